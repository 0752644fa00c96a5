//! Rows that are wrong, found one by one.
//!
//! A row is wrong if it is far from the smooth prediction of all others (an externally studentised residual: Cook & Weisberg 1982,
//! Residuals and Influence in Regression, section 2.2), in units of the scatter of the others: smooth directions are many, and one
//! wrong row bends them enough to hide itself. The farthest row is left out and the rest is smoothed again, until more than one in
//! twenty is out. All rows up to the last one that was far are wrong (Rosner 1983, Technometrics 25, 165), so that two cannot mask
//! each other. If more than one in twenty is far, these are no accidents of single rows; nor are adjacent rows with residuals of
//! the same sign, if there are more of them than expected by chance.

use nalgebra::{DMatrix, DVector};
use statrs::distribution::{ContinuousCDF, Discrete, Poisson, StudentsT};

use crate::analysis::measurement::DataSet;
use crate::numeric::least_squares::Span;

/// Distance from which a row is wrong, in units of the scatter, and the probability that noise puts any row of the file there.
pub(in crate::analysis::diagnose) const FAR: f64 = 5.0;
const BY_CHANCE: f64 = 2e-3;

/// One row in this number may be wrong.
const ONE_IN: usize = 20;

/// Part of a row's residual that is its own, below which the row is not judged: it may be all that shows an effect.
const ITS_OWN: f64 = 0.15;

/// Probability below which adjacent far rows are no coincidence.
const NO_ACCIDENT: f64 = 0.01;

/// Largest number of rows of a file that may be wrong.
pub(in crate::analysis::diagnose) fn most(rows: usize) -> usize {
    rows.div_ceil(ONE_IN)
}

/// Wrong rows, ascending, each with its distance from the prediction of the others, in quoted errors. The scatter is not taken as
/// less than `least_scatter`, in quoted errors.
pub(super) fn of(residuals: &DVector<f64>, smooth: &DMatrix<f64>, least_scatter: f64) -> Vec<(usize, f64)> {
    let (most, mut out, mut wrong) = (most(residuals.len()), Vec::new(), 0);
    while out.len() <= most {
        let Some(judged) = Judged::without(&out, residuals, smooth) else { break };
        let Some((row, size)) = judged.farthest() else { break };
        out.push(row);
        if judged.is_far(size, least_scatter) {
            wrong = out.len();
        }
    }
    if wrong > most {
        return Vec::new();
    }
    out.truncate(wrong);
    // Several wrong rows together distort what is smooth at others that are right.
    let right = |out: &Vec<usize>| {
        out.iter().position(|&row| {
            let rest: Vec<usize> = out.iter().copied().filter(|other| *other != row).collect();
            let judged = Judged::without(&rest, residuals, smooth);
            judged.is_none_or(|judged| judged.size(row).is_none_or(|size| !judged.is_far(size, least_scatter)))
        })
    };
    while let Some(place) = right(&out) {
        out.remove(place);
    }
    out.sort_unstable();
    let right = others(residuals.len(), &out);
    let found = Span::of(&smooth.select_rows(&right), FLAT).solve(&residuals.select_rows(&right));
    let far: Vec<(usize, f64)> =
        out.into_iter().map(|row| (row, residuals[row] - (smooth.row(row) * &found)[0])).collect();
    if are_together(&far, residuals.len()) { Vec::new() } else { far }
}

/// Share of a column beyond the others, below which it is linearly dependent.
const FLAT: f64 = 1e-6;

/// Rows that are not left out.
fn others(rows: usize, out: &[usize]) -> Vec<usize> {
    (0..rows).filter(|row| !out.contains(row)).collect()
}

/// Distances of rows from what is smooth, with some left out.
struct Judged {
    /// Rows that can be judged, each with its residual over √(1 − leverage): the studentised residual times the scatter.
    sizes: Vec<(usize, f64)>,
    /// Rows used.
    rows: f64,
    /// Sum of squares about what is smooth.
    squares: f64,
    /// Its degrees of freedom when one more row is out.
    law: StudentsT,
}

