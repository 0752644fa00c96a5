//! The command `ctiplan`: what belongs to a process (its allocator, its output, signals) around the library.

use std::process::ExitCode;

/// A diagnosis makes millions of short-lived buffers of 10 to 100 kB, which take other allocators a quarter of its time
/// (glibc) or half of it (musl).
#[cfg(unix)]
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

fn main() -> ExitCode {
    #[cfg(unix)]
    if standard_output::was_closed() {
        eprintln!("error: cannot write the result\n  standard output is closed");
        return ExitCode::from(1);
    }
    #[cfg(unix)]
    if let Err(error) = ended::remove_unfinished_files() {
        eprintln!("warning: an interrupted command may leave incomplete files ({error})");
    }
    ctiplan::cli::run(std::env::args_os()).into()
}

/// Whether standard output was open when the program was started.
///
/// That must be seen before `main`: Rust opens /dev/null in place of a stream that is closed (`ctiplan ... >&-`), and what is
/// printed is lost without an error.
#[cfg(unix)]
mod standard_output {
    use std::sync::atomic::{AtomicBool, Ordering};

    static CLOSED: AtomicBool = AtomicBool::new(false);

    #[ctor::ctor(unsafe)]
    fn look() {
        CLOSED.store(rustix::io::fcntl_getfd(rustix::stdio::stdout()).is_err(), Ordering::Relaxed);
    }

    pub fn was_closed() -> bool {
        CLOSED.load(Ordering::Relaxed)
    }
}

/// What is left to do when a signal ends the program: Ctrl-C, or the end of a job's time.
#[cfg(unix)]
mod ended {
    use std::{fs, io, process, thread};

    use signal_hook::consts::{SIGINT, SIGTERM};
    use signal_hook::iterator::Signals;
    use signal_hook::low_level::emulate_default_handler;

    /// Removes incomplete files at such a signal, and ends as without this.
    pub fn remove_unfinished_files() -> io::Result<()> {
        // A shell's background job ignores SIGINT, and goes on doing so.
        let mut signals = Signals::new([SIGINT, SIGTERM].into_iter().filter(|signal| !is_ignored(*signal)))?;
        thread::Builder::new().name("signals".into()).spawn(move || {
            if let Some(signal) = signals.forever().next() {
                ctiplan::io::atomic_file::remove_unfinished();
                if let Some(advice) = ctiplan::cli::interrupted::advice() {
                    eprintln!("\n{advice}");
                }
                // It returns only if it fails.
                let _ = emulate_default_handler(signal);
                process::abort();
            }
        })?;
        Ok(())
    }

    /// Whether a signal is ignored; false on systems without /proc.
    fn is_ignored(signal: i32) -> bool {
        let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
        let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
        mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok())
            .is_some_and(|mask| mask >> (signal - 1) & 1 == 1)
    }
}
