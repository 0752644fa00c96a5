//! Model against measurements: 500 rows of each kind validated, a fit of 5 parameters to 200 rows, a diagnosis of 600 rows on 50
//! backgrounds that finds two effects, and one of 92 rows of dose, trails and shapes in which nothing is hidden.
//!
//! `cargo bench --bench measurements`. On files that are made here, with noise for the diagnosis alone; the accuracy is the default one.

use ctiplan::analysis::diagnose::{self, Progress, Verdict, diagnose};
use ctiplan::analysis::fit::{Options, fit};
use ctiplan::analysis::measurement::DataSet;
use ctiplan::analysis::validate::validate;
use ctiplan::io::table::Table;
use ctiplan::mission::Mission;
use divan::Bencher;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

fn main() {
    divan::main();
}

fn mission() -> Mission {
    Mission::parse(include_str!("../tests/practice/prelaunch/mission.toml")).expect("a valid mission")
}

/// Rows of a measurement file: header lines, names, and what is written for each row.
fn data(meta: &str, names: &str, rows: usize, row: impl Fn(usize) -> String) -> DataSet {
    data_of(&mission(), meta, names, rows, row)
}

/// The same of another mission.
fn data_of(mission: &Mission, meta: &str, names: &str, rows: usize, row: impl Fn(usize) -> String) -> DataSet {
    let mut text = format!("{meta}{names},value,sigma\n");
    for index in 0..rows {
        text.push_str(&format!("{},0.001,0.001\n", row(index)));
    }
    DataSet::of(Table::parse("bench.csv", &text).expect("a table"), mission).expect("measurements")
}

fn packets(rows: usize) -> DataSet {
    data("# observable: packet_charge\n# background_e: 50\n", "t_yr,signal_e,transfers", rows, |row| {
        format!("{},{},{}", 0.5 + (row % 10) as f64 / 2.0, 500 + 700 * (row / 10 % 5), 200 + 17 * (row / 50))
    })
}

fn trails(rows: usize) -> DataSet {
    data("# observable: trail\n# background_e: 50\n", "t_yr,signal_e,trail_px", rows, |row| {
        format!("{},{},{}", 0.5 + (row / 100) as f64, 500 + 700 * (row / 20 % 5), 1 + row % 20)
    })
}

#[divan::bench(sample_count = 10)]
fn validate_500_packets(bencher: Bencher) {
    let (mission, data) = (mission(), [packets(500)]);
    bencher.bench(|| validate(&mission, &data, 1).expect("values"));
}

#[divan::bench(sample_count = 10)]
fn validate_500_rows_of_eper(bencher: Bencher) {
    let meta = "# observable: eper\n# background_e: 100\n# block_px: 500\n# t_yr: 4\n";
    let data = [data(meta, "signal_e,trail_px", 500, |row| format!("{},{}", 300 * (1 + row / 50), 1 + row % 50))];
    let mission = mission();
    bencher.bench(|| validate(&mission, &data, 1).expect("values"));
}

#[divan::bench(sample_count = 10)]
fn validate_500_shapes(bencher: Bencher) {
    let galaxies = ["faint", "bright", "large", "disc"];
    let meta = "# observable: delta_e1\n";
    let data = [data(meta, "t_yr,galaxy", 500, |row| format!("{},{}", (1 + row / 4) as f64 / 16.0, galaxies[row % 4]))];
    let mission = mission();
    bencher.bench(|| validate(&mission, &data, 1).expect("values"));
}

#[divan::bench(sample_count = 5)]
fn fit_5_parameters_to_200_rows(bencher: Bencher) {
    // The mission's own values, from others: the way there is what takes time.
    let mission = mission();
    let mut sets = [trails(100), packets(100)];
    for set in &mut sets {
        let values = validate(&mission, std::slice::from_ref(set), 1).expect("values").sets[0].model.clone();
        for (row, value) in set.rows.iter_mut().zip(values) {
            row.value = value;
            row.sigma = 1e-3 * value.abs().max(1e-3);
        }
    }
    let keys = [
        "detector.traps.fast.density_per_px",
        "detector.traps.mid.density_per_px",
        "detector.traps.slow.density_per_px",
        "detector.traps.mid.release_ms",
        "detector.well_fill_power",
    ]
    .map(String::from);
    let away: Vec<(String, toml::Value)> =
        keys.iter().map(|key| (key.clone(), (1.5 * mission.number(key).expect("a number")).into())).collect();
    let start = mission.with(&away).expect("values that are allowed");
    bencher.bench(|| {
        let found = fit(&start, &sets, &keys, &Options::default(), &|_| {}).expect("a fit");
        assert!(found.chi2 < 1.0, "{}", found.chi2);
    });
}

