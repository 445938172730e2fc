//! Sampling of emitted rays: the start of photon paths.
//!
//! A sample is a ray with the power Φ = Le·|cos θ|/(p_A·p_ω), where p_A is the density of its origin (1/m²) and p_ω is
//! the density of its direction (1/sr). E\[Φ\] is therefore the emitted flux (W). For delta lights with a position, the
//! intensity replaces Le·|cos θ|/p_A.
//!
//! | light | origin | direction | Φ |
//! |---|---|---|---|
//! | point | its position | uniform on the sphere | 4π·I, constant |
//! | spot | its position | by its falloff | I times the solid angle of the falloff, constant |
//! | goniometric, projection | its position | by its image | I/p_ω |
//! | area | by area, see [`area`](super::kinds::area) | cosine about the normal, of one side or of either | π·Le/p_A |
//! | distant | disk | its own | π·R²·E, constant |
//! | portal | uniform over it, moved back by the scene's size | by the part of its image that passes | A·Le·cos θ/p_ω |
//! | environment | disk | by its image, or uniform | π·R²·Le/p_ω |
//!
//! The disk has the radius R of the scene's bounding sphere, is perpendicular to the direction and touches that sphere
//! on the side the light comes from [Pharr et al. 2023, §12.2, §12.5]. Flux that misses the scene is included.

use super::kinds::area::AreaLight;
use super::light::Light;
use super::light_sample::{EmissionSample, EmittingPoint};
use lumiris_numbers::math::warp::{
    pdf_uniform_sphere, sample_cosine_hemisphere, sample_uniform_disk_concentric, sample_uniform_sphere,
};
use lumiris_numbers::math::{Frame, ONE_MINUS_EPSILON, Rgb, Sphere, Vec3};
use std::f32::consts::PI;

impl Light {
    /// Samples light that leaves this source into a scene with the given bounding sphere.
    /// Returns `None` if the sample carries no power. The first number of `u_direction` also chooses the side of a
    /// two-sided surface.
    pub fn sample_le(&self, scene: Sphere, u_position: [f32; 2], u_direction: [f32; 2]) -> Option<EmissionSample> {
        match self {
            Light::Point(light) => light.sample_le(u_direction),
            Light::Spot(light) => light.sample_le(u_direction),
            Light::Image(light) => light.sample_le(u_direction),
            Light::Distant(light) => from_infinity(scene, u_position, light.wi, light.irradiance),
            Light::Area(area) => area.sample_le(u_position, u_direction),
            Light::InfiniteConstant { l } => {
                from_infinity(scene, u_position, sample_uniform_sphere(u_direction), *l / pdf_uniform_sphere())
            }
            Light::InfiniteImage { map, world_from_light, scale } => {
                let s = map.sample(u_direction)?;
                from_infinity(scene, u_position, *world_from_light * s.w, s.le * (*scale / s.pdf))
            }
            Light::Portal(light) => light.sample_le(scene, u_position, u_direction),
            Light::Volume(_) => None,
        }
    }
}

/// Light from the unit direction `wi` through the disk that the scene projects to; `irradiance` is the irradiance of
/// the disk.
fn from_infinity(
    Sphere { center, radius }: Sphere,
    u_position: [f32; 2],
    wi: Vec3,
    irradiance: Rgb,
) -> Option<EmissionSample> {
    let on_disk = sample_uniform_disk_concentric(u_position);
    let p = center + Frame::from_z(wi).to_world(on_disk.extend(1.0)) * radius;
    EmissionSample::in_space(p, -wi, irradiance * (PI * radius * radius))
}

impl AreaLight {
    /// Samples a point of the surface, uniform or nearly uniform in area, and its emission in the unit direction `d`.
    pub fn sample_point_towards(&self, u_position: [f32; 2], d: Vec3) -> EmittingPoint {
        let point = self.sample_point(u_position);
        let faces = point.n.dot(d) > 0.0;
        let radiance = if faces || self.emission.two_sided { self.radiance(point.p) } else { Rgb::BLACK };
        let n = if faces { point.n } else { -point.n };
        EmittingPoint { p: point.p, p_error: point.p_error, n, pdf_area: point.pdf_area, radiance }
    }

    /// [`Light::sample_le`] of a surface: by area, and by the cosine about the normal.
    fn sample_le(&self, u_position: [f32; 2], u_direction: [f32; 2]) -> Option<EmissionSample> {
        let point = self.sample_point(u_position);

        // Choose the side
        let [u, v] = u_direction;
        let (u, n, sides) = match (self.emission.two_sided, u < 0.5) {
            (false, _) => (u, point.n, 1.0),
            (true, true) => (2.0 * u, point.n, 2.0),
            (true, false) => ((2.0 * u - 1.0).min(ONE_MINUS_EPSILON), -point.n, 2.0),
        };

        // The cosine of the radiance cancels with the cosine of the density, cos θ/π.
        let d = Frame::from_z(n).to_world(sample_cosine_hemisphere([u, v])).normalize();
        let power = self.radiance(point.p) * (PI * sides / point.pdf_area);
        EmissionSample { p: point.p, p_error: point.p_error, n, d, power }.if_lit()
    }
}
