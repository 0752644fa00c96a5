//! Traps that carry their state on from pixel to pixel, in a handful of passes (see [`Method::CarriedTraps`]).
//!
//! Pixel k starts in the state in which its neighbour nearer to the register was left by its first packet. Followed back to the
//! register, this is the state left by a sequence of packets: packet 0 once for each pixel it passes, then each arrived packet,
//! with its charge in the last pixel it passed. So with d rows downstream, and v_k the charge of packet 0 in pixel k,
//!
//! ```text
//! pixel k < d    empty traps, then packets of v_0 … v_k−1, then packets 0, 1, 2, … of the column
//! pixel k ≥ d    empty traps, then packets of v_0 … v_d−1, then packets 0, 1, 2, … of the column
//! ```
//!
//! where packets that have arrived pass again with the charge they arrived with, and no longer change. This is exact. The effect of
//! a pixel on packet r, δ_r(n), is then a function of the charges alone that differs little from pixel to pixel. Blocks of B pixels
//! are advanced to second order, by the change at their midpoint:
//!
//! ```text
//! n_r ← n_r + b_r δ_r(m),   m_r = n_r + (b_r − 1)/2 δ_r(n),   b_r the pixels of the block that packet r passes
//! ```
//!
//! The block length is halved until the result no longer changes. Derived for ctiplan; compared with every transfer in the test
//! below, and with ArCTIc in `python/tests/test_arctic.py`.

use ndarray::{Array2, ArrayViewMut2, Axis};
use rayon::prelude::*;

use super::block_path::BlockPath;
use super::duplicate_columns::DuplicateColumns;
use super::finite_capture::FiniteCapturePixel;
use super::multirevolution::Workspace;
use super::passage::{Block, Lead, Passage};
use super::pixel::{self, Pixel};
use super::several_clouds::{self, SeveralClouds, Stacks};
use super::simd::{self, LANES, Packets};
use super::{Downstream, Method, Readout, Trap, WIDEST, continuum, interrupt};

/// Blocks of the first attempt.
const FEWEST_BLOCKS: usize = 4;

/// Shortest block that is tried; below that, every pixel is passed by itself.
const SHORTEST: i64 = 3;

/// Share of the tolerance by which two attempts may differ. If the change is smooth, the error of the finer one is a third of their
/// difference. Behind rows without charge it is not smooth, and both may miss the same.
const SHARE: f64 = 0.1;

/// Most recent passages of packet 0 that are kept. What it left earlier is a layer as thin as the charge it has lost since.
const REMEMBERED: usize = 256;

/// Any pixel: all packets pass it, and none starts there.
const ANY: Block = Block { nearest: 0, pixels: 1 };
const EMPTY: Lead = Lead { rows: 1, charge_e: [0.0; LANES], pixels: 0..1 };

impl Readout {
    /// Clocks an image out along its rows by [`Method::CarriedTraps`], to a relative accuracy: the error of a packet, estimated
    /// from the last two attempts, over the largest displacement of charge in the columns around the brightest pixel.
    ///
    /// `image[[row, column]]`, e-, row 0 nearest the register, behind `rows_downstream` empty ones. [`Readout::method`] is ignored.
    /// Species with clouds of their own are followed through every transfer.
    ///
    /// # Panics
    /// As [`Readout::parallel`].
    pub fn parallel_carried(&self, image: &Array2<f64>, rows_downstream: usize, relative: f64) -> Array2<f64> {
        let traps: Vec<Trap> = self.traps.iter().filter(|trap| trap.density_per_px > 0.0).copied().collect();
        if image.is_empty() || traps.is_empty() {
            return image.clone();
        }
        let traps = continuum::resolved(&traps, WIDEST, continuum::error_of(self.method));
        let (clouds, cloud_of) = several_clouds::clouds_of(&traps, &self.cloud);
        if clouds.len() > 1 || traps.iter().any(Trap::returns) {
            let exact = Readout { method: Method::CarriedTraps, ..self.clone() };
            return exact.parallel(image, Downstream { rows: rows_downstream as i64, charge_e: 0.0 });
        }
        let cloud = clouds[0].clone();
        let packets = image.nrows() + rows_downstream;
        if traps.iter().any(|trap| trap.capture_transfers > 0.0) {
            return with_width!([4, 16, 64, WIDEST], traps.len(), |WIDTH| {
                let nothing = Downstream { rows: 1, charge_e: 0.0 };
                let pixel = FiniteCapturePixel::<WIDTH>::new(&traps, cloud, nothing, packets, 0.0);
                let alone = |charge_e: f64| {
                    let mut watermarks = Default::default();
                    pixel.start(0, 0, &mut watermarks);
                    lone(charge_e, rows_downstream, |charge_e, row| pixel.packet(&mut watermarks, charge_e, row + 1).0)
                };
                side_by_side(&pixel, &alone, image, rows_downstream, relative)
            });
        }
        let by_itself = SeveralClouds::new(&traps, (clouds, cloud_of), rows_downstream);
        let alone = |charge_e: f64| {
            let mut stacks = Stacks::default();
            by_itself.start(None, &mut stacks);
            lone(charge_e, rows_downstream, |charge_e, row| by_itself.packet(&mut stacks, charge_e, row).0)
        };
        let remembered = image.nrows() + REMEMBERED.min(rows_downstream);
        with_width!([3, pixel::FEW, WIDEST], traps.len(), |WIDTH| {
            let pixel = Pixel::<WIDTH, false>::new(&traps, cloud, remembered);
            side_by_side(&pixel, &alone, image, rows_downstream, relative)
        })
    }
}

