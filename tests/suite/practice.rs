//! Cases made by another simulator (ArCTIc, every transfer followed; galaxies drawn with GalSim), with their truth.

use std::fs;
use std::path::Path;

use ctiplan::analysis::fit::{Fit, Options, fit};
use ctiplan::analysis::measurement::{DataSet, questions};
use ctiplan::analysis::validate::{Claim, Validation, validate};
use ctiplan::io::table::Table;
use ctiplan::mission::Mission;
use ctiplan::model::Model;
use ctiplan::model::predict::predict;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use serde_json::Value;

fn read(case: &str, add: &str) -> (Mission, Vec<DataSet>) {
    let folder = format!("tests/practice/{case}");
    let mission = Mission::parse(&format!("{}\n{add}", fs::read_to_string(format!("{folder}/mission.toml")).unwrap()));
    let mission = mission.unwrap_or_else(|error| panic!("{error}"));
    let truth: Value = serde_json::from_str(&fs::read_to_string(format!("{folder}/truth.json")).unwrap()).unwrap();
    let files = truth["files"].as_array().unwrap();
    let data =
        files.iter().map(|file| DataSet::read(format!("{folder}/{}", file.as_str().unwrap()), &mission).unwrap());
    let data = data.collect();
    (mission, data)
}

fn validated(case: &str, add: &str) -> Validation {
    let (mission, data) = read(case, add);
    validate(&mission, &data, 1).unwrap()
}

fn fitted(mission: &Mission, data: &[DataSet], keys: &[&str]) -> Fit {
    let keys: Vec<String> = keys.iter().map(ToString::to_string).collect();
    fit(mission, data, &keys, &Options::default(), &|_| {}).unwrap()
}

/// With what was really there the model explains every case.
#[test]
fn the_truth_is_within_the_noise() {
    for (case, truth) in [
        ("nothing-missing", ""),
        ("slow-trap", "[effects.extra-species]\ndensity_per_px = 0.7\nrelease_ms = 5000.0\n"),
        ("prelaunch", "[effects.prelaunch-traps]\nfast = 0.06\nmid = 0.15\nslow = 0.12\n"),
        ("notch", "[effects.notch]\nnotch_e = 60.0\n"),
        ("flare", "[effects.solar-flare]\nt_yr = 2.6\ndose_mev_g = 1.9e6\n"),
        (
            "slow-trap-and-annealing",
            "[effects.extra-species]\ndensity_per_px = 1.6\nrelease_ms = 250.0\n[effects.annealing]\ntime_yr = 6.0\n",
        ),
        (
            "gain-drift",
            "[effects.formula]\ntarget = \"value\"\nexpression = \"value * (1 + 0.004 * t_yr - 0.0011 * t_yr^2)\"\n",
        ),
    ] {
        let validation = validated(case, truth);
        for set in &validation.sets {
            let n = set.data.rows.len() as f64;
            // chi2 of n rows is n ± √(2n).
            assert!((set.chi2 - n).abs() < 3.5 * (2.0 * n).sqrt(), "{case}, {}: chi2 {} of {n}", set.name(), set.chi2);
        }
        assert!(validation.words().is_empty(), "{case}: {:?}", validation.words());
    }
}

/// Without it the residuals trend where they should, and the words say so.
#[test]
fn what_is_missing_shows_where_it_should() {
    for (case, set, condition, said) in [
        (
            "slow-trap",
            1,
            "transfers",
            "packets.ecsv: model loses too little charge at all transfers, most at 1500 to 1700",
        ),
        ("prelaunch", 0, "trail_px", "trails.ecsv: model's trail too faint up to trail_px 12, at all epochs"),
        ("flare", 0, "t_yr", "dose.ecsv: model's dose too small from t_yr 2.75 on"),
    ] {
        let validation = validated(case, "");
        let trend = validation.trends.iter().find(|trend| trend.set == set).unwrap();
        assert_eq!(trend.name, condition, "{case}");
        assert!(trend.false_alarm < 1e-6, "{case}: {}", trend.false_alarm);
        assert!(validation.words().iter().any(|word| word == said), "{case}: {:#?}", validation.words());
    }
    let drift = validated("gain-drift", "");
    assert_eq!(drift.trends[0].name, "t_yr");
    let notch = validated("notch", "");
    assert_eq!(notch.trends[0].name, "signal_e");
}

