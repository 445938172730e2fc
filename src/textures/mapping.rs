//! Maps from surface points to texture coordinates.

use super::context::TextureContext;
use glam::Mat2;
use lumiris_numbers::math::{DAffine3, DVec2, Vec2, Vec3, warp};
use std::f32::consts::{FRAC_1_PI, PI, TAU};

/// Mapping of a surface point to the plane of a texture.
#[derive(Clone, Copy, Debug)]
pub enum Mapping2d {
    /// scale·uv + delta.
    Uv {
        /// Factor per axis.
        scale: Vec2,
        /// Offset per axis.
        delta: Vec2,
    },
    /// matrix·uv + offset of the first or the second texture coordinates. With the second ones, lookups are not
    /// filtered.
    Affine {
        /// True for the second texture coordinates.
        second: bool,
        /// Linear part.
        matrix: Mat2,
        /// Offset.
        offset: Vec2,
    },
    /// (θ/π, φ/2π) of the direction from the origin of texture space.
    Spherical {
        /// World to texture space.
        texture_from_world: DAffine3,
    },
    /// ((π + atan2(y, x))/2π, z) in texture space.
    Cylindrical {
        /// World to texture space.
        texture_from_world: DAffine3,
    },
    /// (vs·p, vt·p) + delta in texture space.
    Planar {
        /// Gradient of s.
        vs: Vec3,
        /// Gradient of t.
        vt: Vec3,
        /// Offset per axis.
        delta: Vec2,
        /// World to texture space.
        texture_from_world: DAffine3,
    },
}

impl Default for Mapping2d {
    fn default() -> Self {
        Mapping2d::Uv { scale: Vec2::ONE, delta: Vec2::ZERO }
    }
}

impl Mapping2d {
    /// Texture coordinates (s, t), t upwards. Coordinates computed from positions may be large.
    pub fn st(&self, ctx: &TextureContext) -> DVec2 {
        match self {
            // Mappings of texture coordinates
            Mapping2d::Uv { scale, delta } => (*scale * ctx.uv + *delta).as_dvec2(),
            Mapping2d::Affine { second, matrix, offset } => {
                (*matrix * if *second { ctx.uv1 } else { ctx.uv } + *offset).as_dvec2()
            }
            // Mappings of positions
            Mapping2d::Spherical { texture_from_world } => {
                let w = texture_from_world.transform_point3(ctx.p).as_vec3().normalize_or(Vec3::Z);
                let st = Vec2::new(w.z.clamp(-1.0, 1.0).acos() * FRAC_1_PI, warp::azimuth(w) / TAU);
                st.as_dvec2()
            }
            Mapping2d::Cylindrical { texture_from_world } => {
                let p = texture_from_world.transform_point3(ctx.p);
                let turn = (PI + (p.y as f32).atan2(p.x as f32)) / TAU;
                DVec2::new(f64::from(turn), p.z)
            }
            Mapping2d::Planar { vs, vt, delta, texture_from_world } => {
                let p = texture_from_world.transform_point3(ctx.p);
                delta.as_dvec2() + DVec2::new(p.dot(vs.as_dvec3()), p.dot(vt.as_dvec3()))
            }
        }
    }

    /// Filter width in (s, t) of mappings of the first texture coordinates; other lookups are not filtered.
    pub fn width(&self, ctx: &TextureContext) -> Vec2 {
        match self {
            Mapping2d::Uv { scale, .. } => scale.abs() * ctx.uv_width,
            Mapping2d::Affine { second: false, matrix, .. } => {
                Mat2::from_cols(matrix.x_axis.abs(), matrix.y_axis.abs()) * ctx.uv_width
            }
            Mapping2d::Affine { second: true, .. }
            | Mapping2d::Spherical { .. }
            | Mapping2d::Cylindrical { .. }
            | Mapping2d::Planar { .. } => Vec2::ZERO,
        }
    }
}

/// Cells of a checkerboard.
#[derive(Clone, Copy, Debug)]
pub enum CheckerboardMapping {
    /// Unit squares of texture coordinates.
    Squares(Mapping2d),
    /// Unit cubes of texture space.
    Cubes {
        /// World to texture space.
        texture_from_world: DAffine3,
    },
}

