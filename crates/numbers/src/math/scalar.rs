//! Constants and functions of single floats.

/// Largest f32 below one; random numbers are clamped to it so that `u < 1` holds after arithmetic.
pub const ONE_MINUS_EPSILON: f32 = 1.0 - f32::EPSILON / 2.0;

/// ⌊x⌋. Without SSE 4.1, `f64::floor` is a function call.
#[inline]
pub fn floor(x: f64) -> f64 {
    /// All floats from here on are integers.
    const WHOLE: f64 = (1_u64 << 52) as f64;
    // Adding and subtracting rounds
    let large = WHOLE.copysign(x);
    let near = (x + large) - large;
    if x.abs() < WHOLE { near - if near > x { 1.0 } else { 0.0 } } else { x }
}

/// `x²`.
#[inline]
pub fn sqr(x: f32) -> f32 {
    x * x
}

/// `sqrt(max(x, 0))`: for expressions that are non-negative except for rounding.
#[inline]
pub fn safe_sqrt(x: f32) -> f32 {
    x.max(0.0).sqrt()
}

/// Bound of the relative rounding error of `n` chained f32 operations,
/// γₙ = nε/(1 − nε), ε = 2⁻²⁴ [Higham 2002; Pharr et al. 2023, §6.8.1].
#[inline]
pub const fn gamma(n: u32) -> f32 {
    let n_eps = n as f32 * (f32::EPSILON * 0.5);
    n_eps / (1.0 - n_eps)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn helpers_have_the_values_of_their_definitions() {
        assert_eq!((sqr(-3.0), safe_sqrt(9.0), safe_sqrt(-1e-9)), (9.0, 3.0, 0.0));
        assert!(ONE_MINUS_EPSILON < 1.0 && ONE_MINUS_EPSILON.next_up() == 1.0);
        // γ₃ = 3·2⁻²⁴/(1 − 3·2⁻²⁴), which rounds to the f32 above 3·2⁻²⁴ for many operations
        let exact = |n: f64| n * 0.5_f64.powi(24) / (1.0 - n * 0.5_f64.powi(24));
        for n in [1, 3, 7, 4_000_000] {
            assert!((f64::from(gamma(n)) / exact(f64::from(n)) - 1.0).abs() < 1e-6, "{n}");
        }
    }
}
