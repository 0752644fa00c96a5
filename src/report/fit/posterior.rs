//! A sample of the posterior, in words and tables.

use super::{correlations, to_digits_of};
use crate::analysis::fit::posterior::{Marginal, Posterior};
use crate::plan::sources::Source;
use crate::report::{Parts, table};

/// CSV columns for each parameter, besides the fit.
pub(super) const COLUMNS: [&str; 7] =
    ["median", "low_68", "high_68", "low_95", "high_95", "autocorrelation_steps", "effective_samples"];

/// Their cells.
pub(super) fn cells(marginal: &Marginal) -> [String; 7] {
    let ([low_68, high_68], [low_95, high_95]) = (marginal.interval_68, marginal.interval_95);
    let steps = marginal.autocorrelation_steps.map_or(String::new(), |steps| steps.to_string());
    let numbers = [marginal.median, low_68, high_68, low_95, high_95].map(|number| number.to_string());
    let [median, low_68, high_68, low_95, high_95] = numbers;
    [median, low_68, high_68, low_95, high_95, steps, marginal.effective_samples.to_string()]
}

/// Intervals, priors, correlations, and whether the sample is long enough.
pub(super) fn say(sample: &Posterior, out: &mut Parts) {
    out.heading(format!("Posterior: a sample of {} draws, seed {}", sample.draws.len(), sample.seed));
    let mut intervals = table(&["key", "probability", "from", "to", "unit"]);
    let mut chains = table(&["key", "median", "autocorrelation [steps]", "effective"]);
    for one in &sample.parameters {
        let spread = 0.5 * (one.interval_68[1] - one.interval_68[0]);
        for (probability, ends) in [("68 %", one.interval_68), ("95 %", one.interval_95)] {
            let [from, to] = ends.map(|end| to_digits_of(end, spread));
            intervals.add_row(vec![one.key.clone(), probability.into(), from, to, one.unit.into()]);
        }
        chains.add_row(vec![
            one.key.clone(),
            to_digits_of(one.median, spread),
            one.autocorrelation_steps.map_or("not known".into(), |steps| format!("{steps:.1}")),
            format!("{:.0}", one.effective_samples),
        ]);
    }
    out.table(intervals);
    out.gap();
    out.table(chains);
    if sample.parameters.len() > 1 {
        out.heading("Correlations of the posterior");
        let known = |row: usize, column: usize| Some(sample.correlation[row][column]);
        out.table(correlations(sample.parameters.iter().map(|one| one.key.as_str()), known));
    }
    out.gap();
    out.words(
        format!(
            "  effective: independent draws that {} walkers of {} steps are worth, the first {} steps not used; {} \
             evaluations, {:.0} % of the moves accepted",
            sample.walkers,
            sample.steps,
            sample.burn_in_steps,
            sample.evaluations,
            100.0 * sample.acceptance
        ),
        4,
    );
    out.gap();
    for one in &sample.parameters {
        out.words(format!("Prior of {}: {}", one.key, one.prior), 2);
    }
    for doubt in doubts(sample) {
        out.verdict(doubt, 2);
    }
}

/// Warnings about the sample.
fn doubts(sample: &Posterior) -> Vec<String> {
    let mut said = Vec::new();
    if !sample.converged {
        let shortest =
            sample.parameters.iter().map(|one| one.autocorrelation_steps.map_or(0.0, |time| one.steps as f64 / time));
        said.push(format!(
            "Warning: the sample is too short. It is {:.0} autocorrelation times long (50 are needed) and worth {:.0} independent \
             draws of {} wanted. All evaluations are used up; allow more with --posterior-evaluations.",
            shortest.fold(f64::INFINITY, f64::min),
            sample.effective_samples,
            sample.wanted_samples
        ));
    }
    for one in sample.parameters.iter().filter(|one| one.ended_by_prior) {
        said.push(format!(
            "Warning: the posterior of {} reaches an end of its prior ({}); its interval depends on that.",
            one.key, one.prior
        ));
    }
    said
}

/// Source of the method.
pub(super) fn source() -> Source {
    Source::new(
        "Sample of the posterior: an ensemble of walkers, differential evolution and stretch moves",
        "ter Braak 2006, Stat. Comput. 16, 239; Goodman & Weare 2010, Comm. App. Math. Comp. Sci. 5, 65; Foreman-Mackey et al. 2013, PASP 125, 306",
    )
}
