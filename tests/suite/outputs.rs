//! No output replaces a file that is read, or another output, or without `--overwrite` any file: for every command, every output and
//! every input of it.

#![cfg(unix)]

use std::fs;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use tempfile::TempDir;

/// A command line: words, `@NAME` for an input, and its outputs.
struct Case {
    words: &'static str,
    outputs: &'static [&'static str],
}

const fn case(words: &'static str, outputs: &'static [&'static str]) -> Case {
    Case { words, outputs }
}

const DRAWN: &[&str] = &["--plots", "--html"];

/// Every command that reads and writes files. The output without a name is the one that stands behind the words.
const CASES: &[Case] = &[
    case("evaluate @mission.toml --posterior @posterior.ecsv", DRAWN),
    case("compare @mission.toml @other.toml", DRAWN),
    case("catalogue @mission.toml @galaxies.csv --at 1", &["--out"]),
    case("dose @mission.toml", DRAWN),
    case("sweep @grid.toml", &["--output"]),
    case("validate @mission.toml @trails.ecsv @packets.ecsv", &["--plots", "--html", "--residuals"]),
    case("predict @mission.toml @trails.ecsv", &["--out"]),
    case(
        "fit @mission.toml @trails.ecsv --free detector.well_fill_power --posterior 10",
        &["--plots", "--html", "--write", "--out"],
    ),
    case("diagnose @mission.toml @trails.ecsv --candidates @candidates.toml", &["--plots", "--html", "--write"]),
    case("readout --mission @mission.toml --at 1 --hdu 5 --overwrite @frame.fits", &[""]),
    case(
        "readout --mission @mission.toml --at 1 --amplifiers @amplifiers.csv --trap-map @map.fits --overwrite @frame.fits",
        &[""],
    ),
    case("readout --mission @mission.toml --at 1 --hdu 5 --overwrite @frame.fits", &["--out-folder"]),
    case("correct --mission @mission.toml --at 1 --hdu 5 --overwrite @frame.fits", &[""]),
    case(
        "correct --mission @mission.toml --at 1 --amplifiers @amplifiers.csv --trap-map @map.fits --overwrite @frame.fits",
        &[""],
    ),
    case("correct --mission @mission.toml --at 1 --hdu 5 --overwrite @frame.fits", &["--out-folder"]),
    case("measure eper --bias-dn 0 @frame.fits none.fits", &["", "--first-pixel", "--cti"]),
    case("measure eper --amplifiers @amplifiers.csv @frame.fits none.fits", &["", "--first-pixel", "--cti"]),
    case("measure trails --amplifiers @amplifiers.csv @frame.fits", &[""]),
    case("measure dipoles --amplifiers @amplifiers.csv @frame.fits", &[""]),
    case("measure injection --amplifiers @amplifiers.csv @frame.fits none.fits", &["", "--first-pixel"]),
    case("study clock @mission.toml", DRAWN),
    case("study distance @mission.toml", DRAWN),
    case("study correction @mission.toml --fit @fit.json", DRAWN),
    case("study calibration @mission.toml --interval-months 3 --samples 50", DRAWN),
    case("study preflash @mission.toml", DRAWN),
    case("study charge-injection @mission.toml", DRAWN),
    case("study pocket-pumping @mission.toml", DRAWN),
    case("study launch @mission.toml", DRAWN),
    case("study shielding @mission.toml", DRAWN),
    case("study requirement @mission.toml --probability 0", DRAWN),
    case("study error-budget @mission.toml --detector-of @other.toml", DRAWN),
];

/// Commands that read no files.
const READ_NOTHING: [&str; 6] = ["effects", "init", "schema", "completions", "man", "help"];

const SOURCES: [(&str, &str); 6] = [
    ("mission.toml", "tests/practice/slow-trap/mission.toml"),
    ("other.toml", "missions/snap_l2.toml"),
    ("trails.ecsv", "tests/practice/slow-trap/trails.ecsv"),
    ("packets.ecsv", "tests/practice/slow-trap/packets.ecsv"),
    ("frame.fits", "tests/golden/camera.fits"),
    // Also read by the grid.
    ("snap.toml", "missions/snap_l2.toml"),
];

const GRID: &str =
    "mission = [\"other.toml\", \"snap.toml\"]\noutputs = [\"dose_mev_g\"]\n[axes]\nreadout.transfers = [100, 200]\n";
const CANDIDATES: &str =
    "[effects.formula]\ntarget = \"value\"\nexpression = \"value * (1 + drift)\"\nparameters = { drift = 0.01 }\n";
const FIT: &str =
    "{\"parameters\": [{\"key\": \"detector.well_fill_power\", \"sigma\": 0.01}], \"correlation\": [[1]]}";

const AMPLIFIERS: &str = "hdu,corner\n5,lower-left\n";

const POSTERIOR: &str = "detector.temperature_k\n133.0\n";

/// All inputs in a folder of their own.
fn inputs() -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    for (name, source) in SOURCES {
        fs::copy(source, folder.path().join(name)).unwrap();
    }
    let texts = [
        ("grid.toml", GRID),
        ("candidates.toml", CANDIDATES),
        ("fit.json", FIT),
        ("posterior.ecsv", POSTERIOR),
        ("galaxies.csv", "transfers,flux_e\n200,3000\n"),
        ("amplifiers.csv", AMPLIFIERS),
    ];
    for (name, text) in texts {
        fs::write(folder.path().join(name), text).unwrap();
    }
    let factors = ndarray::Array2::ones((1, 47));
    crate::amplifiers::file(&folder.path().join("map.fits"), &[], &[("MAP", 1, factors, vec![])]);
    folder
}

