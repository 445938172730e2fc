//! `lumiris bench efficiency`: scenes × settings, as one table.

use super::args::SceneArgs;
use super::bench_references::References;
use super::named::named;
use super::progress;
use super::settings::{Setup, load_job_of, render_settings};
use super::settings_args::SettingsArgs;
use anyhow::Context;
use clap::Args;
use lumiris::import::cache::FileCache;
use lumiris::integrators::exclusions;
use lumiris::lights::LightSamplerKind;
use lumiris::scene::RenderJob;
use lumiris::settings::{EstimatorKind, IntegratorKind, Settings};
use lumiris_bench::efficiency::{Case, Efficiency, Row, first_look, measure_efficiency};
use lumiris_formats::output::write_text;
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Options of `bench efficiency`.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Efficiency")]
pub(super) struct EfficiencyArgs {
    /// Settings to compare, as options of render: 'mis8=--estimator mis --samples 8'. All are compared with the first.
    /// May be given several times [default: mis, ris, ocv and contributing with 1, 2, 4 and 8 samples, with the light
    /// tree and with photons]
    #[arg(long = "case", value_name = "NAME=OPTIONS", value_parser = parse_case)]
    cases: Vec<NamedOptions>,
    /// Additional scenes
    #[arg(long, value_name = "SCENE", num_args = 1..)]
    more_scenes: Vec<PathBuf>,
    /// Integrators, one after the other [default: --integrator]
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = named::<IntegratorKind>())]
    integrators: Vec<IntegratorKind>,
    /// Seeds of each setting
    #[arg(long, value_name = "N", default_value_t = 2, value_parser = clap::value_parser!(u32).range(2..=1000))]
    seeds: u32,
    /// Additional options for all settings but the first; they are measured with and without: 'adaptive=--allocation
    /// adaptive'. May be given several times
    #[arg(long = "variant", value_name = "NAME=OPTIONS", value_parser = parse_case)]
    variants: Vec<NamedOptions>,
    /// Measure errors against two references of N samples per pixel (`--estimator auto`, same integrator); their noise
    /// cancels. Without references, errors are variances between seeds
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    reference_spp: Option<u32>,
    /// Keep the references in this folder, and reuse stored ones of the same scene and settings. The program version
    /// that rendered them is not checked
    #[arg(long, value_name = "DIR", requires = "reference_spp")]
    references: Option<PathBuf>,
    /// Screening pass: render all settings but the first once with N samples per pixel. Skip settings with less than
    /// half the efficiency of the best by every error measure, separately for each variant
    #[arg(long, value_name = "N", requires = "reference_spp", value_parser = clap::value_parser!(u32).range(1..))]
    screen_spp: Option<u32>,
}

/// A case is skipped if its efficiency in the screening pass is below this share of the best.
const LEFT_OUT_BELOW: f64 = 0.5;

/// Options with a name.
#[derive(Clone, Debug)]
struct NamedOptions {
    name: String,
    options: SettingsArgs,
}

fn parse_case(text: &str) -> Result<NamedOptions, String> {
    let (name, words) = text.split_once('=').ok_or("expected NAME=OPTIONS, such as 'mis8=--samples 8'")?;
    let options = SettingsArgs::parse(words.split_whitespace())?;
    Ok(NamedOptions { name: name.trim().to_owned(), options })
}

/// The default cases: estimators × light samplers × sample counts.
fn default_cases(base: &Settings) -> Vec<Case> {
    let kinds = [EstimatorKind::Mis, EstimatorKind::Ris, EstimatorKind::Ocv, EstimatorKind::Contributing];
    let lights = [LightSamplerKind::Tree, LightSamplerKind::VisibilityCache];
    let mut cases = vec![Case { name: "default".to_owned(), settings: *base }];
    for (estimator, light_sampler) in kinds.iter().flat_map(|kind| lights.iter().map(move |lights| (*kind, *lights))) {
        // `contributing` always finds its lights by photons
        if (estimator, light_sampler) == (EstimatorKind::Contributing, LightSamplerKind::Tree) {
            continue;
        }
        for samples in [1, 2, 4, 8] {
            let mut settings = *base;
            settings.integrator.estimator = estimator;
            settings.integrator.light_sampler = light_sampler;
            settings.integrator.samples = Some(samples);
            let name = format!("{} {samples}, {}", <&str>::from(estimator), <&str>::from(light_sampler));
            cases.push(Case { name, settings });
        }
    }
    cases
}

