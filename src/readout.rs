//! Image and traps → image with trails.
//!
//! One transfer is the contract of the whole crate. In each physical pixel, for each packet that passes, in order:
//! a filled trap releases its electron with probability 1 − exp(−1/τ); what is released joins the packet; then
//! every empty trap below the height h(n) of the charge cloud captures one electron at once.
//!
//! ```text
//! row r of the image starts r + 1 + rows-downstream pixels from the register and passes through all of them:
//!
//!   register │ pixel 0 │ pixel 1 │ … downstream … │ row 0 │ row 1 │ … image … │
//!            ◀───────────────────────── charge moves
//! ```
//!
//! Four ways to do that stand behind one interface, [`Readout`]: [`Method::Fast`] (what everything else uses),
//! [`Method::Exact`], [`Method::Fractional`] and [`Method::MonteCarlo`].
//!
//! Traps that need time to capture follow another law, inside the cloud as the packet arrives: see `readout/slow.rs`. Release
//! times that are spread are resolved into many species of one release time each: see `readout/continuum.rs`.
//!
//! Sources: Rhodes et al. 2010 (PASP 122, 439), section 3; Massey et al. 2010 (MNRAS 401, 371) for the cloud that
//! captures at once. Holds where one transfer is one step (no clock phases).

mod cloud;
mod continuum;
mod exact;
mod fast;
mod fractional;
mod monte_carlo;
mod pixel;
mod slow;

pub use cloud::Cloud;

use ndarray::{Array2, ArrayView1, Axis};
use rayon::prelude::*;

use pixel::{Passage, Pixel, Workspace};
use slow::SlowPixel;

/// One trap species as the readout meets it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Trap {
    /// Traps per pixel, ρ.
    pub density_per_px: f64,
    /// Release time constant τ, in units of one transfer; the median where it is spread.
    pub release_transfers: f64,
    /// Standard deviation of ln τ; 0 where all traps have the same.
    pub release_sigma: f64,
    /// Capture time constant τc inside the cloud, in units of one transfer; 0 where capture is instantaneous.
    pub capture_transfers: f64,
}

impl Trap {
    /// Traps of one release time (in units of one transfer) that capture at once.
    pub const fn new(density_per_px: f64, release_transfers: f64) -> Trap {
        Trap { density_per_px, release_transfers, release_sigma: 0.0, capture_transfers: 0.0 }
    }

    /// Fraction filled inside the clouds of so many packets of background.
    fn filled_by(&self, packets: i64) -> f64 {
        let (_, full, approach) = self.passage();
        full * (1.0 - approach.powf(packets as f64))
    }

    /// Where capture takes time: exp(−1/τ), f∞ and exp(−1/τc − 1/τ).
    fn passage(&self) -> (f64, f64, f64) {
        let (release, capture) = (self.release_transfers, self.capture_transfers);
        // A release time of 0 and a capture time of 0 at once: the trap captures.
        let full = if capture == 0.0 { 1.0 } else { release / (release + capture) };
        ((-1.0 / release).exp(), full, (-1.0 / capture - 1.0 / release).exp())
    }
}

/// How the transfers are computed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Method {
    /// Runge-Kutta methods for the *difference* equation of the transfers, with error control. `relative` is the error
    /// allowed in the charge of any packet, as estimated, in units of the largest displacement of charge in the image.
    Fast {
        /// Largest error of a packet over the largest change of a packet.
        relative: f64,
    },
    /// Every transfer of every packet, one by one.
    Exact,
    /// The paper's fractional traps: each species is cut into `levels` traps at fixed heights, whose filling is a
    /// fraction. Every transfer is done. (Rhodes et al. 2010, section 3: 10 000 levels.)
    Fractional {
        /// Number of heights between 0 and 1.
        levels: usize,
    },
    /// The paper's real traps: whole numbers of them at random places and heights that catch and release whole
    /// electrons at random. One realisation per seed.
    MonteCarlo {
        /// The same seed gives the same bits, whatever the number of threads.
        seed: u64,
    },
}

/// What lies between row 0 of an image and the register.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Downstream {
    /// Number of rows; row r of the image makes r + 1 + rows transfers. Negative where the image reaches past the
    /// register: those rows make no transfer.
    pub rows: i64,
    /// Charge of the packets in those rows before readout, e-. They have passed before row 0 does and have left the
    /// traps that they reach full (with instantaneous capture this is the steady state of any number of equal packets), or
    /// as full as they could get. 0: the traps are empty when row 0 arrives.
    pub charge_e: f64,
}

