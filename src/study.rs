//! Trade studies: a mission → what a team decides on.
//!
//! Each study asks one question of the section on future missions of Rhodes et al. 2010 (PASP 122, 439), and answers it for the
//! galaxy that the mission's requirement judges: with tables, with figures, and in words that are derived from the numbers.
//!
//! A study is a file with a type that implements [`Kind`]; the command line lists it in one line (`cli/study.rs`).

pub mod charge_injection;
pub mod clock;
pub mod correction;
pub mod distance;
pub mod error_budget;
mod estimate;
pub mod launch;
pub mod pocket_pumping;
pub mod preflash;
pub mod shielding;
mod signal;

use chrono::NaiveDate;
use clap::Args;
use serde_json::{Map, Value};

use crate::error::InputError;
use crate::mission::keys::plain;
use crate::mission::{Fit, Mission};
use crate::mission_file::lookup;
use crate::model::Model;
use crate::physics::accuracy::Purpose;
use crate::plan::evaluate::unmeasurable;
use crate::plan::scenario::Axis;
use crate::plan::sources::Source;
use crate::report::plot::{Figure, level, line};
use crate::warning::Warning;

pub use estimate::Estimate;
use signal::left_out;
pub use signal::{Aperture, Exposure};

/// A question that can be asked of a mission; its fields are the options of its command.
pub trait Kind: Args + Clone {
    /// The same for a mission in which these keys were set on purpose, beside what its file says.
    fn with_keys_set(self, _keys: &[&str]) -> Self {
        self
    }

    /// Answers it; `advance` is called whenever a part is done.
    ///
    /// # Errors
    /// Where an option makes no sense for the mission, or its judged galaxy has no measurable shape.
    fn study(&self, mission: &Mission, advance: &(dyn Fn() + Sync)) -> Result<Study, InputError>;
}

/// The options of a study as its command has them by default.
pub fn defaults<K: Kind>() -> K {
    let command = K::augment_args(clap::Command::new("study"));
    let matches = command.get_matches_from(["study"]);
    K::from_arg_matches(&matches).expect("a study whose options all have defaults")
}

/// What a study found.
#[derive(Clone, Debug, Default)]
pub struct Study {
    /// Name of the study, as on the command line.
    pub name: &'static str,
    /// Name of the mission.
    pub mission: String,
    /// What is studied, in a sentence.
    pub title: String,
    /// Tables; the first is the one that makes the CSV.
    pub tables: Vec<Table>,
    /// Single numbers, by names that end in their unit.
    pub results: Map<String, Value>,
    /// What follows from them, in sentences.
    pub findings: Vec<String>,
    /// Things seen that are not errors.
    pub warnings: Vec<Warning>,
    /// Figures with the names of their files.
    pub figures: Vec<(String, Figure)>,
    /// Where the models are from that are the study's own.
    pub sources: Vec<Source>,
}

/// Rows of one kind.
#[derive(Clone, Debug, Default)]
pub struct Table {
    /// Its key in JSON.
    pub name: &'static str,
    /// What it shows, in words; may be empty.
    pub title: String,
    /// What stands in the rows.
    pub columns: Vec<Column>,
    /// As many cells as columns.
    pub rows: Vec<Vec<Cell>>,
    /// Whether it is for programs alone: too long to be read.
    pub programs_only: bool,
}

/// What stands in one place of the rows.
#[derive(Clone, Debug)]
pub struct Column {
    /// Key with its unit, for programs.
    pub key: String,
    /// Name with its unit, for people; a column without one is for programs alone.
    pub head: String,
    /// How numbers are shown to people.
    pub digits: Digits,
    /// Key of the standard errors, where its numbers are estimated from draws.
    pub error_key: Option<String>,
}

impl Column {
    /// The same with numbers that are estimated from draws, whose errors have a key of their own.
    fn with_error(self, key: impl Into<String>) -> Column {
        Column { error_key: Some(key.into()), ..self }
    }
}

/// How a number is shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Digits {
    /// So many decimals.
    Fixed(usize),
    /// So many decimals and an exponent.
    Scientific(usize),
    /// So many digits in all, without an exponent where that is readable.
    Significant(usize),
}

/// One value.
#[derive(Clone, Debug, PartialEq)]
pub enum Cell {
    /// A number in the column's unit; one that is not finite counts as none.
    Number(f64),
    /// A number that is estimated from draws.
    Estimate(Estimate),
    /// A day that is estimated from draws, with its standard error in days where that is known.
    Date(NaiveDate, Option<f64>),
    /// Words, or a date.
    Words(String),
    /// There is no such value.
    None,
}

impl Cell {
    /// The value, for programs.
    pub fn value(&self) -> Value {
        match self {
            Cell::Number(number) | Cell::Estimate(Estimate { value: number, .. }) => (*number).into(),
            Cell::Date(date, _) => date.to_string().into(),
            Cell::Words(words) => words.clone().into(),
            Cell::None => Value::Null,
        }
    }

