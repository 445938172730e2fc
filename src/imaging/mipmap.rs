//! Image pyramids for filtered lookups.
//!
//! Level 0 is the image. Each further level halves both sides, rounding down, to one pixel; its values are exact area
//! means (a box filter over possibly fractional pixels). Alternatively a file provides all levels. Texture coordinates
//! (s, t) are 0..1 from the **top left**; callers with t upwards flip it. A filter of width w in (s, t) reads the level
//! ℓ = levels − 1 + log₂ w, as in pbrt-v4.

use super::file::ImageError;
use super::file_tiles::FileTexels;
use super::oiio::{ImageFile, Values};
use super::texels::{Level, NearestByte, Texels};
use super::tiles::TileStore;
use super::{ColorEncoding, Image};
use lumiris_numbers::math::{DVec2, Rgb, Vec2, scalar};
use std::sync::Arc;

/// Wrap mode: values outside the image.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Wrap {
    /// The image repeats.
    #[default]
    Repeat,
    /// Zero.
    Black,
    /// The nearest pixel.
    Clamp,
    /// The unfolded octahedron: an edge is joined to itself, mirrored about its midpoint.
    OctahedralSphere,
    /// A wrap mode for each axis.
    Axes([AxisWrap; 2]),
}

/// Wrap mode of one axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AxisWrap {
    /// The image repeats.
    Repeat,
    /// The image alternates with its mirror image.
    Mirror,
    /// The nearest pixel.
    Clamp,
}

impl Wrap {
    /// The wrap mode of each axis, if the axes are independent.
    fn axes(self) -> Option<[AxisWrap; 2]> {
        match self {
            Wrap::Repeat => Some([AxisWrap::Repeat; 2]),
            Wrap::Clamp => Some([AxisWrap::Clamp; 2]),
            Wrap::Axes(axes) => Some(axes),
            Wrap::Black | Wrap::OctahedralSphere => None,
        }
    }
}

impl AxisWrap {
    /// The pixel in 0..`count` for the index `i`. Panics if `count` is 0.
    #[inline]
    pub fn pixel(self, i: i64, count: i64) -> i64 {
        if (0..count).contains(&i) {
            return i;
        }
        match self {
            AxisWrap::Repeat => i.rem_euclid(count),
            AxisWrap::Mirror => {
                let i = i.rem_euclid(2 * count);
                if i < count { i } else { 2 * count - 1 - i }
            }
            AxisWrap::Clamp => i.clamp(0, count - 1),
        }
    }
}

/// The filter of a lookup.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Filter {
    /// The nearest pixel of the level below the filter's width.
    Point,
    /// Bilinear in the level below the filter's width.
    #[default]
    Bilinear,
    /// Bilinear in two levels, linear between them.
    Trilinear,
    /// Implemented as [`Filter::Trilinear`] with the mean width of the footprint's axes. An anisotropic kernel is not
    /// needed, since the pixel integrates over the footprint.
    Ewa,
}

/// How lookups find and filter texels, and the encoding of these.
#[derive(Clone, Copy, Debug)]
pub struct Lookup {
    /// Texels beyond the edges.
    pub wrap: Wrap,
    /// Filter.
    pub filter: Filter,
    /// Encoding of the image.
    pub encoding: ColorEncoding,
}

/// A pyramid of an image of one or three channels.
#[derive(Clone, Debug)]
pub struct MipMap {
    pub(super) levels: Vec<Level>,
    pub(super) channels: usize,
    pub(super) wrap: Wrap,
    pub(super) filter: Filter,
    /// Linear values of the bytes.
    pub(super) table: Box<[f32; 256]>,
}

impl MipMap {
    /// The pyramid of an image's colour channels (see [`Image::color_channels`]). If all values are multiples of 1/255
    /// in 0..1, they are stored as bytes. An image without pixels or channels is one black pixel.
    pub fn new(image: &Image, wrap: Wrap, filter: Filter, encoding: ColorEncoding) -> Self {
        let Some(channels) = image.color_channels() else { return Self::constant(0.0, wrap, filter) };
        let channels = channels.as_slice();
        let pixels = image.data.chunks_exact(image.channels.len());
        let values = pixels.flat_map(|pixel| channels.iter().map(|&c| pixel[c])).collect();
        let lookup = Lookup { wrap, filter, encoding };
        Self::of_values(Values::Floats(values), [image.width, image.height], channels.len(), lookup)
    }

