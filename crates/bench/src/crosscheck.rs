//! Crosscheck of two ray tracers with the same rays.
//!
//! Both trace five families of rays: camera rays, shadow segments towards the lights, random chords of the scene's
//! bounds, rays that graze the surfaces hit by camera rays, and rays aimed at edges and vertices of triangles. Answers
//! are *equal* if both hit the same primitive and their t differ by at most [`T_TOLERANCE_ULPS`] units in the last
//! place of the largest number involved. A different answer is *explained* in three cases: the nearer primitive is
//! tied in t with the other one; the ray, in f64 arithmetic, passes one of its edges within [`EDGE_ULPS`] units in the
//! last place; or the ray starts within [`START_ULPS`] of it. All other differences are disagreements.

use glam::DVec3;
use lumiris::accel::{Accel, Coherence, Hit, RayBatch};
use lumiris::geometry::Shape;
use lumiris::lights::{LightCtx, SampleOfLight};
use lumiris::scene::{RenderJob, Scene};
use lumiris_numbers::math::ray::{SEGMENT_END, offset_origin};
use lumiris_numbers::math::{Ray, Sphere, Vec2, Vec3, warp};
use lumiris_numbers::samplers::{SampleStream, SamplerKind};
use serde::Serialize;

/// Allowed difference of t in units in the last place of the largest of t·|d|, |o| and the hit's coordinates.
pub const T_TOLERANCE_ULPS: f64 = 64.0;
/// Distance between a ray and an edge of a triangle below which rounding decides, in units in the last place of the
/// largest coordinate involved.
pub const EDGE_ULPS: f64 = 32.0;
/// Distance of a hit from the start of its ray, in the same units, below which rounding decides.
pub const START_ULPS: f64 = 1.0;

/// A family of rays.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Family {
    /// From the camera.
    Camera,
    /// From surfaces to lights; occlusion queries.
    Shadow,
    /// Chords of the bounding sphere.
    Random,
    /// Nearly tangent to the surface that they leave.
    Grazing,
    /// Aimed at edges and vertices of triangles.
    Edge,
}

impl Family {
    /// All families.
    pub const ALL: [Family; 5] = [Family::Camera, Family::Shadow, Family::Random, Family::Grazing, Family::Edge];
}

/// Counts of one family.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct Tally {
    /// Rays traced.
    pub rays: u64,
    /// Rays for which the first tracer reports a hit.
    pub hits: u64,
    /// Same primitive, t within tolerance.
    pub equal: u64,
    /// Different primitives, t within tolerance: a tie or a shared edge.
    pub ties: u64,
    /// Only one tracer hits, or one hits farther away, at the edge of a primitive or at a grazing angle.
    pub edge_flips: u64,
    /// Differences without an explanation.
    pub disagreements: u64,
    /// The largest difference of t among equal answers, in units in the last place.
    pub max_t_ulps: f64,
}

/// A disagreement in full.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Disagreement {
    /// Family of the ray.
    pub family: Family,
    /// Origin, in the world of the scene's file.
    pub o: [f64; 3],
    /// Direction.
    pub d: [f32; 3],
    /// End of the interval; null if infinite.
    pub t_max: f32,
    /// t by the first tracer; null if it misses.
    pub t_a: Option<f32>,
    /// t by the second tracer; null if it misses.
    pub t_b: Option<f32>,
}

/// Results of all families.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// One tally per family.
    pub tallies: Vec<(Family, Tally)>,
    /// The first few disagreements.
    pub examples: Vec<Disagreement>,
}

impl Report {
    /// Number of answers without an explanation.
    pub fn disagreements(&self) -> u64 {
        self.tallies.iter().map(|(_, t)| t.disagreements).sum()
    }
}

/// Maximum number of disagreements stored in full.
const MAX_EXAMPLES: usize = 16;

