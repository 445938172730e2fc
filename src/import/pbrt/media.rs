//! `MakeNamedMedium` and `MediumInterface`.

use super::checks::unknown;
use super::descriptions::{MediumDesc, MediumNames, PendingMedium, ShapeDesc};
use super::media_presets;
use super::spectrum::SpectrumUse;
use super::state::Builder;
use crate::materials::MaterialId;
use crate::media::{
    Cloud, Field, Heterogeneous, Homogeneous, Medium, MediumId, MediumSet, RgbGrid, Samples, Scalars, Sides,
    Temperature, UniformGrid,
};
use lumiris_formats::color_space::Colored;
use lumiris_formats::diagnostic::Diagnostics;
use lumiris_formats::pbrt::directive::Name;
use lumiris_formats::pbrt::params::{ParamSet, ParamType};
use lumiris_formats::spectra::{Y_INTEGRAL, glow_rgb};
use lumiris_numbers::math::{DAffine3, DVec3, Rgb};
use std::collections::HashMap;
use std::sync::Arc;

/// Number of temperatures whose radiance is tabulated.
const TEMPERATURES: usize = 1024;

/// The media that surfaces and the camera refer to.
#[derive(Default)]
pub(super) struct MediaInUse {
    pub(super) set: MediumSet,
    ids: HashMap<String, MediumId>,
    /// Interiors of materials.
    pub(super) interiors: HashMap<MaterialId, MediumId>,
}

impl MediaInUse {
    fn id(&self, name: &Option<Name>) -> Option<MediumId> {
        self.ids.get(&name.as_ref()?.text).copied()
    }

    /// The media on the sides of a shape of a material; `None` if they are the same.
    pub(super) fn sides(&self, names: &MediumNames, material: MaterialId) -> Option<Sides> {
        let front = self.id(&names.outside);
        if let Some(&interior) = self.interiors.get(&material) {
            return Some(Sides { front, back: Some(interior) });
        }
        let sides = Sides { front, back: self.id(&names.inside) };
        (names.differ() && sides.differ()).then_some(sides)
    }
}

