//! Systems of spherical lenses, traced surface by surface [Kolb et al. 1995].
//!
//! The film lies in the plane z = 0, and the scene has greater z. Lengths are in metres, as in pbrt-v4. Rays from a
//! point of the film are sampled in its *exit pupil*: the part of the rear vertex plane through which light reaches
//! that point. Bounds of the exit pupils are precomputed for rings of the film. The measured quantity is the irradiance
//! E = ∫ L cos⁴θ / s² dA over the pupil, where s is the distance of the plane from the film.

use lumiris_numbers::math::{DVec2, DVec3, Vec2, Vec3};
use rayon::prelude::*;
use std::f64::consts::{FRAC_PI_4, PI};

/// Number of film rings, each with its exit pupil.
const RINGS: usize = 64;
/// Points along each edge of the search square for an exit pupil, and film positions within a ring.
const SEARCH: [usize; 2] = [96, 3];
/// Half the edge of the search square, relative to the radius of the rear surface.
const SEARCHED: f64 = 1.5;

/// A surface of a lens system.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LensElement {
    /// Radius of curvature (m): positive if the centre is on the film side; 0 for the aperture stop.
    pub curvature_radius: f64,
    /// Distance to the next surface on the film side (m).
    pub thickness: f64,
    /// Index of refraction of the medium up to that surface; 0 and 1 are air.
    pub eta: f64,
    /// Radius of the opening (m).
    pub aperture_radius: f64,
}

/// Transmission of the stop within its radius.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Aperture {
    /// Everything.
    #[default]
    Circle,
    /// Transmission that decreases towards the edge.
    Gaussian,
    /// A star-shaped polygon around the centre: its corners, in order.
    Polygon(Vec<[f64; 2]>),
    /// Transmission by an image: its texels over −1..1 in both directions, rows from the top.
    Image(Vec<f32>, [usize; 2]),
}

/// A ray that has left the lenses.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LensRay {
    /// Origin, on the front surface (m).
    pub o: Vec3,
    /// Unit direction.
    pub d: Vec3,
    /// cos⁴θ/s² times the transmission of the stop, over the density of the pupil point. 0 if the lenses block the
    /// light; the ray is then the ray through the middle of the pupil.
    pub weight: f32,
}

/// An exit pupil for a ring of the film, at the intersection of the ring with the x axis.
#[derive(Clone, Copy, Debug)]
struct Pupil {
    min: DVec2,
    max: DVec2,
    /// The mean of the points that transmit light.
    middle: DVec2,
}

/// A lens system in front of a film, in focus.
#[derive(Clone, Debug)]
pub struct LensSystem {
    /// Surfaces from front to rear.
    elements: Vec<LensElement>,
    /// Distances of the vertices from the film.
    z: Vec<f64>,
    aperture: Aperture,
    /// Factor of the weights that gives all aperture shapes the same total transmission as a circle.
    aperture_scale: f64,
    /// Half the diagonal of the film.
    film_radius: f64,
    focal_length: f64,
    /// Distance of the film from the principal plane.
    image_distance: f64,
    pupils: Vec<Pupil>,
}

/// Light that a lens system transmits along a ray.
struct Transmitted {
    /// The ray in front of the lenses, with weight 0.
    ray: LensRay,
    /// cos⁴θ/s² of the ray behind the lenses.
    form_factor: f64,
    /// Transmission of the stop.
    transmission: f64,
}

/// A ray that leaves the front surface.
struct Exit {
    p: DVec3,
    d: DVec3,
    /// Transmission of the stop.
    transmission: f64,
}

