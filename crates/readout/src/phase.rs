//! The phases of a pixel, and the packets to which traps below each of them release electrons.
//!
//! A pixel has P electrodes (phases), with traps below all of them. The clock goes through some steps in one line time, and in each
//! step packets lie below some of the phases. While a packet is over a trap, every trap below the height of the cloud captures at
//! once, and those above release into that packet. Between two packets, released charge joins the nearer one: the packet ahead,
//! which has just left, or the one behind, which comes next. Distances are counted in phases from the trap to the nearest phase of
//! the packet; at equal distances each packet gets half.
//!
//! ```text
//! three phases, charge moves →      trap below phase 0, line time 1
//!
//!   step   phase 0  1  2            nearest packet     released to
//!    1          ●                   over it            (captures)
//!    2             ●                ahead, 1 away      the packet that has left: nothing is trailed
//!    3                ●             behind, 1 away     the next packet: trailed by one pixel
//! ```
//!
//! Within a line time, a trap spends the shares `over`, `ahead`, `tie` and the rest near the next packet. Of the traps that are
//! full when the packet leaves, a fraction R returns its electrons to it. Of those still full, a fraction Q is released to the next
//! packet before that captures:
//!
//! ```text
//! R = 1 − exp(−a/τ) (1 + exp(−t/τ))/2         a = ahead, t = tie, τ in line times
//! 1 − Q = exp(−(1 − a − t)/τ) · 2 exp(−t/τ)/(1 + exp(−t/τ))         (1 − R) (1 − Q) = exp(−1/τ)
//! ```
//!
//! Charge released from above the packet's own height while it is over the trap counts with Q, before it captures. With one phase a
//! = t = 0, and this is the transfer in one step of the whole crate.
//!
//! A packet has the same height below each of its phases as in a pixel of one phase; if it lies below two at once, the volume is
//! not shared between them. Its loss below the phases of one pixel is too small to change its height from one of them to the next.
//!
//! Derived for ctiplan from the geometry of the phases; a test follows every step of the clock. Capture on the way from one phase
//! to the next is neglected, as usual; Skottfelt et al. 2018 (arXiv:1801.01068) find that it shows in trap pumping.

use std::fmt;

use super::Trap;

/// Which packet is near a trap, in shares of the line time. For the rest of the line the next packet is nearer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Phase {
    /// A packet is over it.
    pub over: f64,
    /// The packet that has just left is nearer than the next one.
    pub ahead: f64,
    /// Both are equally near.
    pub tie: f64,
}

impl Phase {
    /// The only phase of a pixel: a packet is always over it.
    pub const SINGLE: Phase = Phase { over: 1.0, ahead: 0.0, tie: 0.0 };

    /// Q, for a release time τ in line times.
    pub(super) fn released(&self, release_transfers: f64) -> f64 {
        let [rest, half_tie] = [1.0 - self.ahead - self.tie, 0.5 * self.tie].map(over(release_transfers));
        // 2 x/(1 + x) = 1 − tanh(t/2τ) for x = exp(−t/τ)
        -(-rest).exp_m1() + (-rest).exp() * half_tie.tanh()
    }

    /// R, for a release time τ in line times.
    pub(super) fn returned(&self, release_transfers: f64) -> f64 {
        let [ahead, tie] = [self.ahead, self.tie].map(over(release_transfers));
        -(-ahead).exp_m1() - 0.5 * (-ahead).exp() * (-tie).exp_m1()
    }

    /// Equal except for rounding.
    fn is_about(&self, other: &Phase) -> bool {
        let differences = [self.over - other.over, self.ahead - other.ahead, self.tie - other.tie];
        differences.iter().all(|difference| difference.abs() < 1e-12)
    }
}

/// A share of the line over a release time, which may be 0.
fn over(release_transfers: f64) -> impl Fn(f64) -> f64 {
    move |share| if share == 0.0 { 0.0 } else { share / release_transfers }
}

/// The phases of a pixel's traps.
#[derive(Clone, Debug, PartialEq)]
pub struct Clock {
    /// Fraction of the traps for each kind of phase.
    shares: Vec<(f64, Phase)>,
}

