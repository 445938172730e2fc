//! The steps of direct light in columns, sample by sample.

use super::batch::{Round, VertexBatch};
use super::control_columns::ControlColumns;
use super::emitters::EmitterRays;
use super::samples::{SampleColumns, TracedSegments};
use super::sinks::{SampleOnLight, Sinks, VisibleSample, WeightAgainstLightPaths};
use super::techniques::Techniques;
use crate::accel::Coherence;
use crate::bsdfs::Lobe;
use crate::direct::candidates::SampleAllocation;
use crate::direct::domain;
use crate::direct::stats::DirectStats;
use crate::direct::transmittance::{Crossing, Departure};
use crate::direct::vertices::{BsdfSamples, Vertices};
use crate::lights::LightId;
use crate::lights::sample_columns::{NO_LIGHT, Scratch};
use crate::media::Sides;
use crate::scene::RenderJob;
use lumiris_lanes::columns::{Columns3, padded};
use lumiris_lanes::level;
use lumiris_lanes::sampler::{self, Below};
use lumiris_lanes::vertex as kernels;
use lumiris_numbers::estimators::heuristics::Technique;
use lumiris_numbers::math::{Rgb, Vec3};
use std::time::Instant;

/// Estimates direct light at vertices in columns; holds the buffers of one worker.
#[derive(Debug, Default)]
pub struct ColumnDirectLighting {
    /// Allocations of the first rows, which may differ from [`VertexBatch::usual`].
    allocations: Vec<SampleAllocation>,
    samples: SampleColumns,
    scratch: Scratch,
    traced: TracedSegments,
    crossing: Crossing,
    emitter_rays: EmitterRays,
    controls: ControlColumns,
    /// Direct light so far.
    radiance: Columns3,
}

impl ColumnDirectLighting {
    /// Direct light of a row after [`Self::estimate`].
    #[inline]
    pub fn radiance(&self, row: usize) -> Rgb {
        self.radiance.rgb(row)
    }

    /// The control variates of a row.
    pub fn controls(&self, job: &RenderJob, row: usize) -> &[f32] {
        &self.controls.of(row)[..job.controls()]
    }

    /// Estimates ∫ f_s L_direct |cos θ| dω for each vertex.
    pub fn estimate(
        &mut self,
        job: &RenderJob,
        techniques: &Techniques,
        vertices: &Vertices<'_>,
        sinks: &mut Sinks<'_>,
        stats: &mut DirectStats,
    ) {
        if vertices.is_empty() {
            return;
        }

        // Allocations
        let start = Instant::now();
        let batch = VertexBatch { job, techniques, vertices, usual: techniques.usual() };
        let [light, bsdf] = self.begin(&batch, stats);
        stats.select += start.elapsed();

        // Light samples
        for index in 0..light {
            let start = Instant::now();
            let round = batch.round(true, index, self.allocations.len());
            self.sample_lights(&batch, round, sinks.against_light_paths);
            let proposed = self.trace(&batch, round, sinks, stats, start);
            stats.t1_light += proposed - start;
            self.add_controls(&batch, round);
        }

        // BSDF samples
        for index in 0..bsdf {
            let start = Instant::now();
            let round = batch.round(false, index, self.allocations.len());
            stats.emitter_rays += self.sample_bsdfs(&batch, round);
            self.trace(&batch, round, sinks, stats, start);
            self.add_controls(&batch, round);
        }
    }

    /// Begins a batch with black radiance. Returns the maximum number of samples of each technique.
    fn begin(&mut self, batch: &VertexBatch<'_, '_>, stats: &mut DirectStats) -> [u32; 2] {
        let VertexBatch { job, techniques, vertices, usual } = *batch;
        let (n, len) = (vertices.len(), padded(vertices.len()));
        self.samples.reserve(len);
        self.radiance.reserve(len);
        self.radiance.get_mut(len).into_iter().for_each(|c| c.fill(0.0));

        // Allocations
        let unusual = if techniques.are_drawn() { n } else { vertices.bsdfs.len() };
        self.allocations.clear();
        self.allocations
            .extend((0..unusual).map(|i| techniques.allocation(&vertices.bsdf(i).bsdf, &vertices.direct.get(i))));
        let rest = if unusual < n { Some(&usual) } else { None };
        let most = |of: fn(&SampleAllocation) -> u32| self.allocations.iter().chain(rest).map(of).max().unwrap_or(0);
        let sum = |of: fn(&SampleAllocation) -> u32| {
            let all = self.allocations.iter().map(|a| u64::from(of(a))).sum::<u64>();
            all + (n - unusual) as u64 * u64::from(of(&usual))
        };
        let (light, bsdf) = (|a: &SampleAllocation| a.light_draws, |a: &SampleAllocation| a.bsdf_draws);
        stats.light_proposals += sum(light);
        stats.proposals += sum(light) + sum(bsdf);

        // Choice of lights
        self.scratch.begin(&job.lights, vertices.surface.lit_points());
        if techniques.has_controls {
            self.controls.begin(job, vertices);
            let is_unusual = |(i, a): (usize, &SampleAllocation)| (*a != usual).then_some(i);
            self.controls.leave_out(self.allocations.iter().enumerate().filter_map(is_unusual));
        }
        [most(light), most(bsdf)]
    }

