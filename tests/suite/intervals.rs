//! Intervals by profile likelihood and samples of a posterior, on problems whose answer is known on paper.

use ctiplan::analysis::fit::profile::{End, Profile, profile};
use ctiplan::analysis::fit::{Fit, Options, fit};
use ctiplan::analysis::measurement::DataSet;
use ctiplan::io::table::Table;
use ctiplan::mission::Mission;
use ctiplan::model::Model;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

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
