//! A law of the measurement itself in place of effects.
//!
//! A gain that depends on the signal, or that stepped between two epochs, is not in the catalogue, but an effect may describe most of
//! it. So an effect is adopted only if no simple law of the measured values explains the data much better: values of one
//! observable, or of all, multiplied by a polynomial of a condition or of themselves, or with such a polynomial added, or a step.
//! All laws are tried to first order at the base fit; the most promising are fitted, with all free parameters.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};

use super::evidence::{Evidence, Found};
use super::fitted_model::Node;
use super::noise::wrong_rows;
use super::result::{Reason, Suggestion, Verdict};
use super::{formula, rivals, trimmed};
use crate::analysis::fit;
use crate::analysis::measurement::DataSet;
use crate::error::InputError;
use crate::mission::keys::plain;
use crate::mission_file;
use crate::numeric::least_squares::Span;
use crate::numeric::parallel;
use crate::physics::observable::Observable;

/// Laws that are fitted.
const FITTED: usize = 3;

/// Epochs between which steps are tried.
const MOST_STEPS: usize = 200;

/// Share of what a parameter of a law changes that no other one does, below which a law without it does the same.
const INDEPENDENT: f64 = 0.01;

/// Range of a condition over its middle, below which it is counted from there.
const NARROW: f64 = 0.5;

/// chi2 of a row, below which a law describes data whose errors may be 1.6 times too small.
const DESCRIBED: f64 = 2.5;

/// A law of the measurement, fitted.
pub(super) struct MeasurementLaw {
    pub suggestion: Suggestion,
    /// For a verdict that names it.
    pub reason: Reason,
    /// chi2 of the rows, with penalties for its parameters and for the choice among all laws. The penalties of pedestals are not
    /// counted: a constant of a law could be one.
    cost: f64,
    /// Penalties of pedestals.
    pedestals: f64,
    /// (value − model)/sigma, whitened.
    residuals: DVector<f64>,
}

/// On what a law depends.
enum Argument {
    /// On nothing.
    Constant,
    /// On the value itself.
    Value,
    /// On a condition, counted from an origin.
    Condition(String, f64),
    /// On whether a condition is above a limit.
    Above(String, f64),
}

/// A law to be tried.
struct Law {
    /// The values of one observable; None for all of them.
    of: Option<Observable>,
    /// Multiplied with the values, or added to them.
    multiplied: bool,
    argument: Argument,
    /// Powers of the argument, one for each parameter.
    powers: &'static [i32],
}

impl Law {
    fn expression(&self) -> String {
        let term = |(name, power): (&&str, &i32)| match (&self.argument, power) {
            (Argument::Above(condition, limit), _) => format!("if {condition} > {limit} {{ {name} }} else {{ 0 }}"),
            (Argument::Constant, _) | (_, 0) => name.to_string(),
            (Argument::Value, power) => format!("{name} * value{}", raised(*power)),
            (Argument::Condition(condition, origin), power) => {
                format!("{name} * {}{}", from_origin(condition, *origin), raised(*power))
            }
        };
        let terms: Vec<String> = formula::NAMES.iter().zip(self.powers).map(term).collect();
        let sum = terms.join(" + ");
        if self.multiplied { format!("value * (1 + {sum})") } else { format!("value + {sum}") }
    }

    fn target(&self) -> String {
        self.of.map_or_else(|| "value".into(), |of| format!("value.{}", of.name()))
    }

    /// Fitted parameters, and the limit of a step.
    fn parameters(&self) -> usize {
        self.powers.len() + usize::from(matches!(self.argument, Argument::Above(..)))
    }

    fn concerns(&self, set: &DataSet) -> bool {
        self.of.is_none_or(|observable| observable == set.observable)
    }

    /// Changes of all values with each parameter, in the unit of the values, if the model predicts `values`.
    fn columns(&self, data: &[DataSet], values: &[f64]) -> Vec<Vec<f64>> {
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
                (Argument::Constant, true) => arguments.extend(here.iter().map(|_| Some(1.0))),
                (_, false) => arguments.extend(here.iter().map(|_| None)),
            }
        }
        let column = |power: &i32| {
            let one = |(argument, value): (&Option<f64>, &f64)| {
                let size = if self.multiplied { *value } else { 1.0 };
                argument.map_or(0.0, |argument| size * argument.powi(*power))
            };
            arguments.iter().zip(values).map(one).collect()
        };
        self.powers.iter().map(column).collect()
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

