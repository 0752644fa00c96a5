//! Sets of effects ranked by their evidence: what a verdict was read from.

use serde::Serialize;

use super::explanation::Explanation;
use super::hypothesis::Hypothesis;
use super::set_search::{Searched, SetSearch, WithLaw};
use super::verdict::{self, Named};
use crate::analysis::likelihood::{Errors, Likelihood};
use crate::analysis::measurement::DataSet;

/// Sets listed: −2 ln Z within this of the best, 22 000 to 1; and the mission as given.
const LISTED: f64 = 20.0;

/// Sets of effects, best evidence first.
#[derive(Clone, Debug, Serialize)]
pub struct Ranking {
    /// The sets, best first; the mission as given, without an effect, is always among them.
    pub sets: Vec<RankedSet>,
    /// Difference of −2 ln Z from which one set is decided against another.
    pub decided: f64,
    /// The effects of the set that is named: the best, or the smallest of its special cases that is not decided against.
    pub named: Vec<String>,
    /// Sets that are not decided against, none larger than that one.
    pub rivals: Vec<Vec<String>>,
    /// Share of each effect: the probability, among the sets listed, of those that contain it.
    pub shares: Vec<EffectShare>,
    /// The best law of the measurement itself.
    pub law: Option<RankedLaw>,
    /// Other values of numbers of the mission, the best first.
    pub numbers: Vec<RankedLaw>,
}

/// One set of effects.
#[derive(Clone, Debug, Serialize)]
pub struct RankedSet {
    /// Its effects; empty for the mission as given.
    pub effects: Vec<String>,
    /// Excess of −2 ln Z over the best.
    pub excess: f64,
    /// −2 ln Z.
    pub minus_2_ln_z: f64,
    /// −2 ln L at the likeliest parameters and errors.
    pub minus_2_ln_l: f64,
    /// Free parameters at their likeliest values.
    pub parameters: Vec<Likeliest>,
    /// The likeliest errors of each file.
    pub noise: Vec<FileErrors>,
}

/// A parameter at its likeliest value.
#[derive(Clone, Debug, Serialize)]
pub struct Likeliest {
    /// Dotted key.
    pub key: String,
    /// Unit of the value; empty for pure numbers.
    pub unit: &'static str,
    /// The value.
    pub value: f64,
}

/// The errors of a file as they are likeliest for a set.
#[derive(Clone, Debug, Serialize)]
pub struct FileErrors {
    /// The file as given.
    pub file: String,
    /// True errors over quoted ones.
    pub scale: f64,
    /// Correlation of neighbours in a trail or a time series.
    pub correlation: f64,
    /// A constant of all values, in their unit; None if the file carries none.
    pub pedestal: Option<f64>,
    /// Lines of rows that are wrong; for a table that was not read from a file, row numbers from 1.
    pub outliers: Vec<usize>,
}

/// The share of an effect.
#[derive(Clone, Debug, Serialize)]
pub struct EffectShare {
    /// The effect.
    pub effect: String,
    /// Its share, 0 to 1.
    pub share: f64,
}

/// A law of the measurement itself.
#[derive(Clone, Debug, Serialize)]
pub struct RankedLaw {
    /// As a formula, or in words.
    pub expression: String,
    /// Effects beside it.
    pub beside: Vec<String>,
    /// Excess of −2 ln Z over the best set; negative if the law is better.
    pub excess: f64,
    /// Whether it is clearly better than every set: it imitates almost any physics, so less says nothing.
    pub is_clearly_better: bool,
}

impl Ranking {
    /// Of everything that was fitted to some data.
    pub(super) fn of(search: &SetSearch, searched: &Searched, named: &Named) -> Ranking {
        let (hypotheses, data) = (search.hypotheses, search.fitter.case.data);
        let names = |set: &[usize]| set.iter().map(|place| hypotheses[*place].name.clone()).collect::<Vec<String>>();
        let best = searched.sets.iter().map(Explanation::minus_2_ln_z).fold(f64::INFINITY, f64::min);
        let is_listed = |one: &&Explanation| one.minus_2_ln_z() < best + LISTED || one.added.is_empty();
        let listed: Vec<&Explanation> = searched.sets.iter().filter(is_listed).collect();
        let ranked_law = |law: &WithLaw, is_clearly_better: bool| RankedLaw {
            expression: law.law.expression(),
            beside: names(&law.beside),
            excess: law.minus_2_ln_z - best,
            is_clearly_better,
        };
        let likelihood = search.fitter.likelihood;
        Ranking {
            decided: verdict::DECIDED,
            named: names(&named.adopted.set()),
            rivals: named.rivals.iter().map(|rival| names(&rival.set())).collect(),
            shares: shares(&listed, hypotheses, best),
            law: searched.law.as_ref().map(|law| ranked_law(law, named.law_is_better)),
            numbers: searched.numbers.iter().map(|number| ranked_law(number, named.number_is_better)).collect(),
            sets: listed.iter().map(|one| ranked(one, names(&one.set()), data, likelihood, best)).collect(),
        }
    }
}

fn ranked(one: &Explanation, effects: Vec<String>, data: &[DataSet], likelihood: &Likelihood, best: f64) -> RankedSet {
    let likeliest = one.unknowns.iter().map(|unknown| Likeliest {
        key: unknown.parameter.key.clone(),
        unit: unknown.parameter.unit,
        value: unknown.parameter.start,
    });
    let of_file = |(index, errors): (usize, &Errors)| {
        let set = &data[index];
        let pedestal = likelihood.pedestal(index, errors).filter(|_| errors.has_pedestal);
        FileErrors {
            file: set.file.clone(),
            scale: errors.scale,
            correlation: errors.correlation,
            pedestal: pedestal.map(|(value, _)| value),
            outliers: errors.wrong().map(|row| set.table.lines.get(row).copied().unwrap_or(row + 1)).collect(),
        }
    };
    RankedSet {
        effects,
        excess: one.minus_2_ln_z() - best,
        minus_2_ln_z: one.minus_2_ln_z(),
        minus_2_ln_l: one.minus_2_ln_l,
        parameters: likeliest.collect(),
        noise: one.errors.iter().enumerate().map(of_file).collect(),
    }
}

/// Probabilities of the effects of some sets, the largest first.
fn shares(listed: &[&Explanation], hypotheses: &[Hypothesis], best: f64) -> Vec<EffectShare> {
    let weight = |one: &&&Explanation| (-0.5 * (one.minus_2_ln_z() - best)).exp();
    let all: f64 = listed.iter().map(|one| weight(&one)).sum();
    let of = |place: usize| {
        let with = listed.iter().filter(|one| one.set().contains(&place));
        EffectShare { effect: hypotheses[place].name.clone(), share: with.map(|one| weight(&one)).sum::<f64>() / all }
    };
    let mut shares: Vec<EffectShare> = (0..hypotheses.len()).map(of).filter(|one| one.share > 0.0).collect();
    shares.sort_by(|a, b| b.share.total_cmp(&a.share));
    shares
}
