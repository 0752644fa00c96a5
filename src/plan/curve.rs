//! A quantity of a mission over time: sampled as densely as needed, and when it crosses limits.
//!
//! A quantity such as |Δe|(t) jumps where dose or annealing is instantaneous, bends where the dose rate changes, and is smooth in
//! between. It is computed on both sides of each jump and at each bend ([`Model::times_yr`]). What is added in between depends on its cost:
//!
//! - few values (`crossings`): points are added until a parabola through three neighbours shows that no crossing of given limits is
//!   missed: the curve stays on one side of the limit, or crosses it once. Crossings are roots of the quantity.
//! - many values, from few readouts ([`Curve::sampled`]): points are added until the curve is straight between them, and gives the
//!   crossing of any limit.

use chrono::NaiveDate;

use crate::error::InputError;
use crate::model::{Model, predict};
use crate::numeric::calendar::date_after;
use crate::numeric::{parallel, root_finding};
use crate::physics::conditions::Conditions;

/// When a limit is exceeded, and by how much.
#[derive(Clone, Debug, PartialEq)]
pub struct Crossing {
    /// First time (years since launch) at which |Δe| reaches the limit; None if not within the mission.
    pub t_yr: Option<f64>,
    /// All times (years since launch, ascending) at which |Δe| crosses the limit: up, down, up, ... The first is `t_yr`.
    pub crossings_yr: Vec<f64>,
    /// Limit on |Δe| before correction.
    pub limit: f64,
    /// Limit minus |Δe| at the end of the mission; negative if exceeded then. None if the galaxy has no shape left by then.
    pub margin: Option<f64>,
    /// Longest interval (yr) in which crossings may have been missed, since the curve is too rough near a limit; None if none were.
    pub rough_yr: Option<f64>,
}

impl Crossing {
    /// The day on which the limit is first exceeded, for a given launch date; None if it is not, or past the end of the calendar.
    pub fn date(&self, launch: NaiveDate) -> Option<NaiveDate> {
        date_after(launch, self.t_yr?)
    }

    /// Whether the limit is exceeded at the end of the mission.
    pub fn exceeded_at_end(&self) -> bool {
        self.crossings_yr.len() % 2 == 1
    }
}

/// A quantity at a time (years since launch); None if no shape is left, which exceeds any limit.
pub type Point = (f64, Option<f64>);

/// Shortest interval that is subdivided, yr: nine hours.
const SHORTEST_YR: f64 = 1e-3;

/// Maximum number of points added. A few dozen show the crossings of a curve that is smooth. If hardly a shape is left, what
/// remains of it is rough, and crosses limits all the time.
const MOST_POINTS: usize = 500;

/// A curve this close to a limit (relative to it) is neither above nor below.
const CLOSE: f64 = 1e-4;

/// Margin for curves that are not parabolas, in units of the deviation from a straight line within an interval. A parabola itself
/// needs a quarter.
const ROOM: f64 = 2.0;

/// Initial number of times in a mission, besides its years, bends and jumps.
const TIMES: usize = 60;

/// Maximum number of halvings of an interval in which |Δe| is not straight.
const HALVINGS: usize = 8;

/// Allowed deviation of |Δe| from a straight line over two intervals: relative to its change over them, which shifts a date by a
/// hundredth of an interval, or to its largest value.
const BENT: f64 = 0.02;
const BENT_OF_LARGEST: f64 = 1e-4;

/// A quantity over time.
#[derive(Clone, Debug)]
pub struct Curve {
    /// Years since launch, ascending, with the quantity; each jump twice: just before it (the next smaller number) and at it.
    pub points: Vec<Point>,
    /// Intervals in which crossings may have been missed, since the curve is too rough near a limit.
    rough: Vec<[f64; 2]>,
}

impl Curve {
    /// Through points that bracket every crossing, ascending in time.
    pub fn through(points: Vec<Point>) -> Curve {
        Curve { points, rough: Vec::new() }
    }

    /// |Δe| of the judged galaxy, for a mission as it is.
    ///
    /// # Errors
    /// If a formula has no value, here and below.
    pub fn of(model: &Model) -> Result<Curve, InputError> {
        Curve::under(model, |_| {})
    }

    /// |Δe| of the judged galaxy, for a mission under other conditions.
    ///
    /// # Errors
    /// As [`Curve::of`].
    pub fn under(model: &Model, change: impl Fn(&mut Conditions)) -> Result<Curve, InputError> {
        Curve::of_galaxy(model, model.judged(), change)
    }

