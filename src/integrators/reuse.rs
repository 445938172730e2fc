//! Paths that neighbouring pixels share [Bekaert et al. 2002].
//!
//! Let x_i be the first Lambertian vertices of some paths, and y_j the vertices after them, Lambertian as well. L(y_j), the
//! radiance that is reflected at y_j, is the same in all directions to one side. So what path j found from there on serves
//! every x_i that sees y_j. Each x_i has drawn one direction by the cosine, which at y is the density
//! g_i(y) = cos θ_i |cos θ_y|/(π ‖y − x_i‖²) per unit area, where y is visible. By the balance heuristic over all of them,
//! the indirect light of x_i, which reflects ρ_i, is
//!
//! ρ_i Σ_j L(y_j) g_i(y_j) V_ij / Σ_k g_k(y_j) V_kj,
//!
//! where V is found by shadow segments. No path gets a greater weight than it had by itself, and the estimate is unbiased:
//! whether an x_i takes part does not depend on the direction that it drew, and light from surfaces that are not
//! Lambertian, beyond others that do not scatter, or of emitters, remains with its own path.
//!
//! The samples of one turn in a block of pixels are a group. Where blocks lie depends on the turn, so that the noise of
//! two pixels is never the same for all samples. Groups end at [cells](CELL), which are always rendered together: so
//! images do not depend on tiles. Where pixels have different numbers of samples, those of one turn are of the same part of
//! the image ([`crate::scene::PixelSamples::turn`]); the numbers are independent of the samples, and so is who is in a group.

use super::light_layers;
use super::segment::CameraSample;
use crate::accel::{Accel, Coherence, RayBatch};
use crate::film::PixelSample;
use crate::scene::RenderJob;
use crate::settings::{IntegratorKind, RouletteKind};
use lumiris_numbers::math::hash::pcg4d;
use lumiris_numbers::math::ray::{SEGMENT_END, offset_origin};
use lumiris_numbers::math::{Ray, Rgb, Vec3};

/// Edge of the squares of pixels that groups lie in, from the corner of the image.
pub const CELL: u32 = 16;
/// Seed of where blocks lie.
const SEED: u32 = 0x72_65_75_73;

/// The edge of the blocks of pixels that share paths; 1 if none do.
pub fn edge(job: &RenderJob) -> u32 {
    if obstacle(job).is_none() { job.settings().integrator.path_reuse.unwrap_or(1) } else { 1 }
}

/// Why pixels of this image cannot share paths.
pub fn obstacle(job: &RenderJob) -> Option<&'static str> {
    let settings = &job.settings().integrator;
    let geometry = &job.world.scene.geometry;
    let is_cut_out = geometry.geometries.iter().any(|g| g.alpha.is_some());
    let reasons = [
        (settings.depth() < 2, "paths of one bounce have nothing to share"),
        (settings.kind != IntegratorKind::Path, "only the integrator path has paths of its own for each pixel"),
        (settings.roulette != RouletteKind::Throughput, "they split"),
        (
            job.shadows_pass(),
            "rays may pass surfaces between their vertices, bounds of media or mixtures with `interface`",
        ),
        (job.world.scene.materials.has_dispersion(), "paths may have wavelengths"),
        (light_layers::count(job) > 0, "light groups have layers (--light-groups none: they have not)"),
        (geometry.has_motion() || is_cut_out, "what a ray meets varies with time or is cut out at random"),
    ];
    reasons.into_iter().find(|(holds, _)| *holds).map(|(_, reason)| reason)
}

/// Which samples of a batch are a group.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Groups {
    /// None: the batch does not have all samples of a cell.
    #[default]
    None,
    /// Those of a block, which lies anywhere in its cell.
    Cells,
    /// Those of a block of a grid over the image.
    Grid,
}

/// A Lambertian vertex: its point, the bound of its rounding error, and the geometric and the shading normal on the side
/// of the viewer.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    pub(super) p: Vec3,
    pub(super) p_error: Vec3,
    pub(super) n: Vec3,
    pub(super) ns: Vec3,
}

impl Place {
    /// By a point with the bound of its error, the geometric and the shading normal, and the direction to the viewer.
    #[inline]
    pub(super) fn new((p, p_error): (Vec3, Vec3), (n, ns): (Vec3, Vec3), wo: Vec3) -> Self {
        let facing = |n: Vec3| if n.dot(wo) < 0.0 { -n } else { n };
        Place { p, p_error, n: facing(n), ns: facing(ns) }
    }
}

