//! Residual shear biases of a population after a correction, to first order in the trailing.
//!
//! With deviations zᵢ of the assumed parameters, whose errors are σᵢ and whose correlations are C, the residual of a bias b is
//!
//! ```text
//! left = Σ dᵢ zᵢ        rms left = √(dᵀ C d)        dᵢ = σᵢ ∂b/∂pᵢ
//! ```
//!
//! Errors are those of the finite sample of galaxies: b and its derivatives are means over the same galaxies, whose first-order
//! jackknife values are propagated. Noise and the residuals of iterations are not included.

use serde::Serialize;

use super::Knowledge;
use crate::error::InputError;
use crate::model::Model;
use crate::plan::judgement::Limited;
use crate::study::slopes::{Limitable, Parameter, Quantity, at_end, slopes};
use crate::study::tolerance::{ALL_DENSITIES, ALL_RELEASES, Known, Sensitivity, known, limit, trap_parameters};

/// Residual shear biases of a population.
#[derive(Clone, Debug)]
pub struct PopulationRemainder {
    /// c1, c2, m1 and m2.
    pub biases: Vec<BiasLeft>,
    /// Required knowledge of the parameters for limits on c and m; empty if there are none.
    pub tolerances: Vec<Tolerance>,
}

/// The residual of a bias.
#[derive(Clone, Debug, Serialize)]
pub struct BiasLeft {
    /// c1, c2, m1 or m2.
    pub bias: String,
    /// The limited quantity of which it is a component.
    #[serde(skip)]
    pub limited: Limited,
    /// Without correction.
    pub uncorrected: f64,
    /// Its standard error from the finite sample of galaxies; None for one galaxy, here and below.
    pub uncorrected_error: Option<f64>,
    /// Root mean square residual over errors of the assumed parameters.
    pub left: f64,
    /// Its standard error.
    pub left_error: Option<f64>,
    /// The same in % of |uncorrected|; None if that is 0.
    pub left_percent: Option<f64>,
    /// Its standard error, %.
    pub left_error_percent: Option<f64>,
    /// |uncorrected| over the residual: the factor of the correction; None if there is no residual.
    pub factor: Option<f64>,
    /// Its standard error.
    pub factor_error: Option<f64>,
    /// The residual, in % of the limit; None if there is no limit.
    pub used_percent: Option<f64>,
}

/// Required knowledge of a parameter, all others known exactly.
#[derive(Clone, Debug, Serialize)]
pub struct Tolerance {
    /// The parameter.
    pub parameter: String,
    /// Its assumed error (1 σ) in the correction, %; for several the root mean square; None if it is assumed exact.
    pub error_percent: Option<f64>,
    /// Largest error with which the limit on c is met at the end of the mission, %; None if there is no limit, or it has no effect.
    pub needed_c_percent: Option<f64>,
    /// The same for the limit on m.
    pub needed_m_percent: Option<f64>,
}

/// Shear biases of a population.
const BIASES: [Limited; 2] = [Limited::C, Limited::M];

impl PopulationRemainder {
    /// For a model's population, after a correction with this knowledge of the detector. None if the mission has no population.
    ///
    /// # Errors
    /// If a formula has no value, no galaxy of the population can be measured, or a parameter cannot be changed by its error.
    pub fn of(
        model: &Model,
        knowledge: &Knowledge,
        advance: &(dyn Fn() + Sync),
    ) -> Result<Option<PopulationRemainder>, InputError> {
        let mission = &model.mission;
        if mission.population.is_none() {
            return Ok(None);
        }
        let traps = trap_parameters(mission);
        let others = knowledge.parameters.iter().filter(|(key, _)| traps.iter().all(|(known, _)| known != key));
        let parameters: Vec<Parameter> = traps.iter().chain(others).cloned().collect();
        let uncorrected = at_end(model, &BIASES)?;
        let found = slopes(model, &parameters, &BIASES, advance)?;
        let deviations = Deviations::of(knowledge, &parameters);
        let mut biases = Vec::new();
        for (uncorrected, slopes) in uncorrected.iter().zip(&found) {
            for member in [0, 1] {
                let slopes: Vec<&Quantity> = slopes.iter().map(|members| &members[member]).collect();
                biases.push(BiasLeft::of(
                    uncorrected,
                    member,
                    &deviations.left(&slopes),
                    limit(mission, uncorrected.limited),
                ));
            }
        }
        let sensitivity = |place: usize| {
            let limited = BIASES[place];
            limit(mission, limited).map(|limit| Sensitivity::of(limited, limit, &found[place][..traps.len()]))
        };
        let needed = [0, 1].map(|place| sensitivity(place).map(|one| known(mission, &[one])));
        Ok(Some(PopulationRemainder { biases, tolerances: tolerances(&traps, knowledge, needed) }))
    }

    /// The largest residual component of a bias.
    pub fn largest(&self, limited: Limited) -> Option<&BiasLeft> {
        let of = self.biases.iter().filter(|one| one.limited == limited);
        of.max_by(|a, b| a.uncorrected.abs().total_cmp(&b.uncorrected.abs()))
    }
}

/// Parameters among those whose slopes are known, with errors in units of the slopes' deviations, and correlations.
struct Deviations<'a> {
    /// Index and error of each.
    of: Vec<(usize, f64)>,
    correlation: Option<&'a Vec<Vec<f64>>>,
}

