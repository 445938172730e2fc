//! β of each pixel of a picture from the estimates of the pixels around it.
//!
//! A pixel p has the estimate ȳ_p and the means c̄_p of its control variates over all of its samples. Its coefficients
//! are those of the regression of y on c over other pixels q, each of which counts as one sample: so they are fitted to
//! the variance of whole estimates, whatever strata have left of it. They do not depend on the samples of p; if pixels
//! are independent, ȳ_p − Σ β_j c̄_pj is unbiased.
//!
//! * The picture itself varies from pixel to pixel. From ȳ_q the mean of its neighbours is subtracted. What is left is
//!   clamped to the light of the darkest of them: single bright samples would make coefficients for all around.
//! * Pixels that are unlike p tell nothing of it: those of other classes, of other normals, and those whose darkest
//!   neighbour is more than [`MAX_RATIO`] times as bright or as dark as that of p.
//! * β is held back by the ridge and the factor of [`System::OTHER_SAMPLES`], in units in which the controls of the
//!   pixels have together a mean square of one: columns that hardly vary are left out.
//!
//! * Nor is β more than [`MAX_BETA`] times the light around p: controls are parts of one, so that no more than that can follow from
//!   them, but where those of other pixels hardly vary, noise would be taken for much more.
//!
//! p itself is no part of any of this: not of the means of its neighbours, nor of what is bright or like it.

use super::normal::NormalEquations;
use super::solve::System;
use crate::math::luminance;

/// Radius of the square of pixels that β is fitted to.
const RADIUS: usize = 6;
/// Rows above and below a row that its coefficients depend on: those pixels, and their neighbours.
pub const MARGIN: usize = RADIUS + 1;
/// Minimum number of neighbours whose mean stands for the picture.
const MIN_AROUND: f64 = 3.0;
/// Maximum ratio of the light around two pixels that are alike.
const MAX_RATIO: f64 = 2.0;
/// Most of β, relative to the luminance of the light around a pixel: blue light has a fourteenth of its radiance.
const MAX_BETA: f64 = 16.0;
/// Minimum squared length of the mean normal of a pixel that is one surface, and minimum part of it that is the product
/// with that of a pixel which is alike.
const MIN_FLATNESS: f32 = 0.95;
const MIN_PRODUCT: f32 = 0.9;

/// A pixel.
#[derive(Clone, Copy, Debug, Default)]
pub struct Pixel {
    /// ȳ, by channel.
    pub mean: [f32; 3],
    /// Which pixels it can be compared to; `None`: it is like no other. It must not depend on y or c.
    pub class: Option<u32>,
    /// Mean normal; it must not depend on y or c either.
    pub normal: [f32; 3],
}

/// What is known of a pixel from those of its eight neighbours that are like it.
#[derive(Clone, Copy, Debug)]
struct Around {
    count: f64,
    /// Σ ȳ.
    means: [f64; 3],
    /// The least light of them, and the least but one, with the pixels.
    darkest: [(f64, usize); 2],
}

impl Around {
    const NOTHING: Around = Around { count: 0.0, means: [0.0; 3], darkest: [(f64::INFINITY, usize::MAX); 2] };

    fn add(&mut self, q: usize, pixel: &Pixel) {
        let mean = pixel.mean.map(f64::from);
        self.count += 1.0;
        self.means.iter_mut().zip(mean).for_each(|(sum, v)| *sum += v);
        let own = (luminance(mean), q);
        if own.0 < self.darkest[0].0 {
            self.darkest = [own, self.darkest[0]];
        } else if own.0 < self.darkest[1].0 {
            self.darkest[1] = own;
        }
    }

    /// The light that the pixel is taken to have; `None` if too few pixels tell.
    fn light(&self) -> Option<f64> {
        (self.count >= MIN_AROUND && self.darkest[0].0 > 0.0).then_some(self.darkest[0].0)
    }
}

/// Memory of [`Picture::coefficients`].
#[derive(Debug, Default)]
pub struct Memory {
    terms: Vec<f32>,
    sums: Vec<f32>,
    scales: Vec<f32>,
}

/// The estimates of the pixels of a picture.
#[derive(Clone, Debug)]
pub struct Picture {
    width: usize,
    equations: NormalEquations,
    pixels: Vec<Pixel>,
    /// c̄ of each pixel, by component.
    controls: Vec<f32>,
    around: Vec<Around>,
}

impl Picture {
    /// Pixels row by row with their controls, `components` of each.
    pub fn new(width: usize, components: usize, mut pixels: Vec<Pixel>, controls: Vec<f32>) -> Self {
        assert_eq!(controls.len(), pixels.len() * components, "as many controls as pixels");
        for (pixel, controls) in pixels.iter_mut().zip(controls.chunks(components.max(1))) {
            let is_finite = pixel.mean.iter().chain(&pixel.normal).chain(controls).all(|v| v.is_finite());
            let flatness: f32 = pixel.normal.iter().map(|v| v * v).sum();
            pixel.class = pixel.class.filter(|_| is_finite && flatness > MIN_FLATNESS);
        }
        let equations = NormalEquations::new(components);
        let mut picture = Picture { width: width.max(1), equations, pixels, controls, around: Vec::new() };
        picture.around = (0..picture.pixels.len()).map(|i| picture.look_around(i, i)).collect();
        picture
    }

    /// Number of pixels of a row.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Number of rows of pixels.
    pub fn height(&self) -> usize {
        self.pixels.len() / self.width
    }

