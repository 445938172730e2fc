//! Integrals on 0..1 sampled by a deterministic mixture of several densities, and blocks of passes over them.

use lumiris_numbers::estimators::ocv::{Form, MAX_COMPONENTS, NormalEquations, block_of};
use lumiris_test_support::random::{Pcg32, RngExt};

/// A density on 0..1.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Density {
    /// Uniform between two ends.
    Uniform(f64, f64),
    /// 4x up to ½, then 4(1 − x): a lobe.
    Tent,
    /// 1/(w(1 + ((x − c)/w)²)) for x in 0..1, normalised: centre, width, and the angles atan((0 − c)/w), atan((1 −
    /// c)/w).
    Peak(f64, f64, [f64; 2]),
}

impl Density {
    fn peak(centre: f64, width: f64) -> Density {
        Density::Peak(centre, width, [(-centre / width).atan(), ((1.0 - centre) / width).atan()])
    }

    pub(crate) fn sample(self, u: f64) -> f64 {
        match self {
            Density::Uniform(a, b) => a + (b - a) * u,
            Density::Tent if u < 0.5 => (0.5 * u).sqrt(),
            Density::Tent => 1.0 - (0.5 * (1.0 - u)).sqrt(),
            Density::Peak(c, w, [a, b]) => (c + w * (a + (b - a) * u).tan()).clamp(0.0, 1.0),
        }
    }

    pub(crate) fn pdf(self, x: f64) -> f64 {
        match self {
            Density::Uniform(a, b) => inside(x, a, b) / (b - a),
            Density::Tent => 4.0 * x.min(1.0 - x),
            Density::Peak(c, w, [a, b]) => lorentz(x, c, w) / (w * (b - a)),
        }
    }
}

fn inside(x: f64, a: f64, b: f64) -> f64 {
    f64::from(u8::from((a..b).contains(&x)))
}

fn lorentz(x: f64, c: f64, w: f64) -> f64 {
    1.0 / (1.0 + ((x - c) / w) * ((x - c) / w))
}

/// An integral and the mixture that samples it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Mixture {
    /// A lobe and two lights; an occluder hides the end of one and most of the other.
    Table,
    /// The same; the occluder hides one of them and a little more.
    Occluded,
    /// A steep lobe and a wide light, of which it reflects only a part.
    Peak,
    /// f is the mixture itself, up to a ripple that no component resembles: control variates cannot reduce the
    /// variance.
    Optimal,
    /// Diffuse and glossy lobes and two lights of different colours, partly hidden.
    Colour,
    /// A lobe and seven lights of different power, some of them hidden.
    Many,
    /// A light visible through a narrow slit: most estimates are 0.
    Slit,
    /// A lobe and one light.
    OneLight,
    /// A lobe, and no light.
    NoLight,
    /// [`Mixture::Table`] with both lights twice.
    Duplicates,
    /// [`Mixture::Table`] and a component outside of the support of f.
    Useless,
    /// f = 0.
    Zero,
}

/// Integrals for which the variance bounds hold.
pub(crate) const PROPER: [Mixture; 7] =
    [Mixture::Table, Mixture::Occluded, Mixture::Peak, Mixture::Optimal, Mixture::Colour, Mixture::Many, Mixture::Slit];

/// Degenerate mixtures, with missing or superfluous components.
pub(crate) const DEGENERATE: [Mixture; 5] =
    [Mixture::OneLight, Mixture::NoLight, Mixture::Duplicates, Mixture::Useless, Mixture::Zero];

const MANY: [(f64, f64, f64); 7] = [
    (0.05, 0.12, 3.0),
    (0.12, 0.19, 0.2),
    (0.2, 0.31, 1.0),
    (0.33, 0.41, 5.0),
    (0.41, 0.54, 0.4),
    (0.55, 0.66, 2.0),
    (0.68, 0.83, 1.0),
];

