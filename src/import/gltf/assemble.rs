//! Geometry and lights of the scene.

use super::animation::changes;
use super::choice::{Names, chosen, name_of, shown};
use super::extent;
use super::materials::{Look, Materials};
use super::meshes::{Primitive, primitive};
use super::messages::Messages;
use super::nodes::{Node, instances, middle, nodes};
use super::pose::{Pose, PoseKey, Skins};
use super::textures::{EmissionKey, EmissionSource};
use super::view::{Framing, View, cameras, chosen_camera, view};
use crate::geometry::{Geometry, GeometryId, GeometrySet, Group, Instance, Shape, TriangleMesh, Visibility};
use crate::imaging::Filter;
use crate::imaging::oiio::ImageError;
use crate::import::LoadOptions;
use crate::import::cache::FileCache;
use crate::import::images::RgbImage;
use crate::import::memory::{MemoryAccount, ShapeSize};
use crate::import::resources::report;
use crate::lights::{
    AlphaMask, DistantLight, Emission, EmissionImage, EnvironmentFilter, EnvironmentMap, EnvironmentMapping, Light,
    LightSet, LightSetBuilder, PointLight, SpotLight,
};
use crate::materials::{MaterialId, MaterialSet};
use crate::media::{Homogeneous, Medium, MediumId, MediumSet, Sides};
use crate::scene::{Choices, Scene, Surface};
use crate::textures::TextureSet;
use glam::Vec3A;
use lumiris_formats::gltf::{Document, GltfError, Place};
use lumiris_numbers::math::origin::{near_origin, rebased};
use lumiris_numbers::math::{Affine3A, Bounds3, DAffine3, DVec3, Rgb, Vec3};
use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// An emitting geometry.
struct Emitter {
    geometry: GeometryId,
    emission: Emission,
}

/// The chosen scene of a file.
struct ChosenScene<'a> {
    place: Place<'a>,
    /// The choices of scenes.
    choices: Choices,
}

/// A scene during its assembly.
pub(super) struct Assembly<'a> {
    document: &'a Document,
    options: &'a LoadOptions,
    materials: Materials<'a>,
    set: GeometrySet,
    surfaces: Vec<Surface>,
    emitters: Vec<Emitter>,
    emission_images: HashMap<EmissionKey, Option<Arc<EmissionImage>>>,
    lights: Vec<Light>,
    media: MediumSet,
    /// Media inside of materials.
    interiors: HashMap<MaterialId, MediumId>,
    /// The point of world space that is the origin of the rendered world.
    origin: DVec3,
}

impl<'a> Assembly<'a> {
    pub(super) fn new(document: &'a Document, options: &'a LoadOptions) -> Result<Self, GltfError> {
        let failed = |e: std::io::Error| document.root().error(e.to_string());
        Ok(Assembly {
            document,
            options,
            materials: Materials::new(document).map_err(failed)?,
            set: GeometrySet::default(),
            surfaces: Vec::new(),
            emitters: Vec::new(),
            emission_images: HashMap::new(),
            lights: Vec::new(),
            media: MediumSet::default(),
            interiors: HashMap::new(),
            origin: DVec3::ZERO,
        })
    }

