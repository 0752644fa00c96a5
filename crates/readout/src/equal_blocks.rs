//! The journey in equal blocks of pixels, from the light to the register or in reverse.
//!
//! What a packet loses in one pixel is tiny, so the charges after each pixel follow a difference equation with a smooth change δ
//! (see [`super::multirevolution`]). It can be followed towards the light as easily as towards the register: from the charges n on
//! one side of a block of N pixels, those on the other side are
//!
//! ```text
//! first order    n ± N δ(n)
//! second order   n ± N δ(n ± c N δ(n)),   c = (1 ∓ 1/N)/2, the mean place of the N pixels as seen from that side
//! ```
//!
//! which is the midpoint rule, for N transfers (upper signs) or −N (lower signs, from the register to the light). Within the image,
//! where packets start in different pixels, the charges that are held fixed are each packet's mean over its path (see
//! [`super::block_path`]), counted from the side that is known. No equation is solved.
//!
//! The number of blocks follows from the allowed error: it is doubled until the result converges, in the columns around the
//! brightest pixel. So the result is a smooth function of the charges, and a correction that compensates the remaining error
//! converges.

use std::ops::Range;

use super::block_path::BlockPath;
use super::estimate;
use super::interrupt;
use super::multirevolution::Workspace;
use super::passage::{Block, Lead, Passage};
use super::simd::{LANES, Packets};

/// Allowed error, as a root mean square over the packets around the brightest pixel: the larger of the two.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Allowed {
    /// In units of the packets' displacement.
    pub relative: f64,
    /// In e-.
    pub error_e: f64,
}

/// Direction of a journey.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Towards {
    Register,
    Light,
}

/// How finely a journey is divided.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Division {
    /// One block within the image and one before it, to first order.
    FirstOrder,
    /// This number of each, to second order.
    SecondOrder(i64),
}

/// Most blocks of each region. Their error is a hundredth of one block's, or less.
const MOST: i64 = 16;

/// Minimum factor by which doubling the number of blocks reduces the error: less than the 4 of a smooth change, because of kinks.
const FALL: f64 = 3.0;

impl Division {
    /// Twice as fine.
    fn doubled(self) -> Division {
        match self {
            Division::FirstOrder => Division::SecondOrder(1),
            Division::SecondOrder(blocks) => Division::SecondOrder(2 * blocks),
        }
    }

    /// The coarsest division sufficient for some packets.
    pub fn of<P: Passage>(
        pixel: &P,
        start_e: &[Packets],
        downstream: &Lead,
        towards: Towards,
        allowed: Allowed,
        work: &mut Workspace<P::Watermarks>,
    ) -> Division {
        let mut end = |division| {
            let mut charge_e = start_e.to_vec();
            columns(pixel, &mut charge_e, downstream, (towards, division), work);
            charge_e
        };
        let mut division = Division::FirstOrder;
        let mut coarse_e = end(division);
        while division != Division::SecondOrder(MOST) {
            let finer = division.doubled();
            let fine_e = end(finer);
            let allowed_e = allowed.error_e.max(allowed.relative * distance_e(&fine_e, start_e));
            // The error of the coarse result, apart from the part that the fine one shares.
            let coarse_error_e = distance_e(&fine_e, &coarse_e);
            if coarse_error_e <= allowed_e {
                return division;
            }
            if coarse_error_e <= (FALL - 1.0) * allowed_e {
                return finer;
            }
            (division, coarse_e) = (finer, fine_e);
        }
        division
    }
}

