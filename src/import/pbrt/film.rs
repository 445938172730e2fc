//! `Film` and `PixelFilter`

use super::checks::{positive, unknown};
use super::descriptions::Pending;
use crate::film::PixelBounds;
use crate::film::filter::PixelFilter;
use crate::import::LoadOptions;
use crate::scene::FilmSettings;
use lumiris_formats::color_space::white_balance;
use lumiris_formats::diagnostic::Diagnostics;
use lumiris_formats::pbrt::directive::Name;
use lumiris_formats::pbrt::params::{ParamSet, ParamType, Values};
use lumiris_formats::source::Span;
use lumiris_numbers::math::Mat3;

/// The default sensor, whose responses are the colour matching functions.
const OBSERVER: &str = "cie1931";
/// Camera sensors with measured responses in pbrt-v4.
const CAMERAS: [&str; 17] = [
    "canon_eos_100d",
    "canon_eos_1dx_mkii",
    "canon_eos_200d",
    "canon_eos_200d_mkii",
    "canon_eos_5d",
    "canon_eos_5d_mkii",
    "canon_eos_5d_mkiii",
    "canon_eos_5d_mkiv",
    "canon_eos_5ds",
    "canon_eos_m",
    "hasselblad_l1d_20c",
    "nikon_d810",
    "nikon_d850",
    "sony_ilce_6400",
    "sony_ilce_7m3",
    "sony_ilce_7rm3",
    "sony_ilce_9",
];

/// The film's sensor.
pub(super) struct Sensor {
    /// Exposure factor by its ISO and scale.
    pub(super) scale: f32,
    /// White balance.
    balance: Option<Mat3>,
    /// Diagonal, for realistic cameras (mm).
    pub(super) diagonal: f32,
}

/// The imported film.
pub(super) struct FinishedFilm {
    pub(super) film: FilmSettings,
    pub(super) sensor: Sensor,
}

/// The part of the image that is rendered.
struct Window {
    /// In fractions of the image: x0, x1, y0, y1.
    crop: [f32; 4],
    /// In pixels, which go before `crop`.
    pixels: Option<PixelBounds>,
}

/// Imports `Film` and `PixelFilter`.
pub(super) fn finish_film(
    pending: Option<&Pending>,
    filter: Option<&Pending>,
    load: &LoadOptions,
    d: &mut Diagnostics,
) -> FinishedFilm {
    // Filter, and the defaults of a film
    let filter = finish_filter(filter, d);
    let mut resolution = [1280, 720];
    let mut file_name = None;
    let mut window = Window { crop: [0.0, 1.0, 0.0, 1.0], pixels: None };
    let mut sensor = Sensor { scale: 1.0, balance: None, diagonal: 35.0 };

    // Parameters
    if let Some(Pending { name, params: p }) = pending {
        film_kind(name, d);
        resolution = [size(p, "xresolution", 1280, d), size(p, "yresolution", 720, d)];
        file_name = p.string("filename", d).map(str::to_owned);
        window = read_window(p, window, d);
        sensor = read_sensor(p, &sensor, d);
        ignore_storage(p, d);
        p.report_unused(d);
    }

    // Options of the command line go before the file
    let resolution = load.resolution.unwrap_or(resolution);
    let bounds = match (load.crop, window.pixels) {
        (Some(crop), _) => crop_bounds(resolution, crop),
        (None, Some(bounds)) if load.resolution.is_none() => clip(bounds, resolution),
        (None, _) => crop_bounds(resolution, window.crop),
    };
    if bounds.area() == 0 {
        let span = pending.map_or_else(Span::default, |f| f.name.span);
        d.error(span, "the crop window holds no pixel");
    }
    let film = FilmSettings { resolution, bounds, filter, file_name, scale: 1.0, balance: sensor.balance };
    FinishedFilm { film, sensor }
}

/// Pixels along an axis.
fn size(p: &ParamSet, key: &'static str, default: u32, d: &mut Diagnostics) -> u32 {
    match p.integer(key, d) {
        Some(n @ 1..=65_536) => n as u32,
        Some(n) => {
            d.error(p.span_of(key), format!("{key} must be from 1 to 65536, not {n}"));
            default
        }
        None => default,
    }
}

/// `pixelbounds` or `cropwindow`.
fn read_window(p: &ParamSet, whole: Window, d: &mut Diagnostics) -> Window {
    let mut window = Window { pixels: read_pixel_bounds(p, d), ..whole };
    let Some(v) = p.floats("cropwindow", d) else { return window };
    match *v {
        // As in pbrt-v4, windows are clamped, and ends may have any order
        [x0, x1, y0, y1] if v.iter().all(|x| x.is_finite()) => {
            let ends = |a: f32, b: f32| [a.min(b), a.max(b)].map(|x| x.clamp(0.0, 1.0));
            let ([x0, x1], [y0, y1]) = (ends(x0, x1), ends(y0, y1));
            window.crop = [x0, x1, y0, y1];
            if window.pixels.take().is_some() {
                d.warning_once(p.span_of("pixelbounds"), "`cropwindow` goes before `pixelbounds`");
            }
        }
        _ => {
            d.error(p.span_of("cropwindow"), "cropwindow takes four numbers, x0 x1 y0 y1");
        }
    }
    window
}

/// Parameters of half-floats and file splitting have no effect here.
fn ignore_storage(p: &ParamSet, d: &mut Diagnostics) {
    for key in ["savefp16", "maxcomponentvalue", "coordinatesystem", "nbuckets", "lambdamin", "lambdamax"] {
        if p.ignore(key) && key == "maxcomponentvalue" {
            d.warning_once(p.span_of(key), "maxcomponentvalue is ignored: clamping would darken the image");
        }
    }
}

