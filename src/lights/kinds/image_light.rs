//! Lights at a point whose radiant intensity is an image: goniometric diagrams and slide projectors, as in pbrt-v4.
//!
//! An image covers the sphere by the equal-area octahedral map, or a rectangle of the plane z = 1 in the space of the
//! light. Texels are looked up without interpolation.

use super::environment::cleaned;
use super::point;
use crate::lights::{EmissionSample, LightBounds, LightCtx, LightSample};
use lumiris_numbers::math::sphere_map::{equal_area_sphere_to_square, equal_area_square_to_sphere};
use lumiris_numbers::math::{Bounds3, Mat3, PiecewiseConstant2D, Rgb, Vec2, Vec3};
use std::f32::consts::PI;

/// Cosine to the axis below which a projector is dark: directions nearly perpendicular to the axis or behind it do not
/// meet the plane.
const MIN_COS: f32 = 1e-3;
/// Reduction of the cosine of a projector's bounding cone below the cosine of its corners, against rounding.
const MARGIN: f32 = 1e-4;

/// How an image covers directions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ImageMapping {
    /// The whole sphere, by the equal-area octahedral map [Clarberg 2008].
    Sphere,
    /// The rectangle |x| ≤ `half[0]`, |y| ≤ `half[1]` of the plane z = 1; rows from the least y.
    Plane {
        /// Half of its width and of its height.
        half: [f32; 2],
    },
}

/// A light at a point, with an image of its radiant intensity.
#[derive(Clone, Debug)]
pub struct ImageLight {
    /// Position.
    p: Vec3,
    /// Orthogonal map of directions.
    world_from_light: Mat3,
    mapping: ImageMapping,
    /// Radiant intensities, row by row.
    texels: Vec<Rgb>,
    size: [usize; 2],
    /// Luminance times solid angle over the square.
    distribution: PiecewiseConstant2D,
    /// Luminance of the power.
    power_luminance: f32,
}

impl ImageLight {
    /// A light at `p` with `texels` of radiant intensity (W/sr), in the row order of the mapping. Components that are
    /// negative or not finite become 0.
    ///
    /// Returns `Err` with a message if there are no texels.
    pub fn new(
        p: Vec3,
        world_from_light: Mat3,
        mapping: ImageMapping,
        texels: Vec<Rgb>,
        size: [usize; 2],
    ) -> Result<Self, String> {
        let [width, height] = size;
        if width == 0 || height == 0 || texels.len() != width * height {
            return Err(format!("an image of {width}×{height} has {} texels", texels.len()));
        }
        let texels: Vec<Rgb> = texels.into_iter().map(cleaned).collect();
        let powers = powers(mapping, size, &texels);
        let weights: Vec<f32> = powers.iter().map(|&w| w as f32).collect();
        let power_luminance = powers.iter().sum::<f64>() as f32;
        let distribution = PiecewiseConstant2D::new(&weights, width);
        Ok(ImageLight { p, world_from_light, mapping, texels, size, distribution, power_luminance })
    }

