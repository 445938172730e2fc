//! Factors of the variance of independent samples, by sets of similar replicas: see [`super::variance`].

/// Sets with less than twice this number of replicas are not split. The relative standard error of f is then about
/// √(2/16) = 35 %, if means are normally distributed.
const MIN_MEMBERS: usize = 16;
/// The extent of a set excludes 1/[`BEYOND`] of the replicas at either end, to be robust against outliers.
const BEYOND: usize = 10;

/// Level and scaled position of a pixel.
pub(super) type Position = [f64; 3];

/// The variances estimated at a replica.
#[derive(Clone, Copy)]
pub(super) struct ReplicaVariance {
    pub(super) position: Position,
    /// (s_A² + s_B²)/2N.
    pub(super) independent: f64,
    /// (A − B)²/2.
    pub(super) measured: f64,
}

/// The factor f of the variance of independent samples: of a set of replicas, or of its two parts.
#[derive(Clone, Debug)]
pub(super) enum VarianceScale {
    One(f64),
    Two { split: Split, parts: Box<[VarianceScale; 2]> },
}

/// A split of a set: positions whose coordinate is below `at` belong to the first part.
#[derive(Clone, Copy, Debug)]
pub(super) struct Split {
    dimension: usize,
    at: f64,
}

impl Split {
    fn is_first(&self, position: &Position) -> bool {
        position[self.dimension] < self.at
    }
}

impl VarianceScale {
    pub(super) fn of(replicas: Vec<ReplicaVariance>) -> Self {
        if let Some(split) = middle(&replicas) {
            let (below, above): (Vec<_>, Vec<_>) = replicas.iter().copied().partition(|r| split.is_first(&r.position));
            if below.len().min(above.len()) >= MIN_MEMBERS / 2 {
                let parts = Box::new([below, above].map(VarianceScale::of));
                return VarianceScale::Two { split, parts };
            }
        }
        let sum = |value: fn(&ReplicaVariance) -> f64| replicas.iter().map(value).sum::<f64>();
        let independent = sum(|r| r.independent);
        VarianceScale::One(if independent > 0.0 { sum(|r| r.measured) / independent } else { 1.0 })
    }

    pub(super) fn factor(&self, position: &Position) -> f64 {
        match self {
            VarianceScale::One(factor) => *factor,
            VarianceScale::Two { split, parts } => parts[usize::from(!split.is_first(position))].factor(position),
        }
    }
}

/// The split in the middle of the longest dimension of a set of replicas; `None` if the set is not to be split.
fn middle(replicas: &[ReplicaVariance]) -> Option<Split> {
    if replicas.len() < 2 * MIN_MEMBERS {
        return None;
    }
    let extent = |dimension: usize| {
        let mut values: Vec<f64> = replicas.iter().map(|r| r.position[dimension]).collect();
        let last = values.len() - 1;
        [last / BEYOND, last - last / BEYOND].map(|k| *values.select_nth_unstable_by(k, f64::total_cmp).1)
    };
    let extents = [0, 1, 2].map(extent);
    let length = |dimension: &usize| extents[*dimension][1] - extents[*dimension][0];
    let dimension = (0..3).max_by(|a, b| length(a).total_cmp(&length(b))).filter(|d| length(d) > 0.0)?;
    Some(Split { dimension, at: 0.5 * (extents[dimension][0] + extents[dimension][1]) })
}