/// The paper's own story: two species fitted to trails and packets leave a residual that trends on trail_px and on
/// transfers; a third, slow one brings chi2 per row to 1, and comes out within its errors.
#[test]
fn the_story_of_the_paper() {
    let (mission, data) = read("slow-trap", "");
    let free = ["detector.traps.Ci.density_per_px", "detector.traps.VV.density_per_px"];
    assert_eq!(mission.fit.free, free);
    let two = fitted(&mission, &data, &free);
    assert!(two.chi2 / two.n as f64 > 20.0);
    let left = validate(&two.mission, &data, 1).unwrap();
    // What free densities could not absorb: nearly all of it in the trail.
    for (condition, alarm) in [("trail_px", 1e-6), ("transfers", 0.05)] {
        let trend = left.trends.iter().find(|trend| trend.name == condition).unwrap();
        assert!(trend.false_alarm < alarm, "{condition}: {}", trend.false_alarm);
    }
    let (mission, data) = read("slow-trap", "[effects.extra-species]\ndensity_per_px = 0.2\nrelease_ms = 1000.0\n");
    let mut keys = free.to_vec();
    keys.extend(["effects.extra-species.density_per_px", "effects.extra-species.release_ms"]);
    let three = fitted(&mission, &data, &keys);
    let per_row = three.chi2 / three.degrees_of_freedom() as f64;
    assert!((0.5..1.5).contains(&per_row), "{per_row}");
    within(&three, &[0.35, 0.49, 0.7, 5000.0]);
    // The release time is far beyond the trail, and known worse towards longer ones: up to where chi2 rises by 1.
    let release = &three.parameters[3];
    let slower = (release.key.clone(), (release.value + release.sigma.unwrap()).into());
    let held = fitted(&three.mission.with(&[slower]).unwrap(), &data, &keys[..3]);
    assert!((0.75..1.1).contains(&(held.chi2 - three.chi2)), "{} {}", held.chi2, three.chi2);
}

/// True values within three errors, and errors that say something.
fn within(fit: &Fit, truths: &[f64]) {
    for (parameter, truth) in fit.parameters.iter().zip(truths) {
        let sigma = parameter.sigma.unwrap_or_else(|| panic!("{} has no error", parameter.key));
        assert!(
            (parameter.value - truth).abs() < 3.0 * sigma,
            "{}: {} +- {sigma}, truth {truth}",
            parameter.key,
            parameter.value
        );
        let size = truth.abs().max(parameter.value.abs());
        assert!(sigma < 0.7 * size, "{}: {} +- {sigma}", parameter.key, parameter.value);
    }
}

#[test]
#[ignore = "slow: .ci/run runs it"]
fn known_parameters_come_out_within_their_errors() {
    let (mission, data) = read("prelaunch", "[effects.prelaunch-traps]\nfast = 0.01\nmid = 0.01\nslow = 0.01\n");
    let keys = ["fast", "mid", "slow"].map(|name| format!("effects.prelaunch-traps.{name}"));
    within(&fitted(&mission, &data, &keys.each_ref().map(String::as_str)), &[0.06, 0.15, 0.12]);

    let (mission, data) = read("notch", "[effects.notch]\nnotch_e = 10.0\n");
    let mut keys: Vec<&str> = mission.fit.free.iter().map(String::as_str).collect();
    keys.push("effects.notch.notch_e");
    within(&fitted(&mission, &data, &keys), &[0.17, 0.45, 0.38, 60.0]);

    let (mission, data) = read("flare", "[effects.solar-flare]\nt_yr = 5.0\ndose_mev_g = 1.0e5\n");
    let flare = fitted(&mission, &data, &["effects.solar-flare.t_yr", "effects.solar-flare.dose_mev_g"]);
    within(&flare, &[2.6, 1.9e6]);

    let add =
        "[effects.extra-species]\ndensity_per_px = 0.5\nrelease_ms = 100.0\n[effects.annealing]\ntime_yr = 20.0\n";
    let (mission, data) = read("slow-trap-and-annealing", add);
    let keys =
        ["effects.extra-species.density_per_px", "effects.extra-species.release_ms", "effects.annealing.time_yr"];
    within(&fitted(&mission, &data, &keys), &[1.6, 250.0, 6.0]);

    let add = "[effects.formula]\ntarget = \"value\"\nexpression = \"value * (1 + a * t_yr + b * t_yr^2)\"\na = 0.0\nb = 0.0\n";
    let (mission, data) = read("gain-drift", add);
    within(&fitted(&mission, &data, &["effects.formula.a", "effects.formula.b"]), &[0.004, -0.0011]);
}

