//! Text → checked mission.

use std::collections::HashSet;
use std::ops::Range;
use std::path::Path;

use toml::Value;
use toml::de::{DeTable, DeValue};

use super::imported::THINNEST_HELP;
use super::{imported, lookup};
use crate::effect::{self, Entry};
use crate::environment::solar_cycle::{self, ACTIVE_AFTER_YR, ACTIVE_BEFORE_YR, CYCLE_YR};
use crate::environment::source::{self, SOURCES};
use crate::error::{InputError, nearest, shortened};
use crate::io::{input, json};
use crate::mission::keys::{self, ARRAYS, Allowed, KEYS, Need, OPTIONAL_TABLES};
use crate::mission::{
    DoseModel, Environment, Galaxy, Mission, Orbit, OrbitKind, Population, ReadoutMethod, SunOfThePast, TrapsAtStart,
};
use crate::numeric::calendar;
use crate::readout::MAX_SPECIES;

/// Maximum number of exposures in a dither pattern.
const MOST_DITHERS: usize = 64;

impl Mission {
    /// Reads a mission file.
    ///
    /// # Errors
    /// If the file cannot be read, or its content is invalid: one message with line, key, value and the allowed range.
    pub fn read(path: impl AsRef<Path>) -> Result<Mission, InputError> {
        let folder = path.as_ref().parent().unwrap_or(Path::new(""));
        Source { folder, ..Source::parse(refused(path.as_ref()), &read_text(path.as_ref())?, true)? }.mission()
    }

    /// Reads a mission from text.
    ///
    /// # Errors
    /// As [`Mission::read`].
    pub fn parse(text: &str) -> Result<Mission, InputError> {
        Source::parse("cannot use mission".into(), text, true)?.mission()
    }

    /// The mission as resolved: a valid mission file.
    pub fn to_toml(&self) -> String {
        toml::to_string(self).expect("a mission is a TOML table")
    }

    /// The same mission with changed values of some keys, such as `detector.temperature_k` or `detector.traps.VV.release_ms`;
    /// members of an array are called by their names.
    ///
    /// # Errors
    /// If there is no such key, it is duplicate, or the value is not allowed.
    pub fn with(&self, settings: &[(String, Value)]) -> Result<Mission, InputError> {
        self.with_numbers(settings).map_or_else(|| self.with_text(settings), Ok)
    }

    /// The same through the text of the mission, with all its checks.
    pub(super) fn with_text(&self, settings: &[(String, Value)]) -> Result<Mission, InputError> {
        let said: Vec<String> = settings.iter().map(|(key, value)| format!("{key} = {value}")).collect();
        let refused = format!("cannot use mission \"{}\" with {}", self.mission.name, said.join(", "));
        let mut table = self.to_table();
        let mut known = HashSet::new();
        for (key, value) in settings {
            let refuse = |problem, help| InputError {
                refused: format!("cannot set {key} = {value}"),
                place: None,
                problem,
                help,
            };
            let path = resolve(&table, key).map_err(|(problem, help)| refuse(problem, help))?;
            if !known.insert(path.clone()) {
                return Err(refuse("the key is set twice".into(), Some("give it one value".into())));
            }
            set(&mut table, &path, value.clone());
        }
        let text = toml::to_string(&table).expect("a table");
        Source::parse(refused, &text, false)?.mission()
    }

    /// The mission as a TOML table, through its text: only this preserves dates.
    pub fn to_table(&self) -> toml::Table {
        self.to_toml().parse().expect("a mission is a TOML table")
    }

    /// The mission as JSON, as resolved; dates are text.
    pub fn to_json(&self) -> serde_json::Value {
        json::table(&self.to_table(), serde_json::value::Serializer).expect("keys are text")
    }

    /// The path of a dotted key, in which members of arrays have their indices instead of their names; or the fault and what to
    /// try.
    pub(crate) fn path(&self, key: &str) -> Result<String, (String, Option<String>)> {
        resolve(&self.to_table(), key)
    }

    /// The value of a numeric key by its dotted path. None if there is no such key or it is not a number.
    pub fn number(&self, key: &str) -> Option<f64> {
        let table = self.to_table();
        let path = resolve(&table, key).ok()?;
        match get(&table, &path)? {
            Value::Float(number) => Some(*number),
            Value::Integer(number) => Some(*number as f64),
            _ => None,
        }
    }
}

fn refused(path: &Path) -> String {
    format!("cannot use mission `{}`", path.display())
}

/// The text of a mission file.
pub(crate) fn read_text(path: &Path) -> Result<String, InputError> {
    input::text(path).map_err(|problem| InputError::new(refused(path), problem))
}

/// What to write in the place of a line that is no TOML.
fn remedy(problem: &str, line: &str) -> String {
    let value = line.split_once('=').map_or("", |(_, value)| value.trim());
    let are_digits = |part: &str| !part.is_empty() && part.chars().all(|letter| letter.is_ascii_digit());
    let parts = |separator: char| value.split(separator).collect::<Vec<_>>();
    match (&parts(',')[..], &parts('.')[..]) {
        ([whole, decimals], _) if are_digits(whole.trim_start_matches('-')) && are_digits(decimals) => {
            format!("numbers have a decimal point: {whole}.{decimals}")
        }
        (_, [day, month, year]) if [day, month, year].into_iter().all(|part| are_digits(part)) && year.len() == 4 => {
            format!("dates are YYYY-MM-DD, without quotes: {year}-{month:0>2}-{day:0>2}")
        }
        _ if problem.starts_with("invalid date") => "dates are YYYY-MM-DD, without quotes".into(),
        _ if problem.starts_with("duplicate key") => "the key is given twice: remove one of the two lines".into(),
        _ => "the file must be TOML: [section] lines and key = value lines, words in quotes".into(),
    }
}

/// A mission text, parsed, with the locations of its values.
struct Source<'a> {
    refused: String,
    text: &'a str,
    document: DeTable<'a>,
    /// Folder to which the names of its files are relative.
    folder: &'a Path,
    /// Whether lines of the text are meaningful to the user.
    lines: bool,
}

