//! Indexed triangle meshes.

use super::hit::{SurfaceHit, VertexValues, face_forward, round, spanning, tangents};
use lumiris_lanes::triangle_points::{
    CornerCoordinates, MIN_DETERMINANT, TexturedPoints, TriangleHits, lane, set_lane,
};
use lumiris_numbers::math::transform::{swaps_handedness, transform_normal};
use lumiris_numbers::math::{Affine3A, Bounds3, Vec2, Vec3, gamma};

/// Indexed triangles. Optional arrays are empty if absent; vertex arrays otherwise have the length of the positions.
#[derive(Clone, Debug, Default)]
pub struct TriangleMesh {
    /// Vertex positions, with an additional zero element at the end: Embree reads 16 bytes at each 12-byte vertex.
    padded_positions: Vec<Vec3>,
    /// Vertex indices, three per triangle; all in range.
    pub indices: Vec<[u32; 3]>,
    /// Unit shading normals.
    pub normals: Vec<Vec3>,
    /// Texture coordinates.
    pub uvs: Vec<Vec2>,
    /// Second texture coordinates.
    pub uvs1: Vec<Vec2>,
    /// Linear colours and opacities.
    pub colors: Vec<[f32; 4]>,
    /// Shading tangents.
    pub tangents: Vec<Vec3>,
    /// Per vertex, 1 if the second axis of tangent space is to the left of the tangent, looking against the shading
    /// normal; −1 if it is to the right. If empty, it is on the side of ∂p/∂v.
    pub tangent_signs: Vec<i8>,
    /// True if shading tangents of a mesh without tangents follow the second texture coordinates.
    pub tangents_along_second: bool,
    /// Face number of each triangle.
    pub faces: Vec<u32>,
    /// True if the geometric normal is the reverse of (p1 − p0) × (p2 − p0): pbrt's `ReverseOrientation` xor a
    /// reflecting transform.
    pub flip_normal: bool,
}

impl TriangleMesh {
    /// A mesh of positions and indices; `Err` with a message if an index is out of range.
    pub fn new(mut positions: Vec<Vec3>, indices: Vec<[u32; 3]>) -> Result<Self, String> {
        let count = positions.len();
        if let Some((i, t)) = indices.iter().enumerate().find(|(_, t)| t.iter().any(|&v| v as usize >= count)) {
            return Err(format!("triangle {i} refers to vertices {t:?}, but there are {count} vertices"));
        }
        positions.push(Vec3::ZERO);
        Ok(TriangleMesh { padded_positions: positions, indices, ..TriangleMesh::default() })
    }

    /// The transformed mesh; the transformation may be singular.
    #[must_use]
    pub fn transformed(&self, m: &Affine3A) -> Self {
        let mut mesh = self.clone();
        let count = self.positions().len();
        mesh.padded_positions[..count].iter_mut().for_each(|p| *p = m.transform_point3(*p));
        mesh.normals.iter_mut().for_each(|n| *n = transform_normal(m, *n));
        mesh.tangents.iter_mut().for_each(|t| *t = m.transform_vector3(*t));
        if swaps_handedness(m) {
            // A reflection moves the second axis of tangent space to the other side of the first
            mesh.tangent_signs.iter_mut().for_each(|sign| *sign = -*sign);
            mesh.flip_normal = !self.flip_normal;
        }
        mesh
    }

    /// Vertex positions.
    #[inline]
    pub fn positions(&self) -> &[Vec3] {
        &self.padded_positions[..self.padded_positions.len().saturating_sub(1)]
    }

    /// Vertex positions followed by one element of padding.
    #[inline]
    pub fn padded_positions(&self) -> &[Vec3] {
        &self.padded_positions
    }

    /// Number of triangles.
    #[inline]
    pub fn triangle_count(&self) -> usize {
        self.indices.len()
    }

    /// The corners of triangle `i`.
    #[inline]
    pub fn triangle(&self, i: usize) -> [Vec3; 3] {
        self.corners(self.indices[i])
    }

    /// The positions of three vertices.
    #[inline]
    pub fn corners(&self, vertices: [u32; 3]) -> [Vec3; 3] {
        vertices.map(|v| self.padded_positions[v as usize])
    }

