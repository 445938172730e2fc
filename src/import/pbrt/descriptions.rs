//! Descriptions of the scene's content, kept until the text and all files have been read.

use super::transform::Ctm;
use crate::geometry::{Curve, CurveKind, QuadricKind};
use crate::lights::Portal;
use crate::materials::MaterialId;
use crate::media::{Homogeneous, Medium};
use crate::textures::FloatTextureId;
use lumiris_formats::color_space::ColorSpace;
use lumiris_formats::pbrt::directive::Name;
use lumiris_formats::pbrt::params::ParamSet;
use lumiris_formats::source::Span;
use lumiris_numbers::math::{Affine3A, DAffine3, DVec3, Rgb, Vec2, Vec3};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A directive that is evaluated after all directives have been read: the camera needs the film's size.
pub(super) struct Pending {
    pub name: Name,
    pub params: ParamSet,
}

/// The state that determines the meaning of texture and material parameters.
#[derive(Clone)]
pub(super) struct ParamState {
    pub ctm: Ctm,
    pub color_space: ColorSpace,
}

/// A texture that is made once all textures are defined.
pub(super) struct TextureDesc {
    pub name: Name,
    /// True for floats, false for spectra.
    pub is_float: bool,
    pub class: Name,
    pub params: ParamSet,
    pub state: ParamState,
}

/// A material that is made once all textures and material names are defined.
pub(super) struct MaterialDesc {
    /// Its index among the materials.
    pub id: MaterialId,
    /// A readable name.
    pub name: String,
    pub kind: Name,
    pub params: ParamSet,
    pub state: ParamState,
}

/// A medium that is made once the origin of rendered space is known.
pub(super) struct PendingMedium {
    /// Its index among the media.
    pub index: usize,
    pub params: ParamSet,
    pub state: ParamState,
}

/// An instance of an object that is not defined yet.
pub(super) struct LateInstance {
    pub name: Name,
    /// The object that contains it.
    pub holder: Option<usize>,
    pub ctm: Ctm,
    /// Source position of the directive.
    pub span: Span,
}

/// The material of a shape: an id, or a name that may be defined later.
#[derive(Clone, Debug)]
pub enum MaterialUse {
    /// A material with an id.
    Id(MaterialId),
    /// By name, shared by its shapes.
    Named(Arc<Name>),
}

/// Media on the two sides of a surface; `None` is vacuum.
#[derive(Clone, Debug, Default)]
pub struct MediumNames {
    /// Behind the normal.
    pub inside: Option<Name>,
    /// On the side of the normal.
    pub outside: Option<Name>,
}

impl MaterialUse {
    /// True if both refer to the same material in the same way.
    pub(super) fn is_same(&self, other: &MaterialUse) -> bool {
        match (self, other) {
            (MaterialUse::Id(a), MaterialUse::Id(b)) => a == b,
            (MaterialUse::Named(a), MaterialUse::Named(b)) => a.text == b.text,
            (MaterialUse::Id(_), MaterialUse::Named(_)) | (MaterialUse::Named(_), MaterialUse::Id(_)) => false,
        }
    }
}

impl MediumNames {
    /// True if both name the same media.
    pub(super) fn is_same(&self, other: &MediumNames) -> bool {
        text(&self.inside) == text(&other.inside) && text(&self.outside) == text(&other.outside)
    }

    /// True if the two media differ.
    pub fn differ(&self) -> bool {
        text(&self.inside) != text(&self.outside)
    }
}

/// The text of a name.
fn text(name: &Option<Name>) -> Option<&str> {
    name.as_ref().map(|name| name.text.as_str())
}

/// A medium by its name.
#[derive(Clone, Debug)]
pub struct MediumDesc {
    /// Its name, and the source position.
    pub name: Name,
    /// The medium; `None` after an error, and until its file is read.
    pub medium: Option<Medium>,
    /// The description of a medium that needs a file.
    pub(super) volume: Option<VolumeDesc>,
}

/// The name of a grid.
#[derive(Clone, Debug)]
pub(super) struct GridName {
    pub text: String,
    /// Source position; `None` for the default name.
    pub span: Option<Span>,
}

/// A medium that needs a file.
#[derive(Clone, Debug)]
pub(super) struct VolumeDesc {
    /// The file.
    pub(super) path: PathBuf,
    /// Source position of the file name.
    pub(super) span: Span,
    /// The density grid.
    pub(super) density: GridName,
    /// The temperature grid; `None` without emission.
    pub(super) temperature: Option<GridName>,
    /// Subtracted from temperatures, which are then multiplied by the next factor.
    pub(super) offset: f32,
    pub(super) scale: f32,
    /// Coefficients where the density is 1 (1/m).
    pub(super) sigma_a: Rgb,
    pub(super) sigma_s: Rgb,
    /// Factor of the emission.
    pub(super) le_scale: f32,
    pub(super) g: f32,
    /// Transform from the space of the file.
    pub(super) placement: DAffine3,
}

/// The interior of a material.
#[derive(Clone, Copy, Debug)]
pub(super) struct Interior {
    pub(super) medium: Homogeneous,
    /// True if light enters and leaves by smooth refraction only.
    pub(super) is_smooth: bool,
    /// The material.
    pub(super) span: Span,
}

