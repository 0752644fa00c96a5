//! Launch date → shape error at the end of life, and when the budget is exceeded.
//!
//! Seven years of a solar cycle of eleven dose the detector, four do not (Rhodes et al. 2010, section 4.1; ECSS-E-ST-10-04C,
//! annex B.1). A mission shorter than a cycle gains or loses by its launch date.

use clap::Args;
use rayon::prelude::*;

use super::{Cell, Digits, Kind, Study, Table};
use super::{column, level, line, ready, when};
use crate::environment::solar_cycle;
use crate::error::InputError;
use crate::mission::Mission;
use crate::numeric::calendar::decimal_year;
use crate::plan::scenario::{Axis, Merit, Ranking, sun};
use crate::plan::sources;
use crate::plan::timeline::Timeline;
use crate::report::plot::{Figure, Kind as Drawn, Panel, Series};
use crate::warning::{self, Warning};

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
    /// Whether a dose that is an average over the solar cycle was asked for on purpose, and stays one
    #[arg(skip)]
    pub keep_average: bool,
}

/// What becomes of one launch date.
struct Tried {
    mission: Mission,
    active_yr: f64,
    dose_mev_g: f64,
    timeline: Timeline,
    warnings: Vec<Warning>,
}

impl Tried {
    fn name(&self) -> String {
        self.mission.mission.launch.to_string()
    }

    fn merit(&self) -> Merit {
        let requirement = &self.mission.requirement;
        Merit {
            uncorrected_yr: self.timeline.crossing(requirement.delta_e).t_yr,
            corrected_yr: self.timeline.crossing(requirement.delta_e * requirement.correction_factor).t_yr,
            delta_e: self.timeline.end(),
        }
    }
}

impl Kind for Launch {
    fn with_keys_set(self, keys: &[&str]) -> Launch {
        Launch { keep_average: keys.contains(&sun::MODEL), ..self }
    }

    fn study(&self, mission: &Mission, advance: &(dyn Fn() + Sync)) -> Result<Study, InputError> {
        let own = mission.mission.launch;
        let last = own.0.checked_add_months(chrono::Months::new(12 * CYCLES_YR)).unwrap_or(own.0);
        let text = self.launch.clone().unwrap_or_else(|| format!("{own}..{last}:{STEP_YR}"));
        let launches = Axis::parse("mission.launch", &text)?.values;
        let (flown, note) = sun::of_launches(mission, self.keep_average);
        let model = ready(&flown)?;
        let cycled = &model.mission;
        let launched = |launch: &toml::Value| {
            let mission = cycled.with(&[("mission.launch".into(), launch.clone())])?;
            let model = model.like(&mission);
            let duration_yr = mission.mission.duration_yr;
            advance();
            let timeline = Timeline::of(&model)?;
            let (active_yr, dose_mev_g) = (model.history().active_years(duration_yr), model.dose_mev_g(duration_yr)?);
            let warnings = model.history().warnings(duration_yr);
            Ok(Tried { active_yr, dose_mev_g, timeline, warnings, mission })
        };
        let tried: Vec<Result<Tried, InputError>> = launches.par_iter().map(launched).collect();
        // The first of several errors, whichever came first.
        let tried = tried.into_iter().collect::<Result<Vec<_>, _>>()?;
        let mut study = report(mission, cycled, &tried);
        study.findings.splice(0..0, note.map(String::from));
        if sun::model(cycled) != sun::model(mission) {
            study.sources.push(sources::over_time(cycled));
        }
        Ok(study)
    }
}

fn report(mission: &Mission, cycled: &Mission, tried: &[Tried]) -> Study {
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
            tried.timeline.crossing(corrected).t_yr.into(),
            day(tried.timeline.date(corrected)),
            sun::model(&tried.mission).into(),
        ]
    });
    let exceeded = tried.iter().any(|tried| tried.merit().corrected_yr.is_some());
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
            column("corrected_t_yr", if exceeded { "after [yr]" } else { "" }, Digits::Fixed(2)),
            column("corrected_date", "corrected", Digits::Fixed(0)),
            column("dose_model", "", Digits::Fixed(0)),
        ],
        rows: rows.collect(),
        ..Table::default()
    }];
    study.figures = vec![("launch.svg".into(), figure(mission, cycled, tried))];
    conclude(&mut study, mission, cycled, tried);
    study
}

