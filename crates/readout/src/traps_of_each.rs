//! Columns whose pixels hold traps of their own, side by side: one detector at many doses or temperatures.
//!
//! One column alone takes as long as [`LANES`] of them, since all lanes of a vector are computed anyway.

use ndarray::{Array2, Axis};

use super::bands::Journey;
use super::multirevolution::{self, Workspace};
use super::passage::Lead;
use super::pixel::{self, Pixel, Rates};
use super::simd::{LANES, Packets};
use super::{Method, Readout, Trap, continuum};

/// Maximum number of release times into which the species of a column are resolved here; its tables are as wide.
const WIDE: usize = 32;

impl Readout {
    /// [`Readout::parallel_after_each`] if each column has traps of its own: `traps[column]` in place of those of this readout.
    /// Sixteen columns take little longer than one if they can be read together ([`Readout::has_room_beside`]); others are read as
    /// by [`Readout::parallel_after_each`].
    ///
    /// # Panics
    /// As [`Readout::parallel_after_each`], or if the number of sets of traps is not that of the columns.
    pub fn parallel_with_traps_of_each(
        &self,
        image: &Array2<f64>,
        rows: i64,
        charge_e: &[f64],
        traps: &[&[Trap]],
    ) -> Array2<f64> {
        assert_eq!(traps.len(), image.ncols(), "one set of traps for each column");
        let mut kinds: Vec<Kind> = Vec::new();
        for (column, traps) in traps.iter().enumerate() {
            match kinds.iter_mut().find(|kind| kind.readout.traps == *traps) {
                Some(kind) => kind.columns.push(column),
                None => kinds.push(Kind::of(Readout { traps: traps.to_vec(), ..self.clone() }, column)),
            }
        }
        let (together, alone): (Vec<Kind>, Vec<Kind>) = kinds.into_iter().partition(|kind| kind.relative().is_some());
        let mut read = image.clone();
        let mut place = |columns: &[usize], part: Array2<f64>| {
            for (column, charge_e) in columns.iter().zip(part.columns()) {
                read.column_mut(*column).assign(&charge_e);
            }
        };
        for Kind { readout, columns, .. } in alone {
            let charge_e: Vec<f64> = columns.iter().map(|column| charge_e[*column]).collect();
            place(&columns, readout.parallel_after_each(&image.select(Axis(1), &columns), rows, &charge_e));
        }
        // The kind of each column, and its number.
        let columns: Vec<(&Kind, usize)> =
            together.iter().flat_map(|kind| kind.columns.iter().map(move |column| (kind, *column))).collect();
        for group in columns.chunks(LANES) {
            let numbers: Vec<usize> = group.iter().map(|(_, column)| *column).collect();
            place(&numbers, side_by_side(image, rows, charge_e, group));
        }
        read
    }

    /// Whether columns of this readout are read together with those of another one that has the same well and method, but other
    /// traps: by [`Method::Fast`], if the traps fill one cloud, capture at once and return nothing.
    pub fn has_room_beside(&self) -> bool {
        Kind::of(self.clone(), 0).relative().is_some()
    }
}

/// Columns with the same traps.
struct Kind {
    readout: Readout,
    /// Its traps, resolved into species of one release time.
    species: Vec<Trap>,
    columns: Vec<usize>,
}

impl Kind {
    fn of(readout: Readout, column: usize) -> Kind {
        let traps: Vec<Trap> = readout.traps.iter().filter(|trap| trap.density_per_px > 0.0).copied().collect();
        let species = continuum::resolved(&traps, super::WIDEST, continuum::error_of(readout.method));
        Kind { readout, species, columns: vec![column] }
    }

    /// Accuracy of the readout, if columns of other kinds may be beside these.
    fn relative(&self) -> Option<f64> {
        let Method::Fast { relative } = self.readout.method else { return None };
        let few = (1..=WIDE).contains(&self.species.len());
        let plain = self.species.iter().all(|trap| {
            trap.capture_transfers == 0.0
                && trap.surface_level_e.is_none()
                && trap.well_fill_power.is_none()
                && !trap.returns()
        });
        (few && plain).then_some(relative)
    }
}

/// Reads out at most [`LANES`] columns of an image.
fn side_by_side(image: &Array2<f64>, rows: i64, charge_e: &[f64], group: &[(&Kind, usize)]) -> Array2<f64> {
    let species = group.iter().map(|(kind, _)| kind.species.len()).max().expect("a group has columns");
    with_width!([pixel::FEW, WIDE], species, |WIDTH| with_width_of::<WIDTH>(image, rows, charge_e, group, species))
}

fn with_width_of<const S: usize>(
    image: &Array2<f64>,
    rows: i64,
    charge_e: &[f64],
    group: &[(&Kind, usize)],
    species: usize,
) -> Array2<f64> {
    let last = group.len() - 1;
    // One table for neighbours of one kind.
    let mut rates: Vec<Rates<S>> = Vec::new();
    let mut of_lane = Vec::new();
    for (lane, (kind, _)) in group.iter().enumerate() {
        if lane == 0 || !std::ptr::eq(*kind, group[lane - 1].0) {
            rates.push(Rates::of(&kind.species));
        }
        of_lane.push(rates.len() - 1);
    }
    let readout = &group[0].0.readout;
    let of_each = |lane: usize| &rates[of_lane[lane.min(last)]];
    let pixel = Pixel::<S, false, Packets>::of_each(species, of_each, readout.cloud.clone(), image.nrows());
    let settled_e: Vec<f64> = group.iter().map(|(kind, column)| kind.readout.settled_e(charge_e[*column])).collect();
    let journey = Journey::of(rows);
    let lead = Lead {
        rows: journey.rows,
        charge_e: std::array::from_fn(|lane| settled_e[lane.min(last)]),
        pixels: journey.pixels(image.nrows()),
    };
    let columns: Vec<usize> = group.iter().map(|(_, column)| *column).collect();
    let mut read_e: Vec<Packets> =
        image.rows().into_iter().map(|row| std::array::from_fn(|lane| row[columns[lane.min(last)]])).collect();
    let mut work = Workspace::new(image.nrows());
    let relative = group[0].0.relative().expect("columns that are read together");
    let aim = multirevolution::aim(&pixel, &read_e, &lead, relative, &mut work);
    multirevolution::columns(&pixel, &mut read_e, &lead, aim, &mut work);
    Array2::from_shape_fn((image.nrows(), group.len()), |(row, lane)| read_e[row][lane])
}
