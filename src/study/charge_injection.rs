//! Lines of charge injected at a fixed row spacing → shape error against signal-to-noise ratio and lost rows.
//!
//! A line that is read before a galaxy fills the traps below its cloud; those still full when the galaxy arrives, d rows later,
//! capture nothing from it. Traps that release sooner leave the line's charge under the galaxy, as a background with its shot
//! noise. Rows near a line are lost to measurement. Galaxies are evenly distributed between two lines, and the image of lines and
//! background alone is subtracted.
//!
//! The line nearest to the galaxy is read out before it, through the same pixels: with instantaneous capture it leaves them as
//! full as any number of lines would. (Rhodes et al. 2010, section 6; Massey et al. 2010 for capture at once.)

use std::num::NonZeroUsize;

use gauss_quad::GaussLegendre;
use ndarray::{Array2, s};
use serde::{Serialize, Serializer};

use super::{Exposure, Study, check, ready, warnings};
use crate::error::InputError;
use crate::mission::Mission;
use crate::model::{Beside, Device, Scene};
use crate::numeric::parallel;
use crate::physics::accuracy::Purpose;
use crate::physics::shape::ShapeChange;
use crate::readout::Downstream;
use crate::warning::Warning;

/// Nodes of the mean between two lines.
const NODES: NonZeroUsize = NonZeroUsize::new(4).expect("above 0");

/// Default charge of a line, as a share of the full well.
const CHARGE: f64 = 0.1;

/// Options of the study.
#[derive(Clone, Debug)]
pub struct ChargeInjection {
    /// Rows from one line to the next; the case without lines is always included.
    pub spacings_rows: Vec<f64>,
    /// Charge of a line, e- per pixel; by default a tenth of the full well.
    pub charge_e: Option<f64>,
    /// Rows on each side of a line that are not measured; by default the width of the galaxy's weight.
    pub guard_rows: Option<u32>,
}

impl Default for ChargeInjection {
    fn default() -> ChargeInjection {
        ChargeInjection { spacings_rows: vec![50.0, 100.0, 200.0, 400.0], charge_e: None, guard_rows: None }
    }
}

/// The results of the study, at the end of the mission.
#[derive(Clone, Debug)]
pub struct Results {
    /// Charge of a line, e- per pixel.
    pub charge_e: f64,
    /// Each spacing, ascending.
    pub with_lines: Vec<Spacing>,
    /// The same without lines.
    pub without_lines: Spacing,
    /// The spacing of smallest shape error.
    pub best: Option<Best>,
    /// Warnings about the mission.
    pub warnings: Vec<Warning>,
}

/// One spacing of lines.
#[derive(Clone, Debug, Serialize)]
pub struct Spacing {
    /// Rows from one line to the next; None without lines.
    #[serde(serialize_with = "rows_or_none")]
    pub spacing_rows: Option<f64>,
    /// |Δe|; None if no shape is left.
    pub delta_e: Option<f64>,
    /// |Δe| over that without lines; None if that is 0.
    pub over_none: Option<f64>,
    /// Charge of the line's trail under the galaxy, e- per pixel.
    pub trail_e: f64,
    /// Signal-to-noise ratio.
    pub snr: f64,
    /// Reduction of it from the case without lines, %.
    pub snr_loss_percent: f64,
    /// Rows lost to measurement, %.
    pub rows_lost_percent: f64,
    /// Area per time at equal depth, relative to that without lines.
    pub area_equal_depth: f64,
}

fn rows_or_none<S: Serializer>(rows: &Option<f64>, serializer: S) -> Result<S::Ok, S::Error> {
    match rows {
        Some(rows) => serializer.serialize_f64(*rows),
        None => serializer.serialize_str("none"),
    }
}

/// The spacing of smallest shape error.
#[derive(Clone, Debug)]
pub struct Best {
    /// Its index among those with lines.
    pub place: usize,
    /// Each species, and the fraction of its traps still full half-way between two such lines.
    pub kept: Vec<(String, f64)>,
}

impl Results {
    /// Each spacing, and the case without lines.
    pub fn all(&self) -> impl Iterator<Item = &Spacing> + Clone {
        self.with_lines.iter().chain([&self.without_lines])
    }
}

/// Change of shape of a galaxy behind a line, and the charge of the line's trail there, e-.
type Seen = (Option<ShapeChange>, f64);

impl Study for ChargeInjection {
    type Results = Results;

