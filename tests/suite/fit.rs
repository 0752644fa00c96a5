//! What a fit says of values that the data hardly know.

use std::path::Path;

use ctiplan::analysis::fit::{Advice, Fit, Options, fit};
use ctiplan::analysis::measurement::{DataSet, questions};
use ctiplan::analysis::validate::validate;
use ctiplan::io::table::Table;
use ctiplan::mission::Mission;
use ctiplan::mission_file;
use ctiplan::model::Model;
use ctiplan::model::predict::predict;
use ctiplan::numeric::calendar::decimal_year;
use ctiplan::report::{FitReport, Format, Report};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

const RELEASE: &str = "detector.traps.VV.release_ms";

/// A laboratory's trails and packets at 25 ms a line, as a model with another release time of the second species makes them,
/// with noise.
fn measured(release_ms: f64, seed: u64) -> (Mission, Vec<DataSet>) {
    let folder = Path::new("tests/practice/slow-trap");
    let mission = Mission::read(folder.join("mission.toml")).unwrap();
    let mut data = ["trails", "packets"]
        .map(|name| DataSet::read(folder.join(format!("{name}.ecsv")), &mission).unwrap())
        .to_vec();
    let truth = mission.with(&[(RELEASE.into(), release_ms.into())]).unwrap();
    let values = predict(&Model::new(&truth), &questions(&data)).unwrap();
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    for (row, value) in data.iter_mut().flat_map(|set| &mut set.rows).zip(values) {
        let noise: f64 = StandardNormal.sample(&mut random);
        row.value = value + noise * row.sigma;
    }
    (mission, data)
}

fn fitted(mission: &Mission, data: &[DataSet], keys: &[&str]) -> Fit {
    let keys: Vec<String> = keys.iter().map(ToString::to_string).collect();
    fit(mission, data, &keys, &Options::default(), &|_| {}).unwrap()
}

/// Measured densities of a species at four doses, by three instruments whose zero levels have an error each: value, error and chi2 are those of
/// generalised least squares with the covariance matrix, and `validate` has that chi2.
#[test]
fn errors_in_common_are_those_of_the_covariance_matrix() {
    const KEY: &str = "detector.traps.VV.density_per_px";
    let mission = Mission::read("missions/snap_l2.toml").unwrap();
    let sigmas = [(0.013, 0.012), (0.03, 0.02), (0.025, 0.0)];
    let mut random = ChaCha8Rng::seed_from_u64(4);
    let mut drawn = || -> f64 { StandardNormal.sample(&mut random) };
    let off = sigmas.map(|(_, common)| common * drawn());
    let mut text =
        "# observable: trap_density\n# species: VV\ndose_mev_g,value,sigma,sigma_common,common_group\n".to_string();
    for dose_mev_g in [2e6, 4e6, 8e6, 1.6e7] {
        for (instrument, (sigma, common)) in sigmas.iter().enumerate() {
            let own = f64::sqrt(sigma * sigma - common * common) * drawn();
            let value = 2e-8 * dose_mev_g + off[instrument] + own;
            text += &format!("{dose_mev_g},{value},{sigma},{common},{instrument}\n");
        }
    }
    let data = [DataSet::of(Table::parse("densities.csv", &text).unwrap(), &mission).unwrap()];
    let rows = &data[0].rows;
    let n = rows.len();
    let covariance = nalgebra::DMatrix::from_fn(n, n, |i, j| match (i == j, i % 3 == j % 3) {
        (true, _) => rows[i].sigma.powi(2),
        (_, true) => rows[i].common.sigma * rows[j].common.sigma,
        _ => 0.0,
    });
    let weights = covariance.try_inverse().unwrap();
    let model = nalgebra::DVector::from_vec(predict(&Model::new(&mission), &questions(&data)).unwrap());
    let values = nalgebra::DVector::from_iterator(n, rows.iter().map(|row| row.value));
    let weight = model.dot(&(&weights * &model));
    let factor = model.dot(&(&weights * &values)) / weight;
    let left = values - factor * &model;
    let chi2 = left.dot(&(&weights * &left));

    let found = fitted(&mission, &data, &[KEY]);
    let density = &found.parameters[0];
    // The solver ends when steps are below 1e-6; chi2 is quadratic there.
    assert!((density.value / (factor * density.before) - 1.0).abs() < 1e-6, "{density:?}, {factor}");
    assert!((density.sigma.unwrap() / (density.before / weight.sqrt()) - 1.0).abs() < 1e-6, "{density:?}, {weight}");
    assert!((found.chi2 / chi2 - 1.0).abs() < 1e-9, "{}, {chi2}", found.chi2);
    let validation = validate(&found.mission, &data, 1).unwrap();
    assert!((validation.chi2 / chi2 - 1.0).abs() < 1e-9, "{}, {chi2}", validation.chi2);
    assert!(validation.render(Format::Text).contains("sigma_common"));
}

