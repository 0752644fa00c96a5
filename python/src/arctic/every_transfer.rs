//! Columns transfer by transfer, for the settings of ArCTIc that the readout of ctiplan has not.
//!
//! A pixel's traps are kept in layers of the volume V of the well, from the bottom up; below the newest cloud all are full. Traps
//! may be exposed to the charge only in a part of the volume (see [`Species::exposed`]), and each column may find the traps as the
//! column before has left them. Found by running arcticpy 2.6 on frames of a few pixels; see `docs/arctic.md`.

use ctiplan::readout::{Cloud, interrupt};

/// Traps of one release time that capture at once.
#[derive(Clone, Copy, Debug)]
pub struct Species {
    /// Traps per pixel.
    pub density_per_px: f64,
    /// Release time constant, in transfers.
    pub release_transfers: f64,
    /// Volumes (of the full well) below which no trap is exposed, and above which all are.
    pub none_exposed: f64,
    pub full_exposed: f64,
}

impl Species {
    /// Fraction of the traps below a volume V: their density grows evenly from none to full exposure, and is constant above.
    fn exposed(&self, volume: f64) -> f64 {
        let (none, full) = (self.none_exposed, self.full_exposed);
        let all = 0.5 * (full - none) + 1.0 - full;
        let rising = if full > none { (volume.min(full) - none).max(0.0).powi(2) / (2.0 * (full - none)) } else { 0.0 };
        if all > 0.0 { (rising + (volume - full).max(0.0)) / all } else { f64::from(volume >= 1.0) }
    }
}

/// Which pixels a packet passes, and the traps that the first packet finds there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Transfers {
    /// Those between its own and the register. Traps of a pixel are empty when its first packet comes.
    Empty,
    /// The same pixels. The first packet finds the traps as it has left them in the pixel before.
    Carried,
    /// This number of pixels, the same for all packets: charge is injected behind them. Traps of a pixel are empty when its first
    /// packet comes.
    Injected(usize),
}

/// What happens at the ends of columns and of the frame.
#[derive(Clone, Copy, Debug)]
pub struct Order {
    /// Pixels between row 0 and the register.
    pub offset: usize,
    /// Most transfers that a packet makes among traps: there are none in the pixels beyond. Without: all.
    pub pixels: Option<usize>,
    /// The first packet that takes part. Those before it hold no charge, and leave the traps as they are.
    pub first: usize,
    pub transfers: Transfers,
    /// Traps are empty when a column begins; else they are as the column before has left them.
    pub empty_between: bool,
}

/// Layers of traps, from the bottom up.
#[derive(Clone, Default)]
struct State {
    tops: Vec<f64>,
    /// Filled fractions, species by species for each layer.
    fills: Vec<f64>,
}

/// Reads columns out, one after another. Each is a list of packets (e-), packet 0 nearest the register.
pub fn columns(columns: &mut [Vec<f64>], species: &[Species], cloud: &Cloud, order: Order) {
    let pixel = Pixel::new(species, cloud);
    let mut left = State::default();
    for charge_e in columns {
        let start = if order.empty_between { State::default() } else { std::mem::take(&mut left) };
        left = match order.transfers {
            Transfers::Empty => pixel.empty_for_first(charge_e, start, order),
            Transfers::Carried => pixel.carried(charge_e, start, order),
            Transfers::Injected(pixels) => pixel.injected(charge_e, start, order, pixels),
        };
    }
}

struct Pixel<'a> {
    species: &'a [Species],
    cloud: &'a Cloud,
    /// 1 − exp(−1/τ)
    released: Vec<f64>,
}

