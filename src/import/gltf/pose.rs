//! Deformation of meshes before the transform of their node: morph targets by their weights, and skins by the current
//! transforms of their joints.

use super::messages::Messages;
use super::nodes::Node;
use super::vertices::InUse;
use glam::{DMat4, Mat4};
use lumiris_formats::gltf::{Document, GltfError, Place};
use lumiris_numbers::math::origin::rebased;
use lumiris_numbers::math::transform::transform_normal;
use lumiris_numbers::math::{Affine3A, DAffine3, DVec3, Vec3};
use std::collections::HashMap;
use std::sync::Arc;

/// The deformation of a mesh.
#[derive(Clone, Debug, Default)]
pub(super) struct Pose {
    /// Weights of the morph targets.
    weights: Vec<f32>,
    /// The skin, and for each of its joints the transform from mesh space to rendered world space.
    skin: Option<(usize, Arc<[Affine3A]>)>,
}

/// Identifies a pose of a mesh: bits of the weights, and the skin.
pub(super) type PoseKey = (Vec<u32>, Option<usize>);

/// The current transforms of joints, once per skin, which meshes may share.
pub(super) struct Skins<'a> {
    document: &'a Document,
    nodes: &'a [Node],
    /// The point of world space that is the origin of rendered space.
    origin: DVec3,
    /// Index in the scene, by index of the node in the file.
    in_scene: HashMap<usize, usize>,
    joints: HashMap<usize, Arc<[Affine3A]>>,
}

impl<'a> Skins<'a> {
    /// The skins of a scene with these nodes.
    pub(super) fn new(document: &'a Document, nodes: &'a [Node], origin: DVec3) -> Self {
        let has_skins = !document.root().key("skins").is_empty();
        let in_scene = nodes.iter().enumerate().filter(|_| has_skins).map(|(i, node)| (node.index, i)).collect();
        Skins { document, nodes, origin, in_scene, joints: HashMap::new() }
    }

    /// For each joint, the transform from mesh space to rendered world space.
    fn joints(&mut self, index: usize) -> Result<Arc<[Affine3A]>, GltfError> {
        if let Some(joints) = self.joints.get(&index) {
            return Ok(Arc::clone(joints));
        }

        // Without inverse bind matrices, all are the identity
        let skin = self.document.root().key("skins").item(index);
        let inverses = match skin.key("inverseBindMatrices").index() {
            Some(index) => self.document.accessor(index)?.elements::<16>(0.0),
            None => Vec::new(),
        };
        let mut joints = Vec::new();
        for (i, place) in skin.key("joints").items().enumerate() {
            let Some(&joint) = place.index().and_then(|joint| self.in_scene.get(&joint)) else {
                return Err(place.error("the joint is not in the scene"));
            };
            let inverse = match inverses.get(i) {
                Some(m) => DAffine3::from_mat4(DMat4::from_cols_array(&m.map(f64::from))),
                None if inverses.is_empty() => DAffine3::IDENTITY,
                None => return Err(skin.key("inverseBindMatrices").error("has not one matrix per joint")),
            };
            let world_from_mesh = self.nodes[joint].world_from_node * inverse;
            joints.push(rebased(&world_from_mesh, self.origin, DVec3::ZERO).as_affine3a());
        }
        let joints: Arc<[Affine3A]> = joints.into();
        self.joints.insert(index, Arc::clone(&joints));
        Ok(joints)
    }
}

/// Vertices of a primitive.
pub(super) struct Vertices {
    pub positions: Vec<Vec3>,
    pub normals: Vec<Vec3>,
    pub tangents: Vec<Vec3>,
}

fn weights(place: &Place<'_>) -> Option<Vec<f32>> {
    place.exists().then(|| place.items().map(|w| w.number().unwrap_or(0.0)).collect())
}

