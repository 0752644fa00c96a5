//! Roots of functions of one variable, by Brent's method.

use argmin::core::{CostFunction, Error, Executor, State};
use argmin::solver::brent::BrentRoot;

/// Root between two places at which a function has different signs (or is 0), to `tolerance`.
///
/// # Panics
/// Where the signs do not differ.
pub(crate) fn between(low: f64, high: f64, tolerance: f64, function: impl Fn(f64) -> f64) -> f64 {
    struct Problem<F>(F);
    impl<F: Fn(f64) -> f64> CostFunction for Problem<F> {
        type Param = f64;
        type Output = f64;
        fn cost(&self, place: &f64) -> Result<f64, Error> {
            Ok((self.0)(*place))
        }
    }
    let solved = Executor::new(Problem(function), BrentRoot::new(low, high, 2.0 * tolerance))
        .configure(|state| state.max_iters(200))
        .run()
        .expect("a change of sign");
    *solved.state().get_best_param().expect("a root between two places")
}
