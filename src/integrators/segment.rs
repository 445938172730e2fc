//! The state of a path between two vertices.

use super::light_paths::{Chain, Guide};
use crate::accel::Hit;
use crate::cameras::CameraRay;
use crate::direct::{DirectStats, Techniques, Vertices};
use crate::film::{FeatureSet, Features};
use crate::lights::{LightCtx, LightHit};
use crate::materials::SurfaceBsdf;
use crate::media::MediumId;
use crate::scene::{RenderJob, SurfaceInteraction};
use crate::settings::{IntegratorSettings, SampleCounts};
use lumiris_numbers::estimators::mis::Technique;
use lumiris_numbers::math::{Ray, Rgb};
use lumiris_numbers::samplers::SampleStream;
use std::iter::Sum;
use std::time::Duration;

/// Random-number domains of a path vertex.
pub(super) mod domain {
    pub(crate) const DIRECT: u32 = 0;
    pub(crate) const BSDF: u32 = 1;
    pub(crate) const ROULETTE: u32 = 2;
    pub(crate) const RESAMPLE: u32 = 3;
    pub(crate) const ALBEDO: u32 = 4;
    /// Vertex k uses the domain `VERTEX + k` of the camera sample.
    pub(crate) const VERTEX: u32 = 16;
    /// The segment to vertex k, through media, uses the domain `FLIGHT + k`.
    pub(crate) const FLIGHT: u32 = 1 << 19;
    /// The light for equiangular distance sampling in media.
    pub(crate) const FOCUS: u32 = 1 << 18;
    /// The walk through an interior before vertex k uses the domain `WALK + k`.
    pub(crate) const WALK: u32 = 1 << 17;
    /// The wavelength of the path.
    pub(crate) const WAVELENGTH: u32 = 1 << 16;
}

/// Counts and times.
#[derive(Clone, Copy, Debug, Default)]
pub struct PathStats {
    /// Camera rays.
    pub camera_rays: u64,
    /// Rays of later path segments.
    pub bounce_rays: u64,
    /// Time in tracing camera rays.
    pub camera_time: Duration,
    /// Time in tracing later segments.
    pub bounce_time: Duration,
    /// Time in hits, textures and materials.
    pub shade_time: Duration,
    /// Approximate number of tentative collisions in media.
    pub collisions: u64,
    /// Direct light.
    pub direct: DirectStats,
    /// Lookups in an irradiance cache.
    pub lookups: LookupStats,
}

/// Lookups and cache misses.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LookupStats {
    /// Diffuse vertices of camera paths.
    pub lookups: u64,
    /// Cache misses: lookups without a usable record, where path tracing takes over.
    pub misses: u64,
}

