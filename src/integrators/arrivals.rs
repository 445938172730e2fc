//! Paths that arrive at vertices: as a pilot records them, or as what it found ends and splits them.
//!
//! Where a path becomes several, each has points of its own of the sequence of random numbers, so that they are well
//! distributed over these paths and the samples of the pixel. They carry the number of their streams, a *branch*.

use super::roulette::{Arrival, Continuation, MAX_PATHS, Roulette};
use super::segment::{CameraSample, Carried, domain};
use lumiris_numbers::math::{Rgb, Vec3};
use lumiris_numbers::samplers::SampleStream;
use std::sync::Arc;

/// What is done about paths that arrive.
#[derive(Debug, Default)]
pub(super) enum Mode {
    /// Nothing.
    #[default]
    Unchanged,
    /// They are recorded.
    Recorded(Vec<Recorded>),
    /// They end and split.
    Guided(Arc<Roulette>),
}

/// The arrival of a path at a vertex.
#[derive(Clone, Copy, Debug)]
pub(super) struct Recorded {
    /// Index of the camera sample.
    pub(super) sample: u32,
    /// Index of the vertex along the path.
    pub(super) vertex: u32,
    /// Position, and unit normal on the side of the path.
    pub(super) p: Vec3,
    pub(super) n: Vec3,
    pub(super) beta: Rgb,
    /// What the sample had found until then.
    pub(super) before: Rgb,
}

/// The arrivals of a batch of paths.
#[derive(Debug, Default)]
pub(super) struct Arrivals {
    pub(super) mode: Mode,
    /// Streams of branches 1, 2, …: those of vertices and of direct light.
    branches: Vec<[SampleStream; 2]>,
}

impl Arrivals {
    /// Begins a batch.
    pub(super) fn start(&mut self) {
        self.branches.clear();
    }

    /// As how many paths one goes on at most.
    pub(super) fn max_paths(&self) -> u32 {
        if matches!(self.mode, Mode::Guided(_)) { MAX_PATHS } else { 1 }
    }

    /// Random numbers of a branch, and those of its direct light.
    #[inline]
    pub(super) fn streams(&self, sample: &CameraSample, branch: u32) -> [SampleStream; 2] {
        streams(&self.branches, sample, branch)
    }

    /// A path of the camera sample, which has found the radiance `before`, arrives at a vertex, whose `place` is a
    /// position and the normal on the side of the path. It goes on as so many paths, whose throughput `path` then has.
    #[inline]
    pub(super) fn arrive(
        &mut self,
        (sample, before): (&CameraSample, Rgb),
        vertex: u32,
        path: &mut Carried,
        place: impl FnOnce() -> (Vec3, Vec3),
    ) -> u32 {
        match &mut self.mode {
            Mode::Unchanged => 1,
            Mode::Recorded(all) => {
                let (p, n) = place();
                all.push(Recorded { sample: path.sample, vertex, p, n, beta: path.beta, before });
                1
            }
            Mode::Guided(roulette) => {
                let (p, n) = place();
                let Carried { beta, eta_scale, .. } = *path;
                let at = Arrival { pixel: sample.pixel, vertex, beta, eta_scale, p, n };
                let [stream, _] = streams(&self.branches, sample, path.branch);
                // Stratified: survivors are then as many as expected where all samples of a pixel arrive at the like
                let u = || stream.domain(domain::VERTEX + vertex).domain(domain::ROULETTE).draw::<1>()[0];
                let Continuation { paths, factor } = roulette.continuation(&at, u);
                path.beta = beta * factor;
                paths
            }
        }
    }

    /// The branch of path `index` of `count` that `branch` goes on as from a vertex.
    #[inline]
    pub(super) fn branch(
        &mut self,
        sample: &CameraSample,
        branch: u32,
        vertex: u32,
        (count, index): (u32, u32),
    ) -> u32 {
        if count == 1 {
            return branch;
        }
        let key = domain::SPLIT + 16 * vertex + count;
        let streams = self.streams(sample, branch).map(|s| s.split(key, count, index));
        self.branches.push(streams);
        self.branches.len() as u32
    }
}

#[inline]
fn streams(branches: &[[SampleStream; 2]], sample: &CameraSample, branch: u32) -> [SampleStream; 2] {
    if branch == 0 { [sample.stream, sample.direct] } else { branches[branch as usize - 1] }
}
