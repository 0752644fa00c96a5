//! Slow traps that keep charge into the next exposure.
//!
//! A frame is read every cadence T, and leaves traps filled. Charge released before the next exposure begins is swept away. During
//! the exposure traps release to the packet that collects in their own pixel: a ghost. Traps still filled as that frame is read
//! capture nothing.
//!
//! ```text
//!  readout of frame k        swept   exposure of frame k + 1   readout of frame k + 1
//!  │ 0, 1, … rows − 1 lines │  …   │                         │ …
//!  ◀──────────────────────────── T ──────────────────────────▶
//! ```
//!
//! The effect of a pixel on the packets of all frames depends only on the charges with which they arrive. So no state is kept from
//! frame to frame for each pixel: all packets of all frames pass one pixel, then all of them the next one towards the register.
//! Watermarks (see [`super::pixel`]) record the frame and the row of the packet that filled them.
//!
//! Pixels in which packets of the image start are passed one by one. Before the next frame the sky behind the image passes them,
//! and then nothing. Pixels between the image and the register are equal: sky passes them directly before the image, so that traps
//! below its cloud are full, and those above it have released for T. [`Method::Fast`] steps over them.
//!
//! The effect of ghosts on the sky ahead of the image is neglected. Derived for ctiplan; `tests/persistence.rs` compares it with a
//! program that follows every pixel through all frames in time.

use std::mem::take;
use std::ops::Range;

use ndarray::{Array2, Axis, concatenate, s};

use super::bands::Journey;
use super::block_path::BlockPath;
use super::encounter::Encounter;
use super::passage::{Block, Lead, Passage, Stage};
use super::several_clouds::{Watermark, clouds_of, layers, share};
use super::simd::{LANES, Packets};
use super::{Cloud, Course, Method, Readout, Trap, WIDEST, columns, continuum, side_by_side};

/// A detector that is read repeatedly. Times are in units of one transfer.
#[derive(Clone, Debug, PartialEq)]
pub struct Persistence {
    /// How a frame is read; with instantaneous capture and a clock of one phase.
    pub readout: Readout,
    /// Number of earlier frames.
    pub frames: u32,
    /// Whether these contain the same image; otherwise only sky.
    pub same_scene: bool,
    /// Rows of a frame.
    pub rows: u32,
    /// Time from the first line of a readout to the next exposure; at least as long as a readout.
    pub dead_transfers: f64,
    /// The exposure time.
    pub exposure_transfers: f64,
}

impl Persistence {
    /// Number of earlier frames that are read. Each frame of sky leaves the same state, whatever preceded it.
    fn frames_read(&self) -> u32 {
        if self.same_scene { self.frames } else { self.frames.min(1) }
    }

    /// Reads an image after the frames before it, like [`Readout::parallel_after_each`]: `charge_e[column]` lies in `rows` rows
    /// between the image and the register, and in all rows behind the image.
    ///
    /// # Panics
    /// As [`Readout::parallel_after_each`]; for methods other than [`Method::Exact`] and [`Method::Fast`]; for traps with finite
    /// capture times or that return charge.
    pub fn parallel_after_each(&self, image: &Array2<f64>, rows: i64, charge_e: &[f64]) -> Array2<f64> {
        assert_eq!(charge_e.len(), image.ncols(), "one background for each column");
        let traps: Vec<Trap> = self.readout.traps.iter().filter(|trap| trap.density_per_px > 0.0).copied().collect();
        if image.is_empty() || traps.is_empty() {
            return image.clone();
        }
        let refused = |trap: &Trap| trap.capture_transfers > 0.0 || trap.returns();
        assert!(!traps.iter().any(refused), "persistence is modelled for capture at once, in a clock of one phase");
        let sky = Array2::from_shape_fn(image.raw_dim(), |(_, column)| charge_e[column]);
        let before = if self.same_scene { image } else { &sky };
        let frames: Vec<_> = (0..self.frames_read()).map(|_| before.view()).chain([image.view()]).collect();
        let frames_e = concatenate(Axis(0), &frames).expect("frames of one shape");
        let traps = continuum::resolved(&traps, WIDEST, continuum::error_of(self.readout.method));
        let pixel = PersistentPixel::new(self, &traps, image.nrows(), rows);
        let settled_e: Vec<f64> = charge_e.iter().map(|charge_e| self.readout.settled_e(*charge_e)).collect();
        let shared = rows.max(0);
        let read_e = match self.readout.method {
            Method::Exact => columns(&frames_e, Axis(1), &|charge_e, column| {
                let sky_e = settled_e[column as usize];
                pixel.where_packets_start(charge_e, sky_e);
                (0..shared).for_each(|_| pixel.one(None, charge_e, sky_e));
            }),
            Method::Fast { relative } => {
                let started_e = columns(&frames_e, Axis(1), &|charge_e, column| {
                    pixel.where_packets_start(charge_e, settled_e[column as usize]);
                });
                let journey = Journey::passed_by_all(1, shared);
                match shared {
                    0 => started_e,
                    _ => side_by_side(&pixel, &started_e, journey, &settled_e, Axis(1), Course::InSteps { relative }),
                }
            }
            _ => panic!("persistence is modelled by every transfer or in a handful of passes"),
        };
        read_e.slice(s![read_e.nrows() - image.nrows().., ..]).to_owned()
    }
}

