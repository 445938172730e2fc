//! Loading of the libraries that write images, while an image is rendered.

use lumiris::imaging::oiio;
use lumiris::planning::processor_time;
use lumiris::render::phases::Phase;
use std::thread::JoinHandle;
use std::time::Duration;

/// A thread that loads them, which takes as long as a sample of a small image. The process must not end meanwhile: libraries
/// would begin while others end.
pub(super) struct Loading(Option<JoinHandle<Duration>>);

impl Loading {
    /// Begins, if images are to be written.
    pub(super) fn begin(has_images: bool) -> Self {
        let load = || {
            // What goes wrong is said when an image is written
            let _ = oiio::load();
            processor_time::of_thread()
        };
        Loading(has_images.then(|| std::thread::spawn(load)))
    }

    /// Waits for it, and tells what it has cost.
    pub(super) fn end(mut self) -> Phase {
        Phase { name: "libraries", time: self.wait() }
    }

    fn wait(&mut self) -> Duration {
        self.0.take().and_then(|thread| thread.join().ok()).unwrap_or_default()
    }
}

impl Drop for Loading {
    fn drop(&mut self) {
        self.wait();
    }
}
