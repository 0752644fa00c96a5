//! `ctiplan compare`.

mod cause;
mod figures;

use chrono::NaiveDate;
use comfy_table::Table;

use super::study::estimate::plus_minus;
use super::{Page, Parts, Report, keep_words, or_dash, table};
use crate::mission::Mission;
use crate::numeric::calendar::{DAYS_PER_YEAR, date_after};
use crate::numeric::estimate::Estimate;
use crate::plan::judgement::{Budget, Limited};
use crate::plan::scenario::{Comparison, Criterion, Ranking, Scenario};
use crate::plan::sources::{self, Source};
use crate::report::plot::Figure;
use crate::report::ranked::{by_others, named};

impl Report for Comparison {
    fn text(&self) -> String {
        self.parts().text()
    }

    fn csv(&self) -> Vec<Vec<String>> {
        let mut header = vec!["mission".to_string()];
        header.extend(self.scenarios[0].settings.iter().map(|(key, _)| key.clone()));
        header.extend(
            [
                "dose_mev_g",
                "active_yr",
                "delta_e",
                "exceeded_t_yr",
                "exceeded_date",
                "corrected_t_yr",
                "corrected_date",
                "dose_model",
                "file",
            ]
            .map(str::to_string),
        );
        if self.confidence.is_some() {
            header.extend(["kept_t_yr", "corrected_kept_t_yr", "probability_met"].map(str::to_string));
        }
        let together = self.limits_biases();
        if together {
            header.extend(
                ["exceeded_first_t_yr", "exceeded_by", "corrected_first_t_yr", "corrected_by"].map(str::to_string),
            );
            header.extend(BUDGETS.into_iter().flat_map(Limited::keys));
        }
        let mut rows = vec![header];
        for scenario in &self.scenarios {
            let number = |value: Option<f64>| value.map_or(String::new(), |value| value.to_string());
            let mut row = vec![scenario.mission.mission.name.clone()];
            row.extend(scenario.settings.iter().map(|(_, value)| setting(value)));
            row.extend([scenario.dose_mev_g.to_string(), scenario.active_yr.to_string(), number(scenario.delta_e)]);
            for crossing in [&scenario.verdict.uncorrected, &scenario.verdict.corrected] {
                row.push(number(crossing.t_yr));
                row.push(
                    crossing.date(scenario.mission.mission.launch.0).map_or(String::new(), |date| date.to_string()),
                );
            }
            row.extend([scenario.dose_model().to_string(), scenario.file.clone()]);
            let judgement = &scenario.judgement;
            if let Some(found) = &judgement.distribution {
                row.extend(judgement.kept_yr(self.confidence).map(number));
                row.push(found.probability_met().to_string());
            }
            if together {
                for first in judgement.first() {
                    row.push(number(first.map(|first| first.1)));
                    row.push(first.map_or(String::new(), |first| first.0.key().into()));
                }
                for limited in BUDGETS {
                    let budget = judgement.budgets.iter().find(|budget| budget.limited == limited);
                    row.push(number(budget.and_then(Budget::at_end)));
                    row.extend([0, 1].map(|limit| number(budget.and_then(|budget| budget.crossings[limit].t_yr))));
                }
            }
            rows.push(row);
        }
        rows
    }
}

impl Page for Comparison {
    fn command(&self) -> String {
        "compare".into()
    }

    fn parts(&self) -> Parts {
        let several = self.several_missions();
        let first = &self.scenarios[0].mission;
        let title = if several { "Missions side by side".to_string() } else { first.mission.name.clone() };
        let alike = |value: fn(&Scenario) -> String| {
            self.scenarios.iter().all(|scenario| value(scenario) == value(&self.scenarios[0]))
        };
        let requirement = &first.requirement;
        let biases = biases_in_words(self);
        let galaxy = if alike(|scenario| scenario.mission.requirement.galaxy.clone()) {
            format!("\"{}\"", requirement.galaxy)
        } else {
            "the judged galaxy".into()
        };
        let budget = if alike(|scenario| {
            format!("{} {}", scenario.mission.requirement.delta_e, scenario.mission.requirement.correction_factor)
        }) {
            format!(
                "{}, uncorrected and corrected by a factor {}",
                crate::mission::keys::plain(requirement.delta_e),
                requirement.correction_factor
            )
        } else {
            "the mission's budget, uncorrected and corrected".into()
        };
        let exceeds =
            if self.limits_biases() { "a budget is exceeded".to_string() } else { format!("it exceeds {budget}") };
        let mut out = Parts::default();
        out.title(title, format!("|delta e| of {galaxy}{biases} at the end of the mission, and when {exceeds}"));
        out.gap();
        if self.confidence.is_some() && self.limits_biases() {
            // All columns together are too wide for a terminal.
            out.table(self.table(true, false));
            out.gap();
            out.table(self.table(false, true));
        } else {
            out.table(self.table(true, true));
        }
        out.gap();
        if self.limits_biases() {
            out.words("exceeded, corrected: the first of all budgets, and which one it is.", 2);
        }
        for note in &self.notes {
            out.verdict(note, 2);
        }
        out.verdict(self.conclusion(), 2);
        for reason in &self.why {
            out.verdict(format!("  - {reason}"), 4);
        }
        for other in by_others(&self.ranking, self.confidence, |place| self.said(place)) {
            out.verdict(other, 2);
        }
        out.warnings(&self.warnings);
        out
    }

