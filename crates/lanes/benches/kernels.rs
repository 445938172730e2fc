//! Nanoseconds per row of the scattering kernels: single vertices, rows in lanes, and one BSDF with 32 directions.
//!
//! `cargo bench -p lumiris-lanes --bench kernels -- [part of a name] [runs]`
#![allow(clippy::print_stdout, missing_docs)]

use lumiris_lanes::kernels::coated::COSINES;
use lumiris_lanes::kernels::*;
use lumiris_lanes::level;
use lumiris_numbers::math::{Frame, Vec3, warp};
use lumiris_test_support::random::{Pcg32, RngExt, pcg32};
use std::hint::black_box;
use std::time::Instant;

const ROWS: usize = 4096;
/// Number of directions for which one BSDF is evaluated.
const MANY: usize = 32;

fn arguments() -> impl Iterator<Item = String> {
    std::env::args().skip(1).filter(|a| !a.starts_with('-'))
}

/// Shortest time of several runs (ns per row).
fn time(mut run: impl FnMut()) -> f64 {
    let runs = arguments().nth(1).and_then(|a| a.parse().ok()).unwrap_or(50);
    let mut best = f64::INFINITY;
    for _ in 0..runs {
        let start = Instant::now();
        run();
        best = best.min(start.elapsed().as_secs_f64());
    }
    best * 1e9 / ROWS as f64
}

/// Input rows for all kernels: directions in world space, as columns and as vectors.
struct Scene {
    tables: Vec<f32>,
    frames: Vec<Frame>,
    wo: Vec<Vec3>,
    wi: Vec<Vec3>,
    u: Vec<[f32; 3]>,
    columns: [[Vec<f32>; 3]; 4],
}

fn columns(rows: &[[f32; 3]]) -> [Vec<f32>; 3] {
    [0, 1, 2].map(|k| rows.iter().map(|row| row[k]).collect())
}

fn slices(columns: &[Vec<f32>; 3]) -> [&[f32]; 3] {
    columns.each_ref().map(|column| &column[..])
}

impl Scene {
    fn new() -> Self {
        let mut s = pcg32([1, 2, 3]);
        let frames: Vec<Frame> =
            (0..ROWS).map(|_| Frame::from_z(warp::sample_uniform_sphere(s.random::<[f32; 2]>()))).collect();
        // Mostly on the viewer's side, some through the surface
        let mut direction = |frame: &Frame, below: f32| {
            let w = warp::sample_cosine_hemisphere(s.random::<[f32; 2]>());
            frame.to_world(if s.random::<f32>() < below { -w } else { w })
        };
        let wo: Vec<Vec3> = frames.iter().map(|frame| direction(frame, 0.0)).collect();
        let wi: Vec<Vec3> = frames.iter().map(|frame| direction(frame, 0.2)).collect();
        let u: Vec<[f32; 3]> = (0..ROWS).map(|_| s.random::<[f32; 3]>()).collect();
        let normals: Vec<[f32; 3]> = frames.iter().map(|frame| frame.z.to_array()).collect();
        let arrays = |w: &[Vec3]| columns(&w.iter().map(Vec3::to_array).collect::<Vec<_>>());
        let columns = [columns(&normals), arrays(&wo), arrays(&wi), columns(&u)];
        let tables = (0..4 * COSINES * 2).map(|i| 0.5 + 0.001 * (i % 256) as f32).collect();
        Scene { tables, frames, wo, wi, u, columns }
    }

