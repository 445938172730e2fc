//! Images for a page: tone-mapped radiance, and colour-coded values.

use lumiris::imaging::color::linear_to_srgb;
pub use lumiris::imaging::heat::{HEAT, RED_GREEN, Scale, significant};
use lumiris::imaging::oiio::{ImageError, Part, write_image};
use std::path::Path;

/// Display values, RGB interleaved, row-major from the top left.
#[derive(Clone, Debug)]
pub struct Image {
    width: usize,
    height: usize,
    data: Vec<f32>,
}

impl Image {
    /// Radiance times `gain`, with the sRGB curve.
    pub fn tone_mapped(size: [u32; 2], radiance: &[[f32; 3]], gain: f32) -> Self {
        let encode = |v: f32| linear_to_srgb((v * gain).clamp(0.0, 1.0));
        Image {
            width: size[0] as usize,
            height: size[1] as usize,
            data: radiance.iter().flat_map(|p| p.map(encode)).collect(),
        }
    }

    /// From display values, RGB interleaved.
    pub fn from_display(size: [u32; 2], data: Vec<f32>) -> Self {
        Image { width: size[0] as usize, height: size[1] as usize, data }
    }

    /// Values as colours of a scale.
    pub fn colored(size: [u32; 2], values: &[f64], scale: &Scale) -> Self {
        let data = values.iter().flat_map(|&v| scale.color(v).map(|c| (c / 255.0) as f32)).collect();
        Image { width: size[0] as usize, height: size[1] as usize, data }
    }

    /// Writes `name`.png into `folder` and returns the name of the file.
    pub fn write(self, folder: &Path, name: &str) -> Result<String, ImageError> {
        let file = format!("{name}.png");
        let channels = ["R", "G", "B"].map(str::to_owned).to_vec();
        write_image(&folder.join(&file), &[Part::display(self.width, self.height, channels, self.data)])?;
        Ok(file)
    }
}

/// The part of an image between left, top, right and bottom, in fractions: its size and its pixels.
pub fn crop(size: [u32; 2], image: &[[f32; 3]], [l, t, r, b]: [f64; 4]) -> ([u32; 2], Vec<[f32; 3]>) {
    let [w, h] = size.map(|s| s as usize);
    let at = |f: f64, n: usize| ((f * n as f64) as usize).min(n - 1);
    let (l, t) = (at(l, w), at(t, h));
    let (r, b) = (at(r, w).max(l + 1), at(b, h).max(t + 1));
    let pixels = (t..b).flat_map(|y| image[y * w + l..y * w + r].iter().copied()).collect();
    ([(r - l) as u32, (b - t) as u32], pixels)
}

/// The gain that maps the 95th percentile to 0.8.
pub fn gain(radiance: &[[f32; 3]]) -> f32 {
    let mut maxima: Vec<f32> = radiance.iter().map(|p| p[0].max(p[1]).max(p[2])).filter(|v| *v > 0.0).collect();
    maxima.sort_by(f32::total_cmp);
    match maxima.get(maxima.len() * 19 / 20) {
        Some(&v) if v.is_finite() => 0.8 / v,
        _ => 1.0,
    }
}
