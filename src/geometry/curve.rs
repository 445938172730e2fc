//! Cubic Bézier curves with a width: hair, fur and grass.
//!
//! A curve is a ribbon about c(u) with a width w(u) that is linear in u. The ribbon faces each ray, as in pbrt-v4
//! [Pharr et al. 2023, sec. 6.7], or has given normals. Parameters of a hit are (u, v): u along the curve, v from 0 to
//! 1 across it.
//!
//! Projected along the ray, the curve is c₂(u) = c − d (c·d)/d², relative to the ray's origin. The ray hits the ribbon
//! at the u with minimum distance to the curve, if that is at most w/2: c₂·c' = 0, c₂·c' increasing, |c₂| ≤ w/2. The
//! hit is at the depth c·d/d² of the centre. The ends of a curve are therefore cut perpendicularly, and adjacent curves
//! with a common tangent leave no gap.
//!
//! Curves are split into pieces of u so short that c₂·c' has at most one root in each, and that their boxes are tight.
//! A piece is one primitive of a ray tracer. The root is computed in f64 by Newton's method in a bracket.

use super::hit::{LocalHit, SurfaceHit, VertexValues, round};
use glam::DVec3;
use lumiris_numbers::math::{Bounds3, Frame, Ray, Vec2, Vec3, gamma};

/// Maximum number of pieces of one curve.
const MAX_PIECES: u32 = 128;

/// The shape of a curve's surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CurveKind {
    /// A ribbon that faces the ray.
    Flat,
    /// As flat, but with the normals of a tube.
    Cylinder,
    /// A ribbon with normals of its own.
    Ribbon,
}

/// One cubic Bézier curve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Curve {
    /// Control points.
    pub points: [Vec3; 4],
    /// Width at u = 0 and u = 1.
    pub width: [f32; 2],
}

/// The part of a curve that is a primitive: u from index/count to (index + 1)/count.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Piece {
    curve: u32,
    index: u16,
    count: u16,
}

/// Curves of one kind.
#[derive(Clone, Debug)]
pub struct CurveSet {
    kind: CurveKind,
    curves: Vec<Curve>,
    /// Unit normals of ribbons at both ends of each curve.
    normals: Vec<[Vec3; 2]>,
    pieces: Vec<Piece>,
}

/// A point of a curve.
#[derive(Clone, Copy)]
struct Point {
    c: DVec3,
    d1: DVec3,
    d2: DVec3,
}

impl Curve {
    /// c, c' and c'' at `u`, relative to `o`.
    #[inline]
    fn at(&self, u: f64, o: DVec3) -> Point {
        let [p0, p1, p2, p3] = self.points.map(|p| p.as_dvec3() - o);
        let w = 1.0 - u;
        let (a, b, c) = (p1 - p0, p2 - p1, p3 - p2);
        Point {
            c: p0 * (w * w * w) + p1 * (3.0 * w * w * u) + p2 * (3.0 * w * u * u) + p3 * (u * u * u),
            d1: (a * (w * w) + b * (2.0 * w * u) + c * (u * u)) * 3.0,
            d2: ((b - a) * w + (c - b) * u) * 6.0,
        }
    }

    /// Width at `u`.
    #[inline]
    pub fn width_at(&self, u: f32) -> f32 {
        self.width[0] * (1.0 - u) + self.width[1] * u
    }

    /// Control points of the part from `from` to `to`, by blossoms.
    fn part(&self, from: f32, to: f32) -> [Vec3; 4] {
        let [p0, p1, p2, p3] = self.points;
        let blossom = |x: f32, y: f32, z: f32| {
            let (a, b, c) = (p0.lerp(p1, x), p1.lerp(p2, x), p2.lerp(p3, x));
            a.lerp(b, y).lerp(b.lerp(c, y), z)
        };
        [blossom(from, from, from), blossom(from, from, to), blossom(from, to, to), blossom(to, to, to)]
    }

    /// Number of pieces: each deviates from a straight line by at most a twentieth of the width, and boxes are tight.
    fn pieces(&self) -> u32 {
        let [p0, p1, p2, p3] = self.points;
        let width = self.width[0].max(self.width[1]).max(f32::MIN_POSITIVE);
        // A curve of second differences L is within 3L/(4 n²) of n chords
        let bend = (p0 - p1 * 2.0 + p2).length().max((p1 - p2 * 2.0 + p3).length());
        let straight = (0.75 * bend / (0.05 * width)).sqrt().ceil();
        let length = (p1 - p0).length() + (p2 - p1).length() + (p3 - p2).length();
        let tight = (length / (8.0 * width)).ceil().min(8.0);
        straight.max(tight).clamp(1.0, MAX_PIECES as f32) as u32
    }

