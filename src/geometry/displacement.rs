//! Displacement: a mesh is refined until its edges are short, then its vertices are displaced along their normals [Cook
//! 1984].

use lumiris_numbers::math::{Vec2, Vec3};
use std::collections::HashMap;

/// Maximum number of triangles.
pub const MAX_TRIANGLES: usize = 1 << 27;

/// A mesh with normals and texture coordinates at its vertices.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DisplacedMesh {
    /// Positions.
    pub positions: Vec<Vec3>,
    /// Unit normals.
    pub normals: Vec<Vec3>,
    /// Texture coordinates.
    pub uvs: Vec<Vec2>,
    /// Triangles; indices are in range.
    pub indices: Vec<[u32; 3]>,
}

impl DisplacedMesh {
    /// A mesh of these vertices; without normals it gets smooth ones.
    ///
    /// Returns `Err` with a message if it is invalid.
    pub fn new(
        positions: Vec<Vec3>,
        normals: Vec<Vec3>,
        uvs: Vec<Vec2>,
        indices: Vec<[u32; 3]>,
    ) -> Result<Self, String> {
        let count = positions.len();
        if uvs.len() != count {
            return Err("a mesh needs texture coordinates to be displaced".to_owned());
        }
        if let Some((i, t)) = indices.iter().enumerate().find(|(_, t)| t.iter().any(|&v| v as usize >= count)) {
            return Err(format!("triangle {i} refers to vertices {t:?}, but there are {count} vertices"));
        }

        // Unit normals, given or smooth
        let mut mesh = DisplacedMesh { positions, normals, uvs, indices };
        if mesh.normals.len() == count {
            mesh.normals.iter_mut().for_each(|n| *n = n.normalize_or_zero());
        } else {
            mesh.normals = mesh.smooth_normals();
        }
        Ok(mesh)
    }

    /// Splits the longest edges of triangles in half until `length` of all edges is at most `longest`. Triangles that
    /// share an edge split it at the same vertex, so that there are no gaps.
    ///
    /// Returns `Err` with a message if there would be more than `most` triangles.
    pub fn refine(&mut self, length: impl Fn(Vec3, Vec3) -> f32, longest: f32, most: usize) -> Result<(), String> {
        let sides = |[a, b, c]: [u32; 3]| {
            let of = |i: u32, j: u32| length(self.positions[i as usize], self.positions[j as usize]);
            [of(a, b), of(b, c), of(c, a)]
        };
        // An equilateral triangle has the maximum area for its longest edge
        let area: f64 = self.indices.iter().map(|&t| area_of(sides(t))).sum();
        let too_many = || format!("edges of at most {longest} make more than {most} triangles");
        if area / (0.25 * 3.0_f64.sqrt() * f64::from(longest) * f64::from(longest)) > most as f64 {
            return Err(too_many());
        }
        let mut open = std::mem::take(&mut self.indices);
        open.reverse();
        let mut middles: HashMap<[u32; 2], u32> = HashMap::new();
        while let Some([a, b, c]) = open.pop() {
            let of = |i: u32, j: u32| length(self.positions[i as usize], self.positions[j as usize]);
            let lengths = [of(a, b), of(b, c), of(c, a)];
            let side = (0..3).fold(0, |best, i| if lengths[i] > lengths[best] { i } else { best });
            // NaN also ends the refinement
            if !(lengths[side] > longest && lengths[side].is_finite()) {
                self.indices.push([a, b, c]);
                continue;
            }
            if self.indices.len() + open.len() >= most {
                return Err(too_many());
            }
            let [i, j, k] = [[a, b, c], [b, c, a], [c, a, b]][side];
            let middle = *middles.entry([i.min(j), i.max(j)]).or_insert_with(|| {
                let [x, y] = [i as usize, j as usize];
                self.positions.push((self.positions[x] + self.positions[y]) * 0.5);
                self.normals.push((self.normals[x] + self.normals[y]).normalize_or(self.normals[x]));
                self.uvs.push((self.uvs[x] + self.uvs[y]) * 0.5);
                (self.positions.len() - 1) as u32
            });
            open.extend([[middle, j, k], [i, middle, k]]);
        }
        Ok(())
    }

    /// Displaces each vertex along its normal by `height` of its position, normal and texture coordinates, and
    /// recomputes the normals.
    pub fn displace(&mut self, height: impl Fn(Vec3, Vec3, Vec2) -> f32) {
        for ((p, n), uv) in self.positions.iter_mut().zip(&self.normals).zip(&self.uvs) {
            let moved = *p + *n * height(*p, *n, *uv);
            if moved.is_finite() {
                *p = moved;
            }
        }
        let normals = self.smooth_normals();
        // Keep the side of the previous normals, which may be opposite to the corners' order
        for (n, new) in self.normals.iter_mut().zip(normals) {
            *n = if new == Vec3::ZERO { *n } else { new * 1.0_f32.copysign(new.dot(*n)) };
        }
    }

