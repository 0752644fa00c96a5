//! Removal of the common errors of a data set's rows from its residuals.
//!
//! Residuals (value − model)/sigma of independent rows are unchanged. Rows of a group may have a known error c in common
//! (`sigma_common`): residuals in units of their own errors s have the covariance 1 + u uᵀ, with u = c/s, whose inverse square root
//! multiplies the part along u by 1/√(1 + |u|²). If errors of neighbouring pixels of a trail are correlated by
//! r (r^d at a distance of d), each but the first is replaced by the part not predicted by the previous one, (e_k − r^d
//! e_(k−1))/√(1 − r^2d): the Cholesky factor of a first-order autoregressive process. A constant pedestal of a file is allowed for
//! by replacing its mean residual z (in units of its own error) by z/√(1 + z²/C): nearly unchanged up to a few sigma, at most √C
//! beyond. All of this is smooth, so that a fit can follow it.

use std::collections::BTreeMap;
use std::ops::Range;

use nalgebra::{DMatrix, DVector};

use crate::analysis::measurement::DataSet;
use crate::numeric::least_squares::Span;

/// Common errors of a data set's rows; none by default.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Shared {
    /// Correlation of neighbours in a trail.
    pub correlation: f64,
    /// Its error.
    pub correlation_sigma: f64,
    /// The neighbours that it refers to.
    pub neighbours: Neighbours,
    /// Whether the file may carry a constant pedestal.
    pub pedestal: bool,
    /// Wrong rows, by their indices in the data set: they have no neighbours.
    pub wrong: Vec<usize>,
    /// Rows confirmed by a model that explains the data, by their indices in the data set.
    pub right: Vec<usize>,
    /// Degrees of freedom from which the scale of the errors was estimated; None if it was not.
    pub freedom: Option<f64>,
}

/// Rows of a trail whose errors have the given correlation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Neighbours {
    /// Adjacent pixels: for a distance of d pixels its power d.
    #[default]
    Pixels,
    /// Adjacent rows of the file in the trail, at any distance.
    Rows,
}

/// The maximum contribution of a pedestal to chi2, C. It is less than the gain required of an effect, or one would be claimed in
/// place of a pedestal. It is more than the margin of a rival, or a pedestal would admit rivals that also need one.
pub(crate) const PEDESTAL: f64 = 12.0;

/// The largest correlation of neighbours that is allowed for.
pub(crate) const LARGEST_CORRELATION: f64 = 0.95;

/// Norm of a column orthogonal to the others, below which it is linearly dependent.
const FLAT: f64 = 1e-5;

/// Minimum number of rows in a file for a pedestal: with few values, it may absorb a whole effect.
const FEW: usize = 4;

/// The preceding row in the same trail, and the distance in pixels.
pub(crate) type Link = Option<(usize, i32)>;

/// Makes errors of rows independent, and allows for pedestals.
pub struct Whitening {
    /// For each row its error over the part that it does not have in common with others.
    over_own: Vec<f64>,
    /// Groups of rows with a known error in common.
    groups: Vec<Group>,
    /// For each row the previous row, and its correlation with it.
    before: Vec<Option<(usize, f64)>>,
    pedestals: Vec<Pedestal>,
}

/// Rows with a known error in common, each with its component of the unit vector u/|u|; and |u|.
struct Group {
    along: Vec<(usize, f64)>,
    length: f64,
}

/// The direction of a file's constant, and its length for one unit of the value.
struct Pedestal {
    set: usize,
    rows: Range<usize>,
    along: DVector<f64>,
    length: f64,
}

