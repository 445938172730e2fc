//! Optimizing control variates (OCV): fit a mixture of the sampling densities to the integrand and integrate only the
//! difference [Fan et al. 2006].
//!
//! N samples x_i come from a deterministic mixture of m components: n_j = Nα_j samples of density p_j, with the joint
//! density p_α = Σ α_j p_j. With y_i = f(x_i)/p_α(x_i) and the columns c_ij = p_j(x_i)/p_α(x_i) − 1, whose expectation
//! is exactly 0, equation (7) is
//!
//! Î = ȳ − Σ_j β_j c̄_j.
//!
//! β = 0 is multiple importance sampling with the balance heuristic. Any β that is independent of the samples gives an
//! unbiased estimate; the optimal one is the regression of y on the columns. There are five forms of β ([`Form`]),
//! which differ in bias. Since Σ α_j c_j = 0, one column is linearly dependent on the others.
//!
//! The densities of the columns are normalised, so that a ridge has the same meaning for all. A component whose
//! integral I_j over the domain is not 1 has the column p_j/(I_j p_α) − 1, or 0 if I_j = 0.
//!
//! In reading order:
//!
//! | module | content |
//! |---|---|
//! | [`normal`] | the sums Σ c_j c_k, Σ c_j y, … of the regression, and the estimate with β |
//! | [`solve`] | β from the sums of many points at once |
//! | [`forms`] | the forms: their systems, columns and estimates |
//! | [`ldlt`] | one small symmetric system in f64, with pivots, for [`super::optimal_mis`] |
//! | [`pixels`] | β of a pixel from other pixels |
//! | [`block`] | the blocks of passes of the progressive form |

pub mod block;
pub mod forms;
pub mod ldlt;
pub mod normal;
pub mod pixels;
pub mod solve;

pub use block::{Block, block_of};
pub use forms::Form;
pub use ldlt::{IllConditioned, MAX_COMPONENTS};
pub use normal::NormalEquations;
pub use solve::{Matrix, System};
