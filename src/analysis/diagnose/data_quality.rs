//! Whether data can carry a verdict at all.
//!
//! Checked before anything is fitted: enough rows, no duplicates, no contradictory rows, and errors not far larger than the scatter
//! of neighbouring rows. (Errors that are too small can be distinguished from a missing effect only after effects have been tried:
//! see [`sigma_too_small`].)

use std::collections::{HashMap, HashSet};

use statrs::distribution::{Binomial, ChiSquared, ContinuousCDF, DiscreteCDF};

use super::fitted_model::{Case, Node};
use super::holdout;
use super::noise::{self, SetNoise};
use super::result::{Reason, RowPlace};
use crate::physics::conditions::NAMES;

/// Rows that any verdict needs: an effect with two parameters, and as many rows to test it with.
const LEAST_ROWS: usize = 4;

/// Probability below which something is no coincidence.
const NO_ACCIDENT: f64 = 1e-5;

/// Sigma beyond which a row is an outlier, and one in how many rows may be one: of fewer rows, one may be all that shows an effect.
const ODD_SIGMA: f64 = 5.0;
const ONE_IN: usize = 20;

/// Standard deviations of chi2 within which a model nearly explains all other rows: it is refitted without the outliers. The
/// residuals of several effects may be a real change that they cannot describe, such as a gain that drifts in the brightest
/// packets: they must leave no more than noise.
const NEARLY: f64 = 4.0;
pub(super) const AS_NOISE: f64 = 1.6;

/// Share of the residuals of a row, or of several together, absorbed by free parameters beyond which one of them is determined by
/// these rows.
const HANGS_ON_IT: f64 = 0.5;

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
pub(super) fn errors_beyond(noise: &[SetNoise]) -> Option<Reason> {
    let beyond = noise.iter().find(|noise| noise.is_beyond())?;
    let file = beyond.file.clone();
    Some(match beyond.scale {
        scale if scale < 1.0 => Reason::LargeErrors { file, factor: (10.0 / scale).round() / 10.0 },
        scale => Reason::SmallErrors { file, factor: scale },
    })
}

/// Errors of a file of few rows that are far larger than what the free parameters leave: the scatter of longer files is estimated
/// from all that is smooth.
pub(super) fn errors_too_large(case: &Case, base: &Node) -> Option<Reason> {
    let taken = base.freedom() / case.n() as f64;
    (0..case.data.len()).find_map(|set| {
        let rows = case.rows(set);
        let freedom = (rows.len() as f64 * taken).max(1.0);
        let chi2: f64 = rows.clone().map(|row| base.residuals[row].powi(2)).sum();
        let has_floor = case.data[set].rows.iter().any(|row| row.floor > 0.0);
        let chance = ChiSquared::new(freedom).map_or(1.0, |law| law.cdf(chi2));
        let scale = (chi2 / freedom).sqrt();
        let far = rows.len() < noise::FEW && !has_floor && chance < noise::TOO_LARGE && noise::is_far_too_large(scale);
        far.then(|| Reason::LargeErrors {
            file: case.data[set].file.clone(),
            factor: (10.0 / scale.max(1e-9)).round() / 10.0,
        })
    })
}

/// Outliers from a model that explains all other rows.
pub(super) struct Odd {
    /// Decrease of chi2 without them, each counted as a parameter.
    pub fall: f64,
    /// Their indices among all rows, and their distances, sigma.
    pub rows: Vec<(usize, f64)>,
    /// The same as a reason for the report.
    pub reason: Reason,
}

