//! Formulas of the measured values, such as `value * (1 + a * background_e)`, or a step between two epochs: laws of the measurement
//! (`measurement_law.rs`), or a starting point for the user's own hypothesis.

use nalgebra::{DMatrix, DVector};

use super::result::{Covariate, Suggestion};
use crate::analysis::measurement::DataSet;
use crate::analysis::validate::Validation;
use crate::mission::keys::plain;
use crate::numeric::least_squares::Span;
use crate::physics::observable::Observable;

/// Share of a power of a covariate beyond the span of the lower ones, below which it is linearly dependent.
const FLAT: f64 = 1e-10;

/// Epochs between which steps are tried.
const MOST_STEPS: usize = 200;

/// Range of a condition over its middle, below which it is counted from there.
const NARROW: f64 = 0.5;

/// Names of a formula's parameters.
pub(super) const NAMES: [&str; 3] = ["a", "b", "c"];

/// On what a formula depends.
#[derive(Clone)]
pub(super) enum Argument {
    /// On nothing.
    Constant,
    /// On the value itself.
    Value,
    /// On a condition, counted from an origin.
    Condition(String, f64),
    /// On whether a condition is above a limit.
    Above(String, f64),
    /// On a wave in time: its cosine and sine, of a period in years.
    Wave(f64),
}

/// A formula for the values of one observable or of all.
#[derive(Clone)]
pub(super) struct Formula {
    /// The values of one observable; None for all of them.
    of: Option<Observable>,
    /// Multiplied with the values, or added to them.
    multiplied: bool,
    pub argument: Argument,
    /// Powers of the argument, one for each parameter.
    pub powers: &'static [i32],
}

impl Formula {
    pub fn expression(&self) -> String {
        let term = |(name, power): (&&str, &i32)| match (&self.argument, power) {
            (Argument::Above(condition, limit), _) => format!("if {condition} > {limit} {{ {name} }} else {{ 0 }}"),
            (Argument::Wave(period_yr), 0) => format!("{name} * cos(2 * PI * t_yr / {})", plain(*period_yr)),
            (Argument::Wave(period_yr), _) => format!("{name} * sin(2 * PI * t_yr / {})", plain(*period_yr)),
            (Argument::Constant, _) | (_, 0) => name.to_string(),
            (Argument::Value, power) => format!("{name} * value{}", raised(*power)),
            (Argument::Condition(condition, origin), power) => {
                format!("{name} * {}{}", from_origin(condition, *origin), raised(*power))
            }
        };
        let terms: Vec<String> = NAMES.iter().zip(self.powers).map(term).collect();
        let sum = terms.join(" + ");
        if self.multiplied { format!("value * (1 + {sum})") } else { format!("value + {sum}") }
    }

    pub fn target(&self) -> String {
        self.of.map_or_else(|| "value".into(), |of| format!("value.{}", of.name()))
    }

    /// `[effects.formula]` as it would be written in a mission, with the values of its parameters.
    pub fn toml(&self, values: &[f64]) -> String {
        let (target, expression) = (self.target(), self.expression());
        let head = format!("[effects.formula]\ntarget = \"{target}\"\nexpression = \"{expression}\"\n");
        let lines = NAMES.iter().zip(values).map(|(name, value)| format!("{name} = {value:.6e}\n"));
        std::iter::once(head).chain(lines).collect()
    }

    fn concerns(&self, set: &DataSet) -> bool {
        self.of.is_none_or(|observable| observable == set.observable)
    }

