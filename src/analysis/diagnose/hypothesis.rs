//! What might be missing: the catalogue, and the user's own formulas.

use nalgebra::{DMatrix, DVector};
use toml::{Table, Value};

use super::fitted_model::{Case, Node, orthonormal};
use crate::effect::{self, CATALOGUE, Reach};
use crate::error::InputError;
use crate::mission::Mission;
use crate::mission_file;
use crate::numeric::parallel;

/// An effect that may be missing.
#[derive(Clone, Debug)]
pub struct Hypothesis {
    /// Its name in reports: the kind, and for a user's own its number.
    pub name: String,
    /// Its kind in the catalogue.
    pub kind: &'static str,
    /// The user's table; None for the catalogue's own trials.
    own: Option<Table>,
}

/// Effects of which a mission may have several.
const SEVERAL: [&str; 4] = ["solar-flare", "bakeout", "extra-species", "formula"];

/// All hypotheses about a mission: every effect of the catalogue but formulas, and those of a user's file.
///
/// # Errors
/// If one of the user's makes no sense in the mission.
pub fn all(mission: &Mission, candidates: Option<&Table>) -> Result<Vec<Hypothesis>, InputError> {
    let kinds = CATALOGUE.iter().map(|entry| entry.card.kind).filter(|kind| *kind != "formula");
    let mut all: Vec<Hypothesis> = kinds.map(|kind| Hypothesis { name: kind.into(), kind, own: None }).collect();
    let refused = "cannot use the candidates";
    for (kind, tables) in candidates.into_iter().flatten() {
        let entry =
            effect::find(kind).ok_or_else(|| InputError::new(refused, format!("no effect is called `{kind}`")))?;
        let tables = match tables {
            Value::Table(table) => vec![table.clone()],
            Value::Array(tables) => tables.iter().filter_map(Value::as_table).cloned().collect(),
            _ => return Err(InputError::new(refused, format!("effects.{kind} is not a table"))),
        };
        let several = tables.len() > 1;
        for (index, table) in tables.into_iter().enumerate() {
            mission_file::add_effect(mission, kind, table.clone())
                .map_err(|error| InputError { refused: refused.into(), ..error })?;
            let name = if several { format!("{kind} {}", index + 1) } else { kind.clone() };
            all.retain(|known| known.name != name);
            all.push(Hypothesis { name, kind: entry.card.kind, own: Some(table) });
        }
    }
    Ok(all)
}

/// One form that an effect could take, at a fitted model.
pub(super) struct Trial {
    /// The effect's table.
    pub table: Table,
    /// Orthonormal directions in which it changes the predictions, beyond what the free parameters absorb.
    pub basis: DMatrix<f64>,
    /// Size of this change, sigma; of the sum if it has several strengths.
    pub moved_sigma: f64,
    /// Whether its strength is free, and not below zero.
    strength: Strength,
}

/// Largest factor on the strength in its table from which a fit starts.
pub(super) const FARTHEST: f64 = 30.0;

#[derive(Clone, Copy, PartialEq)]
enum Strength {
    /// It has nothing to adjust.
    Fixed,
    /// One, not below zero.
    Positive,
    /// Several, of any sign.
    Any,
}

impl Trial {
    /// Decrease of chi2 with it, to first order. `along` are the projections of the residuals (without the part that free
    /// parameters absorb) on its directions.
    pub fn gain_along(&self, along: &[f64]) -> f64 {
        self.fall_along(along).max(0.0)
    }

    /// The same, negative if it increases chi2.
    fn fall_along(&self, along: &[f64]) -> f64 {
        match self.strength {
            Strength::Fixed => 2.0 * along[0] * self.moved_sigma - self.moved_sigma.powi(2),
            Strength::Positive => along[0].max(0.0).powi(2),
            Strength::Any => along.iter().map(|along| along * along).sum(),
        }
    }

    /// Number of independent changes of the predictions by its strength alone.
    pub fn dimensions(&self) -> usize {
        self.basis.ncols()
    }
}

/// Share of an effect's signature below which the free parameters count as absorbing it.
const ABSORBED: f64 = 2e-3;

/// Share below which the remainder may be only the curvature of the free parameters. They are then moved to where they absorb the
/// signature to first order, and it is computed again.
const CURVED: f64 = 0.03;

