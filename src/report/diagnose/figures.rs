//! Figures of a diagnosis: data and model before and after, and the decreasing error.

use crate::analysis::diagnose::{Diagnosis, Rung};
use crate::report::plot::{Figure, Mark, Panel, Series};

impl Diagnosis {
    /// Figures with their file names: the decreasing error, if anything was added, and all of `validate` for the model as given
    /// (fitted) and for the improved one. Those of residuals against a condition have the band of noise alone.
    pub(super) fn drawn(&self) -> Vec<(String, Figure)> {
        let mut figures = Vec::new();
        if !self.steps.is_empty() {
            figures.push(("error.svg".to_string(), self.falling_error()));
        }
        let sides = [("before", &self.before), ("after", &self.after)];
        for (when, validation) in sides.into_iter().take(if self.steps.is_empty() { 1 } else { 2 }) {
            figures.extend(validation.drawn().into_iter().map(|(name, figure)| {
                let title = format!("{when}: {}", figure.title);
                (format!("{when}-{name}"), Figure { title, ..figure })
            }));
        }
        figures
    }

    fn falling_error(&self) -> Figure {
        let rungs: Vec<&Rung> = [&self.baseline].into_iter().chain(self.steps.iter().map(|step| &step.rung)).collect();
        let x: Vec<f64> = (0..rungs.len()).map(|step| step as f64).collect();
        let line = |label: &str, color, y: Vec<f64>| {
            let points = Series {
                label: Some(label.into()),
                color,
                kind: Mark::Points { x: x.clone(), y: y.clone(), sigma: None },
            };
            [points, Series { label: None, color, kind: Mark::Line { x: x.clone(), y, dashed: false } }]
        };
        let mut series = line("all rows, fitted", 1, rungs.iter().map(|rung| rung.rms_sigma()).collect()).to_vec();
        let held_out: Vec<f64> = rungs.iter().map(|rung| rung.holdout_rms_sigma.unwrap_or(f64::NAN)).collect();
        series.extend(line("rows left out", 2, held_out));
        series.push(Series { label: Some("noise alone".into()), color: 0, kind: Mark::Level { y: 1.0, dashed: true } });
        let names: Vec<&str> = self.steps.iter().map(|step| step.effect.as_str()).collect();
        let wide = rungs[0].rms_sigma() > 5.0;
        Figure {
            title: format!("{}: added {}", self.verdict.name(), names.join(", then ")),
            panels: vec![Panel {
                x_label: "effects added".into(),
                y_label: "rms of (data − model)/σ".into(),
                x_log: false,
                y_log: wide,
                x_counts: true,
                series,
                ..Panel::default()
            }],
        }
    }
}
