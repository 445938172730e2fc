//! Display colours of PNG, JPEG, TIFF and TGA images: exposure and view transform.

use super::UsageError;
use anyhow::Context;
use clap::Args;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use lumiris::imaging::oiio::{OcioView, ocio_display};
use lumiris::imaging::view_transform::auto_exposure;
use lumiris::imaging::{TextEntries, ViewTransform};
use strum::VariantNames;

/// Common OpenColorIO names of the linear Rec.709 colour space, in which images are stored.
const LINEAR_REC709: [&str; 7] = [
    "lin_rec709",
    "lin_srgb",
    "Linear Rec.709 (sRGB)",
    "Linear Rec.709",
    "Utility - Linear - Rec.709",
    "Utility - Linear - sRGB",
    "lnf",
];

/// Exposure of display images.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Exposure {
    /// Number of stops.
    Stops(f32),
    /// Computed from the image.
    Auto,
}

/// A view transform.
#[derive(Clone, Copy, Debug, PartialEq)]
enum View {
    /// Built-in curve.
    Curve(ViewTransform),
    /// View of an OpenColorIO configuration.
    Ocio,
}

/// Options of display images.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "PNG, JPEG, TIFF and TGA")]
pub(super) struct LookArgs {
    /// Exposure in stops, or `auto`: the geometric mean of the luminance becomes middle grey
    #[arg(
        long, value_name = "STOPS", default_value = "0", allow_negative_numbers = true, value_parser = parse_exposure
    )]
    exposure: Exposure,
    /// View transform. `ocio`: the view of the OpenColorIO configuration named by the environment variable OCIO
    #[arg(long, value_name = "NAME", default_value = "srgb", value_parser = view())]
    view_transform: View,
    /// Display of the configuration [default: the configuration's]
    #[arg(long, value_name = "NAME")]
    ocio_display: Option<String>,
    /// View of the display [default: the display's]
    #[arg(long, value_name = "NAME")]
    ocio_view: Option<String>,
    /// Looks, instead of the looks of the view
    #[arg(long, value_name = "NAMES")]
    ocio_looks: Option<String>,
    /// The configuration's name for linear light with Rec.709 primaries [default: the first of the common names that it
    /// has]
    #[arg(long, value_name = "NAME")]
    ocio_input: Option<String>,
}

/// Display colours with their metadata.
pub(super) struct Displayed {
    /// RGB, interleaved, 0..1.
    pub pixels: Vec<f32>,
    /// Exposure and view transform, as metadata.
    pub metadata: TextEntries,
}

/// Exposure and a built-in curve.
#[derive(Clone, Copy, Debug)]
pub(super) struct Grade {
    stops: f32,
    curve: ViewTransform,
}

impl Grade {
    /// Applies exposure and curve to pixels: RGB, interleaved.
    pub(super) fn apply(&self, pixels: &mut [f32]) {
        let gain = self.stops.exp2();
        for rgb in pixels.as_chunks_mut::<3>().0 {
            *rgb = self.curve.apply(rgb.map(|v| v * gain));
        }
    }

    /// Exposure and view transform, as metadata.
    pub(super) fn metadata(&self) -> TextEntries {
        metadata(self.stops, <&str>::from(self.curve).to_owned())
    }
}

fn metadata(stops: f32, view: String) -> TextEntries {
    let entry = |key: &str, value: String| (format!("lumiris:{key}"), value);
    vec![entry("exposure", stops.to_string()), entry("view_transform", view)]
}

fn parse_exposure(text: &str) -> Result<Exposure, String> {
    match text.parse::<f32>() {
        _ if text == "auto" => Ok(Exposure::Auto),
        Ok(stops) if stops.is_finite() => Ok(Exposure::Stops(stops)),
        _ => Err("expected a number of stops, or `auto`".to_owned()),
    }
}

fn view() -> impl TypedValueParser<Value = View> {
    let names = ViewTransform::VARIANTS.iter().copied().chain(["ocio"]);
    PossibleValuesParser::new(names)
        .try_map(|name| if name == "ocio" { Ok(View::Ocio) } else { name.parse().map(View::Curve) })
}

impl LookArgs {
    /// Refuses impossible combinations before time is spent on rendering.
    pub(super) fn check(&self) -> anyhow::Result<()> {
        let is_ocio = self.view_transform == View::Ocio;
        let of_ocio = [&self.ocio_display, &self.ocio_view, &self.ocio_looks, &self.ocio_input];
        if !is_ocio && of_ocio.iter().any(|option| option.is_some()) {
            return Err(UsageError("--ocio-… needs --view-transform ocio".to_owned()).into());
        }
        if is_ocio {
            if std::env::var_os("OCIO").is_none_or(|path| path.is_empty()) {
                let help = "--view-transform ocio: the environment variable OCIO names no configuration";
                return Err(UsageError(help.to_owned()).into());
            }
            self.ocio(&mut [0.18; 3])?;
        }
        Ok(())
    }

    /// The exposure of an image (stops).
    fn stops(&self, radiance: &[f32]) -> f32 {
        match self.exposure {
            Exposure::Stops(stops) => stops,
            Exposure::Auto => auto_exposure(radiance.as_chunks::<3>().0.iter().copied()),
        }
    }

    /// The per-pixel operation; `None` if it depends on the whole image or is left to OpenColorIO.
    pub(super) fn grade(&self) -> Option<Grade> {
        match (self.exposure, self.view_transform) {
            (Exposure::Stops(stops), View::Curve(curve)) => Some(Grade { stops, curve }),
            _ => None,
        }
    }

    /// The display colours of an image: RGB, interleaved.
    pub(super) fn apply_to(&self, mut pixels: Vec<f32>) -> anyhow::Result<Displayed> {
        let stops = self.stops(&pixels);
        let metadata = match self.view_transform {
            View::Curve(curve) => {
                let grade = Grade { stops, curve };
                grade.apply(&mut pixels);
                grade.metadata()
            }
            View::Ocio => {
                let gain = stops.exp2();
                pixels.iter_mut().for_each(|v| *v *= gain);
                metadata(stops, self.ocio(&mut pixels)?)
            }
        };
        Ok(Displayed { pixels, metadata })
    }

    /// Applies the OpenColorIO view. Returns the names of colour space, display, view and looks.
    fn ocio(&self, pixels: &mut [f32]) -> anyhow::Result<String> {
        let or_empty = |name: &Option<String>| name.clone().unwrap_or_default();
        let (display, view, looks) =
            (or_empty(&self.ocio_display), or_empty(&self.ocio_view), or_empty(&self.ocio_looks));
        let by = |input: &str, pixels: &mut [f32]| {
            ocio_display(pixels, &OcioView { input, display: &display, view: &view, looks: &looks })
        };
        let input = match &self.ocio_input {
            Some(name) => name.as_str(),
            None => *LINEAR_REC709.iter().find(|name| by(name, &mut [0.18; 3]).is_ok()).unwrap_or(&LINEAR_REC709[0]),
        };
        let [display, view] = by(input, pixels).with_context(|| {
            format!("--view-transform ocio, with the colour space {input} (--ocio-input names another)")
        })?;
        let looks = if looks.is_empty() { looks } else { format!(", {looks}") };
        Ok(format!("ocio: {input} to {display}, {view}{looks}"))
    }
}
