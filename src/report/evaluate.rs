//! `ctiplan evaluate`.

mod compliance;
mod distribution;
mod figures;
mod flown;
mod noise;
mod population;
mod verdict;

use comfy_table::Table;
use serde::ser::{Serialize, Serializer};

use super::{Page, Parts, Report, exceeded, or_dash, table};
use crate::mission::keys::plain;
use crate::mission::{Mission, Persistence, SceneBefore, Store};
use crate::model::realise::NoisyChange;
use crate::physics::shape::ShapeChange;
use crate::physics::solar_event_dose::SOLAR_PROTONS;
use crate::physics::{RateOrigin, SourceDose, SpeciesState};
use crate::plan::assessment::Assessment;
use crate::plan::compliance::{Line, lines, passes};
use crate::plan::date_distribution::DateDistribution;
use crate::plan::evaluate::json::NamedChange;
use crate::plan::evaluate::{Evaluation, Year};
use crate::plan::flown::Flown;
use crate::report::plot::Figure;
use crate::report::validate::significant;

/// How much of an evaluation is told.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Depth {
    /// The verdict and the warnings.
    Verdict,
    /// Also its causes, and the state at the end of the mission.
    Short,
    /// Also every year, every species and the release times.
    Whole,
}

/// The document of an evaluation, followed by the realisations.
#[derive(serde::Serialize)]
struct Document<'a> {
    #[serde(flatten)]
    evaluation: &'a Evaluation,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    monte_carlo: Vec<Realisations<'a>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    flown: Option<&'a Flown>,
    #[serde(skip_serializing_if = "Option::is_none")]
    distribution: Option<&'a DateDistribution>,
    compliance: Vec<Line>,
    /// The requested probability.
    confidence: Option<f64>,
    /// Whether all corrected budgets are met, without noise.
    passes: bool,
}

/// Realisations of one galaxy.
#[derive(serde::Serialize)]
struct Realisations<'a> {
    name: &'a str,
    measured: usize,
    /// Absent if fewer than two could be measured.
    #[serde(skip_serializing_if = "Option::is_none")]
    lost: Option<usize>,
    mean: Option<NamedChange<'a>>,
    standard_error: Option<NamedChange<'a>>,
}

impl<'a> Realisations<'a> {
    fn of(name: &'a str, noisy: Option<&NoisyChange>) -> Realisations<'a> {
        Realisations {
            name,
            measured: noisy.map_or(0, |noisy| noisy.measured),
            lost: noisy.map(|noisy| noisy.lost),
            mean: noisy.map(|noisy| NamedChange::of(name, Some(&noisy.mean))),
            standard_error: noisy.map(|noisy| NamedChange::of(name, Some(&noisy.error))),
        }
    }
}

impl Serialize for Assessment {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        let galaxies = self.evaluation.mission().galaxies.iter().zip(&self.noisy);
        let monte_carlo = galaxies.map(|(galaxy, noisy)| Realisations::of(&galaxy.name, noisy.as_ref())).collect();
        let distribution = self.distribution.as_ref();
        let compliance = self.lines();
        let passes = passes(&compliance);
        let confidence = self.confidence;
        let flown = self.flown.as_ref();
        Document { evaluation: &self.evaluation, monte_carlo, flown, distribution, compliance, confidence, passes }
            .serialize(to)
    }
}

impl Report for Assessment {
    fn text(&self) -> String {
        self.told(Depth::Short).text()
    }

    fn csv(&self) -> Vec<Vec<String>> {
        let (mission, years) = (self.evaluation.mission(), &self.evaluation.years);
        let mut header: Vec<String> = ["t_yr", "date", "dose_mev_g", "traps_per_px"].map(str::to_string).to_vec();
        let species = &years.last().expect("a mission has an end").traps;
        header.extend(species.iter().map(|species| format!("{}_per_px", species.name)));
        header.extend(["galaxy", "delta_e1", "delta_e2", "delta_y_px", "delta_size", "delta_flux"].map(str::to_string));
        let mut rows = vec![header];
        for year in years {
            for (galaxy, change) in mission.galaxies.iter().zip(&year.galaxies) {
                let mut row =
                    vec![year.t_yr.to_string(), date(year), year.dose_mev_g.to_string(), all_traps(year).to_string()];
                row.extend(year.traps.iter().map(|species| species.density_per_px.to_string()));
                row.push(galaxy.name.clone());
                row.extend(match change {
                    Some(change) => {
                        [change.delta_e1, change.delta_e2, change.delta_y_px, change.delta_size, change.delta_flux]
                            .map(|value| value.to_string())
                    }
                    None => [const { String::new() }; 5],
                });
                rows.push(row);
            }
        }
        rows
    }
}

