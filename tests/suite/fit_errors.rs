//! Errors of fits: times of events, degenerate keys, errors that are not independent, errors of conditions.

use ctiplan::analysis::fit::profile::{End, profile};
use ctiplan::analysis::fit::{Advice, Fit, Options, fit};
use ctiplan::analysis::measurement::{DataSet, questions, with_errors_at};
use ctiplan::analysis::validate::validate;
use ctiplan::effect::CATALOGUE;
use ctiplan::io::table::Table;
use ctiplan::mission::Mission;
use ctiplan::model::Model;
use ctiplan::model::predict::predict;
use ctiplan::report::{FitReport, Report};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

const SNAP: &str = include_str!("../../missions/snap_l2.toml");

fn fitted(mission: &Mission, data: &[DataSet], keys: &[String]) -> Fit {
    fit(mission, data, keys, &Options::default(), &|_| {}).unwrap()
}

fn read(name: &str, text: &str, mission: &Mission) -> DataSet {
    DataSet::of(Table::parse(name, text).unwrap(), mission).unwrap()
}

/// The model's own values, with noise of the rows' errors.
fn simulated(mission: &Mission, mut data: Vec<DataSet>, seed: u64) -> Vec<DataSet> {
    let values = predict(&Model::new(mission), &questions(&data)).unwrap();
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    for (row, value) in data.iter_mut().flat_map(|set| &mut set.rows).zip(values) {
        let noise: f64 = StandardNormal.sample(&mut random);
        row.value = value + noise * row.sigma;
    }
    data
}

/// Effects of the catalogue with an event epoch: its key, that of the amplitude, and the effect's example in SNAP.
fn events() -> Vec<([String; 2], Mission)> {
    let snap = Mission::parse(SNAP).unwrap();
    let mut found = Vec::new();
    for entry in CATALOGUE.iter().filter(|entry| entry.card.keys.iter().any(|key| key.path == "t_yr")) {
        let kind = entry.card.kind;
        let example = toml::to_string(&(entry.example)(&snap)).unwrap();
        let mission = Mission::parse(&format!("{SNAP}\n[effects.{kind}]\n{example}")).unwrap();
        let amplitude = entry.card.keys.iter().find(|key| key.path != "t_yr").unwrap().path;
        found.push(([format!("effects.{kind}.t_yr"), format!("effects.{kind}.{amplitude}")], mission));
    }
    assert!(found.len() >= 2);
    found
}

/// Trap densities and doses of every quarter of a year, the error of a density that of so many hundredths of it.
fn monitored(mission: &Mission) -> Vec<DataSet> {
    let mut texts = ["trap_density", "dose"].map(|name| format!("# observable: {name}\nt_yr,value,sigma\n"));
    for quarter in 1..=20 {
        for _ in 0..2 {
            texts[0] += &format!("{},0.1,0.005\n", 0.25 * f64::from(quarter));
        }
        texts[1] += &format!("{},1e6,2e5\n", 0.25 * f64::from(quarter));
    }
    vec![read("densities.csv", &texts[0], mission), read("doses.csv", &texts[1], mission)]
}

/// Time and amplitude of an event anywhere between two epochs: the errors are those of the scatter, and intervals contain all that
/// fits as well.
#[test]
fn errors_of_events_include_their_times() {
    const CASES: u32 = 28;
    for (keys, mission) in events() {
        let empty = monitored(&mission);
        let mut within = [0; 2];
        for case in 0..CASES {
            let t_yr = 2.25 + 0.25 * (f64::from(case) + 0.5) / f64::from(CASES);
            let truth = mission.with(&[(keys[0].clone(), t_yr.into())]).unwrap();
            let data = simulated(&truth, empty.clone(), u64::from(case));
            let start = mission.with(&[(keys[0].clone(), 3.1.into())]).unwrap();
            let found = fitted(&start, &data, &keys);
            for (place, fitted) in found.parameters.iter().enumerate() {
                let pull = (fitted.value - truth.number(&keys[place]).unwrap()) / fitted.sigma.unwrap();
                assert!(pull.abs() < 4.0, "{} at {t_yr}: {pull}", fitted.key);
                within[place] += u32::from(pull.abs() < 1.0);
            }
            if case % 14 == 0 {
                intervals_contain_what_fits_as_well(&data, &found, &keys);
            }
        }
        for within in within {
            let share = f64::from(within) / f64::from(CASES);
            assert!((0.5..=0.85).contains(&share), "{keys:?}: {share}");
        }
    }
}

