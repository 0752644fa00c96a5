//! The content of a mission file, as data. [`keys`] is the single list of its keys: unit, allowed values, default, frequent
//! mistakes. [`crate::mission_file`] reads it.

mod clock;
pub mod keys;
mod orbit;
mod shielding;

use std::fmt;
use std::sync::Arc;

use chrono::NaiveDate;
use ctiplan_magnetosphere::Elements;
use serde::{Deserialize, Serialize};

use crate::environment::Niel;
use crate::environment::observed_sun::Record;
use crate::environment::spectrum::Spectrum;
pub use clock::{ClockProblem, PhaseClock};
pub use orbit::{Header, Orbit, OrbitElements, OrbitKind};
pub use shielding::{Layer, SecondariesCounted, Shielding};

/// The content of a mission file, with defaults filled in. Keys carry their units; see [`keys::KEYS`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Mission {
    /// Name, launch, duration, orbit.
    pub mission: Header,
    /// Orbit by its elements.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub orbit: Option<OrbitElements>,
    /// Dose model.
    pub environment: Environment,
    /// Matter around the detector; needed if the dose is derived.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub shielding: Option<Shielding>,
    /// Wells and traps.
    pub detector: Detector,
    /// Clocking.
    pub readout: Clocking,
    /// Background.
    pub sky: Sky,
    /// Point spread function.
    pub psf: Psf,
    /// Galaxies whose shapes are measured.
    pub galaxies: Vec<Galaxy>,
    /// Galaxies of a survey, for shear biases.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub population: Option<Population>,
    /// The requirement.
    pub requirement: Requirement,
    /// Numerical accuracy; not physics.
    pub accuracy: Accuracy,
    /// Effects added to the model, by kind: a table, or an array of tables; see [`crate::effect`].
    #[serde(default, skip_serializing_if = "toml::Table::is_empty")]
    pub effects: toml::Table,
    /// Timing of a survey; needed for comparisons of areas.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub survey: Option<Survey>,
    /// Uncertainties of the inputs.
    pub uncertainty: Uncertainty,
    /// Parameters that may be fitted to measurements.
    pub fit: FitSettings,
    /// Contents of the files named in the mission, and a drawn realisation of the Sun.
    #[serde(skip)]
    pub imported: Imported,
}

/// Data of a mission besides its file: contents of the files that it names, and a drawn realisation of the Sun.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Imported {
    /// `environment.history`: years since launch, ascending from 0, and dose since launch, MeV/g.
    pub history: Vec<(f64, f64)>,
    /// `environment.spectra`.
    pub spectra: Vec<ImportedSpectrum>,
    /// `environment.dose_depth`: areal density of aluminium (g/cm², ascending), dose of the mission behind a sphere of it, MeV/g.
    pub dose_depth: Vec<(f64, f64)>,
    /// `shielding.sectors`: share of the sky and areal density, g/cm².
    pub sectors: Vec<(f64, f64)>,
    /// `detector.temperature_history`: years since launch, ascending, and temperature from then on, K.
    pub temperatures: Vec<(f64, f64)>,
    /// `population.table`: galaxies.
    pub galaxies: Vec<PopulationGalaxy>,
    /// `environment.solar_events`, with the events of the program.
    pub solar_events: Option<Arc<Record>>,
    /// `orbit.history`: the elements, each with its time in years since launch, ascending.
    pub orbits: Vec<(f64, Elements)>,
    /// A drawn realisation of the Sun: years since launch, ascending, and dose of solar protons since launch (MeV/g, before
    /// `environment.dose_factor`). It replaces all solar protons of the environment.
    pub sun: Option<Vec<(f64, f64)>>,
    /// A drawn level of cosmic rays: their dose relative to that of a mean cycle.
    pub cosmic_rays: Option<f64>,
}

/// A proton spectrum of another program.
#[derive(Clone, Debug, PartialEq)]
pub struct ImportedSpectrum {
    /// The file.
    pub file: String,
    /// The program that wrote it.
    pub program: String,
    /// Omnidirectional fluence of the mission, or per second, cm⁻².
    pub spectrum: Spectrum,
    /// Whether it is per second.
    pub per_second: bool,
    /// Highest energy of the file at which there are protons, MeV.
    pub last_mev: f64,
}