impl<'a> Source<'a> {
    fn parse(refused: String, text: &'a str, lines: bool) -> Result<Source<'a>, InputError> {
        if text.trim().is_empty() {
            let help = "`ctiplan init FILE` writes a mission to start from";
            return Err(InputError::new(refused, "the file is empty").with_help(help));
        }
        let document = DeTable::parse(text).map_err(|error| {
            let line = error.span().map(|span| line_at(text, span.start));
            let written = line.and_then(|line| text.lines().nth(line - 1)).unwrap_or_default();
            let help = remedy(error.message(), written);
            InputError {
                refused: refused.clone(),
                place: line
                    .map(|line| format!("line {line}: {}", shortened(text.lines().nth(line - 1).unwrap_or("").trim()))),
                problem: error.message().replace('\n', " "),
                help: Some(help),
            }
        })?;
        Ok(Source { refused, text, document: document.into_inner(), folder: Path::new(""), lines })
    }

    fn mission(&self) -> Result<Mission, InputError> {
        self.check_table(&self.document, "")?;
        let mut table: toml::Table = toml::from_str(self.text).map_err(|error| self.fault("", error.message()))?;
        for key in KEYS {
            self.complete(&mut table, "", key)?;
        }
        for entry in &effect::CATALOGUE {
            name_each(&mut table, entry);
            for place in effect_places(&table, entry.card.kind) {
                for key in entry.card.keys.iter().filter(|key| key.path != "*") {
                    self.complete(&mut table, &format!("{place}."), key)?;
                }
            }
        }
        if get(&table, "environment.solar_maximum").is_none() {
            let maxima = solar_cycle::MAXIMA.iter().map(|&year| Value::Float(year)).collect();
            set(&mut table, "environment.solar_maximum", Value::Array(maxima));
        }
        let mut mission: Mission =
            table.clone().try_into().map_err(|error: toml::de::Error| self.fault("", error.message()))?;
        self.check_together(&mission, &table)?;
        imported::import(&mut mission, self.folder).map_err(|(key, error)| match key {
            Some(key) => InputError { place: self.place(key), refused: self.refused.clone(), ..error },
            None => error,
        })?;
        Ok(mission)
    }

    /// Checks that every key of a table is known and has an allowed value.
    fn check_table(&self, table: &DeTable, path: &str) -> Result<(), InputError> {
        for (name, value) in table {
            let name = name.get_ref().as_ref();
            let below = if path.is_empty() { name.to_string() } else { format!("{path}.{name}") };
            let is_table = lookup::is_table(&below);
            let is_array = lookup::is_table(&format!("{below}[]"));
            // A single effect is a table, several of a kind are an array of tables.
            let either = path == "effects" && is_table;
            match value.get_ref() {
                DeValue::Table(inner) if is_table && (either || !is_array) => self.check_table(inner, &below)?,
                DeValue::Array(members) if is_array => {
                    for (index, member) in members.iter().enumerate() {
                        let DeValue::Table(inner) = member.get_ref() else {
                            return Err(self.fault(&below, format!("must be tables: write [[{below}]]")));
                        };
                        self.check_table(inner, &format!("{below}[{index}]"))?;
                    }
                }
                _ if is_array && !either => {
                    return Err(self.fault(&below, format!("must be tables: write [[{}]]", keys::pattern_of(&below))));
                }
                _ if is_table => return Err(self.fault(&below, format!("must be a table: write [{below}]"))),
                value => match lookup::find(&below) {
                    Some(key) => self.check_value(value, &below, key)?,
                    None => return Err(self.unknown(&below)),
                },
            }
        }
        Ok(())
    }

    fn check_value(&self, value: &DeValue, path: &str, key: &keys::Key) -> Result<(), InputError> {
        check_value(value, key, |problem| self.fault(path, problem))
    }

    fn unknown(&self, path: &str) -> InputError {
        let pattern = keys::pattern_of(path);
        let (parent, name) = pattern.rsplit_once('.').unwrap_or(("", &pattern));
        let siblings = lookup::members(parent);
        let elsewhere = KEYS.iter().find(|key| key.path.rsplit('.').next() == Some(name)).map(|key| key.path);
        let help = if parent == "effects" || (parent.starts_with("effects.") && siblings.contains(&"*")) {
            let near = nearest(name, siblings.iter().copied()).map(|near| format!("did you mean `{near}`? "));
            format!("{}`ctiplan effects` lists them all", near.unwrap_or_default())
        } else if let Some(elsewhere) = elsewhere.filter(|_| !parent.starts_with("effects")) {
            let table = elsewhere.rsplit_once('.').expect("keys stand in tables").0;
            let table = if table.ends_with("[]") {
                format!("[[{}]]", table.trim_end_matches("[]"))
            } else {
                format!("[{table}]")
            };
            format!("it belongs in {table}")
        } else if let Some(near) = nearest(name, siblings.iter().copied()) {
            format!("did you mean `{near}`?")
        } else if siblings.is_empty() {
            "leave the table empty".to_string()
        } else {
            format!("known here: {}", siblings.join(", "))
        };
        let problem = if parent == "effects" {
            format!("no effect is called `{name}`")
        } else if siblings.is_empty() {
            format!("{parent} takes no keys; found `{name}`")
        } else if parent.is_empty() {
            format!("no section is called `{name}`")
        } else {
            format!("no key is called `{name}` in {parent}")
        };
        InputError { help: Some(help), ..self.fault(path, problem) }
    }

    /// Fills in a default, or rejects a mission without a required key. `prefix` precedes the key's path.
    fn complete(&self, table: &mut toml::Table, prefix: &str, key: &keys::Key) -> Result<(), InputError> {
        let path = format!("{prefix}{}", key.path);
        let paths = match path.split_once("[]") {
            Some((array, field)) => {
                let members = get(table, array).and_then(Value::as_array).map_or(0, Vec::len);
                if members == 0 && OPTIONAL_TABLES.contains(&format!("{array}[]").as_str()) {
                    return Ok(());
                }
                if members == 0 {
                    let called = if array == "galaxies" { "galaxy" } else { "trap species" };
                    let written = keys::pattern_of(array).replace("[]", "");
                    let problem = format!("there is no {called}: at least one [[{written}]] is needed");
                    let place = self.place(array.rsplit_once('.').map_or("", |(parent, _)| parent));
                    let place = place.filter(|_| !prefix.is_empty());
                    return Err(InputError { place, ..InputError::new(&self.refused, problem) });
                }
                (0..members).map(|index| format!("{array}[{index}]{field}")).collect()
            }
            None => vec![path],
        };
        for path in paths {
            let parent = path.rsplit_once('.').expect("keys stand in tables").0;
            let absent = OPTIONAL_TABLES.contains(&parent) && get(table, parent).is_none();
            if get(table, &path).is_some() || absent {
                continue;
            }
            match key.need {
                Need::Optional => {}
                Need::Default(value) => {
                    let value = default_value(value);
                    set(table, &path, value);
                }
                Need::Required => {
                    let shown = self.shown(&path);
                    let problem = format!("`{shown}` is missing: the {} ({})", key.what, key.kind.allowed(key.unit));
                    return Err(InputError { place: self.place(parent), ..InputError::new(&self.refused, problem) });
                }
            }
        }
        Ok(())
    }

    /// Checks the keys in combination.
    fn check_together(&self, mission: &Mission, table: &toml::Table) -> Result<(), InputError> {
        self.check_traps(mission)?;
        let galaxies: Vec<&str> = mission.galaxies.iter().map(|galaxy| galaxy.name.as_str()).collect();
        self.check_names("galaxies", &galaxies)?;
        for (index, galaxy) in mission.galaxies.iter().enumerate() {
            self.check_flux(galaxy, index)?;
        }
        self.check_judged(&mission.requirement.galaxy, &galaxies)?;
        self.check_effects(mission, table)?;
        self.check_free(&mission.fit.free, table)?;
        self.check_clock(mission)?;
        self.check_persistence(mission)?;
        self.check_noise(mission)?;
        self.check_population(mission, table)?;
        self.check_dose(mission)
    }

    /// Checks that notch and surface are below the full well, and that the readout can hold all species, with distinct names.
    fn check_traps(&self, mission: &Mission) -> Result<(), InputError> {
        let traps = &mission.detector.traps;
        if let Some(problem) = mission.notch_problem() {
            return Err(self.fault("detector.notch_e", problem));
        }
        if let Some((index, problem)) = mission.surface_problem() {
            return Err(self.fault(&format!("detector.traps[{index}].surface_level_e"), problem));
        }
        if traps.len() > MAX_SPECIES {
            let problem = format!("{} trap species; allowed: up to {MAX_SPECIES}", traps.len());
            return Err(self.fault("detector.traps", problem));
        }
        let species: Vec<&str> = traps.iter().map(|species| species.name.as_str()).collect();
        self.check_names("detector.traps", &species)
    }

    /// Checks that members of an array have distinct names.
    fn check_names(&self, array: &str, names: &[&str]) -> Result<(), InputError> {
        (1..names.len()).find(|&index| names[..index].contains(&names[index])).map_or(Ok(()), |index| {
            let problem = format!("duplicate name \"{}\"", names[index]);
            Err(self.fault(&format!("{array}[{index}].name"), problem))
        })
    }

    /// Checks that the charge of a galaxy is given, or follows from its signal-to-noise ratio.
    fn check_flux(&self, galaxy: &Galaxy, index: usize) -> Result<(), InputError> {
        let snr = format!("galaxies[{index}].snr");
        match (galaxy.flux_e, galaxy.snr, galaxy.aperture_px) {
            (Some(_), Some(_), _) => Err(self.fault(&snr, "give flux_e or snr, not both: one follows from the other")),
            (None, None, _) => {
                let problem = format!("galaxy \"{}\" needs flux_e (e-), or snr with aperture_px (px)", galaxy.name);
                Err(InputError { place: self.place(&format!("galaxies[{index}]")), ..self.fault("", problem) })
            }
            (None, Some(_), None) => {
                Err(self.fault(&snr, "a signal-to-noise ratio needs aperture_px, the radius in which it holds"))
            }
            _ => Ok(()),
        }
    }

    /// Checks that the requirement names a galaxy of the mission.
    fn check_judged(&self, judged: &str, galaxies: &[&str]) -> Result<(), InputError> {
        if galaxies.contains(&judged) {
            return Ok(());
        }
        let help = nearest(judged, galaxies.iter().copied()).map(|near| format!("did you mean \"{near}\"?"));
        let problem = format!("there is no galaxy \"{judged}\"; there are: {}", galaxies.join(", "));
        Err(InputError { help, ..self.fault("requirement.galaxy", problem) })
    }

    /// Each effect checks its own keys in combination.
    fn check_effects(&self, mission: &Mission, table: &toml::Table) -> Result<(), InputError> {
        for entry in &effect::CATALOGUE {
            entry.check(mission).map_err(|(index, refusal)| {
                let place = &effect_places(table, entry.card.kind)[index];
                let path = if refusal.key.is_empty() { place.clone() } else { format!("{place}.{}", refusal.key) };
                InputError { help: refusal.help, ..self.fault(&path, refusal.problem) }
            })?;
        }
        Ok(())
    }

    /// Checks that free parameters are keys of the mission.
    fn check_free(&self, free: &[String], table: &toml::Table) -> Result<(), InputError> {
        for (index, key) in free.iter().enumerate() {
            if let Err((problem, help)) = resolve(table, key) {
                return Err(InputError { help, ..self.fault(&format!("fit.free[{index}]"), problem) });
            }
        }
        Ok(())
    }

    /// Checks that the steps of a clock move a packet by one pixel, and that there are not too many species for its phases.
    fn check_clock(&self, mission: &Mission) -> Result<(), InputError> {
        let by_levels = matches!(mission.accuracy.readout, ReadoutMethod::Fractional | ReadoutMethod::MonteCarlo);
        if by_levels && mission.readout.traps_at_start == TrapsAtStart::Carried {
            let problem = "traps that carry their state from pixel to pixel are computed one by one";
            let help = "set accuracy.readout = \"exact\", or traps_at_start = \"empty\"";
            return Err(self.fault("readout.traps_at_start", problem).with_help(help));
        }
        self.check_store(mission)?;
        let Some(clock) = &mission.readout.clock else { return Ok(()) };
        let clock = clock.clock().map_err(|fault| {
            let key = format!("readout.clock.{}", fault.key);
            let place = self.place(&key).or_else(|| self.place("readout.clock"));
            InputError { place, ..self.fault("", fault.problem) }.with_help(fault.help)
        })?;
        let divided = clock.kinds() * mission.detector.traps.len();
        if divided > MAX_SPECIES {
            let problem = format!(
                "{} trap species below {} kinds of phases are {divided}; allowed: up to {MAX_SPECIES}",
                mission.detector.traps.len(),
                clock.kinds()
            );
            return Err(self.fault("readout.clock.phases", problem));
        }
        Ok(())
    }

    /// Checks persistence: instantaneous capture, in an image that ends at the register.
    fn check_persistence(&self, mission: &Mission) -> Result<(), InputError> {
        let Some(persistence) = mission.persistence() else { return Ok(()) };
        let readout = &mission.readout;
        let without = |key: &str, problem: &str, help: &str| {
            let help = format!("{help}, or remove [survey.persistence]");
            Err(self.fault(key, problem).with_help(help))
        };
        if readout.store.is_some() {
            let problem = "charge that stays from exposures before is modelled in an image without a store only";
            return without("readout.store.rows", problem, "remove [readout.store]");
        }
        if readout.traps_at_start == TrapsAtStart::Carried {
            let problem = "traps that start as their neighbours were left keep nothing from exposures before";
            return without("readout.traps_at_start", problem, "set traps_at_start = \"empty\"");
        }
        if matches!(mission.accuracy.readout, ReadoutMethod::Fractional | ReadoutMethod::MonteCarlo) {
            let problem = "charge that stays from exposures before is computed by the methods fast and exact only";
            return without("accuracy.readout", problem, "set accuracy.readout = \"exact\"");
        }
        if readout.clock.as_ref().is_some_and(|clock| clock.phases > 1) {
            let problem = "charge that stays from exposures before is modelled in a clock of one phase only";
            return without("readout.clock.phases", problem, "remove [readout.clock]");
        }
        if persistence.rows < readout.transfers {
            let problem = format!("a frame of {} rows; readout.transfers is {}", persistence.rows, readout.transfers);
            return without("survey.persistence.rows", &problem, "set rows to the number of rows of the image");
        }
        Ok(())
    }

    /// Checks a store: all rows read have been shifted into it, and its traps are initially empty.
    fn check_store(&self, mission: &Mission) -> Result<(), InputError> {
        let Some(store) = mission.readout.store else { return Ok(()) };
        if mission.readout.traps_at_start == TrapsAtStart::Carried {
            let problem = "traps carry their state from pixel to pixel in an image without a store only";
            let help = "set traps_at_start = \"empty\", or remove [readout.store]";
            return Err(self.fault("readout.traps_at_start", problem).with_help(help));
        }
        if store.rows < mission.readout.transfers {
            let problem = format!("a store of {} rows; readout.transfers is {}", store.rows, mission.readout.transfers);
            let help = "set rows to the number of rows of the image: every row of it is shifted into the store";
            return Err(self.fault("readout.store.rows", problem).with_help(help));
        }
        Ok(())
    }

    /// Checks that something is judged, that shear biases have a population, and that galaxies come from a table or a law.
    fn check_population(&self, mission: &Mission, table: &toml::Table) -> Result<(), InputError> {
        let requirement = &mission.requirement;
        let judged = ["delta_e", "c", "m"].iter().any(|key| get(table, &format!("requirement.{key}")).is_some());
        if !judged {
            let problem =
                "`requirement.delta_e` is missing: the largest change of ellipticity (above 0 and up to 0.999)";
            return Err(InputError { place: self.place("requirement"), ..self.fault("", problem) }
                .with_help("or give requirement.c and requirement.m, the largest shear biases of [population]"));
        }
        let Some(population) = &mission.population else {
            let biases = [("requirement.c", requirement.c), ("requirement.m", requirement.m)];
            let Some((key, _)) = biases.into_iter().find(|(_, limit)| limit.is_some()) else { return Ok(()) };
            let help = "add [population]: with table, or without it for the law of docs/population.md";
            return Err(self
                .fault(key, "a shear bias is that of a population, and there is no [population]")
                .with_help(help));
        };
        let law = ["magnitude_range", "one_electron_mag", "pixel_arcsec"].map(|key| format!("population.{key}"));
        let given = law.into_iter().find(|key| population.table.is_some() && is_set(table, key));
        if let Some(key) = given {
            let problem = "it belongs to the law of galaxies, but the galaxies come from population.table";
            return Err(self.fault(&key, problem).with_help("remove one of them"));
        }
        self.check_dithers(population)?;
        match population.magnitude_range[..] {
            [bright, faint] if bright < faint => Ok(()),
            _ => {
                Err(self
                    .fault("population.magnitude_range", "two magnitudes are needed, the brighter one (smaller) first"))
            }
        }
    }

    /// Checks that rows and columns of dithers belong to the same exposures, and that these are not too many.
    fn check_dithers(&self, population: &Population) -> Result<(), InputError> {
        let rows = population.dither_rows_px.len();
        if rows > MOST_DITHERS {
            let problem = format!("{rows} exposures; allowed: 1 to {MOST_DITHERS}, each of which is read out");
            let help = "give fewer offsets, which represent the others";
            return Err(self.fault("population.dither_rows_px", problem).with_help(help));
        }
        match &population.dither_columns_px {
            Some(columns) if columns.len() != rows => {
                let problem = format!("{} offsets in columns (px), but {rows} in rows", columns.len());
                let help = "give dither_rows_px and dither_columns_px one number for each exposure";
                Err(self.fault("population.dither_columns_px", problem).with_help(help))
            }
            _ => Ok(()),
        }
    }

    /// Checks that read noise is a law or a table, and that a table has as many noises as rates.
    fn check_noise(&self, mission: &Mission) -> Result<(), InputError> {
        let Some(noise) = &mission.readout.noise else { return Ok(()) };
        let law = [noise.floor_e, noise.white_e, noise.reference_rate_khz];
        let help = "a law: floor_e, white_e (e-) and reference_rate_khz; or a table: pixel_rate_khz and read_noise_e";
        let refuse =
            |key: &str, problem: String| Err(self.fault(&format!("readout.noise.{key}"), problem).with_help(help));
        match (&noise.pixel_rate_khz, &noise.read_noise_e) {
            (None, None) if law.iter().all(Option::is_some) => Ok(()),
            (Some(rates), Some(noises)) if law.iter().all(Option::is_none) => {
                if rates.len() != noises.len() {
                    let problem = format!("{} pixel rates (kHz), but {} read noises (e-)", rates.len(), noises.len());
                    return refuse("pixel_rate_khz", problem);
                }
                if rates.windows(2).any(|pair| pair[0] >= pair[1]) {
                    return refuse("pixel_rate_khz", "pixel rates (kHz) must rise".into());
                }
                Ok(())
            }
            _ => {
                let problem = "the read noise must be a law or a table, whole, and not both";
                Err(InputError { place: self.place("readout.noise"), ..self.fault("", problem) }.with_help(help))
            }
        }
    }

    fn check_dose(&self, mission: &Mission) -> Result<(), InputError> {
        self.check_orbit(mission)?;
        self.check_shielding(mission)?;
        self.check_sources(mission)?;
        self.check_reference(mission)?;
        self.check_observed_sun(&mission.environment)?;
        self.check_sun(mission)
    }

    /// Checks that an observed Sun meets a dose that is derived from it.
    fn check_observed_sun(&self, environment: &Environment) -> Result<(), InputError> {
        if environment.sun != SunOfThePast::Observed {
            return match &environment.solar_events {
                None => Ok(()),
                Some(_) => Err(self
                    .fault("environment.solar_events", "events are those of an observed Sun")
                    .with_help("set environment.sun = \"observed\"")),
            };
        }
        let fault = |key: &str, problem: &str, help: &str| Err(self.fault(key, problem).with_help(help));
        if environment.model != DoseModel::Derived {
            let problem = "only a derived dose follows the Sun as it was";
            return fault("environment.sun", problem, "take environment.model = \"derived\", or sun = \"drawn\"");
        }
        for (key, given) in [
            ("spectra", environment.spectra.is_some()),
            ("dose_depth", environment.dose_depth.is_some()),
            ("active_years", environment.active_years.is_some()),
            ("solar_phase", environment.solar_phase.is_some()),
        ] {
            if given {
                let problem = "with environment.sun = \"observed\" the Sun is that of the calendar";
                return fault(&format!("environment.{key}"), problem, "remove it, or take sun = \"drawn\"");
            }
        }
        Ok(())
    }

    /// Checks that the orbit is given once, with all its elements.
    fn check_orbit(&self, mission: &Mission) -> Result<(), InputError> {
        let Some(orbit) = &mission.orbit else { return Ok(()) };
        if let Some(named) = mission.mission.orbit {
            let same = match named {
                Orbit::L1 => orbit.kind == OrbitKind::L1,
                Orbit::L2 => orbit.kind == OrbitKind::L2,
                Orbit::Interplanetary => orbit.kind == OrbitKind::Interplanetary,
                Orbit::Geo => orbit.kind == OrbitKind::Geo,
                Orbit::Leo => orbit.kind == OrbitKind::Elements,
            };
            if !same {
                let problem = format!("mission.orbit and [orbit] disagree: [orbit] says {orbit}");
                return Err(self.fault("mission.orbit", problem).with_help("remove mission.orbit"));
            }
        }
        let elements = [
            ("perigee_km", orbit.perigee_km),
            ("apogee_km", orbit.apogee_km),
            ("inclination_deg", orbit.inclination_deg),
            ("argument_of_perigee_deg", orbit.argument_of_perigee_deg),
        ];
        for (index, (key, value)) in elements.iter().enumerate() {
            if orbit.kind != OrbitKind::Elements && value.is_some() {
                let problem = "elements belong to kind = \"elements\"";
                return Err(self.fault(&format!("orbit.{key}"), problem));
            }
            if orbit.history.is_some() && value.is_some() {
                let problem = "elements stand in the file of orbit.history";
                return Err(self.fault(&format!("orbit.{key}"), problem).with_help("remove it, or orbit.history"));
            }
            let needed = orbit.kind == OrbitKind::Elements && orbit.history.is_none() && index < 3;
            if needed && value.is_none() {
                let problem =
                    format!("`orbit.{key}` is missing: kind = \"elements\" needs perigee, apogee and inclination");
                return Err(InputError { place: self.place("orbit"), ..self.fault("", problem) });
            }
        }
        if orbit.kind != OrbitKind::Elements && orbit.history.is_some() {
            return Err(self.fault("orbit.history", "elements belong to kind = \"elements\""));
        }
        if orbit.history.is_some() && mission.environment.solar_phase.is_some() {
            let problem = "a phase of the Sun is held for an orbit that does not change";
            return Err(self.fault("environment.solar_phase", problem).with_help("remove it, or give fixed elements"));
        }
        match mission.orbit_problem() {
            Some(problem) => Err(self.fault("orbit.perigee_km", problem)),
            None => Ok(()),
        }
    }

    /// Checks that a shield is a shape with one thickness, a shape with layers, or sectors.
    fn check_shielding(&self, mission: &Mission) -> Result<(), InputError> {
        let Some(shielding) = &mission.shielding else { return Ok(()) };
        let help = "geometry with thickness_mm or areal_density_g_cm2; geometry with [[shielding.layers]]; or sectors";
        let refuse = |key: &str, problem: &str| Err(self.fault(key, problem).with_help(help));
        let thicknesses = [
            shielding.thickness_mm.is_some(),
            shielding.areal_density_g_cm2.is_some(),
            !shielding.layers.is_empty(),
            shielding.sectors.is_some(),
        ];
        match (shielding.geometry, &shielding.sectors) {
            (Some(_), Some(_)) => return refuse("shielding.sectors", "sectors stand in place of geometry"),
            (None, None) => {
                let problem = "`shielding.geometry` is missing: the shape of the shield (\"sphere\" or \"slab\")";
                return Err(InputError { place: self.place("shielding"), ..self.fault("", problem) }.with_help(help));
            }
            _ => {}
        }
        match thicknesses.iter().filter(|given| **given).count() {
            0 => {
                let problem = "`shielding.thickness_mm` is missing: the thickness of the shield (mm)";
                return Err(InputError { place: self.place("shielding"), ..self.fault("", problem) }.with_help(help));
            }
            1 => {}
            _ => {
                let key = if thicknesses[1] { "shielding.areal_density_g_cm2" } else { "shielding.thickness_mm" };
                return refuse(key, "the thickness of the shield is given twice");
            }
        }
        for (index, layer) in shielding.layers.iter().enumerate() {
            if layer.thickness_mm.is_some() == layer.areal_density_g_cm2.is_some() {
                let problem = "a layer needs thickness_mm (mm) or areal_density_g_cm2 (g/cm2), one of them";
                return Err(self.fault(&format!("shielding.layers[{index}].material"), problem));
            }
        }
        Ok(())
    }

    /// Checks that the dose is given, derived or read, in one way.
    fn check_sources(&self, mission: &Mission) -> Result<(), InputError> {
        let environment = &mission.environment;
        self.check_model_keys(environment)?;
        self.check_lists(environment)?;
        if let Some(problem) = mission.active_years_problem() {
            return Err(self.fault("environment.active_years", problem).with_help("at most mission.duration_yr"));
        }
        let given = environment.active_dose_rate_mev_g_yr.is_some();
        match environment.model {
            DoseModel::History => self.check_history(environment),
            DoseModel::Derived if given => Err(self
                .fault("environment.active_dose_rate_mev_g_yr", "the model \"derived\" derives the dose rate")
                .with_help("remove it, or take the model \"solar-cycle\"")),
            _ if given => Ok(()),
            _ => {
                self.check_derivable(mission)?;
                self.check_source_names(environment)
            }
        }
    }

    /// Checks that keys of models other than the mission's are absent.
    fn check_model_keys(&self, environment: &Environment) -> Result<(), InputError> {
        for (key, is_there, of) in [
            ("history", environment.history.is_some(), DoseModel::History),
            ("sources", environment.sources.is_some(), DoseModel::Derived),
            ("spectra", environment.spectra.is_some(), DoseModel::Derived),
            ("dose_depth", environment.dose_depth.is_some(), DoseModel::Derived),
        ] {
            if is_there && environment.model != of {
                let word = if of == DoseModel::History { "history" } else { "derived" };
                let problem = format!("{key} is for environment.model = \"{word}\"");
                return Err(self.fault(&format!("environment.{key}"), problem));
            }
        }
        Ok(())
    }

    /// Checks that the dose has a single origin, and that nothing is counted twice.
    fn check_lists(&self, environment: &Environment) -> Result<(), InputError> {
        let (sources, spectra) = (environment.sources.is_some(), environment.spectra.is_some());
        if [sources, spectra, environment.dose_depth.is_some()].iter().filter(|given| **given).count() > 1 {
            let key = if spectra { "environment.spectra" } else { "environment.dose_depth" };
            return Err(self.fault(key, "give one of sources, spectra and dose_depth: each makes the whole dose"));
        }
        for (key, list) in [("sources", &environment.sources), ("spectra", &environment.spectra)] {
            let Some(list) = list else { continue };
            if list.is_empty() {
                return Err(self
                    .fault(&format!("environment.{key}"), "the list is empty: no dose would come")
                    .with_help("name at least one, or remove the key"));
            }
            if let Some(index) = (1..list.len()).find(|index| list[..*index].contains(&list[*index])) {
                let problem = format!("\"{}\" is given twice, and would count twice", list[index]);
                return Err(self.fault(&format!("environment.{key}[{index}]"), problem));
            }
        }
        Ok(())
    }

    /// Checks that a dose history comes only from its file.
    fn check_history(&self, environment: &Environment) -> Result<(), InputError> {
        if environment.history.is_none() {
            let problem = "`environment.history` is missing: the file of the dose over time";
            return Err(InputError { place: self.place("environment"), ..self.fault("", problem) });
        }
        for (key, is_there) in [
            ("active_dose_rate_mev_g_yr", environment.active_dose_rate_mev_g_yr.is_some()),
            ("active_years", environment.active_years.is_some()),
            ("solar_phase", environment.solar_phase.is_some()),
        ] {
            if is_there {
                let problem = "the model \"history\" takes its dose from the file alone";
                return Err(self.fault(&format!("environment.{key}"), problem).with_help("remove it"));
            }
        }
        Ok(())
    }

    /// Checks that a dose that is not given follows from an orbit and a shield.
    fn check_derivable(&self, mission: &Mission) -> Result<(), InputError> {
        let environment = &mission.environment;
        let imports = environment.spectra.is_some() || environment.dose_depth.is_some();
        if mission.place().is_none() && !imports {
            let problem = "a low Earth orbit is dosed by trapped protons, which depend on its altitude and inclination: \
                           the dose cannot be derived";
            return Err(self.fault("mission.orbit", problem).with_help(
                "add [orbit] with kind = \"elements\", perigee_km, apogee_km and inclination_deg, and take the model \
                 \"derived\"; or give environment.active_dose_rate_mev_g_yr",
            ));
        }
        let has_elements = mission.orbit.as_ref().is_some_and(|orbit| orbit.kind == OrbitKind::Elements);
        if environment.model != DoseModel::Derived && has_elements {
            let problem = "this model knows solar protons alone: trapped protons would be missing";
            return Err(self
                .fault("environment.model", problem)
                .with_help("take \"derived\", or give environment.active_dose_rate_mev_g_yr"));
        }
        if mission.shielding.is_none() {
            let problem = "no dose: neither environment.active_dose_rate_mev_g_yr nor [shielding] to derive it from";
            return Err(InputError { place: self.place("environment"), ..self.fault("", problem) }.with_help(
                "add [shielding] with geometry = \"sphere\" or \"slab\" and thickness_mm, in mm of aluminium",
            ));
        }
        match mission.shield_problem() {
            Some(problem) => Err(self.fault(self.thickness_key(), problem).with_help(THINNEST_HELP)),
            None => Ok(()),
        }
    }

    /// The key that gives the thickness of a shield.
    fn thickness_key(&self) -> &'static str {
        let keys = ["shielding.thickness_mm", "shielding.areal_density_g_cm2", "shielding.layers"];
        keys.into_iter().find(|key| self.span(key).is_some()).unwrap_or("shielding.geometry")
    }