/// A flare between epochs of which the data say next to nothing lies in their middle, with the error of a uniform chance.
#[test]
#[ignore = "slow: .ci/run runs it"]
fn a_moment_lies_in_the_middle_of_where_the_data_leave_it() {
    let (mission, mut data) = read("flare", "[effects.solar-flare]\nt_yr = 5.0\ndose_mev_g = 1.0e5\n");
    for row in data.iter_mut().flat_map(|set| &mut set.rows).filter(|row| (1.9..3.6).contains(&row.at.t_yr)) {
        row.sigma *= 1e4;
    }
    let fit = fitted(&mission, &data, &["effects.solar-flare.t_yr", "effects.solar-flare.dose_mev_g"]);
    let [moment, dose] = &fit.parameters[..] else { panic!("two parameters") };
    // Epochs that count: 1.75 and 3.75.
    assert!((moment.value - 2.75).abs() < 0.01, "{}", moment.value);
    let uniform = 2.0 / 12.0_f64.sqrt();
    assert!((moment.sigma.unwrap() - uniform).abs() < 0.05 * uniform, "{:?}", moment.sigma);
    within(&fit, &[2.6, 1.9e6]);
    assert!(dose.sigma.unwrap() < 2e5);
}

/// The error of a moment is that of fits with the moment held in every interval between epochs, each as likely as it is long,
/// times exp(-chi2/2).
#[test]
#[ignore = "slow: .ci/run runs it"]
fn the_error_of_a_moment_is_that_of_all_places_where_it_may_be() {
    let (mission, mut data) = read("flare", "[effects.solar-flare]\nt_yr = 5.0\ndose_mev_g = 1.0e5\n");
    for row in data.iter_mut().flat_map(|set| &mut set.rows) {
        row.sigma *= 25.0;
    }
    let [t_yr, dose] = ["effects.solar-flare.t_yr", "effects.solar-flare.dose_mev_g"];
    let fit = fitted(&mission, &data, &[t_yr, dose]);
    let mut epochs: Vec<f64> = data.iter().flat_map(|set| &set.rows).map(|row| row.at.t_yr).chain([0.0]).collect();
    epochs.sort_by(f64::total_cmp);
    epochs.dedup();
    let (mut all, mut squares, mut doses) = (0.0, 0.0, 0.0);
    for ends in epochs.windows(2) {
        let middle = 0.5 * (ends[0] + ends[1]);
        let there = fit.mission.with(&[(t_yr.into(), middle.into())]).unwrap();
        let held = fitted(&there, &data, &[dose]);
        let likely = (ends[1] - ends[0]) * (-0.5 * (held.chi2 - fit.chi2)).exp();
        all += likely;
        squares += likely * (middle - fit.parameters[0].value).powi(2);
        doses += likely * (held.parameters[0].value - fit.parameters[1].value).powi(2);
    }
    let [moment, size] = [squares, doses].map(|sum: f64| (sum / all).sqrt());
    let sigma = |index: usize| fit.parameters[index].sigma.unwrap();
    assert!(moment > 0.2, "{moment}: more than one interval is likely");
    assert!((sigma(0) - moment).abs() < 0.1 * moment, "{} {moment}", sigma(0));
    let held = fitted(&fit.mission, &data, &[dose]).parameters[0].sigma.unwrap();
    assert!((sigma(1) - held.hypot(size)).abs() < 0.1 * sigma(1), "{} {held} {size}", sigma(1));
}

