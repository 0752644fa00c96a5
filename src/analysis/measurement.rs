//! A measurement file → rows of value, error and conditions.
//!
//! One file, one observable. Conditions are columns, or given once in `meta`, or those of the mission. Columns unknown to the model
//! are kept, so that residuals can also be tested against them.

mod common_errors;
mod condition_errors;
mod floor;
mod lookalike;
mod units;

use std::path::Path;

use crate::analysis::whitening::Shared;
use crate::error::{InputError, nearest};
use crate::io::table::{Cell, NotADate, Table, Time};
use crate::io::unit::Conversion;
use crate::mission::keys::Allowed::{self, Integer, Number, Positive};
use crate::mission::{Mission, keys};
use crate::mission_file::lookup;
use crate::model::predict::Question;
use crate::numeric::calendar::DAYS_PER_YEAR;
use crate::physics::conditions::{self, MIRRORED, Stated};
use crate::physics::observable::{Observable, Probe};
use crate::warning::Warning;
use common_errors::Common;
use units::Unit;

/// The rows of one measurement file.
#[derive(Clone, Debug)]
pub struct DataSet {
    /// The file as given.
    pub file: String,
    /// The measured quantity.
    pub observable: Observable,
    /// In the file's order.
    pub rows: Vec<Row>,
    /// Conditions and covariates that vary from row to row, by name, in the file's order.
    pub varying: Vec<String>,
    /// The file's table, with everything unknown to the model.
    pub table: Table,
    /// Common errors of its rows: none as read.
    pub shared: Shared,
    /// Conditions that are the mission's although the file has columns that look like them.
    pub warning: Option<Warning>,
}

/// One measurement.
#[derive(Clone, Debug)]
pub struct Row {
    /// The value, in the observable's unit.
    pub value: f64,
    /// Its 1-sigma error, including floors and errors of conditions.
    pub sigma: f64,
    /// The same without the errors of conditions.
    pub value_sigma: f64,
    /// The part of it that other rows have in common.
    pub common: Common,
    /// The part of it that is a floor of systematic errors, which the scatter of rows need not show.
    pub floor: f64,
    /// The adopted conditions; numeric columns unknown to the model are covariates.
    pub at: Stated,
    /// 1-sigma errors of conditions, by name, in the units of the conditions; independent from row to row. Only those given in the
    /// file as `sigma_CONDITION`.
    pub condition_sigmas: Vec<(&'static str, f64)>,
    /// The galaxy, by its index in the mission.
    pub galaxy: Option<usize>,
    /// Whether it is the galaxy that the mission judges, as the file names none.
    pub galaxy_is_judged: bool,
    /// The species of a trap density or of a dipole, by its index in the mission.
    pub species: Option<usize>,
    /// Text columns unknown to the model, and the galaxy: name and word.
    pub words: Vec<(String, String)>,
}

impl Row {
    /// The query to the model for this row.
    pub fn question(&self, observable: Observable) -> Question<'_, Stated> {
        let galaxy = self.galaxy.filter(|_| !self.galaxy_is_judged);
        Question { observable, at: &self.at, galaxy, species: self.species }
    }

    /// 1-sigma error without the part that other rows have in common.
    pub fn own_sigma(&self) -> f64 {
        (self.sigma * self.sigma - self.common.sigma * self.common.sigma).sqrt()
    }

    /// A word of the row, by the column's name.
    pub fn word(&self, name: &str) -> Option<&str> {
        self.words.iter().find(|(known, _)| known == name).map(|(_, word)| word.as_str())
    }
}

/// All queries of some data sets, in order.
pub fn questions(data: &[DataSet]) -> Vec<Question<'_, Stated>> {
    data.iter().flat_map(|set| set.rows.iter().map(|row| row.question(set.observable))).collect()
}

/// Data sets with the errors of their conditions derived at another mission.
///
/// # Errors
/// If the model has no value.
pub fn with_errors_at(mut data: Vec<DataSet>, mission: &Mission) -> Result<Vec<DataSet>, InputError> {
    for set in &mut data {
        condition_errors::add(&mut set.rows, set.observable, mission)?;
    }
    Ok(data)
}

/// Rejects data without rows.
pub(crate) fn some_rows(data: &[DataSet], refused: &str) -> Result<(), InputError> {
    if data.iter().all(|set| set.rows.is_empty()) {
        return Err(InputError::new(refused, "there are no measurements").with_help("give at least one data set"));
    }
    Ok(())
}

/// A condition that files may contain, with its unit and allowed values.
struct Known {
    name: &'static str,
    /// Usual names, in lower case without separators and units.
    words: &'static [&'static str],
    unit: Unit,
    kind: Allowed,
    help: fn(f64) -> Option<String>,
}

