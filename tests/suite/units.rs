//! Units in the headers of all tables that are read: a unit that converts gives what the converted numbers give, and one that does
//! not is refused.

use std::fs;
use std::path::Path;

use ctiplan::analysis::measurement::DataSet;
use ctiplan::error::InputError;
use ctiplan::image::AmplifierTable;
use ctiplan::io::radiation_file::{
    Times, read_dose_depth, read_dose_history, read_sectors, read_spectrum, read_temperature_history,
};
use ctiplan::mission::Mission;
use ctiplan::physics::conditions::NAMES;
use ctiplan::plan::mission_sample::MissionSample;

/// Columns of a table: name, unit, and two rows. The first line may be `meta`.
struct Case {
    meta: &'static str,
    columns: &'static [(&'static str, &'static str, [f64; 2])],
    read: fn(&Path) -> Result<Vec<f64>, InputError>,
}

const DOSE: (&str, &str, [f64; 2]) = ("value", "MeV/g", [2e6, 3e6]);

const CASES: &[Case] = &[
    Case {
        meta: "# observable: packet_charge\n",
        columns: &[
            ("value", "e-", [1500.0, 1400.0]),
            ("sigma", "e-", [2.0, 3.0]),
            ("sigma_common", "e-", [1.0, 1.5]),
            ("floor", "e-", [0.5, 0.5]),
            ("t_yr", "yr", [1.0, 2.0]),
            ("temperature_k", "K", [150.0, 151.0]),
            ("line_time_ms", "ms", [25.0, 30.0]),
            ("background_e", "e-", [50.0, 60.0]),
            ("transfers", "px", [1650.0, 800.0]),
            ("signal_e", "e-", [1620.0, 1500.0]),
            ("preceding_e", "e-", [900.0, 800.0]),
            ("preceding_px", "px", [20.0, 30.0]),
            ("trail_px", "px", [10.0, 20.0]),
            ("block_px", "px", [10.0, 20.0]),
            ("first_px", "px", [10.0, 10.0]),
            ("last_px", "px", [20.0, 20.0]),
            ("phase_time_ms", "ms", [1.0, 2.0]),
            ("pumping_cycles", "ct", [1000.0, 2000.0]),
            ("sigma_t_yr", "yr", [0.1, 0.2]),
            ("sigma_temperature_k", "K", [0.5, 0.6]),
            ("sigma_signal_e", "e-", [5.0, 6.0]),
        ],
        read: measurements,
    },
    Case {
        meta: "# observable: dose\n# t_yr: 2\n",
        columns: &[DOSE, ("sigma", "MeV/g", [1e5, 1e5])],
        read: measurements,
    },
    Case {
        meta: "# observable: trap_density\n",
        columns: &[("value", "1/px", [0.1, 0.2]), ("sigma", "1/px", [0.01, 0.01]), ("dose_mev_g", "MeV/g", [2e6, 3e6])],
        read: measurements,
    },
    Case {
        meta: "# observable: delta_y\n",
        columns: &[("value", "px", [0.1, 0.2]), ("sigma", "px", [0.01, 0.01]), ("mjd", "d", [55000.0, 55500.0])],
        read: measurements,
    },
    Case {
        meta: "# observable: delta_size\n",
        columns: &[("value", "", [0.1, 0.2]), ("sigma", "", [0.01, 0.01]), ("jd", "d", [2455000.0, 2455500.0])],
        read: measurements,
    },
    Case {
        meta: "",
        columns: &[
            ("flux_e", "e-", [1000.0, 2000.0]),
            ("half_light_px", "px", [1.0, 2.0]),
            ("sersic_index", "", [1.0, 2.0]),
            ("e1", "", [0.1, 0.2]),
            ("e2", "", [0.1, 0.2]),
            ("weight_px", "px", [4.0, 5.0]),
            ("transfers", "px", [1000.0, 2000.0]),
            ("weight", "", [1.0, 2.0]),
        ],
        read: galaxies,
    },
    Case {
        meta: "",
        columns: &[("t_yr", "yr", [0.0, 2.0]), ("dose_mev_g", "MeV/g", [0.0, 2e6])],
        read: |path| read_dose_history(path).map(|read| with_times(&read.times, read.doses.values())),
    },
    Case {
        meta: "",
        columns: &[("t_yr", "yr", [0.0, 2.0]), ("rate_mev_g_yr", "MeV/g/yr", [1e6, 2e6])],
        read: |path| read_dose_history(path).map(|read| with_times(&read.times, read.doses.values())),
    },
    Case {
        meta: "",
        columns: &[("t_yr", "yr", [0.0, 2.0]), ("temperature_k", "K", [150.0, 160.0])],
        read: |path| {
            let read = read_temperature_history(path, [50.0, 400.0])?;
            Ok(with_times(&read.times, &read.temperatures_k))
        },
    },
    Case {
        meta: "",
        columns: &[("weight", "sr", [1.0, 3.0]), ("thickness_mm", "mm", [2.0, 5.0])],
        read: |path| read_sectors(path).map(|read| [read.weights, read.depths.values().to_vec()].concat()),
    },
    Case {
        meta: "",
        columns: &[("areal_density_g_cm2", "g/cm2", [2.0, 5.0]), ("dose_mev_g", "MeV/g", [2e6, 1e6])],
        read: |path| read_dose_depth(path).map(|read| [read.depths.values(), read.doses.values()].concat()),
    },
    Case {
        meta: "",
        columns: &[("energy_mev", "MeV", [1.0, 10.0]), ("integral_cm2", "1/cm2", [1e10, 1e9])],
        read: |path| read_spectrum(path).map(|read| [read.energies_mev, read.values].concat()),
    },
    Case {
        meta: "",
        columns: &[
            ("detector.temperature_k", "K", [150.0, 160.0]),
            ("readout.line_time_ms", "ms", [20.0, 30.0]),
            ("sky.background_e", "e-", [20.0, 30.0]),
            ("log_posterior", "", [-1.0, -2.0]),
        ],
        read: |path| {
            let mission = mission();
            let drawn = MissionSample::read(path, &mission)?.mission(&mission, 1)?;
            Ok(vec![drawn.detector.temperature_k, drawn.readout.line_time_ms, drawn.sky.background_e])
        },
    },
];

