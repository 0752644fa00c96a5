#![no_main]

libfuzzer_sys::fuzz_target!(|text: &str| ctiplan_fuzz::formula(text));
