//! `ctiplan measure`: frames of a simulator with known traps (tests/golden/measure.py) go in; what comes out gives the traps back, and
//! is the same with cosmic rays, neighbours and a sky that is not flat.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use ctiplan::image::fits::Fits;
use ctiplan::io::table::{Cell, Table};
use fitsio_pure::header::{Card, serialize_header};
use fitsio_pure::image::{ImageData, serialize_image};
use fitsio_pure::value::Value;
use ndarray::{Array2, s};
use serde_json::Value as Json;
use tempfile::TempDir;

const TRUTH: &str = "tests/measure/truth.toml";
/// The traps of the frames, and how far off a fit begins.
const TRAPS: [(&str, f64, f64); 4] = [
    ("detector.traps.fast.density_per_px", 0.8, 0.5),
    ("detector.traps.slow.density_per_px", 1.2, 1.5),
    ("detector.traps.fast.release_ms", 1.5, 1.2),
    ("detector.traps.slow.release_ms", 6.0, 8.0),
];
/// What headers of the frames do not tell.
const FLAT: &str =
    "--gain-keyword GAIN --overscan-columns 8 --overscan-rows 24 --transfers-before 300 --dose-mev-g 1e8";
const WARM: &str = "--gain-keyword GAIN --overscan-columns 8 --transfers-before 600 --dose-mev-g 1e8";
const INJECTED: &str = "--gain-keyword GAIN --overscan-columns 8 --transfers-before 300 --dose-mev-g 1e8";

fn ctiplan(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_ctiplan")).args(arguments).output().unwrap()
}

fn json(arguments: &[&str]) -> Json {
    let done = ctiplan(&[arguments, &["--json"]].concat());
    assert!(done.status.success(), "{arguments:?}: {}", String::from_utf8(done.stderr).unwrap());
    serde_json::from_slice(&done.stdout).unwrap()
}

fn golden(names: &[&str]) -> Vec<String> {
    names.iter().map(|name| format!("tests/golden/measure/{name}.fits")).collect()
}

fn flats(dirty: &str) -> Vec<String> {
    golden(&[300, 3000, 30000].map(|level| format!("flat-{level}{dirty}")).each_ref().map(String::as_str))
}

fn warm(dirty: &str) -> Vec<String> {
    golden(&[1, 2, 3].map(|number| format!("warm{dirty}-{number}")).each_ref().map(String::as_str))
}

/// A folder, and a table in it.
struct Measured {
    folder: TempDir,
    said: Json,
}

impl Measured {
    fn path(&self) -> PathBuf {
        self.folder.path().join("out.ecsv")
    }

    fn first_pixel(&self) -> PathBuf {
        self.folder.path().join("first.ecsv")
    }
}

/// Measures frames into `out.ecsv`, and `first.ecsv` where options end with --first-pixel.
fn measure(kind: &str, frames: &[String], options: &str) -> Measured {
    let folder = tempfile::tempdir().unwrap();
    let (out, first) = (folder.path().join("out.ecsv"), folder.path().join("first.ecsv"));
    let mut arguments = vec!["measure", kind];
    arguments.extend(frames.iter().map(String::as_str));
    arguments.push(out.to_str().unwrap());
    arguments.extend(options.split_whitespace());
    if options.ends_with("--first-pixel") {
        arguments.push(first.to_str().unwrap());
    }
    let said = json(&arguments);
    Measured { folder, said }
}

/// What is said when frames are refused, and that nothing is written.
fn refused(kind: &str, frames: &[String], options: &str) -> String {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out.ecsv");
    let mut arguments = vec!["measure", kind];
    arguments.extend(frames.iter().map(String::as_str));
    arguments.push(out.to_str().unwrap());
    arguments.extend(options.split_whitespace());
    let done = ctiplan(&arguments);
    assert_eq!(done.status.code(), Some(2), "{arguments:?}");
    assert!(done.stdout.is_empty());
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0, "something was written");
    String::from_utf8(done.stderr).unwrap()
}

/// Chi2 and rows of tables against the true traps.
fn against_truth(tables: &[&Path]) -> (f64, f64) {
    let mut arguments = vec!["validate", TRUTH];
    arguments.extend(tables.iter().map(|path| path.to_str().unwrap()));
    let said = json(&arguments);
    (said["chi2"].as_f64().unwrap(), said["n"].as_f64().unwrap())
}

