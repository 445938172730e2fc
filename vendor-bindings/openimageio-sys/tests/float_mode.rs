//! The only test of its binary, so that the examined thread is the one that loads the library.

use openimageio_sys::load;
use std::hint::black_box;

#[test]
fn loading_does_not_flush_subnormal_numbers() {
    // A library linked with -ffast-math would make the loading thread flush them
    let half_of_smallest_normal = || black_box(f32::MIN_POSITIVE) / black_box(2.0);
    let before = half_of_smallest_normal();
    load().unwrap();
    assert!(before > 0.0);
    assert_eq!(half_of_smallest_normal().to_bits(), before.to_bits());
}