    /// Area of triangle `i`.
    pub fn area(&self, i: usize) -> f32 {
        let [a, b, c] = self.triangle(i);
        0.5 * (b - a).cross(c - a).length()
    }

    /// Bounds of all vertices in use.
    pub fn bounds(&self) -> Bounds3 {
        Bounds3::from_points(self.indices.iter().flatten().map(|&v| self.padded_positions[v as usize]))
    }

    /// The surface of triangle `i` at the barycentric weights `uv` of vertices 1 and 2, in the space of the group.
    ///
    /// n is the unit vector of (p1 − p0) × (p2 − p0), reversed if `flip_normal`. If the mesh has shading normals, n is
    /// then flipped to their side. Texture coordinates are (0,0), (1,0), (1,1) if the mesh has none.
    pub fn surface_hit(&self, i: usize, uv: [f32; 2]) -> SurfaceHit {
        let corners = self.triangle(i);
        let b = [1.0 - uv[0] - uv[1], uv[0], uv[1]];
        let [p0, p1, p2] = corners.map(Vec3::as_dvec3);
        let (e1, e2) = (p1 - p0, p2 - p0);
        let p = round(p0 + e1 * f64::from(uv[0]) + e2 * f64::from(uv[1]));
        let p_error = gamma(7) * (0..3).fold(Vec3::ZERO, |sum, k| sum + (corners[k] * b[k]).abs());

        // Geometric normal, in f64 for slivers.
        let n = round(e1.cross(e2).normalize_or_zero());
        let n = if self.flip_normal { -n } else { n };
        let (n, ns) = self.shading_normal(i, b).map_or((n, n), |ns| (face_forward(n, ns), ns));

        // Partial derivatives from the texture coordinates.
        let st = self.texture_coordinates(i);
        let [dpdu, dpdv] = partial_derivatives(corners, st);
        let [dpdu, dpdv] = spanning(dpdu, dpdv, ns);
        let [dpdus, dpdvs] = self.shading_tangents(i, b, ns).unwrap_or([dpdu, dpdv]);
        let vertex = self.vertex_values_at(i, uv);
        let uv = self.texture_coordinates_at(i, uv);
        SurfaceHit { p, p_error, n, ns, dpdu, dpdv, dpdus, dpdvs, uv, vertex }
    }

    /// The same, from lane `k` of the `points` that were computed for it, see [`Self::gather_hit`] and
    /// [`Self::gather_coordinates`].
    pub fn surface_hit_of_lane(&self, i: usize, uv: [f32; 2], points: &TexturedPoints, k: usize) -> SurfaceHit {
        let ns = lane(&points.ns, k);
        let derivatives = points.derivatives.each_ref().map(|rows| lane(rows, k));
        let [dpdu, dpdv] = if derivatives == [Vec3::ZERO; 2] { tangents(ns) } else { derivatives };
        let b = [1.0 - uv[0] - uv[1], uv[0], uv[1]];
        let [dpdus, dpdvs] = self.shading_tangents(i, b, ns).unwrap_or([dpdu, dpdv]);
        SurfaceHit {
            p: lane(&points.p, k),
            p_error: lane(&points.p_error, k),
            n: lane(&points.n, k),
            ns,
            dpdu,
            dpdv,
            dpdus,
            dpdvs,
            uv: points.uv(k),
            vertex: self.vertex_values_at(i, uv),
        }
    }

    /// Sets lane `k` of `hits` to a hit of triangle `i`, at the weights `uv` of corners 1 and 2, by a ray of direction
    /// `d`.
    #[inline(always)]
    pub fn gather_hit(&self, i: usize, uv: [f32; 2], d: Vec3, hits: &mut TriangleHits, k: usize) {
        let vertices = self.indices[i];
        for (rows, p) in hits.corners.iter_mut().zip(self.corners(vertices)) {
            set_lane(rows, k, p);
        }
        if self.normals.is_empty() {
            hits.normals.iter_mut().for_each(|rows| set_lane(rows, k, Vec3::ZERO));
        } else {
            for (rows, v) in hits.normals.iter_mut().zip(vertices) {
                set_lane(rows, k, self.normals[v as usize]);
            }
        }
        [hits.b[0][k], hits.b[1][k]] = uv;
        hits.orientation[k] = if self.flip_normal { -1.0 } else { 1.0 };
        set_lane(&mut hits.d, k, d);
    }

