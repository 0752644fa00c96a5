//! Text → checked grid.

use std::ops::Range;
use std::path::Path;

use chrono::NaiveDate;
use toml::Value;
use toml::de::{DeTable, DeValue};

use super::{Axis, Grid, MOST_POINTS, Values, whole};
use crate::error::{InputError, NO_SUCH_FILE, nearest};
use crate::mission::keys::{self, Allowed, plain};
use crate::mission::{Date, Mission};
use crate::mission_file::lookup;
use crate::mission_file::{check_value, line_at};
use crate::numeric::sample_points::{MOST_SOBOL, Sample, Sampling};
use crate::plan::scenario::{self, sun};
use crate::sweep::distribution::Distribution;
use crate::sweep::output::Output;

/// Top-level keys of a grid file.
const KNOWN: [&str; 7] = ["mission", "outputs", "sampling", "draws", "seed", "chunk_points", "axes"];

/// All distributions.
const DISTRIBUTIONS: [Syntax; 5] = [
    Syntax { name: "uniform", family: Some(Family::Uniform), required: &["from", "to"], optional: &[] },
    Syntax { name: "log-uniform", family: Some(Family::LogUniform), required: &["from", "to"], optional: &[] },
    Syntax { name: "normal", family: Some(Family::Normal), required: &["mean", "sigma"], optional: &["min", "max"] },
    Syntax {
        name: "log-normal",
        family: Some(Family::LogNormal),
        required: &["median", "sigma"],
        optional: &["min", "max"],
    },
    Syntax { name: "choice", family: None, required: &["values"], optional: &[] },
];

const SAMPLINGS: [&str; 4] = ["grid", "latin-hypercube", "monte-carlo", "sobol"];

/// Minimum probability left by truncation: below that, quantiles lose their digits.
const LEAST_KEPT: f64 = 1e-6;

/// Default number of chunks.
const CHUNKS: u64 = 256;

/// Maximum default size of a chunk.
const MOST_CHUNK_POINTS: u64 = 1000;

pub(super) fn grid(refused: &str, name: String, text: &str, folder: &Path) -> Result<Grid, InputError> {
    let document = DeTable::parse(text).map_err(|error| {
        let line = error.span().map(|span| line_at(text, span.start));
        InputError {
            place: line.map(|line| format!("line {line}: {}", text.lines().nth(line - 1).unwrap_or("").trim())),
            ..InputError::new(refused, error.message().replace('\n', " "))
        }
        .with_help("the file must be TOML: key = value lines and an [axes] section, words in quotes")
    })?;
    let source = Source { refused, text };
    source.read(document.get_ref(), name, folder)
}

/// Notation of a distribution in a grid file.
#[derive(Clone, Copy)]
struct Syntax {
    name: &'static str,
    /// None if values are drawn from a list.
    family: Option<Family>,
    required: &'static [&'static str],
    optional: &'static [&'static str],
}

/// A family of distributions of numbers.
#[derive(Clone, Copy, PartialEq)]
enum Family {
    Uniform,
    LogUniform,
    Normal,
    LogNormal,
}

struct Source<'a> {
    refused: &'a str,
    text: &'a str,
}

/// An axis, its location, and the values that its key takes.
struct Placed<'a> {
    axis: Axis,
    entry: Entry<'a>,
    key: &'static keys::Key,
}

/// A key as written by the user, its value, and their locations in the text.
struct Entry<'a> {
    key: String,
    value: &'a DeValue<'a>,
    line: usize,
    span: Range<usize>,
}

