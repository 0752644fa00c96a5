//! From the particle spectrum to MeV/g, in steps that can be checked by hand.

use chrono::NaiveDate;

use crate::environment::proton::RANGE_ALUMINIUM;
use crate::mission::{Mission, SolarPhase};
use crate::physics::{DoseHistory, SourceDose};

/// The largest source of a mission, step by step, and the sum of all sources.
#[derive(Clone, Debug)]
pub struct Explained {
    /// The steps.
    pub steps: Vec<Step>,
}

/// One step.
#[derive(Clone, Debug, PartialEq)]
pub enum Step {
    /// Orbit and time: orbit, years, active years of the Sun.
    Orbit {
        /// In words.
        orbit: String,
        /// Length of the mission, yr.
        duration_yr: f64,
        /// Active years of the Sun in it; with an observed Sun, after the observations.
        active_years: f64,
        /// Last day on which the Sun is taken as it was; None if it is drawn at all times.
        observed_to: Option<NaiveDate>,
    },
    /// The source with the largest share of the dose.
    Source {
        /// Its name.
        name: String,
        /// Its law, as on its card.
        law: Option<&'static str>,
        /// Share of the dose.
        share: f64,
        /// Phase at which the Sun is fixed.
        held: Option<SolarPhase>,
        /// Last day on which the Sun is taken as it was, before the law applies; None if it is drawn at all times.
        observed_to: Option<NaiveDate>,
    },
    /// Fluences of the mission above 10, 30 and 100 MeV, cm⁻².
    Fluence {
        /// By energy (MeV).
        above_cm2: [(f64, f64); 3],
    },
    /// Shield: areal density, and its equivalent in aluminium, g/cm².
    Shield {
        /// In words.
        words: String,
        /// Share of the sky from which protons come.
        open: f64,
        /// Whether the densities are those along the normal of a slab; otherwise they are means over the open directions.
        along_normal: bool,
        /// Areal density, g/cm².
        areal_g_cm2: f64,
        /// As aluminium, g/cm².
        aluminium_g_cm2: f64,
    },
    /// Range: the lowest energy of protons that penetrate the shield where it is thinnest, and the residual energy of a faster one.
    Range {
        /// Minimum energy, MeV.
        stopped_below_mev: f64,
        /// An energy in front of the shield, MeV.
        before_mev: f64,
        /// The same proton's energy behind it, MeV.
        behind_mev: f64,
    },
    /// Fluence behind the shield, cm⁻².
    Behind {
        /// At all energies above 0.1 MeV.
        fluence_cm2: f64,
    },
    /// Mean NIEL of those protons, MeV cm²/g.
    Niel {
        /// The curve.
        curve: String,
        /// Mean, MeV cm²/g.
        mean_mev_cm2_g: f64,
        /// Dose of the source, MeV/g: the product.
        dose_mev_g: f64,
    },
    /// All sources and their common factor.
    Sum {
        /// Name and dose, MeV/g.
        sources: Vec<(String, f64)>,
        /// Factor on the whole dose.
        factor: f64,
        /// The sum, MeV/g, before effects.
        total_mev_g: f64,
    },
    /// The same damage as a fluence of 10 MeV protons.
    Equivalent {
        /// NIEL at 10 MeV, MeV cm²/g.
        niel_10_mev: f64,
        /// Their fluence, cm⁻².
        protons_cm2: f64,
    },
    /// Traps created by it.
    Traps {
        /// Reference dose, MeV/g.
        reference_mev_g: f64,
        /// Its origin: fluence (cm⁻²), energy (MeV) and NIEL (MeV cm²/g).
        reference_of: Option<(f64, f64, f64)>,
        /// The dose over the reference.
        ratio: f64,
    },
}

/// Energy (MeV) above which protons behind the shield are counted.
const COUNTED_MEV: f64 = 0.1;

