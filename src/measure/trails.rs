//! Trails behind warm and hot pixels.
//!
//! A warm pixel holds the same charge in every exposure of its date, in a single pixel surrounded by background: a lone packet at a
//! known position. If found in several exposures at the same position, it is not a cosmic ray (`find`).
//!
//! ```text
//! T(k) = [q(r + k, c) − q(r − k, c)] − median over columns near c of the same difference
//! ```
//!
//! is the charge in pixel k behind it. Trails are one-sided. Faint neighbours, halos and charge shared with neighbours are
//! symmetric, and cancel with the pixels in front. A background gradient along the columns cancels with the adjacent columns.
//! Trails are stacked in bins of signal, transfers and background; the error of a mean comes from the scatter between warm pixels
//! (`stack`).
//!
//! A value is T(k) over the charge before transfer, to first order the charge read in the pixel and in its trail.
//!
//! Source of the method: Massey et al. 2010, MNRAS 401, 371, section 3 (trails behind hot pixels).

mod find;
mod stack;

use std::collections::{BTreeMap, HashMap, HashSet};

use chrono::TimeDelta;
use serde_json::json;

use super::exposure::{About, Exposure, Frames, When};
use super::table::Measurement;
use super::{Found, Measured};
use crate::error::InputError;
use crate::physics::observable::Observable;
use crate::warning::Warning;
use find::{Cut, Search};
use stack::Bins;

/// Options of the measurement.
#[derive(Clone, Debug)]
pub struct Trails {
    /// Length of a trail, px.
    pub trail_px: usize,
    /// Minimum charge of a warm pixel above the background, e-.
    pub threshold_e: f64,
    /// Bins of signal and of background per decade.
    pub bins_per_decade: usize,
    /// Bins of transfers.
    pub transfer_bins: usize,
    /// Minimum number of warm pixels in a bin.
    pub fewest: usize,
    /// Exposures within this number of days of the previous one belong to one date.
    pub epoch_days: f64,
    /// Rows give the charge of the packet as read, not before transfer.
    pub signal_as_read: bool,
}

impl Default for Trails {
    fn default() -> Trails {
        Trails {
            trail_px: 15,
            threshold_e: 300.0,
            bins_per_decade: 4,
            transfer_bins: 3,
            fewest: 10,
            epoch_days: 10.0,
            signal_as_read: false,
        }
    }
}

/// Amplifier of an HDU: warm pixels are at the same position in all its exposures.
type Sensor = (usize, usize);
type Pixel = (usize, usize);

/// Candidate warm pixels of an exposure, with its data.
struct Seen {
    about: About,
    /// Rows of the image.
    rows: usize,
    pixels: HashSet<Pixel>,
}

/// A copy of an exposure would show each of its cosmic rays twice.
fn refuse_repeated(about: &About, seen: &[Seen]) -> Result<(), InputError> {
    let same = seen.iter().find(|seen| {
        (seen.about.hdu, seen.about.amplifier, seen.about.fingerprint)
            == (about.hdu, about.amplifier, about.fingerprint)
    });
    match same {
        None => Ok(()),
        Some(seen) => {
            let problem = format!("it holds the same charges as {}", seen.about.place());
            Err(InputError::new(about.place(), problem).with_help(
                "give each exposure once: a pixel is warm, and not hit by a cosmic ray, if two exposures show it",
            ))
        }
    }
}

impl Trails {
    /// Measures the trails of all frames, which are read twice. `progress` is given the number of files done.
    ///
    /// # Errors
    /// If frames cannot be read as described, or no or too few warm pixels are found.
    pub fn measure(&self, frames: &Frames, progress: &dyn Fn(usize)) -> Result<Measured, InputError> {
        let search = Search { trail_px: self.trail_px, threshold_e: self.threshold_e };
        let mut found = Found::of(frames)?;
        let mut seen: Vec<Seen> = Vec::new();
        frames.each(progress, |exposure| {
            refuse_repeated(&exposure.about, &seen)?;
            let pixels = search.candidates(&exposure, &mut found);
            seen.push(Seen { about: exposure.about, rows: exposure.rows, pixels });
            Ok(())
        })?;
        let epochs = self.epochs(&seen);
        let warm = warm_pixels(&seen, &epochs, &mut found);
        let mut cuts: BTreeMap<usize, Vec<Cut>> = BTreeMap::new();
        let mut index = 0;
        frames.each(progress, |exposure: Exposure| {
            let sensor = (exposure.about.hdu, exposure.about.amplifier);
            let of_epoch = warm.get(&(epochs[index], sensor));
            let here = seen[index].pixels.iter().filter(|pixel| of_epoch.is_some_and(|warm| warm.contains(pixel)));
            let mut pixels: Vec<Pixel> = here.copied().collect();
            pixels.sort_unstable();
            let trails = pixels.into_iter().filter_map(|pixel| search.cut(&exposure, pixel));
            cuts.entry(epochs[index]).or_default().extend(trails);
            index += 1;
            Ok(())
        })?;
        found.count("trails_cut", cuts.values().map(Vec::len).sum());
        let rows = self.stacked(&seen, &epochs, cuts, &mut found);
        if rows.is_empty() {
            return Err(self.nothing(&found));
        }
        found.exposures = seen.into_iter().map(|seen| seen.about).collect();
        let options = json!({
            "trail_px": self.trail_px, "threshold_e": self.threshold_e, "bins_per_decade": self.bins_per_decade,
            "transfer_bins": self.transfer_bins, "fewest_px": self.fewest, "epoch_days": self.epoch_days,
            "mean": "mean over warm pixels within 5 sigma of their median",
            "signal": if self.signal_as_read { "charge read in the pixel" } else { "charge read in the pixel and in its trail" },
            "geometry": super::geometry_json(&frames.reading),
        });
        Ok(found.measured("trails", options, vec![(Observable::Trail, rows)]))
    }

