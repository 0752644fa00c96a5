//! What holds of every mission, tried on random ones: no panic, no NaN, more dose does more damage, and neither the spelling of
//! units nor the number of threads matters.
//!
//! The missions are the same in every run. `PROPTEST_CASES=1000 PROPTEST_RNG_SEED=2 cargo test --test suite properties::` tries more.

use ctiplan::analysis::measurement::DataSet;
use ctiplan::effect::CATALOGUE;
use ctiplan::io::table::Table;
use ctiplan::mission::Mission;
use ctiplan::model::Model;
use ctiplan::plan::assessment::Assessment;
use ctiplan::plan::evaluate::{Evaluation, evaluate};
use ctiplan::report::{Format, Report};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;

/// So many missions, the same in every run, unless the environment asks for others.
fn config(cases: u32) -> ProptestConfig {
    let asked = |name: &str| std::env::var_os(name).is_some();
    let default = ProptestConfig::default();
    ProptestConfig {
        cases: if asked("PROPTEST_CASES") { default.cases } else { cases },
        rng_seed: if asked("PROPTEST_RNG_SEED") { default.rng_seed } else { RngSeed::Fixed(1) },
        failure_persistence: None,
        ..default
    }
}

/// A number between two powers of ten.
fn decades(low: f64, high: f64) -> impl Strategy<Value = f64> {
    (low..high).prop_map(|power| 10_f64.powf(power))
}

/// One or none.
fn perhaps(number: impl Strategy<Value = f64>) -> impl Strategy<Value = f64> {
    (any::<bool>(), number).prop_map(|(there, number)| if there { number } else { 0.0 })
}

fn environment() -> impl Strategy<Value = String> {
    let model = prop_oneof![Just("constant"), Just("solar-cycle")];
    let dose = prop_oneof![
        perhaps(decades(2.0, 9.0)).prop_map(|rate| (format!("active_dose_rate_mev_g_yr = {rate:e}\n"), String::new())),
        (0.05..0.999, decades(-1.5, 2.4), prop_oneof![Just("sphere"), Just("slab")]).prop_map(
            |(confidence, thickness, geometry)| {
                let shield = format!("[shielding]\ngeometry = \"{geometry}\"\nthickness_mm = {thickness}\n");
                (format!("confidence = {confidence}\n"), shield)
            }
        ),
    ];
    let mission = (1960..2060, 1..13, 0.05..12.0);
    (mission, model, dose).prop_map(|((year, month, duration), model, (dose, shield))| {
        format!(
            "[mission]\nname = \"random\"\nlaunch = {year}-{month:02}-01\nduration_yr = {duration}\n\
             [environment]\nmodel = \"{model}\"\n{dose}{shield}"
        )
    })
}

fn detector() -> impl Strategy<Value = String> {
    let wells = (decades(3.0, 6.0), perhaps(0.0..0.5), 0.05..2.0);
    let temperatures = (80.0..220.0, 80.0..220.0);
    let species = (decades(-4.0, 1.0), decades(-3.0, 6.0), 0.02..0.6);
    (wells, temperatures, decades(6.0, 10.0), prop::collection::vec(species, 1..4)).prop_map(
        |((full_well, notch, power), (at, quoted), dose, species)| {
            let mut text = format!(
                "[detector]\nfull_well_e = {full_well}\nnotch_e = {}\nwell_fill_power = {power}\ntemperature_k = {at}\n\
                 reference_temperature_k = {quoted}\nreference_dose_mev_g = {dose:e}\n",
                notch * full_well
            );
            for (number, (density, release, energy)) in species.into_iter().enumerate() {
                text += &format!(
                    "[[detector.traps]]\nname = \"T{number}\"\ndensity_per_px = {density}\nrelease_ms = {release:e}\n\
                     energy_ev = {energy}\n"
                );
            }
            text
        },
    )
}

fn scene() -> impl Strategy<Value = String> {
    let clock = (decades(-2.0, 3.0), 1..4000);
    let seeing = (perhaps(decades(-1.0, 4.0)), 0.8..6.0, 1.5..5.0);
    let galaxy = (0.5..6.0, 0.1..6.0, decades(1.5, 6.0), -0.5..0.5, 1.0..8.0);
    (clock, seeing, galaxy).prop_map(|((line, transfers), (sky, fwhm, beta), (index, radius, flux, e1, weight))| {
        format!(
            "[readout]\nline_time_ms = {line}\ntransfers = {transfers}\n[sky]\nbackground_e = {sky}\n\
             [psf]\nfwhm_px = {fwhm}\nmoffat_beta = {beta}\n\
             [[galaxies]]\nname = \"g\"\nsersic_index = {index}\nhalf_light_px = {radius}\nflux_e = {flux}\ne1 = {e1}\n\
             weight_px = {weight}\n\
             [requirement]\ndelta_e = 1e-3\ngalaxy = \"g\"\n[accuracy]\nrelative = 1e-3\nsubpixel_grid = 1\n"
        )
    })
}

