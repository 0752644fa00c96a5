//! Real numbers of a mission by their dotted keys: other values without going by way of text.
//!
//! A fit asks for thousands of missions that differ in a few numbers. [`Mission::with`] makes them here where it can, and goes by
//! way of the text, with all its checks and messages, where it cannot: for a key that is not there, a value that is refused, or
//! anything but real numbers. Both ways give the same mission (a test over all keys).

use toml::Value;

use super::lookup;
use crate::effect;
use crate::mission::keys::{self, Key, Kind};
use crate::mission::{Galaxy, Mission, Species};

impl Mission {
    /// The mission with other real numbers; None where one of them is not a real number that is there already, stands twice, or is
    /// not allowed.
    pub(super) fn with_numbers(&self, settings: &[(String, Value)]) -> Option<Mission> {
        let mut mission = self.clone();
        for (index, (key, value)) in settings.iter().enumerate() {
            let value = value.as_float().filter(|value| value.is_finite())?;
            let (number, known) = number(&mut mission, key)?;
            let is_real = matches!(known.kind, Kind::Number(..) | Kind::Positive(..));
            if !is_real || known.kind.refuses(value) || settings[..index].iter().any(|(other, _)| other == key) {
                return None;
            }
            *number = value;
        }
        let agrees =
            mission.notch_problem().is_none() && effect::CATALOGUE.iter().all(|entry| entry.check(&mission).is_ok());
        agrees.then_some(mission)
    }

    /// What is wrong with the notch, where it is not below the full well.
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

/// The number of a dotted key, and what is known of the key.
fn number<'a>(mission: &'a mut Mission, key: &str) -> Option<(&'a mut f64, &'static Key)> {
    if let Some(below) = key.strip_prefix("effects.") {
        return of_effect(&mut mission.effects, below);
    }
    if let Some(below) = key.strip_prefix("detector.traps.") {
        let (species, field) = member(&mut mission.detector.traps, |species| &species.name, below)?;
        return Some((of_species(species, field)?, lookup::find(&format!("detector.traps[].{field}"))?));
    }
    if let Some(below) = key.strip_prefix("galaxies.") {
        let (galaxy, field) = member(&mut mission.galaxies, |galaxy| &galaxy.name, below)?;
        return Some((of_galaxy(galaxy, field)?, lookup::find(&format!("galaxies[].{field}"))?));
    }
    let (environment, detector) = (&mut mission.environment, &mut mission.detector);
    let number = match key {
        "mission.duration_yr" => &mut mission.mission.duration_yr,
        "environment.active_dose_rate_mev_g_yr" => environment.active_dose_rate_mev_g_yr.as_mut()?,
        "environment.confidence" => &mut environment.confidence,
        "environment.cosmic_ray_floor_mev_g_yr" => &mut environment.cosmic_ray_floor_mev_g_yr,
        "shielding.thickness_mm" => &mut mission.shielding.as_mut()?.thickness_mm,
        "detector.full_well_e" => &mut detector.full_well_e,
        "detector.notch_e" => &mut detector.notch_e,
        "detector.well_fill_power" => &mut detector.well_fill_power,
        "detector.temperature_k" => &mut detector.temperature_k,
        "detector.reference_temperature_k" => &mut detector.reference_temperature_k,
        "detector.reference_dose_mev_g" => &mut detector.reference_dose_mev_g,
        "readout.line_time_ms" => &mut mission.readout.line_time_ms,
        "sky.background_e" => &mut mission.sky.background_e,
        "psf.fwhm_px" => &mut mission.psf.fwhm_px,
        "psf.moffat_beta" => &mut mission.psf.moffat_beta,
        "requirement.delta_e" => &mut mission.requirement.delta_e,
        "requirement.correction_factor" => &mut mission.requirement.correction_factor,
        "accuracy.relative" => &mut mission.accuracy.relative,
        _ => return None,
    };
    Some((number, lookup::find(key)?))
}

/// A member of an array by its name, and the rest of the key.
fn member<'a, 'b, T>(members: &'a mut [T], name: impl Fn(&T) -> &str, key: &'b str) -> Option<(&'a mut T, &'b str)> {
    members.iter_mut().find_map(|member| {
        let field = key.strip_prefix(name(member))?.strip_prefix('.')?;
        Some((member, field))
    })
}

fn of_species<'a>(species: &'a mut Species, field: &str) -> Option<&'a mut f64> {
    match field {
        "density_per_px" => Some(&mut species.density_per_px),
        "release_ms" => Some(&mut species.release_ms),
        "energy_ev" => Some(&mut species.energy_ev),
        _ => None,
    }
}

fn of_galaxy<'a>(galaxy: &'a mut Galaxy, field: &str) -> Option<&'a mut f64> {
    match field {
        "sersic_index" => Some(&mut galaxy.sersic_index),
        "half_light_px" => Some(&mut galaxy.half_light_px),
        "flux_e" => galaxy.flux_e.as_mut(),
        "snr" => galaxy.snr.as_mut(),
        "aperture_px" => galaxy.aperture_px.as_mut(),
        "read_noise_e" => Some(&mut galaxy.read_noise_e),
        "e1" => Some(&mut galaxy.e1),
        "weight_px" => Some(&mut galaxy.weight_px),
        _ => None,
    }
}

/// A parameter of an effect: `annealing.time_yr`, `bakeout.2.fraction`, `serial-traps.traps.NAME.density_per_px`.
fn of_effect<'a>(effects: &'a mut toml::Table, key: &str) -> Option<(&'a mut f64, &'static Key)> {
    let (kind, parameter) = key.split_once('.')?;
    let card = &effect::find(kind)?.card;
    let (table, parameter) = match effects.get_mut(kind)? {
        Value::Table(table) => (table, parameter),
        Value::Array(several) => {
            let (number, parameter) = parameter.split_once('.')?;
            (several.get_mut(number.parse::<usize>().ok()?.checked_sub(1)?)?.as_table_mut()?, parameter)
        }
        _ => return None,
    };
    if let Some(below) = parameter.strip_prefix("traps.") {
        let species = table.get_mut("traps")?.as_array_mut()?;
        let name = |species: &Value| species.get("name").and_then(Value::as_str).unwrap_or_default().to_string();
        let place = species.iter().position(|species| below.starts_with(&format!("{}.", name(species))))?;
        let field = below.strip_prefix(&name(&species[place]))?.strip_prefix('.')?;
        return Some((float(species[place].get_mut(field)?)?, card.key(&format!("traps[].{field}"))?));
    }
    if parameter.contains('.') {
        return None;
    }
    Some((float(table.get_mut(parameter)?)?, card.key(parameter)?))
}

fn float(value: &mut Value) -> Option<&mut f64> {
    match value {
        Value::Float(number) => Some(number),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Dotted keys of all real numbers below a table, members of arrays called by their names or numbers.
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
        // All that a fit may free: only tables of noise, the survey and uncertainties go by way of the text.
        let slow: Vec<&String> = keys
            .iter()
            .filter(|(key, number)| mission.with_numbers(&[(key.clone(), Value::Float(1.01 * number))]).is_none())
            .map(|(key, _)| key)
            .collect();
        let known = ["readout.noise.", "survey.", "uncertainty.", "environment.solar_maximum."];
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