/// Chi2 is that of noise to 3.5 standard deviations; errors half as large or twice as large would not be.
fn is_noise((chi2, rows): (f64, f64)) {
    let within = |chi2: f64| (chi2 - rows).abs() < 3.5 * (2.0 * rows).sqrt();
    assert!(within(chi2), "chi2 {chi2} of {rows} rows");
    assert!(!within(4.0 * chi2) && !within(chi2 / 4.0), "{rows} rows tell nothing of errors");
}

/// A fit from other values gives the traps back within its errors, which are below these fractions; there may be fewer of them than
/// keys: the rest keep their true values.
fn gives_traps_back(tables: &[&Path], errors: &[f64]) {
    let mut arguments: Vec<String> = vec!["fit".into(), TRUTH.into()];
    arguments.extend(tables.iter().map(|path| path.to_str().unwrap().to_string()));
    for (key, _, start) in &TRAPS[..errors.len()] {
        arguments.extend(["--set".into(), format!("{key}={start}"), "--free".into(), key.to_string()]);
    }
    let fit = json(&arguments.iter().map(String::as_str).collect::<Vec<_>>());
    for ((key, truth, _), error) in TRAPS.into_iter().zip(errors) {
        let found = fit["parameters"].as_array().unwrap().iter().find(|one| one["key"] == key).unwrap();
        let (value, sigma) = (found["value"].as_f64().unwrap(), found["sigma"].as_f64().unwrap());
        assert!((value - truth).abs() < 3.5 * sigma, "{key}: {value} +- {sigma}, truth {truth}");
        assert!(sigma < *error * truth, "{key}: {value} +- {sigma} tells little of {truth}");
    }
}

#[test]
fn edges_of_flat_fields_give_the_traps_back() {
    let measured = measure("eper", &flats(""), &format!("{FLAT} --first-pixel"));
    let tables = [measured.path(), measured.first_pixel()];
    let tables = tables.each_ref().map(PathBuf::as_path);
    is_noise(against_truth(&tables[..1]));
    gives_traps_back(&tables, &[0.1, 0.1, 0.1, 0.1]);
}

#[test]
fn the_cti_of_edges_gives_the_traps_back() {
    let folder = tempfile::tempdir().unwrap();
    let [by_range, by_pixel] = ["ranges.ecsv", "pixels.ecsv"].map(|name| folder.path().join(name));
    let cti = |path: &Path, more: &str| measure("eper", &flats(""), &format!("{FLAT} --cti {} {more}", path.display()));
    let pixels: Vec<String> = (1..=24).map(|pixel| pixel.to_string()).collect();
    cti(&by_pixel, &format!("--cti-px {}", pixels.join(",")));
    is_noise(against_truth(&[&by_pixel]));
    let edges = cti(&by_range, "--first-pixel");
    let table = Table::read(&by_range).unwrap();
    let last = |row: usize| table.column("last_px").unwrap().cells[row].number().unwrap();
    assert_eq!((0..5).map(last).collect::<Vec<_>>(), [1.0, 3.0, 7.0, 15.0, 24.0]);
    assert_eq!(edges.said["tables"][2]["observable"], "cti");
    let (chi2, rows) = against_truth(&[&by_range]);
    assert!(rows == 15.0 && (chi2 - rows).abs() < 3.5 * (2.0 * rows).sqrt(), "chi2 {chi2} of {rows} rows");
    gives_traps_back(&[&by_range, &edges.first_pixel()], &[0.15, 0.12, 0.15, 0.12]);
    // A range is the sum of its pixels.
    let (ranges, pixels) = (values(&by_range), values(&by_pixel));
    let sum: f64 = pixels[3..7].iter().map(|(value, _)| value).sum();
    assert!((ranges[2].0 / sum - 1.0).abs() < 1e-9, "{} {sum}", ranges[2].0);
}

