//! Per-pixel state of estimators: coefficients fitted to earlier estimates, or sums of control variates.

use crate::film::fixed_sums::FixedSum;
use crate::film::packed::PackedRows;
use lumiris_numbers::estimators::ocv::NormalEquations;

/// Solves the systems of all fits from their sums. Returns the number of ill-conditioned systems.
pub(super) type Solver = fn(NormalEquations, &[f32], &mut [f32]) -> u64;

/// Sums over earlier estimates, and coefficients for later estimates.
///
/// An estimate uses the coefficients of its fit and adds its samples to the sums. [`Self::solve`] begins a new block
/// with coefficients fitted to all sums. Later estimates must be independent of earlier ones.
#[derive(Clone, Debug)]
pub struct Fits {
    equations: NormalEquations,
    solver: Solver,
    sums: Vec<f32>,
    beta: Vec<f32>,
    controls: PixelControls,
}

/// Sums over all estimates of a pixel: values by channel, and control variates, whose expectation is 0. Both have the
/// weights of film samples.
#[derive(Clone, Debug, Default)]
struct PixelControls {
    components: usize,
    /// The sums, except while samples are being added.
    packed: PackedRows,
    /// The sums while samples are being added; otherwise empty.
    sums: Vec<FixedSum>,
    /// Values and controls of the current batch, by camera sample.
    batch: Vec<f32>,
}

impl PixelControls {
    fn row(&self, index: usize) -> std::ops::Range<usize> {
        let len = 3 + self.components;
        index * len..(index + 1) * len
    }

    /// The unpacked sums.
    fn unpack(&mut self) -> &mut Vec<FixedSum> {
        if self.sums.is_empty() {
            self.sums = self.packed.unpacked();
        }
        &mut self.sums
    }
}

impl Default for Fits {
    fn default() -> Self {
        Fits::new(NormalEquations::new(0), |_, _, _| 0, 0)
    }
}

impl Fits {
    /// `count` fits without samples.
    pub(super) fn new(equations: NormalEquations, solver: Solver, count: usize) -> Self {
        let [sums, beta] = [equations.len(), equations.coefficients()].map(|len| vec![0.0; count * len]);
        Fits { equations, solver, sums, beta, controls: PixelControls::default() }
    }

    /// Empty sums of values and of `components` control variates for `count` pixels.
    pub fn of_pixels(components: usize, count: usize) -> Self {
        let packed = PackedRows::new(count, 3 + components);
        let controls = PixelControls { components, packed, ..PixelControls::default() };
        Fits { controls, ..Fits::default() }
    }

    /// Begins a batch of camera samples.
    pub(crate) fn begin_batch(&mut self, samples: usize) {
        if !self.controls.packed.is_empty() {
            self.controls.batch.clear();
            self.controls.batch.resize(samples * (3 + self.controls.components), 0.0);
        }
    }

    /// Sets value and controls of a camera sample of the batch, if sums of controls are enabled.
    pub(crate) fn set_controls(&mut self, sample: u32, value: [f32; 3], controls: &[f32]) {
        if !self.controls.batch.is_empty() && value.iter().chain(controls).all(|v| v.is_finite()) {
            let row = self.controls.row(sample as usize);
            self.controls.batch[row].iter_mut().zip(value.iter().chain(controls)).for_each(|(to, v)| *to = *v);
        }
    }

    /// Adds the batch to the sums of its pixels. The camera samples are given by fit and weight.
    pub(crate) fn end_batch(&mut self, samples: impl Iterator<Item = (u32, f32)>) {
        if self.controls.batch.is_empty() {
            return;
        }
        self.controls.unpack();
        for (i, (fit, weight)) in samples.enumerate() {
            let (from, to) = (self.controls.row(i), self.controls.row(fit as usize));
            for (sum, v) in self.controls.sums[to].iter_mut().zip(&self.controls.batch[from]) {
                sum.add_product(weight, *v);
            }
        }
    }

    /// Number of control variates.
    pub fn controls(&self) -> usize {
        self.controls.components
    }

    /// Number of sums of all pixels: values by channel, and control variates.
    pub fn sum_count(&self) -> usize {
        self.controls.packed.len()
    }

    /// The sums of all pixels, pixel by pixel: values by channel, and control variates. Empty if there are none.
    pub fn exact_sums(&self) -> Vec<FixedSum> {
        match self.controls.sums.is_empty() {
            true => self.controls.packed.unpacked(),
            false => self.controls.sums.clone(),
        }
    }

    /// Adds sums of values and control variates to a pixel. Returns false if their numbers differ.
    pub fn merge_sums(&mut self, fit: u32, sums: &[FixedSum]) -> bool {
        let row = self.controls.row(fit as usize);
        let own = self.controls.unpack().get_mut(row).filter(|own| own.len() == sums.len());
        own.map(|own| own.iter_mut().zip(sums).for_each(|(a, b)| a.merge(b))).is_some()
    }

    /// Packs the sums until samples are added again; `scratch` is a shared buffer.
    pub fn pack(&mut self, scratch: &mut Vec<u8>) {
        let PixelControls { packed, sums, batch, .. } = &mut self.controls;
        if !sums.is_empty() {
            packed.set(sums, scratch);
        }
        (*sums, *batch) = (Vec::new(), Vec::new());
    }

    /// The state for later estimates: sums and coefficients of all fits.
    pub fn memory(&self) -> [&[f32]; 2] {
        [&self.sums, &self.beta]
    }

    /// Restores the state of [`Self::memory`]. Returns false if its size does not fit.
    pub fn restore(&mut self, [sums, beta]: [Vec<f32>; 2]) -> bool {
        let fits = sums.len() == self.sums.len() && beta.len() == self.beta.len();
        if fits {
            (self.sums, self.beta) = (sums, beta);
        }
        fits
    }

    /// Begins a block. Returns the number of ill-conditioned systems. Without a solution, the MIS estimate is used.
    pub fn solve(&mut self) -> u64 {
        (self.solver)(self.equations, &self.sums, &mut self.beta)
    }

    /// The coefficients of a fit; `None` if there are no fits.
    pub(super) fn beta(&self, fit: u32) -> Option<&[f32]> {
        let len = self.equations.coefficients();
        (!self.sums.is_empty()).then(|| &self.beta[fit as usize * len..][..len])
    }

    /// Adds the sums of an estimate to its fit, if there are fits.
    pub(super) fn add(&mut self, fit: u32, sums: &[f32]) {
        if !self.sums.is_empty() {
            let len = self.equations.len();
            self.equations.merge(&mut self.sums[fit as usize * len..][..len], sums);
        }
    }
}
