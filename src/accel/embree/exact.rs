//! Exact hits of a block of rays: their triangles are collected, and tested side by side.

use super::world::{Reported, World};
use crate::accel::{Hit, RayBatch};
use crate::geometry::{GeometryId, Shape, TriangleMesh};
use lumiris_lanes::hits::{self, BLOCK, Hits, Pairs};
use lumiris_lanes::level;

/// Rays of a block with the triangles that Embree reported.
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
    /// Determines the hits of the rays from `base` on, one for each of at most [`BLOCK`] hits that Embree reported.
    pub(super) fn find(&mut self, world: &World, rays: &RayBatch, base: usize, reported: &[Reported]) {
        let count = reported.len().min(BLOCK);
        let range = base..base + count;
        let Pairs { o, d, t_max, corners } = &mut self.pairs;
        let columns = [&rays.ox, &rays.oy, &rays.oz, &rays.dx, &rays.dy, &rays.dz];
        for (row, column) in o.iter_mut().chain(d.iter_mut()).zip(columns) {
            row[..count].copy_from_slice(&column[range.clone()]);
        }
        t_max[..count].copy_from_slice(&rays.t_max[range]);

        // The indices of all, then their corners: each of the two is a cache miss, and those of different rays overlap
        let mut triangles: [Option<(&TriangleMesh, [u32; 3])>; BLOCK] = [None; BLOCK];
        for (lane, reported) in reported[..count].iter().enumerate() {
            let mesh = (reported.geometry != u32::MAX).then(|| {
                let instance = world.instance(reported.instance);
                let geometry = world.geometry(reported.geometry, instance);
                (self.geometries[lane], self.instances[lane]) = (geometry, instance);
                &world.set.geometries[geometry as usize].shape
            });
            if let Some(Shape::Mesh(mesh)) = mesh {
                triangles[lane] = Some((mesh, mesh.indices[reported.primitive as usize]));
            } else {
                t_max[lane] = f32::NEG_INFINITY;
            }
        }
        for (lane, triangle) in triangles[..count].iter().enumerate() {
            let Some((mesh, vertices)) = triangle else { continue };
            for (rows, p) in corners.iter_mut().zip(mesh.corners(*vertices)) {
                (rows[0][lane], rows[1][lane], rows[2][lane]) = p.into();
            }
            if self.instances[lane] != Hit::NO_INSTANCE {
                let ray = world.group_ray(&rays.get(base + lane), self.instances[lane]);
                (o[0][lane], o[1][lane], o[2][lane]) = ray.o.into();
                (d[0][lane], d[1][lane], d[2][lane]) = ray.d.into();
            }
        }
        hits::exact(level(), &self.pairs, count, &mut self.hits);
    }

    /// The hit of a ray of the block, on the primitive that was reported; `None` where [`World::refine`] must decide, or
    /// nothing was reported.
    #[inline]
    pub(super) fn hit(&self, lane: usize, primitive: u32) -> Option<Hit> {
        let Hits { t, b1, b2 } = &self.hits;
        let (geometry, instance) = (self.geometries[lane], self.instances[lane]);
        (!t[lane].is_nan()).then(|| Hit { t: t[lane], uv: [b1[lane], b2[lane]], geometry, primitive, instance })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::triangle::{RayPrecomputed, TriangleHit, intersect_triangle};
    use lumiris_numbers::math::{Ray, Vec3};
    use lumiris_test_support::random::{RngExt, pcg32};

    #[test]
    fn lanes_give_the_bits_of_the_scalar_test_at_every_level() {
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

    /// Blocks of 64, 63, … pairs.
    const LANES_LEFT_OUT: usize = 9;
}
