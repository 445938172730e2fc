//! Meshes of bilinear patches.
//!
//! A ray hits the patch where it intersects one of the segments from edge p00–p10 to edge p01–p11: a quadratic equation
//! in u [Reshetov 2019]. It is solved in f64, so that only the rounding of the ray itself limits the accuracy.

use super::hit::{LocalHit, SurfaceHit, VertexValues, face_forward, round, spanning};
use glam::DVec3;
use lumiris_lanes::triangle_points::MIN_DETERMINANT;
use lumiris_numbers::math::transform::{swaps_handedness, transform_normal};
use lumiris_numbers::math::{Affine3A, Bounds3, Ray, Vec2, Vec3, gamma};

/// Indexed bilinear patches; p(u, v) blends corners p00, p10, p01, p11 in this order (pbrt's `bilinearmesh`).
#[derive(Clone, Debug, Default)]
pub struct BilinearMesh {
    /// Vertex positions.
    pub positions: Vec<Vec3>,
    /// Four vertex indices per patch: p00, p10, p01, p11; all in range.
    pub indices: Vec<[u32; 4]>,
    /// Unit shading normals per vertex, or empty.
    pub normals: Vec<Vec3>,
    /// Texture coordinates per vertex, or empty.
    pub uvs: Vec<Vec2>,
    /// Face number of each patch, or empty.
    pub faces: Vec<u32>,
    /// True if the geometric normal is the reverse of ∂p/∂u × ∂p/∂v.
    pub flip_normal: bool,
}

impl BilinearMesh {
    /// The transformed patches; the transformation may be singular.
    #[must_use]
    pub fn transformed(&self, m: &Affine3A) -> Self {
        let mut mesh = self.clone();
        mesh.positions.iter_mut().for_each(|p| *p = m.transform_point3(*p));
        mesh.normals.iter_mut().for_each(|n| *n = transform_normal(m, *n));
        mesh.flip_normal ^= swaps_handedness(m);
        mesh
    }

    /// Number of patches.
    #[inline]
    pub fn patch_count(&self) -> usize {
        self.indices.len()
    }

    /// Bounds of all vertices in use; a patch lies in the convex hull of its corners.
    pub fn bounds(&self) -> Bounds3 {
        Bounds3::from_points(self.indices.iter().flatten().map(|&v| self.positions[v as usize]))
    }

    /// The corners p00, p10, p01, p11 of patch `i`.
    #[inline]
    pub fn patch(&self, i: usize) -> [Vec3; 4] {
        self.indices[i].map(|v| self.positions[v as usize])
    }

    /// The first hit of patch `i` in (0, t_max) that `accepts` accepts. `accepts` receives the hit and the index of its
    /// crossing, 0 or 1, in ascending order of u; uv are its parameters (u, v). A ray that leaves from
    /// [`lumiris_numbers::math::ray::offset_origin`] does not hit the same planar patch again.
    #[inline]
    pub fn intersect_patch_where(
        &self,
        i: usize,
        ray: &Ray,
        accepts: impl Fn(&LocalHit, usize) -> bool,
    ) -> Option<LocalHit> {
        /// Parameters this far outside 0..1 count as on the border, so that adjacent patches do not leak.
        const BORDER: f64 = 1e-10;
        let (o, d) = (ray.o.as_dvec3(), ray.d.as_dvec3());
        let corners = self.patch(i);
        let [p00, p10, p01, p11] = corners.map(|p| p.as_dvec3() - o);
        let (e00, e11, e10) = (p01 - p00, p11 - p10, p10 - p00);

        // The quadratic a u² + b u + c, whose roots are the lines that intersect the ray.
        let a = e10.cross(p01 - p11).dot(d);
        let c = p00.cross(d).dot(e00);
        let b = p10.cross(d).dot(e11) - (a + c);
        let roots = solve_quadratic(a, b, c)?;

        // Below this parameter a hit is rounding noise.
        let scale = ray.o.abs().max_element() + corners.iter().fold(0.0_f32, |m, p| m.max(p.abs().max_element()));
        let t_min = f64::from(scale) * 2.0_f64.powi(-44) / d.length();
        let mut best: Option<LocalHit> = None;
        for (crossing, u) in roots.into_iter().enumerate() {
            let is_double = crossing == 1 && u == roots[0];
            if is_double || !(-BORDER..=1.0 + BORDER).contains(&u) {
                continue;
            }
            let from = p00.lerp(p10, u);
            let along = p01.lerp(p11, u) - from;
            let perpendicular = d.cross(along);
            let length_squared = perpendicular.length_squared();
            let v = from.dot(d.cross(perpendicular)) / length_squared;
            let t = from.dot(along.cross(perpendicular)) / length_squared;
            let is_met = (-BORDER..=1.0 + BORDER).contains(&v) && t > t_min;
            let hit = LocalHit { t: t as f32, uv: [u, v].map(|x| x.clamp(0.0, 1.0) as f32) };
            let end = best.map_or(ray.t_max, |best| best.t);
            if is_met && hit.t > 0.0 && hit.t < end && accepts(&hit, crossing) {
                best = Some(hit);
            }
        }
        best
    }

