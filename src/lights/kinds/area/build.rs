//! Area lights of a geometry: one per emissive primitive, or one for two triangles that form a rectangle.

use super::area_light::AreaLight;
use super::area_shape::AreaShape;
use super::emission::{Emission, EmissionMapping};
use super::patch::PatchLight;
use super::plane::Plane;
use super::quadric::QuadricLight;
use super::rectangle::RectangleLight;
use super::triangle::TriangleLight;
use crate::geometry::{BilinearMesh, Shape, TriangleMesh};
use lumiris_numbers::math::{Rgb, Vec2, Vec3};

/// Tolerance of right angles, of coplanarity and of parallel edges, relative to the edges.
const RECTANGLE_TOLERANCE: f32 = 1e-4;

/// The area lights of one geometry.
#[derive(Clone, Debug, Default)]
pub struct AreaLights {
    /// The lights.
    pub lights: Vec<AreaLight>,
    /// For each primitive of the geometry, the index of its light in `lights`.
    pub light_of_primitive: Vec<u32>,
}

impl AreaLights {
    fn push(&mut self, shape: AreaShape, emission: &Emission, primitives: u32) {
        let primitive = self.light_of_primitive.len() as u32;
        let index = self.lights.len() as u32;
        let plane = Plane::of(&shape);
        self.lights.push(AreaLight { shape, plane, emission: emission.clone(), primitive });
        self.light_of_primitive.extend((0..primitives).map(|_| index));
    }
}

/// Makes area lights of a shape in world space. Primitives without area become lights without power.
pub fn area_lights_of(shape: &Shape, emission: &Emission) -> AreaLights {
    let mut out = AreaLights::default();
    match shape {
        Shape::Mesh(mesh) => triangles(mesh, emission, &mut out),
        Shape::Quadric(quadric) => {
            out.push(AreaShape::Quadric(Box::new(QuadricLight::new(quadric))), emission, 1);
        }
        Shape::Bilinear(mesh) => {
            for i in 0..mesh.patch_count() {
                out.push(patch(mesh, i, emission.is_textured()), emission, 1);
            }
        }
        // The importer refuses curves that emit
        Shape::Curves(_) => {}
    }
    out
}

fn triangles(mesh: &TriangleMesh, emission: &Emission, out: &mut AreaLights) {
    let mapping = emission.image.as_ref().and_then(|image| image.mapping());
    let triangle = |i: usize| triangle(mesh, i, mapping);
    let colors = |i: usize| corner_colors(mesh, i).filter(|_| emission.has_vertex_colors);
    let mut i = 0;
    while i < mesh.triangle_count() {
        let corners = colors(i);
        // One colour is a factor of the emission
        let color = corners.map_or(Some(Rgb::WHITE), |[a, b, c]| (a == b && a == c).then_some(a));
        let colored = Emission { l: emission.l * color.unwrap_or(Rgb::WHITE), ..emission.clone() };
        let pair = (i + 1 < mesh.triangle_count() && color.is_some() && colors(i + 1) == corners)
            .then(|| rectangle_of_pair(&triangle(i), &triangle(i + 1), emission.image.is_some()))
            .flatten();
        match pair {
            Some(rectangle) => {
                out.push(AreaShape::Rectangle(rectangle), &colored, 2);
                i += 2;
            }
            None => {
                let colors = corners.filter(|_| color.is_none()).map(Box::new);
                out.push(AreaShape::Triangle(TriangleLight { colors, ..triangle(i) }), &colored, 1);
                i += 1;
            }
        }
    }
}

/// Colours of the corners of triangle `i`, if the mesh has any.
fn corner_colors(mesh: &TriangleMesh, i: usize) -> Option<[Rgb; 3]> {
    let color = |v: u32| mesh.colors.get(v as usize).map(|[r, g, b, _]| Rgb::new(*r, *g, *b).map(|c| c.max(0.0)));
    let [a, b, c] = mesh.indices[i];
    Some([color(a)?, color(b)?, color(c)?])
}

/// Triangle `i`. Vertex normals, if there are any, decide the emitting side, as in pbrt-v4.
fn triangle(mesh: &TriangleMesh, i: usize, mapping: Option<&EmissionMapping>) -> TriangleLight {
    let vertices = mesh.indices[i].map(|v| v as usize);
    let all = if mapping.is_some_and(|m| m.second) { &mesh.uvs1 } else { &mesh.uvs };
    let uvs =
        if all.is_empty() { [Vec2::ZERO, Vec2::new(1.0, 0.0), Vec2::new(1.0, 1.0)] } else { vertices.map(|v| all[v]) };
    let uvs = mapping.map_or(uvs, |m| uvs.map(|uv| m.image_from_uv.transform_point2(uv)));
    let mut light = TriangleLight::new(mesh.triangle(i), mesh.flip_normal, uvs);
    if !mesh.normals.is_empty() {
        let ns: Vec3 = vertices.iter().map(|&v| mesh.normals[v]).sum();
        if ns.dot(light.n) < 0.0 {
            light.n = -light.n;
        }
    }
    light
}

