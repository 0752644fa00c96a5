//! The Sun as events: quantiles of missions are ESP's, quiet years have events too, and a seed is a result.

use std::process::{Command, Output};

use ctiplan::environment::esp;
use ctiplan::environment::solar_events::{Activity, SolarEvents, Sun};
use ctiplan::mission::Mission;
use ctiplan::model::Model;
use ctiplan::physics::SolarEventDoses;
use ctiplan::plan::dose::{QUANTILES, Samples, survey};
use serde_json::Value;

const SHIELDED: &str = "missions/snap_l2_shielded.toml";

/// The shielded mission behind a sphere, which is quicker, with other lines in place of some of its own.
fn mission(changes: &[(&str, &str)]) -> Mission {
    let mut text = include_str!("../../missions/snap_l2_shielded.toml")
        .replace("geometry = \"slab\"", "geometry = \"sphere\"")
        .replace("accumulate = \"yearly\"", "accumulate = \"mission\"");
    for (from, to) in changes {
        assert!(text.contains(from), "{from}");
        text = text.replace(from, to);
    }
    Mission::parse(&text).unwrap()
}

/// So many years, all of them active.
fn active(years: u32) -> Mission {
    mission(&[
        ("duration_yr = 5.0", &format!("duration_yr = {years}.0")),
        ("confidence = 0.95", &format!("confidence = 0.95\nactive_years = {years}.0")),
    ])
}

/// With all sources, in a low polar orbit.
fn low_orbit() -> Mission {
    mission(&[
        (
            "orbit = \"l2\"\n",
            "\n[orbit]\nkind = \"elements\"\nperigee_km = 600.0\napogee_km = 600.0\ninclination_deg = 97.8\n",
        ),
        ("model = \"solar-cycle\"", "model = \"derived\""),
    ])
}

fn ctiplan(arguments: &[&str], threads: &str) -> Output {
    Command::new(env!("CARGO_BIN_EXE_ctiplan"))
        .args(arguments)
        .env("RAYON_NUM_THREADS", threads)
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .output()
        .unwrap()
}

