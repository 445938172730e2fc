//! Direct light sampled separately from the contributing lights 𝓛_con, which the visibility cache finds, and from all
//! others [Keller and Wald 2000, §3].
//!
//! S_con samples are taken on 𝓛_con:
//!
//! * |𝓛_con| ≤ S_con: every light gets one sample, and the remaining ones are allocated by emission area. The estimate
//!   is the sum of the lights' estimates. The area of an infinite light is that of the disk from which its photons
//!   start; point, spot and distant lights have no area and never get a second sample.
//! * |𝓛_con| > S_con: the unshadowed contributions k_l of all these lights are sorted [Ward 1991]. The S_con − 1
//!   largest are traced. Ward estimates the sum of the others from the visibility of those traced; here one of the
//!   others is traced, chosen with probability q_l = Y(k_l)/Σ Y(k) by luminance Y, and counts k_l/q_l. Its expectation
//!   is the sum of their shadowed contributions, so the estimate is unbiased.
//! * |𝓛_con| > [`MAX_ORDERED`]: S_con lights are chosen in proportion to their numbers of photons.
//!
//! S_non samples are taken on the non-contributing lights: a light chosen uniformly among the n that emit counts n
//! times [Eq. 1 of the paper]. Without these samples (S_non = 0) the estimate is biased. Where the cache is empty, all
//! S_con + S_non samples are drawn as by `mc`.

use super::mc;
use crate::direct::candidates::{Candidate, SampleAllocation};
use crate::direct::domain;
use crate::direct::light_samples::{self, unshadowed_candidate};
use crate::direct::point::ShadingPoint;
use crate::direct::t1::T1;
use crate::lights::{Light, LightCtx, LightId, LightSample, LightSampling, LightSet};
use crate::scene::RenderJob;
use lumiris_numbers::math::cumulative;
use std::f32::consts::PI;

/// Maximum number of lights that are sorted at a point.
pub const MAX_ORDERED: usize = 64;

/// Light sampling, separately of contributing and of non-contributing lights.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contributing {
    /// Samples on contributing lights (S_con).
    pub samples: u32,
    /// Samples on non-contributing lights (S_non).
    pub noncontributing_samples: u32,
}

impl Contributing {
    pub(super) fn propose(&self, t1: &mut T1<'_>, buffers: &mut Buffers) {
        t1.propose(mc::allocation, |job, at, allocation, records| {
            if allocation.light_draws == 0 { 0 } else { buffers.draw(job, at, self.noncontributing_samples, records) }
        });
    }
}

/// What is kept from point to point, to save allocations.
#[derive(Debug, Default)]
pub(super) struct Buffers {
    /// 𝓛_con: lights and their photon counts, ids ascending.
    contributing: Vec<(LightId, u32)>,
    /// Samples per light.
    counts: Vec<u32>,
    /// Contributions sorted by luminance.
    ordered: Vec<(f32, Candidate)>,
}

/// A point and the lights that are sampled from it.
struct At<'a> {
    lights: &'a LightSampling,
    index: u32,
    point: &'a ShadingPoint<'a>,
    ctx: LightCtx,
}

impl At<'_> {
    /// A sample of a light chosen with probability `pmf`, one of `n` drawn in this way.
    fn sample(&self, light: LightId, pmf: f32, n: u32, u: [f32; 2]) -> Option<Candidate> {
        let sample = self.lights.lights[light as usize].sample_li(&self.ctx, u)?;
        let drawn = (light, LightSample { pdf: sample.pdf * pmf, ..sample });
        unshadowed_candidate((self.index, self.point), &SampleAllocation::fixed(n, 0), drawn)
    }
}