impl Hypothesis {
    /// Whether it can be added to a mission: not if the mission allows for it already.
    pub fn is_new_to(&self, mission: &Mission) -> bool {
        SEVERAL.contains(&self.kind) || !mission.effects.contains_key(self.kind)
    }

    /// Whether it may be added twice.
    pub fn may_repeat(&self) -> bool {
        SEVERAL.contains(&self.kind) && self.own.is_none()
    }

    /// Whether it has a special case that is an effect of its own.
    pub(super) fn is_general(&self) -> bool {
        self.own.is_none() && effect::find(self.kind).is_some_and(|entry| !entry.generalises.is_empty())
    }

    /// Whether another is a special case of it.
    pub(super) fn generalises(&self, other: &Hypothesis) -> bool {
        self.own.is_none() && effect::find(self.kind).is_some_and(|entry| entry.generalises.contains(&other.kind))
    }

    /// Parameters of a table of this effect that are to be fitted, as dotted keys below that of the table.
    pub fn free(&self, key: &str, table: &Table, reach: &Reach) -> Vec<String> {
        let fitted = |number: &Number| number.value.is_float() && !self.is_held(number.name, reach);
        numbers(key, table).into_iter().filter(fitted).map(|number| number.key).collect()
    }

    /// Number of parameters of a table that are fitted.
    pub(super) fn parameters(&self, table: &Table, reach: &Reach) -> usize {
        self.free("", table, reach).len()
    }

    /// The parameters that are not fitted, and their assumed values.
    pub fn assumed(&self, key: &str, table: &Table, reach: &Reach) -> Vec<(String, f64)> {
        let held = |number: &Number| number.value.is_integer() || self.is_held(number.name, reach);
        let value = |number: Number| {
            let value = number.value.as_float().or(number.value.as_integer().map(|value| value as f64));
            value.map(|value| (number.key, value))
        };
        numbers(key, table).into_iter().filter(held).filter_map(value).collect()
    }

    fn is_held(&self, name: &str, reach: &Reach) -> bool {
        self.own.is_none() && effect::find(self.kind).is_some_and(|entry| (entry.held)(reach).contains(&name))
    }

    /// The forms it could take, as tables whose signatures add.
    pub(super) fn ways(&self, mission: &Mission, reach: &Reach) -> Vec<Vec<Table>> {
        let Some(own) = &self.own else {
            return effect::find(self.kind).map_or_else(Vec::new, |entry| (entry.trials)(mission, reach));
        };
        // Any of its parameters may be nonzero.
        let moved = |name: &String, factor: f64| {
            let mut table = own.clone();
            let value = own[name].as_float().unwrap_or(0.0);
            table.insert(name.clone(), (if value == 0.0 { 1e-3 * factor.signum() } else { factor * value }).into());
            table
        };
        let numbers = || own.iter().filter(|(_, value)| value.is_float()).map(|(name, _)| name);
        let mut ways: Vec<Vec<Table>> =
            numbers().flat_map(|name| [vec![moved(name, 2.0)], vec![moved(name, -2.0)]]).collect();
        ways.push(vec![own.clone()]);
        ways
    }

    /// Its table with the strength multiplied by `factor`, and the parameters that set the strength: those that are 0, or infinite,
    /// without the effect, or else its only parameter. None if it has no strength.
    pub fn scaled(&self, mission: &Mission, table: &Table, factor: f64) -> Option<(Table, Vec<String>)> {
        let nothing = (effect::find(self.kind)?.nothing)(mission);
        if self.own.is_some() {
            return None;
        }
        let (table, names) = scaled(table, &nothing, factor);
        (!names.is_empty()).then_some((table, names))
    }

