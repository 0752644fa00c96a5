//! Release times spread log-normally about their median, as many species of one release time each.
//!
//! Traps of a continuum do not know of one another, so that a species of density ρ, median τ and spread σ is the sum of
//! species of densities ρ w and release times τ exp(σ t), with the weights w of a rule of integration over the normal
//! distribution of t. The trapezoidal rule converges faster than any power of its step h for such integrands. What is
//! integrated are decays exp(−m exp(−σ t)/τ), whose Fourier transform falls as exp(−π ω/(2σ)): its error is
//! exp(−π²/(h σ)), and that of the normal distribution itself exp(−2π²/h²).

use super::Trap;

/// Longest step in units of the standard deviation of t: exp(−2π²/h²) is 3e-9.
const LONGEST_STEP: f64 = 1.0;

/// Longest step in ln τ: exp(−π²/(h σ)) is 7e-8.
const LONGEST_STEP_IN_LN_RELEASE: f64 = 0.6;

/// Where the normal distribution is cut off, in standard deviations: beyond it lie 1e-7 of the traps.
const CUT_OFF: f64 = 5.3;

/// The same traps as species of one release time each, `most` of them at most.
pub(super) fn resolved(traps: &[Trap], most: usize) -> Vec<Trap> {
    let spread = traps.iter().filter(|trap| trap.release_sigma > 0.0).count();
    let nodes = (most - (traps.len() - spread)).checked_div(spread).unwrap_or(0);
    let mut species = Vec::new();
    for trap in traps {
        if trap.release_sigma == 0.0 {
            species.push(*trap);
            continue;
        }
        let step = LONGEST_STEP.min(LONGEST_STEP_IN_LN_RELEASE / trap.release_sigma);
        let half = ((CUT_OFF / step).ceil() as i64).min((nodes as i64 - 1) / 2);
        let step = CUT_OFF / half as f64;
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
            let species = resolved(&[trap], 256);
            for after in [0.01, 1.0, 7.0, 30.0, 1000.0] {
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
                // The cut-off leaves 1e-7 of the traps out.
                assert!((kept - 2.0 * fine / total).abs() < 1e-6, "{sigma}, {after}: {kept}, {}", 2.0 * fine / total);
            }
        }
    }

    #[test]
    fn a_spread_of_nothing_is_one_release_time() {
        let trap = Trap::new(1.0, 3.0);
        assert_eq!(resolved(&[trap], 256), vec![trap]);
    }
}