/// Of traps that have let go of everything before the next pixel comes, the data only say that they are fast: the value stays
/// where that begins, and its error says that nothing is known.
#[test]
fn a_value_that_moves_nothing_does_not_run_away() {
    for seed in 1..5 {
        let (mission, data) = measured(0.5, seed);
        let found = fitted(&mission, &data, &[RELEASE]);
        let release = &found.parameters[0];
        assert!(release.value > 0.05 && release.value < 5.0, "seed {seed}: {release:?}");
        assert!(release.sigma.is_none_or(|sigma| sigma > 0.3 * release.value), "seed {seed}: {release:?}");
        let (truth, _) = measured(0.5, seed);
        let best = truth.with(&[(RELEASE.into(), 0.5.into())]).unwrap();
        let chi2 = fitted(&best, &data, &[]).chi2;
        assert!(found.chi2 < chi2 + 0.1, "seed {seed}: {} {chi2}", found.chi2);
    }
}

/// A release time far below or above what the data span has a limit on one side, and that is told; one that they know has none.
#[test]
fn a_limit_on_one_side_only_is_told() {
    let density = "detector.traps.VV.density_per_px";
    let open = |release_ms: f64| -> Vec<bool> {
        let (mission, data) = measured(release_ms, 1);
        let start = mission.with(&[(RELEASE.into(), release_ms.into())]).unwrap();
        let found = fitted(&start, &data, &[density, RELEASE]);
        let side = |advice: &Advice| match advice {
            Advice::Open { key, above, rise, .. } => {
                assert!(key == RELEASE && *rise < 9.0, "{advice:?}");
                Some(*above)
            }
            _ => None,
        };
        found.advice.iter().filter_map(side).collect()
    };
    assert_eq!([3.0, 12.15, 30_000.0].map(open), [vec![false], vec![], vec![true]]);
}

/// With errors a thousand times larger no release time is excluded: that is said once, and no error is shown.
#[test]
fn a_value_that_the_data_do_not_determine_has_no_error() {
    let (mission, mut data) = measured(12.15, 1);
    data.iter_mut().flat_map(|set| &mut set.rows).for_each(|row| row.sigma *= 1000.0);
    let found = fitted(&mission, &data, &[RELEASE]);
    let [Advice::Undetermined { key, between, rise, .. }] = &found.advice[..] else { panic!("{:?}", found.advice) };
    let value = found.parameters[0].value;
    assert!(key == RELEASE && between[0] < value && value < between[1] && *rise < 9.0, "{:?}", found.advice);
    let report =
        FitReport { fit: found, holdout: None, profiles: Vec::new(), posterior: None, has_common_errors: false };
    let said = report.text();
    let row = said.lines().find(|line| line.trim_start().starts_with(RELEASE)).unwrap();
    assert!(row.contains("not determined"), "{said}");
    assert!(said.contains("not determined; from") && !said.contains("poorly constrained"), "{said}");
}

