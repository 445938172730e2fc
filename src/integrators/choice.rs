//! The choice of the integrator by the settings.

use super::integrator::{Cameras, Integrator};
use super::irradiance_cache::CacheIntegrator;
use super::path::PathIntegrator;
use super::photon_map::PhotonMapIntegrator;
use crate::photons::PhotonError;
use crate::scene::RenderJob;
use crate::settings::IntegratorKind;
use std::sync::atomic::AtomicBool;

/// The integrator of the settings. `cameras` gives the camera samples that preparations trace; `stop` ends preparations
/// early.
pub fn make_integrator<'a>(
    job: &'a RenderJob,
    cameras: Cameras<'_>,
    stop: &'a AtomicBool,
) -> Result<Box<dyn Integrator + 'a>, PhotonError> {
    Ok(match job.settings().integrator.kind {
        IntegratorKind::Direct | IntegratorKind::Path => Box::new(PathIntegrator::new(job)),
        IntegratorKind::IrradianceCache => Box::new(CacheIntegrator::new(job, cameras, stop)),
        IntegratorKind::PhotonMap => Box::new(PhotonMapIntegrator::new(job, cameras, stop)?),
    })
}
