//! Temperatures of a detector over time: which holds when, and what is refused.

use std::fs;

use ctiplan::analysis::measurement::DataSet;
use ctiplan::error::InputError;
use ctiplan::io::table::Table;
use ctiplan::mission::Mission;
use ctiplan::model::Model;
use ctiplan::physics::release_factor;

/// A mission launched on 2009-01-01, at 133 K, with a history in its own folder.
fn with_history(table: &str) -> Result<Mission, InputError> {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("temperature.csv"), table).unwrap();
    let text = include_str!("../../missions/snap_l2.toml")
        .replace("\ntemperature_k = 133.0", "\ntemperature_k = 133.0\ntemperature_history = \"temperature.csv\"");
    assert!(text.contains("temperature_history"));
    let path = folder.path().join("mission.toml");
    fs::write(&path, text).unwrap();
    let mission = Mission::read(&path)?;
    // Other values keep it, by way of numbers and by way of the text.
    for (key, value) in [("sky.background_e", toml::Value::Float(7.0)), ("readout.transfers", 900.into())] {
        let other = mission.with(&[(key.into(), value)]).unwrap();
        assert_eq!(other.imported.temperatures, mission.imported.temperatures);
    }
    Ok(mission)
}

#[test]
fn each_row_holds_until_the_next_and_release_times_follow() {
    let mission = with_history("t_yr,temperature_k\n1.0,150\n2.5,140\n").unwrap();
    let plain = Mission::read("missions/snap_l2.toml").unwrap();
    let (model, plain) = (Model::new(&mission), Model::new(&plain));
    let before = |t_yr: f64| t_yr.next_down();
    for (t_yr, kelvin) in
        [(0.0, 133.0), (before(1.0), 133.0), (1.0, 150.0), (before(2.5), 150.0), (2.5, 140.0), (5.0, 140.0)]
    {
        assert_eq!(model.conditions(t_yr).temperature_k, kelvin, "{t_yr}");
        let species = mission.detector.traps.iter();
        for ((warm, cold), species) in model.traps(t_yr).unwrap().iter().zip(plain.traps(t_yr).unwrap()).zip(species) {
            let factor = release_factor(species.energy_ev, kelvin, 133.0);
            assert!((warm.release_ms / (cold.release_ms * factor) - 1.0).abs() < 1e-12, "{t_yr}");
            assert_eq!(warm.density_per_px, cold.density_per_px);
        }
    }
    // A curve over the mission knows both sides of each step.
    let times = model.times_yr(5.0);
    assert!([before(1.0), 1.0, before(2.5), 2.5].iter().all(|t_yr| times.contains(t_yr)), "{times:?}");
}

#[test]
fn dates_and_degrees_celsius_are_converted() {
    let table = "date,temperature_k [deg_C]\n2008-06-01,-120\n2010-01-01T12:00:00,-130\n";
    let mission = with_history(table).unwrap();
    let noon_yr = 365.5 / 365.25;
    for (t_yr, kelvin) in [(0.0, 153.15), (noon_yr - 1e-6, 153.15), (noon_yr + 1e-6, 143.15)] {
        assert!((mission.temperature_k(t_yr) - kelvin).abs() < 1e-9, "{t_yr}");
    }
}

/// A row's own temperature comes first, then the history; a laboratory does not follow the mission's.
#[test]
fn rows_without_a_temperature_have_that_of_their_time() {
    let mission = with_history("t_yr,temperature_k\n1.0,150\n").unwrap();
    let temperatures_k = |rows: &str| -> Vec<f64> {
        let text = format!("# observable: trail\n# signal_e: 800\n# trail_px: 1\n{rows}");
        let data = DataSet::of(Table::parse("rows.csv", &text).unwrap(), &mission).unwrap();
        data.rows.iter().map(|row| row.at.temperature_k).collect()
    };
    let of_mission = "t_yr,dose_mev_g,value,sigma\n0.5,,0.01,0.001\n2.0,,0.01,0.001\n2.0,1e7,0.01,0.001\n";
    assert_eq!(temperatures_k(of_mission), [133.0, 150.0, 133.0]);
    assert_eq!(temperatures_k("t_yr,temperature_k,value,sigma\n2.0,141,0.01,0.001\n"), [141.0]);
}

#[test]
fn what_makes_no_sense_is_refused_with_line_and_reason() {
    for (table, place, said) in [
        ("t_yr,temperature_k\n1,150\n1,140\n", "line 3: t_yr = 1", "more than in the row before"),
        ("t_yr,temperature_k\n1,20\n", "line 2: temperature_k = 20", "allowed: 40 to 400 K"),
        ("t_yr,temperature_k\n1,-120\n", "line 2: temperature_k = -120", "unit deg_C"),
        (
            "t_yr,temperature_k [deg_F]\n1,-120\n",
            "temperature_k [deg_F]",
            "the unit \"deg_F\" cannot be converted to K",
        ),
        ("t_yr,temperature_k\n1,cold\n", "line 2: temperature_k = ", "a number is needed here"),
        ("t_yr,temperature\n1,150\n", "", "no column temperature_k"),
        ("epoch,temperature_k\n1,150\n", "", "no column t_yr or date"),
    ] {
        let error = with_history(table).unwrap_err().to_string();
        assert!(error.contains("temperature history") && error.contains("temperature.csv"), "{error}");
        assert!(error.contains(place) && error.contains(said), "{error}");
    }
    let missing = include_str!("../../missions/snap_l2.toml")
        .replace("\ntemperature_k = 133.0", "\ntemperature_k = 133.0\ntemperature_history = \"nowhere.csv\"");
    assert!(Mission::parse(&missing).unwrap_err().to_string().contains("nowhere.csv"));
}
