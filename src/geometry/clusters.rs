//! Instances of instances that are not expanded. A cluster is a set of groups with their transforms, and is placed many
//! times. The memory is that of the clusters and of their places, not of the instances that they stand for.

use lumiris_numbers::math::{Affine3A, Bounds3, DAffine3};
use std::ops::Range;

/// Index into [`GeometrySet::groups`](super::GeometrySet::groups).
pub type GroupId = u32;

/// Index of a cluster.
pub type ClusterId = u32;

/// A group in a cluster.
#[derive(Clone, Debug)]
pub struct Member {
    /// The group.
    pub group: GroupId,
    /// Its transform; it does not move.
    pub cluster_from_group: DAffine3,
}

/// A place of a cluster.
#[derive(Clone, Debug)]
pub struct ClusterInstance {
    /// The cluster.
    pub cluster: ClusterId,
    /// Its transform.
    pub world_from_cluster: DAffine3,
    /// Number of instances of the places before.
    pub first: u32,
}

impl ClusterInstance {
    /// Bounds of the place from those of all clusters.
    pub fn bounds(&self, cluster_bounds: &[Bounds3]) -> Bounds3 {
        cluster_bounds[self.cluster as usize].transformed(&self.world_from_cluster.as_affine3a())
    }
}

/// Clusters and their places. The instances that they stand for are numbered place by place, member by member.
#[derive(Clone, Debug, Default)]
pub struct Clusters {
    clusters: Vec<Vec<Member>>,
    places: Vec<ClusterInstance>,
    count: u32,
}

impl Clusters {
    /// Adds a cluster, with at least one member.
    pub fn add(&mut self, members: Vec<Member>) -> ClusterId {
        self.clusters.push(members);
        (self.clusters.len() - 1) as ClusterId
    }

    /// Places a cluster. There must be less than 2³² instances.
    pub fn place(&mut self, cluster: ClusterId, world_from_cluster: DAffine3) {
        self.places.push(ClusterInstance { cluster, world_from_cluster, first: self.count });
        self.count += self.clusters[cluster as usize].len() as u32;
    }

    /// The members of each cluster.
    pub fn clusters(&self) -> &[Vec<Member>] {
        &self.clusters
    }

    /// All places.
    pub fn places(&self) -> &[ClusterInstance] {
        &self.places
    }

    /// Number of instances that all places stand for.
    pub fn instance_count(&self) -> u32 {
        self.count
    }

    fn member(&self, index: u32) -> (&ClusterInstance, &Member) {
        let place = &self.places[self.places.partition_point(|place| place.first <= index) - 1];
        (place, &self.clusters[place.cluster as usize][(index - place.first) as usize])
    }

    /// The group of an instance.
    pub fn group(&self, index: u32) -> GroupId {
        self.member(index).1.group
    }

    /// The transform of an instance.
    pub fn world_from_group(&self, index: u32) -> Affine3A {
        let (place, member) = self.member(index);
        (place.world_from_cluster * member.cluster_from_group).as_affine3a()
    }

    /// The instances that a place stands for.
    pub fn instances_of(&self, place: &ClusterInstance) -> Range<u32> {
        place.first..place.first + self.clusters[place.cluster as usize].len() as u32
    }
}
