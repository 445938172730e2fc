//! A dragon that winds up a carved column on a pedestal: the parts of the statue.
//!
//! z is up and the head faces −y. Lengths are in units of space (about metres); angles are measured from +x to +y.

use super::head::{Head, head_parts};
use super::limbs::{knot, limb, part, tuft};
use super::relief::Relief;
use super::solids::{Knot, Part, Shape, Stroke, Turned, spline, strokes};
use lumiris_numbers::math::{Vec2, Vec3};
use std::f32::consts::{PI, TAU};

/// Height of the statue.
pub const HEIGHT: f32 = 3.2;
/// Lower corner of its bounds.
pub const LOW: Vec3 = Vec3::new(-1.06, -1.06, -0.02);
/// Upper corner of its bounds.
pub const HIGH: Vec3 = Vec3::new(1.06, 1.06, HEIGHT);

/// Top of the pedestal.
const FLOOR: f32 = 0.46;
/// Radius of the shaft.
const SHAFT: f32 = 0.3;
/// Number of windings of the body around the shaft.
const TURNS: f32 = 3.25;
/// Angle of the end of the last winding.
const END_ANGLE: f32 = 0.36 * PI;

/// The point at an angle, a distance from the axis, and a height.
fn around(angle: f32, radius: f32, z: f32) -> Vec3 {
    Vec3::new(radius * angle.cos(), radius * angle.sin(), z)
}

/// All parts, in the order of their union.
pub fn parts() -> Vec<Part> {
    let body = body();
    let tip = body[body.len() - 1];
    let head = Head::new(tip.center, Vec3::new(0.42, -0.88, -0.2), Vec3::new(0.03, -0.1, 1.0), 0.23);
    let mut parts = vec![
        turned(&PEDESTAL, Relief::Pedestal),
        turned(&COLUMN, Relief::Shaft),
        turned(&CAPITAL, Relief::Shaft),
        part(rocks(), Relief::Rock { height: 0.035 }, 0.02),
        part(strokes(&body).collect(), Relief::Scales { around: 20.0, height: 0.13 }, 0.008),
        part(spines(&body), Relief::Strands { around: 4.0, height: 0.002 }, 0.01),
        part(tail_tuft(&body), Relief::Strands { around: 5.0, height: 0.004 }, 0.012),
        part(mane(&body), Relief::Strands { around: 5.0, height: 0.004 }, 0.012),
    ];
    // Positions of the legs, as fractions of the winding, and whether they reach forward
    for (at, direction) in [(0.44, 1.0), (0.5, -1.0), (0.77, 1.0), (0.83, -1.0)] {
        let [limb, claws, flames] = leg(&body, at, direction);
        parts.push(part(limb, Relief::Scales { around: 13.0, height: 0.1 }, 0.025));
        parts.push(part(claws, Relief::Rings { frequency: 0.5, height: 0.001 }, 0.006));
        parts.push(part(flames, Relief::Strands { around: 4.0, height: 0.003 }, 0.012));
    }
    parts.extend(head_parts(&head));
    parts
}

/// Base and two wreaths of petals.
const PEDESTAL: [(f32, f32); 16] = [
    (0.0, 0.0),
    (1.0, 0.0),
    (1.0, 0.11),
    (0.985, 0.12),
    (0.965, 0.14),
    (0.935, 0.19),
    (0.87, 0.24),
    (0.825, 0.266),
    (0.815, 0.27),
    (0.815, 0.304),
    (0.83, 0.31),
    (0.88, 0.335),
    (0.93, 0.39),
    (0.945, 0.43),
    (0.93, FLOOR),
    (0.0, FLOOR),
];

const COLUMN: [(f32, f32); 10] = [
    (0.0, 0.4),
    (0.44, 0.4),
    (0.44, 0.5),
    (0.36, 0.54),
    (SHAFT, 0.58),
    (SHAFT, 2.03),
    (0.34, 2.05),
    (0.34, 2.1),
    (0.3, 2.12),
    (0.0, 2.12),
];

const CAPITAL: [(f32, f32); 9] = [
    (0.0, 2.1),
    (0.27, 2.1),
    (0.3, 2.16),
    (0.37, 2.22),
    (0.4, 2.26),
    (0.38, 2.29),
    (0.2, 2.31),
    (0.12, 2.33),
    (0.0, 2.33),
];

