//! Changes of shape as polynomials in a galaxy's catalogue properties.
//!
//! **Coordinates.** The logarithms of flux, Sersic index and size, and the ellipticity (e1, e2), all but the index under the weight
//! and through the PSF, as in [`Observed`]: galaxies that look alike are close to each other, whatever their shapes before the PSF.
//! All are scaled to −1 to 1.
//!
//! **Transfers.** Beyond the stamp's half-width all of the stamp's packets pass every pixel, and a change is nearly parabolic in
//! the number of transfers. So the polynomials are fitted at three numbers of transfers, with Lagrange's parabola through them.
//! Closer to the register, where rows make few transfers or none, they are fitted at more numbers, and interpolated in the
//! logarithm.
//!
//! **Fit.** Least squares. Powers of flux and index cost 1.5 times as much as the others, since changes are smoother in them.
//! Coefficients of high degrees are regularised, so that one term for every two or three galaxies is possible. Galaxies are taken
//! from all parts of the catalogue. Their number and the degree increase until the error is as small as requested. In a detector
//! that maps mirror images to mirror images, Δe2 and Δx are odd in e2 and the others even.
//!
//! **Error.** Galaxies that were not fitted, chosen at random among all rows, are read out at their own positions.

use std::ops::Range;
use std::sync::Arc;

use ndarray::{Array2, s};
use serde::Serialize;

use super::{Survey, rms, training};
use crate::error::InputError;
use crate::model::half_px;
use crate::model::shear::SurveyGalaxy;
use crate::numeric::parallel;
use crate::numeric::polynomial::{Parity, Terms, fitted};
use crate::physics::galaxy::observed::Observed;
use crate::physics::shape::ShapeChange;

/// Number of coordinates of a galaxy.
const COORDINATES: usize = 5;

/// Costs of powers of the coordinates, in units of half a degree.
const COSTS: [usize; COORDINATES] = [3, 3, 2, 2, 2];

/// Number of fitted galaxies in each step, and the degree of their polynomials in units of one half.
const STEPS: [(usize, usize); 5] = [(400, 13), (900, 17), (1800, 21), (3600, 23), (7200, 25)];

/// At most one galaxy in this many is fitted: with more, reading out all of them would be as fast.
const SHARE: usize = 4;

/// Number of galaxies held out.
const HELD_OUT: usize = 400;

/// Range in which a polynomial is used, in units of half the range of the fitted galaxies.
const BEYOND: f64 = 1.02;

/// Numbers of nodes in transfers, beyond the stamp and closer to the register.
const FAR: usize = 3;
const NEAR: usize = 8;

/// Rows computed together.
const TOGETHER: usize = 512;

/// Quantities of a change; the first ones are even in e2 if mirror images are read as mirror images.
const QUANTITIES: usize = 6;
const EVEN: usize = 4;

/// Errors of polynomials at held-out galaxies.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct HeldOut {
    /// Number of held-out galaxies.
    pub galaxies: usize,
    /// Root mean square error of (Δe1, Δe2) over the root mean square change.
    pub delta_e: f64,
    /// The same for Δy.
    pub delta_y: f64,
    /// The same for the change of size.
    pub delta_size: f64,
    /// The same for the change of flux.
    pub delta_flux: f64,
    /// Median of the error of (Δe1, Δe2) of a galaxy over its own |Δe|.
    pub own_median: f64,
    /// The same, as the 95 % quantile of the galaxies.
    pub own_95: f64,
    /// The same, largest value.
    pub own_largest: f64,
}

impl HeldOut {
    /// The largest of the errors relative to their changes.
    pub fn worst(&self) -> f64 {
        [self.delta_e, self.delta_y, self.delta_size, self.delta_flux].into_iter().fold(0.0, f64::max)
    }