/// All laws that make sense for some data: something added has the unit of one observable. A constant that is added is a pedestal.
fn laws(data: &[DataSet]) -> Vec<Law> {
    let mut observables: Vec<Observable> = data.iter().map(|set| set.observable).collect();
    observables.sort_by_key(|observable| *observable as usize);
    observables.dedup();
    let targets = match &observables[..] {
        [_] => vec![None],
        several => std::iter::once(None).chain(several.iter().copied().map(Some)).collect(),
    };
    let mut all = Vec::new();
    for of in targets {
        let concerned: Vec<&DataSet> = data.iter().filter(|set| of.is_none_or(|of| of == set.observable)).collect();
        let mut add = |multiplied: bool, argument: Argument, powers: &'static [i32]| {
            all.push(Law { of, multiplied, argument, powers });
        };
        add(true, Argument::Constant, &[0]);
        for powers in [&[1][..], &[0, 1], &[1, 2]] {
            add(true, Argument::Value, powers);
        }
        for (condition, values) in conditions(&concerned) {
            for multiplied in [true, false] {
                if !multiplied && of.is_none() && observables.len() > 1 {
                    continue;
                }
                for powers in [&[1][..], &[0, 1], &[1, 2], &[0, 1, 2]] {
                    add(multiplied, Argument::Condition(condition.clone(), origin(&values)), powers);
                }
                if condition == "t_yr" && values.len() <= MOST_STEPS {
                    for pair in values.windows(2) {
                        add(multiplied, Argument::Above(condition.clone(), between(pair[0], pair[1])), &[1]);
                    }
                }
            }
        }
    }
    all
}

/// Numeric conditions that vary, and that every row has; each with its values, ascending.
fn conditions(concerned: &[&DataSet]) -> Vec<(String, Vec<f64>)> {
    let mut names: Vec<&String> = concerned.iter().flat_map(|set| &set.varying).collect();
    names.sort();
    names.dedup();
    let of = |name: &String| {
        if concerned.iter().any(|set| set.is_words(name)) {
            return None;
        }
        let mut values: Vec<f64> = concerned.iter().flat_map(|set| set.against(name)).collect();
        values.sort_by(f64::total_cmp);
        values.dedup();
        (values.iter().all(|value| value.is_finite()) && values.len() > 1).then(|| (name.clone(), values))
    };
    names.into_iter().filter_map(of).collect()
}

/// A short number between two others.
fn between(low: f64, high: f64) -> f64 {
    let middle = 0.5 * (low + high);
    let rounded = |digits: i32| (middle * 10_f64.powi(digits)).round() / 10_f64.powi(digits);
    (0..8).map(rounded).find(|at| *at > low && *at < high).unwrap_or(middle)
}

/// Some but not all of a few effects, and at least one of them.
fn fewer(effects: &[usize]) -> Vec<Vec<usize>> {
    let chosen = |mask: u32| {
        let is_in = |(place, _): &(usize, &usize)| mask >> place & 1 == 1;
        effects.iter().enumerate().filter(is_in).map(|(_, effect)| *effect).collect()
    };
    (1..(1 << effects.len()) - 1).map(chosen).collect()
}

