//! The vertex table.

use super::error::PlyError;
use super::header::{Element, Scalar};
use super::mesh::PlyMesh;
use super::numbers::{ByteOrder, Numbers, double_at, number_at};
use super::stream::{MAX_FILL, Stream};
use lumiris_numbers::math::origin::{LocalPoints, near_origin, relative};
use lumiris_numbers::math::{DVec3, Vec2, Vec3};

/// Reads all vertices.
pub(super) fn read<'a, N: Numbers<'a>>(element: &Element, numbers: &mut N, mesh: &mut PlyMesh) -> Result<(), PlyError> {
    let Some(columns) = Columns::new(element) else {
        let line = element.line;
        return Err(PlyError::header(line, "vertices have no properties x, y and z"));
    };
    let row_size = element.properties.iter().map(|p| N::size(p.list.unwrap_or(p.ty))).sum();
    let count = numbers.stream().trusted_items(element.count, row_size);
    columns.reserve(count, mesh);
    let is_regular = !element.has_list() && element.min_stride() <= MAX_FILL;
    let mut doubles = Vec::new();
    let is_single = |&c: &usize| element.properties[c].ty == Scalar::F32;
    if N::ORDER.is_some() && is_regular && columns.position.iter().all(is_single) {
        mesh.positions.reserve_exact(count + 1);
    } else {
        doubles.reserve_exact(count);
    }
    match N::ORDER.filter(|_| is_regular) {
        Some(ByteOrder::Little) => read_blocks::<false>(element, &columns, numbers.stream(), (mesh, &mut doubles))?,
        Some(ByteOrder::Big) => read_blocks::<true>(element, &columns, numbers.stream(), (mesh, &mut doubles))?,
        None => read_rows(element, &columns, numbers, (mesh, &mut doubles))?,
    }
    if doubles.is_empty() {
        mesh.origin = mesh.positions.get(mesh.positions.len() / 2).map_or(DVec3::ZERO, |p| near_origin(p.as_dvec3()));
        if mesh.origin != DVec3::ZERO {
            mesh.positions.iter_mut().for_each(|p| *p = (p.as_dvec3() - mesh.origin).as_vec3());
        }
    } else {
        LocalPoints { points: mesh.positions, origin: mesh.origin } = relative(doubles.iter().copied());
    }
    // Usually a no-op; compressed files may exceed the reserved memory.
    mesh.positions.reserve_exact(1);
    Ok(())
}

/// Names of texture coordinates.
const UVS: [[&str; 2]; 4] = [["u", "v"], ["s", "t"], ["texture_u", "texture_v"], ["texture_s", "texture_t"]];

/// The names of the texture coordinates in a vertex table.
fn uvs_of(element: &Element) -> Option<[&'static str; 2]> {
    UVS.into_iter().find(|pair| pair.iter().all(|name| element.scalar(name).is_some()))
}

/// True if a vertex property is a texture coordinate.
pub(super) fn reads(element: &Element, name: &str) -> bool {
    uvs_of(element).is_some_and(|pair| pair.contains(&name))
}

/// A mesh, and its positions if they are not of single precision.
type Out<'m> = (&'m mut PlyMesh, &'m mut Vec<DVec3>);

/// The columns in use.
struct Columns {
    position: [usize; 3],
    normal: Option<[usize; 3]>,
    uv: Option<[usize; 2]>,
}

impl Columns {
    /// `None` without positions.
    fn new(element: &Element) -> Option<Self> {
        let three = |[x, y, z]: [&str; 3]| Some([element.scalar(x)?, element.scalar(y)?, element.scalar(z)?]);
        let uv = uvs_of(element).and_then(|[u, v]| Some([element.scalar(u)?, element.scalar(v)?]));
        Some(Columns { position: three(["x", "y", "z"])?, normal: three(["nx", "ny", "nz"]), uv })
    }

