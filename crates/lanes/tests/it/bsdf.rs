//! Tests of `lumiris_lanes::bsdf`.

use super::support::{LENGTHS, assert_same_bits};
use lumiris_lanes::bsdf::*;
use lumiris_numbers::math::warp;
use lumiris_numbers::math::{Frame, Vec3};
use lumiris_test_support::random::{RngExt, pcg32};

#[test]
fn lanes_are_the_same_at_all_levels() {
    let alpha = [0.3, 0.1];
    let rows: [Vec<[f32; 2]>; 2] = [0.3, 0.5].map(|a| (0..128).map(|i| [a * (i as f32 / 127.0).sqrt(), 0.1]).collect());
    let (base, p_interface) = ([0.1, 0.2, 0.3], 0.4);
    let coated = |transmittance, interface| Model::Coated { interface, base, p_interface, transmittance };
    let interface = Interface { alpha, eta: 1.5 };
    let mut stream = pcg32([8, 8, 8]);
    for model in [
        Model::Lambertian { reflection: base, transmission: [0.3, 0.2, 0.0], p: [0.6, 0.4] },
        Model::Conductor { alpha, eta: [0.2, 0.9, 1.1], k: [3.9, 2.4, 0.0] },
        Model::Dielectric(interface),
        coated(Transmittance::Table([&rows[0], &rows[1]], 0.0), Some(interface)),
        coated(Transmittance::Table([&rows[0], &rows[1]], 0.25), Some(interface)),
        coated(Transmittance::Smooth(1.5, 0.0), None),
        coated(Transmittance::Smooth(1.5, 0.1), None),
    ] {
        for n in LENGTHS {
            let wo = warp::sample_uniform_sphere(stream.random::<[f32; 2]>());
            let frame = Frame::from_z(warp::sample_uniform_sphere(stream.random::<[f32; 2]>()));
            let mut wi = [vec![0.0; n], vec![0.0; n], vec![0.0; n]];
            for i in 0..n {
                let w = if i % 50 == 7 {
                    Vec3::splat(f32::NAN)
                } else {
                    warp::sample_uniform_sphere(stream.random::<[f32; 2]>())
                };
                (0..3).for_each(|c| wi[c][i] = w[c]);
            }
            assert_same_bits::<4>(n, |level, [r, g, b, pdf]| {
                let wi = wi.each_ref().map(|v| &v[..]);
                Bsdf { frame, wo, model }.eval(level, wi, &mut Values { f_cos: [r, g, b], pdf });
                assert!(pdf.iter().chain(r.iter()).all(|&p| p >= 0.0 && p.is_finite()));
            });
        }
    }
}
