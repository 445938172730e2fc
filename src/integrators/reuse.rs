//! Path sharing between neighbouring pixels [Bekaert et al. 2002].
//!
//! Let x_i be the first Lambertian vertices of some paths, and y_j the next vertices of these paths, Lambertian as
//! well. L(y_j), the radiance reflected at y_j, is the same in all directions of one side. So the part of path j after
//! y_j contributes to every x_i that is visible from y_j. Each x_i has sampled one direction in proportion to the
//! cosine. Its density at y is g_i(y) = cos θ_i |cos θ_y|/(π ‖y − x_i‖²) per unit area, where y is visible. By the
//! balance heuristic over all x_i, the indirect light of x_i with reflectance ρ_i is
//!
//! ρ_i Σ_j L(y_j) g_i(y_j) V_ij / Σ_k g_k(y_j) V_kj,
//!
//! where V is traced by shadow segments. No path gets a greater weight than without sharing. The estimate is unbiased,
//! since the participation of x_i does not depend on its sampled direction. Light from non-Lambertian surfaces, from
//! beyond non-scattering surfaces, and of emitters is not shared.
//!
//! Paths are shared by samples of one [share group](crate::scene::PixelSamples::share_group) in a block of pixels.
//! Blocks depend on the share group, so that the noise of two pixels is never the same for all samples. Blocks are
//! within [cells](super::cells), which are always rendered together. The sample counts of pixels are independent of the
//! samples, and so are share groups and blocks.

use super::camera_sample::CameraSamples;
use super::cells::Blocks;
use super::exclusions::{self, Feature};
use super::path_state::PathState;
use crate::accel::{Coherence, RayBatch};
use crate::film::PixelSample;
use crate::scene::RenderJob;
use lumiris_lanes::columns::{Column, Columns3, padded, reserve, select_rows};
use lumiris_lanes::connections::{Connections, Vertices, connect};
use lumiris_lanes::lane::LANES;
use lumiris_lanes::level;
use lumiris_lanes::vertex::Ends;
use lumiris_numbers::math::ray::SEGMENT_END;
use lumiris_numbers::math::{Rgb, Vec3};

/// Number of second vertices that are connected together.
const TOGETHER: usize = 16;

/// Edge of the blocks of pixels that share paths; 1 if paths are not shared.
pub fn edge(job: &RenderJob) -> u32 {
    if exclusions::allows(job, Feature::Sharing) { job.settings().integrator.path_reuse.unwrap_or(1) } else { 1 }
}

/// A Lambertian vertex: point, bound of its rounding error, and geometric and shading normals on the side of the
/// viewer.
#[derive(Clone, Copy, Debug)]
pub(super) struct LambertianVertex {
    pub(super) p: Vec3,
    pub(super) p_error: Vec3,
    pub(super) n: Vec3,
    pub(super) ns: Vec3,
}

impl LambertianVertex {
    /// A vertex given by its point with the error bound, the geometric and the shading normal, and the direction to the
    /// viewer.
    #[inline]
    pub(super) fn new(p: Vec3, p_error: Vec3, n: Vec3, ns: Vec3, wo: Vec3) -> Self {
        let facing = |n: Vec3| if n.dot(wo) < 0.0 { -n } else { n };
        LambertianVertex { p, p_error, n: facing(n), ns: facing(ns) }
    }
}

/// The first Lambertian vertex of a path.
#[derive(Clone, Copy, Debug)]
struct First {
    at: LambertianVertex,
    /// Index along the path.
    vertex: u32,
    /// Throughput beyond it.
    beta: Rgb,
}

