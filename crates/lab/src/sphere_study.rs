//! Images and variances of a distantly lit sphere, estimated by BSDF sampling only [Talbot et al. 2005, Fig. 5].
//!
//! The sphere is viewed along −z by parallel rays through the centres of the pixels. Each estimate of a pixel is f |cos
//! θ| L(wi) W for one direction that [`lumiris::bsdfs::resample()`] draws from M proposals (N = 1), so that all
//! variance is due to direction sampling. Nothing is traced: light comes from infinity and is unoccluded.

use lumiris::bsdfs::{Bsdf, resample};
use lumiris_numbers::math::{Frame, Rgb, Vec3};
use lumiris_numbers::samplers::{SampleStream, SamplerKind};
use rayon::prelude::*;

/// Random-number domains of an estimate.
mod domain {
    pub(super) const PROPOSAL: u32 = 0;
    pub(super) const CHOICE: u32 = 1;
}

/// Radius of the sphere relative to the image's half-width.
const RADIUS: f32 = 0.96;

/// Settings of the estimates of a sphere.
#[derive(Clone, Copy, Debug)]
pub struct SphereSettings {
    /// Proposals per estimate (M); 1 is plain importance sampling.
    pub proposals: u32,
    /// Estimates per pixel; the variance needs two.
    pub spp: u32,
    /// Width and height in pixels.
    pub size: u32,
    /// Images of different seeds are independent.
    pub seed: u32,
}

/// One sphere.
#[derive(Clone, Debug)]
pub struct SphereStudy {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Radiance: mean of the estimates, row-major from the top left; black outside the sphere.
    pub pixels: Vec<Rgb>,
    /// Unbiased variance of one estimate; 0 outside the sphere and with one estimate per pixel.
    pub variance: Vec<Rgb>,
    /// True if the pixel is covered by the sphere.
    pub covered: Vec<bool>,
}

impl SphereStudy {
    /// Mean over the sphere's pixels of the radiance, per channel.
    pub fn mean(&self) -> [f64; 3] {
        self.mean_of(&self.pixels)
    }

    /// Mean over the sphere's pixels of the variance of one estimate, per channel.
    pub fn mean_variance(&self) -> [f64; 3] {
        self.mean_of(&self.variance)
    }

    fn mean_of(&self, values: &[Rgb]) -> [f64; 3] {
        let (mut sum, mut count) = ([0.0; 3], 0_u32);
        for (value, _) in values.iter().zip(&self.covered).filter(|(_, covered)| **covered) {
            sum.iter_mut().zip(value.to_array()).for_each(|(s, v)| *s += f64::from(v));
            count += 1;
        }
        sum.map(|s| s / f64::from(count.max(1)))
    }
}

/// A sphere with `bsdf` under incident radiance `l(wi)` from the direction `wi`; the viewer is at +z and y is up.
pub fn sphere_image(bsdf: &Bsdf<'_>, l: &(dyn Fn(Vec3) -> Rgb + Sync), settings: &SphereSettings) -> SphereStudy {
    let SphereSettings { size, .. } = *settings;
    let pixels: Vec<Option<[Rgb; 2]>> = (0..size * size)
        .into_par_iter()
        .map(|i| {
            let pixel = [i % size, i / size];
            normal(pixel, size).map(|n| estimate(bsdf, l, settings, pixel, n))
        })
        .collect();
    SphereStudy {
        width: size,
        height: size,
        pixels: pixels.iter().map(|p| p.map_or(Rgb::BLACK, |p| p[0])).collect(),
        variance: pixels.iter().map(|p| p.map_or(Rgb::BLACK, |p| p[1])).collect(),
        covered: pixels.iter().map(Option::is_some).collect(),
    }
}

/// Normal of the sphere at the centre of a pixel; `None` outside it.
fn normal(pixel: [u32; 2], size: u32) -> Option<Vec3> {
    let [x, y] = pixel.map(|p| (2.0 * (p as f32 + 0.5) / size as f32 - 1.0) / RADIUS);
    let z2 = 1.0 - x * x - y * y;
    (z2 > 0.0).then(|| Vec3::new(x, -y, z2.sqrt()))
}

/// Mean and variance of the estimates of a pixel.
fn estimate(
    bsdf: &Bsdf<'_>,
    l: &(dyn Fn(Vec3) -> Rgb + Sync),
    settings: &SphereSettings,
    pixel: [u32; 2],
    n: Vec3,
) -> [Rgb; 2] {
    let frame = Frame::from_z(n);
    let wo = frame.to_local(Vec3::Z);
    let (mut mean, mut m2) = ([0.0_f64; 3], [0.0_f64; 3]);
    for sample in 0..settings.spp {
        // Independent numbers, so that the variance is due to the estimator and not to the sequence.
        let stream = SampleStream::new(SamplerKind::Independent, pixel, sample, settings.seed);
        let proposal = |j| stream.split(domain::PROPOSAL, settings.proposals, j).draw::<3>();
        let [u_choice] = stream.domain(domain::CHOICE).draw::<1>();
        let value = match resample(bsdf, wo, settings.proposals, proposal, u_choice) {
            Some(r) => r.f * l(frame.to_world(r.wi)) * (r.wi.z.abs() * r.weight),
            None => Rgb::BLACK,
        };
        for ((mean, m2), x) in mean.iter_mut().zip(&mut m2).zip(value.to_array().map(f64::from)) {
            let delta = x - *mean;
            *mean += delta / f64::from(sample + 1);
            *m2 += delta * (x - *mean);
        }
    }
    let degrees = f64::from(settings.spp.saturating_sub(1).max(1));
    let rgb = |v: [f64; 3]| Rgb::new(v[0] as f32, v[1] as f32, v[2] as f32);
    [rgb(mean), rgb(m2.map(|m| m / degrees))]
}