    /// Checks that sources of protons are known.
    fn check_source_names(&self, environment: &Environment) -> Result<(), InputError> {
        for (index, name) in environment.sources.iter().flatten().enumerate() {
            if source::source(name).is_none() {
                let names = || SOURCES.iter().map(|source| source.card().name);
                let help = nearest(name, names()).map(|near| format!("did you mean \"{near}\"?"));
                let problem =
                    format!("no source is called \"{name}\"; there are: {}", names().collect::<Vec<_>>().join(", "));
                return Err(InputError { help, ..self.fault(&format!("environment.sources[{index}]"), problem) });
            }
        }
        Ok(())
    }

    /// Checks that densities are quoted at a dose or at a fluence of protons of an energy.
    fn check_reference(&self, mission: &Mission) -> Result<(), InputError> {
        let detector = &mission.detector;
        let of_fluence = (detector.reference_fluence_cm2.is_some(), detector.reference_energy_mev.is_some());
        match (detector.reference_dose_mev_g.is_some(), of_fluence) {
            (true, (false, false)) | (false, (true, true)) => Ok(()),
            (true, (true, _)) => {
                Err(self.fault("detector.reference_fluence_cm2", "give it or reference_dose_mev_g, not both"))
            }
            (true, (false, true)) => {
                Err(self
                    .fault("detector.reference_energy_mev", "it belongs to reference_fluence_cm2, which is not given"))
            }
            (false, (true, false)) => Err(self.fault(
                "detector.reference_fluence_cm2",
                "it needs reference_energy_mev, the energy of the protons (MeV)",
            )),
            (false, (false, _)) => {
                let problem = "`detector.reference_dose_mev_g` is missing: the dose of the quoted trap densities (above 0 and \
                               up to 1e15 MeV/g)";
                Err(InputError { place: self.place("detector"), ..InputError::new(&self.refused, problem) }
                    .with_help("or give reference_fluence_cm2 and reference_energy_mev"))
            }
        }
    }