/// Moves columns from one end of their journey to the other.
pub(super) fn columns<P: Passage>(
    pixel: &P,
    charge_e: &mut [Packets],
    downstream: &Lead,
    (towards, division): (Towards, Division),
    work: &mut Workspace<P::Watermarks>,
) {
    let Range { start: nearest, end } = downstream.pixels;
    let image = (downstream.rows.max(nearest)..end, true);
    let shared = (nearest..downstream.rows.min(end), false);
    let regions = if towards == Towards::Register { [image, shared] } else { [shared, image] };
    for (region, staggered) in regions {
        let length = (region.end - region.start).max(0);
        let blocks = if let Division::SecondOrder(blocks) = division { blocks.min(length) } else { 1.min(length) };
        for number in 0..blocks {
            interrupt::check();
            let number = if towards == Towards::Register { blocks - 1 - number } else { number };
            let [nearest, end] = [number, number + 1].map(|number| region.start + length * number / blocks);
            let block = Block { nearest, pixels: end - nearest };
            through(pixel, charge_e, (block, staggered), downstream, (towards, division), work);
        }
    }
}

/// Moves columns from one side of a block to the other.
fn through<P: Passage>(
    pixel: &P,
    charge_e: &mut [Packets],
    (block, staggered): (Block, bool),
    downstream: &Lead,
    (towards, division): (Towards, Division),
    work: &mut Workspace<P::Watermarks>,
) {
    let Workspace { watermarks, stages: [k1, k2, ..], stage_e, path } = work;
    let mut pass = |charge_e: &[Packets], path: BlockPath, found: &mut _| {
        pixel.pass(charge_e, path, block, downstream, watermarks, found);
    };
    let sign = if towards == Towards::Register { 1.0 } else { -1.0 };
    if division == Division::FirstOrder {
        pass(charge_e, BlockPath::Unknown, k1);
        return estimate::add(charge_e, &[(sign, k1)]);
    }
    if staggered {
        pass(charge_e, BlockPath::Sought(path), k1);
        match towards {
            Towards::Register => pass(charge_e, BlockPath::Known(path), k2),
            Towards::Light => {
                // Initial charges, to first order, and the means over the path relative to them.
                estimate::sum(charge_e, &[(-1.0, k1)], stage_e);
                pass(stage_e, BlockPath::Known(path), k2);
            }
        }
    } else {
        pass(charge_e, BlockPath::Unknown, k1);
        estimate::sum(charge_e, &[(0.5 * (sign - 1.0 / block.pixels as f64), k1)], stage_e);
        pass(stage_e, BlockPath::Unknown, k2);
    }
    estimate::add(charge_e, &[(sign, k2)]);
}

