//! Tests of `lumiris_lanes::sampler`.

use crate::support::{LENGTHS, assert_same_bits, levels};
use lumiris_lanes::sampler::draw;
use lumiris_numbers::samplers::{SampleStream, SamplerKind};

const KINDS: [SamplerKind; 4] =
    [SamplerKind::Independent, SamplerKind::Stratified, SamplerKind::Sobol, SamplerKind::SobolBlueNoise];

#[test]
fn lanes_draw_the_numbers_of_single_streams() {
    for kind in KINDS {
        for n in LENGTHS.into_iter().chain([1000, 70_000]) {
            let stream = |i: u32| SampleStream::new(kind, [i % 91, i / 91], i.wrapping_mul(77), 5);
            let streams: Vec<SampleStream> =
                (0..n as u32).map(|i| stream(i).domain(i % 7).split(3, 5, i % 5)).collect();
            for level in levels() {
                let mut u: [Vec<f32>; 4] = std::array::from_fn(|_| vec![-1.0; n]);
                draw(level, &streams, u.each_mut().map(|u| &mut u[..]));
                for (i, stream) in streams.iter().enumerate() {
                    let single = stream.draw::<4>();
                    assert_eq!(u.each_ref().map(|u| u[i]), single, "{kind:?} {i} of {n}");
                    assert_eq!(stream.draw::<2>(), [single[0], single[1]]);
                }
            }
        }
    }
}

#[test]
fn all_levels_draw_the_same_bits() {
    for n in LENGTHS {
        let streams: Vec<SampleStream> =
            (0..n as u32).map(|i| SampleStream::new(SamplerKind::Sobol, [i, 3], i, 1)).collect();
        assert_same_bits::<3>(n, |level, out| draw(level, &streams, out));
    }
}
