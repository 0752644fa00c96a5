//! Sections of images as FITS headers write them: `[1:2048,1:2066]`.

use std::ops::Range;
use std::str::FromStr;

/// Columns and rows of an image, counted from 1, both ends included.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Section {
    columns: (usize, usize),
    rows: (usize, usize),
}

/// The format of a section, for messages.
pub(super) const EXAMPLE: &str = "[1:2048,1:2066]: first and last column, first and last row, counted from 1";

impl Section {
    /// All of an image of this shape (rows, columns).
    pub fn whole((rows, columns): (usize, usize)) -> Section {
        Section { columns: (1, columns), rows: (1, rows) }
    }

    /// Rows and columns from 0, if they are within an image of this shape.
    pub fn within(self, (rows, columns): (usize, usize)) -> Result<(Range<usize>, Range<usize>), String> {
        if self.rows.1 > rows || self.columns.1 > columns {
            return Err(format!("{self} ends beyond the image of {columns} columns and {rows} rows"));
        }
        Ok((self.rows.0 - 1..self.rows.1, self.columns.0 - 1..self.columns.1))
    }

    /// Rows and columns from 0, if they are within the given ones.
    pub fn inside(
        self,
        (rows, columns): (&Range<usize>, &Range<usize>),
    ) -> Result<(Range<usize>, Range<usize>), String> {
        let (own_rows, own_columns) = self.within((rows.end, columns.end))?;
        if own_rows.start < rows.start || own_columns.start < columns.start {
            return Err(format!("{self} begins before the pixels of the amplifier"));
        }
        Ok((own_rows, own_columns))
    }
}

impl FromStr for Section {
    type Err = String;

    fn from_str(text: &str) -> Result<Section, String> {
        let parse = || {
            let (columns, rows) = text.trim().strip_prefix('[')?.strip_suffix(']')?.split_once(',')?;
            let range = |text: &str| {
                let (first, last) = text.split_once(':')?;
                let range: (usize, usize) = (first.trim().parse().ok()?, last.trim().parse().ok()?);
                (1 <= range.0 && range.0 <= range.1).then_some(range)
            };
            Some(Section { columns: range(columns)?, rows: range(rows)? })
        };
        parse().ok_or_else(|| format!("a section is needed, such as {EXAMPLE}"))
    }
}

impl std::fmt::Display for Section {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(out, "[{}:{},{}:{}]", self.columns.0, self.columns.1, self.rows.0, self.rows.1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_section_has_columns_and_rows_from_1() {
        let section: Section = " [11:522, 1:2002]".parse().unwrap();
        assert_eq!(section.within((2048, 576)), Ok((0..2002, 10..522)));
        assert!(section.within((2001, 576)).is_err());
        for wrong in ["", "[1:2]", "[2:1,1:2]", "[0:1,1:2]", "1:2,1:2", "[1:2,1:*]"] {
            assert!(wrong.parse::<Section>().is_err(), "{wrong}");
        }
    }
}
