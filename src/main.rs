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
