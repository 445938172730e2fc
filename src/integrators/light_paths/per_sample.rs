//! The number of light paths.

use crate::integrators::exclusions::{Feature, allows};
use crate::scene::RenderJob;

/// Light paths per camera sample; 0 if disabled.
pub fn per_sample(job: &RenderJob) -> f32 {
    let wanted = job.settings().integrator.light_paths.unwrap_or(0.0);
    if wanted > 0.0 && allows(job, Feature::LightPaths) { wanted } else { 0.0 }
}
