//! Drift shell → flux of trapped protons: the maps AP-8 MIN and AP-8 MAX.
//!
//! Sawyer & Vette 1976 (NSSDC/WDC-A-R&S 76-06). For each energy a map has strings, one for each of some values of L: along a string
//! log10 of the flux falls by 0.25 from point to point while B/B0 rises. Between strings and points it is interpolated as by Daly
//! et al. 1996 (IEEE Trans. Nucl. Sci. 43, 2771) and SPENVIS, in φ = asin[(b − 1)/(b_max − 1)] instead of b = B/B0, which preserves
//! the steep edge near the atmosphere. (NASA's own routine, in B/B0, gives 16 to 19 % less at 400 to 600 km.)

use std::f64::consts::FRAC_PI_2;
use std::sync::LazyLock;

use crate::dipole::Dipole;
use crate::drift_shell::MOMENT;
use crate::field::{Field, GSFC_1266_1970, JENSEN_CAIN_1960, igrf};
use crate::{number, rows};

/// Phase of the solar cycle of a map.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Activity {
    /// Solar minimum: AP-8 MIN, epoch 1964.
    Minimum,
    /// Solar maximum: AP-8 MAX, epoch 1970.
    Maximum,
}

impl Activity {
    /// The map.
    pub fn map(self) -> &'static Map {
        static MINIMUM: LazyLock<Map> = LazyLock::new(|| Map::parse(include_str!("../data/ap8min.csv")));
        static MAXIMUM: LazyLock<Map> = LazyLock::new(|| Map::parse(include_str!("../data/ap8max.csv")));
        match self {
            Activity::Minimum => &MINIMUM,
            Activity::Maximum => &MAXIMUM,
        }
    }

    /// The field in which the map was made. A map in another field has large errors at low altitude: the South Atlantic Anomaly
    /// sinks into an atmosphere that the map does not include.
    pub fn field(self) -> &'static Field {
        match self {
            Activity::Minimum => &JENSEN_CAIN_1960,
            Activity::Maximum => &GSFC_1266_1970,
        }
    }
}

impl Activity {
    /// The eccentric dipole of the map's epoch.
    pub fn dipole(self) -> &'static Dipole {
        static MINIMUM: LazyLock<Dipole> = LazyLock::new(|| Dipole::of(&igrf(1960.0)));
        static MAXIMUM: LazyLock<Dipole> = LazyLock::new(|| Dipole::of(&igrf(1970.0)));
        match self {
            Activity::Minimum => &MINIMUM,
            Activity::Maximum => &MAXIMUM,
        }
    }
}

/// A map of trapped protons.
#[derive(Debug)]
pub struct Map {
    /// By ascending energy.
    sheets: Vec<Sheet>,
    /// L, ascending, and the strongest field (nT) with protons on a shell up to the next L.
    reach: Vec<(f64, f64)>,
}

/// The map for one energy.
#[derive(Debug)]
struct Sheet {
    energy_mev: f64,
    /// By ascending L.
    strings: Vec<String>,
}

/// The map for one energy and one L.
#[derive(Debug)]
struct String {
    l: f64,
    /// B/B0 of the last point.
    edge: f64,
    /// φ and log10 flux, by ascending φ.
    points: Vec<(f64, f64)>,
}

impl Map {
    fn parse(csv: &'static str) -> Map {
        let rows: Vec<[f64; 4]> = rows(csv).map(|row| [0, 1, 2, 3].map(|column| number(row[column]))).collect();
        let same = |column: usize| move |a: &[f64; 4], b: &[f64; 4]| a[column] == b[column];
        let string = |rows: &[[f64; 4]]| {
            let points: Vec<(f64, f64)> = rows.iter().map(|row| (row[2], row[3])).collect();
            String::of(rows[0][1], &points)
        };
        let sheet =
            |rows: &[[f64; 4]]| Sheet { energy_mev: rows[0][0], strings: rows.chunk_by(same(1)).map(string).collect() };
        let sheets: Vec<Sheet> = rows.chunk_by(same(0)).map(sheet).collect();
        let mut reach: Vec<(f64, f64)> = sheets
            .iter()
            .flat_map(|sheet| &sheet.strings)
            .map(|string| (string.l, MOMENT * string.edge_over_l3()))
            .collect();
        reach.sort_by(|a, b| a.0.total_cmp(&b.0));
        // Between two shells the edge is between theirs.
        for index in 0..reach.len() {
            let next = reach.get(index + 1).map_or(0.0, |next| next.1);
            let before = index.checked_sub(1).map_or(0.0, |before| reach[before].1);
            reach[index].1 = reach[index].1.max(next).max(before);
        }
        Map { sheets, reach }
    }

    /// Field (nT) above which the map has no protons on any shell up to an L: such places are within the atmosphere.
    fn strongest_field_nt(&self, l: f64) -> f64 {
        let after = self.reach.partition_point(|shell| shell.0 <= l);
        after.checked_sub(1).map_or(0.0, |index| self.reach[index].1)
    }

