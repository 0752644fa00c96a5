//! `ctiplan validate`.

mod figures;
mod words;

pub(super) use words::correlation_in_words;

use serde::ser::{Serialize, Serializer};

use super::{Page, Parts, Report, chance, noise, table};
use crate::analysis::independence::Neighbours;
use crate::analysis::noise::SetNoise;
use crate::analysis::validate::residual_trend::Trend;
use crate::analysis::validate::{Likeliest, SetResult, Validation};
use crate::report::plot::Figure;
use crate::warning::Warning;

/// Number of rows listed as the worst.
const WORST: usize = 5;

/// A validation in JSON.
#[derive(serde::Serialize)]
struct Document<'a> {
    mission: &'a str,
    chi2: f64,
    n: usize,
    rms: f64,
    rms_sigma: f64,
    datasets: &'a [SetResult],
    covariates: &'a [Trend],
    independence: &'a [Neighbours],
    words: Vec<String>,
    conclusion: String,
    likeliest_errors: Option<&'a Likeliest>,
    warnings: Vec<&'a Warning>,
}

impl Serialize for Validation {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        let document = Document {
            mission: &self.mission.mission.name,
            chi2: self.chi2,
            n: self.n,
            rms: self.rms_sigma(),
            rms_sigma: self.rms_sigma(),
            datasets: &self.sets,
            covariates: &self.trends,
            independence: &self.independence.tests,
            words: self.words(),
            conclusion: self.conclusion(),
            likeliest_errors: self.likeliest.as_ref(),
            warnings: self.warnings(),
        };
        document.serialize(to)
    }
}

impl Report for Validation {
    fn text(&self) -> String {
        self.parts().text()
    }

    fn csv(&self) -> Vec<Vec<String>> {
        let header = ["file", "observable", "line", "value", "sigma", "model", "residual_sigma"];
        let mut records = vec![header.map(str::to_string).to_vec()];
        for set in &self.sets {
            for (index, residual) in set.residuals().into_iter().enumerate() {
                let row = &set.data.rows[index];
                records.push(vec![
                    set.data.file.clone(),
                    set.data.observable.to_string(),
                    set.data.table.lines.get(index).map_or(String::new(), usize::to_string),
                    row.value.to_string(),
                    row.sigma.to_string(),
                    set.model[index].to_string(),
                    residual.to_string(),
                ]);
            }
        }
        records
    }
}

impl Page for Validation {
    fn command(&self) -> String {
        "validate".into()
    }

    fn parts(&self) -> Parts {
        let mut out = Parts::default();
        out.title(&self.mission.mission.name, "model against data");
        out.gap();
        self.by_file(&mut out);
        if !self.trends.is_empty() {
            self.residual_trends(&mut out);
        }
        self.largest_residuals(&mut out);
        out.gap();
        for word in self.words() {
            out.verdict(word, 2);
        }
        out.verdict(self.conclusion(), 2);
        self.likeliest_errors(&mut out);
        out.warnings(self.warnings());
        out
    }

    fn figures(&self) -> Vec<(String, Figure)> {
        self.drawn()
    }
}

impl Validation {
    /// Errors other than quoted that are likeliest if the model is right.
    fn likeliest_errors(&self, out: &mut Parts) {
        let Some(likeliest) = &self.likeliest else { return };
        let of = |(noise, set): (&SetNoise, &SetResult)| noise::words(noise, set.data.observable.unit());
        let words: Vec<String> = likeliest.noise.iter().zip(&self.sets).filter_map(of).collect();
        let are_believable = likeliest.noise.iter().zip(&self.sets).all(|(noise, set)| noise.is_believable(&set.data));
        if words.is_empty() || !are_believable {
            return;
        }
        out.heading("Errors that are likeliest if this model is right");
        for word in words {
            out.words(format!("  {word}"), 4);
        }
        out.words(format!("  with these errors chi2 is {} for {} rows", large(likeliest.chi2, 1), self.n), 4);
    }

