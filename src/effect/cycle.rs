//! A dose rate that varies with the solar cycle.

use serde::Deserialize;

use super::reach::ratios;
use super::{AfterFit, Card, Catalogued, Effect, Reach, numbers};
use crate::mission::Mission;
use crate::mission::keys::{Allowed::Number, Key, Need::Required, key, percentage};
use crate::numeric::calendar::decimal_year;
use crate::physics::{DoseHistory, Modulation};

/// `[effects.cycle]`
#[derive(Debug, Deserialize)]
pub struct Cycle {
    amplitude: f64,
    period_yr: f64,
    peak: f64,
}

/// Mean length of the solar cycle, yr, and the standard deviation over it: cycles 1 to 24 lasted 9.0 to 13.7 yr, 11.0 ± 1.2 (Hathaway
/// 2015, Living Reviews in Solar Physics 12, 4, table 1).
const SOLAR_CYCLE_YR: f64 = 11.0;
const SCATTER: f64 = 0.11;

/// Data that span at least this many years determine their own period.
const SHOWS_PERIOD_YR: f64 = 8.0;

/// Number of phases at which a search starts.
const PHASES: u32 = 8;

impl Catalogued for Cycle {
    const CARD: Card = Card {
        kind: "cycle",
        adds: "a dose rate that rises and falls as a cosine, such as that in low Earth orbit over the solar cycle",
        physics: "D'(t) is multiplied by 1 + amplitude cos(2 pi (t − peak)/period_yr), where t and peak are decimal years. Doses \
                  that come at once (solar-flare) are not multiplied. The dose monitor sees it.",
        source: "Massey et al. 2025 (arXiv:2509.05057): damage of ACS in low Earth orbit, amplitude 18.5 % (−0.5, +4.5), \
                 largest 430 d (−5, +11) after solar minimum",
        holds: "The mean rate stays that of the mission only over whole periods. A search holds the period at 11 yr if the data \
                span less than 8 yr. Several streams that vary in different ways are not one cosine.",
        residuals: "The model's dose, and all damage, is too large and too small in turn. Residuals against t_yr are a wave of \
                    the length of the period.",
        keys: &[
            Key {
                help: percentage,
                ..key("amplitude", "amplitude over the mean dose rate", "", Number(0.0, 1.0), Required)
            },
            Key { scatter: Some(SCATTER), ..key("period_yr", "period", "yr", Number(0.1, 1000.0), Required) },
            Key {
                help: |value| {
                    (value < 1000.0).then(|| "a calendar year such as 2000.3, not a time since launch".into())
                },
                ..key("peak", "time of a maximum of the dose rate", "(decimal year)", Number(1700.0, 2300.0), Required)
            },
        ],
    };

    fn nothing(mission: &Mission) -> toml::Table {
        table(0.0, SOLAR_CYCLE_YR, decimal_year(mission.mission.launch.0))
    }

    fn example(mission: &Mission) -> toml::Table {
        table(0.3, SOLAR_CYCLE_YR, decimal_year(mission.mission.launch.0) + 1.0)
    }

    fn trials(mission: &Mission, reach: &Reach) -> Vec<Vec<toml::Table>> {
        let middle = decimal_year(mission.mission.launch.0) + 0.5 * reach.last_yr();
        let periods: Vec<f64> = if shows_period(reach) {
            ratios(SOLAR_CYCLE_YR / 1.5, SOLAR_CYCLE_YR * 1.5, 3).collect()
        } else {
            vec![SOLAR_CYCLE_YR]
        };
        let phases = |period_yr: f64| (0..PHASES).map(move |phase| (period_yr, f64::from(phase) / f64::from(PHASES)));
        let trial = |(period_yr, phase): (f64, f64)| vec![table(0.05, period_yr, middle + phase * period_yr)];
        periods.into_iter().flat_map(phases).map(trial).collect()
    }

    /// The maximum nearest to the middle of the mission.
    fn plainer(after: &AfterFit, key: &str) -> Vec<(String, f64)> {
        let fitted = after.fitted;
        let number = |name: &str| fitted.number(&format!("{key}.{name}")).expect("a required number");
        let middle = decimal_year(fitted.mission.launch.0) + 0.5 * fitted.mission.duration_yr;
        let (peak, period_yr) = (number("peak"), number("period_yr"));
        let periods = ((peak - middle) / period_yr).round();
        if periods == 0.0 { Vec::new() } else { vec![(format!("{key}.peak"), peak - periods * period_yr)] }
    }

    fn held(reach: &Reach) -> &'static [&'static str] {
        if shows_period(reach) { &[] } else { &["period_yr"] }
    }
}

fn table(amplitude: f64, period_yr: f64, peak: f64) -> toml::Table {
    numbers(&[("amplitude", amplitude), ("period_yr", period_yr), ("peak", peak)])
}

fn shows_period(reach: &Reach) -> bool {
    reach.last_yr() >= SHOWS_PERIOD_YR
}

impl Effect for Cycle {
    fn dose(&self, dose: &mut DoseHistory) {
        let Cycle { amplitude, period_yr, peak } = *self;
        if amplitude > 0.0 {
            dose.modulations.push(Modulation { amplitude, period_yr, peak });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mission_file::add_effect;
    use crate::model::Model;

    #[test]
    fn a_maximum_is_that_nearest_to_the_middle_of_the_mission() {
        let mission = Mission::read("missions/snap_l2.toml").unwrap();
        let middle = decimal_year(mission.mission.launch.0) + 0.5 * mission.mission.duration_yr;
        let (far, key) = add_effect(&mission, "cycle", table(0.4, 7.0, middle + 1.5 - 17.0 * 7.0)).unwrap();
        let values = plainer(&far, &mission, &key);
        assert_eq!(values.len(), 1);
        assert!((values[0].1 - middle - 1.5).abs() < 1e-9, "{values:?}");
        let near = far.with(&[(values[0].0.clone(), values[0].1.into())]).unwrap();
        for t_yr in [0.5, 2.0, 6.0] {
            let [a, b] = [&far, &near].map(|mission| Model::new(mission).dose_mev_g(t_yr).unwrap());
            assert!((a / b - 1.0).abs() < 1e-9, "{a} {b}");
        }
        assert!(plainer(&near, &mission, &key).is_empty());
    }

    fn plainer(fitted: &Mission, given: &Mission, key: &str) -> Vec<(String, f64)> {
        Cycle::plainer(&AfterFit { fitted, given, free: &[], epochs_yr: &[] }, key)
    }
}
