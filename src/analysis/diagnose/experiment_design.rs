//! The measurement that best distinguishes two models.
//!
//! Both were fitted to the same data. A measurement is worth most where their predictions differ most, in units of its own error
//! and of the uncertainty left by the fits (T-optimality: Atkinson & Fedorov 1975, Biometrika 62, 57).

use nalgebra::DVector;

use super::evidence::Rival;
use super::fitted_model::{Case, FLAT, Node};
use super::hypothesis::Hypothesis;
use super::result::Next;
use crate::error::InputError;
use crate::model::predict::{Question, predict};
use crate::numeric::least_squares::Span;
use crate::numeric::parallel;
use crate::physics::conditions::{Conditions, UnderMission};
use crate::physics::observable::Observable;

/// Possible measurements whose prediction uncertainty is computed together.
const TOGETHER: usize = 24;

/// The best measurement to distinguish a model from a rival; None if no possible measurement would.
pub(super) fn best(
    case: &Case,
    hypotheses: &[Hypothesis],
    node: &Node,
    rival: &Node,
    rivals: &[Rival],
    can: &[Observable],
) -> Result<Option<Next>, InputError> {
    let observables: Vec<Observable> =
        Observable::ALL.into_iter().filter(|one| can.contains(one) || (can.is_empty() && !one.is_derived())).collect();
    let mut wanted: Vec<(Observable, Conditions, Option<usize>)> = Vec::new();
    for observable in observables {
        wanted.extend(possible(case, node, observable)?);
    }
    let questions: Vec<Question> = wanted
        .iter()
        .map(|(observable, at, galaxy)| Question { observable: *observable, at, galaxy: *galaxy, species: None })
        .collect();
    if questions.is_empty() {
        return Ok(None);
    }
    let (one, other) = (predict(&node.model, &questions)?, predict(&rival.model, &questions)?);
    let sigma = |index: usize| error(case, wanted[index].0, one[index]);
    let apart = |index: usize, open: f64| {
        let apart = (one[index] - other[index]).abs() / sigma(index).hypot(open.sqrt());
        if apart.is_finite() { apart } else { 0.0 }
    };
    // The uncertainty left by the fits takes many predictions, and only reduces the separation of two models. It is skipped if the
    // separation without it is below the best so far with it.
    let mut order: Vec<usize> = (0..wanted.len()).collect();
    order.sort_by(|a, b| apart(*b, 0.0).total_cmp(&apart(*a, 0.0)).then(a.cmp(b)));
    let mut best = (order[0], 0.0);
    for some in order.chunks(TOGETHER) {
        if apart(some[0], 0.0) <= best.1 {
            break;
        }
        let asked: Vec<Question> = some.iter().map(|&index| questions[index]).collect();
        let (open_one, open_other) = (left_open(node, &asked)?, left_open(rival, &asked)?);
        for ((&index, one), other) in some.iter().zip(open_one).zip(open_other) {
            let apart = apart(index, one + other);
            if apart > best.1 {
                best = (index, apart);
            }
        }
    }
    let (best, apart_sigma) = best;
    let sigma = sigma(best);
    let (observable, at, galaxy) = &wanted[best];
    // In a laboratory, a dose needs no date.
    let is_stated = |name: &&&str| **name != "t_yr" || at.dose_mev_g.is_none() || at.t_yr > 0.0;
    let names = observable.card().conditions.iter().filter(is_stated);
    let name = |place: usize| hypotheses[place].name.clone();
    Ok((apart_sigma > 0.5).then(|| Next {
        observable: *observable,
        conditions: names.filter_map(|name| Some((name.to_string(), at.get(name)?))).collect(),
        galaxy: galaxy.map(|place| node.mission().galaxies[place].name.clone()),
        separates: [name(rivals[0].instead_of), name(rivals[0].hypothesis)],
        apart_sigma,
        sigma,
    }))
}

/// Pixels behind a packet that are worth measuring.
const PIXELS: [u32; 6] = [1, 2, 4, 10, 30, 100];

