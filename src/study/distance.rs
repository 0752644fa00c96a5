//! Distance to the register → shape error of the farthest galaxy, of the mean over the detector, and of dithered exposures.
//!
//! The effect is nearly proportional to the distance: the mean over the detector is half of the farthest. Exposures with a galaxy
//! at several distances average its Δe:
//!
//! ```text
//! Δe(detector) = 1/T ∫₀ᵀ Δe(n) dn        Δe(pattern) = mean of Δe(n_k) over the exposures k
//! ```
//!
//! Rhodes et al. 2010, section 5.1 (distance) and 6.

use std::num::NonZeroUsize;

use chrono::NaiveDate;
use gauss_quad::GaussLegendre;
use serde::Serialize;

use super::{Study, budgets, check, ready, warnings};
use crate::error::InputError;
use crate::mission::Mission;
use crate::model::Model;
use crate::numeric::parallel;
use crate::plan::curve::Curve;
use crate::warning::Warning;

/// Nodes of the mean over the detector.
const NODES: NonZeroUsize = NonZeroUsize::new(6).expect("above 0");

/// Number of distances of the curve.
const CURVE: u32 = 8;

/// Options of the study.
#[derive(Clone, Debug, Default)]
pub struct Distance {
    /// Dither patterns; by default small steps, half a register, and the whole register.
    pub dithers: Vec<Dither>,
}

/// A dither pattern.
#[derive(Clone, Debug)]
pub struct Dither {
    /// Its name.
    pub name: String,
    /// Distance to the register in each exposure, transfers.
    pub transfers: Vec<f64>,
}

/// The results of the study, at the end of the mission.
#[derive(Clone, Debug)]
pub struct Results {
    /// The farthest galaxy, the mean over the detector, and each dither pattern.
    pub places: Vec<Place>,
    /// |Δe| against distance.
    pub curve: Vec<Point>,
    /// Warnings about the mission.
    pub warnings: Vec<Warning>,
}

/// Galaxies at one distance, or averaged over several.
#[derive(Clone, Debug, Serialize)]
pub struct Place {
    /// Name.
    #[serde(rename = "place")]
    pub name: String,
    /// Mean distance to the register, transfers.
    pub mean_transfers: f64,
    /// |Δe|; None if no shape is left, here and below.
    pub delta_e: Option<f64>,
    /// |Δe| relative to that of the farthest; None if that is 0.
    pub over_farthest: Option<f64>,
    /// Day on which the uncorrected budget is exceeded.
    pub exceeded_date: Option<NaiveDate>,
    /// Day on which the corrected budget is exceeded.
    pub corrected_date: Option<NaiveDate>,
}

/// One distance.
#[derive(Clone, Debug, Serialize)]
pub struct Point {
    /// Distance to the register, transfers.
    pub transfers: f64,
    /// |Δe|.
    pub delta_e: Option<f64>,
}

impl Results {
    /// The farthest galaxy.
    pub fn farthest(&self) -> &Place {
        &self.places[0]
    }

    /// The mean over galaxies evenly spread over the detector.
    pub fn mean(&self) -> &Place {
        &self.places[1]
    }

    /// The dither patterns.
    pub fn dithers(&self) -> &[Place] {
        &self.places[2..]
    }
}

/// Distances (transfers) with their weights.
struct Distances {
    name: String,
    transfers: Vec<f64>,
    weights: Vec<f64>,
}

impl Study for Distance {
    type Results = Results;

    fn study(&self, mission: &Mission, advance: &(dyn Fn() + Sync)) -> Result<Results, InputError> {
        self.dithers.iter().try_for_each(|dither| check("readout.transfers", &dither.transfers))?;
        let model = ready(mission)?;
        let farthest = f64::from(mission.readout.transfers);
        let mut sets = vec![Distances::even("farthest".into(), vec![farthest]), Distances::over_detector(farthest)];
        sets.extend(self.patterns(farthest));
        let mut places: Vec<Place> = Vec::new();
        for distances in &sets {
            let farthest = places.first().map(|place| place.delta_e);
            places.push(distances.place(&model, farthest)?);
            advance();
        }
        let curve = curve(&model, farthest, advance)?;
        Ok(Results { places, curve, warnings: warnings(mission) })
    }
}

impl Distance {
    fn patterns(&self, farthest: f64) -> Vec<Distances> {
        if self.dithers.is_empty() {
            let share = |name: &str, shares: &[f64]| {
                let transfers = shares.iter().map(|share| (share * farthest).round().max(1.0));
                Distances::even(name.into(), transfers.collect())
            };
            return vec![
                share("steps of 1 %", &[1.0, 0.99, 0.98, 0.97]),
                share("half a register", &[1.0, 0.5]),
                share("whole register", &[1.0, 0.75, 0.5, 0.25]),
            ];
        }
        self.dithers.iter().map(|dither| Distances::even(dither.name.clone(), dither.transfers.clone())).collect()
    }
}

impl Distances {
    /// With equal weights.
    fn even(name: String, transfers: Vec<f64>) -> Distances {
        let weights = vec![1.0 / transfers.len() as f64; transfers.len()];
        Distances { name, transfers, weights }
    }

    /// Galaxies evenly spread over the detector.
    fn over_detector(farthest: f64) -> Distances {
        let rule = GaussLegendre::new(NODES);
        let (transfers, weights) =
            rule.iter().map(|(place, weight)| (0.5 * farthest * (1.0 + place), 0.5 * weight)).unzip();
        Distances { name: "detector mean".into(), transfers, weights }
    }

    /// Results for these distances, given |Δe| of the farthest; None if these are the farthest.
    fn place(&self, model: &Model, farthest: Option<Option<f64>>) -> Result<Place, InputError> {
        let curves = parallel::try_map(&self.transfers, |transfers| {
            Curve::under(model, |at| at.transfers = transfers.round() as u32)
        })?;
        let curve = Curve::weighted(&curves, &self.weights);
        let delta_e = curve.end();
        let over = delta_e.zip(farthest.unwrap_or(delta_e)).filter(|(_, farthest)| *farthest > 0.0);
        let date = |budget: f64| curve.crossing(budget).date(model.mission.mission.launch.0);
        let [exceeded_date, corrected_date] = budgets(&model.mission).map(date);
        Ok(Place {
            name: self.name.clone(),
            mean_transfers: self
                .transfers
                .iter()
                .zip(&self.weights)
                .map(|(transfers, weight)| transfers * weight)
                .sum(),
            delta_e,
            over_farthest: over.map(|(end, farthest)| end / farthest),
            exceeded_date,
            corrected_date,
        })
    }
}

/// |Δe| at the end of the mission against distance.
fn curve(model: &Model, farthest: f64, advance: &(dyn Fn() + Sync)) -> Result<Vec<Point>, InputError> {
    let steps: Vec<u32> = (1..=CURVE).collect();
    parallel::try_map(&steps, |step| {
        let transfers = (farthest * f64::from(*step) / f64::from(CURVE)).round().max(1.0);
        let mut at = model.conditions(model.mission.mission.duration_yr);
        at.transfers = transfers as u32;
        advance();
        let change = model.change_by(0, &model.device(&at)?)?;
        Ok(Point { transfers, delta_e: change.map(|change| change.magnitude()) })
    })
}
