//! Russian roulette and splitting by what lies beyond a vertex.
//!
//! A path that arrives at a vertex with the throughput β goes on as n paths of the throughput β/E(n) or β/n. How many is
//! decided by what pilot paths found there ([`tree`]) and in the path's pixel ([`pixels`]):
//!
//! * `efficiency` [Rath et al. 2022]: maximises 1/(V C), V being the relative variance of a pixel and C its cost, by
//!   s = β/I √(C/V) √(V_r/C_r), where V_r is the variance of ⟨L_r⟩, the estimate of the radiance that is reflected along
//!   the path, and C_r its cost. V/n + C n is least for the n with n(n−1) < s² ≤ n(n+1). Where that is one path, roulette
//!   may end it, and E⟨L_r⟩² takes the place of V_r.
//! * `adjoint` [Vorba and Křivánek 2016]: s = β L_r/I, the expected contribution by the value of the pixel, is kept in a
//!   window around 1.
//!
//! I² is I² + 0.01, as in the error that is relative to the square of a pixel. V, V_r and C are those of paths without
//! roulette, where [Rath et al. 2022] iterate.
//!
//! Estimates are unbiased whatever the pilot found: n does not depend on what the paths then find. What a path finds of
//! emitters on its way to the vertex is added before, with its own weight.

mod pixels;
mod tree;

pub(super) use pixels::PixelMeans;
pub(super) use tree::Tail;

use crate::settings::{IntegratorSettings, RouletteKind};
use lumiris_numbers::math::{Rgb, Vec3};
use tree::Tree;

/// Most paths that one splits into.
pub(super) const MAX_PATHS: u32 = 8;
/// Least probability of survival. Less saves little, and makes much of the rare path that is bright.
const MIN_SURVIVAL: f32 = 0.3;
/// The first vertex where paths end or split, counted from 0.
const FIRST_VERTEX: u32 = 1;
/// δ of the window of `adjoint`: from 2/(1 + δ) to δ times that [Vorba and Křivánek 2016, §5.3].
const WINDOW: f32 = 5.0;

/// Where a path arrives.
#[derive(Clone, Copy, Debug)]
pub(super) struct Arrival {
    pub(super) pixel: [u32; 2],
    /// Index of the vertex along the path.
    pub(super) vertex: u32,
    /// Its throughput, and the squared relative index of refraction along the path.
    pub(super) beta: Rgb,
    pub(super) eta_scale: f32,
    /// Position and unit normal on the side of the path.
    pub(super) p: Vec3,
    pub(super) n: Vec3,
}

/// What becomes of a path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Continuation {
    /// As how many it goes on.
    pub(super) paths: u32,
    /// Factor of their throughput.
    pub(super) factor: f32,
}

impl Continuation {
    /// One path as before.
    const SAME: Continuation = Continuation { paths: 1, factor: 1.0 };

    /// Several paths that share what one carries.
    fn split(paths: u32) -> Self {
        Continuation { paths, factor: 1.0 / paths as f32 }
    }

    /// Roulette by a number in [0, 1).
    fn roulette(survival: f32, u: f32) -> Self {
        Continuation { paths: u32::from(u < survival), factor: 1.0 / survival }
    }
}

/// What the pilot found, as decisions need it.
#[derive(Debug)]
pub(super) struct Roulette {
    kind: RouletteKind,
    /// The bounce from which on throughput decides where the pilot found nothing.
    plain_depth: Option<u32>,
    pixels: PixelMeans,
    /// C/V.
    cost_by_variance: f32,
    /// By vertex, from the first one on; the last one serves all later vertices.
    trees: Vec<Tree>,
}

impl Roulette {
    /// From the tails of each vertex, the means of the image, and the cost of a camera sample by its mean relative
    /// variance.
    pub(super) fn new(
        settings: &IntegratorSettings,
        tails: Vec<Vec<Tail>>,
        scene_radius: f32,
        (pixels, cost_by_variance): (PixelMeans, f32),
    ) -> Self {
        let trees = tails.into_iter().map(|mut tails| Tree::new(&mut tails, scene_radius)).collect();
        let (kind, plain_depth) = (settings.roulette, settings.roulette_depth);
        Roulette { kind, plain_depth, pixels, cost_by_variance, trees }
    }

