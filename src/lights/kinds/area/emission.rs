//! Emission of an area light's surface.

use super::alpha_mask::AlphaMask;
use crate::imaging::AxisWrap;
use crate::lights::kinds::environment::cleaned;
use glam::Affine2;
use lumiris_numbers::math::{Rgb, Vec2, Vec3};
use std::sync::Arc;

/// Emission of a surface.
#[derive(Clone, Debug)]
pub struct Emission {
    /// Radiance, including the scale. If there is an image, its values are multiplied by this.
    pub l: Rgb,
    /// True if both sides emit; else the side of the geometric normal.
    pub two_sided: bool,
    /// Radiance over the texture coordinates.
    pub image: Option<Arc<EmissionImage>>,
    /// True if the vertex colours of a triangle mesh are a factor.
    pub has_vertex_colors: bool,
    /// The alpha texture of the surface, if it has one.
    pub alpha: Option<Arc<AlphaMask>>,
}

impl Emission {
    /// The same radiance everywhere, on the side of the normal.
    pub fn constant(l: Rgb) -> Self {
        Emission { l, two_sided: false, image: None, has_vertex_colors: false, alpha: None }
    }

    /// True if the emission varies with the texture coordinates.
    #[inline]
    pub fn is_textured(&self) -> bool {
        self.image.is_some() || self.alpha.is_some()
    }

    /// Radiance at `uv` in direction `w`, where the normal is `n`.
    #[inline]
    pub fn l(&self, n: Vec3, uv: Vec2, w: Vec3) -> Rgb {
        if !self.two_sided && n.dot(w) <= 0.0 {
            return Rgb::BLACK;
        }
        self.radiance(uv)
    }

    /// Radiance at `uv` on a side that emits.
    #[inline]
    pub fn radiance(&self, uv: Vec2) -> Rgb {
        match &self.image {
            None => self.l,
            Some(image) => self.l * image.lookup(uv),
        }
    }

    /// The radiance, averaged over the image.
    pub fn mean(&self) -> Rgb {
        self.image.as_ref().map_or(self.l, |image| self.l * image.mean)
    }

    /// Luminance of [`mean`](Self::mean).
    pub fn mean_luminance(&self) -> f32 {
        luminance_of(self.mean())
    }
}

/// Luminance of a radiance that may not be finite.
pub(super) fn luminance_of(radiance: Rgb) -> f32 {
    let luminance = radiance.luminance();
    if luminance.is_finite() { luminance.max(0.0) } else { 0.0 }
}

/// A linear RGB image that an area light emits; v = 0 is its last row, as in pbrt-v4.
#[derive(Clone, Debug)]
pub struct EmissionImage {
    width: usize,
    height: usize,
    data: Vec<Rgb>,
    mean: Rgb,
    wrap: [AxisWrap; 2],
    mapping: Option<EmissionMapping>,
    /// True if the nearest pixel counts, else the four nearest ones.
    is_nearest: bool,
}

/// Texture coordinates of an emission image on triangles, if they differ from the coordinates of other textures.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EmissionMapping {
    /// True for the second texture coordinates.
    pub second: bool,
    /// Transform from texture coordinates to image coordinates.
    pub image_from_uv: Affine2,
}

impl EmissionImage {
    /// An image whose rows start at the top. Negative and non-finite values become 0.
    ///
    /// Returns `Err` with a message if the sizes do not fit.
    pub fn new(width: usize, height: usize, data: Vec<Rgb>) -> Result<Self, String> {
        if width == 0 || height == 0 || data.len() != width * height {
            return Err(format!("an emission image of {width}×{height} has {} pixels", data.len()));
        }
        let data: Vec<Rgb> = data.into_iter().map(cleaned).collect();
        let mut sums = [0.0_f64; 3];
        for c in &data {
            for (sum, x) in sums.iter_mut().zip(c.to_array()) {
                *sum += f64::from(x);
            }
        }
        let mean = Rgb::from_array(sums.map(|s| (s / data.len() as f64) as f32));
        Ok(EmissionImage { width, height, data, mean, wrap: [AxisWrap::Clamp; 2], mapping: None, is_nearest: false })
    }

