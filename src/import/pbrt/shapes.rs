//! `Shape`: checked during parsing, made later (`make_shapes`).

use super::checks::{file_name, positive, unknown};
use super::curves::{curve_data, merged};
use super::descriptions::{DisplacementDesc, FaceData, ShapeDesc, ShapeSource};
use super::make_shapes::placed_quadric;
use super::state::Builder;
use super::transform::affine;
use crate::geometry::QuadricKind;
use crate::textures::FloatTexture;
use lumiris_formats::diagnostic::Diagnostics;
use lumiris_formats::names::file_in;
use lumiris_formats::pbrt::directive::Name;
use lumiris_formats::pbrt::params::{Input, ParamSet, ParamType};
use lumiris_formats::source::Span;
use lumiris_numbers::math::origin::{LocalPoints, relative};
use lumiris_numbers::math::{Vec2, Vec3};
use std::sync::Arc;

/// Shapes that are rendered.
const KINDS: [&str; 8] =
    ["trianglemesh", "plymesh", "sphere", "disk", "cylinder", "bilinearmesh", "loopsubdiv", "curve"];

impl Builder<'_> {
    /// `Shape "kind"`
    pub fn shape(&mut self, kind: &Name, mut p: ParamSet, d: &mut Diagnostics) {
        if ["hyperboloid", "cone", "paraboloid", "heightfield", "nurbs"].contains(&kind.text.as_str()) {
            d.warning_once(kind.span, format!("shape `{}` is not rendered yet: it is left out", kind.text));
            return;
        }
        if !KINDS.contains(&kind.text.as_str()) {
            unknown(&kind.text, kind.span, "shape", &KINDS, d);
            return;
        }

        // Parameters
        let source = self.source(&kind.text, &mut p, d);
        let alpha = self.alpha(&p, d);
        let displacement = match &source {
            Some(ShapeSource::Mesh(_) | ShapeSource::Ply(_) | ShapeSource::Loop(..)) => self.displacement(&p, d),
            _ => None,
        };
        p.report_unused(d);
        let Some(source) = source.filter(|source| self.can_be_placed(source, &kind.text, p.span, d)) else { return };

        // Description; curves that differ only in their numbers are merged
        let is_curve = matches!(source, ShapeSource::Curves(_));
        if is_curve && self.state.area_light.is_some() {
            d.warning_once(p.span, "curves do not emit: their area light is left out");
        }
        let desc = ShapeDesc {
            source,
            name: self.shape_name(kind, &p, d),
            span: p.span,
            ctm: self.state.ctm.clone(),
            reverse_orientation: self.state.reverse_orientation,
            material: self.state.material.clone(),
            area_light: self.state.area_light.clone().filter(|_| !is_curve),
            alpha,
            displacement,
            object: self.current_object,
            media: self.state.media.clone(),
        };
        let rest = if is_curve { merged(self.shapes.last_mut(), desc) } else { Some(desc) };
        self.shapes.extend(rest);
    }

    /// The numbers of a shape, or their file; `None` after an error.
    fn source(&self, kind: &str, p: &mut ParamSet, d: &mut Diagnostics) -> Option<ShapeSource> {
        match kind {
            "trianglemesh" => face_data(p, d).map(ShapeSource::Mesh),
            "loopsubdiv" => control_mesh(p, d),
            "plymesh" => match file_name(p, "filename", d) {
                Some(file) => Some(ShapeSource::Ply(file_in(&self.folder, file))),
                None => {
                    d.error(p.span, "a plymesh needs a `string filename`");
                    None
                }
            },
            "bilinearmesh" => {
                if p.ignore("emissionfilename") {
                    let message = "`emissionfilename` is not used yet: sampling is uniform";
                    d.warning_once(p.span_of("emissionfilename"), message);
                }
                face_data(p, d).map(ShapeSource::Bilinear)
            }
            "curve" => curve_data(p, d).map(ShapeSource::Curves),
            quadric_kind => quadric(quadric_kind, p, d).map(ShapeSource::Quadric),
        }
    }

    /// A readable name: the file of a mesh, or the kind.
    fn shape_name(&self, kind: &Name, p: &ParamSet, d: &mut Diagnostics) -> Arc<str> {
        let file = if kind.text == "plymesh" { file_name(p, "filename", d) } else { None };
        let name = file.unwrap_or(&kind.text);
        match self.shapes.last() {
            Some(last) if *last.name == *name => Arc::clone(&last.name),
            _ => Arc::from(name),
        }
    }

    /// Checks that the current transform is valid for a shape; reports an error if it flattens a shape that cannot be
    /// flat.
    fn can_be_placed(&self, source: &ShapeSource, kind: &str, span: Span, d: &mut Diagnostics) -> bool {
        match source {
            _ if self.state.ctm.is_moving() => self.has_inverse(&format!("a moving {kind}"), span, d),
            ShapeSource::Quadric(quadric)
                if placed_quadric(*quadric, &affine(&self.state.ctm.start).as_affine3a()).is_some() =>
            {
                true
            }
            ShapeSource::Quadric(_) | ShapeSource::Curves(_) => self.has_inverse(&format!("a {kind}"), span, d),
            ShapeSource::Mesh(_) | ShapeSource::Ply(_) | ShapeSource::Loop(..) | ShapeSource::Bilinear(_) => true,
        }
    }

    /// `"texture displacement"` of a mesh, which may be refined to edges of `"float edgelength"`.
    fn displacement(&mut self, p: &ParamSet, d: &mut Diagnostics) -> Option<DisplacementDesc> {
        let edge_length = positive(p, "edgelength", 1.0, d);
        let Input::Texture(name) = p.float_input("displacement", d)? else {
            d.error(p.span_of("displacement"), "displacement is a texture");
            return None;
        };
        let texture = self.late_float_texture(name, p.span_of("displacement"));
        Some(DisplacementDesc { texture, edge_length: edge_length * self.options.edge_scale() })
    }

    /// The alpha texture; `None` for opaque shapes.
    fn alpha(&mut self, p: &ParamSet, d: &mut Diagnostics) -> Option<u32> {
        if p.ignore("shadowalpha") {
            d.warning_once(p.span_of("shadowalpha"), "`shadowalpha` is pbrt-v3: `alpha` holds for shadows as well");
        }
        match p.float_input("alpha", d)? {
            Input::Value(alpha) if alpha >= 1.0 => None,
            Input::Value(alpha) => Some(self.textures.add_float(FloatTexture::Constant(alpha))),
            Input::Texture(texture) => Some(self.late_float_texture(texture, p.span_of("alpha"))),
        }
    }
}