/// An area light as written; it applies to the shapes that follow.
#[derive(Clone, Debug)]
pub struct AreaLightDesc {
    /// Radiance including the scale.
    pub l: Rgb,
    /// True if both sides emit.
    pub two_sided: bool,
    /// Image of the radiance.
    pub image: Option<(PathBuf, Span)>,
    /// Total power (W) that replaces the scale, if positive.
    pub power: f32,
    /// Light group.
    pub group: Option<Arc<str>>,
    /// The directive.
    pub span: Span,
}

/// The use of a light's image.
#[derive(Clone, Copy, Debug)]
pub enum ImageUse {
    /// Radiance from all directions.
    Environment {
        /// Illuminance that replaces the radiance scale, if positive.
        illuminance: f32,
        /// The portal, if any.
        portal: Option<Portal>,
    },
    /// Factors of an intensity by direction.
    Goniometric {
        /// Radiant intensity.
        intensity: Rgb,
        /// Power that replaces the intensity scale, if positive.
        power: f32,
    },
    /// Intensities in a rectangle.
    Projection {
        /// Angle of view along the shorter side (degrees).
        fov: f32,
        /// Power that replaces the intensity scale, if positive.
        power: f32,
    },
}

/// A light that waits for its image.
#[derive(Clone, Debug)]
pub struct EnvironmentDesc {
    /// Image.
    pub path: PathBuf,
    /// Source position of the file name.
    pub span: Span,
    /// Use of the image.
    pub image_use: ImageUse,
    /// Position and orientation.
    pub world_from_light: Affine3A,
    /// Factor of the radiance, or of the intensity.
    pub scale: f32,
    /// Index among the lights.
    pub index: usize,
}

/// An object, defined by `ObjectBegin` … `ObjectEnd`.
#[derive(Clone, Debug)]
pub struct ObjectDesc {
    /// Source position of the name.
    pub span: Span,
    /// Instances of objects within, in its space.
    pub instances: Vec<InstanceDesc>,
}

/// An instance of an object.
#[derive(Clone, Debug)]
pub struct InstanceDesc {
    /// Index of the object.
    pub object: usize,
    /// Its transformation.
    pub ctm: Ctm,
    /// Source position of the instance.
    pub span: Span,
}

/// The source of a shape's numbers.
#[derive(Clone, Debug)]
pub enum ShapeSource {
    /// Triangles in the file itself.
    Mesh(MeshData),
    /// Triangles and patches in a PLY file.
    Ply(PathBuf),
    /// A control mesh that is subdivided `levels` times.
    Loop(MeshData, u32),
    /// A sphere, disk or cylinder.
    Quadric(QuadricKind),
    /// Bilinear patches.
    Bilinear(PatchData),
    /// Curves.
    Curves(CurveData),
}

impl ShapeSource {
    /// The file that holds it.
    pub(super) fn file(&self) -> Option<&Path> {
        match self {
            ShapeSource::Ply(path) => Some(path),
            ShapeSource::Mesh(_)
            | ShapeSource::Loop(..)
            | ShapeSource::Quadric(_)
            | ShapeSource::Bilinear(_)
            | ShapeSource::Curves(_) => None,
        }
    }
}

/// Arrays of a mesh of faces of N corners in object space.
#[derive(Clone, Debug, Default)]
pub struct FaceData<const N: usize> {
    /// Relative to `origin`.
    pub(super) positions: Vec<Vec3>,
    pub(super) origin: DVec3,
    pub(super) indices: Vec<[u32; N]>,
    pub(super) normals: Vec<Vec3>,
    /// Of triangles alone.
    pub(super) tangents: Vec<Vec3>,
    pub(super) uvs: Vec<Vec2>,
    /// Numbers of the faces.
    pub(super) faces: Vec<u32>,
}

/// Triangles.
pub type MeshData = FaceData<3>;

/// Bilinear patches.
pub type PatchData = FaceData<4>;

/// Curves in object space.
#[derive(Clone, Debug)]
pub struct CurveData {
    pub(super) kind: CurveKind,
    /// The origin of the points.
    pub(super) origin: DVec3,
    pub(super) curves: Vec<Curve>,
    /// Normals of ribbons, two for each curve.
    pub(super) normals: Vec<[Vec3; 2]>,
}

/// Displacement of a mesh along its normals.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DisplacementDesc {
    /// A float texture: the displacement, in units of the mesh.
    pub texture: FloatTextureId,
    /// Maximum edge of a triangle of the displaced mesh, in units of the scene.
    pub edge_length: f32,
}

/// A shape with its graphics state.
#[derive(Clone, Debug)]
pub struct ShapeDesc {
    /// Its numbers.
    pub source: ShapeSource,
    /// A readable name, shared by shapes that follow each other.
    pub name: Arc<str>,
    /// Source position.
    pub span: Span,
    /// Transform from object space to world space, or to the space of its object.
    pub ctm: Ctm,
    /// `ReverseOrientation`.
    pub reverse_orientation: bool,
    /// Material.
    pub material: MaterialUse,
    /// Emission.
    pub area_light: Option<Arc<AreaLightDesc>>,
    /// Alpha texture.
    pub alpha: Option<u32>,
    /// Displacement of the surface.
    pub displacement: Option<DisplacementDesc>,
    /// The object that it belongs to.
    pub object: Option<usize>,
    /// The media on its sides.
    pub media: Arc<MediumNames>,
}
