//! Derivatives of the limited quantities with respect to parameters of the detector, at the end of the mission.
//!
//! ```text
//! ∂q/∂ln p = [q(p eˢ) − q(p e⁻ˢ)]/2s        s = 0.05        q: Δe of the judged galaxy, shear biases c and m of the population
//! ```
//!
//! To first order in the trailing, a correction with assumed parameters leaves the difference between the effects of the true and
//! the assumed ones: Σ ∂q/∂ln pᵢ (Δpᵢ/pᵢ).

use crate::error::InputError;
use crate::model::Model;
use crate::numeric::parallel;
use crate::plan::judgement::Limited;
use crate::plan::population::{EndBias, Estimated, Influence, PopulationBias};

/// Relative step of a parameter in a central difference: second-order terms cancel.
const STEP: f64 = 0.05;

/// A quantity, and the contribution of each draw of galaxies to its error, to first order: empty if it is not a mean over galaxies.
#[derive(Clone, Debug, Default)]
pub(super) struct Quantity {
    pub value: f64,
    influence: Influence,
}

impl Quantity {
    /// A quantity that is not a mean over galaxies.
    pub fn exact(value: f64) -> Quantity {
        Quantity { value, influence: Influence::default() }
    }

    /// Σ wᵢ qᵢ.
    pub fn sum<'a>(terms: impl Iterator<Item = (f64, &'a Quantity)>) -> Quantity {
        let mut sum = Quantity::default();
        for (weight, term) in terms {
            sum.value += weight * term.value;
            sum.influence.add(weight, &term.influence);
        }
        sum
    }

    /// Standard error from the finite sample of galaxies; None if it is not a mean over several.
    pub fn error(&self) -> Option<f64> {
        self.influence.error()
    }
}

/// A quantity that a requirement may limit, components 1 and 2.
#[derive(Clone, Debug)]
pub(super) struct Limitable {
    pub limited: Limited,
    pub members: [Quantity; 2],
}

/// Components 1 and 2 of a bias, and the contributions of each draw of galaxies to their errors.
type Members<'a> = (&'a [Estimated; 2], &'a [Influence; 2]);

/// A parameter of the detector: its key in the mission, and a deviation in the key's unit.
pub(super) type Parameter = (String, f64);

/// Quantities that a requirement may limit at the end of the mission, of the requested kinds.
pub(super) fn at_end(model: &Model, asked: &[Limited]) -> Result<Vec<Limitable>, InputError> {
    let mission = &model.mission;
    let biases = match asked.iter().any(|one| *one != Limited::DeltaE) {
        true => PopulationBias::of(model, mission.accuracy.seed)?.map(|biases| biases.at_end),
        false => None,
    };
    let of_bias = |of: fn(&EndBias) -> Members<'_>| {
        let (values, influences) = of(biases.as_ref().expect("a population"));
        [0, 1].map(|member| Quantity { value: values[member].value, influence: influences[member].clone() })
    };
    let quantity = |limited: &Limited| {
        let members = match limited {
            Limited::DeltaE => {
                let lost =
                    || InputError::new("cannot study a correction", "no shape is left at the end of the mission");
                let change = model.change(model.judged(), mission.mission.duration_yr)?.ok_or_else(lost)?;
                [change.delta_e1, change.delta_e2].map(Quantity::exact)
            }
            Limited::C => of_bias(|end| (&end.bias.c, &end.influence_c)),
            Limited::M => of_bias(|end| (&end.bias.m, &end.influence_m)),
        };
        Ok(Limitable { limited: *limited, members })
    };
    asked.iter().map(quantity).collect()
}

/// Changes by a deviation of each parameter, to first order: for each requested kind, in the order of the parameters.
pub(super) fn slopes(
    model: &Model,
    parameters: &[Parameter],
    asked: &[Limited],
    advance: &(dyn Fn() + Sync),
) -> Result<Vec<Vec<[Quantity; 2]>>, InputError> {
    let of = |(key, deviation): &Parameter| {
        let value = model.mission.number(key).unwrap_or(0.0);
        let at = |value: f64| at_end(&model.like(&model.mission.with(&[(key.clone(), value.into())])?), asked);
        // Values of 0 or less have no logarithm.
        let (high, low, over) = match value > 0.0 {
            true => (at(value * STEP.exp())?, at(value * (-STEP).exp())?, deviation / value / (2.0 * STEP)),
            false => (at(value + deviation)?, at(value)?, 1.0),
        };
        advance();
        let difference = |(high, low): (&Limitable, &Limitable)| {
            [0, 1]
                .map(|member| Quantity::sum([(over, &high.members[member]), (-over, &low.members[member])].into_iter()))
        };
        Ok(high.iter().zip(&low).map(difference).collect::<Vec<_>>())
    };
    let of_parameters = parallel::try_map(parameters, of)?;
    Ok((0..asked.len()).map(|place| of_parameters.iter().map(|all| all[place].clone()).collect()).collect())
}