    /// As how many paths one goes on; `u` gives a number in [0, 1).
    #[inline]
    pub(super) fn continuation(&self, at: &Arrival, u: impl FnOnce() -> f32) -> Continuation {
        if at.vertex < FIRST_VERTEX {
            return Continuation::SAME;
        }
        let tree = (at.vertex as usize).min(self.trees.len().saturating_sub(1));
        let Some(cell) = self.trees.get(tree).and_then(|tree| tree.find(at.p, at.n)) else {
            return self.plain(at, u);
        };
        match self.kind {
            RouletteKind::Throughput => self.plain(at, u),
            RouletteKind::Adjoint => {
                let relative = at.beta * cell.mean * self.pixels.weight(at.pixel).sqrt();
                by_contribution(relative.map(f32::abs).average(), u)
            }
            RouletteKind::Efficiency => {
                let relative = at.beta * at.beta * self.pixels.weight(at.pixel) * self.cost_by_variance;
                let squared = |moment: Rgb| (relative * moment).average();
                by_efficiency(squared(cell.variance_per_cost), squared(cell.second_moment_per_cost), u)
            }
        }
    }

    /// Roulette on throughput.
    fn plain(&self, at: &Arrival, u: impl FnOnce() -> f32) -> Continuation {
        let survival = (at.beta * at.eta_scale).map(f32::abs).max_component();
        let has_roulette = self.plain_depth.is_some_and(|first| at.vertex >= first);
        if has_roulette && survival < 1.0 { Continuation::roulette(survival, u()) } else { Continuation::SAME }
    }
}

/// By s² with the variance, and with the second moment.
fn by_efficiency(by_variance: f32, by_second_moment: f32, u: impl FnOnce() -> f32) -> Continuation {
    if by_variance > 2.0 {
        // The least n with s² ≤ n(n + 1)
        let paths = ((by_variance + 0.25).sqrt() - 0.5).ceil();
        return Continuation::split((paths as u32).clamp(2, MAX_PATHS));
    }
    if by_second_moment < 1.0 {
        return Continuation::roulette(by_second_moment.sqrt().max(MIN_SURVIVAL), u());
    }
    // What is not a number as well
    Continuation::SAME
}

/// By the expected contribution relative to the value of the pixel.
fn by_contribution(relative: f32, u: impl FnOnce() -> f32) -> Continuation {
    let low = 2.0 / (1.0 + WINDOW);
    if relative < low {
        Continuation::roulette((relative / low).max(MIN_SURVIVAL), u())
    } else if relative > low * WINDOW {
        Continuation::split(((relative / (low * WINDOW)).ceil() as u32).clamp(1, MAX_PATHS))
    } else {
        Continuation::SAME
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Mean of paths × factor over u.
    fn expected(decide: impl Fn(f32) -> Continuation) -> f32 {
        let n = 10_000;
        let one = |i: i32| {
            let c = decide((i as f32 + 0.5) / n as f32);
            if c.paths == 0 { 0.0 } else { c.paths as f32 * c.factor }
        };
        (0..n).map(one).sum::<f32>() / n as f32
    }

    #[test]
    fn the_expected_throughput_of_all_paths_is_that_of_one() {
        for s2 in [0.0, 1e-6, 0.3, 0.999, 1.0, 1.9, 2.1, 7.0, 1e9, f32::INFINITY, f32::NAN] {
            for ratio in [0.0, 0.4, 1.0] {
                let mean = expected(|u| by_efficiency(s2 * ratio, s2, || u));
                assert!((mean - 1.0).abs() < 1e-3, "efficiency {s2} {ratio}: {mean}");
            }
            let mean = expected(|u| by_contribution(s2, || u));
            assert!((mean - 1.0).abs() < 1e-3, "adjoint {s2}: {mean}");
        }
    }

    #[test]
    fn as_many_paths_as_cost_and_variance_ask_for() {
        // V/n + C n with V/C = s²
        for s2 in [2.1_f32, 5.9, 6.1, 11.9, 12.1, 50.0] {
            let total = |n: u32| s2 / n as f32 + n as f32;
            let best = (1..=MAX_PATHS).min_by(|&a, &b| total(a).total_cmp(&total(b)));
            assert_eq!(Some(by_efficiency(s2, s2 + 1.0, || 0.5).paths), best, "{s2}");
        }
        assert_eq!(by_efficiency(0.1, 1.5, || 0.99), Continuation::SAME);
        assert_eq!(by_efficiency(0.0, 0.25, || 0.49).paths, 1);
        assert_eq!(by_efficiency(0.0, 0.25, || 0.51).paths, 0);
    }
}
