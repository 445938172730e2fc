//! Free flights: segments, random numbers, and what comes of a flight.
//!
//! A flight either passes the segment, or ends by scattering. Its weight w has the expectation that transport asks for:
//! E[w; passes] = T, and E[w; scatters in dt] = T σ_s dt, per channel. So beyond a segment a path carries an estimate of T,
//! as a shadow segment does; the density of a *direction* is the same whether there is a medium or not. Multiple
//! importance sampling of light and BSDF or phase function weights by these densities alone: the weights of the two
//! techniques add up to 1 for every direction, and each technique estimates the same f·L·T.

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

/// What comes of a flight along a segment.
#[derive(Clone, Copy, Debug)]
pub struct Flight {
    /// Estimate of the light that the medium sends out along the whole segment, weakened on its way to the origin.
    pub emitted: Rgb,
    /// How it ends.
    pub end: End,
}

/// A place where a flight through a medium that varies looks for what it sends out.
#[derive(Clone, Copy, Debug)]
pub struct Glimpse {
    /// Distance from the origin (m).
    pub t: f32,
    /// The point in the unit cube of the medium.
    pub unit: Vec3,
    /// Rate of such places (1/m).
    pub rate: f32,
}

/// How a flight ends.
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

/// The random numbers of a flight: the first ones well distributed over the samples of a pixel, later ones independent.
#[derive(Clone, Copy, Debug)]
pub struct Numbers {
    stream: SampleStream,
    rest: Option<HashStream>,
    /// How many pairs were drawn: tentative collisions, each a lookup of the medium, and ends of lines.
    pub drawn: u32,
}

/// Domain of the numbers of later collisions.
const REST: u32 = 1;
/// Domain of the places of glimpses.
const GLIMPSES: u32 = 2;

impl Numbers {
    /// Those of a place in the tree of random numbers.
    #[inline]
    pub fn new(stream: SampleStream) -> Self {
        Numbers { stream, rest: None, drawn: 0 }
    }

    /// Four numbers in [0, 1), of a flight that needs no others.
    #[inline]
    pub fn first(&self) -> [f32; 4] {
        self.stream.draw::<4>()
    }

    /// A number in [0, 1) for the places of glimpses.
    #[inline]
    pub fn offset(&self) -> f32 {
        self.stream.domain(GLIMPSES).draw::<1>()[0]
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
