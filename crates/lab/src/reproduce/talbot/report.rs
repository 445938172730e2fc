//! Converts measurements to sections of the page and to JSON.

use super::super::ReproduceError;
use super::super::figure::{Figure, Summary, estimate_json, percent, plus_minus};
use super::super::images::{HEAT, Image, Scale, gain, significant};
use super::super::measure::{Estimate, Measured, Seconds, same_mean};
use super::super::page::{Block, Cell, Shown, Table};
use super::super::verdicts::{falls, helps_most_in_shadow, reduced_by_resampling};
use super::cases::Kind;
use super::classes::{Classes, LIT, NAMES, SHADOWED};
use super::outcome::Outcome;
use super::roster::Roles;
use super::setup::Setup;
use lumiris::settings::SampleCounts;
use serde_json::{Value, json};

/// All numbers of a method among the methods of its turns, the first of which is the baseline.
pub(super) fn method_json(name: &str, all: &[Measured], method: usize, classes: &Classes) -> Value {
    // By class of pixels
    let (m, base) = (&all[method], &all[0]);
    let class = |k: usize| {
        let mask = Some(&classes.masks[k][..]);
        json!({
            "pixels": classes.counts()[k],
            "variance": estimate_json(m.variance(mask)),
            "at_equal_time": estimate_json(m.at_equal_time(base, mask)),
        })
    };
    let by_class: serde_json::Map<String, Value> = (0..3).map(|k| (NAMES[k].to_owned(), class(k))).collect();

    // Over all pixels
    json!({
        "name": name,
        "estimator": <&str>::from(m.method.estimator), "samples": m.method.samples, "proposals": m.method.proposals,
        "strata": <&str>::from(m.method.strata), "points": m.method.points.name(),
        "turns": m.turns(), "variance": estimate_json(m.variance(None)),
        "time_ratio": m.time_ratio(base), "at_equal_time": estimate_json(m.at_equal_time(base, None)),
        "mean": estimate_json(m.mean()), "same_mean_p": same_mean(all, method),
        "classes": by_class, "seconds": m.seconds,
        "segments": m.segments, "proposals_drawn": m.proposals, "invalid_samples": m.invalid,
    })
}

/// The section of a case.
pub(super) fn comparison(setup: &Setup<'_>, o: &Outcome<'_>) -> Result<Figure, ReproduceError> {
    // Facts
    let SampleCounts { samples, proposals } = o.calibration.sample_counts;
    let [triangles, lights] = o.stage_facts;
    let base = &o.measured[o.roles.base];
    let mut blocks = vec![
        Block::Text(o.case.intro.to_owned()),
        Block::Facts(vec![
            ("scene".to_owned(), format!("{triangles} triangles, {lights} lights")),
            (
                "image".to_owned(),
                format!("{} × {} pixels, {} camera rays per pixel", o.size[0], o.size[1], o.case.primary),
            ),
            ("turns".to_owned(), format!("{} of {} methods each", base.turns(), o.measured.len())),
            ("T1, a proposal".to_owned(), format!("{} ns", significant(o.calibration.times.t1))),
            ("T2, a sample".to_owned(), format!("{} ns", significant(o.calibration.times.t2))),
            (
                "M and N".to_owned(),
                format!("{proposals} and {samples}, for {} ns per point", significant(o.calibration.budget)),
            ),
        ]),
    ];

    // Images and tables
    blocks.extend(images(setup, o)?);
    blocks.extend(tables(o));

    // The summary
    let (summary, also) = match o.case.kind {
        Kind::Reduction { paper, target, .. } => reductions(o, [paper, target]),
        Kind::Stratification => (stratification(o), Vec::new()),
    };

    // The numbers
    let rows: Vec<Value> =
        (0..o.methods.len()).map(|i| method_json(&o.methods[i].name, &o.measured, i, &o.classes)).collect();
    let antialiased: Vec<Value> =
        (0..o.antialiased.len()).map(|i| method_json("antialiased", &o.antialiased, i, &o.classes)).collect();
    let numbers = json!({
        "size": o.size, "camera_rays": o.case.primary, "turns": base.turns(),
        "t1_ns": o.calibration.times.t1, "t2_ns": o.calibration.times.t2, "budget_ns": o.calibration.budget,
        "proposals": proposals, "samples": samples,
        "visibility_share_of_ris": visibility(o).share, "visibility_bound": visibility(o).bound,
        "judged": o.roles.judged, "equal_halves": o.roles.equal_halves,
        "methods": rows, "antialiased": antialiased,
    });
    Ok(Figure { id: o.case.id, title: o.case.title, summary, also, blocks, numbers })
}

/// Variance of unstratified resampling due to visibility alone.
struct VisibilityVariance {
    /// Relative to the baseline, both at the time of the baseline.
    bound: f64,
    /// Fraction of the total variance of unstratified resampling.
    share: f64,
}

