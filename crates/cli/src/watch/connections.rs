//! Connections to viewers.

use super::canvas::Canvas;
use super::server::Server;
use super::shared::Shared;
use super::tev::{Tev, open_stream};
use anyhow::Context;
use lumiris::render::Progress;
use lumiris::scene::FilmSettings;
use std::net::{Shutdown, SocketAddr, TcpStream};
use std::sync::atomic::Ordering;
use std::sync::{Arc, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Time for showing the last state when the program ends.
const FAREWELL: Duration = Duration::from_secs(5);

/// Addresses for watching.
#[derive(Clone, Debug, Default)]
pub(crate) struct Places {
    /// Address of tev.
    pub tev: Option<String>,
    /// Address at which the page is served.
    pub view: Option<SocketAddr>,
    /// True if other machines may open the page.
    pub insecure: bool,
}

/// Connections to viewers. Dropping it waits until they have the last state of the last image.
#[derive(Debug, Default)]
pub(crate) struct Watch {
    shared: Arc<Shared>,
    threads: Vec<JoinHandle<()>>,
    /// The connection to tev.
    tev: Option<TcpStream>,
    /// Address of the page.
    pub page: Option<SocketAddr>,
}

impl Watch {
    /// Connects to tev and opens the page, if requested. `warn` is called if tev disconnects later.
    pub(crate) fn start(places: &Places, warn: fn(&str)) -> anyhow::Result<Self> {
        let mut watch = Watch::default();
        if let Some(address) = &places.tev {
            let mut connect = || Tev::new(watch.tev.insert(open_stream(address)?));
            let tev = connect().with_context(|| format!("--tev: there is no tev at {address}"))?;
            let shared = Arc::clone(&watch.shared);
            watch.threads.push(std::thread::spawn(move || tev.run(&shared, warn)));
        }
        if let Some(address) = places.view {
            let server = Server::open(address, places.insecure, Arc::clone(&watch.shared))
                .with_context(|| format!("--view: nothing can be served on {address}"))?;
            watch.page = Some(server.address());
            watch.threads.push(std::thread::spawn(move || server.run()));
        }
        Ok(watch)
    }

    /// Begins an image; `None` without viewers.
    pub(crate) fn begin(&self, name: &str, film: &FilmSettings, has_features: bool) -> Option<Arc<Canvas>> {
        if self.threads.is_empty() {
            return None;
        }
        let canvas = Arc::new(Canvas::new(name, film.bounds, has_features));
        *self.shared.canvas.lock().unwrap_or_else(PoisonError::into_inner) = Some(Arc::clone(&canvas));
        Some(canvas)
    }
}

impl Drop for Watch {
    fn drop(&mut self) {
        self.shared.is_closing.store(true, Ordering::Release);
        let closing = Instant::now();
        while closing.elapsed() < FAREWELL && !self.threads.iter().all(JoinHandle::is_finished) {
            std::thread::sleep(Duration::from_millis(5));
        }
        if let Some(tev) = &self.tev {
            // Ends a write that a very slow tev would never finish
            let _ = tev.shutdown(Shutdown::Both);
        }
        for thread in self.threads.drain(..) {
            // A panic in a viewer thread must not affect the image
            let _ = thread.join();
        }
    }
}

/// Passes the progress to viewers, if there are any.
pub(crate) fn observe(canvas: Option<&Arc<Canvas>>, progress: &Progress) {
    if let Some(canvas) = canvas {
        canvas.set_progress(progress);
    }
}
