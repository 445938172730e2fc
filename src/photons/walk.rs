//! Random walks of particles, a batch at a time: photons from lights, and importons from the camera.
//!
//! At each surface a particle is scattered by its BSDF and survives with the probability by which its power would
//! decrease, so that powers remain nearly equal [Arvo and Kirk 1990]. Photons carry flux, importons importance; their
//! weights differ by the adjoint [Veach 1997, §5.3.2]:
//!
//! * importons, like camera paths: f |wi·ns|/p
//! * photons: f η² |wo·ns| |wi·n|/(|wo·n| p), where f is the BSDF for radiance, which includes the factor 1/η² of
//!   refraction
//!
//! with the shading normal ns, the geometric normal n, and `wo` pointing towards the particle's origin.
//!
//! A scattering event belongs either to the Lambertian part of the BSDF or to the other lobes. If both scatter into the
//! sampled direction, one of them is chosen in proportion to its f. Its weight is then divided by the probability of
//! the choice.

use super::photon::Origin;
use crate::accel::{Coherence, Hit, RayBatch};
use crate::bsdfs::dielectric::Transport;
use crate::bsdfs::{Lambertian, Resampled};
use crate::materials::SurfaceBsdf;
use crate::scene::{RenderJob, SurfaceInteraction, SurfaceInteractions};
use lumiris_numbers::math::sphere_map::equal_area_sphere_to_square;
use lumiris_numbers::math::{Ray, Rgb, Vec3};
use lumiris_numbers::samplers::SampleStream;

/// Maximum number of surfaces without scattering between two vertices.
const MAX_PASSED: u32 = 64;

/// Random-number domains of a vertex.
mod domain {
    pub(super) const BSDF: u32 = 0;
    pub(super) const RESAMPLE: u32 = 1;
    pub(super) const ROULETTE: u32 = 2;
    pub(super) const PART: u32 = 3;
    /// The number that decides on storage.
    pub(super) const DEPOSIT: u32 = 4;
    /// Vertex k has the domain `VERTEX + k` of the photon path.
    pub(super) const VERTEX: u32 = 16;
}

/// A particle on its way.
#[derive(Clone, Copy, Debug)]
pub(super) struct Particle {
    /// Index in its batch.
    pub(super) index: u32,
    pub(super) ray: Ray,
    /// Its power.
    pub(super) power: Rgb,
    /// Its last scattering event.
    pub(super) origin: Origin,
    /// Random numbers of its photon path.
    pub(super) stream: SampleStream,
    passed: u32,
}

impl Particle {
    pub(super) fn new(index: u32, ray: Ray, power: Rgb, origin: Origin, stream: SampleStream) -> Self {
        Particle { index, ray, power, origin, stream, passed: 0 }
    }
}

/// A particle at a surface that has a Lambertian part.
pub(super) struct ParticleHit<'a> {
    pub(super) particle: &'a Particle,
    pub(super) p: Vec3,
    /// Unit direction towards the particle's origin.
    pub(super) wi: Vec3,
    /// Geometric normal on the side of `wi`.
    pub(super) n: Vec3,
    pub(super) part: &'a Lambertian<'a>,
    /// Number of scattering events so far.
    pub(super) scatterings: u32,
    stream: SampleStream,
}

impl ParticleHit<'_> {
    /// The number that decides whether it is stored.
    pub(super) fn xi(&self) -> f32 {
        self.stream.domain(domain::DEPOSIT).draw_random(0)
    }
}

/// Settings of a random walk.
#[derive(Clone, Copy, Debug)]
pub(super) struct WalkSettings {
    pub(super) transport: Transport,
    /// Maximum number of scattering events before a hit.
    pub(super) max_depth: u32,
}