/// One step of a clock.
#[derive(Clone, Debug, PartialEq)]
pub struct ClockStep {
    /// Its duration, in any unit.
    pub dwell: f64,
    /// Phases that hold a packet, in the direction of transfer; numbered from 0; the last is followed by phase 0 of the next pixel.
    pub holds: Vec<usize>,
}

/// Why a sequence of steps is not a clock. Steps and phases are numbered from 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ClockFault {
    /// No step takes any time, or no phase has traps.
    Empty,
    /// A step holds no packet, or its phases do not exist or are not neighbours in the direction of transfer.
    NotNeighbours {
        /// The step.
        step: usize,
    },
    /// A step holds packets below all of several phases.
    Merges {
        /// The step.
        step: usize,
    },
    /// Between two steps the packet moves backwards, or its new phases neither overlap nor follow its old ones.
    Leaps {
        /// The step before that move.
        step: usize,
    },
    /// After all steps the packet has not moved by one pixel.
    NotOnePixel,
}

impl fmt::Display for ClockFault {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            ClockFault::Empty => out.write_str("no step takes any time, or no phase has traps"),
            ClockFault::NotNeighbours { step } => {
                write!(out, "the phases of step {} are not neighbours in the direction of transfer", step + 1)
            }
            ClockFault::Merges { step } => {
                write!(out, "step {} holds charge below all phases: packets would merge", step + 1)
            }
            ClockFault::Leaps { step } => {
                write!(out, "after step {} the packet moves by more than one phase, or backwards", step + 1)
            }
            ClockFault::NotOnePixel => out.write_str("all steps together do not move a packet by one pixel"),
        }
    }
}

impl Clock {
    /// One phase: the transfer is a single step.
    pub fn single() -> Clock {
        Clock { shares: vec![(1.0, Phase::SINGLE)] }
    }

    /// A clock of `phases` phases (at least 1), each with an equal part of the line and an equal part of the traps.
    pub fn of_phases(phases: usize) -> Clock {
        let steps: Vec<ClockStep> =
            (0..phases.max(1)).map(|phase| ClockStep { dwell: 1.0, holds: vec![phase] }).collect();
        Clock::new(&steps, &vec![1.0; phases.max(1)]).expect("a step for each phase is a clock")
    }

    /// The steps of one line; `trap_share[phase]` is the share of the traps below each phase, in any unit.
    ///
    /// # Errors
    /// If the steps are not a clock.
    pub fn new(steps: &[ClockStep], trap_share: &[f64]) -> Result<Clock, ClockFault> {
        let phases = trap_share.len();
        let (all_dwell, all_traps) = (steps.iter().map(|step| step.dwell).sum::<f64>(), trap_share.iter().sum::<f64>());
        if !(all_dwell > 0.0 && all_traps > 0.0) {
            return Err(ClockFault::Empty);
        }
        let held = positions(steps, phases)?;
        if phases == 1 {
            return Ok(Clock::single());
        }
        let mut shares: Vec<(f64, Phase)> = Vec::new();
        for (phase, traps) in trap_share.iter().enumerate().filter(|(_, traps)| **traps > 0.0) {
            let mut seen = Phase { over: 0.0, ahead: 0.0, tie: 0.0 };
            for (step, held) in steps.iter().zip(&held) {
                let share = step.dwell / all_dwell;
                match nearest(phase, *held, phases) {
                    Nearest::Over => seen.over += share,
                    Nearest::Ahead => seen.ahead += share,
                    Nearest::Tie => seen.tie += share,
                    Nearest::Behind => {}
                }
            }
            match shares.iter_mut().find(|(_, known)| known.is_about(&seen)) {
                Some((share, _)) => *share += traps / all_traps,
                None => shares.push((traps / all_traps, seen)),
            }
        }
        Ok(Clock { shares })
    }

    /// The same clock with more time between two packets: of the time that a packet is over a trap, the share `returns` (0 to ½) is
    /// spent near the packet that has just left, and as much near the next one. One phase becomes 1/(1 − 2 `returns`) equal ones,
    /// if that is an odd number.
    pub fn with_return(&self, returns: f64) -> Clock {
        let longer = |(share, phase): &(f64, Phase)| {
            let over = phase.over;
            (*share, Phase { over: over * (1.0 - 2.0 * returns), ahead: phase.ahead + returns * over, ..*phase })
        };
        Clock { shares: self.shares.iter().map(longer).collect() }
    }

