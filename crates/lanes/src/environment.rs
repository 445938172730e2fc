//! Importance sampling of directions from an environment map.
//!
//! The cumulative distributions are inverted sample by sample, since cache misses dominate: tables are read in steps,
//! and each step requests the entries of the next for all samples of a chunk. Directions and densities are computed in
//! lanes. A texel is one load of four floats. The mappings between square and sphere are in
//! [`lumiris_numbers::math::sphere_map`].

use super::lane::{Columns3, F, I, LANES, Vec3s, begin, load, or_zero, safe_sqrt, store};
use super::light::LightLanes;
use super::prefetch::{prefetch, prefetch_square};
use super::wide::{sin_cos_quadrant, sin_cos_turns};
use fearless_simd::{Level, Simd, dispatch, f32x4, f32x16, prelude::*};
use lumiris_numbers::math::distribution::{Running, STEP, clamped};
use lumiris_numbers::math::elementary::SinCos;
use lumiris_numbers::math::sphere_map::{self, pdf_equal_area_square_to_sphere};
use lumiris_numbers::math::{Mat3, ONE_MINUS_EPSILON, TexelDistribution};
use std::f32::consts::{PI, TAU};

/// An environment map with its sampling distribution.
#[derive(Clone, Copy, Debug)]
pub struct Environment<'a> {
    /// Density over the unit square.
    pub distribution: &'a TexelDistribution,
    /// Red, green, blue, and the density per unit area of the square, row by row. A border of one texel continues the
    /// image around the sphere.
    pub texels: &'a [[f32; 4]],
    /// True for the equal-area octahedral mapping, false for latitude–longitude.
    pub is_equal_area: bool,
    /// True for bilinear interpolation, false for the nearest texel.
    pub is_bilinear: bool,
    /// Orthogonal matrix for directions.
    pub world_from_light: Mat3,
    /// Factor of the radiance.
    pub scale: f32,
}

/// Samples per chunk.
const CHUNK: usize = 32;

/// One number per sample of a chunk.
type Column = [f32; CHUNK];

/// Bins of a chunk's random numbers in one dimension.
struct Places {
    bin: [i32; CHUNK],
    /// The random number minus the cumulative probability at the start of its bin.
    above: Column,
    /// Probability of the bin.
    width: Column,
}

impl Places {
    fn new() -> Self {
        Places { bin: [0; CHUNK], above: [0.0; CHUNK], width: [1.0; CHUNK] }
    }

    /// Inverts the cumulative distribution at `u`: the last bin with `cdf[i] <= u`, which is not before `first`.
    #[inline(always)]
    fn set<S: Simd>(&mut self, i: usize, simd: S, running: &Running<'_>, first: usize, u: f32) {
        let u = clamped(u);
        let at = f32x16::splat(simd, u);
        let mut bin = first;
        let bin = loop {
            let next = f32x16::from_slice(simd, &running.cdf[bin + 1..bin + 1 + STEP]);
            let passed = next.simd_le(at).to_bitmask().count_ones() as usize;
            bin += passed;
            if passed < STEP {
                break running.found(bin);
            }
        };
        self.bin[i] = bin.index as i32;
        self.above[i] = u - bin.begin;
        self.width[i] = bin.end - bin.begin;
    }

    /// Position of sample `i` within its bin, in [0, 1).
    #[inline(always)]
    fn fraction(&self, i: usize) -> f32 {
        (self.above[i] / self.width[i]).min(ONE_MINUS_EPSILON)
    }
}

/// Texels of a chunk's samples in one dimension.
struct Along {
    texel: [i32; CHUNK],
    /// Position in units of texels.
    place: Column,
}

impl Along {
    fn new() -> Self {
        Along { texel: [0; CHUNK], place: [0.0; CHUNK] }
    }

    /// Texels and positions within blocks of `edge` texels of uniform density.
    #[inline(always)]
    fn set<S: Simd>(&mut self, simd: S, i: usize, blocks: &Places, edge: usize) {
        let block = I::from_slice(simd, &blocks.bin[i..i + LANES]);
        let fraction = (load(simd, &blocks.above, i) / load(simd, &blocks.width, i)).min(ONE_MINUS_EPSILON);
        let within = fraction * edge as f32;
        let texel = within.floor().min(edge as f32 - 1.0);
        let first = block * edge as i32;
        (first + texel.to_int::<I<S>>()).store_slice(&mut self.texel[i..i + LANES]);
        store(first.to_float::<F<S>>() + within, &mut self.place, i);
    }

    #[inline(always)]
    fn texels<S: Simd>(&self, simd: S, i: usize) -> I<S> {
        I::from_slice(simd, &self.texel[i..i + LANES])
    }
}

/// Texel lookups of a chunk.
struct Lookups {
    /// Index of the sampled texel, whose fourth component is the density.
    cell: [i32; CHUNK],
    /// Index of the first of the four texels for bilinear interpolation.
    first: [i32; CHUNK],
    dx: Column,
    dy: Column,
    /// Density per unit area of the square.
    pdf_area: Column,
    /// Jacobian from density per unit area of the square to density per steradian.
    density: Column,
}