fn intervals_contain_what_fits_as_well(data: &[DataSet], found: &Fit, keys: &[String; 2]) {
    let model = Model::new(&found.mission);
    let profiles = keys.each_ref().map(|key| profile(&model, data, found, key, &|_| {}).unwrap());
    let end = |end: End| match end {
        End::Crossing { value } | End::Bound { value } | End::Undone { value } => value,
    };
    for step in 1..50 {
        let t_yr = 2.25 + 0.005 * f64::from(step);
        let held = found.mission.with(&[(keys[0].clone(), t_yr.into())]).unwrap();
        let there = fitted(&held, data, &keys[1..]);
        if there.chi2 > found.chi2 + 0.05 {
            continue;
        }
        for (profile, value) in profiles.iter().zip([t_yr, there.parameters[0].value]) {
            let interval = profile.intervals[0];
            let (low, high) = (end(interval.low), end(interval.high));
            // An end is known to a thousandth of its distance.
            let near = 2e-3 * (high - low);
            assert!(low - near < value && value < high + near, "{}: {value} {interval:?}", profile.key);
        }
    }
}

/// Dose = floor + (a + b) of a formula, and a slope.
fn sum() -> Mission {
    let text = format!(
        "{SNAP}\n[effects.formula]\ntarget = \"value\"\nexpression = \"value + a + b + slope * t_yr\"\na = 0.0\nb = 0.0\nslope = 0.0\n"
    );
    Mission::parse(&text).unwrap().with(&[("environment.active_dose_rate_mev_g_yr".into(), 0.0.into())]).unwrap()
}

fn keys(names: &[&str]) -> Vec<String> {
    names.iter().map(|name| format!("effects.formula.{name}")).collect()
}

/// Doses of 0 with independent normal errors of 1e5 MeV/g, or of a first-order autoregressive process.
fn doses(n: usize, correlation: f64, seed: u64) -> (Mission, Vec<DataSet>) {
    let mission = sum();
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut text = "# observable: dose\nt_yr,value,sigma\n".to_string();
    let mut off: f64 = StandardNormal.sample(&mut random);
    for row in 1..=n {
        text += &format!("{},{},1e5\n", 0.1 * row as f64, 1e5 * off);
        let noise: f64 = StandardNormal.sample(&mut random);
        off = correlation * off + (1.0 - correlation * correlation).sqrt() * noise;
    }
    let data = vec![read("doses.csv", &text, &mission)];
    (mission, data)
}

#[test]
fn of_degenerate_keys_the_constrained_combination_is_known() {
    let (mission, data) = doses(20, 0.0, 1);
    let found = fitted(&mission, &data, &keys(&["a", "slope", "b"]));
    let alone = fitted(&mission, &data, &keys(&["a", "slope"]));
    assert!(found.parameters[0].sigma.is_none() && found.parameters[2].sigma.is_none());
    assert_eq!([found.correlation[0][2], found.correlation[0][1]], [None, None]);
    let sigma = found.parameters[1].sigma.unwrap();
    assert!((sigma / alone.parameters[1].sigma.unwrap() - 1.0).abs() < 1e-3);
    let [Advice::Degenerate { keys, combinations }] = &found.advice[..1] else { panic!("{:?}", found.advice) };
    assert_eq!((keys.len(), combinations.len()), (2, 1));
    let one = &combinations[0];
    assert!((one.sigma / alone.parameters[0].sigma.unwrap() - 1.0).abs() < 1e-3, "{one:?}");
    assert!(
        (one.value - alone.parameters[0].value).abs() < 1e-2 * one.sigma && (one.terms[1].factor - 1.0).abs() < 1e-3
    );
    let report =
        FitReport { fit: found, holdout: None, profiles: Vec::new(), posterior: None, has_common_errors: false };
    let said = report.text();
    assert!(said.contains("only their combination") && said.contains("not known"), "{said}");
    let json = serde_json::to_value(&report).unwrap();
    assert!(json["correlation"][0][2].is_null() && json["constrained_combinations"][0]["sigma"].is_number(), "{json}");
}

/// The p-value for independent errors is one, also of residuals of a fit; and of errors with a correlation, it finds the
/// correlation and the factor by which errors are too small.
#[test]
fn independence_is_tested_at_the_level_that_is_said() {
    const SEEDS: u64 = 200;
    let free = keys(&["a", "slope"]);
    let chances: Vec<f64> = (0..SEEDS)
        .map(|seed| {
            let (mission, data) = doses(20, 0.0, seed);
            let tests = fitted(&mission, &data, &free).independence.tests;
            let [one] = &tests[..] else { panic!("{tests:?}") };
            one.false_alarm
        })
        .collect();
    for level in [0.02, 0.1, 0.3, 0.6] {
        let below = chances.iter().filter(|chance| **chance < level).count() as f64;
        let (expected, error) = (level * SEEDS as f64, (level * (1.0 - level) * SEEDS as f64).sqrt());
        assert!((below - expected).abs() < 3.0 * error, "{level}: {below} of {SEEDS}");
    }
    let (mut squares, mut factors, mut correlations) = ([0.0; 2], Vec::new(), Vec::new());
    for seed in 0..SEEDS / 2 {
        let (mission, data) = doses(60, 0.8, seed);
        let found = fitted(&mission, &data, &free);
        for (square, one) in squares.iter_mut().zip(&found.parameters) {
            *square += (one.value / one.sigma.unwrap()).powi(2) / (SEEDS / 2) as f64;
        }
        correlations.push(found.independence.tests[0].correlation);
        if let [Some(_), Some(slope)] = found.independence.error_factors[..] {
            factors.push(slope);
        }
    }
    factors.sort_by(f64::total_cmp);
    correlations.sort_by(f64::total_cmp);
    assert!(factors.len() > 90, "{}", factors.len());
    assert!((correlations[50] - 0.8).abs() < 0.06, "{}", correlations[50]);
    let (said, right) = (factors[factors.len() / 2], squares[1].sqrt());
    assert!((said / right - 1.0).abs() < 0.2, "{said} {right}");
}

