//! All keys of a mission file: unit, allowed values, default, and advice on frequent mistakes.

use crate::environment::material::Material;
use crate::mission::MOST_DOSE_FACTOR;
use Allowed::{Choice, Date, Integer, IntegerLists, Number, Numbers, Text, Texts};
use Need::{Default, Optional, Required};

/// One key of the mission file.
#[derive(Debug)]
pub struct Key {
    /// Dotted path; `[]` matches any member of an array of tables.
    pub path: &'static str,
    /// Description.
    pub what: &'static str,
    /// Unit of the value, empty for pure numbers and text.
    pub unit: &'static str,
    /// Allowed values.
    pub kind: Allowed,
    /// Whether it must be given.
    pub need: Need,
    /// Advice on a number out of range, such as one in another unit.
    pub help: fn(f64) -> Option<String>,
    /// Advice on a word that is not one of those allowed.
    pub help_on_word: fn(&str) -> Option<String>,
    /// Standard deviation of its values in nature over their mean, where observations tell; None if all that is known is in the unit.
    pub scatter: Option<f64>,
}

impl Key {
    /// Whether its value is a name.
    pub fn is_name(&self) -> bool {
        self.path.rsplit('.').next() == Some("name")
    }
}

/// Allowed values of a key.
#[derive(Clone, Copy, Debug)]
pub enum Allowed {
    /// A number from the first to the second, ends included.
    Number(f64, f64),
    /// A number above the first, up to the second.
    Positive(f64, f64),
    /// An integer from the first to the second, ends included.
    Integer(i64, i64),
    /// A list of numbers in that range.
    Numbers(f64, f64),
    /// A list of lists of integers in that range.
    IntegerLists(i64, i64),
    /// One of these words.
    Choice(&'static [&'static str]),
    /// Text that is not empty.
    Text,
    /// A list of texts.
    Texts,
    /// A day.
    Date,
}