    /// Number of kinds of phases that a species is divided into.
    pub fn kinds(&self) -> usize {
        self.shares.len()
    }

    /// The fraction of electrons that traps of one release time (in line times) return to the packet that has just left.
    pub fn returned(&self, release_transfers: f64) -> f64 {
        self.shares.iter().map(|(share, phase)| share * phase.returned(release_transfers)).sum()
    }

    /// Traps divided among the phases.
    pub fn spread(&self, traps: &[Trap]) -> Vec<Trap> {
        let below = |trap: &Trap| {
            let trap = *trap;
            self.shares.iter().map(move |(share, phase)| Trap {
                density_per_px: if self.shares.len() == 1 { trap.density_per_px } else { trap.density_per_px * share },
                phase: *phase,
                ..trap
            })
        };
        traps.iter().flat_map(below).collect()
    }
}

/// The nearest packet to a trap.
enum Nearest {
    Over,
    Ahead,
    Tie,
    Behind,
}

/// The nearest packet to a trap below a phase while packets lie below `first` to `last` and the same phases of all other pixels.
fn nearest(phase: usize, (first, last): (usize, usize), phases: usize) -> Nearest {
    // Phases from the packet's first one to the trap, in the direction of transfer.
    let from_first = (phase as i64 - first as i64).rem_euclid(phases as i64) as usize;
    let length = last - first;
    if from_first <= length {
        return Nearest::Over;
    }
    // The packet behind ends before the trap; the one ahead begins after it.
    let (behind, ahead) = (from_first - length, phases - from_first);
    match ahead.cmp(&behind) {
        std::cmp::Ordering::Less => Nearest::Ahead,
        std::cmp::Ordering::Equal => Nearest::Tie,
        std::cmp::Ordering::Greater => Nearest::Behind,
    }
}