    /// The date of each exposure, numbered.
    fn epochs(&self, seen: &[Seen]) -> Vec<usize> {
        let mut order: Vec<usize> = (0..seen.len()).collect();
        let key = |index: &usize| seen[*index].about.when.order();
        order.sort_by(|a, b| key(a).0.cmp(&key(b).0).then(key(a).1.total_cmp(&key(b).1)));
        let mut epochs = vec![0; seen.len()];
        for pair in order.windows(2) {
            let [before, after] = [pair[0], pair[1]].map(|index| seen[index].about.when);
            epochs[pair[1]] = epochs[pair[0]] + usize::from(!before.is_near(after, self.epoch_days));
        }
        epochs
    }

    /// The rows of the table, date by date.
    fn stacked(
        &self,
        seen: &[Seen],
        epochs: &[usize],
        cuts: BTreeMap<usize, Vec<Cut>>,
        found: &mut Found,
    ) -> Vec<Measurement> {
        let before = |seen: &Seen| f64::from(seen.about.rows_before());
        let least = seen.iter().map(before).fold(f64::INFINITY, f64::min);
        let most = seen.iter().map(|seen| before(seen) + seen.rows as f64).fold(0.0, f64::max);
        let bins = Bins {
            per_decade: self.bins_per_decade,
            transfers: (least, most, self.transfer_bins),
            // Only a table states that they are different detectors.
            amplifiers_apart: seen.iter().any(|seen| seen.about.amplifier_name.is_some()),
        };
        let mut table = Vec::new();
        for (epoch, cuts) in cuts {
            let abouts: Vec<&About> =
                seen.iter().zip(epochs).filter(|(_, known)| **known == epoch).map(|(seen, _)| &seen.about).collect();
            for bin in bins.sorted(cuts) {
                match stack::stack(&bin, self.fewest, self.trail_px) {
                    Some(trail) => {
                        let here = |about: &&About| (about.hdu, about.amplifier) == (bin[0].place.0, bin[0].place.1);
                        let apart = bins.amplifiers_apart;
                        let abouts: Vec<&About> =
                            abouts.iter().copied().filter(|about| !apart || here(about)).collect();
                        table.extend(trail.rows(&abouts, self.signal_as_read));
                    }
                    None => found.count("trails_in_small_bins", bin.len()),
                }
            }
        }
        for row in &table {
            found.count_pixels(row);
        }
        table
    }

    fn nothing(&self, found: &Found) -> InputError {
        let count = |name: &str| found.counts.iter().find(|(known, _)| *known == name).map_or(0, |(_, count)| *count);
        let problem = format!(
            "{} pixels above {} e- are isolated, {} of them in too few exposures; no bin holds {} warm pixels",
            count("candidates"),
            self.threshold_e,
            count("candidates_not_repeated"),
            self.fewest
        );
        InputError::new("no trails can be measured", problem).with_help(
            "give more exposures of the same date, a lower --threshold-e, a smaller --trail-px, fewer bins, or --fewest-px",
        )
    }
}

/// Warm pixels of each date and sensor: those seen in at least two of three exposures, and in two if there are several.
fn warm_pixels(seen: &[Seen], epochs: &[usize], found: &mut Found) -> HashMap<(usize, Sensor), HashSet<Pixel>> {
    let mut times: HashMap<(usize, Sensor), (usize, HashMap<Pixel, usize>)> = HashMap::new();
    for (seen, epoch) in seen.iter().zip(epochs) {
        let (exposures, pixels) = times.entry((*epoch, (seen.about.hdu, seen.about.amplifier))).or_default();
        *exposures += 1;
        for pixel in &seen.pixels {
            *pixels.entry(*pixel).or_default() += 1;
        }
    }
    let mut warm = HashMap::new();
    for (key, (exposures, pixels)) in times {
        if exposures == 1 {
            found.warnings.push(Warning::OneExposure);
        }
        let needed = (2 * exposures).div_ceil(3);
        let (repeated, single): (Vec<_>, Vec<_>) = pixels.into_iter().partition(|(_, times)| *times >= needed);
        found.count("warm_pixels", repeated.len());
        found.count("candidates_not_repeated", single.len());
        warm.insert(key, repeated.into_iter().map(|(pixel, _)| pixel).collect());
    }
    warm
}

impl When {
    /// Sort key of exposures: kinds are separated.
    fn order(self) -> (u8, f64) {
        match self {
            When::Date(date) => (0, date.and_utc().timestamp() as f64),
            When::Since(t_yr) => (1, t_yr),
            When::Dose(dose_mev_g, _) => (2, dose_mev_g),
        }
    }

    /// Whether two exposures belong to one date; exposures with a dose do if it is the same.
    pub(super) fn is_near(self, other: When, days: f64) -> bool {
        match (self, other) {
            (When::Date(one), When::Date(other)) => (one - other).abs().as_seconds_f64() <= days * 86_400.0,
            (one, other) => one == other,
        }
    }

    /// The mean time of several exposures of one date.
    pub(super) fn mean(times: &[When]) -> When {
        let first = times[0];
        let When::Date(start) = first else { return first };
        let since = |when: &When| if let When::Date(date) = when { (*date - start).as_seconds_f64() } else { 0.0 };
        let mean_s = times.iter().map(since).sum::<f64>() / times.len() as f64;
        When::Date(start + TimeDelta::seconds(mean_s.round() as i64))
    }
}
