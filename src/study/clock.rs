//! Line time → shape error, photometric loss, read noise, readout time, survey area.
//!
//! A species hurts shapes most where it releases after a few transfers, within the galaxy; much faster, and the charge never
//! leaves its pixel; much slower, and it is lost to the galaxy without a direction (Rhodes et al. 2010, sections 5.1 and 6). A
//! faster clock reads more noise (`[readout.noise]`), a slower one takes time from the survey (`[survey]`):
//!
//! ```text
//! rate = columns/(line time − parallel)     cycle = exposure + max(readout, slew)     area ∝ 1/cycle
//! ```
//!
//! Area at equal depth: every exposure is made as much longer as the read noise asks for to keep the signal-to-noise ratio that
//! the mission's own clock gives.

use clap::Args;
use rayon::prelude::*;

use super::{Cell, Digits, Exposure, Kind, Study, Table};
use super::{column, level, line, numbers, ratios, ready, when};
use crate::error::InputError;
use crate::mission::Mission;
use crate::model::Model;
use crate::physics::conditions::Conditions;
use crate::plan::timeline::Timeline;
use crate::report::plot::{Figure, Kind as Drawn, Panel, Series};

/// Line times on either side of the mission's own where none are given, as a factor, and how many.
const REACH: f64 = 30.0;
const COUNT: usize = 25;

/// Options of the study.
#[derive(Clone, Debug, Args)]
pub struct Clock {
    /// Times between two parallel transfers, ms, such as 1,5,25 or 5..100:log:8 [default: a factor 30 either way]
    #[arg(long, value_name = "MS")]
    pub line_time_ms: Option<String>,
}

/// What becomes of one line time.
struct Tried {
    line_time_ms: f64,
    delta_e: Option<f64>,
    flux_loss: Option<f64>,
    /// Δe1 of each species alone.
    alone: Vec<Option<f64>>,
    cost: Option<Cost>,
}

/// What a line time costs besides shapes.
struct Cost {
    read_noise_e: f64,
    snr: f64,
    readout_s: f64,
    /// Area per time over that of the mission's clock, with equal exposures and at equal depth.
    area: Option<(f64, f64)>,
}

impl Kind for Clock {
    fn study(&self, mission: &Mission, advance: &(dyn Fn() + Sync)) -> Result<Study, InputError> {
        let own_ms = mission.readout.line_time_ms;
        let line_times = match &self.line_time_ms {
            Some(text) => numbers("readout.line_time_ms", text)?,
            None => ratios(own_ms / REACH, own_ms * REACH, COUNT),
        };
        let model = ready(mission)?;
        let tried: Vec<Result<Tried, InputError>> = line_times
            .par_iter()
            .map(|line_time_ms| {
                advance();
                tried(&model, *line_time_ms)
            })
            .collect();
        let tried = tried.into_iter().collect::<Result<Vec<Tried>, _>>()?;
        let species: Vec<String> =
            model.traps(mission.mission.duration_yr)?.into_iter().map(|species| species.name).collect();
        let mut study = Study::of(
            "clock",
            mission,
            format!("line time against shape error of \"{}\" at the end of the mission", mission.requirement.galaxy),
        );
        study.cite("Line time against shape error", "Rhodes et al. 2010 (PASP 122, 439), sections 5.1 and 6");
        study.tables = vec![table(&tried), by_species(&tried, &species)];
        study.figures = vec![("clock.svg".into(), figure(mission, &tried, &species))];
        conclude(&mut study, mission, &model, &tried, &species)?;
        Ok(study)
    }
}

fn tried(model: &Model, line_time_ms: f64) -> Result<Tried, InputError> {
    let mission = &model.mission;
    let at = Conditions { line_time_ms, ..model.conditions(mission.mission.duration_yr) };
    let device = model.device(&at)?;
    let change = model.change_by(0, &device)?;
    let alone = (0..device.traps.len()).map(|index| {
        let change = model.change_by(0, &device.with_species(index))?;
        Ok(change.map(|change| change.delta_e1))
    });
    Ok(Tried {
        line_time_ms,
        delta_e: change.map(|change| change.magnitude()),
        flux_loss: change.map(|change| -change.delta_flux),
        alone: alone.collect::<Result<_, InputError>>()?,
        cost: cost(mission, line_time_ms),
    })
}

