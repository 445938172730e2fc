//! The camera and the film.

use super::choice::{Names, chosen, name_of};
use super::messages::Messages;
use super::nodes::Node;
use crate::cameras::Camera;
use crate::film::PixelBounds;
use crate::film::filter::PixelFilter;
use crate::import::LoadOptions;
use crate::scene::FilmSettings;
use lumiris_formats::gltf::{Document, Place};
use lumiris_numbers::math::origin::rebased;
use lumiris_numbers::math::{Affine3A, Bounds3, DAffine3, DVec3, Sphere, Vec3};

/// Default height of the image.
const HEIGHT: u32 = 720;
/// Angle of view of the automatic camera (degrees).
const AUTO_FOV: f32 = 40.0;
/// Direction from the scene to the automatic camera.
const AUTO_DIRECTION: Vec3 = Vec3::new(0.5, 0.35, 0.8);

/// A camera of the scene with its node.
#[derive(Clone)]
pub(super) struct PlacedCamera<'n, 'd> {
    pub node: &'n Node,
    camera: Place<'d>,
}

/// The cameras of the scene, in the order of its nodes.
pub(super) struct Cameras<'n, 'd> {
    pub placed: Vec<PlacedCamera<'n, 'd>>,
    /// Names of nodes take precedence over names of cameras.
    pub names: Names<'d>,
}

/// The scene in view of the automatic camera.
pub(super) struct Framing {
    /// Relative to `origin`.
    pub bounds: Bounds3,
    pub origin: DVec3,
}

/// The camera and the film.
pub(super) struct View {
    pub camera: Camera,
    pub film: FilmSettings,
}

/// The cameras of the scene.
pub(super) fn cameras<'n, 'd>(
    document: &'d Document,
    nodes: &'n [Node],
    messages: &mut Messages<'_>,
) -> Cameras<'n, 'd> {
    let all = document.root().key("cameras");
    let stands = |n: &Node| n.world_from_node.is_finite() && n.world_from_node.matrix3.determinant() != 0.0;
    let placed = |node: &'n Node| {
        let camera = all.item(node.place(document).key("camera").index()?);
        Some(PlacedCamera { node, camera })
    };
    let mut placed: Vec<PlacedCamera<'n, 'd>> = nodes.iter().filter_map(placed).collect();
    for PlacedCamera { node, .. } in placed.iter().filter(|placed| !stands(placed.node)) {
        messages.warning(&node.place(document), "a camera cannot be flattened by its node: it is left out");
    }
    placed.retain(|placed| stands(placed.node));
    let names = placed.iter().map(|placed| [name_of(&placed.node.place(document)), name_of(&placed.camera)]);
    Cameras { names: names.collect(), placed }
}

impl Cameras<'_, '_> {
    /// The index of a camera.
    pub(super) fn index_of(&self, camera: &PlacedCamera<'_, '_>) -> Option<usize> {
        self.placed.iter().position(|other| other.node.index == camera.node.index)
    }
}

/// The requested camera, or the first one; `None` for the automatic camera.
pub(super) fn chosen_camera<'n, 'd>(
    options: &LoadOptions,
    Cameras { placed, names }: &Cameras<'n, 'd>,
    messages: &mut Messages<'_>,
) -> Option<PlacedCamera<'n, 'd>> {
    if options.camera_auto {
        return None;
    }

    // The first camera is the default
    let index = match &options.camera {
        Some(wanted) => chosen(["camera", "--camera"], wanted, names),
        None if placed.is_empty() => {
            let place = Place::default().key("cameras");
            messages.warning(&place, "no camera: one that frames the scene is used (--camera-auto)");
            return None;
        }
        None => Ok(0),
    };
    match index {
        Ok(index) => placed.get(index).cloned(),
        Err(message) => {
            messages.diagnostics.error_without_place(message);
            None
        }
    }
}

