//! Laws of what the noise of one exposure does to the change of a galaxy's shape.

use ctiplan::evaluate;
use ctiplan::mission::Mission;
use ctiplan::model::noise::Realisations;
use ctiplan::model::realise::realise;
use ctiplan::plan::noise::{NoisyEvaluation, NoisyShape};

const GALAXIES: &str = include_str!("../../missions/rhodes2010_galaxies.toml");

/// The seven galaxies of the paper, or those of these names.
fn mission(text: &str, names: &[&str]) -> Mission {
    let mut mission = Mission::parse(text).unwrap();
    mission.galaxies.retain(|galaxy| names.contains(&galaxy.name.as_str()));
    mission.requirement.galaxy = names[0].into();
    mission
}

fn noisy(mission: &Mission, count: u32, seed: u64) -> NoisyEvaluation {
    evaluate(mission).unwrap().with_noise(Realisations { count, seed }).unwrap().noise.unwrap()
}

/// At the end of the mission.
fn end(mission: &Mission, count: u32, seed: u64) -> Vec<NoisyShape> {
    noisy(mission, count, seed).years.last().unwrap().iter().map(|shape| shape.unwrap()).collect()
}

#[test]
fn the_bright_galaxy_of_the_paper_changes_more_with_noise_and_the_faint_one_has_a_mean() {
    let of = |name: &str| end(&mission(GALAXIES, &[name]), 128, 1)[0];
    let (faint, bright) = (of("small-faint"), of("small-bright"));
    // Single noisy galaxies give 1.24e-3; noisy sky farther downstream adds 1 to 2 %.
    assert!((bright.delta_e[0] + 1.25e-3).abs() < 0.03e-3, "{bright:?}");
    assert!(bright.error[0] < 0.01 * 1.25e-3, "{bright:?}");
    assert!(faint.error[0] < 0.015 * 1.4e-3 && faint.delta_e[0] < -1.3e-3, "{faint:?}");
    // No direction is preferred but that of the transfers.
    assert!(bright.delta_e[1].abs() < 4.0 * bright.error[1], "{bright:?}");
}

#[test]
fn means_are_those_of_single_galaxies_with_a_fitted_centroid() {
    let mission = mission(GALAXIES, &["small-bright", "large-bright"]);
    let evaluation = evaluate(&mission).unwrap();
    let device = evaluation.model.device_at(mission.mission.duration_yr).unwrap();
    for (galaxy, shape) in mission.galaxies.iter().zip(end(&mission, 256, 1)) {
        let single = realise(&mission, galaxy, &device, 400, 5, || {}).unwrap().unwrap();
        assert_eq!(single.lost, 0);
        let error = single.error.delta_e1.hypot(shape.error[0]);
        // Single galaxies have no noisy sky downstream of their stamp.
        let allowed = 4.0 * error + 0.03 * shape.delta_e[0].abs();
        assert!((single.mean.delta_e1 - shape.delta_e[0]).abs() < allowed, "{single:?} {shape:?}");
    }
}

#[test]
fn without_noise_there_is_nothing_to_add() {
    // All charges, and the traps with them, a thousand times as many: noise is a thousandth of the signal's variance.
    let times = |text: &str, key: &str, value: &str| {
        let more = value.parse::<f64>().unwrap() * 1e3;
        text.replace(&format!("{key} = {value}"), &format!("{key} = {more:.1}"))
    };
    let mut text = times(GALAXIES, "full_well_e", "161000.0");
    for (key, value) in [("background_e", "120.0"), ("flux_e", "5600.0")] {
        text = times(&text, key, value);
    }
    for value in ["0.35", "0.49", "0.7"] {
        text = times(&text, "density_per_px", value);
    }
    let added = |mission: &Mission| {
        let free = evaluate(mission).unwrap().end().galaxies[0].unwrap().delta_e1;
        end(mission, 128, 1)[0].delta_e[0] - free
    };
    let [noisy, scaled] = [GALAXIES, &text].map(|text| added(&mission(text, &["small-bright"])));
    // It falls slowly: noise counts where the galaxy is fainter than it, in the wings.
    assert!(noisy.abs() > 1.8e-4 && scaled.abs() < 0.15 * noisy.abs(), "{noisy} {scaled}");
}

#[test]
fn errors_fall_as_the_root_of_the_number_and_are_those_of_other_seeds() {
    let mission = mission(GALAXIES, &["small-bright"]);
    let [few, many] = [64, 1024].map(|count| end(&mission, count, 1)[0].error[0]);
    assert!((few / many / 4.0 - 1.0).abs() < 0.35, "{few} {many}");
    let means: Vec<f64> = (10..34).map(|seed| end(&mission, 64, seed)[0].delta_e[0]).collect();
    let mean = means.iter().sum::<f64>() / means.len() as f64;
    let scatter = (means.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / (means.len() - 1) as f64).sqrt();
    assert!((0.6..1.7).contains(&(scatter / (4.0 * many))), "{scatter} {many}");
}

#[test]
fn any_number_of_threads_gives_the_same_bits() {
    let mission = mission(GALAXIES, &["small-faint"]);
    let of = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| end(&mission, 32, 7)[0])
    };
    assert_eq!(of(1), of(3));
}

#[test]
fn noise_moves_the_date_and_says_by_how_much() {
    let mission = mission(GALAXIES, &["small-faint"]);
    let evaluation = evaluate(&mission).unwrap();
    let with = noisy(&mission, 64, 1).verdict.uncorrected;
    let (without_yr, with_yr) = (evaluation.verdict.uncorrected.t_yr.unwrap(), with.crossing.t_yr.unwrap());
    assert_eq!(with.earlier_yr.unwrap(), without_yr - with_yr);
    assert!(with.earlier_yr.unwrap() > 3.0 * with.error_yr.unwrap(), "{with:?}");
    // |Δe| grows about evenly.
    let noisy = &noisy(&mission, 64, 1).years[3][0].unwrap();
    assert!((with_yr / 4.0 / (1e-3 / noisy.magnitude()) - 1.0).abs() < 0.01, "{with_yr} {noisy:?}");
}

/// Dates long before the end of the mission, when far fewer traps are there, are those of a mission that ends soon after them.
#[test]
fn dates_with_noise_do_not_depend_on_the_duration() {
    let long = Mission::read("missions/hst_leo.toml").unwrap();
    let long = Mission { galaxies: vec![long.judged_galaxy().clone()], ..long };
    let short = long.with(&[("mission.duration_yr".into(), toml::Value::Float(0.5))]).unwrap();
    let [long, short] = [long, short].map(|mission| noisy(&mission, 48, 1).verdict);
    for (long, short) in [(long.uncorrected, short.uncorrected), (long.corrected, short.corrected)] {
        let error_yr = long.error_yr.unwrap().hypot(short.error_yr.unwrap());
        let [long_yr, short_yr] = [long.crossing.t_yr, short.crossing.t_yr].map(Option::unwrap);
        assert!((long_yr - short_yr).abs() < 3.0 * error_yr, "{long_yr} {short_yr} +- {error_yr}");
    }
}
