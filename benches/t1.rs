//! Time per proposal of direct lighting (ns): directions to one light, values of one BSDF, and weights. In lanes, with
//! the slowdown of single calls.
//!
//! `cargo bench --bench t1 -- [part of a name] [runs]`
#![allow(clippy::print_stdout, missing_docs)]

use lumiris::bsdfs::{
    Bsdf, CoatTable, CoatedDiffuse, Conductor, Dielectric, Diffuse, DiffuseTransmission, TrowbridgeReitz,
};
use lumiris::lights::{EnvironmentFilter, EnvironmentMap, EnvironmentMapping};
use lumiris::lights::{Light, LightCtx, LightLanes, PointLight};
use lumiris::materials::SurfaceBsdf;
use lumiris_lanes::hilbert::{hilbert_points, hilbert_points_scalar, strata, strata_scalar};
use lumiris_lanes::ris_weights::{Proposals, Weights, weigh};
use lumiris_numbers::estimators::heuristics::Heuristic;
use lumiris_numbers::math::hash::pcg4d;
use lumiris_numbers::math::warp::sample_uniform_sphere;
use lumiris_numbers::math::{Affine3A, Frame, Rgb, Vec3};
use lumiris_test_support::random::{RngExt, pcg32};
use std::hint::black_box;
use std::sync::Arc;
use std::time::Instant;

const SIZES: [usize; 3] = [8, 32, 128];

/// Number of shading points with separate random numbers, large enough to avoid warm caches.
const POINTS: u32 = 4096;

/// Best of several runs over all points (ns per sample).
fn time(m: usize, mut run: impl FnMut(u32)) -> f64 {
    let points = POINTS / (m as u32 / 8);
    let mut best = f64::INFINITY;
    for _ in 0..runs() {
        let start = Instant::now();
        for point in 0..points {
            run(point);
        }
        best = best.min(start.elapsed().as_secs_f64());
    }
    best * 1e9 / (f64::from(points) * m as f64)
}

fn report(name: &str, m: usize, lanes: f64, single: f64) {
    println!("{name:32} M = {m:3}: {lanes:7.2} ns, single {single:7.2} ns, ratio {:5.1}", single / lanes);
}

fn arguments() -> impl Iterator<Item = String> {
    std::env::args().skip(1).filter(|a| !a.starts_with('-'))
}

fn runs() -> u32 {
    arguments().nth(1).and_then(|a| a.parse().ok()).unwrap_or(7)
}

fn is_wanted(name: &str) -> bool {
    arguments().next().is_none_or(|part| name.contains(&part))
}

/// Random numbers of all points, sorted along the Hilbert curve.
fn numbers(m: usize) -> Vec<[Vec<f32>; 2]> {
    (0..POINTS / (m as u32 / 8))
        .map(|point| {
            let (mut t, mut jitter) = (vec![0; m], vec![0; m]);
            let mut u = [vec![0.0; m], vec![0.0; m]];
            strata(pcg4d([point, 1, 2, 3])[0], point, m as u32, &mut t, &mut jitter);
            let [u0, u1] = &mut u;
            hilbert_points(&t, &jitter, u0, u1);
            u
        })
        .collect()
}

/// An environment map with a sky of soft gradients, some noise and a small sun.
fn sky(size: [usize; 2], mapping: EnvironmentMapping, filter: EnvironmentFilter) -> Light {
    let mut stream = pcg32([1, 2, 3]);
    let texels = (0..size[0] * size[1])
        .map(|i| {
            let (x, y) = ((i % size[0]) as f32 / size[0] as f32, (i / size[0]) as f32 / size[1] as f32);
            let sun = ((x - 0.3).powi(2) + (y - 0.4).powi(2)) < 1e-4;
            let l = (1.5 + (x * 9.0).sin() * (y * 7.0).cos()) * (0.5 + stream.random::<f32>());
            Rgb::splat(if sun { 2000.0 } else { l })
        })
        .collect();
    let map = EnvironmentMap::new(texels, size, mapping, filter).expect("the sizes fit");
    Light::infinite_image(Arc::new(map), &Affine3A::from_rotation_x(0.5), 1.0)
}

type Make = Box<dyn Fn() -> Light>;

fn lights() -> Vec<(&'static str, Make)> {
    let l = Rgb::new(1.0, 2.0, 3.0);
    let (nearest, bilinear) = (EnvironmentFilter::Nearest, EnvironmentFilter::Bilinear);
    vec![
        ("environment 256² nearest", Box::new(move || sky([256, 256], EnvironmentMapping::EqualArea, nearest))),
        ("environment 1024² nearest", Box::new(move || sky([1024, 1024], EnvironmentMapping::EqualArea, nearest))),
        ("environment 1024² bilinear", Box::new(move || sky([1024, 1024], EnvironmentMapping::EqualArea, bilinear))),
        ("environment 2048×1024 bilinear", Box::new(move || sky([2048, 1024], EnvironmentMapping::LatLong, bilinear))),
        ("environment 4096×2048 bilinear", Box::new(move || sky([4096, 2048], EnvironmentMapping::LatLong, bilinear))),
        ("constant environment", Box::new(move || Light::InfiniteConstant { l })),
        ("point light", Box::new(move || Light::Point(PointLight { p: Vec3::Y * 3.0, intensity: l }))),
    ]
}

