//! Counts and times of the stages.

use std::time::Duration;

/// Counts and times of the stages.
#[derive(Clone, Copy, Debug, Default)]
pub struct DirectStats {
    /// Candidates drawn by T1.
    pub proposals: u64,
    /// Candidates that are light samples.
    pub light_proposals: u64,
    /// Rays traced against emitters.
    pub emitter_rays: u64,
    /// Shadow segments traced by T2.
    pub segments: u64,
    /// Approximate number of tentative collisions of segments in media.
    pub collisions: u64,
    /// Time in T1.
    pub t1: Duration,
    /// Part of `t1` for light samples.
    pub t1_light: Duration,
    /// Time in select and resolve.
    pub select: Duration,
    /// Time in T2.
    pub t2: Duration,
    /// Time for normal equations and their solutions; part of `select`.
    pub solve: Duration,
    /// Number of linear systems.
    pub systems: u64,
    /// Ill-conditioned systems. Without a solution, the MIS estimate is used. If columns are linearly dependent, some
    /// of them are dropped.
    pub ill_conditioned: u64,
}

impl DirectStats {
    /// Adds the counts of another worker.
    pub fn merge(&mut self, other: &DirectStats) {
        self.proposals += other.proposals;
        self.light_proposals += other.light_proposals;
        self.emitter_rays += other.emitter_rays;
        self.segments += other.segments;
        self.collisions += other.collisions;
        self.t1 += other.t1;
        self.t1_light += other.t1_light;
        self.select += other.select;
        self.t2 += other.t2;
        self.solve += other.solve;
        self.systems += other.systems;
        self.ill_conditioned += other.ill_conditioned;
    }
}
