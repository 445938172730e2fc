//! A path on its way: its state between two vertices, and the ways in which it goes on.

use super::light_paths::{Chain, Guide};
use crate::accel::Hit;
use crate::bsdfs::Lobe;
use crate::cameras::CameraRay;
use crate::direct::estimators::mis::Mis;
use crate::direct::{DirectStats, ShadingPoint};
use crate::film::{FeatureSet, Features};
use crate::geometry::SurfaceHit;
use crate::lights::{GlossyLobe, LightCtx, LightHit};
use crate::materials::SurfaceBsdf;
use crate::media::{MediumId, Sides};
use crate::scene::{RenderJob, SurfaceInteraction};
use crate::settings::{IntegratorSettings, SampleCounts};
use lumiris_numbers::estimators::mis::{Heuristic, Technique};
use lumiris_numbers::math::ray::offset_origin;
use lumiris_numbers::math::{Ray, Rgb, Vec3};
use lumiris_numbers::samplers::SampleStream;
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
    /// The way to vertex k, through media, uses the domain `FLIGHT + k`.
    pub(crate) const FLIGHT: u32 = 1 << 19;
    /// The light about which distances of a flight may be equiangular.
    pub(crate) const FOCUS: u32 = 1 << 18;
    /// The walk through an interior on the way to vertex k uses the domain `WALK + k`.
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
    /// Tentative collisions of flights through media, about.
    pub collisions: u64,
    /// Direct lighting.
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

/// A camera sample to be traced.
#[derive(Clone, Copy, Debug)]
pub struct CameraSample {
    /// Its ray.
    pub ray: CameraRay,
    /// Weight of the pixel filter times that of the camera.
    pub weight: f32,
    /// Its random numbers.
    pub stream: SampleStream,
    /// Random numbers of direct light, which progressive estimators draw anew for every block of samples: they are
    /// independent of those of earlier blocks, wherever the path goes.
    pub direct: SampleStream,
    /// Sample counts at its first vertex.
    pub sample_counts: SampleCounts,
    /// Which samples of neighbouring pixels may share its path, and which light paths it has: its index, where all pixels
    /// have as many samples.
    pub turn: u32,
    /// The fit of its pixel.
    pub fit: u32,
    /// Its pixel; any, where none is the sample's.
    pub pixel: [u32; 2],
    /// True if it is of a second estimate of its pixel, by which the variance is known.
    pub is_replica: bool,
}

/// The state of a path.
#[derive(Clone, Copy, Debug)]
pub(super) struct PathState {
    /// Index of the camera sample.
    pub(super) sample: u32,
    pub(super) ray: Ray,
    pub(super) beta: Rgb,
    /// Squared relative index of refraction along the path, which roulette takes out of β.
    pub(super) eta_scale: f32,
    /// Width of a pixel at the ray's origin, and its growth per unit length.
    pub(super) width: f32,
    pub(super) spread: f32,
    /// Surfaces without scattering passed since the last vertex.
    pub(super) passed: u32,
    /// Distance travelled through such surfaces.
    pub(super) travelled: f32,
    /// The technique that drew the direction, if the segment looks for emitters.
    pub(super) technique: Option<BsdfTechnique>,
    /// What the ray goes through.
    pub(super) medium: Option<MediumId>,
    /// The wavelength (nm) that the path has got where its index of refraction depends on it.
    pub(super) wavelength: Option<f32>,
    /// The path has ended in a medium, and only looks for the features of the first surface behind.
    pub(super) is_ghost: bool,
    /// What light paths could have found as well.
    pub(super) chain: Chain,
}

/// What a path keeps at a vertex of what it brought there.
#[derive(Clone, Copy, Debug)]
pub(super) struct Carried {
    /// Index of the camera sample.
    pub(super) sample: u32,
    pub(super) beta: Rgb,
    pub(super) eta_scale: f32,
    /// Width of a pixel at the vertex, and its growth per unit length.
    pub(super) width: f32,
    pub(super) spread: f32,
    pub(super) time: f32,
    /// See [`PathState`].
    pub(super) passed: u32,
    /// See [`PathState`].
    pub(super) wavelength: Option<f32>,
    /// See [`PathState`].
    pub(super) chain: Chain,
}

