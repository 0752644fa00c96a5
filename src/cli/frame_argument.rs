//! Geometry of a frame on the detector, as options of the command line.

use clap::ValueEnum;
use clap::builder::PossibleValue;

use crate::image::{Corner, Split, Transfers};

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
