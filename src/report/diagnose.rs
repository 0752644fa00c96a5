//! `ctiplan diagnose`.

mod figures;
mod json;
mod ranking;
mod reason;

use super::fit::value_and_error;
use super::{Page, Parts, Report, chance, effects_listed, keep_joined, noise, or_dash, significant, table};
use crate::analysis::diagnose::{Changed, Diagnosis, Next, Reason, Rung, Stability, Tried, Verdict};
use crate::analysis::fit::Fitted;
use crate::analysis::noise::SetNoise;
use crate::analysis::validate::SetResult;
use crate::mission::Mission;
use crate::numeric::calendar::date_after;
use crate::plan::sources::{self, Source};
use crate::report::plot::Figure;

/// Increase of chi2 above which an effect whose strength cannot be lower is ruled out: three standard errors.
const RULED_OUT: f64 = 9.0;

/// Number of tried effects that are listed.
const LISTED: usize = 8;

impl Report for Diagnosis {
    fn text(&self) -> String {
        self.parts().text()
    }

    fn csv(&self) -> Vec<Vec<String>> {
        let header = [
            "model",
            "parameter",
            "unit",
            "value",
            "sigma",
            "chi2",
            "n",
            "free",
            "rms_sigma",
            "holdout_rms_sigma",
            "false_alarm",
            "uncorrected_t_yr",
            "corrected_t_yr",
        ];
        let mut records = vec![header.map(str::to_string).to_vec()];
        let mut record = |model: &str, rung: &Rung, alarm: Option<f64>| {
            let number = |value: Option<f64>| value.map_or(String::new(), |value| value.to_string());
            let none = [None];
            let each: Vec<Option<&Fitted>> =
                if rung.parameters.is_empty() { none.to_vec() } else { rung.parameters.iter().map(Some).collect() };
            for fitted in each {
                let budget = rung.budget.as_ref();
                records.push(vec![
                    model.to_string(),
                    fitted.map_or(String::new(), |fitted| fitted.key.clone()),
                    fitted.map_or(String::new(), |fitted| fitted.unit.to_string()),
                    number(fitted.map(|fitted| fitted.value)),
                    number(fitted.and_then(|fitted| fitted.sigma)),
                    rung.chi2.to_string(),
                    rung.n.to_string(),
                    rung.free.to_string(),
                    rung.rms_sigma().to_string(),
                    number(rung.holdout_rms_sigma),
                    number(alarm),
                    number(budget.and_then(|budget| budget.uncorrected.t_yr)),
                    number(budget.and_then(|budget| budget.corrected.t_yr)),
                ]);
            }
        };
        record("as given", &self.baseline, None);
        for step in &self.steps {
            record(&step.effect, &step.rung, Some(step.false_alarm));
        }
        records
    }
}

impl Page for Diagnosis {
    fn command(&self) -> String {
        "diagnose".into()
    }

    fn parts(&self) -> Parts {
        let mut out = Parts::default();
        out.title(&self.mission.mission.name, "which effect is missing?");
        out.gap();
        let reason = sentence(&self.reason.to_string());
        out.verdict(format!("Verdict: {}. {reason}.{}", self.verdict.name(), self.reservations()), 2);
        self.bounds(&mut out);
        self.errors(&mut out);
        self.ladder(&mut out);
        if !self.steps.is_empty() {
            self.added(&mut out);
        }
        if !self.alternatives.is_empty() {
            out.heading("Effects that these data do not distinguish");
            let pedestals = matches!(self.reason, Reason::LackingOrPedestals { .. });
            for set in &self.alternatives {
                let or_pedestals = if pedestals { " or pedestals" } else { "" };
                out.words(format!("  {}{or_pedestals}", set.join(" or ")), 4);
            }
            if pedestals {
                out.words(
                    "A pedestal is the same in all rows of a file: measure at other conditions, into the same file.",
                    2,
                );
            }
            match &self.next {
                Some(next) => out.words(self.measure(next), 2),
                None if self.alternatives.iter().all(|set| set.len() < 2) => (),
                None => out.words("No measurement that was considered would distinguish the first two.", 2),
            }
        }
        if self.verdict == Verdict::Unexplained {
            self.left_over(&mut out);
        }
        self.formula(&mut out);
        if !self.limits.is_empty() {
            self.detection_limits(&mut out);
        }
        if let Some(ranking) = &self.ranking {
            ranking::say(ranking, &mut out);
        }
        if !self.tried.is_empty() {
            self.what_was_tried(&mut out);
        }
        self.stands(&mut out);
        for note in &self.notes {
            out.words(format!("Note: {note}."), 2);
        }
        out.warnings(self.before.warnings());
        out
    }

