//! Frames through the readout, by ArCTIc's conventions.

mod every_transfer;

use ctiplan::error::InputError;
use ctiplan::readout::{Clock, ClockStep, Cloud, Downstream, MAX_SPECIES, Method, Readout, Trap};
use ndarray::{Array2, Axis};
use numpy::{IntoPyArray, PyArray2, PyReadonlyArray2};
use pyo3::prelude::*;

use crate::work;
use every_transfer::{Order, Species, Transfers};

/// Traps of one species, as Python says it. Times are in transfers, volumes fractions of the full well.
#[derive(FromPyObject, Clone, Copy)]
#[pyo3(from_item_all)]
pub struct Traps {
    density: f64,
    release: f64,
    sigma: f64,
    capture: f64,
    none_exposed: f64,
    full_exposed: f64,
}

/// How charge is transferred, as Python says it.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Setting {
    full_well: f64,
    notch: f64,
    power: f64,
    first_electron_fill: f64,
    offset: usize,
    pixels: Option<usize>,
    /// The first row that takes part; those before it hold no charge.
    first: usize,
    empty_for_first: bool,
    /// Pixels that all packets pass, if charge is injected behind them.
    injected: Option<usize>,
    empty_between: bool,
    relative: f64,
    /// Time below each phase, in any unit, and traps there, as a share of all.
    dwells: Vec<f64>,
    shares: Vec<f64>,
}

/// Reads a frame out along its first axis, row 0 nearest the register. What is checked here is what would panic; the facade says
/// the rest in the user's words.
#[pyfunction]
pub fn arctic_readout<'py>(
    py: Python<'py>,
    frame_e: PyReadonlyArray2<'py, f64>,
    traps: Vec<Traps>,
    setting: Setting,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let frame_e = frame_e.as_array().to_owned();
    let read = work::run(py, None, move |_| {
        check(&traps, &setting)?;
        setting.readout(&traps, frame_e)
    })?;
    Ok(read.into_pyarray(py))
}

fn check(traps: &[Traps], setting: &Setting) -> Result<(), InputError> {
    let refused = |problem: String| Err(InputError::new("cannot read the frame out", problem));
    let kinds = traps.len() * setting.dwells.len();
    if kinds > MAX_SPECIES {
        return refused(format!("{kinds} trap species in all phases; at most {MAX_SPECIES} are possible"));
    }
    if setting.full_well <= setting.notch {
        let Setting { full_well, notch, .. } = setting;
        return refused(format!("the full well of {full_well} e- must be above the notch of {notch} e-"));
    }
    let plain = |trap: &Traps| trap.capture == 0.0 && trap.sigma == 0.0 && setting.dwells.len() == 1;
    if setting.is_special(traps) && !traps.iter().all(plain) {
        return refused(
            "capture that takes time, spread release times and several phases go with overscan_start = -1, \
             empty_traps_between_columns = True, traps in the whole volume and no charge injection only"
                .into(),
        );
    }
    Ok(())
}

impl Traps {
    /// Whether traps lie in a part of the volume.
    fn is_in_part(&self) -> bool {
        self.full_exposed > 0.0
    }
}

impl Setting {
    /// Whether the readout of ctiplan has no such setting.
    fn is_special(&self, traps: &[Traps]) -> bool {
        self.pixels.is_some() || self.injected.is_some() || !self.empty_between || traps.iter().any(Traps::is_in_part)
    }

    fn readout(&self, traps: &[Traps], frame_e: Array2<f64>) -> Result<Array2<f64>, InputError> {
        let cloud = Cloud::new(self.full_well, self.notch, self.power).with_volume_at_zero(self.first_electron_fill);
        if self.is_special(traps) {
            return Ok(self.every_transfer(traps, &cloud, frame_e));
        }
        let trap = |traps: &Traps| Trap {
            release_sigma: traps.sigma,
            capture_transfers: traps.capture,
            ..Trap::new(traps.density, traps.release)
        };
        let traps: Vec<Trap> = traps.iter().map(trap).collect();
        let traps = self.clock()?.spread(&traps);
        let readout = Readout { traps, cloud, method: Method::Fast { relative: self.relative } };
        if !self.empty_for_first {
            return Ok(readout.parallel_carried(&frame_e, self.offset, self.relative));
        }
        Ok(readout.parallel(&frame_e, Downstream { rows: self.offset as i64, charge_e: 0.0 }))
    }

    /// Charge below one phase after the other, in the direction of transfer.
    fn clock(&self) -> Result<Clock, InputError> {
        let step = |(phase, dwell): (usize, &f64)| ClockStep { dwell: *dwell, holds: vec![phase] };
        let steps: Vec<ClockStep> = self.dwells.iter().enumerate().map(step).collect();
        Clock::new(&steps, &self.shares)
            .map_err(|fault| InputError::new("cannot read the frame out", format!("its phases: {fault}")))
    }

    fn every_transfer(&self, traps: &[Traps], cloud: &Cloud, mut frame_e: Array2<f64>) -> Array2<f64> {
        let species = |traps: &Traps| Species {
            density_per_px: traps.density,
            release_transfers: traps.release,
            none_exposed: traps.none_exposed,
            full_exposed: traps.full_exposed,
        };
        let species: Vec<Species> = traps.iter().map(species).collect();
        let Setting { offset, pixels, first, empty_between, .. } = *self;
        let transfers = match self.injected {
            Some(pixels) => Transfers::Injected(pixels),
            None if self.empty_for_first => Transfers::Empty,
            None => Transfers::Carried,
        };
        let order = Order { offset, pixels, first, transfers, empty_between };
        let mut columns: Vec<Vec<f64>> = frame_e.axis_iter(Axis(1)).map(|column| column.to_vec()).collect();
        // Columns that leave their traps to the next are read one after another, others side by side.
        let together = if empty_between { 1 } else { columns.len().max(1) };
        rayon::scope(|scope| {
            for columns in columns.chunks_mut(together) {
                let species = &species;
                scope.spawn(move |_| every_transfer::columns(columns, species, cloud, order));
            }
        });
        for (mut out, column) in frame_e.axis_iter_mut(Axis(1)).zip(columns) {
            out.assign(&ndarray::Array1::from(column));
        }
        frame_e
    }
}
