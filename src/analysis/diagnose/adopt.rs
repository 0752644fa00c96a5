//! Which effects of a model are real: significance, groups left out, rivals.

use std::sync::Arc;

use super::evidence::{Ended, Evidence, Found};
use super::fitted_model::Node;
use super::result::{Note, Reason, Verdict};
use super::search::Sketch;
use super::significance::Noise;
use super::{experiment_design, holdout, limits, noise, rivals};
use crate::error::InputError;

/// Effects that are fitted in place of pedestals.
const IN_PLACE: usize = 3;

/// An effect that explains pedestals of the base.
struct InPlace {
    sketch: Sketch,
    /// Files that need no pedestal with it.
    files: Vec<String>,
    /// It has fewer parameters than there are such files.
    simpler: bool,
    /// In one of them the constant is most of the values.
    are_most: bool,
}

impl Evidence<'_> {
    /// The models from the base to one with several effects, each time adding first the effect with the larger gain.
    pub(super) fn ladder(&self, node: &Arc<Node>) -> Result<Vec<Arc<Node>>, InputError> {
        let mut rest: Vec<usize> = node.added.iter().map(|added| added.hypothesis).collect();
        let mut ladder = vec![self.base.clone()];
        let mut chosen: Vec<usize> = Vec::new();
        while !rest.is_empty() {
            let mut best: Option<(usize, Arc<Node>)> = None;
            for (place, &next) in rest.iter().enumerate() {
                let with: Vec<usize> = chosen.iter().copied().chain([next]).collect();
                let candidate = if rest.len() == 1 { node.clone() } else { self.search.with(self.base, &with)? };
                if best.as_ref().is_none_or(|(_, best)| candidate.chi2() < best.chi2()) {
                    best = Some((place, candidate));
                }
            }
            let (place, next) = best.expect("something is left");
            chosen.push(rest.remove(place));
            ladder.push(next);
        }
        Ok(ladder)
    }

    /// The fitted model without one of its effects (by its index among those added).
    pub(super) fn without(&self, node: &Node, place: usize) -> Result<Arc<Node>, InputError> {
        self.search.without(self.base, node, place)
    }

    /// Probability that noise alone makes an effect of a model look as good, given its other effects and the residual noise. If
    /// there are other effects, or too few rows for an estimate of their errors, it is also computed for errors of all rows that are
    /// wrong by a common factor, the likeliest one of each model: the residuals without the effect may only show that the errors are
    /// too small.
    pub(super) fn false_alarm(&self, node: &Node, place: usize) -> Result<f64, InputError> {
        let parent = self.without(node, place)?;
        let noise = Noise::left_at(self.case(), node);
        let null = self.search.null(&parent, &noise);
        let added = &node.added[place];
        let gain = parent.gain_of(node.chi2(), &node.pedestal_costs, added.free.len());
        let alarm = null.false_alarm(added.hypothesis, gain);
        let quoted = Noise::of(self.case());
        let errors_hold = parent.added.is_empty() && self.case().n() >= noise::FEW;
        if errors_hold || !quoted.is_as_quoted() {
            return Ok(alarm);
        }
        // −2 ln of the likelihood ratio with a common scale of all errors free in both; Fisher's F to a few per cent.
        let with_scale = node.freedom() * (gain.max(0.0) / node.chi2_of_rows()).ln_1p();
        Ok(alarm.max(self.search.null(&parent, &quoted).false_alarm(added.hypothesis, with_scale)))
    }

    /// Whether that probability is too large for the effect to be adopted.
    pub(super) fn may_be_noise(&self, node: &Node, place: usize) -> Result<bool, InputError> {
        let parent = self.without(node, place)?;
        Ok(self.false_alarm(node, place)? > self.level(&parent))
    }

    /// Whether a model also predicts rows left out better than without one of its effects.
    pub(super) fn confirmed(&self, node: &Node, place: usize) -> Result<bool, InputError> {
        let parent = self.without(node, place)?;
        let better = |groups| holdout::surprise_of_all(groups, node) < holdout::surprise_of_all(groups, &parent);
        Ok(self.groups().is_none_or(better))
    }

    /// The effect that would best explain the pedestals of the base, if any. A change that one pedestal could make is no evidence
    /// for an effect, nor against one.
    fn in_place_of_pedestals(&self) -> Option<InPlace> {
        if !self.base.has_pedestal() || !self.work().allows("effects in the place of pedestals") {
            return None;
        }
        let mut wanted = self.search.promising_without_pedestals(self.base);
        wanted.truncate(IN_PLACE);
        let sketches = self.search.sketches(&self.search.expand(self.base), &wanted);
        let parameters = |sketch: &Sketch| sketch.added.last().map_or(0, |added| added.free.len());
        let score = |sketch: &Sketch| sketch.chi2 + 2.0 * parameters(sketch) as f64;
        let best = sketches.into_iter().min_by(|a, b| score(a).total_cmp(&score(b)))?;
        let costs = self.base.pedestal_costs.iter().zip(&best.pedestal_costs);
        let without = costs.enumerate().filter(|(_, (before, with))| **before > 0.0 && **with == 0.0);
        let files: Vec<String> = self.case().pedestal_files(without.map(|(place, _)| place));
        let clear = score(&best) + rivals::margin(self.options.level) < self.base.chi2();
        let simpler = parameters(&best) < files.len();
        let dominated = noise::dominated_by_pedestals(self.case(), self.base);
        let are_most = files.iter().any(|file| dominated.contains(file));
        (clear && !files.is_empty()).then_some(InPlace { sketch: best, files, simpler, are_most })
    }

    /// The base explains the data, unless an effect explains its pedestals with fewer parameters.
    pub(super) fn complete(&self, reason: Reason) -> Result<Found, InputError> {
        let mut found = Found::of(Verdict::Complete, reason, vec![self.base.clone()]);
        match self.in_place_of_pedestals() {
            Some(in_place) if in_place.simpler || in_place.are_most => return self.instead_of_pedestals(in_place),
            Some(InPlace { sketch, files, .. }) => {
                let fall = self.base.chi2() - sketch.chi2;
                found.aside.push(Note::InPlaceOfPedestals { effect: self.name(sketch.last()), files, fall });
            }
            None => (),
        }
        Ok(found)
    }

    /// Adds to a verdict what complete data would have shown, or, if there are rivals, the measurement that would distinguish them.
    pub(super) fn explain(&self, found: &mut Found) -> Result<(), InputError> {
        let node = found.ladder.last().expect("the base");
        if found.verdict == Verdict::Complete {
            found.limits = limits::all(self.search, self.base, self.options.level)?;
            if !found.limits.is_empty() && found.limits.iter().all(|limit| limit.table.is_none()) {
                found.aside.push(Note::NothingDetectable);
            }
        }
        if let Some(rival) = found.rivals.first() {
            found.next = experiment_design::best(self.search, node, &rival.node, &found.rivals, &self.options.can)?;
        }
        Ok(())
    }

    /// An effect with fewer parameters than the pedestals that it explains: independent constants would rarely agree with it.
    fn instead_of_pedestals(&self, in_place: InPlace) -> Result<Found, InputError> {
        let node = self.search.settled(&*self.search.node(&in_place.sketch, self.base)?)?;
        let (node, rivals::Around { rivals, aside }) = rivals::of(self, &node)?;
        let adopted = node.set();
        let reason = Reason::LackingOrPedestals {
            effect: self.name(adopted[0]),
            files: in_place.files,
            are_most: in_place.are_most,
        };
        let mut found = Found::of(Verdict::Ambiguous, reason, self.ladder(&node)?);
        let all = distinct(adopted.into_iter().chain(rivals.iter().map(|rival| rival.hypothesis)));
        found.alternatives = vec![all.into_iter().map(|place| self.name(place)).collect()];
        (found.rivals, found.aside) = (rivals, aside);
        Ok(found)
    }

    /// Adopts a model that explains the data, unless noise or a few rows alone account for it.
    pub(super) fn adopt(&self, node: &Arc<Node>) -> Result<Ended, InputError> {
        for place in 0..node.added.len() {
            if self.may_be_noise(node, place)? {
                // The model without it may explain the data; perhaps only the values of the larger one have led there.
                let simpler = self.without(node, place)?;
                let is_enough = !simpler.added.is_empty() && self.is_enough(&simpler)?;
                return if is_enough { self.adopt(&simpler) } else { Ok(Ended::ByChance) };
            }
        }
        let (node, rivals::Around { rivals, aside }) = rivals::of(self, node)?;
        for place in 0..node.added.len() {
            if self.may_be_noise(&node, place)? || !self.confirmed(&node, place)? {
                return Ok(Ended::Nothing);
            }
        }
        if self.better_law(&node).is_some() {
            return Ok(Ended::Nothing);
        }
        let effects = node.added.iter().map(|added| self.name(added.hypothesis)).collect();
        let reason = Reason::Lacking { effects, has_rivals: !rivals.is_empty() };
        let mut found = Found::of(Verdict::Missing, reason, self.ladder(&node)?);
        if !rivals.is_empty() {
            found.verdict = Verdict::Ambiguous;
            // An effect that was added twice may have the same rivals both times.
            for adopted in distinct(node.added.iter().map(|added| added.hypothesis)) {
                let of_it = rivals.iter().filter(|rival| rival.instead_of == adopted);
                let others = distinct(of_it.map(|rival| rival.hypothesis));
                if !others.is_empty() {
                    let names = std::iter::once(adopted).chain(others).map(|place| self.name(place));
                    found.alternatives.push(names.collect());
                }
            }
        }
        (found.rivals, found.aside) = (rivals, aside);
        Ok(Ended::Adopted(Box::new(found)))
    }
}

/// Each index once, in the order of their first occurrence.
fn distinct(indices: impl Iterator<Item = usize>) -> Vec<usize> {
    let mut all = Vec::new();
    for index in indices {
        if !all.contains(&index) {
            all.push(index);
        }
    }
    all
}
