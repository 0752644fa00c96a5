//! The phases of a pixel and the clock steps, as given in a mission file.

use serde::{Deserialize, Serialize};

use crate::readout::{Clock, ClockFault, ClockStep};

/// `[readout.clock]`: clock phases; without it, a transfer is one step.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PhaseClock {
    /// Phases of a pixel.
    pub phases: u32,
    /// Phases that hold the packet in each step, numbered from 1 in the direction of transfer; each phase in turn if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub holds: Option<Vec<Vec<u32>>>,
    /// Relative durations of the steps; equal if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub dwell: Option<Vec<f64>>,
    /// Relative numbers of traps below the phases; equal if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub trap_share: Option<Vec<f64>>,
}

/// A fault in a key of the table, and what to try.
#[derive(Clone, Debug, PartialEq)]
pub struct ClockProblem {
    /// The key within the table.
    pub key: &'static str,
    /// The fault.
    pub problem: String,
    /// What to try.
    pub help: &'static str,
}

impl PhaseClock {
    /// The clock of the readout.
    ///
    /// # Errors
    /// If lists differ in length, or the steps do not move a packet by one pixel.
    pub fn clock(&self) -> Result<Clock, ClockProblem> {
        let phases = self.phases as usize;
        let holds = match &self.holds {
            Some(holds) => holds.iter().map(|held| held.iter().map(|phase| *phase as usize).collect()).collect(),
            None => (1..=phases).map(|phase| vec![phase]).collect::<Vec<Vec<usize>>>(),
        };
        let dwell = self.dwell.clone().unwrap_or_else(|| vec![1.0; holds.len()]);
        let trap_share = self.trap_share.clone().unwrap_or_else(|| vec![1.0; phases]);
        if dwell.len() != holds.len() {
            let problem = format!("{} dwell times for {} steps", dwell.len(), holds.len());
            let help = "one number for each step of holds, or for each phase if there is no holds";
            return Err(ClockProblem { key: "dwell", problem, help });
        }
        if trap_share.len() != phases {
            let problem = format!("{} shares of the traps for {phases} phases", trap_share.len());
            return Err(ClockProblem { key: "trap_share", problem, help: "one number for each phase" });
        }
        if let Some((step, phase)) = outside(&holds, phases) {
            let problem = format!("step {} holds charge below phase {phase}; there are phases 1 to {phases}", step + 1);
            return Err(ClockProblem { key: "holds", problem, help: HOLDS });
        }
        let from_zero = |held: Vec<usize>| held.into_iter().map(|phase| phase - 1).collect();
        let steps = |(dwell, held)| ClockStep { dwell, holds: from_zero(held) };
        let steps: Vec<ClockStep> = dwell.into_iter().zip(holds).map(steps).collect();
        Clock::new(&steps, &trap_share).map_err(problem)
    }
}

/// An example of a list of steps.
const HOLDS: &str = "for three phases: holds = [[1], [2], [3]] or [[1], [1, 2], [2], [2, 3], [3], [3, 1]]";

/// The first step with a phase that does not exist, and that phase.
fn outside(holds: &[Vec<usize>], phases: usize) -> Option<(usize, usize)> {
    let wrong = |held: &Vec<usize>| held.iter().copied().find(|phase| !(1..=phases).contains(phase));
    holds.iter().enumerate().find_map(|(step, held)| Some((step, wrong(held)?)))
}

fn problem(fault: ClockFault) -> ClockProblem {
    let (key, help) = match fault {
        ClockFault::Empty => ("trap_share", "give at least one phase a share above 0"),
        _ => ("holds", HOLDS),
    };
    ClockProblem { key, problem: fault.to_string(), help }
}
