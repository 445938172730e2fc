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
        for v in [&mut self.ox, &mut self.oy, &mut self.oz, &mut self.dx, &mut self.dy, &mut self.dz] {
            v.clear();
        }
        self.t_max.clear();
        self.time.clear();
    }

    /// Appends a ray.
    #[inline]
    pub fn push(&mut self, ray: &Ray) {
        self.ox.push(ray.o.x);
        self.oy.push(ray.o.y);
        self.oz.push(ray.o.z);
        self.dx.push(ray.d.x);
        self.dy.push(ray.d.y);
        self.dz.push(ray.d.z);
        self.t_max.push(ray.t_max);
        self.time.push(ray.time);
    }

    /// Replaces all rays.
    #[inline]
    pub fn set<'r>(&mut self, rays: impl ExactSizeIterator<Item = &'r Ray>) {
        let n = rays.len();
        let RayBatch { ox, oy, oz, dx, dy, dz, t_max, time } = self;
        let mut columns = [ox, oy, oz, dx, dy, dz, t_max, time].map(|column| {
            column.resize(n, 0.0);
            &mut column[..n]
        });
        for (i, ray) in rays.enumerate().take(n) {
            let values = [ray.o.x, ray.o.y, ray.o.z, ray.d.x, ray.d.y, ray.d.z, ray.t_max, ray.time];
            for (column, value) in columns.iter_mut().zip(values) {
                column[i] = value;
            }
        }
    }

    /// Ray `i`.
    #[inline]
    pub fn get(&self, i: usize) -> Ray {
        Ray {
            o: Vec3::new(self.ox[i], self.oy[i], self.oz[i]),
            d: Vec3::new(self.dx[i], self.dy[i], self.dz[i]),
            t_max: self.t_max[i],
            time: self.time[i],
        }
    }
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