/// Traces `rays` rays of each family through both tracers of the same scene.
pub fn crosscheck(job: &RenderJob, other: &dyn Accel, rays: u32) -> Report {
    // Camera rays and their hits, from which other families start
    let mut report = Report { tallies: Vec::new(), examples: Vec::new() };
    let scene = &job.world.scene;
    let camera = camera_rays(scene, rays);
    let mut hits = Vec::new();
    job.world.accel.intersect(&camera, Coherence::Coherent, &mut hits);

    // Check the families
    for family in Family::ALL {
        let batch = match family {
            Family::Camera => camera.clone(),
            Family::Shadow => shadow_rays(job, &camera, &hits),
            Family::Random => random_rays(scene, rays),
            Family::Grazing => grazing_rays(scene, &camera, &hits),
            Family::Edge => edge_rays(scene, rays),
        };
        let mut checker = Checker { scene, family, tally: Tally::default(), examples: &mut report.examples };
        if family == Family::Shadow {
            checker.check_occlusion(&*job.world.accel, other, &batch);
        } else {
            checker.check_hits(&*job.world.accel, other, &batch);
        }
        let tally = checker.tally;
        report.tallies.push((family, tally));
    }
    report
}

fn uniforms(family: Family, index: u32) -> [f32; 4] {
    SampleStream::new(SamplerKind::Independent, [index, family as u32], 0, 0x6c75).draw::<4>()
}

fn camera_rays(scene: &Scene, count: u32) -> RayBatch {
    let mut batch = RayBatch::default();
    let b = scene.film.bounds;
    for i in 0..count {
        let u = uniforms(Family::Camera, i);
        let film = Vec2::new(b.x0 as f32 + u[0] * b.width() as f32, b.y0 as f32 + u[1] * b.height() as f32);
        batch.push(&scene.camera.ray(film, [u[2], u[3]], u[2]).ray);
    }
    batch
}

fn random_rays(scene: &Scene, count: u32) -> RayBatch {
    let mut batch = RayBatch::default();
    let Sphere { center, radius } = scene.geometry.world_bounds().bounding_sphere();
    for i in 0..count {
        let u = uniforms(Family::Random, i);
        let o = center + radius * warp::sample_uniform_sphere([u[0], u[1]]);
        let to = center + radius * warp::sample_uniform_sphere([u[2], u[3]]);
        batch.push(&Ray { o, d: (to - o).normalize_or(Vec3::Z), t_max: f32::INFINITY, time: u[0] });
    }
    batch
}

fn shadow_rays(job: &RenderJob, camera: &RayBatch, hits: &[Option<Hit>]) -> RayBatch {
    // A light sample at every camera hit
    let mut batch = RayBatch::default();
    for (i, hit) in hits.iter().enumerate() {
        let Some(hit) = hit else { continue };
        let time = camera.time[i];
        let (set, ray) = (&job.world.scene.geometry, camera.get(i));
        let s = set.surface_hit_of_ray(hit.geometry, hit.primitive, hit.instance, hit.uv, &ray);
        let u = uniforms(Family::Shadow, i as u32);
        let ctx = LightCtx { ns: s.ns, ..LightCtx::on(s.p, s.n) };
        let Some(SampleOfLight { sample, .. }) = job.lights.sample(&ctx, u[0], [u[1], u[2]]) else { continue };

        // A segment to a point, or a ray to a light at infinity
        let o = offset_origin(s.p, s.p_error, s.n, sample.wi);
        if sample.t.is_finite() {
            let end = offset_origin(sample.p, sample.p_error, sample.n, o - sample.p);
            batch.push(&Ray { o, d: end - o, t_max: SEGMENT_END, time });
        } else {
            batch.push(&Ray { o, d: sample.wi, t_max: f32::INFINITY, time });
        }
    }
    batch
}

fn grazing_rays(scene: &Scene, camera: &RayBatch, hits: &[Option<Hit>]) -> RayBatch {
    let mut batch = RayBatch::default();
    for (i, hit) in hits.iter().enumerate() {
        let Some(hit) = hit else { continue };
        let time = camera.time[i];
        let ray = camera.get(i);
        let s = scene.geometry.surface_hit_of_ray(hit.geometry, hit.primitive, hit.instance, hit.uv, &ray);
        let u = uniforms(Family::Grazing, i as u32);
        // Elevations from 10⁻⁵ to 10⁻¹ radians, log-uniform
        let elevation = 10.0_f32.powf(-5.0 + 4.0 * u[0]);
        let frame = lumiris_numbers::math::Frame::from_z(s.n);
        let d = frame.to_world(warp::direction(elevation.sin(), std::f32::consts::TAU * u[1]));
        batch.push(&Ray { o: offset_origin(s.p, s.p_error, s.n, d), d, t_max: f32::INFINITY, time });
    }
    batch
}

