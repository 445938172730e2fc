//! The visibility cache: for a point, the lights whose photons arrived nearby on a direct path [Keller and Wald 2000,
//! §3].
//!
//! Space is divided into cubes of edge 2r. A photon is stored in the 8 cubes that overlap a cube of half-edge r about
//! it, so that a single lookup returns every photon within r of the point, and some up to 3r away. The lights of these
//! photons are 𝓛_con; all others are most probably occluded.
//!
//! Cubes are also distinguished by the orientation of the surface: a photon is stored for each of the six axis
//! directions within [`SIDE_COS`] of its normal, and a lookup uses the direction nearest to its own normal. A lookup
//! therefore returns all photons whose normals are within 17° of the normal of the point, and never photons on the
//! other side of a wall.
//!
//! A radius is safe if a visible light almost surely has a photon within it. If μ photons are expected, there is none
//! with probability e^−μ. [`VisibilityCache::adapted`] chooses the radius at which the photons found at a point have on
//! average [`SECURE_COUNT`] photons of their light.

use crate::lights::{LightId, SurfacePoint};
use lumiris_numbers::math::{Bounds3, Vec3};
use rayon::prelude::*;

/// Minimum cosine between a photon's normal and an axis direction for it to count on that side: cos(54.7° + 17.8°), the
/// maximum angle between a direction and its nearest axis plus a margin.
pub const SIDE_COS: f32 = 0.3;
/// Mean number of photons of the same light in a lookup, for [`VisibilityCache::adapted`].
pub const SECURE_COUNT: f64 = 128.0;
/// Minimum and maximum radius of [`VisibilityCache::adapted`], relative to the radius of the scene.
const RADIUS_RANGE: [f32; 2] = [1.0 / 4096.0, 1.0 / 16.0];

/// Bits of a cube's index along each axis.
const AXIS_BITS: u32 = 20;
/// Key of an empty slot.
const EMPTY: u64 = u64::MAX;

/// A cube for one orientation, with its range of entries.
#[derive(Clone, Copy, Debug)]
struct Slot {
    key: u64,
    first: u32,
    len: u32,
}

/// The visibility cache: the lights that contribute around a point, according to photons that came straight from them.
#[derive(Clone, Debug)]
pub struct VisibilityCache {
    origin: Vec3,
    /// 1/(2r).
    scale: f32,
    radius: f32,
    /// A hash table with linear probing, filled in the order of the keys.
    slots: Vec<Slot>,
    /// Photon counts of lights, cube by cube; ids ascend in each.
    entries: Vec<PhotonCount>,
    /// Cumulative photon counts of each cube.
    sums: Vec<u32>,
    /// Numbers of photon paths; ids ascend.
    paths: Vec<PathCount>,
    /// Number of photons from which the cache was built.
    photon_count: usize,
}

/// A photon that came straight from a light.
#[derive(Clone, Copy, Debug)]
pub struct PrimaryPhoton {
    /// Where it arrived; the normal is on the illuminated side.
    pub at: SurfacePoint,
    /// Its light.
    pub light: LightId,
}

/// The number of photons of a light around a point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PhotonCount {
    /// The light.
    pub light: LightId,
    /// The number.
    pub count: u32,
}

/// The number of photon paths from a light.
#[derive(Clone, Copy, Debug)]
pub struct PathCount {
    /// The light.
    pub light: LightId,
    /// The number; an expected value if lights are chosen at random.
    pub paths: f32,
}

/// The number of photons of a light in a cube, in the order of the cache.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct CubeCount {
    key: u64,
    light: LightId,
    count: u32,
}

/// The contributing lights of a point.
#[derive(Clone, Copy, Debug, Default)]
pub struct ContributingLights<'a> {
    /// Photon counts, ids ascending.
    pub lights: &'a [PhotonCount],
    /// Cumulative photon counts.
    pub sums: &'a [u32],
}

impl ContributingLights<'_> {
    /// Index of a light.
    #[inline]
    pub fn index_of(&self, light: LightId) -> Option<usize> {
        self.lights.binary_search_by_key(&light, |entry| entry.light).ok()
    }

    /// Number of photons of a light.
    #[inline]
    pub fn count(&self, light: LightId) -> u32 {
        self.index_of(light).map_or(0, |i| self.lights[i].count)
    }
}