fn turned(profile: &[(f32, f32)], relief: Relief) -> Part {
    let profile = profile.iter().map(|&p| Vec2::from(p)).collect();
    Part { shape: Shape::Turned(Turned { profile }), relief, blend: 0.012 }
}

/// The body from the tip of the tail to the skull: a helix whose first turn lies on the pedestal, then the neck.
fn body() -> Vec<Knot> {
    let mut points = Vec::new();
    let windings = 96;
    for i in 0..=windings {
        let t = i as f32 / windings as f32;
        let angle = END_ANGLE - TAU * TURNS * (1.0 - t);
        let radius = 0.022 + 0.13 * (1.0 - (1.0 - (t / 0.6).min(1.0)).powi(2)) - 0.012 * (t - 0.6).max(0.0);
        // On the floor first, then upwards
        let lying = (1.0 - t / 0.3).clamp(0.0, 1.0);
        let lying = lying * lying * (3.0 - 2.0 * lying);
        let wave = 0.05 * (4.0 * angle).sin() * lying;
        let out = (SHAFT + 0.84 * radius) * (1.0 - lying) + (0.68 + wave) * lying;
        let climb = ((t - 0.16) / 0.84).max(0.0);
        let z = FLOOR + 0.85 * radius + 1.52 * climb.powf(1.12);
        let dorsal = Vec3::new(angle.cos(), angle.sin(), 0.75 + 1.5 * lying);
        points.push(knot(around(angle, out, z), radius, dorsal));
    }
    let neck = [
        ([-0.2, 0.53, 2.24], 0.135, [-0.3, 0.8, 0.4]),
        ([-0.43, 0.42, 2.4], 0.128, [-0.6, 0.6, 0.4]),
        ([-0.5, 0.2, 2.6], 0.122, [-0.8, 0.4, 0.3]),
        ([-0.41, 0.0, 2.78], 0.117, [-0.7, 0.5, 0.8]),
        ([-0.24, -0.16, 2.86], 0.114, [-0.5, 0.4, 1.0]),
        ([-0.06, -0.32, 2.84], 0.112, [-0.1, 0.1, 1.0]),
        ([0.06, -0.47, 2.78], 0.112, [0.0, 0.0, 1.0]),
    ];
    points.extend(neck.map(|(p, r, d)| knot(Vec3::from(p), r, Vec3::from(d))));
    spline(&points, 5)
}

/// Index of the knot of the body at a fraction of its winding.
fn body_at(body: &[Knot], t: f32) -> usize {
    ((body.len() - 1) as f32 * t) as usize
}

/// Direction of the body at a knot.
fn tangent_at(body: &[Knot], i: usize) -> Vec3 {
    let (low, high) = (i.saturating_sub(1), (i + 1).min(body.len() - 1));
    (body[high].center - body[low].center).normalize()
}

/// Spines along the back.
fn spines(body: &[Knot]) -> Vec<Stroke> {
    let mut out = Vec::new();
    let mut next = 6.0;
    // Spines are half a radius apart, where the body is thick enough
    for i in 1..body.len() {
        let k = body[i];
        if k.along < next || k.radius < 0.035 {
            continue;
        }
        next = k.along + 0.5;
        let tangent = (k.center - body[i - 1].center).normalize();
        let at = |height: f32, back: f32| k.center + (k.dorsal * height - tangent * back) * k.radius;
        let points = [
            (at(0.8, -0.1), 0.28 * k.radius),
            (at(1.3, 0.0), 0.19 * k.radius),
            (at(1.65, 0.2), 0.11 * k.radius),
            (at(1.85, 0.6), 0.025 * k.radius),
        ];
        out.extend(limb(&points, tangent, 3));
    }
    out
}

/// Flames at the end of the tail.
fn tail_tuft(body: &[Knot]) -> Vec<Stroke> {
    let (tip, tangent) = (body[1], (body[0].center - body[4].center).normalize());
    let side = tangent.cross(Vec3::Z).normalize();
    let mut out = Vec::new();
    for i in 0..7 {
        let a = (i as f32 - 3.0) / 3.0;
        let direction = (tangent + side * (0.7 * a) + Vec3::Z * (0.15 + 0.35 * (1.0 - a.abs()))).normalize();
        let bend = if i % 2 == 0 { Vec3::Z + side * a } else { Vec3::Z - side };
        out.extend(tuft(tip.center, direction, bend.normalize(), 0.24 - 0.06 * a.abs(), 0.022));
    }
    out
}

