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
//! The samples of one turn in a block of pixels are a group. Blocks depend on the turn, so that the noise of two pixels is never
//! the same for all samples, and are within [cells](super::cells), which are always rendered together. Where pixels have
//! different numbers of samples, those of one turn are of the same part of the image
//! ([`crate::scene::PixelSamples::turn`]); the numbers are independent of the samples, and so is who is in a group.

use super::cells::Groups;
use super::features::{self, Feature};
use super::segment::CameraSample;
use crate::accel::{Coherence, RayBatch};
use crate::film::PixelSample;
use crate::scene::RenderJob;
use lumiris_lanes::columns::{Column, Columns3, padded, reserve};
use lumiris_lanes::connections::{Connections, Vertices, connect};
use lumiris_lanes::lane::LANES;
use lumiris_lanes::level;
use lumiris_lanes::vertex::Ends;
use lumiris_numbers::math::ray::SEGMENT_END;
use lumiris_numbers::math::{Rgb, Vec3};

/// Second vertices that are connected together.
const TOGETHER: usize = 16;

/// The edge of the blocks of pixels that share paths; 1 if none do.
pub fn edge(job: &RenderJob) -> u32 {
    if features::allows(job, Feature::Sharing) { job.settings().integrator.path_reuse.unwrap_or(1) } else { 1 }
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

/// A sample with a first vertex.
#[derive(Clone, Copy, Debug)]
struct Member {
    sample: u32,
    /// Index of the first vertex along the path.
    vertex: u32,
    /// Throughput beyond it.
    beta: Rgb,
}

/// A second vertex, and the first vertices of others that may see it.
#[derive(Clone, Copy, Debug)]
struct Shared {
    /// The member whose path it is of.
    member: u32,
    /// g of that member.
    own: f32,
    /// Where the shares of others end.
    end: usize,
}

/// What the paths of a batch share.
#[derive(Debug, Default)]
struct Shares {
    /// Those of one group after another.
    members: Vec<Member>,
    shared: Vec<Shared>,
    /// The members that may get something, those of one second vertex after another.
    to: Vec<u32>,
    /// g of these, or 0 where nothing gets through.
    g: Column,
    /// The segments between.
    rays: RayBatch,
    /// What the members get.
    sums: Vec<Rgb>,
}

/// The paths of a batch that are shared.
#[derive(Debug, Default)]
pub(super) struct Reuse {
    groups: Groups,
    /// Edge of the blocks; 1 or 0 if the batch shares nothing.
    edge: u32,
    /// Group and index of each sample, sorted: the index in the lower 32 bits.
    order: Vec<u128>,
    first: Vec<Option<First>>,
    second: Vec<Option<Second>>,
    /// Number of second vertices.
    count: u32,
    group: Group,
    shares: Shares,
    occluded: Vec<bool>,
    tails: Vec<Rgb>,
}

/// The vertices of a group, and what lies between them.
#[derive(Debug, Default)]
struct Group {
    /// The first one of its members.
    begin: usize,
    first: Places,
    /// Members whose second vertices were found, up to [`TOGETHER`].
    found: Vec<u32>,
    second: Places,
    g: Column,
    o: Columns3,
    d: Columns3,
    /// Which first vertices have segments to a second vertex that count.
    kept: Vec<u32>,
}

/// Places in columns.
#[derive(Debug, Default)]
struct Places {
    p: Columns3,
    p_error: Columns3,
    n: Columns3,
    ns: Columns3,
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
        self.count = 0;
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
                self.count += 1;
                Rgb::splat(beta.map(f32::abs).max_component() / first.beta.map(f32::abs).max_component())
            }
            Some(_) => beta,
        }
    }

    /// Gives each sample its part of what the paths of its group have found; returns the number of segments.
    pub(super) fn resolve(&mut self, job: &RenderJob, samples: &[CameraSample], out: &mut [PixelSample]) -> u64 {
        if self.count == 0 {
            return 0;
        }
        let (origin, groups, edge) = (job.world.scene.film.bounds, self.groups, self.edge);
        let rule = (edge, job.settings().sampling.seed);
        let pixel = |s: &CameraSample| [s.pixel[0] - origin.x0, s.pixel[1] - origin.y0];
        let group = |s: &CameraSample| groups.of(rule, pixel(s), (s.turn, s.is_replica));
        self.order.clear();
        self.order.extend(samples.iter().zip(0_u128..).map(|(s, i)| u128::from(group(s)) << 32 | i));
        self.order.sort_unstable();

        self.tails.clear();
        self.tails.extend(out.iter().map(|o| o.radiance));
        for (sample, second) in out.iter_mut().zip(&self.second) {
            if let Some(second) = second {
                sample.radiance = second.before;
            }
        }
        self.connect();
        job.world.accel.occluded(&self.shares.rays, Coherence::Packets, &mut self.occluded);
        self.shares.distribute(&self.occluded, &self.tails);
        for (member, &sum) in self.shares.members.iter().zip(&self.shares.sums) {
            out[member.sample as usize].radiance += member.beta * sum;
        }
        self.shares.rays.len() as u64
    }

    /// What the members of each group share, and the segments for it.
    fn connect(&mut self) {
        let Reuse { order, first, second, group, shares, tails, .. } = self;
        shares.clear();
        for samples in order.chunk_by(|a, b| a >> 32 == b >> 32) {
            group.begin = shares.members.len();
            for sample in samples.iter().map(|&entry| entry as u32) {
                let Some(First { at, vertex, beta }) = &first[sample as usize] else { continue };
                group.first.set(shares.members.len() - group.begin, at);
                shares.members.push(Member { sample, vertex: *vertex, beta: *beta });
            }
            for i in group.begin..shares.members.len() {
                let sample = shares.members[i].sample as usize;
                let Some(second) = second[sample].as_ref().filter(|_| !tails[sample].is_black()) else { continue };
                group.second.set(group.found.len(), &second.at);
                group.found.push(i as u32);
                if group.found.len() == TOGETHER {
                    group.connect(shares);
                }
            }
            group.connect(shares);
        }
        let (RayBatch { t_max, time, .. }, count) = (&mut shares.rays, shares.to.len());
        t_max.resize(count, SEGMENT_END);
        time.resize(count, 0.0);
    }
}