/// A full well a hundredth as large would lie below the notch: that side is closed, and the fit is not refused for it.
#[test]
fn values_that_make_no_sense_limit_a_parameter() {
    let (mission, mut data) = measured(12.15, 1);
    let full_well = "detector.full_well_e";
    let mission = mission.with(&[(full_well.into(), 5e4.into()), ("detector.notch_e".into(), 1000.0.into())]).unwrap();
    let values = predict(&Model::new(&mission), &questions(&data)).unwrap();
    for (row, value) in data.iter_mut().flat_map(|set| &mut set.rows).zip(values) {
        (row.value, row.sigma) = (value, 150.0 * row.sigma);
    }
    let found = fitted(&mission, &data, &[full_well]);
    let fitted = &found.parameters[0];
    assert!(fitted.sigma.unwrap() > 0.3 * fitted.value, "the case shows nothing: {fitted:?}");
    let below = |advice: &Advice| matches!(advice, Advice::Open { above: false, .. });
    assert!(!found.advice.iter().any(below), "{:?}", found.advice);
}

/// A maximum three periods ago is the same as one during the mission, and stands there.
#[test]
fn a_cycle_keeps_its_maximum_near_the_mission() {
    let mission = Mission::read("missions/snap_l2.toml").unwrap();
    let middle = decimal_year(mission.mission.launch.0) + 0.5 * mission.mission.duration_yr;
    let with = |peak: f64| {
        let text = format!("amplitude = 0.4\nperiod_yr = 7.0\npeak = {peak}\n");
        mission_file::add_effect(&mission, "cycle", text.parse().unwrap()).unwrap().0
    };
    let epochs: Vec<f64> = (1..=10).map(|epoch| 0.5 * f64::from(epoch)).collect();
    let rows = epochs.iter().map(|t_yr| format!("{t_yr},0.0,1e4\n")).collect::<String>();
    let table = Table::parse("dose.csv", &format!("# observable: dose\nt_yr,value,sigma\n{rows}")).unwrap();
    let mut data = [DataSet::of(table, &mission).unwrap()];
    let values = predict(&Model::new(&with(middle + 1.5)), &questions(&data)).unwrap();
    data[0].rows.iter_mut().zip(values).for_each(|(row, value)| row.value = value);
    let found = fitted(&with(middle + 1.7 - 21.0), &data, &["effects.cycle.amplitude", "effects.cycle.peak"]);
    let (peak, sigma) = (found.parameters[1].value, found.parameters[1].sigma.unwrap());
    assert!((peak - middle - 1.5).abs() < 0.01 && sigma < 0.1, "{:?}", found.parameters);
    assert_eq!(found.parameters[1].before, middle + 1.7 - 21.0);
}

/// An error is as far as chi2 rises by 1, the other parameter following, to that side where it is farther.
#[test]
fn an_error_reaches_to_where_chi2_rises_by_one() {
    let density = "detector.traps.VV.density_per_px";
    let mut curved = 0;
    for (release_ms, seed) in [(5.0, 1), (5.0, 2), (12.15, 1)] {
        let (mission, data) = measured(release_ms, seed);
        let found = fitted(&mission, &data, &[density, RELEASE]);
        let sigma = found.parameters[1].sigma.unwrap();
        let rise = |side: f64| {
            let held = found.parameters[1].value + side * sigma;
            let there = found.mission.with(&[(RELEASE.into(), held.max(1e-3).into())]).unwrap();
            fitted(&there, &data, &[density]).chi2 - found.chi2
        };
        let rises = [rise(-1.0), rise(1.0)];
        let least = rises[0].min(rises[1]);
        assert!((0.75..1.1).contains(&least), "{release_ms} ms, seed {seed}: {rises:?}");
        curved += usize::from(rises[0].max(rises[1]) > 1.5);
    }
    assert!(curved > 0, "none of these is curved");
}

const NOTCH: &str = "effects.notch.notch_e";

/// With a readout that is fine enough for these errors, and quicker.
fn coarse(mission: Mission) -> Mission {
    mission.with(&[("accuracy.relative".into(), 1e-4.into())]).unwrap()
}