    /// Sets lane `k` of `coordinates` to the texture coordinates of triangle `i`'s corners.
    #[inline]
    pub fn gather_coordinates(&self, i: usize, coordinates: &mut CornerCoordinates, k: usize) {
        for (rows, uv) in coordinates.iter_mut().zip(self.texture_coordinates(i)) {
            (rows[0][k], rows[1][k]) = uv.into();
        }
    }

    /// The shading tangents at the weights `b` of triangle `i`; `None` if they follow the texture coordinates.
    fn shading_tangents(&self, i: usize, b: [f32; 3], ns: Vec3) -> Option<[Vec3; 2]> {
        let vertices = self.indices[i].map(|v| v as usize);
        let second = || {
            let [u, v] = partial_derivatives(self.triangle(i), vertices.map(|v| self.uvs1[v]));
            spanning(u, v, ns)
        };
        if self.tangents.is_empty() {
            return (self.tangents_along_second && !self.uvs1.is_empty()).then(second);
        }
        let tangent = self.blend(&self.tangents, i, b).filter(|s| s.length_squared() > 0.0)?;
        if self.tangent_signs.is_empty() {
            let [_, dpdv] = partial_derivatives(self.triangle(i), self.texture_coordinates(i));
            return Some([tangent, dpdv]);
        }
        let sign = vertices.iter().map(|&v| i32::from(self.tangent_signs[v])).sum::<i32>().signum();
        Some([tangent, ns.cross(tangent) * sign as f32])
    }

    /// The texture coordinates of triangle `i`'s corners.
    #[inline]
    pub fn texture_coordinates(&self, i: usize) -> [Vec2; 3] {
        if self.uvs.is_empty() {
            return [Vec2::ZERO, Vec2::X, Vec2::ONE];
        }
        self.indices[i].map(|v| self.uvs[v as usize])
    }

    /// The texture coordinates of triangle `i` at the weights `uv` of vertices 1 and 2.
    #[inline]
    pub fn texture_coordinates_at(&self, i: usize, uv: [f32; 2]) -> Vec2 {
        let [st0, st1, st2] = self.texture_coordinates(i);
        st0 * (1.0 - uv[0] - uv[1]) + st1 * uv[0] + st2 * uv[1]
    }

    /// Second texture coordinates, colour and face of triangle `i` at the weights `uv` of vertices 1 and 2.
    #[inline]
    pub fn vertex_values_at(&self, i: usize, uv: [f32; 2]) -> VertexValues {
        let face = self.faces.get(i).copied().unwrap_or(0);
        let mut values = VertexValues { face, ..VertexValues::default() };
        if self.uvs1.is_empty() && self.colors.is_empty() {
            return values;
        }
        let vertices = self.indices[i].map(|v| v as usize);
        let b = [1.0 - uv[0] - uv[1], uv[0], uv[1]];
        if !self.uvs1.is_empty() {
            values.uv1 = (0..3).map(|k| self.uvs1[vertices[k]] * b[k]).sum();
        }
        if !self.colors.is_empty() {
            values.color = std::array::from_fn(|c| (0..3).map(|k| self.colors[vertices[k]][c] * b[k]).sum());
        }
        values
    }

    fn shading_normal(&self, i: usize, b: [f32; 3]) -> Option<Vec3> {
        self.blend(&self.normals, i, b).and_then(Vec3::try_normalize)
    }

    fn blend(&self, values: &[Vec3], i: usize, b: [f32; 3]) -> Option<Vec3> {
        let [v0, v1, v2] = self.indices[i].map(|v| v as usize);
        (!values.is_empty()).then(|| values[v0] * b[0] + values[v1] * b[1] + values[v2] * b[2])
    }
}