    fn study(&self, mission: &Mission, advance: &(dyn Fn() + Sync)) -> Result<Results, InputError> {
        let charge_e = self.charge_e.unwrap_or(CHARGE * mission.detector.full_well_e);
        let guard_rows = self.guard_rows.unwrap_or(mission.judged_galaxy().weight_px.ceil() as u32);
        let spacings_rows = self.spacings_rows(mission, charge_e, guard_rows)?;
        let model = ready(mission)?;
        let device = model.device_at(mission.mission.duration_yr)?.fit_for(Purpose::BehindLine);
        let scene = model.scene(0).expect("a mission made ready has a galaxy with a shape");
        let exposure = Exposure::of(mission);
        let without = model.change_by(0, &device)?.map(|change| change.magnitude());
        let spacing = |spacing_rows: Option<f64>, delta_e: Option<f64>, trail_e: f64| {
            let lost = spacing_rows.map_or(0.0, |rows| f64::from(2 * guard_rows + 1) / rows);
            let over = delta_e.zip(without).filter(|(_, without)| *without > 0.0);
            let snr = exposure.snr(trail_e);
            Spacing {
                spacing_rows,
                delta_e,
                over_none: over.map(|(with, without)| with / without),
                trail_e,
                snr,
                snr_loss_percent: 100.0 * (1.0 - snr / exposure.snr(0.0)),
                rows_lost_percent: 100.0 * lost,
                area_equal_depth: match spacing_rows {
                    Some(_) => (1.0 - lost) * exposure.area_equal_depth(trail_e, &exposure),
                    None => 1.0,
                },
            }
        };
        let mut with_lines = Vec::new();
        for rows in spacings_rows {
            let (change, trail_e) = between_lines(&device, scene, charge_e, (guard_rows, rows))?;
            advance();
            // Of the mean with its signs: this biases a survey.
            let delta_e = change.map(|change| change.magnitude());
            with_lines.push(spacing(Some(f64::from(rows)), delta_e, trail_e));
        }
        let best = Best::of(&with_lines, &device);
        let without_lines = spacing(None, without, 0.0);
        Ok(Results { charge_e, with_lines, without_lines, best, warnings: warnings(mission) })
    }
}

impl ChargeInjection {
    /// Spacings (rows), ascending.
    ///
    /// # Errors
    /// If the charge or a spacing is invalid.
    fn spacings_rows(&self, mission: &Mission, charge_e: f64, guard_rows: u32) -> Result<Vec<u32>, InputError> {
        let full_well_e = mission.detector.full_well_e;
        if !(charge_e > 0.0 && charge_e <= full_well_e) {
            let problem = format!(
                "a line has {charge_e} e- per pixel; allowed: above 0 and up to the full well, {full_well_e} e-"
            );
            return Err(InputError::new("cannot inject charge", problem));
        }
        check("readout.transfers", &self.spacings_rows)?;
        let mut spacings: Vec<u32> = self.spacings_rows.iter().map(|rows| *rows as u32).collect();
        spacings.sort_unstable();
        let lost = 2 * guard_rows + 1;
        match spacings.iter().find(|spacing| **spacing <= lost) {
            None => Ok(spacings),
            Some(spacing) => {
                let problem = format!(
                    "lines every {spacing} rows leave nothing to measure: {guard_rows} rows on each side of a line are lost, \
                     which needs more than {lost}"
                );
                let error = InputError::new("cannot inject charge", problem);
                Err(error.with_help("--guard-rows says how many are lost"))
            }
        }
    }
}

impl Best {
    /// None without any lines.
    fn of(with_lines: &[Spacing], device: &Device) -> Option<Best> {
        let change = |place: &usize| with_lines[*place].delta_e.unwrap_or(f64::INFINITY);
        let place = (0..with_lines.len()).min_by(|a, b| change(a).total_cmp(&change(b)))?;
        let half_ms = 0.5 * with_lines[place].spacing_rows? * device.at.line_time_ms;
        let kept = |release_ms: f64| (-half_ms / release_ms).exp();
        let kept = device.traps.iter().map(|species| (species.name.clone(), kept(species.release_ms)));
        Some(Best { place, kept: kept.collect() })
    }
}

/// The mean over all galaxies between two lines `spacing_rows` apart, without the `guard_rows` beside each of them.
fn between_lines(
    device: &Device,
    scene: &Scene,
    charge_e: f64,
    (guard_rows, spacing_rows): (u32, u32),
) -> Result<Seen, InputError> {
    let (low, high) = (f64::from(guard_rows + 1), f64::from(spacing_rows - guard_rows));
    let rule = GaussLegendre::new(NODES);
    let nodes: Vec<(u32, f64)> = rule
        .iter()
        .map(|(place, weight)| ((low + 0.5 * (1.0 + place) * (high - low)).round() as u32, 0.5 * weight))
        .collect();
    let seen = parallel::try_map(&nodes, |(distance, _)| behind_a_line(device, scene, charge_e, *distance))?;
    let weighted = || nodes.iter().map(|(_, weight)| weight).zip(&seen);
    let trail_e = weighted().map(|(weight, seen)| weight * seen.1).sum::<f64>().max(0.0);
    let change = weighted().try_fold(ShapeChange::default(), |sum, (weight, seen)| Some(sum.plus(&seen.0?, *weight)));
    Ok((change, trail_e))
}

/// Change of shape of a galaxy `distance` rows behind a line, and the charge of the line's trail there, e-.
fn behind_a_line(device: &Device, scene: &Scene, line_e: f64, distance: u32) -> Result<Seen, InputError> {
    let device = device.expected();
    let background_e = device.at.background_e;
    let (half_px, width_px, distance) = (scene.half_px(), scene.width_px(), distance as usize);
    // The line in row 0, or the edge of the stamp if that extends further down.
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
