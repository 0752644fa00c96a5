//! `ctiplan study correction`.

use serde::Serialize;

use super::estimate::{error_of_date, known_date, plus_minus, scientific};
use super::table::{column, words};
use super::{DataTable, Digits, Shown, StudyReport, budget, short, when};
use crate::mission::Mission;
use crate::plan::judgement::Limited;
use crate::report::plot::{Figure, Panel, line};
use crate::study::Estimate;
use crate::study::correction::{BiasLeft, Cause, Earned, Left, PopulationRemainder, Remainder, Results};

/// Standard errors above which a mean is significant.
const STANDS_OUT: f64 = 3.0;

impl Shown for Results {
    fn shown(&self, mission: &Mission) -> StudyReport {
        let title = format!(
            "what correction leaves of the shape error of \"{}\" at the end of the mission",
            mission.requirement.galaxy
        );
        let mut report = StudyReport::of("correction", mission, title, &self.warnings);
        if self.population.is_none() {
            report.of_galaxy_alone(mission);
        }
        report.cite(
            "Correction by iterating the readout",
            "Bristow 2003; Massey et al. 2010 (MNRAS 401, 371); Massey et al. 2014 (MNRAS 439, 887)",
        );
        let Some(remainder) = &self.remainder else {
            report.tables = vec![causes(&[])];
            report.find("There is nothing to correct at the end of the mission: no traps, or no shape left.");
            return report;
        };
        report.tables = vec![causes(&remainder.causes)];
        if let Some(population) = &self.population {
            report.tables.extend(of_population(population));
        }
        report.result("uncorrected_delta_e", remainder.uncorrected_delta_e);
        report.result("needed_factor", remainder.needed_factor);
        report.result("assumed_factor", remainder.assumed_factor);
        match &remainder.earned {
            None => report.find("Corrected with these errors of the parameters, no shape is left to measure."),
            Some(earned) => {
                describe(&mut report, remainder, earned, mission);
                report.draw(figure(remainder, earned, mission));
            }
        }
        if let Some(population) = &self.population {
            describe_population(&mut report, population);
        }
        report
    }
}

/// A cause by its name.
fn name(cause: &Cause) -> String {
    match cause {
        Cause::PerfectKnowledge => "perfect knowledge".into(),
        Cause::Parameter(key) => key.strip_prefix("detector.").unwrap_or(key).into(),
        Cause::Together => "all together, rms".into(),
        Cause::Noise(read_noise_e) => format!("noise, {} e- read noise", short(*read_noise_e)),
    }
}

/// The residual from a cause, with its name.
#[derive(Serialize)]
struct Named<'a> {
    cause: String,
    #[serde(flatten)]
    left: &'a Left,
}

fn causes(causes: &[Left]) -> DataTable {
    let columns = vec![
        words("cause", "uncertain input"),
        column("error_percent", "error [%]", Digits::Significant(3)),
        column("delta_e", "residual |delta e|", Digits::Scientific(2)).with_error("delta_e_sigma"),
        column("left_percent", "residual [%]", Digits::Significant(3)).with_error("left_error_percent"),
        column("factor", "factor", Digits::Significant(3)).with_error("factor_error"),
    ];
    DataTable::of("causes", causes.iter().map(|left| Named { cause: name(&left.cause), left }), columns)
}

fn figure(remainder: &Remainder, earned: &Earned, mission: &Mission) -> Figure {
    let points = &remainder.curve.points;
    let x: Vec<f64> = points.iter().map(|point| point.0).collect();
    let curve = |factor: f64| -> Vec<f64> {
        points.iter().map(|point| point.1.map_or(f64::NAN, |delta_e| delta_e / factor)).collect()
    };
    let assumed = remainder.assumed_factor;
    let panel = Panel {
        x_label: "years since launch".into(),
        y_label: "|Δe|".into(),
        series: vec![
            line("uncorrected", 2, &x, curve(1.0)),
            line(&format!("assumed factor {assumed}"), 1, &x, curve(assumed)),
            line(&format!("achieved factor {}", plus_minus(earned.factor)), 3, &x, curve(earned.factor.value)),
        ]
        .into_iter()
        .chain(budget(mission))
        .collect(),
        ..Panel::default()
    };
    Figure { title: format!("{}: correction", mission.mission.name), panels: vec![panel] }
}

fn describe(report: &mut StudyReport, remainder: &Remainder, earned: &Earned, mission: &Mission) {
    report.result("earned_factor", earned.factor.value);
    report.result("earned_factor_error", earned.factor.error);
    report.result("corrected_percent", earned.removed_percent.value);
    report.result("corrected_error_percent", earned.removed_percent.error);
    limit(report, remainder);
    report.find(noise(remainder.noise_delta_e));
    let (needed, assumed) = (remainder.needed_factor, remainder.assumed_factor);
    let within = if needed <= 1.0 {
        "No correction is needed to meet the budget".to_string()
    } else {
        format!("A factor {needed:.2} is needed to meet the budget")
    };
    report.find(format!(
        "The correction achieves a factor {} ({} % removed); the mission assumes {assumed}. {within}. Published: a factor 10 \
         (Massey et al. 2009, ACS), 98 % removed (Massey et al. 2014, ACS), 99.68 % in simulations with a perfect model (Israel \
         et al. 2015, Euclid).",
        plus_minus(earned.factor),
        plus_minus(earned.removed_percent)
    ));
    let launch = mission.mission.launch.0;
    let date = |factor: f64| when(remainder.curve.crossing(mission.requirement.delta_e * factor).date(launch));
    report.find(format!(
        "Budget: {} without correction, {} with the assumed factor, {} with the achieved factor.",
        date(1.0),
        date(assumed),
        earned_date(earned)
    ));
}