    /// Checks that solar maxima are far enough apart, and known at launch.
    fn check_sun(&self, mission: &Mission) -> Result<(), InputError> {
        let environment = &mission.environment;
        let mut maxima = environment.solar_maximum.clone();
        maxima.sort_by(f64::total_cmp);
        // A small tolerance for decimal years, which are not exact.
        let overlap = |pair: &&[f64]| pair[1] - pair[0] < solar_cycle::ACTIVE_YR - 1e-6;
        if let Some(pair) = maxima.windows(2).find(overlap) {
            let problem = format!(
                "the maxima {} and {} overlap: each stands for {} active years, {ACTIVE_BEFORE_YR} yr before to \
                 {ACTIVE_AFTER_YR} yr after it",
                pair[0],
                pair[1],
                solar_cycle::ACTIVE_YR
            );
            return Err(self
                .fault("environment.solar_maximum", problem)
                .with_help("give one maximum for each cycle: maxima of the Sun were never less than 7 yr apart"));
        }
        let follows = matches!(environment.model, DoseModel::SolarCycle | DoseModel::Derived);
        if follows || mission.effects.contains_key("solar-cycle") {
            let first = environment.solar_maximum.iter().copied().fold(f64::INFINITY, f64::min);
            let start = first - ACTIVE_BEFORE_YR - (1.0 - solar_cycle::ACTIVE_SHARE) * CYCLE_YR;
            if calendar::decimal_year(mission.mission.launch.0) < start {
                let problem = format!(
                    "launch is before the list of solar maxima, which says nothing before {start:.1} (first maximum \
                     {first:.1})"
                );
                return Err(self
                    .fault("mission.launch", problem)
                    .with_help("add the earlier maximum to environment.solar_maximum, or check the year"));
            }
        }
        Ok(())
    }

