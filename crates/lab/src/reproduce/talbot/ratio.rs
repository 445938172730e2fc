//! The best number of proposals per sample: over the whole image by a sweep at equal time, and pixel by pixel by
//! K = (T2/T1)·√((T/T2·V(f/p) − V(f/q)) / (T/T1·V(f/q) − V(f/q))) [Talbot 2005, Eq. 4.3] from measured variances
//! [Talbot et al. 2005, Fig. 3; Talbot 2005, Fig. 5.1 and 5.2].

use super::super::calibrate::{Calibration, calibrate, counts_for_budget};
use super::super::chart::Chart;
use super::super::figure::{Figure, Summary, estimate_json, plus_minus};
use super::super::images::{HEAT, Image, RED_GREEN, Scale, gain, significant};
use super::super::measure::{Measured, PixelPlan, Stage, View, radiance, reference, turns};
use super::super::method::Method;
use super::super::page::{Block, Cell, Shown, Table};
use super::super::{Observer, ReproduceError};
use super::classes::{Classes, NAMES};
use super::report::method_json;
use super::scenes::Which;
use super::setup::{Setup, portrait};
use lumiris::settings::SampleCounts;
use lumiris_numbers::estimators::ris::sample_counts::{Costs, Variances, clamp_ratio, optimal_ratio};
use serde_json::json;
use std::time::{Duration, Instant};

/// M and N of the left image of the thesis, which determine the time.
const BASE: u32 = 20;
/// Numbers of samples of the sweep.
const SAMPLES: [u32; 9] = [20, 17, 14, 10, 7, 5, 3, 2, 1];
/// Proposals of the rendering that measures the variance of visibility.
const MANY: u32 = 96;
/// Maximum number of camera rays per turn: normal and quick.
const MAX_CAMERA_RAYS: [u32; 2] = [16, 4];
/// Minimum and maximum number of turns.
const TURNS: [u32; 2] = [6, 40];
/// Maximum ratio of the variance of `auto` to the best ratio's.
const TARGET: f64 = 2.0;

/// V(f/p) and V(f/q) of every pixel.
struct Terms(Vec<Variances>);

impl Terms {
    /// From the variances with M = N = 1, and with N = 1 of [`MANY`] proposals: V = V(f/p)/M + (1 − 1/M)·V(f/q).
    /// Averaged over 3 × 3 pixels, since there are few turns.
    fn new(one: &Measured, many: &Measured, spp: u32, size: [u32; 2]) -> Self {
        let scaled = |m: &Measured| -> Vec<f64> { m.variance_map().iter().map(|v| v * f64::from(spp)).collect() };
        let (p, many) = (smooth(&scaled(one), size), smooth(&scaled(many), size));
        let share = 1.0 / f64::from(MANY);
        let samples = |p: f64, v: f64| ((v - p * share) / (1.0 - share)).max(0.0);
        let pixels = p.iter().zip(&many);
        Terms(pixels.map(|(&p, &v)| Variances { proposals: p, samples: samples(p, v) }).collect())
    }

    /// The best M/N of every pixel; `None` without variance.
    fn ratios(&self, costs: Costs, time: f64) -> Vec<Option<f64>> {
        let best = |v: &Variances| (v.proposals > 0.0).then(|| optimal_ratio(costs, *v, time));
        self.0.iter().map(best).collect()
    }

