//! Tests of `lumiris_lanes::kernels`: rows in lanes, many directions of one BSDF, and single directions have the same
//! bits.

use super::support::{LENGTHS, assert_same_bits};
use lumiris_lanes::kernels::coated::COSINES;
use lumiris_lanes::kernels::*;
use lumiris_numbers::math::{Frame, Vec3, warp};
use lumiris_test_support::random::{Pcg32, RngExt, pcg32};

/// Value and density, given parameters, tables and both directions.
type Evaluate = fn(&[f32], &[f32], [Vec3; 2]) -> [f32; 4];

/// A sample, given parameters, tables, the direction to the viewer, and random numbers.
type Sample = fn(&[f32], &[f32], Vec3, [f32; 3]) -> [f32; 9];

/// A kernel with a generator of its parameters.
struct Case {
    kernel: Kernel,
    params: fn(&mut Pcg32) -> Vec<f32>,
    evaluate: Evaluate,
    sample: Sample,
}

fn case<K: BsdfKernel>(kernel: Kernel, params: fn(&mut Pcg32) -> Vec<f32>) -> Case {
    Case {
        kernel,
        params,
        evaluate: |p, tables, [wo, wi]| {
            let Value { f_cos: [r, g, b], pdf } = K::evaluate(p, tables, wo.into(), wi.into());
            [r, g, b, pdf]
        },
        sample: |p, tables, wo, u| {
            let Drawn { wi, f_cos: [r, g, b], pdf, lobe, eta } = K::sample(p, tables, wo.into(), u);
            [wi.x, wi.y, wi.z, r, g, b, pdf, lobe, eta]
        },
    }
}

fn uniform(s: &mut Pcg32, from: f32, to: f32) -> f32 {
    from + (to - from) * s.random::<f32>()
}

fn numbers(s: &mut Pcg32, n: usize) -> Vec<f32> {
    (0..n).map(|_| s.random::<f32>()).collect()
}

/// Smooth, slightly rough, or any roughness.
fn alpha(s: &mut Pcg32) -> f32 {
    match s.random::<f32>() {
        x if x < 0.2 => 0.0,
        x if x < 0.4 => 0.001,
        _ => uniform(s, 0.001, 1.0),
    }
}

fn metal(s: &mut Pcg32) -> Vec<f32> {
    let index = (0..6).map(|_| uniform(s, 0.0, 4.0)).collect::<Vec<_>>();
    [vec![alpha(s), alpha(s)], index].concat()
}

/// No interface, glass, or glass from inside.
fn glass(s: &mut Pcg32) -> Vec<f32> {
    let eta = if s.random::<f32>() < 0.2 { 1.0 } else { uniform(s, 0.4, 2.5) };
    vec![eta, alpha(s), alpha(s)]
}

const TABLE_ROWS: usize = 5;

fn rough_coat(s: &mut Pcg32) -> Vec<f32> {
    let place = [(s.random::<f32>() * (TABLE_ROWS - 1) as f32).floor(), (s.random::<f32>() - 0.5).max(0.0)];
    let facets = [uniform(s, 1.1, 2.0), alpha(s).max(0.001), alpha(s).max(0.001)];
    [numbers(s, 4), facets.to_vec(), place.to_vec()].concat()
}

fn smooth_coat(s: &mut Pcg32) -> Vec<f32> {
    let thickness = (s.random::<f32>() - 0.3).max(0.0);
    [numbers(s, 4), vec![uniform(s, 1.0, 2.0), thickness]].concat()
}

/// Coat, sheen, metal and glass are each present or absent.
fn principled(s: &mut Pcg32) -> Vec<f32> {
    let part = |s: &mut Pcg32| (s.random::<f32>() * 1.5 - 0.5).max(0.0);
    let mut p = numbers(s, 18);
    (p[8], p[9], p[17]) = (alpha(s).max(0.001), alpha(s).max(0.001), alpha(s).max(0.001));
    (p[3], p[10], p[16], p[15]) = (part(s), part(s), part(s), p[15].max(0.005));
    p[11] = if p[11] < 0.5 { 0.0 } else { 0.6 + p[11] };
    if s.random::<f32>() < 0.5 {
        p[12..15].fill(0.0);
    }
    p
}