/// `[environment]`
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Environment {
    /// How the dose is distributed over the years.
    pub model: DoseModel,
    /// Dose rate behind the shielding in an active year, MeV/g/yr; derived if not given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub active_dose_rate_mev_g_yr: Option<f64>,
    /// Probability that the solar proton fluence is not exceeded.
    pub confidence: f64,
    /// How quantiles of years are combined, if stated in the file; see [`Environment::accumulate`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub accumulate: Option<Accumulate>,
    /// Factor on the whole dose, such as a radiation design margin.
    pub dose_factor: f64,
    /// Additional dose rate of cosmic rays in every year, MeV/g/yr.
    pub cosmic_ray_floor_mev_g_yr: f64,
    /// Solar maxima, decimal years.
    pub solar_maximum: Vec<f64>,
    /// Active years of the mission, in place of those of the calendar.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub active_years: Option<f64>,
    /// The Sun in the past; see [`SunOfThePast`].
    pub sun: SunOfThePast,
    /// File of solar events that continue those of the program, or replace them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub solar_events: Option<String>,
    /// Dose of helium and heavier nuclei of cosmic rays relative to that of the protons.
    pub nuclei_over_protons: f64,
    /// Phase of the solar cycle at which trapped protons and cosmic rays are fixed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub solar_phase: Option<SolarPhase>,
    /// Damage curve of protons in silicon.
    pub niel: Niel,
    /// Sources of protons, by name; if None, all that reach the orbit.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sources: Option<Vec<String>>,
    /// File of the dose over time.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub history: Option<String>,
    /// Files of proton spectra, in place of sources.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub spectra: Option<Vec<String>>,
    /// File of the dose against thickness, in place of sources.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub dose_depth: Option<String>,
}

impl Environment {
    /// How quantiles of years are combined: the quantile of the sum if all sources are derived, the paper's method in its models.
    pub fn accumulate(&self) -> Accumulate {
        let default = if self.model == DoseModel::Derived { Accumulate::Mission } else { Accumulate::Yearly };
        self.accumulate.unwrap_or(default)
    }
}

/// The Sun at times that were observed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum SunOfThePast {
    /// As at all other times: a quantile, or drawn.
    Drawn,
    /// As it was: solar proton events, modulation of cosmic rays, sunspot number.
    Observed,
}

/// A phase of the solar cycle.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum SolarPhase {
    /// Solar minimum.
    Min,
    /// Solar maximum.
    Max,
}

/// How the dose is distributed over the years.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum DoseModel {
    /// 7/11 of the active rate, at all times.
    Constant,
    /// The active rate in active years, nothing in quiet ones.
    SolarCycle,
    /// From orbit, Sun, shield and NIEL: each source at its own times.
    Derived,
    /// From a file.
    History,
}

/// How quantiles of years are combined.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Accumulate {
    /// The quantile of one active year, times active years: the paper's method. Larger than the quantile of the sum for common
    /// particles at high confidence, smaller for rare ones (behind much shielding) and at low confidence.
    Yearly,
    /// The quantile of the sum over the mission, spread evenly over its active years.
    Mission,
}

/// `[detector]`
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Detector {
    /// Charge that fills a pixel, e-.
    pub full_well_e: f64,
    /// Charge that a notch keeps away from the traps, e-.
    pub notch_e: f64,
    /// Exponent α of the cloud's height.
    pub well_fill_power: f64,
    /// Fraction of the well that any charge fills, a.
    pub volume_at_zero: f64,
    /// Operating temperature, K.
    pub temperature_k: f64,
    /// File of the operating temperature over time.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub temperature_history: Option<String>,
    /// Temperature at which the release times are quoted, K.
    pub reference_temperature_k: f64,
    /// Dose at which the densities are quoted, MeV/g.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reference_dose_mev_g: Option<f64>,
    /// Fluence of protons at which they are quoted instead, cm⁻².
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reference_fluence_cm2: Option<f64>,
    /// Energy of those protons, MeV.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reference_energy_mev: Option<f64>,
    /// Trap species.
    pub traps: Vec<Species>,
}

