//! Conversion of ray batches to Embree's single rays and packets, and of the results.
#![allow(unsafe_code)]

use super::calls::{self, RayHitPacket, RayPacket, Valid, can_trace};
use super::context::{Mode, QueryContext, QueryKind, Ties};
use super::embree_accel::EmbreeAccel;
use super::exact_hits::ExactHits;
use super::scene_ids::{Refined, Reported};
use crate::accel::{Coherence, Hit, RayBatch};
use crate::geometry::Visibility;
use embree4_sys as sys;
use lumiris_lanes::hits::BLOCK;
use std::ops::Range;

/// Maximum number of retries to leave the surface on which a ray starts.
const MAX_RETRIES: u32 = 64;

const FIRST_SINGLE: Mode = Mode { query: QueryKind::First(Ties::Settled), coherent: false };
pub(super) const ANY_SINGLE: Mode = Mode { query: QueryKind::Any, coherent: false };

impl EmbreeAccel {
    pub(super) fn intersect_batch(&self, rays: &RayBatch, coherence: Coherence, hits: &mut Vec<Option<Hit>>) {
        hits.clear();
        hits.reserve(rays.len());
        let mode = Mode { query: QueryKind::First(Ties::Noted), coherent: self.is_coherent(coherence) };
        match self.packet_width(coherence) {
            4 => self.intersect_packets::<4>(rays, mode, hits),
            8 => self.intersect_packets::<8>(rays, mode, hits),
            16 => self.intersect_packets::<16>(rays, mode, hits),
            _ => self.intersect_singly(rays, hits),
        }
    }

    pub(super) fn occluded_batch(&self, rays: &RayBatch, coherence: Coherence, occluded: &mut Vec<bool>) {
        occluded.clear();
        occluded.reserve(rays.len());
        let width = if coherence == Coherence::Incoherent { 1 } else { self.packet_width(coherence) };
        let mode = Mode { query: QueryKind::Any, coherent: self.is_coherent(coherence) && width < 16 };
        match width {
            4 => self.occluded_packets::<4>(rays, mode, occluded),
            8 => self.occluded_packets::<8>(rays, mode, occluded),
            16 => self.occluded_packets::<16>(rays, mode, occluded),
            _ => self.occluded_singly(rays, occluded),
        }
    }

    /// True if packets may be traversed by their common frustum.
    fn is_coherent(&self, coherence: Coherence) -> bool {
        coherence == Coherence::Coherent && (self.packet_width(coherence) < 16 || self.has_only_triangles)
    }

    fn intersect_singly(&self, rays: &RayBatch, hits: &mut Vec<Option<Hit>>) {
        self.intersect_blocks(rays, FIRST_SINGLE, hits, |context, block| {
            block.for_each(|i| self.trace_one(context, i, calls::T_NEAR));
        });
    }

    fn intersect_packets<const N: usize>(&self, rays: &RayBatch, mode: Mode, hits: &mut Vec<Option<Hit>>) {
        let mut packet = RayHitPacket::<N>::new(Visibility::PATH.0);
        self.intersect_blocks(rays, mode, hits, |context, block| {
            for base in block.clone().step_by(N) {
                let valid = load(&mut packet.rays, rays, base);
                packet.geometry = [sys::RTC_INVALID_GEOMETRY_ID; N];
                packet.instance = [sys::RTC_INVALID_GEOMETRY_ID; N];
                // SAFETY: the scene is committed, the lanes in `valid` are finite, ids are indices of the batch.
                unsafe { calls::intersect_packet(self.root.raw(), context, mode, &valid, &mut packet) };
                packet.store(context, base - block.start);
            }
            if context.tied != [0; BLOCK] {
                self.settle_ties(context, block);
            }
        });
    }

    /// Traces the rays of a block with ties again.
    #[cold]
    fn settle_ties(&self, context: &mut QueryContext<'_>, block: Range<usize>) {
        let mut single = calls::query_context(&self.world, context.rays, FIRST_SINGLE);
        single.begin(block.start);
        for (lane, i) in block.enumerate().filter(|&(lane, _)| context.tied[lane] != 0) {
            self.trace_one(&mut single, i, calls::T_NEAR);
            context.first.set(lane, &single.first.get(lane));
        }
        single.finish();
    }