/// Walks with particles; holds the buffers of one worker.
#[derive(Debug, Default)]
pub(super) struct Walker {
    /// The particles to trace.
    pub(super) active: Vec<Particle>,
    next: Vec<Particle>,
    passing: Vec<Particle>,
    rays: RayBatch,
    hits: Vec<Option<Hit>>,
    surfaces: SurfaceInteractions,
    /// Rays traced so far.
    pub(super) traced: u64,
}

impl Walker {
    /// Traces the active particles until all have ended, and reports their arrivals at Lambertian surfaces in the order
    /// of vertices.
    pub(super) fn walk(&mut self, job: &RenderJob, settings: &WalkSettings, mut on_hit: impl FnMut(&ParticleHit<'_>)) {
        self.sort(job);
        let mut coherence = Coherence::Packets;
        for vertex in 0..=settings.max_depth {
            self.next.clear();
            while !self.active.is_empty() {
                self.step(job, settings, vertex, coherence, &mut on_hit);
                coherence = Coherence::Incoherent;
            }
            std::mem::swap(&mut self.active, &mut self.next);
        }
        self.active.clear();
    }

    /// Sorts the particles so that neighbours have the same light, similar directions, and near origins.
    fn sort(&mut self, job: &RenderJob) {
        let lights = &job.lights;
        let key = |particle: &Particle| {
            let source = if let Origin::Primary(light) = particle.origin { light } else { 0 };
            let direction = equal_area_sphere_to_square(particle.ray.d) * 64.0;
            let place = (particle.ray.o - lights.scene_centre) / lights.scene_radius * 32.0 + 32.0;
            let direction = [direction.x, direction.y].map(|x| (x as u32).min(63));
            let place = place.to_array().map(|x| (x as u32).min(63));
            (source, interleave(direction), interleave(place))
        };
        self.active.sort_by_cached_key(key);
    }

    /// Traces the active particles to the next surface. Particles that pass it stay active.
    fn step(
        &mut self,
        job: &RenderJob,
        settings: &WalkSettings,
        vertex: u32,
        coherence: Coherence,
        on_hit: &mut impl FnMut(&ParticleHit<'_>),
    ) {
        self.rays.clear();
        self.active.iter().for_each(|particle| self.rays.push(&particle.ray));
        job.world.accel.intersect(&self.rays, coherence, &mut self.hits);
        self.traced += self.rays.len() as u64;

        // Particles that pass the surface continue without a scattering event
        self.passing.clear();
        let Walker { active, next, passing, hits, surfaces, .. } = &mut *self;
        surfaces.visit(
            job,
            active,
            |particle| &particle.ray,
            hits,
            |particle, interaction| {
                let Some(bsdf) = interaction.scatter(job) else {
                    if particle.passed < MAX_PASSED {
                        let ray = Ray { o: interaction.origin(particle.ray.d), ..particle.ray };
                        passing.push(Particle { ray, passed: particle.passed + 1, ..*particle });
                    }
                    return;
                };

                // Report the hit
                let stream = particle.stream.domain(domain::VERTEX + vertex);
                let part = bsdf.lambertian(interaction.wo);
                if let Some(part) = &part {
                    let n = if bsdf.n.dot(interaction.wo) < 0.0 { -bsdf.n } else { bsdf.n };
                    on_hit(&ParticleHit {
                        particle,
                        p: interaction.surface.p,
                        wi: interaction.wo,
                        n,
                        part,
                        scatterings: vertex,
                        stream,
                    });
                }

                // Scatter
                if vertex < settings.max_depth {
                    let proposals = job.settings().integrator.bsdf_proposals;
                    let scattering = Scattering { interaction, bsdf: &bsdf, part: part.as_ref(), stream, proposals };
                    next.extend(scattering.scatter(particle, settings.transport));
                }
            },
        );
        std::mem::swap(&mut self.active, &mut self.passing);
    }
}

/// The Morton code of coordinates below 64, with interleaved bits: near points have near codes [Morton 1966].
fn interleave<const N: usize>(coordinates: [u32; N]) -> u32 {
    (0..6).rev().flat_map(|bit| coordinates.map(move |x| x >> bit & 1)).fold(0, |code, bit| code << 1 | bit)
}

/// A scattering event of a particle.
struct Scattering<'a> {
    interaction: &'a SurfaceInteraction,
    bsdf: &'a SurfaceBsdf<'a>,
    part: Option<&'a Lambertian<'a>>,
    stream: SampleStream,
    /// Number of proposals for BSDFs that can only be evaluated.
    proposals: u32,
}

/// The part of a BSDF that scatters a particle.
struct ChosenPart {
    /// Its f over the probability of the choice.
    f: Rgb,
    origin: Origin,
}

impl Scattering<'_> {
    /// The particle after the scattering event; `None` if it ends there.
    fn scatter(&self, particle: &Particle, transport: Transport) -> Option<Particle> {
        let drawn = self.draw()?;
        let (wo, wi) = (self.interaction.wo, drawn.wi);
        let ChosenPart { f, origin } = self.choose_part(&drawn);

        // Weight
        let cosine = match transport {
            Transport::Radiance => wi.dot(self.bsdf.frame.z).abs(),
            Transport::Importance => self.bsdf.adjoint_cos(wo, wi, drawn.eta),
        };
        let power = particle.power * f * (cosine * drawn.weight);
        if power.is_black() || !power.is_finite() {
            return None;
        }

        // Russian roulette by the weight, without the scaling of radiance by refraction
        let scale = match transport {
            Transport::Radiance => drawn.eta * drawn.eta,
            Transport::Importance => 1.0,
        };
        let survival = power.max_component() * scale / particle.power.max_component();
        if survival < 1.0 && self.stream.draw_random(domain::ROULETTE) >= survival {
            return None;
        }
        let power = power / survival.min(1.0);
        let ray = Ray { o: self.interaction.origin(wi), d: wi, ..particle.ray };
        Some(Particle { ray, power, origin, passed: 0, ..*particle })
    }

