//! The head of the dragon: skull, open jaws with teeth, tongue and whiskers, horns, ears, brows and beard.

use super::limbs::{limb, part, tuft};
use super::relief::Relief;
use super::solids::{Part, Stroke};
use lumiris_numbers::math::Vec3;

/// The frame of the head. Its parts are positioned by (forward, sideways, up) in units of `size`.
pub(super) struct Head {
    origin: Vec3,
    forward: Vec3,
    side: Vec3,
    up: Vec3,
    size: f32,
}

impl Head {
    /// A head at `origin` that faces `forward`.
    pub(super) fn new(origin: Vec3, forward: Vec3, up: Vec3, size: f32) -> Self {
        let forward = forward.normalize();
        let up = (up - forward * forward.dot(up)).normalize();
        Head { origin, forward, side: up.cross(forward), up, size }
    }

    fn direction(&self, [f, s, u]: [f32; 3]) -> Vec3 {
        self.forward * f + self.side * s + self.up * u
    }

    fn point(&self, place: [f32; 3]) -> Vec3 {
        self.origin + self.direction(place) * self.size
    }

    /// A smooth stroke through (forward, sideways, up, radius).
    fn stroke(&self, points: &[[f32; 4]], steps: usize) -> Vec<Stroke> {
        let points: Vec<(Vec3, f32)> =
            points.iter().map(|&[f, s, u, r]| (self.point([f, s, u]), r * self.size)).collect();
        limb(&points, self.up, steps)
    }

    /// The same stroke on both sides.
    fn both(&self, points: &[[f32; 4]], steps: usize) -> Vec<Stroke> {
        let mirrored: Vec<[f32; 4]> = points.iter().map(|&[f, s, u, r]| [f, -s, u, r]).collect();
        [self.stroke(points, steps), self.stroke(&mirrored, steps)].concat()
    }

    /// Tufts on both sides.
    fn tufts(&self, root: [f32; 3], direction: [f32; 3], bend: [f32; 3], length: f32, radius: f32) -> Vec<Stroke> {
        let mut out = Vec::new();
        for sign in [1.0, -1.0] {
            let turn = |[f, s, u]: [f32; 3]| [f, sign * s, u];
            let [direction, bend] = [direction, bend].map(|d| self.direction(turn(d)).normalize());
            out.extend(tuft(self.point(turn(root)), direction, bend, length * self.size, radius * self.size));
        }
        out
    }
}

/// The parts of a head, in the order of their union.
pub(super) fn head_parts(head: &Head) -> Vec<Part> {
    vec![
        part(skull(head), Relief::Skin { height: 0.004 }, 0.03),
        part(ridges(head), Relief::Skin { height: 0.002 }, 0.014),
        part(head.both(&[[0.52, 0.36, 0.2, 0.135], [0.54, 0.37, 0.2, 0.135]], 1), Relief::Skin { height: 0.0 }, 0.004),
        part(teeth(head), Relief::Skin { height: 0.0005 }, 0.003),
        part(horns(head), Relief::Rings { frequency: 0.9, height: 0.006 }, 0.012),
        part(hair(head), Relief::Strands { around: 5.0, height: 0.003 }, 0.01),
        part(whiskers(head), Relief::Rings { frequency: 0.25, height: 0.001 }, 0.006),
    ]
}

/// Skull, muzzle, lower jaw, cheeks and nose.
fn skull(head: &Head) -> Vec<Stroke> {
    // Skull and muzzle
    let mut out = head.stroke(&[[-0.2, 0.0, -0.05, 0.52], [0.15, 0.0, 0.02, 0.52], [0.6, 0.0, -0.02, 0.38]], 3);
    for side in [0.13, -0.13] {
        out.extend(head.stroke(&[[0.4, side, -0.02, 0.32], [0.9, side, -0.02, 0.25], [1.5, side, 0.0, 0.21]], 3));
    }

    // Nose and cheeks
    out.extend(head.both(&[[1.5, 0.17, 0.12, 0.14], [1.62, 0.2, 0.1, 0.11]], 1));
    out.extend(head.both(&[[0.0, 0.42, -0.28, 0.26], [0.3, 0.42, -0.3, 0.2]], 1));

    // The two halves of the lower jaw
    for side in [0.12, -0.12] {
        out.extend(head.stroke(
            &[
                [-0.05, 1.8 * side, -0.42, 0.2],
                [0.45, 1.5 * side, -0.68, 0.14],
                [0.95, side, -0.84, 0.11],
                [1.25, 0.6 * side, -0.84, 0.1],
            ],
            4,
        ));
    }
    out
}

