//! Outlines of leaves, as images for alpha textures.

use lumiris::imaging::oiio::Part;

/// Size of an image (pixels), and the samples of a pixel along each axis.
const WIDTH: usize = 128;
const HEIGHT: usize = 256;
const SAMPLES: usize = 4;

/// An outline.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Leaf {
    /// A blade of grass.
    Blade,
    /// A broad leaf with some slits.
    Broad,
    /// Narrow leaflets along an axis.
    Frond,
    /// Segments about a point.
    Fan,
    /// Oval leaves on a twig.
    Twig,
}

/// All outlines.
pub(super) const LEAVES: [Leaf; 5] = [Leaf::Blade, Leaf::Broad, Leaf::Frond, Leaf::Fan, Leaf::Twig];

impl Leaf {
    /// Name of its texture, and of its file with `.png`.
    pub(super) fn name(self) -> &'static str {
        match self {
            Leaf::Blade => "blade",
            Leaf::Broad => "broad",
            Leaf::Frond => "frond",
            Leaf::Fan => "fan",
            Leaf::Twig => "twig",
        }
    }

    /// True inside the outline: `x` is −1..1 across, `t` is 0 at the root and 1 at the tip.
    fn covers(self, x: f32, t: f32) -> bool {
        let side = x.abs();
        match self {
            Leaf::Blade => side < (1.0 - t).powf(0.7) * (0.4 + 2.0 * t).min(1.0),
            Leaf::Broad => {
                let slit = (t * 9.0 + 0.6 * side + 0.2 * x).fract();
                let is_slit = slit < 0.10 * side && side > 0.25;
                side < 0.04
                    || (side < (9.0 * (t - 0.08)).clamp(0.0, 1.0) * (4.0 * (1.0 - t)).min(1.0).sqrt() && !is_slit)
            }
            Leaf::Frond => {
                let leaflet = (t * 26.0 - 3.0 * side).rem_euclid(1.0);
                let reach = (6.0 * (t - 0.10)).clamp(0.0, 1.0) * (1.0 - t).powf(0.45);
                side < 0.05 * (1.1 - t) || (side < reach && (leaflet - 0.5).abs() < 0.36 * (1.0 - 0.75 * side / reach))
            }
            Leaf::Fan => {
                let (y, r) = (t - 0.35, x.hypot((t - 0.35) * 1.6));
                let segment = (f32::atan2(x, y) * 24.0 / std::f32::consts::TAU).rem_euclid(1.0);
                let is_gap = r > 0.5 && (segment - 0.5).abs() > 0.5 * (1.5 - r).min(1.0) - 0.04;
                (side < 0.03 && t < 0.4) || (r < 0.98 && !is_gap && !(side < 0.25 && y < 0.0 && r > 0.3))
            }
            Leaf::Twig => {
                let is_in_leaf = |i: u32| {
                    let hand = if i.is_multiple_of(2) { 1.0 } else { -1.0 };
                    let (cx, ct) = (hand * 0.45, 0.14 + 0.08 * i as f32);
                    // The axis of the leaf rises outwards
                    let (dx, dt) = ((x - cx) * hand, (t - ct) * 2.0);
                    let (along, across) = (0.85 * dx + 0.52 * dt, 0.85 * dt - 0.52 * dx);
                    (along / 0.46).powi(2) + (across / 0.19).powi(2) < 1.0
                };
                (side < 0.03 && t < 0.85)
                    || (0..10).any(is_in_leaf)
                    || (x / 0.22).powi(2) + ((t - 0.88) / 0.12).powi(2) < 1.0
            }
        }
    }

    /// The image: 1 inside, 0 outside. The tip is at the top.
    pub(super) fn image(self) -> Part {
        let pixel = |i: usize| {
            let coordinate = |pixel: usize, sample: usize, size: usize| {
                (pixel as f32 + (sample as f32 + 0.5) / SAMPLES as f32) / size as f32
            };
            let is_covered = |k: &usize| {
                let s = coordinate(i % WIDTH, k % SAMPLES, WIDTH);
                let t = 1.0 - coordinate(i / WIDTH, k / SAMPLES, HEIGHT);
                self.covers(2.0 * s - 1.0, t)
            };
            (0..SAMPLES * SAMPLES).filter(is_covered).count() as f32 / (SAMPLES * SAMPLES) as f32
        };
        Part::display(WIDTH, HEIGHT, vec!["Y".to_owned()], (0..WIDTH * HEIGHT).map(pixel).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_leaf_covers_a_part_of_its_image_and_is_held_at_its_root() {
        for leaf in LEAVES {
            let inside = (0..10_000).filter(|i| leaf.covers((i % 100) as f32 / 50.0 - 0.99, (i / 100) as f32 / 100.0));
            let fraction = inside.count() as f32 / 1e4;
            assert!((0.2..0.9).contains(&fraction), "{leaf:?} {fraction}");
            assert!(leaf.covers(0.0, 0.0) && !leaf.covers(0.99, 0.99), "{leaf:?}");
        }
    }
}
