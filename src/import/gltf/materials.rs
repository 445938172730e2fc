//! Materials and their textures.

use super::Messages;
use crate::import::images::{ImageChannels, ImageEncoding, ImageRequest};
use crate::import::resources::Resources;
use crate::materials::{Material, MaterialEntry, MaterialId, NormalMap, PrincipledMaterial};
use crate::textures::{
    Filter, FloatTexture, FloatTextureId, ImageTexture, Mapping2d, RgbTexture, RgbTextureId, TextureSet, Wrap,
};
use glam::Mat2;
use lumiris_formats::gltf::document::Content;
use lumiris_formats::gltf::{Document, GltfError, Place};
use lumiris_formats::source::Span;
use lumiris_numbers::math::{Rgb, Vec2};
use std::path::PathBuf;

/// What a primitive needs to know of its material.
#[derive(Clone)]
pub(super) struct Look {
    pub material: MaterialId,
    /// Texture of the opacity.
    pub alpha: Option<FloatTextureId>,
    /// Radiance, with the image that it is a factor of.
    pub emission: Rgb,
    pub emission_image: Option<PathBuf>,
    pub is_double_sided: bool,
}

/// Materials while a scene is read.
pub(super) struct Materials<'a> {
    document: &'a Document,
    pub textures: TextureSet,
    pub entries: Vec<MaterialEntry>,
    pub resources: Resources,
    pub looks: Vec<Look>,
    /// Holds images that are in the document.
    folder: tempfile::TempDir,
}

impl<'a> Materials<'a> {
    pub(super) fn new(document: &'a Document) -> std::io::Result<Self> {
        Ok(Materials {
            document,
            textures: TextureSet::default(),
            entries: Vec::new(),
            resources: Resources::default(),
            looks: Vec::new(),
            folder: tempfile::tempdir()?,
        })
    }

    /// Understands all materials, and the one of primitives without a material as the last.
    pub(super) fn read(&mut self, messages: &mut Messages<'_>) -> Result<(), GltfError> {
        let mut places = self.document.root().key("materials").items();
        places.push(self.document.root().key("default material"));
        for place in places {
            let look = self.look(&place, messages)?;
            self.looks.push(look);
        }
        Ok(())
    }

    fn float(&mut self, value: f32) -> FloatTextureId {
        self.textures.add_float(FloatTexture::Constant(value))
    }

    fn look(&mut self, place: &Place<'a>, messages: &mut Messages<'_>) -> Result<Look, GltfError> {
        let pbr = place.key("pbrMetallicRoughness");
        let factor: [f32; 4] = pbr.key("baseColorFactor").numbers().unwrap_or([1.0; 4]);
        let color = Rgb::new(factor[0], factor[1], factor[2]);
        let base = pbr.key("baseColorTexture");
        let base_color = self.colored(color, &base)?;
        let vertex = self.textures.add_rgb(RgbTexture::VertexColor);
        let base_color = self.textures.add_rgb(RgbTexture::Product { tex1: base_color, tex2: vertex });
        let is_unlit = place.extension("KHR_materials_unlit").exists();
        let material = if is_unlit {
            messages.warning(place, "an unlit surface emits its colour, and lights others");
            Material::Diffuse { reflectance: self.textures.add_rgb(RgbTexture::Constant(Rgb::BLACK)) }
        } else {
            Material::Principled(self.principled(place, base_color, messages)?)
        };
        let normal = place.key("normalTexture");
        let normal_map = match self.image(&normal, ImageChannels::Color, ImageEncoding::Linear)? {
            Some(image) => {
                Some(NormalMap { image, strength: normal.key("scale").number().unwrap_or(1.0), is_along_v: true })
            }
            None => None,
        };
        let name = place.key("name").text().unwrap_or("default").to_owned();
        self.entries.push(MaterialEntry { name, material, normal_map, displacement: None });
        let strength = place.extension("KHR_materials_emissive_strength").key("emissiveStrength").number();
        let mut emission = Rgb::from_array(place.key("emissiveFactor").numbers().unwrap_or([0.0; 3]));
        emission *= strength.unwrap_or(1.0).max(0.0);
        let emissive = if is_unlit { base.clone() } else { place.key("emissiveTexture") };
        if is_unlit {
            emission = color;
        }
        let emission_image = if emission.is_black() { None } else { self.file(&emissive)? };
        if emission_image.is_some() && emissive.extension("KHR_texture_transform").exists() {
            messages.warning(&emissive, "the transformation of an emissive texture is not applied");
        }
        Ok(Look {
            material: (self.entries.len() - 1) as MaterialId,
            alpha: self.opacity(place, factor[3], &base)?,
            emission,
            emission_image,
            is_double_sided: place.key("doubleSided").is_true(),
        })
    }