impl Explained {
    /// None if the mission gives its dose.
    pub(super) fn of(mission: &Mission, history: &DoseHistory) -> Option<Explained> {
        let duration_yr = mission.mission.duration_yr;
        let doses: Vec<(String, f64)> = history
            .sources
            .iter()
            .map(|source| (source.name.clone(), history.of_source_mev_g(source, 0.0, duration_yr)))
            .collect();
        let total_mev_g: f64 = doses.iter().map(|(_, dose)| dose).sum();
        let most = (0..doses.len()).max_by(|a, b| doses[*a].1.total_cmp(&doses[*b].1))?;
        let source = &history.sources[most];
        let observed_to = mission.observed_to();
        let mut steps = vec![
            Step::Orbit {
                orbit: mission.orbit_name(),
                duration_yr,
                active_years: history.active_years(duration_yr),
                observed_to,
            },
            Step::Source {
                name: source.name.clone(),
                law: source.card.map(|card| card.law),
                share: doses[most].1 / total_mev_g,
                held: mission.environment.solar_phase,
                observed_to,
            },
        ];
        let factor = mission.environment.dose_factor;
        steps.extend(chain(mission, history, source, doses[most].1 / factor));
        steps.push(Step::Sum { sources: doses, factor, total_mev_g });
        let niel_10_mev = mission.environment.niel.at_10_mev();
        steps.push(Step::Equivalent { niel_10_mev, protons_cm2: total_mev_g / niel_10_mev });
        steps.push(traps(mission, total_mev_g));
        Some(Explained { steps })
    }
}

/// From the spectrum of a source to its dose (MeV/g, before the factor).
fn chain(mission: &Mission, history: &DoseHistory, source: &SourceDose, dose_mev_g: f64) -> Vec<Step> {
    let duration_yr = mission.mission.duration_yr;
    let above = |energy_mev: f64| history.of_spectrum(source, duration_yr, |spectrum| spectrum.above(energy_mev));
    let Some(shield) = mission.shield() else { return Vec::new() };
    let open = shield.mean(|_| 1.0);
    let [areal_g_cm2, aluminium_g_cm2] = shield.typical_g_cm2();
    // Oblique paths through a slab become infinite: the thinnest path says more than the mean.
    let nearest = shield.directions.iter().map(|direction| direction.aluminium_g_cm2).fold(f64::INFINITY, f64::min);
    let stopped_below_mev = RANGE_ALUMINIUM.inverse(nearest);
    let before_mev = (2.0 * stopped_below_mev).max(100.0);
    let behind_mev = RANGE_ALUMINIUM.inverse(RANGE_ALUMINIUM.at(before_mev) - nearest);
    let fluence_cm2 = history.of_spectrum(source, duration_yr, |spectrum| shield.fluence(spectrum, COUNTED_MEV));
    vec![
        Step::Fluence { above_cm2: [10.0, 30.0, 100.0].map(|energy_mev| (energy_mev, above(energy_mev))) },
        Step::Shield {
            words: mission.shielding.as_ref().map_or(String::new(), |shielding| shielding.words()),
            open,
            along_normal: shield.along_normal_g_cm2.is_some(),
            areal_g_cm2,
            aluminium_g_cm2,
        },
        Step::Range { stopped_below_mev, before_mev, behind_mev },
        Step::Behind { fluence_cm2 },
        Step::Niel {
            curve: mission.environment.niel.to_string(),
            mean_mev_cm2_g: dose_mev_g / fluence_cm2,
            dose_mev_g,
        },
    ]
}

fn traps(mission: &Mission, total_mev_g: f64) -> Step {
    let detector = &mission.detector;
    let reference_of = detector.reference_fluence_cm2.zip(detector.reference_energy_mev);
    let reference_mev_g = mission.reference_dose_mev_g();
    Step::Traps {
        reference_mev_g,
        reference_of: reference_of.map(|(fluence, energy)| (fluence, energy, mission.environment.niel.at(energy))),
        ratio: total_mev_g / reference_mev_g,
    }
}
