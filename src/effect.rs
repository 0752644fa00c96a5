//! What is added to the model: the catalogue of effects.
//!
//! A mission switches effects on in its `[effects]` tables; a fit adjusts their parameters; a diagnosis tries every one of
//! them. Each stands in one file, with its physics, its source, and what it looks like in residuals; the list below is all
//! that knows of them. To add one: a file beside the others, its `mod` line, its line in [`CATALOGUE`] (see
//! `docs/adding-an-effect.md`).
//!
//! An effect changes one quantity of the chain, by overriding the method of [`Effect`] that is called for it. Effects act in the
//! order of the list, regardless of their order in the file.

mod annealing;
mod bakeout;
mod clocking;
mod cosmic_ray_floor;
mod cycle;
mod dose_scale;
mod extra_species;
mod finite_capture;
mod formula;
mod notch;
mod preflash;
mod prelaunch_traps;
mod reach;
mod release_continuum;
mod reverse_annealing;
mod serial_traps;
mod signal_bounce;
mod signal_ringing;
mod solar_cycle;
mod solar_flare;
mod temperature_offset;
mod volume_at_zero;
mod well_fill;

use std::fmt;
use std::sync::Arc;

use ndarray::Array2;
use serde::de::DeserializeOwned;

use crate::error::InputError;
use crate::mission::keys::{Key, pattern_of};
use crate::mission::{Detector, Mission, Species};
use crate::physics::conditions::Conditions;
use crate::physics::observable::Observable;
use crate::physics::{Damage, DoseHistory, SpeciesState};
use crate::readout::{Clock, Cloud};
pub use reach::Reach;

/// All effects there are, in the order in which the physics happens.
pub static CATALOGUE: [Entry; 22] = [
    entry::<solar_cycle::SolarCycle>(),
    entry::<cycle::Cycle>(),
    entry::<solar_flare::SolarFlare>(),
    entry::<cosmic_ray_floor::CosmicRayFloor>(),
    entry::<dose_scale::DoseScale>(),
    entry::<prelaunch_traps::PrelaunchTraps>(),
    entry::<annealing::Annealing>(),
    entry::<reverse_annealing::ReverseAnnealing>(),
    entry::<bakeout::Bakeout>(),
    entry::<extra_species::ExtraSpecies>(),
    entry::<release_continuum::ReleaseContinuum>(),
    entry::<finite_capture::FiniteCapture>(),
    entry::<notch::Notch>(),
    entry::<well_fill::WellFill>(),
    entry::<volume_at_zero::VolumeAtZero>(),
    entry::<preflash::Preflash>(),
    entry::<temperature_offset::TemperatureOffset>(),
    entry::<clocking::Clocking>(),
    entry::<serial_traps::SerialTraps>(),
    entry::<signal_bounce::SignalBounce>(),
    entry::<signal_ringing::SignalRinging>(),
    entry::<formula::Formula>(),
];

/// A small change of one noun of the chain: override the method of the noun that changes. In the order of the chain.
///
/// Methods that make something once for a mission cannot fail: what they are made of was checked when the mission was read.
/// Those that are asked under given conditions can.
pub trait Effect: fmt::Debug + Send + Sync {
    /// The conditions as they really are, where thermometers and mission files are wrong.
    fn conditions(&self, _at: &mut Conditions) -> Result<(), InputError> {
        Ok(())
    }
    /// Dose over time, as a dose monitor sees it.
    fn dose(&self, _dose: &mut DoseHistory) {}
    /// Wells and trap species.
    fn detector(&self, _detector: &mut Detector) {}
    /// Formation of traps by dose, and their evolution.
    fn damage(&self, _damage: &mut Damage) {}
    /// Traps under given conditions.
    fn traps(&self, _traps: &mut [SpeciesState], _at: &Conditions) -> Result<(), InputError> {
        Ok(())
    }
    /// The height of charge clouds.
    fn cloud(&self, _cloud: &mut Cloud, _at: &Conditions) -> Result<(), InputError> {
        Ok(())
    }
    /// The phases of a pixel.
    fn clock(&self, _clock: &mut Clock, _at: &Conditions) -> Result<(), InputError> {
        Ok(())
    }
    /// The charges (e-, `[[row, column]]`) before the first transfer.
    fn charge(&self, _charge_e: &mut Array2<f64>, _at: &Conditions) -> Result<(), InputError> {
        Ok(())
    }
    /// A serial register with traps of its own.
    fn serial(&self) -> Option<SerialRegister> {
        None
    }
    /// The charges (e-, `[[row, column]]`) as the amplifier gives them out, with those before the first transfer.
    fn read(&self, _before_e: &Array2<f64>, _read_e: &mut Array2<f64>, _at: &Conditions) -> Result<(), InputError> {
        Ok(())
    }
    /// What is predicted for an observable.
    fn value(&self, _value: &mut f64, _observable: Observable, _at: &Conditions) -> Result<(), InputError> {
        Ok(())
    }

