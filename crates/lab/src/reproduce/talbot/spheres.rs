//! BSDFs that can only be evaluated, sampled from a default density with and without resampling [Talbot et al. 2005,
//! Fig. 5]: one sample of M = 20 proposals compared with M = 1.

use super::super::figure::{Figure, Summary};
use super::super::images::{HEAT, Image, Scale, gain, significant};
use super::super::page::{Block, Cell, Shown, Table};
use super::super::{ReproduceError, page};
use super::setup::Setup;
use crate::sphere_study::{SphereSettings, SphereStudy, sphere_image};
use lumiris::bsdfs::models::CookTorrance;
use lumiris::bsdfs::{Bsdf, Evaluated, Model, ProposalDensity};
use lumiris_numbers::math::Rgb;
use lumiris_numbers::math::luminance;
use serde_json::{Value, json};
use std::time::Instant;

/// Maximum remaining fraction of the variance.
const TARGET: f64 = 0.2;
/// Proposals without and with resampling.
const PROPOSALS: [u32; 2] = [1, 20];
/// Estimates per pixel: of the images, and of the variances.
const SPP: [u32; 2] = [4, 64];

struct Sphere {
    name: &'static str,
    model: Model,
    density: ProposalDensity,
    /// True for the two spheres of the paper.
    in_paper: bool,
}

/// One sphere without and with resampling.
struct Pair {
    images: [SphereStudy; 2],
    variances: [SphereStudy; 2],
    /// Times of an estimate (ns).
    times: [f64; 2],
}

fn spheres() -> [Sphere; 4] {
    let diffuse = Model::Diffuse(Rgb::new(0.75, 0.6, 0.45));
    let glossy = Model::CookTorrance(CookTorrance::new(Rgb::new(0.35, 0.1, 0.1), Rgb::splat(0.6), 0.2, 0.6));
    let (uniform, lobes) = (ProposalDensity::Uniform, ProposalDensity::Lobes);
    [
        Sphere { name: "diffuse, uniform proposals", model: diffuse, density: uniform, in_paper: true },
        Sphere { name: "Cook-Torrance, uniform proposals", model: glossy, density: uniform, in_paper: true },
        Sphere { name: "diffuse, default lobes", model: diffuse, density: lobes, in_paper: false },
        Sphere { name: "Cook-Torrance, default lobes", model: glossy, density: lobes, in_paper: false },
    ]
}

fn study(sphere: &Sphere, size: u32) -> Pair {
    let bsdf = Bsdf::Evaluated(Evaluated { model: sphere.model, density: sphere.density });
    let render =
        |proposals, spp, seed| sphere_image(&bsdf, &|_| Rgb::WHITE, &SphereSettings { proposals, spp, size, seed });
    let mut times = [0.0; 2];
    let variances = [0, 1].map(|i| {
        let start = Instant::now();
        let study = render(PROPOSALS[i], SPP[1], 1 + i as u32);
        let estimates = study.covered.iter().filter(|&&c| c).count().max(1) as f64 * f64::from(SPP[1]);
        times[i] = start.elapsed().as_secs_f64() * 1e9 / estimates;
        study
    });
    Pair { images: PROPOSALS.map(|m| render(m, SPP[0], 11 + m)), variances, times }
}

/// Ratio of the variance with resampling to the variance without.
fn ratio(pair: &Pair) -> f64 {
    let [one, many] = [0, 1].map(|i| luminance(pair.variances[i].mean_variance()));
    many / one.max(1e-300)
}

