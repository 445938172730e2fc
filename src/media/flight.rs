//! Free flights: segments, random numbers, and results.
//!
//! A flight either passes the segment or ends by scattering. Its weight w satisfies, per channel, E[w; passes] = T and
//! E[w; scatters in dt] = T σ_s dt. Beyond a segment, a path therefore carries an estimate of T, as a shadow segment
//! does. The density of a *direction* does not depend on the medium. MIS weights of light sampling and BSDF (or phase
//! function) sampling use these densities only: they add up to 1 for every direction, and each technique estimates the
//! same f·L·T.

use lumiris_numbers::math::hash::HashStream;
use lumiris_numbers::math::{Rgb, Vec3};
use lumiris_numbers::samplers::SampleStream;

/// A part of a ray.
#[derive(Clone, Copy, Debug)]
pub struct Segment {
    /// Its origin.
    pub o: Vec3,
    /// Its direction, unit.
    pub d: Vec3,
    /// Its length (m), which may be infinite.
    pub length: f32,
}

/// The result of a flight along a segment.
#[derive(Clone, Copy, Debug)]
pub struct Flight {
    /// Estimate of the medium's emission along the whole segment, attenuated on its way to the origin.
    pub emitted: Rgb,
    /// Its end.
    pub end: End,
}

/// An emission lookup of a flight through a heterogeneous medium.
#[derive(Clone, Copy, Debug)]
pub struct EmissionLookup {
    /// Distance from the origin (m).
    pub t: f32,
    /// The point in the unit cube of the medium.
    pub unit: Vec3,
    /// Rate of the lookups (1/m).
    pub rate: f32,
}

/// How a flight collects the emission of a heterogeneous medium.
#[derive(Clone, Copy, Debug)]
pub struct EmissionLookups<F> {
    /// Minimum rate of the lookups (1/m); it is otherwise the rate of the majorant.
    pub min_rate: f32,
    /// MIS weight of a lookup, if another technique also samples the emission.
    pub weight: F,
}

impl EmissionLookups<fn(&EmissionLookup) -> f32> {
    /// Lookups without weights, at the rate of the majorant.
    pub const UNWEIGHTED: Self = EmissionLookups { min_rate: 0.0, weight: |_| 1.0 };
}

/// The end of a flight.
#[derive(Clone, Copy, Debug)]
pub enum End {
    /// It passes.
    Through {
        /// Factor of the throughput.
        weight: Rgb,
    },
    /// It is scattered.
    Scattered {
        /// Distance from the origin (m).
        t: f32,
        /// Factor of the throughput, without the phase function.
        weight: Rgb,
    },
}

/// The random numbers of a flight. The first ones are well distributed over the samples of a pixel, later ones are
/// independent.
#[derive(Clone, Copy, Debug)]
pub struct FlightSampler {
    stream: SampleStream,
    rest: Option<HashStream>,
    /// Number of pairs drawn: one per tentative collision (a lookup of the medium) or end of a line.
    pub drawn: u32,
}

/// Domain of the random numbers of later collisions.
const REST: u32 = 1;
/// Domain of the offsets of emission lookups.
const EMISSION_LOOKUPS: u32 = 2;

impl FlightSampler {
    /// The random numbers of a stream.
    #[inline]
    pub fn new(stream: SampleStream) -> Self {
        FlightSampler { stream, rest: None, drawn: 0 }
    }

    /// Four numbers in [0, 1), for flights that need no more.
    #[inline]
    pub fn first(&self) -> [f32; 4] {
        self.stream.draw::<4>()
    }

    /// A number in [0, 1) for the offset of emission lookups.
    #[inline]
    pub fn offset(&self) -> f32 {
        self.stream.domain(EMISSION_LOOKUPS).draw::<1>()[0]
    }

    /// Two numbers in [0, 1).
    #[inline]
    pub fn pair(&mut self) -> [f32; 2] {
        self.drawn += 1;
        if let Some(rest) = &mut self.rest {
            return rest.next_2d();
        }
        self.rest = Some(HashStream::new(self.stream.domain(REST).draw::<3>().map(f32::to_bits)));
        self.stream.draw::<2>()
    }
}