impl Whitening {
    /// For the wanted rows only (by their indices among all).
    pub fn of(data: &[DataSet], wanted: impl Fn(usize) -> bool) -> Whitening {
        let (mut before, mut ends, mut first) = (Vec::new(), Vec::new(), 0);
        let mut over_own = Vec::new();
        for set in data {
            let rows: Vec<usize> = (0..set.rows.len()).filter(|row| wanted(first + row)).collect();
            let start = before.len();
            over_own.extend(rows.iter().map(|&row| set.rows[row].sigma / set.rows[row].own_sigma()));
            let shared = &set.shared;
            if shared.correlation == 0.0 {
                before.resize(start + rows.len(), None);
            } else {
                let links = trails(set, |row| wanted(first + row) && !shared.wrong.contains(&row));
                let place = |row: usize| start + rows.binary_search(&row).expect("a row that is wanted");
                before.extend(rows.iter().map(|&row| {
                    let (neighbour, apart) = links[row]?;
                    Some((place(neighbour), shared.between(apart)))
                }));
            }
            ends.push((rows, start..before.len()));
            first += set.rows.len();
        }
        let mut whitening = Whitening { over_own, groups: Vec::new(), before, pedestals: Vec::new() };
        let of_set =
            |(set, (rows, range)): (&DataSet, &(Vec<usize>, Range<usize>))| whitening.groups_of(set, rows, range.start);
        whitening.groups = data.iter().zip(&ends).flat_map(of_set).collect();
        let pedestals =
            data.iter().zip(ends).enumerate().filter(|(_, (set, (rows, _)))| set.shared.pedestal && rows.len() >= FEW);
        let pedestals = pedestals.map(|(index, (set, (rows, range)))| {
            let mut constant = vec![0.0; whitening.before.len()];
            for (place, row) in range.clone().zip(rows) {
                constant[place] = 1.0 / set.rows[row].sigma;
            }
            let along = DVector::from_vec(whitening.linear(&constant)).rows_range(range.clone()).into_owned();
            let length = along.norm();
            Pedestal { set: index, rows: range, along: along / length, length }
        });
        whitening.pedestals = pedestals.collect();
        whitening
    }

    /// The groups of a data set, of whose rows some are wanted; the first one is row `start` of all wanted ones.
    fn groups_of(&self, set: &DataSet, rows: &[usize], start: usize) -> Vec<Group> {
        let mut behind = vec![None; rows.len()];
        for (place, link) in self.before[start..start + rows.len()].iter().enumerate() {
            if let Some((before, shared)) = link {
                behind[before - start] = Some((place, *shared));
            }
        }
        // The part that is not predicted by the row before, as in `uncorrelated`.
        let unpredicted =
            |place: usize| self.before[start + place].map_or(1.0, |(_, shared)| (1.0 - shared * shared).sqrt());
        let mut groups: BTreeMap<usize, BTreeMap<usize, f64>> = BTreeMap::new();
        for (place, row) in rows.iter().map(|row| &set.rows[*row]).enumerate().filter(|(_, row)| row.common.sigma > 0.0)
        {
            let along = groups.entry(row.common.group).or_default();
            let share = row.common.sigma / row.own_sigma();
            *along.entry(start + place).or_default() += share / unpredicted(place);
            if let Some((next, shared)) = behind[place] {
                *along.entry(start + next).or_default() -= shared * share / unpredicted(next);
            }
        }
        let of = |along: BTreeMap<usize, f64>| {
            let length = along.values().map(|share| share * share).sum::<f64>().sqrt();
            Group { along: along.into_iter().map(|(row, share)| (row, share / length)).collect(), length }
        };
        groups.into_values().map(of).collect()
    }

    /// A change of the residuals, without common errors of rows, pedestals kept.
    pub fn linear(&self, residuals: &[f64]) -> Vec<f64> {
        let mut white = self.uncorrelated(residuals);
        for group in &self.groups {
            group.multiply(&mut white, 1.0 / group.growth());
        }
        white
    }

    /// In units of the rows' own errors, and without their correlation along trails.
    fn uncorrelated(&self, residuals: &[f64]) -> Vec<f64> {
        let own = |row: usize| residuals[row] * self.over_own[row];
        let one = |(row, link): (usize, &Option<(usize, f64)>)| match link {
            None => own(row),
            Some((before, shared)) => (own(row) - shared * own(*before)) / (1.0 - shared * shared).sqrt(),
        };
        self.before.iter().enumerate().map(one).collect()
    }

    /// The inverse of [`Whitening::linear`].
    pub fn undone(&self, white: &[f64]) -> Vec<f64> {
        let mut white = white.to_vec();
        for group in self.groups.iter().rev() {
            group.multiply(&mut white, group.growth());
        }
        let mut found: Vec<Option<f64>> = vec![None; white.len()];
        for row in 0..white.len() {
            // From the row back to the first known one of its trail, and forward again.
            let mut way = vec![row];
            while let Some((before, _)) =
                self.before[*way.last().expect("a row")].filter(|(before, _)| found[*before].is_none())
            {
                way.push(before);
            }
            for row in way.into_iter().rev() {
                let value = match self.before[row] {
                    None => white[row],
                    Some((before, shared)) => {
                        white[row] * (1.0 - shared * shared).sqrt()
                            + shared * found[before].expect("the way leads there")
                    }
                };
                found[row] = Some(value);
            }
        }
        found.into_iter().zip(&self.over_own).map(|(value, over_own)| value.expect("every row") / over_own).collect()
    }