/// Units, and what one of them is in ours. Numbers are halves, tens and whole ones, which no conversion rounds.
const UNITS: &[(&str, &[(&str, f64)])] = &[
    ("yr", &[("d", 1.0 / 365.25), ("s", 1.0 / 31_557_600.0), ("h", 1.0 / 8766.0)]),
    ("d", &[("h", 1.0 / 24.0), ("s", 1.0 / 86_400.0)]),
    ("MeV/g", &[("MeV / g", 1.0), ("keV / g", 1e-3), ("TeV/g", 1e6), ("1e+06 MeV / g", 1e6)]),
    ("MeV/g/yr", &[("MeV / (g d)", 365.25), ("keV / (g s)", 31_557.6)]),
    ("K", &[("mK", 1e-3)]),
    ("ms", &[("s", 1e3), ("us", 1e-3), ("\u{b5}s", 1e-3)]),
    ("e-", &[("electron", 1.0), ("ke-", 1e3), ("100 electron", 1e2)]),
    ("px", &[("pix", 1.0), ("rows", 1.0), ("10 pix", 10.0)]),
    ("1/px", &[("1 / pix", 1.0), ("1 / (10 pix)", 0.1)]),
    ("ct", &[("count", 1.0), ("10 ct", 10.0)]),
    ("", &[("%", 0.01)]),
    ("mm", &[("um", 1e-3), ("cm", 10.0)]),
    ("g/cm2", &[("kg / m2", 0.1), ("mg/cm2", 1e-3)]),
    ("sr", &[("deg2", 1.0)]),
    ("MeV", &[("keV", 1e-3), ("GeV", 1e3)]),
    ("1/cm2", &[("1 / m2", 1e-4), ("mm-2", 1e2)]),
];

fn mission() -> Mission {
    Mission::read("missions/snap_l2.toml").unwrap()
}

fn measurements(path: &Path) -> Result<Vec<f64>, InputError> {
    let set = DataSet::read(path, &mission())?;
    let row = |row: &ctiplan::analysis::measurement::Row| -> Vec<f64> {
        let at = NAMES.iter().filter_map(|name| row.at.get(name));
        let sigmas = row.condition_sigmas.iter().map(|(_, sigma)| *sigma);
        [row.value, row.sigma, row.floor, row.common.sigma].into_iter().chain(at).chain(sigmas).collect()
    };
    Ok(set.rows.iter().flat_map(row).collect())
}

