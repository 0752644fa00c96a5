//! Intervals by profile likelihood.
//!
//! A parameter θ is fixed at one value after another, and all other free parameters φ are refitted at each:
//!
//! ```text
//! Δχ²(θ) = min over φ of χ²(θ, φ) − χ²(at the optimum)
//! ```
//!
//! With Gaussian noise the values with Δχ² ≤ 1 are an interval of 68.3 % confidence, those with Δχ² ≤ 4 of 95.4 % (Wilks 1938, Ann.
//! Math. Stat. 9, 60; Cash 1976, A&A 52, 307). Each side is followed outwards in growing steps until Δχ² is above, or to the bound,
//! and the crossing is found as a root. Of several crossings on one side, the first one seen by a step is used. The number of fits
//! is limited.

use std::cell::{Cell, RefCell};

use serde::Serialize;

use super::parameter::Parameter;
use super::problem::Problem;
use super::result::{Fit, SAME};
use crate::analysis::measurement::DataSet;
use crate::error::{InputError, nearest};
use crate::model::Model;
use crate::numeric::parallel;
use crate::numeric::root_finding::try_between;

/// Increases of chi2, each with the confidence of its interval.
pub const LEVELS: [(f64, f64); 2] = [(1.0, 0.6827), (4.0, 0.9545)];

/// Maximum number of fits on one side of the optimum.
const FITS: usize = 40;

/// Fits added between the ends of the widest interval, for the curve.
const ADDED: usize = 12;

/// Accuracy of an end: share of its distance from the optimum.
const EXACT: f64 = 1e-3;

/// Smallest and largest factor from one distance to the next.
const GROWTH: (f64, f64) = (1.3, 4.0);

/// Increase of chi2 above which its value does not matter; also used if the model has no value.
const VERY_HIGH: f64 = 1e6;

/// A scan of chi2 along one parameter.
#[derive(Clone, Debug, Serialize)]
pub struct Profile {
    /// Dotted key.
    pub key: String,
    /// Unit of its values; empty for pure numbers.
    pub unit: &'static str,
    /// Value at the optimum.
    pub value: f64,
    /// Intervals, in the order of [`LEVELS`].
    pub intervals: Vec<Interval>,
    /// Values of the parameter, ascending, with the increase of chi2 when all others are refitted.
    pub curve: Vec<CurvePoint>,
    /// Number of fits.
    pub refits: usize,
    /// Lowest chi2 below that of the optimum found on the way, with the parameter's value there; None if there is none.
    pub lower: Option<CurvePoint>,
}

/// A value of the parameter, and chi2 there.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct CurvePoint {
    /// Value, in the unit of the key.
    pub value: f64,
    /// chi2 minus that of the optimum.
    pub delta_chi2: f64,
}

/// A confidence interval.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Interval {
    /// Its confidence, between 0 and 1.
    pub confidence: f64,
    /// Increase of chi2 at its ends.
    pub delta_chi2: f64,
    /// Its lower end.
    pub low: End,
    /// Its upper end.
    pub high: End,
}

/// End of an interval.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(tag = "end", rename_all = "kebab-case")]
pub enum End {
    /// At the value at which chi2 has increased by the requested amount.
    Crossing {
        /// In the unit of the key.
        value: f64,
    },
    /// At a bound of the key: chi2 does not increase that much within the allowed range.
    Bound {
        /// The bound, in the unit of the key.
        value: f64,
    },
    /// Not reached up to this value, where the search ended.
    Undone {
        /// In the unit of the key.
        value: f64,
    },
}

impl End {
    /// The value at which chi2 has increased by the requested amount; None if none was found.
    pub fn crossing(&self) -> Option<f64> {
        match self {
            End::Crossing { value } => Some(*value),
            End::Bound { .. } | End::Undone { .. } => None,
        }
    }
}

