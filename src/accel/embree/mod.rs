//! Ray tracing by Embree, 3.13 or 4.x.
//!
//! Reading order: [`device`] (errors, memory), [`scene`] (geometries, instances), [`world`] (ids and exact hits),
//! [`exact`] (exact hits of a block of rays), [`context`] (what the callbacks of a query share), [`callbacks`] (first
//! hits, cut-outs, quadrics, patches, curves), [`kernels`] (the two families' functions), [`query`] (batches), [`bare`] (Embree
//! by itself, to compare with).
//!
//! # Answers do not depend on packets
//!
//! Embree decides which triangles a ray meets; all else is exact arithmetic of this program, so a ray has one answer,
//! to the bit, in packets of any width and beside any neighbours:
//!
//! 1. (t, u, v) of a hit are computed from the vertices by the same function as in [`super::bvh`], in the group's
//!    space. The two tracers, and processors with other vector units, give the same bits for the same triangle.
//! 2. Of hits whose parameters as Embree reports them differ by less than 2⁻¹², the exact one that comes first is
//!    taken, and of equal ones the smallest (instance, geometry, primitive), again as in [`super::bvh`]. A filter sees
//!    every hit that Embree takes for the nearest so far, and leaves the end of the ray that little beyond it. In
//!    packets it only notes which rays have two such hits, and these few are traced again by single rays, whose filter
//!    compares exact hits. Without this the first of a tie is a matter of the order of traversal: among rays at
//!    vertices of a closed mesh, packets with the coherence flag gave other triangles than single rays for 10 %, at
//!    edges for 0.2 %, camera rays on coplanar triangles for 13 %.
//! 3. Packets are traced for first hits of coherent rays and for occlusion. For other first hits Embree 3.13 traces the
//!    rays of a packet one by one anyway.
//! 4. Scenes with moving instances are traced by single rays. Embree interpolates and inverts their matrices in another
//!    way in packets: t differed for 6 % of the rays. For instances at rest no bit differed.
//! 5. Packets have 4 or 8 rays. With 16, Embree 3.13.5 did not return from scenes with instances on a processor with
//!    AVX-512, and it is no faster.
//! 6. Rays of unused lanes are empty: Embree 3.13 emulates packets that the processor lacks, and then ignores `valid`.
//!
//! Whether a ray meets a triangle at all, by less than a rounding error of its edge, remains Embree's decision. Its
//! kernels decided alike in all of 2·10⁷ rays (camera, random, along edges, at vertices, grazing; soups, crossing,
//! coplanar and closed meshes, quadrics, patches, instances) with AVX-512, and 10⁷ each with AVX2, AVX and SSE 4.2,
//! single and in packets of 4 and 8, with and without the coherence flag: no first hit and no occlusion bit differed.
//! On another processor (Xeon, 2.5 GHz) the kernels of AVX2 decide otherwise in single rays than in packets at edges and vertices
//! alone: of 5,003 rays at vertices of a closed mesh, 796 first hits and 13 occlusions differ, and none of camera, random and
//! grazing rays; with AVX-512, AVX and SSE 4.2 none differ there either. The tests repeat this with fewer rays. Rays that leave a surface by [`lumiris_numbers::math::ray::offset_origin`] do
//! not meet it again.
//!
//! # Cost
//!
//! Against a bare loop over Embree with packets filled in advance (`benches/embree.rs`: 10⁶ triangles of the size of a
//! pixel, 10⁶ rays, one thread): occlusion in packets 0.97–1.04 of its speed, single rays 0.83–0.92. First hits of the
//! rays of a rendering: 0.44–0.66 in coherent packets, 0.68–0.91 for bounces. A filter that only notes ties costs less
//! than a nanosecond per coherent ray; the rest is loading rays, exact hits, and storing them (docs/measurements/wavefront).

pub mod bare;
mod callbacks;
mod context;
mod device;
mod exact;
mod kernels;
mod query;
mod scene;
#[cfg(test)]
mod tests;
mod world;

use super::{Accel, AccelStats, AlphaTest, Coherence, Hit, RayBatch};
use crate::geometry::{AlphaSource, GeometryId, GeometrySet, Shape};
use callbacks::GeometryContext;
use device::Device;
use embree4_sys::{RTCDeviceProperty as Property, RTCError};
use scene::EmbreeScene;
use std::ffi::CString;
use std::fmt;
use std::sync::Arc;
use std::time::Instant;
use world::World;

/// Kind of an error of Embree.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs)]
pub enum ErrorCode {
    None,
    Unknown,
    InvalidArgument,
    InvalidOperation,
    OutOfMemory,
    UnsupportedCpu,
    Cancelled,
    /// A code that this program does not know.
    Other(u32),
}

