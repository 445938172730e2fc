//! The integrator with photon maps.

use super::gather_guide::{GatherGuide, GuidePhoton};
use super::lookups::Lookups;
use super::maps::{self, MapMaker, PhotonMaps};
use crate::cameras::CameraRay;
use crate::direct::{Estimator, Fits};
use crate::film::{FeatureSet, PixelSample};
use crate::integrators::camera_sample::{CameraSample, CameraSamples};
use crate::integrators::diffuse;
use crate::integrators::domain;
use crate::integrators::integrator::{Cameras, Integrator, Tracer};
use crate::integrators::path::{AtVertices, PathTracer};
use crate::integrators::statistics::{PathStats, Statistics};
use crate::photons::{GatherPoint, GatherScratch, PhotonError, Search};
use crate::scene::RenderJob;
use crate::settings::{IntegratorSettings, PhotonMapSettings};
use lumiris_numbers::math::ray::offset_origin;
use lumiris_numbers::math::{Frame, Ray, Rgb};
use std::f32::consts::FRAC_1_PI;
use std::sync::atomic::AtomicBool;

/// Number of photons that guide the directions of a gather.
const GUIDES: u32 = 32;

/// Renders with photon maps.
pub struct PhotonMapIntegrator<'a> {
    job: &'a RenderJob,
    maker: MapMaker<'a>,
    /// Maps of the current samples.
    maps: Option<PhotonMaps>,
}

impl<'a> PhotonMapIntegrator<'a> {
    /// Prepares the data common to all maps.
    pub fn new(job: &'a RenderJob, cameras: Cameras<'_>, stop: &'a AtomicBool) -> Result<Self, PhotonError> {
        let maker = MapMaker::new(job, &maps::visible_points(job, cameras), stop)?;
        Ok(PhotonMapIntegrator { job, maker, maps: None })
    }
}

impl Integrator for PhotonMapIntegrator<'_> {
    /// Progressive maps serve one sample per pixel. A map for all samples does not depend on `first`.
    fn prepare(&mut self, first: u32) -> Result<u32, PhotonError> {
        self.maps = None;
        match self.maker.make(self.job, if self.shares_noise() { first } else { 0 }) {
            Ok(maps) => self.maps = Some(maps),
            Err(PhotonError::Stopped { .. }) if self.maker.stats.maps > 0 => return Ok(0),
            Err(error) => return Err(error),
        }
        Ok(if self.shares_noise() { 1 } else { u32::MAX })
    }

    fn tracer(&self, features: FeatureSet) -> Box<dyn Tracer + '_> {
        let maps = self.maps.as_ref().expect("maps are prepared before samples are traced");
        Box::new(PhotonMapTracer {
            maps,
            paths: PathTracer::new(features),
            gather: PathTracer::default(),
            lookups: Lookups::default(),
            samples: CameraSamples::default(),
            results: Vec::new(),
        })
    }

    /// True for progressive maps: all pixels of a pass share a map.
    fn shares_noise(&self) -> bool {
        self.job.settings().integrator.photons.progressive.is_some()
    }

    fn statistics(&self, paths: PathStats) -> Statistics {
        Statistics { paths, photons: Some(self.maker.stats), ..Statistics::default() }
    }
}

/// Traces with photon maps.
struct PhotonMapTracer<'m> {
    maps: &'m PhotonMaps,
    paths: PathTracer,
    gather: PathTracer,
    lookups: Lookups,
    /// Gather rays, and their radiance.
    samples: CameraSamples,
    results: Vec<PixelSample>,
}