impl Page for Assessment {
    fn command(&self) -> String {
        "evaluate".into()
    }

    fn parts(&self) -> Parts {
        self.told(Depth::Whole)
    }

    fn figures(&self) -> Vec<(String, Figure)> {
        self.drawn()
    }

    fn compliance(&self) -> Option<Table> {
        Some(compliance::table_of(&self.lines(), self.confidence))
    }
}

impl Assessment {
    /// The requirements, one by one.
    pub fn lines(&self) -> Vec<Line> {
        lines(&self.evaluation, self.distribution.as_ref(), self.confidence)
    }

    /// The evaluation in words and tables, verdict first.
    pub fn told(&self, depth: Depth) -> Parts {
        let mission = self.evaluation.mission();
        let mut out = Parts::default();
        if depth != Depth::Verdict {
            self.title(&mut out);
        }
        verdict::say(self, &mut out);
        out.warnings(&self.evaluation.warnings);
        if let Some(biases) = &self.evaluation.population {
            population::warn(biases, &mut out);
        }
        if depth == Depth::Verdict {
            return out;
        }
        out.gap();
        if let Some(flown) = &self.flown {
            flown::say(flown, mission, &mut out);
        }
        self.budget(&mut out);
        if let Some(biases) = &self.evaluation.population {
            population::judge(biases, mission, &mut out);
        }
        if let Some(distribution) = &self.distribution {
            distribution::say(distribution, mission, &mut out);
            distribution::say_met(&self.lines(), self.confidence, &mut out);
        }
        self.at_the_end(&mut out);
        if !self.noisy.is_empty() {
            self.realisations(&mut out);
        }
        if let Some(biases) = &self.evaluation.population {
            population::say(biases, mission, depth, &mut out);
        }
        out.gap();
        out.words(format!("Dose: {}", self.dose_origin()), 2);
        match depth {
            Depth::Whole => self.by_year(&mut out),
            _ => out.words("Each year, each species and the release times: -v", 2),
        }
        out
    }

    fn title(&self, out: &mut Parts) {
        let mission = self.evaluation.mission();
        let header = &mission.mission;
        out.title(
            &header.name,
            format!(
                "{} yr from {}, orbit {}; {} transfers of {} ms{}{}, {}",
                header.duration_yr,
                header.launch,
                mission.orbit_name(),
                mission.readout.transfers,
                mission.readout.line_time_ms,
                mission.readout.store.map_or(String::new(), burst),
                mission.persistence().map_or(String::new(), exposures_before),
                temperature(mission)
            ),
        );
        out.gap();
    }

    /// Dose, traps and shapes at the end of each year.
    fn by_year(&self, out: &mut Parts) {
        let Evaluation { model, years, .. } = &self.evaluation;
        let dose = model.history();
        let mut doses = table(&["t [yr]", "date", "active [yr]", "dose [MeV/g]", "traps [1/px]"]);
        for year in years {
            doses.add_row(vec![
                format!("{}", year.t_yr),
                date(year),
                match dose.averages_the_cycle() {
                    true => "mean".into(),
                    false => format!("{:.2}", dose.active_years(year.t_yr)),
                },
                format!("{:.3e}", year.dose_mev_g),
                format!("{:.4}", all_traps(year)),
            ]);
        }
        out.heading("Dose and traps");
        out.table(doses);
        if years.iter().any(|year| year.traps.len() > 1) {
            out.heading("Trap densities by species [1/px]");
            for densities in densities(years) {
                out.table(densities);
            }
        }
        self.release_times(out);
        out.heading("Change of ellipticity, delta e1");
        for changes in changes(years, model.mission.galaxies.iter().map(|galaxy| galaxy.name.as_str()).collect()) {
            out.table(changes);
        }
    }

