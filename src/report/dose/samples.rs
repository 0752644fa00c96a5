//! `ctiplan dose --samples`: quantiles of the dose with the Sun drawn.

use crate::plan::dose::{QUANTILES, Quantile, Samples, Survey};
use crate::plan::sources::Source;
use crate::report::study::estimate::{scientific, scientific_value};
use crate::report::{Parts, table};
use crate::study::Estimate;

/// The quantiles, if requested.
pub(super) fn said(survey: &Survey, out: &mut Parts) {
    let Some(samples) = &survey.samples else { return };
    out.heading(format!(
        "Dose with the Sun drawn as events, before effects: {} samples, seed {}",
        samples.samples, samples.seed
    ));
    let mut at_end = table(&["not exceeded with [%]", "dose [MeV/g]", "ESP, sum of active years [MeV/g]"]);
    for at in &samples.quantiles {
        let esp = at.esp_mev_g.map_or("-".into(), |esp_mev_g| format!("{esp_mev_g:.3e}"));
        at_end.add_row(vec![percent(at.p), or_zero(at, scientific), esp]);
    }
    out.table(at_end);
    out.words(findings(survey, samples), 2);
    out.heading("Dose since launch at the end of each year [MeV/g], not exceeded with");
    let columns: Vec<String> = QUANTILES.iter().map(|p| format!("{} %", percent(*p))).collect();
    let mut years = table(&std::iter::once("year").chain(columns.iter().map(String::as_str)).collect::<Vec<_>>());
    for year in &samples.years {
        let cells = year.quantiles.iter().map(|at| or_zero(at, scientific_value));
        years.add_row(std::iter::once(year.year.to_string()).chain(cells));
    }
    out.table(years);
}

/// Further findings, and the validity of the numbers.
fn findings(survey: &Survey, samples: &Samples) -> String {
    let mut words = format!("A mission has {:.1} solar events on average", samples.events);
    if let Some(share) = samples.largest_event_share {
        words += &format!("; the largest makes {:.0} % of the dose of all events on average", 100.0 * share);
    }
    if samples.others_mev_g > 0.0 {
        words += &format!(". Everything else makes {:.3e} MeV/g in all samples", samples.others_mev_g);
    }
    let flown_yr = survey.years.iter().map(|year| year.flown_yr).sum();
    if !survey.history.extrapolated(flown_yr).is_empty() {
        words += ". Solar maxima that are not known yet are drawn, too; ESP's quantile is of those that are expected";
    }
    words
        + ". Errors are from the number of samples alone; at the end of the mission they are upper limits. ESP itself is known \
             to a factor of 2 at 95 %, and has no events in quiet years."
}

/// CSV columns of the table of years.
pub(super) fn columns(survey: &Survey) -> Vec<String> {
    let names = |p: &f64| {
        let p = format!("p{:02}", (100.0 * p).round());
        [format!("cumulative_{p}_mev_g"), format!("cumulative_{p}_error_mev_g")]
    };
    survey.samples.iter().flat_map(|_| QUANTILES.iter().flat_map(names)).collect()
}

/// Their cells in a row.
pub(super) fn cells(survey: &Survey, year: usize) -> Vec<String> {
    let quantiles = survey.samples.iter().flat_map(|samples| &samples.years[year].quantiles);
    quantiles.flat_map(|at| [at.dose_mev_g.to_string(), at.error.to_string()]).collect()
}

/// Source of the event model.
pub(super) fn source() -> Source {
    Source::new(
        "Solar events, drawn: a Poisson process with lognormal sizes, scaled to ESP's quantiles of a mission",
        "moments: Xapsos et al. 1999, 2000; rate: ECSS-E-ST-10-04C (2008), table I-2; quiet years: list of solar proton events \
         affecting the Earth environment (NOAA/NCEI), 1976 to 2026",
    )
}

/// A quantile in words; 0 if there is no dose yet.
fn or_zero(at: &Quantile, words: fn(Estimate) -> String) -> String {
    let estimate = Estimate { value: at.dose_mev_g, error: at.error };
    if estimate.value == 0.0 && estimate.error == 0.0 { "0".into() } else { words(estimate) }
}

fn percent(p: f64) -> String {
    format!("{:.0}", 100.0 * p)
}
