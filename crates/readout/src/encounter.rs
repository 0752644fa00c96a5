//! The traps that a packet met in a pixel, as one number: if it changes, there is a kink in between.

/// Distinct for each sequence of marks; the probability of a collision is about 1e-16.
///
/// Marks are mixed by the finaliser of SplitMix64 (Steele et al. 2014).
#[derive(Clone, Copy, Default)]
pub(crate) struct Encounter(u64);

impl Encounter {
    pub fn and(self, mark: u64) -> Encounter {
        let mixed = (self.0 ^ mark).wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mixed = (mixed ^ (mixed >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        Encounter(mixed ^ (mixed >> 31))
    }

    /// Between 0 and 1.
    pub fn number(self) -> f64 {
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn marks_in_another_order_or_by_another_packet_are_something_else() {
        let met = |marks: &[u64]| marks.iter().fold(Encounter::default(), |met, mark| met.and(*mark)).number();
        let sequences: Vec<Vec<u64>> = (0..40).flat_map(|a| (0..40).map(move |b| vec![a, b])).collect();
        let mut numbers: Vec<f64> = sequences.iter().map(|marks| met(marks)).collect();
        numbers.sort_by(f64::total_cmp);
        assert!(numbers.windows(2).all(|pair| pair[0] < pair[1]));
        assert!(met(&[1, 0, 0]) != met(&[1, 0]));
    }
}
