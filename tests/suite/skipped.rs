//! What could not be tested here, said in one line when the tests are over: the output of tests that pass is not shown.

use std::collections::BTreeMap;
use std::ffi::c_int;
use std::io::Write;
use std::sync::Mutex;

/// How many tests lacked a thing, by its name.
static ABSENT: Mutex<BTreeMap<String, usize>> = Mutex::new(BTreeMap::new());

/// Notes that a test, or a part of it, is skipped for want of something.
#[expect(unsafe_code, reason = "nothing else in Rust is called at the end of a program")]
pub fn for_want_of(what: impl Into<String>) {
    let mut absent = ABSENT.lock().unwrap();
    if absent.is_empty() {
        // SAFETY: the function is one of the C library's and takes any function without arguments.
        assert_eq!(unsafe { atexit(tell) }, 0);
    }
    *absent.entry(what.into()).or_default() += 1;
}

#[expect(unsafe_code, reason = "as above")]
unsafe extern "C" {
    fn atexit(function: extern "C" fn()) -> c_int;
}

extern "C" fn tell() {
    let Ok(absent) = ABSENT.lock() else { return };
    let tests = |number: usize| if number == 1 { "1 test".into() } else { format!("{number} tests") };
    let all: Vec<String> = absent.iter().map(|(what, number)| format!("{what} ({})", tests(*number))).collect();
    // Nobody is left to be told that this fails.
    let _ = writeln!(std::io::stdout(), "skipped, not installed or not here: {}", all.join(", "));
}
