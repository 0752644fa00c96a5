//! Why one scenario is better than another: dose, and what the same dose does, species by species.

use crate::error::InputError;
use crate::mission::Mission;
use crate::model::Model;

/// What makes one scenario better than another; the report has the words.
#[derive(Clone, Debug, PartialEq)]
pub enum Cause {
    /// The worse one has no measurable shape left.
    Lost,
    /// The doses differ.
    Dose {
        /// The better one has more, which is no cause.
        although: bool,
        /// Dose of the better one and of the worse, MeV/g.
        dose_mev_g: [f64; 2],
        /// Active time of the better one and of the worse, yr.
        active_yr: [f64; 2],
    },
    /// The same dose does more to one of them.
    PerDose {
        /// It does more to the better one, which is no cause.
        although: bool,
        /// |Δe| per dose of the better one over that of the worse.
        ratio: f64,
    },
    /// A species has another share.
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
    /// For each species its share of |Δe| were it alone, and its release time in transfers.
    shares: Vec<(String, f64, f64)>,
}

impl State {
    pub fn of(mission: &Mission, t_yr: f64) -> Result<State, InputError> {
        let judged = Mission { galaxies: vec![mission.judged_galaxy().clone()], ..mission.clone() };
        let model = Model::new(&judged);
        Ok(State {
            delta_e: model.change(0, t_yr)?.map(|change| change.magnitude()),
            dose_mev_g: model.dose_mev_g(t_yr)?,
            active_yr: model.history().active_years(t_yr),
            shares: shares(&model, t_yr)?,
        })
    }
}

/// |Δe| of the better over that of the worse, and what makes it so.
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
    // A difference the other way round than that of |Δe| is no cause of it.
    let although = |more: bool| more == (ratio < 1.0);
    if !alike(better.dose_mev_g, worse.dose_mev_g) {
        causes.push(Cause::Dose {
            although: although(better.dose_mev_g > worse.dose_mev_g),
            dose_mev_g: [better.dose_mev_g, worse.dose_mev_g],
            active_yr: [better.active_yr, worse.active_yr],
        });
    }
    if better.dose_mev_g > 0.0 && worse.dose_mev_g > 0.0 {
        let (better_per, worse_per) = (better_e / better.dose_mev_g, worse_e / worse.dose_mev_g);
        if (better_per / worse_per - 1.0).abs() > 0.01 {
            causes.push(Cause::PerDose { although: although(better_per > worse_per), ratio: better_per / worse_per });
        }
        for ((name, worse_share, worse_transfers), (_, better_share, better_transfers)) in
            worse.shares.iter().zip(&better.shares).filter(|(from, to)| from.0 == to.0 && (from.1 - to.1).abs() > 0.02)
        {
            causes.push(Cause::Species {
                name: name.clone(),
                release_transfers: [*better_transfers, *worse_transfers],
                share: [*better_share, *worse_share],
            });
        }
    }
    (Some(ratio), causes)
}

/// For each species its share of |Δe| were it alone, and its release time in transfers.
fn shares(model: &Model, t_yr: f64) -> Result<Vec<(String, f64, f64)>, InputError> {
    let device = model.device_at(t_yr)?;
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
