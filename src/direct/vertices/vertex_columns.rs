//! The columns of [`Vertices`], and the assignment of their rows.

use super::surface::Surface;
use super::vertex_data::{PlainMeshVertex, VertexData};
use crate::bsdfs::{Bsdf, Diffuse};
use crate::direct::point::{ShadingPoint, lobe_for_lights};
use crate::geometry::TriangleMesh;
use crate::lights::{GlossyLobe, JobLights};
use crate::materials::SurfaceBsdf;
use crate::media::Sides;
use crate::settings::SampleCounts;
use lumiris_lanes::columns::{Column, Columns3, padded, reserve};
use lumiris_lanes::kernels::{Kernel, MAX_PARAMS};
use lumiris_lanes::lane::LANES;
use lumiris_lanes::level;
use lumiris_lanes::triangle_points::{self as kernels, Points, TriangleHits};
use lumiris_numbers::math::{Frame, Rgb, Vec3};
use lumiris_numbers::samplers::StreamColumns;
use std::ops::Range;

/// The vertices of a batch, at most one per path.
#[derive(Debug, Default)]
pub struct Vertices<'w> {
    /// Index of the path of each vertex.
    pub path: Vec<u32>,
    /// Time (0 to 1).
    pub time: Vec<f32>,
    /// Random numbers of the vertices, and of their direct light.
    pub streams: StreamColumns,
    /// See [`Self::streams`].
    pub direct: StreamColumns,
    /// Points, and Lambertian reflection there.
    pub surface: Surface,
    /// BSDFs of the first rows; all later rows are Lambertian.
    pub bsdfs: Vec<SurfaceBsdf<'w>>,
    /// Runs of rows.
    pub(super) runs: Vec<Run>,
    /// Parameters of the kernels of the first rows.
    pub(super) params: [Column; MAX_PARAMS],
    /// x axes of the shading frames of the first rows.
    pub(super) tangents: Columns3,
    /// Media of the first rows; all other rows are in empty space.
    media: Vec<Sides>,
    first_plain: usize,
    /// Vertices without a row yet.
    pending: Vec<VertexData<'w>>,
    plain: Vec<PlainMeshVertex>,
    /// Corners of the plain vertices, one item per vector of lanes.
    plain_hits: Vec<TriangleHits>,
}

/// Rows that are evaluated together.
#[derive(Clone, Debug)]
pub(super) struct Run {
    /// Kernel of the rows; `None`: they are evaluated one by one.
    pub(super) kernel: Option<Kernel>,
    pub(super) rows: Range<usize>,
}

/// The run of a vertex. Runs have this order.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum RunKind {
    OneByOne,
    Kernel(Kernel),
    /// Rows without BSDFs of their own.
    Lambertian,
}

impl RunKind {
    fn of(vertex: &VertexData<'_>) -> Self {
        match vertex.bsdf.bsdf.kernel() {
            _ if vertex.is_lambertian() => RunKind::Lambertian,
            Some(kernel) => RunKind::Kernel(kernel),
            None => RunKind::OneByOne,
        }
    }
}

