//! Directives before `WorldBegin`: the camera and general options. Integrator and sampler are in [`super::settings`],
//! film and filter in [`super::film`].

use super::checks::{positive, unknown};
use super::descriptions::Pending;
use super::film::{FinishedFilm, finish_film};
use super::lenses::{self, realistic};
use super::settings::{GivenSetting, finish_integrator, finish_sampler};
use super::transform::{Ctm, affine};
use crate::cameras::{Camera, SphericalMapping, default_screen_window};
use crate::import::LoadOptions;
use crate::scene::FilmSettings;
use crate::settings::Settings;
use lumiris_formats::diagnostic::Diagnostics;
use lumiris_formats::pbrt::directive::Name;
use lumiris_formats::pbrt::params::ParamSet;
use lumiris_formats::source::Span;
use lumiris_numbers::math::origin::{near_origin, rebased};
use lumiris_numbers::math::{Affine3A, DAffine3, DVec3};
use std::path::PathBuf;

/// The options read so far.
#[derive(Default)]
pub struct Options {
    camera: Option<CameraDirective>,
    film: Option<Pending>,
    filter: Option<Pending>,
    sampler: Option<Pending>,
    integrator: Option<Pending>,
    times: Option<[f32; 2]>,
    seed: Option<u32>,
    edge_scale: Option<f32>,
}

/// The options, parsed.
pub struct ParsedOptions {
    /// Camera.
    pub camera: Camera,
    /// Film.
    pub film: FilmSettings,
    /// Integrator and sampler.
    pub settings: Settings,
    /// The settings given in the file.
    pub given: Vec<GivenSetting>,
    /// Opening and closing of the shutter, as fractions of the motion.
    pub shutter: [f32; 2],
}

/// Position of a camera, and size of its image.
struct CameraFrame {
    world_from_camera: Affine3A,
    resolution: [u32; 2],
    /// Diagonal of the film (m).
    diagonal: f32,
}

/// A camera with its exposure.
struct FinishedCamera {
    camera: Camera,
    /// Opening and closing of the shutter, as fractions of the motion.
    shutter: [f32; 2],
    /// Exposure time (s).
    seconds: f32,
}

/// `Camera` with the state that it was given in.
pub(super) struct CameraDirective {
    pub pending: Pending,
    pub ctm: Ctm,
    /// Folder of its files.
    pub folder: PathBuf,
    /// The medium around it.
    pub medium: Option<Name>,
}

impl Options {
    /// `TransformTimes`
    pub fn transform_times(&mut self, times: [f32; 2], span: Span, diagnostics: &mut Diagnostics) {
        if times[0] < times[1] {
            self.times = Some(times);
        } else {
            diagnostics.error(span, "the end of the motion must be after its start");
        }
    }

    /// `Camera`; a second one replaces the first. The same holds for the other directives.
    pub(super) fn camera(&mut self, directive: CameraDirective) {
        self.camera = Some(directive);
    }

    /// The origin of rendered space: near the camera, at the start of its motion.
    pub fn origin(&self) -> DVec3 {
        let position = |camera: &CameraDirective| affine(&camera.ctm.start.inverse()).translation;
        self.camera.as_ref().map_or(DVec3::ZERO, |camera| near_origin(position(camera)))
    }

    /// The files that the camera names.
    pub fn camera_files(&self) -> Vec<PathBuf> {
        let camera = self.camera.as_ref().filter(|camera| camera.pending.name.text == "realistic");
        camera.map_or_else(Vec::new, |camera| lenses::files(&camera.pending.params, &camera.folder))
    }

    /// Factor of the edge lengths of displaced meshes.
    pub fn edge_scale(&self) -> f32 {
        self.edge_scale.unwrap_or(1.0)
    }

    /// The medium around the camera.
    pub fn camera_medium(&self) -> Option<&Name> {
        self.camera.as_ref()?.medium.as_ref()
    }

    /// Source position of the integrator `path`, which ignores media in pbrt-v4.
    pub fn integrator_without_media(&self) -> Option<Span> {
        self.integrator.as_ref().map(|pending| &pending.name).filter(|name| name.text == "path").map(|name| name.span)
    }

    /// `Film`
    pub fn film(&mut self, name: Name, params: ParamSet) {
        self.film = Some(Pending { name, params });
    }

    /// `Sampler`
    pub fn sampler(&mut self, name: Name, params: ParamSet) {
        self.sampler = Some(Pending { name, params });
    }

    /// `Integrator`
    pub fn integrator(&mut self, name: Name, params: ParamSet) {
        self.integrator = Some(Pending { name, params });
    }