/// Brows, lips, wrinkles of the nose, nostrils, and the tongue.
fn ridges(head: &Head) -> Vec<Stroke> {
    // Brows and lips
    let mut out = head.both(&[[0.18, 0.5, 0.3, 0.1], [0.45, 0.44, 0.42, 0.13], [0.78, 0.26, 0.28, 0.08]], 3);
    out.extend(head.both(&[[0.2, 0.5, 0.06, 0.07], [0.5, 0.46, 0.04, 0.06], [0.8, 0.34, 0.12, 0.05]], 3));
    out.extend(head.both(
        &[[0.3, 0.46, -0.2, 0.08], [0.9, 0.38, -0.22, 0.06], [1.45, 0.32, -0.14, 0.06], [1.68, 0.14, -0.1, 0.05]],
        4,
    ));
    out.extend(head.both(
        &[[0.1, 0.33, -0.42, 0.06], [0.5, 0.27, -0.56, 0.055], [1.0, 0.19, -0.74, 0.05], [1.32, 0.06, -0.75, 0.045]],
        4,
    ));

    // Wrinkles of the nose
    for i in 0..5 {
        let f = 0.85 + 0.14 * i as f32;
        out.extend(head.stroke(&[[f, 0.27, 0.14, 0.035], [f + 0.05, 0.0, 0.25, 0.05], [f, -0.27, 0.14, 0.035]], 3));
    }

    // Nostrils
    for i in 0..3 {
        let f = 1.66 - 0.06 * i as f32;
        out.extend(head.both(&[[f, 0.28 - 0.02 * i as f32, 0.02, 0.04], [f, 0.26, 0.14 + 0.03 * i as f32, 0.045]], 2));
    }

    // The tongue
    out.extend(head.stroke(
        &[
            [0.2, 0.0, -0.45, 0.12],
            [0.7, 0.0, -0.52, 0.11],
            [1.1, 0.03, -0.6, 0.085],
            [1.45, 0.06, -0.62, 0.05],
            [1.65, 0.1, -0.5, 0.02],
        ],
        4,
    ));
    out
}

/// Upper and lower teeth, and fangs.
fn teeth(head: &Head) -> Vec<Stroke> {
    let mut out = Vec::new();
    for i in 0..8 {
        let t = i as f32 / 7.0;
        let long = [0.12, 0.13, 0.12, 0.14, 0.16, 0.24, 0.32, 0.16][i];
        let (f, s) = (0.5 + 1.08 * t, 0.35 - 0.07 * t - 0.12 * (t - 0.8).max(0.0));
        let u = -0.22 + 0.08 * t;
        out.extend(
            head.both(&[[f, s, u, 0.05], [f + 0.02, s, u - 0.5 * long, 0.035], [f - 0.02, s, u - long, 0.006]], 2),
        );
        let (f, s, u) = (0.4 + 0.85 * t, 0.27 - 0.17 * t * t, -0.52 - 0.22 * t);
        let long = 0.8 * long;
        out.extend(
            head.both(&[[f, s, u, 0.045], [f - 0.01, s, u + 0.5 * long, 0.03], [f - 0.04, s, u + long, 0.006]], 2),
        );
    }
    out
}

/// A pair of branched horns.
fn horns(head: &Head) -> Vec<Stroke> {
    let mut out = head.both(
        &[
            [0.0, 0.25, 0.38, 0.14],
            [-0.3, 0.36, 0.72, 0.125],
            [-0.7, 0.48, 0.92, 0.1],
            [-1.15, 0.55, 1.0, 0.075],
            [-1.5, 0.5, 1.22, 0.045],
            [-1.62, 0.42, 1.48, 0.008],
        ],
        6,
    );
    out.extend(head.both(&[[-0.62, 0.46, 0.9, 0.085], [-0.66, 0.58, 1.15, 0.065], [-0.58, 0.62, 1.42, 0.008]], 5));
    out.extend(head.both(&[[0.1, 0.12, 0.44, 0.1], [0.02, 0.13, 0.62, 0.07], [-0.1, 0.14, 0.8, 0.008]], 4));
    out
}

/// Ears, cheek flames, beard and eyebrows.
fn hair(head: &Head) -> Vec<Stroke> {
    let mut out = head.tufts([-0.15, 0.5, 0.2], [-0.6, 0.8, 0.35], [0.3, 0.2, 1.0], 0.62, 0.13);
    for i in 0..7 {
        let t = i as f32 / 6.0;
        let root = [-0.02 + 0.1 * t, 0.52 - 0.12 * t, 0.02 - 0.56 * t];
        let direction = [-0.85, 0.62 - 0.25 * t, 0.3 - 0.95 * t];
        out.extend(head.tufts(root, direction, [0.2, 0.6, 0.6 - 0.3 * t], 0.75 - 0.15 * t, 0.1));
        let root = [-0.25, 0.42 - 0.1 * t, 0.1 - 0.56 * t];
        out.extend(head.tufts(root, [-1.0, 0.75 - 0.2 * t, 0.1 - 0.8 * t], [0.0, 0.8, 0.3], 0.85 - 0.15 * t, 0.09));
    }
    for i in 0..5 {
        let t = i as f32 / 4.0;
        let root = [0.35 + 0.85 * t, 0.16 - 0.12 * t, -0.72 - 0.2 * t.min(0.6)];
        out.extend(head.tufts(root, [-0.45, 0.2, -1.0], [0.8, 0.1, -0.2], 0.55 - 0.12 * t, 0.075));
        let root = [0.25 + 0.12 * i as f32, 0.48 - 0.05 * i as f32, 0.42];
        out.extend(head.tufts(root, [-0.7, 0.4, 0.7], [0.2, 0.1, 1.0], 0.34, 0.06));
    }
    out
}

/// A pair of long whiskers.
fn whiskers(head: &Head) -> Vec<Stroke> {
    head.both(
        &[
            [1.5, 0.3, 0.0, 0.06],
            [1.75, 0.62, 0.1, 0.05],
            [1.6, 1.0, -0.1, 0.042],
            [1.25, 1.25, -0.42, 0.036],
            [1.15, 1.5, -0.85, 0.03],
            [1.35, 1.75, -1.1, 0.024],
            [1.6, 1.8, -1.05, 0.012],
        ],
        8,
    )
}
