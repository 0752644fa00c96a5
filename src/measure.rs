//! From frames to measurements: tables of edge responses, trails, injected charge and dipoles, in the format read by `validate`,
//! `fit` and `diagnose`.
//!
//! ```text
//! FITS files ─▶ [exposure] electrons above the bias, in the order of readout ─┬▶ [eper]      ─┐
//!                  ▲                                                          ├▶ [trails]     ├▶ [table] ─▶ ECSV
//!               [bias] overscan                                               ├▶ [injection]  │
//!                                                                             └▶ [dipoles]   ─┘
//! ```
//!
//! Every value is a clipped mean ([statistic]); its error comes from the scatter of the pixels averaged.

pub mod bias;
pub mod dipoles;
pub mod edge;
pub mod eper;
pub mod exposure;
pub mod injection;
pub mod statistic;
pub mod table;
pub mod trails;

use serde_json::{Value as Json, json};

use crate::error::InputError;
use crate::io::table::{Cell, Meta, Table};
use crate::physics::observable::Observable;
use crate::warning::{Warning, together};
use exposure::{About, Frames, Reading};
use table::{Measurement, Origin};

/// Results of the measurement.
#[derive(Clone, Debug)]
pub struct Measured {
    /// The command's word for the method.
    pub kind: &'static str,
    /// The tables, the one requested first.
    pub tables: Vec<(Observable, Table)>,
    /// The exposures.
    pub exposures: Vec<About>,
    /// Numbers of used and rejected items, by name.
    pub counts: Vec<(&'static str, usize)>,
    /// Options, as interpreted.
    pub options: Json,
    /// Warnings.
    pub warnings: Vec<Warning>,
}

impl Measured {
    /// Adds a word to the `meta` of all tables.
    fn say(&mut self, name: &str, word: &str) {
        for (_, table) in &mut self.tables {
            table.meta.push(Meta { name: name.into(), value: Cell::Text(word.into()), line: None });
        }
    }
}

/// Results collected while frames are read.
#[derive(Default)]
struct Found {
    exposures: Vec<About>,
    counts: Vec<(&'static str, usize)>,
    warnings: Vec<Warning>,
}

impl Found {
    /// Before frames are read: with warnings of the images of their files that are left out.
    fn of(frames: &Frames) -> Result<Found, InputError> {
        Ok(Found { warnings: frames.left_out()?, ..Found::default() })
    }

    /// Adds to a number of used or rejected items.
    fn count(&mut self, name: &'static str, more: usize) {
        match self.counts.iter_mut().find(|(known, _)| *known == name) {
            Some((_, count)) => *count += more,
            None => self.counts.push((name, more)),
        }
    }

    /// Adds the pixels of a row.
    fn count_pixels(&mut self, row: &Measurement) {
        for (name, count) in row.from.iter().filter(|(name, _)| name.starts_with("pixels_")) {
            self.count(name, *count);
        }
    }

    fn measured(self, kind: &'static str, options: Json, tables: Vec<(Observable, Vec<Measurement>)>) -> Measured {
        let origin = |observable| Origin {
            observable,
            kind,
            options: options.clone(),
            counts: &self.counts,
            exposures: &self.exposures,
        };
        let table = |(observable, rows): (Observable, Vec<Measurement>)| {
            (observable, table::table(observable.name(), &origin(observable), &rows))
        };
        let tables = tables.into_iter().map(table).collect();
        let warnings = together(&self.warnings);
        Measured { kind, tables, exposures: self.exposures, counts: self.counts, options, warnings }
    }
}

/// How frames lay on the detector, for `meta`.
fn geometry_json(reading: &Reading) -> Json {
    let geometry = &reading.geometry;
    if let Some(table) = &reading.amplifiers {
        return json!({ "amplifiers": table.name });
    }
    json!({
        "amplifiers": geometry.sides(),
        "prescan_px": geometry.prescan_columns,
        "overscan_columns": geometry.overscan_columns,
        "overscan_rows": geometry.overscan_rows,
        "transfers_before": geometry.rows_before,
    })
}
