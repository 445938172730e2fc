//! Unoccluded irradiance of lights in closed form: E = ∫ L̄ cos θ dω, with the mean radiance L̄ of the light and θ
//! about a unit normal n, over the part of the light above the horizon of n.
//!
//! | light | E |
//! |---|---|
//! | triangle, rectangle | L̄/2 · abs Σ_edges γᵢ (Γᵢ · n), polygon above the horizon [Lambert 1760; Baum et al. 1989] |
//! | one-sided sphere, seen from outside and wholly above the horizon | L̄ π (r/d)² cos θ_c |
//! | constant environment | π L |
//!
//! γᵢ is the angle subtended by an edge; Γᵢ is the unit normal of the plane through the edge and the point. r is the
//! radius of the sphere, d the distance of its centre, θ_c the angle of its centre.
//!
//! E is not available for other lights, for flat lights at grazing angles, or for surfaces with alpha masks, whose
//! extent differs from the shape. These count as black, in E and in L̄.

use super::choice::set::LightSet;
use super::kinds::area::{AreaLight, AreaShape};
use super::light::Light;
use super::light_sample::{LightId, SurfacePoint};
use crate::geometry::GeometryId;
use glam::DVec3;
use lumiris_numbers::math::{Rgb, Sphere, Vec3, sqr};
use std::f32::consts::PI;

/// Distance from the plane of a flat light, relative to its extent, below which the light counts as edge-on: rounding
/// decides there on which side the point is.
const EDGE_ON: f32 = 1e-4;

/// The lights of a set that have an irradiance in closed form.
#[derive(Clone, Debug, Default)]
pub struct Irradiances {
    /// Area lights, ascending.
    area: Vec<LightId>,
    /// L̄ of each light; black if E is not available.
    mean_l: Vec<Rgb>,
    /// Radiance of all constant environments.
    environment: Rgb,
}

impl Irradiances {
    /// The irradiances of a light set; `has_alpha` tells which geometries have alpha masks.
    pub fn new(set: &LightSet, has_alpha: impl Fn(GeometryId) -> bool) -> Self {
        let mut mean_l: Vec<Rgb> = set.lights.iter().map(mean_l).collect();
        for (_, light) in set.emitters().filter(|(geometry, _)| has_alpha(*geometry)) {
            mean_l[light as usize] = Rgb::BLACK;
        }
        let is_area = |&i: &usize| matches!(set.lights[i], Light::Area(_)) && !mean_l[i].is_black();
        let area = (0..mean_l.len()).filter(is_area).map(|i| i as LightId).collect();
        let environment = set.infinite.iter().map(|&i| mean_l[i as usize]).sum();
        Irradiances { area, mean_l, environment }
    }

    /// E of all lights together at `p` about the unit normal `n`.
    pub fn irradiance(&self, set: &LightSet, p: Vec3, n: Vec3) -> Rgb {
        let area = |&i: &LightId| {
            let Light::Area(light) = &set.lights[i as usize] else { return Rgb::BLACK };
            self.mean_l[i as usize] * form(light, p, n)
        };
        self.environment * PI + self.area.iter().map(area).sum()
    }

    /// The radiance that E includes for an area light, from a point with the normal `n_light` to `at` along `−wi`. `wi`
    /// is above the horizon.
    pub fn l(&self, set: &LightSet, light: LightId, at: SurfacePoint, wi: Vec3, n_light: Vec3) -> Rgb {
        let Light::Area(area) = &set.lights[light as usize] else { return Rgb::BLACK };
        let mean_l = self.mean_l[light as usize];
        if !mean_l.is_black() && faces(area, at, wi, n_light) { mean_l } else { Rgb::BLACK }
    }

    /// The radiance that E includes for infinite lights, the same in every direction above the horizon.
    #[inline]
    pub fn environment(&self) -> Rgb {
        self.environment
    }
}

/// L̄ of a light; black if E is never available, or if the light has no power.
fn mean_l(light: &Light) -> Rgb {
    // E is available for flat and spherical lights, and constant environments
    let l = match light {
        Light::Area(area) => match &area.shape {
            AreaShape::Triangle(_) | AreaShape::Rectangle(_) => area.mean_radiance(),
            AreaShape::Quadric(quadric) if quadric.outward_sphere().is_some() && !area.emission.two_sided => {
                area.mean_radiance()
            }
            AreaShape::Quadric(_) | AreaShape::Patch(_) => Rgb::BLACK,
        },
        Light::InfiniteConstant { l } => *l,
        Light::Point(_)
        | Light::Spot(_)
        | Light::Image(_)
        | Light::Distant(_)
        | Light::InfiniteImage { .. }
        | Light::Portal(_)
        | Light::Volume(_) => Rgb::BLACK,
    };
    if l.is_finite() && l.luminance() > 0.0 { l } else { Rgb::BLACK }
}

