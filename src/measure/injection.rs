//! Charge-injection blocks: periodic blocks of rows of injected charge, with empty rows between them.
//!
//! Behind each block is the trail of an edge, as behind a flat field ([`super::edge`]). Its first row is the packet that meets the
//! traps in the state left by those before. The zero level is the mean of the last rows of the gap behind a block, where its trail
//! has ended, or of the rows in front of the first block, which have lost charge if rows before them are empty. The charge of the
//! block is the mean of its last rows, where capture and release are in balance.
//!
//! If their rows are not given, blocks are found by their brightness: rows whose median is above half of the brightest. Traps that
//! hold charge for longer than the gap are partly filled by the block ahead: its charge, and how many rows it is ahead, are conditions
//! of the rows (`preceding_e`, `preceding_px`).

use std::ops::Range;

use serde_json::json;

use super::edge::{Block, Edge};
use super::eper::{of, trail_in_bias};
use super::exposure::{Exposure, Frames};
use super::statistic::{Mean, median};
use super::table::Measurement;
use super::{Found, Measured};
use crate::error::InputError;
use crate::physics::observable::Observable;

/// The zero level is measured in the last nth part of a gap between blocks.
const GAP_SHARE: usize = 4;

/// Positions of the blocks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pattern {
    /// First row of the first block, from 0, in the order of readout.
    pub first_row: usize,
    /// Number of rows of a block.
    pub block_px: usize,
    /// Rows from the first of a block to the first of the next.
    pub period_px: usize,
}

/// Options of the measurement.
#[derive(Clone, Debug, Default)]
pub struct Injection {
    /// Positions of the blocks; none: they are searched in each exposure.
    pub pattern: Option<Pattern>,
    /// Rows behind a block; none: all those not needed for the zero level.
    pub trail_px: Option<usize>,
    /// Number of last rows of a block averaged for its charge; none: half of them.
    pub level_rows: Option<usize>,
    /// Groups of columns, by their charge.
    pub groups: usize,
    /// Whether the zero level is that of the rows in front of the first block, not of the last quarter of each gap.
    pub in_front: bool,
    /// Whether the charge of the first rows is also requested.
    pub first_pixel: bool,
}

/// The blocks of an exposure, in the order of readout.
struct Blocks {
    rows: Vec<Range<usize>>,
    /// Rows of the zero level, for each.
    empty: Vec<Range<usize>>,
    /// Rows of a gap that are not used for it.
    free: usize,
    trail_px: usize,
}