/// Whether a key must be given.
#[derive(Clone, Copy, Debug)]
pub enum Need {
    /// There is no sensible default.
    Required,
    /// The default (TOML).
    Default(&'static str),
    /// Its absence has a meaning.
    Optional,
}

/// All tables, in the order of the file, with a description; `[]` is a member of an array of tables. Effects have their own tables,
/// listed in the catalogue of effects.
pub const TABLES: [(&str, &str); 21] = [
    ("mission", "name, launch, duration, orbit"),
    ("orbit", "orbit, by its elements; in place of mission.orbit"),
    ("environment", "displacement damage dose: given, or derived from orbit, Sun, [shielding] and NIEL"),
    ("shielding", "matter around the detector; needed if the dose is derived"),
    ("shielding.layers[]", "one layer of the shield, in place of material and thickness_mm"),
    ("detector", "wells, and the reference conditions of trap densities and release times"),
    ("detector.traps[]", "one trap species"),
    ("readout", "clocking"),
    (
        "readout.clock",
        "clock phases of a pixel; without it, a transfer is one step. Phases hold the packet in turn, for equal times and \
         with equal numbers of traps, unless lists say otherwise",
    ),
    (
        "readout.store",
        "store region of a frame-transfer detector: a burst shifts the image into it, and line_time_ms is that of its readout",
    ),
    ("readout.noise", "read noise against pixel rate, as a formula or as a table; for trade studies"),
    ("survey", "exposure and slew times of a survey; for trade studies, and for persistence"),
    (
        "survey.persistence",
        "charge that slow traps keep from exposures before; without it, traps are empty before each exposure",
    ),
    ("sky", "background"),
    ("psf", "point spread function: a Moffat profile"),
    ("galaxies[]", "one galaxy; its brightness is flux_e, or snr within aperture_px"),
    ("population", "the galaxies of a survey, for shear biases: a table, or a law"),
    (
        "requirement",
        "the budget: the largest change of ellipticity of one galaxy, or the shear biases of the population",
    ),
    ("accuracy", "numerical accuracy; no physics"),
    ("uncertainty", "relative uncertainties of the inputs; for trade studies"),
    ("fit", "free parameters of fits to measurements"),
];

/// Tables that may be absent as a whole; their required keys are required only if the table is present.
pub const OPTIONAL_TABLES: [&str; 9] = [
    "orbit",
    "shielding",
    "shielding.layers[]",
    "readout.clock",
    "readout.store",
    "readout.noise",
    "survey",
    "survey.persistence",
    "population",
];

/// Arrays of tables, each with the name of one member.
pub const ARRAYS: [(&str, &str); 2] = [("detector.traps", "trap species"), ("galaxies", "galaxy")];

/// Relative uncertainties: at most a factor e.
const SIGMA: Allowed = Number(0.0, 1.0);

/// All keys, in the order of the file.
pub const KEYS: &[Key] = &[
    key("mission.name", "name of the mission", "", Text, Required),
    key("mission.launch", "day of launch", "", Date, Required),
    Key {
        help: |value| (value > 100.0).then(|| format!("in days? {value} days are {:.2} years", value / 365.25)),
        ..key("mission.duration_yr", "duration", "yr", Allowed::Positive(0.0, 100.0), Required)
    },
    key(
        "mission.orbit",
        "orbit; l2 if no [orbit] is given",
        "",
        Choice(&["l1", "l2", "interplanetary", "geo", "leo"]),
        Optional,
    ),
    Key {
        help_on_word: orbit_kind,
        ..key("orbit.kind", "kind of orbit", "", Choice(&["l1", "l2", "interplanetary", "geo", "elements"]), Required)
    },
    Key {
        help: altitude,
        ..key("orbit.perigee_km", "lowest altitude above a sphere of 6371 km", "km", ALTITUDE, Optional)
    },
    Key {
        help: altitude,
        ..key("orbit.apogee_km", "highest altitude above a sphere of 6371 km", "km", ALTITUDE, Optional)
    },
    key("orbit.inclination_deg", "inclination", "degrees", Number(0.0, 180.0), Optional),
    key(
        "orbit.argument_of_perigee_deg",
        "argument of perigee, if it is held; averaged over otherwise",
        "degrees",
        Number(-360.0, 360.0),
        Optional,
    ),
    key(
        "orbit.history",
        "file of the elements at dates, in place of perigee, apogee and inclination",
        "",
        Text,
        Optional,
    ),
    key("environment.model", "dose model", "", Choice(&["constant", "solar-cycle", "derived", "history"]), Required),
    key("environment.sources", "source of protons; all that reach the orbit if none is given", "", Texts, Optional),
    key("environment.history", "file of the dose over time, for the model history", "", Text, Optional),
    key(
        "environment.spectra",
        "file of a proton spectrum of another program, in place of sources",
        "",
        Texts,
        Optional,
    ),
    key("environment.dose_depth", "file of dose against thickness, in place of sources", "", Text, Optional),
    Key {
        help: |value| {
            (value > 0.0)
                .then(|| "displacement damage dose, not ionising dose: values in krad cannot be converted".into())
        },
        ..key(
            "environment.active_dose_rate_mev_g_yr",
            "dose rate behind the shielding in an active year",
            "MeV/g/yr",
            Number(0.0, 1e12),
            Optional,
        )
    },
    Key {
        help: |value| {
            (1.0..=100.0)
                .contains(&value)
                .then(|| format!("a probability, not a percentage: {value} % is {}", value / 100.0))
        },
        ..key(
            "environment.confidence",
            "confidence that the fluence is not exceeded",
            "",
            Number(0.01, 0.9999),
            Default("0.95"),
        )
    },
    key(
        "environment.accumulate",
        "accumulation of the quantiles of years; mission for the model derived, yearly for the others",
        "",
        Choice(&["yearly", "mission"]),
        Optional,
    ),
    Key {
        help: |value| (value > MOST_DOSE_FACTOR).then(|| "a factor: a margin of 20 % is 1.2".into()),
        ..key(
            "environment.dose_factor",
            "factor on the whole dose, such as a radiation design margin",
            "",
            Number(0.0, MOST_DOSE_FACTOR),
            Default("1.0"),
        )
    },
    key(
        "environment.cosmic_ray_floor_mev_g_yr",
        "dose rate of cosmic rays",
        "MeV/g/yr",
        Number(0.0, 1e12),
        Default("0.0"),
    ),
    key("environment.solar_maximum", "solar maximum", "(decimal year)", Numbers(1700.0, 2300.0), Optional),
    key(
        "environment.active_years",
        "active years of the Sun in the mission, in place of those of the calendar",
        "yr",
        Number(0.0, 100.0),
        Optional,
    ),
    key(
        "environment.sun",
        "the Sun at times that were observed: drawn as at others, or as it was",
        "",
        Choice(&["drawn", "observed"]),
        Default("\"drawn\""),
    ),
    key(
        "environment.solar_events",
        "file of solar proton events that continue those of the program, for an observed Sun",
        "",
        Text,
        Optional,
    ),
    Key {
        help: |value| (value > 10.0).then(|| "a ratio, not a percentage: 75 % is 0.75".into()),
        ..key(
            "environment.nuclei_over_protons",
            "dose of helium and heavier nuclei of cosmic rays over that of their protons",
            "",
            Number(0.0, 10.0),
            Default("0.75"),
        )
    },
    key(
        "environment.solar_phase",
        "phase of the solar cycle at which trapped protons and cosmic rays are held",
        "",
        Choice(&["min", "max"]),
        Optional,
    ),
    key("environment.niel", "damage curve of protons in silicon", "", Choice(&["sr", "rd50"]), Default("\"sr\"")),
    key("shielding.geometry", "shape of the shield", "", Choice(&["sphere", "slab"]), Optional),
    key("shielding.material", "material of the shield", "", Choice(Material::NAMES), Default("\"aluminium\"")),
    Key {
        help: |value| {
            (value == 0.0).then(|| {
                "the proton model starts at 1 MeV, which 0.015 mm stop: no dose can be derived without a shield".into()
            })
        },
        ..key("shielding.thickness_mm", "thickness of the shield", "mm", Allowed::Positive(0.0, 300.0), Optional)
    },
    key(
        "shielding.areal_density_g_cm2",
        "areal density of the shield",
        "g/cm2",
        Allowed::Positive(0.0, 100.0),
        Optional,
    ),
    key("shielding.sectors", "file of thicknesses against solid angle, in place of geometry", "", Text, Optional),
    key(
        "shielding.secondaries",
        "nuclear reactions in the shield",
        "",
        Choice(&["neglected", "estimated"]),
        Default("\"neglected\""),
    ),
    key("shielding.layers[].material", "material of the layer", "", Choice(Material::NAMES), Required),
    key("shielding.layers[].thickness_mm", "thickness of the layer", "mm", Allowed::Positive(0.0, 300.0), Optional),
    key(
        "shielding.layers[].areal_density_g_cm2",
        "areal density of the layer",
        "g/cm2",
        Allowed::Positive(0.0, 100.0),
        Optional,
    ),
    key("detector.full_well_e", "full well", "e-", Allowed::Positive(0.0, 1e9), Required),
    key("detector.notch_e", "notch", "e-", Number(0.0, 1e9), Default("0.0")),
    key("detector.well_fill_power", "well fill power", "", Allowed::Positive(0.0, 5.0), Required),
    Key {
        help: percentage,
        ..key("detector.volume_at_zero", "fraction of the well that any charge fills", "", FRACTION, Default("0.0"))
    },
    Key { help: celsius, ..key("detector.temperature_k", "operating temperature", "K", TEMPERATURE, Required) },
    key(
        "detector.temperature_history",
        "file of the operating temperature over time, in place of temperature_k from its first row on",
        "",
        Text,
        Optional,
    ),
    Key {
        help: celsius,
        ..key("detector.reference_temperature_k", "temperature of the quoted release times", "K", TEMPERATURE, Required)
    },
    key(
        "detector.reference_dose_mev_g",
        "dose of the quoted trap densities",
        "MeV/g",
        Allowed::Positive(0.0, 1e15),
        Optional,
    ),
    key(
        "detector.reference_fluence_cm2",
        "proton fluence of the quoted trap densities, in place of their dose",
        "cm-2",
        Allowed::Positive(0.0, 1e18),
        Optional,
    ),
    key("detector.reference_energy_mev", "energy of those protons", "MeV", Number(0.01, 1e4), Optional),
    key("detector.traps[].name", "name of the species", "", Text, Required),
    Key {
        help: |value| (value > 1e4).then(|| "traps per pixel, not per cm3: multiply by the volume of a pixel".into()),
        ..key("detector.traps[].density_per_px", "trap density", "per pixel", Number(0.0, 1e4), Required)
    },
    key("detector.traps[].release_ms", "release time", "ms", Allowed::Positive(0.0, 1e12), Required),
    Key {
        help: |value| (value > 1.2).then(|| format!("in meV? {value} meV are {} eV", value / 1000.0)),
        ..key("detector.traps[].energy_ev", "energy level below the band", "eV", Number(0.0, 1.2), Required)
    },
    key(
        "detector.traps[].well_fill_power",
        "well fill power of this species, in place of the detector's",
        "",
        Allowed::Positive(0.0, 5.0),
        Optional,
    ),
    key(
        "detector.traps[].surface_level_e",
        "charge above which a packet reaches this species at the surface",
        "e-",
        Number(0.0, 1e9),
        Optional,
    ),
    key("readout.line_time_ms", "time between two parallel transfers", "ms", Allowed::Positive(0.0, 1e7), Required),
    Key {
        help: |value| (value > 1e5).then(|| "the number of rows to the register: 4096 for a large detector".into()),
        ..key("readout.transfers", "number of parallel transfers", "", Integer(1, 100_000), Required)
    },
    key(
        "readout.traps_at_start",
        "state of a pixel's traps when its first packet comes: empty, or carried on from the pixel nearer to the register",
        "",
        Choice(&["empty", "carried"]),
        Default("\"empty\""),
    ),
    key("readout.clock.phases", "number of phases of a pixel", "", Integer(1, 12), Required),
    key("readout.clock.holds", "phase that holds the packet in a step", "", IntegerLists(1, 12), Optional),
    key("readout.clock.dwell", "duration of each step, in any unit", "", Numbers(1e-9, 1e9), Optional),
    key("readout.clock.trap_share", "number of traps below each phase, in any unit", "", Numbers(0.0, 1e9), Optional),
    key(
        "readout.store.rows",
        "number of rows of the store, and of transfers of the burst",
        "",
        Integer(1, 100_000),
        Required,
    ),
    key(
        "readout.store.burst_line_time_ms",
        "time between two transfers of the burst",
        "ms",
        Allowed::Positive(0.0, 1e7),
        Required,
    ),
    Key {
        help: percentage_of_traps,
        ..key(
            "readout.store.trap_ratio",
            "traps of a pixel of the store over those of a pixel of the image",
            "",
            Number(0.0, 10.0),
            Default("1.0"),
        )
    },
    key(
        "readout.noise.columns",
        "number of pixels per row that one amplifier reads",
        "",
        Integer(1, 100_000),
        Required,
    ),
    key("readout.noise.rows", "number of rows that one amplifier reads", "", Integer(1, 100_000), Required),
    key(
        "readout.noise.parallel_ms",
        "part of the line time in which no pixel is read",
        "ms",
        Number(0.0, 1e7),
        Default("0.0"),
    ),
    key("readout.noise.floor_e", "read noise in the limit of slow readout", "e-", Number(0.0, 1e4), Optional),
    key(
        "readout.noise.white_e",
        "white part of the read noise at the reference rate",
        "e-",
        Number(0.0, 1e4),
        Optional,
    ),
    Key {
        help: |value| (value > 1e5).then(|| format!("in Hz? {value} Hz are {} kHz", value / 1000.0)),
        ..key("readout.noise.reference_rate_khz", "pixel rate of white_e", "kHz", Allowed::Positive(0.0, 1e5), Optional)
    },
    key("readout.noise.pixel_rate_khz", "pixel rate", "kHz", Numbers(1e-6, 1e5), Optional),
    key("readout.noise.read_noise_e", "read noise at a pixel rate", "e-", Numbers(0.0, 1e4), Optional),
    key("survey.exposure_s", "exposure time", "s", Allowed::Positive(0.0, 1e7), Required),
    key(
        "survey.slew_s",
        "slew time between exposures, during which the detector may be read out",
        "s",
        Number(0.0, 1e7),
        Default("0.0"),
    ),
    key(
        "survey.persistence.exposures",
        "number of exposures before, of the same length and readout",
        "",
        Integer(1, 20),
        Required,
    ),
    key(
        "survey.persistence.scene",
        "scene of the exposures before, same (in the same pixels) or sky (the telescope has moved)",
        "",
        Choice(&["same", "sky"]),
        Required,
    ),
    key("survey.persistence.rows", "number of rows of the frame", "", Integer(1, 100_000), Required),
    key("sky.background_e", "background", "e- per pixel", Number(0.0, 1e7), Required),
    Key {
        help: |value| (value > 0.0).then(|| "in pixels, not in arcseconds".into()),
        ..key("psf.fwhm_px", "full width at half maximum of the PSF", "px", Number(0.5, 50.0), Required)
    },
    key("psf.moffat_beta", "Moffat beta", "", Number(1.1, 100.0), Required),
    key("galaxies[].name", "name of the galaxy", "", Text, Required),
    key("galaxies[].sersic_index", "Sersic index", "", Number(0.5, 8.0), Required),
    Key {
        help: |value| (value == 0.0).then(|| "a star is a galaxy of 0.001 px".into()),
        ..key("galaxies[].half_light_px", "half-light radius", "px", Number(0.001, 100.0), Required)
    },
    key("galaxies[].flux_e", "flux", "e-", Allowed::Positive(0.0, 1e9), Optional),
    key("galaxies[].snr", "signal-to-noise ratio", "", Allowed::Positive(0.0, 1e5), Optional),
    key("galaxies[].aperture_px", "radius of the aperture", "px", Allowed::Positive(0.0, 1000.0), Optional),
    key("galaxies[].read_noise_e", "read noise", "e- per pixel", Number(0.0, 1e4), Default("0.0")),
    key("galaxies[].e1", "ellipticity", "", Number(-0.9, 0.9), Default("0.0")),
    key("galaxies[].weight_px", "width (sigma) of the weight function", "px", Number(0.5, 50.0), Required),
    key("population.table", "file of galaxies", "", Text, Optional),
    key(
        "population.galaxies",
        "number of galaxies that are evaluated, at most; without a table, that are drawn",
        "",
        Integer(1, 100_000),
        Default("100"),
    ),
    key(
        "population.magnitude_range",
        "brightest and faintest magnitude of the law",
        "mag",
        Numbers(-30.0, 40.0),
        Default("[20.0, 24.5]"),
    ),
    key(
        "population.one_electron_mag",
        "magnitude of a source of one electron in an exposure; if absent, the faintest galaxies have the flux of the judged one",
        "mag",
        Number(-30.0, 60.0),
        Optional,
    ),
    key("population.pixel_arcsec", "width of a pixel; 0.1 if absent", "arcsec", Allowed::Positive(0.0, 10.0), Optional),
    key(
        "population.transfers",
        "transfers that the table does not give: readout.transfers, the default with a table, or evenly spread up to it",
        "",
        Choice(&["evaluated", "uniform"]),
        Optional,
    ),
    key(
        "population.psf_stars_e",
        "flux of the stars of which the PSF is made",
        "e-",
        Allowed::Positive(0.0, 1e9),
        Optional,
    ),
    key(
        "population.orientations_deg",
        "orientation of the detector on the sky; the survey averages over all of the list",
        "degrees",
        Numbers(-360.0, 360.0),
        Default("[0.0]"),
    ),
    key(
        "population.dither_rows_px",
        "rows by which a galaxy is farther from the register in an exposure; the survey averages over all of the list",
        "px",
        Numbers(-100_000.0, 100_000.0),
        Default("[0.0]"),
    ),
    key(
        "population.dither_columns_px",
        "columns by which it is farther from the amplifier in the same exposure; none if absent",
        "px",
        Numbers(-100_000.0, 100_000.0),
        Optional,
    ),
    key(
        "population.noise",
        "noise of one exposure in the ellipticities",
        "",
        Choice(&["neglected", "included"]),
        Default("\"neglected\""),
    ),
    Key {
        help: |value| (value >= 1.0).then(|| "a change of ellipticity: 1 % is 0.01".into()),
        ..key("requirement.delta_e", "largest change of ellipticity", "", Allowed::Positive(0.0, 0.999), Optional)
    },
    key("requirement.c", "largest additive shear bias of the population", "", Allowed::Positive(0.0, 0.999), Optional),
    Key {
        help: percentage,
        ..key(
            "requirement.m",
            "largest multiplicative shear bias of the population",
            "",
            Allowed::Positive(0.0, 0.999),
            Optional,
        )
    },
    Key {
        help: |value| {
            (value > 0.0 && value < 1.0).then(|| {
                let factor = (1000.0 / value).round() / 1000.0;
                format!("the change is divided by this factor: if {value} of it remains, write {factor}")
            })
        },
        ..key(
            "requirement.correction_factor",
            "factor of the software correction",
            "",
            Number(1.0, 1e6),
            Default("10.0"),
        )
    },
    key("requirement.galaxy", "galaxy that is judged", "", Text, Required),
    key(
        "accuracy.readout",
        "readout method",
        "",
        Choice(&["fast", "exact", "fractional", "monte-carlo"]),
        Default("\"fast\""),
    ),
    key("accuracy.relative", "relative accuracy of the readout", "", Number(1e-12, 0.1), Default("1e-6")),
    key("accuracy.levels", "number of heights of the fractional traps", "", Integer(10, 1_000_000), Default("10000")),
    key("accuracy.seed", "seed of all random numbers", "", Integer(0, i64::MAX), Default("1")),
    key(
        "accuracy.subpixel_grid",
        "sub-pixel positions in y; as many in x if columns are not alike and independent, two (four above 8) otherwise",
        "",
        Integer(1, 64),
        Default("4"),
    ),
    key(
        "accuracy.noise_realisations",
        "noise realisations of the judged galaxy, and half of them of others; 0 for no noise",
        "",
        Integer(0, 1_000_000),
        Default("96"),
    ),
    key("uncertainty.dose_model", "relative uncertainty (1 sigma) of the dose", "", SIGMA, Default("0.2")),
    key(
        "uncertainty.niel",
        "relative uncertainty (1 sigma) of the damage curve, where the dose is derived",
        "",
        SIGMA,
        Default("0.1"),
    ),
    key(
        "uncertainty.cosmic_ray_modulation",
        "relative uncertainty (1 sigma) of the modulation of cosmic rays, where they are a source",
        "",
        SIGMA,
        Default("0.18"),
    ),
    key("uncertainty.shielding", "relative uncertainty (1 sigma) of the shield's thickness", "", SIGMA, Default("0.1")),
    key("uncertainty.density", "relative uncertainty (1 sigma) of each species' density", "", SIGMA, Default("0.1")),
    key("uncertainty.release", "relative uncertainty (1 sigma) of each release time", "", SIGMA, Default("0.1")),
    key("uncertainty.full_well", "relative uncertainty (1 sigma) of the full well", "", SIGMA, Default("0.1")),
    key(
        "uncertainty.well_fill_power",
        "relative uncertainty (1 sigma) of the well fill power",
        "",
        SIGMA,
        Default("0.05"),
    ),
    key("uncertainty.background", "relative uncertainty (1 sigma) of the background", "", SIGMA, Default("0.1")),
    key("uncertainty.galaxy_flux", "relative uncertainty (1 sigma) of the galaxy's flux", "", SIGMA, Default("0.1")),
    key(
        "uncertainty.galaxy_size",
        "relative uncertainty (1 sigma) of the galaxy's half-light radius",
        "",
        SIGMA,
        Default("0.1"),
    ),
    key("fit.free", "free parameter of a fit", "", Texts, Default("[]")),
    Key {
        help: percentage,
        ..key(
            "fit.floor",
            "systematic error (1 sigma) as a fraction of each measured value",
            "",
            Number(0.0, 1.0),
            Default("0.0"),
        )
    },
];

/// Coldest and warmest allowed detector, K.
pub const TEMPERATURES_K: [f64; 2] = [40.0, 400.0];

const TEMPERATURE: Allowed = Number(TEMPERATURES_K[0], TEMPERATURES_K[1]);

/// A fraction below 1.
pub const FRACTION: Allowed = Number(0.0, 0.999);

/// A fraction written as a percentage.
pub fn percentage(value: f64) -> Option<String> {
    (1.0..=100.0).contains(&value).then(|| format!("a fraction, not a percentage: {value} % is {}", value / 100.0))
}

/// A ratio written as a percentage.
fn percentage_of_traps(value: f64) -> Option<String> {
    (value > 10.0).then(|| format!("a ratio, not a percentage: {value} % is {}", value / 100.0))
}

/// Altitudes: from orbits that last for months up to the region where the Sun dominates.
pub const ALTITUDES_KM: [f64; 2] = [100.0, 1.5e6];

const ALTITUDE: Allowed = Number(ALTITUDES_KM[0], ALTITUDES_KM[1]);

fn altitude(value: f64) -> Option<String> {
    (value < 100.0).then(|| "an altitude in km, not a distance in Earth radii; orbits below 100 km do not last".into())
}

/// A key without advice.
pub const fn key(path: &'static str, what: &'static str, unit: &'static str, kind: Allowed, need: Need) -> Key {
    Key { path, what, unit, kind, need, help: |_| None, help_on_word: |_| None, scatter: None }
}

/// Orbits by their usual names.
fn orbit_kind(word: &str) -> Option<String> {
    let elements = "kind = \"elements\" with perigee_km, apogee_km and inclination_deg";
    match word.to_lowercase().as_str() {
        "leo" | "low-earth" | "sso" | "iss" | "meo" | "heo" | "gto" | "molniya" | "polar" => Some(elements.into()),
        "earth-trailing" | "heliocentric" | "drift-away" | "solar" => {
            Some("kind = \"interplanetary\", which is at 1 AU from the Sun".into())
        }
        _ => None,
    }
}

/// Temperatures below 0 are degrees Celsius.
fn celsius(value: f64) -> Option<String> {
    (value < 0.0 && value > -273.15).then(|| format!("this key is in kelvin: {value} °C is {:.2} K", value + 273.15))
}

impl Allowed {
    /// Whether a number is not allowed.
    pub fn refuses(&self, value: f64) -> bool {
        match *self {
            Number(low, high) | Numbers(low, high) => !(low..=high).contains(&value),
            Allowed::Positive(low, high) => !(value > low && value <= high),
            Integer(low, high) | IntegerLists(low, high) => {
                value.fract() != 0.0 || !(low as f64..=high as f64).contains(&value)
            }
            _ => false,
        }
    }

