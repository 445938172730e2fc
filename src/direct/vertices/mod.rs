//! The vertices of a batch of paths, in columns. Row k of every column is vertex k.
//!
//! Rows form runs of equal work ([`Run`]). The first rows have their own [`SurfaceBsdf`], sorted by the kernel that
//! evaluates them. All other rows are one run of Lambertian surfaces, with their reflectance in columns. The data of a
//! vertex go straight into the columns, except for the points of meshes in world space: their corners are collected,
//! and one kernel computes all of these points at the end ([`Vertices::finish`]). `scattering` evaluates and samples
//! the BSDFs of all rows.

mod scattering;

pub use scattering::BsdfSamples;

use super::point::{ShadingPoint, lobe_for_lights};
use crate::bsdfs::{Bsdf, Diffuse};
use crate::geometry::TriangleMesh;
use crate::lights::many::LitPoints;
use crate::lights::{GlossyLobe, LightSampling};
use crate::materials::SurfaceBsdf;
use crate::media::Sides;
use crate::settings::SampleCounts;
use lumiris_lanes::columns::{Column, Columns3, padded, reserve};
use lumiris_lanes::kernels::{Kernel, MAX_PARAMS};
use lumiris_lanes::lane::LANES;
use lumiris_lanes::level;
use lumiris_lanes::vertex::{self as kernels, Ends, Points, TriangleHits};
use lumiris_numbers::math::{Frame, Rgb, Vec3};
use lumiris_numbers::samplers::SampleStream;
use std::ops::Range;

/// The vertices of a batch, at most one per path.
#[derive(Debug, Default)]
pub struct Vertices<'w> {
    /// Index of the path of each vertex.
    pub path: Vec<u32>,
    /// Time (0 to 1).
    pub time: Vec<f32>,
    /// Random numbers of the vertices, and of their direct light.
    pub streams: Vec<SampleStream>,
    /// See [`Self::streams`].
    pub direct: Vec<SampleStream>,
    /// Points, and Lambertian reflection there.
    pub surface: Surface,
    /// BSDFs of the first rows; all later rows are Lambertian.
    pub bsdfs: Vec<SurfaceBsdf<'w>>,
    /// Runs of rows.
    runs: Vec<Run>,
    /// Parameters of the kernels of the first rows.
    params: [Column; MAX_PARAMS],
    /// x axes of the shading frames of the first rows.
    tangents: Columns3,
    /// Media of the first rows; all other rows are in empty space.
    media: Vec<Sides>,
    first_plain: usize,
    /// Vertices without a row yet.
    singles: Vec<Single<'w>>,
    plain: Vec<Plain>,
    /// Corners of the plain vertices, one item per vector of lanes.
    hits: Vec<TriangleHits>,
}

/// Rows that are evaluated together.
#[derive(Clone, Debug)]
struct Run {
    /// Kernel of the rows; `None`: they are evaluated one by one.
    kernel: Option<Kernel>,
    rows: Range<usize>,
}

/// Points of surfaces, and Lambertian reflection there.
#[derive(Debug, Default)]
pub struct Surface {
    /// Points.
    pub p: Columns3,
    /// Bounds of their rounding errors.
    pub p_error: Columns3,
    /// Geometric normals; zero if there is no surface.
    pub n: Columns3,
    /// Normals on the lit side; zero if both sides are lit.
    pub lit: Columns3,
    /// Shading normals.
    pub ns: Columns3,
    /// Unit directions to the viewer.
    pub wo: Columns3,
    /// Reflectances; black if the BSDF is not Lambertian.
    pub rho: Columns3,
    /// Lobes used by the choice of lights; empty if it does not use them.
    pub lobes: Vec<GlossyLobe>,
}

/// A vertex with all its data.
#[derive(Clone, Copy, Debug)]
pub struct Single<'w> {
    /// Index of its path.
    pub path: u32,
    /// The point.
    pub p: Vec3,
    /// Bound of its rounding error.
    pub p_error: Vec3,
    /// Direction to the viewer, unit.
    pub wo: Vec3,
    /// Scattering.
    pub bsdf: SurfaceBsdf<'w>,
    /// The media on both sides of the surface.
    pub media: Sides,
}

