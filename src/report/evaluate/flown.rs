//! Dose and traps of a mission that flies, up to the last observation of the Sun.

use crate::mission::Mission;
use crate::plan::flown::Flown;
use crate::report::Parts;

pub(super) fn say(flown: &Flown, mission: &Mission, out: &mut Parts) {
    let Flown { until, t_yr, dose_mev_g, traps_per_px, solar_events_mev_g } = flown;
    let ends = (*t_yr - mission.mission.duration_yr).abs() < 1e-9;
    let after = if ends { "" } else { "; from then on the Sun is a quantile, or drawn where a distribution is given" };
    out.verdict(format!("The Sun as observed, to {until} ({t_yr:.2} yr after launch){after}."), 2);
    out.words(
        format!(
            "Dose by then {:.3e} +- {:.1e} MeV/g, of which solar events {:.3e} +- {:.1e} (error of their calibration alone); traps \
             {:.4} +- {:.4} per pixel. Errors are those of [uncertainty] and of the calibration.",
            dose_mev_g.value,
            dose_mev_g.error,
            solar_events_mev_g.value,
            solar_events_mev_g.error,
            traps_per_px.value,
            traps_per_px.error,
        ),
        2,
    );
    out.gap();
}