    /// The same for any galaxy, by its index in the mission.
    ///
    /// # Errors
    /// As [`Curve::of`].
    pub fn of_galaxy(model: &Model, galaxy: usize, change: impl Fn(&mut Conditions)) -> Result<Curve, InputError> {
        let under = |t_yr: &f64| {
            let mut at = model.conditions(*t_yr);
            change(&mut at);
            at
        };
        Curve::sampled(model, |times| {
            let conditions: Vec<Conditions> = times.iter().map(under).collect();
            let changes = predict::changes(model, galaxy, &conditions)?;
            Ok(changes.into_iter().map(|change| change.map(|change| change.magnitude())).collect())
        })
    }

    /// A quantity at many times at once, until the curve is straight between its points.
    ///
    /// # Errors
    /// Those of the quantity.
    pub fn sampled(
        model: &Model,
        values: impl Fn(&[f64]) -> Result<Vec<Option<f64>>, InputError>,
    ) -> Result<Curve, InputError> {
        let at_all = |times: &[f64]| -> Result<Vec<Point>, InputError> {
            Ok(times.iter().copied().zip(values(times)?).collect())
        };
        let duration_yr = model.mission.mission.duration_yr;
        let breaks = model.times_yr(duration_yr);
        let mut times: Vec<f64> = (0..=TIMES).map(|index| duration_yr * index as f64 / TIMES as f64).collect();
        times.extend(year_ends(duration_yr));
        times.extend(&breaks);
        let mut points = at_all(&in_order(times))?;
        for _ in 0..HALVINGS {
            let more = where_bent(&points, &breaks);
            if more.is_empty() {
                break;
            }
            points.extend(at_all(&more)?);
            points.sort_by(|a, b| a.0.total_cmp(&b.0));
        }
        Ok(Curve::through(points))
    }

    /// Adds points until the crossings of a quantity with each limit can be located. The curve must hold both ends, each bend and each
    /// jump.
    ///
    /// # Errors
    /// Those of the quantity; the earliest in time.
    fn resolved(
        self,
        limits: &[f64],
        quantity: impl Fn(f64) -> Result<Option<f64>, InputError> + Sync,
    ) -> Result<Curve, InputError> {
        let known = &self.points;
        let mut points = known.clone();
        let mut open: Vec<[Point; 2]> = Vec::new();
        for (index, pair) in known.windows(2).enumerate() {
            // Years are evenly spaced: one neighbour is often enough.
            let before = index.checked_sub(1).map(|before| [known[before], pair[0], pair[1]]);
            let after = known.get(index + 2).map(|after| [pair[0], pair[1], *after]);
            let shown = [before, after].into_iter().flatten().any(|three| is_even(&three) && is_clear(&three, limits));
            if !shown && pair[1].0 - pair[0].0 > SHORTEST_YR {
                open.push([pair[0], pair[1]]);
            }
        }
        while !open.is_empty() && points.len() + open.len() <= known.len() + MOST_POINTS {
            let middles: Vec<Result<Point, InputError>> = parallel::map(&open, |[start, end]| {
                let t_yr = 0.5 * (start.0 + end.0);
                Ok((t_yr, quantity(t_yr)?))
            });
            let mut next = Vec::new();
            for ([start, end], middle) in open.into_iter().zip(middles) {
                let middle = middle?;
                points.push(middle);
                if !is_clear(&[start, middle, end], limits) && middle.0 - start.0 > SHORTEST_YR {
                    next.extend([[start, middle], [middle, end]]);
                }
            }
            open = next;
        }
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        let rough = open.into_iter().map(|[start, end]| [start.0, end.0]).collect();
        Ok(Curve { points, rough })
    }

    /// The weighted sum of several curves.
    pub fn weighted(curves: &[Curve], weights: &[f64]) -> Curve {
        let times = in_order(curves.iter().flat_map(|one| one.points.iter().map(|point| point.0)).collect());
        let sum =
            |t_yr: f64| curves.iter().zip(weights).map(|(one, weight)| one.at(t_yr).map(|value| weight * value)).sum();
        Curve::through(times.into_iter().map(|t_yr| (t_yr, sum(t_yr))).collect())
    }

    /// The quantity at the end of the mission; None if no shape is left.
    pub fn end(&self) -> Option<f64> {
        self.points.last().expect("a mission has an end").1
    }

    /// The quantity at a time (years since launch); None if no shape is left.
    pub fn at(&self, t_yr: f64) -> Option<f64> {
        let after = self.points.partition_point(|point| point.0 < t_yr).clamp(1, self.points.len() - 1);
        let (before, after) = (self.points[after - 1], self.points[after]);
        let place = (t_yr - before.0) / (after.0 - before.0);
        Some(before.1? * (1.0 - place) + after.1? * place)
    }

    /// When the curve, straight between its points, crosses a limit.
    pub fn crossing(&self, limit: f64) -> Crossing {
        self.crossing_of(limit, |t_yr| Ok(self.at(t_yr))).expect("a straight line has a value")
    }

