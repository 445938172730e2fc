//! A bounding volume hierarchy over lights, descended at random in proportion to an upper bound of each child's
//! contribution, [`LightBound::importance`] [Conty Estévez and Kulla 2018; Pharr et al. 2023, §12.6.3].

use super::build::{Item, build};
use super::node::Node;
use super::sampled_light::{LightRun, SampledLight, UNIT};
use crate::lights::{Light, LightBounds, LightCtx, LightId};
use lumiris_lanes::level;
use lumiris_lanes::light_descent::{DESCENTS, left_probabilities};
use lumiris_numbers::math::ONE_MINUS_EPSILON;
use lumiris_numbers::math::light_bound::{LightBound, first_probability};
use rayon::prelude::*;
use smallvec::SmallVec;
use std::hint::select_unpredictable;

/// Trail of lights that are not in the tree.
const NO_TRAIL: u64 = u64::MAX;

/// The hierarchy.
#[derive(Clone, Debug, Default)]
pub struct LightTree {
    pub(super) nodes: Vec<Node>,
    /// Per light, the path from the root to its leaf, first branch in the lowest bit; 1 is right.
    trails: Vec<u64>,
    /// Per light, its leaf.
    leaves: Vec<u32>,
}

/// An inner node above a cut of the tree.
#[derive(Clone, Copy, Debug)]
pub struct CutNode {
    index: u32,
    /// The first subtrees below its children.
    left: usize,
    right: usize,
}

/// A subtree, and the positions that chose it.
#[derive(Clone, Copy)]
struct SubtreeRun {
    root: u32,
    pmf: f32,
    /// Range of the positions in their list.
    range: [u32; 2],
    /// The part of [0, 1) that chooses the subtree.
    interval: [f64; 2],
}

/// Positions of a sorted list for which [`LightTree::runs`] chooses lights.
#[derive(Clone, Copy, Debug)]
pub struct RunPositions<'a> {
    /// All positions, ascending, in units of 2⁻³².
    pub positions: &'a [u32],
    /// Index of the first position to be considered.
    pub first: usize,
    /// Begin of the part of [0, 1) that is considered.
    pub start: f64,
    /// Factor of all probabilities.
    pub fraction: f32,
}

impl<'a> RunPositions<'a> {
    /// All positions in [0, 1).
    pub fn all(positions: &'a [u32]) -> Self {
        RunPositions { positions, first: 0, start: 0.0, fraction: 1.0 }
    }
}

impl LightTree {
    /// The tree over the lights that have bounds and that `holds` is true for.
    pub fn new(lights: &[Light], holds: impl Fn(&Light) -> bool + Sync) -> Self {
        let mut items: Vec<Item> = lights
            .par_iter()
            .enumerate()
            .filter(|(_, light)| holds(light))
            .filter_map(|(id, light)| Some(Item { id: id as LightId, bounds: light.bounds()? }))
            .filter(|item| item.bounds.bounds.center().is_finite() && item.bounds.intensity > 0.0)
            .collect();
        let mut tree =
            LightTree { trails: vec![NO_TRAIL; lights.len()], leaves: vec![0; lights.len()], ..LightTree::default() };
        if !items.is_empty() {
            tree.nodes = vec![Node::new(&LightBounds::EMPTY, true, 0); 2 * items.len() - 1];
            build(&mut tree.nodes, 0, &mut items, 0);
            tree.find_leaves();
        }
        tree
    }

    /// Sets `leaves` and `trails`.
    fn find_leaves(&mut self) {
        let mut stack = vec![(0, 0, 0)];
        while let Some((index, depth, trail)) = stack.pop() {
            let node = &self.nodes[index as usize];
            if node.is_leaf {
                self.trails[node.light_or_right_child as usize] = trail;
                self.leaves[node.light_or_right_child as usize] = index;
            } else {
                stack.extend([
                    (index + 1, depth + 1, trail),
                    (node.light_or_right_child, depth + 1, trail | 1 << depth),
                ]);
            }
        }
    }