    /// Description of the allowed values.
    pub fn allowed(&self, unit: &str) -> String {
        let unit = if unit.is_empty() { String::new() } else { format!(" {unit}") };
        match *self {
            Number(low, high) => format!("{} to {}{unit}", plain(low), plain(high)),
            Numbers(low, high) => format!("a list in brackets of numbers from {} to {}{unit}", plain(low), plain(high)),
            Allowed::Positive(low, high) => format!("above {} and up to {}{unit}", plain(low), plain(high)),
            Integer(low, i64::MAX) => format!("whole numbers from {low}"),
            Integer(low, high) => format!("whole numbers from {low} to {high}"),
            IntegerLists(low, high) => format!("lists of whole numbers from {low} to {high}, such as [[1], [2]]"),
            Choice(words) => words.iter().map(|word| format!("\"{word}\"")).collect::<Vec<_>>().join(", "),
            Text => "words in quotes".into(),
            Texts => "a list of words in quotes".into(),
            Date => "a date without quotes, such as 2030-01-01".into(),
        }
    }
}

/// A number in common notation: 0.001 or 1e9, not 1000000000.
pub fn plain(value: f64) -> String {
    let magnitude = value.abs();
    if value != 0.0 && !(1e-4..1e6).contains(&magnitude) { format!("{value:e}") } else { format!("{value}") }
}

/// `detector.traps[3].name` → `detector.traps[].name`.
pub fn pattern_of(path: &str) -> String {
    let mut pattern = String::new();
    let mut inside = false;
    for letter in path.chars() {
        match letter {
            '[' => inside = true,
            ']' => inside = false,
            _ if inside => continue,
            _ => {}
        }
        pattern.push(letter);
    }
    pattern
}
