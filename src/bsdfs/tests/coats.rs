//! The closed form of a coat over a Lambertian base, compared with the random walk, and the walk compared with an
//! analog simulation.

use super::*;
use crate::bsdfs::dielectric::Transport;
use lumiris_numbers::estimators::stats::{Welford, sidak, two_sample_z_test, z_test};

fn over_lambert(top: Dielectric, rho: f32, max_depth: u32) -> Layered {
    let base = Base::Diffuse(Diffuse { reflectance: Rgb::splat(rho) });
    Layered { top, base, thickness: 0.01, albedo: Rgb::BLACK, g: 0.0, max_depth, samples: 1 }
}

/// Moments of f(wo, wi) over `n` directions that differ only by rounding, so that each seeds another walk.
fn walk_moments(layered: &Layered, wo: Vec3, wi: Vec3, n: u32) -> Welford {
    // Means of 64 walks are nearly normal and cost one evaluation each.
    let batch = Layered { samples: 64, ..*layered };
    let mut w = Welford::new();
    let mut s = pcg32([4, 4, 4]);
    for _ in 0..n / 64 {
        let jitter = Vec3::new(s.random::<f32>() - 0.5, s.random::<f32>() - 0.5, s.random::<f32>() - 0.5) * 2e-6;
        w.add(f64::from(batch.f(wo, wi + jitter).r));
    }
    w
}

#[test]
fn the_closed_form_is_the_mean_of_the_walk() {
    let pairs = [
        (warp::direction(0.9, 0.0), warp::direction(0.7, 2.0)),
        (warp::direction(0.3, 0.0), warp::direction(0.8, 3.0)),
        (warp::direction(0.15, 0.0), warp::direction(0.4, 1.0)),
    ];

    // η, roughness, reflectance of the base, maximum depth
    let cases = [
        (1.5, ggx(0.0, 0.0), 0.9, 10),
        (1.5, ggx(0.0, 0.0), 1.0, 3),
        (1.5, ggx(0.05, 0.05), 0.5, 10),
        (1.5, ggx(0.1, 0.1), 0.9, 10),
        (1.5, ggx(0.3, 0.3), 1.0, 4),
        (1.5, ggx(0.7, 0.7), 0.8, 10),
        (2.0, ggx(0.2, 0.2), 1.0, 10),
        (1.3, ggx(0.5, 0.5), 1.0, 1),
        (1.5, ggx(0.4, 0.1), 0.9, 10),
        (1.5, ggx(0.5, 0.5), 0.9, 0),
    ];
    let significance = sidak(0.01, cases.len() * pairs.len());
    for (eta, distribution, rho, max_depth) in cases {
        let table = CoatTable::for_roughness(eta, 0.01, distribution);
        let closed = CoatedDiffuse::new(&table, distribution, Rgb::splat(rho), max_depth);
        let walk = over_lambert(Dielectric { eta, distribution }, rho, max_depth);

        // Random walks against the closed form
        for (wo, wi) in pairs {
            let w = walk_moments(&walk, wo, wi, 256_000);
            let f = f64::from(Bsdf::CoatedDiffuse(closed).f(wo, wi).r);
            let z = z_test(w.mean(), f, w.standard_error().max(1e-5 * f));
            assert!(
                z.p_value > significance,
                "eta {eta} {distribution:?} rho {rho} depth {max_depth} {wo} {wi}: {f} against {} ± {}",
                w.mean(),
                w.standard_error()
            );
        }
    }
}

/// Light that left a layer.
struct WalkExit {
    wi: Vec3,
    beta: Rgb,
    /// True for the mirror reflection.
    specular: bool,
}

/// Analog simulation: light enters, has up to `max_depth` events in the layer, and leaves.
fn analog_walk(l: &Layered, wo: Vec3, s: &mut Pcg32) -> Option<WalkExit> {
    let weight = |x: &BsdfSample| x.f * (x.wi.z.abs() / x.pdf);
    let all = dielectric::Select::All;
    let mut x = l.top.sample_select(wo, s.random::<f32>(), s.random::<[f32; 2]>(), Transport::Radiance, all)?;
    let mut beta = weight(&x);
    let mut specular = x.lobe.is_specular();
    if !x.lobe.contains(Lobe::TRANSMISSION) {
        return Some(WalkExit { wi: x.wi, beta, specular });
    }
    let (mut w, mut z) = (x.wi, l.thickness);
    for _ in 0..=l.max_depth {
        let free = if l.albedo.is_black() { f32::INFINITY } else { -(1.0 - s.random::<f32>()).ln() };
        let boundary = if w.z > 0.0 { l.thickness } else { 0.0 };
        let distance = (boundary - z) / w.z;
        if free < distance {
            z += free * w.z;
            // Henyey-Greenstein about the direction of travel, in its usual form.
            let (g, u) = (l.g, s.random::<[f32; 2]>());
            let cos = (1.0 + g * g - sqr((1.0 - g * g) / (1.0 - g + 2.0 * g * u[0]))) / (2.0 * g);
            w = lumiris_numbers::math::Frame::from_z(w).to_world(warp::direction(cos, TAU * u[1]));
            beta *= l.albedo;
            specular = false;
            continue;
        }
        if l.albedo.is_black() {
            beta *= (-distance).exp();
        }
        z = boundary;
        x = if z == 0.0 {
            match &l.base {
                Base::Diffuse(b) => b.sample(-w, 0.0, s.random::<[f32; 2]>())?,
                Base::Conductor(b) => b.sample(-w, 0.0, s.random::<[f32; 2]>())?,
            }
        } else {
            l.top.sample_select(-w, s.random::<f32>(), s.random::<[f32; 2]>(), Transport::Radiance, all)?
        };
        beta *= weight(&x);
        specular &= x.lobe.is_specular();
        w = x.wi;
        if x.lobe.contains(Lobe::TRANSMISSION) {
            return Some(WalkExit { wi: w, beta, specular });
        }
    }
    None
}

