//! Features of scenes and settings that exclude each other: [`TABLE`]. All other combinations are supported.

use crate::direct::Estimator;
use crate::lights::Light;
use crate::scene::RenderJob;
use crate::settings::table::joined;
use crate::settings::{EstimatorKind, IntegratorKind, IntegratorSettings, Target};
use std::fmt;
use strum::VariantNames;

/// A feature of the settings or of the scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Feature {
    /// The integrator.
    Integrator(IntegratorKind),
    /// The estimator of direct light.
    Estimator(EstimatorKind),
    /// The target of `ris`.
    Target(Target),
    /// An estimator that is fitted to earlier samples of the pixel.
    Progressive,
    /// Fewer bounces than this.
    Fewer(u32),
    /// Paths whose next segment is not the only BSDF sample of `mis`.
    OtherContinuation,
    /// Light-group layers.
    LightGroups,
    /// Light paths.
    LightPaths,
    /// Pixels that share paths.
    Sharing,
    /// A part of the image: some of its tiles. Callers decide if it is requested.
    TileShare,
    /// A part of the image: some of the samples of each pixel. Callers decide if it is requested.
    SampleShare,
    /// Participating media.
    Media,
    /// Media that emit.
    VolumeEmission,
    /// Surfaces that shadow rays may pass: bounds of media, and mixtures with `interface`.
    Passable,
    /// Surfaces with stochastic alpha.
    Alpha,
    /// Moving objects.
    MovingObjects,
    /// A moving camera.
    MovingCamera,
    /// Glass with dispersion.
    Dispersion,
    /// No area light.
    NoAreaLight,
    /// A camera that cannot project points onto the film.
    NoProjection,
    /// A pixel filter without extent.
    PointFilter,
}

use Feature as F;

/// Excluded features, the features that exclude each of them, and the reason. If a feature is an integrator, estimator
/// or target, its name precedes the reason in messages.
pub type Row = (&'static [Feature], &'static [Feature], &'static str);

/// All exclusions. The first one that applies is reported.
pub const TABLE: &[Row] = &[
    // Corrections of estimators are fitted to binary visibility; transmittance in media is not binary
    (
        &[F::Media],
        &[CACHE, PHOTONS, OCV, OPTIMAL, CORRELATED],
        "does not render participating media, which this scene has",
    ),
    // Samples are selected by binary visibility
    (&[F::Media], &TRACED, "does not see through participating media, which this scene has"),
    (&[F::Passable], &TRACED, "does not see through mixtures with `interface`"),
    (&[F::LightGroups], &[CACHE, PHOTONS, OCV, OPTIMAL, CORRELATED, CONTROL], "does not tell lights apart"),
    (&[F::LightGroups], &[F::VolumeEmission], "media emit, and belong to no group"),
    (&[F::Sharing, F::LightPaths], &[DIRECT, CACHE, PHOTONS], "does not follow camera paths from pixel to light"),
    (&[F::Sharing], &[F::Fewer(2)], "paths of one bounce have nothing to share"),
    (&[F::Sharing], &[F::Progressive], "with a progressive estimator, samples depend on earlier ones of their pixel"),
    (
        &[F::Sharing],
        &[F::TileShare],
        "pixels share paths with others all over the image: divide it with --part-by samples, or render with \
         --path-reuse 1",
    ),
    (
        &[F::Progressive],
        &[F::SampleShare],
        "with a progressive estimator, samples depend on earlier ones of their pixel: divide the image with \
         --part-by tiles",
    ),
    (&[F::LightPaths], &[F::Fewer(3)], "paths of less than three bounces leave nothing to them"),
    (&[F::LightPaths], &[F::OtherContinuation], "they need mis with one BSDF sample at vertices after the first"),
    (&[F::LightPaths], &[F::NoAreaLight], "there are no area lights"),
    (&[F::LightPaths], &[F::NoProjection], "they need a perspective camera"),
    (&[F::LightPaths], &[F::PointFilter], "the pixel filter has no extent"),
    (&[F::LightPaths], &[F::Media], "there are participating media"),
    (&[F::LightPaths], &[F::MovingCamera], "the camera moves while the shutter is open"),
    (
        &[F::Sharing, F::LightPaths],
        &[F::Passable],
        "rays may pass surfaces: bounds of media, or mixtures with `interface`",
    ),
    (&[F::Sharing, F::LightPaths], &[F::Dispersion], "glass has dispersion, so that paths may have wavelengths"),
    (
        &[F::Sharing, F::LightPaths],
        &[F::LightGroups],
        "light groups have layers (turn them off with --light-groups none)",
    ),
    (&[F::Sharing, F::LightPaths], &[F::MovingObjects], "objects move while the shutter is open"),
    (&[F::Sharing, F::LightPaths], &[F::Alpha], "alpha cuts out surfaces at random"),
];

const DIRECT: Feature = F::Integrator(IntegratorKind::Direct);
const CACHE: Feature = F::Integrator(IntegratorKind::IrradianceCache);
const PHOTONS: Feature = F::Integrator(IntegratorKind::PhotonMap);
const OCV: Feature = F::Estimator(EstimatorKind::Ocv);
const OPTIMAL: Feature = F::Estimator(EstimatorKind::OptimalMis);
const CORRELATED: Feature = F::Estimator(EstimatorKind::Correlated);
const CONTROL: Feature = F::Target(Target::VisibilityControl);
const TRACED: [Feature; 2] = [F::Target(Target::Gv), F::Target(Target::Gvl)];

/// Features that are disabled if the table excludes them: feature, name of the option, and text of the message.
pub const OPTIONAL: [(Feature, &str, &str); 3] = [
    (F::Sharing, "path-reuse", "pixels do not share paths"),
    (F::LightPaths, "light-paths", "there are no light paths"),
    (F::LightGroups, "light-groups", "light groups have no layers"),
];

/// Features that cannot be disabled: if the table excludes one, the scene is not rendered.
const NECESSARY: [Feature; 2] = [F::Media, F::Passable];

/// A feature that another one excludes. `Display` shows the reason and names the alternatives.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub struct Conflict {
    /// The excluded feature.
    pub feature: Feature,
    /// The feature that excludes it.
    pub by: Feature,
    why: &'static str,
}

