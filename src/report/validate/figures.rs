//! Data, model and residuals as figures.

use crate::analysis::measurement::DataSet;
use crate::analysis::validate::residual_trend::Trend;
use crate::analysis::validate::{SetResult, Validation, file_stem, plain_name};
use crate::report::chance;
use crate::report::plot::label::{counts, label, setting};
use crate::report::plot::{Figure, Mark, Panel, Series};

/// Maximum number of groups of rows, one for each colour; further ones are not drawn.
const COLOURS: usize = 6;

impl Validation {
    /// Figures with their file names: for each data set the data against its first varying condition with model and residuals, and
    /// the residuals against every varying condition.
    pub(in crate::report) fn drawn(&self) -> Vec<(String, Figure)> {
        let mut figures = Vec::new();
        for (index, set) in self.sets.iter().enumerate() {
            let name = file_stem(index, &set.data);
            let along = set.data.varying.iter().find(|name| *name == "trail_px").or(set.data.varying.first());
            if let Some(along) = along {
                figures.push((format!("{name}.svg"), data_and_model(set, along)));
            }
            for trend in self.trends.iter().filter(|trend| trend.set == index) {
                figures.push((format!("{name}-{}.svg", plain_name(&trend.name)), residuals(set, trend)));
            }
        }
        figures
    }
}

/// Data with errors and model above, residuals below, against one condition; rows with different values of another are
/// distinguished.
fn data_and_model(set: &SetResult, along: &str) -> Figure {
    let at = set.data.against(along);
    let residuals = set.residuals();
    let (groups, left_out) = groups(&set.data, along);
    let not_drawn =
        if left_out > 0 { format!(" ({left_out} rows are left to the other figures)") } else { String::new() };
    let log = is_log(&at);
    let all_positive = set.data.rows.iter().all(|row| row.value > 0.0);
    let wide = {
        let values = set.data.rows.iter().map(|row| row.value.abs());
        let (low, high) = values.fold((f64::INFINITY, 0.0_f64), |(low, high), value| (low.min(value), high.max(value)));
        high > 30.0 * low
    };
    let mut data = Vec::new();
    let mut below = vec![Series { label: None, color: 0, kind: Mark::Level { y: 0.0, dashed: false } }];
    for (color, (name, rows)) in groups.iter().enumerate() {
        let pick = |value: &dyn Fn(usize) -> f64| rows.iter().map(|&row| value(row)).collect::<Vec<f64>>();
        let x = pick(&|row| at[row]);
        let points = Mark::Points {
            x: x.clone(),
            y: pick(&|row| set.data.rows[row].value),
            sigma: Some(pick(&|row| set.data.rows[row].sigma)),
        };
        data.push(Series { label: Some(name.clone()), color, kind: points });
        data.push(Series {
            label: (color == 0).then(|| "model".into()),
            color,
            kind: Mark::Line { x: x.clone(), y: pick(&|row| set.model[row]), dashed: false },
        });
        let y = pick(&|row| residuals[row]);
        below.push(Series { label: None, color, kind: Mark::Points { x, y, sigma: None } });
    }
    Figure {
        title: format!("{}: data and model{not_drawn}", set.name()),
        panels: vec![
            Panel {
                x_label: label(along),
                y_label: set.data.observable.card().label.into(),
                x_log: log,
                y_log: all_positive && wide,
                x_counts: counts(along),
                series: data,
                height_share: 1.6,
                ..Panel::default()
            },
            Panel {
                x_label: label(along),
                y_label: "(data − model)/σ".into(),
                x_log: log,
                y_log: false,
                x_counts: counts(along),
                series: below,
                ..Panel::default()
            },
        ],
    }
}

/// Residuals of all rows against one condition, the means of its bins, and the band of noise alone.
fn residuals(set: &SetResult, trend: &Trend) -> Figure {
    let at = set.data.against(&trend.name);
    let centre = |rows: &[usize]| rows.iter().map(|&row| at[row]).sum::<f64>() / rows.len() as f64;
    let x: Vec<f64> = trend.bins.iter().map(|bin| centre(&bin.rows)).collect();
    let band = |sign: f64| trend.bins.iter().map(|bin| sign * 2.0 * bin.error_sigma).collect::<Vec<f64>>();
    let means = trend.bins.iter().map(|bin| bin.mean_sigma).collect();
    let errors = trend.bins.iter().map(|bin| bin.error_sigma).collect();
    let series = vec![
        Series {
            label: Some("95 % of bin means of noise alone".into()),
            color: 6,
            kind: Mark::Band { x: x.clone(), low: band(-1.0), high: band(1.0) },
        },
        Series {
            label: Some("rows".into()),
            color: 0,
            kind: Mark::Points { x: at.clone(), y: set.residuals(), sigma: None },
        },
        Series { label: Some("bin means".into()), color: 2, kind: Mark::Points { x, y: means, sigma: Some(errors) } },
        Series { label: None, color: 0, kind: Mark::Level { y: 0.0, dashed: false } },
    ];
    Figure {
        title: format!("{}: residuals against {} (p-value {})", set.name(), trend.name, chance(trend.false_alarm)),
        panels: vec![Panel {
            x_label: label(&trend.name),
            y_label: "(data − model)/σ".into(),
            x_log: is_log(&at),
            y_log: false,
            x_counts: counts(&trend.name),
            series,
            ..Panel::default()
        }],
    }
}

/// Rows grouped by what else varies, in order of appearance, at most one group per colour; and the number of other rows.
fn groups(data: &DataSet, along: &str) -> (Vec<(String, Vec<usize>)>, usize) {
    let others: Vec<(&String, Vec<f64>)> =
        data.varying.iter().filter(|name| *name != along).map(|name| (name, data.against(name))).collect();
    let mut groups: Vec<(String, Vec<usize>)> = Vec::new();
    let mut left_out = 0;
    for (row, measured) in data.rows.iter().enumerate() {
        let said: Vec<String> = others
            .iter()
            .map(|(name, at)| match measured.word(name) {
                Some(word) => word.to_string(),
                None => setting(name, at[row]),
            })
            .collect();
        let name = if said.is_empty() { "data".into() } else { said.join(", ") };
        match groups.iter().position(|(known, _)| *known == name) {
            Some(group) => groups[group].1.push(row),
            None if groups.len() < COLOURS => groups.push((name, vec![row])),
            None => left_out += 1,
        }
    }
    (groups, left_out)
}

/// Whether a condition needs a logarithmic axis.
fn is_log(at: &[f64]) -> bool {
    let finite = at.iter().copied().filter(|at| at.is_finite());
    let (low, high) = finite.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), at| (low.min(at), high.max(at)));
    low > 0.0 && high > 20.0 * low
}
