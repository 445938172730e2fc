//! Tests of `lumiris_lanes::sampler`.

use crate::support::{LENGTHS, assert_same_bits, levels};
use lumiris_lanes::sampler::{Below, draw, enter};
use lumiris_numbers::samplers::{SampleStream, SamplerKind, StreamColumns};

const KINDS: [SamplerKind; 4] =
    [SamplerKind::Independent, SamplerKind::Stratified, SamplerKind::Sobol, SamplerKind::SobolBlueNoise];

/// Pairs of streams of a pixel. Neighbouring pairs have the same place in different blocks, or different places in the
/// same block.
fn streams(kind: SamplerKind, n: usize) -> StreamColumns {
    let mut columns = StreamColumns::default();
    for i in 0..n as u32 {
        let pixel = [i / 8 % 91 + [0, 16, 17, 1][i as usize / 2 % 4], i / 800];
        let stream = SampleStream::new(kind, pixel, i.wrapping_mul(77), 5).domain(i / 8 % 7);
        columns.extend([stream].iter());
    }
    columns
}

#[test]
fn lanes_draw_the_numbers_of_single_streams() {
    // The last split passes the end of the index of a point
    let splits = [(0, 1), (4, 5), (0, 5), (65_535, 65_536)];
    for kind in KINDS {
        for n in LENGTHS.into_iter().chain([1000, 70_000]) {
            let streams = streams(kind, n);
            for level in levels() {
                for (index, count) in splits {
                    let mut u: [Vec<f32>; 4] = std::array::from_fn(|_| vec![-1.0; n]);
                    let below = Below::Split { key: 3, count, index };
                    draw(level, &streams, 0..n, below, u.each_mut().map(|u| &mut u[..]));
                    for i in 0..n {
                        let single = streams.get(i).split(3, count, index).draw::<4>();
                        assert_eq!(u.each_ref().map(|u| u[i]), single, "{kind:?} {i} of {n}");
                    }
                }
            }
        }
    }
}

#[test]
fn lanes_enter_the_domains_of_single_streams() {
    for kind in KINDS {
        for n in LENGTHS.into_iter().chain([1000]) {
            for level in levels() {
                let mut entered = streams(kind, n);
                enter(level, &mut entered, 9);
                let outer = streams(kind, n);
                assert!((0..n).all(|i| entered.get(i) == outer.get(i).domain(9)), "{kind:?} {n}");

                // A range of rows
                let rows = n / 3..n;
                let [mut u, mut v] = [(); 2].map(|()| vec![-1.0; rows.len()]);
                draw(level, &outer, rows.clone(), Below::Domain(9), [&mut u[..], &mut v[..]]);
                for (k, i) in rows.enumerate() {
                    assert_eq!([u[k], v[k]], entered.get(i).draw::<2>(), "{kind:?} {i} of {n}");
                }
            }
        }
    }
}

#[test]
fn all_levels_draw_the_same_bits() {
    for n in LENGTHS {
        let streams = streams(SamplerKind::Sobol, n);
        assert_same_bits::<3>(n, |level, out| draw(level, &streams, 0..n, Below::Domain(2), out));
    }
}
