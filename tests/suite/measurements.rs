//! Measurement files as users' astropy, spreadsheets and hands write them (`tests/measurements/make.py`).

use std::fs;
use std::path::PathBuf;

use chrono::NaiveDateTime;
use ctiplan::analysis::measurement::DataSet;
use ctiplan::io::table::{Cell, Table};
use ctiplan::mission::Mission;
use ctiplan::physics::conditions::NAMES;
use serde_json::Value;

fn mission() -> Mission {
    Mission::read("missions/snap_l2.toml").unwrap()
}

fn files(folder: &str) -> Vec<PathBuf> {
    let mut files: Vec<PathBuf> = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.retain(|file| file.extension().is_some_and(|ending| ending == "ecsv" || ending == "csv"));
    files.sort();
    files
}

fn read(name: &str) -> DataSet {
    DataSet::read(format!("tests/measurements/{name}"), &mission()).unwrap()
}

#[test]
fn what_makes_sense_is_read() {
    let files = files("tests/measurements");
    assert!(files.len() >= 35);
    for file in files {
        let set = DataSet::read(&file, &mission()).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(set.rows.len(), set.table.rows(), "{}", file.display());
    }
}

#[test]
fn what_makes_no_sense_is_refused_with_line_and_reason() {
    let files = files("tests/measurements/broken");
    assert!(files.len() >= 50);
    for file in files {
        let error = DataSet::read(&file, &mission()).expect_err(&format!("{} was accepted", file.display()));
        let expected = fs::read_to_string(format!("{}.stderr", file.display())).unwrap();
        assert_eq!(format!("error: {error}\n"), expected, "{}", file.display());
    }
}

#[test]
fn units_of_the_header_are_converted() {
    let set = read("packets_other_units.ecsv");
    let column = |name: &str| set.table.column(name).unwrap();
    for (row, measured) in set.rows.iter().enumerate() {
        let given = |name: &str| column(name).cells[row].number().unwrap();
        assert!((measured.at.t_yr - given("t_yr") / 365.25).abs() < 1e-12);
        assert!((measured.at.line_time_ms - 1000.0 * given("line_time_ms")).abs() < 1e-9);
        assert!((measured.at.temperature_k - (given("temperature_k") + 273.15)).abs() < 1e-9);
    }
}

#[test]
fn dates_of_all_kinds_are_years_since_launch() {
    let launch = mission().mission.launch.0.and_hms_opt(0, 0, 0).unwrap();
    let dated = files("tests/measurements").into_iter().filter(|file| file.to_string_lossy().contains("_time_"));
    let mut kinds = 0;
    for file in dated {
        // What astropy itself says these times are.
        let json: Value = serde_json::from_str(&fs::read_to_string(file.with_extension("json")).unwrap()).unwrap();
        let columns = json["columns"].as_array().unwrap();
        let times = columns.iter().find(|column| column["name"] == "date").unwrap()["time"]["utc"].as_array().unwrap();
        let set = DataSet::read(&file, &mission()).unwrap();
        assert_eq!(set.rows.len(), times.len());
        for (row, time) in set.rows.iter().zip(times) {
            let time = NaiveDateTime::parse_from_str(time.as_str().unwrap(), "%Y-%m-%d %H:%M:%S%.f").unwrap();
            let t_yr = (time - launch).as_seconds_f64() / 86_400.0 / 365.25;
            // astropy's decimal years know leap seconds.
            assert!((row.at.t_yr - t_yr).abs() * 365.25 * 86_400.0 < 1.0, "{}: {} {t_yr}", file.display(), row.at.t_yr);
        }
        kinds += 1;
    }
    assert!(kinds >= 6);
    // 2009-07-02 12:00, launched on 2009-01-01.
    assert!((read("dose_time_iso.ecsv").rows[0].at.t_yr - 182.5 / 365.25).abs() < 1e-9);
}

