//! What rows leave to the mission is that of the mission evaluated, not of the one with which they were read.

use ctiplan::analysis::fit::{Advice, Options, fit};
use ctiplan::analysis::measurement::{DataSet, questions};
use ctiplan::analysis::validate::validate;
use ctiplan::io::table::Table;
use ctiplan::mission::Mission;
use ctiplan::mission::keys::{Allowed, KEYS};
use ctiplan::model::Model;
use ctiplan::model::predict::predict;
use ctiplan::physics::conditions::{Conditions, MIRRORED, NAMES};
use ctiplan::report::{FitReport, Format, Report};

fn mission() -> Mission {
    Mission::read("missions/snap_l2.toml").unwrap()
}

/// Values that differ from the mission's, for each condition that mirrors a key.
fn other(name: &str) -> f64 {
    match name {
        "temperature_k" => 141.0,
        "line_time_ms" => 40.0,
        "background_e" => 33.0,
        "transfers" => 900.0,
        _ => panic!("no other value of {name}"),
    }
}

/// Rows of each observable: columns, and their cells.
const TABLES: [(&str, &str, [&str; 2]); 6] = [
    ("trail", "t_yr,trail_px,signal_e", ["1,1,800", "4,3,800"]),
    ("packet_charge", "t_yr,signal_e", ["1,800", "4,3000"]),
    ("eper", "t_yr,trail_px,signal_e,block_px", ["1,1,800,200", "4,3,3000,200"]),
    ("cti", "t_yr,signal_e", ["1,800", "4,3000"]),
    ("delta_e1", "t_yr,galaxy", ["1,faint", "4,bright"]),
    ("trail", "dose_mev_g,trail_px,signal_e", ["1e7,1,800", "5e7,3,800"]),
];

/// A data set of one table, with further columns and the same cells of them in every row.
fn set((observable, columns, rows): (&str, &str, [&str; 2]), more: &[(&str, String)], mission: &Mission) -> DataSet {
    let mut text = format!("# observable: {observable}\n{columns},value,sigma");
    more.iter().for_each(|(name, _)| text += &format!(",{name}"));
    for row in rows {
        text += &format!("\n{row},0.1,0.01");
        more.iter().for_each(|(_, cell)| text += &format!(",{cell}"));
    }
    DataSet::of(Table::parse("rows.csv", &text).unwrap(), mission).unwrap_or_else(|error| panic!("{error}\n{text}"))
}

fn values(mission: &Mission, set: &DataSet) -> Vec<f64> {
    predict(&Model::new(mission), &questions(std::slice::from_ref(set))).unwrap()
}

fn with(mission: &Mission, key: &str, value: f64) -> Mission {
    let whole = key == "readout.transfers";
    let value = if whole { toml::Value::Integer(value as i64) } else { toml::Value::Float(value) };
    mission.with(&[(key.into(), value)]).unwrap()
}

/// The list of conditions that mirror keys leaves none out: each number of the mission is changed.
#[test]
fn all_conditions_that_mirror_a_key_are_listed() {
    let mission = mission();
    let own = Conditions::of(&mission, 2.0);
    let mut found = Vec::new();
    for key in KEYS.iter().filter(|key| !key.path.contains("[]")) {
        let Some(number) = mission.number(key.path) else { continue };
        let whole = matches!(key.kind, Allowed::Integer(..));
        let changed =
            if whole { toml::Value::Integer(number as i64 + 1) } else { toml::Value::Float(1.01 * number + 1e-3) };
        let Ok(changed) = mission.with(&[(key.path.into(), changed)]) else { continue };
        let changed = Conditions::of(&changed, 2.0);
        let differing = NAMES.into_iter().filter(|name| changed.get(name) != own.get(name));
        found.extend(differing.map(|name| (name, key.path)));
    }
    found.sort();
    let mut listed = MIRRORED.to_vec();
    listed.sort();
    assert_eq!(found, listed);
}

