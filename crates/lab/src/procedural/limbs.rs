//! Strokes and parts of the dragon and its head.

use super::relief::Relief;
use super::solids::{Knot, Part, Shape, Stroke, spline, strokes};
use lumiris_numbers::math::Vec3;

/// A knot of an unfinished curve: dorsal vectors need not be perpendicular.
pub(super) fn knot(center: Vec3, radius: f32, dorsal: Vec3) -> Knot {
    Knot { center, radius, dorsal, along: 0.0 }
}

/// A smooth stroke through points with radii.
pub(super) fn limb(points: &[(Vec3, f32)], dorsal: Vec3, steps: usize) -> Vec<Stroke> {
    let knots: Vec<Knot> = points.iter().map(|&(p, r)| knot(p, r, dorsal)).collect();
    strokes(&spline(&knots, steps)).collect()
}

pub(super) fn part(strokes: Vec<Stroke>, relief: Relief, blend: f32) -> Part {
    Part { shape: Shape::Strokes(strokes), relief, blend }
}

/// A wavy tuft from `root` along `direction`, bent towards `bend`.
pub(super) fn tuft(root: Vec3, direction: Vec3, bend: Vec3, length: f32, radius: f32) -> Vec<Stroke> {
    let at = |t: f32, b: f32| root + direction * (length * t) + bend * (length * b);
    let points = [
        (at(0.0, 0.0), radius),
        (at(0.3, 0.1), radius * 1.05),
        (at(0.6, 0.06), radius * 0.75),
        (at(0.85, 0.16), radius * 0.4),
        (at(1.0, 0.34), radius * 0.08),
    ];
    limb(&points, bend, 4)
}