impl Group {
    /// What members get from the second vertices that were found, and the segments for it.
    fn connect(&mut self, shares: &mut Shares) {
        let (len, count) = (padded(shares.members.len() - self.begin), self.found.len());
        self.first.reserve(len);
        [&mut self.o, &mut self.d].into_iter().for_each(|columns| columns.reserve(len * count));
        reserve(&mut [&mut self.g], len * count);
        self.kept.resize(self.kept.len().max(len), 0);
        let (from, to) = (self.first.vertices(len), self.second.vertices(count));
        let (o, d) = (self.o.get_mut(len * count), self.d.get_mut(len * count));
        connect(level(), &from, &to, &mut Connections { g: &mut self.g[..len * count], o, d });
        for k in 0..count {
            self.share(k, len, shares);
        }
        self.found.clear();
    }

    /// What members get from the second vertex `k` of those that were found; columns have `len` first vertices for each.
    fn share(&mut self, k: usize, len: usize, shares: &mut Shares) {
        let member = self.found[k];
        let (own, vertex) = (member as usize - self.begin, shares.members[member as usize].vertex);
        let g = &self.g[k * len..][..len];
        let mut count = 0;
        for (i, (other, &g)) in shares.members[self.begin..].iter().zip(g).enumerate() {
            self.kept[count] = i as u32;
            count += usize::from(g > 0.0 && i != own && other.vertex == vertex);
        }
        let kept = &self.kept[..count];
        shares.to.extend(kept.iter().map(|&i| self.begin as u32 + i));
        let (o, d) = (self.o.get((k + 1) * len), self.d.get((k + 1) * len));
        let RayBatch { ox, oy, oz, dx, dy, dz, .. } = &mut shares.rays;
        let columns = [ox, oy, oz, dx, dy, dz].into_iter().zip(o.into_iter().chain(d).map(|from| &from[k * len..]));
        for (to, from) in columns.chain([(&mut shares.g, g)]) {
            to.extend(kept.iter().map(|&i| from[i as usize]));
        }
        shares.shared.push(Shared { member, own: g[own], end: shares.to.len() });
    }
}

impl Shares {
    fn clear(&mut self) {
        let Shares { members, shared, to, g, rays, sums: _ } = self;
        members.clear();
        shared.clear();
        to.clear();
        g.clear();
        rays.clear();
    }

    /// Gives members their parts of what was found, by sample, from second vertices on.
    fn distribute(&mut self, occluded: &[bool], tails: &[Rgb]) {
        self.sums.clear();
        self.sums.resize(self.members.len(), Rgb::BLACK);
        for (g, &is_occluded) in self.g.iter_mut().zip(occluded) {
            *g = if is_occluded { 0.0 } else { *g };
        }
        let mut begin = 0;
        for &Shared { member, own, end } in &self.shared {
            let (g, to) = (&self.g[begin..end], &self.to[begin..end]);
            begin = end;
            let tail = tails[self.members[member as usize].sample as usize];
            let sum = own + sum_of(g);
            if own > 0.0 && sum.is_finite() && tail.is_finite() {
                self.sums[member as usize] += tail * (own / sum);
                for (&to, &g) in to.iter().zip(g) {
                    self.sums[to as usize] += tail * (g / sum);
                }
            } else {
                // Of no use to others, such as a path along a surface
                self.sums[member as usize] += tail;
            }
        }
    }
}

/// The sum, in the order of as many sums as lanes.
fn sum_of(values: &[f32]) -> f32 {
    let (vectors, rest) = values.as_chunks::<LANES>();
    let mut sums = [0.0; LANES];
    for vector in vectors {
        for (sum, value) in sums.iter_mut().zip(vector) {
            *sum += value;
        }
    }
    sums.iter().chain(rest).sum()
}

impl Places {
    fn reserve(&mut self, len: usize) {
        let Places { p, p_error, n, ns } = self;
        [p, p_error, n, ns].into_iter().for_each(|columns| columns.reserve(len));
    }

    /// Sets place `i`, the last one so far or the one after it.
    fn set(&mut self, i: usize, at: &Place) {
        self.reserve(padded(i + 1));
        self.p.set(i, at.p);
        self.p_error.set(i, at.p_error);
        self.n.set(i, at.n);
        self.ns.set(i, at.ns);
    }

    fn vertices(&self, len: usize) -> Vertices<'_> {
        let Places { p, p_error, n, ns } = self;
        Vertices { ends: Ends { p: p.get(len), p_error: p_error.get(len), n: n.get(len) }, ns: ns.get(len) }
    }
}