#[test]
fn conditions_come_from_columns_from_meta_and_from_the_mission_in_this_order() {
    let text = "# observable: trail\n# t_yr: 2.0\n# transfers: 800\n# ccd: 7\n\
                signal_e,trail_px,temperature_k,chip,value,sigma\n1000,1,140,left,0.01,0.001\n1000,2,141,right,0.008,0.001\n";
    let set = DataSet::of(Table::parse("rows.csv", text).unwrap(), &mission()).unwrap();
    let at = &set.rows[1].at;
    assert_eq!((at.temperature_k, at.transfers, at.background_e, at.line_time_ms), (141.0, 800, 120.0, 25.0));
    assert_eq!(at.get("ccd"), Some(7.0));
    assert_eq!(set.rows[1].word("chip"), Some("right"));
    assert_eq!(set.varying, ["trail_px", "temperature_k", "chip"]);
    assert_eq!(set.against("chip"), [0.0, 1.0]);
}

/// All names that come of one by a slip in one letter: another letter, one missing, one too many, two swapped.
fn slips(name: &str) -> Vec<String> {
    let letters: Vec<char> = name.chars().collect();
    let join = |letters: Vec<char>| letters.into_iter().collect::<String>();
    let mut slips = Vec::new();
    for place in 0..=letters.len() {
        let (before, after) = letters.split_at(place);
        slips.push(join([before, &['x'], after].concat()));
        if let [first, rest @ ..] = after {
            slips.push(join([before, rest].concat()));
            slips.push(join([before, &['z'], rest].concat()));
            slips.push(join([before, &[first.to_ascii_uppercase()], rest].concat()));
        }
        if let [first, second, rest @ ..] = after {
            slips.push(join([before, &[*second, *first], rest].concat()));
        }
    }
    slips.retain(|slip| slip != name);
    slips
}

#[test]
fn no_column_and_no_number_of_meta_is_a_condition_with_a_slip() {
    let mission = mission();
    let read = |text: String| Table::parse("rows.csv", &text).and_then(|table| DataSet::of(table, &mission));
    let column = |name: &str| format!("# observable: dose\n{name},t_yr,value,sigma\n7,1,2e6,1e4\n8,2,4e6,1e4\n");
    let meta = |name: &str| format!("# observable: dose\n# {name}: 7\nt_yr,value,sigma\n1,2e6,1e4\n2,4e6,1e4\n");
    let slips_of = |name: &'static str| slips(name).into_iter().map(move |slip| (name, slip));
    let capitals = ["Date", "DATE"].map(|slip| ("date", slip.to_string()));
    for (name, slip) in NAMES.into_iter().chain(["galaxy"]).flat_map(slips_of).chain(capitals) {
        for text in [column(&slip), meta(&slip)] {
            let error = read(text).expect_err(&format!("{slip} was accepted")).to_string();
            assert!(error.contains(&format!("resembles `{name}`")), "{slip}: {error}");
        }
    }
    // Other names are covariates.
    for name in ["exposure_s", "ccd", "run", "rate", "humidity", "signal", "temperature_of_the_amplifier_k"] {
        for text in [column(name), meta(name)] {
            assert_eq!(read(text).unwrap().rows[0].at.get(name), Some(7.0), "{name}");
        }
    }
}

#[test]
fn what_is_written_is_what_was_read() {
    for file in files("tests/measurements") {
        let table = Table::read(&file).unwrap();
        let again = Table::parse("again", &table.to_ecsv()).unwrap();
        assert_eq!(again.columns.len(), table.columns.len(), "{}", file.display());
        for (one, other) in table.columns.iter().zip(&again.columns) {
            assert_eq!((&one.name, &one.unit), (&other.name, &other.unit), "{}", file.display());
            for (one, other) in one.cells.iter().zip(&other.cells) {
                let alike = match (one, other) {
                    (Cell::Number(one), Cell::Number(other)) => one.to_bits() == other.to_bits(),
                    // ECSV has no empty words, only missing ones.
                    (Cell::Text(one), Cell::Missing) => one.is_empty(),
                    _ => one == other,
                };
                assert!(alike, "{}: {one:?}, {other:?}", file.display());
            }
        }
    }
}