/// All numeric conditions.
fn known(name: &str) -> Option<Known> {
    let plain = |name, words, unit, kind| Known { name, words, unit, kind, help: |_| None };
    let as_key = |name, words, unit| {
        let (_, path) = MIRRORED.iter().find(|(mirrored, _)| *mirrored == name).expect("it mirrors a key");
        let key = lookup::find(path).expect("a key of the mission");
        Known { name, words, unit, kind: key.kind, help: key.help }
    };
    Some(match name {
        "t_yr" => plain("t_yr", TIME, Unit::Years, Number(0.0, 1000.0)),
        "dose_mev_g" => plain("dose_mev_g", &["dose", "ddd", "displacementdose"], Unit::Dose, Number(0.0, 1e15)),
        "temperature_k" => as_key("temperature_k", TEMPERATURE, Unit::Kelvin),
        "line_time_ms" => as_key("line_time_ms", LINE_TIME, Unit::Milliseconds),
        "background_e" => as_key("background_e", BACKGROUND, Unit::Electrons),
        "transfers" => as_key("transfers", TRANSFERS, Unit::Count),
        "signal_e" => plain("signal_e", &["signal", "charge", "packet"], Unit::Electrons, Positive(0.0, 1e9)),
        "signal_read_e" => plain("signal_read_e", &["signalread"], Unit::Electrons, Positive(0.0, 1e9)),
        "preceding_e" => plain("preceding_e", &["preceding"], Unit::Electrons, Number(0.0, 1e9)),
        "preceding_px" => plain("preceding_px", &["precedingrows"], Unit::Pixels, Integer(1, 100_000)),
        "trail_px" => plain("trail_px", &["trail", "trailpixel"], Unit::Pixels, Integer(1, 100_000)),
        "block_px" => plain("block_px", &["block", "blockrows", "blocklength"], Unit::Pixels, Integer(1, 100_000)),
        "first_px" => plain("first_px", &["firstpixel"], Unit::Pixels, Integer(1, 100_000)),
        "last_px" => plain("last_px", &["lastpixel"], Unit::Pixels, Integer(1, 100_000)),
        "phase_time_ms" => plain("phase_time_ms", &["phasetime", "tph"], Unit::Milliseconds, Positive(0.0, 1e9)),
        "pumping_cycles" => plain("pumping_cycles", &["cycles", "pumps"], Unit::Count, Positive(0.0, 1e9)),
        _ => return None,
    })
}

const TIME: &[&str] = &["time", "t", "year", "years", "epoch", "day", "days", "elapsedtime", "missiontime"];
const TEMPERATURE: &[&str] =
    &["temperature", "temp", "tk", "tempk", "tccd", "tccdk", "tdet", "ccdtemp", "dettemp", "kelvin"];
const LINE_TIME: &[&str] =
    &["linetime", "rowtime", "lineperiod", "rowperiod", "transfertime", "shifttime", "clocktime", "tline"];
const BACKGROUND: &[&str] = &["background", "bkg", "bkgd", "bg", "sky", "skybackground", "skylevel", "fatzero"];
const TRANSFERS: &[&str] =
    &["transfers", "transfer", "trans", "ntrans", "shifts", "paralleltransfers", "rowstoregister"];

/// Usual names of the galaxy of a row.
const fn names_of_galaxy() -> &'static [&'static str] {
    &["galaxy", "galaxies", "gal", "galaxyname", "object", "objectname", "source"]
}

/// Whether a column or a member of `meta` is neither a condition nor anything else that is read.
fn is_unknown(name: &str) -> bool {
    !OTHERS.contains(&name) && known(name).is_none() && condition_of_sigma(name).is_none()
}

/// Other names for a time, in days.
const DAYS: [&str; 3] = ["date", "mjd", "jd"];

/// What a row needs whose traps depend on the dose alone.
const TIME_OR_DOSE: &str = "t_yr or dose_mev_g";

/// Names of the sides of an error.
const SIDES: [&str; 8] = ["plus", "minus", "upper", "lower", "up", "low", "hi", "lo"];

/// The condition whose error is in a column of this name.
fn condition_of_sigma(name: &str) -> Option<&'static str> {
    let condition = name.strip_prefix(SIGMA_OF)?;
    if DAYS.contains(&condition) {
        return Some("t_yr");
    }
    conditions::NAMES.into_iter().find(|known| *known == condition)
}

/// Difference in days below which two times of a row are the same.
const SAME_TIME_D: f64 = 2.0;

/// Prefix of a condition's name for its 1-sigma error.
const SIGMA_OF: &str = "sigma_";

