//! Intervals by profile likelihood and samples of a posterior, on problems whose answer is known on paper.

use std::fs;
use std::process::Command;

use ctiplan::analysis::fit::posterior::{self, Posterior, posterior};
use ctiplan::analysis::fit::profile::{End, Profile, profile};
use ctiplan::analysis::fit::{Fit, Options, fit};
use ctiplan::analysis::measurement::DataSet;
use ctiplan::evaluate;
use ctiplan::io::table::Table;
use ctiplan::mission::Mission;
use ctiplan::model::Model;
use ctiplan::plan::date_distribution::date_distribution;
use ctiplan::plan::mission_sample::MissionSample;
use ctiplan::plan::progress::Progress;
use ctiplan::report::{FitReport, Report};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use serde_json::Value;
use statrs::distribution::{ContinuousCDF, Normal};

const OFFSET: &str = "effects.formula.offset";
const SLOPE: &str = "effects.formula.slope";
const FLOOR: &str = "environment.cosmic_ray_floor_mev_g_yr";

/// A dose that is a straight line: `offset` (MeV/g) and `slope` (MeV/g/yr).
fn mission() -> Mission {
    let text = format!(
        "{}\n[effects.formula]\ntarget = \"value\"\nexpression = \"value + offset + slope * t_yr\"\noffset = 0.0\nslope = 0.0\n",
        include_str!("../../missions/snap_l2.toml")
    );
    Mission::parse(&text).unwrap().with(&[("environment.active_dose_rate_mev_g_yr".into(), 0.0.into())]).unwrap()
}

const SIGMA: f64 = 1e5;

/// Times of the measurements, years since launch.
fn times() -> Vec<f64> {
    (0..12).map(|index| 0.1 + 0.1 * f64::from(index)).collect()
}

/// Doses on a straight line with noise, and their values.
fn doses(offset: f64, slope: f64, seed: u64) -> (Mission, Vec<DataSet>, Vec<f64>) {
    let mission = mission();
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let noisy = |t_yr: f64| {
        let noise: f64 = StandardNormal.sample(&mut random);
        offset + slope * t_yr + SIGMA * noise
    };
    let values: Vec<f64> = times().into_iter().map(noisy).collect();
    let rows = times().into_iter().zip(&values).map(|(t_yr, value)| format!("{t_yr},{value},{SIGMA}\n"));
    let text = format!("# observable: dose\nt_yr [yr],value [MeV / g],sigma [MeV / g]\n{}", rows.collect::<String>());
    let data = vec![DataSet::of(Table::parse("doses.csv", &text).unwrap(), &mission).unwrap()];
    (mission, data, values)
}

fn fitted(mission: &Mission, data: &[DataSet], keys: &[&str]) -> Fit {
    let keys: Vec<String> = keys.iter().map(ToString::to_string).collect();
    fit(mission, data, &keys, &Options::default(), &|_| {}).unwrap()
}

fn scanned(mission: &Mission, data: &[DataSet], fit: &Fit, key: &str) -> Profile {
    profile(&Model::new(mission), data, fit, key, &|_| {}).unwrap()
}

/// Values, errors and correlation of a straight line by the normal equations.
fn straight_line(values: &[f64]) -> ([f64; 2], [f64; 2], f64) {
    let n = values.len() as f64;
    let (t, tt): (f64, f64) = times().iter().fold((0.0, 0.0), |(t, tt), one| (t + one, tt + one * one));
    let y: f64 = values.iter().sum();
    let ty: f64 = times().iter().zip(values).map(|(t, y)| t * y).sum();
    let determinant = n * tt - t * t;
    let best = [(tt * y - t * ty) / determinant, (n * ty - t * y) / determinant];
    let sigmas = [SIGMA * (tt / determinant).sqrt(), SIGMA * (n / determinant).sqrt()];
    (best, sigmas, -t / (n * tt).sqrt())
}

