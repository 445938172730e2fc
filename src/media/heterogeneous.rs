//! A heterogeneous medium in a box, sampled by tentative collisions.
//!
//! Tentative collisions occur at the rate of a majorant σ̄, a bound of σ_t of all channels in a cell of a coarse grid.
//! At each tentative collision the medium is looked up, and the flight either scatters or continues (a *null
//! collision*). With σ_n = σ̄ − σ_t, the probability of scattering depends on all channels [Kutz et al. 2017]:
//!
//! P_s = Σ_c |β_c w_c| σ_s,c / Σ_c |β_c w_c| (σ_s,c + |σ_n,c|),  w ← w σ_s/(σ̄ P_s) or w σ_n/(σ̄ (1 − P_s)),
//!
//! where β_c w_c is the throughput so far. The channels that still carry energy dominate the probability, which keeps
//! the weights bounded. Absorption only reduces the weights. At every point of the segment, the weight (0 after
//! scattering) has the expectation T. Emission is therefore added at points independent of the collisions, at a rate λ:
//! w σ_a L_e/λ.
//!
//! This is unbiased for any σ̄ > 0, also where σ_t exceeds σ̄ and σ_n is negative. The estimated bounds of clouds rely
//! on this.

use super::cloud::Cloud;
use super::coefficients::Coefficients;
use super::flight::{EmissionLookup, EmissionLookups, End, Flight, FlightSampler, Segment};
use super::grid::{RgbGrid, Scalars, UniformGrid};
use super::majorants::{MajorantGrid, MajorantIterator};
use lumiris_numbers::math::{Affine3A, Bounds3, DAffine3, DVec3, Rgb, Vec3};

/// The spatially varying field.
#[derive(Clone, Debug)]
pub enum Field {
    /// A density on a grid.
    Uniform(UniformGrid),
    /// Colours on a grid.
    Rgb(RgbGrid),
    /// A procedural cloud.
    Cloud(Cloud),
}

/// A medium in a box.
#[derive(Clone, Debug)]
pub struct Heterogeneous {
    field: Field,
    /// The minimum and maximum corner, in the space of the medium.
    corners: [DVec3; 2],
    /// Transform from world space to the box as the unit cube.
    unit_from_world: Affine3A,
    world_from_unit: Affine3A,
    majorants: MajorantGrid,
    /// Asymmetry of the phase function.
    pub g: f32,
}

/// Samples along an axis per majorant.
const SAMPLES_PER_CELL: usize = 4;
/// Maximum number of majorants along an axis.
const MAX_CELLS: usize = 64;
/// Majorants of a cloud along each axis, and number of points along an axis of a cell that estimate its bound.
const CLOUD_CELLS: usize = 16;
const CLOUD_POINTS: usize = 3;
/// Margin of the estimated maximum density: a factor, and the minimum bound.
const CLOUD_MARGIN: [f32; 2] = [1.25, 0.05];
/// Weight of a shadow segment below which Russian roulette applies, and its survival probability. Roulette of paths is
/// in `integrators/roulette.rs`.
const FAINT: [f32; 2] = [0.1, 0.25];

impl Heterogeneous {
    /// A field in a box, given by the minimum and maximum corner in the space of the medium. The map to world space
    /// must be invertible.
    pub fn new(field: Field, corners: [DVec3; 2], world_from_medium: &DAffine3, g: f32) -> Self {
        let [min, max] = corners;
        let world_from_unit = *world_from_medium * DAffine3::from_translation(min) * DAffine3::from_scale(max - min);
        let [unit_from_world, world_from_unit] = [world_from_unit.inverse(), world_from_unit].map(|m| m.as_affine3a());
        let cells = |resolution: [usize; 3]| resolution.map(|n| n.div_ceil(SAMPLES_PER_CELL).clamp(1, MAX_CELLS));
        let majorants = match &field {
            Field::Uniform(grid) => {
                let sigma_t = (grid.sigma_a + grid.sigma_s).max_component();
                MajorantGrid::new(cells(grid.density.resolution()), |low, high| sigma_t * grid.density.bound(low, high))
            }
            Field::Rgb(grid) => MajorantGrid::new(cells(grid.resolution()), |low, high| grid.bound(low, high)),
            Field::Cloud(cloud) => cloud_majorants(cloud, &corners),
        };
        Heterogeneous { field, corners, unit_from_world, world_from_unit, majorants, g }
    }