/// A condition of another name, of which this one is a misspelling: one letter is wrong, missing, additional, or two are swapped,
/// or the unit of `signal_read_e` or `preceding_e` is missing. Case does not matter; of `date`, with many neighbours (`rate`,
/// `gate`, `data`), only other cases are misspellings.
fn slip_of(name: &str) -> Option<&'static str> {
    if conditions::NAMES.contains(&name) || OTHERS.contains(&name) {
        return None;
    }
    let allowed = |condition: &str| if condition == "date" { 0 } else { 1 };
    let like = |condition: &&str| {
        let name = name.to_lowercase();
        let without_unit =
            ["signal_read", "preceding"].contains(&name.as_str()) && condition.strip_suffix("_e") == Some(&name);
        without_unit || strsim::damerau_levenshtein(&name, condition) <= allowed(condition)
    };
    // An additional or missing letter is likelier than a wrong one.
    let letters_apart = |condition: &&str| condition.len().abs_diff(name.len());
    conditions::NAMES
        .into_iter()
        .chain(["galaxy", "date", common_errors::GROUP])
        .rev()
        .filter(like)
        .max_by_key(letters_apart)
}

/// Columns that are neither conditions nor covariates.
const OTHERS: [&str; 9] =
    ["value", "sigma", common_errors::SIGMA, common_errors::GROUP, "floor", "galaxy", "date", "mjd", "jd"];

impl DataSet {
    /// Reads a measurement file, ECSV or CSV, for a mission.
    ///
    /// # Errors
    /// If the file cannot be read, or its content is invalid for the mission: one message with line, column, value and the allowed
    /// range.
    pub fn read(path: impl AsRef<Path>, mission: &Mission) -> Result<DataSet, InputError> {
        DataSet::of(Table::read(path)?, mission)
    }

    /// Interprets a table as measurements.
    ///
    /// # Errors
    /// As [`DataSet::read`].
    pub fn of(table: Table, mission: &Mission) -> Result<DataSet, InputError> {
        let observable = observable(&table)?;
        let reader = Reader { table: &table, mission, observable };
        if table.rows() == 0 {
            return Err(table.fault(None, None, "there are no rows"));
        }
        reader.check_names()?;
        reader.check_sigma_unit()?;
        let mut rows = (0..table.rows()).map(|row| reader.row(row)).collect::<Result<Vec<_>, _>>()?;
        for (row, common) in reader.common_errors(&rows)?.into_iter().enumerate() {
            rows[row].common = common;
        }
        condition_errors::add(&mut rows, observable, mission)?;
        let varying = varying(&table, &rows);
        let (file, shared) = (table.name.clone(), Shared::default());
        let set = DataSet { file, observable, rows, varying, table, shared, warning: None };
        Ok(DataSet { warning: set.lookalikes(mission), ..set })
    }

    /// Whether conditions of rows have errors.
    pub fn has_condition_errors(&self) -> bool {
        self.rows.iter().any(|row| !row.condition_sigmas.is_empty())
    }

    /// Whether rows have known errors in common.
    pub fn has_common_errors(&self) -> bool {
        self.rows.iter().any(|row| row.common.sigma > 0.0)
    }

    /// A condition, covariate or text column of every row, as numbers; NaN if a row has none. Words are numbered in order of
    /// appearance.
    pub fn against(&self, name: &str) -> Vec<f64> {
        let mut words: Vec<&str> = Vec::new();
        let mut values = Vec::with_capacity(self.rows.len());
        for row in &self.rows {
            values.push(match row.word(name) {
                None => row.at.get(name).unwrap_or(f64::NAN),
                Some(word) => {
                    let place = words.iter().position(|known| *known == word).unwrap_or(words.len());
                    if place == words.len() {
                        words.push(word);
                    }
                    place as f64
                }
            });
        }
        values
    }

    /// Whether a condition or covariate differs between rows.
    pub fn varies_in(&self, name: &str) -> bool {
        self.varying.iter().any(|varying| varying == name)
    }

    /// Whether a varying column contains words.
    pub fn is_words(&self, name: &str) -> bool {
        self.rows.iter().any(|row| row.word(name).is_some())
    }
}

fn observable(table: &Table) -> Result<Observable, InputError> {
    let names = || Observable::ALL.iter().map(|observable| observable.name());
    let listed = || names().collect::<Vec<_>>().join(", ");
    let Some(said) = table.meta("observable") else {
        let help = if table.meta("meta").is_some() {
            "`# meta: {...}` belongs to ECSV, whose first line is `# %ECSV 1.0`; in CSV write a line `# observable: trail`"
        } else {
            "write it into the header: `t.meta[\"observable\"] = \"trail\"` in astropy, `# observable: trail` in CSV"
        };
        return Err(table
            .fault(None, None, format!("meta.observable is missing: one of {}", listed()))
            .with_help(help));
    };
    let said = said.text().map_or_else(|| said.to_string(), str::to_string);
    Observable::named(&said).ok_or_else(|| {
        let fault = table.fault(
            None,
            Some("meta.observable"),
            format!("no observable is called \"{said}\"; there are: {}", listed()),
        );
        match nearest(&said, names()) {
            _ if said.eq_ignore_ascii_case("cte") => fault.with_help("give `cti`, with values of 1 - cte"),
            Some(near) => fault.with_help(format!("did you mean \"{near}\"?")),
            None => fault,
        }
    })
}