    /// An error at a key (at none if `path` is empty).
    fn fault(&self, path: &str, problem: impl Into<String>) -> InputError {
        InputError { place: self.place(path), ..InputError::new(&self.refused, problem) }
    }

    /// `line 17: detector.temperature_k = -120.0`
    fn place(&self, path: &str) -> Option<String> {
        let span = self.span(path)?;
        let line = if self.lines { format!("line {}: ", line_at(self.text, span.start)) } else { String::new() };
        let value = &self.text[span];
        let shown = self.shown(path);
        if value.starts_with('[') && !value.contains('=') && lookup::find(path).is_none() {
            // The location of a table is its header.
            return Some(format!("{line}{value}"));
        }
        Some(format!("{line}{shown} = {}", shortened(value)))
    }

    /// Location of the value of a key in the text.
    fn span(&self, path: &str) -> Option<Range<usize>> {
        if path.is_empty() {
            return None;
        }
        let mut table = &self.document;
        let mut found = None;
        for part in path.split('.') {
            let (name, index) = match part.split_once('[') {
                Some((name, index)) => (name, index.trim_end_matches(']').parse::<usize>().ok()),
                None => (part, None),
            };
            let (_, mut value) = table.iter().find(|(key, _)| key.get_ref() == name)?;
            if let (Some(index), DeValue::Array(members)) = (index, value.get_ref()) {
                value = members.get(index)?;
            }
            found = Some(value.span());
            if let DeValue::Table(inner) = value.get_ref() {
                table = inner;
            }
        }
        found
    }

