//! Exact hits of a block of rays: their triangles are gathered and intersected in SIMD lanes.

use super::context::ReportedBlock;
use super::scene_ids::SceneIds;
use crate::accel::{Hit, RayBatch};
use crate::geometry::{GeometryId, Shape, TriangleMesh};
use lumiris_lanes::hits::{self, BLOCK, Hits, Pairs};
use lumiris_lanes::level;
use lumiris_numbers::math::Vec3;
use std::ops::Range;

/// Rays whose triangles are compared at once: neighbouring rays often hit the same triangle.
const GROUP: usize = 8;

/// Rays of a block with the triangles reported by Embree.
pub(super) struct ExactHits {
    pairs: Pairs,
    hits: Hits,
    geometries: [GeometryId; BLOCK],
    instances: [u32; BLOCK],
}

impl Default for ExactHits {
    fn default() -> Self {
        ExactHits {
            pairs: Pairs::default(),
            hits: Hits::default(),
            geometries: [0; BLOCK],
            instances: [Hit::NO_INSTANCE; BLOCK],
        }
    }
}

impl ExactHits {
    /// Computes the hits of at most [`BLOCK`] rays, one for each hit reported by Embree.
    pub(super) fn find(&mut self, world: &SceneIds, rays: &RayBatch, range: Range<usize>, reported: &ReportedBlock) {
        let count = range.len().min(BLOCK);
        let Pairs { o, d, t_max, .. } = &mut self.pairs;
        let columns = [&rays.ox, &rays.oy, &rays.oz, &rays.dx, &rays.dy, &rays.dz];
        for (row, column) in o.iter_mut().chain(d.iter_mut()).zip(columns) {
            row[..count].copy_from_slice(&column[range.clone()]);
        }
        t_max[..count].copy_from_slice(&rays.t_max[range.clone()]);

        // All indices first, then all corners: both are cache misses, and the misses of different rays overlap
        let mut triangles: [Option<IndexedTriangle<'_>>; BLOCK] = [None; BLOCK];
        for begin in (0..count).step_by(GROUP) {
            if is_same(&reported.geometry, begin)
                & is_same(&reported.primitive, begin)
                & is_same(&reported.instance, begin)
            {
                let triangle = self.triangle(world, reported, begin);
                let (geometry, instance) = (self.geometries[begin], self.instances[begin]);
                self.geometries[begin..begin + GROUP].fill(geometry);
                self.instances[begin..begin + GROUP].fill(instance);
                match triangle {
                    Some(triangle) => self.set_corners::<GROUP>(begin, triangle.corners()),
                    None => self.pairs.t_max[begin..begin + GROUP].fill(f32::NEG_INFINITY),
                }
            } else {
                for lane in begin..(begin + GROUP).min(count) {
                    let triangle = self.triangle(world, reported, lane);
                    if triangle.is_none() {
                        self.pairs.t_max[lane] = f32::NEG_INFINITY;
                    }
                    triangles[lane] = triangle;
                }
            }
        }
        for (lane, triangle) in triangles[..count].iter().enumerate() {
            if let Some(triangle) = triangle {
                self.set_corners::<1>(lane, triangle.corners());
            }
        }
        if world.set.has_instances() {
            self.enter_instances(world, rays, range);
        }
        hits::exact(level(), &self.pairs, count, &mut self.hits);
    }

    /// The triangle reported for a ray. Also stores its geometry and instance.
    #[inline(always)]
    fn triangle<'a>(
        &mut self,
        world: &'a SceneIds,
        reported: &ReportedBlock,
        lane: usize,
    ) -> Option<IndexedTriangle<'a>> {
        if reported.geometry[lane] == u32::MAX {
            self.instances[lane] = Hit::NO_INSTANCE;
            return None;
        }