impl Case {
    /// Names of the files that are read.
    fn inputs(&self) -> Vec<&str> {
        let mut named: Vec<&str> = self.words.split(' ').filter_map(|word| word.strip_prefix('@')).collect();
        if named == ["grid.toml"] {
            named.extend(["other.toml", "snap.toml"]);
        }
        named
    }

    /// Runs the command in a folder.
    fn run(&self, folder: &Path, outputs: &[(&str, &Path)]) -> Output {
        let mut command = Command::new(env!("CARGO_BIN_EXE_ctiplan"));
        command.current_dir(folder).args(self.words.split(' ').map(|word| word.trim_start_matches('@')));
        for (option, path) in outputs {
            command.args([*option].iter().filter(|option| !option.is_empty())).arg(path);
        }
        command.output().unwrap()
    }
}

/// Everything in a folder and below it, with its bytes.
fn all(folder: &Path) -> Vec<(PathBuf, Vec<u8>)> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        match path.is_dir() {
            true => found.extend(all(&path)),
            false => found.push((path.clone(), fs::read(&path).unwrap())),
        }
    }
    found.sort();
    found
}

fn refused(output: &Output, what: &str) {
    let said = String::from_utf8(output.stderr.clone()).unwrap();
    assert_eq!(output.status.code(), Some(2), "{what}: {said}");
    assert!(said.starts_with("error: cannot write `") && said.matches("error: ").count() == 1, "{what}: {said}");
    assert!(output.stdout.is_empty(), "{what}");
}

/// Ways to name a file of a folder, each as an output of some ending: the path to give, with what must be there first.
fn ways(folder: &Path, input: &str, ending: &str) -> Vec<PathBuf> {
    let target = folder.join(input);
    let (soft, hard) = (folder.join(format!("1-soft.{ending}")), folder.join(format!("1-hard.{ending}")));
    symlink(&target, &soft).unwrap();
    fs::hard_link(&target, &hard).unwrap();
    let name = folder.file_name().unwrap().to_str().unwrap();
    let plain = [input.into(), format!("./{input}"), format!("../{name}//{input}"), target.to_str().unwrap().into()];
    plain.into_iter().map(PathBuf::from).chain([soft, hard]).collect()
}

