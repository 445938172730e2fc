//! Lights: their emission, the sampling of directions towards them, and the choice of one of many.
//!
//! Reading order: [`light_sample`] has arguments and results, [`kinds`] the larger kinds, [`light`] the small ones and
//! the type that stands for all of them, with [`emit`] (rays that leave it), [`lanes`] (many samples of an infinite
//! light) and [`bounds`]. [`tree`], [`visibility`] and [`choice`] choose among the lights of a scene. [`layers`] are the light
//! groups of the image, and [`irradiance`] has closed forms.

pub mod bounds;
pub mod choice;
pub mod emit;
pub mod irradiance;
pub mod kinds;
pub mod lanes;
pub mod layers;
pub mod light;
pub mod light_sample;
pub mod tree;
pub mod visibility;

#[cfg(test)]
mod emit_tests;
#[cfg(test)]
mod light_tests;

pub use bounds::LightBounds;
pub use choice::groups::{self, LightGroups};
pub use choice::light_sampler::{LightChoice, LightSampler, LightSamplerKind};
pub use choice::many;
pub use choice::sampling::LightSampling;
pub use choice::set::{LightSet, LightSetBuilder};
pub use irradiance::Irradiances;
pub use kinds::area::{AreaLight, AreaShape, Cover, Emission, EmissionImage, EmissionMapping, area_lights_of};
pub use kinds::environment::{self, EnvironmentFilter, EnvironmentMap, EnvironmentMapping};
pub use kinds::glow::Glow;
pub use kinds::image_light::{ImageLight, ImageMapping};
pub use kinds::portal::{Portal, PortalLight};
pub use kinds::spot;
pub use lanes::LightLanes;
pub use layers::LightLayers;
pub use light::Light;
pub use light_sample::{EmissionSample, EmittingPoint, LightCtx, LightHit, LightId, LightSample};
pub use tree::light_tree::{CutNode, LightTree};
pub use tree::sampled_light::{LightRun, SampledLight};
pub use tree::tops::Tops;
pub use tree::tree_choice::TreeChoice;
pub use tree::turns::Turns;
pub use visibility::learned_visibility::{self, LearnedVisibility};
pub use visibility::visibility_cache::{self, VisibilityCache};
pub use visibility::visibility_cache_sampler::VisibilityCacheSampler;

pub use lumiris_numbers::math::light_bound::GlossyLobe;
