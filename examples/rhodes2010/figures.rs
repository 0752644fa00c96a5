//! The figures of Rhodes et al. 2010, computed.

use ctiplan::mission::Mission;
use ctiplan::model::{Device, Model};
use ctiplan::physics::conditions::Conditions;
use ctiplan::physics::shape::ShapeChange;
use ctiplan::plan::evaluate::evaluate;
use ctiplan::readout::{Downstream, Method, Readout};
use ndarray::Array2;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Charge of a Mn K-alpha event at 133 K, e- (section 4.2).
pub const XRAY_E: f64 = 1580.0;
/// Transfers from the centre of the galaxies to the register (section 5).
pub const TRANSFERS: u32 = 1650;
/// Release time (transfers) of traps that do not release within any readout.
pub const NEVER_TRANSFERS: f64 = 1e9;
/// Years at L2 to which the laboratory irradiation corresponds (section 4.1).
pub const LABORATORY_YR: f64 = 110.0;

/// The mission of the paper.
pub fn snap() -> Mission {
    Mission::parse(include_str!("../../missions/snap_l2.toml")).expect("a valid mission")
}

/// Rate of equation 2, per year.
pub const EQUATION_2_PER_YR: f64 = 2.65e-4;
/// Number of points, and last of them (yr), to which the paper fitted equation 2 (section 5.3).
pub const PAPER_RANGE: (u32, f64) = (50, 220.0);
/// The same over the years that a mission may last.
pub const MISSION_RANGE: (u32, f64) = (10, 10.0);

/// Rate of |Δe| per year: slope of a straight line through the origin, fitted to evenly spaced times up to the last one (yr).
pub fn rate_per_yr(mission: &Mission, (points, last_yr): (u32, f64)) -> f64 {
    let times: Vec<f64> = (1..=points).map(|point| last_yr * f64::from(point) / f64::from(points)).collect();
    let products: f64 = times.iter().zip(density_scan(mission, &times)).map(|(t_yr, change)| t_yr * change).sum();
    products / times.iter().map(|t_yr| t_yr * t_yr).sum::<f64>()
}

/// Years until the budget is exceeded, and |Δe| after 5 years over the factor of the correction.
pub fn budget(mission: &Mission) -> (f64, f64) {
    let evaluation = evaluate(mission).unwrap();
    let end = evaluation.years.last().unwrap().galaxies[0].unwrap().magnitude();
    (evaluation.verdict.uncorrected.t_yr.unwrap(), end / mission.requirement.correction_factor)
}

/// One row of table 2.
pub struct Row {
    pub name: &'static str,
    pub paper_delta_e: f64,
    pub paper_delta_y_px: f64,
    pub paper_size_px: f64,
    pub change: ShapeChange,
    pub size_px: f64,
}

/// Table 2: seven galaxies after the laboratory irradiation.
pub fn table2() -> Vec<Row> {
    let mission = Mission::parse(include_str!("../../missions/rhodes2010_galaxies.toml")).expect("a valid mission");
    let model = Model::new(&mission);
    let device = irradiated(&mission, TRANSFERS);
    let paper = [
        ("de Vaucouleurs, S/N 13, e = 0", -0.028, 0.19, 1.8),
        ("de Vaucouleurs, S/N 13, e = -0.17", -0.024, 0.19, 1.8),
        ("de Vaucouleurs, S/N 13, e = +0.17", -0.031, 0.19, 1.8),
        ("de Vaucouleurs, S/N 50, e = 0", -0.024, 0.17, 1.9),
        ("de Vaucouleurs, S/N 20, large", -0.010, 0.20, 3.1),
        ("de Vaucouleurs, S/N 50, large", -0.010, 0.20, 3.6),
        ("exponential, S/N 49", -0.022, 0.18, 1.9),
    ];
    let row = |(index, (name, paper_delta_e, paper_delta_y_px, paper_size_px))| Row {
        name,
        paper_delta_e,
        paper_delta_y_px,
        paper_size_px,
        change: model.change_by(index, &device).unwrap().unwrap(),
        size_px: model.scene(index).unwrap().before().size_px,
    };
    paper.into_iter().enumerate().map(row).collect()
}

/// Release times (transfers) and the change they make (section 5.1).
pub fn release_scan(change: impl Fn(f64) -> ShapeChange) -> Vec<(f64, ShapeChange)> {
    let times = (0..=60).map(|step| 10_f64.powf(-1.0 + f64::from(step) / 15.0));
    times.map(|release_transfers| (release_transfers, change(release_transfers))).collect()
}

/// Change of shape by one trap per pixel, against its release time (transfers).
pub fn of_release(mission: &Mission) -> impl Fn(f64) -> ShapeChange + use<> {
    let (model, device) = (Model::new(mission), irradiated(mission, TRANSFERS).with_species(0));
    move |release_transfers| {
        let mut device = device.clone();
        device.traps[0].density_per_px = 1.0;
        device.traps[0].release_ms = release_transfers * device.at.line_time_ms;
        model.change_by(model.judged(), &device).unwrap().unwrap()
    }
}