    /// `PixelFilter`
    pub fn pixel_filter(&mut self, name: Name, params: ParamSet) {
        self.filter = Some(Pending { name, params });
    }

    /// `Option "name" value`; case, `-` and `_` of the name are ignored.
    pub fn option(&mut self, name: &Name, value: &Name, d: &mut Diagnostics) {
        let letters = name.text.chars().filter(|c| !matches!(c, '-' | '_'));
        let key = letters.collect::<String>().to_ascii_lowercase();
        let wrong = |d: &mut Diagnostics, expected: &str| {
            d.error(value.span, format!("option `{}` takes {expected}, not `{}`", name.text, value.text));
        };
        let text = value.text.as_str();
        match key.as_str() {
            // Negative numbers are large ones with the same bits
            "seed" => match text.parse::<i32>().map(|n| n as u32).or_else(|_| text.parse()) {
                Ok(seed) => self.seed = Some(seed),
                Err(_) => wrong(d, "a whole number of 32 bits"),
            },
            "displacementedgescale" => match text.parse::<f32>() {
                Ok(scale) if scale > 0.0 && scale.is_finite() => self.edge_scale = Some(scale),
                Ok(_) | Err(_) => wrong(d, "a positive number"),
            },
            "disablepixeljitter"
            | "disabletexturefiltering"
            | "disablewavelengthjitter"
            | "forcediffuse"
            | "pixelstats"
            | "wavefront" => match text {
                // Options of the execution in pbrt have no effect on the image
                "true" if key == "wavefront" => {}
                "true" => warn_without_effect(name, d),
                "false" => {}
                _ => wrong(d, "true or false"),
            },
            "msereferenceimage" | "msereferenceout" => warn_without_effect(name, d),
            // Computation space of pbrt, without effect on the image
            "rendercoordsys" if ["camera", "cameraworld", "world"].contains(&text) => {}
            "rendercoordsys" => wrong(d, "camera, cameraworld or world"),
            _ => unknown(&name.text, name.span, "option", OPTIONS, d),
        }
    }

    /// Parses all options.
    pub fn finish(&self, load: &LoadOptions, d: &mut Diagnostics) -> Option<ParsedOptions> {
        let FinishedFilm { film, sensor } = finish_film(self.film.as_ref(), self.filter.as_ref(), load, d);
        let mut settings = Settings::default();
        settings.sampling.seed = self.seed.unwrap_or(settings.sampling.seed);
        let mut given = finish_sampler(self.sampler.as_ref(), &mut settings, d);
        given.extend(finish_integrator(self.integrator.as_ref(), &mut settings, d));
        let FinishedCamera { camera, shutter, seconds } = self.finish_camera(film.resolution, sensor.diagonal, d)?;
        let film = FilmSettings { scale: sensor.scale * seconds, ..film };
        Some(ParsedOptions { camera, film, settings, given, shutter })
    }

    /// The camera, at the start of its motion and then moving.
    fn finish_camera(&self, resolution: [u32; 2], diagonal: f32, d: &mut Diagnostics) -> Option<FinishedCamera> {
        let Some(directive) = &self.camera else { return Some(FinishedCamera::usual(resolution)) };
        let CameraDirective { pending: Pending { params, .. }, ctm, .. } = directive;

        // Shutter
        let open = params.float("shutteropen", d).unwrap_or(0.0);
        let close = params.float("shutterclose", d).unwrap_or(1.0);
        if !(open < close) {
            d.error(params.span_of("shutterclose"), "the shutter must close after it opens");
            return None;
        }
        let [start, end] = self.times.unwrap_or([0.0, 1.0]);
        let shutter = [open, close].map(|time| (time - start) / (end - start));

        // Camera
        let to_render_space = |m: &DAffine3| rebased(m, self.origin(), DVec3::ZERO).as_affine3a();
        let world_from_camera = to_render_space(&affine(&ctm.start.inverse()));
        let frame = CameraFrame { world_from_camera, resolution, diagonal: diagonal / 1000.0 };
        let places: Vec<Affine3A> = ctm.inverse().samples(shutter).iter().map(to_render_space).collect();
        let camera = directive.camera(&frame, d)?.moving(&places);
        Some(FinishedCamera { camera, shutter, seconds: close - open })
    }
}

impl FinishedCamera {
    /// The camera of a file without one.
    fn usual(resolution: [u32; 2]) -> Self {
        let window = default_screen_window(resolution[0] as f32 / resolution[1] as f32);
        let camera = Camera::perspective(Affine3A::IDENTITY, 90.0, window, resolution, 0.0, 1e6);
        FinishedCamera { camera, shutter: [0.0, 1.0], seconds: 1.0 }
    }
}