/// The results of a scene.
#[derive(Serialize)]
struct Table {
    scene: String,
    integrator: &'static str,
    max_depth: u32,
    spp: u32,
    seeds: u32,
    reference_spp: Option<u32>,
    rows: Vec<Row>,
    /// Settings that the screening pass skipped.
    left_out: Vec<LeftOut>,
}

/// Settings that the screening pass skipped for low efficiency.
#[derive(Clone, Debug, Serialize)]
struct LeftOut {
    name: String,
    /// Efficiency in the screening pass by each of [`ERRORS`], relative to the best with the same variant.
    relative: [f64; 3],
}

impl LeftOut {
    /// The largest of the relative efficiencies.
    fn best(&self) -> f64 {
        self.relative.into_iter().fold(0.0, f64::max)
    }
}

/// Splits the cases into those to measure and those to skip.
fn sorted_out(cases: Vec<Case>, relative: &[[f64; 3]]) -> (Vec<Case>, Vec<LeftOut>) {
    let (kept, left_out): (Vec<_>, Vec<_>) =
        cases.into_iter().zip(relative).partition(|(_, relative)| relative.iter().any(|r| *r >= LEFT_OUT_BELOW));
    let left_out = left_out.into_iter().map(|(case, relative)| LeftOut { name: case.name, relative: *relative });
    (kept.into_iter().map(|(case, _)| case).collect(), left_out.collect())
}

/// Measures all scenes. Prints a table per scene, then a summary: the efficiency of the first settings relative to the
/// best of the others. The JSON file is rewritten after each table, so that results are kept if a later scene fails.
pub(super) fn efficiency(scene_args: &SceneArgs, own: &EfficiencyArgs, json: Option<&Path>) -> anyhow::Result<()> {
    let mut tables = Vec::new();
    let write = |tables: &[Table]| -> anyhow::Result<()> {
        let Some(path) = json else { return Ok(()) };
        write_text(path, &serde_json::to_string_pretty(tables)?)
            .with_context(|| format!("cannot write {}", path.display()))
    };
    // Fail before hours are spent if the file cannot be written
    write(&tables)?;
    let variants: Vec<&str> = own.variants.iter().map(|variant| variant.name.as_str()).collect();
    let variants_and_none = || std::iter::once(None).chain(variants.iter().copied().map(Some));
    let variant_of = |name: &str| variants.iter().copied().find(|variant| is_variant(name, variant));

    // Measure each scene with each integrator
    for path in std::iter::once(&scene_args.scene).chain(&own.more_scenes) {
        let mut scene = scene_args.clone();
        scene.scene.clone_from(path);
        let Setup { mut job, files, .. } = load_job_of(&scene, &FileCache::default(), None, None)?;
        let mut base = *job.settings();
        // Texture filtering is the same for cases with other sample counts
        base.sampling.footprint_spp = Some(base.sampling.footprint_spp());
        let references = own.reference_spp.map(|spp| References::new(spp, own.references.as_deref(), &scene, &files));
        let references = references.transpose()?;
        let given = [base.integrator.kind];
        let kinds = if own.integrators.is_empty() { &given[..] } else { &own.integrators };
        for &kind in kinds {
            let base = Settings { integrator: base.integrator.of_kind(kind), ..base };
            let mut cases = cases(own, &base);
            cases.retain(|case| is_possible(case, &job, path));
            if cases.is_empty() {
                continue;
            }
            let of_scene = render_settings(&scene, &job);
            let references = references.as_ref().map(|r| r.images(&mut job, &base, &of_scene)).transpose()?;
            let observe = &mut |name: &str, seed| progress::say(&format!("{}: {name}, seed {seed}", path.display()));
            let failed = || format!("cannot render {}", path.display());

            // Screening pass
            let mut left_out = Vec::new();
            if let Some((spp, references)) = own.screen_spp.zip(references.as_ref()) {
                let others = cases.split_off(1);
                for variant in variants_and_none() {
                    let of_variant: Vec<Case> =
                        others.iter().filter(|case| variant_of(&case.name) == variant).cloned().collect();
                    let numbers = [spp, own.seeds];
                    let relative = first_look(&mut job, &of_variant, numbers, references, &of_scene, observe);
                    let (kept, weak) = sorted_out(of_variant, &relative.with_context(failed)?);
                    cases.extend(kept);
                    left_out.extend(weak);
                }
            }

            // Measure the remaining cases
            let rows = measure_efficiency(&mut job, &cases, own.seeds, references.as_ref(), &of_scene, observe)
                .with_context(failed)?;
            let table = Table {
                scene: path.display().to_string(),
                integrator: kind.into(),
                max_depth: base.integrator.depth(),
                spp: base.sampling.spp,
                seeds: own.seeds,
                reference_spp: own.reference_spp,
                rows,
                left_out,
            };
            let shown = text(&table);
            tables.push(table);
            write(&tables)?;
            progress::print(&shown)?;
        }
    }

    // Summaries
    for variant in variants_and_none() {
        if let Some(text) = summary(&tables, variant, |row| variant_of(&row.name) == variant) {
            progress::print(&text)?;
        }
    }
    Ok(())
}