#[test]
fn no_output_replaces_an_input() {
    for case in CASES {
        for (input, option) in case.inputs().into_iter().flat_map(|input| case.outputs.iter().map(move |o| (input, *o)))
        {
            let folder = inputs();
            // Into a folder: a file that may be replaced there is one that is read.
            let into = ["--plots", "--residuals", "--out-folder"].contains(&option);
            let ending = match option {
                "--plots" => "svg",
                "--residuals" => "ecsv",
                "--output" => "csv",
                _ => "any",
            };
            let links = ways(folder.path(), input, ending);
            let paths: Vec<PathBuf> = if into {
                vec![
                    ".".into(),
                    folder.path().into(),
                    format!("../{}", folder.path().file_name().unwrap().display()).into(),
                ]
            } else {
                links
            };
            let before = all(folder.path());
            for path in paths {
                let what = format!("{} {option} {} ({input})", case.words, path.display());
                refused(&case.run(folder.path(), &[(option, &path)]), &what);
                assert!(before == all(folder.path()), "{what}: files have changed");
            }
        }
    }
}

/// Outputs that go on with what is there.
const RESUMED: [&str; 1] = ["--output"];

/// Without `--overwrite` nothing that exists is replaced, and nothing is computed or printed before that is said.
#[test]
fn no_output_replaces_a_file_unasked() {
    for case in CASES {
        let words = case.words.replace("--overwrite ", "");
        for option in case.outputs.iter().filter(|option| !RESUMED.contains(option)) {
            let folder = inputs();
            let there = match *option {
                "--plots" => "out/error.svg",
                "--residuals" => "out/1-trails.ecsv",
                "--out-folder" => "out/frame.fits",
                "--out" => "out/there.ecsv",
                _ => "out/there",
            };
            fs::create_dir(folder.path().join("out")).unwrap();
            fs::write(folder.path().join(there), "of another day").unwrap();
            let before = all(folder.path());
            let path = if ["--plots", "--residuals", "--out-folder"].contains(option) { "out" } else { there };
            let words = Case { words: Box::leak(words.clone().into_boxed_str()), outputs: case.outputs };
            let output = words.run(folder.path(), &[(option, Path::new(path))]);
            let what = format!("{} {option} {path}", words.words);
            refused(&output, &what);
            let said = String::from_utf8(output.stderr).unwrap();
            assert!(said.contains("exists already") && said.contains("--overwrite"), "{what}: {said}");
            assert!(before == all(folder.path()), "{what}: files have changed");
        }
    }
}

/// Every command with an output offers the remedy.
#[test]
fn every_command_that_writes_may_overwrite() {
    let own = [vec!["init"], vec!["man"]];
    let with_outputs = CASES.iter().filter(|case| case.outputs.iter().any(|option| !RESUMED.contains(option)));
    let named = with_outputs.map(|case| {
        let words = case.words.split(' ');
        words.take(if ["study", "measure"].iter().any(|above| case.words.starts_with(above)) { 2 } else { 1 }).collect()
    });
    for command in named.chain(own) {
        assert!(help(&command).contains("--overwrite"), "{command:?}");
    }
}

#[test]
fn a_mission_is_revised_in_place_only_if_asked() {
    const FIT: &str = "fit @mission.toml @trails.ecsv --only --free detector.well_fill_power";
    let folder = inputs();
    let before = all(folder.path());
    let onto_itself: &[(&str, &Path)] = &[("--write", Path::new("mission.toml"))];
    refused(&case(FIT, &[]).run(folder.path(), onto_itself), "without --overwrite");
    assert!(before == all(folder.path()));
    const ASKED: &str = "fit @mission.toml @trails.ecsv --only --free detector.well_fill_power --overwrite";
    // Not the data, nor the mission by another output.
    refused(&case(ASKED, &[]).run(folder.path(), &[("--write", Path::new("trails.ecsv"))]), "the data");
    refused(&case(ASKED, &[]).run(folder.path(), &[("--html", Path::new("mission.toml"))]), "a page");
    assert!(before == all(folder.path()));
    let output = case(ASKED, &[]).run(folder.path(), onto_itself);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let changed = all(folder.path()).into_iter().zip(before).filter(|(now, then)| now != then);
    let changed: Vec<PathBuf> = changed.map(|((path, _), _)| path).collect();
    assert_eq!(changed, [folder.path().join("mission.toml")]);
}