/// A trail, with more columns.
fn trail_with(columns: &str, cells: &str) -> Result<DataSet, String> {
    let text = format!("# observable: trail\n# t_yr: 3.0\ntrail_px,value,sigma,{columns}\n1,0.01,0.001,{cells}\n");
    DataSet::of(Table::parse("trail.csv", &text).unwrap(), &mission()).map_err(|error| error.to_string())
}

#[test]
fn charges_as_read_and_preceding_packets_are_conditions() {
    let set = trail_with("signal_read_e,preceding_e,preceding_px", "800,5000,30").unwrap();
    let at = &set.rows[0].at;
    assert_eq!((at.signal_e, at.signal_read_e), (None, Some(800.0)));
    assert_eq!((at.preceding_e, at.preceding_px), (Some(5000.0), Some(30)));
    assert!(at.covariates.is_empty());
    let refused = |columns: &str, cells: &str, said: &str| {
        let error = trail_with(columns, cells).expect_err(columns);
        assert!(error.contains(said), "{error}");
    };
    refused("signal_e,signal_read_e", "800,790", "both signal_e and signal_read_e");
    refused("signal_e,preceding_e", "800,790", "preceding_px");
    refused("signal_e,preceding_px", "800,7", "preceding_e");
    refused("signal_e,preceding_e,preceding_px", "800,500,1000000", "allowed: whole numbers");
    refused("signal_e,preceding_e,preceding_px", "800,500,99999", "has been read out before");
    refused("signal_read", "800", "write `signal_read_e`");
    refused("signal_e,preceding,preceding_px", "800,500,3", "write `preceding_e`");
    refused("signal_e,preceding_pix,preceding_e", "800,5,500", "write `preceding_px`");
    refused("Signal_Read_e", "800", "write `signal_read_e`");
    let circular = "# observable: packet_charge\n# t_yr: 3.0\nsignal_read_e,value,sigma\n800,790,2\n";
    let error = DataSet::of(Table::parse("packets.csv", circular).unwrap(), &mission()).unwrap_err().to_string();
    assert!(error.contains("the charge as read itself") || error.contains("is the charge as read"), "{error}");
}

#[test]
fn errors_of_conditions_are_kept_in_the_units_of_the_conditions() {
    let columns =
        "signal_e,sigma_signal_e [ke-],temperature_k [deg_C],sigma_temperature_k [deg_C],sigma_t_yr [d],sigma_trail_px";
    let set = trail_with(columns, "800,0.02,-140,1.5,36.525,").unwrap();
    assert_eq!(
        set.rows[0].condition_sigmas.iter().map(|(name, _)| *name).collect::<Vec<_>>(),
        ["t_yr", "temperature_k", "signal_e"]
    );
    for ((_, sigma), expected) in set.rows[0].condition_sigmas.iter().zip([0.1, 1.5, 20.0]) {
        assert!((sigma - expected).abs() < 1e-12, "{sigma}, {expected}");
    }
    assert!(set.rows[0].at.covariates.is_empty() && set.varying.is_empty());
    let refused = |columns: &str, cells: &str, said: &str| {
        let error = trail_with(columns, cells).expect_err(columns);
        assert!(error.contains(said), "{error}");
    };
    refused("signal_e,sigma_mjd,sigma_t_yr", "800,3,0.1", "one error of the time too many");
    refused("signal_e,sigma_signal", "800,3", "did you mean `sigma_signal_e`?");
    refused("signal_e,Sigma_Signal_e", "800,3", "did you mean `sigma_signal_e`?");
    refused("signal_e,sigma_seeing", "800,3", "is the error of no condition");
    refused("signal_e,sigma_signal_e", "800,-3", "a number from 0 on");
}

