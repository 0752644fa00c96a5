//! Warnings: observation, consequence and remedy.

use std::fmt;

use serde::ser::{Serialize, Serializer};

use crate::environment::solar_cycle::{CYCLE_YR, Maximum};

/// Number of line times below which a release time counts as release in place ([`Warning::ReleasesInPlace`]).
///
/// A packet leaves a pixel by way of the pixel's phases, three of them in most CCDs, one in each third of a line time Δt. An
/// electron that its trap releases meanwhile falls back into the packet: of a species with release time τ the share
/// 1 − exp(−Δt/3τ), 96 % at τ = Δt/10. A transfer that is one step gives all of them to the packet behind instead.
pub const RELEASED_IN_PLACE_LINES: f64 = 0.1;

/// A reason to doubt a result.
#[derive(Clone, Debug, PartialEq)]
pub enum Warning {
    /// Conditions of measurements are the mission's, although the file has columns that look like them.
    LooksLikeCondition {
        /// The file.
        file: String,
        /// Column, condition, and the mission's value with its unit.
        found: Vec<[String; 3]>,
    },
    /// The mission flies through active years of the Sun that are not known yet.
    SunExtrapolated {
        /// Maxima that are assumed.
        maxima: Vec<Maximum>,
    },
    /// A species holds charge for longer than the whole readout takes.
    NeverReleases {
        /// Name of the species.
        species: String,
        /// Its release time over the time of all transfers.
        over_readout: f64,
    },
    /// A species releases long before the packet moves on.
    ReleasesInPlace {
        /// Name of the species.
        species: String,
        /// Its release time over the time between two transfers.
        over_line: f64,
    },
    /// A readout takes hours.
    LongReadout {
        /// Time between two transfers, ms.
        line_time_ms: f64,
        /// Time of all transfers, h.
        hours: f64,
    },
    /// A row of a square frame is read faster than by any amplifier.
    FastReadout {
        /// Time between two transfers, ms.
        line_time_ms: f64,
        /// Number of parallel transfers, and so of pixels in a row of a square frame.
        transfers: u32,
        /// Pixels of that row per second, in millions.
        mega_px_s: f64,
    },
    /// All species release far too early or far too late to be noticed.
    NothingToNotice {
        /// The shortest and the longest release time, ms.
        release_ms: (f64, f64),
        /// Time between two transfers, ms.
        line_time_ms: f64,
        /// Time of all transfers, ms.
        readout_ms: f64,
    },
    /// Release times are quoted at a temperature far from that of the detector.
    FarFromReference {
        /// The species whose release time changes most.
        species: String,
        /// The reference temperature and that of the detector, K.
        temperatures_k: (f64, f64),
        /// Its release time at these, ms.
        release_ms: (f64, f64),
    },
    /// Traps start in the state of the pixel nearer to the register.
    CarriedTraps,
    /// A pixel holds more than the full well.
    Saturated {
        /// What it is a pixel of.
        name: String,
        /// Its charge, e-.
        peak_e: f64,
    },
    /// The dose of solar protons is shown for an orbit that they do not reach freely.
    ShieldedByField,
    /// A phase of the solar cycle is given, but the dose does not depend on it.
    IdlePhase,
    /// Nuclear reactions in the shield change the dose.
    Secondaries {
        /// Share of the dose that is lost with protons that react.
        lost: f64,
        /// Share that neutrons add.
        neutrons: f64,
        /// Whether both are counted.
        counted: bool,
    },
    /// The orbit meets the same longitudes again and again.
    RepeatsLongitudes {
        /// Revolutions a sidereal day.
        revolutions: u32,
    },
    /// Sources are counted that do not reach the orbit.
    DoesNotReach {
        /// Their names.
        sources: Vec<&'static str>,
        /// The orbit, in words.
        orbit: String,
    },
    /// An imported spectrum ends before the energies that get through the shield.
    SpectrumEnds {
        /// The file.
        file: String,
        /// Its last energy, MeV.
        last_mev: f64,
        /// Energy (MeV) below which the shield stops protons where it is thinnest.
        stopped_mev: f64,
    },
    /// A shield is thinner or thicker than an imported dose-depth curve.
    BeyondDepths {
        /// The file.
        file: String,
        /// Its thinnest and thickest aluminium, g/cm².
        depths_g_cm2: (f64, f64),
    },
    /// Cosmic rays are derived, and given by hand besides.
    CosmicRaysTwice {
        /// Dose rate given by hand, MeV/g/yr.
        floor_mev_g_yr: f64,
    },
    /// Trapped protons are counted where there are none.
    NoTrappedProtons {
        /// The orbit, in words.
        orbit: String,
    },
    /// The Sun is active for less than the shortest time of the model of solar protons.
    PartOfAnActiveYear {
        /// Active years in the mission.
        active_years: f64,
        /// Probability that their fluence is not exceeded.
        confidence: f64,
    },
    /// The mean of the trapped protons over the orbit has not converged.
    OrbitMean {
        /// Its estimated relative error.
        relative_error: f64,
    },
    /// Trapped protons are counted where the belt ends in the atmosphere.
    LowAltitude {
        /// Altitude of the perigee, km.
        perigee_km: f64,
    },
    /// Sun and Moon move the perigee of a long ellipse.
    PerigeeMoves {
        /// Whether its argument is held.
        held: bool,
    },
    /// The readout has one realisation of random traps.
    OneSetOfTraps,
    /// The accuracy of the readout is too low for the requirement.
    CoarseAccuracy {
        /// `[accuracy] relative`.
        relative: f64,
    },
    /// What is left of a shape is so rough that crossings of its limit may be missed.
    RoughShape {
        /// Longest interval between two shapes computed, yr.
        interval_yr: f64,
    },
    /// According to its header, the same task was applied to a frame before.
    DoneBefore {
        /// The frame.
        name: String,
        /// What was done.
        task: &'static str,
    },
    /// Pixels without light hold much charge beside those of the image.
    DarkPixelsHoldCharge {
        /// The frame.
        name: String,
        /// Median charge in prescan and overscan, e-.
        dark_e: f64,
        /// Median charge in the image, e-.
        lit_e: f64,
    },
    /// A FITS file has bytes after its last HDU.
    AfterLastHdu {
        /// Bytes that were copied.
        bytes: u64,
    },
    /// Packets were emptied by traps, and a correction cannot determine their charge.
    UncertainPixels {
        /// The frame.
        name: String,
        /// Number of pixels.
        pixels: usize,
        /// Error that they may have more than, e-.
        error_e: f64,
        /// The extension in which they are marked.
        marked: String,
    },
    /// Errors or data quality of a frame cannot be used.
    CompanionNotUsed {
        /// Their HDU.
        name: String,
        /// The frame's.
        frame: String,
        /// What is wrong with them.
        why: &'static str,
        /// What to do.
        help: &'static str,
    },
    /// An image without a known name is no frame.
    ImageLeftOut {
        /// Its HDU.
        name: String,
        /// The reason.
        why: String,
    },
    /// A correction has left a residual above the tolerance.
    NotCorrected {
        /// The frame.
        name: String,
        /// Largest residual that is left, e-.
        max_e: f64,
        /// Largest residual before the correction, e-.
        of_e: f64,
    },
    /// Warm pixels were looked for in a single exposure.
    OneExposure,
    /// The dipoles of a frame are not those of its pumping series.
    NotOfSeries {
        /// The frame.
        name: String,
        /// Its dipoles over those that the other frames predict.
        times: f64,
        /// Time of one phase, ms.
        phase_time_ms: f64,
        /// Cycles of trap pumping.
        cycles: f64,
    },
    /// The level of no charge is that of rows in which the trail has not ended.
    TrailInBias {
        /// The frame.
        name: String,
        /// Charge per pixel of the trail in them, estimated from its decay before, e-.
        left_e: f64,
        /// 1-sigma error of the level, e-.
        sigma_e: f64,
    },
    /// Far behind an edge, the charge is not that of the bias.
    LevelBehindEdge {
        /// The frame.
        name: String,
        /// Charge per pixel in the last overscan rows, e-.
        level_e: f64,
        /// Its 1-sigma error, e-.
        sigma_e: f64,
    },
    /// The bias does not drift evenly along the rows.
    BentBias {
        /// The frame.
        name: String,
        /// Bias in the middle third of the rows less that of the line, in the unit of the frame.
        bend_dn: f64,
        /// Its 1-sigma error.
        sigma_dn: f64,
    },
    /// A flat field changes along the columns.
    SlopedFlat {
        /// The frame.
        name: String,
        /// Level at the first row over that of the last rows, less 1.
        share: f64,
    },
}