#[test]
fn a_changed_key_is_a_column_with_the_changed_value() {
    let mission = mission();
    for table in TABLES {
        let left = set(table, &[], &mission);
        for (name, key) in MIRRORED {
            let changed = with(&mission, key, other(name));
            let stated = set(table, &[(name, other(name).to_string())], &mission);
            let expected = values(&mission, &stated);
            assert_ne!(values(&mission, &left), expected, "{} {name}: it does not matter", table.0);
            assert_eq!(values(&changed, &left), expected, "{} {name}", table.0);
            // What a row states is its own.
            assert_eq!(values(&changed, &stated), expected, "{} {name}", table.0);
            // As if read with the changed mission, for all conditions together.
            assert_eq!(values(&changed, &set(table, &[], &changed)), expected, "{} {name}", table.0);
        }
    }
}

#[test]
fn dates_and_the_judged_galaxy_follow_the_mission_too() {
    let mission = mission();
    let dated = ("trail", "date,trail_px,signal_e", ["2011-01-01,1,800", "2012-07-01,3,800"]);
    let later =
        mission.with(&[("mission.launch".into(), "2010-06-01".parse::<toml::value::Datetime>().unwrap().into())]);
    let later = later.unwrap();
    let moved = values(&later, &set(dated, &[], &mission));
    let read = values(&later, &set(dated, &[], &later));
    assert!(moved.iter().zip(&read).all(|(a, b)| (a / b - 1.0).abs() < 1e-9), "{moved:?}, {read:?}");
    let never =
        mission.with(&[("mission.launch".into(), "2012-06-01".parse::<toml::value::Datetime>().unwrap().into())]);
    let error = predict(&Model::new(&never.unwrap()), &questions(&[set(dated, &[], &mission)])).unwrap_err();
    assert!(error.to_string().contains("before launch"), "{error}");
    let shapes = ("delta_e1", "t_yr", ["1", "4"]);
    let bright = mission.with(&[("requirement.galaxy".into(), "bright".into())]).unwrap();
    let expected = values(&mission, &set(shapes, &[("galaxy", "bright".into())], &mission));
    assert_eq!(values(&bright, &set(shapes, &[], &mission)), expected);
}

/// Rows that share a readout do so only if all their conditions are equal under the mission evaluated.
#[test]
fn rows_beside_others_are_what_they_are_alone() {
    let mission = mission();
    for (name, key) in MIRRORED {
        let changed = with(&mission, key, other(name));
        let left = set(TABLES[0], &[], &mission);
        let own = with(&mission, key, other(name)).number(key).unwrap();
        let stated = set(TABLES[0], &[(name, mission.number(key).unwrap_or(1650.0).to_string())], &mission);
        let same = set(TABLES[0], &[(name, own.to_string())], &mission);
        let all = [left.clone(), stated.clone(), same.clone()];
        let together = predict(&Model::new(&changed), &questions(&all)).unwrap();
        let alone: Vec<f64> = all.iter().flat_map(|set| values(&changed, set)).collect();
        for (together, alone) in together.iter().zip(&alone) {
            assert!((together / alone - 1.0).abs() < 1e-5, "{name}: {together}, {alone}");
        }
        assert_eq!(together[..2], together[4..], "{name}");
        assert!((together[0] / together[2] - 1.0).abs() > 1e-3, "{name}: {together:?}");
    }
}

/// The free key of a condition gets the value with which data were made.
#[test]
fn a_fit_finds_the_key_of_a_condition() {
    let mission = mission();
    let pixels = |px: u32| format!("{},{px},800\n4,{px},2000", 2 + px % 3);
    for (name, key) in MIRRORED.into_iter().filter(|(name, _)| *name != "transfers") {
        let truth = with(&mission, key, other(name));
        let mut text = "# observable: trail\nt_yr,trail_px,signal_e,value,sigma\n".to_string();
        for row in (1..=12).map(pixels).collect::<Vec<_>>().join("\n").lines() {
            text += &format!("{row},0.0,1e-5\n");
        }
        let mut data = [DataSet::of(Table::parse("trail.csv", &text).unwrap(), &mission).unwrap()];
        let made = values(&truth, &data[0]);
        data[0].rows.iter_mut().zip(made).for_each(|(row, value)| row.value = value);
        assert!(validate(&mission, &data, 1).unwrap().chi2 > 100.0, "{name}");
        assert!(validate(&truth, &data, 1).unwrap().chi2 < 1e-6, "{name}");
        let found = fit(&mission, &data, &[key.to_string()], &Options::default(), &|_| {}).unwrap();
        let fitted = &found.parameters[0];
        assert!((fitted.value / other(name) - 1.0).abs() < 1e-3, "{key}: {} for {}", fitted.value, other(name));
        assert!(!found.advice.iter().any(|advice| matches!(advice, Advice::Unconstrained { .. })), "{key}");
    }
    let data = [set(TABLES[0], &[], &mission)];
    let error = fit(&mission, &data, &["readout.transfers".to_string()], &Options::default(), &|_| {}).unwrap_err();
    assert!(error.to_string().contains("whole numbers"), "{error}");
}