/// A time may be given in several ways, if they agree; its error in days as well.
#[test]
fn times_in_several_ways_agree_or_are_refused() {
    let read = |columns: &str, cells: &str| {
        let text = format!("# observable: dose\n{columns},value,sigma\n{cells},1e6,1e4\n");
        DataSet::of(Table::parse("dose.csv", &text).unwrap(), &mission()).map_err(|error| error.to_string())
    };
    // Launched on MJD 54832; 2012-01-01 is MJD 55927.
    let expected = (55927.0 - 54832.0) / 365.25;
    for (columns, cells) in [
        ("mjd", "55927"),
        ("mjd [d]", "55927"),
        ("jd", "2455927.5"),
        ("mjd,jd,date", "55927,2455927.5,2012-01-01"),
        ("date,mjd", ",55927"),
    ] {
        let t_yr = read(columns, cells).unwrap_or_else(|error| panic!("{columns}: {error}")).rows[0].at.t_yr;
        assert!((t_yr - expected).abs() < 1e-9, "{columns}: {t_yr}, {expected}");
    }
    for (columns, cells) in [
        ("mjd,date", "55927,2013-01-01"),
        ("mjd,jd", "55927,2456028.5"),
        ("t_yr,jd", "1.0,2455927.5"),
        ("t_yr,date", "1.0,2012-01-01"),
    ] {
        let error = read(columns, cells).expect_err(columns);
        assert!(error.contains("contradict one another"), "{error}");
    }
    for name in ["sigma_mjd", "sigma_jd", "sigma_date"] {
        let set = read(&format!("t_yr,{name}"), "1.0,36.525").unwrap();
        assert!(
            set.rows[0].condition_sigmas.iter().all(|(name, sigma)| *name == "t_yr" && (sigma - 0.1).abs() < 1e-12)
        );
        assert!(set.rows[0].condition_sigmas.len() == 1 && set.rows[0].at.covariates.is_empty());
    }
}

#[test]
fn an_error_without_a_unit_beside_a_value_in_another_one_is_refused() {
    let read = |columns: &str| {
        let text = format!("# observable: trail\n# t_yr: 3.0\n# signal_e: 800\ntrail_px,{columns}\n1,1.2,0.1\n");
        DataSet::of(Table::parse("trail.csv", &text).unwrap(), &mission()).map_err(|error| error.to_string())
    };
    let error = read("value [%],sigma").unwrap_err();
    assert!(error.contains("value is in %, and sigma has no unit"), "{error}");
    let row = &read("value [%],sigma [%]").unwrap().rows[0];
    assert!((row.value - 0.012).abs() < 1e-15 && (row.sigma - 0.001).abs() < 1e-15);
    assert!(read("value,sigma").is_ok());
}

#[test]
fn errors_in_common_are_a_part_of_the_error_and_no_condition() {
    let read = |columns: &str, cells: [&str; 2]| {
        let text = format!(
            "# observable: trail\n# t_yr: 3.0\n# signal_e: 800\ntrail_px,value,sigma,{columns}\n\
             1,0.01,0.005,{}\n2,0.01,0.005,{}\n",
            cells[0], cells[1]
        );
        DataSet::of(Table::parse("trail.csv", &text).unwrap(), &mission()).map_err(|error| error.to_string())
    };
    let set = read("sigma_common,common_group", ["0.003,first", "0.004,first"]).unwrap();
    let found: Vec<_> = set.rows.iter().map(|row| (row.common.sigma, row.common.group)).collect();
    assert_eq!(found, [(0.003, 0), (0.004, 0)]);
    assert!((set.rows[0].own_sigma() - 0.004).abs() < 1e-15 && set.rows[0].sigma == 0.005);
    assert!(set.rows[0].at.covariates.is_empty() && set.rows[0].words.is_empty() && set.varying == ["trail_px"]);
    // Without groups, of the whole file; of one row alone, its own.
    let common = |set: DataSet| [0, 1].map(|row| set.rows[row].common.sigma);
    assert_eq!(common(read("sigma_common", ["0.003", "0.002"]).unwrap()), [0.003, 0.002]);
    assert_eq!(common(read("sigma_common", ["0.003", ""]).unwrap()), [0.0, 0.0]);
    assert_eq!(common(read("sigma_common,common_group", ["0.003,1", "0.003,2"]).unwrap()), [0.0, 0.0]);
    for (columns, cells, said) in [
        ("sigma_common", ["0.003", "0.005"], "a part of sigma, which is 0.005; this is 0.005"),
        ("sigma_common", ["-0.003", "0.001"], "this is -0.003"),
        ("sigma_common", ["nan", "0.001"], "this is NaN"),
        ("common_group", ["1", "2"], "no column `sigma_common`"),
        ("sigma_common,common_group", ["0.003,1", "0.003,"], "no `common_group` says with which"),
        ("sigma_common,common_grup", ["0.003,1", "0.003,2"], "write `common_group`"),
        ("sigma_comon", ["0.003", "0.001"], "did you mean `sigma_common`?"),
    ] {
        let error = read(columns, cells).expect_err(columns);
        assert!(error.contains(said), "{error}");
    }
    let text =
        "# observable: trail\n# t_yr: 3.0\n# signal_e: 800\ntrail_px,value [%],sigma [%],sigma_common\n1,1,0.5,0.3\n";
    let error = DataSet::of(Table::parse("trail.csv", text).unwrap(), &mission()).unwrap_err().to_string();
    assert!(error.contains("sigma_common has no unit"), "{error}");
}