    fn reserve(&self, count: usize, mesh: &mut PlyMesh) {
        mesh.normals.reserve_exact(if self.normal.is_some() { count } else { 0 });
        mesh.uvs.reserve_exact(if self.uv.is_some() { count } else { 0 });
    }
}

/// Reads rows number by number.
fn read_rows<'a>(
    element: &Element,
    columns: &Columns,
    numbers: &mut impl Numbers<'a>,
    (mesh, positions): Out<'_>,
) -> Result<(), PlyError> {
    let mut row = vec![0.0; element.properties.len()];
    let mut position = [0.0; 3];
    for _ in 0..element.count {
        for (c, (value, property)) in row.iter_mut().zip(&element.properties).enumerate() {
            match (property.list, columns.position.iter().position(|&p| p == c)) {
                (None, Some(axis)) => position[axis] = numbers.double(property.ty, &element.name)?,
                (None, None) => *value = numbers.float(property.ty, &element.name)?,
                (Some(_), _) => numbers.skip_property(property, &element.name)?,
            }
        }
        positions.push(DVec3::from(position));
        mesh.normals.extend(columns.normal.map(|n| Vec3::from(n.map(|c| row[c]))));
        mesh.uvs.extend(columns.uv.map(|uv| Vec2::from(uv.map(|c| row[c]))));
    }
    Ok(())
}

/// Reads rows of fixed size in blocks: each number is read at its offset.
fn read_blocks<const BIG: bool>(
    element: &Element,
    columns: &Columns,
    stream: &mut Stream<'_>,
    (mesh, doubles): Out<'_>,
) -> Result<(), PlyError> {
    let stride = element.min_stride();
    let place = |c: usize| {
        let offset = element.properties[..c].iter().map(|p| p.ty.size()).sum::<usize>();
        (offset, element.properties[c].ty)
    };
    let position = columns.position.map(place);
    let normal = columns.normal.map(|n| n.map(place));
    let uv = columns.uv.map(|uv| uv.map(place));
    let is_single = |&(_, ty): &Place| ty == Scalar::F32;
    let others_are_single = normal.iter().flatten().chain(uv.iter().flatten()).all(is_single);
    let single = |row: &[u8], (at, _): Place| number_at!(f32, BIG, row, at);
    let any = |row: &[u8], (at, ty): Place| double_at::<BIG>(row, at, ty) as f32;

    let mut left = element.count;
    while left > 0 {
        let available = stream.require(stride, &element.name)?;
        let rows = (available.len() / stride).min(usize::try_from(left).unwrap_or(usize::MAX));
        let block = available[..rows * stride].chunks_exact(stride);
        if position.iter().all(is_single) {
            mesh.positions.extend(block.clone().map(|row| Vec3::from(position.map(|p| single(row, p)))));
        } else {
            let double = |row: &[u8], (at, ty): Place| double_at::<BIG>(row, at, ty);
            doubles.extend(block.clone().map(|row| DVec3::from(position.map(|p| double(row, p)))));
        }
        if others_are_single {
            pick(block, (normal, uv), single, mesh);
        } else {
            pick(block, (normal, uv), any, mesh);
        }
        stream.consume(rows * stride);
        left -= rows as u64;
    }
    Ok(())
}

/// Offset and type of a number.
type Place = (usize, Scalar);
/// Offsets of normals and texture coordinates.
type Places = (Option<[Place; 3]>, Option<[Place; 2]>);

#[inline]
fn pick<'a>(
    block: impl Iterator<Item = &'a [u8]> + Clone,
    (normal, uv): Places,
    read: impl Fn(&[u8], Place) -> f32 + Copy,
    mesh: &mut PlyMesh,
) {
    if let Some(normal) = normal {
        mesh.normals.extend(block.clone().map(|row| Vec3::from(normal.map(|p| read(row, p)))));
    }
    if let Some(uv) = uv {
        mesh.uvs.extend(block.map(|row| Vec2::from(uv.map(|p| read(row, p)))));
    }
}