impl Warning {
    /// Share of the dose that neutrons add, of a warning about nuclear reactions.
    pub fn neutrons(&self) -> Option<f64> {
        match self {
            Warning::Secondaries { neutrons, .. } => Some(*neutrons),
            _ => None,
        }
    }
}

/// Warnings of several missions, each said once; what is extrapolated for any of them is said together, and of nuclear reactions
/// those that matter most.
pub fn together<'a>(warnings: impl IntoIterator<Item = &'a Warning>) -> Vec<Warning> {
    let mut maxima: Vec<Maximum> = Vec::new();
    let mut others: Vec<Warning> = Vec::new();
    for warning in warnings {
        let reactions = others.iter().position(|known| known.neutrons().is_some());
        match (warning, reactions) {
            (Warning::SunExtrapolated { maxima: more }, _) => maxima.extend(more),
            (Warning::Secondaries { .. }, Some(place)) if others[place].neutrons() < warning.neutrons() => {
                others[place] = warning.clone();
            }
            (Warning::Secondaries { .. }, Some(_)) => {}
            (other, _) if !others.contains(other) => others.push(other.clone()),
            _ => {}
        }
    }
    maxima.sort_by(|a, b| a.year.total_cmp(&b.year));
    maxima.dedup();
    let sun = (!maxima.is_empty()).then_some(Warning::SunExtrapolated { maxima });
    sun.into_iter().chain(others).collect()
}

