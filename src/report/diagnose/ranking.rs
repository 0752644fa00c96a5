//! Sets of effects by their evidence: what a verdict was read from.

use super::super::{Parts, effects_listed, table};
use crate::analysis::diagnose::Ranking;

/// Sets that are shown, and the smallest share of an effect.
const SHOWN: usize = 6;
const SHARE: f64 = 0.01;

/// The best sets, the shares of effects, and the best law.
pub(super) fn say(ranking: &Ranking, out: &mut Parts) {
    out.heading("Evidence for sets of effects");
    let mut sets = table(&["effects", "-2 ln Z", "more than the best", "-2 ln L"]);
    let shown = ranking.sets.iter().enumerate().filter(|(place, set)| *place < SHOWN || set.effects.is_empty());
    for (_, set) in shown {
        let number = |value: f64| format!("{value:.1}");
        sets.add_row(vec![name(&set.effects), number(set.minus_2_ln_z), number(set.excess), number(set.minus_2_ln_l)]);
    }
    out.table(sets);
    out.words(
        format!(
            "  -2 ln Z: evidence, -2 ln L and the price of parameters and of the choice among effects, with the errors that are \
             likeliest for each set; {} apart is decided, 27 to 1",
            ranking.decided
        ),
        4,
    );
    let shares = ranking.shares.iter().filter(|share| share.share > SHARE);
    let shares: Vec<String> = shares.map(|share| format!("{} {:.0} %", share.effect, 100.0 * share.share)).collect();
    if !shares.is_empty() {
        out.words(format!("  probability of an effect among these sets: {}", shares.join(", ")), 4);
    }
    let number = ranking.numbers.first().filter(|number| number.excess < ranking.decided);
    for (what, law) in [("law of the measured values", ranking.law.as_ref()), ("number of the mission", number)] {
        let Some(law) = law else { continue };
        let beside =
            if law.beside.is_empty() { String::new() } else { format!(" beside {}", effects_listed(&law.beside)) };
        let says = match law.excess {
            _ if law.is_clearly_better => "clearly better",
            excess if excess < 0.0 => "better, but not clearly",
            _ => "the set is better",
        };
        out.words(
            format!("  best {what}: {}{beside}; {:+.1} from the best set: {says}", law.expression, law.excess),
            4,
        );
    }
}

/// The effects of a set.
fn name(effects: &[String]) -> String {
    if effects.is_empty() { "as given".into() } else { effects.join(" + ") }
}