/// Charge of packet 0 in each pixel downstream, and after the last of them, e-. `pass(charge_e, pixel)` gives its change.
fn lone(mut charge_e: f64, rows_downstream: usize, mut pass: impl FnMut(f64, usize) -> f64) -> Vec<f64> {
    let mut before_e = vec![charge_e];
    for place in 0..rows_downstream {
        charge_e += pass(charge_e, place);
        before_e.push(charge_e);
    }
    before_e
}

/// Reads an image out, several columns at a time; `alone` is [`lone`] for a charge.
fn side_by_side<P: Passage>(
    pixel: &P,
    alone: &(dyn Fn(f64) -> Vec<f64> + Sync),
    image: &Array2<f64>,
    rows_downstream: usize,
    relative: f64,
) -> Array2<f64> {
    let columns = DuplicateColumns::of(image.view(), &vec![0.0; image.ncols()]);
    let groups: Vec<&[usize]> = columns.distinct.chunks(LANES).collect();
    let brightest = groups[super::brightest(image.view(), &columns.distinct) / LANES];
    let rows = image.nrows();
    let start = |work: &mut Work<P::Watermarks>, group: &[usize]| {
        simd::gather(image.view(), group, &mut work.before_e);
        let first = work.before_e[0].map(alone);
        work.first_e.clear();
        work.first_e
            .extend((0..=rows_downstream).map(|place| -> Packets { std::array::from_fn(|lane| first[lane][place]) }));
    };
    let mut work = Work::new(rows, rows_downstream);
    start(&mut work, brightest);
    let tolerance_e = relative * work.moved_e(pixel);
    let mut trailed = Array2::zeros((rows, columns.distinct.len()));
    let read = |work: &mut Work<P::Watermarks>, group: &[usize], mut out: ArrayViewMut2<f64>| {
        start(work, group);
        work.read(pixel, tolerance_e);
        for (mut out, charge_e) in out.rows_mut().into_iter().zip(&work.charge_e) {
            let out = out.as_slice_mut().expect("columns side by side");
            out.copy_from_slice(&charge_e[..out.len()]);
        }
    };
    let parts = trailed.axis_chunks_iter_mut(Axis(1), LANES).into_par_iter();
    let buffers = || Work::new(rows, rows_downstream);
    (parts, groups).into_par_iter().for_each_init(buffers, |work, (out, group)| read(work, group, out));
    columns.spread(trailed)
}

/// Columns side by side, and buffers.
struct Work<L> {
    before_e: Vec<Packets>,
    charge_e: Vec<Packets>,
    /// The same with which packets pass, or have passed their last pixel.
    arriving_e: Vec<Packets>,
    coarser_e: Vec<Packets>,
    /// Packet 0 in each pixel downstream, and after the last of them.
    first_e: Vec<Packets>,
    /// What passes a pixel: packet 0 as often as it is remembered, then the packets of the column.
    row_e: Vec<Packets>,
    buffers: Workspace<L>,
}

