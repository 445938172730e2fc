//! The page: a small HTTP server that knows three addresses and no file.
//!
//! * `/`: the page;
//! * `/state`: progress and layers, as JSON;
//! * `/tiles?image=I&layer=L&since=V`: tiles of a layer that have changed since the state V: the state that they lead to
//!   (u64), then for each tile left, top, width, height (u32) and its values (f32), little-endian. The page goes on from there
//!   until it has reached the `version` of `/state`.
//!
//! A page of another site could ask for these under a name of its own that leads to this machine; so requests must
//! name it by its address or as `localhost`.
//!
//! Whoever reaches the address may send anything. One thread answers, with an [`Allowance`] of processor time, and connections
//! are bounded in number, length and time: 64 of them have 16 kB for the head of a request, and 260 kB for an answer each.

use super::Shared;
use super::allowance::Allowance;
use super::canvas::Canvas;
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

/// Time between two looks at whether the program ends, and at how much processor time was taken.
const INTERVAL: Duration = Duration::from_millis(10);
/// How long a page that is open may take to fetch the last state.
const FAREWELL: Duration = Duration::from_secs(2);
/// Connections; one more ends the oldest of them.
const CONNECTIONS: usize = 64;
/// Length of the head of a request (bytes).
const HEAD: usize = 16 << 10;
/// How long a client may take to send it.
const HEAD_TIME: Duration = Duration::from_secs(10);
/// How long a connection may take altogether.
const CONNECTION_TIME: Duration = Duration::from_secs(30);

/// The server, before it answers.
pub(super) struct Server {
    runtime: Runtime,
    listener: TcpListener,
    page: Page,
}

/// What requests ask for.
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
    /// The image that is shown, with a number of its own.
    shown: Option<(u64, Arc<Canvas>)>,
    /// When a page asked last.
    asked: Option<Instant>,
    /// True once the last state was handed out.
    is_told: bool,
}

type Answer = Response<Full<Bytes>>;

impl Server {
    pub(super) fn open(address: SocketAddr, insecure: bool, shared: Arc<Shared>) -> io::Result<Self> {
        let runtime = tokio::runtime::Builder::new_current_thread().enable_io().enable_time().build()?;
        let listener = runtime.block_on(TcpListener::bind(address))?;
        // With port 0 the system chooses
        let address = listener.local_addr()?;
        let html = PAGE.replace("/*style*/", STYLE).replace("/*script*/", SCRIPT).into();
        Ok(Server { runtime, listener, page: Page { shared, address, insecure, html, state: Mutex::default() } })
    }

    pub(super) fn address(&self) -> SocketAddr {
        self.page.address
    }

    /// Answers until the program ends, and a page that is open has seen the end.
    pub(super) fn run(self) {
        let (page, listener) = (Arc::new(self.page), self.listener);
        self.runtime.block_on(async move {
            let mut allowance = Allowance::new();
            tokio::spawn(accept(listener, Arc::clone(&page)));
            while !page.shared.is_closing() {
                sleep(INTERVAL).await;
                // This thread itself, so that no connection goes on meanwhile
                std::thread::sleep(allowance.rest());
            }
            let closing = Instant::now();
            while closing.elapsed() < FAREWELL && page.is_awaited() {
                sleep(INTERVAL).await;
            }
        });
    }
}

/// Takes connections, each into a task of its own.
async fn accept(listener: TcpListener, page: Arc<Page>) {
    let mut open: VecDeque<AbortHandle> = VecDeque::new();
    loop {
        let Ok((stream, _)) = listener.accept().await else {
            // Too many files are open, perhaps
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

/// Answers the one request of a connection.
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

    /// True if a page is open that has not seen the end.
    fn is_awaited(&self) -> bool {
        let state = self.state();
        !state.is_told && state.asked.is_some_and(|asked| asked.elapsed() < FAREWELL)
    }

    /// The answer to a request; `is_last` becomes true if nothing will come after it.
    fn answer(&self, request: &Request<impl Body>, is_last: &AtomicBool) -> Answer {
        if !self.is_for_us(request) {
            return plain(StatusCode::FORBIDDEN, "This page is for this machine only.");
        }
        if request.method() != Method::GET {
            return plain(StatusCode::METHOD_NOT_ALLOWED, "GET only");
        }
        if !request.body().is_end_stream() {
            return plain(StatusCode::PAYLOAD_TOO_LARGE, "GET without a body only");
        }
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

    /// True if a request names this machine as who is to answer.
    fn is_for_us(&self, request: &Request<impl Body>) -> bool {
        let (address, port) = (self.address, self.address.port());
        let names = [address.to_string(), format!("localhost:{port}")];
        let host = request.headers().get(header::HOST);
        self.insecure || host.is_some_and(|host| names.iter().any(|name| name.as_bytes() == host.as_bytes()))
    }
}

impl State {
    /// Shows an image, if it is another one than before.
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
            "image": number, "name": canvas.name, "summary": canvas.summary.get(), "width": canvas.size[0], "height": canvas.size[1],
            "layers": layers, "finished": canvas.is_finished(), "version": canvas.version(),
            "done": progress.map_or(0, |p| p.samples_done), "total": progress.map_or(0, |p| p.samples_total),
            "seconds": progress.map_or(0.0, |p| p.elapsed.as_secs_f64()),
            "noise": progress.and_then(|p| p.noise).filter(|noise| noise.is_finite()),
        })
    }
}

/// See the module.
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
    // In this order: what is finished before its tiles are read has no others
    let is_finished = canvas.is_finished();
    let (version, tiles) = canvas.changed_since(since);
    is_last.store(is_finished && tiles.is_empty(), Ordering::Relaxed);
    let mut bytes = version.to_le_bytes().to_vec();
    for tile in tiles {
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
