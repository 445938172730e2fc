//! Scenes rendered in two ways that must agree in the means of the image and of its blocks.
//!
//! Images have different seeds, so their means are independent. Their number is chosen to detect the biases of
//! [`effort`] with a power of 0.99. The detectable bias of each comparison is printed (`docs/measurements/power`).

use lumiris::film::Film;
use lumiris_numbers::estimators::stats::{Welford, median};
use lumiris_test_support::power::by_power;
use lumiris_test_support::significance::{critical_t, detectable_deviation};
use std::io::Write;

/// Relative biases that a comparison has to detect.
#[derive(Clone, Copy)]
struct Effort {
    /// In the mean of the image, in every channel.
    image: f64,
    /// In the median of the blocks and channels.
    block: f64,
}

fn effort() -> Effort {
    by_power(Effort { image: 0.005, block: 0.03 }, Effort { image: 0.12, block: 0.15 })
}

/// Blocks along each side of an image.
const BLOCKS: usize = 4;
/// Level of the test of each mean: about 30 comparisons of 51 means together reject right images with a probability of
/// 0.0015.
const LEVEL: f64 = 1e-6;
/// Probability of detecting a bias of the stated size.
const POWER: f64 = 0.99;
/// Pilot images of each side: they determine the number of images, and are not compared.
const PILOT: u32 = 8;
/// Factor on the number from the pilot: more images have a lower critical value.
const MARGIN: f64 = 0.8;
/// Relative difference due to rounding where there is no noise.
const ROUNDING: f64 = 1e-6;
/// Minimum number of images of each side.
const LEAST: u32 = 12;
/// Maximum number of doublings of the number of images, for pilots that underestimate the noise.
const ATTEMPTS: u32 = 3;

/// Mean pixel values of the image, then of its blocks, by channel.
fn means(film: &Film) -> Vec<f64> {
    let (width, height) = (film.bounds.width() as usize, film.bounds.area() / film.bounds.width() as usize);
    let mut sums = vec![[0.0; 4]; 1 + BLOCKS * BLOCKS];
    for (i, pixel) in film.pixels().iter().enumerate() {
        let block = i / width * BLOCKS / height * BLOCKS + i % width * BLOCKS / width;
        for sum in [0, 1 + block] {
            pixel.mean().iter().enumerate().for_each(|(c, v)| sums[sum][c] += v);
            sums[sum][3] += 1.0;
        }
    }
    sums.iter().flat_map(|s| [0, 1, 2].map(|c| s[c] / s[3])).collect()
}

/// Moments of each mean over the images of one side.
struct Side(Vec<Welford>);

impl Side {
    fn render(image: &mut dyn FnMut(u32) -> Film, seeds: std::ops::Range<u32>) -> Side {
        let mut of_means = vec![Welford::default(); 3 * (1 + BLOCKS * BLOCKS)];
        for seed in seeds {
            of_means.iter_mut().zip(means(&image(seed))).for_each(|(moments, mean)| moments.add(mean));
        }
        Side(of_means)
    }
}

/// The relative biases that a test detects.
struct Noticed {
    /// In the noisiest channel of the image.
    image: f64,
    /// In half of the blocks and channels.
    block: f64,
}

/// Two-sided t-tests between two sides with equal numbers of images.
struct Comparison([Side; 2]);

impl Comparison {
    /// For each mean: its value without, the difference, and the standard error of the difference.
    fn differences(&self) -> Vec<(f64, f64, f64)> {
        let [without, with] = &self.0;
        let difference = |(a, b): (&Welford, &Welford)| {
            (a.mean(), b.mean() - a.mean(), a.standard_error().hypot(b.standard_error()))
        };
        without.0.iter().zip(&with.0).map(difference).collect()
    }

    fn freedom(&self) -> u64 {
        2 * (self.0[0].0[0].count() - 1)
    }

    fn noticed(&self) -> Noticed {
        let deviation = detectable_deviation(LEVEL, POWER, self.freedom());
        let bias: Vec<f64> = self.differences().iter().map(|(mean, _, error)| deviation * error / mean).collect();
        let lit = |bias: &&f64| bias.is_finite();
        Noticed {
            image: bias[..3].iter().copied().fold(0.0, f64::max),
            block: median(bias[3..].iter().filter(lit).copied()),
        }
    }

    fn is_enough(&self, effort: Effort) -> bool {
        let noticed = self.noticed();
        noticed.image <= effort.image && noticed.block <= effort.block
    }

    /// The factor on the number of images that would give the required power.
    fn missing(&self, effort: Effort) -> f64 {
        let noticed = self.noticed();
        (noticed.image / effort.image).max(noticed.block / effort.block).powi(2)
    }
}

/// Asserts that the images of both functions of the seed have the same means.
#[track_caller]
pub(crate) fn assert_same_light(name: &str, mut without: impl FnMut(u32) -> Film, mut with: impl FnMut(u32) -> Film) {
    let effort = effort();
    // No seed is used twice
    let mut first = 0;
    let mut render = |count: u32| {
        let begin = first;
        first += 2 * count;
        Comparison([
            Side::render(&mut without, begin..begin + count),
            Side::render(&mut with, begin + count..begin + 2 * count),
        ])
    };
    let mut count = (MARGIN * render(PILOT).missing(effort) * f64::from(PILOT)).ceil().max(LEAST.into()) as u32;
    let mut comparison = render(count);
    for _ in 0..ATTEMPTS {
        if !comparison.is_enough(effort) {
            count *= 2;
            comparison = render(count);
        }
    }

    let noticed = comparison.noticed();
    let found = format!("{:.2} % of the image, {:.1} % of blocks", 100.0 * noticed.image, 100.0 * noticed.block);
    let limit = critical_t(LEVEL, comparison.freedom());
    let differences = comparison.differences();
    let wrong: Vec<String> = differences
        .iter()
        .enumerate()
        .filter(|(_, (mean, difference, error))| difference.abs() > limit * error + ROUNDING * mean)
        .map(|(i, (mean, d, error))| format!("mean {}, channel {}: {mean} and {d} ± {error} more", i / 3, i % 3))
        .collect();
    assert!(wrong.is_empty(), "{name}, which notices {found}: {}", wrong.join("\n"));
    assert!(comparison.is_enough(effort), "too much noise: {name} notices {found} by {count} images");
    // Standard output itself: it is shown even if the test passes
    writeln!(
        std::io::stdout().lock(),
        "| {name} | {count} | {:.2} | {:.1} |",
        100.0 * noticed.image,
        100.0 * noticed.block
    )
    .unwrap();
}
