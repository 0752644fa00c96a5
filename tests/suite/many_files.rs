//! Many files at once: `--out-folder`, `--resume`, and what becomes of files that fail; what headers say of it.

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use ctiplan::image::fits::Fits;
use fitsio_pure::value::Value;
use ndarray::Array2;
use serde_json::Value as Json;

use crate::amplifiers::{field, file, values, work};

fn many(command: &str, inputs: &[&Path], folder: &Path, more: &[&str]) -> Output {
    let files = inputs.iter().map(|path| path.to_str().unwrap());
    let options = ["--mission", "tests/images/mission.toml", "--at", "2", "--out-folder", folder.to_str().unwrap()];
    Command::new(env!("CARGO_BIN_EXE_ctiplan")).arg(command).args(files).args(options).args(more).output().unwrap()
}

fn frame(path: &Path, charge_e: f64) {
    file(path, &[], &[("SCI", 1, field(20, 5) + charge_e, vec![("BUNIT", Value::String("electron".into()))])]);
}

fn said(output: &Output) -> String {
    String::from_utf8(output.stderr.clone()).unwrap()
}

#[test]
fn many_files_are_as_each_alone_and_one_that_fails_loses_no_other() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    frame(&at("a.fits"), 0.0);
    fs::write(at("b.fits"), "no FITS file").unwrap();
    frame(&at("c.fits"), 50.0);
    let inputs = ["a.fits", "b.fits", "c.fits"].map(at);
    let inputs: Vec<&Path> = inputs.iter().map(|path| path.as_path()).collect();
    let done = many("correct", &inputs, &at("out"), &["--json"]);
    assert_eq!(done.status.code(), Some(2));
    let stderr = said(&done);
    assert!(stderr.starts_with("error: 1 of 3 files failed; the others are complete\n  cannot read `"), "{stderr}");
    assert!(stderr.contains("b.fits`") && stderr.contains("this is not a FITS file"), "{stderr}");
    let report: Json = serde_json::from_slice(&done.stdout).unwrap();
    let status: Vec<&str> =
        report["files"].as_array().unwrap().iter().map(|file| file["status"].as_str().unwrap()).collect();
    assert_eq!(status, ["done", "failed", "done"]);
    assert_eq!(report["files"][2]["result"]["hdus"][1]["name"], "SCI");
    let names: Vec<_> = fs::read_dir(at("out")).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    assert_eq!(names.len(), 2, "{names:?}");
    let alone = Command::new(env!("CARGO_BIN_EXE_ctiplan"))
        .args(["correct", at("c.fits").to_str().unwrap(), at("alone.fits").to_str().unwrap()])
        .args(["--mission", "tests/images/mission.toml", "--at", "2"])
        .output()
        .unwrap();
    assert!(alone.status.success());
    assert!(fs::read(at("alone.fits")).unwrap() == fs::read(at("out/c.fits")).unwrap());

    // The other file is mended, and only it is made.
    frame(&at("b.fits"), 20.0);
    let time = |name: &str| fs::metadata(at(name)).unwrap().modified().unwrap();
    let before = (time("out/a.fits"), time("out/c.fits"));
    let refused = many("correct", &inputs, &at("out"), &[]);
    assert!(refused.status.code() == Some(2) && said(&refused).contains("--resume"), "{}", said(&refused));
    assert!(!at("out/b.fits").exists());
    let resumed = many("correct", &inputs, &at("out"), &["--resume", "--csv"]);
    assert!(resumed.status.success(), "{}", said(&resumed));
    let table = String::from_utf8(resumed.stdout).unwrap();
    let rows: Vec<Vec<&str>> = table.lines().map(|line| line.split(',').collect()).collect();
    assert_eq!(rows[0][2..4], ["status", "frames"]);
    assert_eq!([rows[1][2], rows[2][2], rows[3][2]], ["kept", "done", "kept"]);
    assert_eq!(before, (time("out/a.fits"), time("out/c.fits")));
    assert!(at("out/b.fits").exists());
    // Files of another epoch are not kept in silence.
    let later = many("correct", &inputs, &at("out"), &["--resume", "--dose-mev-g", "1e7"]);
    assert!(later.status.code() == Some(2) && said(&later).contains("it was made with mission"), "{}", said(&later));
    let text = String::from_utf8(many("correct", &inputs, &at("out"), &["--overwrite"]).stdout).unwrap();
    assert!(text.lines().any(|line| line.trim_start().starts_with("b.fits") && line.contains("done")), "{text}");
    assert!(before.0 < time("out/a.fits"));
}