impl CameraDirective {
    /// The camera, not moving.
    fn camera(&self, frame: &CameraFrame, d: &mut Diagnostics) -> Option<Camera> {
        let Pending { name, params } = &self.pending;
        let CameraFrame { world_from_camera, resolution, diagonal } = *frame;
        let camera = match name.text.as_str() {
            "perspective" => perspective(params, frame, d),
            "orthographic" => {
                let window = screen_window(params, resolution, d)?;
                let ThinLens { radius, focus } = lens(params, d)?;
                Some(Camera::orthographic(world_from_camera, window, resolution, radius, focus))
            }
            "spherical" | "environment" => {
                Some(Camera::spherical(world_from_camera, resolution, mapping(name, params, d)?))
            }
            "realistic" => realistic(params, &self.folder, diagonal, d)
                .map(|lens| Camera::realistic(world_from_camera, resolution, diagonal, lens)),
            other => {
                unknown(other, name.span, "camera", &["perspective", "orthographic", "realistic", "spherical"], d);
                return None;
            }
        };
        params.report_unused(d);
        camera
    }
}

/// Options of pbrt-v4.
const OPTIONS: &[&str] = &[
    "disablepixeljitter",
    "disabletexturefiltering",
    "disablewavelengthjitter",
    "displacementedgescale",
    "forcediffuse",
    "msereferenceimage",
    "msereferenceout",
    "pixelstats",
    "rendercoordsys",
    "seed",
    "wavefront",
];

fn warn_without_effect(name: &Name, d: &mut Diagnostics) {
    d.warning_once(name.span, format!("option `{}` has no effect here", name.text));
}

/// The mapping of a spherical camera.
fn mapping(name: &Name, p: &ParamSet, d: &mut Diagnostics) -> Option<SphericalMapping> {
    let is_old = name.text == "environment";
    if is_old {
        d.warning_once(name.span, "camera `environment` is pbrt-v3; pbrt-v4 writes `spherical`");
    }
    match p.string("mapping", d).unwrap_or(if is_old { "equirectangular" } else { "equalarea" }) {
        "equalarea" => Some(SphericalMapping::EqualArea),
        "equirectangular" => Some(SphericalMapping::EquiRectangular),
        other => {
            let message = format!("unknown mapping `{other}`");
            d.error(p.span_of("mapping"), message).help("one of equalarea, equirectangular");
            None
        }
    }
}

fn perspective(p: &ParamSet, frame: &CameraFrame, d: &mut Diagnostics) -> Option<Camera> {
    let mut fov = p.float("fov", d).unwrap_or(90.0);
    if let Some(half) = p.float("halffov", d) {
        d.warning_once(p.span_of("halffov"), "halffov is pbrt-v3; pbrt-v4 writes fov");
        fov = 2.0 * half;
    }
    if !(fov > 0.0 && fov < 180.0) {
        d.error(p.span_of("fov"), format!("fov must be between 0 and 180 degrees, not {fov}"));
        return None;
    }
    let window = screen_window(p, frame.resolution, d)?;
    let ThinLens { radius, focus } = lens(p, d)?;
    Some(Camera::perspective(frame.world_from_camera, fov, window, frame.resolution, radius, focus))
}

/// Radius of a thin lens, and distance of the plane in focus.
struct ThinLens {
    radius: f32,
    focus: f32,
}

fn lens(p: &ParamSet, d: &mut Diagnostics) -> Option<ThinLens> {
    let radius = p.float("lensradius", d).unwrap_or(0.0);
    if !(radius >= 0.0 && radius.is_finite()) {
        d.error(p.span_of("lensradius"), "lensradius must not be negative");
        return None;
    }
    Some(ThinLens { radius, focus: positive(p, "focaldistance", 1e6, d) })
}

/// The part of the image plane covered by the film, x0 x1 y0 y1; the shorter axis spans −1..1 by default.
fn screen_window(p: &ParamSet, [w, h]: [u32; 2], d: &mut Diagnostics) -> Option<[f32; 4]> {
    let aspect = p.float("frameaspectratio", d).unwrap_or(w as f32 / h as f32);
    if !(aspect > 0.0 && aspect.is_finite()) {
        d.error(p.span_of("frameaspectratio"), "frameaspectratio must be positive");
        return None;
    }
    let mut window = default_screen_window(aspect);
    if let Some(v) = p.floats("screenwindow", d) {
        match *v {
            [x0, x1, y0, y1] if x0 < x1 && y0 < y1 => window = [x0, x1, y0, y1],
            _ => {
                d.error(p.span_of("screenwindow"), "screenwindow takes x0 x1 y0 y1 with x0 < x1 and y0 < y1");
                return None;
            }
        }
    }
    Some(window)
}
