//! A flash before each exposure → shape error against signal-to-noise ratio.
//!
//! Charge P in every pixel keeps traps full that a faint galaxy would otherwise meet, and adds its shot noise (Rhodes et al. 2010,
//! section 6):
//!
//! ```text
//! S/N = s F/√(s F + π r² (B + P + R²))
//! ```
//!
//! To restore the S/N, the exposure is lengthened by a factor, which reduces the survey area; see `signal.rs`.

use chrono::NaiveDate;
use serde::Serialize;

use super::{Exposure, Study, budgets, check, ready, warnings};
use crate::error::InputError;
use crate::mission::Mission;
use crate::model::Model;
use crate::numeric::parallel;
use crate::plan::curve::Curve;
use crate::warning::Warning;

/// Options of the study.
#[derive(Clone, Debug)]
pub struct Preflash {
    /// Charges of the flash, e- per pixel; the case without a flash is always included.
    pub electrons: Vec<f64>,
}

impl Default for Preflash {
    fn default() -> Preflash {
        Preflash { electrons: vec![3.0, 10.0, 30.0, 100.0, 300.0, 1000.0] }
    }
}

/// The results of the study, at the end of the mission.
#[derive(Clone, Debug)]
pub struct Results {
    /// Each flash, ascending; the first is none.
    pub levels: Vec<Level>,
    /// Radius of the aperture of the signal-to-noise ratio, px.
    pub aperture_px: f64,
    /// Warnings about the mission.
    pub warnings: Vec<Warning>,
}

/// One flash.
#[derive(Clone, Debug, Serialize)]
pub struct Level {
    /// Charge, e- per pixel.
    pub electrons: f64,
    /// |Δe|; None if no shape is left, here and below.
    pub delta_e: Option<f64>,
    /// Flux lost, %.
    pub flux_loss_percent: Option<f64>,
    /// Signal-to-noise ratio.
    pub snr: f64,
    /// Reduction of it from the case without a flash, %.
    pub snr_loss_percent: f64,
    /// Area per time at equal depth, relative to that without a flash.
    pub area_equal_depth: f64,
    /// Day on which the uncorrected budget is exceeded.
    pub exceeded_date: Option<NaiveDate>,
    /// Day on which the corrected budget is exceeded.
    pub corrected_date: Option<NaiveDate>,
    /// Whether the uncorrected and the corrected budget are met until the end of the mission.
    #[serde(skip)]
    pub lasts: [bool; 2],
}

impl Study for Preflash {
    type Results = Results;

    fn study(&self, mission: &Mission, advance: &(dyn Fn() + Sync)) -> Result<Results, InputError> {
        check("sky.background_e", &self.electrons)?;
        let mut electrons = self.electrons.clone();
        electrons.push(0.0);
        electrons.sort_by(f64::total_cmp);
        electrons.dedup();
        let model = ready(mission)?;
        let exposure = Exposure::of(mission);
        let levels = parallel::try_map(&electrons, |electrons| {
            let level = Level::of(&model, &exposure, *electrons)?;
            advance();
            Ok(level)
        })?;
        Ok(Results { levels, aperture_px: exposure.aperture.radius_px, warnings: warnings(mission) })
    }
}

impl Level {
    fn of(model: &Model, exposure: &Exposure, electrons: f64) -> Result<Level, InputError> {
        let curve = Curve::under(model, |at| at.background_e += electrons)?;
        let mut at = model.conditions(model.mission.mission.duration_yr);
        at.background_e += electrons;
        let change = model.change_by(0, &model.device(&at)?)?;
        let snr = exposure.snr(electrons);
        let crossings = budgets(&model.mission).map(|budget| curve.crossing(budget));
        let [exceeded_date, corrected_date] =
            crossings.each_ref().map(|found| found.date(model.mission.mission.launch.0));
        Ok(Level {
            electrons,
            delta_e: curve.end(),
            flux_loss_percent: change.map(|change| 100.0 * -change.delta_flux),
            snr,
            snr_loss_percent: 100.0 * (1.0 - snr / exposure.snr(0.0)),
            area_equal_depth: exposure.area_equal_depth(electrons, exposure),
            exceeded_date,
            corrected_date,
            lasts: crossings.map(|found| found.t_yr.is_none()),
        })
    }
}