/// An error of the bias moves all values of an exposure by the errors that they have in common.
#[test]
fn the_error_of_the_bias_is_common_to_the_rows_of_an_exposure() {
    let folder = tempfile::tempdir().unwrap();
    let cti = folder.path().join("cti.ecsv");
    let options = format!("{FLAT} --cti {}", cti.display());
    let frame = flats("")[..1].to_vec();
    let known = measure("eper", &frame, &options);
    let column = |path: &Path, name: &str| -> Vec<f64> {
        let table = Table::read(path).unwrap();
        table.column(name).unwrap().cells.iter().map(|cell| cell.number().unwrap()).collect()
    };
    let of = |path: &Path| ["value", "sigma_common", "common_group"].map(|name| column(path, name));
    let tables = [of(&known.path()), of(&cti)];
    let exposure = &known.said["exposures"][0];
    let [bias_dn, sigma_dn] = ["bias_dn", "bias_sigma_dn"].map(|name| exposure[name].as_f64().unwrap());
    let moved = measure("eper", &frame, &format!("{options} --overwrite --bias-dn {}", bias_dn + sigma_dn));
    for ([values, common, groups], path) in tables.iter().zip([&moved.path(), &cti]) {
        assert!(groups.iter().all(|group| *group == 1.0));
        for ((before, after), common) in values.iter().zip(column(path, "value")).zip(common) {
            // To first order: the level that divides the CTI of this flat moves by 5e-4 of itself.
            assert!(((before - after) / common - 1.0).abs() < 1e-3, "{before}, {after}, {common}");
        }
        // A bias that is given has no error.
        assert!(Table::read(path).unwrap().column("sigma_common").is_none());
    }
}

#[test]
fn cosmic_rays_and_bad_columns_do_not_change_edges() {
    let measured = measure("eper", &flats("-dirty"), &format!("{FLAT} --first-pixel"));
    assert!(measured.said["counts"]["columns_rejected"].as_u64() >= Some(9), "two hot columns and a dead one in each");
    is_noise(against_truth(&[&measured.path()]));
    gives_traps_back(&[&measured.path(), &measured.first_pixel()], &[0.15, 0.15, 0.15, 0.15]);
}

#[test]
fn trails_of_warm_pixels_give_the_traps_back() {
    let measured = measure("trails", &warm(""), WARM);
    is_noise(against_truth(&[&measured.path()]));
    gives_traps_back(&[&measured.path()], &[0.15, 0.1, 0.1, 0.12]);
}

#[test]
fn trails_of_packets_that_are_known_as_read_give_the_traps_back() {
    let measured = measure("trails", &warm(""), &format!("{WARM} --signal-as-read"));
    let table = Table::read(measured.path()).unwrap();
    assert!(table.column("signal_e").is_none() && table.column("signal_read_e").is_some());
    is_noise(against_truth(&[&measured.path()]));
    gives_traps_back(&[&measured.path()], &[0.15, 0.1, 0.1, 0.12]);
}

#[test]
fn neighbours_cosmic_rays_halos_and_sky_do_not_change_trails() {
    // Few warm pixels are alone among so many faint ones: bins are larger, and release times are taken as known.
    let measured = measure("trails", &warm("-dirty"), &format!("{WARM} --transfer-bins 1 --bins-per-decade 5"));
    assert!(measured.said["counts"]["candidates_not_repeated"].as_u64() > Some(30), "cosmic rays");
    is_noise(against_truth(&[&measured.path()]));
    gives_traps_back(&[&measured.path()], &[0.1, 0.1]);
}

#[test]
fn blocks_of_injected_charge_give_the_traps_back() {
    let measured = measure("injection", &golden(&["injection"]), &format!("{INJECTED} --first-pixel"));
    assert_eq!(measured.said["counts"]["blocks"], 5);
    is_noise(against_truth(&[&measured.path()]));
    gives_traps_back(&[&measured.path(), &measured.first_pixel()], &[0.25, 0.2, 0.2, 0.25]);
    let told = measure(
        "injection",
        &golden(&["injection"]),
        &format!("{INJECTED} --first-row 10 --block-px 5 --period-px 40"),
    );
    assert_eq!(values(&told.path()), values(&measured.path()));
    // The last row of the block ahead is 36 rows ahead of the first one of a block; nothing is ahead of the first block.
    let table = Table::read(measured.path()).unwrap();
    let of = |name: &str, row: usize| table.column(name).unwrap().cells[row].number().unwrap();
    for row in 0..table.rows() {
        let ahead_e = of("preceding_e", row);
        match of("block", row) {
            1.0 => assert_eq!(ahead_e, 0.0),
            _ => assert!((ahead_e / of("signal_e", row) - 1.0).abs() < 0.1 && of("preceding_px", row) == 36.0),
        }
    }
}