    /// Builds the scene; its files are appended to `others`.
    pub(super) fn scene(
        mut self,
        files: &FileCache,
        others: &mut Vec<PathBuf>,
        messages: &mut Messages<'_>,
    ) -> Result<Option<Scene>, GltfError> {
        // Materials, and the files of the scene
        self.materials.read(messages)?;
        others.extend(self.materials.textures.files());
        others.extend(self.options.environment.clone());
        if !self.document.unread.is_empty() {
            // Nothing can be built, but other missing files are reported at once
            self.check_images(files, messages);
            return Ok(None);
        }

        // Nodes of the scene, at a time of the animation
        let changes = self.options.time.map(|time| changes(self.document, time, messages)).transpose()?;
        let Some(ChosenScene { place, mut choices }) = self.chosen_scene(messages) else { return Ok(None) };
        let nodes = nodes(self.document, &place, &changes.unwrap_or_default())?;

        // Camera, and the origin of the rendered world near it
        let cameras = cameras(self.document, &nodes, messages);
        let found = chosen_camera(self.options, &cameras, messages);
        choices.cameras = shown(&cameras.names);
        choices.camera = found.as_ref().and_then(|found| cameras.index_of(found)).filter(|&i| i > 0);
        let framing = self.framing(&place, found.is_none(), messages)?;
        self.origin = match (&found, &framing) {
            (Some(found), _) => near_origin(found.node.world_from_node.translation),
            (None, Some(framing)) => framing.origin,
            (None, None) => near_origin(middle(self.document, &nodes)?),
        };

        // Meshes and lights
        if let Err(error) = self.add_meshes(&nodes, files, messages) {
            messages.error(&error);
        }
        nodes.iter().for_each(|node| self.add_light(node, messages));
        let bounds = self.set.world_bounds();
        if self.set.geometries.is_empty() {
            messages.warning(&self.document.root().key("meshes"), "the scene has no meshes to render");
        }
        let view = view(self.options, found, &framing.unwrap_or(Framing { bounds, origin: self.origin }));
        self.add_environment(files, messages);
        Ok(self.finished(view, choices, &bounds, files, messages))
    }

    /// The framing of an automatic camera that is common to all frames of an animation, if there is one.
    fn framing(
        &self,
        scene: &Place<'a>,
        is_automatic: bool,
        messages: &mut Messages<'_>,
    ) -> Result<Option<Framing>, GltfError> {
        let is_animated = self.options.time.is_some();
        if is_automatic && is_animated { extent::of_animations(self.document, scene, messages) } else { Ok(None) }
    }

    /// The environment of the options; without any light, white.
    fn add_environment(&mut self, files: &FileCache, messages: &mut Messages<'_>) {
        if let Some(path) = &self.options.environment {
            self.lights.extend(environment(path, files, messages));
        } else if self.lights.is_empty() && self.emitters.is_empty() {
            messages.warning(&self.document.root().key("scenes"), "no light: all around is white (--environment FILE)");
            self.lights.push(Light::InfiniteConstant { l: Rgb::WHITE });
        }
    }

    /// Reads the images, and builds the scene of the assembled parts; `None` after an error.
    fn finished(
        mut self,
        view: View,
        choices: Choices,
        bounds: &Bounds3,
        files: &FileCache,
        messages: &mut Messages<'_>,
    ) -> Option<Scene> {
        let mut account = if files.memory_limit().is_some() { self.account() } else { MemoryAccount::default() };
        account.reserve_image(view.film.bounds.area());
        let textures = &mut self.materials.textures;
        textures.set.images = textures.resources.load(files, account, messages.diagnostics)?;
        if messages.diagnostics.has_errors() {
            return None;
        }
        let geometry = Arc::new(self.set);
        let textures = Arc::new(self.materials.textures.set);
        let lights = light_set(self.lights, self.emitters, &geometry, &textures, bounds);
        let materials = MaterialSet::new(self.materials.entries, &textures).find_caustics(&textures);
        Some(Scene {
            camera: view.camera,
            film: view.film,
            materials,
            textures,
            lights: Arc::new(lights),
            geometry,
            surfaces: self.surfaces,
            media: self.media,
            choices,
            origin: self.origin,
        })
    }

    /// The memory that the geometry will take, whose arrays are in memory.
    fn account(&self) -> MemoryAccount {
        let set = &self.set;
        let mut group_of = vec![None; set.geometries.len()];
        for (i, group) in set.groups.iter().enumerate() {
            group.geometries.iter().for_each(|&geometry| group_of[geometry as usize] = Some(i));
        }
        let emitting: HashSet<GeometryId> = self.emitters.iter().map(|emitter| emitter.geometry).collect();
        let size = |(i, geometry): (usize, &Geometry)| ShapeSize {
            name: Some(self.surfaces[i].name.to_string()),
            bytes: 0,
            primitives: if let Shape::Mesh(mesh) = &geometry.shape { mesh.triangle_count() as u64 } else { 0 },
            emits: emitting.contains(&(i as GeometryId)),
            group: group_of[i],
        };
        let mut account = MemoryAccount::now();
        account.add_geometry(set.geometries.iter().enumerate().map(size), set.groups.len(), set.instances.len());
        account
    }

