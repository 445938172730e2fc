//! Boundary bias of density estimation: the loss at edges, in corners, and next to other objects.
//!
//! An estimate with kernel K of radius r has the expectation E · p, where E is the irradiance and p = ∫ K dA is the
//! part of the kernel that lies on the surface. p is unknown, but points of the kernel can be tested. The number of
//! trials up to and including the first point on the surface has the expectation 1/p. Multiplied by this number, the
//! estimate is correct on average wherever irradiance and surface are smooth. If the kernel lies entirely on the
//! surface, the number is 1 and adds no noise.
//!
//! A point lies on the surface if the path to it along the surface is unoccluded, and a short ray down from there hits
//! a surface with nearly the same normal. Points have the density of the Epanechnikov kernel. Their distance d has the
//! distribution F(s) = 2s² − s⁴, s = d/r.

use crate::accel::{Coherence, Hit, RayBatch};
use crate::photons::GatherPoint;
use crate::scene::World;
use lumiris_numbers::math::{Frame, Ray, Vec3};
use lumiris_numbers::samplers::SampleStream;
use std::f32::consts::TAU;

/// Maximum number of trials. If p is below about 1/32, some bias remains.
const MAX_TRIALS: u32 = 32;
/// Minimum cosine between the normals of points on the same surface, as in photon maps.
const MIN_NORMAL_COS: f32 = 0.8;
/// Height of the path above the surface, in radii. Photons farther than a quarter radius from the tangent plane do not
/// count.
const HEIGHT: f32 = 0.25;

/// A kernel to be tested.
#[derive(Clone, Copy, Debug)]
pub(super) struct Probe {
    pub(super) point: GatherPoint,
    /// r.
    pub(super) radius: f32,
    pub(super) time: f32,
    pub(super) stream: SampleStream,
}

/// A point of a kernel to be tested.
#[derive(Clone, Copy, Debug)]
struct Trial {
    /// Base point on the tangent plane.
    foot: Vec3,
    /// Height of the path above the plane.
    height: f32,
}

impl Probe {
    /// The location of a trial.
    fn trial(&self, trial: u32) -> Trial {
        let [u, v] = self.stream.domain(trial).draw::<2>();
        let s2 = 1.0 - (1.0 - u).sqrt();
        let (sin, cos) = (TAU * v).sin_cos();
        let d = self.radius * s2.sqrt();
        let height = HEIGHT * self.radius * (1.0 - s2).sqrt().max(0.2);
        let foot = self.point.p + Frame::from_z(self.point.n).to_world(Vec3::new(d * cos, d * sin, 0.0));
        Trial { foot, height }
    }
}

/// Tests kernels; holds the buffers of one worker.
#[derive(Debug, Default)]
pub(super) struct Boundary {
    rays: RayBatch,
    blocked: Vec<bool>,
    hits: Vec<Option<Hit>>,
    open: Vec<u32>,
    free: Vec<u32>,
}

impl Boundary {
    /// The trial counts of some kernels; `out[i]` belongs to `probes[i]`.
    pub(super) fn trials(&mut self, world: &World, probes: &[Probe], out: &mut Vec<u32>) {
        out.clear();
        out.resize(probes.len(), MAX_TRIALS);
        self.open.clear();
        self.open.extend(0..probes.len() as u32);
        for trial in 1..=MAX_TRIALS {
            if self.open.is_empty() {
                break;
            }
            self.round(world, probes, trial, out);
        }
    }