/// Tufts along the neck, in rows beside the back.
fn mane(body: &[Knot]) -> Vec<Stroke> {
    let mut out = Vec::new();
    for row in 0..11 {
        let i = body_at(body, 0.985 - 0.0085 * row as f32);
        let (k, tangent) = (body[i], tangent_at(body, i));
        let side = tangent.cross(k.dorsal);
        for column in -3..=3_i32 {
            let angle = (column as f32 + 0.5 * (row % 2) as f32 - 0.25) * 0.42;
            let normal = k.dorsal * angle.cos() + side * angle.sin();
            let shrink = 1.0 - 0.04 * row as f32;
            let length = (0.19 + 0.025 * ((row * 5 + column + 9) % 4) as f32) * shrink;
            let direction = (normal * 0.62 - tangent).normalize();
            let bend = (normal + side * (0.5 * angle.sin())).normalize();
            out.extend(tuft(k.center + normal * (0.86 * k.radius), direction, bend, length, 0.021 * shrink));
        }
    }
    out
}

/// A leg that reaches to the shaft: the limb with its toes, the claws, and flames at the elbow.
fn leg(body: &[Knot], at: f32, direction: f32) -> [Vec<Stroke>; 3] {
    // Points around the shaft, relative to the angle and height of the root
    let k = body[body_at(body, at)];
    let angle = k.center.y.atan2(k.center.x);
    let z = k.center.z;
    let place = |turn: f32, radius: f32, up: f32| around(angle + direction * turn, radius, z + up);
    let (elbow, wrist) = (place(0.3, 0.66, 0.02), place(0.6, 0.47, -0.13));
    let outward = Vec3::new(angle.cos(), angle.sin(), 0.0);

    // The limb
    let points = [
        (k.center, 0.115),
        (place(0.14, 0.56, 0.04), 0.1),
        (elbow, 0.068),
        (place(0.47, 0.6, -0.07), 0.062),
        (wrist, 0.05),
        (place(0.68, 0.41, -0.16), 0.055),
    ];
    let mut out = limb(&points, outward + Vec3::Z, 5);

    // Toes and claws
    let mut claws = Vec::new();
    for toe in 0..4 {
        let (spread, drop) = [(0.46, -0.27), (0.74, -0.31), (0.98, -0.25), (1.02, -0.1)][toe];
        let palm = place(0.68, 0.41, -0.16);
        let (knuckle, end) = (place(0.5 * (0.68 + spread), 0.42, 0.5 * (drop - 0.16)), place(spread, 0.365, drop));
        let toe = [(palm, 0.036), (knuckle + 0.012 * outward, 0.033), (end, 0.026)];
        out.extend(limb(&toe, outward, 4));
        let tip = place(spread * 1.12 - 0.1, 0.315, drop - 0.075);
        let ridge = end + (tip - end) * 0.5 + outward * 0.014;
        claws.extend(limb(&[(end, 0.022), (ridge, 0.015), (tip, 0.002)], outward, 4));
    }

    // Flames at the elbow
    let mut flames = Vec::new();
    for i in 0..4 {
        let bend = (outward + Vec3::Z * (0.6 - 0.4 * i as f32)).normalize();
        let back = (place(0.1, 0.78, 0.14 - 0.06 * i as f32) - elbow).normalize();
        flames.extend(tuft(elbow, back, bend, 0.2 - 0.02 * i as f32, 0.022));
    }
    [out, claws, flames]
}

/// Boulders around the foot of the shaft.
fn rocks() -> Vec<Stroke> {
    (0..9)
        .map(|i| {
            let angle = i as f32 * 0.7 + 0.3 * (i as f32 * 2.3).sin();
            let size = 0.1 + 0.035 * (i as f32 * 4.1).cos();
            let foot = knot(around(angle, 0.42, FLOOR), size, Vec3::X);
            let top = knot(around(angle + 0.1, 0.36, FLOOR + 0.1 + size), 0.75 * size, Vec3::X);
            Stroke { knots: [foot, top] }
        })
        .collect()
}
