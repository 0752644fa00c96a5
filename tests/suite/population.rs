//! Shear biases of populations: against GalSim and ArCTIc (`tests/golden/population.py`), and laws of their own.

use std::fs;

use ctiplan::evaluate;
use ctiplan::mission::Mission;
use ctiplan::plan::judgement::Limited;
use ctiplan::plan::population::{PopulationBias, ShearBias};
use ctiplan::study::Study;
use ctiplan::study::calibration::Calibration;
use ctiplan::study::correction::{Cause, Correction};
use serde_json::Value;
use tempfile::TempDir;

const SNAP: &str = include_str!("../../missions/snap_l2.toml");

/// SNAP with a `[population]` of these keys and these more of `[requirement]`; a table is written beside the mission.
fn mission(table: Option<&str>, population: &str, requirement: &str) -> Mission {
    let folder = TempDir::new().unwrap();
    let mut keys = population.to_string();
    if let Some(table) = table {
        fs::write(folder.path().join("galaxies.csv"), table).unwrap();
        keys += "\ntable = \"galaxies.csv\"";
    }
    let text = SNAP.replace("[requirement]", &format!("[population]\n{keys}\n\n[requirement]\n{requirement}"));
    let path = folder.path().join("mission.toml");
    fs::write(&path, text).unwrap();
    Mission::read(&path).unwrap()
}

fn biases(mission: &Mission) -> PopulationBias {
    evaluate(mission).unwrap().with_population(1).unwrap().population.unwrap()
}

fn end(mission: &Mission) -> ShearBias {
    biases(mission).years.last().unwrap().1
}

const LAW: &str = "one_electron_mag = 33.0\npixel_arcsec = 0.1\n";

/// Whether the limits on biases are kept, with correction, to the end of the mission.
fn met(biases: &PopulationBias) -> bool {
    [&biases.c, &biases.m].into_iter().flatten().all(|verdict| verdict.corrected.crossings_yr.is_empty())
}

#[test]
fn biases_are_those_of_galsim_and_arctic() {
    let golden: Value = serde_json::from_str(include_str!("../golden/population.json")).unwrap();
    let number = |key: &str| golden[key].as_f64().unwrap();
    let table = include_str!("../golden/population.csv");
    let [alone, stars] = ["", "psf_stars_e = 1e4"].map(|keys| end(&mission(Some(table), keys, "")));
    for (what, found, of_error) in [
        ("c1", alone.c[0], number("c1_error")),
        ("c1_stars", stars.c[0], number("c1_stars_error")),
        ("m1", alone.m[0], number("m1_error")),
    ] {
        let expected = number(what);
        let error = found.error.unwrap();
        println!("{what}: {:.5e} +- {error:.1e}, oracle {expected:.5e} +- {of_error:.1e}", found.value);
        assert!((found.value / expected - 1.0).abs() < 0.01, "{what}: {} {expected}", found.value);
        assert!((error / of_error - 1.0).abs() < 0.02, "{what}: {error} {of_error}");
    }
}

#[test]
fn a_population_of_one_galaxy_changes_as_that_galaxy() {
    let table = "weight\n3.0\n";
    let mission = mission(Some(table), "", "");
    let evaluation = evaluate(&mission).unwrap();
    let found = biases(&mission);
    for ((_, bias), year) in found.years.iter().zip(&evaluation.years) {
        let change = year.galaxies[evaluation.model.judged()].unwrap();
        let c = bias.c[0].value * found.response[0];
        // Shears of 0.01 are not infinitely small; a parabola in the density is not all.
        assert!((c / change.delta_e1 - 1.0).abs() < 1e-3, "{c} {change:?}");
        assert_eq!((bias.c[0].error, bias.m[0].error), (None, None));
    }
    assert_eq!((found.galaxies, found.evaluated, found.lost), (1, 1, 0));
}

