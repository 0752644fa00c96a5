//! The result of a diagnosis.

use serde::Serialize;

use super::holdout::Carried;
use super::ranking::Ranking;
use super::stability::Stability;
use crate::analysis::fit::{Advice, Fitted};
use crate::analysis::noise::SetNoise;
use crate::analysis::validate::Validation;
use crate::mission::Mission;
use crate::physics::observable::Observable;
use crate::plan::evaluate;

/// The verdict of a diagnosis.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Verdict {
    /// The model explains the data.
    Complete,
    /// Effects were missing; with them the model explains the data.
    Missing,
    /// The same, but some effect has rivals that these data cannot distinguish from it.
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

/// The reason for a verdict; the report has the wording.
#[derive(Clone, Debug, PartialEq)]
pub enum Reason {
    /// Complete: the model explains the data.
    Explained,
    /// Missing or ambiguous: effects explain the data.
    Lacking {
        /// The effects.
        effects: Vec<String>,
        /// Whether the data allow others in their place.
        has_rivals: bool,
    },
    /// An effect explains constants in several files with fewer parameters.
    LackingOrPedestals {
        /// The effect.
        effect: String,
        /// Files that need no constant with it.
        files: Vec<String>,
        /// Whether the constants are most of the values.
        are_most: bool,
    },
    /// Effects explain with the errors as quoted what is otherwise larger or correlated errors of a file.
    LackingOrErrors {
        /// The effects.
        effects: Vec<String>,
        /// The file.
        file: String,
    },
    /// Unexplained.
    Unexplained {
        /// Steps of the search that were left undone.
        undone: Vec<String>,
    },
    /// Unexplained: a law of the measurement itself explains the data better than effects.
    BetterLaw {
        /// What it changes: `value`, or `value.OBSERVABLE`.
        target: String,
        /// Its new value.
        expression: String,
        /// Effects beside it.
        beside: Vec<String>,
    },
    /// Unexplained: another value of a number of the mission explains the data better than effects.
    WrongNumber {
        /// Its key.
        key: String,
        /// Its value in the mission.
        given: String,
        /// The value that explains the data.
        right: String,
        /// Effects beside it.
        beside: Vec<String>,
    },
    /// Unfit: fewer rows than unknowns.
    TooFewRows {
        /// Rows.
        n: usize,
        /// Free parameters.
        free: usize,
    },
    /// Unfit: duplicate rows.
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
        /// Their difference, in units of their errors.
        apart_sigma: f64,
    },
    /// Unfit: quoted errors that are larger than the scatter.
    LargeErrors {
        /// The file.
        file: String,
        /// Ratio to the scatter, rounded to a tenth.
        factor: f64,
    },
    /// Unfit: quoted errors that are smaller than a scatter without a trend.
    SmallErrors {
        /// The file.
        file: String,
        /// Ratio of the scatter to them.
        factor: f64,
    },
}

/// A row of a measurement file.
#[derive(Clone, Debug, PartialEq)]
pub struct RowPlace {
    /// The file as given.
    pub file: String,
    /// Its line in that file, from 1; None for a table that was not read from a file.
    pub line: Option<usize>,
    /// Its index among the rows, from 0.
    pub row: usize,
}