#[cfg(test)]
mod tests {
    use super::*;
    use lumiris::bsdfs::models::{AshikhminShirley, CookTorrance, CosineLobe, LobeAxis, Model, OrenNayar};
    use lumiris::bsdfs::{Evaluated, ProposalDensity};
    use strum::IntoEnumIterator;

    const RED: Rgb = Rgb::new(0.9, 0.5, 0.2);
    const BLUE: Rgb = Rgb::new(0.1, 0.4, 0.8);

    /// One of each kind.
    fn models() -> [(&'static str, Model); 6] {
        let lobe = |d: f32, s: f32, n, axis| Model::CosineLobe(CosineLobe::new(RED * d, BLUE * s, n, axis));
        [
            ("diffuse", Model::Diffuse(RED)),
            ("oren-nayar", Model::OrenNayar(OrenNayar::new(RED, 1.05))),
            ("cook-torrance", Model::CookTorrance(CookTorrance::new(BLUE, RED, 0.3, 0.5))),
            ("phong", lobe(0.4, 0.7, 20.0, LobeAxis::Mirror)),
            ("retro", lobe(0.2, 0.9, 40.0, LobeAxis::Retro)),
            ("ashikhmin-shirley", Model::AshikhminShirley(AshikhminShirley::new(RED, BLUE * 0.5, [10.0, 200.0]))),
        ]
    }

    /// Incident radiance that varies with direction.
    fn uneven(wi: Vec3) -> Rgb {
        Rgb::new(1.0 + wi.x, 1.0, 0.3 + 0.5 * (wi.y + 1.0))
    }

    fn study(model: Model, density: ProposalDensity, l: fn(Vec3) -> Rgb, proposals: u32) -> SphereStudy {
        let settings = SphereSettings { proposals, spp: 64, size: 32, seed: 4 };
        sphere_image(&Bsdf::Evaluated(Evaluated { model, density }), &l, &settings)
    }

    #[test]
    fn variance_falls_with_proposals_for_every_model() {
        for (name, model) in models() {
            for density in ProposalDensity::iter() {
                for (under, l) in [("uniform", (|_| Rgb::WHITE) as fn(Vec3) -> Rgb), ("uneven", uneven)] {
                    let [one, eight, twenty] = [1, 8, 20].map(|m| study(model, density, l, m));
                    let v = [&one, &eight, &twenty].map(|s| s.mean_variance()[1]);
                    // Resampling by f does not remove the variance of colour differences and of the incident radiance.
                    let limit = if under == "uniform" { 0.3 } else { 0.5 };
                    assert!(v[2] < limit * v[0], "{name} {density:?} {under}: {v:?}");
                    assert!(v[2] < v[1] && v[1] < v[0], "{name} {density:?} {under}: {v:?}");
                }
            }
        }
    }

    #[test]
    fn spheres_have_the_radiance_of_their_albedo() {
        let white: fn(Vec3) -> Rgb = |_| Rgb::WHITE;
        let sphere = study(Model::Diffuse(RED), ProposalDensity::Lobes, white, 8);
        let mean = sphere.mean();
        assert!((mean[0] - 0.9).abs() < 5e-3 && (mean[1] - 0.5).abs() < 5e-3, "{mean:?}");
        assert_eq!(sphere.pixels.len(), 32 * 32);
        assert!(!sphere.covered[0] && sphere.pixels[0].is_black() && sphere.covered[16 * 32 + 16]);
        // A uniform density without the cosine gives a Lambertian a relative variance of 4/3 − 1.
        let uniform = study(Model::Diffuse(RED), ProposalDensity::Uniform, white, 1);
        assert!((uniform.mean_variance()[0] / 0.81 - 1.0 / 3.0).abs() < 0.02, "{:?}", uniform.mean_variance());
        // The same image twice, and another image for another seed.
        assert_eq!(study(Model::Diffuse(RED), ProposalDensity::Lobes, white, 8).pixels, sphere.pixels);
        let bsdf = Bsdf::Evaluated(Evaluated { model: Model::Diffuse(RED), density: ProposalDensity::Lobes });
        let other = SphereSettings { proposals: 8, spp: 64, size: 32, seed: 5 };
        assert_ne!(sphere_image(&bsdf, &white, &other).pixels, sphere.pixels);
    }
}