/// The axis direction nearest to `n`: 2·axis, plus one if it is negative.
#[inline]
fn side_of(n: Vec3) -> u64 {
    let a = n.abs();
    let axis = if a.x >= a.y && a.x >= a.z { 0 } else { 1 + usize::from(a.z > a.y) };
    2 * axis as u64 + u64::from(n[axis] < 0.0)
}

#[inline]
fn key_of([x, y, z]: [u64; 3], side: u64) -> u64 {
    ((side << AXIS_BITS | x) << AXIS_BITS | y) << AXIS_BITS | z
}

/// The index of a cube along an axis for a distance from the origin in edges.
#[inline]
fn cube_index(x: f32) -> u64 {
    // Casts saturate; NaN becomes 0
    (x as u64).min((1 << AXIS_BITS) - 1)
}

impl VisibilityCache {
    /// Built from photons. `radius` (m) is enlarged if the scene has more than 2²⁰ cubes along an axis. Photons without
    /// a finite position or without a normal are ignored.
    pub fn new(photons: &[PrimaryPhoton], radius: f32) -> Self {
        let photon_count = photons.len();
        let photons = || photons.iter().filter(|photon| photon.at.p.is_finite());
        let bounds = Bounds3::from_points(photons().map(|photon| photon.at.p));
        let extent = if bounds.is_empty() { 0.0 } else { bounds.diagonal().max_element() };
        // Two cubes of margin at each end
        let radius = radius.max(extent / (2.0 * ((1_u64 << AXIS_BITS) - 8) as f32)).max(f32::MIN_POSITIVE);
        let edge = 2.0 * radius;
        let origin = if bounds.is_empty() { Vec3::ZERO } else { bounds.min - 2.0 * edge };
        let scale = 1.0 / edge;

        // Photons with the same 8 cubes, orientation and light are one item with their count
        let mut items: Vec<CubeCount> = Vec::new();
        for &PrimaryPhoton { at: SurfacePoint { p, n }, light } in photons() {
            let lowest = ((p - origin) * scale - 0.5).to_array().map(cube_index);
            let sides = (0..6).filter(|&side| (if side & 1 == 0 { n[side / 2] } else { -n[side / 2] }) >= SIDE_COS);
            items.extend(sides.map(|side| CubeCount { key: key_of(lowest, side as u64), light, count: 1 }));
        }

        // Unless given, the number of paths of a light is the number of its photons
        let mut ids: Vec<LightId> = photons().map(|photon| photon.light).collect();
        ids.par_sort_unstable();
        let of_light = |same: &[LightId]| PathCount { light: same[0], paths: same.len() as f32 };
        let paths = ids.chunk_by(|a, b| a == b).map(of_light).collect();

        // Spread the items over their 8 cubes
        let items = merged(items);
        let cubes = (0..8_u64).map(|i| key_of([i & 1, i >> 1 & 1, i >> 2], 0));
        let spread = cubes.flat_map(|step| items.iter().map(move |item| CubeCount { key: item.key + step, ..*item }));
        let cache = VisibilityCache::from_sorted(origin, radius, &merged(spread.collect()));
        VisibilityCache { paths, photon_count, ..cache }
    }

    /// [`Self::new`] with a safe radius for lookups at the given points, bounded by `scene_radius` (m).
    pub fn adapted(points: &[SurfacePoint], photons: &[PrimaryPhoton], scene_radius: f32) -> Self {
        let [min, max] = RADIUS_RANGE.map(|share| share * scene_radius);
        let mut cache = VisibilityCache::new(photons, scene_radius / 64.0);
        // Photon counts on a surface grow approximately with the square of the radius
        for _ in 0..3 {
            let ratio = (SECURE_COUNT / cache.mean_count_at(points).max(1.0)).sqrt() as f32;
            let radius = (cache.radius * ratio.clamp(0.125, 8.0)).clamp(min, max);
            if (radius / cache.radius - 1.0).abs() < 0.1 {
                break;
            }
            cache = VisibilityCache::new(photons, radius);
        }
        cache
    }