/// Renders and measures all spheres.
pub(super) fn run(setup: &Setup<'_>) -> Result<Figure, ReproduceError> {
    // Measurements
    (setup.observer.say)("Paper, figure 5: spheres …");
    let size = setup.size.min(200);
    let spheres = spheres();
    let pairs: Vec<Pair> = spheres.iter().map(|s| study(s, size)).collect();

    // Images, table rows and numbers of the spheres
    let mut blocks = vec![Block::Text(
        "Spheres under uniform light. Directions are drawn from a density that knows nothing of the BSDF: one (M = 1), or \
         one of 20 by the weight of f |cos θ| (M = 20, N = 1). The paper shows uniform proposals; the default lobes are a \
         cosine-weighted hemisphere with a mirror lobe and a retroreflective one, which it proposes for practice."
            .to_owned(),
    )];
    let mut table =
        Table::new(&["sphere", "variance, M = 1", "variance, M = 20", "ratio", "ns per estimate, M = 1", "M = 20"]);
    let mut numbers = Vec::new();
    for (sphere, pair) in spheres.iter().zip(&pairs) {
        blocks.extend(images(setup, sphere, pair, size)?);
        let variances = [0, 1].map(|i| luminance(pair.variances[i].mean_variance()));
        let values = [variances[0], variances[1], ratio(pair), pair.times[0], pair.times[1]];
        table.row(std::iter::once(Cell::text(sphere.name)).chain(values.iter().map(|&v| Cell::number(significant(v)))));
        let means = [0, 1].map(|i| luminance(pair.variances[i].mean()));
        numbers.push(json!({
            "sphere": sphere.name, "in_paper": sphere.in_paper, "size": size, "estimates_per_pixel": SPP[1],
            "variance": variances, "ratio": ratio(pair), "nanoseconds_per_estimate": pair.times,
            "mean": means,
        }));
    }
    blocks.push(Block::Table(table));
    blocks.push(Block::Note(format!(
        "Variance of one estimate (luminance), mean over the pixels of the sphere, from {} estimates at each.",
        SPP[1]
    )));
    Ok(figure(&spheres, &pairs, blocks, Value::from(numbers)))
}

fn figure(spheres: &[Sphere], pairs: &[Pair], blocks: Vec<Block>, numbers: Value) -> Figure {
    // Only spheres of the paper count
    let shown: Vec<(&str, f64)> =
        spheres.iter().zip(pairs).filter(|(s, _)| s.in_paper).map(|(s, p)| (s.name, ratio(p))).collect();
    let worst = shown.iter().map(|s| s.1).fold(0.0, f64::max);
    let list: Vec<String> = shown.iter().map(|(name, r)| format!("{name}: {:.1} %", r * 100.0)).collect();
    Figure {
        id: "paper-figure-5",
        title: "Paper, figure 5: sampling of BSDFs",
        summary: Summary {
            paper: "“greatly reduces the variance”".to_owned(),
            target: format!("at most {:.0} % of it left", TARGET * 100.0),
            measured: format!("left: {}", list.join("; ")),
            reached: worst <= TARGET,
            reason: format!(
                "20 proposals can leave no less than {:.0} %; what is above is the part that the first term of the variance keeps",
                100.0 / f64::from(PROPOSALS[1])
            ),
        },
        also: Vec::new(),
        blocks,
        numbers,
    }
}

fn images(setup: &Setup<'_>, sphere: &Sphere, pair: &Pair, size: u32) -> Result<Vec<Block>, ReproduceError> {
    // Images and variances share gain and scale
    let name = sphere.name.replace([' ', ','], "-").replace("--", "-").to_lowercase();
    let rgb = |s: &SphereStudy| -> Vec<[f32; 3]> { s.pixels.iter().map(|p| p.to_array()).collect() };
    let maps = [0, 1].map(|i| -> Vec<f64> {
        pair.variances[i].variance.iter().map(|v| luminance(v.to_array().map(f64::from))).collect()
    });
    let gain = gain(&rgb(&pair.variances[1]));
    let scale = Scale::of_values(HEAT, maps.iter().flatten());

    // The images
    let mut shown: Vec<page::Shown> = Vec::new();
    for (i, m) in PROPOSALS.iter().enumerate() {
        let image = Image::tone_mapped([size; 2], &rgb(&pair.images[i]), gain);
        let file = image.write(&setup.options.out, &format!("figure-5-{name}-m{m}"))?;
        let caption = format!("{} estimates per pixel", SPP[0]);
        shown.push(Shown { file, title: format!("{}, M = {m}", sphere.name), caption });
    }

    // The variances
    for (i, m) in PROPOSALS.iter().enumerate() {
        let file = Image::colored([size; 2], &maps[i], &scale)
            .write(&setup.options.out, &format!("figure-5-{name}-m{m}-variance"))?;
        shown.push(Shown { file, title: format!("variance, M = {m}"), caption: String::new() });
    }
    let title = "variance of one estimate (luminance)".to_owned();
    Ok(vec![Block::Images(shown), Block::Legend { title, scale }])
}
