//! Roots of functions of one variable.

/// Maximum number of steps: bisection alone needs fewer.
const STEPS: usize = 200;

/// Root between two points at which a function has different signs (or is 0), to `tolerance`.
///
/// # Panics
/// If the signs do not differ.
pub(crate) fn between(low: f64, high: f64, tolerance: f64, function: impl Fn(f64) -> f64) -> f64 {
    let ends = [low, high].map(|place| (place, function(place)));
    let found = try_between(ends, tolerance, |place| Ok::<_, std::convert::Infallible>(function(place)));
    found.unwrap_or_else(|never| match never {})
}

/// The same for a function that may fail, given with its values at the two points.
///
/// Brent's method (Brent 1973, Algorithms for Minimization without Derivatives, chapter 4): inverse quadratic interpolation or the
/// secant if they converge, otherwise bisection.
///
/// # Errors
/// Those of the function.
///
/// # Panics
/// If the signs do not differ.
pub(crate) fn try_between<E>(
    [(mut a, mut at_a), (mut b, mut at_b)]: [(f64, f64); 2],
    tolerance: f64,
    function: impl Fn(f64) -> Result<f64, E>,
) -> Result<f64, E> {
    assert!(at_a * at_b <= 0.0, "no change of sign between {a} ({at_a}) and {b} ({at_b})");
    // b is the best point so far, c the one on the other side of the root.
    let (mut c, mut at_c) = (a, at_a);
    let (mut step, mut before_last) = (b - a, b - a);
    for _ in 0..STEPS {
        if at_c.abs() < at_b.abs() {
            (a, at_a) = (b, at_b);
            (b, at_b) = (c, at_c);
            (c, at_c) = (a, at_a);
        }
        let least = 2.0 * f64::EPSILON * b.abs() + 0.5 * tolerance;
        let half = 0.5 * (c - b);
        if half.abs() <= least || at_b == 0.0 {
            break;
        }
        let interpolated = (before_last.abs() >= least && at_a.abs() > at_b.abs())
            .then(|| interpolation((a, at_a), (b, at_b), (c, at_c)))
            .filter(|step| {
                let towards = step * half > 0.0;
                towards && step.abs() < (1.5 * half.abs() - 0.5 * least).min(0.5 * before_last.abs())
            });
        (before_last, step) = match interpolated {
            Some(interpolated) => (step, interpolated),
            None => (half, half),
        };
        (a, at_a) = (b, at_b);
        b += if step.abs() > least { step } else { least.copysign(half) };
        at_b = function(b)?;
        if at_b * at_c > 0.0 {
            (c, at_c) = (a, at_a);
            (step, before_last) = (b - a, b - a);
        }
    }
    Ok(b)
}

/// Step from `b` to the zero of a curve through three points (or a line, if two are the same).
fn interpolation((a, at_a): (f64, f64), (b, at_b): (f64, f64), (c, at_c): (f64, f64)) -> f64 {
    let s = at_b / at_a;
    let (p, q) = if a == c {
        ((c - b) * s, 1.0 - s)
    } else {
        let (q, r) = (at_a / at_c, at_b / at_c);
        (s * ((c - b) * q * (q - r) - (b - a) * (r - 1.0)), (q - 1.0) * (r - 1.0) * (s - 1.0))
    };
    -p / q
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn roots_are_found_to_the_tolerance_in_few_steps() {
        type Case = (fn(f64) -> f64, f64, f64, f64);
        let cases: [Case; 6] = [
            (|x| x * x - 2.0, 0.0, 2.0, 2_f64.sqrt()),
            (|x| x.cos() - x, 0.0, 1.0, 0.739_085_133_215_160_6),
            (|x| x.powi(9), -1.0, 1.5, 0.0),
            (|x| if x < 0.3 { -1.0 } else { 1e6 }, 0.0, 1.0, 0.3),
            (|x| x.exp() - 1e4, -10.0, 30.0, 1e4_f64.ln()),
            (|x| 1.0 - x, 1.0, 3.0, 1.0),
        ];
        for (function, low, high, root) in cases {
            let calls = std::cell::Cell::new(0);
            let counted = |x| {
                calls.set(calls.get() + 1);
                function(x)
            };
            let found = between(low, high, 1e-9, counted);
            let near = (found - root).abs() <= 1e-9 || function(found) == 0.0;
            assert!(near || (root == 0.0 && function(found).abs() < 1e-60), "{found} for {root}");
            assert!(calls.get() < 120, "{} calls for {root}", calls.get());
        }
    }
}