    /// What is known of pixel `i` from its neighbours but `without`.
    fn look_around(&self, i: usize, without: usize) -> Around {
        let mut around = Around::NOTHING;
        self.each_within(1, i, |q, _| {
            if q != without && self.are_alike(q, i) {
                around.add(q, &self.pixels[q]);
            }
        });
        around
    }

    /// Pixels of the square around pixel `i`, without it, and whether they are next to it.
    #[inline]
    fn each_within(&self, radius: usize, i: usize, mut f: impl FnMut(usize, bool)) {
        let (x, y) = (i % self.width, i / self.width);
        for row in y.saturating_sub(radius)..(y + radius + 1).min(self.height()) {
            for column in x.saturating_sub(radius)..(x + radius + 1).min(self.width) {
                if (column, row) != (x, y) {
                    f(row * self.width + column, column.abs_diff(x) <= 1 && row.abs_diff(y) <= 1);
                }
            }
        }
    }

    /// True if both show the same kind of surface.
    fn are_alike(&self, q: usize, p: usize) -> bool {
        let (q, p) = (&self.pixels[q], &self.pixels[p]);
        let product: f32 = q.normal.iter().zip(&p.normal).map(|(a, b)| a * b).sum();
        q.class.is_some() && q.class == p.class && product > MIN_PRODUCT
    }

    /// β of the pixels of row `row`, by pixel, component and channel; 0 where nothing is known.
    pub fn coefficients(&self, row: usize, memory: &mut Memory, beta: &mut Vec<f32>) {
        let (len, width) = (self.equations.len(), self.equations.coefficients());
        let Memory { terms, sums, scales } = memory;
        let rows = row.saturating_sub(RADIUS)..(row + RADIUS + 1).min(self.height());
        terms.clear();
        terms.resize(rows.len() * self.width * len, 0.0);
        let first = rows.start * self.width;
        for (i, terms) in terms.chunks_mut(len).enumerate() {
            self.add_pixel(first + i, &self.around[first + i], terms);
        }
        sums.clear();
        sums.resize(self.width * len, 0.0);
        beta.clear();
        beta.resize(self.width * width, 0.0);
        scales.clear();
        for (column, sums) in sums.chunks_mut(len).enumerate() {
            scales.push(self.sum_around(row * self.width + column, (first, terms), sums));
        }
        self.equations.solve(System::OTHER_SAMPLES, sums, beta);
        let around = &self.around[row * self.width..];
        for ((beta, scale), around) in beta.chunks_mut(width.max(1)).zip(scales).zip(around) {
            let most = (MAX_BETA * around.light().unwrap_or(0.0)) as f32;
            beta.iter_mut().for_each(|b| *b = (*b * *scale).clamp(-most, most));
        }
    }

    /// Adds pixel `q`, whose neighbours are `around`, as a sample.
    fn add_pixel(&self, q: usize, around: &Around, sums: &mut [f32]) {
        let m = self.equations.components();
        let mut columns = [(0, 0.0); super::MAX_COMPONENTS];
        for (j, (column, c)) in columns.iter_mut().zip(&self.controls[q * m..][..m]).enumerate() {
            *column = (j, *c);
        }
        let mean = &self.pixels[q].mean;
        let most = around.light().unwrap_or(0.0);
        let y =
            [0, 1, 2].map(|c| (f64::from(mean[c]) - around.means[c] / around.count.max(1.0)).clamp(-most, most) as f32);
        self.equations.add_sparse(sums, &columns[..m], y);
    }

    /// Sums the pixels around `p` that are like it, of which those not next to it have `terms`, from the pixel `first`
    /// on. Controls are in units of their root mean square, whose inverse is returned; 0 if there are none.
    fn sum_around(&self, p: usize, (first, terms): (usize, &[f32]), sums: &mut [f32]) -> f32 {
        let Some(light) = self.around[p].light() else { return 0.0 };
        let len = self.equations.len();
        let is_as_lit = |l: f64| l <= MAX_RATIO * light && light <= MAX_RATIO * l;
        self.each_within(RADIUS, p, |q, is_next| {
            if !self.are_alike(q, p) {
                return;
            }
            if is_next {
                let around = self.look_around(q, p);
                if around.light().is_some_and(is_as_lit) {
                    self.add_pixel(q, &around, sums);
                }
            } else if self.around[q].light().is_some_and(is_as_lit) {
                self.equations.merge(sums, &terms[(q - first) * len..][..len]);
            }
        });
        let squares: f64 = (0..self.equations.components()).map(|j| self.equations.sum_of_products(sums, j, j)).sum();
        let unit = (squares / f64::from(self.equations.samples(sums)).max(1.0)).sqrt() as f32;
        if !(unit > 0.0 && unit.is_finite()) {
            sums.fill(0.0);
            return 0.0;
        }
        self.equations.scale(sums, &[1.0 / unit; super::MAX_COMPONENTS]);
        1.0 / unit
    }

    /// Σ β_j c̄_j of pixel `i`, which is to be subtracted from ȳ, by channel; `beta` is that of the pixel.
    pub fn correction(&self, i: usize, beta: &[f32]) -> [f32; 3] {
        let m = self.equations.components();
        correction(&self.controls[i * m..][..m], beta)
    }
}

/// Σ β_j c̄_j by channel; 0 if it is not finite.
pub fn correction(controls: &[f32], beta: &[f32]) -> [f32; 3] {
    let sum = |c: usize| controls.iter().zip(beta.chunks(3)).map(|(control, beta)| control * beta[c]).sum::<f32>();
    [0, 1, 2].map(|c| Some(sum(c)).filter(|s| s.is_finite()).unwrap_or(0.0))
}
