//! Trails into empty wells of which any charge fills a part: packets of a hundredth of an electron gain and lose charge smoothly.

use ctiplan_readout::{Cloud, Method, Readout, Trap};
use ndarray::Array2;

/// 100 pixels behind a lone packet, for wells from hardly to nearly filled by any charge. A fast release (0.5 transfers) makes the
/// tail exchange far more charge with the traps in each pixel than it holds.
#[test]
fn trails_into_empty_wells_have_the_requested_accuracy() {
    let traps = vec![Trap::new(0.35, 10.0), Trap::new(0.49, 0.486), Trap::new(0.16, 500.0)];
    for signal_e in [300.0, 1580.0, 20_000.0] {
        for volume_at_zero in [1e-3, 0.06, 0.3, 0.8] {
            let cloud = Cloud::new(161_000.0, 0.0, 0.5).with_volume_at_zero(volume_at_zero);
            let mut image = Array2::zeros((101, 1));
            image[[0, 0]] = signal_e;
            let read = |method| {
                let readout = Readout { traps: traps.clone(), cloud: cloud.clone(), method };
                readout.parallel_after_each(&image, 400, &[0.0])
            };
            let exact = read(Method::Exact);
            let size = |difference: Array2<f64>| difference.mapv(|e| e * e).sum().sqrt();
            for relative in [1e-3, 1e-5] {
                let off = size(&read(Method::Fast { relative }) - &exact) / size(&exact - &image);
                assert!(off < relative, "{signal_e} e-, {volume_at_zero}, {relative}: {off:e}");
            }
        }
    }
}