    fn principled(
        &mut self,
        place: &Place<'a>,
        base_color: RgbTextureId,
        messages: &mut Messages<'_>,
    ) -> Result<PrincipledMaterial, GltfError> {
        for name in place.key("extensions").names() {
            if ["KHR_materials_sheen", "KHR_materials_iridescence", "KHR_materials_dispersion"].contains(&name) {
                messages.warning(&place.extension(name), "is not rendered");
            }
        }
        let volume = place.extension("KHR_materials_volume");
        if volume.key("attenuationColor").exists() {
            messages.warning(&volume.key("attenuationColor"), "absorption is not rendered");
        }
        let pbr = place.key("pbrMetallicRoughness");
        let packed = pbr.key("metallicRoughnessTexture");
        let unit = |place: Place<'_>, default: f32| place.number().unwrap_or(default);
        let specular = place.extension("KHR_materials_specular");
        let coat = place.extension("KHR_materials_clearcoat");
        let anisotropy = place.extension("KHR_materials_anisotropy");
        if anisotropy.key("anisotropyRotation").number().is_some_and(|r| r != 0.0)
            || anisotropy.key("anisotropyTexture").exists()
        {
            messages.warning(&anisotropy, "the direction of anisotropy is that of the tangents");
        }
        if coat.key("clearcoatNormalTexture").exists() {
            messages.warning(&coat.key("clearcoatNormalTexture"), "the coat has the normals of the base");
        }
        let transmission = place.extension("KHR_materials_transmission");
        let color = Rgb::from_array(specular.key("specularColorFactor").numbers().unwrap_or([1.0; 3]));
        Ok(PrincipledMaterial {
            base_color,
            metalness: self.scaled(unit(pbr.key("metallicFactor"), 1.0), &packed, 2)?,
            roughness: self.scaled(unit(pbr.key("roughnessFactor"), 1.0), &packed, 1)?,
            anisotropy: unit(anisotropy.key("anisotropyStrength"), 0.0),
            ior: unit(place.extension("KHR_materials_ior").key("ior"), 1.5).max(1.0),
            specular: self
                .opacity_scaled(unit(specular.key("specularFactor"), 1.0), &specular.key("specularTexture"))?,
            specular_color: self.colored(color, &specular.key("specularColorTexture"))?,
            transmission: self.scaled(
                unit(transmission.key("transmissionFactor"), 0.0),
                &transmission.key("transmissionTexture"),
                0,
            )?,
            is_thin: volume.key("thicknessFactor").number().unwrap_or(0.0) <= 0.0,
            coat: self.scaled(unit(coat.key("clearcoatFactor"), 0.0), &coat.key("clearcoatTexture"), 0)?,
            coat_roughness: self.scaled(
                unit(coat.key("clearcoatRoughnessFactor"), 0.0),
                &coat.key("clearcoatRoughnessTexture"),
                1,
            )?,
        })
    }

    /// The probability that rays are stopped; `None` for 1.
    fn opacity(
        &mut self,
        place: &Place<'a>,
        factor: f32,
        base: &Place<'a>,
    ) -> Result<Option<FloatTextureId>, GltfError> {
        let mode = place.key("alphaMode").text().unwrap_or("OPAQUE");
        if mode == "OPAQUE" {
            return Ok(None);
        }
        let tex = self.opacity_scaled(factor, base)?;
        let vertex = self.textures.add_float(FloatTexture::VertexOpacity);
        let alpha = self.textures.add_float(FloatTexture::Scale { tex, scale: vertex });
        if mode == "BLEND" {
            return Ok(Some(alpha));
        }
        let threshold = place.key("alphaCutoff").number().unwrap_or(0.5);
        Ok(Some(self.textures.add_float(FloatTexture::Threshold { tex: alpha, threshold })))
    }

