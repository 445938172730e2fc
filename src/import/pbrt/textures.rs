//! `Texture`

use super::checks::{file_name, unknown};
use super::descriptions::TextureDesc;
use super::spectrum::SpectrumUse;
use super::state::Builder;
use super::transform::affine;
use crate::import::images::{ImageChannels, ImageEncoding, ImageRequest, Tile, UDIM, tiles};
use crate::textures::{
    Bilerp, CheckerboardMapping, Dots, Filter, FloatTexture, FloatTextureId, ImageId, ImageTexture, Mapping2d, Marble,
    NoiseKind, NoiseTexture, Octaves, RgbTexture, RgbTextureId, Udim, UdimId, Wrap,
};
use lumiris_formats::diagnostic::Diagnostics;
use lumiris_formats::names::file_in;
use lumiris_formats::pbrt::directive::Name;
use lumiris_formats::pbrt::params::{Input, ParamSet, ParamType, SpectrumValue};
use lumiris_formats::source::Span;
use lumiris_numbers::math::origin::rebased;
use lumiris_numbers::math::{DAffine3, DVec3, Rgb, Vec2, Vec3};

/// Maximum depth of references between textures.
const MAX_DEPTH: u32 = 500;

/// The tiles of an image, and the first one.
struct TiledImage {
    first: ImageId,
    udim: UdimId,
}

