//! Solids for sculptures, as distance functions: strokes (round cones) and solids of revolution.
//!
//! The distance of a stroke is the distance to the sphere at the nearest point of its axis. It changes by at most √(1 +
//! (Δr/l)²) per unit length, where l is the length and Δr the change of the radius. Parts are merged by the smooth
//! minimum min(a, b) − k h²/4, h = max(1 − |a − b|/k, 0) [Quilez 2013], which equals the minimum if they differ by k or
//! more.

use super::relief::{Relief, Spot};
use lumiris_numbers::math::{Vec2, Vec3};

/// Maximum change of any distance here per unit length.
pub const LIPSCHITZ: f32 = 1.16;

/// An end of a stroke.
#[derive(Clone, Copy, Debug)]
pub struct Knot {
    /// Centre of the sphere.
    pub center: Vec3,
    /// Its radius.
    pub radius: f32,
    /// Unit vector across the stroke that carvings count angles from.
    pub dorsal: Vec3,
    /// Coordinate along the stroke that carvings use.
    pub along: f32,
}

/// A round cone between two knots.
#[derive(Clone, Copy, Debug)]
pub struct Stroke {
    /// The ends.
    pub knots: [Knot; 2],
}

impl Stroke {
    /// The position along the axis that is nearest to a point, 0..1.
    #[inline]
    pub fn position(&self, p: Vec3) -> f32 {
        let [a, b] = &self.knots;
        let axis = b.center - a.center;
        ((p - a.center).dot(axis) / axis.length_squared().max(1e-12)).clamp(0.0, 1.0)
    }

    /// Distance of a point from the surface (negative inside), given its position along the axis.
    #[inline]
    pub fn distance(&self, p: Vec3, t: f32) -> f32 {
        let [a, b] = &self.knots;
        (p - a.center - (b.center - a.center) * t).length() - (a.radius + (b.radius - a.radius) * t)
    }

    /// The coordinates at `t` for carving.
    fn spot(&self, p: Vec3, t: f32) -> Spot {
        let [a, b] = &self.knots;
        let axis = b.center - a.center;
        let across = p - a.center - axis * t;
        let dorsal = a.dorsal.lerp(b.dorsal, t);
        let side = axis.cross(dorsal);
        let side = side * (dorsal.length() / side.length().max(1e-12));
        let radius = a.radius + (b.radius - a.radius) * t;
        Spot { p, angle: across.dot(side).atan2(across.dot(dorsal)), along: a.along + (b.along - a.along) * t, radius }
    }
}

/// A solid of revolution: a polygon of (distance from the z axis, z), rotated about the z axis.
#[derive(Clone, Debug)]
pub struct Turned {
    /// The corners, counter-clockwise; the first and the last lie on the axis.
    pub profile: Vec<Vec2>,
}

impl Turned {
    /// Distance from the surface, negative inside: exact. The side along the axis is not a surface.
    pub fn distance(&self, p: Vec3) -> f32 {
        let q = Vec2::new(p.truncate().length(), p.z);
        let (mut nearest, mut inside) = (f32::INFINITY, false);
        for pair in self.profile.windows(2) {
            let (a, b) = (pair[0], pair[1]);
            let (edge, to) = (b - a, q - a);
            let t = (to.dot(edge) / edge.length_squared()).clamp(0.0, 1.0);
            nearest = nearest.min((to - edge * t).length_squared());
            // Crossings of the ray from q away from the axis
            if (a.y > q.y) != (b.y > q.y) && q.x < a.x + edge.x * (q.y - a.y) / edge.y {
                inside = !inside;
            }
        }
        if inside { -nearest.sqrt() } else { nearest.sqrt() }
    }
}

/// The shape of a part.
#[derive(Clone, Debug)]
pub enum Shape {
    /// The union of strokes.
    Strokes(Vec<Stroke>),
    /// A solid of revolution.
    Turned(Turned),
}

/// A carved solid.
#[derive(Clone, Debug)]
pub struct Part {
    /// The solid before carving.
    pub shape: Shape,
    /// The relief carved into it.
    pub relief: Relief,
    /// Width of the fillet to the previous parts.
    pub blend: f32,
}

impl Part {
    /// Distance after carving; `None` if it is certainly more than `limit`. Only the `selected` strokes count.
    pub fn distance(&self, selected: &[u32], p: Vec3, limit: f32) -> Option<f32> {
        let amplitude = self.relief.amplitude();
        match &self.shape {
            Shape::Strokes(strokes) => {
                // The nearest selected stroke, with the relief at its nearest point
                let (mut nearest, mut at) = (f32::INFINITY, (0, 0.0));
                for &i in selected {
                    let t = strokes[i as usize].position(p);
                    let d = strokes[i as usize].distance(p, t);
                    if d < nearest {
                        (nearest, at) = (d, (i, t));
                    }
                }
                (nearest - amplitude <= limit)
                    .then(|| nearest - self.relief.height(&strokes[at.0 as usize].spot(p, at.1)))
            }
            Shape::Turned(turned) => {
                let d = turned.distance(p);
                let spot = || Spot { p, angle: p.y.atan2(p.x), along: p.z, radius: p.truncate().length() };
                (d - amplitude <= limit).then(|| d - self.relief.height(&spot()))
            }
        }
    }
}