/// `[[detector.traps]]`
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Species {
    /// Name.
    pub name: String,
    /// Traps per pixel at the reference dose.
    pub density_per_px: f64,
    /// Release time at the reference temperature, ms.
    pub release_ms: f64,
    /// Energy level below the band, eV.
    pub energy_ev: f64,
    /// Exponent of the cloud's height for this species, if it differs from the detector's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub well_fill_power: Option<f64>,
    /// Charge above which a packet reaches this species at the surface, e-; none for bulk traps.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub surface_level_e: Option<f64>,
}

/// `[readout]`
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Clocking {
    /// Time between two parallel transfers, ms.
    pub line_time_ms: f64,
    /// Parallel transfers of the evaluated object.
    pub transfers: u32,
    /// State of the traps when the first packet arrives.
    #[serde(default, skip_serializing_if = "TrapsAtStart::is_empty")]
    pub traps_at_start: TrapsAtStart,
    /// The phases of a pixel; none if a transfer is one step.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub clock: Option<PhaseClock>,
    /// The store into which frames are shifted before they are read; none if the image ends at the register.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub store: Option<Store>,
    /// Read noise against the clock; needed for comparisons of clocks beyond shapes.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub noise: Option<ReadNoise>,
}

/// `[readout.store]`: frame transfer.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Store {
    /// Rows of the store, and transfers of the burst.
    pub rows: u32,
    /// Time between two transfers of the burst, ms.
    pub burst_line_time_ms: f64,
    /// Trap density in the store relative to the image.
    #[serde(default = "one")]
    pub trap_ratio: f64,
}

/// State of the traps of a pixel when its first packet arrives.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum TrapsAtStart {
    /// Empty.
    #[default]
    Empty,
    /// The state in which the next pixel nearer to the register was left by its own first packet; ArCTIc's default.
    Carried,
}

impl TrapsAtStart {
    fn is_empty(&self) -> bool {
        *self == TrapsAtStart::Empty
    }
}

/// `[readout.noise]`: read noise against pixel rate, as a law or as a table.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ReadNoise {
    /// Pixels of a row that one amplifier reads.
    pub columns: u32,
    /// Rows that one amplifier reads.
    pub rows: u32,
    /// Part of the line time without pixel reads, ms.
    pub parallel_ms: f64,
    /// Read noise of a slow amplifier, e-.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub floor_e: Option<f64>,
    /// White part of the read noise at the reference rate, e-; proportional to the square root of the rate.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub white_e: Option<f64>,
    /// Pixel rate of `white_e`, kHz.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reference_rate_khz: Option<f64>,
    /// Pixel rates of a table, kHz, ascending.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pixel_rate_khz: Option<Vec<f64>>,
    /// Read noise at those rates, e-.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub read_noise_e: Option<Vec<f64>>,
}

impl ReadNoise {
    /// Pixel rate (kHz) required by a line time (ms): `columns` pixels in the rest of it. None if nothing is left.
    pub fn pixel_rate_khz(&self, line_time_ms: f64) -> Option<f64> {
        let left_ms = line_time_ms - self.parallel_ms;
        (left_ms > 0.0).then(|| f64::from(self.columns) / left_ms)
    }

    /// Read noise (e-) at a pixel rate (kHz): √(floor² + white² rate/reference), or linear interpolation in the logarithm of the
    /// rate between the values of the table. None beyond the ends of the table.
    ///
    /// White noise of an amplifier is proportional to the square root of its bandwidth; 1/f noise after correlated double sampling
    /// is not (Janesick 2001, Scientific Charge-Coupled Devices).
    pub fn read_noise_e(&self, rate_khz: f64) -> Option<f64> {
        if let (Some(rates), Some(noise)) = (&self.pixel_rate_khz, &self.read_noise_e) {
            let after = rates.iter().position(|rate| *rate >= rate_khz)?;
            if rates[after] == rate_khz {
                return Some(noise[after]);
            }
            let before = after.checked_sub(1)?;
            let place = (rate_khz / rates[before]).ln() / (rates[after] / rates[before]).ln();
            return Some(noise[before] + place * (noise[after] - noise[before]));
        }
        let (floor_e, white_e, reference_khz) = (self.floor_e?, self.white_e?, self.reference_rate_khz?);
        Some((floor_e * floor_e + white_e * white_e * rate_khz / reference_khz).sqrt())
    }
}

