//! The records, and octrees for their lookup.

use super::gradients::Irradiance;
use super::octree::Octree;
use super::record::{Range, Record};
use crate::settings::IrradianceCacheSettings;
use lumiris_numbers::math::{Bounds3, Rgb, Vec3};

/// Maximum number of records: about 400 MB with the trees.
pub const MAX_RECORDS: usize = 1 << 20;

/// The records of a scene. Lookups depend on the records and on the order in which they were added.
#[derive(Clone, Debug)]
pub struct IrradianceCache {
    settings: IrradianceCacheSettings,
    records: Vec<Record>,
    ranges: Vec<Range>,
    /// Spheres of radius a, for interpolation.
    reaches: Octree,
    /// Spheres of radius R, for clamping.
    radii: Octree,
}

impl IrradianceCache {
    /// An empty cache.
    pub fn new(settings: IrradianceCacheSettings, bounds: &Bounds3) -> Self {
        IrradianceCache {
            settings,
            records: Vec::new(),
            ranges: Vec::new(),
            reaches: Octree::new(bounds),
            radii: Octree::new(bounds),
        }
    }

    /// The records, in the order in which they were added.
    pub fn records(&self) -> &[Record] {
        &self.records
    }

    /// The settings of the cache.
    pub fn settings(&self) -> &IrradianceCacheSettings {
        &self.settings
    }

    /// True if the maximum number of records is reached.
    pub fn is_full(&self) -> bool {
        self.records.len() >= MAX_RECORDS
    }

    /// Bytes of records and trees.
    pub fn bytes(&self) -> usize {
        self.records.len() * (size_of::<Record>() + size_of::<Range>()) + self.reaches.bytes() + self.radii.bytes()
    }

    /// Irradiance at a point with the normal `n`, interpolated from all usable records; `None` if there are none.
    #[inline]
    pub fn irradiance(&self, p: Vec3, n: Vec3) -> Option<Rgb> {
        let (mut sum, mut weights) = (Rgb::BLACK, 0.0);
        self.reaches.at_point(p, |id| {
            let error = self.ranges[id as usize].error(self.settings.error, p, n);
            if error < 1.0 {
                let weight = 1.0 - error;
                sum += self.records[id as usize].extrapolate(p, n) * weight;
                weights += weight;
            }
        });
        (weights > 0.0).then(|| sum / weights)
    }

    /// True if the point has a record with an error of at most `error`.
    #[inline]
    pub fn serves(&self, p: Vec3, n: Vec3, error: f32) -> bool {
        let mut found = false;
        self.reaches.at_point(p, |id| {
            found |= self.ranges[id as usize].error(self.settings.error, p, n) <= error;
        });
        found
    }

    /// Adds a record, unless the cache is full. Radii are clamped so that R_i ≤ R_j + |x_i − x_j| for all pairs
    /// [Křivánek et al. 2006]. So if one record detects a near surface, neighbours that may have missed it do not
    /// extend beyond it.
    pub fn insert(&mut self, mut record: Record) {
        if self.is_full() {
            return;
        }

        // Limit the radius by the range of a, then by the neighbours
        let [min, max] = self.settings.radius;
        record.radius = record.radius.min(max.max(min) * record.pixel_width / self.settings.error);
        let mut nearby = Vec::new();
        self.radii.near(record.p, record.radius, |id| nearby.push(id));

        // Limit the radii of the neighbours
        for &id in &nearby {
            let other = &self.records[id as usize];
            record.radius = record.radius.min(other.radius + record.p.distance(other.p));
        }
        for &id in &nearby {
            let other = &mut self.records[id as usize];
            let limit = record.radius + record.p.distance(other.p);
            if other.radius > limit {
                other.radius = limit;
                self.ranges[id as usize].reach = other.reach(&self.settings);
            }
        }

        // Store the record
        let id = self.records.len() as u32;
        let reach = record.reach(&self.settings);
        limit_gradients(&mut record.light, reach, self.settings.error);
        self.radii.insert(id, record.p, record.radius.max(reach));
        self.reaches.insert(id, record.p, reach);
        self.ranges.push(Range { p: record.p, n: record.n, reach });
        self.records.push(record);
    }
}