    /// The pyramid of the values of an image of one or three channels. Floats are stored as bytes if all are multiples
    /// of 1/255 in 0..1, as read from 8 bits. An image without pixels is one black pixel.
    pub fn of_values(values: Values, size: [usize; 2], channels: usize, lookup: Lookup) -> Self {
        let Lookup { wrap, filter, encoding } = lookup;
        if size.contains(&0) {
            return Self::constant(0.0, wrap, filter);
        }
        let texels = match values {
            Values::Bytes(bytes) => Texels::Bytes(bytes),
            Values::Floats(values) => Texels::of_floats(values, encoding),
        };
        Self::with_base(Level::new(size, texels), channels, wrap, filter, Box::new(encoding.byte_table()))
    }

    /// The pyramid in a file, of one or three channels with the given positions and encoding. 8-bit values are stored
    /// as bytes. With a `store`, levels of more than a tile are read on demand.
    pub fn of_file(
        file: ImageFile,
        channels: Vec<usize>,
        Lookup { wrap, filter, encoding }: Lookup,
        store: Option<&Arc<TileStore>>,
    ) -> Result<Self, ImageError> {
        let (table, count) = (Box::new(encoding.byte_table()), channels.len());
        let texels = FileTexels { file: Arc::new(file), channels, encoding };
        let level = |index: usize| match store {
            Some(store) => texels.tiled_level(index, store),
            None => texels.level(index),
        };
        let levels = (0..texels.file.sizes().len()).map(level).collect::<Result<_, ImageError>>()?;
        Ok(MipMap { levels, channels: count, wrap, filter, table })
    }

    /// One pixel of one channel.
    pub fn constant(value: f32, wrap: Wrap, filter: Filter) -> Self {
        let level = Level::new([1, 1], Texels::Floats(vec![value]));
        Self::with_base(level, 1, wrap, filter, Box::new(ColorEncoding::Linear.byte_table()))
    }

    fn with_base(base: Level, channels: usize, wrap: Wrap, filter: Filter, table: Box<[f32; 256]>) -> Self {
        let mut map = MipMap { levels: vec![base], channels, wrap, filter, table };
        let nearest = NearestByte::new(&map.table);
        while let Some(next) = map.halve(&nearest) {
            map.levels.push(next);
        }
        map
    }

    /// The next coarser level; `None` at one pixel. Byte levels stay bytes, by the inverse of the table.
    fn halve(&self, nearest: &NearestByte) -> Option<Level> {
        // Size of the level
        let source = self.levels.last()?;
        if source.width == 1 && source.height == 1 {
            return None;
        }
        let (width, height) = ((source.width / 2).max(1), (source.height / 2).max(1));

        // Area means, in the storage of the finer level
        let texels = match source.texels {
            Texels::Floats(_) | Texels::Tiled(_) => Texels::Floats(self.means([width, height], |v| v)),
            Texels::Bytes(_) => Texels::Bytes(self.means([width, height], |v| nearest.of(v))),
        };
        Some(Level::new([width, height], texels))
    }

    /// Area means of the coarsest level over `width` × `height` pixels, stored by `store`.
    fn means<T>(&self, [width, height]: [usize; 2], store: impl Fn(f32) -> T) -> Vec<T> {
        let Some(source) = self.levels.last() else { return Vec::new() };
        let columns: Vec<_> = (0..width).map(|x| overlaps(x, width, source.width)).collect();
        let mut values = Vec::with_capacity(width * height * self.channels);
        for y in 0..height {
            let rows = overlaps(y, height, source.height);
            for columns in &columns {
                for c in 0..self.channels {
                    let mut sum = 0.0_f64;
                    for row in &rows {
                        for column in columns {
                            let texel = source.texel([column.pixel, row.pixel], c, self.channels, &self.table);
                            sum += f64::from(row.fraction * column.fraction * texel);
                        }
                    }
                    values.push(store(sum as f32));
                }
            }
        }
        values
    }

