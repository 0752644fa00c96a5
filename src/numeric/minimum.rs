//! Minima of functions of one variable.

/// Position of a minimum between two points, by golden-section search (Kiefer 1953, Proc. Amer. Math. Soc. 4, 502): each step
/// leaves 0.618 of the interval.
pub(crate) fn golden_section([mut low, mut high]: [f64; 2], steps: usize, function: impl Fn(f64) -> f64) -> f64 {
    let share = 0.5 * (5_f64.sqrt() - 1.0);
    for _ in 0..steps {
        let (left, right) = (high - share * (high - low), low + share * (high - low));
        if function(left) < function(right) { high = right } else { low = left }
    }
    0.5 * (low + high)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_minimum_of_a_parabola_is_found() {
        let found = golden_section([-1.0, 5.0], 40, |x| (x - 2.0) * (x - 2.0));
        // Rounding of the values limits the accuracy to the root of the machine precision.
        assert!((found - 2.0).abs() < 1e-7, "{found}");
    }
}
