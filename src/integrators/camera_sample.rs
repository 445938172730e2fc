//! A camera sample: the beginning of a path.

use crate::cameras::CameraRay;
use crate::settings::SampleCounts;
use lumiris_numbers::samplers::SampleStream;

/// A camera sample to be traced.
#[derive(Clone, Copy, Debug)]
pub struct CameraSample {
    /// Its ray.
    pub ray: CameraRay,
    /// Weight of the pixel filter times weight of the camera.
    pub weight: f32,
    /// Its random numbers.
    pub stream: SampleStream,
    /// Random numbers of direct light. Progressive estimators use a new stream for every block of samples, so that a
    /// block is independent of earlier blocks.
    pub direct: SampleStream,
    /// Sample counts at its first vertex.
    pub sample_counts: SampleCounts,
    /// Share group ([`crate::scene::PixelSamples::share_group`]). Samples with the same group may share paths, and use
    /// the same light paths.
    pub share_group: u32,
    /// Index of the fit of its pixel.
    pub fit: u32,
    /// Its pixel; arbitrary for rays that belong to no pixel.
    pub pixel: [u32; 2],
    /// True if the sample belongs to a replica: a second estimate of its pixel, used to estimate the variance.
    pub is_replica: bool,
}

impl CameraSample {
    /// The sample of a ray that belongs to no pixel.
    #[inline]
    pub fn of_ray(ray: CameraRay, weight: f32, stream: SampleStream, sample_counts: SampleCounts) -> Self {
        let (share_group, fit, pixel, is_replica) = (0, 0, [0; 2], false);
        CameraSample { ray, weight, stream, direct: stream, sample_counts, share_group, fit, pixel, is_replica }
    }
}
