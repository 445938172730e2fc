//! Content of a measured-BSDF file.
//!
//! Spectra are converted to linear Rec.709 like reflectances: by the CIE 1931 observer under D65, with white at 1. They
//! are linear between the wavelengths of the file and constant beyond the last ones. Colours outside of Rec.709 lose
//! their negative parts. Files with `rgb` instead of `spectra` contain these colours already.

use super::tensor::{Field, TensorError, TensorFile};
use crate::spectra::hat_weights;
use lumiris_numbers::math::Rgb;
use std::path::{Path, PathBuf};

/// The tables of a measured BSDF, over the unit square. Rows are along φ, from −π to π, and columns along √(2θ/π). The
/// tables are ordered by θ, then by φ, of their direction. All numbers are finite.
#[derive(Clone, Debug, PartialEq)]
pub struct MeasuredBsdf {
    /// Description of the measurement.
    pub description: String,
    /// Azimuths of the tables (radians), increasing.
    pub phi: Vec<f32>,
    /// Polar angles of the tables (radians), increasing.
    pub theta: Vec<f32>,
    /// Columns and rows of D.
    pub ndf_size: [usize; 2],
    /// D of a normal (1/sr).
    pub ndf: Vec<f32>,
    /// Columns and rows of σ.
    pub sigma_size: [usize; 2],
    /// Projected area of the facets, by direction.
    pub sigma: Vec<f32>,
    /// Columns and rows of the tables of visible normals.
    pub visible_size: [usize; 2],
    /// Density of visible normals over the unit square, up to a factor.
    pub visible: Vec<f32>,
    /// Columns and rows of the tables of luminance and colour.
    pub color_size: [usize; 2],
    /// Luminance of the samples of visible normals.
    pub luminance: Vec<f32>,
    /// Colours; [`Self::is_relative`] defines their meaning.
    pub color: Vec<Rgb>,
    /// True if the colour is f cos θ over D/(4σ), else f cos θ itself (1/sr).
    pub is_relative: bool,
}

/// Errors of measured-BSDF files.
#[derive(Debug, thiserror::Error)]
pub enum BsdfFileError {
    /// Error of the operating system.
    #[error("{reason}")]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// Its reason.
        reason: std::io::Error,
    },
    /// It is not such a file.
    #[error("{}: {error}", path.display())]
    Wrong {
        /// The file.
        path: PathBuf,
        /// The error.
        error: TensorError,
    },
}

/// Reads a file.
pub fn read_bsdf(path: &Path) -> Result<MeasuredBsdf, BsdfFileError> {
    let path = path.to_owned();
    match std::fs::read(&path) {
        Ok(bytes) => MeasuredBsdf::parse(&bytes).map_err(|error| BsdfFileError::Wrong { path, error }),
        Err(reason) => Err(BsdfFileError::Unreadable { path, reason }),
    }
}

impl MeasuredBsdf {
    /// Parses the bytes of a file.
    pub fn parse(bytes: &[u8]) -> Result<Self, TensorError> {
        let file = TensorFile::parse(bytes)?;
        let (phi, theta) = (increasing(file.need("phi_i")?)?, increasing(file.need("theta_i")?)?);
        let families = [phi.len(), theta.len()];
        let [(ndf_size, ndf), (sigma_size, sigma)] = [facets(file.need("ndf")?)?, facets(file.need("sigma")?)?];
        let [visible, luminance] = [file.need("vndf")?, file.need("luminance")?];
        let color_size = table_size(luminance, &families)?;
        let description = file.field("description").map(Field::bytes).transpose()?.unwrap_or_default();
        let flag = file.need("jacobian")?;
        Ok(MeasuredBsdf {
            description: String::from_utf8_lossy(description).into_owned(),
            ndf_size,
            ndf,
            sigma_size,
            sigma,
            visible_size: table_size(visible, &families)?,
            visible: visible.floats()?,
            luminance: luminance.floats()?,
            color: colors(&file, families, color_size)?,
            is_relative: *flag.bytes()?.first().ok_or_else(|| flag.wrong("`jacobian` is empty".to_owned()))? != 0,
            phi,
            theta,
            color_size,
        })
    }
}

/// The increasing numbers of a one-dimensional field.
fn increasing(field: &Field<'_>) -> Result<Vec<f32>, TensorError> {
    let values = field.floats()?;
    if field.shape.len() != 1 || values.is_empty() {
        return Err(field.wrong(format!("`{}` has the shape {:?}, not that of a list", field.name, field.shape)));
    }
    match values.windows(2).find(|w| w[0] >= w[1]) {
        Some(w) => Err(field.wrong(format!("`{}` must increase, but {} follows {}", field.name, w[1], w[0]))),
        None => Ok(values),
    }
}