#[test]
fn only_files_of_the_same_command_mission_and_options_are_kept() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let electrons = || vec![("BUNIT", Value::String("electron".into()))];
    file(&at("a.fits"), &[], &[("SCI", 1, field(20, 5), electrons()), ("SCI", 2, field(20, 5), electrons())]);
    let input = at("a.fits");
    let map = at("map.fits");
    file(&map, &[], &[("SCI", 1, Array2::from_elem((1, 5), 1.1), Vec::new())]);
    let options: [&[&str]; 9] = [
        &["--set", "detector.temperature_k=151"],
        &["--set", "detector.traps.slow.density_per_px=0.3"],
        &["--corner", "upper-left"],
        &["--bias-dn", "3"],
        &["--transfers-before", "7"],
        &["--tolerance", "1e-2"],
        &["--relative", "1e-5"],
        &["--trap-map", map.to_str().unwrap()],
        &["--keep-err"],
    ];
    assert!(many("correct", &[&input], &at("out"), &[]).status.success());
    assert!(many("correct", &[&input], &at("out"), &["--resume"]).status.success());
    let made = fs::read(at("out/a.fits")).unwrap();
    let refused = |command: &str, more: &[&str], words: &str| {
        let done = many(command, &[&input], &at("out"), &[&["--resume"], more].concat());
        assert_eq!(done.status.code(), Some(2), "{command} {more:?}");
        assert!(said(&done).contains("cannot keep") && said(&done).contains(words), "{more:?}: {}", said(&done));
    };
    for more in options {
        refused("correct", more, "CTIJOB = ");
    }
    refused("readout", &[], "CTIJOB = ");
    refused("correct", &["--hdu", "2"], "other HDUs");
    refused("correct", &["--hdu", "SCI,1"], "other HDUs");
    assert!(fs::read(at("out/a.fits")).unwrap() == made, "a file that is refused stays as it was");
    // A raw frame under the name of the output.
    fs::copy(&input, at("out/a.fits")).unwrap();
    refused("correct", &[], "no frame in it has the keyword CTIJOB");
}

#[test]
fn what_an_interruption_has_left_is_removed() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    frame(&at("a.fits"), 0.0);
    fs::create_dir(at("out")).unwrap();
    fs::write(at("out/.a.fits.XyZ123.part"), "half").unwrap();
    fs::write(at("out/.b.fits.XyZ123.part"), "of another command").unwrap();
    assert!(many("correct", &[&at("a.fits")], &at("out"), &["--resume"]).status.success());
    let mut names: Vec<_> = fs::read_dir(at("out")).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    names.sort();
    assert_eq!(names, [".b.fits.XyZ123.part", "a.fits"]);
}

/// A signal that ends the program runs no destructor.
#[cfg(unix)]
#[test]
fn an_interrupted_command_leaves_no_incomplete_file() {
    use std::os::unix::process::ExitStatusExt;
    use std::time::{Duration, Instant};

    let folder = tempfile::tempdir().unwrap();
    let input = folder.path().join("a.fits");
    let electrons = vec![("BUNIT", Value::String("electron".into()))];
    file(&input, &[], &[("SCI", 1, field(2000, 400), electrons)]);
    let out = folder.path().join("out");
    fs::create_dir(&out).unwrap();
    let mut running = Command::new(env!("CARGO_BIN_EXE_ctiplan"))
        .args(["correct", input.to_str().unwrap(), out.join("a.fits").to_str().unwrap()])
        .args(["--mission", "tests/images/mission.toml", "--at", "2", "--tolerance", "1e-9"])
        .spawn()
        .unwrap();
    let names = || -> Vec<String> {
        fs::read_dir(&out).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect()
    };
    let begun = Instant::now();
    while !names().iter().any(|name| name.ends_with(".part")) {
        assert!(begun.elapsed() < Duration::from_secs(60), "nothing is written");
        std::thread::sleep(Duration::from_millis(1));
    }
    // Not SIGINT, which tests in the background of a shell ignore.
    assert!(Command::new("kill").args(["-TERM", &running.id().to_string()]).status().unwrap().success());
    let status = running.wait().unwrap();
    assert_eq!(status.signal(), Some(15), "{status}");
    assert_eq!(names(), Vec::<String>::new());
}