    fn of(pairs: &[(ShapeChange, ShapeChange)]) -> HeldOut {
        let error = |(found, expected): &(ShapeChange, ShapeChange)| found.plus(expected, -1.0);
        let ratio = |of: fn(&ShapeChange) -> f64| {
            let errors = rms(pairs.iter().map(|pair| of(&error(pair))));
            let changes = rms(pairs.iter().map(|(_, expected)| of(expected)));
            if errors > 0.0 { errors / changes } else { 0.0 }
        };
        let own = |pair: &(ShapeChange, ShapeChange)| match error(pair).magnitude() {
            0.0 => 0.0,
            error => error / pair.1.magnitude(),
        };
        let mut own: Vec<f64> = pairs.iter().map(own).collect();
        own.sort_by(f64::total_cmp);
        let quantile = |share: f64| own.get((share * own.len() as f64) as usize).or(own.last()).copied().unwrap_or(0.0);
        HeldOut {
            galaxies: pairs.len(),
            delta_e: ratio(ShapeChange::magnitude),
            delta_y: ratio(|change| change.delta_y_px),
            delta_size: ratio(|change| change.delta_size),
            delta_flux: ratio(|change| change.delta_flux),
            own_median: quantile(0.5),
            own_95: quantile(0.95),
            own_largest: quantile(1.0),
        }
    }
}

/// A fit with the galaxies that were read out for it.
pub(super) struct Fit {
    pub emulator: Emulator,
    /// Galaxies that were fitted, and the degree.
    pub fitted: usize,
    pub degree: f64,
    pub held_out: HeldOut,
    /// Whether the error is as small as requested.
    pub is_used: bool,
    /// Rows read out at their own positions.
    pub read_out: Vec<(usize, Option<ShapeChange>)>,
}

/// Polynomials for the galaxies of one weight.
pub(super) struct Emulator {
    place: Coordinates,
    distances: Distances,
    /// Terms of the quantities that are even in e2, and of the others, with coefficients `[(node and quantity, term)]`.
    even: (Terms, Array2<f64>),
    odd: (Terms, Array2<f64>),
}

impl Emulator {
    /// Polynomials for some rows that are measured with the same weight. None if there are too few rows.
    ///
    /// # Errors
    /// If a formula has no value.
    pub fn of(survey: &Survey, rows: &[usize], accuracy: f64, seed: u64) -> Result<Option<Fit>, InputError> {
        if rows.len() < SHARE * (STEPS[0].0 + HELD_OUT) {
            return Ok(None);
        }
        let shuffled = training::shuffled(survey.galaxies, rows, seed);
        let (compared, others) = shuffled.split_at(HELD_OUT);
        let place = Coordinates::of(survey, rows);
        let coordinates: Vec<[f64; COORDINATES]> = others.iter().map(|row| place.at(*row)).collect();
        let order = training::of_all_kinds(others, &coordinates);
        let distances = Distances::of(survey, rows);
        let read_out: Vec<(usize, Option<ShapeChange>)> =
            compared.iter().copied().zip(survey.read_out(compared)?).collect();
        let mut known = Known::default();
        let mut best: Option<Fit> = None;
        for (galaxies, degree) in STEPS.into_iter().filter(|(galaxies, _)| SHARE * galaxies <= rows.len()) {
            known.extend(survey, &distances, &order[known.rows.len().min(galaxies)..galaxies.min(order.len())])?;
            let Some(emulator) = Emulator::fitted(survey, &place, &distances, &known, degree) else { continue };
            let held_out = emulator.compared(survey, &read_out);
            if best.as_ref().is_none_or(|best| held_out.worst() < best.held_out.worst()) {
                let (fitted, degree) = (known.rows.len(), degree as f64 / 2.0);
                let is_used = held_out.worst() <= accuracy;
                best = Some(Fit { emulator, fitted, degree, held_out, is_used, read_out: Vec::new() });
            }
            if held_out.worst() <= accuracy {
                break;
            }
        }
        Ok(best.map(|fit| Fit { read_out, ..fit }))
    }

