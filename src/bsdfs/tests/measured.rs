//! Measured reflection: tables computed from a known BRDF must reproduce it.

use super::*;
use lumiris_formats::bsdf_file::MeasuredBsdf;
use lumiris_numbers::math::{Blend, PiecewiseBilinear2D, Vec2};
use std::sync::LazyLock;

/// Resolution of the tables.
#[derive(Clone)]
struct Resolution {
    /// Azimuths of wo (radians).
    phi: Vec<f32>,
    /// Number of polar angles of wo, denser near the horizon.
    theta: usize,
    /// Columns and rows of normals.
    normals: [usize; 2],
    /// Columns and rows of colours.
    colors: [usize; 2],
}

/// The measured surface: a metal over a Lambertian.
#[derive(Clone, Copy)]
struct Sample {
    metal: Conductor,
    /// Albedo of the Lambertian.
    diffuse: Rgb,
}

impl Sample {
    fn new(alpha_x: f32, alpha_y: f32) -> Self {
        Sample { metal: gold(alpha_x, alpha_y), diffuse: RED * 0.3 }
    }

    /// Value without cosine (1/sr) of directions of the upper hemisphere.
    fn f(&self, wo: Vec3, wi: Vec3) -> Rgb {
        self.metal.f(wo, wi) * 0.6 + self.diffuse / PI
    }

    /// σ.
    fn sigma(&self, w: Vec3) -> f32 {
        w.z / self.metal.distribution.g1(w)
    }

    /// The tables of a noiseless measurement.
    fn measure(&self, resolution: &Resolution, is_relative: bool) -> MeasuredBsdf {
        let Resolution { phi, theta, normals, colors } = resolution.clone();
        let steps = theta as f32 - 1.0;
        let theta: Vec<f32> =
            (0..theta).map(|i| (1.0 - (1.0 - i as f32 / steps).powf(1.3)) * 0.5 * PI * 0.98).collect();
        let distribution = &self.metal.distribution;
        let ndf_size = [256, 65];
        let sigma_size = [129, 65];
        let mut bsdf = MeasuredBsdf {
            description: "gold".to_owned(),
            ndf_size,
            ndf: points(ndf_size).map(|p| distribution.d(normal(p))).collect(),
            sigma_size,
            sigma: points(sigma_size).map(|p| self.sigma(normal(Vec2::new(p.x.min(0.999), p.y)))).collect(),
            visible_size: normals,
            visible: Vec::new(),
            color_size: colors,
            luminance: Vec::new(),
            color: Vec::new(),
            is_relative,
            phi,
            theta,
        };
        let is_isotropic = bsdf.phi.len() <= 2;
        for &phi in &bsdf.phi {
            for &theta in &bsdf.theta {
                let wo = Vec3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos());
                let turned = |m: Vec3| if is_isotropic { turn(m, phi) } else { m };
                let density = |p: Vec2| {
                    let m = turned(normal(p));
                    distribution.pdf_m(wo, m) * f32::from(wo.dot(m) > 0.0) * p.x * m.truncate().length()
                };
                let visible: Vec<f32> = points(normals).map(density).collect();
                let warp = PiecewiseBilinear2D::new(normals, visible.clone()).unwrap();
                let color = |u: Vec2| {
                    let m = turned(normal(warp.sample(&Blend::only(0), u).p));
                    let wi = m * (2.0 * wo.dot(m)) - wo;
                    if wi.z <= 0.0 {
                        return Rgb::BLACK;
                    }
                    let facets = distribution.d(m) / (4.0 * self.sigma(wo));
                    self.f(wo, wi) * wi.z / if is_relative { facets } else { 1.0 }
                };
                let color: Vec<Rgb> = points(colors).map(color).collect();
                // The weight of samples of visible normals
                let weight = |(u, c): (Vec2, &Rgb)| {
                    let m = turned(normal(warp.sample(&Blend::only(0), u).p));
                    let facets = distribution.d(m) / (4.0 * self.sigma(wo));
                    c.luminance() / if is_relative { 1.0 } else { facets }
                };
                bsdf.luminance.extend(points(colors).zip(&color).map(weight));
                bsdf.color.extend(color);
                bsdf.visible.extend(visible);
            }
        }
        bsdf
    }
}

