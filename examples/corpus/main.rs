//! Diagnoses a folder of cases with known truth, and counts how often it is right.
//!
//! `cargo run --release --example corpus -- FOLDER [--only NAME-PART] [--exact] [--seed N]`, on cases of
//! `tests/corpus/make.py`.

mod judge;
mod rough;

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::Parser;
use ctiplan::analysis::diagnose::{Diagnosis, Options, Progress, Verdict, diagnose};
use ctiplan::analysis::measurement::{DataSet, questions};
use ctiplan::analysis::whitening::{Shared, Whitening};
use ctiplan::error::InputError;
use ctiplan::mission::{Mission, ReadoutMethod};
use ctiplan::model::Model;
use ctiplan::model::predict::predict;
use ctiplan::report::Report;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use rough::Rough;
use serde_json::Value;

#[derive(Parser)]
struct Arguments {
    /// Folder of cases
    #[arg(default_value = "tests/practice")]
    folder: PathBuf,
    /// Only cases whose name contains this
    #[arg(long, default_value = "")]
    only: String,
    /// Replace the values of the cases by those with every transfer done, all that is true (true.toml) and fresh noise
    #[arg(long)]
    exact: bool,
    /// Make errors wrong in one of these ways
    #[arg(long)]
    rough: Option<Rough>,
    /// Repeat each search under other assumptions
    #[arg(long)]
    stability: bool,
    /// Print the report of each case as well
    #[arg(long)]
    report: bool,
    /// Only one of this many cases
    #[arg(long, default_value_t = 1)]
    every: usize,
    /// Seed of that noise
    #[arg(long, default_value_t = 1)]
    seed: u64,
}

fn main() -> Result<(), InputError> {
    let arguments = Arguments::parse();
    let unreadable = |error: std::io::Error| {
        InputError::new(format!("cannot read `{}`", arguments.folder.display()), error.to_string())
    };
    let mut cases: Vec<PathBuf> = fs::read_dir(&arguments.folder)
        .map_err(unreadable)?
        .filter_map(|entry| Some(entry.ok()?.path()))
        .filter(|path| path.join("truth.json").exists() && name(path).contains(&arguments.only))
        .filter(|path| !arguments.remade() || path.join("true.toml").exists())
        .collect();
    cases.sort();
    let mut counts = Counts::default();
    for case in cases.into_iter().step_by(arguments.every.max(1)) {
        let truth: Value = serde_json::from_str(&fs::read_to_string(case.join("truth.json")).unwrap()).unwrap();
        let (mission, mut data) = read(&case, &truth)?;
        if arguments.remade() {
            replace(&mut data, &case, &arguments)?;
        }
        if let Some(rough) = arguments.rough {
            rough.apply(&mut data, stream(&case) ^ arguments.seed);
        }
        let start = Instant::now();
        let options = Options { free: mission.fit.free.clone(), stability: arguments.stability, ..Options::default() };
        let stage = |name: &str, _| eprintln!("{:6.1} {name}", start.elapsed().as_secs_f64());
        let found = diagnose(&mission, &data, &options, &Progress { stage: &stage, advance: &|| () })?;
        let seconds = start.elapsed().as_secs_f64();
        print_case(&name(&case), &truth, &found, seconds);
        if arguments.report {
            println!("{}", found.text());
        }
        counts.add(&truth, &found, seconds);
    }
    counts.print();
    Ok(())
}