/// A packet that just about sinks into a notch: chi2 has a kink at the background and a minimum on either side.
fn at_the_background(notch_e: f64) -> (Mission, Vec<DataSet>) {
    let folder = Path::new("tests/corpus/edge/notch-at-the-background");
    let mission = Mission::read(folder.join("mission.toml")).unwrap();
    let (mission, _) = mission_file::add_effect(&mission, "notch", toml::toml! { notch_e = 1.0 }).unwrap();
    let mission = coarse(mission.with(&[(NOTCH.into(), notch_e.into())]).unwrap());
    let data = vec![DataSet::read(folder.join("trails.ecsv"), &mission).unwrap()];
    (mission, data)
}

/// chi2 is the same from wherever a fit starts, and where it has several minima, that is said.
#[test]
fn a_fit_ends_at_the_same_chi2_from_all_starting_values() {
    let mut least = f64::INFINITY;
    let mut others = 0;
    for notch_e in [5.0, 20.0, 400.0] {
        let (mission, data) = at_the_background(notch_e);
        let found = fitted(&mission, &data, &[NOTCH]);
        others += usize::from(!found.is_optimum(found.chi2_from_mission) && !found.minima.is_empty());
        least = least.min(found.chi2);
        assert!(found.chi2 < least + TOLERANCE, "from {notch_e}: {} {least}", found.chi2);
    }
    assert_eq!(others, 3, "each of these starts leads to another minimum");
}

/// How exactly chi2 is known where it has a kink.
const TOLERANCE: f64 = 0.1;

/// With more that is free chi2 is no larger, on data of several kinds and noise of several seeds.
#[test]
#[ignore = "slow: .ci/run runs it"]
fn a_superset_of_free_keys_ends_no_higher() {
    let densities = ["detector.traps.Ci.density_per_px", "detector.traps.VV.density_per_px"];
    let power = "detector.well_fill_power";
    let chains: [&[&str]; 3] =
        [&[NOTCH, power, densities[1]], &[power, NOTCH, densities[0]], &[densities[1], power, NOTCH]];
    let mut checked = 0;
    let mut check = |mission: &Mission, data: &[DataSet], chain: &[&str]| {
        let chi2: Vec<f64> = (1..=chain.len()).map(|count| fitted(mission, data, &chain[..count]).chi2).collect();
        for pair in chi2.windows(2) {
            assert!(pair[1] <= pair[0] + TOLERANCE, "{chain:?}: {chi2:?}");
            checked += 1;
        }
    };
    let (mission, data) = at_the_background(20.0);
    for chain in chains {
        check(&mission, &data, chain);
    }
    for (release_ms, seed) in [(5.0, 1), (12.15, 2)] {
        let (mission, data) = measured(release_ms, seed);
        let mission = coarse(mission);
        check(&mission, &data, &[RELEASE, densities[1], power]);
        check(&mission, &data, &[power, densities[0], RELEASE]);
    }
    assert_eq!(checked, 14);
}

/// Trails of packets of several charges say how the capture rate depends on the density of their clouds.
#[test]
fn the_power_of_the_density_in_the_capture_rate_is_fitted() {
    let power = "effects.finite-capture.density_power";
    let snap = include_str!("../../missions/snap_l2.toml");
    let mission = Mission::parse(&format!("{snap}\n[effects.finite-capture]\ncapture_ms = 3.0\n")).unwrap();
    let truth = mission.with(&[(power.into(), 0.8.into())]).unwrap();
    let rows =
        [100, 1000, 10_000, 60_000].map(|signal_e| [1, 2, 3].map(|trail_px| format!("{signal_e},{trail_px},0,1e-5\n")));
    let text = format!("# observable: trail\n# t_yr: 5\nsignal_e,trail_px,value,sigma\n{}", rows.concat().concat());
    let mut data = vec![DataSet::of(Table::parse("trails.csv", &text).unwrap(), &mission).unwrap()];
    let values = predict(&Model::new(&truth), &questions(&data)).unwrap();
    let mut random = ChaCha8Rng::seed_from_u64(5);
    for (row, value) in data[0].rows.iter_mut().zip(values) {
        let noise: f64 = StandardNormal.sample(&mut random);
        row.value = value + noise * row.sigma;
    }
    let found = fitted(&mission, &data, &[power]);
    let sigma = found.parameters[0].sigma.unwrap();
    assert!((found.parameters[0].value - 0.8).abs() < 3.5 * sigma && sigma < 0.02, "{:?}", found.parameters[0]);
}