/// `[survey]`
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Survey {
    /// Length of one exposure, s.
    pub exposure_s: f64,
    /// Time between exposures that is available for the readout, s.
    pub slew_s: f64,
    /// Earlier exposures that have filled the traps; none if the traps are empty.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub persistence: Option<Persistence>,
}

/// `[survey.persistence]`: earlier exposures, whose charge slow traps retain.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Persistence {
    /// Number of earlier exposures.
    pub exposures: u32,
    /// Their scene.
    pub scene: SceneBefore,
    /// Rows of the frame, all of which are read.
    pub rows: u32,
}

/// Scene of earlier exposures in the columns of an object.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum SceneBefore {
    /// The same in the same pixels: the telescope has not moved.
    Same,
    /// Only sky: the telescope has moved.
    Sky,
}

impl Survey {
    /// Time from one exposure to the next (s), for given exposure and readout times (s): readout and slew are in parallel.
    pub fn cycle_s(&self, exposure_s: f64, readout_s: f64) -> f64 {
        exposure_s + readout_s.max(self.slew_s)
    }
}

/// `[uncertainty]`: relative uncertainties (1 σ of the logarithm).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Uncertainty {
    /// Dose model: spectrum and transport at a given confidence, and the damage curve if the dose is given; without the randomness
    /// of the Sun.
    pub dose_model: f64,
    /// Damage curve of protons in silicon (NIEL), if the dose is derived from it.
    pub niel: f64,
    /// Modulation of cosmic rays from cycle to cycle, if they are a source of the mission.
    pub cosmic_ray_modulation: f64,
    /// Thickness of the shield.
    pub shielding: f64,
    /// Density of each species.
    pub density: f64,
    /// Release time of each species.
    pub release: f64,
    /// Full well above the notch.
    pub full_well: f64,
    /// Exponent of the cloud's height.
    pub well_fill_power: f64,
    /// Background.
    pub background: f64,
    /// Flux of the judged galaxy.
    pub galaxy_flux: f64,
    /// Half-light radius of the judged galaxy.
    pub galaxy_size: f64,
}

/// `[sky]`
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Sky {
    /// Background, e- per pixel.
    pub background_e: f64,
}

/// `[psf]`
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Psf {
    /// Full width at half maximum, px.
    pub fwhm_px: f64,
    /// Moffat's β.
    pub moffat_beta: f64,
}

/// `[[galaxies]]`
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Galaxy {
    /// Name.
    pub name: String,
    /// Sersic index: 4 de Vaucouleurs, 1 exponential.
    pub sersic_index: f64,
    /// Circularised half-light radius before the PSF, px.
    pub half_light_px: f64,
    /// Flux, e-.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub flux_e: Option<f64>,
    /// Signal-to-noise ratio within the aperture, instead of the flux.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub snr: Option<f64>,
    /// Radius of the aperture for `snr`, px.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub aperture_px: Option<f64>,
    /// Read noise included in `snr`, and used for noise if `[readout.noise]` is missing, e- per pixel.
    pub read_noise_e: f64,
    /// Ellipticity before the PSF, (a² − b²)/(a² + b²), positive along the rows' direction x.
    pub e1: f64,
    /// σ of the round Gaussian weight of the moments, px.
    pub weight_px: f64,
}