    /// Residuals with independent errors, pedestals allowed for.
    pub fn residuals(&self, residuals: &[f64]) -> Vec<f64> {
        let mut white = self.linear(residuals);
        for pedestal in &self.pedestals {
            let level = pedestal.level(&white);
            let counted = level / (1.0 + level * level / PEDESTAL).sqrt();
            pedestal.add(&mut white, counted - level);
        }
        white
    }

    /// The same with significant pedestals removed completely.
    pub fn levelled(&self, residuals: &[f64]) -> Vec<f64> {
        let mut white = self.linear(residuals);
        for pedestal in &self.pedestals {
            let level = pedestal.level(&white);
            if level * level > PEDESTAL {
                pedestal.add(&mut white, -level);
            }
        }
        white
    }

    /// Transforms a small change of such residuals, if pedestals have the given levels.
    pub fn change(&self, linear: &mut [f64], levels: &[f64]) {
        for (pedestal, level) in self.pedestals.iter().zip(levels) {
            let along = pedestal.level(linear);
            pedestal.add(linear, (slope(*level) - 1.0) * along);
        }
    }

    /// The data set of each pedestal.
    pub(crate) fn pedestal_sets(&self) -> Vec<usize> {
        self.pedestals.iter().map(|pedestal| pedestal.set).collect()
    }

    /// No longer allows for pedestals.
    pub(crate) fn forget_pedestals(&mut self) {
        self.pedestals.clear();
    }

    /// The level of each pedestal, in units of its own error, in linear residuals.
    pub fn levels(&self, linear: &[f64]) -> Vec<f64> {
        self.pedestals.iter().map(|pedestal| pedestal.level(linear)).collect()
    }

    /// The contribution of each significant pedestal to chi2, at its level; 0 for others.
    pub fn costs(&self, levels: &[f64]) -> Vec<f64> {
        let of = |level: &f64| {
            let square = level * level;
            if square > PEDESTAL { square / (1.0 + square / PEDESTAL) } else { 0.0 }
        };
        levels.iter().map(of).collect()
    }

    /// Data set, value and error of each pedestal, in the unit of the values, in linear residuals of a fit with those derivatives
    /// (of its residuals, pedestals allowed for); the error is that with all parameters free.
    pub fn pedestals(&self, linear: &[f64], jacobian: &DMatrix<f64>) -> Vec<(usize, f64, f64)> {
        let levels = self.levels(linear);
        let mut derivatives = jacobian.clone();
        for mut column in derivatives.column_iter_mut() {
            for (pedestal, level) in self.pedestals.iter().zip(&levels) {
                let along = pedestal.level(column.as_slice());
                pedestal.add(column.as_mut_slice(), (1.0 / slope(*level) - 1.0) * along);
            }
        }
        let span = Span::of(&derivatives, FLAT);
        let of = |(pedestal, level): (&Pedestal, f64)| {
            let mut constant = vec![0.0; linear.len()];
            pedestal.add(&mut constant, 1.0);
            let known = (1.0 - span.directions().tr_mul(&DVector::from_vec(constant)).norm_squared()).max(FLAT);
            (pedestal.set, level / pedestal.length, 1.0 / (pedestal.length * known.sqrt()))
        };
        self.pedestals.iter().zip(levels).map(of).collect()
    }
}

/// Derivative of a pedestal's transformed level with respect to the level.
fn slope(level: f64) -> f64 {
    (1.0 + level * level / PEDESTAL).powf(-1.5)
}

impl Group {
    /// Standard deviation along the group's direction, in units of that of a row's own error.
    fn growth(&self) -> f64 {
        self.length.hypot(1.0)
    }

    /// Multiplies the part along the group's direction.
    fn multiply(&self, white: &mut [f64], factor: f64) {
        let level: f64 = self.along.iter().map(|(row, along)| white[*row] * along).sum();
        for (row, along) in &self.along {
            white[*row] += (factor - 1.0) * level * along;
        }
    }
}