    /// Its standard error, where it is estimated from draws.
    pub fn error(&self) -> Option<f64> {
        match self {
            Cell::Estimate(Estimate { error, .. }) => Some(*error),
            Cell::Date(_, error_d) => *error_d,
            _ => None,
        }
    }
}

impl From<f64> for Cell {
    fn from(number: f64) -> Cell {
        if number.is_finite() { Cell::Number(number) } else { Cell::None }
    }
}

impl From<Option<f64>> for Cell {
    fn from(number: Option<f64>) -> Cell {
        number.map_or(Cell::None, Cell::from)
    }
}

impl From<Estimate> for Cell {
    fn from(estimate: Estimate) -> Cell {
        if estimate.value.is_finite() { Cell::Estimate(estimate) } else { Cell::None }
    }
}

impl From<String> for Cell {
    fn from(words: String) -> Cell {
        Cell::Words(words)
    }
}

impl From<&str> for Cell {
    fn from(words: &str) -> Cell {
        Cell::Words(words.into())
    }
}

/// A column.
fn column(key: impl Into<String>, head: impl Into<String>, digits: Digits) -> Column {
    Column { key: key.into(), head: head.into(), digits, error_key: None }
}

impl Study {
    /// An empty answer.
    fn of(name: &'static str, mission: &Mission, title: String) -> Study {
        let warnings = Model::new(mission).history().warnings(mission.mission.duration_yr);
        Study { name, mission: mission.mission.name.clone(), title, warnings, ..Study::default() }
    }

    /// Adds a number to the results.
    fn result(&mut self, key: &str, value: impl Into<Value>) {
        self.results.insert(key.into(), value.into());
    }

    /// Says where a model is from.
    fn cite(&mut self, model: &str, from: &str) {
        self.sources.push(Source::new(model, from));
    }

    /// Adds a sentence to the findings.
    fn find(&mut self, words: impl Into<String>) {
        self.findings.push(words.into());
    }
}

/// The mission as studies look at it: its judged galaxy alone, read out as accurately as differences between choices need.
fn judged(mission: &Mission) -> Mission {
    let mission = Purpose::ManyShapes.of(mission);
    Mission { galaxies: vec![mission.judged_galaxy().clone()], fit: Fit::default(), ..mission }
}

/// A model of the mission as studies look at it.
///
/// # Errors
/// Where its galaxy has no measurable shape before the readout.
fn ready(mission: &Mission) -> Result<Model, InputError> {
    let model = Model::new(&judged(mission));
    if model.scene(0).is_none() {
        return Err(unmeasurable(mission, mission.judged_galaxy()));
    }
    Ok(model)
}

/// Numbers of an option, read as those of a key of the mission.
fn numbers(key: &str, text: &str) -> Result<Vec<f64>, InputError> {
    let numbers: Vec<f64> = Axis::parse(key, text)?
        .values
        .iter()
        .filter_map(|value| value.as_float().or(value.as_integer().map(|whole| whole as f64)))
        .collect();
    let kind = lookup::find(key).expect("a key of the mission");
    match numbers.iter().find(|number| kind.kind.refuses(**number)) {
        None => Ok(numbers),
        Some(number) => {
            let problem = format!("the {} is {number}; allowed: {}", kind.what, kind.kind.allowed(kind.unit));
            let error = InputError::new(format!("cannot use the values `{text}`"), problem);
            Err(match (kind.help)(*number) {
                Some(help) => error.with_help(help),
                None => error,
            })
        }
    }
}

/// `first` to `last` in so many equal ratios.
fn ratios(first: f64, last: f64, count: usize) -> Vec<f64> {
    (0..count).map(|index| first * (last / first).powf(index as f64 / (count - 1) as f64)).collect()
}

/// A number with four digits, as people write it.
fn short(number: f64) -> String {
    plain(format!("{number:.3e}").parse().expect("a number that was printed"))
}

/// A date that is known to so many days (1 sigma), to the unit that they leave: a day, a month, or a year.
pub(crate) fn known_date(date: NaiveDate, error_d: Option<f64>) -> String {
    let format = match error_d {
        Some(error_d) if error_d < 0.5 * MONTH_D => "%Y-%m-%d",
        Some(error_d) if error_d < 6.0 * MONTH_D => "%Y-%m",
        _ => "%Y",
    };
    date.format(format).to_string()
}

/// Days of a month.
const MONTH_D: f64 = 365.25 / 12.0;

/// An error in days, to one digit or two.
pub(crate) fn days(error_d: f64) -> String {
    let unit = if error_d < 100.0 { 1.0 } else { 10.0 };
    format!("+- {} d", (error_d / unit).ceil() * unit)
}

/// When the budget is exceeded, in words.
fn when(date: Option<NaiveDate>) -> String {
    date.map_or("not within the mission".into(), |date| date.to_string())
}