fn cases() -> Vec<Case> {
    vec![
        case::<Diffuse>(Kernel::Diffuse, |s| numbers(s, 3)),
        case::<DiffuseTransmission>(Kernel::DiffuseTransmission, |s| match s.random::<f32>() {
            x if x < 0.2 => vec![0.0; 6],
            _ => numbers(s, 6),
        }),
        case::<Conductor>(Kernel::Conductor, metal),
        case::<Dielectric>(Kernel::Dielectric, glass),
        case::<Exit>(Kernel::Exit, glass),
        case::<ThinDielectric>(Kernel::ThinDielectric, |s| vec![uniform(s, 1.0, 2.5)]),
        case::<Coated>(Kernel::Coated, rough_coat),
        case::<SmoothCoated>(Kernel::SmoothCoated, smooth_coat),
        case::<Principled>(Kernel::Principled, principled),
    ]
}

/// T and R of coats.
fn tables() -> Vec<f32> {
    (0..TABLE_ROWS * COSINES * 2).map(|i| 0.9 * ((i * 37 % 101) as f32 / 101.0)).collect()
}

/// A random direction: often grazing, sometimes on an axis of the frame or NaN.
fn direction(s: &mut Pcg32, frame: &Frame) -> Vec3 {
    let w = warp::sample_uniform_sphere(s.random::<[f32; 2]>());
    match s.random::<f32>() {
        x if x < 0.05 => frame.z,
        x if x < 0.1 => frame.x,
        x if x < 0.3 => frame.to_world(warp::direction(w.z * 1e-4, w.x * 6.0)),
        x if x < 0.32 => Vec3::splat(f32::NAN),
        _ => w,
    }
}

fn columns<const N: usize>(rows: &[[f32; N]]) -> [Vec<f32>; N] {
    std::array::from_fn(|k| rows.iter().map(|row| row[k]).collect())
}

fn slices<const N: usize>(columns: &[Vec<f32>; N]) -> [&[f32]; N] {
    columns.each_ref().map(|column| &column[..])
}

/// Compares columns with the expected ones. All kinds of NaN are equal.
fn assert_columns<const N: usize>(expected: &[[f32; N]], run: impl Fn(lumiris_lanes::Level, [&mut [f32]; N])) {
    assert_same_bits::<N>(expected.len(), |level, mut out| {
        run(level, out.each_mut().map(|column| &mut **column));
        for (i, row) in expected.iter().enumerate() {
            for (k, x) in row.iter().enumerate() {
                let y = out[k][i];
                assert!(x.to_bits() == y.to_bits() || (x.is_nan() && y.is_nan()), "{level:?}, row {i}.{k}: {x} {y}");
            }
        }
    });
}

