//! A statue of fine detail: a dragon on a carved column ([`dragon`](super::dragon)), meshed at a resolution of choice.
//!
//! The distance of the statue is the smooth minimum over its carved parts. In a ball of radius R only those strokes
//! matter whose distance from its centre is within 2LR + amplitudes + fillets of the least, L the bound of
//! [`solids`](super::solids); the others would not change a bit of the result.

use super::dragon;
use super::nets::{Ball, Field, Grid, mesh_field};
use super::solids::{LIPSCHITZ, Part, Shape, smooth_min};
use crate::geometry::TriangleMesh;
use crate::math::Vec3;

/// Default of [`StatueOptions::detail`].
pub const DEFAULT_DETAIL: u32 = 520;

/// How the statue is made.
#[derive(Clone, Copy, Debug)]
pub struct StatueOptions {
    /// Cells of the grid along its height, 8..=4096. The number of triangles grows with its square.
    pub detail: u32,
    /// Whether vertices have normals.
    pub normals: bool,
}

impl Default for StatueOptions {
    fn default() -> Self {
        StatueOptions { detail: DEFAULT_DETAIL, normals: true }
    }
}

/// The mesh of the statue: closed, z up, on the plane z = 0, [`dragon::HEIGHT`] high. `Err` with a message if the
/// options are out of range.
pub fn statue(options: &StatueOptions) -> Result<TriangleMesh, String> {
    if !(8..=4096).contains(&options.detail) {
        return Err(format!("the detail of the statue must be 8 to 4096, not {}", options.detail));
    }
    let field = StatueField { parts: dragon::parts() };
    let cell = dragon::HEIGHT / options.detail as f32;
    let pad = Vec3::splat(2.5 * cell);
    let mut mesh = mesh_field(&field, &Grid::new(dragon::LOW - pad, dragon::HIGH + pad, cell))?;
    if !options.normals {
        mesh.normals = Vec::new();
    }
    Ok(mesh)
}

/// The distance of the statue.
struct StatueField {
    parts: Vec<Part>,
}

/// The parts that matter in a ball, in order, with their strokes.
struct Near {
    parts: Vec<(u32, Vec<u32>)>,
}

impl StatueField {
    /// Calls `visit(part, stroke, low, high)` with bounds of the distance of each element anywhere in the ball.
    fn bounds(&self, near: Option<&Near>, ball: Ball, mut visit: impl FnMut(u32, u32, f32, f32)) {
        let reach = LIPSCHITZ * ball.radius;
        let mut visit_part = |index: u32, selected: Option<&[u32]>| {
            let part = &self.parts[index as usize];
            let slack = reach + part.relief.amplitude();
            match &part.shape {
                Shape::Turned(turned) => {
                    let d = turned.distance(ball.center);
                    visit(index, 0, d - slack, d + slack);
                }
                Shape::Strokes(strokes) => {
                    let mut one = |i: u32| {
                        let d = strokes[i as usize].distance(ball.center).0;
                        visit(index, i, d - slack, d + slack);
                    };
                    match selected {
                        Some(selected) => selected.iter().for_each(|&i| one(i)),
                        None => (0..strokes.len() as u32).for_each(one),
                    }
                }
            }
        };
        match near {
            Some(near) => near.parts.iter().for_each(|(i, selected)| visit_part(*i, Some(selected))),
            None => (0..self.parts.len() as u32).for_each(|i| visit_part(i, None)),
        }
    }

    fn largest_blend(&self) -> f32 {
        self.parts.iter().map(|p| p.blend).fold(0.0, f32::max)
    }
}

impl Field for StatueField {
    type Near = Near;

    fn near(&self, ball: Ball) -> Near {
        let mut limit = f32::INFINITY;
        self.bounds(None, ball, |_, _, _, high| limit = limit.min(high));
        limit += 2.5 * self.largest_blend();
        let mut parts: Vec<(u32, Vec<u32>)> = Vec::new();
        self.bounds(None, ball, |part, stroke, low, _| {
            if low <= limit {
                match parts.last_mut() {
                    Some((last, strokes)) if *last == part => strokes.push(stroke),
                    _ => parts.push((part, vec![stroke])),
                }
            }
        });
        Near { parts }
    }

