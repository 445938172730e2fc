//! What moves the vertices of a mesh before its node does: morph targets by their weights, and skins by the
//! joints as they stand.

use super::Messages;
use super::nodes::Node;
use glam::{DMat4, Mat4};
use lumiris_formats::gltf::{Document, GltfError, Place};
use lumiris_numbers::math::origin::rebased;
use lumiris_numbers::math::transform::transform_normal;
use lumiris_numbers::math::{Affine3A, DAffine3, DVec3, Vec3};

/// How a mesh is bent.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Pose {
    /// Weights of the morph targets.
    weights: Vec<f32>,
    /// World that is rendered from mesh, by each joint.
    joints: Option<Vec<Affine3A>>,
}

/// Vertices of a primitive.
pub(super) struct Vertices {
    pub positions: Vec<Vec3>,
    pub normals: Vec<Vec3>,
    pub tangents: Vec<Vec3>,
}

fn weights(place: &Place<'_>) -> Option<Vec<f32>> {
    place.exists().then(|| place.items().iter().map(|w| w.number().unwrap_or(0.0)).collect())
}

impl Pose {
    /// The pose of a mesh at a node; `origin` is the one of the world that is rendered.
    pub(super) fn of(
        document: &Document,
        mesh: &Place<'_>,
        node: &Node<'_>,
        (nodes, origin): (&[Node<'_>], DVec3),
    ) -> Result<Self, GltfError> {
        let of_node = || weights(&node.place.key("weights"));
        let weights =
            node.weights.clone().or_else(of_node).or_else(|| weights(&mesh.key("weights"))).unwrap_or_default();
        let Some(skin) = node.place.key("skin").index() else { return Ok(Pose { weights, joints: None }) };
        let skin = document.root().key("skins").item(skin);
        let inverses = match skin.key("inverseBindMatrices").index() {
            Some(index) => document.accessor(index)?.elements::<16>(0.0),
            None => Vec::new(),
        };
        let mut joints = Vec::new();
        for (i, place) in skin.key("joints").items().iter().enumerate() {
            let Some(joint) = nodes.iter().find(|n| Some(n.index) == place.index()) else {
                return Err(place.error("the joint is not in the scene"));
            };
            let inverse = match inverses.get(i) {
                Some(m) => DAffine3::from_mat4(DMat4::from_cols_array(&m.map(f64::from))),
                None if inverses.is_empty() => DAffine3::IDENTITY,
                None => return Err(skin.key("inverseBindMatrices").error("has not one matrix per joint")),
            };
            joints.push(rebased(&(joint.world_from_node * inverse), origin, DVec3::ZERO).as_affine3a());
        }
        Ok(Pose { weights, joints: Some(joints) })
    }

    /// True if vertices become points of the world that is rendered, whatever the transformation of their node.
    pub(super) fn is_skinned(&self) -> bool {
        self.joints.is_some()
    }

    /// Bends the vertices of a primitive.
    pub(super) fn bend(
        &self,
        document: &Document,
        primitive: &Place<'_>,
        vertices: &mut Vertices,
        messages: &mut Messages<'_>,
    ) -> Result<(), GltfError> {
        for (target, &weight) in primitive.key("targets").items().iter().zip(&self.weights).filter(|(_, w)| **w != 0.0)
        {
            let parts = [
                ("POSITION", &mut vertices.positions),
                ("NORMAL", &mut vertices.normals),
                ("TANGENT", &mut vertices.tangents),
            ];
            for (name, values) in parts {
                add_target(document, &target.key(name), weight, values)?;
            }
            if target.names().iter().any(|name| name.starts_with("TEXCOORD") || name.starts_with("COLOR")) {
                messages.warning(target, "morph targets move vertices, not their colours and texture coordinates");
            }
        }
        match &self.joints {
            Some(joints) => skin(document, &primitive.key("attributes"), joints, vertices),
            None => Ok(()),
        }
    }
}

fn add_target(document: &Document, place: &Place<'_>, weight: f32, values: &mut [Vec3]) -> Result<(), GltfError> {
    let Some(index) = place.index().filter(|_| !values.is_empty()) else { return Ok(()) };
    let changes = document.accessor(index)?.elements::<3>(0.0);
    if changes.len() != values.len() {
        return Err(place.error("has not one element per vertex"));
    }
    for (value, change) in values.iter_mut().zip(changes) {
        *value += Vec3::from(change) * weight;
    }
    Ok(())
}

/// Moves each vertex by the weighted mean of its joints' transformations.
fn skin(
    document: &Document,
    attributes: &Place<'_>,
    joints: &[Affine3A],
    vertices: &mut Vertices,
) -> Result<(), GltfError> {
    let count = vertices.positions.len();
    let mut sums = vec![(Mat4::ZERO, 0.0_f32); count];
    for set in 0.. {
        let [of_joints, of_weights] = ["JOINTS", "WEIGHTS"].map(|name| attributes.key(&format!("{name}_{set}")));
        let (Some(indices), Some(weights)) = (of_joints.index(), of_weights.index()) else { break };
        let (indices, weights) =
            (document.accessor(indices)?.elements::<4>(0.0), document.accessor(weights)?.elements::<4>(0.0));
        if indices.len() != count || weights.len() != count {
            return Err(of_joints.error("has not one element per vertex"));
        }
        for (i, (sum, total)) in sums.iter_mut().enumerate() {
            for (&joint, &weight) in indices[i].iter().zip(&weights[i]).filter(|(_, w)| **w > 0.0) {
                let Some(joint) = joints.get(joint as usize) else {
                    return Err(of_joints.error(format!("vertex {i} refers to joint {joint}, of {}", joints.len())));
                };
                *sum += Mat4::from(*joint) * weight;
                *total += weight;
            }
        }
    }
    for (i, (sum, total)) in sums.into_iter().enumerate().filter(|(_, (_, total))| *total > 0.0) {
        let m = Affine3A::from_mat4(sum * (1.0 / total));
        vertices.positions[i] = m.transform_point3(vertices.positions[i]);
        if let Some(n) = vertices.normals.get_mut(i) {
            *n = transform_normal(&m, *n);
        }
        if let Some(t) = vertices.tangents.get_mut(i) {
            *t = m.transform_vector3(*t);
        }
    }
    Ok(())
}
