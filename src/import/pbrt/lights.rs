//! `LightSource`, `AreaLightSource`. Lights that need images are finished in `image_lights`.

use super::checks::{FilePlace, file_name, unknown};
use super::descriptions::{AreaLightDesc, EnvironmentDesc, ImageUse};
use super::spectrum::SpectrumUse;
use super::state::Builder;
use crate::lights::layers::fault_of_name;
use crate::lights::{DistantLight, EnvironmentFilter, EnvironmentMap, EnvironmentMapping, Light, PointLight};
use crate::lights::{Portal, PortalLight, SpotLight};
use lumiris_formats::color_space::Colored;
use lumiris_formats::diagnostic::Diagnostics;
use lumiris_formats::names::{file_in, nfc};
use lumiris_formats::pbrt::directive::Name;
use lumiris_formats::pbrt::params::{ParamSet, ParamType};
use lumiris_numbers::math::{DAffine3, DMat3, DVec3, Mat3, Rgb, Vec3};
use std::f32::consts::PI;
use std::path::PathBuf;
use std::sync::Arc;

/// The placement of a light.
#[derive(Clone, Copy)]
struct Placed {
    world_from_light: DAffine3,
    /// Factor of its light.
    scale: f32,
}

impl Builder<'_> {
    /// `LightSource "kind"`
    pub fn light(&mut self, kind: &Name, p: &ParamSet, d: &mut Diagnostics) {
        let world_from_light = self.still_transform("lights", p.span, d);
        let placed = Placed { world_from_light, scale: light_scale(p, d) };
        let images = self.environments.len();
        let light = match kind.text.as_str() {
            "point" => self.point(p, placed, d),
            "spot" => self.spot(p, placed, d),
            "distant" => self.distant(p, placed, d),
            "infinite" | "exinfinite" => self.infinite(p, placed, d),
            "goniometric" => self.goniometric(p, placed, d),
            "projection" => self.projection(p, placed, d),
            other => {
                let known = ["point", "spot", "distant", "infinite", "goniometric", "projection"];
                unknown(other, kind.span, "light", &known, d);
                return;
            }
        };

        // An image needs the inverse transform for lookups
        if self.environments.len() > images && !self.has_inverse("a light with an image", p.span, d) {
            self.environments.truncate(images);
        }

        // Sample counts of pbrt-v3 have no effect here
        p.ignore("nsamples");
        p.ignore("samples");
        let group = light_group(p, d);
        p.report_unused(d);
        self.lights.extend(light);
        self.light_groups.resize(self.lights.len(), group);
    }

    /// The default colour of emission: the illuminant of the current colour space.
    fn white(&self) -> Rgb {
        self.state.color_space.to_rec709([1.0; 3], Colored::Light)
    }

    fn emitted(&self, p: &ParamSet, name: &'static str, d: &mut Diagnostics) -> Rgb {
        self.color_param(p, name, SpectrumUse::Illuminant, d).unwrap_or_else(|| self.white())
    }

    fn point(&self, p: &ParamSet, Placed { world_from_light, scale }: Placed, d: &mut Diagnostics) -> Option<Light> {
        let intensity = self.emitted(p, "I", d) * scale;
        let from = p.point("from", d).unwrap_or(DVec3::ZERO);
        let power = p.float("power", d).unwrap_or(0.0);
        let factor = if power > 0.0 { power / (4.0 * PI) } else { 1.0 };
        Some(Light::Point(PointLight {
            p: world_from_light.transform_point3(from).as_vec3(),
            intensity: intensity * factor,
        }))
    }

    fn spot(&self, p: &ParamSet, Placed { world_from_light, scale }: Placed, d: &mut Diagnostics) -> Option<Light> {
        let intensity = self.emitted(p, "I", d) * scale;
        let from = p.point("from", d).unwrap_or(DVec3::ZERO);
        let to = p.point("to", d).unwrap_or(DVec3::Z);
        let cone = p.float("coneangle", d).unwrap_or(30.0);
        let delta = p.float("conedeltaangle", d).or_else(|| p.float("conedelta", d)).unwrap_or(5.0);
        let power = p.float("power", d).unwrap_or(0.0);

        // Axis
        let p0 = world_from_light.transform_point3(from);
        let p1 = world_from_light.transform_point3(to);
        let Some(axis) = (p1 - p0).as_vec3().try_normalize() else {
            d.error(p.span_of("to"), "the light and what it points at are the same point");
            return None;
        };
        if !(cone > 0.0 && cone <= 180.0) {
            d.error(p.span_of("coneangle"), format!("coneangle must be above 0 and at most 180 degrees, not {cone}"));
            return None;
        }

        // Cone and power
        let cos_total = cone.to_radians().cos();
        let cos_falloff_start = (cone - delta).clamp(0.0, cone).to_radians().cos();
        let light = SpotLight { p: p0.as_vec3(), axis, cos_total, cos_falloff_start, intensity };
        let factor = if power > 0.0 { power / light.solid_angle() } else { 1.0 };
        Some(Light::Spot(SpotLight { intensity: intensity * factor, ..light }))
    }

    fn distant(&self, p: &ParamSet, Placed { world_from_light, scale }: Placed, d: &mut Diagnostics) -> Option<Light> {
        let l = self.emitted(p, "L", d) * scale;
        let from = p.point("from", d).unwrap_or(DVec3::ZERO);
        let to = p.point("to", d).unwrap_or(DVec3::Z);
        let illuminance = p.float("illuminance", d).unwrap_or(0.0);
        let Some(wi_world) = world_from_light.transform_vector3(from - to).as_vec3().try_normalize() else {
            d.error(p.span_of("to"), "`from` and `to` are the same point");
            return None;
        };
        // pbrt-v4 replaces the scale, including the normalisation of the white point, so the colour's luminance remains
        // a factor.
        let l = if illuminance > 0.0 { l * illuminance } else { l };
        Some(Light::Distant(DistantLight { wi: wi_world, irradiance: l }))
    }

    fn infinite(&mut self, p: &ParamSet, placed: Placed, d: &mut Diagnostics) -> Option<Light> {
        let portal = self.portal(p, d);
        self.portals.extend(portal.map(|portal| (portal, p.span_of("portal"))));
        let illuminance = p.float("illuminance", d).unwrap_or(0.0);

        // Image file, also by its name in pbrt-v3
        let color = self.color_param(p, "L", SpectrumUse::Illuminant, d);
        if p.type_of("mapname").is_some() {
            d.warning_once(p.span_of("mapname"), "`mapname` is pbrt-v3; pbrt-v4 writes `filename`");
        }
        let file = file_name(p, "filename", d).map(|f| (f.to_owned(), p.span_of("filename")));
        let file = file.or_else(|| file_name(p, "mapname", d).map(|f| (f.to_owned(), p.span_of("mapname"))));

        // Without an image, a constant light
        let Some((name, span)) = file else {
            let l = color.unwrap_or_else(|| self.white()) * placed.scale;
            let l = l * if illuminance > 0.0 { illuminance / PI } else { 1.0 };
            return Some(portal.map_or(Light::InfiniteConstant { l }, |portal| constant_portal(l, portal)));
        };
        if color.is_some() {
            d.error(p.span_of("L"), "an infinite light has `L` or `filename`, not both");
        }
        let image = FilePlace { path: &file_in(&self.folder, &name), span };
        Some(self.wait_for_image(&image, ImageUse::Environment { illuminance, portal }, placed))
    }

    /// `portal`: corners in world space, independent of the current transform.
    fn portal(&self, p: &ParamSet, d: &mut Diagnostics) -> Option<Portal> {
        let param = p.get("portal", &[ParamType::Point3], d)?;
        let corners = param.doubles().unwrap_or_default().chunks_exact(3).map(DVec3::from_slice);
        let corners: Vec<Vec3> = corners.map(|corner| (corner - self.origin).as_vec3()).collect();
        let portal =
            <[Vec3; 4]>::try_from(corners).map_err(|_| "a portal has four corners".to_owned()).and_then(Portal::new);
        portal.map_err(|reason| d.error(param.value_span, reason)).ok()
    }

    /// Reserves the index of a light until its image is read.
    fn wait_for_image(&mut self, image: &FilePlace<'_>, image_use: ImageUse, placed: Placed) -> Light {
        self.environments.push(EnvironmentDesc {
            path: image.path.to_owned(),
            span: image.span,
            image_use,
            world_from_light: placed.world_from_light.as_affine3a(),
            scale: placed.scale,
            index: self.lights.len(),
        });
        Light::InfiniteConstant { l: Rgb::BLACK }
    }

    /// `LightSource "goniometric"`: in the frame of the light, z of the image's sphere is y.
    fn goniometric(&mut self, p: &ParamSet, placed: Placed, d: &mut Diagnostics) -> Option<Light> {
        let intensity = self.emitted(p, "I", d);
        let power = p.float("power", d).unwrap_or(0.0);
        let path = self.image_of(p, "goniometric", d)?;
        let swap = DAffine3::from_mat3(DMat3::from_cols(DVec3::X, DVec3::Z, DVec3::Y));
        let image_use = ImageUse::Goniometric { intensity, power };
        let image = FilePlace { path: &path, span: p.span_of("filename") };
        let world_from_light = placed.world_from_light * swap;
        Some(self.wait_for_image(&image, image_use, Placed { world_from_light, ..placed }))
    }

    /// `LightSource "projection"`: along z, with the first row of the image at the maximum y.
    fn projection(&mut self, p: &ParamSet, placed: Placed, d: &mut Diagnostics) -> Option<Light> {
        let fov = p.float("fov", d).unwrap_or(90.0);
        let power = p.float("power", d).unwrap_or(0.0);
        let path = self.image_of(p, "projection", d)?;
        if !(fov > 0.0 && fov < 180.0) {
            d.error(p.span_of("fov"), format!("fov must be above 0 and below 180 degrees, not {fov}"));
            return None;
        }
        let flip = DAffine3::from_scale(DVec3::new(1.0, -1.0, 1.0));
        let image_use = ImageUse::Projection { fov, power };
        let image = FilePlace { path: &path, span: p.span_of("filename") };
        let world_from_light = placed.world_from_light * flip;
        Some(self.wait_for_image(&image, image_use, Placed { world_from_light, ..placed }))
    }

    /// `filename`, which the light requires.
    fn image_of(&self, p: &ParamSet, kind: &str, d: &mut Diagnostics) -> Option<PathBuf> {
        let name = file_name(p, "filename", d);
        if name.is_none() {
            d.error(p.span, format!("a {kind} light needs `filename`"));
        }
        name.map(|name| file_in(&self.folder, name))
    }

    /// `AreaLightSource "diffuse"`
    pub fn area_light(&mut self, kind: &Name, p: &ParamSet, d: &mut Diagnostics) -> Option<AreaLightDesc> {
        if kind.text == "area" {
            d.warning_once(kind.span, "area light `area` is pbrt-v3; pbrt-v4 writes `diffuse`");
        } else if kind.text != "diffuse" {
            unknown(&kind.text, kind.span, "area light", &["diffuse"], d);
            return None;
        }
        let scale = light_scale(p, d);
        let color = self.color_param(p, "L", SpectrumUse::Illuminant, d);
        let two_sided = p.boolean("twosided", d).unwrap_or(false);
        let power = p.float("power", d).unwrap_or(0.0);
        let image = file_name(p, "filename", d).map(|f| (file_in(&self.folder, f), p.span_of("filename")));
        if color.is_some() && image.is_some() {
            d.error(p.span_of("L"), "an area light has `L` or `filename`, not both");
        }

        // Sample counts of pbrt-v3 have no effect here
        p.ignore("nsamples");
        p.ignore("samples");
        let group = light_group(p, d);
        p.report_unused(d);

        // The image is read later, with all others
        self.emission_images.extend(image.as_ref().map(|(path, _)| path.clone()));
        let l = color.unwrap_or_else(|| if image.is_some() { Rgb::WHITE } else { self.white() });
        Some(AreaLightDesc { l: l * scale, two_sided, image, power, group, span: p.span })
    }
}