/// min(a, b) with a fillet of width `k`.
#[inline]
pub fn smooth_min(a: f32, b: f32, k: f32) -> f32 {
    let h = (1.0 - (a - b).abs() / k).max(0.0);
    a.min(b) - 0.25 * k * h * h
}

/// The smooth curve through points [Catmull and Rom 1974], `steps` pieces between two of them.
pub fn spline(points: &[Knot], steps: usize) -> Vec<Knot> {
    // Missing neighbours repeat the end points
    let at = |i: isize| points[i.clamp(0, points.len() as isize - 1) as usize];
    let mut knots = Vec::new();
    for i in 0..points.len() as isize - 1 {
        let [a, b, c, d] = [at(i - 1), at(i), at(i + 1), at(i + 2)];
        for step in 0..steps {
            // The weights of a uniform Catmull–Rom spline
            let t = step as f32 / steps as f32;
            let w = [
                ((2.0 - t) * t - 1.0) * t * 0.5,
                ((3.0 * t - 5.0) * t * t + 2.0) * 0.5,
                ((4.0 - 3.0 * t) * t + 1.0) * t * 0.5,
                (t - 1.0) * t * t * 0.5,
            ];
            let mix = |f: fn(&Knot) -> Vec3| f(&a) * w[0] + f(&b) * w[1] + f(&c) * w[2] + f(&d) * w[3];
            let radius = a.radius * w[0] + b.radius * w[1] + c.radius * w[2] + d.radius * w[3];
            knots.push(Knot { center: mix(|k| k.center), radius, dorsal: b.dorsal.lerp(c.dorsal, t), along: 0.0 });
        }
    }
    knots.push(at(points.len() as isize - 1));
    finish(&mut knots);
    knots
}

/// Makes the dorsal vectors unit and perpendicular to the curve, and computes `along` in radii: ∫ ds/r.
fn finish(knots: &mut [Knot]) {
    let mut along = 0.0;
    for i in 0..knots.len() {
        let (low, high) = (i.saturating_sub(1), (i + 1).min(knots.len() - 1));
        let tangent = (knots[high].center - knots[low].center).normalize_or(Vec3::Z);
        let dorsal = knots[i].dorsal;
        knots[i].dorsal = (dorsal - tangent * tangent.dot(dorsal)).normalize_or(tangent.any_orthonormal_vector());
        if i > 0 {
            along += 2.0 * knots[i].center.distance(knots[low].center) / (knots[i].radius + knots[low].radius);
        }
        knots[i].along = along;
    }
}

/// The strokes between neighbouring knots.
pub fn strokes(knots: &[Knot]) -> impl Iterator<Item = Stroke> + '_ {
    knots.windows(2).map(|pair| Stroke { knots: [pair[0], pair[1]] })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn knot(x: f32, radius: f32) -> Knot {
        Knot { center: Vec3::new(x, 0.0, 0.0), radius, dorsal: Vec3::Z, along: 0.0 }
    }

    #[test]
    fn distances_of_strokes_and_turned_profiles_are_right() {
        let stroke = Stroke { knots: [knot(0.0, 0.2), knot(2.0, 0.1)] };
        let p = Vec3::new(1.0, 0.0, 1.0);
        let t = stroke.position(p);
        let d = stroke.distance(p, t);
        assert!((d - 0.85).abs() < 1e-6 && (t - 0.5).abs() < 1e-6);
        assert!((stroke.distance(Vec3::new(-1.0, 0.0, 0.0), 0.0) - 0.8).abs() < 1e-6);
        let turned = Turned { profile: [(0.0, 0.0), (1.0, 0.0), (1.0, 2.0), (0.0, 2.0)].map(Vec2::from).to_vec() };
        assert!((turned.distance(Vec3::new(0.0, 0.0, 1.0)) + 1.0).abs() < 1e-6);
        assert!((turned.distance(Vec3::new(0.0, 0.0, 2.5)) - 0.5).abs() < 1e-6);
        assert!((turned.distance(Vec3::new(2.0, 0.0, 3.0)) - 2f32.sqrt()).abs() < 1e-6);
    }

    #[test]
    fn the_spline_meets_its_points_and_the_smooth_minimum_is_exact_far_away() {
        let points = [knot(0.0, 0.2), knot(1.0, 0.1), knot(2.0, 0.3), knot(3.0, 0.3)];
        let knots = spline(&points, 4);
        assert_eq!(knots.len(), 13);
        assert!((knots[8].center - points[2].center).length() < 1e-6 && (knots[8].radius - 0.3).abs() < 1e-6);
        assert!(knots.windows(2).all(|k| k[1].along > k[0].along));
        assert_eq!(smooth_min(0.3, 0.5, 0.2), 0.3);
        assert!((smooth_min(0.3, 0.3, 0.2) - 0.25).abs() < 1e-6);
    }
}
