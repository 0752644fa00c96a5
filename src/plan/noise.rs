//! The change of shape with the noise of one exposure, over a mission, and how much earlier the budget is then exceeded.
//!
//! To first order, the effect of noise is proportional to the density of the traps. It is realised at the end of the mission, and
//! in a few other years whose traps differ from those then by more than their number, and on the dates without noise, if far fewer
//! traps are there by then. In between, the effect at the nearest such time is scaled. If noise leaves no shape at the end, it is
//! realised in years before as well.

use crate::error::InputError;
use crate::model::noise::{NoiseTerm, Realisations};
use crate::model::{Device, Model};
use crate::physics::shape::ShapeChange;
use crate::plan::curve::{self, Crossing, Point};
use crate::plan::verdict::{BudgetVerdict, Year};

/// Maximum number of times at which noise is realised.
const TIMES: usize = 8;

/// Ratio of the numbers of traps down to which the effect of noise on a date is scaled.
const PROPORTIONAL: f64 = 0.3;

/// Position of the centroid while noise is measured, in words.
pub const CENTROID: &str = "held where the image without noise has it, before and after the readout";

/// How ellipticity is measured with noise, in words.
pub const ESTIMATOR: &str = "(A, C)/max(T, sqrt(A^2 + C^2)) of the weighted sums A = sum I w (x^2 - y^2), C = sum I w 2xy, \
                             T = sum I w (x^2 + y^2): |e| is bounded by 1";

/// Changes of shape with noise.
#[derive(Clone, Debug)]
pub struct NoisyEvaluation {
    /// Number of realisations.
    pub realisations: Realisations,
    /// For each year and each galaxy, in the order of the evaluation. None if no shape is left.
    pub years: Vec<Vec<Option<NoisyShape>>>,
    /// When the budget is exceeded with noise.
    pub verdict: NoisyVerdict,
}

/// A mean change of ellipticity with noise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NoisyShape {
    /// Δe1 and Δe2 with noise.
    pub delta_e: [f64; 2],
    /// Standard errors from the finite number of realisations.
    pub error: [f64; 2],
}

/// When the budget is exceeded with noise.
#[derive(Clone, Debug, PartialEq)]
pub struct NoisyVerdict {
    /// Without software correction.
    pub uncorrected: NoisyCrossing,
    /// With it.
    pub corrected: NoisyCrossing,
}

/// When |Δe| with noise exceeds a limit.
#[derive(Clone, Debug, PartialEq)]
pub struct NoisyCrossing {
    /// As without noise.
    pub crossing: Crossing,
    /// Standard error of the first time from the finite number of realisations, yr.
    pub error_yr: Option<f64>,
    /// Time without noise minus time with noise, yr; None if one of them is not within the mission.
    pub earlier_yr: Option<f64>,
}

/// Noise realised at one time.
struct Realised {
    device: Device,
    /// For each galaxy.
    terms: Vec<Option<NoiseTerm>>,
}

impl NoisyEvaluation {
    /// The effect of noise on the shapes of these years, and on the dates of this verdict. None without realisations.
    ///
    /// # Errors
    /// If a formula has no value.
    pub fn of(
        model: &Model,
        years: &[Year],
        verdict: &BudgetVerdict,
        realisations: Realisations,
    ) -> Result<Option<NoisyEvaluation>, InputError> {
        if realisations.count == 0 {
            return Ok(None);
        }
        let realised = realised(model, years, verdict, realisations)?;
        let shapes = years.iter().map(|year| {
            let device = model.device_at(year.t_yr)?;
            let shape = |(galaxy, change): (usize, &Option<ShapeChange>)| {
                Some(NoisyShape::of(change.as_ref()?, &term(&realised, galaxy, &device)?))
            };
            Ok(year.galaxies.iter().enumerate().map(shape).collect())
        });
        let shapes = shapes.collect::<Result<Vec<Vec<_>>, InputError>>()?;
        let verdict = noisy_verdict(model, years, verdict, &shapes, &realised)?;
        Ok(Some(NoisyEvaluation { realisations, years: shapes, verdict }))
    }
}

impl NoisyShape {
    fn of(change: &ShapeChange, term: &NoiseTerm) -> NoisyShape {
        let delta_e = [change.delta_e1 + term.added[0], change.delta_e2 + term.added[1]];
        NoisyShape { delta_e, error: term.error }
    }

    /// |Δe|.
    pub fn magnitude(&self) -> f64 {
        self.delta_e[0].hypot(self.delta_e[1])
    }

    /// Standard error of |Δe|.
    pub fn magnitude_error(&self) -> f64 {
        let along = [0, 1].map(|member| self.delta_e[member] * self.error[member]);
        if self.magnitude() > 0.0 {
            along[0].hypot(along[1]) / self.magnitude()
        } else {
            self.error[0].hypot(self.error[1])
        }
    }
}

/// Number of realisations for galaxies that are not judged: half as many.
pub fn others(judged: u32) -> u32 {
    judged.div_ceil(2)
}