/// The first Lambertian vertex of a path.
#[derive(Clone, Copy, Debug)]
struct First {
    at: Place,
    /// Index along the path.
    vertex: u32,
    /// Throughput beyond it.
    beta: Rgb,
}

/// The vertex after it, from which on what the path finds is shared.
#[derive(Clone, Copy, Debug)]
struct Second {
    at: Place,
    /// What the sample had found before.
    before: Rgb,
}

/// First and second vertex of two samples.
#[derive(Clone, Copy, Debug)]
struct Pair {
    first: u32,
    second: u32,
    /// g, or 0 where nothing gets through.
    g: f32,
}

/// The paths of a batch that are shared.
#[derive(Debug, Default)]
pub(super) struct Reuse {
    groups: Groups,
    /// Edge of the blocks; 1 or 0 if the batch shares nothing.
    edge: u32,
    /// Group and index of each sample, sorted.
    order: Vec<(u64, u32)>,
    first: Vec<Option<First>>,
    second: Vec<Option<Second>>,
    shared: u32,
    rays: RayBatch,
    occluded: Vec<bool>,
    pairs: Vec<Pair>,
    tails: Vec<Rgb>,
}

impl Reuse {
    pub(super) fn of(groups: Groups) -> Self {
        Reuse { groups, ..Reuse::default() }
    }

    /// Begins a batch of so many samples, which share paths in blocks of the given edge, or do not.
    pub(super) fn begin(&mut self, edge: Option<u32>, count: usize) {
        self.edge = edge.filter(|_| self.groups != Groups::None).unwrap_or(1);
        let count = if self.edge > 1 { count } else { 0 };
        self.first.clear();
        self.first.resize(count, None);
        self.second.clear();
        self.second.resize(count, None);
        self.shared = 0;
    }

    /// Itself, if the batch shares paths.
    #[inline]
    pub(super) fn active(&mut self) -> Option<&mut Self> {
        (self.edge > 1).then_some(self)
    }

    /// The path of a sample has arrived at a Lambertian vertex that reflects `rho`; `is_next` if it has passed no surface
    /// since the last one. The answer is its throughput from there on: if it is shared, that is one which only roulette has
    /// changed since the first vertex, and the sample has found nothing.
    #[inline]
    pub(super) fn arrive(
        &mut self,
        (sample, vertex, is_next): (u32, u32, bool),
        at: Place,
        (beta, rho): (Rgb, Rgb),
        radiance: &mut Rgb,
    ) -> Rgb {
        let (first, second) = (&mut self.first[sample as usize], &mut self.second[sample as usize]);
        match first {
            None => {
                // Without throughput it draws no direction
                let beyond = beta * rho;
                *first = (!beyond.is_black() && beyond.is_finite()).then_some(First { at, vertex, beta: beyond });
                beta
            }
            Some(first) if first.vertex + 1 == vertex && is_next && second.is_none() => {
                *second = Some(Second { at, before: std::mem::replace(radiance, Rgb::BLACK) });
                self.shared += 1;
                Rgb::splat(beta.map(f32::abs).max_component() / first.beta.map(f32::abs).max_component())
            }
            Some(_) => beta,
        }
    }

    /// Gives each sample its part of what the paths of its group have found; returns the number of segments.
    pub(super) fn resolve(&mut self, job: &RenderJob, samples: &[CameraSample], out: &mut [PixelSample]) -> u64 {
        if self.shared == 0 {
            return 0;
        }
        let (origin, groups, edge) = (job.world.scene.film.bounds, self.groups, self.edge);
        let group = |s: &CameraSample| groups.of(edge, [s.pixel[0] - origin.x0, s.pixel[1] - origin.y0], s.turn);
        self.order.clear();
        self.order.extend(samples.iter().map(group).zip(0_u32..));
        self.order.sort_unstable();

        self.tails.clear();
        self.tails.extend(out.iter().map(|o| o.radiance));
        for (sample, second) in out.iter_mut().zip(&self.second) {
            if let Some(second) = second {
                sample.radiance = second.before;
            }
        }
        self.pair();
        self.trace(&*job.world.accel);
        for pairs in self.pairs.chunk_by(|a, b| a.second == b.second) {
            self.distribute(pairs, out);
        }
        self.rays.len() as u64
    }