impl Pedestal {
    fn level(&self, white: &[f64]) -> f64 {
        white[self.rows.clone()].iter().zip(self.along.iter()).map(|(white, along)| white * along).sum()
    }

    fn add(&self, white: &mut [f64], amount: f64) {
        for (white, along) in white[self.rows.clone()].iter_mut().zip(self.along.iter()) {
            *white += amount * along;
        }
    }
}

impl Shared {
    /// Correlation of two neighbouring rows of a trail, at a distance in pixels.
    pub fn between(&self, apart: i32) -> f64 {
        match self.neighbours {
            Neighbours::Pixels => self.correlation.powi(apart),
            Neighbours::Rows => self.correlation,
        }
    }
}

/// For each row of a data set the previous row in the same trail, among the wanted ones, and their distance in pixels.
pub(crate) fn trails(set: &DataSet, wanted: impl Fn(usize) -> bool) -> Vec<Link> {
    let others: Vec<Vec<f64>> =
        set.varying.iter().filter(|name| *name != "trail_px").map(|name| set.against(name)).collect();
    let pixel = |row: usize| set.rows[row].at.trail_px.unwrap_or(0) as i32;
    let trail =
        |a: usize, b: usize| others.iter().map(|column| column[a].total_cmp(&column[b])).find(|order| order.is_ne());
    let mut rows: Vec<usize> = (0..set.rows.len()).filter(|row| wanted(*row)).collect();
    rows.sort_by(|&a, &b| trail(a, b).unwrap_or(pixel(a).cmp(&pixel(b))).then(a.cmp(&b)));
    let mut before = vec![None; set.rows.len()];
    for pair in rows.windows(2) {
        let apart = pixel(pair[1]) - pixel(pair[0]);
        if trail(pair[0], pair[1]).is_none() && apart > 0 {
            before[pair[1]] = Some((pair[0], apart));
        }
    }
    before
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::table::Table;
    use crate::mission::Mission;

    /// Rows of two groups with known errors in common, own errors correlated along trails: chi2 is that of their covariance matrix,
    /// and nothing is lost.
    #[test]
    fn chi2_is_that_of_the_covariance_matrix() {
        let text = "# observable: trail\n# t_yr: 3.0\n\
            trail_px,signal_e,value,sigma,sigma_common,common_group\n\
            1,500,0.01,0.004,0.003,a\n2,500,0.01,0.003,0.002,a\n3,500,0.01,0.003,,a\n\
            1,800,0.01,0.002,0.0015,b\n2,800,0.01,0.001,0.0009,b\n4,800,0.01,0.002,0.0,b\n";
        let mission = Mission::read("missions/snap_l2.toml").unwrap();
        let mut set = DataSet::of(Table::parse("trails.csv", text).unwrap(), &mission).unwrap();
        for correlation in [0.0, 0.6] {
            set.shared.correlation = correlation;
            let links = trails(&set, |_| true);
            assert_eq!(links.iter().flatten().count(), 4);
            let row = |row: usize| &set.rows[row];
            let covariance = DMatrix::from_fn(6, 6, |i, j| {
                let same_trail = row(i).at.signal_e == row(j).at.signal_e;
                let pixel = |index: usize| f64::from(row(index).at.trail_px.unwrap());
                let own = match same_trail {
                    true => correlation.powf((pixel(i) - pixel(j)).abs()) * row(i).own_sigma() * row(j).own_sigma(),
                    false => 0.0,
                };
                own + if same_trail { row(i).common.sigma * row(j).common.sigma } else { 0.0 }
            });
            let off = DVector::from_vec(vec![0.003, -0.001, 0.002, -0.002, 0.0005, 0.001]);
            let expected = off.dot(&(covariance.try_inverse().unwrap() * &off));
            let over_sigma: Vec<f64> = off.iter().zip(&set.rows).map(|(off, row)| off / row.sigma).collect();
            let whitening = Whitening::of(std::slice::from_ref(&set), |_| true);
            let white = whitening.linear(&over_sigma);
            let chi2: f64 = white.iter().map(|residual| residual * residual).sum();
            assert!((chi2 / expected - 1.0).abs() < 1e-12, "{chi2}, {expected}");
            for (undone, given) in whitening.undone(&white).iter().zip(&over_sigma) {
                assert!((undone - given).abs() < 1e-12, "{undone}, {given}");
            }
        }
    }
}
