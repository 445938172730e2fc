//! A bounding volume hierarchy over lights, descended at random in proportion to an upper bound of each child's
//! contribution ([`lumiris_numbers::math::light_bound`]) [Conty Estévez and Kulla 2018; Pharr et al. 2023, §12.6.3].

use super::build::{Item, build};
use super::node::Node;
use super::sampled_light::LightRun;
use super::turns::Turns;
use crate::lights::{LightBounds, LightCtx, LightId};
use lumiris_numbers::math::ONE_MINUS_EPSILON;
use lumiris_numbers::math::light_bound::{LightBound, first_probability};
use std::ops::Deref;

/// Maximum size of the stack of subtrees in [`LightTree::runs`]: one per level.
const MAX_DEPTH: usize = 66;
/// Trail of lights that are not in the tree.
const NO_TRAIL: u64 = u64::MAX;

/// The hierarchy.
#[derive(Clone, Debug, Default)]
pub struct LightTree {
    nodes: Vec<Node>,
    /// Per light, the path from the root to its leaf, first branch in the lowest bit; 1 is right.
    trails: Vec<u64>,
    /// Per light, its leaf.
    leaves: Vec<u32>,
    /// Index and number of the inner nodes with numbers below [`Turns::COUNT`].
    tops: Vec<(u32, usize)>,
}

/// An inner node above a cut of the tree.
#[derive(Clone, Copy, Debug)]
pub struct CutNode {
    place: usize,
    number: usize,
    /// The first subtrees below its children.
    left: usize,
    right: usize,
}

/// The number of a child of the node `number`: 2n or 2n + 1, if below [`Turns::COUNT`]. The root has the number 1.
#[inline]
fn child(number: usize, is_right: bool) -> usize {
    if number < Turns::COUNT { 2 * number + usize::from(is_right) } else { number }
}

/// Positions descending the tree.
#[derive(Clone, Copy, Default)]
struct Descent {
    place: u32,
    pmf: f32,
    places: [u32; 2],
    interval: [f64; 2],
}

impl LightTree {
    /// The tree over the lights that have bounds; the index into `bounds` is the light's id.
    pub fn new(bounds: &[Option<LightBounds>]) -> Self {
        let mut items: Vec<Item> = bounds
            .iter()
            .enumerate()
            .filter_map(|(id, b)| b.map(|b| Item { id: id as LightId, bounds: b, center: b.bounds.center() }))
            .filter(|item| item.center.is_finite() && item.bounds.intensity > 0.0)
            .collect();
        let mut tree =
            LightTree { trails: vec![NO_TRAIL; bounds.len()], leaves: vec![0; bounds.len()], ..LightTree::default() };
        if !items.is_empty() {
            tree.nodes = vec![Node::new(&LightBounds::EMPTY, true, 0); 2 * items.len() - 1];
            build(&mut tree.nodes, 0, &mut items, 0);
            tree.find_leaves();
            tree.find_tops();
        }
        tree
    }

    /// Sets `tops`.
    fn find_tops(&mut self) {
        let mut stack = vec![(0, 1)];
        while let Some((place, number)) = stack.pop() {
            let node = &self.nodes[place as usize];
            if !node.is_leaf && number < Turns::COUNT {
                self.tops.push((place, number));
                stack.extend([(place + 1, child(number, false)), (node.index, child(number, true))]);
            }
        }
    }