    /// True if it holds no light.
    #[inline]
    pub fn is_empty(&self) -> bool {
        self.nodes.is_empty()
    }

    /// True if it holds more than one light.
    #[inline]
    pub fn has_choice(&self) -> bool {
        self.nodes.len() > 1
    }

    /// True if it holds the light.
    #[inline]
    pub fn contains(&self, light: LightId) -> bool {
        self.trails.get(light as usize).is_some_and(|&trail| trail != NO_TRAIL)
    }

    /// The bound of all lights, if there are any.
    pub fn root(&self) -> Option<&LightBound> {
        self.nodes.first().map(|root| &root.bound)
    }

    #[inline]
    fn children(&self, index: usize) -> [&Node; 2] {
        [&self.nodes[index + 1], &self.nodes[self.nodes[index].light_or_right_child as usize]]
    }

    /// Upper bound, up to a common factor, of the contribution of all lights together at a point; 0 if none can
    /// contribute.
    #[inline]
    pub fn importance(&self, ctx: &LightCtx) -> f32 {
        self.nodes.first().map_or(0.0, |root| root.importance(ctx))
    }

    /// Upper bound, up to the same factor, of the contribution of one light at a point; 0 if it is not in the tree.
    #[inline]
    pub fn light_importance(&self, ctx: &LightCtx, light: LightId) -> f32 {
        self.bound(light).map_or(0.0, |bound| bound.importance(&ctx.receiver()))
    }

    /// The bound of a light; `None` if it is not in the tree.
    #[inline]
    pub fn bound(&self, light: LightId) -> Option<&LightBound> {
        self.leaf(light).map(|leaf| &self.nodes[leaf as usize].bound)
    }

    /// Probability of the left child of an inner node. If neither child can contribute, the intensities decide. The
    /// probabilities of all leaves therefore always add up to 1.
    #[inline]
    fn left_probability(&self, ctx: &LightCtx, index: u32) -> f32 {
        let [left, right] = self.children(index as usize);
        first_probability(
            [left.importance(ctx), right.importance(ctx)],
            [left.bound.intensity(), right.bound.intensity()],
        )
    }

    /// Chooses a light by `u` in [0, 1).
    #[inline]
    pub fn sample(&self, ctx: &LightCtx, u: f32) -> Option<SampledLight> {
        if self.is_empty() { None } else { self.sample_below(ctx, 0, u) }
    }

    /// Chooses a light of the subtree below a node by `u` in [0, 1); `pmf` is the probability in the subtree.
    #[inline]
    pub fn sample_below(&self, ctx: &LightCtx, root: u32, u: f32) -> Option<SampledLight> {
        let (mut index, mut u, mut pmf) = (root, u, 1.0);
        let mut node = &self.nodes[index as usize];
        while !node.is_leaf {
            // Descend, and rescale the random number. Without branches, since half of them would be predicted wrongly
            let p = self.left_probability(ctx, index);
            let is_left = u < p;
            let (offset, taken) = select_unpredictable(is_left, (u, p), (u - p, 1.0 - p));
            pmf *= taken;
            u = (offset / taken).min(ONE_MINUS_EPSILON);
            index = select_unpredictable(is_left, index + 1, node.light_or_right_child);
            node = &self.nodes[index as usize];
        }
        (pmf > 0.0).then_some(SampledLight { light: node.light_or_right_child, pmf, u })
    }

