//! Local origins for points far from the world's origin.
//!
//! An f32 has 24 bits: at 10⁷ units from the origin the spacing of numbers is one unit. Coordinates and transforms are
//! therefore f64 until a nearby origin is subtracted. Origins are on a grid of 128 units. Points within 64 units of the
//! world's origin are unchanged, bit for bit. Elsewhere, points near an origin have coordinates of up to 64 units,
//! which f32 resolves to 4·10⁻⁶. Short decimals and powers of two remain short.

use super::{DAffine3, DVec3, Vec3};

/// Spacing of the origins along each axis.
const GRID: f64 = 128.0;

/// The nearest origin to a point; the world's origin if the point is not finite.
pub fn near_origin(p: DVec3) -> DVec3 {
    // Adding zero normalises −0
    let origin = (p / GRID).round() * GRID + 0.0;
    if origin.is_finite() { origin } else { DVec3::ZERO }
}

/// Points relative to a nearby origin.
#[derive(Clone, Debug)]
pub struct LocalPoints {
    /// The differences.
    pub points: Vec<Vec3>,
    /// The origin.
    pub origin: DVec3,
}

/// Points relative to the origin near the middle point of the list, since some programs write an unused first point.
pub fn relative(points: impl ExactSizeIterator<Item = DVec3> + Clone) -> LocalPoints {
    let origin = points.clone().nth(points.len() / 2).map_or(DVec3::ZERO, near_origin);
    // Space for the element that a mesh appends
    let mut out = Vec::with_capacity(points.len() + 1);
    out.extend(points.map(|p| (p - origin).as_vec3()));
    LocalPoints { points: out, origin }
}

/// Rebases a map between two spaces to points relative to the origins `to` and `from`.
pub fn rebased(to_from: &DAffine3, to: DVec3, from: DVec3) -> DAffine3 {
    DAffine3 { matrix3: to_from.matrix3, translation: to_from.transform_point3(from) - to }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_near_to_the_origin_stay_and_others_come_within_64_units() {
        assert_eq!(near_origin(DVec3::new(63.9, -63.9, 0.0)), DVec3::ZERO);
        assert_eq!(near_origin(DVec3::new(1e7, -130.0, 65.0)), DVec3::new(1e7, -128.0, 128.0));
        assert_eq!(near_origin(DVec3::splat(-0.1)).to_array().map(f64::to_bits), [0; 3]);
        assert_eq!(near_origin(DVec3::new(f64::NAN, 1e9, 0.0)), DVec3::ZERO);
        let points = [DVec3::new(0.1, -0.0, 7e30), DVec3::new(0.3, 1.0, 2.0)];
        let LocalPoints { points: near, origin } = relative(points.into_iter());
        assert_eq!(
            (near[0].to_array().map(f32::to_bits), origin),
            ([0.1, -0.0, 7e30_f32].map(f32::to_bits), DVec3::ZERO)
        );
        let LocalPoints { points: near, origin } = relative(points.map(|p| p + DVec3::X * 4e6).into_iter());
        assert_eq!((near[1].x, origin.x), (0.3 + 4e6_f64.rem_euclid(128.0) as f32, 4e6 - 4e6_f64.rem_euclid(128.0)));
    }

    #[test]
    fn rebased_maps_lead_to_the_same_points() {
        let m = DAffine3::from_rotation_x(0.3) * DAffine3::from_translation(DVec3::new(1e7, 2e7, -3e7));
        let (p, from) = (DVec3::new(0.25, 1.5, -2.0), DVec3::new(128.0, -1e6, 5e6));
        let expected = m.transform_point3(p + from);
        let to = near_origin(expected);
        let made = rebased(&m, to, from).transform_point3(p);
        assert!((made + to - expected).length() < 1e-7 && made.length() < 200.0, "{made}");
    }
}