/// A vertex on a mesh in world space, whose point is computed by a kernel.
#[derive(Clone, Copy, Debug)]
struct Plain {
    path: u32,
    rho: Rgb,
}

impl Single<'_> {
    /// True if the vertex fits into a Lambertian row.
    fn is_lambertian(&self) -> bool {
        matches!(self.bsdf.bsdf, Bsdf::Diffuse(_)) && self.media == Sides::default()
    }
}

impl<'w> Vertices<'w> {
    /// Empty columns in the memory of `old`, whose vertices may belong to another scene.
    pub fn emptied(mut old: Vertices<'_>) -> Self {
        old.clear();
        let (bsdfs, singles) =
            (in_memory_of(std::mem::take(&mut old.bsdfs)), in_memory_of(std::mem::take(&mut old.singles)));

        // Reuse all other columns
        let Vertices { path, time, streams, direct, surface, runs, params, tangents, media, .. } = old;
        let (first_plain, plain, hits) = (0, old.plain, old.hits);
        Vertices {
            path,
            time,
            streams,
            direct,
            surface,
            bsdfs,
            runs,
            params,
            tangents,
            media,
            first_plain,
            singles,
            plain,
            hits,
        }
    }

    /// Removes all vertices.
    pub fn clear(&mut self) {
        self.path.clear();
        self.time.clear();
        self.streams.clear();
        self.direct.clear();
        self.surface.lobes.clear();
        self.bsdfs.clear();
        self.runs.clear();
        self.media.clear();
        self.first_plain = 0;
        self.singles.clear();
        self.plain.clear();
    }

    /// Number of rows.
    pub fn len(&self) -> usize {
        self.path.len()
    }

    /// True if there are no rows.
    pub fn is_empty(&self) -> bool {
        self.path.is_empty()
    }

    /// The rows on plain meshes: the last ones.
    pub fn plain(&self) -> Range<usize> {
        self.first_plain..self.len()
    }

    /// Adds a vertex with all its data.
    #[inline]
    pub fn push(&mut self, vertex: Single<'w>) {
        self.singles.push(vertex);
    }

    /// Adds the hit of a ray of direction `d` on a mesh in world space with the constant reflectance `rho`. `uv` are
    /// the weights of the second and the third corner of `triangle`.
    #[inline]
    pub fn push_plain(&mut self, path: u32, mesh: &TriangleMesh, triangle: u32, uv: [f32; 2], d: Vec3, rho: Rgb) {
        let (block, k) = (self.plain.len() / LANES, self.plain.len() % LANES);
        if block == self.hits.len() {
            self.hits.push(TriangleHits::default());
        }

        // Corners and vertex normals
        let hits = &mut self.hits[block];
        let vertices = mesh.indices[triangle as usize];
        for (rows, p) in hits.corners.iter_mut().zip(mesh.corners(vertices)) {
            set_lane(rows, k, p);
        }
        if mesh.normals.is_empty() {
            hits.normals.iter_mut().for_each(|rows| set_lane(rows, k, Vec3::ZERO));
        } else {
            for (rows, v) in hits.normals.iter_mut().zip(vertices) {
                set_lane(rows, k, mesh.normals[v as usize]);
            }
        }

        // Weights, orientation and ray direction
        [hits.b[0][k], hits.b[1][k]] = uv;
        hits.orientation[k] = if mesh.flip_normal { -1.0 } else { 1.0 };
        set_lane(&mut hits.d, k, d);
        self.plain.push(Plain { path, rho });
    }

