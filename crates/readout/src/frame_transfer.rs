//! Frame transfer: a burst shifts the image into a store region, which is read behind a shield.
//!
//! A store of N rows ends at the register, and the image begins behind it. The burst makes N transfers, each in its own line time.
//! It takes the packet of row r through the r + 1 pixels of its column of the image and through the store, down to the pixel r + 1
//! from the register. From there it is read at the ordinary line time:
//!
//! ```text
//!            ◀── slow ──┬──────── burst ─────────◀───────── burst ──────────
//!   register │ pixel 0 … pixel r │ … │ pixel N−1 │ row 0 │ … row r │ … image
//!                         store                            image
//! ```
//!
//! The effect of a pixel depends only on the charges with which packets arrive, so this is a composition of readouts:
//!
//! 1. The image region at the line time of the burst: an ordinary readout that ends at the store.
//! 2. The store's pixels above the last packet, in the burst: all packets pass them, after those that were downstream.
//! 3. The pixels in which packets wait, one by one, the farthest first: packets up to the one that waits there come in the burst, the
//!    others at the line time of the readout.
//! 4. The store's pixels below the first packet, at the line time of the readout.
//!
//! No time passes between the burst and the first line that is read. The third is exact for capture at once into one cloud in a clock
//! of one phase, whose traps are followed through burst and lines (`waiting_pixels.rs`). Otherwise packets that are read find the
//! traps as if all packets before them had passed at the line time of the readout. Some of these passed in the burst and left more
//! traps filled. This affects only packets within a few release times, in the pixels where packets wait.
//!
//! Derived for ctiplan; `tests/frame_transfer.rs` compares it with a program that follows all pixels in time.

use ndarray::{Array2, Axis, s};

use super::bands::Journey;
use super::several_clouds::clouds_of;
use super::waiting_pixels::WaitingPixel;
use super::{Cloud, Method, Readout, Trap, WIDEST, columns, continuum};

/// A detector with a store region.
#[derive(Clone, Debug, PartialEq)]
pub struct FrameTransfer {
    /// The image region; release times in transfers of the burst.
    pub image: Readout,
    /// The store region during the burst; release times in transfers of the burst.
    pub burst: Readout,
    /// The store region as it is read; release times in transfers of the readout.
    pub store: Readout,
    /// Rows of the store.
    pub rows: u32,
}

impl FrameTransfer {
    /// Shifts an image into the store and reads it, as [`Readout::parallel_after_each`]: `charge_e[column]` lies in `rows` rows between
    /// the image given and the store.
    ///
    /// # Panics
    /// As [`Readout::parallel`], and with [`Method::CarriedTraps`], whose traps are carried through equal pixels only.
    pub fn parallel_after_each(&self, image: &Array2<f64>, rows: i64, charge_e: &[f64]) -> Array2<f64> {
        assert!(self.store.method != Method::CarriedTraps, "traps are carried through equal pixels only");
        let mut packets = self.image.parallel_after_each(image, rows, charge_e);
        // In the image region they have filled the pixels they started in; in the store, others have passed before them.
        let settled_e: Vec<f64> = charge_e.iter().map(|charge_e| self.image.settled_e(*charge_e)).collect();
        let ahead = Ahead { rows: rows.max(0), charge_e: &settled_e };
        let above = i64::from(self.rows) - (rows + image.nrows() as i64).max(0);
        packets = ahead.through(&self.burst, packets, above);
        packets = self.through_resting_places(packets, rows, &ahead);
        ahead.through(&self.store, packets, rows.min(self.rows.into()))
    }

    /// The pixels in which packets wait after the burst.
    fn through_resting_places(&self, mut packets: Array2<f64>, rows: i64, ahead: &Ahead) -> Array2<f64> {
        let exists = |row: &usize| (0..i64::from(self.rows)).contains(&(rows + *row as i64));
        if let Some((traps, cloud)) = self.followed() {
            let burst_per_line = self.burst.traps[0].release_transfers / self.store.traps[0].release_transfers;
            let pixel = WaitingPixel::new(&traps, &cloud, burst_per_line, packets.nrows());
            return columns(&packets, Axis(1), &|charge_e, column| {
                let ahead_e = if ahead.rows > 0 { ahead.charge_e[column as usize] } else { 0.0 };
                for waiting in (0..charge_e.len()).rev().filter(exists) {
                    pixel.pass(charge_e, waiting, cloud.height(ahead_e));
                }
            });
        }
        for waiting in (0..packets.nrows()).rev().filter(exists) {
            let in_burst = ahead.through(&self.burst, packets.slice(s![..=waiting, ..]).to_owned(), 1);
            packets = ahead.through(&self.store, packets, 1);
            packets.slice_mut(s![..=waiting, ..]).assign(&in_burst);
        }
        packets
    }
}

impl FrameTransfer {
    /// Traps and cloud of the store if they can be followed through burst and readout.
    fn followed(&self) -> Option<(Vec<Trap>, Cloud)> {
        let method = self.store.method;
        let exact = matches!(method, Method::Exact | Method::Fast { .. });
        let traps: Vec<Trap> = self.store.traps.iter().filter(|trap| trap.density_per_px > 0.0).copied().collect();
        let at_once = |trap: &Trap| trap.capture_transfers == 0.0 && !trap.returns() && trap.release_transfers > 0.0;
        let (clouds, _) = clouds_of(&traps, &self.store.cloud);
        (exact && !traps.is_empty() && clouds.len() == 1 && self.store.traps.iter().all(at_once))
            .then(|| (continuum::resolved(&traps, WIDEST, continuum::error_of(method)), clouds[0].clone()))
    }
}

/// Packets that pass the store ahead of an image.
struct Ahead<'a> {
    rows: i64,
    /// Their charge in each column, e-.
    charge_e: &'a [f64],
}

impl Ahead<'_> {
    /// The packets after all of them have passed `pixels` pixels.
    fn through(&self, readout: &Readout, packets: Array2<f64>, pixels: i64) -> Array2<f64> {
        if pixels <= 0 {
            return packets;
        }
        let nothing = vec![0.0; self.charge_e.len()];
        let charge_e = if self.rows > 0 { self.charge_e } else { &nothing };
        readout.along(&packets, Journey::passed_by_all(self.rows, pixels), charge_e, Axis(0))
    }
}
