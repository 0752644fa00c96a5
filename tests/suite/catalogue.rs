//! `ctiplan catalogue`: a galaxy is changed as `evaluate` has it, whatever stands beside it, and interpolation is as accurate as it
//! says.

use std::fs;
use std::process::Command;

use ctiplan::io::table::Table;
use ctiplan::mission::Mission;
use ctiplan::model::Model;
use ctiplan::model::shear::SurveyGalaxy;
use ctiplan::physics::shape::ShapeChange;
use ctiplan::plan::catalogue::{Catalogue, Settings};
use rayon::ThreadPoolBuilder;
use tempfile::TempDir;

/// SNAP with few sub-pixel positions: what is compared has the same.
fn snap() -> Mission {
    let mut mission = Mission::read("missions/snap_l2.toml").unwrap();
    mission.accuracy.subpixel_grid = 1;
    mission
}

/// Galaxies spread over a range of everything, by steps that repeat nowhere.
fn galaxies(mission: &Mission, count: usize) -> Vec<SurveyGalaxy> {
    let between =
        |index: usize, step: f64, low: f64, high: f64| low + (high - low) * (0.5 + index as f64 * step).fract();
    let galaxy = |index: usize| {
        let judged = SurveyGalaxy::of(mission, &Default::default());
        SurveyGalaxy {
            transfers: between(index, 0.618_034, 200.0, 1650.0) as u32,
            flux_e: between(index, 0.414_214, 1500_f64.ln(), 20_000_f64.ln()).exp(),
            half_light_px: between(index, 0.732_051, 1.0, 4.0),
            sersic_index: between(index, 0.236_068, 0.8, 2.5),
            ellipticity: [between(index, 0.645_751, -0.3, 0.3), between(index, 0.316_625, -0.3, 0.3)],
            ..judged
        }
    };
    (0..count).map(galaxy).collect()
}

fn changes(mission: &Mission, galaxies: &[SurveyGalaxy], emulate: Option<f64>) -> Catalogue {
    Catalogue::of(&Model::new(mission), galaxies, 5.0, Settings { emulate, seed: 1 }, &|_| ()).unwrap()
}

/// Distance of (Δe1, Δe2) over |Δe|.
fn off(found: &ShapeChange, expected: &ShapeChange) -> f64 {
    (found.delta_e1 - expected.delta_e1).hypot(found.delta_e2 - expected.delta_e2) / expected.magnitude()
}

#[test]
fn a_catalogue_of_one_galaxy_is_its_evaluation() {
    let mission = Mission::read("missions/snap_l2.toml").unwrap();
    let galaxy = SurveyGalaxy::of(&mission, &Default::default());
    let found = changes(&mission, &[galaxy], Some(1e-3));
    let model = Model::new(&mission);
    let expected = model.change(model.judged(), 5.0).unwrap().unwrap();
    let off = off(&found.changes[0].unwrap(), &expected);
    // Components of 1e-6 of the flux are left out, and the readout is ten times coarser.
    assert!(off < 1e-4, "{off:e}");
    assert_eq!((found.emulated, found.lost), (0, 0));
}

#[test]
fn a_galaxy_is_changed_alike_in_any_order_and_by_any_number_of_threads() {
    let mission = snap();
    let galaxies = galaxies(&mission, 3600);
    let in_pool = |threads: usize, galaxies: &[SurveyGalaxy]| {
        let pool = ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| changes(&mission, galaxies, Some(0.1)))
    };
    let one = in_pool(1, &galaxies);
    assert!(one.emulated > 2000, "{one:?}");
    assert_eq!(one.changes, in_pool(3, &galaxies).changes);
    let reversed: Vec<SurveyGalaxy> = galaxies.iter().rev().copied().collect();
    let mut reversed = in_pool(2, &reversed).changes;
    reversed.reverse();
    assert_eq!(one.changes, reversed);
}