    /// The requested scene, or the default of the file.
    fn chosen_scene(&self, messages: &mut Messages<'_>) -> Option<ChosenScene<'a>> {
        let scenes = self.document.root().key("scenes");
        let names: Names<'a> = scenes.items().map(|scene| [name_of(&scene), None]).collect();
        let usual = self.document.root().key("scene").index().unwrap_or(0);
        let index = match &self.options.scene {
            Some(wanted) => chosen(["scene", "--scene-in-file"], wanted, &names),
            None => Ok(usual),
        };
        match index {
            Ok(index) => {
                let scene = (index != usual).then_some(index);
                let choices = Choices { scenes: shown(&names), scene, ..Choices::default() };
                Some(ChosenScene { place: scenes.item(index), choices })
            }
            Err(message) => {
                messages.diagnostics.error_without_place(message);
                None
            }
        }
    }

    /// Reads all images, for their errors.
    fn check_images(&self, files: &FileCache, messages: &mut Messages<'_>) {
        for look in self.materials.looks.iter().filter(|look| !look.emission.is_black()) {
            look.emission_image.as_ref().map(|source| emission_image(source, files, messages));
        }
        if let Some(path) = &self.options.environment {
            environment(path, files, messages);
        }
        self.materials.textures.resources.load(files, MemoryAccount::default(), messages.diagnostics);
    }

    /// Adds all meshes, once for every pose.
    fn add_meshes(&mut self, nodes: &[Node], files: &FileCache, messages: &mut Messages<'_>) -> Result<(), GltfError> {
        let meshes = self.document.root().key("meshes");
        let mut users: Vec<Vec<u32>> = vec![Vec::new(); meshes.len()];
        for (i, node) in nodes.iter().enumerate() {
            if let Some(list) = node.mesh.and_then(|mesh| users.get_mut(mesh)) {
                list.push(i as u32);
            }
        }
        let mut skins = Skins::new(self.document, nodes, self.origin);
        for (place, users) in meshes.items().zip(users) {
            // In the order of the nodes
            let mut poses: Vec<(Pose, Vec<u32>)> = Vec::new();
            let mut indices: HashMap<PoseKey, usize> = HashMap::new();
            for i in users {
                let node = &nodes[i as usize];
                let of_node = node.place(self.document);
                instances(self.document, &of_node)?;
                let pose = Pose::of(&place, node, &of_node, &mut skins)?;
                let index = *indices.entry(pose.key()).or_insert_with(|| {
                    poses.push((pose, Vec::new()));
                    poses.len() - 1
                });
                poses[index].1.push(i);
            }
            for (pose, users) in &poses {
                let users: Vec<&Node> = users.iter().map(|&i| &nodes[i as usize]).collect();
                self.add_mesh(&place, pose, &users, files, messages)?;
            }
        }
        Ok(())
    }

    /// Primitives that are used once, that emit, or that are flattened, are in world space. Others are a group with
    /// instances, whose transforms have inverses.
    fn add_mesh(
        &mut self,
        place: &Place<'a>,
        pose: &Pose,
        users: &[&Node],
        files: &FileCache,
        messages: &mut Messages<'_>,
    ) -> Result<(), GltfError> {
        let name = Arc::from(place.key("name").text().unwrap_or("mesh"));
        let (document, to) = (self.document, self.origin);
        let placements = || users.iter().flat_map(move |node| placements(document, node, pose, to));

        // Number of placements, and of those with an inverse
        let (mut count, mut invertible) = (0, 0);
        for m in placements() {
            (count, invertible) = (count + 1, invertible + usize::from(has_inverse(&m)));
        }
        if count == 0 {
            return Ok(());
        }

        // Primitives: in the group, or in world space for each placement
        let mut group = Vec::new();
        let mut origin = None;
        let rendered =
            |m: &DAffine3, origin: Option<DVec3>| rebased(m, to, origin.unwrap_or(DVec3::ZERO)).as_affine3a();
        for place in place.key("primitives").items() {
            let Some(Primitive { mut mesh, material }) = primitive(self.document, &place, pose, &mut origin, messages)?
            else {
                continue;
            };
            let looks = &self.materials.looks;
            let look = looks[material.unwrap_or(looks.len() - 1).min(looks.len() - 1)].clone();
            mesh.tangents_along_second = look.tangents_along_second;
            let is_instanced = invertible > 1 && look.emission.is_black();
            if is_instanced && invertible == count {
                group.push(self.add_geometry(mesh, &look, &name));
                continue;
            }
            if is_instanced {
                group.push(self.add_geometry(mesh.clone(), &look, &name));
            }
            for m in placements().filter(|m| !is_instanced || !has_inverse(m)) {
                let id = self.add_geometry(mesh.transformed(&rendered(&m, origin)), &look, &name);
                self.set.root.geometries.push(id);
                self.add_emission(id, &look, files, messages);
            }
        }

        // Instances of the group
        if !group.is_empty() {
            let id = self.set.groups.len() as u32;
            self.set.groups.push(Group { geometries: group });
            let instance = |m: DAffine3| Instance { group: id, world_from_group: vec![rendered(&m, origin)] };
            self.set.instances.extend(placements().filter(has_inverse).map(instance));
        }
        Ok(())
    }

    fn add_geometry(&mut self, mesh: TriangleMesh, look: &Look, name: &Arc<str>) -> GeometryId {
        self.set.geometries.push(Geometry { shape: Shape::Mesh(mesh), alpha: look.alpha, visibility: Visibility::ALL });
        let sides = look.interior.as_ref().map(|medium| Sides { front: None, back: Some(self.interior(look, medium)) });
        self.surfaces.push(Surface { material: look.material, name: Arc::clone(name), sides });
        (self.set.geometries.len() - 1) as GeometryId
    }

    /// The medium inside of a material.
    fn interior(&mut self, look: &Look, medium: &Homogeneous) -> MediumId {
        *self.interiors.entry(look.material).or_insert_with(|| {
            self.media.media.push(Medium::Homogeneous(*medium));
            self.media.names.push(self.materials.entries[look.material as usize].name.clone());
            (self.media.media.len() - 1) as MediumId
        })
    }

    fn add_emission(&mut self, id: GeometryId, look: &Look, files: &FileCache, messages: &mut Messages<'_>) {
        if look.emission.is_black() {
            return;
        }
        let image = look.emission_image.as_ref().and_then(|source| {
            let read = || emission_image(source, files, messages);
            self.emission_images.entry(source.key()).or_insert_with(read).clone()
        });
        let (two_sided, has_vertex_colors) = (look.is_double_sided, look.emits_vertex_colors);
        let emission = Emission { two_sided, image, has_vertex_colors, ..Emission::constant(look.emission) };
        self.emitters.push(Emitter { geometry: id, emission });
    }

    /// `KHR_lights_punctual`: lights shine along −z.
    fn add_light(&mut self, node: &Node, messages: &mut Messages<'_>) {
        let light = node.place(self.document).extension("KHR_lights_punctual").key("light").index();
        let Some(index) = light.filter(|_| node.is_visible) else { return };
        let light = self.document.root().extension("KHR_lights_punctual").key("lights").item(index);

        // Intensity or irradiance, in the units of the options
        let color = Rgb::from_array(light.key("color").numbers().unwrap_or([1.0; 3])).map(|c| c.max(0.0));
        let per_candela = self.options.light_units.unwrap_or_default().per_candela();
        let intensity = color * (light.key("intensity").number().unwrap_or(1.0).max(0.0) * per_candela);
        let m = &rebased(&node.world_from_node, self.origin, DVec3::ZERO).as_affine3a();
        if !m.is_finite() {
            return;
        }
        if light.key("range").exists() {
            messages
                .warning(&light.key("range"), "lights have no range: they fall off with the square of the distance");
        }

        // Light
        let p = m.transform_point3(Vec3::ZERO);
        let axis = m.transform_vector3(-Vec3::Z).normalize_or(-Vec3::Z);
        match light.key("type").text() {
            Some("directional") => self.lights.push(Light::Distant(DistantLight { wi: -axis, irradiance: intensity })),
            Some("spot") => {
                let angle = |key: &str, default: f32| light.key("spot").key(key).number().unwrap_or(default).cos();
                let cos_total = angle("outerConeAngle", std::f32::consts::FRAC_PI_4);
                let cos_falloff_start = angle("innerConeAngle", 0.0).max(cos_total);
                self.lights.push(Light::Spot(SpotLight { p, axis, cos_total, cos_falloff_start, intensity }));
            }
            _ => self.lights.push(Light::Point(PointLight { p, intensity })),
        }
    }
}

/// Finite transforms of the mesh of a node in a pose. They are recomputed at each use, since a scene may have 10⁶
/// nodes.
fn placements<'n>(
    document: &Document,
    node: &'n Node,
    pose: &Pose,
    origin: DVec3,
) -> impl Iterator<Item = DAffine3> + use<'n> {
    // Joints lead to rendered world space
    let world_from_node = if pose.is_skinned() { DAffine3::from_translation(origin) } else { node.world_from_node };
    // Errors of the instances were reported before
    let within = instances(document, &node.place(document)).unwrap_or_default();
    within.into_iter().map(move |m| world_from_node * m).filter(|m| m.as_affine3a().is_finite())
}

