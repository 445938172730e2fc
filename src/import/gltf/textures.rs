//! Textures and their images.

use super::messages::Messages;
use crate::imaging::AxisWrap;
use crate::import::images::{ImageChannels, ImageEncoding, ImageRequest};
use crate::import::resources::Resources;
use crate::lights::EmissionMapping;
use crate::textures::{
    Filter, FloatTexture, FloatTextureId, ImageTexture, Mapping2d, RgbTexture, RgbTextureId, TextureSet, Wrap,
};
use glam::{Affine2, Mat2};
use lumiris_formats::gltf::document::Content;
use lumiris_formats::gltf::{Document, GltfError, Place};
use lumiris_formats::output::Temporary;
use lumiris_formats::source::Span;
use lumiris_numbers::math::{Rgb, Vec2};
use std::collections::HashMap;
use std::path::{Path, PathBuf};

/// An emission image.
#[derive(Clone, Debug)]
pub(super) struct EmissionSource {
    /// Index of the texture, which has an image and a sampler.
    pub texture: usize,
    pub path: PathBuf,
    /// Source position of its name.
    pub span: Span,
    pub wrap: [AxisWrap; 2],
    pub filter: Filter,
    pub mapping: Option<EmissionMapping>,
}

/// Identifies an emission image: the texture, and the bits of its mapping.
pub(super) type EmissionKey = (usize, Option<(bool, [u32; 6])>);

impl EmissionSource {
    pub(super) fn key(&self) -> EmissionKey {
        let bits = |m: &EmissionMapping| (m.second, m.image_from_uv.to_cols_array().map(f32::to_bits));
        (self.texture, self.mapping.as_ref().map(bits))
    }
}

/// The file of an image.
#[derive(Clone)]
struct ImageFile {
    path: PathBuf,
    /// Source position of its name.
    span: Span,
}

/// The use of an image by a texture.
struct Sampler {
    /// Along rows and columns.
    wrap: [AxisWrap; 2],
    filter: Filter,
}

/// Textures during import.
pub(super) struct Textures<'a> {
    document: &'a Document,
    pub set: TextureSet,
    pub resources: Resources,
    /// Files by index of the image, which textures may share.
    image_files: HashMap<usize, Option<ImageFile>>,
    /// Temporary folder for images embedded in the document.
    folder: tempfile::TempDir,
    _temporary: Temporary,
}

impl<'a> Textures<'a> {
    pub(super) fn new(document: &'a Document) -> std::io::Result<Self> {
        let (set, resources) = (TextureSet::default(), Resources::default());
        let (image_files, folder) = (HashMap::new(), tempfile::tempdir()?);
        let _temporary = Temporary::new(folder.path());
        Ok(Textures { document, set, resources, image_files, folder, _temporary })
    }

    pub(super) fn float(&mut self, value: f32) -> FloatTextureId {
        self.set.add_float(FloatTexture::Constant(value))
    }

    /// A colour times a texture.
    pub(super) fn colored(
        &mut self,
        color: Rgb,
        place: &Place<'a>,
        messages: &mut Messages<'_>,
    ) -> Result<RgbTextureId, GltfError> {
        let constant = self.set.add_rgb(RgbTexture::Constant(color));
        let Some(image) = self.image(place, ImageChannels::Color, ImageEncoding::Srgb, messages)? else {
            return Ok(constant);
        };
        let tex2 = self.set.add_rgb(RgbTexture::Image(image));
        Ok(self.set.add_rgb(RgbTexture::Product { tex1: constant, tex2 }))
    }

    /// A number times a channel of a texture.
    pub(super) fn scaled(
        &mut self,
        factor: f32,
        place: &Place<'a>,
        channel: usize,
        messages: &mut Messages<'_>,
    ) -> Result<FloatTextureId, GltfError> {
        Ok(match self.image(place, ImageChannels::Color, ImageEncoding::Linear, messages)? {
            Some(image) => self.set.add_float(FloatTexture::Channel(ImageTexture { scale: factor, ..image }, channel)),
            None => self.float(factor),
        })
    }

    /// A number times the opacity of a texture.
    pub(super) fn opacity_scaled(
        &mut self,
        factor: f32,
        place: &Place<'a>,
        messages: &mut Messages<'_>,
    ) -> Result<FloatTextureId, GltfError> {
        Ok(match self.image(place, ImageChannels::Alpha, ImageEncoding::Linear, messages)? {
            Some(image) => self.set.add_float(FloatTexture::Image(ImageTexture { scale: factor, ..image })),
            None => self.float(factor),
        })
    }

    /// The file of a texture.
    fn file(&mut self, place: &Place<'a>, messages: &mut Messages<'_>) -> Result<Option<ImageFile>, GltfError> {
        let Some(index) = place.key("index").index() else { return Ok(None) };
        let texture = self.document.root().key("textures").item(index);
        let Some(source) = texture.key("source").index() else {
            messages.warning(&texture, "a texture without an image in PNG or JPEG is left out");
            return Ok(None);
        };
        if let Some(file) = self.image_files.get(&source) {
            return Ok(file.clone());
        }
        let file = self.image_file(source, messages)?;
        self.image_files.insert(source, file.clone());
        Ok(file)
    }

