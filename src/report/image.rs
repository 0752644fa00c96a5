//! `ctiplan readout` and `ctiplan correct`.

use serde_json::{Value, json};

use super::{Report, lines, or_dash, table, traps_json, wrapped};
use crate::image::{Done, FrameDone, HduDone, Task, Uncertain};
use crate::readout::Method;

impl Report for Done {
    fn text(&self) -> String {
        let at = &self.at;
        let mut out = wrapped(
            &format!(
                "{}, {} yr after launch, {:.3e} MeV/g, {} K, {} ms per row: trails {}",
                self.mission,
                at.t_yr,
                self.dose_mev_g,
                at.temperature_k,
                at.line_time_ms,
                if self.task == Task::Readout { "added" } else { "taken out" }
            ),
            2,
        );
        out.push_str(&wrapped(&format!("Frames are {}. {}", self.geometry.sides(), accuracy(self.method)), 2));
        out.push('\n');
        let mut hdus =
            table(&["HDU", "name", "size [px]", "gain [e-/DN]", "change [e-]", "missing", "saturated", "clipped"]);
        for hdu in &self.hdus {
            let name = hdu.name.clone().unwrap_or_else(|| "-".into());
            hdus.add_row(match &hdu.frame {
                None => {
                    let mut row = vec![hdu.index.to_string(), name, "copied".into()];
                    row.resize(8, "-".into());
                    row
                }
                Some(frame) => vec![
                    hdu.index.to_string(),
                    name,
                    format!("{} x {}", frame.shape.1, frame.shape.0),
                    frame.gain_e_per_dn.to_string(),
                    format!("{:.4}", frame.largest_change_e),
                    frame.missing_px.to_string(),
                    frame.saturated_px.to_string(),
                    frame.clipped_px.to_string(),
                ],
            });
        }
        out.push_str(&lines(&hdus));
        if self.task != Task::Readout {
            out.push_str("\nResidual of the forward model against the observed frame\n");
            let mut residuals = table(&[
                "HDU",
                "iterations",
                "rms before [e-]",
                "after [e-]",
                "largest before [e-]",
                "after [e-]",
                "noise",
            ]);
            for (hdu, frame) in self.frames() {
                let (Some(first), Some(uncertain)) = (frame.residuals.first(), &frame.uncertain) else { continue };
                let last = uncertain.left;
                residuals.add_row(vec![
                    hdu.index.to_string(),
                    (frame.residuals.len() - 1).to_string(),
                    format!("{:.3e}", first.rms_e),
                    format!("{:.3e}", last.rms_e),
                    format!("{:.3e}", first.max_e),
                    format!("{:.3e}", last.max_e),
                    or_dash(frame.noise_amplification.map(|factor| format!("x {factor:.3}"))),
                ]);
            }
            out.push_str(&lines(&residuals));
            for (hdu, frame) in self.frames() {
                let Some(uncertain) = &frame.uncertain else { continue };
                let besides = match uncertain.count() {
                    0 => String::new(),
                    pixels => format!(", but for {pixels} uncertain pixels"),
                };
                let error = format!(
                    "HDU {}: if the model is right, the error of a pixel is below {:.1e} e-",
                    hdu.index, uncertain.error_e
                );
                out.push_str(&wrapped(&format!("{error}{besides}."), 2));
            }
        }
        for warning in &self.warnings {
            out.push_str(&wrapped(&format!("\nWarning: {warning}"), 2));
        }
        out
    }

    fn json(&self) -> Value {
        let hdus: Vec<Value> = self.hdus.iter().map(hdu_json).collect();
        json!({
            "mission": self.mission,
            "task": self.task.word(),
            "t_yr": self.at.t_yr,
            "dose_mev_g": self.dose_mev_g,
            "traps": traps_json(&self.traps),
            "temperature_k": self.at.temperature_k,
            "line_time_ms": self.at.line_time_ms,
            "relative": relative(self.method),
            "hdus": hdus,
            "warnings": self.warnings.iter().map(ToString::to_string).collect::<Vec<_>>(),
        })
    }

