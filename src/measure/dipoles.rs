//! Dipoles of trap pumping: pairs of neighbours along a column of a flat field, one brighter and one darker by the same charge.
//!
//! ```text
//! I = (bright − dark)/2
//! ```
//!
//! A dipole is found if, in several frames, the two pixels are on opposite sides of the flat near them and their difference is
//! significant. Its intensity is needed at all phase times, also where it is faint. So it is measured in every frame, at its
//! position and with its sign, whether it was detected there or not. Its error is that of the flat's noise and the binomial noise
//! of the pumps, I(1 − I/N) after N cycles. A pair whose sum is not that of two pixels of the flat, because of a cosmic ray, is
//! excluded.
//!
//! A frame whose dipoles are not those of its series is left out (`series`).

mod series;

use std::collections::{BTreeMap, HashMap, HashSet};

use ndarray::s;
use serde_json::json;

use super::exposure::{About, Exposure, Frames};
use super::statistic::{CLIP_SIGMA, median, robust_scatter};
use super::table::Measurement;
use super::{Found, Measured};
use crate::error::InputError;
use crate::physics::observable::Observable;
use crate::warning::Warning;
use series::{Dipole, strangers};

/// Rows on each side of a pair from which the flat is estimated.
const NEAR_ROWS: usize = 10;
/// Minimum deviation of each pixel of a pair from the flat, relative to that of their half difference.
const EACH: f64 = 0.5;

/// How dipoles are measured.
#[derive(Clone, Debug)]
pub struct Dipoles {
    /// Detection threshold of a pair, in sigma of its noise.
    pub threshold_sigma: f64,
    /// Number of frames in which a dipole must be found; one, if there are no more.
    pub found_in: usize,
    /// The species of the traps, by its name in the mission, for the header.
    pub species: Option<String>,
}

impl Default for Dipoles {
    fn default() -> Dipoles {
        Dipoles { threshold_sigma: 6.0, found_in: 2, species: None }
    }
}

/// Amplifier, and row and column of the pixel of a pair nearer the register.
type Place = (usize, usize, usize, usize);

impl Dipoles {
    /// Measures the dipoles of all frames, which are read twice. `progress` is given the number of files done.
    ///
    /// # Errors
    /// If frames cannot be read as described, phase time or cycles are not given, or no dipole is found.
    pub fn measure(&self, frames: &Frames, progress: &dyn Fn(usize)) -> Result<Measured, InputError> {
        let mut found = Found::of(frames)?;
        // Number of detections of a pair with its bright pixel nearer the register, minus those with it further away.
        let mut seen: HashMap<Place, (usize, i64)> = HashMap::new();
        let mut of_sensor: HashMap<(usize, usize), usize> = HashMap::new();
        frames.each(progress, |exposure| {
            *of_sensor.entry((exposure.about.hdu, exposure.about.amplifier)).or_default() += 1;
            for (place, half) in self.pairs(&exposure) {
                let times = seen.entry(place).or_default();
                *times = (times.0 + 1, times.1 + half);
            }
            Ok(())
        })?;
        let candidates = seen.len();
        let enough = |place: &Place| self.found_in.min(of_sensor[&(place.0, place.1)]);
        // The same sign in the majority of the frames.
        seen.retain(|place, (times, halves)| *times >= enough(place) && 2 * halves.unsigned_abs() as usize > *times);
        let dipoles: BTreeMap<Place, i64> =
            seen.into_iter().map(|(place, (_, halves))| (place, halves.signum())).collect();
        found.count("dipoles", dipoles.len());
        found.count("candidates_not_repeated", candidates - dipoles.len());
        let mut rows: Vec<(Place, Measurement)> = Vec::new();
        frames.each(progress, |exposure| {
            let sensor = (exposure.about.hdu, exposure.about.amplifier);
            let here = dipoles.iter().filter(|(place, _)| (place.0, place.1) == sensor);
            for (place, half) in here {
                match measured(&exposure, *place, *half)? {
                    Some(row) => rows.push((*place, row)),
                    None => found.count("dipoles_hit", 1),
                }
            }
            found.exposures.push(exposure.about);
            Ok(())
        })?;
        leave_strangers_out(&mut rows, &mut found);
        if rows.is_empty() {
            return Err(self.nothing(candidates));
        }
        // Sorted by dipole.
        rows.sort_by_key(|(place, _)| *place);
        let options = json!({
            "threshold_sigma": self.threshold_sigma, "found_in": self.found_in,
            "geometry": super::geometry_json(&frames.reading),
        });
        let rows = rows.into_iter().map(|(_, row)| row).collect();
        let mut measured = found.measured("dipoles", options, vec![(Observable::PumpingDipole, rows)]);
        if let Some(species) = &self.species {
            measured.say("species", species);
        }
        Ok(measured)
    }