#[test]
fn dipoles_of_trap_pumping_give_the_release_time_back() {
    let frames: Vec<String> = (1..=10).flat_map(|number| golden(&[&format!("pumped-{number}")])).collect();
    let options = "--gain-keyword GAIN --overscan-columns 8 --dose-mev-g 1e8 --species fast --phase-time-keyword PHASE";
    let measured = measure("dipoles", &frames, &format!("{options} --cycles 2000"));
    // Hot pixels and cosmic rays are none; traps that share a pixel with them may be missed.
    let dipoles = measured.said["counts"]["dipoles"].as_u64().unwrap();
    assert!((37..=40).contains(&dipoles), "{dipoles} of 40 traps");
    is_noise(against_truth(&[&measured.path()]));
    let table = measured.path();
    let [key, free] = ["detector.traps.fast.release_ms=3", "detector.traps.fast.release_ms"];
    let fit = json(&["fit", TRUTH, table.to_str().unwrap(), "--only", "--set", key, "--free", free]);
    let release = &fit["parameters"][0];
    let (value, sigma) = (release["value"].as_f64().unwrap(), release["sigma"].as_f64().unwrap());
    assert!((value - 1.5).abs() < 3.5 * sigma && sigma < 0.05, "{value} +- {sigma} ms");
    let message = refused("dipoles", &frames, options);
    assert!(message.contains("give --cycles, or --cycles-keyword"), "{message}");
}

/// Values and errors of a table.
fn values(path: &Path) -> Vec<(f64, f64)> {
    let table = Table::read(path).unwrap();
    let of =
        |name: &str| table.column(name).unwrap().cells.iter().map(|cell| cell.number().unwrap()).collect::<Vec<_>>();
    of("value").into_iter().zip(of("sigma")).collect()
}

/// A frame of the golden ones, in DN.
fn frame(name: &str) -> Array2<f64> {
    Fits::open(Path::new(&golden(&[name])[0])).unwrap().pixels(0).unwrap().physical()
}

fn write(path: &Path, frame: &Array2<f64>, cards: &[(&str, Value)]) {
    let number = |value: i64| Value::Integer(value);
    let mut all = vec![
        ("SIMPLE", Value::Logical(true)),
        ("BITPIX", number(-64)),
        ("NAXIS", number(2)),
        ("NAXIS1", number(frame.ncols() as i64)),
        ("NAXIS2", number(frame.nrows() as i64)),
    ];
    all.extend(cards.iter().cloned());
    let cards: Vec<Card> = all.into_iter().map(|(keyword, value)| Card::new(keyword, value).unwrap()).collect();
    let mut bytes = serialize_header(&cards).unwrap();
    bytes.extend(serialize_image(&ImageData::F64(frame.iter().copied().collect())));
    fs::write(path, bytes).unwrap();
}