    /// Sets the number of photon paths of each light, ids ascending, for scenes in which some photon paths did not
    /// reach a surface.
    #[must_use]
    pub fn with_paths(self, paths: impl Iterator<Item = PathCount>) -> Self {
        VisibilityCache { paths: paths.collect(), ..self }
    }

    fn from_sorted(origin: Vec3, radius: f32, items: &[CubeCount]) -> Self {
        // A hash table with a load of at most one half
        let cells = items.chunk_by(|a, b| a.key == b.key);
        let slots = (2 * cells.clone().count()).next_power_of_two();
        let mut cache = VisibilityCache {
            origin,
            scale: 0.5 / radius,
            radius,
            slots: vec![Slot { key: EMPTY, first: 0, len: 0 }; slots],
            entries: Vec::with_capacity(items.len()),
            sums: Vec::with_capacity(items.len()),
            paths: Vec::new(),
            photon_count: 0,
        };

        // Entries and cumulative counts by cell
        for cell in cells {
            let key = cell[0].key;
            let slot = cache.find(key);
            cache.slots[slot] = Slot { key, first: cache.entries.len() as u32, len: cell.len() as u32 };
            let mut sum = 0_u32;
            for &CubeCount { light, count, .. } in cell {
                sum = sum.saturating_add(count);
                cache.entries.push(PhotonCount { light, count });
                cache.sums.push(sum);
            }
        }
        cache
    }

    /// The slot of a key, or the empty slot for its insertion.
    #[inline]
    fn find(&self, key: u64) -> usize {
        let mask = self.slots.len() - 1;
        let mut slot = (key.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 32) as usize & mask;
        while self.slots[slot].key != key && self.slots[slot].key != EMPTY {
            slot = (slot + 1) & mask;
        }
        slot
    }

    /// Restricts the cache to some of the lights.
    #[must_use]
    pub fn of_lights(self, is_light: impl Fn(LightId) -> bool) -> Self {
        if self.entries.iter().all(|entry| is_light(entry.light)) {
            return self;
        }
        let items_of = |slot: &Slot| {
            let entries = &self.entries[slot.first as usize..(slot.first + slot.len) as usize];
            entries
                .iter()
                .map(|&PhotonCount { light, count }| CubeCount { key: slot.key, light, count })
                .collect::<Vec<_>>()
        };
        let mut items: Vec<_> = self.slots.iter().flat_map(items_of).collect();
        items.retain(|item| is_light(item.light));
        items.sort_unstable();
        let cache = VisibilityCache::from_sorted(self.origin, self.radius, &items);
        VisibilityCache { paths: self.paths, photon_count: self.photon_count, ..cache }
    }

    /// Area (m²) of a plane surface that a lookup covers: photons come from within r around a cube of edge 2r.
    pub fn area(&self) -> f32 {
        16.0 * self.radius * self.radius
    }

    /// Number of photon paths of a light; by default, its number of photons.
    pub fn paths(&self, light: LightId) -> f32 {
        self.paths.binary_search_by_key(&light, |entry| entry.light).map_or(0.0, |i| self.paths[i].paths)
    }

    /// The radius r (m) within which a lookup returns all photons.
    pub fn radius(&self) -> f32 {
        self.radius
    }

    /// Number of photons from which it was built.
    pub fn photon_count(&self) -> usize {
        self.photon_count
    }

