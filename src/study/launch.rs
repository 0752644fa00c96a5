//! Launch date → shape error at the end of life, and when the budget is exceeded.
//!
//! Seven years of a solar cycle of eleven dose the detector, four do not (Rhodes et al. 2010, section 4.1; ECSS-E-ST-10-04C,
//! annex B.1). A mission shorter than a cycle gains or loses by its launch date.

use clap::Args;
use rayon::prelude::*;

use super::{Cell, Digits, Kind, Study, Table, Timeline};
use super::{column, level, line, ready, when};
use crate::calendar::decimal_year;
use crate::environment::solar_cycle::{self, ACTIVE_AFTER_YR, CYCLE_YR};
use crate::error::InputError;
use crate::mission::{DoseModel, Mission};
use crate::plot::{Figure, Kind as Drawn, Panel, Series};
use crate::scenario::Axis;

/// Years over which launches are tried where none are given, and the step between two.
const CYCLES_YR: u32 = 22;
const STEP_YR: f64 = 0.5;

/// Options of the study.
#[derive(Clone, Debug, Args)]
pub struct Launch {
    /// Launch dates: 2009-01-01,2012-01-01 or 2009-01-01..2020-01-01:1 (step in years) [default: every half year of 22 years
    /// from the mission's launch]
    #[arg(long, value_name = "DATES")]
    pub launch: Option<String>,
}

/// What becomes of one launch date.
struct Tried {
    mission: Mission,
    active_yr: f64,
    dose_mev_g: f64,
    timeline: Timeline,
}

impl Kind for Launch {
    fn study(&self, mission: &Mission, advance: &(dyn Fn() + Sync)) -> Result<Study, InputError> {
        let own = mission.mission.launch;
        let last = own.0.checked_add_months(chrono::Months::new(12 * CYCLES_YR)).unwrap_or(own.0);
        let text = self.launch.clone().unwrap_or_else(|| format!("{own}..{last}:{STEP_YR}"));
        let launches = Axis::parse("mission.launch", &text)?.values;
        let model = ready(mission)?;
        let (cycled, assumed) = continued(&model.mission, &launches);
        let launched = |launch: &toml::Value| {
            let mission = cycled.with(&[("mission.launch".into(), launch.clone())])?;
            let model = model.like(&mission);
            let duration_yr = mission.mission.duration_yr;
            advance();
            let timeline = Timeline::of(&model)?;
            let (active_yr, dose_mev_g) = (model.history().active_years(duration_yr), model.dose_mev_g(duration_yr)?);
            Ok(Tried { active_yr, dose_mev_g, timeline, mission })
        };
        let tried: Vec<Result<Tried, InputError>> = launches.par_iter().map(launched).collect();
        // The first of several errors, whichever came first.
        let tried = tried.into_iter().collect::<Result<Vec<_>, _>>()?;
        Ok(report(mission, &cycled, &tried, &assumed))
    }
}

/// The mission with solar maxima to the end of its last flight, and those that were assumed for it.
fn continued(mission: &Mission, launches: &[toml::Value]) -> (Mission, Vec<f64>) {
    let year = |launch: &toml::Value| launch.as_datetime().and_then(|day| day.date).map_or(0, |day| day.year);
    let last = launches.iter().map(year).max().map_or(0.0, f64::from) + 1.0 + mission.mission.duration_yr;
    until(mission, last)
}

/// The mission with solar maxima every 11 years after its last, until a decimal year is covered.
pub(super) fn until(mission: &Mission, year: f64) -> (Mission, Vec<f64>) {
    let mut continued = mission.clone();
    let maxima = &mut continued.environment.solar_maximum;
    let mut assumed = Vec::new();
    if mission.environment.model == DoseModel::SolarCycle {
        let mut last = maxima.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        while last + ACTIVE_AFTER_YR < year && last + CYCLE_YR < 2300.0 {
            last += CYCLE_YR;
            assumed.push(last);
        }
        maxima.extend(&assumed);
    }
    (continued, assumed)
}

fn report(mission: &Mission, cycled: &Mission, tried: &[Tried], assumed: &[f64]) -> Study {
    let requirement = &mission.requirement;
    let (limit, corrected) = (requirement.delta_e, requirement.delta_e * requirement.correction_factor);
    let duration_yr = mission.mission.duration_yr;
    let mut study = Study::of(
        "launch",
        mission,
        format!("launch date against shape error of \"{}\" after {duration_yr} yr", requirement.galaxy),
    );
    let day = |date: Option<chrono::NaiveDate>| date.map_or(Cell::None, |date| date.to_string().into());
    let rows = tried.iter().map(|tried| {
        vec![
            tried.mission.mission.launch.to_string().into(),
            tried.active_yr.into(),
            tried.dose_mev_g.into(),
            tried.timeline.end().into(),
            tried.timeline.crossing(limit).t_yr.into(),
            day(tried.timeline.date(limit)),
            day(tried.timeline.date(corrected)),
        ]
    });
    study.tables = vec![Table {
        name: "launches",
        title: String::new(),
        columns: vec![
            column("launch", "launch", Digits::Fixed(0)),
            column("active_yr", "active [yr]", Digits::Fixed(2)),
            column("dose_mev_g", "dose [MeV/g]", Digits::Scientific(2)),
            column("delta_e", "|delta e|", Digits::Scientific(3)),
            column("exceeded_t_yr", "after [yr]", Digits::Fixed(2)),
            column("exceeded_date", "exceeded", Digits::Fixed(0)),
            column("corrected_date", "corrected", Digits::Fixed(0)),
        ],
        rows: rows.collect(),
        ..Table::default()
    }];
    study.figures = vec![("launch.svg".into(), figure(mission, cycled, tried))];
    conclude(&mut study, mission, tried, assumed);
    study
}

