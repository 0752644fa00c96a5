//! Launch date → shape error at the end of life, and when the budget is exceeded.
//!
//! The detector accumulates solar proton dose in seven years of the eleven-year cycle (Rhodes et al. 2010, section 4.1;
//! ECSS-E-ST-10-04C, annex B.1). For a mission shorter than a cycle, the dose depends on the launch date.

use chrono::{Months, NaiveDate};
use serde::Serialize;

use super::{Study, ready};
use crate::error::InputError;
use crate::mission::{Date, Mission};
use crate::model::Model;
use crate::numeric::{parallel, range};
use crate::plan::curve::Curve;
use crate::plan::date_distribution::Confidence;
use crate::plan::judgement::{JudgedRow, Judgement};
use crate::plan::scenario::{Merit, Ranking, sun};
use crate::warning::{self, Warning};

/// Default range of launch dates in years, and the step in months.
const CYCLES_YR: u32 = 22;
const STEP_MONTHS: u32 = 6;

/// Options of the study.
#[derive(Clone, Debug, Default)]
pub struct Launch {
    /// Launch dates; by default every half year for 22 years from the mission's launch.
    pub launches: Option<Vec<NaiveDate>>,
    /// Whether an average dose over the solar cycle was requested explicitly, and is used.
    pub keep_average: bool,
    /// Whether the Sun at times that were observed was requested explicitly: then observed and drawn Suns may be compared.
    pub keep_sun: bool,
    /// The probability with which budgets are to be met; if given, launches are ranked by it.
    pub confidence: Option<Confidence>,
}

/// The results of the study.
#[derive(Clone, Debug)]
pub struct Results {
    /// Each launch date, in the order of the options.
    pub launches: Vec<Launched>,
    /// The best and the worst of them.
    pub ranking: Ranking,
    /// The mission with the dose over time under which launches are compared.
    pub compared: Mission,
    /// The requested probability.
    pub confidence: Option<f64>,
    /// A note on that for the reader.
    pub note: Option<&'static str>,
    /// Warnings about any of the launches.
    pub warnings: Vec<Warning>,
}

/// One launch date.
#[derive(Clone, Debug, Serialize)]
pub struct Launched {
    /// Day of the launch.
    pub launch: NaiveDate,
    /// Active years of the Sun within the mission, yr.
    pub active_yr: f64,
    /// Displacement dose at the end of the mission, MeV/g.
    pub dose_mev_g: f64,
    /// |Δe| at the end of the mission; None if no shape is left.
    pub delta_e: Option<f64>,
    /// Judgement of the budgets.
    #[serde(flatten)]
    pub judged: JudgedRow,
    /// How the dose is distributed over the years.
    pub dose_model: &'static str,
    /// Its ranking key.
    #[serde(skip)]
    merit: Merit,
    /// Warnings about this launch.
    #[serde(skip)]
    warnings: Vec<Warning>,
}

impl Study for Launch {
    type Results = Results;

    fn study(&self, mission: &Mission, advance: &(dyn Fn() + Sync)) -> Result<Results, InputError> {
        let (flown, note) = sun::of_launches(mission, self.keep_average);
        let model = ready(&flown)?;
        let given = self.launches.clone().filter(|dates| !dates.is_empty());
        let dates = given.unwrap_or_else(|| half_years(mission.mission.launch.0));
        let missions = dates.iter().map(|date| launched(&model.mission, *date));
        let missions = missions.collect::<Result<Vec<Mission>, InputError>>()?;
        let note = note.or(sun::of_the_past(missions.iter(), self.keep_sun)?);
        let launches = parallel::try_map(&dates, |date| Launched::of(&model, *date, self.confidence, advance))?;
        Ok(Results {
            ranking: Ranking::of(&launches.iter().map(|launched| launched.merit).collect::<Vec<_>>()),
            warnings: warning::together(launches.iter().flat_map(|launched| &launched.warnings)),
            launches,
            compared: model.mission,
            confidence: self.confidence.map(|asked| asked.probability),
            note,
        })
    }
}

/// Every half year of two solar cycles.
fn half_years(first: NaiveDate) -> Vec<NaiveDate> {
    let last = first.checked_add_months(Months::new(12 * CYCLES_YR)).unwrap_or(first);
    range::by_months(first, last, STEP_MONTHS)
}

/// The mission with another launch.
fn launched(mission: &Mission, launch: NaiveDate) -> Result<Mission, InputError> {
    let date: toml::value::Datetime = Date(launch).into();
    mission.with(&[("mission.launch".into(), date.into())])
}

impl Launched {
    fn of(
        model: &Model,
        launch: NaiveDate,
        confidence: Option<Confidence>,
        advance: &(dyn Fn() + Sync),
    ) -> Result<Launched, InputError> {
        let mission = launched(&model.mission, launch)?;
        let model = model.like(&mission);
        advance();
        let curve = Curve::of(&model)?;
        let duration_yr = mission.mission.duration_yr;
        let judgement = Judgement::along(&model, &curve, confidence)?;
        let probability = confidence.map(|asked| asked.probability);
        Ok(Launched {
            launch,
            active_yr: model.history().active_years(duration_yr),
            dose_mev_g: model.dose_mev_g(duration_yr)?,
            delta_e: curve.end(),
            judged: JudgedRow::of(&judgement, launch, probability),
            merit: Merit::of(&judgement, probability, curve.end()),
            dose_model: sun::model(&mission),
            warnings: model.history().warnings(duration_yr),
        })
    }
}
