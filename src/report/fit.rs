//! `ctiplan fit`.

mod advice;
mod figures;
mod posterior;
mod profile;

use serde::ser::{Serialize, Serializer};

use super::validate::correlation_in_words;
use super::{Page, Parts, Report, chance, significant, table};
use crate::analysis::fit::holdout::Holdout;
use crate::analysis::fit::posterior::Posterior;
use crate::analysis::fit::profile::Profile;
use crate::analysis::fit::{Advice, Combination, Fit, Fitted, Minimum};
use crate::analysis::independence::Neighbours;
use crate::mission::Mission;
use crate::mission::keys::plain;
use crate::plan::sources::{self, Source};
use crate::report::plot::Figure;
use crate::warning::Warning;

/// A fit, with the requested additions: the error for held-out rows, intervals, a sample.
pub struct FitReport {
    /// The fit.
    pub fit: Fit,
    /// Held-out errors.
    pub holdout: Option<Holdout>,
    /// Scans of chi2.
    pub profiles: Vec<Profile>,
    /// A sample of the posterior.
    pub posterior: Option<Posterior>,
    /// Whether rows of the data have known errors in common.
    pub has_common_errors: bool,
}

/// A fit in JSON.
#[derive(serde::Serialize)]
struct Document<'a> {
    mission: &'a str,
    n: usize,
    free: usize,
    chi2_before: f64,
    chi2: f64,
    rms_sigma: f64,
    parameters: &'a [Fitted],
    correlation: &'a [Vec<Option<f64>>],
    #[serde(skip_serializing_if = "Vec::is_empty")]
    constrained_combinations: Vec<&'a Combination>,
    starts_chi2: &'a [f64],
    chi2_from_mission: f64,
    other_minima: &'a [Minimum],
    holdout: Option<&'a Holdout>,
    #[serde(skip_serializing_if = "<[Profile]>::is_empty")]
    profiles: &'a [Profile],
    #[serde(skip_serializing_if = "Option::is_none")]
    posterior: Option<&'a Posterior>,
    independence: Independent<'a>,
    advice: &'a [Advice],
    warnings: &'a [Warning],
}

/// Independence of the residuals in JSON.
#[derive(serde::Serialize)]
struct Independent<'a> {
    tests: &'a [Neighbours],
    error_factors: Vec<ErrorFactor<'a>>,
}

/// Factor from the error of a key to that with correlated errors of the data.
#[derive(serde::Serialize)]
struct ErrorFactor<'a> {
    key: &'a str,
    factor: f64,
}

/// Factors from the errors of keys to those with correlated errors of the data, the largest first; none if they are independent.
fn factors(fit: &Fit) -> impl Iterator<Item = (&str, f64)> {
    let known = fit.parameters.iter().zip(&fit.independence.error_factors);
    let mut factors: Vec<(&str, f64)> =
        known.filter_map(|(parameter, factor)| Some((parameter.key.as_str(), (*factor)?))).collect();
    factors.sort_by(|a, b| b.1.total_cmp(&a.1));
    factors.into_iter()
}

impl Serialize for FitReport {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        let fit = &self.fit;
        let document = Document {
            mission: &fit.mission.mission.name,
            n: fit.n,
            free: fit.parameters.len(),
            chi2_before: fit.chi2_before,
            chi2: fit.chi2,
            rms_sigma: fit.rms_sigma(),
            parameters: &fit.parameters,
            correlation: &fit.correlation,
            constrained_combinations: fit.combinations(),
            starts_chi2: &fit.starts,
            chi2_from_mission: fit.chi2_from_mission,
            other_minima: &fit.minima,
            holdout: self.holdout.as_ref(),
            profiles: &self.profiles,
            posterior: self.posterior.as_ref(),
            independence: Independent {
                tests: &fit.independence.tests,
                error_factors: factors(fit).map(|(key, factor)| ErrorFactor { key, factor }).collect(),
            },
            advice: &fit.advice,
            warnings: &fit.warnings,
        };
        document.serialize(to)
    }
}

impl Report for FitReport {
    fn text(&self) -> String {
        self.parts().text()
    }

    /// The curves of the profiles if there are any; otherwise the parameters.
    fn csv(&self) -> Vec<Vec<String>> {
        if !self.profiles.is_empty() {
            return profile::curves(&self.profiles);
        }
        let mut header = ["key", "unit", "before", "value", "sigma"].map(str::to_string).to_vec();
        header.extend(self.posterior.iter().flat_map(|_| posterior::COLUMNS.map(str::to_string)));
        let mut records = vec![header];
        for (place, parameter) in self.fit.parameters.iter().enumerate() {
            let mut record = vec![
                parameter.key.clone(),
                parameter.unit.into(),
                parameter.before.to_string(),
                parameter.value.to_string(),
                parameter.sigma.map_or(String::new(), |sigma| sigma.to_string()),
            ];
            record.extend(self.posterior.iter().flat_map(|sample| posterior::cells(&sample.parameters[place])));
            records.push(record);
        }
        records
    }
}

