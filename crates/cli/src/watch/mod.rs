//! Watching an image while it converges: in tev ([`tev`]), and on a page in the browser ([`server`]).
//!
//! Threads that render leave their tiles in a [`Canvas`](canvas::Canvas), which shares their sums, and wait for nobody. Those
//! that send them on, one for each way to watch, make pixels of them, only of what has changed, within an
//! [`Allowance`](allowance::Allowance) of processor time.

mod allowance;
mod canvas;
mod preview;
mod server;
mod tev;

use anyhow::Context;
pub(crate) use canvas::Canvas;
use lumiris::render::Progress;
use lumiris::scene::FilmSettings;
pub(crate) use preview::preview;
use server::Server;
use std::net::{Shutdown, SocketAddr, TcpStream};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};
use tev::Tev;

/// How long the program may take to show the last state when it ends.
const FAREWELL: Duration = Duration::from_secs(5);

/// Where images may be watched.
#[derive(Clone, Debug, Default)]
pub(crate) struct Places {
    /// Address of a tev.
    pub tev: Option<String>,
    /// Address that the page is served on.
    pub view: Option<SocketAddr>,
    /// Whether others than this machine may see the page.
    pub insecure: bool,
}

/// What all threads know.
#[derive(Debug, Default)]
struct Shared {
    /// The image that is being rendered, if one has begun.
    canvas: Mutex<Option<Arc<Canvas>>>,
    is_closing: AtomicBool,
}

impl Shared {
    fn canvas(&self) -> Option<Arc<Canvas>> {
        self.canvas.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    fn is_closing(&self) -> bool {
        self.is_closing.load(Ordering::Acquire)
    }
}

/// Those who watch; they see the last state of the last image before this is dropped.
#[derive(Debug, Default)]
pub(crate) struct Watch {
    shared: Arc<Shared>,
    threads: Vec<JoinHandle<()>>,
    /// The connection with tev.
    tev: Option<TcpStream>,
    /// Address of the page.
    pub page: Option<SocketAddr>,
}

impl Watch {
    /// Connects with tev and opens the page, if there are to be. `warn` is told when tev goes away later.
    pub(crate) fn start(places: &Places, warn: fn(&str)) -> anyhow::Result<Self> {
        let mut watch = Watch::default();
        if let Some(address) = &places.tev {
            let (tev, stream) =
                Tev::connect(address).with_context(|| format!("--tev: there is no tev at {address}"))?;
            watch.tev = Some(stream);
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

    /// Begins an image; `None` if nobody watches.
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
            // A tev that reads a byte now and then would never end the thread that writes
            let _ = tev.shutdown(Shutdown::Both);
        }
        for thread in self.threads.drain(..) {
            // A thread that failed has shown nothing more: the image is not its concern
            let _ = thread.join();
        }
    }
}

/// Progress of an image that somebody may watch.
pub(crate) fn observe(canvas: Option<&Arc<Canvas>>, progress: &Progress) {
    if let Some(canvas) = canvas {
        canvas.set_progress(progress);
    }
}