/// The control mesh of a `loopsubdiv`, and its levels.
fn control_mesh(p: &mut ParamSet, d: &mut Diagnostics) -> Option<ShapeSource> {
    let levels = p.integer("levels", d).or_else(|| p.integer("nlevels", d)).unwrap_or(3);
    p.ignore("scheme");
    match levels {
        0..=10 => face_data(p, d).map(|mesh| ShapeSource::Loop(mesh, levels as u32)),
        _ => {
            d.error(p.span_of("levels"), format!("levels must be from 0 to 10, not {levels}"));
            None
        }
    }
}

fn quadric(kind: &str, p: &ParamSet, d: &mut Diagnostics) -> Option<QuadricKind> {
    let radius = p.float("radius", d).unwrap_or(1.0);
    let phi = p.float("phimax", d).unwrap_or(360.0);
    if !(radius > 0.0 && radius.is_finite()) {
        d.error(p.span_of("radius"), format!("radius must be positive, not {radius}"));
        return None;
    }
    if !(phi > 0.0 && phi <= 360.0) {
        d.error(p.span_of("phimax"), format!("phimax must be above 0 and at most 360 degrees, not {phi}"));
        return None;
    }

    // Ranges of each shape
    let phi_max = phi.to_radians();
    match kind {
        "disk" => {
            let height = p.float("height", d).unwrap_or(0.0);
            let inner_radius = p.float("innerradius", d).unwrap_or(0.0);
            if !(inner_radius >= 0.0 && inner_radius < radius && height.is_finite()) {
                d.error(p.span_of("innerradius"), "innerradius must be at least 0 and below radius");
                return None;
            }
            Some(QuadricKind::Disk { height, radius, inner_radius, phi_max })
        }
        "sphere" => {
            let ends = [p.float("zmin", d).unwrap_or(-radius), p.float("zmax", d).unwrap_or(radius)];
            let [z_min, z_max] = ends.map(|z| z.clamp(-radius, radius));
            (z_min < z_max).then_some(QuadricKind::Sphere { radius, z_min, z_max, phi_max }).or_else(|| {
                d.error(p.span_of("zmin"), "zmin must be below zmax");
                None
            })
        }
        _ => {
            let z_min = p.float("zmin", d).unwrap_or(-1.0);
            let z_max = p.float("zmax", d).unwrap_or(1.0);
            let (z_min, z_max) = (z_min.min(z_max), z_min.max(z_max));
            if !(z_min < z_max && z_min.is_finite() && z_max.is_finite()) {
                d.error(p.span_of("zmin"), "a cylinder needs two different finite ends");
                return None;
            }
            Some(QuadricKind::Cylinder { radius, z_min, z_max, phi_max })
        }
    }
}