fn main() {
    // Lights
    for (name, make) in lights() {
        if !is_wanted(name) {
            continue;
        }
        let light = make();
        for m in SIZES {
            let numbers = numbers(m);
            let mut v = vec![vec![0.0; m]; 7];
            let mut measure = |is_single: bool| {
                let [x, y, z, r, g, b, pdf] = &mut v[..] else { unreachable!("there are seven") };
                let mut out = LightLanes { wi: [x, y, z], li: [r, g, b], pdf };
                time(m, |point| {
                    let [jx, jy, ..] = pcg4d([point, 7, 7, 7]).map(|h| h as f32 * 1e-10);
                    let ctx = LightCtx::on(Vec3::new(jx, 0.0, jy), Vec3::Y);
                    let u = numbers[point as usize].each_ref().map(|u| &u[..]);
                    if is_single || !light.sample_li_columns(u, &mut out) {
                        for i in 0..m {
                            let Some(s) = light.sample_li(&ctx, [u[0][i], u[1][i]]) else { continue };
                            for c in 0..3 {
                                (out.wi[c][i], out.li[c][i]) = (s.wi[c], s.li[c]);
                            }
                            out.pdf[i] = s.pdf;
                        }
                    }
                    black_box(&mut out);
                })
            };
            let (lanes, single) = (measure(false), measure(true));
            report(name, m, lanes, single);
        }
    }

    // BSDFs and kernels
    bsdfs();
    for m in SIZES {
        kernels(m);
    }
}

fn bsdfs() {
    // One BSDF of each kind
    let rgb = Rgb::new(0.2, 0.5, 0.8);
    let distribution = TrowbridgeReitz::new(0.3, 0.3);
    let (rough, smooth) = (distribution, TrowbridgeReitz::new(0.0, 0.0));
    let rough_coat = CoatTable::for_roughness(1.5, 0.01, rough);
    let smooth_coat = CoatTable::for_roughness(1.5, 0.01, smooth);
    let (eta, k) = (Rgb::new(0.2, 0.9, 1.1), Rgb::new(3.9, 2.4, 2.2));
    let all = [
        ("diffuse", Bsdf::Diffuse(Diffuse { reflectance: rgb })),
        ("translucent", Bsdf::DiffuseTransmission(DiffuseTransmission { reflectance: rgb, transmittance: rgb })),
        ("conductor", Bsdf::Conductor(Conductor { distribution, eta, k })),
        ("dielectric", Bsdf::Dielectric(Dielectric { eta: 1.5, distribution })),
        ("coated, rough", Bsdf::CoatedDiffuse(CoatedDiffuse::new(&rough_coat, rough, rgb, 10))),
        ("coated, smooth", Bsdf::CoatedDiffuse(CoatedDiffuse::new(&smooth_coat, smooth, rgb, 10))),
    ];

    // Many directions from one viewer
    for (name, bsdf) in all {
        if !is_wanted(name) {
            continue;
        }
        let frame = Frame::from_z(Vec3::new(0.48, 0.6, 0.64));
        let surface = SurfaceBsdf { bsdf, frame, makes_caustics: false, n: frame.z };
        let wo = frame.to_world(Vec3::new(0.6, 0.0, 0.8));
        for m in SIZES {
            let mut stream = pcg32([3, 1, 4]);
            let w: Vec<Vec3> = (0..m).map(|_| sample_uniform_sphere(stream.random::<[f32; 2]>())).collect();
            let wi: Vec<Vec<f32>> = (0..3).map(|c| w.iter().map(|w| w[c]).collect()).collect();
            let wi = [&wi[0][..], &wi[1], &wi[2]];
            let mut v = vec![vec![0.0; m]; 4];
            let [r, g, b, pdf] = &mut v[..] else { unreachable!("there are four") };
            let lanes = time(m, |_| {
                surface.eval_lanes(black_box(wo), wi, [&mut r[..], &mut g[..], &mut b[..]], pdf);
                black_box(&mut *pdf);
            });
            let single = time(m, |_| {
                surface.eval_each(black_box(wo), wi, [&mut r[..], &mut g[..], &mut b[..]], pdf);
                black_box(&mut *pdf);
            });
            report(name, m, lanes, single);
        }
    }
}

fn kernels(m: usize) {
    // Each kernel against its scalar twin
    let (mut t, mut jitter) = (vec![0; m], vec![0; m]);
    let mut v: Vec<Vec<f32>> = (0..11).map(|k| (0..m).map(|i| (i + k) as f32 * 0.1).collect()).collect();
    if is_wanted("strata") {
        let lanes = time(m, |p| strata(black_box(p), p, m as u32, &mut t, &mut jitter));
        let single = time(m, |p| strata_scalar(black_box(p), p, m as u32, &mut t, &mut jitter));
        report("strata", m, lanes, single);
    }
    let [u0, u1, rest @ ..] = &mut v[..] else { unreachable!("there are eleven") };
    if is_wanted("curve") {
        let lanes = time(m, |_| hilbert_points(black_box(&t), &jitter, u0, u1));
        let single = time(m, |_| hilbert_points_scalar(black_box(&t), &jitter, u0, u1));
        report("curve", m, lanes, single);
    }
    if is_wanted("combine") {
        let [a, b, c, d, e, f, q_hat, r, w] = rest else { unreachable!("there are nine") };
        let (f_cos, li) = ([&a[..], b, c], [&d[..], e, f]);
        let proposals =
            Proposals { f_cos, li, p: u0, p_other: u1, m: m as f32, m_other: 1.0, heuristic: Heuristic::Power };
        let mut out = Weights { q_hat, r, w };
        let lanes = time(m, |_| weigh(lumiris_lanes::level(), black_box(&proposals), &mut out));
        let single = time(m, |_| weigh(lumiris_lanes::Level::baseline(), black_box(&proposals), &mut out));
        report("combine (single: baseline)", m, lanes, single);
    }
}
