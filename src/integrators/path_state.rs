//! The state of a path between two vertices, and the MIS weight of an emitter that its segment hits.

use super::domain;
use super::light_paths::{Chain, Guide};
use crate::accel::Hit;
use crate::direct::{Techniques, Vertices};
use crate::film::{FeatureSet, Features};
use crate::lights::{LightCtx, LightHit};
use crate::materials::SurfaceBsdf;
use crate::media::MediumId;
use crate::scene::{RenderJob, SurfaceInteraction};
use lumiris_numbers::estimators::heuristics::Technique;
use lumiris_numbers::math::{Ray, Rgb};
use lumiris_numbers::samplers::SampleStream;

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
            l *= self.chain.camera_weight(guide.density(light, s.n, interaction.wo));
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::direct::Estimator;
    use crate::settings::IntegratorSettings;
    use lumiris_numbers::math::Vec3;

    fn path(technique: Option<BsdfTechnique>) -> PathState {
        let ray = Ray { o: Vec3::ZERO, d: Vec3::Z, t_max: f32::INFINITY, time: 0.0 };
        let (beta, chain) = (Rgb::splat(0.5), Chain::NONE);
        let (sample, eta_scale, width, spread, passed, travelled) = (0, 1.0, 0.0, 0.0, 0, 0.0);
        let (medium, wavelength, is_ghost) = (None, None, false);
        PathState {
            sample,
            ray,
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
    fn a_medium_weakens_the_path_before_and_beyond_an_emitter() {
        let technique = BsdfTechnique { row: 0, pdf: Some(1.0), survivor: Some(Rgb::splat(2.0)) };
        let mut through = path(Some(technique));
        through.weaken(Rgb::splat(0.25));
        assert_eq!((through.beta.r, through.beta_beyond_emitter().unwrap().r), (0.125, 0.5));

        // Roulette has ended the path beyond its first surface, and counts once
        let ended = path(Some(BsdfTechnique { survivor: None, ..technique }));
        assert_eq!(ended.beta_beyond_emitter(), None);
        assert_eq!(PathState { passed: 1, ..ended }.beta_beyond_emitter(), Some(ended.beta));
        assert_eq!(path(None).beta_beyond_emitter().unwrap().r, 0.5);
    }

    #[test]
    fn an_emitter_hit_has_the_weight_that_light_samples_leave() {
        let settings = IntegratorSettings { samples: Some(4), ..IntegratorSettings::default() };
        let techniques = Techniques::of(&Estimator::at_vertex(&settings, 0), true);
        let (vertices, n) = (Vertices::default(), techniques.unwrap().light_samples());
        let last = LastVertices { vertices: &vertices, techniques };
        let technique = |pdf| BsdfTechnique { row: BsdfTechnique::NO_ROW, pdf, survivor: None };
        let sampled = path(Some(technique(Some(2.0))));
        let (light, bsdf) = (Technique { n, p: 0.5 }, Technique { n: 1.0, p: 2.0 });
        let of_light = techniques.unwrap().heuristic.weight(light, bsdf);
        assert!(of_light > 0.0 && (last.weight(&sampled, |_| 0.5) + of_light - 1.0).abs() < 1e-6);

        // Only BSDF sampling finds emitters in specular directions, and where no light is sampled
        assert_eq!(last.weight(&path(Some(technique(None))), |_| 0.5), 1.0);
        assert_eq!(LastVertices { vertices: &vertices, techniques: None }.weight(&sampled, |_| 0.5), 1.0);
    }
}