    fn figures(&self) -> Vec<(String, Figure)> {
        self.drawn()
    }

    fn names(&self, _: &[Mission]) -> Vec<String> {
        self.names.clone()
    }

    fn sources(&self, _: &[Mission]) -> Vec<Source> {
        sources::once(self.scenarios.iter().flat_map(|scenario| sources::of(&scenario.mission)))
    }
}

/// Quantities that budgets limit.
const BUDGETS: [Limited; 3] = [Limited::DeltaE, Limited::C, Limited::M];

impl Comparison {
    fn several_missions(&self) -> bool {
        self.names.len() > 1
    }

    /// Scenarios with their expected values, and with the dates and probabilities from draws if a confidence is requested.
    fn table(&self, expected: bool, drawn: bool) -> Table {
        let several = self.several_missions();
        let mut header: Vec<String> = if several { vec!["mission".into()] } else { Vec::new() };
        header.extend(self.scenarios[0].settings.iter().map(|(key, _)| short(key).to_string()));
        if expected {
            header.extend(["dose [MeV/g]".into(), "|delta e|".into()]);
            header.extend(self.limited_biases().map(|one| one.symbol().to_string()));
            header.extend(["exceeded".into(), "corrected".into()]);
        }
        if let Some(confidence) = self.confidence.filter(|_| drawn) {
            let percent = format!("{:.0} %", 100.0 * confidence);
            header.extend([format!("met until ({percent})"), format!("corrected ({percent})")]);
            header.push("corrected met [%]".into());
        }
        header.push(String::new());
        let mut comparison = table(&header.iter().map(String::as_str).collect::<Vec<_>>());
        for (index, scenario) in self.scenarios.iter().enumerate() {
            let mut row: Vec<String> = if several { vec![scenario.name.clone()] } else { Vec::new() };
            row.extend(scenario.settings.iter().map(|(_, value)| setting(value)));
            if expected {
                row.push(format!("{:.3e}", scenario.dose_mev_g));
                row.push(scenario.delta_e.map_or("lost".into(), |delta_e| format!("{delta_e:.3e}")));
                row.extend(self.limited_biases().map(|one| at_end(scenario, one)));
                row.extend(scenario.judgement.first().map(|first| when(scenario, first)));
            }
            if drawn {
                row.extend(self.kept(scenario));
            }
            row.push(self.mark(index).into());
            comparison.add_row(row);
        }
        keep_words(&mut comparison, usize::from(several));
        comparison
    }

    /// Shear biases that any scenario limits.
    fn limited_biases(&self) -> impl Iterator<Item = Limited> {
        BUDGETS.into_iter().filter(|one| *one != Limited::DeltaE && self.limits(*one))
    }

    /// Dates until which a scenario meets its budgets with the requested confidence, and the probability that it meets the
    /// corrected one until the end, %; empty if none is requested.
    fn kept(&self, scenario: &Scenario) -> Vec<String> {
        let Some(found) = &scenario.judgement.distribution else { return Vec::new() };
        let launch = scenario.mission.mission.launch.0;
        let date = |t_yr: Option<f64>| or_dash(t_yr.map(|t_yr| dated(launch, t_yr)));
        let met = Estimate { value: found.probability_met(), error: found.requirement()[1].probability_error };
        let mut cells: Vec<String> = scenario.judgement.kept_yr(self.confidence).into_iter().map(date).collect();
        cells.push(plus_minus(met.times(100.0)));
        cells
    }

    /// Whether any scenario exceeds a budget, without or with correction.
    fn is_exceeded(&self, corrected: usize) -> bool {
        self.scenarios.iter().any(|scenario| scenario.judgement.kept_yr(None)[corrected].is_some())
    }

    /// Whether any scenario limits it.
    fn limits(&self, limited: Limited) -> bool {
        self.scenarios.iter().any(|scenario| Limited::by(&scenario.mission).contains(&limited))
    }

    /// Whether any scenario limits shear biases.
    fn limits_biases(&self) -> bool {
        self.scenarios.iter().any(|scenario| scenario.judgement.limits_biases())
    }

    fn mark(&self, index: usize) -> &str {
        match &self.ranking {
            Ranking { by: None, .. } => "",
            Ranking { best, .. } if best.contains(&index) => "best",
            Ranking { worst, .. } if worst.contains(&index) => "worst",
            _ => "",
        }
    }