fn galaxies(path: &Path) -> Result<Vec<f64>, InputError> {
    let name = path.file_name().unwrap().to_str().unwrap();
    let population = format!("[population]\ntable = \"{name}\"\n\n[requirement]");
    let snap = include_str!("../../missions/snap_l2.toml").replace("[requirement]", &population);
    let mission_file = path.with_file_name("mission.toml");
    fs::write(&mission_file, snap).unwrap();
    let galaxies = Mission::read(&mission_file)?.imported.galaxies;
    let of = |one: &ctiplan::mission::PopulationGalaxy| {
        let transfers = one.transfers.map(f64::from);
        [one.flux_e, one.half_light_px, one.sersic_index, one.e1, one.e2, one.weight_px, transfers, Some(one.weight)]
    };
    Ok(galaxies.iter().flat_map(of).flatten().collect())
}

fn with_times(times: &Times, values: &[f64]) -> Vec<f64> {
    let Times::SinceLaunchYr(years) = times else { panic!("years") };
    [years, values].concat()
}

/// The table with a column in another unit, of which one is `factor` of ours.
fn text(case: &Case, changed: &str, unit: &str, factor: f64) -> String {
    let header = |(name, ..): &(&str, &str, [f64; 2])| {
        if *name == changed { format!("{name} [{unit}]") } else { (*name).to_string() }
    };
    // An error has the unit of its value.
    let names: Vec<String> = case.columns.iter().map(header).collect();
    let row = |row: usize| {
        let cell = |(name, _, rows): &(&str, &str, [f64; 2])| {
            (if *name == changed { rows[row] / factor } else { rows[row] }).to_string()
        };
        case.columns.iter().map(cell).collect::<Vec<_>>().join(",")
    };
    format!("{}{}\n{}\n{}\n", case.meta, names.join(","), row(0), row(1))
}

#[test]
fn a_column_in_another_unit_is_its_converted_numbers_or_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("table.csv");
    let read = |case: &Case, text: &str| {
        fs::write(&path, text).unwrap();
        (case.read)(&path)
    };
    let mut converted = 0;
    for case in CASES {
        let expected = read(case, &text(case, "", "", 1.0)).unwrap_or_else(|error| panic!("{error}"));
        // An error without a unit beside a value in another one is refused, as it is ambiguous.
        let is_lonely = |name: &str| name == "value" && case.meta.contains("observable");
        for (name, ours, _) in case.columns {
            let (_, units) = UNITS.iter().find(|(known, _)| known == ours).unwrap();
            let skipped = is_lonely(name) || *name == "log_posterior";
            for (unit, factor) in units.iter().filter(|(_, factor)| !skipped || *factor == 1.0) {
                let found = read(case, &text(case, name, unit, *factor)).unwrap_or_else(|error| panic!("{error}"));
                assert_eq!(found.len(), expected.len(), "{name} [{unit}]");
                for (a, b) in found.iter().zip(&expected) {
                    assert!((a - b).abs() <= 1e-9 * b.abs(), "{name} [{unit}]: {a} {b}");
                }
                converted += 1;
            }
            if *name == "log_posterior" {
                continue;
            }
            for unit in ["uJy", "arcsec", "furlong", "adu", "electron2"] {
                let error = read(case, &text(case, name, unit, 1.0)).expect_err(&format!("{name} [{unit}]"));
                let said = error.to_string();
                for part in ["table.csv", name, unit, "allowed: "] {
                    assert!(said.contains(part), "{part}: {said}");
                }
            }
        }
    }
    assert!(converted > 80, "{converted}");
}

#[test]
fn amplifiers_have_units_too() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("amplifiers.csv");
    let read = |name: &str, cell: f64| {
        fs::write(&path, format!("hdu,corner,{name}\n1,lower-left,{cell}\n")).unwrap();
        // The columns of the file keep their units.
        let rows = |table| format!("{table:?}").split_once("rows: [Row").expect("rows").1.to_string();
        AmplifierTable::read(&path).map(rows)
    };
    let same = [
        ("read_noise_e", "electron", 5.0, 5.0),
        ("read_noise_e", "ke-", 5.0, 0.005),
        ("gain_e_per_dn", "electron / adu", 2.0, 2.0),
        ("gain_e_per_dn", "ke-/DN", 2.0, 0.002),
        ("bias_dn", "adu", 100.0, 100.0),
        ("prescan_columns", "10 pix", 20.0, 2.0),
        ("density_factor", "%", 1.5, 150.0),
    ];
    for (name, unit, ours, theirs) in same {
        assert_eq!(read(&format!("{name} [{unit}]"), theirs).unwrap(), read(name, ours).unwrap(), "{name} [{unit}]");
        let refused = read(&format!("{name} [Jy]"), 1.0).unwrap_err().to_string();
        assert!(refused.contains("\"Jy\"") && refused.contains("allowed: "), "{refused}");
    }
}
