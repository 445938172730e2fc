//! Measured reflection in the adaptive parameterisation of [Dupuy and Jakob 2018], on both sides of the surface.
//!
//! Reflection is parameterised by facet normals: wi is the reflection of wo about a normal m. Directions map to points
//! (√(2θ/π), (φ + π)/2π) of the unit square; for isotropic surfaces the φ of m is relative to the φ of wo. For each of
//! some directions wo, a table of visible normals is a density over this square. Sampling it is a map R from random
//! numbers u to m, and
//!
//! f cos θi = s(u) D(m)/(4 σ(wo)), u = R⁻¹(m),
//!
//! where s is the table of colours, D the table of normals, and σ the table of projected areas. s is the weight of a
//! sample of R and varies slowly with u. Samples draw u by the luminance of s. With p(u) and p(m) the densities over
//! the square, the density of wi per steradian is p(u) p(m)/(2π² √(2θm/π) sin θm · 4 (wo·m)).

use super::fresnel::{reflect, to_upper};
use super::lobe::{BsdfSample, Lobe};
use lumiris_formats::bsdf_file::MeasuredBsdf;
use lumiris_numbers::math::{BilinearTables, Blend, ParameterGrid, PiecewiseBilinear2D, Rgb, Vec2, Vec3};
use std::f32::consts::{FRAC_PI_2, PI, TAU};

/// Maximum deviation of the azimuths of the tables from a whole, a half or a quarter turn, in turns.
const AZIMUTH_TOLERANCE: f32 = 0.01;

/// The symmetry of the surface, which determines how it depends on the azimuth of wo.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Symmetry {
    /// Independent of the azimuth.
    Isotropic,
    /// No symmetry: there are tables for all azimuths.
    None,
    /// Symmetric under rotation by 180° about n: there are tables for the side of this direction.
    HalfTurn(Vec2),
    /// Symmetric under reflection at both axes: there are tables for the quadrant of this direction.
    Quadrants(Vec2),
}

impl Symmetry {
    /// The symmetry implied by the azimuths of the tables (radians).
    fn of(phi: &[f32]) -> Result<Self, String> {
        let (&[first, .., last], 3..) = (phi, phi.len()) else { return Ok(Symmetry::Isotropic) };
        let middle = Vec2::from_angle(0.5 * (first + last));
        let covers = |turns: f32| ((last - first) / TAU - turns).abs() < AZIMUTH_TOLERANCE;
        if covers(1.0) {
            return Ok(Symmetry::None);
        } else if covers(0.5) {
            return Ok(Symmetry::HalfTurn(middle));
        } else if covers(0.25) && middle.abs().min_element() > 0.6 {
            return Ok(Symmetry::Quadrants(middle));
        }
        Err(format!(
            "the azimuths of its tables go from {first} to {last} rad, not over a whole, a half or a quarter turn"
        ))
    }

    /// Signs of x and y that map a direction to the range of the tables.
    fn signs(self, w: Vec3) -> Vec2 {
        let sign = |product: f32| if product < 0.0 { -1.0 } else { 1.0 };
        match self {
            Symmetry::Isotropic | Symmetry::None => Vec2::ONE,
            Symmetry::HalfTurn(middle) => Vec2::splat(sign(middle.dot(w.truncate()))),
            Symmetry::Quadrants(middle) => Vec2::new(sign(middle.x * w.x), sign(middle.y * w.y)),
        }
    }
}

/// D and σ, which normalise the colours.
#[derive(Clone, Debug)]
struct Facets {
    ndf: BilinearTables<f32>,
    sigma: BilinearTables<f32>,
}

/// The tables of a measured surface.
#[derive(Clone, Debug)]
pub struct MeasuredTables {
    /// Azimuth and polar angle of wo.
    grid: ParameterGrid,
    symmetry: Symmetry,
    /// `None` if the colours are f cos θi itself.
    facets: Option<Facets>,
    visible: PiecewiseBilinear2D,
    luminance: PiecewiseBilinear2D,
    color: BilinearTables<Rgb>,
    /// tan θ of the cone about n that contains half of the facets.
    alpha: f32,
}

