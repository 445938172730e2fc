//! The interface of ray tracers: batches of rays, hits, and the trait [`Accel`].

use crate::geometry::GeometryId;
use lumiris_numbers::math::{Ray, Vec3};

/// Rays as a structure of arrays. All vectors have the same length.
#[derive(Clone, Debug, Default)]
pub struct RayBatch {
    /// Origins, x.
    pub ox: Vec<f32>,
    /// Origins, y.
    pub oy: Vec<f32>,
    /// Origins, z.
    pub oz: Vec<f32>,
    /// Directions, x. Directions need not be normalised.
    pub dx: Vec<f32>,
    /// Directions, y.
    pub dy: Vec<f32>,
    /// Directions, z.
    pub dz: Vec<f32>,
    /// End of the open interval (0, t_max).
    pub t_max: Vec<f32>,
    /// Time in 0..1.
    pub time: Vec<f32>,
}

impl RayBatch {
    /// Number of rays.
    #[inline]
    pub fn len(&self) -> usize {
        self.ox.len()
    }

    /// True if there are no rays.
    #[inline]
    pub fn is_empty(&self) -> bool {
        self.ox.is_empty()
    }

    /// Removes all rays, but keeps the memory.
    pub fn clear(&mut self) {
        self.columns_mut().into_iter().for_each(Vec::clear);
    }

    /// Appends a ray.
    #[inline]
    pub fn push(&mut self, ray: &Ray) {
        self.columns_mut().into_iter().zip(values(ray)).for_each(|(column, value)| column.push(value));
    }

    /// Appends infinite rays from `o` at the time 0; `d` are columns of directions.
    pub fn extend_from(&mut self, o: Vec3, d: [&[f32]; 3]) {
        let n = self.len() + d[0].len();
        [&mut self.ox, &mut self.oy, &mut self.oz].into_iter().zip(o.to_array()).for_each(|(c, o)| c.resize(n, o));
        [&mut self.dx, &mut self.dy, &mut self.dz].into_iter().zip(d).for_each(|(c, d)| c.extend_from_slice(d));
        self.t_max.resize(n, f32::INFINITY);
        self.time.resize(n, 0.0);
    }

    /// Replaces ray `i`.
    #[inline]
    pub fn replace(&mut self, i: usize, ray: &Ray) {
        self.columns_mut().into_iter().zip(values(ray)).for_each(|(column, value)| column[i] = value);
    }

    /// Replaces all rays.
    #[inline]
    pub fn set<'r>(&mut self, rays: impl ExactSizeIterator<Item = &'r Ray>) {
        let n = rays.len();
        let mut columns = self.columns_mut().map(|column| {
            column.resize(n, 0.0);
            &mut column[..n]
        });
        for (i, ray) in rays.enumerate().take(n) {
            columns.iter_mut().zip(values(ray)).for_each(|(column, value)| column[i] = value);
        }
    }

    /// Replaces all rays by those of `from`.
    pub fn copy_from(&mut self, from: &RayBatch) {
        for (to, from) in self.columns_mut().into_iter().zip(from.columns()) {
            to.clear();
            to.extend_from_slice(from);
        }
    }

    /// Replaces all rays by the rays `indices` of `from`.
    pub fn gather(&mut self, from: &RayBatch, indices: &[u32]) {
        self.gather_columns(from.columns().map(|column| &column[..]), indices);
    }

    /// Replaces all rays by rays with these origins, directions and times, and ends if not infinite.
    pub fn gather_rows(
        &mut self,
        [ox, oy, oz]: [&[f32]; 3],
        [dx, dy, dz]: [&[f32]; 3],
        t_max: Option<&[f32]>,
        time: &[f32],
        rows: &[u32],
    ) {
        self.gather_columns([ox, oy, oz, dx, dy, dz, t_max.unwrap_or(time), time], rows);
        if t_max.is_none() {
            self.t_max.fill(f32::INFINITY);
        }
    }

    fn gather_columns(&mut self, from: [&[f32]; 8], rows: &[u32]) {
        for (to, from) in self.columns_mut().into_iter().zip(from) {
            to.clear();
            to.extend(rows.iter().map(|&row| from[row as usize]));
        }
    }

    /// The direction of ray `i`.
    #[inline]
    pub fn direction(&self, i: usize) -> Vec3 {
        Vec3::new(self.dx[i], self.dy[i], self.dz[i])
    }

    /// Replaces `out` by the lengths of the directions.
    pub fn lengths(&self, out: &mut Vec<f32>) {
        out.clear();
        let directions = self.dx.iter().zip(&self.dy).zip(&self.dz);
        out.extend(directions.map(|((x, y), z)| (x * x + y * y + z * z).sqrt()));
    }

    /// Ray `i`.
    #[inline]
    pub fn get(&self, i: usize) -> Ray {
        Ray {
            o: Vec3::new(self.ox[i], self.oy[i], self.oz[i]),
            d: self.direction(i),
            t_max: self.t_max[i],
            time: self.time[i],
        }
    }

    fn columns(&self) -> [&Vec<f32>; 8] {
        let RayBatch { ox, oy, oz, dx, dy, dz, t_max, time } = self;
        [ox, oy, oz, dx, dy, dz, t_max, time]
    }

    #[inline]
    fn columns_mut(&mut self) -> [&mut Vec<f32>; 8] {
        let RayBatch { ox, oy, oz, dx, dy, dz, t_max, time } = self;
        [ox, oy, oz, dx, dy, dz, t_max, time]
    }
}

