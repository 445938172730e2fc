//! Columns of vertices and of their samples.

use crate::accel::RayBatch;
use crate::bsdfs::Bsdf;
use crate::lights::GlossyLobe;
use crate::lights::many::{LightSamples, LitPoints};
use crate::materials::SurfaceBsdf;
use lumiris_lanes::columns::{Column, Columns3};
use lumiris_lanes::level;
use lumiris_lanes::vertex::{self as kernels, Ends, Lambertian};
use lumiris_numbers::math::Vec3;

/// Points of surfaces, and Lambertian reflection there.
#[derive(Debug, Default)]
pub(super) struct Surface {
    pub(super) p: Columns3,
    pub(super) p_error: Columns3,
    pub(super) n: Columns3,
    /// The normal on the side that is lit; zero if both are.
    pub(super) lit: Columns3,
    pub(super) ns: Columns3,
    /// Lobes that lights are chosen by; none if no choice depends on them.
    pub(super) lobes: Vec<GlossyLobe>,
    pub(super) wo: Columns3,
    pub(super) rho: Columns3,
}

impl Surface {
    pub(super) fn lit_points(&self) -> LitPoints<'_> {
        LitPoints { p: &self.p, n: &self.lit, ns: &self.ns, lobes: &self.lobes }
    }

    pub(super) fn lambertian(&self, len: usize) -> Lambertian<'_> {
        Lambertian { rho: self.rho.get(len), ns: self.ns.get(len), wo: self.wo.get(len) }
    }

    pub(super) fn ends(&self, len: usize) -> Ends<'_> {
        Ends { p: self.p.get(len), p_error: self.p_error.get(len), n: self.n.get(len) }
    }

    /// Origins of rays in the directions of the samples.
    pub(super) fn origins(&self, samples: &mut SampleColumns, len: usize) {
        kernels::origins(level(), &self.ends(len), samples.light.wi.get(len), &mut samples.o.get_mut(len));
    }
}

/// Samples of one technique, one for each vertex.
#[derive(Debug, Default)]
pub(super) struct SampleColumns {
    pub(super) u: [Column; 3],
    /// Directions and the light that comes along them, with the density of light sampling.
    pub(super) light: LightSamples,
    pub(super) f_cos: Columns3,
    /// Density of BSDF sampling. That of the technique is 0 where there is no sample, that of the other one where only
    /// this one can draw it.
    pub(super) p_bsdf: Column,
    /// Contributions.
    pub(super) c: Columns3,
    /// Rays.
    pub(super) o: Columns3,
    pub(super) d: Columns3,
    pub(super) t_max: Column,
}

impl SampleColumns {
    /// True if sample `i`, of light or of BSDF sampling, has an unshadowed integrand f·|cos θ|·L that is not zero, whatever its
    /// weight is.
    #[inline]
    pub(super) fn has_integrand(&self, i: usize, by_light: bool) -> bool {
        let p = if by_light { self.light.pdf[i] } else { self.p_bsdf[i] };
        (p > 0.0) & !(self.f_cos.rgb(i) * self.light.li.rgb(i)).is_black()
    }
}

/// Segments of the samples that are traced.
#[derive(Debug, Default)]
pub(super) struct Traced {
    /// Places of their vertices.
    pub(super) index: Vec<u32>,
    pub(super) rays: RayBatch,
    pub(super) occluded: Vec<bool>,
}

/// A vertex that the kernels do not determine.
#[derive(Clone, Copy, Debug)]
pub(super) struct Single<'w> {
    /// Its place in the columns.
    pub(super) index: u32,
    pub(super) p: Vec3,
    pub(super) p_error: Vec3,
    pub(super) wo: Vec3,
    pub(super) bsdf: SurfaceBsdf<'w>,
}

impl Single<'_> {
    pub(super) fn is_lambertian(&self) -> bool {
        matches!(self.bsdf.bsdf, Bsdf::Diffuse(_))
    }
}

/// Vertices that the kernels of Lambertian reflection leave out.
pub(super) fn others<'s, 'w>(singles: &'s [Single<'w>]) -> impl Iterator<Item = &'s Single<'w>> {
    singles.iter().filter(|single| !single.is_lambertian())
}
