//! Additions to the model: the catalogue of effects.
//!
//! A mission switches effects on in its `[effects]` tables; a fit adjusts their parameters; a diagnosis tries each of them. Each
//! has one file, with its physics, its source, and its appearance in residuals; they are registered only in the list below. To add
//! one: a file beside the others, its `mod` line, its line in [`CATALOGUE`] (see `docs/adding-an-effect.md`).
//!
//! An effect changes one quantity of the chain, by overriding the corresponding method of [`Effect`]. Effects act in the order of
//! the list, regardless of their order in the file.

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
mod sacrificial_charge;
mod serial_traps;
mod signal_bounce;
mod signal_ringing;
mod solar_cycle;
mod solar_flare;
mod temperature_cycle;
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

/// All effects, in the order of the physics.
pub static CATALOGUE: [Entry; 24] = [
    entry::<solar_cycle::SolarCycle>(),
    entry::<cycle::Cycle>(),
    entry::<solar_flare::SolarFlare>(),
    entry::<cosmic_ray_floor::CosmicRayFloor>(),
    entry::<dose_scale::DoseScale>(),
    entry::<prelaunch_traps::PrelaunchTraps>(),
    entry::<annealing::Annealing>(),
    entry::<reverse_annealing::ReverseAnnealing>(),
    entry::<bakeout::Bakeout>(),
    entry::<sacrificial_charge::SacrificialCharge>(),
    entry::<extra_species::ExtraSpecies>(),
    entry::<release_continuum::ReleaseContinuum>(),
    entry::<finite_capture::FiniteCapture>(),
    entry::<notch::Notch>(),
    entry::<well_fill::WellFill>(),
    entry::<volume_at_zero::VolumeAtZero>(),
    entry::<preflash::Preflash>(),
    entry::<temperature_offset::TemperatureOffset>(),
    entry::<temperature_cycle::TemperatureCycle>(),
    entry::<clocking::Clocking>(),
    entry::<serial_traps::SerialTraps>(),
    entry::<signal_bounce::SignalBounce>(),
    entry::<signal_ringing::SignalRinging>(),
    entry::<formula::Formula>(),
];

/// A small change of one element of the chain: override the method of that element. In the order of the chain.
///
/// Methods called once per mission cannot fail: their parameters were checked when the mission was read. Those called with
/// conditions can.
pub trait Effect: fmt::Debug + Send + Sync {
    /// The true conditions, if thermometers and mission files are wrong.
    fn conditions(&self, _at: &mut Conditions) -> Result<(), InputError> {
        Ok(())
    }
    /// Dose over time, as measured by a dose monitor.
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
    /// A serial register with its own traps.
    fn serial(&self) -> Option<SerialRegister> {
        None
    }
    /// The charges (e-, `[[row, column]]`) as output by the amplifier, with those before the first transfer.
    fn read(&self, _before_e: &Array2<f64>, _read_e: &mut Array2<f64>, _at: &Conditions) -> Result<(), InputError> {
        Ok(())
    }
    /// The predicted value of an observable.
    fn value(&self, _value: &mut f64, _observable: Observable, _at: &Conditions) -> Result<(), InputError> {
        Ok(())
    }

    /// Conditions, by name, on which it depends in addition to those of the chain itself.
    fn depends_on(&self) -> Vec<String> {
        Vec::new()
    }
}

/// A serial register: rows are clocked through it after the parallel transfers, with the same physics.
#[derive(Clone, Debug, PartialEq)]
pub struct SerialRegister {
    /// Trap species, densities at the detector's reference dose.
    pub traps: Vec<Species>,
    /// Time between two serial transfers, ms.
    pub pixel_time_ms: f64,
    /// Serial transfers of the object.
    pub transfers: u32,
}

/// Description of an effect.
#[derive(Clone, Copy)]
pub struct Card {
    /// Its name in `[effects.NAME]`.
    pub kind: &'static str,
    /// The addition, in one sentence.
    pub adds: &'static str,
    /// The physics, with its formula.
    pub physics: &'static str,
    /// Source of the physics.
    pub source: &'static str,
    /// Range of validity.
    pub holds: &'static str,
    /// Appearance of residuals if it is missing from the model.
    pub residuals: &'static str,
    /// Its parameters; paths are relative to its table, and `*` matches any name.
    pub keys: &'static [Key],
}

impl Card {
    /// The parameter with a relative path, in which `[]` matches any member of an array.
    pub fn key(&self, pattern: &str) -> Option<&'static Key> {
        let fits = |key: &&Key| key.path == pattern || (key.path == "*" && !pattern.contains(['.', '[']));
        self.keys.iter().find(fits)
    }
}