fn json(arguments: &[&str]) -> Value {
    let output = ctiplan(&[arguments, &["--json"]].concat(), "2");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

#[test]
fn doses_of_missions_have_the_quantiles_of_esp() {
    for years in [1, 3, 7] {
        let mission = active(years);
        let samples = Samples::of(&mission, 2000, 3).unwrap();
        let confidences = survey(&mission, &[10.0]).unwrap().confidences;
        for at in &samples.quantiles {
            // Ranks are spread evenly: what is left is the straight line between two samples.
            let esp_mev_g = at.esp_mev_g.unwrap();
            assert!((at.dose_mev_g / esp_mev_g - 1.0).abs() < 1e-3, "{years} yr, {at:?}");
            assert!((at.dose_mev_g - esp_mev_g).abs() < at.error, "{years} yr, {at:?}");
            // The same by way of a mission at this confidence.
            if let Some(other) = confidences.iter().find(|other| other.confidence == at.p) {
                assert!((esp_mev_g / other.mission_mev_g - 1.0).abs() < 1e-3, "{years} yr, {at:?}: {other:?}");
            }
        }
    }
}

/// Fluence (cm⁻²) of the active events of a sample up to a time, above an energy, each energy scaled to ESP's sum by itself.
fn fluence_until(events: &SolarEvents, index: usize, until_yr: f64, energy_mev: f64) -> f64 {
    let log = |z: f64| Activity::Active.event(z).above(energy_mev).ln();
    let (mu, sigma) = (log(0.0), log(1.0) - log(0.0));
    let sample = events.sample(index);
    let sum = |until_yr: f64| -> f64 {
        let within = sample.events.iter().filter(|event| event.activity == Activity::Active && event.t_yr < until_yr);
        within.map(|event| (mu + sigma * event.z).exp()).sum()
    };
    let total = esp::fluence(sample.confidence, sample.active_years).above(energy_mev);
    total * sum(until_yr) / sum(f64::INFINITY)
}

#[test]
fn fluences_within_a_mission_are_those_of_esp_to_the_errors_of_both() {
    const COUNT: usize = 20_000;
    let events = SolarEvents::new(Sun::Mean { active_yr: 7.0 }, 7.0, COUNT as u32, 5);
    for energy_mev in [10.0, 30.0, 60.0] {
        for until_yr in [1.0, 3.0] {
            let fluence = |index: usize| fluence_until(&events, index, until_yr, energy_mev);
            let mut fluences: Vec<f64> = (0..COUNT).map(fluence).collect();
            fluences.sort_by(f64::total_cmp);
            for p in [0.5, 0.75, 0.9, 0.95, 0.99] {
                let ratio = fluences[(p * COUNT as f64) as usize] / esp::fluence(p, until_yr).above(energy_mev);
                assert!((0.8..1.15).contains(&ratio), "{energy_mev} MeV, {until_yr} yr, {p}: {ratio}");
            }
        }
    }
}

#[test]
fn events_are_as_many_as_were_observed() {
    let mission =
        mission(&[("launch = 2009-01-01", "launch = 2005-01-01"), ("duration_yr = 5.0", "duration_yr = 10.0")]);
    // Quiet to 2011.8, then active.
    let (quiet_yr, active_yr) = (6.8, 3.2);
    let samples = Samples::of(&mission, 4000, 1).unwrap();
    let expected: f64 = 1.6 * quiet_yr + 6.15 * active_yr;
    let error = (expected / 4000.0).sqrt();
    assert!((samples.events - expected).abs() < 4.0 * error + 0.01, "{} {expected} +- {error}", samples.events);
    let largest = samples.largest_event_share.unwrap();
    assert!(largest > 0.3 && largest < 0.8, "{largest}");
}

#[test]
fn quiet_years_have_a_dose_too_but_rarely() {
    let mission =
        mission(&[("launch = 2009-01-01", "launch = 2006-01-01"), ("duration_yr = 5.0", "duration_yr = 0.5")]);
    let model = Model::new(&mission);
    assert_eq!(model.dose_mev_g(0.5).unwrap(), 0.0);
    let doses = SolarEventDoses::of(&mission, model.history(), 4000, 1).unwrap();
    let with_dose =
        (0..4000).filter(|index| doses.steps(*index).iter().any(|(_, dose_mev_g)| *dose_mev_g > 0.0)).count();
    let expected = 1.0 - (-1.6_f64 * 0.5).exp();
    let error = (expected * (1.0 - expected) / 4000.0).sqrt();
    assert!((with_dose as f64 / 4000.0 - expected).abs() < 4.0 * error, "{with_dose} of 4000: {expected} +- {error}");
    assert_eq!((doses.esp_mev_g(0.95), doses.events.active_years()), (0.0, None));
    // Less than in the same time of an active Sun.
    let quiet = Samples::of(&mission, 1000, 1).unwrap();
    let years = [("launch = 2009-01-01", "launch = 2013-01-01"), ("duration_yr = 5.0", "duration_yr = 0.5")];
    let active = Samples::of(&self::mission(&years), 1000, 1).unwrap();
    assert!(quiet.quantiles.iter().zip(&active.quantiles).all(|(quiet, active)| quiet.dose_mev_g < active.dose_mev_g));
}

#[test]
fn maxima_that_are_not_known_yet_are_drawn() {
    let years = |launch: &str| {
        let mission = mission(&[("launch = 2009-01-01", &format!("launch = {launch}"))]);
        SolarEventDoses::of(&mission, Model::new(&mission).history(), 500, 1).unwrap().events.active_years().unwrap()
    };
    let (least, most) = years("2013-01-01");
    assert_eq!(least, most);
    // Expected to be active from 2033.3 to 2040.3.
    let (least, most) = years("2037-06-01");
    assert!(least < 1.5 && most > 4.0, "{least} {most}");
}

#[test]
fn the_same_seed_gives_the_same_bits_with_any_number_of_threads() {
    let arguments = |seed: &'static str| {
        ["dose", SHIELDED, "--set", "mission.launch=2036-06-01", "--samples", "300", "--seed", seed, "--json"]
    };
    let [one, two, other] =
        [("5", "1"), ("5", "2"), ("6", "2")].map(|(seed, threads)| ctiplan(&arguments(seed), threads).stdout);
    assert!(!one.is_empty() && one == two && one != other);
}

