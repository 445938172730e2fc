//! The best number of proposals per sample: over the whole picture by a sweep at equal time, and pixel by pixel by
//! K = (T2/T1)·√((T/T2·V(f/p) − V(f/q)) / (T/T1·V(f/q) − V(f/q))) [Talbot 2005, Eq. 4.3] from measured variances
//! [Talbot et al. 2005, Fig. 3; Talbot 2005, Fig. 5.1 and 5.2].

use super::super::calibrate::{Calibration, calibrate, spend_rest};
use super::super::chart::Chart;
use super::super::measure::{Measured, Method, Stage, View, radiance, reference, turns};
use super::super::page::{Block, Cell, Shown, Table};
use super::super::pictures::{HEAT, Picture, RED_GREEN, Scale, gain, significant};
use super::super::{Observer, ReproduceError};
use super::classes::{Classes, NAMES};
use super::report::{estimate_json, method_json, plus_minus};
use super::scenes::Which;
use super::{Figure, Setup, Summary};
use crate::scene::{Split, StageTimes};
use serde_json::json;
use std::time::{Duration, Instant};

/// M and N of the left picture of the thesis, which sets the time.
const BASE: u32 = 20;
/// Numbers of samples of the sweep.
const SAMPLES: [u32; 9] = [20, 17, 14, 10, 7, 5, 3, 2, 1];
/// Proposals of the rendering from which the variance of visibility follows.
const MANY: u32 = 96;
/// Fewest and most turns.
const TURNS: [u32; 2] = [6, 40];
/// `auto` may have this many times the variance of the best ratio.
const TARGET: f64 = 2.0;

/// V(f/p) and V(f/q) of every pixel.
struct Terms {
    p: Vec<f64>,
    q: Vec<f64>,
}

impl Terms {
    /// From the variances with M = N = 1, and with N = 1 of [`MANY`] proposals: V = V(f/p)/M + (1 − 1/M)·V(f/q). Averaged over
    /// 3 × 3 pixels, since each is from few turns.
    fn new(one: &Measured, many: &Measured, spp: u32, size: [u32; 2]) -> Self {
        let scaled = |m: &Measured| -> Vec<f64> { m.variance_map().iter().map(|v| v * f64::from(spp)).collect() };
        let (p, many) = (smooth(&scaled(one), size), smooth(&scaled(many), size));
        let share = 1.0 / f64::from(MANY);
        let q = p.iter().zip(&many).map(|(p, v)| ((v - p * share) / (1.0 - share)).max(0.0)).collect();
        Terms { p, q }
    }
}

/// Means over 3 × 3 pixels.
fn smooth(values: &[f64], size: [u32; 2]) -> Vec<f64> {
    let [w, h] = size.map(|s| s as i64);
    let at = |x: i64, y: i64| {
        let around = (-1..=1).flat_map(|dy| (-1..=1).map(move |dx| (x + dx, y + dy)));
        let inside = around.filter(|&(x, y)| (0..w).contains(&x) && (0..h).contains(&y));
        let (sum, count) = inside.fold((0.0, 0.0), |(s, c), (x, y)| (s + values[(y * w + x) as usize], c + 1.0));
        sum / count
    };
    (0..w * h).map(|i| at(i % w, i / w)).collect()
}

/// The best M/N of a pixel for a time of `t` per point, from 1 to what one sample leaves; `None` without variance.
fn best_ratio(p: f64, q: f64, t: f64, times: StageTimes) -> Option<f64> {
    let StageTimes { t1, t2 } = times;
    let highest = ((t - t2) / t1).max(1.0);
    if p <= 0.0 {
        return None;
    }
    let above = t / t2 * p - q;
    let below = (t / t1 - 1.0) * q;
    let k = if below > 0.0 { t2 / t1 * (above.max(0.0) / below).sqrt() } else { highest };
    Some(k.clamp(1.0, highest))
}

/// Variance of one estimate that takes the time `t` at the ratio `k` [Talbot 2005, Eq. 4.2].
fn predicted(p: f64, q: f64, k: f64, t: f64, times: StageTimes) -> f64 {
    let n = (t / (k * times.t1 + times.t2)).max(1.0);
    let m = (k * n).max(1.0);
    p / m + (1.0 - 1.0 / m) * q / n
}