/// A random mission within what can be asked for in a fraction of a second.
fn mission() -> impl Strategy<Value = Mission> {
    (environment(), detector(), scene()).prop_map(|(environment, detector, scene)| {
        Mission::parse(&format!("{environment}{detector}{scene}")).unwrap_or_else(|error| panic!("{error}"))
    })
}

/// A mission with one effect of the catalogue, or none.
fn mission_with_effect() -> impl Strategy<Value = Mission> {
    (mission(), 0..=CATALOGUE.len()).prop_map(|(mission, choice)| match CATALOGUE.get(choice) {
        None => mission,
        Some(entry) => {
            let added = ctiplan::mission_file::add_effect(&mission, entry.card.kind, (entry.example)(&mission));
            // Some make no sense in some missions, such as a notch above the full well.
            added.map_or(mission, |(with, _)| with)
        }
    })
}

fn set(mission: &Mission, key: &str, value: impl Into<toml::Value>) -> Mission {
    mission.with(&[(key.to_string(), value.into())]).unwrap()
}

fn report(evaluation: Evaluation) -> Assessment {
    Assessment { evaluation, noisy: Vec::new(), distribution: None, flown: None, confidence: None, time_series: None }
}

/// Dose at the end of the mission, MeV/g.
fn last_dose(mission: &Mission) -> f64 {
    Model::new(mission).dose_mev_g(mission.mission.duration_yr).unwrap()
}

proptest! {
    #![proptest_config(config(60))]

    #[test]
    fn every_answer_is_a_number(mission in mission_with_effect()) {
        let evaluation = evaluate(&mission).unwrap();
        let verdict = &evaluation.verdict;
        let crossings = [&verdict.uncorrected, &verdict.corrected];
        let numbers = crossings.iter().flat_map(|crossing| [crossing.t_yr, crossing.margin, Some(crossing.limit)]);
        for number in numbers.chain([verdict.rate_at_launch_per_yr, verdict.mean_rate_per_yr]).flatten() {
            prop_assert!(number.is_finite(), "{verdict:?}");
        }
        let mut dose = 0.0;
        for year in &evaluation.years {
            prop_assert!(year.dose_mev_g >= dose, "dose falls");
            dose = year.dose_mev_g;
        }
        let report = report(evaluation);
        for row in &report.csv()[1..] {
            for cell in row {
                prop_assert!(cell.parse::<f64>().map_or(true, f64::is_finite), "{row:?}");
            }
        }
        for format in [Format::Text, Format::Json] {
            let shown = report.render(format);
            prop_assert!(!shown.contains("NaN") && !shown.contains("inf,"), "{shown}");
        }
    }

    #[test]
    fn a_mission_is_the_same_when_it_is_written_and_read_again(mission in mission_with_effect()) {
        prop_assert_eq!(Mission::parse(&mission.to_toml()).unwrap(), mission);
    }

    #[test]
    fn dose_grows_with_what_makes_it(mission in mission()) {
        let dose = last_dose(&mission);
        let longer = set(&mission, "mission.duration_yr", mission.mission.duration_yr + 3.0);
        prop_assert!(last_dose(&longer) >= dose);
        let with_floor = set(&mission, "environment.cosmic_ray_floor_mev_g_yr", 1e4);
        prop_assert!(last_dose(&with_floor) > dose);
        match (&mission.shielding, mission.environment.active_dose_rate_mev_g_yr) {
            (_, Some(rate)) => {
                let twice = last_dose(&set(&mission, "environment.active_dose_rate_mev_g_yr", 2.0 * rate));
                prop_assert!((twice - 2.0 * dose).abs() <= 1e-9 * twice);
            }
            (Some(shield), None) => {
                let thicker = set(&mission, "shielding.thickness_mm", 1.2 * shield.thickness_mm.unwrap());
                prop_assert!(last_dose(&thicker) <= dose);
                let surer = set(&mission, "environment.confidence", 0.5 + 0.5 * mission.environment.confidence);
                prop_assert!(last_dose(&surer) >= dose);
            }
            (None, None) => unreachable!("a mission has a dose"),
        }
    }
}