    /// A unit tangent that is defined everywhere.
    fn tangent(&self, at: &Point) -> DVec3 {
        let [p0, .., p3] = self.points;
        let chord = (p3 - p0).as_dvec3();
        at.d1.try_normalize().or_else(|| at.d2.try_normalize()).or_else(|| chord.try_normalize()).unwrap_or(DVec3::X)
    }
}

impl CurveSet {
    /// Curves of one kind; `normals` has two unit vectors for each curve of ribbons, and is unused for others.
    pub fn new(kind: CurveKind, curves: Vec<Curve>, normals: Vec<[Vec3; 2]>) -> Result<Self, String> {
        if kind == CurveKind::Ribbon && normals.len() != curves.len() {
            return Err(format!("{} ribbons have {} pairs of normals", curves.len(), normals.len()));
        }
        let is_sound =
            |c: &Curve| c.points.iter().all(|p| p.is_finite()) && c.width.iter().all(|&w| w >= 0.0 && w.is_finite());
        if !curves.iter().all(is_sound) {
            return Err("points and widths of curves must be finite, and widths not negative".into());
        }
        let mut pieces = Vec::new();
        for (i, curve) in curves.iter().enumerate() {
            let curve_id = u32::try_from(i).map_err(|_| "more than 4294967295 curves in one shape".to_string())?;
            let count = curve.pieces();
            pieces.extend((0..count).map(|k| Piece { curve: curve_id, index: k as u16, count: count as u16 }));
        }
        pieces.shrink_to_fit();
        let normals = if kind == CurveKind::Ribbon { normals } else { Vec::new() };
        Ok(CurveSet { kind, curves, normals, pieces })
    }

    /// The curves.
    pub fn curves(&self) -> &[Curve] {
        &self.curves
    }

    /// Number of primitives for a ray tracer.
    pub fn piece_count(&self) -> usize {
        self.pieces.len()
    }

    /// Memory (bytes).
    pub fn bytes(&self) -> usize {
        size_of_val(&self.curves[..]) + size_of_val(&self.normals[..]) + size_of_val(&self.pieces[..])
    }

    /// Bounds of all curves.
    pub fn bounds(&self) -> Bounds3 {
        (0..self.pieces.len()).fold(Bounds3::EMPTY, |b, i| Bounds3::union(b, self.piece_bounds(i)))
    }

    /// Bounds of a piece.
    pub fn piece_bounds(&self, i: usize) -> Bounds3 {
        let Piece { curve, index, count } = self.pieces[i];
        let curve = &self.curves[curve as usize];
        let [from, to] = [index, index + 1].map(|k| f32::from(k) / f32::from(count));
        let b = Bounds3::from_points(curve.part(from, to));
        let extent = curve.points.iter().fold(Vec3::ZERO, |m, p| m.max(p.abs())).max_element();
        let r = Vec3::splat(0.5 * curve.width_at(from).max(curve.width_at(to)) * (1.0 + gamma(4)) + extent * gamma(8));
        Bounds3 { min: b.min - r, max: b.max + r }
    }

    /// Normal of a ribbon at `u`, interpolated on the sphere.
    fn ribbon_normal(&self, curve: usize, u: f64) -> DVec3 {
        let [a, b] = self.normals[curve].map(|n| n.as_dvec3());
        let angle = a.dot(b).clamp(-1.0, 1.0).acos();
        let sin = angle.sin();
        if sin < 1e-6 {
            return a;
        }
        (a * ((1.0 - u) * angle).sin() + b * (u * angle).sin()) / sin
    }

