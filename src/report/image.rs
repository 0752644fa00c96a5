//! `ctiplan readout` and `ctiplan correct`.

use super::{Report, lines, or_dash, table, wrapped};
use crate::image::{CompanionsDone, Done, FrameDone, HduDone, LeftOut, QualityDone, Task, Transfers};
use crate::readout::Method;

impl Report for Done {
    fn text(&self) -> String {
        let mut out = self.heading();
        out.push('\n');
        out.push_str(&self.changes());
        if self.task != Task::Readout {
            out.push_str("\nResidual of the forward model against the observed frame\n");
            out.push_str(&self.residuals());
            out.push_str(&self.pixel_errors());
        }
        for warning in &self.warnings {
            out.push_str(&wrapped(&format!("\nWarning: {warning}"), 2));
        }
        out
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
                frame.gain_e_per_dn.map_or(String::new(), |gain| gain.to_string()),
                frame.largest_change_e.to_string(),
                frame.missing_px.to_string(),
                frame.saturated_px.to_string(),
                frame.clipped_px.to_string(),
            ];
            if let (Some(first), Some(uncertain)) = (frame.residuals.first(), &frame.uncertain) {
                let last = uncertain.left;
                row.push((frame.residuals.len() - 1).to_string());
                row.extend([first.rms_e, last.rms_e, first.max_e, last.max_e].map(|value| value.to_string()));
                row.push(frame.noise.as_ref().map_or(String::new(), |noise| noise.ratio_rms.to_string()));
                row.extend([uncertain.count().to_string(), uncertain.error_e.to_string()]);
            }
            row.resize(header.len(), String::new());
            rows.push(row);
        }
        rows
    }
}

impl Done {
    /// The mission and its conditions, the positions of the amplifiers, and the method for the transfers.
    fn heading(&self) -> String {
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
        let lies = match &self.amplifiers {
            None => format!("Frames are {}.", self.geometry.sides()),
            Some(table) => format!("Amplifiers are those of {table}."),
        };
        out.push_str(&wrapped(&format!("{lies} {}", accuracy(self.method)), 2));
        out
    }

    /// One row for each HDU: the change of its pixels, or its treatment if it is not a frame.
    fn changes(&self) -> String {
        let mut hdus =
            table(&["HDU", "name", "size [px]", "gain [e-/DN]", "change [e-]", "missing", "saturated", "clipped"]);
        for hdu in &self.hdus {
            let name = hdu.name.clone().unwrap_or_else(|| "-".into());
            hdus.add_row(match &hdu.frame {
                None => {
                    let mut row = vec![hdu.index.to_string(), name, self.beside(hdu.index).into()];
                    row.resize(8, "-".into());
                    row
                }
                Some(frame) => vec![
                    hdu.index.to_string(),
                    name,
                    format!("{} x {}", frame.shape.1, frame.shape.0),
                    frame.gain_e_per_dn.map_or("several".into(), |gain| gain.to_string()),
                    format!("{:.4}", frame.largest_change_e),
                    frame.missing_px.to_string(),
                    frame.saturated_px.to_string(),
                    frame.clipped_px.to_string(),
                ],
            });
        }
        lines(&hdus) + &self.left_out()
    }

    /// Images that are no frames, by the reason.
    fn left_out(&self) -> String {
        let mut by_reason: Vec<(LeftOut, Vec<String>)> = Vec::new();
        for hdu in &self.hdus {
            let Some(why) = hdu.left_out.filter(|why| !why.is_doubtful()) else { continue };
            let name = format!("HDU {} ({})", hdu.index, hdu.name.as_deref().unwrap_or("-"));
            match by_reason.iter_mut().find(|(known, _)| *known == why) {
                Some((_, names)) => names.push(name),
                None => by_reason.push((why, vec![name])),
            }
        }
        let said = by_reason.iter().map(|(why, names)| wrapped(&format!("Left out: {}: {why}.", names.join(", ")), 2));
        said.collect()
    }