/// A few rows, each far from a model that explains all others. None if there are none, or if more is wrong.
pub(super) fn odd_rows(case: &Case, node: &Node) -> Option<Odd> {
    // A row that alone determines a parameter may be all that shows an effect, and so may the first or the last of a short
    // file in time or dose.
    let hangs = |row: &usize| node.basis.row(*row).norm_squared() > HANGS_ON_IT;
    let size = |row: usize| node.residuals[row].abs();
    let is_right = |row: &usize| {
        let set = case.set_of[*row];
        case.data[set].shared.right.contains(&(row - case.rows(set).start))
    };
    let is_short = |row: &usize| case.rows(case.set_of[*row]).len() < noise::FEW;
    let of_damage = |name: &str| ["t_yr", "dose_mev_g"].contains(&name);
    let is_all = |row: &usize| is_short(row) && is_alone_at_an_end_of(case, *row, of_damage);
    let odd = |row: &usize| size(*row) > ODD_SIGMA && !hangs(row) && !is_right(row) && !is_all(row);
    let mut clear: Vec<usize> = (0..case.n()).filter(odd).collect();
    clear.sort_by(|a, b| size(*b).total_cmp(&size(*a)));
    // In each file one row in twenty, including those already known.
    let wrong = |set: usize| case.data[set].shared.wrong.len();
    let mut left: Vec<usize> =
        (0..case.data.len()).map(|set| case.rows(set).len().div_ceil(ONE_IN).saturating_sub(wrong(set))).collect();
    clear.retain(|row| {
        let left = &mut left[case.set_of[*row]];
        let may_be = *left > 0;
        *left -= usize::from(may_be);
        may_be
    });
    let explained = |rows: &[usize]| {
        let here: Vec<(usize, f64)> = rows.iter().map(|&row| (row, node.residuals[row])).collect();
        // A parameter may be determined by several rows together and by none of them alone.
        if are_neighbours_alike(&here) || holdout::least_seen(node, rows) < 1.0 - HANGS_ON_IT {
            return None;
        }
        let off = holdout::left_out(node, rows)?;
        let far: Vec<(usize, f64)> = rows.iter().copied().zip(off.iter().copied()).collect();
        if noise::share_a_condition(case, &far) {
            return None;
        }
        let fall: f64 = rows.iter().zip(off.iter()).map(|(&row, off)| node.residuals[row] * off).sum();
        let freedom = node.freedom() - rows.len() as f64;
        let above = if node.added.len() > 1 { AS_NOISE } else { NEARLY };
        (node.chi2_of_rows() - fall < freedom + above * (2.0 * freedom).sqrt()).then_some((fall, off))
    };
    let least = (1..=clear.len()).find_map(|count| explained(&clear[..count]).map(|found| (&clear[..count], found)));
    let (rows, (fall, off)) = least?;
    let with = node.added.iter().filter_map(|added| added.key.split('.').nth(1)).map(str::to_string).collect();
    let each = rows.iter().zip(off.iter()).map(|(&row, off)| (named(case, row), *off)).collect();
    let rows: Vec<(usize, f64)> = rows.iter().copied().zip(off.iter().copied()).collect();
    Some(Odd { fall: fall - 2.0 * rows.len() as f64, rows, reason: Reason::OddRows { rows: each, with } })
}

/// Whether neighbours among rows, each with its residual, have the same sign: these are no accidents of single rows.
pub(super) fn are_neighbours_alike(rows: &[(usize, f64)]) -> bool {
    rows.iter().any(|a| rows.iter().any(|b| a.0.abs_diff(b.0) == 1 && a.1 * b.1 > 0.0))
}

/// Whether a row alone has the lowest or highest value of a condition in its file. It may then be all that shows an effect, such as
/// an event before the second epoch.
pub(super) fn is_alone_at_an_end(case: &Case, place: usize) -> bool {
    is_alone_at_an_end_of(case, place, |_| true)
}

/// The same for some conditions.
fn is_alone_at_an_end_of(case: &Case, place: usize, wanted: impl Fn(&str) -> bool) -> bool {
    let (set, row) = (&case.data[case.set_of[place]], place - case.rows(case.set_of[place]).start);
    set.varying.iter().filter(|name| wanted(name) && !set.is_words(name)).any(|name| {
        let values = set.against(name);
        let others = || values.iter().enumerate().filter(|(other, _)| *other != row).map(|(_, value)| *value);
        others().all(|value| value > values[row]) || others().all(|value| value < values[row])
    })
}

/// Decrease of chi2 of a model without some rows, each counted as a parameter. If the other rows do not predict these, chi2 does
/// not decrease.
pub(super) fn fall_without(node: &Node, rows: &[(usize, f64)]) -> f64 {
    let places: Vec<usize> = rows.iter().map(|(row, _)| *row).collect();
    let off = holdout::left_out(node, &places);
    let fall = off.map_or(0.0, |off| places.iter().zip(off.iter()).map(|(&row, off)| node.residuals[row] * off).sum());
    fall - 2.0 * rows.len() as f64
}

/// Errors smaller than a scatter without trends.
pub(super) fn sigma_too_small(case: &Case, node: &Node) -> Reason {
    let (mut file, mut worst) = (String::new(), 0.0);
    for (index, set) in case.data.iter().enumerate() {
        let rows = case.rows(index);
        let chi2: f64 = rows.clone().map(|row| node.residuals[row].powi(2)).sum();
        let factor = (chi2 / (rows.len() as f64 * node.freedom() / case.n() as f64).max(1.0)).sqrt();
        if factor > worst {
            worst = factor;
            file = set.file.clone();
        }
    }
    Reason::SmallErrors { file, factor: worst }
}