    /// Name of the kind of light, for messages.
    pub fn kind_name(&self) -> &'static str {
        match self.mapping {
            ImageMapping::Sphere => "goniometric",
            ImageMapping::Plane { .. } => "projection",
        }
    }

    /// Multiplies all intensities. Photons are still sampled by the luminance of the original image.
    #[must_use]
    pub fn scaled(mut self, factor: Rgb) -> Self {
        self.texels.iter_mut().for_each(|c| *c *= factor);
        self.power_luminance = powers(self.mapping, self.size, &self.texels).iter().sum::<f64>() as f32;
        self
    }

    /// Luminance of the emitted power.
    pub fn power_luminance(&self) -> f32 {
        self.power_luminance
    }

    /// Radiant intensity towards the unit direction `w`.
    #[inline]
    pub fn intensity(&self, w: Vec3) -> Rgb {
        let w = self.world_from_light.transpose() * w;
        let uv = match self.mapping {
            ImageMapping::Sphere => equal_area_sphere_to_square(w),
            ImageMapping::Plane { half } => {
                if w.z < MIN_COS {
                    return Rgb::BLACK;
                }
                let uv = Vec2::new(w.x / w.z / half[0], w.y / w.z / half[1]) * 0.5 + 0.5;
                if uv.min_element() < 0.0 || uv.max_element() > 1.0 {
                    return Rgb::BLACK;
                }
                uv
            }
        };
        let [width, height] = self.size;
        let bin = |x: f32, n: usize| ((x * n as f32) as usize).min(n - 1);
        self.texels[bin(uv.y, height) * width + bin(uv.x, width)]
    }

    /// See [`crate::lights::Light::sample_li`].
    #[inline]
    pub(in crate::lights) fn sample_li(&self, ctx: &LightCtx) -> Option<LightSample> {
        point::sample_li_from(self.p, ctx, |w| self.intensity(w))
    }

    /// See [`crate::lights::Light::sample_le`]: in proportion to the image.
    pub(in crate::lights) fn sample_le(&self, u: [f32; 2]) -> Option<EmissionSample> {
        let s = self.distribution.sample(u)?;
        let (w, steradians) = match self.mapping {
            ImageMapping::Sphere => (equal_area_square_to_sphere(s.p), 4.0 * PI),
            ImageMapping::Plane { half: [hx, hy] } => {
                let w = Vec3::new((2.0 * s.p.x - 1.0) * hx, (2.0 * s.p.y - 1.0) * hy, 1.0).normalize();
                // dω = cos³θ dA
                (w, 4.0 * hx * hy * w.z * w.z * w.z)
            }
        };
        let d = (self.world_from_light * w).normalize();
        let [width, height] = self.size;
        let bin = |x: f32, n: usize| ((x * n as f32) as usize).min(n - 1);
        let intensity = self.texels[bin(s.p.y, height) * width + bin(s.p.x, width)];
        EmissionSample::in_space(self.p, d, intensity * (steradians / s.pdf))
    }

    /// Bounds for the light tree: a cone about the corners of a projector, or all directions, with the mean intensity.
    pub(in crate::lights) fn bounds(&self) -> LightBounds {
        let at = Bounds3 { min: self.p, max: self.p };
        match self.mapping {
            ImageMapping::Sphere => LightBounds {
                bounds: at,
                cos_theta_o: -1.0,
                cos_theta_e: 0.0,
                intensity: self.power_luminance / (4.0 * PI),
                ..LightBounds::EMPTY
            },
            ImageMapping::Plane { half: [hx, hy] } => {
                // The cone touches the corners of the image
                let cos_theta_o = 1.0 / (1.0 + hx * hx + hy * hy).sqrt() - MARGIN;
                let steradians = 4.0 * corner([hx.into(), hy.into()]) as f32;
                LightBounds {
                    bounds: at,
                    axis: (self.world_from_light * Vec3::Z).normalize(),
                    cos_theta_o,
                    cos_theta_e: if cos_theta_o < 0.0 { 0.0 } else { 1.0 },
                    intensity: self.power_luminance / steradians,
                    ..LightBounds::EMPTY
                }
            }
        }
    }
}

/// Luminance of the power of each texel.
fn powers(mapping: ImageMapping, size: [usize; 2], texels: &[Rgb]) -> Vec<f64> {
    let of = |(i, c): (usize, &Rgb)| f64::from(c.luminance()) * solid_angle(mapping, size, [i % size[0], i / size[0]]);
    texels.iter().enumerate().map(of).collect()
}

/// Solid angle of a rectangle of the plane z = 1 between the axis and a corner (x, y).
fn corner([x, y]: [f64; 2]) -> f64 {
    (x * y / (1.0 + x * x + y * y).sqrt()).atan()
}