#[test]
fn a_fit_says_what_the_data_do_not_determine() {
    // One epoch: more traps by a factor, or by their densities, are the same.
    let (mission, data) = read("one-epoch", "[effects.dose-scale]\nfactor = 1.0\n");
    let keys = [
        "effects.dose-scale.factor",
        "detector.traps.fast.density_per_px",
        "detector.traps.mid.density_per_px",
        "detector.traps.slow.density_per_px",
    ];
    let fit = fitted(&mission, &data, &keys);
    let advice: Vec<String> = fit.advice.iter().map(ToString::to_string).collect();
    assert!(advice.iter().any(|advice| advice.contains("degenerate") && advice.contains("dose-scale")), "{advice:?}");
    // At the reference temperature the energy level is of no consequence.
    let fit = fitted(&mission, &data, &["detector.traps.fast.energy_ev", "detector.traps.fast.density_per_px"]);
    let advice: Vec<String> = fit.advice.iter().map(ToString::to_string).collect();
    assert!(
        advice.iter().any(|advice| advice.starts_with("detector.traps.fast.energy_ev: unconstrained")),
        "{advice:?}"
    );
    assert_eq!(fit.parameters[0].sigma, None);
}

/// A real irradiated CCD; its data have a licence of their own and are not part of this project.
#[test]
#[ignore = "slow: .ci/run runs it"]
fn a_real_ccd_is_read_and_fitted() {
    let folder = Path::new("../shared/practice/real-ccd");
    if !folder.exists() {
        crate::skipped::for_want_of(folder.display().to_string());
        return;
    }
    let mission = Mission::read(folder.join("mission.toml")).unwrap();
    let data = vec![DataSet::read(folder.join("eper.ecsv"), &mission).unwrap()];
    let keys: Vec<&str> = mission.fit.free.iter().map(String::as_str).collect();
    let fit = fitted(&mission, &data, &keys);
    assert!(fit.chi2 < 0.01 * fit.chi2_before, "{} of {}", fit.chi2, fit.chi2_before);
}

/// Doses of a mission at so many epochs with noise, whose quoted sigma is so many times too large.
fn doses(mission: &Mission, rows: usize, too_large: f64, seed: u64) -> Vec<DataSet> {
    let epochs = (0..rows).map(|row| format!("{},0,1e4", 0.1 + 4.8 * row as f64 / rows as f64));
    let text = format!("# observable: dose\nt_yr,value,sigma\n{}\n", epochs.collect::<Vec<_>>().join("\n"));
    let mut data = vec![DataSet::of(Table::parse("doses.csv", &text).unwrap(), mission).unwrap()];
    let values = predict(&Model::new(mission), &questions(&data)).unwrap();
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    for (row, value) in data[0].rows.iter_mut().zip(values) {
        let noise: f64 = StandardNormal.sample(&mut random);
        row.value = value + row.sigma * noise / too_large;
    }
    data
}

/// What is claimed of data in which nothing is missing is claimed as seldom as is said, 1 in 1000, from 4 rows on; and the last
/// line names what was claimed.
#[test]
fn errors_are_called_too_large_where_they_are_and_nowhere_else() {
    let mission = Mission::read("missions/snap_l2.toml").unwrap();
    let claims = |rows: usize, too_large: f64, seed: u64| -> Vec<Claim> {
        let validation = validate(&mission, &doses(&mission, rows, too_large, seed), 1).unwrap();
        let claims: Vec<Claim> = validation.findings.iter().map(|finding| finding.claim).collect();
        let (conclusion, trend) = (validation.conclusion(), claims.contains(&Claim::Trend));
        assert_eq!(
            validation.within_noise(),
            conclusion.ends_with("the model agrees with the data within their noise")
        );
        assert_eq!(trend && !validation.exceeds_noise(), conclusion.contains("trend"), "{conclusion} {claims:?}");
        claims
    };
    let sizes = [4, 5, 6, 8, 12, 21, 24, 30, 56, 100];
    let mut wrong = 0;
    for (index, rows) in sizes.into_iter().enumerate() {
        for seed in 0..60 {
            let claims = claims(rows, 1.0, 1000 * index as u64 + seed);
            wrong += usize::from(claims.contains(&Claim::LargeErrors) || claims.contains(&Claim::SmallErrors));
        }
        // Ten times too large: 94 % of sets of 4 rows show that, and nearly all larger ones.
        let seen = (0..20).filter(|seed| claims(rows, 10.0, *seed).contains(&Claim::LargeErrors)).count();
        assert!(seen >= 16, "{rows} rows: {seen} of 20");
    }
    // 600 sets at 1e-3: more than 4 have a chance of 4e-4.
    assert!(wrong <= 4, "{wrong} of 600");
}
