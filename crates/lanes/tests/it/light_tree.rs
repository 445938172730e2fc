//! Tests of `lumiris_lanes::light_tree` and `lumiris_lanes::light_descent`.

use super::support::assert_same_bits;
use lumiris_lanes::lane::LANES;
use lumiris_lanes::light_descent::{DESCENTS, Descents, Expected, Photons, descend, expect, left_probabilities};
use lumiris_lanes::light_tree::{GlossyLobes, Receivers, importances};
use lumiris_lanes::vertex::Columns3;
use lumiris_numbers::math::expected_visibility::expected_visibility;
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

/// N receivers, some without a surface, the first two vectors and some others without lobes.
struct Points {
    p: [Vec<f32>; 3],
    ns: [Vec<f32>; 3],
    wo: [Vec<f32>; 3],
    /// cos_o, alpha_squared, scale, diffuse.
    rest: [Vec<f32>; 4],
    singles: Vec<Receiver<f32>>,
}

impl Points {
    fn new(stream: &mut Pcg32) -> Self {
        let mut vectors =
            || -> Vec<Vec3> { (0..N).map(|_| sample_uniform_sphere(stream.random::<[f32; 2]>())).collect() };
        let (p, mut ns, wo) = (vectors(), vectors(), vectors());
        ns.iter_mut().step_by(5).for_each(|n| *n = Vec3::ZERO);
        let has_lobe = |i: usize| i >= 2 * LANES && !i.is_multiple_of(3);
        let lobe = |i: usize| if has_lobe(i) { GlossyLobe::new(wo[i], ns[i], 0.2, 0.6) } else { GlossyLobe::NONE };
        let lobes: Vec<GlossyLobe> = (0..N).map(lobe).collect();
        let rest = [
            |l: &GlossyLobe| l.cos_o,
            |l: &GlossyLobe| l.alpha_squared,
            |l: &GlossyLobe| l.scale,
            |l: &GlossyLobe| l.diffuse,
        ]
        .map(|of| lobes.iter().map(of).collect::<Vec<f32>>());
        let single = |i: usize| {
            let lobe = Some(lobes[i]).filter(|l| l.scale > 0.0);
            Receiver { p: p[i].to_array(), ns: ns[i].to_array(), lobe }
        };
        let singles = (0..N).map(single).collect();
        let wo = columns(&lobes.iter().map(|l| Vec3::from_array(l.wo)).collect::<Vec<_>>());
        Points { p: columns(&p), ns: columns(&ns), wo, rest, singles }
    }

    fn receivers(&self) -> Receivers<'_> {
        let [cos_o, alpha_squared, scale, diffuse] = self.rest.each_ref().map(|column| &column[..]);
        let lobes = GlossyLobes { wo: slices(&self.wo), cos_o, alpha_squared, scale, diffuse };
        Receivers { p: slices(&self.p), ns: slices(&self.ns), lobes: Some(lobes) }
    }
}

#[test]
fn importances_are_those_of_single_points_at_all_levels() {
    let stream = &mut pcg32([8, 2, 1]);
    let points = Points::new(stream);
    let at = points.receivers();
    let mut dark = 0;
    for round in 0..40 {
        let bound = bound(stream, round % 2 == 0);
        let [found] = assert_same_bits::<1>(N, |level, [importance]| importances(level, &bound, &at, importance));
        for (found, receiver) in found.iter().zip(&points.singles) {
            assert_eq!(*found, bound.importance(receiver));
            dark += usize::from(*found == 0.0);
        }
    }
    assert!((50..39 * N).contains(&dark), "{dark}");
}