/// Possible measurements: around the data's and the mission's own conditions, one condition changed at a time.
///
/// # Errors
/// If the mission was launched after the date of a row.
fn possible(
    case: &Case,
    node: &Node,
    observable: Observable,
) -> Result<Vec<(Observable, Conditions, Option<usize>)>, InputError> {
    let mission = node.mission();
    let like = case.questions.iter().find(|question| question.observable == observable).or(case.questions.first());
    let Some(like) = like else { return Ok(Vec::new()) };
    let mut here = like.at.under(mission)?.into_owned();
    here.t_yr = case.reach.last_yr().max(here.t_yr);
    here.signal_e = here.signal_e.or(Some(10.0 * here.background_e.max(100.0)));
    let a_block = observable.card().requires.contains(&"block_px");
    (here.first_px, here.last_px) = (None, None);
    here.block_px = a_block.then(|| here.block_px.unwrap_or(200).min(here.transfers));
    let in_lab = here.dose_mev_g.is_some() && observable.depends_on("dose_mev_g");
    let mut around = vec![here.clone()];
    let signal_e = here.signal_e.expect("set above");
    let deepest_e = 0.5 * mission.detector.full_well_e;
    for factor in [0.03, 0.1, 0.3, 3.0, 10.0] {
        around.push(Conditions { signal_e: Some((factor * signal_e).clamp(10.0, deepest_e)), ..here.clone() });
        around.push(Conditions { line_time_ms: factor * here.line_time_ms, ..here.clone() });
        let background_e = (factor * here.background_e).min(0.1 * deepest_e);
        around.push(Conditions { background_e, ..here.clone() });
    }
    for kelvin in [-20.0, -10.0, 10.0, 20.0] {
        around.push(Conditions { temperature_k: (here.temperature_k + kelvin).max(60.0), ..here.clone() });
    }
    for share in [0.05, 0.3, 0.6] {
        let transfers = ((share * f64::from(here.transfers.max(mission.readout.transfers))) as u32).max(10);
        let block_px = here.block_px.map(|block_px| block_px.min(transfers));
        around.push(Conditions { transfers, block_px, ..here.clone() });
    }
    // Not before the last of the data: nobody measures in the past.
    let left_yr = (mission.mission.duration_yr - here.t_yr).max(0.0);
    for share in [0.1, 0.25, 0.5, 0.75, 1.0] {
        if !in_lab {
            around.push(Conditions { t_yr: here.t_yr + share * left_yr, dose_mev_g: None, ..here.clone() });
        }
    }
    let galaxy = observable.is_shape().then(|| mission.judged());
    let mut all = Vec::new();
    for at in around {
        // Conditions that it does not depend on are not stated.
        let at = Conditions {
            dose_mev_g: at.dose_mev_g.filter(|_| observable.depends_on("dose_mev_g")),
            signal_e: at.signal_e.filter(|_| observable.depends_on("signal_e")),
            trail_px: None,
            ..at
        };
        if observable.depends_on("trail_px") {
            all.extend(PIXELS.map(|px| (observable, Conditions { trail_px: Some(px), ..at.clone() }, galaxy)));
        } else {
            all.push((observable, at, galaxy));
        }
    }
    Ok(all)
}

/// The error of a measurement of an observable: as in the data if they include it, or a hundredth of the value.
fn error(case: &Case, observable: Observable, value: f64) -> f64 {
    let mut sigmas: Vec<f64> = case
        .questions
        .iter()
        .zip(&case.sigmas)
        .filter(|(question, _)| question.observable == observable)
        .map(|(_, sigma)| *sigma)
        .collect();
    sigmas.sort_by(f64::total_cmp);
    let least = observable.card().least_sigma;
    sigmas.get(sigmas.len() / 2).copied().unwrap_or((0.01 * value.abs()).max(least))
}

/// The variance of predictions that a fit leaves.
fn left_open(node: &Node, questions: &[Question]) -> Result<Vec<f64>, InputError> {
    if node.fit.parameters.is_empty() {
        return Ok(vec![0.0; questions.len()]);
    }
    let here = predict(&node.model, questions)?;
    let keys = &node.fit.parameters;
    let derivatives: Vec<DVector<f64>> = parallel::try_map(keys, |fitted| {
        let step = 1e-2 * fitted.sigma.unwrap_or(0.0);
        let moved = node.mission().with(&[(fitted.key.clone(), (fitted.value + step).into())]);
        match moved {
            Ok(mission) if step > 0.0 => {
                let there = predict(&node.model.like(&mission), questions)?;
                Ok(DVector::from_iterator(here.len(), there.iter().zip(&here).map(|(a, b)| (a - b) / step)))
            }
            _ => Ok(DVector::zeros(here.len())),
        }
    })?;
    let covariance = Span::of(&node.fit.jacobian, FLAT).covariance();
    let open = (0..here.len()).map(|row| {
        let gradient = DVector::from_iterator(keys.len(), derivatives.iter().map(|derivative| derivative[row]));
        (gradient.transpose() * &covariance * &gradient)[(0, 0)].max(0.0)
    });
    Ok(open.collect())
}