/// Everything that was measured.
struct Outcome {
    calibration: Calibration,
    splits: Vec<Split>,
    /// Camera rays per pixel of a turn.
    spp: u32,
    /// The sweep, `auto`, one proposal, one sample of many.
    measured: Vec<Measured>,
    classes: Classes,
    terms: Terms,
}

impl Outcome {
    fn sweep(&self) -> &[Measured] {
        &self.measured[..self.splits.len()]
    }

    fn auto(&self) -> &Measured {
        &self.measured[self.splits.len()]
    }

    /// Position in the sweep of the least variance at equal time; after the last for `auto`.
    fn best(&self, mask: Option<&[bool]>) -> usize {
        let value = |m: &Measured| m.at_equal_time(&self.measured[0], mask).value;
        let all = &self.measured[..=self.splits.len()];
        (0..all.len()).min_by(|&a, &b| value(&all[a]).total_cmp(&value(&all[b]))).unwrap_or(0)
    }
}

/// Renders and measures within about `time`.
pub fn run(setup: &Setup<'_>, time: Duration) -> Result<Figure, ReproduceError> {
    let start = Instant::now();
    let Observer { say, .. } = setup.observer;
    say("Paper, figure 3: proposals per sample …");
    let path = setup.scenes.path(Which::Both);
    let base = Method::ris(BASE, BASE);
    let mut stage = Stage::load(&path, setup.size, setup.options.threads)?;
    let calibration = calibrate(&mut stage, &base, setup.observer)?;
    let mut splits: Vec<Split> = vec![Split { samples: BASE, proposals: BASE }];
    for n in SAMPLES {
        let split = spend_rest(calibration.budget, calibration.times, n);
        if splits.iter().all(|s| s.samples != split.samples) {
            splits.push(split);
        }
    }
    let of = |s: &Split| Method::ris(s.proposals, s.samples);
    let mut methods: Vec<Method> = splits.iter().map(of).collect();
    methods.extend([of(&calibration.split), Method::ris(1, 1), Method::ris(MANY, 1)]);

    // Turns, and camera rays per turn, that fit
    let turn = calibration.seconds / setup.threads as f64 * 1.1 * methods.len() as f64;
    let left = time.saturating_sub(start.elapsed()).as_secs_f64() * 0.95;
    let spp = ((left / turn / f64::from(TURNS[1])) as u32).clamp(1, 16);
    let count = ((left / (turn * f64::from(spp))) as u32).clamp(TURNS[0], TURNS[1]);
    say(&format!("  {count} turns of {} methods, {spp} camera rays each", methods.len()));
    let measured = turns(&mut stage, &methods, View::Centres, spp, 0..count, setup.observer)?;
    let classes = Classes::new(&mut stage, &reference(&measured), setup.observer)?;
    let [one, many] = [2, 1].map(|k| &measured[measured.len() - k]);
    let terms = Terms::new(one, many, spp, stage.size());
    let outcome = Outcome { calibration, splits, spp, measured, classes, terms };

    let mut blocks = vec![Block::Text(format!(
        "Resampling without stratification at the time of M = N = {BASE}, for different M/N. More proposals help where the \
         target is like the integrand, more samples where visibility is not known. T1 = {} ns, T2 = {} ns.",
        significant(calibration.times.t1),
        significant(calibration.times.t2)
    ))];
    blocks.extend(pictures(setup, &mut stage, &outcome)?);
    blocks.extend(tables(&outcome));
    Ok(figure(&outcome, stage.size(), blocks))
}

