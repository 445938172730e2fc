//! The error of a wrong command line.

/// Usage error, such as contradictory options.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub(super) struct UsageError(pub(super) String);