/// The values of a ray, in the order of the columns.
#[inline]
fn values(&Ray { o, d, t_max, time }: &Ray) -> [f32; 8] {
    [o.x, o.y, o.z, d.x, d.y, d.z, t_max, time]
}

/// The first hit of a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Ray parameter.
    pub t: f32,
    /// Parametric position on the primitive: barycentric weights of vertices 1 and 2 of a triangle, (u, v) of a
    /// bilinear patch, (φ/φ_max, v) of a quadric (see there).
    pub uv: [f32; 2],
    /// The geometry.
    pub geometry: GeometryId,
    /// Index of the triangle or patch in the geometry; 0 for a quadric.
    pub primitive: u32,
    /// Index of the instance, or [`Hit::NO_INSTANCE`].
    pub instance: u32,
}

impl Hit {
    /// `instance` of hits in the root group.
    pub const NO_INSTANCE: u32 = crate::geometry::NO_INSTANCE;

    /// True if this is the first of two hits of a ray: by t, and for equal t by (instance, geometry, primitive).
    /// Applied by both tracers, so that coincident surfaces do not depend on the order of traversal.
    #[inline]
    pub fn precedes(&self, other: &Hit) -> bool {
        let key = |h: &Hit| (h.instance, h.geometry, h.primitive);
        self.t < other.t || (self.t == other.t && key(self) < key(other))
    }
}

/// Coherence of neighbouring rays in a batch, as a hint to the tracer. It never changes a result.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Coherence {
    /// Similar origins and directions (camera rays of a tile).
    Coherent,
    /// A common origin or end (shadow segments of a shading point): packets without frustum culling.
    Packets,
    /// None (bounces): first hits in packets without frustum culling, occlusion by single rays.
    Incoherent,
}

/// Memory and build time of an acceleration structure.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct AccelStats {
    /// Bytes held by the structure.
    pub bytes: u64,
    /// Peak bytes during the build.
    pub peak_bytes: u64,
    /// Wall-clock seconds of the build.
    pub build_seconds: f64,
}

/// A ray tracer with built structures. Queries may come from any number of threads.
pub trait Accel: Send + Sync {
    /// Nearest hits with geometries of `Visibility::PATH`. `hits` is resized; `hits[i]` is the result of ray `i`.
    fn intersect(&self, rays: &RayBatch, coherence: Coherence, hits: &mut Vec<Option<Hit>>);

    /// Occlusion by geometries of `Visibility::SHADOW`: `occluded[i]` is true if one lies inside (0, t_max) of ray `i`.
    fn occluded(&self, rays: &RayBatch, coherence: Coherence, occluded: &mut Vec<bool>);

    /// Memory and build time.
    fn stats(&self) -> AccelStats;
}