    /// Mean variance of an estimate that takes `time`, with the ratio `ratio(pixel)`.
    fn predicted(&self, costs: Costs, time: f64, ratio: impl Fn(usize) -> f64) -> f64 {
        let of_pixel = |(i, v): (usize, &Variances)| {
            let k = clamp_ratio(ratio(i), costs, time);
            let n = (time / (k * costs.t1 + costs.t2)).max(1.0);
            v.of_estimate(k * n, n)
        };
        self.0.iter().enumerate().map(of_pixel).sum::<f64>() / self.0.len().max(1) as f64
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

/// All measurements.
struct Outcome {
    calibration: Calibration,
    swept: Vec<SampleCounts>,
    /// Camera rays per pixel of a turn.
    spp: u32,
    /// The sweep, `auto`, the optimum of each pixel by the renderer's pilot, one proposal, one sample of many.
    measured: Vec<Measured>,
    /// M/N of each pixel by the renderer's pilot, and the processor time of the pilot (s).
    pilot: Vec<f32>,
    pilot_seconds: f64,
    classes: Classes,
    terms: Terms,
}

impl Outcome {
    fn sweep(&self) -> &[Measured] {
        &self.measured[..self.swept.len()]
    }

    fn auto(&self) -> &Measured {
        &self.measured[self.swept.len()]
    }

    fn per_pixel(&self) -> &Measured {
        &self.measured[self.swept.len() + 1]
    }

    /// Index in the sweep of the least variance at equal time; after the last for `auto`.
    fn best(&self, mask: Option<&[bool]>) -> usize {
        let value = |m: &Measured| m.at_equal_time(&self.measured[0], mask).value;
        let all = &self.measured[..=self.swept.len()];
        (0..all.len()).min_by(|&a, &b| value(&all[a]).total_cmp(&value(&all[b]))).unwrap_or(0)
    }
}

/// Renders and measures within about `time`.
pub(super) fn run(setup: &Setup<'_>, time: Duration) -> Result<Figure, ReproduceError> {
    let start = Instant::now();
    let Observer { say, .. } = setup.observer;
    say("Paper, figure 3: proposals per sample …");
    let path = setup.scenes.path(Which::Both);
    let base = Method::ris(BASE, BASE);
    let mut stage = Stage::load(&path, portrait(setup.size), setup.options.threads)?;
    let calibration = calibrate(&mut stage, &base, setup.observer)?;
    let mut swept: Vec<SampleCounts> = vec![SampleCounts { samples: BASE, proposals: BASE }];
    for n in SAMPLES {
        let sample_counts = counts_for_budget(calibration.budget, calibration.times, n);
        if swept.iter().all(|s| s.samples != sample_counts.samples) {
            swept.push(sample_counts);
        }
    }
    let of = |s: &SampleCounts| Method::ris(s.proposals, s.samples);
    let mut methods: Vec<Method> = swept.iter().map(of).collect();
    let per_pixel = Method { per_pixel: true, ..of(&calibration.sample_counts) };
    methods.extend([of(&calibration.sample_counts), per_pixel, Method::ris(1, 1), Method::ris(MANY, 1)]);
    let PixelPlan { ratios: pilot, seconds: pilot_seconds } =
        stage.plan_per_pixel(calibration.times, calibration.budget)?;

    // Turns, and camera rays per turn, that fit the time
    let quick = usize::from(setup.options.quick);
    let turn = calibration.seconds * 1.1 * methods.len() as f64;
    let left = time.saturating_sub(start.elapsed()).as_secs_f64() * 0.95;
    let spp = ((left / turn / f64::from(TURNS[1])) as u32).clamp(1, MAX_CAMERA_RAYS[quick]);
    let count = ((left / (turn * f64::from(spp))) as u32).clamp(TURNS[0], TURNS[1]);
    say(&format!("  {count} turns of {} methods, {spp} camera rays each", methods.len()));
    let measured = turns(&mut stage, &methods, View::Centres, spp, 0..count, setup.observer)?;
    let classes = Classes::new(&mut stage, &reference(&measured), setup.observer)?;
    let [one, many] = [2, 1].map(|k| &measured[measured.len() - k]);
    let terms = Terms::new(one, many, spp, stage.size());
    let outcome = Outcome { calibration, swept, spp, measured, pilot, pilot_seconds, classes, terms };

    let mut blocks = vec![Block::Text(format!(
        "Resampling without stratification at the time of M = N = {BASE}, for different M/N. More proposals help where the \
         target is like the integrand, more samples where visibility is not known. T1 = {} ns, T2 = {} ns.",
        significant(calibration.times.t1),
        significant(calibration.times.t2)
    ))];
    blocks.extend(images(setup, &mut stage, &outcome)?);
    blocks.extend(tables(&outcome));
    Ok(figure(&outcome, stage.size(), blocks))
}

/// The two images of the thesis, and the map.
fn images(setup: &Setup<'_>, stage: &mut Stage, o: &Outcome) -> Result<Vec<Block>, ReproduceError> {
    // One camera ray per pixel, with the first and the last M/N of the sweep
    let size = stage.size();
    let to_f32 = |p: Vec<[f64; 3]>| -> Vec<[f32; 3]> { p.iter().map(|p| p.map(|v| v as f32)).collect() };
    let exposure = gain(&to_f32(reference(&o.measured)));
    let mut shown = Vec::new();
    for i in [0, o.swept.len() - 1] {
        let SampleCounts { samples, proposals } = o.swept[i];
        let method = o.measured[i].method;
        let rendering = stage.render(&method, View::Antialiased, 1, 0, setup.observer)?;
        let image = Image::tone_mapped(size, &to_f32(radiance(&rendering.film)), exposure);
        let file = image.write(&setup.options.out, &format!("figure-3-m{proposals}-n{samples}"))?;
        let title = format!("M = {proposals}, N = {samples}, one camera ray");
        let caption = format!("time relative to M = N = {BASE}: {:.3}", o.measured[i].time_ratio(&o.measured[0]));
        shown.push(Shown { file, title, caption });
    }

    // Maps of the best M/N: from the measured variances, and from the pilot
    let Calibration { times: costs, budget: time, .. } = o.calibration;
    let is_surface = o.classes.visibility.iter().map(|v| !v.is_nan());
    let ratios: Vec<Option<f64>> =
        o.terms.ratios(costs, time).into_iter().zip(is_surface).map(|(k, is)| k.filter(|_| is)).collect();
    let scale = Scale::new(RED_GREEN, 1.0, clamp_ratio(f64::INFINITY, costs, time).max(2.0));
    let of_pilot: Vec<Option<f64>> =
        ratios.iter().zip(&o.pilot).map(|(measured, &k)| measured.map(|_| f64::from(k))).collect();
    for (name, title, map) in [
        ("map", "best M/N of every pixel, from the variances measured here", &ratios),
        ("pilot", "best M/N of every pixel, by the renderer's pilot", &of_pilot),
    ] {
        let color = |k: &Option<f64>| k.map_or([0.0; 3], |k| scale.color(k)).map(|c| (c / 255.0) as f32);
        let colors = map.iter().flat_map(color).collect();
        let file = Image::from_display(size, colors).write(&setup.options.out, &format!("figure-3-{name}"))?;
        let caption = "green: more proposals; red: more samples; black: nothing lit".to_owned();
        shown.push(Shown { file, title: title.to_owned(), caption });
    }

    // Maps of both variance terms
    let [p, q]: [Vec<f64>; 2] =
        [|v: &Variances| v.proposals, |v: &Variances| v.samples].map(|f| o.terms.0.iter().map(f).collect());
    let heat = Scale::of_values(HEAT, &p);
    for (name, title, values) in
        [("p", "V(f/p): variance of a proposal", &p), ("q", "V(f/q): variance that visibility alone leaves", &q)]
    {
        let file =
            Image::colored(size, values, &heat).write(&setup.options.out, &format!("figure-3-variance-{name}"))?;
        shown.push(Shown { file, title: title.to_owned(), caption: String::new() });
    }
    Ok(vec![
        Block::Images(shown),
        Block::Legend { title: "best M/N".to_owned(), scale },
        Block::Legend { title: "variance of one estimate (luminance)".to_owned(), scale: heat },
    ])
}

fn ratio_of(s: &SampleCounts) -> f64 {
    f64::from(s.proposals) / f64::from(s.samples)
}

fn tables(o: &Outcome) -> Vec<Block> {
    // Columns
    let masks = &o.classes.masks;
    let mut header = vec!["M", "N", "M/N", "time", "variance at equal time"];
    header.extend(NAMES);
    let mut table = Table::new(&header);

    // Rows: the sweep, auto, and M and N per pixel
    let base = &o.measured[0];
    let auto = (o.calibration.sample_counts, o.auto());
    let rows = o.swept.iter().copied().zip(o.sweep()).chain([auto, (o.calibration.sample_counts, o.per_pixel())]);
    for (i, (sample_counts, m)) in rows.enumerate() {
        let name = if i == o.swept.len() { " (auto)" } else { "" };
        let numbers = match m.method.per_pixel {
            true => ["per pixel".to_owned(), String::new(), String::new()],
            false => [
                format!("{}{name}", sample_counts.proposals),
                sample_counts.samples.to_string(),
                significant(ratio_of(&sample_counts)),
            ],
        };
        let [proposals, samples, ratio] = numbers;
        let mut cells = vec![
            Cell::text(proposals),
            Cell::number(samples),
            Cell::number(ratio),
            Cell::number(format!("{:.3}", m.time_ratio(base))),
            Cell::number(plus_minus(m.at_equal_time(base, None))),
        ];
        cells.extend(masks.iter().map(|mask| Cell::number(plus_minus(m.at_equal_time(base, Some(mask))))));
        table.row(cells);
    }

    // The variance by M/N, for all pixels and for each class
    let curve = |mask: Option<&[bool]>| -> Vec<[f64; 2]> {
        let point = |(s, m): (&SampleCounts, &Measured)| [ratio_of(s), m.at_equal_time(base, mask).value];
        o.swept.iter().zip(o.sweep()).map(point).collect()
    };
    let mut chart = Chart::new("M/N", "variance at equal time").with("all pixels", curve(None));
    for (name, mask) in NAMES.iter().zip(masks) {
        chart = chart.with(name, curve(Some(mask)));
    }
    let point = [ratio_of(&o.calibration.sample_counts), o.auto().at_equal_time(base, None).value];
    let chart = chart.with("auto, all pixels", vec![point]);
    let note = format!(
        "Per pixel: M and N by the variances that the renderer's pilot found, which took {} processor seconds once, not \
         counted above.",
        significant(o.pilot_seconds)
    );
    vec![Block::Table(table), Block::Note(note), Block::Chart(chart)]
}

fn figure(o: &Outcome, size: [u32; 2], blocks: Vec<Block>) -> Figure {
    // The excess of auto over the best of the sweep
    let base = &o.measured[0];
    let best = o.best(None);
    let min = o.measured[best].at_equal_time(base, None);
    let auto = o.auto().at_equal_time(base, None);
    let excess = auto.value / min.value.max(1e-300);

    // Predicted variances with the M/N of auto and with the best M/N of every pixel
    let Calibration { times: costs, budget: time, .. } = o.calibration;
    let k = ratio_of(&o.calibration.sample_counts);
    let is_surface = o.classes.visibility.iter().map(|v| !v.is_nan());
    let ratios: Vec<Option<f64>> =
        o.terms.ratios(costs, time).into_iter().zip(is_surface).map(|(k, is)| k.filter(|_| is)).collect();
    let of_auto = o.terms.predicted(costs, time, |_| k);
    let of_best = o.terms.predicted(costs, time, |i| ratios[i].unwrap_or(k));

    // The best M/N by class
    let sample_counts = |i: usize| o.swept.get(i).copied().unwrap_or(o.calibration.sample_counts);
    let best_of: Vec<String> = NAMES
        .iter()
        .zip(&o.classes.masks)
        .map(|(name, mask)| format!("{name} {}", significant(ratio_of(&sample_counts(o.best(Some(mask)))))))
        .collect();
    let summary = Summary {
        paper: "map; T2/T1 is never more than 2 × the variance of the best M/N".to_owned(),
        target: format!("map; auto within {TARGET} × of the best of the sweep"),
        measured: format!(
            "auto (M/N = {}) has {excess:.2} × the variance of the best (M/N = {})",
            significant(k),
            significant(ratio_of(&sample_counts(best)))
        ),
        reached: excess <= TARGET,
        reason: format!(
            "best M/N of the sweep by class: {}; the best M/N of every pixel would have {:.2} × the variance of auto, the \
             pilot's has {:.2} ×",
            best_of.join(", "),
            of_best / of_auto.max(1e-300),
            o.per_pixel().at_equal_time(o.auto(), None).value
        ),
    };

    // The numbers
    let names: Vec<String> = (0..o.measured.len()).map(|i| o.name(i)).collect();
    let rows: Vec<_> = (0..names.len()).map(|i| method_json(&names[i], &o.measured, i, &o.classes)).collect();
    let numbers = json!({
        "size": size, "camera_rays_per_turn": o.spp, "turns": base.turns(),
        "t1_ns": costs.t1, "t2_ns": costs.t2, "budget_ns": time,
        "auto_over_best": excess, "auto": estimate_json(auto), "best": estimate_json(min),
        "pilot_seconds": o.pilot_seconds, "best_per_pixel_over_auto_predicted": of_best / of_auto.max(1e-300),
        "methods": rows,
    });
    let title = "Paper, figure 3; thesis, figures 5.1 and 5.2: proposals per sample";
    Figure { id: "paper-figure-3", title, summary, also: Vec::new(), blocks, numbers }
}

impl Outcome {
    fn name(&self, i: usize) -> String {
        let n = self.swept.len();
        let m = self.measured[i].method;
        if m.per_pixel {
            return "per pixel".to_owned();
        }
        let role = if i == n { "auto: " } else { "" };
        format!("{role}M = {}, N = {}", m.proposals, m.samples)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn smoothing_keeps_constants_and_stays_inside() {
        assert_eq!(smooth(&[2.0; 12], [4, 3]), vec![2.0; 12]);
        assert_eq!(smooth(&[0.0, 9.0], [2, 1]), vec![4.5, 4.5]);
    }
}
