//! `ctiplan sweep`.

use serde_json::{Value, json};

use super::{Report, lines, table, wrapped};
use crate::sweep::{Done, Grid, Merged, Parts, Shard};

/// What a sweep came to.
pub struct SweepReport<'a> {
    /// The grid.
    pub grid: &'a Grid,
    /// Its parts and its result.
    pub parts: &'a Parts<'a>,
    /// The part of the sweep that was computed, where it was not all of it.
    pub shard: Option<Shard>,
    /// What was computed; None where parts were only collected.
    pub done: Option<Done>,
    /// The result; None where it was there already, or is for others to collect.
    pub merged: Option<Merged>,
}

impl Report for SweepReport<'_> {
    fn text(&self) -> String {
        let grid = self.grid;
        let listed = grid.combinations();
        let mut out = wrapped(
            &format!(
                "Sweep {} of {}: {} points ({} x {} x {})",
                grid.fingerprint,
                grid.name,
                grid.points(),
                counted(grid.missions.len() as u64, "mission"),
                counted(listed, "combination"),
                counted(grid.draws, "draw")
            ),
            2,
        );
        let result = self.parts.result.display();
        if let Some(done) = &self.done {
            let of = self.shard.map_or(String::new(), |shard| format!("shard {}/{}: ", shard.number, shard.of));
            let mut said =
                format!("  {of}{} of {} points were there, {} computed", done.found, done.points, done.computed);
            if self.shard.is_some() && done.problems > 0 {
                said.push_str(&format!(", {} of them without a result", done.problems));
            }
            out.push_str(&wrapped(&said, 4));
        }
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
        let mut spreads = table(&["output", "least", "16 %", "median", "84 %", "largest", "none"]);
        for (name, spread, without) in &merged.spreads {
            let mut row = vec![name.clone()];
            match spread {
                None => row.extend(std::iter::repeat_n("-".to_string(), 5)),
                Some(spread) => row.extend(
                    [spread.least, spread.low, spread.median, spread.high, spread.largest]
                        .map(|value| shown(name, value)),
                ),
            }
            row.push(without.to_string());
            spreads.add_row(row);
        }
        out.push_str(&lines(&spreads));
        if merged.spreads.iter().any(|(.., without)| *without > 0) {
            out.push_str(&wrapped(
                "  none: points without a value; a budget that is not exceeded within the mission has no time",
                4,
            ));
        }
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

    fn json(&self) -> Value {
        let done = self.done.as_ref();
        json!({
            "sweep": self.grid.fingerprint,
            "grid": self.grid.name,
            "points": self.grid.points(),
            "shard": self.shard.map(|shard| format!("{}/{}", shard.number, shard.of)),
            "found_points": done.map(|done| done.found),
            "computed_points": done.map(|done| done.computed),
            "output": self.parts.result.display().to_string(),
            "complete": self.parts.merged(),
            "points_without_result": self.merged.as_ref().map(|merged| merged.problems.0),
            "points_with_warnings": self.merged.as_ref().map(|merged| merged.warnings.0),
            "outputs": self.merged.as_ref().map(|merged| merged.spreads.iter().map(|(name, spread, without)| json!({
                "name": name,
                "points_without_value": without,
                "least": spread.map(|spread| spread.least),
                "quantile_16": spread.map(|spread| spread.low),
                "median": spread.map(|spread| spread.median),
                "quantile_84": spread.map(|spread| spread.high),
                "largest": spread.map(|spread| spread.largest),
            })).collect::<Vec<_>>()),
        })
    }

    fn csv(&self) -> Vec<Vec<String>> {
        let header = ["output", "least", "quantile_16", "median", "quantile_84", "largest", "points_without_value"];
        let mut rows = vec![header.map(str::to_string).to_vec()];
        for (name, spread, without) in self.merged.iter().flat_map(|merged| &merged.spreads) {
            let values = spread.map(|spread| [spread.least, spread.low, spread.median, spread.high, spread.largest]);
            let values =
                values.map_or(vec![String::new(); 5], |values| values.map(|value| format!("{value:?}")).to_vec());
            rows.push([vec![name.clone()], values, vec![without.to_string()]].concat());
        }
        rows
    }
}

/// Times in years, all else in powers of ten.
fn shown(name: &str, value: f64) -> String {
    if name.ends_with("_yr") && !name.ends_with("per_yr") { format!("{value:.2}") } else { format!("{value:.2e}") }
}

fn counted(number: u64, what: &str) -> String {
    format!("{number} {what}{}", if number == 1 { "" } else { "s" })
}