/// Points of a table, row by row.
fn points([columns, rows]: [usize; 2]) -> impl Iterator<Item = Vec2> {
    let part = |i: usize, n: usize| i as f32 / (n - 1) as f32;
    (0..rows).flat_map(move |y| (0..columns).map(move |x| Vec2::new(part(x, columns), part(y, rows))))
}

/// The direction of a point of the square.
fn normal(p: Vec2) -> Vec3 {
    let (theta, phi) = (p.x * p.x * 0.5 * PI, (2.0 * p.y - 1.0) * PI);
    Vec3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos())
}

fn turn(w: Vec3, phi: f32) -> Vec3 {
    (Vec2::from_angle(phi).rotate(w.truncate())).extend(w.z)
}

fn isotropic() -> Resolution {
    Resolution { phi: vec![0.0], theta: 24, normals: [96, 96], colors: [64, 64] }
}

fn anisotropic(turns: f32, steps: u32) -> Resolution {
    let phi = (0..=steps).map(|i| TAU * turns * i as f32 / steps as f32 - PI).collect();
    Resolution { phi, theta: 12, normals: [64, 64], colors: [40, 40] }
}

fn tables(sample: Sample, resolution: &Resolution) -> MeasuredTables {
    MeasuredTables::new(sample.measure(resolution, true)).unwrap()
}

static ISOTROPIC: LazyLock<MeasuredTables> = LazyLock::new(|| {
    let coarse = Resolution { phi: vec![0.0], theta: 8, normals: [24, 20], colors: [16, 16] };
    tables(Sample::new(0.4, 0.4), &coarse)
});

static QUADRANTS: LazyLock<MeasuredTables> = LazyLock::new(|| {
    let coarse = Resolution { theta: 6, normals: [24, 20], colors: [16, 16], ..anisotropic(0.25, 4) };
    tables(Sample::new(0.5, 0.25), &coarse)
});

static WHOLE: LazyLock<MeasuredTables> = LazyLock::new(|| {
    let coarse = Resolution { theta: 5, normals: [20, 20], colors: [14, 14], ..anisotropic(1.0, 12) };
    tables(Sample::new(0.3, 0.6), &coarse)
});

/// Coarse tables, whose densities have discontinuous derivatives everywhere.
pub(super) fn measured() -> [(&'static str, Measured<'static>); 3] {
    [("isotropic", &ISOTROPIC), ("quadrants", &QUADRANTS), ("whole", &WHOLE)]
        .map(|(name, t)| (name, Measured { tables: t }))
}

/// Mean and 99th percentile of |f − exact|/exact over directions that are at least 10° from the horizon.
fn errors(tables: &MeasuredTables, sample: Sample) -> [f32; 2] {
    let measured = Bsdf::Measured(Measured { tables });
    let mut s = pcg32([8, 1, 6]);
    let mut relative: Vec<f32> = Vec::new();
    while relative.len() < 20_000 {
        let [wo, wi] = [0, 1].map(|_| warp::sample_cosine_hemisphere(s.random::<[f32; 2]>()));
        if wo.z.min(wi.z) > 0.17 {
            let (f, exact) = (measured.f(wo, wi), sample.f(wo, wi));
            relative.push((f - exact).map(f32::abs).max_component() / exact.max_component());
        }
    }
    relative.sort_by(f32::total_cmp);
    [relative.iter().sum::<f32>() / relative.len() as f32, relative[relative.len() * 99 / 100]]
}

#[test]
fn tables_of_a_known_brdf_give_it_back() {
    for (resolution, alphas, bounds) in [
        (isotropic(), [0.4, 0.4], [0.0015, 0.01]),
        (isotropic(), [0.15, 0.15], [0.016, 0.18]),
        (anisotropic(0.25, 12), [0.5, 0.25], [0.014, 0.13]),
        (anisotropic(0.5, 24), [0.25, 0.5], [0.014, 0.13]),
        (anisotropic(1.0, 48), [0.5, 0.25], [0.014, 0.13]),
    ] {
        let sample = Sample::new(alphas[0], alphas[1]);
        let [mean, most] = errors(&tables(sample, &resolution), sample);
        assert!(mean < bounds[0] && most < bounds[1], "{alphas:?}: {mean} {most}");
    }
}