/// V(f/q) comes from one sample of many proposals by [Talbot 2005, Eq. 4.2].
fn visibility(o: &Outcome<'_>) -> VisibilityVariance {
    let (base, plain) = (&o.measured[o.roles.base], &o.measured[o.roles.plain]);
    let many = &o.measured[o.roles.visibility];
    let (m, n) = (f64::from(plain.method.proposals), f64::from(plain.method.samples));
    let share = 1.0 / f64::from(many.method.proposals);
    // V_many = s·P + (1 − s)·Q and V_plain = P/M + (1 − 1/M)·Q/N, for P = V(f/p) and Q = V(f/q)
    let (v_many, v_plain) = (many.variance(None).value, plain.variance(None).value);
    let determinant = share * (1.0 - 1.0 / m) / n - (1.0 - share) / m;
    let q = if determinant.abs() > 1e-12 { (share * v_plain - v_many / m) / determinant } else { v_many };
    let left = (1.0 - 1.0 / m) * q.max(0.0) / n;
    let base_variance = base.variance(None).value.max(1e-300);
    VisibilityVariance { bound: left / base_variance * plain.time_ratio(base), share: left / v_plain.max(1e-300) }
}

/// The row of resampling number `i`.
fn reduction(o: &Outcome<'_>, i: usize, [paper, target]: [f64; 2]) -> Summary {
    // Variances relative to the baseline at equal time
    let base = &o.measured[o.roles.base];
    let m = &o.measured[i];
    let at = |i: usize| o.measured[i].at_equal_time(base, None);
    let counts = [m.method.proposals, m.method.samples];
    let reached = reduced_by_resampling(counts, at(i), target);
    let VisibilityVariance { bound, share } = visibility(o);

    // M, N, and the effect of stratification
    let mut reason = format!("M = {}, N = {}", m.method.proposals, m.method.samples);
    if m.method.proposals == m.method.samples {
        reason += ", so that nothing is resampled";
    }
    reason += &format!("; without stratification {}", percent(at(o.roles.plain)));
    if let Some(stratified) = o.roles.base_stratified {
        reason += &format!(
            "; stratified samples alone give mc {}, and against that it is {}",
            percent(at(stratified)),
            percent(m.at_equal_time(&o.measured[stratified], None))
        );
        if i == o.roles.judged {
            let [base, judged, stratified] = [0, 1, 2].map(|k| &o.antialiased[k]);
            reason += &format!(
                "; with antialiasing it is {} against mc, {} against mc with stratified samples",
                percent(judged.at_equal_time(base, None)),
                percent(judged.at_equal_time(stratified, None))
            );
        }
    }

    // The share of visibility, and its lower bound
    reason += &format!("; visibility is {:.0} % of the variance of unstratified ris", share * 100.0);
    if !reached && i == o.roles.equal_halves {
        reason += &format!(", so that no number of proposals brings it below {:+.0} %", (bound - 1.0) * 100.0);
    }
    Summary {
        paper: format!("−{paper} % variance at equal time"),
        target: format!("−{target} %"),
        measured: percent(at(i)),
        reached,
        reason,
    }
}

/// The row of the judged M and N, and the row of equal halves of the time if it differs.
fn reductions(o: &Outcome<'_>, printed: [f64; 2]) -> (Summary, Vec<(&'static str, Summary)>) {
    let Roles { judged, equal_halves, .. } = o.roles;
    let beside = (judged != equal_halves).then(|| {
        let about = "equal halves of the time for proposals and samples, stratified";
        (about, reduction(o, equal_halves, printed))
    });
    (reduction(o, judged, printed), beside.into_iter().collect())
}

/// The row of the kinds of stratification, which the list of methods has in the order of the thesis.
fn stratification(o: &Outcome<'_>) -> Summary {
    let base = &o.measured[o.roles.base];
    let masks = &o.classes.masks;
    let at = |i: usize, mask: Option<&[bool]>| o.measured[i].at_equal_time(base, mask);
    let none = Estimate { value: 1.0, error: 0.0 };
    let steps: Vec<Estimate> = std::iter::once(none).chain((1..=4).map(|i| at(i, None))).collect();
    // The ratio of the variance with strata of samples to the variance with stratified proposals only
    let left = |i: usize| {
        [0, 1, 2].map(|k| {
            let mask = Some(&masks[k][..]);
            at(i, mask).value / at(1, mask).value.max(1e-300)
        })
    };
    let by_class = |left: [f64; 3]| -> String {
        let classes: Vec<String> = NAMES.iter().zip(left).map(|(name, v)| format!("{name} {v:.2}")).collect();
        classes.join(", ")
    };
    let of_proposals = [0, 1, 2].map(|k| at(1, Some(&masks[k])).value);
    let list: Vec<String> = steps[1..].iter().map(|e| format!("{:.3} ± {:.3}", e.value, e.error)).collect();
    Summary {
        paper: "each step less variance; strata of samples most in shadow".to_owned(),
        target: "same order, each step by more than its noise; less left in penumbra and in shadow than in light"
            .to_owned(),
        measured: format!("1 → {} (proposals, equal-proposals, equal-weights, systematic)", list.join(", ")),
        reached: falls(&steps) && (2..=4).all(|i| helps_most_in_shadow(left(i))),
        reason: format!(
            "stratified proposals leave {} of the variance; of that, equal-proposals strata leave {}, equal-weights strata {}, \
             systematic samples {}",
            by_class(of_proposals),
            by_class(left(2)),
            by_class(left(3)),
            by_class(left(4))
        ),
    }
}

