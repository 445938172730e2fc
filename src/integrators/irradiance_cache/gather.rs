//! Computes records. Indirect light comes from path tracing over a stratified hemisphere. Direct light is estimated at
//! a white Lambertian surface, whose radiance is E/π.
//!
//! A path from a record omits the emission of its first hit, which is direct light. Its random numbers follow from the
//! pixel that requests the record, so that records are independent of each other.
//!
//! The gradient of direct irradiance comes from the same samples. With weights such that Σ c_i estimates E, Σ c_i ∇ln
//! g_i estimates its gradient, where g = cos θ cos θ'/r² is the factor that changes with the point. Visibility is
//! treated as constant: the movement of shadows is ignored, and only smaller radii reduce this error.

use super::gradients::{Cells, Irradiance};
use super::record::Record;
use crate::accel::{Hit, RayBatch};
use crate::bsdfs::{Bsdf, Diffuse};
use crate::cameras::CameraRay;
use crate::direct::{Estimator, Fits, PointDirectLighting, ShadingPoint};
use crate::film::PixelSample;
use crate::integrators::camera_sample::{CameraSample, CameraSamples};
use crate::integrators::integrator::Tracer;
use crate::integrators::path::PathTracer;
use crate::integrators::statistics::PathStats;
use crate::lights::GlossyLobe;
use crate::materials::SurfaceBsdf;
use crate::media::Sides;
use crate::scene::{EmitterHit, EmitterScratch, RenderJob};
use crate::settings::{Cached, IntegratorKind, IntegratorSettings, SampleCounts};
use lumiris_numbers::estimators::ocv::block_of;
use lumiris_numbers::math::hash::pcg4d;
use lumiris_numbers::math::ray::offset_origin;
use lumiris_numbers::math::{Frame, Ray, Rgb, Vec3};
use lumiris_numbers::samplers::SampleStream;
use std::f32::consts::PI;

/// Records computed together.
pub const BATCH: usize = 16;
/// Lower bound of cosines in denominators of gradients.
const MIN_COS: f32 = 0.05;

/// Random-number domains of a record.
mod domain {
    pub(super) const CELL: u32 = 0;
    pub(super) const SOURCES: u32 = 1;
}

/// A point at which a record is requested.
#[derive(Clone, Copy, Debug)]
pub struct RecordRequest {
    /// The point.
    pub p: Vec3,
    /// Bound of the rounding error of `p`.
    pub p_error: Vec3,
    /// Geometric normal, unit.
    pub n: Vec3,
    /// Shading normal on the side of the irradiance, unit.
    pub ns: Vec3,
    /// Time in 0..1.
    pub time: f32,
    /// Width of a pixel on the surface.
    pub pixel_width: f32,
    /// Growth of the pixel width per unit length.
    pub spread: f32,
    /// The pixel that requests it.
    pub pixel: [u32; 2],
    /// Distinguishes the records of a pixel.
    pub key: u32,
}

/// Computes records; holds the buffers of one worker.
#[derive(Default)]
pub struct Gatherer {
    paths: PathTracer,
    direct: PointDirectLighting,
    samples: CameraSamples,
    results: Vec<PixelSample>,
    radiance: Vec<Rgb>,
    rays: RayBatch,
    hits: EmitterScratch,
    emitters: Vec<Option<EmitterHit>>,
}

impl Gatherer {
    /// Counts and times since the last call.
    pub fn take_stats(&mut self) -> PathStats {
        let mut stats = self.paths.take_stats();
        stats.direct.merge(&std::mem::take(&mut self.direct.stats));
        stats
    }

    /// The records of some points, in their order.
    pub fn records(&mut self, job: &RenderJob, wanted: &[RecordRequest]) -> Vec<Record> {
        let settings = &job.settings().integrator;
        let mut records = self.indirect(job, settings, wanted);
        if settings.cache.cached == Cached::All {
            for (record, sources) in records.iter_mut().zip(self.sources(job, settings, wanted)) {
                record.light = record.light.plus(&sources);
            }
        }
        records
    }

