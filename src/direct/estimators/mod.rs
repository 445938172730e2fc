//! The estimators of direct light. Each is a struct of its settings, and a file with its part in each stage.
//!
//! | file | propose (T1) | select | resolve |
//! |---|---|---|---|
//! | [`mc`] | light samples | 1/(n·p) | sum |
//! | [`mis`] | light and BSDF samples | weights of a heuristic | sum |
//! | [`ris`] | many light and BSDF samples, in chunks | draws from each chunk | sum |
//! | [`ocv`] | like `mis`, by group of lights | like `mis` | control variates |
//! | [`optimal_mis`] | like `mis`, by group of lights | like `mis` | optimal weights |
//! | [`correlated`] | samples of one technique | 1/(n·p) | two estimates combined |
//! | [`contributing`] | light samples by contribution, and BSDF samples | like `mis` | sum |

pub mod contributing;
pub mod correlated;
mod estimator;
pub mod mc;
pub mod mis;
pub mod ocv;
pub mod optimal_mis;
pub mod ris;

pub use estimator::Estimator;
pub(super) use estimator::PointBatch;