fn adu() -> [(&'static str, Value); 2] {
    [("BUNIT", Value::String("ADU".into())), ("GAIN", Value::Float(1.5))]
}

#[test]
fn frames_that_are_read_elsewhere_are_turned() {
    let folder = tempfile::tempdir().unwrap();
    let turned = folder.path().join("turned.fits");
    let plain = folder.path().join("plain.fits");
    let flat = frame("flat-3000");
    write(&plain, &flat, &adu());
    write(&turned, &flat.slice(s![..;-1, ..;-1]).to_owned(), &adu());
    let path = |path: &Path| vec![path.to_str().unwrap().to_string()];
    let upright = measure("eper", &path(&plain), FLAT);
    let upside_down = measure("eper", &path(&turned), &format!("{FLAT} --corner upper-right"));
    assert_eq!(values(&upright.path()), values(&upside_down.path()));
    // Two halves, each read to its own side.
    let halves = folder.path().join("halves.fits");
    let both = ndarray::concatenate![ndarray::Axis(1), flat, flat.slice(s![.., ..;-1])];
    write(&halves, &both, &adu());
    let both = measure("eper", &path(&halves), &format!("{FLAT} --split columns"));
    assert_eq!(values(&both.path()), [values(&upright.path()), values(&upright.path())].concat());
}

#[test]
fn each_amplifier_of_a_table_has_its_own_corner_overscan_gain_and_bias() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let flat = frame("flat-3000");
    let (rows, columns) = flat.dim();
    // The right half is mirrored, and has another gain and bias; the other frame is read at its top.
    let half = (&flat - 1000.0) * (1.5 / 2.0) + 300.0;
    let both = ndarray::concatenate![ndarray::Axis(1), flat, half.slice(s![.., ..;-1])];
    let upper = flat.slice(s![..;-1, ..]).to_owned();
    crate::amplifiers::file(&at("flat.fits"), &[], &[("ONE", 1, both, vec![]), ("TWO", 1, upper, vec![])]);
    let section = |first: usize| format!("\"[{}:{},1:{rows}]\"", first + 1, first + columns);
    let table = format!(
        "hdu,amplifier,corner,section,overscan_columns,overscan_rows,transfers_before,gain_e_per_dn,bias_dn\n\
         TWO,C,upper-left,,8,24,300,1.5,\nONE,A,lower-left,{},8,24,300,1.5,\nONE,B,lower-right,{},8,24,300,2,300\n",
        section(0),
        section(columns)
    );
    fs::write(at("table.csv"), table).unwrap();
    let files = vec![at("flat.fits").to_str().unwrap().to_string()];
    let told = format!("--dose-mev-g 1e8 --amplifiers {}", at("table.csv").display());
    let measured = measure("eper", &files, &told);
    let alone = values(&measure("eper", &golden(&["flat-3000"]), FLAT).path());
    let found = values(&measured.path());
    assert_eq!(found.len(), 3 * alone.len());
    let table = Table::read(measured.path()).unwrap();
    let cells = |name: &str| -> Vec<f64> {
        table.column(name).unwrap().cells.iter().map(|cell| cell.number().unwrap()).collect()
    };
    let n = alone.len();
    let (hdu, amplifier) = (cells("hdu"), cells("amplifier"));
    assert_eq!([0, n, 2 * n].map(|row| (hdu[row], amplifier[row])), [(1.0, 2.0), (1.0, 3.0), (2.0, 1.0)]);
    assert_eq!(measured.said["exposures"][1]["amplifier_name"], "B");
    for (place, (value, sigma)) in found.iter().enumerate() {
        let (expected, error) = alone[place % n];
        // The bias of B is given, and those of the others are measured: its error is that of 4 e- in some thousand pixels.
        assert!((value - expected).abs() < 0.5 && (sigma - error).abs() < 0.1, "{place}: {value} {expected}");
    }
    // Trails of amplifiers are apart.
    let flat = frame("warm-1");
    let shape = flat.dim();
    let warm: Vec<String> = (1..=3)
        .map(|number| {
            let flat = frame(&format!("warm-{number}"));
            let path = at(&format!("warm-{number}.fits"));
            let both = ndarray::concatenate![ndarray::Axis(1), flat, flat.slice(s![.., ..;-1])];
            crate::amplifiers::file(&path, &[], &[("SCI", 1, both, vec![])]);
            path.to_str().unwrap().to_string()
        })
        .collect();
    let half = |first: usize| format!("\"[{}:{},1:{}]\"", first + 1, first + shape.1, shape.0);
    let row = |name: &str, corner: &str, first: usize| format!("SCI,{name},{corner},{},8,600,1.5\n", half(first));
    let table = [
        "hdu,amplifier,corner,section,overscan_columns,transfers_before,gain_e_per_dn\n".to_string(),
        row("left", "lower-left", 0),
        row("right", "lower-right", shape.1),
    ];
    fs::write(at("table.csv"), table.concat()).unwrap();
    let trails = values(&measure("trails", &warm, &told).path());
    let of_one = values(&measure("trails", &golden(&["warm-1", "warm-2", "warm-3"]), WARM).path());
    assert_eq!(trails, [of_one.clone(), of_one].concat());
    let refused = refused("trails", &warm, &format!("{told} --corner lower-left"));
    assert!(refused.contains("cannot be used with"), "{refused}");
}