#[test]
fn interpolated_galaxies_are_as_accurate_as_stated() {
    let mission = snap();
    let galaxies = galaxies(&mission, 4000);
    let catalogue = changes(&mission, &galaxies, Some(0.02));
    let class = &catalogue.classes[0];
    assert!(class.is_used && class.held_out.worst() <= 0.02, "{class:?}");
    // Others than those it was judged by.
    let interpolated = (0..galaxies.len()).filter(|row| catalogue.is_emulated[*row]);
    let some: Vec<usize> = interpolated.step_by(40).collect();
    let read: Vec<SurveyGalaxy> = some.iter().map(|row| galaxies[*row]).collect();
    let read = changes(&mission, &read, None);
    let squares = some.iter().zip(&read.changes).map(|(row, expected)| {
        let (found, expected) = (catalogue.changes[*row].unwrap(), expected.unwrap());
        (off(&found, &expected) * expected.magnitude()).powi(2)
    });
    let error = (squares.sum::<f64>() / some.len() as f64).sqrt() / read.rms_delta_e;
    // Two samples of one distribution with tails: within a factor of two.
    assert!(error < 2.0 * class.held_out.delta_e && error > 0.4 * class.held_out.delta_e, "{error:e} {class:?}");
}

#[test]
fn polynomials_that_miss_are_not_used() {
    let mission = snap();
    let galaxies = galaxies(&mission, 3200);
    let catalogue = changes(&mission, &galaxies, Some(1e-6));
    assert!(!catalogue.classes[0].is_used);
    assert_eq!(catalogue.emulated, 0);
    assert!(catalogue.changes.iter().all(Option::is_some));
}

/// Runs the program on a table; gives status, standard output and error, and the table written.
fn run(table: &str, arguments: &[&str]) -> (i32, String, String, Option<String>) {
    let folder = TempDir::new().unwrap();
    let (galaxies, out) = (folder.path().join("galaxies.csv"), folder.path().join("changed.ecsv"));
    fs::write(&galaxies, table).unwrap();
    let done = Command::new(env!("CARGO_BIN_EXE_ctiplan"))
        .args(["catalogue", "missions/snap_l2.toml"])
        .arg(&galaxies)
        .args(if arguments.contains(&"--at") { &[][..] } else { &["--at", "3.5"] })
        .args(["--overwrite", "--set", "accuracy.subpixel_grid=1", "--out"])
        .arg(&out)
        .args(arguments)
        .output()
        .unwrap();
    let text = |bytes: &[u8]| String::from_utf8(bytes.to_vec()).unwrap();
    (done.status.code().unwrap(), text(&done.stdout), text(&done.stderr), fs::read_to_string(out).ok())
}

#[test]
fn the_table_comes_back_with_the_changes() {
    let (status, text, _, table) = run("name,transfers,flux_e,e2\na,1650,1150,0\nb,800,5000,0.2\n", &[]);
    assert_eq!(status, 0);
    assert!(text.contains("2 galaxies, 0 of them"), "{text}");
    let table = table.unwrap();
    assert!(table.contains("{name: delta_y_px, unit: pix, datatype: float64"), "{table}");
    let rows: Vec<Vec<&str>> =
        table.lines().filter(|line| !line.starts_with('#')).map(|line| line.split(',').collect()).collect();
    assert_eq!(rows[0][..5], ["name", "transfers", "flux_e", "e2", "delta_e1"]);
    let number = |row: usize, name: &str| -> f64 {
        rows[row][rows[0].iter().position(|column| *column == name).unwrap()].parse().unwrap()
    };
    // Trails lengthen galaxies along y, delay them, and take flux from them; e2 of the first stays 0.
    assert!(number(1, "delta_e1") < 0.0 && number(1, "delta_y_px") > 0.0 && number(1, "delta_flux") < 0.0);
    assert_eq!(number(1, "delta_e2"), 0.0);
    assert!(number(2, "delta_e2") != 0.0);
    assert_eq!(rows[2].last(), Some(&"readout"));
}