/// The profile of a parameter in which the model is linear is a parabola with the error of the linear theory.
#[test]
fn the_profile_of_a_linear_parameter_is_a_parabola() {
    let (mission, data, values) = doses(3e6, -1e6, 1);
    let fit = fitted(&mission, &data, &[OFFSET, SLOPE]);
    let (best, sigmas, _) = straight_line(&values);
    for (index, key) in [OFFSET, SLOPE].into_iter().enumerate() {
        let profile = scanned(&mission, &data, &fit, key);
        assert!((profile.value - best[index]).abs() < 1e-3 * sigmas[index], "{profile:?} {best:?}");
        for (interval, reach) in profile.intervals.iter().zip([1.0, 2.0]) {
            for (end, sign) in [(interval.low, -1.0), (interval.high, 1.0)] {
                let expected = best[index] + sign * reach * sigmas[index];
                assert!((end.crossing().unwrap() - expected).abs() < 5e-3 * sigmas[index], "{key}: {end:?} {expected}");
            }
        }
        assert!(profile.curve.len() > 10 && profile.lower.is_none());
        for point in &profile.curve {
            let parabola = ((point.value - best[index]) / sigmas[index]).powi(2);
            assert!((point.delta_chi2 - parabola).abs() < 1e-3 * (1.0 + parabola), "{key}: {point:?} {parabola}");
        }
    }
}

/// A rate that cannot be negative, from data that are below 0: χ² has its minimum at the bound, and an interval begins there.
#[test]
fn an_interval_keeps_to_the_bounds() {
    let (mission, data, values) = doses(0.0, -1e5, 2);
    let fit = fitted(&mission, &data, &[FLOOR]);
    let tt: f64 = times().iter().map(|t| t * t).sum();
    let unbounded = times().iter().zip(&values).map(|(t, y)| t * y).sum::<f64>() / tt;
    let sigma = SIGMA / tt.sqrt();
    assert!(unbounded < -0.3 * sigma, "the data ask for a positive rate: {unbounded} {sigma}");
    let profile = scanned(&mission, &data, &fit, FLOOR);
    for interval in &profile.intervals {
        assert_eq!(interval.low, End::Bound { value: 0.0 });
        // ((x − x̂)² − x̂²)/σ² = Δχ²
        let expected = unbounded + (unbounded.powi(2) + interval.delta_chi2 * sigma * sigma).sqrt();
        let found = interval.high.crossing().unwrap();
        assert!((found / expected - 1.0).abs() < 0.01, "{found} {expected}");
    }
}

/// What the data are insensitive to has no ends, and that takes a limited number of fits.
#[test]
fn an_interval_of_an_idle_parameter_is_open() {
    let (mission, data, _) = doses(3e6, -1e6, 3);
    let key = "detector.traps.VV.release_ms";
    let fit = fitted(&mission, &data, &[OFFSET, key]);
    let profile = scanned(&mission, &data, &fit, key);
    for interval in &profile.intervals {
        assert!(interval.low.crossing().is_none() && interval.high.crossing().is_none(), "{interval:?}");
    }
    assert!(profile.refits <= 100, "{}", profile.refits);
}

#[test]
fn a_key_that_is_not_free_is_refused() {
    let (mission, data, _) = doses(3e6, -1e6, 3);
    let fit = fitted(&mission, &data, &[OFFSET]);
    let refusal = profile(&Model::new(&mission), &data, &fit, "effects.formula.ofset", &|_| {}).unwrap_err();
    assert_eq!(refusal.help.as_deref(), Some("did you mean `effects.formula.offset`?"));
}

fn sampled(mission: &Mission, data: &[DataSet], fit: &Fit, samples: usize, seed: u64) -> Posterior {
    let options = posterior::Options { samples, seed, evaluations: None };
    posterior(&Model::new(mission), data, fit, &options, &|_| {}).unwrap()
}

