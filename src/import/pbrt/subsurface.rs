//! `Material "subsurface"`: a dielectric boundary around a scattering interior.

use super::checks::unknown;
use super::descriptions::{Interior, MaterialDesc, MaterialUse, ShapeDesc};
use super::media::MediaInUse;
use super::media_presets;
use super::spectrum::SpectrumUse;
use super::state::Builder;
use crate::lights::Light;
use crate::materials::{HalfSpace, Material, MaterialId};
use crate::media::{Homogeneous, Medium, MediumId};
use lumiris_formats::diagnostic::Diagnostics;
use lumiris_formats::pbrt::params::{ParamSet, ParamType};
use lumiris_numbers::math::Rgb;

/// Parameters that must be constant in an interior.
const COLORS: [&str; 4] = ["sigma_a", "sigma_s", "reflectance", "mfp"];
/// Default index of refraction.
const ETA: f32 = 1.33;
/// Default σ_a and σ_s, as in pbrt-v4 (1/mm): milk.
const DEFAULT: [Rgb; 2] = [Rgb::new(0.0011, 0.0024, 0.014), Rgb::new(2.55, 3.21, 3.77)];

impl Builder<'_> {
    /// The material of the boundary; the interior is stored separately.
    pub(super) fn subsurface(&mut self, desc: &MaterialDesc, d: &mut Diagnostics) -> Material {
        let p = &desc.params;
        if let Some(key) = COLORS.into_iter().find(|key| p.type_of(key) == Some(ParamType::Texture)) {
            let text = format!("an interior is the same everywhere: with a textured `{key}` the material is diffuse");
            d.warning_once(p.span_of(key), text);
            let reflectance = self.albedo(p, "reflectance", Rgb::splat(0.5), d);
            p.ignore_all();
            return Material::Diffuse { reflectance };
        }
        let eta = if p.type_of("eta").is_some() { self.ior(p, "eta", d) } else { ETA };
        let roughness = self.roughness(p, ["roughness", "uroughness", "vroughness"], 0.0, d);
        if let Some(medium) = self.interior(p, eta, d) {
            let is_zero = |id| self.textures.constant_float(id) == Some(0.0);
            let is_smooth = is_zero(roughness.u) && is_zero(roughness.v);
            self.interiors.insert(desc.id, Interior { medium, is_smooth, span: desc.kind.span });
        }
        Material::Dielectric { eta, roughness }
    }

    /// The interior; `None` after an error.
    fn interior(&self, p: &ParamSet, eta: f32, d: &mut Diagnostics) -> Option<Homogeneous> {
        let g = p.float("g", d).unwrap_or(0.0);
        if !(-1.0..=1.0).contains(&g) {
            d.error(p.span_of("g"), format!("g must be from -1 to 1, not {g}"));
            return None;
        }
        let scale = p.float("scale", d).unwrap_or(1.0);
        if !(scale > 0.0 && scale.is_finite()) {
            d.error(p.span_of("scale"), format!("scale must be positive, not {scale}"));
            return None;
        }

        // Coefficients by preset, by reflectance, or given
        let name = p.string("name", d).map(str::to_owned);
        let given = |key: &str| p.type_of(key).is_some();
        let [sigma_a, sigma_s] = match name {
            Some(name) => {
                if let Some(key) = COLORS.into_iter().find(|key| p.ignore(key)) {
                    d.warning_once(p.span_of(key), format!("`name` goes before `{key}`, as in pbrt-v4"));
                }
                let Some(sigma) = media_presets::preset(&name) else {
                    unknown(&name, p.span_of("name"), "preset", &media_presets::names(), d);
                    return None;
                };
                sigma.map(|sigma| sigma * scale)
            }
            None if given("reflectance") => self.sigma_of_reflectance(p, eta, g, scale, d)?,
            None => self.sigma(p, d)?.map(|sigma| sigma * scale),
        };
        Some(Homogeneous { sigma_a, sigma_s, le: Rgb::BLACK, g })
    }

    /// σ_a and σ_s as given: both or none.
    fn sigma(&self, p: &ParamSet, d: &mut Diagnostics) -> Option<[Rgb; 2]> {
        let keys = ["sigma_a", "sigma_s"];
        let [a, s] = keys.map(|key| self.color_param(p, key, SpectrumUse::Unbounded, d));
        for (key, other) in [(keys[0], keys[1]), (keys[1], keys[0])] {
            if p.type_of(key).is_some() && p.type_of(other).is_none() {
                d.error(p.span_of(key), format!("`{key}` needs `{other}` beside it"));
                return None;
            }
        }
        let sigma = if p.type_of(keys[0]).is_none() { DEFAULT } else { [a?, s?] };
        for (key, sigma) in keys.into_iter().zip(sigma) {
            if !sigma.to_array().iter().all(|&c| c >= 0.0 && c.is_finite()) {
                d.error(p.span_of(key), format!("{key} must be finite and not negative"));
                return None;
            }
        }
        Some(sigma)
    }

    /// σ_a and σ_s of an interior whose half-space has the given `reflectance`, with mean free paths of `scale` ×
    /// `mfp`.
    fn sigma_of_reflectance(
        &self,
        p: &ParamSet,
        eta: f32,
        g: f32,
        scale: f32,
        d: &mut Diagnostics,
    ) -> Option<[Rgb; 2]> {
        if let Some(key) = ["sigma_a", "sigma_s"].into_iter().find(|key| p.ignore(key)) {
            d.error(p.span_of(key), format!("a subsurface has `reflectance` or `{key}`, not both"));
            p.ignore("sigma_s");
            return None;
        }

        // Reflectance and mean free path
        let reflectance = self.color_param(p, "reflectance", SpectrumUse::Albedo, d);
        let mfp = match p.type_of("mfp") {
            Some(ParamType::Float) => p.float("mfp", d).map(Rgb::splat),
            Some(_) => self.color_param(p, "mfp", SpectrumUse::Unbounded, d),
            None => Some(Rgb::WHITE),
        };
        let (reflectance, mfp) = (reflectance?.clamp(0.0, 1.0), mfp? * scale);
        if !mfp.to_array().iter().all(|&c| c > 0.0 && c.is_finite()) {
            d.error(p.span_of("mfp"), "mfp must be finite and positive");
            return None;
        }

        // Invert the reflectance of the half-space
        let space = HalfSpace::new(eta);
        let albedo = reflectance.map(|r| space.albedo(f64::from(r), f64::from(g)) as f32);
        let sigma_t = Rgb::WHITE / mfp;
        Some([sigma_t * (Rgb::WHITE - albedo), sigma_t * albedo])
    }

    /// The material of a shape, if it has an interior.
    pub(super) fn interior_of(&self, material: &MaterialUse) -> Option<MaterialId> {
        let id = match material {
            MaterialUse::Id(id) => Some(*id),
            MaterialUse::Named(name) => self.named_materials.get(&name.text).map(|(id, _)| *id),
        };
        id.filter(|id| self.interiors.contains_key(id))
    }

    /// Adds the interiors of shapes to the media.
    pub(super) fn add_interiors(&self, media: &mut MediaInUse, shapes: &[ShapeDesc], d: &mut Diagnostics) {
        let has_delta = self.lights.iter().any(Light::is_delta);
        for shape in shapes {
            let Some(material) = self.interior_of(&shape.material) else { continue };
            if let Some(inside) = shape.media.inside.as_ref().filter(|_| shape.media.differ()) {
                d.warning_once(
                    inside.span,
                    format!("the material's interior goes before the medium `{}`", inside.text),
                );
            }

            // One interior for each material
            if media.interiors.contains_key(&material) {
                continue;
            }

            // Delta lights cannot be sampled through a smooth boundary
            let Interior { medium, is_smooth, span } = self.interiors[&material];
            if is_smooth && has_delta {
                let text =
                    "light of a point or from one direction does not come through the smooth boundary of an interior";
                if let Some(warning) = d.warning_once(span, text) {
                    warning.help("give the material a `roughness`, or the light an extent");
                }
            }
            let id = media.set.media.len() as MediumId;
            media.set.media.push(Medium::Interior(medium));
            media.set.names.push(self.materials[material as usize].name.clone());
            media.interiors.insert(material, id);
        }
    }
}
