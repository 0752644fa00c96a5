//! What to say when a signal ends a command that can be gone on with.

use std::sync::{Mutex, PoisonError};

static ADVICE: Mutex<Option<String>> = Mutex::new(None);

/// Sets what an interruption says from now on.
pub(super) fn say_then(advice: Option<String>) {
    *ADVICE.lock().unwrap_or_else(PoisonError::into_inner) = advice;
}

/// How to go on with the command that has been interrupted; None if it has to start again.
pub fn advice() -> Option<String> {
    ADVICE.lock().unwrap_or_else(PoisonError::into_inner).clone()
}
