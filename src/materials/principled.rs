//! The material of [`crate::bsdfs::principled`].

use super::parameters::{Textures, distribution_of};
use crate::bsdfs::Principled;
use crate::bsdfs::principled::{Interior, rough};
use crate::bsdfs::sheen::{LEAST_ALPHA, Sheen};
use crate::textures::{FloatTextureId, RgbTextureId};
use lumiris_numbers::math::{Frame, Vec2, Vec3, sqr};

/// Anisotropy of several models, by its strength, 0..1. With 0 both alphas equal the alpha of the roughness.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Anisotropy {
    /// `KHR_materials_anisotropy`: alpha along the direction tends to 1 with the square of the strength.
    Gltf(f32),
    /// OpenPBR: the ratio of the alphas is 1 − strength, with the same mean of their squares.
    OpenPbr(f32),
    /// The ratio is 1 − 0.9 strength, with the same product [Burley 2012].
    Disney(f32),
}

/// The direction of the anisotropy, if it is not ∂p/∂u.
#[derive(Clone, Copy, Debug)]
pub struct AnisotropyDirection {
    /// Angle from ∂p/∂u towards ∂p/∂v (radians).
    pub rotation: f32,
    /// Texture of `KHR_materials_anisotropy`. Red and green are the direction before the rotation, along ∂p/∂u and
    /// ∂p/∂v, where 0 to 1 map to −1 to 1. Blue is a factor of the strength.
    pub map: Option<RgbTextureId>,
}

impl AnisotropyDirection {
    /// `frame` rotated about its z axis to the direction. ∂p/∂v, `dpdv`, determines the sense of rotation.
    fn turned(&self, frame: &Frame, dpdv: Vec3, t: &Textures<'_>) -> Frame {
        let direction = self.map.map_or(Vec2::X, |map| {
            let c = t.rgb(map) * 2.0;
            Vec2::new(c.r - 1.0, c.g - 1.0)
        });
        let direction = Vec2::from_angle(self.rotation).rotate(direction);
        let up = if frame.y.dot(dpdv) < 0.0 { -frame.y } else { frame.y };
        let x = frame.x * direction.x + up * direction.y;
        if x.length_squared() > 1e-6 { Frame::from_xz(x, frame.z) } else { *frame }
    }
}

impl Anisotropy {
    /// Multiplies the strength by `factor`.
    fn times(self, factor: f32) -> Self {
        match self {
            Anisotropy::Gltf(strength) => Anisotropy::Gltf(strength * factor),
            Anisotropy::OpenPbr(strength) => Anisotropy::OpenPbr(strength * factor),
            Anisotropy::Disney(strength) => Anisotropy::Disney(strength * factor),
        }
    }

    /// Alphas along the direction and across it.
    fn alphas(self, alpha: f32) -> [f32; 2] {
        match self {
            Anisotropy::Gltf(strength) => [alpha + (1.0 - alpha) * sqr(strength.clamp(0.0, 1.0)), alpha],
            Anisotropy::OpenPbr(strength) => {
                let ratio = 1.0 - strength;
                let along = alpha * (2.0 / (1.0 + sqr(ratio))).sqrt();
                [along, ratio * along]
            }
            Anisotropy::Disney(strength) => {
                let aspect = (1.0 - 0.9 * strength).sqrt();
                [alpha / aspect, alpha * aspect]
            }
        }
    }
}

/// Textures of a principled BSDF; weights and colours are clamped to 0..1.
#[derive(Clone, Copy, Debug)]
pub struct PrincipledMaterial {
    /// Colour of metal, diffuse base and glass.
    pub base_color: RgbTextureId,
    /// Fraction of metal.
    pub metalness: FloatTextureId,
    /// Square root of alpha.
    pub roughness: FloatTextureId,
    /// Ratio of alpha along ∂p/∂u and across it.
    pub anisotropy: Anisotropy,
    /// Direction of the anisotropy; `None`: along ∂p/∂u.
    pub direction: Option<AnisotropyDirection>,
    /// Index of refraction.
    pub ior: f32,
    /// Factor of the dielectric's reflectance.
    pub specular: FloatTextureId,
    /// Colour of the dielectric's reflectance at normal incidence.
    pub specular_color: RgbTextureId,
    /// Fraction of glass in the dielectric.
    pub transmission: FloatTextureId,
    /// True if glass is a thin sheet; else a solid.
    pub is_thin: bool,
    /// Weight of the sheen.
    pub sheen: FloatTextureId,
    /// Colour of the sheen.
    pub sheen_color: RgbTextureId,
    /// Square root of the sheen's alpha.
    pub sheen_roughness: FloatTextureId,
    /// Weight of the coat.
    pub coat: FloatTextureId,
    /// Square root of the coat's alpha.
    pub coat_roughness: FloatTextureId,
}

impl PrincipledMaterial {
    /// The frame of the BSDF: `frame`, rotated to the direction of the anisotropy if there is one.
    pub(super) fn frame(&self, frame: Frame, dpdv: Vec3, t: &Textures<'_>) -> Frame {
        self.direction.map_or(frame, |direction| direction.turned(&frame, dpdv, t))
    }

    /// The BSDF at a point.
    pub(super) fn bsdf(&self, t: &Textures<'_>) -> Principled {
        let unit = |id: FloatTextureId| t.float(id).clamp(0.0, 1.0);
        let specular = unit(self.specular);
        let f0 = sqr((self.ior - 1.0) / (self.ior + 1.0));

        // Roughness along and across the direction of anisotropy
        let alpha = sqr(unit(self.roughness));
        let factor = self.direction.and_then(|d| d.map).map_or(1.0, |map| t.rgb(map).b.clamp(0.0, 1.0));
        let [along, across] = self.anisotropy.times(factor).alphas(alpha);

        // An interface with an IOR of about 1 does not refract
        let coat_alpha = sqr(unit(self.coat_roughness));
        let refracts = !self.is_thin && (self.ior - 1.0).abs() > 1e-3;
        Principled {
            base_color: t.albedo(self.base_color),
            metalness: unit(self.metalness),
            f0: (t.rgb(self.specular_color) * f0).clamp(0.0, 1.0) * specular,
            f90: specular,
            distribution: rough(distribution_of(along, across, false)),
            transmission: unit(self.transmission),
            interior: if refracts { Interior::Solid(self.ior) } else { Interior::Thin },
            sheen: Sheen {
                color: t.rgb(self.sheen_color).clamp(0.0, 1.0) * unit(self.sheen),
                alpha: sqr(unit(self.sheen_roughness)).max(LEAST_ALPHA),
            },
            coat: unit(self.coat),
            coat_distribution: rough(distribution_of(coat_alpha, coat_alpha, false)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn anisotropy_is_what_each_model_says() {
        let alpha = 0.25;
        for none in [Anisotropy::Gltf(0.0), Anisotropy::OpenPbr(0.0), Anisotropy::Disney(0.0)] {
            assert_eq!(none.alphas(alpha), [alpha; 2], "{none:?}");
        }
        assert_eq!(Anisotropy::Gltf(1.0).alphas(alpha), [1.0, alpha]);
        let [x, y] = Anisotropy::OpenPbr(0.6).alphas(alpha);
        assert!((y / x - 0.4).abs() < 1e-6 && ((x * x + y * y) / 2.0 - alpha * alpha).abs() < 1e-6, "{x} {y}");
        let [x, y] = Anisotropy::Disney(0.6).alphas(alpha);
        assert!((y / x - 0.46).abs() < 1e-6 && (x * y - alpha * alpha).abs() < 1e-6, "{x} {y}");
    }
}