impl PathState {
    /// At a vertex with the throughput `beta`, where a pixel has the given width.
    #[inline]
    pub(super) fn carried(&self, beta: Rgb, width: f32) -> Carried {
        let PathState { sample, eta_scale, spread, passed, wavelength, chain, ray: Ray { time, .. }, .. } = *self;
        Carried { sample, beta, eta_scale, width, spread, time, passed, wavelength, chain }
    }

    /// What the path carries of the emission of a surface, with the weight of the technique that found it.
    pub(super) fn emission(&self, job: &RenderJob, interaction: &SurfaceInteraction, guide: Option<&Guide>) -> Rgb {
        let lights = &job.lights;
        if interaction.hit.instance != Hit::NO_INSTANCE {
            return Rgb::BLACK;
        }
        let Some(light) = lights.light_of(interaction.hit.geometry, interaction.hit.primitive) else {
            return Rgb::BLACK;
        };
        if self.technique.is_some_and(|technique| lights.lights[light as usize].is_dark_from(technique.ctx.p)) {
            return Rgb::BLACK;
        }
        let s = &interaction.surface;
        let hit = LightHit { t: self.depth(interaction), p: s.p, n: s.n, uv: s.uv };
        let mut l = self.beta * lights.lights[light as usize].l(&hit, interaction.wo);
        if let Some(guide) = guide.filter(|_| self.chain.is_caustic() && !l.is_black()) {
            l *= self.chain.rest(guide.density(light, s.n, interaction.wo));
        }
        match &self.technique {
            Some(technique) if !l.is_black() => l * technique.weight(|ctx| lights.pdf(ctx, light, self.ray.d, &hit)),
            _ => l,
        }
    }

    /// The throughput beyond what the last segment has hit; `None` if roulette ends the path there.
    #[inline]
    pub(super) fn beta_beyond_emitter(&self) -> Option<Rgb> {
        match &self.technique {
            Some(technique) if self.passed == 0 => technique.survivor,
            _ => Some(self.beta),
        }
    }

    /// Multiplies what it carries by what a medium lets pass.
    pub(super) fn weaken(&mut self, weight: Rgb) {
        self.beta *= weight;
        if let Some(technique) = &mut self.technique {
            technique.survivor = technique.survivor.map(|survivor| survivor * weight);
        }
    }

    /// Features of a hit of a mesh that reflects `rho`, without the normal.
    pub(super) fn plain_features(&self, job: &RenderJob, hit: &Hit, distance: f32, rho: Rgb) -> Features {
        Features {
            albedo: rho,
            normal: Vec3::ZERO,
            depth: self.travelled + distance,
            material: job.world.scene.surfaces[hit.geometry as usize].material,
            object: hit.geometry,
        }
    }

