//! A mission → realisations of its Sun, each a dose of solar protons over time.
//!
//! If the mission gives its dose rate, the Sun is drawn behind the aluminium sphere that gives that rate in an active year at the
//! mission's confidence. If no sphere does, it is drawn behind [`ASSUMED_MM`] and scaled to the rate.

use crate::environment::esp;
use crate::environment::shielding::{Geometry, Shield};
use crate::error::InputError;
use crate::mission::{Mission, Orbit, Shielding};
use crate::model::Model;
use crate::physics::solar_event_dose::SolarEventDoses;
use crate::plan::dose::equivalent_mm;

/// Thickness (mm of aluminium) assumed if none gives the stated dose rate.
const ASSUMED_MM: f64 = 10.0;

/// Duration (yr) of an event's dose: three days.
const EVENT_YR: f64 = 3.0 / 365.25;

/// Realisations of the Sun.
pub struct Suns {
    doses: SolarEventDoses,
    factor: f64,
}

impl Suns {
    /// `samples` realisations of the Sun over a mission.
    ///
    /// # Errors
    /// If its dose does not determine single events: it is imported, has no solar protons, or is that of trapped protons in a low
    /// orbit of unknown elements.
    pub fn of(model: &Model, samples: u32, seed: u64) -> Result<Suns, InputError> {
        if model.mission.place().is_none() {
            let problem = "in a low Earth orbit of unknown elements the dose is that of trapped protons";
            return Err(InputError::new("cannot draw the Sun", problem));
        }
        let (derived, factor) = derived(&model.mission);
        let doses = SolarEventDoses::of(&derived, model.history(), samples, seed)?;
        Ok(Suns { doses, factor })
    }

    /// Probability of a smaller sum of events in as many active years: evenly spread over all realisations.
    ///
    /// # Panics
    /// If there are not that many.
    pub fn rank(&self, index: usize) -> f64 {
        self.doses.events.rank(index)
    }

    /// A realisation: years since launch, ascending from 0, and dose of solar protons since launch (MeV/g, before the mission's
    /// factor on all doses).
    ///
    /// # Panics
    /// If there are not that many.
    pub fn realisation(&self, index: usize) -> Vec<(f64, f64)> {
        let mut changes: Vec<(f64, f64)> = Vec::new();
        for (t_yr, dose_mev_g) in self.doses.steps(index) {
            let rate = self.factor * dose_mev_g / EVENT_YR;
            changes.extend([(t_yr, rate), (t_yr + EVENT_YR, -rate)]);
        }
        changes.sort_by(|a, b| a.0.total_cmp(&b.0));
        let (mut realisation, mut rate, mut dose_mev_g) = (vec![(0.0, 0.0)], 0.0_f64, 0.0);
        for (t_yr, change) in changes {
            let before_yr = realisation.last().expect("its start").0;
            dose_mev_g += rate.max(0.0) * (t_yr - before_yr);
            rate += change;
            match realisation.last_mut() {
                Some(last) if last.0 == t_yr => last.1 = dose_mev_g,
                _ => realisation.push((t_yr, dose_mev_g)),
            }
        }
        realisation
    }
}

/// The mission with a derived dose, without its factor on all doses; and the factor on the doses of its Sun.
fn derived(mission: &Mission) -> (Mission, f64) {
    let mut derived = mission.clone();
    let environment = &mut derived.environment;
    environment.dose_factor = 1.0;
    let Some(rate) = environment.active_dose_rate_mev_g_yr.take() else { return (derived, 1.0) };
    environment.sources = None;
    // The rate is that behind all shielding: no orbit reduces it further.
    derived.orbit = None;
    derived.mission.orbit = Some(Orbit::L2);
    let environment = &derived.environment;
    let thickness_mm = equivalent_mm(mission, Geometry::Sphere).unwrap_or(ASSUMED_MM);
    let year = esp::fluence(environment.confidence, 1.0);
    let dose = Shield::aluminium(Geometry::Sphere, thickness_mm).dose(&year, environment.niel.curve());
    derived.shielding = Some(Shielding::aluminium(Geometry::Sphere, thickness_mm));
    (derived, rate / dose)
}