    /// Release times at the end of the mission, at the operating temperature.
    fn release_times(&self, out: &mut Parts) {
        let Evaluation { model, years, .. } = &self.evaluation;
        let traps = &years.last().expect("a mission has an end").traps;
        if traps.is_empty() {
            return;
        }
        let time = |species: &SpeciesState| format!("{} {} ms", species.name, significant(species.release_ms));
        let times = traps.iter().map(time).collect::<Vec<_>>().join(", ");
        out.words(format!("Release times at the end of the mission, {}: {times}", temperature(&model.mission)), 2);
    }

    fn at_the_end(&self, out: &mut Parts) {
        let Evaluation { model, years, .. } = &self.evaluation;
        let mission = &model.mission;
        let end = years.last().expect("a mission has an end");
        out.heading(format!(
            "At the end, after {} yr: {:.3e} MeV/g, {:.4} traps per pixel",
            mission.mission.duration_yr,
            end.dose_mev_g,
            all_traps(end)
        ));
        let mut end_table = table(&["galaxy", "delta e1", "delta y [px]", "delta size [%]", "delta flux [%]"]);
        for (galaxy, change) in mission.galaxies.iter().zip(&end.galaxies) {
            let cell = |value: fn(&ShapeChange) -> String| change.as_ref().map_or("lost".into(), value);
            end_table.add_row(vec![
                galaxy.name.clone(),
                cell(|change| format!("{:+.3e}", change.delta_e1)),
                cell(|change| format!("{:+.4}", change.delta_y_px)),
                cell(|change| format!("{:+.4}", 100.0 * change.delta_size)),
                cell(|change| format!("{:+.4}", 100.0 * change.delta_flux)),
            ]);
        }
        out.table(end_table);
    }

    fn budget(&self, out: &mut Parts) {
        let Evaluation { model, verdict, .. } = &self.evaluation;
        let mission = &model.mission;
        let requirement = &mission.requirement;
        if !requirement.limits_a_galaxy() {
            return;
        }
        out.verdict(
            format!(
                "Budget, design case: |delta e| of \"{}\" below {}",
                requirement.galaxy,
                plain(requirement.delta_e)
            ),
            2,
        );
        let corrected = format!("corrected, factor {}", requirement.correction_factor);
        let width = corrected.len();
        for (name, crossing) in [("uncorrected", &verdict.uncorrected), (corrected.as_str(), &verdict.corrected)] {
            out.judged(name, width, exceeded(crossing, mission.mission.launch.0), crossing.t_yr.is_none());
        }
        if let Some(noise) = &self.evaluation.noise {
            noise::say(&self.evaluation, noise, out);
        }
        let rate = |rate: Option<f64>| or_dash(rate.map(|rate| format!("{rate:.3e}")));
        out.verdict(
            format!(
                "  rate of |delta e|: {} per yr at launch, {} per yr on average",
                rate(verdict.rate_at_launch_per_yr),
                rate(verdict.mean_rate_per_yr)
            ),
            4,
        );
    }

    fn realisations(&self, out: &mut Parts) {
        let mission = self.evaluation.mission();
        let mut noisy_table = table(&["galaxy", "delta e1", "+-", "delta y [px]", "+-", "measured", "lost"]);
        for (galaxy, noisy) in mission.galaxies.iter().zip(&self.noisy) {
            let cell = |value: fn(&NoisyChange) -> String| or_dash(noisy.as_ref().map(value));
            noisy_table.add_row(vec![
                galaxy.name.clone(),
                cell(|noisy| format!("{:+.3e}", noisy.mean.delta_e1)),
                cell(|noisy| format!("{:.1e}", noisy.error.delta_e1)),
                cell(|noisy| format!("{:+.4}", noisy.mean.delta_y_px)),
                cell(|noisy| format!("{:.1e}", noisy.error.delta_y_px)),
                cell(|noisy| noisy.measured.to_string()),
                cell(|noisy| noisy.lost.to_string()),
            ]);
        }
        out.gap();
        out.words(
            "The same from realisations with photon and read noise, centroid fitted, ellipticity bounded by 1; +- standard error. \
             The budget is judged without noise.",
            0,
        );
        out.table(noisy_table);
    }