impl Mixture {
    /// Components and their weights.
    fn components(self) -> Vec<(Density, f32)> {
        let lights = [(0.2, 0.5), (0.6, 0.9)].map(|(a, b)| Density::Uniform(a, b));
        let three =
            |weights: [f32; 3]| vec![(Density::Tent, weights[0]), (lights[0], weights[1]), (lights[1], weights[2])];
        match self {
            Mixture::Table | Mixture::Occluded | Mixture::Zero => three([0.5, 0.25, 0.25]),
            Mixture::Optimal => three([1.0 / 3.0; 3]),
            Mixture::Peak => vec![(Density::peak(0.4, 0.02), 0.5), (Density::Uniform(0.2, 0.7), 0.5)],
            Mixture::Colour => {
                let glossy = Density::peak(0.7, 0.03);
                vec![(Density::Tent, 0.25), (glossy, 0.25), (lights[0], 0.25), (lights[1], 0.25)]
            }
            Mixture::Many => {
                let light = |&(a, b, _): &(f64, f64, f64)| (Density::Uniform(a, b), 0.5 / 7.0);
                std::iter::once((Density::Tent, 0.5)).chain(MANY.iter().map(light)).collect()
            }
            Mixture::Slit | Mixture::OneLight => vec![(Density::Tent, 0.5), (lights[0], 0.5)],
            Mixture::NoLight => vec![(Density::Tent, 1.0)],
            Mixture::Duplicates => {
                let mut twice = three([0.5, 0.125, 0.125]);
                twice.extend_from_within(1..);
                twice
            }
            Mixture::Useless => {
                let mut four = three([0.4, 0.2, 0.2]);
                four.push((Density::Uniform(0.0, 0.1), 0.2));
                four
            }
        }
    }

    /// f by channel.
    pub(crate) fn f(self, x: f64) -> [f64; 3] {
        let bsdf = 4.0 * x * (1.0 - x);
        let (a, b) = (inside(x, 0.2, 0.5), inside(x, 0.6, 0.9));
        let visible = |from, to| 1.0 - inside(x, from, to);
        match self {
            Mixture::Table | Mixture::Duplicates | Mixture::Useless => [2.0 * bsdf * (a + b) * visible(0.4, 0.78); 3],
            Mixture::Occluded => [2.0 * bsdf * (a + b) * visible(0.55, 0.9); 3],
            Mixture::Peak => [inside(x, 0.2, 0.7) * (20.0 * lorentz(x, 0.41, 0.022) + 0.5); 3],
            Mixture::Optimal => {
                let mixture = (4.0 * x.min(1.0 - x) + (a + b) / 0.3) / 3.0;
                [mixture * (1.0 + 0.5 * (150.0 * x).sin()); 3]
            }
            Mixture::Colour => {
                let gloss = 8.0 * lorentz(x, 0.71, 0.03);
                let seen = visible(0.25, 0.35);
                let [red, green, blue] = [4.0 * a + 0.1 * b, a + b, 0.2 * a + 5.0 * b].map(|l| l * seen);
                [red * (0.3 * bsdf + 0.2 * gloss), green * (bsdf + 0.1 * gloss), blue * (0.5 * bsdf + 0.2 * gloss)]
            }
            Mixture::Many => {
                let li = MANY.iter().map(|&(a, b, l)| l * inside(x, a, b)).sum::<f64>();
                [bsdf * li * visible(0.3, 0.45); 3]
            }
            Mixture::Slit => [30.0 * bsdf * inside(x, 0.3, 0.31); 3],
            Mixture::OneLight => [2.0 * bsdf * a * visible(0.4, 0.78); 3],
            Mixture::NoLight => [bsdf, bsdf * x, 1.0 - x],
            Mixture::Zero => [0.0; 3],
        }
    }

    /// A channel of f without the occluder, for integrals whose lights have the same power.
    pub(crate) fn unshadowed(self, x: f64) -> f64 {
        8.0 * x * (1.0 - x) * (inside(x, 0.2, 0.5) + inside(x, 0.6, 0.9))
    }

    /// ∫f by the midpoint rule, with points symmetric about every discontinuity of f.
    pub(crate) fn value(self) -> [f64; 3] {
        const POINTS: u32 = 1_000_000;
        let mut sum = [0.0; 3];
        for k in 0..POINTS {
            let f = self.f((f64::from(k) + 0.5) / f64::from(POINTS));
            (0..3).for_each(|i| sum[i] += f[i]);
        }
        sum.map(|s| s / f64::from(POINTS))
    }
}

