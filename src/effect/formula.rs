//! The user's own effect: an expression that changes a named quantity of the model.

use std::collections::BTreeMap;

use ndarray::Array2;
use serde::Deserialize;

use super::{Card, Catalogued, Effect, Refusal};
use crate::error::{InputError, nearest, shortened};
use crate::mission::Mission;
use crate::mission::keys::{self, Allowed::Number, Need::Optional, Need::Required, key};
use crate::numeric::expression::{Expression, ExpressionError};
use crate::physics::conditions::{self, Conditions};
use crate::physics::observable::Observable;
use crate::physics::{DoseHistory, Law, SpeciesState};
use crate::readout::Cloud;

/// `[effects.formula]`
#[derive(Debug, Deserialize)]
#[serde(from = "Written")]
pub struct Formula {
    target: String,
    parameters: BTreeMap<String, f64>,
    /// An error in the expression is reported when the mission is checked.
    compiled: Result<Compiled, ExpressionError>,
}

/// The same, as written in a mission file.
#[derive(Deserialize)]
struct Written {
    target: String,
    expression: String,
    #[serde(flatten)]
    parameters: BTreeMap<String, f64>,
}

impl From<Written> for Formula {
    fn from(written: Written) -> Formula {
        let Written { target, expression, parameters } = written;
        let quantity = target.split('.').next().unwrap_or_default();
        let compiled =
            Expression::parse(&expression).map(|expression| Compiled::new(expression, quantity, &parameters));
        Formula { target, parameters, compiled }
    }
}

/// An expression with the sources of the values of its slots.
#[derive(Clone, Debug)]
struct Compiled {
    expression: Expression,
    /// Values of the constant slots: those of parameters.
    slots: Vec<f64>,
    /// The slot of the changed quantity.
    quantity: Option<usize>,
    /// The slot of `charge_e`, on which a charge cloud's height depends.
    charge_e: Option<usize>,
    /// All other slots: conditions with these names.
    conditions: Vec<(usize, String)>,
}

impl Compiled {
    fn new(expression: Expression, quantity: &str, parameters: &BTreeMap<String, f64>) -> Compiled {
        let mut slots = Vec::new();
        let mut conditions = Vec::new();
        for (slot, name) in expression.variables().enumerate() {
            let parameter = parameters.get(name).copied();
            slots.push(parameter.unwrap_or(f64::NAN));
            if parameter.is_none() && name != quantity && !(name == CHARGE && quantity == CLOUD) {
                conditions.push((slot, name.to_string()));
            }
        }
        let charge_e = expression.slot(CHARGE).filter(|_| quantity == CLOUD);
        Compiled { slots, quantity: expression.slot(quantity), charge_e, conditions, expression }
    }

    /// Values of all slots under given conditions, except those filled by [`Compiled::value`].
    fn slots(&self, known: impl Fn(&str) -> Option<f64>) -> Result<Vec<f64>, InputError> {
        let mut slots = self.slots.clone();
        for (slot, name) in &self.conditions {
            slots[*slot] = known(name).ok_or_else(|| refusal(self.expression.without_value(*slot)))?;
        }
        Ok(slots)
    }

    /// The new value of a quantity. An unknown quantity stays unknown.
    fn value(&self, slots: &mut [f64], quantity: f64) -> Result<f64, InputError> {
        if quantity.is_nan() {
            return Ok(quantity);
        }
        if let Some(slot) = self.quantity {
            slots[slot] = quantity;
        }
        self.expression.value(slots).map_err(refusal)
    }
}

/// The target that depends on the charge, and the name of the charge.
const CLOUD: &str = "cloud_height";
const CHARGE: &str = "charge_e";

/// Targets; each is also the name of the quantity in its expression.
const TARGETS: [&str; 10] = [
    "background_e",
    "temperature_k",
    "dose_rate_mev_g_yr",
    "dose_mev_g",
    "density_per_px",
    "release_ms",
    CLOUD,
    CHARGE,
    "read_e",
    "value",
];