    fn is_inside(&self, near: &Near, ball: Ball) -> Option<bool> {
        let (mut low, mut high) = (f32::INFINITY, f32::INFINITY);
        self.bounds(Some(near), ball, |_, _, l, h| (low, high) = (low.min(l), high.min(h)));
        // Fillets lower the minimum by at most 5/4 of their width.
        if low - 1.25 * self.largest_blend() > 0.0 { Some(false) } else { (high < 0.0).then_some(true) }
    }

    fn value(&self, near: &Near, p: Vec3) -> f32 {
        let mut distance = f32::INFINITY;
        for (index, strokes) in &near.parts {
            let part = &self.parts[*index as usize];
            if let Some(d) = part.distance(strokes, p, distance + part.blend) {
                distance = if distance == f32::INFINITY { d } else { smooth_min(distance, d, part.blend) };
            }
        }
        distance
    }
}

#[cfg(test)]
mod tests {
    use super::super::nets::tests::assert_closed;
    use super::*;
    use crate::math::hash::HashStream;

    fn small(threads: usize) -> TriangleMesh {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| statue(&StatueOptions { detail: 90, normals: true })).unwrap()
    }

    #[test]
    fn the_statue_is_closed_and_fills_its_box() {
        let mesh = small(2);
        assert!(mesh.triangle_count() > 30_000, "{}", mesh.triangle_count());
        assert_closed(&mesh);
        let bounds = mesh.bounds();
        assert!(
            bounds.min.cmpge(dragon::LOW - 0.01).all() && bounds.max.cmple(dragon::HIGH + 0.01).all(),
            "{bounds:?}"
        );
        assert!(bounds.max.z > 0.9 * dragon::HEIGHT && bounds.min.z.abs() < 0.03, "{bounds:?}");
        let volume: f32 =
            (0..mesh.triangle_count()).map(|i| mesh.triangle(i)).map(|[a, b, c]| a.dot(b.cross(c)) / 6.0).sum();
        assert!(volume > 0.5, "{volume}");
    }

    #[test]
    fn the_statue_does_not_depend_on_the_number_of_threads() {
        let (a, b) = (small(1), small(3));
        assert!(a.indices == b.indices);
        let bits = |m: &TriangleMesh| -> Vec<[u32; 3]> {
            m.positions().iter().chain(&m.normals).map(|p| p.to_array().map(f32::to_bits)).collect()
        };
        assert!(bits(&a) == bits(&b));
    }

    #[test]
    fn what_a_ball_leaves_out_changes_no_bit_and_its_sign_is_right() {
        let field = StatueField { parts: dragon::parts() };
        let everything = field.near(Ball { center: Vec3::ZERO, radius: 100.0 });
        let mut stream = HashStream::new([8, 1, 5]);
        let mut random = |low: Vec3, high: Vec3| {
            low + (high - low) * Vec3::new(stream.next_f32(), stream.next_f32(), stream.next_f32())
        };
        let mut signs = [0; 3];
        for i in 0..1500 {
            let half = if i % 2 == 0 { 0.05 } else { 0.012 };
            let ball = Ball { center: random(dragon::LOW, dragon::HIGH), radius: half * 1.7321 };
            let near = field.near(ball);
            let sign = field.is_inside(&near, ball);
            signs[sign.map_or(2, usize::from)] += 1;
            for _ in 0..4 {
                let p = ball.center + random(Vec3::splat(-half), Vec3::splat(half));
                let value = field.value(&everything, p);
                assert_eq!(field.value(&near, p).to_bits(), value.to_bits(), "{p}");
                assert!(sign.is_none_or(|s| s == (value < 0.0)), "{p} {value}");
            }
        }
        assert!(signs.iter().all(|&n| n > 50), "{signs:?}");
    }

    #[test]
    fn strokes_keep_the_lipschitz_bound() {
        for part in dragon::parts() {
            if let Shape::Strokes(strokes) = part.shape {
                for s in strokes {
                    let [a, b] = s.knots;
                    let slope = (a.radius - b.radius) / a.center.distance(b.center).max(1e-9);
                    assert!((1.0 + slope * slope).sqrt() <= LIPSCHITZ, "{s:?}");
                }
            }
        }
    }

    #[test]
    fn a_detail_out_of_range_is_an_error() {
        assert!(statue(&StatueOptions { detail: 3, normals: true }).is_err());
        assert!(statue(&StatueOptions { detail: 10_000, normals: true }).is_err());
    }
}