fn images(setup: &Setup<'_>, o: &Outcome<'_>) -> Result<Vec<Block>, ReproduceError> {
    // The exposure comes from the reference
    let out = &setup.options.out;
    let id = o.case.id.replace('.', "-");
    let reference: Vec<[f32; 3]> = o.reference.iter().map(|p| p.map(|v| v as f32)).collect();
    let exposure = gain(&reference);

    // Antialiased images of the baseline and the judged method
    let chosen = [o.roles.base, o.roles.judged];
    let base_seconds = o.antialiased[0].seconds[0].processor;
    let mut shown = Vec::new();
    for (k, &i) in chosen.iter().enumerate() {
        let m = &o.antialiased[k];
        let SampleCounts { samples, proposals } =
            SampleCounts { samples: m.method.samples, proposals: m.method.proposals };
        let file = Image::tone_mapped(o.size, &m.first, exposure).write(out, &format!("{id}-{k}"))?;
        let seconds = m.seconds[0].processor;
        let caption = format!(
            "M = {proposals}, N = {samples}; {} processor seconds ({:+.1} %); variance with antialiasing {}",
            significant(seconds),
            (seconds / base_seconds - 1.0) * 100.0,
            significant(m.variance(None).value)
        );
        shown.push(Shown { file, title: o.methods[i].name.clone(), caption });
    }

    // Their variances, on the same scale
    let maps: Vec<Vec<f64>> = chosen.iter().map(|&i| o.measured[i].variance_map()).collect();
    let scale = Scale::of_values(HEAT, maps.iter().flatten());
    for (k, (&i, map)) in chosen.iter().zip(&maps).enumerate() {
        let file = Image::colored(o.size, map, &scale).write(out, &format!("{id}-variance-{k}"))?;
        shown.push(Shown { file, title: format!("variance: {}", o.methods[i].name), caption: String::new() });
    }

    // The reference
    let file = Image::tone_mapped(o.size, &reference, exposure).write(out, &format!("{id}-mean"))?;
    let title = "mean of all turns of all methods".to_owned();
    shown.push(Shown { file, title, caption: String::new() });

    // The visibility
    let grey = |&v: &f64| if v.is_nan() { [0.0, 0.0, 0.1] } else { [v.clamp(0.0, 1.0) as f32; 3] };
    let visibility: Vec<[f32; 3]> = o.classes.visibility.iter().map(grey).collect();
    let file = Image::tone_mapped(o.size, &visibility, 1.0).write(out, &format!("{id}-visibility"))?;
    let title = "part of the light that arrives".to_owned();
    shown.push(Shown { file, title, caption: String::new() });
    let title = "variance of the pixel (luminance)".to_owned();
    Ok(vec![Block::Images(shown), Block::Legend { title, scale }])
}

fn tables(o: &Outcome<'_>) -> Vec<Block> {
    // Variances and times of the methods
    let base = &o.measured[o.roles.base];
    let mut header = vec!["method", "M", "N", "variance", "time", "at equal time"];
    header.extend(NAMES);
    header.push("same mean, p");
    let mut table = Table::new(&header);
    for (i, (named, m)) in o.methods.iter().zip(&o.measured).enumerate() {
        let mut cells = vec![
            Cell::text(&named.name),
            Cell::number(m.method.proposals.to_string()),
            Cell::number(m.method.samples.to_string()),
            Cell::number(plus_minus(m.variance(None))),
            Cell::number(format!("{:.3}", m.time_ratio(base))),
            Cell::number(percent(m.at_equal_time(base, None))),
        ];
        cells.extend(o.classes.masks.iter().map(|mask| Cell::number(percent(m.at_equal_time(base, Some(mask))))));
        cells.push(Cell::number(significant(same_mean(&o.measured, i))));
        table.row(cells);
    }

    // Times by stage of a rendering
    let mut times =
        Table::new(&["method", "camera rays", "materials", "T1", "select", "T2", "processor seconds of a turn"]);
    for (named, m) in o.methods.iter().zip(&o.measured) {
        let mean = |f: fn(&Seconds) -> f64| m.median_seconds(f);
        let values = [mean(|s| s.camera), mean(|s| s.shade), mean(|s| s.t1), mean(|s| s.select), mean(|s| s.t2)];
        let total = Cell::number(significant(m.median_seconds(|s| s.processor)));
        let cells = values.iter().map(|&v| Cell::number(significant(v)));
        times.row(std::iter::once(Cell::text(&named.name)).chain(cells).chain([total]));
    }

    // Pixels by visibility class
    let counts = o.classes.counts();
    let classes = format!(
        "Pixels by the part v of the light that arrives: {} lit (v ≥ {LIT}), {} in penumbra, {} in shadow (v ≤ {SHADOWED}).",
        counts[0], counts[1], counts[2]
    );
    vec![Block::Table(table), Block::Note(classes), Block::Table(times)]
}