impl Downstream {
    /// The image touches the register: row r makes r + 1 transfers and meets empty traps.
    pub const NONE: Downstream = Downstream { rows: 0, charge_e: 0.0 };
}

/// A detector's traps and wells, and the way its transfers are computed.
#[derive(Clone, Debug, PartialEq)]
pub struct Readout {
    /// Trap species.
    pub traps: Vec<Trap>,
    /// How high a charge cloud reaches.
    pub cloud: Cloud,
    /// The way to compute.
    pub method: Method,
}

/// Calls `$body` with `$width` bound to the smallest width that holds a number of species.
macro_rules! with_width {
    ($species:expr, |$width:ident| $body:expr) => {
        match $species {
            0..=1 => with_width!(@ 1, $width, $body),
            2 => with_width!(@ 2, $width, $body),
            3..=4 => with_width!(@ 4, $width, $body),
            5..=8 => with_width!(@ 8, $width, $body),
            9..=16 => with_width!(@ 16, $width, $body),
            17..=32 => with_width!(@ 32, $width, $body),
            33..=64 => with_width!(@ 64, $width, $body),
            65..=128 => with_width!(@ 128, $width, $body),
            _ => with_width!(@ { WIDEST }, $width, $body),
        }
    };
    (@ $value:expr, $width:ident, $body:expr) => {{
        const $width: usize = $value;
        $body
    }};
}

/// Release times that species may be resolved into, all together.
const WIDEST: usize = 256;

/// Most species that one readout takes.
pub const MAX_SPECIES: usize = 128;

impl Readout {
    /// Clocks an image out along its rows.
    ///
    /// `image[[row, column]]`, electrons, row 0 nearest the register; the same shape comes back. Columns are
    /// independent of one another and are computed in parallel; the result does not depend on the number of threads.
    ///
    /// # Panics
    /// With more than [`MAX_SPECIES`] species.
    pub fn parallel(&self, image: &Array2<f64>, downstream: Downstream) -> Array2<f64> {
        self.along(image, downstream, Axis(0))
    }

    /// Clocks an image out along its columns, column 0 nearest the amplifier: the same code, the axis swapped.
    ///
    /// # Panics
    /// With more than [`MAX_SPECIES`] species.
    pub fn serial(&self, image: &Array2<f64>, downstream: Downstream) -> Array2<f64> {
        self.along(image, downstream, Axis(1))
    }

    /// Clocks out one column of packets (e-), packet 0 nearest the register.
    ///
    /// # Panics
    /// With more than [`MAX_SPECIES`] species.
    pub fn column(&self, charge_e: &[f64], downstream: Downstream) -> Vec<f64> {
        let image = Array2::from_shape_vec((charge_e.len(), 1), charge_e.to_vec()).expect("one column");
        self.parallel(&image, downstream).into_raw_vec_and_offset().0
    }

    /// The same readout without chance: what the mean over many random sets of traps tends to.
    pub fn expected(&self) -> Readout {
        match self.method {
            Method::MonteCarlo { .. } => Readout { method: Method::Exact, ..self.clone() },
            _ => self.clone(),
        }
    }

    /// Packets downstream as they are when they pass: each has filled the empty traps of the pixel it started in, and
    /// has then met traps that an equal packet had just filled.
    fn settled(&self, downstream: Downstream) -> Downstream {
        let held = |trap: &Trap| trap.density_per_px * trap.passage().1;
        let spent_e = self.traps.iter().map(held).sum::<f64>() * self.cloud.height(downstream.charge_e);
        Downstream { charge_e: (downstream.charge_e - spent_e).max(0.0), ..downstream }
    }