    pub(super) fn features(
        &self,
        job: &RenderJob,
        interaction: &SurfaceInteraction,
        bsdf: &SurfaceBsdf<'_>,
        (features, stream): (FeatureSet, &SampleStream),
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

    /// The path beyond a surface that does not scatter, with the throughput `beta`.
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

/// BSDF sampling at the last vertex, as multiple importance sampling weights it against light sampling there.
#[derive(Clone, Copy, Debug)]
pub(super) struct BsdfTechnique {
    /// Where light sampling stood.
    pub(super) ctx: LightCtx,
    /// Number of light samples.
    pub(super) n_light: f32,
    /// Density of the direction; `None` for a specular lobe, which no other technique samples.
    pub(super) pdf: Option<f32>,
    pub(super) heuristic: Heuristic,
    /// Throughput of the path beyond the first surface, if roulette lets it go on.
    pub(super) survivor: Option<Rgb>,
}

impl BsdfTechnique {
    /// The weight of what it found, where light sampling has the density `p_light`.
    pub(super) fn weight(&self, p_light: impl FnOnce(&LightCtx) -> f32) -> f32 {
        self.pdf.map_or(1.0, |p| {
            let light = Technique { n: self.n_light, p: p_light(&self.ctx) };
            self.heuristic.weight(Technique { n: 1.0, p }, light)
        })
    }
}

impl Carried {
    /// Throughput and squared relative index of refraction of the path in a direction; `None` if it carries nothing.
    #[inline]
    pub(super) fn beyond(&self, direction: &Direction) -> Option<(Rgb, f32)> {
        let beta = self.beta * direction.weight;
        let eta_scale = self.eta_scale * direction.eta * direction.eta;
        (!beta.is_black() && beta.is_finite()).then_some((beta, eta_scale))
    }

    /// What light paths could have found as well, in a direction beyond a vertex of geometric normal `n`.
    #[inline]
    pub(super) fn chain_beyond(&self, n: Vec3, direction: &Direction) -> Chain {
        if self.chain.is_caustic() {
            return self.chain;
        }
        let pdf = direction.pdf.filter(|_| !direction.lobe.is_specular());
        self.chain.beyond_first(pdf, n.dot(direction.wi))
    }

    /// The path from the origin `o` on in the direction `wi`, with what [`Self::beyond`] says.
    #[inline]
    pub(super) fn segment(&self, o: Vec3, wi: Vec3, beta: Rgb, eta_scale: f32) -> PathState {
        let Carried { sample, width, spread, time, wavelength, chain, .. } = *self;
        let ray = Ray { o, d: wi, t_max: f32::INFINITY, time };
        PathState {
            sample,
            ray,
            beta,
            eta_scale,
            width,
            spread,
            passed: 0,
            travelled: 0.0,
            technique: None,
            medium: None,
            wavelength,
            is_ghost: false,
            chain,
        }
    }
}

/// Russian roulette before bounce `bounce` on what the path that left the vertex of `stream` carries, its throughput
/// `beta` without the scaling of refraction: the throughput of a path that goes on.
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

/// How a path continues.
pub(super) struct Direction {
    pub(super) wi: Vec3,
    /// Factor of the throughput.
    pub(super) weight: Rgb,
    /// Relative index of refraction.
    pub(super) eta: f32,
    pub(super) lobe: Lobe,
    /// Density of the direction; `None` if it was resampled.
    pub(super) pdf: Option<f32>,
}

/// A direction by BSDF sampling.
pub(super) fn sampled_direction(bsdf: &SurfaceBsdf<'_>, wo: Vec3, [uc, u0, u1]: [f32; 3]) -> Option<Direction> {
    let sample = bsdf.sample(wo, uc, [u0, u1])?;
    let weight = sample.f * (bsdf.cos(sample.wi) / sample.pdf);
    Some(Direction { wi: sample.wi, weight, eta: sample.eta, lobe: sample.lobe, pdf: Some(sample.pdf) })
}

/// A vertex that scatters.
#[derive(Clone, Copy, Debug)]
pub(super) struct Vertex<'w> {
    pub(super) surface: SurfaceHit,
    pub(super) bsdf: SurfaceBsdf<'w>,
    pub(super) wo: Vec3,
    pub(super) stream: SampleStream,
    pub(super) direct: SampleStream,
    /// The path has passed no surface since its last vertex.
    pub(super) is_next: bool,
    /// What rays that leave it go through.
    pub(super) media: Sides,
}

impl<'w> Vertex<'w> {
    /// Origin of a ray that leaves the vertex in direction `w`.
    fn origin(&self, w: Vec3) -> Vec3 {
        offset_origin(self.surface.p, self.surface.p_error, self.bsdf.n, w)
    }

    /// The segment in a direction, with what it goes through.
    fn segment(&self, carried: &Carried, direction: &Direction, beta: Rgb, eta_scale: f32) -> PathState {
        let wi = direction.wi;
        let medium = self.media.towards(self.bsdf.n.dot(wi));
        let chain = carried.chain_beyond(self.bsdf.n, direction);
        PathState { medium, chain, ..carried.segment(self.origin(wi), wi, beta, eta_scale) }
    }

