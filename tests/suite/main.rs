//! All tests of the program and the library as users meet them: one program, so that there is one to link. Each module says what it
//! tests; `cargo test --test suite paper::` runs one.

mod alike;
mod architecture;
mod astropy;
mod book;
mod cli;
mod crossings;
mod diagnose;
mod effects_golden;
mod environment;
mod fit;
mod fuzzed;
mod galaxy_golden;
mod html;
mod images;
mod laws;
mod measurements;
mod missions;
mod one_chain;
mod outputs;
mod packets_golden;
mod paper;
mod practice;
mod predict;
mod properties;
mod readout;
mod robust;
mod skipped;
mod slurm;
mod start;
mod steady_state;
mod studies;
mod sun;
mod sweep;
mod tables;
mod tutorial;
