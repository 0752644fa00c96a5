//! A catalogue of galaxies → the change of shape of each.
//!
//! Every galaxy is the mean over the sub-pixel positions of the mission, at its own position on the detector. If there are many,
//! the change is a smooth function of a galaxy's catalogue entries: some hundreds or thousands of galaxies are read out, a
//! polynomial is fitted to their changes, and the others are computed by it (see [`emulator`]). Its error is measured with galaxies
//! that are read out and were not fitted. A polynomial that is not accurate enough is not used: then, and wherever it would
//! extrapolate, galaxies are read out one by one.

pub mod emulator;
mod table;
mod training;

use std::collections::BTreeMap;

use serde::Serialize;

use crate::error::InputError;
use crate::model::shear::SurveyGalaxy;
use crate::model::{Device, Model};
use crate::numeric::parallel;
use crate::physics::shape::ShapeChange;
use emulator::{Emulator, HeldOut};

/// How a catalogue is computed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Allowed error of polynomials: root mean square over that of the changes, for the worst quantity. None: all galaxies are read
    /// out.
    pub emulate: Option<f64>,
    /// Seed for the choice of the galaxies that are fitted and of those that are held out.
    pub seed: u64,
}

/// A catalogue with the changes of shape of its galaxies.
#[derive(Clone, Debug, Serialize)]
pub struct Catalogue {
    /// Name of the mission.
    pub mission: String,
    /// Time, years since launch.
    pub t_yr: f64,
    /// Dose since launch, MeV/g.
    pub dose_mev_g: f64,
    /// Galaxies of the catalogue.
    pub galaxies: usize,
    /// Galaxies without a measurable shape, before or after the readout.
    pub lost: usize,
    /// Galaxies whose change was computed by a polynomial.
    pub emulated: usize,
    /// Classes of galaxies, by the width of the weight, for which polynomials were fitted.
    pub classes: Vec<Class>,
    /// Root mean square of |Δe| over the galaxies that have a shape.
    pub rms_delta_e: f64,
    /// The change of each galaxy, in the order of the catalogue; None if it has no measurable shape before or after the readout.
    #[serde(skip)]
    pub changes: Vec<Option<ShapeChange>>,
    /// Whether it was computed by a polynomial.
    #[serde(skip)]
    pub is_emulated: Vec<bool>,
}

/// Galaxies that are measured with the same weight.
#[derive(Clone, Debug, Serialize)]
pub struct Class {
    /// σ of the weight, px.
    pub weight_px: f64,
    /// Galaxies of the class.
    pub galaxies: usize,
    /// Galaxies that were read out for the fit.
    pub fitted: usize,
    /// Largest degree of the polynomials: powers of flux and index count 1.5 times.
    pub degree: f64,
    /// Errors of the polynomials.
    pub held_out: HeldOut,
    /// Whether the polynomials were accurate enough.
    pub is_used: bool,
}

/// A catalogue at several times.
#[derive(Clone, Debug)]
pub struct Epochs(pub Vec<Catalogue>);

impl Serialize for Epochs {
    fn serialize<S: serde::Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        match &self.0[..] {
            [only] => only.serialize(to),
            several => serde_json::json!({ "epochs": several }).serialize(to),
        }
    }
}

/// Called with the number of galaxies done.
pub type Progress<'a> = &'a (dyn Fn(usize) + Sync);

/// What the galaxies of a catalogue share.
pub(crate) struct Survey<'a> {
    pub model: &'a Model,
    pub galaxies: &'a [SurveyGalaxy],
    pub t_yr: f64,
    /// Devices by the number of transfers of their galaxies.
    devices: BTreeMap<u32, Device>,
    progress: Progress<'a>,
}