impl MeasuredTables {
    /// Builds the tables from the content of a file.
    ///
    /// Returns `Err` with a message if tables are inconsistent.
    pub fn new(bsdf: MeasuredBsdf) -> Result<Self, String> {
        let symmetry = Symmetry::of(&bsdf.phi)?;
        let sizes = || "its tables do not have the sizes that they should have".to_owned();
        let grid = ParameterGrid::new([bsdf.phi, bsdf.theta]).ok_or_else(sizes)?;
        let of_all = |size: [usize; 2]| size[0] * size[1] * grid.tables();
        let is_whole = bsdf.visible.len() == of_all(bsdf.visible_size)
            && bsdf.luminance.len() == of_all(bsdf.color_size)
            && bsdf.color.len() == of_all(bsdf.color_size);
        if !is_whole {
            return Err(sizes());
        }
        // Measurement noise may be negative
        let areas = |values: Vec<f32>| values.into_iter().map(|x| x.max(0.0)).collect();
        let ndf = BilinearTables::new(bsdf.ndf_size, areas(bsdf.ndf)).ok_or_else(sizes)?;
        let sigma = BilinearTables::new(bsdf.sigma_size, areas(bsdf.sigma)).ok_or_else(sizes)?;
        Ok(MeasuredTables {
            alpha: median_slope(&ndf),
            facets: bsdf.is_relative.then_some(Facets { ndf, sigma }),
            visible: PiecewiseBilinear2D::new(bsdf.visible_size, bsdf.visible).ok_or_else(sizes)?,
            luminance: PiecewiseBilinear2D::new(bsdf.color_size, bsdf.luminance).ok_or_else(sizes)?,
            color: BilinearTables::new(bsdf.color_size, bsdf.color).ok_or_else(sizes)?,
            grid,
            symmetry,
        })
    }
}

/// tan θ of the cone about n that contains half of ∫ D cos θ; for a GGX distribution this is α.
fn median_slope(ndf: &BilinearTables<f32>) -> f32 {
    const POLAR: usize = 256;
    const AZIMUTH: usize = 32;
    let ring = |i: usize| {
        let u = (i as f32 + 0.5) / POLAR as f32;
        let around = (0..AZIMUTH).map(|j| ndf.at(&Blend::only(0), Vec2::new(u, (j as f32 + 0.5) / AZIMUTH as f32)));
        // dθ is π u du
        let theta = polar_of(u);
        around.sum::<f32>().max(0.0) * u * theta.sin() * theta.cos()
    };
    let rings: Vec<f32> = (0..POLAR).map(ring).collect();
    let half = 0.5 * rings.iter().sum::<f32>();
    let mut sum = 0.0;
    let inside = rings.iter().take_while(|&&r| {
        sum += r;
        sum < half
    });
    let alpha = polar_of(inside.count() as f32 / POLAR as f32).tan();
    if alpha > 0.0 { alpha.min(1.0) } else { 1.0 }
}

/// θ of a coordinate of the unit square.
fn polar_of(x: f32) -> f32 {
    x * x * FRAC_PI_2
}

/// The polar angle of a direction, accurate near n.
fn theta_of(w: Vec3) -> f32 {
    w.truncate().length().atan2(w.z)
}

/// The point of the unit square for a polar angle and an azimuth.
fn square(theta: f32, phi: f32) -> Vec2 {
    let turns = phi / TAU + 0.5;
    Vec2::new((theta / FRAC_PI_2).max(0.0).sqrt(), turns - turns.floor())
}

/// Measured reflection.
#[derive(Clone, Copy, Debug)]
pub struct Measured<'a> {
    /// The tables of the measurement.
    pub tables: &'a MeasuredTables,
}

/// Data for a direction wo, in the upper hemisphere and in the range of the tables.
struct Viewer {
    wo: Vec3,
    blend: Blend,
    /// Added to azimuths within the square.
    azimuth: f32,
    /// Its point in the square.
    place: Vec2,
}

