//! `ctiplan predict`: what the model expects under the conditions of a table.

use std::collections::HashMap;

use clap::Args;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use super::inputs::OneMission;
use super::{Failure, Outcome, say, swapped};
use crate::analysis::measurement::{DataSet, questions};
use crate::cli::file_argument::{InputFile, OutputFile, Overwrite};
use crate::error::InputError;
use crate::io::atomic_file;
use crate::io::table::{Cell, Column, Datatype, Table};
use crate::mission::Mission;
use crate::model::Model;
use crate::model::predict::predict;
use crate::physics::observable::Observable;
use crate::sweep::quoted;

#[derive(Debug, Args)]
pub(super) struct Predict {
    #[command(flatten)]
    mission: OneMission,
    /// Measurement file (ECSV, CSV or Parquet) with the conditions; a column `value` is not needed, nor, without --noise, `sigma`
    #[arg(value_name = "TABLE")]
    table: InputFile,
    /// Measurement file to write (ECSV): the table with the predicted `value`; without it, standard output
    #[arg(long, value_name = "FILE")]
    out: Option<OutputFile>,
    /// Add normal noise of the table's `sigma`; the part `sigma_common` is the same in all rows of a group
    #[arg(long)]
    noise: bool,
    /// Seed of the noise, instead of the mission's
    #[arg(long, value_name = "SEED", requires = "noise")]
    seed: Option<u64>,
    #[command(flatten)]
    overwrite: Overwrite,
}

impl Predict {
    pub(super) fn run(&self) -> Result<Outcome, Failure> {
        let mission = self.mission.read()?;
        if let Some(path) = &self.out {
            atomic_file::refuse_unwritable(path)?;
        }
        let table = Table::read(&self.table).map_err(|error| swapped::hint_of_data(error, &self.table))?;
        let seed = self.noise.then(|| self.seed.unwrap_or(mission.accuracy.seed));
        let table = predicted(&mission, table, seed)?;
        let Some(path) = &self.out else {
            say(&table.to_ecsv())?;
            return Ok(Outcome::Done);
        };
        atomic_file::write(path, table.to_ecsv())?;
        let noise = seed.map_or(String::new(), |seed| format!(" with noise of seed {seed}"));
        let (rows, file, mission) = (table.rows(), quoted(path), self.mission.words());
        say(&format!("{rows} rows{noise} written to {file}\n\nnext: ctiplan validate {mission} {file}\n"))?;
        Ok(Outcome::Done)
    }
}

/// The table with the values that the model predicts, as `validate` does; with a seed, noise is added to them.
fn predicted(mission: &Mission, mut table: Table, noise_seed: Option<u64>) -> Result<Table, InputError> {
    let given = |table: &Table, name: &str| table.column(name).is_some() || table.meta(name).is_some();
    // What reads measurements needs values and errors, on which no prediction depends.
    let mut asked = table.clone();
    fill(&mut asked, "value", None, vec![0.0; table.rows()]);
    if noise_seed.is_none() && !given(&table, "sigma") {
        fill(&mut asked, "sigma", None, vec![1.0; table.rows()]);
    }
    let set = DataSet::of(asked.clone(), mission)?;
    let mut values = predict(&Model::new(mission), &questions(std::slice::from_ref(&set)))?;
    if let Some(row) = values.iter().position(|value| !value.is_finite()) {
        let fault = table.fault(Some(row), None, format!("the model has no {} here", set.observable));
        return Err(fault.with_help("the galaxy has lost its shape: so large a change cannot be measured"));
    }
    let unit = unit(set.observable);
    if let Some(seed) = noise_seed {
        // Floors may be shares of the value: errors are those of the predicted values.
        fill(&mut asked, "value", unit, values.clone());
        add_noise(&mut values, &DataSet::of(asked, mission)?, seed);
    }
    fill(&mut table, "value", unit, values);
    Ok(table)
}

/// Adds errors as the rows quote them, in the order of the rows.
fn add_noise(values: &mut [f64], set: &DataSet, seed: u64) {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut normal = || -> f64 { StandardNormal.sample(&mut random) };
    let mut of_group: HashMap<usize, f64> = HashMap::new();
    for (value, row) in values.iter_mut().zip(&set.rows) {
        *value += row.own_sigma() * normal();
        if row.common.sigma > 0.0 {
            *value += row.common.sigma * *of_group.entry(row.common.group).or_insert_with(&mut normal);
        }
    }
}

/// Sets a column of numbers, in its place if there is one; without a unit, that of the column stays.
fn fill(table: &mut Table, name: &str, unit: Option<&str>, values: Vec<f64>) {
    let old = table.columns.iter().position(|column| column.name == name);
    let kept = old.and_then(|place| table.columns[place].unit.clone());
    let column = Column {
        name: name.into(),
        unit: unit.map(str::to_string).or(kept),
        datatype: Datatype::Float(64),
        cells: values.into_iter().map(Cell::Number).collect(),
        ..Column::default()
    };
    match old {
        Some(place) => table.columns[place] = column,
        None => table.columns.push(column),
    }
}

/// Unit of an observable in astropy's spelling.
fn unit(observable: Observable) -> Option<&'static str> {
    match observable.unit() {
        "" => None,
        "e-" => Some("electron"),
        "px" => Some("pix"),
        unit => Some(unit),
    }
}