    /// True if there was no photon.
    pub fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }

    /// Memory (bytes).
    pub fn bytes(&self) -> u64 {
        let entry = size_of::<PhotonCount>() + size_of::<u32>();
        (self.slots.len() * size_of::<Slot>() + self.entries.len() * entry) as u64
    }

    /// 𝓛_con of the point `p` on the side of the unit normal `n`. Empty without photons, and for a zero normal.
    #[inline]
    pub fn lookup(&self, p: Vec3, n: Vec3) -> ContributingLights<'_> {
        if n == Vec3::ZERO {
            return ContributingLights::default();
        }
        let cube = ((p - self.origin) * self.scale).to_array().map(cube_index);
        let Slot { first, len, .. } = self.slots[self.find(key_of(cube, side_of(n)))];
        let range = first as usize..(first + len) as usize;
        ContributingLights { lights: &self.entries[range.clone()], sums: &self.sums[range] }
    }

    /// Mean over the points with photons: the expected count of a light, averaged over the photons of the lookup.
    fn mean_count_at(&self, points: &[SurfacePoint]) -> f64 {
        let (mut sum, mut lit) = (0.0, 0);
        for &SurfacePoint { p, n } in points {
            let counts = || self.lookup(p, n).lights.iter().map(|entry| f64::from(entry.count));
            let photons = counts().sum::<f64>();
            if photons > 0.0 {
                sum += counts().map(|c| c * c).sum::<f64>() / photons;
                lit += 1;
            }
        }
        if lit > 0 { sum / f64::from(lit) } else { 0.0 }
    }
}

/// Sorts the items and merges items of the same cube and light.
fn merged(mut items: Vec<CubeCount>) -> Vec<CubeCount> {
    items.par_sort_unstable();
    items.dedup_by(|next, kept| {
        let is_same = (next.key, next.light) == (kept.key, kept.light);
        if is_same {
            kept.count = kept.count.saturating_add(next.count);
        }
        is_same
    });
    items.shrink_to_fit();
    items
}

#[cfg(test)]
mod tests {
    use super::*;
    use lumiris_numbers::math::warp::sample_uniform_sphere;
    use lumiris_test_support::random::{RngExt, pcg32};

    fn photon(p: Vec3, n: Vec3, light: LightId) -> PrimaryPhoton {
        PrimaryPhoton { at: SurfacePoint { p, n }, light }
    }

    fn ids(contributing: ContributingLights<'_>) -> Vec<LightId> {
        contributing.lights.iter().map(|entry| entry.light).collect()
    }

    fn random_photons(count: usize, lights: u32) -> Vec<PrimaryPhoton> {
        let mut s = pcg32([5, 5, 5]);
        let random = |_| {
            let [x, y] = s.random::<[f32; 2]>();
            let p = Vec3::new(x, y, s.random::<f32>()) * 4.0 - 1.0;
            let n = sample_uniform_sphere(s.random::<[f32; 2]>());
            photon(p, n, (s.random::<f32>() * lights as f32) as LightId)
        };
        (0..count).map(random).collect()
    }

    #[test]
    fn every_photon_within_the_radius_on_the_same_side_is_found() {
        let photons = random_photons(20_000, 50);
        let radius = 0.1;
        let cache = VisibilityCache::new(&photons, radius);
        let mut s = pcg32([6, 6, 6]);
        let mut found = 0;
        for _ in 0..2000 {
            let [x, y] = s.random::<[f32; 2]>();
            let (p, n) =
                (Vec3::new(x, y, s.random::<f32>()) * 4.4 - 1.2, sample_uniform_sphere(s.random::<[f32; 2]>()));
            let contributing = cache.lookup(p, n).lights;
            assert!(contributing.windows(2).all(|w| w[0].light < w[1].light));
            let near = |max: f32, min_cos: f32| {
                let is_near = move |photon: &&PrimaryPhoton| {
                    (p - photon.at.p).abs().max_element() <= max && n.dot(photon.at.n) >= min_cos
                };
                photons.iter().filter(is_near)
            };
            for PrimaryPhoton { light, .. } in near(radius * 0.999, 17.0_f32.to_radians().cos()) {
                assert!(contributing.iter().any(|entry| entry.light == *light));
                found += 1;
            }
            // A lookup returns no photon beyond three radii or from the other side, and each photon only once.
            for &PhotonCount { light, count } in contributing {
                let max = near(radius * 3.001, -0.61).filter(|photon| photon.light == light).count();
                assert!(count as usize <= max, "{light} {count} {max}");
            }
        }
        assert!(found > 20);
    }

