//! `Shape`: checked during parsing, made after all files have been read.

use super::checks::{file_name, positive, unknown};
use super::curves::{curve_data, merged, placed};
use super::descriptions::{DisplacementDesc, FaceData, MeshData, PatchData, ShapeDesc, ShapeSource};
use super::state::Builder;
use super::transform::affine;
use crate::geometry::displacement::MAX_TRIANGLES;
use crate::geometry::loop_subdiv::loop_subdivide;
use crate::geometry::{BilinearMesh, DisplacedMesh, Quadric, QuadricKind, Shape, TriangleMesh};
use crate::textures::{FloatTexture, TextureContext, TextureSet};
use lumiris_formats::diagnostic::Diagnostics;
use lumiris_formats::names::file_in;
use lumiris_formats::pbrt::directive::Name;
use lumiris_formats::pbrt::params::{Input, ParamSet, ParamType};
use lumiris_formats::ply::{PlyError, PlyMesh};
use lumiris_formats::source::Span;
use lumiris_numbers::math::origin::{near_origin, rebased, relative};
use lumiris_numbers::math::transform::{swaps_handedness, transform_normal};
use lumiris_numbers::math::{Affine3A, DAffine3, DVec3, Vec2, Vec3};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// The result of making a shape.
#[derive(Debug, Default)]
pub struct Made {
    /// The shapes: a PLY file may hold triangles and patches.
    pub shapes: Vec<Shape>,
    /// Their origin: the origin of rendered space; in objects and for moving shapes, a point near the shapes.
    pub origin: DVec3,
    /// Warnings.
    pub warnings: Vec<String>,
}

/// Errors of shapes.
#[derive(Debug)]
pub enum ShapeError {
    /// Its file is missing.
    Missing(PathBuf, String),
    /// It is invalid.
    Wrong(String),
}