    /// Name of the kind of field, for messages.
    pub fn kind_name(&self) -> &'static str {
        match &self.field {
            Field::Uniform(grid) => match grid.density {
                Scalars::Dense(_) => "uniformgrid",
                Scalars::Sparse(_) => "nanovdb",
            },
            Field::Rgb(_) => "rgbgrid",
            Field::Cloud(_) => "cloud",
        }
    }

    /// True if it emits light.
    pub fn is_emissive(&self) -> bool {
        match &self.field {
            Field::Uniform(grid) => grid.is_emissive(),
            Field::Rgb(grid) => grid.le.is_some(),
            Field::Cloud(_) => false,
        }
    }

    /// Numbers of samples along the axes of its box; of majorants for fields without samples.
    pub fn resolution(&self) -> [usize; 3] {
        match &self.field {
            Field::Uniform(grid) => grid.density.resolution(),
            Field::Rgb(grid) => grid.resolution(),
            Field::Cloud(_) => self.majorants.resolution(),
        }
    }

    /// σ_a L_e at a point of the unit cube.
    pub fn emission(&self, p: Vec3) -> Rgb {
        let Coefficients { sigma_a, le, .. } = self.at(p);
        sigma_a * le
    }

    /// Default rate of a path's emission lookups at a point of the unit cube (1/m).
    pub fn emission_lookup_rate(&self, p: Vec3) -> f32 {
        self.majorants.at(p)
    }

    /// A point of the unit cube in world space.
    pub fn world_point(&self, p: Vec3) -> Vec3 {
        self.world_from_unit.transform_point3(p)
    }

    /// A point of world space in the space of the unit cube.
    pub fn unit_point(&self, p: Vec3) -> Vec3 {
        self.unit_from_world.transform_point3(p)
    }

    /// Bounds in world space of a box in the unit cube.
    pub fn world_bounds(&self, bounds: Bounds3) -> Bounds3 {
        bounds.transformed(&self.world_from_unit)
    }

    /// Volume of its box (m³).
    pub fn volume(&self) -> f32 {
        self.world_from_unit.matrix3.determinant().abs()
    }

    /// Bytes of its samples and majorants.
    pub fn bytes(&self) -> usize {
        let field = match &self.field {
            Field::Uniform(grid) => grid.bytes(),
            Field::Rgb(grid) => grid.bytes(),
            Field::Cloud(_) => 0,
        };
        field + self.majorants.bytes()
    }

    /// The medium at a point of the unit cube.
    fn at(&self, p: Vec3) -> Coefficients {
        match &self.field {
            Field::Uniform(grid) => grid.at(p),
            Field::Rgb(grid) => grid.at(p),
            Field::Cloud(cloud) => {
                let density = cloud.density_at(point_in(&self.corners, p));
                Coefficients { sigma_a: cloud.sigma_a * density, sigma_s: cloud.sigma_s * density, le: Rgb::BLACK }
            }
        }
    }

    /// The tentative collisions along a segment. Parameters of the line are distances in world space (m).
    fn collisions(&self, segment: &Segment) -> Collisions<'_> {
        let o = self.unit_point(segment.o);
        let d = self.unit_from_world.transform_vector3(segment.d);
        let segments = self.majorants.segments(o, d, segment.length);
        Collisions { medium: self, o, d, segments, from: 0.0, to: 0.0, majorant: 0.0 }
    }

    /// The emission lookups along a segment. `offset` is the position of the first lookup in its interval;
    /// `min_rate` in 1/m.
    fn lookups(&self, segment: &Segment, min_rate: f32, offset: f32) -> LookupsAlong<'_> {
        let Collisions { o, d, segments, .. } = self.collisions(segment);
        LookupsAlong { o, d, segments, min_rate, from: 0.0, to: 0.0, rate: 0.0, left: offset, count: 0 }
    }

    /// A flight along a segment of a path of throughput `beta`; `lookups` if it is emissive.
    pub(super) fn fly(
        &self,
        segment: &Segment,
        beta: Rgb,
        numbers: &mut FlightSampler,
        EmissionLookups { min_rate, weight: mis_weight }: EmissionLookups<impl Fn(&EmissionLookup) -> f32>,
    ) -> Flight {
        // Adds the emission of the lookups up to the distance t
        let (mut weight, mut emitted) = (Rgb::WHITE, Rgb::BLACK);
        let mut collisions = self.collisions(segment);
        let mut lookups = self.is_emissive().then(|| self.lookups(segment, min_rate, numbers.offset()));
        let mut add_emission_before = |t: f32, weight: Rgb, numbers: &mut FlightSampler| {
            let Some(lookups) = &mut lookups else { return };
            while let Some(lookup) = lookups.next_before(t) {
                numbers.drawn += 1;
                let l = weight * self.emission(lookup.unit) / lookup.rate;
                if !l.is_black() {
                    emitted += l * mis_weight(&lookup);
                }
            }
        };
        let mut u = numbers.pair();
        while let Some(Collision { t, majorant, at: Coefficients { sigma_a, sigma_s, .. } }) = collisions.next(u[0]) {
            add_emission_before(t, weight, numbers);

            // Probability of scattering
            let sigma_n = (sigma_a + sigma_s).map(|sigma_t| majorant - sigma_t);
            let carried = (weight * beta).map(f32::abs);
            let sum = |v: Rgb| v.r + v.g + v.b;
            let scattered = sum(carried * sigma_s);
            let passed = sum(carried * sigma_n.map(f32::abs));
            let p = scattered / (scattered + passed);
            if !p.is_finite() {
                return Flight { emitted, end: End::Through { weight: Rgb::BLACK } };
            }
            if u[1] < p {
                return Flight { emitted, end: End::Scattered { t, weight: weight * sigma_s / (majorant * p) } };
            }
            weight = weight * sigma_n / (majorant * (1.0 - p));
            u = numbers.pair();
        }
        add_emission_before(f32::INFINITY, weight, numbers);
        Flight { emitted, end: End::Through { weight } }
    }

    /// T along a segment by ratio tracking: the product of σ_n/σ̄ over the tentative collisions [Novák et al. 2014].
    pub(super) fn transmittance(&self, segment: &Segment, numbers: &mut FlightSampler) -> Rgb {
        let mut weight = Rgb::WHITE;
        let mut collisions = self.collisions(segment);
        let mut u = numbers.pair();
        while let Some(Collision { majorant, at, .. }) = collisions.next(u[0]) {
            weight *= (at.sigma_a + at.sigma_s).map(|sigma_t| 1.0 - sigma_t / majorant);
            if weight.map(f32::abs).max_component() < FAINT[0] {
                if u[1] >= FAINT[1] {
                    return Rgb::BLACK;
                }
                weight *= 1.0 / FAINT[1];
            }
            u = numbers.pair();
        }
        weight
    }
}