#[test]
fn no_two_outputs_are_the_same_file() {
    for case in CASES.iter().filter(|case| case.outputs.len() > 1) {
        let folder = inputs();
        fs::create_dir(folder.path().join("figures")).unwrap();
        symlink("figures", folder.path().join("link")).unwrap();
        let before = all(folder.path());
        let files: Vec<&str> =
            case.outputs.iter().copied().filter(|o| ["", "--first-pixel", "--html", "--write"].contains(o)).collect();
        let mut pairs: Vec<[(&str, &str); 2]> = Vec::new();
        if let [one, other] = files[..] {
            pairs.push([(one, "new"), (other, "./new")]);
            pairs.push([(one, "link/new"), (other, "figures/new")]);
        }
        if case.outputs.contains(&"--plots") {
            pairs.extend(files.iter().map(|file| [("--plots", "figures"), (*file, "link/error.svg")]));
            pairs.extend(files.iter().map(|file| [("--plots", "not/yet"), (*file, "not/yet/error.svg")]));
        }
        assert!(!pairs.is_empty());
        for pair in pairs {
            let what = format!("{}: {pair:?}", case.words);
            refused(&case.run(folder.path(), &pair.map(|(option, path)| (option, Path::new(path)))), &what);
            assert!(before == all(folder.path()) && !folder.path().join("not").exists(), "{what}: files have changed");
        }
    }
}

/// Words of the help of a command that stand in angle brackets behind an option, and names of commands.
fn help(command: &[&str]) -> String {
    let output = Command::new(env!("CARGO_BIN_EXE_ctiplan")).args(command).arg("--help").output().unwrap();
    String::from_utf8(output.stdout).unwrap()
}

fn commands_of(command: &[&str]) -> Vec<String> {
    let help = help(command);
    let listed = help.lines().skip_while(|line| *line != "Commands:").skip(1).take_while(|line| !line.is_empty());
    // Descriptions are indented further.
    let names = listed.filter(|line| line.starts_with("  ") && !line.starts_with("   "));
    names.map(|line| line.split_whitespace().next().unwrap().to_string()).collect()
}

/// The cases above name every command, and every option with a file.
#[test]
fn the_law_leaves_out_no_command_and_no_option() {
    let mut commands: Vec<Vec<String>> = commands_of(&[]).into_iter().map(|name| vec![name]).collect();
    for above in ["study", "measure"] {
        commands.extend(commands_of(&[above]).into_iter().map(|name| vec![above.into(), name]));
    }
    assert!(commands.len() > 20);
    for command in commands {
        let name = command.join(" ");
        if ["study", "measure"].contains(&name.as_str())
            || command.iter().any(|word| READ_NOTHING.contains(&word.as_str()))
        {
            continue;
        }
        let words: Vec<&str> = command.iter().map(String::as_str).collect();
        let cases = || CASES.iter().filter(|case| case.words.starts_with(&format!("{name} ")));
        assert!(cases().next().is_some(), "no case for `{name}`");
        for line in help(&words).lines().map(str::trim).filter(|line| line.starts_with("--")) {
            let Some((option, value)) = line.split_once(" <") else { continue };
            let value = value.split('>').next().unwrap();
            let a_file = ["FILE", "DIR", "MISSION", ".toml", ".json", ".fits"].iter().any(|word| value.contains(word));
            assert!(
                !a_file
                    || cases()
                        .any(|case| case.outputs.contains(&option) || case.words.contains(&format!("{option} @"))),
                "{name} {option} <{value}> is not in the cases"
            );
        }
    }
}
