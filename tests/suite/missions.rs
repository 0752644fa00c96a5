//! Every mission file runs and has a sane verdict; every broken one says why, in exactly the words stored beside it.

use std::fs;
use std::path::PathBuf;

use ctiplan::mission::Mission;
use ctiplan::plan::evaluate::evaluate;

fn files(folder: &str) -> Vec<PathBuf> {
    let mut files: Vec<PathBuf> = fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|extension| extension == "toml"))
        .collect();
    files.sort();
    files
}

/// What no dose at all may change.
const ROUNDING: f64 = 1e-12;

#[test]
fn every_mission_runs() {
    let files = files("missions");
    assert!(files.len() >= 6);
    for file in files {
        let name = file.display();
        let mission = Mission::read(&file).unwrap_or_else(|error| panic!("{error}"));
        let evaluation = evaluate(&mission).unwrap();
        let mut before = 0.0;
        for year in &evaluation.years {
            assert!(year.dose_mev_g >= before, "{name}: dose falls");
            before = year.dose_mev_g;
            for change in &year.galaxies {
                let change = change.unwrap_or_else(|| panic!("{name}: no shape after {} yr", year.t_yr));
                // Traps trail charge away from the register.
                assert!(
                    change.delta_e1 < ROUNDING && change.delta_y_px > -ROUNDING && change.delta_flux < ROUNDING,
                    "{name}"
                );
                assert!(change.magnitude() < 1.0, "{name}");
            }
        }
        let verdict = &evaluation.verdict;
        if let (Some(first), Some(second)) = (verdict.uncorrected.t_yr, verdict.corrected.t_yr) {
            assert!(first <= second, "{name}: correction makes it worse");
        }
        assert!(verdict.corrected.t_yr.is_none() || verdict.uncorrected.t_yr.is_some(), "{name}");
    }
}

/// A line time or release times in another unit, and a reference temperature that is not that of the release times, are named.
#[test]
fn times_that_do_not_go_together_are_named() {
    let mission = |settings: &[(&str, f64)]| {
        let settings: Vec<_> = settings.iter().map(|(key, value)| (key.to_string(), (*value).into())).collect();
        Mission::read("missions/snap_l2.toml").unwrap().with(&settings).unwrap()
    };
    let warnings = |settings: &[(&str, f64)]| -> Vec<String> {
        evaluate(&mission(settings)).unwrap().warnings.iter().map(ToString::to_string).collect()
    };
    let species = |factor: f64| {
        let times = [("Ci", 250.0), ("VV", 12.15), ("CO", 5000.0)];
        times.map(|(name, ms)| (format!("detector.traps.{name}.release_ms"), factor * ms))
    };
    let line_s: &[(&str, f64)] = &[("readout.line_time_ms", 0.025)];
    let line_us: &[(&str, f64)] = &[("readout.line_time_ms", 25_000.0)];
    let slow = species(1e6);
    let slow: Vec<(&str, f64)> = slow.iter().map(|(key, value)| (key.as_str(), *value)).collect();
    let fast = species(1e-5);
    let fast: Vec<(&str, f64)> = fast.iter().map(|(key, value)| (key.as_str(), *value)).collect();
    let reference: &[(&str, f64)] = &[("detector.reference_temperature_k", 100.0)];
    let hot: &[(&str, f64)] = &[("detector.temperature_k", 188.0)];
    for (settings, said) in [
        (line_s, "with readout.line_time_ms = 0.025 a row of 1650 pixels, as of a square frame, is read at 66 million"),
        (line_us, "with readout.line_time_ms = 25000 a readout takes 11.5 h"),
        (&slow, "no species releases at a time that the readout notices"),
        (&fast, "no species releases at a time that the readout notices"),
        (reference, "ms at 100 K (detector.reference_temperature_k)"),
        (hot, "ms at 133 K (detector.reference_temperature_k)"),
    ] {
        let found = warnings(settings);
        assert!(found.iter().any(|warning| warning.contains(said)), "{settings:?}: {found:?}");
    }
    for settings in [&[][..], &[("readout.line_time_ms", 100.0)], &[("detector.temperature_k", 137.0)]] {
        let doubted = ["a readout takes", "a row of", "no species releases", "reference_temperature_k"];
        let found = warnings(settings);
        assert!(!found.iter().any(|warning| doubted.iter().any(|said| warning.contains(said))), "{found:?}");
    }
}

#[test]
fn a_resolved_mission_is_the_same_mission() {
    for file in files("missions") {
        let mission = Mission::read(&file).unwrap();
        assert_eq!(Mission::parse(&mission.to_toml()).unwrap(), mission, "{}", file.display());
    }
}