impl<'a> Pixel<'a> {
    fn new(species: &'a [Species], cloud: &'a Cloud) -> Pixel<'a> {
        let released = species.iter().map(|species| -(-1.0 / species.release_transfers).exp_m1()).collect();
        Pixel { species, cloud, released }
    }

    /// Pixels from the farthest on, each of which starts alike. Gives the traps of the last. Of more than `order.pixels` transfers,
    /// ArCTIc lets a packet make the first ones only.
    fn empty_for_first(&self, charge_e: &mut [f64], start: State, order: Order) -> State {
        let rows = charge_e.len();
        let most = order.pixels.unwrap_or(rows + order.offset);
        let mut state = start.clone();
        for place in (0..rows + order.offset).rev() {
            interrupt::check();
            state.clone_from(&start);
            let first = place.saturating_sub(order.offset).max(order.first).min(rows);
            let end = (place + most).saturating_sub(order.offset).clamp(first, rows);
            for packet_e in &mut charge_e[first..end] {
                self.packet(&mut state, packet_e);
            }
        }
        state
    }

    /// Pixels from the nearest on, each of which starts as the first packet has left the one before. Gives the traps of the last one.
    fn carried(&self, charge_e: &mut [f64], mut start: State, order: Order) -> State {
        let pixels = charge_e.len() + order.offset;
        let mut state = start.clone();
        for place in 0..order.pixels.map_or(pixels, |limit| limit.min(pixels)) {
            interrupt::check();
            let nearest = place.saturating_sub(order.offset);
            if nearest >= order.first {
                self.packet(&mut start, &mut charge_e[nearest]);
            }
            state.clone_from(&start);
            for packet_e in &mut charge_e[order.first.max(nearest + 1)..] {
                self.packet(&mut state, packet_e);
            }
        }
        state
    }

    /// Pixels that all packets pass, each of which starts alike. Gives the traps of the last.
    fn injected(&self, charge_e: &mut [f64], start: State, order: Order, pixels: usize) -> State {
        let first = order.first.min(charge_e.len());
        let mut state = start.clone();
        for _ in 0..order.pixels.map_or(pixels, |limit| limit.min(pixels)) {
            interrupt::check();
            state.clone_from(&start);
            for packet_e in &mut charge_e[first..] {
                self.packet(&mut state, packet_e);
            }
        }
        state
    }

    /// One packet passes.
    fn packet(&self, state: &mut State, packet_e: &mut f64) {
        let count = self.species.len();
        let mut floor = 0.0;
        for (top, fills) in state.tops.iter().zip(state.fills.chunks_mut(count)) {
            for ((species, released), fill) in self.species.iter().zip(&self.released).zip(fills) {
                let out = *fill * released;
                *fill -= out;
                *packet_e += out * self.traps(species, floor, *top);
            }
            floor = *top;
        }
        let volume = self.cloud.height(*packet_e);
        if volume <= 0.0 {
            return;
        }
        let wanted_e = self.wanted_e(state, volume);
        // A packet cannot give more than it has: then all traps in its reach get the same share of what they want.
        let share = if wanted_e > *packet_e { *packet_e / wanted_e } else { 1.0 };
        *packet_e -= share * wanted_e;
        self.fill(state, volume, share);
    }

    /// Traps of a species between two volumes.
    fn traps(&self, species: &Species, floor: f64, top: f64) -> f64 {
        if species.full_exposed == 0.0 {
            return species.density_per_px * (top - floor);
        }
        species.density_per_px * (species.exposed(top) - species.exposed(floor))
    }

    /// Charge that the empty traps below a volume would take, e-.
    fn wanted_e(&self, state: &State, volume: f64) -> f64 {
        let (mut wanted_e, mut floor) = (0.0, 0.0);
        for (top, fills) in state.tops.iter().zip(state.fills.chunks(self.species.len())) {
            if floor >= volume {
                return wanted_e;
            }
            // Packets that gave all they had may have left layers of no thickness.
            let top = top.min(volume);
            for (species, fill) in self.species.iter().zip(fills) {
                wanted_e += (1.0 - fill) * self.traps(species, floor, top);
            }
            floor = top;
        }
        if volume > floor {
            wanted_e += self.species.iter().map(|species| self.traps(species, floor, volume)).sum::<f64>();
        }
        wanted_e
    }

    /// Fills a share of the empty traps below a volume.
    fn fill(&self, state: &mut State, volume: f64, share: f64) {
        let count = self.species.len();
        let below = state.tops.partition_point(|top| *top <= volume);
        if share < 1.0 {
            let part = state.fills.get(below * count..(below + 1) * count).map_or(vec![0.0; count], <[f64]>::to_vec);
            state.tops.insert(below, volume);
            state.fills.splice(below * count..below * count, part);
            state.fills[..(below + 1) * count].iter_mut().for_each(|fill| *fill += share * (1.0 - *fill));
            return;
        }
        state.tops.splice(..below, [volume]);
        state.fills.splice(..below * count, std::iter::repeat_n(1.0, count));
    }
}