    fn fitted(
        survey: &Survey,
        place: &Coordinates,
        distances: &Distances,
        known: &Known,
        degree: usize,
    ) -> Option<Emulator> {
        // Galaxies that lose their shape do not follow a smooth function.
        let all = known.rows.iter().zip(&known.changes);
        let (rows, changes): (Vec<usize>, Vec<&Vec<ShapeChange>>) =
            all.filter_map(|(row, changes)| Some((*row, changes.as_ref()?))).unzip();
        let place = place.around(&rows);
        let points = place.of_rows(&rows);
        let nodes = distances.nodes.len();
        let symmetric = survey.devices.values().all(|device| device.is_mirror_symmetric());
        let of = |parity: Parity, from: usize, quantities: usize| {
            let terms = Terms::of(&COSTS, degree, if symmetric { parity } else { Parity::Any });
            let values = Array2::from_shape_fn((nodes * quantities, rows.len()), |(function, row)| {
                numbers(&changes[row][function / quantities])[from + function % quantities]
            });
            let coefficients = fitted(&terms, &terms.values(&points), &values)?;
            Some((terms, coefficients))
        };
        let even = of(Parity::Even, 0, EVEN)?;
        let odd = of(Parity::Odd, EVEN, QUANTITIES - EVEN)?;
        Some(Emulator { place, distances: distances.clone(), even, odd })
    }

    /// Changes of rows; None if they would be extrapolated.
    pub fn changes(&self, survey: &Survey, rows: &[usize]) -> Vec<Option<ShapeChange>> {
        // Rows far from the register need the polynomials of few nodes.
        let is_far = |place: &usize| self.distances.is_far(survey.galaxies[rows[*place]].transfers);
        let (far, near): (Vec<usize>, Vec<usize>) = (0..rows.len()).partition(is_far);
        let mut changes = vec![None; rows.len()];
        for places in [far, near] {
            let together = |places: &[usize]| {
                let rows: Vec<usize> = places.iter().map(|place| rows[*place]).collect();
                self.together(survey, &rows)
            };
            let found = parallel::map(places.chunks(TOGETHER), together);
            for (place, change) in places.into_iter().zip(found.into_iter().flatten()) {
                changes[place] = change;
            }
        }
        changes
    }

    /// The same for rows that are all far from the register or all near.
    fn together(&self, survey: &Survey, rows: &[usize]) -> Vec<Option<ShapeChange>> {
        let Some(first) = rows.first() else { return Vec::new() };
        let nodes = self.distances.around(survey.galaxies[*first].transfers);
        let points = self.place.of_rows(rows);
        let values = |(terms, coefficients): &(Terms, Array2<f64>), quantities: usize| {
            terms.sums(coefficients.slice(s![nodes.start * quantities..nodes.end * quantities, ..]), &points)
        };
        let (even, odd) = (values(&self.even, EVEN), values(&self.odd, QUANTITIES - EVEN));
        let change = |(place, row): (usize, &usize)| {
            if points.column(place).iter().any(|x| x.is_nan() || x.abs() > BEYOND) {
                return None;
            }
            let mut numbers = [0.0; QUANTITIES];
            for (node, weight) in self.distances.weights(survey.galaxies[*row].transfers)?.into_iter().enumerate() {
                for (quantity, number) in numbers.iter_mut().enumerate() {
                    *number += weight
                        * match quantity {
                            0..EVEN => even[[node * EVEN + quantity, place]],
                            _ => odd[[node * (QUANTITIES - EVEN) + quantity - EVEN, place]],
                        };
                }
            }
            Some(change_of(numbers))
        };
        rows.iter().enumerate().map(change).collect()
    }

    fn compared(&self, survey: &Survey, read_out: &[(usize, Option<ShapeChange>)]) -> HeldOut {
        let rows: Vec<usize> = read_out.iter().map(|(row, _)| *row).collect();
        let found = self.changes(survey, &rows).into_iter().zip(read_out);
        HeldOut::of(&found.filter_map(|(found, (_, expected))| found.zip(*expected)).collect::<Vec<_>>())
    }
}

/// A change as numbers.
fn numbers(change: &ShapeChange) -> [f64; QUANTITIES] {
    let ShapeChange { delta_e1, delta_e2, delta_x_px, delta_y_px, delta_size, delta_flux } = *change;
    [delta_e1, delta_y_px, delta_size, delta_flux, delta_e2, delta_x_px]
}

/// The change made of these numbers.
fn change_of([delta_e1, delta_y_px, delta_size, delta_flux, delta_e2, delta_x_px]: [f64; QUANTITIES]) -> ShapeChange {
    ShapeChange { delta_e1, delta_e2, delta_x_px, delta_y_px, delta_size, delta_flux }
}

