//! Tests of `lumiris_lanes::environment`.

use super::support::{LENGTHS, assert_same_bits};
use lumiris_lanes::LightLanes;
use lumiris_lanes::environment::*;
use lumiris_lanes::lane::LANES;
use lumiris_numbers::math::{Mat3, TexelDistribution, Vec3, sphere_map};
use lumiris_test_support::random::{RngExt, pcg32};

#[test]
fn lanes_are_the_same_at_all_levels() {
    let mut stream = pcg32([6, 6, 6]);
    let [width, height] = [36, 20];
    // Some rows and many texels are black
    let values: Vec<f32> = (0..width * height)
        .map(|i| if i / width % 7 == 3 { 0.0 } else { (stream.random::<f32>() - 0.3).max(0.0).powi(6) })
        .collect();
    let distributions = [TexelDistribution::new(&values, width), TexelDistribution::with_blocks(&values, width)];
    let texels: Vec<[f32; 4]> = (0..(width + 2) * (height + 2))
        .map(|_| [stream.random::<f32>(), stream.random::<f32>(), stream.random::<f32>(), stream.random::<f32>()])
        .collect();
    let world_from_light = Mat3::from_rotation_x(0.3) * Mat3::from_rotation_y(1.0);
    for (is_equal_area, is_bilinear) in [(false, false), (false, true), (true, false), (true, true)] {
        let texels = &texels;
        for distribution in &distributions {
            let map = Environment { distribution, texels, is_equal_area, is_bilinear, world_from_light, scale: 2.0 };
            for n in LENGTHS {
                let (u0, u1): (Vec<f32>, Vec<f32>) = (0..n)
                    .map(|i| if i == 5 { (0.0, 1.0) } else { (stream.random::<f32>(), stream.random::<f32>()) })
                    .unzip();
                assert_same_bits::<7>(n, |level, [x, y, z, r, g, b, pdf]| {
                    map.sample(level, [&u0, &u1], &mut LightLanes { wi: [x, y, z], li: [r, g, b], pdf });
                    for i in 0..n {
                        let length2 = x[i] * x[i] + y[i] * y[i] + z[i] * z[i];
                        assert!((length2 - 1.0).abs() < 1e-6 && pdf[i] >= 0.0);
                    }
                });
            }
        }
    }
}

#[test]
fn points_of_the_square_have_the_bits_of_each_by_itself() {
    let mut stream = pcg32([6, 6, 7]);
    let mut w: [Vec<f32>; 3] = Default::default();
    for i in 0..64 * LANES {
        // First the axes, which have coordinates of 0, then random directions
        let axis = if i % 2 == 0 { 1.0 } else { -1.0 };
        let v = match i {
            0..6 => Vec3::AXES[i / 2] * axis,
            _ => Vec3::from_array(std::array::from_fn(|_| stream.random::<f32>() - 0.5)).normalize(),
        };
        w.iter_mut().zip(v.to_array()).for_each(|(column, x)| column.push(x));
    }
    for level in lumiris_lanes::levels() {
        let [mut u, mut v] = [vec![0.0; w[0].len()], vec![0.0; w[0].len()]];
        equal_area_squares(level, w.each_ref().map(|column| &column[..]), [&mut u, &mut v]);
        for i in 0..u.len() {
            let direction = Vec3::new(w[0][i], w[1][i], w[2][i]);
            let p = sphere_map::equal_area_sphere_to_square(direction);
            assert_eq!([u[i], v[i]].map(f32::to_bits), p.to_array().map(f32::to_bits), "{direction}");
            assert!((sphere_map::equal_area_square_to_sphere(p) - direction).length() < 2e-6, "{direction}");
        }
    }
}