    /// A scenario in words.
    fn said(&self, place: usize) -> String {
        name(&self.scenarios[place], self.several_missions())
    }

    fn conclusion(&self) -> String {
        let Some(by) = self.ranking.by else { return "All are alike.".into() };
        let of = |places: &[usize]| {
            let lasts = |limit: &str, kept_yr: Option<f64>| match (kept_yr, self.confidence) {
                (Some(t_yr), None) => format!(", which exceeds the {limit} budget after {t_yr:.2} yr"),
                (None, None) => format!(", which does not exceed the {limit} budget"),
                (Some(t_yr), Some(p)) => {
                    format!(
                        ", which meets the {limit} budget for {t_yr:.2} yr with a probability of {:.0} %",
                        100.0 * p
                    )
                }
                (None, Some(p)) => {
                    format!(", which meets the {limit} budget to the end with a probability of {:.0} %", 100.0 * p)
                }
            };
            let [uncorrected_yr, corrected_yr] = self.scenarios[places[0]].judgement.kept_yr(self.confidence);
            let fate = match by {
                Criterion::Uncorrected => lasts("uncorrected", uncorrected_yr),
                Criterion::Corrected => lasts("corrected", corrected_yr),
                Criterion::Used => {
                    let used = self.scenarios[places[0]].judgement.used();
                    used.map_or(String::new(), |used| {
                        format!(", which uses {:.1} % of a budget at the end", 100.0 * used)
                    })
                }
                Criterion::End => String::new(),
            };
            format!("{}{fate}", self.said(places[0]))
        };
        let tied = |places: &[usize], word: &str| match &places[1..] {
            [] => of(places),
            others => format!("{} (equally {word}: {})", of(places), named(others, |place| self.said(place))),
        };
        let sides = format!("Best: {}. Worst: {}.", tied(&self.ranking.best, "good"), tied(&self.ranking.worst, "bad"));
        let when = match by {
            Criterion::Used | Criterion::End => "At the end of the mission".into(),
            _ if self.compared_at_yr[1] < 0.1 => format!("After {:.1} d", DAYS_PER_YEAR * self.compared_at_yr[1]),
            _ => format!("After {:.2} yr", self.compared_at_yr[1]),
        };
        let how = match self.ratio {
            Some(0.0) => "no change of shape".into(),
            Some(ratio) if ratio < 1e-3 => format!("{ratio:.1e} of the |delta e| of the worst"),
            Some(ratio) => format!("{ratio:.3} of the |delta e| of the worst"),
            None => "the smaller |delta e|".into(),
        };
        let because = if self.why.is_empty() { "." } else { ", because" };
        format!("{sides} {when} the best has {how}{because}")
    }
}

/// A label that distinguishes a scenario.
fn name(scenario: &Scenario, several_missions: bool) -> String {
    let settings: Vec<String> =
        scenario.settings.iter().map(|(key, value)| format!("{} = {}", short(key), setting(value))).collect();
    let settings = settings.join(", ");
    match (several_missions, settings.is_empty()) {
        (true, false) => format!("\"{}\" with {settings}", scenario.name),
        (true, true) => format!("\"{}\"", scenario.name),
        (false, _) => settings,
    }
}

/// The key without its section.
fn short(key: &str) -> &str {
    key.split_once('.').map_or(key, |(_, name)| name)
}

fn setting(value: &toml::Value) -> String {
    match value {
        // Six digits distinguish the values in any reasonable list.
        toml::Value::Float(number) => {
            let rounded: f64 = format!("{number:.5e}").parse().expect("a number that was printed");
            crate::mission::keys::plain(rounded)
        }
        toml::Value::String(word) => word.clone(),
        other => other.to_string(),
    }
}

/// The day and the years after launch at which the first budget is exceeded, and the budget if there are several: dates for
/// different launches do not show which mission lasts longer.
fn when(scenario: &Scenario, first: Option<(Limited, f64)>) -> String {
    let several = scenario.judgement.limits_biases();
    or_dash(first.map(|(limited, t_yr)| {
        let date = dated(scenario.mission.mission.launch.0, t_yr);
        if several { format!("{date} {}", limited.symbol()) } else { date }
    }))
}

/// A shear bias at the end of the mission, if it is limited.
fn at_end(scenario: &Scenario, limited: Limited) -> String {
    let budget = scenario.judgement.budgets.iter().find(|budget| budget.limited == limited);
    or_dash(budget.and_then(Budget::at_end).map(|value| format!("{value:.2e}")))
}

/// The shear biases shown, in words.
fn biases_in_words(comparison: &Comparison) -> &'static str {
    if comparison.limits_biases() { " and shear biases" } else { "" }
}

fn dated(launch: NaiveDate, t_yr: f64) -> String {
    match date_after(launch, t_yr) {
        // A narrow column breaks between the two, not before the unit.
        Some(date) => format!("{date} {t_yr:.2}\u{a0}yr"),
        None => format!("{t_yr:.2} yr"),
    }
}
