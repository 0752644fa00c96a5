//! Real numbers of a mission by their dotted keys, changed without re-reading the text.
//!
//! A fit needs thousands of missions that differ in a few numbers: it finds each key once, as a [`Handle`]. [`Mission::with`] uses
//! this method if it can, and the text, with all its checks and messages, if it cannot: for a key that is absent, a value that is
//! not allowed, or anything but real numbers. Both methods give the same mission (a test over all keys).

use toml::Value;

use super::imported::THINNEST_G_CM2;
use super::lookup;
use crate::effect;
use crate::mission::keys::{self, Allowed, Key};
use crate::mission::{DoseModel, Galaxy, Mission, Species};

impl Mission {
    /// The mission with other real numbers; None if one of them is no longer present, or not allowed.
    pub(crate) fn with_handles<'a>(&self, numbers: impl Iterator<Item = (&'a Handle, f64)>) -> Option<Mission> {
        let mut mission = self.clone();
        for (handle, value) in numbers {
            handle.set(&mut mission, value)?;
        }
        let agrees = mission.notch_problem().is_none()
            && mission.surface_problem().is_none()
            && mission.orbit_problem().is_none()
            && mission.history_problem().is_none()
            && mission.active_years_problem().is_none()
            && mission.shield_problem().is_none()
            && effect::CATALOGUE.iter().all(|entry| entry.check(&mission).is_ok());
        agrees.then_some(mission)
    }

    /// The same by dotted keys; None also if a key is not that of an existing real number, or is duplicate.
    pub(super) fn with_numbers(&self, settings: &[(String, Value)]) -> Option<Mission> {
        let twice = |index: usize| settings[..index].iter().any(|(other, _)| *other == settings[index].0);
        if (0..settings.len()).any(twice) {
            return None;
        }
        let number = |(key, value): &(String, Value)| Some((Handle::of(self, key)?, value.as_float()?));
        let numbers: Vec<(Handle, f64)> = settings.iter().map(number).collect::<Option<_>>()?;
        self.with_handles(numbers.iter().map(|(handle, value)| (handle, *value)))
    }

    /// The fault in the elements of the orbit, if the perigee is above the apogee.
    pub(super) fn orbit_problem(&self) -> Option<String> {
        let (perigee_km, apogee_km) = (self.orbit.as_ref()?.perigee_km?, self.orbit.as_ref()?.apogee_km?);
        (perigee_km > apogee_km)
            .then(|| format!("the perigee ({perigee_km} km) must not be above the apogee ({apogee_km} km)"))
    }

    /// The fault in the dose history, if it ends before the mission.
    pub(super) fn history_problem(&self) -> Option<String> {
        let (last_yr, _) = self.imported.history.last()?;
        let duration_yr = self.mission.duration_yr;
        // A tolerance of one day for dates.
        (*last_yr + 0.003 < duration_yr)
            .then(|| format!("the history ends after {last_yr:.3} yr, but the mission lasts {duration_yr} yr"))
    }

    /// The fault in given active years, if the mission is too short for them.
    pub(super) fn active_years_problem(&self) -> Option<String> {
        let (years, duration_yr) = (self.environment.active_years?, self.mission.duration_yr);
        (years > duration_yr).then(|| format!("{years} active years of the Sun in a mission of {duration_yr} yr"))
    }

    /// The fault in a shield, if its dose is derived and it is too thin for that. Sectors are checked when their file is read.
    pub(super) fn shield_problem(&self) -> Option<String> {
        let environment = &self.environment;
        let read = environment.model == DoseModel::History
            || environment.active_dose_rate_mev_g_yr.is_some()
            || environment.spectra.is_some()
            || environment.dose_depth.is_some();
        let has_shape = self.shielding.as_ref()?.geometry.is_some();
        let [areal_g_cm2, _] = self.shield().filter(|_| has_shape && !read)?.typical_g_cm2();
        (areal_g_cm2 < THINNEST_G_CM2).then(|| {
            let areal_g_cm2 = keys::plain(areal_g_cm2);
            format!("a shield of {areal_g_cm2} g/cm2: at least {THINNEST_G_CM2} g/cm2 are needed to derive a dose")
        })
    }

    /// The first surface species whose level is not below the full well, by its index, and the fault.
    pub(super) fn surface_problem(&self) -> Option<(usize, String)> {
        let full_well_e = self.detector.full_well_e;
        let level = |species: &Species| species.surface_level_e.filter(|level_e| *level_e >= full_well_e);
        self.detector.traps.iter().enumerate().find_map(|(index, species)| {
            let level_e = level(species)?;
            let (level, full_well) = (keys::plain(level_e), keys::plain(full_well_e));
            Some((index, format!("the level ({level} e-) must be below the full well ({full_well} e-)")))
        })
    }

    /// The fault in the notch, if it is not below the full well.
    pub(super) fn notch_problem(&self) -> Option<String> {
        let detector = &self.detector;
        (detector.notch_e >= detector.full_well_e).then(|| {
            format!(
                "the notch ({} e-) must be below the full well ({} e-)",
                keys::plain(detector.notch_e),
                keys::plain(detector.full_well_e)
            )
        })
    }
}