/// Numbers of samples n_j of a deterministic mixture with the weights `alpha`: Σ n_j = `n`, and each is the integer
/// nearest to n α_j, but at least 1 where α_j > 0. If `n` is too small for that, the components with the largest α_j
/// have one each.
///
/// The mixture has the weights n_j/n, which equal α_j only if all n α_j are integers. Densities must be weighted by the
/// returned numbers, or the estimate is biased. Ties are settled in favour of the earlier component.
fn allot(alpha: &[f32], n: u32, counts: &mut [u32]) {
    let counts = &mut counts[..alpha.len()];
    counts.fill(0);
    let total: f64 = alpha.iter().filter(|a| **a > 0.0).map(|a| f64::from(*a)).sum();
    for _ in 0..n {
        // Components without samples come first, by weight; then the one farthest below its fraction.
        let claim = |j: usize, count: u32| match (alpha[j] > 0.0, count) {
            (false, _) => f64::NEG_INFINITY,
            (true, 0) => f64::from(n) + f64::from(alpha[j]) / total,
            (true, count) => f64::from(n) * f64::from(alpha[j]) / total - f64::from(count),
        };
        let best = (0..alpha.len()).reduce(|b, j| if claim(j, counts[j]) > claim(b, counts[b]) { j } else { b });
        match best {
            Some(best) if alpha[best] > 0.0 => counts[best] += 1,
            _ => return,
        }
    }
}

#[test]
fn counts_of_a_mixture_are_its_shares_and_nobody_with_a_share_has_none() {
    let counts = |alpha: &[f32], n| {
        let mut counts = vec![9; alpha.len()];
        allot(alpha, n, &mut counts);
        counts
    };
    assert_eq!(counts(&[0.5, 0.25, 0.25], 8), [4, 2, 2]);
    assert_eq!(counts(&[0.5, 0.25, 0.25], 64), [32, 16, 16]);
    assert_eq!(counts(&[0.5, 0.25, 0.25], 3), [1, 1, 1]);
    assert_eq!(counts(&[0.25, 0.5, 0.25], 2), [1, 1, 0]);
    assert_eq!(counts(&[0.9, 0.05, 0.05], 10), [8, 1, 1]);
    assert_eq!(counts(&[1.0, 0.0], 5), [5, 0]);
    assert_eq!(counts(&[0.3, 0.2, 0.25, 0.25], 64), [19, 13, 16, 16]);
    assert_eq!((counts(&[0.0], 4), counts(&[], 4)), (vec![0], vec![]));
}

/// Sampler of a mixture, with the number n_j per pass of each component.
pub(crate) struct Sampler {
    pub mixture: Mixture,
    pub densities: Vec<Density>,
    pub counts: Vec<u32>,
    /// Stratified samples: each component over its whole domain, with one stratum per sample in a block.
    pub is_stratified: bool,
    /// Factor of f.
    pub scale: f64,
    /// Offset of the occluder of [`Mixture::Table`].
    pub shift: f64,
    pub equations: NormalEquations,
    /// I_j of each component: 1, or 0 for a component without samples, which has no column.
    pub integrals: Vec<f32>,
    pub n: u32,
}

/// A sample: position, component, all densities, and p_α.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Point {
    pub x: f64,
    pub component: usize,
    pub pdfs: [f64; MAX_COMPONENTS],
    pub mixture_pdf: f64,
}

/// Values of a sample: y by channel, and the columns.
const VALUES: usize = 3 + MAX_COMPONENTS;

/// A covariance for each pair of values.
pub(crate) type Covariances = [[f64; VALUES]; VALUES];

impl Sampler {
    pub(crate) fn new(mixture: Mixture, n: u32, is_stratified: bool) -> Sampler {
        let (densities, alpha): (Vec<Density>, Vec<f32>) = mixture.components().into_iter().unzip();
        let mut counts = vec![0; alpha.len()];
        allot(&alpha, n, &mut counts);
        let equations = NormalEquations::new(alpha.len());
        let integrals = counts.iter().map(|&n| f32::from(u8::from(n > 0))).collect();
        Sampler { mixture, densities, counts, is_stratified, scale: 1.0, shift: 0.0, equations, integrals, n }
    }

    /// All samples of a block of `passes`.
    pub(crate) fn points(&self, passes: u32, stream: &mut Pcg32, mut each: impl FnMut(&Point)) {
        for (component, count) in self.counts.iter().enumerate() {
            let strata = count * passes;
            for k in 0..strata {
                let u = f64::from(stream.random::<f32>());
                let u = if self.is_stratified { (f64::from(k) + u) / f64::from(strata) } else { u };
                each(&self.point(component, u));
            }
        }
    }