impl Catalogue {
    /// The changes of shape of galaxies at a time (years since launch).
    ///
    /// # Errors
    /// If a formula has no value.
    pub fn of(
        model: &Model,
        galaxies: &[SurveyGalaxy],
        t_yr: f64,
        how: Settings,
        progress: Progress,
    ) -> Result<Catalogue, InputError> {
        let survey = Survey::new(model, galaxies, t_yr, progress)?;
        let mut changes: Vec<Option<Option<ShapeChange>>> = vec![None; galaxies.len()];
        let mut is_emulated = vec![false; galaxies.len()];
        let mut classes = Vec::new();
        if let Some(accuracy) = how.emulate.filter(|_| survey.is_smooth()) {
            for (weight_bits, members) in survey.classes() {
                let Some(fit) = Emulator::of(&survey, &members, accuracy, how.seed)? else { continue };
                for (row, change) in fit.read_out {
                    changes[row] = Some(change);
                }
                if fit.is_used {
                    let open: Vec<usize> = members.iter().copied().filter(|row| changes[*row].is_none()).collect();
                    progress(changes.iter().flatten().count());
                    for (row, change) in open.iter().zip(fit.emulator.changes(&survey, &open)) {
                        changes[*row] = change.map(Some);
                        is_emulated[*row] = change.is_some();
                    }
                }
                classes.push(Class {
                    weight_px: f64::from_bits(weight_bits),
                    galaxies: members.len(),
                    fitted: fit.fitted,
                    degree: fit.degree,
                    held_out: fit.held_out,
                    is_used: fit.is_used,
                });
            }
        }
        let open: Vec<usize> = (0..galaxies.len()).filter(|row| changes[*row].is_none()).collect();
        progress(galaxies.len() - open.len());
        for (row, change) in open.iter().zip(survey.read_out(&open)?) {
            changes[*row] = Some(change);
        }
        let changes: Vec<Option<ShapeChange>> = changes.into_iter().map(Option::flatten).collect();
        Ok(Catalogue {
            mission: model.mission.mission.name.clone(),
            t_yr,
            dose_mev_g: model.dose_mev_g(t_yr)?,
            galaxies: galaxies.len(),
            lost: changes.iter().filter(|change| change.is_none()).count(),
            emulated: is_emulated.iter().filter(|emulated| **emulated).count(),
            classes,
            rms_delta_e: rms(changes.iter().flatten().map(ShapeChange::magnitude)),
            changes,
            is_emulated,
        })
    }
}

impl<'a> Survey<'a> {
    fn new(
        model: &'a Model,
        galaxies: &'a [SurveyGalaxy],
        t_yr: f64,
        progress: Progress<'a>,
    ) -> Result<Survey<'a>, InputError> {
        let mut distances: Vec<u32> = galaxies.iter().map(|galaxy| galaxy.transfers).collect();
        distances.sort_unstable();
        distances.dedup();
        let device = |transfers: u32| Ok((transfers, model.survey_device(t_yr, transfers)?));
        let devices = distances.into_iter().map(device).collect::<Result<_, InputError>>()?;
        Ok(Survey { model, galaxies, t_yr, devices, progress })
    }

    /// Whether changes are smooth functions of the catalogue entries: traps are not at random positions.
    fn is_smooth(&self) -> bool {
        self.devices.values().all(|device| !device.method.is_random())
    }

    /// Rows by the width of their weight.
    fn classes(&self) -> BTreeMap<u64, Vec<usize>> {
        let mut classes: BTreeMap<u64, Vec<usize>> = BTreeMap::new();
        for (row, galaxy) in self.galaxies.iter().enumerate() {
            classes.entry(galaxy.weight_px.to_bits()).or_default().push(row);
        }
        classes
    }

    /// The changes of some rows, read out one by one.
    fn read_out(&self, rows: &[usize]) -> Result<Vec<Option<ShapeChange>>, InputError> {
        let done = std::sync::atomic::AtomicUsize::new(self.galaxies.len() - rows.len());
        let of = |row: &usize| {
            let galaxy = &self.galaxies[*row];
            let device = std::slice::from_ref(&self.devices[&galaxy.transfers]);
            let changes = self.model.survey_changes(galaxy, device)?;
            (self.progress)(1 + done.fetch_add(1, std::sync::atomic::Ordering::Relaxed));
            Ok(changes.map(|changes| changes[0]))
        };
        parallel::try_map(rows, of)
    }
}

/// Root mean square; 0 for no values.
pub(crate) fn rms(values: impl Iterator<Item = f64>) -> f64 {
    let (count, squares) = values.fold((0.0, 0.0), |(count, sum), value| (count + 1.0, sum + value * value));
    if count > 0.0 { (squares / count).sqrt() } else { 0.0 }
}
