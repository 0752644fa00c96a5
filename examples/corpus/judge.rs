//! Whether a diagnosis agrees with the truth.

use ctiplan::analysis::diagnose::{Diagnosis, Verdict};
use serde_json::Value;

/// Names in a list, sorted.
pub fn names(list: &Value) -> Vec<String> {
    let mut names: Vec<String> =
        list.as_array().into_iter().flatten().filter_map(|name| Some(name.as_str()?.to_string())).collect();
    names.sort();
    names
}

/// Effects that a diagnosis adds, sorted.
pub fn added(found: &Diagnosis) -> Vec<String> {
    let mut steps: Vec<String> = found.steps.iter().map(|step| step.effect.clone()).collect();
    steps.sort();
    steps
}

/// Whether the truth is among the rivals.
fn among(truth: &Value, found: &Diagnosis) -> bool {
    found.alternatives.iter().flatten().any(|name| names(&truth["effects"]).contains(name))
}

/// What a diagnosis says of one hidden effect, in a few words.
pub fn answer(truth: &Value, found: &Diagnosis) -> &'static str {
    let accepted = truth["accept"].as_array().unwrap().iter().any(|accept| names(accept) == added(found));
    match found.verdict {
        Verdict::Missing if accepted => "named",
        Verdict::Missing => "wrong",
        Verdict::Ambiguous if accepted => "named, with rivals",
        Verdict::Ambiguous if among(truth, found) => "among the rivals",
        Verdict::Ambiguous => "wrong",
        Verdict::Complete => "not seen",
        Verdict::Unexplained => "unexplained",
        Verdict::Unfit => "unfit",
    }
}

/// Whether the answer is one that counts as right in the case's group.
pub fn is_right(truth: &Value, found: &Diagnosis) -> bool {
    let accepted = truth["accept"].as_array().unwrap().iter().any(|accept| names(accept) == added(found));
    let verdict = found.verdict.name();
    if truth["group"] == "edge" || truth["group"] == "power" {
        // Any answer but a wrong one.
        return accepted || among(truth, found) || !matches!(found.verdict, Verdict::Missing | Verdict::Ambiguous);
    }
    match truth["verdict"].as_str().unwrap() {
        "ambiguous" => verdict == "ambiguous" && (accepted || among(truth, found)),
        "unexplained" => {
            let covariates = names(&truth["covariates"]);
            let told = found.covariates.iter().any(|leaning| covariates.contains(&leaning.name));
            verdict == "unexplained" && accepted && (told || covariates.is_empty())
        }
        other => verdict == other && accepted,
    }
}

/// Parameters whose true value is known: how many are within three errors, and how many there are.
pub fn pulls(truth: &Value, found: &Diagnosis) -> (usize, usize) {
    let (mut near, mut all) = (0, 0);
    let fitted = || found.steps.iter().flat_map(|step| &step.parameters);
    let names: Vec<&str> = fitted().map(|fitted| fitted.key.rsplit('.').next().unwrap()).collect();
    for (fitted, name) in fitted().zip(&names) {
        // Of a name that two effects have, the truth does not say whose value it is.
        if names.iter().filter(|other| *other == name).count() > 1 {
            continue;
        }
        if let (Some(value), Some(sigma)) = (truth["parameters"][*name].as_f64(), fitted.sigma) {
            all += 1;
            near += usize::from((fitted.value - value).abs() < 3.0 * sigma);
        }
    }
    (near, all)
}
