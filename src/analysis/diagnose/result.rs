//! What a diagnosis comes to.

use serde::Serialize;

use super::holdout::Carried;
use super::noise::SetNoise;
use super::stability::Stability;
use crate::analysis::fit::{Advice, Fitted};
use crate::analysis::validate::Validation;
use crate::mission::Mission;
use crate::physics::observable::Observable;
use crate::plan::evaluate;

/// What came of a diagnosis.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Verdict {
    /// The model explains the data.
    Complete,
    /// Effects were missing; with them it does.
    Missing,
    /// The same, but some effect has rivals that these data cannot tell from it.
    Ambiguous,
    /// No combination of effects explains the data.
    Unexplained,
    /// The data cannot carry a verdict.
    Unfit,
}

impl Verdict {
    /// As in JSON.
    pub fn name(self) -> &'static str {
        match self {
            Verdict::Complete => "complete",
            Verdict::Missing => "missing",
            Verdict::Ambiguous => "ambiguous",
            Verdict::Unexplained => "unexplained",
            Verdict::Unfit => "unfit",
        }
    }
}

/// Why a diagnosis comes to its verdict; the report has the words.
#[derive(Clone, Debug, PartialEq)]
pub enum Reason {
    /// Complete: the model explains the data.
    Explained,
    /// Complete: what is left is noise.
    Noise {
        /// The effects that would help most, and by how much chi2 would fall.
        best: Option<(Vec<String>, f64)>,
    },
    /// Missing or ambiguous: effects explain the data.
    Lacking {
        /// The effects.
        effects: Vec<String>,
        /// Whether the data leave others in their place.
        has_rivals: bool,
    },
    /// Unexplained.
    Unexplained {
        /// Steps of the search that were left undone.
        undone: Vec<String>,
    },
    /// Unfit: fewer rows than questions.
    TooFewRows {
        /// Rows.
        n: usize,
        /// Free parameters.
        free: usize,
    },
    /// Unfit: rows that are there twice.
    Repeated {
        /// How many.
        count: usize,
        /// The first two.
        such_as: [RowPlace; 2],
    },
    /// Unfit: rows under the same conditions that differ.
    Contradictory {
        /// The two that differ most.
        rows: [RowPlace; 2],
        /// By how much, in units of their errors.
        apart_sigma: f64,
    },
    /// Unfit: quoted errors that are larger than the scatter.
    LargeErrors {
        /// The file.
        file: String,
        /// So many times, rounded to a tenth.
        factor: f64,
    },
    /// Unfit: quoted errors that are smaller than a scatter without a trend.
    SmallErrors {
        /// The file.
        file: String,
        /// So many times.
        factor: f64,
    },
    /// Unfit: rows far from a model that explains all others.
    OddRows {
        /// Each with how far off it is, in sigma.
        rows: Vec<(RowPlace, f64)>,
        /// Kinds of the effects that the model was given.
        with: Vec<String>,
    },
}

/// A row of a measurement file.
#[derive(Clone, Debug, PartialEq)]
pub struct RowPlace {
    /// The file as given.
    pub file: String,
    /// Its line in there, from 1; None for a table that was not read from a file.
    pub line: Option<usize>,
    /// Its number among the rows, from 0.
    pub row: usize,
}

