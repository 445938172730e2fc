//! Optimizing control variates (OCV): fit a mixture of the sampling densities to the integrand and integrate only the
//! difference [Fan et al. 2006].
//!
//! N samples x_i come from a deterministic mixture of m components: n_j = Nα_j of density p_j, together of density
//! p_α = Σ α_j p_j. With y_i = f(x_i)/p_α(x_i) and the columns c_ij = p_j(x_i)/p_α(x_i) − 1, whose expectation is 0
//! exactly, equation (7) is
//!
//! Î = ȳ − Σ_j β_j c̄_j.
//!
//! β = 0 is multiple importance sampling with the balance heuristic. Any β that is independent of the samples leaves
//! the estimate unbiased; the best one is that of the regression of y on the columns. There are five ways to obtain it
//! ([`Form`]), which differ in bias. Since Σ α_j c_j = 0, one column depends on the others.
//!
//! The densities of the columns are normalised, so that a ridge means the same for all: a component whose integral I_j
//! over the domain is not 1 has the column p_j/(I_j p_α) − 1, and 0 where I_j = 0.
//!
//! In reading order:
//!
//! | module | what |
//! |---|---|
//! | [`normal`] | the sums Σ c_j c_k, Σ c_j y, … of the regression, and the estimate with β |
//! | [`solve`] | β from the sums of many points at once |
//! | [`forms`] | the forms: which system, of which columns, and what is made of β |
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