#[test]
fn albedos_of_the_closed_form_and_of_analog_walks_agree_to_half_a_percent() {
    for (distribution, rho) in
        [(ggx(0.0, 0.0), 0.9), (ggx(0.1, 0.1), 0.8), (ggx(0.5, 0.5), 1.0), (ggx(1.0, 1.0), 0.9), (ggx(0.3, 0.1), 0.9)]
    {
        let table = CoatTable::for_roughness(1.5, 0.01, distribution);
        let closed = CoatedDiffuse::new(&table, distribution, Rgb::splat(rho), 10);
        let walk = over_lambert(Dielectric { eta: 1.5, distribution }, rho, 10);
        for cos in [0.1, 0.5, 1.0] {
            let (wo, mut s) = (warp::direction(cos, 0.5), pcg32([8, 8, 8]));
            let w: Welford = (0..400_000)
                .map(|_| analog_walk(&walk, wo, &mut s).map_or(0.0, |exit| f64::from(exit.beta.r)))
                .collect();
            let albedo = f64::from(closed.albedo(wo).r);
            let bound = 0.005 * albedo + 3.0 * w.standard_error();
            assert!((w.mean() - albedo).abs() < bound, "{distribution:?} {cos}: {albedo}, {} walks", w.mean());
        }
    }
}

#[test]
fn layered_sampling_reproduces_the_analog_walk_in_three_bands() {
    // The integral of f cos over three bands of wi.z, and the mirror, by both kinds of walk.
    let tables = tables();
    let layers: Vec<_> = zoo(&tables)
        .into_iter()
        .filter_map(|(name, b)| if let Bsdf::Layered(l) = b { Some((name, l)) } else { None })
        .collect();
    let wos = [warp::direction(0.9, 0.3), warp::direction(-0.35, 1.3)];
    let significance = sidak(0.01, layers.len() * wos.len() * 4);
    for (name, l) in &layers {
        for &wo in &wos {
            let band = |wi: Vec3, specular: bool| if specular { 3 } else { ((wi.z.abs() * 3.0) as usize).min(2) };
            let (mut a, mut b) = ([Welford::new(); 4], [Welford::new(); 4]);
            let (mut s, mut t) = (pcg32([6, 1, 8]), pcg32([6, 2, 8]));
            for _ in 0..300_000 {
                let mut values = [0.0; 4];
                if let Some(WalkExit { wi, beta, specular }) = analog_walk(l, wo.abs(), &mut s) {
                    values[band(wi, specular)] = f64::from(beta.g);
                }
                a.iter_mut().zip(values).for_each(|(w, v)| w.add(v));
                let mut values = [0.0; 4];
                if let Some(x) = l.sample(wo, t.random::<f32>(), t.random::<[f32; 2]>()) {
                    assert!(x.wi.z * wo.z > 0.0);
                    values[band(x.wi, x.lobe.is_specular())] = f64::from(x.f.g * x.wi.z.abs() / x.pdf);
                }
                b.iter_mut().zip(values).for_each(|(w, v)| w.add(v));
            }
            for i in 0..4 {
                let exact = (a[i].mean() - b[i].mean()).abs() < 1e-5;
                let test = two_sample_z_test(&a[i], &b[i]);
                assert!(exact || test.p_value > significance, "{name} {wo} band {i}: {:?} {:?}", a[i], b[i]);
            }
        }
    }
}

#[test]
fn the_table_over_all_roughnesses_interpolates_to_a_fifth_of_a_percent_of_albedo() {
    let all = CoatTable::for_all_roughness(1.5, 0.01);
    for alpha in [0.0, 0.0013, 0.01, 0.05, 0.11, 0.27, 0.6, 0.95] {
        let d = ggx(alpha, alpha);
        let one = CoatTable::for_roughness(1.5, 0.01, d);
        for cos in [0.01, 0.1, 0.33, 0.62, 0.97] {
            let wo = warp::direction(cos, 1.0);
            let albedo = |table| CoatedDiffuse::new(table, d, Rgb::splat(0.9), 10).albedo(wo).r;
            let (a, b) = (albedo(&all), albedo(&one));
            assert!((a - b).abs() < 2e-3, "alpha {alpha} cos {cos}: {a} {b}");
        }
    }
}