impl Page for FitReport {
    fn command(&self) -> String {
        "fit".into()
    }

    fn parts(&self) -> Parts {
        let fit = &self.fit;
        let mut out = Parts::default();
        out.title(&fit.mission.mission.name, format!("fitted to {} rows", fit.n));
        out.gap();
        if !fit.parameters.is_empty() {
            out.table(values(fit));
        }
        out.gap();
        for said in quality(fit, self.has_common_errors).into_iter().chain(minima(fit)) {
            out.verdict(said, 2);
        }
        out.warnings(&fit.warnings);
        if fit.parameters.len() > 1 {
            out.heading("Correlations");
            let known = |row: usize, column: usize| fit.correlation[row][column];
            out.table(correlations(fit.parameters.iter().map(|one| one.key.as_str()), known));
        }
        if let Some(holdout) = &self.holdout {
            held_out(holdout, fit, &mut out);
        }
        profile::say(&self.profiles, &mut out);
        if let Some(sample) = &self.posterior {
            posterior::say(sample, &mut out);
        }
        if !fit.advice.is_empty() {
            out.heading("Not determined by these data");
            for advice in &fit.advice {
                out.words(format!("  - {advice}"), 4);
            }
        }
        out
    }

    fn figures(&self) -> Vec<(String, Figure)> {
        self.drawn()
    }

    fn sources(&self, missions: &[Mission]) -> Vec<Source> {
        let mut found: Vec<Source> = missions.iter().flat_map(sources::of).collect();
        found.extend((!self.profiles.is_empty()).then(profile::source));
        found.extend(self.posterior.as_ref().map(|_| posterior::source()));
        sources::once(found)
    }
}

fn values(fit: &Fit) -> comfy_table::Table {
    let mut values = table(&["key", "before", "fitted", "error", "unit"]);
    for parameter in &fit.parameters {
        let (value, error) = value_and_error(parameter, &fit.advice);
        values.add_row(vec![parameter.key.clone(), plain(parameter.before), value, error, parameter.unit.into()]);
    }
    values
}

/// Quality of the fit, in sentences.
fn quality(fit: &Fit, has_common_errors: bool) -> Vec<String> {
    let freedom = fit.degrees_of_freedom().max(1);
    let mut said = vec![format!(
        "chi2 {:.1} before, {:.1} after, {:.2} per degree of freedom; rms of residuals {:.2} sigma",
        fit.chi2_before,
        fit.chi2,
        fit.chi2 / freedom as f64,
        fit.rms_sigma()
    )];
    if !fit.describes_data() {
        said.push(
            "The model does not explain the data within their errors. The errors above are then too small, and parameters \
             may stand in for a missing effect. `ctiplan validate` shows where."
                .into(),
        );
    } else if let Some(probability) = fit.errors_too_large() {
        said.push(format!(
            "Noise leaves as little chi2 with a probability of {}: the quoted errors of the data are too large, and so are the \
             errors above.",
            chance(probability)
        ));
    } else if !fit.parameters.is_empty() && fit.independence.correlated().is_empty() {
        let but = if has_common_errors { ", apart from sigma_common" } else { "" };
        said.push(format!(
            "The errors (1 sigma) hold if the quoted errors of the data are right, and independent from row to row{but}."
        ));
    }
    for one in fit.independence.correlated() {
        let file = one.file.rsplit(['/', '\\']).next().expect("a last part");
        said.push(format!("{}.", correlation_in_words(file, one, fit.independence.tests.len())));
    }
    let factors: Vec<String> = factors(fit).map(|(key, factor)| format!("{factor:.1} ({key})")).collect();
    if !factors.is_empty() {
        said.push(format!(
            "With errors so correlated, {}. chi2 and the errors above are those of independent rows.",
            match &factors[..] {
                [one] => format!("the error above is to be multiplied by {one}"),
                all => format!("the errors above are to be multiplied by {}", all.join(", ")),
            }
        ));
    }
    said
}