impl Builder<'_> {
    /// `MakeNamedMedium "name"`; media are made after all directives are read.
    pub fn make_named_medium(&mut self, name: Name, params: ParamSet, d: &mut Diagnostics) {
        if name.text.is_empty() {
            d.error(name.span, "a medium needs a name");
        }
        let first = *self.medium_names.entry(name.text.clone()).or_insert(self.media.len());
        if let Some(first) = self.media.get(first) {
            let message = format!("medium `{}` is defined twice", name.text);
            d.error(name.span, message).label(first.name.span, "first defined here");
        }
        self.pending_media.push(PendingMedium { index: self.media.len(), params, state: self.param_state() });
        self.media.push(MediumDesc { name, medium: None, volume: None });
    }

    /// Makes a medium after the origin of rendered space is known.
    pub(super) fn make_medium(&mut self, index: usize, p: &mut ParamSet, d: &mut Diagnostics) {
        let span = self.media[index].name.span;
        let world_from_medium = self.still_transform("media", span, d);
        let kind = p.string("type", d).unwrap_or("homogeneous").to_owned();
        if kind != "homogeneous" && !self.has_inverse("a medium of a grid", span, d) {
            p.ignore_all();
            return;
        }

        // Medium; volumes of files are read later
        let mut volume = None;
        let medium = match kind.as_str() {
            "homogeneous" => self.homogeneous(p, d),
            "uniformgrid" => self.uniform_grid(p, &world_from_medium, d),
            "rgbgrid" => self.rgb_grid(p, &world_from_medium, d),
            "cloud" => self.cloud(p, &world_from_medium, d),
            "nanovdb" => {
                volume = self.nanovdb(p, world_from_medium, d);
                None
            }
            other => {
                p.ignore_all();
                let known = ["homogeneous", "uniformgrid", "rgbgrid", "cloud", "nanovdb"];
                unknown(other, p.span_of("type"), "medium", &known, d);
                None
            }
        };
        p.report_unused(d);
        (self.media[index].medium, self.media[index].volume) = (medium, volume);
    }

    /// σ_a and σ_s including the scale; 1 by default.
    pub(super) fn coefficients(&self, p: &ParamSet, scale: f32, d: &mut Diagnostics) -> Option<[Rgb; 2]> {
        let mut of = [Rgb::WHITE; 2];
        let preset = p.string("preset", d).map(str::to_owned);
        let found = preset.as_deref().map(|name| (name, media_presets::preset(name)));
        if let Some((name, None)) = found {
            unknown(name, p.span_of("preset"), "preset", &media_presets::names(), d);
            return None;
        }
        for (i, key) in ["sigma_a", "sigma_s"].into_iter().enumerate() {
            // A preset overrides coefficients
            let given = self.color_param(p, key, SpectrumUse::Unbounded, d);
            let measured = found.and_then(|(_, preset)| preset).map(|preset| preset[i]);
            if let (Some(_), Some(_)) = (given, measured) {
                d.warning_once(p.span_of(key), format!("`preset` goes before `{key}`, as in pbrt-v4"));
            }
            of[i] = measured.or(given).unwrap_or(Rgb::WHITE) * scale;
            if of[i].to_array().iter().any(|&c| !(c >= 0.0 && c.is_finite())) {
                d.error(p.span_of(key), format!("{key} must be finite and not negative"));
                return None;
            }
        }
        Some(of)
    }

    fn homogeneous(&self, p: &ParamSet, d: &mut Diagnostics) -> Option<Medium> {
        let scale = not_negative(p, "scale", 1.0, d);
        let g = asymmetry(p, d);
        let le = self.color_param(p, "Le", SpectrumUse::Illuminant, d).unwrap_or(Rgb::BLACK);
        let le = le * not_negative(p, "Lescale", 1.0, d);
        let [sigma_a, sigma_s] = self.coefficients(p, scale, d)?;
        Some(Medium::Homogeneous(Homogeneous { sigma_a, sigma_s, le, g }))
    }

    fn uniform_grid(&self, p: &mut ParamSet, placement: &DAffine3, d: &mut Diagnostics) -> Option<Medium> {
        let scale = not_negative(p, "scale", 1.0, d);
        let g = asymmetry(p, d);
        let bounds = bounds(p, d);
        let resolution = resolution(p, d);
        let le = self.color_param(p, "Le", SpectrumUse::Illuminant, d);
        let offset = p.float("temperatureoffset", d);
        let offset = offset.or_else(|| p.float("temperaturecutoff", d)).unwrap_or(0.0);
        let temperature_scale = p.float("temperaturescale", d).unwrap_or(1.0);

        // Samples
        let coefficients = self.coefficients(p, scale, d);
        let resolution = resolution?;
        let density = float_samples(p, "density", resolution, d);
        let le_scale = float_samples(p, "Lescale", resolution, d);
        let temperature = float_samples(p, "temperature", resolution, d);

        // Conflicts
        if p.type_of("density").is_none() {
            d.error(p.span, "a uniformgrid needs `float density`");
            return None;
        }
        if let (Some(_), Some(_)) = (le, &temperature) {
            d.error(
                p.span_of("temperature"),
                "the colour of the emission is given by `Le` or by `temperature`, not by both",
            );
            return None;
        }

        // Grid
        let temperature = temperature.map(|samples| glowing(Scalars::Dense(samples), offset, temperature_scale));
        let le = if temperature.is_some() { Rgb::WHITE } else { le.unwrap_or(Rgb::BLACK) };
        let [sigma_a, sigma_s] = coefficients?;
        let grid = UniformGrid { sigma_a, sigma_s, density: Scalars::Dense(density?), le, le_scale, temperature };
        Some(Medium::Heterogeneous(Arc::new(Heterogeneous::new(Field::Uniform(grid), bounds?, placement, g))))
    }

    fn rgb_grid(&self, p: &ParamSet, placement: &DAffine3, d: &mut Diagnostics) -> Option<Medium> {
        let scale = not_negative(p, "scale", 1.0, d);
        let le_scale = not_negative(p, "Lescale", 1.0, d);
        let g = asymmetry(p, d);
        let bounds = bounds(p, d);
        let resolution = resolution(p, d)?;
        let [sigma_a, sigma_s, le] = ["sigma_a", "sigma_s", "Le"].map(|key| self.rgb_samples(p, key, resolution, d));
        if p.type_of("sigma_a").is_none() && p.type_of("sigma_s").is_none() {
            d.error(p.span, "an rgbgrid needs `rgb sigma_a` or `rgb sigma_s`");
            return None;
        }
        if p.type_of("Le").is_some() && p.type_of("sigma_a").is_none() {
            d.error(p.span_of("Le"), "an rgbgrid that emits needs `rgb sigma_a`");
            return None;
        }
        // pbrt-v4 does not normalise this emission to a luminance
        let le = le.filter(|_| le_scale > 0.0).map(|samples| samples.map(|le| le * (le_scale * Y_INTEGRAL)));
        let grid = RgbGrid { sigma_a, sigma_s, scale, le };
        Some(Medium::Heterogeneous(Arc::new(Heterogeneous::new(Field::Rgb(grid), bounds?, placement, g))))
    }

    fn cloud(&self, p: &ParamSet, placement: &DAffine3, d: &mut Diagnostics) -> Option<Medium> {
        let g = asymmetry(p, d);
        let bounds = bounds(p, d);
        let density = not_negative(p, "density", 1.0, d);
        let wispiness = not_negative(p, "wispiness", 1.0, d);
        let frequency = not_negative(p, "frequency", 5.0, d);
        let [sigma_a, sigma_s] = self.coefficients(p, 1.0, d)?;
        let cloud = Cloud { sigma_a, sigma_s, density, wispiness, frequency };
        Some(Medium::Heterogeneous(Arc::new(Heterogeneous::new(Field::Cloud(cloud), bounds?, placement, g))))
    }

    fn rgb_samples(
        &self,
        p: &ParamSet,
        key: &'static str,
        resolution: [usize; 3],
        d: &mut Diagnostics,
    ) -> Option<Samples<Rgb>> {
        let param = p.get(key, &[ParamType::Rgb], d)?;
        let values = param.floats().unwrap_or_default();
        let space = param.color_space.unwrap_or(self.state.color_space);
        let of = if key == "Le" { Colored::Light } else { Colored::Factor };
        let colors = values.chunks_exact(3).map(|c| space.to_rec709([c[0], c[1], c[2]], of));
        let is_wrong = |c: &f32| !(*c >= 0.0 && c.is_finite());
        if values.iter().any(is_wrong) {
            d.error(param.value_span, format!("{key} must be finite and not negative"));
            return None;
        }
        // A colour of another space may be outside Rec.709
        let samples = Samples::new(resolution, colors.map(|c| c.map(|c| c.max(0.0))).collect());
        if samples.is_none() {
            d.error(param.value_span, wrong_count(key, resolution, values.len() / 3));
        }
        samples
    }

    /// The media that shapes and the camera refer to.
    pub(super) fn media_in_use(&self, shapes: &[ShapeDesc], d: &mut Diagnostics) -> MediaInUse {
        let mut media = MediaInUse::default();

        // Adds a medium at its first use
        let used = |media: &mut MediaInUse, name: &Name, d: &mut Diagnostics| {
            let Some(&index) = self.medium_names.get(&name.text) else {
                d.unknown(name.span, "medium", &name.text, self.medium_names.keys().map(String::as_str));
                return None;
            };
            let medium = self.media[index].medium.as_ref()?;
            let MediaInUse { set, ids, .. } = media;
            Some(*ids.entry(name.text.clone()).or_insert_with(|| {
                set.media.push(medium.clone());
                set.names.push(name.text.clone());
                (set.media.len() - 1) as MediumId
            }))
        };
        if let Some(name) = self.options.camera_medium() {
            media.set.camera = used(&mut media, name, d);
        }

        // Interior materials and boundaries of media
        for shape in shapes.iter().filter(|s| s.media.differ() || self.interior_of(&s.material).is_some()) {
            for name in [&shape.media.inside, &shape.media.outside].into_iter().flatten() {
                let id = used(&mut media, name, d);
                let varies = id.is_some_and(|id| matches!(media.set.media[id as usize], Medium::Heterogeneous(_)));
                if varies && shape.object.is_some() {
                    let text =
                        "a medium stays where it is defined, as in pbrt-v4, wherever instances of the object are";
                    d.warning_once(name.span, text);
                }
            }
        }
        if let Some(span) = self.options.integrator_without_media().filter(|_| !media.set.is_empty()) {
            d.warning_once(span, "media are rendered, which pbrt-v4 does with the integrator `volpath` only");
        }
        media
    }
}