#[test]
fn steps_down_a_tree_are_those_of_single_points_at_all_levels() {
    let stream = &mut pcg32([8, 2, 2]);
    let points = Points::new(stream);
    let at = points.receivers();
    let mut counts = [0; 4];
    for round in 0..80 {
        // Another pair of nodes for each point; every seventh point is at a leaf, some nodes are closed
        let bounds: [Vec<LightBound>; 2] =
            [0, 1].map(|side| (0..DESCENTS).map(|i| bound(stream, (i + side) % 3 == 0)).collect());
        let children = bounds.each_ref().map(|bounds| std::array::from_fn(|i| &bounds[i]));
        let mut photons = [Photons::default(); 2];
        for photons in &mut photons {
            photons.of_one = std::array::from_fn(|_| 10_f32.powf(4.0 * stream.random::<f32>() - 2.0));
            photons.count = std::array::from_fn(|_| f32::from(stream.random_range(0..5_u8)) - 1.0);
        }
        let photons = (round % 2 == 1).then_some(photons);
        let u: Vec<f32> = (0..DESCENTS).map(|_| stream.random::<f32>()).collect();
        let first = round % (N / DESCENTS) * DESCENTS;
        let mut begun = Descents::default();
        begun.begin_rows(&at, first..first + DESCENTS, &u);
        begun.is_inner = std::array::from_fn(|i| if i % 7 == 3 { 0.0 } else { 1.0 });

        // All levels
        let outputs = |d: &Descents| [d.u, d.pmf, d.is_left, d.importance, d.diffuse_importance];
        let [found_u, pmf, is_left, importance, diffuse] = assert_same_bits::<5>(DESCENTS, |level, out| {
            let mut descents = begun;
            descend(level, [&children[0], &children[1]], photons.as_ref(), &mut descents);
            out.into_iter().zip(outputs(&descents)).for_each(|(out, row)| out.copy_from_slice(&row));
        });

        // Single points
        for i in 0..DESCENTS {
            if begun.is_inner[i] == 0.0 {
                assert_eq!((found_u[i], pmf[i], importance[i]), (u[i], 1.0, 0.0));
                continue;
            }
            let receiver = &points.singles[first + i];
            let of_diffuse = Receiver { lobe: None, ..*receiver };
            let nodes = [children[0][i], children[1][i]];
            let reflected = nodes.map(|node| node.importance(receiver));
            let e = nodes.map(|node| node.importance(&of_diffuse));
            let weight = |side: usize| match &photons {
                Some(photons) if photons[side].count[i] < 0.0 => 0.0,
                Some(photons) => {
                    let Photons { of_one, count } = &photons[side];
                    reflected[side] * expected_visibility(e[side], of_one[i], count[i]).sqrt()
                }
                None => reflected[side],
            };
            let p = first_probability([weight(0), weight(1)], nodes.map(LightBound::intensity));
            let side = usize::from(u[i] >= p);
            let taken = [p, 1.0 - p][side];
            assert_eq!((is_left[i] == 1.0, pmf[i]), (side == 0, taken), "{i}");
            assert!((0.0..1.0).contains(&found_u[i]));
            assert_eq!(importance[i], reflected[side]);
            assert!(photons.is_none() || diffuse[i] == e[side]);
            counts[side] += 1;
            counts[2] += usize::from(taken == 1.0);
            counts[3] += usize::from(reflected[side] != e[side]);
        }
    }
    assert!(counts.iter().all(|&count| count > 100), "{counts:?}");
}

#[test]
fn nodes_and_lights_at_a_point_are_those_of_single_ones_at_all_levels() {
    let stream = &mut pcg32([8, 2, 3]);
    let points = Points::new(stream);
    for (round, at) in points.singles.iter().enumerate() {
        let bounds: [Vec<LightBound>; 2] =
            [0, 1].map(|side| (0..DESCENTS).map(|i| bound(stream, (i + side) % 3 == 0)).collect());
        let [left, right] = bounds.each_ref().map(|bounds| std::array::from_fn(|i| &bounds[i]));
        let photons = Photons {
            of_one: std::array::from_fn(|_| 10_f32.powf(4.0 * stream.random::<f32>() - 2.0)),
            count: std::array::from_fn(|i| (i % 5) as f32),
        };
        let count = 1 + round % DESCENTS;
        let [importance, visibility, p] = assert_same_bits::<3>(count, |level, [importance, visibility, p]| {
            let (mut expected, mut of_left) = (Expected::default(), [0.0; DESCENTS]);
            expect(level, at, &left, &photons, count, &mut expected);
            left_probabilities(level, at, [&left, &right], count, &mut of_left);
            importance.copy_from_slice(&expected.importance[..count]);
            visibility.copy_from_slice(&expected.visibility[..count]);
            p.copy_from_slice(&of_left[..count]);
        });
        for i in 0..count {
            let e = left[i].importance(&Receiver { lobe: None, ..*at });
            let both = [left[i].importance(at), right[i].importance(at)];
            assert_eq!(importance[i], both[0]);
            assert_eq!(visibility[i], expected_visibility(e, photons.of_one[i], photons.count[i]));
            assert_eq!(p[i], first_probability(both, [left[i].intensity(), right[i].intensity()]));
        }
    }
}
