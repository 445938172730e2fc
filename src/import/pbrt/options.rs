//! Directives before `WorldBegin`: the camera and general options. Integrator and sampler are in [`super::settings`],
//! film and filter in [`super::film`].

use super::checks::{positive, unknown};
use super::descriptions::Pending;
use super::film::finish_film;
use super::lenses::{self, realistic};
use super::settings::{Placed, finish_integrator, finish_sampler};
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
use std::path::{Path, PathBuf};

/// The options read so far.
#[derive(Default)]
pub struct Options {
    camera: Option<(Pending, Ctm)>,
    camera_medium: Option<Name>,
    /// Folder of the camera's files.
    folder: PathBuf,
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
    pub given: Placed,
    /// Opening and closing of the shutter, as fractions of the motion.
    pub shutter: [f32; 2],
}

/// The camera, the film and other options of the image's size.
struct CameraFrame {
    resolution: [u32; 2],
    shutter: [f32; 2],
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
    pub fn camera(&mut self, name: Name, params: ParamSet, (ctm, folder): (Ctm, &Path), medium: Option<Name>) {
        self.camera = Some((Pending { name, params }, ctm));
        self.folder = folder.to_owned();
        self.camera_medium = medium;
    }

    /// The origin of rendered space: near the camera, at the start of its motion.
    pub fn origin(&self) -> DVec3 {
        self.camera.as_ref().map_or(DVec3::ZERO, |(_, ctm)| near_origin(affine(&ctm.start.inverse()).translation))
    }

    /// The files that the camera names.
    pub fn camera_files(&self) -> Vec<PathBuf> {
        let camera = self.camera.as_ref().filter(|(pending, _)| pending.name.text == "realistic");
        camera.map_or_else(Vec::new, |(pending, _)| lenses::files(&pending.params, &self.folder))
    }

    /// Factor of the edge lengths of displaced meshes.
    pub fn edge_scale(&self) -> f32 {
        self.edge_scale.unwrap_or(1.0)
    }

    /// The medium around the camera.
    pub fn camera_medium(&self) -> Option<&Name> {
        self.camera_medium.as_ref()
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
        let (film, sensor) = finish_film(self.film.as_ref(), self.filter.as_ref(), load, d);
        let mut settings = Settings::default();
        settings.sampling.seed = self.seed.unwrap_or(settings.sampling.seed);
        let mut given = finish_sampler(self.sampler.as_ref(), &mut settings, d);
        given.extend(finish_integrator(self.integrator.as_ref(), &mut settings, d));
        let (camera, shutter, seconds) = self.finish_camera(film.resolution, sensor.diagonal, d)?;
        let film = FilmSettings { scale: sensor.scale * seconds, ..film };
        Some(ParsedOptions { camera, film, settings, given, shutter })
    }

    fn finish_camera(
        &self,
        resolution: [u32; 2],
        diagonal: f32,
        d: &mut Diagnostics,
    ) -> Option<(Camera, [f32; 2], f32)> {
        let Some((Pending { name, params }, ctm)) = &self.camera else {
            let aspect = resolution[0] as f32 / resolution[1] as f32;
            let window = default_screen_window(aspect);
            let camera = Camera::perspective(Affine3A::IDENTITY, 90.0, window, resolution, 0.0, 1e6);
            return Some((camera, [0.0, 1.0], 1.0));
        };

        // Position and shutter
        let to_render_space = |m: &DAffine3| rebased(m, self.origin(), DVec3::ZERO).as_affine3a();
        let world_from_camera = to_render_space(&affine(&ctm.start.inverse()));
        let open = params.float("shutteropen", d).unwrap_or(0.0);
        let close = params.float("shutterclose", d).unwrap_or(1.0);
        if !(open < close) {
            d.error(params.span_of("shutterclose"), "the shutter must close after it opens");
            return None;
        }
        let [start, end] = self.times.unwrap_or([0.0, 1.0]);
        let frame =
            CameraFrame { resolution, shutter: [(open - start) / (end - start), (close - start) / (end - start)] };

        // Camera
        let camera = match name.text.as_str() {
            "perspective" => perspective(params, &world_from_camera, &frame, d),
            "orthographic" => {
                let window = screen_window(params, resolution, d)?;
                let (lens, focus) = lens(params, d)?;
                Some(Camera::orthographic(world_from_camera, window, resolution, lens, focus))
            }
            "spherical" | "environment" => {
                if name.text == "environment" {
                    d.warning_once(name.span, "camera `environment` is pbrt-v3; pbrt-v4 writes `spherical`");
                }
                let mapping = match params.string("mapping", d).unwrap_or(if name.text == "environment" {
                    "equirectangular"
                } else {
                    "equalarea"
                }) {
                    "equalarea" => SphericalMapping::EqualArea,
                    "equirectangular" => SphericalMapping::EquiRectangular,
                    other => {
                        let message = format!("unknown mapping `{other}`");
                        d.error(params.span_of("mapping"), message).help("one of equalarea, equirectangular");
                        return None;
                    }
                };
                Some(Camera::spherical(world_from_camera, resolution, mapping))
            }
            "realistic" => realistic(params, &self.folder, diagonal / 1000.0, d)
                .map(|lens| Camera::realistic(world_from_camera, resolution, diagonal / 1000.0, lens)),
            other => {
                unknown(other, name.span, "camera", &["perspective", "orthographic", "realistic", "spherical"], d);
                return None;
            }
        };

        // Motion
        params.report_unused(d);
        let places: Vec<Affine3A> = ctm.inverse().samples(frame.shutter).iter().map(to_render_space).collect();
        let camera = camera?.moving(&places);
        Some((camera, frame.shutter, close - open))
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

fn perspective(p: &ParamSet, world_from_camera: &Affine3A, frame: &CameraFrame, d: &mut Diagnostics) -> Option<Camera> {
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
    let (radius, focus) = lens(p, d)?;
    Some(Camera::perspective(*world_from_camera, fov, window, frame.resolution, radius, focus))
}

fn lens(p: &ParamSet, d: &mut Diagnostics) -> Option<(f32, f32)> {
    let radius = p.float("lensradius", d).unwrap_or(0.0);
    if !(radius >= 0.0 && radius.is_finite()) {
        d.error(p.span_of("lensradius"), "lensradius must not be negative");
        return None;
    }
    Some((radius, positive(p, "focaldistance", 1e6, d)))
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
