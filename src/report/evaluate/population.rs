//! Shear biases of a population, in words.

use super::Depth;
use crate::mission::keys::plain;
use crate::mission::{Mission, PopulationNoise};
use crate::plan::population::{Camera, Estimated, PopulationBias};
use crate::report::{Parts, exceeded, table};

/// Biases by year, or at the end of the mission.
pub(super) fn say(biases: &PopulationBias, mission: &Mission, depth: Depth, out: &mut Parts) {
    let Some(population) = &mission.population else { return };
    let whole = if biases.evaluated < biases.galaxies { format!(" of {}", biases.galaxies) } else { String::new() };
    out.heading(format!("Shear biases of the population: {}{whole} galaxies", biases.evaluated));
    let mut years = table(&["t [yr]", "c1", "+-", "c2", "+-", "m1", "+-", "m2", "+-"]);
    let from = if depth == Depth::Whole { 0 } else { biases.years.len().saturating_sub(1) };
    for (t_yr, bias) in &biases.years[from..] {
        let cells = bias.c.iter().chain(&bias.m).flat_map(|estimated: &Estimated| {
            let error = estimated.error.map_or("-".into(), |error| format!("{error:.0e}"));
            [format!("{:+.2e}", estimated.value), error]
        });
        years.add_row([t_yr.to_string()].into_iter().chain(cells));
    }
    out.table(years);
    if population.table.is_none() {
        let Camera { one_electron_mag, pixel_arcsec } = Camera::of(mission, population);
        let [bright, faint] = [population.magnitude_range[0], population.magnitude_range[1]];
        let faintest_e = 10_f64.powf(-0.4 * (faint - one_electron_mag));
        out.words(
            format!(
                "  Galaxies drawn from a distribution: {bright} to {faint} mag ({faintest_e:.0} e- at the faint limit); pixels of \
                 {pixel_arcsec} arcsec."
            ),
            2,
        );
    }
    let stars = match population.psf_stars_e {
        None => "PSF known without trails (no psf_stars_e)".into(),
        Some(flux_e) => format!("the trailing of PSF stars of {} e- is subtracted", plain(flux_e)),
    };
    let noise = match population.noise {
        PopulationNoise::Neglected => "without noise",
        PopulationNoise::Included => "with the noise of one exposure",
    };
    let [r1, r2] = biases.response;
    let exposures = match population.dither_rows_px.len() {
        1 => String::new(),
        exposures => format!(" and {exposures} exposures"),
    };
    out.words(
        format!(
            "  Shear responsivity {r1:.3} (e1), {r2:.3} (e2); {stars}; {noise}; mean over {} orientation{}{exposures}. Errors: finite \
             sample.",
            population.orientations_deg.len(),
            if population.orientations_deg.len() == 1 { "" } else { "s" }
        ),
        2,
    );
}

/// Galaxies that are left out.
pub(super) fn warn(biases: &PopulationBias, out: &mut Parts) {
    if biases.lost > 0 {
        let lost = biases.lost;
        out.warning(format!(
            "{lost} galaxies have no measurable shape, before or after the readout: they are left out"
        ));
    }
}

/// Whether and when the limits are exceeded.
pub(super) fn judge(biases: &PopulationBias, mission: &Mission, out: &mut Parts) {
    let factor = mission.requirement.correction_factor;
    for (name, what, verdict) in [("c", "additive", &biases.c), ("m", "multiplicative", &biases.m)] {
        let Some(verdict) = verdict else { continue };
        out.verdict(format!("Budget, design case: {what} shear bias {name} within +- {}", plain(verdict.limit)), 2);
        let corrected = format!("corrected, factor {factor}");
        let width = corrected.len();
        for (how, crossing) in [("uncorrected", &verdict.uncorrected), (corrected.as_str(), &verdict.corrected)] {
            out.judged(how, width, exceeded(crossing, mission.mission.launch.0), crossing.t_yr.is_none());
        }
    }
}
