//! The low orbit: HST ACS/WFC.

use ctiplan::mission::{Mission, SolarPhase};

use super::drawn::{self, Band, Drawn};
use super::flown::*;

/// Launch of the camera, decimal year.
const LAUNCH: f64 = 2002.1616;
/// Solar minimum before the greatest rate within the mission, decimal year (that of the model).
const MINIMUM: f64 = 2008.9;
/// Published modulation over the cycle, with its errors: least and most (Massey et al. 2025, arXiv:2509.05057).
pub const MODULATION: (f64, f64) = (0.185 - 0.005, 0.185 + 0.045);
/// Published lag of the greatest rate behind the minimum, yr (the same: 430 d, −5 +11).
pub const LAG_YR: f64 = 430.0 / 365.25;

/// Spheres behind which the modulation is computed, mm of aluminium.
pub const THICKNESSES_MM: [f64; 5] = [10.0, 15.0, 20.0, 40.0, 80.0];

pub fn mission() -> Mission {
    Mission::parse(include_str!("../../missions/flown/hst_acs.toml")).expect("a valid mission")
}

/// Times (decimal years), traps per pixel and errors: launch, then the published dates, neighbours within a year as their mean.
fn densities() -> Vec<(f64, f64, f64)> {
    let rows = rows(include_str!("../../missions/flown/hst_acs_trap_density.ecsv"));
    let rows: Vec<(f64, f64, f64)> = rows
        .iter()
        .map(|(t_yr, value, sigma)| (LAUNCH + t_yr.parse::<f64>().expect("years"), *value, *sigma))
        .collect();
    let mut means = vec![(LAUNCH, 0.0, 0.0)];
    for group in rows.chunk_by(|one, next| next.0 - one.0 < 1.0) {
        let n = group.len() as f64;
        let mean = |of: fn(&(f64, f64, f64)) -> f64| group.iter().map(of).sum::<f64>() / n;
        means.push((mean(|row| row.0), mean(|row| row.1), mean(|row| row.2) / n.sqrt()));
    }
    means
}

/// A stretch of time and the growth in it over the mean growth.
pub struct Stretch {
    pub from: f64,
    pub to: f64,
    pub growth: Compared,
}

/// Growth between published dates, over that from launch to the last.
pub fn stretches(flown: &impl Dose) -> Vec<Stretch> {
    let dates = densities();
    let (first, last) = (dates[0], dates[dates.len() - 1]);
    let mean = last.1 / (last.0 - first.0);
    let model_mean = flown.rate(first.0, last.0);
    let between = |pair: &[(f64, f64, f64)]| {
        let [(from, low, low_error), (to, high, high_error)] = [pair[0], pair[1]];
        let scale = 1.0 / ((to - from) * mean);
        let growth = Compared {
            published: (high - low) * scale,
            error: low_error.hypot(high_error) * scale,
            model: flown.rate(from, to) / model_mean,
        };
        Stretch { from, to, growth }
    };
    dates.windows(2).map(between).collect()
}

/// The same under drawn Suns.
pub fn bands() -> Vec<Band> {
    let growth = |course: &drawn::Course| stretches(course).into_iter().map(|stretch| stretch.growth).collect();
    Drawn::of(&mission()).bands(growth)
}

/// Ratio of growth before a date to growth after it, by several analyses.
pub struct Ratio {
    pub analysis: &'static str,
    pub ratio: Compared,
}

/// Straight lines before and after the change of temperature in 2006-07 (or the repair of 2009-05), as `hst_acs_trap_density.csv` and
/// the pages of the institute have them.
pub fn ratios(flown: &Flown) -> Vec<Ratio> {
    const END: f64 = 2024.8;
    let of = |analysis, before: f64, after: f64, error: f64, from: f64, to: f64, end: f64| Ratio {
        analysis,
        ratio: Compared { published: before / after, error, model: flown.slope(LAUNCH, from) / flown.slope(to, end) },
    };
    // Errors where both lines have one: 0.0023/0.1554 and 0.0003/0.1707.
    let error = 0.15535 / 0.17072 * f64::hypot(0.0023 / 0.15535, 0.0003 / 0.17072);
    vec![
        of("trails at 176 dates, before and after 2006-07", 0.15535, 0.17072, error, 2006.5, 2006.5, END),
        of("trails to 2014, before and after 2009-05", 0.12962, 0.20641, f64::NAN, 2009.37, 2009.37, 2014.0),
        of(
            "extended pixel edge response at 1620 e-, to 2005-06, from 2006-07",
            1.17e-5,
            1.66e-5,
            f64::NAN,
            2005.5,
            2006.5,
            2010.0,
        ),
    ]
}

