//! Selection of the galaxies of a catalogue that are fitted or held out: independent of the order of the rows.

use std::collections::BTreeMap;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use sha2::{Digest, Sha256};

use crate::model::shear::SurveyGalaxy;

/// Parts into which the range of each coordinate is divided to cover galaxies of all kinds.
const PARTS: f64 = 4.0;

/// Rows in a random order that depends on their content, not on their position.
pub(super) fn shuffled(galaxies: &[SurveyGalaxy], rows: &[usize], seed: u64) -> Vec<usize> {
    let mut marked: Vec<(u64, [u64; 6], usize)> = rows
        .iter()
        .map(|&row| {
            let galaxy = &galaxies[row];
            let held = [
                u64::from(galaxy.transfers),
                galaxy.flux_e.to_bits(),
                galaxy.half_light_px.to_bits(),
                galaxy.sersic_index.to_bits(),
                galaxy.ellipticity[0].to_bits(),
                galaxy.ellipticity[1].to_bits(),
            ];
            (mark(&held, seed), held, row)
        })
        .collect();
    // Rows that are identical in everything may be in any order.
    marked.sort_unstable_by_key(|(mark, held, _)| (*mark, *held));
    marked.into_iter().map(|(.., row)| row).collect()
}

/// A pseudo-random number.
fn mark(held: &[u64; 6], seed: u64) -> u64 {
    let mut hash = Sha256::new();
    hash.update(seed.to_le_bytes());
    held.iter().for_each(|number| hash.update(number.to_le_bytes()));
    let digest = hash.finalize();
    let mut random = ChaCha8Rng::from_seed(digest.into());
    random.random()
}

/// Reorders rows (given in a random order, with their coordinates between −1 and 1) so that all kinds come early: the least and the
/// largest in each coordinate, one of each cell of a grid, then a second one of each, and so on.
pub(super) fn of_all_kinds<const D: usize>(rows: &[usize], coordinates: &[[f64; D]]) -> Vec<usize> {
    let by = |member: usize| {
        move |a: &usize, b: &usize| coordinates[*a][member].total_cmp(&coordinates[*b][member]).then(b.cmp(a))
    };
    let mut ends: Vec<usize> = (0..D)
        .flat_map(|member| [(0..rows.len()).min_by(by(member)), (0..rows.len()).max_by(by(member))])
        .flatten()
        .collect();
    ends.sort_unstable();
    let mut taken: BTreeMap<[u8; D], usize> = BTreeMap::new();
    let mut order: Vec<(usize, usize)> = Vec::with_capacity(rows.len());
    for (place, coordinates) in coordinates.iter().enumerate() {
        let cell = coordinates.map(|x| (0.5 * (x + 1.0) * PARTS).clamp(0.0, PARTS - 1.0) as u8);
        let before = taken.entry(cell).or_default();
        *before += 1;
        let round = if ends.binary_search(&place).is_ok() { 0 } else { *before };
        order.push((round, place));
    }
    order.sort_unstable();
    order.into_iter().map(|(_, place)| rows[place]).collect()
}