/// None where the mission does not say what a clock costs, or the amplifier cannot be clocked so.
fn cost(mission: &Mission, line_time_ms: f64) -> Option<Cost> {
    let exposure = Exposure::with_line_time(mission, line_time_ms)?;
    let own = Exposure::with_line_time(mission, mission.readout.line_time_ms);
    let area =
        own.filter(|_| mission.survey.is_some()).map(|own| (exposure.area(&own), exposure.area_equal_depth(0.0, &own)));
    let (read_noise_e, readout_s) = (exposure.read_noise_e, exposure.readout_s);
    Some(Cost { read_noise_e, snr: exposure.snr(0.0), readout_s, area })
}

fn table(tried: &[Tried]) -> Table {
    let priced = tried.iter().any(|tried| tried.cost.is_some());
    let surveyed = tried.iter().any(|tried| tried.cost.as_ref().is_some_and(|cost| cost.area.is_some()));
    let mut columns = vec![
        column("line_time_ms", "line [ms]", Digits::Significant(4)),
        column("delta_e", "|delta e|", Digits::Scientific(3)),
        column("flux_loss_percent", "flux lost [%]", Digits::Fixed(4)),
    ];
    if priced {
        columns.push(column("read_noise_e", "noise [e-]", Digits::Fixed(2)));
        columns.push(column("snr", "S/N", Digits::Fixed(2)));
        columns.push(column("readout_s", "readout [s]", Digits::Significant(3)));
    }
    if surveyed {
        columns.push(column("area", "area", Digits::Fixed(3)));
        columns.push(column("area_equal_depth", "equal depth", Digits::Fixed(3)));
    }
    let rows = tried.iter().map(|tried| {
        let mut row: Vec<Cell> =
            vec![tried.line_time_ms.into(), tried.delta_e.into(), tried.flux_loss.map(|loss| 100.0 * loss).into()];
        let cost = |value: fn(&Cost) -> Option<f64>| Cell::from(tried.cost.as_ref().and_then(value));
        if priced {
            row.extend([
                cost(|cost| Some(cost.read_noise_e)),
                cost(|cost| Some(cost.snr)),
                cost(|cost| Some(cost.readout_s)),
            ]);
        }
        if surveyed {
            row.extend([cost(|cost| cost.area.map(|area| area.0)), cost(|cost| cost.area.map(|area| area.1))]);
        }
        row
    });
    let title = if surveyed { "Area per time is over that of the mission's own clock" } else { "" };
    Table { name: "line_times", title: title.into(), columns, rows: rows.collect(), ..Table::default() }
}

fn by_species(tried: &[Tried], species: &[String]) -> Table {
    let mut columns = vec![column("line_time_ms", "line [ms]", Digits::Significant(4))];
    let of = |name: &String| column(format!("delta_e1_{name}"), name.clone(), Digits::Scientific(2));
    columns.extend(species.iter().map(of));
    let row = |tried: &Tried| {
        let mut row = vec![Cell::from(tried.line_time_ms)];
        row.extend(tried.alone.iter().map(|alone| Cell::from(*alone)));
        row
    };
    Table {
        name: "species",
        title: "delta e1 of each species alone".into(),
        columns,
        rows: tried.iter().map(row).collect(),
        ..Table::default()
    }
}