/// Noise of all galaxies at the end of the mission, in those years (evenly chosen) whose traps differ from all of these by more than
/// their number, and on dates with fewer traps. While no shape of the judged galaxy is left, earlier years follow.
fn realised(
    model: &Model,
    years: &[Year],
    verdict: &BudgetVerdict,
    realisations: Realisations,
) -> Result<Vec<Realised>, InputError> {
    let judged = model.judged();
    let mut found: Vec<Realised> = Vec::new();
    let of_years = years.iter().rev().step_by(years.len().div_ceil(TIMES)).map(|year| (year.t_yr, 0.0));
    let dates = [verdict.corrected.t_yr, verdict.uncorrected.t_yr];
    let of_dates = dates.into_iter().flatten().map(|t_yr| (t_yr, PROPORTIONAL));
    for (t_yr, least) in of_years.chain(of_dates) {
        let device = model.device_at(t_yr)?;
        let measured = |realised: &&Realised| realised.terms[judged].is_some();
        let scales = |realised: &Realised| device.traps_over(&realised.device).is_some_and(|factor| factor > least);
        let known = found.iter().filter(measured).any(scales);
        if known || device.species().all(|species| species.density_per_px == 0.0) {
            continue;
        }
        let others = Realisations { count: others(realisations.count), ..realisations };
        let terms = (0..model.mission.galaxies.len()).map(|galaxy| {
            let realisations = if galaxy == judged { realisations } else { others };
            model.noise_term(galaxy, &device, realisations)
        });
        found.push(Realised { terms: terms.collect::<Result<_, _>>()?, device });
    }
    Ok(found)
}

/// The effect of noise on the change of a galaxy by a device. None if no shape is left.
fn term(realised: &[Realised], galaxy: usize, device: &Device) -> Option<NoiseTerm> {
    let traps = |device: &Device| device.species().map(|species| species.density_per_px).sum::<f64>();
    let total = traps(device);
    if total == 0.0 {
        return Some(NoiseTerm::default());
    }
    let is_lost = |realised: &Realised| realised.terms[galaxy].is_none() && traps(&realised.device) <= total;
    if realised.iter().any(is_lost) {
        return None;
    }
    let measured = || realised.iter().filter_map(|realised| Some((&realised.device, realised.terms[galaxy].as_ref()?)));
    let nearest = |of: &dyn Fn(&Device) -> f64| measured().min_by(|a, b| of(a.0).total_cmp(&of(b.0)));
    let in_number = |other: &Device| device.traps_over(other).map_or(f64::INFINITY, |factor| factor.ln().abs());
    let in_time = |other: &Device| (other.at.t_yr - device.at.t_yr).abs();
    let (other, term) = nearest(&in_number).filter(|(other, _)| in_number(other).is_finite()).or(nearest(&in_time))?;
    Some(term.times(total / traps(other)))
}

/// When |Δe| of the judged galaxy with noise exceeds the budget.
fn noisy_verdict(
    model: &Model,
    years: &[Year],
    without: &BudgetVerdict,
    noisy: &[Vec<Option<NoisyShape>>],
    realised: &[Realised],
) -> Result<NoisyVerdict, InputError> {
    let judged = model.judged();
    let shape = |t_yr: f64| -> Result<Option<NoisyShape>, InputError> {
        let device = model.device_at(t_yr)?;
        let change = model.change_by(judged, &device)?;
        Ok(change.zip(term(realised, judged, &device)).map(|(change, term)| NoisyShape::of(&change, &term)))
    };
    let magnitude = |t_yr: f64| Ok(shape(t_yr)?.map(|shape| shape.magnitude()));
    let of_year = |shapes: &Vec<Option<NoisyShape>>| shapes[judged].map(|shape| shape.magnitude());
    let known = years.iter().zip(noisy).map(|(year, shapes)| (year.t_yr, of_year(shapes)));
    let known: Vec<Point> = known.collect();
    let [uncorrected, corrected] =
        curve::crossings(model, [without.uncorrected.limit, without.corrected.limit], &known, magnitude)?;
    let noisy = |crossing: Crossing, without: &Crossing| -> Result<NoisyCrossing, InputError> {
        let error_yr = crossing.t_yr.map_or(Ok(None), |t_yr| error_yr(t_yr, shape))?;
        let earlier_yr = without.t_yr.zip(crossing.t_yr).map(|(without, with)| without - with);
        Ok(NoisyCrossing { crossing, error_yr, earlier_yr })
    };
    Ok(NoisyVerdict {
        uncorrected: noisy(uncorrected, &without.uncorrected)?,
        corrected: noisy(corrected, &without.corrected)?,
    })
}

/// Share of the time of a crossing over which its slope is measured.
const SLOPE: f64 = 0.02;

/// Standard error of the time (years since launch) of a crossing; None if |Δe| does not increase there.
fn error_yr(
    t_yr: f64,
    shape: impl Fn(f64) -> Result<Option<NoisyShape>, InputError>,
) -> Result<Option<f64>, InputError> {
    let (Some(here), Some(before)) = (shape(t_yr)?, shape((1.0 - SLOPE) * t_yr)?) else { return Ok(None) };
    let slope = (here.magnitude() - before.magnitude()) / (SLOPE * t_yr);
    Ok((slope > 0.0 && slope.is_finite()).then(|| here.magnitude_error() / slope))
}