/// Fitted galaxies, with their changes at the nodes.
#[derive(Default)]
struct Known {
    rows: Vec<usize>,
    changes: Vec<Option<Vec<ShapeChange>>>,
}

impl Known {
    fn extend(&mut self, survey: &Survey, distances: &Distances, rows: &[usize]) -> Result<(), InputError> {
        let devices = distances.nodes.iter().map(|node| survey.model.survey_device(survey.t_yr, *node));
        let devices = devices.collect::<Result<Vec<_>, InputError>>()?;
        let of = |row: &usize| survey.model.survey_changes(&survey.galaxies[*row], &devices);
        self.changes.extend(parallel::try_map(rows, of)?);
        self.rows.extend(rows);
        Ok(())
    }
}

/// Coordinates of galaxies between −1 and 1.
#[derive(Clone)]
struct Coordinates {
    /// Coordinates of each row of the catalogue, not scaled; zero for rows of another weight.
    unscaled: Arc<Vec<[f64; COORDINATES]>>,
    least: [f64; COORDINATES],
    largest: [f64; COORDINATES],
}

impl Coordinates {
    /// The coordinates of some rows.
    fn of(survey: &Survey, rows: &[usize]) -> Coordinates {
        let indices = rows.iter().map(|row| survey.galaxies[*row].sersic_index);
        let range = indices.fold([f64::INFINITY, 0.0], |range, index| [range[0].min(index), range[1].max(index)]);
        let observed = Observed::new(&survey.model.mission.psf, range);
        let of_row = |row: &usize| unscaled(&observed, &survey.galaxies[*row]);
        let found: Vec<[f64; COORDINATES]> = parallel::map(rows, of_row);
        let mut unscaled = vec![[0.0; COORDINATES]; survey.galaxies.len()];
        for (row, found) in rows.iter().zip(found) {
            unscaled[*row] = found;
        }
        let (least, largest) = ([-1.0; COORDINATES], [1.0; COORDINATES]);
        Coordinates { unscaled: Arc::new(unscaled), least, largest }.around(rows)
    }

    /// The same, scaled to the range of some rows.
    fn around(&self, rows: &[usize]) -> Coordinates {
        let [mut least, mut largest] = [[f64::INFINITY; COORDINATES], [f64::NEG_INFINITY; COORDINATES]];
        for row in rows {
            for (member, value) in self.unscaled[*row].into_iter().enumerate() {
                least[member] = least[member].min(value);
                largest[member] = largest[member].max(value);
            }
        }
        // The range of e2 is symmetric: a mirror image has the opposite sign.
        let e2 = COORDINATES - 1;
        largest[e2] = largest[e2].max(-least[e2]);
        least[e2] = -largest[e2];
        Coordinates { unscaled: Arc::clone(&self.unscaled), least, largest }
    }

    fn at(&self, row: usize) -> [f64; COORDINATES] {
        let mut coordinates = self.unscaled[row];
        for (member, x) in coordinates.iter_mut().enumerate() {
            let (least, largest) = (self.least[member], self.largest[member]);
            // A coordinate that is the same for all galaxies is at the centre.
            *x = if largest > least { (2.0 * *x - least - largest) / (largest - least) } else { *x - least };
        }
        coordinates
    }

    /// Coordinates of rows, `[(coordinate, row)]`.
    fn of_rows(&self, rows: &[usize]) -> Array2<f64> {
        let mut points = Array2::zeros((COORDINATES, rows.len()));
        for (place, row) in rows.iter().enumerate() {
            for (member, x) in self.at(*row).into_iter().enumerate() {
                points[[member, place]] = x;
            }
        }
        points
    }
}

fn unscaled(observed: &Observed, galaxy: &SurveyGalaxy) -> [f64; COORDINATES] {
    let SurveyGalaxy { flux_e, sersic_index, half_light_px, ellipticity, weight_px, .. } = *galaxy;
    let [share, size_px, e1, e2] = observed.shape(sersic_index, half_light_px, ellipticity, weight_px);
    [(share * flux_e).ln(), sersic_index.ln(), size_px.ln(), e1, e2]
}

