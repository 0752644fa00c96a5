//! Cancelling long work that is no longer needed.
//!
//! A thread may watch a token. Once the token is set, the next [`check`] on that thread unwinds with [`Interrupted`], which is
//! caught where the work began (`std::panic::catch_unwind`). Readouts check between pixels and between columns; a thread that
//! watches no token never stops.

use std::cell::RefCell;
use std::panic::resume_unwind;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

thread_local! {
    static WATCHED: RefCell<Option<Arc<AtomicBool>>> = const { RefCell::new(None) };
}

/// The payload with which interrupted work unwinds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Interrupted;

/// From now on, this thread's work ends once the token is set.
pub fn watch(token: Arc<AtomicBool>) {
    WATCHED.with_borrow_mut(|watched| *watched = Some(token));
}

/// Returns, unless this thread's token is set.
///
/// # Panics
/// With [`Interrupted`], without a message, if the token is set.
pub fn check() {
    let set = WATCHED.with_borrow(|watched| watched.as_ref().is_some_and(|token| token.load(Ordering::Relaxed)));
    if set {
        resume_unwind(Box::new(Interrupted));
    }
}

/// Most pieces of a parallel loop.
const MOST_PIECES: usize = 4096;

/// Minimum items per piece in a parallel loop over `count`. If one piece unwinds, rayon still starts all others, and divides them
/// down to this length.
pub fn piece(count: usize) -> usize {
    count / MOST_PIECES + 1
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Cloud, Downstream, Method, Readout, Trap};
    use std::panic::{AssertUnwindSafe, catch_unwind};

    #[test]
    fn every_method_ends_once_its_thread_is_told() {
        let methods = [
            Method::Fast { relative: 1e-3 },
            Method::Exact,
            Method::CarriedTraps,
            Method::Fractional { levels: 100 },
            Method::MonteCarlo { seed: 1 },
        ];
        let slow = Trap { capture_transfers: 0.5, ..Trap::new(0.5, 3.0) };
        for method in methods {
            for trap in [Trap::new(0.5, 3.0), slow] {
                let readout = Readout { traps: vec![trap], cloud: Cloud::new(1e5, 0.0, 0.5), method };
                let interrupted = std::thread::spawn(move || {
                    let token = Arc::new(AtomicBool::new(false));
                    watch(token.clone());
                    let read = || readout.column(&[10.0, 500.0, 3.0], Downstream::NONE);
                    let before = catch_unwind(AssertUnwindSafe(read)).is_ok();
                    token.store(true, Ordering::Relaxed);
                    let after = catch_unwind(AssertUnwindSafe(read));
                    before && after.is_err_and(|payload| payload.is::<Interrupted>())
                });
                assert!(interrupted.join().unwrap(), "{method:?} of {trap:?}");
            }
        }
    }
}
