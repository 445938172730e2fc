//! What the callbacks of a query share: the batch, and the nearest hit of each lane so far.

use super::world::{Reported, World};
use crate::accel::RayBatch;
use embree4_sys as sys;
use lumiris_lanes::hits::BLOCK;
use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// Hits whose parameters differ by less than this fraction are compared exactly: much more than what Embree's
/// parameter is off, but for rays at less than some 0.1° to a triangle.
const TIE: f32 = 1.0 / (1 << 12) as f32;

/// The part of a query that Embree sees.
#[cfg(embree3)]
pub(super) type RtcContext = sys::RTCIntersectContext;
/// The part of a query that Embree sees.
#[cfg(embree4)]
pub(super) type RtcContext = sys::RTCRayQueryContext;

/// The context of a query; Embree passes the address of its first member to the callbacks.
#[repr(C)]
pub(super) struct QueryContext<'a> {
    pub rtc: RtcContext,
    pub world: &'a World,
    /// The batch; a ray's `id` is its index in it.
    pub rays: &'a RayBatch,
    /// Index of the block's first ray.
    pub base: u32,
    /// The smallest parameter reported for each ray of the block.
    pub best_t: [f32; BLOCK],
    /// The hit of each ray of the block.
    pub first: [Reported; BLOCK],
    /// The payload of a panic in a callback, resumed when Embree has returned.
    pub panic: Option<Box<dyn Any + Send>>,
}

impl<'a> QueryContext<'a> {
    pub(super) fn new(rtc: RtcContext, world: &'a World, rays: &'a RayBatch) -> Self {
        let (best_t, first) = ([f32::INFINITY; BLOCK], [Reported::NONE; BLOCK]);
        QueryContext { rtc, world, rays, base: 0, best_t, first, panic: None }
    }

    /// Begins with a block of at most [`BLOCK`] rays.
    #[inline]
    pub(super) fn begin(&mut self, base: usize, count: usize) {
        self.base = base as u32;
        self.best_t[..count].fill(f32::INFINITY);
        for first in &mut self.first[..count] {
            first.geometry = u32::MAX;
        }
    }

    /// Records a hit of the ray `id`; returns the new end of the ray, or `None` if another hit is nearer. The end is
    /// slightly beyond the hit, so that ties are found whichever of the hits comes first.
    #[inline]
    pub(super) fn offer(&mut self, id: u32, hit: Reported) -> Option<f32> {
        let lane = (id - self.base) as usize % BLOCK;
        let best = self.best_t[lane];
        if hit.t < best * (1.0 - TIE) {
            self.best_t[lane] = hit.t;
        } else {
            self.best_t[lane] = best.min(hit.t);
            if !self.wins_tie(id, lane, &hit) {
                return None;
            }
        }
        self.first[lane] = hit;
        Some(self.best_t[lane] * (1.0 + TIE))
    }

    /// Whether the exact hits put `hit` before the lane's first.
    #[cold]
    fn wins_tie(&mut self, id: u32, lane: usize, hit: &Reported) -> bool {
        let mut wins = self.first[lane].geometry == u32::MAX;
        self.guard(|query| {
            if !wins {
                let (ray, first) = (query.rays.get(id as usize), &query.first[lane]);
                wins = query.world.refine(&ray, hit).precedes(&query.world.refine(&ray, first));
            }
        });
        wins
    }

    /// Runs the body of a callback; a panic is stored for later.
    #[inline]
    pub(super) fn guard(&mut self, body: impl FnOnce(&mut Self)) {
        let result = catch_unwind(AssertUnwindSafe(|| body(self)));
        if let Err(panic) = result {
            self.panic = Some(panic);
        }
    }

    /// Resumes the panic of a callback.
    #[inline]
    pub(super) fn finish(self) {
        if let Some(panic) = self.panic {
            std::panic::resume_unwind(panic);
        }
    }
}
