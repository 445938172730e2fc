//! Pixels of images that are compared, without those that are not finite.

/// Linear red, green and blue.
pub type Pixel = [f32; 3];

/// True if all components are finite.
#[inline]
pub(super) fn is_finite(pixel: &Pixel) -> bool {
    pixel.iter().all(|v| v.is_finite())
}

/// Pixels that are finite in both images, in f64, with their index. Panics if the lengths differ.
pub(super) fn finite_pairs<'a>(
    image: &'a [Pixel],
    reference: &'a [Pixel],
) -> impl Iterator<Item = (usize, [f64; 3], [f64; 3])> + 'a {
    assert_eq!(image.len(), reference.len(), "images of one size");
    let finite = image.iter().zip(reference).enumerate().filter(|(_, (x, r))| is_finite(x) && is_finite(r));
    finite.map(|(i, (x, r))| (i, x.map(f64::from), r.map(f64::from)))
}

/// Mean of the finite values of a map; 0 if there are none.
pub fn mean_of_map(map: &[f32]) -> f64 {
    let (sum, count) =
        map.iter().filter(|v| v.is_finite()).fold((0.0, 0_usize), |(s, n), &v| (s + f64::from(v), n + 1));
    if count == 0 { 0.0 } else { sum / count as f64 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn means_leave_out_what_is_not_finite() {
        assert_eq!(mean_of_map(&[1.0, f32::NAN, 3.0, f32::INFINITY]), 2.0);
        assert_eq!(mean_of_map(&[f32::NAN]), 0.0);
        let image = [[1.0, f32::NAN, 0.0], [1.0, 2.0, 3.0], [0.0; 3]];
        let reference = [[0.0; 3], [0.5; 3], [f32::INFINITY, 0.0, 0.0]];
        let pairs: Vec<_> = finite_pairs(&image, &reference).collect();
        assert_eq!(pairs, [(1, [1.0, 2.0, 3.0], [0.5; 3])]);
    }

    #[test]
    #[should_panic(expected = "one size")]
    fn lengths_must_agree() {
        let _ = finite_pairs(&[[0.0; 3]], &[]).count();
    }
}
