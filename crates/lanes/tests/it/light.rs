//! Tests of `lumiris_lanes::light`.

use super::support::{LENGTHS, assert_same_bits};
use lumiris_lanes::light::*;
use lumiris_numbers::math::warp;

#[test]
fn lanes_are_the_same_at_all_levels() {
    for n in LENGTHS {
        let u: Vec<f32> = (0..n).map(|i| (i as f32 * 0.618) % 1.0).collect();
        let v: Vec<f32> = (0..n).map(|i| (i as f32 + 0.5) / n as f32).collect();
        assert_same_bits::<7>(n, |level, [x, y, z, r, g, b, pdf]| {
            let mut out = LightLanes { wi: [x, y, z], li: [r, g, b], pdf };
            sample_uniform_sphere(level, [&u, &v], [1.0, 2.0, 3.0], &mut out);
            assert!(out.pdf.iter().all(|&p| p == warp::pdf_uniform_sphere()));
        });
    }
}
