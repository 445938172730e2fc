//! Reasons why a rendering ends without an image.

use super::parts::PartError;
use crate::integrators::exclusions::Conflict;
use crate::photons::PhotonError;
use crate::planning::PlanError;
use crate::planning::preparation::ThreadError;

/// Reason why a rendering ended without an image.
#[derive(Debug, thiserror::Error)]
pub enum RenderError {
    /// The threads could not be started.
    #[error(transparent)]
    Threads(#[from] ThreadError),
    /// The integrator could not prepare its photon maps.
    #[error(transparent)]
    Photons(#[from] PhotonError),
    /// The settings exclude a feature of the scene, or the image cannot be divided.
    #[error(transparent)]
    Features(#[from] Conflict),
    /// The rendering was stopped before the first sample.
    #[error("stopped before the first sample")]
    Stopped,
    /// Texels could not be read during the rendering.
    #[error("{0}")]
    Texels(String),
    /// The stored sums belong to another rendering.
    #[error(transparent)]
    Stored(#[from] PartError),
}

impl From<PlanError> for RenderError {
    fn from(error: PlanError) -> Self {
        match error {
            PlanError::Threads(error) => RenderError::Threads(error),
            PlanError::Features(conflict) => conflict.into(),
            PlanError::Stopped => RenderError::Stopped,
        }
    }
}