    /// The path as written by users: members of arrays by their names.
    fn shown(&self, path: &str) -> String {
        let mut shown = String::new();
        let mut so_far = String::new();
        for part in path.split('.') {
            for text in [&mut shown, &mut so_far] {
                if !text.is_empty() {
                    text.push('.');
                }
            }
            so_far.push_str(part);
            match part.split_once('[') {
                Some((name, index)) => {
                    let member =
                        self.span(&format!("{so_far}.name")).map(|span| self.text[span].trim_matches(['"', '\'']));
                    let number = index.trim_end_matches(']').parse::<usize>().map_or(0, |index| index + 1);
                    shown.push_str(name);
                    shown.push('.');
                    shown.push_str(&member.map_or_else(|| number.to_string(), str::to_string));
                }
                None => shown.push_str(part),
            }
        }
        shown
    }
}

/// Checks that a value is allowed for a key; `fault` makes the error message.
pub(crate) fn check_value(
    value: &DeValue,
    key: &keys::Key,
    fault: impl Fn(String) -> InputError,
) -> Result<(), InputError> {
    let wrong_kind = || wrong_kind(key, &fault);
    let check_number = |value: &DeValue| check_number(value, key, &fault);
    match (key.kind, value) {
        (Allowed::Number(..) | Allowed::Positive(..), value) => check_number(value),
        (Allowed::Integer(..), value @ DeValue::Integer(_)) => check_number(value),
        (Allowed::Numbers(..), DeValue::Array(members)) if !members.is_empty() => {
            members.iter().try_for_each(|member| check_number(member.get_ref()))
        }
        (Allowed::IntegerLists(..), DeValue::Array(lists)) if !lists.is_empty() => {
            lists.iter().try_for_each(|list| match list.get_ref() {
                DeValue::Array(members) => members.iter().try_for_each(|member| match member.get_ref() {
                    number @ DeValue::Integer(_) => check_number(number),
                    _ => Err(wrong_kind()),
                }),
                _ => Err(wrong_kind()),
            })
        }
        (Allowed::Choice(words), DeValue::String(word)) => check_choice(word, words, key, &fault),
        (Allowed::Text, DeValue::String(word)) => check_text(word, key, &fault),
        (Allowed::Texts, DeValue::Array(members))
            if members.iter().all(|member| matches!(member.get_ref(), DeValue::String(_))) =>
        {
            Ok(())
        }
        (Allowed::Date, DeValue::Datetime(datetime)) => crate::mission::Date::try_from(*datetime)
            .map(|_| ())
            .map_err(|problem| fault(format!("the {}: {problem}", key.what))),
        (Allowed::Date, DeValue::String(word)) => {
            let help = word.parse::<chrono::NaiveDate>().ok().map(|date| format!("without quotes: {date}"));
            Err(InputError { help, ..wrong_kind() })
        }
        // One value where a list is needed.
        (Allowed::Numbers(..), DeValue::Float(_) | DeValue::Integer(_)) | (Allowed::Texts, DeValue::String(_)) => {
            Err(InputError { help: Some(format!("in brackets: [{}]", written(value))), ..wrong_kind() })
        }
        _ => Err(wrong_kind()),
    }
}