    fn figures(&self) -> Vec<(String, Figure)> {
        self.drawn()
    }

    /// Includes those of the added effects.
    fn sources(&self, _: &[Mission]) -> Vec<Source> {
        sources::of(&self.improved)
    }
}

/// With a capital letter, unless it is a file name.
fn sentence(text: &str) -> String {
    let mut letters = text.chars();
    match letters.next() {
        Some(first) if !text.contains(".ecsv:") && !text.contains(".csv:") => {
            first.to_uppercase().chain(letters).collect()
        }
        _ => text.to_string(),
    }
}

impl Changed {
    /// The result of the search.
    fn found(&self) -> String {
        let effects =
            if self.effects.is_empty() { String::new() } else { format!(", {}", effects_listed(&self.effects)) };
        format!("{}{effects}", self.verdict.name())
    }
}

impl Diagnosis {
    /// Bounds at which the search ended, beside the verdict that they limit.
    fn bounds(&self, out: &mut Parts) {
        if !self.undone.is_empty() {
            out.words(
                format!(
                    "Note: the search ended after {} evaluations of the model (it may begin steps up to {}); left undone: {}. \
                     --evaluations N allows more.",
                    self.evaluations[0],
                    self.evaluations[1],
                    self.undone.join(", ")
                ),
                2,
            );
        }
    }

    /// If they differ from the quoted ones.
    fn errors(&self, out: &mut Parts) {
        let of = |(noise, set): (&SetNoise, &SetResult)| noise::words(noise, set.data.observable.unit());
        for words in self.noise.iter().zip(&self.after.sets).filter_map(of) {
            out.words(words, 2);
        }
    }

    /// The conditions of the verdict, and incomplete tests, in sentences that follow it.
    fn reservations(&self) -> String {
        let fails = self.stability.done.iter().filter(|changed| !changed.holds);
        let fails: Vec<String> = fails.map(|changed| format!("with {}: {}", changed.change, changed.found())).collect();
        let unstable = if fails.is_empty() { String::new() } else { format!(" Not stable: {}.", fails.join("; ")) };
        // That reason already states that it is incomplete.
        let incomplete = !self.undone.is_empty() && !matches!(self.reason, Reason::Unexplained { .. });
        let undone = if incomplete { " The search is incomplete (see the note)." } else { "" };
        format!("{unstable}{undone}")
    }

    /// Other assumptions under which the verdict is the same.
    fn stands(&self, out: &mut Parts) {
        let (holds, fails): (Vec<&Changed>, Vec<&Changed>) =
            self.stability.done.iter().partition(|changed| changed.holds);
        if self.stability == Stability::default() {
            return;
        }
        out.heading("Stability of the verdict");
        let names = |changed: &[&Changed]| changed.iter().map(|one| one.change.as_str()).collect::<Vec<_>>().join(", ");
        if !holds.is_empty() {
            out.words(format!("  the same with: {}", names(&holds)), 4);
        }
        for changed in fails {
            out.words(format!("  with {}: {}", changed.change, changed.found()), 4);
        }
        if !self.stability.undone.is_empty() {
            let undone = self.stability.undone.join(", ");
            out.words(format!("  not tried within {} evaluations: {undone}", self.evaluations[1]), 4);
        }
    }