#[test]
fn a_constant_added_to_a_frame_changes_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let higher = folder.path().join("higher.fits");
    let flat = frame("flat-3000");
    write(&higher, &(&flat + 512.0), &adu());
    let higher = vec![higher.to_str().unwrap().to_string()];
    let of = |options: &str| values(&measure("eper", &higher, options).path());
    let plain = values(&measure("eper", &golden(&["flat-3000"]), FLAT).path());
    let near = |a: &[(f64, f64)], b: &[(f64, f64)], e: f64| a.iter().zip(b).all(|(a, b)| (a.0 - b.0).abs() < e);
    assert!(near(&of(FLAT), &plain, 1e-9));
    // Any bias will do, within its error: 0.1 DN are 0.15 e-.
    assert!(near(&of(&format!("{FLAT} --bias-dn 1512")), &plain, 0.3));
    let rows = of(&format!("{FLAT} --bias-from rows"));
    assert_eq!(rows.len(), 12, "the last half of the overscan rows tells the bias");
    assert!(near(&rows, &plain, 1.0));
}

#[test]
fn headers_tell_dates_temperatures_and_doses() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("flat.fits");
    let mut cards = adu().to_vec();
    cards.extend([("MJD-OBS", Value::Float(60310.25)), ("DOSE", Value::Float(2e8)), ("CCDTEMP", Value::Float(151.5))]);
    write(&path, &frame("flat-3000"), &cards);
    let flat = FLAT.replace("--dose-mev-g 1e8", "");
    let files = vec![path.to_str().unwrap().to_string()];
    let cell = |options: &str, column: &str| {
        let measured = measure("eper", &files, &format!("{flat} {options}"));
        let table = Table::read(measured.path()).unwrap();
        table.column(column).map(|column| column.cells[0].clone())
    };
    assert_eq!(cell("", "date"), Some(Cell::Text("2024-01-01T06:00:00".into())));
    assert_eq!(cell("--date 2025-06-01", "date"), Some(Cell::Text("2025-06-01".into())));
    assert_eq!(cell("--at 3.5", "t_yr"), Some(Cell::Number(3.5)));
    assert_eq!(cell("--dose-keyword DOSE", "dose_mev_g"), Some(Cell::Number(2e8)));
    assert_eq!(cell("--dose-keyword DOSE", "date"), None, "a dose stands in place of a date");
    assert_eq!(cell("--temperature-keyword ccdtemp", "temperature_k"), Some(Cell::Number(151.5)));
    assert_eq!(cell("--line-time-ms 2", "line_time_ms"), Some(Cell::Number(2.0)));
    // Older headers have the time of day apart.
    let mut apart = adu().to_vec();
    let text = |text: &str| Value::String(text.into());
    apart.extend([("DATE-OBS", text("2024-01-01")), ("TIME-OBS", text("06:00:00"))]);
    write(&path, &frame("flat-3000"), &apart);
    assert_eq!(cell("", "date"), Some(Cell::Text("2024-01-01T06:00:00".into())));
    write(&path, &frame("flat-3000"), &cards);
    // A date is what validate wants.
    let measured = measure("eper", &files, &flat);
    against_truth(&[&measured.path()]);
}

#[test]
fn every_number_can_be_found_again() {
    let measured = measure("eper", &flats("-dirty"), FLAT);
    let table = Table::read(measured.path()).unwrap();
    let Some(Cell::Other(exposures)) = table.meta("exposures") else { panic!("no exposures") };
    assert_eq!(exposures, &measured.said["exposures"]);
    let first = &exposures[0];
    assert_eq!(first["file"], "tests/golden/measure/flat-300-dirty.fits");
    assert_eq!(first["bias_from"], "last half of the overscan columns");
    assert_eq!(first["gain_e_per_dn"], 1.5);
    // Read noise of 4 e-, told from 4 columns of 224 rows, to 4 standard deviations.
    let noise_e = first["read_noise_e"].as_f64().unwrap();
    assert!((noise_e - 4.0).abs() < 4.0 * 4.0 / (2.0 * 896.0_f64).sqrt(), "{noise_e}");
    let pixels: i64 = table.column("pixels_used").unwrap().cells.iter().map(|cell| cell.number().unwrap() as i64).sum();
    assert_eq!(measured.said["counts"]["pixels_used"].as_i64(), Some(pixels));
    let Some(Cell::Other(counts)) = table.meta("counts") else { panic!("no counts") };
    assert_eq!(counts, &measured.said["counts"]);
}

