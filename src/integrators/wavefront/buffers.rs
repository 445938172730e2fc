//! What a worker keeps from batch to batch, and the kernels over it.

use super::columns::{SampleColumns, Single, Surface, Traced};
use super::controls::Controls;
use super::emitters::EmitterRays;
use crate::film::PixelSample;
use crate::integrators::light_layers::LayerSums;
use crate::integrators::segment::Carried;
use crate::lights::many::Scratch;
use crate::scene::RenderJob;
use lumiris_lanes::columns::{Columns3, padded, reserve};
use lumiris_lanes::lane::LANES;
use lumiris_lanes::vertex::{self as kernels, Ends, Points, Rays, Samples, TriangleHits};
use lumiris_lanes::{level, sampler};
use lumiris_numbers::estimators::mis::Heuristic;
use lumiris_numbers::samplers::SampleStream;

/// What the next batch needs as well.
#[derive(Debug, Default)]
pub(in crate::integrators) struct Buffers {
    pub(super) paths: Vec<Carried>,
    /// Random numbers of the vertices, and of their direct light.
    pub(super) streams: Vec<SampleStream>,
    pub(super) direct: Vec<SampleStream>,
    /// What determines points, so many at a time as lanes.
    pub(super) hits: Vec<TriangleHits>,
    pub(super) surface: Surface,
    /// Direct light.
    pub(super) radiance: Columns3,
    pub(super) samples: SampleColumns,
    pub(super) drawn: Vec<SampleStream>,
    pub(super) scratch: Scratch,
    pub(super) traced: Traced,
    pub(super) emitter_rays: EmitterRays,
    pub(super) controls: Controls,
    pub(super) spare_singles: Vec<Single<'static>>,
}

/// Which random numbers of a vertex.
pub(super) enum Stream {
    /// A domain of the vertex.
    Vertex(u32),
    /// Point k of n of a domain of its direct light: (domain, n, k).
    Direct(u32, u32, u32),
}

impl Buffers {
    pub(super) fn begin(&mut self, len: usize) {
        self.paths.clear();
        self.streams.clear();
        self.direct.clear();
        if self.hits.len() < len / LANES {
            self.hits.resize(len / LANES, TriangleHits::default());
        }
        self.radiance.reserve(len);
        let Surface { p, p_error, n, lit, ns, wo, rho, .. } = &mut self.surface;
        [p, p_error, n, lit, ns, wo, rho].into_iter().for_each(|c| c.reserve(len));
        let SampleColumns { u: [u0, u1, u2], light, f_cos, p_bsdf, c, o, d, t_max } = &mut self.samples;
        light.reserve(len);
        [f_cos, c, o, d].into_iter().for_each(|c| c.reserve(len));
        reserve(&mut [u0, u1, u2, p_bsdf, t_max], len);
    }

    /// The points of hits.
    pub(super) fn find_points(&mut self, n: usize) {
        let len = padded(n);
        let Surface { p, p_error, n, lit, ns, wo, .. } = &mut self.surface;
        let [p, p_error, n, facing, ns, wo] = [p, p_error, n, lit, ns, wo].map(|c| c.get_mut(len));
        kernels::points(level(), &self.hits[..len / LANES], &mut Points { p, p_error, n, facing, ns, wo });
    }

    /// The shading normals as features of the camera samples that have features.
    pub(super) fn set_normals(&self, samples: &mut [PixelSample]) {
        for (i, path) in self.paths.iter().enumerate() {
            if let Some(features) = &mut samples[path.sample as usize].features {
                let (z, wo) = (self.surface.ns.vec3(i), self.surface.wo.vec3(i));
                features.normal = if z.dot(wo) < 0.0 { -z } else { z };
            }
        }
    }

    /// Draws three numbers for each vertex.
    pub(super) fn draw(&mut self, stream: Stream) {
        self.drawn.clear();
        match stream {
            Stream::Vertex(key) => self.drawn.extend(self.streams.iter().map(|s| s.domain(key))),
            Stream::Direct(key, n, k) => self.drawn.extend(self.direct.iter().map(|s| s.split(key, n, k))),
        }
        let n = self.drawn.len();
        sampler::draw(level(), &self.drawn, self.samples.u.each_mut().map(|u| &mut u[..n]));
    }