    /// The shading normal on the side of the viewer.
    pub(super) fn viewer_normal(&self) -> Vec3 {
        let z = self.bsdf.frame.z;
        if z.dot(self.wo) < 0.0 { -z } else { z }
    }

    pub(super) fn shading_point(&self, time: f32, sample_counts: SampleCounts, fit: u32) -> ShadingPoint<'w> {
        ShadingPoint {
            p: self.surface.p,
            p_error: self.surface.p_error,
            wo: self.wo,
            bsdf: self.bsdf,
            lobe: GlossyLobe::NONE,
            time,
            stream: self.direct.domain(domain::DIRECT),
            sample_counts,
            fit,
            sample: 0,
            bsdf_by_path: false,
            media: self.media,
        }
    }
}

/// The next path segment by BSDF sampling and Russian roulette, with the lobe that it took; `None` if the path ends.
pub(super) fn extend(
    path: &PathState,
    v: &Vertex<'_>,
    vertex: u32,
    settings: &IntegratorSettings,
) -> Option<(PathState, Lobe)> {
    let direction = next_direction(v, settings)?;
    let carried = path.carried(path.beta, path.width);
    let (beta, eta_scale) = carried.beyond(&direction)?;
    let beta = survive(beta, eta_scale, &v.stream, vertex + 1, settings)?;
    Some((v.segment(&carried, &direction, beta, eta_scale), direction.lobe))
}

/// The next path segment by BSDF sampling, which looks for the emitter of the sample as well. Roulette ends it only behind
/// that; `None` if the direction carries no light.
pub(super) fn extend_to_emitter(
    path: &PathState,
    v: &Vertex<'_>,
    point: &ShadingPoint<'_>,
    vertex: u32,
    (settings, mis): (&IntegratorSettings, &Mis),
) -> Option<PathState> {
    let direction = next_direction(v, settings)?;
    let carried = path.carried(path.beta, path.width);
    let (beta, eta_scale) = carried.beyond(&direction)?;
    debug_assert!(direction.pdf.is_some(), "a resampled direction has no weight against light sampling");
    let technique = BsdfTechnique {
        ctx: point.light_ctx(),
        n_light: point.light_samples_beside_path() as f32,
        pdf: direction.pdf.filter(|_| !direction.lobe.is_specular()),
        heuristic: mis.heuristic,
        survivor: survive(beta, eta_scale, &v.stream, vertex + 1, settings),
    };
    let next = v.segment(&carried, &direction, beta, eta_scale);
    Some(PathState { technique: Some(technique), ..next })
}

/// A direction by BSDF sampling; of a BSDF that can only be evaluated, by resampling M proposals.
fn next_direction(v: &Vertex<'_>, settings: &IntegratorSettings) -> Option<Direction> {
    if v.bsdf.bsdf.is_only_evaluated() {
        let count = settings.bsdf_proposals.max(1);
        let proposal = |i| v.stream.split(domain::BSDF, count, i).draw::<3>();
        let [u_choice] = v.stream.domain(domain::RESAMPLE).draw::<1>();
        let r = v.bsdf.resample(v.wo, count, proposal, u_choice)?;
        return Some(Direction {
            wi: r.wi,
            weight: r.f * (v.bsdf.cos(r.wi) * r.weight),
            eta: r.eta,
            lobe: r.lobe,
            pdf: None,
        });
    }
    sampled_direction(&v.bsdf, v.wo, v.stream.domain(domain::BSDF).draw::<3>())
}

/// An empty vector in the memory of `old`, whose items have the same layout and may borrow from something else.
pub(super) fn emptied<T, U>(mut old: Vec<T>) -> Vec<U> {
    const { assert!(size_of::<T>() == size_of::<U>() && align_of::<T>() == align_of::<U>()) };
    old.clear();
    old.into_iter().map(|_| unreachable!("the vector is empty")).collect()
}