/// A column that looks like a condition of the mission's is pointed out, once, in text and JSON; one that is no such thing is not.
#[test]
fn columns_that_look_like_a_condition_are_pointed_out() {
    let mission = mission();
    let near = [
        ("n_transfers", "transfers"),
        ("temperature", "temperature_k"),
        ("T_K", "temperature_k"),
        ("background", "background_e"),
        ("line_time", "line_time_ms"),
        ("dose", "dose_mev_g"),
    ];
    for (column, condition) in near {
        let data = [set(TABLES[1], &[(column, "100".into())], &mission)];
        let validation = validate(&mission, &data, 1).unwrap();
        let fit = fit(&mission, &data, &["detector.well_fill_power".into()], &Options::default(), &|_| {}).unwrap();
        let fit = FitReport { fit, holdout: None, profiles: Vec::new(), posterior: None, has_common_errors: false };
        let named = format!("name it `{condition}`");
        for text in [validation.render(Format::Text), fit.render(Format::Text)] {
            let text = text.split_whitespace().collect::<Vec<_>>().join(" ");
            assert_eq!(text.matches("Warning: ").count(), 1, "{column}: {text}");
            assert!(text.contains(&format!("`{column}`")) && text.contains(&named), "{column}: {text}");
        }
        for json in [validation.render(Format::Json), fit.render(Format::Json)] {
            let json: serde_json::Value = serde_json::from_str(&json).unwrap();
            assert!(json["warnings"][0].as_str().unwrap().contains(&named), "{column}: {json}");
        }
        // Not if the file states the condition as well.
        let stated = if condition == "dose_mev_g" { "1e7".into() } else { other(condition).to_string() };
        let stated = set(TABLES[1], &[(column, "100".into()), (condition, stated)], &mission);
        assert!(stated.warning.is_none(), "{column}");
    }
    for column in ["amplifier", "ccd", "exposure", "seeing", "airmass", "chip", "row", "filter", "gain", "run"] {
        assert!(set(TABLES[1], &[(column, "1".into())], &mission).warning.is_none(), "{column}");
    }
}

/// No empty cell of a condition is filled in from the mission.
#[test]
fn an_empty_cell_is_refused_with_its_place() {
    let mission = mission();
    for (name, _) in MIRRORED {
        let text = format!(
            "# observable: packet_charge\nt_yr,signal_e,{name},value,sigma\n1,800,{},790,1\n4,800,,780,1\n",
            other(name)
        );
        let error = DataSet::of(Table::parse("p.csv", &text).unwrap(), &mission).unwrap_err().to_string();
        assert!(error.contains("line 4") && error.contains(&format!("`{name}` is empty")), "{error}");
    }
    for (columns, row, said) in [
        ("t_yr,signal_e", ",800", "`t_yr` is empty"),
        ("date,signal_e", ",800", "`date` is empty"),
        ("t_yr,signal_e", "4,", "`signal_e` is empty"),
        ("signal_e", "800", "neither a column nor in meta"),
        ("t_yr", "4", "needs `signal_e`, which is neither a column nor in meta"),
        ("t_yr,signal", "4,800", "`signal`? then name the column `signal_e`"),
        ("time,signal_e", "4,800", "`time`? then name the column `t_yr`"),
    ] {
        let text = format!("# observable: packet_charge\n{columns},value,sigma\n{row},790,1\n");
        let error = DataSet::of(Table::parse("p.csv", &text).unwrap(), &mission).unwrap_err().to_string();
        assert!(error.contains(said), "{said}: {error}");
    }
}