/// A warning or remark; the report has the wording.
#[derive(Clone, Debug, PartialEq)]
pub enum Note {
    /// An event between two epochs between which a recorded condition changed as well.
    CoincidesWith {
        /// The effect, or the step of a law.
        what: String,
        /// The condition.
        condition: String,
        /// Its values or words before and after.
        values: [String; 2],
        /// The epochs, years since launch.
        between_yr: [f64; 2],
    },
    /// At one temperature, another temperature is another release time.
    SameAsReleaseTime {
        /// The effect.
        effect: String,
        /// Dotted keys of release times that are not free.
        keys: Vec<String>,
    },
    /// The mission's own readout is too coarse; a finer one is used.
    CoarseReadout {
        /// Its largest error, sigma.
        shift_sigma: f64,
    },
    /// An effect explains little, but moves the date at which the budget is exceeded far.
    MovesTheDate {
        /// The effect.
        effect: String,
        /// Its share of the decrease of chi2.
        share: f64,
        /// Shift of the date, years; None if either date is not within the mission.
        years: Option<f64>,
    },
    /// An effect worsens predictions at the ends of a condition's range.
    DoesNotExtrapolate {
        /// The effect.
        effect: String,
        /// The condition.
        condition: String,
        /// rms of (value − model)/sigma of groups left out at the ends of the range, without and with it.
        beyond_rms_sigma: [f64; 2],
    },
    /// The final model predicts well only inside the range of a condition.
    TrustInside {
        /// The condition.
        condition: String,
        /// Its range in the data.
        range: [f64; 2],
        /// rms of (value − model)/sigma of groups left out inside the range and at its ends.
        rms_sigma: [f64; 2],
    },
    /// A cycle of which the data show less than a period.
    PartOfAPeriod {
        /// The effect.
        effect: String,
        /// Its period, years.
        period_yr: f64,
        /// The years that the data span.
        span_yr: f64,
    },
    /// The best combination of effects, of data that none explains.
    Nearest {
        /// The effects.
        effects: Vec<String>,
        /// chi2 without and with them.
        chi2: [f64; 2],
        /// Rows.
        n: usize,
    },
    /// Further effects in the place of errors that are not as quoted, or of rows that are wrong.
    IfErrorsAreRight {
        /// The effects.
        effects: Vec<String>,
        /// Excess of their −2 ln Z over that with such errors.
        excess: f64,
    },
    /// Another value of a number of the mission explains the data about as well as what is named.
    MayBeANumber {
        /// Its key.
        key: String,
        /// Its value in the mission.
        given: String,
        /// The value that explains the data.
        right: String,
    },
    /// No effect of any strength would have been detected.
    NothingDetectable,
    /// A cycle whose period evenly spaced epochs do not distinguish from others.
    OtherPeriods {
        /// The effect.
        effect: String,
        /// Its period, years.
        period_yr: f64,
        /// The others, years.
        others_yr: Vec<f64>,
        /// The spacing of the epochs, years.
        spacing_yr: f64,
    },
    /// The density of a species of the mission vanished, and an additional species took its place.
    TakesItsPlace {
        /// The effect.
        effect: String,
        /// The key of the species that vanished.
        species: String,
    },
    /// A temperature of its own for every epoch explains what no effect does.
    EpochTemperatures {
        /// Number of epochs.
        epochs: usize,
        /// Lowest and highest difference from the temperature assumed, K.
        range_k: [f64; 2],
        /// chi2 of the mission's model, without and with them.
        chi2: [f64; 2],
        /// Number of rows.
        n: usize,
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
    /// rms of (value − model)/sigma over groups left out in turn; None if nothing can be left out.
    pub holdout_rms_sigma: Option<f64>,
    /// The same inside and at the ends of the range of each condition.
    pub carried: Vec<Carried>,
    /// When the budget is exceeded with this model; None if the mission's galaxies have no measurable shapes.
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
    /// Its name: the kind, with a number for the user's own.
    pub effect: String,
    /// Its parameters in the final model.
    pub parameters: Vec<Fitted>,
    /// Dotted key of its table in the improved mission.
    pub key: String,
    /// The fit of the model with this effect and those before it.
    pub rung: Rung,
    /// False-alarm probability: that noise alone looks as good, over everything that was tried.
    pub false_alarm: f64,
}

/// An effect that was tried on top of the mission's own model.
#[derive(Clone, Debug)]
pub struct Tried {
    /// Its name.
    pub effect: String,
    /// chi2 with it alone; None if the free parameters absorb all that it changes.
    pub chi2: Option<f64>,
}

/// A condition or covariate with a residual trend.
#[derive(Clone, Debug, Serialize)]
pub struct Covariate {
    /// Its name.
    pub name: String,
    /// Probability that noise alone gives such a trend with any condition.
    pub false_alarm: f64,
}

/// An effect that would describe the residual trend. It says nothing about the cause.
#[derive(Clone, Debug)]
pub struct Suggestion {
    /// `[effects.formula]`, ready for a mission or for `--candidates`.
    pub toml: String,
    /// chi2 before, and with it: to first order, or fitted.
    pub chi2: [f64; 2],
    /// Whether it is a law of the measurement that explains all data better than any effect, nearly to their errors.
    pub is_law: bool,
    /// Whether it was fitted with the free parameters and constant offsets of the files; else to first order, without offsets.
    pub is_fitted: bool,
    /// Time of a step, years since launch.
    pub step_yr: Option<f64>,
}

/// A measurement that distinguishes rivals.
#[derive(Clone, Debug)]
pub struct Next {
    /// What to measure.
    pub observable: Observable,
    /// Under which conditions, by name; those that the observable uses.
    pub conditions: Vec<(String, f64)>,
    /// The galaxy, of a change of shape.
    pub galaxy: Option<String>,
    /// The effects that it distinguishes.
    pub separates: [String; 2],
    /// Difference of their predictions, in units of the error of the measurement and of the fits.
    pub apart_sigma: f64,
    /// The assumed error, in the observable's unit.
    pub sigma: f64,
}

/// A detection limit.
#[derive(Clone, Debug)]
pub struct Limit {
    /// The effect.
    pub effect: String,
    /// Its table at the limit; None if no strength would be detected.
    pub table: Option<toml::Table>,
    /// The parameter that measures its strength; empty if it has none.
    pub parameter: String,
    /// Whether larger values of the parameter are stronger effects.
    pub increases: bool,
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
    /// The verdict.
    pub verdict: Verdict,
    /// The reason for the verdict.
    pub reason: Reason,
    /// The mission's own model, fitted.
    pub baseline: Rung,
    /// Effects added, best first.
    pub steps: Vec<Step>,
    /// Sets of effects by their evidence; None if the data cannot carry a verdict.
    pub ranking: Option<Ranking>,
    /// All effects tried on top of the mission's own model, lowest chi2 first.
    pub tried: Vec<Tried>,
    /// Sets of effects that explain the data equally well, the adopted one first.
    pub alternatives: Vec<Vec<String>>,
    /// Residual trends, the most significant first.
    pub covariates: Vec<Covariate>,
    /// A formula that describes the remaining residuals, if there is a trend.
    pub suggestion: Option<Suggestion>,
    /// The measurement that would distinguish the rivals.
    pub next: Option<Next>,
    /// What the data would have shown, if nothing is missing.
    pub limits: Vec<Limit>,
    /// The column whose groups were left out, and the number of rows in them.
    pub held_out: Option<(String, usize)>,
    /// The errors of each file as used in the search.
    pub noise: Vec<SetNoise>,
    /// The verdict under equally plausible assumptions.
    pub stability: Stability,
    /// Warnings and remarks.
    pub notes: Vec<Note>,
    /// Evaluations of the model at all rows made by the search, and the number after which it begins no further step.
    pub evaluations: [u64; 2],
    /// Steps of the search omitted because of this limit.
    pub undone: Vec<String>,
    /// The mission as given compared with the data, after the fit of the free parameters.
    pub before: Validation,
    /// The improved mission compared with the data.
    pub after: Validation,
    /// Values of the improved mission that the data do not determine.
    pub advice: Vec<Advice>,
}

impl Diagnosis {
    /// The same with the results of each file reordered.
    pub(super) fn with_files_at(mut self, places: &[usize]) -> Diagnosis {
        fn put<T>(all: &mut Vec<T>, places: &[usize]) {
            let mut placed: Vec<(usize, T)> = places.iter().copied().zip(all.drain(..)).collect();
            placed.sort_by_key(|(place, _)| *place);
            all.extend(placed.into_iter().map(|(_, one)| one));
        }
        put(&mut self.noise, places);
        self.ranking.iter_mut().flat_map(|ranking| &mut ranking.sets).for_each(|set| put(&mut set.noise, places));
        for validation in [&mut self.before, &mut self.after] {
            put(&mut validation.sets, places);
            validation.trends.iter_mut().for_each(|trend| trend.set = places[trend.set]);
            validation.independence.tests.iter_mut().for_each(|test| test.set = places[test.set]);
            validation.findings.iter_mut().for_each(|finding| finding.set = places[finding.set]);
        }
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

    /// The text of the mission's file with the values found.
    pub fn improved_text(&self, text: &str) -> String {
        let settings: Vec<(String, toml::Value)> =
            self.parameters.iter().map(|fitted| (fitted.key.clone(), fitted.value.into())).collect();
        let own = settings.into_iter().filter(|(key, _)| !key.starts_with("effects.")).collect::<Vec<_>>();
        let text = crate::mission_file::edit(text, &self.mission, &own);
        crate::mission_file::with_effects(&text, &self.added_effects(), "found by `ctiplan diagnose`")
    }
}
