//! Results for a file as the JSON document that `ctiplan readout` and `ctiplan correct` print.

use serde::ser::{Serialize, Serializer};

use super::{Done, FrameDone, HduDone, QualityDone, Residual, Uncertain};
use crate::physics::SpeciesState;
use crate::readout::Method;
use crate::warning::Warning;

#[derive(serde::Serialize)]
struct Document<'a> {
    mission: &'a str,
    task: &'static str,
    t_yr: f64,
    dose_mev_g: f64,
    traps: &'a [SpeciesState],
    temperature_k: f64,
    line_time_ms: f64,
    /// Only for the fast readout.
    relative: Option<f64>,
    hdus: Vec<OneHdu<'a>>,
    warnings: &'a [Warning],
}

#[derive(serde::Serialize)]
struct OneHdu<'a> {
    hdu: usize,
    name: Option<&'a str>,
    copied: bool,
    /// Why an image is no frame.
    #[serde(skip_serializing_if = "Option::is_none")]
    left_out: Option<String>,
    #[serde(flatten)]
    frame: Option<Frame>,
    #[serde(flatten)]
    correction: Option<Correction<'a>>,
}

#[derive(serde::Serialize)]
struct Frame {
    /// The amplifiers of a table.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    amplifiers: Vec<OneAmplifier>,
    rows_px: usize,
    columns_px: usize,
    gain_e_per_dn: Option<f64>,
    largest_change_e: f64,
    missing_px: usize,
    saturated_px: usize,
    clipped_px: usize,
}

#[derive(serde::Serialize)]
struct OneAmplifier {
    name: String,
    section: String,
    read: String,
    gain_e_per_dn: f64,
    bias_dn: f64,
    read_noise_e: Option<f64>,
    traps: Vec<SpeciesState>,
}

#[derive(serde::Serialize)]
struct Correction<'a> {
    iterations: usize,
    converged: bool,
    residuals: &'a [Residual],
    noise_amplification: Option<f64>,
    /// Correlation of its pixels, 1, 2, ... rows and columns apart.
    noise_correlation: Option<Correlation<'a>>,
    uncertain_px: Option<usize>,
    error_e: Option<f64>,
    left: Option<Residual>,
    errors: Option<Errors>,
    quality: Option<QualityDone>,
}

#[derive(serde::Serialize)]
struct Correlation<'a> {
    rows: &'a [f64],
    columns: &'a [f64],
}

#[derive(serde::Serialize)]
struct Errors {
    hdu: usize,
    ratio_rms: f64,
}

impl Serialize for Done {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        let relative = if let Method::Fast { relative } = self.method { Some(relative) } else { None };
        let document = Document {
            mission: &self.mission,
            task: self.task.word(),
            t_yr: self.at.t_yr,
            dose_mev_g: self.dose_mev_g,
            traps: &self.traps,
            temperature_k: self.at.temperature_k,
            line_time_ms: self.at.line_time_ms,
            relative,
            hdus: self.hdus.iter().map(|hdu| OneHdu::of(hdu, &self.hdus)).collect(),
            warnings: &self.warnings,
        };
        document.serialize(to)
    }
}

impl<'a> OneHdu<'a> {
    fn of(done: &'a HduDone, all: &[HduDone]) -> OneHdu<'a> {
        let beside = |hdu: &HduDone| hdu.frame.as_ref().is_some_and(|frame| frame.beside.changed(done.index));
        let corrected = done.frame.as_ref().filter(|frame| !frame.residuals.is_empty());
        OneHdu {
            hdu: done.index,
            name: done.name.as_deref(),
            copied: done.frame.is_none() && !all.iter().any(beside),
            left_out: done.left_out.map(|why| why.to_string()),
            frame: done.frame.as_ref().map(Frame::of),
            correction: corrected.map(Correction::of),
        }
    }
}

impl Frame {
    fn of(done: &FrameDone) -> Frame {
        let amplifiers = done.amplifiers.0.iter().filter_map(|amplifier| {
            Some(OneAmplifier {
                name: amplifier.name.clone()?,
                section: amplifier.section(),
                read: amplifier.geometry.sides(),
                gain_e_per_dn: amplifier.scale.gain_e_per_dn,
                bias_dn: amplifier.scale.bias_dn,
                read_noise_e: amplifier.read_noise_e,
                traps: amplifier.device.traps.clone(),
            })
        });
        Frame {
            amplifiers: amplifiers.collect(),
            rows_px: done.shape.0,
            columns_px: done.shape.1,
            gain_e_per_dn: done.gain_e_per_dn,
            largest_change_e: done.largest_change_e,
            missing_px: done.missing_px,
            saturated_px: done.saturated_px,
            clipped_px: done.clipped_px,
        }
    }
}

impl<'a> Correction<'a> {
    fn of(done: &'a FrameDone) -> Correction<'a> {
        let uncertain = done.uncertain.as_ref();
        Correction {
            iterations: done.residuals.len().saturating_sub(1),
            converged: done.converged,
            residuals: &done.residuals,
            noise_amplification: done.noise.as_ref().map(|noise| noise.ratio_rms),
            noise_correlation: done
                .noise
                .as_ref()
                .map(|noise| Correlation { rows: &noise.correlation_rows, columns: &noise.correlation_columns }),
            uncertain_px: uncertain.map(Uncertain::count),
            error_e: uncertain.map(|uncertain| uncertain.error_e),
            left: uncertain.map(|uncertain| uncertain.left),
            errors: done.beside.errors.map(|(hdu, ratio_rms)| Errors { hdu, ratio_rms }),
            quality: done.beside.quality,
        }
    }
}
