//! Dipoles of single traps against phase time, and fits of their release times.

use crate::numeric::minimum::golden_section;
pub use crate::physics::observable::dipole_e;
use crate::study::ratios;

/// Number of starting values for a fit, and of its golden-section steps.
const STARTS: usize = 240;
const SECTIONS: usize = 40;

/// One phase time of a series of images.
#[derive(Clone, Copy, Debug)]
pub struct Phase {
    /// Time of one phase, ms.
    pub phase_ms: f64,
    /// Cycles of an image.
    pub cycles: f64,
}

/// Grid of release times for a fit, with the shape of the dipole against phase time for each.
pub struct Grid<'a> {
    phases: &'a [Phase],
    nodes: Vec<(f64, Vec<f64>)>,
}

impl Grid<'_> {
    /// With release times around the phase times, and beyond.
    pub fn new(phases: &[Phase]) -> Grid<'_> {
        let ends = |pick: fn(f64, f64) -> f64| phases.iter().map(|phase| phase.phase_ms).reduce(pick).expect("a phase");
        let times = ratios(ends(f64::min) / 10.0, ends(f64::max) * 10.0, STARTS);
        let nodes = times.into_iter().map(|release_ms| (release_ms.ln(), shape(phases, release_ms))).collect();
        Grid { phases, nodes }
    }

    /// Best-fitting release time (ms) for dipoles with errors, for any probability of capture.
    pub fn fit(&self, measured: &[(f64, f64)]) -> f64 {
        let chi2 = |shape: &[f64]| {
            // χ² of the best amplitude: Σ y²w − (Σ y m w)²/Σ m²w; the first term is constant.
            let sums = measured.iter().zip(shape).fold((0.0, 0.0), |(across, own), ((dipole, sigma), model)| {
                let weight = 1.0 / (sigma * sigma);
                (across + weight * dipole * model, own + weight * model * model)
            });
            if sums.1 > 0.0 && sums.0 > 0.0 { -sums.0 * sums.0 / sums.1 } else { 0.0 }
        };
        let best = |a: &usize, b: &usize| chi2(&self.nodes[*a].1).total_cmp(&chi2(&self.nodes[*b].1));
        let node = (0..self.nodes.len()).min_by(best).expect("many nodes");
        let place = |node: usize| self.nodes[node].0;
        let ends = [place(node.saturating_sub(1)), place((node + 1).min(self.nodes.len() - 1))];
        golden_section(ends, SECTIONS, |log_ms| chi2(&shape(self.phases, log_ms.exp()))).exp()
    }
}

/// Dipoles at each phase time for a capture probability of 1, e-.
fn shape(phases: &[Phase], release_ms: f64) -> Vec<f64> {
    phases.iter().map(|phase| dipole_e(phase.cycles, 1.0, phase.phase_ms, release_ms)).collect()
}
