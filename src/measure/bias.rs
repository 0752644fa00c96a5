//! The level of a pixel without charge: given, or the clipped mean of pixels without charge.

use std::ops::Range;

use ndarray::{Array2, s};

use super::statistic::clipped;
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
                drift_dn: None,
            });
        }
        let (rows, columns) = self.region(geometry, part_dn.dim())?;
        let of = |rows: Range<usize>| clipped(part_dn.slice(s![rows, columns.clone()]).iter().copied(), quantum_dn);
        let mean = of(rows.clone())?;
        let third = rows.len() / 3;
        let ends = of(rows.start..rows.start + third).zip(of(rows.end - third..rows.end));
        let drift_dn = ends.map(|(first, last)| [last.value - first.value, last.sigma.hypot(first.sigma)]);
        Some(Bias {
            dn: mean.value,
            sigma_dn: mean.sigma,
            noise_dn: Some(mean.scatter),
            source: self,
            pixels: mean.used,
            rejected_px: mean.rejected,
            drift_dn,
        })
    }
}

/// The bias of an amplifier's part of a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bias {
    /// Level of a pixel without charge, in the unit of the frame.
    pub dn: f64,
    /// Its 1-sigma error; 0 if it was given.
    pub sigma_dn: f64,
    /// Standard deviation of the pixels from which it was estimated: the noise of the amplifier.
    pub noise_dn: Option<f64>,
    /// Its source.
    pub source: BiasSource,
    /// Number of pixels averaged.
    pub pixels: usize,
    /// Number of rejected pixels.
    pub rejected_px: usize,
    /// Value in the last third of the rows less that in the first third, and its 1-sigma error; None if too few pixels tell it.
    pub drift_dn: Option<[f64; 2]>,
}

#[cfg(test)]
mod tests {
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
    fn columns_of_overscan_are_preferred() {
        assert_eq!(BiasSource::of(&geometry()), Some(BiasSource::OverscanColumns));
        let rows = Geometry { overscan_rows: 6, ..Geometry::default() };
        assert_eq!(BiasSource::of(&rows), Some(BiasSource::OverscanRows));
        assert_eq!(BiasSource::of(&Geometry::default()), None);
    }
}
