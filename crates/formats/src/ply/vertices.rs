//! The vertex table.

use super::header::{Element, Scalar};
use super::numbers::{ByteOrder, Numbers, float_at, number_at};
use super::stream::{MAX_FILL, Stream};
use super::{PlyError, PlyMesh};
use lumiris_numbers::math::{Vec2, Vec3};

/// Reads all vertices.
pub(super) fn read<'a, N: Numbers<'a>>(element: &Element, numbers: &mut N, mesh: &mut PlyMesh) -> Result<(), PlyError> {
    let Some(columns) = Columns::new(element) else {
        let line = element.line;
        return Err(PlyError::header(line, "vertices have no properties x, y and z"));
    };
    let row_size = element.properties.iter().map(|p| N::size(p.list.unwrap_or(p.ty))).sum();
    columns.reserve(numbers.stream().trusted_items(element.count, row_size), mesh);
    let is_regular = !element.has_list() && element.min_stride() <= MAX_FILL;
    match N::ORDER.filter(|_| is_regular) {
        Some(ByteOrder::Little) => read_blocks::<false>(element, &columns, numbers.stream(), mesh)?,
        Some(ByteOrder::Big) => read_blocks::<true>(element, &columns, numbers.stream(), mesh)?,
        None => read_rows(element, &columns, numbers, mesh)?,
    }
    // Usually a no-op; compressed files may hold more than memory was taken for.
    mesh.positions.reserve_exact(1);
    Ok(())
}

/// Names of texture coordinates.
const UVS: [[&str; 2]; 4] = [["u", "v"], ["s", "t"], ["texture_u", "texture_v"], ["texture_s", "texture_t"]];

/// The texture coordinates that a table of vertices has.
fn uvs_of(element: &Element) -> Option<[&'static str; 2]> {
    UVS.into_iter().find(|pair| pair.iter().all(|name| element.scalar(name).is_some()))
}

/// True if a property of vertices is their texture coordinates.
pub(super) fn reads(element: &Element, name: &str) -> bool {
    uvs_of(element).is_some_and(|pair| pair.contains(&name))
}

/// Which columns are used.
struct Columns {
    position: [usize; 3],
    normal: Option<[usize; 3]>,
    uv: Option<[usize; 2]>,
}

impl Columns {
    /// `None` if there are no positions.
    fn new(element: &Element) -> Option<Self> {
        let three = |[x, y, z]: [&str; 3]| Some([element.scalar(x)?, element.scalar(y)?, element.scalar(z)?]);
        let uv = uvs_of(element).and_then(|[u, v]| Some([element.scalar(u)?, element.scalar(v)?]));
        Some(Columns { position: three(["x", "y", "z"])?, normal: three(["nx", "ny", "nz"]), uv })
    }

    fn reserve(&self, count: usize, mesh: &mut PlyMesh) {
        mesh.positions.reserve_exact(count + 1);
        mesh.normals.reserve_exact(if self.normal.is_some() { count } else { 0 });
        mesh.uvs.reserve_exact(if self.uv.is_some() { count } else { 0 });
    }
}

/// Rows number by number.
fn read_rows<'a>(
    element: &Element,
    columns: &Columns,
    numbers: &mut impl Numbers<'a>,
    mesh: &mut PlyMesh,
) -> Result<(), PlyError> {
    let mut row = vec![0.0; element.properties.len()];
    for _ in 0..element.count {
        for (value, property) in row.iter_mut().zip(&element.properties) {
            match property.list {
                None => *value = numbers.float(property.ty, &element.name)?,
                Some(_) => numbers.skip_property(property, &element.name)?,
            }
        }
        mesh.positions.push(Vec3::from(columns.position.map(|c| row[c])));
        mesh.normals.extend(columns.normal.map(|n| Vec3::from(n.map(|c| row[c]))));
        mesh.uvs.extend(columns.uv.map(|uv| Vec2::from(uv.map(|c| row[c]))));
    }
    Ok(())
}

/// Rows of fixed size in blocks: each wanted number is picked at its offset.
fn read_blocks<const BIG: bool>(
    element: &Element,
    columns: &Columns,
    stream: &mut Stream<'_>,
    mesh: &mut PlyMesh,
) -> Result<(), PlyError> {
    let stride = element.min_stride();
    let place = |c: usize| {
        let offset = element.properties[..c].iter().map(|p| p.ty.size()).sum::<usize>();
        (offset, element.properties[c].ty)
    };
    let position = columns.position.map(place);
    let normal = columns.normal.map(|n| n.map(place));
    let uv = columns.uv.map(|uv| uv.map(place));
    let mut used = position.iter().chain(normal.iter().flatten()).chain(uv.iter().flatten());
    let all_f32 = used.all(|&(_, ty)| ty == Scalar::F32);

    let mut left = element.count;
    while left > 0 {
        let available = stream.require(stride, &element.name)?;
        let rows = (available.len() / stride).min(usize::try_from(left).unwrap_or(usize::MAX));
        let block = available[..rows * stride].chunks_exact(stride);
        if all_f32 {
            pick(block, (position, normal, uv), |row, (at, _)| number_at!(f32, BIG, row, at), mesh);
        } else {
            pick(block, (position, normal, uv), |row, (at, ty)| float_at::<BIG>(row, at, ty), mesh);
        }
        stream.consume(rows * stride);
        left -= rows as u64;
    }
    Ok(())
}

/// Offset and type of a number.
type Place = (usize, Scalar);
/// Of positions, normals and texture coordinates.
type Places = ([Place; 3], Option<[Place; 3]>, Option<[Place; 2]>);

#[inline]
fn pick<'a>(
    block: impl Iterator<Item = &'a [u8]> + Clone,
    (position, normal, uv): Places,
    read: impl Fn(&[u8], Place) -> f32 + Copy,
    mesh: &mut PlyMesh,
) {
    mesh.positions.extend(block.clone().map(|row| Vec3::from(position.map(|p| read(row, p)))));
    if let Some(normal) = normal {
        mesh.normals.extend(block.clone().map(|row| Vec3::from(normal.map(|p| read(row, p)))));
    }
    if let Some(uv) = uv {
        mesh.uvs.extend(block.map(|row| Vec2::from(uv.map(|p| read(row, p)))));
    }
}