/// What stands nowhere is the mission's: shapes are those of the galaxy that is judged.
#[test]
fn shapes_of_no_galaxy_in_particular_are_those_of_the_judged_one() {
    let text = "# observable: delta_e1\nt_yr,value,sigma\n1.0,-3e-4,1e-5\n";
    let set = DataSet::of(Table::parse("shapes.csv", text).unwrap(), &mission()).unwrap();
    let judged = mission().galaxies.iter().position(|galaxy| galaxy.name == mission().requirement.galaxy);
    assert_eq!(set.rows[0].galaxy, judged);
}

/// σ² = σ_row² + floor² + (share value)², the floor of the file as a number of `meta` or a column of any unit.
#[test]
fn floors_enlarge_errors_in_squares() {
    let read = |meta: &str, columns: &str, cells: &str, mission: &Mission| {
        let text = format!(
            "# observable: trail\n# t_yr: 3.0\n# signal_e: 800\n{meta}trail_px,value,sigma{columns}\n\
             1,0.01,0.001{cells}\n2,-0.02,0.001{cells}\n"
        );
        DataSet::of(Table::parse("trail.csv", &text).unwrap(), mission)
    };
    let share = mission().with(&[("fit.floor".into(), 0.2.into())]).unwrap();
    for (mission, meta, columns, cells, parts) in [
        (mission(), "", "", "", [0.0, 0.0]),
        (mission(), "# floor: 0.0012\n", "", "", [0.0012, 0.0]),
        (mission(), "", ",floor [%]", ",0.12", [0.0012, 0.0]),
        (share.clone(), "", "", "", [0.0, 0.2]),
        (share, "# floor: 0.0012\n", "", "", [0.0012, 0.2]),
    ] {
        let set = read(meta, columns, cells, &mission).unwrap();
        for row in &set.rows {
            let expected: f64 = 1e-6 + parts[0] * parts[0] + (parts[1] * row.value).powi(2);
            assert!((row.sigma / expected.sqrt() - 1.0).abs() < 1e-12, "{}, {expected}", row.sigma);
            assert!((row.floor * row.floor - (expected - 1e-6)).abs() < 1e-18, "{}, {expected}", row.floor);
            assert!(row.at.covariates.is_empty());
        }
        assert_eq!(set.varying, ["trail_px"]);
    }
    for (meta, said) in [
        ("# floor: -0.1\n", "the floor of errors is a number from 0 on; this is -0.1"),
        ("# floor: wide\n", "a number is needed here"),
        ("# floor: nan\n", "the floor of errors is a number from 0 on"),
    ] {
        let error = read(meta, "", "", &mission()).unwrap_err().to_string();
        assert!(error.contains(said) && error.contains("meta.floor"), "{error}");
    }
    for (floor, said) in [(-0.1, "0 to 1"), (1.5, "1.5 % is 0.015")] {
        let error = mission().with(&[("fit.floor".into(), floor.into())]).unwrap_err().to_string();
        assert!(error.contains(said), "{error}");
    }
}