    fn nothing(&self, candidates: usize) -> InputError {
        let problem = format!(
            "{candidates} pairs of pixels stand out beyond {} sigma, none of them in {} frames",
            self.threshold_sigma, self.found_in
        );
        InputError::new("no dipoles can be measured", problem)
            .with_help("give frames of other phase times, a lower --threshold-sigma or a smaller --found-in")
    }

    /// Significant pairs of a frame, with +1 if the bright pixel is nearer the register, otherwise -1.
    fn pairs(&self, exposure: &Exposure) -> HashSet<(Place, i64)> {
        let Some(noise_e) = noise(exposure) else { return HashSet::new() };
        let about = &exposure.about;
        // For half the difference of two pixels.
        let least_e = self.threshold_sigma * noise_e / 2_f64.sqrt();
        let mut pairs = HashSet::new();
        for column in exposure.columns.clone() {
            let half_e = |row: usize| 0.5 * (exposure.charge_e[[row, column]] - exposure.charge_e[[row + 1, column]]);
            for row in 1..exposure.rows.saturating_sub(2) {
                let size_e = half_e(row).abs();
                // Of overlapping pairs the most significant one.
                let is_largest = size_e > half_e(row - 1).abs() && size_e >= half_e(row + 1).abs();
                if size_e > least_e && is_largest && is_dipole(exposure, row, column, half_e(row)) {
                    pairs.insert(((about.hdu, about.amplifier, row, column), half_e(row).signum() as i64));
                }
            }
        }
        pairs
    }
}

/// Largest time between exposures of a series, days: irradiation and annealing change a trap within months.
const SERIES_DAYS: f64 = 10.0;

/// Largest difference of temperatures in a series, K: a release time changes by 10 to 20 % with a kelvin, E/kT² of some 0.1 to 0.2
/// at 150 K.
const SERIES_K: f64 = 1.0;

/// Exposures of one series, by their indices: of one amplifier, one date and one temperature.
fn all_series(exposures: &[About]) -> Vec<Vec<usize>> {
    let mut all: Vec<Vec<usize>> = Vec::new();
    let is_alike = |one: &About, other: &About| {
        let warmer = one.temperature_k.unwrap_or(0.0) - other.temperature_k.unwrap_or(0.0);
        (one.hdu, one.amplifier) == (other.hdu, other.amplifier)
            && warmer.abs() <= SERIES_K
            && one.when.is_near(other.when, SERIES_DAYS)
    };
    for (index, about) in exposures.iter().enumerate() {
        match all.iter_mut().find(|series| is_alike(&exposures[series[0]], about)) {
            Some(series) => series.push(index),
            None => all.push(vec![index]),
        }
    }
    all
}

/// Takes out the rows of frames that are not of their pumping series, with a warning for each.
fn leave_strangers_out(rows: &mut Vec<(Place, Measurement)>, found: &mut Found) {
    for series in all_series(&found.exposures) {
        let abouts: Vec<&About> = series.iter().map(|index| &found.exposures[*index]).collect();
        let frames: HashMap<usize, usize> =
            abouts.iter().enumerate().map(|(frame, about)| (about.number, frame)).collect();
        let frame_of = |row: &Measurement| {
            let number = row.from.iter().find(|(name, _)| *name == "exposure").map(|(_, number)| *number);
            frames.get(&number.expect("a row has its exposure")).copied()
        };
        let mut dipoles: BTreeMap<Place, Dipole> = BTreeMap::new();
        for (place, row) in rows.iter() {
            let Some(frame) = frame_of(row) else { continue };
            dipoles.entry(*place).or_insert_with(|| vec![None; series.len()])[frame] = Some((row.value, row.sigma));
        }
        let pumped = |about: &&About| Some((about.phase_time_ms?, about.cycles?));
        let Some(pumped) = abouts.iter().map(pumped).collect::<Option<Vec<(f64, f64)>>>() else { continue };
        let dipoles: Vec<Dipole> = dipoles.into_values().collect();
        let out = strangers(&pumped, &dipoles);
        rows.retain(|(_, row)| !frame_of(row).is_some_and(|frame| out.iter().any(|stranger| stranger.frame == frame)));
        let warnings = out.iter().map(|stranger| {
            let (phase_time_ms, cycles) = pumped[stranger.frame];
            Warning::NotOfSeries { name: abouts[stranger.frame].place(), times: stranger.times, phase_time_ms, cycles }
        });
        let warnings: Vec<Warning> = warnings.collect();
        if !warnings.is_empty() {
            found.count("frames_left_out", warnings.len());
        }
        found.warnings.extend(warnings);
    }
}

