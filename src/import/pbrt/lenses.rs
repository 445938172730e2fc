//! `Camera "realistic"`: the lens file, and the shape of the aperture.

use super::checks::positive;
use crate::cameras::{Aperture, LensElement, LensSystem};
use crate::imaging::oiio::ImageFile;
use lumiris_formats::diagnostic::Diagnostics;
use lumiris_formats::names::file_in;
use lumiris_formats::number::numbers_of_text;
use lumiris_formats::pbrt::params::ParamSet;
use std::path::{Path, PathBuf};

/// Default diameter of the stop, as in pbrt-v4 (mm).
const APERTURE: f32 = 1.0;

/// The files that a camera names.
pub(super) fn files(p: &ParamSet, folder: &Path) -> Vec<PathBuf> {
    // Parameter errors were reported before
    let d = &mut Diagnostics::new();
    let aperture = p.string("aperture", d).filter(|name| Aperture::named(name).is_none());
    p.string("lensfile", d).into_iter().chain(aperture).map(|name| file_in(folder, name)).collect()
}

/// The lenses, in focus, for a film with the given diagonal (m).
pub(super) fn realistic(p: &ParamSet, folder: &Path, diagonal: f32, d: &mut Diagnostics) -> Option<LensSystem> {
    let Some(name) = p.string("lensfile", d) else {
        d.error(p.span, "camera `realistic` needs `string lensfile`");
        return None;
    };

    // Lens file
    let (path, span) = (file_in(folder, name), p.span_of("lensfile"));
    let text = match std::fs::read(&path) {
        Ok(bytes) => String::from_utf8_lossy(&bytes).into_owned(),
        Err(error) => {
            d.missing_file(path, error, Some(span));
            return None;
        }
    };
    let mut elements = match elements_of_text(&text) {
        Ok(elements) => elements,
        Err(reason) => {
            d.error(span, format!("{}: {reason}", path.display()));
            return None;
        }
    };

    // Aperture diameter (mm in the file), limited by the lens
    let stop = f64::from(positive(p, "aperturediameter", APERTURE, d)) / 1000.0 / 2.0;
    for element in elements.iter_mut().filter(|e| e.curvature_radius == 0.0) {
        if stop > element.aperture_radius {
            let widest = (element.aperture_radius * 2000.0) as f32;
            let message = format!("the aperture of these lenses is {widest} mm at most, which it has here");
            d.warning_once(p.span_of("aperturediameter"), message);
        }
        element.aperture_radius = stop.min(element.aperture_radius);
    }

    // Focus
    let focus = positive(p, "focusdistance", 10.0, d);
    let aperture = aperture(p, folder, d)?;
    match LensSystem::new(&elements, aperture, f64::from(focus), f64::from(diagonal)) {
        Ok(lens) => Some(lens),
        Err(reason) => {
            d.error(span, format!("{}: {reason}", path.display()));
            None
        }
    }
}

/// Lines of four numbers: radius of curvature, thickness, index of refraction, diameter; lengths in mm.
fn elements_of_text(text: &str) -> Result<Vec<LensElement>, String> {
    let numbers = numbers_of_text(text)?;
    if numbers.is_empty() || !numbers.len().is_multiple_of(4) {
        return Err(format!(
            "a lens has four numbers for each surface: radius, thickness, index of refraction, diameter. There are {}",
            numbers.len()
        ));
    }
    let element = |v: &[f32]| {
        let [radius, thickness, eta, diameter] = [v[0], v[1], v[2], v[3]].map(f64::from);
        LensElement {
            curvature_radius: radius / 1000.0,
            thickness: thickness / 1000.0,
            eta,
            aperture_radius: 0.5 * diameter / 1000.0,
        }
    };
    Ok(numbers.chunks_exact(4).map(element).collect())
}

/// A shape by its name, or an image.
fn aperture(p: &ParamSet, folder: &Path, d: &mut Diagnostics) -> Option<Aperture> {
    let Some(name) = p.string("aperture", d) else { return Some(Aperture::Circle) };

    // Shape
    if let Some(aperture) = Aperture::named(name) {
        return Some(aperture);
    }
    let span = p.span_of("aperture");
    if !name.contains('.') {
        super::checks::unknown(name, span, "aperture", &Aperture::NAMES, d);
        return None;
    }

    // Image: mean of the colour channels
    let path = file_in(folder, name);
    let read = ImageFile::open(&path).and_then(|file| {
        let colors = file.layer().channels;
        let count = colors.as_slice().len();
        let texels = file.floats(colors.as_slice())?;
        let mean = |texel: &[f32]| texel.iter().sum::<f32>() / count as f32;
        Ok(Aperture::Image(texels.chunks_exact(count).map(mean).collect(), file.sizes()[0]))
    });
    match read {
        Ok(aperture) => Some(aperture),
        Err(error) => {
            crate::import::resources::report(&error, &path, span, d);
            None
        }
    }
}