impl Injection {
    /// Measures the blocks of all frames. `progress` is given the number of files done.
    ///
    /// # Errors
    /// If frames cannot be read as described, or contain no blocks.
    pub fn measure(&self, frames: &Frames, progress: &dyn Fn(usize)) -> Result<Measured, InputError> {
        let mut found = Found::of(frames)?;
        let (mut edges, mut first) = (Vec::new(), Vec::new());
        let mut zero_levels = 0;
        frames.each(progress, |exposure| {
            let blocks = self.blocks(&exposure)?;
            found.count("blocks", blocks.rows.len());
            let all: Vec<usize> = exposure.columns.clone().collect();
            let in_gaps = blocks.empty.as_slice();
            let trail = if self.in_front { None } else { trail_in_bias(&exposure, in_gaps, blocks.free, &all) };
            // One value for all blocks: the level of each has an error that is also that of its values.
            let background = exposure.mean(in_gaps.iter().flat_map(Range::clone), &all);
            let background_e = background.map_or(0.0, |mean| mean.value.max(0.0));
            // Charge of the block ahead, for each group of columns, and its last row.
            let mut ahead: Option<(Vec<Option<f64>>, usize)> = None;
            for (number, (rows, empty)) in blocks.rows.iter().zip(&blocks.empty).enumerate() {
                let level_rows = self.level_rows.unwrap_or(rows.len().div_ceil(2)).min(rows.len());
                let block = Block { rows: rows.clone(), level_rows, trail_px: blocks.trail_px };
                let groups = block.groups(&exposure, self.groups.max(1));
                let used: usize = groups.iter().map(Vec::len).sum();
                found.count("columns_used", used);
                found.count("columns_rejected", exposure.columns.len() - used);
                let mut here = vec![None; groups.len()];
                for (group, columns) in groups.into_iter().enumerate() {
                    let measured = exposure
                        .mean(empty.clone(), &columns)
                        .and_then(|base| Some((base, block.edge(&exposure, &columns, base.value)?)));
                    let Some((base, edge)) = measured else { continue };
                    here[group] = Some(edge.signal.value);
                    let preceding =
                        ahead.as_ref().and_then(|(charges_e, last)| Some((charges_e[group]?, rows.start - last)));
                    // In front of the first block, one level for all. What is left of the trails is alike in all gaps.
                    let level = match &trail {
                        Some(_) => 0,
                        None if self.in_front => group,
                        None => number * here.len() + group,
                    };
                    let left_e = trail.as_ref().map_or(0.0, |trail| trail.left_e);
                    let base = (Mean { sigma: base.sigma.hypot(left_e), ..base }, zero_levels + level + 1);
                    let place = Place { exposure: &exposure, rows, number: number + 1, base, background_e, preceding };
                    edges.extend(place.behind(&edge));
                    first.push(place.first(&edge));
                }
                ahead = Some((here, rows.end - 1));
            }
            zero_levels += blocks.rows.len() * self.groups.max(1);
            found.warnings.extend(trail.map(|trail| trail.warning(&exposure.about)));
            found.exposures.push(exposure.about);
            Ok(())
        })?;
        if edges.is_empty() {
            let problem = "no block has five columns with values";
            return Err(InputError::new("no injected charge can be measured", problem)
                .with_help("check --first-row, --block-px and --period-px, or give fewer --column-groups"));
        }
        for row in &edges {
            found.count_pixels(row);
        }
        let options = json!({
            "pattern": self.pattern.map(|pattern| json!({
                "first_row": pattern.first_row, "block_px": pattern.block_px, "period_px": pattern.period_px,
            })),
            "trail_px": self.trail_px, "level_rows": self.level_rows, "column_groups": self.groups.max(1),
            "background": if self.in_front { "rows in front of the first block" } else { "last quarter of the gap behind each block" },
            "geometry": super::geometry_json(&frames.reading),
        });
        let mut tables = vec![(Observable::Eper, edges)];
        if self.first_pixel {
            tables.push((Observable::PacketCharge, first));
        }
        Ok(found.measured("injection", options, tables))
    }

    /// The blocks of an exposure.
    fn blocks(&self, exposure: &Exposure) -> Result<Blocks, InputError> {
        let refused = |problem: String| {
            InputError::new(exposure.about.place(), problem)
                .with_help("give --first-row, --block-px and --period-px, in the order of readout")
        };
        let rows = match self.pattern {
            Some(pattern) => pattern.blocks(exposure.rows),
            None => bright_rows(exposure),
        };
        let Some(first) = rows.first() else { return Err(refused("there are no blocks of bright rows".into())) };
        if let Some(other) = rows.iter().find(|block| block.len() != first.len()) {
            let problem = format!("blocks differ: rows {}, but rows {}", words(first), words(other));
            return Err(refused(problem));
        }
        let gaps = gaps(&rows, exposure.rows);
        // The end of the image may truncate the gap behind the last block.
        let is_cut = gaps.len() > 1 && 2 * gaps[gaps.len() - 1] < gaps[0];
        let whole = if is_cut { gaps.len() - 1 } else { gaps.len() };
        let (rows, gap) = (&rows[..whole], gaps[..whole].iter().copied().min().expect("one block at least"));
        if self.in_front && first.start == 0 {
            return Err(refused("there are no rows in front of the first block".into()));
        }
        let kept = if self.in_front { 0 } else { (gap / GAP_SHARE).max(1) };
        let free = gap - kept;
        let trail_px = self.trail_px.unwrap_or(free);
        if trail_px > free || free == 0 {
            let problem = format!("{gap} rows lie behind each block, {free} of them free for a trail of {trail_px}");
            return Err(refused(problem).with_help("give a smaller --trail-px, or --background-from front"));
        }
        let of_gap = |block: &Range<usize>| block.end + free..block.end + gap;
        let empty = rows.iter().map(|block| if self.in_front { 0..first.start } else { of_gap(block) }).collect();
        Ok(Blocks { rows: rows.to_vec(), empty, free, trail_px })
    }
}