/// Something seen on the way; the report has the words.
#[derive(Clone, Debug, PartialEq)]
pub enum Note {
    /// The mission's own readout is too coarse, and a finer one is used.
    CoarseReadout {
        /// How far it is off at most, in sigma.
        shift_sigma: f64,
    },
    /// An effect explains little, and moves the date at which the budget is exceeded far.
    MovesTheDate {
        /// The effect.
        effect: String,
        /// Share of the fall of chi2 that is its own.
        share: f64,
        /// By how many years the date moves; None where one of the two dates is not within the mission.
        years: Option<f64>,
    },
    /// An effect makes predictions at the ends of a condition's range worse than they were without it.
    DoesNotExtrapolate {
        /// The effect.
        effect: String,
        /// The condition.
        condition: String,
        /// rms of what is predicted beyond the other rows, in sigma, without and with it.
        beyond_rms_sigma: [f64; 2],
    },
    /// The final model is only good inside the range of a condition.
    TrustInside {
        /// The condition.
        condition: String,
        /// Its range in the data.
        range: [f64; 2],
        /// rms of what is predicted inside and beyond, in sigma.
        rms_sigma: [f64; 2],
    },
    /// A species of the mission has gone, and an additional one has come in its place.
    TakesItsPlace {
        /// The effect.
        effect: String,
        /// The key of the species that has gone.
        species: String,
    },
    /// An effect that would explain the pedestals of complete data: as simply as they do.
    InPlaceOfPedestals {
        /// The effect.
        effect: String,
        /// Files that would have no pedestal with it.
        files: Vec<String>,
        /// By how much chi2 would fall, pedestals counting as in the search.
        fall: f64,
    },
    /// A rival that is hardly worse than the adopted effect, and was set aside.
    SetAside {
        /// The rival.
        effect: String,
        /// The adopted effect.
        instead_of: String,
        /// By how much its chi2 is larger, and by how many parameters it has more.
        chi2: f64,
        /// Parameters that it has more.
        parameters: i64,
    },
}

/// One rung of the ladder: a model fitted to all rows.
#[derive(Clone, Debug)]
pub struct Rung {
    /// chi2.
    pub chi2: f64,
    /// Rows.
    pub n: usize,
    /// Free parameters.
    pub free: usize,
    /// Their values.
    pub parameters: Vec<Fitted>,
    /// rms of (value − model)/sigma over groups left out in turn; None where nothing can be left out.
    pub holdout_rms_sigma: Option<f64>,
    /// The same inside and at the ends of the range of each condition.
    pub carried: Vec<Carried>,
    /// When the budget is exceeded with this model; None where the mission's galaxies lose their shapes.
    pub budget: Option<evaluate::BudgetVerdict>,
}

impl Rung {
    /// rms of (value − model)/sigma.
    pub fn rms_sigma(&self) -> f64 {
        (self.chi2 / self.n as f64).sqrt()
    }
}

/// An effect that was added.
#[derive(Clone, Debug)]
pub struct Step {
    /// Its name: the kind, for a user's own with its number.
    pub effect: String,
    /// Its parameters with all effects added.
    pub parameters: Vec<Fitted>,
    /// Dotted key of its table in the improved mission.
    pub key: String,
    /// The model with it and those before it.
    pub rung: Rung,
    /// Chance that noise alone looks as good, over everything that was tried.
    pub false_alarm: f64,
}

/// An effect that was tried on top of the mission's own model.
#[derive(Clone, Debug)]
pub struct Tried {
    /// Its name.
    pub effect: String,
    /// chi2 with it alone; None where it changes nothing that the free parameters do not absorb.
    pub chi2: Option<f64>,
}

/// A condition or covariate that residuals trend on.
#[derive(Clone, Debug, Serialize)]
pub struct Covariate {
    /// Its name.
    pub name: String,
    /// Chance that noise alone trends as much on anything.
    pub false_alarm: f64,
}

/// An effect that would describe what residuals trend on. It says nothing of the cause.
#[derive(Clone, Debug)]
pub struct Suggestion {
    /// `[effects.formula]`, ready for a mission or for `--candidates`.
    pub toml: String,
    /// chi2 before, and with it to first order.
    pub chi2: [f64; 2],
}

/// A measurement that separates rivals.
#[derive(Clone, Debug)]
pub struct Next {
    /// What to measure.
    pub observable: Observable,
    /// Under which conditions, by name; those that the observable uses.
    pub conditions: Vec<(String, f64)>,
    /// The galaxy, of a change of shape.
    pub galaxy: Option<String>,
    /// The effects that it separates.
    pub separates: [String; 2],
    /// How far apart their predictions are, in units of the error of the measurement and of the fits.
    pub apart_sigma: f64,
    /// The error assumed, in the observable's unit.
    pub sigma: f64,
}

/// A detection limit.
#[derive(Clone, Debug)]
pub struct Limit {
    /// The effect.
    pub effect: String,
    /// Its table at the limit; None where no strength would have been seen.
    pub table: Option<toml::Table>,
    /// The parameter that measures its strength; empty for an effect that has none.
    pub parameter: String,
}

