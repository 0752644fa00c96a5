//! The paper's real traps: whole numbers of them, at random positions and heights, that hold one electron each.
//!
//! Rhodes et al. 2010, section 3. (Its step 6 empties a trap if the decay probability is *less* than the random number; this is
//! inverted, and corrected here.)

use std::ops::Range;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Poisson};

use super::{Cloud, Downstream, Trap, interrupt};

/// One trap of a pixel.
struct Site {
    height: f64,
    /// The index of its species.
    species: usize,
    /// Probability of release until a packet captures, or while it is elsewhere, and as it leaves.
    release: f64,
    returned: f64,
    /// Whether the capture time is finite.
    slow: bool,
    filled: bool,
}

/// Clocks one column out through one random set of traps. `lane` identifies the column of an image, so that each column and each
/// run of pixels has its own traps and its own stream of random numbers. `clouds`: that of each species.
pub(super) fn column(
    traps: &[Trap],
    clouds: &[&Cloud],
    charge_e: &mut [f64],
    downstream: Downstream,
    pixels: Range<i64>,
    (seed, lane): (u64, u64),
) {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    random.set_stream(lane | (pixels.start as u64) << 32);
    let mut pixel_traps = PixelTraps::new(traps, clouds, random);
    for pixel in pixels.rev() {
        interrupt::check();
        pixel_traps.place(pixel, downstream);
        let first = (pixel - downstream.rows).max(0) as usize;
        for charge in &mut charge_e[first..] {
            pixel_traps.pass(charge);
        }
    }
}

/// The traps of one pixel.
struct PixelTraps<'a> {
    traps: &'a [Trap],
    clouds: &'a [&'a Cloud],
    /// Distribution of the number of traps, by species. A Poisson distribution of mean 0 does not exist: None is no trap.
    numbers: Vec<Option<Poisson<f64>>>,
    random: ChaCha8Rng,
    sites: Vec<Site>,
    /// For finite capture times, by species: probability of being filled after a transfer inside a packet's cloud, if empty and if
    /// filled.
    inside: Vec<[f64; 2]>,
    /// Height of the packet's cloud, by species.
    heights: Vec<f64>,
}

impl<'a> PixelTraps<'a> {
    fn new(traps: &'a [Trap], clouds: &'a [&'a Cloud], random: ChaCha8Rng) -> PixelTraps<'a> {
        let numbers = traps.iter().map(|trap| Poisson::new(trap.density_per_px).ok()).collect();
        let inside = traps.iter().zip(clouds).map(|(trap, cloud)| chances(trap, cloud, 0.0)).collect();
        let heights = vec![0.0; clouds.len()];
        PixelTraps { traps, clouds, numbers, random, sites: Vec::new(), inside, heights }
    }

    /// Places the traps of a pixel, filled as packets that passed before row 0 leave them.
    fn place(&mut self, pixel: i64, downstream: Downstream) {
        self.sites.clear();
        for (species, (trap, number)) in self.traps.iter().zip(&self.numbers).enumerate() {
            let cloud = self.clouds[species];
            let filled_before = if pixel < downstream.rows { cloud.height(downstream.charge_e) } else { 0.0 };
            let count = number.map_or(0.0, |number| number.sample(&mut self.random)) as usize;
            let slow = trap.capture_transfers > 0.0;
            // For finite capture times, a line is one step.
            let (release, returned) = if slow { (trap.lost(), 0.0) } else { (trap.released(), trap.returned()) };
            let filled = trap.filled_by(downstream.rows - pixel, cloud, downstream.charge_e);
            let sure = !slow && filled == 1.0;
            for _ in 0..count {
                let height = self.random.random::<f64>();
                let filled = height < filled_before && (sure || self.random.random::<f64>() < filled);
                self.sites.push(Site { height, species, release, returned, slow, filled });
            }
        }
    }

    /// A packet passes: traps release into it, capture from it, and release again before it leaves.
    fn pass(&mut self, charge_e: &mut f64) {
        self.set_heights(*charge_e);
        for (species, trap) in self.traps.iter().enumerate().filter(|(_, trap)| trap.capture_density.is_some()) {
            self.inside[species] = chances(trap, self.clouds[species], *charge_e);
        }
        for site in &mut self.sites {
            if site.slow && site.height < self.heights[site.species] {
                let fills = self.random.random::<f64>() < self.inside[site.species][usize::from(site.filled)];
                if fills && !site.filled && *charge_e >= 1.0 {
                    site.filled = true;
                    *charge_e -= 1.0;
                } else if !fills && site.filled {
                    site.filled = false;
                    *charge_e += 1.0;
                }
            } else if site.filled && self.random.random::<f64>() < site.release {
                site.filled = false;
                *charge_e += 1.0;
            }
        }
        self.set_heights(*charge_e);
        for site in &mut self.sites {
            // Only a whole electron can be captured.
            if !site.slow && !site.filled && site.height < self.heights[site.species] && *charge_e >= 1.0 {
                site.filled = true;
                *charge_e -= 1.0;
            }
        }
        for site in self.sites.iter_mut().filter(|site| site.returned > 0.0 && site.filled) {
            if self.random.random::<f64>() < site.returned {
                site.filled = false;
                *charge_e += 1.0;
            }
        }
    }

    fn set_heights(&mut self, charge_e: f64) {
        for species in 0..self.clouds.len() {
            // Species usually share one cloud.
            let known = species > 0 && std::ptr::eq(self.clouds[species], self.clouds[species - 1]);
            self.heights[species] =
                if known { self.heights[species - 1] } else { self.clouds[species].height(charge_e) };
        }
    }
}

/// Probability of being filled after a transfer inside a packet's cloud, if empty and if filled.
fn chances(trap: &Trap, cloud: &Cloud, charge_e: f64) -> [f64; 2] {
    let (_, full, approach) = trap.passage_of(cloud, charge_e);
    [full * (1.0 - approach), full + (1.0 - full) * approach]
}