/// Rays from outside, aimed at random points of edges, or at vertices, of random triangles.
fn edge_rays(scene: &Scene, count: u32) -> RayBatch {
    // Meshes
    let mut batch = RayBatch::default();
    let Sphere { center, radius } = scene.geometry.world_bounds().bounding_sphere();
    let meshes: Vec<_> = scene
        .geometry
        .root
        .geometries
        .iter()
        .filter_map(|&id| match &scene.geometry.geometries[id as usize].shape {
            Shape::Mesh(mesh) if mesh.triangle_count() > 0 => Some(mesh),
            Shape::Mesh(_) | Shape::Quadric(_) | Shape::Bilinear(_) | Shape::Curves(_) => None,
        })
        .collect();
    if meshes.is_empty() {
        return batch;
    }

    // One ray in four is aimed at a vertex
    for i in 0..count {
        let u = uniforms(Family::Edge, i);
        let mesh = meshes[i as usize % meshes.len()];
        let [a, b, _] = mesh.triangle(((u[0] * mesh.triangle_count() as f32) as usize).min(mesh.triangle_count() - 1));
        let target = if i % 4 == 0 { a } else { a.lerp(b, u[3]) };
        let o = center + 1.5 * radius * warp::sample_uniform_sphere([u[1], u[2]]);
        batch.push(&Ray { o, d: (target - o).normalize_or(Vec3::Z), t_max: f32::INFINITY, time: u[3] });
    }
    batch
}

struct Checker<'a> {
    scene: &'a Scene,
    family: Family,
    tally: Tally,
    examples: &'a mut Vec<Disagreement>,
}

