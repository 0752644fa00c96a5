//! Sets of effects ranked by their evidence.

use super::{Report, effects_listed, lines, significant, table, wrapped};
use crate::analysis::diagnose::Ranking;
use crate::analysis::diagnose::ranking::{FileErrors, RankedSet};
use crate::mission::keys::plain;

/// Smallest share of an effect that is printed.
const SHARE: f64 = 0.01;

impl Report for Ranking {
    fn text(&self) -> String {
        let mut out = wrapped(&format!("{}: sets of effects, ranked by their evidence", self.mission), 2);
        out.push('\n');
        out.push_str(&wrapped(&self.sentence(), 2));
        out.push('\n');
        let mut sets = table(&["effects", "-2 ln Z", "excess", "-2 ln L"]);
        for set in &self.sets {
            let number = |value: f64| format!("{value:.1}");
            sets.add_row(vec![
                name(&set.effects),
                number(set.minus_2_ln_z),
                format!("{:+.1}", set.excess),
                number(set.minus_2_ln_l),
            ]);
        }
        out.push_str(&lines(&sets));
        let decided = format!(
            "  {} rows; -2 ln Z: evidence, with the price of parameters and of the choice among effects; {} apart is decided, \
             27 to 1; errors are those that are likeliest for each set",
            self.n, self.decided
        );
        out.push_str(&wrapped(&decided, 4));
        self.say_shares(&mut out);
        if let Some(named) = self.sets.iter().find(|set| set.effects == self.named) {
            say_named(named, &mut out);
        }
        if let Some(law) = &self.law {
            let beside =
                if law.beside.is_empty() { String::new() } else { format!(" beside {}", effects_listed(&law.beside)) };
            let says = match law.excess {
                _ if law.is_clearly_better => "clearly better",
                excess if excess < 0.0 => "better, but not clearly: a law imitates almost any effect",
                _ => "the set is better",
            };
            let law = format!(
                "Best law of the measured values: {}{beside}; -2 ln Z {:+.1} from the best set: {says}",
                law.expression, law.excess
            );
            out.push('\n');
            out.push_str(&wrapped(&law, 2));
        }
        if !self.undone.is_empty() {
            let undone = format!("Left undone after {} evaluations: {}", self.evaluations, self.undone.join(", "));
            out.push_str(&wrapped(&undone, 2));
        }
        out
    }

    fn csv(&self) -> Vec<Vec<String>> {
        let header = ["effects", "minus_2_ln_z", "excess", "minus_2_ln_l"].map(str::to_string).to_vec();
        let row = |set: &RankedSet| {
            let numbers = [set.minus_2_ln_z, set.excess, set.minus_2_ln_l].map(|value| value.to_string());
            std::iter::once(set.effects.join(" + ")).chain(numbers).collect()
        };
        std::iter::once(header).chain(self.sets.iter().map(row)).collect()
    }
}

impl Ranking {
    fn sentence(&self) -> String {
        if self.law.as_ref().is_some_and(|law| law.is_clearly_better) {
            return "A law of the measured values explains the data better than any set of effects.".into();
        }
        match (&self.named[..], self.rivals.is_empty()) {
            ([], _) => "No effect is called for.".into(),
            (named, true) => format!("The evidence is for {}.", effects_listed(named)),
            (named, false) => {
                let rivals: Vec<String> = self.rivals.iter().map(|rival| name(rival)).collect();
                format!("The evidence is for {}, not decided against {}.", effects_listed(named), rivals.join(", "))
            }
        }
    }

    fn say_shares(&self, out: &mut String) {
        let shown = self.shares.iter().filter(|share| share.share > SHARE);
        let each: Vec<String> = shown.map(|share| format!("{} {:.0} %", share.effect, 100.0 * share.share)).collect();
        if !each.is_empty() {
            out.push('\n');
            out.push_str(&wrapped(&format!("Share of each effect in these sets: {}", each.join(", ")), 2));
        }
    }
}

/// The effects of a set.
fn name(effects: &[String]) -> String {
    if effects.is_empty() { "as given".into() } else { effects.join(" + ") }
}

/// Parameters and errors of the set that is named.
fn say_named(set: &RankedSet, out: &mut String) {
    if !set.parameters.is_empty() {
        let mut values = table(&["likeliest values", "value", "unit"]);
        for parameter in &set.parameters {
            values.add_row(vec![parameter.key.clone(), significant(parameter.value, 4), parameter.unit.into()]);
        }
        out.push('\n');
        out.push_str(&lines(&values));
    }
    out.push('\n');
    for file in &set.noise {
        out.push_str(&wrapped(&errors(file), 2));
    }
}

/// `trails.ecsv: errors x 1.31; lines 31 and 44 are wrong`
fn errors(file: &FileErrors) -> String {
    let mut said = vec![format!("errors x {:.2}", file.scale)];
    if file.correlation > 0.0 {
        said.push(format!("neighbours correlated by {:.2}", file.correlation));
    }
    if let Some(pedestal) = file.pedestal {
        said.push(format!("a constant of {pedestal:.2e} in all values"));
    }
    if !file.outliers.is_empty() {
        let lines: Vec<String> = file.outliers.iter().map(|line| plain(*line as f64)).collect();
        said.push(format!("wrong: {} {}", if lines.len() == 1 { "line" } else { "lines" }, lines.join(", ")));
    }
    format!("{}: {}", file.file, said.join("; "))
}
