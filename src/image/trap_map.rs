//! Maps of traps: factors on the densities of the pixels' traps, by column, by row, or by block of pixels.
//!
//! ```text
//! map ─▶ factors of a frame ─▶ of each amplifier's part, in the order of readout ─▶ bands of each column
//! ```
//!
//! Columns share no packets, so those with the same factors are read out side by side with their own densities; along a column,
//! bands of rows are read out one after another ([`Readout::parallel_in_bands`]). Both are exact.

use std::collections::BTreeMap;
use std::ops::Range;
use std::path::Path;
use std::sync::Arc;

use ndarray::{Array2, Axis};
use sha2::{Digest, Sha256};

use super::fits::{Fits, Hdu, HduKind};
use crate::error::InputError;
use crate::numeric::parallel;
use crate::readout::{Allowed, Band, Downstream, Method, Readout};

/// Largest factor.
const MOST: f64 = 1e6;

/// Factors of one frame or of several.
#[derive(Clone, Debug)]
pub struct TrapMap {
    /// The path as given.
    pub name: String,
    /// EXTNAME, EXTVER and factors of each image of the file.
    images: Vec<(Option<String>, i64, Arc<Array2<f64>>)>,
}

/// Factors on the densities of the traps in the pixels of a frame, or of a part of one.
#[derive(Clone, Debug)]
pub struct Factors {
    map: Arc<Array2<f64>>,
    /// The row of the map for each row.
    rows: Vec<usize>,
    /// The column of the map for each column.
    columns: Vec<usize>,
}

impl TrapMap {
    /// Reads the images of a FITS file: a factor for each pixel or block of pixels of a frame.
    ///
    /// # Errors
    /// If the file cannot be read, has no image, or a factor is outside 0 to 10⁶.
    pub fn read(path: &Path) -> Result<TrapMap, InputError> {
        let name = path.display().to_string();
        let mut fits = Fits::open(path)?;
        let mut images = Vec::new();
        for hdu in fits.hdus.clone() {
            let HduKind::Image { .. } = hdu.kind else { continue };
            let map = fits.pixels(hdu.index)?.physical();
            images.push((hdu.name(), hdu.version(), checked(map, &name, &hdu.to_string())?));
        }
        if images.is_empty() {
            return Err(refusal(&name, "it has no image".into()));
        }
        Ok(TrapMap { name, images })
    }

    /// Adds all its factors to a hash.
    pub(super) fn add_to(&self, hash: &mut Sha256) {
        for (name, version, map) in &self.images {
            hash.update(format!("{name:?} {version} {:?}", map.dim()));
            map.iter().for_each(|factor| hash.update(factor.to_le_bytes()));
        }
    }

    /// A map in memory, for all frames.
    ///
    /// # Errors
    /// If a factor is outside 0 to 10⁶.
    pub fn of_all(name: &str, map: Array2<f64>) -> Result<TrapMap, InputError> {
        Ok(TrapMap { name: name.into(), images: vec![(None, 1, checked(map, name, "the map")?)] })
    }

    /// The factors of a frame: those of the same EXTNAME and EXTVER, or of the only image.
    ///
    /// # Errors
    /// If there are none, if rows or columns of the map are not those of the frame or equal blocks of them, or if factors change
    /// along columns whose traps carry their state from pixel to pixel.
    pub fn of(&self, frame: &Hdu, shape: (usize, usize), method: Method) -> Result<Factors, InputError> {
        let named = |image: &&(Option<String>, i64, _)| (&image.0, image.1) == (&frame.name(), frame.version());
        let (.., map) = match &self.images[..] {
            [only] => only,
            several => several.iter().find(named).ok_or_else(|| {
                let problem = format!("none of its {} images has the EXTNAME and EXTVER of {frame}", several.len());
                refusal(&self.name, problem).with_help("give one image for all frames, or one for each")
            })?,
        };
        self.spread(map, &frame.to_string(), shape, method)
    }

    /// The factors of a frame in memory, of this shape (rows, columns).
    ///
    /// # Errors
    /// As [`TrapMap::of`].
    pub fn of_array(&self, shape: (usize, usize), method: Method) -> Result<Factors, InputError> {
        self.spread(&self.images[0].2, "the frame", shape, method)
    }