/// `[population]`: galaxies of a survey, from a table or by a law.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Population {
    /// File of galaxies.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub table: Option<String>,
    /// Maximum number of galaxies evaluated; without a table, the number drawn.
    pub galaxies: u32,
    /// Brightest and faintest magnitude of the law.
    pub magnitude_range: Vec<f64>,
    /// Magnitude of a source that gives one electron in an exposure; None: the faintest galaxies have the flux of the judged one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub one_electron_mag: Option<f64>,
    /// Width of a pixel, arcsec; None: 0.1.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pixel_arcsec: Option<f64>,
    /// Transfers of galaxies if not in the table.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub transfers: Option<Distances>,
    /// Flux of the stars from which the PSF is measured, e-; None: the PSF is known independently.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub psf_stars_e: Option<f64>,
    /// Orientations of the detector on the sky over which the survey averages, degrees.
    pub orientations_deg: Vec<f64>,
    /// Additional rows between a galaxy and the register in each exposure, px; the survey averages over exposures.
    pub dither_rows_px: Vec<f64>,
    /// Additional columns between it and the amplifier, px, in the same exposures; None: no columns.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub dither_columns_px: Option<Vec<f64>>,
    /// Whether ellipticities are measured with the noise of one exposure.
    pub noise: PopulationNoise,
}

/// Position of a galaxy in an exposure, relative to its own.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Dither {
    /// Additional parallel transfers.
    pub rows: i64,
    /// Additional serial transfers.
    pub columns: i64,
}

impl Population {
    /// Positions in all exposures, in whole pixels: sub-pixel positions are averaged over anyway.
    pub fn dithers(&self) -> Vec<Dither> {
        let columns = |place: usize| self.dither_columns_px.as_ref().map_or(0.0, |columns| columns[place]);
        let dither =
            |(place, rows): (usize, &f64)| Dither { rows: rows.round() as i64, columns: columns(place).round() as i64 };
        self.dither_rows_px.iter().enumerate().map(dither).collect()
    }
}

/// Transfers of the galaxies of a population.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Distances {
    /// `readout.transfers` for all of them.
    Evaluated,
    /// Evenly spread from 1 to `readout.transfers`.
    Uniform,
}

/// Whether a population is measured with noise.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum PopulationNoise {
    /// Without noise.
    Neglected,
    /// With photon and read noise.
    Included,
}

/// One galaxy of a population; None for values not in its table.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PopulationGalaxy {
    /// Flux, e-.
    pub flux_e: Option<f64>,
    /// Circularised half-light radius before the PSF, px.
    pub half_light_px: Option<f64>,
    /// Sersic index.
    pub sersic_index: Option<f64>,
    /// Ellipticity before the PSF, (a² − b²)/(a² + b²), along the rows' direction x.
    pub e1: Option<f64>,
    /// The same along the diagonal.
    pub e2: Option<f64>,
    /// σ of the weight, px.
    pub weight_px: Option<f64>,
    /// Parallel transfers.
    pub transfers: Option<u32>,
    /// Weight of the galaxy in the survey.
    pub weight: f64,
}

/// `[requirement]`
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Requirement {
    /// Largest change of ellipticity; 0.999, which is never reached, if only shear biases are limited.
    #[serde(default = "unlimited")]
    pub delta_e: f64,
    /// Largest additive shear bias of the population.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub c: Option<f64>,
    /// Largest multiplicative shear bias of the population.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub m: Option<f64>,
    /// Factor by which software correction reduces it.
    pub correction_factor: f64,
    /// The galaxy that is judged.
    pub galaxy: String,
}

/// A change of ellipticity that is never reached.
const UNLIMITED: f64 = 0.999;

fn one() -> f64 {
    1.0
}

fn unlimited() -> f64 {
    UNLIMITED
}

impl Requirement {
    /// Limits on |Δe| before correction: for none, and for software correction.
    pub fn limits(&self) -> [f64; 2] {
        [self.delta_e, self.delta_e * self.correction_factor]
    }

    /// Whether the change of the galaxy's ellipticity is limited, not only shear biases of the population.
    pub fn limits_a_galaxy(&self) -> bool {
        self.delta_e < UNLIMITED
    }
}

/// Largest accepted `environment.dose_factor`, and the largest multiple of a dose that studies search. A margin is at most a factor of a
/// few; a budget divided by a correction factor allows tens. A percentage such as 120 is refused.
pub const MOST_DOSE_FACTOR: f64 = 100.0;

