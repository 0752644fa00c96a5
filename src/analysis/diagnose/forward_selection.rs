//! From the base to a model that meets the stopping rule: one effect at a time on top of the best few models, then two at once.

use std::sync::Arc;

use nalgebra::DVector;
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::data_quality::Odd;
use super::evidence::{Ended, Evidence, Found};
use super::fitted_model::{Added, Node};
use super::pairs::{self, Pair};
use super::result::{Reason, Verdict};
use super::search::{BREADTH, LINES, Sketch};
use super::{data_quality, rivals};
use crate::error::InputError;
use crate::numeric::parallel;

/// Effects added at most.
const MOST: usize = 3;

/// Probability of a larger chi2 by noise, below which the model may stand for two effects, and alternatives are tested.
const DOUBTFUL: f64 = 0.05;

/// Most promising effects, of which one is added before the errors are estimated from the residuals.
const NEAREST: usize = 4;

/// Share of the decrease of chi2 within which two models make the same predictions for the data.
const THE_SAME: f64 = 0.02;

/// Decrease of chi2, relative to the residual chi2 per degree of freedom, below which an effect is weak.
const WEAK: f64 = 20.0;

/// Decrease of chi2 that any effect reaches by chance.
const NO_GAIN: f64 = 4.0;

/// Share of the excess of chi2 that may remain after another effect for one more to be tried.
const WORTH_GOING_ON: f64 = 0.5;

/// How much lower chi2 plus its penalties must be with rows left out than with additional effects, for the rows to be wrong.
const MUCH_SIMPLER: f64 = 15.0;

