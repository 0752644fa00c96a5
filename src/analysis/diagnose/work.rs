//! Computing budget of a search, counted in evaluations of the model at all rows: a count does not depend on the machine.
//!
//! A step that has begun is completed, so a search can exceed its budget: at most by rough fits of every effect on top of one
//! model. The budget is checked only between steps, never while some run in parallel, so the result does not depend on the number
//! of threads.

use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};

/// Evaluations done, and steps that the last round of a search omitted because the budget was used.
#[derive(Debug)]
pub struct Work {
    most: u64,
    done: AtomicU64,
    undone: Mutex<Vec<String>>,
}

impl Work {
    pub fn of_at_most(most: u64) -> Work {
        Work { most, done: AtomicU64::new(0), undone: Mutex::default() }
    }

    /// Counts one evaluation.
    pub fn count(&self) {
        self.done.fetch_add(1, Ordering::Relaxed);
    }

    /// Evaluations so far.
    pub fn done(&self) -> u64 {
        self.done.load(Ordering::Relaxed)
    }

    /// Whether a step of the search may begin; if not, it is recorded as omitted.
    pub fn allows(&self, step: &str) -> bool {
        let allowed = self.done() < self.most;
        let mut undone = self.undone.lock().expect("nobody panics");
        if !allowed && !undone.iter().any(|known| known == step) {
            undone.push(step.to_string());
        }
        allowed
    }

    /// Omitted steps, in the order in which they were requested.
    pub fn undone(&self) -> Vec<String> {
        self.undone.lock().expect("nobody panics").clone()
    }
}
