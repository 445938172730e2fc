//! Control variates over the pixels of an image: bias.

use super::mixtures::{Mixture, Sampler};
use super::{assert_means, level};
use lumiris_numbers::estimators::ocv::Form;
use lumiris_numbers::estimators::ocv::pixels::{Memory, Picture, Pixel};
use lumiris_numbers::estimators::stats::{Welford, z_test};
use lumiris_test_support::integrals::run;
use lumiris_test_support::random::Pcg32;

/// Edge of an image.
const EDGE: usize = 8;

/// Estimates of pixels, by channel.
type Estimates = Vec<[f64; 3]>;

/// Pixels of an image that all have the integral of `sampler`: by MIS, and corrected. With `copies`, pairs of
/// neighbours have the same samples.
fn picture(sampler: &Sampler, passes: u32, copies: bool, stream: &mut Pcg32) -> [Estimates; 2] {
    let (equations, m) = (sampler.equations, sampler.counts.len());
    let mut sums = vec![0.0; equations.len()];
    let (mut pixels, mut controls) = (Vec::new(), Vec::new());
    for i in 0..EDGE * EDGE {
        if !(copies && i % 2 == 1) {
            sampler.block(Form::Pixels, passes, stream, &mut sums);
        }
        let n = f64::from(equations.samples(&sums));
        controls.extend((0..m).map(|j| (equations.sum_of_column(&sums, j) / n) as f32));
        pixels.push(Pixel { mean: equations.mean(&sums), class: Some(1), normal: [0.0, 0.0, 1.0] });
    }
    let before: Estimates = pixels.iter().map(|p| p.mean.map(f64::from)).collect();
    let picture = Picture::new(EDGE, m, pixels, controls);
    let (mut memory, mut beta, mut corrected) = (Memory::default(), Vec::new(), Vec::new());
    for row in 0..picture.height() {
        picture.coefficients(row, &mut memory, &mut beta);
        for (column, beta) in beta.chunks(3 * m).enumerate() {
            let i = row * EDGE + column;
            let off = picture.correction(i, beta);
            corrected.push([0, 1, 2].map(|c| before[i][c] - f64::from(off[c])));
        }
    }
    [before, corrected]
}

fn mean(estimates: &[[f64; 3]]) -> [f64; 3] {
    [0, 1, 2].map(|c| estimates.iter().map(|e| e[c]).sum::<f64>() / estimates.len() as f64)
}

/// Means over images with `runs` pixels in total.
fn runs_of_pixels(sampler: &Sampler, runs: usize, copies: bool) -> [Welford; 3] {
    let key = [41, sampler.n, sampler.mixture as u32];
    run(runs / (EDGE * EDGE), key, |stream| mean(&picture(sampler, 1, copies, stream)[1]))
}

#[test]
fn the_form_over_pixels_is_unbiased() {
    for (mixture, runs) in [(Mixture::Table, 1_000_000), (Mixture::Occluded, 100_000), (Mixture::Colour, 100_000)] {
        for n in [3, 8] {
            for stratified in [false, true] {
                let sampler = Sampler::new(mixture, n, stratified);
                let name = format!("{mixture:?}, N = {n}, stratified: {stratified}");
                assert_means(&name, &runs_of_pixels(&sampler, runs, false), mixture.value());
            }
        }
    }
}

#[test]
fn coefficients_of_pixels_that_share_their_samples_are_biased() {
    // The effect that the test above would detect if a pixel were fitted to itself.
    let sampler = Sampler::new(Mixture::Table, 3, false);
    let [w, ..] = runs_of_pixels(&sampler, 1_000_000, true);
    let z = z_test(w.mean(), Mixture::Table.value()[0], w.standard_error());
    assert!(z.p_value < level(), "{} {}", w.mean(), Mixture::Table.value()[0]);
}

/// Ratio of the variance of a pixel to MIS, in the first channel.
fn variance(sampler: &Sampler, passes: u32, pictures: usize) -> f64 {
    let value = sampler.mixture.value()[0];
    let mut squares = [0.0; 2];
    let _ = run(pictures, [42, sampler.n, sampler.mixture as u32], |stream| {
        for (sum, estimates) in squares.iter_mut().zip(picture(sampler, passes, false, stream)) {
            *sum += estimates.iter().map(|e| (e[0] - value).powi(2)).sum::<f64>();
        }
        [0.0; 3]
    });
    squares[1] / squares[0]
}

#[test]
fn pixels_gain_where_controls_explain_the_light_and_lose_little_where_they_do_not() {
    for (mixture, stratified, most) in [
        (Mixture::Occluded, false, 0.5),
        (Mixture::Table, false, 0.85),
        (Mixture::Optimal, false, 1.03),
        (Mixture::Peak, true, 1.03),
    ] {
        let ratio = variance(&Sampler::new(mixture, 8, stratified), 4, 300);
        assert!(ratio < most, "{mixture:?}: {ratio}");
    }
}