impl PathStats {
    /// Times of the stages of tracing, without overlap.
    pub fn stages(&self) -> [(&'static str, Duration); 6] {
        [
            ("camera_rays", self.camera_time),
            ("bounce_rays", self.bounce_time),
            ("shade", self.shade_time),
            ("t1_propose", self.direct.t1),
            ("select_resolve", self.direct.select),
            ("t2_trace", self.direct.t2),
        ]
    }

    /// The part of the time `tracing` outside all stages.
    pub fn beside_stages(&self, tracing: Duration) -> Duration {
        tracing.saturating_sub(self.stages().iter().map(|(_, time)| *time).sum())
    }

    /// Adds the counts of another worker.
    pub fn merge(&mut self, other: &PathStats) {
        self.camera_rays += other.camera_rays;
        self.bounce_rays += other.bounce_rays;
        self.camera_time += other.camera_time;
        self.bounce_time += other.bounce_time;
        self.shade_time += other.shade_time;
        self.collisions += other.collisions;
        self.direct.merge(&other.direct);
        self.lookups.lookups += other.lookups.lookups;
        self.lookups.misses += other.lookups.misses;
    }
}

impl Sum for PathStats {
    fn sum<I: Iterator<Item = PathStats>>(all: I) -> Self {
        all.fold(PathStats::default(), |mut sum, stats| {
            sum.merge(&stats);
            sum
        })
    }
}

/// A camera sample to be traced.
#[derive(Clone, Copy, Debug)]
pub struct CameraSample {
    /// Its ray.
    pub ray: CameraRay,
    /// Weight of the pixel filter times weight of the camera.
    pub weight: f32,
    /// Its random numbers.
    pub stream: SampleStream,
    /// Random numbers of direct light. Progressive estimators use a new stream for every block of samples, so that a
    /// block is independent of earlier blocks.
    pub direct: SampleStream,
    /// Sample counts at its first vertex.
    pub sample_counts: SampleCounts,
    /// Share group ([`crate::scene::PixelSamples::share_group`]). Samples with the same group may share paths, and use the
    /// same light paths.
    pub share_group: u32,
    /// Index of the fit of its pixel.
    pub fit: u32,
    /// Its pixel; arbitrary for rays that belong to no pixel.
    pub pixel: [u32; 2],
    /// True if the sample belongs to a replica: a second estimate of its pixel, used to estimate the variance.
    pub is_replica: bool,
}

impl CameraSample {
    /// The sample of a ray that belongs to no pixel.
    #[inline]
    pub fn of_ray(ray: CameraRay, weight: f32, stream: SampleStream, sample_counts: SampleCounts) -> Self {
        let (share_group, fit, pixel, is_replica) = (0, 0, [0; 2], false);
        CameraSample { ray, weight, stream, direct: stream, sample_counts, share_group, fit, pixel, is_replica }
    }
}

/// The state of a path.
#[derive(Clone, Copy, Debug)]
pub(super) struct PathState {
    /// Index of the camera sample.
    pub(super) sample: u32,
    pub(super) ray: Ray,
    pub(super) beta: Rgb,
    /// Squared relative index of refraction along the path. Russian roulette divides it out of β.
    pub(super) eta_scale: f32,
    /// Pixel width at the origin of the ray, and its growth per unit length.
    pub(super) width: f32,
    pub(super) spread: f32,
    /// Number of non-scattering surfaces passed since the last vertex.
    pub(super) passed: u32,
    /// Distance travelled through such surfaces.
    pub(super) travelled: f32,
    /// The technique that sampled the direction, if the segment may hit emitters.
    pub(super) technique: Option<BsdfTechnique>,
    /// The medium around the ray.
    pub(super) medium: Option<MediumId>,
    /// Wavelength (nm), once a dispersive material has chosen one.
    pub(super) wavelength: Option<f32>,
    /// The path has ended in a medium, and continues only to the features of the first surface behind.
    pub(super) is_ghost: bool,
    /// The part of the path that light paths can sample as well.
    pub(super) chain: Chain,
}

impl PathState {
    /// Emission of a surface hit, times throughput and MIS weight.
    pub(super) fn emission(
        &self,
        job: &RenderJob,
        left: &LastVertices<'_, '_>,
        interaction: &SurfaceInteraction,
        guide: Option<&Guide>,
    ) -> Rgb {
        let lights = &job.lights;
        if interaction.hit.instance != Hit::NO_INSTANCE {
            return Rgb::BLACK;
        }
        let Some(light) = lights.light_of(interaction.hit.geometry, interaction.hit.primitive) else {
            return Rgb::BLACK;
        };
        if self.technique.is_some() && lights.lights[light as usize].is_dark_from(left.ctx(self).p) {
            return Rgb::BLACK;
        }

        // Weight against light paths, then against light samples
        let s = &interaction.surface;
        let hit = LightHit { t: self.depth(interaction), p: s.p, n: s.n, uv: s.uv };
        let mut l = self.beta * lights.lights[light as usize].l(&hit, interaction.wo);
        if let Some(guide) = guide.filter(|_| self.chain.is_caustic() && !l.is_black()) {
            l *= self.chain.rest(guide.density(light, s.n, interaction.wo));
        }
        match &self.technique {
            Some(_) if !l.is_black() => l * left.weight(self, |ctx| lights.pdf(ctx, light, self.ray.d, &hit)),
            _ => l,
        }
    }

    /// The throughput beyond the surface hit by the last segment; `None` if roulette ends the path there.
    #[inline]
    pub(super) fn beta_beyond_emitter(&self) -> Option<Rgb> {
        match &self.technique {
            Some(technique) if self.passed == 0 => technique.survivor,
            _ => Some(self.beta),
        }
    }

    /// Multiplies the throughput by `weight`, the transmittance of a medium over its sampling probability.
    pub(super) fn weaken(&mut self, weight: Rgb) {
        self.beta *= weight;
        if let Some(technique) = &mut self.technique {
            technique.survivor = technique.survivor.map(|survivor| survivor * weight);
        }
    }

    pub(super) fn features(
        &self,
        job: &RenderJob,
        interaction: &SurfaceInteraction,
        bsdf: &SurfaceBsdf<'_>,
        features: FeatureSet,
        stream: &SampleStream,
    ) -> Features {
        let z = bsdf.frame.z;
        Features {
            albedo: match features {
                FeatureSet::All => bsdf.albedo_estimate(interaction.wo, || stream.domain(domain::ALBEDO).draw::<3>()),
                FeatureSet::None | FeatureSet::NoAlbedo => Rgb::BLACK,
            },
            normal: if z.dot(interaction.wo) < 0.0 { -z } else { z },
            depth: self.depth(interaction),
            material: job.world.scene.surfaces[interaction.hit.geometry as usize].material,
            object: interaction.hit.geometry,
        }
    }

    /// Distance from the camera along the ray.
    pub(super) fn depth(&self, interaction: &SurfaceInteraction) -> f32 {
        self.travelled + interaction.distance
    }