impl Lookups {
    fn new() -> Self {
        let zero = [0.0; CHUNK];
        Lookups { cell: [0; CHUNK], first: [0; CHUNK], dx: zero, dy: zero, pdf_area: zero, density: zero }
    }
}

/// A direction of a point of the square.
struct Mapped<S: Simd> {
    /// The direction before the rotation.
    w: Vec3s<S>,
    /// Density (1/sr) of a uniform point.
    density: F<S>,
}

#[inline(always)]
fn equal_area<S: Simd>(x: F<S>, y: F<S>) -> Mapped<S> {
    let simd = x.token();
    let one = F::splat(simd, 1.0);
    let (u, v) = (x * 2.0 - one, y * 2.0 - one);
    let signed_distance = one - (u.abs() + v.abs());
    let r = one - signed_distance.abs();
    let a = or_zero(r.simd_gt(F::splat(simd, 0.0)), (v.abs() - u.abs()) / r);
    let SinCos { sin: sin_phi, cos: cos_phi } = sin_cos_quadrant(a.max(-1.0).min(1.0));
    let r2 = r * r;
    let sin_theta = r * safe_sqrt(F::splat(simd, 2.0) - r2);
    let w = Vec3s {
        x: (cos_phi * sin_theta).copysign(u),
        y: (sin_phi * sin_theta).copysign(v),
        z: (one - r2).copysign(signed_distance),
    };
    Mapped { w, density: F::splat(simd, pdf_equal_area_square_to_sphere()) }
}

/// As [`equal_area`], for the latitude–longitude mapping.
#[inline(always)]
fn lat_long<S: Simd>(x: F<S>, y: F<S>) -> Mapped<S> {
    let SinCos { sin: sin_theta, cos: cos_theta } = sin_cos_turns(y * 0.5);
    let SinCos { sin: sin_phi, cos: cos_phi } = sin_cos_turns(x);
    let w = Vec3s { x: sin_theta * cos_phi, y: sin_theta * sin_phi, z: cos_theta };
    Mapped { w, density: F::splat(x.token(), 1.0) / (sin_theta * (TAU * PI)) }
}

/// Points of the square for unit directions under the equal-area octahedral mapping. Slices have the same length, a
/// multiple of [`LANES`].
pub fn equal_area_squares(level: Level, w: Columns3<'_>, out: [&mut [f32]; 2]) {
    dispatch!(level, simd => squares_lanes(simd, w, out));
}

#[inline(always)]
fn squares_lanes<S: Simd>(simd: S, w: Columns3<'_>, [u, v]: [&mut [f32]; 2]) {
    for i in (0..u.len()).step_by(LANES) {
        let [x, y] = sphere_map::equal_area_squares(Vec3s::load(simd, w, i).into());
        store(x.0, u, i);
        store(y.0, v, i);
    }
}