fn name(case: &Path) -> String {
    case.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

fn read(case: &Path, truth: &Value) -> Result<(Mission, Vec<DataSet>), InputError> {
    let mission = Mission::read(case.join("mission.toml"))?;
    let files = truth["files"].as_array().unwrap().iter().map(|file| case.join(file.as_str().unwrap()));
    let data = files.map(|file| DataSet::read(file, &mission)).collect::<Result<Vec<_>, _>>()?;
    Ok((mission, data))
}

/// A number of its own for each case.
fn stream(case: &Path) -> u64 {
    name(case).bytes().fold(0_u64, |sum, byte| sum.wrapping_mul(31).wrapping_add(byte.into()))
}

impl Arguments {
    /// Whether values are computed here.
    fn remade(&self) -> bool {
        self.exact || self.rough == Some(Rough::Correlated)
    }
}

/// Values as the true mission gives them, with noise of the quoted sigma: with every transfer done, or correlated along trails.
fn replace(data: &mut [DataSet], case: &Path, arguments: &Arguments) -> Result<(), InputError> {
    let mut mission = Mission::read(case.join("true.toml"))?;
    if arguments.exact {
        mission.accuracy.readout = ReadoutMethod::Exact;
    }
    let values = predict(&Model::new(&mission), &questions(data)).expect("no formulas");
    let mut random = ChaCha8Rng::seed_from_u64(arguments.seed);
    random.set_stream(stream(case));
    let mut values = values.into_iter();
    for set in data {
        if arguments.rough == Some(Rough::Correlated) {
            set.shared.correlation = rough::CORRELATION;
        }
        let white: Vec<f64> = set.rows.iter().map(|_| StandardNormal.sample(&mut random)).collect();
        let noise = Whitening::of(std::slice::from_ref(set), |_| true).undone(&white);
        set.shared = Shared::default();
        for (row, noise) in set.rows.iter_mut().zip(noise) {
            row.value = values.next().expect("one for each row") + row.sigma * noise;
        }
    }
    Ok(())
}

fn print_case(name: &str, truth: &Value, found: &Diagnosis, seconds: f64) {
    let steps: Vec<String> = found
        .steps
        .iter()
        .map(|step| {
            let values: Vec<String> = step
                .parameters
                .iter()
                .map(|fitted| format!("{:.3e}±{:.0e}", fitted.value, fitted.sigma.unwrap_or(f64::NAN)))
                .collect();
            format!("{}({}) fa {:.0e}", step.effect, values.join(" "), step.false_alarm)
        })
        .collect();
    for tried in found.tried.iter().take(4) {
        eprintln!("       {} {:?}", tried.effect, tried.chi2);
    }
    let last = found.steps.last().map_or(&found.baseline, |step| &step.rung);
    let (near, of) = judge::pulls(truth, found);
    let unstable: Vec<&str> =
        found.stability.done.iter().filter(|one| !one.holds).map(|one| one.change.as_str()).collect();
    let noise = found.noise.iter().map(|noise| {
        let pedestal = noise.pedestal.zip(noise.pedestal_sigma).map_or(0.0, |(value, sigma)| value / sigma);
        let wrong = noise.wrong.len();
        format!("{:.2} r{:.2} p{pedestal:.1} w{wrong}", noise.scale, noise.correlation)
    });
    let law = found.ranking.as_ref().and_then(|ranking| ranking.law.as_ref());
    let law = law.map_or(String::new(), |law| format!("{:+.1}", law.excess));
    println!(
        "{} {name:38} {:11} {seconds:5.1} s {:6}  chi2/n {:.2} -> {:.2}  [{}] alt {:?} cov {:?} noise {:?} law {law} unstable {unstable:?} {} {}",
        if judge::is_right(truth, found) { "  ok " } else { "WRONG" },
        found.verdict.name(),
        found.evaluations[0],
        found.baseline.chi2 / found.baseline.n as f64,
        last.chi2 / last.n as f64,
        steps.join("; "),
        found.alternatives,
        found.covariates.iter().take(3).map(|leaning| leaning.name.as_str()).collect::<Vec<_>>(),
        noise.collect::<Vec<_>>(),
        if found.verdict == Verdict::Unfit { found.reason.to_string() } else { String::new() },
        if of > near { format!("PULL {}", truth["parameters"]) } else { String::new() },
    );
}

/// How often what was answered.
#[derive(Default)]
struct Counts {
    /// By group: right answers, and cases.
    groups: BTreeMap<String, (usize, usize)>,
    /// Of one hidden effect, by the chi2 aimed at: answers.
    power: BTreeMap<u64, BTreeMap<&'static str, usize>>,
    /// By what is hidden and what is added.
    confusion: BTreeMap<(String, String), usize>,
    inside: usize,
    parameters: usize,
    seconds: Vec<f64>,
}

impl Counts {
    fn add(&mut self, truth: &Value, found: &Diagnosis, seconds: f64) {
        let (good, total) = self.groups.entry(truth["group"].as_str().unwrap_or("practice").to_string()).or_default();
        *good += usize::from(judge::is_right(truth, found));
        *total += 1;
        if let Some(target) = truth["target"].as_u64() {
            *self.power.entry(target).or_default().entry(judge::answer(truth, found)).or_default() += 1;
        }
        let words = |effects: Vec<String>| if effects.is_empty() { "nothing".into() } else { effects.join(" + ") };
        let (hidden, added) = (words(judge::names(&truth["effects"])), words(judge::added(found)));
        if hidden != added {
            let added = if found.verdict == Verdict::Ambiguous { format!("{added} (ambiguous)") } else { added };
            *self.confusion.entry((hidden, added)).or_default() += 1;
        }
        let (near, of) = judge::pulls(truth, found);
        self.inside += near;
        self.parameters += of;
        self.seconds.push(seconds);
    }

    fn print(mut self) {
        for (group, (good, total)) in &self.groups {
            println!("{group}: {good} of {total} right");
        }
        for (target, answers) in &self.power {
            let answers: Vec<String> = answers.iter().map(|(answer, count)| format!("{answer} {count}")).collect();
            println!("chi2 falls by {target}: {}", answers.join(", "));
        }
        for ((hidden, added), count) in &self.confusion {
            println!("{hidden} taken for {added}: {count}");
        }
        println!("true parameters within three errors: {} of {}", self.inside, self.parameters);
        self.seconds.sort_by(f64::total_cmp);
        if let Some(slowest) = self.seconds.last() {
            let of = |share: f64| self.seconds[((self.seconds.len() - 1) as f64 * share) as usize];
            println!(
                "seconds: half within {:.1}, nine of ten within {:.1}, the slowest {slowest:.1}",
                of(0.5),
                of(0.9)
            );
        }
    }
}