    /// Records of indirect light, with their radii.
    fn indirect(&mut self, job: &RenderJob, settings: &IntegratorSettings, wanted: &[RecordRequest]) -> Vec<Record> {
        // Paths through every cell, with one bounce less: the record's surface makes it
        let cells = Cells::new(settings.cache.samples);
        let paths = IntegratorSettings {
            kind: IntegratorKind::Path,
            max_depth: settings.max_depth.saturating_sub(1),
            ..Estimator::without_fits(settings, 1)
        };
        let sample_counts = Estimator::at_vertex(settings, 1).sample_counts();
        self.samples.clear();
        for w in wanted {
            let frame = Frame::from_z(w.ns);
            for cell in 0..cells.count() {
                let stream = w.stream(job, cell);
                let d = frame.to_world(cells.direction(cell, stream.domain(domain::CELL).draw::<2>()));
                let o = offset_origin(w.p, w.p_error, w.n, d);
                let ray = Ray { o, d, t_max: f32::INFINITY, time: w.time };
                let ray = CameraRay { ray, spread: w.spread, width0: w.pixel_width, weight: 1.0 };
                self.samples.push(&CameraSample::of_ray(ray, 1.0, stream, sample_counts));
            }
        }
        self.paths.search.only_reflected = true;
        self.paths.trace(job, &paths, &self.samples, &mut Fits::default(), &mut self.results);

        // Irradiance
        let of_record = |(w, results): (&RecordRequest, &[PixelSample])| {
            let finite = |l: Rgb| if l.is_finite() { l } else { Rgb::BLACK };
            let l: Vec<Rgb> = results.iter().map(|r| finite(r.radiance)).collect();
            let r: Vec<f32> = results.iter().map(|r| r.features.map_or(f32::INFINITY, |f| f.depth)).collect();
            let mut light = cells.irradiance(&Frame::from_z(w.ns), &l, &r);
            if !light.is_finite() {
                light = Irradiance { e: light.e, ..Irradiance::default() };
            }
            let radius = radius(&light, &r, settings.cache.error);
            Record { p: w.p, n: w.ns, light, radius, pixel_width: w.pixel_width, pixel: w.pixel }
        };
        wanted.iter().zip(self.results.chunks(cells.count() as usize)).map(of_record).collect()
    }

    /// Direct light. Progressive estimators are fitted to earlier passes of each record, in blocks.
    fn sources(&mut self, job: &RenderJob, settings: &IntegratorSettings, wanted: &[RecordRequest]) -> Vec<Irradiance> {
        let passes = settings.cache.passes.max(1);
        let mut sums = vec![Irradiance::default(); wanted.len()];
        let estimator = Estimator::at_vertex(settings, 0);
        let mut fits = estimator.fits(job, wanted.len());
        for pass in 0..passes {
            let block = block_of(pass);
            if estimator.is_progressive() && pass > 0 && block.first == pass {
                self.direct.stats.ill_conditioned += fits.solve();
                self.direct.stats.systems += wanted.len() as u64;
            }
            let points: Vec<ShadingPoint<'_>> = (0_u32..)
                .zip(wanted)
                .map(|(fit, w)| {
                    let (block, index) =
                        if estimator.is_progressive() { (block.index, pass - block.first) } else { (0, pass) };
                    ShadingPoint { fit, ..w.white_point(job, block, index, estimator.sample_counts()) }
                })
                .collect();
            self.direct.estimate(job, &estimator, &points, &mut fits, &mut self.radiance);
            for (sum, &l) in sums.iter_mut().zip(&self.radiance) {
                // E = π L of a white surface
                sum.e += l * (PI / passes as f32);
            }
            self.add_gradients(job, wanted, PI / passes as f32, &mut sums);
        }
        for sum in sums.iter_mut().filter(|s| !s.is_finite()) {
            *sum = Irradiance { e: if sum.e.is_finite() { sum.e } else { Rgb::BLACK }, ..Irradiance::default() };
        }
        sums
    }

