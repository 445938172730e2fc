//! Many samples of one light from one point, as a structure of arrays.

use super::{Light, LightCtx};

pub use lumiris_lanes::LightLanes;

/// Number of samples of an area light from which on lanes are faster than single samples.
const FEW: usize = 3;

impl Light {
    /// [`sample_li`](Self::sample_li) for each pair of numbers `u[0][i]`, `u[1][i]`. The results are those of single
    /// samples up to rounding.
    pub fn sample_li_lanes(&self, ctx: &LightCtx, u: [&[f32]; 2], out: &mut LightLanes<'_>) {
        match self {
            Light::InfiniteConstant { l } if !l.is_black() => {
                lumiris_lanes::light::sample_uniform_sphere(lumiris_lanes::level(), u, l.to_array(), out);
            }
            Light::InfiniteImage { map, world_from_light, scale } => {
                map.lanes(*world_from_light, *scale).sample(lumiris_lanes::level(), u, out);
            }
            // The same for all numbers
            Light::Point { .. } | Light::Spot { .. } | Light::Distant { .. } | Light::InfiniteConstant { .. } => {
                let Some(s) = self.sample_li(ctx, [0.5; 2]) else { return out.pdf.fill(0.0) };
                for (wi, value) in out.wi.iter_mut().zip(s.wi.to_array()) {
                    wi.fill(value);
                }
                out.fill(s.li.to_array(), s.pdf);
            }
            Light::Area(area) if area.is_dark_from(ctx.p) => out.pdf.fill(0.0),
            Light::Area(area) => match area.lanes(ctx) {
                Some(sampler) if out.pdf.len() >= FEW || sampler.has_setup() => {
                    sampler.sample(lumiris_lanes::level(), u, out)
                }
                _ => self.sample_li_each(ctx, u, out),
            },
        }
    }

