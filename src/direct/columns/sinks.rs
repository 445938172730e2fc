//! Callbacks of the samples of a batch.

use crate::accel::RayBatch;
use crate::lights::LightId;
use lumiris_numbers::math::{Rgb, Vec3};

/// A light sample at a finite distance.
#[derive(Clone, Copy, Debug)]
pub struct SampleOnLight {
    /// Row of the vertex.
    pub row: usize,
    /// The light.
    pub light: LightId,
    /// Normal at the point on the light.
    pub n: Vec3,
    /// Unit direction to it.
    pub wi: Vec3,
}

/// A sample whose segment is unoccluded.
#[derive(Clone, Copy, Debug)]
pub struct VisibleSample {
    /// Row of the vertex.
    pub row: usize,
    /// The light; `None`: all infinite lights.
    pub light: Option<LightId>,
    /// Unit direction to it.
    pub wi: Vec3,
    /// Contribution to the light reflected at the vertex.
    pub contribution: Rgb,
}

/// MIS weight of a light sample against light paths.
pub type WeightAgainstLightPaths<'a> = dyn Fn(&SampleOnLight) -> f32 + 'a;

/// Callbacks of the samples.
#[derive(Default)]
pub struct Sinks<'a> {
    /// MIS weight of light samples against light paths, if there are any.
    pub against_light_paths: Option<&'a WeightAgainstLightPaths<'a>>,
    /// Receives the visible samples.
    pub visible: Option<&'a mut (dyn FnMut(&VisibleSample) + 'a)>,
    /// Receives copies of the segments.
    pub segments: Option<&'a mut Vec<RayBatch>>,
}