#[test]
fn galaxies_of_opposite_ellipticity_have_the_multiplicative_bias_of_their_difference() {
    let found = biases(&mission(Some("e1\n0.4\n-0.4\n"), "", ""));
    let bias = found.years.last().unwrap().1;
    let change = |e1: f64| {
        let mission =
            Mission::parse(&SNAP.replacen("weight_px = 5.4", &format!("e1 = {e1}\nweight_px = 5.4"), 1)).unwrap();
        evaluate(&mission).unwrap().end().galaxies[0].unwrap().delta_e1
    };
    // A shear of g changes an intrinsic e1 of 0 by 2 g: d(Δe1)/de1 is half of what trailing takes from the response.
    let slope = (change(0.4) - change(-0.4)) / 0.8;
    assert!((slope + 3.8e-4).abs() < 0.1e-4, "{slope}");
    // At e1 = ±0.4 a shear changes e1 by 2 g (1 − e1²).
    let of_response = 0.5 * bias.m[0].value * found.response[0] / (1.0 - 0.4 * 0.4);
    assert!((of_response / slope - 1.0).abs() < 0.15, "{of_response} {slope}");
}

#[test]
fn errors_fall_as_the_root_of_the_number() {
    let error = |galaxies: u32| {
        let bias = end(&mission(None, &format!("{LAW}galaxies = {galaxies}"), ""));
        [bias.c[0].error.unwrap(), bias.m[0].error.unwrap()]
    };
    let (few, many) = (error(24), error(96));
    for member in [0, 1] {
        assert!((1.2..3.4).contains(&(few[member] / many[member])), "{few:?} {many:?}");
    }
}

#[test]
fn orientations_cancel_the_additive_bias_and_average_the_multiplicative_one() {
    let table = "e1,e2\n0.3,0.2\n-0.1,0.4\n";
    let of = |orientations: &str| end(&mission(Some(table), &format!("orientations_deg = {orientations}"), ""));
    let (one, opposite, crossed, all) = (of("[0]"), of("[0, 180]"), of("[0, 90]"), of("[0, 45, 90, 135]"));
    assert!(one.c[0].value.abs() > 1e-3);
    for member in [0, 1] {
        // Trails to the other side are the same ellipse.
        assert!((opposite.c[member].value - one.c[member].value).abs() < 1e-12);
        assert!(crossed.c[member].value.abs() < 1e-12 && all.c[member].value.abs() < 1e-12);
        // A quarter turn only changes the sign of e1 and e2. An eighth exchanges them.
        assert!((crossed.m[member].value / one.m[member].value - 1.0).abs() < 1e-9);
        let [least, most] = [one.m[0].value.min(one.m[1].value), one.m[0].value.max(one.m[1].value)];
        assert!(all.m[member].value > least && all.m[member].value < most, "{all:?} {one:?}");
    }
    assert!((all.m[0].value - all.m[1].value).abs() < 1e-12);
}

/// A dither of nothing changes no bit; the mean over exposures is that of missions with one exposure each, in rows and in columns.
#[test]
fn biases_of_dithers_are_the_mean_of_those_of_each_exposure() {
    let serial = "[effects.serial-traps]\npixel_time_ms = 0.025\ntransfers = 1000\n[[effects.serial-traps.traps]]\n\
                  name = \"serial\"\ndensity_per_px = 0.3\nrelease_ms = 0.1\nenergy_ev = 0.2\n";
    let table = "e1,e2,transfers\n0.3,0.2,1000\n-0.1,0.4,1500\n";
    let of = |dithers: &str| {
        let mut mission = mission(Some(table), dithers, "");
        let effects = serial.parse::<toml::Table>().unwrap().remove("effects").unwrap();
        mission.effects = effects.as_table().unwrap().clone();
        end(&mission)
    };
    let own = of("");
    assert_eq!(own, of("dither_rows_px = [0.0]\ndither_columns_px = [0.0]"));
    let (rows, columns) = (of("dither_rows_px = [-600]"), of("dither_rows_px = [0]\ndither_columns_px = [800]"));
    // Nearer to the register, less is trailed along y; farther from the amplifier, more along x: e1 falls by either less or more.
    assert!(rows.c[0].value > own.c[0].value && columns.c[0].value > own.c[0].value, "{own:?} {rows:?} {columns:?}");
    let mean = of("dither_rows_px = [0, -600, 0]\ndither_columns_px = [0, 0, 800]");
    for member in [0, 1] {
        for of in [|bias: &ShearBias| bias.c, |bias: &ShearBias| bias.m] {
            let expected = [&own, &rows, &columns].map(|bias| of(bias)[member].value).iter().sum::<f64>() / 3.0;
            let found = of(&mean)[member].value;
            assert!((found - expected).abs() < 1e-12 + 1e-9 * expected.abs(), "{found} {expected}");
        }
    }
    // An exposure in which a galaxy is not on the detector does not count for it: of these two, the first galaxy has one.
    let (both, far) = (of("dither_rows_px = [0, -1200]"), of("dither_rows_px = [-1200]"));
    assert!(both != own && far.c[0].error.is_none(), "{both:?} {far:?}");
}

