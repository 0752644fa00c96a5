//! The ellipse through the belts: XMM-Newton EPIC pn.

use ctiplan::analysis::fit::{Fit, Options, fit};
use ctiplan::analysis::measurement::DataSet;
use ctiplan::analysis::validate::validate;
use ctiplan::mission::Mission;
use ctiplan::mission_file::add_effect;

use super::flown::{self, *};

pub fn mission() -> Mission {
    flown::mission("xmm_pn")
}

/// New years (decimal), published CTI and errors.
fn cti() -> Vec<(f64, f64, f64)> {
    let rows = rows(include_str!("../../missions/flown/xmm_pn_al_k.ecsv"));
    rows.iter().map(|(date, value, sigma)| (year_of(date), *value, *sigma)).collect()
}

/// The published CTI of the years of this range, as measurements.
pub fn data(mission: &Mission, years: std::ops::Range<usize>) -> Vec<DataSet> {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/missions/flown/xmm_pn_al_k.ecsv");
    let mut set = DataSet::read(path, mission).expect("measurements");
    set.rows = set.rows[years].to_vec();
    vec![set]
}

/// The mission with charge of cosmic rays in its traps.
pub fn with_charge(mission: &Mission) -> Mission {
    let table = toml::Table::from_iter([("filled".to_string(), 0.03.into())]);
    add_effect(mission, "sacrificial-charge", table).expect("a valid effect").0
}

/// Years of the data.
pub const YEARS: usize = 17;

/// The first of them, from which the others are predicted.
pub const FIRST: usize = 8;

/// A fit of density at launch, density per dose, and the strength of the effect if it is there, to the first years.
pub fn fitted(mission: &Mission, years: usize) -> Fit {
    let mut keys = mission.fit.free.clone();
    if mission.effects.contains_key("sacrificial-charge") {
        keys.push("effects.sacrificial-charge.filled".into());
    }
    fit(mission, &data(mission, 0..years), &keys, &Options::default(), &|_| {}).expect("a fit")
}

/// rms and largest residual (sigma) of the years after the first, predicted from these.
pub fn predicted(mission: &Mission) -> (f64, f64) {
    let fitted = fitted(mission, FIRST).mission;
    let data = data(&fitted, FIRST..YEARS);
    let set = &validate(&fitted, &data, 1).expect("predictions").sets[0];
    let residual = |(row, model): (&ctiplan::analysis::measurement::Row, &f64)| (row.value - model) / row.sigma;
    let residuals: Vec<f64> = set.data.rows.iter().zip(&set.model).map(residual).collect();
    let mean = residuals.iter().map(|one| one * one).sum::<f64>() / residuals.len() as f64;
    (mean.sqrt(), residuals.iter().fold(0.0, |most: f64, one| most.max(one.abs())))
}

/// The mission at a constant rate of dose.
pub fn constant(mission: &Mission) -> Mission {
    let mut mission = drawn(mission);
    mission.environment.model = ctiplan::mission::DoseModel::Constant;
    mission.environment.active_dose_rate_mev_g_yr = Some(7e5);
    mission
}

/// Years that are summed: first, and first after.
pub const SUMS: [(usize, usize); 5] = [(2000, 2003), (2003, 2007), (2007, 2011), (2011, 2015), (2015, 2016)];

/// Growth over that of all years: published with its error, and of the fitted model.
pub fn sums(fit: &Fit) -> Vec<Compared> {
    let rows = cti();
    let growth = |values: &[f64], from: usize, to: usize| {
        let mean = (values[YEARS - 1] - values[0]) / (rows[YEARS - 1].0 - rows[0].0);
        (values[to] - values[from]) / (rows[to].0 - rows[from].0) / mean
    };
    let values: Vec<f64> = rows.iter().map(|row| row.1).collect();
    let mean = (values[YEARS - 1] - values[0]) / (rows[YEARS - 1].0 - rows[0].0);
    let of = |(first, after): (usize, usize)| {
        let (from, to) = (first - 2000, after - 2000);
        let error = rows[from].2.hypot(rows[to].2) / (rows[to].0 - rows[from].0) / mean;
        Compared { published: growth(&values, from, to), error, model: growth(&fit.values, from, to) }
    };
    SUMS.into_iter().map(of).collect()
}

pub fn report() -> Vec<String> {
    let mission = mission();
    let charged = with_charge(&mission);
    let mut lines = vec![
        "Fits to 17 yearly values; the last nine predicted from the first eight [sigma]".to_string(),
        format!(" {:<46} {:>4} {:>7} {:>6} {:>9}", "model", "free", "chi2", "rms", "largest"),
    ];
    for (name, mission) in [
        ("constant rate", constant(&mission)),
        ("Sun as observed", mission.clone()),
        ("constant rate, sacrificial charge", constant(&charged)),
        ("Sun as observed, sacrificial charge", charged.clone()),
    ] {
        let (rms, largest) = predicted(&mission);
        let fit = fitted(&mission, YEARS);
        lines.push(format!(" {name:<46} {:>4} {:>7.1} {rms:>6.1} {largest:>9.1}", fit.parameters.len(), fit.chi2));
    }
    let fit = fitted(&charged, YEARS);
    let filled = fit.parameters.last().expect("the strength");
    lines.push(format!(
        " filled by cosmic rays: {:.1} +- {:.1} % of the traps at their mean rate",
        100.0 * filled.value,
        100.0 * filled.sigma.unwrap_or(f64::NAN)
    ));
    lines.push(String::new());
    lines.push("Growth over several years over the mean, Sun as observed, sacrificial charge".into());
    lines.push(" years           published    model  diff [sigma]".into());
    for ((from, to), sum) in SUMS.iter().zip(sums(&fit)) {
        lines.push(format!(" {from}-{}  {}", to - 1, sum.words()));
    }
    lines.push(String::new());
    lines.push("chi2 against the shield and the weight of nuclei".into());
    lines.push(" nuclei/protons   26 mm   28 mm   30 mm   33 mm".into());
    for nuclei in [0.2, 0.5, 0.75] {
        let chi2 = [26.0, 28.0, 30.0, 33.0].map(|mm: f64| {
            let settings = [("environment.nuclei_over_protons", nuclei.into()), ("shielding.thickness_mm", mm.into())];
            format!("{:>7.1}", fitted(&with(&charged, &settings), YEARS).chi2)
        });
        lines.push(format!(" {nuclei:<15.2} {}", chi2.join(" ")));
    }
    lines
}