#[test]
fn what_is_missing_is_said_with_what_to_give() {
    let flat = golden(&["flat-3000"]);
    let without = |option: &str, value: &str| FLAT.replace(&format!("{option} {value}"), "");
    for (kind, options, said) in [
        ("eper", without("--gain-keyword", "GAIN"), "--gain-e-per-dn"),
        ("eper", without("--overscan-rows", "24"), "give their number with --overscan-rows"),
        ("eper", format!("{FLAT} --trail-px 13 --bias-from rows"), "give a smaller --trail-px"),
        ("eper", format!("{FLAT} --bias-from prescan"), "give --bias-dn"),
        ("eper", format!("{FLAT} --corner upper-left"), "this is not an edge\n  help: check --corner"),
        ("eper", format!("{FLAT} --level-rows 201"), "give a smaller --level-rows"),
        (
            "eper",
            FLAT.replace("--overscan-rows 24", "--overscan-rows 12 --level-rows 10"),
            "the flat field ends before them\n  help: check --corner, --overscan-rows",
        ),
        ("eper", format!("{FLAT} --dq-bad 4"), "the file has no data quality for it"),
        (
            "eper",
            format!("{FLAT} --cti cti.ecsv --cti-px 20-25"),
            "pixels 20 to 25; 24 rows behind the edge are measured",
        ),
        ("eper", format!("{FLAT} --cti cti.ecsv --cti-px 0-2"), "pixels behind the edge are needed, from 1"),
        ("trails", "--gain-keyword GAIN --dose-mev-g 1".into(), "give --bias-dn (0 if it is subtracted)"),
        ("trails", WARM.to_string(), "no trails can be measured"),
        (
            "injection",
            format!("{INJECTED} --overscan-rows 24 --first-row 9 --block-px 9 --period-px 20 --trail-px 10"),
            "9 of them free",
        ),
        ("injection", format!("{INJECTED} --overscan-rows 24"), "there are no blocks of bright rows"),
        ("injection", format!("{INJECTED} --first-row 1 --block-px 9 --period-px 9"), "leave none between them"),
    ] {
        let message = refused(kind, &flat, &options);
        assert!(message.contains(said) && message.matches("error: ").count() == 1, "{kind} {options}: {message}");
    }
    let twice = refused("trails", &[&warm("")[..1], &warm("")[..1]].concat(), WARM);
    assert!(twice.contains("it holds the same charges as") && twice.contains("give each exposure once"), "{twice}");
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("undated.fits");
    write(&path, &frame("flat-3000"), &adu());
    let message = refused("eper", &[path.to_str().unwrap().to_string()], &without("--dose-mev-g", "1e8"));
    assert!(message.contains("DATE-OBS") && message.contains("give --date"), "{message}");
}

#[test]
fn nothing_is_replaced_unasked() {
    let measured = measure("eper", &golden(&["flat-3000"]), FLAT);
    let (flat, out) = (golden(&["flat-3000"]), measured.path());
    let mut arguments = vec!["measure", "eper", &flat[0], out.to_str().unwrap()];
    arguments.extend(FLAT.split_whitespace());
    let before = fs::read(&out).unwrap();
    let again = ctiplan(&arguments);
    assert_eq!(again.status.code(), Some(2));
    assert!(String::from_utf8(again.stderr).unwrap().contains("--overwrite"));
    arguments.push("--overwrite");
    assert!(ctiplan(&arguments).status.success());
    assert_eq!(fs::read(&out).unwrap(), before, "the same frames give the same bytes");
}

#[test]
fn doubts_are_told() {
    let one = measure("trails", &warm("")[..1], WARM);
    assert!(one.said["warnings"][0].as_str().unwrap().contains("single exposure"), "{}", one.said["warnings"]);
    // Two rows behind the edge are still in its trail.
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("short.fits");
    write(&path, &frame("flat-30000").slice(s![..204, ..]).to_owned(), &adu());
    let short = FLAT.replace("--overscan-rows 24", "--overscan-rows 4 --bias-from rows");
    let short = measure("eper", &[path.to_str().unwrap().to_string()], &short);
    let said = short.said["warnings"][0].as_str().unwrap();
    assert!(said.contains("values are too small"), "{said}");
}
