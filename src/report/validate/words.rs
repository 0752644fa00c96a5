//! Where a model fails, in words.

use crate::analysis::independence::Neighbours;
use crate::analysis::validate::residual_trend::{Bin, Trend};
use crate::analysis::validate::{Claim, Finding, SetResult, Validation};
use crate::mission::keys::plain;
use crate::report::{chance, counted};

/// Minimum significance, in errors, of a mean that is reported.
const CLEAR: f64 = 3.0;

impl Validation {
    /// Where the model fails, in words.
    pub fn words(&self) -> Vec<String> {
        self.findings.iter().map(|finding| self.sentence(finding)).collect()
    }

    fn sentence(&self, finding: &Finding) -> String {
        let set = &self.sets[finding.set];
        match finding.claim {
            Claim::Trend => trend_in_words(set, self.trend(finding.set).expect("what was found")),
            Claim::Offset => {
                let all: Vec<usize> = (0..set.data.rows.len()).collect();
                format!("{}: {} in all rows", set.name(), fault(set, &all))
            }
            Claim::SmallErrors => format!(
                "{}: residuals scatter by {:.1} sigma from row to row: the quoted errors look too small. Trends are judged by \
                 that scatter",
                set.name(),
                set.scatter_sigma
            ),
            Claim::LargeErrors => format!(
                "{}: residuals scatter by only {:.2} sigma (p-value under noise alone {}): the quoted errors look too large, \
                 and may hide a missing effect",
                set.name(),
                set.rms_sigma(),
                chance(finding.chance)
            ),
            Claim::Correlated => {
                let correlated = self.independence.correlated();
                let one = correlated.into_iter().find(|one| one.set == finding.set).expect("what was found");
                correlation_in_words(set.name(), one, self.independence.tests.len())
            }
        }
    }

    /// The conclusion, in a sentence.
    pub fn conclusion(&self) -> String {
        let all = format!("chi2 is {:.1} for {}", self.chi2, counted(self.n as u64, "row"));
        let [as_small, as_large] = self.chi2_chances();
        if self.exceeds_noise() {
            let chance = chance(as_large);
            return format!("{all}, more than noise gives (p-value {chance}): the model does not explain the data");
        }
        if self.falls_short_of_noise() {
            let chance = chance(as_small);
            return format!("{all}, less than noise gives (p-value {chance}): the quoted errors are too large");
        }
        let mut claims: Vec<&str> = Vec::new();
        for said in self.findings.iter().map(|finding| ending(finding.claim)) {
            if !claims.contains(&said) {
                claims.push(said);
            }
        }
        match &claims[..] {
            [] => format!("{all}: the model agrees with the data within their noise"),
            claims => format!("{all}, as noise gives, but {}", claims.join(", and ")),
        }
    }
}

/// The correlation of the residuals of a file: `dose.ecsv: residuals of neighbours along t_yr have a correlation of +0.90 ..`.
pub(in crate::report) fn correlation_in_words(file: &str, one: &Neighbours, tests: usize) -> String {
    format!(
        "{file}: residuals of neighbours along {} have a correlation of {:+.2} (p-value {}, corrected for {}): rows are not independent, \
         or a smooth effect is missing",
        one.name,
        one.correlation,
        chance(one.false_alarm),
        match tests {
            1 => "1 condition tested".to_string(),
            tests => format!("{tests} conditions tested"),
        }
    )
}

/// A claim as the end of a sentence that begins with a chi2 about which nothing can be said.
fn ending(claim: Claim) -> &'static str {
    match claim {
        Claim::Trend => "the residuals have a trend",
        Claim::Offset => "the mean residual is not zero",
        Claim::SmallErrors => "some quoted errors look too small",
        Claim::LargeErrors => "some quoted errors look too large",
        Claim::Correlated => "neighbouring rows are not independent",
    }
}

/// The fault of the model in some rows: `trail too faint`.
fn fault(set: &SetResult, rows: &[usize]) -> &'static str {
    let sum = |value: &dyn Fn(usize) -> f64| rows.iter().map(|&row| value(row) / set.data.rows[row].sigma).sum::<f64>();
    let data = sum(&|row| set.data.rows[row].value);
    let excess = data - sum(&|row| set.model[row]);
    let observable = set.data.observable;
    let more = if observable.is_shape() { excess * data > 0.0 } else { excess > 0.0 };
    if more { observable.card().more } else { observable.card().less }
}

fn trend_in_words(set: &SetResult, trend: &Trend) -> String {
    let clear = |sign: f64| -> Vec<usize> {
        let beyond = |bin: &Bin| sign * bin.mean_sigma > CLEAR * bin.error_sigma;
        (0..trend.bins.len()).filter(|&bin| beyond(&trend.bins[bin])).collect()
    };
    let mut parts = Vec::new();
    for sign in [1.0, -1.0] {
        let bins = clear(sign);
        if bins.is_empty() {
            continue;
        }
        let rows: Vec<usize> = bins.iter().flat_map(|&bin| trend.bins[bin].rows.clone()).collect();
        let most = bins.iter().map(|&bin| trend.bins[bin].mean_sigma.abs()).fold(0.0, f64::max);
        parts.push((most, format!("{} {}{}", fault(set, &rows), place(trend, &bins), elsewhere(set, trend, &rows))));
    }
    parts.sort_by(|a, b| b.0.total_cmp(&a.0));
    let said: Vec<String> = parts.into_iter().map(|(_, said)| said).collect();
    if said.is_empty() {
        let way = if trend.slope_sigma > 0.0 { "rise" } else { "fall" };
        return format!("{}: residuals {way} with {}, but no bin is significant by itself", set.name(), trend.name);
    }
    format!("{}: {}", set.name(), said.join("; "))
}