    /// Appends runs for the positions. They descend the tree together, so that each node is evaluated once.
    pub fn runs(&self, ctx: &LightCtx, at: RunPositions<'_>, out: &mut Vec<LightRun>) {
        if self.is_empty() || at.first == at.positions.len() {
            return;
        }
        let first_run = out.len();
        let range = [at.first as u32, at.positions.len() as u32];
        let mut queue = SmallVec::<[SubtreeRun; DESCENTS]>::new();
        queue.push(SubtreeRun { root: 0, pmf: 1.0, range, interval: [at.start, 1.0] });
        let mut done = 0;
        while done < queue.len() {
            let batch = done..queue.len().min(done + DESCENTS);
            done = batch.end;
            let p = self.left_probabilities(ctx, &queue[batch.clone()]);
            for (i, p) in batch.zip(p) {
                let SubtreeRun { root, pmf, range: [first, end], interval } = queue[i];
                let node = &self.nodes[root as usize];
                if node.is_leaf {
                    if pmf > 0.0 {
                        let pmf = pmf * at.fraction;
                        out.push(LightRun { light: node.light_or_right_child, pmf, range: [first, end], interval });
                    }
                    continue;
                }

                // Split the positions at the boundary between the children
                let middle = interval[0] + (interval[1] - interval[0]) * f64::from(p);
                let is_left = |&x: &u32| f64::from(x) * UNIT < middle;
                let split = first + at.positions[first as usize..end as usize].partition_point(is_left) as u32;
                if first < split {
                    let interval = [interval[0], middle];
                    queue.push(SubtreeRun { root: root + 1, pmf: pmf * p, range: [first, split], interval });
                }
                if split < end {
                    let (root, pmf) = (node.light_or_right_child, pmf * (1.0 - p));
                    queue.push(SubtreeRun { root, pmf, range: [split, end], interval: [middle, interval[1]] });
                }
            }
        }
        out[first_run..].sort_unstable_by_key(|run| run.range[0]);
    }

    /// The probabilities of the left children of at most [`DESCENTS`] subtrees; meaningless for leaves.
    fn left_probabilities(&self, ctx: &LightCtx, subtrees: &[SubtreeRun]) -> [f32; DESCENTS] {
        let is_inner = |subtree: &SubtreeRun| !self.nodes[subtree.root as usize].is_leaf;
        let mut p = [0.0; DESCENTS];
        match subtrees {
            // A vector would be slower
            [subtree] if is_inner(subtree) => p[0] = self.left_probability(ctx, subtree.root),
            _ if subtrees.iter().any(is_inner) => {
                let mut children = [[&self.nodes[0].bound; DESCENTS]; 2];
                for (i, subtree) in subtrees.iter().enumerate().filter(|(_, subtree)| is_inner(subtree)) {
                    [children[0][i], children[1][i]] = self.children(subtree.root as usize).map(|child| &child.bound);
                }
                let [left, right] = &children;
                left_probabilities(level(), &ctx.receiver(), [left, right], subtrees.len(), &mut p);
            }
            _ => {}
        }
        p
    }

    /// At most `max` disjoint subtrees that together hold all lights, by their root nodes. Repeatedly splits the
    /// subtree with the largest extent, weighted by its intensity. Empty without lights, or if `max` is 0.
    pub fn cut(&self, max: usize) -> Vec<u32> {
        let mut cut: Vec<u32> = if self.is_empty() || max == 0 { Vec::new() } else { vec![0] };
        while cut.len() < max {
            let spread = |&index: &u32| {
                let node = &self.nodes[index as usize];
                if node.is_leaf { -1.0 } else { node.bound.intensity() * node.bound.radius_squared() }
            };
            let widest = (0..cut.len()).max_by(|&a, &b| spread(&cut[a]).total_cmp(&spread(&cut[b])));
            let Some(widest) = widest.filter(|&i| !self.nodes[cut[i] as usize].is_leaf) else { break };
            let index = cut[widest];
            cut[widest] = index + 1;
            cut.push(self.nodes[index as usize].light_or_right_child);
        }
        cut.sort_unstable();
        cut
    }

    /// Calls `visit` with each light of the subtree below a node.
    pub fn visit_lights(&self, index: u32, visit: &mut dyn FnMut(LightId)) {
        let node = &self.nodes[index as usize];
        if node.is_leaf {
            visit(node.light_or_right_child);
        } else {
            self.visit_lights(index + 1, visit);
            self.visit_lights(node.light_or_right_child, visit);
        }
    }

