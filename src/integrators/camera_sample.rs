//! Camera samples: the beginnings of paths. `CameraSampler` draws them.

use crate::accel::RayBatch;
use crate::cameras::CameraRay;
use crate::settings::SampleCounts;
use lumiris_numbers::samplers::{SampleStream, StreamColumns};

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
}

impl CameraSample {
    /// The sample of a ray that belongs to no pixel.
    #[inline]
    pub fn of_ray(ray: CameraRay, weight: f32, stream: SampleStream, sample_counts: SampleCounts) -> Self {
        CameraSample { ray, weight, stream, direct: stream, sample_counts, share_group: 0, fit: 0, pixel: [0; 2] }
    }
}

/// The camera samples of a batch in columns; see [`CameraSample`].
#[derive(Clone, Debug, Default)]
pub struct CameraSamples {
    /// Rays.
    pub rays: RayBatch,
    /// Growth of the pixel width per unit length of the ray.
    pub spread: Vec<f32>,
    /// Pixel width at the origin of the ray.
    pub width0: Vec<f32>,
    /// Weights of the pixel filter times weights of the camera.
    pub weight: Vec<f32>,
    /// Random numbers.
    pub streams: StreamColumns,
    /// Random numbers of direct light; empty if they are [`Self::streams`].
    pub direct: StreamColumns,
    /// Sample counts at the first vertices.
    pub sample_counts: Vec<SampleCounts>,
    /// Share groups.
    pub share_group: Vec<u32>,
    /// Indices of the fits of the pixels.
    pub fit: Vec<u32>,
    /// Pixels.
    pub pixel: Vec<[u32; 2]>,
    /// True if the samples belong to replicas: second estimates of their pixels, used to estimate the variance.
    pub are_replicas: bool,
}

impl CameraSamples {
    /// Number of samples.
    pub fn len(&self) -> usize {
        self.weight.len()
    }

    /// True if there are no samples.
    pub fn is_empty(&self) -> bool {
        self.weight.is_empty()
    }

    /// Removes all samples, which belong to no replicas from now on.
    pub fn clear(&mut self) {
        let CameraSamples { rays, spread, width0, weight, streams, direct, .. } = self;
        rays.clear();
        [spread, width0, weight].into_iter().for_each(Vec::clear);
        [streams, direct].into_iter().for_each(StreamColumns::clear);
        self.sample_counts.clear();
        [&mut self.share_group, &mut self.fit].into_iter().for_each(Vec::clear);
        self.pixel.clear();
        self.are_replicas = false;
    }

    /// Adds a sample.
    pub fn push(&mut self, sample: &CameraSample) {
        // The first stream of its own for direct light
        let has_own = sample.direct != sample.stream;
        if has_own && self.direct.is_empty() {
            self.direct.copy_from(&self.streams);
        }
        if has_own || !self.direct.is_empty() {
            self.direct.extend([sample.direct].iter());
        }
        self.streams.extend([sample.stream].iter());

        let CameraRay { ray, spread, width0, .. } = &sample.ray;
        self.rays.push(ray);
        self.spread.push(*spread);
        self.width0.push(*width0);
        self.weight.push(sample.weight);
        self.sample_counts.push(sample.sample_counts);
        self.share_group.push(sample.share_group);
        self.fit.push(sample.fit);
        self.pixel.push(sample.pixel);
    }

    /// Sample `i`. The weight of its ray is included in [`CameraSample::weight`].
    pub fn get(&self, i: usize) -> CameraSample {
        let (spread, width0) = (self.spread[i], self.width0[i]);
        let stream = self.streams.get(i);
        CameraSample {
            ray: CameraRay { ray: self.rays.get(i), spread, width0, weight: 1.0 },
            weight: self.weight[i],
            stream,
            direct: if self.direct.is_empty() { stream } else { self.direct.get(i) },
            sample_counts: self.sample_counts[i],
            share_group: self.share_group[i],
            fit: self.fit[i],
            pixel: self.pixel[i],
        }
    }
}

impl Extend<CameraSample> for CameraSamples {
    fn extend<I: IntoIterator<Item = CameraSample>>(&mut self, samples: I) {
        samples.into_iter().for_each(|sample| self.push(&sample));
    }
}

impl FromIterator<CameraSample> for CameraSamples {
    fn from_iter<I: IntoIterator<Item = CameraSample>>(samples: I) -> Self {
        let mut columns = CameraSamples::default();
        columns.extend(samples);
        columns
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lumiris_numbers::math::{Ray, Vec3};
    use lumiris_numbers::samplers::SamplerKind;

    #[test]
    fn columns_hold_all_of_each_sample() {
        let stream = |i| SampleStream::new(SamplerKind::Sobol, [i, 1], i, 5);
        let sample = |i: u32| {
            let x = i as f32;
            let ray = Ray { o: Vec3::splat(x), d: Vec3::new(x, 1.0, 2.0), t_max: 3.0 + x, time: 0.25 * x };
            let ray = CameraRay { ray, spread: 0.5 * x, width0: x + 7.0, weight: 1.0 };
            let counts = SampleCounts { samples: i, ..SampleCounts::default() };
            let of_ray = CameraSample::of_ray(ray, 2.0 * x, stream(i), counts);
            CameraSample { share_group: i + 3, fit: i + 4, pixel: [i, i + 1], ..of_ray }
        };

        // The third has a stream of its own for direct light
        let all = [0, 1, 2, 3].map(|i| CameraSample { direct: stream(if i == 2 { 9 } else { i }), ..sample(i) });
        let columns: CameraSamples = all.into_iter().collect();
        assert!(columns.len() == 4 && columns.direct.len() == 4);
        for (i, sample) in all.iter().enumerate() {
            assert_eq!(format!("{:?}", columns.get(i)), format!("{sample:?}"));
        }
        let plain: CameraSamples = (0..4).map(sample).collect();
        assert!(plain.direct.is_empty() && format!("{:?}", plain.get(3)) == format!("{:?}", sample(3)));
    }
}