#[test]
fn finer_tables_are_nearer() {
    // Linear interpolation has errors of second order in the spacing
    let sample = Sample::new(0.3, 0.3);
    let coarse = Resolution { theta: 12, normals: [48, 48], colors: [32, 32], ..isotropic() };
    let [coarse, fine] = [coarse, isotropic()].map(|resolution| errors(&tables(sample, &resolution), sample)[0]);
    assert!((2.5..6.0).contains(&(coarse / fine)), "{coarse} {fine}");
}

#[test]
fn colours_may_be_f_cos_itself() {
    let sample = Sample::new(0.4, 0.4);
    let plain = MeasuredTables::new(sample.measure(&isotropic(), false)).unwrap();
    let [mean, most] = errors(&plain, sample);
    assert!(mean < 0.001 && most < 0.004, "{mean} {most}");
}

#[test]
fn alpha_is_that_of_the_facets() {
    for alpha in [0.15, 0.4] {
        let sample = Sample::new(alpha, alpha);
        let tables = tables(sample, &Resolution { theta: 2, normals: [8, 8], colors: [4, 4], ..isotropic() });
        let found = Bsdf::Measured(Measured { tables: &tables }).glossy_lobe(Vec3::Z).unwrap().alpha;
        assert!((found / alpha - 1.0).abs() < 0.03, "{alpha} {found}");
    }
}

#[test]
fn azimuths_that_are_no_part_of_a_turn_are_an_error() {
    let coarse = |phi: Vec<f32>| {
        let sample =
            Sample::new(0.5, 0.5).measure(&Resolution { phi, theta: 2, normals: [4, 4], colors: [4, 4] }, true);
        MeasuredTables::new(sample).err()
    };
    assert!(coarse(vec![-PI, -2.0, -1.0]).unwrap().contains("from -3.14"));
    // Between the axes
    assert!(coarse(vec![-0.25 * PI, 0.0, 0.25 * PI]).is_some());
    for phi in
        [vec![-PI, -2.0, -0.5 * PI], vec![0.0, 1.0, 0.5 * PI], vec![-0.5 * PI, 1.0, 0.5 * PI], vec![0.0, 2.0 * PI]]
    {
        assert_eq!(coarse(phi), None);
    }
}

/// For directions wo and wi: f and density in Mitsuba 3.9.1 of the demo file (docs/measurements/measured-bsdf.py).
const OF_MITSUBA: [([f32; 3], [f32; 3], [f32; 4]); 8] = [
    ([-0.828386, -0.275919, 0.487489], [0.439946, 0.701722, 0.560388], [0.235547, 0.156173, 0.123015, 0.176165]),
    ([-0.246151, 0.419501, 0.873744], [0.485320, 0.785259, 0.384490], [0.083349, 0.053000, 0.036270, 0.039984]),
    ([-0.428744, 0.353989, 0.831186], [-0.346579, 0.457262, 0.819021], [0.092771, 0.059074, 0.040664, 0.095464]),
    ([0.741991, 0.476141, 0.471952], [0.457777, 0.408593, 0.789615], [0.071670, 0.044962, 0.029034, 0.072927]),
    ([0.154555, -0.581832, 0.798489], [0.013069, -0.423995, 0.905570], [0.105717, 0.067809, 0.048071, 0.121790]),
    ([-0.681209, -0.521408, 0.513896], [-0.211938, 0.169284, 0.962510], [0.117934, 0.076010, 0.054908, 0.148469]),
    ([-0.226735, 0.274621, 0.934438], [-0.050974, 0.012536, 0.998621], [0.396523, 0.263725, 0.213387, 0.506969]),
    ([0.910404, -0.125877, 0.394106], [0.283564, 0.061931, 0.956951], [0.091390, 0.058202, 0.040087, 0.113045]),
];

#[test]
fn a_file_has_the_values_that_another_renderer_finds() {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/demo/measured.bsdf");
    let tables = MeasuredTables::new(lumiris_formats::bsdf_file::read_bsdf(&path).unwrap()).unwrap();
    let bsdf = Bsdf::Measured(Measured { tables: &tables });
    for (wo, wi, expected) in OF_MITSUBA {
        let (wo, wi) = (Vec3::from(wo).normalize(), Vec3::from(wi).normalize());
        let f = bsdf.f(wo, wi);
        for (found, expected) in [f.r, f.g, f.b, bsdf.pdf(wo, wi)].into_iter().zip(expected) {
            assert!((found / expected - 1.0).abs() < 3e-4, "{wo} {wi}: {found} {expected}");
        }
    }
}