/// The conflict of two features; `None` if they work together.
pub fn between(feature: Feature, by: Feature) -> Option<Conflict> {
    conflicts(feature).find(|conflict| conflict.by == by)
}

/// The first conflict of a feature under these settings; `None` if it is supported.
pub fn conflict(job: &RenderJob, settings: &IntegratorSettings, feature: Feature) -> Option<Conflict> {
    conflicts(feature).find(|conflict| conflict.by.is_in(job, settings))
}

/// The first conflict that prevents rendering this scene with these settings; `None` if it can be rendered.
pub fn refusal(job: &RenderJob, settings: &IntegratorSettings) -> Option<Conflict> {
    let mut present = NECESSARY.into_iter().filter(|feature| feature.is_in(job, settings));
    present.find_map(|feature| conflict(job, settings, feature))
}

/// True if this image supports a feature.
pub fn allows(job: &RenderJob, feature: Feature) -> bool {
    conflict(job, &job.settings().integrator, feature).is_none()
}

fn conflicts(feature: Feature) -> impl Iterator<Item = Conflict> {
    let rows = TABLE.iter().filter(move |row| row.0.contains(&feature));
    rows.flat_map(move |&(_, by, why)| by.iter().map(move |&by| Conflict { feature, by, why }))
}

impl Feature {
    /// True if the settings request the feature, or the scene has it.
    pub fn is_wanted(self, job: &RenderJob, s: &IntegratorSettings) -> bool {
        let scene = &job.world.scene;

        // The parts of an image are checked by callers, by `between`
        match self {
            F::Integrator(kind) => s.kind == kind,
            F::Estimator(kind) => s.estimator == kind,
            F::Target(target) => s.estimator == EstimatorKind::Ris && s.ris.target == target,
            F::Progressive => Estimator::at_vertex(s, 0).is_progressive(),
            F::Fewer(bounces) => s.depth() < bounces,
            F::OtherContinuation => !extends_by_sample(s),
            F::LightGroups => s.light_groups && !job.lights.layers.names().is_empty(),
            F::LightPaths => s.light_paths.is_some_and(|number| number > 0.0),
            F::Sharing => s.path_reuse.is_some_and(|edge| edge > 1),
            F::TileShare | F::SampleShare => false,
            F::Media => !scene.media.is_empty(),
            F::VolumeEmission => scene.media.is_emissive(),
            F::Passable => job.shadows_pass(),
            F::Alpha => scene.geometry.geometries.iter().any(|g| g.alpha.is_some()),
            F::MovingObjects => scene.geometry.has_motion(),
            F::MovingCamera => scene.camera.is_moving(),
            F::Dispersion => scene.materials.has_dispersion(),
            F::NoAreaLight => {
                !scene.lights.lit.iter().any(|&l| matches!(scene.lights.lights[l as usize], Light::Area(_)))
            }
            F::NoProjection => !scene.camera.projects(),
            F::PointFilter => scene.film.filter.sampler().is_point(),
        }
    }

    /// True if the feature is wanted and, if optional, not excluded.
    fn is_in(self, job: &RenderJob, s: &IntegratorSettings) -> bool {
        let is_optional = OPTIONAL.iter().any(|row| row.0 == self);
        self.is_wanted(job, s) && !(is_optional && conflict(job, s, self).is_some())
    }

    /// The choice among integrators, estimators or targets; `None` for other features.
    fn choice(self) -> Option<Choice> {
        fn all<T: VariantNames + std::str::FromStr>(of: fn(T) -> Feature) -> Vec<Feature> {
            T::VARIANTS.iter().filter_map(|name| name.parse().ok()).map(of).collect()
        }
        match self {
            F::Integrator(x) => Some(Choice { kind: "integrator", name: x.into(), all: all(F::Integrator) }),
            F::Estimator(x) => Some(Choice { kind: "estimator", name: x.into(), all: all(F::Estimator) }),
            F::Target(x) => Some(Choice { kind: "target", name: x.into(), all: all(F::Target) }),
            _ => None,
        }
    }
}

/// One of several features of a kind.
struct Choice {
    kind: &'static str,
    name: &'static str,
    all: Vec<Feature>,
}

impl fmt::Display for Conflict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Some(Choice { kind, name, all }) = self.by.choice() else { return f.write_str(self.why) };
        let others = all.into_iter().filter(|&other| between(self.feature, other).is_none());
        let others: Vec<_> = others.filter_map(|other| Some(other.choice()?.name)).collect();
        let verb = if others.len() == 1 { "does" } else { "do" };
        write!(f, "the {kind} {name} {}; {} {verb}", self.why, joined(&others))
    }
}

/// True if the only BSDF sample of each vertex after the first is the next segment of the path, which hits the
/// emitters.
fn extends_by_sample(settings: &IntegratorSettings) -> bool {
    (1..settings.depth().saturating_sub(1)).all(|vertex| match Estimator::at_vertex(settings, vertex) {
        Estimator::Mis(mis) => mis.samples >= 2 && mis.has_one_bsdf_sample(mis.samples),
        _ => false,
    })
}