#[test]
fn more_samples_narrow_the_errors() {
    let mission = mission(&[]);
    let [few, many] = [400, 6400].map(|count| Samples::of(&mission, count, 1).unwrap());
    for (few, many) in few.quantiles.iter().zip(&many.quantiles) {
        // A quarter; an error of few samples is known to a third of itself.
        assert!(many.error < 0.5 * few.error, "{few:?} {many:?}");
        assert!((few.dose_mev_g - many.dose_mev_g).abs() < 4.0 * few.error, "{few:?} {many:?}");
    }
}

#[test]
fn other_sources_are_the_same_in_all_samples_and_the_field_keeps_events_off() {
    let low = low_orbit();
    let samples = Samples::of(&low, 300, 1).unwrap();
    let found = survey(&low, &[10.0]).unwrap();
    let (solar, others): (Vec<_>, Vec<_>) = found.sources.iter().partition(|source| source.name == "solar-protons");
    let others_mev_g: f64 = others.iter().map(|source| source.total_mev_g).sum();
    assert!(others_mev_g > 0.0 && (samples.others_mev_g / others_mev_g - 1.0).abs() < 1e-12);
    assert!(samples.quantiles.iter().all(|at| at.dose_mev_g > others_mev_g));
    // Behind the same cutoff as the source that is not drawn.
    let at_95 = samples.quantiles.iter().find(|at| at.p == 0.95).unwrap();
    let esp_mev_g = at_95.esp_mev_g.unwrap() - others_mev_g;
    assert!((esp_mev_g / solar[0].total_mev_g - 1.0).abs() < 1e-3, "{esp_mev_g} {}", solar[0].total_mev_g);
    let free = mission(&[]);
    let outside = Samples::of(&free, 300, 1).unwrap();
    assert!(outside.quantiles[4].esp_mev_g.unwrap() > 1.5 * esp_mev_g);
}

#[test]
fn json_and_csv_have_the_quantiles_year_by_year() {
    let found = &json(&["dose", SHIELDED, "--samples", "200"]);
    let samples = &found["samples"];
    assert_eq!((&samples["samples"], &samples["seed"]), (&Value::from(200), &Value::from(1)));
    let quantiles = samples["quantiles"].as_array().unwrap();
    let known: Vec<f64> = quantiles.iter().map(|at| at["p"].as_f64().unwrap()).collect();
    assert_eq!(known, QUANTILES);
    assert!(quantiles.iter().all(|at| at["dose_mev_g"].as_f64() > Some(0.0) && at["error"].as_f64() > Some(0.0)));
    let years = samples["years"].as_array().unwrap();
    assert_eq!(years.len(), found["years"].as_array().unwrap().len());
    let medians: Vec<f64> = years.iter().map(|year| year["quantiles"][2]["dose_mev_g"].as_f64().unwrap()).collect();
    assert!(medians.is_sorted());
    assert_eq!(*medians.last().unwrap(), quantiles[2]["dose_mev_g"].as_f64().unwrap());
    let csv = String::from_utf8(ctiplan(&["dose", SHIELDED, "--samples", "200", "--csv"], "2").stdout).unwrap();
    assert!(csv.lines().next().unwrap().ends_with(",cumulative_p95_mev_g,cumulative_p95_error_mev_g"), "{csv}");
    assert!(json(&["dose", SHIELDED]).get("samples").is_none());
}

#[test]
fn a_sun_that_makes_no_dose_is_not_drawn() {
    for (arguments, said) in [
        (&["missions/snap_l2.toml", "--samples", "500"][..], "active_dose_rate_mev_g_yr gives its dose"),
        (
            &[
                SHIELDED,
                "--samples",
                "500",
                "--set",
                "environment.model=derived",
                "--set",
                "environment.sources=cosmic-rays",
            ],
            "no \"solar-protons\"",
        ),
        (&[SHIELDED, "--samples", "99"], "a whole number from 100 to 100000"),
        (&[SHIELDED, "--samples", "100001"], "a whole number from 100 to 100000"),
        (&[SHIELDED, "--seed", "3"], "--samples"),
    ] {
        let output = ctiplan(&[&["dose"], arguments].concat(), "2");
        let stderr = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {stderr}");
        assert!(output.stdout.is_empty() && stderr.contains(said), "{arguments:?}: {stderr}");
    }
}
