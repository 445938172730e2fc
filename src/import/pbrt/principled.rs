//! `Material "principled"`: a part of OpenPBR, by its names. All but the last three may be textures.
//!
//! | parameter | default | range |
//! |---|---|---|
//! | `spectrum base_color` | 0.8 | 0 to 1 |
//! | `float base_metalness`, `transmission_weight`, `fuzz_weight`, `coat_weight`, `coat_roughness` | 0 | 0 to 1 |
//! | `float specular_weight` | 1 | 0 to 1 |
//! | `spectrum specular_color` | 1 | not negative |
//! | `float specular_roughness` (the square root of alpha) | 0.3 | 0 to 1 |
//! | `spectrum fuzz_color` | 1 | 0 to 1 |
//! | `float fuzz_roughness` (the square root of alpha) | 0.5 | 0 to 1 |
//! | `float specular_ior` | 1.5 | above 0 |
//! | `float specular_roughness_anisotropy` | 0 | 0 to 1 |
//! | `bool geometry_thin_walled` | false | |
//!
//! Values outside of their ranges are errors; those of textures are clamped.

use super::state::Builder;
use crate::materials::{Material, PrincipledMaterial};
use crate::textures::{FloatTextureId, RgbTextureId};
use lumiris_formats::diagnostic::Diagnostics;
use lumiris_formats::pbrt::params::{ParamSet, ParamType, SpectrumValue};
use lumiris_numbers::math::Rgb;

impl Builder<'_> {
    /// The material that the parameters describe.
    pub(super) fn principled(&mut self, p: &ParamSet, d: &mut Diagnostics) -> Material {
        let anisotropy = p.float("specular_roughness_anisotropy", d).unwrap_or(0.0);
        check_unit(anisotropy, p, "specular_roughness_anisotropy", d);
        Material::Principled(PrincipledMaterial {
            base_color: self.color_up_to(1.0, p, ("base_color", Rgb::splat(0.8)), d),
            metalness: self.unit(p, "base_metalness", 0.0, d),
            roughness: self.unit(p, "specular_roughness", 0.3, d),
            anisotropy,
            ior: self.ior(p, "specular_ior", d),
            specular: self.unit(p, "specular_weight", 1.0, d),
            specular_color: self.color_up_to(f32::INFINITY, p, ("specular_color", Rgb::WHITE), d),
            transmission: self.unit(p, "transmission_weight", 0.0, d),
            is_thin: p.boolean("geometry_thin_walled", d).unwrap_or(false),
            sheen: self.unit(p, "fuzz_weight", 0.0, d),
            sheen_color: self.color_up_to(1.0, p, ("fuzz_color", Rgb::WHITE), d),
            sheen_roughness: self.unit(p, "fuzz_roughness", 0.5, d),
            coat: self.unit(p, "coat_weight", 0.0, d),
            coat_roughness: self.unit(p, "coat_roughness", 0.0, d),
        })
    }

    /// A number from 0 to 1, or a texture.
    fn unit(&mut self, p: &ParamSet, name: &'static str, default: f32, d: &mut Diagnostics) -> FloatTextureId {
        let id = self.float_param(p, name, default, d);
        let number = self.textures.constant_float(id).filter(|_| p.type_of(name) == Some(ParamType::Float));
        if let Some(x) = number {
            check_unit(x, p, name, d);
        }
        id
    }

    /// A colour whose numbers, as they are written, are from 0 to `most`; or another spectrum, or a texture.
    fn color_up_to(
        &mut self,
        most: f32,
        p: &ParamSet,
        (name, default): (&'static str, Rgb),
        d: &mut Diagnostics,
    ) -> RgbTextureId {
        let id = self.albedo(p, name, default, d);
        let is_rgb = p.type_of(name) == Some(ParamType::Rgb);
        if let Some(SpectrumValue::Rgb([r, g, b])) = is_rgb.then(|| p.spectrum(name, d)).flatten()
            && [r, g, b].iter().any(|x| !(0.0..=most).contains(x))
        {
            let range = if most.is_finite() { format!("from 0 to {most}") } else { "0 or more".to_owned() };
            d.error(p.span_of(name), format!("the numbers of {name} must be {range}, not {r} {g} {b}"));
        }
        id
    }
}

fn check_unit(x: f32, p: &ParamSet, name: &'static str, d: &mut Diagnostics) {
    if !(0.0..=1.0).contains(&x) {
        d.error(p.span_of(name), format!("{name} must be from 0 to 1, not {x}"));
    }
}