impl<L: Default> Work<L> {
    fn new(rows: usize, rows_downstream: usize) -> Work<L> {
        let empty = || vec![[0.0; LANES]; rows];
        let [before_e, charge_e, arriving_e, coarser_e] = [(); 4].map(|()| empty());
        let remembered = REMEMBERED.min(rows_downstream);
        let buffers = Workspace::new(rows + remembered);
        Work { before_e, charge_e, arriving_e, coarser_e, first_e: Vec::new(), row_e: Vec::new(), buffers }
    }

    /// Pixels downstream.
    fn downstream(&self) -> usize {
        self.first_e.len() - 1
    }

    /// Largest displacement of charge, estimated with the fewest blocks, e-.
    fn moved_e<P: Passage<Watermarks = L>>(&mut self, pixel: &P) -> f64 {
        self.journey(pixel, self.longest(), f64::INFINITY);
        apart(&self.charge_e, &self.before_e)
    }

    /// Pixels of a block of the first attempt.
    fn longest(&self) -> i64 {
        (self.before_e.len() + self.downstream()).div_ceil(FEWEST_BLOCKS) as i64
    }

    /// Reads the columns out, with ever shorter blocks.
    fn read<P: Passage<Watermarks = L>>(&mut self, pixel: &P, tolerance_e: f64) {
        let mut length = self.longest();
        let mut compared = false;
        while length >= SHORTEST {
            self.journey(pixel, length, SHARE * tolerance_e);
            if compared && apart(&self.charge_e, &self.coarser_e) <= SHARE * tolerance_e {
                return;
            }
            self.coarser_e.copy_from_slice(&self.charge_e);
            compared = true;
            length /= 2;
        }
        self.journey(pixel, 1, 0.0);
    }

    /// Pixels of a block in which no packet of more than `faint_e` would lose more than half of its charge: beyond that, it would
    /// be taken as spent half-way, and to lose nothing.
    fn enough(&self, change_e: &[Packets], arrived: usize, pixels: i64, faint_e: f64) -> i64 {
        let mut fewest = pixels as f64;
        for (charge_e, change_e) in self.arriving_e.iter().zip(change_e).skip(arrived) {
            for (charge_e, change_e) in charge_e.iter().zip(change_e) {
                if *charge_e > faint_e && *change_e < 0.0 {
                    fewest = fewest.min(-0.5 * charge_e / change_e);
                }
            }
        }
        (fewest as i64).max(1)
    }

    /// All pixels, in blocks of the given length; packets of less than `faint_e` need not be accurate.
    fn journey<P: Passage<Watermarks = L>>(&mut self, pixel: &P, length: i64, faint_e: f64) {
        let downstream = self.downstream() as i64;
        let pixels = self.before_e.len() as i64 + downstream;
        self.charge_e.copy_from_slice(&self.before_e);
        self.arriving_e.copy_from_slice(&self.before_e);
        let mut nearest = 0;
        while nearest < pixels {
            interrupt::check();
            // The first pixel has traps that no packet has passed; a block ends where the first packet ends.
            let end = match nearest {
                0 => 1,
                _ if nearest < downstream => downstream,
                _ => pixels,
            };
            // The effect of packet 0 on the traps varies most in the first pixels: there blocks grow, more slowly in each attempt.
            let longest = if nearest < downstream { (nearest * length / self.longest()).max(1) } else { pixels };
            let mut block = length.min(longest).min(end - nearest);
            let visits = |row: usize, block: i64| (row as i64 + 1 + downstream - nearest).clamp(0, block) as f64;
            self.line_up(nearest as usize);
            if block > 1 {
                let change_e = self.pass(pixel).to_vec();
                let arrived = (nearest - downstream).max(0) as usize;
                block = self.enough(&change_e, arrived, block, faint_e);
                let leads = self.line_up((nearest + (block - 1) / 2) as usize);
                for (row, (row_e, change_e)) in self.row_e[leads..].iter_mut().zip(&change_e).enumerate() {
                    let half_way = 0.5 * (visits(row, block) - 1.0).max(0.0);
                    *row_e = std::array::from_fn(|lane| row_e[lane] + half_way * change_e[lane]);
                }
            }
            let rows = self.charge_e.len();
            let Work { row_e, charge_e, arriving_e, buffers, .. } = self;
            let change_e = changes(pixel, row_e, rows, buffers);
            for (row, (charge_e, change_e)) in charge_e.iter_mut().zip(change_e).enumerate() {
                let visits = visits(row, block);
                if visits > 0.0 {
                    let arrives = row as i64 + 1 + downstream <= nearest + block;
                    *charge_e = std::array::from_fn(|lane| charge_e[lane] + visits * change_e[lane]);
                    let last = if arrives { 1.0 } else { 0.0 };
                    arriving_e[row] = std::array::from_fn(|lane| charge_e[lane] - last * change_e[lane]);
                }
            }
            nearest += block;
            if let Some(first_e) = self.first_e.get(nearest as usize) {
                (self.charge_e[0], self.arriving_e[0]) = (*first_e, *first_e);
            }
        }
    }