    /// Deviation of the model from each file.
    fn by_file(&self, out: &mut Parts) {
        let mut sets = table(&["data", "observable", "rows", "chi2", "chi2/row", "rms", "bias", "scatter"]);
        for set in &self.sets {
            let n = set.data.rows.len();
            sets.add_row(vec![
                set.name().to_string(),
                set.data.observable.to_string(),
                n.to_string(),
                large(set.chi2, 1),
                large(set.chi2 / n as f64, 2),
                with_unit(set.rms, set),
                format!("{:+.2}", set.bias_sigma),
                format!("{:.2}", set.scatter_sigma),
            ]);
        }
        if self.sets.len() > 1 {
            let all = ["all", "", &self.n.to_string(), &large(self.chi2, 1)].map(str::to_string);
            let mut row = all.to_vec();
            row.extend([large(self.chi2 / self.n as f64, 2), String::new(), String::new(), String::new()]);
            sets.add_row(row);
        }
        out.table(sets);
        out.words(
            format!(
                "  rms of residuals {:.2} sigma; bias: mean residual (error 1/sqrt(rows)); scatter: from row to row; both in sigma",
                self.rms_sigma()
            ),
            4,
        );
    }

    /// Trends of residuals with conditions.
    fn residual_trends(&self, out: &mut Parts) {
        out.heading("Residual trends");
        let mut trends =
            table(&["data", "condition", "linear trend [sigma]", "least, greatest bin [sigma]", "p-value"]);
        for trend in &self.trends {
            let extremes = trend.bins.iter().map(|bin| bin.mean_sigma);
            let low = extremes.clone().fold(f64::INFINITY, f64::min);
            let high = extremes.fold(f64::NEG_INFINITY, f64::max);
            trends.add_row(vec![
                self.sets[trend.set].name().to_string(),
                trend.name.clone(),
                format!("{:+.2} +- {:.2}", trend.slope_sigma, trend.slope_error_sigma),
                format!("{low:+.1}, {high:+.1}"),
                chance(trend.false_alarm),
            ]);
        }
        out.table(trends);
        out.words(
            format!(
                "  linear trend: change over the range of the condition, along the line through the bin means; p-value: probability \
                 that noise alone, independent from row to row, gives bin means that differ as much, or as strong a linear trend, \
                 corrected for {} {} tested",
                self.trends.len(),
                if self.trends.len() == 1 { "condition" } else { "conditions" }
            ),
            4,
        );
    }

    /// The rows with the largest residuals.
    fn largest_residuals(&self, out: &mut Parts) {
        out.heading("Largest residuals");
        let mut worst = table(&["data", "line", "value", "model", "residual [sigma]"]);
        for (set, row, residual) in self.worst(WORST) {
            let result = &self.sets[set];
            worst.add_row(vec![
                result.name().to_string(),
                result.data.table.lines.get(row).map_or_else(|| format!("row {}", row + 1), usize::to_string),
                significant(result.data.rows[row].value),
                significant(result.model[row]),
                format!("{residual:+.1}"),
            ]);
        }
        out.table(worst);
        if self.sets.iter().any(|set| set.data.has_common_errors()) {
            out.words(
                "  where rows have an error in common (sigma_common), residuals are independent of it, in units of the errors without it",
                4,
            );
        }
    }
}

fn with_unit(value: f64, set: &SetResult) -> String {
    let unit = set.data.observable.unit();
    if unit.is_empty() { significant(value) } else { format!("{} {unit}", significant(value)) }
}

/// With so many decimals, or in scientific notation if that is shorter.
fn large(value: f64, decimals: usize) -> String {
    if value < 1e6 { format!("{value:.decimals$}") } else { format!("{value:.2e}") }
}

/// Four digits.
pub(super) fn significant(value: f64) -> String {
    if value != 0.0 && !(1e-2..1e5).contains(&value.abs()) {
        return format!("{value:.3e}");
    }
    let digits = (3 - value.abs().max(1e-3).log10().floor() as i32).max(0) as usize;
    format!("{value:.digits$}")
}
