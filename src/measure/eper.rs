//! Extended pixel edge response and first pixel response of flat fields.
//!
//! A flat field fills all rows of the image. Its last row is followed by overscan rows, which contain the charge that traps release
//! behind it: the mean over columns of the charge in overscan row k, above the bias, is the edge response in pixel k. The level of
//! the flat is that of its last rows, where capture and release are in balance: it is the charge before transfer.
//!
//! The first row of the flat is the first packet that meets the traps between the frame and the register, and loses charge to them
//! like a lone packet: the first pixel response.
//!
//! Source: Janesick 2001, Scientific Charge-Coupled Devices, section 5.2 (edge response, first pixel response).

use std::ops::Range;

use serde_json::json;

use super::bias::{BiasSource, Line};
use super::edge::{Block, Edge};
use super::exposure::{About, Exposure, Frames};
use super::statistic::{Mean, median};
use super::table::Measurement;
use super::{Found, Measured};
use crate::error::InputError;
use crate::image::Geometry;
use crate::numeric::root_finding::between;
use crate::physics::observable::Observable;
use crate::warning::Warning;

/// Default maximum number of rows measured behind the edge.
const MOST_TRAIL_PX: usize = 50;
/// Default number of rows for the level: this number, or this fraction of the image.
const LEVEL_ROWS: usize = 20;
const LEVEL_SHARE: usize = 4;
/// Maximum charge in the row behind an edge, relative to the flat.
const MOST_BEHIND: f64 = 0.5;
/// Minimum charge of the last rows of a flat field, relative to the median of all.
const LEAST_AT_END: f64 = 0.5;
/// Significance, sigma, at which a trail in the rows of the bias is distinguished from noise.
const TRAIL_SIGMA: f64 = 3.0;

/// Significance, sigma, of a level behind an edge.
const LEVEL_SIGMA: f64 = 4.0;
/// What is left of a trail in the last quarter of the overscan rows, relative to the one before, at most.
const LEAST_FALL: f64 = 0.6;

/// Least and largest ratio of a decay from window to window.
const FASTEST: f64 = 1e-3;
const SLOWEST: f64 = 0.95;

/// Options of the measurement.
#[derive(Clone, Debug, Default)]
pub struct Eper {
    /// Rows behind the edge; none: all those not needed for the bias, up to 50.
    pub trail_px: Option<usize>,
    /// Number of last rows of the flat averaged for its level; none: 20, or a quarter of the image.
    pub level_rows: Option<usize>,
    /// Groups of columns, by the level of the flat.
    pub groups: usize,
    /// Whether the first pixel response is also requested.
    pub first_pixel: bool,
    /// CTI is also requested: from the charge in these pixels behind the edge, first and last; empty: pixel 1, 2 to 3, 4 to 7, ...
    pub cti_px: Option<Vec<(usize, usize)>>,
}

impl Eper {
    /// Measures the edges of all frames. `progress` is given the number of files done.
    ///
    /// # Errors
    /// If the frames have no or too few overscan rows, or cannot be read as described.
    pub fn measure(&self, frames: &Frames, progress: &dyn Fn(usize)) -> Result<Measured, InputError> {
        let mut found = Found::of(frames)?;
        let (mut edges, mut first, mut cti) = (Vec::new(), Vec::new(), Vec::new());
        let (mut level_rows, mut trail_px) = (0, 0);
        frames.each(progress, |exposure| {
            let (source, geometry) = (exposure.about.bias.source, exposure.about.geometry);
            let block = self.block(&exposure, self.rows_behind(source, &geometry)?)?;
            let ranges = self.cti_px.as_ref().map(|given| ranges(given, block.trail_px)).transpose()?;
            (level_rows, trail_px) = (block.level_rows, trail_px.max(block.trail_px));
            let groups = block.groups(&exposure, self.groups.max(1));
            let columns = exposure.columns.len();
            found.count("columns_used", groups.iter().map(Vec::len).sum());
            found.count("columns_rejected", columns - groups.iter().map(Vec::len).sum::<usize>());
            let all: Vec<usize> = exposure.columns.clone().collect();
            let trail = bias_rows(source, &exposure, &geometry).and_then(|rows| {
                let free = rows.start - exposure.rows;
                trail_in_bias(&exposure, &[rows], free, &all)
            });
            let bias_sigma_e = exposure.about.bias_sigma_e().hypot(trail.as_ref().map_or(0.0, |trail| trail.left_e));
            for columns in groups {
                let edge = block.edge(&exposure, &columns, 0.0).ok_or_else(|| no_edge(&exposure.about))?;
                is_edge(&exposure, &columns, &edge)?;
                if edge.is_sloped {
                    let share = edge.first_signal.value / edge.signal.value - 1.0;
                    found.warnings.push(Warning::SlopedFlat { name: exposure.about.place(), share });
                }
                edges.extend(behind(&exposure, &edge, bias_sigma_e));
                first.push(first_pixel(&exposure, &edge));
                let of_range = |range: &(usize, usize)| lost(&exposure, &edge, *range, bias_sigma_e);
                cti.extend(ranges.iter().flatten().filter_map(of_range));
            }
            found.warnings.extend(bent_bias(&exposure.about));
            found.warnings.extend(trail.map(|trail| trail.warning(&exposure.about)));
            if source != BiasSource::OverscanRows {
                found.warnings.extend(level_behind(&exposure, &all));
            }
            found.exposures.push(exposure.about);
            Ok(())
        })?;
        for row in &edges {
            found.count_pixels(row);
        }
        let options = json!({
            "trail_px": trail_px, "level_rows": level_rows, "column_groups": self.groups.max(1),
            "geometry": super::geometry_json(&frames.reading),
        });
        let mut tables = vec![(Observable::Eper, edges)];
        if self.first_pixel {
            tables.push((Observable::PacketCharge, first));
        }
        if self.cti_px.is_some() {
            tables.push((Observable::Cti, cti));
        }
        Ok(found.measured("eper", options, tables))
    }