/// True if a case can render the scene; otherwise prints the reason.
fn is_possible(case: &Case, job: &RenderJob, scene: &Path) -> bool {
    let refusal = exclusions::refusal(job, &case.settings.integrator);
    if let Some(conflict) = refusal {
        progress::say(&format!("{}: {} is left out: {conflict}", scene.display(), case.name));
    }
    refusal.is_none()
}

fn cases(args: &EfficiencyArgs, base: &Settings) -> Vec<Case> {
    let case = |named: &NamedOptions| {
        let mut settings = *base;
        named.options.apply(&mut settings);
        Case { name: named.name.clone(), settings }
    };
    let mut cases = if args.cases.is_empty() { default_cases(base) } else { args.cases.iter().map(case).collect() };
    let variants = args.variants.iter().flat_map(|variant| {
        cases.iter().skip(1).map(|case| {
            let mut settings = case.settings;
            variant.options.apply(&mut settings);
            Case { name: format!("{}{}", case.name, suffix(&variant.name)), settings }
        })
    });
    let variants: Vec<Case> = variants.collect();
    cases.extend(variants);
    cases
}

/// The suffix of the names of cases with a variant.
fn suffix(variant: &str) -> String {
    format!(", {variant}")
}

fn is_variant(case: &str, variant: &str) -> bool {
    case.ends_with(&suffix(variant))
}

/// Formats an efficiency; a dash if it is not distinguishable from noise.
fn known(efficiency: f64) -> String {
    if efficiency.is_finite() { format!("{efficiency:.2}") } else { "–".to_owned() }
}

fn between([low, high]: [f64; 2]) -> String {
    format!("[{}, {}]", known(low), known(high))
}

fn text(table: &Table) -> String {
    let mut text = format!(
        "\n{}, {}, {} bounces; efficiency relative to the first row, [interval of 2 standard errors]\n\
         {:<28}{:>8}{:>10}{:>11}{:>24}{:>11}{:>24}{:>11}{:>8}\n",
        table.scene,
        table.integrator,
        table.max_depth,
        "settings",
        "CPU s",
        "mean",
        "relMSE",
        "efficiency",
        "MSE masked",
        "efficiency",
        "MSE",
        "eff."
    );

    // One line per row, and lines with the choices of `auto`, seeds of equal choices together
    for row in &table.rows {
        text += &format!("{:<28}{:>8.2}{:>10.5}", row.name, row.cpu_seconds, row.mean);
        for Efficiency { error, relative, interval } in [row.relmse, row.masked_mse] {
            text += &format!("{error:>11.3e}{:>8} {:>15}", known(relative), between(interval));
        }
        text += &format!("{:>11.3e}{:>8}\n", row.mse.error, known(row.mse.relative));
        let mut choices: Vec<(Vec<String>, &Vec<_>)> = Vec::new();
        for (seed, chosen) in row.chosen.iter().enumerate().filter(|(_, chosen)| !chosen.is_empty()) {
            match choices.iter_mut().find(|(_, other)| *other == chosen) {
                Some((seeds, _)) => seeds.push(seed.to_string()),
                None => choices.push((vec![seed.to_string()], chosen)),
            }
        }
        for (seeds, chosen) in choices {
            let chosen: Vec<String> = chosen.iter().map(|(key, value)| format!("{key} {value}")).collect();
            text += &format!("    chose {} (seed {})\n", chosen.join(", "), seeds.join(", "));
        }
    }

    // Settings that were skipped
    if !table.left_out.is_empty() {
        let names: Vec<String> =
            table.left_out.iter().map(|row| format!("{} ({})", row.name, known(row.best()))).collect();
        text += &format!("less than {LEFT_OUT_BELOW} of the best at first sight: {}\n", names.join("; "));
    }
    text.trim_end().to_owned()
}

