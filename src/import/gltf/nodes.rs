//! The tree of nodes with their transforms.

use super::animation::{Change, Changes};
use glam::{DMat4, DQuat};
use lumiris_formats::gltf::{Document, GltfError, Place};
use lumiris_numbers::math::{DAffine3, DVec3};
use std::collections::HashSet;

/// A node of the scene with its transform.
pub(super) struct Node {
    /// Index of the node.
    pub index: usize,
    /// Index of its mesh, if it is visible.
    pub mesh: Option<usize>,
    /// False if the node or a parent is hidden by `KHR_node_visibility`. Hidden nodes have no meshes and lights, but
    /// keep cameras and joints.
    pub is_visible: bool,
    pub world_from_node: DAffine3,
    /// Animated weights of morph targets.
    pub weights: Option<Vec<f32>>,
}

impl Node {
    /// Its position in the file.
    pub(super) fn place<'d>(&self, document: &'d Document) -> Place<'d> {
        document.root().key("nodes").item(self.index)
    }
}

/// All nodes of a scene, parents first, with their animated properties; without a scene, all root nodes and their
/// descendants. A node that is reached twice is an error, which also excludes cycles.
pub(super) fn nodes<'d>(document: &'d Document, scene: &Place<'d>, changes: &Changes) -> Result<Vec<Node>, GltfError> {
    let all = document.root().key("nodes");
    let count = all.len();
    let at_root = |i| (i, DAffine3::IDENTITY, true);

    // Roots
    let mut open: Vec<(usize, DAffine3, bool)> = if scene.exists() {
        scene.key("nodes").items().filter_map(|root| root.index()).map(at_root).collect()
    } else {
        let children: HashSet<usize> =
            all.items().flat_map(|n| n.key("children").items()).filter_map(|child| child.index()).collect();
        (0..count).filter(|i| !children.contains(i)).map(at_root).collect()
    };

    // Depth-first traversal in the order of the file
    open.reverse();
    let mut is_met = vec![false; count];
    let mut nodes = Vec::with_capacity(count);
    while let Some((index, parent, is_parent_visible)) = open.pop() {
        let place = all.item(index);
        match is_met.get_mut(index) {
            Some(met) if !*met => *met = true,
            Some(_) => return Err(place.error("the node has two parents, or is its own ancestor")),
            None => return Err(place.error("is not there")),
        }
        let change = changes.get(&index).cloned().unwrap_or_default();
        let world_from_node = parent * transform(&place, &change);
        let is_hidden = place.extension("KHR_node_visibility").key("visible").flag() == Some(false);
        let is_visible = is_parent_visible && !is_hidden;
        let children = place.key("children").items().rev().filter_map(|child| child.index());
        open.extend(children.map(|i| (i, world_from_node, is_visible)));
        let mesh = place.key("mesh").index().filter(|_| is_visible);
        nodes.push(Node { mesh, is_visible, index, world_from_node, weights: change.weights });
    }
    Ok(nodes)
}

fn transform(place: &Place<'_>, change: &Change) -> DAffine3 {
    if let Some(m) = place.key("matrix").doubles::<16>() {
        return DAffine3::from_mat4(DMat4::from_cols_array(&m));
    }
    let [translation, scale] =
        [("translation", change.translation, 0.0), ("scale", change.scale, 1.0)].map(|(name, change, default)| {
            let given = change.map(|v| v.map(f64::from)).or_else(|| place.key(name).doubles());
            DVec3::from(given.unwrap_or([default; 3]))
        });
    let rotation = change.rotation.map(|q| q.map(f64::from)).or_else(|| place.key("rotation").doubles());
    let rotation = unit(rotation.unwrap_or([0.0, 0.0, 0.0, 1.0]));
    DAffine3::from_scale_rotation_translation(scale, rotation, translation)
}

/// The rotation of a quaternion of any length; the identity for zero.
fn unit(q: [f64; 4]) -> DQuat {
    let q = DQuat::from_array(q);
    if q.length_squared() > 0.0 { q.normalize() } else { DQuat::IDENTITY }
}

/// The centre of the meshes of a scene, by the bounds of their accessors.
pub(super) fn middle(document: &Document, nodes: &[Node]) -> Result<DVec3, GltfError> {
    let [meshes, accessors] = ["meshes", "accessors"].map(|key| document.root().key(key));
    let (mut min, mut max) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for node in nodes {
        let Some(mesh) = node.mesh else { continue };
        let placements = instances(document, &node.place(document))?;
        for primitive in meshes.item(mesh).key("primitives").items() {
            let positions = primitive.key("attributes").key("POSITION").index();
            let accessor = accessors.item(positions.unwrap_or(usize::MAX));
            let corner = |key: &str| accessor.key(key).doubles().map_or(DVec3::ZERO, DVec3::from_array);
            let center = (corner("min") + corner("max")) * 0.5;
            let centers = placements.iter().map(|m| node.world_from_node.transform_point3(m.transform_point3(center)));
            (min, max) = centers.fold((min, max), |(min, max), p| (min.min(p), max.max(p)));
        }
    }
    Ok((min + max) * 0.5)
}

/// Transforms by `EXT_mesh_gpu_instancing`, relative to the node; a single identity without the extension.
pub(super) fn instances(document: &Document, place: &Place<'_>) -> Result<Vec<DAffine3>, GltfError> {
    let attributes = place.extension("EXT_mesh_gpu_instancing").key("attributes");
    let numbers = |name: &str| attributes.key(name).index().map(|i| document.accessor(i)).transpose();
    let [translations, rotations, scales] = [numbers("TRANSLATION")?, numbers("ROTATION")?, numbers("SCALE")?];
    let translations = translations.map(|n| n.elements::<3>(0.0));
    let rotations = rotations.map(|n| n.elements::<4>(0.0));
    let scales = scales.map(|n| n.elements::<3>(1.0));
    let counts = [translations.as_ref().map(Vec::len), rotations.as_ref().map(Vec::len), scales.as_ref().map(Vec::len)];
    let Some(&count) = counts.iter().flatten().min() else { return Ok(vec![DAffine3::IDENTITY]) };
    let placement = |i: usize| {
        let rotation = rotations.as_ref().map_or(DQuat::IDENTITY, |r| unit(r[i].map(f64::from)));
        let scale = scales.as_ref().map_or(DVec3::ONE, |s| DVec3::from(s[i].map(f64::from)));
        let translation = translations.as_ref().map_or(DVec3::ZERO, |t| DVec3::from(t[i].map(f64::from)));
        DAffine3::from_scale_rotation_translation(scale, rotation, translation)
    };
    Ok((0..count).map(placement).collect())
}