#[test]
fn every_broken_mission_says_why() {
    let files = files("missions/broken");
    assert!(files.len() >= 25);
    for file in files {
        let expected = fs::read_to_string(file.with_extension("stderr")).unwrap();
        let error = Mission::read(&file).expect_err(&format!("{} was accepted", file.display()));
        assert_eq!(format!("error: {error}\n"), expected, "{}", file.display());
    }
}

#[test]
fn keys_are_set_by_their_dotted_paths() {
    let mission = Mission::read("missions/snap_l2.toml").unwrap();
    let set = |key: &str, value: toml::Value| mission.with(&[(key.to_string(), value)]);
    assert_eq!(set("readout.transfers", 800.into()).unwrap().readout.transfers, 800);
    assert_eq!(set("detector.traps.VV.release_ms", 3.5.into()).unwrap().detector.traps[1].release_ms, 3.5);
    assert_eq!(set("galaxies.large.weight_px", 6.0.into()).unwrap().galaxies[2].weight_px, 6.0);
    assert_eq!(mission.number("detector.traps.CO.density_per_px"), Some(0.7));
    for (key, value) in [("readout.transfers", -1), ("readout.transfer", 5), ("galaxies.huge.weight_px", 5)] {
        assert!(set(key, value.into()).is_err(), "{key}");
    }
}

#[test]
fn missions_that_never_see_dose_or_span_cycles_are_judged() {
    let mission = Mission::read("missions/two_maxima.toml").unwrap();
    let with = |settings: &[(&str, toml::Value)]| {
        let settings: Vec<_> = settings.iter().map(|(key, value)| (key.to_string(), value.clone())).collect();
        evaluate(&mission.with(&settings).unwrap()).unwrap()
    };
    // Launched just after the active years of cycle 24, for three of the four quiet ones.
    let quiet = with(&[
        ("mission.launch", "2019-01-01".parse::<toml::value::Datetime>().unwrap().into()),
        ("mission.duration_yr", 3.0.into()),
    ]);
    assert_eq!(quiet.years.last().unwrap().dose_mev_g, 0.0);
    assert_eq!(quiet.verdict.uncorrected.t_yr, None);
    assert_eq!(quiet.verdict.mean_rate_per_yr.map(|rate| rate < 1e-12), Some(true));
    // 15 years from 2011.5: active from 2011.8 to 2018.8 and from 2022.3 to the end, 2026.5.
    let cycles = with(&[]);
    let active = cycles.model.history().active_years(15.0);
    assert!((active - (7.0 + 4.196)).abs() < 0.01, "{active}");
    // A budget that is used up between the two maxima's active years is exceeded within active years, never in between.
    for budget in [5e-4, 1.5e-3, 1.8e-3, 2.5e-3] {
        let t_yr = with(&[("requirement.delta_e", budget.into())]).verdict.uncorrected.t_yr.unwrap();
        assert!(!(7.3..=10.8).contains(&t_yr), "{budget}: {t_yr}");
    }
}

#[test]
fn quantiles_add_up_as_asked() {
    let mission = Mission::read("missions/snap_l2_shielded.toml").unwrap();
    let dose = |accumulate: &str, duration: f64, confidence: f64| {
        let settings = [
            ("environment.accumulate".to_string(), accumulate.into()),
            ("mission.duration_yr".to_string(), duration.into()),
            ("environment.confidence".to_string(), confidence.into()),
        ];
        evaluate(&mission.with(&settings).unwrap()).unwrap().years.last().unwrap().dose_mev_g
    };
    // Launched in 2009, active from 2011.8: one active year after 3.8 years, for which both are the same.
    let (yearly, sum) = (dose("yearly", 3.8, 0.95), dose("mission", 3.8, 0.95));
    assert!((yearly / sum - 1.0).abs() < 1e-9, "{yearly} {sum}");
    // Less than one active year counts as one in the quantile of the sum, not in the yearly rate.
    assert!((dose("mission", 3.3, 0.95) / sum - 1.0).abs() < 1e-9);
    assert!((dose("yearly", 3.3, 0.95) / yearly - 0.5).abs() < 1e-9);
    // Rare bad years: at 50 % the sum is more than twice the yearly quantile, at 99 % less.
    assert!(dose("mission", 4.8, 0.5) > dose("yearly", 4.8, 0.5));
    assert!(dose("mission", 4.8, 0.99) < dose("yearly", 4.8, 0.99));
}
