//! Loop subdivision to limit positions and limit normals: pbrt's `loopsubdiv` [Loop 1987; Hoppe et al. 1994].
//!
//! The mesh is stored as links: a face (v, a, b) gives v the link a → b. The links of a vertex form its ring of
//! neighbours, counter-clockwise if faces are. A manifold vertex has exactly one chain, closed or open.

use super::mesh::TriangleMesh;
use lumiris_numbers::math::Vec3;
use std::f32::consts::{PI, TAU};

/// Maximum number of triangles.
const MAX_TRIANGLES: u64 = 1 << 28;

/// The limit surface of a control mesh after `levels` subdivisions, as triangles with shading normals.
///
/// Normals are on the side of (p1 − p0) × (p2 − p0) of the faces.
///
/// Returns `Err` with a message if the mesh is not an oriented manifold, possibly with boundary, or would become too
/// large.
pub fn loop_subdivide(levels: u32, positions: Vec<Vec3>, indices: Vec<[u32; 3]>) -> Result<TriangleMesh, String> {
    let count = 4_u64.checked_pow(levels).and_then(|n| n.checked_mul(indices.len() as u64));
    if count.is_none_or(|n| n > MAX_TRIANGLES) {
        return Err(format!("{levels} levels of subdivision of {} triangles are too many triangles", indices.len()));
    }
    let mut mesh = ControlMesh { positions, faces: indices };
    let mut links = Links::new(&mesh.faces, mesh.positions.len())?;
    for _ in 0..levels {
        mesh = subdivide(&links, &mesh)?;
        links = Links::new(&mesh.faces, mesh.positions.len())?;
    }
    let ControlMesh { positions, faces } = mesh;

    // Move the vertices to the limit surface.
    let mut limit = Vec::with_capacity(positions.len());
    let mut normals = Vec::with_capacity(positions.len());
    for (v, &p) in positions.iter().enumerate() {
        let ring = links.ring(v as u32)?.positions(&positions);
        limit.push(ring.blend(p, Rule::Limit));
        normals.push(ring.limit_normal(p));
    }
    let mut mesh = TriangleMesh::new(limit, faces)?;
    mesh.normals = normals;
    Ok(mesh)
}

struct ControlMesh {
    positions: Vec<Vec3>,
    faces: Vec<[u32; 3]>,
}