    /// Number of rows measured behind the edge.
    fn rows_behind(&self, source: BiasSource, geometry: &Geometry) -> Result<usize, InputError> {
        let free = source.first_overscan_row(geometry).unwrap_or(geometry.overscan_rows);
        let refused = |wanted: usize| InputError::new("cannot measure an edge", format!("{wanted} rows behind it"));
        if geometry.overscan_rows == 0 {
            return Err(InputError::new(
                "cannot measure an edge",
                "the frame has no rows behind the image by its options",
            )
            .with_help("give their number with --overscan-rows, or in the table of amplifiers"));
        }
        match self.trail_px {
            Some(wanted) if wanted > free => Err(InputError {
                problem: format!("{wanted} rows behind it were requested; {free} are there, less those of the bias"),
                help: Some("give a smaller --trail-px, or another bias with --bias-from or --bias-dn".into()),
                ..refused(wanted)
            }),
            Some(wanted) => Ok(wanted),
            None => Ok(free.min(MOST_TRAIL_PX)),
        }
    }

    fn block(&self, exposure: &Exposure, trail_px: usize) -> Result<Block, InputError> {
        let level_rows = self.level_rows.unwrap_or(LEVEL_ROWS.min(exposure.rows / LEVEL_SHARE).max(1));
        if level_rows > exposure.rows {
            let problem = format!("the image has {} rows, and its level was to be that of {level_rows}", exposure.rows);
            return Err(InputError::new(exposure.about.place(), problem).with_help("give a smaller --level-rows"));
        }
        Ok(Block { rows: 0..exposure.rows, level_rows, trail_px })
    }
}

/// The rows of a table for the charges behind an edge, with an error of the bias, e-.
fn behind(exposure: &Exposure, edge: &Edge, bias_sigma_e: f64) -> Vec<Measurement> {
    let about = &exposure.about;
    let trail = edge.trail.iter().enumerate().filter_map(|(index, mean)| Some((index + 1, (*mean)?)));
    let row = |(trail_px, mean): (usize, Mean)| Measurement {
        common: with_bias(about, bias_sigma_e),
        conditions: vec![
            ("trail_px", trail_px as f64),
            ("signal_e", edge.signal.value),
            ("sigma_signal_e", edge.signal.sigma.hypot(bias_sigma_e)),
            ("background_e", 0.0),
            ("block_px", exposure.rows as f64),
            ("transfers", (exposure.rows + about.rows_before() as usize) as f64),
        ],
        ..of(about, mean.value, mean.sigma.hypot(bias_sigma_e), mean)
    };
    trail.map(row).collect()
}

/// Pixels behind an edge for the CTI. By default each range is twice as long as the previous one: trails fade, and ranges do not
/// overlap, so that only the error of the bias is common to rows.
fn ranges(given: &[(usize, usize)], trail_px: usize) -> Result<Vec<(usize, usize)>, InputError> {
    if let Some((first, last)) = given.iter().find(|(first, last)| !(1..=*last).contains(first) || *last > trail_px) {
        let problem = format!("pixels {first} to {last}; {trail_px} rows behind the edge are measured, from 1");
        return Err(InputError::new("cannot measure CTI", problem)
            .with_help("give other --cti-px, such as 1-2, or a larger --trail-px"));
    }
    if !given.is_empty() {
        return Ok(given.to_vec());
    }
    let starts = std::iter::successors(Some(1), |first| Some(2 * first)).take_while(|first| *first <= trail_px);
    Ok(starts.map(|first| (first, (2 * first - 1).min(trail_px))).collect())
}