/// Reads rows of one table.
struct Reader<'a> {
    table: &'a Table,
    mission: &'a Mission,
    observable: Observable,
}

impl Reader<'_> {
    /// Checks that no column or number of `meta` is a misspelt condition: as a covariate it would leave the condition to the
    /// mission.
    fn check_names(&self) -> Result<(), InputError> {
        let columns = self.table.columns.iter().map(|column| (&column.name, column.name.clone()));
        let numbers = self.table.meta.iter().filter(|meta| meta.value.quantity().is_some());
        let numbers = numbers.map(|meta| (&meta.name, format!("meta.{}", meta.name)));
        for (name, place) in columns.chain(numbers) {
            self.check_sigma_of(name, &place)?;
            if let Some(condition) = slip_of(name) {
                let problem = format!("`{name}` is not a condition, and resembles `{condition}`");
                let help = format!("write `{condition}`, or give a covariate a name that is less similar");
                return Err(self.table.fault(None, Some(&place), problem).with_help(help));
            }
        }
        Ok(())
    }

    /// Checks that an error has a unit if its value is in a unit that is converted: otherwise it is ambiguous.
    fn check_sigma_unit(&self) -> Result<(), InputError> {
        let unit = |name: &str| self.table.column(name).map(|column| column.unit.as_deref().unwrap_or(""));
        let ours = ["sigma", common_errors::SIGMA].into_iter().find(|name| unit(name) == Some(""));
        let (Some(of_value), Some(name)) = (unit("value"), ours) else { return Ok(()) };
        let conversion = self.table.conversion("value", Unit::of(self.observable).ours())?;
        if conversion == Conversion::default() {
            return Ok(());
        }
        let problem = format!("value is in {of_value}, and {name} has no unit");
        Err(self.table.fault(None, Some(name), problem).with_help(format!("give {name} the unit that it is in")))
    }

    /// Checks that the name of an error column refers to a condition.
    fn check_sigma_of(&self, name: &str, place: &str) -> Result<(), InputError> {
        let lower = name.to_lowercase();
        let Some(condition) = lower.strip_prefix(SIGMA_OF).filter(|_| name != common_errors::SIGMA) else {
            return Ok(());
        };
        if SIDES.contains(&condition) {
            let problem = format!("`{name}`: errors have one value, not two sides");
            let help = "give one column `sigma`, such as the mean of both sides";
            return Err(self.table.fault(None, Some(place), problem).with_help(help));
        }
        if condition_of_sigma(name).is_some() {
            return Ok(());
        }
        let fault = self.table.fault(None, Some(place), format!("`{name}` is the error of no condition"));
        let near = slip_of(condition).or(nearest(condition, conditions::NAMES.into_iter().chain(["common"])));
        Err(fault.with_help(match near.or(conditions::NAMES.into_iter().find(|known| *known == condition)) {
            Some(near) => format!("did you mean `{SIGMA_OF}{near}`?"),
            None => format!("conditions are: {}, {}", conditions::NAMES.join(", "), DAYS.join(", ")),
        }))
    }

    fn row(&self, row: usize) -> Result<Row, InputError> {
        let value = self.measured(row, "value")?;
        if let Some(most) = self.observable.card().most.filter(|most| value.abs() > *most) {
            let problem =
                format!("the value is {}; a {} is at most {}", keys::plain(value), self.observable, keys::plain(most));
            let help = "a charge transfer efficiency is 1 - cti; values in units of 1e-5 are to be multiplied";
            return Err(self.table.fault(Some(row), Some("value"), problem).with_help(help));
        }
        let sigma = self.measured(row, "sigma")?;
        if sigma <= 0.0 {
            let problem = format!("the error of a measurement is above 0; this is {sigma}");
            let help = "leave the row out, or give the error that the scatter of the data shows";
            return Err(self.table.fault(Some(row), Some("sigma"), problem).with_help(help));
        }
        let floor = self.floor(row, value)?;
        let sigma = sigma.hypot(floor);
        let galaxy = self.galaxy(row)?;
        let galaxy_is_judged = galaxy.is_none() && self.observable.is_shape();
        let galaxy = if galaxy_is_judged { Some(self.mission.judged()) } else { galaxy };
        let species = self.species(row)?;
        let name = |galaxy: usize| ("galaxy".to_string(), self.mission.galaxies[galaxy].name.clone());
        let mut words: Vec<(String, String)> = galaxy.map(name).into_iter().collect();
        let at = self.conditions(row)?;
        for column in &self.table.columns {
            if OTHERS.contains(&column.name.as_str()) || known(&column.name).is_some() {
                continue;
            }
            if let Cell::Text(word) = &column.cells[row] {
                words.push((column.name.clone(), word.clone()));
            }
        }
        let condition_sigmas = self.condition_sigmas(row)?;
        // Known only with those of all rows.
        let common = Common::default();
        Ok(Row {
            value,
            sigma,
            value_sigma: sigma,
            common,
            floor,
            at,
            condition_sigmas,
            galaxy,
            galaxy_is_judged,
            species,
            words,
        })
    }

    /// Errors of the conditions.
    fn condition_sigmas(&self, row: usize) -> Result<Vec<(&'static str, f64)>, InputError> {
        let mut sigmas: Vec<(&'static str, f64)> = Vec::new();
        let in_days = DAYS.map(|name| (name, "t_yr", Unit::Days, 1.0 / DAYS_PER_YEAR));
        let others = conditions::NAMES.map(|name| (name, name, known(name).expect("a condition").unit, 1.0));
        for (name, condition, unit, factor) in others.into_iter().chain(in_days) {
            let name = format!("{SIGMA_OF}{name}");
            // A temperature difference is the same in kelvin and degrees Celsius.
            let Some((sigma, place)) =
                self.number_by(row, &name, unit, |conversion, theirs| conversion.scale(theirs))?
            else {
                continue;
            };
            if !(sigma.is_finite() && sigma >= 0.0) {
                let problem =
                    format!("the error of a condition is a number from 0 on; this is {sigma}{}", unit.behind());
                return Err(self.table.fault(Some(row), Some(&place), problem));
            }
            if sigmas.iter().any(|(known, _)| *known == condition) {
                let problem = format!("`{name}` is one error of the time too many");
                return Err(self.table.fault(Some(row), Some(&place), problem).with_help("give one of them"));
            }
            sigmas.push((condition, factor * sigma));
        }
        Ok(sigmas)
    }

    /// `value` or `sigma`.
    fn measured(&self, row: usize, name: &str) -> Result<f64, InputError> {
        let unit = Unit::of(self.observable);
        let Some((number, place)) = self.number(row, name, unit)? else {
            return Err(if self.table.column(name).is_some() {
                let fault = self.table.fault(Some(row), Some(name), format!("the {name} is missing"));
                fault.with_help("leave out rows without measurements")
            } else {
                let problem = format!("there is no column `{name}`; columns: {}", self.names());
                let help = match name {
                    "sigma" => {
                        "every row needs the 1-sigma error of its value; if none is published, give the scatter about a smooth curve, and \
                         say in meta.source that it is assumed"
                    }
                    _ => "every row needs a value and its 1-sigma error",
                };
                self.table.fault(None, None, problem).with_help(help)
            });
        };
        if number.is_finite() {
            return Ok(number);
        }
        let problem = format!("the {name} must be a finite number; this is {number}");
        Err(self.table.fault(Some(row), Some(&place), problem).with_help("leave out rows without measurements"))
    }

    /// The galaxy of a change of shape, by its index in the mission; None if the file names none.
    fn galaxy(&self, row: usize) -> Result<Option<usize>, InputError> {
        if !self.observable.is_shape() {
            return Ok(None);
        }
        let names: Vec<&str> = self.mission.galaxies.iter().map(|galaxy| galaxy.name.as_str()).collect();
        match self.named(row, "galaxy", &names)? {
            Some(galaxy) => Ok(Some(galaxy)),
            // The galaxy of [requirement]: whatever is not given is the mission's.
            None if self.table.column("galaxy").is_none() => Ok(None),
            None => Err(self.missing("galaxy", row)),
        }
    }

    /// The species of a trap density or of a dipole, by its index in the mission; None if a row of a density names none. A dipole
    /// belongs to a single trap.
    fn species(&self, row: usize) -> Result<Option<usize>, InputError> {
        let pumped = matches!(self.observable.card().probe, Probe::Pumping(_));
        if !pumped && !matches!(self.observable.card().probe, Probe::Traps) {
            return Ok(None);
        }
        let names: Vec<&str> = self.mission.detector.traps.iter().map(|species| species.name.as_str()).collect();
        match self.named(row, "species", &names)? {
            None if pumped && names.len() > 1 => Err(self.missing("species", row)),
            None if pumped => Ok(Some(0)),
            named => Ok(named),
        }
    }

    /// The index of the name given in a column or `meta`; None if there is none.
    fn named(&self, row: usize, what: &str, names: &[&str]) -> Result<Option<usize>, InputError> {
        let column = self.table.column(what);
        let said = column.map(|column| &column.cells[row]).or_else(|| self.table.meta(what));
        let place = if column.is_some() { what.to_string() } else { format!("meta.{what}") };
        let Some(name) = said.and_then(Cell::text) else { return Ok(None) };
        if let Some(found) = names.iter().position(|known| *known == name) {
            return Ok(Some(found));
        }
        let problem = format!("the mission has no {what} \"{name}\"; it has: {}", names.join(", "));
        let fault = self.table.fault(Some(row), Some(&place), problem);
        Err(match nearest(name, names.iter().copied()) {
            Some(near) => fault.with_help(format!("did you mean \"{near}\"?")),
            None => fault,
        })
    }

    fn conditions(&self, row: usize) -> Result<Stated, InputError> {
        let dose_mev_g = self.condition(row, "dose_mev_g")?;
        let t_yr = self.t_yr(row)?;
        let dose_will_do = self.observable.depends_on("dose_mev_g");
        if t_yr.is_none() && !(dose_will_do && dose_mev_g.is_some()) {
            return Err(self.missing(if dose_will_do { TIME_OR_DOSE } else { "t_yr" }, row));
        }
        let mut at = Stated::left_to(self.mission, t_yr.map_or(0.0, |(_, t_yr)| t_yr), dose_mev_g);
        if t_yr.is_some_and(|(name, _)| DAYS.contains(&name)) {
            at = at.dated(self.mission);
        }
        for name in conditions::NAMES.into_iter().filter(|name| !["t_yr", "dose_mev_g"].contains(name)) {
            if let Some(value) = self.condition(row, name)? {
                at.state(name, value);
            }
        }
        self.check_edge(row, &at)?;
        self.check_signal_read(row, &at)?;
        self.check_preceding(row, &at)?;
        for name in self.observable.card().requires {
            let as_read = *name == "signal_e" && at.signal_read_e.is_some();
            if *name != "galaxy" && !as_read && at.get(name).is_none() {
                return Err(self.missing(name, row));
            }
        }
        if let Some(block_px) = at.block_px.filter(|block_px| *block_px > at.transfers) {
            let problem = format!(
                "a block of {block_px} rows whose last row makes {} transfers reaches past the register",
                at.transfers
            );
            return Err(self.table.fault(Some(row), Some("block_px"), problem));
        }
        at.set_covariates(self.covariates(row));
        Ok(at)
    }

    /// Checks that the charge of a packet is given either before transfer or as read.
    fn check_signal_read(&self, row: usize, at: &Stated) -> Result<(), InputError> {
        let Some(signal_read_e) = at.signal_read_e else { return Ok(()) };
        let refuse = |problem: &str, help: &str| {
            Err(self.table.fault(Some(row), Some("signal_read_e"), problem).with_help(help))
        };
        if at.signal_e.is_some() {
            let help = "give the charge before transfer (signal_e) or the charge as read (signal_read_e)";
            return refuse("a packet has both signal_e and signal_read_e", help);
        }
        if self.observable == Observable::PacketCharge {
            let problem = format!("packet_charge is the charge as read: it would be {signal_read_e} e- in every model");
            return refuse(&problem, "give the charge before transfer, signal_e");
        }
        Ok(())
    }

    /// Checks that a preceding packet has a charge and a distance, and is on the detector.
    fn check_preceding(&self, row: usize, at: &Stated) -> Result<(), InputError> {
        match (at.preceding_e, at.preceding_px) {
            (None, None) => Ok(()),
            (None, Some(_)) => Err(self.missing("preceding_e", row)),
            (Some(_), None) => Err(self.missing("preceding_px", row)),
            (Some(_), Some(ahead_px)) if ahead_px + at.block_px.unwrap_or(1) > at.transfers => {
                let problem = format!(
                    "a packet {ahead_px} rows ahead of one that makes {} transfers has been read out before",
                    at.transfers
                );
                Err(self.table.fault(Some(row), Some("preceding_px"), problem))
            }
            _ => Ok(()),
        }
    }

    /// Checks that the CTI of an edge has the pixels behind it.
    fn check_edge(&self, row: usize, at: &Stated) -> Result<(), InputError> {
        if !self.observable.depends_on("first_px") {
            return Ok(());
        }
        match (at.block_px, at.first_px, at.last_px) {
            (None, None, None) => Ok(()),
            (None, _, _) => Err(self.missing("block_px", row)),
            (_, None, _) => Err(self.missing("first_px", row)),
            (_, _, None) => Err(self.missing("last_px", row)),
            (_, Some(first), Some(last)) if first > last => {
                let problem = format!("first_px is {first}, behind last_px, {last}");
                Err(self.table.fault(Some(row), Some("first_px"), problem))
            }
            _ => Ok(()),
        }
    }

    /// Numeric columns, and numbers of `meta`, unknown to the model.
    fn covariates(&self, row: usize) -> Vec<(String, f64)> {
        let number = |cell: &Cell| match cell {
            Cell::Number(number) => Some(*number),
            Cell::Integer(integer) => Some(*integer as f64),
            Cell::Truth(truth) => Some(f64::from(u8::from(*truth))),
            _ => None,
        };
        let columns = self.table.columns.iter().map(|column| (&column.name, &column.cells[row]));
        let meta = self.table.meta.iter().map(|meta| (&meta.name, &meta.value));
        let named = columns.chain(meta).filter(|(name, _)| is_unknown(name));
        named.filter_map(|(name, cell)| Some((name.clone(), number(cell)?))).collect()
    }

    /// A condition of a row, checked, in our unit.
    fn condition(&self, row: usize, name: &'static str) -> Result<Option<f64>, InputError> {
        let Known { name, unit, kind, help, .. } = known(name).expect("a condition");
        let Some((number, place)) = self.number(row, name, unit)? else {
            return Ok(None);
        };
        let kelvin_of_celsius = unit == Unit::Kelvin && number < 0.0;
        if !kind.refuses(number) && !kelvin_of_celsius {
            return Ok(Some(number));
        }
        let said = match name {
            "t_yr" if number < 0.0 => "this is before launch".to_string(),
            _ => format!("{name} is {}{}", keys::plain(number), unit.behind()),
        };
        let problem = format!("{said}; allowed: {}", kind.allowed(unit.name()));
        let fault = self.table.fault(Some(row), Some(&place), problem);
        Err(match help(number) {
            Some(help) => fault.with_help(help),
            None => fault,
        })
    }

    /// A number of a row or of `meta` in our unit, and its location.
    fn number(&self, row: usize, name: &str, unit: Unit) -> Result<Option<(f64, String)>, InputError> {
        self.number_by(row, name, unit, Conversion::apply)
    }

    /// The same with a specific conversion.
    fn number_by(
        &self,
        row: usize,
        name: &str,
        unit: Unit,
        convert: fn(Conversion, f64) -> f64,
    ) -> Result<Option<(f64, String)>, InputError> {
        if let Some(column) = self.table.column(name) {
            let cell = &column.cells[row];
            if *cell == Cell::Missing {
                return self.refuse_empty(row, name).map(|()| None);
            }
            let number = cell.number().ok_or_else(|| self.not_a_number(Some(row), name))?;
            let conversion = self.table.conversion(name, unit.ours())?;
            return Ok(Some((convert(conversion, number), name.to_string())));
        }
        let place = format!("meta.{name}");
        match self.table.meta(name) {
            None | Some(Cell::Missing) => Ok(None),
            Some(cell) => {
                let (number, given) = cell.quantity().ok_or_else(|| self.not_a_number(None, &place))?;
                let conversion = self.table.conversion_of(given, unit.ours(), &place)?;
                Ok(Some((convert(conversion, number), place)))
            }
        }
    }

    /// Rejects an empty cell where the mission's value would be taken silently.
    fn refuse_empty(&self, row: usize, name: &str) -> Result<(), InputError> {
        let Some((_, key)) = MIRRORED.iter().find(|(mirrored, _)| *mirrored == name) else { return Ok(()) };
        let help = format!("leave out the row, or give the value; without the column, {key} of the mission holds");
        Err(self.empty(row, name).with_help(help))
    }

    /// A cell without a value.
    fn empty(&self, row: usize, name: &str) -> InputError {
        self.table.fault(Some(row), Some(name), format!("`{name}` is empty in this row"))
    }

    fn not_a_number(&self, row: Option<usize>, place: &str) -> InputError {
        self.table.fault(row, Some(place), "a number is needed here")
    }

    /// The row's time in years since launch, from any of its columns, with the column's name.
    fn t_yr(&self, row: usize) -> Result<Option<(&'static str, f64)>, InputError> {
        let given = [
            ("t_yr", self.condition(row, "t_yr")?),
            ("date", self.date(row)?),
            ("mjd", self.julian_date(row, "mjd")?),
            ("jd", self.julian_date(row, "jd")?),
        ];
        let mut given = given.into_iter().filter_map(|(name, t_yr)| Some((name, t_yr?)));
        let Some((first, t_yr)) = given.next() else { return Ok(None) };
        match given.find(|(_, other)| (t_yr - other).abs() * DAYS_PER_YEAR > SAME_TIME_D) {
            Some((name, other)) => {
                let launch = self.mission.mission.launch;
                let problem = format!(
                    "{name} and {first} contradict one another: launched {launch}, they are {other:.3} yr and {t_yr:.3} yr"
                );
                Err(self.table.fault(Some(row), Some(name), problem).with_help("give one of them"))
            }
            None => Ok(Some((first, t_yr))),
        }
    }

    /// The row's `date` in years since launch.
    fn date(&self, row: usize) -> Result<Option<f64>, InputError> {
        let column = self.table.column("date");
        let (cell, place) = match column {
            Some(column) => (&column.cells[row], "date"),
            None => match self.table.meta("date") {
                Some(cell) => (cell, "meta.date"),
                None => return Ok(None),
            },
        };
        if *cell == Cell::Missing {
            return Ok(None);
        }
        self.since_launch(row, place, cell, column.and_then(|column| column.time.as_ref())).map(Some)
    }

    /// A point in time in years since launch.
    fn since_launch(&self, row: usize, place: &str, cell: &Cell, time: Option<&Time>) -> Result<f64, InputError> {
        let moment = cell
            .moment(time)
            .map_err(|NotADate { problem, help }| self.table.fault(Some(row), Some(place), problem).with_help(help))?;
        let launch = self.mission.mission.launch.0.and_hms_opt(0, 0, 0).expect("midnight");
        let t_yr = (moment - launch).as_seconds_f64() / 86_400.0 / DAYS_PER_YEAR;
        if t_yr < 0.0 {
            let problem = format!("this is before launch, {}", self.mission.mission.launch);
            return Err(self.table.fault(Some(row), Some(place), problem));
        }
        Ok(t_yr)
    }

    /// The row's `mjd` or `jd` (UTC) in years since launch.
    fn julian_date(&self, row: usize, name: &str) -> Result<Option<f64>, InputError> {
        if let Some(column) = self.table.column(name).filter(|column| column.time.is_some()) {
            let cell = &column.cells[row];
            let t_yr = || self.since_launch(row, name, cell, column.time.as_ref());
            return (*cell != Cell::Missing).then(t_yr).transpose();
        }
        let Some((days, place)) = self.number(row, name, Unit::Days)? else { return Ok(None) };
        let time = Time { format: name.into(), scale: "utc".into() };
        self.since_launch(row, &place, &Cell::Number(days), Some(&time)).map(Some)
    }

    /// A condition that a row needs and does not have: its cells are empty, or there is no such column.
    fn missing(&self, name: &'static str, row: usize) -> InputError {
        let any: &[&'static str] =
            if name == TIME_OR_DOSE { &["t_yr", "dose_mev_g", "date", "mjd", "jd"] } else { &[name] };
        let any = if name == "t_yr" { &["t_yr", "date", "mjd", "jd"] } else { any };
        let empty: Vec<&str> = any.iter().copied().filter(|name| self.table.column(name).is_some()).collect();
        if let Some(first) = empty.first() {
            let fault = self.empty(row, &empty.join("`, `"));
            let help = format!("give the value, or leave out the row: a {} needs it", self.observable);
            return InputError { place: self.table.fault(Some(row), Some(first), "").place, ..fault }.with_help(help);
        }
        let problem = format!(
            "{} needs `{name}`, which is neither a column nor in meta; columns: {}",
            self.observable,
            self.names()
        );
        let fault = self.table.fault(None, None, problem);
        if let Some((column, condition)) = self.looks_like(any) {
            return fault.with_help(format!("is it in `{column}`? then name the column `{condition}`"));
        }
        let help = match name {
            "signal_e" if self.observable == Observable::Cti => "X-rays of E eV make E/3.65 e- in silicon",
            TIME_OR_DOSE => {
                "a date, mjd or jd will do as well; t_yr counts years from launch, and a laboratory gives the dose"
            }
            _ => return fault,
        };
        fault.with_help(help)
    }

    /// A column that looks like one of some conditions.
    fn looks_like(&self, conditions: &[&'static str]) -> Option<(&str, &'static str)> {
        let columns = self.table.columns.iter().map(|column| column.name.as_str()).filter(|name| is_unknown(name));
        let like = |column| {
            let is_like = |name: &&&str| known(name).is_some_and(|known| lookalike::looks_like(column, known.words));
            Some((column, *conditions.iter().find(is_like)?))
        };
        columns.filter_map(like).next()
    }

    fn names(&self) -> String {
        self.table.columns.iter().map(|column| column.name.as_str()).collect::<Vec<_>>().join(", ")
    }
}

/// Names of conditions and covariates that differ between rows.
fn varying(table: &Table, rows: &[Row]) -> Vec<String> {
    let differs = |name: &str| {
        let first = (rows[0].at.get(name).map(f64::to_bits), rows[0].word(name));
        rows.iter().any(|row| (row.at.get(name).map(f64::to_bits), row.word(name)) != first)
    };
    let columns = table
        .columns
        .iter()
        .map(|column| if DAYS.contains(&column.name.as_str()) { "t_yr" } else { column.name.as_str() });
    let mut names: Vec<String> = columns.filter(|name| differs(name)).map(str::to_string).collect();
    names.dedup();
    names
}
