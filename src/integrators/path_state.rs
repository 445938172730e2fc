//! The state of a path between two vertices, and the MIS weight of an emitter that its segment hits.

use super::domain;
use super::light_paths::{Chain, LightPathGuide};
use crate::accel::{Hit, RayBatch};
use crate::direct::{Techniques, Vertices};
use crate::film::{FeatureSet, Features};
use crate::lights::{LightCtx, LightHit};
use crate::materials::SurfaceBsdf;
use crate::media::MediumId;
use crate::scene::{RenderJob, SurfaceInteraction};
use lumiris_numbers::estimators::heuristics::Technique;
use lumiris_numbers::math::{Ray, Rgb};
use lumiris_numbers::samplers::SampleStream;

/// Paths with their rays.
#[derive(Debug, Default)]
pub(super) struct Paths {
    pub(super) states: Vec<PathState>,
    pub(super) rays: RayBatch,
}

impl Paths {
    /// Number of paths.
    pub(super) fn len(&self) -> usize {
        self.states.len()
    }

    /// True if there are no paths.
    pub(super) fn is_empty(&self) -> bool {
        self.states.is_empty()
    }

    /// Removes all paths.
    pub(super) fn clear(&mut self) {
        self.states.clear();
        self.rays.clear();
    }

    /// Adds a path.
    pub(super) fn push(&mut self, state: PathState, ray: &Ray) {
        self.states.push(state);
        self.rays.push(ray);
    }

    /// A path and its ray.
    #[inline]
    pub(super) fn traced(&mut self, index: u32) -> TracedPath<'_> {
        let i = index as usize;
        TracedPath { index, state: &mut self.states[i], ray: self.rays.get(i) }
    }

    /// Removes the paths for which `keeps` is false.
    pub(super) fn retain(&mut self, keeps: impl Fn(&PathState) -> bool) {
        let kept: Vec<u32> = (0..self.len() as u32).filter(|&i| keeps(&self.states[i as usize])).collect();
        self.states.retain(keeps);
        let rays = std::mem::take(&mut self.rays);
        self.rays.gather(&rays, &kept);
    }
}

/// A path and its ray, while the hit of the ray is processed.
pub(super) struct TracedPath<'p> {
    /// Index of the path.
    pub(super) index: u32,
    pub(super) state: &'p mut PathState,
    pub(super) ray: Ray,
}

/// The state of a path but for its ray.
#[derive(Clone, Copy, Debug)]
pub(super) struct PathState {
    /// Index of the camera sample.
    pub(super) sample: u32,
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

// More would not fit the cache beside the other columns of a batch
const _: () = assert!(size_of::<PathState>() <= 80);

impl PathState {
    /// Emission of a surface that the ray hits, times throughput and MIS weight.
    pub(super) fn emission(
        &self,
        ray: &Ray,
        job: &RenderJob,
        left: &LastVertices<'_, '_>,
        interaction: &SurfaceInteraction,
        guide: Option<&LightPathGuide>,
    ) -> Rgb {
        let lights = &job.lights;
        if interaction.hit.instance != Hit::NO_INSTANCE {
            return Rgb::BLACK;
        }
        let Some(light) = lights.light_of(interaction.hit.geometry, interaction.hit.primitive) else {
            return Rgb::BLACK;
        };
        if self.technique.is_some() && lights.lights[light as usize].is_dark_from(left.ctx(self, ray).p) {
            return Rgb::BLACK;
        }

        // Weight against light paths, then against light samples
        let s = &interaction.surface;
        let hit = LightHit { t: self.depth(interaction), p: s.p, n: s.n, uv: s.uv };
        let mut l = self.beta * lights.lights[light as usize].l(&hit, interaction.wo);
        if let Some(guide) = guide.filter(|_| self.chain.is_caustic() && !l.is_black()) {
            l *= self.chain.camera_weight(guide.density(light, s.n, interaction.wo));
        }
        match &self.technique {
            Some(_) if !l.is_black() => l * left.weight(self, ray, |ctx| lights.pdf(ctx, light, ray.d, &hit)),
            _ => l,
        }
    }

    /// The throughput beyond the surface hit by the last segment; `None` if roulette ends the path there.
    #[inline]
    pub(super) fn beta_beyond_emitter(&self) -> Option<Rgb> {
        match &self.technique {
            Some(BsdfTechnique { survival, .. }) if self.passed == 0 => {
                (*survival > 0.0).then(|| self.beta / *survival)
            }
            _ => Some(self.beta),
        }
    }

    /// Features of the first surface, for denoisers and AOVs.
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