    fn ladder(&self, out: &mut Parts) {
        out.gap();
        let header = ["model", "chi2", "free", "rms [sigma]", "held out", "budget exceeded", "p-value"];
        let mut ladder = table(&header);
        let mut rung = |name: String, rung: &Rung, alarm: String| {
            ladder.add_row(vec![
                name,
                format!("{:.1}", rung.chi2),
                rung.free.to_string(),
                format!("{:.2}", rung.rms_sigma()),
                or_dash(rung.holdout_rms_sigma.map(|rms| format!("{rms:.2}"))),
                self.exceeded(rung),
                alarm,
            ]);
        };
        rung("as given".into(), &self.baseline, String::new());
        for step in &self.steps {
            rung(format!("+ {}", step.effect), &step.rung, chance(step.false_alarm));
        }
        keep_joined(&mut ladder, |text| text.replace("+ ", "+-").replace("below ", "below-"));
        out.table(ladder);
        let held_out = self.held_out.as_ref().map_or(String::new(), |(column, rows)| {
            format!(
                "; held out: rms of the {rows} rows that vary in {column}, left out of the fit group by group of it"
            )
        });
        out.words(
            format!(
                "  {} rows; free parameters are refitted in every row; errors are those that are likeliest for the last model, \
                 in all rows of this table; p-value: probability that noise alone does as well, corrected for all effects \
                 tried{held_out}",
                self.baseline.n
            ),
            4,
        );
    }

    /// The day on which the budget is exceeded.
    fn exceeded(&self, rung: &Rung) -> String {
        match rung.budget.as_ref().map(|budget| budget.uncorrected.t_yr) {
            None => "-".into(),
            Some(None) => "never".into(),
            Some(Some(t_yr)) => {
                let date = date_after(self.mission.mission.launch.0, t_yr);
                date.map_or_else(|| format!("{t_yr:.2} yr"), |date| date.to_string())
            }
        }
    }

    fn added(&self, out: &mut Parts) {
        out.heading("What to add to the mission file");
        out.gap();
        out.code(self.toml());
        let fitted: Vec<&Fitted> =
            self.steps.iter().flat_map(|step| &step.parameters).chain(&self.parameters).collect();
        if !fitted.is_empty() {
            out.gap();
            let mut values = table(&["fitted", "value", "error", "unit"]);
            for fitted in fitted {
                let (value, error) = value_and_error(fitted, &self.advice);
                values.add_row(vec![fitted.key.clone(), value, error, fitted.unit.into()]);
            }
            out.table(values);
        }
        if !self.advice.is_empty() {
            out.heading("Not determined by these data");
            for advice in &self.advice {
                out.words(format!("  - {advice}"), 4);
            }
        }
    }

    fn measure(&self, next: &Next) -> String {
        let mut conditions: Vec<String> =
            next.conditions.iter().map(|(name, value)| format!("{name} {}", significant(*value, 5))).collect();
        conditions.extend(next.galaxy.iter().map(|galaxy| format!("galaxy {galaxy}")));
        format!(
            "Measure next: {} at {}. There {} and {} differ by {:.1} sigma, for an error of {:.2e}{}.",
            next.observable,
            conditions.join(", "),
            next.separates[0],
            next.separates[1],
            next.apart_sigma,
            next.sigma,
            match next.observable.unit() {
                "" => String::new(),
                unit => format!(" {unit}"),
            }
        )
    }

    fn left_over(&self, out: &mut Parts) {
        out.heading("Remaining residual trends");
        if !self.covariates.is_empty() {
            let mut trends = table(&["condition", "p-value"]);
            for covariate in &self.covariates {
                trends.add_row(vec![covariate.name.clone(), chance(covariate.false_alarm)]);
            }
            out.table(trends);
        }
        for word in self.after.words() {
            out.words(word, 2);
        }
    }