    /// Traces rays block by block. `trace` stores the hits reported by Embree for a block in the context.
    fn intersect_blocks(
        &self,
        rays: &RayBatch,
        mode: Mode,
        hits: &mut Vec<Option<Hit>>,
        mut trace: impl FnMut(&mut QueryContext<'_>, Range<usize>),
    ) {
        let mut context = calls::query_context(&self.world, rays, mode);
        let mut exact = ExactHits::default();
        for base in (0..rays.len()).step_by(BLOCK) {
            let count = BLOCK.min(rays.len() - base);
            // Trace a block
            context.begin(base);
            trace(&mut context, base..base + count);

            // Compute exact hits; refine single rays where necessary
            let first = &context.first;
            exact.find(&self.world, rays, base..base + count, first);
            hits.extend((0..count).map(|lane| {
                let is_hit = first.geometry[lane] != u32::MAX;
                let found = exact.hit(lane, first.primitive[lane]);
                if is_hit & found.is_none() { self.refine_one(rays, base + lane, first.get(lane)) } else { found }
            }));
        }
        context.finish();
    }

    /// Traces ray `i` from `tnear` on. Stores the hit in its lane of the context.
    #[inline]
    fn trace_one(&self, context: &mut QueryContext<'_>, i: usize, tnear: f32) {
        let rays = context.rays;
        let o = [rays.ox[i], rays.oy[i], rays.oz[i]];
        let d = [rays.dx[i], rays.dy[i], rays.dz[i]];
        if !can_trace(o, d, rays.t_max[i]) {
            return;
        }
        let mut query = sys::RTCRayHit { ray: single_ray(rays, i, Visibility::PATH), ..Default::default() };
        query.ray.tnear = tnear;
        query.hit.geomID = sys::RTC_INVALID_GEOMETRY_ID;
        query.hit.instID = [sys::RTC_INVALID_GEOMETRY_ID];
        // SAFETY: the scene is committed, the ray is finite and its id is `i`.
        unsafe { calls::intersect1(self.root.raw(), context, FIRST_SINGLE, &mut query) };
    }

    /// The exact hit of ray `i`, for which Embree reported `first`. If this is the surface that the ray left, the ray
    /// is continued behind it.
    #[cold]
    fn refine_one(&self, rays: &RayBatch, i: usize, mut first: Reported) -> Option<Hit> {
        // Continue behind the surface until there is another hit
        let ray = rays.get(i);
        let mut context = calls::query_context(&self.world, rays, FIRST_SINGLE);
        let mut exact = self.world.refine(&ray, &first);
        for _ in 0..MAX_RETRIES {
            if exact != Refined::Behind {
                break;
            }
            context.begin(i);
            self.trace_one(&mut context, i, first.t.next_up().max(calls::T_NEAR));
            first = context.first.get(0);
            if first.geometry == u32::MAX {
                break;
            }
            exact = self.world.refine(&ray, &first);
        }

        // Return the hit
        context.finish();
        match exact {
            Refined::Hit(hit) => Some(hit),
            Refined::Behind | Refined::Beyond => None,
        }
    }

    fn occluded_singly(&self, rays: &RayBatch, occluded: &mut Vec<bool>) {
        let mut context = calls::query_context(&self.world, rays, ANY_SINGLE);
        occluded.extend((0..rays.len()).map(|i| {
            let o = [rays.ox[i], rays.oy[i], rays.oz[i]];
            if !can_trace(o, [rays.dx[i], rays.dy[i], rays.dz[i]], rays.t_max[i]) {
                return false;
            }
            let mut query = single_ray(rays, i, Visibility::SHADOW);
            // SAFETY: the scene is committed, the ray is finite and its id is `i`.
            unsafe { calls::occluded1(self.root.raw(), &mut context, &mut query) };
            query.tfar < 0.0
        }));
        context.finish();
    }

    fn occluded_packets<const N: usize>(&self, rays: &RayBatch, mode: Mode, occluded: &mut Vec<bool>) {
        let mut packet = RayPacket::<N>::new(Visibility::SHADOW.0);
        let mut context = calls::query_context(&self.world, rays, mode);
        for base in (0..rays.len()).step_by(N) {
            let valid = load(&mut packet, rays, base);
            // SAFETY: the scene is committed, the lanes in `valid` are finite, ids are indices of the batch.
            unsafe { calls::occluded_packet(self.root.raw(), &mut context, mode, &valid, &mut packet) };
            let count = N.min(rays.len() - base);
            occluded.extend((0..count).map(|lane| valid.0[lane] != 0 && packet.tfar[lane] < 0.0));
        }
        context.finish();
    }
}

/// Ray `i` in Embree's format.
#[inline]
pub(super) fn single_ray(rays: &RayBatch, i: usize, visibility: Visibility) -> sys::RTCRay {
    sys::RTCRay {
        org_x: rays.ox[i],
        org_y: rays.oy[i],
        org_z: rays.oz[i],
        tnear: calls::T_NEAR,
        dir_x: rays.dx[i],
        dir_y: rays.dy[i],
        dir_z: rays.dz[i],
        time: unit_time(rays.time[i]),
        tfar: rays.t_max[i],
        mask: visibility.0,
        id: i as u32,
        flags: 0,
    }
}

/// Fills a packet with the rays from `base` on. Lanes that are −1 in the result hold rays that can be traced.
#[inline]
pub(super) fn load<const N: usize>(packet: &mut RayPacket<N>, rays: &RayBatch, base: usize) -> Valid<N> {
    let count = N.min(rays.len() - base);
    let ([ox, oy, oz], [dx, dy, dz]) = (&mut packet.o, &mut packet.d);
    let fields = [
        (ox, &rays.ox),
        (oy, &rays.oy),
        (oz, &rays.oz),
        (dx, &rays.dx),
        (dy, &rays.dy),
        (dz, &rays.dz),
        (&mut packet.tfar, &rays.t_max),
        (&mut packet.time, &rays.time),
    ];
    for (lanes, values) in fields {
        match values[base..].first_chunk::<N>() {
            Some(values) => *lanes = *values,
            None => lanes[..count].copy_from_slice(&values[base..]),
        }
    }
    // Like `can_trace`, but vectorised over the lanes
    let ([ox, oy, oz], [dx, dy, dz]) = (&packet.o, &packet.d);
    let mut valid = Valid([0; N]);
    for lane in 0..N {
        let zero = ox[lane] * 0.0 + oy[lane] * 0.0 + oz[lane] * 0.0 + dx[lane] * 0.0 + dy[lane] * 0.0 + dz[lane] * 0.0;
        let length = dx[lane].abs() + dy[lane].abs() + dz[lane].abs();
        let can_trace = (zero == 0.0) & (packet.tfar[lane] > 0.0) & (length > 0.0) & (lane < count);
        valid.0[lane] = -i32::from(can_trace);
    }
    for lane in 0..N {
        packet.time[lane] = unit_time(packet.time[lane]);
        packet.id[lane] = (base + lane) as u32;
    }
    if valid.0 != [-1; N] {
        empty_others(packet, &valid);
    }
    valid
}

/// Replaces rays that cannot be traced by empty ones: if the processor lacks packets of this width, Embree 3.13 traces
/// all lanes regardless of `valid`.
#[cold]
fn empty_others<const N: usize>(packet: &mut RayPacket<N>, valid: &Valid<N>) {
    for lane in (0..N).filter(|&lane| valid.0[lane] == 0) {
        (packet.o[0][lane], packet.o[1][lane], packet.o[2][lane]) = (0.0, 0.0, 0.0);
        (packet.d[0][lane], packet.d[1][lane], packet.d[2][lane]) = (0.0, 0.0, 1.0);
        packet.tfar[lane] = f32::NEG_INFINITY;
    }
}

/// `time` clamped to 0..=1; 0 for NaN.
#[inline]
fn unit_time(time: f32) -> f32 {
    if time > 0.0 { time.min(1.0) } else { 0.0 }
}
