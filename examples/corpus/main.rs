//! Diagnoses a folder of cases with known truth, and counts how often it is right.
//!
//! `cargo run --release --example corpus -- FOLDER [NAME-PART]`, on cases of `tests/corpus/make.py`.

use std::fs;
use std::path::{Path, PathBuf};
use std::time::Instant;

use ctiplan::diagnose::{Diagnosis, Options, Progress, Verdict, diagnose};
use ctiplan::error::InputError;
use ctiplan::measurement::DataSet;
use ctiplan::mission::Mission;
use serde_json::Value;

fn main() -> Result<(), InputError> {
    let mut arguments = std::env::args().skip(1);
    let folder = arguments.next().unwrap_or_else(|| "tests/practice".into());
    let part = arguments.next().unwrap_or_default();
    let mut cases: Vec<PathBuf> = fs::read_dir(&folder)
        .map_err(|error| InputError::new(format!("cannot read `{folder}`"), error.to_string()))?
        .filter_map(|entry| Some(entry.ok()?.path()))
        .filter(|path| path.join("truth.json").exists() && path.to_string_lossy().contains(&part))
        .collect();
    cases.sort();
    let mut counts: Vec<(String, usize, usize)> = Vec::new();
    let (mut inside, mut all, mut slowest) = (0, 0, 0.0_f64);
    for case in cases {
        let truth: Value = serde_json::from_str(&fs::read_to_string(case.join("truth.json")).unwrap()).unwrap();
        let start = Instant::now();
        let found = run(&case, &truth)?;
        let seconds = start.elapsed().as_secs_f64();
        slowest = slowest.max(seconds);
        let right = is_right(&truth, &found);
        let (near, of) = pulls(&truth, &found);
        inside += near;
        all += of;
        let group = truth["group"].as_str().unwrap_or("practice").to_string();
        match counts.iter_mut().find(|(known, ..)| *known == group) {
            Some((_, good, total)) => {
                *good += usize::from(right);
                *total += 1;
            }
            None => counts.push((group, usize::from(right), 1)),
        }
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
        let last = found.steps.last().map_or(&found.baseline, |step| &step.rung);
        println!(
            "{} {:38} {:11} {:5.1} s  chi2/n {:.2} -> {:.2}  [{}] alt {:?} cov {:?} {} {}",
            if right { "  ok " } else { "WRONG" },
            case.file_name().unwrap().to_string_lossy(),
            found.verdict.name(),
            seconds,
            found.baseline.chi2 / found.baseline.n as f64,
            last.chi2 / last.n as f64,
            steps.join("; "),
            found.alternatives,
            found.covariates.iter().take(3).map(|leaning| leaning.name.as_str()).collect::<Vec<_>>(),
            if found.verdict == Verdict::Unfit { &found.reason } else { "" },
            if of > near { format!("PULL {}", truth["parameters"]) } else { String::new() },
        );
    }
    for (group, good, total) in counts {
        println!("{group}: {good} of {total} right");
    }
    println!("true parameters within three errors: {inside} of {all}; slowest case {slowest:.0} s");
    Ok(())
}

fn run(case: &Path, truth: &Value) -> Result<Diagnosis, InputError> {
    let mission = Mission::read(case.join("mission.toml"))?;
    let files = truth["files"].as_array().unwrap().iter().map(|file| case.join(file.as_str().unwrap()));
    let data = files.map(|file| DataSet::read(file, &mission)).collect::<Result<Vec<_>, _>>()?;
    let free = mission.fit.free.clone();
    let options = Options { level: 0.01, seed: 1, free, candidates: None, can: Vec::new() };
    let start = Instant::now();
    let stage = |name: &str, _| eprintln!("{:6.1} {name}", start.elapsed().as_secs_f64());
    diagnose(&mission, &data, &options, &Progress { stage: &stage, advance: &|| () })
}

fn names(list: &Value) -> Vec<String> {
    let mut names: Vec<String> =
        list.as_array().into_iter().flatten().filter_map(|name| Some(name.as_str()?.to_string())).collect();
    names.sort();
    names
}

fn is_right(truth: &Value, found: &Diagnosis) -> bool {
    let mut steps: Vec<String> = found.steps.iter().map(|step| step.effect.clone()).collect();
    steps.sort();
    let accepted = truth["accept"].as_array().unwrap().iter().any(|accept| names(accept) == steps);
    let verdict = found.verdict.name();
    if truth["group"] == "edge" {
        // Any answer but a wrong one.
        let among = found.alternatives.iter().flatten().any(|name| names(&truth["effects"]).contains(name));
        return accepted || among || !matches!(found.verdict, Verdict::Missing | Verdict::Ambiguous);
    }
    match truth["verdict"].as_str().unwrap() {
        "ambiguous" => {
            let known = names(&truth["effects"]);
            verdict == "ambiguous" && (accepted || found.alternatives.iter().flatten().any(|name| known.contains(name)))
        }
        "unexplained" => {
            let covariates = names(&truth["covariates"]);
            let told = found.covariates.iter().any(|leaning| covariates.contains(&leaning.name));
            verdict == "unexplained" && accepted && (told || covariates.is_empty())
        }
        other => verdict == other && accepted,
    }
}

/// Parameters whose true value is known: how many are within three errors, and how many there are.
fn pulls(truth: &Value, found: &Diagnosis) -> (usize, usize) {
    let (mut near, mut all) = (0, 0);
    for fitted in found.steps.iter().flat_map(|step| &step.parameters) {
        let name = fitted.key.rsplit('.').next().unwrap();
        if let (Some(value), Some(sigma)) = (truth["parameters"][name].as_f64(), fitted.sigma) {
            all += 1;
            near += usize::from((fitted.value - value).abs() < 3.0 * sigma);
        }
    }
    (near, all)
}