    /// A formula instead of effects, or for what they leave.
    fn formula(&self, out: &mut Parts) {
        if let Some(suggestion) = &self.suggestion {
            out.gap();
            let [before, with] = suggestion.chi2;
            let what = if suggestion.is_law {
                format!(
                    "The formula lowers chi2 from {before:.1} to {with:.1}. It is a description and names no cause: check gain, linearity \
                     and data reduction first."
                )
            } else {
                let how = if suggestion.is_fitted { "" } else { ", without constant offsets of the files," };
                format!(
                    "An empirical formula to start from lowers chi2{how} from {before:.1} to {with:.1}. It describes the residuals \
                     and names no cause."
                )
            };
            out.words(format!("{what} Refine it, and add it to the search: --candidates FILE.toml"), 2);
            out.gap();
            out.code(&suggestion.toml);
        }
    }

    fn detection_limits(&self, out: &mut Parts) {
        out.heading("Detection limits, at 95 % power");
        let mut limits = table(&["effect", "detected if"]);
        for limit in &self.limits {
            let said = match &limit.table {
                None => "not detectable".to_string(),
                Some(_) if limit.parameter.is_empty() => "present".to_string(),
                Some(table) => {
                    let inner = || table.get("traps")?.as_array()?.first()?.as_table();
                    let table = if table.contains_key(&limit.parameter) { Some(table) } else { inner() };
                    let number = |value: &toml::Value| value.as_float().map(|number| significant(number, 3));
                    let strength = table.and_then(|table| table.get(&limit.parameter)).and_then(number);
                    let side = if limit.increases { "or more" } else { "or less" };
                    let others: Vec<String> = table
                        .into_iter()
                        .flatten()
                        .filter(|(name, _)| **name != limit.parameter)
                        .filter_map(|(name, value)| Some(format!("{name} {}", number(value)?)))
                        .collect();
                    let at = if others.is_empty() { String::new() } else { format!(" (at {})", others.join(", ")) };
                    format!("{} {} {side}{at}", limit.parameter, or_dash(strength))
                }
            };
            limits.add_row(vec![limit.effect.clone(), said]);
        }
        if let Some(column) = limits.column_mut(1) {
            column.set_cell_alignment(comfy_table::CellAlignment::Left);
        }
        out.table(limits);
        out.words(
            "  detected: in 95 % of data sets chi2 falls by what --level asks of this effect; the verdict also asks that rows left out \
             are predicted better, and may remain complete with a note",
            4,
        );
    }

    fn what_was_tried(&self, out: &mut Parts) {
        out.heading("Effects tried one at a time");
        let mut tried = table(&["effect", "chi2", "change of chi2"]);
        for attempt in self.tried.iter().filter(|tried| tried.chi2.is_some()).take(LISTED) {
            let chi2 = attempt.chi2.expect("filtered");
            // Rough fits are accurate to a few per mille.
            let digits = |value: f64| usize::from(value.abs() < 1000.0);
            let fall = chi2 - self.baseline.chi2;
            tried.add_row(vec![
                attempt.effect.clone(),
                format!("{chi2:.*}", digits(chi2)),
                format!("{fall:+.*}", digits(chi2)),
            ]);
        }
        out.table(tried);
        let rest = self.tried.iter().filter(|tried| tried.chi2.is_some()).count().saturating_sub(LISTED);
        if rest > 0 {
            out.words(format!("  and {rest} more with larger chi2"), 4);
        }
        let worse = |tried: &&Tried| tried.chi2.is_some_and(|chi2| chi2 > self.baseline.chi2 + RULED_OUT);
        let ruled_out: Vec<String> = self
            .tried
            .iter()
            .filter(worse)
            .map(|tried| format!("{} (chi2 {:+.1})", tried.effect, tried.chi2.expect("filtered") - self.baseline.chi2))
            .collect();
        if !ruled_out.is_empty() {
            out.words(format!("  ruled out, since chi2 rises: {}", ruled_out.join(", ")), 4);
        }
        let absorbed: Vec<&str> =
            self.tried.iter().filter(|tried| tried.chi2.is_none()).map(|tried| tried.effect.as_str()).collect();
        if !absorbed.is_empty() {
            out.words(
                format!(
                    "  not testable with these data (no influence on them, degenerate with the free parameters, or already in \
                     the mission): {}",
                    absorbed.join(", ")
                ),
                4,
            );
        }
    }
}
