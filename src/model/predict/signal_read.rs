//! The charge of packets before transfer, if only the charge as read is known.
//!
//! The charge as read increases with the charge before transfer, so each packet needs one root finding. The root depends on the
//! traps, and is found anew for each model.

use std::collections::HashMap;

use super::{Probed, Question, Reading, columns, identity};
use crate::error::InputError;
use crate::model::Model;
use crate::numeric::parallel;
use crate::numeric::root_finding;
use crate::physics::conditions::Conditions;

/// Error of the charge before transfer over the charge as read.
const TOLERANCE: f64 = 1e-10;

/// Largest charge before transfer, e-, and the smallest one relative to the charge as read.
const LARGEST_E: f64 = 1e9;
const LEAST_SHARE: f64 = 1e-6;

/// For each question with `signal_read_e` alone, its conditions with the `signal_e` for which the model reads that charge; None for
/// all others.
///
/// # Errors
/// If the model reads that charge for no packet, or a formula has no value.
pub(super) fn before_transfer(
    model: &Model,
    questions: &[Question],
    depends_on: &[String],
) -> Result<Vec<Option<Conditions>>, InputError> {
    let mut distinct: Vec<&Question> = Vec::new();
    let mut known: HashMap<Vec<u64>, usize> = HashMap::new();
    let mut of_question = Vec::with_capacity(questions.len());
    for question in questions {
        let is_of_charge = matches!(super::kind(question), Probed::Packet | Probed::Block);
        let sought = is_of_charge && question.at.signal_e.is_none() && question.at.signal_read_e.is_some();
        of_question.push(sought.then(|| {
            *known.entry(identity(question, depends_on)).or_insert_with(|| {
                distinct.push(question);
                distinct.len() - 1
            })
        }));
    }
    let signal_e = parallel::try_map(&distinct, |question| charge_before_transfer(model, question))?;
    let solved = |(question, index): (&Question, &Option<usize>)| {
        index.map(|index| Conditions { signal_e: Some(signal_e[index]), ..question.at.clone() })
    };
    Ok(questions.iter().zip(&of_question).map(solved).collect())
}

/// Charge before transfer (e-) of one packet, or of each row of a block, for which the model reads `signal_read_e`.
fn charge_before_transfer(model: &Model, question: &Question) -> Result<f64, InputError> {
    let read_e = question.at.signal_read_e.expect("a packet whose charge is known as read");
    let excess_e = |signal_e: f64| -> Result<f64, InputError> {
        let at = Conditions { signal_e: Some(signal_e), ..question.at.clone() };
        let reading = Reading { kind: super::kind(question), at: &at, trail_px: 0 };
        let device = model.device(&at)?;
        let charges = columns::read(&[reading], &[device])?.remove(0).expect("a packet or a block");
        Ok(charges[0] - read_e)
    };
    // Usually little is lost: the first step goes twice as far as that.
    let start = (read_e, excess_e(read_e)?);
    let mut other = start;
    let mut step_e = 2.0 * start.1.abs();
    while other.1 * start.1 > 0.0 {
        let next_e = if start.1 < 0.0 { other.0 + step_e } else { (other.0 - step_e).max(0.1 * other.0) };
        if !(LEAST_SHARE * read_e..=LARGEST_E).contains(&next_e) {
            let problem = format!("the model reads {read_e} e- of no packet (signal_read_e)");
            let help = "is it the charge above the background? does an effect change what is read?";
            return Err(InputError::new("cannot find the charge before transfer", problem).with_help(help));
        }
        other = (next_e, excess_e(next_e)?);
        step_e *= 4.0;
    }
    root_finding::try_between([start, other], TOLERANCE * read_e, excess_e)
}
