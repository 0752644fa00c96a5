//! The level of a pixel without charge: given, or the clipped mean of pixels without charge; a straight line along the rows if it
//! drifts while they are read.

use std::ops::Range;

use ndarray::Array2;

use super::statistic::{Mean, clipped};
use crate::image::Geometry;

/// Source of the bias.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum BiasSource {
    /// A given value, in the unit of the frame.
    Given(f64),
    /// The second half of the overscan columns: trails of the serial register end in the first half.
    OverscanColumns,
    /// The prescan columns.
    Prescan,
    /// The second half of the overscan rows, in the columns of the image: trails along the columns end in the first half.
    OverscanRows,
}

/// Minimum number of columns of overscan or prescan, and of rows of overscan, for the default bias.
const FEWEST_COLUMNS: usize = 2;
const FEWEST_ROWS: usize = 4;

impl BiasSource {
    /// The best source in a frame: overscan columns, prescan columns, overscan rows. Only the last of them contains trails along
    /// the columns.
    pub fn of(geometry: &Geometry) -> Option<BiasSource> {
        if geometry.overscan_columns >= FEWEST_COLUMNS {
            Some(BiasSource::OverscanColumns)
        } else if geometry.prescan_columns >= FEWEST_COLUMNS {
            Some(BiasSource::Prescan)
        } else {
            (geometry.overscan_rows >= FEWEST_ROWS).then_some(BiasSource::OverscanRows)
        }
    }

    /// The first overscan row, counted from 0, that is used for the bias.
    pub fn first_overscan_row(self, geometry: &Geometry) -> Option<usize> {
        (self == BiasSource::OverscanRows).then_some(geometry.overscan_rows / 2)
    }

    /// In words.
    pub fn words(self) -> &'static str {
        match self {
            BiasSource::Given(_) => "given",
            BiasSource::OverscanColumns => "last half of the overscan columns",
            BiasSource::Prescan => "prescan columns",
            BiasSource::OverscanRows => "last half of the overscan rows",
        }
    }

    /// Rows and columns of an amplifier's part, in the order of readout, that are averaged. None if the bias is given, or if there
    /// are no such pixels.
    fn region(self, geometry: &Geometry, shape: (usize, usize)) -> Option<(Range<usize>, Range<usize>)> {
        let (rows, columns) = geometry.image(shape);
        let region = match self {
            BiasSource::Given(_) => return None,
            BiasSource::OverscanColumns => (0..shape.0, columns.end + geometry.overscan_columns / 2..shape.1),
            BiasSource::Prescan => (0..shape.0, 0..columns.start),
            BiasSource::OverscanRows => (rows.end + geometry.overscan_rows / 2..shape.0, columns),
        };
        (!region.0.is_empty() && !region.1.is_empty()).then_some(region)
    }

    /// The bias of an amplifier's part (in the unit of the frame, in the order of readout), whose values have steps of
    /// `quantum_dn`. None if no pixels determine it.
    pub fn measure(self, geometry: &Geometry, part_dn: &Array2<f64>, quantum_dn: f64) -> Option<Bias> {
        if let BiasSource::Given(dn) = self {
            return Some(Bias {
                dn,
                sigma_dn: 0.0,
                noise_dn: None,
                source: self,
                pixels: 0,
                rejected_px: 0,
                line: None,
            });
        }
        let (rows, columns) = self.region(geometry, part_dn.dim())?;
        let less = |line: Option<Line>, rows: Range<usize>| {
            let pixels = rows.flat_map(|row| columns.clone().map(move |column| (row, column)));
            let dn_in = |row: usize| line.map_or(0.0, |line| line.dn_in(row));
            clipped(pixels.map(|(row, column)| part_dn[[row, column]] - dn_in(row)), quantum_dn)
        };
        let line = match self {
            BiasSource::OverscanRows => None,
            _ => Line::through(&rows, |rows| less(None, rows)),
        };
        let mean = less(line, rows.clone())?;
        // At the ends of a line, its slope matters most.
        let of_slope_dn = line.map_or(0.0, |line| line.slope_sigma_dn * 0.5 * rows.len() as f64);
        Some(Bias {
            dn: line.map_or(mean.value, |line| line.middle_dn),
            sigma_dn: mean.sigma.hypot(of_slope_dn),
            noise_dn: Some(mean.scatter),
            source: self,
            pixels: mean.used,
            rejected_px: mean.rejected,
            line,
        })
    }
}

/// Significance of a change of the bias along the rows, in its errors.
const DRIFT_SIGMA: f64 = 5.0;

/// A bias that drifts evenly while rows are read.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Line {
    /// Its value in the middle of the rows, in the unit of the frame.
    middle_dn: f64,
    /// Position of the middle, in rows from the first.
    middle_row: f64,
    /// Change per row, in the unit of the frame.
    pub slope_dn: f64,
    /// Its 1-sigma error.
    slope_sigma_dn: f64,
    /// Value in the middle third of the rows less that of the line, and its 1-sigma error.
    pub bend_dn: [f64; 2],
}