    /// The sample of a component at the number `u`.
    fn point(&self, component: usize, u: f64) -> Point {
        let x = self.densities[component].sample(u);
        let mut point = Point { x, component, pdfs: [0.0; 8], mixture_pdf: 0.0 };
        for (j, d) in self.densities.iter().enumerate() {
            point.pdfs[j] = d.pdf(x);
            point.mixture_pdf += f64::from(self.counts[j]) / f64::from(self.n) * point.pdfs[j];
        }
        point
    }

    /// r_j = p_j/p_α. A component without samples has no column.
    fn columns(&self, point: &Point) -> [f32; MAX_COMPONENTS] {
        let mut columns = [0.0; MAX_COMPONENTS];
        for j in (0..self.counts.len()).filter(|&j| self.counts[j] > 0) {
            columns[j] = (point.pdfs[j] / point.mixture_pdf) as f32;
        }
        columns
    }

    /// Covariances of the means over a block of `passes` of y, by channel, followed by the columns; by quadrature over
    /// each stratum.
    pub(crate) fn covariances(&self, passes: u32) -> Covariances {
        const POINTS: u32 = 1 << 15;
        let mut covariances = Covariances::default();
        let samples = f64::from(self.counts.iter().sum::<u32>() * passes);
        for (component, count) in self.counts.iter().enumerate() {
            let [strata, each] = if self.is_stratified { [count * passes, 1] } else { [1, count * passes] };
            let points = (POINTS / strata.max(1)).max(256);
            for stratum in 0..strata {
                let (mut sum, mut products) = ([0.0; VALUES], Covariances::default());
                for k in 0..points {
                    let u = f64::from(stratum) + (f64::from(k) + 0.5) / f64::from(points);
                    let point = self.point(component, u / f64::from(strata));
                    let (y, columns) = (self.y(&point), self.columns(&point));
                    let value = |i: usize| f64::from(if i < 3 { y[i] } else { columns[i - 3] });
                    for i in 0..3 + self.densities.len() {
                        sum[i] += value(i);
                        (0..=i).for_each(|j| products[i][j] += value(i) * value(j));
                    }
                }
                let (points, each) = (f64::from(points), f64::from(each));
                for i in 0..VALUES {
                    for j in 0..=i {
                        let covariance = products[i][j] / points - sum[i] * sum[j] / (points * points);
                        covariances[i][j] += covariance * each / (samples * samples);
                        covariances[j][i] = covariances[i][j];
                    }
                }
            }
        }
        covariances
    }

    /// y = f/p_α.
    pub(crate) fn y(&self, point: &Point) -> [f32; 3] {
        let scale = self.scale / point.mixture_pdf;
        if self.shift != 0.0 {
            let seen = 1.0 - inside(point.x, 0.4 + self.shift, 0.78 + self.shift);
            return [(self.mixture.unshadowed(point.x) * seen * scale) as f32; 3];
        }
        self.mixture.f(point.x).map(|f| (f * scale) as f32)
    }

    /// Adds a block of `passes` to `sums`, whose columns are r_j.
    pub(crate) fn add(&self, passes: u32, stream: &mut Pcg32, sums: &mut [f32]) {
        self.points(passes, stream, |point| {
            let (columns, mut there, mut count) = (self.columns(point), [(0, 0.0); MAX_COMPONENTS], 0);
            for (j, c) in columns.into_iter().enumerate().filter(|(_, c)| *c > 0.0) {
                there[count] = (j, c);
                count += 1;
            }
            self.equations.add_sparse(sums, &there[..count], self.y(point));
        });
    }

    /// The sums of a new block, in the columns of a form.
    pub(crate) fn block(&self, form: Form, passes: u32, stream: &mut Pcg32, sums: &mut [f32]) {
        sums.fill(0.0);
        self.add(passes, stream, sums);
        form.finish(self.equations, sums, &self.integrals);
    }

    /// Lengths of the blocks of the first `passes` passes.
    pub(crate) fn blocks(passes: u32) -> impl Iterator<Item = u32> {
        (0..passes).map(block_of).enumerate().filter(|(pass, b)| *pass == b.first as usize).map(|(_, b)| b.len)
    }
}
