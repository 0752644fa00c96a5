//! An uncertain damage curve → uncertainty of the number of traps.
//!
//! The logarithm of the true NIEL over the published one is σ g(ln E), where g is a Gaussian process: at each energy its mean is 0
//! and its variance 1, and energies are correlated by
//!
//! ```text
//! ρ(E, E') = exp(−(ln E − ln E')²/2ℓ²)
//! ```
//!
//! A dose D = ∫ NIEL φ dE changes by the mean of g over the energies behind the shield that make it, with weights w(E) dE in
//! proportion to NIEL φ dE. Where densities are quoted at a fluence of protons of E_ref, their dose changes by g(E_ref). The number
//! of traps is in proportion to D/D_ref, so that to first order in σ its logarithm is normal with standard deviation σ s:
//!
//! ```text
//! s² = var(Σ wᵢ g(Eᵢ) − g(E_ref)) = Σ wᵢ wⱼ ρ(Eᵢ, Eⱼ) − 2 Σ wᵢ ρ(Eᵢ, E_ref) + 1
//! ```
//!
//! and only the first term where densities are quoted at a dose. As ρ is between 0 and 1, s² ≤ 2 behind any shield.

use crate::environment::esp;
use crate::environment::spectrum::Spectrum;
use crate::mission::{DoseModel, Mission};
use crate::model::Model;

/// Correlation length ℓ of a damage curve's error, in ln E: half a decade. Measured on the two published curves (a test): the
/// correlation of ln(RD50/SR-NIEL) at two energies falls to exp(−½) between 0.5 and 0.6 decades and vanishes near one decade, and its
/// root mean square from 10 keV to 1 GeV is 0.108, about its default σ.
const CORRELATION_LENGTH: f64 = 0.5 * std::f64::consts::LN_10;

/// Energies (MeV) behind the shield by which a dose is divided: protons of less make almost no damage, and of more are too few.
const ENERGIES_MEV: (f64, f64) = (1e-3, 1e5);

/// Number of intervals between them: four in a decade, half a correlation length each.
const INTERVALS: usize = 32;

/// Standard deviation of the logarithm of a mission's number of traps for a damage curve of unit uncertainty, s. None if its dose
/// does not depend on the curve, or is zero.
pub(super) fn sensitivity(mission: &Mission) -> Option<f64> {
    let environment = &mission.environment;
    let given = environment.active_dose_rate_mev_g_yr.is_some()
        || environment.model == DoseModel::History
        || environment.dose_depth.is_some();
    if given {
        return None;
    }
    let weights = weights(mission)?;
    let mean = |log: f64| weights.iter().map(|(other, weight)| weight * correlation(log - other)).sum::<f64>();
    let of_dose: f64 = weights.iter().map(|(log, weight)| weight * mean(*log)).sum();
    let detector = &mission.detector;
    let of_reference = match detector.reference_energy_mev.filter(|_| detector.reference_dose_mev_g.is_none()) {
        Some(energy_mev) => 1.0 - 2.0 * mean(energy_mev.ln()),
        None => 0.0,
    };
    Some((of_dose + of_reference).max(0.0).sqrt())
}

/// Correlation of the curve's error at two energies, by the difference of their logarithms.
fn correlation(difference: f64) -> f64 {
    (-0.5 * (difference / CORRELATION_LENGTH).powi(2)).exp()
}

/// Shares of the mission's dose by the energy of protons behind the shield: ln E (MeV) in the middle of each interval, and the share.
fn weights(mission: &Mission) -> Option<Vec<(f64, f64)>> {
    let (shield, niel) = (mission.shield()?, mission.environment.niel.curve());
    let model = Model::new(mission);
    let (history, duration_yr) = (model.history(), mission.mission.duration_yr);
    let year = esp::fluence(mission.environment.confidence, 1.0);
    let total = |of: &dyn Fn(&Spectrum) -> f64| -> f64 {
        if history.sources.is_empty() {
            return of(&year);
        }
        history.sources.iter().map(|source| history.of_spectrum(source, duration_yr, of)).sum()
    };
    let (from, to) = (ENERGIES_MEV.0.ln(), ENERGIES_MEV.1.ln());
    let log = |edge: f64| from + (to - from) * edge / INTERVALS as f64;
    let above: Vec<f64> =
        (0..=INTERVALS).map(|edge| total(&|spectrum| shield.fluence(spectrum, log(edge as f64).exp()))).collect();
    let part = |interval: usize| {
        let middle = log(interval as f64 + 0.5);
        (middle, niel.at(middle.exp()) * (above[interval] - above[interval + 1]).max(0.0))
    };
    let parts: Vec<(f64, f64)> = (0..INTERVALS).map(part).collect();
    let dose: f64 = parts.iter().map(|(_, part)| part).sum();
    (dose > 0.0).then(|| parts.into_iter().map(|(log, part)| (log, part / dose)).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::environment::Niel;

    /// ln(RD50/SR-NIEL) over the energies of both fits: its root mean square, and its correlation, as mean of squared differences.
    #[test]
    fn the_correlation_length_is_that_of_published_curves() {
        let count = 500;
        let log = |index: usize| {
            let energy_mev = 10_f64.powf(-2.0 + 5.0 * index as f64 / count as f64);
            (Niel::Rd50.curve().at(energy_mev) / Niel::Sr.curve().at(energy_mev)).ln()
        };
        let logs: Vec<f64> = (0..=count).map(log).collect();
        let square = logs.iter().map(|log| log * log).sum::<f64>() / logs.len() as f64;
        assert!((square.sqrt() - 0.108).abs() < 2e-3, "{}", square.sqrt());
        let found = |decades: f64| {
            let apart = (decades * count as f64 / 5.0).round() as usize;
            let squares = logs.iter().zip(&logs[apart..]).map(|(one, other)| (one - other).powi(2));
            1.0 - 0.5 * squares.sum::<f64>() / (logs.len() - apart) as f64 / square
        };
        for decades in [0.1, 0.25, 0.5, 0.75, 1.0] {
            let expected = correlation(decades * std::f64::consts::LN_10);
            assert!((found(decades) - expected).abs() < 0.1, "{decades}: {} {expected}", found(decades));
        }
    }

    /// At one energy, that of the reference, all of it cancels; far from it, both vary independently.
    #[test]
    fn what_is_common_to_dose_and_reference_cancels() {
        let text = include_str!("../../../missions/snap_l2_shielded.toml");
        let with = |from: &str, to: &str| sensitivity(&Mission::parse(&text.replace(from, to)).unwrap()).unwrap();
        let at_dose = {
            let text = text
                .replace("reference_fluence_cm2 = 2e10", "reference_dose_mev_g = 1.69e8")
                .replace("reference_energy_mev = 12.5", "");
            sensitivity(&Mission::parse(&text).unwrap()).unwrap()
        };
        assert!((0.5..1.0).contains(&at_dose), "{at_dose}");
        let near = with("reference_energy_mev = 12.5", "reference_energy_mev = 30.0");
        let far = with("reference_energy_mev = 12.5", "reference_energy_mev = 0.05");
        assert!(near < 0.9 && near < far && far < 2_f64.sqrt(), "{near} {far}");
        assert!((far.hypot(0.0) - (1.0 + at_dose * at_dose).sqrt()).abs() < 0.1, "{far} {at_dose}");
    }
}
