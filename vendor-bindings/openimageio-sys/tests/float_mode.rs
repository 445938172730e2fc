//! Alone in its binary, so that the thread that loads the library is the one that is examined.

use openimageio_sys::load;
use std::hint::black_box;

#[test]
fn loading_does_not_flush_subnormal_numbers() {
    // A library linked with -ffast-math sets the thread that loads it to flush them.
    let half_of_smallest_normal = || black_box(f32::MIN_POSITIVE) / black_box(2.0);
    let before = half_of_smallest_normal();
    load().unwrap();
    assert!(before > 0.0);
    assert_eq!(half_of_smallest_normal().to_bits(), before.to_bits());
}