    /// Samples a direction by the BSDF; by resampling if the BSDF can only be evaluated.
    fn draw(&self) -> Option<Resampled> {
        let wo = self.interaction.wo;
        if self.bsdf.bsdf.is_only_evaluated() {
            let count = self.proposals.max(1);
            let proposal = |i| self.stream.split(domain::BSDF, count, i).draw::<3>();
            let [u_choice] = self.stream.domain(domain::RESAMPLE).draw::<1>();
            return self.bsdf.resample(wo, count, proposal, u_choice);
        }
        let [uc, u0, u1] = self.stream.domain(domain::BSDF).draw::<3>();
        let s = self.bsdf.sample(wo, uc, [u0, u1])?;
        Some(Resampled { f: s.f, wi: s.wi, weight: 1.0 / s.pdf, lobe: s.lobe, eta: s.eta })
    }

    /// Chooses the Lambertian part or the rest.
    fn choose_part(&self, drawn: &Resampled) -> ChosenPart {
        let Some(part) = self.part else { return ChosenPart { f: drawn.f, origin: Origin::Caustic } };
        let Some(rest) = part.rest else { return ChosenPart { f: drawn.f, origin: Origin::Diffuse } };
        if drawn.lobe.is_specular() {
            return ChosenPart { f: drawn.f, origin: Origin::Caustic };
        }
        let rest = SurfaceBsdf { bsdf: rest, ..*self.bsdf };
        let f_rest = rest.f(self.interaction.wo, drawn.wi);
        let p_rest = (f_rest.average() / drawn.f.average()).clamp(0.0, 1.0);
        if self.stream.draw_random(domain::PART) < p_rest {
            ChosenPart { f: f_rest / p_rest, origin: Origin::Caustic }
        } else {
            let f = (drawn.f - f_rest).map(|c| c.max(0.0)) / (1.0 - p_rest);
            ChosenPart { f, origin: Origin::Diffuse }
        }
    }
}