    /// Assigns rows to all vertices added; vertices with their own BSDFs come first. Times and random numbers are set
    /// by the caller.
    pub fn finish(&mut self, lights: &LightSampling) {
        let (singles, plain) = (std::mem::take(&mut self.singles), std::mem::take(&mut self.plain));
        // The kernel writes whole vectors from the first plain row on
        self.surface.reserve(padded(singles.len() + padded(plain.len())));
        self.add_runs(&singles);
        singles.iter().filter(|single| single.is_lambertian()).for_each(|single| self.add_single(single));
        self.add_plain(&plain);
        let lambertian = self.bsdfs.len()..self.len();
        if !lambertian.is_empty() {
            self.runs.push(Run { kernel: Some(Kernel::Diffuse), rows: lambertian });
        }
        self.find_lobes(lights);
        (self.singles, self.plain) = (singles, plain);
        self.singles.clear();
        self.plain.clear();
    }

    /// Adds the rows with their own BSDFs, kernel by kernel.
    fn add_runs(&mut self, singles: &[Single<'w>]) {
        let kernel = |single: &Single<'w>| if single.is_lambertian() { None } else { Some(single.bsdf.bsdf.kernel()) };

        // Kernels in use
        let mut kinds: Vec<Option<Kernel>> = Vec::new();
        for kind in singles.iter().filter_map(kernel) {
            if !kinds.contains(&kind) {
                kinds.push(kind);
            }
        }
        kinds.sort_by_key(|kind| kind.map(|kernel| kernel as u32));

        // One run for each kernel
        for kind in kinds {
            let first = self.len();
            for single in singles.iter().filter(|single| kernel(single) == Some(kind)) {
                self.bsdfs.push(single.bsdf);
                self.media.push(single.media);
                self.add_single(single);
            }
            self.runs.push(Run { kernel: kind, rows: first..self.len() });
        }
        self.set_params();
    }

    /// Sets the parameters of kernels.
    fn set_params(&mut self) {
        let len = padded(self.bsdfs.len());
        self.tangents.reserve(len);
        for Run { kernel, rows } in &self.runs {
            let Some(kernel) = kernel else { continue };
            let columns = &mut self.params[..kernel.params()];
            columns.iter_mut().for_each(|column| reserve(&mut [column], len));
            for i in rows.clone() {
                let SurfaceBsdf { bsdf, frame, .. } = &self.bsdfs[i];
                self.tangents.set(i, frame.x);
                columns.iter_mut().zip(bsdf.params()).for_each(|(column, param)| column[i] = param);
            }
        }
    }

    fn add_single(&mut self, single: &Single<'_>) {
        let i = self.len();
        self.path.push(single.path);
        let Single { p, p_error, wo, bsdf, .. } = single;
        let has_surface = bsdf.bsdf.has_surface();
        let s = &mut self.surface;
        s.p.set(i, *p);
        s.p_error.set(i, *p_error);
        s.n.set(i, bsdf.n);
        s.lit.set(i, if has_surface { bsdf.lit_normal(*wo) } else { Vec3::ZERO });
        s.ns.set(i, if has_surface { bsdf.frame.z } else { Vec3::ZERO });
        s.wo.set(i, *wo);
        let Bsdf::Diffuse(Diffuse { reflectance }) = bsdf.bsdf else { return s.rho.set_rgb(i, Rgb::BLACK) };
        s.rho.set_rgb(i, reflectance);
    }

    fn add_plain(&mut self, plain: &[Plain]) {
        let (first, len) = (self.len(), padded(plain.len()));
        self.first_plain = first;
        self.path.extend(plain.iter().map(|vertex| vertex.path));
        for (i, vertex) in (first..).zip(plain) {
            self.surface.rho.set_rgb(i, vertex.rho);
        }
        let Surface { p, p_error, n, lit, ns, wo, .. } = &mut self.surface;
        let [p, p_error, n, facing, ns, wo] =
            [p, p_error, n, lit, ns, wo].map(|c| c.get_mut(first + len).map(|c| &mut c[first..]));
        kernels::points(level(), &self.hits[..len / LANES], &mut Points { p, p_error, n, facing, ns, wo });
    }

    /// Sets the lobes used by the choice of lights.
    fn find_lobes(&mut self, lights: &LightSampling) {
        let lobes = &mut self.surface.lobes;
        lobes.clear();
        if lights.sampler.needs_lobes() && !self.bsdfs.is_empty() {
            let wo = &self.surface.wo;
            lobes.extend(self.bsdfs.iter().enumerate().map(|(i, bsdf)| lobe_for_lights(lights, bsdf, wo.vec3(i))));
            lobes.resize(self.path.len(), GlossyLobe::NONE);
        }
    }

    /// The scattering of a row.
    #[inline]
    pub fn bsdf(&self, i: usize) -> SurfaceBsdf<'w> {
        if let Some(bsdf) = self.bsdfs.get(i) {
            return *bsdf;
        }
        SurfaceBsdf {
            bsdf: Bsdf::Diffuse(Diffuse { reflectance: self.surface.rho.rgb(i) }),
            frame: Frame::from_z(self.surface.ns.vec3(i)),
            n: self.surface.n.vec3(i),
            makes_caustics: false,
        }
    }

