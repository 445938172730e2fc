//! Which fraction of the light samples goes to lights at infinity, as `--estimator auto` finds it by a pilot.
//!
//! Beside lamps, a sky may have nearly all of the light that is reflected, or, as through windows, nearly none of it; and
//! what counts is how much of the variance it has. Fractions are those of a few binary digits: points of a net whose first
//! coordinate lies in such an interval are a net again, so that samples of the sky and of the lamps stay well distributed.
//!
//! Light samples of lamps may take longer than those of the sky, so fractions are compared by efficiency.

use super::auto_round::{Round, Trial};
use crate::lights::LightSampling;
use crate::settings::IntegratorSettings;

/// Fractions among which is chosen.
const FRACTIONS: [f32; 6] = [0.125, 0.25, 0.5, 0.75, 0.875, 0.9375];
/// By how much a fraction must be better than the one before it, and standard errors by which it must be.
const MIN_GAIN: f64 = 1.1;
const MIN_ERRORS: f64 = 1.0;

/// True if there is anything to choose.
pub(super) fn is_open(lights: &LightSampling, settings: &IntegratorSettings) -> bool {
    let choice = lights.sampler.tree().filter(|choice| !choice.infinite.is_empty() && !choice.tree.is_empty());
    settings.infinite_fraction.is_none() && choice.is_some()
}

/// The fraction that is most efficient by what `measure` finds for each, in rounds of one candidate; the trials, of which the
/// first is that without a choice, whose fraction is `usual`. `Err` is that of `measure`.
pub(super) fn best<E>(
    usual: f32,
    mut measure: impl FnMut(Option<f32>) -> Result<Round, E>,
) -> Result<(Vec<Trial>, Option<f32>), E> {
    let base = measure(None)?;
    let mut trials = vec![trial("infinite fraction as usual", &base, &base)];
    let above = FRACTIONS.iter().copied().filter(|&f| f > usual);
    let below = FRACTIONS.iter().rev().copied().filter(|&f| f < usual);
    for fractions in [above.collect::<Vec<_>>(), below.collect()] {
        let mut best: Option<(f32, Round)> = None;
        for fraction in fractions {
            let found = measure(Some(fraction))?;
            trials.push(trial(&format!("infinite fraction {fraction}"), &found, &base));
            let (gain, error) = found.gain_over(best.as_ref().map_or(&base, |(_, round)| round));
            if gain <= MIN_GAIN.ln().max(MIN_ERRORS * error) {
                break;
            }
            best = Some((fraction, found));
        }
        if let Some((fraction, _)) = best {
            return Ok((trials, Some(fraction)));
        }
    }
    Ok((trials, None))
}

fn trial(name: &str, round: &Round, base: &Round) -> Trial {
    let (gain, error) = round.gain_over(base);
    let (nanoseconds, variance) = (round.measured[0].0, round.variances(0)[0]);
    Trial { name: name.to_owned(), nanoseconds, variance, efficiency: gain.exp(), error }
}

#[cfg(test)]
mod tests {
    use super::super::auto_round::Mean;
    use super::*;

    /// The choice where the variance is a/p + b/(1 − p), of which the infinite lights have a, and the number of fractions
    /// measured; the time is 1 + c (1 − p).
    fn chosen([a, b, c]: [f64; 3]) -> (usize, Option<f32>) {
        let measure = |fraction: Option<f32>| {
            let p = f64::from(fraction.unwrap_or(0.5));
            let variance = a / p + b / (1.0 - p);
            let of_pixel = |i: usize| (0.9 + 0.2 * (i % 7) as f64 / 6.0) * variance;
            let differences = (0..224).map(of_pixel).map(|v| [v.sqrt(), 2.0 * v]).collect();
            let measured = vec![(1.0 + c * (1.0 - p), differences)];
            Ok::<_, ()>(Round::of(measured, 4, Mean::Squares))
        };
        let (trials, fraction) = best(0.5, measure).unwrap();
        (trials.len(), fraction)
    }

    #[test]
    fn the_fraction_is_the_best_of_few() {
        // The best is 1/(1 + √(b/a))
        assert_eq!(chosen([1.0, 1.0, 0.0]), (3, None));
        assert_eq!(chosen([9.0, 1.0, 0.0]), (3, Some(0.75)));
        assert_eq!(chosen([99.0, 1.0, 0.0]), (4, Some(0.875)));
        assert_eq!(chosen([1.0, 9.0, 0.0]), (4, Some(0.25)));
        assert_eq!(chosen([0.0, 1.0, 0.0]), (4, Some(0.125)));
        // Lamps take ten times as long
        assert_eq!(chosen([1.0, 1.0, 9.0]), (3, Some(0.75)));
    }
}
