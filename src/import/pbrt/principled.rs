//! `Material "principled"`: a subset of OpenPBR, with its names. All parameters but the last three may be textures.
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
//! Values outside of their ranges are errors; texture values are clamped. Parameters may also have their names in
//! Blender and in Disney's material ([`SPELLINGS`]), with these differences:
//!
//! * `specular_ior_level` and `specular` (numbers, default 0.5) are half of the reflectance factor;
//! * `anisotropic` keeps the product of both alphas; their ratio is 1 − 0.9 times the value [Burley 2012];
//! * `anisotropic_rotation` rotates the direction of the greater alpha from ∂p/∂u towards ∂p/∂v; 1 is a full turn;
//! * `clearcoatgloss` (a number) is a coat whose alpha is 0.1 to 0.001.

use super::state::Builder;
use crate::materials::principled::{Anisotropy, AnisotropyDirection};
use crate::materials::{Material, PrincipledMaterial};
use crate::textures::{FloatTexture, FloatTextureId, RgbTexture, RgbTextureId};
use lumiris_formats::diagnostic::Diagnostics;
use lumiris_formats::pbrt::params::{ParamSet, ParamType, SpectrumValue};
use lumiris_numbers::math::Rgb;
use std::f32::consts::TAU;

/// Names of OpenPBR, and synonyms.
const SPELLINGS: &[(&str, &[&str])] = &[
    ("base_color", &["basecolor"]),
    ("base_metalness", &["metallic"]),
    ("specular_roughness", &["roughness"]),
    ("specular_ior", &["ior", "eta"]),
    ("specular_color", &["specular_tint"]),
    ("transmission_weight", &["spectrans"]),
    ("fuzz_weight", &["sheen_weight", "sheen"]),
    ("fuzz_color", &["sheen_tint"]),
    ("fuzz_roughness", &["sheen_roughness"]),
    ("coat_weight", &["clearcoat"]),
    ("geometry_thin_walled", &["thin"]),
];

impl Builder<'_> {
    /// The material described by the parameters.
    pub(super) fn principled(&mut self, p: &ParamSet, d: &mut Diagnostics) -> Material {
        // Names as in the file: OpenPBR, Blender or Disney
        let mut name = |name: &'static str| spelled(p, name, d);
        let [color, metalness, roughness, ior] =
            ["base_color", "base_metalness", "specular_roughness", "specular_ior"].map(&mut name);
        let [specular_color, transmission, coat, thin] =
            ["specular_color", "transmission_weight", "coat_weight", "geometry_thin_walled"].map(&mut name);
        let fuzz = ["fuzz_weight", "fuzz_color", "fuzz_roughness"].map(&mut name);
        Material::Principled(PrincipledMaterial {
            base_color: self.color_up_to(1.0, p, color, Rgb::splat(0.8), d),
            metalness: self.unit(p, metalness, 0.0, d),
            roughness: self.unit(p, roughness, 0.3, d),
            anisotropy: anisotropy(p, d),
            direction: number_of(p, ["anisotropic_rotation"], d)
                .map(|turns| AnisotropyDirection { rotation: turns.x * TAU, map: None }),
            ior: self.ior(p, ior, d),
            specular: self.unit(p, "specular_weight", 1.0, d),
            specular_color: self.specular_color(p, specular_color, d),
            transmission: self.unit(p, transmission, 0.0, d),
            is_thin: p.boolean(thin, d).unwrap_or(false),
            sheen: self.unit(p, fuzz[0], 0.0, d),
            sheen_color: self.color_up_to(1.0, p, fuzz[1], Rgb::WHITE, d),
            sheen_roughness: self.unit(p, fuzz[2], 0.5, d),
            coat: self.unit(p, coat, 0.0, d),
            coat_roughness: self.coat_roughness(p, d),
        })
    }

    /// The specular colour, multiplied by twice the level of Blender and Disney.
    fn specular_color(&mut self, p: &ParamSet, name: &'static str, d: &mut Diagnostics) -> RgbTextureId {
        let color = self.color_up_to(f32::INFINITY, p, name, Rgb::WHITE, d);
        let Some(Number { name, x: level }) = number_of(p, ["specular_ior_level", "specular"], d) else { return color };
        check_unit(level, p, name, d);
        let level = self.textures.add_rgb(RgbTexture::Constant(Rgb::splat(2.0 * level)));
        self.textures.add_rgb(RgbTexture::Product { tex1: color, tex2: level })
    }

    /// The roughness of the coat, or the equivalent of Disney's gloss.
    fn coat_roughness(&mut self, p: &ParamSet, d: &mut Diagnostics) -> FloatTextureId {
        let Some(Number { name, x: gloss }) = number_of(p, ["clearcoatgloss"], d) else {
            return self.unit(p, "coat_roughness", 0.0, d);
        };
        check_unit(gloss, p, name, d);
        self.textures.add_float(FloatTexture::Constant((0.1 + (0.001 - 0.1) * gloss).sqrt()))
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

    /// A colour whose literal components are from 0 to `most`; or another spectrum, or a texture.
    fn color_up_to(
        &mut self,
        most: f32,
        p: &ParamSet,
        name: &'static str,
        default: Rgb,
        d: &mut Diagnostics,
    ) -> RgbTextureId {
        let id = self.albedo(p, name, default, d);
        let is_rgb = p.type_of(name) == Some(ParamType::Rgb);
        if let Some(SpectrumValue::Rgb([r, g, b], _)) = is_rgb.then(|| p.spectrum(name, d)).flatten()
            && [r, g, b].iter().any(|x| !(0.0..=most).contains(x))
        {
            let range = if most.is_finite() { format!("from 0 to {most}") } else { "0 or more".to_owned() };
            d.error(p.span_of(name), format!("the numbers of {name} must be {range}, not {r} {g} {b}"));
        }
        id
    }
}

/// The synonym under which a parameter of OpenPBR is given; more than one is an error.
fn spelled(p: &ParamSet, name: &'static str, d: &mut Diagnostics) -> &'static str {
    let others = SPELLINGS.iter().find(|(of, _)| *of == name).map_or(&[][..], |(_, others)| others);
    let mut given = std::iter::once(name).chain(others.iter().copied()).filter(|n| p.type_of(n).is_some());
    let Some(first) = given.next() else { return name };
    for other in given {
        p.ignore(other);
        d.error(p.span_of(other), format!("{other} is {first}, which is given as well"));
    }
    first
}

/// A number with its name; no name if it is not given.
#[derive(Clone, Copy, Default)]
struct Number {
    name: &'static str,
    x: f32,
}

/// The number of the first of these names that is given.
fn number_of<const N: usize>(p: &ParamSet, names: [&'static str; N], d: &mut Diagnostics) -> Option<Number> {
    names.into_iter().find_map(|name| p.float(name, d).map(|x| Number { name, x }))
}

fn anisotropy(p: &ParamSet, d: &mut Diagnostics) -> Anisotropy {
    let of_disney = number_of(p, ["anisotropic"], d);
    let Number { name, x } = of_disney.or(number_of(p, ["specular_roughness_anisotropy"], d)).unwrap_or_default();
    if !name.is_empty() {
        check_unit(x, p, name, d);
    }
    if of_disney.is_some() { Anisotropy::Disney(x) } else { Anisotropy::OpenPbr(x) }
}

fn check_unit(x: f32, p: &ParamSet, name: &'static str, d: &mut Diagnostics) {
    if !(0.0..=1.0).contains(&x) {
        d.error(p.span_of(name), format!("{name} must be from 0 to 1, not {x}"));
    }
}