    fn along(&self, image: &Array2<f64>, downstream: Downstream, transfer: Axis) -> Array2<f64> {
        assert!(self.traps.len() <= MAX_SPECIES, "at most {MAX_SPECIES} trap species");
        // Without traps, or with traps that hold nothing, there is nothing to do.
        let traps: Vec<Trap> = self.traps.iter().filter(|trap| trap.density_per_px > 0.0).copied().collect();
        let across = Axis(1 - transfer.index());
        let rows = image.len_of(transfer);
        if rows == 0 || traps.is_empty() {
            return image.clone();
        }
        let traps = continuum::resolved(&traps, WIDEST);
        let slow = traps.iter().any(|trap| trap.capture_transfers > 0.0);
        let lanes = match self.method {
            Method::Fractional { levels } => lanes(image, across, |charge_e, _| {
                fractional::column(&traps, &self.cloud, charge_e, self.settled(downstream), levels);
            }),
            Method::MonteCarlo { seed } => lanes(image, across, |charge_e, lane| {
                let before = self.settled(downstream);
                monte_carlo::column(&traps, &self.cloud, charge_e, before, seed, lane as u64);
            }),
            _ if slow => {
                let merge_e = match self.method {
                    Method::Fast { relative } => {
                        let brightest = image.iter().copied().fold(0.0, f64::max);
                        let density: f64 = traps.iter().map(|trap| trap.density_per_px).sum();
                        MERGED * relative * density * self.cloud.height(brightest)
                    }
                    _ => 0.0,
                };
                with_width!(traps.len(), |WIDTH| {
                    let pixel = SlowPixel::<WIDTH>::new(&traps, self.cloud.clone(), downstream, merge_e);
                    self.through(&pixel, image, downstream, across)
                })
            }
            _ => with_width!(traps.len(), |WIDTH| {
                let pixel = Pixel::<WIDTH>::new(&traps, self.cloud.clone(), rows);
                self.through(&pixel, image, self.settled(downstream), across)
            }),
        };
        let mut trailed = image.clone();
        for (lane, charge_e) in lanes.into_iter().enumerate() {
            trailed.index_axis_mut(across, lane).assign(&ArrayView1::from(&charge_e));
        }
        trailed
    }

    /// Passes the lanes of an image over pixels of one kind.
    fn through<P: Passage>(
        &self,
        pixel: &P,
        image: &Array2<f64>,
        downstream: Downstream,
        across: Axis,
    ) -> Vec<Vec<f64>> {
        let tolerance_e = match self.method {
            Method::Fast { relative } => Some(relative * largest_displacement(pixel, image, downstream, across)),
            _ => None,
        };
        (0..image.len_of(across))
            .into_par_iter()
            .with_min_len(LANES_PER_TASK)
            .map_init(Workspace::default, |work, lane| {
                let mut charge_e = image.index_axis(across, lane).to_vec();
                match tolerance_e {
                    Some(tolerance_e) => fast::column(pixel, &mut charge_e, downstream, tolerance_e, work),
                    None => exact::column(pixel, &mut charge_e, downstream, work),
                }
                charge_e
            })
            .collect()
    }
}

/// Share of the accuracy asked for, of all the charge that the traps of a pixel can hold, that one merger of levels of
/// slowly capturing traps may misplace: there may be one for every packet and pixel.
const MERGED: f64 = 1e-5;

/// The lanes of an image after something was done to each, with its number.
fn lanes(image: &Array2<f64>, across: Axis, column: impl Fn(&mut [f64], usize) + Sync) -> Vec<Vec<f64>> {
    let lane = |lane: usize| {
        let mut charge_e = image.index_axis(across, lane).to_vec();
        column(&mut charge_e, lane);
        charge_e
    };
    (0..image.len_of(across)).into_par_iter().map(lane).collect()
}

/// Columns that one thread takes at a time: a stamp's columns are done sooner than a thread is woken.
const LANES_PER_TASK: usize = 64;

/// Largest change of a packet in the lane that holds the brightest pixel, to first order, e-: what errors are
/// measured against. One lane is enough, and costs one pass.
fn largest_displacement<P: Passage>(pixel: &P, image: &Array2<f64>, downstream: Downstream, across: Axis) -> f64 {
    let brightest = image
        .axis_iter(across)
        .map(|lane| lane.iter().copied().fold(f64::NEG_INFINITY, f64::max))
        .enumerate()
        .fold((0, f64::NEG_INFINITY), |best, (lane, peak)| if peak > best.1 { (lane, peak) } else { best })
        .0;
    let charge_e = image.index_axis(across, brightest).to_vec();
    let mut work = Workspace::<P::Levels>::default();
    let journey = pixel::Block { nearest: 0, pixels: charge_e.len() as i64 + downstream.rows };
    let found = &mut work.stages[0];
    found.resize(charge_e.len());
    pixel.pass(&charge_e, None, journey, downstream, &mut work.levels, found);
    // No packet loses more than it has, although a first-order change may.
    let moved = found.change_e.iter().zip(&charge_e).map(|(change, charge)| change.abs().min(change.max(*charge)));
    moved.fold(0.0, f64::max)
}