/// Whether some analyses have more early growth than the model, and some less.
pub fn among(ratios: &[Ratio]) -> bool {
    let more = |one: &&Ratio| one.ratio.published > one.ratio.model;
    (1..ratios.len()).contains(&ratios.iter().filter(more).count())
}

/// Dose rates (MeV/g/yr) at solar minimum and maximum behind a sphere of aluminium, on a circle.
pub fn extremes(thickness_mm: f64, altitude_km: f64) -> (f64, f64) {
    let at = |phase| {
        let mut mission = mission();
        let orbit = mission.orbit.as_mut().expect("an orbit");
        (orbit.perigee_km, orbit.apogee_km) = (Some(altitude_km), Some(altitude_km));
        mission.environment.solar_phase = Some(phase);
        Flown::behind(&mission, thickness_mm).rate(LAUNCH, LAUNCH + 10.0)
    };
    (at(SolarPhase::Min), at(SolarPhase::Max))
}

/// (MIN − MAX)/(MIN + MAX).
pub fn modulation((minimum, maximum): (f64, f64)) -> f64 {
    (minimum - maximum) / (minimum + maximum)
}

/// Years from the solar minimum to the greatest dose rate after it.
pub fn lag_yr(flown: &Flown) -> f64 {
    const STEP_YR: f64 = 1.0 / 365.25;
    let rate = |day: &i32| {
        let year = MINIMUM + f64::from(*day) * STEP_YR;
        flown.rate(year - 0.1, year + 0.1)
    };
    let greatest = (0..1500).max_by(|one, other| rate(one).total_cmp(&rate(other)));
    STEP_YR * f64::from(greatest.expect("days"))
}

pub fn report() -> Vec<String> {
    let mission = mission();
    let flown = Flown::new(&mission);
    let mut lines = vec!["Growth over the mean growth, behind 15 mm".into()];
    lines.push(" from     to          published    model  diff [sigma]".into());
    let stretches = stretches(&flown);
    for stretch in &stretches {
        lines.push(format!(" {:.1}  {:.1}  {}", stretch.from, stretch.to, stretch.growth.words()));
    }
    let growth: Vec<Compared> = stretches.iter().map(|stretch| stretch.growth).collect();
    lines.push(format!(" {}", verdict(&growth)));
    let names: Vec<String> =
        stretches.iter().map(|stretch| format!("{:.1}  {:.1}", stretch.from, stretch.to)).collect();
    lines.push(String::new());
    lines.extend(drawn::table("Growth over the mean growth, behind 15 mm", "from     to   ", &names, &bands()));
    lines.push(String::new());
    lines.push("Growth before over growth after".into());
    lines.push(format!(" {:<66} published     model  diff [sigma]", "analysis"));
    for Ratio { analysis, ratio } in ratios(&flown) {
        let (error, sigma) = match ratio.error.is_finite() {
            true => (format!("+- {:.2}", ratio.error), format!("{:+.1}", ratio.sigma())),
            false => (String::new(), String::new()),
        };
        lines.push(
            format!(" {analysis:<66} {:>4.2} {error:<7} {:>5.2} {sigma:>13}", ratio.published, ratio.model)
                .trim_end()
                .into(),
        );
    }
    let words = if among(&ratios(&flown)) { "met" } else { "not met" };
    lines.push(format!(" the model among the analyses: {words}"));
    lines.push(String::new());
    lines.push("Modulation over the solar cycle, (MIN - MAX)/(MIN + MAX) [%]; dose rates in MeV/g/yr".into());
    lines.push(" mm Al     MIN, 590 km  MAX, 590 km  590 km  540 km".into());
    for thickness_mm in THICKNESSES_MM {
        let [high, low] = [590.0, 540.0].map(|altitude_km| extremes(thickness_mm, altitude_km));
        let [high_percent, low_percent] = [high, low].map(|both| 100.0 * modulation(both));
        let [minimum, maximum] = [high.0, high.1].map(|rate| format!("{rate:.3e}"));
        lines.push(format!(" {thickness_mm:<5} {minimum:>15} {maximum:>12} {high_percent:>7.1} {low_percent:>7.1}"));
    }
    lines.push(format!(" published: {:.1} to {:.1}", 100.0 * MODULATION.0, 100.0 * MODULATION.1));
    let lag_yr = lag_yr(&flown);
    lines.push(format!(
        "Greatest dose rate after the minimum of {MINIMUM}: {lag_yr:.2} yr later; published {LAG_YR:.2}"
    ));
    lines
}
