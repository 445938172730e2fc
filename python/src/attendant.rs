//! The calling thread while another thread renders: it calls back and checks for Ctrl-C.

use crate::progress::{Canvas, PassProgress};
use lumiris::render::Progress;
use pyo3::prelude::*;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Interval of checking for Ctrl-C.
const ATTENTION: Duration = Duration::from_millis(50);

/// Messages from the rendering thread to the calling thread.
pub(crate) enum Event {
    Begin(Arc<Canvas>),
    Pass(Progress, SyncSender<()>),
}

/// State of the calling thread while another thread renders.
pub(crate) struct Attendant<'a> {
    pub(crate) callback: Option<&'a Py<PyAny>>,
    pub(crate) interval: Duration,
    pub(crate) stop: &'a AtomicBool,
    pub(crate) latest: &'a Mutex<Option<Progress>>,
    pub(crate) canvas: Option<Arc<Canvas>>,
    pub(crate) called: Instant,
    /// The exception of Ctrl-C or of the callback.
    pub(crate) raised: Option<PyErr>,
}

impl Attendant<'_> {
    /// Attends until the other thread has ended, which drops `finished` and the senders of events.
    pub(crate) fn attend(&mut self, events: &Receiver<Event>, finished: &Receiver<()>) {
        loop {
            match events.recv_timeout(ATTENTION.min(self.interval)) {
                Ok(Event::Begin(canvas)) => self.canvas = Some(canvas),
                Ok(Event::Pass(progress, done)) => {
                    // Progress from before the end of the pass is out of date
                    self.latest.lock().unwrap_or_else(PoisonError::into_inner).take();
                    self.call(progress, true);
                    // The other thread may have ended
                    let _ = done.send(());
                }
                Err(RecvTimeoutError::Timeout) => self.call_latest(),
                // There is no callback, or the rendering is about to end
                Err(RecvTimeoutError::Disconnected) => match finished.recv_timeout(ATTENTION) {
                    Err(RecvTimeoutError::Timeout) => {}
                    Ok(()) | Err(RecvTimeoutError::Disconnected) => return,
                },
            }
            self.raise_if(|_, py| py.check_signals());
        }
    }

    /// Calls back within a pass if the interval is over.
    fn call_latest(&mut self) {
        if self.called.elapsed() >= self.interval
            && let Some(progress) = self.latest.lock().unwrap_or_else(PoisonError::into_inner).take()
        {
            self.call(progress, false);
        }
    }

    fn call(&mut self, progress: Progress, is_pass: bool) {
        let (Some(callback), Some(canvas)) = (self.callback, self.canvas.clone()) else { return };
        if self.stop.load(Ordering::Relaxed) {
            return;
        }
        self.raise_if(|attendant, py| {
            let returned = callback.call1(py, (PassProgress { progress, is_pass, canvas },))?;
            // Only `False` itself stops: a callback that returns nothing does not
            if returned.bind(py).extract::<bool>().is_ok_and(|goes_on| !goes_on) {
                attendant.stop.store(true, Ordering::Relaxed);
            }
            Ok(())
        });
        self.called = Instant::now();
    }

    /// Runs Python code; an exception ends the rendering.
    fn raise_if(&mut self, run: impl FnOnce(&Self, Python<'_>) -> PyResult<()>) {
        if self.raised.is_some() {
            return;
        }
        if let Err(error) = Python::attach(|py| run(self, py)) {
            self.stop.store(true, Ordering::Relaxed);
            self.raised = Some(error);
        }
    }
}