/// The lower triangle of a correlation matrix.
fn correlations<'a>(
    keys: impl Iterator<Item = &'a str> + Clone,
    correlation: impl Fn(usize, usize) -> Option<f64>,
) -> comfy_table::Table {
    let n = keys.clone().count();
    let numbers: Vec<String> = (1..=n).map(|number| number.to_string()).collect();
    let mut header = vec!["key"];
    header.extend(numbers.iter().map(String::as_str));
    let mut correlations = table(&header);
    for (index, key) in keys.enumerate() {
        let mut row = vec![format!("{} {key}", index + 1)];
        let cell = |other: usize| match correlation(index, other) {
            _ if other > index => String::new(),
            Some(correlation) => format!("{correlation:+.2}"),
            None => "not known".into(),
        };
        row.extend((0..n).map(cell));
        correlations.add_row(row);
    }
    correlations
}

/// Maximum number of other minima listed.
const MINIMA: usize = 3;

/// The results from all starts, in sentences; empty if there was only one.
fn minima(fit: &Fit) -> Vec<String> {
    let mut said = Vec::new();
    if fit.starts.len() > 1 {
        let same = fit.starts.iter().filter(|chi2| fit.is_optimum(**chi2)).count();
        said.push(format!("{same} of {} starts came to this minimum of chi2.", fit.starts.len()));
    }
    if !fit.is_optimum(fit.chi2_from_mission) {
        said.push(format!(
            "Another start was better: from the mission's values the fit ends in a local minimum, chi2 {:.1}.",
            fit.chi2_from_mission
        ));
    }
    let at = |minimum: &Minimum| {
        let value = |(parameter, value): (&Fitted, &f64)| format!("{} = {value:.4}", parameter.key);
        let values: Vec<String> = fit.parameters.iter().zip(&minimum.values).map(value).collect();
        format!("{:.1} at {}", minimum.chi2, values.join(", "))
    };
    if !fit.minima.is_empty() {
        let listed: Vec<String> = fit.minima.iter().take(MINIMA).map(at).collect();
        let more = fit.minima.len().saturating_sub(MINIMA);
        let more = if more > 0 { format!("; and {more} more") } else { String::new() };
        said.push(format!("This minimum is one of several. Other starts ended at chi2 {}{more}.", listed.join("; ")));
    }
    said
}

/// Value and error to the same decimal place, the error to two digits. An error larger than the value is none if the data set no
/// limit on one side.
pub(super) fn value_and_error(parameter: &Fitted, advice: &[Advice]) -> (String, String) {
    let value = parameter.value;
    let limited = advice.iter().find(|advice| advice.limited() == Some(&parameter.key));
    let limit = limited.map(|advice| match advice {
        Advice::Open { above: true, .. } => "lower limit",
        Advice::Open { above: false, .. } => "upper limit",
        _ => "not determined",
    });
    match parameter.sigma {
        Some(sigma) if sigma > value && limit.is_some() => (significant(value, 4), limit.unwrap_or_default().into()),
        Some(sigma) if sigma > 0.0 && sigma.is_finite() => to_two_digits(value, sigma),
        _ => (significant(value, 4), "not known".into()),
    }
}

/// A value, and its error to two digits.
fn to_two_digits(value: f64, sigma: f64) -> (String, String) {
    let shown = to_digits_of(value, sigma);
    let error = if shown.contains('e') { format!("{sigma:.1e}") } else { to_digits_of(sigma, sigma) };
    (shown, error)
}

fn held_out(holdout: &Holdout, fit: &Fit, out: &mut Parts) {
    out.heading(format!("Held out: fitted without each group of {} in turn, and predicted", holdout.column));
    let mut groups = table(&[&holdout.column, "rows", "rms [sigma]", ""]);
    for group in &holdout.groups {
        groups.add_row(vec![
            group.name.clone(),
            group.n.to_string(),
            format!("{:.2}", group.rms_sigma),
            if group.at_end { "extrapolated".into() } else { String::new() },
        ]);
    }
    out.table(groups);
    let rms = |rms: Option<f64>| rms.map_or("-".into(), |rms| format!("{rms:.2}"));
    out.words(
        format!(
            "  rms {:.2} sigma ({} interpolated, {} extrapolated); {:.2} sigma if all rows are fitted",
            holdout.rms_sigma,
            rms(holdout.interpolated_rms_sigma),
            rms(holdout.extrapolated_rms_sigma),
            fit.rms_sigma()
        ),
        4,
    );
}

/// A number to two digits of its uncertainty.
fn to_digits_of(value: f64, spread: f64) -> String {
    if !(spread > 0.0 && spread.is_finite()) {
        return plain(value);
    }
    let decimals = 1 - spread.log10().floor() as i32;
    if (0..=8).contains(&decimals) && value.abs() < 1e6 {
        format!("{value:.*}", decimals as usize)
    } else {
        let digits = ((value.abs().max(spread) / spread).log10().floor() as usize + 1).min(12);
        format!("{value:.digits$e}")
    }
}