/// A tentative collision.
struct Collision {
    /// Distance from the origin (m).
    t: f32,
    /// σ̄ (1/m).
    majorant: f32,
    at: Coefficients,
}

/// Tentative collisions along a line.
struct Collisions<'a> {
    medium: &'a Heterogeneous,
    /// The line in the unit cube.
    o: Vec3,
    d: Vec3,
    segments: MajorantIterator<'a>,
    /// The rest of the current part.
    from: f32,
    to: f32,
    majorant: f32,
}

impl Collisions<'_> {
    /// The next collision, at an optical depth given by `u`; `None` beyond the end of the line.
    fn next(&mut self, u: f32) -> Option<Collision> {
        let mut depth = -(-u).ln_1p();
        loop {
            let t = self.from + depth / self.majorant;
            if self.majorant > 0.0 && t < self.to {
                self.from = t;
                let at = self.medium.at(self.o + self.d * t);
                return Some(Collision { t, majorant: self.majorant, at });
            }
            depth = (depth - self.majorant * (self.to - self.from)).max(0.0);
            let part = self.segments.next()?;
            (self.from, self.to, self.majorant) = (part.begin, part.end, part.majorant);
        }
    }
}

/// Emission lookups of a flight: stratified, one in each of equal intervals, at a given rate.
struct LookupsAlong<'a> {
    /// The line in the unit cube.
    o: Vec3,
    d: Vec3,
    segments: MajorantIterator<'a>,
    /// Minimum rate where the medium is not empty (1/m).
    min_rate: f32,
    /// The current part, and its rate.
    from: f32,
    to: f32,
    rate: f32,
    /// Remaining fraction of an interval before the first lookup of the part, and the number of lookups in the part.
    left: f32,
    count: u32,
}

impl LookupsAlong<'_> {
    /// The next lookup up to the distance `end`.
    fn next_before(&mut self, end: f32) -> Option<EmissionLookup> {
        loop {
            // A lookup in the current part
            let passed = self.left + self.count as f32;
            let t = self.from + passed / self.rate;
            if self.rate > 0.0 && t < self.to {
                if t > end {
                    return None;
                }
                self.count += 1;
                return Some(EmissionLookup { t, unit: self.o + self.d * t, rate: self.rate });
            }
            if self.to > end {
                return None;
            }

            // Carry the remaining interval over to the next part
            self.left = (passed - self.rate * (self.to - self.from)).max(0.0);
            self.count = 0;
            let part = self.segments.next()?;
            let rate = if part.majorant > 0.0 { part.majorant.max(self.min_rate) } else { 0.0 };
            (self.from, self.to, self.rate) = (part.begin, part.end, rate);
        }
    }
}

/// A point of the unit cube in the box between two corners.
fn point_in(&[min, max]: &[DVec3; 2], p: Vec3) -> DVec3 {
    min + (max - min) * p.as_dvec3()
}

/// Estimated bounds: the maximum density at some points of each cell and its neighbours, with a margin.
fn cloud_majorants(cloud: &Cloud, corners: &[DVec3; 2]) -> MajorantGrid {
    let greatest = MajorantGrid::new([CLOUD_CELLS; 3], |low, high| {
        (0..CLOUD_POINTS.pow(3)).fold(0.0_f32, |greatest, i| {
            let place = [1, CLOUD_POINTS, CLOUD_POINTS.pow(2)].map(|n| (i / n % CLOUD_POINTS) as f32 + 0.5);
            let p = low + (high - low) * Vec3::from(place) / CLOUD_POINTS as f32;
            greatest.max(cloud.density_at(point_in(corners, p)))
        })
    });
    let sigma_t = (cloud.sigma_a + cloud.sigma_s).max_component();
    greatest.with_neighbors(|density| sigma_t * (density * CLOUD_MARGIN[0] + CLOUD_MARGIN[1]).min(1.0))
}
