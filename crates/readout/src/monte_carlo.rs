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
    let numbers: Vec<Option<Poisson<f64>>> = traps.iter().map(|trap| Poisson::new(trap.density_per_px).ok()).collect();
    // For finite capture times: probability of being filled after a transfer inside a packet's cloud, if empty and if filled.
    let chances = |species: usize, charge_e: f64| {
        let (_, full, approach) = traps[species].passage_of(clouds[species], charge_e);
        [full * (1.0 - approach), full + (1.0 - full) * approach]
    };
    let mut inside: Vec<[f64; 2]> = (0..traps.len()).map(|species| chances(species, 0.0)).collect();
    let mut sites = Vec::new();
    let mut heights = vec![0.0; clouds.len()];
    // Species usually share one cloud.
    let set_heights = |heights: &mut [f64], charge_e: f64| {
        for species in 0..clouds.len() {
            let known = species > 0 && std::ptr::eq(clouds[species], clouds[species - 1]);
            heights[species] = if known { heights[species - 1] } else { clouds[species].height(charge_e) };
        }
    };
    for pixel in pixels.rev() {
        interrupt::check();
        sites.clear();
        for (species, (trap, number)) in traps.iter().zip(&numbers).enumerate() {
            let filled_before = if pixel < downstream.rows { clouds[species].height(downstream.charge_e) } else { 0.0 };
            // A Poisson distribution of mean 0 does not exist: a species of no density has no traps.
            let count = number.map_or(0.0, |number| number.sample(&mut random)) as usize;
            let slow = trap.capture_transfers > 0.0;
            // For finite capture times, a line is one step.
            let (release, returned) = if slow { (trap.lost(), 0.0) } else { (trap.released(), trap.returned()) };
            let filled = trap.filled_by(downstream.rows - pixel, clouds[species], downstream.charge_e);
            let sure = !slow && filled == 1.0;
            for _ in 0..count {
                let height = random.random::<f64>();
                let filled = height < filled_before && (sure || random.random::<f64>() < filled);
                sites.push(Site { height, species, release, returned, slow, filled });
            }
        }
        let first = (pixel - downstream.rows).max(0) as usize;
        for charge in &mut charge_e[first..] {
            set_heights(&mut heights, *charge);
            for species in (0..traps.len()).filter(|species| traps[*species].capture_density.is_some()) {
                inside[species] = chances(species, *charge);
            }
            for site in &mut sites {
                if site.slow && site.height < heights[site.species] {
                    let fills = random.random::<f64>() < inside[site.species][usize::from(site.filled)];
                    if fills && !site.filled && *charge >= 1.0 {
                        site.filled = true;
                        *charge -= 1.0;
                    } else if !fills && site.filled {
                        site.filled = false;
                        *charge += 1.0;
                    }
                } else if site.filled && random.random::<f64>() < site.release {
                    site.filled = false;
                    *charge += 1.0;
                }
            }
            set_heights(&mut heights, *charge);
            for site in &mut sites {
                // Only a whole electron can be captured.
                if !site.slow && !site.filled && site.height < heights[site.species] && *charge >= 1.0 {
                    site.filled = true;
                    *charge -= 1.0;
                }
            }
            for site in sites.iter_mut().filter(|site| site.returned > 0.0 && site.filled) {
                if random.random::<f64>() < site.returned {
                    site.filled = false;
                    *charge += 1.0;
                }
            }
        }
    }
}