    /// The path beyond a non-scattering surface, with the throughput `beta`.
    pub(super) fn pass(&self, job: &RenderJob, beta: Rgb, interaction: &SurfaceInteraction) -> PathState {
        PathState {
            beta,
            medium: interaction.medium_beyond(job, self.ray.d, self.medium),
            ray: Ray { o: interaction.origin(self.ray.d), ..self.ray },
            width: interaction.width,
            passed: self.passed + 1,
            travelled: self.travelled + interaction.distance,
            chain: Chain::NONE,
            ..*self
        }
    }
}

/// BSDF sampling at the last vertex, for its MIS weight against light sampling there.
#[derive(Clone, Copy, Debug)]
pub(super) struct BsdfTechnique {
    /// The row of the last vertex; [`Self::NO_ROW`] if no light was sampled there.
    pub(super) row: u32,
    /// Density of the direction; `None` for a specular lobe, which no other technique samples.
    pub(super) pdf: Option<f32>,
    /// Throughput beyond the first surface; `None` if roulette ends the path there.
    pub(super) survivor: Option<Rgb>,
}

impl BsdfTechnique {
    /// Stands for a point where no light was sampled.
    pub(super) const NO_ROW: u32 = u32::MAX;
}

/// The last vertices of the paths of a batch, and the direct-light techniques used there.
pub(super) struct LastVertices<'a, 'w> {
    pub(super) vertices: &'a Vertices<'w>,
    pub(super) techniques: Option<Techniques>,
}

impl LastVertices<'_, '_> {
    /// The point at which light was sampled last.
    #[inline]
    pub(super) fn ctx(&self, path: &PathState) -> LightCtx {
        match path.technique {
            Some(technique) if technique.row != BsdfTechnique::NO_ROW => {
                self.vertices.surface.lit_points().get(technique.row as usize)
            }
            _ => LightCtx::at(path.ray.o),
        }
    }

    /// MIS weight of an emitter hit by the BSDF sample of a path; light sampling has the density `p_light`.
    #[inline]
    pub(super) fn weight(&self, path: &PathState, p_light: impl FnOnce(&LightCtx) -> f32) -> f32 {
        let Some(techniques) = &self.techniques else { return 1.0 };
        path.technique.and_then(|technique| technique.pdf).map_or(1.0, |p| {
            let light = Technique { n: techniques.light_samples(), p: p_light(&self.ctx(path)) };
            techniques.heuristic.weight(Technique { n: 1.0, p }, light)
        })
    }
}

/// Russian roulette before bounce `bounce`, for a path that leaves the vertex of `stream` with the throughput `beta`.
/// The survival probability is the maximum of β · `eta_scale`, so refraction does not count as a loss. Returns the
/// throughput of a path that survives.
#[inline]
pub(super) fn survive(
    beta: Rgb,
    eta_scale: f32,
    stream: &SampleStream,
    bounce: u32,
    settings: &IntegratorSettings,
) -> Option<Rgb> {
    let survival = (beta * eta_scale).map(f32::abs).max_component();
    if !settings.has_roulette(bounce) || !(survival < 1.0) {
        return Some(beta);
    }
    (stream.draw_random(domain::ROULETTE) < survival).then(|| beta / survival)
}

#[cfg(test)]
mod tests {
    use super::*;
    use lumiris_numbers::samplers::SamplerKind;

    #[test]
    fn roulette_keeps_the_mean_of_the_throughput() {
        let settings = IntegratorSettings { roulette_depth: Some(3), ..IntegratorSettings::default() };
        let streams = (0..4096).map(|i| SampleStream::new(SamplerKind::Sobol, [i % 64, i / 64], i, 1));
        let (beta, eta_scale) = (Rgb::new(0.1, 0.2, 0.05), 2.25);

        // Refraction does not count as a loss: the survival probability is 0.2·2.25
        let (mut sum, mut count) = (Rgb::BLACK, 0);
        for stream in streams.clone() {
            assert_eq!(survive(beta, eta_scale, &stream, 2, &settings), Some(beta));
            let Some(survivor) = survive(beta, eta_scale, &stream, 3, &settings) else { continue };
            (sum, count) = (sum + survivor, count + 1);
        }
        // Five standard deviations of independent numbers
        let (mean, share) = (sum * (1.0 / 4096.0), count as f32 / 4096.0);
        assert!((share - 0.45).abs() < 0.04, "{share}");
        assert!((mean.g - 0.2).abs() < 0.02 && (mean.r - 0.1).abs() < 0.01, "{mean:?}");

        // A throughput above 1 is unchanged
        let bright = Rgb::splat(1.5);
        assert!(streams.into_iter().all(|stream| survive(bright, 1.0, &stream, 9, &settings) == Some(bright)));
    }
}
