//! Direct light from many, mostly occluded lights [Keller and Wald 2000, Fig. 5]: variance at equal time in the rooms
//! with 100 lights, and the cost of a sample among 10,000.

use super::super::calibrate::{Calibration, calibrate};
use super::super::figure::{Figure, Summary, estimate_json, plus_minus};
use super::super::images::{HEAT, Image, Scale, gain, significant};
use super::super::measure::{Estimate, Measured, Stage, View, reference, same_mean, scaled, turns};
use super::super::method::Method;
use super::super::page::{Block, Cell, Shown, Table};
use super::super::verdicts::hardly_perceivable;
use super::super::{Observer, ReproduceError};
use super::setup::{SHAPE, Setup};
use lumiris::lights::LightSamplerKind;
use lumiris::planning::visibility_cache::build_visibility_cache;
use lumiris::settings::{SampleCounts, Strata, Target};
use serde_json::{Value, json};
use std::time::{Duration, Instant};

/// Shadow rays per estimate, and camera rays per pixel and turn.
const SAMPLES: u32 = 4;
const SPP: u32 = 4;
/// Edge of the image for time measurements, and the minimum edge.
const PILOT_SIZE: u32 = 64;
const MIN_SIZE: u32 = 16;
/// Minimum and maximum number of turns.
const TURNS: [u32; 2] = [4, 24];
const QUICK_TURNS: u32 = 6;
/// Number of turns for which the size of the image is chosen.
const WANTED_TURNS: f64 = 8.0;
/// Fraction of the time for the scene with more lights.
const MANY_FRACTION: f64 = 0.3;

/// The role of a method.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Role {
    /// The baseline: light and BSDF sampling over all lights.
    All,
    /// Resampling without visibility information.
    Resampled,
    /// Uses the visibility information of photons, without bias.
    Informed,
    /// Treats the visibility information of photons as exact, with bias.
    Biased,
    /// For completeness.
    Other,
}

/// A method with its name on the page.
struct Named {
    name: &'static str,
    role: Role,
    method: Method,
}

fn methods(sample_counts: SampleCounts) -> Vec<Named> {
    let named = |name, role, method: Method| Named { name, role, method: method.stratified() };
    let by = |light_sampler| Method { light_sampler, ..Method::mis(SAMPLES) };
    // Resampling without and with visibility in the target function
    let ris = Method::ris(sample_counts.proposals, sample_counts.samples).strata(Strata::Systematic);
    let known = Method { target: Target::Visibility, ..ris };

    // The first method is the baseline
    vec![
        named("mis, all lights", Role::All, Method::mis(SAMPLES)),
        named("mis, all lights, by power", Role::Other, by(LightSamplerKind::Power)),
        named("mis, all lights alike", Role::Other, by(LightSamplerKind::Uniform)),
        named("ris, visibility unknown", Role::Resampled, ris),
        named("mis, lights by photons", Role::Informed, by(LightSamplerKind::VisibilityCache)),
        named("ris, target with visibility", Role::Informed, known),
        named(
            "ris, target with visibility, lights by photons",
            Role::Informed,
            Method { light_sampler: LightSamplerKind::VisibilityCache, ..known },
        ),
        named("contributing lights", Role::Informed, Method::contributing(SAMPLES, 1)),
        named("contributing lights only (biased)", Role::Biased, Method::contributing(SAMPLES, 0)),
    ]
}

/// Measurements of one scene.
struct Outcome {
    lights: usize,
    size: [u32; 2],
    calibration: Calibration,
    named: Vec<Named>,
    measured: Vec<Measured>,
    /// Number of photons in the visibility cache, and the time to build it (s).
    visibility_cache: CachePhotons,
}

impl Outcome {
    /// The unbiased method with the least variance at equal time among those that use the visibility information of
    /// photons.
    fn best(&self) -> usize {
        let informed = (0..self.named.len()).filter(|&i| self.named[i].role == Role::Informed);
        let left = |i: &usize| self.against(*i, Role::All).value;
        informed.min_by(|a, b| left(a).total_cmp(&left(b))).expect("the roster has every role")
    }

    /// [`same_mean`] among the unbiased methods; for a biased one, among all.
    fn same_mean(&self, i: usize) -> f64 {
        let unbiased = self.named.iter().take_while(|n| n.role != Role::Biased).count();
        same_mean(&self.measured[..unbiased.max(i + 1)], i)
    }