    /// The file of an image; an embedded image is written to a temporary file.
    fn image_file(&self, source: usize, messages: &mut Messages<'_>) -> Result<Option<ImageFile>, GltfError> {
        let image = self.document.root().key("images").item(source);
        let bytes = match self.document.content(&image)? {
            Content::File(path) => return Ok(Some(ImageFile { path, span: messages.file_span("images", source) })),
            Content::Bytes(bytes) => bytes,
            Content::Unread => return Ok(None),
        };
        let extension = if bytes.starts_with(&[0xff, 0xd8]) { "jpg" } else { "png" };
        let path = self.folder.path().join(format!("image{source}.{extension}"));
        std::fs::write(&path, bytes).map_err(|e| image.error(e.to_string()))?;
        Ok(Some(ImageFile { path, span: messages.file_span("images", source) }))
    }

    /// The sampler of a texture.
    fn sampler(&self, place: &Place<'a>) -> Sampler {
        let root = self.document.root();
        let sampler = place.key("index").index().and_then(|i| root.key("textures").item(i).key("sampler").index());
        let Some(sampler) = sampler.map(|i| root.key("samplers").item(i)) else {
            return Sampler { wrap: [AxisWrap::Repeat; 2], filter: Filter::Bilinear };
        };
        let wrap = ["wrapS", "wrapT"].map(|key| match sampler.key(key).index() {
            Some(33071) => AxisWrap::Clamp,
            Some(33648) => AxisWrap::Mirror,
            _ => AxisWrap::Repeat,
        });
        let is_nearest = sampler.key("magFilter").index() == Some(9728);
        Sampler { wrap, filter: if is_nearest { Filter::Point } else { Filter::Bilinear } }
    }

    /// An emission image.
    pub(super) fn emission(
        &mut self,
        place: &Place<'a>,
        messages: &mut Messages<'_>,
    ) -> Result<Option<EmissionSource>, GltfError> {
        let Some((ImageFile { path, span }, texture)) = self.file(place, messages)?.zip(place.key("index").index())
        else {
            return Ok(None);
        };
        let mapping = mapping(place, messages);
        let is_plain = !mapping.second && mapping.image_from_uv == Affine2::IDENTITY;
        let mapping = (!is_plain).then_some(mapping);
        let Sampler { wrap, filter } = self.sampler(place);
        Ok(Some(EmissionSource { texture, path, span, wrap, filter, mapping }))
    }

    pub(super) fn image(
        &mut self,
        place: &Place<'a>,
        channels: ImageChannels,
        encoding: ImageEncoding,
        messages: &mut Messages<'_>,
    ) -> Result<Option<ImageTexture>, GltfError> {
        let Some(ImageFile { path, span }) = self.file(place, messages)? else { return Ok(None) };
        let Sampler { wrap, filter } = self.sampler(place);
        let wrap = match wrap {
            [AxisWrap::Repeat, AxisWrap::Repeat] => Wrap::Repeat,
            [AxisWrap::Clamp, AxisWrap::Clamp] => Wrap::Clamp,
            mixed => Wrap::Axes(mixed),
        };
        let image = self.resources.image(ImageRequest { path, channels, encoding, wrap, filter }, span);
        let EmissionMapping { second, image_from_uv } = mapping(place, messages);
        let mapping = Mapping2d::Affine { second, matrix: image_from_uv.matrix2, offset: image_from_uv.translation };
        Ok(Some(ImageTexture { image, mapping, udim: None, scale: 1.0, invert: false }))
    }

    /// Files outside of the document.
    pub(super) fn files(&self) -> Vec<PathBuf> {
        let is_own = |path: &Path| path.starts_with(self.folder.path());
        self.resources.paths().filter(|path| !is_own(path)).map(Into::into).collect()
    }
}

/// The texture coordinates of an image, also of images that do not emit. v points down in the file and up
/// here, so v ↦ 1 − v is applied on both sides of the transform offset + rotation · scale.
fn mapping(place: &Place<'_>, messages: &mut Messages<'_>) -> EmissionMapping {
    let transform = place.extension("KHR_texture_transform");
    let sets = [transform.key("texCoord"), place.key("texCoord")];
    let set = sets.iter().find_map(|key| Some((key, key.index()?)));
    if let Some((key, set @ 2..)) = set {
        messages.warning(key, &format!("TEXCOORD_{set} is not read: textures have TEXCOORD_0 in its place"));
    }
    let offset = Vec2::from(transform.key("offset").numbers().unwrap_or([0.0; 2]));
    let scale = Vec2::from(transform.key("scale").numbers().unwrap_or([1.0; 2]));
    let (sin, cos) = transform.key("rotation").number().unwrap_or(0.0).sin_cos();
    let matrix = Mat2::from_cols(Vec2::new(cos, -sin), Vec2::new(sin, cos)) * Mat2::from_diagonal(scale);
    let flip = Mat2::from_diagonal(Vec2::new(1.0, -1.0));
    // 1 − (M (u, 1 − v) + o)_v
    let offset = flip * (matrix * Vec2::Y + offset) + Vec2::Y;
    let image_from_uv = Affine2::from_mat2_translation(flip * matrix * flip, offset);
    EmissionMapping { second: set.is_some_and(|(_, set)| set == 1), image_from_uv }
}
