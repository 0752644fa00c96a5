//! Long computations, without blocking the interpreter.
//!
//! The interpreter's lock is released, and a pool of threads does the work. Meanwhile the calling thread handles signals and
//! reports the progress, so callbacks run in the thread that expects them. Ctrl-C, or an exception in a callback, sets the token
//! that all threads of the pool watch: their readouts end, and the exception is raised.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use ctiplan::error::InputError;
use ctiplan::readout::interrupt;
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};

use crate::errors;

/// Interval at which signals and progress are checked.
const EVERY: Duration = Duration::from_millis(40);

/// Progress of the work, updated from any thread.
#[derive(Default)]
pub struct Watch {
    stage: Mutex<String>,
    done: AtomicU64,
    total: AtomicU64,
}

impl Watch {
    /// Another stage begins, of so many steps; 0 where their number is not known.
    pub fn stage(&self, name: &str, total: u64) {
        *self.stage.lock().unwrap_or_else(|poisoned| poisoned.into_inner()) = name.into();
        self.done.store(0, Ordering::Relaxed);
        self.total.store(total, Ordering::Relaxed);
    }

    /// Another name for the stage.
    pub fn rename(&self, name: &str) {
        *self.stage.lock().unwrap_or_else(|poisoned| poisoned.into_inner()) = name.into();
    }

    /// One more step is done. Between two steps, work ends where it is to end.
    pub fn advance(&self) {
        interrupt::check();
        self.done.fetch_add(1, Ordering::Relaxed);
    }

    fn now(&self) -> (String, u64, u64) {
        let stage = self.stage.lock().unwrap_or_else(|poisoned| poisoned.into_inner()).clone();
        let (done, total) = (self.done.load(Ordering::Relaxed), self.total.load(Ordering::Relaxed));
        // A search may take more steps than it expected.
        (stage, done, if total > 0 { total.max(done) } else { 0 })
    }
}

/// Does some work. `progress(stage, done, total)` is called from this thread while it is under way, and once at its end.
pub fn run<T: Send>(
    py: Python<'_>,
    progress: Option<&Bound<'_, PyAny>>,
    work: impl FnOnce(&Watch) -> Result<T, InputError> + Send,
) -> PyResult<T> {
    let crew = Crew::take()?;
    let watch = Watch::default();
    let callback = progress.map(|progress| progress.clone().unbind());
    let mut reported = None;
    let mut tell = |py: Python<'_>| -> PyResult<()> {
        let now = watch.now();
        if let Some(callback) = callback.as_ref().filter(|_| reported.as_ref() != Some(&now)) {
            callback.call1(py, now.clone())?;
            reported = Some(now);
        }
        Ok(())
    };
    let mut stopped: Option<PyErr> = None;
    let outcome = py.detach(|| {
        crew.pool.in_place_scope(|scope| {
            let (sender, receiver) = channel();
            let watch = &watch;
            scope.spawn(move |_| {
                let outcome = catch_unwind(AssertUnwindSafe(|| work(watch)));
                // The receiver still exists: the scope ends after this.
                let _ = sender.send(outcome);
            });
            loop {
                match receiver.recv_timeout(EVERY) {
                    Ok(outcome) => break Some(outcome),
                    Err(RecvTimeoutError::Disconnected) => break None,
                    Err(RecvTimeoutError::Timeout) if stopped.is_some() => {}
                    Err(RecvTimeoutError::Timeout) => {
                        stopped = Python::attach(|py| py.check_signals().and_then(|()| tell(py))).err();
                        crew.token.store(stopped.is_some(), Ordering::Relaxed);
                    }
                }
            }
        })
    });
    if let Some(stopped) = stopped {
        return Err(stopped);
    }
    match outcome {
        Some(Ok(Ok(result))) => tell(py).map(|()| result),
        Some(Ok(Err(error))) => Err(errors::bad_input(py, &error)),
        Some(Err(_)) | None => Err(errors::internal(py)),
    }
}

/// Requested number of threads; 0: as many as there are processors, or RAYON_NUM_THREADS.
static THREADS: AtomicUsize = AtomicUsize::new(0);

/// Largest number of threads that can be requested.
const MOST_THREADS: i64 = 1024;

/// Sets the number of threads of all work that begins later; 0: one for each processor.
#[pyfunction]
pub fn set_threads(py: Python<'_>, threads: i64) -> PyResult<()> {
    if !(0..=MOST_THREADS).contains(&threads) {
        let problem = format!("allowed: 1 to {MOST_THREADS}, or 0 for one for each processor");
        return Err(errors::bad_input(py, &InputError::new(format!("cannot use {threads} threads"), problem)));
    }
    THREADS.store(threads as usize, Ordering::Relaxed);
    Ok(())
}

/// The number of threads that work uses.
#[pyfunction]
pub fn threads() -> usize {
    match THREADS.load(Ordering::Relaxed) {
        0 => rayon::current_num_threads(),
        threads => threads,
    }
}

/// Threads with a token of their own, so that one call is interrupted and no other.
struct Crew {
    pool: ThreadPool,
    token: Arc<AtomicBool>,
    threads: usize,
    /// A pool does not survive a fork.
    process: u32,
}

/// Crews that wait for work: making threads takes longer than reading out a stamp.
static WAITING: Mutex<Vec<Crew>> = Mutex::new(Vec::new());

/// Most crews that are kept.
const KEPT: usize = 4;

/// A crew at work, which waits again when dropped.
struct AtWork(Option<Crew>);

impl Crew {
    fn take() -> PyResult<AtWork> {
        let (threads, process) = (THREADS.load(Ordering::Relaxed), std::process::id());
        let mut waiting = WAITING.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
        let mut kept = Vec::new();
        for crew in waiting.drain(..) {
            if crew.process == process { kept.push(crew) } else { std::mem::forget(crew) }
        }
        *waiting = kept;
        let fit = waiting.iter().position(|crew| crew.threads == threads).map(|place| waiting.swap_remove(place));
        drop(waiting);
        fit.map_or_else(|| Crew::new(threads, process), Ok).map(|crew| AtWork(Some(crew)))
    }

    fn new(threads: usize, process: u32) -> PyResult<Crew> {
        let token = Arc::new(AtomicBool::new(false));
        let watched = token.clone();
        let pool = ThreadPoolBuilder::new()
            .num_threads(threads)
            .thread_name(|place| format!("ctiplan-{place}"))
            .start_handler(move |_| interrupt::watch(watched.clone()))
            .build();
        let pool = pool.map_err(|error| PyRuntimeError::new_err(format!("cannot start {threads} threads: {error}")))?;
        Ok(Crew { pool, token, threads, process })
    }
}

impl std::ops::Deref for AtWork {
    type Target = Crew;
    fn deref(&self) -> &Crew {
        self.0.as_ref().expect("a crew is given back once")
    }
}

impl Drop for AtWork {
    fn drop(&mut self) {
        let Some(crew) = self.0.take() else { return };
        crew.token.store(false, Ordering::Relaxed);
        let mut waiting = WAITING.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
        if waiting.len() < KEPT {
            waiting.push(crew);
        }
    }
}
