//! Face lists and triangle strips.

use super::error::{Place, PlyError};
use super::header::{Element, Property, Scalar};
use super::mesh::PlyMesh;
use super::numbers::{ByteOrder, Numbers, number_at};
use super::stream::{MAX_FILL, Stream};
use super::wedges::{self, NONE};
use lumiris_numbers::math::{Vec2, Vec3};

/// The property with the number of a face.
const NUMBER: &str = "face_indices";
/// The list with u and v of each corner, and the property with the index of their texture.
const TEXCOORD: &str = "texcoord";
const TEXTURE: &str = "texnumber";
/// Properties of colours and textures that are supported.
pub(super) const READ: [&str; 2] = [TEXCOORD, TEXTURE];
/// Separates strips within a list.
const RESTART: i64 = -1;

/// Faces during reading.
#[derive(Default)]
pub(super) struct Faces {
    vertices: u64,
    triangles: FaceList<3>,
    quads: FaceList<4>,
    polygons: u64,
    degenerate: u64,
    /// Number of faces whose list of texture coordinates has a wrong length.
    odd_uvs: u64,
    /// Minimum and maximum texture index.
    textures: Option<[i64; 2]>,
}

/// A face as it is read.
#[derive(Clone, Copy)]
struct Polygon<'a> {
    /// Vertices.
    corners: &'a [u32],
    /// Texture coordinates of the corners, or empty.
    uvs: &'a [[f32; 2]],
}

/// Faces of `N` corners.
#[derive(Default)]
struct FaceList<const N: usize> {
    indices: Vec<[u32; N]>,
    /// Their face numbers, if the file has any.
    numbers: Vec<u32>,
    /// Texture coordinates of the corners, up to the last face that has any.
    uvs: Vec<[Vec2; N]>,
}

impl<const N: usize> FaceList<N> {
    /// Adds a face made of the corners `at` of a polygon, with its number.
    fn push(&mut self, polygon: Polygon<'_>, at: [usize; N], number: Option<u32>) {
        let Polygon { corners, uvs } = polygon;
        if !uvs.is_empty() {
            self.uvs.resize(self.indices.len(), [NONE; N]);
            self.uvs.push(at.map(|i| Vec2::from(uvs[i])));
        }
        self.indices.push(at.map(|i| corners[i]));
        self.numbers.extend(number);
    }
}

impl Faces {
    /// No faces yet, for a mesh with `vertices` vertices.
    pub(super) fn new(vertices: u64) -> Self {
        Faces { vertices, ..Faces::default() }
    }

    /// Reads a table of faces.
    pub(super) fn read<'a, N: Numbers<'a>>(&mut self, element: &Element, numbers: &mut N) -> Result<(), PlyError> {
        let Some(column) = element.indices() else {
            return numbers.skip_element(element);
        };
        let list = &element.properties[column];
        let triangle = N::size(list.list.unwrap_or(list.ty)) + 3 * N::size(list.ty);
        self.triangles.indices.reserve_exact(numbers.stream().trusted_items(element.count, triangle));
        let mut row = 0;
        while row < element.count {
            // Runs of triangles are read in blocks; other faces and layouts, face by face.
            row += match (N::ORDER, TriangleRows::of(element, column)) {
                (Some(ByteOrder::Little), Some(rows)) => {
                    self.read_run::<false>(rows, element.count - row, numbers.stream())?
                }
                (Some(ByteOrder::Big), Some(rows)) => {
                    self.read_run::<true>(rows, element.count - row, numbers.stream())?
                }
                (None, _) | (_, None) => 0,
            };
            let end = element.count.min(row + SLOW_RUN);
            self.read_rows(element, column, row..end, numbers)?;
            row = end;
        }
        Ok(())
    }