#[test]
fn limits_on_biases_are_judged_like_the_one_on_a_galaxy() {
    let table = "e1\n0.4\n-0.4\n";
    let found = biases(&mission(Some(table), "", "c = 1e-3\nm = 1e-3"));
    let (c, m) = (found.c.as_ref().unwrap(), found.m.as_ref().unwrap());
    for (verdict, of) in [(c, (|bias| bias.c[0].value) as fn(&ShearBias) -> f64), (m, |bias| bias.m[0].value)] {
        // Biases grow about evenly.
        let end = of(&found.years[4].1).abs();
        assert!((verdict.uncorrected.t_yr.unwrap() / (5.0 * 1e-3 / end) - 1.0).abs() < 0.02, "{verdict:?}");
        assert!(verdict.corrected.t_yr.is_none() && verdict.corrected.limit == 1e-2);
        assert!((verdict.corrected.margin.unwrap() - (1e-2 - end)).abs() < 1e-9);
    }
    assert!(met(&found));
    assert!(!met(&biases(&mission(Some(table), "", "c = 1e-5"))));
}

#[test]
fn nothing_but_a_population_can_be_judged() {
    let mut text = SNAP.replace("delta_e = 1.0e-3", "c = 1.0e-4");
    text = text.replace("[requirement]", &format!("[population]\n{LAW}galaxies = 4\n[requirement]"));
    let mission = Mission::parse(&text).unwrap();
    let evaluation = evaluate(&mission).unwrap();
    assert!(evaluation.verdict.corrected.crossings_yr.is_empty());
    // The resolved mission is one.
    assert_eq!(Mission::parse(&toml::to_string(&mission.to_table()).unwrap()).unwrap(), mission);
}

#[test]
fn without_a_scale_the_faintest_galaxies_of_the_law_have_the_flux_of_the_judged_one() {
    let (plain, given) = ("galaxies = 2", "galaxies = 2\npixel_arcsec = 0.1\none_electron_mag = 32.151744601584");
    // 24.5 + 2.5 log10(1150)
    let [plain, given] = [plain, given].map(|keys| end(&mission(None, keys, "")));
    assert!((plain.c[0].value / given.c[0].value - 1.0).abs() < 1e-6, "{plain:?} {given:?}");
}

#[test]
fn any_number_of_threads_gives_the_same_bits() {
    let mission = mission(None, &format!("{LAW}galaxies = 3\nnoise = \"included\"\npsf_stars_e = 1e4"), "");
    let of = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| biases(&mission).years)
    };
    assert_eq!(of(1), of(3));
}

#[test]
fn what_a_table_cannot_be_is_refused_with_its_line() {
    let refused = |table: &str| {
        let folder = TempDir::new().unwrap();
        fs::write(folder.path().join("galaxies.csv"), table).unwrap();
        let text = SNAP.replace("[requirement]", "[population]\ntable = \"galaxies.csv\"\n[requirement]");
        let path = folder.path().join("mission.toml");
        fs::write(&path, text).unwrap();
        Mission::read(&path).unwrap_err().to_string()
    };
    for (table, parts) in [
        ("flux_e\n100\n-5\n", vec!["galaxies.csv", "line 3", "-5", "above 0"]),
        ("e1,e2\n0.8,0.8\n", vec!["line 2", "1.131", "up to 0.95"]),
        ("flux,e1\n1,0\n", vec!["`flux`", "flux_e"]),
        ("transfers\n1.5\n", vec!["line 2", "1.5", "whole numbers"]),
        ("flux_e\n", vec!["no rows"]),
        ("weight\n0\n", vec!["weights is 0"]),
    ] {
        let message = refused(table);
        assert!(message.contains("cannot read galaxies") && !message.contains("measurements"), "{table}: {message}");
        for part in parts {
            assert!(message.contains(part), "{table}: {message}");
        }
    }
    let parsed = |population: &str, requirement: &str| {
        let text = SNAP.replace("[requirement]", &format!("{population}\n[requirement]\n{requirement}"));
        Mission::parse(&text).unwrap_err().to_string()
    };
    let of_table = |law: &str| parsed(&format!("[population]\ntable = \"galaxies.csv\"\n{law}"), "");
    for (message, part) in [
        (of_table("magnitude_range = [20.0, 25.0]"), "belongs to the law of galaxies"),
        (of_table("pixel_arcsec = 0.2"), "belongs to the law of galaxies"),
        (parsed("", "c = 1e-4"), "there is no [population]"),
        (parsed(&format!("[population]\n{LAW}magnitude_range = [25.0, 20.0]"), ""), "brighter one"),
        (
            parsed(&format!("[population]\n{LAW}dither_columns_px = [0, 5]"), ""),
            "2 offsets in columns (px), but 1 in rows",
        ),
        (parsed(&format!("[population]\n{LAW}dither_rows_px = {:?}", [0.0; 65]), ""), "allowed: 1 to 64"),
    ] {
        assert!(message.contains(part), "{message}");
    }
}