    /// Continues the path beyond a non-scattering surface, with the throughput `beta`.
    pub(super) fn pass(&mut self, ray: &mut Ray, job: &RenderJob, beta: Rgb, interaction: &SurfaceInteraction) {
        *self = PathState {
            beta,
            medium: interaction.medium_beyond(job, ray.d, self.medium),
            width: interaction.width,
            passed: self.passed + 1,
            travelled: self.travelled + interaction.distance,
            chain: Chain::NONE,
            ..*self
        };
        ray.o = interaction.origin(ray.d);
    }
}

/// BSDF sampling at the last vertex, for its MIS weight against light sampling there.
#[derive(Clone, Copy, Debug)]
pub(super) struct BsdfTechnique {
    /// The row of the last vertex; [`Self::NO_ROW`] if no light was sampled there.
    pub(super) row: u32,
    /// Density of the direction; 0 for a specular lobe, which no other technique samples.
    pub(super) pdf: f32,
    /// Probability with which roulette lets the path continue beyond the first surface; 0 if it ends the path there.
    pub(super) survival: f32,
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
    pub(super) fn ctx(&self, path: &PathState, ray: &Ray) -> LightCtx {
        match path.technique {
            Some(technique) if technique.row != BsdfTechnique::NO_ROW => {
                self.vertices.surface.lit_points().get(technique.row as usize)
            }
            _ => LightCtx::at(ray.o),
        }
    }

    /// MIS weight of an emitter hit by the BSDF sample of a path; light sampling has the density `p_light`.
    #[inline]
    pub(super) fn weight(&self, path: &PathState, ray: &Ray, p_light: impl FnOnce(&LightCtx) -> f32) -> f32 {
        let Some(techniques) = &self.techniques else { return 1.0 };
        let Some(BsdfTechnique { pdf: p, .. }) = path.technique.filter(|technique| technique.pdf > 0.0) else {
            return 1.0;
        };
        let light = Technique { n: techniques.light_samples(), p: p_light(&self.ctx(path, ray)) };
        techniques.heuristic.weight(Technique { n: 1.0, p }, light)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::direct::Estimator;
    use crate::settings::IntegratorSettings;
    use lumiris_numbers::math::Vec3;

    const RAY: Ray = Ray { o: Vec3::ZERO, d: Vec3::Z, t_max: f32::INFINITY, time: 0.0 };

    fn path(technique: Option<BsdfTechnique>) -> PathState {
        let (beta, chain) = (Rgb::splat(0.5), Chain::NONE);
        let (sample, eta_scale, width, spread, passed, travelled) = (0, 1.0, 0.0, 0.0, 0, 0.0);
        let (medium, wavelength, is_ghost) = (None, None, false);
        PathState {
            sample,
            beta,
            eta_scale,
            width,
            spread,
            passed,
            travelled,
            technique,
            medium,
            wavelength,
            is_ghost,
            chain,
        }
    }

    #[test]
    fn roulette_counts_beyond_the_first_surface_and_once() {
        let technique = BsdfTechnique { row: 0, pdf: 1.0, survival: 0.25 };
        assert_eq!(path(Some(technique)).beta_beyond_emitter().unwrap().r, 2.0);
        let certain = path(Some(BsdfTechnique { survival: 1.0, ..technique }));
        assert_eq!(certain.beta_beyond_emitter().unwrap().r, 0.5);
        assert_eq!(path(None).beta_beyond_emitter().unwrap().r, 0.5);

        let ended = path(Some(BsdfTechnique { survival: 0.0, ..technique }));
        assert_eq!(ended.beta_beyond_emitter(), None);
        assert_eq!(PathState { passed: 1, ..ended }.beta_beyond_emitter(), Some(ended.beta));
    }

    #[test]
    fn paths_keep_their_rays() {
        let mut paths = Paths::default();
        for sample in 0..5 {
            paths.push(PathState { sample, ..path(None) }, &Ray { time: sample as f32, ..RAY });
        }
        paths.retain(|path| path.sample % 2 == 1);
        assert_eq!((paths.len(), paths.rays.len()), (2, 2));
        assert!([1, 3].into_iter().eq(paths.states.iter().map(|path| path.sample)));
        assert_eq!(paths.rays.time, [1.0, 3.0]);
    }

    #[test]
    fn an_emitter_hit_has_the_weight_that_light_samples_leave() {
        let settings = IntegratorSettings { samples: Some(4), ..IntegratorSettings::default() };
        let techniques = Techniques::of(&Estimator::at_vertex(&settings, 0), true);
        let (vertices, n) = (Vertices::default(), techniques.unwrap().light_samples());
        let last = LastVertices { vertices: &vertices, techniques };
        let technique = |pdf| BsdfTechnique { row: BsdfTechnique::NO_ROW, pdf, survival: 0.0 };
        let sampled = path(Some(technique(2.0)));
        let (light, bsdf) = (Technique { n, p: 0.5 }, Technique { n: 1.0, p: 2.0 });
        let of_light = techniques.unwrap().heuristic.weight(light, bsdf);
        assert!(of_light > 0.0 && (last.weight(&sampled, &RAY, |_| 0.5) + of_light - 1.0).abs() < 1e-6);

        // Only BSDF sampling finds emitters in specular directions, and where no light is sampled
        assert_eq!(last.weight(&path(Some(technique(0.0))), &RAY, |_| 0.5), 1.0);
        assert_eq!(LastVertices { vertices: &vertices, techniques: None }.weight(&sampled, &RAY, |_| 0.5), 1.0);
    }
}
