//! Companions of a frame: its errors and its data quality, in separate HDUs.
//!
//! Pipelines name them after the frame: `SCI`, `ERR` and `DQ` with the same EXTVER (Hubble), or `3-4.F.SCI`, `3-4.F.RMS` and
//! `3-4.F.FLG` (Euclid).

use ndarray::{Array2, Zip};

use super::fits::{Hdu, HduKind, Pixels};
use crate::error::InputError;

/// The last part of the name of a frame with companions.
const FRAME: &str = "SCI";

/// The last part of the name of 1-sigma errors.
const ERRORS: [&str; 3] = ["ERR", "ERROR", "RMS"];

/// The last part of the name of data quality.
const QUALITY: [&str; 3] = ["DQ", "FLG", "FLAG"];

/// The companion HDUs of a frame, by their indices.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Companions {
    /// 1-sigma errors, in the unit of the frame.
    pub errors: Option<usize>,
    /// Data quality: integers whose bits are flags.
    pub quality: Option<usize>,
}

/// Meaning of the data quality bits.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Bits {
    /// Saturated pixels; none: those of the instrument.
    pub saturated: Option<u32>,
    /// Pixels without a measured value; none: those of the instrument.
    pub bad: Option<u32>,
    /// Set where a correction is uncertain; 0: no bit.
    pub uncertain: u32,
}

/// Flagged pixels.
#[derive(Clone, Debug)]
pub struct Flagged {
    /// Saturated.
    pub saturated: Array2<bool>,
    /// Without a measured value.
    pub bad: Array2<bool>,
}

impl Companions {
    /// The companions of a frame; HDUs of another size, or without data, are excluded.
    pub fn of(hdus: &[Hdu], frame: usize) -> Companions {
        let Some((stem, FRAME)) = parts(&hdus[frame]).as_ref().map(|(stem, last)| (stem.clone(), last.as_str())) else {
            return Companions::default();
        };
        let called = |names: [&str; 3]| {
            let beside = hdus.iter().filter(|hdu| {
                is_called(hdu, &stem, &names, &hdus[frame]) && image_shape(hdu) == image_shape(&hdus[frame])
            });
            // A combined file may repeat names: the nearest one after the frame is used.
            beside.map(|hdu| hdu.index).min_by_key(|index| (*index < frame, index.abs_diff(frame)))
        };
        let quality =
            called(QUALITY).filter(|index| matches!(hdus[*index].kind, HduKind::Image { bitpix: 8 | 16 | 32, .. }));
        Companions { errors: called(ERRORS), quality }
    }

    /// Images with the name of a companion of a frame, but of another size.
    pub fn of_other_size(hdus: &[Hdu], frame: usize) -> Vec<&Hdu> {
        let Some((stem, FRAME)) = parts(&hdus[frame]).as_ref().map(|(stem, last)| (stem.clone(), last.as_str())) else {
            return Vec::new();
        };
        let names = [ERRORS, QUALITY].concat();
        let other = |hdu: &&Hdu| image_shape(hdu).is_some_and(|shape| Some(shape) != image_shape(&hdus[frame]));
        hdus.iter().filter(|hdu| is_called(hdu, &stem, &names, &hdus[frame])).filter(other).collect()
    }

    /// Whether an HDU is one of them.
    pub fn has(self, index: usize) -> bool {
        self.errors == Some(index) || self.quality == Some(index)
    }
}

/// Rows and columns of an image.
fn image_shape(hdu: &Hdu) -> Option<(usize, usize)> {
    if let HduKind::Image { rows, columns, .. } = hdu.kind { Some((rows, columns)) } else { None }
}

/// Whether an HDU has one of these names, after the same stem, and the EXTVER of a frame.
fn is_called(hdu: &Hdu, stem: &str, names: &[&str], frame: &Hdu) -> bool {
    parts(hdu).is_some_and(|(of, last)| of == stem && names.contains(&last.as_str()))
        && hdu.version() == frame.version()
}

/// EXTNAME in upper case, split at its last dot.
fn parts(hdu: &Hdu) -> Option<(String, String)> {
    let name = hdu.name()?.to_ascii_uppercase();
    Some(match name.rsplit_once('.') {
        Some((stem, last)) => (stem.into(), last.into()),
        None => (String::new(), name),
    })
}

impl Bits {
    /// Default bits of the instrument if none are given: full well or converter saturated (256, 2048), and lost or filled by
    /// software (1, 2), for HST/ACS.
    ///
    /// Source: table of ACS flags in spacetelescope/stginga (`dqflags_acs.txt`), as in the ACS Data Handbook.
    pub fn of(self, primary: &Hdu) -> Bits {
        let acs = primary.text("INSTRUME").is_some_and(|instrument| instrument.eq_ignore_ascii_case("ACS"));
        let (saturated, bad) = if acs { (256 | 2048, 1 | 2) } else { (0, 0) };
        Bits {
            saturated: Some(self.saturated.unwrap_or(saturated)),
            bad: Some(self.bad.unwrap_or(bad)),
            uncertain: self.uncertain,
        }
    }

    /// Pixels with at least one of the bits.
    pub fn flagged(self, quality: &Pixels) -> Flagged {
        let flags = quality.physical();
        let any = |bits: Option<u32>| {
            let bits = i64::from(bits.unwrap_or(0));
            flags.mapv(|flags| flags as i64 & bits != 0)
        };
        Flagged { saturated: any(self.saturated), bad: any(self.bad) }
    }

    /// Sets the bit of uncertain pixels, and returns their number.
    ///
    /// # Errors
    /// If the type of the pixels does not hold the bit.
    pub fn mark(self, quality: &mut Pixels, uncertain: &Array2<bool>, hdu: &Hdu) -> Result<usize, InputError> {
        let flags = quality.physical();
        let marked = Zip::from(&flags)
            .and(uncertain)
            .map_collect(|flags, uncertain| uncertain.then_some((*flags as i64 | i64::from(self.uncertain)) as f64));
        let count = marked.iter().flatten().count();
        if quality.set(marked.into_iter()) > 0 {
            let problem = format!("its type does not hold the bit {}", self.uncertain);
            return Err(InputError::new(format!("cannot set --dq-set in {hdu}"), problem).with_help("give a lower bit"));
        }
        Ok(count)
    }
}
