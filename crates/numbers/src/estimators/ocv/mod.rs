//! Optimizing control variates (OCV) as numbers: fit a mixture of the sampling densities to the integrand and integrate
//! only what is left [Fan et al. 2006].
//!
//! N samples x_i come from a deterministic mixture of m components: n_j = Nα_j of density p_j, together of density
//! p_α = Σ α_j p_j. With y_i = f(x_i)/p_α(x_i) and the columns c_ij = p_j(x_i)/p_α(x_i) − 1, whose expectation is 0
//! exactly, equation (7) is
//!
//! Î = ȳ − Σ_j β_j c̄_j.
//!
//! β = 0 is multiple importance sampling with the balance heuristic. Any β that is independent of the samples leaves the
//! estimate unbiased; the best one is that of the regression of y on the columns. There are four ways to come by it
//! ([`Form`]), which differ in bias. Since Σ α_j c_j = 0, one column depends on the others.
//!
//! The densities of the columns are normalised, so that a ridge means the same for all: a component whose integral I_j over
//! the domain is not 1 has the column p_j/(I_j p_α) − 1, and 0 where I_j = 0.
//!
//! In reading order:
//!
//! | module | what |
//! |---|---|
//! | [`normal`] | the sums Σ c_j c_k, Σ c_j y, … of the regression, and β from them |
//! | [`ldlt`] | small symmetric systems, with pivots |
//! | [`forms`] | the forms that fit β to samples of the same estimate |
//! | [`block`] | the blocks of passes of the progressive form |

pub mod block;
pub mod forms;
pub mod ldlt;
pub mod normal;

pub use block::{Block, block_of};
pub use forms::{Outcome, crossfit, paper, regression};
pub use ldlt::{IllConditioned, MAX_COMPONENTS};
pub use normal::{NormalEquations, Penalty};
use strum::{EnumString, IntoStaticStr, VariantNames};

/// How β is found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, EnumString, IntoStaticStr, VariantNames)]
#[strum(serialize_all = "kebab-case")]
pub enum Form {
    /// Equations (10) and (11): β₀ + Σ β_j of the ridge solution with λ = 1 on the same samples. Biased.
    Paper,
    /// Equation (7), β from the same samples. Bias O(1/N).
    Regression,
    /// Equation (7), β from the other of two independently randomised halves. Unbiased.
    Crossfit,
    /// Equation (7), β from earlier blocks of passes of the same pixel ([`block_of`]). Unbiased.
    #[default]
    Progressive,
}
