//! Which settings estimate light transport through media.

use crate::scene::RenderJob;
use crate::settings::{EstimatorKind, IntegratorKind, IntegratorSettings};

/// Why an image of these settings cannot be rendered where there are media, and what can; `None` if it can.
pub fn obstacle_of(settings: &IntegratorSettings) -> Option<String> {
    let knows_integrator = match settings.kind {
        IntegratorKind::Direct | IntegratorKind::Path => true,
        IntegratorKind::IrradianceCache | IntegratorKind::PhotonMap => false,
    };
    let knows_estimator = match settings.estimator {
        EstimatorKind::Auto
        | EstimatorKind::Mc
        | EstimatorKind::Mis
        | EstimatorKind::Ris
        | EstimatorKind::Contributing => true,
        // Their corrections are fitted to what is visible or not, which is no bit in a medium
        EstimatorKind::Ocv | EstimatorKind::OptimalMis | EstimatorKind::Correlated => false,
    };
    if !knows_integrator {
        return Some(format!(
            "the integrator {} leaves out participating media, which this scene has: direct and path render them",
            <&str>::from(settings.kind)
        ));
    }
    if !knows_estimator {
        return Some(format!(
            "the estimator {} leaves out participating media, which this scene has: auto, mc, mis, ris and contributing know them",
            <&str>::from(settings.estimator)
        ));
    }
    traces_first(settings).then(|| {
        let target: &'static str = settings.ris.target.into();
        format!(
            "the target {target} leaves out participating media, which this scene has: fgl and visibility know them"
        )
    })
}

/// [`obstacle_of`] the settings of an image, if there are media; or why they do not render one with surfaces that rays may
/// pass.
pub fn obstacle(job: &RenderJob) -> Option<String> {
    let settings = &job.settings().integrator;
    if !job.world.scene.media.is_empty() {
        return obstacle_of(settings);
    }
    (job.shadows_pass() && traces_first(settings)).then(|| {
        let target: &'static str = settings.ris.target.into();
        format!("the target {target} does not see through mixtures with `interface`: fgl and visibility do")
    })
}

/// True if samples are chosen by what is visible, as if nothing let light through.
fn traces_first(settings: &IntegratorSettings) -> bool {
    settings.estimator == EstimatorKind::Ris && settings.ris.target.has_visibility()
}
