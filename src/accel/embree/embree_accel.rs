//! The tracer: its construction, and the width of its packets.
//!
//! # Results do not depend on packets
//!
//! Embree decides which triangles a ray hits. Everything else is exact arithmetic of this program. A ray therefore has
//! the same result, bit for bit, in packets of any width and with any neighbours:
//!
//! 1. (t, u, v) of a hit are computed from the vertices by the same function as in [`crate::accel::bvh`], in the space
//!    of the group. Both tracers, and processors with different vector units, give the same bits for the same triangle.
//! 2. If the parameters reported by Embree differ by less than 2⁻¹², the hit with the smallest exact parameter is
//!    taken. [`Hit::precedes`](crate::accel::Hit::precedes) decides among equal ones, as in [`crate::accel::bvh`]. A
//!    filter receives every hit that Embree considers the nearest so far, and sets the end of the ray slightly beyond
//!    it. In packets it only notes which rays have such a tie. These few rays are traced again as single rays, whose
//!    filter compares exact hits. Without this, the traversal order would decide. Packets with the coherence flag then
//!    gave other triangles than single rays for 10 % of the rays at vertices of a closed mesh, for 0.2 % at edges, and
//!    for 13 % of camera rays on coplanar triangles.
//! 3. Packets are used for first hits of coherent rays and for occlusion. For other first hits Embree 3.13 traces the
//!    rays of a packet one by one anyway.
//! 4. Scenes with moving instances are traced by single rays. In packets, Embree interpolates and inverts their
//!    matrices differently: t differed for 6 % of the rays. For static instances no bit differed.
//! 5. Packets have 4, 8 or 16 rays, at most the native width of the processor. Packets of 16 are coherent only in
//!    scenes of triangles without instances: from others, Embree 3.13.5 did not return on a processor with AVX-512.
//! 6. Rays of unused lanes are empty: Embree 3.13 emulates packets that the processor lacks, and then ignores `valid`.
//!
//! If a ray passes an edge of a triangle within the rounding error, Embree decides whether it hits. In 2·10⁷ rays with
//! AVX-512, all kernels decided alike, and in 10⁷ rays each with AVX2, AVX and SSE 4.2: no first hit and no occlusion
//! bit differed. The rays were camera rays, random and grazing rays, and rays along edges and at vertices. The scenes
//! were soups, crossing, coplanar and closed meshes, quadrics, patches and instances. They were traced singly and in
//! packets of 4 and 8, with and without the coherence flag.
//!
//! On another processor (Xeon, 2.5 GHz) the AVX2 kernels decide differently for single rays and packets, but only at
//! edges and vertices. Of 5,003 rays at vertices of a closed mesh, 796 first hits and 13 occlusions differ; of camera,
//! random and grazing rays none. With AVX-512, AVX and SSE 4.2 none differ there either. The tests repeat this with
//! fewer rays. Rays that leave a surface by [`lumiris_numbers::math::ray::offset_origin`] do not hit it again.
//!
//! # Curves
//!
//! Curves are not in Embree's scene. The rays of a batch pass the pure-Rust hierarchy after Embree, with the hits so
//! far. As primitives with callbacks, curves took several times the time and memory (docs/measurements/curves).
//!
//! # Cost
//!
//! Speed relative to a bare loop over Embree with prefilled packets (`benches/embree.rs`: 10⁶ pixel-sized triangles,
//! 10⁶ rays, one thread): occlusion in packets 0.97–1.04, single rays 0.83–0.92. First hits of the rays of a rendering:
//! 0.44–0.66 in coherent packets, 0.68–0.91 for bounces. The filter that notes ties costs less than a nanosecond per
//! coherent ray. The rest is loading rays, exact hits, and storing them (docs/measurements/wavefront).

use super::callbacks::GeometryContext;
use super::clusters::ClustersContext;
use super::device::Device;
use super::error::EmbreeError;
use super::scene::EmbreeScene;
use super::scene_ids::SceneIds;
use crate::accel::{Accel, AccelStats, AlphaTest, Bvh, Coherence, Hit, RayBatch};
use crate::geometry::{AlphaSource, GeometryId, GeometrySet, Member, Shape};
use embree4_sys::RTCDeviceProperty as Property;
use std::ffi::CString;
use std::sync::Arc;
use std::time::Instant;

/// Options of a tracer.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct EmbreeOptions {
    /// Rays per packet: 1, 4, 8 or 16; by default the fastest width of the processor.
    pub packet_width: Option<u32>,
    /// Maximum memory of Embree (bytes).
    pub memory_limit: Option<u64>,
    /// Embree configuration string, for instance `threads=4,isa=avx2`.
    pub config: CString,
}