impl Pose {
    /// The pose of a mesh at a node, which is `of_node` in the file.
    pub(super) fn of(
        mesh: &Place<'_>,
        node: &Node,
        of_node: &Place<'_>,
        skins: &mut Skins<'_>,
    ) -> Result<Self, GltfError> {
        let by_node = || weights(&of_node.key("weights"));
        let weights =
            node.weights.clone().or_else(by_node).or_else(|| weights(&mesh.key("weights"))).unwrap_or_default();
        let skin = of_node.key("skin").index();
        let skin = skin.map(|skin| Ok((skin, skins.joints(skin)?))).transpose()?;
        Ok(Pose { weights, skin })
    }

    /// Weights of the morph targets.
    pub(super) fn weights(&self) -> &[f32] {
        &self.weights
    }

    /// For each joint, the transform from mesh space to rendered world space; `None` without joints.
    pub(super) fn joints(&self) -> Option<&[Affine3A]> {
        self.skin.as_ref().map(|(_, joints)| &**joints)
    }

    /// Identifies the pose among the poses of the mesh.
    pub(super) fn key(&self) -> PoseKey {
        (self.weights.iter().map(|w| w.to_bits()).collect(), self.skin.as_ref().map(|(skin, _)| *skin))
    }

    /// True if vertices are transformed to rendered world space, independent of the transform of their node.
    pub(super) fn is_skinned(&self) -> bool {
        self.skin.is_some()
    }

    /// Deforms the vertices of a primitive.
    pub(super) fn bend(
        &self,
        document: &Document,
        primitive: &Place<'_>,
        in_use: &InUse,
        vertices: &mut Vertices,
        messages: &mut Messages<'_>,
    ) -> Result<(), GltfError> {
        // Morph targets
        for (target, &weight) in primitive.key("targets").items().zip(&self.weights).filter(|(_, w)| **w != 0.0) {
            let parts = [
                ("POSITION", &mut vertices.positions),
                ("NORMAL", &mut vertices.normals),
                ("TANGENT", &mut vertices.tangents),
            ];
            for (name, values) in parts {
                add_target(document, &target.key(name), in_use, weight, values)?;
            }
            if target.members().any(|(name, _)| name.starts_with("TEXCOORD") || name.starts_with("COLOR")) {
                messages.warning(&target, "morph targets move vertices, not their colours and texture coordinates");
            }
        }

        // Skin
        match &self.skin {
            Some((_, joints)) => skin(document, &primitive.key("attributes"), in_use, joints, vertices),
            None => Ok(()),
        }
    }
}

fn add_target(
    document: &Document,
    place: &Place<'_>,
    in_use: &InUse,
    weight: f32,
    values: &mut [Vec3],
) -> Result<(), GltfError> {
    if values.is_empty() {
        return Ok(());
    }
    for (value, change) in values.iter_mut().zip(in_use.read::<3>(document, place, 0.0)?) {
        *value += Vec3::from(change) * weight;
    }
    Ok(())
}

/// Transforms each vertex by the weighted mean of its joints' transforms.
fn skin(
    document: &Document,
    attributes: &Place<'_>,
    in_use: &InUse,
    joints: &[Affine3A],
    vertices: &mut Vertices,
) -> Result<(), GltfError> {
    // Weighted sums of joint transforms; each set has four joints per vertex
    let mut sums = vec![(Mat4::ZERO, 0.0_f32); vertices.positions.len()];
    for set in 0.. {
        let attribute = |name: &str| attributes.members().find(|(other, _)| *other == format!("{name}_{set}"));
        let (Some((_, of_joints)), Some((_, of_weights))) = (attribute("JOINTS"), attribute("WEIGHTS")) else { break };
        let (indices, weights) =
            (in_use.read::<4>(document, &of_joints, 0.0)?, in_use.read::<4>(document, &of_weights, 0.0)?);
        for (i, (sum, total)) in sums.iter_mut().enumerate() {
            for (&joint, &weight) in indices[i].iter().zip(&weights[i]).filter(|(_, w)| **w > 0.0) {
                let Some(joint) = joints.get(joint as usize) else {
                    let (i, count) = (in_use.vertex(i), joints.len());
                    return Err(of_joints.error(format!("vertex {i} refers to joint {joint}, of {count}")));
                };
                *sum += Mat4::from(*joint) * weight;
                *total += weight;
            }
        }
    }

    // Transform positions, normals and tangents
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