/// The row of a table for the CTI from the charge in some pixels behind an edge: that charge over the level of the flat and the
/// number of transfers (Janesick 2001, section 5.2), with an error of the bias, e-. None if one of the pixels has no value.
fn lost(exposure: &Exposure, edge: &Edge, (first, last): (usize, usize), bias_sigma_e: f64) -> Option<Measurement> {
    let about = &exposure.about;
    let pixels: Vec<Mean> = edge.trail[first - 1..last].iter().copied().collect::<Option<_>>()?;
    let charge_e: f64 = pixels.iter().map(|mean| mean.value).sum();
    let of_pixels_e = pixels.iter().map(|mean| mean.sigma * mean.sigma).sum::<f64>().sqrt();
    let transfers = (exposure.rows + about.rows_before() as usize) as f64;
    let signal_e = edge.signal.value;
    let value = charge_e / (signal_e * transfers);
    let own = (of_pixels_e / (signal_e * transfers)).hypot(value * edge.signal.sigma / signal_e);
    // A higher bias lowers all pixels and the level.
    let of_bias = bias_sigma_e * (pixels.len() as f64 - charge_e / signal_e).abs() / (signal_e * transfers);
    let all = Mean {
        used: pixels.iter().map(|mean| mean.used).sum(),
        rejected: pixels.iter().map(|mean| mean.rejected).sum(),
        ..pixels[0]
    };
    let conditions = vec![
        ("first_px", first as f64),
        ("last_px", last as f64),
        ("signal_e", signal_e),
        ("background_e", 0.0),
        ("block_px", exposure.rows as f64),
        ("transfers", transfers),
    ];
    Some(Measurement { conditions, common: with_bias(about, of_bias), ..of(about, value, own.hypot(of_bias), all) })
}

/// A part of an error that is common to the rows of an exposure, since it is from its bias.
fn with_bias(about: &About, sigma: f64) -> Option<(f64, usize)> {
    (sigma > 0.0).then_some((sigma, about.number))
}

/// The row of a table for the charge in the first row. Its error is that of its difference to the level, to which it is compared:
/// an error of the bias is the same in both.
fn first_pixel(exposure: &Exposure, edge: &Edge) -> Measurement {
    let (about, first) = (&exposure.about, edge.first);
    Measurement {
        conditions: vec![
            ("signal_e", edge.first_signal.value),
            ("sigma_signal_e", edge.first_signal.sigma),
            ("background_e", 0.0),
            ("transfers", f64::from(about.rows_before()) + 1.0),
        ],
        ..of(about, first.value, first.sigma, first)
    }
}

/// A row of a table with the data of an exposure, and no conditions yet.
pub(super) fn of(about: &About, value: f64, sigma: f64, mean: Mean) -> Measurement {
    Measurement {
        conditions: Vec::new(),
        when: about.when,
        temperature_k: about.temperature_k,
        line_time_ms: about.line_time_ms,
        value,
        sigma,
        common: None,
        from: [vec![("exposure", about.number)], about.sensor(), mean.pixels()].concat(),
    }
}

/// Overscan rows from which the bias is estimated, if any.
fn bias_rows(source: BiasSource, exposure: &Exposure, geometry: &Geometry) -> Option<Range<usize>> {
    Some(exposure.rows + source.first_overscan_row(geometry)?..exposure.charge_e.nrows())
}

/// A trail that has not ended in the rows of the zero level.
pub(super) struct TrailInBias {
    /// Charge per pixel of the trail in them, by which the level is too high, e-.
    pub left_e: f64,
    /// 1-sigma error of the level apart from that, e-.
    sigma_e: f64,
}

impl TrailInBias {
    pub fn warning(&self, about: &About) -> Warning {
        Warning::TrailInBias { name: about.place(), left_e: self.left_e, sigma_e: self.sigma_e }
    }
}

/// How much of a trail is in the rows of the zero level, by its decay in the `free` rows before them, as that of one exponential; None if
/// it is not significant. `rows`: those of the level, each behind as many free ones.
pub(super) fn trail_in_bias(
    exposure: &Exposure,
    rows: &[Range<usize>],
    free: usize,
    columns: &[usize],
) -> Option<TrailInBias> {
    let mean = |of: &dyn Fn(&Range<usize>) -> Range<usize>| exposure.mean(rows.iter().flat_map(of), columns);
    if free < 2 {
        return None;
    }
    // The first third of the free rows holds the trails of faster traps, too.
    let window = rows.first()?.len().min((free / 3).max(1));
    let back = |windows: usize| mean(&|rows| rows.start - windows * window..rows.start - (windows - 1) * window);
    let [level, near, far] = [mean(&Range::clone)?, back(1)?, back(2)?];
    let windows = rows.first()?.len() as f64 / window as f64;
    let left_e = left_of_decay([near, far].map(|mean| mean.value - level.value), windows);
    let reaches = near.value - level.value > TRAIL_SIGMA * near.sigma.hypot(level.sigma) && left_e > level.sigma;
    reaches.then_some(TrailInBias { left_e, sigma_e: level.sigma })
}