/// Location of a real number in a mission: found once from its dotted key, and valid in every mission that differs only in numbers.
#[derive(Clone, Debug)]
pub struct Handle {
    place: Place,
    known: &'static Key,
}

#[derive(Clone, Debug)]
enum Place {
    Plain(fn(&mut Mission) -> Option<&mut f64>),
    /// Of a species or a galaxy, by its index.
    Species(usize, fn(&mut Species) -> Option<&mut f64>),
    Galaxy(usize, fn(&mut Galaxy) -> Option<&mut f64>),
    /// Of an effect's table: its kind, its index if there are several tables, the index of its species, and the name.
    Effect {
        kind: &'static str,
        table: Option<usize>,
        species: Option<usize>,
        name: String,
    },
}

impl Handle {
    /// The handle of a dotted key; None if it is not that of an existing real number.
    pub fn of(mission: &Mission, key: &str) -> Option<Handle> {
        let (place, known) = if let Some(below) = key.strip_prefix("effects.") {
            of_effect(&mission.effects, below)?
        } else if let Some(below) = key.strip_prefix("detector.traps.") {
            let (index, field) = member(&mission.detector.traps, |species| &species.name, below)?;
            (Place::Species(index, of_species(field)?), lookup::find(&format!("detector.traps[].{field}"))?)
        } else if let Some(below) = key.strip_prefix("galaxies.") {
            let (index, field) = member(&mission.galaxies, |galaxy| &galaxy.name, below)?;
            (Place::Galaxy(index, of_galaxy(field)?), lookup::find(&format!("galaxies[].{field}"))?)
        } else {
            (Place::Plain(plain(key)?), lookup::find(key)?)
        };
        let is_real = matches!(known.kind, Allowed::Number(..) | Allowed::Positive(..));
        is_real.then_some(Handle { place, known })
    }

    /// Sets the number; None if it is absent, or the value is not allowed.
    fn set(&self, mission: &mut Mission, value: f64) -> Option<()> {
        let number = match &self.place {
            Place::Plain(number) => number(mission)?,
            Place::Species(index, number) => number(mission.detector.traps.get_mut(*index)?)?,
            Place::Galaxy(index, number) => number(mission.galaxies.get_mut(*index)?)?,
            Place::Effect { kind, table, species, name } => {
                let mut found = mission.effects.get_mut(*kind)?;
                if let Some(index) = table {
                    found = found.get_mut(*index)?;
                }
                if let Some(index) = species {
                    found = found.get_mut("traps")?.get_mut(*index)?;
                }
                match found.get_mut(name.as_str())? {
                    Value::Float(number) => number,
                    _ => return None,
                }
            }
        };
        *number = Some(value).filter(|value| value.is_finite() && !self.known.kind.refuses(*value))?;
        Some(())
    }
}

