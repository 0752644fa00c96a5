//! Lines of charge injected every so many rows → shape error against signal-to-noise ratio and lost rows.
//!
//! A line that is read before a galaxy fills the traps below its cloud; those still full when the galaxy comes, d rows later,
//! take nothing from it. Traps that release sooner put the line's charge behind it, under the galaxy, as a background with its
//! shot noise. Rows near a line are lost to measurement. The galaxy is placed evenly between two lines, and what lines and
//! background alone give is subtracted.
//!
//! The line nearest to the galaxy is read out before it, through the same pixels: with instantaneous capture it leaves them as
//! full as any number of lines would. (Rhodes et al. 2010, section 6; Massey et al. 2010 for capture at once.)

use std::num::NonZeroUsize;

use clap::Args;
use gauss_quad::GaussLegendre;
use ndarray::{Array2, s};
use rayon::prelude::*;

use super::{Digits, Exposure, Kind, Study, Table};
use super::{column, left_out, level, line, numbers, ready, short};
use crate::error::InputError;
use crate::mission::Mission;
use crate::model::{Beside, Device, Scene};
use crate::physics::accuracy::Purpose;
use crate::physics::shape::ShapeChange;
use crate::readout::Downstream;
use crate::report::plot::{Figure, Kind as Drawn, Panel, Series};

/// Nodes of the mean between two lines.
const NODES: NonZeroUsize = NonZeroUsize::new(4).expect("above 0");

/// Options of the study.
#[derive(Clone, Debug, Args)]
pub struct ChargeInjection {
    /// Rows from one line to the next; no lines at all are always among them
    #[arg(long, value_name = "ROWS", default_value = "50,100,200,400")]
    pub spacing_rows: String,
    /// Charge of a line, e- per pixel [default: a tenth of the full well]
    #[arg(long, value_name = "ELECTRONS")]
    pub charge_e: Option<f64>,
    /// Rows on each side of a line that are not measured [default: the width of the galaxy's weight]
    #[arg(long, value_name = "ROWS")]
    pub guard_rows: Option<u32>,
}

/// Change of shape of a galaxy behind a line, and the charge of the line's trail there, e-.
type Seen = (Option<ShapeChange>, f64);

/// One spacing of lines; none for no lines.
struct Tried {
    spacing: Option<u32>,
    delta_e: Option<f64>,
    /// Charge of the line's trail under the galaxy, e- per pixel.
    trail_e: f64,
    lost_rows: f64,
    snr: f64,
    /// Area at equal depth over that without lines.
    area: f64,
}