impl LensSystem {
    /// Positions the film such that points at `focus_distance` (m, from the film) are in focus near the axis.
    /// `diagonal` is the diagonal of the film (m).
    ///
    /// Returns `Err` with a message if the lenses are invalid or cannot focus.
    pub fn new(
        elements: &[LensElement],
        aperture: Aperture,
        focus_distance: f64,
        diagonal: f64,
    ) -> Result<Self, String> {
        check(elements)?;
        let [a, b, c, d] = paraxial(elements);
        if c >= 0.0 {
            return Err("the lenses do not collect light: they have no positive focal length".to_owned());
        }
        // Film at s, point at `gap` − s before the front: A s + B + (gap − s)(C s + D) = 0
        let depth: f64 = elements[..elements.len() - 1].iter().map(|e| e.thickness).sum();
        let gap = focus_distance - depth;
        let (half, rest) = (0.5 * (a + gap * c - d), b + gap * d);
        let root = half * half + c * rest;
        if !(root >= 0.0) {
            return Err(format!("{focus_distance} m is too near to be in focus"));
        }
        let at_infinity = -d / c;
        let roots = [1.0, -1.0].map(|sign| (half + sign * root.sqrt()) / c);
        let s = roots.into_iter().min_by(|x, y| (x - at_infinity).abs().total_cmp(&(y - at_infinity).abs()));
        let s = s.filter(|s| *s > 0.0 && gap > *s).ok_or_else(|| format!("{focus_distance} m cannot be in focus"))?;
        let mut z = vec![s; elements.len()];
        for i in (0..elements.len() - 1).rev() {
            z[i] = z[i + 1] + elements[i].thickness;
        }
        let mut system = LensSystem {
            elements: elements.to_vec(),
            z,
            aperture_scale: aperture.scale(),
            aperture,
            film_radius: 0.5 * diagonal,
            focal_length: -1.0 / c,
            image_distance: s - at_infinity - 1.0 / c,
            pupils: Vec::new(),
        };
        system.pupils = (0..RINGS).into_par_iter().map(|ring| system.pupil(ring)).collect();
        if system.pupils[0].max.x < system.pupils[0].min.x {
            return Err("no light passes the lenses".to_owned());
        }
        Ok(system)
    }

    /// Focal length (m).
    pub fn focal_length(&self) -> f64 {
        self.focal_length
    }

    /// A ray from the film point (x, y) through the point of the exit pupil given by `u`.
    pub fn sample(&self, film: Vec2, u: [f32; 2]) -> LensRay {
        let film = film.as_dvec2();
        let r = film.length();
        let pupil = &self.pupils[((r / self.film_radius * RINGS as f64) as usize).min(RINGS - 1)];
        let u = DVec2::from(u.map(f64::from));
        let size = pupil.max - pupil.min;
        if let Some(Transmitted { ray, form_factor, transmission }) = self.through(film, pupil.min + u * size) {
            let weight = form_factor * size.x * size.y * transmission;
            return LensRay { weight: weight as f32, ..ray };
        }
        let middle = self.through(film, pupil.middle).map(|transmitted| transmitted.ray);
        middle.unwrap_or(LensRay { o: Vec3::Z * self.z[0] as f32, d: Vec3::Z, weight: 0.0 })
    }

    /// Angle between the rays of film points 1 m apart around (x, y), by linearisation (radians).
    pub fn spread(&self, film: Vec2) -> f32 {
        let tangent = f64::from(film.length()) / self.image_distance;
        self.spread_towards((1.0 / (1.0 + tangent * tangent).sqrt()) as f32)
    }

    /// The same for points in a direction at the cosine `cos` to the axis.
    pub fn spread_towards(&self, cos: f32) -> f32 {
        (f64::from(cos).powf(1.5) / self.image_distance) as f32
    }

    /// The light from a film point through a point of the rear plane. `rear` is given for film points on the x axis and
    /// is rotated to this one.
    fn through(&self, film: DVec2, rear: DVec2) -> Option<Transmitted> {
        let r = film.length();
        let axis = if r > 0.0 { film / r } else { DVec2::X };
        let (o, rear) = (film.extend(0.0), axis.rotate(rear).extend(self.rear()));
        let d = (rear - o).normalize();
        let Exit { p, d: out, transmission } = self.trace(o, d)?;
        let ray = LensRay { o: p.as_vec3(), d: out.as_vec3().normalize(), weight: 0.0 };
        Some(Transmitted { ray, form_factor: d.z.powi(4) / (self.rear() * self.rear()), transmission })
    }

    /// Distance of the rear surface's vertex from the film.
    fn rear(&self) -> f64 {
        self.z[self.z.len() - 1]
    }