    /// The hit of a piece in (0, t_max); uv are (u, v) of the curve.
    pub fn intersect(&self, primitive: usize, ray: &Ray) -> Option<LocalHit> {
        let Piece { curve: id, index, count } = self.pieces[primitive];
        let curve = &self.curves[id as usize];
        let (o, d) = (ray.o.as_dvec3(), ray.d.as_dvec3());
        let inv_d2 = 1.0 / d.length_squared();
        let project = |x: DVec3| x - d * (x.dot(d) * inv_d2);
        // Half the derivative of the squared distance of the ray and c(u), and its own derivative
        let slope = |u: f64| {
            let at = curve.at(u, o);
            let c2 = project(at.c);
            [c2.dot(at.d1), project(at.d1).length_squared() + c2.dot(at.d2)]
        };
        let [from, to] = [index, index + 1].map(|k| f64::from(k) / f64::from(count));
        let (a, b) = (slope(from)[0], slope(to)[0]);
        if !(a <= 0.0 && b > 0.0) {
            return None;
        }
        let u = root(slope, [from, to], [a, b]);

        let at = curve.at(u, o);
        let c2 = project(at.c);
        let (u32, distance) = (u as f32, c2.length());
        let mut width = f64::from(curve.width_at(u32));
        if self.kind == CurveKind::Ribbon {
            width *= self.ribbon_normal(id as usize, u).dot(d).abs() * inv_d2.sqrt();
        }
        let t = (at.c.dot(d) * inv_d2) as f32;
        if !(2.0 * distance <= width && width > 0.0 && t > 0.0 && t < ray.t_max) {
            return None;
        }
        let x = self.across(id as usize, u, curve.tangent(&at), d).dot(-c2).signum() * distance;
        Some(LocalHit { t, uv: [u32, (0.5 + x / width).clamp(0.0, 1.0) as f32] })
    }

    /// Unit vector of increasing v.
    fn across(&self, curve: usize, u: f64, tangent: DVec3, d: DVec3) -> DVec3 {
        let side = match self.kind {
            CurveKind::Flat | CurveKind::Cylinder => tangent.cross(d),
            CurveKind::Ribbon => self.ribbon_normal(curve, u).cross(tangent),
        };
        side.try_normalize().unwrap_or_else(|| Frame::from_z(round(tangent)).x.as_dvec3())
    }

    /// The surface at (u, v) of a piece for a ray of direction `d`. Normals of flat curves and tubes point towards the
    /// ray's origin.
    ///
    /// The error bound is twice the width, as in pbrt-v4. The ribbon rotates with the ray, so an outgoing ray must
    /// start beyond half the width to avoid hitting the same ribbon in its new orientation.
    pub fn surface_hit(&self, primitive: usize, [u, v]: [f32; 2], d: Vec3) -> SurfaceHit {
        let id = self.pieces[primitive].curve as usize;
        let curve = &self.curves[id];
        let at = curve.at(f64::from(u), DVec3::ZERO);
        let tangent = curve.tangent(&at);
        let width = curve.width_at(u);

        // Frame across the curve
        let side = self.across(id, f64::from(u), tangent, d.as_dvec3());
        let h = f64::from(2.0 * v - 1.0);
        let front = side.cross(tangent);

        // Normal
        let n = match self.kind {
            CurveKind::Flat | CurveKind::Ribbon => tangent.cross(side),
            CurveKind::Cylinder => side * h - front * (1.0 - h * h).max(0.0).sqrt(),
        };
        let n = round(n.normalize_or(-front));
        let p = round(at.c + side * (0.5 * h * f64::from(width)));

        // Derivatives and error bound
        let dpdu = round(if at.d1.length_squared() > 0.0 { at.d1 } else { tangent });
        let dpdv = n.cross(dpdu).normalize_or(round(side)) * width;
        let p_error = Vec3::splat(2.0 * width) + p.abs() * gamma(4);
        let (uv, vertex) = (Vec2::new(u, v), VertexValues::default());
        SurfaceHit { p, p_error, n, ns: n, dpdu, dpdv, dpdus: dpdu, dpdvs: dpdv, uv, vertex }
    }
}

