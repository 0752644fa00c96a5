//! Waves that are equal at evenly spaced times.
//!
//! At times t₀ + mΔ a cosine of frequency f has the values of those of |k/Δ ± f|, k = 0, 1, 2, … (Shannon 1949, Proc. IRE 37, 10):
//! from such times alone no period can be distinguished from its aliases, of which the longest is at least 2Δ.

/// Share of the spacing by which times may deviate from even spacing.
const EVEN: f64 = 0.02;

/// Fewest times that show an even spacing.
const FEWEST: usize = 4;

/// Multiples of 1/Δ that are listed.
const MULTIPLES: u32 = 8;

/// Spacing of evenly spaced times (ascending, distinct), some of which may be missing; None if they are not.
pub fn even_spacing(times: &[f64]) -> Option<f64> {
    if times.len() < FEWEST {
        return None;
    }
    let least = times.windows(2).map(|pair| pair[1] - pair[0]).fold(f64::INFINITY, f64::min);
    let span = times[times.len() - 1] - times[0];
    let spacing = span / (span / least).round();
    let is_even = |time: &f64| {
        let places = (time - times[0]) / spacing;
        (places - places.round()).abs() <= EVEN
    };
    (least > 0.0 && times.iter().all(is_even)).then_some(spacing)
}

/// A wave: its period, and a time of a maximum.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wave {
    /// Period, in the unit of the times.
    pub period: f64,
    /// Time of a maximum.
    pub maximum: f64,
}

impl Wave {
    /// Other waves with the same values at times `first` + m `spacing`, the longest period first.
    pub fn aliases(self, first: f64, spacing: f64) -> Vec<Wave> {
        let frequency = 1.0 / self.period;
        // Turns from the maximum to the first time, which each alias has as well, in one direction or the other.
        let turns = frequency * (first - self.maximum);
        let alias = |multiple: u32, sign: f64| {
            let other = f64::from(multiple) / spacing + sign * frequency;
            let turns = sign * turns * other.signum();
            Wave { period: 1.0 / other.abs(), maximum: first - turns / other.abs() }
        };
        let mut all: Vec<Wave> =
            (1..=MULTIPLES).flat_map(|multiple| [alias(multiple, -1.0), alias(multiple, 1.0)]).collect();
        all.retain(|wave| wave.period.is_finite() && (wave.period / self.period - 1.0).abs() > 1e-9);
        all.sort_by(|a, b| b.period.total_cmp(&a.period));
        all
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn value(wave: Wave, time: f64) -> f64 {
        (std::f64::consts::TAU * (time - wave.maximum) / wave.period).cos()
    }

    #[test]
    fn aliases_have_the_same_values_at_all_times() {
        for (period, spacing) in [(1.75, 0.636), (0.389, 0.636), (11.0, 3.0), (0.31, 1.0)] {
            let wave = Wave { period, maximum: 0.27 };
            let aliases = wave.aliases(0.5, spacing);
            assert!(aliases.len() >= 15 && aliases.windows(2).all(|pair| pair[0].period >= pair[1].period));
            for alias in aliases {
                for place in 0..20 {
                    let time = 0.5 + f64::from(place) * spacing;
                    assert!((value(alias, time) - value(wave, time)).abs() < 1e-9, "{wave:?} {alias:?} {time}");
                }
            }
        }
    }

    #[test]
    fn gaps_leave_a_spacing_even_and_shifts_do_not() {
        let even = [0.5, 1.5, 2.5, 5.5, 6.5];
        assert!((even_spacing(&even).unwrap() - 1.0).abs() < 1e-12);
        assert_eq!(even_spacing(&[0.5, 1.5, 2.6, 5.5, 6.5]), None);
        assert_eq!(even_spacing(&even[..3]), None);
    }
}
