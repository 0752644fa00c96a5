//! What is written, read by the real astropy where there is one.
//!
//! `ASTROPY_PYTHON=/path/to/python cargo test --test suite astropy::` where `python3` has no astropy. Without one, what is written is
//! compared with what astropy was once seen to read unchanged (`tests/measurements/written/`).

use std::fs;
use std::path::Path;
use std::process::Command;

use ctiplan::io::table::Table;

const SCRIPT: &str = r#"
import sys, numpy as np
from astropy.table import Table
for pair in sys.argv[1:]:
    ours, theirs = [Table.read(name, format="ascii.ecsv") for name in pair.split("=")]
    assert ours.colnames == theirs.colnames, pair
    for name in theirs.colnames:
        a, b = ours[name], theirs[name]
        assert str(a.unit or "") == str(b.unit or ""), (pair, name)
        a, b = [[None if value is np.ma.masked or str(value) == "" else value for value in column] for column in (a, b)]
        for x, y in zip(a, b):
            same = (x is None and y is None) or bool(np.all(np.asarray(x == y)))
            nan = isinstance(x, (float, np.floating)) and isinstance(y, (float, np.floating)) and x != x and y != y
            assert same or nan or repr(x) == repr(y), (pair, name, x, y)
    for key in theirs.meta:
        if not key.startswith("__"):
            assert key in ours.meta, (pair, key)
print("read", len(sys.argv) - 1)
"#;

/// Files whose columns are numbers and words, which come back as they were. (Quantities and masks come back as plain columns
/// with units and missing values; that is tested column by column in `tests/suite/tables.rs`.)
const FILES: [&str; 12] = [
    "dose_plain_dict",
    "trail_omap_blank",
    "eper_nested_meta",
    "packets_units_formats",
    "packets_other_units",
    "dose_date_strings",
    "trail_masked_comma",
    "trail_masked_blank",
    "delta_e1_strings_comma",
    "delta_e1_strings_blank",
    "packets_datatypes",
    "packets_nan_inf",
];

fn written(name: &str) -> String {
    Table::read(format!("tests/measurements/{name}.ecsv")).unwrap().to_ecsv()
}

#[test]
fn astropy_reads_back_what_is_written() {
    let python = std::env::var("ASTROPY_PYTHON").unwrap_or_else(|_| "python3".into());
    let there = Command::new(&python).args(["-c", "import astropy.table, yaml"]).output();
    if !there.is_ok_and(|output| output.status.success()) {
        crate::skipped::for_want_of("astropy");
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let pairs: Vec<String> = FILES
        .iter()
        .map(|name| {
            let ours = folder.path().join(format!("{name}.ecsv"));
            fs::write(&ours, written(name)).unwrap();
            format!("{}=tests/measurements/{name}.ecsv", ours.display())
        })
        .collect();
    let output = Command::new(&python).args(["-W", "ignore", "-c", SCRIPT]).args(&pairs).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert_eq!(String::from_utf8_lossy(&output.stdout).trim(), format!("read {}", FILES.len()));
}

#[test]
fn what_is_written_is_what_astropy_was_seen_to_read() {
    // RENEW=1 cargo test --test suite astropy:: writes these files, after a run with astropy has passed.
    let folder = Path::new("tests/measurements/written");
    for name in FILES {
        let file = folder.join(format!("{name}.ecsv"));
        if std::env::var_os("RENEW").is_some() {
            fs::create_dir_all(folder).unwrap();
            fs::write(&file, written(name)).unwrap();
        }
        assert_eq!(written(name), fs::read_to_string(&file).unwrap(), "{name}");
    }
}