    /// Lines up the packets that pass a pixel; returns how many precede those of the column.
    fn line_up(&mut self, place: usize) -> usize {
        let leads = place.min(self.downstream());
        let remembered = leads.min(REMEMBERED);
        self.row_e.clear();
        self.row_e.extend_from_slice(&self.first_e[leads - remembered..leads]);
        self.row_e.extend_from_slice(&self.arriving_e);
        remembered
    }

    /// Change of the column's packets in a pixel, from those lined up, e-.
    fn pass<P: Passage<Watermarks = L>>(&mut self, pixel: &P) -> &[Packets] {
        changes(pixel, &self.row_e, self.charge_e.len(), &mut self.buffers)
    }
}

/// Change of the last `rows` of some packets in a pixel, e-.
fn changes<'a, P: Passage>(
    pixel: &P,
    row_e: &[Packets],
    rows: usize,
    buffers: &'a mut Workspace<P::Watermarks>,
) -> &'a [Packets] {
    let (watermarks, found) = buffers.single(row_e.len());
    pixel.pass(row_e, BlockPath::Unknown, ANY, &EMPTY, watermarks, found);
    &found.change_e[row_e.len() - rows..]
}

/// Largest difference between two sets of packets, e-.
fn apart(some: &[Packets], others: &[Packets]) -> f64 {
    let differences = some.iter().zip(others).flat_map(|(some, others)| some.iter().zip(others));
    differences.fold(0.0, |largest, (some, other)| (some - other).abs().max(largest))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Cloud;

    /// A noisy sky with some sources and a row without charge, from a seed.
    fn image(rows: usize, seed: u64) -> Array2<f64> {
        let mut state = seed;
        let mut chance = move || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64
        };
        Array2::from_shape_fn((rows, 20), |(row, _)| {
            let sky = 40.0 + 20.0 * chance();
            let source = if chance() > 0.98 { 10_f64.powf(2.0 + 2.0 * chance()) } else { 0.0 };
            if row == 7 { 0.0 } else { sky + source }
        })
    }

    #[test]
    fn a_handful_of_passes_gives_what_every_transfer_does() {
        let slow = Trap { capture_transfers: 0.3, ..Trap::new(0.3, 9.0) };
        for (case, traps) in [vec![Trap::new(0.4, 2.0), Trap::new(0.3, 30.0)], vec![slow]].into_iter().enumerate() {
            for (rows, downstream) in [(80, 0), (50, 150), (1, 50), (70, 3)] {
                let image = image(rows, case as u64);
                let readout =
                    Readout { traps: traps.clone(), cloud: Cloud::new(1e5, 0.0, 0.6), method: Method::CarriedTraps };
                let exact = readout.parallel(&image, Downstream { rows: downstream as i64, charge_e: 0.0 });
                let moved_e = (&exact - &image).fold(0.0_f64, |largest, change| change.abs().max(largest));
                for relative in [1e-3, 1e-5, 1e-13] {
                    let found = readout.parallel_carried(&image, downstream, relative);
                    let error_e = (&found - &exact).fold(0.0_f64, |largest, error| error.abs().max(largest));
                    assert!(
                        error_e <= relative.max(1e-10) * moved_e,
                        "{case}, {rows} rows: {error_e} e- of {moved_e} e-"
                    );
                }
            }
        }
    }
}
