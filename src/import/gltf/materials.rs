//! Materials: metallic-roughness or specular-glossiness, and extensions.

use super::messages::Messages;
use super::textures::{EmissionSource, Textures};
use crate::import::images::{ImageChannels, ImageEncoding};
use crate::materials::principled::{Anisotropy, AnisotropyDirection};
use crate::materials::{Dispersion, Material, MaterialEntry, MaterialId, NormalMap, PrincipledMaterial};
use crate::media::Homogeneous;
use crate::textures::{FloatTexture, FloatTextureId, ImageTexture, Mapping2d, RgbTexture, RgbTextureId};
use lumiris_formats::gltf::{Document, GltfError, Place};
use lumiris_formats::spectra::Spectrum;
use lumiris_numbers::math::Rgb;
use std::sync::Arc;

/// The properties of a material that primitives need.
#[derive(Clone)]
pub(super) struct Look {
    pub material: MaterialId,
    /// Texture of the opacity.
    pub alpha: Option<FloatTextureId>,
    /// Radiance; a factor of the emission image, if there is one.
    pub emission: Rgb,
    pub emission_image: Option<EmissionSource>,
    /// True if the vertex colours are a factor of the emission.
    pub emits_vertex_colors: bool,
    pub is_double_sided: bool,
    /// True if a normal map uses the second texture coordinates, which then define the tangents.
    pub tangents_along_second: bool,
    /// The absorbing medium inside.
    pub interior: Option<Homogeneous>,
}

/// Materials during import.
pub(super) struct Materials<'a> {
    document: &'a Document,
    pub textures: Textures<'a>,
    pub entries: Vec<MaterialEntry>,
    pub looks: Vec<Look>,
}

/// An index of refraction so large that all light is reflected: specular colours are then reflectances.
const MIRROR_IOR: f32 = 1e6;

/// Below this index, light passes as if there were no surface.
const LEAST_IOR: f32 = 1.0011;

/// Minimum component of the colour of light after some distance in a volume: 0 would need infinite absorption.
const LEAST_COLOR: f32 = 1e-6;

/// Extensions of materials that are not supported.
const LEFT_OUT: &[(&str, &str)] = &[
    ("KHR_materials_iridescence", "thin films are not rendered"),
    ("KHR_materials_diffuse_transmission", "diffuse transmission is not rendered"),
];

/// The specular-glossiness properties, which take precedence over the metallic-roughness fallback.
fn glossiness_of<'a>(place: &Place<'a>) -> Option<Place<'a>> {
    Some(place.extension("KHR_materials_pbrSpecularGlossiness")).filter(Place::exists)
}

/// A factor of a material.
fn factor(place: &Place<'_>, default: f32) -> f32 {
    place.number().unwrap_or(default)
}

/// The base colour of a material, with its opacity.
struct BaseColor<'a> {
    factor: [f32; 4],
    texture: Place<'a>,
}

impl<'a> Materials<'a> {
    pub(super) fn new(document: &'a Document) -> std::io::Result<Self> {
        Ok(Materials { document, textures: Textures::new(document)?, entries: Vec::new(), looks: Vec::new() })
    }

    /// Imports all materials; the last is the default material for primitives without one.
    pub(super) fn read(&mut self, messages: &mut Messages<'_>) -> Result<(), GltfError> {
        let root = self.document.root();
        for place in root.key("materials").items().chain([root.key("default material")]) {
            let look = self.appearance(&place, messages)?;
            self.looks.push(look);
        }
        Ok(())
    }

