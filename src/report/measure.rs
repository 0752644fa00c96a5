//! `ctiplan measure`.

use std::path::Path;

use serde::ser::{Serialize, Serializer};
use serde_json::{Map, Value as Json, json};

use super::{Report, keep_words, lines, or_dash, table, wrapped};
use crate::measure::Measured;
use crate::measure::exposure::About;

/// The measurement, and its files.
pub struct MeasureReport {
    /// The measurement.
    pub measured: Measured,
    /// The files, in the order of the tables.
    pub files: Vec<String>,
}

impl Serialize for MeasureReport {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        let measured = &self.measured;
        let tables: Vec<Json> = self
            .written()
            .map(|(observable, rows, file)| json!({"file": file, "observable": observable, "rows": rows}))
            .collect();
        let counts: Map<String, Json> =
            measured.counts.iter().map(|(name, count)| (name.to_string(), json!(count))).collect();
        let document = json!({
            "kind": measured.kind,
            "tables": tables,
            "counts": counts,
            "options": measured.options,
            "exposures": measured.exposures.iter().map(About::json).collect::<Vec<_>>(),
            "warnings": measured.warnings.iter().map(ToString::to_string).collect::<Vec<_>>(),
        });
        document.serialize(to)
    }
}

impl MeasureReport {
    /// Observable, rows and file of each table.
    fn written(&self) -> impl Iterator<Item = (&'static str, usize, &str)> {
        let tables = self.measured.tables.iter().zip(&self.files);
        tables.map(|((observable, table), file)| (observable.name(), table.rows(), file.as_str()))
    }
}

impl Report for MeasureReport {
    fn text(&self) -> String {
        let mut out = String::new();
        for (observable, rows, file) in self.written() {
            let s = if rows == 1 { "" } else { "s" };
            out.push_str(&wrapped(&format!("{observable}: {rows} row{s} written to {file}"), 2));
        }
        out.push('\n');
        let mut exposures = table(&["frame", "time", "gain [e-/DN]", "bias [DN]", "noise [e-]"]);
        for about in &self.measured.exposures {
            let noise = about.bias.noise_dn.map(|noise| format!("{:.2}", noise * about.gain_e_per_dn));
            let amplifier = match &about.amplifier_name {
                Some(name) => format!(".{name}"),
                None if about.amplifier == 1 => String::new(),
                None => format!(".{}", about.amplifier),
            };
            exposures.add_row(vec![
                format!("{}[{}]{amplifier}", name(&about.file), about.hdu),
                about.when.words(),
                about.gain_e_per_dn.to_string(),
                format!("{:.3} +- {:.3}", about.bias.dn, about.bias.sigma_dn),
                or_dash(noise),
            ]);
        }
        keep_words(&mut exposures, 0);
        out.push_str(&lines(&exposures));
        if let Some(first) = self.measured.exposures.first() {
            out.push_str(&wrapped(&format!("Bias: {}.", first.bias.source.words()), 2));
        }
        out.push('\n');
        let mut counts = table(&["", "number"]);
        for (name, count) in &self.measured.counts {
            counts.add_row(vec![name.replace('_', " "), count.to_string()]);
        }
        out.push_str(&lines(&counts));
        for warning in &self.measured.warnings {
            out.push_str(&wrapped(&format!("\nWarning: {warning}"), 2));
        }
        out
    }

    fn csv(&self) -> Vec<Vec<String>> {
        let header = ["observable", "rows", "file"].map(str::to_string).to_vec();
        let row =
            |(observable, rows, file): (&str, usize, &str)| vec![observable.into(), rows.to_string(), file.into()];
        [header].into_iter().chain(self.written().map(row)).collect()
    }
}

/// A file's name without its folders.
fn name(file: &str) -> &str {
    Path::new(file).file_name().and_then(|name| name.to_str()).unwrap_or(file)
}