impl Pattern {
    /// The blocks within a frame's rows, with the gaps behind them.
    fn blocks(self, rows: usize) -> Vec<Range<usize>> {
        let starts = (self.first_row..rows).step_by(self.period_px.max(1));
        starts.map(|start| start..start + self.block_px).filter(|block| block.end < rows).collect()
    }
}

/// Blocks of rows whose median is above half of the brightest, except one that reaches the last row of the image.
fn bright_rows(exposure: &Exposure) -> Vec<Range<usize>> {
    let of_row = |row: usize| {
        let charges = exposure.columns.clone().map(|column| exposure.charge_e[[row, column]]);
        median(charges.collect()).unwrap_or(f64::NAN)
    };
    let levels: Vec<f64> = (0..exposure.rows).map(of_row).collect();
    let half = 0.5 * levels.iter().copied().fold(0.0, f64::max);
    let mut blocks: Vec<Range<usize>> = Vec::new();
    for row in (0..exposure.rows).filter(|row| levels[*row] > half) {
        match blocks.last_mut() {
            Some(block) if block.end == row => block.end += 1,
            _ => blocks.push(row..row + 1),
        }
    }
    blocks.retain(|block| block.end < exposure.rows);
    blocks
}

/// Rows behind each block, to the next or to the end of the image.
fn gaps(blocks: &[Range<usize>], rows: usize) -> Vec<usize> {
    let ends = blocks.iter().skip(1).map(|block| block.start).chain([rows]);
    blocks.iter().zip(ends).map(|(block, end)| end - block.end).collect()
}

fn words(rows: &Range<usize>) -> String {
    format!("{} to {}", rows.start, rows.end - 1)
}

/// A block of an exposure.
struct Place<'a> {
    exposure: &'a Exposure,
    rows: &'a Range<usize>,
    number: usize,
    /// Zero level, e-, and its number among all.
    base: (Mean, usize),
    /// Charge of empty rows, e-.
    background_e: f64,
    /// Charge of the block ahead, e-, and how many rows its last one is ahead of the first of this one; None for the first block.
    preceding: Option<(f64, usize)>,
}

impl Place<'_> {
    /// The rows of a table for the charges behind it.
    fn behind(&self, edge: &Edge) -> Vec<Measurement> {
        let trail = edge.trail.iter().enumerate().filter_map(|(index, mean)| Some((index + 1, (*mean)?)));
        let row = |(trail_px, mean): (usize, Mean)| {
            let conditions = [("trail_px", trail_px as f64), ("block_px", self.rows.len() as f64)];
            let (base, number) = self.base;
            let row = self.row(conditions.to_vec(), edge, self.rows.end, mean);
            Measurement { sigma: mean.sigma.hypot(base.sigma), common: Some((base.sigma, number)), ..row }
        };
        trail.map(row).collect()
    }

    /// The row of a table for the charge in its first row. An error of the zero level is the same in the charge of the block, to which
    /// it is compared.
    fn first(&self, edge: &Edge) -> Measurement {
        self.row(Vec::new(), edge, self.rows.start + 1, edge.first)
    }

    fn row(&self, mut conditions: Vec<(&'static str, f64)>, edge: &Edge, row: usize, mean: Mean) -> Measurement {
        let about = &self.exposure.about;
        conditions.extend([
            ("signal_e", edge.signal.value),
            ("sigma_signal_e", edge.signal.sigma),
            ("background_e", self.background_e),
            ("transfers", (row + about.rows_before() as usize) as f64),
        ]);
        // No charge ahead of the first block: a packet of 0 e-, since all rows of a table have the same columns.
        let (preceding_e, preceding_px) = self.preceding.unwrap_or((0.0, self.rows.start.max(1)));
        conditions.extend([("preceding_e", preceding_e.max(0.0)), ("preceding_px", preceding_px as f64)]);
        let mut measured = of(about, mean.value, mean.sigma, mean);
        measured.from.insert(1, ("block", self.number));
        Measurement { conditions, ..measured }
    }
}