impl Tracer for PhotonMapTracer<'_> {
    fn trace(&mut self, job: &RenderJob, samples: &CameraSamples, fits: &mut Fits, out: &mut Vec<PixelSample>) {
        let settings = &job.settings().integrator;
        let (maps, lookups) = (self.maps, &mut self.lookups);
        lookups.requests.clear();
        let own: &mut AtVertices<'_> = &mut |vertices, out| {
            diffuse::shade(vertices, false, out, |v, part| {
                if vertices.vertex + 1 < settings.depth() {
                    lookups.look_up(maps, &settings.photons, vertices.vertex, v, part);
                }
                // Added later
                Some(Rgb::BLACK)
            })
        };
        self.paths.search.start(job, samples, out);
        self.paths.follow(job, settings, Some(own), samples, fits, out);
        self.lookups.correct(job, out);

        self.start_gather(settings);
        self.finish_gather(job, settings);
        let rays_of_request = self.results.chunks(settings.photons.gather.max(1) as usize);
        for (request, rays) in self.lookups.requests.iter().zip(rays_of_request) {
            for ray in rays {
                out[request.sample as usize].radiance += request.beta * ray.radiance;
            }
        }
    }

    fn take_stats(&mut self) -> PathStats {
        let mut stats = self.paths.take_stats();
        let mut gather = self.gather.take_stats();
        // Gather rays are not camera rays
        gather.bounce_rays += std::mem::take(&mut gather.camera_rays);
        gather.bounce_time += std::mem::take(&mut gather.camera_time);
        stats.merge(&gather);
        stats
    }
}

impl PhotonMapTracer<'_> {
    /// Generates the rays of all gathers.
    fn start_gather(&mut self, settings: &IntegratorSettings) {
        self.samples.clear();
        let sample_counts = Estimator::at_vertex(settings, 1).sample_counts();
        let PhotonMapSettings { gather: count, guide: fraction, .. } = settings.photons;
        for request in &self.lookups.requests {
            let frame = Frame::from_z(request.point.ns);
            let guide = guide(self.maps, &request.point, &frame, fraction, &mut self.lookups.scratch);
            for i in 0..count {
                let stream = request.stream.split(domain::GATHER, count, i);
                let [u_choice, u0, u1] = stream.draw::<3>();
                let w = guide.sample(u_choice, [u0, u1]);
                let pdf = guide.pdf(w);
                let d = frame.to_world(w);
                // Directions below the surface contribute nothing
                let is_above = w.z > 0.0 && pdf > 0.0 && d.dot(request.point.n) > 0.0;
                let weight = if is_above { w.z * FRAC_1_PI / (pdf * count as f32) } else { 0.0 };
                let o = offset_origin(request.point.p, request.p_error, request.point.n, d);
                let ray = Ray { o, d, t_max: f32::INFINITY, time: request.time };
                let ray = CameraRay { ray, spread: request.spread, width0: request.width, weight: 1.0 };
                self.samples.push(&CameraSample::of_ray(ray, weight, stream, sample_counts));
            }
        }
    }

    /// Traces the rays of all gathers, and looks up the maps at their hits.
    fn finish_gather(&mut self, job: &RenderJob, settings: &IntegratorSettings) {
        let (maps, lookups) = (self.maps, &mut self.lookups);
        (self.gather.search.only_reflected, self.gather.estimator_of) = (true, Some(1));
        self.gather.search.start(job, &self.samples, &mut self.results);
        self.gather.search.active.retain(|path| !path.beta.is_black());
        let own: &mut AtVertices<'_> = &mut |vertices, out| lookups.shade_hits(maps, settings, vertices, out);
        let (samples, fits) = (&self.samples, &mut Fits::default());
        self.gather.follow(job, settings, Some(own), samples, fits, &mut self.results);
        self.lookups.correct(job, &mut self.results);
    }
}

/// A guide from the photons around a vertex.
fn guide(
    maps: &PhotonMaps,
    point: &GatherPoint,
    frame: &Frame,
    fraction: f32,
    scratch: &mut GatherScratch,
) -> GatherGuide {
    let mut photons = Vec::new();
    if fraction > 0.0 {
        let search = match maps.search {
            Search::Nearest { max_radius, .. } => Search::Nearest { count: GUIDES, max_radius },
            Search::Radius(radius) => Search::Radius(radius),
        };
        // Primary photons stand for direct light, which gather rays leave out
        maps.global.gather(point, search, scratch, |photon, _| {
            if !photon.is_primary() {
                photons.push(GuidePhoton { wi: frame.to_local(photon.wi()), power: photon.power().luminance() });
            }
        });
    }
    GatherGuide::new(photons, fraction)
}