/// False for transforms that are singular, or nearly singular in f32.
fn has_inverse(m: &DAffine3) -> bool {
    let m = m.as_affine3a();
    m.matrix3.determinant() != 0.0 && m.inverse().is_finite()
}

/// All lights; area lights are the last.
fn light_set(
    lights: Vec<Light>,
    emitters: Vec<Emitter>,
    geometry: &Arc<GeometrySet>,
    textures: &Arc<TextureSet>,
    bounds: &Bounds3,
) -> LightSet {
    let mut set = LightSetBuilder::default();
    for light in lights {
        set.add(light);
    }
    for Emitter { geometry: id, emission } in emitters {
        let alpha = AlphaMask::of(geometry, id, Arc::clone(textures) as _);
        set.add_area(id, &geometry.geometries[id as usize].shape, &Emission { alpha, ..emission });
    }
    set.build(bounds)
}

fn emission_image(
    source: &EmissionSource,
    files: &FileCache,
    messages: &mut Messages<'_>,
) -> Option<Arc<EmissionImage>> {
    let image =
        files.rgb(&source.path).map_err(|error| report(&error, &source.path, source.span, messages.diagnostics));
    let RgbImage { texels, size: [width, height] } = Arc::unwrap_or_clone(image.ok()?);
    let image = EmissionImage::new(width, height, texels).ok()?.placed(source.wrap, source.mapping);
    Some(Arc::new(if source.filter == Filter::Point { image.nearest() } else { image }))
}