impl Measured<'_> {
    fn viewer(&self, wo: Vec3) -> Viewer {
        let (theta, phi) = (theta_of(wo), wo.y.atan2(wo.x));
        let azimuth = if self.tables.symmetry == Symmetry::Isotropic { phi } else { 0.0 };
        Viewer { wo, blend: self.tables.grid.at([phi, theta]), azimuth, place: square(theta, phi) }
    }

    /// Both directions, mapped to the range of the tables; `None` if they are on different sides.
    fn folded(&self, wo: Vec3, wi: Vec3) -> Option<[Vec3; 2]> {
        let [wo, wi] = to_upper(wo, wi)?;
        let signs = self.tables.symmetry.signs(wo).extend(1.0);
        Some([wo * signs, wi * signs])
    }

    /// f cos θi (1/sr) for the normal at the point `m` of the square, whose random number is `u`.
    fn f_cos(&self, viewer: &Viewer, m: Vec2, u: Vec2) -> Rgb {
        let color = self.tables.color.at(&viewer.blend, u);
        let relative = |facets: &Facets| {
            let all = Blend::only(0);
            facets.ndf.at(&all, m) / (4.0 * facets.sigma.at(&all, viewer.place))
        };
        color * self.tables.facets.as_ref().map_or(1.0, relative)
    }

    /// Value without cosine (1/sr).
    pub fn f(&self, wo: Vec3, wi: Vec3) -> Rgb {
        let Some([wo, wi]) = self.folded(wo, wi) else { return Rgb::BLACK };
        let Some(m) = (wo + wi).try_normalize() else { return Rgb::BLACK };
        let viewer = self.viewer(wo);
        let place = square(theta_of(m), m.y.atan2(m.x) - viewer.azimuth);
        let u = self.tables.visible.invert(&viewer.blend, place);
        self.f_cos(&viewer, place, u) / wi.z
    }

    /// Density of [`Self::sample`] per steradian.
    pub fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        let Some([wo, wi]) = self.folded(wo, wi) else { return 0.0 };
        let Some(m) = (wo + wi).try_normalize() else { return 0.0 };
        let viewer = self.viewer(wo);
        let place = square(theta_of(m), m.y.atan2(m.x) - viewer.azimuth);
        let u = self.tables.visible.invert(&viewer.blend, place);
        let density = self.tables.luminance.pdf(&viewer.blend, u) * self.tables.visible.pdf(&viewer.blend, place);
        density / steradians(place.x, m, wo)
    }

    /// Samples a reflection by visible normals, in proportion to their luminance.
    pub fn sample(&self, wo: Vec3, u: [f32; 2]) -> Option<BsdfSample> {
        let side = Vec3::splat(wo.z.signum());
        let signs = self.tables.symmetry.signs(wo * side).extend(1.0);
        let viewer = self.viewer(wo * side * signs);

        // Choose a normal
        let number = self.tables.luminance.sample(&viewer.blend, Vec2::from(u));
        let normal = self.tables.visible.sample(&viewer.blend, number.p);
        let (sin, cos) = polar_of(normal.p.x).sin_cos();
        let phi = (2.0 * normal.p.y - 1.0) * PI + viewer.azimuth;
        let m = Vec3::new(sin * phi.cos(), sin * phi.sin(), cos);

        // Reflect
        let wi = reflect(viewer.wo, m);
        if viewer.wo.dot(m) <= 0.0 || wi.z <= 0.0 {
            return None;
        }
        let f = self.f_cos(&viewer, normal.p, number.p) / wi.z;
        let pdf = number.pdf * normal.pdf / steradians(normal.p.x, m, viewer.wo);
        Some(BsdfSample { f, wi: wi * signs * side, pdf, lobe: Lobe::GLOSSY | Lobe::REFLECTION, eta: 1.0 })
    }

    /// Width of the distribution of normals: the α of a GGX with the same median slope.
    pub fn alpha(&self) -> f32 {
        self.tables.alpha
    }
}

/// Jacobian: steradians of wi per area of the square of m, whose first coordinate is `x`. At n itself, where it is 0, a
/// small number that keeps densities finite.
fn steradians(x: f32, m: Vec3, wo: Vec3) -> f32 {
    let normals = 2.0 * PI * PI * x * m.truncate().length();
    normals.max(1e-12) * 4.0 * wo.dot(m)
}
