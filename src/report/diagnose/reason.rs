//! The reason for the verdict of a diagnosis, and further notes, in sentences.

use std::fmt;

use serde::ser::{Serialize, Serializer};

use crate::analysis::diagnose::{Note, Reason, RowPlace};
use crate::mission::keys::plain;
use crate::report::{counted, effects_listed, listed, significant};

impl fmt::Display for Reason {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Reason::Explained => out.write_str("the model explains the data"),
            Reason::Lacking { effects, has_rivals: false } => {
                write!(out, "the model lacks {}", effects_listed(effects))
            }
            Reason::Lacking { effects, has_rivals: true } => write!(
                out,
                "the model lacks {}, or an effect that these data do not distinguish from it",
                effects_listed(effects)
            ),
            Reason::LackingOrPedestals { effect, files, are_most } => write!(
                out,
                "the model lacks {effect}, or {} off by a constant{}: these data do not distinguish the two",
                match &files[..] {
                    [only] => format!("all values of {only} are"),
                    several => format!("{} are each", listed(several)),
                },
                if *are_most { " that is most of what was measured" } else { " of their own" }
            ),
            Reason::LackingOrErrors { effects, file } => write!(
                out,
                "the model lacks {}; or the errors of {file} are not as quoted (larger, correlated, or of rows that are wrong): these data do \
                 not distinguish the two",
                effects_listed(effects)
            ),
            Reason::Unexplained { undone } if undone.is_empty() => {
                out.write_str("no combination of the catalogue's effects explains the data to within their noise")
            }
            Reason::Unexplained { undone } => write!(
                out,
                "none of the effects tried explains the data to within their noise, and the search is incomplete: {} left undone",
                undone.join(", ")
            ),
            Reason::WrongNumber { key, given, right, beside } => {
                let beside =
                    if beside.is_empty() { String::new() } else { format!(", beside {},", effects_listed(beside)) };
                write!(
                    out,
                    "{key} = {right} in place of {given}{beside} explains the data better than any effect of the catalogue: is the \
                     number in the mission right"
                )
            }
            Reason::BetterLaw { target, expression, beside } => {
                let beside = match &beside[..] {
                    [] => String::new(),
                    effects => format!(" (beside {})", effects_listed(effects)),
                };
                write!(
                    out,
                    "a correction of the measured values explains the data better than any effect of the catalogue: {target} = \
                     {expression}{beside}"
                )
            }
            Reason::TooFewRows { n, free } => write!(
                out,
                "{} {} too few to fit {} and to test effects besides: free fewer, or give more data",
                counted(*n as u64, "row"),
                if *n == 1 { "is" } else { "are" },
                counted(*free as u64, "free parameter")
            ),
            Reason::Repeated { count, such_as: [a, b] } => write!(
                out,
                "{} another in every digit, such as {a} and {b}: counted twice, noise looks like an effect. \
                 Give each measurement once",
                if *count == 1 { "1 row repeats".into() } else { format!("{count} rows repeat") }
            ),
            Reason::Contradictory { rows: [a, b], apart_sigma } => write!(
                out,
                "rows contradict one another: {a} and {b} were taken under the same conditions and differ by \
                 {apart_sigma:.1} of their errors; one of them is wrong, or a condition that differs has no column"
            ),
            Reason::LargeErrors { file, factor } => write!(
                out,
                "{file}: the quoted sigma is {} times the scatter of the rows. With such errors hardly any effect could be \
                 detected: quote the scatter",
                plain(*factor)
            ),
            Reason::SmallErrors { file, factor } => write!(
                out,
                "{file}: rows scatter by {factor:.1} times their quoted sigma, and the residuals follow no condition: the \
                 errors are too small, or something that no column records disturbs the data"
            ),
        }
    }
}

/// `line 17 of trails.ecsv`
impl fmt::Display for RowPlace {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.line {
            Some(line) => write!(out, "line {line} of {}", self.file),
            None => write!(out, "row {} of {}", self.row + 1, self.file),
        }
    }
}