/// Error measures by which the first settings are compared with the best of the others.
const ERRORS: [&str; 3] = ["relMSE", "MSE masked", "MSE"];

/// Efficiency by each of [`ERRORS`].
fn efficiencies(row: &Row) -> [Efficiency; 3] {
    [row.relmse, row.masked_mse, row.mse]
}

/// The efficiency of the first settings relative to the best others of a variant, for each error measure, with
/// intervals and geometric means. `None` if there are no others. The best are selected by the compared images
/// themselves, so they are favoured by selection bias.
fn summary(tables: &[Table], variant: Option<&str>, is_of_variant: impl Fn(&Row) -> bool) -> Option<String> {
    let title = format!("first row by the best of others in hindsight{}", variant.map(suffix).unwrap_or_default());
    let mut text = format!("\n{title:<48}{:>8}", "CPU s");
    ERRORS.iter().for_each(|name| text += &format!("{name:>12}{:<33}", ""));
    text += "\n";
    let mut logarithms = [(); 3].map(|()| Vec::new());

    // One line per scene
    for table in tables {
        let Some((first, others)) = table.rows.split_first() else { continue };
        let others: Vec<&Row> = others.iter().filter(|row| is_of_variant(row)).collect();
        if others.is_empty() {
            continue;
        }
        // Scenes in different folders may have the same name
        let path = Path::new(&table.scene).with_extension("");
        let last: Vec<_> = path.iter().rev().take(2).map(|part| part.to_string_lossy()).collect();
        let name = last.into_iter().rev().collect::<Vec<_>>().join("/");
        text += &format!("{:<48}{:>8.2}", format!("{name}, {}", table.integrator), first.cpu_seconds);
        for (kind, logarithms) in logarithms.iter_mut().enumerate() {
            let of = |row: &Row| efficiencies(row)[kind];
            // Includes rows whose error is within its noise: the best of the others may be the worst of all
            let product = |row: &Row| of(row).error * row.cpu_seconds;
            let best = others.iter().min_by(|a, b| product(a).total_cmp(&product(b)));
            let Some(best) = best.filter(|row| of(row).relative.is_finite()) else {
                text += &format!("{:>8} {:<36}", known(f64::NAN), "");
                continue;
            };
            let Efficiency { relative, interval: [low, high], .. } = of(best);
            logarithms.push(-relative.ln());
            let interval = between([1.0 / high, 1.0 / low]);
            text += &format!("{:>8} {interval:<15}{:<21}", known(1.0 / relative), best.name);
        }
        text += "\n";
    }

    // Means over all scenes
    text += &format!("{:<56}", "geometric mean");
    for logarithms in &logarithms {
        let mean = (logarithms.iter().sum::<f64>() / logarithms.len() as f64).exp();
        text += &format!("{:>8}{:<37}", known(mean), "");
    }
    logarithms.iter().any(|l| !l.is_empty()).then(|| text.trim_end().to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cases_are_options_with_a_name() {
        let named = parse_case("a b=--estimator ris --samples 3").expect("options of render");
        let mut settings = Settings::default();
        named.options.apply(&mut settings);
        assert_eq!(named.name, "a b");
        assert_eq!((settings.integrator.estimator, settings.integrator.samples), (EstimatorKind::Ris, Some(3)));
        for wrong in ["--samples 3", "a=--samples none", "a=--sampels 3", "a=3"] {
            assert!(parse_case(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn by_default_each_estimator_is_compared_by_its_light_samplers() {
        let cases = default_cases(&Settings::default());
        assert_eq!(cases.len(), 1 + 7 * 4);
        let mut names: Vec<&str> = cases.iter().map(|c| c.name.as_str()).collect();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), cases.len());
    }

    #[test]
    fn the_first_is_compared_with_the_best_of_the_others_for_each_error() {
        // Rows with given efficiencies
        let efficiency = |relative: f64| {
            let error = if relative.is_nan() { 1.0 } else { 1.0 / relative };
            Efficiency { error, relative, interval: [relative / 2.0, relative * 2.0] }
        };
        let row = |name: &str, [relmse, masked, mse]: [f64; 3]| Row {
            name: name.to_owned(),
            cpu_seconds: 3.0,
            mean: 1.0,
            relmse: efficiency(relmse),
            mse: efficiency(mse),
            masked_mse: efficiency(masked),
            chosen: Vec::new(),
        };
        let table = |scene: &str, rows: Vec<Row>| Table {
            scene: scene.to_owned(),
            integrator: "direct",
            max_depth: 1,
            spp: 4,
            seeds: 2,
            reference_spp: None,
            rows,
            left_out: Vec::new(),
        };

        // Scenes with a variant, without other rows, and with an efficiency within the noise
        let first = row("auto", [1.0; 3]);
        let tables = [
            table("a/one.pbrt", vec![first.clone(), row("x", [0.25, 0.5, 4.0]), row("y", [0.5, f64::NAN, 1.0])]),
            table("c/b/two.pbrt", vec![first.clone(), row("z", [2.0, 0.5, 1.0]), row("z, v", [4.0, f64::NAN, 4.0])]),
            table("b/alone.pbrt", vec![first]),
        ];
        let lines = |variant: Option<&str>| -> Vec<String> {
            let text = summary(&tables, variant, |row| is_variant(&row.name, "v") == variant.is_some());
            let text = text.expect("there are others");
            text.trim().lines().map(|l| l.split_whitespace().collect::<Vec<_>>().join(" ")).collect()
        };

        // Values of the best others, and their means
        assert_eq!(
            lines(None)[1..],
            [
                "a/one, direct 3.00 2.00 [1.00, 4.00] y – 0.25 [0.12, 0.50] x",
                "b/two, direct 3.00 0.50 [0.25, 1.00] z 2.00 [1.00, 4.00] z 1.00 [0.50, 2.00] z",
                "geometric mean 1.00 2.00 0.50",
            ]
        );
        assert_eq!(
            lines(Some("v"))[1..],
            ["b/two, direct 3.00 0.25 [0.12, 0.50] z, v – 0.25 [0.12, 0.50] z, v", "geometric mean 0.25 – 0.25",]
        );
        assert!(summary(&tables, None, |_| false).is_none());
    }

    #[test]
    fn what_has_half_of_the_best_by_one_error_is_not_left_out() {
        let cases = ["a", "b", "c"].map(|name| Case { name: name.to_owned(), settings: Settings::default() });
        let (kept, left_out) = sorted_out(cases.to_vec(), &[[1.0, 0.1, 1.0], [0.4, 0.32, 0.2], [0.1, 0.1, 0.54]]);
        assert_eq!(kept.iter().map(|case| case.name.as_str()).collect::<Vec<_>>(), ["a", "c"]);
        let left_out: Vec<_> = left_out.iter().map(|row| (row.name.as_str(), row.best())).collect();
        assert_eq!(left_out, [("b", 0.4)]);
    }

    #[test]
    fn variants_are_of_all_settings_but_the_first() {
        // Options as typed
        use clap::Parser;
        #[derive(Parser)]
        struct Words {
            #[command(flatten)]
            own: EfficiencyArgs,
        }
        let words = [
            "bench",
            "--case=auto=",
            "--case=mis=--estimator mis",
            "--variant=four=--samples 4",
            "--variant=no=--spp 9",
        ];

        // Each variant is applied to all cases but the first
        let own = Words::parse_from(words).own;
        let cases = cases(&own, &Settings::default());
        let names: Vec<&str> = cases.iter().map(|c| c.name.as_str()).collect();
        assert_eq!(names, ["auto", "mis", "mis, four", "mis, no"]);
        assert_eq!(cases[2].settings.integrator.samples, Some(4));
        assert_eq!(cases[2].settings.integrator.estimator, EstimatorKind::Mis);
        assert_eq!((cases[3].settings.integrator.samples, cases[3].settings.sampling.spp), (None, 9));
    }
}
