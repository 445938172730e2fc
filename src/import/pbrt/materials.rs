//! `Material`, `MakeNamedMaterial`

use super::checks::{file_name, unknown};
use super::descriptions::{MaterialDesc, MaterialUse};
use super::spectrum::{Resolved, SpectrumUse};
use super::state::Builder;
use crate::bsdfs::models::LobeAxis;
use crate::import::images::{ImageChannels, ImageEncoding, ImageRequest};
use crate::materials::{
    Coat, ConductorSpectrum, Dispersion, EvaluatedMaterial, Material, MaterialEntry, MaterialId, NormalMap, Roughness,
};
use crate::textures::{Filter, RgbTexture, RgbTextureId, Wrap};
use lumiris_formats::diagnostic::Diagnostics;
use lumiris_formats::names::{file_in, nfc};
use lumiris_formats::pbrt::directive::Name;
use lumiris_formats::pbrt::params::{Input, ParamSet, ParamType, SpectrumValue};
use lumiris_formats::source::Span;
use lumiris_formats::spectra;
use lumiris_numbers::math::Rgb;
use std::sync::Arc;

/// Parameters of a roughness along both axes, and along each.
const ROUGHNESS: [&str; 3] = ["roughness", "uroughness", "vroughness"];
const OF_INTERFACE: [&str; 3] = ["interface.roughness", "interface.uroughness", "interface.vroughness"];
const OF_CONDUCTOR: [&str; 3] = ["conductor.roughness", "conductor.uroughness", "conductor.vroughness"];
/// Kinds of pbrt-v4 that are rendered, `principled` and `evaluated`.
const KINDS: &[&str] = &[
    "diffuse",
    "conductor",
    "dielectric",
    "thindielectric",
    "diffusetransmission",
    "coateddiffuse",
    "coatedconductor",
    "subsurface",
    "mix",
    "interface",
    "principled",
    "hair",
    "measured",
    "evaluated",
];

/// Models of the material `evaluated`.
const MODELS: &[&str] = &["diffuse", "orennayar", "cooktorrance", "phong", "retroreflective", "ashikhminshirley"];