    /// Sets `leaves` and `trails`.
    fn find_leaves(&mut self) {
        let mut stack = vec![(0, 0, 0)];
        while let Some((place, depth, trail)) = stack.pop() {
            let node = &self.nodes[place as usize];
            if node.is_leaf {
                self.trails[node.index as usize] = trail;
                self.leaves[node.index as usize] = place;
            } else {
                stack.extend([(place + 1, depth + 1, trail), (node.index, depth + 1, trail | 1 << depth)]);
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

    /// The numbers of the top inner nodes, below [`Turns::COUNT`], with the bounds of their left and right children.
    pub fn tops(&self) -> impl Iterator<Item = (usize, [&LightBound; 2])> {
        self.tops.iter().map(|&(place, number)| (number, self.children(place as usize).map(|node| &node.bound)))
    }

    #[inline]
    fn children(&self, place: usize) -> [&Node; 2] {
        [&self.nodes[place + 1], &self.nodes[self.nodes[place].index as usize]]
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
        self.leaf(light).map_or(0.0, |leaf| self.nodes[leaf as usize].importance(ctx))
    }

    /// Probability of the left child of an inner node. If neither child can contribute, the intensities decide. The
    /// probabilities of all leaves therefore always add up to 1.
    #[inline]
    fn left_probability(&self, ctx: &LightCtx, place: usize) -> f32 {
        let [left, right] = self.children(place);
        first_probability([left.importance(ctx), right.importance(ctx)], [&left.bound, &right.bound])
    }

    /// Chooses a light of the subtree below a node by `u` in [0, 1). Returns its id, its probability in the subtree,
    /// and `u` remapped to be uniform again.
    #[inline]
    pub fn sample_below(&self, ctx: &LightCtx, place: u32, u: f32) -> Option<(LightId, f32, f32)> {
        self.descend(place, u, |place, _| self.left_probability(ctx, place))
    }

    /// Chooses a light by `u` in [0, 1). Returns its id, its probability, and `u` remapped to be uniform again. `turns`
    /// are the precomputed probabilities of the point.
    #[inline]
    pub fn sample(&self, ctx: &impl Deref<Target = LightCtx>, u: f32, turns: Turns<'_>) -> Option<(LightId, f32, f32)> {
        if self.is_empty() {
            return None;
        }
        self.descend(0, u, |place, number| turns.probability(number, || self.left_probability(ctx, place)))
    }

    /// Descends from a node, which has the number 1; `left(node, number)` is the probability of the left child.
    #[inline]
    fn descend(&self, place: u32, u: f32, mut left: impl FnMut(usize, usize) -> f32) -> Option<(LightId, f32, f32)> {
        let (mut place, mut number, mut pmf, mut u) = (place as usize, 1, 1.0, u);
        let mut node = &self.nodes[place];
        while !node.is_leaf {
            // Descend, and rescale the random number
            let p = left(place, number);
            let turns_left = u < p;
            if turns_left {
                u /= p;
                pmf *= p;
                place += 1;
            } else {
                u = (u - p) / (1.0 - p);
                pmf *= 1.0 - p;
                place = node.index as usize;
            }
            number = child(number, !turns_left);
            u = u.min(ONE_MINUS_EPSILON);
            node = &self.nodes[place];
        }
        (pmf > 0.0).then_some((node.index, pmf, u))
    }

    /// Chooses a light for each of the ascending `positions[places[0]..places[1]]` in units of 2⁻³². The tree covers
    /// the interval of length `fraction` from `start` on. The positions descend the tree together, so that each node is
    /// evaluated once.
    pub fn runs(
        &self,
        ctx: &LightCtx,
        positions: &[u32],
        places: [u32; 2],
        (start, fraction): (f64, f32),
        out: &mut Vec<LightRun>,
    ) {
        let mut stack = [Descent::default(); MAX_DEPTH];
        stack[0] = Descent { place: 0, pmf: 1.0, places, interval: [start, 1.0] };
        let mut size = 1;
        while size > 0 {
            size -= 1;
            let Descent { place, pmf, places: [first, end], interval } = stack[size];
            if first == end {
                continue;
            }
            let node = &self.nodes[place as usize];
            if node.is_leaf {
                if pmf > 0.0 {
                    out.push(LightRun { light: node.index, pmf: pmf * fraction, places: [first, end], interval });
                }
                continue;
            }

            // Split the positions at the boundary between the children
            let p = self.left_probability(ctx, place as usize);
            let middle = interval[0] + (interval[1] - interval[0]) * f64::from(p);
            let is_left = |&x: &u32| f64::from(x) * (1.0 / 4_294_967_296.0) < middle;
            let split = first + positions[first as usize..end as usize].partition_point(is_left) as u32;
            stack[size] = Descent {
                place: node.index,
                pmf: pmf * (1.0 - p),
                places: [split, end],
                interval: [middle, interval[1]],
            };
            stack[size + 1] =
                Descent { place: place + 1, pmf: pmf * p, places: [first, split], interval: [interval[0], middle] };
            size += 2;
        }
    }

    /// At most `max` disjoint subtrees that together hold all lights, by their root nodes. Repeatedly splits the
    /// subtree with the largest extent, weighted by its intensity. Empty without lights, or if `max` is 0.
    pub fn cut(&self, max: usize) -> Vec<u32> {
        let mut cut: Vec<u32> = if self.is_empty() || max == 0 { Vec::new() } else { vec![0] };
        while cut.len() < max {
            let spread = |&place: &u32| {
                let node = &self.nodes[place as usize];
                if node.is_leaf { -1.0 } else { node.bound.intensity * node.bound.radius_squared }
            };
            let widest = (0..cut.len()).max_by(|&a, &b| spread(&cut[a]).total_cmp(&spread(&cut[b])));
            let Some(widest) = widest.filter(|&i| !self.nodes[cut[i] as usize].is_leaf) else { break };
            let place = cut[widest];
            cut[widest] = place + 1;
            cut.push(self.nodes[place as usize].index);
        }
        cut.sort_unstable();
        cut
    }

    /// Calls `visit` with each light of the subtree below a node.
    pub fn visit_lights(&self, place: u32, visit: &mut dyn FnMut(LightId)) {
        let node = &self.nodes[place as usize];
        if node.is_leaf {
            visit(node.index);
        } else {
            self.visit_lights(place + 1, visit);
            self.visit_lights(node.index, visit);
        }
    }

    /// The inner nodes above a [`cut`](Self::cut), each before those below it.
    pub fn above(&self, cut: &[u32]) -> Vec<CutNode> {
        let mut above = Vec::new();
        if !cut.is_empty() {
            self.add_above((0, 1), (cut, 0), &mut above);
        }
        above
    }

    /// Appends the inner nodes from `place` on down; `number` is the number of that node and `first` the index of the
    /// first subtree below it. Returns the index after its last subtree.
    fn add_above(
        &self,
        (place, number): (u32, usize),
        (cut, first): (&[u32], usize),
        above: &mut Vec<CutNode>,
    ) -> usize {
        if cut.binary_search(&place).is_ok() {
            return first + 1;
        }
        let i = above.len();
        above.push(CutNode { place: place as usize, number, left: first, right: first });
        let right = self.add_above((place + 1, child(number, false)), (cut, first), above);
        above[i].right = right;
        self.add_above((self.nodes[place as usize].index, child(number, true)), (cut, right), above)
    }

    /// Probabilities with which [`sample`](Self::sample) enters each subtree of a non-empty cut, in its order. `above`
    /// are the nodes [`above`](Self::above) the cut; `turns` are precomputed probabilities of the point.
    #[inline]
    pub fn cut_pmfs(&self, ctx: &LightCtx, above: &[CutNode], turns: Turns<'_>, pmfs: &mut [f32]) {
        pmfs[0] = 1.0;
        for node in above {
            let p = turns.probability(node.number, || self.left_probability(ctx, node.place));
            let pmf = pmfs[node.left];
            pmfs[node.left] = pmf * p;
            pmfs[node.right] = pmf * (1.0 - p);
        }
    }

    /// [`Self::sample`] with the importances `importance(place, node, count)`, which must be positive where the
    /// importance of the node is. `count` is the number of `leaves` below the node; `leaves` are positions of leaves in
    /// ascending order. These leaves are chosen only if no other light can contribute. Nodes are numbered as in
    /// [`Self::sums`].
    #[inline]
    pub(in crate::lights) fn sample_by(
        &self,
        u: f32,
        leaves: &[u32],
        importance: impl Fn(usize, &Node, usize) -> f32,
    ) -> Option<(LightId, f32, f32)> {
        let mut left = self.left_by(leaves, importance);
        if self.is_empty() { None } else { self.descend(0, u, |place, _| left(place)) }
    }

    /// The probability of the left child of each node on the way down, with the importances of [`Self::sample_by`].
    #[inline]
    fn left_by<'a>(
        &'a self,
        leaves: &'a [u32],
        importance: impl Fn(usize, &Node, usize) -> f32 + 'a,
    ) -> impl FnMut(usize) -> f32 + 'a {
        // Those below the node, and which of them are to its right
        let (mut below, mut right_of, mut last) = (leaves, leaves, None);
        move |place| {
            if let Some((parent, middle)) = last {
                below = if place == parent + 1 { &below[..middle] } else { right_of };
            }
            let right_place = self.nodes[place].index as usize;
            let middle = below.partition_point(|&leaf| (leaf as usize) < right_place);
            let [left, right] = self.children(place);
            let of = |place: usize, child: &Node, count: usize| {
                if child.is_leaf && count > 0 { 0.0 } else { importance(place, child, count) }
            };
            let importances = [of(place + 1, left, middle), of(right_place, right, below.len() - middle)];
            (right_of, last) = (&below[middle..], Some((place, middle)));
            first_probability(importances, [&left.bound, &right.bound])
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
        for (place, node) in self.nodes.iter().enumerate().rev() {
            sums[place] = if node.is_leaf { of(node.index) } else { sums[place + 1] + sums[node.index as usize] };
        }
        sums
    }

    /// The light of a tree of one light.
    pub fn only_light(&self) -> Option<LightId> {
        if let [leaf] = &self.nodes[..] { Some(leaf.index) } else { None }
    }

    /// Probability that [`sample`](Self::sample) chooses `light`.
    #[inline]
    pub fn pmf(&self, ctx: &LightCtx, light: LightId) -> f32 {
        self.probability(light, |place| self.left_probability(ctx, place))
    }

    /// Probability that [`sample_by`](Self::sample_by) chooses `light`.
    #[inline]
    pub(in crate::lights) fn pmf_by(
        &self,
        light: LightId,
        leaves: &[u32],
        importance: impl Fn(usize, &Node, usize) -> f32,
    ) -> f32 {
        self.probability(light, self.left_by(leaves, importance))
    }

    /// Probability of the way down to a light: `left(node)` is that to turn left at a node.
    #[inline]
    fn probability(&self, light: LightId, mut left: impl FnMut(usize) -> f32) -> f32 {
        if !self.contains(light) {
            return 0.0;
        }
        let (mut place, mut pmf, mut trail) = (0, 1.0, self.trails[light as usize]);
        while !self.nodes[place].is_leaf {
            let p = left(place);
            if trail & 1 == 0 {
                pmf *= p;
                place += 1;
            } else {
                pmf *= 1.0 - p;
                place = self.nodes[place].index as usize;
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
    use crate::lights::{Emission, GlossyLobe, Light, area_lights_of};
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
                    0 => Light::Point { p, intensity: l * scale * scale },
                    1 => {
                        let (a, b) = (s.random::<f32>(), s.random::<f32>());
                        let (cos_total, cos_falloff_start) = (a.min(b) * 2.0 - 1.0, a.max(b) * 2.0 - 1.0);
                        Light::Spot { p, axis, cos_total, cos_falloff_start, intensity: l * scale * scale }
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
        LightTree::new(&lights.iter().map(Light::bounds).collect::<Vec<_>>())
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
                let (light, pmf, u) = tree.sample(&&ctx, s.random::<f32>(), Turns::NONE).unwrap();
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
    fn near_lights_are_preferred() {
        let at = |x: f32| Light::Point { p: Vec3::new(x, 0.0, 0.0), intensity: Rgb::WHITE };
        let tree = tree_of(&[at(0.0), at(10.0)]);
        let pmf = tree.pmf(&LightCtx::at(Vec3::new(1.0, 0.0, 0.0)), 0);
        assert!((pmf - 81.0 / 82.0).abs() < 1e-5, "{pmf}");
    }

    #[test]
    fn degenerate_sets_are_handled() {
        let ctx = LightCtx::on(Vec3::ZERO, Vec3::Y);
        // None, or none that shines.
        assert!(tree_of(&[]).sample(&&ctx, 0.5, Turns::NONE).is_none());
        let black = Light::Point { p: Vec3::ONE, intensity: Rgb::BLACK };
        let mesh = TriangleMesh::new(vec![Vec3::ONE, Vec3::ONE, Vec3::X], vec![[0, 1, 2]]).unwrap();
        let flat = area_lights_of(&Shape::Mesh(mesh), &Emission::constant(Rgb::WHITE)).lights.remove(0);
        let dark = [black.clone(), Light::Area(flat), Light::InfiniteConstant { l: Rgb::WHITE }];
        let tree = tree_of(&dark);
        assert!(tree.is_empty() && tree.sample(&&ctx, 0.5, Turns::NONE).is_none() && tree.pmf(&ctx, 0) == 0.0);

        // One light, the same light many times, lights on a line, and the point on a light.
        let one = Light::Point { p: Vec3::ONE, intensity: Rgb::WHITE };
        assert_eq!(tree_of(&[black, one.clone()]).sample(&&ctx, 0.9, Turns::NONE).map(|s| (s.0, s.1)), Some((1, 1.0)));
        let same = vec![one; 1000];
        let line: Vec<Light> = (0..1000)
            .map(|i| Light::Point { p: Vec3::new(1e-3 * 1.01_f32.powi(i), 0.0, 0.0), intensity: Rgb::WHITE })
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
        let spot =
            |axis| Light::Spot { p: Vec3::ONE, axis, cos_total: 0.9, cos_falloff_start: 0.9, intensity: Rgb::WHITE };
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
            let (light, pmf, _) = tree.sample(&&ctx, s.random::<f32>(), Turns::NONE).unwrap();
            assert!(pmf > 0.0 && light < 100_000);
        }
    }
}