#[test]
fn files_that_would_replace_one_another_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    fs::create_dir(at("other")).unwrap();
    frame(&at("a.fits"), 0.0);
    frame(&at("other/a.fits"), 1.0);
    let says = |inputs: &[&Path], out: &Path, words: &str| {
        let done = many("readout", inputs, out, &[]);
        assert_eq!(done.status.code(), Some(2));
        assert!(said(&done).contains(words), "{}", said(&done));
    };
    says(&[&at("a.fits"), &at("other/a.fits")], &at("out"), "two files have this name");
    says(&[&at("a.fits")], folder.path(), "it is one of the files that are read");
    says(&[&at("a.fits")], &at("other/../"), "it is one of the files that are read");
    says(&[&at("a.fits")], &at("a.fits"), "this is a file, not a folder");
    // Without a folder two files are needed, no more and no less.
    for files in [&["a"][..], &["a", "b", "c"]] {
        let mission = ["--mission", "tests/images/mission.toml", "--at", "1"];
        let done =
            Command::new(env!("CARGO_BIN_EXE_ctiplan")).arg("readout").args(files).args(mission).output().unwrap();
        assert!(done.status.code() == Some(2) && said(&done).contains("--out-folder"), "{}", said(&done));
    }
}

#[test]
fn headers_say_what_was_done() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    frame(&at("in.fits"), 0.0);
    work("readout", &at("in.fits"), &at("trailed.fits"), &[]);
    let report = work("correct", &at("trailed.fits"), &at("once.fits"), &[]);
    let header = |name: &str| Fits::open(&at(name)).unwrap().hdus[1].clone();
    let once = header("once.fits");
    let text = |keyword: &str| once.text(keyword);
    assert_eq!(text("CTICORR"), Some(concat!("ctiplan ", env!("CARGO_PKG_VERSION")).into()));
    assert_eq!(text("CTIADDED"), text("CTICORR"));
    assert_eq!(text("CTIMISS"), Some("frames".into()));
    assert_eq!(once.value("CTIYEAR"), Some(&Value::Float(0.0)));
    assert_eq!(once.value("CTIDOSE"), Some(&Value::Float(1e8)));
    let done = &report["hdus"][1];
    assert_eq!(once.value("CTIITER"), Some(&Value::Integer(done["iterations"].as_i64().unwrap())));
    assert_eq!(once.value("CTIUNCER"), Some(&Value::Integer(0)));
    let Some(Value::Float(rms)) = once.value("CTIRMS") else { panic!() };
    assert!((rms / done["left"]["rms_e"].as_f64().unwrap() - 1.0).abs() < 1e-9);
    assert!(report["warnings"].as_array().unwrap().is_empty(), "{report}");
    // Once more: a warning, and no keyword twice.
    let again = work("correct", &at("once.fits"), &at("twice.fits"), &[]);
    assert!(again["warnings"][0].as_str().unwrap().contains("HDU 1 (SCI)"), "{again}");
    let bytes = fs::read(at("twice.fits")).unwrap();
    let cards = |keyword: &[u8]| bytes.chunks(80).filter(|card| card.starts_with(keyword)).count();
    assert_eq!((cards(b"CTICORR "), cards(b"CTIYEAR "), cards(b"CTIADDED")), (1, 1, 1));
    let before: Array2<f64> = values(&at("in.fits"), 1);
    assert!((values(&at("once.fits"), 1) - before).iter().all(|error| error.abs() < 0.05));
}
