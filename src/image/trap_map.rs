//! Maps of traps: for each column of a frame, a factor on the densities of the pixels' traps.
//!
//! Columns share no packet, so each is read out with its own densities, exactly. Factors that change along a column would need a
//! readout in which some pixels of a column have traps and others have not; such maps are refused.

use std::collections::BTreeMap;
use std::path::Path;

use ndarray::{Array2, Axis};
use rayon::prelude::*;

use super::fits::{Fits, Hdu, HduKind};
use crate::error::InputError;
use crate::readout::{Downstream, Readout};

/// Largest factor.
const MOST: f64 = 1e6;

/// Factors by column, of one frame or of several.
#[derive(Clone, Debug)]
pub struct TrapMap {
    /// The path as given.
    pub name: String,
    /// EXTNAME, EXTVER and factors of each image of the file.
    images: Vec<(Option<String>, i64, Vec<f64>)>,
}

impl TrapMap {
    /// Reads the images of a FITS file: one row each, a factor for each column.
    ///
    /// # Errors
    /// Where the file cannot be read, has no such image, or a factor is not from 0 to 10⁶.
    pub fn read(path: &Path) -> Result<TrapMap, InputError> {
        let name = path.display().to_string();
        let refusal = |problem: String| InputError::new(format!("cannot use trap map `{name}`"), problem);
        let mut fits = Fits::open(path)?;
        let mut images = Vec::new();
        for hdu in fits.hdus.clone() {
            let HduKind::Image { rows, .. } = hdu.kind else { continue };
            if rows != 1 {
                return Err(refusal(format!("{hdu} has {rows} rows; one is needed, with a factor for each column"))
                    .with_help("factors that change along a column are not modelled: give their mean over the rows"));
            }
            let factors = fits.pixels(hdu.index)?.physical().into_raw_vec_and_offset().0;
            if let Some(column) = factors.iter().position(|factor| !(0.0..=MOST).contains(factor)) {
                let problem = format!("{hdu}, column {}: {}; allowed: 0 to {MOST}", column + 1, factors[column]);
                return Err(refusal(problem));
            }
            images.push((hdu.name(), hdu.version(), factors));
        }
        if images.is_empty() {
            return Err(refusal("it has no image".into()));
        }
        Ok(TrapMap { name, images })
    }

    /// The factors of a frame with n columns: those of the same EXTNAME and EXTVER, or of the only image.
    ///
    /// # Errors
    /// Where there are none, or for another number of columns.
    pub fn of(&self, frame: &Hdu, columns: usize) -> Result<&[f64], InputError> {
        let refusal = |problem: String| InputError::new(format!("cannot use trap map `{}`", self.name), problem);
        let named = |image: &&(Option<String>, i64, Vec<f64>)| (&image.0, image.1) == (&frame.name(), frame.version());
        let image = match &self.images[..] {
            [only] => only,
            several => several.iter().find(named).ok_or_else(|| {
                refusal(format!("none of its {} images has the EXTNAME and EXTVER of {frame}", several.len()))
                    .with_help("give one image for all frames, or one for each")
            })?,
        };
        match image.2.len() {
            there if there == columns => Ok(&image.2),
            there => Err(refusal(format!("it has {there} columns, and {frame} has {columns}"))),
        }
    }
}

/// A parallel readout in which each column has so many times the traps.
pub(super) fn parallel(
    readout: &Readout,
    charge_e: &Array2<f64>,
    downstream: Downstream,
    factors: &[f64],
) -> Array2<f64> {
    // Columns with the same traps are read side by side.
    let mut together: BTreeMap<u64, Vec<usize>> = BTreeMap::new();
    for (column, factor) in factors.iter().enumerate() {
        together.entry(factor.to_bits()).or_default().push(column);
    }
    let together: Vec<(u64, Vec<usize>)> = together.into_iter().collect();
    let read: Vec<Array2<f64>> = together
        .par_iter()
        .map(|(factor, columns)| {
            let mut readout = readout.clone();
            readout.traps.iter_mut().for_each(|trap| trap.density_per_px *= f64::from_bits(*factor));
            readout.parallel(&charge_e.select(Axis(1), columns), downstream)
        })
        .collect();
    let mut read_e = charge_e.clone();
    for ((_, columns), read) in together.iter().zip(read) {
        for (column, read) in columns.iter().zip(read.columns()) {
            read_e.column_mut(*column).assign(&read);
        }
    }
    read_e
}