impl Catalogued for Formula {
    const CARD: Card = Card {
        kind: "formula",
        adds: "a user's expression that changes a named quantity of the model, without compiling",
        physics: "`target` names the quantity: background_e and temperature_k (the true conditions of the row), \
                  dose_rate_mev_g_yr, dose_mev_g (as seen by a dose monitor), density_per_px and release_ms (of all species, \
                  or density_per_px.NAME of one), cloud_height (0 to 1), charge_e (of every pixel before transfer), read_e \
                  (of every pixel as read), value (of all observables, or value.trail of one). `expression` gives its new \
                  value as a function of the old value (by the target's name), of the row's conditions (t_yr, dose_mev_g, \
                  temperature_k, line_time_ms, background_e, transfers, signal_e, signal_read_e, preceding_e, \
                  preceding_px, trail_px, block_px, first_px, last_px, phase_time_ms, pumping_cycles, and any other numeric \
                  column of the data) and of parameters, which are all other keys of the table. Operators and functions are \
                  + - * / ^, comparisons, `if a { b } else { c }`, sqrt, exp, ln, log10, sin, cos, tan, asin, acos, atan, \
                  sinh, cosh, tanh, abs, floor, ceiling, round, min, max, hypot, and PI.",
        source: "the user",
        holds: "Names include units, and conditions in other units have no names. Doses depend on t_yr and parameters alone. \
                cloud_height may also depend on charge_e, and is tabulated.",
        residuals: "The residuals that remain if no other effect explains the data, as a function of the conditions with \
                    residual trends.",
        keys: &[
            key("target", "quantity that is changed", "", keys::Allowed::Text, Required),
            key("expression", "expression for its new value", "", keys::Allowed::Text, Required),
            key("*", "parameter", "", Number(f64::NEG_INFINITY, f64::INFINITY), Optional),
        ],
    };

    fn nothing(_: &Mission) -> toml::Table {
        words("value", "value")
    }

    fn example(_: &Mission) -> toml::Table {
        let mut table = words("value", "value * (1 + drift_per_yr * t_yr)");
        table.insert("drift_per_yr".into(), 0.01.into());
        table
    }

    fn check(&self, mission: &Mission) -> Result<(), Refusal> {
        let refusal = |key: &str, problem, help| Err(Refusal { key: key.into(), problem, help });
        let (target, member) = self.parts();
        if !TARGETS.contains(&target) {
            let help = nearest(target, TARGETS).map(|near| format!("did you mean \"{near}\"?"));
            let problem = format!("no quantity is called \"{target}\"; there are: {}", TARGETS.join(", "));
            return refusal("target", problem, help);
        }
        let extra = super::extra_species::names(mission);
        let members: Vec<&str> = match target {
            "density_per_px" | "release_ms" => {
                let species = mission.detector.traps.iter().map(|species| species.name.as_str());
                species.chain(extra.iter().map(String::as_str)).collect()
            }
            "value" => Observable::ALL.iter().map(|observable| observable.name()).collect(),
            _ => Vec::new(),
        };
        if let Some(member) = member.filter(|member| !members.contains(member)) {
            let help =
                nearest(member, members.iter().copied()).map(|near| format!("did you mean \"{target}.{near}\"?"));
            let problem = format!("{target} has no \"{member}\"; it has: {}", members.join(", "));
            return refusal("target", problem, help);
        }
        let reserved = conditions::NAMES.into_iter().chain(TARGETS).chain(["PI"]);
        if let Some(name) = reserved.into_iter().find(|name| self.parameters.contains_key(*name)) {
            let problem = format!("`{name}` is a condition or a quantity already: parameters need names of their own");
            return refusal(name, problem, None);
        }
        let expression = match &self.compiled {
            Ok(compiled) => &compiled.expression,
            Err(ExpressionError { place, problem, help, .. }) => {
                let place = place.map_or(String::new(), |place| format!("at letter {}: ", place + 1));
                return refusal("expression", format!("{place}{problem}"), help.clone());
            }
        };
        let knows_all = |name: &str| self.parameters.contains_key(name) || name == target || name == "t_yr";
        let doses = ["dose_rate_mev_g_yr", "dose_mev_g"].contains(&target);
        if let Some(other) = expression.variables().find(|name| doses && !knows_all(name)) {
            let problem = format!("`{other}` is not known here: a dose depends on t_yr and on parameters alone");
            return refusal("expression", problem, None);
        }
        let conditions = ["background_e", "temperature_k"].contains(&target);
        if conditions && expression.variables().any(|name| name == "dose_mev_g") {
            let problem = "`dose_mev_g` is not known here: conditions come before the dose".to_string();
            return refusal("expression", problem, Some("write it as a function of t_yr".into()));
        }
        let unused = self.parameters.keys().find(|name| !expression.variables().any(|used| used == *name));
        if let Some(name) = unused {
            let near = nearest(name, expression.variables()).map(|near| format!("did you mean `{near}`?"));
            return refusal(name, format!("the expression does not use `{name}`"), near);
        }
        Ok(())
    }
}

fn words(target: &str, expression: &str) -> toml::Table {
    toml::Table::from_iter([("target".into(), target.into()), ("expression".into(), expression.into())])
}