#[divan::bench(sample_count = 1, args = [false, true])]
fn diagnose_600_rows_on_50_backgrounds(bencher: Bencher, stability: bool) {
    let mission = mission();
    let effects = "[effects.annealing]\ntime_yr = 6.0\n[effects.notch]\nnotch_e = 40.0\n";
    let truth = Mission::parse(&format!("{}\n{effects}", mission.to_toml())).expect("a valid mission");
    let meta = "# observable: trail\n# signal_e: 3000\n# transfers: 1000\n";
    let mut set = data(meta, "background_e,trail_px,t_yr", 600, |row| {
        format!("{:.3},{},{}", 2.0 * 1.12_f64.powi((row / 12) as i32), 1 + row % 12, 1 + row / 12 % 5)
    });
    measured(&truth, &mut set, |_| 1e-4);
    let options = diagnose::Options { free: mission.fit.free.clone(), stability, ..diagnose::Options::default() };
    bencher.bench(|| {
        let found = diagnose(&mission, std::slice::from_ref(&set), &options, &SILENT).expect("a diagnosis");
        assert_eq!((found.verdict, found.steps.len()), (Verdict::Missing, 2), "{}", found.reason);
    });
}

/// 20 readings of the dose, 48 of trails (1 %) and 24 changes of shape (0.2 %), without the repetitions under other assumptions.
#[divan::bench(sample_count = 1, args = [0, 3, 6])]
fn diagnose_92_rows_with_nothing_hidden(bencher: Bencher, free: usize) {
    let mission =
        Mission::parse(include_str!("../tests/practice/nothing-missing/mission.toml")).expect("a valid mission");
    let epochs_yr = [3.5, 4.5, 6.0, 8.0];
    let dose = data_of(&mission, "# observable: dose\n", "t_yr", 20, |row| format!("{}", 0.4 * (row + 1) as f64));
    let trails = "# observable: trail\n# background_e: 80\n# transfers: 1650\n";
    let trails = data_of(&mission, trails, "t_yr,signal_e,trail_px", 48, |row| {
        format!("{},{},{}", epochs_yr[row / 12], [1000, 5000, 20_000][row / 4 % 3], 1 << (row % 4))
    });
    let shapes = data_of(&mission, "# observable: delta_e1\n", "t_yr,galaxy,transfers", 24, |row| {
        format!("{},{},{}", epochs_yr[row / 6], ["faint", "bright"][row / 3 % 2], 550 * (1 + row % 3))
    });
    let mut sets = [dose, trails, shapes];
    for (set, (share, least)) in sets.iter_mut().zip([(0.01, 1e4), (0.01, 2e-6), (0.002, 1e-7)]) {
        measured(&mission, set, |value| (share * value.abs()).max(least));
    }
    let keys = ["density_per_px", "release_ms"];
    let keys = keys.into_iter().flat_map(|key| ["Ci", "VV", "CO"].map(|name| format!("detector.traps.{name}.{key}")));
    let options =
        diagnose::Options { free: keys.take(free).collect(), stability: false, ..diagnose::Options::default() };
    bencher.bench(|| {
        let found = diagnose(&mission, &sets, &options, &SILENT).expect("a diagnosis");
        assert_eq!(found.verdict, Verdict::Complete, "{}", found.reason);
    });
}

const SILENT: Progress = Progress { stage: &|_, _| (), advance: &|| () };

/// Values as a mission makes them, with an error that depends on the value, and noise.
fn measured(truth: &Mission, set: &mut DataSet, sigma: impl Fn(f64) -> f64) {
    let values = validate(truth, std::slice::from_ref(set), 1).expect("values").sets[0].model.clone();
    let mut random = ChaCha8Rng::seed_from_u64(3);
    for (row, value) in set.rows.iter_mut().zip(values) {
        row.sigma = sigma(value);
        let noise: f64 = StandardNormal.sample(&mut random);
        row.value = value + row.sigma * noise;
    }
}