/// Constant radiance through a portal.
fn constant_portal(l: Rgb, portal: Portal) -> Light {
    let map = EnvironmentMap::new(vec![l], [1, 1], EnvironmentMapping::EqualArea, EnvironmentFilter::Nearest)
        .expect("one texel is square");
    Light::Portal(Arc::new(PortalLight::new(Arc::new(map), Mat3::IDENTITY, 1.0, portal)))
}

/// `lightgroup`: the image layer of the light.
fn light_group(p: &ParamSet, d: &mut Diagnostics) -> Option<Arc<str>> {
    let name = nfc(p.string("lightgroup", d)?).into_owned();
    match fault_of_name(&name) {
        Some(reason) => {
            d.error(p.span_of("lightgroup"), reason);
            None
        }
        None => Some(name.into()),
    }
}

/// `scale`: a factor of all lights; in pbrt-v3 a colour.
fn light_scale(p: &ParamSet, d: &mut Diagnostics) -> f32 {
    let scale = match p.type_of("scale") {
        Some(ParamType::Rgb | ParamType::Spectrum) => {
            d.warning_once(p.span_of("scale"), "a colour `scale` is pbrt-v3; pbrt-v4 takes a float: its mean is used");
            match p.get("scale", &[ParamType::Rgb, ParamType::Spectrum], d).and_then(|q| q.floats()) {
                Some(&[r, g, b]) => (r + g + b) / 3.0,
                _ => 1.0,
            }
        }
        _ => p.float("scale", d).unwrap_or(1.0),
    };
    if scale.is_finite() && scale >= 0.0 {
        return scale;
    }
    d.error(p.span_of("scale"), format!("scale must be finite and not negative, not {scale}"));
    0.0
}

/// The factor that gives a surface of `area` (m²) the requested power; `mean` is the mean of its image.
pub fn power_factor(desc: &AreaLightDesc, area: f32, mean: f32) -> f32 {
    let sides = if desc.two_sided { 2.0 } else { 1.0 };
    let emitted = mean * sides * area * PI;
    if desc.power > 0.0 && emitted > 0.0 { desc.power / emitted } else { 1.0 }
}
