//! When a budget is exceeded, against a dense scan of |Δe|(t): no crossing is missed, whatever dose, annealing, bakeouts and the
//! Sun do to the curve.

use ctiplan::evaluate;
use ctiplan::mission::Mission;
use ctiplan::model::Model;
use ctiplan::plan::curve::Crossing;
use ctiplan::study::Study;
use ctiplan::study::launch::Launch;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Times of a scan, besides both sides of each jump.
const TIMES: usize = 400;

/// A curve so close to a limit, relative to it, is neither above nor below.
const CLOSE: f64 = 3e-4;

/// SNAP's detector with one galaxy, flown through flares, bakeouts, annealing and cycles; and when something happens at once, yr.
fn mission(random: &mut ChaCha8Rng) -> (Mission, Vec<f64>) {
    let duration_yr = random.random_range(2.0..15.0);
    let mut text = include_str!("../../missions/snap_l2.toml")
        .replace(
            "launch = 2009-01-01",
            &format!("launch = {}-0{}-15", random.random_range(1995..2060), random.random_range(1..10)),
        )
        .replace("duration_yr = 5.0", &format!("duration_yr = {duration_yr}"))
        .replace("[requirement]", "[accuracy]\nsubpixel_grid = 1\nrelative = 1e-5\n[requirement]");
    if random.random::<bool>() {
        text = text.replace("model = \"constant\"", "model = \"solar-cycle\"");
    }
    let mut events = Vec::new();
    for _ in 0..random.random_range(0..3) {
        let t_yr = random.random_range(0.0..duration_yr);
        text +=
            &format!("\n[[effects.solar-flare]]\nt_yr = {t_yr}\ndose_mev_g = {:e}\n", random.random_range(1e5..2e7));
        events.push(t_yr);
    }
    for _ in 0..random.random_range(0..4) {
        let t_yr = random.random_range(0.0..duration_yr);
        text += &format!("\n[[effects.bakeout]]\nt_yr = {t_yr}\nfraction = {}\n", random.random_range(0.1..0.999));
        events.push(t_yr);
    }
    if random.random::<bool>() {
        text += &format!("\n[effects.annealing]\ntime_yr = {}\n", 10_f64.powf(random.random_range(-1.0..2.0)));
    }
    let mut mission = Mission::parse(&text).unwrap();
    mission.galaxies.truncate(1);
    (mission, events)
}

fn exceeds(crossing: &Crossing, t_yr: f64) -> bool {
    crossing.crossings_yr.iter().filter(|crossed_yr| **crossed_yr <= t_yr).count() % 2 == 1
}

#[test]
#[ignore = "slow: .ci/run runs it"]
fn no_crossing_of_a_dense_scan_is_missed() {
    let mut random = ChaCha8Rng::seed_from_u64(17);
    let (mut exceeded, mut came_back) = (0, 0);
    for case in 0..200 {
        let (mut mission, events) = mission(&mut random);
        let duration_yr = mission.mission.duration_yr;
        let model = Model::new(&mission);
        let mut times: Vec<f64> = (0..=TIMES).map(|index| duration_yr * index as f64 / TIMES as f64).collect();
        times.extend(events.iter().flat_map(|t_yr| [t_yr.next_down(), *t_yr]));
        times.sort_by(f64::total_cmp);
        let scan: Vec<(f64, f64)> =
            times.iter().map(|t_yr| (*t_yr, model.change(0, *t_yr).unwrap().unwrap().magnitude())).collect();
        let most = scan.iter().map(|(_, delta_e)| *delta_e).fold(0.0, f64::max);
        // From a small part of the largest value to just above it; the corrected limit is ten times higher.
        let limit = most * random.random_range(0.05..1.1);
        if limit <= 0.0 {
            continue;
        }
        mission.requirement.delta_e = limit;
        let verdict = evaluate(&mission).unwrap().verdict;
        for crossing in [&verdict.uncorrected, &verdict.corrected] {
            assert_eq!(crossing.t_yr, crossing.crossings_yr.first().copied());
            assert!(crossing.crossings_yr.is_sorted());
            for (t_yr, delta_e) in &scan {
                let clear = (delta_e / crossing.limit - 1.0).abs() > CLOSE;
                assert!(
                    !clear || exceeds(crossing, *t_yr) == (*delta_e > crossing.limit),
                    "case {case}: |delta e| is {delta_e} of {} at {t_yr} yr; crossings {:?}\n{}",
                    crossing.limit,
                    crossing.crossings_yr,
                    mission.to_toml()
                );
            }
        }
        exceeded += usize::from(verdict.uncorrected.t_yr.is_some());
        came_back += usize::from(verdict.uncorrected.crossings_yr.len() > 1);
    }
    assert!(exceeded > 100 && came_back > 40, "{exceeded} of 200 exceed, {came_back} come back");
}

/// Studies follow |Δe| on straight lines between sixty times and more where it is bent; their dates are those of `evaluate`.
#[test]
fn studies_tell_the_date_of_evaluate() {
    let mut random = ChaCha8Rng::seed_from_u64(18);
    let mut told = 0;
    for case in 0..40 {
        let (mut mission, _) = mission(&mut random);
        mission.environment.model = ctiplan::mission::DoseModel::SolarCycle;
        let model = Model::new(&mission);
        let end = model.change(0, mission.mission.duration_yr).unwrap().unwrap().magnitude();
        mission.requirement.delta_e = (0.5 * end).max(1e-6);
        let own = evaluate(&mission).unwrap().verdict.uncorrected.t_yr;
        let asked = Launch { launches: Some(vec![mission.mission.launch.0]), ..Default::default() };
        let found = asked.study(&mission, &|| {}).unwrap().launches[0].judged.exceeded_t_yr;
        assert_eq!(own.is_some(), found.is_some(), "case {case}");
        if let (Some(own), Some(found)) = (own, found) {
            // A hundredth of a step between two of the sixty times.
            let step_yr = mission.mission.duration_yr / 60.0;
            assert!(
                (own - found).abs() < 0.03 * step_yr,
                "case {case}: {found} yr, evaluate has {own} yr, step {step_yr}"
            );
            told += 1;
        }
    }
    assert!(told > 25, "{told}");
}

/// A crossing of hours before a bakeout, as a mission in flight meets it every year.
#[test]
fn what_yearly_bakeouts_hide_is_said() {
    let mut text = include_str!("../../missions/snap_l2.toml").replace("duration_yr = 5.0", "duration_yr = 8.0");
    for year in 1..8 {
        text += &format!("\n[[effects.bakeout]]\nt_yr = {year}.0\nfraction = 0.99\n");
    }
    let mut mission = Mission::parse(&text).unwrap();
    mission.galaxies.truncate(1);
    let model = Model::new(&mission);
    let before = |t_yr: f64| model.change(0, t_yr.next_down()).unwrap().unwrap().magnitude();
    mission.requirement.delta_e = 0.9 * before(1.0);
    let verdict = evaluate(&mission).unwrap().verdict.uncorrected;
    assert!((verdict.t_yr.unwrap() - 0.9).abs() < 0.01, "{:?}", verdict.t_yr);
    // Up before each bakeout and before the end, down at each bakeout.
    assert_eq!(verdict.crossings_yr.len(), 15);
    for (year, down) in (1..8).zip(verdict.crossings_yr.chunks(2)) {
        assert_eq!(down[1], f64::from(year));
    }
    assert!(verdict.exceeded_at_end());
}