/// Location of some bins of a condition: `beyond trail_px 20`.
fn place(trend: &Trend, bins: &[usize]) -> String {
    let name = &trend.name;
    let last = trend.bins.len() - 1;
    let (first_bin, last_bin) = (bins[0], bins[bins.len() - 1]);
    if trend.bins[0].word.is_some() {
        let words: Vec<&str> = bins.iter().filter_map(|&bin| trend.bins[bin].word.as_deref()).collect();
        return format!("for {name} {}", words.join(", "));
    }
    if bins.len() == trend.bins.len() {
        let worst = bins.iter().max_by(|a, b| {
            let size = |bin: usize| trend.bins[bin].mean_sigma.abs();
            size(**a).total_cmp(&size(**b))
        });
        let bin = &trend.bins[*worst.expect("bins")];
        return format!("at all {name}, most at {}", range(bin.low, bin.high));
    }
    let contiguous = last_bin - first_bin + 1 == bins.len();
    if !contiguous {
        let each: Vec<String> = bins.iter().map(|&bin| range(trend.bins[bin].low, trend.bins[bin].high)).collect();
        return format!("at {name} {}", each.join(", "));
    }
    match (first_bin, last_bin) {
        (first, end) if end == last && first > 0 => format!("from {name} {} on", number(trend.bins[first].low)),
        (0, end) => format!("up to {name} {}", number(trend.bins[end].high)),
        (first, end) => match (trend.bins[first].low, trend.bins[end].high) {
            (low, high) if low == high => format!("at {name} {}", number(low)),
            (low, high) => format!("between {name} {} and {}", number(low), number(high)),
        },
    }
}

/// Whether that holds at all values of the other conditions: `, at all signal_e`.
fn elsewhere(set: &SetResult, trend: &Trend, rows: &[usize]) -> String {
    let residuals = set.residuals();
    let along = set.data.against(&trend.name);
    let mut said = String::new();
    for name in set.data.varying.iter().filter(|name| **name != trend.name) {
        let at = set.data.against(name);
        let mut values: Vec<f64> = rows.iter().map(|&row| at[row]).filter(|at| at.is_finite()).collect();
        values.sort_by(f64::total_cmp);
        values.dedup();
        if values.len() < 2 || values.len() > rows.len() / 2 || follows(&at, &along, rows) {
            continue;
        }
        let mean = |value: f64| {
            let here: Vec<f64> = rows.iter().filter(|&&row| at[row] == value).map(|&row| residuals[row]).collect();
            (here.iter().sum::<f64>() / here.len() as f64, 1.0 / (here.len() as f64).sqrt())
        };
        let sign = rows.iter().map(|&row| residuals[row]).sum::<f64>().signum();
        let seen: Vec<f64> =
            values.iter().copied().filter(|&value| mean(value).0 * sign > CLEAR * mean(value).1).collect();
        if seen.len() == values.len() {
            said.push_str(&if name == "t_yr" { ", at all epochs".to_string() } else { format!(", at all {name}") });
        } else if !seen.is_empty() && !set.data.is_words(name) {
            let listed: Vec<String> = seen.iter().map(|value| number(*value)).collect();
            if listed.len() <= 3 {
                said.push_str(&format!(", clear at {name} {} only", listed.join(", ")));
            }
        }
    }
    said
}

/// Whether one condition has a single value for every value of another: a temperature recorded once for every epoch.
fn follows(at: &[f64], along: &[f64], rows: &[usize]) -> bool {
    let mut pairs: Vec<(f64, f64)> = rows.iter().map(|&row| (along[row], at[row])).collect();
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
    pairs.windows(2).all(|pair| pair[0].0 != pair[1].0 || pair[0].1 == pair[1].1)
}

fn range(low: f64, high: f64) -> String {
    if high > low { format!("{} to {}", number(low), number(high)) } else { number(low) }
}

/// At most four digits.
fn number(value: f64) -> String {
    if value == 0.0 || value.fract() == 0.0 {
        return plain(value);
    }
    let digits = (3 - value.abs().log10().floor() as i32).max(0);
    plain((value * 10_f64.powi(digits)).round() / 10_f64.powi(digits))
}

#[cfg(test)]
mod tests {
    use super::follows;

    /// A temperature recorded once for every epoch follows the epochs; one that is recorded row by row does not.
    #[test]
    fn a_condition_with_one_value_for_each_of_another_follows_it() {
        let epochs = [1.0, 2.0, 1.0, 3.0, 2.0];
        assert!(follows(&[150.0, 151.0, 150.0, 150.0, 151.0], &epochs, &[0, 1, 2, 3, 4]));
        assert!(!follows(&[150.0, 151.0, 150.0, 150.0, 152.0], &epochs, &[0, 1, 2, 3, 4]));
        assert!(follows(&[150.0, 151.0, 150.0, 150.0, 152.0], &epochs, &[0, 2, 3, 4]));
    }
}