/// Two species whose values are exchanged are the same model at one temperature: they keep the order of their release times. At two
/// temperatures their energy levels tell them apart, and that they were given in the wrong order is said.
#[test]
fn species_keep_the_order_of_their_release_times() {
    let keys = ["Ci.release_ms", "VV.release_ms", "Ci.density_per_px", "VV.density_per_px"]
        .map(|key| format!("detector.traps.{key}"));
    let mission = Mission::read("missions/snap_l2.toml").unwrap();
    let with = |values: [f64; 4]| {
        let values: Vec<_> = keys.iter().cloned().zip(values.map(Into::into)).collect();
        mission.with(&values).unwrap()
    };
    let (truth, given) = (with([160.0, 40.0, 0.5, 0.3]), with([70.0, 80.0, 0.4, 0.4]));
    let of = |temperatures_k: &[f64]| {
        let row = |temperature_k: &f64| {
            let pixels = (1..=12).map(move |trail_px| format!("{temperature_k},10000,{trail_px},0,1e-5\n"));
            pixels.collect::<String>()
        };
        let rows: String = temperatures_k.iter().map(row).collect();
        let text = format!("# observable: trail\n# t_yr: 5\ntemperature_k,signal_e,trail_px,value,sigma\n{rows}");
        let mut data = vec![DataSet::of(Table::parse("trails.csv", &text).unwrap(), &mission).unwrap()];
        let values = predict(&Model::new(&truth), &questions(&data)).unwrap();
        data[0].rows.iter_mut().zip(values).for_each(|(row, value)| row.value = value);
        fitted(&given, &data, &keys.each_ref().map(String::as_str))
    };
    let is_exchanged = |fit: &Fit| fit.advice.iter().any(|advice| matches!(advice, Advice::Exchanged { .. }));
    let near = |fit: &Fit, expected: [f64; 4]| {
        fit.parameters.iter().zip(expected).all(|(found, expected)| (found.value / expected - 1.0).abs() < 0.01)
    };
    let one = of(&[mission.detector.temperature_k]);
    assert!(near(&one, [40.0, 160.0, 0.3, 0.5]) && !is_exchanged(&one), "{:?}", one.parameters);
    assert_eq!(one.parameters.iter().map(|found| found.before).collect::<Vec<_>>(), [70.0, 80.0, 0.4, 0.4]);
    let two = of(&[mission.detector.temperature_k, mission.detector.temperature_k + 10.0]);
    assert!(near(&two, [160.0, 40.0, 0.5, 0.3]) && is_exchanged(&two), "{:?}", two.parameters);
}

/// A notch that starts at 0 has no size, and chi2 rises on the way to the minimum.
#[test]
fn a_value_that_starts_at_its_bound_is_found_far_from_it() {
    let folder = Path::new("tests/practice/notch");
    let mission = Mission::read(folder.join("mission.toml")).unwrap();
    let data = [DataSet::read(folder.join("trails.ecsv"), &mission).unwrap()];
    assert_eq!(mission.detector.notch_e, 0.0);
    let key = "detector.notch_e".to_string();
    let alone = fitted(&mission, &data, &["detector.notch_e"]);
    assert!((alone.parameters[0].value - 59.8).abs() < 1.0 && alone.chi2 < 150.0, "{:?}", alone.parameters);
    // Beside other keys, a value at its bound does not end the search for theirs.
    let keys: Vec<String> = mission.fit.free.iter().cloned().chain([key]).collect();
    let unscanned = Options { scan: false, ..Options::default() };
    let [held, free] =
        [&keys[..keys.len() - 1], &keys[..]].map(|keys| fit(&mission, &data, keys, &unscanned, &|_| {}).unwrap());
    assert!(free.chi2 < held.chi2 * 1.001, "{} {}", free.chi2, held.chi2);
}