    /// Index of the method with a role.
    fn place(&self, role: Role) -> usize {
        self.named.iter().position(|n| n.role == role).expect("the roster has every role")
    }

    /// Variance at equal time of a method, relative to the method with a role.
    fn against(&self, i: usize, role: Role) -> Estimate {
        self.measured[i].at_equal_time(&self.measured[self.place(role)], None)
    }

    /// Processor time of a method per shadow segment (ns).
    fn per_sample(&self, i: usize) -> f64 {
        let m = &self.measured[i];
        let segments = m.segments as f64 / m.turns().max(1) as f64;
        m.median_seconds(|s| s.processor) * 1e9 / segments.max(1.0)
    }
}

/// Measures both scenes within about `time`.
pub(super) fn run(setup: &Setup<'_>, time: Duration) -> Result<Figure, ReproduceError> {
    (setup.observer.say)("Direct light …");
    let few = measure(setup, "rooms.pbrt", time.mul_f64(1.0 - MANY_FRACTION))?;
    let many = measure(setup, "rooms-10000.pbrt", time.mul_f64(MANY_FRACTION))?;
    figure(setup, &few, &many)
}

fn measure(setup: &Setup<'_>, file: &str, time: Duration) -> Result<Outcome, ReproduceError> {
    let start = Instant::now();
    let Observer { say, .. } = setup.observer;
    let path = setup.scenes.join(file);
    let base = Method::mis(SAMPLES).stratified();

    // Image size that fits the time
    let pilot_size = setup.size.min(PILOT_SIZE);
    let mut stage = Stage::load(&path, scaled(SHAPE, pilot_size), setup.options.threads)?;
    let mut calibration = calibrate(&mut stage, &base, setup.observer)?;
    let count = methods(calibration.sample_counts).len() as f64;
    let turn = |c: &Calibration| c.seconds * f64::from(SPP) * count * 1.2;
    let left = |spent: Duration| time.saturating_sub(spent).as_secs_f64();
    let fits = (left(start.elapsed()) / (turn(&calibration) * WANTED_TURNS)).sqrt();
    let size = ((f64::from(pilot_size) * fits) as u32 / 8 * 8).max(MIN_SIZE).min(setup.size);
    if size != pilot_size {
        stage = Stage::load(&path, scaled(SHAPE, size), setup.options.threads)?;
        calibration = calibrate(&mut stage, &base, setup.observer)?;
    }

    // Number of turns that fits the time
    let named = methods(calibration.sample_counts);
    let visibility_cache = prepare_visibility_cache(setup, &mut stage);
    let list: Vec<Method> = named.iter().map(|n| n.method).collect();
    let max = if setup.options.quick { QUICK_TURNS } else { TURNS[1] };
    let count_turns = ((left(start.elapsed()) / turn(&calibration)) as u32).clamp(TURNS[0], max);
    let (size, lights) = (stage.size(), stage.facts()[1]);
    say(&format!("  {lights} lights, {} × {} pixels, {count_turns} turns of {count} methods", size[0], size[1]));
    let measured = turns(&mut stage, &list, View::Centres, SPP, 0..count_turns, setup.observer)?;
    Ok(Outcome { lights, size, calibration, named, measured, visibility_cache })
}

/// Photons of a visibility cache.
struct CachePhotons {
    count: u64,
    /// Time of the build.
    seconds: f64,
}

/// Builds the visibility cache from photons that come straight from lights.
fn prepare_visibility_cache(setup: &Setup<'_>, stage: &mut Stage) -> CachePhotons {
    let start = Instant::now();
    let visibility_cache = setup.pool.install(|| build_visibility_cache(stage.job()));
    let count = visibility_cache.as_ref().map_or(0, |cache| cache.photon_count() as u64);
    stage.set_visibility_cache(visibility_cache);
    CachePhotons { count, seconds: start.elapsed().as_secs_f64() }
}

