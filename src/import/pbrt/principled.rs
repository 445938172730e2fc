//! `Material "principled"`: a part of OpenPBR, by its names. All but the last three may be textures.
//!
//! | parameter | default |
//! |---|---|
//! | `spectrum base_color` | 0.8 |
//! | `float base_metalness`, `transmission_weight`, `coat_weight`, `coat_roughness` | 0 |
//! | `float specular_weight` | 1 |
//! | `spectrum specular_color` | 1 |
//! | `float specular_roughness` (the square root of alpha) | 0.3 |
//! | `float specular_ior` | 1.5 |
//! | `float specular_roughness_anisotropy` | 0 |
//! | `bool geometry_thin_walled` | false |

use super::state::Builder;
use crate::materials::{Material, PrincipledMaterial};
use lumiris_formats::diagnostic::Diagnostics;
use lumiris_formats::pbrt::params::ParamSet;
use lumiris_numbers::math::Rgb;

impl Builder<'_> {
    /// The material that the parameters describe.
    pub(super) fn principled(&mut self, p: &ParamSet, d: &mut Diagnostics) -> Material {
        Material::Principled(PrincipledMaterial {
            base_color: self.albedo(p, "base_color", Rgb::splat(0.8), d),
            metalness: self.float_param(p, "base_metalness", 0.0, d),
            roughness: self.float_param(p, "specular_roughness", 0.3, d),
            anisotropy: p.float("specular_roughness_anisotropy", d).unwrap_or(0.0),
            ior: self.ior(p, "specular_ior", d),
            specular: self.float_param(p, "specular_weight", 1.0, d),
            specular_color: self.albedo(p, "specular_color", Rgb::WHITE, d),
            transmission: self.float_param(p, "transmission_weight", 0.0, d),
            is_thin: p.boolean("geometry_thin_walled", d).unwrap_or(false),
            coat: self.float_param(p, "coat_weight", 0.0, d),
            coat_roughness: self.float_param(p, "coat_roughness", 0.0, d),
        })
    }
}
