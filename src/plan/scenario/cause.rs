//! Why one scenario is better than another: the dose, and the effect of the same dose, species by species.

use crate::error::InputError;
use crate::mission::Mission;
use crate::model::{Device, Model};

/// A cause of the difference between two scenarios; the report has the words.
#[derive(Clone, Debug, PartialEq)]
pub enum Cause {
    /// The worse one has no measurable shape left.
    Lost,
    /// The doses differ.
    Dose {
        /// The better one has more dose, which is not a cause.
        although: bool,
        /// Dose of the better one and of the worse, MeV/g.
        dose_mev_g: [f64; 2],
        /// Active time of the better one and of the worse, yr.
        active_yr: [f64; 2],
    },
    /// The effect of the same dose differs.
    PerDose {
        /// It is larger in the better one, which is not a cause.
        although: bool,
        /// |Δe| per dose of the better one over that of the worse.
        ratio: f64,
    },
    /// One of them has effects that the other lacks.
    Effects {
        /// Effects of the better one only.
        only_better: Vec<String>,
        /// Effects of the worse one only.
        only_worse: Vec<String>,
    },
    /// Part of the change is not by traps of the image: registers and amplifiers also change shapes.
    Beside {
        /// |Δe| without these traps, as a share of |Δe| in the better one and in the worse.
        share: [f64; 2],
    },
    /// A species with a different share.
    Species {
        /// Its name.
        name: String,
        /// Its release time in the better one and in the worse, in transfers.
        release_transfers: [f64; 2],
        /// Its share of |Δe| in the better one and in the worse.
        share: [f64; 2],
    },
}

/// A scenario at one time.
pub(super) struct State {
    delta_e: Option<f64>,
    dose_mev_g: f64,
    active_yr: f64,
    /// Names of its effects.
    effects: Vec<String>,
    /// |Δe| without the traps of the image.
    beside: f64,
    /// For each species, its share of |Δe| if it were alone, and its release time in transfers.
    shares: Vec<(String, f64, f64)>,
}

impl State {
    pub fn of(mission: &Mission, t_yr: f64) -> Result<State, InputError> {
        let judged = Mission { galaxies: vec![mission.judged_galaxy().clone()], ..mission.clone() };
        let model = Model::new(&judged);
        let device = model.device_at(t_yr)?;
        Ok(State {
            delta_e: model.change(0, t_yr)?.map(|change| change.magnitude()),
            dose_mev_g: model.dose_mev_g(t_yr)?,
            active_yr: model.history().active_years(t_yr),
            effects: mission.effects.keys().cloned().collect(),
            beside: model.change_by(0, &device.without_traps())?.map_or(0.0, |change| change.magnitude()),
            shares: shares(&model, &device)?,
        })
    }
}

/// Share of |Δe| above which contributions other than traps of the image are named, and the shares of traps are not.
const BESIDE: f64 = 0.05;

/// |Δe| of the better over that of the worse, and the causes.
pub(super) fn why(better: &State, worse: &State) -> (Option<f64>, Vec<Cause>) {
    let (Some(better_e), Some(worse_e)) = (better.delta_e, worse.delta_e) else {
        return (None, vec![Cause::Lost]);
    };
    if worse_e <= 0.0 || worse_e.is_nan() {
        return (None, Vec::new());
    }
    let ratio = better_e / worse_e;
    let mut causes = Vec::new();
    let alike = |a: f64, b: f64| (a - b).abs() <= 1e-6 * a.abs().max(b.abs());
    // A difference opposite in sign to that of |Δe| is not its cause.
    let although = |more: bool| more == (ratio < 1.0);
    if !alike(better.dose_mev_g, worse.dose_mev_g) {
        causes.push(Cause::Dose {
            although: although(better.dose_mev_g > worse.dose_mev_g),
            dose_mev_g: [better.dose_mev_g, worse.dose_mev_g],
            active_yr: [better.active_yr, worse.active_yr],
        });
    }
    let only = |of: &State, other: &State| -> Vec<String> {
        of.effects.iter().filter(|name| !other.effects.contains(name)).cloned().collect()
    };
    let (only_better, only_worse) = (only(better, worse), only(worse, better));
    if !only_better.is_empty() || !only_worse.is_empty() {
        causes.push(Cause::Effects { only_better, only_worse });
    }
    if better.dose_mev_g > 0.0 && worse.dose_mev_g > 0.0 {
        let (better_per, worse_per) = (better_e / better.dose_mev_g, worse_e / worse.dose_mev_g);
        if (better_per / worse_per - 1.0).abs() > 0.01 {
            causes.push(Cause::PerDose { although: although(better_per > worse_per), ratio: better_per / worse_per });
        }
    }
    let beside = [better.beside / better_e, worse.beside / worse_e];
    if beside.iter().any(|share| *share > BESIDE) {
        causes.push(Cause::Beside { share: beside });
    } else if better.dose_mev_g > 0.0 && worse.dose_mev_g > 0.0 {
        causes.extend(species(better, worse));
    }
    (Some(ratio), causes)
}

/// Species of both whose shares differ.
fn species(better: &State, worse: &State) -> Vec<Cause> {
    let both = worse.shares.iter().zip(&better.shares).filter(|(from, to)| from.0 == to.0);
    both.filter(|(from, to)| (from.1 - to.1).abs() > 0.02)
        .map(|((name, worse_share, worse_transfers), (_, better_share, better_transfers))| Cause::Species {
            name: name.clone(),
            release_transfers: [*better_transfers, *worse_transfers],
            share: [*better_share, *worse_share],
        })
        .collect()
}

/// For each species, its share of |Δe| if it were alone, and its release time in transfers.
fn shares(model: &Model, device: &Device) -> Result<Vec<(String, f64, f64)>, InputError> {
    let alone = |index: usize| -> Result<f64, InputError> {
        Ok(model.change_by(0, &device.with_species(index))?.map_or(0.0, |change| change.magnitude()))
    };
    let alone = (0..device.traps.len()).map(alone).collect::<Result<Vec<f64>, _>>()?;
    let total: f64 = alone.iter().sum();
    let line_time_ms = device.at.line_time_ms;
    let shares = device.traps.iter().zip(&alone).map(|(species, alone)| {
        let share = if total > 0.0 { alone / total } else { 0.0 };
        (species.name.clone(), share, species.release_ms / line_time_ms)
    });
    Ok(shares.collect())
}