/// Noise of a pixel of the flat, e-, from successive pixels in a column.
fn noise(exposure: &Exposure) -> Option<f64> {
    let image = exposure.charge_e.slice(s![..exposure.rows, exposure.columns.clone()]);
    let (below, above) = (image.slice(s![..-1, ..]), image.slice(s![1.., ..]));
    let differences: Vec<f64> = below.iter().zip(above).map(|(below, above)| above - below).collect();
    Some((robust_scatter(&differences)? / 2_f64.sqrt()).max(exposure.about.quantum_e))
}

/// Charge of the flat near a pair, e-.
fn flat(exposure: &Exposure, row: usize, column: usize) -> Option<f64> {
    let rows = row.saturating_sub(NEAR_ROWS)..(row + NEAR_ROWS + 2).min(exposure.rows);
    median(rows.filter(|near| *near != row && *near != row + 1).map(|near| exposure.charge_e[[near, column]]).collect())
}

/// Whether one pixel is above the flat and the other below, each by at least half of the expected amount. This excludes hot pixels,
/// dark ones and cosmic rays.
fn is_dipole(exposure: &Exposure, row: usize, column: usize, half_e: f64) -> bool {
    let Some(flat_e) = flat(exposure, row, column) else { return false };
    let near = half_e.signum() * (exposure.charge_e[[row, column]] - flat_e);
    let far = -half_e.signum() * (exposure.charge_e[[row + 1, column]] - flat_e);
    near.min(far) > EACH * half_e.abs()
}

/// The intensity of a dipole in a frame; None if a pixel has no value, or the sum of the pair is not that of two pixels of the
/// flat, as after a cosmic ray or on a hot pixel.
fn measured(exposure: &Exposure, (_, _, row, column): Place, half: i64) -> Result<Option<Measurement>, InputError> {
    let about = &exposure.about;
    let needed = |value: Option<f64>, what: &str, option: &str, keyword: &str| {
        value.ok_or_else(|| {
            InputError::new(about.place(), format!("{what} is not given"))
                .with_help(format!("give --{option}, or --{keyword} with the keyword of the header that holds it"))
        })
    };
    let phase_time_ms =
        needed(about.phase_time_ms, "the phase time of the pumping", "phase-time-ms", "phase-time-keyword")?;
    let cycles = needed(about.cycles, "the number of pumping cycles", "cycles", "cycles-keyword")?;
    if row + 1 >= exposure.rows || !exposure.columns.contains(&column) {
        return Ok(None);
    }
    let (Some(noise_e), Some(flat_e)) = (noise(exposure), flat(exposure, row, column)) else { return Ok(None) };
    let [near_e, far_e] = [row, row + 1].map(|row| exposure.charge_e[[row, column]]);
    if (near_e + far_e - 2.0 * flat_e).abs() > CLIP_SIGMA * 2_f64.sqrt() * noise_e {
        return Ok(None);
    }
    let value = 0.5 * half as f64 * (near_e - far_e);
    let pumped = value.clamp(0.0, cycles);
    let row = Measurement {
        conditions: vec![
            ("row_px", row as f64),
            ("column_px", column as f64),
            ("half", half as f64),
            ("flat_e", flat_e),
            ("phase_time_ms", phase_time_ms),
            ("pumping_cycles", cycles),
        ],
        when: about.when,
        temperature_k: about.temperature_k,
        line_time_ms: about.line_time_ms,
        value,
        sigma: (0.5 * noise_e * noise_e + pumped * (1.0 - pumped / cycles)).sqrt(),
        common: None,
        from: [vec![("exposure", about.number)], about.sensor()].concat(),
    };
    Ok(value.is_finite().then_some(row))
}