/// Of a linear model with Gaussian noise and flat priors the posterior is the normal law of the linear theory.
#[test]
fn the_posterior_of_a_linear_problem_is_that_of_the_linear_theory() {
    let (mission, data, values) = doses(3e6, -1e6, 4);
    let fit = fitted(&mission, &data, &[OFFSET, SLOPE]);
    let found = sampled(&mission, &data, &fit, 1000, 1);
    assert!(found.converged && found.effective_samples >= 1000.0 && found.draws.len() == 1000);
    let (best, sigmas, correlation) = straight_line(&values);
    // Four standard errors of so many independent draws.
    let n = found.effective_samples;
    for (place, marginal) in found.parameters.iter().enumerate() {
        let off = (marginal.median - best[place]) / sigmas[place];
        // The variance of a median is π/2 times that of a mean.
        assert!(off.abs() < 4.0 * 1.2533 / n.sqrt(), "{off} {marginal:?}");
        let mean = found.draws.iter().map(|draw| draw[place]).sum::<f64>() / found.draws.len() as f64;
        assert!(((mean - best[place]) / sigmas[place]).abs() < 4.0 / (found.draws.len() as f64).sqrt() * 1.5);
        let squares: f64 = found.draws.iter().map(|draw| (draw[place] - mean).powi(2)).sum();
        let sigma = (squares / found.draws.len() as f64).sqrt();
        assert!((sigma / sigmas[place] - 1.0).abs() < 4.0 / (2.0 * n).sqrt() * 1.5, "{sigma} {sigmas:?}");
        for (interval, reach) in [(marginal.interval_68, 1.0), (marginal.interval_95, 2.0)] {
            let ends = [best[place] - reach * sigmas[place], best[place] + reach * sigmas[place]];
            for (found, expected) in interval.into_iter().zip(ends) {
                // √(p (1 − p)) over the density there, in sigma: 1.5 at 1 sigma, 2.8 at 2.
                assert!(((found - expected) / sigmas[place]).abs() < 4.0 * 2.8 / n.sqrt(), "{found} {expected}");
            }
        }
    }
    assert!((found.correlation[0][1] - correlation).abs() < 4.0 * (1.0 - correlation.powi(2)) / n.sqrt());
    // ln p = −χ²/2
    let draw = &found.draws[7];
    let chi2: f64 = times().iter().zip(&values).map(|(t, y)| ((y - draw[0] - draw[1] * t) / SIGMA).powi(2)).sum();
    assert!((draw[2] + 0.5 * chi2).abs() < 1e-6 * chi2, "{draw:?} {chi2}");
}

/// A rate that cannot be negative: the posterior is a normal law cut at 0, and that its prior ends it is said.
#[test]
fn the_posterior_keeps_to_the_bounds() {
    let (mission, data, values) = doses(0.0, -1e5, 2);
    let fit = fitted(&mission, &data, &[FLOOR]);
    let found = sampled(&mission, &data, &fit, 1000, 1);
    let marginal = &found.parameters[0];
    assert!(found.draws.iter().all(|draw| draw[0] >= 0.0) && marginal.ended_by_prior);
    assert_eq!(marginal.prior.to_string(), "flat in the value from 0 to 1e12");
    let tt: f64 = times().iter().map(|t| t * t).sum();
    let centre = times().iter().zip(&values).map(|(t, y)| t * y).sum::<f64>() / tt;
    let sigma = SIGMA / tt.sqrt();
    let normal = Normal::new(centre, sigma).unwrap();
    let below = normal.cdf(0.0);
    let quantile = |p: f64| normal.inverse_cdf(below + p * (1.0 - below));
    let (low, median) = (quantile(0.4), quantile(0.5));
    // The standard error of a median: ½ over density and √n; the density is about 0.1 over the width from 40 to 50 %.
    let error = 0.5 / (0.1 / (median - low)) / found.effective_samples.sqrt();
    assert!((marginal.median - median).abs() < 4.0 * error, "{} {median} {error}", marginal.median);
}

#[test]
fn a_seed_gives_the_same_sample_with_any_number_of_threads() {
    let (mission, data, _) = doses(3e6, -1e6, 5);
    let fit = fitted(&mission, &data, &[OFFSET, SLOPE]);
    let with = |threads: usize, seed: u64| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| sampled(&mission, &data, &fit, 50, seed)).draws
    };
    assert_eq!(with(1, 3), with(2, 3));
    assert_ne!(with(2, 3), with(2, 4));
}