/// Scans chi2 along one of the free parameters of a fit.
///
/// # Errors
/// If the key is not among the fitted ones.
pub fn profile(
    model: &Model,
    data: &[DataSet],
    fit: &Fit,
    key: &str,
    progress: &(dyn Fn(f64) + Sync),
) -> Result<Profile, InputError> {
    let keys: Vec<String> = fit.parameters.iter().map(|fitted| fitted.key.clone()).collect();
    let index = place(&keys, key)?;
    let others = (0..fit.parameters.len()).filter(|other| *other != index);
    let scan = Scan {
        model: &model.like(&fit.mission),
        data,
        fit,
        parameter: Parameter::of(&fit.mission, key)?,
        sigma: fit.parameters[index].sigma,
        others: others.clone().map(|other| keys[other].clone()).collect(),
        progress,
    };
    let optimum = Refit {
        coordinate: scan.parameter.coordinate(fit.parameters[index].value),
        rise: 0.0,
        others: others.map(|other| fit.parameters[other].value).collect(),
    };
    let (below, above) = rayon::join(|| Side::of(&scan, &optimum, -1.0), || Side::of(&scan, &optimum, 1.0));
    let ends = below.ends.into_iter().zip(above.ends);
    let interval = |((delta_chi2, confidence), (low, high))| Interval { confidence, delta_chi2, low, high };
    let intervals: Vec<Interval> = LEVELS.into_iter().zip(ends).map(interval).collect();
    let mut refits: Vec<Refit> = below.refits.into_iter().chain(above.refits).chain([optimum]).collect();
    refits.extend(scan.between(&refits, &intervals));
    let made = refits.len() - 1;
    refits.sort_by(|a, b| a.coordinate.total_cmp(&b.coordinate));
    let curve: Vec<CurvePoint> = refits.iter().map(|refit| scan.point(refit)).collect();
    let least = curve.iter().copied().min_by(|a, b| a.delta_chi2.total_cmp(&b.delta_chi2));
    Ok(Profile {
        key: key.to_string(),
        unit: scan.parameter.unit,
        value: fit.parameters[index].value,
        intervals,
        lower: least.filter(|point| point.delta_chi2 < -SAME),
        curve,
        refits: made,
    })
}

/// The index of a key among the free ones.
///
/// # Errors
/// If it is not one of them.
pub fn place(free: &[String], key: &str) -> Result<usize, InputError> {
    free.iter().position(|known| known == key).ok_or_else(|| {
        let problem = format!("it is not free; free are: {}", free.join(", "));
        let refusal = InputError::new(format!("cannot profile `{key}`"), problem);
        match nearest(key, free.iter().map(String::as_str)) {
            Some(near) => refusal.with_help(format!("did you mean `{near}`?")),
            None => refusal.with_help("name it with --free, too"),
        }
    })
}

/// Quantities that are constant while a parameter is moved.
struct Scan<'a> {
    /// With the values at the optimum.
    model: &'a Model,
    data: &'a [DataSet],
    fit: &'a Fit,
    /// The parameter that is moved, and its error.
    parameter: Parameter,
    sigma: Option<f64>,
    /// Keys of all others.
    others: Vec<String>,
    progress: &'a (dyn Fn(f64) + Sync),
}

/// A fit with the parameter fixed.
#[derive(Clone)]
struct Refit {
    /// Its fixed value.
    coordinate: f64,
    /// chi2 minus that of the optimum.
    rise: f64,
    /// Values of the other parameters.
    others: Vec<f64>,
}

impl Scan<'_> {
    /// A fit of the others from a start, with the parameter fixed. If the model has no value, chi2 is very high.
    fn refit(&self, coordinate: f64, start: &[f64]) -> Refit {
        let value = self.parameter.at_coordinate(coordinate);
        let held = [(self.parameter.key.clone(), value.into())];
        let found = self.model.mission.with(&held).and_then(|mission| {
            let model = self.model.like(&mission);
            let problem = Problem::new(&model, self.data, &self.others, self.progress, |_| true)?;
            Ok(problem.with_event_epochs(start))
        });
        let (others, chi2) = found.map_or((start.to_vec(), f64::INFINITY), |optimum| (optimum.at, optimum.chi2));
        let rise = chi2 - self.fit.chi2;
        Refit { coordinate, rise: if rise < VERY_HIGH { rise } else { VERY_HIGH }, others }
    }

    fn point(&self, refit: &Refit) -> CurvePoint {
        CurvePoint { value: self.parameter.at_coordinate(refit.coordinate), delta_chi2: refit.rise }
    }

    /// Fits evenly spaced between the ends of the widest interval, each from the nearest known one.
    fn between(&self, known: &[Refit], intervals: &[Interval]) -> Vec<Refit> {
        let Some(widest) = intervals.last() else { return Vec::new() };
        let farthest = |end: End| match end {
            End::Crossing { value } | End::Undone { value } => Some(self.parameter.coordinate(value)),
            // A bound at 0 has no logarithm.
            End::Bound { .. } => None,
        };
        let all = || known.iter().map(|refit| refit.coordinate);
        let low = farthest(widest.low).unwrap_or(all().fold(f64::INFINITY, f64::min));
        let high = farthest(widest.high).unwrap_or(all().fold(f64::NEG_INFINITY, f64::max));
        let places: Vec<f64> = (1..=ADDED).map(|step| low + (high - low) * step as f64 / (ADDED + 1) as f64).collect();
        let nearest = |place: f64| {
            let distance = |refit: &&Refit| (refit.coordinate - place).abs();
            known.iter().min_by(|a, b| distance(a).total_cmp(&distance(b))).expect("the optimum is known")
        };
        parallel::map(places, |place| self.refit(place, &nearest(place).others))
    }
}