fn figure(setup: &Setup<'_>, few: &Outcome, many: &Outcome) -> Result<Figure, ReproduceError> {
    // Images and tables of both buildings
    let mut blocks = vec![Block::Text(
        "Direct light in rooms with a light each, of which a point sees one or two: the others are behind walls, and no bound on \
         their distance and direction tells. Below it 2,500 rooms with four lights each."
            .to_owned(),
    )];
    for (o, name) in [(few, "direct"), (many, "direct-many")] {
        blocks.push(facts(o));
        blocks.extend(images(setup, o, name)?);
        blocks.push(Block::Table(table(o)));
    }
    blocks.push(Block::Text("Processor time for each shadow segment, everything included:".to_owned()));
    blocks.push(Block::Table(growth_table(few, many)));

    // Efficiency of the best unbiased method against mis and ris, and its cost with more lights
    let best = few.best();
    let [left, left_of_ris] = [Role::All, Role::Resampled].map(|role| few.against(best, role));
    let factor = |e: Estimate| if e.value > 0.0 { 1.0 / e.value } else { 0.0 };
    let enough = factor(left) >= 10.0 && factor(left_of_ris) >= 3.0;
    let growth = many.per_sample(best) / few.per_sample(best).max(1e-300);
    Ok(Figure {
        id: "direct",
        title: "Figure 5: direct light among 100 and 10,000 lights",
        summary: Summary {
            paper: "“much less noise … at the same computational cost”".to_owned(),
            target: "at equal time ≥ 10× less variance than mis over all lights, ≥ 3× less than ris without visibility"
                .to_owned(),
            measured: format!(
                "{}: {}× and {}×",
                few.named[best].name,
                significant(factor(left)),
                significant(factor(left_of_ris))
            ),
            reached: enough,
            reason: format!("relative variance {} and {}", plus_minus(left), plus_minus(left_of_ris)),
        },
        also: vec![
            ("contributing lights only", biased_summary(few)),
            (
                "10,000 lights",
                Summary {
                    paper: "effort “independent of the actual number of light sources”".to_owned(),
                    target: "cost of a sample grows less than 1.5×".to_owned(),
                    measured: format!("{}×", significant(growth)),
                    reached: growth < 1.5,
                    reason: format!(
                        "{} → {} ns",
                        significant(few.per_sample(best)),
                        significant(many.per_sample(best))
                    ),
                },
            ),
        ],
        blocks,
        numbers: json!({ "few": outcome_json(few), "many": outcome_json(many), "growth": growth }),
    })
}

/// Gain and loss by omitting lights.
fn biased_summary(o: &Outcome) -> Summary {
    // The bias relative to the best unbiased method
    let i = o.place(Role::Biased);
    let (own, true_mean) = (o.measured[i].mean(), o.measured[o.best()].mean());
    let value = own.value / true_mean.value.max(1e-300);
    let error = value * (own.error / own.value.max(1e-300)).hypot(true_mean.error / true_mean.value.max(1e-300));
    let left = o.against(i, Role::All);
    Summary {
        paper: "“biased, but hardly noticeable”".to_owned(),
        target: "bias below 2 %; less variance than without bias".to_owned(),
        measured: format!(
            "mean {:+.2} ± {:.2} %; {}× less variance than mis at equal time",
            (value - 1.0) * 100.0,
            error * 100.0,
            significant(1.0 / left.value.max(1e-300))
        ),
        reached: left.value < o.against(o.best(), Role::All).value
            && hardly_perceivable(Estimate { value: value - 1.0, error }),
        reason: "lights of which no photon arrived near a point are left out there".to_owned(),
    }
}

fn facts(o: &Outcome) -> Block {
    let SampleCounts { samples, proposals } = o.calibration.sample_counts;
    Block::Facts(vec![
        ("scene".to_owned(), format!("{} lights", o.lights)),
        ("image".to_owned(), format!("{} × {} pixels, {SPP} camera rays per pixel", o.size[0], o.size[1])),
        ("turns".to_owned(), format!("{} of {} methods", o.measured[0].turns(), o.named.len())),
        (
            "photons".to_owned(),
            format!(
                "{} that came straight from lights, in {} s, which no time below includes",
                o.visibility_cache.count,
                significant(o.visibility_cache.seconds)
            ),
        ),
        ("ris".to_owned(), format!("M = {proposals}, N = {samples} in the time of mis with N = {SAMPLES}")),
    ])
}