impl Line {
    /// Through the means of the first and the last third of the rows, if these differ significantly.
    fn through(rows: &Range<usize>, of: impl Fn(Range<usize>) -> Option<Mean>) -> Option<Line> {
        let third = rows.len() / 3;
        let [first, middle, last] = [rows.start, rows.start + third, rows.end - third];
        let (first, middle, last) = (of(first..middle)?, of(middle..last)?, of(last..rows.end)?);
        let (drift_dn, sigma_dn) = (last.value - first.value, last.sigma.hypot(first.sigma));
        let apart = (rows.len() - third) as f64;
        let mean_dn = 0.5 * (first.value + last.value);
        (drift_dn.abs() > DRIFT_SIGMA * sigma_dn).then(|| Line {
            middle_dn: mean_dn,
            middle_row: rows.start as f64 + 0.5 * (rows.len() as f64 - 1.0),
            slope_dn: drift_dn / apart,
            slope_sigma_dn: sigma_dn / apart,
            bend_dn: [middle.value - mean_dn, middle.sigma.hypot(0.5 * sigma_dn)],
        })
    }

    /// Its value in a row, counted from the first that is read, in the unit of the frame.
    fn dn_in(&self, row: usize) -> f64 {
        self.middle_dn + self.slope_dn * (row as f64 - self.middle_row)
    }

    /// Whether the bias does not follow the line.
    pub fn is_bent(&self) -> bool {
        let [bend_dn, sigma_dn] = self.bend_dn;
        bend_dn.abs() > DRIFT_SIGMA * sigma_dn
    }
}

/// The bias of an amplifier's part of a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bias {
    /// Level of a pixel without charge, in the unit of the frame; that in the middle of the rows if it drifts.
    pub dn: f64,
    /// Its 1-sigma error in any row; 0 if it was given.
    pub sigma_dn: f64,
    /// Standard deviation of the pixels from which it was estimated: the noise of the amplifier.
    pub noise_dn: Option<f64>,
    /// Its source.
    pub source: BiasSource,
    /// Number of pixels averaged.
    pub pixels: usize,
    /// Number of rejected pixels.
    pub rejected_px: usize,
    /// How it drifts along the rows; None if that is not significant, or not known.
    pub line: Option<Line>,
}

impl Bias {
    /// Level of a pixel without charge in a row, counted from the first that is read, in the unit of the frame.
    pub fn dn_in(&self, row: usize) -> f64 {
        self.line.map_or(self.dn, |line| line.dn_in(row))
    }
}

#[cfg(test)]
mod tests {
    use ndarray::s;

    use super::*;

    fn geometry() -> Geometry {
        Geometry { prescan_columns: 2, overscan_columns: 4, overscan_rows: 6, ..Geometry::default() }
    }

    #[test]
    fn the_bias_is_that_of_far_overscan() {
        // Columns 0 and 1 are prescan, 8 to 11 overscan; rows 10 to 15 are overscan.
        let mut part = Array2::from_elem((16, 12), 900.0);
        part.slice_mut(s![.., ..2]).fill(101.0);
        part.slice_mut(s![10.., 2..8]).fill(150.0);
        part.slice_mut(s![13.., 2..8]).fill(102.0);
        part.slice_mut(s![.., 8..10]).fill(130.0);
        part.slice_mut(s![.., 10..]).fill(103.0);
        part[[4, 11]] = 5000.0;
        let dn = |source: BiasSource| source.measure(&geometry(), &part, 1.0).unwrap();
        assert_eq!(dn(BiasSource::Prescan).dn, 101.0);
        assert_eq!(dn(BiasSource::OverscanRows).dn, 102.0);
        let columns = dn(BiasSource::OverscanColumns);
        assert_eq!((columns.dn, columns.pixels, columns.rejected_px), (103.0, 31, 1));
        assert_eq!(dn(BiasSource::Given(99.5)).dn, 99.5);
    }

    #[test]
    fn a_bias_that_drifts_is_a_line() {
        let geometry = Geometry { overscan_columns: 12, ..Geometry::default() };
        let part = |of_row: &dyn Fn(usize) -> f64| {
            // Noise of 1 DN, up and down in turn.
            Array2::from_shape_fn((120, 40), |(row, column)| {
                of_row(row) + if (row + column) % 2 == 0 { 1.0 } else { -1.0 }
            })
        };
        let of = |part: Array2<f64>| BiasSource::OverscanColumns.measure(&geometry, &part, 1.0).unwrap();
        let flat = of(part(&|_| 100.0));
        assert_eq!((flat.line, flat.dn_in(0), flat.dn_in(119)), (None, 100.0, 100.0));
        let straight = of(part(&|row| 100.0 + 0.01 * row as f64));
        for row in [0, 60, 119] {
            assert!((straight.dn_in(row) - 100.0 - 0.01 * row as f64).abs() < 1e-9, "{row}: {}", straight.dn_in(row));
        }
        assert!(!straight.line.unwrap().is_bent());
        assert!(straight.sigma_dn > flat.sigma_dn, "a slope has an error, too");
        let bent = of(part(&|row| 100.0 + 6.0 * (row as f64 / 119.0).powi(3)));
        assert!(bent.line.unwrap().is_bent());
    }

    #[test]
    fn columns_of_overscan_are_preferred() {
        assert_eq!(BiasSource::of(&geometry()), Some(BiasSource::OverscanColumns));
        let rows = Geometry { overscan_rows: 6, ..Geometry::default() };
        assert_eq!(BiasSource::of(&rows), Some(BiasSource::OverscanRows));
        assert_eq!(BiasSource::of(&Geometry::default()), None);
    }
}