    /// When the quantity crosses a limit: roots of it, to 1e-9 yr, not of the curve; where the curve is rough, to the length of the
    /// interval.
    ///
    /// # Errors
    /// Those of the quantity.
    pub fn crossing_of(
        &self,
        limit: f64,
        quantity: impl Fn(f64) -> Result<Option<f64>, InputError>,
    ) -> Result<Crossing, InputError> {
        let Curve { points, rough } = self;
        let excess = |value: Option<f64>| value.map_or(limit, |value| value - limit);
        let exceeds = |point: &Point| excess(point.1) >= 0.0;
        let mut crossings_yr: Vec<f64> =
            points.first().filter(|first| exceeds(first)).map(|first| first.0).into_iter().collect();
        for pair in points.windows(2) {
            if exceeds(&pair[0]) == exceeds(&pair[1]) {
                continue;
            }
            let is_jump = pair[0].0.next_up() >= pair[1].0;
            let is_rough = rough.iter().any(|[start, end]| *start <= pair[0].0 && pair[1].0 <= *end);
            crossings_yr.push(match is_jump || is_rough {
                true => pair[1].0,
                false => {
                    let ends = [pair[0], pair[1]].map(|(t_yr, value)| (t_yr, excess(value)));
                    root_finding::try_between(ends, 1e-9, |t_yr| quantity(t_yr).map(excess))?
                }
            });
        }
        let margin = points.last().expect("at least one time").1.map(|value| limit - value);
        let rough_yr = rough.iter().map(|[start, end]| end - start).reduce(f64::max);
        Ok(Crossing { t_yr: crossings_yr.first().copied(), crossings_yr, limit, margin, rough_yr })
    }
}

/// When a quantity of a model crosses limits, each located with as few values as possible; `known` points are reused.
///
/// # Errors
/// Those of the quantity; the earliest in time.
pub(crate) fn crossings<const N: usize>(
    model: &Model,
    limits: [f64; N],
    known: &[Point],
    quantity: impl Fn(f64) -> Result<Option<f64>, InputError> + Sync,
) -> Result<[Crossing; N], InputError> {
    let mut times = model.times_yr(model.mission.mission.duration_yr);
    times.retain(|t_yr| known.iter().all(|known| known.0 != *t_yr));
    let mut points: Vec<Point> = parallel::try_map(times, |t_yr| Ok((t_yr, quantity(t_yr)?)))?;
    points.extend(known);
    points.sort_by(|a, b| a.0.total_cmp(&b.0));
    let curve = Curve::through(points).resolved(&limits, &quantity)?;
    let found = limits.map(|limit| curve.crossing_of(limit, &quantity));
    let found: Vec<Crossing> = found.into_iter().collect::<Result<_, _>>()?;
    Ok(found.try_into().expect("as many crossings as limits"))
}

/// Ends of the years of a mission, and its end.
pub(crate) fn year_ends(duration_yr: f64) -> Vec<f64> {
    let mut ends: Vec<f64> = (1..=duration_yr.floor() as usize).map(|year| year as f64).collect();
    if duration_yr.fract() > 0.0 {
        ends.push(duration_yr);
    }
    ends
}

fn is_even([a, b, c]: &[Point; 3]) -> bool {
    ((b.0 - a.0) - (c.0 - b.0)).abs() < 1e-9
}

/// Whether the smooth curve through three evenly spaced points has no undetected crossing of a limit between them.
fn is_clear(three: &[Point; 3], limits: &[f64]) -> bool {
    let [Some(a), Some(b), Some(c)] = three.map(|point| point.1) else {
        return three.iter().all(|point| point.1.is_none());
    };
    let bend = (b - 0.5 * (a + c)).abs();
    let (least, most) = (a.min(b).min(c) - ROOM * bend, a.max(b).max(c) + ROOM * bend);
    // The vertex of the parabola is far outside.
    let monotone = (c - a).abs() > 4.0 * ROOM * bend;
    limits.iter().all(|limit| {
        let beside = *limit < least || *limit > most;
        let along = (most - limit).abs().max((least - limit).abs()) < CLOSE * limit;
        beside || monotone || along
    })
}

fn in_order(mut times: Vec<f64>) -> Vec<f64> {
    times.sort_by(f64::total_cmp);
    times.dedup();
    times
}