/// The size and numbers of a single table. A single row holds for all azimuths and is duplicated.
fn facets(field: &Field<'_>) -> Result<([usize; 2], Vec<f32>), TensorError> {
    match field.shape[..] {
        [1, columns] if columns >= 2 => Ok(([columns, 2], field.floats()?.repeat(2))),
        _ => Ok((table_size(field, &[])?, field.floats()?)),
    }
}

/// Columns and rows of the tables of a field; `families` are the sizes of its leading dimensions.
fn table_size(field: &Field<'_>, families: &[usize]) -> Result<[usize; 2], TensorError> {
    if let Some([rows, columns]) = field.shape.strip_prefix(families)
        && *rows >= 2
        && *columns >= 2
    {
        return Ok([*columns, *rows]);
    }
    let expected: Vec<String> =
        families.iter().map(usize::to_string).chain(["2 or more".into(), "2 or more".into()]).collect();
    let (name, shape) = (&field.name, &field.shape);
    Err(field.wrong(format!("`{name}` has the shape {shape:?}, not [{}]", expected.join(", "))))
}

/// The colours of a file, from its spectra if it has them.
fn colors(file: &TensorFile<'_>, families: [usize; 2], size: [usize; 2]) -> Result<Vec<Rgb>, TensorError> {
    let (field, weights) = match file.field("wavelengths") {
        Some(wavelengths) => (file.need("spectra")?, hat_weights(&increasing(wavelengths)?)),
        None => (file.need("rgb")?, vec![[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]),
    };
    let [columns, rows] = size;
    let expected = [families[0], families[1], weights.len(), rows, columns];
    if field.shape != expected {
        let (name, shape) = (&field.name, &field.shape);
        return Err(field.wrong(format!("`{name}` has the shape {shape:?}, not {expected:?}")));
    }
    let (values, texels) = (field.floats()?, rows * columns);
    let mut colors = Vec::with_capacity(families[0] * families[1] * texels);
    for table in values.chunks_exact(texels * weights.len()) {
        let mut sums = vec![[0.0_f64; 3]; texels];
        for (wave, weight) in table.chunks_exact(texels).zip(&weights) {
            for (sum, &value) in sums.iter_mut().zip(wave) {
                (0..3).for_each(|c| sum[c] += weight[c] * f64::from(value));
            }
        }
        colors.extend(sums.iter().map(|&c| Rgb::from_array(c.map(|c| c.max(0.0) as f32))));
    }
    Ok(colors)
}

#[cfg(test)]
mod tests {
    use super::super::tensor::{FieldData, write_tensor_file};
    use super::*;

    /// A field of a file: name, shape and numbers.
    type Part = (&'static str, Vec<usize>, Vec<f32>);

    fn ramp(n: usize) -> Vec<f32> {
        (0..n).map(|i| i as f32 + 1.0).collect()
    }

    /// A file of 2 azimuths, 3 polar angles, and tables of 2 × 3 to 4 × 4.
    fn parts() -> Vec<Part> {
        vec![
            ("phi_i", vec![2], vec![-3.0, 3.0]),
            ("theta_i", vec![3], vec![0.0, 0.5, 1.5]),
            ("ndf", vec![2, 3], ramp(6)),
            ("sigma", vec![3, 2], ramp(6)),
            ("vndf", vec![2, 3, 4, 4], ramp(96)),
            ("luminance", vec![2, 3, 2, 2], ramp(24)),
            ("rgb", vec![2, 3, 3, 2, 2], ramp(72)),
        ]
    }

    fn file(parts: &[Part], jacobian: &[u8]) -> Vec<u8> {
        let mut fields: Vec<_> =
            parts.iter().map(|(name, shape, v)| (*name, shape.clone(), FieldData::Floats(v))).collect();
        fields.push(("jacobian", vec![jacobian.len()], FieldData::Bytes(jacobian)));
        fields.push(("description", vec![4], FieldData::Bytes(b"test")));
        write_tensor_file(&fields)
    }

    fn error_with(change: impl Fn(&mut Vec<Part>)) -> String {
        let mut parts = parts();
        change(&mut parts);
        MeasuredBsdf::parse(&file(&parts, &[1])).unwrap_err().message
    }

    #[test]
    fn tables_have_their_sizes_and_colours_their_channels() {
        let bsdf = MeasuredBsdf::parse(&file(&parts(), &[1])).unwrap();
        assert_eq!(
            (bsdf.ndf_size, bsdf.sigma_size, bsdf.visible_size, bsdf.color_size),
            ([3, 2], [2, 3], [4, 4], [2, 2])
        );
        assert_eq!((bsdf.color.len(), bsdf.luminance.len(), bsdf.visible.len()), (24, 24, 96));
        assert_eq!((bsdf.color[1], bsdf.color[5]), (Rgb::new(2.0, 6.0, 10.0), Rgb::new(14.0, 18.0, 22.0)));
        assert!(bsdf.is_relative && bsdf.description == "test");
        assert!(!MeasuredBsdf::parse(&file(&parts(), &[0])).unwrap().is_relative);
        // One row of D is for all azimuths
        let mut parts = parts();
        parts[2] = ("ndf", vec![1, 3], ramp(3));
        let bsdf = MeasuredBsdf::parse(&file(&parts, &[1])).unwrap();
        assert_eq!((bsdf.ndf_size, bsdf.ndf), ([3, 2], vec![1.0, 2.0, 3.0, 1.0, 2.0, 3.0]));
    }

    #[test]
    fn spectra_that_are_the_same_everywhere_are_grey_and_long_waves_are_red() {
        // From 450 to 700 nm: the spectrum of white must be extended beyond
        let with = |values: [f32; 3]| {
            let mut parts = parts();
            parts.pop();
            parts.push(("wavelengths", vec![3], vec![450.0, 550.0, 700.0]));
            let waves = values.iter().flat_map(|&v| [v; 4]);
            parts.push(("spectra", vec![2, 3, 3, 2, 2], waves.cycle().take(72).collect()));
            MeasuredBsdf::parse(&file(&parts, &[1])).unwrap().color[7]
        };
        let grey = with([0.3; 3]);
        assert!((grey - Rgb::splat(0.3)).map(f32::abs).max_component() < 1e-6, "{grey:?}");
        let red = with([0.0, 0.0, 1.0]);
        assert!(red.r > 2.0 * red.g && red.b >= 0.0, "{red:?}");
        // The same curve, converted as a reflectance
        let pairs = [359.0, 0.0, 450.0, 0.0, 550.0, 0.0, 700.0, 1.0, 900.0, 1.0];
        let curve = crate::spectra::Spectrum::from_pairs(&pairs).unwrap();
        let expected = crate::spectra::unbounded_rgb(&curve);
        assert!((red - expected).map(f32::abs).max_component() < 1e-5, "{red:?} {expected:?}");
    }

    #[test]
    fn what_does_not_fit_is_an_error_that_says_so() {
        assert!(error_with(|p| p[0].2 = vec![1.0, 1.0]).contains("`phi_i` must increase, but 1 follows 1"));
        assert!(error_with(|p| p[1].1 = vec![3, 1]).contains("`theta_i` has the shape [3, 1], not that of a list"));
        assert!(error_with(|p| p[2] = ("ndf", vec![6, 1], ramp(6))).contains("not [2 or more, 2 or more]"));
        assert!(error_with(|p| p[4].1 = vec![3, 2, 4, 4]).contains("[3, 2, 4, 4], not [2, 3, 2 or more, 2 or more]"));
        assert!(error_with(|p| p[6].1 = vec![2, 3, 2, 3, 2]).contains("`rgb` has the shape [2, 3, 2, 3, 2]"));
        assert!(error_with(|p| p[6].0 = "spectra").contains("there is no field `rgb`"));
        assert!(error_with(|p| p[3].0 = "area").contains("there is no field `sigma`"));
        assert!(error_with(|p| p[5].2[3] = f32::INFINITY).contains("number 3 of `luminance` is inf"));
        let empty = MeasuredBsdf::parse(&file(&parts(), &[])).unwrap_err();
        assert_eq!(empty.message, "`jacobian` is empty");
    }

    #[test]
    fn cut_files_are_errors_and_changed_ones_never_panic() {
        let bytes = file(&parts(), &[1]);
        for length in (0..bytes.len()).step_by(3) {
            assert!(MeasuredBsdf::parse(&bytes[..length]).is_err(), "{length}");
        }
        for at in 0..bytes.len().min(600) {
            for value in [0, 1, 0x40, 0xff] {
                let mut changed = bytes.clone();
                changed[at] = value;
                let _ = MeasuredBsdf::parse(&changed);
            }
        }
    }
}