/// The corners of a flat light. A triangle repeats its last corner.
fn corners(area: &AreaLight) -> Option<[Vec3; 4]> {
    match &area.shape {
        AreaShape::Triangle(t) => Some([t.p[0], t.p[1], t.p[2], t.p[2]]),
        AreaShape::Rectangle(r) => {
            let (x, y) = (r.ex * r.size.x, r.ey * r.size.y);
            Some([r.corner, r.corner + x, r.corner + x + y, r.corner + y])
        }
        AreaShape::Quadric(_) | AreaShape::Patch(_) => None,
    }
}

/// A sphere that is wholly above the horizon and does not contain `p`.
fn sphere_above(area: &AreaLight, p: Vec3, n: Vec3) -> Option<Sphere> {
    let AreaShape::Quadric(quadric) = &area.shape else { return None };
    let sphere = quadric.outward_sphere()?;
    (n.dot(sphere.center - p) > sphere.radius && !area.is_dark_from(p)).then_some(sphere)
}

/// True if a flat light with the given normal illuminates `p` and is not edge-on.
fn shines_on(area: &AreaLight, corners: &[Vec3; 4], n_light: Vec3, p: Vec3) -> bool {
    let extent = (corners[2] - corners[0]).length().max((corners[1] - corners[0]).length());
    let height = n_light.dot(p - corners[0]);
    (if area.emission.two_sided { height.abs() } else { height }) > EDGE_ON * extent
}

/// True if E at the point includes the light in the direction `wi`.
fn faces(area: &AreaLight, SurfacePoint { p, n }: SurfacePoint, wi: Vec3, n_light: Vec3) -> bool {
    match &area.shape {
        AreaShape::Triangle(t) => corners(area).is_some_and(|c| shines_on(area, &c, t.n, p)),
        AreaShape::Rectangle(r) => corners(area).is_some_and(|c| shines_on(area, &c, r.n, p)),
        AreaShape::Quadric(_) => n_light.dot(wi) < 0.0 && sphere_above(area, p, n).is_some(),
        AreaShape::Patch(_) => false,
    }
}

/// E for L̄ = 1.
fn form(area: &AreaLight, p: Vec3, n: Vec3) -> f32 {
    let n_light = match &area.shape {
        AreaShape::Triangle(t) => t.n,
        AreaShape::Rectangle(r) => r.n,
        AreaShape::Quadric(_) | AreaShape::Patch(_) => Vec3::ZERO,
    };
    match corners(area) {
        Some(corners) if shines_on(area, &corners, n_light, p) => {
            polygon_irradiance(&corners.map(|c| c.as_dvec3() - p.as_dvec3()), n.as_dvec3()) as f32
        }
        Some(_) => 0.0,
        None => sphere_above(area, p, n).map_or(0.0, |Sphere { center, radius }| {
            let d = center - p;
            let distance = d.length();
            PI * sqr(radius / distance) * n.dot(d) / distance
        }),
    }
}

