//! Selection of the vertices of a primitive.

use lumiris_formats::gltf::{Document, GltfError, Place};

/// The vertices of a primitive that its triangles use. Primitives may share accessors with more vertices; each loads
/// only its own.
pub(super) struct InUse {
    /// Number of vertices in the file.
    count: usize,
    /// Vertices in use, ascending; `None` for all.
    vertices: Option<Vec<u32>>,
}

/// Maximum ratio of vertices to triangle corners for loading all vertices.
const SPARSE: usize = 4;

impl InUse {
    /// Selects the vertices of triangles, whose indices are replaced by indices into the selection.
    pub(super) fn of(count: usize, triangles: &mut [[u32; 3]], place: &Place<'_>) -> Result<Self, GltfError> {
        if let Some((i, t)) = triangles.iter().enumerate().find(|(_, t)| t.iter().any(|&v| v as usize >= count)) {
            let message = format!("triangle {i} refers to vertices {t:?}, but there are {count} vertices");
            return Err(place.error(message));
        }
        if 3 * triangles.len() * SPARSE >= count {
            return Ok(InUse { count, vertices: None });
        }
        let mut vertices = triangles.as_flattened().to_vec();
        vertices.sort_unstable();
        vertices.dedup();
        for v in triangles.as_flattened_mut() {
            *v = vertices.partition_point(|used| used < v) as u32;
        }
        Ok(InUse { count, vertices: Some(vertices) })
    }

    /// The index in the file of a selected vertex.
    pub(super) fn vertex(&self, index: usize) -> usize {
        self.vertices.as_ref().map_or(index, |vertices| vertices[index] as usize)
    }

    /// Elements of an attribute, one per selected vertex; empty if the attribute is absent.
    pub(super) fn read<const N: usize>(
        &self,
        document: &Document,
        place: &Place<'_>,
        fill: f32,
    ) -> Result<Vec<[f32; N]>, GltfError> {
        let Some(index) = place.index() else { return Ok(Vec::new()) };
        let accessor = document.open(index)?;
        if accessor.count() != self.count {
            return Err(place.error("has not one element per vertex"));
        }

        // Elements of the vertices in use
        let numbers = match &self.vertices {
            Some(vertices) => accessor.numbers(vertices.iter().map(|&v| v as usize)),
            None => accessor.numbers(0..self.count),
        };
        let elements = numbers.elements::<N>(fill);
        match elements.iter().position(|e| e.iter().any(|x| !x.is_finite())) {
            Some(i) => Err(place.error(format!("vertex {} is not finite", self.vertex(i)))),
            None => Ok(elements),
        }
    }
}
