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
use super::formula::{Argument, Formula, NAMES, laws};
use super::noise::wrong_rows;
use super::result::{Reason, Suggestion, Verdict};
use super::{rivals, trimmed};
use crate::analysis::fit;
use crate::error::InputError;
use crate::mission_file;
use crate::numeric::least_squares::Span;
use crate::numeric::parallel;

/// Laws that are fitted.
const FITTED: usize = 3;

/// Share of what a parameter of a law changes that no other one does, below which a law without it does the same.
const INDEPENDENT: f64 = 0.01;

/// A law that multiplies every value by more takes the place of the model, whose own traps then hardly count.
const IN_PLACE: f64 = 10.0;

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
        let mut promised: Vec<(f64, &Formula, DVector<f64>)> = promised.into_iter().flatten().collect();
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
    fn promise<'a>(&self, base: &Node, law: &'a Formula) -> Option<(f64, &'a Formula, DVector<f64>)> {
        let columns = law.columns(self.case().data.iter(), &base.fit.values);
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
    fn with_law(&self, base: &Node, law: &Formula, start: &DVector<f64>) -> Option<(Node, String)> {
        let mut table = toml::Table::new();
        table.insert("target".into(), law.target().into());
        table.insert("expression".into(), law.expression().into());
        for (name, value) in NAMES.iter().zip(start.iter()) {
            table.insert((*name).into(), (*value).into());
        }
        let (mission, key) = mission_file::add_effect(base.mission(), "formula", table).ok()?;
        let names = NAMES.iter().take(law.powers.len());
        let own: Vec<String> = names.map(|name| format!("{key}.{name}")).collect();
        let free: Vec<String> = self.search.base.iter().chain(&own).cloned().collect();
        // Beside a law, the epochs of events may be others.
        let options = fit::Options { seed: self.options.seed, ..fit::Options::default() };
        let node = Node::fit(self.case(), &base.model.like(&mission), base.added.clone(), &free, &options).ok()?;
        let value =
            |key: &String| node.fit.parameters.iter().find(|fitted| fitted.key == *key).map(|fitted| fitted.value);
        let values = own.iter().map(value).collect::<Option<Vec<f64>>>()?;
        let factors = law.factors(self.case().data.iter(), &base.fit.values, &values);
        if !factors.is_empty() && factors.iter().all(|factor| factor.abs() > IN_PLACE) {
            return None;
        }
        let toml = law.toml(&values);
        Some((node, toml))
    }
}