fn figure(mission: &Mission, cycled: &Mission, tried: &[Tried]) -> Figure {
    let limit = mission.requirement.delta_e;
    let x: Vec<f64> = tried.iter().map(|tried| decimal_year(tried.mission.mission.launch.0)).collect();
    let (first, last) = (x.iter().copied().fold(f64::INFINITY, f64::min), x.iter().copied().fold(0.0, f64::max));
    let shades = || -> Vec<Series> {
        let stretches = solar_cycle::active_years(&solar_cycle::maxima(&cycled.environment.solar_maximum, last));
        let seen = stretches.into_iter().filter(|stretch| stretch.to > first && stretch.from < last);
        let shade = |stretch: solar_cycle::ActiveYears| Series {
            label: Some("active Sun".into()),
            color: 7,
            kind: Drawn::Shade { from: stretch.from.max(first), to: stretch.to.min(last) },
        };
        seen.map(shade).collect()
    };
    let panel = |y_label: &str, mut series: Vec<Series>| {
        series.extend(shades());
        Panel { x_label: "launch [year]".into(), y_label: y_label.into(), series, ..Panel::default() }
    };
    let ends = tried.iter().map(|tried| tried.timeline.end().unwrap_or(f64::NAN)).collect();
    let exceeded = tried.iter().map(|tried| tried.timeline.crossing(limit).t_yr.unwrap_or(f64::NAN)).collect();
    Figure {
        title: format!("{}: launch date", mission.mission.name),
        panels: vec![
            panel("|delta e| at the end", vec![line("at the end of life", 1, &x, ends), level("budget", limit)]),
            panel(
                "exceeded after [yr]",
                vec![
                    line("uncorrected budget exceeded", 2, &x, exceeded),
                    level("end of the mission", mission.mission.duration_yr),
                ],
            ),
        ],
    }
}

fn conclude(study: &mut Study, mission: &Mission, tried: &[Tried], assumed: &[f64]) {
    let end = |tried: &Tried| tried.timeline.end().unwrap_or(f64::INFINITY);
    let best = tried.iter().min_by(|a, b| end(a).total_cmp(&end(b))).expect("at least one launch");
    let worst = tried.iter().rev().max_by(|a, b| end(a).total_cmp(&end(b))).expect("at least one launch");
    let name = |tried: &Tried| tried.mission.mission.launch.to_string();
    if !assumed.is_empty() {
        let years: Vec<String> = assumed.iter().map(|year| format!("{year:.1}")).collect();
        study.find(format!(
            "Solar maxima after the last in the list are assumed every {CYCLE_YR} years: {}.",
            years.join(", ")
        ));
    }
    study.result("best_launch", name(best));
    study.result("worst_launch", name(worst));
    let alike = end(worst) - end(best) <= 1e-6 * end(best);
    // Many rows of the same are nothing to read.
    study.tables[0].programs_only = alike && tried.len() > 2;
    if alike {
        let end = best.timeline.end().map_or("no shape left".into(), |end| format!("|delta e| {end:.3e} at the end"));
        let after = best.timeline.crossing(mission.requirement.delta_e).t_yr;
        let after = after.map_or("never within the mission".into(), |t_yr| format!("after {t_yr:.2} yr"));
        study.find(format!("{} launches were tried: {end}, the uncorrected budget exceeded {after}.", tried.len()));
    }
    if alike && mission.environment.model == DoseModel::Constant && mission.effects.get("solar-cycle").is_none() {
        study.find(
            "Every launch date is alike: the mission's dose is a constant average over the solar cycle. \
             --set environment.model=solar-cycle lets it follow the Sun.",
        );
        return;
    }
    if alike {
        study.find("Every launch date that was tried is alike.");
        return;
    }
    let limit = mission.requirement.delta_e;
    let said = |tried: &Tried| {
        let shape = tried.timeline.end().map_or("no shape left".into(), |end| format!("|delta e| {end:.3e}"));
        let after = tried.timeline.crossing(limit).t_yr.map_or("not exceeded within the mission".into(), |t_yr| {
            format!("exceeded after {t_yr:.2} yr, on {}", when(tried.timeline.date(limit)))
        });
        format!("{} ({:.2} active years, {shape}, {after})", name(tried), tried.active_yr)
    };
    study.find(format!("The best launch is {}.", said(best)));
    study.find(format!("The worst launch is {}.", said(worst)));
    if end(worst).is_finite() && end(best) > 0.0 {
        study.result("worst_over_best", end(worst) / end(best));
        study.find(format!("The launch date is worth a factor {:.2} in shape error.", end(worst) / end(best)));
    }
    let lasting = tried.iter().filter(|tried| tried.timeline.crossing(limit).t_yr.is_none()).count();
    study.find(format!("{lasting} of {} launches stay within the uncorrected budget to their end.", tried.len()));
}
