//! Place → magnetic field of the Earth, from spherical harmonics.
//!
//! V = a Σ (a/r)ⁿ⁺¹ (g cos mλ + h sin mλ) P_nm(θ), B = −∇V, with Schmidt's semi-normalised P_nm and a = 6371.2 km. The gradient is
//! computed in Cartesian coordinates by the recursion of Cunningham 1970 (Celestial Mechanics 2, 207), as in Montenbruck & Gill
//! 2000 (Satellite Orbits, section 3.2.4): no singular poles, no trigonometric functions.

use std::sync::LazyLock;

use crate::{number, rows};

/// Real and imaginary parts of the solid harmonics of one order, by degree.
type Column = [(f64, f64); ORDERS];

/// Highest degree of the models, plus the two that the gradient needs.
const ORDERS: usize = 13;

/// Share of the field that may be neglected far from the Earth, where high degrees have decayed.
const NEGLIGIBLE: f64 = 1e-6;

/// Gauss coefficients of the main field, nT, Schmidt semi-normalised.
#[derive(Clone, Debug)]
pub struct Coefficients {
    /// `(n, m, g, h)`.
    terms: Vec<(usize, usize, f64, f64)>,
}

impl Coefficients {
    /// Only the axial dipole with a moment (nT RE³).
    pub fn axial_dipole(moment: f64) -> Coefficients {
        Coefficients { terms: vec![(1, 0, -moment, 0.0)] }
    }

    /// The coefficients of degree `n` and order `m`; 0 beyond the model's degree.
    pub fn at(&self, n: usize, m: usize) -> (f64, f64) {
        self.terms.iter().find(|term| (term.0, term.1) == (n, m)).map_or((0.0, 0.0), |term| (term.2, term.3))
    }
}

/// A field for evaluation.
#[derive(Clone, Debug)]
pub struct Field {
    /// For each degree from 1 on, for each order, the coefficients (nT) without normalisation.
    degrees: Vec<Vec<(f64, f64)>>,
    /// For each degree, the radius beyond which it and all higher ones are negligible.
    reach: Vec<f64>,
}

/// Jensen & Cain 1962 at 1960.0, degree 6: the field of AP-8 MIN.
pub static JENSEN_CAIN_1960: LazyLock<Field> =
    LazyLock::new(|| Field::of(&table(include_str!("../data/jensen_cain_1960.csv"))));

/// GSFC 12/66 (Cain et al. 1967) at 1970.0, degree 10: the field of AP-8 MAX.
pub static GSFC_1266_1970: LazyLock<Field> =
    LazyLock::new(|| Field::of(&table(include_str!("../data/gsfc_1266_1970.csv"))));

/// A table of `n, m, g, h`.
fn table(csv: &'static str) -> Coefficients {
    let term = |row: Vec<&str>| (number(row[0]) as usize, number(row[1]) as usize, number(row[2]), number(row[3]));
    Coefficients { terms: rows(csv).map(term).collect() }
}

/// International Geomagnetic Reference Field at a decimal year: linear between its epochs (1960 to 2025), extrapolated with the
/// last or first slope beyond.
pub fn igrf(year: f64) -> Coefficients {
    const FIRST: f64 = 1960.0;
    const STEP: f64 = 5.0;
    let mut terms: Vec<(usize, usize, f64, f64)> = Vec::new();
    for row in rows(include_str!("../data/igrf_1960_2025.csv")) {
        let values: Vec<f64> = row[3..].iter().map(|cell| number(cell)).collect();
        let place = (year - FIRST) / STEP;
        let before = (place.floor().max(0.0) as usize).min(values.len() - 2);
        let share = place - before as f64;
        let value = values[before] + share * (values[before + 1] - values[before]);
        let (n, m) = (number(row[1]) as usize, number(row[2]) as usize);
        match terms.iter_mut().find(|term| (term.0, term.1) == (n, m)) {
            Some(term) if row[0] == "h" => term.3 = value,
            Some(term) => term.2 = value,
            None if row[0] == "h" => terms.push((n, m, 0.0, value)),
            None => terms.push((n, m, value, 0.0)),
        }
    }
    Coefficients { terms }
}