impl<'w> Vertices<'w> {
    /// Empty columns in the memory of `old`, whose vertices may belong to another scene.
    pub fn emptied(mut old: Vertices<'_>) -> Self {
        old.clear();
        let (bsdfs, pending) =
            (in_memory_of(std::mem::take(&mut old.bsdfs)), in_memory_of(std::mem::take(&mut old.pending)));

        // Reuse all other columns
        let Vertices { path, time, streams, direct, surface, runs, params, tangents, media, .. } = old;
        let (first_plain, plain, plain_hits) = (0, old.plain, old.plain_hits);
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
            pending,
            plain,
            plain_hits,
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
        self.pending.clear();
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
    pub fn plain_rows(&self) -> Range<usize> {
        self.first_plain..self.len()
    }

    /// Adds a vertex with all its data.
    #[inline]
    pub fn push(&mut self, vertex: VertexData<'w>) {
        self.pending.push(vertex);
    }

    /// Adds the hit of a ray of direction `d` on a mesh in world space with the constant reflectance `rho`. `uv` are
    /// the weights of the second and the third corner of `triangle`.
    #[inline(always)]
    pub fn push_plain_mesh(&mut self, path: u32, mesh: &TriangleMesh, triangle: u32, uv: [f32; 2], d: Vec3, rho: Rgb) {
        let (block, k) = (self.plain.len() / LANES, self.plain.len() % LANES);
        if block == self.plain_hits.len() {
            self.plain_hits.push(TriangleHits::default());
        }

        mesh.gather_hit(triangle as usize, uv, d, &mut self.plain_hits[block], k);
        self.plain.push(PlainMeshVertex { path, rho });
    }

    /// Assigns rows to all vertices added; vertices with their own BSDFs come first. Times and random numbers are set
    /// by the caller.
    pub fn finish(&mut self, lights: &JobLights) {
        let (pending, plain) = (std::mem::take(&mut self.pending), std::mem::take(&mut self.plain));
        // The kernel writes whole vectors from the first plain row on
        self.surface.reserve(padded(pending.len() + padded(plain.len())));
        self.add_runs(&pending);
        pending.iter().filter(|vertex| vertex.is_lambertian()).for_each(|vertex| self.add_row(vertex));
        self.add_plain_rows(&plain);
        let lambertian = self.bsdfs.len()..self.len();
        if !lambertian.is_empty() {
            self.runs.push(Run { kernel: Some(Kernel::Diffuse), rows: lambertian });
        }
        self.find_lobes(lights);
        (self.pending, self.plain) = (pending, plain);
        self.pending.clear();
        self.plain.clear();
    }

    /// Adds the rows with their own BSDFs, kernel by kernel.
    fn add_runs(&mut self, pending: &[VertexData<'w>]) {
        // Runs in use
        let kinds: Vec<RunKind> = pending.iter().map(RunKind::of).collect();
        let mut used: Vec<RunKind> = Vec::new();
        for &kind in &kinds {
            if kind != RunKind::Lambertian && !used.contains(&kind) {
                used.push(kind);
            }
        }
        used.sort();

        // Rows of each run
        for kind in used {
            let first = self.len();
            for (vertex, _) in pending.iter().zip(&kinds).filter(|&(_, &other)| other == kind) {
                self.bsdfs.push(vertex.bsdf);
                self.media.push(vertex.media);
                self.add_row(vertex);
            }
            let kernel = if let RunKind::Kernel(kernel) = kind { Some(kernel) } else { None };
            self.runs.push(Run { kernel, rows: first..self.len() });
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

    fn add_row(&mut self, vertex: &VertexData<'_>) {
        let i = self.len();
        self.path.push(vertex.path);
        let VertexData { p, p_error, wo, bsdf, .. } = vertex;
        let has_surface = bsdf.bsdf.has_surface();
        let s = &mut self.surface;
        s.p.set(i, *p);
        s.p_error.set(i, *p_error);
        s.n.set(i, bsdf.n);
        s.facing.set(i, if has_surface { bsdf.lit_normal(*wo) } else { Vec3::ZERO });
        s.ns.set(i, if has_surface { bsdf.frame.z } else { Vec3::ZERO });
        s.wo.set(i, *wo);
        let Bsdf::Diffuse(Diffuse { reflectance }) = bsdf.bsdf else { return s.rho.set_rgb(i, Rgb::BLACK) };
        s.rho.set_rgb(i, reflectance);
    }

    fn add_plain_rows(&mut self, plain: &[PlainMeshVertex]) {
        let (first, len) = (self.len(), padded(plain.len()));
        self.first_plain = first;
        self.path.extend(plain.iter().map(|vertex| vertex.path));
        for (i, vertex) in (first..).zip(plain) {
            self.surface.rho.set_rgb(i, vertex.rho);
        }
        let Surface { p, p_error, n, facing, ns, wo, .. } = &mut self.surface;
        let [p, p_error, n, facing, ns, wo] =
            [p, p_error, n, facing, ns, wo].map(|c| c.get_mut(first + len).map(|c| &mut c[first..]));
        kernels::points(level(), &self.plain_hits[..len / LANES], &mut Points { p, p_error, n, facing, ns, wo });
    }

    /// Sets the lobes used by the choice of lights.
    fn find_lobes(&mut self, lights: &JobLights) {
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
            stream: self.direct.get(i),
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
        lights: &JobLights,
        bsdf: impl Fn(usize) -> Option<SurfaceBsdf<'w>>,
    ) {
        let mut row_of = vec![0_u32; other.path.iter().max().map_or(0, |&path| path as usize + 1)];
        for i in 0..other.len() {
            row_of[other.path[i] as usize] = i as u32;
            let Some(bsdf) = bsdf(i) else { continue };
            let s = &other.surface;
            let (p, p_error, wo) = (s.p.vec3(i), s.p_error.vec3(i), s.wo.vec3(i));
            self.push(VertexData { path: other.path[i], p, p_error, wo, bsdf, media: other.media(i) });
        }
        self.finish(lights);

        // Times and random numbers
        let Vertices { path, time, streams, direct, .. } = self;
        let rows: Vec<u32> = path.iter().map(|&path| row_of[path as usize]).collect();
        time.extend(rows.iter().map(|&row| other.time[row as usize]));
        streams.gather(&other.streams, &rows);
        direct.gather(&other.direct, &rows);
    }
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
    use lumiris_numbers::samplers::{SampleStream, SamplerKind};
    use std::sync::Arc;

    fn lights() -> JobLights {
        let set = LightSetBuilder::default().build(&Bounds3::from_points([Vec3::ZERO, Vec3::ONE]));
        let choice = LightChoice { kind: LightSamplerKind::Uniform, infinite_fraction: None, volumes: false };
        JobLights::new(Arc::new(set), choice, 1)
    }

    fn stream(path: u32, sample: u32) -> SampleStream {
        SampleStream::new(SamplerKind::Sobol, [path, 0], sample, 7)
    }

    fn vertex_data(path: u32, bsdf: SurfaceBsdf<'static>, media: Sides) -> VertexData<'static> {
        VertexData { path, p: Vec3::splat(path as f32), p_error: Vec3::ZERO, wo: Vec3::Z, bsdf, media }
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
            assert_eq!(vertices.streams.get(row).draw::<2>(), stream(path, 0).draw::<2>());
            assert_eq!(vertices.direct.get(row).draw::<2>(), stream(path, 1).draw::<2>());
        }
    }

    #[test]
    fn rows_are_sorted_by_kernel_and_keep_the_numbers_of_their_paths() {
        let (lights, in_medium) = (lights(), SurfaceBsdf::in_medium(0.2, Vec3::Z));
        let mut vertices = Vertices::default();
        for path in [5, 1, 4] {
            vertices.push(vertex_data(path, grey(), Sides::default()));
        }
        vertices.push(vertex_data(0, grey(), Sides::both(Some(3))));
        vertices.push(vertex_data(2, in_medium, Sides::default()));
        vertices.finish(&lights);
        for &path in &vertices.path {
            vertices.time.push(path as f32);
            vertices.streams.extend([stream(path, 0)].iter());
            vertices.direct.extend([stream(path, 1)].iter());
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
