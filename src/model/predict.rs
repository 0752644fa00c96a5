//! Model and conditions → predicted measurement.
//!
//! Rows that share a readout (a packet and its trail, a block and its trail, all moments of a galaxy) are computed from one
//! readout. Packets and blocks that share a detector are read side by side (see `predict/columns.rs`), everything else in parallel.
//! Changes of shape of one galaxy at many doses are interpolated between a few (see `predict/shapes.rs`). The result does not
//! depend on the order of the rows or the number of threads, to the last bit.

mod columns;
mod shapes;
mod signal_read;

use std::borrow::Cow;
use std::collections::HashMap;

use crate::error::InputError;
use crate::model::{Device, Model};
use crate::numeric::parallel;
use crate::physics::conditions::{Conditions, UnderMission};
use crate::physics::observable::{Observable, Probe};
use crate::physics::shape::ShapeChange;

/// A quantity to be predicted: an observable under conditions, and its galaxy or species (by index in the mission) if it refers to
/// one.
#[derive(Debug)]
pub struct Question<'a, C = Conditions> {
    /// The quantity.
    pub observable: Observable,
    /// The assumed conditions; effects may modify them.
    pub at: &'a C,
    /// The galaxy of a change of shape; None for the one that the mission judges.
    pub galaxy: Option<usize>,
    /// The species of a trap density (None: all together), or of a dipole.
    pub species: Option<usize>,
}

impl<C> Clone for Question<'_, C> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<C> Copy for Question<'_, C> {}

/// Predicted values, in the observables' units and in the order of the questions. NaN for a galaxy whose shape is lost.
///
/// # Errors
/// If a formula has no value, or the mission was launched after the date of a row.
///
/// # Panics
/// If a question lacks a condition that its observable requires.
pub fn predict<C: UnderMission>(model: &Model, questions: &[Question<C>]) -> Result<Vec<f64>, InputError> {
    let under: Vec<Cow<Conditions>> =
        questions.iter().map(|question| question.at.under(&model.mission)).collect::<Result<_, _>>()?;
    let stated = questions.iter().zip(&under).map(|(question, at)| Question {
        observable: question.observable,
        at: at.as_ref(),
        galaxy: question.galaxy.or_else(|| question.observable.is_shape().then(|| model.judged())),
        species: question.species,
    });
    answers(model, &stated.collect::<Vec<_>>())
}

/// The values of questions in which nothing is left to the mission.
fn answers(model: &Model, questions: &[Question]) -> Result<Vec<f64>, InputError> {
    let depends_on = model.depends_on();
    let before_transfer = signal_read::before_transfer(model, questions, &depends_on)?;
    let questions: Vec<Question> = questions
        .iter()
        .zip(&before_transfer)
        .map(|(question, at)| at.as_ref().map_or(*question, |at| Question { at, ..*question }))
        .collect();
    let mut readings: Vec<Reading> = Vec::new();
    let mut known: HashMap<Vec<u64>, usize> = HashMap::new();
    let mut of_question = Vec::with_capacity(questions.len());
    for question in &questions {
        let index = *known.entry(identity(question, &depends_on)).or_insert_with(|| {
            readings.push(Reading::of(question));
            readings.len() - 1
        });
        let rows = question.at.trail_px.max(question.at.last_px).unwrap_or(0) as usize;
        readings[index].trail_px = readings[index].trail_px.max(rows);
        of_question.push(index);
    }
    let devices = devices(model, &readings)?;
    let charges = columns::read(&readings, &devices)?;
    let changes = shapes::changes(model, &readings, &devices)?;
    let read: Vec<Read> = readings
        .iter()
        .zip(&devices)
        .zip(charges.into_iter().zip(changes))
        .map(|((reading, device), (charges, change))| match reading.kind {
            Probed::Dose => Read::Dose(device.at.dose_mev_g.expect("a device knows the dose behind its traps")),
            Probed::Pumping => Read::Pumping(device.traps.iter().map(|species| species.release_ms).collect()),
            Probed::Traps => Read::Traps(device.traps.iter().map(|species| species.density_per_px).collect()),
            Probed::Packet | Probed::Block => Read::Charges(charges.expect("packets and blocks have been read")),
            Probed::Galaxy(_) => Read::Shape(change),
        })
        .collect();
    let answer = |(question, index): (&Question, &usize)| {
        let (device, read) = (&devices[*index], &read[*index]);
        let at = Conditions {
            trail_px: question.at.trail_px,
            first_px: question.at.first_px,
            last_px: question.at.last_px,
            phase_time_ms: question.at.phase_time_ms,
            pumping_cycles: question.at.pumping_cycles,
            covariates: question.at.covariates.clone(),
            ..device.at.clone()
        };
        device.observed(read.value(question), question.observable, &at)
    };
    questions.iter().zip(&of_question).map(answer).collect()
}

/// Changes of a galaxy's shape (by its index in the mission) under many conditions; None if the shape is lost.
///
/// # Errors
/// If a formula has no value.
pub fn changes(model: &Model, galaxy: usize, at: &[Conditions]) -> Result<Vec<Option<ShapeChange>>, InputError> {
    let readings: Vec<Reading> =
        at.iter().map(|at| Reading { kind: Probed::Galaxy(galaxy), at, trail_px: 0 }).collect();
    let devices = devices(model, &readings)?;
    let changes = shapes::changes(model, &readings, &devices)?;
    let observed = devices.iter().zip(changes);
    observed.map(|(device, change)| change.map(|change| device.observed_change(change)).transpose()).collect()
}

