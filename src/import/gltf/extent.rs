//! The bounds of an animated scene over all of its time, so that an automatic camera is the same in all frames.
//!
//! Boxes of vertices, one per joint of skinned primitives, are transformed by nodes and joints at several times. A
//! vertex is a weighted mean of its transforms by its joints, so it lies within the union of these boxes.

use super::animation::changes;
use super::messages::Messages;
use super::nodes::{Node, instances, middle, nodes};
use super::pose::{Pose, Skins};
use super::view::Framing;
use lumiris_formats::gltf::{Document, GltfError, Place};
use lumiris_numbers::math::origin::{near_origin, rebased};
use lumiris_numbers::math::{Affine3A, Bounds3, DVec3, Vec3};
use std::collections::hash_map::Entry;
use std::collections::{BTreeMap, HashMap};

/// Number of times at which bounds are computed, uniform from the first key to the last.
const TIMES: u16 = 64;

/// Boxes of the vertices of a primitive, in the space of its mesh.
#[derive(Debug, Default)]
struct Boxes {
    /// Boxes by joint; primitives without joints have a single box under 0.
    of_joints: BTreeMap<usize, Bounds3>,
    /// Displacements by each morph target.
    targets: Vec<Bounds3>,
}

/// The bounds of the scene over all of its animations, relative to a point near their centre; `None` without
/// animations.
pub(super) fn of_animations(
    document: &Document,
    scene: &Place<'_>,
    messages: &mut Messages<'_>,
) -> Result<Option<Framing>, GltfError> {
    let Some([first, last]) = keys(document)? else { return Ok(None) };
    let steps = if last > first { TIMES - 1 } else { 0 };
    let mut boxes_of = HashMap::<usize, Vec<Boxes>>::new();
    let (mut bounds, mut origin) = (Bounds3::EMPTY, None);
    for step in 0..=steps {
        // Pose at the time
        let time = first + (last - first) * f32::from(step) / f32::from(steps.max(1));
        let nodes = nodes(document, scene, &changes(document, time, messages)?)?;
        let origin = match origin {
            Some(origin) => origin,
            None => *origin.insert(near_origin(middle(document, &nodes)?)),
        };

        // Bounds of all meshes, from boxes in mesh space
        let mut skins = Skins::new(document, &nodes, origin);
        for node in &nodes {
            let Some(index) = node.mesh else { continue };
            let mesh = document.root().key("meshes").item(index);
            let of_mesh = match boxes_of.entry(index) {
                Entry::Occupied(known) => known.into_mut(),
                Entry::Vacant(new) => {
                    let primitives = mesh.key("primitives").items();
                    new.insert(primitives.map(|p| Boxes::of(document, &p)).collect::<Result<_, _>>()?)
                }
            };
            let pose = Pose::of(&mesh, node, &node.place(document), &mut skins)?;
            for boxes in of_mesh.iter() {
                bounds = bounds.union(boxes.placed(document, node, &pose, origin)?);
            }
        }
    }
    Ok(origin.filter(|_| !bounds.is_empty()).map(|origin| Framing { bounds, origin }))
}

/// Times of the first and the last key of all animations; `None` without keys.
fn keys(document: &Document) -> Result<Option<[f32; 2]>, GltfError> {
    let mut ends: Option<[f32; 2]> = None;
    for animation in document.root().key("animations").items() {
        for index in animation.key("samplers").items().filter_map(|sampler| sampler.key("input").index()) {
            for [time] in document.accessor(index)?.elements::<1>(0.0) {
                let [first, last] = ends.unwrap_or([time; 2]);
                ends = Some([first.min(time), last.max(time)]);
            }
        }
    }
    Ok(ends.filter(|ends| ends.iter().all(|time| time.is_finite())))
}

impl Boxes {
    /// The boxes of a primitive.
    fn of(document: &Document, primitive: &Place<'_>) -> Result<Self, GltfError> {
        let attributes = primitive.key("attributes");
        let points = |place: Place<'_>| -> Result<Vec<Vec3>, GltfError> {
            let Some(index) = place.index() else { return Ok(Vec::new()) };
            Ok(document.accessor(index)?.elements::<3>(0.0).into_iter().map(Vec3::from).collect())
        };

        // Boxes of the morph targets
        let positions = points(attributes.key("POSITION"))?;
        let targets = primitive.key("targets").items().map(|t| Ok(Bounds3::from_points(points(t.key("POSITION"))?)));
        let mut boxes = Boxes { targets: targets.collect::<Result<_, GltfError>>()?, ..Boxes::default() };

        // Boxes of the vertices of each joint
        for set in 0.. {
            let numbers = |name: &str| {
                let (_, place) = attributes.members().find(|(other, _)| *other == format!("{name}_{set}"))?;
                place.index().map(|index| document.accessor(index))
            };
            let (Some(joints), Some(weights)) = (numbers("JOINTS"), numbers("WEIGHTS")) else { break };
            let both = joints?.elements::<4>(0.0).into_iter().zip(weights?.elements::<4>(0.0));
            for (&p, (joints, weights)) in positions.iter().zip(both) {
                for (joint, _) in joints.iter().zip(weights).filter(|(_, w)| *w > 0.0) {
                    let bounds = boxes.of_joints.entry(*joint as usize).or_insert(Bounds3::EMPTY);
                    *bounds = bounds.union_point(p);
                }
            }
        }

        // Without joints, one box
        if boxes.of_joints.is_empty() {
            boxes.of_joints.insert(0, Bounds3::from_points(positions));
        }
        Ok(boxes)
    }

    /// The bounds at a node in a pose, relative to `origin`.
    fn placed(&self, document: &Document, node: &Node, pose: &Pose, origin: DVec3) -> Result<Bounds3, GltfError> {
        let placed = |bounds: &Bounds3, m: &Affine3A| moved(&self.bent(bounds, pose.weights()), m);
        if let Some(joints) = pose.joints() {
            let of_joint = |(&joint, bounds): (&usize, &Bounds3)| Some(placed(bounds, joints.get(joint)?));
            return Ok(self.of_joints.iter().filter_map(of_joint).fold(Bounds3::EMPTY, Bounds3::union));
        }
        let mut all = Bounds3::EMPTY;
        for placement in instances(document, &node.place(document))? {
            let m = rebased(&(node.world_from_node * placement), origin, DVec3::ZERO).as_affine3a();
            all = self.of_joints.values().map(|bounds| placed(bounds, &m)).fold(all, Bounds3::union);
        }
        Ok(all)
    }

    /// A box enlarged by the displacements of morph targets.
    fn bent(&self, bounds: &Bounds3, weights: &[f32]) -> Bounds3 {
        let mut bent = *bounds;
        for (target, &weight) in self.targets.iter().zip(weights).filter(|(target, _)| !target.is_empty()) {
            let (a, b) = (target.min * weight, target.max * weight);
            (bent.min, bent.max) = (bent.min + a.min(b), bent.max + a.max(b));
        }
        bent
    }
}

/// The bounds of a transformed box.
fn moved(bounds: &Bounds3, m: &Affine3A) -> Bounds3 {
    if bounds.is_empty() {
        return *bounds;
    }
    let corner = |i: u32| {
        let of = |axis: usize| if i >> axis & 1 == 0 { bounds.min[axis] } else { bounds.max[axis] };
        m.transform_point3(Vec3::new(of(0), of(1), of(2)))
    };
    Bounds3::from_points((0..8).map(corner))
}
