//! The user's own effect: an expression that changes a named quantity of the model.

use std::collections::BTreeMap;
use std::sync::OnceLock;

use ndarray::Array2;
use serde::Deserialize;

use super::{Card, Effect, Kind, Refusal};
use crate::error::{InputError, nearest, shortened};
use crate::mission::Mission;
use crate::mission::keys::{self, Kind::Number, Need::Optional, Need::Required, key};
use crate::numeric::expression::{Expression, ExpressionError};
use crate::physics::conditions::{self, Conditions};
use crate::physics::observable::Observable;
use crate::physics::{DoseHistory, Law, SpeciesState};
use crate::readout::Cloud;

/// `[effects.formula]`
#[derive(Debug, Deserialize)]
pub struct Formula {
    target: String,
    expression: String,
    #[serde(skip)]
    read: OnceLock<Expression>,
    #[serde(flatten)]
    parameters: BTreeMap<String, f64>,
}

/// Targets, each the name of the quantity in its expression too.
const TARGETS: [&str; 10] = [
    "background_e",
    "temperature_k",
    "dose_rate_mev_g_yr",
    "dose_mev_g",
    "density_per_px",
    "release_ms",
    "cloud_height",
    "charge_e",
    "read_e",
    "value",
];

impl Kind for Formula {
    const CARD: Card = Card {
        kind: "formula",
        adds: "the user's own: an expression that changes a named quantity of the model, without compiling",
        physics: "`target` names the quantity: background_e and temperature_k (the row's, as they really were), dose_rate_mev_g_yr, dose_mev_g (as a dose monitor sees it), density_per_px and \
                  release_ms (of all species, or density_per_px.NAME of one), cloud_height (0 to 1), charge_e (of every \
                  pixel before transfer), read_e (of every pixel as read), value (of all observables, or value.trail of \
                  one). `expression` is what becomes of it, in terms of the quantity itself (by the target's name), of \
                  the row's conditions (t_yr, dose_mev_g, temperature_k, line_time_ms, background_e, transfers, signal_e, \
                  trail_px, block_px, and any other numeric column of the data) and of parameters, which are all other \
                  keys of the table. + - * / ^, comparisons, `if a { b } else { c }`, sqrt, exp, ln, log10, sin, cos, tan, \
                  asin, acos, atan, sinh, cosh, tanh, abs, floor, ceiling, round, min, max, hypot, and PI are known.",
        source: "the user's",
        holds: "Names carry units, and there are no others: a condition in another unit has no name. Doses depend on t_yr \
                alone. cloud_height knows charge_e as well, and is tabulated.",
        residuals: "What remains when no other effect explains the data, in terms of the conditions it leans on.",
        keys: &[
            key("target", "quantity that changes", "", keys::Kind::Text, Required),
            key("expression", "expression that gives its new value", "", keys::Kind::Text, Required),
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
        let expression = match Expression::parse(&self.expression) {
            Ok(expression) => expression,
            Err(ExpressionError { place, problem, help, .. }) => {
                let place = place.map_or(String::new(), |place| format!("at letter {}: ", place + 1));
                return refusal("expression", format!("{place}{problem}"), help);
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
            return refusal("expression", problem, Some("say it in terms of t_yr".into()));
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
    /// Target and the member of it, as in `density_per_px.VV`.
    fn parts(&self) -> (&str, Option<&str>) {
        self.target.split_once('.').map_or((&self.target, None), |(target, member)| (target, Some(member)))
    }

    fn expression(&self) -> &Expression {
        self.read.get_or_init(|| Expression::parse(&self.expression).expect("checked when the mission was read"))
    }

    /// What becomes of a quantity. A quantity that is not known stays unknown.
    fn becomes(&self, quantity: f64, at: &Conditions, also: Option<(&str, f64)>) -> Result<f64, InputError> {
        if quantity.is_nan() {
            return Ok(quantity);
        }
        let (target, _) = self.parts();
        let value = self.expression().value(|name| {
            let also = also.filter(|(known, _)| *known == name).map(|(_, value)| value);
            let parameter = || self.parameters.get(name).copied();
            if name == target { Some(quantity) } else { parameter().or(also).or_else(|| at.get(name)) }
        });
        value.map_err(refusal)
    }

    /// The same for the charge of every pixel (e-).
    fn each(&self, charges_e: &mut Array2<f64>, at: &Conditions) -> Result<(), InputError> {
        charges_e.iter_mut().try_for_each(|charge_e| {
            *charge_e = self.becomes(*charge_e, at, None)?;
            Ok(())
        })
    }

    /// The same expression as a law over time.
    fn law(&self) -> Law {
        let (target, _) = self.parts();
        let (target, expression, parameters) = (target.to_string(), self.expression().clone(), self.parameters.clone());
        Law::new(move |t_yr, quantity| {
            let known = |name: &str| match name {
                "t_yr" => Some(t_yr),
                name if name == target => Some(quantity),
                name => parameters.get(name).copied(),
            };
            expression.value(known).map_err(refusal)
        })
    }
}

/// Why an expression has no value, with its place in the mission file.
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
            "background_e" => at.background_e = self.becomes(at.background_e, at, None)?.max(0.0),
            "temperature_k" => at.temperature_k = self.becomes(at.temperature_k, at, None)?.max(1.0),
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
                "density_per_px" => species.density_per_px = self.becomes(species.density_per_px, at, None)?.max(0.0),
                "release_ms" => {
                    let release_ms = self.becomes(species.release_ms, at, None)?;
                    // Traps that release within a millionth of a transfer, or never, are the limits.
                    species.release_ms = release_ms.max(1e-6 * at.line_time_ms);
                }
                _ => {}
            }
        }
        Ok(())
    }

    fn cloud(&self, cloud: &mut Cloud, at: &Conditions) -> Result<(), InputError> {
        if self.target == "cloud_height" {
            let before = cloud.clone();
            let height = |charge_e| self.becomes(before.height(charge_e), at, Some(("charge_e", charge_e)));
            *cloud = Cloud::tabulated(height)?;
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
            *value = self.becomes(*value, at, None)?;
        }
        Ok(())
    }

    fn depends_on(&self) -> Vec<String> {
        self.expression().variables().filter(|name| !self.parameters.contains_key(*name)).map(str::to_string).collect()
    }
}