    /// A colour times a texture.
    fn colored(&mut self, color: Rgb, place: &Place<'a>) -> Result<RgbTextureId, GltfError> {
        let constant = self.textures.add_rgb(RgbTexture::Constant(color));
        let Some(image) = self.image(place, ImageChannels::Color, ImageEncoding::Srgb)? else { return Ok(constant) };
        let tex2 = self.textures.add_rgb(RgbTexture::Image(image));
        Ok(self.textures.add_rgb(RgbTexture::Product { tex1: constant, tex2 }))
    }

    /// A number times a channel of a texture.
    fn scaled(&mut self, factor: f32, place: &Place<'a>, channel: usize) -> Result<FloatTextureId, GltfError> {
        Ok(match self.image(place, ImageChannels::Color, ImageEncoding::Linear)? {
            Some(image) => {
                self.textures.add_float(FloatTexture::Channel(ImageTexture { scale: factor, ..image }, channel))
            }
            None => self.float(factor),
        })
    }

    /// A number times the opacity of a texture.
    fn opacity_scaled(&mut self, factor: f32, place: &Place<'a>) -> Result<FloatTextureId, GltfError> {
        Ok(match self.image(place, ImageChannels::Alpha, ImageEncoding::Linear)? {
            Some(image) => self.textures.add_float(FloatTexture::Image(ImageTexture { scale: factor, ..image })),
            None => self.float(factor),
        })
    }

    /// The file of a texture; an image of the document becomes one.
    fn file(&self, place: &Place<'a>) -> Result<Option<PathBuf>, GltfError> {
        let Some(index) = place.key("index").index() else { return Ok(None) };
        let texture = self.document.root().key("textures").item(index);
        let Some(source) = texture.key("source").index() else { return Ok(None) };
        let image = self.document.root().key("images").item(source);
        Ok(Some(match self.document.content(&image)? {
            Content::File(path) => path,
            Content::Bytes(bytes) => {
                let extension = if bytes.starts_with(&[0xff, 0xd8]) { "jpg" } else { "png" };
                let path = self.folder.path().join(format!("image{source}.{extension}"));
                if !path.exists() {
                    let failed = |e: std::io::Error| GltfError { place: image.path.clone(), message: e.to_string() };
                    std::fs::write(&path, bytes).map_err(failed)?;
                }
                path
            }
        }))
    }

    fn image(
        &mut self,
        place: &Place<'a>,
        channels: ImageChannels,
        encoding: ImageEncoding,
    ) -> Result<Option<ImageTexture>, GltfError> {
        let Some(path) = self.file(place)? else { return Ok(None) };
        let root = self.document.root();
        let texture = root.key("textures").item(place.key("index").index().unwrap_or(0));
        let sampler = texture.key("sampler").index().map(|i| root.key("samplers").item(i));
        let clamps = sampler.is_some_and(|s| s.key("wrapS").index() == Some(33071));
        let wrap = if clamps { Wrap::Clamp } else { Wrap::Repeat };
        let request = ImageRequest { path, channels, encoding, wrap, filter: Filter::Bilinear };
        let image = self.resources.image(request, Span::default());
        Ok(Some(ImageTexture { image, mapping: mapping(place), scale: 1.0, invert: false }))
    }

    /// Files that are not in the document.
    pub(super) fn files(&self) -> Vec<PathBuf> {
        let is_own = |path: &std::path::Path| path.starts_with(self.folder.path());
        self.resources.paths().filter(|path| !is_own(path)).map(Into::into).collect()
    }
}

/// Texture coordinates have v downwards in the file, and upwards here: v ↦ 1 − v on both sides of the transformation
/// offset + rotation · scale.
fn mapping(place: &Place<'_>) -> Mapping2d {
    let transform = place.extension("KHR_texture_transform");
    let set = transform.key("texCoord").index().or_else(|| place.key("texCoord").index()).unwrap_or(0);
    let offset = Vec2::from(transform.key("offset").numbers().unwrap_or([0.0; 2]));
    let scale = Vec2::from(transform.key("scale").numbers().unwrap_or([1.0; 2]));
    let (sin, cos) = transform.key("rotation").number().unwrap_or(0.0).sin_cos();
    let matrix = Mat2::from_cols(Vec2::new(cos, -sin), Vec2::new(sin, cos)) * Mat2::from_diagonal(scale);
    let flip = Mat2::from_diagonal(Vec2::new(1.0, -1.0));
    // 1 − (M (u, 1 − v) + o)_v
    let offset = flip * (matrix * Vec2::Y + offset) + Vec2::Y;
    Mapping2d::Affine { second: set == 1, matrix: flip * matrix * flip, offset }
}