/// ∂p/∂u and ∂p/∂v of a triangle; zero if the texture coordinates are degenerate.
fn partial_derivatives([p0, p1, p2]: [Vec3; 3], [uv0, uv1, uv2]: [Vec2; 3]) -> [Vec3; 2] {
    let (duv02, duv12) = ((uv0 - uv2).as_dvec2(), (uv1 - uv2).as_dvec2());
    let (dp02, dp12) = ((p0 - p2).as_dvec3(), (p1 - p2).as_dvec3());
    let det = duv02.x * duv12.y - duv02.y * duv12.x;
    if det.is_nan() || det.abs() < MIN_DETERMINANT {
        return [Vec3::ZERO; 2];
    }
    let dpdu = (duv12.y * dp02 - duv02.y * dp12) / det;
    let dpdv = (duv02.x * dp12 - duv12.x * dp02) / det;
    [round(dpdu), round(dpdv)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::triangle::{RayPrecomputed, intersect_triangle};
    use lumiris_lanes::lane::LANES;
    use lumiris_lanes::level;
    use lumiris_lanes::triangle_points::textured_points;
    use lumiris_numbers::math::Ray;
    use lumiris_numbers::math::ray::offset_origin;
    use lumiris_test_support::random::{RngExt, pcg32};

    fn triangle() -> TriangleMesh {
        let positions = vec![Vec3::new(1.0, 0.0, 2.0), Vec3::new(3.0, 0.0, 2.0), Vec3::new(1.0, 2.0, 2.0)];
        TriangleMesh::new(positions, vec![[0, 1, 2]]).unwrap()
    }

    #[test]
    fn surface_hit_follows_the_orientation_rules() {
        let mut mesh = triangle();
        let hit = mesh.surface_hit(0, [0.25, 0.5]);
        assert!((hit.p - Vec3::new(1.5, 1.0, 2.0)).length() < 1e-6);
        assert_eq!((hit.n, hit.ns), (Vec3::Z, Vec3::Z));
        assert!((hit.uv - Vec2::new(0.75, 0.5)).length() < 1e-6);

        mesh.flip_normal = true;
        assert_eq!(mesh.surface_hit(0, [0.2, 0.2]).n, -Vec3::Z);

        // Shading normals are authoritative: n is flipped to their side, for either value of flip_normal.
        let tilted = Vec3::new(0.6, 0.0, 0.8);
        mesh.normals = vec![tilted; 3];
        let hit = mesh.surface_hit(0, [0.2, 0.2]);
        assert_eq!(hit.n, Vec3::Z);
        assert!((hit.ns - tilted).length() < 1e-6);
        mesh.normals = vec![-tilted; 3];
        mesh.flip_normal = false;
        assert_eq!(mesh.surface_hit(0, [0.2, 0.2]).n, -Vec3::Z);
    }

    #[test]
    fn partial_derivatives_follow_the_texture_coordinates() {
        let mut mesh = triangle();
        mesh.uvs = vec![Vec2::new(0.1, 0.2), Vec2::new(0.5, 0.1), Vec2::new(0.3, 0.9)];
        let at = |b: [f32; 2]| mesh.surface_hit(0, b);
        let (a, b) = (at([0.2, 0.3]), at([0.3, 0.1]));
        let duv = b.uv - a.uv;
        let predicted = a.dpdu * duv.x + a.dpdv * duv.y;
        assert!((predicted - (b.p - a.p)).length() < 1e-5);

        mesh.uvs = vec![Vec2::ONE; 3];
        let hit = mesh.surface_hit(0, [0.2, 0.3]);
        assert!(hit.dpdu.cross(hit.dpdv).length() > 0.5 && hit.dpdu.dot(hit.n).abs() < 1e-6);

        mesh.tangents = vec![Vec3::new(0.0, 2.0, 0.0); 3];
        assert_eq!(mesh.surface_hit(0, [0.2, 0.3]).dpdus, Vec3::new(0.0, 2.0, 0.0));
        for sign in [1, -1] {
            mesh.tangent_signs = vec![sign; 3];
            assert_eq!(mesh.surface_hit(0, [0.2, 0.3]).dpdvs, Vec3::new(-2.0, 0.0, 0.0) * f32::from(sign));
        }

        // Tangents of the second texture coordinates, for a mesh without tangents
        (mesh.tangents, mesh.uvs1) = (Vec::new(), vec![Vec2::ZERO, Vec2::new(0.0, -1.0), Vec2::X]);
        mesh.tangents_along_second = true;
        let hit = mesh.surface_hit(0, [0.2, 0.3]);
        assert_eq!((hit.dpdus, hit.dpdvs), (Vec3::new(0.0, 2.0, 0.0), Vec3::new(-2.0, 0.0, 0.0)));
    }

    #[test]
    fn points_of_lanes_are_points_of_single_hits() {
        let mut s = pcg32([12, 0, 1]);
        let mut random = || Vec3::new(s.random::<f32>(), s.random::<f32>(), s.random::<f32>()) * 2.0 - 1.0;
        for k in 0..400 {
            // With and without normals, texture coordinates (also degenerate ones), and tangents
            let mut mesh = TriangleMesh::new(vec![random(), random(), random()], vec![[0, 1, 2]]).unwrap();
            mesh.flip_normal = k % 2 == 0;
            if k % 3 > 0 {
                mesh.normals = [random(), random(), random()].map(Vec3::normalize).to_vec();
            }
            match k % 5 {
                0 => {}
                1 => mesh.uvs = vec![Vec2::splat(0.3); 3],
                _ => mesh.uvs = [random(), random(), random()].map(Vec3::truncate).to_vec(),
            }
            if k % 7 == 0 {
                mesh.tangents = vec![random(); 3];
            }
            match k % 11 {
                0 => mesh.indices = vec![[0, 1, 1]],
                1 if !mesh.normals.is_empty() => mesh.normals = vec![Vec3::ZERO; 3],
                _ => {}
            }
            let (uv, d) = ([random().x.abs() * 0.5, random().y.abs() * 0.5], random());

            // Computed in one of the lanes
            let (mut hits, mut coordinates) = (TriangleHits::default(), CornerCoordinates::default());
            mesh.gather_hit(0, uv, d, &mut hits, k % LANES);
            mesh.gather_coordinates(0, &mut coordinates, k % LANES);
            let mut points = [TexturedPoints::default()];
            textured_points(level(), &[hits], &[coordinates], &mut points);
            let [points] = &points;
            let (found, single) = (mesh.surface_hit_of_lane(0, uv, points, k % LANES), mesh.surface_hit(0, uv));
            assert_eq!(format!("{found:?}"), format!("{single:?}"), "{k} {mesh:?}");
            assert_eq!(lane(&points.wo, k % LANES), -d.normalize());
            let lengths = [single.dpdu, single.dpdv].map(|v| 1.0 / v.length());
            let inverse = points.inverse_lengths.map(|row| row[k % LANES]);
            assert!(inverse == lengths || inverse == [0.0; 2] && single.dpdu == tangents(single.ns)[0], "{k} {mesh:?}");
        }
    }

    #[test]
    fn rays_that_leave_a_triangle_do_not_meet_it_again() {
        let mut s = pcg32([12, 0, 0]);
        let mut random = || Vec3::new(s.random::<f32>(), s.random::<f32>(), s.random::<f32>()) * 2.0 - 1.0;
        for k in 0..200_000 {
            let (center, scale) = (random() * 300.0, [0.01, 1.0, 50.0][k % 3]);
            let mut corners = [random(), random(), random()].map(|p| center + p * scale);
            if k % 5 == 0 {
                corners.iter_mut().for_each(|p| p.y = center.y);
            }
            let mesh = TriangleMesh::new(corners.to_vec(), vec![[0, 1, 2]]).unwrap();
            let placement = Affine3A::from_scale_rotation_translation(
                Vec3::new(0.5, 2.0, 1.0),
                glam::Quat::from_axis_angle(random().normalize(), 2.0),
                random() * 20.0,
            );
            let u = random().abs();
            let [b1, b2] = if u.x + u.y > 1.0 { [1.0 - u.x, 1.0 - u.y] } else { [u.x, u.y] };
            let local = mesh.surface_hit(0, [b1, b2]);
            let hit = if k % 2 == 0 { local } else { local.transformed(&placement) };
            let w = random().normalize();
            if hit.n.dot(w).abs() < 1e-4 {
                continue;
            }
            let o = offset_origin(hit.p, hit.p_error, hit.n, w);
            let back = placement.inverse();
            let (o, d) = if k % 2 == 0 { (o, w) } else { (back.transform_point3(o), back.transform_vector3(w)) };
            let ray = RayPrecomputed::new(&Ray { o, d, t_max: f32::INFINITY, time: 0.0 }).unwrap();
            assert_eq!(intersect_triangle(&ray, mesh.triangle(0), f32::INFINITY), None, "{mesh:?} {ray:?}");
        }
    }
}
