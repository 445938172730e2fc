//! `lumiris bench efficiency`: scenes × settings, as one table.

use super::args::SceneArgs;
use super::named::named;
use super::progress;
use super::settings::{load_job, render_settings};
use super::settings_args::SettingsArgs;
use anyhow::Context;
use clap::Args;
use lumiris::integrators::through_media;
use lumiris::lights::LightSamplerKind;
use lumiris::render::efficiency::{Case, Row, measure_efficiency};
use lumiris::settings::{EstimatorKind, IntegratorKind, Settings};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// Options of `bench efficiency`.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Efficiency")]
pub(super) struct EfficiencyArgs {
    /// Settings to compare, as options of render: 'mis8=--estimator mis --samples 8'; all are compared with the first.
    /// May be given several times [default: mis, ris, ocv and contributing with 1, 2, 4 and 8 samples, by the light tree
    /// and by photons]
    #[arg(long = "case", value_name = "NAME=OPTIONS", value_parser = parse_case)]
    cases: Vec<NamedOptions>,
    /// Further scenes
    #[arg(long, value_name = "SCENE", num_args = 1..)]
    more_scenes: Vec<PathBuf>,
    /// Integrators, one after the other [default: --integrator]
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = named::<IntegratorKind>())]
    integrators: Vec<IntegratorKind>,
    /// Seeds of each setting
    #[arg(long, value_name = "N", default_value_t = 2, value_parser = clap::value_parser!(u32).range(2..=1000))]
    seeds: u32,
}

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

/// Estimators, numbers of samples and light samplers that are compared by default.
fn default_cases(base: &Settings) -> Vec<Case> {
    let kinds = [EstimatorKind::Mis, EstimatorKind::Ris, EstimatorKind::Ocv, EstimatorKind::Contributing];
    let lights = [LightSamplerKind::Tree, LightSamplerKind::Photons];
    let mut cases = vec![Case { name: "default".to_owned(), settings: *base }];
    for (estimator, light_sampler) in kinds.iter().flat_map(|kind| lights.iter().map(move |lights| (*kind, *lights))) {
        // The lights of contributing are found by photons in any case
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

/// Measures all scenes and prints a table of each; the answer is what goes into the JSON file.
pub(super) fn efficiency(scene_args: &SceneArgs, own: &EfficiencyArgs) -> anyhow::Result<Value> {
    let mut tables = Vec::new();
    for path in std::iter::once(&scene_args.scene).chain(&own.more_scenes) {
        let mut scene = scene_args.clone();
        scene.scene.clone_from(path);
        let (mut job, _) = load_job(&scene)?;
        let base = *job.settings();
        let given = [base.integrator.kind];
        let kinds = if own.integrators.is_empty() { &given[..] } else { &own.integrators };
        for &kind in kinds {
            let base = Settings { integrator: base.integrator.of_kind(kind), ..base };
            let mut cases = cases(own, &base);
            if !job.world.scene.media.is_empty() {
                cases.retain(|case| is_possible(case, path));
            }
            if cases.is_empty() {
                continue;
            }
            let of_scene = render_settings(&scene, &job);
            let rows = measure_efficiency(&mut job, &cases, own.seeds, &of_scene, &mut |name, seed| {
                progress::say(&format!("{}: {name}, seed {seed}", path.display()));
            })
            .with_context(|| format!("cannot render {}", path.display()))?;
            let depth = base.integrator.depth();
            progress::print(&table(&format!("{}, {}, {depth} bounces", path.display(), <&str>::from(kind)), &rows));
            tables.push(json!({
                "scene": path.display().to_string(), "integrator": <&str>::from(kind), "max_depth": depth,
                "spp": base.sampling.spp, "seeds": own.seeds, "rows": rows,
            }));
        }
    }
    Ok(tables.into())
}

/// Says why a case is left out of a scene with media, if it is.
fn is_possible(case: &Case, scene: &Path) -> bool {
    let obstacle = through_media::obstacle_of(&case.settings.integrator);
    if let Some(obstacle) = &obstacle {
        progress::say(&format!("{}: {} is left out: {obstacle}", scene.display(), case.name));
    }
    obstacle.is_none()
}

fn cases(args: &EfficiencyArgs, base: &Settings) -> Vec<Case> {
    if args.cases.is_empty() {
        return default_cases(base);
    }
    let case = |named: &NamedOptions| {
        let mut settings = *base;
        named.options.apply(&mut settings);
        Case { name: named.name.clone(), settings }
    };
    args.cases.iter().map(case).collect()
}

fn table(title: &str, rows: &[Row]) -> String {
    let mut text = format!(
        "\n{title}; efficiency relative to the first row, [interval of 2 standard errors]\n{:<28}{:>8}{:>10}{:>11}{:>24}{:>11}{:>24}{:>11}{:>8}\n",
        "settings", "CPU s", "mean", "relMSE", "efficiency", "MSE masked", "efficiency", "MSE", "eff."
    );
    for row in rows {
        let interval = |[a, b]: [f64; 2]| format!("[{a:.2}, {b:.2}]");
        text += &format!(
            "{:<28}{:>8.2}{:>10.5}{:>11.3e}{:>8.2} {:>15}{:>11.3e}{:>8.2} {:>15}{:>11.3e}{:>8.2}\n",
            row.name,
            row.cpu_seconds,
            row.mean,
            row.relmse.error,
            row.relmse.relative,
            interval(row.relmse.interval),
            row.masked_mse.error,
            row.masked_mse.relative,
            interval(row.masked_mse.interval),
            row.mse.error,
            row.mse.relative,
        );
        if !row.chosen.is_empty() {
            let chosen: Vec<String> = row.chosen.iter().map(|(key, value)| format!("{key} {value}")).collect();
            text += &format!("    chose {}\n", chosen.join(", "));
        }
    }
    text.trim_end().to_owned()
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
}
