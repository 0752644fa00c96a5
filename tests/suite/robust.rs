//! What goes wrong around a program: no room, no permission, files that vanish, very long files, two of it at once.

#![cfg(unix)]

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::thread;
use std::time::Duration;

use tempfile::TempDir;

const SNAP: &str = "missions/snap_l2.toml";
const CASE: &str = "tests/practice/nothing-missing";

fn command(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_ctiplan"));
    command.args(arguments);
    command
}

fn ctiplan(arguments: &[&str]) -> Output {
    command(arguments).output().unwrap()
}

fn said(output: &Output) -> String {
    String::from_utf8(output.stderr.clone()).unwrap()
}

/// One message, and no panic.
fn refused(output: &Output, status: i32, message: &str) {
    let said = said(output);
    assert_eq!(output.status.code(), Some(status), "{said}");
    assert!(said.starts_with("error: ") && said.contains(message), "{message}: {said}");
    assert!(!said.contains("panicked") && said.matches("error: ").count() == 1, "{said}");
}

fn names(folder: &Path) -> Vec<String> {
    let all = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
    let mut names: Vec<String> = all.collect();
    names.sort();
    names
}

fn case(name: &str) -> String {
    format!("{CASE}/{name}")
}

/// A folder, and the path of a file in it.
fn scratch(name: &str) -> (TempDir, String) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name).display().to_string();
    (folder, path)
}

fn frame() -> &'static str {
    "tests/golden/camera.fits"
}

fn readout<'a>(output: &'a str, at: &'a str) -> Vec<&'a str> {
    let mission = "tests/images/mission.toml";
    let unit = ["--hdu", "1", "--gain-keyword", "GAIN", "--bias-dn", "500", "--overwrite"];
    [&["readout", frame(), output, "--mission", mission, "--at", at][..], &unit].concat()
}

#[test]
fn a_full_disk_behind_standard_output_is_said() {
    if !Path::new("/dev/full").exists() {
        crate::skipped::for_want_of("/dev/full");
        return;
    }
    for arguments in [&["evaluate", SNAP][..], &["effects"], &["schema"], &["completions", "bash"]] {
        let full = fs::File::create("/dev/full").unwrap();
        let output = command(arguments).stdout(full).stderr(Stdio::piped()).output().unwrap();
        refused(&output, 1, "cannot write the result");
    }
}

#[test]
fn closed_standard_output_is_said_before_the_work() {
    for arguments in ["evaluate missions/snap_l2.toml", "effects", "schema --help", "completions bash"] {
        let closed = format!("exec \"$0\" {arguments} >&-");
        let output = Command::new("bash").args(["-c", &closed, env!("CARGO_BIN_EXE_ctiplan")]).output().unwrap();
        refused(&output, 1, "standard output is closed");
    }
    // What is thrown away on purpose is no failure.
    let output = command(&["effects"]).stdout(Stdio::null()).stderr(Stdio::piped()).output().unwrap();
    assert!(output.status.success() && output.stderr.is_empty());
}

#[test]
fn a_device_is_not_read() {
    let mission = case("mission.toml");
    for arguments in [
        &["evaluate", "/dev/zero"][..],
        &["compare", SNAP, "/dev/zero"],
        &["validate", &mission, "/dev/zero"],
        &["fit", &mission, "/dev/zero"],
        &["diagnose", &mission, &case("delta_e1.ecsv"), "--candidates", "/dev/zero"],
        &["study", "correction", SNAP, "--fit", "/dev/zero"],
        &["study", "error-budget", SNAP, "--detector-of", "/dev/zero"],
        &["sweep", "/dev/zero", "--output", "target/none.csv"],
    ] {
        refused(&ctiplan(arguments), 2, "this is a device, not a file");
    }
    let frame = ["readout", "/dev/zero", "target/none.fits", "--mission", &mission, "--at", "1"];
    refused(&ctiplan(&frame), 2, "not a FITS file");
}

