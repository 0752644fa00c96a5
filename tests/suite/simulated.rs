//! `ctiplan predict`: measurement files as the model expects them, for every observable.

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use ctiplan::physics::observable::Observable;
use serde_json::Value;
use tempfile::TempDir;

const SNAP: &str = "missions/snap_l2.toml";
const ROWS: usize = 120;

fn ctiplan(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_ctiplan")).args(arguments).output().unwrap()
}

fn succeeds(arguments: &[&str]) -> String {
    let output = ctiplan(arguments);
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

/// Conditions of all observables, without a value; only those that one uses count for it.
fn conditions(observable: Observable, sigma: &str) -> String {
    let card = observable.card();
    let uses = |name: &str| card.requires.contains(&name);
    let mut text = format!("# observable: {}\n", observable.name());
    let all = ["trail_px", "signal_e", "block_px", "first_px", "last_px", "phase_time_ms", "pumping_cycles"];
    let names: Vec<&str> = all.into_iter().filter(|name| uses(name)).collect();
    let species = if observable.name() == "pumping_dipole" { ",species" } else { "" };
    text += &format!("t_yr,{}sigma{species}\n", names.iter().map(|name| format!("{name},")).collect::<String>());
    for row in 0..ROWS {
        let cells = names.iter().map(|name| match *name {
            "trail_px" => format!("{},", 1 + row % 5),
            "signal_e" => format!("{},", 500 + 10 * row),
            "block_px" => "20,".into(),
            "first_px" => "1,".into(),
            "last_px" => "2,".into(),
            "phase_time_ms" => format!("{},", 0.1 + 0.1 * row as f64),
            _ => "1000,".into(),
        });
        let species = if species.is_empty() { "" } else { ",VV" };
        text += &format!("{},{}{sigma}{species}\n", 0.5 + 0.03 * row as f64, cells.collect::<String>());
    }
    text
}

fn chi2(mission: &str, data: &Path) -> (f64, f64) {
    let json: Value =
        serde_json::from_str(&succeeds(&["validate", mission, data.to_str().unwrap(), "--json"])).unwrap();
    (json["chi2"].as_f64().unwrap(), json["n"].as_f64().unwrap())
}

/// Predictions are those of `validate`, to the last bit that a file keeps; with noise, they differ by as much as the errors say.
#[test]
fn every_observable_can_be_predicted_and_validates() {
    let folder = TempDir::new().unwrap();
    let path = |name: &str| folder.path().join(name);
    for observable in Observable::ALL {
        let sigma = match observable.name() {
            "dose" => "1e4",
            "packet_charge" | "eper" | "pumping_dipole" => "0.5",
            _ => "1e-5",
        };
        let (asked, found, noisy) = (path("asked.csv"), path("found.ecsv"), path("noisy.ecsv"));
        fs::write(&asked, conditions(observable, sigma)).unwrap();
        let predict = |out: &Path, more: &[&str]| {
            let words = ["predict", SNAP, asked.to_str().unwrap(), "--out", out.to_str().unwrap(), "--overwrite"];
            succeeds(&[&words[..], more].concat());
            fs::read_to_string(out).unwrap()
        };
        predict(&found, &[]);
        let (chi2_exact, n) = chi2(SNAP, &found);
        assert_eq!((chi2_exact, n), (0.0, ROWS as f64), "{observable}");
        let once = predict(&noisy, &["--noise", "--seed", "7"]);
        let (chi2_noisy, n) = chi2(SNAP, &noisy);
        // chi2 has the standard deviation sqrt(2n): five of them.
        assert!((chi2_noisy - n).abs() < 5.0 * (2.0 * n).sqrt(), "{observable}: chi2 {chi2_noisy} of {n}");
        assert_eq!(predict(&noisy, &["--noise", "--seed", "7"]), once, "{observable}: the same seed");
        assert_ne!(predict(&noisy, &["--noise", "--seed", "8"]), once, "{observable}: another seed");
    }
}

#[test]
fn what_cannot_be_predicted_is_refused_with_one_message() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("asked.csv");
    for (text, more, expected) in [
        ("t_yr,trail_px\n1,1\n", &[][..], "meta.observable is missing"),
        ("# observable: trail\nt_yr,trail_px\n1,1\n", &[], "needs `signal_e`"),
        ("# observable: dose\nt_yr\n-1\n", &[], "before launch"),
        ("# observable: dose\nt_yr\n1\n", &["--noise"], "no column `sigma`"),
        ("# observable: dose\nt_yr,sigma\n1,0\n", &["--noise"], "above 0"),
        ("# observable: dose\nt_yr\n", &[], "no rows"),
        ("# observable: dose\nt_yr\n1\n", &["--seed", "1"], "--noise"),
    ] {
        fs::write(&path, text).unwrap();
        let output = ctiplan(&[&["predict", SNAP, path.to_str().unwrap()][..], more].concat());
        let said = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{text}: {said}");
        assert!(said.contains(expected) && output.stdout.is_empty(), "{text}: {said}");
    }
    // Without noise, errors need not be known.
    fs::write(&path, "# observable: dose\nt_yr\n1\n").unwrap();
    assert!(succeeds(&["predict", SNAP, path.to_str().unwrap()]).starts_with("# %ECSV"));
}