impl Checker<'_> {
    fn check_hits(&mut self, a: &dyn Accel, b: &dyn Accel, rays: &RayBatch) {
        let (mut hits_a, mut hits_b) = (Vec::new(), Vec::new());
        a.intersect(rays, Coherence::Packets, &mut hits_a);
        b.intersect(rays, Coherence::Incoherent, &mut hits_b);
        for (i, (hit_a, hit_b)) in hits_a.iter().zip(&hits_b).enumerate() {
            let ray = rays.get(i);
            self.tally.rays += 1;
            self.tally.hits += u64::from(hit_a.is_some());
            match (hit_a, hit_b) {
                (None, None) => self.tally.equal += 1,
                (Some(x), Some(y)) => self.compare(&ray, x, y),
                (Some(x), None) | (None, Some(x)) => self.explain(&ray, x, *hit_a, *hit_b),
            }
        }
    }

    fn check_occlusion(&mut self, a: &dyn Accel, b: &dyn Accel, rays: &RayBatch) {
        let (mut bits_a, mut bits_b) = (Vec::new(), Vec::new());
        a.occluded(rays, Coherence::Packets, &mut bits_a);
        b.occluded(rays, Coherence::Incoherent, &mut bits_b);
        // The explanation needs the hit of the tracer that reports occlusion
        let (mut hit_a, mut hit_b) = (Vec::new(), Vec::new());
        for (i, (&x, &y)) in bits_a.iter().zip(&bits_b).enumerate() {
            self.tally.rays += 1;
            self.tally.hits += u64::from(x);
            if x == y {
                self.tally.equal += 1;
                continue;
            }
            let ray = rays.get(i);
            let mut one = RayBatch::default();
            one.push(&ray);
            a.intersect(&one, Coherence::Incoherent, &mut hit_a);
            b.intersect(&one, Coherence::Incoherent, &mut hit_b);
            match hit_a[0].filter(|_| x).or(hit_b[0].filter(|_| y)) {
                Some(hit) => self.explain(&ray, &hit, hit_a[0], hit_b[0]),
                None => self.disagree(&ray, hit_a[0], hit_b[0]),
            }
        }
    }

    /// Compares two hits of the same ray.
    fn compare(&mut self, ray: &Ray, a: &Hit, b: &Hit) {
        let ulps = self.t_ulps(ray, a.t, b.t);
        let same = (a.instance, a.geometry, a.primitive) == (b.instance, b.geometry, b.primitive);
        if ulps <= T_TOLERANCE_ULPS {
            self.tally.max_t_ulps = self.tally.max_t_ulps.max(ulps);
            if same {
                self.tally.equal += 1;
            } else {
                self.tally.ties += 1;
            }
        } else {
            // One tracer missed the nearer primitive
            let nearer = if a.t < b.t { a } else { b };
            self.explain(ray, nearer, Some(*a), Some(*b));
        }
    }

    /// Counts a difference as explained if rounding may decide about `hit`, else as a disagreement.
    fn explain(&mut self, ray: &Ray, hit: &Hit, a: Option<Hit>, b: Option<Hit>) {
        if self.is_marginal(ray, hit) {
            self.tally.edge_flips += 1;
        } else {
            self.disagree(ray, a, b);
        }
    }

    fn disagree(&mut self, ray: &Ray, a: Option<Hit>, b: Option<Hit>) {
        self.tally.disagreements += 1;
        if self.examples.len() < MAX_EXAMPLES {
            self.examples.push(Disagreement {
                family: self.family,
                o: (ray.o.as_dvec3() + self.scene.origin).to_array(),
                d: ray.d.to_array(),
                t_max: ray.t_max,
                t_a: a.map(|h| h.t),
                t_b: b.map(|h| h.t),
            });
        }
    }

    /// Difference of two t in units in the last place of the largest number involved.
    fn t_ulps(&self, ray: &Ray, a: f32, b: f32) -> f64 {
        let scale = ray.o.abs().max_element().max(ray.at(a.max(b)).abs().max_element());
        let in_t = scale / ray.d.abs().max_element().max(f32::MIN_POSITIVE);
        let unit = f64::from(in_t.max(a.abs()).max(b.abs())) * f64::from(f32::EPSILON);
        (f64::from(a) - f64::from(b)).abs() / unit.max(f64::from(f32::MIN_POSITIVE))
    }

    fn is_marginal(&self, ray: &Ray, hit: &Hit) -> bool {
        if self.t_ulps(ray, hit.t, 0.0) <= START_ULPS {
            return true;
        }
        let Shape::Mesh(mesh) = &self.scene.geometry.geometries[hit.geometry as usize].shape else {
            // Both tracers intersect curved shapes with the same code; only rays transformed to an instance differ
            return hit.instance != Hit::NO_INSTANCE;
        };
        let (mut o, mut d) = (ray.o.as_dvec3(), ray.d.as_dvec3());
        let world_scale = o.abs().max_element().max(ray.at(hit.t).as_dvec3().abs().max_element());
        let mut stretch = 1.0;
        if hit.instance != Hit::NO_INSTANCE {
            let m = self.scene.geometry.world_from_group_at(hit.instance, ray.time);
            let inverse = glam::DAffine3::from_cols_array(&m.to_cols_array().map(f64::from)).inverse();
            (o, d) = (inverse.transform_point3(o), inverse.transform_vector3(d));
            let columns = inverse.matrix3;
            stretch = columns.x_axis.length().max(columns.y_axis.length()).max(columns.z_axis.length());
        }
        // Distances between the ray's line and the lines of the edges, from signed volumes. A ray that grazes the
        // triangle is also near its edges
        let [a, b, c] = mesh.triangle(hit.primitive as usize).map(|p| p.as_dvec3() - o);
        let distance = |p: DVec3, q: DVec3| (d.dot(p.cross(q)) / d.cross(q - p).length()).abs();
        let nearest = [distance(a, b), distance(b, c), distance(c, a)].into_iter().fold(f64::INFINITY, f64::min);
        let coordinates = [a, b, c, o].into_iter().map(|p| p.abs().max_element()).fold(world_scale * stretch, f64::max);
        nearest.is_nan() || nearest <= EDGE_ULPS * f64::from(f32::EPSILON) * coordinates
    }
}

#[cfg(test)]
mod tests;
