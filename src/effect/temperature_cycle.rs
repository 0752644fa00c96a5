//! A detector temperature that rises and falls with the seasons.

use std::f64::consts::TAU;

use serde::Deserialize;

use super::{AfterFit, Card, Catalogued, Effect, Reach, Refusal, numbers};
use crate::error::InputError;
use crate::mission::Mission;
use crate::mission::keys::{Allowed::Number, Key, Need::Required, key};
use crate::numeric::aliases::{Wave, even_spacing};
use crate::physics::conditions::Conditions;

/// `[effects.temperature-cycle]`
#[derive(Debug, Deserialize)]
pub struct TemperatureCycle {
    amplitude_k: f64,
    period_yr: f64,
    warmest_t_yr: f64,
}

/// Periods at which a search starts, yr: the Earth's distance from the Sun, and eclipse seasons.
const PERIODS_YR: [f64; 2] = [1.0, 0.5];

/// Number of phases at which a search starts.
const PHASES: u32 = 8;

/// Data that span at least this many years determine their own period.
const SHOWS_PERIOD_YR: f64 = 3.0;

/// Fewer epochs do not show a wave.
const FEWEST_EPOCHS: usize = 6;

impl Catalogued for TemperatureCycle {
    const CARD: Card = Card {
        kind: "temperature-cycle",
        adds: "a detector temperature that rises and falls as a cosine, with the seasons, unseen by the thermometer",
        physics: "Release times are those at temperature_k + amplitude_k cos(2 pi (t_yr − warmest_t_yr)/period_yr). The \
                  reference temperature is not changed.",
        source: "release times: Shockley & Read 1952 (Phys. Rev. 87, 835) and Hall 1952 (Phys. Rev. 87, 387); seasons: sunlight \
                 at the Earth's distance varies by 6.9 % in a year, and orbits have eclipse seasons",
        holds: "One cosine. A search tries it only if all data are of one temperature, recorded or assumed, and holds the period at \
                a year or half a year if the data span less than 3 yr.",
        residuals: "Measured trails are steeper, then flatter than the model's, in waves of the period along t_yr; deep levels \
                    more than shallow ones.",
        keys: &[
            Key {
                help: |value| (value > 100.0).then(|| "a difference in kelvin, not a temperature".into()),
                ..key("amplitude_k", "amplitude about the recorded temperature", "K", Number(0.0, 100.0), Required)
            },
            key("period_yr", "period", "yr", Number(0.01, 100.0), Required),
            Key {
                help: |value| (value > 1000.0).then(|| "years since launch, not a calendar year".into()),
                ..key("warmest_t_yr", "a time at which it is warmest", "yr", Number(-100.0, 100.0), Required)
            },
        ],
    };

    fn nothing(_: &Mission) -> toml::Table {
        table(0.0, 1.0, 0.0)
    }

    fn example(_: &Mission) -> toml::Table {
        table(3.0, 1.0, 0.3)
    }

    fn trials(_: &Mission, reach: &Reach) -> Vec<Vec<toml::Table>> {
        // Launch is among the epochs.
        if reach.varies_in_temperature() || reach.epochs_yr.len() <= FEWEST_EPOCHS {
            return Vec::new();
        }
        let periods = PERIODS_YR.into_iter().filter(|period_yr| *period_yr <= reach.last_yr());
        let phases = |period_yr: f64| (0..PHASES).map(move |phase| (period_yr, f64::from(phase) / f64::from(PHASES)));
        periods.flat_map(phases).map(|(period_yr, phase)| vec![table(0.5, period_yr, phase * period_yr)]).collect()
    }

    /// The longest period of those that evenly spaced epochs do not distinguish, and the first maximum after launch.
    fn plainer(after: &AfterFit, key: &str) -> Vec<(String, f64)> {
        let of = |name: &str| format!("{key}.{name}");
        let number = |name: &str| after.fitted.number(&of(name)).expect("a required number");
        let found = Wave { period: number("period_yr"), maximum: number("warmest_t_yr") };
        let longest = longest_alias(found, after.epochs_yr).unwrap_or(found);
        let first = Wave { maximum: longest.maximum.rem_euclid(longest.period), ..longest };
        let both = [("period_yr", first.period, found.period), ("warmest_t_yr", first.maximum, found.maximum)];
        both.into_iter().filter(|(_, new, old)| new != old).map(|(name, new, _)| (of(name), new)).collect()
    }

