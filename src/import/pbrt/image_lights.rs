//! Lights that need images.

use super::descriptions::{EnvironmentDesc, ImageUse};
use crate::import::images::RgbImage;
use crate::lights::environment::orthogonal;
use crate::lights::{
    EnvironmentFilter, EnvironmentMap, EnvironmentMapping, ImageLight, ImageMapping, Light, Portal, PortalLight,
};
use lumiris_formats::diagnostic::Diagnostics;
use lumiris_numbers::math::{Mat3, Rgb, warp};
use std::f32::consts::PI;
use std::sync::Arc;

impl EnvironmentDesc {
    /// Builds the light from its image.
    pub fn light(&self, image: RgbImage, d: &mut Diagnostics) -> Option<Light> {
        let made = match self.image_use {
            ImageUse::Environment { illuminance, portal } => self.environment(image, illuminance, portal, d),
            ImageUse::Goniometric { intensity, power } => self.goniometric(&image, intensity, power),
            ImageUse::Projection { fov, power } => self.projection(image, fov, power),
        };
        made.map_err(|reason| {
            d.error(self.span, reason);
        })
        .ok()
    }

    fn environment(
        &self,
        RgbImage { texels, size }: RgbImage,
        illuminance: f32,
        portal: Option<Portal>,
        d: &mut Diagnostics,
    ) -> Result<Light, String> {
        // The aspect determines the mapping
        let mapping = if size[0] == size[1] {
            EnvironmentMapping::EqualArea
        } else if size[0] == 2 * size[1] {
            d.warning_once(self.span, "a latitude-longitude map is pbrt-v3; pbrt-v4 takes equal-area maps");
            EnvironmentMapping::LatLong
        } else {
            return Err(format!("an environment map is square or twice as wide as high, not {}×{}", size[0], size[1]));
        };
        let map = EnvironmentMap::new(texels, size, mapping, EnvironmentFilter::Nearest)?;

        // Scale by the illuminance, if given
        let factor = if illuminance > 0.0 { illuminance / map_illuminance(&map) } else { 1.0 };
        let scale = self.scale * factor;
        Ok(match portal {
            Some(portal) => Light::Portal(Arc::new(PortalLight::new(Arc::new(map), self.frame(), scale, portal))),
            None => Light::infinite_image(Arc::new(map), &self.world_from_light, scale),
        })
    }

    /// Orthogonal map of directions.
    fn frame(&self) -> Mat3 {
        orthogonal(&self.world_from_light)
    }

    /// As in pbrt-v4, the image is grey: the mean of its channels. `power` is the power of a white intensity.
    fn goniometric(&self, image: &RgbImage, intensity: Rgb, power: f32) -> Result<Light, String> {
        let RgbImage { texels, size } = image;
        if size[0] != size[1] {
            return Err(format!("a goniometric diagram is square (an equal-area map), not {}×{}", size[0], size[1]));
        }
        let grey: Vec<Rgb> = texels.iter().map(|c| Rgb::splat((c.r + c.g + c.b) / 3.0)).collect();
        let p = self.world_from_light.translation.into();
        let light = ImageLight::new(p, self.frame(), ImageMapping::Sphere, grey, *size)?;
        Ok(Light::Image(Arc::new(self.scaled(light, intensity, power))))
    }

    /// Scales the light's intensity, or sets its power if `power` is positive.
    fn scaled(&self, light: ImageLight, factor: Rgb, power: f32) -> ImageLight {
        let brightness =
            if power > 0.0 && light.power_luminance() > 0.0 { power / light.power_luminance() } else { 1.0 };
        light.scaled(factor * (self.scale * brightness))
    }

    fn projection(&self, RgbImage { texels, size }: RgbImage, fov: f32, power: f32) -> Result<Light, String> {
        let tan = (0.5 * fov.to_radians()).tan();
        let aspect = size[0] as f32 / size[1].max(1) as f32;
        let half = [tan * aspect.max(1.0), tan * aspect.recip().max(1.0)];
        let p = self.world_from_light.translation.into();
        let light = ImageLight::new(p, self.frame(), ImageMapping::Plane { half }, texels, size)?;
        Ok(Light::Image(Arc::new(self.scaled(light, Rgb::WHITE, power))))
    }
}

/// Illuminance of the light's own z = 0 plane by the upper half of the map, by stratified cosine sampling.
fn map_illuminance(map: &EnvironmentMap) -> f32 {
    const N: usize = 512;
    let mut sum = 0.0_f64;
    for y in 0..N {
        for x in 0..N {
            let u = [(x as f32 + 0.5) / N as f32, (y as f32 + 0.5) / N as f32];
            sum += f64::from(map.le(warp::sample_cosine_hemisphere(u)).luminance());
        }
    }
    (sum / (N * N) as f64) as f32 * PI
}