impl Builder<'_> {
    /// `Material "kind"`, which is made after all names are defined.
    pub fn material(&mut self, kind: Name, params: ParamSet) {
        let id = self.add_material(kind.text.clone(), kind, params);
        self.state.material = MaterialUse::Id(id);
    }

    /// `MakeNamedMaterial "name" "string type" "kind"`
    pub fn make_named_material(&mut self, name: Name, params: ParamSet, d: &mut Diagnostics) {
        if let Some((_, first)) = self.named_materials.get(&name.text) {
            let message = format!("material `{}` is defined twice", name.text);
            d.error(name.span, message).label(*first, "first defined here");
            return;
        }
        let Some(text) = params.string("type", d).map(str::to_owned) else {
            d.error(params.span, format!("material `{}` needs a `string type`", name.text));
            return;
        };
        let kind = Name { text, span: params.span_of("type") };
        let id = self.add_material(name.text.clone(), kind, params);
        self.named_materials.insert(name.text, (id, name.span));
    }

    /// Reserves an index for the material.
    fn add_material(&mut self, name: String, kind: Name, params: ParamSet) -> MaterialId {
        let (id, state) = (self.materials.len() as MaterialId, self.param_state());
        let material = Material::Interface;
        let entry =
            MaterialEntry { name: name.clone(), material, normal_map: None, displacement: None, dispersion: None };
        self.materials.push(entry);
        self.pending_materials.push(MaterialDesc { id, name, kind, params, state });
        id
    }

    /// Makes a material after all textures are made.
    pub(super) fn material_entry(&mut self, desc: &MaterialDesc, d: &mut Diagnostics) -> MaterialEntry {
        let (kind, p) = (desc.kind.text.as_str(), &desc.params);
        let material = match kind {
            "" | "none" | "interface" => Material::Interface,
            "mix" => self.mix(p, d),
            _ => self.scattering_material(desc, d),
        };
        let displacement = match p.float_input("displacement", d) {
            Some(Input::Texture(texture)) => self.float_texture_named(texture, p.span_of("displacement"), d),
            Some(Input::Value(_)) | None => None,
        };
        let dispersion = matches!(kind, "dielectric" | "glass").then(|| self.dispersion(p)).flatten();
        MaterialEntry { name: desc.name.clone(), material, normal_map: self.normal_map(p, d), displacement, dispersion }
    }

    fn normal_map(&mut self, p: &ParamSet, d: &mut Diagnostics) -> Option<NormalMap> {
        let name = file_name(p, "normalmap", d)?;
        let request = ImageRequest {
            path: file_in(&self.folder, name),
            channels: ImageChannels::Color,
            encoding: ImageEncoding::Linear,
            wrap: Wrap::Repeat,
            filter: Filter::Bilinear,
        };
        Some(NormalMap::unscaled(self.resources.image(request, p.span_of("normalmap"))))
    }

    fn scattering_material(&mut self, desc: &MaterialDesc, d: &mut Diagnostics) -> Material {
        let (place, p) = (&desc.kind, &desc.params);
        let grey = Rgb::splat(0.5);
        match place.text.as_str() {
            "diffuse" => Material::Diffuse { reflectance: self.albedo(p, "reflectance", grey, d) },
            "conductor" => Material::Conductor {
                spectrum: self.conductor(p, ["eta", "k", "reflectance"], d),
                roughness: self.roughness(p, ROUGHNESS, 0.0, d),
            },
            "dielectric" => {
                Material::Dielectric { eta: self.ior(p, "eta", d), roughness: self.roughness(p, ROUGHNESS, 0.0, d) }
            }
            "thindielectric" => Material::ThinDielectric { eta: self.ior(p, "eta", d) },
            "diffusetransmission" => Material::DiffuseTransmission {
                reflectance: self.albedo(p, "reflectance", Rgb::splat(0.25), d),
                transmittance: self.albedo(p, "transmittance", Rgb::splat(0.25), d),
                scale: p.float("scale", d).unwrap_or(1.0),
            },
            "coateddiffuse" => Material::CoatedDiffuse {
                reflectance: self.albedo(p, "reflectance", grey, d),
                coat: self.coat(p, ROUGHNESS, 0.0, "eta", d),
            },
            "coatedconductor" => Material::CoatedConductor {
                conductor: self.conductor(p, ["conductor.eta", "conductor.k", "reflectance"], d),
                roughness: self.roughness(p, OF_CONDUCTOR, 0.0, d),
                coat: self.coat(p, OF_INTERFACE, 0.0, "interface.eta", d),
            },
            "subsurface" => self.subsurface(desc, d),
            "principled" => self.principled(p, d),
            "hair" => self.hair(p, d),
            "measured" => self.measured(place, p, d),
            "evaluated" => self.evaluated(place, p, d),
            _ => self.other_material(place, p, d),
        }
    }

    /// `Material "evaluated" "string model" "…"`, of which only the value is used. Directions are proposed by a density
    /// that is the same for all models, and resampled. Parameters of the models, which may all be textures;
    /// `reflectance` and `specular` are spectra, all others floats:
    ///
    /// | model | parameters |
    /// |---|---|
    /// | `diffuse` | `reflectance` (0.5) |
    /// | `orennayar` | `reflectance` (0.5), `sigma` (20 degrees) |
    /// | `cooktorrance` | `reflectance` (0.5), `specular` (0.5), `slope` (0.2), `amount` (0.5) |
    /// | `phong`, `retroreflective` | `reflectance` (0.25), `specular` (0.5), `exponent` (50) |
    /// | `ashikhminshirley` | `reflectance` (0.5), `specular` (0.1), `uexponent`, `vexponent` (100) |
    fn evaluated(&mut self, place: &Name, p: &ParamSet, d: &mut Diagnostics) -> Material {
        let Some(model) = p.string("model", d).map(str::to_owned) else {
            d.error(place.span, "material `evaluated` needs a `string model`")
                .help(format!("one of {}", MODELS.join(", ")));
            p.ignore_all();
            return Material::Interface;
        };
        let (half, quarter) = (Rgb::splat(0.5), Rgb::splat(0.25));
        Material::Evaluated(match model.as_str() {
            "diffuse" => EvaluatedMaterial::Diffuse { reflectance: self.albedo(p, "reflectance", half, d) },
            "orennayar" => EvaluatedMaterial::OrenNayar {
                reflectance: self.albedo(p, "reflectance", half, d),
                sigma: self.float_param(p, "sigma", 20.0, d),
            },
            "cooktorrance" => EvaluatedMaterial::CookTorrance {
                reflectance: self.albedo(p, "reflectance", half, d),
                specular: self.albedo(p, "specular", half, d),
                slope: self.float_param(p, "slope", 0.2, d),
                amount: self.float_param(p, "amount", 0.5, d),
            },
            "phong" | "retroreflective" => EvaluatedMaterial::CosineLobe {
                reflectance: self.albedo(p, "reflectance", quarter, d),
                specular: self.albedo(p, "specular", half, d),
                exponent: self.float_param(p, "exponent", 50.0, d),
                axis: if model == "phong" { LobeAxis::Mirror } else { LobeAxis::Retro },
            },
            "ashikhminshirley" => EvaluatedMaterial::AshikhminShirley {
                reflectance: self.albedo(p, "reflectance", half, d),
                specular: self.albedo(p, "specular", Rgb::splat(0.1), d),
                exponents: ["uexponent", "vexponent"].map(|name| self.float_param(p, name, 100.0, d)),
            },
            other => {
                unknown(other, p.span_of("model"), "model", MODELS, d);
                p.ignore_all();
                return Material::Interface;
            }
        })
    }

    /// pbrt-v3's `matte`: Lambertian, or Oren-Nayar if `sigma` may be other than 0.
    fn matte(&mut self, p: &ParamSet, d: &mut Diagnostics) -> Material {
        let reflectance = self.albedo(p, "Kd", Rgb::splat(0.5), d);
        let sigma = self.float_param(p, "sigma", 0.0, d);
        match self.textures.constant_float(sigma) {
            Some(sigma) if !(sigma > 0.0) => Material::Diffuse { reflectance },
            Some(_) | None => Material::Evaluated(EvaluatedMaterial::OrenNayar { reflectance, sigma }),
        }
    }

    /// Materials of pbrt-v3, and unsupported ones.
    fn other_material(&mut self, place: &Name, p: &ParamSet, d: &mut Diagnostics) -> Material {
        let kind = place.text.as_str();
        match kind {
            "matte" | "plastic" | "substrate" | "uber" | "metal" | "mirror" | "glass" | "translucent" => {}
            "kdsubsurface" | "disney" | "fourier" => {
                d.warning_once(place.span, format!("material `{kind}` is not rendered yet: it is diffuse"));
                p.ignore_all();
                return Material::Diffuse { reflectance: self.textures.add_rgb(RgbTexture::Constant(Rgb::splat(0.5))) };
            }
            _ => {
                unknown(kind, place.span, "material", KINDS, d);
                p.ignore_all();
                return Material::Interface;
            }
        }

        // The nearest material of pbrt-v4
        let material = match kind {
            "matte" => self.matte(p, d),
            "plastic" | "substrate" | "uber" => Material::CoatedDiffuse {
                reflectance: self.albedo(p, "Kd", Rgb::splat(if kind == "substrate" { 0.5 } else { 0.25 }), d),
                coat: self.coat(p, ROUGHNESS, 0.1, "eta", d),
            },
            "metal" => Material::Conductor {
                spectrum: self.conductor(p, ["eta", "k", "reflectance"], d),
                roughness: self.roughness(p, ROUGHNESS, 0.01, d),
            },
            "mirror" => Material::Conductor {
                spectrum: ConductorSpectrum::Reflectance(self.albedo(p, "Kr", Rgb::splat(0.9), d)),
                roughness: self.roughness(p, ROUGHNESS, 0.0, d),
            },
            "glass" => {
                Material::Dielectric { eta: self.ior(p, "eta", d), roughness: self.roughness(p, ROUGHNESS, 0.0, d) }
            }
            _ => Material::DiffuseTransmission {
                reflectance: self.albedo(p, "Kd", Rgb::splat(0.25), d),
                transmittance: self.albedo(p, "transmit", Rgb::splat(0.5), d),
                scale: 1.0,
            },
        };

        // Warnings about the replacement and ignored parameters
        let used = material.kind_name();
        d.warning_once(place.span, format!("material `{kind}` is pbrt-v3: `{used}` takes its place"));
        for key in ["bumpmap", "Ks", "Kr", "Kt", "opacity", "index", "reflect", "remaproughness"] {
            if p.ignore(key) && key != "remaproughness" {
                d.warning_once(p.span_of(key), format!("`{key}` of material `{kind}` is ignored"));
            }
        }
        material
    }

    /// The coat whose roughness and index have these names.
    fn coat(
        &mut self,
        p: &ParamSet,
        names: [&'static str; 3],
        rough: f32,
        eta: &'static str,
        d: &mut Diagnostics,
    ) -> Coat {
        Coat {
            roughness: self.roughness(p, names, rough, d),
            thickness: self.float_param(p, "thickness", 0.01, d),
            eta: self.ior(p, eta, d),
            g: self.float_param(p, "g", 0.0, d),
            albedo: self.albedo(p, "albedo", Rgb::BLACK, d),
            max_depth: count(p, "maxdepth", 10, d),
            samples: count(p, "nsamples", 1, d),
        }
    }

    pub(super) fn albedo(
        &mut self,
        p: &ParamSet,
        name: &'static str,
        default: Rgb,
        d: &mut Diagnostics,
    ) -> RgbTextureId {
        let albedo = self.rgb_param(p, name, default, SpectrumUse::Albedo, d);
        if self.textures.constant_rgb(albedo).is_some_and(|c| c != c.clamp(0.0, 1.0)) {
            d.warning_once(p.span_of(name), format!("`{name}` is beyond 0 to 1, to which it is clamped"));
        }
        albedo
    }

    pub(super) fn roughness(
        &mut self,
        p: &ParamSet,
        names: [&'static str; 3],
        default: f32,
        d: &mut Diagnostics,
    ) -> Roughness {
        let both = self.float_param(p, names[0], default, d);
        let mut axis = |name: &'static str| match p.float_input(name, d) {
            Some(_) => self.float_param(p, name, default, d),
            None => both,
        };

        // Constants must be valid
        let (u, v) = (axis(names[1]), axis(names[2]));
        for (name, texture) in names.into_iter().zip([both, u, v]) {
            let value = self.textures.constant_float(texture).filter(|_| p.type_of(name).is_some());
            if let Some(wrong) = value.filter(|value| !(*value >= 0.0 && value.is_finite())) {
                d.error(p.span_of(name), format!("{name} must be at least 0, not {wrong}"));
            }
        }
        Roughness { u, v, remap: p.boolean("remaproughness", d).unwrap_or(true) }
    }

    /// Dispersion by a spectrum `eta`; its errors were reported before.
    fn dispersion(&mut self, p: &ParamSet) -> Option<Arc<Dispersion>> {
        let mut known = Diagnostics::default();
        let is_spectrum = p.type_of("eta") == Some(ParamType::Spectrum);
        let value = p.spectrum("eta", &mut known).filter(|_| is_spectrum)?;
        match self.resolve_spectrum(value, SpectrumUse::Unbounded, p.span_of("eta"), &mut known)? {
            Resolved::Curve(curve) => Dispersion::new(&curve).map(Arc::new),
            Resolved::Rgb(_) => None,
        }
    }

    /// An index of refraction: a number, or the value of a spectrum at the helium d line.
    pub(super) fn ior(&mut self, p: &ParamSet, name: &'static str, d: &mut Diagnostics) -> f32 {
        let eta = match p.type_of(name) {
            None => {
                p.ignore(name);
                return 1.5;
            }
            Some(ParamType::Float) => p.float(name, d),
            Some(ParamType::Texture | ParamType::String | ParamType::Integer | ParamType::Bool) => {
                p.get(name, &[ParamType::Float, ParamType::Spectrum], d);
                None
            }
            Some(_) => {
                let span = p.span_of(name);
                let resolved =
                    p.spectrum(name, d).and_then(|v| self.resolve_spectrum(v, SpectrumUse::Unbounded, span, d));
                resolved.map(|r| match r {
                    Resolved::Rgb(rgb) => rgb.average(),
                    Resolved::Curve(curve) => curve.at_d_line(),
                })
            }
        };

        // Range
        match eta {
            Some(eta) if eta > 0.0 && eta.is_finite() => eta,
            Some(eta) => {
                d.error(p.span_of(name), format!("an index of refraction must be positive, not {eta}"));
                1.5
            }
            None => 1.5,
        }
    }

    /// η and k, or a reflectance; copper if nothing is given.
    fn conductor(&mut self, p: &ParamSet, names: [&'static str; 3], d: &mut Diagnostics) -> ConductorSpectrum {
        let [eta_name, k_name, reflectance] = names;
        if p.type_of(reflectance).is_some() {
            for name in [eta_name, k_name] {
                if p.type_of(name).is_some() {
                    let message = format!("a conductor has `{reflectance}` or `{eta_name}` and `{k_name}`, not both");
                    d.error(p.span_of(name), message);
                    p.ignore(name);
                }
            }
            return ConductorSpectrum::Reflectance(self.albedo(p, reflectance, Rgb::splat(0.5), d));
        }
        p.ignore(reflectance);
        let mut input = |builder: &Self, name: &'static str, default: &str| match p.spectrum_input(name, d) {
            Some(Input::Texture(_)) => None,
            Some(Input::Value(value)) => builder.resolve_spectrum(value, SpectrumUse::Unbounded, p.span_of(name), d),
            None => builder.resolve_spectrum(SpectrumValue::Named(default), SpectrumUse::Unbounded, p.span, d),
        };
        let eta = input(self, eta_name, "metal-Cu-eta");
        let k = input(self, k_name, "metal-Cu-k");
        if let (Some(eta), Some(k)) = (eta, k) {
            // A spectral renderer shows the colour of both curves together. The Fresnel equations per colour channel do
            // not give this colour.
            let fitted = spectra::conductor_rgb(&eta.unbounded_curve(), &k.unbounded_curve());
            let [eta, k] = [fitted.eta, fitted.k].map(|rgb| self.textures.add_rgb(RgbTexture::Constant(rgb)));
            return ConductorSpectrum::EtaK { eta, k };
        }
        ConductorSpectrum::EtaK {
            eta: self.rgb_param(p, eta_name, Rgb::splat(0.2), SpectrumUse::Unbounded, d),
            k: self.rgb_param(p, k_name, Rgb::splat(3.9), SpectrumUse::Unbounded, d),
        }
    }

    fn mix(&mut self, p: &ParamSet, d: &mut Diagnostics) -> Material {
        let amount = self.float_param(p, "amount", 0.5, d);
        let names = p.strings("materials", d).map(<[String]>::to_vec).unwrap_or_default();
        let [first, second] = names.as_slice() else {
            d.error(p.span_of("materials"), format!("a mix takes two materials, not {}", names.len()));
            return Material::Interface;
        };
        let ids = [first, second].map(|name| self.named_material(name, p.span_of("materials"), d));
        match ids {
            [Some(a), Some(b)] => Material::Mix { materials: [a, b], amount },
            _ => Material::Interface,
        }
    }

    /// The material with a name, after all names are defined.
    fn named_material(&self, name: &str, span: Span, d: &mut Diagnostics) -> Option<MaterialId> {
        let found = self.named_materials.get(&*nfc(name)).map(|(id, _)| *id);
        if found.is_none() {
            d.unknown(span, "material", name, self.named_materials.keys().map(String::as_str));
        }
        found
    }

    /// The material of a shape, after all names are defined.
    pub fn material_of(&self, material: &MaterialUse, d: &mut Diagnostics) -> Option<MaterialId> {
        match material {
            MaterialUse::Id(id) => Some(*id),
            MaterialUse::Named(name) => self.named_material(&name.text, name.span, d),
        }
    }
}

fn count(p: &ParamSet, name: &'static str, default: u32, d: &mut Diagnostics) -> u32 {
    match p.integer(name, d) {
        Some(n @ 1..=1_000) => n as u32,
        Some(n) => {
            d.error(p.span_of(name), format!("{name} must be from 1 to 1000, not {n}"));
            default
        }
        None => default,
    }
}
