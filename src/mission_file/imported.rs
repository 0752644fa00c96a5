//! The files named in a mission: read with it, so that an existing mission is complete.

use std::path::Path;
use std::sync::Arc;

use ctiplan_magnetosphere::Elements;

use super::galaxies::read as read_galaxies;
use crate::environment::observed_sun::Record;
use crate::environment::spectrum::{Law, Spectrum};
use crate::error::InputError;
use crate::io::radiation_file::{
    Depths, Doses, Quantity, SpectrumFile, Time, Times, read_dose_depth, read_dose_history, read_orbit_history,
    read_sectors, read_solar_events, read_spectrum, read_temperature_history,
};
use crate::mission::keys::{ALTITUDES_KM, TEMPERATURES_K};
use crate::mission::{Imported, ImportedSpectrum, Mission, PopulationGalaxy};
use crate::numeric::calendar::years_between;

/// A fault in a file, with the key that names it, unless the fault is only in the file.
type Refusal = (Option<&'static str>, InputError);

/// Reads the files named in a mission, relative to a folder; their names become those of the files read.
pub(super) fn import(mission: &mut Mission, folder: &Path) -> Result<(), Refusal> {
    let environment = &mut mission.environment;
    let sectors = mission.shielding.as_mut().and_then(|shielding| shielding.sectors.as_mut());
    let warmings = mission.detector.temperature_history.as_mut();
    let table = mission.population.as_mut().and_then(|population| population.table.as_mut());
    let orbit = mission.orbit.as_mut().and_then(|orbit| orbit.history.as_mut());
    let (doses, depths) = (environment.history.as_mut(), environment.dose_depth.as_mut());
    let named = [doses, depths, environment.solar_events.as_mut(), orbit, sectors, warmings, table];
    let named = named.into_iter().flatten();
    for file in named.chain(environment.spectra.iter_mut().flatten()) {
        *file = folder.join(&file).display().to_string();
    }
    mission.imported = Imported {
        history: history(mission)?,
        spectra: spectra(mission)?,
        dose_depth: dose_depth(mission)?,
        sectors: sectors_of(mission)?,
        temperatures: temperatures(mission)?,
        galaxies: galaxies(mission)?,
        solar_events: solar_events(mission)?,
        orbits: orbits(mission)?,
        sun: None,
        cosmic_rays: None,
    };
    if let Some(sun) = mission.observed_sun() {
        let (from, launch) = (sun.record().from.date(), mission.mission.launch.0);
        if launch < from {
            let problem = format!("the Sun was observed from {from}, after the launch on {launch}");
            let help = "take sun = \"drawn\", or a file of solar_events with an earlier observed_from";
            let (key, error) = wrong("environment.sun", problem);
            return Err((key, error.with_help(help)));
        }
    }
    match mission.history_problem() {
        Some(problem) => Err(wrong("environment.history", problem)),
        None => Ok(()),
    }
}

fn wrong(key: &'static str, problem: impl Into<String>) -> Refusal {
    (Some(key), InputError::new("", problem.into()))
}

fn within(error: InputError) -> Refusal {
    (None, error)
}

/// Number of straight lines for the dose between two rows of rates: accurate to 0.4 % of its deviation from a single line.
const PIECES: u32 = 16;

/// Years since launch, starting at 0, and dose since launch, MeV/g.
fn history(mission: &Mission) -> Result<Vec<(f64, f64)>, Refusal> {
    const KEY: &str = "environment.history";
    let Some(file) = &mission.environment.history else { return Ok(Vec::new()) };
    let read = read_dose_history(file).map_err(within)?;
    let times = since_launch_yr(mission, &read.times);
    if times[0] < 0.0 {
        return Err(wrong(KEY, format!("{file} begins before launch, at {:.3} yr", times[0])));
    }
    match &read.doses {
        Doses::Total(doses) => {
            if times[0] == 0.0 && doses[0] > 0.0 {
                return Err(wrong(
                    KEY,
                    format!("{file} has a dose of {} MeV/g at launch: it must begin at 0", doses[0]),
                ));
            }
            let mut table = vec![(0.0, 0.0)];
            table.extend(times.into_iter().zip(doses.iter().copied()).filter(|(t_yr, _)| *t_yr > 0.0));
            Ok(table)
        }
        Doses::Rate(rates) => {
            // A tolerance of one day for dates.
            if times[0] > 0.003 {
                return Err(wrong(KEY, format!("{file} has no dose rate before {:.3} yr after launch", times[0])));
            }
            let mut table = vec![(0.0, 0.0)];
            for (pair, rate) in times.windows(2).zip(rates.windows(2)) {
                // The rate is linear between two rows, so the dose is a parabola, approximated by several straight lines.
                let (before, length) = (table[table.len() - 1].1, pair[1] - pair[0]);
                table.extend((1..=PIECES).map(|piece| {
                    let share = f64::from(piece) / f64::from(PIECES);
                    let mean_rate = rate[0] + 0.5 * share * (rate[1] - rate[0]);
                    (pair[0] + share * length, before + mean_rate * share * length)
                }));
            }
            Ok(table)
        }
    }
}

/// Times in years since launch.
fn since_launch_yr(mission: &Mission, times: &Times) -> Vec<f64> {
    let launch = mission.mission.launch.0;
    match times {
        Times::SinceLaunchYr(times) => times.clone(),
        Times::Dates(dates) => dates
            .iter()
            .map(|date| {
                let seconds = f64::from(chrono::Timelike::num_seconds_from_midnight(&date.time()));
                years_between(launch, date.date()) + seconds / crate::environment::SECONDS_PER_YEAR
            })
            .collect(),
    }
}

/// Years since launch, ascending, and temperature from then on, K.
fn temperatures(mission: &Mission) -> Result<Vec<(f64, f64)>, Refusal> {
    let Some(file) = &mission.detector.temperature_history else { return Ok(Vec::new()) };
    let read = read_temperature_history(file, TEMPERATURES_K).map_err(within)?;
    Ok(since_launch_yr(mission, &read.times).into_iter().zip(read.temperatures_k).collect())
}

/// Solar events of the program with those of the file.
fn solar_events(mission: &Mission) -> Result<Option<Arc<Record>>, Refusal> {
    let Some(file) = &mission.environment.solar_events else { return Ok(None) };
    let read = read_solar_events(file).map_err(within)?;
    let record =
        Record::with(read).map_err(|problem| wrong("environment.solar_events", format!("{file}: {problem}")))?;
    Ok(Some(Arc::new(record)))
}

/// Years since launch, ascending, and elements of the orbit then.
fn orbits(mission: &Mission) -> Result<Vec<(f64, Elements)>, Refusal> {
    let Some(file) = mission.orbit.as_ref().and_then(|orbit| orbit.history.as_ref()) else { return Ok(Vec::new()) };
    let read = read_orbit_history(file, ALTITUDES_KM).map_err(within)?;
    let elements = read.elements.iter().map(|row| Elements {
        perigee_km: row.perigee_km,
        apogee_km: row.apogee_km,
        inclination_deg: row.inclination_deg,
        argument_of_perigee_deg: row.argument_of_perigee_deg,
    });
    Ok(since_launch_yr(mission, &read.times).into_iter().zip(elements).collect())
}

/// Galaxies of the population's table.
fn galaxies(mission: &Mission) -> Result<Vec<PopulationGalaxy>, Refusal> {
    let Some(file) = mission.population.as_ref().and_then(|population| population.table.as_ref()) else {
        return Ok(Vec::new());
    };
    read_galaxies(file).map_err(within)
}

fn spectra(mission: &Mission) -> Result<Vec<ImportedSpectrum>, Refusal> {
    const KEY: &str = "environment.spectra";
    let duration_yr = mission.mission.duration_yr;
    let of = |file: &String| {
        let read = read_spectrum(file).map_err(within)?;
        if let Some(shield) = &read.shield {
            return Err(wrong(
                KEY,
                format!("{file} is a spectrum behind a shield ({shield}): [shielding] would count twice"),
            ));
        }
        let own_yr = read.duration_s.map(|seconds| seconds / crate::environment::SECONDS_PER_YEAR);
        if let Some(own_yr) = own_yr.filter(|own| read.time == Time::Mission && (own / duration_yr - 1.0).abs() > 0.02)
        {
            let problem = format!("{file} is of a mission of {own_yr:.2} yr, but this one lasts {duration_yr} yr");
            return Err(wrong(KEY, problem));
        }
        Ok(ImportedSpectrum {
            file: file.clone(),
            program: format!("{:?}", read.program),
            spectrum: spectrum(&read),
            per_second: read.time == Time::PerSecond,
            last_mev: last_mev(&read),
        })
    };
    mission.environment.spectra.iter().flatten().map(of).collect()
}

/// Highest energy (MeV) at which there are protons, or the last one if there are none.
fn last_mev(read: &SpectrumFile) -> f64 {
    let last = read.values.iter().rposition(|value| *value > 0.0);
    read.energies_mev[last.unwrap_or(read.energies_mev.len() - 1)]
}

/// Power laws between the energies of a file.
fn spectrum(read: &SpectrumFile) -> Spectrum {
    let points: Vec<(f64, f64)> = read.energies_mev.iter().copied().zip(read.values.iter().copied()).collect();
    if read.quantity == Quantity::Integral {
        return Spectrum::of(points, Law::Power);
    }
    let differential = |energy_mev: f64| {
        let after = points.partition_point(|point| point.0 <= energy_mev).clamp(1, points.len() - 1);
        let ((from, low), (to, high)) = (points[after - 1], points[after]);
        if low <= 0.0 || high <= 0.0 {
            0.0
        } else {
            low * (high / low).powf((energy_mev / from).ln() / (to / from).ln())
        }
    };
    Spectrum::of_differential(differential, points[0].0, points[points.len() - 1].0)
}

/// Areal density of aluminium (g/cm², ascending) and dose of the mission, MeV/g.
fn dose_depth(mission: &Mission) -> Result<Vec<(f64, f64)>, Refusal> {
    let Some(file) = &mission.environment.dose_depth else { return Ok(Vec::new()) };
    let read = read_dose_depth(file).map_err(within)?;
    let years = match read.doses {
        Doses::Total(_) => 1.0,
        Doses::Rate(_) => mission.mission.duration_yr,
    };
    let doses = read.doses.values().iter().map(|dose| years * dose);
    Ok(areal(&read.depths, crate::environment::proton::ALUMINIUM_G_CM3).zip(doses).collect())
}

/// Areal density (g/cm²) of 0.015 mm of aluminium, the thinnest shield behind which a dose is derived.
pub(super) const THINNEST_G_CM2: f64 = 0.004;

/// Why a thinner shield is refused.
pub(super) const THINNEST_HELP: &str = "proton models start at 1 MeV, which 0.015 mm of aluminium stop";

/// Share of the sky and areal density, g/cm².
fn sectors_of(mission: &Mission) -> Result<Vec<(f64, f64)>, Refusal> {
    let Some((file, shielding)) =
        mission.shielding.as_ref().and_then(|shielding| Some((shielding.sectors.as_ref()?, shielding)))
    else {
        return Ok(Vec::new());
    };
    let read = read_sectors(file).map_err(within)?;
    let areal: Vec<f64> = areal(&read.depths, shielding.material.density_g_cm3()).collect();
    if let Some(row) = areal.iter().position(|areal| *areal < THINNEST_G_CM2) {
        let problem = format!(
            "{file} has {} g/cm2 in its row {}: at least {THINNEST_G_CM2} g/cm2 are needed",
            areal[row],
            row + 1
        );
        let (key, error) = wrong("shielding.sectors", problem);
        return Err((key, error.with_help(THINNEST_HELP)));
    }
    Ok(read.weights.iter().copied().zip(areal).collect())
}

/// Areal densities (g/cm²) of a material with a density (g/cm³).
fn areal(depths: &Depths, density_g_cm3: f64) -> impl Iterator<Item = f64> {
    let scale = match depths {
        Depths::ThicknessMm(_) => density_g_cm3 / 10.0,
        Depths::ArealDensityGCm2(_) => 1.0,
    };
    depths.values().iter().map(move |value| scale * value)
}
