//! The directives of a pbrt file, syntactically valid.

use super::params::ParamSet;
use crate::source::Span;

/// A string argument, or the value of an option, and its source position.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Name {
    /// The string, without quotes.
    pub text: String,
    /// Source position.
    pub span: Span,
}

/// The time samples of the current transform that a transform directive changes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ActiveTimes {
    /// The first.
    Start,
    /// The last.
    End,
    /// Both.
    All,
}

/// The target of the default parameters of `Attribute`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AttributeTarget {
    /// Shapes.
    Shape,
    /// Lights and area lights.
    Light,
    /// Materials.
    Material,
    /// Media.
    Medium,
    /// Textures.
    Texture,
}

/// A directive without its parameter list. Matrices are in file order, column by column for `to_from · point`, and have
/// the last row 0 0 0 1.
#[derive(Clone, Debug, PartialEq)]
#[allow(missing_docs, reason = "the variants are pbrt's directives")]
pub enum DirectiveKind {
    Identity,
    Translate([f64; 3]),
    Scale([f64; 3]),
    Rotate([f64; 4]),
    LookAt([f64; 9]),
    Transform([f64; 16]),
    ConcatTransform([f64; 16]),
    CoordinateSystem(Name),
    CoordSysTransform(Name),
    ActiveTransform(ActiveTimes),
    TransformTimes([f32; 2]),
    AttributeBegin,
    AttributeEnd,
    Attribute(AttributeTarget),
    Option { name: Name, value: Name },
    ColorSpace(Name),
    Camera(Name),
    Film(Name),
    Sampler(Name),
    Integrator(Name),
    PixelFilter(Name),
    Accelerator(Name),
    MakeNamedMedium(Name),
    MediumInterface { inside: Name, outside: Name },
    WorldBegin,
    WorldEnd,
    ReverseOrientation,
    Material(Name),
    MakeNamedMaterial(Name),
    NamedMaterial(Name),
    Texture { name: Name, value: Name, class: Name },
    LightSource(Name),
    AreaLightSource(Name),
    Shape(Name),
    ObjectBegin(Name),
    ObjectEnd,
    ObjectInstance(Name),
}

/// A directive.
#[derive(Clone, Debug)]
pub struct Directive {
    /// The directive with its arguments.
    pub kind: DirectiveKind,
    /// Its keyword.
    pub span: Span,
    /// Its parameters; empty for directives that take none.
    pub params: ParamSet,
}

/// All keywords, for suggestions and for finding the next directive after an error.
pub const KEYWORDS: &[&str] = &[
    "Accelerator",
    "ActiveTransform",
    "AreaLightSource",
    "Attribute",
    "AttributeBegin",
    "AttributeEnd",
    "Camera",
    "ColorSpace",
    "ConcatTransform",
    "CoordSysTransform",
    "CoordinateSystem",
    "Film",
    "Identity",
    "Import",
    "Include",
    "Integrator",
    "LightSource",
    "LookAt",
    "MakeNamedMaterial",
    "MakeNamedMedium",
    "Material",
    "MediumInterface",
    "NamedMaterial",
    "ObjectBegin",
    "ObjectEnd",
    "ObjectInstance",
    "Option",
    "PixelFilter",
    "ReverseOrientation",
    "Rotate",
    "Sampler",
    "Scale",
    "Shape",
    "Texture",
    "Transform",
    "TransformBegin",
    "TransformEnd",
    "TransformTimes",
    "Translate",
    "WorldBegin",
    "WorldEnd",
];
