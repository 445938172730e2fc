//! Camera paths that take the light reflected by the Lambertian parts of BSDFs from elsewhere: from irradiance records
//! or from photons.
//!
//! At each vertex, the light reflected by the Lambertian part ([`crate::bsdfs::Bsdf::lambertian`]) is looked up, and
//! the path continues with the other lobes (mirrors, glass, coats, metals) to the next vertex, which does the same. A
//! vertex where the lookup misses, or without such a part, continues as in `path`. So no light is counted twice or
//! lost.

use super::path::{Found, Shading};
use super::segment::{PathState, Vertex};
use crate::bsdfs::Lambertian;
use crate::film::PixelSample;
use crate::materials::SurfaceBsdf;
use lumiris_numbers::math::Rgb;

/// Adds to `out` what the Lambertian parts of the vertices of some paths reflect to the viewer: `reflected`, where that
/// is available. It may include direct light.
pub(super) fn shade<'w>(
    found: &Found<'_, 'w>,
    includes_direct: bool,
    out: &mut [PixelSample],
    mut reflected: impl FnMut(&PathState, &Vertex<'w>, &Lambertian<'_>) -> Option<Rgb>,
) -> Vec<Shading<'w>> {
    let shading = |(path, v): (&PathState, &Vertex<'w>)| {
        let all = Some(v.bsdf);
        let known = v.bsdf.lambertian(v.wo).and_then(|part| Some((reflected(path, v, &part)?, part.rest)));
        let Some((known, rest)) = known else { return Shading { lit: all, next: all } };
        out[path.sample as usize].radiance += path.beta * known;
        let rest = rest.map(|bsdf| SurfaceBsdf { bsdf, ..v.bsdf });
        Shading { lit: if includes_direct { rest } else { all }, next: rest }
    };
    found.paths.iter().zip(found.vertices).map(shading).collect()
}