/// The parameter whose error leaves the largest residual.
fn limit(report: &mut StudyReport, remainder: &Remainder) {
    let square = |left: &Left| left.delta_e.map_or(0.0, |delta_e| delta_e * delta_e);
    let parameters = || remainder.causes.iter().filter(|left| left.error_percent.is_some());
    let all: f64 = parameters().map(square).sum();
    let most = parameters().max_by(|a, b| square(a).total_cmp(&square(b)));
    if let Some(most) = most.filter(|_| all > 0.0) {
        report.result("limited_by", name(&most.cause));
        report.find(format!(
            "The correction is limited by {}: its error of {} % alone leaves {:.2} % of the shape error, {:.0} % of the sum of \
             squares.",
            name(&most.cause),
            short(most.error_percent.unwrap_or(0.0)),
            100.0 * most.delta_e.unwrap_or(0.0) / remainder.uncorrected_delta_e,
            100.0 * square(most) / all
        ));
    }
}

/// The residual from noise with the true model.
fn noise(delta_e: Option<Estimate>) -> String {
    match delta_e {
        Some(noise) if noise.value > STANDS_OUT * noise.error => format!(
            "Noise leaves {} even with the true model: read noise is added after the transfers, but corrected as if before them.",
            scientific(noise)
        ),
        Some(noise) => format!(
            "Noise leaves no significant error (standard error {:.0e}); more --realisations make that smaller.",
            noise.error
        ),
        None => {
            "Noise is not included: give --read-noise-e, [readout.noise] or read_noise_e of the galaxy to include it."
                .into()
        }
    }
}

fn earned_date(earned: &Earned) -> String {
    match (earned.exceeded_date, earned.exceeded_error_d) {
        (Some(date), Some(error_d)) => {
            format!("exceeded {} ({})", known_date(date, Some(error_d)), error_of_date(error_d))
        }
        (Some(date), None) => format!("exceeded {}", known_date(date, None)),
        (None, _) => when(None),
    }
}

/// Shear biases of the population, and the required knowledge of the parameters.
fn of_population(population: &PopulationRemainder) -> Vec<DataTable> {
    let biases = vec![
        words("bias", "population"),
        column("uncorrected", "uncorrected", Digits::Scientific(2)).with_error("uncorrected_error"),
        column("left", "left, rms", Digits::Scientific(2)).with_error("left_error"),
        column("left_percent", "left [%]", Digits::Significant(3)).with_error("left_error_percent"),
        column("factor", "factor", Digits::Significant(3)).with_error("factor_error"),
        column("used_percent", "of the limit [%]", Digits::Significant(3)),
    ];
    let tolerances = vec![
        words("parameter", "parameter"),
        column("error_percent", "known to [%]", Digits::Significant(3)),
        column("needed_c_percent", "needed for |c| [%]", Digits::Significant(3)),
        column("needed_m_percent", "needed for |m| [%]", Digits::Significant(3)),
    ];
    let mut tables = vec![DataTable::of("population", &population.biases, biases).titled(
        "Shear biases of the population: what errors of the parameters leave, to first order; +-: finite sample of galaxies",
    )];
    if !population.tolerances.is_empty() {
        tables.push(DataTable::of("tolerances", &population.tolerances, tolerances).titled(
            "Error (1 sigma) of a parameter that uses up the limit on a bias at the end of the mission, all others known exactly",
        ));
    }
    tables
}

fn describe_population(report: &mut StudyReport, population: &PopulationRemainder) {
    for limited in [Limited::C, Limited::M] {
        let Some(largest) = population.largest(limited) else { continue };
        report.result(&format!("earned_factor_{}", limited.key()), largest.factor);
        report.result(&format!("earned_factor_{}_error", limited.key()), largest.factor_error);
        report.find(bias_left(largest));
    }
    let needed: Vec<String> = population
        .all()
        .map(|all| {
            let percent = |needed: Option<f64>| needed.map_or("-".into(), short);
            let known = all.error_percent.map_or("exactly".into(), |percent| format!("to {} %", short(percent)));
            format!(
                "{} to {} % for |c| and {} % for |m|, where the correction knows them {known}",
                all.parameter,
                percent(all.needed_c_percent),
                percent(all.needed_m_percent)
            )
        })
        .collect();
    match needed.is_empty() {
        true => report.find("The requirement has no limit on c or m: how well the traps must be known for the population is not computed."),
        false => report.find(format!(
            "The limits on the population ask for {}. Israel et al. 2015 (Euclid, worst-case galaxy) ask for 0.03 % in densities and \
             0.04 % in release times.",
            needed.join("; ")
        )),
    }
}

/// The factor of the correction for a bias.
fn bias_left(bias: &BiasLeft) -> String {
    let Some(factor) = bias.factor else { return format!("Of {} nothing is left to first order.", bias.bias) };
    let estimate = |value: f64, error: Option<f64>| Estimate { value, error: error.unwrap_or(0.0) };
    let limit = match bias.used_percent {
        None => String::new(),
        Some(percent) if percent <= 100.0 => format!(", {} % of its limit", short(percent)),
        Some(percent) => format!(", {} % of its limit: exceeded", short(percent)),
    };
    format!(
        "For the population's {} the correction achieves a factor {}: {} is left (1 sigma){limit}.",
        bias.bias,
        plus_minus(estimate(factor, bias.factor_error)),
        scientific(estimate(bias.left, bias.left_error))
    )
}