    fn dose_origin(&self) -> String {
        let (mission, dose) = (self.evaluation.mission(), self.evaluation.model.history());
        let environment = &mission.environment;
        let shield = mission.shielding.as_ref().map_or(String::new(), |shielding| shielding.words());
        let niel = environment.niel;
        let origin = match dose.origin {
            RateOrigin::Given => "given by the mission file".into(),
            RateOrigin::Esp { .. } if dose.active_years(mission.mission.duration_yr) == 0.0 => {
                "of ESP solar protons, but the mission has no active year of the Sun".into()
            }
            RateOrigin::Esp { active_years } => format!(
                "ESP solar protons at {} % confidence for {active_years:.2} active years behind a {shield}, damage curve {niel}",
                100.0 * environment.confidence,
            ),
            RateOrigin::Sources { .. } => {
                let added: Vec<String> = self.added_dose().into_iter().map(|added| format!(", and {added}")).collect();
                return format!("{} behind a {shield}, damage curve {niel}{}", self.by_source(), added.concat());
            }
            RateOrigin::Spectra => format!("imported spectra behind a {shield}, damage curve {niel}, spread evenly"),
            RateOrigin::DoseDepth => "an imported dose-depth curve, spread evenly".into(),
            RateOrigin::History => return format!("imported: {}", environment.history.as_deref().unwrap_or("a file")),
        };
        if matches!(dose.origin, RateOrigin::Spectra | RateOrigin::DoseDepth) {
            return format!("{:.3e} MeV/g/yr in every year; {origin}", dose.floor_mev_g_yr);
        }
        let added: Vec<String> = self.added_dose().into_iter().map(|added| format!(", and {added}")).collect();
        let rate = format!("{:.3e} MeV/g/yr {}", dose.active_rate_mev_g_yr, self.active_years());
        format!("{rate}; {origin}{}", added.concat())
    }

    /// The years in which a rate of active years holds.
    fn active_years(&self) -> String {
        let (mission, dose) = (self.evaluation.mission(), self.evaluation.model.history());
        match mission.environment.active_years {
            Some(years) => {
                format!(
                    "in active years, of which {years:.2} are spread over {} yr",
                    plain(mission.mission.duration_yr)
                )
            }
            None if dose.averages_the_cycle() => "in active years, averaged over the solar cycle (x 7/11)".into(),
            None => "in active years, nothing in quiet ones".into(),
        }
    }

    /// Mean dose rates of all sources over the mission, the largest first.
    fn by_source(&self) -> String {
        let (mission, dose) = (self.evaluation.mission(), self.evaluation.model.history());
        let duration_yr = mission.mission.duration_yr;
        let mean = |source: &SourceDose| dose.of_source_mev_g(source, 0.0, duration_yr) / duration_yr;
        let mut rates: Vec<(f64, &str)> = dose.sources.iter().map(|source| (mean(source), &source.name[..])).collect();
        rates.sort_by(|a, b| b.0.total_cmp(&a.0));
        let said = |&(rate, name): &(f64, &str)| {
            let shown = if rate == 0.0 { "0".into() } else { significant(rate) };
            let when = if name == SOLAR_PROTONS { self.solar_protons() } else { String::new() };
            format!("{} {shown}{when}", name.replace('-', " "))
        };
        let total: f64 = rates.iter().map(|(rate, _)| rate).sum();
        let all: Vec<String> = rates.iter().map(said).collect();
        format!("{total:.3e} MeV/g/yr on average: {},", all.join(", "))
    }

