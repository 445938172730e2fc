//! Plain Embree: loops over prefilled packets, without the additions of the renderer. They measure the best possible
//! speed of a query, and thereby the cost of conversion and of exact hits. Only `crates/bench` uses them.
//!
//! The scene is built as in the renderer, but without the flag that allows a filter function per query. Quadrics,
//! patches and alpha masks use callbacks as in the renderer. Curves are left out.
#![allow(unsafe_code)]

use super::calls::{self, RayHitPacket, RayPacket, Valid, can_trace};
use super::context::{Mode, QueryKind};
use super::device::Device;
use super::embree_accel::{Builder, checked_width, has_only_triangles};
use super::error::EmbreeError;
use super::query::{ANY_SINGLE, load, single_ray};
use super::scene::EmbreeScene;
use super::scene_ids::SceneIds;
use crate::accel::RayBatch;
use crate::geometry::{AlphaSource, GeometrySet, Shape, Visibility};
use embree4_sys as sys;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Embree's data structures for a scene.
pub struct Bare {
    root: EmbreeScene,
    world: Arc<SceneIds>,
    /// True if callbacks report hits; the context must be prepared for them.
    calls_back: bool,
    has_only_triangles: bool,
    build_time: Duration,
}

/// Packed rays of one batch.
pub struct Packed<'a> {
    rays: &'a RayBatch,
    packets: Packets,
}

/// A packet and its valid lanes.
struct Loaded<const N: usize, P> {
    valid: Valid<N>,
    packet: P,
}

enum Packets {
    First1(Vec<sys::RTCRayHit>),
    First4(Vec<Loaded<4, RayHitPacket<4>>>),
    First8(Vec<Loaded<8, RayHitPacket<8>>>),
    First16(Vec<Loaded<16, RayHitPacket<16>>>),
    Any1(Vec<sys::RTCRay>),
    Any4(Vec<Loaded<4, RayPacket<4>>>),
    Any8(Vec<Loaded<8, RayPacket<8>>>),
    Any16(Vec<Loaded<16, RayPacket<16>>>),
}

impl Bare {
    /// Builds on all cores. Without `alpha`, alpha masks are opaque.
    pub fn new(set: Arc<GeometrySet>, alpha: Option<Arc<dyn AlphaSource>>) -> Result<Bare, EmbreeError> {
        let start = Instant::now();
        let device = Arc::new(Device::new(c"", None)?);
        let has_only_triangles = has_only_triangles(&set);
        let calls_back = set.geometries.iter().any(|g| matches!(g.shape, Shape::Quadric(_) | Shape::Bilinear(_)));
        let world = Arc::new(SceneIds::new(set));
        let root = Builder { device: &device, world: &world, alpha, query_filter: false }.root()?;
        Ok(Bare { root, world, calls_back, has_only_triangles, build_time: start.elapsed() })
    }

    /// Wall-clock time of the build.
    pub fn build_time(&self) -> Duration {
        self.build_time
    }

    /// Traces packed rays. `coherent` allows frustum traversal of packets, where Embree supports it.
    pub fn trace(&self, packed: &mut Packed<'_>, coherent: bool) {
        let rays = packed.rays;
        match &mut packed.packets {
            Packets::First1(singles) => self.nearest_singly(rays, singles),
            Packets::First4(packets) => self.nearest(rays, packets, coherent),
            Packets::First8(packets) => self.nearest(rays, packets, coherent),
            Packets::First16(packets) => self.nearest(rays, packets, coherent && self.has_only_triangles),
            Packets::Any1(singles) => self.any_singly(rays, singles),
            Packets::Any4(packets) => self.any(rays, packets, coherent),
            Packets::Any8(packets) => self.any(rays, packets, coherent),
            Packets::Any16(packets) => self.any(rays, packets, false),
        }
    }

    fn nearest_singly(&self, rays: &RayBatch, singles: &mut [sys::RTCRayHit]) {
        let mode = Mode { query: QueryKind::Nearest, coherent: false };
        let mut context = calls::query_context(&self.world, rays, mode);
        for single in singles {
            if self.calls_back {
                context.begin(single.ray.id as usize);
            }
            // SAFETY: the scene is committed, the ray is finite and its id an index of the batch.
            unsafe { calls::intersect1(self.root.raw(), &mut context, mode, single) };
        }
        context.finish();
    }

    fn nearest<const N: usize>(&self, rays: &RayBatch, packets: &mut [Loaded<N, RayHitPacket<N>>], coherent: bool) {
        let mode = Mode { query: QueryKind::Nearest, coherent };
        let mut context = calls::query_context(&self.world, rays, mode);
        for Loaded { valid, packet } in packets {
            if self.calls_back {
                context.begin(packet.rays.id[0] as usize);
            }
            // SAFETY: the scene is committed, the lanes in `valid` are finite, ids are indices of the batch.
            unsafe { calls::intersect_packet(self.root.raw(), &mut context, mode, valid, packet) };
        }
        context.finish();
    }

