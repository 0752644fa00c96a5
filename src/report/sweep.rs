//! `ctiplan sweep`.

use serde::ser::{Serialize, Serializer};

use super::{Report, counted, lines, table, wrapped};
use crate::sweep::{Done, Grid, Merged, Parts, Shard, Spread, Undefined};

/// The result of a sweep.
pub struct SweepReport<'a> {
    /// The grid.
    pub grid: &'a Grid,
    /// Its parts and its result.
    pub parts: &'a Parts<'a>,
    /// The part of the sweep that was computed, if not all of it.
    pub shard: Option<Shard>,
    /// The computation; None if parts were only merged.
    pub done: Option<Done>,
    /// The result; None if it already existed, or is to be merged by another process.
    pub merged: Option<Merged>,
}

/// A sweep in JSON.
#[derive(serde::Serialize)]
struct Document<'a> {
    sweep: &'a str,
    grid: &'a str,
    points: u64,
    shard: Option<String>,
    found_points: Option<u64>,
    computed_points: Option<u64>,
    output: String,
    complete: bool,
    points_without_result: Option<u64>,
    points_with_warnings: Option<u64>,
    outputs: Option<&'a [Spread]>,
}

impl Serialize for SweepReport<'_> {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        let (done, merged) = (self.done.as_ref(), self.merged.as_ref());
        let document = Document {
            sweep: &self.grid.fingerprint,
            grid: &self.grid.name,
            points: self.grid.points(),
            shard: self.shard.map(|shard| format!("{}/{}", shard.number, shard.of)),
            found_points: done.map(|done| done.found),
            computed_points: done.map(|done| done.computed),
            output: self.parts.result.display().to_string(),
            complete: self.parts.merged(),
            points_without_result: merged.map(|merged| merged.problems.0),
            points_with_warnings: merged.map(|merged| merged.warnings.0),
            outputs: merged.map(|merged| &merged.spreads[..]),
        };
        document.serialize(to)
    }
}

impl Report for SweepReport<'_> {
    fn text(&self) -> String {
        let mut out = self.heading();
        if let Some(done) = &self.done {
            out.push_str(&wrapped(&self.computed(done), 4));
        }
        let result = self.parts.result.display();
        let Some(merged) = &self.merged else {
            let said = if self.parts.merged() {
                format!("  {result} is complete")
            } else {
                format!("  parts are in {}; --collect makes {result} of them", self.parts.folder.display())
            };
            out.push_str(&wrapped(&said, 4));
            return out;
        };
        out.push_str(&wrapped(&format!("  written to {result}"), 4));
        out.push('\n');
        out.push_str(&spreads(&merged.spreads));
        out.push_str(&first_faults(merged));
        out
    }

    fn csv(&self) -> Vec<Vec<String>> {
        let header = ["output", "least", "quantile_16", "median", "quantile_84", "largest", "points_without_value"];
        let mut rows = vec![header.map(str::to_string).to_vec()];
        for spread in self.merged.iter().flat_map(|merged| &merged.spreads) {
            let mut row = vec![spread.name.clone()];
            row.extend(spread.values().map(|value| value.map_or(String::new(), |value| format!("{value:?}"))));
            row.push(spread.points_without_value.to_string());
            rows.push(row);
        }
        rows
    }
}

impl SweepReport<'_> {
    /// The grid and its size.
    fn heading(&self) -> String {
        let grid = self.grid;
        wrapped(
            &format!(
                "Sweep {} of {}: {} points ({} x {} x {})",
                grid.fingerprint,
                grid.name,
                grid.points(),
                counted(grid.missions.len() as u64, "mission"),
                counted(grid.combinations(), "combination"),
                counted(grid.draws, "draw")
            ),
            2,
        )
    }

    /// How many points were computed.
    fn computed(&self, done: &Done) -> String {
        let of = self.shard.map_or(String::new(), |shard| format!("shard {}/{}: ", shard.number, shard.of));
        let mut said = format!("  {of}{} of {} points were there, {} computed", done.found, done.points, done.computed);
        // For a whole sweep, the result states it.
        if self.shard.is_some() && done.problems > 0 {
            said.push_str(&format!(", {} of them without a result", done.problems));
        }
        said
    }
}

/// Quantiles of every output, and what those are that fall among points without a value.
fn spreads(all: &[Spread]) -> String {
    let mut spreads = table(&["output", "least", "16 %", "median", "84 %", "largest", "none"]);
    for spread in all {
        let mut row = vec![spread.name.clone()];
        let absent = || word(spread.without_value).to_string();
        row.extend(spread.values().map(|value| value.map_or_else(absent, |value| shown(&spread.name, value))));
        row.push(spread.points_without_value.to_string());
        spreads.add_row(row);
    }
    let mut out = lines(&spreads);
    let mut met: Vec<Undefined> =
        all.iter().filter(|spread| spread.points_without_value > 0).map(|spread| spread.without_value).collect();
    met.sort();
    met.dedup();
    if !met.is_empty() {
        out.push_str(&wrapped("  none: points without a value", 4));
    }
    for undefined in met {
        out.push_str(&wrapped(&format!("  {}: {}", word(undefined), explained(undefined)), 4));
    }
    out
}

/// A quantile that falls among points without a value.
fn word(undefined: Undefined) -> &'static str {
    match undefined {
        Undefined::Later => "later",
        Undefined::Above => "above",
        Undefined::Below => "below",
        Undefined::Apart => "-",
    }
}

/// The place of points without a value.
fn explained(undefined: Undefined) -> &'static str {
    match undefined {
        Undefined::Later => "than the mission; a budget that is never exceeded counts as later than all dates",
        Undefined::Above => "all values; a shape that is lost counts as changed more than all others",
        Undefined::Below => "all values; a shape that is lost has less margin than all others",
        Undefined::Apart => "points without a value are left out of these quantiles",
    }
}

/// Points without a result and with warnings: their number, and the first of each.
fn first_faults(merged: &Merged) -> String {
    let mut out = String::new();
    if let (count, Some((point, problem))) = &merged.problems {
        out.push_str(&wrapped(
            &format!(
                "{} without a result, see column problem; the first is point {point}: {problem}",
                counted(*count, "point")
            ),
            2,
        ));
    }
    if let (count, Some(warning)) = &merged.warnings {
        out.push_str(&wrapped(
            &format!("{} with warnings, see column warnings; the first: {warning}", counted(*count, "point")),
            2,
        ));
    }
    out
}

/// Times in years, all else in scientific notation.
fn shown(name: &str, value: f64) -> String {
    if name.ends_with("_yr") && !name.ends_with("per_yr") { format!("{value:.2}") } else { format!("{value:.2e}") }
}