    /// Traces a ray from the film to the front surface.
    fn trace(&self, mut o: DVec3, mut d: DVec3) -> Option<Exit> {
        let mut transmission = 1.0;
        for (i, element) in self.elements.iter().enumerate().rev() {
            let (z, radius) = (self.z[i], element.curvature_radius);
            let t = if radius == 0.0 { (z - o.z) / d.z } else { at_sphere(o, d, z - radius, radius)? };
            if t < 0.0 {
                return None;
            }

            // Vignetting by the rim
            o += d * t;
            if o.truncate().length_squared() > element.aperture_radius * element.aperture_radius {
                return None;
            }
            if radius == 0.0 {
                transmission *= self.aperture.at(o.truncate() / element.aperture_radius) * self.aperture_scale;
                if transmission == 0.0 {
                    return None;
                }
                continue;
            }

            // Refraction
            let n = (DVec3::Z * (z - radius) - o) / radius;
            let [from, to] = [element.eta, self.eta_before(i)];
            d = refract(d, if n.dot(d) < 0.0 { n } else { -n }, from.max(1.0) / to)?;
        }
        Some(Exit { p: o, d, transmission })
    }

    /// Index of refraction on the scene side of a surface.
    fn eta_before(&self, i: usize) -> f64 {
        if i == 0 { 1.0 } else { self.elements[i - 1].eta.max(1.0) }
    }

    /// The exit pupil of a ring of the film. It has a negative size if no light passes.
    fn pupil(&self, ring: usize) -> Pupil {
        let half = DVec2::splat(SEARCHED * self.elements[self.elements.len() - 1].aperture_radius);
        let everywhere = Pupil { min: -half, max: half, middle: DVec2::ZERO };
        // For a narrow stop, the first search finds few points; the second one refines around them
        let found = self.search(ring, &everywhere).and_then(|near| self.search(ring, &near));
        found.unwrap_or(Pupil { min: DVec2::ZERO, max: DVec2::NEG_INFINITY, middle: DVec2::ZERO })
    }

    /// Bounds of the points in a rectangle of the rear plane that transmit light to a ring.
    fn search(&self, ring: usize, within: &Pupil) -> Option<Pupil> {
        let cell = (within.max - within.min) / SEARCH[0] as f64;
        let (mut min, mut max, mut sum, mut count) = (DVec2::INFINITY, DVec2::NEG_INFINITY, DVec2::ZERO, 0.0);
        for place in 0..SEARCH[1] {
            let fraction = (ring as f64 + place as f64 / (SEARCH[1] - 1) as f64) / RINGS as f64;
            let film = DVec2::X * fraction * self.film_radius;
            for k in 0..SEARCH[0] * SEARCH[0] {
                let cells = DVec2::new((k % SEARCH[0]) as f64 + 0.5, (k / SEARCH[0]) as f64 + 0.5);
                let at = within.min + cells * cell;
                if self.through(film, at).is_some() {
                    (min, max, sum, count) = (min.min(at), max.max(at), sum + at, count + 1.0);
                }
            }
        }
        // The search is exact up to one cell
        (count > 0.0).then(|| Pupil { min: min - cell, max: max + cell, middle: sum / count })
    }
}

impl Aperture {
    /// An aperture shape by its name in pbrt-v4.
    pub fn named(name: &str) -> Option<Self> {
        let polygon = |corners: usize, radii: [f64; 2], turn: f64| {
            let corner = |i: usize| {
                let (sin, cos) = (2.0 * PI * i as f64 / corners as f64 + turn).sin_cos();
                [cos * radii[i % 2], sin * radii[i % 2]]
            };
            Aperture::Polygon((0..corners).map(corner).collect())
        };
        Some(match name {
            "circle" => Aperture::Circle,
            "gaussian" => Aperture::Gaussian,
            "square" => polygon(4, [1.0, 1.0], FRAC_PI_4),
            "pentagon" => polygon(5, [1.0, 1.0], 0.5 * PI),
            "star" => polygon(10, [1.0, 0.382], 0.5 * PI),
            _ => return None,
        })
    }

    /// The names of all shapes.
    pub const NAMES: [&str; 5] = ["circle", "gaussian", "square", "pentagon", "star"];