/// One level of subdivision: four triangles for one.
fn subdivide(links: &Links, ControlMesh { positions, faces }: &ControlMesh) -> Result<ControlMesh, String> {
    // Even vertices keep their indices.
    let mut refined = Vec::with_capacity(positions.len() * 4);
    for (v, &p) in positions.iter().enumerate() {
        refined.push(links.ring(v as u32)?.positions(positions).blend(p, Rule::Refine));
    }

    // One new vertex per edge, numbered in the order of the links; the link with the smaller start owns an inner edge.
    let mut edge_vertex = vec![0_u32; links.links.len()];
    for (k, &[v, a, b]) in links.links.iter().enumerate() {
        let [v_pos, a_pos, b_pos] = [v, a, b].map(|i| positions[i as usize]);
        match links.find(a, v) {
            Some(twin) if v > a => edge_vertex[k] = edge_vertex[twin],
            Some(twin) => {
                edge_vertex[k] = refined.len() as u32;
                let opposite = positions[links.links[twin][2] as usize];
                refined.push((v_pos + a_pos) * 0.375 + (b_pos + opposite) * 0.125);
            }
            None => {
                edge_vertex[k] = refined.len() as u32;
                refined.push((v_pos + a_pos) * 0.5);
            }
        }
    }

    let mid = |v: u32, a: u32| edge_vertex[links.find(v, a).expect("every edge of a face has its link")];
    let split = faces.iter().flat_map(|&[a, b, c]| {
        let (ab, bc, ca) = (mid(a, b), mid(b, c), mid(c, a));
        [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
    });
    Ok(ControlMesh { faces: split.collect(), positions: refined })
}

/// The links [v, a, b] of all corners, sorted, so that the links of a vertex are contiguous.
struct Links {
    links: Vec<[u32; 3]>,
    /// Index of the first link of each vertex, with one additional entry at the end.
    starts: Vec<usize>,
}

impl Links {
    fn new(faces: &[[u32; 3]], vertex_count: usize) -> Result<Self, String> {
        for (i, f) in faces.iter().enumerate() {
            if f.iter().any(|&v| v as usize >= vertex_count) {
                return Err(format!("triangle {i} refers to vertices {f:?}, but there are {vertex_count} vertices"));
            }
            if f[0] == f[1] || f[1] == f[2] || f[2] == f[0] {
                return Err(format!("triangle {i} has the vertices {f:?}: two are the same"));
            }
        }

        // Every directed edge has at most one triangle
        let mut links: Vec<[u32; 3]> = faces.iter().flat_map(|&[a, b, c]| [[a, b, c], [b, c, a], [c, a, b]]).collect();
        links.sort_unstable();
        if let Some(pair) = links.windows(2).find(|w| w[0][..2] == w[1][..2]) {
            let [v, a, _] = pair[0];
            return Err(format!(
                "the edge from vertex {v} to vertex {a} has two triangles on one side: not manifold, or not oriented alike"
            ));
        }

        // Index of the links by vertex
        let mut starts = vec![0; vertex_count + 1];
        for link in &links {
            starts[link[0] as usize + 1] += 1;
        }
        for v in 0..vertex_count {
            starts[v + 1] += starts[v];
        }
        Ok(Links { links, starts })
    }

    /// Index of the link of `v` that starts at `a`.
    fn find(&self, v: u32, a: u32) -> Option<usize> {
        let start = self.starts[v as usize];
        let of_vertex = &self.links[start..self.starts[v as usize + 1]];
        of_vertex.binary_search_by_key(&a, |link| link[1]).ok().map(|k| start + k)
    }

    /// The neighbours of `v` in order.
    fn ring(&self, v: u32) -> Result<Ring<u32>, String> {
        let of_vertex = &self.links[self.starts[v as usize]..self.starts[v as usize + 1]];
        let Some(&[_, any, _]) = of_vertex.first() else {
            return Ok(Ring { neighbours: Vec::new(), boundary: false });
        };
        // The neighbour at the boundary that only starts a link. An edge v–a ends a link if the reverse edge (a, v)
        // exists.
        let open_start = of_vertex.iter().map(|link| link[1]).find(|&a| self.find(a, v).is_none());
        let boundary = open_start.is_some();
        let mut neighbours = vec![open_start.unwrap_or(any)];
        for _ in 0..of_vertex.len() {
            let Some(k) = self.find(v, *neighbours.last().expect("never empty")) else { break };
            neighbours.push(self.links[k][2]);
        }
        if !boundary {
            neighbours.pop();
        }
        // A second chain remains if two fans share the vertex.
        let complete = neighbours.len() == of_vertex.len() + usize::from(boundary);
        let closed = boundary
            || self
                .find(v, *neighbours.last().expect("never empty"))
                .is_some_and(|k| self.links[k][2] == neighbours[0]);
        let distinct = {
            let mut sorted = neighbours.clone();
            sorted.sort_unstable();
            sorted.windows(2).all(|w| w[0] != w[1])
        };
        if !(complete && closed && distinct) {
            return Err(format!("vertex {v} joins several fans of triangles: not manifold"));
        }
        Ok(Ring { neighbours, boundary })
    }
}

/// The neighbours of a vertex in order; on a boundary the first and the last are its boundary neighbours.
struct Ring<T> {
    neighbours: Vec<T>,
    boundary: bool,
}

/// The kind of weights.
#[derive(Clone, Copy)]
enum Rule {
    /// Even vertices of a level.
    Refine,
    /// The limit surface.
    Limit,
}

impl Ring<u32> {
    fn positions(&self, positions: &[Vec3]) -> Ring<Vec3> {
        let neighbours = self.neighbours.iter().map(|&v| positions[v as usize]).collect();
        Ring { neighbours, boundary: self.boundary }
    }
}

impl Ring<Vec3> {
    /// The new position of the vertex at `p`.
    fn blend(&self, p: Vec3, rule: Rule) -> Vec3 {
        let ring = &self.neighbours;
        let valence = ring.len() as f32;
        if ring.is_empty() {
            return p;
        }
        if self.boundary {
            let weight = match rule {
                Rule::Refine => 1.0 / 8.0,
                // The limit of the boundary, a cubic B-spline.
                Rule::Limit => 1.0 / 6.0,
            };
            return p * (1.0 - 2.0 * weight) + (ring[0] + ring[ring.len() - 1]) * weight;
        }
        let beta = if ring.len() == 3 { 3.0 / 16.0 } else { 3.0 / (8.0 * valence) };
        let weight = match rule {
            Rule::Refine => beta,
            Rule::Limit => 1.0 / (valence + 3.0 / (8.0 * beta)),
        };
        p * (1.0 - valence * weight) + ring.iter().sum::<Vec3>() * weight
    }

    /// The unit normal of the limit surface at the vertex, from its two tangent masks; +z where it is undefined.
    fn limit_normal(&self, p: Vec3) -> Vec3 {
        let ring = &self.neighbours;
        let n = ring.len();
        let normal = match (self.boundary, n) {
            (_, 0) => Vec3::ZERO,
            (false, _) => {
                let step = TAU / n as f32;
                let (s, t) = ring.iter().enumerate().fold((Vec3::ZERO, Vec3::ZERO), |(s, t), (j, &q)| {
                    let (sin, cos) = (step * j as f32).sin_cos();
                    (s + (q - p) * cos, t + (q - p) * sin)
                });
                s.cross(t)
            }
            (true, _) => self.inward_tangent(p).cross(ring[n - 1] - ring[0]),
        };
        normal.try_normalize().unwrap_or(Vec3::Z)
    }

    /// The tangent of a boundary vertex across the boundary, into the surface.
    fn inward_tangent(&self, p: Vec3) -> Vec3 {
        let ring = &self.neighbours;
        match ring[..] {
            [a, b] => a + b - p * 2.0,
            [_, b, _] => b - p,
            [a, b, c, d] => (b + c) * 2.0 - a - d - p * 2.0,
            _ => {
                let n = ring.len();
                let theta = PI / (n - 1) as f32;
                let ends = (ring[0] + ring[n - 1]) * theta.sin();
                let inner = (1..n - 1).map(|k| ring[k] * (theta * k as f32).sin()).sum::<Vec3>();
                inner * (2.0 - 2.0 * theta.cos()) - ends
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashMap;

    fn tetrahedron() -> (Vec<Vec3>, Vec<[u32; 3]>) {
        let p = [[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]];
        (p.map(Vec3::from).to_vec(), vec![[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]])
    }

    fn octahedron() -> (Vec<Vec3>, Vec<[u32; 3]>) {
        let p = vec![Vec3::X, Vec3::Y, -Vec3::X, -Vec3::Y, Vec3::Z, -Vec3::Z];
        let upper = (0..4).map(|k| [k, (k + 1) % 4, 4]);
        let lower = (0..4).map(|k| [(k + 1) % 4, k, 5]);
        (p, upper.chain(lower).collect())
    }

    fn grid(n: u32) -> (Vec<Vec3>, Vec<[u32; 3]>) {
        let p = (0..=n).flat_map(|j| (0..=n).map(move |i| Vec3::new(i as f32, j as f32, 0.0))).collect();
        let faces = (0..n).flat_map(|j| {
            (0..n).flat_map(move |i| {
                let v = j * (n + 1) + i;
                [[v, v + 1, v + n + 2], [v, v + n + 2, v + n + 1]]
            })
        });
        (p, faces.collect())
    }

    fn assert_closed(mesh: &TriangleMesh) {
        let mut edges = HashMap::new();
        for t in &mesh.indices {
            for k in 0..3 {
                *edges.entry((t[k], t[(k + 1) % 3])).or_insert(0) += 1;
            }
        }
        assert!(edges.iter().all(|(&(a, b), &n)| n == 1 && edges.contains_key(&(b, a))));
    }

    #[test]
    fn closed_meshes_stay_closed_with_outward_normals() {
        for (p, f) in [tetrahedron(), octahedron()] {
            let mesh = loop_subdivide(3, p, f.clone()).unwrap();
            assert_eq!(mesh.triangle_count(), f.len() * 64);
            assert_closed(&mesh);
            for (i, t) in mesh.indices.iter().enumerate() {
                let [a, b, c] = mesh.triangle(i);
                let face = (b - a).cross(c - a).normalize();
                assert!(face.dot(a) > 0.0);
                for &v in t {
                    assert!(mesh.normals[v as usize].dot(face) > 0.8, "{}", mesh.normals[v as usize].dot(face));
                }
            }
        }
    }

    #[test]
    fn limit_positions_do_not_depend_on_the_level() {
        for (p, f) in [tetrahedron(), octahedron(), grid(3)] {
            let coarse = loop_subdivide(1, p.clone(), f.clone()).unwrap();
            let fine = loop_subdivide(4, p.clone(), f).unwrap();
            // Even vertices keep their indices, so the vertices of the coarse mesh are in both.
            for v in 0..coarse.positions().len() {
                assert!((coarse.positions()[v] - fine.positions()[v]).length() < 1e-5, "vertex {v}");
                assert!((coarse.normals[v] - fine.normals[v]).length() < 1e-2, "vertex {v}");
            }
        }
    }

    #[test]
    fn limit_normals_are_those_of_the_fine_faces() {
        let (p, f) = octahedron();
        let mesh = loop_subdivide(5, p, f).unwrap();
        for (i, t) in mesh.indices.iter().enumerate() {
            let [a, b, c] = mesh.triangle(i);
            let face = (b - a).cross(c - a).normalize();
            // Valence 4 converges slowly: its faces still deviate by 11° at this level.
            assert!(t.iter().all(|&v| mesh.normals[v as usize].dot(face) > 0.98));
        }
    }

    #[test]
    fn flat_sheets_stay_flat_and_keep_their_boundary_straight() {
        let (p, f) = grid(4);
        let mesh = loop_subdivide(2, p, f).unwrap();
        assert!(mesh.positions().iter().all(|p| p.z == 0.0));
        for n in &mesh.normals {
            assert!((*n - Vec3::Z).length() < 1e-5, "{n}");
        }
        // The corners are rounded as the cubic B-spline of the boundary polygon; the sides remain on it.
        assert!(mesh.positions().iter().any(|p| p.y == 0.0 && (p.x - 2.0).abs() < 1e-6));
        assert!(mesh.positions().iter().all(|p| p.min_element() >= 0.0 && p.max_element() <= 4.0));
    }

    #[test]
    fn a_boundary_fan_of_high_valence_has_its_normal_up() {
        for n in 2..9_u32 {
            let rim = (0..=n).map(|k| {
                let (sin, cos) = (PI * k as f32 / n as f32).sin_cos();
                Vec3::new(cos, sin, 0.0)
            });
            let p: Vec<Vec3> = std::iter::once(Vec3::ZERO).chain(rim).collect();
            let mesh = loop_subdivide(0, p, (1..=n).map(|k| [0, k, k + 1]).collect()).unwrap();
            assert!(mesh.normals.iter().all(|v| (*v - Vec3::Z).length() < 1e-4), "{n}: {:?}", mesh.normals);
        }
    }

    #[test]
    fn bad_meshes_are_errors() {
        let p: Vec<Vec3> = (0..8).map(|i| Vec3::new(i as f32, (i * i) as f32, 0.0)).collect();
        let run = |f: Vec<[u32; 3]>| loop_subdivide(2, p.clone(), f);
        assert!(run(vec![[0, 1, 9]]).unwrap_err().contains("refers to"));
        assert!(run(vec![[0, 1, 1]]).unwrap_err().contains("the same"));
        assert!(run(vec![[0, 1, 2], [0, 1, 3]]).unwrap_err().contains("not manifold"));
        assert!(run(vec![[0, 1, 2], [0, 1, 2]]).is_err());
        assert!(run(vec![[0, 1, 2], [1, 0, 3], [0, 1, 4]]).is_err());
        // Two fans at vertex 0, open and closed.
        assert!(run(vec![[0, 1, 2], [0, 3, 4]]).unwrap_err().contains("fans"));
        let closed = |a: u32, b: u32, c: u32| vec![[0, a, b], [0, b, c], [0, c, a], [a, c, b]];
        assert!(run([closed(1, 2, 3), closed(4, 5, 6)].concat()).unwrap_err().contains("fans"));
        assert!(loop_subdivide(40, p.clone(), vec![[0, 1, 2]]).is_err());
        // Unused vertices and empty meshes are fine.
        assert_eq!(run(vec![[0, 1, 3]]).unwrap().triangle_count(), 16);
        assert_eq!(run(vec![]).unwrap().triangle_count(), 0);
    }
}
