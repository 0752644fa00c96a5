//! Line time → shape error, photometric loss, read noise, readout time, survey area.
//!
//! A species distorts shapes most if it releases after a few transfers, within the galaxy. If it is much faster, the charge never
//! leaves its pixel; if much slower, it is lost to the galaxy without a preferred direction (Rhodes et al. 2010, sections 5.1 and
//! 6). A faster clock has more read noise (`[readout.noise]`), a slower one takes time from the survey (`[survey]`):
//!
//! ```text
//! rate = columns/(line time − parallel)     cycle = exposure + max(readout, slew)     area ∝ 1/cycle
//! ```
//!
//! Area at equal depth: exposures are lengthened to compensate the read noise, so that the signal-to-noise ratio is that of the
//! mission's own clock.

use chrono::NaiveDate;
use serde::Serialize;

use super::{Exposure, Study, budgets, check, ratios, ready, warnings};
use crate::error::InputError;
use crate::mission::Mission;
use crate::model::Model;
use crate::numeric::parallel;
use crate::physics::SpeciesState;
use crate::physics::conditions::Conditions;
use crate::plan::curve::Curve;
use crate::plan::date_distribution::Confidence;
use crate::plan::judgement::{JudgedRow, Judgement, Limited};
use crate::plan::scenario::{Merit, Ranking};
use crate::warning::Warning;

/// Default range of line times on either side of the mission's own, as a factor, and their number.
const REACH: f64 = 30.0;
const COUNT: usize = 25;

/// Options of the study.
#[derive(Clone, Debug, Default)]
pub struct Clock {
    /// Times between two parallel transfers, ms; by default up to a factor 30 either way of the mission's own.
    pub line_times_ms: Option<Vec<f64>>,
    /// The probability with which budgets are to be met; if given, line times are ranked by it.
    pub confidence: Option<Confidence>,
}

/// The results of the study, at the end of the mission.
#[derive(Clone, Debug)]
pub struct Results {
    /// Each line time, in the order of the options.
    pub line_times: Vec<LineTime>,
    /// Trap species.
    pub species: Vec<SpeciesState>,
    /// The line times compared; None if no shape is left with any of them.
    pub comparison: Option<Comparison>,
    /// Line times ranked by how long they meet all budgets; None if only |Δe| is limited and no probability is requested.
    pub ranking: Option<Ranking>,
    /// The requested probability.
    pub confidence: Option<f64>,
    /// Warnings about the mission.
    pub warnings: Vec<Warning>,
}

/// One line time.
#[derive(Clone, Debug, Serialize)]
pub struct LineTime {
    /// Time between two parallel transfers, ms.
    pub line_time_ms: f64,
    /// |Δe|; None if no shape is left, here and below.
    pub delta_e: Option<f64>,
    /// Flux lost, %.
    pub flux_loss_percent: Option<f64>,
    /// None if the mission does not state the cost of a clock, or the amplifier cannot be clocked at this rate.
    #[serde(flatten)]
    pub cost: Option<Cost>,
    /// Judgement of the budgets over the mission; None if only |Δe| is limited and no probability is requested.
    #[serde(flatten)]
    pub judged: Option<JudgedRow>,
    /// Its ranking key in that case.
    #[serde(skip)]
    merit: Option<Merit>,
    /// Δe1 of each species alone, in the order of the species.
    #[serde(skip)]
    pub delta_e1_alone: Vec<Option<f64>>,
}

/// The cost of a line time besides shapes.
#[derive(Clone, Debug, Serialize)]
pub struct Cost {
    /// Read noise, e- per pixel.
    pub read_noise_e: f64,
    /// Signal-to-noise ratio of the judged galaxy.
    pub snr: f64,
    /// Time of a readout, s.
    pub readout_s: f64,
    /// Area per time relative to that of the mission's clock, with equal exposures; None without a survey.
    pub area: Option<f64>,
    /// The same at equal depth.
    pub area_equal_depth: Option<f64>,
}

/// The clocks of largest and of smallest shape error, and the mission's own.
#[derive(Clone, Debug)]
pub struct Comparison {
    /// Largest |Δe|, by its index among the line times.
    pub worst: usize,
    /// Smallest |Δe|.
    pub best: usize,
    /// Largest area at equal depth of those within the corrected budget; None if there are none, or the area is unknown.
    pub most_area: Option<usize>,
    /// |Δe| of the mission's own clock.
    pub own_delta_e: Option<f64>,
    /// Cost of the mission's own clock.
    pub own_cost: Option<Cost>,
    /// Day on which the uncorrected budget is exceeded, with the worst clock.
    pub worst_date: Option<NaiveDate>,
    /// The same with the best clock.
    pub best_date: Option<NaiveDate>,
    /// The same with the mission's own clock.
    pub own_date: Option<NaiveDate>,
}

impl Study for Clock {
    type Results = Results;

    fn study(&self, mission: &Mission, advance: &(dyn Fn() + Sync)) -> Result<Results, InputError> {
        let own_ms = mission.readout.line_time_ms;
        let line_times_ms = self.line_times_ms.clone().unwrap_or_else(|| ratios(own_ms / REACH, own_ms * REACH, COUNT));
        check("readout.line_time_ms", &line_times_ms)?;
        let model = ready(mission)?;
        let line_times = parallel::try_map(&line_times_ms, |line_time_ms| {
            advance();
            LineTime::of(&model, *line_time_ms, self.confidence)
        })?;
        let species = model.traps(mission.mission.duration_yr)?;
        let comparison = Comparison::of(&model, &line_times)?;
        let merits: Option<Vec<Merit>> = line_times.iter().map(|one| one.merit).collect();
        Ok(Results {
            line_times,
            species,
            comparison,
            ranking: merits.map(|merits| Ranking::of(&merits)),
            confidence: self.confidence.map(|asked| asked.probability),
            warnings: warnings(mission),
        })
    }
}