/// A camera of the scene or the automatic camera, and the film. The camera is relative to the origin of the framing.
pub(super) fn view(options: &LoadOptions, found: Option<PlacedCamera<'_, '_>>, framing: &Framing) -> View {
    // Resolution, by the aspect of the camera
    let aspect = found.as_ref().and_then(|found| aspect_of(&found.camera));
    let width = (HEIGHT as f32 * aspect.unwrap_or(16.0 / 9.0)).round().clamp(1.0, 65_536.0);
    let resolution = options.resolution.unwrap_or([width as u32, HEIGHT]);
    let aspect = resolution[0] as f32 / resolution[1] as f32;

    // Camera
    let camera = match found {
        Some(PlacedCamera { node, camera }) => {
            let world_from_node = rebased(&node.world_from_node, framing.origin, DVec3::ZERO);
            of_file(&world_from_node, &camera, aspect, resolution)
        }
        None => frame(&framing.bounds, aspect, resolution),
    };

    // Film
    let [x0, x1, y0, y1] = options.crop.unwrap_or([0.0, 1.0, 0.0, 1.0]);
    let at = |fraction: f32, size: u32| ((fraction * size as f32).ceil() as u32).min(size);
    let [w, h] = resolution;
    let bounds = PixelBounds { x0: at(x0, w), x1: at(x1, w), y0: at(y0, h), y1: at(y1, h) };
    let filter = PixelFilter::Gaussian { rx: 1.5, ry: 1.5, sigma: 0.5 };
    let film = FilmSettings { resolution, bounds, filter, file_name: None, scale: 1.0, balance: None };
    View { camera, film }
}

/// The aspect ratio (width over height) of a camera, if it has one.
fn aspect_of(camera: &Place<'_>) -> Option<f32> {
    let orthographic = camera.key("orthographic");
    let aspect = if orthographic.exists() {
        half_size(&orthographic).map(|[x, y]| x / y)
    } else {
        camera.key("perspective").key("aspectRatio").number()
    };
    aspect.filter(|a| *a > 0.0 && a.is_finite())
}

/// Half the width and height of an orthographic camera, if it has them.
fn half_size(orthographic: &Place<'_>) -> Option<[f32; 2]> {
    let [x, y] = ["xmag", "ymag"].map(|key| orthographic.key(key).number().map(f32::abs).filter(|half| *half > 0.0));
    Some([x.or(y)?, y.or(x)?])
}

/// A camera of the file, which faces −z; scales of its node are ignored. If the aspect ratio of the image differs, a
/// perspective camera keeps its vertical angle of view, and an orthographic one extends its view horizontally or
/// vertically.
fn of_file(world_from_node: &DAffine3, camera: &Place<'_>, aspect: f32, resolution: [u32; 2]) -> Camera {
    let (_, rotation, translation) = world_from_node.to_scale_rotation_translation();
    let flip = DVec3::new(1.0, 1.0, -1.0);
    let world_from_camera = DAffine3::from_scale_rotation_translation(flip, rotation, translation).as_affine3a();
    let orthographic = camera.key("orthographic");
    if orthographic.exists() {
        let [x, y] = half_size(&orthographic).unwrap_or([1.0; 2]);
        let y = y.max(x / aspect).max(1e-6);
        return Camera::orthographic(world_from_camera, [-y * aspect, y * aspect, -y, y], resolution, 0.0, 1e6);
    }
    let fov = camera.key("perspective").key("yfov").number().unwrap_or(0.8).clamp(1e-3, 3.1);
    Camera::perspective(world_from_camera, fov.to_degrees(), [-aspect, aspect, -1.0, 1.0], resolution, 0.0, 1e6)
}

/// The automatic camera, with the whole scene in view.
fn frame(bounds: &Bounds3, aspect: f32, resolution: [u32; 2]) -> Camera {
    let Sphere { center, radius } = bounds.bounding_sphere();
    let radius = if radius > 0.0 && radius.is_finite() { radius } else { 1.0 };
    let center = if center.is_finite() { center } else { Vec3::ZERO };
    let half = (AUTO_FOV.to_radians() * 0.5).tan() * aspect.min(1.0);
    let eye = center + AUTO_DIRECTION.normalize() * (radius / half.atan().sin());
    let z = (center - eye).normalize();
    let x = z.cross(Vec3::Y).normalize();
    let world_from_camera = Affine3A::from_cols(x.into(), x.cross(z).into(), z.into(), eye.into());
    Camera::perspective(world_from_camera, AUTO_FOV, [-aspect, aspect, -1.0, 1.0], resolution, 0.0, 1e6)
}