    /// Whether a place with a field (nT) may have protons, by its L in the eccentric dipole of the map's epoch: a fast test without
    /// tracing the field line. McIlwain's L is at most 1.32 times that of the dipole (measured; verified in a test).
    pub fn may_have_protons(&self, b_nt: f64, dipole_l: f64) -> bool {
        b_nt <= self.strongest_field_nt(1.4 * dipole_l)
    }

    /// Energies of the map, MeV, ascending.
    pub fn energies_mev(&self) -> Vec<f64> {
        self.sheets.iter().map(|sheet| sheet.energy_mev).collect()
    }

    /// Flux above each of the map's energies, cm⁻² s⁻¹, on a drift shell at a place with B/B0.
    pub fn fluxes(&self, l: f64, b_over_b0: f64) -> impl Iterator<Item = f64> {
        let logs = self.sheets.iter().map(move |sheet| sheet.log_flux(l, b_over_b0));
        logs.map(|log_flux| if log_flux > 0.0 { 10_f64.powf(log_flux) } else { 0.0 })
    }

    /// Flux above an energy (MeV), cm⁻² s⁻¹: log10 of the flux is linear in the energy.
    pub fn flux(&self, energy_mev: f64, l: f64, b_over_b0: f64) -> f64 {
        let logs: Vec<f64> = self.sheets.iter().map(|sheet| sheet.log_flux(l, b_over_b0)).collect();
        let energies = self.energies_mev();
        let upper = energies.partition_point(|energy| *energy < energy_mev).clamp(1, energies.len() - 1);
        let line = |low: usize, high: usize| {
            let share = (energy_mev - energies[low]) / (energies[high] - energies[low]);
            logs[low] + share * (logs[high] - logs[low])
        };
        let mut log_flux = line(upper - 1, upper);
        if logs[upper] <= 0.0 && upper >= 2 {
            log_flux = log_flux.min(line(upper - 2, upper - 1));
        }
        if logs[upper - 1] <= 0.0 || log_flux <= 0.0 { 0.0 } else { 10_f64.powf(log_flux) }
    }
}

impl Sheet {
    /// log10 of the flux; 0 without flux.
    fn log_flux(&self, l: f64, b_over_b0: f64) -> f64 {
        let after = self.strings.partition_point(|string| string.l < l);
        if after == 0 || after == self.strings.len() {
            return 0.0;
        }
        let (inner, outer) = (&self.strings[after - 1], &self.strings[after]);
        let share = (l - inner.l) / (outer.l - inner.l);
        // The edge is interpolated in latitude, by B/B0 over L³.
        let edge = l.powi(3) * ((1.0 - share) * inner.edge_over_l3() + share * outer.edge_over_l3());
        if b_over_b0 > edge {
            return 0.0;
        }
        let angle = if edge > 1.0 { ((b_over_b0 - 1.0) / (edge - 1.0)).min(1.0).asin() } else { 0.0 };
        between(&inner.points, &outer.points, share, angle)
    }
}

/// Walks along two strings from the equator, always to the nearer next point, up to the triangle that contains the angle: log10 of
/// the flux, linear in the angle between its edges.
fn between(inner: &[(f64, f64)], outer: &[(f64, f64)], share: f64, angle: f64) -> f64 {
    let (mut s, mut t) = (0, 0);
    let edge = |s: usize, t: usize| {
        let mix = |a: f64, b: f64| a * (1.0 - share) + b * share;
        (mix(inner[s].0, outer[t].0), mix(inner[s].1, outer[t].1))
    };
    let mut upper = edge(0, 0);
    let mut lower = upper;
    while s + 1 < inner.len() || t + 1 < outer.len() {
        let next = |points: &[(f64, f64)], index: usize| points.get(index + 1).map_or(f64::INFINITY, |point| point.0);
        if next(inner, s) < next(outer, t) {
            s += 1
        } else {
            t += 1
        }
        (lower, upper) = (upper, edge(s, t));
        if upper.0 >= angle {
            break;
        }
    }
    let width = upper.0 - lower.0;
    let place = if width > 0.0 { (angle - lower.0) / width } else { 0.0 };
    (lower.1 + place * (upper.1 - lower.1)).max(0.0)
}

impl String {
    /// B/B0 of the edge over L³: the field there in units of the Earth's moment.
    fn edge_over_l3(&self) -> f64 {
        if self.l > 0.0 { self.edge / self.l.powi(3) } else { 0.0 }
    }

    fn of(l: f64, points: &[(f64, f64)]) -> String {
        let (edge, _) = points[points.len() - 1];
        if points.len() == 1 {
            return String { l, edge, points: vec![(0.0, points[0].1), (FRAC_PI_2, points[0].1)] };
        }
        let angle = |(b_over_b0, log_flux): &(f64, f64)| (((b_over_b0 - 1.0) / (edge - 1.0)).asin(), *log_flux);
        String { l, edge, points: points.iter().map(angle).collect() }
    }
}