/// The number of a key that is not a member of an array.
fn plain(key: &str) -> Option<fn(&mut Mission) -> Option<&mut f64>> {
    Some(match key {
        "mission.duration_yr" => |mission| Some(&mut mission.mission.duration_yr),
        "environment.active_dose_rate_mev_g_yr" => |mission| mission.environment.active_dose_rate_mev_g_yr.as_mut(),
        "environment.confidence" => |mission| Some(&mut mission.environment.confidence),
        "environment.cosmic_ray_floor_mev_g_yr" => |mission| Some(&mut mission.environment.cosmic_ray_floor_mev_g_yr),
        "environment.nuclei_over_protons" => |mission| Some(&mut mission.environment.nuclei_over_protons),
        "environment.dose_factor" => |mission| Some(&mut mission.environment.dose_factor),
        "environment.active_years" => |mission| mission.environment.active_years.as_mut(),
        "orbit.perigee_km" => |mission| mission.orbit.as_mut()?.perigee_km.as_mut(),
        "orbit.apogee_km" => |mission| mission.orbit.as_mut()?.apogee_km.as_mut(),
        "orbit.inclination_deg" => |mission| mission.orbit.as_mut()?.inclination_deg.as_mut(),
        "orbit.argument_of_perigee_deg" => |mission| mission.orbit.as_mut()?.argument_of_perigee_deg.as_mut(),
        "shielding.thickness_mm" => |mission| mission.shielding.as_mut()?.thickness_mm.as_mut(),
        "shielding.areal_density_g_cm2" => |mission| mission.shielding.as_mut()?.areal_density_g_cm2.as_mut(),
        "detector.full_well_e" => |mission| Some(&mut mission.detector.full_well_e),
        "detector.notch_e" => |mission| Some(&mut mission.detector.notch_e),
        "detector.well_fill_power" => |mission| Some(&mut mission.detector.well_fill_power),
        "detector.volume_at_zero" => |mission| Some(&mut mission.detector.volume_at_zero),
        "detector.temperature_k" => |mission| Some(&mut mission.detector.temperature_k),
        "detector.reference_temperature_k" => |mission| Some(&mut mission.detector.reference_temperature_k),
        "detector.reference_dose_mev_g" => |mission| mission.detector.reference_dose_mev_g.as_mut(),
        "detector.reference_fluence_cm2" => |mission| mission.detector.reference_fluence_cm2.as_mut(),
        "detector.reference_energy_mev" => |mission| mission.detector.reference_energy_mev.as_mut(),
        "readout.line_time_ms" => |mission| Some(&mut mission.readout.line_time_ms),
        "readout.store.burst_line_time_ms" => |mission| Some(&mut mission.readout.store.as_mut()?.burst_line_time_ms),
        "readout.store.trap_ratio" => |mission| Some(&mut mission.readout.store.as_mut()?.trap_ratio),
        "sky.background_e" => |mission| Some(&mut mission.sky.background_e),
        "psf.fwhm_px" => |mission| Some(&mut mission.psf.fwhm_px),
        "psf.moffat_beta" => |mission| Some(&mut mission.psf.moffat_beta),
        "requirement.delta_e" => |mission| Some(&mut mission.requirement.delta_e),
        "requirement.correction_factor" => |mission| Some(&mut mission.requirement.correction_factor),
        "accuracy.relative" => |mission| Some(&mut mission.accuracy.relative),
        _ => return None,
    })
}

/// The index of a member of an array by its name, and the rest of the key.
fn member<'a, T>(members: &[T], name: impl Fn(&T) -> &str, key: &'a str) -> Option<(usize, &'a str)> {
    let field = |member: &T| key.strip_prefix(name(member))?.strip_prefix('.');
    members.iter().enumerate().find_map(|(index, member)| Some((index, field(member)?)))
}

fn of_species(field: &str) -> Option<fn(&mut Species) -> Option<&mut f64>> {
    Some(match field {
        "density_per_px" => |species| Some(&mut species.density_per_px),
        "release_ms" => |species| Some(&mut species.release_ms),
        "energy_ev" => |species| Some(&mut species.energy_ev),
        "well_fill_power" => |species| species.well_fill_power.as_mut(),
        "surface_level_e" => |species| species.surface_level_e.as_mut(),
        _ => return None,
    })
}

fn of_galaxy(field: &str) -> Option<fn(&mut Galaxy) -> Option<&mut f64>> {
    Some(match field {
        "sersic_index" => |galaxy| Some(&mut galaxy.sersic_index),
        "half_light_px" => |galaxy| Some(&mut galaxy.half_light_px),
        "flux_e" => |galaxy| galaxy.flux_e.as_mut(),
        "snr" => |galaxy| galaxy.snr.as_mut(),
        "aperture_px" => |galaxy| galaxy.aperture_px.as_mut(),
        "read_noise_e" => |galaxy| Some(&mut galaxy.read_noise_e),
        "e1" => |galaxy| Some(&mut galaxy.e1),
        "weight_px" => |galaxy| Some(&mut galaxy.weight_px),
        _ => return None,
    })
}

