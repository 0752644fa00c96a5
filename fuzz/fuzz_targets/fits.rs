#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| ctiplan_fuzz::fits(bytes));