/// The detector of each reading. Readings at the same time and dose share their irradiation: an integral over all earlier times.
fn devices(model: &Model, readings: &[Reading]) -> Result<Vec<Device>, InputError> {
    let at = parallel::try_map(readings, |reading| model.true_conditions(reading.at))?;
    let mut ages: Vec<(f64, Option<f64>)> = Vec::new();
    let mut known: HashMap<(u64, Option<u64>), usize> = HashMap::new();
    let mut age_of = |at: &Conditions| {
        *known.entry((at.t_yr.to_bits(), at.dose_mev_g.map(f64::to_bits))).or_insert_with(|| {
            ages.push((at.t_yr, at.dose_mev_g));
            ages.len() - 1
        })
    };
    let age_of: Vec<usize> = at.iter().map(&mut age_of).collect();
    let irradiations = parallel::try_map(ages, |(t_yr, given_mev_g)| model.irradiation(t_yr, given_mev_g))?;
    parallel::try_map(at.into_iter().zip(age_of), |(at, age)| model.irradiated(at, &irradiations[age]))
}

/// The result of one readout.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Probed {
    Dose,
    Traps,
    Pumping,
    /// A lone packet.
    Packet,
    /// A flat block.
    Block,
    /// A galaxy, by its index in the mission.
    Galaxy(usize),
}

/// One readout, to be shared.
struct Reading<'a> {
    kind: Probed,
    at: &'a Conditions,
    /// Pixels behind the packet that are needed.
    trail_px: usize,
}

/// The values read out.
enum Read {
    Dose(f64),
    /// Traps per pixel of each species.
    Traps(Vec<f64>),
    /// Release time of each species, ms.
    Pumping(Vec<f64>),
    /// Charge less the trailed background, e-: of the packet or the block's last row, and of the pixels behind it.
    Charges(Vec<f64>),
    Shape(Option<ShapeChange>),
}

fn kind(question: &Question) -> Probed {
    match question.observable.card().probe {
        Probe::Dose => Probed::Dose,
        Probe::Traps => Probed::Traps,
        Probe::Pumping(_) => Probed::Pumping,
        Probe::PacketOrBlock { .. } if question.at.block_px.is_some() => Probed::Block,
        Probe::Packet(_) | Probe::PacketOrBlock { .. } => Probed::Packet,
        Probe::Block(_) => Probed::Block,
        Probe::Galaxy(_) => Probed::Galaxy(question.galaxy.expect("a change of shape is that of a galaxy")),
    }
}

/// Equal for questions that share a readout.
fn identity(question: &Question, depends_on: &[String]) -> Vec<u64> {
    let (kind, galaxy) = match kind(question) {
        Probed::Dose => (0, 0),
        Probed::Packet => (1, 0),
        Probed::Block => (2, 0),
        Probed::Galaxy(galaxy) => (3, galaxy as u64),
        Probed::Traps => (4, 0),
        Probed::Pumping => (5, 0),
    };
    // All members, so that a new condition cannot be forgotten here.
    let Conditions {
        t_yr,
        dose_mev_g,
        temperature_k,
        line_time_ms,
        background_e,
        transfers,
        signal_e,
        signal_read_e,
        preceding_e,
        preceding_px,
        block_px,
        // The same readout shows all pixels behind a packet, and its traps any pumping.
        trail_px: _,
        first_px: _,
        last_px: _,
        phase_time_ms: _,
        pumping_cycles: _,
        // Those on which an effect depends are listed below.
        covariates: _,
    } = *question.at;
    let bits = |value: Option<f64>| value.map_or(u64::MAX, f64::to_bits);
    let whole = |value: Option<u32>| value.map_or(u64::MAX, u64::from);
    let mut identity = vec![kind, galaxy, u64::from(transfers), whole(block_px), whole(preceding_px)];
    identity.extend([t_yr, temperature_k, line_time_ms, background_e].map(f64::to_bits));
    identity.extend([dose_mev_g, signal_e, signal_read_e, preceding_e].map(bits));
    identity.extend(depends_on.iter().map(|name| bits(question.at.get(name))));
    identity
}

impl<'a> Reading<'a> {
    fn of(question: &Question<'a>) -> Reading<'a> {
        Reading { kind: kind(question), at: question.at, trail_px: 0 }
    }
}

impl Read {
    fn value(&self, question: &Question) -> f64 {
        match (self, &question.observable.card().probe) {
            (Read::Dose(dose_mev_g), Probe::Dose) => *dose_mev_g,
            (Read::Traps(densities), Probe::Traps) => match question.species {
                Some(species) => densities[species],
                None => densities.iter().sum(),
            },
            (Read::Pumping(release_ms), Probe::Pumping(value)) => {
                value(release_ms[question.species.expect("a dipole is that of a species")], question.at)
            }
            (Read::Charges(charge_e), Probe::Packet(value) | Probe::Block(value)) => value(charge_e, question.at),
            (Read::Charges(charge_e), Probe::PacketOrBlock { packet, block }) => match question.at.block_px {
                None => packet(charge_e, question.at),
                Some(_) => block(charge_e, question.at),
            },
            (Read::Shape(change), Probe::Galaxy(member)) => change.map_or(f64::NAN, |mut change| *member(&mut change)),
            _ => unreachable!("a readout is that of its observable"),
        }
    }
}