impl Field {
    /// The field of Gauss coefficients.
    pub fn of(coefficients: &Coefficients) -> Field {
        let degree = coefficients.terms.iter().map(|term| term.0).max().unwrap_or(0);
        let mut degrees: Vec<Vec<(f64, f64)>> = (1..=degree).map(|n| vec![(0.0, 0.0); n + 1]).collect();
        let mut power = vec![0.0; degree];
        for &(n, m, g, h) in &coefficients.terms {
            let schmidt = schmidt(n, m);
            degrees[n - 1][m] = (g * schmidt, h * schmidt);
            // Mean square of the field of a degree at r = 1 (Lowes 1966): (n + 1) Σ (g² + h²).
            power[n - 1] += (n as f64 + 1.0) * (g * g + h * h);
        }
        let reach = (0..degree)
            .map(|index| {
                // The field of degree n decreases as r⁻⁽ⁿ⁺²⁾, that of the dipole as r⁻³.
                let radius = |above: usize| {
                    let relative = (power[above] / power[0]).sqrt() / NEGLIGIBLE;
                    if above == 0 { f64::INFINITY } else { relative.powf(1.0 / above as f64) }
                };
                (index..degree).map(radius).fold(0.0, f64::max)
            })
            .collect();
        Field { degrees, reach }
    }

    /// Field (nT) at a geocentric place, both along the axes to (0° N, 0° E), (0° N, 90° E) and the north pole.
    pub fn at(&self, place: [f64; 3]) -> [f64; 3] {
        let [x, y, z] = place;
        let inverse2 = 1.0 / (x * x + y * y + z * z);
        let radius = inverse2.sqrt().recip();
        let degree = self.reach.iter().take_while(|reach| **reach > radius).count();
        let (x, y, z) = (x * inverse2, y * inverse2, z * inverse2);
        // Solid harmonics V + iW of two neighbouring orders, by degree.
        let mut sectoral = (1.0 / radius, 0.0);
        let mut columns = [[(0.0, 0.0); ORDERS]; 3];
        let [below, here, above] = &mut columns;
        let (mut below, mut here, mut above) = (below, here, above);
        column(here, sectoral, 0, degree, z, inverse2);
        let mut field = [0.0; 3];
        for m in 0..=degree {
            let next = (2 * m + 1) as f64;
            sectoral = (next * (x * sectoral.0 - y * sectoral.1), next * (x * sectoral.1 + y * sectoral.0));
            column(above, sectoral, m + 1, degree, z, inverse2);
            for n in m.max(1)..=degree {
                let gradient = gradient(self.degrees[n - 1][m], n, m, below[n + 1], here[n + 1], above[n + 1]);
                for (component, part) in field.iter_mut().zip(gradient) {
                    *component -= part;
                }
            }
            (below, here, above) = (here, above, below);
        }
        field
    }
}

/// Solid harmonics of one order, by degree up to one above `degree`, from the sectoral one.
#[inline(always)]
fn column(harmonics: &mut Column, sectoral: (f64, f64), m: usize, degree: usize, z: f64, inverse2: f64) {
    /// 1/n: divisions would dominate the time.
    const INVERSE: [f64; ORDERS + 1] = {
        let mut inverse = [0.0; ORDERS + 1];
        let mut n = 1;
        while n <= ORDERS {
            inverse[n] = 1.0 / n as f64;
            n += 1;
        }
        inverse
    };
    let (mut back, mut last) = ((0.0, 0.0), sectoral);
    harmonics[m] = sectoral;
    for n in m + 1..=degree + 1 {
        let scale = INVERSE[n - m];
        let up = scale * (2 * n - 1) as f64 * z;
        let down = scale * (n + m - 1) as f64 * inverse2;
        (back, last) = (last, (up * last.0 - down * back.0, up * last.1 - down * back.1));
        harmonics[n] = last;
    }
}

/// Gradient of one term, from the harmonics of the next degree and of the orders below, at, and above its own.
fn gradient(
    (c, s): (f64, f64),
    n: usize,
    m: usize,
    below: (f64, f64),
    here: (f64, f64),
    above: (f64, f64),
) -> [f64; 3] {
    let along = -((n - m + 1) as f64) * (c * here.0 + s * here.1);
    if m == 0 {
        return [-c * above.0, -c * above.1, along];
    }
    let weight = ((n - m + 2) * (n - m + 1)) as f64;
    [
        0.5 * (weight * (c * below.0 + s * below.1) - (c * above.0 + s * above.1)),
        0.5 * (weight * (s * below.0 - c * below.1) + (s * above.0 - c * above.1)),
        along,
    ]
}

/// √((2 − δ_m0)(n − m)!/(n + m)!): Schmidt's P_nm over the one without normalisation.
fn schmidt(n: usize, m: usize) -> f64 {
    let ratio: f64 = (n - m + 1..=n + m).map(|k| 1.0 / k as f64).product();
    (if m == 0 { 1.0 } else { 2.0 * ratio }).sqrt()
}

/// Length of a vector.
pub(crate) fn length(vector: [f64; 3]) -> f64 {
    vector.iter().map(|component| component * component).sum::<f64>().sqrt()
}
