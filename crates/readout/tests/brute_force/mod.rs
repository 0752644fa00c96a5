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

/// Traps from the level below up to `top`, with the fraction filled of each species.
#[derive(Clone)]
struct Level {
    top: f64,
    filled: Vec<f64>,
}

/// What is above or near a trap in one step.
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
    let nothing = vec![Level { top: 1.0, filled: vec![0.0; traps.len()] }];
    let mut levels = vec![vec![nothing; phases]; pixels];
    let height = |charge_e: f64| (charge_e.max(0.0) / full_well_e).powf(power).min(1.0);
    let positions = positions(steps, phases as i64);
    // One line more, in which traps of the last pixels release near the last packet.
    for lines in 0..=pixels as i64 {
        for (step, held) in steps.iter().zip(&positions) {
            let dwell = step.dwell / line;
            for pixel in 0..pixels {
                for phase in 0..phases {
                    let density = |species: usize| traps[species].density_per_px * trap_share[phase] / all_traps;
                    let levels = &mut levels[pixel][phase];
                    let near = near(pixel as i64, phase as i64, lines, *held, phases as i64);
                    let kept = |species: usize| (-dwell / traps[species].release_transfers).exp();
                    match near {
                        Near::Over(packet) if (0..pixels as i64).contains(&packet) => {
                            let packet = &mut packets[packet as usize];
                            let height = height(*packet);
                            *packet -= captured(levels, height, density, |species| caught(&traps[species], dwell));
                            *packet += released(levels, height, density, kept);
                        }
                        Near::Over(_) => {
                            released(levels, 0.0, density, kept);
                        }
                        Near::Between(near) => {
                            let out_e = released(levels, 0.0, density, kept);
                            for (packet, part) in near {
                                if (0..pixels as i64).contains(&packet) {
                                    packets[packet as usize] += part * out_e;
                                }
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
fn caught(trap: &Trap, time: f64) -> (f64, f64) {
    if trap.capture_transfers == 0.0 {
        return (1.0, 0.0);
    }
    // df/dt = (1 − f)/τc − f/τ
    let (capture, release) = (1.0 / trap.capture_transfers, 1.0 / trap.release_transfers);
    (capture / (capture + release), (-time * (capture + release)).exp())
}

/// Fills traps below a height, each species towards what [`caught`] says; electrons captured.
fn captured(
    levels: &mut Vec<Level>,
    height: f64,
    density: impl Fn(usize) -> f64,
    caught: impl Fn(usize) -> (f64, f64),
) -> f64 {
    let (mut captured_e, mut floor) = (0.0, 0.0);
    let mut after: Vec<Level> = Vec::new();
    for level in levels.drain(..) {
        let top = level.top.min(height);
        if top > floor {
            let mut inside = Level { top, filled: level.filled.clone() };
            for (species, filled) in inside.filled.iter_mut().enumerate() {
                let (full, approach) = caught(species);
                let before = *filled;
                *filled = full + (before - full) * approach;
                captured_e += (top - floor) * density(species) * (*filled - before);
            }
            // Traps that are all full are one level.
            match after.last_mut().filter(|below| below.filled == inside.filled) {
                Some(below) => below.top = top,
                None => after.push(inside),
            }
        }
        floor = level.top;
        if level.top > height {
            after.push(level);
        }
    }
    *levels = after;
    captured_e
}

/// Releases from traps above a height, of which the fraction `kept` stays filled; electrons released.
fn released(levels: &mut [Level], height: f64, density: impl Fn(usize) -> f64, kept: impl Fn(usize) -> f64) -> f64 {
    let (mut released_e, mut floor) = (0.0, 0.0);
    for level in levels {
        if level.top > height {
            for (species, filled) in level.filled.iter_mut().enumerate() {
                let out = *filled * (1.0 - kept(species));
                *filled -= out;
                released_e += (level.top - floor) * density(species) * out;
            }
        }
        floor = level.top;
    }
    released_e
}
