//! Release times with a log-normal distribution about their median, as many species of one release time each.
//!
//! Traps of a continuum are independent. A species of density ρ, median τ and spread σ is thus the sum of species of densities ρ w
//! and release times τ exp(σ t), with the weights w of a quadrature rule over the normal distribution of t. The trapezoidal rule
//! converges faster than any power of its step h for such integrands. The integrands are decays exp(−m exp(−σ t)/τ), whose Fourier
//! transform falls as exp(−π ω/(2σ)): the error of the rule is exp(−π²/(h σ)), and exp(−2π²/h²) for the normal distribution itself.
//! Steps and the range of t follow from the requested error.

use std::f64::consts::PI;

use super::{Method, Trap};

/// Smallest relative error of the filled traps for which a sum over release times is computed.
pub(super) const FINEST: f64 = 5e-8;

/// Largest such error: with fewer release times, single ones would be visible in a trail.
const COARSEST: f64 = 1e-4;

/// Error of such a sum, as a share of the accuracy of the readout.
const OF_READOUT: f64 = 0.1;

/// Error of the sums over release times for a method: it must be negligible beside that of the transfers.
pub(super) fn error_of(method: Method) -> f64 {
    match method {
        Method::Fast { relative } => (OF_READOUT * relative).clamp(FINEST, COARSEST),
        Method::Exact | Method::CarriedTraps | Method::Fractional { .. } | Method::MonteCarlo { .. } => FINEST,
    }
}

/// The same traps as at most `most` species of one release time each, for a relative error of the filled traps.
pub(super) fn resolved(traps: &[Trap], most: usize, error: f64) -> Vec<Trap> {
    let digits = -error.ln();
    let longest_step = PI * (2.0 / digits).sqrt();
    let longest_step_in_ln_release = PI * PI / digits;
    // The tail beyond c standard deviations equals the error: exp(−c²/2) √(2/π)/c, solved in one step from exp(−c²/2).
    let cut_off = (2.0 * (digits - ((2.0 * digits).sqrt() * (0.5 * PI).sqrt()).ln())).sqrt();
    let spread = traps.iter().filter(|trap| trap.release_sigma > 0.0).count();
    let nodes = (most - (traps.len() - spread)).checked_div(spread).unwrap_or(0);
    let mut species = Vec::new();
    for trap in traps {
        if trap.release_sigma == 0.0 {
            species.push(*trap);
            continue;
        }
        let step = longest_step.min(longest_step_in_ln_release / trap.release_sigma);
        let half = ((cut_off / step).ceil() as i64).min((nodes as i64 - 1) / 2);
        let step = cut_off / half as f64;
        let weight = |node: i64| (-0.5 * (node as f64 * step).powi(2)).exp();
        let total: f64 = (-half..=half).map(weight).sum();
        species.extend((-half..=half).map(|node| Trap {
            density_per_px: trap.density_per_px * weight(node) / total,
            release_transfers: trap.release_transfers * (trap.release_sigma * node as f64 * step).exp(),
            release_sigma: 0.0,
            ..*trap
        }));
    }
    species
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_continuum_decays_as_its_integral_says() {
        for sigma in [0.05, 0.3, 1.0, 2.0] {
            let trap = Trap { release_sigma: sigma, ..Trap::new(2.0, 7.0) };
            for (after, error) in
                [0.01, 1.0, 7.0, 30.0, 1000.0].into_iter().flat_map(|after| [(after, FINEST), (after, 1e-4)])
            {
                let species = resolved(&[trap], 256, error);
                let kept: f64 =
                    species.iter().map(|one| one.density_per_px * (-after / one.release_transfers).exp()).sum();
                // A rule forty times finer, over more standard deviations.
                let (mut fine, mut total) = (0.0, 0.0);
                for node in -1600..=1600 {
                    let t = f64::from(node) / 200.0;
                    let weight = (-0.5 * t * t).exp();
                    fine += weight * (-after / (7.0 * (sigma * t).exp())).exp();
                    total += weight;
                }
                // The step and the cut-off each contribute the error, of either sign.
                let off = kept / 2.0 - fine / total;
                assert!(off.abs() < 4.0 * error, "{sigma}, {after}, {error}: {off}");
            }
        }
    }

    /// The numbers quoted in docs/physics.md.
    #[test]
    fn so_many_release_times_are_summed_over() {
        let trap = Trap { release_sigma: 1.0, ..Trap::new(2.0, 7.0) };
        let count = |method| resolved(&[trap], 256, error_of(method)).len();
        assert_eq!([count(Method::Exact), count(Method::Fast { relative: 1e-4 })], [21, 13]);
    }

    #[test]
    fn a_spread_of_nothing_is_one_release_time() {
        let trap = Trap::new(1.0, 3.0);
        assert_eq!(resolved(&[trap], 256, FINEST), vec![trap]);
    }
}