/// Solid angle of a texel.
fn solid_angle(mapping: ImageMapping, size: [usize; 2], texel: [usize; 2]) -> f64 {
    match mapping {
        ImageMapping::Sphere => 4.0 * std::f64::consts::PI / (size[0] * size[1]) as f64,
        ImageMapping::Plane { half } => {
            let edge = |axis: usize, i: usize| (2.0 * i as f64 / size[axis] as f64 - 1.0) * f64::from(half[axis]);
            let [x, y] = [0, 1].map(|axis| [edge(axis, texel[axis]), edge(axis, texel[axis] + 1)]);
            corner([x[1], y[1]]) - corner([x[0], y[1]]) - corner([x[1], y[0]]) + corner([x[0], y[0]])
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 3 × 2 texels of one channel, all different.
    fn projector(p: Vec3, world_from_light: Mat3) -> ImageLight {
        let texels = (0..6).map(|i| Rgb::splat(1.0 + i as f32)).collect();
        let mapping = ImageMapping::Plane { half: [0.6, 0.4] };
        ImageLight::new(p, world_from_light, mapping, texels, [3, 2]).unwrap()
    }

    #[test]
    fn a_projector_lights_each_part_of_the_plane_by_its_texel() {
        let light = projector(Vec3::ZERO, Mat3::IDENTITY);
        let at = |x: f32, y: f32| light.intensity(Vec3::new(x, y, 1.0).normalize()).r;
        assert_eq!([at(-0.4, -0.2), at(0.0, -0.2), at(0.4, -0.2)], [1.0, 2.0, 3.0]);
        assert_eq!([at(-0.4, 0.2), at(0.0, 0.2), at(0.4, 0.2)], [4.0, 5.0, 6.0]);
        assert_eq!([at(0.61, 0.0), at(0.0, 0.41), at(-0.61, 0.0)], [0.0; 3]);
        assert_eq!(light.intensity(-Vec3::Z), Rgb::BLACK);
        // Rotated to face the point, at a distance of 2
        let turned = projector(Vec3::new(0.0, 0.0, 5.0), Mat3::from_rotation_x(PI));
        let s = turned.sample_li(&LightCtx::at(Vec3::new(0.0, 0.0, 3.0))).unwrap();
        assert!((s.li.r - turned.intensity(-Vec3::Z).r / 4.0).abs() < 1e-6 && s.is_delta && s.wi == Vec3::Z);
    }

    #[test]
    fn solid_angles_of_texels_add_up() {
        let mapping = ImageMapping::Plane { half: [0.6, 0.4] };
        let sum: f64 = (0..6).map(|i| solid_angle(mapping, [3, 2], [i % 3, i / 3])).sum();
        assert!((sum - 4.0 * corner([0.6_f32.into(), 0.4_f32.into()])).abs() < 1e-12);
        // A cube has six faces
        assert!((6.0 * 4.0 * corner([1.0, 1.0]) - 4.0 * std::f64::consts::PI).abs() < 1e-12);
        let light = ImageLight::new(Vec3::ZERO, Mat3::IDENTITY, ImageMapping::Sphere, vec![Rgb::splat(2.0); 4], [2, 2]);
        assert!((light.unwrap().power_luminance() - 8.0 * PI).abs() < 1e-4);
    }

    #[test]
    fn the_bounds_hold_all_lit_directions() {
        let light = projector(Vec3::ONE, Mat3::from_rotation_y(0.7));
        let bounds = light.bounds();
        for i in 0..400 {
            let [x, y] = [(i % 20) as f32 / 19.0 * 1.2 - 0.6, (i / 20) as f32 / 19.0 * 0.8 - 0.4];
            let w = (light.world_from_light * Vec3::new(x, y, 1.0)).normalize();
            assert!(light.intensity(w).is_black() || w.dot(bounds.axis) > bounds.cos_theta_o);
        }
        assert!(ImageLight::new(Vec3::ONE, Mat3::IDENTITY, ImageMapping::Sphere, Vec::new(), [0, 0]).is_err());
    }
}