    /// Reads rows number by number.
    fn read_rows<'a>(
        &mut self,
        element: &Element,
        column: usize,
        rows: std::ops::Range<u64>,
        numbers: &mut impl Numbers<'a>,
    ) -> Result<(), PlyError> {
        let (mut corners, mut uvs) = (Vec::new(), Vec::new());
        let [number_column, texture_column] = [NUMBER, TEXTURE].map(|name| element.scalar(name));
        let uv_column = element.properties.iter().position(|p| p.list.is_some() && p.name == TEXCOORD);
        for row in rows {
            let mut number = None;
            for (i, property) in element.properties.iter().enumerate() {
                match property.list {
                    None if Some(i) == number_column => {
                        number = Some(numbers.integer(property.ty, &element.name)? as u32)
                    }
                    None if Some(i) == texture_column => {
                        let texture = numbers.integer(property.ty, &element.name)?;
                        let [least, most] = self.textures.unwrap_or([texture; 2]);
                        self.textures = Some([least.min(texture), most.max(texture)]);
                    }
                    Some(count_type) if Some(i) == uv_column => {
                        let count = numbers.list_length(count_type, property.ty, &element.name)?;
                        uvs.clear();
                        for _ in 0..count {
                            uvs.push(numbers.float(property.ty, &element.name)?);
                        }
                    }
                    Some(count_type) if i == column => {
                        let count = numbers.list_length(count_type, property.ty, &element.name)?;
                        corners.clear();
                        for _ in 0..count {
                            let place = numbers.place();
                            let index = numbers.integer(property.ty, &element.name)?;
                            corners.push(self.check(index, row, place)?);
                        }
                    }
                    Some(_) | None => numbers.skip_property(property, &element.name)?,
                }
            }
            self.push(&corners, &uvs, number);
        }
        Ok(())
    }

    /// Reads up to `left` triangles, until another face, an index out of range, or the end; returns their number.
    fn read_run<const BIG: bool>(
        &mut self,
        rows: TriangleRows,
        left: u64,
        stream: &mut Stream<'_>,
    ) -> Result<u64, PlyError> {
        let mut done = 0;
        loop {
            let available = stream.fill(rows.stride)?;
            let faces = available.chunks_exact(rows.stride).take(usize::try_from(left - done).unwrap_or(usize::MAX));
            let block = faces.take_while(|face| face[rows.offset] == 3).count();
            let before = self.triangles.indices.len();
            let mut largest = 0_u32;
            self.triangles.indices.extend(available[..block * rows.stride].chunks_exact(rows.stride).map(|face| {
                let face = &face[rows.offset..rows.offset + TriangleRows::LIST];
                let t = [number_at!(u32, BIG, face, 1), number_at!(u32, BIG, face, 5), number_at!(u32, BIG, face, 9)];
                largest = largest.max(t[0]).max(t[1]).max(t[2]);
                t
            }));
            if block == 0 || u64::from(largest) >= self.vertices {
                self.triangles.indices.truncate(before);
                return Ok(done);
            }
            if let Some(number) = rows.number {
                let faces = available[..block * rows.stride].chunks_exact(rows.stride);
                self.triangles.numbers.extend(faces.map(|face| number_at!(u32, BIG, face, number)));
            }
            stream.consume(block * rows.stride);
            done += block as u64;
        }
    }

    /// Adds the face with these vertices, which are in range, with u and v of each corner or without, and its number.
    fn push(&mut self, corners: &[u32], uvs: &[f32], number: Option<u32>) {
        let is_whole = uvs.len() == 2 * corners.len();
        self.odd_uvs += u64::from(!is_whole && !uvs.is_empty());
        let uvs = if is_whole { uvs.as_chunks::<2>().0 } else { &[] };
        let face = Polygon { corners, uvs };
        match corners.len() {
            0..3 => self.degenerate += 1,
            3 => self.triangles.push(face, [0, 1, 2], number),
            4 => self.quads.push(face, [0, 1, 2, 3], number),
            count => {
                self.polygons += 1;
                (1..count - 1).for_each(|i| self.triangles.push(face, [0, i, i + 1], number));
            }
        }
    }

    /// Reads a table of strips. The vertices a, b, c, d, e give the triangles abc, cbd, cde, all with the same
    /// orientation. Triangles that repeat a vertex only connect strips and are omitted.
    pub(super) fn read_strips<'a>(
        &mut self,
        element: &Element,
        numbers: &mut impl Numbers<'a>,
    ) -> Result<(), PlyError> {
        let Some(column) = element.indices() else {
            return numbers.skip_element(element);
        };
        for row in 0..element.count {
            for (i, property) in element.properties.iter().enumerate() {
                match property.list {
                    Some(count_type) if i == column => {
                        let count = numbers.list_length(count_type, property.ty, &element.name)?;
                        self.read_strip(count, property.ty, row, numbers)?;
                    }
                    Some(_) | None => numbers.skip_property(property, &element.name)?,
                }
            }
        }
        Ok(())
    }

    fn read_strip<'a>(
        &mut self,
        count: u64,
        ty: Scalar,
        row: u64,
        numbers: &mut impl Numbers<'a>,
    ) -> Result<(), PlyError> {
        let (mut a, mut b, mut length) = (0, 0, 0_u64);
        for _ in 0..count {
            let place = numbers.place();
            let index = numbers.integer(ty, "tristrips")?;
            if index == RESTART {
                length = 0;
                continue;
            }
            let c = self.check(index, row, place)?;
            if length >= 2 && a != b && b != c && c != a {
                self.triangles.indices.push(if length % 2 == 0 { [a, b, c] } else { [b, a, c] });
            }
            (a, b) = (b, c);
            length += 1;
        }
        Ok(())
    }

    #[inline]
    fn check(&self, index: i64, face: u64, place: Place) -> Result<u32, PlyError> {
        match u32::try_from(index) {
            Ok(i) if u64::from(i) < self.vertices => Ok(i),
            _ => Err(PlyError::IndexOutOfRange { place, face, index, vertices: self.vertices }),
        }
    }

    /// Moves all faces to the mesh, whose vertices are complete.
    pub(super) fn finish(mut self, mesh: &mut PlyMesh) {
        // Memory was reserved for one triangle per face.
        self.triangles.indices.shrink_to_fit();
        let has_uvs = !self.triangles.uvs.is_empty() || !self.quads.uvs.is_empty();
        mesh.triangles = self.triangles.indices;
        mesh.quads = self.quads.indices;
        if has_uvs {
            self.triangles.uvs.resize(mesh.triangles.len(), [NONE; 3]);
            self.quads.uvs.resize(mesh.quads.len(), [NONE; 4]);
            wedges::apply(mesh, &self.triangles.uvs, &self.quads.uvs);
        }
        // Strips have no numbers
        let all = |numbers: Vec<u32>, faces: usize| if numbers.len() == faces { numbers } else { Vec::new() };
        mesh.triangle_numbers = all(self.triangles.numbers, mesh.triangles.len());
        mesh.quad_numbers = all(self.quads.numbers, mesh.quads.len());
        if self.odd_uvs > 0 {
            let n = self.odd_uvs;
            mesh.warnings
                .push(format!("{n} faces have a `{TEXCOORD}` that is not two numbers for each corner; it is not used"));
        }
        if self.textures.is_some_and(|[least, most]| least < most) {
            let text = "faces have different textures (`texnumber`), but all of them get that of the material";
            mesh.warnings.push(text.to_owned());
        }
        if self.polygons > 0 {
            let n = self.polygons;
            mesh.warnings.push(format!("{n} faces have more than four vertices; each becomes a fan of triangles"));
        }
        if self.degenerate > 0 {
            mesh.warnings.push(format!("{} faces have less than three vertices and are left out", self.degenerate));
        }
        if mesh.triangles.is_empty() && mesh.quads.is_empty() {
            mesh.warnings.push("there are no faces".to_owned());
        }
        drop_broken_vertices(mesh, self.vertices as usize);
    }
}

