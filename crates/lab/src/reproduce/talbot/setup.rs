//! Data shared by all figures.

use super::scenes::Scenes;
use crate::reproduce::{Observer, Options, ReproduceError};

/// Maximum number of pixels along an edge of an image: normal and quick.
const SIZE: [u32; 2] = [400, 160];

/// Options, scenes and size of the images.
pub(super) struct Setup<'a> {
    pub(super) options: &'a Options,
    pub(super) observer: Observer<'a>,
    pub(super) scenes: Scenes,
    pub(super) size: u32,
}

impl<'a> Setup<'a> {
    /// Generates the scenes unless the options name others.
    pub(super) fn new(options: &'a Options, observer: Observer<'a>) -> Result<Self, ReproduceError> {
        let size = options.size.unwrap_or(SIZE[usize::from(options.quick)]);
        Ok(Setup { options, observer, scenes: Scenes::new(options)?, size })
    }
}

/// Width and height of an image of the statue whose longer edge has `size` pixels.
pub(super) fn portrait(size: u32) -> [u32; 2] {
    [(size * 3 / 4).max(1), size]
}