    /// Adds `scale` times the gradients of the samples of the last estimates to the sums of their points.
    fn add_gradients(&mut self, job: &RenderJob, wanted: &[RecordRequest], scale: f32, sums: &mut [Irradiance]) {
        // Normals of the emitters at the ends of segments
        let segments = self.direct.segments();
        self.rays.clear();
        let mut free = Vec::new();
        for (i, outcome) in self.direct.outcomes().enumerate().filter(|(_, outcome)| outcome.is_free) {
            let segment = segments.get(i);
            self.rays.push(&Ray { t_max: f32::INFINITY, ..segment });
            free.push((outcome.point as usize, outcome.unshadowed * scale, segment.t_max.is_finite()));
        }
        job.world.intersect_emitters(&self.rays, &mut self.hits, &mut self.emitters);

        for (i, &(point, c, has_end)) in free.iter().enumerate() {
            let (w, sum) = (&wanted[point], &mut sums[point]);
            let d = self.rays.get(i).d;
            let r2 = d.length_squared();
            if !(r2 > 0.0) {
                continue;
            }
            let wi = d / r2.sqrt();
            Irradiance::add_gradient(&mut sum.rotation, w.ns.cross(wi), c / wi.dot(w.ns).max(MIN_COS));
            if has_end {
                let gradient = log_gradient(job, w, d, self.emitters[i].as_ref());
                // Only the tangential component
                Irradiance::add_gradient(&mut sum.translation, gradient - w.ns * gradient.dot(w.ns), c);
            }
        }
    }
}

/// ∇x ln(cos θ cos θ'/r²) up to a component along the normal, where d leads from x to the light: 4d/r² − n'/(n'·d) for
/// an emitting surface at its end, 3d/r² for a point light.
fn log_gradient(job: &RenderJob, w: &RecordRequest, d: Vec3, emitter: Option<&EmitterHit>) -> Vec3 {
    let r2 = d.length_squared();
    match emitter {
        Some(hit) if (hit.t - 1.0).abs() < 1e-3 => {
            let s = job.world.scene.geometry.surface_hit(hit.geometry, hit.primitive, Hit::NO_INSTANCE, hit.uv, w.time);
            let n = if s.n.dot(d) < 0.0 { -s.n } else { s.n };
            d * (4.0 / r2) - n / n.dot(d).max(MIN_COS * r2.sqrt())
        }
        _ => d * (3.0 / r2),
    }
}

/// R: the harmonic mean of the distances [Ward et al. 1988], at most E/|∇t E| [Křivánek et al. 2006]. κR is at most the
/// distance of the nearest surface, since the light behind it differs.
fn radius(light: &Irradiance, r: &[f32], kappa: f32) -> f32 {
    let inverse: f32 = r.iter().map(|r| 1.0 / r).sum();
    let mean = r.len() as f32 / inverse;
    let nearest = r.iter().copied().fold(f32::INFINITY, f32::min);
    let luminance = |v: [f32; 3]| Rgb::from_array(v).luminance();
    let gradient: [f32; 3] = std::array::from_fn(|axis| luminance(light.translation.map(|g| g[axis])));
    let by_gradient = light.e.luminance() / Vec3::from_array(gradient).length();
    // Without light both are 0; the quotient is NaN, which `min` ignores
    mean.min(by_gradient).min(nearest / kappa)
}

impl RecordRequest {
    /// Random numbers of sample `index` of this record.
    fn stream(&self, job: &RenderJob, index: u32) -> SampleStream {
        self.stream_of_block(job, 0, index)
    }

    /// The same for independent blocks of samples.
    fn stream_of_block(&self, job: &RenderJob, block: u32, index: u32) -> SampleStream {
        let sampling = &job.settings().sampling;
        let [seed, ..] = pcg4d([sampling.seed, self.key, 0x6972_7261, block]);
        SampleStream::new(sampling.sampler, self.pixel, index, seed)
    }

    /// A white surface at the point, for sample `index` of `block`.
    fn white_point(
        &self,
        job: &RenderJob,
        block: u32,
        index: u32,
        sample_counts: SampleCounts,
    ) -> ShadingPoint<'static> {
        // A white Lambertian surface, whose radiance is E/π
        let bsdf = SurfaceBsdf {
            bsdf: Bsdf::Diffuse(Diffuse { reflectance: Rgb::WHITE }),
            frame: Frame::from_z(self.ns),
            n: self.n,
            makes_caustics: false,
        };
        ShadingPoint {
            media: Sides::default(),
            p: self.p,
            p_error: self.p_error,
            wo: self.ns,
            bsdf,
            lobe: GlossyLobe::NONE,
            time: self.time,
            stream: self.stream_of_block(job, block, index).domain(domain::SOURCES),
            sample_counts,
            fit: 0,
            sample: 0,
        }
    }
}