    /// Columns and rows of level 0.
    pub fn resolution(&self) -> [usize; 2] {
        [self.levels[0].width, self.levels[0].height]
    }

    /// One or three.
    pub fn channels(&self) -> usize {
        self.channels
    }

    /// Number of levels.
    pub fn levels(&self) -> usize {
        self.levels.len()
    }

    /// The store of its tiles, if it has any.
    pub fn store(&self) -> Option<&Arc<TileStore>> {
        self.levels[0].store()
    }

    /// Memory of the pixels without tiles (bytes).
    pub fn bytes(&self) -> usize {
        self.levels.iter().map(Level::bytes).sum()
    }

    /// Linear colour of a pixel of a level, with the wrap mode applied; grey if the map has one channel. Panics if
    /// there is no such level.
    pub fn texel(&self, level: usize, x: i64, y: i64) -> Rgb {
        let level = &self.levels[level];
        let Some(pixel) = self.wrap_pixel(level, x, y) else { return Rgb::BLACK };
        let [color] = level.colors([pixel], self.channels, &self.table);
        color
    }

    /// The pixel inside the image that corresponds to (x, y).
    fn wrap_pixel(&self, level: &Level, x: i64, y: i64) -> Option<[usize; 2]> {
        let (w, h) = (level.width as i64, level.height as i64);
        if let Some([of_x, of_y]) = self.wrap.axes() {
            return Some([of_x.pixel(x, w), of_y.pixel(y, h)].map(|i| i as usize));
        }
        let is_inside = (0..w).contains(&x) && (0..h).contains(&y);
        if is_inside || self.wrap == Wrap::Black {
            return is_inside.then_some([x as usize, y as usize]);
        }
        // Each step over an edge of the octahedron mirrors the other axis. Lookups go at most one image beyond an edge
        let (mut x, mut y) = (x, y);
        if x < 0 || x >= w {
            x = if x < 0 { -1 - x } else { 2 * w - 1 - x };
            y = h - 1 - y;
        }
        if y < 0 || y >= h {
            x = w - 1 - x;
            y = if y < 0 { -1 - y } else { 2 * h - 1 - y };
        }
        Some([x.clamp(0, w - 1) as usize, y.clamp(0, h - 1) as usize])
    }

    /// Bilinear interpolation between the pixel centres of level `index`.
    pub fn bilinear(&self, index: usize, st: Vec2) -> Rgb {
        let level = &self.levels[index];
        let corner = Corner::of(level, st);
        let [a, b, c, d] = match self.wrap.axes() {
            Some(axes) => {
                let [[x0, x1], [y0, y1]] = corner.pixels(level, axes);
                level.colors([[x0, y0], [x1, y0], [x0, y1], [x1, y1]], self.channels, &self.table)
            }
            None => {
                let Corner { x, y, .. } = corner;
                [[x, y], [x + 1, y], [x, y + 1], [x + 1, y + 1]].map(|[x, y]| self.texel(index, x, y))
            }
        };
        a.lerp(b, corner.fraction.x).lerp(c.lerp(d, corner.fraction.x), corner.fraction.y)
    }

    /// Requests the pixels of [`Self::bilinear`], which is called soon.
    fn prefetch_bilinear(&self, index: usize, st: Vec2) {
        let (Some(axes), Some(level)) = (self.wrap.axes(), self.levels.get(index)) else { return };
        let [[x, _], [y0, y1]] = Corner::of(level, st).pixels(level, axes);
        level.prefetch([x, y0], self.channels);
        level.prefetch([x, y1], self.channels);
    }

    fn nearest(&self, level: usize, st: Vec2) -> Rgb {
        let at = st * self.levels[level].size;
        self.texel(level, saturated(floor(at.x)), saturated(floor(at.y)))
    }

