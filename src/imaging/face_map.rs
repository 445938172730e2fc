//! Textures of the faces of a mesh, as in Ptex files.
//!
//! Each face has its own pyramid. Level ℓ has 2^(u−ℓ) × 2^(v−ℓ) texels, at least one. Its texels are means of two or
//! four texels of level ℓ − 1. A lookup is a cubic B-spline over the texels of one level. It continues across the edges
//! of the face into its neighbours; if an edge has no neighbour, the texels at the edge are repeated.

use super::ColorEncoding;
use super::texels::NearestByte;
use lumiris_formats::ptex::{Neighbor, PtexFace, PtexFile, PtexTexels};
use lumiris_numbers::math::{Rgb, Vec2};

/// Maximum ratio of the filter widths along both axes, in texels of the level. For a larger ratio a coarser level is
/// used.
const MOST_ANISOTROPY: f32 = 4.0;
/// Maximum number of edges crossed on the way to a texel: two at a corner, and some more where faces are narrow.
const MOST_CROSSINGS: usize = 4;

/// The textures of all faces.
#[derive(Clone, Debug)]
pub struct FaceMap {
    /// `first` is the index of the first texel of level 0; the other levels follow.
    faces: Vec<PtexFace>,
    /// One or three.
    channels: usize,
    texels: PtexTexels,
    /// Linear values of the bytes.
    table: Box<[f32; 256]>,
}

/// Columns and rows of level `level` of a face.
fn size_of(log2: [u8; 2], level: usize) -> [usize; 2] {
    log2.map(|log2| 1 << usize::from(log2).saturating_sub(level))
}

impl FaceMap {
    /// The pyramids of a file with the given encoding.
    pub fn new(file: PtexFile, encoding: ColorEncoding) -> Self {
        let PtexFile { mut faces, channels, texels } = file;
        let table = Box::new(encoding.byte_table());
        let texels = match texels {
            PtexTexels::Bytes(base) => {
                let nearest = NearestByte::new(&table);
                let (read, write) = (|byte: u8| table[usize::from(byte)], |v: f32| nearest.of(v));
                PtexTexels::Bytes(with_levels(&mut faces, channels, &base, read, write))
            }
            PtexTexels::Floats(base) => {
                let base: Vec<f32> = base.iter().map(|&v| encoding.to_linear(v)).collect();
                PtexTexels::Floats(with_levels(&mut faces, channels, &base, |v| v, |v| v))
            }
        };
        FaceMap { faces, channels, texels, table }
    }

    /// Memory of faces and texels (bytes).
    pub fn bytes(&self) -> usize {
        let texels = match &self.texels {
            PtexTexels::Bytes(v) => v.len(),
            PtexTexels::Floats(v) => size_of_val(v.as_slice()),
        };
        texels + size_of_val(self.faces.as_slice())
    }

    /// The linear colour at `uv` of a face, for a filter of `width` in u and v, which is limited to the face. Grey if
    /// there is one channel, black if there is no such face.
    pub fn value(&self, face: u32, uv: Vec2, width: Vec2) -> Rgb {
        let Some(PtexFace { log2, .. }) = self.faces.get(face as usize) else { return Rgb::BLACK };
        // NaN counts as 0
        let width = [width.x, width.y].map(|w| if w > 0.0 { w.min(1.0) } else { 0.0 });
        let texels: [f32; 2] = std::array::from_fn(|a| (width[a] * (1_u32 << log2[a]) as f32).max(1.0));
        let finest = texels[0].min(texels[1]).max(texels[0].max(texels[1]) / MOST_ANISOTROPY);
        let level = finest.log2() as usize;
        let size = size_of(*log2, level);
        let uv = [uv.x, uv.y].map(|x| if x > 0.0 { x.min(1.0) } else { 0.0 });
        let [columns, rows] = std::array::from_fn(|a| Taps::new(uv[a] * size[a] as f32, width[a] * size[a] as f32));
        let mut sum = Rgb::BLACK;
        for (j, row_weight) in rows.iter() {
            for (i, weight) in columns.iter() {
                sum += self.texel(face, [i, j], (size, level)) * (row_weight * weight);
            }
        }
        sum * (1.0 / (columns.sum * rows.sum))
    }

    /// The texel at column and row `at` of a level of a face. `at` may be outside the face.
    fn texel(&self, face: u32, at: [i32; 2], (size, level): ([usize; 2], usize)) -> Rgb {
        let is_inside = (0..2).all(|a| (0..size[a] as i32).contains(&at[a]));
        if is_inside {
            return self.color(&self.faces[face as usize], level, [at[0] as usize, at[1] as usize]);
        }
        let centre = std::array::from_fn(|a| (at[a] as f32 + 0.5) / size[a] as f32);
        let (face, uv) = self.across(face, centre);
        let face = &self.faces[face as usize];
        // The level with texels of a similar size
        let finest = |size: [usize; 2]| size[0].max(size[1]).ilog2() as usize;
        let level = usize::from(face.log2[0].max(face.log2[1])).saturating_sub(finest(size));
        let size = size_of(face.log2, level);
        self.color(face, level, std::array::from_fn(|a| ((uv[a] * size[a] as f32) as usize).min(size[a] - 1)))
    }