/// The traps of one pixel, and the frames whose packets pass it.
struct PersistentPixel {
    traps: Vec<Trap>,
    clouds: Vec<Cloud>,
    /// The index of the cloud of each species.
    cloud_of: Vec<usize>,
    /// exp(−t/τ) of each species; t in cadences (first index) and rows (second index, from minus all rows of the image on).
    left: Vec<Vec<Vec<f64>>>,
    /// Fraction of the filled traps of each species that release in a line, and in an exposure.
    released: [Vec<f64>; 2],
    frames: usize,
    /// Rows of the image in each of them.
    rows: usize,
    /// Rows downstream; negative if the image reaches past the register.
    rows_downstream: i64,
    /// The last row of the frame, counted from the first row of the image.
    last_row: i64,
    exposure: f64,
    /// Time from one readout to the next.
    cadence: f64,
}

/// When a packet passes: its frame, and its row of the image.
#[derive(Clone, Copy)]
struct Time {
    frame: usize,
    row: i64,
}

/// Watermarks of every cloud, the highest first, and electrons in the traps of every species.
#[derive(Clone, Default)]
struct Stacks {
    watermarks: Vec<Vec<Watermark<Time>>>,
    stored_e: Vec<f64>,
    /// Heights of a packet's clouds, and its captured charge for each species, e-.
    heights: Vec<f64>,
    captured_e: Vec<f64>,
}

impl PersistentPixel {
    fn new(of: &Persistence, traps: &[Trap], rows: usize, rows_downstream: i64) -> PersistentPixel {
        let (clouds, cloud_of) = clouds_of(traps, &of.readout.cloud);
        // The image is part of the frame.
        let last_row = (i64::from(of.rows) - 1 - rows_downstream).max(rows as i64 - 1);
        let readout = (last_row + 1 + rows_downstream) as f64;
        let cadence = of.dead_transfers.max(readout) + of.exposure_transfers;
        let after = |frames: u32, lines: i64| {
            let lines = f64::from(frames) * cadence + lines as f64;
            traps.iter().map(|trap| (-lines / trap.release_transfers).exp()).collect()
        };
        let most = rows as i64 + 1;
        let after_frames = |frames: u32| (-most..=most).map(|lines| after(frames, lines)).collect();
        PersistentPixel {
            traps: traps.to_vec(),
            clouds,
            cloud_of,
            left: (0..=of.frames_read()).map(after_frames).collect(),
            released: [1.0, of.exposure_transfers]
                .map(|lines| traps.iter().map(|trap| -(-lines / trap.release_transfers).exp_m1()).collect()),
            frames: of.frames_read() as usize + 1,
            rows,
            rows_downstream,
            last_row,
            exposure: of.exposure_transfers,
            cadence,
        }
    }

    /// All pixels in which packets of the image start, the farthest first.
    fn where_packets_start(&self, charge_e: &mut [f64], sky_e: f64) {
        let nearest = (-self.rows_downstream).clamp(0, self.rows as i64) as usize;
        (nearest..self.rows).rev().for_each(|home| self.one(Some(home), charge_e, sky_e));
    }