const VECTORS: &[ParamType] = &[ParamType::Vector3];
const NORMALS: &[ParamType] = &[ParamType::Normal];
const UVS: &[ParamType] = &[ParamType::Point2, ParamType::Float];

fn vec3s(p: &mut ParamSet, name: &'static str, types: &[ParamType], d: &mut Diagnostics) -> Option<Vec<Vec3>> {
    let floats = p.take_floats(name, types, d)?;
    Some(floats.chunks_exact(3).map(Vec3::from_slice).collect())
}

/// Texture coordinates, with any of their names.
fn uvs(p: &mut ParamSet, d: &mut Diagnostics) -> Vec<Vec2> {
    let floats = p.take_floats("uv", UVS, d).or_else(|| p.take_floats("st", UVS, d)).unwrap_or_default();
    floats.chunks_exact(2).map(Vec2::from_slice).collect()
}

/// An array that must have the length of the positions or be absent; others are ignored, as in pbrt.
fn per_vertex<T>(values: Vec<T>, count: usize, name: &'static str, p: &ParamSet, d: &mut Diagnostics) -> Vec<T> {
    if values.is_empty() || values.len() == count {
        return values;
    }
    let message = format!("`{name}` has {} entries, but there are {count} vertices: it is left out", values.len());
    d.warning_once(p.span_of(name), message);
    Vec::new()
}

/// Vertices of the faces; as in pbrt, surplus indices are ignored.
fn indices<const N: usize>(p: &mut ParamSet, count: usize, d: &mut Diagnostics) -> Option<Vec<[u32; N]>> {
    let Some(mut values) = p.take_integers("indices", d).filter(|values| !values.is_empty()) else {
        if count == N {
            return Some(vec![std::array::from_fn(|i| i as u32)]);
        }
        d.error(p.span, format!("{} needs `integer indices`: it has {count} vertices", p.owner));
        return None;
    };

    // Surplus indices
    let surplus = values.len() % N;
    if surplus != 0 {
        let whole = values.len() - surplus;
        let message =
            format!("the number of indices must be a multiple of {N}, not {}: {surplus} are left out", values.len());
        d.warning_once(p.span_of("indices"), message);
        values.truncate(whole);
    }
    if let Some(bad) = values.iter().find(|&&i| i < 0 || i as usize >= count) {
        d.error(p.span_of("indices"), format!("index {bad} is out of range: there are {count} vertices"));
        return None;
    }
    Some(values.chunks_exact(N).map(|c| std::array::from_fn(|i| c[i] as u32)).collect())
}

/// Face numbers, for textures of faces; as in pbrt, invalid ones are ignored.
fn face_numbers(p: &mut ParamSet, count: usize, d: &mut Diagnostics) -> Vec<u32> {
    let numbers = p.take_integers("faceIndices", d).unwrap_or_default();
    if !(numbers.is_empty() || numbers.len() == count) || numbers.iter().any(|&n| n < 0) {
        let message = format!(
            "faceIndices must be {count} numbers, one for each face, none of which is negative: they are left out"
        );
        d.warning_once(p.span_of("faceIndices"), message);
        return Vec::new();
    }
    numbers.into_iter().map(|n| n as u32).collect()
}

fn face_data<const N: usize>(p: &mut ParamSet, d: &mut Diagnostics) -> Option<FaceData<N>> {
    let Some(LocalPoints { points: positions, origin }) = p.points("P", d).map(relative) else {
        d.error(p.span, format!("{} needs `point3 P`", p.owner));
        // Other errors are irrelevant without vertices
        p.ignore_all();
        return None;
    };
    let count = positions.len();
    let normals = vec3s(p, "N", NORMALS, d).unwrap_or_default();
    let tangents = if N == 3 { vec3s(p, "S", VECTORS, d).unwrap_or_default() } else { Vec::new() };
    let uvs = uvs(p, d);
    let indices = indices(p, count, d)?;
    let faces = face_numbers(p, indices.len(), d);
    Some(FaceData {
        faces,
        indices,
        normals: per_vertex(normals, count, "N", p, d),
        tangents: per_vertex(tangents, count, "S", p, d),
        uvs: per_vertex(uvs, count, "uv", p, d),
        positions,
        origin,
    })
}
