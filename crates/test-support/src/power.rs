//! How much statistical tests render and draw.

/// `full` in `make test-power`, which sets `TEST_POWER`, and `quick` in `make test`: numbers of samples, and the bias
/// that a test has to notice with them.
pub fn by_power<T>(full: T, quick: T) -> T {
    if std::env::var_os("TEST_POWER").is_some() { full } else { quick }
}