impl From<RTCError> for ErrorCode {
    fn from(code: RTCError) -> Self {
        match code {
            RTCError::RTC_ERROR_NONE => ErrorCode::None,
            RTCError::RTC_ERROR_UNKNOWN => ErrorCode::Unknown,
            RTCError::RTC_ERROR_INVALID_ARGUMENT => ErrorCode::InvalidArgument,
            RTCError::RTC_ERROR_INVALID_OPERATION => ErrorCode::InvalidOperation,
            RTCError::RTC_ERROR_OUT_OF_MEMORY => ErrorCode::OutOfMemory,
            RTCError::RTC_ERROR_UNSUPPORTED_CPU => ErrorCode::UnsupportedCpu,
            RTCError::RTC_ERROR_CANCELLED => ErrorCode::Cancelled,
            RTCError(other) => ErrorCode::Other(other),
        }
    }
}

impl fmt::Display for ErrorCode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            ErrorCode::None => f.write_str("no error"),
            ErrorCode::Unknown => f.write_str("unknown error"),
            ErrorCode::InvalidArgument => f.write_str("invalid argument"),
            ErrorCode::InvalidOperation => f.write_str("invalid operation"),
            ErrorCode::OutOfMemory => f.write_str("out of memory"),
            ErrorCode::UnsupportedCpu => f.write_str("processor not supported"),
            ErrorCode::Cancelled => f.write_str("cancelled"),
            ErrorCode::Other(code) => write!(f, "error {code}"),
        }
    }
}

/// Why there is no ray tracer.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum EmbreeError {
    /// A call failed.
    #[error("Embree cannot {action}: {code}{}{message}", if .message.is_empty() { "" } else { ": " })]
    Call {
        /// What was tried.
        action: &'static str,
        /// The kind of error.
        code: ErrorCode,
        /// What Embree says.
        message: String,
    },
    /// The library was built without something that is needed.
    #[error("this build of Embree has no {0}")]
    Unsupported(&'static str),
    /// Unsupported packet width.
    #[error("packets of {0} rays are not supported: 1, 4, 8 or 16")]
    PacketWidth(u32),
    /// A shape has more primitives than 32 bits count.
    #[error("a shape has more than 4294967295 primitives")]
    TooManyPrimitives,
}

/// Options of a tracer.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct EmbreeOptions {
    /// Rays per packet: 1, 4, 8 or 16; what the processor is fastest with if not given.
    pub packet_width: Option<u32>,
    /// Maximum memory of Embree (bytes).
    pub memory_limit: Option<u64>,
    /// Embree's own configuration, for instance `threads=4,isa=avx2`.
    pub config: CString,
}

/// Rays per packet.
#[derive(Clone, Copy, Debug)]
struct Widths {
    /// Of rays with similar origins and directions.
    coherent: usize,
    /// Of rays with a common origin or end.
    packets: usize,
    /// Of rays without: those of wide packets part soon, and are traced one after the other.
    incoherent: usize,
}

impl Widths {
    fn all(width: usize) -> Self {
        Widths { coherent: width, packets: width, incoherent: width }
    }
}

/// True if nothing is placed and all is triangles. Elsewhere Embree 3.13.5 may not return from coherent queries
/// for packets of 16 (seen of occlusion).
fn has_only_triangles(set: &GeometrySet) -> bool {
    set.instances.is_empty() && set.geometries.iter().all(|g| matches!(g.shape, Shape::Mesh(_)))
}

/// Embree's data structures for a scene.
pub struct EmbreeAccel {
    root: Arc<EmbreeScene>,
    world: Arc<World>,
    widths: Widths,
    has_only_triangles: bool,
    has_motion: bool,
    stats: AccelStats,
}

impl EmbreeAccel {
    /// Builds on all cores. Without `alpha`, cut-outs are opaque. `packet_width` is 1, 4, 8 or 16.
    pub fn new(
        geometry: Arc<GeometrySet>,
        alpha: Option<Arc<dyn AlphaSource>>,
        packet_width: Option<u32>,
    ) -> Result<EmbreeAccel, EmbreeError> {
        Self::with_options(geometry, alpha, EmbreeOptions { packet_width, ..EmbreeOptions::default() })
    }

    /// As [`Self::new`], with options.
    pub fn with_options(
        geometry: Arc<GeometrySet>,
        alpha: Option<Arc<dyn AlphaSource>>,
        options: EmbreeOptions,
    ) -> Result<EmbreeAccel, EmbreeError> {
        let start = Instant::now();
        let device = Arc::new(Device::new(&options.config, options.memory_limit)?);
        let widths = packet_widths(&device, options.packet_width, has_only_triangles(&geometry))?;
        let set = Arc::clone(&geometry);
        let world = Arc::new(World::new(geometry, |i| scene::can_place(&set.instances[i as usize])));
        let builder = Builder { device: &device, world: &world, alpha, query_filter: true };
        let root = Arc::new(builder.root()?);

        let (has_motion, has_only_triangles) = (set.has_motion(), has_only_triangles(&set));
        let (bytes, peak_bytes) = device.memory();
        let stats = AccelStats { bytes, peak_bytes, build_seconds: start.elapsed().as_secs_f64() };
        Ok(EmbreeAccel { root, world, widths, has_only_triangles, has_motion, stats })
    }