    /// The transmission at a point of the unit disk.
    fn at(&self, p: DVec2) -> f64 {
        match self {
            Aperture::Circle => 1.0,
            Aperture::Gaussian => (-2.0 * p.length_squared() / 0.64).exp(),
            Aperture::Polygon(corners) => {
                let edges = corners.iter().zip(corners.iter().cycle().skip(1));
                let crosses = |([ax, ay], [bx, by]): &(&[f64; 2], &[f64; 2])| {
                    (ay > &p.y) != (by > &p.y) && p.x < ax + (p.y - ay) / (by - ay) * (bx - ax)
                };
                f64::from(u8::from(edges.filter(crosses).count() % 2 == 1))
            }
            Aperture::Image(texels, [width, height]) => {
                let at = |x: f64, n: usize| (((x + 1.0) * 0.5 * n as f64).max(0.0) as usize).min(n - 1);
                f64::from(texels[at(-p.y, *height) * width + at(p.x, *width)].max(0.0))
            }
        }
    }

    /// Ratio of a circle's total transmission to this shape's; 1 if the shape is opaque.
    fn scale(&self) -> f64 {
        const POINTS: usize = 512;
        let place = |i: usize| (i as f64 + 0.5) / POINTS as f64 * 2.0 - 1.0;
        let disk = (0..POINTS * POINTS).map(|k| DVec2::new(place(k % POINTS), place(k / POINTS)));
        let (all, passed) =
            disk.filter(|p| p.length_squared() <= 1.0).fold((0.0, 0.0), |(n, s), p| (n + 1.0, s + self.at(p)));
        if passed > 0.0 && *self != Aperture::Circle { all / passed } else { 1.0 }
    }
}

/// Returns `Err` with a message if a surface is invalid.
fn check(elements: &[LensElement]) -> Result<(), String> {
    if elements.is_empty() {
        return Err("there are no surfaces".to_owned());
    }
    // Numbers of each surface
    for (i, e) in elements.iter().enumerate() {
        let values = [e.curvature_radius, e.thickness, e.eta, e.aperture_radius];
        let is_right = values.iter().all(|v| v.is_finite())
            && e.thickness >= 0.0
            && e.aperture_radius > 0.0
            && (e.eta == 0.0 || e.eta >= 1.0)
            && (e.curvature_radius == 0.0 || e.aperture_radius <= e.curvature_radius.abs());
        if !is_right {
            return Err(format!(
                "surface {} has impossible numbers: thickness is not negative, the index of refraction 0 or at least 1, the diameter \
                 positive and at most twice the radius of curvature",
                i + 1
            ));
        }
    }

    // Surfaces without curvature are aperture stops
    match elements.iter().filter(|e| e.curvature_radius == 0.0).count() {
        0 | 1 => Ok(()),
        n => Err(format!("there are {n} aperture stops; a lens has one")),
    }
}

/// The paraxial matrix [A, B, C, D] that takes (height, angle) at the rear surface to the front surface.
fn paraxial(elements: &[LensElement]) -> [f64; 4] {
    let mut m = [1.0, 0.0, 0.0, 1.0];
    for (i, e) in elements.iter().enumerate().rev() {
        if i + 1 < elements.len() {
            m = [m[0] + e.thickness * m[2], m[1] + e.thickness * m[3], m[2], m[3]];
        }
        if e.curvature_radius != 0.0 {
            let from = e.eta.max(1.0);
            let to = if i == 0 { 1.0 } else { elements[i - 1].eta.max(1.0) };
            let power = (to - from) / (to * e.curvature_radius);
            m = [m[0], m[1], m[2] * from / to + power * m[0], m[3] * from / to + power * m[1]];
        }
    }
    m
}

/// Ray parameter of the intersection with a sphere around (0, 0, `center`), on the side of its vertex.
fn at_sphere(o: DVec3, d: DVec3, center: f64, radius: f64) -> Option<f64> {
    let to = o - DVec3::Z * center;
    let b = to.dot(d);
    let root = b * b - to.length_squared() + radius * radius;
    // If the vertex points to the scene, take the exit of the sphere
    (root >= 0.0).then(|| -b + root.sqrt().copysign(radius))
}

/// The refracted direction. `n` points against `d`; `eta` is the ratio of the indices. `None` for total reflection.
fn refract(d: DVec3, n: DVec3, eta: f64) -> Option<DVec3> {
    let cos = -d.dot(n);
    let root = 1.0 - eta * eta * (1.0 - cos * cos);
    (root >= 0.0).then(|| d * eta + n * (eta * cos - root.sqrt()))
}

#[cfg(test)]
#[path = "lens_system_tests.rs"]
mod tests;
