//! Which images of a file are frames.
//!
//! Those selected, if any are. Otherwise images of charge: if some state a unit of charge (BUNIT), they alone; else all with two axes.
//! In both cases without the companions of frames: data quality, errors, weights, and tables of a distortion of the coordinates.

use std::fmt;

use super::fits::{Hdu, HduKind};
use super::frame::Geometry;
use super::unit::{self, Scale, Unit};
use super::{Choice, image_shape};
use crate::error::InputError;

/// Why an image is no frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LeftOut {
    /// Its name is that of a companion.
    Companion,
    /// It is a table of a distortion of the coordinates.
    Distortion,
    /// Other images state a unit of charge.
    NoCharge,
    /// It has another number of axes than two.
    Axes(usize),
}

impl LeftOut {
    /// Whether it might hold charge all the same.
    pub fn is_doubtful(self) -> bool {
        matches!(self, LeftOut::NoCharge | LeftOut::Axes(_))
    }
}

impl fmt::Display for LeftOut {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            LeftOut::Companion => write!(out, "no charge, by its name"),
            LeftOut::Distortion => write!(out, "a table of the distortion of coordinates"),
            LeftOut::NoCharge => write!(out, "no BUNIT of charge, which other images have"),
            LeftOut::Axes(axes) => write!(out, "{axes} {}, not two", if *axes == 1 { "axis" } else { "axes" }),
        }
    }
}

/// Indices of the HDUs to process, and the meaning of their values.
///
/// # Errors
/// If there is no such HDU, one is not an image, does not fit the geometry, or its unit is unknown.
pub(crate) fn frames(
    hdus: &[Hdu],
    choices: &[Choice],
    geometry: &Geometry,
    unit: &Unit,
) -> Result<Vec<(usize, Scale)>, InputError> {
    for choice in choices {
        if !hdus.iter().any(|hdu| choice.is(hdu)) {
            let known: Vec<String> = hdus.iter().map(Hdu::to_string).collect();
            return Err(InputError::new(format!("there is no HDU {choice}"), format!("it has {}", known.join(", "))));
        }
    }
    let chosen: Vec<&Hdu> = match choices {
        [] => of_charge(hdus)?.0,
        choices => hdus.iter().filter(|hdu| choices.iter().any(|choice| choice.is(hdu))).collect(),
    };
    let mut frames = Vec::new();
    for hdu in chosen {
        let shape = image_shape(hdu)?;
        geometry.check(shape).map_err(|error| InputError { refused: format!("{hdu}, {}", error.refused), ..error })?;
        frames.push((hdu.index, unit.scale(hdu, &hdus[0])?));
    }
    if frames.is_empty() {
        let others = left_out(hdus, choices)?;
        let others: Vec<String> = others.iter().map(|(index, why)| format!("{}: {why}", hdus[*index])).collect();
        let error = InputError::new("nothing to do", "it has no image of charge");
        return Err(if others.is_empty() {
            error
        } else {
            error.with_help(format!("to process one of {}, select it with --hdu", others.join("; ")))
        });
    }
    Ok(frames)
}

/// Images that are left out where none are selected.
///
/// # Errors
/// If a unit cannot be read.
pub(crate) fn left_out(hdus: &[Hdu], choices: &[Choice]) -> Result<Vec<(usize, LeftOut)>, InputError> {
    if choices.is_empty() { Ok(of_charge(hdus)?.1) } else { Ok(Vec::new()) }
}

/// Images of charge, and all other images with the reason.
type Sorted<'a> = (Vec<&'a Hdu>, Vec<(usize, LeftOut)>);

/// Tells frames from other images where none are selected.
fn of_charge(hdus: &[Hdu]) -> Result<Sorted<'_>, InputError> {
    let distorted = hdus.iter().any(says_distorted);
    let companion = |hdu: &Hdu| match hdu.kind {
        _ if is_distortion(hdu, distorted) => Some(LeftOut::Distortion),
        _ if says_other_than_charge(hdu) => Some(LeftOut::Companion),
        _ => None,
    };
    let images = hdus.iter().filter(|hdu| !matches!(hdu.kind, HduKind::Empty | HduKind::NoImage));
    let (mut frames, mut left_out) = (Vec::new(), Vec::new());
    for hdu in images {
        match companion(hdu) {
            Some(why) => left_out.push((hdu.index, why)),
            None => frames.push((hdu, unit::is_charge(hdu)?)),
        }
    }
    let some_charge = frames.iter().any(|(_, charge)| *charge);
    let some_flat = frames.iter().any(|(hdu, charge)| hdu.has_two_axes() && (*charge || !some_charge));
    let mut of_charge = Vec::new();
    for (hdu, charge) in frames {
        match hdu.kind {
            _ if some_charge && !charge => left_out.push((hdu.index, LeftOut::NoCharge)),
            // A file with nothing else is refused, with the reason.
            HduKind::OtherAxes(axes) if some_flat => left_out.push((hdu.index, LeftOut::Axes(axes))),
            _ => of_charge.push(hdu),
        }
    }
    left_out.sort_by_key(|(index, _)| *index);
    Ok((of_charge, left_out))
}

