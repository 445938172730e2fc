//! Direct light at path vertices: in columns for `mc`, `mis` and `ocv --ocv pixels`, in stages for all other
//! estimators.

use super::path::{Outcome, PathTracer, ShadeStep};
use super::vertex_search::VertexSearch;
use crate::direct::columns::{SampleOnLight, Sinks, VisibleSample, WeightAgainstLightPaths};
use crate::direct::shadow_segments::SegmentOutcome;
use crate::direct::{Fits, ShadingPoint, Techniques, Vertices};
use crate::film::PixelSample;
use lumiris_numbers::math::Rgb;
use std::time::Instant;

impl PathTracer {
    /// Adds the direct light at vertices.
    pub(super) fn add_direct_light(
        &mut self,
        step: &ShadeStep<'_>,
        vertices: &Vertices<'_>,
        fits: &mut Fits,
        out: &mut [PixelSample],
    ) {
        match &step.techniques {
            Some(techniques) => self.add_in_columns(step, techniques, vertices, fits, out),
            None => self.add_at_points(step, vertices, fits, out),
        }
    }

    /// Adds the direct light by estimators that trace all their samples.
    fn add_in_columns(
        &mut self,
        step: &ShadeStep<'_>,
        techniques: &Techniques,
        vertices: &Vertices<'_>,
        fits: &mut Fits,
        out: &mut [PixelSample],
    ) {
        let job = step.job;

        // Callbacks: the weight that light paths leave to a light sample, and the sums of light groups
        let VertexSearch { active, layers, guide, recording, .. } = &mut self.search;
        let path = |row: usize| &active.states[vertices.path[row] as usize];
        let against_light_paths = guide.as_ref().map(|guide| {
            move |&SampleOnLight { row, light, n, wi }: &SampleOnLight| {
                let chain = path(row).chain;
                if chain.is_caustic() { chain.camera_weight(guide.density(light, n, -wi)) } else { 1.0 }
            }
        });
        let are_kept = layers.are_kept();
        let mut visible = |&VisibleSample { row, light, wi, contribution }: &VisibleSample| {
            let (path, p) = (path(row), vertices.surface.p.vec3(row));
            match light {
                Some(light) => layers.add(&job.lights, path.sample, light, p, wi, path.beta * contribution),
                None => layers.add_infinite(&job.lights, path.sample, p, wi, path.beta * contribution),
            }
        };

        // Add β·L_d, and the control variates
        let mut sinks = Sinks {
            against_light_paths: against_light_paths.as_ref().map(|weight| weight as &WeightAgainstLightPaths<'_>),
            visible: if are_kept { Some(&mut visible) } else { None },
            segments: recording.as_mut().map(|r| r.segments_at(step.vertex)),
        };
        self.columns.estimate(job, techniques, vertices, &mut sinks, &mut self.direct.stats);

        let start = Instant::now();
        for row in 0..vertices.len() {
            let (path, radiance) = (path(row), self.columns.radiance(row));
            out[path.sample as usize].radiance += path.beta * radiance;
            if techniques.has_controls {
                let value = job.world.scene.film.balanced(radiance).to_array();
                fits.set_controls(path.sample, value, self.columns.controls(job, row));
            }
        }
        self.direct.stats.select += start.elapsed();
    }

    /// Adds the direct light by estimators that select among their samples.
    fn add_at_points(
        &mut self,
        step: &ShadeStep<'_>,
        vertices: &Vertices<'_>,
        fits: &mut Fits,
        out: &mut [PixelSample],
    ) {
        let (job, active) = (step.job, &self.search.active.states);
        // Points in the order of the paths, since fits are sums over the points of a pixel
        let mut rows = vec![u32::MAX; active.len()];
        vertices.path.iter().zip(0..).for_each(|(&path, row)| rows[path as usize] = row);
        rows.retain(|&row| row != u32::MAX);
        let path = |point: usize| &active[vertices.path[rows[point] as usize] as usize];
        let counts = step.estimator.sample_counts();
        let point = |(point, &row): (usize, &u32)| {
            let sample = path(point).sample;
            let counts = if step.vertex == 0 { step.samples.sample_counts[sample as usize] } else { counts };
            vertices.point(row as usize, counts, [sample, step.samples.fit[sample as usize]])
        };
        let points: Vec<ShadingPoint<'_>> = rows.iter().enumerate().map(point).collect();
        self.direct.estimate(job, &step.estimator, &points, fits, &mut self.radiance);

        // Record segments and outcomes, if requested
        if let Some(r) = &mut self.search.recording {
            r.segments_at(step.vertex).push(self.direct.segments().clone());
        }
        if let Some(outcomes) = self.outcomes.as_mut().filter(|_| step.vertex == 0) {
            outcomes.extend(self.direct.outcomes().map(|SegmentOutcome { point, unshadowed, is_free, .. }| {
                let contribution = if is_free { unshadowed } else { Rgb::BLACK };
                Outcome { sample: path(point as usize).sample, unshadowed, contribution }
            }));
        }

        // Add β·L_d, and the sums of light groups
        for (point, &radiance) in self.radiance.iter().enumerate() {
            out[path(point).sample as usize].radiance += path(point).beta * radiance;
        }
        if self.search.layers.are_kept() {
            let segments = self.direct.segments();
            for (i, s) in self.direct.outcomes().enumerate().filter(|(_, s)| s.is_free) {
                let path = path(s.point as usize);
                let p = points[s.point as usize].light_ctx().p;
                let wi = segments.get(i).d.normalize_or_zero();
                self.search.layers.add(&job.lights, path.sample, s.light, p, wi, path.beta * s.unshadowed);
            }
        }
    }
}