/// The vertex after it. The light beyond is shared.
#[derive(Clone, Copy, Debug)]
struct Second {
    at: LambertianVertex,
    /// Radiance of the sample up to this vertex.
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

/// A second vertex, and the first vertices of other members that may be visible from it.
#[derive(Clone, Copy, Debug)]
struct Shared {
    /// The member that owns the path.
    member: u32,
    /// g of that member.
    own: f32,
    /// End of its entries in [`Shares::to`].
    end: usize,
}

/// Shared contributions of a batch.
#[derive(Debug, Default)]
struct Shares {
    /// Group by group.
    members: Vec<Member>,
    shared: Vec<Shared>,
    /// The receiving members, second vertex by second vertex.
    to: Vec<u32>,
    /// g of the receiving members; 0 if occluded.
    g: Column,
    /// The shadow segments.
    rays: RayBatch,
    /// Sum of the shared radiance per member.
    sums: Vec<Rgb>,
}

/// Path sharing within a batch.
#[derive(Debug, Default)]
pub(super) struct Reuse {
    blocks: Blocks,
    /// Edge of the blocks; 1 or 0 if nothing is shared.
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

/// The vertices of a group, and the segments between them.
#[derive(Debug, Default)]
struct Group {
    /// Index of its first member.
    begin: usize,
    first: VertexColumns,
    /// Members with second vertices, up to [`TOGETHER`].
    connecting: Vec<u32>,
    second: VertexColumns,
    g: Column,
    o: Columns3,
    d: Columns3,
    /// First vertices with a non-zero g for a second vertex.
    kept: Vec<u32>,
}

/// Vertices in columns.
#[derive(Debug, Default)]
struct VertexColumns {
    p: Columns3,
    p_error: Columns3,
    n: Columns3,
    ns: Columns3,
}

impl Reuse {
    pub(super) fn of(blocks: Blocks) -> Self {
        Reuse { blocks, ..Reuse::default() }
    }

    /// Begins a batch of `count` samples, which share paths in blocks of the given edge; `None`: nothing is shared.
    pub(super) fn begin(&mut self, edge: Option<u32>, count: usize) {
        self.edge = edge.filter(|_| self.blocks != Blocks::None).unwrap_or(1);
        let count = if self.edge > 1 { count } else { 0 };
        self.first.clear();
        self.first.resize(count, None);
        self.second.clear();
        self.second.resize(count, None);
        self.count = 0;
    }

    /// `self`, if the batch shares paths.
    #[inline]
    pub(super) fn active(&mut self) -> Option<&mut Self> {
        (self.edge > 1).then_some(self)
    }

    /// Registers a Lambertian vertex of a path, with its index along the path and the reflectance `rho`. If the light
    /// beyond is shared, the throughput becomes 1 but for the roulette since the first vertex, and the radiance of the
    /// sample restarts at 0.
    #[inline]
    pub(super) fn add(
        &mut self,
        path: &mut PathState,
        vertex: u32,
        at: LambertianVertex,
        rho: Rgb,
        radiance: &mut Rgb,
    ) {
        let sample = path.sample as usize;
        let (first, second) = (&mut self.first[sample], &mut self.second[sample]);
        match first {
            None => {
                // Without throughput the path ends here
                let beyond = path.beta * rho;
                *first = (!beyond.is_black() && beyond.is_finite()).then_some(First { at, vertex, beta: beyond });
            }
            Some(first) if first.vertex + 1 == vertex && path.passed == 0 && second.is_none() => {
                *second = Some(Second { at, before: std::mem::replace(radiance, Rgb::BLACK) });
                self.count += 1;
                let [beta, of_first] = [path.beta, first.beta].map(|beta| beta.map(f32::abs).max_component());
                path.beta = Rgb::splat(beta / of_first);
            }
            Some(_) => {}
        }
    }

    /// Distributes the light of the paths of each group to its samples; returns the number of segments.
    pub(super) fn resolve(&mut self, job: &RenderJob, samples: &CameraSamples, out: &mut [PixelSample]) -> u64 {
        if self.count == 0 {
            return 0;
        }

        // Sort the samples by group
        let (origin, blocks, edge) = (job.world.scene.film.bounds, self.blocks, self.edge);
        let seed = job.settings().sampling.seed;
        let group = |[x, y]: [u32; 2], share_group: u32| {
            blocks.of(edge, seed, [x - origin.x0, y - origin.y0], share_group, samples.are_replicas)
        };
        self.order.clear();
        let of_samples = samples.pixel.iter().zip(&samples.share_group).zip(0_u128..);
        self.order.extend(of_samples.map(|((&pixel, &share), i)| u128::from(group(pixel, share)) << 32 | i));
        self.order.sort_unstable();

        // Separate the radiance beyond the second vertices, which is shared
        self.tails.clear();
        self.tails.extend(out.iter().map(|o| o.radiance));
        for (sample, second) in out.iter_mut().zip(&self.second) {
            if let Some(second) = second {
                sample.radiance = second.before;
            }
        }

        // Weights, visibility, distribution
        self.connect();
        job.world.accel.occluded(&self.shares.rays, Coherence::Packets, &mut self.occluded);
        self.shares.distribute(&self.occluded, &self.tails);
        for (member, &sum) in self.shares.members.iter().zip(&self.shares.sums) {
            out[member.sample as usize].radiance += member.beta * sum;
        }
        self.shares.rays.len() as u64
    }

