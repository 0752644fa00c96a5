//! Four cameras that flew: dose under the Sun as it was, beside the published growth of damage.
//!
//! `cargo run --release --example hindcast -- hst` (or `xmm`, `chandra`, `gaia`, `goals`); docs/hindcast.md shows what it prints and
//! discusses it. `euclid`: a mission in its third year, for docs/euclid.md.

mod chandra;
mod euclid;
mod flown;
mod gaia;
mod hst;
mod report;
mod xmm;

fn main() {
    let name = std::env::args().nth(1).unwrap_or_default();
    match report::of(&name) {
        Some(report) => print!("{report}"),
        None => {
            eprintln!("error: no report is called `{name}`; there are: {}", report::REPORTS.join(", "));
            std::process::exit(2);
        }
    }
}
