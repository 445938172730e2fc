//! What the threads of a rendering hold: a tracer each, with the memory of a batch.

use super::camera_samples::Scratch;
use crate::film::PixelSample;
use crate::film::accumulator::PixelAccumulator;
use crate::integrators::path::CameraSample;
use crate::integrators::{Integrator, Tracer};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Buffers of one thread.
pub(super) struct Worker<T> {
    pub(super) tracer: T,
    pub(super) samples: Vec<CameraSample>,
    pub(super) scratch: Scratch,
    pub(super) results: Vec<PixelSample>,
    /// The sums of a tile, while samples are added to them.
    pub(super) sums: Vec<PixelAccumulator>,
    /// Memory to pack them.
    pub(super) packing: Vec<u8>,
}

impl<T> Worker<T> {
    pub(super) fn new(tracer: T) -> Self {
        let (samples, scratch, results) = Default::default();
        Worker { tracer, samples, scratch, results, sums: Vec::new(), packing: Vec::new() }
    }
}

/// A worker that may have any tracer.
pub(super) type AnyWorker<'a> = Worker<Box<dyn Tracer + 'a>>;

/// The workers that use what an integrator has prepared.
pub(super) struct Workers<'a> {
    integrator: &'a dyn Integrator,
    with_features: bool,
    /// Those without a tile, whose buffers are large enough already.
    idle: Mutex<Vec<AnyWorker<'a>>>,
}

impl<'a> Workers<'a> {
    pub(super) fn new(integrator: &'a dyn Integrator, with_features: bool) -> Self {
        Workers { integrator, with_features, idle: Mutex::default() }
    }

    /// Lets one of them work.
    pub(super) fn with_one<R>(&self, work: impl FnOnce(&mut AnyWorker<'a>) -> R) -> R {
        let idle = self.idle().pop();
        let mut worker = idle.unwrap_or_else(|| Worker::new(self.integrator.tracer(self.with_features)));
        let result = work(&mut worker);
        self.idle().push(worker);
        result
    }

    fn idle(&self) -> MutexGuard<'_, Vec<AnyWorker<'a>>> {
        self.idle.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