/// Images of one turn of each method, and their variances.
fn images(setup: &Setup<'_>, o: &Outcome, name: &str) -> Result<Vec<Block>, ReproduceError> {
    let mean: Vec<[f32; 3]> = reference(&o.measured).iter().map(|p| p.map(|v| v as f32)).collect();
    let exposure = gain(&mean);
    let maps: Vec<Vec<f64>> = o.measured.iter().map(Measured::variance_map).collect();
    let scale = Scale::of_values(HEAT, maps.iter().flatten());
    let (mut shown, mut variances) = (Vec::new(), Vec::new());
    for (i, (named, m)) in o.named.iter().zip(&o.measured).enumerate() {
        let file = Image::tone_mapped(o.size, &m.first, exposure).write(&setup.options.out, &format!("{name}-{i}"))?;
        shown.push(Shown { file, title: named.name.to_owned(), caption: String::new() });
        let image = Image::colored(o.size, &maps[i], &scale);
        let file = image.write(&setup.options.out, &format!("{name}-variance-{i}"))?;
        let caption = format!("mean {}", significant(m.variance(None).value));
        variances.push(Shown { file, title: named.name.to_owned(), caption });
    }
    let file = Image::tone_mapped(o.size, &mean, exposure).write(&setup.options.out, &format!("{name}-mean"))?;
    shown.push(Shown { file, title: "mean of all".to_owned(), caption: String::new() });
    let legend = Block::Legend { title: "variance of a pixel (luminance²), one turn".to_owned(), scale };
    Ok(vec![Block::Images(shown), Block::Images(variances), legend])
}

fn table(o: &Outcome) -> Table {
    // Columns
    let header = [
        "method",
        "N",
        "variance",
        "time",
        "variance at equal time",
        "efficiency against mis",
        "against ris",
        "same mean, p",
    ];

    // A row for each method
    let mut table = Table::new(&header);
    let base = &o.measured[o.place(Role::All)];
    for (i, m) in o.measured.iter().enumerate() {
        let relative = o.against(i, Role::All);
        let against_ris = o.against(i, Role::Resampled);
        let inverse = |e: Estimate| if e.value > 0.0 { significant(1.0 / e.value) + "×" } else { "–".to_owned() };
        table.row([
            Cell::text(o.named[i].name),
            Cell::number(m.method.samples.to_string()),
            Cell::number(plus_minus(m.variance(None))),
            Cell::number(format!("{:.2}", m.time_ratio(base))),
            Cell::number(plus_minus(relative)),
            Cell::number(inverse(relative)),
            Cell::number(inverse(against_ris)),
            Cell::number(format!("{:.3}", o.same_mean(i))),
        ]);
    }
    table
}

fn growth_table(few: &Outcome, many: &Outcome) -> Table {
    let (a, b) = (format!("{} lights (ns)", few.lights), format!("{} lights (ns)", many.lights));
    let mut table = Table::new(&["method", &a, &b, "growth"]);
    for (i, named) in few.named.iter().enumerate() {
        let [x, y] = [few.per_sample(i), many.per_sample(i)];
        let cells = [significant(x), significant(y), format!("{:.2}×", y / x.max(1e-300))];
        table.row(std::iter::once(Cell::text(named.name)).chain(cells.map(Cell::number)));
    }
    table
}

fn outcome_json(o: &Outcome) -> Value {
    let base = &o.measured[o.place(Role::All)];
    let method = |(i, m): (usize, &Measured)| {
        json!({
            "name": o.named[i].name, "estimator": <&str>::from(m.method.estimator), "light_sampler": <&str>::from(m.method.light_sampler),
            "samples": m.method.samples, "proposals": m.method.proposals, "turns": m.turns(),
            "variance": estimate_json(m.variance(None)), "time_ratio": m.time_ratio(base),
            "at_equal_time": estimate_json(o.against(i, Role::All)),
            "at_equal_time_of_ris": estimate_json(o.against(i, Role::Resampled)),
            "mean": estimate_json(m.mean()), "same_mean_p": o.same_mean(i), "biased": o.named[i].role == Role::Biased,
            "nanoseconds_per_sample": o.per_sample(i), "segments": m.segments, "invalid_samples": m.invalid,
            "seconds": m.seconds,
        })
    };
    let methods: Vec<Value> = o.measured.iter().enumerate().map(method).collect();
    json!({ "lights": o.lights, "size": o.size, "camera_rays": SPP, "photons": o.visibility_cache.count, "photon_seconds": o.visibility_cache.seconds, "methods": methods })
}
