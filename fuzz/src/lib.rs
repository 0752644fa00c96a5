//! What must hold of any input of the readers: it is refused with a message, or it is what it seems to be. Nothing panics.

use std::io::Write;
use std::sync::LazyLock;

use ctiplan::analysis::measurement::DataSet;
use ctiplan::image::fits::{Fits, HduKind};
use ctiplan::io::table::Table;
use ctiplan::mission::Mission;
use ctiplan::numeric::expression::Expression;

/// Any text as a mission file; a mission is the same when it is written and read again.
pub fn mission(text: &str) {
    if let Ok(mission) = Mission::parse(text) {
        assert_eq!(Mission::parse(&mission.to_toml()).as_ref(), Ok(&mission));
    }
}

static SNAP: LazyLock<Mission> =
    LazyLock::new(|| Mission::parse(include_str!("../../missions/snap_l2.toml")).expect("a mission"));

/// Any text as a file of measurements, ECSV or CSV; a table can be written and read again.
pub fn measurement(text: &str) {
    if let Ok(table) = Table::parse("fuzzed", text) {
        if let Err(error) = Table::parse("written", &table.to_ecsv()) {
            panic!("what was read cannot be written and read again: {error}");
        }
        let _ = DataSet::of(table, &SNAP);
    }
}

/// Any text as a formula; its value is a number, or a message.
pub fn formula(text: &str) {
    if let Ok(expression) = Expression::parse(text) {
        let slots: Vec<f64> = expression.variables().map(|name| name.len() as f64 - 2.0).collect();
        if let Ok(value) = expression.value(&slots) {
            assert!(value.is_finite());
        }
    }
}

/// Any bytes as a FITS file; images can be written again.
pub fn fits(bytes: &[u8]) {
    let mut file = tempfile::NamedTempFile::new().expect("a folder for temporary files");
    file.write_all(bytes).expect("room for the file");
    let Ok(mut fits) = Fits::open(file.path()) else { return };
    let mut out = Vec::new();
    for index in 0..fits.hdus.len() {
        let hdu = fits.hdus[index].clone();
        match hdu.kind {
            HduKind::Image { .. } => {
                let Ok(mut pixels) = fits.pixels(index) else { continue };
                let physical = pixels.physical();
                pixels.set(physical.iter().map(|value| (!value.is_nan()).then_some(*value)));
                hdu.write(&pixels, &[ctiplan::image::fits::history("fuzzed")], &mut out).expect("memory takes all");
            }
            _ => fits.copy(index, &mut out).expect("memory takes all"),
        }
    }
    fits.copy_rest(&mut out).expect("memory takes all");
}