impl Builder<'_> {
    /// `Shape "kind"`
    pub fn shape(&mut self, kind: &Name, mut p: ParamSet, d: &mut Diagnostics) {
        let mut name = kind.text.clone();
        let source = match kind.text.as_str() {
            "sphere" | "disk" | "cylinder" => quadric(&kind.text, &p, d).map(ShapeSource::Quadric),
            "trianglemesh" => face_data(&mut p, d).map(ShapeSource::Mesh),
            "loopsubdiv" => {
                let levels = p.integer("levels", d).or_else(|| p.integer("nlevels", d)).unwrap_or(3);
                p.ignore("scheme");
                match levels {
                    0..=10 => face_data(&mut p, d).map(|m| ShapeSource::Loop(m, levels as u32)),
                    _ => {
                        d.error(p.span_of("levels"), format!("levels must be from 0 to 10, not {levels}"));
                        None
                    }
                }
            }
            "plymesh" => match file_name(&p, "filename", d) {
                Some(file) => {
                    name = file.to_owned();
                    let path = file_in(&self.folder, file);
                    Some(ShapeSource::Ply(path))
                }
                None => {
                    d.error(p.span, "a plymesh needs a `string filename`");
                    None
                }
            },
            "bilinearmesh" => {
                if p.ignore("emissionfilename") {
                    d.warning_once(
                        p.span_of("emissionfilename"),
                        "`emissionfilename` is not used yet: sampling is uniform",
                    );
                }
                face_data(&mut p, d).map(ShapeSource::Bilinear)
            }
            "curve" => curve_data(&p, d).map(ShapeSource::Curves),
            "hyperboloid" | "cone" | "paraboloid" | "heightfield" | "nurbs" => {
                d.warning_once(kind.span, format!("shape `{}` is not rendered yet: it is left out", kind.text));
                return;
            }
            other => {
                let known =
                    ["trianglemesh", "plymesh", "sphere", "disk", "cylinder", "bilinearmesh", "loopsubdiv", "curve"];
                unknown(other, kind.span, "shape", &known, d);
                return;
            }
        };

        // Alpha and displacement
        let alpha = self.alpha(&p, d);
        let is_mesh = source
            .as_ref()
            .is_some_and(|s| matches!(s, ShapeSource::Mesh(_) | ShapeSource::Ply(_) | ShapeSource::Loop(..)));
        let displacement = if is_mesh { self.displacement(&p, d) } else { None };
        p.report_unused(d);

        // Description; curves that differ only in their numbers are merged
        if let Some(source) = source.filter(|source| self.can_be_placed(source, &kind.text, p.span, d)) {
            let emits = self.state.area_light.is_some();
            let is_curve = matches!(source, ShapeSource::Curves(_));
            if is_curve && emits {
                d.warning_once(p.span, "curves do not emit: their area light is left out");
            }
            let desc = ShapeDesc {
                source,
                name,
                span: p.span,
                ctm: self.state.ctm,
                origin: self.origin,
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
            let (z_min, z_max) = (p.float("zmin", d).unwrap_or(-1.0), p.float("zmax", d).unwrap_or(1.0));
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

/// The vertices of a mesh, and their origin; `None` if they are missing, which makes other errors irrelevant.
fn positions(p: &mut ParamSet, d: &mut Diagnostics) -> Option<(Vec<Vec3>, DVec3)> {
    let positions = p.points("P", d).map(relative);
    if positions.is_none() {
        d.error(p.span, format!("{} needs `point3 P`", p.owner));
        p.ignore_all();
    }
    positions
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
    let (positions, origin) = positions(p, d)?;
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

impl ShapeDesc {
    /// True if it is the same where the instance of its object is. In objects, lights are dark, and media stay where they
    /// are defined; the width of curves and the mesh of displaced surfaces depend on the space of the object.
    pub fn can_leave_object(&self) -> bool {
        let is_curve = matches!(self.source, ShapeSource::Curves(_));
        !is_curve
            && !self.ctm.is_moving()
            && self.area_light.is_none()
            && self.displacement.is_none()
            && !self.media.differ()
    }

    /// The transform from coordinates relative to `origin` to the group: the current transform at the start, unless an
    /// instance does more than shift the shape.
    fn placement(&self, origin: DVec3) -> Placement {
        let m = if self.ctm.only_shifts() { affine(&self.ctm.start) } else { DAffine3::IDENTITY };
        let is_in_world = self.object.is_none() && self.ctm.only_shifts();
        let group_origin = if is_in_world { self.origin } else { near_origin(m.transform_point3(origin)) };
        // pbrt flips the orientation if the transform of the shape reflects, moving or not.
        let flip = self.reverse_orientation ^ swaps_handedness(&affine(&self.ctm.start).as_affine3a());
        Placement {
            group_from_object: rebased(&m, group_origin, origin).as_affine3a(),
            group_origin,
            textured_from_object: rebased(&m, self.origin, origin),
            flip,
            reverse: self.reverse_orientation,
        }
    }

    /// Makes the shapes in the space of their group; `mesh` reads a PLY file, `textures` evaluate displacements. Moves
    /// the arrays out of `self`.
    pub fn make(
        &mut self,
        mesh: &dyn Fn(&Path) -> Result<Arc<PlyMesh>, PlyError>,
        textures: &TextureSet,
    ) -> Result<Made, ShapeError> {
        let displacement = self.displacement;
        let finished = |data: MeshData, placement: &Placement| match &displacement {
            Some(displacement) => displaced(data, displacement, (placement, textures)).map_err(ShapeError::Wrong),
            None => Ok(data),
        };
        let source = std::mem::replace(&mut self.source, ShapeSource::Mesh(MeshData::default()));
        let wrong = |reason: String| ShapeError::Wrong(reason);
        let mut warnings = Vec::new();
        let mut shapes = Vec::new();
        let placement;
        match source {
            ShapeSource::Quadric(kind) => {
                placement = self.placement(DVec3::ZERO);
                let quadric = placed_quadric(kind, &placement.group_from_object)
                    .ok_or_else(|| wrong("the shape is flattened".to_owned()))?;
                shapes.push(Shape::Quadric(Quadric { flip_normal: placement.flip, ..quadric }));
            }
            ShapeSource::Mesh(data) => {
                placement = self.placement(data.origin);
                shapes.push(Shape::Mesh(triangles(finished(data, &placement)?, &placement).map_err(wrong)?));
            }
            ShapeSource::Loop(data, levels) => {
                let faces = data.indices.len() as u64 * 4_u64.saturating_pow(levels);
                if faces > 200_000_000 {
                    return Err(ShapeError::Wrong(format!(
                        "{levels} levels make {faces} triangles; at most 200 million are"
                    )));
                }
                placement = self.placement(data.origin);
                let mesh = loop_subdivide(levels, data.positions, data.indices).map_err(wrong)?;
                let fine = MeshData {
                    positions: mesh.positions().to_vec(),
                    normals: mesh.normals.clone(),
                    indices: mesh.indices,
                    ..MeshData::default()
                };
                shapes.push(Shape::Mesh(triangles(finished(fine, &placement)?, &placement).map_err(wrong)?));
            }
            ShapeSource::Curves(data) => {
                placement = self.placement(data.origin);
                shapes.push(Shape::Curves(placed(data, &placement.group_from_object).map_err(wrong)?));
            }
            ShapeSource::Bilinear(data) => {
                placement = self.placement(data.origin);
                shapes.push(patches(data, &placement).map_err(wrong)?);
            }
            ShapeSource::Ply(path) => {
                let ply = mesh(&path).map_err(|error| match error {
                    PlyError::Io { source, .. } => ShapeError::Missing(path.clone(), source.to_string()),
                    other => ShapeError::Wrong(format!("{}: {other}", path.display())),
                })?;
                let mut ply = Arc::unwrap_or_clone(ply);
                placement = self.placement(ply.origin);
                warnings = ply.warnings.iter().map(|w| format!("{}: {w}", path.display())).collect();
                if displacement.is_some() {
                    let halves = ply.quads.drain(..).flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]]);
                    ply.triangles.extend(halves);
                }
                if !ply.quads.is_empty() {
                    let data = PatchData {
                        positions: ply.positions.clone(),
                        // A patch has its corners row by row, a face in circular order.
                        indices: ply.quads.iter().map(|&[a, b, c, d]| [a, b, d, c]).collect(),
                        normals: ply.normals.clone(),
                        uvs: ply.uvs.clone(),
                        faces: std::mem::take(&mut ply.quad_numbers),
                        origin: ply.origin,
                        tangents: Vec::new(),
                    };
                    shapes.push(patches(data, &placement).map_err(wrong)?);
                }
                if !ply.triangles.is_empty() {
                    let data = MeshData {
                        positions: ply.positions,
                        indices: ply.triangles,
                        normals: ply.normals,
                        tangents: Vec::new(),
                        uvs: ply.uvs,
                        faces: ply.triangle_numbers,
                        origin: ply.origin,
                    };
                    shapes.push(Shape::Mesh(triangles(finished(data, &placement)?, &placement).map_err(wrong)?));
                }
            }
        }
        Ok(Made { shapes, origin: placement.group_origin, warnings })
    }
}

/// A transformed quadric; `None` if the transform flattens it, except for a disk along its axis.
pub(super) fn placed_quadric(kind: QuadricKind, m: &Affine3A) -> Option<Quadric> {
    let with = |kind, m: Affine3A| {
        let local_from_group = m.inverse();
        let flip_normal = swaps_handedness(&m);
        let quadric = Quadric { kind, group_from_local: m, local_from_group, flip_normal };
        (m.matrix3.determinant() != 0.0 && local_from_group.is_finite()).then_some(quadric)
    };
    let flat_disk = || {
        let QuadricKind::Disk { height, radius, inner_radius, phi_max } = kind else { return None };
        // The disk has no thickness: any third axis is valid
        let mut upright = *m;
        upright.matrix3.z_axis = m.matrix3.x_axis.cross(m.matrix3.y_axis).normalize_or_zero();
        upright.translation += m.matrix3.z_axis * height;
        with(QuadricKind::Disk { height: 0.0, radius, inner_radius, phi_max }, upright)
    };
    with(kind, *m).or_else(flat_disk)
}

fn place(points: &mut [Vec3], m: &Affine3A) {
    if *m != Affine3A::IDENTITY {
        points.iter_mut().for_each(|p| *p = m.transform_point3(*p));
    }
}

/// Transforms normals to group space; pbrt reverses them if `ReverseOrientation` is set.
fn place_normals(normals: &mut [Vec3], m: &Affine3A, reverse: bool) {
    let sign = if reverse { -1.0 } else { 1.0 };
    normals.iter_mut().for_each(|n| *n = transform_normal(m, *n) * sign);
}

/// The transforms of a shape.
struct Placement {
    group_from_object: Affine3A,
    group_origin: DVec3,
    /// To the space of position-dependent textures: rendered space, with moving shapes and shapes in objects at the
    /// position of their definition.
    textured_from_object: DAffine3,
    /// True if the geometric normal is reversed.
    flip: bool,
    /// `ReverseOrientation`, which reverses given normals as well.
    reverse: bool,
}

/// A mesh refined and displaced in its own space.
fn displaced(
    data: MeshData,
    displacement: &DisplacementDesc,
    (placement, textures): (&Placement, &TextureSet),
) -> Result<MeshData, String> {
    let mut mesh = DisplacedMesh::new(data.positions, data.normals, data.uvs, data.indices)?;
    let Placement { group_from_object, textured_from_object, .. } = placement;
    let length = |a: Vec3, b: Vec3| group_from_object.transform_vector3(a - b).length();
    mesh.refine(length, displacement.edge_length, MAX_TRIANGLES)?;
    mesh.displace(|p, n, uv| {
        let (p, n) = (textured_from_object.transform_point3(p.as_dvec3()), transform_normal(group_from_object, n));
        let point = TextureContext { uv, uv_width: Vec2::ZERO, uv1: Vec2::ZERO, color: [1.0; 4], face: 0, p, n };
        textures.float(displacement.texture, &point)
    });
    let DisplacedMesh { positions, normals, uvs, indices } = mesh;
    Ok(MeshData { positions, indices, normals, uvs, ..MeshData::default() })
}

fn triangles(mut data: MeshData, placement: &Placement) -> Result<TriangleMesh, String> {
    let m = &placement.group_from_object;
    place(&mut data.positions, m);
    place_normals(&mut data.normals, m, placement.reverse);
    data.tangents.iter_mut().for_each(|t| *t = m.transform_vector3(*t));
    let mut mesh = TriangleMesh::new(data.positions, data.indices)?;
    (mesh.normals, mesh.tangents, mesh.uvs, mesh.faces) = (data.normals, data.tangents, data.uvs, data.faces);
    mesh.flip_normal = placement.flip;
    Ok(mesh)
}

/// Maximum distance of a corner of a parallelogram from its position by the other three, relative to its edges.
const PARALLELOGRAM: f32 = 1e-6;

/// Two triangles for each patch, if all patches are parallelograms without normals. The surface and texture coordinates
/// are the same, and ray tracing is much faster.
fn parallelograms(data: &PatchData) -> Option<MeshData> {
    let corners = |c: &[u32; 4]| c.map(|i| data.positions[i as usize]);
    let is_flat = |c: &[u32; 4]| {
        let [a, b, c, d] = corners(c);
        (a + d - b - c).length() <= PARALLELOGRAM * ((b - a).length() + (c - a).length())
    };
    if !data.normals.is_empty() || !data.indices.iter().all(is_flat) {
        return None;
    }

    // Corners, with the default texture coordinates of patches
    let mut mesh = MeshData::default();
    for patch in &data.indices {
        let first = mesh.positions.len() as u32;
        mesh.positions.extend(corners(patch));
        mesh.uvs.extend((0..4).map(|i| match data.uvs.get(patch[i] as usize) {
            Some(&uv) => uv,
            None => Vec2::new((i % 2) as f32, (i / 2) as f32),
        }));
        mesh.indices.extend([[first, first + 1, first + 3], [first, first + 3, first + 2]]);
    }
    mesh.faces = data.faces.iter().flat_map(|&face| [face; 2]).collect();
    Some(mesh)
}

fn patches(mut data: PatchData, placement: &Placement) -> Result<Shape, String> {
    if let Some(mesh) = parallelograms(&data) {
        return triangles(mesh, placement).map(Shape::Mesh);
    }
    let m = &placement.group_from_object;
    place(&mut data.positions, m);
    place_normals(&mut data.normals, m, placement.reverse);
    Ok(Shape::Bilinear(BilinearMesh {
        positions: data.positions,
        indices: data.indices,
        normals: data.normals,
        uvs: data.uvs,
        faces: data.faces,
        flip_normal: placement.flip,
    }))
}
