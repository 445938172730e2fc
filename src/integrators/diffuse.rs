//! Camera paths that replace the light reflected by Lambertian lobes by a lookup: in irradiance records or photon maps.
//!
//! At each vertex, the light reflected by the Lambertian lobe ([`crate::bsdfs::Bsdf::lambertian`]) is looked up, and
//! the path continues with the other lobes (mirrors, glass, coats, metals). If the lookup misses, or there is no
//! Lambertian lobe, the vertex is handled as in `path`. So no light is counted twice or lost.

use super::path::{BatchVertices, PathVertex, Shading};
use crate::bsdfs::Lambertian;
use crate::film::PixelSample;
use crate::materials::SurfaceBsdf;
use lumiris_numbers::math::Rgb;

/// Adds to `out` the light that the Lambertian lobes at the vertices reflect to the viewer. `reflected` returns this
/// radiance, or `None` if the lookup misses. It includes direct light if `includes_direct` is true.
pub(super) fn shade<'w>(
    found: &BatchVertices<'_, 'w>,
    includes_direct: bool,
    out: &mut [PixelSample],
    mut reflected: impl FnMut(&PathVertex<'_, 'w>, &Lambertian<'_>) -> Option<Rgb>,
) -> Vec<Shading<'w>> {
    let shading = |v: PathVertex<'_, 'w>| {
        let (path, bsdf) = (v.path, v.point.bsdf);
        let all = Some(bsdf);
        let looked_up = bsdf.lambertian(v.point.wo).and_then(|part| Some((reflected(&v, &part)?, part.rest)));
        let Some((reflected, rest)) = looked_up else { return Shading { direct: all, next: all } };
        out[path.sample as usize].radiance += path.beta * reflected;
        let rest = rest.map(|rest| SurfaceBsdf { bsdf: rest, ..bsdf });
        Shading { direct: if includes_direct { rest } else { all }, next: rest }
    };
    found.each().map(shading).collect()
}