fn finish_filter(pending: Option<&Pending>, d: &mut Diagnostics) -> PixelFilter {
    let Some(Pending { name, params: p }) = pending else {
        return PixelFilter::Gaussian { rx: 1.5, ry: 1.5, sigma: 0.5 };
    };

    // Radii, also by their names in pbrt-v3
    let default_radius = match name.text.as_str() {
        "box" => 0.5,
        "gaussian" => 1.5,
        "sinc" => 4.0,
        _ => 2.0,
    };
    let mut radius = |key: &'static str, v3: &'static str| {
        let r = p.float(key, d).or_else(|| p.float(v3, d)).unwrap_or(default_radius);
        if r > 0.0 && r <= 64.0 {
            r
        } else {
            d.error(p.span_of(key), format!("{key} must be above 0 and at most 64"));
            default_radius
        }
    };
    let (rx, ry) = (radius("xradius", "xwidth"), radius("yradius", "ywidth"));

    // Filter
    let filter = match name.text.as_str() {
        "box" => PixelFilter::Box { rx, ry },
        "triangle" => PixelFilter::Triangle { rx, ry },
        "gaussian" => {
            p.ignore("alpha");
            PixelFilter::Gaussian { rx, ry, sigma: positive(p, "sigma", 0.5, d) }
        }
        "mitchell" => {
            let third = 1.0 / 3.0;
            PixelFilter::Mitchell { rx, ry, b: p.float("B", d).unwrap_or(third), c: p.float("C", d).unwrap_or(third) }
        }
        "sinc" => PixelFilter::LanczosSinc { rx, ry, tau: positive(p, "tau", 3.0, d) },
        other => {
            unknown(other, name.span, "pixel filter", &["box", "triangle", "gaussian", "mitchell", "sinc"], d);
            PixelFilter::Box { rx: 0.5, ry: 0.5 }
        }
    };
    p.report_unused(d);
    filter
}

fn film_kind(name: &Name, d: &mut Diagnostics) {
    match name.text.as_str() {
        "rgb" => {}
        "gbuffer" => {
            let message =
                "film `gbuffer` is rendered as `rgb`, with the layers of --aov: normals and depths in world space";
            d.warning_once(name.span, message);
        }
        "image" => {
            d.warning_once(name.span, "film `image` is pbrt-v3; pbrt-v4 writes `rgb`");
        }
        "spectral" => {
            d.warning_once(name.span, "film `spectral` is rendered as `rgb`");
        }
        other => unknown(other, name.span, "film", &["rgb", "gbuffer", "spectral"], d),
    }
}

/// The sensor, with the factor of its ISO and its white balance; exposure time belongs to the camera. Camera sensors
/// are balanced for daylight of 6500 K unless another temperature is given. pbrt-v4 scales their response to that white
/// to its luminance, so the factor is the same for all sensors.
fn read_sensor(p: &ParamSet, usual: &Sensor, d: &mut Diagnostics) -> Sensor {
    let is_camera = sensor_is_of_camera(p, d);
    let kelvin = match p.float("whitebalance", d).unwrap_or(0.0) {
        0.0 if is_camera => 6500.0,
        kelvin => kelvin,
    };
    let balance = (kelvin != 0.0).then(|| white_balance(kelvin)).flatten();
    if kelvin != 0.0 && balance.is_none() {
        d.error(p.span_of("whitebalance"), format!("whitebalance is 0 or from 1000 to 25000 K, not {kelvin}"));
    }
    let scale = p.float("scale", d).unwrap_or(1.0) * positive(p, "iso", 100.0, d) / 100.0;
    Sensor { scale, balance, diagonal: positive(p, "diagonal", usual.diagonal, d) }
}

/// True if the film has a camera sensor.
fn sensor_is_of_camera(p: &ParamSet, d: &mut Diagnostics) -> bool {
    let Some(name) = p.string("sensor", d).filter(|name| *name != OBSERVER) else { return false };
    let name = name.to_owned();
    if !CAMERAS.contains(&name.as_str()) {
        let known: Vec<&str> = std::iter::once(OBSERVER).chain(CAMERAS).collect();
        unknown(&name, p.span_of("sensor"), "sensor", &known, d);
        return false;
    }
    let message = format!("sensor `{name}` has the colours of {OBSERVER}; its exposure and white balance are its own");
    d.warning_once(p.span_of("sensor"), message);
    true
}

fn read_pixel_bounds(p: &ParamSet, d: &mut Diagnostics) -> Option<PixelBounds> {
    let param = p.get("pixelbounds", &[ParamType::Integer], d)?;
    if let Values::Integers(v) = &param.values
        && let [x0, x1, y0, y1] = v[..]
        && 0 <= x0
        && x0 < x1
        && 0 <= y0
        && y0 < y1
    {
        return Some(PixelBounds { x0: x0 as u32, x1: x1 as u32, y0: y0 as u32, y1: y1 as u32 });
    }
    d.error(param.value_span, "pixelbounds takes x0 x1 y0 y1 with 0 <= x0 < x1 and 0 <= y0 < y1");
    None
}

fn clip(b: PixelBounds, [w, h]: [u32; 2]) -> PixelBounds {
    PixelBounds { x0: b.x0.min(w), x1: b.x1.min(w), y0: b.y0.min(h), y1: b.y1.min(h) }
}

/// pbrt's rule: both ends are rounded up.
fn crop_bounds([w, h]: [u32; 2], [x0, x1, y0, y1]: [f32; 4]) -> PixelBounds {
    let place = |fraction: f32, size: u32| ((fraction * size as f32).ceil() as u32).min(size);
    PixelBounds { x0: place(x0, w), x1: place(x1, w), y0: place(y0, h), y1: place(y1, h) }
}
