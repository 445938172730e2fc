//! State shared by all threads.

use super::canvas::Canvas;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

/// The image, and the end of the program.
#[derive(Debug, Default)]
pub(super) struct Shared {
    /// The current image, once it has begun.
    pub(super) canvas: Mutex<Option<Arc<Canvas>>>,
    pub(super) is_closing: AtomicBool,
}

impl Shared {
    pub(super) fn canvas(&self) -> Option<Arc<Canvas>> {
        self.canvas.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    pub(super) fn is_closing(&self) -> bool {
        self.is_closing.load(Ordering::Acquire)
    }
}