impl Kind for ChargeInjection {
    fn study(&self, mission: &Mission, advance: &(dyn Fn() + Sync)) -> Result<Study, InputError> {
        let charge_e = self.charge_e.unwrap_or(0.1 * mission.detector.full_well_e);
        if !(charge_e > 0.0 && charge_e <= mission.detector.full_well_e) {
            let problem = format!(
                "a line has {charge_e} e- per pixel; allowed: above 0 and up to the full well, {} e-",
                mission.detector.full_well_e
            );
            return Err(InputError::new("cannot inject charge", problem));
        }
        let guard = self.guard_rows.unwrap_or(mission.judged_galaxy().weight_px.ceil() as u32);
        let mut spacings: Vec<u32> =
            numbers("readout.transfers", &self.spacing_rows)?.into_iter().map(|rows| rows as u32).collect();
        spacings.sort_unstable();
        if let Some(spacing) = spacings.iter().find(|spacing| **spacing <= 2 * guard + 1) {
            let problem = format!(
                "lines every {spacing} rows leave nothing to measure: {guard} rows on each side of a line are lost, which needs \
                 more than {}",
                2 * guard + 1
            );
            return Err(
                InputError::new("cannot inject charge", problem).with_help("--guard-rows says how many are lost")
            );
        }
        let model = ready(mission)?;
        let device = model.device_at(mission.mission.duration_yr)?.fit_for(Purpose::BehindLine);
        let scene = model.scene(0).expect("a mission made ready has a galaxy with a shape");
        let exposure = Exposure::of(mission);
        let plain = Tried {
            spacing: None,
            delta_e: model.change_by(0, &device)?.map(|change| change.magnitude()),
            trail_e: 0.0,
            lost_rows: 0.0,
            snr: exposure.snr(0.0),
            area: 1.0,
        };
        let with_lines = |spacing: u32| -> Result<Tried, InputError> {
            let (low, high) = (f64::from(guard + 1), f64::from(spacing - guard));
            let rule = GaussLegendre::new(NODES);
            let nodes: Vec<(u32, f64)> = rule
                .iter()
                .map(|(place, weight)| ((low + 0.5 * (1.0 + place) * (high - low)).round() as u32, 0.5 * weight))
                .collect();
            let seen: Vec<_> =
                nodes.par_iter().map(|(distance, _)| behind_a_line(&device, scene, charge_e, *distance)).collect();
            let seen = seen.into_iter().collect::<Result<Vec<Seen>, _>>()?;
            advance();
            let weighted = || nodes.iter().map(|(_, weight)| weight).zip(&seen);
            let trail_e = weighted().map(|(weight, seen)| weight * seen.1).sum::<f64>().max(0.0);
            let change =
                weighted().try_fold(ShapeChange::default(), |sum, (weight, seen)| Some(sum.plus(&seen.0?, *weight)));
            let lost_rows = f64::from(2 * guard + 1) / f64::from(spacing);
            Ok(Tried {
                spacing: Some(spacing),
                // Of the mean with its signs: that is what biases a survey.
                delta_e: change.map(|change| change.magnitude()),
                trail_e,
                lost_rows,
                snr: exposure.snr(trail_e),
                area: (1.0 - lost_rows) * exposure.area_equal_depth(trail_e, &exposure),
            })
        };
        let mut tried = spacings.into_iter().map(with_lines).collect::<Result<Vec<Tried>, _>>()?;
        tried.push(plain);
        let mut study = report(mission, &tried, charge_e, &device);
        study.findings.extend(left_out(mission));
        Ok(study)
    }
}

/// Change of shape of a galaxy `distance` rows behind a line, and the charge of the line's trail there, e-.
fn behind_a_line(device: &Device, scene: &Scene, line_e: f64, distance: u32) -> Result<Seen, InputError> {
    let device = device.expected();
    let background_e = device.at.background_e;
    let (half_px, width_px, distance) = (scene.half_px(), scene.width_px(), distance as usize);
    // The line in row 0, or the stamp where that reaches farther down.
    let centre = distance.max(half_px);
    let stamp_rows = centre - half_px..centre + half_px + 1;
    let downstream = Downstream { rows: i64::from(device.at.transfers) - 1 - centre as i64, charge_e: background_e };
    let beside = Beside::Stamp(half_px);
    let lines = |columns: usize| {
        let mut image = Array2::from_elem((stamp_rows.end, columns), background_e);
        image.row_mut(centre - distance).fill(line_e.max(background_e));
        image
    };
    let alone = device.read(&lines(device.columns_of_background(width_px)), downstream, beside)?;
    let change = scene.mean(device.is_mirror_symmetric(), |charge_e| {
        let mut image = lines(width_px);
        let mut stamp = image.slice_mut(s![stamp_rows.clone(), ..]);
        stamp += charge_e;
        let read = device.read(&image, downstream, beside)? - &alone;
        Ok(read.slice(s![stamp_rows.clone(), ..]).to_owned())
    })?;
    let observed = change.map(|change| device.observed_change(change)).transpose()?;
    Ok((observed, alone[[centre, 0]] - background_e))
}