    fn held(reach: &Reach) -> &'static [&'static str] {
        if reach.last_yr() >= SHOWS_PERIOD_YR { &[] } else { &["period_yr"] }
    }

    fn check(&self, mission: &Mission) -> Result<(), Refusal> {
        let coldest_k = mission.detector.temperature_k - self.amplitude_k;
        if coldest_k > 0.0 {
            return Ok(());
        }
        let problem = format!("the detector would be at {coldest_k} K");
        Err(Refusal { key: "amplitude_k".into(), problem, help: None })
    }
}

fn table(amplitude_k: f64, period_yr: f64, warmest_t_yr: f64) -> toml::Table {
    numbers(&[("amplitude_k", amplitude_k), ("period_yr", period_yr), ("warmest_t_yr", warmest_t_yr)])
}

/// The longest wave with the same values at evenly spaced epochs, if it is longer, and no longer than the epochs span.
fn longest_alias(wave: Wave, epochs_yr: &[f64]) -> Option<Wave> {
    let spacing_yr = even_spacing(epochs_yr)?;
    let (first_yr, last_yr) = (epochs_yr[0], epochs_yr[epochs_yr.len() - 1]);
    let aliases = wave.aliases(first_yr, spacing_yr).into_iter();
    aliases.filter(|alias| alias.period <= last_yr - first_yr).find(|alias| alias.period > wave.period)
}

impl Effect for TemperatureCycle {
    fn conditions(&self, at: &mut Conditions) -> Result<(), InputError> {
        at.temperature_k += self.amplitude_k * (TAU * (at.t_yr - self.warmest_t_yr) / self.period_yr).cos();
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mission_file::add_effect;

    #[test]
    fn the_warmest_time_is_the_first_after_launch() {
        let mission = Mission::read("missions/snap_l2.toml").unwrap();
        for (warmest_t_yr, first) in [(-3.4, 1.1), (7.25, 1.25)] {
            let (far, key) = add_effect(&mission, "temperature-cycle", table(2.0, 1.5, warmest_t_yr)).unwrap();
            let values = plainer(&far, &mission, &key, &[]);
            assert!(values.len() == 1 && (values[0].1 - first).abs() < 1e-12, "{values:?}");
            let kelvin = |warmest_t_yr: f64| {
                let mut at = Conditions::of(&mission, 2.3);
                let given_k = at.temperature_k;
                TemperatureCycle { amplitude_k: 2.0, period_yr: 1.5, warmest_t_yr }.conditions(&mut at).unwrap();
                at.temperature_k - given_k
            };
            assert!((kelvin(warmest_t_yr) - kelvin(values[0].1)).abs() < 1e-9);
        }
        let (near, key) = add_effect(&mission, "temperature-cycle", table(2.0, 1.5, 0.6)).unwrap();
        assert!(plainer(&near, &mission, &key, &[]).is_empty());
    }

    fn plainer(fitted: &Mission, given: &Mission, key: &str, epochs_yr: &[f64]) -> Vec<(String, f64)> {
        TemperatureCycle::plainer(&AfterFit { fitted, given, free: &[], epochs_yr }, key)
    }

    /// Epochs 0.636 yr apart do not tell a period of 1.0032 yr from one of 1.74 yr.
    #[test]
    fn of_periods_that_the_epochs_do_not_distinguish_the_longest_is_taken() {
        let mission = Mission::read("missions/snap_l2.toml").unwrap();
        let epochs_yr: Vec<f64> = (0..12).map(|place| 0.5 + 7.0 / 11.0 * f64::from(place)).collect();
        let (short, key) = add_effect(&mission, "temperature-cycle", table(3.0, 1.0032, 0.4)).unwrap();
        let values = plainer(&short, &mission, &key, &epochs_yr);
        assert!(values.len() == 2 && (values[0].1 - 1.740).abs() < 0.001, "{values:?}");
        let uneven: Vec<f64> = epochs_yr.iter().map(|t_yr| t_yr + 0.05 * (7.0 * t_yr).sin()).collect();
        assert!(plainer(&short, &mission, &key, &uneven).is_empty());
    }
}
