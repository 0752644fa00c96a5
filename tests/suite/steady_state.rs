//! Starting with the traps as the background has left them changes nothing against starting at the register.

use ctiplan::physics::galaxy::Profile;
use ctiplan::physics::shape::{Moments, ShapeChange};
use ctiplan::readout::{Cloud, Downstream, Method, Readout, Trap};
use ndarray::{Array2, s};

#[test]
fn starting_upstream_in_the_steady_state_changes_nothing() {
    let trap = |density_per_px, release_transfers| Trap::new(density_per_px, release_transfers);
    let half = 27;
    let profile = Profile::new(4.0, 0.45, 0.0, 2.91, 3.5);
    let galaxy = 1150.0 * profile.stamp(half, 0.125, -0.375);
    let before = Moments::of(&galaxy, 5.4).unwrap();
    // What is left out is the slice of traps between the background before and after its first pixel, which fresh packets
    // fill: second order in the density, so 1e-5 at mission doses and up to 1e-3 at twenty times those.
    for (years, background_e, transfers, tolerance) in
        [(5.0, 120.0, 600, 2e-5), (5.0, 10.0, 400, 2e-5), (110.0, 120.0, 600, 1e-3)]
    {
        let readout = Readout {
            traps: [trap(0.35, 10.0), trap(0.49, 0.486), trap(0.7, 200.0)]
                .map(|t| trap(t.density_per_px * years / 110.0, t.release_transfers))
                .to_vec(),
            cloud: Cloud::new(161_000.0, 0.0, 0.5),
            method: Method::Exact,
        };
        let downstream_rows = transfers - 1 - half;
        let change = |readout: &Readout, rows_before: usize, downstream: Downstream| {
            let mut with_galaxy = Array2::from_elem((rows_before + galaxy.nrows(), galaxy.ncols()), background_e);
            let background = with_galaxy.clone();
            let mut stamp = with_galaxy.slice_mut(s![rows_before.., ..]);
            stamp += &galaxy;
            let trailed = readout.parallel(&with_galaxy, downstream) - readout.parallel(&background, downstream);
            let after = Moments::of(&trailed.slice(s![rows_before.., ..]).to_owned(), 5.4).unwrap();
            ShapeChange::between(&before, &after)
        };
        let from_register = change(&readout, downstream_rows, Downstream::NONE);
        let steady = Downstream { rows: downstream_rows as i64, charge_e: background_e };
        let from_steady = change(&readout, 0, steady);
        for (what, a, b) in [
            ("delta_e1", from_register.delta_e1, from_steady.delta_e1),
            ("delta_y_px", from_register.delta_y_px, from_steady.delta_y_px),
            ("delta_size", from_register.delta_size, from_steady.delta_size),
            ("delta_flux", from_register.delta_flux, from_steady.delta_flux),
        ] {
            assert!((b / a - 1.0).abs() < tolerance, "{years} yr, {background_e} e-: {what} {a} {b}");
        }
    }
}