/// First and last phase of one packet in every step, counted continuously from pixel to pixel.
fn positions(steps: &[ClockStep], phases: usize) -> Result<Vec<(usize, usize)>, ClockFault> {
    let mut held: Vec<(usize, usize)> = Vec::new();
    for (step, ClockStep { holds, .. }) in steps.iter().enumerate() {
        let neighbours = holds.windows(2).all(|pair| pair[1] == (pair[0] + 1) % phases);
        let Some(&first) = holds.first().filter(|_| neighbours && holds.iter().all(|phase| *phase < phases)) else {
            return Err(ClockFault::NotNeighbours { step });
        };
        if holds.len() > 1 && holds.len() >= phases {
            return Err(ClockFault::Merges { step });
        }
        // The next such phase after the packet's previous one.
        let before = held.last().map_or(0, |(first, _)| *first);
        let first = if held.is_empty() { first } else { before + (first + phases - before % phases) % phases };
        held.push((first, first + holds.len() - 1));
    }
    let start = held[0];
    let end = (start.0 + phases, start.1 + phases);
    if held.iter().any(|(first, last)| *first > end.0 || *last > end.1) {
        return Err(ClockFault::NotOnePixel);
    }
    for (step, (before, after)) in held.iter().zip(held[1..].iter().chain([&end])).enumerate() {
        if after.0 > before.1 + 1 || after.1 < before.1 {
            return Err(ClockFault::Leaps { step });
        }
    }
    Ok(held)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn steps(holds: &[&[usize]]) -> Vec<ClockStep> {
        holds.iter().map(|holds| ClockStep { dwell: 1.0, holds: holds.to_vec() }).collect()
    }

    fn clock(holds: &[&[usize]], phases: usize) -> Result<Vec<(f64, Phase)>, ClockFault> {
        Clock::new(&steps(holds), &vec![1.0; phases]).map(|clock| clock.shares)
    }

    #[test]
    fn a_trap_is_near_the_packet_that_left_for_half_of_the_time_between_two() {
        // One step over the trap, and half of the others near each packet, for equal dwell times.
        for phases in 1..=6_usize {
            let clock = Clock::of_phases(phases);
            let [(share, phase)] = clock.shares[..] else { panic!("{phases} phases that are alike") };
            assert!((share - 1.0).abs() < 1e-12);
            let step = 1.0 / phases as f64;
            let between = (phases - 1) as f64 * step;
            assert!((phase.over - step).abs() < 1e-12);
            assert!((phase.ahead + phase.tie / 2.0 - between / 2.0).abs() < 1e-12, "{phases}: {phase:?}");
            let tie = if phases % 2 == 0 { step } else { 0.0 };
            assert!((phase.tie - tie).abs() < 1e-12, "{phases}: {phase:?}");
        }
    }

    #[test]
    fn overlapping_phases_hold_a_packet_longer() {
        // Each phase holds charge in three of six steps.
        let three = clock(&[&[0], &[0, 1], &[1], &[1, 2], &[2], &[2, 0]], 3).unwrap();
        let [(_, phase)] = three[..] else { panic!("phases that are alike") };
        assert!((phase.over - 0.5).abs() < 1e-12);
        // Then one near the packet that left ([1, 2] seen from 0 is one behind and one ahead: the tie).
        assert!((phase.ahead - 1.0 / 6.0).abs() < 1e-12);
        assert!((phase.tie - 1.0 / 6.0).abs() < 1e-12);
        // Four phases, two of which hold charge at a time.
        let four = clock(&[&[0, 1], &[1, 2], &[2, 3], &[3, 0]], 4).unwrap();
        let [(_, phase)] = four[..] else { panic!("phases that are alike") };
        assert_eq!((phase.over, phase.ahead, phase.tie), (0.5, 0.25, 0.0));
    }

    #[test]
    fn more_time_between_packets_makes_more_phases() {
        assert_eq!(Clock::of_phases(4).with_return(0.0), Clock::of_phases(4));
        for phases in [1.0, 3.0, 5.0] {
            let made = Clock::single().with_return(0.5 * (1.0 - 1.0 / phases));
            let [(_, made), (_, expected)] = [made.shares[0], Clock::of_phases(phases as usize).shares[0]];
            assert!(made.is_about(&expected), "{made:?}, {expected:?}");
        }
    }

    #[test]
    fn the_count_may_begin_below_any_phase() {
        assert_eq!(clock(&[&[1], &[2], &[0]], 3), clock(&[&[0], &[1], &[2]], 3));
    }

    #[test]
    fn what_is_no_clock_is_refused() {
        assert_eq!(clock(&[&[0], &[2], &[1]], 3), Err(ClockFault::NotOnePixel));
        assert_eq!(clock(&[&[0], &[1]], 3), Err(ClockFault::Leaps { step: 1 }));
        assert_eq!(clock(&[&[0], &[0, 2]], 3), Err(ClockFault::NotNeighbours { step: 1 }));
        assert_eq!(clock(&[&[0], &[]], 3), Err(ClockFault::NotNeighbours { step: 1 }));
        assert_eq!(clock(&[&[3]], 3), Err(ClockFault::NotNeighbours { step: 0 }));
        assert_eq!(clock(&[&[0, 1]], 2), Err(ClockFault::Merges { step: 0 }));
        assert_eq!(clock(&[&[0, 1], &[0], &[1]], 3), Err(ClockFault::Leaps { step: 0 }));
        assert_eq!(Clock::new(&steps(&[&[0]]), &[0.0]), Err(ClockFault::Empty));
    }

    #[test]
    fn both_packets_together_get_what_a_line_time_releases() {
        let phases =
            [Phase::SINGLE, Phase { over: 0.2, ahead: 0.3, tie: 0.1 }, Phase { over: 0.5, ahead: 0.0, tie: 0.5 }];
        for phase in phases {
            for release in [1e-4, 0.3, 1.0, 50.0] {
                let kept = (1.0 - phase.returned(release)) * (1.0 - phase.released(release));
                assert!((kept - (-1.0_f64 / release).exp()).abs() < 1e-15, "{phase:?}, {release}");
            }
        }
        assert_eq!(Phase::SINGLE.released(3.0), -(-1.0_f64 / 3.0).exp_m1());
        assert_eq!(Phase::SINGLE.returned(3.0), 0.0);
        // Half of a tie, for traps that release at once.
        assert_eq!(Phase { over: 0.5, ahead: 0.0, tie: 0.5 }.returned(1e-4), 0.5);
    }
}
