//! Requests of memory: the cache misses of many lookups overlap if all of them are requested before the first is read.
#![allow(unsafe_code)]

/// Requests the cache line of `items[index]`, which is read soon. An index beyond the end is harmless. Does nothing on
/// processors other than x86-64.
#[inline(always)]
pub fn prefetch<T>(items: &[T], index: usize) {
    #[cfg(target_arch = "x86_64")]
    {
        use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        // SAFETY: the instruction neither faults nor changes anything that the program sees.
        unsafe { _mm_prefetch::<_MM_HINT_T0>(items.as_ptr().wrapping_add(index).cast()) };
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = (items, index);
}

/// Requests the items around a point of an image for bilinear interpolation: two from `first` on, and two in the next
/// row, `stride` items later.
#[inline(always)]
pub fn prefetch_square<T>(items: &[T], first: usize, stride: usize) {
    for row in [first, first + stride] {
        prefetch(items, row);
        prefetch(items, row + 1);
    }
}
