//! How much a search may compute, counted in evaluations of the model at all rows: a count depends on no machine.
//!
//! A step that has begun is ended, so that a search makes somewhat more evaluations than it may: those of every effect fitted roughly
//! on top of one model at most. It is asked for only between steps, never while some run in parallel, so that the number of threads decides nothing.

use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};

/// Evaluations done, and what the last round of a search left undone for want of more.
#[derive(Debug)]
pub struct Work {
    most: u64,
    done: AtomicU64,
    /// Evaluations done before this round.
    before: AtomicU64,
    undone: Mutex<Vec<String>>,
}

impl Work {
    pub fn of_at_most(most: u64) -> Work {
        Work { most, done: AtomicU64::new(0), before: AtomicU64::new(0), undone: Mutex::default() }
    }

    /// A search that begins anew may make as many again; what the one before left undone is no matter.
    pub fn begin_round(&self) {
        self.before.store(self.done(), Ordering::Relaxed);
        self.undone.lock().expect("nobody panics").clear();
    }

    /// Counts one evaluation.
    pub fn count(&self) {
        self.done.fetch_add(1, Ordering::Relaxed);
    }

    /// Evaluations so far.
    pub fn done(&self) -> u64 {
        self.done.load(Ordering::Relaxed)
    }

    /// Whether a step of the search may be done; where not, it is noted as undone.
    pub fn allows(&self, step: &str) -> bool {
        let allowed = self.done() - self.before.load(Ordering::Relaxed) < self.most;
        let mut undone = self.undone.lock().expect("nobody panics");
        if !allowed && !undone.iter().any(|known| known == step) {
            undone.push(step.to_string());
        }
        allowed
    }

    /// What was left undone, in the order in which it was asked for.
    pub fn undone(&self) -> Vec<String> {
        self.undone.lock().expect("nobody panics").clone()
    }
}