    /// Changes of all values with each parameter, in the unit of the values, if the model predicts `values`.
    pub fn columns<'a>(&self, data: impl Iterator<Item = &'a DataSet>, values: &[f64]) -> Vec<Vec<f64>> {
        let mut arguments = Vec::with_capacity(values.len());
        for set in data {
            let here = &values[arguments.len()..arguments.len() + set.rows.len()];
            match (&self.argument, self.concerns(set)) {
                (Argument::Value, true) => arguments.extend(here.iter().map(|value| Some(*value))),
                (Argument::Condition(condition, origin), true) => {
                    arguments.extend(set.against(condition).into_iter().map(|at| Some(at - origin)))
                }
                (Argument::Above(condition, limit), true) => {
                    arguments.extend(set.against(condition).iter().map(|at| Some(f64::from(at > limit))));
                }
                (Argument::Wave(period_yr), true) => {
                    let turns = set.against("t_yr").into_iter();
                    arguments.extend(turns.map(|t_yr| Some(2.0 * std::f64::consts::PI * t_yr / period_yr)))
                }
                (Argument::Constant, true) => arguments.extend(here.iter().map(|_| Some(1.0))),
                (_, false) => arguments.extend(here.iter().map(|_| None)),
            }
        }
        let column = |power: &i32| {
            let one = |(argument, value): (&Option<f64>, &f64)| {
                let size = if self.multiplied { *value } else { 1.0 };
                // Rows without the condition are left as they are.
                let term = |argument: f64| match (&self.argument, power) {
                    (Argument::Wave(_), 0) => argument.cos(),
                    (Argument::Wave(_), _) => argument.sin(),
                    (_, power) => argument.powi(*power),
                };
                argument.filter(|argument| argument.is_finite()).map_or(0.0, |argument| size * term(argument))
            };
            arguments.iter().zip(values).map(one).collect()
        };
        self.powers.iter().map(column).collect()
    }

    /// The factors by which it multiplies values, with the values of its parameters; none if it is added.
    pub fn factors<'a>(&self, data: impl Iterator<Item = &'a DataSet>, values: &[f64], parameters: &[f64]) -> Vec<f64> {
        if !self.multiplied {
            return Vec::new();
        }
        let columns = self.columns(data, values);
        let change =
            |row: usize| columns.iter().zip(parameters).map(|(column, parameter)| parameter * column[row]).sum::<f64>();
        values.iter().enumerate().map(|(row, value)| 1.0 + change(row) / value).collect()
    }
}

/// `temperature_k`, or `(temperature_k - 153)`
fn from_origin(condition: &str, origin: f64) -> String {
    match origin {
        0.0 => condition.to_string(),
        origin if origin < 0.0 => format!("({condition} + {})", plain(-origin)),
        origin => format!("({condition} - {})", plain(origin)),
    }
}

/// From where a condition is counted: 0, or, if all values are far from it, a short number in their middle. A law in powers of a temperature
/// in kelvins would otherwise be the small difference of large terms.
fn origin(values: &[f64]) -> f64 {
    let (Some(low), Some(high)) = (values.first(), values.last()) else { return 0.0 };
    let (middle, range) = (0.5 * (low + high), high - low);
    if range < NARROW * middle.abs() { between(middle - 0.1 * range, middle + 0.1 * range) } else { 0.0 }
}

fn raised(power: i32) -> String {
    if power == 1 { String::new() } else { format!("^{power}") }
}

/// To what formulas can apply: `of`, and `multiplied`. Something added has the unit of one observable.
fn targets<'a>(data: impl Iterator<Item = &'a DataSet>) -> Vec<(Option<Observable>, bool)> {
    let mut observables: Vec<Observable> = data.map(|set| set.observable).collect();
    observables.sort_by_key(|observable| *observable as usize);
    observables.dedup();
    match &observables[..] {
        [_] => vec![(None, true), (None, false)],
        several => {
            let one = |of: &Observable| [(Some(*of), true), (Some(*of), false)];
            [(None, true)].into_iter().chain(several.iter().flat_map(one)).collect()
        }
    }
}