#[test]
fn what_never_ends_is_not_read_for_ever() {
    let endless = "exec \"$0\" evaluate <(yes)";
    let output = Command::new("bash").args(["-c", endless, env!("CARGO_BIN_EXE_ctiplan")]).output().unwrap();
    refused(&output, 2, "longer than");
}

/// A limit on the size of files is a disk that is full: writing fails in the middle.
#[test]
fn what_finds_no_room_leaves_nothing_behind_and_what_was_there_untouched() {
    let (folder, path) = scratch("out");
    let words = |words: &[&str]| words.iter().map(|word| word.to_string()).collect::<Vec<_>>();
    let svg = folder.path().join("plots").display().to_string();
    let grid = folder.path().join("grid.toml");
    let mission = fs::canonicalize(SNAP).unwrap();
    let axis = "[axes]\nreadout.transfers = [100, 200]\n";
    fs::write(&grid, format!("mission = \"{}\"\noutputs = [\"dose_mev_g\"]\n{axis}", mission.display())).unwrap();
    fs::write(&path, "what was there").unwrap();
    let mut attempts = vec![
        words(&readout(&path, "3")),
        words(&["init", &path, "--overwrite"]),
        words(&[
            "fit",
            &case("mission.toml"),
            &case("delta_e1.ecsv"),
            "--free",
            "detector.well_fill_power",
            "--write",
            &path,
        ]),
        words(&["validate", &case("mission.toml"), &case("delta_e1.ecsv"), "--plots", &svg]),
    ];
    attempts.push(words(&["man", &svg]));
    for arguments in attempts {
        // Blocks of 1 kB.
        let limited = "trap '' XFSZ; ulimit -f 1; exec \"$0\" \"$@\"";
        let output =
            Command::new("bash").args(["-c", limited, env!("CARGO_BIN_EXE_ctiplan")]).args(&arguments).output();
        refused(&output.unwrap(), 2, "cannot write");
        assert_eq!(fs::read_to_string(&path).unwrap(), "what was there", "{arguments:?}");
        let left = names(folder.path());
        assert!(
            left.iter().all(|name| ["grid.toml", "out", "plots"].contains(&name.as_str())),
            "{arguments:?}: {left:?}"
        );
        if Path::new(&svg).exists() {
            assert!(names(Path::new(&svg)).iter().all(|name| !name.contains("tmp") && !name.contains("part")));
        }
    }
    // A sweep that found no room goes on when there is some.
    let result = folder.path().join("sweep.csv").display().to_string();
    let sweep = ["sweep", grid.to_str().unwrap(), "--output", &result];
    let limited = "trap '' XFSZ; ulimit -f 0; exec \"$0\" \"$@\"";
    let output =
        Command::new("bash").args(["-c", limited, env!("CARGO_BIN_EXE_ctiplan")]).args(sweep).output().unwrap();
    assert!(matches!(output.status.code(), Some(1 | 2)) && said(&output).contains("cannot write"), "{}", said(&output));
    assert!(!Path::new(&result).exists());
    let output = ctiplan(&sweep);
    assert!(output.status.success(), "{}", said(&output));
    assert_eq!(fs::read_to_string(&result).unwrap().lines().count(), 3);
}