    /// Adds the last sample of each vertex to its control variates, if they are enabled. Rows with a different
    /// allocation have no control variates.
    fn add_controls(&mut self, batch: &VertexBatch<'_, '_>, round: Round) {
        if !batch.techniques.has_controls || !round.is_usual {
            return;
        }
        let n = [batch.usual.n_light, batch.usual.n_bsdf];
        let ColumnDirectLighting { controls, samples, traced, scratch, emitter_rays, .. } = self;
        if round.by_light {
            controls.add_light_samples(batch.job, n, samples, traced, scratch, batch.vertices);
        } else {
            controls.add_bsdf_samples(batch.job, n, samples, emitter_rays, batch.vertices);
        }
    }

    /// Draws the random numbers of a sample of each vertex.
    fn draw(&mut self, batch: &VertexBatch<'_, '_>, round: Round) {
        let of = |a: &SampleAllocation| if round.by_light { a.light_draws } else { a.bsdf_draws };
        let key = if round.by_light { domain::LIGHT } else { domain::BSDF };
        let count = |row: usize| of(self.allocations.get(row).unwrap_or(&batch.usual)).max(1);

        // Rows with the same number of samples together
        let mut first = 0;
        while first < round.rows {
            let end = (first + 1..round.rows).find(|&row| count(row) != count(first)).unwrap_or(round.rows);
            let below = Below::Split { key, count: count(first), index: round.index };
            let numbers = self.samples.u.each_mut().map(|u| &mut u[first..end]);
            sampler::draw(level(), &batch.vertices.direct, first..end, below, numbers);
            first = end;
        }
    }

    /// Removes the sample at rows with fewer samples.
    fn leave_out(&mut self, round: Round) {
        for (i, allocation) in self.allocations.iter().enumerate() {
            let draws = if round.by_light { allocation.light_draws } else { allocation.bsdf_draws };
            if draws <= round.index {
                self.samples.leave_out(i, round.by_light);
            }
        }
    }

    /// The light of the light sample of a row.
    fn light_of(&self, job: &RenderJob, row: usize) -> LightId {
        job.lights.sampler.only_light().unwrap_or_else(|| self.scratch.chosen(row))
    }

    /// Draws a light sample of each vertex, with its contribution.
    fn sample_lights(
        &mut self,
        batch: &VertexBatch<'_, '_>,
        round: Round,
        against_light_paths: Option<&WeightAgainstLightPaths<'_>>,
    ) {
        let VertexBatch { job, techniques, vertices, .. } = *batch;
        let n = round.rows;
        self.draw(batch, round);
        let at = vertices.surface.lit_points();
        job.lights.sample_many(n, at, &self.samples.u, &mut self.scratch, &mut self.samples.incident);
        self.leave_out(round);
        self.leave_out_volume_lights(batch, round);

        // BSDF values and densities of BSDF sampling
        let SampleColumns { incident, bsdf: BsdfSamples { f_cos, pdf, .. }, .. } = &mut self.samples;
        vertices.evaluate(n, &incident.wi, f_cos, pdf);
        if let Some(weight) = against_light_paths {
            for row in (0..vertices.bsdfs.len()).filter(|&row| self.samples.incident.is_far[row] == 0.0) {
                let (n, wi) = (self.samples.incident.n.vec3(row), self.samples.incident.wi.vec3(row));
                let end = || SampleOnLight { row, light: self.light_of(job, row), n, wi };
                let weight = if self.samples.incident.pdf[row] > 0.0 { weight(&end()) } else { 1.0 };
                self.samples.bsdf.f_cos.set_rgb(row, self.samples.bsdf.f_cos.rgb(row) * weight);
            }
        }
        if techniques.is_light_alone() {
            self.samples.bsdf.pdf[..n].fill(0.0);
        }
        for (p, is_delta) in self.samples.bsdf.pdf[..n].iter_mut().zip(&self.samples.incident.is_delta) {
            *p = if *is_delta { 0.0 } else { *p };
        }
        self.weigh(batch, round);
    }

