//! Estimators of ∫ f: slices and numbers in, numbers out, independent of rays, lights and scenes.
//!
//! | module | estimate | bias |
//! |---|---|---|
//! | [`mc`] | (1/N) Σ f/p | none |
//! | [`heuristics`] | Σᵢ (1/nᵢ) Σⱼ wᵢ f/pᵢ, weights that sum to one | none |
//! | [`ris`] | Σ scale·f r over N proposals drawn from M | none |
//! | [`ocv`] | ȳ − Σ βⱼ c̄ⱼ, β fitted: optimizing control variates | by form: none if β is independent of the samples |
//! | [`correlated`] | ȳ − λ c̄, one density, one control | O(1/N), or none with λ from other samples |
//! | [`optimal_mis`] | Σ αⱼ + (1/N) Σ (f − Σ αⱼ pⱼ)/p_α, optimal weights | O(1/N), or none with α from other samples |
//!
//! [`stats`] has running moments and the tests (t, z, χ²) that check these claims.

pub mod correlated;
pub mod efficiency;
pub mod heuristics;
pub mod mc;
pub mod ocv;
pub mod optimal_mis;
pub mod ris;
pub mod stats;