#[test]
fn wrong_catalogues_are_refused_with_line_column_and_value() {
    let refused = |table: &str, words: &[&str]| {
        let (status, _, error, written) = run(table, &[]);
        assert_eq!((status, written), (2, None), "{error}");
        words.iter().for_each(|word| assert!(error.contains(word), "{word}: {error}"));
    };
    refused("transfers,flux_e\n100,5000\n200,-1\n", &["line 3: flux_e = -1"]);
    refused("transfers,e1,e2\n100,0.8,0.8\n", &["line 2: e2 = 0.8", "up to 0.95"]);
    refused("transfers,flux_e,computed\n100,5000,x\n", &["computed", "rename"]);
    refused("transfers,fluxe\n100,5000\n", &["did you mean `flux_e`?"]);
    let (status, _, error, _) = run("transfers\n100\n", &["--accuracy", "2"]);
    assert_eq!(status, 2);
    assert!(error.contains("1e-6 to 1"), "{error}");
}

#[test]
fn several_epochs_and_parquet_hold_the_same_numbers() {
    let folder = TempDir::new().unwrap();
    let at = |name: &str| folder.path().join(name);
    fs::write(at("galaxies.csv"), "name,transfers,flux_e,e2\na,1650,1150,0\nb,800,5000,0.2\n").unwrap();
    let run = |input: &str, epochs: &str, out: &str| {
        let done = Command::new(env!("CARGO_BIN_EXE_ctiplan"))
            .args(["catalogue", "missions/snap_l2.toml", at(input).to_str().unwrap(), "--at", epochs, "--json"])
            .args(["--set", "accuracy.subpixel_grid=1", "--out", at(out).to_str().unwrap()])
            .output()
            .unwrap();
        assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
        let said: serde_json::Value = serde_json::from_slice(&done.stdout).unwrap();
        (said, Table::read(at(out)).unwrap())
    };
    let cells = |table: &Table, name: &str| format!("{:?}", table.column(name).unwrap().cells);
    let (one, first) = run("galaxies.csv", "2", "one.ecsv");
    let (_, second) = run("galaxies.csv", "5", "two.ecsv");
    let (both, together) = run("galaxies.csv", "2,5", "both.ecsv");
    assert_eq!(one["t_yr"], 2.0);
    assert_eq!((both["epochs"][0].clone(), both["epochs"][1]["t_yr"].clone()), (one, 5.0.into()));
    assert_eq!(cells(&together, "t_yr"), "[Number(2.0), Number(2.0), Number(5.0), Number(5.0)]");
    for name in ["name", "flux_e", "delta_e1", "delta_y_px", "computed"] {
        let [first, second] = [&first, &second].map(|table| table.column(name).unwrap().cells.clone());
        assert_eq!(together.column(name).unwrap().cells, [first, second].concat(), "{name}");
    }
    // From Parquet to Parquet.
    fs::write(at("galaxies.parquet"), Table::read(at("galaxies.csv")).unwrap().to_parquet().unwrap()).unwrap();
    let (_, parquet) = run("galaxies.parquet", "2,5", "both.parquet");
    assert!(fs::read(at("both.parquet")).unwrap().starts_with(b"PAR1"));
    let names: Vec<&str> = parquet.columns.iter().map(|column| column.name.as_str()).collect();
    assert_eq!(names, together.columns.iter().map(|column| column.name.as_str()).collect::<Vec<_>>());
    names.into_iter().for_each(|name| assert_eq!(cells(&parquet, name), cells(&together, name), "{name}"));
    // Damaged files are refused, not fallen over.
    let whole = fs::read(at("galaxies.parquet")).unwrap();
    for place in (4..whole.len()).step_by(7) {
        let mut damaged = whole.clone();
        damaged[place] ^= 0x55;
        fs::write(at("damaged.parquet"), damaged).unwrap();
        let read = std::panic::catch_unwind(|| Table::read(at("damaged.parquet")).map(|table| table.rows()));
        assert!(read.is_ok(), "byte {place}");
    }
}

#[test]
fn epochs_need_a_table_without_times() {
    let (status, _, error, _) = run("t_yr,transfers\n1,100\n", &["--at", "4,5"]);
    assert_eq!(status, 2, "{error}");
    assert!(error.contains("rename it, or run one epoch"), "{error}");
}
