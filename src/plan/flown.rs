//! What has happened to a mission that flies: its dose and its traps up to the last observation of the Sun, with their errors.
//!
//! Errors are those of `[uncertainty]`, each input alone up and down by one standard deviation, and of the calibration of the
//! satellites that measured the events, added in quadrature.

use chrono::NaiveDate;
use serde::Serialize;

use crate::error::InputError;
use crate::mission::Mission;
use crate::model::Model;
use crate::numeric::calendar::{date_after, decimal_year};
use crate::numeric::parallel;
use crate::physics::solar_event_dose::observed_mev_g;
use crate::plan::draws::input::{Derived, inputs};

/// Dose and traps up to the last observation.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Flown {
    /// The day of the last observation, or the end of the mission if that is earlier.
    pub until: NaiveDate,
    /// The same, years since launch.
    pub t_yr: f64,
    /// Dose since launch.
    pub dose_mev_g: Measured,
    /// Traps of all species.
    pub traps_per_px: Measured,
    /// Part of the dose from observed solar events, with the error of their calibration alone, MeV/g.
    pub solar_events_mev_g: Measured,
}

/// A value with its error.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Measured {
    /// The value.
    pub value: f64,
    /// Its error, 1 sigma.
    pub error: f64,
}

impl Flown {
    /// None if the Sun is not taken as it was, or the mission begins after the last observation.
    ///
    /// # Errors
    /// If a formula has no value.
    pub fn of(mission: &Mission) -> Result<Option<Flown>, InputError> {
        let Some(sun) = mission.observed_sun() else { return Ok(None) };
        let launch = mission.mission.launch.0;
        let t_yr = (sun.span()[1] - decimal_year(launch)).min(mission.mission.duration_yr);
        let Some(until) = date_after(launch, t_yr).filter(|_| t_yr > 0.0) else { return Ok(None) };
        let model = Model::new(mission);
        let of = |model: &Model| -> Result<[f64; 2], InputError> {
            let traps = model.traps(t_yr)?.iter().map(|species| species.density_per_px).sum();
            Ok([model.dose_mev_g(t_yr)?, traps])
        };
        let values = of(&model)?;
        let events = observed_mev_g(mission, model.history(), t_yr);
        let share = if values[0] > 0.0 { events.1 / values[0] } else { 0.0 };
        let mut squares = values.map(|value| (share * value).powi(2));
        let inputs = inputs(mission, Derived::of(mission));
        let half_differences = parallel::try_map(&inputs, |input| {
            let side = |deviation: f64| {
                let mut other = mission.clone();
                input.deviate(&mut other, deviation);
                of(&model.like(&other))
            };
            let (high, low) = (side(1.0)?, side(-1.0)?);
            Ok::<_, InputError>([0, 1].map(|quantity| 0.5 * (high[quantity] - low[quantity])))
        })?;
        for half in half_differences {
            squares.iter_mut().zip(half).for_each(|(square, half)| *square += half * half);
        }
        let measured = |quantity: usize| Measured { value: values[quantity], error: squares[quantity].sqrt() };
        Ok(Some(Flown {
            until,
            t_yr,
            dose_mev_g: measured(0),
            traps_per_px: measured(1),
            solar_events_mev_g: Measured { value: events.0, error: events.1 },
        }))
    }
}
