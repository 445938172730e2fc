//! Samples of one infinite light for columns of random numbers. [`super::choice::sample_columns`] has area lights,
//! where the points differ.

use super::light::Light;

pub use lumiris_lanes::LightLanes;

impl Light {
    /// [`sample_li`](Self::sample_li) of an infinite light for each pair of numbers `u[0][i]`, `u[1][i]`. Returns false
    /// if the light has no kernel. The results equal single samples up to rounding.
    pub fn sample_li_columns(&self, u: [&[f32]; 2], out: &mut LightLanes<'_>) -> bool {
        let level = lumiris_lanes::level();
        match self {
            Light::InfiniteConstant { l } if !l.is_black() => {
                lumiris_lanes::light::sample_uniform_sphere(level, u, l.to_array(), out);
            }
            Light::InfiniteImage { map, world_from_light, scale } => {
                map.lanes(*world_from_light, *scale).sample(level, u, out);
            }
            Light::InfiniteConstant { .. }
            | Light::Point(_)
            | Light::Spot(_)
            | Light::Image(_)
            | Light::Distant(_)
            | Light::Area(_)
            | Light::Portal(_)
            | Light::Volume(_) => return false,
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lights::{EnvironmentFilter, EnvironmentMap, EnvironmentMapping, LightCtx};
    use lumiris_numbers::math::{Affine3A, Rgb, Vec3};
    use lumiris_test_support::random::{Pcg32, RngExt, pcg32};
    use std::sync::Arc;

    /// Directions and radiances within `tolerance`, densities within `tolerance` relatively; a lane may lack a sample
    /// that its single call has only where that is on an edge.
    fn assert_like_singles(light: &Light, stream: &mut Pcg32, tolerance: f32) {
        for n in [1, 5, 8, 31, 32, 33, 100] {
            // Sample in lanes
            let u: [Vec<f32>; 2] = std::array::from_fn(|_| (0..n).map(|_| stream.random()).collect());
            let mut columns: [Vec<f32>; 7] = std::array::from_fn(|_| vec![0.0; n]);
            let [x, y, z, r, g, b, pdf] = &mut columns;
            assert!(light.sample_li_columns([&u[0], &u[1]], &mut LightLanes { wi: [x, y, z], li: [r, g, b], pdf }));

            // Compare with single samples
            for i in 0..n {
                let [x, y, z, r, g, b, pdf] = columns.each_ref().map(|column| column[i]);
                let Some(single) = light.sample_li(&LightCtx::at(Vec3::ZERO), [u[0][i], u[1][i]]) else {
                    assert!(pdf <= 0.0);
                    continue;
                };
                assert!((pdf - single.pdf).abs() <= tolerance * single.pdf, "pdf {pdf} {single:?}");
                let off = (Vec3::new(x, y, z) - single.wi).abs().max_element();
                assert!(off < 1e-6_f32.max(0.1 * tolerance), "{x} {y} {z} {single:?}");
                let is_near = |(l, l1): (f32, f32)| (l - l1).abs() <= tolerance * (1.0 + l1);
                assert!([r, g, b].into_iter().zip(single.li.to_array()).all(is_near), "{r} {g} {b} {single:?}");
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

    /// A map large enough for blocks of texels: smooth, except in one corner.
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
    fn lanes_of_infinite_lights_are_single_samples() {
        let mut stream = pcg32([3, 3, 3]);
        let rotation = Affine3A::from_rotation_x(0.7) * Affine3A::from_rotation_y(2.0);
        for mapping in [EnvironmentMapping::EqualArea, EnvironmentMapping::LatLong] {
            for filter in [EnvironmentFilter::Nearest, EnvironmentFilter::Bilinear] {
                let light = Light::infinite_image(Arc::new(random_map(mapping, filter)), &rotation, 1.5);
                assert_like_singles(&light, &mut stream, 1e-4);
            }
        }
        for mapping in [EnvironmentMapping::EqualArea, EnvironmentMapping::LatLong] {
            let light = Light::infinite_image(Arc::new(large_map(mapping)), &rotation, 1.5);
            for _ in 0..20 {
                assert_like_singles(&light, &mut stream, 1e-3);
            }
        }
        assert_like_singles(&Light::InfiniteConstant { l: Rgb::new(0.5, 0.25, 1.0) }, &mut stream, 1e-5);
    }
}