    /// The face that contains the point `uv`, which may be outside the given face, and its coordinates there.
    fn across(&self, mut face: u32, mut uv: [f32; 2]) -> (u32, [f32; 2]) {
        for _ in 0..MOST_CROSSINGS {
            let [u, v] = uv;
            // Position along the edge, counter-clockwise, and distance from it
            let (edge, along, beyond) = match uv {
                _ if u < 0.0 => (3, 1.0 - v, -u),
                _ if u > 1.0 => (1, v, u - 1.0),
                _ if v < 0.0 => (0, u, -v),
                _ if v > 1.0 => (2, 1.0 - u, v - 1.0),
                _ => return (face, uv),
            };
            match self.faces[face as usize].neighbors[edge] {
                Some(neighbor) => {
                    uv = entered(neighbor, 1.0 - along, beyond);
                    face = neighbor.face;
                }
                None => uv[1 - edge % 2] = uv[1 - edge % 2].clamp(0.0, 1.0),
            }
        }
        (face, uv.map(|x| x.clamp(0.0, 1.0)))
    }

    fn color(&self, face: &PtexFace, level: usize, [x, y]: [usize; 2]) -> Rgb {
        let texel = if face.is_constant {
            0
        } else {
            let before: usize = (0..level).map(|level| size_of(face.log2, level).iter().product::<usize>()).sum();
            before + y * size_of(face.log2, level)[0] + x
        };
        let i = (face.first + texel) * self.channels;
        let number = |c: usize| match &self.texels {
            PtexTexels::Bytes(v) => self.table[usize::from(v[i + c])],
            PtexTexels::Floats(v) => v[i + c],
        };
        if self.channels == 1 { Rgb::splat(number(0)) } else { Rgb::from_array([0, 1, 2].map(number)) }
    }
}

/// The point of a neighbour at the distance `inside` from its edge and the position `along` on it, counter-clockwise.
fn entered(neighbor: Neighbor, along: f32, inside: f32) -> [f32; 2] {
    match neighbor.edge {
        0 => [along, inside],
        1 => [1.0 - inside, along],
        2 => [1.0 - along, 1.0 - inside],
        _ => [inside, 1.0 - along],
    }
}

/// All levels of all faces. Sets `first` of every face to its first texel in the result.
fn with_levels<T: Copy>(
    faces: &mut [PtexFace],
    channels: usize,
    base: &[T],
    read: impl Fn(T) -> f32,
    write: impl Fn(f32) -> T,
) -> Vec<T> {
    let mut out = Vec::with_capacity(base.len() + base.len() / 3 + faces.len() * channels);
    for face in faces {
        let count = if face.is_constant { 1 } else { size_of(face.log2, 0).iter().product() };
        let texels = &base[face.first * channels..][..count * channels];
        face.first = out.len() / channels;
        out.extend_from_slice(texels);
        if face.is_constant {
            continue;
        }
        let mut finer = out.len() - texels.len();
        for level in 1..=usize::from(face.log2[0].max(face.log2[1])) {
            let ([fine_columns, fine_rows], [columns, rows]) =
                (size_of(face.log2, level - 1), size_of(face.log2, level));
            let start = out.len();
            for (y, x) in (0..rows).flat_map(|y| (0..columns).map(move |x| (y, x))) {
                for c in 0..channels {
                    // A single row or column counts twice
                    let at = |dx: usize, dy: usize| {
                        let x = (2 * x + dx).min(fine_columns - 1);
                        let y = (2 * y + dy).min(fine_rows - 1);
                        read(out[finer + (y * fine_columns + x) * channels + c])
                    };
                    let mean = 0.25 * (at(0, 0) + at(1, 0) + (at(0, 1) + at(1, 1)));
                    out.push(write(mean));
                }
            }
            finer = start;
        }
    }
    out
}

/// Texels along an axis with the weights of a cubic B-spline.
struct Taps {
    first: i32,
    weights: [f32; Taps::MOST],
    count: usize,
    sum: f32,
}

impl Taps {
    /// Maximum number of texels: 4 per texel of the width, which is below 2·[`MOST_ANISOTROPY`].
    const MOST: usize = 8 * MOST_ANISOTROPY as usize + 1;

