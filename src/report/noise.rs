//! The errors of the files as adopted in the search: in sentences, and in JSON.

use serde::ser::{Serialize, Serializer};

use crate::analysis::noise::SetNoise;
use crate::mission::keys::plain;

#[derive(serde::Serialize)]
struct OneFile<'a> {
    file: &'a str,
    scale: f64,
    correlation: f64,
    pedestal: Pedestal,
    /// Line numbers of the file; for a table that was not read from a file, row numbers from 1.
    outliers: Vec<usize>,
}

#[derive(serde::Serialize)]
struct Pedestal {
    value: f64,
    sigma: f64,
}

impl Serialize for SetNoise {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        let file = OneFile {
            file: &self.file,
            scale: self.scale,
            correlation: self.correlation,
            pedestal: Pedestal { value: self.pedestal.unwrap_or(0.0), sigma: self.pedestal_sigma.unwrap_or(0.0) },
            outliers: self.wrong.iter().map(|wrong| wrong.line.unwrap_or(wrong.row + 1)).collect(),
        };
        file.serialize(to)
    }
}

/// The allowances made for a file; None if its errors are as quoted.
pub(super) fn words(noise: &SetNoise, unit: &str) -> Option<String> {
    let mut said = Vec::new();
    if noise.scale != 1.0 {
        said.push(format!("rows scatter by {:.2} times the quoted sigma; that is taken as their error", noise.scale));
    }
    if noise.correlation > 0.0 {
        let of = "errors of neighbours in a trail or a time series are correlated";
        said.push(format!("{of} by {}", plain((100.0 * noise.correlation).round() / 100.0)));
    }
    if let (Some(value), Some(sigma)) = (noise.pedestal, noise.pedestal_sigma) {
        let unit = if unit.is_empty() { String::new() } else { format!(" {unit}") };
        said.push(format!("all values share a pedestal of {value:.2e} +- {sigma:.1e}{unit}, which is allowed for"));
    }
    if !noise.wrong.is_empty() {
        let each: Vec<String> = noise
            .wrong
            .iter()
            .map(|wrong| match wrong.line {
                Some(line) => format!("line {line} ({:+.0} sigma)", wrong.off_sigma),
                None => format!("row {} ({:+.0} sigma)", wrong.row + 1, wrong.off_sigma),
            })
            .collect();
        said.push(format!("far from the model, and given a larger error: {}", each.join(", ")));
    }
    (!said.is_empty()).then(|| format!("{}: {}.", noise.file, said.join("; ")))
}
