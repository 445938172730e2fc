//! State shared by the callbacks of a query: the batch, and the nearest hit of each lane so far. Ties are detected
//! here; [`Hit::precedes`](crate::accel::Hit::precedes) decides them. `query` traces rays with a noted tie again.

use super::scene_ids::{Reported, SceneIds};
use crate::accel::RayBatch;
use embree4_sys as sys;
use lumiris_lanes::hits::BLOCK;
use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// Hits whose parameters differ by less than this fraction are compared exactly. It is much larger than the error of
/// Embree's parameters, except for rays at less than about 0.1° to a triangle.
const TIE: f32 = 1.0 / (1 << 12) as f32;

/// Treatment of hits with nearly equal parameters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Ties {
    /// Embree stores the hits. Rays with a tie are noted and traced again.
    Noted,
    /// The callbacks compare exact hits and store the first.
    Settled,
}

/// The kind of query.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum QueryKind {
    /// Nearest hits. The filter function of the query notes or settles ties.
    First(Ties),
    /// Nearest hits as determined by Embree.
    Nearest,
    /// Occlusion.
    Any,
}

/// Query mode.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Mode {
    /// The kind of query.
    pub query: QueryKind,
    /// True to traverse packets by their common frustum.
    pub coherent: bool,
}

/// The part of a query context that Embree accesses.
#[cfg(embree3)]
pub(super) type RtcContext = sys::RTCIntersectContext;
/// The part of a query context that Embree accesses.
#[cfg(embree4)]
pub(super) type RtcContext = sys::RTCRayQueryContext;

/// Hits reported by Embree for a block of rays.
pub(super) struct ReportedBlock {
    pub geometry: [u32; BLOCK],
    pub primitive: [u32; BLOCK],
    pub instance: [u32; BLOCK],
    pub t: [f32; BLOCK],
    pub uv: [[f32; BLOCK]; 2],
}

impl ReportedBlock {
    const NONE: ReportedBlock = ReportedBlock {
        geometry: [u32::MAX; BLOCK],
        primitive: [u32::MAX; BLOCK],
        instance: [u32::MAX; BLOCK],
        t: [f32::INFINITY; BLOCK],
        uv: [[0.0; BLOCK]; 2],
    };

    /// The hit of a ray; its geometry is `u32::MAX` if there is none.
    #[inline]
    pub(super) fn get(&self, lane: usize) -> Reported {
        let [u, v] = &self.uv;
        Reported {
            geometry: self.geometry[lane],
            primitive: self.primitive[lane],
            instance: self.instance[lane],
            t: self.t[lane],
            uv: [u[lane], v[lane]],
        }
    }

    #[inline]
    pub(super) fn set(&mut self, lane: usize, hit: &Reported) {
        self.geometry[lane] = hit.geometry;
        self.primitive[lane] = hit.primitive;
        self.instance[lane] = hit.instance;
        self.t[lane] = hit.t;
        (self.uv[0][lane], self.uv[1][lane]) = (hit.uv[0], hit.uv[1]);
    }
}

/// The context of a query. Embree passes the address of its first member to the callbacks.
#[repr(C)]
pub(super) struct QueryContext<'a> {
    pub rtc: RtcContext,
    pub world: &'a SceneIds,
    /// The batch. The `id` of a ray is its index in the batch.
    pub rays: &'a RayBatch,
    /// Index of the first ray of the block.
    pub base: u32,
    /// Treatment of ties.
    pub ties: Ties,
    /// Kind of the query.
    pub mode: Mode,
    /// Added to the `instID` of hits in the place of a cluster.
    pub first_instance: u32,
    /// The smallest parameter reported for each ray of the block.
    pub best_t: [f32; BLOCK],
    /// Not 0 for rays of the block with a noted tie.
    pub tied: [u32; BLOCK],
    /// The hit of each ray of the block.
    pub first: ReportedBlock,
    /// The payload of a panic in a callback, resumed after Embree has returned.
    pub panic: Option<Box<dyn Any + Send>>,
}

impl<'a> QueryContext<'a> {
    pub(super) fn new(rtc: RtcContext, world: &'a SceneIds, rays: &'a RayBatch, mode: Mode) -> Self {
        let ties = if let QueryKind::First(ties) = mode.query { ties } else { Ties::Noted };
        QueryContext {
            rtc,
            world,
            rays,
            base: 0,
            ties,
            mode,
            first_instance: 0,
            best_t: [f32::INFINITY; BLOCK],
            tied: [0; BLOCK],
            first: ReportedBlock::NONE,
            panic: None,
        }
    }

    /// Starts the block of rays from `base` on.
    #[inline]
    pub(super) fn begin(&mut self, base: usize) {
        self.base = base as u32;
        self.best_t = [f32::INFINITY; BLOCK];
        self.tied = [0; BLOCK];
        self.first.geometry = [u32::MAX; BLOCK];
    }

    /// Index of the ray `id` in the block.
    #[inline]
    fn lane(&self, id: u32) -> usize {
        id.wrapping_sub(self.base) as usize % BLOCK
    }

    /// Offers a hit of the ray `id`. Returns the new end of the ray, or `None` if another hit is nearer. The end is
    /// slightly beyond the hit, so that ties are detected in any order of the hits.
    #[inline]
    pub(super) fn offer(&mut self, id: u32, hit: &Reported) -> Option<f32> {
        match self.ties {
            Ties::Noted => Some(self.note(id, hit.t)),
            Ties::Settled => self.settle(id, hit),
        }
    }

    /// Notes a tie of a hit of the ray `id` with an earlier one. Returns the new end of the ray.
    #[inline]
    pub(super) fn note(&mut self, id: u32, t: f32) -> f32 {
        let lane = self.lane(id);
        let (best, is_first) = (self.best_t[lane], t < self.best_t[lane] * (1.0 - TIE));
        self.tied[lane] |= u32::from(!is_first);
        self.best_t[lane] = best.min(t);
        self.best_t[lane] * (1.0 + TIE)
    }

    /// Stores a hit of the ray `id` if it is the first one so far. Returns the new end of the ray in that case.
    #[inline]
    pub(super) fn settle(&mut self, id: u32, hit: &Reported) -> Option<f32> {
        let lane = self.lane(id);
        let best = self.best_t[lane];
        if hit.t < best * (1.0 - TIE) {
            self.best_t[lane] = hit.t;
        } else {
            self.best_t[lane] = best.min(hit.t);
            if !self.wins_tie(id, lane, hit) {
                return None;
            }
        }
        self.first.set(lane, hit);
        Some(self.best_t[lane] * (1.0 + TIE))
    }

    /// True if the exact hit of `hit` precedes the lane's first hit.
    #[cold]
    fn wins_tie(&mut self, id: u32, lane: usize, hit: &Reported) -> bool {
        let first = self.first.get(lane);
        let mut wins = first.geometry == u32::MAX;
        self.guard(|query| {
            if !wins {
                let ray = query.rays.get(id as usize);
                wins = query.world.refine(&ray, hit).precedes(&query.world.refine(&ray, &first));
            }
        });
        wins
    }

    /// Runs the body of a callback. A panic is stored for later.
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