    /// The surface of patch `i` at its parameters `uv`, in the space of the group.
    ///
    /// n is the unit vector of ∂p/∂u × ∂p/∂v, u and v the patch's parameters, reversed if `flip_normal`; where the mesh
    /// has shading normals, n is then turned to their side.
    pub fn surface_hit(&self, i: usize, uv: [f32; 2]) -> SurfaceHit {
        let corners = self.patch(i);
        let [p00, p10, p01, p11] = corners.map(Vec3::as_dvec3);
        let [u, v] = uv.map(f64::from);
        let p = round(p00.lerp(p10, u).lerp(p01.lerp(p11, u), v));
        let p_error = corners.iter().fold(Vec3::ZERO, |m, p| m.max(p.abs())) * gamma(7);
        let (du, dv) = ((p10 - p00).lerp(p11 - p01, v), (p01 - p00).lerp(p11 - p10, u));

        // Geometric normal; at a collapsed edge, the normal of the diagonals.
        let n = du.cross(dv).try_normalize().unwrap_or_else(|| (p10 - p01).cross(p11 - p00).normalize_or_zero());
        let n = if self.flip_normal { -round(n) } else { round(n) };
        let blend = |values: &[Vec3]| {
            let [q00, q10, q01, q11] = self.indices[i].map(|k| values[k as usize]);
            q00.lerp(q10, uv[0]).lerp(q01.lerp(q11, uv[0]), uv[1])
        };
        let shading = if self.normals.is_empty() { None } else { blend(&self.normals).try_normalize() };
        let (n, ns) = shading.map_or((n, n), |ns| (face_forward(n, ns), ns));

        // Derivatives by the texture coordinates, by the chain rule.
        let [dpdu, dpdv] = self.texture_derivatives(i, uv, [du, dv]);
        let [dpdu, dpdv] = spanning(dpdu, dpdv, n);
        let uv = self.texture_coordinates_at(i, uv);
        SurfaceHit { p, p_error, n, ns, dpdu, dpdv, dpdus: dpdu, dpdvs: dpdv, uv, vertex: self.vertex_values_of(i) }
    }

    /// Vertex values of patch `i`.
    #[inline]
    pub fn vertex_values_of(&self, i: usize) -> VertexValues {
        VertexValues { face: self.faces.get(i).copied().unwrap_or(0), ..VertexValues::default() }
    }

    /// The texture coordinates of patch `i` at its parameters `uv`: the parameters themselves if the mesh has none.
    #[inline]
    pub fn texture_coordinates_at(&self, i: usize, uv: [f32; 2]) -> Vec2 {
        if self.uvs.is_empty() {
            return Vec2::from(uv);
        }
        let [s00, s10, s01, s11] = self.indices[i].map(|k| self.uvs[k as usize]);
        s00.lerp(s10, uv[0]).lerp(s01.lerp(s11, uv[0]), uv[1])
    }

