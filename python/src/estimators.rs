//! The estimators of `lumiris_numbers`, row by row.

use lumiris::settings::Strata;
use lumiris_numbers::estimators::heuristics::{Heuristic, Technique};
use lumiris_numbers::estimators::ocv::{Form, MAX_COMPONENTS, NormalEquations};
use lumiris_numbers::estimators::optimal_mis as optimal;
use lumiris_numbers::estimators::ris::strata::{equal_proposals, equal_weights};
use lumiris_numbers::estimators::ris::{stratified, systematic, with_replacement};
use numpy::{
    IntoPyArray, PyArray1, PyArray2, PyArray4, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3,
    PyUntypedArrayMethods,
};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use strum::VariantNames;

fn wrong<T>(text: impl Into<String>) -> PyResult<T> {
    Err(PyValueError::new_err(text.into()))
}

/// Weights w of technique `a` against `b` at samples of `a`; with `is_factor`, w/(n p) instead.
#[pyfunction]
pub(crate) fn mis<'py>(
    py: Python<'py>,
    heuristic: &str,
    a: [PyReadonlyArray1<'py, f32>; 2],
    b: [PyReadonlyArray1<'py, f32>; 2],
    is_factor: bool,
) -> PyResult<Bound<'py, PyArray1<f32>>> {
    // Check the arguments
    let Ok(heuristic) = heuristic.parse::<Heuristic>() else {
        return wrong(format!("heuristic: expected balance, power or maximum, but found `{heuristic}`"));
    };
    let [na, pa, nb, pb] = [a[0].as_slice()?, a[1].as_slice()?, b[0].as_slice()?, b[1].as_slice()?];
    if [pa, nb, pb].iter().any(|v| v.len() != na.len()) {
        return wrong("numbers and densities of different lengths");
    }

    // Compute without the GIL
    let weights: Vec<f32> = py.detach(|| {
        let weight = |i: usize| {
            let (a, b) = (Technique { n: na[i], p: pa[i] }, Technique { n: nb[i], p: pb[i] });
            if is_factor { heuristic.factor(a, b) } else { heuristic.weight(a, b) }
        };
        (0..na.len()).map(weight).collect()
    });
    Ok(weights.into_pyarray(py))
}

/// Indices and scales, rows × draws.
type Draws<'py> = (Bound<'py, PyArray2<u32>>, Bound<'py, PyArray2<f32>>);

/// Draws proposals in each row, with a value of the setting `strata`. `u` has a uniform number per draw, and `u_ends`
/// one per end of strata of equal weights.
///
/// Returns indices and scales. A draw that is impossible has the scale 0.
#[pyfunction]
pub(crate) fn ris_draws<'py>(
    py: Python<'py>,
    words: &str,
    weights: PyReadonlyArray2<'py, f32>,
    u: PyReadonlyArray2<'py, f32>,
    u_ends: PyReadonlyArray2<'py, f32>,
) -> PyResult<Draws<'py>> {
    // Check the arguments
    let ([rows, m], [_, n], [_, ends]) = (dims(&weights), dims(&u), dims(&u_ends));
    if dims(&u)[0] != rows || dims(&u_ends)[0] != rows {
        return wrong("weights and uniform numbers of different numbers of rows");
    }
    if m > u32::MAX as usize || n > u32::MAX as usize {
        return wrong("too many proposals or draws");
    }
    let strata = match words.parse::<Strata>() {
        Ok(Strata::Weights) if ends + 1 < n => {
            return wrong(format!("{n} strata of equal weights need {} uniform numbers for their ends", n - 1));
        }
        Ok(strata) => strata,
        Err(_) => return wrong(format!("strata: expected {}, but found `{words}`", Strata::VARIANTS.join(", "))),
    };

    // Draw row by row
    let (weights, u, u_ends) = (weights.as_slice()?, u.as_slice()?, u_ends.as_slice()?);
    let (mut index, mut scale) = (vec![0; rows * n], vec![0.0; rows * n]);
    py.detach(|| {
        let (mut draws, mut bounds) = (Vec::new(), Vec::new());
        for row in 0..rows {
            let (weights, u) = (&weights[row * m..][..m], &u[row * n..][..n]);
            match strata {
                Strata::None => with_replacement(weights, u, &mut draws),
                Strata::Systematic => systematic(weights, n as u32, u.first().copied().unwrap_or(0.0), &mut draws),
                Strata::Proposals => equal_proposals(m, n, &mut bounds),
                Strata::Weights => equal_weights(weights, n, &u_ends[row * ends..][..ends], &mut bounds),
            }
            if matches!(strata, Strata::Proposals | Strata::Weights) {
                stratified(weights, &bounds, u, &mut draws);
            }
            for (i, draw) in draws.iter().enumerate() {
                (index[row * n + i], scale[row * n + i]) = (draw.index, draw.scale);
            }
        }
    });
    Ok((index.into_pyarray(py).reshape([rows, n])?, scale.into_pyarray(py).reshape([rows, n])?))
}

/// Samples of rows: columns r_j = p_j/p_α (rows × samples × m) and values y (rows × samples × 3).
type Samples<'py> = (PyReadonlyArray3<'py, f32>, PyReadonlyArray3<'py, f32>);

/// Adds samples of one row to the sums.
fn add(equations: NormalEquations, sums: &mut [f32], r: &[f32], y: &[f32]) {
    let columns: Vec<usize> = (0..equations.components()).collect();
    for (r, y) in r.chunks_exact(columns.len()).zip(y.as_chunks::<3>().0) {
        let sample: Vec<(usize, f32)> = columns.iter().copied().zip(r.iter().copied()).collect();
        equations.add_sparse(sums, &sample, *y);
    }
}