/// Numbers of transfers at which polynomials are fitted.
#[derive(Clone)]
struct Distances {
    /// All nodes, ascending.
    nodes: Vec<u32>,
    /// The first of the nodes beyond the stamp.
    far: usize,
}

impl Distances {
    /// For the transfers of some rows.
    fn of(survey: &Survey, rows: &[usize]) -> Distances {
        let transfers = || rows.iter().map(|row| survey.galaxies[*row].transfers);
        let (least, most) = (transfers().min().unwrap_or(1), transfers().max().unwrap_or(1));
        let weight_px = rows.first().map_or(1.0, |row| survey.galaxies[*row].weight_px);
        // Rows from there on make transfers over the whole stamp.
        let edge = half_px(weight_px) as u32 + 1;
        let spread = |from: f64, to: f64, count: usize| -> Vec<f64> {
            let place = |node: usize| 0.5 - 0.5 * (std::f64::consts::PI * node as f64 / (count - 1) as f64).cos();
            (0..count).map(|node| from + (to - from) * place(node)).collect()
        };
        let mut nodes: Vec<u32> = Vec::new();
        if least < edge {
            let (from, to) = (f64::from(least).ln(), f64::from(edge.min(most)).ln());
            nodes.extend(spread(from, to, NEAR).into_iter().map(|log| log.exp().round() as u32));
            nodes.dedup();
        }
        let far = nodes.len().saturating_sub(usize::from(most > edge));
        if most > edge || nodes.is_empty() {
            let (from, to) = (f64::from(least.max(edge)), f64::from(most));
            nodes.extend(spread(from, to, FAR).into_iter().map(|place| place.round() as u32));
            nodes.dedup();
        }
        Distances { nodes, far }
    }

    /// Whether rows make transfers over the whole stamp.
    fn is_far(&self, transfers: u32) -> bool {
        self.nodes.get(self.far).is_some_and(|edge| transfers >= *edge)
    }

    /// The nodes between which a number of transfers is interpolated.
    fn around(&self, transfers: u32) -> Range<usize> {
        if self.is_far(transfers) { self.far..self.nodes.len() } else { 0..(self.far + 1).min(self.nodes.len()) }
    }

    /// Lagrange weights of these nodes. None outside all nodes.
    fn weights(&self, transfers: u32) -> Option<Vec<f64>> {
        let (first, last) = (*self.nodes.first()?, *self.nodes.last()?);
        if !(first..=last).contains(&transfers) {
            return None;
        }
        let is_far = self.is_far(transfers);
        let places = self.around(transfers);
        let x = |transfers: u32| if is_far { f64::from(transfers) } else { f64::from(transfers).ln() };
        let weight = |node: usize| {
            let factor =
                |other: usize| (x(transfers) - x(self.nodes[other])) / (x(self.nodes[node]) - x(self.nodes[other]));
            places.clone().filter(|other| *other != node).map(factor).product::<f64>()
        };
        Some(places.clone().map(weight).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nodes_of_transfers_reproduce_parabolas_and_themselves() {
        let distances = Distances { nodes: vec![1, 2, 5, 12, 28, 839, 1650], far: 4 };
        let law = |t: f64| 3.0 + 0.5 * t - 1e-4 * t * t;
        for transfers in [28, 100, 839, 1650] {
            let nodes = &distances.nodes[distances.around(transfers)];
            let weights = distances.weights(transfers).unwrap();
            let found: f64 = nodes.iter().zip(weights).map(|(node, weight)| weight * law(f64::from(*node))).sum();
            assert!((found / law(f64::from(transfers)) - 1.0).abs() < 1e-12);
        }
        for (node, transfers) in [1, 2, 5, 12].into_iter().enumerate() {
            for (other, weight) in distances.around(transfers).zip(distances.weights(transfers).unwrap()) {
                assert!((weight - f64::from(u8::from(other == node))).abs() < 1e-12);
            }
        }
        assert!(distances.weights(1651).is_none() && distances.weights(0).is_none());
    }
}
