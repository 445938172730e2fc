//! Alpha masks: decides whether a hit on a geometry with an alpha texture stops a ray. `embree/callbacks.rs` and
//! `bvh/walk.rs` call [`AlphaTest::stops`] during the traversal, so hits that do not stop a ray never leave a tracer.

use super::ray_tracer::Hit;
use crate::geometry::{AlphaSource, GeometrySet};
use lumiris_numbers::math::Ray;
use lumiris_numbers::math::hash::{hash_floats, pcg4d, unit_f32};
use std::sync::Arc;

/// The alpha test of a hit.
#[derive(Clone)]
pub struct AlphaTest {
    geometry: Arc<GeometrySet>,
    source: Arc<dyn AlphaSource>,
}

impl AlphaTest {
    /// The test for `geometry`, whose `alpha` are textures of `source`.
    pub fn new(geometry: Arc<GeometrySet>, source: Arc<dyn AlphaSource>) -> Self {
        AlphaTest { geometry, source }
    }

    /// True if the hit stops the ray, which happens with probability alpha. `world_ray` is the ray in world space, not
    /// transformed into an instance. `crossing`, 0 or 1, distinguishes hits on the same primitive.
    ///
    /// The decision is a hash of the ray and of the hit. It is therefore independent of the number and order of calls,
    /// and independent between the hits along a ray.
    pub fn stops(&self, hit: &Hit, crossing: usize, world_ray: &Ray) -> bool {
        let geometry = &self.geometry.geometries[hit.geometry as usize];
        let Some(texture) = geometry.alpha else { return true };
        let uv = geometry.shape.texture_coordinates(hit.primitive, hit.uv);
        let vertex = geometry.shape.vertex_values(hit.primitive, hit.uv);
        let alpha = self.source.alpha(texture, uv, &vertex, world_ray.at(hit.t));
        if alpha >= 1.0 {
            return true;
        }
        if alpha.is_nan() || alpha <= 0.0 {
            return false;
        }
        let (o, d) = (world_ray.o, world_ray.d);
        let ray_hash = hash_floats(&[o.x, o.y, o.z, d.x, d.y, d.z]);
        unit_f32(pcg4d([ray_hash, hit.geometry, hit.primitive, hit.instance])[crossing]) < alpha
    }
}