    /// The media on both sides of a row.
    #[inline]
    pub fn media(&self, i: usize) -> Sides {
        self.media.get(i).copied().unwrap_or_default()
    }

    /// A row as a shading point. `sample` is the index of its camera sample, `fit` the index of its fit.
    pub fn point(&self, i: usize, sample_counts: SampleCounts, [sample, fit]: [u32; 2]) -> ShadingPoint<'w> {
        ShadingPoint {
            p: self.surface.p.vec3(i),
            p_error: self.surface.p_error.vec3(i),
            wo: self.surface.wo.vec3(i),
            bsdf: self.bsdf(i),
            lobe: self.surface.lit_points().get(i).lobe,
            time: self.time[i],
            stream: self.direct[i],
            sample_counts,
            fit,
            sample,
            media: self.media(i),
        }
    }

    /// Adds the rows of `other` for which `bsdf` returns a BSDF, with this BSDF.
    pub fn select(
        &mut self,
        other: &Vertices<'w>,
        lights: &LightSampling,
        bsdf: impl Fn(usize) -> Option<SurfaceBsdf<'w>>,
    ) {
        let mut row_of = vec![0; other.path.iter().max().map_or(0, |&path| path as usize + 1)];
        for i in 0..other.len() {
            row_of[other.path[i] as usize] = i;
            let Some(bsdf) = bsdf(i) else { continue };
            let s = &other.surface;
            let (p, p_error, wo) = (s.p.vec3(i), s.p_error.vec3(i), s.wo.vec3(i));
            self.push(Single { path: other.path[i], p, p_error, wo, bsdf, media: other.media(i) });
        }
        self.finish(lights);

        // Times and random numbers
        let Vertices { path, time, streams, direct, .. } = self;
        let rows = || path.iter().map(|&path| row_of[path as usize]);
        time.extend(rows().map(|row| other.time[row]));
        streams.extend(rows().map(|row| other.streams[row]));
        direct.extend(rows().map(|row| other.direct[row]));
    }
}

impl Surface {
    fn reserve(&mut self, len: usize) {
        let Surface { p, p_error, n, lit, ns, wo, rho, lobes: _ } = self;
        [p, p_error, n, lit, ns, wo, rho].into_iter().for_each(|c| c.reserve(len));
    }

    /// The points as input of light sampling.
    pub fn lit_points(&self) -> LitPoints<'_> {
        LitPoints { p: &self.p, n: &self.lit, ns: &self.ns, lobes: &self.lobes }
    }

    /// The first `len` points as ends of segments.
    pub fn ends(&self, len: usize) -> Ends<'_> {
        Ends { p: self.p.get(len), p_error: self.p_error.get(len), n: self.n.get(len) }
    }
}

/// Sets a vector of a lane.
#[inline]
fn set_lane(rows: &mut [[f32; LANES]; 3], k: usize, v: Vec3) {
    (rows[0][k], rows[1][k], rows[2][k]) = v.into();
}