    /// The inner nodes above a [`cut`](Self::cut), each before those below it.
    pub fn above(&self, cut: &[u32]) -> Vec<CutNode> {
        let mut above = Vec::new();
        if !cut.is_empty() {
            self.add_above(0, cut, 0, &mut above);
        }
        above
    }

    /// Appends the inner nodes from `node` on down; `first` is the index of the first subtree below it. Returns the
    /// index after its last subtree.
    fn add_above(&self, index: u32, cut: &[u32], first: usize, above: &mut Vec<CutNode>) -> usize {
        if cut.binary_search(&index).is_ok() {
            return first + 1;
        }
        let i = above.len();
        above.push(CutNode { index, left: first, right: first });
        let right = self.add_above(index + 1, cut, first, above);
        above[i].right = right;
        self.add_above(self.nodes[index as usize].light_or_right_child, cut, right, above)
    }

    /// Probabilities with which [`sample`](Self::sample) enters each subtree of a non-empty cut, in its order. `above`
    /// are the nodes [`above`](Self::above) the cut.
    #[inline]
    pub fn cut_pmfs(&self, ctx: &LightCtx, above: &[CutNode], pmfs: &mut [f32]) {
        pmfs[0] = 1.0;
        for &CutNode { index, left, right } in above {
            let p = self.left_probability(ctx, index);
            let pmf = pmfs[left];
            pmfs[left] = pmf * p;
            pmfs[right] = pmf * (1.0 - p);
        }
    }