    /// Conditions, by name, on which it depends beyond those that the chain itself depends on.
    fn depends_on(&self) -> Vec<String> {
        Vec::new()
    }
}

/// A serial register: rows are clocked through it after the parallel transfers, by the same physics.
#[derive(Clone, Debug, PartialEq)]
pub struct SerialRegister {
    /// Trap species, densities at the detector's reference dose.
    pub traps: Vec<Species>,
    /// Time between two serial transfers, ms.
    pub pixel_time_ms: f64,
    /// Serial transfers of the object.
    pub transfers: u32,
}

/// What a reader needs to know of an effect.
#[derive(Clone, Copy)]
pub struct Card {
    /// Its name in `[effects.NAME]`.
    pub kind: &'static str,
    /// What it adds, in one sentence.
    pub adds: &'static str,
    /// The physics, with its formula.
    pub physics: &'static str,
    /// Where that is from.
    pub source: &'static str,
    /// Where it holds and where not.
    pub holds: &'static str,
    /// What residuals look like where it is missing from the model.
    pub residuals: &'static str,
    /// Its parameters; paths are relative to its table, and `*` stands for any name.
    pub keys: &'static [Key],
}

impl Card {
    /// The parameter of a relative path, in which `[]` stands for any member of an array.
    pub fn key(&self, pattern: &str) -> Option<&'static Key> {
        let fits = |key: &&Key| key.path == pattern || (key.path == "*" && !pattern.contains(['.', '[']));
        self.keys.iter().find(fits)
    }
}

/// A kind of effect: what the catalogue holds.
pub trait Catalogued: Effect + DeserializeOwned + 'static {
    /// What a reader needs to know.
    const CARD: Card;

    /// Its table at zero strength: in this mission it changes nothing.
    fn nothing(mission: &Mission) -> toml::Table;

    /// Its table at a strength that can be seen, as an example.
    fn example(mission: &Mission) -> toml::Table;

    /// Starting points of a search for it in some data: forms that it could take, each as tables whose changes of the predictions
    /// add up, with any weights. The strength is only known to be not below zero. Weak effects show best what free parameters
    /// absorb.
    fn trials(mission: &Mission, _reach: &Reach) -> Vec<Vec<toml::Table>> {
        vec![vec![Self::example(mission)]]
    }

    /// Whether it replaces a part of the mission, as a second one would again: a mission has one at most.
    const REPLACES: bool = false;

    /// Kinds of which it is the general case: if it is no better, they are meant.
    const GENERALISES: &'static [&'static str] = &[];

    /// Parameters that a search holds at the values of its trials: the data do not determine them.
    fn held(_reach: &Reach) -> &'static [&'static str] {
        &[]
    }

    /// Values (in the unit of each key), by dotted key, with which a fitted mission predicts the same and reads better, such as a time within the mission;
    /// none if it reads well. `key` is that of the table, `given` the mission before the fit of the `free` keys.
    fn plainer(_fitted: &Mission, _given: &Mission, _free: &[String], _key: &str) -> Vec<(String, f64)> {
        Vec::new()
    }

    /// Whether it makes sense in a mission.
    ///
    /// # Errors
    /// If it does not.
    fn check(&self, _mission: &Mission) -> Result<(), Refusal> {
        Ok(())
    }
}

/// Why an effect makes no sense in a mission.
#[derive(Clone, Debug)]
pub struct Refusal {
    /// The parameter that is wrong.
    pub key: String,
    /// What is wrong.
    pub problem: String,
    /// What to try.
    pub help: Option<String>,
}

/// Fitted mission, mission before the fit, free keys and the key of a table → values, by dotted key (see [`Catalogued::plainer`]).
pub type Plainer = fn(&Mission, &Mission, &[String], &str) -> Vec<(String, f64)>;