/// Number of faces that are read one by one before trying another run of triangles.
const SLOW_RUN: u64 = 256;

/// Rows of fixed size, if they are triangles: one list `uchar, int`, and numbers before and after it.
#[derive(Clone, Copy)]
struct TriangleRows {
    /// Offset of the list in the row (bytes).
    offset: usize,
    /// Size of the row (bytes).
    stride: usize,
    /// Offset of the face number in the row, if there is one.
    number: Option<usize>,
}

impl TriangleRows {
    /// Bytes of the list: a length of one byte, three indices of four.
    const LIST: usize = 13;

    fn of(element: &Element, column: usize) -> Option<Self> {
        let list = &element.properties[column];
        let is_common = list.list == Some(Scalar::U8) && matches!(list.ty, Scalar::I32 | Scalar::U32);
        let others = element.properties.iter().filter(|p| p.list.is_some()).count();
        let offset = element.properties[..column].iter().map(|p| p.ty.size()).sum();
        let stride = element.min_stride() - 1 + Self::LIST;
        let number = element.scalar(NUMBER);
        let is_common =
            is_common && number.is_none_or(|i| matches!(element.properties[i].ty, Scalar::I32 | Scalar::U32));
        let bytes = |property: &Property| if property.list.is_some() { Self::LIST } else { property.ty.size() };
        let number = number.map(|i| element.properties[..i].iter().map(bytes).sum());
        let has_textures = element.scalar(TEXTURE).is_some();
        (is_common && others == 1 && !has_textures && stride <= MAX_FILL).then_some(TriangleRows {
            offset,
            stride,
            number,
        })
    }
}

/// Removes faces with non-finite vertices, and replaces such vertices by the origin. The first `vertices` come from the
/// file.
fn drop_broken_vertices(mesh: &mut PlyMesh, vertices: usize) {
    // A sum of products with zero is zero only if all are finite: one branchless pass handles the common case.
    let probe: f32 = mesh.positions.iter().map(|p| (p.x + p.y + p.z) * 0.0).sum();
    if probe == 0.0 {
        return;
    }
    let broken: Vec<bool> = mesh.positions.iter().map(|p| !p.is_finite()).collect();
    let count = broken.iter().take(vertices).filter(|&&b| b).count();
    if count == 0 {
        return;
    }
    let faces = mesh.triangles.len() + mesh.quads.len();
    retain_whole(&mut mesh.triangles, &mut mesh.triangle_numbers, &broken);
    retain_whole(&mut mesh.quads, &mut mesh.quad_numbers, &broken);
    mesh.positions.iter_mut().filter(|p| !p.is_finite()).for_each(|p| *p = Vec3::ZERO);
    let left_out = faces - mesh.triangles.len() - mesh.quads.len();
    mesh.warnings.push(format!("{count} vertices are not finite; {left_out} faces of them are left out"));
}

/// Removes faces with non-finite vertices, and their numbers.
fn retain_whole<const N: usize>(faces: &mut Vec<[u32; N]>, numbers: &mut Vec<u32>, broken: &[bool]) {
    let is_whole = |face: &[u32; N]| face.iter().all(|&v| !broken[v as usize]);
    let mut kept = faces.iter().map(is_whole);
    numbers.retain(|_| kept.next().unwrap_or(true));
    faces.retain(is_whole);
}
