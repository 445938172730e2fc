//! Tests of `lumiris_lanes::triangle_points`.

use super::support::assert_same_bits;
use lumiris_lanes::lane::LANES;
use lumiris_lanes::triangle_points::*;
use lumiris_test_support::random::{RngExt, pcg32};

const N: usize = 64;

#[test]
fn points_are_the_same_at_all_levels() {
    let mut stream = pcg32([8, 1, 1]);
    let mut lanes =
        |scale: f32| -> [f32; LANES] { std::array::from_fn(|_| (stream.random::<f32>() * 2.0 - 1.0) * scale) };
    let mut hits = [TriangleHits::default(); N / LANES];
    let mut coordinates = [CornerCoordinates::default(); N / LANES];
    for (hits, coordinates) in hits.iter_mut().zip(&mut coordinates) {
        hits.corners.iter_mut().flatten().for_each(|row| *row = lanes(4.0));
        hits.normals.iter_mut().flatten().chain(&mut hits.d).for_each(|row| *row = lanes(1.0));
        hits.b = [lanes(0.5), lanes(0.5)];
        hits.orientation = [1.0; LANES];
        coordinates.iter_mut().flatten().for_each(|row| *row = lanes(3.0));
    }
    assert_same_bits::<18>(N, |level, [a, b, c, d, e, f, g, h, i, j, k, l, m, n, o, p, q, r]| {
        let mut out =
            Points { p: [a, b, c], p_error: [d, e, f], n: [g, h, i], facing: [j, k, l], ns: [m, n, o], wo: [p, q, r] };
        points(level, &hits, &mut out);
    });

    // With derivatives
    assert_same_bits::<10>(N, |level, mut columns| {
        let mut out = [TexturedPoints::default(); N / LANES];
        textured_points(level, &hits, &coordinates, &mut out);
        for (block, points) in out.iter().enumerate() {
            let TexturedPoints { derivatives, inverse_lengths, uv, .. } = points;
            let rows = derivatives.iter().flatten().chain(inverse_lengths).chain(uv);
            for (column, row) in columns.iter_mut().zip(rows) {
                column[block * LANES..][..LANES].copy_from_slice(row);
            }
        }
    });
}