    /// Rays per packet. Where instances move, each ray has a time of its own, and is traced alone.
    pub fn packet_width(&self, coherence: Coherence) -> u32 {
        let width = match coherence {
            Coherence::Coherent => self.widths.coherent,
            Coherence::Packets => self.widths.packets,
            Coherence::Incoherent => self.widths.incoherent,
        };
        if self.has_motion { 1 } else { width as u32 }
    }

    /// The same structures, traced with packets of another width: 1, 4, 8 or 16.
    pub fn with_packet_width(&self, width: u32) -> Result<EmbreeAccel, EmbreeError> {
        let width = checked_width(width)?;
        let widths = Widths::all(width);
        Ok(EmbreeAccel { root: Arc::clone(&self.root), world: Arc::clone(&self.world), widths, ..*self })
    }
}

impl Accel for EmbreeAccel {
    fn intersect(&self, rays: &RayBatch, coherence: Coherence, hits: &mut Vec<Option<Hit>>) {
        self.intersect_batch(rays, coherence, hits);
    }

    fn occluded(&self, rays: &RayBatch, coherence: Coherence, occluded: &mut Vec<bool>) {
        self.occluded_batch(rays, coherence, occluded);
    }

    fn stats(&self) -> AccelStats {
        self.stats
    }
}

struct Builder<'a> {
    device: &'a Arc<Device>,
    world: &'a Arc<World>,
    alpha: Option<Arc<dyn AlphaSource>>,
    /// Whether queries bring a filter.
    query_filter: bool,
}

impl Builder<'_> {
    /// The scene of everything, committed.
    fn root(&self) -> Result<EmbreeScene, EmbreeError> {
        // A scene per group that is placed.
        let (world, set) = (self.world, &self.world.set);
        let mut groups: Vec<Option<Arc<EmbreeScene>>> = vec![None; set.groups.len()];
        for &i in &world.instances {
            let group = set.instances[i as usize].group as usize;
            if groups[group].is_none() {
                let scene = self.scene(&world.groups[group])?;
                scene.commit()?;
                groups[group] = Some(Arc::new(scene));
            }
        }

        // The root with the placements.
        let mut root = self.scene(&world.root)?;
        for &i in &world.instances {
            let instance = &set.instances[i as usize];
            if let Some(group) = &groups[instance.group as usize] {
                root.add_instance(group, instance)?;
            }
        }
        root.commit()?;
        Ok(root)
    }

    /// A scene of geometries, not committed.
    fn scene(&self, geometries: &[GeometryId]) -> Result<EmbreeScene, EmbreeError> {
        let set = &self.world.set;
        let mut scene = EmbreeScene::new(self.device, set, self.query_filter)?;
        for &id in geometries {
            let source = self.alpha.as_ref().filter(|_| set.geometries[id as usize].alpha.is_some());
            let alpha = source.map(|source| AlphaTest::new(Arc::clone(set), Arc::clone(source)));
            scene.add_shape(id, GeometryContext { world: Arc::clone(self.world), id, alpha })?;
        }
        Ok(scene)
    }
}

/// The requested width, or the widest that pay off.
fn packet_widths(device: &Device, asked: Option<u32>, is_plain: bool) -> Result<Widths, EmbreeError> {
    if !device.has(Property::RTC_DEVICE_PROPERTY_RAY_MASK_SUPPORTED) {
        return Err(EmbreeError::Unsupported("ray masks"));
    }
    if !device.has(Property::RTC_DEVICE_PROPERTY_FILTER_FUNCTION_SUPPORTED) {
        return Err(EmbreeError::Unsupported("filter functions"));
    }
    if !device.has(Property::RTC_DEVICE_PROPERTY_USER_GEOMETRY_SUPPORTED) {
        return Err(EmbreeError::Unsupported("user geometry"));
    }
    if let Some(width) = asked {
        let width = checked_width(width)?;
        return Ok(Widths::all(width));
    }
    let is_native = |width: &(Property, usize)| device.has(width.0);
    let wide = [
        (Property::RTC_DEVICE_PROPERTY_NATIVE_RAY16_SUPPORTED, 16),
        (Property::RTC_DEVICE_PROPERTY_NATIVE_RAY8_SUPPORTED, 8),
    ];
    let packets = wide.into_iter().find(is_native).map_or(4, |(_, width)| width);
    let narrow = packets.min(8);
    Ok(Widths { coherent: if is_plain { packets } else { narrow }, packets, incoherent: narrow })
}

fn checked_width(width: u32) -> Result<usize, EmbreeError> {
    match width {
        1 | 4 | 8 | 16 => Ok(width as usize),
        _ => Err(EmbreeError::PacketWidth(width)),
    }
}