impl Builder<'_> {
    /// `Texture "name" "float|spectrum" "class"`; textures are made at the end of the text.
    pub fn texture(&mut self, name: Name, value: &Name, class: Name, params: ParamSet, d: &mut Diagnostics) {
        let is_float = match value.text.as_str() {
            "float" => true,
            "spectrum" => false,
            "color" => {
                d.warning_once(value.span, "texture type `color` is pbrt-v3; pbrt-v4 writes `spectrum`");
                false
            }
            other => return unknown(other, value.span, "texture type", &["float", "spectrum"], d),
        };
        let is_new = if is_float { self.float_textures.define(&name, d) } else { self.rgb_textures.define(&name, d) };
        if is_new {
            let state = self.param_state();
            self.pending_textures.push(TextureDesc { name, is_float, class, params, state });
        }
    }

    /// Makes a texture after the textures that it may refer to.
    pub(super) fn make_texture(&mut self, desc: &TextureDesc, d: &mut Diagnostics) {
        let (class, p) = (&desc.class, &desc.params);
        let depth = if desc.is_float {
            let texture = self.float_texture(class, p, d);
            let id = self.textures.add_float(texture);
            self.float_textures.set(&desc.name, id);
            self.textures.float_depth(id)
        } else {
            let texture = self.rgb_texture(class, p, d);
            let id = self.textures.add_rgb(texture);
            self.rgb_textures.set(&desc.name, id);
            self.textures.rgb_depth(id)
        };
        if depth > MAX_DEPTH {
            d.error(desc.name.span, format!("textures refer to each other more than {MAX_DEPTH} deep"));
        }
        p.report_unused(d);
    }

    fn float_texture(&mut self, class: &Name, p: &ParamSet, d: &mut Diagnostics) -> FloatTexture {
        match class.text.as_str() {
            "constant" => FloatTexture::Constant(p.float("value", d).unwrap_or(1.0)),
            "scale" => {
                let tex = self.float_param(p, "tex", 1.0, d);
                FloatTexture::Scale { tex, scale: self.float_param(p, "scale", 1.0, d) }
            }
            "mix" => FloatTexture::Mix {
                tex1: self.float_param(p, "tex1", 0.0, d),
                tex2: self.float_param(p, "tex2", 1.0, d),
                amount: self.float_param(p, "amount", 0.5, d),
            },
            "directionmix" => FloatTexture::DirectionMix {
                tex1: self.float_param(p, "tex1", 0.0, d),
                tex2: self.float_param(p, "tex2", 1.0, d),
                direction: self.direction(p, d),
            },
            "checkerboard" => FloatTexture::Checkerboard {
                mapping: self.checker_mapping(p, d),
                tex1: self.float_param(p, "tex1", 1.0, d),
                tex2: self.float_param(p, "tex2", 0.0, d),
            },
            "imagemap" => match self.image_texture(ImageChannels::Number, p, d) {
                Some(image) => FloatTexture::Image(image),
                None => FloatTexture::Constant(1.0),
            },
            "ptex" => match self.face_texture(p, d) {
                Some(faces) => FloatTexture::Faces(faces),
                None => FloatTexture::Constant(1.0),
            },
            "fbm" | "wrinkled" | "windy" => FloatTexture::Noise(self.noise(&class.text, p, d)),
            "dots" => FloatTexture::Dots {
                dots: Dots { mapping: self.mapping(p, d) },
                tex1: self.float_param(p, "inside", 1.0, d),
                tex2: self.float_param(p, "outside", 0.0, d),
            },
            "bilerp" => {
                // Corners are constants
                let corners = CORNERS.map(|(key, value)| p.float(key, d).unwrap_or(value));
                FloatTexture::Bilerp(Bilerp { mapping: self.mapping(p, d), corners })
            }
            other => {
                unknown(other, class.span, "texture class", FLOAT_CLASSES, d);
                p.ignore_all();
                FloatTexture::Constant(0.5)
            }
        }
    }

    fn rgb_texture(&mut self, class: &Name, p: &ParamSet, d: &mut Diagnostics) -> RgbTexture {
        match class.text.as_str() {
            "constant" => {
                let value = p.spectrum("value", d);
                let color = value.and_then(|v| self.color(v, SpectrumUse::Albedo, p.span_of("value"), d));
                RgbTexture::Constant(color.unwrap_or(Rgb::WHITE))
            }
            "scale" => {
                let tex = self.rgb_param(p, "tex", Rgb::WHITE, SpectrumUse::Albedo, d);
                RgbTexture::Scale { tex, scale: self.float_param(p, "scale", 1.0, d) }
            }
            "mix" => RgbTexture::Mix {
                tex1: self.rgb_param(p, "tex1", Rgb::BLACK, SpectrumUse::Albedo, d),
                tex2: self.rgb_param(p, "tex2", Rgb::WHITE, SpectrumUse::Albedo, d),
                amount: self.float_param(p, "amount", 0.5, d),
            },
            "directionmix" => RgbTexture::DirectionMix {
                tex1: self.rgb_param(p, "tex1", Rgb::BLACK, SpectrumUse::Albedo, d),
                tex2: self.rgb_param(p, "tex2", Rgb::WHITE, SpectrumUse::Albedo, d),
                direction: self.direction(p, d),
            },
            "checkerboard" => RgbTexture::Checkerboard {
                mapping: self.checker_mapping(p, d),
                tex1: self.rgb_param(p, "tex1", Rgb::WHITE, SpectrumUse::Albedo, d),
                tex2: self.rgb_param(p, "tex2", Rgb::BLACK, SpectrumUse::Albedo, d),
            },
            "imagemap" => match self.image_texture(ImageChannels::Color, p, d) {
                Some(image) => RgbTexture::Image(image),
                None => RgbTexture::Constant(Rgb::WHITE),
            },
            "ptex" => match self.face_texture(p, d) {
                Some(faces) => RgbTexture::Faces(faces),
                None => RgbTexture::Constant(Rgb::WHITE),
            },
            "marble" => RgbTexture::Marble(Marble {
                octaves: octaves(p, d),
                scale: p.float("scale", d).unwrap_or(1.0),
                variation: p.float("variation", d).unwrap_or(0.2),
                texture_from_world: self.texture_from_world(p, d),
            }),
            "dots" => RgbTexture::Dots {
                dots: Dots { mapping: self.mapping(p, d) },
                tex1: self.rgb_param(p, "inside", Rgb::WHITE, SpectrumUse::Albedo, d),
                tex2: self.rgb_param(p, "outside", Rgb::BLACK, SpectrumUse::Albedo, d),
            },
            "bilerp" => {
                let corners = CORNERS
                    .map(|(key, value)| self.color_param(p, key, SpectrumUse::Albedo, d).unwrap_or(Rgb::splat(value)));
                RgbTexture::Bilerp(Bilerp { mapping: self.mapping(p, d), corners })
            }
            other => {
                unknown(other, class.span, "texture class", RGB_CLASSES, d);
                p.ignore_all();
                RgbTexture::Constant(Rgb::splat(0.5))
            }
        }
    }

    fn noise(&self, class: &str, p: &ParamSet, d: &mut Diagnostics) -> NoiseTexture {
        let kind = match class {
            "fbm" => NoiseKind::Fbm(octaves(p, d)),
            "wrinkled" => NoiseKind::Wrinkled(octaves(p, d)),
            _ => NoiseKind::Windy,
        };
        NoiseTexture { kind, texture_from_world: self.texture_from_world(p, d) }
    }

    fn direction(&self, p: &ParamSet, d: &mut Diagnostics) -> Vec3 {
        let dir = p.triple("dir", ParamType::Vector3, d).map_or(Vec3::Y, Vec3::from_array);
        affine(&self.state.ctm.start).transform_vector3(dir.as_dvec3()).as_vec3().normalize_or(Vec3::Y)
    }

    fn checker_mapping(&self, p: &ParamSet, d: &mut Diagnostics) -> CheckerboardMapping {
        match p.integer("dimension", d).unwrap_or(2) {
            2 => CheckerboardMapping::Squares(self.mapping(p, d)),
            3 => CheckerboardMapping::Cubes { texture_from_world: self.texture_from_world(p, d) },
            other => {
                d.error(p.span_of("dimension"), format!("a checkerboard has 2 or 3 dimensions, not {other}"));
                CheckerboardMapping::Squares(self.mapping(p, d))
            }
        }
    }

    /// For textures that depend on the point; the transform must not be singular.
    fn texture_from_world(&self, p: &ParamSet, d: &mut Diagnostics) -> DAffine3 {
        match self.has_inverse("a texture in space", p.span, d) {
            true => rebased(&affine(&self.state.ctm.start.inverse()), DVec3::ZERO, self.origin),
            false => DAffine3::IDENTITY,
        }
    }

    fn mapping(&self, p: &ParamSet, d: &mut Diagnostics) -> Mapping2d {
        match p.string("mapping", d).unwrap_or("uv") {
            "spherical" => Mapping2d::Spherical { texture_from_world: self.texture_from_world(p, d) },
            "cylindrical" => Mapping2d::Cylindrical { texture_from_world: self.texture_from_world(p, d) },
            "planar" => Mapping2d::Planar {
                vs: p.triple("v1", ParamType::Vector3, d).map_or(Vec3::X, Vec3::from_array),
                vt: p.triple("v2", ParamType::Vector3, d).map_or(Vec3::Y, Vec3::from_array),
                delta: Vec2::new(p.float("udelta", d).unwrap_or(0.0), p.float("vdelta", d).unwrap_or(0.0)),
                texture_from_world: self.texture_from_world(p, d),
            },
            other => {
                if other != "uv" {
                    let known = ["uv", "spherical", "cylindrical", "planar"];
                    unknown(other, p.span_of("mapping"), "mapping", &known, d);
                }
                Mapping2d::Uv {
                    scale: Vec2::new(p.float("uscale", d).unwrap_or(1.0), p.float("vscale", d).unwrap_or(1.0)),
                    delta: Vec2::new(p.float("udelta", d).unwrap_or(0.0), p.float("vdelta", d).unwrap_or(0.0)),
                }
            }
        }
    }

    fn image_texture(&mut self, channels: ImageChannels, p: &ParamSet, d: &mut Diagnostics) -> Option<ImageTexture> {
        let mapping = self.mapping(p, d);
        let wrap = match p.string("wrap", d).unwrap_or("repeat") {
            "repeat" => Wrap::Repeat,
            "black" => Wrap::Black,
            "clamp" => Wrap::Clamp,
            "octahedralsphere" => Wrap::OctahedralSphere,
            other => {
                unknown(other, p.span_of("wrap"), "wrap mode", &["repeat", "black", "clamp", "octahedralsphere"], d);
                Wrap::Repeat
            }
        };
        let filter = match p.string("filter", d).unwrap_or("bilinear") {
            "point" => Filter::Point,
            "bilinear" => Filter::Bilinear,
            "trilinear" => Filter::Trilinear,
            "ewa" | "EWA" => Filter::Ewa,
            other => {
                unknown(other, p.span_of("filter"), "filter", &["point", "bilinear", "trilinear", "ewa"], d);
                Filter::Bilinear
            }
        };
        let mut encoding = self.encoding(p, d);
        if p.boolean("trilinear", d).is_some() {
            d.warning_once(p.span_of("trilinear"), "`trilinear` is pbrt-v3; pbrt-v4 writes `filter`");
        }
        // Bounds the kernel of `ewa`, which the samples of the pixel replace
        p.float("maxanisotropy", d);
        if let Some(gamma) = p.boolean("gamma", d) {
            d.warning_once(p.span_of("gamma"), "`gamma` is pbrt-v3; pbrt-v4 writes `encoding`");
            encoding = if gamma { ImageEncoding::Srgb } else { ImageEncoding::Linear };
        }
        let scale = p.float("scale", d).unwrap_or(1.0);
        let invert = p.boolean("invert", d).unwrap_or(false);
        let Some(name) = file_name(p, "filename", d) else {
            d.error(p.span, "an image texture needs a `string filename`");
            return None;
        };
        let (path, span) = (file_in(&self.folder, name), p.span_of("filename"));
        let request = ImageRequest { path, channels, encoding, wrap, filter };
        let (image, udim) = if name.contains(UDIM) {
            let TiledImage { first, udim } = self.udim(&request, span, d)?;
            (first, Some(udim))
        } else {
            (self.resources.image(request, span), None)
        };
        Some(ImageTexture { image, udim, mapping, scale, invert })
    }

    /// The tiles of a name with [`UDIM`] in its folder, and the first one. Beyond its edges a tile repeats its edge
    /// values.
    fn udim(&mut self, request: &ImageRequest, span: Span, d: &mut Diagnostics) -> Option<TiledImage> {
        let mut udim = Udim::default();
        let mut first = None;
        for Tile { number, path } in tiles(&request.path) {
            let image = self.resources.image(ImageRequest { path, wrap: Wrap::Clamp, ..request.clone() }, span);
            udim.set(number, image);
            first.get_or_insert(image);
        }
        let Some(first) = first else {
            d.error(span, format!("there is no tile of {}, such as …1001…", request.path.display()));
            return None;
        };
        self.textures.udims.push(udim);
        Some(TiledImage { first, udim: (self.textures.udims.len() - 1) as UdimId })
    }

    /// `encoding`; an unknown one is an error and ignored.
    pub(super) fn encoding(&self, p: &ParamSet, d: &mut Diagnostics) -> ImageEncoding {
        let Some(text) = p.string("encoding", d) else { return ImageEncoding::Auto };
        let gamma = text.strip_prefix("gamma ").and_then(|g| g.trim().parse::<f32>().ok()).filter(|g| *g > 0.0);
        match (text, gamma) {
            ("sRGB", _) => ImageEncoding::Srgb,
            ("linear", _) => ImageEncoding::Linear,
            (_, Some(gamma)) => ImageEncoding::Gamma(gamma),
            _ => {
                let message = format!("unknown encoding `{text}`");
                d.error(p.span_of("encoding"), message).help("one of sRGB, linear, gamma N");
                ImageEncoding::Auto
            }
        }
    }

    /// A float parameter or the texture that it names.
    pub fn float_param(
        &mut self,
        p: &ParamSet,
        name: &'static str,
        default: f32,
        d: &mut Diagnostics,
    ) -> FloatTextureId {
        let value = match p.float_input(name, d) {
            Some(Input::Texture(texture)) => match self.float_texture_named(texture, p.span_of(name), d) {
                Some(id) => return id,
                None => default,
            },
            Some(Input::Value(value)) => value,
            None => default,
        };
        self.textures.add_float(FloatTexture::Constant(value))
    }

    /// The float texture with this name, if it is already made.
    pub fn float_texture_named(&self, name: &str, span: Span, d: &mut Diagnostics) -> Option<FloatTextureId> {
        self.float_textures.find(name, span, &self.rgb_textures, d)
    }

    /// A spectrum parameter or the texture that it names.
    pub fn rgb_param(
        &mut self,
        p: &ParamSet,
        name: &'static str,
        default: Rgb,
        usage: SpectrumUse,
        d: &mut Diagnostics,
    ) -> RgbTextureId {
        let color = match p.spectrum_input(name, d) {
            Some(Input::Texture(texture)) => match self.rgb_texture_named(texture, p.span_of(name), d) {
                Some(id) => return id,
                None => default,
            },
            Some(Input::Value(value)) => self.color(value, usage, p.span_of(name), d).unwrap_or(default),
            None => default,
        };
        self.textures.add_rgb(RgbTexture::Constant(color))
    }

    fn rgb_texture_named(&self, name: &str, span: Span, d: &mut Diagnostics) -> Option<RgbTextureId> {
        self.rgb_textures.find(name, span, &self.float_textures, d)
    }

    /// A spectrum parameter that cannot be a texture.
    pub fn color_param(
        &self,
        p: &ParamSet,
        name: &'static str,
        usage: SpectrumUse,
        d: &mut Diagnostics,
    ) -> Option<Rgb> {
        let value: SpectrumValue<'_> = p.spectrum(name, d)?;
        self.color(value, usage, p.span_of(name), d)
    }
}

/// The corners of a bilinear texture, and their default values.
const CORNERS: [(&str, f32); 4] = [("v00", 0.0), ("v10", 0.0), ("v01", 1.0), ("v11", 1.0)];
/// Maximum number of noise octaves: the frequency of the last is 10⁹.
const MAX_OCTAVES: i32 = 30;
const FLOAT_CLASSES: &[&str] = &[
    "constant",
    "scale",
    "mix",
    "directionmix",
    "checkerboard",
    "imagemap",
    "ptex",
    "fbm",
    "wrinkled",
    "windy",
    "dots",
    "bilerp",
];
const RGB_CLASSES: &[&str] =
    &["constant", "scale", "mix", "directionmix", "checkerboard", "imagemap", "ptex", "marble", "dots", "bilerp"];

fn octaves(p: &ParamSet, d: &mut Diagnostics) -> Octaves {
    let roughness = p.float("roughness", d).unwrap_or(0.5);
    let count = match p.integer("octaves", d).unwrap_or(8) {
        count @ 0..=MAX_OCTAVES => count as u32,
        other => {
            d.error(p.span_of("octaves"), format!("octaves must be from 0 to {MAX_OCTAVES}, not {other}"));
            0
        }
    };
    Octaves { count, roughness }
}