/// A number or a word as it stands in a file.
fn written(value: &DeValue) -> String {
    match value {
        DeValue::Float(float) => float.as_str().to_string(),
        DeValue::Integer(integer) => integer.to_string(),
        DeValue::String(word) => format!("{word:?}"),
        _ => String::new(),
    }
}

fn wrong_kind(key: &keys::Key, fault: &impl Fn(String) -> InputError) -> InputError {
    fault(format!("the {} is of the wrong kind; allowed: {}", key.what, key.kind.allowed(key.unit)))
}

fn check_number(value: &DeValue, key: &keys::Key, fault: &impl Fn(String) -> InputError) -> Result<(), InputError> {
    let number = match value {
        DeValue::Float(float) => float.as_str().parse::<f64>().ok(),
        DeValue::Integer(integer) => i64::from_str_radix(integer.as_str(), integer.radix()).ok().map(|i| i as f64),
        _ => None,
    };
    let number = number.ok_or_else(|| wrong_kind(key, fault))?;
    if key.kind.refuses(number) {
        let unit = if key.unit.is_empty() { String::new() } else { format!(" {}", key.unit) };
        let allowed = key.kind.allowed(key.unit);
        let problem = format!("the {} is {}{unit}; allowed: {allowed}", key.what, keys::plain(number));
        return Err(InputError { help: (key.help)(number), ..fault(problem) });
    }
    Ok(())
}

fn check_choice(
    word: &str,
    words: &[&str],
    key: &keys::Key,
    fault: &impl Fn(String) -> InputError,
) -> Result<(), InputError> {
    if words.contains(&word) {
        return Ok(());
    }
    let near = || nearest(word, words.iter().copied()).map(|near| format!("did you mean \"{near}\"?"));
    let help = (key.help_on_word)(word).or_else(near);
    let problem = format!("the {} is \"{word}\"; allowed: {}", key.what, key.kind.allowed(key.unit));
    Err(InputError { help, ..fault(problem) })
}

/// Checks that text is not empty; names are written into tables, one per row.
fn check_text(word: &str, key: &keys::Key, fault: &impl Fn(String) -> InputError) -> Result<(), InputError> {
    if key.is_name() && word.contains(char::is_control) {
        return Err(fault(format!("the {} holds an end of a line, a tab or another control character", key.what)));
    }
    if word.trim().is_empty() {
        return Err(wrong_kind(key, fault));
    }
    Ok(())
}

/// Line of a byte offset in a text, from 1.
pub(crate) fn line_at(text: &str, place: usize) -> usize {
    text[..place.min(text.len())].matches('\n').count() + 1
}

/// Names unnamed tables of an effect, if it has a default name: `extra`, `extra 2`, and so on.
fn name_each(table: &mut toml::Table, entry: &Entry) {
    let Some(Need::Default(default)) = entry.card.key("name").map(|key| key.need) else { return };
    let places = effect_places(table, entry.card.kind);
    if places.len() < 2 {
        return;
    }
    let first = default_value(default);
    let named = |table: &toml::Table, place: &String| {
        get(table, &format!("{place}.name")).and_then(Value::as_str).map(str::to_string)
    };
    let mut taken: Vec<String> = places.iter().filter_map(|place| named(table, place)).collect();
    for place in &places {
        let path = format!("{place}.name");
        if get(table, &path).is_none() {
            let name = effect::new_name(first.as_str().unwrap_or_default(), &taken);
            set(table, &path, name.clone().into());
            taken.push(name);
        }
    }
}

