//! The requirements as a table.

use comfy_table::Table;

use crate::mission::keys::plain;
use crate::numeric::estimate::Estimate;
use crate::plan::compliance::Line;
use crate::report::study::estimate::plus_minus;
use crate::report::{or_dash, table};

/// One row for each requirement.
pub(super) fn table_of(lines: &[Line], confidence: Option<f64>) -> Table {
    let met = confidence.map_or("met".into(), |required| format!("met, {} % required", plain(100.0 * required)));
    let mut rows =
        table(&["requirement", "correction", "limit", "at the end", "used [%]", "exceeded", "met with [%]", &met]);
    for line in lines {
        let noise = if line.noise { ", with noise" } else { "" };
        let used = line.at_end.map(|value| format!("{:.1}", 100.0 * value / line.limit));
        let probability = line.probability_met.zip(line.probability_error);
        let probability = probability.map(|(value, error)| plus_minus(Estimate { value, error }.times(100.0)));
        rows.add_row(vec![
            format!("{}{noise}", line.requirement),
            if line.correction_factor == 1.0 {
                "none".into()
            } else {
                format!("factor {}", plain(line.correction_factor))
            },
            plain(line.limit),
            line.at_end.map_or("lost".into(), |value| format!("{value:.3e}")),
            or_dash(used),
            or_dash(line.date.map(|date| date.to_string()).or(line.t_yr.map(|t_yr| format!("{t_yr:.2} yr")))),
            or_dash(probability),
            match (line.met, confidence.is_some() && !line.by_probability) {
                (true, false) => "yes".into(),
                (false, false) => "no".into(),
                (true, true) => "design case: yes".into(),
                (false, true) => "design case: no".into(),
            },
        ]);
    }
    rows
}