/// A kind of effect, as registered in the catalogue.
pub trait Catalogued: Effect + DeserializeOwned + 'static {
    /// Its description.
    const CARD: Card;

    /// Its table at zero strength, without effect in this mission.
    fn nothing(mission: &Mission) -> toml::Table;

    /// Its table at a visible strength, as an example.
    fn example(mission: &Mission) -> toml::Table;

    /// Starting points of a search in some data: possible forms, each as tables whose changes of the predictions add up, with any
    /// weights. The strength is only known to be non-negative. Weak effects best show what free parameters absorb.
    fn trials(mission: &Mission, _reach: &Reach) -> Vec<Vec<toml::Table>> {
        vec![vec![Self::example(mission)]]
    }

    /// Whether it replaces a part of the mission, as a second one would again: a mission has at most one.
    const REPLACES: bool = false;

    /// Kinds of which it is the general case: unless it is better, they are preferred.
    const GENERALISES: &'static [&'static str] = &[];

    /// Parameters that a search fixes at the values of its trials: the data do not determine them.
    fn held(_reach: &Reach) -> &'static [&'static str] {
        &[]
    }

    /// Values (in the unit of each key), by dotted key, with which a fitted mission gives the same predictions and is easier to
    /// read, such as a time within the mission; empty if it already is. `key` is that of the table.
    fn plainer(_after: &AfterFit, _key: &str) -> Vec<(String, f64)> {
        Vec::new()
    }

    /// Checks that it is valid in a mission.
    ///
    /// # Errors
    /// If it is not.
    fn check(&self, _mission: &Mission) -> Result<(), Refusal> {
        Ok(())
    }
}

/// Why an effect is invalid in a mission.
#[derive(Clone, Debug)]
pub struct Refusal {
    /// The invalid parameter.
    pub key: String,
    /// The fault.
    pub problem: String,
    /// What to try.
    pub help: Option<String>,
}

/// A fit, as effects see it.
#[derive(Clone, Copy, Debug)]
pub struct AfterFit<'a> {
    /// The fitted mission.
    pub fitted: &'a Mission,
    /// The mission before the fit.
    pub given: &'a Mission,
    /// Keys of the mission, apart from effects that were added, that were free.
    pub free: &'a [String],
    /// Epochs of the data, years since launch, ascending.
    pub epochs_yr: &'a [f64],
}

/// A fit and the key of a table → values, by dotted key (see [`Catalogued::plainer`]).
pub type Plainer = fn(&AfterFit, &str) -> Vec<(String, f64)>;

/// One line of the catalogue.
pub struct Entry {
    /// Its description.
    pub card: Card,
    /// The table at zero strength.
    pub nothing: fn(&Mission) -> toml::Table,
    /// The table of an example.
    pub example: fn(&Mission) -> toml::Table,
    /// Starting points of a search.
    pub trials: fn(&Mission, &Reach) -> Vec<Vec<toml::Table>>,
    /// Whether a mission has at most one.
    pub replaces: bool,
    /// Kinds of which it is the general case.
    pub generalises: &'static [&'static str],
    /// Parameters that a search fixes.
    pub held: fn(&Reach) -> &'static [&'static str],
    /// Equivalent values that are easier to read.
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
    /// Checks the tables of this effect, already valid by themselves, in a mission; the index is that of the table among several of
    /// the kind.
    ///
    /// # Errors
    /// That of the first invalid one.
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

/// The catalogue's entry for a kind.
pub fn find(kind: &str) -> Option<&'static Entry> {
    CATALOGUE.iter().find(|entry| entry.card.kind == kind)
}

/// The key of a dotted path below `effects`, in which `[3]` may replace `[]`.
pub(crate) fn find_key(path: &str) -> Option<&'static Key> {
    let pattern = pattern_of(path);
    let (kind, parameter) = pattern.strip_prefix("effects.")?.split_once('.')?;
    find(kind.trim_end_matches("[]"))?.card.key(parameter)
}

/// An unused name: `extra`, `extra 2`, and so on.
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

/// The table of a dotted key from [`add_effect`](crate::mission_file::add_effect).
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

/// Maximum number of epochs at which a search tries an event.
pub(crate) const EVENT_EPOCHS: usize = 48;

/// A table of numbers.
fn numbers(values: &[(&str, f64)]) -> toml::Table {
    values.iter().map(|(key, value)| (key.to_string(), toml::Value::Float(*value))).collect()
}