impl Deviations<'_> {
    fn of<'a>(knowledge: &'a Knowledge, parameters: &[Parameter]) -> Deviations<'a> {
        let place = |(key, sigma): &Parameter| {
            let place = parameters.iter().position(|(known, _)| known == key).expect("a parameter that was changed");
            (place, if parameters[place].1 == 0.0 { 0.0 } else { sigma / parameters[place].1 })
        };
        Deviations { of: knowledge.parameters.iter().map(place).collect(), correlation: knowledge.correlation.as_ref() }
    }

    /// Root mean square residual, √(dᵀ C d); the weight of each slope is (C d)ᵢ σᵢ over it.
    fn left(&self, slopes: &[&Quantity]) -> Quantity {
        let d: Vec<f64> = self.of.iter().map(|(place, error)| error * slopes[*place].value).collect();
        let correlated = |row: usize| match self.correlation {
            None => d[row],
            Some(rows) => rows[row].iter().zip(&d).map(|(correlation, d)| correlation * d).sum(),
        };
        let correlated: Vec<f64> = (0..d.len()).map(correlated).collect();
        let rms = d.iter().zip(&correlated).map(|(d, correlated)| d * correlated).sum::<f64>().max(0.0).sqrt();
        if rms == 0.0 {
            return Quantity::default();
        }
        let terms = self.of.iter().zip(&correlated);
        Quantity::sum(terms.map(|((place, error), correlated)| (correlated * error / rms, slopes[*place])))
    }
}

impl BiasLeft {
    fn of(uncorrected: &Limitable, member: usize, left: &Quantity, limit: Option<f64>) -> BiasLeft {
        let before = &uncorrected.members[member];
        let percent = (before.value != 0.0).then(|| ratio(left, before, 100.0));
        let factor = (left.value > 0.0).then(|| ratio(before, left, 1.0));
        BiasLeft {
            bias: format!("{}{}", uncorrected.limited.key(), member + 1),
            limited: uncorrected.limited,
            uncorrected: before.value,
            uncorrected_error: before.error(),
            left: left.value,
            left_error: left.error(),
            left_percent: percent.map(|percent| percent.0),
            left_error_percent: percent.and_then(|percent| percent.1),
            factor: factor.map(|factor| factor.0),
            factor_error: factor.and_then(|factor| factor.1),
            used_percent: limit.map(|limit| 100.0 * left.value / limit),
        }
    }
}

/// |a/b| times a scale, and its standard error, with errors of a and b from the same galaxies.
fn ratio(a: &Quantity, b: &Quantity, scale: f64) -> (f64, Option<f64>) {
    let value = scale * (a.value / b.value);
    // d(a/b) = da/b − a db/b²
    let influence = Quantity::sum([(scale / b.value, a), (-value / b.value, b)].into_iter());
    (value.abs(), influence.error())
}

/// Knowledge required by the limits, beside that assumed.
fn tolerances(traps: &[Parameter], knowledge: &Knowledge, needed: [Option<Vec<Known>>; 2]) -> Vec<Tolerance> {
    let Some(names) = needed.iter().flatten().next() else { return Vec::new() };
    let (densities, releases) = traps.split_at(traps.len() / 2);
    let error = |(key, value): &Parameter| {
        let known = knowledge.parameters.iter().find(|(known, _)| known == key);
        known.map_or(0.0, |(_, sigma)| 100.0 * sigma / value)
    };
    let rms = |of: &[Parameter]| (of.iter().map(|one| error(one).powi(2)).sum::<f64>() / of.len() as f64).sqrt();
    let mut errors: Vec<f64> = densities.iter().map(error).chain([rms(densities)]).collect();
    errors.extend(releases.iter().map(error).chain([rms(releases)]));
    let percent = |place: usize, row: usize| needed[place].as_ref().and_then(|known| known[row].needed_percent);
    let row = |(row, known): (usize, &Known)| Tolerance {
        parameter: known.parameter.clone(),
        error_percent: Some(errors[row]).filter(|error| error.is_finite() && *error > 0.0),
        needed_c_percent: percent(0, row),
        needed_m_percent: percent(1, row),
    };
    names.iter().enumerate().map(row).collect()
}

impl PopulationRemainder {
    /// The rows for all densities and for all release times.
    pub fn all(&self) -> impl Iterator<Item = &Tolerance> {
        self.tolerances.iter().filter(|one| [ALL_DENSITIES, ALL_RELEASES].contains(&one.parameter.as_str()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Errors of one sign add linearly, errors of opposite signs cancel, and independent ones add in quadrature.
    #[test]
    fn what_is_left_follows_the_correlations() {
        let slope = |value: f64| Quantity::exact(value);
        let (one, two) = (slope(3.0), slope(4.0));
        let parameters: Vec<Parameter> = vec![("a".into(), 1.0), ("b".into(), 2.0)];
        let left = |correlation: Option<f64>| {
            let correlation = correlation.map(|off| vec![vec![1.0, off], vec![off, 1.0]]);
            // b is known to half of the deviation of its slope.
            let knowledge = Knowledge { parameters: vec![("b".into(), 1.0), ("a".into(), 1.0)], correlation };
            Deviations::of(&knowledge, &parameters).left(&[&one, &two]).value
        };
        assert!((left(None) - 3.0_f64.hypot(2.0)).abs() < 1e-12);
        assert!((left(Some(1.0)) - 5.0).abs() < 1e-12 && (left(Some(-1.0)) - 1.0).abs() < 1e-12);
    }
}
