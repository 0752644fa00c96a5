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

/// Why an HDU cannot be the companion that its name says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Unfit {
    /// What it has or holds.
    pub why: &'static str,
    /// What to do.
    pub help: &'static str,
}

impl Unfit {
    /// Of errors or data quality; None if they can be used.
    fn of(hdu: &Hdu, frame: &Hdu, names: &[&str]) -> Option<Unfit> {
        let integers = matches!(hdu.kind, HduKind::Image { bitpix: 8 | 16 | 32, .. });
        if image_shape(hdu).is_none() {
            Some(Unfit { why: "is no image of two axes that can be read", help: "write it as one" })
        } else if image_shape(hdu) != image_shape(frame) {
            Some(Unfit { why: "has another size", help: "give it the size of the frame" })
        } else if names == QUALITY && !integers {
            let why = "holds other values than integers of 8, 16 or 32 bits";
            Some(Unfit { why, help: "write it as such" })
        } else {
            None
        }
    }
}

impl Companions {
    /// The companions of a frame; HDUs that are unfit are excluded.
    pub fn of(hdus: &[Hdu], frame: usize) -> Companions {
        let called = |names: &[&str]| {
            let fit = called(hdus, frame, names).filter(|hdu| Unfit::of(hdu, &hdus[frame], names).is_none());
            // A combined file may repeat names: the nearest one after the frame is used.
            fit.map(|hdu| hdu.index).min_by_key(|index| (*index < frame, index.abs_diff(frame)))
        };
        Companions { errors: called(&ERRORS), quality: called(&QUALITY) }
    }

    /// Images with the name of a companion of a frame that cannot be one.
    pub fn unfit(hdus: &[Hdu], frame: usize) -> Vec<(&Hdu, Unfit)> {
        let of = |names: &'static [&'static str]| {
            let images =
                called(hdus, frame, names).filter(|hdu| !matches!(hdu.kind, HduKind::Empty | HduKind::NoImage));
            images.filter_map(move |hdu| Some((hdu, Unfit::of(hdu, &hdus[frame], names)?)))
        };
        of(&ERRORS).chain(of(&QUALITY)).collect()
    }

    /// The data quality of a frame, for an option that needs it, such as `use --dq-bad 1`.
    ///
    /// # Errors
    /// If there is none that can be used.
    pub fn quality_for(hdus: &[Hdu], frame: usize, option: &str) -> Result<usize, InputError> {
        Companions::of(hdus, frame).quality.ok_or_else(|| {
            let mut problem =
                "the file has no data quality for it: an image of integers, DQ or FLG, of the same EXTVER and size"
                    .to_string();
            let unfit =
                called(hdus, frame, &QUALITY).find_map(|hdu| Some((hdu, Unfit::of(hdu, &hdus[frame], &QUALITY)?)));
            let help = match unfit {
                None => "choose frames with --hdu, or leave the option out".to_string(),
                Some((hdu, unfit)) => {
                    problem += &format!("; {hdu} {}", unfit.why);
                    format!("{}, or leave the option out", unfit.help)
                }
            };
            InputError::new(format!("cannot {option} for {}", hdus[frame]), problem).with_help(help)
        })
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

/// HDUs with one of these names, after the stem of a frame's and with its EXTVER.
fn called<'a>(hdus: &'a [Hdu], frame: usize, names: &'a [&str]) -> impl Iterator<Item = &'a Hdu> {
    let stem = parts(&hdus[frame]).filter(|(_, last)| last == FRAME).map(|(stem, _)| stem);
    let version = hdus[frame].version();
    let is_called = move |hdu: &&Hdu| {
        let parts = parts(hdu).filter(|(of, _)| Some(of) == stem.as_ref());
        parts.is_some_and(|(_, last)| names.contains(&last.as_str())) && hdu.version() == version
    };
    hdus.iter().filter(is_called)
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
    ///
    /// # Errors
    /// If the header contradicts itself about the instrument, and bits are not given.
    pub fn of(self, primary: &Hdu) -> Result<Bits, InputError> {
        let given = self.saturated.is_some() && self.bad.is_some();
        let instrument = if given { None } else { primary.read_text("INSTRUME")? };
        let acs = instrument.is_some_and(|instrument| instrument.eq_ignore_ascii_case("ACS"));
        let (saturated, bad) = if acs { (256 | 2048, 1 | 2) } else { (0, 0) };
        Ok(Bits {
            saturated: Some(self.saturated.unwrap_or(saturated)),
            bad: Some(self.bad.unwrap_or(bad)),
            uncertain: self.uncertain,
        })
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