/// As people read it.
impl Serialize for Warning {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        to.collect_str(self)
    }
}

impl fmt::Display for Warning {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            // Measurements.
            Warning::LooksLikeCondition { file, found } => {
                let one = |[column, condition, value]: &[String; 3]| {
                    format!(
                        "{condition} is the mission's ({value}), and the column `{column}` is not used; if it is meant, name it \
                         `{condition}`"
                    )
                };
                write!(out, "{file}: {}", found.iter().map(one).collect::<Vec<_>>().join("; "))
            }
            // The dose.
            Warning::SunExtrapolated { maxima } => {
                let years: Vec<String> =
                    maxima.iter().map(|maximum| format!("{:.1} +- {:.1}", maximum.year, maximum.sigma_yr())).collect();
                let (be, s) = if years.len() == 1 { ("is", "um") } else { ("are", "a") };
                write!(
                    out,
                    "the solar maxim{s} {} {be} extrapolated with the mean cycle of {CYCLE_YR} yr: the dose in these cycles is \
                     uncertain; put better dates into environment.solar_maximum",
                    years.join(", ")
                )
            }
            Warning::ShieldedByField => write!(
                out,
                "the magnetosphere shields a low Earth orbit from part of the solar protons: the ESP values hold outside it"
            ),
            Warning::IdlePhase => write!(
                out,
                "the phase of the solar cycle (environment.solar_phase) has no effect on a dose that is given: derive it with \
                 environment.model = \"derived\""
            ),
            Warning::Secondaries { lost, neutrons, counted } => write!(
                out,
                "nuclear reactions in the shield are {}included: they {} {:.0} % of the dose and add {:.0} % by neutrons, uncertain by \
                 a factor of 2{}",
                if *counted { "" } else { "not " },
                if *counted { "remove" } else { "would remove" },
                100.0 * lost,
                100.0 * neutrons,
                if *counted { "" } else { "; to include them: shielding.secondaries = \"estimated\"" }
            ),
            Warning::CosmicRaysTwice { floor_mev_g_yr } => write!(
                out,
                "environment.cosmic_ray_floor_mev_g_yr = {floor_mev_g_yr:e} comes on top of the cosmic rays that are derived: remove \
                 it, or name environment.sources without them"
            ),
            Warning::SpectrumEnds { file, last_mev, stopped_mev } => write!(
                out,
                "{file} ends at {last_mev} MeV, but the shield stops protons below {stopped_mev:.0} MeV: what gets through is mostly \
                 extrapolated"
            ),
            Warning::BeyondDepths { file, depths_g_cm2: (least, most) } => write!(
                out,
                "part of the shield is thinner or thicker than {file}, {least:.3} to {most:.3} g/cm2 of aluminium: its dose is \
                 extrapolated"
            ),
            // Protons along the orbit.
            Warning::DoesNotReach { sources, orbit } => {
                write!(out, "{} do not reach the orbit ({orbit}) and add nothing", sources.join(" and "))
            }
            Warning::RepeatsLongitudes { revolutions } => write!(
                out,
                "the orbit makes {revolutions} revolution{} a day and meets the same longitudes again and again: its trapped protons \
                 may be half or twice the mean over all longitudes that is used",
                if *revolutions == 1 { "" } else { "s" }
            ),
            Warning::NoTrappedProtons { orbit } => write!(
                out,
                "AP-8 has no trapped protons on the orbit ({orbit}): it lies below the belt or outside it, and its few protons, \
                 below 1 /cm2/s, are not in the model"
            ),
            Warning::PartOfAnActiveYear { active_years, confidence } => write!(
                out,
                "the mission has {active_years:.3} active years of the Sun, and ESP is a model of one or more: the fluence of a whole \
                 active year at {} % confidence is used, an upper limit",
                100.0 * confidence
            ),
            Warning::OrbitMean { relative_error } => write!(
                out,
                "the mean of the trapped protons over the orbit has an estimated error of {:.1} %: few of them are met, in a small \
                 part of the orbit",
                100.0 * relative_error
            ),
            Warning::LowAltitude { perigee_km } => write!(
                out,
                "at {perigee_km} km the flux of trapped protons doubles within 50 to 70 km of altitude: AP-8 is uncertain by \
                 more than its factor of 2"
            ),
            Warning::PerigeeMoves { held } => write!(
                out,
                "Sun and Moon move the perigee of so long an ellipse by thousands of km within years: the dose of trapped protons {} \
                 may change by a factor of 10; give the orbit of each part of the mission, or import a spectrum",
                if *held { "at this perigee" } else { "as a mean over all arguments of perigee" }
            ),
            // The readout.
            Warning::Saturated { name, peak_e } => write!(
                out,
                "{name} puts {peak_e:.3e} e- into a pixel, more than the full well: the cloud then has its largest height, \
                 and blooming is not modelled"
            ),
            Warning::NeverReleases { species, over_readout } => write!(
                out,
                "{species} releases after {over_readout:.2} readouts: its traps stay filled from one exposure to the next, but \
                 here they start empty: describe the exposures before in [survey.persistence]"
            ),
            Warning::ReleasesInPlace { species, over_line } => write!(
                out,
                "{species}: the release time is {over_line:.3} line times. In a CCD nearly all of these electrons return to their own \
                 packet. Without [readout.clock] they join the packet behind, and the trail of {species} is overestimated"
            ),
            Warning::LongReadout { line_time_ms, hours } => write!(
                out,
                "with readout.line_time_ms = {line_time_ms} a readout takes {hours:.1} h: is the line time in ms? (50000 us are 50 ms)"
            ),
            Warning::FastReadout { line_time_ms, transfers, mega_px_s } => write!(
                out,
                "with readout.line_time_ms = {line_time_ms} a row of {transfers} pixels, as of a square frame, is read at {mega_px_s:.0} \
                 million pixels per second; CCDs are read at up to 30: is the line time in ms? (0.05 s are 50 ms)"
            ),
            Warning::NothingToNotice { release_ms: (least, most), line_time_ms, readout_ms } => write!(
                out,
                "no species releases at a time that the readout notices, between the line time of {line_time_ms} ms and the \
                 {readout_ms:.3e} ms of all transfers: their release times are {least:.2e} to {most:.2e} ms; are line time and release \
                 times in ms?"
            ),
            Warning::FarFromReference {
                species,
                temperatures_k: (reference, operating),
                release_ms: (quoted, release),
            } => write!(
                out,
                "{species}: {quoted:.2e} ms at {reference} K (detector.reference_temperature_k) are {release:.2e} ms at {operating} K: \
                 release times far from the temperature at which they were measured are uncertain by as much as their energies; is that \
                 the temperature at which they are quoted?"
            ),
            Warning::CarriedTraps => write!(
                out,
                "readout.traps_at_start = \"carried\" is the default of ArCTIc, for comparison with it: charge is not conserved, \
                 and every transfer is computed, which takes longer than accuracy.readout = \"fast\""
            ),
            Warning::OneSetOfTraps => write!(
                out,
                "accuracy.readout = \"monte-carlo\" has one realisation of random traps: its scatter affects every \
                 value and the verdict; compare several values of accuracy.seed"
            ),
            Warning::CoarseAccuracy { relative } => {
                write!(out, "accuracy.relative = {relative} may affect the shapes: 1e-6 takes little more time")
            }
            Warning::RoughShape { interval_yr } => write!(
                out,
                "near its limit the change of shape is rough: hardly a shape is left to measure, or the accuracy of the readout is \
                 too low. Up to {interval_yr:.2} yr apart, crossings of the limit may be missed; try a smaller accuracy.relative or \
                 a larger accuracy.subpixel_grid"
            ),
            // Frames with trails added or removed.
            Warning::DoneBefore { name, task } => {
                write!(
                    out,
                    "according to its header, `ctiplan {task}` was applied to {name} before: it is applied again"
                )
            }
            Warning::AfterLastHdu { bytes } => {
                write!(out, "{bytes} bytes after the last HDU do not start with XTENSION: they are copied unchanged")
            }
            Warning::CompanionNotUsed { name, frame, why, help } => write!(
                out,
                "{name} is called as errors or data quality of {frame} are, and {why}: it is copied, and neither used nor changed; \
                 {help}, or give it another name"
            ),
            Warning::ImageLeftOut { name, why } => {
                write!(out, "{name} is left out ({why}): if it is a frame, select it with --hdu")
            }
            Warning::UncertainPixels { name, pixels, error_e, marked } => write!(
                out,
                "{pixels} pixels of {name} are uncertain by more than {error_e:.3e} e-: their packets, or packets ahead of \
                 them, were emptied by traps, and the frame does not determine their charge; they are marked in the extension \
                 {marked}"
            ),
            Warning::DarkPixelsHoldCharge { name, dark_e, lit_e } => write!(
                out,
                "prescan and overscan of {name} hold {dark_e:.1} e- per pixel, and its image {lit_e:.1} e- (medians): if that is bias, \
                 it was taken for charge; give the bias, or check the sizes of prescan and overscan"
            ),
            Warning::NotCorrected { name, max_e, of_e } => write!(
                out,
                "the correction of {name} leaves up to {max_e:.3e} e- of {of_e:.3e} e- that the forward model moves: increase \
                 --iterations, decrease --relative, or increase --tolerance; faint pixels without sky converge slowly"
            ),
            // Measurements in frames.
            Warning::OneExposure => write!(
                out,
                "warm pixels were looked for in a single exposure: cosmic rays that hit one pixel alone count as warm pixels; give \
                 several exposures of the same date"
            ),
            Warning::NotOfSeries { name, times, phase_time_ms, cycles } => write!(
                out,
                "{name}: its dipoles are {times:.2} times what the other frames of the series predict for {cycles} cycles with a phase \
                 time of {phase_time_ms} ms: it was not pumped so, and is left out; check its phase time and cycles"
            ),
            Warning::TrailInBias { name, left_e, sigma_e } => write!(
                out,
                "{name}: the trail reaches into the rows that define the level of no charge: by its decay in the rows before, {left_e:.2} e- of \
                 it are there (error of that level {sigma_e:.2} e-), and values are too small by about that, which is in their sigma_common; use --bias-from columns (of injected \
                 charge: --background-from front), or more rows"
            ),
            Warning::LevelBehindEdge { name, level_e, sigma_e } => {
                let cause = if *level_e < 0.0 {
                    "the bias is too high, given so or because its pixels hold charge such as a serial tail: give --bias-from rows, or more overscan columns"
                } else {
                    "a fit takes it as a trail of slow traps; if it is dark charge or an offset, give --bias-from rows"
                };
                write!(
                    out,
                    "{name}: the last overscan rows hold {level_e:+.2} +- {sigma_e:.2} e- above the bias and do not fall: {cause}"
                )
            }
            Warning::BentBias { name, bend_dn, sigma_dn } => write!(
                out,
                "{name}: the bias drifts along the rows, and is {bend_dn:+.2} +- {sigma_dn:.2} DN off a straight line in their middle: \
                 what is left of it behind the edge looks like a trail; subtract the bias row by row first"
            ),
            Warning::SlopedFlat { name, share } => write!(
                out,
                "{name}: the flat field is {:.1} % {} at its first row than in its last ones: its first row is compared with a straight line \
                 through the rows behind it",
                100.0 * share.abs(),
                if *share > 0.0 { "brighter" } else { "darker" }
            ),
        }
    }
}
