//! Errors that several rows have in common, such as that of the zero level of an exposure.
//!
//! The column `sigma_common` is the part of `sigma` that is the same error in all rows with the same `common_group` (a number or
//! a word), or, without that column, in all rows of the file. Errors of two such rows i, j are correlated,
//!
//! ```text
//! cov(i, j) = c_i c_j   (i ≠ j),   var(i) = σ_i²,
//! ```
//!
//! as in D'Agostini 1994, Nucl. Instrum. Methods A 346, 306, equation 12. [`crate::analysis::whitening`] makes them independent.

use std::collections::HashMap;

use super::units::Unit;
use super::{Reader, Row};
use crate::error::InputError;
use crate::io::table::Cell;

/// The columns.
pub(super) const SIGMA: &str = "sigma_common";
pub(super) const GROUP: &str = "common_group";

/// Part of a row's error that is common to its group.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Common {
    /// 1-sigma error, in the observable's unit; 0 if there is none.
    pub sigma: f64,
    /// The group, numbered in order of appearance.
    pub group: usize,
}

impl Reader<'_> {
    /// The common error of each row.
    ///
    /// # Errors
    /// If one is negative, or not below the error of its row, or an error or a group is given without the other.
    pub(super) fn common_errors(&self, rows: &[Row]) -> Result<Vec<Common>, InputError> {
        if self.table.column(SIGMA).is_none() && self.table.meta(SIGMA).is_none() {
            return match self.table.column(GROUP) {
                None => Ok(vec![Common::default(); rows.len()]),
                Some(_) => {
                    let problem =
                        format!("there are groups of rows, and no column `{SIGMA}` with the error they share");
                    Err(self.table.fault(None, Some(GROUP), problem).with_help(HELP))
                }
            };
        }
        let mut groups: HashMap<String, usize> = HashMap::new();
        let of = |(row, known): (usize, &Row)| {
            let sigma = self.common_sigma(row, known.sigma)?;
            let cell = self.table.column(GROUP).map(|column| &column.cells[row]);
            if cell == Some(&Cell::Missing) && sigma > 0.0 {
                let problem = format!("the row has an error in common with others, and no `{GROUP}` says with which");
                let help =
                    "rows with the same number or word have it in common; give sigma_common = 0 to rows without one";
                return Err(self.table.fault(Some(row), Some(GROUP), problem).with_help(help));
            }
            let name = cell.map_or(String::new(), ToString::to_string);
            let number = groups.len();
            Ok(Common { sigma, group: *groups.entry(name).or_insert(number) })
        };
        let found = rows.iter().enumerate().map(of).collect::<Result<Vec<Common>, InputError>>()?;
        let mut members = vec![0; groups.len()];
        found.iter().filter(|common| common.sigma > 0.0).for_each(|common| members[common.group] += 1);
        // Of one row alone it is an error like any other.
        let is_alone = |common: &Common| members[common.group] < 2;
        let shared = |common: Common| if is_alone(&common) { Common { sigma: 0.0, ..common } } else { common };
        Ok(found.into_iter().map(shared).collect())
    }

    fn common_sigma(&self, row: usize, most: f64) -> Result<f64, InputError> {
        let unit = Unit::of(self.observable);
        let Some((sigma, place)) = self.number_by(row, SIGMA, unit, |conversion, theirs| conversion.scale(theirs))?
        else {
            return Ok(0.0);
        };
        if sigma >= 0.0 && sigma < most {
            return Ok(sigma);
        }
        let behind = unit.behind();
        let problem = format!(
            "the error that rows have in common is a part of sigma, which is {most}{behind}; this is {sigma}{behind}"
        );
        Err(self.table.fault(Some(row), Some(&place), problem).with_help(HELP))
    }
}

const HELP: &str = "sigma is the whole error of a row: its own and the common one, added in quadrature";