impl Judged {
    /// None if too few rows remain.
    fn without(out: &[usize], residuals: &DVector<f64>, smooth: &DMatrix<f64>) -> Option<Judged> {
        let right = others(residuals.len(), out);
        let directions = Span::of(&smooth.select_rows(&right), FLAT).directions().clone();
        let here = residuals.select_rows(&right);
        let left = &here - &directions * directions.tr_mul(&here);
        let studentised = |place: usize| {
            let own = 1.0 - directions.row(place).norm_squared();
            (own > ITS_OWN).then(|| (right[place], left[place].abs() / own.sqrt()))
        };
        let rows = right.len() as f64;
        let law = StudentsT::new(0.0, 1.0, rows - directions.ncols() as f64 - 1.0).ok()?;
        let sizes = (0..right.len()).filter_map(studentised).collect();
        Some(Judged { sizes, rows, squares: left.norm_squared(), law })
    }

    fn farthest(&self) -> Option<(usize, f64)> {
        self.sizes.iter().copied().max_by(|a, b| a.1.total_cmp(&b.1))
    }

    fn size(&self, row: usize) -> Option<f64> {
        self.sizes.iter().find(|(known, _)| *known == row).map(|(_, size)| *size)
    }

    /// Whether a row of that size is far from the others.
    fn is_far(&self, size: f64, least_scatter: f64) -> bool {
        // Without the row the residual sum of squares decreases by the square of its size.
        let scatter = ((self.squares - size * size).max(0.0) / self.law.freedom()).sqrt().max(least_scatter);
        let by_chance = 2.0 * self.law.sf(size / scatter) * self.rows;
        size > FAR * scatter && by_chance < BY_CHANCE
    }
}

/// Whether more wrong rows than expected by chance are adjacent and of the same sign.
fn are_together(far: &[(usize, f64)], rows: usize) -> bool {
    let same = |pair: &&[(usize, f64)]| pair[1].0 == pair[0].0 + 1 && pair[0].1.signum() == pair[1].1.signum();
    let pairs = far.windows(2).filter(same).count() as u64;
    // A pair of wrong rows is adjacent with a probability of 2/rows, and of the same sign in half of these cases.
    let by_chance = (far.len() * far.len().saturating_sub(1)) as f64 / (2 * rows) as f64;
    let Ok(law) = Poisson::new(by_chance) else { return false };
    let fewer: f64 = (0..pairs).map(|pairs| law.pmf(pairs)).sum();
    1.0 - fewer < NO_ACCIDENT
}

/// Whether rows (each with its residual) are all of an epoch, two or more, and of one sign.
pub(super) fn are_whole_epoch(times_yr: &[f64], far: &[(usize, f64)]) -> bool {
    far.iter().any(|(row, off)| {
        let is_then = |other: &usize| times_yr[*other] == times_yr[*row];
        let with = far.iter().filter(|(other, of_it)| is_then(other) && of_it * off > 0.0).count();
        with > 1 && with == (0..times_yr.len()).filter(is_then).count()
    })
}

/// Whether rows of a file are all of an epoch, two or more, with residuals of one sign; or three or more have residuals of one sign and the
/// same value of a condition, with a probability below `NO_ACCIDENT` of doing so by chance: such as a ghost in one pixel of every
/// trail, by crosstalk.
pub(super) fn share_a_condition(set: &DataSet, far: &[(usize, f64)]) -> bool {
    let times_yr: Vec<f64> = set.rows.iter().map(|row| row.at.t_yr).collect();
    if are_whole_epoch(&times_yr, far) {
        return true;
    }
    let Some((&(first, off), others)) = far.split_first() else { return false };
    if others.len() < 2 || others.iter().any(|(_, other)| other * off < 0.0) {
        return false;
    }
    let by_chance = |name: &String| {
        let values = set.against(name);
        let alike = values.iter().filter(|value| **value == values[first]).count() as f64;
        let all_alike = others.iter().all(|(row, _)| values[*row] == values[first]);
        // Each other row has the value, and the sign.
        if all_alike { (0.5 * alike / values.len() as f64).powi(others.len() as i32) } else { 1.0 }
    };
    let least = set.varying.iter().map(by_chance).fold(1.0, f64::min);
    least * (set.varying.len() as f64) < NO_ACCIDENT
}

#[cfg(test)]
mod tests {
    use std::fmt::Write;

    use rand::seq::index::sample;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    use super::*;
    use crate::io::table::Table;
    use crate::mission::Mission;