    /// Factors of the pixels of a frame.
    fn spread(
        &self,
        map: &Arc<Array2<f64>>,
        frame: &str,
        (rows, columns): (usize, usize),
        method: Method,
    ) -> Result<Factors, InputError> {
        for (there, length, what) in [(map.ncols(), columns, "columns"), (map.nrows(), rows, "rows")] {
            if there == 0 || length % there != 0 {
                let problem = format!("it has {there} {what}, and {frame} has {length}");
                let help = format!(
                    "give 1, {length}, or a number that divides {length}: each for as many {what} of the frame"
                );
                return Err(refusal(&self.name, problem).with_help(help));
            }
        }
        if map.nrows() > 1 && method == Method::CarriedTraps {
            let problem =
                "factors change along the columns, and traps_at_start is `carried`, for pixels that are all alike";
            return Err(refusal(&self.name, problem.into())
                .with_help("give a map of one row, or set readout.traps_at_start to `empty`"));
        }
        let places = |there: usize, length: usize| (0..length).map(|place| place * there / length).collect();
        Ok(Factors { map: map.clone(), rows: places(map.nrows(), rows), columns: places(map.ncols(), columns) })
    }
}

fn refusal(name: &str, problem: String) -> InputError {
    InputError::new(format!("cannot use trap map `{name}`"), problem)
}

/// Checks the factors of a map.
fn checked(map: Array2<f64>, name: &str, place: &str) -> Result<Arc<Array2<f64>>, InputError> {
    match map.indexed_iter().find(|(_, factor)| !(0.0..=MOST).contains(*factor)) {
        None => Ok(Arc::new(map)),
        Some(((row, column), factor)) => {
            let problem = format!("{place}, column {}, row {}: {factor}; allowed: 0 to {MOST}", column + 1, row + 1);
            Err(refusal(name, problem))
        }
    }
}

impl Factors {
    /// The factors of some rows and columns.
    pub fn part(&self, rows: Range<usize>, columns: Range<usize>) -> Factors {
        Factors { map: self.map.clone(), rows: self.rows[rows].to_vec(), columns: self.columns[columns].to_vec() }
    }

    /// The same for some rows and columns, in any order.
    pub(super) fn ordered(
        &self,
        rows: impl Fn(&[usize]) -> Vec<usize>,
        columns: impl Fn(&[usize]) -> Vec<usize>,
    ) -> Factors {
        Factors { map: self.map.clone(), rows: rows(&self.rows), columns: columns(&self.columns) }
    }

    /// Columns with the same traps, with their bands.
    fn alike(&self) -> Vec<(Vec<Band>, Vec<usize>)> {
        let mut of_column: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
        for (column, place) in self.columns.iter().enumerate() {
            of_column.entry(*place).or_default().push(column);
        }
        let mut alike: BTreeMap<Vec<(usize, u64)>, Vec<usize>> = BTreeMap::new();
        for (place, columns) in of_column {
            alike.entry(self.bands(place)).or_default().extend(columns);
        }
        let band = |(first_row, bits)| Band { first_row, density_factor: f64::from_bits(bits) };
        alike.into_iter().map(|(bands, columns)| (bands.into_iter().map(band).collect(), columns)).collect()
    }

    /// First rows and factors (as bits) of the bands of a column of the map.
    fn bands(&self, column: usize) -> Vec<(usize, u64)> {
        let mut bands: Vec<(usize, u64)> = Vec::new();
        for (row, place) in self.rows.iter().enumerate() {
            let bits = self.map[[*place, column]].to_bits();
            if bands.last().is_none_or(|(_, before)| *before != bits) {
                bands.push((row, bits));
            }
        }
        bands
    }

    /// A parallel readout of an image with these rows and columns, with an allowed error if given.
    pub(super) fn parallel(
        &self,
        readout: &Readout,
        charge_e: &Array2<f64>,
        downstream: Downstream,
        allowed: Option<Allowed>,
    ) -> Array2<f64> {
        self.each(charge_e, |charge_e, bands| Some(readout.parallel_in_bands(charge_e, downstream, bands, allowed)))
            .expect("every readout has a result")
    }

    /// Its reversal; None if it cannot be reversed.
    pub(super) fn parallel_reversed(
        &self,
        readout: &Readout,
        read_e: &Array2<f64>,
        downstream: Downstream,
        allowed: Allowed,
    ) -> Option<Array2<f64>> {
        self.each(read_e, |read_e, bands| readout.parallel_in_bands_reversed(read_e, downstream, bands, allowed))
    }

    /// An image after an operation on its columns, those with the same traps together.
    fn each(
        &self,
        image: &Array2<f64>,
        of: impl Fn(&Array2<f64>, &[Band]) -> Option<Array2<f64>> + Sync,
    ) -> Option<Array2<f64>> {
        let alike = self.alike();
        let parts: Option<Vec<Array2<f64>>> =
            parallel::map(&alike, |(bands, columns)| of(&image.select(Axis(1), columns), bands)).into_iter().collect();
        let mut after = image.clone();
        for ((_, columns), part) in alike.iter().zip(parts?) {
            for (column, part) in columns.iter().zip(part.columns()) {
                after.column_mut(*column).assign(&part);
            }
        }
        Some(after)
    }
}
