//! The part of a diagnosis that `ctiplan diagnose` prints as JSON, in that form.

use serde::ser::{Serialize, SerializeMap, Serializer};

use super::holdout::Carried;
use super::result::{Next, Rung, Step};
use crate::analysis::fit::Fitted;
use crate::physics::observable::Observable;

#[derive(serde::Serialize)]
struct OneRung<'a> {
    chi2: f64,
    n: usize,
    free: usize,
    rms_sigma: f64,
    holdout_rms_sigma: Option<f64>,
    holdout: &'a [Carried],
    budget_exceeded_t_yr: Exceeded,
}

#[derive(serde::Serialize)]
struct Exceeded {
    uncorrected: Option<f64>,
    corrected: Option<f64>,
}

#[derive(serde::Serialize)]
struct OneStep<'a> {
    #[serde(flatten)]
    rung: &'a Rung,
    effect: &'a str,
    parameters: Parameters<'a>,
    false_alarm: f64,
}

/// The fitted parameters of one effect by their names in its table.
struct Parameters<'a>(&'a Step);

#[derive(serde::Serialize)]
struct Value {
    value: f64,
    sigma: Option<f64>,
    unit: &'static str,
}

#[derive(serde::Serialize)]
struct OneMeasurement<'a> {
    observable: Observable,
    conditions: Conditions<'a>,
    separates: &'a [String; 2],
    apart_sigma: f64,
    sigma: f64,
}

/// Conditions of a measurement by their names, the galaxy among them.
struct Conditions<'a>(&'a Next);

impl Serialize for Rung {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        let budget = self.budget.as_ref();
        let rung = OneRung {
            chi2: self.chi2,
            n: self.n,
            free: self.free,
            rms_sigma: self.rms_sigma(),
            holdout_rms_sigma: self.holdout_rms_sigma,
            holdout: &self.carried,
            budget_exceeded_t_yr: Exceeded {
                uncorrected: budget.and_then(|budget| budget.uncorrected.t_yr),
                corrected: budget.and_then(|budget| budget.corrected.t_yr),
            },
        };
        rung.serialize(to)
    }
}

impl Serialize for Step {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        let step = OneStep {
            rung: &self.rung,
            effect: &self.effect,
            parameters: Parameters(self),
            false_alarm: self.false_alarm,
        };
        step.serialize(to)
    }
}

impl Serialize for Parameters<'_> {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        let table = format!("{}.", self.0.key);
        let named = |fitted: &'_ Fitted| {
            let name = fitted.key.strip_prefix(&table).unwrap_or(&fitted.key).to_string();
            (name, Value { value: fitted.value, sigma: fitted.sigma, unit: fitted.unit })
        };
        to.collect_map(self.0.parameters.iter().map(named))
    }
}

impl Serialize for Next {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        let measurement = OneMeasurement {
            observable: self.observable,
            conditions: Conditions(self),
            separates: &self.separates,
            apart_sigma: self.apart_sigma,
            sigma: self.sigma,
        };
        measurement.serialize(to)
    }
}

impl Serialize for Conditions<'_> {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        let mut map = to.serialize_map(None)?;
        for (name, value) in &self.0.conditions {
            map.serialize_entry(name, value)?;
        }
        if let Some(galaxy) = &self.0.galaxy {
            map.serialize_entry("galaxy", galaxy)?;
        }
        map.end()
    }
}