    /// `st` without whole periods of the axes on which the image repeats: an f32 then resolves the fraction, and
    /// lookups need no division.
    pub fn within_periods(&self, st: DVec2) -> Vec2 {
        let within = |wrap: AxisWrap, x: f64| if wrap == AxisWrap::Repeat { x - scalar::floor(x) } else { x };
        let [s, t] = self.wrap.axes().unwrap_or([AxisWrap::Clamp; 2]);
        Vec2::new(within(s, st.x) as f32, within(t, st.y) as f32)
    }

    /// Linear colour at `st`, filtered over `width` per axis, in units of the image. A width of 0 reads level 0.
    pub fn lookup(&self, st: Vec2, width: Vec2) -> Rgb {
        if !st.is_finite() {
            return Rgb::BLACK;
        }
        let top = self.levels.len() - 1;
        let extent = self.extent(width);
        let Some(below) = self.level_below(extent) else { return self.texel(top, 0, 0) };
        match self.filter {
            Filter::Point => self.nearest(below, st),
            Filter::Bilinear => self.bilinear(below, st),
            Filter::Trilinear | Filter::Ewa => {
                let fine = self.bilinear(below, st);
                let delta = top as f32 + extent.log2() - below as f32;
                if delta <= 0.0 { fine } else { fine.lerp(self.bilinear(below + 1, st), delta) }
            }
        }
    }

    /// Requests the pixels of [`Self::lookup`], which is called soon.
    pub fn prefetch(&self, st: Vec2, width: Vec2) {
        if let Some(below) = self.level_below(self.extent(width)).filter(|_| st.is_finite()) {
            self.prefetch_bilinear(below, st);
            if matches!(self.filter, Filter::Trilinear | Filter::Ewa) {
                self.prefetch_bilinear(below + 1, st);
            }
        }
    }

    /// Width of the filter whose value at the coarsest level is 1.
    fn extent(&self, width: Vec2) -> f32 {
        let width = width.abs();
        let extent = match self.filter {
            Filter::Point | Filter::Bilinear | Filter::Trilinear => width.max_element(),
            Filter::Ewa => 0.5 * (width.x + width.y),
        };
        // pbrt-v4 takes twice the derivative as the width of the filter
        (2.0 * extent).max(1e-8)
    }

    /// The level below the filter's width; `None` for the coarsest one.
    fn level_below(&self, extent: f32) -> Option<usize> {
        let top = self.levels.len() - 1;
        // ⌊log₂⌋ of a positive float is its exponent less 127. Just below a power of two, log₂ is rounded up to it
        let bits = extent.to_bits();
        let below = match bits & 0x7f_ff00 {
            0x7f_ff00 => (top as f32 + extent.log2()).floor() as isize,
            _ => top as isize + (bits >> 23) as isize - 127,
        };
        (below < top as isize).then(|| below.max(0) as usize)
    }
}

/// The pixel at the lower corner of a bilinear interpolation, and the position between it and the next one.
struct Corner {
    x: i64,
    y: i64,
    fraction: Vec2,
}

impl Corner {
    #[inline]
    fn of(level: &Level, st: Vec2) -> Self {
        let at = st * level.size - Vec2::splat(0.5);
        let corner = Vec2::new(floor(at.x), floor(at.y));
        Corner { x: saturated(corner.x), y: saturated(corner.y), fraction: at - corner }
    }

    /// Columns and rows of the four pixels.
    #[inline]
    fn pixels(&self, level: &Level, [of_x, of_y]: [AxisWrap; 2]) -> [[usize; 2]; 2] {
        [
            [self.x, self.x + 1].map(|x| of_x.pixel(x, level.width as i64) as usize),
            [self.y, self.y + 1].map(|y| of_y.pixel(y, level.height as i64) as usize),
        ]
    }
}

