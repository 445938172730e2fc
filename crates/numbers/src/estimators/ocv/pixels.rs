//! β of each pixel of an image from the surrounding pixels.
//!
//! A pixel p has the estimate ȳ_p and the means c̄_p of its control variates over all of its samples. Its coefficients
//! are the regression of y on c over other pixels q, each of which counts as one sample. They are therefore fitted to
//! the variance of whole estimates, including the effect of stratification. They do not depend on the samples of p; if
//! pixels are independent, ȳ_p − Σ β_j c̄_pj is unbiased.
//!
//! * The image itself varies from pixel to pixel. The mean of its neighbours is subtracted from ȳ_q. The rest is
//!   clamped to the radiance of the darkest neighbour, since single bright samples would dominate the coefficients of
//!   all pixels around.
//! * Pixels unlike p are excluded: pixels of other classes or normals, and pixels whose darkest neighbour is more than
//!   [`MAX_RATIO`] times as bright or as dark as the darkest neighbour of p.
//! * β is regularised by the ridge and the factor of [`System::OTHER_SAMPLES`], in units in which the controls of the
//!   pixels have together a mean square of one. Nearly constant columns are omitted.
//!
//! * β is at most [`MAX_BETA`] times the radiance around p. Controls are fractions of one, so larger coefficients are
//!   only noise of nearly constant controls.
//!
//! p itself is excluded from all of this: from the means of its neighbours, and from their brightness and similarity.

use super::normal::NormalEquations;
use super::solve::System;
use crate::math::luminance;

/// Radius of the square of pixels that β of a pixel is fitted to.
const RADIUS: usize = 6;
/// Number of rows above and below a row that its coefficients depend on: the square of pixels, and their neighbours.
pub const MARGIN: usize = RADIUS + 1;
/// Minimum number of neighbours for a mean.
const MIN_AROUND: f64 = 3.0;
/// Maximum ratio of the radiance around two similar pixels.
const MAX_RATIO: f64 = 2.0;
/// Maximum of β, relative to the luminance around a pixel: blue light has a luminance of a fourteenth of its radiance.
const MAX_BETA: f64 = 16.0;
/// Minimum squared length of the mean normal of a pixel with a single surface, and minimum ratio of its dot product
/// with the normal of a similar pixel to that length.
const MIN_FLATNESS: f32 = 0.95;
const MIN_PRODUCT: f32 = 0.9;

/// A pixel.
#[derive(Clone, Copy, Debug, Default)]
pub struct Pixel {
    /// ȳ, by channel.
    pub mean: [f32; 3],
    /// Pixels are only compared within a class; `None` excludes the pixel. It must not depend on y or c.
    pub class: Option<u32>,
    /// Mean normal; it must not depend on y or c.
    pub normal: [f32; 3],
}

/// Sums over the similar pixels among the eight neighbours of a pixel.
#[derive(Clone, Copy, Debug)]
struct Around {
    count: f64,
    /// Σ ȳ.
    means: [f64; 3],
    /// The smallest and the second smallest radiance among them, with the pixels.
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

    /// The radiance around the pixel; `None` if there are too few neighbours.
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

/// The estimates of the pixels of an image.
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
    /// Pixels row by row, with `components` controls each.
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

    /// Sums over the neighbours of pixel `i`, excluding `without`.
    fn look_around(&self, i: usize, without: usize) -> Around {
        let mut around = Around::NOTHING;
        self.each_within(1, i, |q, _| {
            if q != without && self.are_alike(q, i) {
                around.add(q, &self.pixels[q]);
            }
        });
        around
    }

    /// Pixels of the square around pixel `i`, without it, with a flag for direct neighbours.
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

    /// True if both pixels show the same kind of surface.
    fn are_alike(&self, q: usize, p: usize) -> bool {
        let (q, p) = (&self.pixels[q], &self.pixels[p]);
        let product: f32 = q.normal.iter().zip(&p.normal).map(|(a, b)| a * b).sum();
        q.class.is_some() && q.class == p.class && product > MIN_PRODUCT
    }

    /// β of the pixels of row `row`, by pixel, component and channel; 0 without data.
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
            scales.push(self.sum_around(row * self.width + column, first, terms, sums));
        }
        self.equations.solve(System::OTHER_SAMPLES, sums, beta);
        let around = &self.around[row * self.width..];
        for ((beta, scale), around) in beta.chunks_mut(width.max(1)).zip(scales).zip(around) {
            let most = (MAX_BETA * around.light().unwrap_or(0.0)) as f32;
            beta.iter_mut().for_each(|b| *b = (*b * *scale).clamp(-most, most));
        }
    }

    /// Adds pixel `q`, with the neighbourhood `around`, as a sample.
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

    /// Sums over the pixels around `p` that are similar to it. `terms` are the precomputed terms of pixels that are not
    /// direct neighbours, starting at pixel `first`. Controls are scaled by the inverse of their root mean square,
    /// which is returned; 0 without pixels.
    fn sum_around(&self, p: usize, first: usize, terms: &[f32], sums: &mut [f32]) -> f32 {
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

    /// Σ β_j c̄_j of pixel `i`, to be subtracted from ȳ, by channel; `beta` are the coefficients of the pixel.
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