    /// [`sample_li_lanes`](Self::sample_li_lanes) by single samples.
    pub fn sample_li_each(&self, ctx: &LightCtx, u: [&[f32]; 2], out: &mut LightLanes<'_>) {
        for i in 0..out.pdf.len() {
            let Some(s) = self.sample_li(ctx, [u[0][i], u[1][i]]) else {
                out.pdf[i] = 0.0;
                continue;
            };
            for c in 0..3 {
                out.wi[c][i] = s.wi[c];
                out.li[c][i] = s.li[c];
            }
            out.pdf[i] = s.pdf;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Quadric, QuadricKind, Shape, TriangleMesh};
    use crate::lights::{Emission, EnvironmentFilter, EnvironmentMap, EnvironmentMapping, area_lights_of};
    use lumiris_numbers::math::{Affine3A, Rgb, Vec3};
    use lumiris_test_support::random::{Pcg32, RngExt, pcg32};
    use std::sync::Arc;

    type Lanes = ([Vec<f32>; 3], [Vec<f32>; 3], Vec<f32>);

    fn run(n: usize, sample: impl Fn(&mut LightLanes<'_>)) -> Lanes {
        let zeros = || std::array::from_fn(|_| vec![0.0; n]);
        let (mut w, mut l, mut pdf): Lanes = (zeros(), zeros(), vec![0.0; n]);
        let ([x, y, z], [r, g, b]) = (&mut w, &mut l);
        sample(&mut LightLanes { wi: [x, y, z], li: [r, g, b], pdf: &mut pdf });
        (w, l, pdf)
    }

    /// Directions and radiances within `tolerance`, densities within `tolerance` relatively; a lane may lack a sample
    /// that its single call has only where that is on an edge.
    fn assert_like_singles(light: &Light, ctx: &LightCtx, stream: &mut Pcg32, tolerance: f32) {
        let what = light.kind_name();
        for n in [1, 5, 8, 31, 32, 33, 100] {
            let mut u = [vec![0.0; n], vec![0.0; n]];
            for i in 0..n {
                let [a, b] = stream.random::<[f32; 2]>();
                (u[0][i], u[1][i]) = (a, b);
            }
            let u = [&u[0][..], &u[1][..]];
            let (w, l, pdf) = run(n, |out| light.sample_li_lanes(ctx, u, out));
            let (w1, l1, pdf1) = run(n, |out| light.sample_li_each(ctx, u, out));
            for i in 0..n {
                assert_eq!(pdf[i] > 0.0, pdf1[i] > 0.0, "{what} {} {}", pdf[i], pdf1[i]);
                if pdf1[i] == 0.0 {
                    continue;
                }
                assert!((pdf[i] - pdf1[i]).abs() <= tolerance * pdf1[i], "{what} pdf {} {}", pdf[i], pdf1[i]);
                for c in 0..3 {
                    assert!(
                        (w[c][i] - w1[c][i]).abs() < 1e-6_f32.max(0.1 * tolerance),
                        "{what} {} {}",
                        w[c][i],
                        w1[c][i]
                    );
                    assert!(
                        (l[c][i] - l1[c][i]).abs() <= tolerance * (1.0 + l1[c][i]),
                        "{what} {} {}",
                        l[c][i],
                        l1[c][i]
                    );
                }
            }
        }
    }

    fn random_map(mapping: EnvironmentMapping, filter: EnvironmentFilter) -> EnvironmentMap {
        let size = if mapping == EnvironmentMapping::EqualArea { [32, 32] } else { [40, 17] };
        let mut stream = pcg32([11, 12, 13]);
        let mut texel = || stream.random::<f32>().powi(8) * 20.0;
        let texels = (0..size[0] * size[1]).map(|_| Rgb::new(texel(), texel(), texel())).collect();
        EnvironmentMap::new(texels, size, mapping, filter).unwrap()
    }

    #[test]
    fn lanes_of_infinite_and_delta_lights_are_single_samples() {
        let mut stream = pcg32([3, 3, 3]);
        let rotation = Affine3A::from_rotation_x(0.7) * Affine3A::from_rotation_y(2.0);
        for mapping in [EnvironmentMapping::EqualArea, EnvironmentMapping::LatLong] {
            for filter in [EnvironmentFilter::Nearest, EnvironmentFilter::Bilinear] {
                let map = random_map(mapping, filter);
                for map in [map.clone(), map.with_mis_compensation()] {
                    let light = Light::infinite_image(Arc::new(map), &rotation, 1.5);
                    assert_like_singles(&light, &LightCtx::at(Vec3::ZERO), &mut stream, 1e-4);
                }
            }
        }
        let p = Vec3::new(1.0, 2.0, 3.0);
        let (axis, l) = (Vec3::new(0.0, -0.6, -0.8), Rgb::new(0.5, 0.25, 1.0));
        for light in [
            Light::InfiniteConstant { l },
            Light::InfiniteConstant { l: Rgb::BLACK },
            Light::Distant { wi_world: Vec3::Y, l },
            Light::Point { p, intensity: l },
            Light::Spot { p, axis, cos_total: 0.5, cos_falloff_start: 0.8, intensity: l },
        ] {
            for at in [Vec3::ZERO, p, Vec3::new(-5.0, 1.0, 9.0)] {
                assert_like_singles(&light, &LightCtx::at(at), &mut stream, 1e-5);
            }
        }
    }

    #[test]
    fn lanes_of_area_lights_are_single_samples() {
        let mesh = |p: &[Vec3], t: &[[u32; 3]]| Shape::Mesh(TriangleMesh::new(p.to_vec(), t.to_vec()).unwrap());
        let quad = [Vec3::ZERO, Vec3::X * 2.0, Vec3::new(2.0, 0.0, 3.0), Vec3::Z * 3.0];
        let quadric = |kind| {
            let placement = Affine3A::from_translation(Vec3::new(1.0, 2.0, 0.5));
            let local_from_group = placement.inverse();
            Shape::Quadric(Quadric { kind, group_from_local: placement, local_from_group, flip_normal: false })
        };
        let (radius, phi_max) = (0.5, std::f32::consts::TAU);
        let mut stream = pcg32([7, 7, 7]);
        for shape in [
            mesh(&quad, &[[0, 1, 2], [0, 2, 3]]),
            mesh(&quad, &[[2, 1, 0], [0, 3, 2]]),
            mesh(&quad, &[[0, 1, 2]]),
            quadric(QuadricKind::Sphere { radius, z_min: -radius, z_max: radius, phi_max }),
            quadric(QuadricKind::Sphere { radius, z_min: 0.0, z_max: radius, phi_max }),
            quadric(QuadricKind::Disk { height: 0.0, radius, inner_radius: 0.0, phi_max }),
        ] {
            for two_sided in [false, true] {
                let emission = Emission { l: Rgb::new(1.0, 2.0, 3.0), two_sided, image: None };
                for area in area_lights_of(&shape, &emission).lights {
                    let light = Light::Area(area);
                    for _ in 0..20 {
                        let [x, y] = stream.random::<[f32; 2]>();
                        let [z, far] = stream.random::<[f32; 2]>();
                        let scale = if far < 0.2 { 300.0 } else { 6.0 };
                        let p = (Vec3::new(x, y, z) - 0.5) * scale;
                        assert_like_singles(&light, &LightCtx::at(p), &mut stream, 2e-5);
                    }
                    for p in [Vec3::new(1.0, 2.1, 0.5), Vec3::new(1.0, 1e-4, 1.0), Vec3::new(-2.0, 0.0, -2.0)] {
                        assert_like_singles(&light, &LightCtx::at(p), &mut stream, 2e-5);
                    }
                }
            }
        }
    }
}