impl Evidence<'_> {
    /// A law of the measurement that explains the data much better than a model with an effect, or better than one with several.
    pub(super) fn better_law(&self, node: &Node) -> Option<&MeasurementLaw> {
        let margin = if node.added.len() > 1 { 0.0 } else { rivals::margin(self.options.level) };
        self.law().filter(|law| law.cost + margin < node.chi2_of_rows() + self.cost(node))
    }

    /// The best law of the measurement on top of the base, whether it is better than effects or not.
    pub(super) fn law(&self) -> Option<&MeasurementLaw> {
        self.law.get_or_init(|| self.best_law(self.base)).as_ref()
    }

    /// Rows far from a law of the measurement that describes all others, each with its residual in sigma, if chi2 and penalties are
    /// below some value without them. Each counts as a parameter and as a choice among all rows.
    pub(super) fn far_from_a_law_below(&self, most: f64) -> Option<Vec<(usize, f64)>> {
        let law = self.law()?;
        let far = trimmed::farthest(self.case(), law.residuals.as_slice()).into_iter();
        let far: Vec<(usize, f64)> =
            far.map(|row| (row, law.residuals[row])).filter(|(_, off)| off.abs() > wrong_rows::FAR).collect();
        let n = self.case().n() as f64;
        let each = 2.0 + 2.0 * n.ln();
        let squares: f64 = far.iter().map(|(_, off)| off * off).sum();
        let is_described = law.residuals.norm_squared() - squares < DESCRIBED * n;
        let saved = squares - each * far.len() as f64;
        (is_described && law.cost + law.pedestals - saved < most).then_some(far)
    }

    /// The outcome of a search; if it found several effects, and a law beside fewer of them explains the data much better, that law and these
    /// effects. Each effect of a model may stand for a gain that changed.
    ///
    /// # Errors
    /// Those of a fit.
    pub(super) fn or_law_beside_fewer(&self, found: Found) -> Result<Found, InputError> {
        let Some(node) = found.ladder.last().filter(|node| node.added.len() > 1 && found.explains()) else {
            return Ok(found);
        };
        let effects: Vec<usize> = node.added.iter().map(|added| added.hypothesis).collect();
        let most = node.chi2_of_rows() + self.cost(node) - rivals::margin(self.options.level);
        let mut best: Option<(Arc<Node>, MeasurementLaw)> = None;
        for fewer in fewer(&effects) {
            let with = self.search.with(self.base, &fewer)?;
            let limit = best.as_ref().map_or(most, |(_, best)| best.cost);
            let Some(law) = self.best_law(&with) else { continue };
            if law.suggestion.is_law && law.cost < limit {
                best = Some((with, law));
            }
        }
        let Some((beside, law)) = best else { return Ok(found) };
        let nearest = Some(node.clone());
        let found = Found::of(Verdict::Unexplained, law.reason, self.ladder(&beside)?);
        Ok(Found { law: Some(law.suggestion), nearest, ..found })
    }

    /// The law that explains the data best on top of a model; None if none can be fitted. Few are fitted, so this is never left undone.
    fn best_law(&self, base: &Node) -> Option<MeasurementLaw> {
        let laws = laws(self.case().data);
        let choice = 2.0 * (laws.len() as f64).ln();
        let promised = parallel::map(&laws, |law| self.promise(base, law));
        let mut promised: Vec<(f64, &Law, DVector<f64>)> = promised.into_iter().flatten().collect();
        promised.sort_by(|a, b| a.0.total_cmp(&b.0));
        let fitted = promised.into_iter().take(FITTED).filter_map(|(_, law, start)| {
            let (node, toml) = self.with_law(base, law, &start)?;
            let unfitted = law.parameters() - law.powers.len();
            let cost = node.chi2_of_rows() + self.cost(&node) + 2.0 * unfitted as f64 + choice;
            let pedestals = node.pedestal_costs.iter().sum();
            let is_law = node.residuals.norm_squared() < DESCRIBED * self.case().n() as f64;
            let step_yr = match law.argument {
                Argument::Above(_, limit) => Some(limit),
                _ => None,
            };
            let suggestion = Suggestion { toml, chi2: [base.chi2(), node.chi2()], is_law, is_fitted: true, step_yr };
            let beside = base.added.iter().map(|added| self.name(added.hypothesis)).collect();
            let reason = Reason::BetterLaw { target: law.target(), expression: law.expression(), beside };
            Some(MeasurementLaw { suggestion, reason, cost, pedestals, residuals: node.residuals })
        });
        fitted.min_by(|a, b| a.cost.total_cmp(&b.cost))
    }

    /// chi2 with a law to first order, plus the cost of its parameters; and their values. None if the data or the free parameters do not
    /// determine all of them: a law with fewer does the same.
    fn promise<'a>(&self, base: &Node, law: &'a Law) -> Option<(f64, &'a Law, DVector<f64>)> {
        let columns = law.columns(self.case().data, &base.fit.values);
        let columns: Vec<DVector<f64>> =
            columns.iter().map(|column| base.beyond(&self.case().change_of_values(base, column))).collect();
        let columns = DMatrix::from_columns(&columns);
        let span = Span::of(&columns, INDEPENDENT);
        if span.directions().ncols() < law.powers.len() {
            return None;
        }
        let found = span.solve(&base.residuals);
        let gain = span.directions().tr_mul(&base.residuals).norm_squared();
        Some((base.chi2() - gain + 2.0 * law.parameters() as f64, law, found))
    }

    /// A model with a law, fitted from some values of its parameters; and the law as it would be written in a mission.
    fn with_law(&self, base: &Node, law: &Law, start: &DVector<f64>) -> Option<(Node, String)> {
        let mut table = toml::Table::new();
        table.insert("target".into(), law.target().into());
        table.insert("expression".into(), law.expression().into());
        for (name, value) in formula::NAMES.iter().zip(start.iter()) {
            table.insert((*name).into(), (*value).into());
        }
        let (mission, key) = mission_file::add_effect(base.mission(), "formula", table).ok()?;
        let names = formula::NAMES.iter().take(law.powers.len());
        let own: Vec<String> = names.map(|name| format!("{key}.{name}")).collect();
        let free: Vec<String> = self.search.base.iter().chain(&own).cloned().collect();
        // Beside a law, the epochs of events may be others.
        let options = fit::Options { seed: self.options.seed, ..fit::Options::default() };
        let node = Node::fit(self.case(), &base.model.like(&mission), base.added.clone(), &free, &options).ok()?;
        let value =
            |key: &String| node.fit.parameters.iter().find(|fitted| fitted.key == *key).map(|fitted| fitted.value);
        let values = own.iter().map(value).collect::<Option<Vec<f64>>>()?;
        let toml = formula::table(&law.target(), &law.expression(), &values);
        Some((node, toml))
    }
}