/// The two pictures of the thesis, and the map.
fn pictures(setup: &Setup<'_>, stage: &mut Stage, o: &Outcome) -> Result<Vec<Block>, ReproduceError> {
    let size = stage.size();
    let to_f32 = |p: Vec<[f64; 3]>| -> Vec<[f32; 3]> { p.iter().map(|p| p.map(|v| v as f32)).collect() };
    let exposure = gain(&to_f32(reference(&o.measured)));
    let mut shown = Vec::new();
    for i in [0, o.splits.len() - 1] {
        let Split { samples, proposals } = o.splits[i];
        let method = o.measured[i].method;
        let rendering = stage.render(&method, View::Antialiased, 1, 0, setup.observer)?;
        let picture = Picture::tone_mapped(size, &to_f32(radiance(&rendering.film)), exposure);
        let file = picture.write(&setup.options.out, &format!("figure-3-m{proposals}-n{samples}"))?;
        let title = format!("M = {proposals}, N = {samples}, one camera ray");
        let caption = format!("time relative to M = N = {BASE}: {:.3}", o.measured[i].time_ratio(&o.measured[0]));
        shown.push(Shown { file, title, caption });
    }

    let (t, times) = (o.calibration.budget, o.calibration.times);
    let ratios: Vec<Option<f64>> =
        o.terms.p.iter().zip(&o.terms.q).map(|(&p, &q)| best_ratio(p, q, t, times)).collect();
    let highest = ((t - times.t2) / times.t1).max(2.0);
    let scale = Scale::new(RED_GREEN, 1.0, highest);
    let colors: Vec<f32> =
        ratios.iter().flat_map(|k| k.map_or([0.0; 3], |k| scale.color(k)).map(|c| (c / 255.0) as f32)).collect();
    let file = Picture::from_display(size, colors).write(&setup.options.out, "figure-3-map")?;
    shown.push(Shown {
        file,
        title: "best M/N of every pixel".to_owned(),
        caption: "green: more proposals; red: more samples; black: no variance".to_owned(),
    });
    let heat = Scale::of_values(HEAT, o.terms.p.iter());
    for (name, title, values) in [
        ("p", "V(f/p): variance of a proposal", &o.terms.p),
        ("q", "V(f/q): variance that visibility alone leaves", &o.terms.q),
    ] {
        let file =
            Picture::colored(size, values, &heat).write(&setup.options.out, &format!("figure-3-variance-{name}"))?;
        shown.push(Shown { file, title: title.to_owned(), caption: String::new() });
    }
    Ok(vec![
        Block::Pictures(shown),
        Block::Legend { title: "best M/N".to_owned(), scale },
        Block::Legend { title: "variance of one estimate (luminance)".to_owned(), scale: heat },
    ])
}

fn ratio_of(s: &Split) -> f64 {
    f64::from(s.proposals) / f64::from(s.samples)
}

fn tables(o: &Outcome) -> Vec<Block> {
    let masks = &o.classes.masks;
    let mut header = vec!["M", "N", "M/N", "time", "variance at equal time"];
    header.extend(NAMES);
    let mut table = Table::new(&header);
    let base = &o.measured[0];
    let auto = (o.calibration.split, o.auto());
    let rows = o.splits.iter().copied().zip(o.sweep()).chain([auto]).enumerate();
    for (i, (split, m)) in rows {
        let name = if i == o.splits.len() { " (auto)" } else { "" };
        let mut cells = vec![
            Cell::text(format!("{}{name}", split.proposals)),
            Cell::number(split.samples.to_string()),
            Cell::number(significant(ratio_of(&split))),
            Cell::number(format!("{:.3}", m.time_ratio(base))),
            Cell::number(plus_minus(m.at_equal_time(base, None))),
        ];
        cells.extend(masks.iter().map(|mask| Cell::number(plus_minus(m.at_equal_time(base, Some(mask))))));
        table.row(cells);
    }
    let curve = |mask: Option<&[bool]>| -> Vec<[f64; 2]> {
        let point = |(s, m): (&Split, &Measured)| [ratio_of(s), m.at_equal_time(base, mask).value];
        o.splits.iter().zip(o.sweep()).map(point).collect()
    };
    let mut chart = Chart::new("M/N", "variance at equal time").with("all pixels", curve(None));
    for (name, mask) in NAMES.iter().zip(masks) {
        chart = chart.with(name, curve(Some(mask)));
    }
    let point = [ratio_of(&o.calibration.split), o.auto().at_equal_time(base, None).value];
    let chart = chart.with("auto, all pixels", vec![point]);
    vec![Block::Table(table), Block::Chart(chart)]
}

