//! `ctiplan study pocket-pumping`.

use super::estimate::plus_minus;
use super::table::{column, words};
use super::{DataTable, Digits, Shown, StudyReport, short};
use crate::mission::Mission;
use crate::physics::SpeciesState;
use crate::report::plot::{Figure, Panel, level, line};
use crate::study::Estimate;
use crate::study::pocket_pumping::{Earned, Known, Phase, Results, dipole_e};

impl Shown for Results {
    fn shown(&self, mission: &Mission) -> StudyReport {
        let title = format!(
            "traps found by pocket pumping at the end of the mission: {} cycles or {} s, flat of {} e-, {} images per phase time",
            self.options.cycles,
            short(self.options.image_s),
            short(self.flat_e),
            self.options.images
        );
        let mut report = StudyReport::of("pocket-pumping", mission, title, &self.warnings);
        report.of_galaxy_alone(mission);
        report.cite(
            "Pocket pumping: dipoles of single traps",
            "Mostek et al. 2010 (Proc. SPIE 7742); Murray et al. 2012 (Proc. SPIE 8453); Hall et al. 2014 (IEEE Trans. Nucl. \
             Sci. 61, 1826); Skottfelt et al. 2017",
        );
        report.tables = vec![dipoles(self), known(self)];
        report.draw(figure(self, mission));
        report.findings.extend(self.known.iter().map(|known| found(self, known)));
        report.findings.extend(self.species.iter().filter_map(|species| not_found(self, species)));
        report.result("hours_per_temperature", self.hours_per_temperature);
        report.find(format!(
            "All {} phase times at one temperature take {:.1} h with reading out.",
            self.phases.len(),
            self.hours_per_temperature
        ));
        match self.earned {
            Earned::NothingToCorrect => report.find("There is nothing to correct at the end of the mission."),
            Earned::ShapeLost => {}
            Earned::Factors { before, after } => earned(&mut report, self, before, after),
        }
        report
    }
}

fn dipoles(results: &Results) -> DataTable {
    let columns = vec![
        column("temperature_k", "T [K]", Digits::Significant(4)),
        words("species", "species"),
        column("release_ms", "release [ms]", Digits::Significant(3)),
        column("phase_ms", "phase [ms]", Digits::Significant(3)),
        column("cycles", "cycles", Digits::Fixed(0)),
        column("dipole_e", "dipole [e-]", Digits::Significant(3)),
        column("snr", "sigma", Digits::Fixed(1)),
        column("found_percent", "found [%]", Digits::Fixed(0)),
        column("release_error_percent", "to [%]", Digits::Significant(2)),
    ];
    DataTable::of("dipoles", &results.dipoles, columns)
        .titled("Dipoles at the best phase time, and release times fitted to all, trap by trap")
}

fn known(results: &Results) -> DataTable {
    let columns = vec![
        words("species", "species"),
        column("temperature_k", "T [K]", Digits::Significant(4)),
        column("phase_ms", "phase [ms]", Digits::Significant(3)),
        column("traps", "traps", Digits::Significant(3)),
        column("density_error_percent", "density to [%]", Digits::Significant(2)),
        column("release_error_percent", "release to [%]", Digits::Significant(2)),
    ];
    DataTable::of("known", &results.known, columns)
        .titled("Errors for all traps within reach; release times at the operating temperature")
}

fn figure(results: &Results, mission: &Mission) -> Figure {
    let options = &results.options;
    let x: Vec<f64> = results.phases.iter().map(|phase| phase.phase_ms).collect();
    let curve = |release_ms: f64| -> Vec<f64> {
        let at = |phase: &Phase| dipole_e(phase.cycles, options.capture_probability, phase.phase_ms, release_ms);
        results.phases.iter().map(at).collect()
    };
    let species = results.species.iter().enumerate();
    let mut series: Vec<_> =
        species.map(|(index, species)| line(&species.name, index + 1, &x, curve(species.release_ms))).collect();
    series.push(level("threshold", options.threshold_sigma * results.noise_e));
    let panel = Panel {
        x_label: "phase time [ms]".into(),
        y_label: "dipole [e-]".into(),
        x_log: true,
        series,
        ..Panel::default()
    };
    Figure {
        title: format!("{}: dipoles at {} K", mission.mission.name, short(results.operating_k)),
        panels: vec![panel],
    }
}

/// Knowledge of a species that is found.
fn found(results: &Results, known: &Known) -> String {
    let release = match known.release_error_percent {
        Some(percent) => format!("to {percent:.2} % (thermometer {} K)", results.options.temperature_error_k),
        None => "is unknown: the energy level needs a second temperature".into(),
    };
    format!(
        "{} is detected best at {} K with phases of {} ms: {} traps within reach of the flat. Its density is known to {:.2} %, its \
         release time at {} K {release}.",
        known.species,
        short(known.temperature_k),
        short(known.phase_ms),
        short(known.traps),
        known.density_error_percent,
        short(results.operating_k),
    )
}

/// Why a species is not found. None if it is, or was not searched.
fn not_found(results: &Results, species: &SpeciesState) -> Option<String> {
    if results.known.iter().any(|known| known.species == species.name) {
        return None;
    }
    if species.density_per_px <= 0.0 {
        return Some(format!("{} has no traps at the end of the mission.", species.name));
    }
    let own = results.dipoles.iter().filter(|dipole| dipole.species == species.name);
    let best = own.max_by(|a, b| a.snr.total_cmp(&b.snr))?;
    Some(format!(
        "{} is not detected. Its best dipole is {} e- at {} K with phases of {} ms and {} cycles, {:.1} sigma of the flat's noise; \
         its release time there is {} ms.",
        species.name,
        short(best.dipole_e),
        short(best.temperature_k),
        short(best.phase_ms),
        best.cycles,
        best.snr,
        short(best.release_ms)
    ))
}

fn earned(report: &mut StudyReport, results: &Results, before: Estimate, after: Estimate) {
    for (key, factor) in [("factor_before", before), ("factor_after", after)] {
        report.result(key, factor.value);
        report.result(&format!("{key}_error"), factor.error);
    }
    report.find(format!(
        "With every density and release time known to {} %, the correction achieves a factor {}. With what pumping measures it \
         achieves {}. The well fill power counts as known; `study correction` includes its error and noise.",
        100.0 * results.options.known_to,
        plus_minus(before),
        plus_minus(after)
    ));
}