/// `[accuracy]`
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Accuracy {
    /// The method for the transfers.
    pub readout: ReadoutMethod,
    /// Accuracy of `fast`: for changes of shape, and for the charge of packets relative to its displacement, as root mean squares.
    pub relative: f64,
    /// Heights of `fractional`.
    pub levels: u32,
    /// Seed of all random numbers.
    pub seed: u64,
    /// Sub-pixel positions in y over which shapes are averaged; see [`crate::model::Model::positions`] for those in x.
    pub subpixel_grid: u32,
    /// Noise realisations of one exposure for the judged galaxy; half as many for others. 0 for none.
    pub noise_realisations: u32,
}

/// The method for the transfers; see [`crate::readout::Method`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ReadoutMethod {
    /// To the requested accuracy.
    Fast,
    /// Every transfer.
    Exact,
    /// The paper's fractional traps.
    Fractional,
    /// The paper's random traps.
    MonteCarlo,
}

/// `[fit]`
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FitSettings {
    /// Dotted keys.
    pub free: Vec<String>,
    /// Systematic error of every measured value (1 σ), as a share of the value.
    pub floor: f64,
}

/// A day; TOML's local date.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(try_from = "toml::value::Datetime", into = "toml::value::Datetime")]
pub struct Date(pub NaiveDate);

impl TryFrom<toml::value::Datetime> for Date {
    type Error = String;

    fn try_from(datetime: toml::value::Datetime) -> Result<Date, String> {
        let date = datetime.date.ok_or("a date is needed, such as 2030-01-01")?;
        if datetime.time.is_some() {
            return Err(format!("a date without a time of day is needed, such as {date}"));
        }
        NaiveDate::from_ymd_opt(date.year.into(), date.month.into(), date.day.into())
            .map(Date)
            .ok_or_else(|| format!("{date} is not in the calendar"))
    }
}

impl From<Date> for toml::value::Datetime {
    fn from(date: Date) -> toml::value::Datetime {
        // A NaiveDate between the years 0 and 9999 prints as TOML's local date.
        date.to_string().parse().expect("a date")
    }
}

impl fmt::Display for Date {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(out)
    }
}

impl Mission {
    /// Earlier exposures that have filled the traps, if modelled.
    pub fn persistence(&self) -> Option<Persistence> {
        self.survey.as_ref()?.persistence
    }

    /// Dose at which the densities are quoted, MeV/g: as given, or that of the reference fluence by the mission's own damage curve,
    /// which at 10 MeV is that of the table.
    pub fn reference_dose_mev_g(&self) -> f64 {
        let detector = &self.detector;
        let of_fluence = || {
            let (fluence_cm2, energy_mev) = (detector.reference_fluence_cm2?, detector.reference_energy_mev?);
            Some(fluence_cm2 * self.environment.niel.at(energy_mev))
        };
        detector.reference_dose_mev_g.or_else(of_fluence).expect("a mission that was read has a reference")
    }

    /// Operating temperature (K) at a time (years since launch): that of the last row of the history up to then, and
    /// `detector.temperature_k` before its first row.
    pub fn temperature_k(&self, t_yr: f64) -> f64 {
        let begun = self.imported.temperatures.partition_point(|(from_yr, _)| *from_yr <= t_yr);
        begun.checked_sub(1).map_or(self.detector.temperature_k, |row| self.imported.temperatures[row].1)
    }

    /// Read noise of a galaxy's pixels, e-: that of the clock by `[readout.noise]`, or the galaxy's own.
    pub fn read_noise_e(&self, galaxy: &Galaxy) -> f64 {
        let of_clock = |noise: &ReadNoise| noise.read_noise_e(noise.pixel_rate_khz(self.readout.line_time_ms)?);
        self.readout.noise.as_ref().and_then(of_clock).unwrap_or(galaxy.read_noise_e)
    }

    /// The judged galaxy of the requirement.
    pub fn judged_galaxy(&self) -> &Galaxy {
        &self.galaxies[self.judged()]
    }

    /// Its index.
    pub fn judged(&self) -> usize {
        let is_judged = |galaxy: &Galaxy| galaxy.name == self.requirement.galaxy;
        self.galaxies.iter().position(is_judged).expect("a mission that was read has its judged galaxy")
    }
}
