//! The numerics of resampled importance sampling (RIS): from M cheap proposals, draw N and evaluate only those [Talbot
//! et al. 2005; Talbot 2005].
//!
//! RIS is an unbiased subsampling of a Monte Carlo sum. M proposals x_j of density p estimate ∫f by Σ c_j with c_j =
//! f(x_j)·r_j and r_j = 1/(M p(x_j)); proposals of several techniques have r_j = wᵢ/(mᵢ pᵢ) (thesis 4.6.1). The weight
//! of a proposal is w_j = q̂(x_j)·r_j, where the target q̂ resembles f but is cheap (for example, f without
//! visibility), so that S = Σ w_j estimates ∫q̂. A drawn proposal j represents the proposals that were not drawn:
//!
//! Î = Σ over draws of scale·c_j,  scale = 1/E[number of times that j is drawn | the proposals].
//!
//! Given the proposals, the expectation of Î is Σ c_j for every drawing method and all strata, and this sum is itself
//! unbiased. The only condition is w_j > 0 where f(x_j) ≠ 0.
//!
//! In reading order:
//!
//! | module | content | source |
//! |---|---|---|
//! | [`draw`] | N of M by weight: with replacement, systematic, one per stratum or set | thesis (4.1), (4.5); paper (1) |
//! | [`reservoir`] | one of a stream | [Chao 1982] |
//! | [`strata`] | the strata: equal counts or equal weights | thesis 4.5.2.1, 4.5.2.2 |
//! | [`control`] | estimated visibility as a control variate | |
//! | [`sample_counts`] | numbers of proposals and samples | thesis (4.3), (4.4); paper (2), (3) |

pub mod control;
pub mod draw;
pub mod reservoir;
pub mod sample_counts;
pub mod strata;

pub use draw::{Draw, stratified, systematic, weight, with_replacement};
pub use reservoir::Reservoir;