/// Rays per packet, by coherence.
#[derive(Clone, Copy, Debug)]
struct Widths {
    /// For rays with similar origins and directions.
    coherent: usize,
    /// For rays with a common origin or end.
    packets: usize,
    /// For other rays. They diverge soon in wide packets and are then traced one by one.
    incoherent: usize,
}

impl Widths {
    fn all(width: usize) -> Self {
        Widths { coherent: width, packets: width, incoherent: width }
    }
}

/// True if Embree gets only triangles and no instances. In other scenes Embree 3.13.5 may not return from coherent
/// queries for packets of 16 (observed for occlusion).
pub(super) fn has_only_triangles(set: &GeometrySet) -> bool {
    !set.has_instances() && set.geometries.iter().all(|g| matches!(g.shape, Shape::Mesh(_) | Shape::Curves(_)))
}

/// Embree's data structures for a scene.
pub struct EmbreeAccel {
    pub(super) root: Arc<EmbreeScene>,
    pub(super) world: Arc<SceneIds>,
    /// The hierarchy of the curves, if there are any.
    pub(super) curves: Option<Arc<Bvh>>,
    widths: Widths,
    pub(super) has_only_triangles: bool,
    has_motion: bool,
    stats: AccelStats,
}

impl EmbreeAccel {
    /// Builds on all cores. Without `alpha`, alpha masks are opaque. `packet_width` is 1, 4, 8 or 16.
    pub fn new(
        geometry: Arc<GeometrySet>,
        alpha: Option<Arc<dyn AlphaSource>>,
        packet_width: Option<u32>,
    ) -> Result<EmbreeAccel, EmbreeError> {
        Self::with_options(geometry, alpha, EmbreeOptions { packet_width, ..EmbreeOptions::default() })
    }

    /// Like [`Self::new`], with options.
    pub fn with_options(
        geometry: Arc<GeometrySet>,
        alpha: Option<Arc<dyn AlphaSource>>,
        options: EmbreeOptions,
    ) -> Result<EmbreeAccel, EmbreeError> {
        let start = Instant::now();
        let device = Arc::new(Device::new(&options.config, options.memory_limit)?);
        let widths = packet_widths(&device, options.packet_width, has_only_triangles(&geometry))?;
        let set = Arc::clone(&geometry);
        let world = Arc::new(SceneIds::new(geometry));
        let builder = Builder { device: &device, world: &world, alpha: alpha.clone(), query_filter: true };
        let root = Arc::new(builder.root()?);

        // The hierarchy of the curves
        let is_curves = |shape: &Shape| matches!(shape, Shape::Curves(_));
        let has_curves = set.geometries.iter().any(|g| is_curves(&g.shape));
        let curves = has_curves.then(|| Arc::new(Bvh::of_shapes(Arc::clone(&set), alpha, is_curves)));
        let of_curves = curves.as_ref().map_or(AccelStats::default(), |bvh| bvh.stats());

        let (has_motion, has_only_triangles) = (set.has_motion(), has_only_triangles(&set));
        let stats = AccelStats {
            bytes: device.bytes() + of_curves.bytes,
            peak_bytes: device.peak_bytes().max(device.bytes() + of_curves.peak_bytes),
            build_seconds: start.elapsed().as_secs_f64(),
        };
        Ok(EmbreeAccel { root, world, curves, widths, has_only_triangles, has_motion, stats })
    }

    /// Rays per packet. With moving instances each ray has its own time and is traced singly.
    pub fn packet_width(&self, coherence: Coherence) -> u32 {
        let width = match coherence {
            Coherence::Coherent => self.widths.coherent,
            Coherence::Packets => self.widths.packets,
            Coherence::Incoherent => self.widths.incoherent,
        };
        if self.has_motion { 1 } else { width as u32 }
    }

    /// Shares the structures, but traces with packets of another width: 1, 4, 8 or 16.
    pub fn with_packet_width(&self, width: u32) -> Result<EmbreeAccel, EmbreeError> {
        let width = checked_width(width)?;
        let widths = Widths::all(width);
        let (root, world, curves) = (Arc::clone(&self.root), Arc::clone(&self.world), self.curves.clone());
        Ok(EmbreeAccel { root, world, curves, widths, ..*self })
    }
}

impl Accel for EmbreeAccel {
    fn intersect(&self, rays: &RayBatch, coherence: Coherence, hits: &mut Vec<Option<Hit>>) {
        self.intersect_batch(rays, coherence, hits);
        if let Some(curves) = &self.curves {
            curves.intersect_before(rays, hits);
        }
    }