/// Too few evaluations: the sample is made of what there is, and that it is too short is known.
#[test]
fn a_sample_that_is_too_short_is_known_to_be() {
    let (mission, data, _) = doses(3e6, -1e6, 6);
    let fit = fitted(&mission, &data, &[OFFSET, SLOPE]);
    let options = posterior::Options { samples: 1000, seed: 1, evaluations: Some(320) };
    let found = posterior(&Model::new(&mission), &data, &fit, &options, &|_| {}).unwrap();
    assert!(!found.converged && found.evaluations <= 320, "{found:?}");
}

const DENSITY: &str = "detector.traps.VV.density_per_px";

/// SNAP, coarsely.
fn snap() -> Mission {
    let text = include_str!("../../missions/snap_l2.toml")
        .replace("[requirement]", "[accuracy]\nsubpixel_grid = 1\n[requirement]");
    Mission::parse(&text).unwrap()
}

fn read(text: &str) -> Result<MissionSample, ctiplan::error::InputError> {
    let file = tempfile::Builder::new().suffix(".ecsv").tempfile().unwrap();
    fs::write(file.path(), text).unwrap();
    MissionSample::read(file.path(), &snap())
}

/// SNAP with a dose that is known, and nothing else uncertain.
fn certain(folder: &std::path::Path) -> Mission {
    let history = folder.join("dose.csv");
    fs::write(&history, "t_yr,dose_mev_g\n0,0\n5,8.08e6\n").unwrap();
    let history = format!("model = \"history\"\nhistory = {:?}", history.display().to_string());
    let uncertainty = "[uncertainty]\ndose_model = 0\nshielding = 0\ndensity = 0\nrelease = 0\nfull_well = 0\nwell_fill_power = 0\n\
                       background = 0\ngalaxy_flux = 0\ngalaxy_size = 0\n";
    let text = include_str!("../../missions/snap_l2.toml")
        .replace("[requirement]", &format!("{uncertainty}[accuracy]\nsubpixel_grid = 1\n[requirement]"))
        .replace("model = \"constant\"", &history)
        .replace("active_dose_rate_mev_g_yr = 2.54e6", "");
    Mission::parse(&text).unwrap()
}

/// Dates under a sample are those of its missions, each evaluated by itself.
#[test]
fn dates_under_a_sample_are_those_of_its_missions() {
    let densities: Vec<f64> = (0..21).map(|index| 0.12 * 1.15_f64.powi(index)).collect();
    let rows: String = densities.iter().map(|density| format!("{density},-1.0\n")).collect();
    let sample = read(&format!("{DENSITY},log_posterior\n{rows}")).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let mission = certain(folder.path());
    let found = date_distribution(&mission, Some(&sample), None, 21, 1, &Progress::NONE).unwrap();
    assert_eq!((found.samples, found.effective_samples), (21, 21.0));
    assert_eq!(found.posterior_keys, [DENSITY]);
    assert!(found.sun_not_drawn.is_some());
    let mut times: Vec<f64> = densities
        .iter()
        .map(|density| {
            let drawn = mission.with(&[(DENSITY.into(), (*density).into())]).unwrap();
            evaluate(&drawn).unwrap().verdict.uncorrected.t_yr.unwrap_or(f64::INFINITY)
        })
        .collect();
    times.sort_by(f64::total_cmp);
    let within = times.iter().filter(|t_yr| t_yr.is_finite()).count();
    assert!(within > 11 && within < 20, "choose densities between which the budget is exceeded: {times:?}");
    let uncorrected = &found.uncorrected;
    assert_eq!(uncorrected.probability_exceeded, within as f64 / 21.0);
    let quantiles: Vec<Option<f64>> = uncorrected.quantiles.iter().map(|at| at.t_yr).collect();
    // Of 21 rows the quantiles of 5, 50 and 95 % are the second, the middle and the last but one.
    // Draws are read out more coarsely.
    let close = |found: Option<f64>, expected: f64| (found.unwrap() / expected - 1.0).abs() < 2e-3;
    assert!(close(quantiles[0], times[1]) && close(quantiles[1], times[10]), "{quantiles:?} {times:?}");
    assert_eq!(quantiles[2], None);
    assert!(uncorrected.quantiles[0].error_yr.unwrap() > 0.0);
    // Emulated, the same rows many times over tell the same.
    let many = date_distribution(&mission, Some(&sample), None, 2100, 1, &Progress::NONE).unwrap();
    assert!(many.emulated.is_some() && many.effective_samples == 21.0);
    assert_eq!(many.uncorrected.probability_exceeded, within as f64 / 21.0);
    let median = many.uncorrected.quantiles[1].t_yr;
    assert!((median.unwrap() / times[10] - 1.0).abs() < 0.02, "{median:?} {times:?}");
}