    /// One trial for each unfinished kernel.
    fn round(&mut self, world: &World, probes: &[Probe], trial: u32, out: &mut [u32]) {
        // Along the surface
        self.rays.clear();
        for &i in &self.open {
            let probe = &probes[i as usize];
            let Trial { foot, height } = probe.trial(trial);
            let o = probe.point.p + probe.point.n * height;
            let d = foot - probe.point.p;
            self.rays.push(&Ray { o, d, t_max: 1.0, time: probe.time });
        }
        world.accel.occluded(&self.rays, Coherence::Incoherent, &mut self.blocked);

        // Down to the surface
        self.rays.clear();
        self.free.clear();
        for (&i, _) in self.open.iter().zip(&self.blocked).filter(|(_, blocked)| !**blocked) {
            let probe = &probes[i as usize];
            let Trial { foot, height } = probe.trial(trial);
            let (o, d) = (foot + probe.point.n * height, probe.point.n * (-2.0 * height));
            self.rays.push(&Ray { o, d, t_max: 1.0, time: probe.time });
            self.free.push(i);
        }
        world.accel.intersect(&self.rays, Coherence::Incoherent, &mut self.hits);
        for (k, (&i, hit)) in self.free.iter().zip(&self.hits).enumerate() {
            let Some(h) = hit else { continue };
            let probe = &probes[i as usize];
            let (set, ray) = (&world.scene.geometry, self.rays.get(k));
            let n = set.surface_hit_of_ray(h.geometry, h.primitive, h.instance, h.uv, &ray).n;
            if n.dot(probe.point.n).abs() >= MIN_NORMAL_COS {
                out[i as usize] = trial;
            }
        }
        self.open.retain(|&i| out[i as usize] == MAX_TRIALS);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::import::{LoadOptions, load};
    use crate::scene::AccelKind;
    use lumiris_numbers::estimators::stats::{Welford, t_test};
    use lumiris_numbers::samplers::SamplerKind;

    /// A square of edge 2 about the origin, its upper side being +z, with a wall on it at x = −0.5.
    const SQUARE_AND_WALL: &str = r#"
WorldBegin
LightSource "point"
Shape "trianglemesh" "point3 P" [ -1 -1 0  1 -1 0  1 1 0  -1 1 0 ] "integer indices" [ 0 1 2 0 2 3 ]
Shape "trianglemesh" "point3 P" [ -0.5 -1 0  -0.5 1 0  -0.5 1 1  -0.5 -1 1 ] "integer indices" [ 0 1 2 0 2 3 ]
"#;

    fn world() -> World {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("scene.pbrt");
        std::fs::write(&path, SQUARE_AND_WALL).unwrap();
        let scene = load(&path, &LoadOptions::default()).map_err(|d| d.to_string()).unwrap().scene;
        World::new(scene, AccelKind::Embree, None).unwrap()
    }

    fn numbers(world: &World, p: Vec3, radius: f32) -> Welford {
        let probe = |i| Probe {
            point: GatherPoint::flat(p, Vec3::Z),
            radius,
            time: 0.0,
            stream: SampleStream::new(SamplerKind::Independent, [i, 0], 0, 9),
        };
        let probes: Vec<Probe> = (0..20_000).map(probe).collect();
        let (mut boundary, mut trials) = (Boundary::default(), Vec::new());
        boundary.trials(world, &probes, &mut trials);
        let mut numbers = Welford::new();
        trials.iter().for_each(|&n| numbers.add(f64::from(n)));
        numbers
    }

    #[test]
    fn the_mean_number_of_trials_is_the_reciprocal_of_what_lies_on_the_surface() {
        // Inside, on an edge, in a corner, next to the wall, and on an edge next to the wall
        let world = world();
        let inside = numbers(&world, Vec3::new(0.2, 0.0, 0.0), 0.3);
        assert_eq!((inside.mean(), inside.variance()), (1.0, 0.0));
        for (p, reciprocal) in [([1.0, 0.0], 2.0), ([1.0, 1.0], 4.0), ([-0.4999, 0.1], 2.0), ([-0.4999, 1.0], 4.0)] {
            let numbers = numbers(&world, Vec3::new(p[0], p[1], 0.0), 0.3);
            // For p = 1/4, the limit of 32 trials multiplies the mean by 1 − (1 − 1/4)³² = 0.9999
            let near = (numbers.mean() / reciprocal - 1.0).abs() < 1e-3;
            assert!(near || t_test(&numbers, reciprocal).p_value > 1e-4, "{p:?}: {numbers:?}");
        }
    }
}