/// The numbers of rows, samples and columns; fails if the shapes do not agree.
fn shape((r, y): &Samples<'_>, integrals: &PyReadonlyArray1<'_, f32>) -> PyResult<[usize; 3]> {
    let ([rows, n, m], [y_rows, y_n, channels]) = (dims3(r), dims3(y));
    if [y_rows, y_n, channels] != [rows, n, 3] {
        return wrong(format!("values of shape {:?} do not belong to columns of shape {:?}", y.shape(), r.shape()));
    }
    if !(1..=MAX_COMPONENTS).contains(&m) {
        return wrong(format!("expected 1 to {MAX_COMPONENTS} columns, but found {m}"));
    }
    if integrals.shape() != [m] {
        return wrong(format!("expected {m} integrals, but found {}", integrals.shape()[0]));
    }
    Ok([rows, n, m])
}

/// Estimates (rows × 3), coefficients (rows × fits × m × 3), and the number of ill-conditioned systems.
type Fitted<'py> = (Bound<'py, PyArray2<f32>>, Bound<'py, PyArray4<f32>>, usize);

/// Optimizing control variates. `others` are the samples to which the form `progressive` is fitted.
#[pyfunction]
pub(crate) fn ocv<'py>(
    py: Python<'py>,
    form: &str,
    samples: Samples<'py>,
    integrals: PyReadonlyArray1<'py, f32>,
    others: Option<Samples<'py>>,
) -> PyResult<Fitted<'py>> {
    let form = match (form.parse::<Form>(), &others) {
        (Ok(Form::Progressive), None) => return wrong("the form progressive needs other samples to be fitted to"),
        (Ok(Form::Pixels), _) => {
            return wrong("the form pixels is fitted to images: use progressive and other samples");
        }
        (Ok(Form::Paper | Form::Regression | Form::Crossfit), Some(_)) => {
            return wrong("only the form progressive is fitted to other samples");
        }
        (Ok(form), _) => form,
        (Err(_), _) => return wrong(format!("form: expected {}, but found `{form}`", Form::VARIANTS.join(", "))),
    };
    let [rows, n, m] = shape(&samples, &integrals)?;
    let fit_n = match &others {
        Some(others) => match shape(others, &integrals)? {
            [other_rows, n, _] if other_rows == rows => n,
            _ => return wrong("samples and other samples of different numbers of rows"),
        },
        None => n,
    };
    let (r, y, integrals) = (samples.0.as_slice()?, samples.1.as_slice()?, integrals.as_slice()?);
    let fitted = others.as_ref().map(|(r, y)| Ok::<_, PyErr>((r.as_slice()?, y.as_slice()?))).transpose()?;
    let (equations, fits) = (NormalEquations::new(m), form.rows());
    let mut estimates = Vec::with_capacity(3 * rows);
    let mut beta = vec![0.0; rows * fits * equations.coefficients()];
    let ill = py.detach(|| {
        // Centred sums of each part of a row's samples
        let sums_of = |row: usize, n: usize, (r, y): (&[f32], &[f32])| {
            let mut sums = vec![0.0; fits * equations.len()];
            for (part, sums) in sums.chunks_exact_mut(equations.len()).enumerate() {
                let (begin, end) = (row * n + part * n / fits, row * n + (part + 1) * n / fits);
                add(equations, sums, &r[begin * m..end * m], &y[begin * 3..end * 3]);
                form.finish(equations, sums, integrals);
            }
            sums
        };
        let mut ill = 0;
        for (row, beta) in beta.chunks_exact_mut(fits * equations.coefficients()).enumerate() {
            let sums = sums_of(row, n, (r, y));
            let sums_fitted = fitted.map(|fitted| sums_of(row, fit_n, fitted));
            ill += equations.solve(form.system(), sums_fitted.as_ref().unwrap_or(&sums), beta);
            estimates.extend(form.estimate(equations, &sums, beta, integrals));
        }
        ill
    });
    let beta = beta.into_pyarray(py).reshape([rows, fits, m, 3])?;
    Ok((estimates.into_pyarray(py).reshape([rows, 3])?, beta, ill))
}

/// Optimal multiple importance sampling, with coefficients from the same samples. Returns estimates (rows × 3) and the
/// number of ill-conditioned systems.
#[pyfunction]
pub(crate) fn optimal_mis<'py>(
    py: Python<'py>,
    samples: Samples<'py>,
    integrals: PyReadonlyArray1<'py, f32>,
) -> PyResult<(Bound<'py, PyArray2<f32>>, usize)> {
    // One system per row
    let [rows, n, m] = shape(&samples, &integrals)?;
    let (r, y, integrals) = (samples.0.as_slice()?, samples.1.as_slice()?, integrals.as_slice()?);
    let equations = NormalEquations::new(m);
    let (mut estimates, mut ill) = (Vec::with_capacity(3 * rows), 0);
    py.detach(|| {
        for row in 0..rows {
            let mut sums = vec![0.0; equations.len()];
            add(equations, &mut sums, &r[row * n * m..][..n * m], &y[row * n * 3..][..n * 3]);
            let outcome = optimal::direct(equations, &sums, integrals);
            estimates.extend(outcome.estimate);
            ill += usize::from(outcome.is_ill_conditioned);
        }
    });
    Ok((estimates.into_pyarray(py).reshape([rows, 3])?, ill))
}

fn dims(array: &PyReadonlyArray2<'_, f32>) -> [usize; 2] {
    [array.shape()[0], array.shape()[1]]
}

fn dims3(array: &PyReadonlyArray3<'_, f32>) -> [usize; 3] {
    [array.shape()[0], array.shape()[1], array.shape()[2]]
}
