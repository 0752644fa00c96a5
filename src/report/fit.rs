//! `ctiplan fit`.

mod advice;

use serde::ser::{Serialize, Serializer};

use super::{Report, lines, table, wrapped};
use crate::analysis::fit::holdout::Holdout;
use crate::analysis::fit::{Advice, Fit, Fitted, Minimum};
use crate::mission::keys::plain;

/// A fit, with the error on rows it has not seen where that was asked for.
pub struct FitReport {
    /// The fit.
    pub fit: Fit,
    /// Held-out errors.
    pub holdout: Option<Holdout>,
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
    correlation: &'a [Vec<f64>],
    starts_chi2: &'a [f64],
    chi2_from_mission: f64,
    other_minima: &'a [Minimum],
    holdout: Option<&'a Holdout>,
    advice: &'a [Advice],
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
            starts_chi2: &fit.starts,
            chi2_from_mission: fit.chi2_from_mission,
            other_minima: &fit.minima,
            holdout: self.holdout.as_ref(),
            advice: &fit.advice,
        };
        document.serialize(to)
    }
}

impl Report for FitReport {
    fn text(&self) -> String {
        let fit = &self.fit;
        let mut out = wrapped(&format!("{}: fitted to {} rows", fit.mission.mission.name, fit.n), 2);
        out.push('\n');
        if !fit.parameters.is_empty() {
            let mut values = table(&["key", "before", "fitted", "error", "unit"]);
            for parameter in &fit.parameters {
                let (value, error) = value_and_error(parameter);
                values.add_row(vec![
                    parameter.key.clone(),
                    plain(parameter.before),
                    value,
                    error,
                    parameter.unit.into(),
                ]);
            }
            out.push_str(&lines(&values));
        }
        let freedom = fit.degrees_of_freedom().max(1);
        out.push('\n');
        out.push_str(&wrapped(
            &format!(
                "chi2 {:.1} before, {:.1} after, {:.2} per degree of freedom; rms of residuals {:.2} sigma",
                fit.chi2_before,
                fit.chi2,
                fit.chi2 / freedom as f64,
                fit.rms_sigma()
            ),
            2,
        ));
        if fit.excess() > 3.0 {
            out.push_str(&wrapped(
                "The model does not explain the data within their errors. The errors above are then too small, and parameters \
                 may stand in for a missing effect. `ctiplan validate` shows where.",
                2,
            ));
        }
        for said in minima(fit) {
            out.push_str(&wrapped(&said, 2));
        }
        let n = fit.parameters.len();
        if n > 1 {
            out.push_str("\nCorrelations\n");
            let numbers: Vec<String> = (1..=n).map(|number| number.to_string()).collect();
            let mut header = vec!["key"];
            header.extend(numbers.iter().map(String::as_str));
            let mut correlations = table(&header);
            for (index, parameter) in fit.parameters.iter().enumerate() {
                let mut row = vec![format!("{} {}", index + 1, parameter.key)];
                row.extend((0..n).map(|other| {
                    if other <= index { format!("{:+.2}", fit.correlation[index][other]) } else { String::new() }
                }));
                correlations.add_row(row);
            }
            out.push_str(&lines(&correlations));
        }
        if let Some(holdout) = &self.holdout {
            out.push_str(&held_out(holdout, fit));
        }
        if !fit.advice.is_empty() {
            out.push_str("\nNot determined by these data\n");
            for advice in &fit.advice {
                out.push_str(&wrapped(&format!("  - {advice}"), 4));
            }
        }
        out
    }

    fn csv(&self) -> Vec<Vec<String>> {
        let mut records = vec![["key", "unit", "before", "value", "sigma"].map(str::to_string).to_vec()];
        for parameter in &self.fit.parameters {
            records.push(vec![
                parameter.key.clone(),
                parameter.unit.into(),
                parameter.before.to_string(),
                parameter.value.to_string(),
                parameter.sigma.map_or(String::new(), |sigma| sigma.to_string()),
            ]);
        }
        records
    }
}

/// Other minima listed.
const MINIMA: usize = 3;

/// What the starts came to, in sentences; nothing where one start was enough.
fn minima(fit: &Fit) -> Vec<String> {
    let mut said = Vec::new();
    if fit.starts.len() > 1 {
        let same = fit.starts.iter().filter(|chi2| fit.is_optimum(**chi2)).count();
        said.push(format!("{same} of {} starts came to this minimum of chi2", fit.starts.len()));
    }
    if !fit.is_optimum(fit.chi2_from_mission) {
        said.push(format!(
            "Another start was better: from the mission's values the fit ends in a local minimum, chi2 {:.1}",
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
        said.push(format!("This minimum is one of several. Other starts ended at chi2 {}{more}", listed.join("; ")));
    }
    said
}

/// Value and error to the same decimal, the error to two digits.
pub(super) fn value_and_error(parameter: &Fitted) -> (String, String) {
    let value = parameter.value;
    match parameter.sigma {
        Some(sigma) if sigma > 0.0 && sigma.is_finite() => {
            let decimals = 1 - sigma.log10().floor() as i32;
            if (0..=8).contains(&decimals) && value.abs() < 1e6 {
                let decimals = decimals as usize;
                (format!("{value:.decimals$}"), format!("{sigma:.decimals$}"))
            } else {
                let digits = ((value.abs().max(sigma) / sigma).log10().floor() as usize + 1).min(12);
                (format!("{value:.digits$e}"), format!("{sigma:.1e}"))
            }
        }
        _ => (format!("{value:.6}"), "not known".into()),
    }
}

fn held_out(holdout: &Holdout, fit: &Fit) -> String {
    let mut out = format!("\nHeld out: fitted without each group of {} in turn, and predicted\n", holdout.column);
    let mut groups = table(&[&holdout.column, "rows", "rms [sigma]", ""]);
    for group in &holdout.groups {
        groups.add_row(vec![
            group.name.clone(),
            group.n.to_string(),
            format!("{:.2}", group.rms_sigma),
            if group.at_end { "extrapolated".into() } else { String::new() },
        ]);
    }
    out.push_str(&lines(&groups));
    let rms = |rms: Option<f64>| rms.map_or("-".into(), |rms| format!("{rms:.2}"));
    out.push_str(&wrapped(
        &format!(
            "  rms {:.2} sigma ({} interpolated, {} extrapolated); {:.2} sigma if all rows are fitted",
            holdout.rms_sigma,
            rms(holdout.interpolated_rms_sigma),
            rms(holdout.extrapolated_rms_sigma),
            fit.rms_sigma()
        ),
        4,
    ));
    out
}