    /// Mean normals of the triangles around each vertex, weighted by area, on the side of (p1 − p0) × (p2 − p0).
    fn smooth_normals(&self) -> Vec<Vec3> {
        let mut sums = vec![Vec3::ZERO; self.positions.len()];
        for t in &self.indices {
            let [a, b, c] = t.map(|v| self.positions[v as usize]);
            let n = (b - a).cross(c - a);
            t.iter().for_each(|&v| sums[v as usize] += n);
        }
        sums.iter().map(|n| n.normalize_or_zero()).collect()
    }
}

/// The area of a triangle by its sides (Heron); 0 if they form none.
fn area_of(sides: [f32; 3]) -> f64 {
    let [a, b, c] = sides.map(f64::from);
    let s = 0.5 * (a + b + c);
    let squared = s * (s - a) * (s - b) * (s - c);
    if squared > 0.0 { squared.sqrt() } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two triangles over 0..4 × 0..1.
    fn sheet() -> DisplacedMesh {
        let corners = [[0.0, 0.0], [4.0, 0.0], [4.0, 1.0], [0.0, 1.0]].map(|[x, y]| Vec3::new(x, y, 0.0));
        let uvs = corners.map(|p| Vec2::new(p.x / 4.0, p.y));
        DisplacedMesh::new(corners.to_vec(), Vec::new(), uvs.to_vec(), vec![[0, 1, 2], [0, 2, 3]]).unwrap()
    }

    #[test]
    fn refined_meshes_cover_the_same_without_gaps() {
        let mut mesh = sheet();
        mesh.refine(Vec3::distance, 0.11, 10_000).unwrap();
        let (mut area, mut edges) = (0.0, HashMap::new());
        for t in &mesh.indices {
            let [a, b, c] = t.map(|v| mesh.positions[v as usize]);
            area += f64::from((b - a).cross(c - a).z) / 2.0;
            assert!([(a, b), (b, c), (c, a)].iter().all(|(p, q)| p.distance(*q) <= 0.11));
            for [i, j] in [[t[0], t[1]], [t[1], t[2]], [t[2], t[0]]] {
                *edges.entry([i.min(j), i.max(j)]).or_insert(0) += 1;
            }
        }
        assert!((area - 4.0).abs() < 1e-4, "{area}");
        // An edge of only one triangle lies on the border
        for ([i, j], _) in edges.iter().filter(|(_, n)| **n == 1) {
            let [p, q] = [*i, *j].map(|v| mesh.positions[v as usize]);
            let at = |f: fn(Vec3) -> f32, x: f32| f(p) == x && f(q) == x;
            assert!(at(|p| p.x, 0.0) || at(|p| p.x, 4.0) || at(|p| p.y, 0.0) || at(|p| p.y, 1.0), "{p} {q}");
        }
        assert!(edges.values().all(|n| *n <= 2));
        assert!(mesh.positions.iter().zip(&mesh.uvs).all(|(p, uv)| Vec2::new(p.x / 4.0, p.y).distance(*uv) < 1e-6));
    }

    #[test]
    fn vertices_move_along_normals_which_follow_the_new_surface() {
        let mut mesh = sheet();
        mesh.refine(Vec3::distance, 0.05, 100_000).unwrap();
        mesh.displace(|_, _, uv| (uv.x * 4.0).sin());
        for (p, n) in mesh.positions.iter().zip(&mesh.normals) {
            assert!((p.z - p.x.sin()).abs() < 1e-5, "{p}");
            let expected = Vec3::new(-p.x.cos(), 0.0, 1.0).normalize();
            assert!(n.dot(expected) > 0.998, "{p} {n}");
        }
        // Normals of the opposite side displace vertices to that side, and remain there
        let mut mesh = sheet();
        mesh.normals.iter_mut().for_each(|n| *n = -*n);
        mesh.displace(|_, _, _| 0.5);
        assert!(mesh.positions.iter().all(|p| p.z == -0.5) && mesh.normals.iter().all(|n| *n == Vec3::NEG_Z));
    }

    #[test]
    fn what_cannot_be_displaced_is_an_error() {
        let error = |uvs: usize, index| {
            let made = DisplacedMesh::new(vec![Vec3::ZERO; 3], Vec::new(), vec![Vec2::ZERO; uvs], vec![[0, 1, index]]);
            made.unwrap_err()
        };
        assert!(error(0, 2).contains("texture coordinates") && error(3, 3).contains("3 vertices"));
        let mut mesh = sheet();
        assert!(mesh.refine(|_, _| 2.0, 1.0, 1000).unwrap_err().contains("triangles"));
        let mut mesh = sheet();
        mesh.refine(|_, _| f32::NAN, 1.0, 1000).unwrap();
        mesh.displace(|_, _, _| f32::NAN);
        assert_eq!(mesh.positions, sheet().positions);
    }
}
