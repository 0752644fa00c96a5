//! Frame values to electrons and back.
//!
//! ```text
//! charge [e-] = (value − bias) · gain
//! ```
//!
//! Values are in electrons if BUNIT says so; otherwise the gain must be given, or the keyword that holds it.

use fitsio_pure::value::Value;

use super::fits::Hdu;
use super::frame::Geometry;
use crate::error::InputError;

/// The meaning of frame values.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Unit {
    /// Electrons per DN.
    pub gain_e_per_dn: Option<f64>,
    /// Header keyword that holds the gain.
    pub gain_keyword: Option<String>,
    /// Level of zero charge, in the frame's own unit; none: 0, but counts with a prescan or an overscan are rejected.
    pub bias_dn: Option<f64>,
    /// Value at which the converter saturates, in the frame's own unit; none: saturation only at full well.
    pub saturated_dn: Option<f64>,
}

/// Electrons per unit of a frame, and its level of zero charge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scale {
    /// Electrons per unit of the frame.
    pub gain_e_per_dn: f64,
    /// Level of zero charge, in the frame's unit.
    pub bias_dn: f64,
}

impl Scale {
    /// Charge of a value, e-.
    pub fn charge_e(self, value: f64) -> f64 {
        (value - self.bias_dn) * self.gain_e_per_dn
    }

    /// Value of a charge (e-).
    pub fn value(self, charge_e: f64) -> f64 {
        charge_e / self.gain_e_per_dn + self.bias_dn
    }
}

/// The unit in BUNIT.
enum Written {
    Electrons,
    Counts,
    Rate,
    Nothing,
    Other,
}

impl Unit {
    /// The scale of an HDU. The gain's keyword is searched in its header, then in the primary one.
    ///
    /// # Errors
    /// If neither the headers nor the options give the gain, or they contradict each other.
    pub fn scale(&self, hdu: &Hdu, primary: &Hdu) -> Result<Scale, InputError> {
        let refusal = |problem: String, help: &str| Err(InputError::new(hdu.to_string(), problem).with_help(help));
        let bunit = hdu.text("BUNIT").unwrap_or_default();
        let written = written(&bunit);
        if let Written::Rate = written {
            return refusal(
                format!("BUNIT = '{bunit}' is a rate; traps meet charges"),
                "multiply the image by its exposure time, and set BUNIT",
            );
        }
        let gain = match (&self.gain_keyword, self.gain_e_per_dn) {
            (Some(keyword), _) => Some(gain_of(keyword, hdu, primary)?),
            (None, given) => given,
        };
        let gain_e_per_dn = match (written, gain) {
            (Written::Electrons, Some(gain)) if gain != 1.0 => {
                return refusal(
                    format!("BUNIT = '{bunit}', and a gain of {gain} e-/DN was given"),
                    "leave out the gain, or correct BUNIT",
                );
            }
            (Written::Electrons, _) => 1.0,
            (_, Some(gain)) => gain,
            (Written::Counts, None) => {
                return refusal(
                    format!("BUNIT = '{bunit}', and no gain was given"),
                    "give --gain-e-per-dn, or --gain-keyword with the keyword of the header that holds it",
                );
            }
            (Written::Nothing, None) => {
                return refusal(
                    "the header has no BUNIT, and no gain was given".into(),
                    "give --gain-e-per-dn (1 where the values are electrons), or --gain-keyword",
                );
            }
            (Written::Other | Written::Rate, None) => {
                return refusal(
                    format!("BUNIT = '{bunit}' is not a number of electrons, and no gain was given"),
                    "give --gain-e-per-dn, electrons per unit of the image",
                );
            }
        };
        Ok(Scale { gain_e_per_dn, bias_dn: self.bias_dn.unwrap_or(0.0) })
    }
}

/// Rejects counts with a prescan or an overscan whose bias is not given: the converter's values there are unlikely to be 0, and all
/// of it would be taken for charge.
pub(super) fn refuse_unknown_bias(hdu: &Hdu, geometry: &Geometry, given_dn: Option<f64>) -> Result<(), InputError> {
    let bunit = hdu.text("BUNIT").unwrap_or_default();
    let counts = matches!(written(&bunit), Written::Counts);
    if given_dn.is_some() || !counts || !geometry.has_dark_pixels() {
        return Ok(());
    }
    let problem = format!("BUNIT = '{bunit}', the frame has a prescan or an overscan, and no bias was given");
    Err(InputError::new(hdu.to_string(), problem))
}

fn gain_of(keyword: &str, hdu: &Hdu, primary: &Hdu) -> Result<f64, InputError> {
    let gain = number_of(keyword, hdu, primary, "give --gain-e-per-dn instead")?;
    if gain > 0.0 && gain.is_finite() {
        Ok(gain)
    } else {
        Err(InputError::new(hdu.to_string(), format!("{keyword} = {gain}: a gain above 0 e-/DN is needed")))
    }
}

/// A number in an HDU's header, or in the primary one; `help` states what to try if neither has it.
pub(crate) fn number_of(keyword: &str, hdu: &Hdu, primary: &Hdu, help: &str) -> Result<f64, InputError> {
    match hdu.value(keyword).or_else(|| primary.value(keyword)) {
        Some(Value::Float(number)) => Ok(*number),
        Some(Value::Integer(number)) => Ok(*number as f64),
        Some(_) => Err(InputError::new(hdu.to_string(), format!("{keyword} is not a number"))),
        None => Err(InputError::new(hdu.to_string(), format!("neither its header nor the primary one has {keyword}"))
            .with_help(help)),
    }
}

/// BUNIT as written by pipelines: ELECTRONS, electron, e-, COUNTS, DN, ADU, ELECTRONS/S, ...
fn written(bunit: &str) -> Written {
    let unit = bunit.trim().to_ascii_lowercase();
    let rate = unit.contains('/') || unit.contains("s-1") || unit.contains("s^-1") || unit.contains("s**-1");
    match unit.as_str() {
        "" => Written::Nothing,
        _ if rate => Written::Rate,
        "electrons" | "electron" | "e-" | "e" => Written::Electrons,
        "counts" | "count" | "ct" | "dn" | "adu" => Written::Counts,
        _ => Written::Other,
    }
}