fn figure(mission: &Mission, tried: &[Tried], species: &[String]) -> Figure {
    let x: Vec<f64> = tried.iter().map(|tried| tried.line_time_ms).collect();
    let of = |value: &dyn Fn(&Tried) -> Option<f64>| -> Vec<f64> {
        tried.iter().map(|tried| value(tried).unwrap_or(f64::NAN)).collect()
    };
    let mut shapes = vec![line("all species", 0, &x, of(&|tried| tried.delta_e))];
    for (index, name) in species.iter().enumerate() {
        let y = of(&|tried| tried.alone[index].map(f64::abs));
        shapes.push(Series {
            label: Some(name.clone()),
            color: index + 1,
            kind: Drawn::Line { x: x.clone(), y, dashed: true },
        });
    }
    let limit = mission.requirement.delta_e;
    shapes.push(level("budget", limit));
    let panel = |y_label: &str, series: Vec<Series>| Panel {
        x_label: "line time [ms]".into(),
        y_label: y_label.into(),
        x_log: true,
        series,
        height_share: 0.6,
        ..Panel::default()
    };
    let mut panels = vec![
        Panel { height_share: 1.4, ..panel("|delta e| at the end", shapes) },
        panel("flux lost [%]", vec![line("flux lost", 2, &x, of(&|tried| tried.flux_loss.map(|loss| 100.0 * loss)))]),
    ];
    if tried.iter().any(|tried| tried.cost.is_some()) {
        let noise = of(&|tried| tried.cost.as_ref().map(|cost| cost.read_noise_e));
        panels.push(panel("read noise [e-]", vec![line("read noise", 3, &x, noise)]));
    }
    if tried.iter().any(|tried| tried.cost.as_ref().is_some_and(|cost| cost.area.is_some())) {
        let area =
            |which: fn((f64, f64)) -> f64| of(&|tried| tried.cost.as_ref().and_then(|cost| cost.area).map(which));
        let series = vec![line("area", 4, &x, area(|area| area.0)), line("at equal depth", 5, &x, area(|area| area.1))];
        panels.push(panel("area per time", series));
    }
    Figure { title: format!("{}: line time", mission.mission.name), panels }
}

fn conclude(
    study: &mut Study,
    mission: &Mission,
    model: &Model,
    tried: &[Tried],
    species: &[String],
) -> Result<(), InputError> {
    let own_ms = mission.readout.line_time_ms;
    let lost = tried.iter().filter(|tried| tried.delta_e.is_none()).count();
    if lost > 0 {
        study.find(format!("With {lost} of {} line times no shape is left at the end of the mission.", tried.len()));
    }
    let measured: Vec<&Tried> = tried.iter().filter(|tried| tried.delta_e.is_some()).collect();
    let by = |a: &&&Tried, b: &&&Tried| a.delta_e.partial_cmp(&b.delta_e).expect("numbers");
    let (Some(worst), Some(best)) = (measured.iter().max_by(by), measured.iter().min_by(by)) else { return Ok(()) };
    let (most, least) = (worst.delta_e.unwrap_or(0.0), best.delta_e.unwrap_or(0.0));
    study.result("worst_line_time_ms", worst.line_time_ms);
    study.result("best_line_time_ms", best.line_time_ms);
    if most == 0.0 {
        study.find("No clock changes any shape: the mission has no traps at its end.");
        return Ok(());
    }
    let last =
        |one: &Tried| [&tried[0], &tried[tried.len() - 1]].iter().any(|end| end.line_time_ms == one.line_time_ms);
    let shown = |line_time_ms: f64| super::short(line_time_ms);
    let mut words =
        format!("The worst clock of those tried is {} ms, with |delta e| {most:.3e}", shown(worst.line_time_ms));
    let size = |tried: &Tried, index: usize| tried.alone[index].map_or(0.0, f64::abs);
    let total: f64 = (0..species.len()).map(|index| size(worst, index)).sum();
    let index = (0..species.len()).max_by(|a, b| size(worst, *a).total_cmp(&size(worst, *b)));
    if let (Some(index), true) = (index, total > 0.0) {
        let release_ms = model.traps(mission.mission.duration_yr)?[index].release_ms;
        words += &format!(
            ", because there {}, released after {} transfers, makes {:.0} % of it",
            species[index],
            super::short(release_ms / worst.line_time_ms),
            100.0 * size(worst, index) / total
        );
    }
    if last(worst) {
        words += "; it is the last that was tried";
    }
    study.find(words + ".");
    let end = if last(best) { " It is the last that was tried: beyond it shapes may get better still." } else { "" };
    study.find(format!(
        "The best for shapes is {} ms: {:.2} of the worst; it takes {:.3} % of the flux, against {:.3} %.{end}",
        shown(best.line_time_ms),
        least / most,
        100.0 * best.flux_loss.unwrap_or(0.0),
        100.0 * worst.flux_loss.unwrap_or(0.0)
    ));
    if let Some(own) = model.change(0, mission.mission.duration_yr)?.map(|change| change.magnitude()) {
        study.result("own_delta_e", own);
        study.find(format!("The mission's own {} ms has {:.2} of the worst.", shown(own_ms), own / most));
    }
    for (index, name) in species.iter().enumerate() {
        let alone = |tried: &Tried| size(tried, index);
        let inside = (1..tried.len().saturating_sub(1)).filter(|place| {
            alone(&tried[*place]) > alone(&tried[place - 1]) && alone(&tried[*place]) > alone(&tried[place + 1])
        });
        if let Some(place) = inside.max_by(|a, b| alone(&tried[*a]).total_cmp(&alone(&tried[*b]))) {
            let release_ms = model.traps(mission.mission.duration_yr)?[index].release_ms;
            let line_time_ms = tried[place].line_time_ms;
            study.find(format!(
                "{name} alone is worst around {} ms, where it is released after {:.2} transfers.",
                shown(line_time_ms),
                release_ms / line_time_ms
            ));
        }
    }
    compare_dates(study, mission, model, worst.line_time_ms, best.line_time_ms)?;
    price(study, mission, tried);
    Ok(())
}

