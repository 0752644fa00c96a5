//! `ctiplan compare`.

mod figures;

use serde_json::{Value, json};

use super::{Page, Parts, Report, crossing_json, or_dash, table, toml_json};
use crate::calendar::date_after;
use crate::mission::Mission;
use crate::plot::Figure;
use crate::requirement::Crossing;
use crate::scenario::{Comparison, Scenario};
use crate::sources::{self, Source};

impl Report for Comparison {
    fn text(&self) -> String {
        self.parts().text()
    }

    fn json(&self) -> Value {
        let scenarios: Vec<Value> = self
            .scenarios
            .iter()
            .map(|scenario| {
                let settings: serde_json::Map<String, Value> =
                    scenario.settings.iter().map(|(key, value)| (key.clone(), toml_json(value))).collect();
                let verdict = &scenario.verdict;
                let requirement = &scenario.mission.requirement;
                json!({
                    "mission": scenario.mission.mission.name,
                    "settings": settings,
                    "dose_mev_g": scenario.dose_mev_g,
                    "active_yr": scenario.active_yr,
                    "delta_e": scenario.delta_e,
                    "uncorrected": crossing_json(&verdict.uncorrected, None, date(scenario, &verdict.uncorrected)),
                    "corrected": crossing_json(
                        &verdict.corrected, Some(requirement.correction_factor), date(scenario, &verdict.corrected)),
                    "rate_at_launch_per_yr": verdict.rate_at_launch_per_yr,
                    "mean_rate_per_yr": verdict.mean_rate_per_yr,
                })
            })
            .collect();
        json!({"scenarios": scenarios, "best": self.best, "worst": self.worst, "why": self.why})
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
            ]
            .map(str::to_string),
        );
        let mut rows = vec![header];
        for scenario in &self.scenarios {
            let number = |value: Option<f64>| value.map_or(String::new(), |value| value.to_string());
            let mut row = vec![scenario.mission.mission.name.clone()];
            row.extend(scenario.settings.iter().map(|(_, value)| setting(value)));
            row.extend([scenario.dose_mev_g.to_string(), scenario.active_yr.to_string(), number(scenario.delta_e)]);
            for crossing in [&scenario.verdict.uncorrected, &scenario.verdict.corrected] {
                row.push(number(crossing.t_yr));
                row.push(date(scenario, crossing).map_or(String::new(), |date| date.to_string()));
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
        let mut header: Vec<String> = if several { vec!["mission".into()] } else { Vec::new() };
        header.extend(self.scenarios[0].settings.iter().map(|(key, _)| short(key).to_string()));
        if header.is_empty() {
            header.push("mission".into());
        }
        header.extend(["dose [MeV/g]", "|delta e|", "exceeded", "corrected", ""].map(str::to_string));
        let mut comparison = table(&header.iter().map(String::as_str).collect::<Vec<_>>());
        for (index, scenario) in self.scenarios.iter().enumerate() {
            let mut row = Vec::new();
            if several || scenario.settings.is_empty() {
                row.push(scenario.mission.mission.name.clone());
            }
            row.extend(scenario.settings.iter().map(|(_, value)| setting(value)));
            row.push(format!("{:.3e}", scenario.dose_mev_g));
            row.push(scenario.delta_e.map_or("lost".into(), |delta_e| format!("{delta_e:.3e}")));
            row.push(when(scenario, &scenario.verdict.uncorrected));
            row.push(when(scenario, &scenario.verdict.corrected));
            row.push(
                if index == self.best {
                    "best"
                } else if index == self.worst {
                    "worst"
                } else {
                    ""
                }
                .into(),
            );
            comparison.add_row(row);
        }
        let first = &self.scenarios[0].mission;
        let title = if several || self.scenarios[0].settings.is_empty() {
            "Missions side by side".to_string()
        } else {
            first.mission.name.clone()
        };
        let alike = |value: fn(&Scenario) -> String| {
            self.scenarios.iter().all(|scenario| value(scenario) == value(&self.scenarios[0]))
        };
        let requirement = &first.requirement;
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
        let mut out = Parts::default();
        out.title(title, format!("|delta e| of {galaxy} at the end of the mission, and when it exceeds {budget}"));
        out.gap();
        out.table(comparison);
        out.gap();
        out.verdict(self.conclusion(), 2);
        for reason in &self.why {
            out.verdict(format!("  - {reason}"), 4);
        }
        out
    }

    fn figures(&self) -> Vec<(String, Figure)> {
        self.drawn()
    }

    fn sources(&self, _: &[Mission]) -> Vec<Source> {
        sources::once(self.scenarios.iter().flat_map(|scenario| sources::of(&scenario.mission)))
    }
}

impl Comparison {
    fn several_missions(&self) -> bool {
        self.scenarios.iter().any(|scenario| scenario.mission.mission.name != self.scenarios[0].mission.mission.name)
    }

    fn conclusion(&self) -> String {
        let (best, worst) = (&self.scenarios[self.best], &self.scenarios[self.worst]);
        let several = self.several_missions();
        match (best.delta_e, worst.delta_e) {
            (Some(least), Some(most)) if least >= most => "All are alike.".into(),
            (Some(0.0), Some(most)) => {
                format!(
                    "Best: {}, without any change of shape, against {most:.3e} of the worst, {}, because",
                    name(best, several),
                    name(worst, several)
                )
            }
            (Some(least), Some(most)) => format!(
                "Best: {}, with {:.3} of the change of the worst, {}, because",
                name(best, several),
                least / most,
                name(worst, several)
            ),
            _ => format!("Best: {}; worst: {}, because", name(best, several), name(worst, several)),
        }
    }
}

/// What tells a scenario apart, in words.
fn name(scenario: &Scenario, several_missions: bool) -> String {
    let mission = format!("\"{}\"", scenario.mission.mission.name);
    if scenario.settings.is_empty() {
        return mission;
    }
    let settings: Vec<String> =
        scenario.settings.iter().map(|(key, value)| format!("{} = {}", short(key), setting(value))).collect();
    let settings = settings.join(", ");
    if several_missions { format!("{mission} with {settings}") } else { settings }
}

/// The key without the section that holds it.
fn short(key: &str) -> &str {
    key.split_once('.').map_or(key, |(_, name)| name)
}

fn setting(value: &toml::Value) -> String {
    match value {
        // Six digits tell values of any sensible list apart.
        toml::Value::Float(number) => {
            let rounded: f64 = format!("{number:.5e}").parse().expect("a number that was printed");
            crate::mission::keys::plain(rounded)
        }
        toml::Value::String(word) => word.clone(),
        other => other.to_string(),
    }
}

fn date(scenario: &Scenario, crossing: &Crossing) -> Option<chrono::NaiveDate> {
    date_after(scenario.mission.mission.launch.0, crossing.t_yr?)
}

fn when(scenario: &Scenario, crossing: &Crossing) -> String {
    or_dash(crossing.t_yr.map(|t_yr| match date(scenario, crossing) {
        Some(date) => format!("{date}"),
        None => format!("{t_yr:.2} yr"),
    }))
}