    /// The probability of the left child of each node on the way down, with the importances `importance(index, node,
    /// count)`. `count` is the number of `leaves` below the node; `leaves` are indices of leaves in ascending order,
    /// which are chosen only if no other light can contribute. Nodes are indexed as in [`Self::sums`].
    #[inline]
    fn left_by<'a>(
        &'a self,
        leaves: &'a [u32],
        importance: impl Fn(usize, &Node, usize) -> f32 + 'a,
    ) -> impl FnMut(u32) -> f32 + 'a {
        // Leaves below the node; those below its right child; the last node, with the number below its left child
        let (mut below, mut right_of, mut last) = (leaves, leaves, None);
        move |index| {
            // Keep the leaves below the chosen child of the last node
            if let Some((parent, middle)) = last {
                below = if index == parent + 1 { &below[..middle] } else { right_of };
            }
            let right_index = self.nodes[index as usize].light_or_right_child;
            let middle = below.partition_point(|&leaf| leaf < right_index);

            // Importances of both children
            let [left, right] = self.children(index as usize);
            let of = |index: u32, child: &Node, count: usize| {
                if child.is_leaf && count > 0 { 0.0 } else { importance(index as usize, child, count) }
            };
            let importances = [of(index + 1, left, middle), of(right_index, right, below.len() - middle)];
            (right_of, last) = (&below[middle..], Some((index, middle)));
            first_probability(importances, [left.bound.intensity(), right.bound.intensity()])
        }
    }

    /// Index of the leaf of a light; `None` if it is not in the tree.
    #[inline]
    pub fn leaf(&self, light: LightId) -> Option<u32> {
        self.contains(light).then(|| self.leaves[light as usize])
    }

    /// For each node, the sum of `of` over the lights below it.
    pub fn sums(&self, of: impl Fn(LightId) -> f32) -> Vec<f32> {
        let mut sums = vec![0.0; self.nodes.len()];
        // Children follow their parents
        for (index, node) in self.nodes.iter().enumerate().rev() {
            sums[index] = if node.is_leaf {
                of(node.light_or_right_child)
            } else {
                sums[index + 1] + sums[node.light_or_right_child as usize]
            };
        }
        sums
    }

    /// The light of a tree of one light.
    pub fn only_light(&self) -> Option<LightId> {
        if let [leaf] = &self.nodes[..] { Some(leaf.light_or_right_child) } else { None }
    }

    /// Probability that [`sample`](Self::sample) chooses `light`.
    #[inline]
    pub fn pmf(&self, ctx: &LightCtx, light: LightId) -> f32 {
        self.probability(light, |index| self.left_probability(ctx, index))
    }

    /// Probability that [`sample_by_photons`](Self::sample_by_photons) chooses `light`; `importance` as in `left_by`.
    #[inline]
    pub(in crate::lights) fn pmf_by(
        &self,
        light: LightId,
        leaves: &[u32],
        importance: impl Fn(usize, &Node, usize) -> f32,
    ) -> f32 {
        self.probability(light, self.left_by(leaves, importance))
    }

    /// Probability of the path to a light; `left` is the probability of the left child of a node.
    #[inline]
    fn probability(&self, light: LightId, mut left: impl FnMut(u32) -> f32) -> f32 {
        if !self.contains(light) {
            return 0.0;
        }
        let (mut index, mut pmf, mut trail) = (0, 1.0, self.trails[light as usize]);
        while !self.nodes[index as usize].is_leaf {
            let p = left(index);
            if trail & 1 == 0 {
                pmf *= p;
                index += 1;
            } else {
                pmf *= 1.0 - p;
                index = self.nodes[index as usize].light_or_right_child;
            }
            trail >>= 1;
        }
        pmf
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Shape, TriangleMesh};
    use crate::lights::{Emission, GlossyLobe, PointLight, SpotLight, area_lights_of};
    use lumiris_numbers::math::warp::sample_uniform_sphere;
    use lumiris_numbers::math::{Rgb, Vec3};
    use lumiris_test_support::assert_chi_squared;
    use lumiris_test_support::random::{Pcg32, RngExt, pcg32};

    /// Lights of all kinds in the cube 0..scale, about half of them in small clusters.
    fn random_lights(count: usize, scale: f32, key: u32) -> Vec<Light> {
        let mut s = pcg32([key, 17, 0]);
        (0..count)
            .map(|i| {
                let mut vector = || Vec3::new(s.random::<f32>(), s.random::<f32>(), s.random::<f32>());

                // Every second light is in a cluster at the centre
                let p = if i % 2 == 0 { vector() } else { vector() * 0.02 + 0.5 } * scale;
                let l = Rgb::splat(s.random::<f32>().powi(4) * 10.0 + 0.01);
                let axis = sample_uniform_sphere(s.random::<[f32; 2]>());
                match i % 5 {
                    0 => Light::Point(PointLight { p, intensity: l * scale * scale }),
                    1 => {
                        let (a, b) = (s.random::<f32>(), s.random::<f32>());
                        let cos_total = a.min(b) * 2.0 - 1.0;
                        let cos_falloff_start = a.max(b) * 2.0 - 1.0;
                        Light::Spot(SpotLight { p, axis, cos_total, cos_falloff_start, intensity: l * scale * scale })
                    }
                    k => {
                        let mut edge = || sample_uniform_sphere(s.random::<[f32; 2]>()) * scale * 0.01;
                        let mesh = TriangleMesh::new(vec![p, p + edge(), p + edge()], vec![[0, 1, 2]]).unwrap();
                        let emission = Emission { two_sided: k == 2, ..Emission::constant(l) };
                        Light::Area(area_lights_of(&Shape::Mesh(mesh), &emission).lights.remove(0))
                    }
                }
            })
            .collect()
    }

    fn tree_of(lights: &[Light]) -> LightTree {
        LightTree::new(lights, |_| true)
    }

    fn random_ctx(s: &mut Pcg32, scale: f32) -> LightCtx {
        let p = (Vec3::new(s.random::<f32>(), s.random::<f32>(), s.random::<f32>()) * 1.6 - 0.3) * scale;
        let n = sample_uniform_sphere(s.random::<[f32; 2]>());
        match s.random_range(0..5) {
            0 => LightCtx::at(p),
            1 | 2 => LightCtx::on(p, n),
            _ => {
                let (alpha, share) = (s.random::<f32>().powi(2), s.random::<f32>().sqrt());
                let lobe = GlossyLobe::new(sample_uniform_sphere(s.random::<[f32; 2]>()), n, alpha, share);
                LightCtx { lobe, ..LightCtx::on(p, n) }
            }
        }
    }

    #[test]
    fn probabilities_add_up_to_one_everywhere() {
        for (count, key) in [(1, 1), (2, 2), (7, 3), (300, 4)] {
            let tree = tree_of(&random_lights(count, 1.0, key));
            let mut s = pcg32([key, 1, 1]);
            for _ in 0..200 {
                let ctx = random_ctx(&mut s, 1.0);
                let sum: f64 = (0..count as u32).map(|i| f64::from(tree.pmf(&ctx, i))).sum();
                assert!((sum - 1.0).abs() < 1e-4, "{count} lights: {sum}");
            }
        }
    }

    #[test]
    fn choices_follow_the_probabilities_and_remapped_numbers_are_uniform() {
        let lights = random_lights(40, 1.0, 9);
        let tree = tree_of(&lights);
        let mut s = pcg32([5, 1, 1]);
        for _ in 0..5 {
            let ctx = random_ctx(&mut s, 1.0);
            let count = 100_000;
            let mut observed = vec![0.0; lights.len() * 4];
            for _ in 0..count {
                let SampledLight { light, pmf, u } = tree.sample(&ctx, s.random::<f32>()).unwrap();
                assert_eq!(pmf, tree.pmf(&ctx, light));
                observed[light as usize * 4 + (u * 4.0) as usize] += 1.0;
            }
            let expected: Vec<f64> = (0..observed.len())
                .map(|i| (f64::from(tree.pmf(&ctx, (i / 4) as u32)) / 4.0 * f64::from(count)).max(1e-3))
                .collect();
            assert_chi_squared(&observed, &expected, 1e-5);
        }
    }

    #[test]
    fn a_light_that_can_contribute_can_be_chosen() {
        for scale in [1e-3, 1.0, 1e3] {
            let lights = random_lights(150, scale, 21);
            let tree = tree_of(&lights);
            let mut s = pcg32([6, 1, 1]);
            let mut contributions = 0;
            for _ in 0..400 {
                let ctx = random_ctx(&mut s, scale);
                for (i, light) in lights.iter().enumerate() {
                    // Any of four samples with radiance
                    let contributes = (0..4).any(|_| {
                        let sample = light.sample_li(&ctx, s.random::<[f32; 2]>());
                        sample.is_some_and(|s| !s.li.is_black() && (ctx.ns == Vec3::ZERO || s.wi.dot(ctx.ns) != 0.0))
                    });
                    contributions += u32::from(contributes);
                    assert!(!contributes || tree.pmf(&ctx, i as u32) > 0.0, "light {i} starves at {ctx:?}: {light:?}");
                }
            }
            assert!(contributions > 10_000);
        }
    }

    #[test]
    fn the_choice_does_not_depend_on_the_unit_of_length() {
        let reference = tree_of(&random_lights(60, 1.0, 33));
        for scale in [1.0 / 1024.0, 1024.0, 1e-3, 1e3] {
            let scaled = tree_of(&random_lights(60, scale, 33));
            let (mut a, mut b) = (pcg32([7, 1, 1]), pcg32([7, 1, 1]));
            // Powers of two are exact.
            let tolerance = if scale.log2().fract() == 0.0 { 0.0 } else { 1e-3 };
            for _ in 0..100 {
                let (ctx, scaled_ctx) = (random_ctx(&mut a, 1.0), random_ctx(&mut b, scale));
                for light in 0..60 {
                    let (p, q) = (reference.pmf(&ctx, light), scaled.pmf(&scaled_ctx, light));
                    assert!((p - q).abs() <= tolerance * p.max(1e-3), "{scale}: light {light}: {p} {q}");
                }
            }
        }
    }

    #[test]
    fn the_tree_does_not_depend_on_the_number_of_threads() {
        let lights = random_lights(20_000, 1.0, 3);
        let [one, three] = [1, 3].map(|threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| format!("{:?}", tree_of(&lights)))
        });
        assert!(one == three);
    }

    #[test]
    fn near_lights_are_preferred() {
        let at = |x: f32| Light::Point(PointLight { p: Vec3::new(x, 0.0, 0.0), intensity: Rgb::WHITE });
        let tree = tree_of(&[at(0.0), at(10.0)]);
        let pmf = tree.pmf(&LightCtx::at(Vec3::new(1.0, 0.0, 0.0)), 0);
        assert!((pmf - 81.0 / 82.0).abs() < 1e-5, "{pmf}");
    }

    #[test]
    fn degenerate_sets_are_handled() {
        let ctx = LightCtx::on(Vec3::ZERO, Vec3::Y);
        // None, or none that shines.
        assert!(tree_of(&[]).sample(&ctx, 0.5).is_none());
        let black = Light::Point(PointLight { p: Vec3::ONE, intensity: Rgb::BLACK });
        let mesh = TriangleMesh::new(vec![Vec3::ONE, Vec3::ONE, Vec3::X], vec![[0, 1, 2]]).unwrap();
        let flat = area_lights_of(&Shape::Mesh(mesh), &Emission::constant(Rgb::WHITE)).lights.remove(0);
        let dark = [black.clone(), Light::Area(flat), Light::InfiniteConstant { l: Rgb::WHITE }];
        let tree = tree_of(&dark);
        assert!(tree.is_empty() && tree.sample(&ctx, 0.5).is_none() && tree.pmf(&ctx, 0) == 0.0);

        // One light, the same light many times, lights on a line, and the point on a light.
        let one = Light::Point(PointLight { p: Vec3::ONE, intensity: Rgb::WHITE });
        assert_eq!(tree_of(&[black, one.clone()]).sample(&ctx, 0.9).map(|s| (s.light, s.pmf)), Some((1, 1.0)));
        let same = vec![one; 1000];
        let line: Vec<Light> = (0..1000)
            .map(|i| {
                Light::Point(PointLight { p: Vec3::new(1e-3 * 1.01_f32.powi(i), 0.0, 0.0), intensity: Rgb::WHITE })
            })
            .collect();
        for lights in [same, line] {
            let tree = tree_of(&lights);
            for p in [Vec3::ZERO, Vec3::ONE, Vec3::new(1e-3, 0.0, 0.0)] {
                let ctx = LightCtx { p, ..ctx };
                let sum: f64 = (0..1000).map(|i| f64::from(tree.pmf(&ctx, i))).sum();
                assert!((sum - 1.0).abs() < 1e-3, "{sum}");
            }
        }
        // Opposite axes have no common cone.
        let spot = |axis| {
            Light::Spot(SpotLight { p: Vec3::ONE, axis, cos_total: 0.9, cos_falloff_start: 0.9, intensity: Rgb::WHITE })
        };
        let tree = tree_of(&[spot(Vec3::Y), spot(-Vec3::Y)]);
        assert!(tree.pmf(&LightCtx::at(Vec3::new(1.0, 5.0, 1.0)), 0) == 1.0);
    }

    #[test]
    fn a_hundred_thousand_lights_make_a_full_tree() {
        let tree = tree_of(&random_lights(100_000, 1.0, 55));
        assert_eq!(tree.nodes.len(), 199_999);
        let mut s = pcg32([8, 1, 1]);
        let ctx = random_ctx(&mut s, 1.0);
        for _ in 0..100_000 {
            let SampledLight { light, pmf, .. } = tree.sample(&ctx, s.random::<f32>()).unwrap();
            assert!(pmf > 0.0 && light < 100_000);
        }
    }
}