/// Densities and release times are off; the rest is known.
fn correction(density_error: f64, release_error: f64) -> Correction {
    Correction {
        density_error,
        release_error,
        well_fill_error: 0.0,
        draws: 2,
        realisations: 0,
        ..Correction::default()
    }
}

/// To first order a correction leaves of a population's c what its iterations leave of the galaxy.
#[test]
fn a_correction_leaves_of_a_population_of_one_galaxy_what_it_leaves_of_that_galaxy() {
    let mission = mission(Some("weight\n3.0\n"), "", "c = 1e-4");
    let found = correction(0.02, 0.02).study(&mission, &|| {}).unwrap();
    let (galaxy, population) = (found.remainder.unwrap(), found.population.unwrap());
    let squares: f64 = galaxy
        .causes
        .iter()
        .filter(|left| matches!(left.cause, Cause::Parameter(_)))
        .map(|left| left.delta_e.unwrap().powi(2))
        .sum();
    let share = squares.sqrt() / galaxy.uncorrected_delta_e;
    let c1 = &population.biases[0];
    assert_eq!((c1.bias.as_str(), c1.uncorrected_error, c1.factor_error), ("c1", None, None));
    // Shears of 0.01, and a step of 5 % for one of 2 %.
    assert!((c1.left / c1.uncorrected.abs() / share - 1.0).abs() < 0.03, "{c1:?} {share}");
    assert!((c1.factor.unwrap() * c1.left_percent.unwrap() - 100.0).abs() < 1e-9);
    assert!((c1.used_percent.unwrap() - 1e6 * c1.left).abs() < 1e-9);
}

/// What the population asks of the correction is what calibrations must reach; and where galaxies differ, a bias and what is left of it
/// have errors that go together.
#[test]
fn what_a_population_asks_of_a_correction_is_what_calibrations_must_reach() {
    let mission = mission(None, &format!("{LAW}galaxies = 8"), "c = 1.1e-4\nm = 1e-3");
    let found = correction(0.05, 0.0).study(&mission, &|| {}).unwrap().population.unwrap();
    let asked = Calibration { samples: 50, ..Calibration::default() };
    let known = asked.study(&mission, &|| {}).unwrap().known;
    assert_eq!(found.tolerances.len(), known.len());
    for (tolerance, known) in found.tolerances.iter().zip(&known) {
        let needed = match known.by {
            Some(Limited::C) => tolerance.needed_c_percent,
            Some(Limited::M) => tolerance.needed_m_percent,
            _ => continue,
        };
        assert_eq!((&tolerance.parameter, needed), (&known.parameter, known.needed_percent));
    }
    let density = &found.tolerances[0];
    assert!((density.error_percent.unwrap() - 5.0).abs() < 1e-9 && found.tolerances[4].error_percent.is_none());
    for bias in [&found.biases[0], &found.biases[2]] {
        let relative = bias.uncorrected_error.unwrap() / bias.uncorrected.abs();
        let left = bias.left_error_percent.unwrap() / bias.left_percent.unwrap();
        assert!(left > 0.0 && left < 0.5 * relative, "{bias:?}");
    }
    // Half the error leaves half.
    let half = correction(0.025, 0.0).study(&mission, &|| {}).unwrap().population.unwrap();
    assert!((half.biases[0].left / found.biases[0].left - 0.5).abs() < 1e-9);
}