impl CheckerboardMapping {
    /// True in cells of even parity, such as the cell from the origin to (1, 1, 1).
    pub fn is_even(&self, ctx: &TextureContext) -> bool {
        // The parity is taken before adding, which would lose it for large floats
        let odd = |x: f64| x.floor().rem_euclid(2.0) == 1.0;
        match self {
            CheckerboardMapping::Squares(mapping) => {
                let st = mapping.st(ctx);
                odd(st.x) == odd(st.y)
            }
            CheckerboardMapping::Cubes { texture_from_world } => {
                let p = texture_from_world.transform_point3(ctx.p);
                !(odd(p.x) ^ odd(p.y) ^ odd(p.z))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lumiris_numbers::math::DVec3;

    fn at(p: Vec3, uv: Vec2) -> TextureContext {
        TextureContext {
            uv,
            uv_width: Vec2::new(0.1, 0.2),
            uv1: Vec2::ZERO,
            color: [1.0; 4],
            face: 0,
            p: p.as_dvec3(),
            n: Vec3::Z,
        }
    }

    #[test]
    fn mappings_have_their_formulas() {
        let shift = DAffine3::from_translation(DVec3::new(-1.0, 0.0, 0.0));
        let uv = Mapping2d::Uv { scale: Vec2::new(2.0, -3.0), delta: Vec2::new(0.5, 0.25) };
        let ctx = at(Vec3::ZERO, Vec2::new(0.25, 0.5));
        let (st, width) = (uv.st(&ctx), uv.width(&ctx));
        assert!((st - DVec2::new(1.0, -1.25)).length() < 1e-6 && (width - Vec2::new(0.2, 0.6)).length() < 1e-6);

        let spherical = Mapping2d::Spherical { texture_from_world: shift };
        let st = spherical.st(&at(Vec3::new(1.0, -5.0, 0.0), Vec2::ZERO));
        assert!((st - DVec2::new(0.5, 0.75)).length() < 1e-6, "{st}");
        assert!(spherical.st(&at(Vec3::X, Vec2::ZERO)).is_finite());

        let cylindrical = Mapping2d::Cylindrical { texture_from_world: shift };
        let st = cylindrical.st(&at(Vec3::new(1.0, 2.0, 3.5), Vec2::ZERO));
        assert!((st - DVec2::new(0.75, 3.5)).length() < 1e-6, "{st}");

        let planar = Mapping2d::Planar { vs: Vec3::Y, vt: Vec3::Z * 2.0, delta: Vec2::ONE, texture_from_world: shift };
        let st = planar.st(&at(Vec3::new(1.0, 2.0, 3.0), Vec2::ZERO));
        assert!((st - DVec2::new(3.0, 7.0)).length() < 1e-6, "{st}");
    }

    #[test]
    fn patterns_far_from_the_origin_of_their_space_are_those_near_to_it() {
        let far = DVec3::new(1e7, -4e6, 512_000.0);
        for i in 0..200_u16 {
            let p = at(Vec3::new(0.137, 0.071, -0.093) * f32::from(i), Vec2::ZERO);
            let of = |o: DVec3| {
                let texture_from_world = DAffine3::from_translation(o);
                let (vs, vt, delta) = (Vec3::X, Vec3::Y, Vec2::ZERO);
                let st = Mapping2d::Planar { vs, vt, delta, texture_from_world }.st(&p);
                (CheckerboardMapping::Cubes { texture_from_world }.is_even(&p), st - o.truncate())
            };
            let ((even, st), (even_far, st_far)) = (of(DVec3::ZERO), of(far));
            assert!(even == even_far && (st - st_far).length() < 1e-8, "{i}");
        }
    }

    #[test]
    fn checkerboards_alternate_on_both_sides_of_zero() {
        let squares = CheckerboardMapping::Squares(Mapping2d::default());
        let even = |x: f32, y: f32| squares.is_even(&at(Vec3::ZERO, Vec2::new(x, y)));
        assert!(even(0.5, 0.5) && !even(1.5, 0.5) && even(1.5, 1.5) && !even(-0.5, 0.5) && even(-0.5, -0.5));
        let cubes = CheckerboardMapping::Cubes { texture_from_world: DAffine3::from_scale(DVec3::splat(2.0)) };
        let even = |x, y, z| cubes.is_even(&at(Vec3::new(x, y, z), Vec2::ZERO));
        assert!(even(0.2, 0.2, 0.2) && !even(0.2, 0.2, 0.7) && even(0.2, 0.7, 0.7) && !even(-0.2, 0.2, 0.2));
        assert!(!even(0.7, 0.7, 0.7));
    }
}
