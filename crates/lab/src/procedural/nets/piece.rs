//! The largest connected component of a mesh: carving leaves fragments above the surface and bubbles below it.

use lumiris::geometry::TriangleMesh;

/// The representative of the set of `v`, with path halving.
fn find(parents: &mut [u32], mut v: u32) -> u32 {
    while parents[v as usize] != v {
        let next = parents[parents[v as usize] as usize];
        parents[v as usize] = next;
        v = next;
    }
    v
}

/// The component with the most triangles (the first one if several are equal), with vertices in the same order.
pub fn largest_piece(mesh: &TriangleMesh) -> Result<TriangleMesh, String> {
    // Union of the vertices of each triangle; the first vertex of a component represents it
    let count = mesh.positions().len();
    let mut parents: Vec<u32> = (0..count as u32).collect();
    for &[a, b, c] in &mesh.indices {
        for other in [b, c] {
            let (x, y) = (find(&mut parents, a), find(&mut parents, other));
            parents[x.max(y) as usize] = x.min(y);
        }
    }
    let mut sizes = vec![0_u32; count];
    for t in &mesh.indices {
        sizes[find(&mut parents, t[0]) as usize] += 1;
    }
    let Some(largest) = (0..count).rev().max_by_key(|&v| sizes[v]) else { return Ok(mesh.clone()) };

    // Renumber its vertices
    let kept: Vec<usize> = (0..count).filter(|&v| find(&mut parents, v as u32) as usize == largest).collect();
    let mut numbers = vec![u32::MAX; count];
    for (number, &v) in kept.iter().enumerate() {
        numbers[v] = number as u32;
    }
    let triangles = mesh.indices.iter().filter(|t| numbers[t[0] as usize] != u32::MAX);
    let triangles = triangles.map(|t| t.map(|v| numbers[v as usize])).collect();
    let mut piece = TriangleMesh::new(kept.iter().map(|&v| mesh.positions()[v]).collect(), triangles)?;
    if !mesh.normals.is_empty() {
        piece.normals = kept.iter().map(|&v| mesh.normals[v]).collect();
    }
    Ok(piece)
}

#[cfg(test)]
mod tests {
    use super::*;
    use lumiris_numbers::math::Vec3;

    #[test]
    fn the_piece_with_the_most_triangles_stays() {
        let positions = (0..9).map(|i| Vec3::new(i as f32, (i * i) as f32, 0.0)).collect();
        let indices = vec![[0, 3, 1], [2, 4, 8], [5, 8, 6], [6, 7, 5]];
        let mut mesh = TriangleMesh::new(positions, indices).unwrap();
        mesh.normals = (0..9).map(|i| Vec3::splat(i as f32)).collect();
        let piece = largest_piece(&mesh).unwrap();
        assert_eq!(piece.positions().iter().map(|p| p.x).collect::<Vec<_>>(), [2.0, 4.0, 5.0, 6.0, 7.0, 8.0]);
        assert_eq!(piece.indices, [[0, 1, 5], [2, 5, 3], [3, 4, 2]]);
        assert_eq!(piece.normals[1].x, 4.0);
        assert_eq!(largest_piece(&TriangleMesh::default()).unwrap().triangle_count(), 0);
    }
}