#[test]
fn paths_that_cannot_be_written_are_refused_before_the_work() {
    let (folder, file) = scratch("file");
    fs::write(&file, "").unwrap();
    let there = folder.path().display().to_string();
    let nowhere = format!("{there}/no/such/folder/new");
    let below_a_file = format!("{file}/new");
    let pipe = format!("{there}/pipe");
    assert!(Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    let (mission, data) = (case("mission.toml"), case("delta_e1.ecsv"));
    for (path, problem) in [
        (&nowhere[..], "the folder is not there"),
        (&below_a_file, "Not a directory"),
        (&there, "this is a folder, not a file"),
        (&pipe, "this is a device or a pipe, not a file"),
    ] {
        let refusal = format!("cannot write `{path}`\n  {problem}");
        let free = ["--free", "detector.well_fill_power"];
        for verb in ["fit", "diagnose"] {
            let arguments = [&[verb, &mission, &data, "--write", path], &free[..]].concat();
            let output = ctiplan(&arguments);
            refused(&output, 2, &refusal);
            assert!(output.stdout.is_empty());
        }
        refused(&ctiplan(&["init", path, "--overwrite"]), 2, &refusal);
        refused(&ctiplan(&readout(path, "3")), 2, &refusal);
    }
    for folder in [&file, &below_a_file] {
        refused(&ctiplan(&["validate", &mission, &data, "--plots", folder]), 2, "cannot make the folder");
        refused(&ctiplan(&["validate", &mission, &data, "--residuals", folder]), 2, "cannot make the folder");
        refused(&ctiplan(&["man", folder]), 2, "cannot make the folder");
    }
    assert_eq!(names(folder.path()), ["file", "pipe"]);
}

#[test]
fn files_that_vanish_are_missed_before_they_are_needed_or_not_at_all() {
    let (mission, data) = (case("mission.toml"), case("delta_e1.ecsv"));
    refused(&ctiplan(&["validate", "no/mission.toml", &data]), 2, "there is no such file");
    refused(&ctiplan(&["validate", &mission, "no/data.ecsv"]), 2, "there is no such file");
    refused(&ctiplan(&["validate", &mission, CASE]), 2, "this is a folder, not a file");
    refused(&ctiplan(&["readout", "no.fits", "target/out.fits", "--mission", &mission, "--at", "1"]), 2, "cannot read");
    // A mission that is removed after it was read: the data come by a pipe, which holds the program up in between.
    let (folder, copy) = scratch("mission.toml");
    fs::copy(&mission, &copy).unwrap();
    let pipe = folder.path().join("data.ecsv");
    assert!(Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    let new = folder.path().join("new.toml");
    let free = ["--free", "detector.well_fill_power", "--write", new.to_str().unwrap()];
    let mut fit = command(&["fit", &copy, pipe.to_str().unwrap()]);
    let child = fit.args(free).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    // Opened when the program opens it to read, which is after the mission.
    let mut writer = fs::OpenOptions::new().write(true).open(&pipe).unwrap();
    fs::remove_file(&copy).unwrap();
    writer.write_all(&fs::read(&data).unwrap()).unwrap();
    drop(writer);
    let output = child.wait_with_output().unwrap();
    assert!(output.status.success(), "{}", said(&output));
    assert!(fs::read_to_string(&new).unwrap().contains("well_fill_power"));
}

/// So long a file, with one observable and the conditions of an epoch.
fn long_file(path: &Path, rows: usize) {
    let mut file = std::io::BufWriter::new(fs::File::create(path).unwrap());
    writeln!(file, "# observable: dose\nt_yr,value,sigma,camera").unwrap();
    for row in 0..rows {
        let t_yr = 5.0 * row as f64 / rows as f64;
        writeln!(file, "{t_yr},{},1000,{}", 1.61e6 * t_yr, row % 4).unwrap();
    }
    file.flush().unwrap();
}

#[test]
#[ignore = "slow: .ci/run runs it"]
fn a_million_rows_are_read() {
    let (_folder, path) = scratch("long.csv");
    long_file(Path::new(&path), 1_000_000);
    let mission = ctiplan::mission::Mission::read(SNAP).unwrap();
    let data = ctiplan::analysis::measurement::DataSet::read(&path, &mission).unwrap();
    assert_eq!(data.rows.len(), 1_000_000);
    assert_eq!(data.rows[999_999].at.get("camera"), Some(3.0));
    // A mistake at its end is told with its line.
    let mut file = fs::OpenOptions::new().append(true).open(&path).unwrap();
    writeln!(file, "5.0,8.1e6,-1000,0").unwrap();
    let error = ctiplan::analysis::measurement::DataSet::read(&path, &mission).unwrap_err();
    assert!(error.to_string().contains("line 1000003"), "{error}");
}

/// Time and memory of a million rows: `cargo test --release --test suite robust:: -- --ignored --nocapture`
#[test]
#[ignore = "takes a minute"]
fn expensive_a_million_rows_are_validated() {
    let (folder, path) = scratch("long.csv");
    long_file(Path::new(&path), 1_000_000);
    let start = std::time::Instant::now();
    let result = fs::File::create(folder.path().join("result.json")).unwrap();
    let mut child = command(&["validate", SNAP, &path, "--json"]).stdout(result).spawn().unwrap();
    let mut most_kb = 0;
    let status = loop {
        if let Some(status) = child.try_wait().unwrap() {
            break status;
        }
        let about = fs::read_to_string(format!("/proc/{}/status", child.id())).unwrap_or_default();
        let peak = about.lines().find_map(|line| line.strip_prefix("VmHWM:")?.trim().strip_suffix(" kB")?.parse().ok());
        most_kb = most_kb.max(peak.unwrap_or(0));
        thread::sleep(Duration::from_millis(20));
    };
    assert!(status.success());
    let json = fs::read(folder.path().join("result.json")).unwrap();
    let json: serde_json::Value = serde_json::from_slice(&json).unwrap();
    assert_eq!(json["n"], 1_000_000);
    println!("a million rows of dose: {:.0} s, {} MB", start.elapsed().as_secs_f64(), most_kb / 1024);
}

#[test]
fn of_two_that_write_one_frame_one_is_there_whole() {
    let (folder, path) = scratch("out.fits");
    let alone = |at: &str| {
        let (_folder, path) = scratch("alone.fits");
        let output = ctiplan(&readout(&path, at));
        assert!(output.status.success(), "{}", said(&output));
        fs::read(&path).unwrap()
    };
    let wanted = [alone("1"), alone("5")];
    assert_ne!(wanted[0], wanted[1]);
    for _ in 0..5 {
        let both = ["1", "5"].map(|at| command(&readout(&path, at)).stdout(Stdio::null()).spawn().unwrap());
        // A reader in between sees a whole file or none.
        let seen: Vec<Vec<u8>> = (0..50)
            .filter_map(|_| {
                thread::sleep(Duration::from_millis(2));
                fs::read(&path).ok()
            })
            .collect();
        for mut child in both {
            assert!(child.wait().unwrap().success());
        }
        let last = fs::read(&path).unwrap();
        assert!(seen.iter().chain([&last]).all(|seen| wanted.contains(seen)));
        assert_eq!(names(folder.path()), ["out.fits"]);
    }
}

#[test]
fn two_that_compute_one_sweep_come_to_the_result_of_one() {
    let folder = tempfile::tempdir().unwrap();
    let grid = folder.path().join("grid.toml");
    let mission = fs::canonicalize(SNAP).unwrap();
    let text = format!(
        "mission = \"{}\"\noutputs = [\"delta_e\"]\nsampling = \"monte-carlo\"\ndraws = 40\nchunk_points = 4\n[axes]\n\
         detector.temperature_k = {{ distribution = \"normal\", mean = 133.0, sigma = 2.0 }}\n",
        mission.display()
    );
    fs::write(&grid, text).unwrap();
    let result = |name: &str| -> PathBuf { folder.path().join(name) };
    let sweep = |result: &Path| {
        let arguments = ["sweep", grid.to_str().unwrap(), "--output", result.to_str().unwrap()];
        command(&arguments).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap()
    };
    let alone = result("alone.csv");
    assert!(sweep(&alone).wait().unwrap().success());
    let shared = result("shared.csv");
    let both = [sweep(&shared), sweep(&shared)].map(|child| child.wait_with_output().unwrap());
    assert!(both.iter().any(|output| output.status.success()));
    for output in both {
        // The other may be told that it is not alone.
        assert!(output.status.success() || said(&output).contains("another ctiplan is at work"), "{}", said(&output));
    }
    assert_eq!(fs::read(&alone).unwrap(), fs::read(&shared).unwrap());
    assert_eq!(names(folder.path()), ["alone.csv", "grid.toml", "shared.csv"]);
}