/// A level that the charge behind an edge ends at and that is not the bias: in the second half of the overscan rows, if it does not
/// fall there.
fn level_behind(exposure: &Exposure, columns: &[usize]) -> Option<Warning> {
    let end = exposure.charge_e.nrows();
    let (start, middle) = (exposure.rows + (end - exposure.rows) / 2, exposure.rows + 3 * (end - exposure.rows) / 4);
    let mean = |rows: Range<usize>| exposure.mean(rows, columns);
    let (near, far) = (mean(start..middle)?, mean(middle..end)?);
    // A trail that has not ended falls further.
    let stays = far.value - LEAST_FALL * near.value > far.sigma.hypot(LEAST_FALL * near.sigma);
    let half = mean(start..end)?;
    let (level_e, sigma_e) = (half.value, half.sigma.hypot(exposure.about.bias_sigma_e()));
    let is_level = level_e < -LEVEL_SIGMA * sigma_e || (level_e > LEVEL_SIGMA * sigma_e && stays);
    is_level.then(|| Warning::LevelBehindEdge { name: exposure.about.place(), level_e, sigma_e })
}

/// Mean of an exponential over some windows, given its excess over that mean in the window before them and in the one before that.
fn left_of_decay([near, far]: [f64; 2], windows: f64) -> f64 {
    // With a ratio x from window to window, the mean over the next ones, in units of the window before them.
    let mean = |x: f64| x * (1.0 - x.powf(windows)) / (windows * (1.0 - x));
    let excess = |x: f64| (1.0 / x - mean(x)) * near - (1.0 - mean(x)) * far;
    if near <= 0.0 || excess(FASTEST) <= 0.0 {
        return 0.0;
    }
    let ratio = if excess(SLOWEST) >= 0.0 { SLOWEST } else { between(FASTEST, SLOWEST, 1e-6, excess) };
    near * mean(ratio) / (1.0 - mean(ratio))
}

/// A bias that does not follow the line that is subtracted.
fn bent_bias(about: &About) -> Option<Warning> {
    let line = about.bias.line.filter(Line::is_bent)?;
    let [bend_dn, sigma_dn] = line.bend_dn;
    Some(Warning::BentBias { name: about.place(), bend_dn, sigma_dn })
}

fn no_edge(about: &About) -> InputError {
    InputError::new(about.place(), "too few columns of the image have values: five are needed at least")
        .with_help("give fewer --column-groups, or leave the frame out with --hdu")
}

/// Checks that the flat field is bright, and the rows behind it are not.
fn is_edge(exposure: &Exposure, columns: &[usize], edge: &Edge) -> Result<(), InputError> {
    let refused = |problem: String| {
        let error = InputError::new(exposure.about.place(), problem);
        Err(error.with_help("check --corner, --overscan-rows and the bias"))
    };
    let signal_e = edge.signal.value;
    let charges = columns.iter().flat_map(|column| (0..exposure.rows).map(|row| exposure.charge_e[[row, *column]]));
    if let Some(middle_e) = median(charges.collect()).filter(|middle_e| signal_e < LEAST_AT_END * middle_e) {
        return refused(format!(
            "the last rows of the image hold {signal_e:.1} e- above the bias, half of its pixels more than {middle_e:.1} e-: the flat \
             field ends before them"
        ));
    }
    if signal_e <= 0.0 {
        return refused(format!(
            "the last rows of the image hold {signal_e:.1} e- above the bias: this is not a flat field"
        ));
    }
    match edge.trail.first().copied().flatten() {
        Some(next) if next.value > MOST_BEHIND * signal_e => refused(format!(
            "the last rows of the image hold {signal_e:.1} e- above the bias, the row behind them {:.1} e-: this is not an edge",
            next.value
        )),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An exponential seen above its own mean in the rows of the level.
    #[test]
    fn what_is_left_of_a_decay_follows_from_the_rows_before() {
        for (ratio, windows) in [(0.1_f64, 1.0), (0.5, 1.0), (0.5, 3.0), (0.8, 2.0)] {
            // Two windows before, one before, and the mean over `windows` of them, of one exponential.
            let left = ratio.powi(2) * (1.0 - ratio.powf(windows)) / (windows * (1.0 - ratio));
            let found = left_of_decay([ratio - left, 1.0 - left], windows);
            assert!((found / left - 1.0).abs() < 0.01, "{found} {left}");
        }
        assert_eq!(left_of_decay([0.0, 1.0], 1.0), 0.0);
    }
}
