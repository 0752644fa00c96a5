//! `ctiplan study`: results of a study → tables, figures and findings.
//!
//! Each study has a file here that selects the numbers shown and their format.

mod calibration;
mod charge_injection;
mod clock;
mod correction;
mod distance;
mod error_budget;
pub(super) mod estimate;
mod judged;
mod launch;
mod pocket_pumping;
mod preflash;
mod requirement;
mod shielding;
mod table;

use chrono::NaiveDate;
use serde::ser::{Serialize, Serializer};
use serde_json::{Map, Value, json};

use super::{Page, Parts, Report, listed, significant};
use crate::mission::Mission;
use crate::plan::judgement::Limited;
use crate::plan::sources::{self, Source};
use crate::report::plot::{Figure, Series, level};
use crate::warning::Warning;

pub use table::{Column, DataTable, Digits};

/// Results of a study, with their report.
pub trait Shown {
    /// Tables, figures and findings, for the studied mission.
    fn shown(&self, mission: &Mission) -> StudyReport;
}

/// The report of a study.
#[derive(Clone, Debug)]
pub struct StudyReport {
    /// Name of the study, as on the command line.
    pub name: &'static str,
    /// Name of the mission.
    pub mission: String,
    /// Subject of the study, in a sentence.
    pub title: String,
    /// Tables; the first is used for CSV.
    pub tables: Vec<DataTable>,
    /// Single numbers, with names that end in their unit.
    pub results: Map<String, Value>,
    /// Conclusions, in sentences.
    pub findings: Vec<String>,
    /// Warnings.
    pub warnings: Vec<Warning>,
    /// Figures with their file names.
    pub figures: Vec<(String, Figure)>,
    /// Sources of the study's own models.
    pub sources: Vec<Source>,
}

impl StudyReport {
    /// An empty report.
    fn of(name: &'static str, mission: &Mission, title: String, warnings: &[Warning]) -> StudyReport {
        StudyReport {
            name,
            mission: mission.mission.name.clone(),
            title,
            tables: Vec::new(),
            results: Map::new(),
            findings: Vec::new(),
            warnings: warnings.to_vec(),
            figures: Vec::new(),
            sources: Vec::new(),
        }
    }

    /// Adds a number to the results.
    fn result(&mut self, key: &str, value: impl Into<Value>) {
        self.results.insert(key.into(), value.into());
    }

    /// Adds a source of a model.
    fn cite(&mut self, model: &str, from: &str) {
        self.sources.push(Source::new(model, from));
    }

    /// Adds a sentence to the findings.
    fn find(&mut self, words: impl Into<String>) {
        self.findings.push(words.into());
    }

    /// States that the study considers one galaxy, if the requirement also limits shear biases.
    fn of_galaxy_alone(&mut self, mission: &Mission) {
        let biases: Vec<&str> =
            Limited::by(mission).into_iter().filter(|one| *one != Limited::DeltaE).map(Limited::symbol).collect();
        if !biases.is_empty() {
            self.find(format!(
                "This study looks at |delta e| of the galaxy alone: the limits on {} of the population are judged by `ctiplan \
                 evaluate`, `compare` and the studies `launch`, `clock` and `shielding`.",
                listed(&biases)
            ));
        }
    }

    /// Adds a figure under the study's name.
    fn draw(&mut self, figure: Figure) {
        self.figures.push((format!("{}.svg", self.name), figure));
    }
}

impl Serialize for StudyReport {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        let tables: Map<String, Value> =
            self.tables.iter().map(|table| (table.name.to_string(), table.json())).collect();
        let document = json!({
            "study": self.name,
            "mission": self.mission,
            "results": self.results,
            "tables": tables,
            "findings": self.findings,
            "warnings": self.warnings,
        });
        document.serialize(to)
    }
}

impl Report for StudyReport {
    fn text(&self) -> String {
        self.parts().text()
    }

    fn csv(&self) -> Vec<Vec<String>> {
        self.tables[0].csv()
    }
}

impl Page for StudyReport {
    fn command(&self) -> String {
        format!("study {}", self.name)
    }

    fn parts(&self) -> Parts {
        let mut out = Parts::default();
        out.title(&self.mission, &self.title);
        for table in self.tables.iter().filter(|table| !table.rows.is_empty() && !table.programs_only) {
            out.gap();
            if !table.title.is_empty() {
                out.words(&table.title, 2);
            }
            out.table(table.text());
        }
        out.gap();
        for finding in &self.findings {
            out.verdict(format!("- {finding}"), 2);
        }
        out.warnings(&self.warnings);
        out
    }

    fn figures(&self) -> Vec<(String, Figure)> {
        self.figures.clone()
    }

    fn sources(&self, missions: &[Mission]) -> Vec<Source> {
        sources::once(missions.iter().flat_map(sources::of).chain(self.sources.iter().cloned()))
    }
}

/// A number with four digits, in common notation.
fn short(number: f64) -> String {
    significant(number, 4)
}

/// The limit on |Δe| of the judged galaxy for a figure, if there is one.
fn budget(mission: &Mission) -> Option<Series> {
    let requirement = &mission.requirement;
    requirement.limits_a_galaxy().then(|| level("budget", requirement.delta_e))
}

/// When the budget is exceeded, in words.
fn when(date: Option<NaiveDate>) -> String {
    date.map_or("not exceeded".into(), |date| format!("exceeded on {date}"))
}

/// Contributions to S/N and area that are neglected because the mission lacks them, in sentences.
fn left_out(mission: &Mission) -> impl Iterator<Item = String> {
    let noise = mission.readout.noise.is_none().then(|| {
        let read_noise_e = short(mission.judged_galaxy().read_noise_e);
        format!("The mission has no [readout.noise]: S/N is with the galaxy's read noise, {read_noise_e} e-.")
    });
    let survey =
        mission.survey.is_none().then(|| "The mission has no [survey]: area counts exposure time alone.".into());
    noise.into_iter().chain(survey)
}