fn report(mission: &Mission, tried: &[Tried], charge_e: f64, device: &Device) -> Study {
    let requirement = &mission.requirement;
    let (limit, corrected) = (requirement.delta_e, requirement.delta_e * requirement.correction_factor);
    let mut study = Study::of(
        "charge-injection",
        mission,
        format!(
            "lines of {} e- per pixel against shape error of \"{}\" at the end of the mission",
            short(charge_e),
            requirement.galaxy
        ),
    );
    study.cite(
        "Injected lines of charge",
        "Rhodes et al. 2010 (PASP 122, 439), section 6; Massey et al. 2010 (MNRAS 401, 371) on capture at once",
    );
    let plain = tried.last().expect("no lines are always among them");
    let rows = tried.iter().map(|tried| {
        vec![
            match tried.spacing {
                Some(spacing) => f64::from(spacing).into(),
                None => "none".into(),
            },
            tried.delta_e.into(),
            tried.delta_e.zip(plain.delta_e).and_then(|(with, without)| (without > 0.0).then(|| with / without)).into(),
            tried.trail_e.into(),
            tried.snr.into(),
            (100.0 * (1.0 - tried.snr / plain.snr)).into(),
            (100.0 * tried.lost_rows).into(),
            tried.area.into(),
        ]
    });
    study.tables = vec![Table {
        name: "spacings",
        title: String::new(),
        columns: vec![
            column("spacing_rows", "line every", Digits::Fixed(0)),
            column("delta_e", "|delta e|", Digits::Scientific(3)),
            column("over_none", "of none", Digits::Fixed(3)),
            column("trail_e", "trail [e-]", Digits::Fixed(3)),
            column("snr", "S/N", Digits::Fixed(2)),
            column("snr_loss_percent", "lost [%]", Digits::Fixed(2)),
            column("rows_lost_percent", "rows lost [%]", Digits::Fixed(1)),
            column("area_equal_depth", "area", Digits::Fixed(3)),
        ],
        rows: rows.collect(),
        ..Table::default()
    }];
    let lined = &tried[..tried.len() - 1];
    let x: Vec<f64> = lined.iter().filter_map(|tried| tried.spacing).map(f64::from).collect();
    let mut shapes =
        vec![line("with lines", 1, &x, lined.iter().map(|tried| tried.delta_e.unwrap_or(f64::NAN)).collect())];
    shapes.push(level("budget", limit));
    if let Some(without) = plain.delta_e {
        shapes.push(Series {
            label: Some("without".into()),
            color: 2,
            kind: Drawn::Level { y: without, dashed: false },
        });
    }
    let panel = |y_label: &str, series| Panel {
        x_label: "rows from line to line".into(),
        y_label: y_label.into(),
        x_log: true,
        series,
        ..Panel::default()
    };
    study.figures = vec![(
        "charge-injection.svg".into(),
        Figure {
            title: format!("{}: injected lines", mission.mission.name),
            panels: vec![
                panel("|delta e| at the end", shapes),
                panel("area at equal depth", vec![line("area", 3, &x, lined.iter().map(|tried| tried.area).collect())]),
            ],
        },
    )];
    let Some(without) = plain.delta_e else {
        study.find("Without lines no shape is left at the end of the mission.");
        return study;
    };
    if without == 0.0 {
        study.find("No lines are needed: the mission has no traps at its end.");
        return study;
    }
    let change = |tried: &Tried| tried.delta_e.unwrap_or(f64::INFINITY);
    if let Some(best) = lined.iter().min_by(|a, b| change(a).total_cmp(&change(b))) {
        let spacing = best.spacing.unwrap_or(0);
        study.result("best_spacing_rows", spacing);
        study.result("best_over_none", change(best) / without);
        study.find(format!(
            "Of the spacings that were tried, lines every {spacing} rows leave least: {:.3} of the shape error without lines. \
             They cost {:.1} % of the rows and {:.2} % of S/N: {:.3} of the survey's area at equal depth are left.",
            change(best) / without,
            100.0 * best.lost_rows,
            100.0 * (1.0 - best.snr / plain.snr),
            best.area
        ));
        if change(best) >= without {
            study.find("Lines do not help here.");
        }
        let middle = 0.5 * f64::from(spacing) * device.at.line_time_ms;
        let kept: Vec<String> = device
            .traps
            .iter()
            .map(|species| format!("{} {:.0} %", species.name, 100.0 * (-middle / species.release_ms).exp()))
            .collect();
        study.find(format!(
            "Half way between such lines the traps that a line filled are still full to: {}. Only slow traps are kept so.",
            kept.join(", ")
        ));
    }
    for (name, limit) in [("uncorrected", limit), ("corrected", corrected)] {
        let best = tried.iter().filter(|tried| change(tried) < limit).max_by(|a, b| a.area.total_cmp(&b.area));
        study.find(match best {
            Some(best) if best.spacing.is_none() => {
                format!("The {name} budget lasts without lines: for it, none are best.")
            }
            Some(best) => format!(
                "The {name} budget lasts with lines every {} rows, at {:.3} of the survey's area.",
                best.spacing.unwrap_or(0),
                best.area
            ),
            None => format!("No spacing that was tried makes the {name} budget last to the end of the mission."),
        });
    }
    study
}