    /// Derivatives of p by the texture coordinates at `uv` of patch `i`; by u and v if they are singular.
    fn texture_derivatives(&self, i: usize, uv: [f32; 2], [du, dv]: [DVec3; 2]) -> [Vec3; 2] {
        if self.uvs.is_empty() {
            return [round(du), round(dv)];
        }
        let [s00, s10, s01, s11] = self.indices[i].map(|k| self.uvs[k as usize]);
        let st_u = (s10 - s00).lerp(s11 - s01, uv[1]).as_dvec2();
        let st_v = (s01 - s00).lerp(s11 - s10, uv[0]).as_dvec2();
        let det = st_u.x * st_v.y - st_u.y * st_v.x;
        if det.is_nan() || det.abs() < MIN_DETERMINANT {
            return [round(du), round(dv)];
        }
        [round((du * st_v.y - dv * st_u.y) / det), round((dv * st_u.x - du * st_v.x) / det)]
    }
}

/// The real roots of a x² + b x + c in ascending order; a double root twice; `None` if there is none.
pub(super) fn solve_quadratic(a: f64, b: f64, c: f64) -> Option<[f64; 2]> {
    let discriminant = b * b - 4.0 * a * c;
    if discriminant.is_nan() || discriminant < 0.0 {
        return None;
    }
    let q = -0.5 * (b + discriminant.sqrt().copysign(b));
    if a == 0.0 && q == 0.0 {
        return None;
    }
    // Not the textbook formula, where −b and the root may cancel.
    let (x0, x1) = match (a == 0.0, q == 0.0) {
        (true, _) => (c / q, c / q),
        (false, true) => (0.0, 0.0),
        (false, false) => (q / a, c / q),
    };
    Some(if x0 <= x1 { [x0, x1] } else { [x1, x0] })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::reference_for_tests::random_point;
    use lumiris_numbers::math::ray::offset_origin;
    use lumiris_test_support::random::{RngExt, pcg32};

    fn patch(corners: [Vec3; 4]) -> BilinearMesh {
        BilinearMesh { positions: corners.to_vec(), indices: vec![[0, 1, 2, 3]], ..BilinearMesh::default() }
    }

    /// Hits of a fine triangulation of the patch, in f64.
    fn reference(mesh: &BilinearMesh, ray: &Ray) -> Option<f64> {
        const N: usize = 48;
        let [p00, p10, p01, p11] = mesh.patch(0).map(Vec3::as_dvec3);
        let (o, d) = (ray.o.as_dvec3(), ray.d.as_dvec3());
        let at = |i: usize, j: usize| {
            let (u, v) = (i as f64 / N as f64, j as f64 / N as f64);
            p00.lerp(p10, u).lerp(p01.lerp(p11, u), v)
        };
        let mut best = f64::INFINITY;
        for (i, j) in (0..N * N).map(|k| (k % N, k / N)) {
            let quad = [at(i, j), at(i + 1, j), at(i, j + 1), at(i + 1, j + 1)];
            for [a, b, c] in [[quad[0], quad[1], quad[2]], [quad[3], quad[2], quad[1]]] {
                // Möller–Trumbore
                let (e1, e2, s) = (b - a, c - a, o - a);
                let det = e1.dot(d.cross(e2));
                let (b1, b2) = (s.dot(d.cross(e2)) / det, d.dot(s.cross(e1)) / det);
                let t = e2.dot(s.cross(e1)) / det;
                if b1 >= 0.0 && b2 >= 0.0 && b1 + b2 <= 1.0 && t > 0.0 && t < best {
                    best = t;
                }
            }
        }
        best.is_finite().then_some(best)
    }

    #[test]
    fn hits_agree_with_a_fine_tessellation() {
        let mut s = pcg32([8, 0, 0]);
        let (mut both, mut differ) = (0, 0);
        for _ in 0..400 {
            let mesh = patch(std::array::from_fn(|_| random_point(&mut s)));
            let o = random_point(&mut s) * 3.0;
            let ray = Ray { o, d: random_point(&mut s) * 0.7 - o, t_max: f32::INFINITY, time: 0.0 };
            match (mesh.intersect_patch_where(0, &ray, |_, _| true), reference(&mesh, &ray)) {
                (Some(hit), Some(t)) => {
                    both += 1;
                    let surface = mesh.surface_hit(0, hit.uv);
                    assert!((surface.p - ray.at(hit.t)).length() < 2e-5, "{hit:?}");
                    differ += usize::from((f64::from(hit.t) - t).abs() > 5e-3);
                }
                (None, None) => {}
                _ => differ += 1,
            }
        }
        // The triangulation differs at silhouettes.
        assert!(both > 60 && differ <= 4, "{both} {differ}");
    }

    #[test]
    fn rays_that_leave_a_planar_patch_do_not_meet_it_again() {
        let mut s = pcg32([9, 0, 0]);
        for k in 0..100_000 {
            // A random parallelogram, every fourth in a coordinate plane.
            let (c, mut e, mut f) = (random_point(&mut s) * 100.0, random_point(&mut s), random_point(&mut s));
            if k % 4 == 0 {
                (e.y, f.y) = (0.0, 0.0);
            }
            let mesh = patch([c, c + e, c + f, c + e + f]);
            let hit = mesh.surface_hit(0, s.random::<[f32; 2]>());
            let w = random_point(&mut s).normalize_or(Vec3::Y);
            // The rounded corners are not exactly coplanar: leave out rays within the patch's own twist.
            if hit.n.dot(w).abs() < 1e-3 {
                continue;
            }
            let ray = Ray { o: offset_origin(hit.p, hit.p_error, hit.n, w), d: w, t_max: f32::INFINITY, time: 0.0 };
            assert_eq!(mesh.intersect_patch_where(0, &ray, |_, _| true), None, "{mesh:?} {ray:?}");
        }
    }

    #[test]
    fn derivatives_normals_and_texture_coordinates_are_consistent() {
        let mut mesh = patch([Vec3::ZERO, Vec3::X * 2.0, Vec3::Y, Vec3::new(2.0, 1.0, 0.5)]);
        mesh.uvs = vec![Vec2::new(0.0, 1.0), Vec2::ONE, Vec2::new(0.2, 0.0), Vec2::new(1.0, 0.1)];
        let a = mesh.surface_hit(0, [0.4, 0.6]);
        assert!(a.n.z > 0.8 && a.n.dot(a.dpdu).abs() < 1e-5 && a.n.dot(a.dpdv).abs() < 1e-5);
        let b = mesh.surface_hit(0, [0.401, 0.601]);
        let duv = b.uv - a.uv;
        assert!((a.dpdu * duv.x + a.dpdv * duv.y - (b.p - a.p)).length() < 1e-4 * (b.p - a.p).length().max(1e-2));

        mesh.flip_normal = true;
        assert!(mesh.surface_hit(0, [0.4, 0.6]).n.z < -0.8);
        mesh.normals = vec![Vec3::Z; 4];
        let hit = mesh.surface_hit(0, [0.4, 0.6]);
        assert!(hit.n.z > 0.8 && hit.ns == Vec3::Z);
    }

    #[test]
    fn degenerate_patches_do_not_panic() {
        let ray = Ray { o: -Vec3::Z, d: Vec3::Z, t_max: f32::INFINITY, time: 0.0 };
        assert_eq!(patch([Vec3::ZERO; 4]).intersect_patch_where(0, &ray, |_, _| true), None);
        assert_eq!(patch([Vec3::NAN; 4]).intersect_patch_where(0, &ray, |_, _| true), None);
        // One edge collapsed: still a triangle, with a normal at the apex.
        let triangle = patch([-Vec3::ONE, Vec3::new(1.0, -1.0, 0.0), Vec3::Y, Vec3::Y]);
        assert!(triangle.intersect_patch_where(0, &ray, |_, _| true).is_some());
        assert!((triangle.surface_hit(0, [0.3, 1.0]).n.length() - 1.0).abs() < 1e-5);
    }
}
