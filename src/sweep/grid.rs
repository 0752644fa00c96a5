//! The grid file (TOML) → missions, axes and recorded quantities; the number of a point → its settings.
//!
//! All combinations of lists and ranges are computed, the last axis varying fastest. Distributions are drawn from, `draws` times at
//! every combination, with the same draws at each, so that designs are compared under the same conditions. Missions vary slowest,
//! draws fastest. A [`Grid`] that was read is valid, except for combinations of keys at single points.

use std::path::{Path, PathBuf};

use sha2::{Digest, Sha256};
use toml::Value;

use super::distribution::Distribution;
use super::output::Output;
use crate::error::InputError;
use crate::io::input;
use crate::mission::keys::Allowed;
use crate::mission::{Date, Mission};
use crate::numeric::sample_points::{Sample, Sampling};

mod read;

/// Maximum number of points of a sweep.
pub const MOST_POINTS: u64 = 100_000_000;

/// A key, and its values.
#[derive(Clone, Debug, PartialEq)]
pub struct Axis {
    /// Dotted key of the mission.
    pub key: String,
    /// Its values.
    pub values: Values,
}

/// Values of an axis.
#[derive(Clone, Debug, PartialEq)]
pub enum Values {
    /// All of these, in this order.
    Listed(Vec<Value>),
    /// One of these for each draw, with the same probability.
    Chosen(Vec<Value>),
    /// A number for each draw.
    Drawn(Distribution),
    /// The nearest integer for each draw.
    DrawnWhole(Distribution),
    /// A day for each draw, between two of them, both included.
    DrawnDays(chrono::NaiveDate, chrono::NaiveDate),
}

/// A grid file.
#[derive(Clone, Debug)]
pub struct Grid {
    /// The path as given, for messages.
    pub name: String,
    /// Missions, each with its path as the grid file writes it.
    pub missions: Vec<(String, Mission)>,
    /// Varied keys, in the order of the file.
    pub axes: Vec<Axis>,
    /// The sampling of distributions; None if there are none.
    pub sampling: Option<Sampling>,
    /// Draws at every combination of the lists; 1 if there are no distributions.
    pub draws: u64,
    /// Seed of the draws.
    pub seed: u64,
    /// Recorded quantities, in the order of the file.
    pub records: Vec<Output>,
    /// Number of points computed and written together.
    pub chunk_points: u64,
    /// Identifies the sweep: a hash of missions, axes, draws, recorded quantities, and ctiplan's version. Comments and the order of
    /// keys in the files do not matter.
    pub fingerprint: String,
    sample: Sample,
}

/// Datatype of a column of the result.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Holds {
    /// Numbers.
    Numbers,
    /// Integers.
    Integers,
    /// Text.
    Words,
    /// Days.
    Days,
}

impl Values {
    /// All values of a list, the first and the last of days that are drawn, none of other distributions.
    fn ends(&self) -> Vec<Value> {
        match self {
            Values::Listed(values) | Values::Chosen(values) => values.clone(),
            Values::DrawnDays(first, last) => {
                [*first, *last].map(|day| toml::value::Datetime::from(Date(day)).into()).to_vec()
            }
            Values::Drawn(_) | Values::DrawnWhole(_) => Vec::new(),
        }
    }
}

impl Grid {
    /// Reads a grid file and its missions.
    ///
    /// # Errors
    /// If a file cannot be read, or its content is invalid: one message with line, key, value and the allowed range.
    pub fn read(path: impl AsRef<Path>) -> Result<Grid, InputError> {
        let path = path.as_ref();
        let refused = format!("cannot use grid `{}`", path.display());
        let text = input::text(path).map_err(|problem| InputError::new(&refused, problem))?;
        let folder = path.parent().unwrap_or(Path::new(""));
        read::grid(&refused, path.display().to_string(), &text, folder)
    }

    /// The files read: the grid and its missions.
    pub fn files(&self) -> Vec<PathBuf> {
        let grid = Path::new(&self.name);
        let folder = grid.parent().unwrap_or(Path::new(""));
        [grid.to_path_buf()].into_iter().chain(self.missions.iter().map(|(path, _)| folder.join(path))).collect()
    }

    /// Number of points.
    pub fn points(&self) -> u64 {
        self.missions.len() as u64 * self.combinations() * self.draws
    }

    /// Number of combinations of listed values.
    pub fn combinations(&self) -> u64 {
        self.axes.iter().map(|axis| axis.values.listed() as u64).product()
    }

    /// Number of chunks of points.
    pub fn chunks(&self) -> u64 {
        self.points().div_ceil(self.chunk_points)
    }

    /// The points of a chunk.
    pub fn chunk(&self, chunk: u64) -> std::ops::Range<u64> {
        let start = chunk * self.chunk_points;
        start..(start + self.chunk_points).min(self.points())
    }