/// Gradients from few samples are noisy. The change within the radius of a record is clamped to the value itself.
fn limit_gradients(light: &mut Irradiance, reach: f32, error: f32) {
    // √(1 − cos α) = κ at α ≈ √2 κ
    let turn = std::f32::consts::SQRT_2 * error;
    for c in 0..3 {
        for (gradient, step) in [(&mut light.translation[c], reach), (&mut light.rotation[c], turn)] {
            let change = gradient.length() * step;
            if change > light.e[c] {
                *gradient *= light.e[c] / change;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lumiris_numbers::math::warp::sample_uniform_sphere;
    use lumiris_test_support::random::{RngExt, pcg32};

    fn unit_box() -> Bounds3 {
        Bounds3 { min: Vec3::ZERO, max: Vec3::ONE }
    }

    fn record(p: Vec3, radius: f32, e: f32) -> Record {
        let light = Irradiance { e: Rgb::splat(e), ..Irradiance::default() };
        Record { p, n: Vec3::Z, light, radius, pixel_width: 0.01, pixel: [0, 0] }
    }

    #[test]
    fn radii_obey_the_triangle_inequality() {
        let settings = IrradianceCacheSettings { radius: [0.0, 1000.0], ..Default::default() };
        let mut cache = IrradianceCache::new(settings, &unit_box());

        // Random records, some of them with small radii
        let mut s = pcg32([5, 6, 7]);
        let mut asked = Vec::new();
        for _ in 0..400 {
            let p = Vec3::new(s.random::<f32>(), s.random::<f32>(), 0.1 * s.random::<f32>());
            let radius = if s.random::<f32>() < 0.05 { 0.01 } else { 2.0 * s.random::<f32>() };
            asked.push(radius);
            cache.insert(record(p, radius, 1.0));
        }

        // The inequality holds for all pairs
        let (mut tight, records) = (0, cache.records());
        for (a, &asked) in records.iter().zip(&asked) {
            assert!(a.radius <= asked);
            for b in records {
                let limit = b.radius + a.p.distance(b.p);
                assert!(a.radius <= limit * (1.0 + 1e-5), "{} above {limit}", a.radius);
            }
            tight += usize::from(a.radius < asked);
        }
        assert!(tight > 300, "most are clamped: {tight}");
        for (r, range) in records.iter().zip(&cache.ranges) {
            assert_eq!(r.reach(&settings), range.reach, "ranges follow the radii");
        }
    }

    #[test]
    fn interpolation_is_what_a_search_of_all_records_gives() {
        let mut cache = IrradianceCache::new(IrradianceCacheSettings::default(), &unit_box());

        // Random records
        let mut s = pcg32([9, 6, 7]);
        for _ in 0..300 {
            let n = (Vec3::Z + sample_uniform_sphere(s.random::<[f32; 2]>()) * 0.1).normalize();
            let p = Vec3::new(s.random::<f32>(), s.random::<f32>(), 0.0);
            cache.insert(Record { n, ..record(p, s.random::<f32>(), s.random::<f32>()) });
        }
        let mut found = 0;
        for _ in 0..1000 {
            let (x, n) = (Vec3::new(s.random::<f32>(), s.random::<f32>(), 0.0), Vec3::Z);

            // Reference: a search of all records
            let (mut sum, mut weights) = (0.0_f64, 0.0_f64);
            for r in cache.records() {
                let reach = r.reach(cache.settings());
                let error = Range { p: r.p, n: r.n, reach }.error(cache.settings().error, x, n);
                if error < 1.0 {
                    sum += f64::from((1.0 - error) * r.extrapolate(x, n).r);
                    weights += f64::from(1.0 - error);
                }
            }

            // The cache
            match cache.irradiance(x, n) {
                None => assert_eq!(weights, 0.0),
                Some(e) => {
                    found += 1;
                    assert!((f64::from(e.r) - sum / weights).abs() < 1e-4, "{e:?} {}", sum / weights);
                }
            }
            assert_eq!(cache.serves(x, n, 0.999_999), weights > 1e-6);
        }
        assert!(found > 200 && found < 1000, "{found}");
    }

    #[test]
    fn gradients_do_not_turn_light_into_more_than_twice_itself() {
        let mut light = Irradiance { e: Rgb::WHITE, ..Irradiance::default() };
        light.translation = [Vec3::X * 100.0, Vec3::X, Vec3::ZERO];
        light.rotation = [Vec3::ZERO, Vec3::Y * 1e6, Vec3::Y];
        limit_gradients(&mut light, 0.5, 0.2);
        assert_eq!(light.translation, [Vec3::X * 2.0, Vec3::X, Vec3::ZERO]);
        assert!((light.rotation[1].length() - 1.0 / (0.2 * std::f32::consts::SQRT_2)).abs() < 1e-3);
        assert_eq!(light.rotation[2], Vec3::Y);
    }
}
