//! Options of a search, and its progress.

use crate::physics::observable::Observable;

/// Options of a search.
#[derive(Clone, Debug)]
pub struct Options {
    /// False-alarm probability allowed for complete models.
    pub level: f64,
    /// Seed of all simulations.
    pub seed: u64,
    /// Free parameters, as dotted keys.
    pub free: Vec<String>,
    /// The user's own effects, by kind, as in a mission's `[effects]`.
    pub candidates: Option<toml::Table>,
    /// Observables that could be measured next; all if empty.
    pub can: Vec<Observable>,
    /// Evaluations of the model at all rows after which a round of the search begins no further step.
    pub evaluations: u64,
    /// Whether the search is repeated under other assumptions.
    pub stability: bool,
}

impl Default for Options {
    fn default() -> Options {
        Options {
            level: 0.01,
            seed: 1,
            free: Vec::new(),
            candidates: None,
            can: Vec::new(),
            evaluations: EVALUATIONS,
            stability: true,
        }
    }
}

/// Evaluations of the model that a round of a search may make by default: more than the longest of the cases of
/// `docs/diagnosis.md` takes.
pub const EVALUATIONS: u64 = 20_000;

/// Progress of a search.
pub struct Progress<'a> {
    /// Called at the start of a stage, with its name and how many steps it has.
    pub stage: &'a (dyn Fn(&str, u64) + Sync),
    /// Called after each step.
    pub advance: &'a (dyn Fn() + Sync),
}

impl Progress<'_> {
    pub(super) fn step(&self) {
        (self.advance)();
    }
}
