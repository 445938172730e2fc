//! Tests of `lumiris_lanes::connections`.

use super::support::assert_same_bits;
use lumiris_lanes::connections::{Connections, Vertices, connect};
use lumiris_lanes::lane::LANES;
use lumiris_lanes::vertex::{Columns3, Ends};
use lumiris_lanes::{Level, level};
use lumiris_numbers::math::Vec3;
use lumiris_numbers::math::ray::offset_origin;
use lumiris_numbers::math::warp::sample_uniform_sphere;
use lumiris_test_support::random::{Pcg32, RngExt, pcg32};

const FROM: usize = 2 * LANES;
const TO: usize = 5;

/// Points with their error bounds, geometric and shading normals.
struct Set([Vec<Vec3>; 4]);

impl Set {
    fn random(n: usize, stream: &mut Pcg32) -> Set {
        let p = (0..n).map(|_| Vec3::from_array(stream.random::<[f32; 3]>()) * 3.0).collect();
        let p_error = (0..n).map(|_| Vec3::from_array(stream.random::<[f32; 3]>()) * 1e-6).collect();
        let normals: Vec<Vec3> = (0..n).map(|_| sample_uniform_sphere(stream.random::<[f32; 2]>())).collect();
        let turned = |n: &Vec3| (*n + Vec3::new(0.1, -0.2, 0.15)).normalize();
        let shading = normals.iter().map(turned).collect();
        Set([p, p_error, normals, shading])
    }

    fn connect(level: Level, from: &Set, to: &Set, [g, ox, oy, oz, dx, dy, dz]: [&mut [f32]; 7]) {
        let [from, to] = [from, to]
            .map(|set| set.0.each_ref().map(|v| [0, 1, 2].map(|axis| v.iter().map(|v| v[axis]).collect::<Vec<f32>>())));
        let [from, to] = [&from, &to].map(|set| {
            let [p, p_error, n, ns] = set.each_ref().map(|v| -> Columns3<'_> { [&v[0], &v[1], &v[2]] });
            Vertices { ends: Ends { p, p_error, n }, ns }
        });
        connect(level, &from, &to, &mut Connections { g, o: [ox, oy, oz], d: [dx, dy, dz] });
    }
}

#[test]
fn segments_are_those_of_single_pairs_at_all_levels() {
    // All levels
    let stream = &mut pcg32([8, 1, 4]);
    let (from, to) = (Set::random(FROM, stream), Set::random(TO, stream));
    assert_same_bits::<7>(FROM * TO, |level, out| Set::connect(level, &from, &to, out));

    // Each pair by itself
    let mut out: [Vec<f32>; 7] = std::array::from_fn(|_| vec![-7.0; FROM * TO]);
    Set::connect(level(), &from, &to, out.each_mut().map(|v| &mut v[..]));
    let mut connected = 0;
    for (at, (j, i)) in (0..TO).flat_map(|j| (0..FROM).map(move |i| (j, i))).enumerate() {
        let [x, x_error, x_n, x_ns] = from.0.each_ref().map(|v| v[i]);
        let [y, y_error, y_n, y_ns] = to.0.each_ref().map(|v| v[j]);
        let d = y - x;
        let cosines = [x_ns.dot(d), -y_n.dot(d), -y_ns.dot(d)].map(|c| c / d.length());
        if cosines.iter().any(|c| *c <= 0.0) {
            assert_eq!(out[0][at], 0.0, "{cosines:?}");
            continue;
        }
        connected += 1;
        let g = cosines[0] * cosines[1] / d.length_squared();
        assert!((out[0][at] / g - 1.0).abs() < 1e-5, "{} {g}", out[0][at]);
        let o = offset_origin(x, x_error, x_n, d);
        let end = offset_origin(y, y_error, y_n, o - y);
        let found = [1, 4].map(|k| Vec3::new(out[k][at], out[k + 1][at], out[k + 2][at]));
        assert_eq!(found, [o, end - o]);
    }
    assert!((5..FROM * TO / 2).contains(&connected), "{connected}");
}
