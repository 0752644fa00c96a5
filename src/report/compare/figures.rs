//! |Δe| at the end of the mission, and when the budget is exceeded, against the setting with most values.

use super::{setting, short};
use crate::mission::Date;
use crate::mission::keys::plain;
use crate::numeric::calendar::decimal_year;
use crate::plan::scenario::{Comparison, Scenario};
use crate::report::plot::label::{counts, label};
use crate::report::plot::{Figure, Panel, Series, level, line, points};

/// Maximum number of groups of scenarios, one for each colour; further ones are not drawn.
const COLOURS: usize = 6;

/// Scenarios that differ only in the quantity on the x axis, and their x values.
struct Group<'a> {
    name: String,
    x: Vec<f64>,
    scenarios: Vec<&'a Scenario>,
}

impl Comparison {
    /// Figures with the names of their files.
    pub(super) fn drawn(&self) -> Vec<(String, Figure)> {
        let along = self.along();
        let groups = self.groups(along);
        let x_label = along.map_or("row of the table", |index| short(&self.scenarios[0].settings[index].0));
        let x_log = wide(groups.iter().flat_map(|group| &group.x));
        let panel = |y_label: &str, y_log, series| Panel {
            x_label: label(x_label),
            y_label: y_label.into(),
            x_log,
            y_log,
            x_counts: along.is_none() || counts(x_label),
            series,
            ..Panel::default()
        };
        let draw = |value: &dyn Fn(&Scenario) -> Option<f64>| -> Vec<Series> {
            groups
                .iter()
                .enumerate()
                .take(COLOURS)
                .flat_map(|(index, group)| group.drawn(index + 1, along, value))
                .collect()
        };
        let delta_e: Vec<f64> = self.scenarios.iter().filter_map(|scenario| scenario.delta_e).collect();
        let mut at_the_end = draw(&|scenario| scenario.delta_e);
        let budget = |scenario: &Scenario| scenario.mission.requirement.delta_e;
        let first = budget(&self.scenarios[0]);
        let limited = self.scenarios[0].mission.requirement.limits_a_galaxy();
        if limited && self.scenarios.iter().all(|scenario| budget(scenario) == first) {
            at_the_end.push(level(&format!("budget {}", plain(first)), first));
        }
        let mut panels = vec![panel("|Δe| at the end", wide(&delta_e), at_the_end)];
        for (corrected, y_label) in ["exceeded after [yr]", "after correction [yr]"].into_iter().enumerate() {
            if self.is_exceeded(corrected) {
                panels.push(panel(y_label, false, draw(&|scenario| scenario.judgement.kept_yr(None)[corrected])));
            }
        }
        let left_out = groups.len().saturating_sub(COLOURS);
        let not_drawn = if left_out > 0 { format!(" ({left_out} groups more are not drawn)") } else { String::new() };
        let sun = self.notes.first().map_or(String::new(), |_| format!("; dose: {}", self.dose_models()));
        let against = label(x_label).split(" [").next().unwrap_or_default().to_string();
        let title = format!("Change of ellipticity, and when it exceeds the budget, against {against}{not_drawn}{sun}");
        vec![("compare.svg".into(), Figure { title, panels })]
    }

    /// The dose models, without repetition.
    fn dose_models(&self) -> String {
        let mut models: Vec<&str> = self.scenarios.iter().map(Scenario::dose_model).collect();
        models.sort_unstable();
        models.dedup();
        models.join(", ")
    }

    /// The setting with most values, if it is a number or a date.
    fn along(&self) -> Option<usize> {
        let settings = 0..self.scenarios[0].settings.len();
        let values = |index: usize| -> Option<usize> {
            let mut values: Vec<f64> =
                self.scenarios.iter().map(|scenario| number(&scenario.settings[index].1)).collect::<Option<_>>()?;
            values.sort_by(f64::total_cmp);
            values.dedup();
            (values.len() > 1).then_some(values.len())
        };
        settings
            .filter_map(|index| Some((values(index)?, index)))
            .max_by_key(|(values, _)| *values)
            .map(|(_, index)| index)
    }

    /// Scenarios equal in all but the quantity on the x axis, from left to right; without one, all of them in their order.
    fn groups(&self, along: Option<usize>) -> Vec<Group<'_>> {
        let several = self.several_missions();
        let mut groups: Vec<Group> = Vec::new();
        for (row, scenario) in self.scenarios.iter().enumerate() {
            let (x, name) = match along {
                None => ((row + 1) as f64, String::new()),
                Some(along) => {
                    let mut said = if several { vec![scenario.name.clone()] } else { Vec::new() };
                    let others = scenario.settings.iter().enumerate().filter(|(index, _)| *index != along);
                    said.extend(others.map(|(_, (key, value))| format!("{} = {}", short(key), setting(value))));
                    (number(&scenario.settings[along].1).expect("a number, as those of all scenarios"), said.join(", "))
                }
            };
            let group = match groups.iter().position(|group| group.name == name) {
                Some(known) => &mut groups[known],
                None => {
                    groups.push(Group { name, x: Vec::new(), scenarios: Vec::new() });
                    groups.last_mut().expect("just made")
                }
            };
            let place = group.x.partition_point(|other| *other <= x);
            group.x.insert(place, x);
            group.scenarios.insert(place, scenario);
        }
        groups
    }
}

impl Group<'_> {
    /// A value of the scenarios as points, joined if there is a quantity on the x axis.
    fn drawn(&self, color: usize, along: Option<usize>, value: &dyn Fn(&Scenario) -> Option<f64>) -> Vec<Series> {
        let y: Vec<f64> = self.scenarios.iter().map(|scenario| value(scenario).unwrap_or(f64::NAN)).collect();
        let mut series = vec![points(&self.name, color, &self.x, y.clone())];
        if along.is_some() {
            series.push(line(&self.name, color, &self.x, y));
        }
        series
    }
}

/// Whether values need a logarithmic axis.
fn wide<'a>(values: impl IntoIterator<Item = &'a f64>) -> bool {
    let ends = |(low, high): (f64, f64), value: &f64| (low.min(*value), high.max(*value));
    let (low, high) = values.into_iter().fold((f64::INFINITY, 0.0), ends);
    low > 0.0 && high > 15.0 * low
}

/// A number, or a date as a decimal year.
fn number(value: &toml::Value) -> Option<f64> {
    match value {
        toml::Value::Float(number) => Some(*number),
        toml::Value::Integer(number) => Some(*number as f64),
        toml::Value::Datetime(date) => Date::try_from(*date).ok().map(|date| decimal_year(date.0)),
        _ => None,
    }
}
