//! The page: a small HTTP server with three addresses and no access to files.
//!
//! * `/`: the page;
//! * `/state`: progress and layers, as JSON;
//! * `/tiles?image=I&layer=L&since=V`: tiles of a layer that have changed since the state V. The answer is the new
//!   state (u64), then for each tile left, top, width, height (u32) and its values (f32), all little-endian. The page
//!   repeats this until it reaches the `version` of `/state`.
//!
//! DNS rebinding: a page of another site could reach this server by a host name that resolves to this machine. Requests
//! must therefore name the host by its address or as `localhost`.
//!
//! Clients are not trusted. One thread answers, with an [`Allowance`] of CPU time. Connections are bounded in number,
//! length and time: 64 connections, each with 16 kB for the head of a request and 260 kB for an answer.

use super::allowance::Allowance;
use super::canvas::{Canvas, Changes};
use super::shared::Shared;
use http_body_util::Full;
use hyper::body::{Body, Bytes};
use hyper::header::{self, HeaderValue};
use hyper::server::conn::http1;
use hyper::service::service_fn;
use hyper::{Method, Request, Response, StatusCode};
use hyper_util::rt::{TokioIo, TokioTimer};
use serde_json::json;
use std::collections::VecDeque;
use std::convert::Infallible;
use std::io;
use std::net::SocketAddr;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use tokio::net::{TcpListener, TcpStream};
use tokio::runtime::Runtime;
use tokio::task::AbortHandle;
use tokio::time::{sleep, timeout};

const PAGE: &str = include_str!("viewer/index.html");
const STYLE: &str = include_str!("viewer/style.css");
const SCRIPT: &str = include_str!("viewer/view.js");

/// Interval for checking whether the program ends, and the CPU time used.
const INTERVAL: Duration = Duration::from_millis(10);
/// Time for an open page to fetch the last state.
const FAREWELL: Duration = Duration::from_secs(2);
/// Maximum number of connections. One more ends the oldest.
const CONNECTIONS: usize = 64;
/// Maximum length of a request's head (bytes).
const HEAD: usize = 16 << 10;
/// Maximum time for receiving the head.
const HEAD_TIME: Duration = Duration::from_secs(10);
/// Maximum total time of a connection.
const CONNECTION_TIME: Duration = Duration::from_secs(30);

/// The server before it starts answering.
pub(super) struct Server {
    runtime: Runtime,
    listener: TcpListener,
    page: Page,
}

/// State for answering requests.
struct Page {
    shared: Arc<Shared>,
    address: SocketAddr,
    insecure: bool,
    /// The page with its style and script.
    html: Bytes,
    state: Mutex<State>,
}

#[derive(Default)]
struct State {
    /// The current image and its number.
    shown: Option<(u64, Arc<Canvas>)>,
    /// Time of the last request for state or tiles.
    asked: Option<Instant>,
    /// True once the last state was sent.
    is_told: bool,
}

type Answer = Response<Full<Bytes>>;

impl Server {
    pub(super) fn open(address: SocketAddr, insecure: bool, shared: Arc<Shared>) -> io::Result<Self> {
        let runtime = tokio::runtime::Builder::new_current_thread().enable_io().enable_time().build()?;
        let listener = runtime.block_on(TcpListener::bind(address))?;
        // Port 0 lets the system choose
        let address = listener.local_addr()?;
        let html = PAGE.replace("/*style*/", STYLE).replace("/*script*/", SCRIPT).into();
        Ok(Server { runtime, listener, page: Page { shared, address, insecure, html, state: Mutex::default() } })
    }

    pub(super) fn address(&self) -> SocketAddr {
        self.page.address
    }

    /// Answers requests until the program ends and an open page has the last state.
    pub(super) fn run(self) {
        let (page, listener) = (Arc::new(self.page), self.listener);
        self.runtime.block_on(async move {
            let mut allowance = Allowance::new();
            tokio::spawn(accept(listener, Arc::clone(&page)));
            while !page.shared.is_closing() {
                sleep(INTERVAL).await;
                // Blocks the whole thread, so that no connection continues meanwhile
                std::thread::sleep(allowance.rest());
            }
            let closing = Instant::now();
            while closing.elapsed() < FAREWELL && page.is_awaited() {
                sleep(INTERVAL).await;
            }
        });
    }
}

/// Accepts connections, each as a separate task.
async fn accept(listener: TcpListener, page: Arc<Page>) {
    let mut open: VecDeque<AbortHandle> = VecDeque::new();
    loop {
        let Ok((stream, _)) = listener.accept().await else {
            // Possibly too many open files
            sleep(Duration::from_millis(100)).await;
            continue;
        };
        open.retain(|connection| !connection.is_finished());
        if open.len() >= CONNECTIONS
            && let Some(oldest) = open.pop_front()
        {
            oldest.abort();
        }
        open.push_back(tokio::spawn(connection(stream, Arc::clone(&page))).abort_handle());
    }
}

/// Answers the single request of a connection.
async fn connection(stream: TcpStream, page: Arc<Page>) {
    let is_last = AtomicBool::new(false);
    let service = service_fn(|request: Request<_>| {
        let answer = page.answer(&request, &is_last);
        async { Ok::<_, Infallible>(answer) }
    });
    let mut http = http1::Builder::new();
    http.timer(TokioTimer::new()).header_read_timeout(HEAD_TIME).max_buf_size(HEAD).keep_alive(false);
    let ended = timeout(CONNECTION_TIME, http.serve_connection(TokioIo::new(stream), service)).await;
    if matches!(ended, Ok(Ok(()))) && is_last.load(Ordering::Relaxed) {
        page.state().is_told = true;
    }
}

