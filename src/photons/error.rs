//! Errors of photon maps.

/// Errors of photon and importon tracing.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum PhotonError {
    /// There is no light.
    #[error("the scene has no light, so there are no photons to trace")]
    NoLight,
    /// There are lights, but all of them are black.
    #[error("the lights of the scene emit nothing, so there are no photons to trace")]
    NoEmission,
    /// A number of paths, photons or importons is 0.
    #[error("the number of photons requested is zero")]
    NothingRequested,
    /// The ratio q is not in (0, 1].
    #[error("the ratio of global to caustic photon paths is {0}; it must be above 0 and at most 1")]
    InvalidRatio(f32),
    /// The minimum probability of storage is not in (0, 1].
    #[error("the minimum probability of storing a photon is {0}; it must be above 0 and at most 1")]
    InvalidProbability(f32),
    /// No photon was stored.
    #[error(
        "no photon was stored in {paths} photon paths: no light reaches a diffuse surface{}",
        if *.by_importance { " that matters to the camera" } else { "" }
    )]
    NothingStored {
        /// Number of photon paths traced.
        paths: u64,
        /// True if photons arrived but had too little importance.
        by_importance: bool,
    },
    /// No importon was stored.
    #[error("the camera sees no diffuse surface, directly or in mirrors, so visual importance is zero everywhere")]
    CameraSeesNothing,
    /// The observer stopped the tracing.
    #[error("stopped after {paths} photon paths, before the photon maps were complete")]
    Stopped {
        /// Number of photon paths traced.
        paths: u64,
    },
    /// The maps exceed the memory limit.
    #[error(
        "the photon maps need more than {} kB, which {photons} photons took: ask for fewer photons or allow more memory",
        limit / 1000
    )]
    OutOfMemory {
        /// The limit (bytes).
        limit: u64,
        /// Number of photons at the limit.
        photons: u64,
    },
}
