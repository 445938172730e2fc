//! Options for watching an image while it is rendered.

use super::UsageError;
use crate::watch::Places;
use clap::Args;
use std::net::{Ipv4Addr, SocketAddr};

/// Default port of tev.
const TEV_PORT: u16 = 14158;
/// Default port of the page.
const VIEW_PORT: u16 = 7575;

/// Options for watching.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Watching")]
pub(super) struct WatchArgs {
    /// Show the image in tev while it converges [default address: 127.0.0.1:14158]
    #[arg(
        long, value_name = "HOST[:PORT]", num_args = 0..=1, require_equals = true, default_missing_value = "127.0.0.1"
    )]
    tev: Option<String>,
    /// Show the image on a web page while it converges, at an address or a port of this machine [default:
    /// 127.0.0.1:7575]
    #[arg(
        long, value_name = "ADDRESS", num_args = 0..=1, require_equals = true, default_missing_value = "7575",
        value_parser = address
    )]
    view: Option<SocketAddr>,
    /// Allow other machines to open the page, without password or encryption
    #[arg(long, requires = "view")]
    view_insecure: bool,
}

fn address(text: &str) -> Result<SocketAddr, String> {
    if let Ok(port) = text.parse::<u16>() {
        return Ok((Ipv4Addr::LOCALHOST, port).into());
    }
    let with_port = text.parse::<SocketAddr>().or_else(|_| text.parse().map(|ip| SocketAddr::new(ip, VIEW_PORT)));
    with_port.map_err(|_| "expected an address such as 127.0.0.1:7575, or a port".to_owned())
}

impl WatchArgs {
    /// The addresses for watching. An address that other machines can reach needs `--view-insecure`.
    pub(super) fn places(&self) -> Result<Places, UsageError> {
        if let Some(address) = self.view.filter(|address| !address.ip().is_loopback() && !self.view_insecure) {
            return Err(UsageError(format!(
                "--view: whoever reaches {address} could see the image; --view-insecure allows that"
            )));
        }
        let with_port = |host: &String| if has_port(host) { host.clone() } else { format!("{host}:{TEV_PORT}") };
        Ok(Places { tev: self.tev.as_ref().map(with_port), view: self.view, insecure: self.view_insecure })
    }
}

/// True for `host:1` and `[::1]:1`, but not for `[::1]`.
fn has_port(host: &str) -> bool {
    host.rsplit_once(':').is_some_and(|(_, port)| port.parse::<u16>().is_ok())
}