/// If nothing else varies, the variance is that of the posterior, of all its keys together, however correlated they are; and a
/// sample that has not converged is named.
#[test]
fn a_posterior_has_its_share_of_the_variance() {
    let folder = tempfile::tempdir().unwrap();
    let mission = certain(folder.path());
    let other = DENSITY.replace("VV", "Ci");
    let row = |index: i32| {
        let both = 0.01 * f64::from(index % 7);
        format!("{},{},-1.0\n", 0.45 + both, 0.30 + both + 1e-3 * f64::from(index % 2))
    };
    let rows: String = (0..40).map(row).collect();
    let header = "# converged: false\n";
    let sample = read(&format!("{header}{DENSITY},{other},log_posterior\n{rows}")).unwrap();
    let found = date_distribution(&mission, Some(&sample), None, 40, 1, &Progress::NONE).unwrap();
    let share = |name: &str| found.shares.iter().find(|share| share.input == name).unwrap().share;
    assert!(share("posterior") > 0.99 && share("rest") < 0.01, "{:?}", found.shares);
    assert_eq!((sample.converged, found.posterior_converged), (Some(false), Some(false)));
}

/// A sample carries the mission that was fitted, and whether it describes the data: used with a mission that differs elsewhere, or
/// after a bad fit, it says so.
#[test]
fn a_sample_knows_the_fit_that_it_belongs_to() {
    let (mission, data, _) = doses(3e6, -1e6, 8);
    let sample = |keys: &[&str], here: &Mission| {
        let fit = fitted(&mission, &data, keys);
        let drawn = sampled(&mission, &data, &fit, 20, 1);
        let file = tempfile::Builder::new().suffix(".ecsv").tempfile().unwrap();
        fs::write(file.path(), drawn.table(&fit, &["doses.csv".into()]).to_ecsv()).unwrap();
        MissionSample::read(file.path(), here).unwrap()
    };
    let known = sample(&[OFFSET, SLOPE], &mission);
    assert_eq!((known.describes_data, &known.differing[..]), (Some(true), &[][..]));
    // What has been fitted does not count, nor what the device does not depend on.
    let settings = [(SLOPE, 5.0), ("detector.traps.VV.release_ms", 3.0), (FLOOR, 7.0), ("requirement.delta_e", 2e-3)];
    let settings = settings.map(|(key, value)| (key.to_string(), value.into()));
    let other = sample(&[OFFSET, SLOPE], &mission.with(&settings).unwrap());
    assert_eq!(other.differing, [FLOOR, "detector.traps.VV.release_ms"]);
    // Without an offset of 3e6 MeV/g a slope does not describe the data.
    assert_eq!(sample(&[SLOPE], &mission).describes_data, Some(false));
}

/// Errors that are too large are named, since those of the fit are as well.
#[test]
fn a_fit_says_that_errors_are_too_large() {
    let (mission, data, _) = doses(3e6, -1e6, 9);
    let said = |factor: f64| {
        let mut data = data.clone();
        data[0].rows.iter_mut().for_each(|row| row.sigma *= factor);
        let fit = fitted(&mission, &data, &[OFFSET, SLOPE]);
        assert_eq!(fit.errors_too_large().is_some(), factor > 1.0, "{:?}", fit.chi2);
        let text =
            FitReport { fit, holdout: None, profiles: Vec::new(), posterior: None, has_common_errors: false }.text();
        text.split_whitespace().collect::<Vec<_>>().join(" ")
    };
    assert!(!said(1.0).contains("too large"));
    assert!(said(10.0).contains("the quoted errors of the data are too large, and so are the errors above"));
}