#[test]
fn rows_are_single_vertices_in_all_bits() {
    // Parameters, frames and directions
    let (s, tables) = (&mut pcg32([5, 0, 1]), tables());
    let mut samples = [0; 3];
    for case in cases() {
        for (round, n) in LENGTHS.into_iter().chain([256; 20]).enumerate() {
            let params: Vec<Vec<f32>> = (0..n).map(|_| (case.params)(s)).collect();
            let tangent = |s: &mut Pcg32| warp::sample_uniform_sphere(s.random::<[f32; 2]>());
            let frames: Vec<Frame> = (0..n)
                .map(|_| {
                    let z = warp::sample_uniform_sphere(s.random::<[f32; 2]>());
                    if round % 2 == 0 { Frame::from_z(z) } else { Frame::from_xz(tangent(s), z) }
                })
                .collect();
            let wo: Vec<Vec3> = frames.iter().map(|frame| direction(s, frame)).collect();
            let wi: Vec<Vec3> = frames.iter().map(|frame| direction(s, frame)).collect();
            let u: Vec<[f32; 3]> = (0..n).map(|_| s.random::<[f32; 3]>()).collect();

            // In columns
            let [wo_columns, wi_columns] =
                [&wo, &wi].map(|w| columns(&w.iter().map(Vec3::to_array).collect::<Vec<_>>()));
            let ns = columns(&frames.iter().map(|frame| frame.z.to_array()).collect::<Vec<_>>());
            let x = columns(&frames.iter().map(|frame| frame.x.to_array()).collect::<Vec<_>>());
            let u_columns = columns(&u);
            let by_param: Vec<Vec<f32>> =
                (0..case.kernel.params()).map(|k| params.iter().map(|p| p[k]).collect()).collect();
            let by_param: Vec<&[f32]> = by_param.iter().map(|column| &column[..]).collect();
            let rows = Rows {
                params: &by_param,
                tables: &tables,
                ns: slices(&ns),
                tangents: (round % 2 == 1).then(|| slices(&x)),
                wo: slices(&wo_columns),
            };

            // Values
            let values: Vec<[f32; 4]> = (0..n)
                .map(|i| {
                    let local = [wo[i], wi[i]].map(|w| frames[i].to_local(w));
                    (case.evaluate)(&params[i], &tables, local)
                })
                .collect();
            assert!(values.iter().flatten().all(|x| x.is_finite() && *x >= 0.0), "{:?}", case.kernel);
            assert_columns(&values, |level, [r, g, b, pdf]| {
                evaluate(level, case.kernel, &rows, slices(&wi_columns), &mut Values { f_cos: [r, g, b], pdf });
            });

            // Samples
            let drawn: Vec<[f32; 9]> = (0..n)
                .map(|i| {
                    let mut drawn = (case.sample)(&params[i], &tables, frames[i].to_local(wo[i]), u[i]);
                    let local = Vec3::new(drawn[0], drawn[1], drawn[2]);
                    drawn[..3].copy_from_slice(&frames[i].to_world(local).to_array());
                    drawn
                })
                .collect();
            assert_columns(&drawn, |level, [x, y, z, r, g, b, pdf, lobe, eta]| {
                let mut out = Directions { wi: [x, y, z], f_cos: [r, g, b], pdf, lobe, eta };
                sample(level, case.kernel, &rows, slices(&u_columns), &mut out);
            });
            for sample in drawn.iter().filter(|sample| sample[6] > 0.0) {
                let flags = sample[7] as u8;
                samples[0] += 1;
                samples[1] += usize::from(flags & lobe::SPECULAR != 0);
                samples[2] += usize::from(flags & lobe::TRANSMISSION != 0);
            }
        }
    }
    assert!(samples.iter().all(|&count| count > 1000), "{samples:?}: all kinds of samples are tested");
}

#[test]
fn many_directions_of_one_bsdf_are_single_ones_in_all_bits() {
    let (s, tables) = (&mut pcg32([5, 0, 2]), tables());
    for case in cases() {
        for n in LENGTHS.into_iter().chain([32; 20]) {
            let frame = Frame::from_z(warp::sample_uniform_sphere(s.random::<[f32; 2]>()));
            let (params, wo) = ((case.params)(s), frame.to_local(direction(s, &frame)));
            let wi: Vec<Vec3> = (0..n).map(|_| direction(s, &frame)).collect();
            let wi_columns = columns(&wi.iter().map(Vec3::to_array).collect::<Vec<_>>());
            let values: Vec<[f32; 4]> =
                wi.iter().map(|&wi| (case.evaluate)(&params, &tables, [wo, frame.to_local(wi)])).collect();
            let one = One { params: &params, tables: &tables, frame, wo };
            assert_columns(&values, |level, [r, g, b, pdf]| {
                evaluate_one(level, case.kernel, &one, slices(&wi_columns), &mut Values { f_cos: [r, g, b], pdf });
            });
        }
    }
}