/// Release time (transfers) beyond which a galaxy is stretched across the transfers: e1 becomes more positive.
pub fn release_where_e1_changes_sign(change: impl Fn(f64) -> ShapeChange) -> f64 {
    let (mut low, mut high) = (10.0_f64, 1e4_f64);
    while high / low > 1.001 {
        let middle = (low * high).sqrt();
        if change(middle).delta_e1 < 0.0 {
            low = middle;
        } else {
            high = middle;
        }
    }
    low
}

/// Release time (transfers) that changes shapes most.
pub fn worst_release(scan: &[(f64, ShapeChange)]) -> f64 {
    scan.iter().max_by(|a, b| a.1.magnitude().total_cmp(&b.1.magnitude())).unwrap().0
}

/// |Δe| after some years of mean dose (section 5.3).
pub fn density_scan(mission: &Mission, years: &[f64]) -> Vec<f64> {
    let model = Model::new(mission);
    years.iter().map(|&t_yr| model.change(model.judged(), t_yr).unwrap().unwrap().magnitude()).collect()
}

/// |Δe| at half the distance over that at the whole one, after the laboratory irradiation (section 7).
pub fn half_the_distance(mission: &Mission) -> f64 {
    let model = Model::new(mission);
    let change =
        |transfers| model.change_by(model.judged(), &irradiated(mission, transfers)).unwrap().unwrap().magnitude();
    change(TRANSFERS / 2) / change(TRANSFERS)
}

/// |Δe| with half the traps over that with all of them, after the laboratory irradiation.
pub fn half_the_traps(mission: &Mission) -> f64 {
    let changes = density_scan(mission, &[LABORATORY_YR / 2.0, LABORATORY_YR]);
    changes[0] / changes[1]
}

/// Charge transfer efficiency by the stacking method: charge of single-pixel X-ray events against transfers, a straight
/// line's slope over its value at the register (section 4.2). 64 columns of 1756 rows; events in a pixel with probability
/// `events_per_px`. 0: one event in a column at a time.
pub fn stacking_cte(mission: &Mission, events_per_px: f64, seed: u64) -> f64 {
    let (rows, columns) = (1756, 64);
    let readout = Readout { method: Method::Exact, ..laboratory(mission) };
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let image = if events_per_px > 0.0 {
        Array2::from_shape_simple_fn(
            (rows, columns),
            || if random.random::<f64>() < events_per_px { XRAY_E } else { 0.0 },
        )
    } else {
        Array2::from_shape_fn(
            (rows, columns),
            |(row, column)| if row == (27 * column + 13) % rows { XRAY_E } else { 0.0 },
        )
    };
    let trailed = readout.parallel(&image, Downstream::NONE);
    // Single-pixel events: no other within two pixels along the column.
    let alone = |row: usize, column: usize| {
        image[[row, column]] > 0.0
            && (row.saturating_sub(2)..=(row + 2).min(rows - 1)).all(|near| near == row || image[[near, column]] == 0.0)
    };
    let (mut n, mut x, mut y, mut xx, mut xy) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for ((row, column), charge) in trailed.indexed_iter() {
        if alone(row, column) {
            let transfers = row as f64 + 1.0;
            n += 1.0;
            x += transfers;
            y += charge;
            xx += transfers * transfers;
            xy += transfers * charge;
        }
    }
    let slope = (n * xy - x * y) / (n * xx - x * x);
    let at_register = (y - slope * x) / n;
    1.0 + slope / at_register
}

/// Charge in the pixels behind a lone X-ray event after 1650 transfers, over the event's charge (section 4.2).
pub fn trail(mission: &Mission, pixels: usize) -> Vec<f64> {
    let readout = Readout { method: Method::Exact, ..laboratory(mission) };
    let mut column = vec![0.0; pixels + 1];
    column[0] = XRAY_E;
    let downstream = Downstream { rows: i64::from(TRANSFERS) - 1, charge_e: 0.0 };
    readout.column(&column, downstream)[1..].iter().map(|charge| charge / XRAY_E).collect()
}

/// Share of the charge missing from a lone X-ray event after 1650 transfers that two of the paper's species account for:
/// its loss with those two alone over that with all three.
pub fn share_of_two_species(mission: &Mission) -> f64 {
    let three = laboratory(mission);
    let two = Readout { traps: three.traps[..2].to_vec(), ..three.clone() };
    loss_e(&two) / loss_e(&three)
}

/// Share of the same charge that is found in the first pixels behind the event (section 4.2: a fit to 45 of them holds 2/3).
pub fn share_of_first(mission: &Mission, pixels: usize) -> f64 {
    XRAY_E * trail(mission, pixels).iter().sum::<f64>() / loss_e(&laboratory(mission))
}

/// Charge missing from a lone X-ray event after 1650 transfers, e-.
fn loss_e(readout: &Readout) -> f64 {
    let downstream = Downstream { rows: i64::from(TRANSFERS) - 1, charge_e: 0.0 };
    XRAY_E - readout.column(&[XRAY_E], downstream)[0]
}

/// The detector as irradiated in the laboratory, for a galaxy so many transfers from the register.
pub fn irradiated(mission: &Mission, transfers: u32) -> Device {
    let model = Model::new(mission);
    let dose_mev_g = Some(mission.reference_dose_mev_g());
    model.device(&Conditions { dose_mev_g, transfers, ..model.conditions(0.0) }).unwrap()
}

/// Its readout.
pub fn laboratory(mission: &Mission) -> Readout {
    irradiated(mission, TRANSFERS).readout()
}