impl Buffers {
    /// Draws the light samples of a point, `noncontributing` of them on non-contributing lights. Returns their number.
    fn draw(
        &mut self,
        job: &RenderJob,
        (index, point): (u32, &ShadingPoint<'_>),
        noncontributing: u32,
        records: &mut Vec<Candidate>,
    ) -> u32 {
        let lights = &job.lights;
        let ctx = point.light_ctx();
        let at = At { lights, index, point, ctx };
        self.contributing.clear();
        self.contributing.extend_from_slice(lights.contributing_lights(&ctx).lights);

        let n = point.sample_counts.samples;
        if self.contributing.is_empty() {
            return light_samples::draw(job, (index, point), &SampleAllocation::fixed(n + noncontributing, 0), records);
        }
        let drawn = if self.contributing.len() <= n as usize {
            self.draw_each(&at, n, records)
        } else if self.contributing.len() <= MAX_ORDERED {
            self.draw_ordered(&at, n, records)
        } else {
            self.draw_by_photons(&at, n, records)
        };
        drawn + self.draw_noncontributing(&at, noncontributing, records)
    }

    /// At least one sample of every contributing light.
    fn draw_each(&mut self, at: &At<'_>, n: u32, records: &mut Vec<Candidate>) -> u32 {
        let contributing = &self.contributing;
        let areas = contributing.iter().map(|&(light, _)| emission_area(at.lights, light));
        allocate_by_area(n - contributing.len() as u32, areas, &mut self.counts);
        for (k, (&(light, _), &count)) in contributing.iter().zip(&self.counts).enumerate() {
            for i in 0..count {
                let u = at.point.stream.split(domain::CONTRIBUTING + k as u32, count, i).draw::<2>();
                records.extend(at.sample(light, 1.0, count, u));
            }
        }
        self.counts.iter().sum()
    }

    /// The largest contributions, and one of the others.
    fn draw_ordered(&mut self, at: &At<'_>, n: u32, records: &mut Vec<Candidate>) -> u32 {
        self.ordered.clear();
        for (k, &(light, _)) in self.contributing.iter().enumerate() {
            let u = at.point.stream.domain(domain::CONTRIBUTING + k as u32).draw::<2>();
            let candidate = at.sample(light, 1.0, 1, u);
            self.ordered.extend(candidate.map(|c| (c.f.luminance() / c.p_light, c)));
        }
        // The sort is stable: equal contributions stay in the order of their lights
        self.ordered.sort_by(|a, b| b.0.total_cmp(&a.0));
        let sure = self.ordered.len().min(n as usize - 1);
        let (brightest, dim) = self.ordered.split_at(sure);
        records.extend(brightest.iter().map(|(_, c)| *c));

        // One of the others, in proportion to its luminance
        let total: f32 = dim.iter().map(|(brightness, _)| brightness).sum();
        let [u] = at.point.stream.domain(domain::DIM).draw::<1>();
        let mut x = u * total;
        let chosen = dim.iter().enumerate().find(|(i, (brightness, _))| {
            x -= brightness;
            x < 0.0 || i + 1 == dim.len()
        });
        let chosen = chosen.map(|(_, (brightness, c))| Candidate { n_light: brightness / total, ..*c });
        records.extend(chosen.filter(|c| c.n_light > 0.0));
        self.contributing.len() as u32
    }

    /// Lights chosen in proportion to their numbers of photons.
    fn draw_by_photons(&mut self, at: &At<'_>, n: u32, records: &mut Vec<Candidate>) -> u32 {
        // Cumulative photon counts
        let numbers = self.contributing.iter().map(|&(_, count)| count);
        self.counts.clear();
        self.counts.extend(numbers.scan(0_u32, |sum, count| {
            *sum = sum.saturating_add(count);
            Some(*sum)
        }));
        let total = self.counts.last().copied().unwrap_or(0) as f32;
        for i in 0..n {
            let [u_choice, u0, u1] = at.point.stream.split(domain::LIGHT, n, i).draw::<3>();
            let k = cumulative::find(&self.counts, u_choice * total).min(self.contributing.len() - 1);
            let pmf = cumulative::weight(&self.counts, k) / total;
            records.extend(at.sample(self.contributing[k].0, pmf, n, [u0, u1]));
        }
        n
    }

    /// Samples of non-contributing lights, chosen uniformly.
    fn draw_noncontributing(&self, at: &At<'_>, noncontributing: u32, records: &mut Vec<Candidate>) -> u32 {
        let lit = &at.lights.lit;
        let others = lit.len() - self.contributing.len();
        if others == 0 {
            return 0;
        }
        for i in 0..noncontributing {
            let [u_choice, u0, u1] = at.point.stream.split(domain::NONCONTRIBUTING, noncontributing, i).draw::<3>();
            let mut place = ((f64::from(u_choice) * others as f64) as usize).min(others - 1);
            // Skip the contributing lights
            for &(light, _) in &self.contributing {
                if lit[place] < light {
                    break;
                }
                place += 1;
            }
            records.extend(at.sample(lit[place], 1.0 / others as f32, noncontributing, [u0, u1]));
        }
        noncontributing
    }
}

/// Emission area of a light (m²); 0 if a second sample of it would be useless.
fn emission_area(lights: &LightSet, light: LightId) -> f32 {
    match &lights.lights[light as usize] {
        Light::Point { .. } | Light::Spot { .. } | Light::Distant { .. } => 0.0,
        Light::Area(area) => area.area(),
        Light::InfiniteConstant { .. } | Light::InfiniteImage { .. } => PI * lights.scene_radius * lights.scene_radius,
    }
}

/// One sample per light plus `extra` in proportion to the areas, rounded so that cumulative counts are off by less than
/// one.
fn allocate_by_area(extra: u32, areas: impl Iterator<Item = f32> + Clone, counts: &mut Vec<u32>) {
    let total: f64 = areas.clone().map(f64::from).sum();
    let scale = if total > 0.0 && total.is_finite() { f64::from(extra) / total } else { 0.0 };
    let (mut sum, mut given) = (0.0, 0);
    counts.clear();
    counts.extend(areas.map(|area| {
        sum += f64::from(area) * scale;
        let upto = (sum.round() as u32).min(extra);
        let count = 1 + upto - given;
        given = upto;
        count
    }));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_are_allocated_by_area_with_one_for_each() {
        let shared = |extra, areas: &[f32]| {
            let mut counts = vec![7];
            allocate_by_area(extra, areas.iter().copied(), &mut counts);
            counts
        };
        assert_eq!(shared(0, &[1.0, 5.0]), [1, 1]);
        assert_eq!(shared(6, &[1.0, 2.0, 3.0]), [2, 3, 4]);
        assert_eq!(shared(6, &[0.0, 0.0]), [1, 1]);
        assert_eq!(shared(5, &[0.0, 2.0, 0.0]), [1, 6, 1]);
        for extra in 0..40 {
            let counts = shared(extra, &[0.3, 0.0, 2.7, 1.1, 1.1, 0.2]);
            assert_eq!(counts.iter().sum::<u32>(), extra + 6);
            assert!(counts.iter().all(|&c| c > 0) && counts[1] == 1);
        }
    }
}