        // Embree's ids are translated to those of the scene
        let instance = world.instance(reported.instance[lane]);
        let geometry = world.geometry(reported.geometry[lane], instance);
        (self.geometries[lane], self.instances[lane]) = (geometry, instance);
        match &world.set.geometries[geometry as usize].shape {
            Shape::Mesh(mesh) => {
                Some(IndexedTriangle { mesh, vertices: mesh.indices[reported.primitive[lane] as usize] })
            }
            _ => None,
        }
    }

    /// Sets the same triangle in N lanes.
    #[inline]
    fn set_corners<const N: usize>(&mut self, begin: usize, corners: [Vec3; 3]) {
        for (rows, p) in self.pairs.corners.iter_mut().zip(corners) {
            for (row, value) in rows.iter_mut().zip(p.to_array()) {
                row[begin..begin + N].fill(value);
            }
        }
    }

    /// Transforms the rays with hits in instances to the space of the group.
    fn enter_instances(&mut self, world: &SceneIds, rays: &RayBatch, range: Range<usize>) {
        let Pairs { o, d, .. } = &mut self.pairs;
        for (lane, i) in range.enumerate().filter(|&(lane, _)| self.instances[lane] != Hit::NO_INSTANCE) {
            let ray = world.group_ray(&rays.get(i), self.instances[lane]);
            (o[0][lane], o[1][lane], o[2][lane]) = ray.o.into();
            (d[0][lane], d[1][lane], d[2][lane]) = ray.d.into();
        }
    }

    /// The hit of a ray of the block on the reported primitive. `None` if nothing was reported or [`SceneIds::refine`]
    /// must decide.
    #[inline]
    pub(super) fn hit(&self, lane: usize, primitive: u32) -> Option<Hit> {
        let Hits { t, b1, b2 } = &self.hits;
        let (geometry, instance) = (self.geometries[lane], self.instances[lane]);
        (!t[lane].is_nan()).then(|| Hit { t: t[lane], uv: [b1[lane], b2[lane]], geometry, primitive, instance })
    }
}

/// The vertex indices of a triangle.
#[derive(Clone, Copy)]
struct IndexedTriangle<'a> {
    mesh: &'a TriangleMesh,
    vertices: [u32; 3],
}

impl IndexedTriangle<'_> {
    fn corners(&self) -> [Vec3; 3] {
        self.mesh.corners(self.vertices)
    }
}

/// True if all lanes of a group have the same value.
#[inline]
fn is_same(row: &[u32; BLOCK], begin: usize) -> bool {
    let group = &row[begin..begin + GROUP];
    group.iter().fold(0, |differ, value| differ | (value ^ group[0])) == 0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::triangle::{RayPrecomputed, TriangleHit, intersect_triangle};
    use lumiris_numbers::math::Ray;
    use lumiris_test_support::random::{RngExt, pcg32};

    #[test]
    fn lanes_give_the_bits_of_the_scalar_test_at_every_level() {
        // Rays and triangles, most of them hit, some beyond the end
        let mut s = pcg32([2, 9, 4]);
        let mut point = move || Vec3::new(s.random::<f32>(), s.random::<f32>(), s.random::<f32>()) * 2.0 - 1.0;
        let (mut plain, mut hits, mut beyond) = (0, 0, 0);
        for round in 0..4_000 {
            let count = BLOCK - round % LANES_LEFT_OUT;
            let (mut block, mut singles) = (Pairs::default(), Vec::new());
            for lane in 0..count {
                let o = point() * 2.0;
                let triangle = [point(), point(), point()];
                let inner = triangle[0] * 0.4 + triangle[1] * 0.3 + triangle[2] * 0.3;
                let d = if lane % 8 < 5 { inner - o } else { point() - o };
                let t_max = if lane % 7 == 0 { 1.2 } else { f32::INFINITY };
                let ray = Ray { o, d: d * 0.7, t_max, time: 0.0 };
                for axis in 0..3 {
                    (block.o[axis][lane], block.d[axis][lane]) = (ray.o[axis], ray.d[axis]);
                    (0..3).for_each(|k| block.corners[k][axis][lane] = triangle[k][axis]);
                }
                block.t_max[lane] = t_max;
                singles.push((ray, triangle));
            }

            // Every SIMD level gives the scalar result or leaves the decision open
            for level in lumiris_lanes::levels() {
                let mut found = Hits::default();
                hits::exact(level, &block, count, &mut found);
                for (lane, (ray, triangle)) in singles.iter().enumerate() {
                    let exact = RayPrecomputed::new(ray).and_then(|r| intersect_triangle(&r, *triangle, f32::INFINITY));
                    let is_beyond = exact.is_some_and(|hit| hit.t >= ray.t_max);
                    beyond += usize::from(is_beyond);
                    hits += usize::from(exact.is_some() && !is_beyond);
                    if found.t[lane].is_nan() {
                        continue;
                    }
                    plain += 1;
                    let bits = |h: TriangleHit| [h.t, h.b1, h.b2].map(f32::to_bits);
                    let of_lane = TriangleHit { t: found.t[lane], b1: found.b1[lane], b2: found.b2[lane] };
                    assert!(!is_beyond);
                    assert_eq!(Some(bits(of_lane)), exact.map(bits), "{ray:?} {triangle:?}");
                }
            }
        }
        assert!(plain > 400_000 && beyond > 1_000 && plain * 100 > hits * 99, "{plain} {hits} {beyond}");
    }

    /// Number of block sizes: 64, 63, … pairs.
    const LANES_LEFT_OUT: usize = 9;
}
