//! Directions from one point to a surface of constant emission, many at once. The formulas are those of the modules of
//! `lights::area`; whatever depends on the point alone is computed once.

//!
//! [`many`] has directions from many points to one surface.

pub mod many;
pub mod spherical;

use super::lane::{F, LANES, Vec3s, begin, load, or_zero, safe_sqrt, sin_cos_turns, store};
use super::light::LightLanes;
use fearless_simd::{Level, Simd, dispatch, prelude::*};
use lumiris_numbers::math::{Frame, Vec2, Vec3, warp};
use spherical::SphericalSetup;

/// A rectangle.
#[derive(Clone, Copy, Debug)]
pub struct Rectangle {
    /// A corner.
    pub corner: Vec3,
    /// Unit vector along an edge from the corner.
    pub ex: Vec3,
    /// Unit vector along the other edge.
    pub ey: Vec3,
    /// Lengths of the two edges.
    pub size: Vec2,
    /// Unit normal.
    pub n: Vec3,
}

/// A rectangle as seen from the point: [x0, x1] × [y0, y1] × {z0} in the frame of its edges, z0 < 0.
#[derive(Clone, Copy, Debug)]
pub struct SphericalRectangle {
    /// Extent along the first edge.
    pub x: [f64; 2],
    /// Extent along the second edge.
    pub y: [f64; 2],
    /// Minus the distance of the plane.
    pub z0: f64,
    /// Solid angle.
    pub solid_angle: f64,
    /// e^{i(g2 + g3)} of the inner angles.
    pub g23: (f64, f64),
}

/// How a surface is sampled.
#[derive(Clone, Copy, Debug)]
pub enum Surface {
    /// Uniformly in solid angle.
    SphericalRectangle(Rectangle, SphericalRectangle),
    /// Uniformly in area.
    Rectangle(Rectangle),
    /// A triangle of corners, unit normal and area, uniformly in area.
    Triangle([Vec3; 3], Vec3, f32),
    /// A sphere from outside, uniformly in its cone.
    Cone {
        /// Centre.
        center: Vec3,
        /// Radius.
        radius: f32,
        /// Unit direction to the centre.
        axis: Vec3,
        /// 1 − cos θ of the cone.
        one_minus_cos: f32,
        /// sin² θ of the cone.
        sin2_max: f32,
        /// True if the normal points inwards.
        reversed: bool,
    },
}

/// A surface and a point from which it is sampled.
#[derive(Clone, Copy, Debug)]
pub struct AreaSampler {
    /// The point.
    pub from: Vec3,
    /// The surface.
    pub surface: Surface,
    /// Emitted radiance.
    pub l: [f32; 3],
    /// True if both sides emit; else the side of the normal.
    pub two_sided: bool,
}

impl AreaSampler {
    /// True if samples have work in common that each of them would do by itself.
    pub fn has_setup(&self) -> bool {
        match self.surface {
            Surface::SphericalRectangle(..) | Surface::Cone { .. } => true,
            Surface::Rectangle(_) | Surface::Triangle(..) => false,
        }
    }

    /// Samples directions.
    pub fn sample(&self, level: Level, u: [&[f32]; 2], out: &mut LightLanes<'_>) {
        out.with_padding(u, &|u, out| dispatch!(level, simd => self.sample_lanes(simd, u, out)));
    }

    #[inline(always)]
    fn sample_lanes<S: Simd>(&self, simd: S, u: [&[f32]; 2], out: &mut LightLanes<'_>) {
        match &self.surface {
            Surface::SphericalRectangle(rectangle, spherical) => {
                let pdf = (1.0 / spherical.solid_angle) as f32;
                self.spherical_rectangle(simd, rectangle, (&SphericalSetup::splat(simd, spherical), pdf), u, out);
            }
            Surface::Rectangle(rectangle) => self.rectangle(simd, rectangle, u, out),
            Surface::Triangle(p, n, area) => self.triangle(simd, p, (*n, *area), u, out),
            Surface::Cone { .. } => self.cone(simd, u, out),
        }
    }