    /// The mission of a point, by its index, and the value of each axis there.
    pub fn point(&self, point: u64) -> (usize, Vec<(String, Value)>) {
        let mut places = self.sample.places(point % self.draws).into_iter();
        let mut rest = point / self.draws;
        let mut settings: Vec<(String, Value)> = Vec::with_capacity(self.axes.len());
        // The last list varies fastest.
        for axis in self.axes.iter().rev() {
            let listed = axis.values.listed() as u64;
            if let Values::Listed(values) = &axis.values {
                settings.push((axis.key.clone(), values[(rest % listed) as usize].clone()));
            } else {
                // Filled in below, in the order of the file.
                settings.push((axis.key.clone(), Value::Boolean(false)));
            }
            rest /= listed;
        }
        settings.reverse();
        for (axis, setting) in self.axes.iter().zip(&mut settings) {
            if !matches!(axis.values, Values::Listed(_)) {
                setting.1 = axis.values.at(places.next().expect("a place in every distribution"));
            }
        }
        (rest as usize, settings)
    }

    /// The recorded quantities, one column each: the quantity, and its galaxy.
    pub fn outputs(&self) -> Vec<(Output, Option<&str>)> {
        let mut galaxies: Vec<&str> = Vec::new();
        for (_, mission) in &self.missions {
            for galaxy in &mission.galaxies {
                if !galaxies.contains(&galaxy.name.as_str()) {
                    galaxies.push(&galaxy.name);
                }
            }
        }
        let columns = |output: &Output| -> Vec<(Output, Option<&str>)> {
            match output.of_galaxies() {
                true => galaxies.iter().map(|galaxy| (*output, Some(*galaxy))).collect(),
                false => vec![(*output, None)],
            }
        };
        self.records.iter().flat_map(columns).collect()
    }

    /// Names and datatypes of the columns of a result.
    pub fn columns(&self) -> Vec<(String, Holds)> {
        let mut columns = vec![
            ("sweep".to_string(), Holds::Words),
            ("point".to_string(), Holds::Integers),
            ("mission_file".to_string(), Holds::Words),
        ];
        columns.extend(self.axes.iter().map(|axis| (axis.key.clone(), axis.values.holds())));
        columns.extend(self.outputs().into_iter().map(|(output, galaxy)| {
            let name = match galaxy {
                Some(galaxy) => format!("{}.{galaxy}", output.name()),
                None => output.name().to_string(),
            };
            (name, Holds::Numbers)
        }));
        columns.extend([("warnings".to_string(), Holds::Words), ("problem".to_string(), Holds::Words)]);
        columns
    }

    fn hash(&self) -> String {
        let mut said = format!("ctiplan {}\n", env!("CARGO_PKG_VERSION"));
        for (name, mission) in &self.missions {
            said.push_str(&format!("{name:?}\n{}\n", mission.to_toml()));
        }
        // Numbers are written such that different ones remain different.
        said.push_str(&format!("{:?} {:?} {}\n", self.axes, self.sampling, self.draws));
        said.push_str(&format!("{} {:?} {}\n", self.seed, self.columns(), self.chunk_points));
        Sha256::digest(said.as_bytes()).iter().take(8).map(|byte| format!("{byte:02x}")).collect()
    }
}

impl Values {
    /// Number of values combined with those of other axes: 1 if they are drawn.
    fn listed(&self) -> usize {
        match self {
            Values::Listed(values) => values.len(),
            _ => 1,
        }
    }

    /// The quantile at a probability `u`.
    fn at(&self, u: f64) -> Value {
        match self {
            Values::Listed(values) | Values::Chosen(values) => {
                values[((u * values.len() as f64) as usize).min(values.len() - 1)].clone()
            }
            Values::Drawn(distribution) => Value::Float(distribution.quantile(u)),
            Values::DrawnWhole(distribution) => Value::Integer(distribution.quantile(u).round() as i64),
            Values::DrawnDays(from, to) => {
                let days = (*to - *from).num_days();
                let day = ((u * (days + 1) as f64) as i64).min(days);
                Value::Datetime(Date(*from + chrono::TimeDelta::days(day)).into())
            }
        }
    }

    fn holds(&self) -> Holds {
        match self {
            Values::Listed(values) | Values::Chosen(values) => match values[0] {
                Value::Float(_) => Holds::Numbers,
                Value::Integer(_) => Holds::Integers,
                Value::Datetime(_) => Holds::Days,
                _ => Holds::Words,
            },
            Values::Drawn(_) => Holds::Numbers,
            Values::DrawnWhole(_) => Holds::Integers,
            Values::DrawnDays(..) => Holds::Days,
        }
    }
}

/// Whether a key takes numbers, and whether integers.
fn whole(kind: Allowed) -> Option<bool> {
    match kind {
        Allowed::Number(..) | Allowed::Positive(..) => Some(false),
        Allowed::Integer(..) => Some(true),
        _ => None,
    }
}