    /// Centred at `x`, for a filter of `width`, at least one (texels).
    fn new(x: f32, width: f32) -> Self {
        let scale = width.max(1.0);
        let (center, reach) = (x - 0.5, 2.0 * scale);
        let first = (center - reach).ceil() as i32;
        let mut taps = Taps { first, weights: [0.0; Taps::MOST], count: 0, sum: 0.0 };
        while taps.count < Taps::MOST && (first + taps.count as i32) as f32 <= center + reach {
            let weight = spline(((first + taps.count as i32) as f32 - center) / scale);
            taps.weights[taps.count] = weight;
            taps.sum += weight;
            taps.count += 1;
        }
        taps
    }

    fn iter(&self) -> impl Iterator<Item = (i32, f32)> + '_ {
        self.weights[..self.count].iter().enumerate().map(|(k, &weight)| (self.first + k as i32, weight))
    }
}

/// The uniform cubic B-spline, up to a factor.
fn spline(x: f32) -> f32 {
    let x = x.abs();
    if x < 1.0 { 4.0 + x * x * (3.0 * x - 6.0) } else { (2.0 - x).max(0.0).powi(3) }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A smooth function of the plane that is not a polynomial.
    fn landscape([x, y]: [f32; 2]) -> f32 {
        0.5 + 0.25 * (3.0 * x + 1.0).sin() * (2.0 * y).cos() + 0.1 * x * y
    }

    /// Rotates a point of the unit square by quarter turns of its (u, v) axes.
    fn turned([u, v]: [f32; 2], quarters: usize) -> [f32; 2] {
        (0..quarters).fold([u, v], |[u, v], _| [1.0 - v, u])
    }

    /// A grid of 4 × 4 faces of 2^`log2` texels over [0, 4]², each rotated by `turn(column, row)` quarter turns.
    fn grid(log2: u8, turn: impl Fn(i32, i32) -> usize) -> FaceMap {
        let turn = |i: i32, j: i32| turn(i, j) % 4;
        let mut texels = Vec::new();
        let mut faces = Vec::new();
        for (j, i) in (0..4).flat_map(|j| (0..4).map(move |i| (j, i))) {
            let n = 1 << log2;
            let first = texels.len();
            for (y, x) in (0..n).flat_map(|y| (0..n).map(move |x| (y, x))) {
                let [u, v] = turned([(x as f32 + 0.5) / n as f32, (y as f32 + 0.5) / n as f32], turn(i, j));
                texels.push(landscape([i as f32 + u, j as f32 + v]));
            }
            // Edge e of a face rotated by q is side (e + q) mod 4 of its square
            let neighbors = std::array::from_fn(|edge| {
                let side = (edge + turn(i, j)) % 4;
                let (i, j) = [(i, j - 1), (i + 1, j), (i, j + 1), (i - 1, j)][side];
                let is_there = (0..4).contains(&i) && (0..4).contains(&j);
                let edge = ((side + 2 + 4 - if is_there { turn(i, j) } else { 0 }) % 4) as u8;
                is_there.then_some(Neighbor { face: (4 * j + i) as u32, edge })
            });
            faces.push(PtexFace { first, log2: [log2; 2], is_constant: false, neighbors });
        }
        let file = PtexFile { faces, channels: 1, texels: PtexTexels::Floats(texels) };
        FaceMap::new(file, ColorEncoding::Linear)
    }

    #[test]
    fn filters_go_over_edges_and_corners_however_faces_are_turned() {
        let straight = grid(3, |_, _| 0);
        let mixed = grid(3, |i, j| (3 * i + 5 * j + i * j) as usize);
        let turn = |i: i32, j: i32| (3 * i + 5 * j + i * j) as usize % 4;
        let mut largest = 0.0_f32;
        for width in [0.0, 0.2, 0.5] {
            for (i, j) in [(1, 1), (2, 1), (1, 2), (2, 2)] {
                for uv in [[0.01, 0.02], [0.99, 0.03], [0.5, 0.98], [0.97, 0.96], [0.4, 0.7], [0.02, 0.5]] {
                    let at = Vec2::from(turned(uv, turn(i, j)));
                    let (a, b) = ((4 * j + i) as u32, Vec2::splat(width));
                    let is = mixed.value(a, Vec2::from(uv), b).r;
                    let should = straight.value(a, at, b).r;
                    assert!((is - should).abs() < 1e-5, "face {i}, {j} at {uv:?}, width {width}: {is} for {should}");
                    if width == 0.0 {
                        largest = largest.max((should - landscape([i as f32 + at.x, j as f32 + at.y])).abs());
                    }
                }
            }
        }
        // Half the variance of the spline, 1/3 texel², times the sum of the second derivatives, which is at most 3.5
        assert!(largest < 0.5 / 3.0 / 64.0 * 3.5, "{largest}");
    }

    #[test]
    fn a_lookup_over_the_edge_of_a_seam_has_no_step() {
        let map = grid(2, |i, j| (i + 2 * j) as usize);
        let turn = |i: i32, j: i32| (i + 2 * j) as usize % 4;
        // The point of a face at (u, v) of its square: rotated back
        let at = |i: i32, j: i32, uv: [f32; 2]| {
            let uv = turned(uv, 4 - turn(i, j));
            map.value((4 * j + i) as u32, Vec2::from(uv), Vec2::ZERO).r
        };
        for v in [0.1, 0.3, 0.55, 0.9] {
            assert!((at(1, 1, [0.99999, v]) - at(2, 1, [0.00001, v])).abs() < 1e-4);
            assert!((at(1, 1, [v, 0.99999]) - at(1, 2, [v, 0.00001])).abs() < 1e-4);
        }
    }

    #[test]
    fn faces_of_one_colour_meet_their_neighbors_at_the_edge_alone() {
        // Two faces of 8 × 8 texels side by side. The right one has a constant colour, stored as one texel or as 64
        let map = |is_constant: bool| {
            let beyond = |edge: usize, face: u32, of: u8| {
                std::array::from_fn(|e| (e == edge).then_some(Neighbor { face, edge: of }))
            };
            let left = PtexFace { first: 0, log2: [3, 3], is_constant: false, neighbors: beyond(1, 1, 3) };
            let right = PtexFace { first: 64, log2: [3, 3], is_constant, neighbors: beyond(3, 0, 1) };
            let mut texels: Vec<f32> = (0..64).map(|i| i as f32 / 63.0).collect();
            texels.resize(64 + if is_constant { 1 } else { 64 }, 5.0);
            let file = PtexFile { faces: vec![left, right], channels: 1, texels: PtexTexels::Floats(texels) };
            FaceMap::new(file, ColorEncoding::Linear)
        };
        let (one, all) = (map(true), map(false));
        for (face, width) in [(0, 0.0), (1, 0.0), (0, 0.4), (1, 0.4), (0, 1.0), (1, 1.0)] {
            for uv in [[0.01, 0.3], [0.5, 0.5], [0.99, 0.8], [0.2, 0.99]] {
                let [a, b] = [&one, &all].map(|map| map.value(face, Vec2::from(uv), Vec2::splat(width)).r);
                assert!((a - b).abs() < 1e-5, "face {face} at {uv:?}, width {width}: {a} and {b}");
            }
        }
        assert!((one.value(1, Vec2::splat(0.5), Vec2::ZERO).r - 5.0).abs() < 1e-5);
        assert!(one.value(1, Vec2::new(0.01, 0.5), Vec2::ZERO).r < 4.0);
    }

    #[test]
    fn levels_are_means_and_wide_filters_see_the_whole_face() {
        let texels: Vec<u8> = (0..32).map(|i| if i % 2 == 0 { 10 } else { 210 }).collect();
        let face = PtexFace { first: 0, log2: [3, 2], is_constant: false, neighbors: [None; 4] };
        let file = PtexFile { faces: vec![face], channels: 1, texels: PtexTexels::Bytes(texels) };
        let map = FaceMap::new(file, ColorEncoding::Linear);
        let wide = map.value(0, Vec2::new(0.3, 0.6), Vec2::splat(1e3)).r;
        assert!((wide - 110.0 / 255.0).abs() < 1e-6, "{wide}");
        // Means are taken of linear values and stored with the same encoding
        let file = PtexFile { faces: vec![face], channels: 1, texels: PtexTexels::Bytes([0, 255].repeat(16)) };
        let map = FaceMap::new(file, ColorEncoding::Srgb);
        let wide = map.value(0, Vec2::splat(0.5), Vec2::splat(1.0)).r;
        assert!((wide - 0.5).abs() < 0.005, "{wide}");
        assert_eq!(map.value(7, Vec2::ZERO, Vec2::ZERO), Rgb::BLACK);
        assert!(map.value(0, Vec2::NAN, Vec2::NAN).r.is_finite());
    }

    #[test]
    fn narrow_footprints_keep_what_varies_along_the_narrow_axis() {
        // Alternating columns: a filter that is wide only along v preserves them
        let texels: Vec<f32> = (0..64 * 64).map(|i| f32::from(u8::from(i % 64 / 4 % 2 == 0))).collect();
        let face = PtexFace { first: 0, log2: [6, 6], is_constant: false, neighbors: [None; 4] };
        let file = PtexFile { faces: vec![face], channels: 1, texels: PtexTexels::Floats(texels) };
        let map = FaceMap::new(file, ColorEncoding::Linear);
        let contrast = |width: Vec2| {
            let at = |x: f32| map.value(0, Vec2::new(x / 64.0, 0.5), width).r;
            at(34.0) - at(38.0)
        };
        assert!(contrast(Vec2::new(1.0, 4.0) / 64.0) > 0.8);
        assert!(contrast(Vec2::new(16.0, 1.0) / 64.0).abs() < 0.05);
    }
}
