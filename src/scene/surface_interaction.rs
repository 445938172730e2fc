//! A surface interaction: a hit with the data for shading.

use super::job::RenderJob;
use crate::accel::Hit;
use crate::geometry::{SurfaceHit, VertexValues};
use crate::materials::{Dispersion, SurfaceBsdf};
use crate::media::{MediumId, Sides};
use crate::textures::TextureContext;
use lumiris_numbers::math::ray::offset_origin;
use lumiris_numbers::math::{Ray, Vec2, Vec3};

/// A ray with its first hit.
#[derive(Clone, Copy, Debug)]
pub struct RayHit {
    /// The ray.
    pub ray: Ray,
    /// The hit.
    pub hit: Hit,
    /// Width of a pixel at the origin of the ray, along the path (m).
    pub width: f32,
    /// Growth of the width per unit length.
    pub spread: f32,
}

impl RayHit {
    /// The first hit of a ray that is not part of a path from the camera.
    #[inline]
    pub fn of_ray(ray: &Ray, hit: &Hit) -> Self {
        RayHit { ray: *ray, hit: *hit, width: 0.0, spread: 0.0 }
    }
}

/// A ray's hit on a surface, with its differential geometry and texture footprint.
#[derive(Clone, Copy, Debug)]
pub struct SurfaceInteraction {
    /// The hit.
    pub hit: Hit,
    /// The point on the surface.
    pub surface: SurfaceHit,
    /// Unit direction towards the origin of the ray.
    pub wo: Vec3,
    /// Width of a pixel at the hit along the path (m).
    pub width: f32,
    /// Distance along the ray (m).
    pub distance: f32,
    /// Extent of the texture footprint in uv, per axis.
    uv_width: Vec2,
}

impl SurfaceInteraction {
    /// The interaction of a ray with the surface that it hits.
    pub fn new(job: &RenderJob, ray_hit: &RayHit) -> Self {
        let RayHit { ray, hit, .. } = ray_hit;
        let set = &job.world.scene.geometry;
        let surface = set.surface_hit_of_ray(hit.geometry, hit.primitive, hit.instance, hit.uv, ray);
        Self::at(job, ray_hit, surface, -ray.d.normalize(), inverse_lengths(&surface))
    }

    /// The interaction at a surface point. `inverse_lengths` are 1/|∂p/∂u| and 1/|∂p/∂v|.
    ///
    /// The texture footprint is the pixel that sees the point directly, for every kind of path. Light paths, photons
    /// and shadow rays must evaluate the same surface as the camera paths that they are combined with.
    #[inline]
    pub(super) fn at(job: &RenderJob, ray_hit: &RayHit, surface: SurfaceHit, wo: Vec3, inverse_lengths: Vec2) -> Self {
        let RayHit { ray, hit, width, spread } = ray_hit;
        let distance = hit.t * ray.d.length();
        let seen = job.world.scene.camera.pixel_width(surface.p, ray.time);
        let uv_width = inverse_lengths * (seen * job.settings().sampling.footprint());
        SurfaceInteraction { hit: *hit, surface, wo, width: width + spread * distance, distance, uv_width }
    }

    /// Inputs of texture lookups.
    #[inline]
    fn context(&self) -> TextureContext {
        let SurfaceHit { p, n, uv, vertex: VertexValues { uv1, color, face }, .. } = self.surface;
        TextureContext { uv, uv_width: self.uv_width, uv1, color, face, p: p.as_dvec3(), n }
    }

    /// Requests the texels of [`Self::scatter`], if it is called soon.
    pub fn prefetch(&self, job: &RenderJob) {
        let scene = &job.world.scene;
        let material = scene.surfaces[self.hit.geometry as usize].material;
        scene.materials.prefetch(material, &scene.textures, &self.context());
    }

    /// The BSDF at the hit; `None` if rays pass the surface.
    pub fn scatter<'j>(&self, job: &'j RenderJob) -> Option<SurfaceBsdf<'j>> {
        let scene = &job.world.scene;
        let material = scene.surfaces[self.hit.geometry as usize].material;
        let bsdf = scene.materials.bsdf(material, &scene.textures, &self.surface, &self.context(), self.wo)?;
        Some(bsdf.proposed_by(job.settings().integrator.bsdf_density))
    }

    /// True if the material is a mixture, from which the direction chooses one material.
    pub fn is_mixture(&self, job: &RenderJob) -> bool {
        let scene = &job.world.scene;
        scene.materials.is_mixture(scene.surfaces[self.hit.geometry as usize].material)
    }

    /// The wavelength dependence of the material's index of refraction, if any.
    pub fn dispersion<'j>(&self, job: &'j RenderJob) -> Option<&'j Dispersion> {
        let scene = &job.world.scene;
        let material = scene.surfaces[self.hit.geometry as usize].material;
        let id = scene.materials.resolve(material, &scene.textures, &self.context(), self.wo)?;
        scene.materials.entries()[id as usize].dispersion.as_deref()
    }

    /// The media on the sides of the surface, for a ray in `medium`.
    #[inline]
    pub fn sides(&self, job: &RenderJob, medium: Option<MediumId>) -> Sides {
        job.world.scene.surfaces[self.hit.geometry as usize].sides.unwrap_or(Sides::both(medium))
    }

    /// The medium that a ray of direction `d` in `medium` enters by passing the surface.
    #[inline]
    pub fn medium_beyond(&self, job: &RenderJob, d: Vec3, medium: Option<MediumId>) -> Option<MediumId> {
        self.sides(job, medium).towards(self.surface.n.dot(d))
    }

    /// Origin of a ray that leaves the surface in direction `w`.
    pub fn origin(&self, w: Vec3) -> Vec3 {
        offset_origin(self.surface.p, self.surface.p_error, self.surface.n, w)
    }
}

/// 1/|∂p/∂u| and 1/|∂p/∂v|; 0 where the derivative is.
pub(super) fn inverse_lengths(surface: &SurfaceHit) -> Vec2 {
    let inverse = |d: Vec3| {
        let length = d.length();
        if length > 0.0 { 1.0 / length } else { 0.0 }
    };
    Vec2::new(inverse(surface.dpdu), inverse(surface.dpdv))
}
