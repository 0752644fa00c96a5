//! Laws of the measurement, beside the ranking of effects: they imitate almost any physics.
//!
//! They are linear, and need no evaluation of the model, but for temperatures that no column records.

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector};

use super::super::explanation::{Explanation, volume};
use super::super::formula::{Argument, Formula, laws};
use super::super::result::{Reason, Suggestion};
use super::super::unrecorded;
use super::linear::Linear;
use super::signature::Strength;
use super::{LINES, ROUNDS, SetSearch};
use crate::analysis::likelihood::{Errors, minus_2_ln_l};
use crate::analysis::measurement::DataSet;
use crate::numeric::parallel;

/// Prior probability that what is missing is a law of the measurement.
const LAWS: f64 = 0.1;

/// Laws that are also tried on top of the sets that are not among the best.
const LAWS_ELSEWHERE: usize = 5;

/// Scatter of temperatures that no column records, K: that of a thermostat, of a radiator, of a detector without either.
const SCATTERS_K: [f64; 3] = [0.5, 1.5, 5.0];

/// A law changes values by about this share, or by this many typical errors.
const LAW_SHARE: f64 = 0.3;

/// Values of a column at most for which rows with one of them are a group: of one that is no condition of the model, and of a condition,
/// such as the pixel of a trail.
const GROUPS: usize = 12;
const VALUES: usize = 40;

/// A law that multiplies every value by more takes the place of the model, whose own traps then hardly count.
const IN_PLACE: f64 = 10.0;

/// A law of the measurement on top of a set.
pub(in super::super) struct WithLaw {
    pub law: Law,
    /// Values of its parameters.
    pub values: Vec<f64>,
    /// The effects beside it.
    pub beside: Vec<usize>,
    pub minus_2_ln_z: f64,
    pub minus_2_ln_l: f64,
    /// The errors with it, and what it leaves (value − model).
    pub errors: Vec<Errors>,
    pub left: Vec<f64>,
}

impl WithLaw {
    /// As a formula to start from, if it is one.
    pub(in super::super) fn suggestion(&self, minus_2_ln_l: f64) -> Option<Suggestion> {
        let Law::Formula(law) = &self.law else { return None };
        let step_yr = match law.argument {
            Argument::Above(_, limit) => Some(limit),
            _ => None,
        };
        let chi2 = [minus_2_ln_l, self.minus_2_ln_l];
        Some(Suggestion { toml: law.toml(&self.values), chi2, is_law: true, is_fitted: true, step_yr })
    }

    /// For a verdict that names it.
    pub(in super::super) fn reason(&self, beside: Vec<String>) -> Reason {
        if let Law::Number { key, given, right } = &self.law {
            return Reason::WrongNumber { key: key.clone(), given: given.clone(), right: right.clone(), beside };
        }
        let target = match &self.law {
            Law::Formula(law) => law.target(),
            _ => "value".into(),
        };
        Reason::BetterLaw { target, expression: self.law.expression(), beside }
    }
}

/// A law of the measurement.
#[derive(Clone)]
pub(in super::super) enum Law {
    /// As a formula.
    Formula(Formula),
    /// A factor, or a constant, of its own for the rows with one value of a column.
    Group { column: String, value: String, multiplied: bool },
    /// For every word or value of a column.
    Groups(String),
    /// A temperature of its own at every epoch, in files that do not record it, with this scatter in K.
    Temperatures(f64),
    /// No law, but another value of a number of the mission.
    Number { key: String, given: String, right: String },
}

/// A set with one fixed change of its predictions, the other parameters and errors following to first order.
pub(in super::super) struct LineFit {
    /// −2 ln L and the priors' part.
    pub objective: f64,
    pub minus_2_ln_l: f64,
    pub errors: Vec<Errors>,
    /// value − model.
    pub left: Vec<f64>,
}

impl Law {
    /// In words, as a formula where it is one.
    pub(in super::super) fn expression(&self) -> String {
        match self {
            Law::Formula(law) => law.expression(),
            Law::Group { column, value, multiplied: true } => format!("value * (1 + a) where {column} is {value}"),
            Law::Group { column, value, multiplied: false } => format!("value + a where {column} is {value}"),
            Law::Groups(column) => format!("value * (1 + a), with another a for every {column}"),
            Law::Number { key, given, right } => format!("{key} = {right} in place of {given}"),
            Law::Temperatures(scatter_k) => {
                format!("value at temperature_k + a, with another a for every t_yr, of some {scatter_k} K")
            }
        }
    }

