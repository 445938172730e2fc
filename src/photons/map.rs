//! Photons in a spatial index, and the density of their power.
//!
//! The irradiance at x is estimated from the photons around it, E ≈ Σ K(d_k) Φ_k, with the Epanechnikov kernel K(d) =
//! 2/(πr²) (1 − d²/r²), whose integral over the disk of radius r is 1 [Epanechnikov 1969; Silverman 1986, §4.2]. r is
//! fixed, or the distance of the k-th nearest photon [Jensen 1996], which is then excluded: for photons of
//! constant density λ, E[(k − 1)/(πr²)] = λ, whereas k/(πr²) would be too large by the factor k/(k − 1). If the disk of
//! the maximum radius has fewer than k photons, all of them count with that radius. The estimate is unbiased in both
//! cases: λ P(N ≥ k − 1) + λ P(N ≤ k − 2), where N is the number of photons in the largest disk.
//!
//! A photon counts at a point if it lies on a surface of nearly the same normal, on the same side, and close to the
//! tangent plane. The maximum of d and 4 |d·n| is compared with r, so that photons farther from the plane than r/4
//! never count, as in the flattened spheres of [Jensen 2001, §7.2]. On a plane, and on a sphere of more than twice the
//! radius r, this maximum is d. The area of a sphere within the distance d is πd² as well.
//!
//! The irradiance refers to the shading normal: a photon's power is weighted by |wi·ns|/|wi·n_k|, where n_k is the
//! geometric normal at the photon, since the photon density is per area about n_k.

use super::photon::Photon;
use super::tree::{Tree, Visit};
use lumiris_numbers::math::{Rgb, Vec3};
use std::collections::BinaryHeap;
use std::f32::consts::FRAC_1_PI;

/// Cosine of the maximum angle between the normals of a point and of photons that count.
const MIN_NORMAL_COS: f32 = 0.8;
/// Squared factor of distances along the normal.
const FLATTENING: f32 = 16.0;
/// Lower bound of cosines in denominators: packed directions cannot resolve smaller ones.
const MIN_COS: f32 = 0.01;

/// A point on a surface, on one side.
#[derive(Clone, Copy, Debug)]
pub struct GatherPoint {
    /// The point.
    pub p: Vec3,
    /// Geometric normal on the illuminated side, unit.
    pub n: Vec3,
    /// Shading normal on that side, which defines the irradiance, unit.
    pub ns: Vec3,
}

impl GatherPoint {
    /// A point whose shading normal is the geometric normal.
    pub fn flat(p: Vec3, n: Vec3) -> Self {
        GatherPoint { p, n, ns: n }
    }
}

/// The photons that an estimate uses.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Search {
    /// The nearest photons.
    Nearest {
        /// Number of photons, at least 2.
        count: u32,
        /// Maximum radius of a search (m).
        max_radius: f32,
    },
    /// All photons within a radius (m).
    Radius(f32),
}

/// Buffers of searches; one per thread.
#[derive(Clone, Debug, Default)]
pub struct GatherScratch {
    nearest: BinaryHeap<Candidate>,
}

/// A photon with its distance.
#[derive(Clone, Copy, Debug)]
struct Candidate {
    d2: f32,
    index: u32,
}

impl PartialEq for Candidate {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}
impl Eq for Candidate {}
impl PartialOrd for Candidate {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}
impl Ord for Candidate {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.d2.total_cmp(&other.d2).then(self.index.cmp(&other.index))
    }
}

/// Photons in a spatial index.
#[derive(Clone, Debug, Default)]
pub struct PhotonMap {
    tree: Tree,
}

impl PhotonMap {
    /// Builds the map on all threads of the current pool; the result does not depend on their number.
    pub fn new(photons: Vec<Photon>) -> Self {
        PhotonMap { tree: Tree::new(photons) }
    }

    /// Number of photons.
    pub fn len(&self) -> usize {
        self.tree.photons.len()
    }

    /// True if there is no photon.
    pub fn is_empty(&self) -> bool {
        self.tree.photons.is_empty()
    }

    /// All photons, in the order of the tree.
    pub fn photons(&self) -> &[Photon] {
        &self.tree.photons
    }

    /// Memory of photons and tree (bytes).
    pub fn bytes(&self) -> u64 {
        self.tree.bytes()
    }

