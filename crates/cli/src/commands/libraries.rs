//! Loads the image-writing libraries while an image is rendered.

use lumiris::imaging::oiio;
use lumiris::planning::processor_time;
use lumiris::render::phases::Phase;
use std::thread::JoinHandle;
use std::time::Duration;

/// A loader thread. Loading takes as long as one sample per pixel of a small image. The process must not exit
/// meanwhile: libraries would be initialised while others are shut down.
pub(super) struct Loading(Option<JoinHandle<Duration>>);

impl Loading {
    /// Starts loading if images will be written.
    pub(super) fn begin(has_images: bool) -> Self {
        let load = || {
            // Errors are reported when an image is written
            let _ = oiio::load();
            processor_time::of_thread()
        };
        Loading(has_images.then(|| std::thread::spawn(load)))
    }

    /// Waits for the thread and returns its CPU time.
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
