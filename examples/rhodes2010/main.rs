//! Every figure of Rhodes et al. 2010 (PASP 122, 439) that its text determines, beside the computed one.
//!
//! `cargo run --release --example rhodes2010`; docs/paper.md shows what it prints and discusses it.

mod figures;
mod report;

fn main() {
    print!("{}", report::report());
}
