//! Energy spectra of protons, as fluences above an energy.
//!
//! From here to the damage, the chain is linear in the spectrum of any source: the Sun, the belts, the Galaxy, or another program.

/// Integral fluence spectrum, omnidirectional (4π): given at some energies, with a law in between.
#[derive(Clone, Debug, PartialEq)]
pub struct Spectrum {
    /// Energy (MeV) and ln(F(>E) cm²), by energy.
    nodes: Vec<(f64, f64)>,
    law: Law,
    /// Energies (MeV) at which the law's parameters change so much that an integral must be split there.
    kinks: Vec<f64>,
}

/// Decrease of a fluence with energy between two nodes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Law {
    /// As a power of the energy.
    Power,
    /// As an exponential of the energy.
    Exponential,
}

impl Law {
    /// The variable in which ln F is a straight line.
    fn variable(self, energy_mev: f64) -> f64 {
        match self {
            Law::Power => energy_mev.ln(),
            Law::Exponential => energy_mev,
        }
    }
}

/// Fluence (cm⁻²) that counts as zero: what a law gives far beyond its last energy.
const NOTHING_CM2: f64 = 1e-12;

/// Energies per decade in the tabulation of a product or a formula.
const PER_DECADE: f64 = 40.0;

impl Spectrum {
    /// From energies (MeV, ascending) and fluences above them (cm⁻², descending). Beyond the ends the law of the end pair applies.
    /// Energies from the first without fluence on are omitted; a spectrum without fluence has fewer than two.
    pub fn of(nodes: impl IntoIterator<Item = (f64, f64)>, law: Law) -> Spectrum {
        let known = nodes.into_iter().take_while(|(_, fluence)| *fluence > 0.0);
        let nodes: Vec<(f64, f64)> = known.map(|(energy_mev, fluence)| (energy_mev, fluence.ln())).collect();
        let kinks = nodes.iter().map(|node| node.0).collect();
        Spectrum { nodes, law, kinks }
    }

    /// From a smooth differential fluence (cm⁻² MeV⁻¹) between two energies (MeV); zero above the second.
    pub fn of_differential(differential: impl Fn(f64) -> f64, from_mev: f64, to_mev: f64) -> Spectrum {
        let energies_mev = tabulated(from_mev, to_mev);
        let values: Vec<f64> = energies_mev.iter().map(|energy_mev| differential(*energy_mev)).collect();
        let mut sum = 0.0;
        let mut nodes = Vec::new();
        for index in (0..energies_mev.len() - 1).rev() {
            sum +=
                power_law_integral((energies_mev[index], values[index]), (energies_mev[index + 1], values[index + 1]));
            nodes.push((energies_mev[index], sum));
        }
        nodes.reverse();
        Spectrum { kinks: Vec::new(), ..Spectrum::of(nodes, Law::Power) }
    }

    /// The part that arrives, by the share at each energy (MeV). Extended to 100 GeV: fast protons pass where others stop.
    pub fn attenuated(&self, share: impl Fn(f64) -> f64) -> Spectrum {
        let (Some(first), Some(last)) = (self.nodes.first(), self.nodes.last()) else { return self.clone() };
        let mut energies_mev = tabulated(first.0, last.0.max(1e5));
        energies_mev.extend(self.nodes.iter().map(|node| node.0));
        energies_mev.sort_by(f64::total_cmp);
        energies_mev.dedup_by(|a, b| (*a / *b - 1.0).abs() < 1e-9);
        let last_mev = energies_mev[energies_mev.len() - 1];
        let mut sum = self.above(last_mev) * share(last_mev);
        let mut nodes = vec![(last_mev, sum)];
        for pair in energies_mev.windows(2).rev() {
            sum += (self.above(pair[0]) - self.above(pair[1])) * share((pair[0] * pair[1]).sqrt());
            nodes.push((pair[0], sum));
        }
        nodes.reverse();
        Spectrum { kinks: self.kinks.clone(), ..Spectrum::of(nodes, self.law) }
    }

    /// The fluence multiplied by a factor.
    pub fn times(&self, factor: f64) -> Spectrum {
        if factor == 0.0 {
            return Spectrum { nodes: Vec::new(), kinks: Vec::new(), law: self.law };
        }
        let nodes = self.nodes.iter().map(|(energy_mev, log)| (*energy_mev, log + factor.ln())).collect();
        Spectrum { nodes, ..self.clone() }
    }

    /// Fluence above an energy (MeV), cm⁻².
    pub fn above(&self, energy_mev: f64) -> f64 {
        let Some((slope, variable, log_fluence)) = self.segment(energy_mev) else { return 0.0 };
        let fluence = (log_fluence + slope * (self.law.variable(energy_mev) - variable)).exp();
        if fluence < NOTHING_CM2 { 0.0 } else { fluence }
    }

    /// Differential fluence at an energy (MeV), cm⁻² MeV⁻¹: the slope of [`Self::above`], discontinuous at the nodes.
    pub fn differential(&self, energy_mev: f64) -> f64 {
        let Some((slope, ..)) = self.segment(energy_mev) else { return 0.0 };
        let per_mev = match self.law {
            Law::Power => slope / energy_mev,
            Law::Exponential => slope,
        };
        -per_mev * self.above(energy_mev)
    }