/// All laws that make sense for some data. A constant that is added is a pedestal.
pub(super) fn laws(data: &[DataSet]) -> Vec<Formula> {
    let mut all = Vec::new();
    for (of, multiplied) in targets(data.iter()) {
        let concerned: Vec<&DataSet> = data.iter().filter(|set| of.is_none_or(|of| of == set.observable)).collect();
        let mut add = |argument: Argument, powers: &'static [i32]| {
            all.push(Formula { of, multiplied, argument, powers });
        };
        if multiplied {
            add(Argument::Constant, &[0]);
            for powers in [&[1][..], &[0, 1], &[1, 2]] {
                add(Argument::Value, powers);
            }
        }
        for (condition, values) in conditions(&concerned) {
            let determined = |powers: &&[i32]| powers.iter().all(|power| (*power as usize) < values.len());
            for powers in [&[1][..], &[0, 1], &[1, 2], &[0, 1, 2]].into_iter().filter(determined) {
                add(Argument::Condition(condition.clone(), origin(&values)), powers);
            }
            if condition == "t_yr" {
                for period_yr in periods_yr(&values) {
                    add(Argument::Wave(period_yr), &[0, 1]);
                }
            }
            if condition == "t_yr" && values.len() <= MOST_STEPS {
                for pair in values.windows(2) {
                    add(Argument::Above(condition.clone(), between(pair[0], pair[1])), &[1]);
                }
            }
        }
    }
    all
}

/// Epochs that a wave needs: its mean, amplitude, phase and period are four numbers, and as many are left to test it.
const EPOCHS_OF_A_WAVE: usize = 8;

/// Ratio of two periods that are tried. The nearest is off by δ = √1.15 − 1 = 7.2 % at most, and keeps sin(πδN)/(πδN) of the amplitude of a
/// wave of N turns: 0.93 of three, 0.72 of six.
const PERIODS: f64 = 1.15;

/// Periods of waves that epochs (ascending, years) can show: from twice their usual interval to their span; a year among them.
fn periods_yr(epochs_yr: &[f64]) -> Vec<f64> {
    let (Some(first), Some(last)) = (epochs_yr.first(), epochs_yr.last()) else { return Vec::new() };
    let span_yr = last - first;
    if epochs_yr.len() < EPOCHS_OF_A_WAVE || span_yr <= 0.0 {
        return Vec::new();
    }
    let shortest_yr = 2.0 * span_yr / (epochs_yr.len() - 1) as f64;
    let count = ((span_yr / shortest_yr).ln() / PERIODS.ln()).floor() as i32;
    let mut all: Vec<f64> = (0..=count).map(|step| span_yr / PERIODS.powi(step)).collect();
    let rounded = |period_yr: f64| format!("{period_yr:.3e}").parse().expect("a number");
    all = all.into_iter().map(rounded).collect();
    if (shortest_yr..span_yr).contains(&1.0) && !all.contains(&1.0) {
        all.push(1.0);
    }
    all
}

/// Numeric conditions that vary, and that every row has; each with its values.
fn conditions(concerned: &[&DataSet]) -> Vec<(String, Vec<f64>)> {
    let mut names: Vec<&String> = concerned.iter().flat_map(|set| &set.varying).collect();
    names.sort();
    names.dedup();
    let of = |name: &String| {
        if concerned.iter().any(|set| set.is_words(name)) {
            return None;
        }
        let all_have_it = concerned.iter().all(|set| set.against(name).iter().all(|value| value.is_finite()));
        let values = distinct(concerned.iter().copied(), name);
        (all_have_it && values.len() > 1).then(|| (name.clone(), values))
    };
    names.into_iter().filter_map(of).collect()
}

/// Values of a numeric condition, ascending.
fn distinct<'a>(data: impl Iterator<Item = &'a DataSet>, name: &str) -> Vec<f64> {
    let mut values: Vec<f64> = data.flat_map(|set| set.against(name)).filter(|value| value.is_finite()).collect();
    values.sort_by(f64::total_cmp);
    values.dedup();
    values
}

/// A short number between two others.
fn between(low: f64, high: f64) -> f64 {
    let middle = 0.5 * (low + high);
    let rounded = |digits: i32| (middle * 10_f64.powi(digits)).round() / 10_f64.powi(digits);
    (0..8).map(rounded).find(|at| *at > low && *at < high).unwrap_or(middle)
}