impl Formula {
    /// Target and its member, as in `density_per_px.VV`.
    fn parts(&self) -> (&str, Option<&str>) {
        self.target.split_once('.').map_or((&self.target, None), |(target, member)| (target, Some(member)))
    }

    fn compiled(&self) -> &Compiled {
        self.compiled.as_ref().expect("checked when the mission was read")
    }

    /// The new value of a quantity. An unknown quantity stays unknown.
    fn becomes(&self, quantity: f64, at: &Conditions) -> Result<f64, InputError> {
        if quantity.is_nan() {
            return Ok(quantity);
        }
        let compiled = self.compiled();
        compiled.value(&mut compiled.slots(|name| at.get(name))?, quantity)
    }

    /// The same for the charge of every pixel (e-).
    fn each(&self, charges_e: &mut Array2<f64>, at: &Conditions) -> Result<(), InputError> {
        let compiled = self.compiled();
        let mut slots = compiled.slots(|name| at.get(name))?;
        charges_e.iter_mut().try_for_each(|charge_e| {
            *charge_e = compiled.value(&mut slots, *charge_e)?;
            Ok(())
        })
    }

    /// The same expression as a law over time.
    fn law(&self) -> Law {
        let compiled = self.compiled().clone();
        Law::new(move |t_yr, quantity| {
            let mut slots = compiled.slots(|name| (name == "t_yr").then_some(t_yr))?;
            compiled.value(&mut slots, quantity)
        })
    }
}

/// The error of an expression, with its location in the mission file.
fn refusal(error: ExpressionError) -> InputError {
    InputError {
        refused: "cannot apply a formula".into(),
        place: Some(format!("effects.formula.expression = \"{}\"", shortened(&error.text))),
        problem: match error.place {
            Some(place) => format!("at letter {}: {}", place + 1, error.problem),
            None => error.problem,
        },
        help: error.help,
    }
}

impl Effect for Formula {
    fn conditions(&self, at: &mut Conditions) -> Result<(), InputError> {
        match self.target.as_str() {
            "background_e" => at.background_e = self.becomes(at.background_e, at)?.max(0.0),
            "temperature_k" => at.temperature_k = self.becomes(at.temperature_k, at)?.max(1.0),
            _ => {}
        }
        Ok(())
    }

    fn dose(&self, dose: &mut DoseHistory) {
        match self.target.as_str() {
            "dose_rate_mev_g_yr" => dose.rate_laws.push(self.law()),
            "dose_mev_g" => dose.dose_laws.push(self.law()),
            _ => {}
        }
    }

    fn traps(&self, traps: &mut [SpeciesState], at: &Conditions) -> Result<(), InputError> {
        let (target, member) = self.parts();
        for species in traps.iter_mut().filter(|species| member.is_none_or(|member| member == species.name)) {
            match target {
                "density_per_px" => species.density_per_px = self.becomes(species.density_per_px, at)?.max(0.0),
                "release_ms" => {
                    let release_ms = self.becomes(species.release_ms, at)?;
                    // Release within a millionth of a transfer, or never, are the limits.
                    species.release_ms = release_ms.max(1e-6 * at.line_time_ms);
                }
                _ => {}
            }
        }
        Ok(())
    }

    fn cloud(&self, cloud: &mut Cloud, at: &Conditions) -> Result<(), InputError> {
        if self.target == CLOUD {
            let compiled = self.compiled();
            let slots = compiled.slots(|name| at.get(name))?;
            let before = cloud.clone();
            *cloud = Cloud::tabulated(|charge_e| {
                let mut slots = slots.clone();
                if let Some(slot) = compiled.charge_e {
                    slots[slot] = charge_e;
                }
                compiled.value(&mut slots, before.height(charge_e))
            })?;
        }
        Ok(())
    }

    fn charge(&self, charge_e: &mut Array2<f64>, at: &Conditions) -> Result<(), InputError> {
        match self.target.as_str() {
            "charge_e" => self.each(charge_e, at),
            _ => Ok(()),
        }
    }

    fn read(&self, _: &Array2<f64>, read_e: &mut Array2<f64>, at: &Conditions) -> Result<(), InputError> {
        match self.target.as_str() {
            "read_e" => self.each(read_e, at),
            _ => Ok(()),
        }
    }

    fn value(&self, value: &mut f64, observable: Observable, at: &Conditions) -> Result<(), InputError> {
        let (target, member) = self.parts();
        if target == "value" && member.is_none_or(|member| member == observable.name()) {
            *value = self.becomes(*value, at)?;
        }
        Ok(())
    }

    fn depends_on(&self) -> Vec<String> {
        let names = self.compiled().expression.variables();
        names.filter(|name| !self.parameters.contains_key(*name)).map(str::to_string).collect()
    }
}