/// One line of the catalogue.
pub struct Entry {
    /// What a reader needs to know.
    pub card: Card,
    /// The table at zero strength.
    pub nothing: fn(&Mission) -> toml::Table,
    /// The table of an example.
    pub example: fn(&Mission) -> toml::Table,
    /// Where a search starts.
    pub trials: fn(&Mission, &Reach) -> Vec<Vec<toml::Table>>,
    /// Whether a mission has one at most.
    pub replaces: bool,
    /// Kinds of which it is the general case.
    pub generalises: &'static [&'static str],
    /// Parameters that a search holds.
    pub held: fn(&Reach) -> &'static [&'static str],
    /// Values that mean the same and read better.
    pub plainer: Plainer,
    read: fn(&toml::Table) -> Result<Arc<dyn Effect>, String>,
    check: fn(&toml::Table, &Mission) -> Result<(), Refusal>,
}

const fn entry<K: Catalogued>() -> Entry {
    fn typed<K: Catalogued>(table: &toml::Table) -> Result<K, String> {
        table.clone().try_into().map_err(|error: toml::de::Error| error.message().to_string())
    }
    Entry {
        card: K::CARD,
        nothing: K::nothing,
        example: K::example,
        trials: K::trials,
        replaces: K::REPLACES,
        generalises: K::GENERALISES,
        held: K::held,
        plainer: K::plainer,
        read: |table| Ok(Arc::new(typed::<K>(table)?)),
        check: |table, mission| {
            let effect = typed::<K>(table).map_err(|problem| Refusal { key: String::new(), problem, help: None })?;
            effect.check(mission)
        },
    }
}

impl Entry {
    /// Whether the tables of this effect make sense in a mission, by themselves already checked; the index is that of the
    /// table among several of the kind.
    ///
    /// # Errors
    /// The first that does not.
    pub(crate) fn check(&self, mission: &Mission) -> Result<(), (usize, Refusal)> {
        for (index, table) in tables(mission, self.card.kind).into_iter().enumerate() {
            if self.replaces && index > 0 {
                let problem = format!("a second {} would take the place of the first", self.card.kind);
                let help = Some("keep one of them".into());
                return Err((index, Refusal { key: String::new(), problem, help }));
            }
            (self.check)(table, mission).map_err(|refusal| (index, refusal))?;
        }
        Ok(())
    }
}

/// The catalogue's line of a kind.
pub fn find(kind: &str) -> Option<&'static Entry> {
    CATALOGUE.iter().find(|entry| entry.card.kind == kind)
}

/// The key of a dotted path below `effects`, in which `[3]` may stand for `[]`.
pub(crate) fn find_key(path: &str) -> Option<&'static Key> {
    let pattern = pattern_of(path);
    let (kind, parameter) = pattern.strip_prefix("effects.")?.split_once('.')?;
    find(kind.trim_end_matches("[]"))?.card.key(parameter)
}

/// A name that is not taken: `extra`, `extra 2`, and so on.
pub(crate) fn new_name(first: &str, taken: &[String]) -> String {
    let numbered = |number: usize| if number == 1 { first.to_string() } else { format!("{first} {number}") };
    (1..).map(numbered).find(|name| !taken.contains(name)).expect("numbers do not end")
}

/// A mission's tables of one kind.
pub(crate) fn tables<'a>(mission: &'a Mission, kind: &str) -> Vec<&'a toml::Table> {
    match mission.effects.get(kind) {
        Some(toml::Value::Table(table)) => vec![table],
        Some(toml::Value::Array(members)) => members.iter().filter_map(toml::Value::as_table).collect(),
        _ => Vec::new(),
    }
}

/// The table of a dotted key as [`add_effect`](crate::mission_file::add_effect) gives it.
pub(crate) fn table<'a>(mission: &'a Mission, key: &str) -> Option<&'a toml::Table> {
    let mut parts = key.split('.').skip(1);
    let kind = parts.next()?;
    let place = parts.next().map_or(Some(1), |number| number.parse::<usize>().ok())?;
    tables(mission, kind).into_iter().nth(place.checked_sub(1)?)
}

/// The effects of a mission, in the order of the catalogue.
pub fn of(mission: &Mission) -> Vec<Arc<dyn Effect>> {
    let read = |entry: &'static Entry| {
        let effect =
            |table: &toml::Table| (entry.read)(table).expect("a mission's effects were checked when it was read");
        tables(mission, entry.card.kind).into_iter().map(effect).collect::<Vec<_>>()
    };
    CATALOGUE.iter().flat_map(read).collect()
}

/// Most epochs at which a search looks for an event.
pub(crate) const EVENT_EPOCHS: usize = 48;

/// A table of numbers.
fn numbers(values: &[(&str, f64)]) -> toml::Table {
    values.iter().map(|(key, value)| (key.to_string(), toml::Value::Float(*value))).collect()
}