fn compare_dates(
    study: &mut Study,
    mission: &Mission,
    model: &Model,
    worst_ms: f64,
    best_ms: f64,
) -> Result<(), InputError> {
    let limit = mission.requirement.delta_e;
    let date = |line_time_ms: f64| -> Result<_, InputError> {
        Ok(Timeline::under(model, |at| at.line_time_ms = line_time_ms)?.date(limit))
    };
    let (worst, best, own) = (date(worst_ms)?, date(best_ms)?, date(mission.readout.line_time_ms)?);
    study.find(format!(
        "Uncorrected, the budget is exceeded: with the worst clock {}, with the best {}, with the mission's own {}.",
        when(worst),
        when(best),
        when(own)
    ));
    Ok(())
}

/// What survey and noise have to say.
fn price(study: &mut Study, mission: &Mission, tried: &[Tried]) {
    let Some(noise) = &mission.readout.noise else {
        study.find(
            "What a clock costs in read noise and time is not in the mission: [readout.noise] and [survey] would say it.",
        );
        return;
    };
    let beyond = tried.iter().filter(|tried| tried.cost.is_none()).count();
    if beyond > 0 {
        study.find(format!(
            "{beyond} of {} line times have no read noise: the rate of {} pixels per line is beyond the table, or no time is \
             left for them.",
            tried.len(),
            noise.columns
        ));
    }
    let Some(own) = cost(mission, mission.readout.line_time_ms) else {
        study.find("The mission's own clock has no read noise in the mission's table: nothing to compare areas with.");
        return;
    };
    study.result("own_read_noise_e", own.read_noise_e);
    study.result("own_readout_s", own.readout_s);
    let requirement = &mission.requirement;
    let limit = requirement.delta_e * requirement.correction_factor;
    let within = |tried: &&Tried| tried.delta_e.is_some_and(|delta_e| delta_e < limit);
    let area = |tried: &Tried| tried.cost.as_ref().and_then(|cost| cost.area).map(|area| area.1);
    let priced = tried.iter().filter(|tried| area(tried).is_some());
    let best = priced.clone().filter(within).max_by(|a, b| area(a).partial_cmp(&area(b)).expect("numbers"));
    match best {
        Some(best) => {
            study.result("best_area_line_time_ms", best.line_time_ms);
            study.find(format!(
                "Of the clocks that stay within the corrected budget, {} ms covers most area at equal depth: {:.3} of the \
                 mission's own, with |delta e| {:.3e} and {:.2} e- of read noise.",
                super::short(best.line_time_ms),
                area(best).unwrap_or(0.0),
                best.delta_e.unwrap_or(0.0),
                best.cost.as_ref().map_or(0.0, |cost| cost.read_noise_e)
            ));
        }
        None if mission.survey.is_none() => study.find("[survey] would say what readout time costs in area."),
        None => study.find("No clock that was tried stays within the corrected budget to the end of the mission."),
    }
}
