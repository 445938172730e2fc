//! The diffuse surfaces visible to the camera, for images that visualise a photon map directly: L = albedo·E/π at the
//! hit of the ray through the centre of each pixel [Keller and Wald 2000, Fig. 2].

use super::super::measure::Measured;
use lumiris::accel::{Coherence, Hit, RayBatch};
use lumiris::scene::World;
use lumiris::textures::TextureContext;
use lumiris_numbers::math::luminance;
use lumiris_numbers::math::{Ray, Rgb, Vec2, Vec3};
use std::f32::consts::FRAC_1_PI;

/// A point of a diffuse surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Seen {
    /// Position.
    pub p: Vec3,
    /// Unit normal towards the camera.
    pub n: Vec3,
    /// Reflectance.
    pub albedo: Rgb,
}

impl Seen {
    /// Reflected radiance under an irradiance.
    pub(super) fn radiance(&self, irradiance: Rgb) -> [f32; 3] {
        let l = self.albedo * irradiance * FRAC_1_PI;
        [l.r, l.g, l.b]
    }
}

/// The visible point of each pixel, row by row; `None` if there is no surface, a light, or a surface that is not purely
/// diffuse.
pub(super) fn seen(world: &World) -> Vec<Option<Seen>> {
    let scene = &world.scene;
    let [width, height] = scene.film.resolution;
    let mut rays = RayBatch::default();
    for y in 0..height {
        for x in 0..width {
            let middle = Vec2::new(x as f32 + 0.5, y as f32 + 0.5);
            rays.push(&scene.camera.ray(middle, [0.5, 0.5], 0.5).ray);
        }
    }
    let mut hits = Vec::new();
    world.accel.intersect(&rays, Coherence::Coherent, &mut hits);
    let point = |(i, hit): (usize, &Option<Hit>)| diffuse_at(world, -rays.get(i).d.normalize(), &(*hit)?);
    hits.iter().enumerate().map(point).collect()
}

fn diffuse_at(world: &World, wo: Vec3, hit: &Hit) -> Option<Seen> {
    // Lights count as not diffuse
    let scene = &world.scene;
    if hit.instance == Hit::NO_INSTANCE && scene.lights.light_of(hit.geometry, hit.primitive).is_some() {
        return None;
    }

    // The surface and its texture context
    let ray = Ray { o: Vec3::ZERO, d: -wo, t_max: f32::INFINITY, time: 0.5 };
    let surface = scene.geometry.surface_hit_of_ray(hit.geometry, hit.primitive, hit.instance, hit.uv, &ray);
    let (uv1, color, face) = (surface.vertex.uv1, surface.vertex.color, surface.vertex.face);
    let context = TextureContext {
        uv: surface.uv,
        uv_width: Vec2::ZERO,
        uv1,
        color,
        face,
        p: surface.p.as_dvec3(),
        n: surface.n,
    };

    // The material must be purely Lambertian
    let material = scene.surfaces[hit.geometry as usize].material;
    let bsdf = scene.materials.bsdf(material, &scene.textures, &surface, &context, wo)?;
    let part = bsdf.lambertian(wo).filter(|part| part.rest.is_none())?;
    let n = if surface.n.dot(wo) < 0.0 { -surface.n } else { surface.n };
    Some(Seen { p: surface.p, n, albedo: part.reflectance })
}

/// The reference image, from long renderings.
pub(super) struct Reference {
    /// Mean radiance.
    pub radiance: Vec<[f32; 3]>,
    luminance: Vec<f64>,
    /// Variance of that luminance.
    variance: Vec<f64>,
}

impl Reference {
    /// From turns of an unbiased method.
    pub(super) fn new(long: &Measured) -> Self {
        let (mean, turns) = (long.mean_radiance(), long.turns().max(1) as f64);
        Reference {
            luminance: mean.iter().map(|&p| luminance(p)).collect(),
            radiance: mean.iter().map(|p| p.map(|v| v as f32)).collect(),
            variance: long.variance_map().iter().map(|v| v / turns).collect(),
        }
    }

    /// Mean luminance over the pixels of a mask.
    pub(super) fn mean(&self, mask: &[bool]) -> f64 {
        mean_where(mask, self.luminance.iter().copied())
    }

    /// RMS difference in luminance over the pixels of a mask, relative to the mean luminance. The reference's own noise
    /// is subtracted from each square.
    pub(super) fn rmse(&self, image: &[[f32; 3]], mask: &[bool]) -> f64 {
        let square =
            |(i, p): (usize, &[f32; 3])| (luminance(p.map(f64::from)) - self.luminance[i]).powi(2) - self.variance[i];
        mean_where(mask, image.iter().enumerate().map(square)).max(0.0).sqrt() / self.mean(mask).max(1e-300)
    }

    /// Ratio of the mean luminance of an image to the reference, minus 1, over the pixels of a mask.
    pub(super) fn bias(&self, image: &[[f32; 3]], mask: &[bool]) -> f64 {
        let mean = mean_where(mask, image.iter().map(|p| luminance(p.map(f64::from))));
        mean / self.mean(mask).max(1e-300) - 1.0
    }
}

/// RMS difference in luminance from another image over the pixels of a mask, relative to the mean luminance of the
/// other image.
pub(super) fn relative_rmse(image: &[[f32; 3]], other: &[[f32; 3]], mask: &[bool]) -> f64 {
    let light = |p: &[f32; 3]| luminance(p.map(f64::from));
    let square = mean_where(mask, image.iter().zip(other).map(|(a, b)| (light(a) - light(b)).powi(2)));
    square.sqrt() / mean_where(mask, other.iter().map(light)).max(1e-300)
}

fn mean_where(mask: &[bool], values: impl Iterator<Item = f64>) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for (value, _) in values.zip(mask).filter(|(_, m)| **m) {
        sum += value;
        count += 1.0;
    }
    if count > 0.0 { sum / count } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::super::super::method::Method;
    use super::*;

    #[test]
    fn errors_leave_out_the_noise_of_the_reference_and_pixels_outside_the_mask() {
        let turns = vec![vec![1.0, 5.0, 0.0], vec![3.0, 5.0, 0.0]];
        let reference = Reference::new(&Measured::from_luminances(Method::mc(1), turns));
        let grey = |v: f32| [v; 3];
        let image = [grey(3.0), grey(5.0), grey(9.0)];
        let mask = [true, true, false];
        // Squares (3 − 2)² − 1 and 0: the mean of two turns that differ by 2 has a variance of 1
        assert!(reference.rmse(&image, &mask) < 1e-3);
        assert!((reference.rmse(&image, &[false, false, true])).is_finite());
        assert!((reference.mean(&mask) - 3.5).abs() < 1e-5);
        assert!((reference.bias(&image, &mask) - (4.0 / 3.5 - 1.0)).abs() < 1e-5);
        let off = [grey(2.0 + 8.0_f32.sqrt()), grey(5.0), grey(0.0)];
        assert!((reference.rmse(&off, &mask) - (3.5_f64).sqrt() / 3.5).abs() < 1e-4);
    }
}