impl LineTime {
    fn of(model: &Model, line_time_ms: f64, confidence: Option<Confidence>) -> Result<LineTime, InputError> {
        let mission = &model.mission;
        let at = Conditions { line_time_ms, ..model.conditions(mission.mission.duration_yr) };
        let device = model.device(&at)?;
        let change = model.change_by(0, &device)?;
        let alone = (0..device.traps.len()).map(|index| {
            let change = model.change_by(0, &device.with_species(index))?;
            Ok(change.map(|change| change.delta_e1))
        });
        let delta_e = change.map(|change| change.magnitude());
        let (judged, merit) = match judged(model, line_time_ms, delta_e, confidence)? {
            Some((judged, merit)) => (Some(judged), Some(merit)),
            None => (None, None),
        };
        Ok(LineTime {
            line_time_ms,
            delta_e,
            judged,
            merit,
            flux_loss_percent: change.map(|change| 100.0 * -change.delta_flux),
            cost: Cost::of(mission, line_time_ms),
            delta_e1_alone: alone.collect::<Result<_, InputError>>()?,
        })
    }

    /// Whether the corrected budgets are met until the end; if judged together, all of them with the requested probability.
    fn keeps(&self, corrected: f64) -> bool {
        match (&self.judged, self.judged.as_ref().and_then(|judged| judged.corrected_met_percent)) {
            (Some(judged), Some(_)) => judged.corrected_kept_t_yr.is_none(),
            (Some(judged), None) => judged.corrected_t_yr.is_none(),
            (None, _) => self.delta_e.is_some_and(|delta_e| delta_e < corrected),
        }
    }

    fn area_equal_depth(&self) -> Option<f64> {
        self.cost.as_ref()?.area_equal_depth
    }
}

/// Judgement of all budgets over the mission with a line time, and its ranking key; None if only |Δe| is limited and no probability
/// is requested.
fn judged(
    model: &Model,
    line_time_ms: f64,
    delta_e: Option<f64>,
    confidence: Option<Confidence>,
) -> Result<Option<(JudgedRow, Merit)>, InputError> {
    if confidence.is_none() && Limited::by(&model.mission) == [Limited::DeltaE] {
        return Ok(None);
    }
    let mission = model.mission.with(&[("readout.line_time_ms".into(), line_time_ms.into())])?;
    let model = model.like(&mission);
    let judgement = Judgement::along(&model, &Curve::of(&model)?, confidence)?;
    let probability = confidence.map(|asked| asked.probability);
    let row = JudgedRow::of(&judgement, mission.mission.launch.0, probability);
    Ok(Some((row, Merit::of(&judgement, probability, delta_e))))
}

impl Cost {
    fn of(mission: &Mission, line_time_ms: f64) -> Option<Cost> {
        let exposure = Exposure::with_line_time(mission, line_time_ms)?;
        let own = Exposure::with_line_time(mission, mission.readout.line_time_ms);
        let own = own.filter(|_| mission.survey.is_some());
        Some(Cost {
            read_noise_e: exposure.read_noise_e,
            snr: exposure.snr(0.0),
            readout_s: exposure.readout_s,
            area: own.as_ref().map(|own| exposure.area(own)),
            area_equal_depth: own.as_ref().map(|own| exposure.area_equal_depth(0.0, own)),
        })
    }
}

impl Comparison {
    fn of(model: &Model, line_times: &[LineTime]) -> Result<Option<Comparison>, InputError> {
        let mission = &model.mission;
        let measured = || line_times.iter().enumerate().filter_map(|(place, one)| Some((place, one.delta_e?)));
        let by = |a: &(usize, f64), b: &(usize, f64)| a.1.total_cmp(&b.1);
        let (Some((worst, most)), Some((best, _))) = (measured().max_by(by), measured().min_by(by)) else {
            return Ok(None);
        };
        let [uncorrected, corrected] = budgets(mission);
        let date = |line_time_ms: f64| -> Result<_, InputError> {
            // Without traps no clock exceeds a budget.
            if most == 0.0 {
                return Ok(None);
            }
            let curve = Curve::under(model, |at| at.line_time_ms = line_time_ms)?;
            Ok(curve.crossing(uncorrected).date(mission.mission.launch.0))
        };
        let own_cost = Cost::of(mission, mission.readout.line_time_ms);
        let areas = line_times.iter().enumerate().filter(|(_, one)| one.keeps(corrected));
        let areas = areas.filter_map(|(place, one)| Some((place, one.area_equal_depth()?)));
        Ok(Some(Comparison {
            worst,
            best,
            most_area: own_cost.as_ref().and_then(|_| Some(areas.max_by(by)?.0)),
            own_delta_e: model.change(0, mission.mission.duration_yr)?.map(|change| change.magnitude()),
            own_cost,
            worst_date: date(line_times[worst].line_time_ms)?,
            best_date: date(line_times[best].line_time_ms)?,
            own_date: date(mission.readout.line_time_ms)?,
        }))
    }
}