impl Environment<'_> {
    /// Samples directions. Densities are 0 where the image is black.
    pub fn sample(&self, level: Level, u: [&[f32]; 2], out: &mut LightLanes<'_>) {
        out.with_padding(u, &|u, out| dispatch!(level, simd => self.sample_lanes(simd, u, out)));
    }

    #[inline(always)]
    fn sample_lanes<S: Simd>(&self, simd: S, u: [&[f32]; 2], out: &mut LightLanes<'_>) {
        // Directions, radiances and densities of each chunk
        let n = out.pdf.len();
        for start in (0..n).step_by(CHUNK) {
            let start = begin(start, n);
            let count = CHUNK.min(n - start);
            let places = self.places(simd, start, count, u);
            let mut lookups = Lookups::new();
            for i in (0..count).step_by(LANES) {
                let i = begin(i, count);
                self.directions(simd, &places, i, &mut lookups, (&mut out.wi, start + i));
            }
            self.radiances(simd, &mut lookups, start, count, out);
            for i in (0..count).step_by(LANES) {
                let i = begin(i, count);
                let pdf = load(simd, &lookups.pdf_area, i) * load(simd, &lookups.density, i);
                let is_sample = pdf.simd_gt(F::splat(simd, 0.0)) & pdf.is_finite();
                store(or_zero(is_sample, pdf), out.pdf, start + i);
            }
        }
    }

    /// Inverts the cumulative distributions.
    #[inline(always)]
    fn places<S: Simd>(&self, simd: S, start: usize, count: usize, u: [&[f32]; 2]) -> [Along; 2] {
        // Invert: rows, then columns within the rows. Each loop requests the entries that the next one reads
        let [mut x, mut y] = [Places::new(), Places::new()];
        let (u0, u1) = (&u[0][start..start + count], &u[1][start..start + count]);
        let rows = self.distribution.rows();
        let (mut parts, mut firsts) = ([0; CHUNK], [0; CHUNK]);
        for i in 0..count {
            let first = usize::from(rows.guide[rows.part(clamped(u1[i]))]);
            y.set(i, simd, &rows, first, u1[i]);
            let row = self.distribution.row(y.bin[i] as usize);
            parts[i] = row.part(clamped(u0[i]));
            prefetch(row.guide, parts[i]);
        }
        for i in 0..count {
            let row = self.distribution.row(y.bin[i] as usize);
            firsts[i] = usize::from(row.guide[parts[i]]);
            prefetch(row.cdf, firsts[i] + 1);
        }
        for i in 0..count {
            x.set(i, simd, &self.distribution.row(y.bin[i] as usize), firsts[i], u0[i]);
        }

        // Blocks to texels
        let edge = self.distribution.edge();
        let mut along = [Along::new(), Along::new()];
        for i in (0..count).step_by(LANES) {
            let i = begin(i, count);
            along[0].set(simd, i, &x, edge);
            along[1].set(simd, i, &y, edge);
        }
        if self.distribution.has_varied() {
            self.tell_apart(&x, &y, count, &mut along);
        }
        along
    }

    /// Chooses texels within blocks whose texels have different densities.
    #[inline(always)]
    fn tell_apart(&self, x: &Places, y: &Places, count: usize, along: &mut [Along; 2]) {
        let edge = self.distribution.edge() as i32;
        let mut within = [None; CHUNK];
        for i in 0..count {
            within[i] = self.distribution.within([x.bin[i] as usize, y.bin[i] as usize]);
            if let Some(within) = within[i] {
                prefetch(std::slice::from_ref(within), 0);
            }
        }
        for i in 0..count {
            let block = [x.bin[i], y.bin[i]];
            let Some(within) = within[i] else { continue };
            let place = within.choose([x.fraction(i), y.fraction(i)]);
            for k in 0..2 {
                let texel = block[k] * edge + place.texel[k] as i32;
                along[k].texel[i] = texel;
                along[k].place[i] = texel as f32 + place.within[k];
            }
        }
    }

    /// Directions and the indices of their texels.
    #[inline(always)]
    fn directions<S: Simd>(
        &self,
        simd: S,
        places: &[Along; 2],
        i: usize,
        lookups: &mut Lookups,
        (wi, at): (&mut [&mut [f32]; 3], usize),
    ) {
        let [width, height] = self.distribution.resolution();
        let (x, y) = (load(simd, &places[0].place, i), load(simd, &places[1].place, i));
        let (column, row) = (places[0].texels(simd, i), places[1].texels(simd, i));
        let (px, py) = (x * (1.0 / width as f32), y * (1.0 / height as f32));
        let Mapped { w, density } = if self.is_equal_area { equal_area(px, py) } else { lat_long(px, py) };
        w.transformed(&self.world_from_light).store(wi, at);
        store(density, &mut lookups.density, i);

        // With the border, texel centres are at 1.5, 2.5, …
        let stride = I::splat(simd, width as i32 + 2);
        ((row + 1) * stride + column + 1).store_slice(&mut lookups.cell[i..i + LANES]);
        let (x, y) = (x + 0.5, y + 0.5);
        // Rounding can move a sample of the last texel to its end
        let (x0, y0) = (x.floor().min(width as f32), y.floor().min(height as f32));
        (y0.to_int::<I<S>>() * stride + x0.to_int::<I<S>>()).store_slice(&mut lookups.first[i..i + LANES]);
        store(x - x0, &mut lookups.dx, i);
        store(y - y0, &mut lookups.dy, i);
    }

    #[inline(always)]
    fn texel<S: Simd>(&self, simd: S, i: usize) -> f32x4<S> {
        f32x4::from_slice(simd, &self.texels[i])
    }

    /// Radiances, and densities per unit area of the square.
    #[inline(always)]
    fn radiances<S: Simd>(&self, simd: S, lookups: &mut Lookups, start: usize, count: usize, out: &mut LightLanes<'_>) {
        // Interpolated or nearest radiance; the density is always the sampled texel's
        let stride = self.distribution.resolution()[0] + 2;
        let [red, green, blue] = &mut out.li;
        let (red, green) = (&mut red[start..start + count], &mut green[start..start + count]);
        let blue = &mut blue[start..start + count];
        for i in 0..count {
            prefetch_square(self.texels, lookups.first[i] as usize, stride);
        }
        for i in 0..count {
            let cell = self.texel(simd, lookups.cell[i] as usize);
            lookups.pdf_area[i] = cell[3];
            let l = if self.is_bilinear {
                let (first, dx, dy) = (lookups.first[i] as usize, lookups.dx[i], lookups.dy[i]);
                let upper = self.texel(simd, first) * (1.0 - dx) + self.texel(simd, first + 1) * dx;
                let lower = self.texel(simd, first + stride) * (1.0 - dx) + self.texel(simd, first + stride + 1) * dx;
                (upper * (1.0 - dy) + lower * dy) * self.scale
            } else {
                cell * self.scale
            };
            red[i] = l[0];
            green[i] = l[1];
            blue[i] = l[2];
        }
    }
}
