//! Orbit and date → fraction of the interplanetary protons that arrives there.
//!
//! The field deflects protons below a cutoff rigidity, and the Earth blocks part of the sky:
//!
//! ```text
//! x(E) = mean over the orbit of v · [L > 5 or R(E) > 14.5/L² GV]      v = (1 + √(1 − 1/r²))/2
//! ```
//!
//! Vertical cutoff of Størmer as in Smart & Shea 2005 (Adv. Space Res. 36, 2012); protons of any energy beyond L = 5 in quiet
//! conditions (Stassinopoulos & King 1974, IEEE Trans. Aerosp. Electron. Syst. 10, 442); L in the eccentric dipole of the date.

use rayon::prelude::*;

use crate::dipole::Dipole;
use crate::field::{igrf, length};
use crate::orbit::Elements;

/// L (RE) beyond which protons of all energies arrive.
const OPEN_BEYOND_L: f64 = 5.0;

/// Vertical cutoff at L = 1, GV.
const CUTOFF_GV: f64 = 14.5;

/// Twice the rest energy of the proton, MeV.
const TWICE_REST_MEV: f64 = 1876.54;

/// Range of energies (MeV) of a tabulated exposure.
const ENERGIES_MEV: (f64, f64) = (0.1, 1e5);

/// Number of energies in the table.
const STEPS: usize = 240;

/// Number of places averaged, and number per task.
const PLACES: usize = 16_384;
const AT_ONCE: usize = 1024;

/// Fraction of the interplanetary protons that arrives along an orbit, against energy.
#[derive(Clone, Debug, PartialEq)]
pub struct Exposure {
    /// At energies evenly spaced in their logarithm.
    shares: Vec<f64>,
}

/// Rigidity of a proton, GV, of an energy in MeV.
pub fn rigidity_gv(energy_mev: f64) -> f64 {
    (energy_mev * (energy_mev + TWICE_REST_MEV)).sqrt() / 1000.0
}

impl Exposure {
    /// Along an orbit, in the field at a decimal year, without magnetic storms.
    pub fn along(elements: &Elements, year: f64) -> Exposure {
        let dipole = Dipole::of(&igrf(year));
        let part = |chunk: usize| {
            let mut arriving = vec![0.0; STEPS + 2];
            for number in chunk * AT_ONCE..(chunk + 1) * AT_ONCE {
                let visit = elements.visit(number, f64::INFINITY);
                let radius = length(visit.place);
                let seen = 0.5 * (1.0 + (1.0 - radius.powi(-2)).max(0.0).sqrt());
                arriving[first_open(dipole.l(visit.place))] += visit.weight * seen / PLACES as f64;
            }
            arriving
        };
        let parts: Vec<Vec<f64>> = (0..PLACES / AT_ONCE).into_par_iter().map(part).collect();
        // The fraction that arrives at an energy is a cumulative histogram of cutoffs.
        let mut shares = Vec::with_capacity(STEPS + 1);
        let mut sum = 0.0;
        for step in 0..=STEPS {
            sum += parts.iter().map(|part| part[step]).sum::<f64>();
            shares.push(sum);
        }
        Exposure { shares }
    }

    /// At an energy, MeV.
    pub fn at(&self, energy_mev: f64) -> f64 {
        let place = position(energy_mev).clamp(0.0, STEPS as f64);
        let before = (place.floor() as usize).min(STEPS - 1);
        let share = place - before as f64;
        self.shares[before] + share * (self.shares[before + 1] - self.shares[before])
    }
}

/// Index of an energy in the table.
fn position(energy_mev: f64) -> f64 {
    (energy_mev / ENERGIES_MEV.0).ln() / (ENERGIES_MEV.1 / ENERGIES_MEV.0).ln() * STEPS as f64
}

/// First step of the table at which protons reach a shell.
fn first_open(l: f64) -> usize {
    if l > OPEN_BEYOND_L {
        return 0;
    }
    let rigidity_mv = 1000.0 * CUTOFF_GV / (l * l);
    // E² + 2 m E = R², in a form without cancellation at small R.
    let half = 0.5 * TWICE_REST_MEV;
    let energy_mev = rigidity_mv * rigidity_mv / (half + (half * half + rigidity_mv * rigidity_mv).sqrt());
    (position(energy_mev).ceil().max(0.0) as usize).min(STEPS + 1)
}