impl Source<'_> {
    fn read(&self, document: &DeTable, name: String, folder: &Path) -> Result<Grid, InputError> {
        let entries = self.entries(document, "");
        self.check_known(&entries)?;
        let find = |key: &str| find(&entries, key);
        let missions = self.missions(find("mission"), folder)?;
        let axes = find("axes").map_or(Ok(Vec::new()), |entry| self.section_of_axes(entry, &missions))?;
        if missions.len() == 1 && axes.is_empty() {
            return Err(InputError::new(self.refused, "there is one mission and nothing that varies")
                .with_help("add [axes] with a line such as readout.transfers = [825, 1650]"));
        }
        let drawn: Vec<&Placed> =
            axes.iter().filter(|placed| !matches!(placed.axis.values, Values::Listed(_))).collect();
        let sampling = self.sampling(find("sampling"), drawn.first().map(|placed| placed.axis.key.as_str()))?;
        let draws = self.draws(find("draws"), sampling)?;
        let seed =
            find("seed").map_or(Ok(1), |entry| self.whole_number(entry, "seed of the draws", 0, i64::MAX as u64))?;
        let records = self.records(find("outputs"))?;
        let points = self.points(missions.len() as u64 * draws, &axes)?;
        let usual = points.div_ceil(CHUNKS).clamp(1, MOST_CHUNK_POINTS);
        let chunk_points = find("chunk_points").map_or(Ok(usual), |entry| {
            self.whole_number(entry, "number of points that are written together", 1, 1_000_000)
        })?;
        self.check_sobol(sampling, draws, drawn.len())?;
        let sample = Sample::new(sampling.unwrap_or(Sampling::MonteCarlo), seed, draws, drawn.len());
        self.check_draws(&drawn, &sample, draws)?;
        let axes: Vec<Axis> = axes.into_iter().map(|placed| placed.axis).collect();
        self.check_suns(&missions, &axes)?;
        let mut grid = Grid {
            name,
            missions,
            axes,
            sampling,
            draws,
            seed,
            records,
            chunk_points,
            fingerprint: String::new(),
            sample,
        };
        grid.fingerprint = grid.hash();
        Ok(grid)
    }

    /// Checks that observed and drawn Suns are not mixed, unless the Sun is an axis.
    fn check_suns(&self, missions: &[(String, Mission)], axes: &[Axis]) -> Result<(), InputError> {
        let launches =
            axes.iter().find(|axis| axis.key == "mission.launch").map_or(Vec::new(), |axis| axis.values.ends());
        let launched = |mission: &Mission| {
            let at = |launch: &Value| mission.with(&[("mission.launch".to_string(), launch.clone())]);
            if launches.is_empty() { Ok(vec![mission.clone()]) } else { launches.iter().map(at).collect() }
        };
        let flown =
            missions.iter().map(|(_, mission)| launched(mission)).collect::<Result<Vec<Vec<Mission>>, InputError>>()?;
        let asked = axes.iter().any(|axis| axis.key == sun::SUN);
        let mixed = sun::of_the_past(flown.iter().flatten(), asked);
        mixed.map(|_| ()).map_err(|error| {
            let help =
                "write environment.sun = [\"drawn\"] under [axes], or [\"observed\"] to compare them as they are";
            InputError { refused: self.refused.into(), ..error }.with_help(help)
        })
    }

    /// Checks that every top-level key of the file is known.
    fn check_known(&self, entries: &[Entry]) -> Result<(), InputError> {
        let Some(unknown) = entries.iter().find(|entry| !KNOWN.contains(&entry.key.as_str())) else { return Ok(()) };
        let help = match nearest(&unknown.key, KNOWN) {
            Some(near) => format!("did you mean `{near}`?"),
            None if lookup::is_table(&unknown.key) => {
                format!("keys of the mission stand under [axes]: [axes.{}]", unknown.key)
            }
            None => format!("known here: {}", KNOWN.join(", ")),
        };
        Err(self.fault(unknown, format!("no key of a grid file is called `{}`", unknown.key)).with_help(help))
    }

    fn section_of_axes<'a>(
        &self,
        entry: &Entry<'a>,
        missions: &[(String, Mission)],
    ) -> Result<Vec<Placed<'a>>, InputError> {
        match entry.value {
            DeValue::Table(table) => self.axes(table, missions),
            _ => Err(self
                .fault(entry, "must be a table: write [axes]")
                .with_help("such as readout.transfers = [825, 1650]")),
        }
    }

    /// Draws at every combination of the lists: given if there are distributions, and only then.
    fn draws(&self, entry: Option<&Entry>, sampling: Option<Sampling>) -> Result<u64, InputError> {
        match (entry, sampling) {
            (Some(entry), None) => Err(self
                .fault(entry, "there is no distribution to draw from: lists and ranges are combined in full")
                .with_help(
                    "leave draws away, or write { distribution = \"uniform\", from = ..., to = ... } for a key",
                )),
            (Some(entry), Some(_)) => {
                self.whole_number(entry, "number of draws at every combination of the lists", 1, MOST_POINTS)
            }
            (None, None) => Ok(1),
            (None, Some(_)) => Err(InputError::new(
                self.refused,
                format!(
                    "`draws` is missing: the number of draws at every combination of the lists (whole numbers from 1 to {MOST_POINTS})"
                ),
            )),
        }
    }

    /// Number of points: missions times draws times the values of each list.
    fn points(&self, missions_and_draws: u64, axes: &[Placed]) -> Result<u64, InputError> {
        let listed = axes
            .iter()
            .try_fold(missions_and_draws, |product, placed| product.checked_mul(placed.axis.values.listed() as u64));
        listed.filter(|points| *points <= MOST_POINTS).ok_or_else(|| {
            InputError::new(
                self.refused,
                format!("more than {MOST_POINTS} points: missions, listed values and draws are multiplied"),
            )
            .with_help(
                "give distributions instead of lists: { distribution = \"choice\", values = [...] } draws from a list",
            )
        })
    }

    /// Checks the limits of Sobol's sequence on points and dimensions.
    fn check_sobol(&self, sampling: Option<Sampling>, draws: u64, distributions: usize) -> Result<(), InputError> {
        if sampling == Some(Sampling::Sobol) && (draws > MOST_SOBOL.0 || distributions > MOST_SOBOL.1) {
            let problem = format!(
                "{draws} draws from {distributions} distributions; allowed with \"sobol\": up to {} draws from {} distributions",
                MOST_SOBOL.0, MOST_SOBOL.1
            );
            return Err(InputError::new(self.refused, problem).with_help("sampling = \"latin-hypercube\""));
        }
        Ok(())
    }

    fn missions(&self, entry: Option<&Entry>, folder: &Path) -> Result<Vec<(String, Mission)>, InputError> {
        let Some(entry) = entry else {
            return Err(InputError::new(
                self.refused,
                "`mission` is missing: the path of a mission file, relative to the grid file",
            )
            .with_help("such as mission = \"snap_l2.toml\", or a list of several"));
        };
        let paths: Option<Vec<String>> = match entry.value {
            DeValue::String(path) => Some(vec![path.to_string()]),
            DeValue::Array(paths) => paths
                .iter()
                .map(|path| match path.get_ref() {
                    DeValue::String(path) => Some(path.to_string()),
                    _ => None,
                })
                .collect(),
            _ => None,
        };
        let paths = paths
            .filter(|paths| !paths.is_empty())
            .ok_or_else(|| self.fault(entry, "allowed: the path of a mission file in quotes, or a list of several"))?;
        if let Some(twice) = (1..paths.len()).find(|&index| paths[..index].contains(&paths[index])) {
            return Err(self.fault(entry, format!("duplicate mission \"{}\"", paths[twice])));
        }
        paths
            .into_iter()
            .map(|path| {
                let mission = Mission::read(folder.join(&path)).map_err(|error| match error.problem.as_str() {
                    NO_SUCH_FILE => {
                        let problem = format!("there is no file `{}`", folder.join(&path).display());
                        self.fault(entry, problem).with_help("paths are relative to the grid file")
                    }
                    _ => error,
                })?;
                Ok((path, mission))
            })
            .collect()
    }

    fn sampling(&self, entry: Option<&Entry>, first_drawn: Option<&str>) -> Result<Option<Sampling>, InputError> {
        let allowed = "allowed: \"latin-hypercube\", \"sobol\", \"monte-carlo\", or \"grid\" where there are lists and ranges alone";
        let Some(entry) = entry else {
            return match first_drawn {
                None => Ok(None),
                Some(key) => Err(InputError::new(
                    self.refused,
                    format!("`sampling` is missing: how distributions are drawn from, such as that of {key}"),
                )
                .with_help("sampling = \"latin-hypercube\", \"sobol\" or \"monte-carlo\"")),
            };
        };
        let DeValue::String(word) = entry.value else {
            return Err(self.fault(entry, format!("the sampling is of the wrong kind; {allowed}")));
        };
        match (word.as_ref(), first_drawn) {
            ("grid", None) => Ok(None),
            ("grid", Some(key)) => {
                Err(self.fault(entry, format!("{key} has a distribution, which cannot be combined in full")).with_help(
                    "sampling = \"latin-hypercube\", \"sobol\" or \"monte-carlo\", or a list or range for the key",
                ))
            }
            ("latin-hypercube" | "monte-carlo" | "sobol", None) => Err(self
                .fault(entry, "there is no distribution to draw from: lists and ranges are combined in full")
                .with_help("{ distribution = \"choice\", values = [...] } draws from a list")),
            ("latin-hypercube", Some(_)) => Ok(Some(Sampling::LatinHypercube)),
            ("monte-carlo", Some(_)) => Ok(Some(Sampling::MonteCarlo)),
            ("sobol", Some(_)) => Ok(Some(Sampling::Sobol)),
            (word, _) => {
                let help = nearest(word, SAMPLINGS).map(|near| format!("did you mean \"{near}\"?"));
                Err(InputError { help, ..self.fault(entry, format!("the sampling is \"{word}\"; {allowed}")) })
            }
        }
    }

    fn records(&self, entry: Option<&Entry>) -> Result<Vec<Output>, InputError> {
        let Some(entry) = entry else { return Ok(Output::USUAL.to_vec()) };
        let names = || Output::ALL.iter().map(|output| output.name());
        let wrong = || self.fault(entry, format!("allowed: a list of {}", names().collect::<Vec<_>>().join(", ")));
        let DeValue::Array(members) = entry.value else { return Err(wrong()) };
        if members.is_empty() {
            return Err(wrong());
        }
        let mut records = Vec::new();
        for member in members {
            let DeValue::String(name) = member.get_ref() else { return Err(wrong()) };
            let Some(output) = Output::ALL.into_iter().find(|output| output.name() == name.as_ref()) else {
                let help = match nearest(name, names()) {
                    Some(near) => format!("did you mean \"{near}\"?"),
                    None => format!("known: {}", names().collect::<Vec<_>>().join(", ")),
                };
                return Err(self.fault(entry, format!("no output is called \"{name}\"")).with_help(help));
            };
            if records.contains(&output) {
                return Err(self.fault(entry, format!("duplicate \"{name}\"")));
            }
            records.push(output);
        }
        Ok(records)
    }

    /// Axes in the order of the file.
    fn axes<'a>(&self, table: &'a DeTable<'a>, missions: &[(String, Mission)]) -> Result<Vec<Placed<'a>>, InputError> {
        let mut leaves = Vec::new();
        self.leaves(table, "", &missions[0].1, &mut leaves);
        // Dotted keys of one section need not be adjacent.
        leaves.sort_by_key(|entry| (entry.line, entry.span.start));
        let mut axes: Vec<Placed> = Vec::new();
        for mut entry in leaves {
            let mut found = None;
            for (path, mission) in missions {
                let place = mission.path(&entry.key).map_err(|(problem, help)| {
                    let problem = if missions.len() > 1 { format!("{problem} (in {path})") } else { problem };
                    InputError { help, ..self.fault_at(&entry, problem) }
                })?;
                found = lookup::find(&place);
            }
            let Some(key) = found else {
                return Err(self.fault_at(&entry, format!("no key is called `{}`", entry.key)));
            };
            if axes.iter().any(|placed| placed.axis.key == entry.key) {
                return Err(self.fault_at(&entry, "duplicate key under [axes]"));
            }
            let values = self.values(&entry, key)?;
            let axis_key = entry.key.clone();
            entry.key = format!("axes.{}", entry.key);
            axes.push(Placed { axis: Axis { key: axis_key, values }, entry, key });
        }
        Ok(axes)
    }

    /// `detector.temperature_k = ...` may be a quoted key, a dotted key, or a key in [axes.detector].
    fn leaves<'a>(&self, table: &'a DeTable<'a>, prefix: &str, mission: &Mission, leaves: &mut Vec<Entry<'a>>) {
        for entry in self.entries(table, prefix) {
            match entry.value {
                DeValue::Table(inner)
                    if !inner.iter().any(|(name, _)| name.get_ref() == "distribution")
                        && mission.path(&entry.key).is_err()
                        && !inner.is_empty() =>
                {
                    self.leaves(inner, &format!("{}.", entry.key), mission, leaves);
                }
                _ => leaves.push(entry),
            }
        }
    }

    fn values(&self, entry: &Entry, key: &'static keys::Key) -> Result<Values, InputError> {
        match entry.value {
            DeValue::Array(members) if !members.is_empty() => self.list(entry, key, members).map(Values::Listed),
            DeValue::Array(_) => Err(self
                .fault_at(entry, "the list is empty")
                .with_help("leave the line away to keep the mission's value")),
            DeValue::String(text) => {
                let axis = scenario::Axis::parse(&entry.key, text)
                    .map_err(|error| InputError { help: error.help, ..self.fault_at(entry, error.problem) })?;
                for value in &axis.values {
                    self.check(entry, key, value)?;
                }
                Ok(Values::Listed(axis.values))
            }
            DeValue::Table(table) => self.distribution(entry, key, table),
            value => {
                check_value(value, key, |problem| self.fault_at(entry, problem))?;
                Ok(Values::Listed(vec![self.number_as_wanted(key, self.value(entry.span.clone()))]))
            }
        }
    }

    fn list(
        &self,
        entry: &Entry,
        key: &'static keys::Key,
        members: &toml::de::DeArray,
    ) -> Result<Vec<Value>, InputError> {
        members
            .iter()
            .map(|member| {
                check_value(member.get_ref(), key, |problem| self.fault_at(entry, problem))?;
                Ok(self.number_as_wanted(key, self.value(member.span())))
            })
            .collect()
    }

    fn distribution(&self, entry: &Entry, key: &'static keys::Key, table: &DeTable) -> Result<Values, InputError> {
        let members = self.entries(table, "");
        let syntax = self.syntax(entry, &members)?;
        self.check_members(entry, syntax, &members)?;
        let Some(family) = syntax.family else { return self.choice(entry, key, &members) };
        if matches!(key.kind, Allowed::Date) {
            return self.days(entry, syntax, &members);
        }
        let Some(whole) = whole(key.kind) else {
            return Err(self
                .fault_at(
                    entry,
                    format!("the {} is not a number: a {} distribution has none of it", key.what, syntax.name),
                )
                .with_help("{ distribution = \"choice\", values = [...] } draws from a list"));
        };
        let distribution = self.numbers(entry, family, &members)?;
        self.sensible(entry, distribution)?;
        Ok(if whole { Values::DrawnWhole(distribution) } else { Values::Drawn(distribution) })
    }

    /// The distribution named in a table.
    fn syntax(&self, entry: &Entry, members: &[Entry]) -> Result<Syntax, InputError> {
        let names = || DISTRIBUTIONS.iter().map(|syntax| syntax.name);
        let known = names().map(|name| format!("\"{name}\"")).collect::<Vec<_>>().join(", ");
        let Some(named) = find(members, "distribution") else {
            return Err(self.fault_at(
                entry,
                format!("a table says how values are drawn, and `distribution` is missing: {known}"),
            ));
        };
        let DeValue::String(name) = named.value else {
            return Err(self.fault_at(entry, format!("the distribution is of the wrong kind; allowed: {known}")));
        };
        DISTRIBUTIONS.into_iter().find(|syntax| syntax.name == name.as_ref()).ok_or_else(|| {
            let help = nearest(name, names()).map(|near| format!("did you mean \"{near}\"?"));
            InputError { help, ..self.fault_at(entry, format!("the distribution is \"{name}\"; allowed: {known}")) }
        })
    }

    /// Checks that a distribution has the numbers it needs, and no others.
    fn check_members(&self, entry: &Entry, syntax: Syntax, members: &[Entry]) -> Result<(), InputError> {
        let Syntax { name, required, optional, .. } = syntax;
        let allowed: Vec<&str> = ["distribution"].iter().chain(required).chain(optional).copied().collect();
        if let Some(unknown) = members.iter().find(|member| !allowed.contains(&member.key.as_str())) {
            let help = match nearest(&unknown.key, allowed.iter().copied()) {
                Some(near) => format!("did you mean `{near}`?"),
                None => format!("known here: {}", allowed.join(", ")),
            };
            return Err(self
                .fault_at(entry, format!("a {name} distribution has no `{}`", unknown.key))
                .with_help(help));
        }
        if let Some(missing) = required.iter().find(|key| find(members, key).is_none()) {
            return Err(self.fault_at(
                entry,
                format!("`{missing}` is missing: a {name} distribution needs {}", required.join(" and ")),
            ));
        }
        Ok(())
    }

    /// A list to draw from.
    fn choice(&self, entry: &Entry, key: &'static keys::Key, members: &[Entry]) -> Result<Values, InputError> {
        let DeValue::Array(values) = find(members, "values").expect("required").value else {
            return Err(self.fault_at(entry, "values must be a list"));
        };
        if values.is_empty() {
            return Err(self.fault_at(entry, "the list of values is empty"));
        }
        self.list(entry, key, values).map(Values::Chosen)
    }

    /// The distribution of a family with the numbers of a table.
    fn numbers(&self, entry: &Entry, family: Family, members: &[Entry]) -> Result<Distribution, InputError> {
        let number =
            |name: &str, otherwise: f64| find(members, name).map_or(Ok(otherwise), |member| self.number(entry, member));
        Ok(match family {
            Family::Uniform => Distribution::Uniform { from: number("from", 0.0)?, to: number("to", 0.0)? },
            Family::LogUniform => Distribution::LogUniform { from: number("from", 0.0)?, to: number("to", 0.0)? },
            Family::Normal => Distribution::Normal {
                mean: number("mean", 0.0)?,
                sigma: number("sigma", 0.0)?,
                ends: (number("min", f64::NEG_INFINITY)?, number("max", f64::INFINITY)?),
            },
            Family::LogNormal => Distribution::LogNormal {
                median: number("median", 0.0)?,
                sigma: number("sigma", 0.0)?,
                ends: (number("min", 0.0)?, number("max", f64::INFINITY)?),
            },
        })
    }

    fn sensible(&self, entry: &Entry, distribution: Distribution) -> Result<(), InputError> {
        let problem = match distribution {
            Distribution::Uniform { from, to } | Distribution::LogUniform { from, to } if from >= to => {
                Some(format!("from ({}) must be below to ({})", plain(from), plain(to)))
            }
            Distribution::LogUniform { from, .. } if from <= 0.0 => {
                Some(format!("from is {}; allowed: above 0, for its logarithm", plain(from)))
            }
            Distribution::LogNormal { median, .. } if median <= 0.0 => {
                Some(format!("the median is {}; allowed: above 0, for its logarithm", plain(median)))
            }
            Distribution::Normal { sigma, .. } | Distribution::LogNormal { sigma, .. } if sigma <= 0.0 => {
                Some(format!("sigma is {}; allowed: above 0", plain(sigma)))
            }
            Distribution::Normal { ends, .. } | Distribution::LogNormal { ends, .. } if ends.0 >= ends.1 => {
                Some(format!("min ({}) must be below max ({})", plain(ends.0), plain(ends.1)))
            }
            _ if distribution.kept() < LEAST_KEPT => {
                Some(format!("less than {LEAST_KEPT:e} of the distribution lies between min and max"))
            }
            _ => None,
        };
        problem.map_or(Ok(()), |problem| Err(self.fault_at(entry, problem)))
    }

    fn days(&self, entry: &Entry, syntax: Syntax, members: &[Entry]) -> Result<Values, InputError> {
        if syntax.family != Some(Family::Uniform) {
            return Err(self.fault_at(
                entry,
                format!("days have no {} distribution; allowed: \"uniform\", \"choice\"", syntax.name),
            ));
        }
        let day = |member: &Entry| -> Result<NaiveDate, InputError> {
            let wrong = |why: &str| {
                self.fault_at(entry, format!("{} {why}: a date without quotes, such as 2030-01-01", member.key))
            };
            match member.value {
                DeValue::Datetime(datetime) => {
                    Date::try_from(*datetime).map(|date| date.0).map_err(|problem| self.fault_at(entry, problem))
                }
                _ => Err(wrong("must be a day")),
            }
        };
        let (Some(from), Some(to)) = (find(members, "from"), find(members, "to")) else {
            unreachable!("both are required")
        };
        let (from, to) = (day(from)?, day(to)?);
        if from >= to {
            return Err(self.fault_at(entry, format!("from ({from}) must be before to ({to})")));
        }
        Ok(Values::DrawnDays(from, to))
    }

    /// Checks that every number to be drawn is allowed for its key.
    fn check_draws(&self, drawn: &[&Placed], sample: &Sample, draws: u64) -> Result<(), InputError> {
        // Quantiles are monotonic: the lowest and the highest draw are sufficient.
        let mut ends = vec![((f64::INFINITY, 0), (0.0, 0)); drawn.len()];
        for draw in 0..draws {
            for (place, (least, most)) in sample.places(draw).into_iter().zip(&mut ends) {
                if place < least.0 {
                    *least = (place, draw);
                }
                if place > most.0 {
                    *most = (place, draw);
                }
            }
        }
        for (placed, (least, most)) in drawn.iter().zip(ends) {
            let Placed { axis, entry, key } = placed;
            for (place, draw) in [least, most] {
                let number = match axis.values.at(place) {
                    Value::Float(number) => number,
                    Value::Integer(integer) => integer as f64,
                    _ => continue,
                };
                if key.kind.refuses(number) {
                    let unit = if key.unit.is_empty() { String::new() } else { format!(" {}", key.unit) };
                    let problem = format!(
                        "in draw {draw} the {} is {}{unit}; allowed: {}",
                        key.what,
                        plain(number),
                        key.kind.allowed(key.unit)
                    );
                    return Err(self
                        .fault(entry, problem)
                        .with_help("cut the distribution with min and max, or make it narrower"));
                }
            }
        }
        Ok(())
    }

    fn check(&self, entry: &Entry, key: &keys::Key, value: &Value) -> Result<(), InputError> {
        let text = format!("value = {value}");
        let table = DeTable::parse(&text).expect("a value that was read");
        let value = table.get_ref().iter().next().expect("one value").1;
        check_value(value.get_ref(), key, |problem| self.fault_at(entry, problem))
    }

    fn number(&self, entry: &Entry, member: &Entry) -> Result<f64, InputError> {
        let number = match self.value(member.span.clone()) {
            Value::Float(number) => Some(number),
            Value::Integer(integer) => Some(integer as f64),
            _ => None,
        };
        number
            .filter(|number| number.is_finite())
            .ok_or_else(|| self.fault_at(entry, format!("{} must be a number", member.key)))
    }

    fn whole_number(&self, entry: &Entry, what: &str, least: u64, most: u64) -> Result<u64, InputError> {
        let allowed = if most == i64::MAX as u64 {
            format!("whole numbers from {least}")
        } else {
            format!("whole numbers from {least} to {most}")
        };
        match entry.value {
            DeValue::Integer(_) => {
                match self.value(entry.span.clone()) {
                    Value::Integer(integer)
                        if u64::try_from(integer).is_ok_and(|integer| (least..=most).contains(&integer)) =>
                    {
                        Ok(integer as u64)
                    }
                    _ => Err(self
                        .fault(entry, format!("the {what} is {}; allowed: {allowed}", &self.text[entry.span.clone()]))),
                }
            }
            _ => Err(self.fault(entry, format!("the {what} is of the wrong kind; allowed: {allowed}"))),
        }
    }

    /// The value at a location in the text.
    fn value(&self, span: Range<usize>) -> Value {
        let table: toml::Table = format!("value = {}", &self.text[span]).parse().expect("a value that was parsed");
        table["value"].clone()
    }

    /// 5 is converted to 5.0 if a key takes any number: a column has one datatype.
    fn number_as_wanted(&self, key: &keys::Key, value: Value) -> Value {
        match (key.kind, value) {
            (Allowed::Number(..) | Allowed::Positive(..), Value::Integer(integer)) => Value::Float(integer as f64),
            (_, value) => value,
        }
    }

    fn entries<'a>(&self, table: &'a DeTable<'a>, prefix: &str) -> Vec<Entry<'a>> {
        let mut entries: Vec<Entry> = table
            .iter()
            .map(|(name, value)| Entry {
                key: format!("{prefix}{}", name.get_ref()),
                value: value.get_ref(),
                line: line_at(self.text, name.span().start),
                span: value.span(),
            })
            .collect();
        entries.sort_by_key(|entry| (entry.line, entry.span.start));
        entries
    }

    /// An error at a key of the grid file itself.
    fn fault(&self, entry: &Entry, problem: impl Into<String>) -> InputError {
        let value = &self.text[entry.span.clone()];
        let place = if value.starts_with('[') && !value.contains('=') && !matches!(entry.value, DeValue::Array(_)) {
            value.to_string()
        } else {
            let mut value: String = value.split_whitespace().collect::<Vec<_>>().join(" ");
            if value.chars().count() > 60 {
                value = value.chars().take(57).chain("...".chars()).collect();
            }
            format!("{} = {value}", entry.key)
        };
        InputError { place: Some(format!("line {}: {place}", entry.line)), ..InputError::new(self.refused, problem) }
    }

    /// An error at an axis.
    fn fault_at(&self, entry: &Entry, problem: impl Into<String>) -> InputError {
        self.fault(
            &Entry {
                key: format!("axes.{}", entry.key),
                value: entry.value,
                line: entry.line,
                span: entry.span.clone(),
            },
            problem,
        )
    }
}

fn find<'a, 'b>(entries: &'b [Entry<'a>], key: &str) -> Option<&'b Entry<'a>> {
    entries.iter().find(|entry| entry.key == key)
}