    /// The pairs of all groups, by their second vertices, and the segments of all but those of one path.
    fn pair(&mut self) {
        let Reuse { order, first, second, rays, pairs, tails, .. } = self;
        rays.clear();
        pairs.clear();
        for group in order.chunk_by(|a, b| a.0 == b.0) {
            for &(_, j) in group {
                let Some(end) = second[j as usize].as_ref().filter(|_| !tails[j as usize].is_black()) else { continue };
                let vertex = first[j as usize].as_ref().map(|first| first.vertex);
                for &(_, i) in group {
                    let Some(start) = first[i as usize].as_ref().filter(|f| Some(f.vertex) == vertex) else { continue };
                    let g = density(&start.at, &end.at);
                    if i == j {
                        pairs.push(Pair { first: i, second: j, g });
                    } else if g > 0.0 {
                        pairs.push(Pair { first: i, second: j, g });
                        rays.push(&segment(&start.at, &end.at));
                    }
                }
            }
        }
    }

    /// Finds which pairs see each other.
    fn trace(&mut self, accel: &dyn Accel) {
        accel.occluded(&self.rays, Coherence::Packets, &mut self.occluded);
        let others = self.pairs.iter_mut().filter(|pair| pair.first != pair.second);
        for (pair, _) in others.zip(&self.occluded).filter(|(_, is_occluded)| **is_occluded) {
            pair.g = 0.0;
        }
    }

    /// Throughput beyond the first vertex of sample `i`.
    #[inline]
    fn beta(&self, i: usize) -> Rgb {
        self.first[i].map_or(Rgb::BLACK, |first| first.beta)
    }

    /// Distributes what was found from one second vertex on.
    fn distribute(&self, pairs: &[Pair], out: &mut [PixelSample]) {
        let j = pairs[0].second as usize;
        let tail = self.tails[j];
        let sum: f32 = pairs.iter().map(|pair| pair.g).sum();
        let own = pairs.iter().find(|pair| pair.first as usize == j).map_or(0.0, |pair| pair.g);
        if !(own > 0.0 && sum.is_finite() && tail.is_finite()) {
            // Of no use to others, such as a path along a surface
            out[j].radiance += self.beta(j) * tail;
            return;
        }
        for pair in pairs.iter().filter(|pair| pair.g > 0.0) {
            let i = pair.first as usize;
            out[i].radiance += self.beta(i) * tail * (pair.g / sum);
        }
    }
}

impl Groups {
    /// The group of a sample of a pixel, counted from the corner of the image.
    fn of(self, edge: u32, [x, y]: [u32; 2], turn: u32) -> u64 {
        let (cell, block) = match self {
            Groups::None => return 0,
            Groups::Grid => ([x / edge, y / edge], [0; 2]),
            Groups::Cells => {
                let cell = [x / CELL, y / CELL];
                let [dx, dy, ..] = pcg4d([cell[0], cell[1], turn, SEED]);
                let block = |p: u32, d: u32| (p % CELL + d % edge) / edge;
                (cell, [block(x, dx), block(y, dy)])
            }
        };
        // A batch has few cells, near each other, and at most CELL blocks in a row of one
        let ([cell_x, cell_y], [block_x, block_y]) = (cell.map(|c| u64::from(c & 0x7ff)), block.map(u64::from));
        u64::from(turn) << 32 | cell_y << 21 | cell_x << 10 | block_y << 5 | block_x
    }
}

/// π g: cos θ |cos θ_y|/‖y − x‖², if y lies above x, and x on the side of y that was lit.
#[inline]
fn density(x: &Place, y: &Place) -> f32 {
    let d = y.p - x.p;
    let (cos, cos_y, cos_shading) = (x.ns.dot(d), -y.n.dot(d), -y.ns.dot(d));
    if cos > 0.0 && cos_y > 0.0 && cos_shading > 0.0 {
        let d2 = d.length_squared();
        cos * cos_y / (d2 * d2)
    } else {
        0.0
    }
}

/// The shadow segment from x to y.
#[inline]
fn segment(x: &Place, y: &Place) -> Ray {
    let o = offset_origin(x.p, x.p_error, x.n, y.p - x.p);
    let end = offset_origin(y.p, y.p_error, y.n, o - y.p);
    Ray { o, d: end - o, t_max: SEGMENT_END, time: 0.0 }
}
