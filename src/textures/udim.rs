//! UDIM: images side by side in the plane of texture coordinates. Tile 1001 + u + 10·v covers [u, u + 1) × [v, v + 1),
//! for u from 0 to 9.

use super::context::ImageId;
use lumiris_numbers::math::{DVec2, Vec2};

/// Index into [`TextureSet::udims`](super::TextureSet::udims).
pub type UdimId = u32;

/// Tiles per row.
const COLUMNS: usize = 10;
/// Number of the first tile.
const FIRST: u32 = 1001;
/// Number of the last tile.
const LAST: u32 = 9999;

/// The images of all tiles.
#[derive(Clone, Debug, Default)]
pub struct Udim {
    /// Indexed by u + 10·v.
    tiles: Vec<Option<ImageId>>,
}

impl Udim {
    /// True if this is a valid tile number.
    pub fn is_number(number: u32) -> bool {
        (FIRST..=LAST).contains(&number)
    }

    /// Sets the image of a tile. `number` must be [valid](Self::is_number).
    pub fn set(&mut self, number: u32, image: ImageId) {
        let index = (number - FIRST) as usize;
        self.tiles.resize(self.tiles.len().max(index + 1), None);
        self.tiles[index] = Some(image);
    }

    /// The tile that contains a point (t upwards); `None` where there is no tile.
    #[inline]
    pub fn tile(&self, st: DVec2) -> Option<ImageId> {
        let corner = st.floor();
        let rows = self.tiles.len().div_ceil(COLUMNS) as f64;
        let is_inside = corner.x >= 0.0 && corner.x < COLUMNS as f64 && corner.y >= 0.0 && corner.y < rows;
        let index = is_inside.then(|| corner.x as usize + COLUMNS * corner.y as usize)?;
        *self.tiles.get(index)?
    }

    /// A point relative to its tile.
    #[inline]
    pub fn within_tile(st: DVec2) -> Vec2 {
        (st - st.floor()).as_vec2()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tiles_cover_their_squares() {
        let mut udim = Udim::default();
        for (number, image) in [(1001, 7), (1002, 8), (1010, 9), (1011, 10)] {
            udim.set(number, image);
        }
        let at = |x: f64, y: f64| udim.tile(DVec2::new(x, y));
        assert_eq!([at(0.0, 0.0), at(0.99, 0.99), at(1.0, 0.5), at(9.5, 0.5)], [Some(7), Some(7), Some(8), Some(9)]);
        assert_eq!([at(0.5, 1.0), at(1.5, 1.0), at(10.5, 0.5), at(-0.1, 0.5)], [Some(10), None, None, None]);
        assert_eq!([at(0.5, -0.1), at(0.5, 1e30), at(f64::NAN, 0.5), at(2.5, 0.5)], [None; 4]);
        assert_eq!(Udim::within_tile(DVec2::new(1.25, 0.75)), Vec2::new(0.25, 0.75));
        assert!(!Udim::is_number(1000) && Udim::is_number(1001) && !Udim::is_number(10_000));
    }
}