/// ⌊v⌋.
#[inline]
fn floor(v: f32) -> f32 {
    /// All floats from here on are integers.
    const WHOLE: f32 = (1 << 23) as f32;
    // Adding and subtracting rounds. Without SSE 4.1, `f32::floor` is a function call with branches that are hard to
    // predict. A cast to an integer and back would depend on the previous lookup: x86 keeps the rest of the register
    let large = WHOLE.copysign(v);
    let near = (v + large) - large;
    if v.abs() < WHOLE { near - if near > v { 1.0 } else { 0.0 } } else { v }
}

/// The integer `v`, saturated to 32 bits, so that absurd or non-finite coordinates wrap somewhere instead of
/// overflowing.
#[inline]
fn saturated(v: f32) -> i64 {
    i64::from(v as i32)
}

/// A source pixel that overlaps a pixel, and its fraction of the area.
struct Overlap {
    pixel: usize,
    fraction: f32,
}

/// Overlaps of pixel `i` of `n` over a source of `m` pixels.
fn overlaps(i: usize, n: usize, m: usize) -> Vec<Overlap> {
    // In units of 1/n source pixels all edges are integers
    let (start, end) = (i * m, (i + 1) * m);
    (start / n..end.div_ceil(n))
        .map(|pixel| {
            let overlap = end.min((pixel + 1) * n) - start.max(pixel * n);
            Overlap { pixel, fraction: overlap as f32 / m as f32 }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::super::tiles::TILE;
    use super::*;

    fn image(width: usize, height: usize, value: impl Fn(usize, usize) -> [f32; 3]) -> Image {
        let mut image = Image::new(width, height, &["R", "G", "B"]);
        for y in 0..height {
            for x in 0..width {
                for (c, v) in value(x, y).into_iter().enumerate() {
                    image.set(x, y, c, v);
                }
            }
        }
        image
    }

    fn map(image: &Image, wrap: Wrap, filter: Filter) -> MipMap {
        MipMap::new(image, wrap, filter, ColorEncoding::Linear)
    }

    #[test]
    fn coordinates_lose_whole_periods_of_axes_that_repeat() {
        let map = |wrap| MipMap::new(&image(2, 2, |x, _| [x as f32; 3]), wrap, Filter::Bilinear, ColorEncoding::Linear);
        let repeat = map(Wrap::Repeat);
        for (st, expected) in [(-0.25, 0.75), (0.25, 0.25), (7.5, 0.5), (-3.0, 0.0), (1e9 + 0.125, 0.125), (1e300, 0.0)]
        {
            let found = repeat.within_periods(DVec2::new(st, -st));
            assert_eq!(found, Vec2::new(expected, (1.0 - expected) % 1.0), "{st}");
        }
        let found = repeat.within_periods(DVec2::new(f64::NAN, f64::INFINITY));
        assert!(found.x.is_nan() && found.y.is_nan());
        for wrap in [Wrap::Clamp, Wrap::Black, Wrap::OctahedralSphere] {
            assert_eq!(map(wrap).within_periods(DVec2::new(-3.5, 7.25)), Vec2::new(-3.5, 7.25));
        }
        let mixed = map(Wrap::Axes([AxisWrap::Mirror, AxisWrap::Repeat]));
        assert_eq!(mixed.within_periods(DVec2::new(3.25, 3.25)), Vec2::new(3.25, 0.25));
    }

    #[test]
    fn every_level_keeps_the_mean_of_any_size() {
        for (w, h) in [(8, 8), (7, 5), (1, 9), (13, 1), (640, 3)] {
            let image = image(w, h, |x, y| [(x * 31 + y * 17) as f32 * 0.013, x as f32, y as f32]);
            let map = map(&image, Wrap::Repeat, Filter::Trilinear);
            assert_eq!(map.levels(), w.max(h).ilog2() as usize + 1);
            for (c, total) in [0, 1, 2].map(|c| (c, image.data.iter().skip(c).step_by(3).sum::<f32>())) {
                let mean = total / (w * h) as f32;
                let top = map.lookup(Vec2::splat(0.3), Vec2::splat(1.0));
                assert!((top[c] - mean).abs() < 1e-4 * mean.max(1.0), "{w}x{h} {c}: {} {mean}", top[c]);
            }
        }
    }

    #[test]
    fn eight_bit_images_stay_bytes_and_decode_by_their_encoding() {
        let bytes = image(4, 4, |x, y| [x as f32 * 60.0 / 255.0, y as f32 * 80.0 / 255.0, 128.0 / 255.0]);
        let map = MipMap::new(&bytes, Wrap::Clamp, Filter::Point, ColorEncoding::Srgb);
        assert_eq!(map.bytes(), 3 * (16 + 4 + 1));
        let c = map.lookup(Vec2::new(0.3, 0.8), Vec2::ZERO);
        let expected = [60.0, 240.0, 128.0].map(|b| crate::imaging::color::srgb_to_linear(b / 255.0));
        assert!((c - Rgb::from_array(expected)).to_array().iter().all(|e| e.abs() < 1e-6), "{c:?}");
        let half_float = image(4, 4, |x, _| [x as f32 * 0.3, 0.0, 0.0]);
        assert_eq!(
            MipMap::new(&half_float, Wrap::Clamp, Filter::Point, ColorEncoding::Srgb).bytes(),
            12 * (16 + 4 + 1)
        );
    }

    #[test]
    fn lookups_interpolate_between_pixel_centres_and_wrap() {
        let image = image(4, 2, |x, y| [x as f32, y as f32, 7.0]);
        let at = |wrap, s, t| map(&image, wrap, Filter::Bilinear).lookup(Vec2::new(s, t), Vec2::ZERO);
        assert_eq!(at(Wrap::Clamp, 0.125, 0.25), Rgb::new(0.0, 0.0, 7.0));
        assert_eq!(at(Wrap::Clamp, 0.25, 0.5), Rgb::new(0.5, 0.5, 7.0));
        assert_eq!(at(Wrap::Clamp, -3.0, 9.0), Rgb::new(0.0, 1.0, 7.0));
        assert_eq!(at(Wrap::Repeat, 0.0, 0.25), Rgb::new(1.5, 0.0, 7.0));
        assert_eq!(at(Wrap::Repeat, 5.125, -0.75), Rgb::new(0.0, 0.0, 7.0));
        assert_eq!(at(Wrap::Black, 0.0, 0.25).b, 3.5);
        assert_eq!(at(Wrap::Black, 1.5, 0.25), Rgb::BLACK);
        let mixed = Wrap::Axes([AxisWrap::Mirror, AxisWrap::Clamp]);
        assert_eq!(at(mixed, 1.125, 9.0), at(Wrap::Clamp, 0.875, 9.0));
        assert_eq!(at(mixed, -2.125, 9.0), at(Wrap::Clamp, 0.125, 9.0));
        let mixed = Wrap::Axes([AxisWrap::Repeat, AxisWrap::Mirror]);
        assert_eq!(at(mixed, 5.125, -0.75), at(Wrap::Clamp, 0.125, 0.75));
        assert_eq!(at(Wrap::Repeat, f32::NAN, 0.2), Rgb::BLACK);
        assert!(at(Wrap::Repeat, 1e30, -1e30).is_finite());
    }

    #[test]
    fn bilinear_lookups_are_those_of_four_texels_at_and_beyond_edges() {
        let mixed = Wrap::Axes([AxisWrap::Mirror, AxisWrap::Clamp]);
        for (w, h) in [(1, 1), (4, 4), (7, 3)] {
            let image = image(w, h, |x, y| [x as f32, y as f32, (x * y) as f32]);
            for wrap in [Wrap::Repeat, Wrap::Black, Wrap::Clamp, Wrap::OctahedralSphere, mixed] {
                let map = map(&image, wrap, Filter::Bilinear);
                for i in 0..2000 {
                    let st = Vec2::new(i as f32 * 0.0113 - 7.0, i as f32 * 0.0071 - 5.0);
                    let v = st * Vec2::new(w as f32, h as f32) - 0.5;
                    let ([x, y], d) = (v.floor().to_array().map(|i| i as i64), v - v.floor());
                    let row = |y| map.texel(0, x, y).lerp(map.texel(0, x + 1, y), d.x);
                    assert_eq!(map.lookup(st, Vec2::ZERO), row(y).lerp(row(y + 1), d.y), "{wrap:?} {st}");
                }
            }
        }
    }

    #[test]
    fn floors_are_those_of_the_standard_library() {
        for i in 0..60_000_u32 {
            for v in [f32::from_bits(i << 16), -f32::from_bits(i << 16), i as f32 * 0.25 - 7000.0].map(|v| v + 0.0) {
                let whole = v.floor();
                assert!(floor(v) == whole || v.is_nan(), "{v}");
            }
        }
    }

    #[test]
    fn octahedral_edges_join_their_mirror_image() {
        let image = image(4, 4, |x, y| [x as f32, y as f32, 0.0]);
        let map = map(&image, Wrap::OctahedralSphere, Filter::Bilinear);
        assert_eq!(map.texel(0, -1, 0), map.texel(0, 0, 3));
        assert_eq!(map.texel(0, 4, 1), map.texel(0, 3, 2));
        assert_eq!(map.texel(0, 1, -1), map.texel(0, 2, 0));
        assert_eq!(map.texel(0, 2, 4), map.texel(0, 1, 3));
        // The pixel across a corner is the opposite corner
        assert_eq!(map.texel(0, -1, -1), map.texel(0, 3, 3));
    }

    #[test]
    fn trilinear_is_continuous_in_the_width_and_ends_at_the_mean() {
        let image = image(16, 16, |x, y| [((x * 7 + y * 3) % 5) as f32, 0.0, 1.0]);
        let map = map(&image, Wrap::Repeat, Filter::Trilinear);
        let at = |w: f32| map.lookup(Vec2::new(0.41, 0.77), Vec2::splat(w)).r;
        for i in 1..2000 {
            let w = i as f32 * 2.5e-4;
            assert!((at(w) - at(w + 1e-6)).abs() < 1e-3, "{w}");
        }
        assert_eq!(at(0.0), at(1.0 / 64.0));
        let mean = image.data.iter().step_by(3).sum::<f32>() / 256.0;
        assert!((at(0.5) - mean).abs() < 1e-5);
    }

    #[test]
    fn tiles_hold_the_same_numbers() {
        // Bytes and floats, with more and less than a tile
        for (w, h) in [(200, 130), (64, 65), (64, 64), (1, 5000)] {
            let bytes = image(w, h, |x, y| [0, 1, 2].map(|c| ((x * 7 + y * 13 + c * 5) % 256) as f32 / 255.0));
            let floats = image(w, h, |x, y| [0, 1, 2].map(|c| (x * 31 + y * 17 + c) as f32 * 0.013));
            for image in [bytes, floats] {
                // The same pyramid in memory and in tiles
                let map = MipMap::new(&image, Wrap::Repeat, Filter::Trilinear, ColorEncoding::Srgb);
                let store = Arc::new(TileStore::new(200_000).unwrap());
                let tiled = map.clone().tiled(&store).unwrap();
                assert_eq!(tiled.store().is_some(), w * h > TILE * TILE);
                assert!(tiled.bytes() < map.bytes() || w * h <= TILE * TILE);

                // Compare texels and lookups
                for i in 0..3000_usize {
                    let (level, x, y) = (i % map.levels(), (i * 37 % (2 * w)) as i64, (i * 101 % (2 * h)) as i64);
                    assert_eq!(tiled.texel(level, x, y), map.texel(level, x, y));
                    let st = Vec2::new(i as f32 * 0.01, i as f32 * 0.037);
                    let width = Vec2::splat(0.001 * (i % 97) as f32);
                    assert_eq!(tiled.lookup(st, width), map.lookup(st, width));
                }
            }
        }
    }

    #[test]
    fn an_empty_image_is_black() {
        let map = MipMap::new(&Image::default(), Wrap::Repeat, Filter::Ewa, ColorEncoding::Linear);
        assert_eq!(map.lookup(Vec2::ZERO, Vec2::ONE), Rgb::BLACK);
    }
}