    /// The key of a number of the mission.
    pub(in super::super) fn key(&self) -> Option<&str> {
        if let Law::Number { key, .. } = self { Some(key) } else { None }
    }

    /// Prior widths of its parameters.
    fn widths(&self, columns: &[Vec<f64>], model: &[f64]) -> Vec<f64> {
        if let Law::Temperatures(scatter_k) = self {
            return vec![*scatter_k; columns.len()];
        }
        let largest = |column: &[f64]| column.iter().fold(0.0_f64, |most, value| most.max(value.abs()));
        let typical = largest(model);
        columns.iter().map(|column| LAW_SHARE * typical / largest(column).max(f64::MIN_POSITIVE)).collect()
    }
}

/// A word or value of a column, and the rows that have it.
type Group = (String, Vec<usize>);

/// Rows with the same word or value in a column, by the name of the column; two groups or more.
fn groups_of_rows(data: &[DataSet]) -> Vec<(String, Vec<Group>)> {
    let mut names: Vec<&String> = data.iter().flat_map(|set| &set.varying).collect();
    names.sort();
    names.dedup();
    let of = |name: &&String| {
        if ["galaxy", "date"].contains(&name.as_str()) {
            return None;
        }
        let is_condition = crate::physics::conditions::NAMES.contains(&name.as_str());
        let mut groups: BTreeMap<String, Vec<usize>> = BTreeMap::new();
        let mut first = 0;
        for set in data {
            let values = set.against(name);
            for (row, value) in values.into_iter().enumerate().filter(|(_, value)| value.is_finite()) {
                let word = set.rows[row].word(name).map_or_else(|| value.to_string(), str::to_string);
                groups.entry(word).or_default().push(first + row);
            }
            first += set.rows.len();
        }
        let most = if is_condition { VALUES } else { GROUPS };
        (2..=most).contains(&groups.len()).then(|| (name.to_string(), groups.into_iter().collect()))
    };
    names.iter().filter_map(of).collect()
}