    /// One pixel: that in which the packet of row `home` starts, or one between the image and the register.
    fn one(&self, home: Option<usize>, charge_e: &mut [f64], sky_e: f64) {
        super::interrupt::check();
        let arriving_e = charge_e.to_vec();
        self.each_packet(home, &arriving_e, sky_e, &mut Stacks::default(), |place, change_e, _| {
            charge_e[place] += change_e;
        });
    }

    /// Passes the packets of all frames (e-) over a pixel; reports the change of each, e-, and the watermarks it met as one number.
    fn each_packet(
        &self,
        home: Option<usize>,
        charge_e: &[f64],
        sky_e: f64,
        stacks: &mut Stacks,
        mut found: impl FnMut(usize, f64, f64),
    ) {
        stacks.watermarks.resize_with(self.clouds.len(), Vec::new);
        stacks.watermarks.iter_mut().for_each(Vec::clear);
        stacks.stored_e.clear();
        stacks.stored_e.resize(self.traps.len(), 0.0);
        for frame in 0..self.frames {
            let first = home.unwrap_or(0);
            match home {
                None => self.cover(stacks, sky_e, Time { frame, row: -1 }),
                Some(row) if frame > 0 => self.until_exposed(stacks, sky_e, Time { frame, row: row as i64 }),
                Some(_) => {}
            }
            for row in first..self.rows {
                let place = frame * self.rows + row;
                let exposed = home == Some(row);
                let (change_e, met) = self.packet(stacks, charge_e[place], Time { frame, row: row as i64 }, exposed);
                found(place, change_e, met);
            }
        }
    }

    /// Fraction of the filled traps of a species that remain filled from one time to another.
    fn left(&self, species: usize, from: Time, to: Time) -> f64 {
        let place = to.row - from.row + self.rows as i64 + 1;
        match self.left[to.frame - from.frame].get(place as usize) {
            Some(left) => left[species],
            None => (-self.lines(from, to) / self.traps[species].release_transfers).exp(),
        }
    }

    /// Time between two times, in lines.
    fn lines(&self, from: Time, to: Time) -> f64 {
        (to.frame - from.frame) as f64 * self.cadence + (to.row - from.row) as f64
    }

    /// Sky has just filled all traps within its reach.
    fn cover(&self, stacks: &mut Stacks, sky_e: f64, now: Time) {
        for (watermarks, cloud) in stacks.watermarks.iter_mut().zip(&self.clouds) {
            fill(watermarks, cloud.height(sky_e), now);
        }
        self.count(stacks, now, 0.0);
    }

    /// State of the traps when the exposure begins of the packet that starts in this pixel: sky behind the image has passed it, its
    /// last packet after all others.
    fn until_exposed(&self, stacks: &mut Stacks, sky_e: f64, start: Time) {
        if self.last_row >= self.rows as i64 {
            for (watermarks, cloud) in stacks.watermarks.iter_mut().zip(&self.clouds) {
                fill(watermarks, cloud.height(sky_e), Time { frame: start.frame - 1, row: self.last_row });
            }
        }
        self.count(stacks, start, self.exposure);
    }

    /// Counts the electrons in the traps, `before` lines before a time.
    fn count(&self, stacks: &mut Stacks, now: Time, before: f64) {
        for (s, stored_e) in stacks.stored_e.iter_mut().enumerate() {
            let mut floor = 0.0;
            *stored_e = 0.0;
            for watermark in stacks.watermarks[self.cloud_of[s]].iter().rev() {
                let traps = self.traps[s].density_per_px * (watermark.height - floor);
                let lines = self.lines(watermark.filled, now) - before;
                *stored_e += traps * (-lines / self.traps[s].release_transfers).exp();
                floor = watermark.height;
            }
        }
    }