proptest! {
    #![proptest_config(config(40))]

    /// As long as there are far fewer traps on the way than charges in the galaxy: then shapes follow the dose.
    #[test]
    fn shapes_change_more_with_more_dose(mission in mission()) {
        // One year, of which the dose does not depend on the Sun, and no search for a date.
        let settings = [
            ("environment.active_dose_rate_mev_g_yr", 1e6.into()),
            ("environment.model", "constant".into()),
            ("mission.duration_yr", 1.0.into()),
            ("requirement.delta_e", 0.9.into()),
        ];
        let mission = mission.with(&settings.map(|(key, value): (&str, toml::Value)| (key.to_string(), value))).unwrap();
        let last = |mission: &Mission| {
            let year = evaluate(mission).unwrap().years.pop().unwrap();
            let traps: f64 = year.traps.iter().map(|species| species.density_per_px).sum();
            (traps * f64::from(mission.readout.transfers), year.galaxies[0])
        };
        let (traps, _) = last(&mission);
        prop_assume!(traps > 0.0);
        // A thousandth of the galaxy's charge, and twice that.
        let rate = 1e6 * 1e-3 * mission.galaxies[0].flux_e.unwrap() / traps;
        prop_assume!(rate < 5e11);
        let [(_, little), (_, much)] =
            [rate, 2.0 * rate].map(|rate| last(&set(&mission, "environment.active_dose_rate_mev_g_yr", rate)));
        let (little, much) = (little.unwrap(), much.unwrap());
        // Of a change of ellipticity that is next to nothing beside the charge that moved, what stretches and what squeezes all
        // but cancel, and what is left may have either sign.
        let cancelled = little.magnitude() < 0.05 * little.delta_flux.abs();
        prop_assert!(cancelled || much.magnitude() >= little.magnitude(), "{little:?} {much:?}");
        prop_assert!(much.delta_y_px.abs() >= little.delta_y_px.abs(), "{little:?} {much:?}");
        prop_assert!(much.delta_flux.abs() >= little.delta_flux.abs(), "{little:?} {much:?}");
    }

    /// Times in years or days, doses per g or kg, temperatures in K or °C, charges in e- or ke-, clocks in ms or s.
    #[test]
    fn the_spelling_of_units_does_not_matter(
        mission in mission(),
        rows in prop::collection::vec((0.0..0.1, 0.01..10.0, 80.0..220.0, decades(-2.0, 3.0), decades(1.0, 5.0), 1..50), 1..20),
    ) {
        let table = |units: [&str; 5], spelled: &dyn Fn([f64; 5]) -> [f64; 5]| {
            let [t, dose, kelvin, line, signal] = units;
            let mut text = format!(
                "# observable: trail\ntrail_px,value,sigma,t_yr [{t}],dose_mev_g [{dose}],temperature_k [{kelvin}],\
                 line_time_ms [{line}],signal_e [{signal}]\n"
            );
            for &(value, t_yr, kelvin, line, signal, pixel) in &rows {
                let [t, dose, kelvin, line, signal] = spelled([t_yr, 1e7 * t_yr, kelvin, line, signal]);
                text += &format!("{pixel},{value},0.001,{t},{dose},{kelvin},{line},{signal}\n");
            }
            DataSet::of(Table::parse("random", &text).unwrap(), &mission).unwrap_or_else(|error| panic!("{error}"))
        };
        let plain = table(["yr", "MeV/g", "K", "ms", "e-"], &|row| row);
        let other = table(["d", "keV / g", "deg_C", "s", "ke-"], &|[t, dose, kelvin, line, signal]| {
            [t * 365.25, dose * 1e3, kelvin - 273.15, line / 1e3, signal / 1e3]
        });
        for (a, b) in plain.rows.iter().zip(&other.rows) {
            let same = |x: f64, y: f64| (x - y).abs() <= 1e-11 * x.abs().max(y.abs());
            prop_assert!(same(a.at.t_yr, b.at.t_yr) && same(a.at.line_time_ms, b.at.line_time_ms));
            prop_assert!(same(a.at.temperature_k, b.at.temperature_k));
            prop_assert!(same(a.at.dose_mev_g.unwrap(), b.at.dose_mev_g.unwrap()));
            prop_assert!(same(a.at.signal_e.unwrap(), b.at.signal_e.unwrap()) && a.at.trail_px == b.at.trail_px);
        }
    }
}

proptest! {
    #![proptest_config(config(12))]

    #[test]
    fn threads_do_not_matter(mission in mission_with_effect()) {
        let with = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| report(evaluate(&mission).unwrap()).render(Format::Json))
        };
        prop_assert_eq!(with(1), with(3));
    }
}