    /// Noise about a few polynomials in the row index, as many as two fifths of the rows.
    fn noise(random: &mut ChaCha8Rng, rows: usize) -> (DVector<f64>, DMatrix<f64>) {
        let smooth = DMatrix::from_fn(rows, 2 * rows / 5, |row, power| {
            (std::f64::consts::PI * power as f64 * (row as f64 + 0.5) / rows as f64).cos()
        });
        let strengths = DVector::from_fn(smooth.ncols(), |_, _| random.random_range(-50.0..50.0));
        (DVector::from_fn(rows, |_, _| StandardNormal.sample(random)) + &smooth * strengths, smooth)
    }

    /// One row in 25, 12 to 30 sigma off, regardless of what is smooth in the others, in files of 16 rows and more. Rows that
    /// the smooth part follows almost exactly are not judged: they are the few that are missed. (Sixty files of each size.)
    #[test]
    fn rows_that_are_far_off_are_found_in_small_files_too() {
        let mut random = ChaCha8Rng::seed_from_u64(4);
        for rows in [16, 25, 50, 100] {
            let (mut found, mut made, mut others) = (0, 0, 0);
            for _ in 0..60 {
                let (mut residuals, smooth) = noise(&mut random, rows);
                let off = sample(&mut random, rows, (0.04 * rows as f64).round() as usize).into_vec();
                for &row in &off {
                    residuals[row] += random.random_range(12.0..30.0) * if random.random() { 1.0 } else { -1.0 };
                }
                let wrong = of(&residuals, &smooth, 0.3);
                made += off.len();
                found += wrong.iter().filter(|(row, _)| off.contains(row)).count();
                others += wrong.iter().filter(|(row, _)| !off.contains(row)).count();
            }
            assert!(found * 10 >= made * 9, "{rows} rows: {found} of {made}");
            // Of two adjacent rows the neighbours may be named, which differ from them by what is smooth.
            assert!(others * 20 <= made, "{rows} rows: {others} that were right");
        }
    }

    /// In noise alone one file in five hundred may name a row: of a thousand, two are expected.
    #[test]
    fn noise_alone_has_no_wrong_rows() {
        let mut random = ChaCha8Rng::seed_from_u64(7);
        for rows in [16, 40] {
            let named = (0..1000).filter(|_| {
                let (residuals, smooth) = noise(&mut random, rows);
                !of(&residuals, &smooth, 0.3).is_empty()
            });
            let named = named.count();
            assert!(named <= 7, "{rows} rows: {named} of 1000");
        }
    }

    #[test]
    fn neighbours_that_are_off_together_are_no_accidents() {
        assert!(!are_together(&[(3, 9.0), (20, -8.0), (21, 8.0)], 60));
        assert!(!are_together(&[(20, 8.0), (21, 8.0)], 40));
        assert!(are_together(&[(20, 8.0), (21, 8.0), (22, 9.0)], 60));
        assert!(are_together(&[(20, 8.0), (21, 8.0)], 400));
    }

    /// Nine trails of twenty pixels. A ghost in one pixel of all of them is no accident of single rows; as many rows elsewhere are.
    #[test]
    fn rows_of_one_pixel_are_no_accidents() {
        let mission = Mission::read("missions/snap_l2.toml").unwrap();
        let mut text = String::from("# observable: trail\n# t_yr: 3.0\ntransfers,trail_px,signal_e,value,sigma\n");
        for (transfers, signal_e) in (1..=9).map(|trail| (300 * (1 + trail % 3), 500 * (1 + trail / 3))) {
            for px in 1..=20 {
                writeln!(text, "{transfers},{px},{signal_e},0.0,1.0").unwrap();
            }
        }
        let set = DataSet::of(Table::parse("trail.csv", &text).unwrap(), &mission).unwrap();
        let rows = |of: &[usize], sign: f64| of.iter().map(|row| (*row, 9.0 * sign)).collect::<Vec<_>>();
        let ghost: Vec<usize> = (0..9).map(|trail| 20 * trail + 7).collect();
        assert!(share_a_condition(&set, &rows(&ghost, 1.0)));
        assert!(share_a_condition(&set, &rows(&ghost[..3], -1.0)));
        // Two may be, and rows of both signs, and rows of different pixels.
        assert!(!share_a_condition(&set, &rows(&ghost[..2], 1.0)));
        assert!(!share_a_condition(&set, &[rows(&ghost[..3], 1.0), rows(&ghost[3..4], -1.0)].concat()));
        assert!(!share_a_condition(&set, &rows(&[7, 28, 49, 130], 1.0)));
        assert!(!share_a_condition(&set, &[]));
    }
}