/// ∫ cos θ dω over the part of a convex quadrilateral above the horizon of `n`; the point is at the origin, outside its
/// plane.
fn polygon_irradiance(corners: &[DVec3; 4], n: DVec3) -> f64 {
    // Clip
    let mut clipped = [DVec3::ZERO; 5];
    let mut count = 0;
    let mut push = |v: DVec3| {
        if let Some(place) = clipped.get_mut(count) {
            *place = v;
            count += 1;
        }
    };
    let heights = corners.map(|v| n.dot(v));
    for i in 0..4 {
        let j = (i + 1) % 4;
        if heights[i] >= 0.0 {
            push(corners[i]);
        }
        if (heights[i] >= 0.0) != (heights[j] >= 0.0) {
            push(corners[i].lerp(corners[j], heights[i] / (heights[i] - heights[j])));
        }
    }

    // Sum over the edges
    let clipped = &clipped[..count];
    let next = clipped.iter().cycle().skip(1);
    let edge = |(&a, &b): (&DVec3, &DVec3)| {
        let cross = a.cross(b);
        let length = cross.length();
        if length > 0.0 { length.atan2(a.dot(b)) * (n.dot(cross) / length) } else { 0.0 }
    };
    0.5 * clipped.iter().zip(next).map(edge).sum::<f64>().abs()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Quadric, QuadricKind, Shape, TriangleMesh};
    use crate::lights::{
        DistantLight, Emission, EmissionImage, JobLights, LightCtx, LightHit, LightSamplerKind, LightSetBuilder,
        SampleOfLight,
    };
    use lumiris_numbers::math::warp::sample_uniform_sphere;
    use lumiris_numbers::math::{Affine3A, Bounds3, Vec2};
    use lumiris_test_support::Moments;
    use lumiris_test_support::random::{Pcg32, RngExt, pcg32};
    use std::sync::Arc;

    const POINTS: u32 = 40;

    fn mesh(p: &[Vec3], indices: &[[u32; 3]]) -> Shape {
        Shape::Mesh(TriangleMesh::new(p.to_vec(), indices.to_vec()).unwrap())
    }

    fn sphere(center: Vec3, radius: f32, flip_normal: bool) -> Shape {
        let kind = QuadricKind::Sphere { radius, z_min: -radius, z_max: radius, phi_max: std::f32::consts::TAU };
        Shape::Quadric(Quadric::new(kind, Affine3A::from_translation(center), flip_normal))
    }

    fn shapes() -> Vec<Shape> {
        let v = Vec3::new;
        vec![
            mesh(&[v(0.0, 0.0, 1.0), v(0.0, 2.0, 1.0), v(1.0, 2.0, 1.0), v(1.0, 0.0, 1.0)], &[[0, 1, 2], [0, 2, 3]]),
            mesh(&[v(-1.0, 0.0, -1.0), v(0.5, 1.5, 0.3), v(0.2, -1.0, 1.0)], &[[0, 1, 2]]),
            sphere(v(0.3, 0.2, 0.5), 0.4, false),
        ]
    }

    fn set(shapes: &[Shape], emission: &Emission) -> Arc<LightSet> {
        let mut builder = LightSetBuilder::default();
        for (i, shape) in shapes.iter().enumerate() {
            builder.add_area(i as GeometryId, shape, emission);
        }
        Arc::new(builder.build(&Bounds3 { min: Vec3::splat(-1.0), max: Vec3::splat(2.0) }))
    }

    /// True if a point is near the plane of a flat light.
    fn is_near(set: &LightSet, p: Vec3) -> bool {
        set.lights.iter().any(|light| match light {
            Light::Area(AreaLight { shape: AreaShape::Triangle(t), .. }) => t.n.dot(p - t.p[0]).abs() < 0.1,
            Light::Area(AreaLight { shape: AreaShape::Rectangle(r), .. }) => r.n.dot(p - r.corner).abs() < 0.1,
            Light::Area(_)
            | Light::Point(_)
            | Light::Spot(_)
            | Light::Image(_)
            | Light::Distant(_)
            | Light::InfiniteConstant { .. }
            | Light::InfiniteImage { .. }
            | Light::Portal(_)
            | Light::Volume(_) => false,
        })
    }

    /// Compares E with light-sampling estimates of the integral of L̄ cos θ, at random points and normals. Returns how
    /// often E was positive.
    fn assert_integrates(set: &Arc<LightSet>, stream: &mut Pcg32) -> u32 {
        let known = Irradiances::new(set, |_| false);
        let sampling = JobLights::new(Arc::clone(set), LightSamplerKind::Tree, 1);
        let mut lit = 0;
        for _ in 0..POINTS {
            let [p, n] = [2.0, 1.0].map(|r| sample_uniform_sphere(stream.random::<[f32; 2]>()) * r);
            let p = p * stream.random::<f32>() + Vec3::splat(0.2);
            // Area sampling rarely samples the brightest part of a light that is next to the point
            if is_near(set, p) {
                continue;
            }
            let ctx = LightCtx::on(p, n);
            let e = f64::from(known.irradiance(set, p, n).g);
            // A corner just above the horizon is rarely sampled
            let count = if e > 0.0 && e < 1e-3 { 400_000 } else { 4000 };
            let mut moments = Moments::default();
            for _ in 0..count {
                let sample = sampling.sample(&ctx, stream.random::<f32>(), stream.random::<[f32; 2]>());
                moments.add(sample.map_or(0.0, |SampleOfLight { light, sample: s }| {
                    let l = if set.infinite.contains(&light) {
                        known.environment()
                    } else {
                        known.l(set, light, SurfacePoint { p, n }, s.wi, s.n)
                    };
                    f64::from(l.g * n.dot(s.wi).max(0.0) / s.pdf)
                }));
            }
            // E below the resolution of the estimate counts as 0
            moments.assert_mean(if e < 1e-6 { 0.0 } else { e }, 1e-5, 1e-4);
            lit += u32::from(e > 0.0);
        }
        lit
    }

    #[test]
    fn irradiance_is_the_integral_of_radiance_and_cosine_above_the_horizon() {
        let mut stream = pcg32([1, 8, 4]);
        for shape in shapes() {
            for two_sided in [false, true] {
                let emission = Emission { two_sided, ..Emission::constant(Rgb::new(1.0, 3.0, 2.0)) };
                let lit = assert_integrates(&set(std::slice::from_ref(&shape), &emission), &mut stream);
                let is_left_out = two_sided && matches!(shape, Shape::Quadric(_));
                assert_eq!(lit == 0, is_left_out);
            }
        }
        let emission = Emission::constant(Rgb::splat(2.0));
        assert!(assert_integrates(&set(&shapes(), &emission), &mut stream) > POINTS / 3);
        assert_eq!(assert_integrates(&set(&[sphere(Vec3::ZERO, 3.0, true)], &emission), &mut stream), 0);
        let mut builder = LightSetBuilder::default();
        builder.add(Light::InfiniteConstant { l: Rgb::splat(0.5) });
        builder.add(Light::Distant(DistantLight { wi: Vec3::Z, irradiance: Rgb::WHITE }));
        let environment = Arc::new(builder.build(&Bounds3::EMPTY));
        assert_eq!(assert_integrates(&environment, &mut stream), POINTS);
    }

    #[test]
    fn known_values_are_met() {
        // A rectangle that fills the hemisphere, from below the middle; half of it below the horizon; from behind; on
        // it
        let s = 1e4;
        let big = [[-s, -s], [-s, s], [s, s], [s, -s]].map(|[x, y]| Vec3::new(x, y, 10.0));
        let set = set(&[mesh(&big, &[[0, 1, 2], [0, 2, 3]])], &Emission::constant(Rgb::splat(2.0)));
        let known = Irradiances::new(&set, |_| false);
        let e = |p: Vec3, n: Vec3| known.irradiance(&set, p, n).r / PI;
        assert!((e(Vec3::ZERO, Vec3::Z) - 2.0).abs() < 1e-4, "{}", e(Vec3::ZERO, Vec3::Z));
        assert!((e(Vec3::ZERO, Vec3::X) - 1.0).abs() < 1e-2);
        assert_eq!(e(Vec3::ZERO, -Vec3::Z), 0.0);
        assert_eq!(e(Vec3::new(0.0, 0.0, 20.0), -Vec3::Z), 0.0);
        assert_eq!(e(Vec3::new(5.0, 7.0, 10.0), Vec3::Z), 0.0);
    }

    #[test]
    fn lights_with_cut_outs_and_of_unknown_irradiance_take_no_part() {
        let data = [1.0, 2.0, 3.0, 6.0].map(Rgb::splat).to_vec();
        let image = Some(Arc::new(EmissionImage::new(2, 2, data).unwrap()));
        let emission = Emission { image, ..Emission::constant(Rgb::splat(2.0)) };
        let shapes = &shapes()[..1];
        let (p, n) = (Vec3::new(0.5, 0.5, 0.0), Vec3::Z);
        let set = set(shapes, &emission);
        let constant = self::set(shapes, &Emission::constant(Rgb::splat(6.0)));
        let e = |set: &LightSet, alpha| Irradiances::new(set, |_| alpha).irradiance(set, p, n).g;
        assert!((e(&set, false) - e(&constant, false)).abs() < 1e-6 && e(&set, false) > 0.0);
        assert_eq!(e(&set, true), 0.0);
        let hit = LightHit { t: 1.0, p: Vec3::new(0.5, 0.5, 1.0), n: -Vec3::Z, uv: Vec2::ZERO };
        assert!(Irradiances::new(&set, |_| true).l(&set, 0, SurfacePoint { p, n }, Vec3::Z, hit.n).is_black());
    }
}
