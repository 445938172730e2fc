//! Lights: their emission, the sampling of directions towards them, and the choice of one of many.
//!
//! Reading order: [`light_sample`] has arguments and results, [`kinds`] the kinds of lights, [`light`] the type
//! that stands for all of them, with [`emit`] (rays that leave it), [`infinite_columns`] (many samples of an infinite
//! light) and [`bounds`]. [`tree`], [`visibility`] and [`choice`] choose among the lights of a scene. [`layers`] are
//! the light groups of the image, and [`irradiance`] has closed forms.

pub mod bounds;
pub mod choice;
pub mod emit;
pub mod infinite_columns;
pub mod irradiance;
pub mod kinds;
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
pub use choice::job_lights::JobLights;
pub use choice::light_sampler::{LightChoice, LightSampler, LightSamplerKind};
pub use choice::mixture_groups::{self, MixtureGroups};
pub use choice::sample_columns;
pub use choice::set::{LightSet, LightSetBuilder};
pub use infinite_columns::LightLanes;
pub use irradiance::Irradiances;
pub use kinds::area::{AlphaMask, AreaLight, AreaShape, Emission, EmissionImage, EmissionMapping, area_lights_of};
pub use kinds::distant::DistantLight;
pub use kinds::environment::{self, EnvironmentFilter, EnvironmentMap, EnvironmentMapping};
pub use kinds::image_light::{ImageLight, ImageMapping};
pub use kinds::point::PointLight;
pub use kinds::portal::{Portal, PortalLight};
pub use kinds::spot::SpotLight;
pub use kinds::volume_light::VolumeLight;
pub use layers::LightLayers;
pub use light::Light;
pub use light_sample::{
    EmissionSample, EmittingPoint, LeAndPdf, LightCtx, LightHit, LightId, LightSample, SampleOfLight, SurfacePoint,
};
pub use tree::light_tree::{CutNode, LightTree, RunPositions};
pub use tree::sampled_light::{LightRun, SampledLight};
pub use tree::tree_choice::TreeChoice;
pub use visibility::learned_visibility::{self, LearnedVisibility};
pub use visibility::visibility_cache::{self, PathCount, PhotonCount, PrimaryPhoton, VisibilityCache};
pub use visibility::visibility_cache_sampler::VisibilityCacheSampler;

pub use lumiris_numbers::math::Sphere;
pub use lumiris_numbers::math::light_bound::GlossyLobe;
