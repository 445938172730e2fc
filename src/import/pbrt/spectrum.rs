//! Spectrum parameters to linear Rec.709.

use super::state::Builder;
use lumiris_formats::color_space::Colored;
use lumiris_formats::diagnostic::Diagnostics;
use lumiris_formats::names::file_in;
use lumiris_formats::pbrt::params::SpectrumValue;
use lumiris_formats::source::Span;
use lumiris_formats::spectra::{self, Spectrum};
use lumiris_formats::upsampling::unbounded_spectrum;
use lumiris_numbers::math::Rgb;

/// The quantity of a spectrum, which determines the colour of its samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SpectrumUse {
    /// A factor between 0 and 1, seen under white light.
    Albedo,
    /// Any non-negative quantity, such as an index of refraction.
    Unbounded,
    /// Emitted light; spectra and blackbodies are scaled to unit luminance, as pbrt-v4 does.
    Illuminant,
}

impl SpectrumUse {
    /// The quantity of its colours.
    pub fn colored(self) -> Colored {
        match self {
            SpectrumUse::Illuminant => Colored::Light,
            SpectrumUse::Albedo | SpectrumUse::Unbounded => Colored::Factor,
        }
    }
}

/// A spectrum parameter that is a colour or a curve.
#[derive(Clone, Debug, PartialEq)]
pub enum Resolved {
    /// A colour already.
    Rgb(Rgb),
    /// A curve over wavelength.
    Curve(Spectrum),
}

impl Resolved {
    /// A non-negative quantity over wavelength: the curve, or a smooth one for the colour.
    pub fn unbounded_curve(self) -> Spectrum {
        match self {
            Resolved::Rgb(rgb) => unbounded_spectrum(rgb),
            Resolved::Curve(curve) => curve,
        }
    }
}

impl Builder<'_> {
    /// Resolves a spectrum parameter; `None` after an error.
    pub fn resolve_spectrum(
        &self,
        value: SpectrumValue<'_>,
        usage: SpectrumUse,
        span: Span,
        d: &mut Diagnostics,
    ) -> Option<Resolved> {
        match value {
            // Albedo values outside 0 to 1 are a warning at their use
            SpectrumValue::Rgb(rgb, _) if usage != SpectrumUse::Albedo && rgb.iter().any(|c| *c < 0.0) => {
                d.error(span, "a colour must not be negative");
                None
            }
            SpectrumValue::Rgb(rgb, space) => {
                let rgb = space.unwrap_or(self.state.color_space).to_rec709(rgb, usage.colored());
                finite(rgb, span, d).map(Resolved::Rgb)
            }
            SpectrumValue::Xyz(xyz) => finite(spectra::xyz_to_rgb(xyz), span, d).map(Resolved::Rgb),
            SpectrumValue::Blackbody(kelvin, factor) if kelvin > 0.0 && kelvin.is_finite() => {
                Some(Resolved::Rgb(spectra::blackbody_rgb(kelvin) * factor))
            }
            SpectrumValue::Blackbody(..) => {
                d.error(span, "a temperature must be positive");
                None
            }
            SpectrumValue::Samples(samples) => match Spectrum::from_pairs(samples) {
                Ok(spectrum) => Some(Resolved::Curve(spectrum)),
                Err(reason) => {
                    d.error(span, reason);
                    None
                }
            },
            SpectrumValue::Named(name) => self.named_spectrum(name, span, d),
        }
    }

    fn named_spectrum(&self, name: &str, span: Span, d: &mut Diagnostics) -> Option<Resolved> {
        if let Some(curve) = Spectrum::named(name) {
            return Some(Resolved::Curve(curve));
        }
        if let Some(rgb) = spectra::illuminant_rgb(name) {
            return Some(Resolved::Rgb(rgb));
        }

        // A file; names without a dot are likely misspelt
        let path = file_in(&self.folder, name);
        match Spectrum::read(&path) {
            Ok(Ok(curve)) => {
                self.spectrum_files.borrow_mut().push(path);
                return Some(Resolved::Curve(curve));
            }
            Ok(Err(error)) if name.contains('.') => d.missing_file(path, error, Some(span)),
            Ok(Err(_)) => super::checks::unknown(name, span, "spectrum", &Spectrum::names().collect::<Vec<_>>(), d),
            Err(reason) => {
                d.error(span, format!("{}: {reason}", path.display()));
            }
        }
        None
    }

    /// The colour of a spectrum parameter; `None` after an error.
    pub fn color(&self, value: SpectrumValue<'_>, usage: SpectrumUse, span: Span, d: &mut Diagnostics) -> Option<Rgb> {
        Some(match (self.resolve_spectrum(value, usage, span, d)?, usage) {
            (Resolved::Rgb(rgb), _) => rgb,
            (Resolved::Curve(curve), SpectrumUse::Illuminant) => spectra::emission_rgb(&curve),
            (Resolved::Curve(curve), SpectrumUse::Albedo) => spectra::reflectance_rgb(&curve),
            (Resolved::Curve(curve), SpectrumUse::Unbounded) => spectra::unbounded_rgb(&curve),
        })
    }
}

fn finite(rgb: Rgb, span: Span, d: &mut Diagnostics) -> Option<Rgb> {
    if rgb.is_finite() {
        return Some(rgb);
    }
    d.error(span, "a colour must be finite");
    None
}