    /// Sets the wrap modes of the edges (columns first) and the mapping of texture coordinates.
    #[must_use]
    pub fn placed(self, wrap: [AxisWrap; 2], mapping: Option<EmissionMapping>) -> Self {
        EmissionImage { wrap, mapping, ..self }
    }

    /// Disables interpolation between pixels.
    #[must_use]
    pub fn nearest(self) -> Self {
        EmissionImage { is_nearest: true, ..self }
    }

    /// The mapping of texture coordinates to image coordinates, if the image has one.
    pub fn mapping(&self) -> Option<&EmissionMapping> {
        self.mapping.as_ref()
    }

    /// The radiance at `uv`: bilinear interpolation, or the nearest pixel.
    pub fn lookup(&self, uv: Vec2) -> Rgb {
        // Larger floats have no fractional bits to interpolate with
        let limit = |v: f32, count: usize, wrap: AxisWrap| match wrap {
            AxisWrap::Clamp => v.clamp(-1.0, count as f32),
            AxisWrap::Repeat | AxisWrap::Mirror => v.clamp(-1e7, 1e7),
        };
        let x = limit(uv.x * self.width as f32 - 0.5, self.width, self.wrap[0]);
        let y = limit((1.0 - uv.y) * self.height as f32 - 0.5, self.height, self.wrap[1]);
        let texel = |x: f32, y: f32| {
            let column = self.wrap[0].pixel(x as i64, self.width as i64) as usize;
            let row = self.wrap[1].pixel(y as i64, self.height as i64) as usize;
            self.data[row * self.width + column]
        };
        if self.is_nearest {
            return texel((x + 0.5).floor(), (y + 0.5).floor());
        }
        let (x0, y0) = (x.floor(), y.floor());
        let (dx, dy) = (x - x0, y - y0);
        let top = texel(x0, y0).lerp(texel(x0 + 1.0, y0), dx);
        let bottom = texel(x0, y0 + 1.0).lerp(texel(x0 + 1.0, y0 + 1.0), dx);
        top.lerp(bottom, dy)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn images_are_looked_up_from_the_bottom_and_clamped() {
        let data = [1.0, 2.0, 3.0, 4.0].map(Rgb::splat).to_vec();
        let image = EmissionImage::new(2, 2, data).unwrap();
        let at = |u, v| image.lookup(Vec2::new(u, v)).r;
        assert_eq!((at(0.25, 0.75), at(0.75, 0.75), at(0.25, 0.25), at(0.75, 0.25)), (1.0, 2.0, 3.0, 4.0));
        assert_eq!((at(-5.0, 9.0), at(7.0, -3.0), at(0.5, 0.5)), (1.0, 4.0, 2.5));
        let repeated = image.clone().placed([AxisWrap::Repeat, AxisWrap::Mirror], None);
        assert_eq!(repeated.lookup(Vec2::new(-0.75, 1.25)).r, 1.0);
        assert_eq!(repeated.lookup(Vec2::new(3.75, -0.75)).r, 2.0);
        let nearest = image.clone().nearest();
        let at = |u, v| nearest.lookup(Vec2::new(u, v)).r;
        assert_eq!((at(0.49, 0.51), at(0.51, 0.51), at(0.0, 0.0), at(7.0, -3.0)), (1.0, 2.0, 3.0, 4.0));
        assert!(EmissionImage::new(2, 2, vec![Rgb::WHITE; 3]).is_err());
        let emission = Emission { image: Some(Arc::new(image)), ..Emission::constant(Rgb::splat(2.0)) };
        assert!((emission.mean_luminance() - 5.0).abs() < 1e-5);
        assert!(emission.l(Vec3::Z, Vec2::ZERO, -Vec3::Z).is_black());
    }
}