/// An empty vector in the memory of `old`, whose items have the same layout and may borrow from something else.
fn in_memory_of<T, U>(mut old: Vec<T>) -> Vec<U> {
    const { assert!(size_of::<T>() == size_of::<U>() && align_of::<T>() == align_of::<U>()) };
    old.clear();
    old.into_iter().map(|_| unreachable!("the vector is empty")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lights::{LightChoice, LightSamplerKind, LightSetBuilder};
    use lumiris_numbers::math::Bounds3;
    use lumiris_numbers::samplers::SamplerKind;
    use std::sync::Arc;

    fn lights() -> LightSampling {
        let set = LightSetBuilder::default().build(&Bounds3::from_points([Vec3::ZERO, Vec3::ONE]));
        let choice = LightChoice { kind: LightSamplerKind::Uniform, infinite_fraction: None, glows: false };
        LightSampling::new(Arc::new(set), choice, 1)
    }

    fn stream(path: u32, sample: u32) -> SampleStream {
        SampleStream::new(SamplerKind::Sobol, [path, 0], sample, 7)
    }

    fn single(path: u32, bsdf: SurfaceBsdf<'static>, media: Sides) -> Single<'static> {
        Single { path, p: Vec3::splat(path as f32), p_error: Vec3::ZERO, wo: Vec3::Z, bsdf, media }
    }

    fn grey() -> SurfaceBsdf<'static> {
        let bsdf = Bsdf::Diffuse(Diffuse { reflectance: Rgb::splat(0.5) });
        SurfaceBsdf { bsdf, frame: Frame::from_z(Vec3::Z), n: Vec3::Z, makes_caustics: false }
    }

    /// The rows belong to these paths, with the points and the numbers of each.
    fn assert_rows(vertices: &Vertices<'_>, paths: &[u32]) {
        assert_eq!(vertices.path, paths);
        for (row, &path) in paths.iter().enumerate() {
            assert_eq!((vertices.surface.p.vec3(row), vertices.time[row]), (Vec3::splat(path as f32), path as f32));
            assert_eq!(vertices.streams[row].draw::<2>(), stream(path, 0).draw::<2>());
            assert_eq!(vertices.direct[row].draw::<2>(), stream(path, 1).draw::<2>());
        }
    }

    #[test]
    fn rows_are_sorted_by_kernel_and_keep_the_numbers_of_their_paths() {
        let (lights, in_medium) = (lights(), SurfaceBsdf::in_medium(0.2, Vec3::Z));
        let mut vertices = Vertices::default();
        for path in [5, 1, 4] {
            vertices.push(single(path, grey(), Sides::default()));
        }
        vertices.push(single(0, grey(), Sides::both(Some(3))));
        vertices.push(single(2, in_medium, Sides::default()));
        vertices.finish(&lights);
        for &path in &vertices.path {
            vertices.time.push(path as f32);
            vertices.streams.push(stream(path, 0));
            vertices.direct.push(stream(path, 1));
        }

        // Without a kernel, by kernel in a medium, and Lambertian
        assert_rows(&vertices, &[2, 0, 5, 1, 4]);
        let runs: Vec<_> = vertices.runs.iter().map(|run| (run.kernel, run.rows.clone())).collect();
        assert_eq!(runs, [(None, 0..1), (Some(Kernel::Diffuse), 1..2), (Some(Kernel::Diffuse), 2..5)]);
        assert_eq!((vertices.media(1).front, vertices.media(2).front), (Some(3), None));

        // Selected rows are sorted by their new BSDFs
        let mut chosen = Vertices::default();
        chosen.select(&vertices, &lights, |row| match vertices.path[row] {
            4 => Some(in_medium),
            path => (path < 5).then(grey),
        });
        assert_rows(&chosen, &[4, 0, 2, 1]);
        assert_eq!(chosen.bsdfs.len(), 2);
    }
}