    fn occluded(&self, rays: &RayBatch, coherence: Coherence, occluded: &mut Vec<bool>) {
        self.occluded_batch(rays, coherence, occluded);
        if let Some(curves) = &self.curves {
            curves.occlude_others(rays, occluded);
        }
    }

    fn stats(&self) -> AccelStats {
        self.stats
    }
}

/// Builds the scenes of a tracer.
pub(super) struct Builder<'a> {
    pub(super) device: &'a Arc<Device>,
    pub(super) world: &'a Arc<SceneIds>,
    pub(super) alpha: Option<Arc<dyn AlphaSource>>,
    /// True if queries have a filter function.
    pub(super) query_filter: bool,
}

impl Builder<'_> {
    /// The committed root scene.
    pub(super) fn root(&self) -> Result<EmbreeScene, EmbreeError> {
        // A scene for each group with instances
        let (world, set) = (self.world, &self.world.set);
        let of_instances = world.instances.iter().map(|&i| set.instances[i as usize].group);
        let of_members = set.clusters.clusters().iter().flatten().map(|member| member.group);
        let mut groups: Vec<Option<Arc<EmbreeScene>>> = vec![None; set.groups.len()];
        for group in of_instances.chain(of_members) {
            let (scene, geometries) = (&mut groups[group as usize], &world.groups[group as usize]);
            if scene.is_none() && !geometries.is_empty() {
                *scene = Some(committed(self.scene(geometries)?)?);
            }
        }

        // The root scene with the instances, and with the places of clusters after them
        let mut root = self.scene(&world.root)?;
        for &i in &world.instances {
            let instance = &set.instances[i as usize];
            if let Some(group) = &groups[instance.group as usize] {
                root.add_instance(group, &instance.world_from_group)?;
            }
        }
        if !set.clusters.places().is_empty() {
            let scenes = self.clusters(&groups)?;
            ClustersContext::new(set, scenes, world.first_of_clusters()).add_to(&mut root)?;
        }
        root.commit()?;
        Ok(root)
    }

    /// A scene for each cluster, whose ids are the indices of its members.
    fn clusters(&self, groups: &[Option<Arc<EmbreeScene>>]) -> Result<Vec<Arc<EmbreeScene>>, EmbreeError> {
        let cluster = |members: &Vec<Member>| {
            let mut scene = self.scene(&[])?;
            for Member { group, cluster_from_group } in members {
                let transform = cluster_from_group.as_affine3a();
                match &groups[*group as usize] {
                    Some(group) if transform.inverse().is_finite() => scene.add_instance(group, &[transform])?,
                    _ => scene.skip_id(),
                }
            }
            committed(scene)
        };
        self.world.set.clusters.clusters().iter().map(cluster).collect()
    }

    /// A scene of geometries, before its commit.
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

fn committed(scene: EmbreeScene) -> Result<Arc<EmbreeScene>, EmbreeError> {
    scene.commit()?;
    Ok(Arc::new(scene))
}

/// The requested packet width, or the widest ones that pay off.
fn packet_widths(device: &Device, asked: Option<u32>, is_plain: bool) -> Result<Widths, EmbreeError> {
    // Check the features of this build
    if !device.has(Property::RTC_DEVICE_PROPERTY_RAY_MASK_SUPPORTED) {
        return Err(EmbreeError::Unsupported("ray masks"));
    }
    if !device.has(Property::RTC_DEVICE_PROPERTY_FILTER_FUNCTION_SUPPORTED) {
        return Err(EmbreeError::Unsupported("filter functions"));
    }
    if !device.has(Property::RTC_DEVICE_PROPERTY_USER_GEOMETRY_SUPPORTED) {
        return Err(EmbreeError::Unsupported("user geometry"));
    }

    // The requested width
    if let Some(width) = asked {
        let width = checked_width(width)?;
        return Ok(Widths::all(width));
    }

    // The native widths
    let is_native = |width: &(Property, usize)| device.has(width.0);
    let wide = [
        (Property::RTC_DEVICE_PROPERTY_NATIVE_RAY16_SUPPORTED, 16),
        (Property::RTC_DEVICE_PROPERTY_NATIVE_RAY8_SUPPORTED, 8),
    ];
    let packets = wide.into_iter().find(is_native).map_or(4, |(_, width)| width);
    let narrow = packets.min(8);
    Ok(Widths { coherent: if is_plain { packets } else { narrow }, packets, incoherent: narrow })
}

/// The packet width, if it is supported.
pub(super) fn checked_width(width: u32) -> Result<usize, EmbreeError> {
    match width {
        1 | 4 | 8 | 16 => Ok(width as usize),
        _ => Err(EmbreeError::PacketWidth(width)),
    }
}

#[cfg(test)]
#[path = "tests.rs"]
mod tests;
