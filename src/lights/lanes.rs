//! Many samples of one light, as a structure of arrays: kernels for infinite lights. [`super::many`] has those of area
//! lights, whose points differ.

use super::{Light, LightCtx};

pub use lumiris_lanes::LightLanes;

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
            Light::Point { .. }
            | Light::Spot { .. }
            | Light::Image(_)
            | Light::Distant { .. }
            | Light::InfiniteConstant { .. } => {
                let Some(s) = self.sample_li(ctx, [0.5; 2]) else { return out.pdf.fill(0.0) };
                for (wi, value) in out.wi.iter_mut().zip(s.wi.to_array()) {
                    wi.fill(value);
                }
                out.fill(s.li.to_array(), s.pdf);
            }
            Light::Area(_) | Light::Portal(_) | Light::Glow(_) => self.sample_li_each(ctx, u, out),
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
    use crate::lights::{EnvironmentFilter, EnvironmentMap, EnvironmentMapping};
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

    /// So large that texels are told apart only where they differ: smooth, and in one corner not.
    fn large_map(mapping: EnvironmentMapping) -> EnvironmentMap {
        const EDGE: usize = 512;
        let mut stream = pcg32([11, 12, 14]);
        let mut texel = |x: usize, y: usize| {
            let noise = if x.max(y) < 256 { 3.0 * stream.random::<f32>() } else { 0.0 };
            Rgb::new(0.5 + x as f32 / 512.0, 1.0, 0.2 + y as f32 / 256.0) * (1.0 + noise)
        };
        let texels = (0..EDGE * EDGE).map(|i| texel(i % EDGE, i / EDGE)).collect();
        EnvironmentMap::new(texels, [EDGE, EDGE], mapping, EnvironmentFilter::Bilinear).unwrap()
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
        for mapping in [EnvironmentMapping::EqualArea, EnvironmentMapping::LatLong] {
            let light = Light::infinite_image(Arc::new(large_map(mapping)), &rotation, 1.5);
            for _ in 0..20 {
                assert_like_singles(&light, &LightCtx::at(Vec3::ZERO), &mut stream, 1e-3);
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
}