/// An environment map whose z axis becomes the y axis of the scene. Its centre is in direction +x, and it appears as
/// stored: columns of pbrt's maps are counter-clockwise about z, so the map is mirrored.
fn environment(path: &Path, files: &FileCache, messages: &mut Messages<'_>) -> Option<Light> {
    // Image
    let d = &mut *messages.diagnostics;
    let failed = |error: ImageError| match error {
        ImageError::NotFound { .. } => d.missing_file(path, "no such file, asked for by --environment", None),
        other => {
            d.error_without_place(format!("--environment: {other}"));
        }
    };
    let RgbImage { texels, size } = Arc::unwrap_or_clone(files.rgb(path).map_err(failed).ok()?);

    // Map
    let mapping = if size[0] == size[1] { EnvironmentMapping::EqualArea } else { EnvironmentMapping::LatLong };
    match EnvironmentMap::new(texels, size, mapping, EnvironmentFilter::Nearest) {
        Ok(map) => {
            let world_from_map = Affine3A::from_cols(-Vec3A::X, -Vec3A::Z, Vec3A::Y, Vec3A::ZERO);
            Some(Light::infinite_image(Arc::new(map), &world_from_map, 1.0))
        }
        Err(reason) => {
            messages.diagnostics.error_without_place(format!("--environment: {}: {reason}", path.display()));
            None
        }
    }
}