    fn measure<K: BsdfKernel>(&self, name: &str, kernel: Kernel, params: impl Fn(&mut Pcg32) -> Vec<f32>) {
        // Arguments in columns
        if arguments().next().is_some_and(|part| !name.contains(&part)) {
            return;
        }
        let mut s = pcg32([4, 5, 6]);
        let params: Vec<Vec<f32>> = (0..ROWS).map(|_| params(&mut s)).collect();
        let by_param: Vec<Vec<f32>> = (0..K::PARAMS).map(|k| params.iter().map(|p| p[k]).collect()).collect();
        let by_param: Vec<&[f32]> = by_param.iter().map(|column| &column[..]).collect();
        let [ns, wo, wi, u] = self.columns.each_ref().map(slices);
        let rows = Rows { params: &by_param, tables: &self.tables, ns, tangents: None, wo };
        let mut out = vec![vec![0.0; ROWS]; 9];
        let [x, y, z, r, g, b, pdf, lobe, eta] = &mut out[..] else { unreachable!("there are nine") };

        // Evaluate
        let single = time(|| {
            for i in 0..ROWS {
                let [wo, wi] = [self.wo[i], self.wi[i]].map(|w| self.frames[i].to_local(w).into());
                black_box(K::evaluate::<f32>(&params[i], &self.tables, wo, wi));
            }
        });
        let evaluated = time(|| evaluate(level(), kernel, &rows, wi, &mut Values { f_cos: [r, g, b], pdf }));
        let many = time(|| {
            for first in (0..ROWS).step_by(MANY) {
                let range = first..first + MANY;
                let (frame, wo) = (self.frames[first], self.frames[first].to_local(self.wo[first]));
                let one = One { params: &params[first], tables: &self.tables, frame, wo };
                let f_cos = [&mut r[range.clone()], &mut g[range.clone()], &mut b[range.clone()]];
                let mut values = Values { f_cos, pdf: &mut pdf[range.clone()] };
                evaluate_one(level(), kernel, &one, wi.map(|column| &column[range.clone()]), &mut values);
            }
        });

        // Sample
        let sampled_single = time(|| {
            for i in 0..ROWS {
                let wo = self.frames[i].to_local(self.wo[i]).into();
                let drawn = K::sample::<f32>(&params[i], &self.tables, wo, self.u[i]);
                black_box((self.frames[i].to_world(drawn.wi.into()), drawn));
            }
        });
        let sampled = time(|| {
            let mut out = Directions { wi: [x, y, z], f_cos: [r, g, b], pdf, lobe, eta };
            sample(level(), kernel, &rows, u, &mut out);
        });
        println!("| {name} | {single:.1} | {evaluated:.1} | {many:.1} | {sampled_single:.1} | {sampled:.1} |");
    }
}

fn main() {
    // Header, then one row per kernel
    let scene = Scene::new();
    let some = |s: &mut Pcg32, n: usize| (0..n).map(|_| 0.1 + 0.8 * s.random::<f32>()).collect::<Vec<f32>>();
    println!("| ns per row | f and pdf, single | rows | one BSDF, {MANY} | sample, single | rows |");
    println!("|---|---|---|---|---|---|");
    scene.measure::<Diffuse>("diffuse", Kernel::Diffuse, |s| some(s, 3));
    scene.measure::<DiffuseTransmission>("diffuse transmission", Kernel::DiffuseTransmission, |s| some(s, 6));
    scene.measure::<Conductor>("conductor", Kernel::Conductor, |s| some(s, 8));
    scene.measure::<Conductor>("mirror", Kernel::Conductor, |s| [vec![0.0; 2], some(s, 6)].concat());
    scene.measure::<Dielectric>("dielectric", Kernel::Dielectric, |s| [vec![1.5], some(s, 2)].concat());
    scene.measure::<Dielectric>("smooth dielectric", Kernel::Dielectric, |_| vec![1.5, 0.0, 0.0]);
    scene.measure::<ThinDielectric>("thin dielectric", Kernel::ThinDielectric, |_| vec![1.5]);
    scene.measure::<Coated>("coated", Kernel::Coated, |s| [some(s, 4), vec![1.5], some(s, 2), vec![1.0, 0.3]].concat());
    scene.measure::<SmoothCoated>("smooth coat", Kernel::SmoothCoated, |s| [some(s, 4), vec![1.5, 0.01]].concat());
    let principled = |s: &mut Pcg32, sheen: f32, coat: f32, transmission: f32, eta: f32| {
        let mut p = some(s, 18);
        p[12..15].iter_mut().for_each(|c| *c *= sheen);
        (p[16], p[10], p[11]) = (p[16] * coat, p[10] * transmission, eta);
        p
    };
    scene.measure::<Principled>("principled", Kernel::Principled, |s| principled(s, 0.0, 0.0, 0.0, 0.0));
    scene.measure::<Principled>("principled, coat", Kernel::Principled, |s| principled(s, 0.0, 1.0, 0.0, 0.0));
    scene.measure::<Principled>("principled, glass", Kernel::Principled, |s| principled(s, 0.0, 0.0, 1.0, 1.5));
    scene.measure::<Principled>("principled, all", Kernel::Principled, |s| principled(s, 1.0, 1.0, 1.0, 1.5));
}