    fn csv(&self) -> Vec<Vec<String>> {
        let header = [
            "hdu",
            "name",
            "rows_px",
            "columns_px",
            "gain_e_per_dn",
            "largest_change_e",
            "missing_px",
            "saturated_px",
            "clipped_px",
            "iterations",
            "rms_before_e",
            "rms_after_e",
            "max_before_e",
            "max_after_e",
            "noise_amplification",
            "uncertain_px",
            "error_e",
        ];
        let mut rows = vec![header.map(str::to_string).to_vec()];
        for (hdu, frame) in self.frames() {
            let mut row = vec![
                hdu.index.to_string(),
                hdu.name.clone().unwrap_or_default(),
                frame.shape.0.to_string(),
                frame.shape.1.to_string(),
                frame.gain_e_per_dn.to_string(),
                frame.largest_change_e.to_string(),
                frame.missing_px.to_string(),
                frame.saturated_px.to_string(),
                frame.clipped_px.to_string(),
            ];
            if let (Some(first), Some(uncertain)) = (frame.residuals.first(), &frame.uncertain) {
                let last = uncertain.left;
                row.push((frame.residuals.len() - 1).to_string());
                row.extend([first.rms_e, last.rms_e, first.max_e, last.max_e].map(|value| value.to_string()));
                row.push(frame.noise_amplification.map_or(String::new(), |factor| factor.to_string()));
                row.extend([uncertain.count().to_string(), uncertain.error_e.to_string()]);
            }
            row.resize(header.len(), String::new());
            rows.push(row);
        }
        rows
    }
}

impl Done {
    fn frames(&self) -> impl Iterator<Item = (&HduDone, &FrameDone)> {
        self.hdus.iter().filter_map(|hdu| hdu.frame.as_ref().map(|frame| (hdu, frame)))
    }
}

fn relative(method: Method) -> Option<f64> {
    if let Method::Fast { relative } = method { Some(relative) } else { None }
}

fn accuracy(method: Method) -> String {
    match method {
        Method::Fast { relative } => {
            format!("Transfers are computed to {relative} of the largest displacement of charge in a frame.")
        }
        Method::Exact => "Every transfer is computed.".into(),
        Method::Fractional { levels } => format!("Every transfer is computed, with {levels} traps of each species."),
        Method::MonteCarlo { seed } => format!("Traps are random (seed {seed})."),
    }
}

fn hdu_json(hdu: &HduDone) -> Value {
    let mut json = json!({"hdu": hdu.index, "name": hdu.name, "copied": hdu.frame.is_none()});
    let Some(frame) = &hdu.frame else { return json };
    let more = json!({
        "rows_px": frame.shape.0,
        "columns_px": frame.shape.1,
        "gain_e_per_dn": frame.gain_e_per_dn,
        "largest_change_e": frame.largest_change_e,
        "missing_px": frame.missing_px,
        "saturated_px": frame.saturated_px,
        "clipped_px": frame.clipped_px,
    });
    let correction = json!({
        "iterations": frame.residuals.len().saturating_sub(1),
        "converged": frame.converged,
        "residuals": frame.residuals.iter()
            .map(|residual| json!({"rms_e": residual.rms_e, "max_e": residual.max_e}))
            .collect::<Vec<_>>(),
        "noise_amplification": frame.noise_amplification,
        "uncertain_px": frame.uncertain.as_ref().map(Uncertain::count),
        "error_e": frame.uncertain.as_ref().map(|uncertain| uncertain.error_e),
        "left": frame.uncertain.as_ref()
            .map(|uncertain| json!({"rms_e": uncertain.left.rms_e, "max_e": uncertain.left.max_e})),
    });
    let members = json.as_object_mut().expect("an object");
    members.extend(more.as_object().expect("an object").clone());
    if !frame.residuals.is_empty() {
        members.extend(correction.as_object().expect("an object").clone());
    }
    json
}
