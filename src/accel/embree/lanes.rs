//! Exact triangle hits, several at a time: the arithmetic of [`crate::geometry::triangle`] without its rare branches.

use crate::accel::RayBatch;
use lumiris_numbers::math::{Vec3, gamma};

/// Rays and triangles side by side, in the order of each ray's axes (x, y, z: the last is the direction's largest).
#[derive(Clone, Copy, Debug)]
pub(super) struct Lanes<const N: usize> {
    /// Corners relative to the origin: `[corner][axis][lane]`.
    corners: [[[f32; N]; 3]; 3],
    /// Directions: `[axis][lane]`.
    d: [[f32; N]; 3],
}

/// Origins and directions of N rays: `[axis][lane]`.
#[derive(Clone, Copy, Debug)]
pub(super) struct RayRows<const N: usize> {
    o: [[f32; N]; 3],
    d: [[f32; N]; 3],
}

impl<const N: usize> RayRows<N> {
    /// The rays from `base` on; beyond the end of the batch, arbitrary ones.
    #[inline]
    pub(super) fn load(rays: &RayBatch, base: usize) -> Self {
        let row = |values: &[f32]| match values[base..].first_chunk::<N>() {
            Some(row) => *row,
            None => std::array::from_fn(|k| values.get(base + k).copied().unwrap_or(1.0)),
        };
        RayRows { o: [row(&rays.ox), row(&rays.oy), row(&rays.oz)], d: [row(&rays.dx), row(&rays.dy), row(&rays.dz)] }
    }

    /// Origin and direction of a ray.
    #[inline]
    pub(super) fn get(&self, lane: usize) -> (Vec3, Vec3) {
        let at = |rows: &[[f32; N]; 3]| Vec3::new(rows[0][lane], rows[1][lane], rows[2][lane]);
        (at(&self.o), at(&self.d))
    }
}

/// Hits side by side.
#[derive(Clone, Copy, Debug)]
pub(super) struct LaneHits<const N: usize> {
    /// Ray parameters.
    pub t: [f32; N],
    /// Weights of vertices 1.
    pub b1: [f32; N],
    /// Weights of vertices 2.
    pub b2: [f32; N],
    /// False where `intersect_triangle` may take one of its branches, and the other values are undefined.
    pub plain: [bool; N],
}

impl<const N: usize> Lanes<N> {
    /// Nothing in any lane.
    pub(super) const EMPTY: Self = Lanes { corners: [[[0.0; N]; 3]; 3], d: [[1.0; N]; 3] };

    /// All rays with one triangle; `None` unless they have the same largest axis.
    #[inline]
    pub(super) fn of_one_triangle(rays: &RayRows<N>, triangle: [Vec3; 3]) -> Option<Self> {
        let (o, d) = (&rays.o, &rays.d);
        let (mut all_x, mut all_y, mut all_z) = (true, true, true);
        for ((x, y), z) in d[0].iter().zip(&d[1]).zip(&d[2]) {
            let (x, y, z) = (x.abs(), y.abs(), z.abs());
            let is_x = (x > y) & (x > z);
            let is_y = !is_x & (y > z);
            all_x &= is_x;
            all_y &= is_y;
            all_z &= !is_x & !is_y;
        }
        let axes = match (all_x, all_y, all_z) {
            (true, ..) => [1, 2, 0],
            (_, true, _) => [2, 0, 1],
            (.., true) => [0, 1, 2],
            _ => return None,
        };
        let mut lanes = Self::EMPTY;
        for (row, axis) in axes.into_iter().enumerate() {
            lanes.d[row] = d[axis];
            for (corner, p) in lanes.corners.iter_mut().zip(triangle) {
                let p = p.to_array()[axis];
                for k in 0..N {
                    corner[row][k] = p - o[axis][k];
                }
            }
        }
        Some(lanes)
    }

    /// Puts a ray and a triangle into a lane.
    #[inline]
    pub(super) fn set(&mut self, lane: usize, (o, direction): (Vec3, Vec3), triangle: [Vec3; 3]) {
        let d = direction.abs();
        let z = if d.x > d.y && d.x > d.z {
            0
        } else if d.y > d.z {
            1
        } else {
            2
        };
        let ordered = |v: Vec3| match z {
            0 => [v.y, v.z, v.x],
            1 => [v.z, v.x, v.y],
            _ => [v.x, v.y, v.z],
        };
        let store = |rows: &mut [[f32; N]; 3], v: Vec3| {
            let [x, y, z] = ordered(v);
            (rows[0][lane], rows[1][lane], rows[2][lane]) = (x, y, z);
        };
        store(&mut self.d, direction);
        for (rows, p) in self.corners.iter_mut().zip(triangle) {
            store(rows, p - o);
        }
    }

