//! Choice of the objects that are clusters. Their contents are stored once, not once per instance.

use super::descriptions::{InstanceDesc, ObjectDesc};

/// Maximum number of instances of groups, whose ids have 32 bits.
const MAX_INSTANCES: u64 = 1 << 31;

/// Maximum number of instances, places and members that are stored.
const MAX_STORED: u64 = 100_000_000;

/// Maximum number of instances for which objects within objects are expanded. Expanded instances take more memory, and
/// rays less time.
const MAX_EXPANDED: u64 = 1 << 16;

/// The groups of an object.
#[derive(Clone, Copy, Debug)]
pub(super) struct Groups {
    /// Their number, at least one: that of the static shapes counts even without shapes.
    pub count: u64,
    /// Number of groups with curves.
    pub with_curves: u64,
    /// True if one moves within the object.
    pub is_moving: bool,
}

/// Numbers of instances.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Stored {
    /// Instances of groups.
    pub instances: u64,
    /// Places of clusters.
    pub places: u64,
    /// Members of clusters.
    pub members: u64,
    /// Instances with curves that places stand for.
    pub with_curves: u64,
}

/// The storage of all instances.
#[derive(Debug)]
pub(super) struct Layout {
    /// Objects whose static instances are places of a cluster.
    pub clusters: Vec<usize>,
    /// Numbers of instances.
    pub stored: Stored,
}

/// Number of instances of an object.
#[derive(Clone, Copy, Default)]
struct Uses {
    fixed: u64,
    /// Moving or singular.
    other: u64,
}

impl Layout {
    /// Clusters are chosen if the instances would expand to more than 2¹⁶. `own` are the groups of an object's shapes,
    /// without those of objects within.
    ///
    /// Returns `Err` with a message if there are too many instances.
    pub(super) fn new(objects: &[ObjectDesc], own: &[Groups], instances: &[InstanceDesc]) -> Result<Layout, String> {
        // All groups of an object; objects contain earlier ones
        let mut groups: Vec<Groups> = Vec::with_capacity(objects.len());
        for (object, own) in objects.iter().zip(own) {
            let all = object.instances.iter().fold(*own, |sum, i| sum.and(&groups[i.object], i.ctm.is_fixed()));
            groups.push(all);
        }
        let all = instances.iter().map(|i| groups[i.object].count).fold(0, u64::saturating_add);
        if all > MAX_INSTANCES {
            return Err(format!("objects within objects make {all} instances; at most {MAX_INSTANCES} are"));
        }

        // Choose from the outermost objects inwards
        let mut uses = vec![Uses::default(); objects.len()];
        instances.iter().for_each(|i| uses[i.object].add(Uses { fixed: 1, other: 0 }, i.ctm.is_fixed()));
        let mut layout = Layout { clusters: Vec::new(), stored: Stored::default() };
        for (index, object) in objects.iter().enumerate().rev() {
            let (all_groups, Uses { fixed, .. }) = (&groups[index], uses[index]);
            let expanded = fixed.saturating_mul(own[index].count + object.instances.len() as u64);
            let is_smaller = fixed + all_groups.count < expanded;
            if all > MAX_EXPANDED && !object.instances.is_empty() && !all_groups.is_moving && is_smaller {
                layout.clusters.push(index);
                layout.stored.add_cluster(fixed, all_groups);
                uses[index].fixed = 0;
            }
            let outer = uses[index];
            layout.stored.instances += (outer.fixed + outer.other) * own[index].count;
            object.instances.iter().for_each(|i| uses[i.object].add(outer, i.ctm.is_fixed()));
        }

        // Check the numbers
        let Stored { instances, places, members, .. } = layout.stored;
        let stored = instances + places + members;
        if stored > MAX_STORED {
            return Err(format!("objects within objects store {stored} instances; at most {MAX_STORED} are"));
        }
        Ok(layout)
    }
}

impl Groups {
    /// Adds those of an object within.
    fn and(self, inner: &Groups, is_fixed: bool) -> Groups {
        Groups {
            count: self.count.saturating_add(inner.count),
            with_curves: self.with_curves.saturating_add(inner.with_curves),
            is_moving: self.is_moving | inner.is_moving | !is_fixed,
        }
    }
}

impl Uses {
    /// Adds instances that are in each of `outer`.
    fn add(&mut self, outer: Uses, is_fixed: bool) {
        let Uses { fixed, other } = outer;
        self.fixed += if is_fixed { fixed } else { 0 };
        self.other += if is_fixed { other } else { fixed + other };
    }
}

impl Stored {
    fn add_cluster(&mut self, places: u64, groups: &Groups) {
        self.places += places;
        self.members += groups.count;
        self.with_curves += places * groups.with_curves;
    }
}

#[cfg(test)]
mod tests {
    use super::super::transform::Ctm;
    use super::*;
    use lumiris_formats::source::Span;
    use lumiris_numbers::math::{DMat4, DVec3};

    const AT_REST: Groups = Groups { count: 1, with_curves: 1, is_moving: false };

    fn instances(object: usize, count: usize, ctm: &Ctm) -> Vec<InstanceDesc> {
        vec![InstanceDesc { object, ctm: ctm.clone(), span: Span::default() }; count]
    }

    /// A world of rows, and the rows of leaves.
    fn layout(rows: Vec<InstanceDesc>, leaves: Vec<InstanceDesc>, leaf: Groups) -> Layout {
        let objects = [vec![], leaves, rows].map(|instances| ObjectDesc { span: Span::default(), instances });
        let without_curves = Groups { with_curves: 0, ..AT_REST };
        Layout::new(&objects, &[leaf, without_curves, without_curves], &instances(2, 1, &Ctm::IDENTITY)).unwrap()
    }

    #[test]
    fn clusters_are_the_objects_with_the_fewest_instances_to_store() {
        let moves = Ctm::new(DMat4::IDENTITY, DMat4::from_translation(DVec3::X));
        let flat = Ctm::new(DMat4::from_scale(DVec3::new(1.0, 0.0, 1.0)), DMat4::from_scale(DVec3::new(1.0, 0.0, 1.0)));
        let still = |object, count| instances(object, count, &Ctm::IDENTITY);

        // The rows, not the world that is there once
        let found = layout(still(1, 2000), still(0, 1000), AT_REST);
        assert_eq!(found.clusters, [1]);
        let expected = Stored { instances: 1, places: 2000, members: 1001, with_curves: 2_000_000 };
        assert_eq!(found.stored, expected);

        // Rows that move or are flat are expanded, and all rows if leaves move within them
        for ctm in [&moves, &flat] {
            let found = layout([still(1, 2000), instances(1, 3, ctm)].concat(), still(0, 1000), AT_REST);
            assert_eq!(found.stored, Stored { instances: 1 + 3 * 1001, ..expected });
        }
        let turning = Groups { is_moving: true, ..AT_REST };
        for found in [
            layout(still(1, 2000), still(0, 1000), turning),
            layout(still(1, 2000), instances(0, 1000, &moves), AT_REST),
        ] {
            assert_eq!((found.clusters, found.stored.instances), (vec![], 2_002_001));
        }

        // Few instances are expanded
        assert_eq!(layout(still(1, 200), still(0, 300), AT_REST).stored.instances, 1 + 200 * 301);
    }
}
