//! A number of the mission that may be wrong: line time, transfers, full well, launch, species exchanged.
//!
//! These are an engineer's most frequent errors, and effects imitate them: a wrong full well looks like a volume at zero charge, a launch a
//! year early like a flare. Each is tried with other values on top of a set, its other parameters and errors following as for a law of the
//! measurement, and the best value is found in one dimension. It stands beside the ranking of effects, with one parameter and a price of
//! its own.

use toml::Value;

use super::super::explanation::Explanation;
use super::SetSearch;
use super::law::{Law, LineFit, WithLaw};
use crate::mission::Mission;
use crate::numeric::calendar::date_after;
use crate::numeric::minimum::golden_section;
use crate::numeric::parallel;

/// Prior probability that what is missing is a wrong number.
const WRONG_NUMBER: f64 = 0.1;

/// Keys of real and of whole numbers that may be wrong by a factor.
const FACTORS: [&str; 2] = ["readout.line_time_ms", "detector.full_well_e"];
const COUNTS: [&str; 1] = ["readout.transfers"];

/// Standard deviation of ln of a factor, a factor of two, and of a launch, years.
const FACTOR_LN: f64 = 0.7;
const LAUNCH_YR: f64 = 1.0;

/// Changes that are tried, in units of these; between the best one's neighbours the best value is searched with so many evaluations.
const CHANGES: [f64; 10] = [-1.0, -0.5, -0.2, -0.1, -0.04, 0.04, 0.1, 0.2, 0.5, 1.0];
const GOLDEN: usize = 10;

/// Step for derivatives, in the same units.
const STEP: f64 = 0.01;