    fn any_singly(&self, rays: &RayBatch, singles: &mut [sys::RTCRay]) {
        let mut context = calls::query_context(&self.world, rays, ANY_SINGLE);
        for single in singles {
            // SAFETY: the scene is committed, the ray is finite and its id an index of the batch.
            unsafe { calls::occluded1(self.root.raw(), &mut context, single) };
        }
        context.finish();
    }

    fn any<const N: usize>(&self, rays: &RayBatch, packets: &mut [Loaded<N, RayPacket<N>>], coherent: bool) {
        let mode = Mode { query: QueryKind::Any, coherent };
        let mut context = calls::query_context(&self.world, rays, mode);
        for Loaded { valid, packet } in packets {
            // SAFETY: the scene is committed, the lanes in `valid` are finite, ids are indices of the batch.
            unsafe { calls::occluded_packet(self.root.raw(), &mut context, mode, valid, packet) };
        }
        context.finish();
    }
}

impl<'a> Packed<'a> {
    /// Packs rays for nearest-hit queries, in packets of `width`: 1, 4, 8 or 16.
    pub fn first(rays: &'a RayBatch, width: u32) -> Result<Packed<'a>, EmbreeError> {
        let packets = match checked_width(width)? {
            4 => Packets::First4(pack_first(rays)),
            8 => Packets::First8(pack_first(rays)),
            16 => Packets::First16(pack_first(rays)),
            _ => {
                let hit = sys::RTCHit {
                    geomID: sys::RTC_INVALID_GEOMETRY_ID,
                    instID: [sys::RTC_INVALID_GEOMETRY_ID],
                    ..Default::default()
                };
                let rays = traceable(rays, Visibility::PATH).map(|ray| sys::RTCRayHit { ray, hit });
                Packets::First1(rays.collect())
            }
        };
        Ok(Packed { rays, packets })
    }

    /// Packs segments for occlusion queries, in packets of `width`: 1, 4, 8 or 16.
    pub fn any(rays: &'a RayBatch, width: u32) -> Result<Packed<'a>, EmbreeError> {
        let packets = match checked_width(width)? {
            4 => Packets::Any4(pack_any(rays)),
            8 => Packets::Any8(pack_any(rays)),
            16 => Packets::Any16(pack_any(rays)),
            _ => Packets::Any1(traceable(rays, Visibility::SHADOW).collect()),
        };
        Ok(Packed { rays, packets })
    }

    /// Number of rays that hit something.
    pub fn hits(&self) -> usize {
        // A geometry marks a hit
        fn first<const N: usize>(packets: &[Loaded<N, RayHitPacket<N>>]) -> usize {
            let geometries = packets.iter().flat_map(|loaded| loaded.packet.geometry);
            geometries.filter(|&g| g != sys::RTC_INVALID_GEOMETRY_ID).count()
        }
        // A negative end marks occlusion
        fn any<const N: usize>(packets: &[Loaded<N, RayPacket<N>>]) -> usize {
            let stopped = |Loaded { valid, packet }: &Loaded<N, RayPacket<N>>| {
                (0..N).filter(|&lane| valid.0[lane] != 0 && packet.tfar[lane] < 0.0).count()
            };
            packets.iter().map(stopped).sum()
        }
        // Count by kind of packet
        match &self.packets {
            Packets::First1(rays) => rays.iter().filter(|r| r.hit.geomID != sys::RTC_INVALID_GEOMETRY_ID).count(),
            Packets::First4(packets) => first(packets),
            Packets::First8(packets) => first(packets),
            Packets::First16(packets) => first(packets),
            Packets::Any1(rays) => rays.iter().filter(|r| r.tfar < 0.0).count(),
            Packets::Any4(packets) => any(packets),
            Packets::Any8(packets) => any(packets),
            Packets::Any16(packets) => any(packets),
        }
    }
}

fn traceable(rays: &RayBatch, visibility: Visibility) -> impl Iterator<Item = sys::RTCRay> {
    let all = (0..rays.len()).map(move |i| single_ray(rays, i, visibility));
    all.filter(|r| can_trace([r.org_x, r.org_y, r.org_z], [r.dir_x, r.dir_y, r.dir_z], r.tfar))
}

fn pack_first<const N: usize>(rays: &RayBatch) -> Vec<Loaded<N, RayHitPacket<N>>> {
    let pack = |base| {
        let mut packet = RayHitPacket::new(Visibility::PATH.0);
        Loaded { valid: load(&mut packet.rays, rays, base), packet }
    };
    (0..rays.len()).step_by(N).map(pack).collect()
}

fn pack_any<const N: usize>(rays: &RayBatch) -> Vec<Loaded<N, RayPacket<N>>> {
    let pack = |base| {
        let mut packet = RayPacket::new(Visibility::SHADOW.0);
        Loaded { valid: load(&mut packet, rays, base), packet }
    };
    (0..rays.len()).step_by(N).map(pack).collect()
}
