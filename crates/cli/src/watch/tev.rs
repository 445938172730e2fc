//! Sends tiles to tev.

use super::allowance::Allowance;
use super::canvas::{Canvas, Changes, Tile};
use super::shared::Shared;
use std::io;
use std::net::{TcpStream, ToSocketAddrs};
use std::sync::Arc;
use std::time::Duration;
use tev_client::{PacketCreateImage, PacketUpdateImage, TevClient};

/// Interval for checking the canvas.
const INTERVAL: Duration = Duration::from_millis(200);
/// Timeout of connecting and of writing.
const PATIENCE: Duration = Duration::from_secs(5);

/// A stream to the first address that answers.
pub(super) fn open_stream(address: &str) -> io::Result<TcpStream> {
    let mut error = io::Error::other("no such host");
    for address in address.to_socket_addrs()? {
        match TcpStream::connect_timeout(&address, PATIENCE) {
            Ok(stream) => return Ok(stream),
            Err(e) => error = e,
        }
    }
    Err(error)
}

/// An image in tev.
struct Shown {
    canvas: Arc<Canvas>,
    /// The state that tev has.
    version: u64,
}

/// A connection to tev.
pub(super) struct Tev(TevClient);

impl Tev {
    /// Connects by a stream, which can also end the connection.
    pub(super) fn new(stream: &TcpStream) -> io::Result<Self> {
        stream.set_write_timeout(Some(PATIENCE))?;
        stream.set_nodelay(true)?;
        Ok(Tev(TevClient::wrap(stream.try_clone()?)))
    }

    /// Sends changes until the program ends. Without tev, rendering continues.
    pub(super) fn run(mut self, shared: &Shared, warn: fn(&str)) {
        let mut shown = None;
        let mut allowance = Allowance::new();
        loop {
            let is_closing = shared.is_closing();
            if let Err(error) = self.show(shared, &mut shown, &mut allowance) {
                return warn(&format!("warning: tev is gone ({error}); the image is rendered without it"));
            }
            if is_closing {
                return;
            }
            std::thread::sleep(INTERVAL);
        }
    }

    /// Sends the changes of the previous image and of the current one.
    fn show(&mut self, shared: &Shared, shown: &mut Option<Shown>, allowance: &mut Allowance) -> io::Result<()> {
        // A new image: finish the previous one, and create it in tev
        if let Some(present) = shared.canvas()
            && shown.as_ref().is_none_or(|shown| !Arc::ptr_eq(&shown.canvas, &present))
        {
            if let Some(former) = shown {
                self.update(&former.canvas, former.version, || ())?;
            }
            self.0.send(PacketCreateImage {
                image_name: &present.name,
                grab_focus: true,
                width: present.size[0],
                height: present.size[1],
                channel_names: &present.channels,
            })?;
            *shown = Some(Shown { canvas: present, version: 0 });
        }

        // Changes of the current image
        let Some(Shown { canvas, version }) = shown else { return Ok(()) };
        let rest = || {
            if !shared.is_closing() {
                std::thread::sleep(allowance.rest())
            }
        };
        *version = self.update(canvas, *version, rest)?;
        Ok(())
    }

    /// Sends the changes since a state, and returns the new state of tev. Calls `rest` in between.
    fn update(&mut self, canvas: &Canvas, since: u64, mut rest: impl FnMut()) -> io::Result<u64> {
        // All channels are interleaved in one buffer
        let offsets: Vec<u64> = (0..canvas.channels.len() as u64).collect();
        let strides = vec![canvas.channels.len() as u64; canvas.channels.len()];
        let (mut sent, present) = (since, canvas.version());
        // Tiles
        while sent < present {
            let Changes { reached, changed } = canvas.changed_since(sent);
            for Tile { place: [x, y, width, height], data } in changed {
                self.0.send(PacketUpdateImage {
                    image_name: &canvas.name,
                    grab_focus: false,
                    channel_names: &canvas.channels,
                    channel_offsets: &offsets,
                    channel_strides: &strides,
                    x,
                    y,
                    width,
                    height,
                    data: &data,
                })?;
            }
            sent = reached;
            rest();
        }
        Ok(sent)
    }
}