    /// Directions to the points `p` of normal `n`, with densities per steradian `pdf`, or per area if `by_area`.
    #[inline(always)]
    fn finish<S: Simd>(
        &self,
        p: Vec3s<S>,
        n: Vec3s<S>,
        pdf: f32,
        by_area: bool,
        (i, out): (usize, &mut LightLanes<'_>),
    ) {
        let simd = p.x.token();
        let zero = F::splat(simd, 0.0);
        let d = p.minus(Vec3s::splat(simd, self.from));
        let t2 = d.dot(d);
        let t = t2.sqrt();
        let wi = Vec3s { x: d.x / t, y: d.y / t, z: d.z / t };
        let cos = n.dot(wi);
        let pdf = F::splat(simd, pdf);
        let pdf = if by_area { pdf * t2 / cos.abs() } else { pdf };
        let is_sample = pdf.simd_gt(zero) & pdf.is_finite() & t.simd_gt(zero);
        store(or_zero(is_sample, pdf), out.pdf, i);
        wi.store(&mut out.wi, i);
        let is_lit = if self.two_sided { pdf.simd_eq(pdf) } else { cos.simd_lt(zero) };
        let [red, green, blue] = &mut out.li;
        store(or_zero(is_lit, F::splat(simd, self.l[0])), red, i);
        store(or_zero(is_lit, F::splat(simd, self.l[1])), green, i);
        store(or_zero(is_lit, F::splat(simd, self.l[2])), blue, i);
    }

    #[inline(always)]
    fn spherical_rectangle<S: Simd>(
        &self,
        simd: S,
        rectangle: &Rectangle,
        (setup, pdf): (&SphericalSetup<S>, f32),
        u: [&[f32]; 2],
        out: &mut LightLanes<'_>,
    ) {
        let n = Vec3s::splat(simd, rectangle.n);
        for i in (0..out.pdf.len()).step_by(LANES) {
            let i = begin(i, out.pdf.len());
            let (u0, u1) = (load(simd, u[0], i).widen(), load(simd, u[1], i).widen());
            let (low, high) = (setup.place(u0.0, u1.0), setup.place(u0.1, u1.1));
            let p = rectangle.point(low.0.narrow(high.0), low.1.narrow(high.1));
            self.finish(p, n, pdf, false, (i, out));
        }
    }

    #[inline(always)]
    fn rectangle<S: Simd>(&self, simd: S, rectangle: &Rectangle, u: [&[f32]; 2], out: &mut LightLanes<'_>) {
        let (n, pdf_area) = (Vec3s::splat(simd, rectangle.n), 1.0 / (rectangle.size.x * rectangle.size.y));
        for i in (0..out.pdf.len()).step_by(LANES) {
            let i = begin(i, out.pdf.len());
            let p = rectangle.point(load(simd, u[0], i) * rectangle.size.x, load(simd, u[1], i) * rectangle.size.y);
            self.finish(p, n, pdf_area, true, (i, out));
        }
    }

    #[inline(always)]
    fn triangle<S: Simd>(
        &self,
        simd: S,
        corners: &[Vec3; 3],
        (n, area): (Vec3, f32),
        u: [&[f32]; 2],
        out: &mut LightLanes<'_>,
    ) {
        let n = Vec3s::splat(simd, n);
        for i in (0..out.pdf.len()).step_by(LANES) {
            let i = begin(i, out.pdf.len());
            let b = barycentric(load(simd, u[0], i), load(simd, u[1], i));
            self.finish(b.combine(corners[0], corners[1], corners[2]), n, 1.0 / area, true, (i, out));
        }
    }

    #[inline(always)]
    fn cone<S: Simd>(&self, simd: S, u: [&[f32]; 2], out: &mut LightLanes<'_>) {
        let Surface::Cone { center, radius, axis, one_minus_cos, sin2_max, reversed } = self.surface else { return };
        let (frame, sin_max, pdf) = (Frame::from_z(axis), sin2_max.sqrt(), warp::pdf_uniform_cone(one_minus_cos));
        let (one, center) = (F::splat(simd, 1.0), Vec3s::splat(simd, center));
        for i in (0..out.pdf.len()).step_by(LANES) {
            let i = begin(i, out.pdf.len());
            let x = load(simd, u[0], i) * one_minus_cos;
            let sin2 = (x * (F::splat(simd, 2.0) - x)).max(0.0);
            let (sin_phi, cos_phi) = sin_cos_turns(load(simd, u[1], i));
            // The angle at the centre
            let cos_alpha = sin2 / sin_max + (one - x) * safe_sqrt(one - sin2 / sin2_max);
            let sin_alpha = safe_sqrt(one - cos_alpha * cos_alpha);
            let local = Vec3s { x: cos_phi * sin_alpha, y: sin_phi * sin_alpha, z: -cos_alpha };
            let outward = local.combine(frame.x, frame.y, frame.z);
            let outward = outward.times(one / outward.dot(outward).sqrt());
            let p = center.plus(outward.times(F::splat(simd, radius)));
            let n = if reversed { outward.times(-one) } else { outward };
            self.finish(p, n, pdf, false, (i, out));
        }
    }
}

impl Rectangle {
    /// The points at `s` along one edge and `t` along the other.
    #[inline(always)]
    fn point<S: Simd>(&self, s: F<S>, t: F<S>) -> Vec3s<S> {
        let simd = s.token();
        Vec3s {
            x: F::splat(simd, self.corner.x) + s * self.ex.x + t * self.ey.x,
            y: F::splat(simd, self.corner.y) + s * self.ex.y + t * self.ey.y,
            z: F::splat(simd, self.corner.z) + s * self.ex.z + t * self.ey.z,
        }
    }
}

/// Barycentric weights uniform over a triangle [Heitz 2019].
#[inline(always)]
fn barycentric<S: Simd>(u0: F<S>, u1: F<S>) -> Vec3s<S> {
    let is_left = u0.simd_lt(u1);
    let half = is_left.select(u0, u1) * 0.5;
    let (b0, b1) = (is_left.select(half, u0 - half), is_left.select(u1 - half, half));
    Vec3s { x: b0, y: b1, z: F::splat(u0.token(), 1.0) - b0 - b1 }
}
