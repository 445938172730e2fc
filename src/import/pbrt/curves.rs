//! `Shape "curve"`: all bases and degrees are converted to cubic Bézier curves, exactly.

use super::checks::unknown;
use super::descriptions::{CurveData, ShapeDesc, ShapeSource};
use crate::geometry::{Curve, CurveKind, CurveSet};
use lumiris_formats::diagnostic::Diagnostics;
use lumiris_formats::pbrt::params::{ParamSet, ParamType};
use lumiris_numbers::math::origin::{LocalPoints, relative};
use lumiris_numbers::math::transform::transform_normal;
use lumiris_numbers::math::{Affine3A, DVec3, Vec3};

/// Basis of the control points.
#[derive(Clone, Copy, PartialEq)]
enum Basis {
    Bezier,
    BSpline,
}

/// Control points of cubic Bézier curves, relative to an origin.
struct Segments {
    points: Vec<[Vec3; 4]>,
    origin: DVec3,
}

/// The curves of one directive.
pub(super) fn curve_data(p: &ParamSet, d: &mut Diagnostics) -> Option<CurveData> {
    let kind = match p.string("type", d).unwrap_or("flat") {
        "flat" => CurveKind::Flat,
        "cylinder" => CurveKind::Cylinder,
        "ribbon" => CurveKind::Ribbon,
        other => {
            unknown(other, p.span_of("type"), "type of curve", &["flat", "cylinder", "ribbon"], d);
            return None;
        }
    };
    let basis = match p.string("basis", d).unwrap_or("bezier") {
        "bezier" => Basis::Bezier,
        "bspline" => Basis::BSpline,
        other => {
            unknown(other, p.span_of("basis"), "basis of curves", &["bezier", "bspline"], d);
            return None;
        }
    };
    let degree = match p.integer("degree", d).unwrap_or(3) {
        degree @ 2..=3 => degree as usize,
        other => {
            d.error(p.span_of("degree"), format!("the degree of a curve must be 2 or 3, not {other}"));
            return None;
        }
    };
    // Pieces are determined by shape and width
    p.ignore("splitdepth");

    let Segments { points: segments, origin } = segments(p, basis, degree, d)?;
    let widths = widths(p, d)?;
    let normals = normals(p, kind, segments.len(), d)?;
    let at = |i: usize| {
        let x = i as f32 / segments.len() as f32;
        widths[0] * (1.0 - x) + widths[1] * x
    };
    let curve = |(i, &points): (usize, &[Vec3; 4])| Curve { points, width: [at(i), at(i + 1)] };
    let curves = segments.iter().enumerate().map(curve).collect();
    Some(CurveData { kind, origin, curves, normals })
}

fn segments(p: &ParamSet, basis: Basis, degree: usize, d: &mut Diagnostics) -> Option<Segments> {
    let LocalPoints { points, origin } = match p.points("P", d).map(relative) {
        Some(points) => points,
        None => {
            d.error(p.span, "a curve needs `point3 P`");
            return None;
        }
    };

    // Number of control points
    let (count, span) = (points.len(), p.span_of("P"));
    let step = if basis == Basis::Bezier { degree } else { 1 };
    if count <= degree || !(count - 1 - degree).is_multiple_of(step) {
        let wanted = match basis {
            Basis::Bezier => format!("{}, {}, {} or so on", degree + 1, 2 * degree + 1, 3 * degree + 1),
            Basis::BSpline => format!("at least {}", degree + 1),
        };
        d.error(span, format!("{count} control points: a curve of this basis and degree {degree} has {wanted}"));
        return None;
    }
    if !points.iter().all(|p| p.is_finite()) {
        d.error(span, "control points must be finite");
        return None;
    }

    // Bézier segments
    let segment = |first: usize| cubic(&points[first..=first + degree], basis);
    Some(Segments { points: (0..count - degree).step_by(step).map(segment).collect(), origin })
}

/// The cubic Bézier curve of one segment of a Bézier curve or uniform B-spline of degree 2 or 3.
fn cubic(points: &[Vec3], basis: Basis) -> [Vec3; 4] {
    match (basis, points) {
        (Basis::Bezier, &[a, b, c, d]) => [a, b, c, d],
        (Basis::BSpline, &[a, b, c, d]) => {
            [(a + b * 4.0 + c) / 6.0, (b * 2.0 + c) / 3.0, (b + c * 2.0) / 3.0, (b + c * 4.0 + d) / 6.0]
        }
        (Basis::Bezier, &[a, b, c]) => elevated(a, b, c),
        (Basis::BSpline, &[a, b, c]) => elevated((a + b) * 0.5, b, (b + c) * 0.5),
        // The caller passes three or four points
        _ => [Vec3::NAN; 4],
    }
}