fn figure(o: &Outcome, size: [u32; 2], blocks: Vec<Block>) -> Figure {
    let base = &o.measured[0];
    let best = o.best(None);
    let least = o.measured[best].at_equal_time(base, None);
    let auto = o.auto().at_equal_time(base, None);
    let excess = auto.value / least.value.max(1e-300);
    let (t, times) = (o.calibration.budget, o.calibration.times);
    let k = ratio_of(&o.calibration.split);
    let pixels = || o.terms.p.iter().zip(&o.terms.q);
    let of_auto: f64 = pixels().map(|(&p, &q)| predicted(p, q, k, t, times)).sum();
    let of_best: f64 =
        pixels().map(|(&p, &q)| best_ratio(p, q, t, times).map_or(0.0, |k| predicted(p, q, k, t, times))).sum();
    let split = |i: usize| o.splits.get(i).copied().unwrap_or(o.calibration.split);
    let best_of: Vec<String> = NAMES
        .iter()
        .zip(&o.classes.masks)
        .map(|(name, mask)| format!("{name} {}", significant(ratio_of(&split(o.best(Some(mask)))))))
        .collect();
    let summary = Summary {
        paper: "map; T2/T1 is never more than 2 × the variance of the best M/N".to_owned(),
        target: format!("map; auto within {TARGET} × of the best of the sweep"),
        measured: format!(
            "auto (M/N = {}) has {excess:.2} × the variance of the best (M/N = {})",
            significant(k),
            significant(ratio_of(&split(best)))
        ),
        reached: excess <= TARGET,
        reason: format!(
            "best M/N of the sweep by class: {}; the best M/N of every pixel would have {:.2} × the variance of auto",
            best_of.join(", "),
            of_best / of_auto.max(1e-300)
        ),
    };
    let names: Vec<String> = (0..o.measured.len()).map(|i| o.name(i)).collect();
    let rows: Vec<_> = o.measured.iter().zip(&names).map(|(m, n)| method_json(n, m, base, &o.classes)).collect();
    let numbers = json!({
        "size": size, "camera_rays_per_turn": o.spp, "turns": base.turns(),
        "t1_ns": times.t1, "t2_ns": times.t2, "budget_ns": t,
        "auto_over_best": excess, "auto": estimate_json(auto), "best": estimate_json(least),
        "best_per_pixel_over_auto_predicted": of_best / of_auto.max(1e-300),
        "methods": rows,
    });
    Figure {
        id: "paper-figure-3",
        title: "Paper, figure 3; thesis, figures 5.1 and 5.2: proposals per sample",
        summary,
        blocks,
        numbers,
    }
}

impl Outcome {
    fn name(&self, i: usize) -> String {
        let n = self.splits.len();
        let role = if i == n { "auto: " } else { "" };
        let m = self.measured[i].method;
        format!("{role}M = {}, N = {}", m.proposals, m.samples)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_best_ratio_is_where_the_predicted_variance_is_least() {
        let times = StageTimes { t1: 10.0, t2: 150.0 };
        let t = 3200.0;
        for (p, q) in [(1.0, 0.1), (5.0, 0.02), (1.0, 0.9), (0.3, 0.05)] {
            let k = best_ratio(p, q, t, times).unwrap();
            let least = predicted(p, q, k, t, times);
            for factor in [0.7, 0.9, 0.97, 1.03, 1.1, 1.4] {
                let other = (k * factor).clamp(1.0, (t - times.t2) / times.t1);
                assert!(predicted(p, q, other, t, times) >= least * (1.0 - 1e-9), "{p} {q} {k} {other}");
            }
            // T2/T1 is at most twice as bad.
            assert!(predicted(p, q, times.t2 / times.t1, t, times) <= 2.0 * least);
        }
        assert_eq!(best_ratio(0.0, 0.0, t, times), None);
        assert_eq!(best_ratio(1.0, 0.0, t, times), Some(305.0));
    }

    #[test]
    fn smoothing_keeps_constants_and_stays_inside() {
        assert_eq!(smooth(&[2.0; 12], [4, 3]), vec![2.0; 12]);
        assert_eq!(smooth(&[0.0, 9.0], [2, 1]), vec![4.5, 4.5]);
    }
}