    /// Calls `f(photon, weight)` for each photon of the estimate. The irradiance about `at.ns` is Σ weight·power
    /// (weight in 1/m²); the radiance that a BSDF f reflects is Σ weight·f·power, without a cosine. Returns the radius
    /// of the kernel (m), which is 0 without photons.
    pub fn gather(
        &self,
        at: &GatherPoint,
        search: Search,
        scratch: &mut GatherScratch,
        mut f: impl FnMut(&Photon, f32),
    ) -> f32 {
        match search {
            Search::Radius(radius) => {
                if !(radius > 0.0) {
                    return 0.0;
                }
                let kernel = Kernel::new(radius * radius);
                self.tree.visit(at.p, &mut Within { at, kernel, f: &mut f });
                radius
            }
            Search::Nearest { count, max_radius } => {
                if !(max_radius > 0.0) || count == 0 {
                    return 0.0;
                }
                let heap = &mut scratch.nearest;
                heap.clear();
                let max = max_radius * max_radius;
                let mut nearest = Nearest { at, count: count as usize, bound: max, heap };
                self.tree.visit(at.p, &mut nearest);
                let bound = nearest.bound;
                let Some(farthest) = heap.peek() else { return 0.0 };
                // Without a maximum radius, use the photons in the heap
                let r2 = if bound.is_finite() { bound } else { farthest.d2 };
                if !(r2 > 0.0) {
                    return 0.0;
                }
                // The k-th photon, if there is one, is at the radius, where the kernel is 0
                let kernel = Kernel::new(r2);
                for candidate in heap.iter() {
                    let photon = &self.tree.photons[candidate.index as usize];
                    let weight = kernel.at(candidate.d2) * at.cosine_ratio(photon);
                    if weight > 0.0 {
                        f(photon, weight);
                    }
                }
                r2.sqrt()
            }
        }
    }

    /// Irradiance about the shading normal (W/m²).
    pub fn irradiance(&self, at: &GatherPoint, search: Search, scratch: &mut GatherScratch) -> Rgb {
        let mut sum = Rgb::BLACK;
        self.gather(at, search, scratch, |photon, weight| sum += photon.power() * weight);
        sum
    }
}

impl GatherPoint {
    /// The squared distance of a photon at offset `d`, of squared length `d2`; `None` if it does not count.
    #[inline]
    fn distance_squared(&self, photon: &Photon, d: Vec3, d2: f32, bound: f32) -> Option<f32> {
        let along = d.dot(self.n);
        let d2 = d2.max(FLATTENING * along * along);
        let belongs = d2 <= bound && photon.n().dot(self.n) >= MIN_NORMAL_COS && photon.wi().dot(self.n) > 0.0;
        belongs.then_some(d2)
    }

    /// |wi·ns|/|wi·n_k|; 0 if the photon comes from below.
    #[inline]
    fn cosine_ratio(&self, photon: &Photon) -> f32 {
        if self.ns == self.n {
            return 1.0;
        }
        let wi = photon.wi();
        wi.dot(self.ns).max(0.0) / wi.dot(photon.n()).max(MIN_COS)
    }
}

/// The Epanechnikov kernel.
#[derive(Clone, Copy)]
struct Kernel {
    r2: f32,
    inverse_r2: f32,
    /// 2/(πr²).
    peak: f32,
}

impl Kernel {
    fn new(r2: f32) -> Self {
        Kernel { r2, inverse_r2: 1.0 / r2, peak: 2.0 * FRAC_1_PI / r2 }
    }

    #[inline]
    fn at(&self, d2: f32) -> f32 {
        self.peak * (1.0 - d2 * self.inverse_r2).max(0.0)
    }
}

/// All photons within a radius.
struct Within<'a, F> {
    at: &'a GatherPoint,
    kernel: Kernel,
    f: &'a mut F,
}

impl<F: FnMut(&Photon, f32)> Visit for Within<'_, F> {
    #[inline]
    fn bound(&self) -> f32 {
        self.kernel.r2
    }

    #[inline]
    fn photon(&mut self, _index: usize, photon: &Photon, d: Vec3, d2: f32) {
        if let Some(d2) = self.at.distance_squared(photon, d, d2, self.kernel.r2) {
            let weight = self.kernel.at(d2) * self.at.cosine_ratio(photon);
            if weight > 0.0 {
                (self.f)(photon, weight);
            }
        }
    }
}

/// The nearest photons so far.
struct Nearest<'a> {
    at: &'a GatherPoint,
    count: usize,
    /// Squared distance of the farthest photon, once there are k.
    bound: f32,
    heap: &'a mut BinaryHeap<Candidate>,
}

impl Visit for Nearest<'_> {
    #[inline]
    fn bound(&self) -> f32 {
        self.bound
    }

    #[inline]
    fn photon(&mut self, index: usize, photon: &Photon, d: Vec3, d2: f32) {
        let Some(d2) = self.at.distance_squared(photon, d, d2, self.bound) else { return };
        let candidate = Candidate { d2, index: index as u32 };
        if self.heap.len() < self.count {
            self.heap.push(candidate);
        } else if let Some(mut farthest) = self.heap.peek_mut()
            && candidate < *farthest
        {
            *farthest = candidate;
        }
        if self.heap.len() == self.count
            && let Some(farthest) = self.heap.peek()
        {
            self.bound = farthest.d2;
        }
    }
}