impl Page {
    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// True if an open page does not have the last state yet.
    fn is_awaited(&self) -> bool {
        let state = self.state();
        !state.is_told && state.asked.is_some_and(|asked| asked.elapsed() < FAREWELL)
    }

    /// The answer to a request. Sets `is_last` if no further tiles will follow.
    fn answer(&self, request: &Request<impl Body>, is_last: &AtomicBool) -> Answer {
        // Refuse
        if !self.is_for_us(request) {
            return plain(StatusCode::FORBIDDEN, "This page is for this machine only.");
        }
        if request.method() != Method::GET {
            return plain(StatusCode::METHOD_NOT_ALLOWED, "GET only");
        }
        if !request.body().is_end_stream() {
            return plain(StatusCode::PAYLOAD_TOO_LARGE, "GET without a body only");
        }

        // Answer
        let mut state = self.state();
        state.show(self.shared.canvas());
        match request.uri().path() {
            "/" => typed(self.html.clone(), "text/html; charset=utf-8"),
            "/state" => {
                state.asked = Some(Instant::now());
                typed(state.json().to_string(), "application/json")
            }
            "/tiles" => {
                state.asked = Some(Instant::now());
                tiles(state, request.uri().query().unwrap_or_default(), is_last)
            }
            _ => plain(StatusCode::NOT_FOUND, "There is nothing else here."),
        }
    }

    /// True if the Host header names this machine.
    fn is_for_us(&self, request: &Request<impl Body>) -> bool {
        let (address, port) = (self.address, self.address.port());
        let names = [address.to_string(), format!("localhost:{port}")];
        let host = request.headers().get(header::HOST);
        self.insecure || host.is_some_and(|host| names.iter().any(|name| name.as_bytes() == host.as_bytes()))
    }
}

impl State {
    /// Switches to `canvas` if it is another image.
    fn show(&mut self, canvas: Option<Arc<Canvas>>) {
        let Some(canvas) = canvas else { return };
        if self.shown.as_ref().is_none_or(|(_, shown)| !Arc::ptr_eq(shown, &canvas)) {
            let number = self.shown.as_ref().map_or(0, |(number, _)| number + 1);
            (self.shown, self.is_told) = (Some((number, canvas)), false);
        }
    }

    fn json(&self) -> serde_json::Value {
        let Some((number, canvas)) = &self.shown else { return json!({ "image": null }) };
        let layers: Vec<_> =
            canvas.layers.iter().map(|l| json!({ "name": l.name, "channels": l.channels.len() })).collect();
        let progress = canvas.progress();
        json!({
            "image": number, "name": canvas.name, "summary": canvas.summary.get(),
            "width": canvas.size[0], "height": canvas.size[1],
            "layers": layers, "finished": canvas.is_finished(), "version": canvas.version(),
            "done": progress.map_or(0, |p| p.samples_done), "total": progress.map_or(0, |p| p.samples_total),
            "seconds": progress.map_or(0.0, |p| p.elapsed.as_secs_f64()),
            "noise": progress.and_then(|p| p.noise).filter(|noise| noise.is_finite()),
        })
    }
}

/// The answer to `/tiles`; see the module.
fn tiles(state: MutexGuard<'_, State>, query: &str, is_last: &AtomicBool) -> Answer {
    let value = |name: &str| {
        let mut pairs = query.split('&').filter_map(|pair| pair.split_once('='));
        pairs.find(|(key, _)| *key == name).and_then(|(_, value)| value.parse::<u64>().ok())
    };
    let (Some(image), Some(layer), Some(since)) = (value("image"), value("layer"), value("since")) else {
        return plain(StatusCode::BAD_REQUEST, "image, layer and since are numbers");
    };
    let Some((number, canvas)) = &state.shown else { return plain(StatusCode::NOT_FOUND, "There is no image yet.") };
    let layer = usize::try_from(layer).ok().and_then(|layer| canvas.layers.get(layer));
    let (Some(layer), true) = (layer, image == *number) else {
        return plain(StatusCode::NOT_FOUND, "There is no such layer.");
    };
    // The order matters: a canvas that is finished before its tiles are read gets no more of them
    let is_finished = canvas.is_finished();
    let Changes { reached, changed } = canvas.changed_since(since);
    is_last.store(is_finished && changed.is_empty(), Ordering::Relaxed);
    let mut bytes = reached.to_le_bytes().to_vec();
    for tile in changed {
        bytes.extend(tile.place.iter().flat_map(|n| n.to_le_bytes()));
        for pixel in tile.data.chunks_exact(canvas.channels.len()) {
            bytes.extend(pixel[layer.channels.clone()].iter().flat_map(|v| v.to_le_bytes()));
        }
    }
    typed(bytes, "application/octet-stream")
}

fn typed(bytes: impl Into<Bytes>, kind: &'static str) -> Answer {
    let policy =
        "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; connect-src 'self'; img-src data:";
    let mut answer = Response::new(Full::new(bytes.into()));
    answer.headers_mut().extend([
        (header::CONTENT_TYPE, HeaderValue::from_static(kind)),
        (header::CACHE_CONTROL, HeaderValue::from_static("no-store")),
        (header::X_CONTENT_TYPE_OPTIONS, HeaderValue::from_static("nosniff")),
        (header::CONTENT_SECURITY_POLICY, HeaderValue::from_static(policy)),
    ]);
    answer
}

fn plain(status: StatusCode, text: &'static str) -> Answer {
    let mut answer = typed(text, "text/plain; charset=utf-8");
    *answer.status_mut() = status;
    answer
}
