//! A mission in its third year: one like Euclid, before launch and with the Sun as it came since.

use ctiplan::mission::Mission;
use ctiplan::plan::assessment::{Assessment, Options, assess};
use ctiplan::plan::date_distribution::Dates;
use ctiplan::plan::dose::Samples;
use ctiplan::plan::flown::Flown;
use ctiplan::plan::progress::Progress;

use super::flown::with;

/// Draws of each distribution.
pub const DRAWS: u32 = 1000;

pub fn mission() -> Mission {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/missions/euclid_like.toml");
    Mission::read(path).expect("a valid mission")
}

/// The same with the Sun as it was.
pub fn observed() -> Mission {
    with(&mission(), &[("environment.sun", "observed".into())])
}

/// What its CCDs have had, and the quantiles (5, 50, 95 %) of the dose (MeV/g) of the same time with the Sun drawn.
pub fn had() -> (Flown, [f64; 3]) {
    let flown = Flown::of(&observed()).expect("a dose").expect("a mission that flies");
    let so_far = with(&mission(), &[("mission.duration_yr", flown.t_yr.into())]);
    let drawn = Samples::of(&so_far, DRAWS, 1).expect("samples").quantiles;
    let at = |p: f64| drawn.iter().find(|quantile| quantile.p == p).expect("a quantile").dose_mev_g;
    (flown, [0.05, 0.5, 0.95].map(at))
}

/// The distribution of its dates.
fn assessed(mission: &Mission) -> Assessment {
    assess(mission, &Options { samples: DRAWS, ..Options::default() }, &Progress::NONE).expect("an assessment")
}

pub fn report() -> Vec<String> {
    let (flown, [low, median, high]) = had();
    let [dose, events, traps] = [flown.dose_mev_g, flown.solar_events_mev_g, flown.traps_per_px];
    let mut lines = vec![
        format!("From launch to {}, {:.2} yr", flown.until, flown.t_yr),
        format!(
            " dose                 {:.2e} +- {:.1e} MeV/g, of which solar events {:.2e} +- {:.1e}",
            dose.value, dose.error, events.value, events.error
        ),
        format!(" as drawn before      {median:.2e} MeV/g at 50 %, {low:.2e} at 5 %, {high:.2e} at 95 %"),
        format!(" traps                {:.4} +- {:.4} per pixel", traps.value, traps.error),
        String::new(),
        "Corrected budgets met to the end of the six years [%]".into(),
        format!(" {:<40} {:>13} {:>13}", "budget", "before launch", "as of 2025-09"),
    ];
    let both = [mission(), observed()].map(|mission| assessed(&mission).distribution.expect("a distribution"));
    let row = |name: &str, dates: [&Dates; 2]| {
        let cell = |dates: &Dates| {
            format!("{:>5.1} +- {:<3.1}", 100.0 * dates.probability_met(), 100.0 * dates.probability_error)
        };
        format!(" {name:<40} {:>13} {:>13}", cell(dates[0]), cell(dates[1]))
    };
    let [before, now] = &both;
    lines.push(row("change of ellipticity, without noise", [&before.corrected, &now.corrected]));
    for (name, limits) in
        [("additive shear bias", [&before.c, &now.c]), ("multiplicative shear bias", [&before.m, &now.m])]
    {
        let of = |limit: usize| &limits[limit].as_ref().expect("a limit").corrected;
        lines.push(row(name, [of(0), of(1)]));
    }
    lines.push(format!(" +-: from the number of draws, {} and {}", before.samples, now.samples));
    lines
}