/// One side of the optimum.
struct Side {
    /// In the order of [`LEVELS`].
    ends: Vec<End>,
    /// All fits, without the optimum.
    refits: Vec<Refit>,
}

/// A search on one side, in progress.
struct Search<'a> {
    scan: &'a Scan<'a>,
    optimum: &'a Refit,
    /// −1 below, 1 above.
    sign: f64,
    /// The last allowed coordinate.
    last: f64,
    /// Sorted by their distance from the optimum, which is the first.
    refits: RefCell<Vec<Refit>>,
    left: Cell<usize>,
}

/// No fits are left.
struct Exhausted;

impl Side {
    fn of(scan: &Scan, optimum: &Refit, sign: f64) -> Side {
        let (low, high) = scan.parameter.coordinates();
        let search = Search {
            scan,
            optimum,
            sign,
            last: if sign < 0.0 { low } else { high },
            refits: RefCell::new(vec![optimum.clone()]),
            left: Cell::new(FITS),
        };
        let ends = LEVELS.iter().map(|(rise, _)| search.end(*rise)).collect();
        let mut refits = search.refits.into_inner();
        refits.remove(0);
        Side { ends, refits }
    }
}

impl Search<'_> {
    /// The end at which chi2 has increased by `rise`.
    fn end(&self, rise: f64) -> End {
        let value = |coordinate: f64| self.scan.parameter.at_coordinate(coordinate);
        match self.bracket(rise) {
            Ok((inside, outside)) => {
                let above = |refit: &Refit| refit.rise.max(0.0).sqrt() - rise.sqrt();
                let tolerance = EXACT * (outside.coordinate - self.optimum.coordinate).abs();
                let ends = [(inside.coordinate, above(&inside)), (outside.coordinate, above(&outside))];
                let root = try_between(ends, tolerance, |at| self.refit(at).map(|refit| above(&refit)));
                match root {
                    Ok(root) => End::Crossing { value: value(root) },
                    Err(Exhausted) => End::Undone { value: value(inside.coordinate) },
                }
            }
            Err(inside) if inside.coordinate == self.last => {
                let parameter = &self.scan.parameter;
                End::Bound { value: if self.sign < 0.0 { parameter.low } else { parameter.high } }
            }
            Err(inside) => End::Undone { value: value(inside.coordinate) },
        }
    }

    /// Two neighbours between which chi2 has increased by `rise`; the last fit below that if there are none.
    fn bracket(&self, rise: f64) -> Result<(Refit, Refit), Refit> {
        let mut reached = 0;
        loop {
            let known = self.refits.borrow();
            while known.get(reached + 1).is_some_and(|next| next.rise < rise) {
                reached += 1;
            }
            let inside = known[reached].clone();
            if let Some(outside) = known.get(reached + 1) {
                return Ok((inside, outside.clone()));
            }
            drop(known);
            if inside.coordinate == self.last || self.refit(self.farther(&inside, rise)).is_err() {
                return Err(inside);
            }
        }
    }

    /// Next trial value for an increase of chi2, beyond a fit with a smaller one: by a parabola.
    fn farther(&self, inside: &Refit, rise: f64) -> f64 {
        let distance = (inside.coordinate - self.optimum.coordinate).abs();
        let next = if distance > 0.0 {
            distance * (1.1 * (rise / inside.rise.max(1e-9)).sqrt()).clamp(GROWTH.0, GROWTH.1)
        } else {
            let value = self.scan.parameter.at_coordinate(self.optimum.coordinate);
            self.scan.parameter.coordinate_error(value, self.scan.sigma) * rise.sqrt()
        };
        let place = self.optimum.coordinate + self.sign * next;
        if self.sign < 0.0 { place.max(self.last) } else { place.min(self.last) }
    }

    /// A fit at this coordinate, from the nearest known one.
    fn refit(&self, coordinate: f64) -> Result<Refit, Exhausted> {
        self.left.set(self.left.get().checked_sub(1).ok_or(Exhausted)?);
        let distance = |refit: &Refit| (refit.coordinate - coordinate).abs();
        let nearest = |known: &[Refit]| {
            known.iter().min_by(|a, b| distance(a).total_cmp(&distance(b))).expect("the optimum").others.clone()
        };
        let start = nearest(&self.refits.borrow());
        let found = self.scan.refit(coordinate, &start);
        let mut known = self.refits.borrow_mut();
        known.push(found.clone());
        known.sort_by(|a, b| (self.sign * a.coordinate).total_cmp(&(self.sign * b.coordinate)));
        Ok(found)
    }
}