fn figure(mission: &Mission, cycled: &Mission, tried: &[Tried]) -> Figure {
    let limit = mission.requirement.delta_e;
    let x: Vec<f64> = tried.iter().map(|tried| decimal_year(tried.mission.mission.launch.0)).collect();
    let (first, last) = (x.iter().copied().fold(f64::INFINITY, f64::min), x.iter().copied().fold(0.0, f64::max));
    let shades = || -> Vec<Series> {
        // An average knows no active years.
        if sun::model(cycled) == "constant" {
            return Vec::new();
        }
        let stretches = solar_cycle::active_years(&solar_cycle::maxima(&cycled.environment.solar_maximum, last));
        let seen = stretches.into_iter().filter(|stretch| stretch.to > first && stretch.from < last);
        let shade = |stretch: solar_cycle::ActiveYears| Series {
            label: Some(if stretch.extrapolated { "active Sun, extrapolated" } else { "active Sun" }.into()),
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
        title: format!("{}: launch date; dose: {}", mission.mission.name, sun::model(cycled)),
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

/// Most ties that are named.
const NAMED: usize = 6;

fn conclude(study: &mut Study, mission: &Mission, cycled: &Mission, tried: &[Tried]) {
    study.warnings = warning::together(tried.iter().flat_map(|tried| &tried.warnings));
    study.result("dose_model", sun::model(cycled));
    let ranking = Ranking::of(&tried.iter().map(Tried::merit).collect::<Vec<_>>());
    let names = |places: &[usize]| -> Vec<String> { places.iter().map(|place| tried[*place].name()).collect() };
    study.result("best_launch", tried[ranking.best[0]].name());
    study.result("worst_launch", tried[ranking.worst[0]].name());
    study.result("tied_best_launches", names(&ranking.best));
    study.result("tied_worst_launches", names(&ranking.worst));
    // Many rows of the same are nothing to read.
    study.tables[0].programs_only = ranking.by.is_none() && tried.len() > 2;
    let requirement = &mission.requirement;
    let fate = |tried: &Tried, dated: bool| {
        let shape =
            tried.timeline.end().map_or("no shape left".into(), |end| format!("|delta e| {end:.3e} at the end"));
        let lasts = |name: &str, limit: f64| match tried.timeline.crossing(limit).t_yr {
            Some(t_yr) => {
                let day = if dated { format!(", on {}", when(tried.timeline.date(limit))) } else { String::new() };
                format!("{name} budget exceeded after {t_yr:.2} yr{day}")
            }
            None => format!("{name} budget not exceeded within the mission"),
        };
        let corrected = requirement.delta_e * requirement.correction_factor;
        let mut words = vec![format!("{:.2} active years", tried.active_yr), lasts("uncorrected", requirement.delta_e)];
        if tried.timeline.crossing(corrected).t_yr.is_some() {
            words.push(lasts("corrected", corrected));
        }
        words.push(shape);
        words.join("; ")
    };
    if ranking.by.is_none() {
        study.find(format!("{} launches were tried, all alike: {}.", tried.len(), fate(&tried[0], false)));
        return;
    }
    for (side, places) in [("best", &ranking.best), ("worst", &ranking.worst)] {
        let first = &tried[places[0]];
        study.find(format!("The {side} launch is {} ({}).", first.name(), fate(first, true)));
        if places.len() > 1 {
            let mut others = names(&places[1..]);
            if others.len() > NAMED {
                others.splice(NAMED.., [format!("{} more", places.len() - 1 - NAMED)]);
            }
            let word = if side == "best" { "good" } else { "bad" };
            study.find(format!("Equally {word}: {}.", others.join(", ")));
        }
    }
    let ends: Option<Vec<f64>> = tried.iter().map(|tried| tried.timeline.end()).collect();
    if let Some(ends) = ends {
        let (least, most) =
            ends.iter().fold((f64::INFINITY, 0.0_f64), |(least, most), end| (least.min(*end), most.max(*end)));
        if least > 0.0 {
            study.result("worst_over_best", most / least);
            study.find(format!("The launch date is worth a factor {:.2} in |delta e| at the end.", most / least));
        }
    }
    let lasting = tried.iter().filter(|tried| tried.merit().uncorrected_yr.is_none()).count();
    study.find(format!("{lasting} of {} launches stay within the uncorrected budget to their end.", tried.len()));
}