/// Words in the names of companions, as pipelines have them (Hubble, Euclid, Gemini, Rubin, DESI, JWST, ESO, ccdproc and others): data
/// quality, errors, weights, models of the background.
const WORDS: [&str; 32] = [
    "DQ",
    "DQF",
    "ERR",
    "ERROR",
    "VAR",
    "VARIANCE",
    "IVAR",
    "INVVAR",
    "RMS",
    "UNC",
    "UNCERT",
    "SIGMA",
    "STD",
    "STDDEV",
    "STDEV",
    "FLG",
    "FLAG",
    "QUAL",
    "QUALITY",
    "MASK",
    "BPM",
    "BADPIX",
    "WHT",
    "WT",
    "WGT",
    "WEIGHT",
    "CTX",
    "BKG",
    "BKGD",
    "BACKGROUND",
    "READNOISE",
    UNCERTAIN,
];

/// Endings of words in such names: `OBJMASK`, `SCIERROR`, `EXPMAP`.
const ENDINGS: [&str; 9] = ["MASK", "ERROR", "VARIANCE", "UNCERTAINTY", "UNCERT", "WEIGHT", "QUALITY", "FLAG", "MAP"];

/// Names of which only the whole, or the part after the last dot, means a companion.
const WHOLE: [&str; 11] =
    ["SAMP", "TIME", "AREA", "CON", "CONTEXT", "COV", "COVERAGE", "STAT", "NOISE", "PSF", "NCOMBINE"];

/// Names of tables of a distortion of the coordinates, stored as images (Calabretta et al. 2004; HST).
const DISTORTIONS: [&str; 2] = ["WCSDVARR", "D2IMARR"];

/// The ending of the name of an extension that marks uncertain pixels.
pub(super) const UNCERTAIN: &str = "UNCERTAIN";

/// Whether an image holds no charge, by its EXTNAME: `DQ`, `3-4.F.RMS`, `VAR_POISSON`, `IM1_MASK`, ...
fn says_other_than_charge(hdu: &Hdu) -> bool {
    let name = hdu.name().unwrap_or_default().to_ascii_uppercase();
    let letters = |word: &str| word.trim_end_matches(|letter: char| letter.is_ascii_digit()).to_string();
    let is_word = |word: String| {
        let one = word.strip_suffix('S').filter(|one| !one.ends_with('S')).unwrap_or(&word);
        [one, &word].iter().any(|word| WORDS.contains(word) || ENDINGS.iter().any(|ending| word.ends_with(ending)))
    };
    WHOLE.contains(&letters(name.rsplit('.').next().unwrap_or_default()).as_str())
        || name.split(|letter: char| !letter.is_ascii_alphanumeric()).any(|word| is_word(letters(word)))
}

/// Whether a header refers to a table of the distortion of its coordinates.
fn says_distorted(hdu: &Hdu) -> bool {
    let of_distortion = |keyword: &str| ["CPDIS", "CQDIS", "D2IMDIS"].iter().any(|begin| keyword.starts_with(begin));
    hdu.keywords()
        .filter(|keyword| of_distortion(keyword))
        .any(|keyword| hdu.text(keyword).is_some_and(|kind| kind.eq_ignore_ascii_case("LOOKUP")))
}

/// Whether an image is such a table: by its name, or, in a file with distorted coordinates, because its own are those of a grid of
/// pixels, with a step and without a meaning.
fn is_distortion(hdu: &Hdu, distorted: bool) -> bool {
    let name = hdu.name().unwrap_or_default().to_ascii_uppercase();
    let is_grid = || hdu.value("CRPIX1").is_some() && hdu.value("CDELT1").is_some() && hdu.value("CTYPE1").is_none();
    DISTORTIONS.contains(&name.as_str()) || (distorted && !says_distorted(hdu) && is_grid())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_tell_companions_from_frames() {
        let says = |name: &str| says_other_than_charge(&Hdu::without_header((2, 2), true).named(name));
        for name in [
            "DQ",
            "err",
            "3-4.F.RMS",
            "VAR_POISSON",
            "IM1_MASK",
            "OBJMASK",
            "BPM",
            "BadPix",
            "UNCERT",
            "UNCERTAINTY",
            "WEIGHTS",
            "IVAR",
            "SCI_VAR",
            "ERR2",
            "MASK1",
            "FLAGS",
            "EXPMAP",
            "QUALITY",
            "ERRORS",
            "STAT",
            "HDU0.UNCERTAIN",
            "UNC",
            "SIGMA",
            "WHT",
        ] {
            assert!(says(name), "{name}");
        }
        for name in [
            "SCI",
            "IMAGE",
            "CCD1",
            "1-1.E.SCI",
            "FLAT",
            "MASKED",
            "STARS",
            "EXPOSURE",
            "SEGMENT10",
            "TIMESERIES",
            "AMP1",
            "RAW",
        ] {
            assert!(!says(name), "{name}");
        }
    }
}
