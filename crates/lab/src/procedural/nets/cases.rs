//! The 256 configurations of a surface in a cell: for each, the sheets and their edges among the twelve.
//!
//! Corner i has the coordinates (x, y, z) = (i & 1, i >> 1 & 1, i >> 2 & 1). Edge 4a + j is parallel to axis a; bit 0
//! of j is its coordinate on the axis a + 1, bit 1 on the axis a + 2 (mod 3). On a face with diagonal inside corners,
//! the inside counts as two pieces. Both cells at a face use the same four corners, so they agree.

/// The sheets of one case.
#[derive(Clone, Copy)]
pub(super) struct Case {
    /// Sheet of each edge; undefined if the surface does not cross the edge.
    pub sheet: [u8; 12],
    /// Number of sheets, at most 4.
    pub sheets: u8,
}

/// The two corners of an edge, lower first.
pub(super) fn edge_corners(edge: usize) -> [usize; 2] {
    let (axis, j) = (edge / 4, edge % 4);
    let first = ((j & 1) << ((axis + 1) % 3)) | ((j >> 1) << ((axis + 2) % 3));
    [first, first | (1 << axis)]
}

/// The four corners of the face across `axis` on `side`: bit 0 of the array index is the axis a + 1, bit 1 the axis a +
/// 2.
pub(super) fn face_corners(axis: usize, side: usize) -> [usize; 4] {
    std::array::from_fn(|j| (side << axis) | ((j & 1) << ((axis + 1) % 3)) | ((j >> 1) << ((axis + 2) % 3)))
}

/// True if a face has two inside corners, which are diagonal.
pub(super) fn is_ambiguous(config: u8, corners: [usize; 4]) -> bool {
    let inside = corners.map(|c| config >> c & 1 == 1);
    inside[0] == inside[3] && inside[1] == inside[2] && inside[0] != inside[1]
}

/// The edge between two corners that differ in one coordinate.
pub(super) fn edge_between(a: usize, b: usize) -> usize {
    let axis = (a ^ b).trailing_zeros() as usize;
    4 * axis + ((a >> ((axis + 1) % 3) & 1) | (a >> ((axis + 2) % 3) & 1) << 1)
}

/// The cases of all configurations of inside corners.
pub(super) fn all() -> Box<[Case; 256]> {
    Box::new(std::array::from_fn(|config| case(config as u8)))
}

fn case(config: u8) -> Case {
    let inside = |corner: usize| config >> corner & 1 == 1;
    let crossed = |edge: usize| {
        edge_corners(edge).map(inside) == [true, false] || edge_corners(edge).map(inside) == [false, true]
    };
    let mut label: [usize; 12] = std::array::from_fn(|e| e);
    let mut join = |a: usize, b: usize| {
        let (from, to) = (label[a].max(label[b]), label[a].min(label[b]));
        for l in &mut label {
            if *l == from {
                *l = to;
            }
        }
    };

    // Each face connects two edges, or two pairs of edges
    for (axis, side) in [(0, 0), (0, 1), (1, 0), (1, 1), (2, 0), (2, 1)] {
        let corners = face_corners(axis, side);
        let around = [[0, 1], [1, 3], [3, 2], [2, 0]].map(|[a, b]| edge_between(corners[a], corners[b]));
        if is_ambiguous(config, corners) {
            for j in 0..4 {
                if inside(corners[j]) {
                    join(edge_between(corners[j], corners[j ^ 1]), edge_between(corners[j], corners[j ^ 2]));
                }
            }
        } else {
            let mut ends = around.into_iter().filter(|&e| crossed(e));
            if let (Some(a), Some(b)) = (ends.next(), ends.next()) {
                join(a, b);
            }
        }
    }

    // Number the sheets
    let mut case = Case { sheet: [0; 12], sheets: 0 };
    let mut number = [None; 12];
    for edge in (0..12).filter(|&e| crossed(e)) {
        case.sheet[edge] = *number[label[edge]].get_or_insert_with(|| {
            case.sheets += 1;
            case.sheets - 1
        });
    }
    case
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn simple_cases_have_the_sheets_that_one_expects() {
        let cases = all();
        assert_eq!((cases[0].sheets, cases[255].sheets), (0, 0));
        assert!((0..8).all(|c| cases[1 << c].sheets == 1 && cases[255 ^ (1 << c)].sheets == 1));
        // Diagonal corners of a face, opposite corners of the cell, and every second corner.
        assert_eq!((cases[0b1001].sheets, cases[0b1000_0001].sheets, cases[0b0110_1001].sheets), (2, 2, 4));
        // A half.
        assert_eq!(cases[0b0000_1111].sheets, 1);
        // A sheet has three edges or more.
        for (config, case) in cases.iter().enumerate() {
            for sheet in 0..case.sheets {
                let count = (0..12).filter(|&e| {
                    let [a, b] = edge_corners(e);
                    (config >> a & 1) != (config >> b & 1) && case.sheet[e] == sheet
                });
                assert!(count.count() >= 3, "{config}");
            }
        }
    }
}
