//! Whether data can carry a verdict at all.
//!
//! Checked before anything is fitted: enough rows, no duplicates, no contradictory rows. Whether their errors can be used is known only
//! at a model that explains them ([`errors_beyond`]).

use std::collections::{HashMap, HashSet};

use statrs::distribution::{Binomial, ChiSquared, ContinuousCDF, DiscreteCDF};

use super::fitted_model::Case;
use super::result::{Reason, RowPlace};
use crate::analysis::measurement::DataSet;
use crate::analysis::noise::SetNoise;
use crate::physics::conditions::NAMES;

/// Rows that any verdict needs: an effect with two parameters, and as many rows to test it with.
const LEAST_ROWS: usize = 4;

/// Probability below which something is no coincidence.
const NO_ACCIDENT: f64 = 1e-5;

/// Why the data cannot carry a verdict; None if they can.
pub(super) fn refusal(case: &Case, free: usize) -> Option<Reason> {
    too_few(case, free).or_else(|| repeated(case))
}

fn too_few(case: &Case, free: usize) -> Option<Reason> {
    let n = case.n();
    (n < LEAST_ROWS.max(free + 3)).then_some(Reason::TooFewRows { n, free })
}

/// Groups of two or more rows of the same observable under the same conditions, as indices among all rows. Everything that a file
/// states about a row is a condition, in its columns or for all its rows.
fn alike(case: &Case) -> Vec<Vec<usize>> {
    let mut groups: Vec<Vec<usize>> = Vec::new();
    let mut group_of: HashMap<_, usize> = HashMap::new();
    let mut first = 0;
    for set in case.data {
        let columns: Vec<Vec<f64>> = set.varying.iter().map(|name| set.against(name)).collect();
        for (row, measured) in set.rows.iter().enumerate() {
            let at = &measured.at;
            let known = NAMES.iter().map(|name| at.get(name).map(f64::to_bits));
            let columns = columns.iter().map(|column| Some(column[row].to_bits()));
            let covariates = at.covariates.iter().map(|(name, value)| (name.clone(), value.to_bits()));
            let key = (
                (set.observable as u64, measured.galaxy, measured.species),
                known.chain(columns).collect::<Vec<Option<u64>>>(),
                covariates.collect::<Vec<(String, u64)>>(),
                measured.words.clone(),
            );
            let group = *group_of.entry(key).or_insert_with(|| {
                groups.push(Vec::new());
                groups.len() - 1
            });
            groups[group].push(first + row);
        }
        first += set.rows.len();
    }
    groups.into_iter().filter(|members| members.len() > 1).collect()
}

/// Duplicate rows: equal in every digit, more often than by rounding.
fn repeated(case: &Case) -> Option<Reason> {
    let groups = alike(case);
    let (mut pairs, mut equal, mut step_sigma) = (0u64, Vec::new(), 0.0_f64);
    for members in &groups {
        for (index, &a) in members.iter().enumerate() {
            for &b in &members[index + 1..] {
                pairs += 1;
                step_sigma = step_sigma
                    .max(10_f64.powi(-decimals(case.values[a]).max(decimals(case.values[b]))) / case.sigmas[a]);
                if case.values[a] == case.values[b] && case.sigmas[a] == case.sigmas[b] {
                    equal.push((a, b));
                }
            }
        }
    }
    // Two normal variates rounded to a step are equal with a probability of step/(2 √π sigma).
    let chance = (step_sigma / (2.0 * std::f64::consts::PI.sqrt())).clamp(1e-12, 1.0);
    let accident = match equal.len() as u64 {
        0 => 1.0,
        count => Binomial::new(chance, pairs).map_or(1.0, |law| law.sf(count - 1)),
    };
    (accident < NO_ACCIDENT).then(|| {
        let (a, b) = equal[0];
        // Of several equal rows all but the first repeat another.
        let count = equal.iter().map(|(_, later)| later).collect::<HashSet<_>>().len();
        Reason::Repeated { count, such_as: [named(case, a), named(case, b)] }
    })
}

/// Decimals of a number in its shortest form.
fn decimals(value: f64) -> i32 {
    let text = format!("{value:e}");
    let (digits, exponent) = text.split_once('e').unwrap_or((&text, "0"));
    let behind = digits.split_once('.').map_or(0, |(_, behind)| behind.len() as i32);
    behind - exponent.parse::<i32>().unwrap_or(0)
}

/// Rows under the same conditions that differ by far more than their errors.
pub(super) fn contradictory(case: &Case) -> Option<Reason> {
    let (mut chi2, mut freedom, mut worst) = (0.0, 0usize, (0.0, 0, 0));
    for members in alike(case) {
        let weight = |row: usize| case.sigmas[row].powi(-2);
        let total: f64 = members.iter().map(|&row| weight(row)).sum();
        let mean = members.iter().map(|&row| weight(row) * case.values[row]).sum::<f64>() / total;
        chi2 += members.iter().map(|&row| weight(row) * (case.values[row] - mean).powi(2)).sum::<f64>();
        freedom += members.len() - 1;
        for (index, &a) in members.iter().enumerate() {
            for &b in &members[index + 1..] {
                let apart = (case.values[a] - case.values[b]).abs() / case.sigmas[a].hypot(case.sigmas[b]);
                if apart > worst.0 {
                    worst = (apart, a, b);
                }
            }
        }
    }
    let chance = if freedom == 0 { 1.0 } else { ChiSquared::new(freedom as f64).map_or(1.0, |law| law.sf(chi2)) };
    let (apart_sigma, a, b) = worst;
    (chance < NO_ACCIDENT).then(|| Reason::Contradictory { rows: [named(case, a), named(case, b)], apart_sigma })
}

/// A row by its index among all.
fn named(case: &Case, row: usize) -> RowPlace {
    let index = case.set_of[row];
    let (set, row) = (&case.data[index], row - case.rows(index).start);
    RowPlace { file: set.file.clone(), line: set.table.lines.get(row).copied(), row }
}

/// Errors that differ from the scatter by more than can be allowed for.
pub(super) fn errors_beyond(data: &[DataSet], noise: &[SetNoise]) -> Option<Reason> {
    let (beyond, _) = noise.iter().zip(data).find(|(noise, set)| noise.is_beyond(set))?;
    let file = beyond.file.clone();
    Some(match beyond.scale {
        scale if scale < 1.0 => Reason::LargeErrors { file, factor: (10.0 / scale).round() / 10.0 },
        scale => Reason::SmallErrors { file, factor: scale },
    })
}