/// A parabola in the condition with the strongest residual trend (a straight line if it has two values), or a constant if there is
/// no trend. It is added to the values or multiplied with them, of one observable or of all, whichever explains most. None if the
/// residuals trend with words alone.
pub(super) fn suggest(validation: &Validation, covariates: &[Covariate]) -> Option<Suggestion> {
    let data = || validation.sets.iter().map(|set| &set.data);
    let covariate = covariates.iter().find(|covariate| !data().any(|set| set.is_words(&covariate.name)));
    if covariate.is_none() && !covariates.is_empty() {
        return None;
    }
    let (argument, powers) = match covariate {
        Some(Covariate { name, .. }) => {
            let values = distinct(data(), name);
            let powers: &[i32] = if values.len() > 2 { &[0, 1, 2] } else { &[0, 1] };
            (Argument::Condition(name.clone(), origin(&values)), powers)
        }
        None => (Argument::Constant, &[0][..]),
    };
    let sigma: Vec<f64> = data().flat_map(|set| set.rows.iter().map(|row| row.sigma)).collect();
    let model: Vec<f64> = validation.sets.iter().flat_map(|set| set.model.iter().copied()).collect();
    let residuals = DVector::from_vec(validation.sets.iter().flat_map(|set| set.off_sigma()).collect());
    let explained = |(of, multiplied)| {
        let form = Formula { of, multiplied, argument: argument.clone(), powers };
        let columns = form.columns(data(), &model).into_iter();
        let in_sigma =
            |column: Vec<f64>| DVector::from_iterator(sigma.len(), column.iter().zip(&sigma).map(|(e, s)| e / s));
        let columns = DMatrix::from_columns(&columns.map(in_sigma).collect::<Vec<_>>());
        let found = Span::of(&columns, FLAT).solve(&residuals);
        (form, (&residuals - columns * &found).norm_squared(), found)
    };
    let all = targets(data()).into_iter().map(explained);
    let (form, chi2, found) = all.min_by(|a, b| a.1.total_cmp(&b.1))?;
    let toml = form.toml(found.as_slice());
    Some(Suggestion { toml, chi2: [residuals.norm_squared(), chi2], is_law: false, is_fitted: false, step_yr: None })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::table::Table;
    use crate::mission::Mission;

    /// CTI at epochs of some temperatures, K.
    fn at(temperatures_k: &[f64]) -> DataSet {
        let mut text = "# observable: cti\n# transfers: 100\nt_yr,temperature_k,signal_e,value,sigma\n".to_string();
        for (row, temperature_k) in temperatures_k.iter().enumerate() {
            text += &format!("{},{temperature_k},1000,1e-5,1e-6\n", 0.5 * (row + 1) as f64);
        }
        let mission = Mission::parse(include_str!("../../../missions/snap_l2.toml")).unwrap();
        DataSet::of(Table::parse("cti.csv", &text).unwrap(), &mission).unwrap()
    }

    #[test]
    fn a_condition_of_two_values_determines_a_straight_line() {
        for (temperatures_k, determined) in [(&[153.0, 153.0, 163.0, 163.0][..], 1), (&[153.0, 158.0, 163.0], 2)] {
            let laws = laws(&[at(temperatures_k)]);
            let in_temperature = |law: &&Formula| matches!(&law.argument, Argument::Condition(condition, _) if condition == "temperature_k");
            let powers = laws.iter().filter(in_temperature).flat_map(|law| law.powers);
            assert_eq!(powers.max(), Some(&determined), "{temperatures_k:?}");
        }
    }

    #[test]
    fn factors_are_those_of_the_expression() {
        let data = [at(&[153.0, 158.0, 163.0])];
        let argument = Argument::Condition("temperature_k".into(), 158.0);
        let law = Formula { of: None, multiplied: true, argument, powers: &[0, 1] };
        assert_eq!(law.expression(), "value * (1 + a + b * (temperature_k - 158))");
        assert_eq!(law.factors(data.iter(), &[1e-5, 2e-5, 4e-5], &[9.0, 0.5]), [7.5, 10.0, 12.5]);
        assert!(Formula { multiplied: false, ..law }.factors(data.iter(), &[1e-5; 3], &[9.0, 0.5]).is_empty());
    }
}
