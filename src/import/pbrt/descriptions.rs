//! Descriptions of what a file asks for, kept until all of it and the files that it names are read.

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

/// A directive that is evaluated once all of them have been read: the camera needs the film's size.
pub(super) struct Pending {
    pub name: Name,
    pub params: ParamSet,
}

/// What the parameters of textures and materials mean something by.
#[derive(Clone, Copy)]
pub(super) struct ParamState {
    pub ctm: Ctm,
    pub color_space: ColorSpace,
}

/// A texture that is made once all of them are known.
pub(super) struct TextureDesc {
    pub name: Name,
    /// Of floats, or of spectra.
    pub is_float: bool,
    pub class: Name,
    pub params: ParamSet,
    pub state: ParamState,
}

/// A material that is made once all textures and the names of all materials are known.
pub(super) struct MaterialDesc {
    /// Its place among the materials.
    pub id: MaterialId,
    /// A name for people.
    pub name: String,
    pub kind: Name,
    pub params: ParamSet,
    pub state: ParamState,
}

/// A medium that is made once it is known where the space that is rendered has its origin.
pub(super) struct PendingMedium {
    /// Its place among the media.
    pub index: usize,
    pub params: ParamSet,
    pub state: ParamState,
}

/// A placement of an object that is not defined yet.
pub(super) struct LateInstance {
    pub name: Name,
    /// The object that it is in.
    pub holder: Option<usize>,
    pub ctm: Ctm,
    /// Of the directive.
    pub span: Span,
}

/// The material of a shape: known, or by a name that may be defined later.
#[derive(Clone, Debug)]
pub enum MaterialUse {
    /// Known.
    Id(MaterialId),
    /// By name.
    Named(Name),
}

/// Media on the two sides of a surface; `None` is empty space.
#[derive(Clone, Debug, Default)]
pub struct MediumNames {
    /// Behind the normal.
    pub inside: Option<Name>,
    /// Where the normal points to.
    pub outside: Option<Name>,
}

impl MaterialUse {
    /// True if both are the same material by the same way.
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
        let text = |names: &MediumNames| [&names.inside, &names.outside].map(|n| n.as_ref().map(|n| n.text.clone()));
        text(self) == text(other)
    }

    /// True if they are two.
    pub fn differ(&self) -> bool {
        let text = |name: &Option<Name>| name.as_ref().map(|name| name.text.clone());
        text(&self.inside) != text(&self.outside)
    }
}

/// A medium by its name.
#[derive(Clone, Debug)]
pub struct MediumDesc {
    /// Its name, and where it stands.
    pub name: Name,
    /// The medium; `None` after an error, and before its file is read.
    pub medium: Option<Medium>,
    /// What waits for a file.
    pub(super) volume: Option<VolumeDesc>,
}

/// A medium that waits for its file.
#[derive(Clone, Debug)]
pub(super) struct VolumeDesc {
    /// The file.
    pub(super) path: PathBuf,
    /// Where it is named.
    pub(super) span: Span,
    /// Name of the grid of densities, and where it stands.
    pub(super) density: (String, Span),
    /// The same of temperatures; no place if the text does not name it. `None` if nothing is to glow.
    pub(super) temperature: Option<(String, Option<Span>)>,
    /// What is subtracted from temperatures, and then their factor.
    pub(super) offset: f32,
    pub(super) scale: f32,
    /// Coefficients where the density is 1 (1/m).
    pub(super) sigma_a: Rgb,
    pub(super) sigma_s: Rgb,
    /// Factor of the emission.
    pub(super) le_scale: f32,
    pub(super) g: f32,
    /// From the space of the file.
    pub(super) placement: DAffine3,
}

/// What is behind the surface of a material.
#[derive(Clone, Copy, Debug)]
pub(super) struct Interior {
    pub(super) medium: Homogeneous,
    /// Light comes in and out by mirror-like refraction only.
    pub(super) is_smooth: bool,
    /// The material.
    pub(super) span: Span,
}

/// An area light as written; shapes that follow emit it.
#[derive(Clone, Debug)]
pub struct AreaLightDesc {
    /// Radiance with the scale.
    pub l: Rgb,
    /// Both sides.
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

/// What the image of a light means.
#[derive(Clone, Copy, Debug)]
pub enum ImageUse {
    /// Radiance from everywhere.
    Environment {
        /// Illuminance that replaces the brightness, if positive.
        illuminance: f32,
        /// What the light comes through.
        portal: Option<Portal>,
    },
    /// Factors of an intensity by direction.
    Goniometric {
        /// Radiant intensity.
        intensity: Rgb,
        /// Power that replaces the brightness, if positive.
        power: f32,
    },
    /// Intensities in a rectangle.
    Projection {
        /// Angle of view along the shorter side (degrees).
        fov: f32,
        /// Power that replaces the brightness, if positive.
        power: f32,
    },
}

/// A light that waits for its image.
#[derive(Clone, Debug)]
pub struct EnvironmentDesc {
    /// Image.
    pub path: PathBuf,
    /// Where it is named.
    pub span: Span,
    /// What it means.
    pub image_use: ImageUse,
    /// Place and orientation.
    pub world_from_light: Affine3A,
    /// Factor of the radiance, or of the intensity.
    pub scale: f32,
    /// Place among the lights.
    pub index: usize,
}

/// An object: what `ObjectBegin` … `ObjectEnd` define.
#[derive(Clone, Debug)]
pub struct ObjectDesc {
    /// Name.
    pub name: String,
    /// Where it is named.
    pub span: Span,
    /// Objects that it holds, placed in its space.
    pub instances: Vec<InstanceDesc>,
}

/// A placement of an object.
#[derive(Clone, Debug)]
pub struct InstanceDesc {
    /// Index of the object.
    pub object: usize,
    /// Its transformation.
    pub ctm: Ctm,
    /// Where it is placed.
    pub span: Span,
}

/// Where the numbers of a shape come from.
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
    /// Of ribbons, two for each curve.
    pub(super) normals: Vec<[Vec3; 2]>,
}

/// Displacement of a mesh along its normals.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DisplacementDesc {
    /// A float texture: how far, in the units of the mesh.
    pub texture: FloatTextureId,
    /// Longest edge of a triangle of the displaced mesh, in the units of the scene.
    pub edge_length: f32,
}

/// A shape with all that the graphics state gives it.
#[derive(Clone, Debug)]
pub struct ShapeDesc {
    /// Its numbers.
    pub source: ShapeSource,
    /// A name for people.
    pub name: String,
    /// Where it stands.
    pub span: Span,
    /// Transformation from its own space to that of the world, or of its object.
    pub ctm: Ctm,
    /// The point of the world that is the origin of the space which is rendered.
    pub origin: DVec3,
    /// `ReverseOrientation`.
    pub reverse_orientation: bool,
    /// Material.
    pub material: MaterialUse,
    /// Emission.
    pub area_light: Option<AreaLightDesc>,
    /// Cut-outs.
    pub alpha: Option<u32>,
    /// By how much the surface moves.
    pub displacement: Option<DisplacementDesc>,
    /// The object that it belongs to.
    pub object: Option<usize>,
    /// The media on its sides.
    pub media: MediumNames,
}