/// A number that may be wrong.
#[derive(Clone, Debug)]
enum Suspect {
    Factor(&'static str),
    Count(&'static str),
    Launch,
    /// Two species have each other's release time and energy.
    Exchanged(String, String),
}

impl Suspect {
    fn all(mission: &Mission) -> Vec<Suspect> {
        let names: Vec<&String> = mission.detector.traps.iter().map(|species| &species.name).collect();
        let pairs = (0..names.len()).flat_map(|a| (a + 1..names.len()).map(move |b| (a, b)));
        let exchanged = pairs.map(|(a, b)| Suspect::Exchanged(names[a].clone(), names[b].clone()));
        let factors = FACTORS.into_iter().map(Suspect::Factor);
        factors.chain(COUNTS.into_iter().map(Suspect::Count)).chain([Suspect::Launch]).chain(exchanged).collect()
    }

    /// The settings that make a number right which is wrong by a change; None if that changes nothing.
    fn settings(&self, mission: &Mission, change: f64) -> Option<Vec<(String, Value)>> {
        let number = |key: &str| mission.number(key);
        match self {
            Suspect::Factor(key) => Some(vec![(key.to_string(), (number(key)? * (FACTOR_LN * change).exp()).into())]),
            Suspect::Count(key) => {
                let given = number(key)?;
                let right = (given * (FACTOR_LN * change).exp()).round();
                (right != given).then(|| vec![(key.to_string(), (right as i64).into())])
            }
            Suspect::Launch => {
                let date = date_after(mission.mission.launch.0, LAUNCH_YR * change)?;
                Some(vec![("mission.launch".into(), Value::Datetime(date.to_string().parse().ok()?))])
            }
            Suspect::Exchanged(one, other) => {
                let of = |name: &str, field: &str| format!("detector.traps.{name}.{field}");
                let fields = ["release_ms", "energy_ev"].into_iter();
                let both =
                    fields.flat_map(|field| [(of(one, field), of(other, field)), (of(other, field), of(one, field))]);
                both.map(|(key, from)| Some((key, number(&from)?.into()))).collect()
            }
        }
    }

    /// Years by which times since launch change.
    fn later_yr(&self, change: f64) -> f64 {
        if matches!(self, Suspect::Launch) { LAUNCH_YR * change } else { 0.0 }
    }

    fn key(&self) -> &str {
        match self {
            Suspect::Factor(key) | Suspect::Count(key) => key,
            Suspect::Launch => "mission.launch",
            Suspect::Exchanged(..) => "detector.traps",
        }
    }

    /// In words.
    fn law(&self, mission: &Mission, settings: &[(String, Value)]) -> Law {
        let (given, right) = match self {
            Suspect::Exchanged(one, other) => (format!("{one}, {other}"), format!("{other}, {one}")),
            Suspect::Launch => (mission.mission.launch.0.to_string(), settings[0].1.to_string()),
            _ => {
                let plain = |value: f64| crate::mission::keys::plain(format!("{value:.3e}").parse().unwrap_or(value));
                let value = |value: &Value| value.as_float().or(value.as_integer().map(|value| value as f64));
                let given = mission.number(self.key()).map_or_else(String::new, plain);
                let right = match &settings[0].1 {
                    Value::Integer(right) => right.to_string(),
                    other => value(other).map_or_else(String::new, plain),
                };
                (given, right)
            }
        };
        Law::Number { key: self.key().to_string(), given, right }
    }
}

impl SetSearch<'_> {
    /// Each number that changes a prediction, at its best value on top of a set.
    pub(super) fn numbers_of(&self, line: &Explanation) -> Vec<WithLaw> {
        let suspects: Vec<Suspect> = Suspect::all(&line.mission)
            .into_iter()
            .filter(|suspect| self.changed(line, suspect, CHANGES[CHANGES.len() - 1]).is_some())
            .collect();
        let choices = 2.0 * (suspects.len().max(1) as f64 / WRONG_NUMBER).ln();
        parallel::map(suspects, |suspect| self.with_number(line, &suspect, choices)).into_iter().flatten().collect()
    }

    /// Change of all predictions; None if there is none.
    fn changed(&self, line: &Explanation, suspect: &Suspect, change: f64) -> Option<Vec<f64>> {
        let mission = line.mission.with(&suspect.settings(&line.mission, change)?).ok()?;
        let later_yr = suspect.later_yr(change);
        let predicted = if later_yr == 0.0 {
            self.fitter.predicted(&mission)?
        } else {
            let model = self.fitter.model.like(&mission);
            let case = self.fitter.case;
            case.predict_at(&model, &|row, at| {
                // Times of dated rows follow the launch by themselves.
                if !case.questions[row].at.is_dated() {
                    at.t_yr -= later_yr;
                }
                at.t_yr >= 0.0
            })?
        };
        let changes: Vec<f64> = predicted.iter().zip(&line.model).map(|(moved, model)| moved - model).collect();
        changes.iter().any(|change| *change != 0.0).then_some(changes)
    }

    /// Evidence of a set with a number at its best value.
    fn with_number(&self, line: &Explanation, suspect: &Suspect, choices: f64) -> Option<WithLaw> {
        let fit = |change: f64| -> Option<LineFit> {
            let changes = self.changed(line, suspect, change)?;
            self.with_fixed(line, &changes).map(|fit| LineFit { objective: fit.objective + change * change, ..fit })
        };
        let objective = |change: f64| fit(change).map_or(f64::INFINITY, |fit| fit.objective);
        let is_discrete = matches!(suspect, Suspect::Exchanged(..));
        let best = if is_discrete {
            1.0
        } else {
            let tried = CHANGES.map(|change| (objective(change), change));
            let place = (0..tried.len()).min_by(|a, b| tried[*a].0.total_cmp(&tried[*b].0)).expect("some");
            let low = tried[place.saturating_sub(1)].1 - if place == 0 { 1.0 } else { 0.0 };
            let high = tried[(place + 1).min(tried.len() - 1)].1 + if place + 1 == tried.len() { 1.0 } else { 0.0 };
            let found = golden_section([low, high], GOLDEN, objective);
            if objective(found) < tried[place].0 { found } else { tried[place].1 }
        };
        let settings = suspect.settings(&line.mission, best)?;
        let fit = fit(best)?;
        let objective = if is_discrete { fit.objective - best * best } else { fit.objective };
        let columns = match (is_discrete, self.changed(line, suspect, best), self.changed(line, suspect, best + STEP)) {
            (false, Some(here), Some(there)) => {
                vec![there.iter().zip(&here).map(|(there, here)| (there - here) / STEP).collect()]
            }
            _ => Vec::new(),
        };
        let widths = vec![1.0; columns.len()];
        let price = self.volume_with(line, &fit.errors, &columns, &widths) + choices + self.choices_of(&line.added);
        Some(WithLaw {
            law: suspect.law(&line.mission, &settings),
            values: vec![best],
            beside: line.set(),
            minus_2_ln_z: objective + price,
            minus_2_ln_l: fit.minus_2_ln_l,
            errors: fit.errors,
            left: fit.left,
        })
    }
}