/// Midpoints of the intervals on both sides of points where a curve is not straight. At `breaks` it may bend or jump.
fn where_bent(points: &[Point], breaks: &[f64]) -> Vec<f64> {
    let largest = points.iter().filter_map(|point| point.1).fold(0.0, f64::max);
    let mut more = Vec::new();
    for three in points.windows(3) {
        let [(t_a, a), (t_b, b), (t_c, c)] = [three[0], three[1], three[2]];
        let (Some(a), Some(b), Some(c)) = (a, b, c) else { continue };
        if breaks.contains(&t_b) {
            continue;
        }
        let bend = (b - a - (c - a) * (t_b - t_a) / (t_c - t_a)).abs();
        if bend > BENT * (c - a).abs() && bend > BENT_OF_LARGEST * largest {
            more.extend([0.5 * (t_a + t_b), 0.5 * (t_b + t_c)]);
        }
    }
    in_order(more)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(limit: f64, jumps: &[f64], function: impl Fn(f64) -> Option<f64> + Sync) -> Crossing {
        let mut times: Vec<f64> = (0..=5).map(f64::from).collect();
        times.extend(jumps.iter().flat_map(|jump| [jump.next_down(), *jump]));
        times.sort_by(f64::total_cmp);
        let known: Vec<Point> = times.into_iter().map(|t_yr| (t_yr, function(t_yr))).collect();
        let curve = Curve::through(known).resolved(&[limit], |t_yr| Ok(function(t_yr))).unwrap();
        curve.crossing_of(limit, |t_yr| Ok(function(t_yr))).unwrap()
    }

    #[test]
    fn the_root_is_that_of_the_curve() {
        let found = found(2.0, &[], |t| Some(t * t));
        assert!((found.t_yr.unwrap() - 2_f64.sqrt()).abs() < 1e-8);
        assert_eq!((found.margin, found.crossings_yr.len()), (Some(-23.0), 1));
    }

    #[test]
    fn a_limit_that_is_not_reached_leaves_a_margin() {
        let found = found(30.0, &[], |t| Some(t * t));
        assert_eq!((found.t_yr, found.margin, found.exceeded_at_end()), (None, Some(5.0), false));
    }

    #[test]
    fn a_curve_that_starts_above_the_limit_has_exceeded_it_at_launch() {
        assert_eq!(found(1.0, &[], |_| Some(2.0)).t_yr, Some(0.0));
    }

    #[test]
    fn a_shape_that_is_lost_is_beyond_any_limit() {
        let found = found(10.0, &[], |t| (t < 3.5).then_some(t));
        assert!((found.t_yr.unwrap() - 3.5).abs() < 2e-3);
        assert_eq!(found.margin, None);
    }

    #[test]
    fn a_crossing_before_a_step_down_is_seen_and_so_is_the_way_back() {
        // Increases by 1 per year, and drops to a hundredth at 2.7 yr.
        let function = |t: f64| Some(if t < 2.7 { t } else { 0.027 + (t - 2.7) });
        let twice = found(2.5, &[2.7], function);
        assert!((twice.crossings_yr[0] - 2.5).abs() < 1e-8);
        assert_eq!(twice.crossings_yr.len(), 2);
        assert_eq!(twice.crossings_yr[1], 2.7);
        assert!(!twice.exceeded_at_end());
        assert_eq!(found(2.2, &[2.7], function).crossings_yr.len(), 3);
    }

    #[test]
    fn a_hump_between_two_years_is_seen() {
        let hump = |t: f64| Some(1.0 - (t - 2.45).powi(2));
        let found = found(0.999, &[], hump);
        let half = 0.001_f64.sqrt();
        assert_eq!(found.crossings_yr.len(), 2);
        assert!((found.crossings_yr[0] - 2.45 + half).abs() < 1e-8);
        assert!((found.crossings_yr[1] - 2.45 - half).abs() < 1e-8);
    }

    #[test]
    fn a_straight_curve_needs_no_more_than_its_years() {
        let calls = std::sync::atomic::AtomicUsize::new(0);
        let line = |t: f64| {
            calls.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
            Ok(Some(t))
        };
        let known: Vec<Point> = (0..=5).map(|year| (f64::from(year), Some(f64::from(year)))).collect();
        assert_eq!(Curve::through(known.clone()).resolved(&[2.5, 25.0], line).unwrap().points.len(), known.len());
        assert_eq!(calls.into_inner(), 0);
    }

    /// Noise about the limit: what is left of a shape that is nearly lost. It ends, and says how closely it looked.
    #[test]
    fn a_curve_that_is_rough_everywhere_is_not_followed_for_ever() {
        let rough = |t: f64| Ok(Some(1.0 + 0.5 * (1e5 * t).sin()));
        let known: Vec<Point> = (0..=5).map(|year| (f64::from(year), rough(f64::from(year)).unwrap())).collect();
        let curve = Curve::through(known.clone()).resolved(&[1.0], rough).unwrap();
        assert!(curve.points.len() <= MOST_POINTS + known.len(), "{}", curve.points.len());
        let found = curve.crossing_of(1.0, rough).unwrap();
        let rough_yr = found.rough_yr.expect("left open");
        assert!((0.005..0.05).contains(&rough_yr), "{rough_yr}");
        assert!(found.crossings_yr.len() > 100);
    }
}