    #[test]
    fn both_sides_of_a_wall_have_contributing_lights_of_their_own() {
        let at = |x: f32, y: f32| Vec3::new(x, y, 1.0);
        let photons: Vec<_> = (0..100)
            .flat_map(|i| {
                let p = at((i % 10) as f32 * 0.1, (i / 10) as f32 * 0.1);
                [photon(p, Vec3::Z, 3), photon(p, Vec3::NEG_Z, 7), photon(p + Vec3::Z * 5.0, Vec3::Z, 9)]
            })
            .collect();
        let cache = VisibilityCache::new(&photons, 0.15);

        // Lookups on both sides, and outside of the cache
        let lights = |p, n| ids(cache.lookup(p, n));
        assert_eq!(lights(at(0.5, 0.5), Vec3::Z), [3]);
        assert_eq!(lights(at(0.5, 0.5), Vec3::NEG_Z), [7]);
        assert!(lights(at(0.5, 0.5), Vec3::X).is_empty());
        assert!(lights(at(0.5, 0.5), Vec3::ZERO).is_empty());
        assert!(lights(at(50.0, 0.5), Vec3::Z).is_empty());
        assert!(lights(at(-50.0, f32::NAN), Vec3::Z).is_empty());
        assert!(cache.bytes() > 0 && cache.radius() == 0.15);

        // Counts
        let contributing = cache.lookup(at(0.5, 0.5), Vec3::Z);
        assert_eq!(contributing.sums.last().copied(), Some(contributing.lights[0].count));
        assert!(contributing.count(3) > 0 && contributing.count(8) == 0 && cache.paths(9) == 100.0);

        let some = cache.clone().of_lights(|light| light != 3);
        let [some_below, all_below] = [&some, &cache].map(|cache| cache.lookup(at(0.5, 0.5), Vec3::NEG_Z).lights);
        assert_eq!(some_below, all_below);
        assert!(ids(some.lookup(at(0.5, 0.5), Vec3::Z)).is_empty());
        assert_eq!((some.paths(7), some.paths(11)), (100.0, 0.0));
    }

    #[test]
    fn the_adapted_radius_gives_photons_enough_company() {
        let mut s = pcg32([7, 7, 7]);
        for count in [3_000, 100_000] {
            // Four lights on a square of 10 m, each visible in its own quarter
            let photons: Vec<_> = (0..count)
                .map(|_| {
                    let [x, y] = s.random::<[f32; 2]>().map(|u| u * 10.0);
                    photon(Vec3::new(x, y, 0.0), Vec3::Z, u32::from(x > 5.0) + 2 * u32::from(y > 5.0))
                })
                .collect();
            let points: Vec<_> = photons.iter().step_by(10).map(|photon| photon.at).collect();
            let cache = VisibilityCache::adapted(&points, &photons, 7.1);
            let mean = cache.mean_count_at(&points);
            assert!((SECURE_COUNT / 2.0..2.0 * SECURE_COUNT).contains(&mean), "{} {mean}", cache.radius());
            let reversed: Vec<_> = photons.iter().rev().copied().collect();
            let again = VisibilityCache::new(&reversed, cache.radius());
            assert_eq!(cache.entries, again.entries, "the cache does not depend on the order of photons");
        }
    }

    #[test]
    fn no_photons_and_photons_in_one_place_are_handled() {
        let none = VisibilityCache::new(&[], 1.0);
        assert!(none.is_empty() && ids(none.lookup(Vec3::ZERO, Vec3::Z)).is_empty());
        assert!(VisibilityCache::adapted(&[SurfacePoint { p: Vec3::ZERO, n: Vec3::Z }], &[], 1.0).is_empty());
        let same = [photon(Vec3::ONE, Vec3::Z, 1), photon(Vec3::NAN, Vec3::Z, 2), photon(Vec3::ONE, Vec3::ZERO, 3)];
        let once = |light| [PhotonCount { light, count: 1 }];
        assert_eq!(VisibilityCache::new(&same, 0.0).lookup(Vec3::ONE, Vec3::Z).lights, once(1));
        let far = [photon(Vec3::ZERO, Vec3::Z, 1), photon(Vec3::splat(1e9), Vec3::Z, 2)];
        let cache = VisibilityCache::new(&far, 1e-3);
        assert_eq!(cache.lookup(Vec3::splat(1e9), Vec3::Z).lights, once(2));
        assert_eq!(cache.lookup(Vec3::ZERO, Vec3::Z).lights, once(1));
    }
}
