//! Display colours by OpenColorIO.
#![allow(unsafe_code)]

use super::shim::{api, c_text, call, text};
use crate::imaging::file::ImageError;
use std::ffi::c_char;

/// A view of an OpenColorIO configuration.
#[derive(Clone, Copy, Debug)]
pub struct OcioView<'a> {
    /// Colour space of the pixels.
    pub input: &'a str,
    /// Display; the configuration's default if it is empty.
    pub display: &'a str,
    /// View; the display's default if it is empty.
    pub view: &'a str,
    /// Looks; the view's own if it is empty.
    pub looks: &'a str,
}

/// Converts RGB triples to the colours of a display, by the configuration in the environment variable OCIO. Returns
/// display and view.
pub fn ocio_display(pixels: &mut [f32], view: &OcioView<'_>) -> Result<[String; 2], ImageError> {
    let api = api()?;
    let [input, display, name, looks] =
        [view.input, view.display, view.view, view.looks].map(|text| c_text(text).map_err(ImageError::Color));
    let (input, display, name, looks) = (input?, display?, name?, looks?);
    let mut chosen = [0 as c_char; 512];
    let (data, count, chosen_size) = (pixels.as_mut_ptr(), pixels.len() as u64, chosen.len());
    // SAFETY: the names end in a zero byte, `data` holds `count` floats, and `chosen` `chosen_size` bytes.
    call(|e, n| unsafe {
        let [input, display, name, looks] = [&input, &display, &name, &looks].map(|text| text.as_ptr());
        (api.ocio_display)(input, display, name, looks, data, count, chosen.as_mut_ptr(), chosen_size, e, n)
    })
    .map_err(|failure| ImageError::Color(failure.message))?;
    let chosen = text(chosen.as_ptr());
    let (display, view) = chosen.split_once('\n').unwrap_or((&chosen, ""));
    Ok([display.to_owned(), view.to_owned()])
}