/// A finite non-negative number, or the default after an error.
pub(super) fn not_negative(p: &ParamSet, key: &'static str, default: f32, d: &mut Diagnostics) -> f32 {
    match p.float(key, d) {
        Some(x) if x >= 0.0 && x.is_finite() => x,
        Some(x) => {
            d.error(p.span_of(key), format!("{key} must be finite and not negative, not {x}"));
            default
        }
        None => default,
    }
}

pub(super) fn asymmetry(p: &ParamSet, d: &mut Diagnostics) -> f32 {
    let g = p.float("g", d).unwrap_or(0.0);
    if !(-1.0..=1.0).contains(&g) {
        d.error(p.span_of("g"), format!("g must be from -1 to 1, not {g}"));
    }
    g
}

/// The box between `p0` and `p1`, in the space of the medium: its minimum and maximum corner.
fn bounds(p: &ParamSet, d: &mut Diagnostics) -> Option<[DVec3; 2]> {
    let mut corner = |key, default| p.point(key, d).unwrap_or(default);
    let (a, b) = (corner("p0", DVec3::ZERO), corner("p1", DVec3::ONE));
    let size = (b - a).abs().as_vec3();
    if !(size.min_element() > 0.0 && size.is_finite()) {
        d.error(p.span_of("p1"), "p0 and p1 must differ along every axis");
        return None;
    }
    Some([a.min(b), a.max(b)])
}

