//! Geometry, lights and camera of the scene.

use super::materials::{Look, Materials};
use super::meshes::{Primitive, placed, primitive};
use super::nodes::{Node, instances, nodes};
use super::{LUMENS_PER_WATT, Messages};
use crate::cameras::Camera;
use crate::film::PixelBounds;
use crate::film::filter::PixelFilter;
use crate::geometry::{Geometry, GeometryId, GeometrySet, Group, Instance, Shape, TriangleMesh, Visibility};
use crate::import::LoadOptions;
use crate::import::cache::FileCache;
use crate::import::resources::report;
use crate::lights::{
    Emission, EmissionImage, EnvironmentFilter, EnvironmentMap, EnvironmentMapping, Light, LightSetBuilder,
};
use crate::materials::MaterialSet;
use crate::scene::{FilmSettings, Scene, Surface};
use lumiris_formats::gltf::{Document, GltfError, Place};
use lumiris_formats::source::Span;
use lumiris_numbers::math::{Affine3A, Bounds3, Rgb, Vec3};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Height of an image whose size nobody gives.
const HEIGHT: u32 = 720;
/// Angle of view of the camera that frames a scene (degrees).
const AUTO_FOV: f32 = 40.0;
/// Direction from the scene to that camera.
const AUTO_DIRECTION: Vec3 = Vec3::new(0.5, 0.35, 0.8);

/// A scene while it is assembled.
pub(super) struct Assembly<'a> {
    document: &'a Document,
    options: &'a LoadOptions,
    materials: Materials<'a>,
    set: GeometrySet,
    surfaces: Vec<Surface>,
    emitters: Vec<(GeometryId, Emission)>,
    lights: Vec<Light>,
}

impl<'a> Assembly<'a> {
    pub(super) fn new(document: &'a Document, options: &'a LoadOptions) -> Result<Self, GltfError> {
        let failed = |e: std::io::Error| GltfError { place: String::new(), message: e.to_string() };
        Ok(Assembly {
            document,
            options,
            materials: Materials::new(document).map_err(failed)?,
            set: GeometrySet::default(),
            surfaces: Vec::new(),
            emitters: Vec::new(),
            lights: Vec::new(),
        })
    }

    /// The scene; files that it was read from are added to `others`.
    pub(super) fn scene(
        mut self,
        files: &FileCache,
        others: &mut Vec<PathBuf>,
        messages: &mut Messages<'_>,
    ) -> Result<Option<Scene>, GltfError> {
        self.materials.read(messages)?;
        others.extend(self.materials.files());
        others.extend(self.options.environment.clone());
        let nodes = nodes(self.document)?;
        self.add_meshes(&nodes, files, messages)?;
        nodes.iter().for_each(|node| self.add_light(node));
        let bounds = self.set.world_bounds();
        let (camera, film) = self.camera(&nodes, &bounds, messages);
        if let Some(path) = &self.options.environment {
            self.lights.extend(environment(path, files, messages));
        } else if self.lights.is_empty() && self.emitters.is_empty() {
            messages.warning(&self.document.root().key("scenes"), "no light: all around is white (--environment FILE)");
            self.lights.push(Light::InfiniteConstant { l: Rgb::WHITE });
        }
        self.materials.textures.images = self.materials.resources.load(files, messages.diagnostics);
        if messages.diagnostics.has_errors() {
            return Ok(None);
        }
        let mut lights = LightSetBuilder::default();
        for light in self.lights {
            lights.add(light);
        }
        for (geometry, emission) in &self.emitters {
            lights.add_area(*geometry, &self.set.geometries[*geometry as usize].shape, emission);
        }
        let materials = MaterialSet::new(self.materials.entries, &self.materials.textures);
        Ok(Some(Scene {
            camera,
            film,
            materials,
            textures: Arc::new(self.materials.textures),
            lights: Arc::new(lights.build(&bounds)),
            geometry: Arc::new(self.set),
            surfaces: self.surfaces,
        }))
    }