    /// Computes g for all pairs of members of each group, and the shadow segments.
    fn connect(&mut self) {
        let Reuse { order, first, second, group, shares, tails, .. } = self;
        shares.clear();
        for samples in order.chunk_by(|a, b| a >> 32 == b >> 32) {
            // First vertices
            group.begin = shares.members.len();
            for sample in samples.iter().map(|&entry| entry as u32) {
                let Some(First { at, vertex, beta }) = &first[sample as usize] else { continue };
                group.first.set(shares.members.len() - group.begin, at);
                shares.members.push(Member { sample, vertex: *vertex, beta: *beta });
            }

            // Second vertices whose light is not black, a few at a time
            for i in group.begin..shares.members.len() {
                let sample = shares.members[i].sample as usize;
                let Some(second) = second[sample].as_ref().filter(|_| !tails[sample].is_black()) else { continue };
                group.second.set(group.connecting.len(), &second.at);
                group.connecting.push(i as u32);
                if group.connecting.len() == TOGETHER {
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
    /// Connects all members to the pending second vertices.
    fn connect(&mut self, shares: &mut Shares) {
        let (len, count) = (padded(shares.members.len() - self.begin), self.connecting.len());
        self.first.reserve(len);
        [&mut self.o, &mut self.d].into_iter().for_each(|columns| columns.reserve(len * count));
        reserve(&mut [&mut self.g], len * count);
        let (from, to) = (self.first.vertices(len), self.second.vertices(count));
        let (o, d) = (self.o.get_mut(len * count), self.d.get_mut(len * count));
        connect(level(), &from, &to, &mut Connections { g: &mut self.g[..len * count], o, d });
        for k in 0..count {
            self.share(k, len, shares);
        }
        self.connecting.clear();
    }

    /// Appends the members with a non-zero g for the pending second vertex `k`. The columns have `len` first vertices
    /// for each second vertex.
    fn share(&mut self, k: usize, len: usize, shares: &mut Shares) {
        let member = self.connecting[k];
        let own = member as usize - self.begin;
        let vertex = shares.members[member as usize].vertex;
        // Members at the same vertex index to whom the vertex may be visible
        let (g, members) = (&self.g[k * len..][..len], &shares.members[self.begin..]);
        let n = members.len().min(len);
        select_rows(n, |i| (g[i] > 0.0) & (i != own) & (members[i].vertex == vertex), &mut self.kept);
        let kept = &self.kept[..];
        shares.to.extend(kept.iter().map(|&i| self.begin as u32 + i));

        // Their segments
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

    /// Adds the radiance `tails` beyond the second vertices, given by sample, to the members, by the balance heuristic.
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
                // Not usable by others, for example a path along a surface
                self.sums[member as usize] += tail;
            }
        }
    }
}

/// The sum of `values`, by one partial sum per lane.
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

impl VertexColumns {
    fn reserve(&mut self, len: usize) {
        let VertexColumns { p, p_error, n, ns } = self;
        [p, p_error, n, ns].into_iter().for_each(|columns| columns.reserve(len));
    }

    /// Sets vertex `i`: the last one, or the one after it.
    fn set(&mut self, i: usize, at: &LambertianVertex) {
        self.reserve(padded(i + 1));
        self.p.set(i, at.p);
        self.p_error.set(i, at.p_error);
        self.n.set(i, at.n);
        self.ns.set(i, at.ns);
    }

    fn vertices(&self, len: usize) -> Vertices<'_> {
        let VertexColumns { p, p_error, n, ns } = self;
        Vertices { ends: Ends { p: p.get(len), p_error: p_error.get(len), n: n.get(len) }, ns: ns.get(len) }
    }
}