#[test]
fn a_sample_that_does_not_fit_the_mission_is_refused() {
    let refusal = |text: &str| read(text).unwrap_err().to_string();
    let unknown = refusal("detector.traps.VX.density_per_px,log_posterior\n0.1,-1\n");
    assert!(unknown.contains("cannot use posterior") && unknown.contains("VX"), "{unknown}");
    let unit = refusal("detector.temperature_k [ms],log_posterior\n150,-1\n");
    assert!(unit.contains("the unit \"ms\" cannot be converted to K"), "{unit}");
    let cell = refusal(&format!("{DENSITY}\n0.1\nmany\n"));
    assert!(cell.contains("line 3") && cell.contains(DENSITY), "{cell}");
    let empty = refusal("log_posterior\n-1\n");
    assert!(empty.contains("no draw of any key"), "{empty}");
    let beyond = read(&format!("{DENSITY}\n0.1\n-0.1\n")).unwrap();
    let beyond = date_distribution(&snap(), Some(&beyond), None, 10, 1, &Progress::NONE).unwrap_err().to_string();
    assert!(beyond.contains("line 3") && beyond.contains(DENSITY), "{beyond}");
}

/// From the command line: fit, intervals and sample, then the date under the sample.
#[test]
fn a_sample_goes_from_fit_to_evaluate() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).display().to_string();
    let (mission, _, values) = doses(3e6, -1e6, 7);
    fs::write(path("mission.toml"), mission.to_toml()).unwrap();
    let rows: String = times().iter().zip(&values).map(|(t_yr, value)| format!("{t_yr},{value},{SIGMA}\n")).collect();
    fs::write(path("doses.csv"), format!("# observable: dose\nt_yr,value,sigma\n{rows}")).unwrap();
    let run = |words: &[&str]| {
        let output = Command::new(env!("CARGO_BIN_EXE_ctiplan")).args(words).output().unwrap();
        let [stdout, stderr] = [output.stdout, output.stderr].map(|bytes| String::from_utf8(bytes).unwrap());
        (output.status.code(), stdout, stderr)
    };
    let (file, html) = (path("posterior.ecsv"), path("fit.html"));
    let (mission, data) = (path("mission.toml"), path("doses.csv"));
    let fit = ["fit", &mission, &data, "--free", OFFSET, "--free", SLOPE];
    let keys = format!("{OFFSET},{SLOPE}");
    let words =
        [&fit[..], &["--profile", &keys, "--posterior", "40", "--seed", "3", "--out", &file, "--overwrite"]].concat();
    let (status, text, stderr) = run(&[&words[..], &["--html", &html]].concat());
    assert_eq!(status, Some(0), "{stderr}");
    assert!(text.contains("Profile likelihood") && text.contains("Posterior: a sample of 40 draws, seed 3"), "{text}");
    assert!(text.lines().all(|line| line.chars().count() <= 80), "{text}");
    assert!(fs::read_to_string(&html).unwrap().contains("Goodman"));
    let first = fs::read_to_string(&file).unwrap();
    let (_, json, _) = run(&[&words[..], &["--json"]].concat());
    assert_eq!(fs::read_to_string(&file).unwrap(), first, "another sample from the same seed");
    let json: Value = serde_json::from_str(&json).unwrap();
    assert_eq!(json["profiles"][1]["intervals"][0]["low"]["end"], "crossing");
    assert_eq!(json["posterior"]["parameters"][0]["key"], OFFSET);
    let (_, csv, _) = run(&[&words[..], &["--csv"]].concat());
    assert!(csv.starts_with("key,unit,value,delta_chi2\n") && csv.lines().count() > 30, "{csv}");
    let (status, json, stderr) = run(&["evaluate", &mission, "--posterior", &file, "--json"]);
    assert_eq!(status, Some(0), "{stderr}");
    let json: Value = serde_json::from_str(&json).unwrap();
    assert_eq!((&json["distribution"]["samples"], &json["distribution"]["seed"]), (&1000.into(), &1.into()));
    assert_eq!(json["distribution"]["corrected"]["quantiles"][2]["p"], 0.95);
    let (status, _, stderr) = run(&[&fit[..], &["--profile", "effects.formula.slop"]].concat());
    assert_eq!((status, stderr.contains("did you mean `effects.formula.slope`?")), (Some(2), true), "{stderr}");
}
