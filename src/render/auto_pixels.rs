//! The pixels where the pilot of `--estimator auto` measures.

use super::auto_reuse;
use crate::film::PixelBounds;
use lumiris_numbers::math::hash::{pcg4d, unit_f32};

/// Combined with the number of the round.
const SEED: u32 = 0x61_75_74_6f;

/// Pixels, one in each cell of a grid, at a place that depends on the round.
pub(super) fn pixels(bounds: &PixelBounds, count: usize, round: u32) -> Vec<[u32; 2]> {
    let (width, height) = (bounds.width(), bounds.height());
    let aspect = f64::from(width) / f64::from(height);
    let columns = ((count as f64 * aspect).sqrt().round() as u32).clamp(1, width);
    let rows = (count as u32 / columns).clamp(1, height);
    let place = |k: u32, cells: u32, size: u32, u: f32| {
        let [start, end] = [k, k + 1].map(|k| u64::from(k) * u64::from(size) / u64::from(cells)).map(|x| x as u32);
        (start + ((end - start) as f32 * u) as u32).min(end - 1)
    };
    let pixel = |row: u32, column: u32| {
        let h = pcg4d([row, column, SEED, round]);
        let (x, y) = (place(column, columns, width, unit_f32(h[0])), place(row, rows, height, unit_f32(h[1])));
        [bounds.x0 + x, bounds.y0 + y]
    };
    (0..rows).flat_map(|row| (0..columns).map(move |column| pixel(row, column))).collect()
}

/// As many pixels in blocks, or somewhat less; none where there is no room for any.
pub(super) fn blocks(bounds: &PixelBounds, count: usize) -> Vec<[u32; 2]> {
    const EDGE: u32 = auto_reuse::EDGE;
    let [width, height] = [bounds.width() / EDGE, bounds.height() / EDGE];
    if width == 0 || height == 0 {
        return Vec::new();
    }
    let corners = pixels(&PixelBounds { x0: 0, x1: width, y0: 0, y1: height }, count / (EDGE * EDGE) as usize, 2);
    let block = |[x, y]: [u32; 2]| {
        (0..EDGE * EDGE).map(move |i| [bounds.x0 + x * EDGE + i % EDGE, bounds.y0 + y * EDGE + i / EDGE])
    };
    corners.into_iter().flat_map(block).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixels_lie_inside_the_image_and_apart() {
        let bounds = PixelBounds { x0: 10, x1: 210, y0: 5, y1: 105 };
        for round in 0..2 {
            let pixels = pixels(&bounds, 300, round);
            assert!((270..=330).contains(&pixels.len()), "{}", pixels.len());
            assert!(pixels.iter().all(|[x, y]| (10..210).contains(x) && (5..105).contains(y)));
            let different: std::collections::HashSet<_> = pixels.iter().collect();
            assert_eq!(different.len(), pixels.len());
        }
        assert_ne!(pixels(&bounds, 300, 0), pixels(&bounds, 300, 1));
        assert_eq!(pixels(&PixelBounds { x0: 0, x1: 2, y0: 0, y1: 1 }, 100, 0), [[0, 0], [1, 0]]);
    }
}
