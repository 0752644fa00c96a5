//! Removal of the common errors of a data set's rows from its residuals.
//!
//! Residuals (value − model)/sigma of independent rows are unchanged. Rows of a group may have a known error c in common
//! (`sigma_common`): residuals in units of their own errors s have the covariance 1 + u uᵀ, with u = c/s, whose inverse square root
//! multiplies the part along u by 1/√(1 + |u|²). If errors of neighbouring pixels of a trail are correlated by
//! r (r^d at a distance of d), each but the first is replaced by the part not predicted by the previous one, (e_k − r^d
//! e_(k−1))/√(1 − r^2d): the Cholesky factor of a first-order autoregressive process.
//! The constant that a file may carry is an error that all its rows have in common.

use std::collections::BTreeMap;
use std::ops::Range;

use crate::analysis::likelihood::series;
use crate::analysis::measurement::DataSet;

/// Common errors of a data set's rows; none by default.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Shared {
    /// Correlation of neighbours in a trail.
    pub correlation: f64,
    /// Its error.
    pub correlation_sigma: f64,
    /// Standard deviation of the constant that the file carries, in the unit of the values; 0 if it carries none.
    pub pedestal_sigma: f64,
    /// Wrong rows, by their indices in the data set: they have no neighbours.
    pub wrong: Vec<usize>,
    /// Rows confirmed by a model that explains the data, by their indices in the data set.
    pub right: Vec<usize>,
    /// Degrees of freedom from which the scale of the errors was estimated; None if it was not.
    pub freedom: Option<f64>,
}

/// The largest correlation of neighbours that is allowed for.
pub(crate) const LARGEST_CORRELATION: f64 = 0.95;

/// The preceding row in the same trail, and the distance in pixels.
pub(crate) type Link = Option<(usize, i32)>;

/// Makes errors of rows independent.
pub struct Whitening {
    /// For each row its error over the part that it does not have in common with others.
    over_own: Vec<f64>,
    /// Groups of rows with a known error in common.
    groups: Vec<Group>,
    /// For each row the previous row, and its correlation with it.
    before: Vec<Option<(usize, f64)>>,
}

/// Rows with a known error in common, each with its component of the unit vector u/|u|; and |u|.
struct Group {
    along: Vec<(usize, f64)>,
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
                let links = series::neighbours(set, |row| wanted(first + row) && !shared.wrong.contains(&row));
                let place = |row: usize| start + rows.binary_search(&row).expect("a row that is wanted");
                before.extend(rows.iter().map(|&row| {
                    let (neighbour, apart) = links[row]?;
                    Some((place(neighbour), shared.between(apart)))
                }));
            }
            ends.push((rows, start..before.len()));
            first += set.rows.len();
        }
        let mut whitening = Whitening { over_own, groups: Vec::new(), before };
        let of_set =
            |(set, (rows, range)): (&DataSet, &(Vec<usize>, Range<usize>))| whitening.groups_of(set, rows, range.start);
        whitening.groups = data.iter().zip(&ends).flat_map(of_set).collect();
        for (set, (rows, range)) in data.iter().zip(ends).filter(|(set, _)| set.shared.pedestal_sigma > 0.0) {
            let mut constant = vec![0.0; whitening.before.len()];
            for (place, row) in range.zip(&rows) {
                constant[place] = set.shared.pedestal_sigma / set.rows[*row].sigma;
            }
            // Beside the other errors in common.
            let along = whitening.linear(&constant);
            let length = along.iter().map(|share| share * share).sum::<f64>().sqrt();
            let along = along.into_iter().enumerate().filter(|(_, share)| *share != 0.0);
            whitening.groups.push(Group { along: along.map(|(row, share)| (row, share / length)).collect(), length });
        }
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

    /// Residuals, or a change of them, with independent errors.
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

impl Shared {
    /// Correlation of two neighbouring rows, at a distance in usual distances.
    pub fn between(&self, apart: f64) -> f64 {
        self.correlation.powf(apart)
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
    use nalgebra::{DMatrix, DVector};

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
