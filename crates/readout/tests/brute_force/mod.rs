//! Every packet in every step of the clock, below every phase of every pixel; nothing is shared with the program.
//!
//! Traps are cut into levels wherever a cloud has ended, so that heights are not rounded.

use ctiplan_readout::{ClockStep, Trap};

/// Packets of a column, row 0 nearest the register, behind packets of background.
pub struct Column<'a> {
    pub charge_e: &'a [f64],
    pub rows_downstream: usize,
    pub background_e: f64,
}

/// Traps of a species from the level below up to `top`, with the fraction filled.
#[derive(Clone)]
struct Level {
    top: f64,
    filled: f64,
}

/// What is above or near a trap in one step.
#[derive(Clone, Copy)]
enum Near {
    Over(i64),
    /// Packets, with the part of what is released that each gets.
    Between([(i64, f64); 2]),
}

/// Charges after all transfers, e-, of clouds that fill `full_well_e` by a power.
pub fn clocked_out(
    column: &Column,
    steps: &[ClockStep],
    trap_share: &[f64],
    traps: &[Trap],
    full_well_e: f64,
    power: f64,
) -> Vec<f64> {
    let phases = trap_share.len();
    let mut packets = vec![column.background_e; column.rows_downstream];
    packets.extend(column.charge_e);
    let pixels = packets.len();
    let line: f64 = steps.iter().map(|step| step.dwell).sum();
    let all_traps: f64 = trap_share.iter().sum();
    let nothing = vec![Level { top: 1.0, filled: 0.0 }];
    let mut levels = vec![vec![vec![nothing; traps.len()]; phases]; pixels];
    let height = |charge_e: f64, trap: &Trap| {
        let level_e = trap.surface_level_e.unwrap_or(0.0);
        let above = (charge_e - level_e).max(0.0) / (full_well_e - level_e);
        above.powf(trap.well_fill_power.unwrap_or(power)).min(1.0)
    };
    let positions = positions(steps, phases as i64);
    // One line more, in which traps of the last pixels release near the last packet.
    for lines in 0..=pixels as i64 {
        for (step, held) in steps.iter().zip(&positions) {
            let dwell = step.dwell / line;
            for pixel in 0..pixels {
                for phase in 0..phases {
                    let near = near(pixel as i64, phase as i64, lines, *held, phases as i64);
                    // Heights are those of the charge that all species meet.
                    let met_e = match near {
                        Near::Over(packet) => packets.get(packet as usize).copied().unwrap_or(0.0),
                        Near::Between(_) => 0.0,
                    };
                    for (trap, levels) in traps.iter().zip(&mut levels[pixel][phase]) {
                        let density = trap.density_per_px * trap_share[phase] / all_traps;
                        let kept = (-dwell / trap.release_transfers).exp();
                        let change_e = match near {
                            Near::Over(_) => {
                                let height = height(met_e, trap);
                                let density_e =
                                    |charge_e: f64| charge_e / ((charge_e / full_well_e).powf(power).min(1.0));
                                let captured = captured(levels, height, caught(trap, dwell, met_e, density_e));
                                density * (released(levels, height, kept) - captured)
                            }
                            Near::Between(_) => density * released(levels, 0.0, kept),
                        };
                        let shares = match near {
                            Near::Over(packet) => [(packet, 1.0), (packet, 0.0)],
                            Near::Between(shares) => shares,
                        };
                        for (packet, share) in shares {
                            if let Some(charge_e) =
                                usize::try_from(packet).ok().and_then(|packet| packets.get_mut(packet))
                            {
                                *charge_e += share * change_e;
                            }
                        }
                    }
                }
            }
        }
    }
    packets.split_off(column.rows_downstream)
}

/// First and last phase that holds the packet in each step, counted on from pixel to pixel.
fn positions(steps: &[ClockStep], phases: i64) -> Vec<[i64; 2]> {
    let mut first = 0;
    let mut position = |step: &ClockStep| {
        while first % phases != step.holds[0] as i64 {
            first += 1;
        }
        [first, first + step.holds.len() as i64 - 1]
    };
    steps.iter().map(&mut position).collect()
}

/// The packet that began in pixel k has moved so many lines: it is below the phases `held` of pixel k − lines, where they are
/// counted towards the register.
fn near(pixel: i64, phase: i64, lines: i64, [first, last]: [i64; 2], phases: i64) -> Near {
    // Phases from pixel 0's first one, towards the register.
    let place = phase - pixel * phases;
    let of = |packet: i64| [first - (packet - lines) * phases, last - (packet - lines) * phases];
    let mut ahead = (i64::MAX, 0);
    let mut behind = (i64::MAX, 0);
    for packet in pixel + lines - 3..=pixel + lines + 3 {
        let [first, last] = of(packet);
        if (first..=last).contains(&place) {
            return Near::Over(packet);
        }
        if first > place {
            ahead = ahead.min((first - place, packet));
        } else {
            behind = behind.min((place - last, packet));
        }
    }
    if ahead.0 == behind.0 {
        Near::Between([(ahead.1, 0.5), (behind.1, 0.5)])
    } else {
        Near::Between([(ahead.min(behind).1, 1.0), (ahead.1, 0.0)])
    }
}

/// What traps inside a cloud are filled to in the end, and what is left of the distance from that after some time (in lines).
fn caught(trap: &Trap, time: f64, met_e: f64, density_e: impl Fn(f64) -> f64) -> (f64, f64) {
    if trap.capture_transfers == 0.0 {
        return (1.0, 0.0);
    }
    let denser = |law: ctiplan_readout::CaptureDensity| (density_e(met_e) / density_e(law.at_e)).powf(law.power);
    let faster = trap.capture_density.filter(|_| met_e > 0.0).map_or(1.0, denser);
    // df/dt = (1 − f)/τc − f/τ
    let (capture, release) = (faster / trap.capture_transfers, 1.0 / trap.release_transfers);
    (capture / (capture + release), (-time * (capture + release)).exp())
}

/// Fills traps below a height towards what [`caught`] says; the share of all traps that captures.
fn captured(levels: &mut Vec<Level>, height: f64, (full, approach): (f64, f64)) -> f64 {
    let (mut captured, mut floor) = (0.0, 0.0);
    let mut after: Vec<Level> = Vec::new();
    for level in levels.drain(..) {
        let top = level.top.min(height);
        if top > floor {
            let filled = full + (level.filled - full) * approach;
            captured += (top - floor) * (filled - level.filled);
            // Traps that are all full are one level.
            match after.last_mut().filter(|below| below.filled == filled) {
                Some(below) => below.top = top,
                None => after.push(Level { top, filled }),
            }
        }
        floor = level.top;
        if level.top > height {
            after.push(level);
        }
    }
    *levels = after;
    captured
}

/// Releases from traps above a height, of which the fraction `kept` stays filled; the share of all traps that releases.
fn released(levels: &mut [Level], height: f64, kept: f64) -> f64 {
    let (mut released, mut floor) = (0.0, 0.0);
    for level in levels {
        if level.top > height {
            let out = level.filled * (1.0 - kept);
            level.filled -= out;
            released += (level.top - floor) * out;
        }
        floor = level.top;
    }
    released
}
