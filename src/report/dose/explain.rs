//! `ctiplan dose --explain`: from the particle spectrum to MeV/g, one numbered line per step.

use crate::mission::SolarPhase;
use crate::plan::dose::{EventDose, Step, Survey};
use crate::report::{Parts, table};

/// The steps, if requested.
pub(super) fn said(survey: &Survey, out: &mut Parts) {
    if !survey.explain {
        return;
    }
    let Some(explained) = &survey.explained else {
        out.gap();
        out.words("The dose is given, not derived: there are no steps to explain.", 2);
        return;
    };
    out.heading("From the particles to the dose");
    let steps = explained.steps.iter().map(|step| words(step, survey.confidence));
    let last = ((survey.total_mev_g / sum(&explained.steps) - 1.0).abs() > 1e-9).then(|| {
        format!("effects and what the mission gives by hand change the dose to {:.4e} MeV/g", survey.total_mev_g)
    });
    for (index, line) in steps.chain(last).enumerate() {
        out.words(format!("{:2}. {line}", index + 1), 4);
    }
    events(survey, out);
}

/// Events that have less than this share of the dose are not listed, nor more events than this number.
const LEAST_SHARE: f64 = 0.01;
const MOST_EVENTS: usize = 12;

/// The observed events that matter.
fn events(survey: &Survey, out: &mut Parts) {
    let matter: Vec<&EventDose> = survey.large_events().collect();
    if survey.events.is_empty() {
        return;
    }
    out.heading("Solar proton events that matter, with fluences outside the magnetosphere");
    let mut rows = table(&["start", "above 10 MeV [1/cm2]", "above 100 MeV [1/cm2]", "dose [MeV/g]", "share [%]"]);
    let line = |name: String, events: &[&EventDose]| {
        let sum = |of: fn(&EventDose) -> f64| events.iter().map(|event| of(event)).sum::<f64>();
        vec![
            name,
            format!("{:.2e}", sum(|event| event.above_10_mev_cm2)),
            format!("{:.2e}", sum(|event| event.above_100_mev_cm2)),
            format!("{:.3e}", sum(|event| event.dose_mev_g)),
            format!("{:.1}", 100.0 * sum(|event| event.share)),
        ]
    };
    for event in &matter {
        rows.add_row(line(event.start.date().to_string(), &[event]));
    }
    let others: Vec<&EventDose> = survey.events.iter().skip(matter.len()).collect();
    rows.add_row(line(format!("{} others", others.len()), &others));
    out.table(rows);
    out.words(
        "Calibration errors of the fluences: 10 % above 10 MeV to 35 % above 100 MeV, common to the events of a satellite. Above \
         100 MeV the spectra are continued as a power of rigidity.",
        2,
    );
}

impl Survey {
    /// The observed events that matter, the largest dose first.
    pub(super) fn large_events(&self) -> impl Iterator<Item = &EventDose> {
        self.events.iter().take(MOST_EVENTS).take_while(|event| event.share >= LEAST_SHARE)
    }
}

/// The sum of all sources, MeV/g.
fn sum(steps: &[Step]) -> f64 {
    let sum = steps.iter().find_map(|step| match step {
        Step::Sum { total_mev_g, .. } => Some(*total_mev_g),
        _ => None,
    });
    sum.unwrap_or(0.0)
}

fn words(step: &Step, confidence: f64) -> String {
    match step {
        Step::Orbit { orbit, duration_yr, active_years, observed_to } => match observed_to {
            None => format!("orbit {orbit}; {duration_yr} yr with {active_years:.2} active years of the Sun"),
            Some(day) => format!(
                "orbit {orbit}; {duration_yr} yr, with the Sun as it was to {day} and {active_years:.2} active years after that"
            ),
        },
        Step::Source { name, law, share, held, observed_to } => {
            let observed = observed_to.map_or(String::new(), |day| format!(", as observed to {day}; after that"));
            let law = law.map_or(String::new(), |law| format!("{observed}: {law}"));
            let held = match held {
                None => "",
                Some(SolarPhase::Min) => "; the Sun is held at minimum",
                Some(SolarPhase::Max) => "; the Sun is held at maximum",
            };
            format!(
                "{:.1} % of the dose is from {name}{law}{held}; confidence of solar protons {} %",
                100.0 * share,
                100.0 * confidence
            )
        }
        Step::Fluence { above_cm2 } => {
            let fluences: Vec<String> =
                above_cm2.iter().map(|(energy, fluence)| format!("{fluence:.4e} above {energy} MeV")).collect();
            format!("fluence of {} per cm2 over the mission", fluences.join(", "))
        }
        Step::Shield { words, open, along_normal, areal_g_cm2, aluminium_g_cm2 } => format!(
            "shield: {words}; {areal_g_cm2:.4} g/cm2 {}, equivalent to {aluminium_g_cm2:.4} g/cm2 of aluminium, over {:.1} % of the \
             sky",
            if *along_normal { "along its normal" } else { "on average" },
            100.0 * open
        ),
        Step::Range { stopped_below_mev, before_mev, behind_mev } => format!(
            "the thinnest part stops protons below {stopped_below_mev:.4} MeV (range = thickness); a proton of {before_mev:.4} MeV \
             leaves it with {behind_mev:.4} MeV"
        ),
        Step::Behind { fluence_cm2 } => format!("fluence behind it: {fluence_cm2:.4e} per cm2 above 0.1 MeV"),
        Step::Niel { curve, mean_mev_cm2_g, dose_mev_g } => {
            format!("times their mean damage of {mean_mev_cm2_g:.4e} MeV cm2/g ({curve}) = {dose_mev_g:.4e} MeV/g")
        }
        Step::Sum { sources, factor, total_mev_g } => {
            let all: Vec<String> = sources.iter().map(|(name, dose)| format!("{dose:.4e} ({name})")).collect();
            let times = if *factor == 1.0 { String::new() } else { format!(", with the factor {factor}") };
            format!("all sources: {} = {total_mev_g:.4e} MeV/g{times}", all.join(" + "))
        }
        Step::Equivalent { niel_10_mev, protons_cm2 } => {
            format!("divided by {niel_10_mev} MeV cm2/g (NIEL at 10 MeV): {protons_cm2:.4e} protons of 10 MeV per cm2")
        }
        Step::Traps { reference_mev_g, reference_of, ratio } => {
            let of = reference_of.map_or(String::new(), |(fluence, energy, niel)| {
                format!(" ({fluence:e} protons of {energy} MeV per cm2 x {niel:.4e} MeV cm2/g)")
            });
            format!(
                "divided by the reference dose of {reference_mev_g:.4e} MeV/g{of}: {ratio:.4e} times the quoted trap densities"
            )
        }
    }
}