/// A quadratic Bézier curve as a cubic one.
fn elevated(a: Vec3, b: Vec3, c: Vec3) -> [Vec3; 4] {
    [a, (a + b * 2.0) / 3.0, (b * 2.0 + c) / 3.0, c]
}

/// Widths at both ends.
fn widths(p: &ParamSet, d: &mut Diagnostics) -> Option<[f32; 2]> {
    let width = p.float("width", d).unwrap_or(1.0);
    let mut checked = |name: &'static str| {
        let given = p.float(name, d);
        let (value, place) = given.map_or((width, "width"), |value| (value, name));
        if value >= 0.0 && value.is_finite() {
            return Some(value);
        }
        d.error(p.span_of(place), format!("{place} of a curve must be finite and not negative, not {value}"));
        None
    };
    let (first, last) = (checked("width0")?, checked("width1"));
    Some([first, last?])
}

/// Normals at the ends of the segments of a ribbon.
fn normals(p: &ParamSet, kind: CurveKind, segments: usize, d: &mut Diagnostics) -> Option<Vec<[Vec3; 2]>> {
    let given = p.get("N", &[ParamType::Normal], d).and_then(|p| p.floats()).unwrap_or_default();
    let given: Vec<Vec3> = given.chunks_exact(3).map(Vec3::from_slice).collect();
    if kind != CurveKind::Ribbon {
        if !given.is_empty() {
            d.warning_once(p.span_of("N"), "`N` is used by curves of type `ribbon` alone: it is ignored");
        }
        return Some(Vec::new());
    }

    // One normal per end of a segment
    if given.len() != segments + 1 {
        let (n, expected) = (given.len(), segments + 1);
        let place = if given.is_empty() { p.span } else { p.span_of("N") };
        d.error(place, format!("a ribbon of {segments} segments needs {expected} normals `N`, not {n}"));
        return None;
    }
    if !given.iter().all(|n| n.is_finite() && n.length_squared() > 0.0) {
        d.error(p.span_of("N"), "normals must be finite and not zero");
        return None;
    }
    Some(given.windows(2).map(|n| [n[0].normalize(), n[1].normalize()]).collect())
}

/// Maximum distance along an axis between origins of curves that are merged.
const MERGED: f64 = 1024.0;

/// Appends the curves of `desc` to `last` if they differ only in their numbers; otherwise returns `desc`. Hair has one
/// directive per fibre.
pub(super) fn merged(last: Option<&mut ShapeDesc>, desc: ShapeDesc) -> Option<ShapeDesc> {
    let Some(last) = last else { return Some(desc) };

    // Only curves with the same state are merged
    let is_alike = last.ctm == desc.ctm
        && last.reverse_orientation == desc.reverse_orientation
        && last.material.is_same(&desc.material)
        && last.area_light.is_none()
        && last.alpha == desc.alpha
        && last.object == desc.object
        && last.media.is_same(&desc.media);
    match (&mut last.source, desc.source) {
        (ShapeSource::Curves(all), ShapeSource::Curves(data))
            if is_alike && all.kind == data.kind && (data.origin - all.origin).abs().max_element() <= MERGED =>
        {
            // Points relative to the common origin
            let shift = (data.origin - all.origin).as_vec3();
            let shifted = |c: Curve| Curve { points: c.points.map(|p| p + shift), ..c };
            all.curves.extend(data.curves.into_iter().map(shifted));
            all.normals.extend(data.normals);
            None
        }
        (_, source) => Some(ShapeDesc { source, ..desc }),
    }
}

/// Curves in the space of their group. A non-uniform scale multiplies the width by the cube root of its determinant.
pub(super) fn placed(mut data: CurveData, m: &Affine3A) -> Result<CurveSet, String> {
    let scale = m.matrix3.determinant().abs().cbrt();
    for curve in &mut data.curves {
        curve.points = curve.points.map(|p| m.transform_point3(p));
        curve.width = curve.width.map(|w| w * scale);
    }
    for normals in &mut data.normals {
        *normals = normals.map(|n| transform_normal(m, n));
    }
    CurveSet::new(data.kind, data.curves, data.normals)
}