    /// Meshes that stand once, or that emit, are placed in world space; others are groups with instances.
    fn add_meshes(
        &mut self,
        nodes: &[Node<'a>],
        files: &FileCache,
        messages: &mut Messages<'_>,
    ) -> Result<(), GltfError> {
        for (index, place) in self.document.root().key("meshes").items().iter().enumerate() {
            let mut placements = Vec::new();
            for node in nodes.iter().filter(|n| n.place.key("mesh").index() == Some(index)) {
                if node.place.key("skin").exists() {
                    messages.warning(&node.place.key("skin"), "skins are not applied");
                }
                let of_node = instances(self.document, &node.place)?;
                placements.extend(of_node.into_iter().map(|m| node.world_from_node * m));
            }
            // What has no inverse is flat, and has no normals
            placements.retain(|m| m.is_finite() && m.matrix3.determinant() != 0.0);
            if placements.is_empty() {
                continue;
            }
            let name = place.key("name").text().unwrap_or("mesh").to_owned();
            let mut group = Vec::new();
            for place in place.key("primitives").items() {
                let Some(Primitive { mesh, material }) = primitive(self.document, &place, messages)? else { continue };
                let looks = &self.materials.looks;
                let look = looks[material.unwrap_or(looks.len() - 1).min(looks.len() - 1)].clone();
                if placements.len() > 1 && look.emission.is_black() {
                    group.push(self.add_geometry(mesh, &look, &name));
                    continue;
                }
                for m in &placements {
                    let wrong = |message: String| GltfError { place: place.path.clone(), message };
                    let id = self.add_geometry(placed(&mesh, m).map_err(wrong)?, &look, &name);
                    self.set.root.geometries.push(id);
                    self.add_emission(id, &look, files, messages);
                }
            }
            if !group.is_empty() {
                let id = self.set.groups.len() as u32;
                self.set.groups.push(Group { geometries: group });
                let instance = |m: &Affine3A| Instance { group: id, world_from_group: vec![*m] };
                self.set.instances.extend(placements.iter().map(instance));
            }
        }
        Ok(())
    }

    fn add_geometry(&mut self, mesh: TriangleMesh, look: &Look, name: &str) -> GeometryId {
        self.set.geometries.push(Geometry { shape: Shape::Mesh(mesh), alpha: look.alpha, visibility: Visibility::ALL });
        self.surfaces.push(Surface { material: look.material, name: name.to_owned() });
        (self.set.geometries.len() - 1) as GeometryId
    }

    fn add_emission(&mut self, id: GeometryId, look: &Look, files: &FileCache, messages: &mut Messages<'_>) {
        if look.emission.is_black() {
            return;
        }
        let image = look.emission_image.as_ref().and_then(|path| match files.rgb(path) {
            Ok(image) => {
                let (texels, [width, height]) = Arc::unwrap_or_clone(image);
                EmissionImage::new(width, height, texels).ok().map(Arc::new)
            }
            Err(error) => {
                report(&error, path, messages.span, messages.diagnostics);
                None
            }
        });
        self.emitters.push((id, Emission { l: look.emission, two_sided: look.is_double_sided, image }));
    }

    /// `KHR_lights_punctual`: lights shine along −z.
    fn add_light(&mut self, node: &Node<'a>) {
        let Some(index) = node.place.extension("KHR_lights_punctual").key("light").index() else { return };
        let light = self.document.root().extension("KHR_lights_punctual").key("lights").item(index);
        let color = Rgb::from_array(light.key("color").numbers().unwrap_or([1.0; 3]));
        let intensity = color * (light.key("intensity").number().unwrap_or(1.0).max(0.0) / LUMENS_PER_WATT);
        let m = &node.world_from_node;
        let (p, axis) = (m.transform_point3(Vec3::ZERO), m.transform_vector3(-Vec3::Z).normalize_or(-Vec3::Z));
        match light.key("type").text() {
            Some("directional") => self.lights.push(Light::Distant { wi_world: -axis, l: intensity }),
            Some("spot") => {
                let angle = |key: &str, default: f32| light.key("spot").key(key).number().unwrap_or(default).cos();
                let cos_total = angle("outerConeAngle", std::f32::consts::FRAC_PI_4);
                let cos_falloff_start = angle("innerConeAngle", 0.0).max(cos_total);
                self.lights.push(Light::Spot { p, axis, cos_total, cos_falloff_start, intensity });
            }
            _ => self.lights.push(Light::Point { p, intensity }),
        }
    }

    /// The first camera of the scene, or one that frames it, and the film.
    fn camera(&self, nodes: &[Node<'a>], bounds: &Bounds3, messages: &mut Messages<'_>) -> (Camera, FilmSettings) {
        let cameras = self.document.root().key("cameras");
        let found = nodes.iter().find_map(|n| Some((n, cameras.item(n.place.key("camera").index()?))));
        let found = if self.options.camera_auto { None } else { found };
        if found.is_none() && !self.options.camera_auto {
            messages.warning(&cameras, "no camera: one that frames the scene is used (--camera-auto)");
        }
        let aspect = found.as_ref().and_then(|(_, c)| c.key("perspective").key("aspectRatio").number());
        let width = (HEIGHT as f32 * aspect.filter(|a| *a > 0.0).unwrap_or(16.0 / 9.0)).round().clamp(1.0, 65_536.0);
        let resolution = self.options.resolution.unwrap_or([width as u32, HEIGHT]);
        let aspect = resolution[0] as f32 / resolution[1] as f32;
        let camera =
            found.map_or_else(|| frame(bounds, aspect, resolution), |(n, c)| of_file(n, &c, aspect, resolution));
        let [x0, x1, y0, y1] = self.options.crop.unwrap_or([0.0, 1.0, 0.0, 1.0]);
        let at = |fraction: f32, size: u32| ((fraction * size as f32).ceil() as u32).min(size);
        let [w, h] = resolution;
        let bounds = PixelBounds { x0: at(x0, w), x1: at(x1, w), y0: at(y0, h), y1: at(y1, h) };
        let filter = PixelFilter::Gaussian { rx: 1.5, ry: 1.5, sigma: 0.5 };
        (camera, FilmSettings { resolution, bounds, filter, file_name: None, scale: 1.0 })
    }
}

/// A camera of the file: it looks along −z; scales of its node do not count.
fn of_file(node: &Node<'_>, camera: &Place<'_>, aspect: f32, resolution: [u32; 2]) -> Camera {
    let (_, rotation, translation) = node.world_from_node.to_scale_rotation_translation();
    let world_from_camera = Affine3A::from_scale_rotation_translation(Vec3::new(1.0, 1.0, -1.0), rotation, translation);
    let orthographic = camera.key("orthographic");
    if orthographic.exists() {
        let y = orthographic.key("ymag").number().unwrap_or(1.0).abs().max(1e-6);
        return Camera::orthographic(world_from_camera, [-y * aspect, y * aspect, -y, y], resolution, 0.0, 1e6);
    }
    let fov = camera.key("perspective").key("yfov").number().unwrap_or(0.8).clamp(1e-3, 3.1);
    Camera::perspective(world_from_camera, fov.to_degrees(), [-aspect, aspect, -1.0, 1.0], resolution, 0.0, 1e6)
}

/// A camera that sees the whole scene.
fn frame(bounds: &Bounds3, aspect: f32, resolution: [u32; 2]) -> Camera {
    let (center, radius) = bounds.bounding_sphere();
    let radius = if radius > 0.0 && radius.is_finite() { radius } else { 1.0 };
    let half = (AUTO_FOV.to_radians() * 0.5).tan() * aspect.min(1.0);
    let eye = center + AUTO_DIRECTION.normalize() * (radius / half.atan().sin());
    let z = (center - eye).normalize();
    let x = z.cross(Vec3::Y).normalize();
    let world_from_camera = Affine3A::from_cols(x.into(), x.cross(z).into(), z.into(), eye.into());
    Camera::perspective(world_from_camera, AUTO_FOV, [-aspect, aspect, -1.0, 1.0], resolution, 0.0, 1e6)
}

/// An environment by an image, whose z becomes the y of the scene.
fn environment(path: &Path, files: &FileCache, messages: &mut Messages<'_>) -> Option<Light> {
    let image = files.rgb(path).map_err(|error| report(&error, path, messages.span, messages.diagnostics)).ok()?;
    let (texels, size) = Arc::unwrap_or_clone(image);
    let mapping = if size[0] == size[1] { EnvironmentMapping::EqualArea } else { EnvironmentMapping::LatLong };
    match EnvironmentMap::new(texels, size, mapping, EnvironmentFilter::Nearest) {
        Ok(map) => {
            let turn = Affine3A::from_rotation_x(-std::f32::consts::FRAC_PI_2);
            Some(Light::infinite_image(Arc::new(map), &turn, 1.0))
        }
        Err(reason) => {
            messages.diagnostics.error(Span::default(), format!("{}: {reason}", path.display()));
            None
        }
    }
}