    /// Removes light samples of emitting media if the BSDF sample is not the next path segment. Nearby, no other
    /// technique would sample the emission of media, and the next segment receives it.
    fn leave_out_volume_lights(&mut self, batch: &VertexBatch<'_, '_>, round: Round) {
        let VertexBatch { job, techniques, vertices, .. } = *batch;
        if !job.world.scene.media.is_emissive() {
            return;
        }
        for i in 0..round.rows {
            let is_volume_light = job.lights.medium_of(self.light_of(job, i)).is_some();
            let is_by_path = techniques.are_by_path() && !vertices.bsdf(i).bsdf.is_only_evaluated();
            if is_volume_light && !is_by_path {
                self.samples.leave_out(i, true);
            }
        }
    }

    /// Draws a BSDF sample of each vertex with its emitter and contribution. Returns the number of emitter rays.
    fn sample_bsdfs(&mut self, batch: &VertexBatch<'_, '_>, round: Round) -> u64 {
        let VertexBatch { job, techniques, vertices, .. } = *batch;
        let n = round.rows;
        self.draw(batch, round);

        // Directions
        let SampleColumns { u, incident, bsdf, .. } = &mut self.samples;
        vertices.sample(n, u, bsdf);
        std::mem::swap(&mut incident.wi, &mut bsdf.wi);
        let is_alone = techniques.is_light_alone();
        for i in 0..n {
            incident.is_delta[i] = Lobe::of_flags(bsdf.lobe[i] as u8).is_specular();
            let is_drawn = (incident.is_delta[i] || !is_alone) && !bsdf.f_cos.rgb(i).is_black();
            bsdf.pdf[i] = if is_drawn { bsdf.pdf[i] } else { 0.0 };
        }
        self.leave_out(round);

        // Emitters
        self.samples.make_origins(&vertices.surface, padded(n));
        let count = self.emitter_rays.find(job, vertices, n, &mut self.samples);
        self.weigh(batch, round);
        count
    }

    /// Computes the contributions of the samples of one technique.
    fn weigh(&mut self, batch: &VertexBatch<'_, '_>, Round { by_light, rows, .. }: Round) {
        let (len, VertexBatch { techniques, usual, .. }) = (padded(rows), *batch);
        let SampleColumns { incident, bsdf: BsdfSamples { f_cos, pdf: p_bsdf, .. }, c, .. } = &mut self.samples;
        let by = |a: &SampleAllocation| if by_light { [a.n_light, a.n_bsdf] } else { [a.n_bsdf, a.n_light] };
        let [p, p_other] =
            if by_light { [&incident.pdf[..len], &p_bsdf[..len]] } else { [&p_bsdf[..len], &incident.pdf[..len]] };
        let [n, n_other] = by(&usual);
        let (values, li, heuristic) = (f_cos.get(len), incident.li.get(len), techniques.heuristic);
        let samples = kernels::Samples { f_cos: values, li, p, p_other, n, n_other, heuristic };
        kernels::weigh(level(), &samples, &mut c.get_mut(len));
        for (i, allocation) in self.allocations.iter().enumerate().filter(|(_, a)| **a != usual) {
            let [n, n_other] = by(allocation);
            let factor = heuristic.factor(Technique { n, p: p[i] }, Technique { n: n_other, p: p_other[i] });
            let value = f_cos.rgb(i) * incident.li.rgb(i) * factor;
            c.set_rgb(i, if p[i] > 0.0 && value.is_finite() { value } else { Rgb::BLACK });
        }
    }