    /// Its trials at a fitted model; none if the free parameters absorb it, or it changes nothing.
    pub(super) fn trials(&self, case: &Case, node: &Node) -> Vec<Trial> {
        let reach = case.reach.with_dose(|t_yr| node.model.dose_mev_g(t_yr).ok());
        let ways = self.ways(node.mission(), &reach);
        let signature = |mission: &Mission, table: &Table| -> Option<DVector<f64>> {
            let (mission, _) = mission_file::add_effect(mission, self.kind, table.clone()).ok()?;
            case.change(node, &node.model.like(&mission)).ok()
        };
        let trial = |tables: &Vec<Table>| -> Option<Trial> {
            let beyond = |table: &Table| -> Option<(f64, DVector<f64>)> {
                let all = signature(node.mission(), table)?;
                let beyond = node.beyond(&all);
                let curved = || node.absorbing(&all).and_then(|moved| signature(&moved, table));
                let again = if beyond.norm() < CURVED * all.norm() { curved() } else { None };
                let again = again.map(|again| node.beyond(&again)).filter(|again| again.norm() < beyond.norm());
                Some((all.norm(), again.unwrap_or(beyond)))
            };
            let all = tables.iter().map(beyond).collect::<Option<Vec<_>>>()?;
            let beyond: Vec<DVector<f64>> = all
                .into_iter()
                .filter(|(all, beyond)| beyond.norm() > (ABSORBED * all).max(1e-6))
                .map(|(_, beyond)| beyond)
                .collect();
            let first = beyond.first()?;
            let table = tables.iter().skip(1).fold(tables[0].clone(), |sum, table| larger(&sum, table));
            let strength = match (self.free("", &table, &case.reach).len(), tables.len()) {
                (0, _) => Strength::Fixed,
                (_, 1) => Strength::Positive,
                _ => Strength::Any,
            };
            let moved_sigma = beyond.iter().skip(1).fold(first.clone(), |sum, other| sum + other).norm();
            // A single signature is its own direction, with its sign.
            let basis = match &beyond[..] {
                [one] => DMatrix::from_columns(&[one / one.norm()]),
                several => orthonormal(&DMatrix::from_columns(several)),
            };
            Some(Trial { table, basis, moved_sigma, strength })
        };
        parallel::map(&ways, trial).into_iter().flatten().collect()
    }
}

/// A number of an effect's table.
struct Number<'a> {
    key: String,
    name: &'a str,
    value: &'a Value,
}

/// All numbers of a table, with dotted keys below that of the table; those of species by the species' names.
fn numbers<'a>(key: &str, table: &'a Table) -> Vec<Number<'a>> {
    let mut all = Vec::new();
    for (name, value) in table {
        match value {
            Value::Float(_) | Value::Integer(_) => all.push(Number { key: format!("{key}.{name}"), name, value }),
            Value::Array(members) => {
                for member in members.iter().filter_map(Value::as_table) {
                    let called = member.get("name").and_then(Value::as_str).unwrap_or_default();
                    all.extend(numbers(&format!("{key}.{name}.{called}"), member));
                }
            }
            _ => {}
        }
    }
    all
}

fn scaled(table: &Table, nothing: &Table, factor: f64) -> (Table, Vec<String>) {
    let (mut changed, mut names) = (table.clone(), Vec::new());
    let floats = table.values().filter(|value| value.is_float()).count();
    let alone = floats == 1 && !table.values().any(Value::is_array);
    for (name, value) in table {
        match (value, nothing.get(name)) {
            (Value::Float(value), Some(Value::Float(nothing))) if alone || *nothing == 0.0 || nothing.is_infinite() => {
                let new = if nothing.is_infinite() { value / factor } else { nothing + factor * (value - nothing) };
                changed.insert(name.clone(), new.into());
                names.push(name.clone());
            }
            (Value::Array(members), Some(Value::Array(nothings))) => {
                let each = members.iter().zip(nothings).filter_map(|(member, nothing)| {
                    let (member, inner) = scaled(member.as_table()?, nothing.as_table()?, factor);
                    names.extend(inner);
                    Some(Value::Table(member))
                });
                changed.insert(name.clone(), each.collect::<Vec<_>>().into());
            }
            _ => {}
        }
    }
    (changed, names)
}

/// For every key the larger of two numbers.
pub(super) fn larger(a: &Table, b: &Table) -> Table {
    let mut larger = a.clone();
    for (key, value) in b {
        let known = a.get(key).and_then(Value::as_float).unwrap_or(f64::NEG_INFINITY);
        if value.as_float().is_some_and(|value| value > known) {
            larger.insert(key.clone(), value.clone());
        }
    }
    larger
}