/// Root mean square of the differences of two sets of charges.
fn distance_e(one: &[Packets], other: &[Packets]) -> f64 {
    let differences = one.as_flattened().iter().zip(other.as_flattened()).map(|(one, other)| one - other);
    (differences.map(|difference| difference * difference).sum::<f64>() / (one.len() * LANES).max(1) as f64).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pixel::Pixel;
    use crate::{Cloud, Downstream, Method, Phase, Readout, Trap};
    use ndarray::Array2;

    /// Noisy sky with two stars.
    fn field() -> Array2<f64> {
        let star = |row: usize, at: f64, peak_e: f64| peak_e * (1.0 + ((row as f64 - at) / 2.0).powi(2)).powf(-2.5);
        Array2::from_shape_fn((90, 20), |(row, column)| {
            let noise = ((row * 7919 + column * 104_729) % 41) as f64;
            60.0 + noise + star(row, 20.0 + column as f64, 900.0) + star(row, 60.0, 9000.0)
        })
    }

    fn readout(density: f64, phase: Phase) -> Readout {
        let traps = [(0.5, 0.6), (0.3, 9.0), (0.2, 60.0)];
        Readout {
            traps: traps.map(|(share, time)| Trap { phase, ..Trap::new(density * share, time) }).to_vec(),
            cloud: Cloud::new(84_700.0, 0.0, 0.5),
            method: Method::Exact,
        }
    }

    /// Errors (rms, e-) for different numbers of blocks, compared with every transfer.
    fn errors(
        density: f64,
        phase: Phase,
        downstream: Downstream,
        towards: Towards,
        divisions: &[Division],
    ) -> Vec<f64> {
        let (before, readout) = (field(), readout(density, phase));
        let read = readout.parallel(&before, downstream);
        let lead = Lead {
            rows: downstream.rows,
            charge_e: [readout.settled_e(downstream.charge_e); LANES],
            pixels: 0..before.nrows() as i64 + downstream.rows,
        };
        let error = |division: &Division| {
            let mut work = Workspace::new(before.nrows());
            let ends = if towards == Towards::Light { [&read, &before] } else { [&before, &read] };
            let [mut charge_e, truth_e] = ends.map(|image| {
                let mut lanes = Vec::new();
                crate::simd::gather(image.view(), &(0..LANES).collect::<Vec<_>>(), &mut lanes);
                lanes
            });
            if phase == Phase::SINGLE {
                let pixel = Pixel::<3, false>::new(&readout.traps, readout.cloud.clone(), before.nrows());
                columns(&pixel, &mut charge_e, &lead, (towards, *division), &mut work);
            } else {
                let pixel = Pixel::<3, true>::new(&readout.traps, readout.cloud.clone(), before.nrows());
                columns(&pixel, &mut charge_e, &lead, (towards, *division), &mut work);
            }
            distance_e(&charge_e, &truth_e)
        };
        divisions.iter().map(error).collect()
    }

    #[test]
    fn blocks_are_passed_to_first_and_second_order_both_ways() {
        let several = Phase { over: 0.2, ahead: 0.3, tie: 0.1 };
        let away = Downstream { rows: 400, charge_e: 0.0 };
        let behind_sky = Downstream { rows: 400, charge_e: 60.0 };
        for (phase, downstream) in [
            (Phase::SINGLE, Downstream::NONE),
            (Phase::SINGLE, behind_sky),
            (several, Downstream::NONE),
            (several, away),
        ] {
            for towards in [Towards::Register, Towards::Light] {
                let divisions = [Division::FirstOrder, Division::SecondOrder(1), Division::SecondOrder(4)];
                let whole = errors(3.0, phase, downstream, towards, &divisions);
                let half = errors(1.5, phase, downstream, towards, &divisions);
                let falls: Vec<f64> = whole.iter().zip(&half).map(|(whole, half)| whole / half).collect();
                // An error of second order in the traps decreases by 4 if they are halved, one of third order by 8.
                assert!(
                    (3.5..4.5).contains(&falls[0]) && (6.0..9.0).contains(&falls[2]),
                    "{towards:?} {whole:?} {half:?}"
                );
                assert!(whole[1] < 0.1 * whole[0] && whole[2] < 0.2 * whole[1], "{towards:?} {whole:?}");
            }
        }
    }

    #[test]
    fn both_ends_are_found_with_the_error_allowed() {
        for downstream in [Downstream::NONE, Downstream { rows: 300, charge_e: 60.0 }] {
            let (before, readout) = (field(), readout(1.0, Phase::SINGLE));
            let rms = |image: Array2<f64>| (image.iter().map(|e| e * e).sum::<f64>() / image.len() as f64).sqrt();
            for (parallel, read) in [
                (true, readout.parallel(&before, downstream)),
                (false, readout.serial(&before.t().to_owned(), downstream)),
            ] {
                for allowed_e in [3e-2, 3e-3, 3e-4] {
                    let allowed = Allowed { relative: 0.0, error_e: allowed_e };
                    let found = match parallel {
                        true => readout.parallel_reversed(&read, downstream, allowed),
                        false => readout.serial_reversed(&read, downstream, allowed).map(|found| found.reversed_axes()),
                    };
                    let error_e = rms(found.unwrap() - &before);
                    assert!(error_e < allowed_e, "{error_e:e} of {allowed_e:e}");
                    let fast = Readout { method: Method::Fast { relative: 1e-9 }, ..readout.clone() };
                    let error_e = match parallel {
                        true => rms(fast.parallel_within(&before, downstream, allowed) - &read),
                        false => rms(fast.serial_within(&before.t().to_owned(), downstream, allowed) - &read),
                    };
                    assert!(error_e < allowed_e, "{error_e:e} of {allowed_e:e}");
                }
            }
        }
    }
}