impl SetSearch<'_> {
    /// The best law of the measurement, on top of the base or of the best sets; the best laws there also on top of all others, since an
    /// effect may be seen only beside a law. Laws are linear: their evidence needs no evaluation.
    pub(super) fn best_law(&self, base: &Explanation, sets: &[Explanation]) -> Option<WithLaw> {
        (self.progress.stage)("laws of the measurement", 0);
        let (first, rest) = sets.split_at(sets.len().min(LINES));
        let mut lines: Vec<&Explanation> = first.iter().collect();
        if lines.iter().all(|line| !line.added.is_empty()) {
            lines.push(base);
        }
        let mut found: Vec<WithLaw> = lines.iter().flat_map(|line| self.laws_of(line, |_| true)).collect();
        found.sort_by(|a, b| a.minus_2_ln_z.total_cmp(&b.minus_2_ln_z));
        let best: Vec<String> = found.iter().take(LAWS_ELSEWHERE).map(|found| found.law.expression()).collect();
        found.extend(rest.iter().flat_map(|line| self.laws_of(line, |law| best.contains(&law.expression()))));
        found.into_iter().min_by(|a, b| a.minus_2_ln_z.total_cmp(&b.minus_2_ln_z))
    }

    /// Some laws on top of a set.
    pub(super) fn laws_of(&self, line: &Explanation, wanted: impl Fn(&Law) -> bool) -> Vec<WithLaw> {
        let data = || self.fitter.case.data.iter();
        let formulas = laws(self.fitter.case.data).into_iter();
        let formulas = formulas.map(|law| (law.columns(data(), &line.model), Law::Formula(law)));
        let groups = groups_of_rows(self.fitter.case.data).into_iter().flat_map(|(name, members)| {
            let column = |(_, rows): &Group, of: &dyn Fn(usize) -> f64| {
                let mut column = vec![0.0; line.model.len()];
                rows.iter().for_each(|&row| column[row] = of(row));
                column
            };
            let times = |group: &Group| column(group, &|row| line.model[row]);
            let one = |group: &Group| {
                let law = |multiplied| Law::Group { column: name.clone(), value: group.0.clone(), multiplied };
                [(vec![times(group)], law(true)), (vec![column(group, &|_| 1.0)], law(false))]
            };
            let mut all: Vec<_> = members.iter().flat_map(one).collect();
            if members.len() <= GROUPS {
                all.push((members.iter().map(times).collect(), Law::Groups(name.clone())));
            }
            all
        });
        let mut all: Vec<(Vec<Vec<f64>>, Law)> = formulas.chain(groups).collect();
        let temperatures = SCATTERS_K.map(Law::Temperatures);
        if temperatures.iter().any(&wanted) {
            let model = self.fitter.model.like(&line.mission);
            let columns = unrecorded::per_kelvin(self.fitter.case, &model, &line.model);
            all.extend(columns.iter().flat_map(|columns| temperatures.clone().map(|law| (columns.clone(), law))));
        }
        let choices = 2.0 * (all.len().max(1) as f64 / LAWS).ln();
        let some: Vec<_> = all.into_iter().filter(|(_, law)| wanted(law)).collect();
        parallel::map(some, |(columns, law)| self.with_law(line, law, &columns, choices))
            .into_iter()
            .flatten()
            .collect()
    }

    /// Evidence of a set with a law; None if the free parameters do the same.
    pub(super) fn with_law(&self, line: &Explanation, law: Law, columns: &[Vec<f64>], choices: f64) -> Option<WithLaw> {
        let widths = law.widths(columns, &line.model);
        let plain = self.plain(line);
        let mut best: Option<WithLaw> = None;
        for from in [&line.errors, &plain] {
            let mut errors = from.clone();
            for _ in 0..ROUNDS {
                let problem = Linear::of(self, line, &errors);
                let found = problem.solve_any(columns, &widths)?;
                let left = problem.left(line, &found, columns);
                errors = self.fitter.likelihood.errors(&left, Some(&errors));
                let values = found[line.unknowns.len()..].to_vec();
                let priors: f64 = values.iter().zip(&widths).map(|(value, width)| (value / width).powi(2)).sum();
                let steps = if matches!(&law, Law::Formula(law) if matches!(law.argument, Argument::Above(..))) {
                    2.0
                } else {
                    0.0
                };
                let price =
                    self.volume_with(line, &errors, columns, &widths) + choices + steps + self.choices_of(&line.added);
                let l = minus_2_ln_l(&errors);
                let minus_2_ln_z = l + problem.prior(&found) + priors + price;
                if best.as_ref().is_none_or(|best| minus_2_ln_z < best.minus_2_ln_z) {
                    best = Some(WithLaw {
                        law: law.clone(),
                        values,
                        beside: line.set(),
                        minus_2_ln_z,
                        minus_2_ln_l: l,
                        errors: errors.clone(),
                        left,
                    });
                }
            }
        }
        let multiplies_too_much = |found: &WithLaw| match &law {
            Law::Formula(law) => {
                let factors = law.factors(self.fitter.case.data.iter(), &line.model, &found.values);
                !factors.is_empty() && factors.iter().all(|factor| factor.abs() > IN_PLACE)
            }
            _ => false,
        };
        best.filter(|best| !multiplies_too_much(best))
    }

    /// A set with a change of its predictions.
    pub(super) fn with_fixed(&self, line: &Explanation, changes: &[f64]) -> Option<LineFit> {
        let columns = [changes.to_vec()];
        let plain = self.plain(line);
        let mut best: Option<LineFit> = None;
        for from in [&line.errors, &plain] {
            let mut errors = from.clone();
            for _ in 0..ROUNDS {
                let problem = Linear::of(self, line, &errors);
                let found = problem.solve(&columns, Strength::Fixed)?;
                let left = problem.left(line, &found, &columns);
                errors = self.fitter.likelihood.errors(&left, Some(&errors));
                let l = minus_2_ln_l(&errors);
                let objective = l + problem.prior(&found[..line.unknowns.len()]);
                if best.as_ref().is_none_or(|best| objective < best.objective) {
                    best = Some(LineFit { objective, minus_2_ln_l: l, errors: errors.clone(), left });
                }
            }
        }
        best
    }

    /// ln det(1 + Π A'A Π) with further columns.
    pub(super) fn volume_with(
        &self,
        line: &Explanation,
        errors: &[Errors],
        columns: &[Vec<f64>],
        widths: &[f64],
    ) -> f64 {
        let further: Vec<DVector<f64>> = columns.iter().map(|column| DVector::from_column_slice(column)).collect();
        let own = line.derivatives.column_iter().map(|column| column.into_owned());
        let all: Vec<DVector<f64>> = own.chain(further).collect();
        if all.is_empty() {
            return 0.0;
        }
        let white = self.fitter.whitened(errors, &DMatrix::from_columns(&all));
        let own = line.unknowns.iter().map(|unknown| unknown.prior.map_or(0.0, |prior| prior.width));
        volume(&white, &own.chain(widths.iter().copied()).collect::<Vec<f64>>())
    }
}