/// The rectangle formed by two triangles with a common edge; `None` if they form none.
fn rectangle_of_pair(a: &TriangleLight, b: &TriangleLight, textured: bool) -> Option<RectangleLight> {
    if a.area <= 0.0 || b.area <= 0.0 || a.n.dot(b.n) < 1.0 - RECTANGLE_TOLERANCE {
        return None;
    }

    // The corner is the vertex of `a` that `b` lacks; the diagonal is the shared edge.
    let lacks = |t: &TriangleLight, p: Vec3| !t.p.contains(&p);
    let apex_a = (0..3).find(|&i| lacks(b, a.p[i]))?;
    let apex_b = (0..3).find(|&i| lacks(a, b.p[i]))?;
    let (s, t) = ((apex_a + 1) % 3, (apex_a + 2) % 3);
    let in_b = |p: Vec3| (0..3).find(|&i| i != apex_b && b.p[i] == p);
    let (s_in_b, t_in_b) = (in_b(a.p[s])?, in_b(a.p[t])?);

    let rectangle = rectangle([a.p[apex_a], a.p[s], a.p[t], b.p[apex_b]], a.n, [a.uvs[apex_a], a.uvs[s], a.uvs[t]])?;
    let uvs_fit = a.uvs[s] == b.uvs[s_in_b]
        && a.uvs[t] == b.uvs[t_in_b]
        && (a.uvs[s] + a.uvs[t] - a.uvs[apex_a] - b.uvs[apex_b]).abs().max_element() <= 1e-5;
    (uvs_fit || !textured).then_some(rectangle)
}

/// The rectangle with the corners `[p, p + x, p + y, p + x + y]`; `None` if they form none.
fn rectangle(corners: [Vec3; 4], n: Vec3, uvs: [Vec2; 3]) -> Option<RectangleLight> {
    let [p, px, py, pxy] = corners.map(|p| p.as_dvec3());
    let (x, y) = (px - p, py - p);
    let (width, height) = (x.length(), y.length());
    let flatness_error = (pxy - (px + py - p)).length();
    let tolerance = f64::from(RECTANGLE_TOLERANCE);
    let is_rectangle = width > 0.0
        && height > 0.0
        && x.dot(y).abs() <= tolerance * width * height
        && flatness_error <= tolerance * width.min(height);

    // The edges are perpendicular and the fourth corner is in the plane, within the tolerance
    is_rectangle.then(|| RectangleLight {
        corner: corners[0],
        ex: (x / width).as_vec3(),
        ey: (y / height).as_vec3(),
        size: Vec2::new(width as f32, height as f32),
        n,
        flatness_error: flatness_error as f32,
        uvs,
    })
}

fn patch(mesh: &BilinearMesh, i: usize, textured: bool) -> AreaShape {
    let vertices = mesh.indices[i].map(|v| v as usize);
    let corners = vertices.map(|v| mesh.positions[v]);
    let uvs =
        if mesh.uvs.is_empty() { [Vec2::ZERO, Vec2::X, Vec2::Y, Vec2::ONE] } else { vertices.map(|v| mesh.uvs[v]) };
    let light = PatchLight::new(corners, orientation(mesh, i), uvs);
    let uvs_fit = (uvs[1] + uvs[2] - uvs[0] - uvs[3]).abs().max_element() <= 1e-5;
    let has_its_uvs = uvs_fit || !textured;
    let flat = has_its_uvs.then(|| rectangle(corners, light.mean_normal(), [uvs[0], uvs[1], uvs[2]])).flatten();
    flat.map_or_else(|| AreaShape::Patch(Box::new(light)), AreaShape::Rectangle)
}