    /// One row for each corrected frame: the residuals of the forward model, before and after.
    fn residuals(&self) -> String {
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
                or_dash(frame.noise.as_ref().map(|noise| format!("x {:.3}", noise.ratio_rms))),
            ]);
        }
        lines(&residuals)
    }

    /// Errors of the pixels of corrected frames, and the changes of their noise and companions.
    fn pixel_errors(&self) -> String {
        let mut out = String::new();
        for (hdu, frame) in self.frames() {
            let Some(uncertain) = &frame.uncertain else { continue };
            let besides = match uncertain.count() {
                0 => String::new(),
                pixels => format!(", but for {pixels} uncertain pixels"),
            };
            let unknown = match frame.missing_px + frame.saturated_px {
                0 => String::new(),
                pixels => format!(", and {pixels} missing or saturated pixels held what is assumed of them"),
            };
            let error = format!(
                "HDU {}: if the model is right{unknown}, the error of a pixel is below {:.1e} e-",
                hdu.index, uncertain.error_e
            );
            out.push_str(&wrapped(&format!("{error}{besides}."), 2));
            out.push_str(&correlation(hdu.index, frame));
            out.push_str(&beside(hdu.index, frame.beside));
        }
        out
    }

    /// The treatment of an HDU that is not a frame.
    fn beside(&self, index: usize) -> &'static str {
        let all = || self.frames().map(|(_, frame)| frame.beside);
        if all().any(|beside| beside.errors.is_some_and(|(hdu, _)| hdu == index)) {
            "propagated"
        } else if all().any(|beside| beside.quality.is_some_and(|quality| quality.hdu == index && quality.set_px > 0)) {
            "bits set"
        } else {
            "copied"
        }
    }

    fn frames(&self) -> impl Iterator<Item = (&HduDone, &FrameDone)> {
        self.hdus.iter().filter_map(|hdu| hdu.frame.as_ref().map(|frame| (hdu, frame)))
    }
}

/// Correlation of the noise of neighbouring pixels.
fn correlation(index: usize, frame: &FrameDone) -> String {
    let Some(noise) = &frame.noise else { return String::new() };
    let transfers = frame.amplifiers.0.first().map(|amplifier| amplifier.geometry.transfers);
    let mut out = String::new();
    for (there, correlation, what) in [
        (transfers.is_some_and(Transfers::parallel), &noise.correlation_rows, "rows"),
        (transfers.is_some_and(Transfers::serial), &noise.correlation_columns, "columns"),
    ] {
        if there {
            let values: Vec<String> = correlation.iter().map(|value| format!("{value:.4}")).collect();
            let last = values.len();
            let line = format!("HDU {index}: correlation of noise 1 to {last} {what} apart: {}.", values.join(", "));
            out += &wrapped(&line, 2);
        }
    }
    out
}

/// The use of errors and data quality of a frame.
fn beside(index: usize, done: CompanionsDone) -> String {
    let mut out = String::new();
    if let Some((hdu, ratio)) = done.errors {
        out += &wrapped(
            &format!("HDU {index}: errors in HDU {hdu} propagated through the correction, x {ratio:.3} rms."),
            2,
        );
    }
    if let Some(QualityDone { hdu, bad_px, saturated_px, set_px }) =
        done.quality.filter(|quality| quality.bad_px + quality.saturated_px + quality.set_px > 0)
    {
        let used =
            format!("HDU {index}: data quality in HDU {hdu} marks {bad_px} bad and {saturated_px} saturated pixels");
        let set = if set_px > 0 { format!("; the bit of uncertain ones was set in {set_px}") } else { String::new() };
        out += &wrapped(&format!("{used}{set}."), 2);
    }
    out
}

fn accuracy(method: Method) -> String {
    match method {
        Method::Fast { relative } => {
            format!("Transfers are computed to {relative} of the largest displacement of charge in a frame.")
        }
        Method::CarriedTraps => {
            "Every transfer is computed; traps of a pixel start as they were left nearer to the register.".into()
        }
        Method::Exact => "Every transfer is computed.".into(),
        Method::Fractional { levels } => format!("Every transfer is computed, with {levels} traps of each species."),
        Method::MonteCarlo { seed } => format!("Traps are random (seed {seed})."),
    }
}