    /// Traces the segments of contributing samples, and adds the visible contributions. `start` is the start time of
    /// sampling. Returns the start time of tracing.
    fn trace(
        &mut self,
        batch: &VertexBatch<'_, '_>,
        round: Round,
        sinks: &mut Sinks<'_>,
        stats: &mut DirectStats,
        start: Instant,
    ) -> Instant {
        let VertexBatch { job, techniques, vertices, .. } = *batch;
        // Control variates of a light sample need its occlusion by emitters, even if its weight is 0
        let hides = round.by_light && techniques.has_controls && job.world.emitters_hide();
        let (n, len) = (round.rows, padded(round.rows));
        self.samples.make_segments(&vertices.surface, len);
        let ColumnDirectLighting { samples, traced, .. } = &mut *self;
        let [r, g, b] = samples.c.get(n);
        let contributes = |i: usize| (r[i] != 0.0) | (g[i] != 0.0) | (b[i] != 0.0);
        if hides {
            let is_hidden = |i: usize| samples.bsdf.pdf[i] > 0.0 && samples.has_integrand(i, true);
            traced.gather(n, |i| contributes(i) || is_hidden(i), samples, &vertices.time);
        } else {
            traced.gather(n, contributes, samples, &vertices.time);
        }
        let proposed = Instant::now();
        self.occlude(batch, round, stats);
        let traced_at = Instant::now();

        self.radiance.add_masked(&self.samples.c, self.traced.mask(n));
        if let Some(visible) = &mut sinks.visible {
            for row in self.traced.visible() {
                let light = if round.by_light { Some(self.light_of(job, row)) } else { self.emitter_rays.lights[row] };
                let (wi, contribution) = (self.samples.incident.wi.vec3(row), self.samples.c.rgb(row));
                visible(&VisibleSample { row, light, wi, contribution });
            }
        }
        if let Some(segments) = &mut sinks.segments {
            segments.push(self.traced.rays.clone());
        }
        stats.t1 += proposed - start;
        stats.t2 += traced_at - proposed;
        stats.select += traced_at.elapsed();
        proposed
    }

    /// Determines the occlusion of the segments. Contributions of segments that may pass surfaces or media are
    /// multiplied by an estimate of the transmittance. Without passable surfaces, segments that begin in empty space
    /// stay there.
    fn occlude(&mut self, batch: &VertexBatch<'_, '_>, round: Round, stats: &mut DirectStats) {
        let VertexBatch { job, vertices, .. } = *batch;
        let TracedSegments { rows, rays, occluded, crossing, some_rays, some_occluded, .. } = &mut self.traced;

        // Segments that may pass surfaces or media
        let crosses = |row: u32| job.shadows_pass() || vertices.media(row as usize) != Sides::default();
        crossing.clear();
        crossing.extend((0..rows.len() as u32).filter(|&k| crosses(rows[k as usize])));
        stats.segments += (rays.len() - crossing.len()) as u64;
        if crossing.is_empty() {
            return job.world.accel.occluded(rays, Coherence::Packets, occluded);
        }

        // Occlusion of the others
        occluded.clear();
        occluded.resize(rays.len(), false);
        if crossing.len() < rows.len() {
            let others = || (0..rows.len()).filter(|&k| !crosses(rows[k]));
            some_rays.clear();
            others().for_each(|k| some_rays.push(&rays.get(k)));
            job.world.accel.occluded(some_rays, Coherence::Packets, some_occluded);
            others().zip(some_occluded).for_each(|(k, is_occluded)| occluded[k] = *is_occluded);
        }

        // Transmittance
        some_rays.clear();
        crossing.iter().for_each(|&k| some_rays.push(&rays.get(k as usize)));
        self.cross(batch, round, stats);
    }

    /// Estimates the transmittance of segments that may pass surfaces or media.
    fn cross(&mut self, batch: &VertexBatch<'_, '_>, round: Round, stats: &mut DirectStats) {
        let VertexBatch { job, vertices, .. } = *batch;
        let mut crossing = std::mem::take(&mut self.crossing);

        // Light, medium and random numbers of each segment
        let row = |traced: &TracedSegments, k: usize| traced.rows[traced.crossing[k] as usize] as usize;
        let departure = |k: usize, d: Vec3| {
            let i = row(&self.traced, k);
            let lights_before = self.allocations.get(i).unwrap_or(&batch.usual).light_draws;
            let (light, index) = if round.by_light {
                (self.light_of(job, i), round.index)
            } else {
                (self.emitter_rays.lights[i].unwrap_or(NO_LIGHT), lights_before + round.index)
            };
            let medium = vertices.media(i).towards(vertices.surface.n.vec3(i).dot(d));
            Departure { light, medium, stream: vertices.direct.get(i).domain(domain::TRANSMITTANCE + index) }
        };

        // Trace, and multiply the contributions
        crossing.start(job, &self.traced.some_rays, departure);
        stats.segments += crossing.trace(job);
        stats.collisions += crossing.collisions();
        for (k, transmittance) in crossing.transmittance().enumerate() {
            let (i, place) = (row(&self.traced, k), self.traced.crossing[k] as usize);
            self.traced.occluded[place] = transmittance.is_black();
            self.samples.c.set_rgb(i, self.samples.c.rgb(i) * transmittance);
        }
        self.crossing = crossing;
    }
}