/// Everything that a diagnosis found.
#[derive(Clone, Debug)]
pub struct Diagnosis {
    /// The mission as given.
    pub mission: Mission,
    /// The mission with fitted values and added effects.
    pub improved: Mission,
    /// Keys that were free from the start, with their values in the improved mission.
    pub parameters: Vec<Fitted>,
    /// What came of it.
    pub verdict: Verdict,
    /// Why the data cannot carry a verdict, or what is the matter with the model.
    pub reason: Reason,
    /// The mission's own model, fitted.
    pub baseline: Rung,
    /// Effects added, best first.
    pub steps: Vec<Step>,
    /// Everything that was tried on top of the mission's own model, least chi2 first.
    pub tried: Vec<Tried>,
    /// Sets of effects that explain the data as well, the adopted one first.
    pub alternatives: Vec<Vec<String>>,
    /// What residuals trend on, the most significant first.
    pub covariates: Vec<Covariate>,
    /// A formula that describes what is left, where something is.
    pub suggestion: Option<Suggestion>,
    /// The measurement that would tell rivals apart.
    pub next: Option<Next>,
    /// What the data would have shown, where nothing is missing.
    pub limits: Vec<Limit>,
    /// The column whose groups were left out.
    pub held_out: Option<String>,
    /// The errors of each file as the search saw them.
    pub noise: Vec<SetNoise>,
    /// What is said under assumptions that are as good.
    pub stability: Stability,
    /// Things seen on the way.
    pub notes: Vec<Note>,
    /// Evaluations of the model at all rows that the search made, and after how many it begins no further step.
    pub evaluations: [u64; 2],
    /// Steps of the search that were left undone for that.
    pub undone: Vec<String>,
    /// The mission as given against the data, after the fit of what is free.
    pub before: Validation,
    /// The improved mission against the data.
    pub after: Validation,
    /// What the data do not determine of the values of the improved mission.
    pub advice: Vec<Advice>,
}

impl Diagnosis {
    /// The same with what is told of each file at another place.
    pub(super) fn with_files_at(mut self, places: &[usize]) -> Diagnosis {
        fn put<T>(all: &mut Vec<T>, places: &[usize]) {
            let mut placed: Vec<(usize, T)> = places.iter().copied().zip(all.drain(..)).collect();
            placed.sort_by_key(|(place, _)| *place);
            all.extend(placed.into_iter().map(|(_, one)| one));
        }
        put(&mut self.noise, places);
        put(&mut self.before.sets, places);
        put(&mut self.after.sets, places);
        self
    }

    /// The tables of effects that differ from those of the mission as given, by kind.
    pub fn added_effects(&self) -> toml::Table {
        let known = &self.mission.effects;
        let new = self.steps.iter().map(|step| step.key.split('.').nth(1).expect("effects.KIND"));
        let mut added = toml::Table::new();
        for kind in new.chain(known.keys().map(String::as_str)) {
            if self.improved.effects.get(kind) != known.get(kind) {
                added.insert(kind.into(), self.improved.effects[kind].clone());
            }
        }
        added
    }

    /// The same as TOML, to six digits.
    pub fn toml(&self) -> String {
        fn rounded(value: &mut toml::Value) {
            match value {
                toml::Value::Float(number) => *number = format!("{number:.5e}").parse().expect("a number"),
                toml::Value::Array(members) => members.iter_mut().for_each(rounded),
                toml::Value::Table(members) => members.iter_mut().for_each(|(_, member)| rounded(member)),
                _ => {}
            }
        }
        let mut effects = toml::Value::Table(self.added_effects());
        rounded(&mut effects);
        let effects = toml::Table::from_iter([("effects".to_string(), effects)]);
        toml::to_string(&effects).expect("tables of numbers and words")
    }

    /// The text of the mission's file with what was found.
    pub fn improved_text(&self, text: &str) -> String {
        let settings: Vec<(String, toml::Value)> =
            self.parameters.iter().map(|fitted| (fitted.key.clone(), fitted.value.into())).collect();
        let own = settings.into_iter().filter(|(key, _)| !key.starts_with("effects.")).collect::<Vec<_>>();
        let text = crate::mission_file::edit(text, &self.mission, &own);
        crate::mission_file::with_effects(&text, &self.added_effects(), "found by `ctiplan diagnose`")
    }
}