impl Evidence<'_> {
    /// Searches until a model meets the stopping rule, or nothing more helps.
    pub(super) fn select(&self) -> Result<Found, InputError> {
        let hypotheses = self.search.hypotheses.len() as u64;
        (self.search.progress.stage)("every effect", 2 * hypotheses);
        self.search.expand(self.base);
        if self.is_enough(self.base)? {
            // Errors estimated from rows among which one is wrong hide it.
            return match data_quality::odd_rows(self.case(), self.base) {
                Some(odd) => Ok(self.unfit_for(odd)),
                None => self.complete(Reason::Explained),
            };
        }
        let mut tried = vec![self.base.clone()];
        let ended = self.lines(&mut tried)?;
        let (found, by_chance) = match ended {
            Ended::Adopted(found) => (Some(*found), false),
            Ended::ByChance => (None, true),
            Ended::Nothing | Ended::Outdone => (None, false),
        };
        if let Some(odd) = self.odd_rows(found.as_ref(), &tried) {
            return Ok(self.unfit_for(odd));
        }
        match found {
            Some(found) => Ok(found),
            None if self.mere_noise(self.base)?.is_some() => {
                self.complete(Reason::Noise { best: self.most_helpful(&tried) })
            }
            None if by_chance => Ok(self.undecided(&tried)),
            None => match self.enough_but_for_noise(&tried)? {
                Some(found) => Ok(found),
                None => self.unexplained(&tried),
            },
        }
    }

    /// Wrong rows, without which the search is to be repeated.
    fn unfit_for(&self, odd: Odd) -> Found {
        Found { wrong: odd.rows, ..Found::of(Verdict::Unfit, odd.reason, vec![self.base.clone()]) }
    }

    /// The simplest model that leaves only noise, if every further effect was found to be possible noise.
    fn enough_but_for_noise(&self, tried: &[Arc<Node>]) -> Result<Option<Found>, InputError> {
        for effects in 1..=MOST {
            let nodes = tried.iter().filter(|node| node.added.len() == effects);
            let Some(best) = nodes.min_by(|a, b| self.score(a).total_cmp(&self.score(b))) else { continue };
            let best = self.search.settled(best)?;
            if self.mere_noise(&best)?.is_none() {
                continue;
            }
            if let Ended::Adopted(found) = self.adopt(&best)? {
                return Ok(Some(*found));
            }
        }
        Ok(None)
    }

    /// The effects that gain most of those tried, and the decrease of chi2 with them: more than noise usually does, but not confirmed.
    fn most_helpful(&self, tried: &[Arc<Node>]) -> Option<(Vec<String>, f64)> {
        let best =
            tried.iter().filter(|node| !node.added.is_empty()).min_by(|a, b| self.score(a).total_cmp(&self.score(b)));
        best.map(|best| {
            let names: Vec<String> = best.set().into_iter().map(|place| self.name(place)).collect();
            (names, self.base.chi2() - best.chi2())
        })
    }

    /// The base leaves more than the errors, and an effect that explains it gains no more than errors that are too small would: no
    /// verdict, since either may be true.
    fn undecided(&self, tried: &[Arc<Node>]) -> Found {
        let (effects, fall) = self.most_helpful(tried).unwrap_or_default();
        let reason = Reason::Undecided { effects, fall, chi2: self.base.chi2(), n: self.case().n() };
        Found::of(Verdict::Unfit, reason, vec![self.base.clone()])
    }

    /// Adds one effect at a time to the best few models, from the base on, until one is adopted. All models are kept.
    fn lines(&self, tried: &mut Vec<Arc<Node>>) -> Result<Ended, InputError> {
        let hypotheses = self.search.hypotheses.len() as u64;
        let mut lines = vec![self.base.clone()];
        let mut outdone = false;
        for depth in 1..=MOST {
            let mut nodes: Vec<Arc<Node>> = Vec::new();
            // Once a model was outdone, the best line need not lead to the best model: all are followed before one is adopted.
            let all_first = std::mem::take(&mut outdone);
            for line in &lines {
                if depth > 1 {
                    if !self.work().allows(["", "", "two effects", "three effects"][depth]) {
                        break;
                    }
                    (self.search.progress.stage)("several effects", hypotheses + BREADTH as u64);
                }
                let further = self.further(line, if depth == 1 { usize::MAX } else { BREADTH })?;
                let ended = if all_first { Ended::Nothing } else { self.success(&further, &nodes)? };
                nodes.extend(further);
                outdone |= matches!(ended, Ended::Outdone);
                // Several effects are only as certain as the least certain of them, so the search goes on.
                if matches!(ended, Ended::Adopted(_)) || (matches!(ended, Ended::ByChance) && depth == 1) {
                    tried.extend(nodes);
                    return Ok(ended);
                }
            }
            if all_first {
                self.sort(&mut nodes);
                if let Ended::Adopted(found) = self.success(&nodes, &[])? {
                    tried.extend(nodes);
                    return Ok(Ended::Adopted(found));
                }
            }
            if depth == 2 && self.work().allows("pairs of effects of which neither helps alone") {
                let pairs = self.pairs(&lines, &nodes)?;
                if let Ended::Adopted(found) = self.success(&pairs, &nodes)? {
                    return Ok(Ended::Adopted(found));
                }
                nodes.extend(pairs);
            }
            self.sort(&mut nodes);
            nodes.dedup_by(|a, b| a.set() == b.set());
            // Two models that differ by one wrong row alone make nearly the same predictions.
            tried.extend(nodes.iter().cloned());
            self.unlike(&mut nodes);
            let Some(best) = nodes.first() else { break };
            let excess = |node: &Node| (node.chi2() - node.freedom()).max(0.0);
            let helped = excess(best) < WORTH_GOING_ON * excess(&lines[0]);
            // chi2 and residual trends are those of noise; the only sign of an effect was not confirmed by its fit.
            if depth == 1 && self.mere_noise(self.base)?.is_some() {
                break;
            }
            // Two effects may be needed although one is of little use. Three are not tried if the second was of little use.
            if depth > 1 && !helped {
                break;
            }
            nodes.truncate(LINES);
            lines = nodes;
        }
        Ok(Ended::Nothing)
    }

    /// Wrong rows, if they explain the data more simply than the effects found; a row left out counts as a parameter. The model
    /// with the fewest effects decides. The one adopted last is also tested for rows that were hidden by errors overestimated
    /// because of them.
    pub(super) fn odd_rows(&self, found: Option<&Found>, tried: &[Arc<Node>]) -> Option<Odd> {
        let adopted = found.and_then(|found| found.ladder.last());
        let no_more = tried.iter().filter(|node| adopted.is_none_or(|adopted| node.added.len() <= adopted.added.len()));
        let odd = no_more.filter_map(|node| data_quality::odd_rows(self.case(), node).map(|odd| (node, odd)));
        let mut odd: Vec<(&Arc<Node>, Odd)> = odd.collect();
        let without = |(node, odd): &(&Arc<Node>, Odd)| self.score(node) - odd.fall;
        odd.sort_by(|a, b| a.0.added.len().cmp(&b.0.added.len()).then(without(a).total_cmp(&without(b))));
        let own = adopted.and_then(|node| data_quality::odd_rows(self.case(), node).map(|odd| (node, odd)));
        let clear =
            |one: &(&Arc<Node>, Odd)| adopted.is_none_or(|adopted| self.are_to_blame(without(one), one, adopted));
        odd.into_iter().chain(own).find(clear).map(|(_, odd)| odd)
    }

    /// Whether rows rather than missing effects explain the data: `score` is that of a model without the rows, `adopted` the model
    /// with effects.
    fn are_to_blame(&self, score: f64, (node, odd): &(&Arc<Node>, Odd), adopted: &Arc<Node>) -> bool {
        let margin = rivals::margin(self.options.level);
        let adopted_without = self.score(adopted) - data_quality::fall_without(adopted, &odd.rows);
        if node.set() == adopted.set() {
            return true;
        }
        // Without the rows the adopted effects gain no more than noise would, or are worse than as many others.
        let simpler = node.added.len() < adopted.added.len();
        let gains_nothing = if simpler { score < adopted_without + margin } else { score + margin < adopted_without };
        let surrounded = !odd.rows.iter().any(|(row, _)| data_quality::is_alone_at_an_end(self.case(), *row));
        (surrounded && gains_nothing) || (simpler && score + MUCH_SIMPLER < self.score(adopted))
    }

    /// The best models with one more effect, fitted in full.
    fn further(&self, line: &Arc<Node>, breadth: usize) -> Result<Vec<Arc<Node>>, InputError> {
        let expansion = self.search.expand(line);
        let mut wanted = expansion.promising();
        // For a single effect, far from the data, the first order may be wrong; on top of others it is not.
        wanted.retain(|place| line.added.is_empty() || expansion.gain(*place) > NO_GAIN);
        wanted.truncate(breadth);
        let sketches = self.search.sketches(&expansion, &wanted);
        let gaining = sketches.iter().filter(|sketch| sketch.chi2 < line.chi2() - NO_GAIN).enumerate();
        // The best is always fitted in full.
        let allowed =
            gaining.take_while(|(place, _)| *place == 0 || self.work().allows("full fits of further effects"));
        let polish = |(_, sketch): (usize, &Sketch)| self.search.node(sketch, line);
        let mut nodes = allowed.map(polish).collect::<Result<Vec<_>, _>>()?;
        self.sort(&mut nodes);
        Ok(nodes)
    }

    /// The best models with two effects more than the base, fitted in full. Both effects are new to the lines carried on, or, in a
    /// few further pairs, one or both are known: two effects together may have another optimum than one of them alone. Pairs whose
    /// residuals equal those of a tried model, to first order, are omitted.
    fn pairs(&self, lines: &[Arc<Node>], tried: &[Arc<Node>]) -> Result<Vec<Arc<Node>>, InputError> {
        let expansion = self.search.expand(self.base);
        let carried_on: Vec<usize> = lines.iter().flat_map(|line| line.set()).collect();
        let mut known: Vec<DVector<f64>> = tried.iter().map(|node| node.residuals.clone()).collect();
        let is_new = |a: usize, b: usize| !carried_on.contains(&a) && !carried_on.contains(&b);
        let mut best = |wanted: &dyn Fn(usize, usize) -> bool, most: usize| {
            let mut pairs = pairs::promising(&expansion, self.search.hypotheses, wanted);
            pairs.retain(|pair| {
                let same =
                    |known: &DVector<f64>| (known - &pair.left).norm_squared() <= NO_GAIN.max(THE_SAME * pair.gain);
                let new = !known.iter().any(same);
                if new {
                    known.push(pair.left.clone());
                }
                new
            });
            pairs.truncate(most);
            pairs
        };
        let mut wanted = best(&is_new, BREADTH);
        wanted.extend(best(&|a, b| !is_new(a, b), BREADTH / 2));
        let sketch = |pair: &Pair| self.search.sketch_of(self.base, &pair.trials);
        let sketches: Vec<Sketch> = parallel::map(&wanted, sketch).into_iter().flatten().collect();
        let polish = |sketch: &Sketch| self.search.node(sketch, self.base);
        let mut nodes = sketches.iter().map(polish).collect::<Result<Vec<_>, _>>()?;
        self.sort(&mut nodes);
        Ok(nodes)
    }

    /// Whether all effects are weak: none gains more from the residuals of the base than noise allows. The first order of all
    /// effects is projected out before errors are estimated, and weak effects change nothing beyond it. The noise is measured by
    /// what an effect leaves: with few rows, one effect may explain nearly all residuals of the base.
    fn is_near(&self) -> bool {
        let expansion = self.search.expand(self.base);
        let is_weak = |place: usize| {
            let (gain, parameters) = (expansion.gain(place), expansion.parameters(place) as f64);
            let freedom = (self.base.freedom() - parameters).max(1.0);
            gain < WEAK * ((self.base.chi2() - gain) / freedom).max(1.0)
        };
        !self.base.has_pedestal() && (0..expansion.trials.len()).all(is_weak)
    }

    /// The models with at most one effect that are nearest to the data, the best first. Their residuals are closer to noise than
    /// those of a base that lacks much.
    pub(super) fn nearest(&self) -> Result<Vec<Arc<Node>>, InputError> {
        let mut nodes = if self.is_near() { Vec::new() } else { self.further(self.base, NEAREST)? };
        nodes.push(self.base.clone());
        self.sort(&mut nodes);
        Ok(nodes)
    }

    /// Whether another model of similar score, or one that the search would carry on, is much nearer to the data than this one when
    /// it gets one more effect, or the base when it gets two at once. Tested only for a model that leaves more than noise usually
    /// does: it may stand for several effects, none of which improves it.
    fn is_outdone(&self, node: &Arc<Node>, others: &[Arc<Node>]) -> bool {
        let chance = ChiSquared::new(node.freedom()).map_or(1.0, |law| law.sf(node.chi2()));
        if chance > DOUBTFUL {
            return false;
        }
        let margin = rivals::margin(self.options.level);
        let near = self.score(node) + margin;
        let others = others.iter().filter(|other| other.set() != node.set()).enumerate();
        let mut others =
            others.filter(|(place, other)| *place < LINES || self.score(other) < near).map(|(_, other)| other);
        let most = node.chi2() + self.cost(node) - margin;
        let is_much_nearer = |sketch: &Sketch, from: &Node| {
            let more = &sketch.added[from.added.len()..];
            let cost = |added: &Added| self.choice() + 2.0 * added.free.len() as f64;
            sketch.chi2 + self.cost(from) + more.iter().map(cost).sum::<f64>() < most
        };
        let with_one_more = |other: &Arc<Node>| {
            let expansion = self.search.expand(other);
            let mut wanted = expansion.promising();
            wanted.truncate(BREADTH);
            self.search.sketches(&expansion, &wanted).iter().any(|sketch| is_much_nearer(sketch, other))
        };
        let expansion = self.search.expand(self.base);
        let promises = |pair: &Pair| self.base.chi2() - pair.gain + self.cost(self.base) + 2.0 * self.choice() < most;
        let pairs = pairs::promising(&expansion, self.search.hypotheses, |_, _| true);
        let pairs: Vec<Pair> = pairs.into_iter().take_while(promises).take(BREADTH).collect();
        let with_two = |pair: &Pair| self.search.sketch_of(self.base, &pair.trials);
        parallel::map(&pairs, with_two).iter().flatten().any(|sketch| is_much_nearer(sketch, self.base))
            || others.any(with_one_more)
    }

    /// Omits models with the same predictions as a better one: equivalents of the adopted effect are tried at the end (`rivals`),
    /// and would take the place of other lines here.
    fn unlike(&self, nodes: &mut Vec<Arc<Node>>) {
        let mut kept: Vec<Arc<Node>> = Vec::new();
        for node in nodes.drain(..) {
            let fall = (self.base.chi2() - node.chi2()).max(0.0);
            let same =
                |other: &Arc<Node>| (&node.residuals - &other.residuals).norm_squared() < NO_GAIN.max(THE_SAME * fall);
            if !kept.iter().any(same) {
                kept.push(node);
            }
        }
        *nodes = kept;
    }

    fn sort(&self, nodes: &mut [Arc<Node>]) {
        nodes.sort_by(|a, b| self.score(a).total_cmp(&self.score(b)).then(a.set().cmp(&b.set())));
    }

    /// The first of the best of some models that meets the stopping rule, adopted; `others` have as many effects.
    fn success(&self, nodes: &[Arc<Node>], others: &[Arc<Node>]) -> Result<Ended, InputError> {
        let mut all = [nodes, others].concat();
        self.sort(&mut all);
        all.dedup_by(|a, b| a.set() == b.set());
        let mut outdone = false;
        let Some(best) = nodes.first() else { return Ok(Ended::Nothing) };
        let near = self.score(best) + rivals::margin(self.options.level);
        for (place, node) in nodes.iter().filter(|node| self.score(node) < near).take(LINES).enumerate() {
            if place > 0 && !self.work().allows("other models that are as near to the data") {
                break;
            }
            let node = self.search.settled(node)?;
            if !self.is_enough(&node)? {
                continue;
            }
            if !self.is_outdone(&node, &all) {
                return self.adopt(&node);
            }
            outdone = true;
        }
        Ok(if outdone { Ended::Outdone } else { Ended::Nothing })
    }
}
