//! Sums of events → probability that a mission with as many active years has a smaller one.

/// Numbers of active years at which sums are ranked; linear interpolation in between.
const NODES: usize = 17;

/// Active years, ascending, at which samples with these are ranked: one if all have the same, none if none has any.
pub(super) fn nodes(years: &[f64]) -> Vec<f64> {
    let active = || years.iter().copied().filter(|years| *years > 0.0);
    let (least, most) = (active().fold(f64::INFINITY, f64::min), active().fold(0.0, f64::max));
    if most <= 0.0 {
        return Vec::new();
    }
    if most - least < 1e-9 {
        return vec![most];
    }
    (0..NODES).map(|node| least + (most - least) * node as f64 / (NODES - 1) as f64).collect()
}

/// Sums of all samples after each of some numbers of active years.
pub(super) struct Ranks {
    /// Active years, and the sorted sums.
    nodes: Vec<(f64, Vec<f64>)>,
}

impl Ranks {
    /// From the sums of each sample after each number of active years.
    pub(super) fn of(years: &[f64], sums: &[Vec<f64>]) -> Ranks {
        let sorted = |(node, years): (usize, &f64)| {
            let mut sums: Vec<f64> = sums.iter().map(|sample| sample[node]).collect();
            sums.sort_by(f64::total_cmp);
            (*years, sums)
        };
        Ranks { nodes: years.iter().enumerate().map(sorted).collect() }
    }

    /// Probability that a mission with this number of active years has a smaller sum, (r + ½)/n.
    pub(super) fn of_sum(&self, years: f64, sum: f64) -> f64 {
        let Some(last) = self.nodes.len().checked_sub(1) else { return 0.5 };
        let after = self.nodes.partition_point(|node| node.0 <= years).min(last);
        let before = after.saturating_sub(1);
        let ((from, low), (to, high)) = (&self.nodes[before], &self.nodes[after]);
        let share = if after == before { 0.0 } else { ((years - from) / (to - from)).clamp(0.0, 1.0) };
        let n = low.len() as f64;
        ((1.0 - share) * rank(low, sum) + share * rank(high, sum)).clamp(0.5 / n, 1.0 - 0.5 / n)
    }
}

/// Fraction of sorted numbers that are smaller, plus half of those that are equal.
fn rank(sorted: &[f64], number: f64) -> f64 {
    let smaller = sorted.partition_point(|other| *other < number);
    let not_larger = sorted.partition_point(|other| *other <= number);
    0.5 * (smaller + not_larger) as f64 / sorted.len() as f64
}