    /// Energies (MeV) between which the spectrum is smooth.
    pub fn kinks_mev(&self) -> impl Iterator<Item = f64> {
        self.kinks.iter().copied()
    }

    /// Slope and starting point of the law at an energy.
    fn segment(&self, energy_mev: f64) -> Option<(f64, f64, f64)> {
        if self.nodes.len() < 2 {
            return None;
        }
        let upper = self.nodes.partition_point(|node| node.0 <= energy_mev).clamp(1, self.nodes.len() - 1);
        let (low, high) = (self.nodes[upper - 1], self.nodes[upper]);
        let (from, to) = (self.law.variable(low.0), self.law.variable(high.0));
        Some(((high.1 - low.1) / (to - from), from, low.1))
    }
}

/// A weighted sum of spectra: tabulated, with errors of 1e-3 at kinks of the terms.
pub fn sum(terms: &[(f64, &Spectrum)]) -> Spectrum {
    if let [(weight, only)] = terms {
        return only.times(*weight);
    }
    let nodes = || terms.iter().flat_map(|(_, spectrum)| spectrum.nodes.iter().map(|node| node.0));
    let (from, to) = (nodes().fold(f64::INFINITY, f64::min), nodes().fold(0.0, f64::max));
    // Without terms, or nodes in them.
    if from >= to {
        return Spectrum::of([], Law::Power);
    }
    let above = |energy_mev: f64| terms.iter().map(|(weight, spectrum)| weight * spectrum.above(energy_mev)).sum();
    let table = tabulated(from, to).into_iter().map(|energy_mev| (energy_mev, above(energy_mev)));
    Spectrum { kinks: Vec::new(), ..Spectrum::of(table.collect::<Vec<(f64, f64)>>(), Law::Power) }
}

/// Energies (MeV) evenly spaced in their logarithm.
fn tabulated(from_mev: f64, to_mev: f64) -> Vec<f64> {
    let steps = ((to_mev / from_mev).log10() * PER_DECADE).ceil().max(1.0);
    (0..=steps as usize).map(|step| from_mev * (to_mev / from_mev).powf(step as f64 / steps)).collect()
}

/// Integral of a power law between two of its points (MeV, per MeV).
fn power_law_integral((from, low): (f64, f64), (to, high): (f64, f64)) -> f64 {
    if low <= 0.0 || high <= 0.0 {
        return 0.5 * (low + high) * (to - from);
    }
    let log_ratio = (to / from).ln();
    let power = (high / low).ln() / log_ratio + 1.0;
    if power.abs() < 1e-9 { low * from * log_ratio } else { (high * to - low * from) / power }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_differential_spectrum_is_the_slope_of_the_integral_one() {
        let nodes = [(1.0, 1e9), (10.0, 2e8), (100.0, 1e6), (300.0, 2e4)];
        for law in [Law::Power, Law::Exponential] {
            let spectrum = Spectrum::of(nodes, law);
            for energy_mev in [0.5, 2.0, 30.0, 250.0, 500.0] {
                let h = 1e-5 * energy_mev;
                let slope = (spectrum.above(energy_mev - h) - spectrum.above(energy_mev + h)) / (2.0 * h);
                assert!((slope / spectrum.differential(energy_mev) - 1.0).abs() < 1e-6);
            }
            for (energy_mev, fluence) in nodes {
                assert!((spectrum.above(energy_mev) / fluence - 1.0).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn a_power_law_is_integrated_to_its_integral() {
        let spectrum = Spectrum::of_differential(|energy_mev| 3e9 * energy_mev.powf(-2.5), 0.1, 1e6);
        for energy_mev in [0.2, 1.0, 37.0, 1e4] {
            let integral = 2e9 * (f64::powf(energy_mev, -1.5) - 1e-9);
            assert!((spectrum.above(energy_mev) / integral - 1.0).abs() < 2e-3, "{energy_mev}");
        }
    }

    #[test]
    fn what_arrives_is_between_nothing_and_all() {
        let spectrum = Spectrum::of([(1.0, 1e9), (10.0, 2e8), (100.0, 1e6), (300.0, 2e4)], Law::Power);
        for energy_mev in [1.0, 5.0, 50.0, 200.0] {
            assert!(
                (spectrum.attenuated(|_| 0.25).above(energy_mev) / (0.25 * spectrum.above(energy_mev)) - 1.0).abs()
                    < 1e-9
            );
            // Only protons above a threshold: the same above it, and constant below.
            let gate = spectrum.attenuated(|energy_mev| if energy_mev > 20.0 { 1.0 } else { 0.0 });
            let expected = spectrum.above(energy_mev.max(20.0));
            assert!((gate.above(energy_mev) / expected - 1.0).abs() < 0.05, "{energy_mev}: {}", gate.above(energy_mev));
        }
        assert_eq!(spectrum.times(0.0).above(1.0), 0.0);
        assert!((spectrum.times(3.0).differential(7.0) / spectrum.differential(7.0) - 3.0).abs() < 1e-12);
    }
}
