//! Frames as options of the command line: the images of a file, their position on the detector, and the meaning of their values.

use std::str::FromStr;

use clap::builder::PossibleValue;
use clap::{Args, ValueEnum};

use super::number_argument::{finite, positive, whole};
use crate::image::{Choice, Corner, Geometry, Split, Transfers, Unit};

/// Which images, and where they lie on the detector.
#[derive(Debug, Args)]
pub(super) struct Layout {
    /// HDUs to process: their numbers (0 is the primary one), EXTNAMEs, or EXTNAME,EXTVER; by default those with a BUNIT of charge, or, if there are none, all images except DQ, ERR, ...
    #[arg(long, value_name = "HDU")]
    hdu: Vec<Choices>,
    /// Corner that is read first; the frame's first pixel is at the lower left
    #[arg(long, value_name = "CORNER", default_value = "lower-left")]
    corner: Corner,
    /// Halves or quarters that are read out to their own sides, each by its own amplifier
    #[arg(long, value_name = "HALVES")]
    split: Option<Split>,
    /// Columns of prescan in the frame: pixels of the serial register alone, nearest the amplifier
    #[arg(long, value_name = "COLUMNS", default_value_t = 0)]
    prescan_px: usize,
    /// Columns of overscan in the frame, read after the image
    #[arg(long, value_name = "COLUMNS", default_value_t = 0)]
    overscan_columns: usize,
    /// Rows of overscan in the frame, read after the image
    #[arg(long, value_name = "ROWS", default_value_t = 0)]
    overscan_rows: usize,
    /// Rows between the frame's first row and the serial register
    #[arg(long, value_name = "ROWS", default_value_t = 0, value_parser = whole(..=1_000_000_u32))]
    pub transfers_before: u32,
}

/// HDUs of a list: 1,4 or SCI,ERR or SCI,1,SCI,2.
#[derive(Clone, Debug)]
struct Choices(Vec<Choice>);

impl FromStr for Choices {
    type Err = String;

    fn from_str(text: &str) -> Result<Choices, String> {
        let mut choices: Vec<Choice> = Vec::new();
        for part in text.split(',') {
            match (part.parse()?, choices.pop()) {
                // A number after a name is its EXTVER, as in amplifier tables.
                (Choice::Index(version), Some(Choice::Name(name))) => {
                    choices.push(Choice::Version(name, version as i64));
                }
                (choice, last) => choices.extend(last.into_iter().chain([choice])),
            }
        }
        Ok(Choices(choices))
    }
}

impl Layout {
    /// The selected HDUs; none: all images of charge.
    pub fn hdus(&self) -> Vec<Choice> {
        self.hdu.iter().flat_map(|choices| choices.0.clone()).collect()
    }

    /// The geometry of frames read along their columns.
    pub fn geometry(&self) -> Geometry {
        Geometry {
            corner: self.corner,
            split: self.split,
            prescan_columns: self.prescan_px,
            overscan_columns: self.overscan_columns,
            overscan_rows: self.overscan_rows,
            rows_before: self.transfers_before,
            ..Geometry::default()
        }
    }
}

/// What the numbers of frames mean, but for the bias.
#[derive(Debug, Args)]
pub(super) struct Gain {
    /// Gain, electrons per DN; not needed if BUNIT is electrons
    #[arg(long, value_name = "GAIN", conflicts_with = "gain_keyword", value_parser = positive)]
    gain_e_per_dn: Option<f64>,
    /// Header keyword of the gain, electrons per DN
    #[arg(long, value_name = "KEYWORD")]
    gain_keyword: Option<String>,
    /// Value at which the converter saturates, in the unit of the frame; such pixels count as saturated
    #[arg(long, value_name = "DN", value_parser = finite)]
    saturated_dn: Option<f64>,
}

impl Gain {
    /// The unit of frames with this bias, in their own unit.
    pub fn unit(&self, bias_dn: Option<f64>) -> Unit {
        Unit {
            gain_e_per_dn: self.gain_e_per_dn,
            gain_keyword: self.gain_keyword.as_deref().map(keyword),
            bias_dn,
            saturated_dn: self.saturated_dn,
        }
    }
}

/// A header keyword, trimmed and in upper case.
pub(super) fn keyword(text: &str) -> String {
    text.trim().to_ascii_uppercase()
}

impl ValueEnum for Transfers {
    fn value_variants<'a>() -> &'a [Transfers] {
        &[Transfers::Parallel, Transfers::Serial, Transfers::Both]
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        let (word, help) = match self {
            Transfers::Parallel => ("parallel", "Along the columns, to the serial register"),
            Transfers::Serial => ("serial", "Along the serial register, to the amplifier"),
            Transfers::Both => ("both", "Along the columns, then along the register"),
        };
        Some(PossibleValue::new(word).help(help))
    }
}

impl ValueEnum for Corner {
    fn value_variants<'a>() -> &'a [Corner] {
        &[Corner::LowerLeft, Corner::LowerRight, Corner::UpperLeft, Corner::UpperRight]
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        let (word, help) = match self {
            Corner::LowerLeft => ("lower-left", "First row, first column"),
            Corner::LowerRight => ("lower-right", "First row, last column"),
            Corner::UpperLeft => ("upper-left", "Last row, first column"),
            Corner::UpperRight => ("upper-right", "Last row, last column"),
        };
        Some(PossibleValue::new(word).help(help))
    }
}

impl ValueEnum for Split {
    fn value_variants<'a>() -> &'a [Split] {
        &[Split::Columns, Split::Rows, Split::Both]
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        let (word, help) = match self {
            Split::Columns => ("columns", "The left half is read to the left, the right half to the right"),
            Split::Rows => ("rows", "The lower half is read downwards, the upper half upwards"),
            Split::Both => ("both", "Each quarter is read to its corner"),
        };
        Some(PossibleValue::new(word).help(help))
    }
}

/// Bits of data quality as a sum or a list: 2304, or 256,2048, or 0x900.
pub(super) fn bits(text: &str) -> Result<u32, String> {
    let one = |text: &str| {
        let text = text.trim();
        text.strip_prefix("0x").map_or_else(|| text.parse().ok(), |digits| u32::from_str_radix(digits, 16).ok())
    };
    let all = text.split(',').try_fold(0, |all, text| Some(all | one(text)?));
    all.ok_or_else(|| "a sum of powers of 2 is needed, such as 2304 or 256,2048; 0 for none".into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hdus_are_numbers_names_or_names_with_versions() {
        let of = |text: &str| text.parse::<Choices>().map(|choices| choices.0);
        let name = |text: &str| Choice::Name(text.into());
        let version = |text: &str, version| Choice::Version(text.into(), version);
        assert_eq!(of("1,4"), Ok(vec![Choice::Index(1), Choice::Index(4)]));
        assert_eq!(of("SCI, 2"), Ok(vec![version("SCI", 2)]));
        assert_eq!(
            of("4,SCI,1,SCI,2,ERR"),
            Ok(vec![Choice::Index(4), version("SCI", 1), version("SCI", 2), name("ERR")])
        );
        assert!(of("SCI,,2").is_err() && of("").is_err());
    }
}
