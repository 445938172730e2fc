//! A medium of any kind, and the media of a scene. Paths call [`Medium::fly`] in `integrators/vertex_search.rs` and
//! `integrators/interior.rs`, shadow segments [`Medium::transmittance`] in `direct/transmittance.rs`.

use super::flight::{EmissionLookup, EmissionLookups, Flight, FlightSampler, Segment};
use super::heterogeneous::Heterogeneous;
use super::homogeneous::Homogeneous;
use lumiris_numbers::math::{Rgb, Vec3};
use std::sync::Arc;

/// Index into [`MediumSet::media`].
pub type MediumId = u32;

/// A medium in world space.
#[derive(Clone, Debug)]
pub enum Medium {
    /// A homogeneous medium.
    Homogeneous(Homogeneous),
    /// A homogeneous medium as the interior of a material: a random walk takes light from surface to surface, and its
    /// scattering events do not count as bounces.
    Interior(Homogeneous),
    /// A heterogeneous medium in a box, with vacuum outside.
    Heterogeneous(Arc<Heterogeneous>),
}

impl Medium {
    /// Name of the kind of medium, for messages.
    pub fn kind_name(&self) -> &'static str {
        match self {
            Medium::Homogeneous(_) => "homogeneous",
            Medium::Interior(_) => "interior",
            Medium::Heterogeneous(m) => m.kind_name(),
        }
    }

    /// True if it emits light.
    pub fn is_emissive(&self) -> bool {
        match self {
            Medium::Homogeneous(m) | Medium::Interior(m) => m.is_emissive(),
            Medium::Heterogeneous(m) => m.is_emissive(),
        }
    }

    /// Asymmetry of the phase function, −1..1: the mean cosine between the directions before and after.
    #[inline]
    pub fn g(&self) -> f32 {
        match self {
            Medium::Homogeneous(m) | Medium::Interior(m) => m.g,
            Medium::Heterogeneous(m) => m.g,
        }
    }

    /// True if it is the interior of a material.
    #[inline]
    pub fn is_interior(&self) -> bool {
        matches!(self, Medium::Interior(_))
    }

    /// Bytes of its tables.
    pub fn bytes(&self) -> usize {
        match self {
            Medium::Homogeneous(_) | Medium::Interior(_) => 0,
            Medium::Heterogeneous(m) => m.bytes(),
        }
    }

    /// A flight along a segment of a path of throughput `beta`: see [`Flight`]. `focus` chooses a point of a light for
    /// equiangular sampling in homogeneous media. Heterogeneous media collect their emission by `lookups`.
    #[inline]
    pub fn fly(
        &self,
        segment: &Segment,
        beta: Rgb,
        numbers: &mut FlightSampler,
        focus: impl FnOnce() -> Option<Vec3>,
        lookups: EmissionLookups<impl Fn(&EmissionLookup) -> f32>,
    ) -> Flight {
        match self {
            Medium::Homogeneous(m) | Medium::Interior(m) => m.fly(segment, beta, numbers.first(), focus),
            Medium::Heterogeneous(m) => m.fly(segment, beta, numbers, lookups),
        }
    }

    /// An unbiased estimate of T along a segment: exact in homogeneous media, which need no random numbers; by ratio
    /// tracking [Novák et al. 2014] in heterogeneous ones.
    #[inline]
    pub fn transmittance(&self, segment: &Segment, numbers: &mut FlightSampler) -> Rgb {
        match self {
            Medium::Homogeneous(m) | Medium::Interior(m) => m.transmittance(segment.length),
            Medium::Heterogeneous(m) => m.transmittance(segment, numbers),
        }
    }
}

/// The media on the two sides of a surface, or around a point; `None` is vacuum.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Sides {
    /// The side of the geometric normal, called outside in scene files.
    pub front: Option<MediumId>,
    /// The other side.
    pub back: Option<MediumId>,
}

impl Sides {
    /// The same medium on both sides.
    #[inline]
    pub fn both(medium: Option<MediumId>) -> Self {
        Sides { front: medium, back: medium }
    }

    /// True if light that passes the surface enters another medium.
    pub fn differ(&self) -> bool {
        self.front != self.back
    }

    /// The medium on the side of a direction whose cosine to the geometric normal is `cos`.
    #[inline]
    pub fn towards(&self, cos: f32) -> Option<MediumId> {
        if cos < 0.0 { self.back } else { self.front }
    }
}

/// The media of a scene.
#[derive(Clone, Debug, Default)]
pub struct MediumSet {
    /// All media in use.
    pub media: Vec<Medium>,
    /// Their names, for messages.
    pub names: Vec<String>,
    /// The medium around the camera.
    pub camera: Option<MediumId>,
}

impl MediumSet {
    /// True if all of space is vacuum.
    #[inline]
    pub fn is_empty(&self) -> bool {
        self.media.is_empty()
    }

    /// True if any medium emits light.
    pub fn is_emissive(&self) -> bool {
        self.media.iter().any(Medium::is_emissive)
    }
}
