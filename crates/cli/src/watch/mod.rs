//! Watching an image while it converges: in tev ([`tev`]), and on a web page ([`server`]).
//!
//! Render threads store their tiles in a [`Canvas`](canvas::Canvas), which shares their sums, and never wait. One
//! thread per viewer computes pixels of the changed tiles and sends them, within an [`Allowance`](allowance::Allowance)
//! of CPU time.

mod allowance;
mod canvas;
mod connections;
mod preview;
mod server;
mod shared;
mod tev;

pub(crate) use canvas::Canvas;
pub(crate) use connections::{Places, Watch, observe};
pub(crate) use preview::preview;
