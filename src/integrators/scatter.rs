//! BSDF sampling of the next path segments.

use super::domain;
use super::path_state::{BsdfTechnique, PathState, Paths};
use super::roulette::survival;
use crate::bsdfs::Lobe;
use crate::direct::vertices::BsdfSamples;
use crate::direct::{Techniques, Vertices};
use crate::settings::IntegratorSettings;
use lumiris_lanes::columns::{Column, Columns3, padded, reserve};
use lumiris_lanes::level;
use lumiris_lanes::sampler::{self, Below};
use lumiris_lanes::vertex as kernels;
use lumiris_numbers::math::{Rgb, Vec3};

/// Samples the directions of a batch; holds the buffers of one worker.
#[derive(Debug, Default)]
pub(super) struct Scatter {
    u: [Column; 3],
    samples: BsdfSamples,
    o: Columns3,
    /// Rows whose paths continue.
    rows: Vec<u32>,
}

/// How paths continue.
pub(super) struct Continuation<'a> {
    pub(super) settings: &'a IntegratorSettings,
    /// Index of the vertices along their paths.
    pub(super) vertex: u32,
    /// Direct-light samples at the vertices; their BSDF sample may be the next segment.
    pub(super) techniques: Option<Techniques>,
    /// Paths continue by specular lobes only.
    pub(super) only_specular: bool,
}

/// The direction of the next segment of a path.
struct Direction {
    wi: Vec3,
    /// Factor of the throughput.
    weight: Rgb,
    /// Relative index of refraction.
    eta: f32,
    /// Density; 0 if no other technique can draw the direction, or the density is unknown.
    pdf: f32,
    /// The segment is the BSDF sample of direct light as well.
    by_path: bool,
}

impl Scatter {
    /// Adds the next segments of the paths at the vertices to `next`.
    pub(super) fn extend(&mut self, how: &Continuation<'_>, vertices: &Vertices<'_>, paths: &Paths, next: &mut Paths) {
        // Draw all directions in columns
        self.draw(vertices);
        let len = padded(vertices.len());
        self.samples.reserve(len);
        self.o.reserve(len);
        vertices.sample(vertices.len(), &self.u, &mut self.samples);
        self.resample(how, vertices);

        // Make segments from the directions with a density
        let Scatter { samples: BsdfSamples { wi, f_cos, pdf, lobe, eta }, o, rows, .. } = self;
        rows.clear();
        for i in (0..vertices.len()).filter(|&i| pdf[i] > 0.0) {
            let is_resampled = i < vertices.bsdfs.len() && vertices.bsdfs[i].bsdf.is_only_evaluated();
            let lobe = Lobe::of_flags(lobe[i] as u8);
            if how.only_specular && !lobe.is_specular() {
                continue;
            }
            let direction = Direction {
                wi: wi.vec3(i),
                weight: f_cos.rgb(i) / pdf[i],
                eta: eta[i],
                pdf: if is_resampled || lobe.is_specular() { 0.0 } else { pdf[i] },
                by_path: !is_resampled && how.techniques.is_some_and(|techniques| techniques.are_by_path()),
            };
            let Some(state) = how.segment(vertices, i, &paths.states[vertices.path[i] as usize], &direction) else {
                continue;
            };
            next.states.push(state);
            rows.push(i as u32);
        }

        // Their rays
        kernels::origins(level(), &vertices.surface.ends(len), wi.get(len), &mut o.get_mut(len));
        next.rays.gather_rows(o.get(len), wi.get(len), None, &vertices.time, rows);
    }

    /// Resamples M proposals at vertices whose BSDFs can only be evaluated.
    fn resample(&mut self, how: &Continuation<'_>, vertices: &Vertices<'_>) {
        for (i, bsdf) in vertices.bsdfs.iter().enumerate().filter(|(_, bsdf)| bsdf.bsdf.is_only_evaluated()) {
            let stream = vertices.streams.get(i);
            let count = how.settings.bsdf_proposals.max(1);
            let proposal = |k| stream.split(domain::BSDF, count, k).draw::<3>();
            let [u_choice] = stream.domain(domain::RESAMPLE).draw::<1>();
            let BsdfSamples { wi, f_cos, pdf, lobe, eta } = &mut self.samples;

            // The weight of the resampled direction replaces 1/pdf, so the pdf is set to 1
            pdf[i] = 0.0;
            let Some(r) = bsdf.resample(vertices.surface.wo.vec3(i), count, proposal, u_choice) else { continue };
            wi.set(i, r.wi);
            f_cos.set_rgb(i, r.f * (bsdf.cos(r.wi) * r.weight));
            (pdf[i], lobe[i], eta[i]) = (1.0, f32::from(r.lobe.flags()), r.eta);
        }
    }

    /// Draws three random numbers for each vertex.
    fn draw(&mut self, vertices: &Vertices<'_>) {
        let (n, len) = (vertices.len(), padded(vertices.len()));
        reserve(&mut self.u.each_mut(), len);
        let numbers = self.u.each_mut().map(|u| &mut u[..n]);
        sampler::draw(level(), &vertices.streams, 0..n, Below::Domain(domain::BSDF), numbers);
    }
}

impl Continuation<'_> {
    /// The segment in a direction; `None` if its throughput is 0, or if roulette ends the path. Roulette does not end a
    /// segment that is the BSDF sample of direct light; it ends the path beyond the emitter.
    #[inline]
    fn segment(&self, vertices: &Vertices<'_>, row: usize, path: &PathState, to: &Direction) -> Option<PathState> {
        let beta = path.beta * to.weight;
        let eta_scale = path.eta_scale * to.eta * to.eta;
        if beta.is_black() || !beta.is_finite() {
            return None;
        }

        // Roulette
        let survival = survival(beta, eta_scale, || vertices.streams.get(row), self.vertex + 1, self.settings);
        if survival == 0.0 && !to.by_path {
            return None;
        }

        // Density of light paths that could have sampled the same path
        let n = vertices.surface.n.vec3(row);
        let chain = if path.chain.is_caustic() { path.chain } else { path.chain.beyond_first(to.pdf, n.dot(to.wi)) };
        Some(PathState {
            beta: if to.by_path { beta } else { beta / survival },
            eta_scale,
            passed: 0,
            travelled: 0.0,
            technique: to.by_path.then_some(BsdfTechnique { row: row as u32, pdf: to.pdf, survival }),
            medium: vertices.media(row).towards(n.dot(to.wi)),
            chain,
            ..*path
        })
    }
}