    /// The base colour of a material.
    fn base(place: &Place<'a>) -> BaseColor<'a> {
        let pbr = place.key("pbrMetallicRoughness");
        // Unlit surfaces use the metallic-roughness colour
        let is_unlit = place.extension("KHR_materials_unlit").exists() && pbr.exists();
        if let Some(old) = glossiness_of(place).filter(|_| !is_unlit) {
            let factor = old.key("diffuseFactor").numbers().unwrap_or([1.0; 4]);
            return BaseColor { factor, texture: old.key("diffuseTexture") };
        }
        let factor = pbr.key("baseColorFactor").numbers().unwrap_or([1.0; 4]);
        BaseColor { factor, texture: pbr.key("baseColorTexture") }
    }

    fn appearance(&mut self, place: &Place<'a>, messages: &mut Messages<'_>) -> Result<Look, GltfError> {
        for (name, message) in LEFT_OUT.iter().filter(|(name, _)| place.extension(name).exists()) {
            messages.warning(&place.extension(name), message);
        }

        // Material; vertex colours multiply the base colour
        let BaseColor { factor, texture: base } = Self::base(place);
        let color = Rgb::new(factor[0], factor[1], factor[2]);
        let is_unlit = place.extension("KHR_materials_unlit").exists();
        let material = if is_unlit {
            messages.warning(place, "an unlit surface emits its colour, and lights others");
            Material::Diffuse { reflectance: self.textures.set.add_rgb(RgbTexture::Constant(Rgb::BLACK)) }
        } else {
            let tex1 = self.textures.colored(color, &base, messages)?;
            let tex2 = self.textures.set.add_rgb(RgbTexture::VertexColor);
            let base_color = self.textures.set.add_rgb(RgbTexture::Product { tex1, tex2 });
            Material::Principled(self.principled(place, base_color, messages)?)
        };

        // Normal map
        let normal = place.key("normalTexture");
        let strength = normal.key("scale").number().unwrap_or(1.0);
        let normal_map = self.textures.image(&normal, ImageChannels::Color, ImageEncoding::Linear, messages)?;
        let is_second = |map: &ImageTexture| matches!(map.mapping, Mapping2d::Affine { second: true, .. });
        let tangents_along_second = normal_map.as_ref().is_some_and(is_second);
        let normal_map = normal_map.map(|image| NormalMap { image, strength, is_along_v: true });
        let name = place.key("name").text().unwrap_or("default").to_owned();
        let dispersion = if is_unlit { None } else { dispersion(place) };
        self.entries.push(MaterialEntry { name, material, normal_map, displacement: None, dispersion });

        // Emission
        let emission = if is_unlit { color } else { emitted(place) };
        let emissive = if is_unlit { base } else { place.key("emissiveTexture") };
        let emission_image = if emission.is_black() { None } else { self.textures.emission(&emissive, messages)? };
        Ok(Look {
            material: (self.entries.len() - 1) as MaterialId,
            alpha: self.opacity(place, factor[3], &base, messages)?,
            emission,
            emission_image,
            emits_vertex_colors: is_unlit,
            is_double_sided: place.key("doubleSided").is_true(),
            tangents_along_second,
            interior: absorption(place),
        })
    }

    fn principled(
        &mut self,
        place: &Place<'a>,
        base_color: RgbTextureId,
        messages: &mut Messages<'_>,
    ) -> Result<PrincipledMaterial, GltfError> {
        warn_of_approximations(place, messages);
        let old = glossiness_of(place);
        // Images of the fallback are not loaded
        let pbr = if old.is_some() { Place::default() } else { place.key("pbrMetallicRoughness") };
        let packed = pbr.key("metallicRoughnessTexture");
        let specular = place.extension("KHR_materials_specular");
        let sheen = place.extension("KHR_materials_sheen");
        let volume = place.extension("KHR_materials_volume");
        let anisotropy = place.extension("KHR_materials_anisotropy");
        let color = Rgb::from_array(specular.key("specularColorFactor").numbers().unwrap_or([1.0; 3]));
        let sheen_color = Rgb::from_array(sheen.key("sheenColorFactor").numbers().unwrap_or([0.0; 3]));
        let [coat, coat_roughness] = self.coat(place, messages)?;
        let transmission = self.transmission(place, messages)?;
        let t = &mut self.textures;
        let mut material = PrincipledMaterial {
            base_color,
            metalness: t.scaled(factor(&pbr.key("metallicFactor"), 1.0), &packed, 2, messages)?,
            roughness: t.scaled(factor(&pbr.key("roughnessFactor"), 1.0), &packed, 1, messages)?,
            anisotropy: Anisotropy::Gltf(factor(&anisotropy.key("anisotropyStrength"), 0.0)),
            direction: None,
            ior: ior(place),
            transmission,
            is_thin: factor(&volume.key("thicknessFactor"), 0.0) <= 0.0,
            coat,
            coat_roughness,
            specular: t.opacity_scaled(
                factor(&specular.key("specularFactor"), 1.0),
                &specular.key("specularTexture"),
                messages,
            )?,
            sheen: t.float(1.0),
            sheen_color: t.colored(sheen_color, &sheen.key("sheenColorTexture"), messages)?,
            sheen_roughness: t.opacity_scaled(
                factor(&sheen.key("sheenRoughnessFactor"), 0.0),
                &sheen.key("sheenRoughnessTexture"),
                messages,
            )?,
            specular_color: t.colored(color, &specular.key("specularColorTexture"), messages)?,
        };
        material.direction = self.anisotropy_direction(&anisotropy, messages)?;
        if let Some(old) = old {
            self.specular_glossiness(&old, &mut material, messages)?;
        }
        Ok(material)
    }

    /// Weight and roughness of the coat.
    fn coat(&mut self, place: &Place<'a>, messages: &mut Messages<'_>) -> Result<[FloatTextureId; 2], GltfError> {
        let coat = place.extension("KHR_materials_clearcoat");
        let weight = factor(&coat.key("clearcoatFactor"), 0.0);
        let weight = self.textures.scaled(weight, &coat.key("clearcoatTexture"), 0, messages)?;
        let roughness = factor(&coat.key("clearcoatRoughnessFactor"), 0.0);
        let roughness = self.textures.scaled(roughness, &coat.key("clearcoatRoughnessTexture"), 1, messages)?;
        Ok([weight, roughness])
    }

    /// Weight of the transmission.
    fn transmission(&mut self, place: &Place<'a>, messages: &mut Messages<'_>) -> Result<FloatTextureId, GltfError> {
        let extension = place.extension("KHR_materials_transmission");
        let weight = factor(&extension.key("transmissionFactor"), 0.0);
        self.textures.scaled(weight, &extension.key("transmissionTexture"), 0, messages)
    }

    /// Rotation and texture of `KHR_materials_anisotropy`.
    fn anisotropy_direction(
        &mut self,
        place: &Place<'a>,
        messages: &mut Messages<'_>,
    ) -> Result<Option<AnisotropyDirection>, GltfError> {
        let rotation = factor(&place.key("anisotropyRotation"), 0.0);
        let texture = place.key("anisotropyTexture");
        let image = self.textures.image(&texture, ImageChannels::Color, ImageEncoding::Linear, messages)?;
        let map = image.map(|image| self.textures.set.add_rgb(RgbTexture::Image(image)));
        Ok((rotation != 0.0 || map.is_some()).then_some(AnisotropyDirection { rotation, map }))
    }

    /// `KHR_materials_pbrSpecularGlossiness`: reflectance at normal incidence, and 1 − roughness, of a dielectric.
    fn specular_glossiness(
        &mut self,
        place: &Place<'a>,
        material: &mut PrincipledMaterial,
        messages: &mut Messages<'_>,
    ) -> Result<(), GltfError> {
        let color = Rgb::from_array(place.key("specularFactor").numbers().unwrap_or([1.0; 3]));
        let glossiness = factor(&place.key("glossinessFactor"), 1.0);
        let texture = place.key("specularGlossinessTexture");
        let image = self.textures.image(&texture, ImageChannels::Alpha, ImageEncoding::Linear, messages)?;

        // A dielectric whose specular colour is its reflectance
        material.metalness = self.textures.float(0.0);
        material.ior = MIRROR_IOR;
        material.specular_color = self.textures.colored(color, &texture, messages)?;
        material.roughness = match image {
            Some(image) => {
                let inverse = ImageTexture { scale: glossiness, invert: true, ..image };
                self.textures.set.add_float(FloatTexture::Image(inverse))
            }
            None => self.textures.float(1.0 - glossiness),
        };
        Ok(())
    }

    /// The opacity texture, the probability that rays are stopped; `None` for 1.
    fn opacity(
        &mut self,
        place: &Place<'a>,
        factor: f32,
        base: &Place<'a>,
        messages: &mut Messages<'_>,
    ) -> Result<Option<FloatTextureId>, GltfError> {
        let mode = place.key("alphaMode").text().unwrap_or("OPAQUE");
        if mode == "OPAQUE" {
            return Ok(None);
        }

        // Opacity of base colour and vertices
        let tex = self.textures.opacity_scaled(factor, base, messages)?;
        let scale = self.textures.set.add_float(FloatTexture::VertexOpacity);
        let alpha = self.textures.set.add_float(FloatTexture::Scale { tex, scale });
        if mode == "BLEND" {
            return Ok(Some(alpha));
        }

        // Mask
        let threshold = place.key("alphaCutoff").number().unwrap_or(0.5);
        Ok(Some(self.textures.set.add_float(FloatTexture::Threshold { tex: alpha, threshold })))
    }
}

/// Emitted radiance without the texture.
fn emitted(place: &Place<'_>) -> Rgb {
    let strength = place.extension("KHR_materials_emissive_strength").key("emissiveStrength").number();
    let color = Rgb::from_array(place.key("emissiveFactor").numbers().unwrap_or([0.0; 3]));
    (color * strength.unwrap_or(1.0)).map(|c| c.max(0.0))
}

/// `KHR_materials_ior`: 0 means an infinite index.
fn ior(place: &Place<'_>) -> f32 {
    match factor(&place.extension("KHR_materials_ior").key("ior"), 1.5) {
        0.0 => MIRROR_IOR,
        ior => ior.max(1.0),
    }
}

/// `KHR_materials_dispersion` of a solid: 20 over the Abbe number (n − 1)/(n(F) − n(C)), where n is the index at the
/// line d. At all wavelengths the index is linear in the inverse square of the wavelength (Cauchy's law).
fn dispersion(place: &Place<'_>) -> Option<Arc<Dispersion>> {
    // nm
    let [d, f, c] = [587.56, 486.13, 656.27];
    let strength = place.extension("KHR_materials_dispersion").key("dispersion").number().filter(|s| *s > 0.0)?;
    let n = ior(place);
    if !is_filled(place) || n <= LEAST_IOR || n >= MIRROR_IOR {
        return None;
    }
    let inverse_square = |lambda: f32| 1.0 / (lambda * lambda);
    let slope = (n - 1.0) * strength / 20.0 / (inverse_square(f) - inverse_square(c));
    let index = |lambda: f32| (n + slope * (inverse_square(lambda) - inverse_square(d))).max(LEAST_IOR);
    let pairs: Vec<f32> = (350..=800).step_by(5).flat_map(|l| [l as f32, index(l as f32)]).collect();
    Dispersion::new(&Spectrum::from_pairs(&pairs).ok()?).map(Arc::new)
}

/// True for solid glass.
fn is_filled(place: &Place<'_>) -> bool {
    let thickness = place.extension("KHR_materials_volume").key("thicknessFactor");
    place.extension("KHR_materials_transmission").exists() && factor(&thickness, 0.0) > 0.0
}

/// `KHR_materials_volume`: white light has the colour after the distance, in world units.
fn absorption(place: &Place<'_>) -> Option<Homogeneous> {
    let volume = place.extension("KHR_materials_volume");
    let color = Rgb::from_array(volume.key("attenuationColor").numbers()?);
    let distance = volume.key("attenuationDistance").number().filter(|d| *d > 0.0 && d.is_finite())?;
    let sigma_a = color.map(|c| -c.clamp(LEAST_COLOR, 1.0).ln() / distance);
    (is_filled(place) && !sigma_a.is_black()).then_some(Homogeneous {
        sigma_a,
        sigma_s: Rgb::BLACK,
        le: Rgb::BLACK,
        g: 0.0,
    })
}

/// Warns about properties that are rendered only approximately.
fn warn_of_approximations(place: &Place<'_>, messages: &mut Messages<'_>) {
    let coat = place.extension("KHR_materials_clearcoat").key("clearcoatNormalTexture");
    if coat.exists() {
        messages.warning(&coat, "the coat has the normals of the base");
    }
}