    /// When the dose of solar protons arrives, and its quantile.
    fn solar_protons(&self) -> String {
        let (mission, dose) = (self.evaluation.mission(), self.evaluation.model.history());
        let RateOrigin::Sources { active_years } = dose.origin else { return String::new() };
        let observed = mission.observed_to().map(|day| format!("observed events to {day}"));
        if dose.active_years(mission.mission.duration_yr) == 0.0 {
            return format!(" ({})", observed.unwrap_or("no active year of the Sun".into()));
        }
        format!(
            " ({}{} {}; ESP at {} % confidence for {active_years:.2} active years)",
            observed.map_or(String::new(), |observed| format!("{observed}, then ")),
            significant(dose.active_rate_mev_g_yr),
            self.active_years(),
            100.0 * mission.environment.confidence,
        )
    }

    /// Further contributions to the dose, in words.
    fn added_dose(&self) -> Vec<String> {
        let (mission, dose) = (self.evaluation.mission(), self.evaluation.model.history());
        let mut added = Vec::new();
        if dose.floor_mev_g_yr != 0.0 {
            added.push(format!("{:.3e} MeV/g/yr of cosmic rays in every year", dose.floor_mev_g_yr));
        }
        let flown = dose.steps.iter().filter(|(t_yr, _)| *t_yr <= mission.mission.duration_yr);
        let steps: Vec<f64> = flown.map(|(_, dose_mev_g)| *dose_mev_g).collect();
        if !steps.is_empty() {
            let events = if steps.len() == 1 { "1 event".into() } else { format!("{} events", steps.len()) };
            added.push(format!("{:.3e} MeV/g of {events} on single days", steps.iter().sum::<f64>()));
        }
        for wave in &dose.modulations {
            added.push(format!(
                "the rate times 1 + {} cos(2 pi (t - {})/{} yr)",
                plain(wave.amplitude),
                plain(wave.peak),
                plain(wave.period_yr)
            ));
        }
        if !dose.rate_laws.is_empty() || !dose.dose_laws.is_empty() {
            added.push("a formula ([effects.formula]) changes that".into());
        }
        added
    }
}

/// The burst into a store.
fn burst(store: Store) -> String {
    let Store { rows, burst_line_time_ms, trap_ratio } = store;
    format!(" from a store filled by {rows} transfers of {burst_line_time_ms} ms (traps x {trap_ratio})")
}

/// The earlier exposures.
fn exposures_before(before: Persistence) -> String {
    let scene = if before.scene == SceneBefore::Same { "the same scene" } else { "sky" };
    format!(" after {} exposures of {scene}", before.exposures)
}

/// The operating temperature.
fn temperature(mission: &Mission) -> String {
    let detector = &mission.detector;
    match &detector.temperature_history {
        None => format!("{} K", detector.temperature_k),
        Some(file) => format!("temperature history {file}"),
    }
}

/// Traps of all species, 1/px.
fn all_traps(year: &Year) -> f64 {
    year.traps.iter().map(|species| species.density_per_px).sum()
}

fn date(year: &Year) -> String {
    or_dash(year.date.map(|date| date.to_string()))
}

/// Tables with one column for each member, as many side by side as fit; `cell` is the text of a member in a year.
fn by_member(years: &[Year], names: &[&str], cell: impl Fn(&Year, usize) -> String) -> Vec<Table> {
    let side_by_side = 5;
    let block = |(block, names): (usize, &[&str])| {
        let mut block_table = table(&[&["t [yr]"], names].concat());
        for year in years {
            let members = block * side_by_side..block * side_by_side + names.len();
            let cells = members.map(|member| cell(year, member));
            block_table.add_row([format!("{}", year.t_yr)].into_iter().chain(cells));
        }
        block_table
    };
    names.chunks(side_by_side).enumerate().map(block).collect()
}

/// Densities by year, one column for each species.
fn densities(years: &[Year]) -> Vec<Table> {
    let names: Vec<&str> = years[0].traps.iter().map(|species| species.name.as_str()).collect();
    by_member(years, &names, |year, species| format!("{:.4}", year.traps[species].density_per_px))
}

/// Changes of ellipticity by year, one column for each galaxy.
fn changes(years: &[Year], names: Vec<&str>) -> Vec<Table> {
    by_member(years, &names, |year, galaxy| {
        year.galaxies[galaxy].map_or("lost".into(), |change| format!("{:+.3e}", change.delta_e1))
    })
}
