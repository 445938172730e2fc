//! `Material "hair"`.

use super::spectrum::SpectrumUse;
use super::state::Builder;
use crate::materials::{HairColor, HairMaterial, Material};
use lumiris_formats::diagnostic::Diagnostics;
use lumiris_formats::pbrt::params::ParamSet;
use lumiris_numbers::math::Rgb;

impl Builder<'_> {
    /// The first parameter given among `sigma_a`, `reflectance`, `color`, and the melanins determines the colour of the
    /// fibres. The default is a eumelanin concentration of 1.3, as in pbrt-v4.
    pub(super) fn hair(&mut self, p: &ParamSet, d: &mut Diagnostics) -> Material {
        const COLORS: [&str; 5] = ["sigma_a", "reflectance", "color", "eumelanin", "pheomelanin"];
        let given: Vec<&'static str> = COLORS.into_iter().filter(|name| p.type_of(name).is_some()).collect();
        let used = given.first().copied().unwrap_or("eumelanin");
        let has_melanin = matches!(used, "eumelanin" | "pheomelanin");

        // Both melanins are used together
        for name in given.iter().copied().filter(|name| *name != used) {
            if !(has_melanin && name == "pheomelanin") {
                d.warning_once(p.span_of(name), format!("`{name}` is ignored: `{used}` colours the hair"));
                p.ignore(name);
            }
        }

        // Colour
        let color = match used {
            "sigma_a" => HairColor::SigmaA(self.rgb_param(p, "sigma_a", Rgb::BLACK, SpectrumUse::Unbounded, d)),
            "reflectance" | "color" => HairColor::Reflectance(self.albedo(p, used, Rgb::splat(0.5), d)),
            _ => HairColor::Melanin {
                eumelanin: self.float_param(p, "eumelanin", if given.is_empty() { 1.3 } else { 0.0 }, d),
                pheomelanin: self.float_param(p, "pheomelanin", 0.0, d),
            },
        };
        Material::Hair(HairMaterial {
            color,
            eta: self.float_param(p, "eta", 1.55, d),
            beta_m: self.float_param(p, "beta_m", 0.3, d),
            beta_n: self.float_param(p, "beta_n", 0.3, d),
            alpha: self.float_param(p, "alpha", 2.0, d),
        })
    }
}
