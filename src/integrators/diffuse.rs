//! Camera paths that take the light reflected by the Lambertian parts of BSDFs from elsewhere: from irradiance records
//! or from photons.
//!
//! At each vertex, the light reflected by the Lambertian part ([`crate::bsdfs::Bsdf::lambertian`]) is looked up, and
//! the path continues with the other lobes (mirrors, glass, coats, metals) to the next vertex, which does the same. A
//! vertex where the lookup misses, or without such a part, continues as in `path`. So no light is counted twice or
//! lost.

use super::path::{self, CameraSample, PathIntegrator, Vertex};
use super::segment::PathState;
use crate::bsdfs::Lambertian;
use crate::direct::{Estimator, Fits, ShadingPoint};
use crate::film::PixelSample;
use crate::materials::SurfaceBsdf;
use crate::scene::RenderJob;
use crate::settings::IntegratorSettings;
use lumiris_numbers::math::{Rgb, Vec3};

/// A source of the light reflected by Lambertian parts.
pub(super) trait Reflected {
    /// Radiance that the Lambertian part of a vertex, the `vertex`-th of its path from 0, reflects to the viewer;
    /// `None` if it is not available.
    fn reflected(&mut self, path: &PathState, vertex: u32, v: &Vertex<'_>, part: &Lambertian<'_>) -> Option<Rgb>;

    /// True if that includes direct light.
    fn has_sources(&self) -> bool;
}

/// How the light of a vertex is computed.
struct Shading<'w> {
    /// Radiance that is known.
    known: Rgb,
    /// BSDF for which direct light is estimated; `None` if it is known.
    lit: Option<SurfaceBsdf<'w>>,
    /// BSDF by which the path continues; `None` if it ends.
    next: Option<SurfaceBsdf<'w>>,
}

/// Estimates the radiance of each camera sample; `out[i]` belongs to `samples[i]`. `fits` are those of the samples'
/// pixels.
pub(super) fn trace(
    paths: &mut PathIntegrator,
    job: &RenderJob,
    source: &mut dyn Reflected,
    samples: &[CameraSample],
    fits: &mut Fits,
    out: &mut Vec<PixelSample>,
) {
    let settings = &job.settings().integrator;
    let depth = settings.depth();
    paths.start(samples, out);
    for vertex in 0..=depth {
        if paths.active.is_empty() {
            break;
        }
        let vertices = paths.find_vertices(job, vertex, depth, samples, out, None);
        let estimator = Estimator::at_vertex(settings, vertex);
        let sample_counts = estimator.sample_counts();
        let shadings: Vec<Shading<'_>> =
            paths.active.iter().zip(&vertices).map(|(path, v)| shade(source, path, vertex, v)).collect();
        let points: Vec<ShadingPoint<'_>> = (vertices.iter().zip(&paths.active))
            .map(|(v, path)| {
                let sample_counts =
                    if vertex == 0 { samples[path.sample as usize].sample_counts } else { sample_counts };
                v.shading_point(path.ray.time, sample_counts, samples[path.sample as usize].fit)
            })
            .collect();
        light(paths, job, &estimator, (&shadings, &points), fits, out);
        extend(paths, settings, vertex, (&vertices, &shadings, &points));
        paths.recycle(vertices);
    }
}

/// Queries the source.
fn shade<'w>(source: &mut dyn Reflected, path: &PathState, vertex: u32, v: &Vertex<'w>) -> Shading<'w> {
    let by_path = Shading { known: Rgb::BLACK, lit: Some(v.bsdf), next: Some(v.bsdf) };
    let Some(part) = v.bsdf.lambertian(v.wo) else { return by_path };
    let Some(known) = source.reflected(path, vertex, v, &part) else { return by_path };
    let rest = part.rest.map(|bsdf| SurfaceBsdf { bsdf, ..v.bsdf });
    Shading { known, lit: if source.has_sources() { rest } else { Some(v.bsdf) }, next: rest }
}

/// Adds the known radiance, and estimates direct light where it is not known.
fn light(
    paths: &mut PathIntegrator,
    job: &RenderJob,
    estimator: &Estimator,
    (shadings, points): (&[Shading<'_>], &[ShadingPoint<'_>]),
    fits: &mut Fits,
    out: &mut [PixelSample],
) {
    for (path, shading) in paths.active.iter().zip(shadings) {
        out[path.sample as usize].radiance += path.beta * shading.known;
    }
    let lit: Vec<ShadingPoint<'_>> = (shadings.iter().zip(points))
        .filter_map(|(shading, point)| shading.lit.map(|bsdf| ShadingPoint { bsdf, ..*point }))
        .collect();
    paths.direct.estimate(job, estimator, &lit, fits, &mut paths.radiance);
    let lit_paths = paths.active.iter().zip(shadings).filter(|(_, shading)| shading.lit.is_some());
    for ((path, _), &radiance) in lit_paths.zip(&paths.radiance) {
        out[path.sample as usize].radiance += path.beta * radiance;
    }
}

/// Continues the paths that have a lobe left.
fn extend(
    paths: &mut PathIntegrator,
    settings: &IntegratorSettings,
    vertex: u32,
    (vertices, shadings, points): (&[Vertex<'_>], &[Shading<'_>], &[ShadingPoint<'_>]),
) {
    paths.next.clear();
    if vertex + 1 < settings.depth() {
        let all = paths.active.iter().zip(vertices).zip(shadings).zip(points);
        paths.next.extend(all.filter_map(|(((path, v), shading), point)| {
            let v = Vertex { bsdf: shading.next?, ..*v };
            Some(path::extend(path, &v, point, vertex, settings)?.0)
        }));
    }
    std::mem::swap(&mut paths.active, &mut paths.next);
}

/// The shading normal on the side of the viewer.
pub(super) fn viewer_normal(v: &Vertex<'_>) -> Vec3 {
    let z = v.bsdf.frame.z;
    if z.dot(v.wo) < 0.0 { -z } else { z }
}
