//! Units of the punctual lights of glTF scenes, which `gltf/assemble.rs` applies.

use strum::{EnumString, IntoStaticStr, VariantNames};

/// Luminous flux of 1 W at 555 nm (lm/W), the divisor of light units.
pub const LUMENS_PER_WATT: f32 = 683.0;

/// Units of punctual lights, relative to an emission of 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, EnumString, IntoStaticStr, VariantNames)]
#[strum(serialize_all = "kebab-case")]
pub enum LightUnits {
    /// Divided by [`LUMENS_PER_WATT`]: W/sr and W/m², as in Blender's export of candela and lux.
    #[default]
    Watt,
    /// Taken as they are: emission is in cd/m², as in the specification, or nothing has units.
    Candela,
}

impl LightUnits {
    /// The intensity of 1 cd, and the irradiance of 1 lx.
    pub(super) fn per_candela(self) -> f32 {
        match self {
            LightUnits::Watt => 1.0 / LUMENS_PER_WATT,
            LightUnits::Candela => 1.0,
        }
    }
}
