//! A finely detailed statue: a dragon on a carved column ([`dragon`]), meshed at a selectable resolution.
//!
//! The distance of the statue is the smooth minimum over its carved parts. In a ball of radius R, with L the bound of
//! [`solids`](super::solids), only strokes of a part within 2LR of the minimum distance from the centre can be the
//! nearest. Only parts within 2LR + amplitudes + fillets of the nearest one affect the result. Omitting the others
//! leaves the result bit-identical.

use super::dragon;
use super::nets::{Ball, Field, Grid, largest_piece, mesh_field};
use super::solids::{LIPSCHITZ, Part, Shape, Stroke, smooth_min};
use lumiris::geometry::TriangleMesh;
use lumiris_numbers::math::Vec3;

/// Default of [`StatueOptions::detail`].
pub const DEFAULT_DETAIL: u32 = 480;

/// Parameters of the statue.
#[derive(Clone, Copy, Debug)]
pub struct StatueOptions {
    /// Cells of the grid along its height, 8..=4096. The number of triangles grows with its square.
    pub detail: u32,
    /// True if vertices have normals.
    pub normals: bool,
}

impl Default for StatueOptions {
    fn default() -> Self {
        StatueOptions { detail: DEFAULT_DETAIL, normals: true }
    }
}

/// The mesh of the statue: closed, connected, z up, on the plane z = 0, [`dragon::HEIGHT`] high.
///
/// Returns `Err` with a message if the options are out of range.
pub fn statue(options: &StatueOptions) -> Result<TriangleMesh, String> {
    if !(8..=4096).contains(&options.detail) {
        return Err(format!("the detail of the statue must be 8 to 4096, not {}", options.detail));
    }
    let field = StatueField { parts: dragon::parts() };
    let cell = dragon::HEIGHT / options.detail as f32;
    let pad = Vec3::splat(2.5 * cell);
    let grid = Grid::new(dragon::LOW - pad, dragon::HIGH + pad, cell);
    let mut mesh = largest_piece(&mesh_field(&field, &grid)?)?;
    if !options.normals {
        mesh.normals = Vec::new();
    }
    Ok(mesh)
}

/// The distance of the statue.
struct StatueField {
    parts: Vec<Part>,
}

/// A part with its relevant strokes.
struct NearPart {
    part: u32,
    strokes: Vec<u32>,
    /// Bounds of its carved distance.
    low: f32,
    high: f32,
}

/// The relevant parts in a ball, in order, and bounds of the distance.
struct Near {
    parts: Vec<NearPart>,
    low: f32,
    high: f32,
}

impl StatueField {
    fn near_part(&self, index: u32, candidates: &mut dyn Iterator<Item = u32>, ball: Ball) -> NearPart {
        let part = &self.parts[index as usize];
        let reach = LIPSCHITZ * ball.radius;
        let mut selected = Vec::new();
        let distance = match &part.shape {
            Shape::Turned(turned) => turned.distance(ball.center),
            Shape::Strokes(strokes) => {
                let distance = |stroke: &Stroke| stroke.distance(ball.center, stroke.position(ball.center));
                let distances: Vec<(u32, f32)> = candidates.map(|i| (i, distance(&strokes[i as usize]))).collect();
                let min = distances.iter().map(|&(_, d)| d).fold(f32::INFINITY, f32::min);
                selected.extend(distances.iter().filter(|&&(_, d)| d - reach <= min + reach).map(|&(i, _)| i));
                min
            }
        };
        let slack = reach + part.relief.amplitude();
        NearPart { part: index, strokes: selected, low: distance - slack, high: distance + slack }
    }
}

impl Field for StatueField {
    type Near = Near;

    fn near(&self, wider: Option<&Near>, ball: Ball) -> Near {
        let mut parts: Vec<NearPart> = match wider {
            Some(wider) => {
                wider.parts.iter().map(|n| self.near_part(n.part, &mut n.strokes.iter().copied(), ball)).collect()
            }
            None => (0..self.parts.len() as u32)
                .map(|i| {
                    let count = if let Shape::Strokes(s) = &self.parts[i as usize].shape { s.len() } else { 0 };
                    self.near_part(i, &mut (0..count as u32), ball)
                })
                .collect(),
        };
        let blend = parts.iter().map(|n| self.parts[n.part as usize].blend).fold(0.0, f32::max);
        let high = parts.iter().map(|n| n.high).fold(f32::INFINITY, f32::min);
        let low = parts.iter().map(|n| n.low).fold(f32::INFINITY, f32::min);
        parts.retain(|n| n.low <= high + 2.5 * blend);
        // Fillets lower the minimum by at most 5/4 of their width.
        Near { parts, low: low - 1.25 * blend, high }
    }

    fn is_inside(&self, near: &Near) -> Option<bool> {
        if near.low > 0.0 { Some(false) } else { (near.high < 0.0).then_some(true) }
    }

    fn value(&self, near: &Near, p: Vec3) -> f32 {
        let mut distance = f32::INFINITY;
        for NearPart { part, strokes, .. } in &near.parts {
            let part = &self.parts[*part as usize];
            if let Some(d) = part.distance(strokes, p, distance + part.blend) {
                distance = if distance == f32::INFINITY { d } else { smooth_min(distance, d, part.blend) };
            }
        }
        distance
    }
}

#[cfg(test)]
mod tests {
    use super::super::nets::assert_closed;
    use super::*;
    use lumiris_test_support::random::{RngExt, pcg32};

    fn small(threads: usize) -> TriangleMesh {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| statue(&StatueOptions { detail: 64, normals: true })).unwrap()
    }

    #[test]
    fn the_statue_is_closed_and_fills_its_box() {
        let mesh = small(2);
        assert!(mesh.triangle_count() > 12_000, "{}", mesh.triangle_count());
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
        let everything = field.near(None, Ball { center: Vec3::ZERO, radius: 100.0 });
        let mut stream = pcg32([8, 1, 5]);
        let mut random = |low: Vec3, high: Vec3| {
            low + (high - low) * Vec3::new(stream.random::<f32>(), stream.random::<f32>(), stream.random::<f32>())
        };
        let mut signs = [0; 3];
        // A ball within a wider one
        for i in 0..1200 {
            let half = if i % 2 == 0 { 0.05 } else { 0.012 };
            let center = random(dragon::LOW, dragon::HIGH);
            let wider = field.near(None, Ball { center: center + 0.1, radius: 0.2 + half * 1.7321 });
            let near = field.near(Some(&wider), Ball { center, radius: half * 1.7321 });
            let sign = field.is_inside(&near);
            signs[sign.map_or(2, usize::from)] += 1;
            // Values at points of the ball
            for _ in 0..2 {
                let p = center + random(Vec3::splat(-half), Vec3::splat(half));
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
