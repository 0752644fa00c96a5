//! Frame values to electrons and back.
//!
//! ```text
//! charge [e-] = (value − bias) · gain
//! ```
//!
//! Values are in electrons (or in multiples of one) if BUNIT says so; otherwise the gain must be given, or the keyword that holds it.

mod bunit;

use super::fits::Hdu;
use super::frame::Geometry;
use crate::error::InputError;
use bunit::Measures;

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

impl Unit {
    /// The scale of an HDU. The gain's keyword is searched in its header, then in the primary one.
    ///
    /// # Errors
    /// If neither the headers nor the options give the gain, or they contradict each other.
    pub fn scale(&self, hdu: &Hdu, primary: &Hdu) -> Result<Scale, InputError> {
        let refusal = |problem: String, help: &str| Err(InputError::new(hdu.to_string(), problem).with_help(help));
        let bunit = hdu.read_text("BUNIT")?.unwrap_or_default();
        let measures = Measures::of(&bunit);
        if measures == Measures::Rate {
            return refusal(
                format!("BUNIT = '{bunit}' is a rate; traps meet charges"),
                "multiply the image by its exposure time, and set BUNIT",
            );
        }
        let gain = match (&self.gain_keyword, self.gain_e_per_dn) {
            (Some(keyword), _) => Some(gain_of(keyword, hdu, primary)?),
            (None, given) => given,
        };
        let gain_e_per_dn = match (measures, gain) {
            (Measures::Electrons(scale), Some(gain)) if gain != scale => {
                return refusal(
                    format!("BUNIT = '{bunit}', and a gain of {gain} e-/DN was given"),
                    "leave out the gain, or correct BUNIT",
                );
            }
            (Measures::Electrons(scale), _) => scale,
            // A value of the frame stands for so many counts.
            (Measures::Counts(scale), Some(gain)) => scale * gain,
            (_, Some(gain)) => gain,
            (Measures::Counts(_), None) => {
                return refusal(
                    format!("BUNIT = '{bunit}', and no gain was given"),
                    "give --gain-e-per-dn, or --gain-keyword with the keyword of the header that holds it",
                );
            }
            (Measures::Nothing, None) => {
                return refusal(
                    "the header has no BUNIT, and no gain was given".into(),
                    "give --gain-e-per-dn (1 where the values are electrons), or --gain-keyword",
                );
            }
            (Measures::Other | Measures::Rate, None) => {
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
    let bunit = hdu.read_text("BUNIT")?.unwrap_or_default();
    let counts = matches!(Measures::of(&bunit), Measures::Counts(_));
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

/// Whether an image says that its values are charges: electrons or counts of the converter.
///
/// # Errors
/// If its BUNIT cannot be read, or cards contradict each other.
pub(super) fn is_charge(hdu: &Hdu) -> Result<bool, InputError> {
    let bunit = hdu.read_text("BUNIT")?.unwrap_or_default();
    Ok(matches!(Measures::of(&bunit), Measures::Electrons(_) | Measures::Counts(_)))
}

/// A number in an HDU's header, or in the primary one; `help` states what to try if neither has it.
pub(crate) fn number_of(keyword: &str, hdu: &Hdu, primary: &Hdu, help: &str) -> Result<f64, InputError> {
    let found = match hdu.read_number(keyword)? {
        None => primary.read_number(keyword)?,
        found => found,
    };
    found.ok_or_else(|| {
        InputError::new(hdu.to_string(), format!("neither its header nor the primary one has {keyword}"))
            .with_help(help)
    })
}