/// True if patch `i` emits on the reverse of ∂p/∂u × ∂p/∂v. Vertex normals decide, if there are any.
fn orientation(mesh: &BilinearMesh, i: usize) -> bool {
    if mesh.normals.is_empty() {
        return mesh.flip_normal;
    }
    let vertices = mesh.indices[i].map(|v| v as usize);
    let [p00, p10, p01, p11] = vertices.map(|v| mesh.positions[v]);
    let ns: Vec3 = vertices.iter().map(|&v| mesh.normals[v]).sum();
    let n = (p10 - p00 + p11 - p01).cross(p01 - p00 + p11 - p10);
    if ns == Vec3::ZERO { mesh.flip_normal } else { n.dot(ns) < 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn quad(corner: Vec3, x: Vec3, y: Vec3, order: [[u32; 3]; 2]) -> TriangleMesh {
        TriangleMesh::new(vec![corner, corner + x, corner + x + y, corner + y], order.to_vec()).unwrap()
    }

    fn lights(mesh: TriangleMesh) -> AreaLights {
        area_lights_of(&Shape::Mesh(mesh), &Emission::constant(lumiris_numbers::math::Rgb::WHITE))
    }

    #[test]
    fn two_triangles_of_a_rectangle_become_one_light() {
        let (x, y) = (Vec3::new(2.0, 0.0, 0.0), Vec3::new(0.0, 0.0, 3.0));
        for order in [[[0, 1, 2], [0, 2, 3]], [[1, 2, 0], [3, 0, 2]], [[0, 1, 3], [1, 2, 3]], [[2, 0, 1], [2, 3, 0]]] {
            let out = lights(quad(Vec3::ONE, x, y, order));
            assert_eq!(out.light_of_primitive, [0, 0]);
            let AreaShape::Rectangle(r) = &out.lights[0].shape else { panic!("{:?}", out.lights[0].shape) };
            assert!((r.area() - 6.0).abs() < 1e-5);
            assert!((r.n - Vec3::NEG_Y).length() < 1e-6);
            let b = r.bounds();
            assert!((b.min - Vec3::ONE).length() < 1e-5 && (b.max - Vec3::new(3.0, 1.0, 4.0)).length() < 1e-5);
        }
    }

    #[test]
    fn what_is_no_rectangle_stays_triangles() {
        let (x, y) = (Vec3::new(2.0, 0.0, 0.0), Vec3::new(0.0, 0.0, 3.0));
        let sheared = quad(Vec3::ZERO, x, y + x * 0.01, [[0, 1, 2], [0, 2, 3]]);
        let opposed = quad(Vec3::ZERO, x, y, [[0, 1, 2], [0, 3, 2]]);
        let mut bent = vec![Vec3::ZERO, x, x + y + Vec3::Y * 0.01, y];
        let bent_mesh = TriangleMesh::new(bent.clone(), vec![[0, 1, 2], [0, 2, 3]]).unwrap();
        bent[2] = x + y * 1.1;
        let trapezoid = TriangleMesh::new(bent, vec![[0, 1, 2], [0, 2, 3]]).unwrap();
        let doubled = quad(Vec3::ZERO, x, y, [[0, 1, 2], [0, 1, 2]]);
        for mesh in [sheared, opposed, bent_mesh, trapezoid, doubled] {
            assert_eq!(lights(mesh).light_of_primitive, [0, 1]);
        }
    }

    #[test]
    fn triangles_without_area_have_no_power_and_break_no_pairs() {
        let p = vec![Vec3::ZERO, Vec3::X, Vec3::X + Vec3::Z, Vec3::Z];
        let mesh = TriangleMesh::new(p, vec![[0, 0, 1], [0, 1, 2], [0, 2, 3], [1, 1, 1]]).unwrap();
        let out = lights(mesh);
        assert_eq!(out.light_of_primitive, [0, 1, 1, 2]);
        let powers: Vec<bool> = out.lights.iter().map(|l| l.power_luminance() > 0.0).collect();
        assert_eq!(powers, [false, true, false]);
        assert_eq!(out.lights[2].primitive, 3);
    }

    #[test]
    fn a_rectangular_patch_is_a_rectangle_and_vertex_normals_orient() {
        let positions = vec![Vec3::ZERO, Vec3::X, Vec3::Y * 2.0, Vec3::X + Vec3::Y * 2.0];
        let mut mesh = BilinearMesh { positions, indices: vec![[0, 1, 2, 3]], ..BilinearMesh::default() };
        let normal = |mesh: &BilinearMesh| {
            let out =
                area_lights_of(&Shape::Bilinear(mesh.clone()), &Emission::constant(lumiris_numbers::math::Rgb::WHITE));
            let AreaShape::Rectangle(r) = &out.lights[0].shape else { panic!() };
            r.n
        };
        assert_eq!(normal(&mesh), Vec3::Z);
        mesh.flip_normal = true;
        assert_eq!(normal(&mesh), -Vec3::Z);
        mesh.normals = vec![Vec3::Z; 4];
        assert_eq!(normal(&mesh), Vec3::Z);
    }
}