/// The root of an increasing function in a bracket with the values `ends`; `f` returns its value and derivative.
fn root(f: impl Fn(f64) -> [f64; 2], [mut lo, mut hi]: [f64; 2], ends: [f64; 2]) -> f64 {
    let mut u = lo - ends[0] * (hi - lo) / (ends[1] - ends[0]);
    for _ in 0..24 {
        let [value, derivative] = f(u);
        if value <= 0.0 {
            lo = u;
        } else {
            hi = u;
        }
        let newton = u - value / derivative;
        let next = if newton > lo && newton < hi { newton } else { 0.5 * (lo + hi) };
        if (next - u).abs() < 1e-10 {
            return next;
        }
        u = next;
    }
    u
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::reference_for_tests::random_point;
    use lumiris_numbers::math::ray::offset_origin;
    use lumiris_test_support::random::{Pcg32, RngExt, pcg32};

    fn straight(kind: CurveKind, width: f32) -> CurveSet {
        let points = [0.0, 1.0, 2.0, 3.0].map(|x| Vec3::new(x, 0.0, 0.0));
        let normals = vec![[Vec3::Z; 2]];
        CurveSet::new(kind, vec![Curve { points, width: [width; 2] }], normals).unwrap()
    }

    fn first(set: &CurveSet, ray: &Ray) -> Option<(usize, LocalHit)> {
        let hits = (0..set.piece_count()).filter_map(|i| Some((i, set.intersect(i, ray)?)));
        hits.min_by(|a, b| a.1.t.total_cmp(&b.1.t))
    }

    fn random_curve(s: &mut Pcg32) -> Curve {
        Curve { points: std::array::from_fn(|_| random_point(s)), width: [0.05 + 0.1 * s.random::<f32>(), 0.05] }
    }

    fn ray(o: Vec3, d: Vec3) -> Ray {
        Ray { o, d, t_max: f32::INFINITY, time: 0.0 }
    }

    #[test]
    fn straight_curves_are_hit_within_their_width_and_length_only() {
        for kind in [CurveKind::Flat, CurveKind::Cylinder, CurveKind::Ribbon] {
            let set = straight(kind, 0.2);
            for (x, y, hits) in [
                (1.5, 0.099, true),
                (1.5, -0.099, true),
                (1.5, 0.101, false),
                (-0.001, 0.0, false),
                (3.001, 0.0, false),
            ] {
                let found = first(&set, &ray(Vec3::new(x, y, 5.0), Vec3::new(0.0, 0.0, -2.0)));
                assert_eq!(found.is_some(), hits, "{kind:?} {x} {y}");
                let Some((i, hit)) = found else { continue };
                assert!((hit.t - 2.5).abs() < 1e-6 && (hit.uv[0] - 0.5).abs() < 1e-6);
                let surface = set.surface_hit(i, hit.uv, -Vec3::Z);
                assert!((surface.p - Vec3::new(x, y, 0.0)).length() < 1e-6, "{surface:?}");
                // h increases along z × x of the frame of the hit, which hair relies on
                let along_y = surface.n.cross(surface.dpdu).normalize();
                assert!(surface.n.z > 0.0 && along_y.dot(surface.dpdv) > 0.0);
                assert!(((hit.uv[1] - 0.5) * 0.2 - y * Vec3::Z.cross(surface.dpdu).normalize().y).abs() < 1e-6);
            }
        }
    }

    #[test]
    fn normals_of_tubes_are_those_of_a_cylinder() {
        let set = straight(CurveKind::Cylinder, 2.0);
        for y in [-0.95_f32, -0.3, 0.0, 0.6] {
            let (i, hit) = first(&set, &ray(Vec3::new(1.3, y, 5.0), -Vec3::Z)).unwrap();
            let n = set.surface_hit(i, hit.uv, -Vec3::Z).n;
            assert!((n - Vec3::new(0.0, y, (1.0 - y * y).sqrt())).length() < 1e-4, "{y} {n}");
        }
    }

    #[test]
    fn ribbons_are_foreshortened() {
        let set = straight(CurveKind::Ribbon, 0.2);
        let d = Vec3::new(0.0, -1.0, -1.0);
        // At 45° the projected width of the ribbon is 0.2/√2: ±0.0707 across the ray, which is ±0.1 along y
        for (y, hits) in [(0.099, true), (0.101, false), (-0.099, true), (-0.101, false)] {
            let found = first(&set, &ray(Vec3::new(1.0, y, 0.0) - d * 3.0, d));
            assert_eq!(found.is_some(), hits, "{y}");
        }
    }

    /// The first minimum of the distance between ray and curve that is within the width, by small steps.
    fn reference(curve: &Curve, ray: &Ray) -> Option<f64> {
        let (o, d) = (ray.o.as_dvec3(), ray.d.as_dvec3());
        let at = |k: i32| {
            let c = curve.at(f64::from(k) / 20_000.0, o).c;
            let t = c.dot(d) / d.length_squared();
            ((c - d * t).length(), t)
        };
        let minima = (1..20_000).filter(|&k| at(k).0 <= at(k - 1).0 && at(k).0 < at(k + 1).0);
        let inside = minima.filter(|&k| 2.0 * at(k).0 <= f64::from(curve.width_at(k as f32 / 20_000.0)));
        inside.map(|k| at(k).1).filter(|t| *t > 0.0).min_by(f64::total_cmp)
    }

    #[test]
    fn hits_are_the_first_minima_of_the_distance() {
        let mut s = pcg32([5, 0, 2]);
        let (mut both, mut differ) = (0, 0);
        for _ in 0..300 {
            let curve = random_curve(&mut s);
            let set = CurveSet::new(CurveKind::Flat, vec![curve], Vec::new()).unwrap();
            let target = round(curve.at(s.random::<f64>(), DVec3::ZERO).c) + random_point(&mut s) * 0.05;
            let o = random_point(&mut s) * 4.0;
            let ray = ray(o, target - o);
            match (first(&set, &ray), reference(&curve, &ray)) {
                (Some((_, hit)), Some(t)) if (f64::from(hit.t) - t).abs() < 1e-3 => both += 1,
                (None, None) => {}
                _ => differ += 1,
            }
        }
        // The stepping may decide differently at the rim
        assert!(both > 100 && differ <= 2, "{both} {differ}");
    }

    #[test]
    fn a_straight_ribbon_covers_its_area() {
        let set = straight(CurveKind::Flat, 0.37);
        let mut s = pcg32([1, 2, 0]);
        let n = 200_000;
        let hit = |s: &mut Pcg32| {
            let o = Vec3::new(4.0 * s.random::<f32>() - 0.5, s.random::<f32>() - 0.5, 2.0);
            first(&set, &ray(o, -Vec3::Z)).is_some()
        };
        let area = (0..n).filter(|_| hit(&mut s)).count() as f64 / f64::from(n) * 4.0;
        // Four standard deviations
        let p = 3.0 * 0.37 / 4.0_f64;
        assert!((area - 3.0 * 0.37).abs() < 4.0 * 4.0 * (p * (1.0 - p) / f64::from(n)).sqrt(), "{area}");
    }

    #[test]
    fn pieces_leave_no_gap_and_boxes_hold_their_hits() {
        let mut s = pcg32([8, 8, 1]);
        for _ in 0..200 {
            let curve = random_curve(&mut s);
            let set = CurveSet::new(CurveKind::Flat, vec![curve], Vec::new()).unwrap();
            for k in 0..set.piece_count() {
                // At the joints, where the ray crosses the curve
                let u = f64::from(k as u32) / set.piece_count() as f64;
                let at = curve.at(u.max(1e-3), DVec3::ZERO);
                let p = round(at.c);
                let side = round(at.d1).any_orthonormal_vector();
                let ray = ray(p - side * 3.0, side);
                let (i, hit) = first(&set, &ray).expect("the curve is met");
                let b = set.piece_bounds(i);
                let q = ray.at(hit.t);
                assert!(q.cmpge(b.min - 1e-5).all() && q.cmple(b.max + 1e-5).all());
            }
        }
    }

    #[test]
    fn rays_that_leave_a_straight_curve_do_not_meet_it_again() {
        let mut s = pcg32([4, 4, 4]);
        for kind in [CurveKind::Flat, CurveKind::Cylinder, CurveKind::Ribbon] {
            let set = straight(kind, 0.1);
            let mut hits = 0;
            for _ in 0..2000 {
                let o = Vec3::new(1.5, 0.0, 0.0) + random_point(&mut s) * 4.0;
                let target = Vec3::new(0.5 + 2.0 * s.random::<f32>(), 0.0, 0.0) + random_point(&mut s) * 0.04;
                let ray_in = ray(o, (target - o).normalize());
                let Some((i, hit)) = first(&set, &ray_in) else { continue };
                hits += 1;
                let surface = set.surface_hit(i, hit.uv, ray_in.d);
                let w = random_point(&mut s).normalize_or(Vec3::Z);
                let out = ray(offset_origin(surface.p, surface.p_error, surface.n, w), w);
                assert!(first(&set, &out).is_none(), "{kind:?} {ray_in:?} {out:?}");
            }
            assert!(hits > 500, "{hits}");
        }
    }

    #[test]
    fn degenerate_curves_give_no_nan() {
        let p = Vec3::ONE;
        for (points, width) in [([p; 4], 0.1), ([p, p, p * 2.0, p * 2.0], 0.0), ([p, p, p, p * 2.0], 0.1)] {
            let set = CurveSet::new(CurveKind::Flat, vec![Curve { points, width: [width; 2] }], Vec::new()).unwrap();
            for d in [Vec3::X, Vec3::ONE, Vec3::new(1.0, 1.0, 1e-3)] {
                if let Some((i, hit)) = first(&set, &ray(p * 1.0 - d, d)) {
                    let s = set.surface_hit(i, hit.uv, d);
                    assert!(s.n.is_finite() && s.p.is_finite() && (s.n.length() - 1.0).abs() < 1e-4);
                }
                let s = set.surface_hit(0, [0.0, 0.5], d);
                assert!(s.n.is_finite() && s.dpdu.is_finite() && s.dpdv.is_finite(), "{s:?}");
            }
        }
        let bad = Curve { points: [Vec3::NAN; 4], width: [1.0; 2] };
        assert!(CurveSet::new(CurveKind::Flat, vec![bad], Vec::new()).is_err());
    }
}
