//! Tests of `lumiris_lanes::light_tree`.

use super::support::assert_same_bits;
use lumiris_lanes::lane::LANES;
use lumiris_lanes::level;
use lumiris_lanes::light_tree::{GlossyLobes, Receivers, first_probabilities, importances};
use lumiris_lanes::vertex::Columns3;
use lumiris_numbers::math::light_bound::{GlossyLobe, LightBound, Receiver, first_probability};
use lumiris_numbers::math::warp::sample_uniform_sphere;
use lumiris_numbers::math::{Sphere, Vec3};
use lumiris_test_support::random::{Pcg32, RngExt, pcg32};

const N: usize = 16 * LANES;

fn columns(v: &[Vec3]) -> [Vec<f32>; 3] {
    [0, 1, 2].map(|axis| v.iter().map(|v| v[axis]).collect())
}

fn slices(v: &[Vec<f32>; 3]) -> Columns3<'_> {
    [&v[0], &v[1], &v[2]]
}

fn bound(stream: &mut Pcg32, two_sided: bool) -> LightBound {
    let center = Vec3::from_array(stream.random::<[f32; 3]>()) * 2.0 - 1.0;
    let cosines = [stream.random::<f32>(), stream.random::<f32>() - 0.5];
    let axis = sample_uniform_sphere(stream.random::<[f32; 2]>());
    let sphere = Sphere { center, radius: 0.3 * stream.random::<f32>() };
    LightBound::new(sphere, axis, cosines, two_sided, 1.0 + stream.random::<f32>())
}

#[test]
fn probabilities_are_those_of_single_points_at_all_levels() {
    let stream = &mut pcg32([8, 2, 1]);
    let mut vectors = || -> Vec<Vec3> { (0..N).map(|_| sample_uniform_sphere(stream.random::<[f32; 2]>())).collect() };
    let (p, mut ns, wo) = (vectors(), vectors(), vectors());
    // Some points have no surface, and the first vectors have no lobes
    ns.iter_mut().step_by(5).for_each(|n| *n = Vec3::ZERO);
    let has_lobe = |i: usize| i >= 2 * LANES && !i.is_multiple_of(3);
    let lobe = |i: usize| if has_lobe(i) { GlossyLobe::new(wo[i], ns[i], 0.2, 0.6) } else { GlossyLobe::NONE };
    let lobes: Vec<GlossyLobe> = (0..N).map(lobe).collect();
    let [cos_o, alpha_squared, scale, diffuse] = [
        |l: &GlossyLobe| l.cos_o,
        |l: &GlossyLobe| l.alpha_squared,
        |l: &GlossyLobe| l.scale,
        |l: &GlossyLobe| l.diffuse,
    ]
    .map(|of| lobes.iter().map(of).collect::<Vec<f32>>());
    let wo = columns(&lobes.iter().map(|l| Vec3::from_array(l.wo)).collect::<Vec<_>>());
    let (p_columns, ns_columns) = (columns(&p), columns(&ns));
    let lobe_columns =
        GlossyLobes { wo: slices(&wo), cos_o: &cos_o, alpha_squared: &alpha_squared, scale: &scale, diffuse: &diffuse };
    let at = Receivers { p: slices(&p_columns), ns: slices(&ns_columns), lobes: Some(lobe_columns) };
    let mut dark = 0;
    for round in 0..40 {
        let (a, b) = (bound(stream, round % 2 == 0), bound(stream, round % 3 == 0));
        assert_same_bits::<2>(N, |level, [first, importance]| {
            first_probabilities(level, [&a, &b], &at, first);
            importances(level, &a, &at, importance);
        });
        let [mut first, mut importance] = [vec![-7.0; N], vec![-7.0; N]];
        first_probabilities(level(), [&a, &b], &at, &mut first);
        importances(level(), &a, &at, &mut importance);
        for i in 0..N {
            let lobe = Some(lobes[i]).filter(|l| l.scale > 0.0);
            let receiver = Receiver { p: p[i].to_array(), ns: ns[i].to_array(), lobe };
            let both = [a.importance(&receiver), b.importance(&receiver)];
            assert_eq!((importance[i], first[i]), (both[0], first_probability(both, [&a, &b])), "{i}");
            assert!((0.0..=1.0).contains(&first[i]));
            dark += usize::from(both[0] == 0.0);
        }
    }
    assert!((50..39 * N).contains(&dark), "{dark}");
}
