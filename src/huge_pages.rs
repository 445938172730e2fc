//! Large blocks of memory in huge pages: lookups that are spread over an environment map or a texture miss the cache of
//! address translations less often.
#![allow(unsafe_code)]

use rustix::mm::{Advice, madvise};
use std::alloc::{GlobalAlloc, Layout, System};

/// Bytes of blocks that are large: whole huge pages lie inside.
const LARGE: usize = 4 << 20;
/// Bytes of a page, or of a multiple of one.
const PAGE: usize = 1 << 16;

/// The allocator of the system, which asks for huge pages where blocks are large.
#[derive(Clone, Copy, Debug)]
pub struct HugePages;

// SAFETY: all blocks are the system's, unchanged.
unsafe impl GlobalAlloc for HugePages {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        // SAFETY: as the caller promises.
        advised(unsafe { System.alloc(layout) }, layout.size())
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        // SAFETY: as the caller promises.
        advised(unsafe { System.alloc_zeroed(layout) }, layout.size())
    }

    unsafe fn realloc(&self, block: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        // SAFETY: as the caller promises.
        advised(unsafe { System.realloc(block, layout, size) }, size)
    }

    unsafe fn dealloc(&self, block: *mut u8, layout: Layout) {
        // SAFETY: as the caller promises.
        unsafe { System.dealloc(block, layout) }
    }
}

/// The block, in huge pages if it is large and the system has them.
#[inline]
fn advised(block: *mut u8, size: usize) -> *mut u8 {
    if size >= LARGE && !block.is_null() {
        advise(block, size);
    }
    block
}

#[cold]
fn advise(block: *mut u8, size: usize) {
    let first = block.align_offset(PAGE);
    let whole = size.saturating_sub(first) / PAGE * PAGE;
    // SAFETY: the pages lie inside the block, and the advice changes nothing that is stored there. Without huge pages
    // it fails, which is no harm.
    let _ = unsafe { madvise(block.wrapping_add(first).cast(), whole, Advice::LinuxHugepage) };
}