    /// The result of `intersect_triangle` for each lane, to the bit.
    #[inline]
    pub(super) fn intersect(&self) -> LaneHits<N> {
        let [a, b, c] = &self.corners;
        let (mut t, mut b1, mut b2) = ([0.0_f32; N], [0.0_f32; N], [0.0_f32; N]);
        let mut plain = [false; N];
        for k in 0..N {
            let dz = self.d[2][k];
            let shear = [self.d[0][k] / dz, self.d[1][k] / dz, 1.0 / dz];
            let sheared = |p: &[[f32; N]; 3]| [p[0][k] - shear[0] * p[2][k], p[1][k] - shear[1] * p[2][k], p[2][k]];
            let (a, b, c) = (sheared(a), sheared(b), sheared(c));
            let (u, v, w) = (c[0] * b[1] - c[1] * b[0], a[0] * c[1] - a[1] * c[0], b[0] * a[1] - b[1] * a[0]);
            let det = u + v + w;
            let inv_det = 1.0 / det;
            t[k] = (u * a[2] + v * b[2] + w * c[2]) * shear[2] * inv_det;
            (b1[k], b2[k]) = (v * inv_det, w * inv_det);

            // The bound of the rounding error of t.
            let largest = |axis: usize| a[axis].abs().max(b[axis].abs()).max(c[axis].abs());
            let (x, y, z) = (largest(0), largest(1), largest(2));
            let (delta_x, delta_y, delta_z) = (gamma(5) * (x + z), gamma(5) * (y + z), gamma(3) * z);
            let delta_e = 2.0 * (gamma(2) * x * y + delta_y * x + delta_x * y);
            let e = 2.0 * x * y;
            let error = 3.0 * (gamma(3) * e * z + delta_e * z + delta_z * e) * (inv_det * shear[2]).abs();

            // Comparisons with NaN are false, so a ray that cannot be prepared is not plain.
            let inside = ((u > 0.0) & (v > 0.0) & (w > 0.0)) | ((u < 0.0) & (v < 0.0) & (w < 0.0));
            plain[k] = inside & (t[k] > error) & (t[k] < f32::INFINITY);
        }
        LaneHits { t, b1, b2, plain }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::triangle::{RayPrecomputed, TriangleHit, intersect_triangle};
    use lumiris_numbers::math::Ray;
    use lumiris_test_support::random::{RngExt, pcg32};

    fn hits_of(found: LaneHits<8>) -> [Option<TriangleHit>; 8] {
        let LaneHits { t, b1, b2, plain } = found;
        std::array::from_fn(|k| plain[k].then_some(TriangleHit { t: t[k], b1: b1[k], b2: b2[k] }))
    }

    #[test]
    fn one_triangle_in_all_lanes_gives_the_bits_of_single_lanes() {
        let mut s = pcg32([2, 9, 5]);
        let mut point = move || Vec3::new(s.random::<f32>(), s.random::<f32>(), s.random::<f32>()) * 2.0 - 1.0;
        let (mut together, mut hits) = (0, 0);
        for _ in 0..20_000 {
            let (o, triangle) = (point() * 2.0, [point(), point(), point()]);
            let inner = triangle[0] * 0.4 + triangle[1] * 0.3 + triangle[2] * 0.3;
            let (mut rays, mut lanes) = (RayBatch::default(), Lanes::<8>::EMPTY);
            rays.push(&Ray { o, d: Vec3::X, t_max: 1.0, time: 0.0 });
            for lane in 0..8 {
                rays.push(&Ray { o, d: inner - o + point() * 0.2, t_max: f32::INFINITY, time: 0.0 });
                let ray = rays.get(lane + 1);
                lanes.set(lane, (ray.o, ray.d), triangle);
            }
            let Some(all) = Lanes::of_one_triangle(&RayRows::<8>::load(&rays, 1), triangle) else { continue };
            together += 1;
            let bits = |hits: [Option<TriangleHit>; 8]| hits.map(|h| h.map(|h| [h.t, h.b1, h.b2].map(f32::to_bits)));
            let (all, single) = (bits(hits_of(all.intersect())), bits(hits_of(lanes.intersect())));
            hits += all.iter().flatten().count();
            assert_eq!(all, single, "{triangle:?} {o}");
        }
        assert!(together > 5_000 && hits > 10_000, "{together} {hits}");
    }

    #[test]
    fn lanes_give_the_bits_of_the_scalar_test() {
        let mut s = pcg32([2, 9, 4]);
        let mut point = move || Vec3::new(s.random::<f32>(), s.random::<f32>(), s.random::<f32>()) * 2.0 - 1.0;
        let (mut plain, mut hits) = (0, 0);
        for _ in 0..100_000 {
            let mut lanes = Lanes::<8>::EMPTY;
            let pairs: [(Ray, [Vec3; 3]); 8] = std::array::from_fn(|lane| {
                let o = point() * 2.0;
                let triangle = [point(), point(), point()];
                let inner = triangle[0] * 0.4 + triangle[1] * 0.3 + triangle[2] * 0.3;
                let d = if lane < 5 { inner - o } else { point() - o };
                (Ray { o, d: d * 0.7, t_max: f32::INFINITY, time: 0.0 }, triangle)
            });
            for (lane, (ray, triangle)) in pairs.iter().enumerate() {
                lanes.set(lane, (ray.o, ray.d), *triangle);
            }
            for ((ray, triangle), found) in pairs.iter().zip(hits_of(lanes.intersect())) {
                let exact = RayPrecomputed::new(ray).and_then(|r| intersect_triangle(&r, *triangle, f32::INFINITY));
                hits += usize::from(exact.is_some());
                let Some(found) = found else { continue };
                plain += 1;
                let bits = |h: TriangleHit| [h.t, h.b1, h.b2].map(f32::to_bits);
                assert_eq!(Some(bits(found)), exact.map(bits), "{ray:?} {triangle:?}");
            }
        }
        assert!(plain > 400_000 && plain * 100 > hits * 99, "{plain} {hits}");
    }
}