    /// Passes a packet, which is exposed in this pixel or follows the previous one; returns its change (e-), and what it met.
    fn packet(&self, stacks: &mut Stacks, charge_e: f64, now: Time, exposed: bool) -> (f64, f64) {
        let mut present_e = charge_e;
        for (s, stored_e) in stacks.stored_e.iter_mut().enumerate() {
            let out_e = *stored_e * self.released[usize::from(exposed)][s];
            *stored_e -= out_e;
            present_e += out_e;
        }
        let (mut heights, mut captured_e) = (take(&mut stacks.heights), take(&mut stacks.captured_e));
        heights.clear();
        heights.extend(self.clouds.iter().map(|cloud| cloud.height(present_e)));
        let mut wanted_e = self.wanted_e(stacks, &heights, now, &mut captured_e);
        // A packet cannot give more charge than it has: it fills every cloud to the same share.
        let spent = wanted_e > present_e;
        if spent {
            let at = |heights: &[f64]| self.wanted_e(stacks, heights, now, &mut Vec::new());
            let share = share(&stacks.watermarks, &heights, present_e.max(0.0), at);
            heights.iter_mut().for_each(|height| *height *= share);
            self.wanted_e(stacks, &heights, now, &mut captured_e);
            wanted_e = present_e.max(0.0);
        }
        let mut met = Encounter::default().and(u64::from(spent));
        stacks.stored_e.iter_mut().zip(&captured_e).for_each(|(stored_e, captured_e)| *stored_e += captured_e);
        for (cloud, &height) in heights.iter().enumerate() {
            fill(&mut stacks.watermarks[cloud], height, now);
            let below = stacks.watermarks[cloud].iter().rev().nth(1);
            let number = |filled: Time| (filled.frame * (self.rows + 2)) as u64 + (filled.row + 2) as u64;
            met = met.and(below.map_or(0, |mark| number(mark.filled)));
        }
        (stacks.heights, stacks.captured_e) = (heights, captured_e);
        (present_e - wanted_e - charge_e, met.number())
    }

    /// Empty traps of a species, per pixel, where they were last filled at a given time, or never.
    fn empty(&self, species: usize, filled: Option<Time>, now: Time) -> f64 {
        self.traps[species].density_per_px * (1.0 - filled.map_or(0.0, |filled| self.left(species, filled, now)))
    }

    /// Charge that the empty traps below some heights would capture, e-, and that of each species.
    fn wanted_e(&self, stacks: &Stacks, heights: &[f64], now: Time, of_species: &mut Vec<f64>) -> f64 {
        of_species.clear();
        of_species.resize(self.traps.len(), 0.0);
        for (cloud, (watermarks, height)) in stacks.watermarks.iter().zip(heights).enumerate() {
            layers(watermarks, *height, |thickness, filled| {
                for s in (0..self.traps.len()).filter(|s| self.cloud_of[*s] == cloud) {
                    of_species[s] += thickness * self.empty(s, filled, now);
                }
            });
        }
        of_species.iter().sum()
    }
}

/// Traps below a height are filled at this time.
fn fill(watermarks: &mut Vec<Watermark<Time>>, height: f64, filled: Time) {
    while watermarks.last().is_some_and(|watermark| watermark.height <= height) {
        watermarks.pop();
    }
    watermarks.push(Watermark { height, filled });
}

/// For the pixels between the image and the register, which are equal. Rows are those of all frames.
impl Passage for PersistentPixel {
    type Watermarks = (Stacks, Vec<f64>);

    fn pass(
        &self,
        charge_e: &[Packets],
        _: BlockPath,
        block: Block,
        downstream: &Lead,
        (stacks, column_e): &mut (Stacks, Vec<f64>),
        found: &mut Stage,
    ) {
        let Stage { change_e, drift_e, doubtful_e, meets } = found;
        doubtful_e.fill([0.0; LANES]);
        for lane in 0..LANES {
            // Lanes without a column of their own repeat the last one.
            let repeats = |row: &Packets| lane > 0 && row[lane] == row[lane - 1];
            if charge_e.iter().chain([&downstream.charge_e]).all(repeats) {
                change_e.iter_mut().chain(meets.iter_mut()).for_each(|row| row[lane] = row[lane - 1]);
                continue;
            }
            column_e.clear();
            column_e.extend(charge_e.iter().map(|row| row[lane]));
            self.each_packet(None, column_e, downstream.charge_e[lane], stacks, |place, change, met| {
                change_e[place][lane] = block.pixels as f64 * change;
                meets[place][lane] = met;
            });
        }
        drift_e.copy_from_slice(change_e);
    }

    fn density(&self) -> f64 {
        self.traps.iter().map(|trap| trap.density_per_px).sum()
    }

    fn clouds(&self) -> &[Cloud] {
        &self.clouds
    }

    fn knows_paths(&self) -> bool {
        false
    }

    fn alike_pixels(&self, pixel: i64, downstream: &Lead) -> Range<i64> {
        if pixel < downstream.rows { i64::MIN..downstream.rows } else { pixel..pixel + 1 }
    }
}