/// A parameter of an effect: `annealing.time_yr`, `bakeout.2.fraction`, `serial-traps.traps.NAME.density_per_px`.
fn of_effect(effects: &toml::Table, key: &str) -> Option<(Place, &'static Key)> {
    let (kind, parameter) = key.split_once('.')?;
    let card = &effect::find(kind)?.card;
    let (found, table, parameter) = match effects.get(kind)? {
        Value::Table(table) => (table, None, parameter),
        Value::Array(several) => {
            let (number, parameter) = parameter.split_once('.')?;
            let index = number.parse::<usize>().ok()?.checked_sub(1)?;
            (several.get(index)?.as_table()?, Some(index), parameter)
        }
        _ => return None,
    };
    let place =
        |species: Option<usize>, name: &str| Place::Effect { kind: card.kind, table, species, name: name.into() };
    if let Some(below) = parameter.strip_prefix("traps.") {
        let name = |species: &Value| species.get("name").and_then(Value::as_str).map_or(String::new(), str::to_string);
        let names: Vec<String> = found.get("traps")?.as_array()?.iter().map(name).collect();
        let (index, field) = member(&names, String::as_str, below)?;
        return Some((place(Some(index), field), card.key(&format!("traps[].{field}"))?));
    }
    let known = card.key(parameter).filter(|_| !parameter.contains('.') && found.contains_key(parameter))?;
    Some((place(None, parameter), known))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Dotted keys of all real numbers below a table; members of arrays by their names or numbers.
    fn real_keys(value: &Value, key: &str, found: &mut Vec<(String, f64)>) {
        let below = |name: &str| if key.is_empty() { name.to_string() } else { format!("{key}.{name}") };
        match value {
            Value::Float(number) => found.push((key.to_string(), *number)),
            Value::Table(table) => table.iter().for_each(|(name, value)| real_keys(value, &below(name), found)),
            Value::Array(members) => {
                for (index, member) in members.iter().enumerate() {
                    let name = member.get("name").and_then(Value::as_str).map(str::to_string);
                    real_keys(member, &below(&name.unwrap_or((index + 1).to_string())), found);
                }
            }
            _ => {}
        }
    }

    /// A mission with every effect, one of them twice.
    fn everything() -> Mission {
        let plain = Mission::parse(include_str!("../../missions/snap_l2_trades.toml")).unwrap();
        let mut mission = plain.clone();
        for entry in &effect::CATALOGUE {
            mission = super::super::add_effect(&mission, entry.card.kind, (entry.example)(&plain)).unwrap().0;
        }
        let bakeout = effect::find("bakeout").unwrap();
        super::super::add_effect(&mission, "bakeout", (bakeout.example)(&plain)).unwrap().0
    }

    #[test]
    fn numbers_are_set_as_by_way_of_the_text() {
        let mission = everything();
        let mut keys = Vec::new();
        real_keys(&Value::Table(mission.to_table()), "", &mut keys);
        let mut quick = 0;
        for (key, number) in &keys {
            for value in [1.01 * number, 0.5 * number, 0.0, -number, 1e30, f64::NAN, f64::INFINITY] {
                let settings = [(key.clone(), Value::Float(value))];
                let Some(found) = mission.with_numbers(&settings) else { continue };
                let expected = mission.with_text(&settings);
                assert_eq!(Ok(found), expected, "{key} = {value}");
                quick += usize::from(value == 1.01 * number);
            }
        }
        // All that a fit may free: only tables of noise, the survey, uncertainties and the error floor use the text.
        let slow: Vec<&String> = keys
            .iter()
            .filter(|(key, number)| mission.with_numbers(&[(key.clone(), Value::Float(1.01 * number))]).is_none())
            .map(|(key, _)| key)
            .collect();
        let known = ["readout.noise.", "survey.", "uncertainty.", "environment.solar_maximum.", "fit."];
        assert!(slow.iter().all(|key| known.iter().any(|prefix| key.starts_with(prefix))), "{slow:?}");
        assert!(quick > 40, "{quick}");
    }

    #[test]
    fn what_cannot_be_set_goes_by_way_of_the_text() {
        let mission = everything();
        for (key, value) in [
            ("detector.notch_e", 1e8.into()),
            ("detector.notch", 1.0.into()),
            ("detector.temperature_k", (-3.0).into()),
            ("readout.transfers", 100.into()),
            ("effects.bakeout.3.fraction", 0.1.into()),
            ("effects.bakeout.fraction", 0.1.into()),
            ("detector.traps.XX.release_ms", 1.0.into()),
        ] {
            let settings: [(String, Value); 1] = [(key.into(), value)];
            assert_eq!(mission.with_numbers(&settings), None, "{key}");
        }
        let twice = ["sky.background_e", "sky.background_e"].map(|key| (key.to_string(), Value::Float(3.0)));
        assert_eq!(mission.with_numbers(&twice), None);
        assert!(mission.with(&twice).unwrap_err().to_string().contains("twice"));
    }
}