    /// Directions by the cosine.
    pub(super) fn sample_lambertian(&mut self, len: usize) {
        let SampleColumns { u, light, p_bsdf, .. } = &mut self.samples;
        let u = [&u[1][..len], &u[2][..len]];
        let at = self.surface.lambertian(len);
        kernels::sample_lambertian(level(), &at, u, &mut light.wi.get_mut(len), &mut p_bsdf[..len]);
    }

    /// Contributions of the samples of light or of BSDF sampling, of which there are `n_light` and `n_bsdf` per vertex.
    pub(super) fn weigh(&mut self, n: usize, [n_light, n_bsdf]: [f32; 2], heuristic: Heuristic, by_light: bool) {
        let len = padded(n);
        let SampleColumns { light, f_cos, p_bsdf, c, .. } = &mut self.samples;
        let (of_light, of_bsdf) = ((&light.pdf[..len], n_light), (&p_bsdf[..len], n_bsdf));
        let ((p, n), (p_other, n_other)) = if by_light { (of_light, of_bsdf) } else { (of_bsdf, of_light) };
        let (f_cos, li) = (f_cos.get(len), light.li.get(len));
        let samples = Samples { f_cos, li, p, p_other, n, n_other, heuristic };
        kernels::weigh(level(), &samples, &mut c.get_mut(len));
    }

    /// Adds the contributions of the last samples that are unoccluded to the layers of their lights.
    pub(super) fn add_to_layers(&self, job: &RenderJob, by_light: bool, layers: &mut LayerSums) {
        let only = job.lights.sampler.only_light();
        let visible = self.traced.index.iter().zip(&self.traced.occluded).filter(|(_, occluded)| !**occluded);
        for i in visible.map(|(&i, _)| i as usize) {
            let (path, wi) = (&self.paths[i], self.samples.light.wi.vec3(i));
            let p = self.surface.lit_points().get(i).p;
            let contribution = path.beta * self.samples.c.rgb(i);
            let drawn = || Some(only.unwrap_or_else(|| self.scratch.chosen(i)));
            match if by_light { drawn() } else { self.emitter_rays.lights[i] } {
                Some(light) => layers.add(&job.lights, path.sample, (light, p, wi), contribution),
                None => layers.add_infinite(&job.lights, path.sample, (p, wi), contribution),
            }
        }
    }

    /// The segments of the samples that `is_traced` holds for.
    pub(super) fn make_segments(&mut self, n: usize, is_traced: impl Fn(&SampleColumns, usize) -> bool) {
        let len = padded(n);
        let SampleColumns { light, o, d, t_max, .. } = &mut self.samples;
        let from = self.surface.ends(len);
        let to = Ends { p: light.p.get(len), p_error: light.p_error.get(len), n: light.n.get(len) };
        let mut rays = Rays { o: o.get_mut(len), d: d.get_mut(len), t_max: &mut t_max[..len] };
        kernels::segments(level(), &from, light.wi.get(len), &to, &light.is_far[..len], &mut rays);

        let Traced { index, rays, .. } = &mut self.traced;
        index.clear();
        index.extend((0..n as u32).filter(|&i| is_traced(&self.samples, i as usize)));
        rays.clear();
        let SampleColumns { o, d, t_max, .. } = &self.samples;
        let ([ox, oy, oz], [dx, dy, dz]) = (o.get(len), d.get(len));
        let columns = [
            (&mut rays.ox, ox),
            (&mut rays.oy, oy),
            (&mut rays.oz, oz),
            (&mut rays.dx, dx),
            (&mut rays.dy, dy),
            (&mut rays.dz, dz),
            (&mut rays.t_max, &t_max[..len]),
        ];
        for (to, from) in columns {
            to.extend(index.iter().map(|&i| from[i as usize]));
        }
        rays.time.extend(index.iter().map(|&i| self.paths[i as usize].time));
    }
}
