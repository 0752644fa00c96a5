//! Sweeps as users meet them: killed, shared, resumed, mixed up.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use ctiplan::mission::Mission;
use ctiplan::plan::evaluate::evaluate;
use ctiplan::sweep::{Grid, Holds};
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::record::Field;
use serde_json::Value;
use tempfile::TempDir;

/// 60 points that take some ten milliseconds each, in 20 parts.
const GRID: &str = r#"
mission = "snap_l2.toml"
outputs = ["dose_mev_g", "delta_e"]
sampling = "latin-hypercube"
draws = 15
chunk_points = 3

[axes]
readout.line_time_ms = "10..40:lin:4"
detector.temperature_k = { distribution = "normal", mean = 133.0, sigma = 2.0 }
"#;

const PARTS: usize = 20;

/// A folder with a mission and a grid.
struct Place(TempDir);

impl Place {
    fn with(grid: &str) -> Place {
        let folder = TempDir::new().unwrap();
        fs::copy("missions/snap_l2.toml", folder.path().join("snap_l2.toml")).unwrap();
        fs::write(folder.path().join("grid.toml"), grid).unwrap();
        Place(folder)
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn command(&self, output: &str, more: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_ctiplan"));
        command.current_dir(self.0.path()).args(["sweep", "grid.toml", "--output", output]).args(more);
        command
    }

    fn run(&self, output: &str, more: &[&str]) -> Output {
        self.command(output, more).output().unwrap()
    }

    fn stdout(&self, output: &str, more: &[&str]) -> String {
        let run = self.run(output, more);
        let stderr = String::from_utf8(run.stderr).unwrap();
        assert!(run.status.success(), "{more:?}: {stderr}");
        assert_eq!(stderr, "", "{more:?}");
        String::from_utf8(run.stdout).unwrap()
    }

    fn json(&self, output: &str, more: &[&str]) -> Value {
        serde_json::from_str(&self.stdout(output, &[more, &["--json"]].concat())).unwrap()
    }

    fn refusal(&self, output: &str, more: &[&str]) -> String {
        let run = self.run(output, more);
        assert_eq!(run.status.code(), Some(2), "{more:?}");
        assert!(run.stdout.is_empty());
        String::from_utf8(run.stderr).unwrap()
    }

    fn read(&self, name: &str) -> Vec<u8> {
        fs::read(self.path(name)).unwrap()
    }

    fn names(&self) -> Vec<String> {
        let mut names = names(self.0.path());
        names.sort();
        names
    }
}

fn names(folder: &Path) -> Vec<String> {
    let Ok(entries) = fs::read_dir(folder) else { return Vec::new() };
    entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect()
}

fn parts(folder: &Path) -> usize {
    names(folder).iter().filter(|name| name.starts_with("part-") && name.ends_with(".csv")).count()
}

#[test]
fn a_sweep_that_is_killed_goes_on_where_it_was() {
    let place = Place::with(GRID);
    let whole = Place::with(GRID);
    whole.stdout("all.csv", &[]);
    let folder = place.path("all.csv.parts");
    let mut there = 0;
    for until in [2, 6, 11] {
        let mut child = place.command("all.csv", &[]).stdout(Stdio::null()).spawn().unwrap();
        let start = Instant::now();
        while parts(&folder) < until {
            assert!(start.elapsed() < Duration::from_secs(60), "no parts after a minute");
            sleep(Duration::from_millis(1));
        }
        // SIGKILL: nothing is tidied up.
        child.kill().unwrap();
        child.wait().unwrap();
        let now = parts(&folder);
        assert!(now >= there.max(until), "parts were lost");
        there = now;
        assert!(!place.path("all.csv").exists());
    }
    assert!(there < PARTS, "nothing was left to do: the sweep is too short for this test");
    let json = place.json("all.csv", &[]);
    assert_eq!(json["found_points"], 3 * there);
    assert_eq!(json["computed_points"], 3 * (PARTS - there));
    assert_eq!(place.read("all.csv"), whole.read("all.csv"));
    // And nothing is left lying about.
    assert_eq!(place.names(), ["all.csv", "grid.toml", "snap_l2.toml"]);
    let again = place.json("all.csv", &[]);
    assert_eq!((&again["computed_points"], &again["complete"]), (&0.into(), &true.into()));
    // Nor after a kill between the result and the removal of its parts.
    fs::create_dir(&folder).unwrap();
    fs::write(folder.join("part-000000.0123456789abcdef.csv"), "").unwrap();
    place.stdout("all.csv", &[]);
    assert_eq!(place.names(), ["all.csv", "grid.toml", "snap_l2.toml"]);
}

#[cfg(unix)]
#[test]
fn an_interrupted_sweep_says_how_to_go_on() {
    let place = Place::with(GRID);
    let child = place.command("all.csv", &[]).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
    let start = Instant::now();
    while parts(&place.path("all.csv.parts")) == 0 {
        assert!(start.elapsed() < Duration::from_secs(60), "no parts after a minute");
        sleep(Duration::from_millis(1));
    }
    assert!(Command::new("kill").args(["-TERM", &child.id().to_string()]).status().unwrap().success());
    let ended = child.wait_with_output().unwrap();
    assert!(!ended.status.success());
    let said = String::from_utf8(ended.stderr).unwrap();
    assert!(said.ends_with("  ctiplan sweep grid.toml --output all.csv\n"), "{said}");
    assert!(place.json("all.csv", &[])["found_points"].as_u64().unwrap() > 0);
}

#[test]
fn shards_make_the_same_file_as_one_run_whatever_their_number_and_threads() {
    let whole = Place::with(GRID);
    whole.stdout("all.csv", &[]);
    whole.stdout("all.parquet", &[]);
    for (shards, threads) in [(1, "3"), (3, "1"), (7, "2")] {
        let place = Place::with(GRID);
        for output in ["all.csv", "all.parquet"] {
            for shard in (1..=shards).rev() {
                let shard = format!("{shard}/{shards}");
                let mut command = place.command(output, &["--shard", &shard]);
                assert!(command.env("RAYON_NUM_THREADS", threads).stdout(Stdio::null()).status().unwrap().success());
            }
            assert_eq!(place.json(output, &["--collect"])["points"], 60);
            assert_eq!(place.read(output), whole.read(output), "{output}: {shards} shards, {threads} threads");
        }
    }
}

#[test]
fn gaps_are_refused_and_named() {
    let place = Place::with(GRID);
    for shard in ["1/9", "2/9", "4/9", "5/9", "6/9"] {
        place.stdout("all.csv", &["--shard", shard]);
    }
    assert_eq!(place.stdout("all.csv", &["--missing", "9"]), "3,7-9\n");
    let refusal = place.refusal("all.csv", &["--collect"]);
    assert!(refusal.contains("24 of 60 points are missing") && refusal.contains("--missing N"), "{refusal}");
    assert!(!place.path("all.csv").exists());
    for shard in ["3/9", "7/9", "8/9", "9/9", "9/9"] {
        place.stdout("all.csv", &["--shard", shard]);
    }
    assert_eq!(place.stdout("all.csv", &["--missing", "9"]), "");
    place.stdout("all.csv", &["--collect"]);
    // What is done stays done for a task that was late.
    assert_eq!(place.json("all.csv", &["--shard", "9/9"])["computed_points"], 0);
    assert_eq!(place.names(), ["all.csv", "grid.toml", "snap_l2.toml"]);
    let refusal = place.refusal("more.csv", &["--shard", "1/21"]);
    assert!(refusal.contains("21 shards for 20 chunks") && refusal.contains("chunk_points"), "{refusal}");
}

#[test]
fn results_of_another_grid_are_refused() {
    let place = Place::with(GRID);
    place.stdout("all.csv", &["--shard", "1/2"]);
    place.stdout("done.parquet", &[]);
    place.stdout("done.csv", &[]);
    // Words that change nothing are the same sweep.
    fs::write(place.path("grid.toml"), format!("# a comment\n{GRID}")).unwrap();
    assert_eq!(place.json("all.csv", &["--shard", "1/2"])["computed_points"], 0);
    let other_grid = GRID.replace("sigma = 2.0", "sigma = 2.1");
    let mission = String::from_utf8(place.read("snap_l2.toml")).unwrap();
    let other_mission = mission.replace("background_e = 120.0", "background_e = 121.0");
    assert_ne!(mission, other_mission);
    for (grid, mission) in [(other_grid.as_str(), mission.as_str()), (GRID, other_mission.as_str())] {
        fs::write(place.path("grid.toml"), grid).unwrap();
        fs::write(place.path("snap_l2.toml"), mission).unwrap();
        for output in ["all.csv", "done.parquet", "done.csv"] {
            let before = place.names();
            let refusal = place.refusal(output, &[]);
            assert!(refusal.contains("is not the same") && refusal.contains("this is sweep"), "{refusal}");
            assert_eq!(place.names(), before);
        }
    }
    fs::write(place.path("notes.csv"), "a,b\n1,2\n").unwrap();
    assert!(place.refusal("notes.csv", &[]).contains("holds no result of a sweep"));
    assert_eq!(place.read("notes.csv"), b"a,b\n1,2\n");
}

#[test]
fn a_damaged_part_is_refused_and_named() {
    let place = Place::with(GRID);
    place.stdout("all.csv", &["--shard", "1/1"]);
    let folder = place.path("all.csv.parts");
    let name = names(&folder).into_iter().find(|name| name.starts_with("part-000004")).unwrap();
    let text = fs::read_to_string(folder.join(&name)).unwrap();
    let (kept, _) = text.trim_end().rsplit_once('\n').unwrap();
    for damaged in [kept.to_string(), text.replace("0.00", "0.x0"), String::new()] {
        fs::write(folder.join(&name), damaged).unwrap();
        let refusal = place.refusal("all.csv", &["--collect"]);
        assert!(refusal.contains(&name) && refusal.contains("delete it and run the sweep again"), "{refusal}");
        assert!(!place.path("all.csv").exists());
    }
    fs::remove_file(folder.join(&name)).unwrap();
    assert_eq!(place.json("all.csv", &[])["computed_points"], 3);
}

#[test]
fn two_processes_at_once_do_no_harm() {
    let whole = Place::with(GRID);
    whole.stdout("all.csv", &[]);
    let place = Place::with(GRID);
    let start =
        |more: &[&str]| place.command("all.csv", more).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
    // The same shard twice, as a scheduler does that has lost sight of a node.
    let twins = [start(&["--shard", "1/2"]), start(&["--shard", "1/2"])];
    for twin in twins {
        assert!(twin.wait_with_output().unwrap().status.success());
    }
    let both = [start(&[]), start(&[])].map(|child| child.wait_with_output().unwrap());
    assert!(both.iter().any(|output| output.status.success()));
    for output in both.iter().filter(|output| !output.status.success()) {
        assert!(String::from_utf8_lossy(&output.stderr).contains("another ctiplan is at work"));
    }
    assert_eq!(place.read("all.csv"), whole.read("all.csv"));
}

#[test]
fn folders_that_cannot_be_written_to_are_refused() {
    let place = Place::with(GRID);
    assert!(place.refusal("nowhere/all.csv", &[]).contains("the folder is not there"));
    assert!(place.refusal("all.txt", &[]).contains(".parquet or .csv"));
    fs::write(place.path("all.csv.parts"), "in the way").unwrap();
    assert!(place.refusal("all.csv", &[]).contains("all.csv.parts"));
}

#[test]
fn rows_are_what_evaluate_says() {
    let place = Place::with(
        r#"
        mission = ["snap_l2.toml", "two.toml"]
        outputs = ["dose_mev_g", "active_yr", "delta_e", "exceeded_yr", "exceeded_corrected_yr", "margin_delta_e",
            "margin_corrected_delta_e", "rate_at_launch_per_yr", "mean_rate_per_yr", "delta_e1", "delta_y_px", "delta_size",
            "delta_flux"]
        [axes]
        readout.transfers = [1650, 3000]
        requirement.delta_e = [1e-3, 5e-5]
        sky.background_e = [120, 200.0]
        mission.launch = ["2009-01-01", "2012-06-01"]
        "#
        .replace("\"2009-01-01\", \"2012-06-01\"", "2009-01-01, 2012-06-01")
        .as_str(),
    );
    // A mission with effects, a solar cycle, and a galaxy less.
    let mission = String::from_utf8(place.read("snap_l2.toml")).unwrap();
    let mission = mission.replace("model = \"constant\"", "model = \"solar-cycle\"");
    fs::write(place.path("two.toml"), mission + "\n[effects.annealing]\ntime_yr = 3.0\n").unwrap();
    place.stdout("all.csv", &[]);
    let mut reader = csv::Reader::from_path(place.path("all.csv")).unwrap();
    let header = reader.headers().unwrap().clone();
    let records: Vec<csv::StringRecord> = reader.records().map(Result::unwrap).collect();
    assert_eq!(records.len(), 32);
    for (index, record) in records.iter().enumerate() {
        let text = |name: &str| &record[header.iter().position(|known| known == name).unwrap()];
        assert_eq!(text("point"), index.to_string());
        let set = |key: &str, value: toml::Value| (key.to_string(), value);
        let launch: toml::Table = format!("launch = {}", text("mission.launch")).parse().unwrap();
        let mission = Mission::read(place.path(text("mission_file")))
            .unwrap()
            .with(&[
                set("readout.transfers", toml::Value::Integer(text("readout.transfers").parse().unwrap())),
                set("requirement.delta_e", toml::Value::Float(text("requirement.delta_e").parse().unwrap())),
                set("sky.background_e", toml::Value::Float(text("sky.background_e").parse().unwrap())),
                set("mission.launch", launch["launch"].clone()),
            ])
            .unwrap();
        let evaluation = evaluate(&mission).unwrap();
        let end = evaluation.years.last().unwrap();
        let near = |name: &str, expected: Option<f64>| {
            let found = text(name).parse::<f64>().ok();
            // Shapes are read out to 1e-4 of a packet instead of 1e-6: some 4e-6 of a change of shape; times follow.
            let close = match (found, expected) {
                (Some(found), Some(expected)) => (found - expected).abs() <= 5e-5 * expected.abs() + 1e-12,
                (found, expected) => found == expected,
            };
            assert!(close, "point {index}: {name} {found:?} {expected:?}");
        };
        let verdict = &evaluation.verdict;
        let judged = end.galaxies[mission.galaxies.iter().position(|g| g.name == mission.requirement.galaxy).unwrap()];
        near("dose_mev_g", Some(end.dose_mev_g));
        near("active_yr", Some(evaluation.model.history().active_years(end.t_yr)));
        near("delta_e", judged.map(|change| change.magnitude()));
        near("exceeded_yr", verdict.uncorrected.t_yr);
        near("exceeded_corrected_yr", verdict.corrected.t_yr);
        near("mean_rate_per_yr", verdict.mean_rate_per_yr);
        // Differences of numbers that are nearly equal lose digits.
        let margin = |name: &str, expected: Option<f64>| {
            assert!((text(name).parse::<f64>().unwrap() - expected.unwrap()).abs() < 5e-5 * end_magnitude(&judged));
        };
        margin("margin_delta_e", verdict.uncorrected.margin);
        margin("margin_corrected_delta_e", verdict.corrected.margin);
        let rate = text("rate_at_launch_per_yr").parse::<f64>().unwrap();
        let expected = verdict.rate_at_launch_per_yr.unwrap();
        assert!((rate - expected).abs() <= 1e-3 * expected.abs(), "point {index}: {rate} {expected}");
        for (galaxy, change) in mission.galaxies.iter().zip(&end.galaxies) {
            near(&format!("delta_e1.{}", galaxy.name), change.map(|change| change.delta_e1));
            near(&format!("delta_y_px.{}", galaxy.name), change.map(|change| change.delta_y_px));
            near(&format!("delta_size.{}", galaxy.name), change.map(|change| change.delta_size));
            near(&format!("delta_flux.{}", galaxy.name), change.map(|change| change.delta_flux));
        }
        assert_eq!(text("problem"), "");
    }
}

fn end_magnitude(change: &Option<ctiplan::physics::shape::ShapeChange>) -> f64 {
    change.unwrap().magnitude()
}

#[test]
fn parquet_holds_what_csv_holds_to_the_last_bit() {
    let grid = GRID.replace("draws = 15", "draws = 3").replace("[axes]", "[axes]\nmission.launch = { distribution = \"uniform\", from = 2009-01-01, to = 2019-12-31 }\nreadout.transfers = { distribution = \"uniform\", from = 400, to = 1650 }\ndetector.notch_e = [0.0, 2e5]");
    let place = Place::with(&grid);
    place.stdout("all.csv", &[]);
    place.stdout("all.parquet", &[]);
    let columns = Grid::read(place.path("grid.toml")).unwrap().columns();
    let mut csv = csv::Reader::from_path(place.path("all.csv")).unwrap();
    assert!(csv.headers().unwrap().iter().eq(columns.iter().map(|(name, _)| name.as_str())));
    let reader = SerializedFileReader::new(fs::File::open(place.path("all.parquet")).unwrap()).unwrap();
    let mut rows = 0;
    let mut problems = 0;
    for (row, record) in reader.get_row_iter(None).unwrap().zip(csv.records()) {
        let (row, record) = (row.unwrap(), record.unwrap());
        rows += 1;
        for (((name, field), text), (_, holds)) in row.get_column_iter().zip(&record).zip(&columns) {
            let same = match (field, holds) {
                (Field::Null, _) => text.is_empty(),
                (Field::Double(number), Holds::Numbers) => number.to_bits() == text.parse::<f64>().unwrap().to_bits(),
                (Field::Long(integer), Holds::Integers) => *integer == text.parse::<i64>().unwrap(),
                (Field::Str(word), Holds::Words) => word == text,
                (Field::Date(days), Holds::Days) => {
                    let day = chrono::NaiveDate::default() + chrono::TimeDelta::days(i64::from(*days));
                    day == text.parse::<chrono::NaiveDate>().unwrap()
                }
                _ => false,
            };
            assert!(same, "{name}: {field:?} {text}");
        }
        // A notch above the full well is wrong at that point alone, and said there.
        let problem = &record[record.len() - 1];
        problems += usize::from(problem.contains("must be below the full well"));
        assert_eq!(record[record.len() - 3].is_empty(), !problem.is_empty());
    }
    assert_eq!((rows, problems), (24, 12));
}

#[test]
fn draws_have_the_statistics_of_their_distributions() {
    let place = Place::with(
        r#"
        mission = "snap_l2.toml"
        sampling = "monte-carlo"
        draws = 4000
        seed = 11
        [axes]
        detector.temperature_k = { distribution = "normal", mean = 150.0, sigma = 3.0 }
        detector.traps.VV.density_per_px = { distribution = "log-normal", median = 0.5, sigma = 0.2 }
        sky.background_e = { distribution = "uniform", from = 50, to = 250 }
        readout.line_time_ms = { distribution = "log-uniform", from = 1.0, to = 100.0 }
        readout.transfers = { distribution = "choice", values = [100, 200, 300, 400] }
        shielding.geometry = { distribution = "choice", values = ["sphere", "slab"] }
        "#,
    );
    let grid = Grid::read(place.path("grid.toml")).unwrap();
    let points: Vec<_> = (0..grid.points()).map(|point| grid.point(point).1).collect();
    assert_eq!(points.len(), 4000);
    let statistics = |axis: usize, of: fn(f64) -> f64| {
        let values = points.iter().map(|settings| {
            let value = &settings[axis].1;
            of(value.as_float().or(value.as_integer().map(|integer| integer as f64)).unwrap())
        });
        let (sum, square) = values.fold((0.0, 0.0), |(sum, square), x| (sum + x, square + x * x));
        let mean: f64 = sum / 4000.0;
        (mean, (square / 4000.0 - mean * mean).sqrt())
    };
    // Four standard errors of the mean, and of the standard deviation (of a normal distribution, the widest of these).
    let near = |found: (f64, f64), mean: f64, sigma: f64| {
        let error = sigma / 4000_f64.sqrt();
        assert!((found.0 - mean).abs() < 4.0 * error, "{found:?} {mean} {sigma}");
        assert!((found.1 - sigma).abs() < 4.0 * error / 2_f64.sqrt(), "{found:?} {mean} {sigma}");
    };
    near(statistics(0, |x| x), 150.0, 3.0);
    near(statistics(1, f64::ln), 0.5_f64.ln(), 0.2);
    near(statistics(2, |x| x), 150.0, 200.0 / 12_f64.sqrt());
    near(statistics(3, f64::ln), 10_f64.ln(), 100_f64.ln() / 12_f64.sqrt());
    near(statistics(4, |x| x), 250.0, 12500_f64.sqrt());
    let spheres = points.iter().filter(|settings| settings[5].1.as_str() == Some("sphere")).count();
    assert!((spheres as f64 - 2000.0).abs() < 4.0 * 1000_f64.sqrt());
    // The same file, the same draws.
    let again = Grid::read(place.path("grid.toml")).unwrap();
    assert!((0..100).rev().all(|point| again.point(point).1 == points[point as usize]));
}

#[test]
fn lists_are_combined_in_full_the_last_one_fastest_and_draws_are_the_same_for_all() {
    let place = Place::with(
        r#"
        mission = "snap_l2.toml"
        sampling = "monte-carlo"
        draws = 2
        [axes]
        readout.transfers = [100, 200]
        sky.background_e = { distribution = "uniform", from = 50, to = 250 }
        readout.line_time_ms = "5..20:log:3"
        "#,
    );
    let grid = Grid::read(place.path("grid.toml")).unwrap();
    assert_eq!((grid.points(), grid.combinations()), (12, 6));
    let of = |point: u64, axis: usize| grid.point(point).1[axis].1.to_string().parse::<f64>().unwrap();
    let transfers: Vec<f64> = (0..12).map(|point| of(point, 0)).collect();
    assert_eq!(transfers, [100.0; 6].into_iter().chain([200.0; 6]).collect::<Vec<_>>());
    let times: Vec<f64> = (0..6).step_by(2).map(|point| of(point, 2)).collect();
    assert!(times[0] == 5.0 && (times[1] - 10.0).abs() < 1e-12 && (times[2] - 20.0).abs() < 1e-12);
    assert!((2..12).all(|point| of(point, 1) == of(point % 2, 1)));
    assert_ne!(of(0, 1), of(1, 1));
}

#[test]
fn a_grid_that_makes_no_sense_is_refused_with_line_key_value_and_what_to_try() {
    let with = |axes: &str| format!("mission = \"snap_l2.toml\"\n[axes]\n{axes}\n");
    let drawn =
        |axes: &str| format!("mission = \"snap_l2.toml\"\nsampling = \"monte-carlo\"\ndraws = 1000\n[axes]\n{axes}\n");
    let cases: Vec<(String, &[&str])> = vec![
        (
            with("readout.transfer = [1, 2]"),
            &["line 3: axes.readout.transfer = [1, 2]", "no key is called", "`readout.transfers`"],
        ),
        (
            with("readout.transfers = [100, 0]"),
            &["line 3: axes.readout.transfers", "is 0; allowed: whole numbers from 1"],
        ),
        (
            with("[axes.detector]\ntemperature_k = [150.0, -120.0]"),
            &["line 4: axes.detector.temperature_k", "kelvin: -120 °C is 153.15 K"],
        ),
        (with("readout.line_time_ms = \"5..x:log:3\""), &["line 3", "`x` is not a number", "5..100:log:8"]),
        (with("readout.line_time_ms = []"), &["the list is empty"]),
        (with("mission.launch = [\"2009-01-01\"]"), &["line 3", "without quotes: 2009-01-01"]),
        (with("environment.model = [\"constant\", \"solar-cycles\"]"), &["did you mean \"solar-cycle\"?"]),
        (with("detector.traps.Cii.release_ms = [1.0, 2.0]"), &["no trap species \"Cii\"", "did you mean \"Ci\"?"]),
        (with("effects.annealing.time_yr = [1.0, 2.0]"), &["has no [effects.annealing]", "add [effects.annealing]"]),
        (with("\"readout.transfers\" = [1]\nreadout.transfers = [2]"), &["line 4", "duplicate key"]),
        (
            with("sky.background_e = { distribution = \"uniform\", from = 1, to = 2 }"),
            &["`sampling` is missing", "sky.background_e"],
        ),
        (drawn("sky.background_e = [1, 2]"), &["line 2: sampling = \"monte-carlo\"", "no distribution to draw from"]),
        (
            drawn("sky.background_e = { distribution = \"unifrom\", from = 1, to = 2 }"),
            &["line 5", "did you mean \"uniform\"?"],
        ),
        (
            drawn("sky.background_e = { distribution = \"uniform\", form = 1, to = 2 }"),
            &["has no `form`", "did you mean `from`?"],
        ),
        (drawn("sky.background_e = { distribution = \"uniform\", from = 1 }"), &["`to` is missing"]),
        (
            drawn("sky.background_e = { distribution = \"uniform\", from = 3, to = 2 }"),
            &["from (3) must be below to (2)"],
        ),
        (
            drawn("sky.background_e = { distribution = \"log-uniform\", from = 0, to = 2 }"),
            &["above 0, for its logarithm"],
        ),
        (
            drawn("sky.background_e = { distribution = \"normal\", mean = 120, sigma = 0 }"),
            &["sigma is 0; allowed: above 0"],
        ),
        (
            drawn("sky.background_e = { distribution = \"normal\", mean = 120, sigma = nan }"),
            &["sigma must be a number"],
        ),
        (drawn("sky.background_e = { mean = 120, sigma = 1 }"), &["`distribution` is missing", "\"log-normal\""]),
        (
            drawn("environment.confidence = { distribution = \"normal\", mean = 0.95, sigma = 0.1 }"),
            &["line 5", "in draw", "allowed: 0.01 to 0.9999", "min and max"],
        ),
        (
            drawn("shielding.geometry = { distribution = \"uniform\", from = 1, to = 2 }"),
            &["is not a number", "choice"],
        ),
        (
            drawn("mission.launch = { distribution = \"normal\", mean = 1, sigma = 2 }"),
            &["days have no normal distribution"],
        ),
        (
            drawn("sky.background_e = { distribution = \"normal\", mean = 1, sigma = 2, min = 90 }"),
            &["less than 1e-6 of the distribution"],
        ),
        ("mission = \"snap_l2.toml\"\n".into(), &["nothing that varies", "add [axes]"]),
        (
            "mission = \"snap.toml\"\n".into(),
            &["line 1: mission = \"snap.toml\"", "there is no file", "relative to the grid file"],
        ),
        ("mision = \"snap_l2.toml\"\n".into(), &["line 1: mision", "did you mean `mission`?"]),
        (
            "mission = \"snap_l2.toml\"\n[readout]\ntransfers = [1, 2]\n".into(),
            &["line 2: [readout]", "[axes.readout]"],
        ),
        ("[axes]\nreadout.transfers = [1, 2]\n".into(), &["`mission` is missing"]),
        (
            "mission = \"snap_l2.toml\"\noutputs = [\"delta_e\", \"dose\"]\n[axes]\nreadout.transfers = [1]".into(),
            &["line 2", "no output is called \"dose\"", "dose_mev_g"],
        ),
        (
            "mission = \"snap_l2.toml\"\ndraws = 7\n[axes]\nreadout.transfers = [1]".into(),
            &["line 2: draws = 7", "no distribution"],
        ),
        (
            "mission = \"snap_l2.toml\"\nseed = -1\n[axes]\nreadout.transfers = [1]".into(),
            &["line 2: seed = -1", "whole numbers from 0"],
        ),
        ("mission = \"snap_l2.toml\"\n[axes]\nreadout.transfers = [1\n".into(), &["line ", "must be TOML"]),
    ];
    for (grid, said) in cases {
        let place = Place::with(&grid);
        let refusal = place.refusal("all.csv", &[]);
        assert!(refusal.starts_with("error: cannot use grid `grid.toml`"), "{refusal}");
        for said in said {
            assert!(refusal.contains(said), "{said:?} is not in\n{refusal}");
        }
        assert_eq!(place.names(), ["grid.toml", "snap_l2.toml"]);
    }
}

#[test]
fn reports_fit_80_columns_and_scripts_name_absolute_paths() {
    let place = Place::with(GRID);
    for more in [&["--shard", "1/4"][..], &[], &["--collect"]] {
        for line in place.stdout("all.csv", more).lines() {
            assert!(line.chars().count() <= 80, "{line}");
        }
    }
    let script = place.stdout("new.parquet", &["--slurm", "4"]);
    let result = place.path("new.parquet");
    assert!(script.contains(&format!("--output {} --shard \"$SLURM_ARRAY_TASK_ID/4\"", result.display())), "{script}");
    assert!(script.contains("#SBATCH --array=1-4\n") && !result.exists());
}