fn resolution(p: &ParamSet, d: &mut Diagnostics) -> Option<[usize; 3]> {
    let mut all = [1; 3];
    for (n, key) in all.iter_mut().zip(["nx", "ny", "nz"]) {
        let value = p.integer(key, d).unwrap_or(1);
        if value < 1 {
            d.error(p.span_of(key), format!("{key} must be positive, not {value}"));
            return None;
        }
        *n = value as usize;
    }
    Some(all)
}

fn float_samples(
    p: &mut ParamSet,
    key: &'static str,
    resolution: [usize; 3],
    d: &mut Diagnostics,
) -> Option<Samples<f32>> {
    let span = p.span_of(key);
    let values = p.take_floats(key, &[ParamType::Float], d)?;
    if values.iter().any(|v| !(*v >= 0.0 && v.is_finite())) {
        d.error(span, format!("{key} must be finite and not negative"));
        return None;
    }
    let count = values.len();
    let samples = Samples::new(resolution, values);
    if samples.is_none() {
        d.error(span, wrong_count(key, resolution, count));
    }
    samples
}

fn wrong_count(key: &str, [nx, ny, nz]: [usize; 3], count: usize) -> String {
    format!("{key} has {count} values, and nx × ny × nz = {nx} × {ny} × {nz}")
}

/// Black-body radiance up to the maximum temperature of the samples.
pub(super) fn glowing(samples: Scalars, offset: f32, scale: f32) -> Temperature {
    let hottest = samples.extremes().into_iter().map(|t| (t - offset) * scale).fold(0.0, f32::max);
    let step = (hottest / (TEMPERATURES - 1) as f32).max(f32::MIN_POSITIVE);
    let radiance = (0..TEMPERATURES).map(|i| glow_rgb(i as f32 * step)).collect();
    Temperature { samples, offset, scale, radiance, step }
}
