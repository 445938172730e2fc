//! The page: a small HTTP server that knows three addresses and no file.
//!
//! * `/`: the page;
//! * `/state`: progress and layers, as JSON;
//! * `/tiles?image=I&layer=L&since=V`: the tiles of a layer that have changed since the state V: that of the answer (u64),
//!   then for each tile left, top, width, height (u32) and its values (f32), little-endian.
//!
//! A page of another site could ask for these under a name of its own that leads to this machine; so requests must
//! name it by its address or as `localhost`.

use super::Shared;
use super::canvas::Canvas;
use anyhow::anyhow;
use serde_json::json;
use std::io::Cursor;
use std::net::SocketAddr;
use std::sync::Arc;
use std::time::{Duration, Instant};
use tiny_http::{Header, Method, Request, Response, StatusCode};

const PAGE: &str = include_str!("viewer/index.html");
const STYLE: &str = include_str!("viewer/style.css");
const SCRIPT: &str = include_str!("viewer/view.js");

/// Time between two looks at whether the program ends.
const INTERVAL: Duration = Duration::from_millis(100);
/// How long a page that is open may take to fetch the last state.
const FAREWELL: Duration = Duration::from_secs(2);

/// The server and the images that it has shown.
pub(super) struct Server {
    http: tiny_http::Server,
    address: SocketAddr,
    insecure: bool,
    /// The image that is shown, with a number of its own.
    shown: Option<(u64, Arc<Canvas>)>,
    /// When a page asked last.
    asked: Option<Instant>,
    /// True once the last state was handed out.
    is_told: bool,
}

type Answer = Response<Cursor<Vec<u8>>>;

impl Server {
    pub(super) fn open(address: SocketAddr, insecure: bool) -> anyhow::Result<Self> {
        let http = tiny_http::Server::http(address).map_err(|error| anyhow!("{error}"))?;
        // With port 0 the system chooses
        let address = http.server_addr().to_ip().unwrap_or(address);
        Ok(Server { http, address, insecure, shown: None, asked: None, is_told: false })
    }

    pub(super) fn address(&self) -> SocketAddr {
        self.address
    }

    /// Answers until the program ends, and a page that is open has seen the end.
    pub(super) fn run(mut self, shared: &Shared) {
        let mut closing: Option<Instant> = None;
        loop {
            if shared.is_closing() {
                let since = *closing.get_or_insert_with(Instant::now);
                let is_open = self.asked.is_some_and(|asked| asked.elapsed() < FAREWELL);
                if !is_open || self.is_told || since.elapsed() > FAREWELL {
                    return;
                }
            }
            match self.http.recv_timeout(INTERVAL) {
                Ok(Some(request)) => self.answer(shared, request),
                Ok(None) => {}
                Err(_) => return,
            }
        }
    }

    fn answer(&mut self, shared: &Shared, request: Request) {
        if let Some(canvas) = shared.canvas()
            && self.shown.as_ref().is_none_or(|(_, shown)| !Arc::ptr_eq(shown, &canvas))
        {
            let number = self.shown.as_ref().map_or(0, |(number, _)| number + 1);
            (self.shown, self.is_told) = (Some((number, canvas)), false);
        }
        let answer = self.answer_to(&request);
        // Who asked may have gone away
        let _ = request.respond(answer);
    }

    fn answer_to(&mut self, request: &Request) -> Answer {
        if !self.is_for_us(request) {
            return plain(403, "This page is for this machine only.");
        }
        if *request.method() != Method::Get {
            return plain(405, "GET only");
        }
        let (path, query) = request.url().split_once('?').unwrap_or((request.url(), ""));
        match path {
            "/" => typed(page().into_bytes(), "text/html; charset=utf-8"),
            "/state" => {
                self.asked = Some(Instant::now());
                typed(self.state().to_string().into_bytes(), "application/json")
            }
            "/tiles" => self.tiles(query),
            _ => plain(404, "There is nothing else here."),
        }
    }

    /// True if a request names this machine as who is to answer.
    fn is_for_us(&self, request: &Request) -> bool {
        let host = request.headers().iter().find(|header| header.field.equiv("Host"));
        let port = self.address.port();
        self.insecure
            || host.is_some_and(|host| {
                let host = host.value.as_str();
                host == self.address.to_string() || host == format!("localhost:{port}")
            })
    }

    fn state(&self) -> serde_json::Value {
        let Some((number, canvas)) = &self.shown else { return json!({ "image": null }) };
        let layers: Vec<_> =
            canvas.layers.iter().map(|l| json!({ "name": l.name, "channels": l.channels.len() })).collect();
        let progress = canvas.progress();
        json!({
            "image": number, "name": canvas.name, "width": canvas.size[0], "height": canvas.size[1],
            "layers": layers, "finished": canvas.is_finished(),
            "done": progress.map_or(0, |p| p.samples_done), "total": progress.map_or(0, |p| p.samples_total),
            "seconds": progress.map_or(0.0, |p| p.elapsed.as_secs_f64()),
            "noise": progress.and_then(|p| p.noise).filter(|noise| noise.is_finite()),
        })
    }

    /// See the module.
    fn tiles(&mut self, query: &str) -> Answer {
        let value = |name: &str| {
            let mut pairs = query.split('&').filter_map(|pair| pair.split_once('='));
            pairs.find(|(key, _)| *key == name).and_then(|(_, value)| value.parse::<u64>().ok())
        };
        let (Some(image), Some(layer), Some(since)) = (value("image"), value("layer"), value("since")) else {
            return plain(400, "image, layer and since are numbers");
        };
        let Some((number, canvas)) = &self.shown else { return plain(404, "There is no image yet.") };
        let layer = usize::try_from(layer).ok().and_then(|layer| canvas.layers.get(layer));
        let (Some(layer), true) = (layer, image == *number) else { return plain(404, "There is no such layer.") };
        // In this order: what is finished before its tiles are read has no others
        let is_finished = canvas.is_finished();
        let (version, tiles) = canvas.changed_since(since);
        self.is_told |= is_finished && tiles.is_empty();
        let mut bytes = version.to_le_bytes().to_vec();
        for tile in tiles {
            bytes.extend(tile.place.iter().flat_map(|n| n.to_le_bytes()));
            for pixel in tile.data.chunks_exact(canvas.channels.len()) {
                bytes.extend(pixel[layer.channels.clone()].iter().flat_map(|v| v.to_le_bytes()));
            }
        }
        typed(bytes, "application/octet-stream")
    }
}

/// The page with its style and script.
fn page() -> String {
    PAGE.replace("/*style*/", STYLE).replace("/*script*/", SCRIPT)
}

fn header(name: &str, value: &str) -> Option<Header> {
    Header::from_bytes(name, value).ok()
}

fn typed(bytes: Vec<u8>, kind: &str) -> Answer {
    let policy =
        "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; connect-src 'self'; img-src data:";
    let headers = [
        ("Content-Type", kind),
        ("Cache-Control", "no-store"),
        ("X-Content-Type-Options", "nosniff"),
        ("Content-Security-Policy", policy),
    ];
    let headers = headers.into_iter().filter_map(|(name, value)| header(name, value));
    headers.fold(Response::from_data(bytes), Response::with_header)
}

fn plain(code: u16, text: &str) -> Answer {
    typed(text.as_bytes().to_vec(), "text/plain; charset=utf-8").with_status_code(StatusCode(code))
}