impl fmt::Display for Note {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Note::CoarseReadout { shift_sigma } => write!(
                out,
                "the mission's own readout ([accuracy]) is off by up to {shift_sigma:.1} sigma from a finer one, which is used \
                 here"
            ),
            Note::MovesTheDate { effect, share, years } => {
                let by =
                    years.map_or_else(|| "into or out of the mission".into(), |years| format!("by {years:+.1} yr"));
                write!(
                    out,
                    "{effect} explains {:.1} % of what all effects explain, and moves the date {by}: the date depends on it",
                    100.0 * share
                )
            }
            Note::DoesNotExtrapolate { effect, condition, beyond_rms_sigma: [without, with] } => write!(
                out,
                "{effect} describes the data but does not extrapolate: the ends of the range of {condition}, left out of the fit, are \
                 predicted to {with:.1} sigma with it and to {without:.1} sigma without it"
            ),
            Note::TrustInside { condition, range: [low, high], rms_sigma: [inside, beyond] } => write!(
                out,
                "rely on the model for {condition} from {} to {} only: groups inside, left out of the fit, are predicted to \
                 {inside:.1} sigma, those at the ends to {beyond:.1} sigma",
                significant(*low, 4),
                significant(*high, 4)
            ),
            Note::PartOfAPeriod { effect, period_yr, span_yr } => write!(
                out,
                "{effect}: the data span {} yr, less than its period of {} yr: they show a drift, and not that it returns",
                significant(*span_yr, 2),
                significant(*period_yr, 2)
            ),
            Note::CoincidesWith { what, condition, values: [before, after], between_yr: [from, to] } => write!(
                out,
                "{what} lies between {} and {} yr, when {condition} changes from {before} to {after} in the data: perhaps it stands for \
                 what that change did",
                significant(*from, 3),
                significant(*to, 3)
            ),
            Note::SameAsReleaseTime { effect, keys } => write!(
                out,
                "all data are of one temperature: there {effect} does what other release times do. Free {} before the thermometer is \
                 doubted",
                listed(keys)
            ),
            Note::Nearest { effects, chi2: [before, after], n } => write!(
                out,
                "the best combination of effects, {}, lowers chi2 from {before:.1} to {after:.1} for {n} rows",
                effects.join(" + ")
            ),
            Note::IfErrorsAreRight { effects, excess } => write!(
                out,
                "if the errors are as quoted and no row is wrong, {} may be missing as well (-2 ln Z {excess:+.1}, which does not decide)",
                effects_listed(effects)
            ),
            Note::MayBeANumber { key, given, right } => write!(
                out,
                "{key} = {right} in place of {given} explains the data about as well: check the number in the mission"
            ),
            Note::NothingDetectable => out.write_str(
                "no effect of the catalogue could have been detected with these data, of any strength: that the model explains them \
                 says little",
            ),
            Note::OtherPeriods { effect, period_yr, others_yr, spacing_yr } => {
                let others: Vec<String> = others_yr.iter().map(|period_yr| significant(*period_yr, 3)).collect();
                write!(
                    out,
                    "{effect}: a period of {} yr fits as well as one of {} yr: the epochs are {} yr apart and do not distinguish them. \
                     Epochs at other intervals would",
                    others.join(" or "),
                    significant(*period_yr, 3),
                    significant(*spacing_yr, 3)
                )
            }
            Note::TakesItsPlace { effect, species } => write!(
                out,
                "{effect} takes the place of {species}, whose density has gone to 0: perhaps it is that species, with another release time or \
                 energy level than the mission file says; free {species}.release_ms and {species}.energy_ev to see"
            ),
            Note::EpochTemperatures { epochs, range_k: [low, high], chi2: [without, with], n } => write!(
                out,
                "the temperature is not recorded epoch by epoch; one of its own for each of the {epochs} epochs, {low:+.1} to \
                 {high:+.1} K from the one assumed, would explain the data (chi2 {without:.0} -> {with:.0}, {n} rows): record it in a \
                 column temperature_k"
            ),
        }
    }
}

/// In text form.
impl Serialize for Reason {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        to.collect_str(self)
    }
}

/// In text form.
impl Serialize for Note {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        to.collect_str(self)
    }
}