#[test]
fn errors_correlated_in_time_are_told_by_fit_and_validate() {
    let (mission, data) = doses(40, 0.9, 3);
    let found = fitted(&mission, &data, &keys(&["a", "slope"]));
    let validation = validate(&found.mission, &data, 1).unwrap();
    let report =
        FitReport { fit: found, holdout: None, profiles: Vec::new(), posterior: None, has_common_errors: false };
    let said = report.text().split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(said.contains("residuals of neighbours along t_yr have a correlation"), "{said}");
    assert!(
        said.contains("the errors above are to be multiplied by") && !said.contains("errors (1 sigma) hold"),
        "{said}"
    );
    let json = serde_json::to_value(&report).unwrap();
    assert_eq!(json["independence"]["tests"][0]["name"], "t_yr");
    assert!(json["independence"]["error_factors"][0]["factor"].as_f64().unwrap() > 1.5, "{json}");
    assert!(validation.text().contains("residuals of neighbours along t_yr"), "{}", validation.text());
}

/// A second fit, from the mission that the first one wrote, has the same chi2, values and errors; so has a comparison.
#[test]
fn a_fit_after_a_fit_is_the_same_with_errors_of_conditions() {
    let key = "detector.traps.VV.density_per_px".to_string();
    let snap = Mission::parse(SNAP).unwrap();
    for (condition, values, sigma) in [
        ("t_yr", [2.0, 3.0, 4.0], 0.3),
        ("temperature_k", [138.0, 142.0, 147.0], 1.0),
        ("line_time_ms", [20.0, 30.0, 45.0], 4.0),
        ("background_e", [30.0, 60.0, 90.0], 20.0),
        ("signal_e", [500.0, 800.0, 2000.0], 150.0),
        ("transfers", [500.0, 1000.0, 1700.0], 90.0),
    ] {
        let mut text = "# observable: trail\n".to_string();
        for (name, value) in [("t_yr", "3.0"), ("signal_e", "800")].iter().filter(|(name, _)| *name != condition) {
            text += &format!("# {name}: {value}\n");
        }
        text += &format!("trail_px,{condition},sigma_{condition},value,sigma\n");
        for value in values {
            for trail_px in [1, 2, 4] {
                text += &format!("{trail_px},{value},{sigma},0.0,0.0004\n");
            }
        }
        let truth = snap.with(&[(key.clone(), 1.5.into())]).unwrap();
        let made = simulated(&truth, vec![read("trails.csv", &text, &truth)], 5);
        let mut lines: Vec<String> = text.lines().map(str::to_string).collect();
        let first = lines.len() - made[0].rows.len();
        for (line, row) in lines[first..].iter_mut().zip(&made[0].rows) {
            *line = line.replace(",0.0,", &format!(",{},", row.value));
        }
        let read_for = |mission: &Mission| vec![read("trails.csv", &lines.join("\n"), mission)];
        let first = fitted(&snap, &read_for(&snap), std::slice::from_ref(&key));
        let data = read_for(&first.mission);
        let again = fitted(&first.mission, &data, std::slice::from_ref(&key));
        let compared = validate(&first.mission, &data, 1).unwrap();
        let near = 0.02 * (1.0 + first.chi2);
        assert!((again.chi2 - first.chi2).abs() < near, "{condition}: {} {}", first.chi2, again.chi2);
        assert!((compared.chi2 - first.chi2).abs() < near, "{condition}: {} {}", first.chi2, compared.chi2);
        let [one, other] = [&first, &again].map(|fit| (fit.parameters[0].value, fit.parameters[0].sigma.unwrap()));
        assert!(
            (one.1 / other.1 - 1.0).abs() < 0.02 && (one.0 - other.0).abs() < 0.05 * one.1,
            "{condition}: {one:?} {other:?}"
        );
        let here = with_errors_at(read_for(&snap), &first.mission).unwrap();
        assert!(here[0].rows.iter().zip(&data[0].rows).all(|(a, b)| (a.sigma / b.sigma - 1.0).abs() < 1e-9));
    }
}