/// Paths of the tables of an effect: `effects.KIND`, or `effects.KIND[0]` and so on if there are several.
fn effect_places(table: &toml::Table, kind: &str) -> Vec<String> {
    match table.get("effects").and_then(|effects| effects.get(kind)) {
        Some(Value::Array(members)) => (0..members.len()).map(|index| format!("effects.{kind}[{index}]")).collect(),
        Some(_) => vec![format!("effects.{kind}")],
        None => Vec::new(),
    }
}

/// `detector.traps.VV.release_ms` → `detector.traps[1].release_ms`, or the fault and what to try.
///
/// Effects are called by their kind, several of one kind by their number, from 1: `effects.solar-flare.2.t_yr`.
fn resolve(table: &toml::Table, key: &str) -> Result<String, (String, Option<String>)> {
    let mut path = key.to_string();
    if let Some(below) = key.strip_prefix("effects.") {
        let (kind, rest) = below.split_once('.').unwrap_or((below, ""));
        if effect::find(kind).is_none() {
            let kinds = effect::CATALOGUE.iter().map(|entry| entry.card.kind);
            let near = nearest(kind, kinds).map(|near| format!("did you mean `{near}`?"));
            return Err((format!("no effect is called `{kind}`"), near));
        }
        let places = effect_places(table, kind);
        let several = get(table, &format!("effects.{kind}")).is_some_and(Value::is_array);
        if places.is_empty() {
            let help = format!("add [effects.{kind}] with values to start from; `ctiplan effects {kind}` lists them");
            return Err((format!("the mission has no [effects.{kind}]"), Some(help)));
        }
        path = match rest.split_once('.').and_then(|(number, rest)| Some((number.parse::<usize>().ok()?, rest))) {
            Some((number, rest)) if several && (1..=places.len()).contains(&number) => {
                format!("{}.{rest}", places[number - 1])
            }
            _ if several => {
                let help =
                    format!("say which: effects.{kind}.1.PARAMETER to effects.{kind}.{}.PARAMETER", places.len());
                return Err((format!("the mission has {} [[effects.{kind}]]", places.len()), Some(help)));
            }
            _ => path,
        };
    }
    for (array, called) in ARRAYS {
        let array = match path.find(array) {
            Some(0) => array.to_string(),
            // The species of an effect.
            _ if called == "trap species" && path.starts_with("effects.") && path.contains(".traps.") => {
                format!("{}.traps", path.split(".traps.").next().expect("a first part"))
            }
            _ => continue,
        };
        let Some(rest) = path.strip_prefix(&array).and_then(|rest| rest.strip_prefix('.')) else { continue };
        let members = get(table, &array).and_then(Value::as_array).cloned().unwrap_or_default();
        let names: Vec<&str> = members.iter().filter_map(|member| member.get("name")?.as_str()).collect();
        for (index, name) in names.iter().enumerate() {
            if let Some(field) = rest.strip_prefix(name).and_then(|rest| rest.strip_prefix('.')) {
                return known(format!("{array}[{index}].{field}"), key);
            }
        }
        let name = rest.rsplit_once('.').map_or(rest, |(name, _)| name);
        let near = nearest(name, names.iter().copied()).map(|near| format!("did you mean \"{near}\"?"));
        return Err((format!("there is no {called} \"{name}\"; there are: {}", names.join(", ")), near));
    }
    // Parameters of any name must exist.
    let any_name = effect::find_key(&path).is_some_and(|key| key.path == "*");
    if any_name && get(table, &path).is_none() {
        let (parent, name) = path.rsplit_once('.').expect("a table and a key");
        let there = get(table, parent).and_then(Value::as_table).map(|table| table.keys().cloned().collect::<Vec<_>>());
        return Err((
            format!("there is no `{name}` in {parent}; there are: {}", there.unwrap_or_default().join(", ")),
            None,
        ));
    }
    known(path, key)
}

/// The path, if it is that of a key.
fn known(path: String, key: &str) -> Result<String, (String, Option<String>)> {
    if lookup::find(&path).is_some() {
        return Ok(path);
    }
    let pattern = keys::pattern_of(&path);
    if let Some((parent, _)) = pattern.rsplit_once('.').filter(|(parent, _)| parent.starts_with("effects.")) {
        return Err((
            format!("no key is called `{key}`"),
            Some(format!("known here: {}", lookup::members(parent).join(", "))),
        ));
    }
    let near = nearest(&pattern, KEYS.iter().map(|key| key.path));
    Err((
        format!("no key is called `{key}`"),
        near.map(|near| format!("did you mean `{}`?", near.replace("[]", ".NAME"))),
    ))
}

/// The default of a key, as a value.
fn default_value(default: &str) -> Value {
    let table: toml::Table = format!("value = {default}").parse().expect("defaults are TOML");
    table["value"].clone()
}

/// Whether a key has a value other than its default.
fn is_set(table: &toml::Table, path: &str) -> bool {
    let default = lookup::find(path).and_then(|key| match key.need {
        Need::Default(default) => Some(default_value(default)),
        _ => None,
    });
    get(table, path).is_some_and(|value| Some(value) != default.as_ref())
}

/// The value at `a.b[2].c`.
fn get<'a>(table: &'a toml::Table, path: &str) -> Option<&'a Value> {
    let mut parts = path.split('.');
    let mut value = member(|name| table.get(name), parts.next()?)?;
    for part in parts {
        value = member(|name| value.get(name), part)?;
    }
    Some(value)
}

fn member<'a>(get: impl Fn(&str) -> Option<&'a Value>, part: &str) -> Option<&'a Value> {
    match part.split_once('[') {
        Some((name, index)) => get(name)?.get(index.trim_end_matches(']').parse::<usize>().ok()?),
        None => get(part),
    }
}

/// Sets the value at `a.b[2].c`, creating intermediate tables; members of arrays must exist.
fn set(table: &mut toml::Table, path: &str, value: Value) {
    let Some((first, rest)) = path.split_once('.') else {
        table.insert(path.to_string(), value);
        return;
    };
    let inner = match first.split_once('[') {
        Some((name, index)) => {
            let index: usize = index.trim_end_matches(']').parse().expect("an index that was resolved");
            table.get_mut(name).and_then(|array| array.get_mut(index)).and_then(Value::as_table_mut)
        }
        None => table.entry(first).or_insert_with(|| Value::Table(toml::Table::new())).as_table_mut(),
    };
    set(inner.expect("a table that was checked"), rest, value);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_that_is_no_toml_gets_the_remedy_of_its_mistake() {
        for (line, remedy) in [
            ("duration_yr = 10,5", "numbers have a decimal point: 10.5"),
            ("launch = 01.06.2027", "dates are YYYY-MM-DD, without quotes: 2027-06-01"),
            ("launch = 2027-13-01", "dates are YYYY-MM-DD, without quotes"),
            ("name = \"a\"\nname = \"b\"", "the key is given twice: remove one of the two lines"),
            ("name = a", "the file must be TOML"),
        ] {
            let refusal = Mission::parse(&format!("[mission]\n{line}\n")).unwrap_err().to_string();
            assert!(refusal.contains(remedy), "{line}: {refusal}");
        }
    }
}
