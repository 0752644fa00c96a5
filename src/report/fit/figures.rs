//! Profiles of chi2, and the posterior of each parameter and each pair: a corner plot.

use super::FitReport;
use crate::analysis::fit::posterior::{Marginal, Posterior, Prior};
use crate::analysis::fit::profile::{LEVELS, Profile};
use crate::report::plot::{Figure, Mark, Panel, Series, dashed, level, line, points};

/// Bins of a histogram.
const BINS: usize = 24;

/// Maximum number of draws shown as points.
const POINTS: usize = 1000;

impl FitReport {
    /// Figures with their file names.
    pub(super) fn drawn(&self) -> Vec<(String, Figure)> {
        let mut figures: Vec<(String, Figure)> = self.profiles.iter().map(profile).collect();
        figures.extend(self.posterior.as_ref().map(|sample| ("corner.svg".into(), corner(sample))));
        figures
    }
}

/// chi2 against a parameter, with the increases that define its intervals.
fn profile(profile: &Profile) -> (String, Figure) {
    let shown = || profile.curve.iter().filter(|point| point.delta_chi2 < 3.0 * LEVELS[LEVELS.len() - 1].0);
    let x: Vec<f64> = shown().map(|point| point.value).collect();
    let y: Vec<f64> = shown().map(|point| point.delta_chi2).collect();
    let mut series = vec![line("", 1, &x, y.clone()), points("all others fitted again", 1, &x, y)];
    series.extend(LEVELS.map(|(rise, confidence)| level(&format!("+ {rise}: {:.0} %", 100.0 * confidence), rise)));
    let panel = Panel {
        x_label: labelled(&profile.key, profile.unit),
        y_label: "chi2 less that of the fit".into(),
        series,
        ..Panel::default()
    };
    let name = format!("profile-{}.svg", profile.key.replace(['/', '\\'], "-"));
    (name, Figure { title: format!("Profile of {}", profile.key), panels: vec![panel] })
}

/// Histograms on the diagonal, pairs of parameters below it.
fn corner(sample: &Posterior) -> Figure {
    let row = |row: usize| {
        let mut panels: Vec<Panel> = (0..row).map(|column| pair(sample, column, row)).collect();
        panels.push(histogram(sample, row));
        let mut panels = panels.into_iter();
        let first = panels.next().expect("a row has a panel");
        Panel { beside: panels.collect(), ..first }
    };
    let title = format!("Posterior: {} draws", sample.draws.len());
    Figure { title, panels: (0..sample.parameters.len()).map(row).collect() }
}

/// Fraction of the draws in each bin, with the median and the central 68 %.
fn histogram(sample: &Posterior, place: usize) -> Panel {
    let of = &sample.parameters[place];
    let values: Vec<f64> = sample.draws.iter().map(|draw| draw[place]).collect();
    let along = |value: f64| if is_log(of) { value.ln() } else { value };
    let back = |at: f64| if is_log(of) { at.exp() } else { at };
    let low = values.iter().map(|value| along(*value)).fold(f64::INFINITY, f64::min);
    let high = values.iter().map(|value| along(*value)).fold(f64::NEG_INFINITY, f64::max);
    let mut counts = [0.0; BINS];
    for value in &values {
        let bin = ((along(*value) - low) / (high - low) * BINS as f64).floor();
        counts[(bin.max(0.0) as usize).min(BINS - 1)] += 100.0 / values.len() as f64;
    }
    // Each bin is a step, at its height from edge to edge.
    let edge = |bin: usize| back(low + (high - low) * bin as f64 / BINS as f64);
    let x: Vec<f64> = (0..BINS).flat_map(|bin| [edge(bin), edge(bin + 1)]).collect();
    let y: Vec<f64> = counts.iter().flat_map(|count| [*count, *count]).collect();
    let zero = vec![0.0; y.len()];
    let most = counts.iter().copied().fold(0.0, f64::max);
    let upright = |label: &str, value: f64| dashed(label, 2, &[value, value], vec![0.0, most]);
    let [from, to] = of.interval_68;
    let mut series = vec![
        Series { label: None, color: 1, kind: Mark::Band { x: x.clone(), low: zero, high: y.clone() } },
        line("", 1, &x, y),
        Series { label: None, color: 2, kind: Mark::Shade { from, to } },
        upright("", of.median),
    ];
    series.retain(|series| !matches!(&series.kind, Mark::Shade { from, to } if from == to));
    Panel { x_label: short(of), x_log: is_log_scale(of), series, ..Panel::default() }
}

/// Draws of two parameters.
fn pair(sample: &Posterior, across: usize, up: usize) -> Panel {
    let every = sample.draws.len().div_ceil(POINTS).max(1);
    let column = |place: usize| sample.draws.iter().step_by(every).map(|draw| draw[place]).collect::<Vec<f64>>();
    let (x_of, y_of) = (&sample.parameters[across], &sample.parameters[up]);
    let draws = Mark::Points { x: column(across), y: column(up), sigma: None };
    Panel {
        x_label: short(x_of),
        y_label: short(y_of),
        x_log: is_log_scale(x_of),
        y_log: is_log_scale(y_of),
        series: vec![Series { label: None, color: 1, kind: draws }],
        ..Panel::default()
    }
}

fn is_log(of: &Marginal) -> bool {
    matches!(of.prior, Prior::FlatInLogarithm { .. })
}

/// Whether the values span more than a factor of 3, so that a logarithmic axis shows more.
fn is_log_scale(of: &Marginal) -> bool {
    is_log(of) && of.interval_95[1] > 3.0 * of.interval_95[0]
}

/// The last two parts of a key, with the unit.
fn short(of: &Marginal) -> String {
    let parts: Vec<&str> = of.key.split('.').collect();
    labelled(&parts[parts.len().saturating_sub(2)..].join("."), of.unit)
}

fn labelled(name: &str, unit: &str) -> String {
    if unit.is_empty() { name.into() } else { format!("{name} [{unit}]") }
}
