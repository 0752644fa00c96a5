//! What is told of measurements that flew, held against what the literature says of them (docs/flight.md).

use ctiplan::analysis::diagnose::{Diagnosis, Note, Options, Progress, Verdict, diagnose};
use ctiplan::analysis::fit::{self, fit};
use ctiplan::analysis::measurement::DataSet;
use ctiplan::mission::Mission;

const SILENT: Progress = Progress { stage: &|_, _| (), advance: &|| () };

fn read(mission: &str, data: &str) -> (Mission, Vec<DataSet>) {
    let mission = Mission::read(format!("docs/flight/{mission}.toml")).unwrap();
    let data = vec![DataSet::read(data, &mission).unwrap()];
    (mission, data)
}

fn diagnosed(mission: &str, data: &str) -> Diagnosis {
    let (mission, data) = read(mission, data);
    let options = Options { free: mission.fit.free.clone(), stability: false, ..Options::default() };
    diagnose(&mission, &data, &options, &SILENT).unwrap()
}

#[test]
fn the_x_ray_camera_shows_a_cycle_of_ten_to_eleven_years_and_perhaps_the_event_of_july_2000() {
    let found = diagnosed("xmm_pn", "missions/flown/xmm_pn_al_k.ecsv");
    let effects: Vec<&str> = found.steps.iter().map(|step| step.effect.as_str()).collect();
    assert_eq!((found.verdict, &effects[..]), (Verdict::Missing, &["cycle"][..]), "{}", found.reason);
    // One row alone shows the event, and it may be wrong.
    assert_eq!(found.noise[0].wrong.iter().map(|wrong| wrong.row).collect::<Vec<_>>(), [0]);
    let told = |note: &Note| matches!(note, Note::IfErrorsAreRight { effects, .. } if effects[..] == ["solar-flare"]);
    assert!(found.notes.iter().any(told), "{:?}", found.notes);
    let fitted = |step: usize, name: &str| {
        let of = found.steps[step].parameters.iter().find(|fitted| fitted.key.ends_with(name)).unwrap();
        (of.value, of.sigma.unwrap())
    };
    let (period_yr, error_yr) = fitted(0, ".period_yr");
    assert!((10.0..11.0).contains(&period_yr) && error_yr < 0.5, "{period_yr} +- {error_yr}");
    let chi2 =
        |effect: &str| found.tried.iter().find(|tried| tried.effect == effect).and_then(|tried| tried.chi2).unwrap();
    assert!(chi2("solar-cycle") > found.baseline.chi2 + 100.0);
}

#[test]
fn in_low_orbit_the_published_cycle_is_much_better_than_no_cycle_or_the_opposite_one() {
    let chi2 = |mission: &str| {
        let (mission, data) = read(mission, "missions/flown/hst_acs_trap_density.ecsv");
        fit(&mission, &data, &mission.fit.free, &fit::Options::default(), &|_| ()).unwrap().chi2
    };
    let [flat, opposite, published] = ["hst_acs", "hst_acs_seven_years_on", "hst_acs_published_cycle"].map(chi2);
    assert!(opposite > flat + 100.0 && flat > published + 100.0, "{opposite}, {flat}, {published}");
    let found = diagnosed("hst_acs", "missions/flown/hst_acs_trap_density.ecsv");
    let told: Vec<&String> = found.alternatives.iter().flatten().collect();
    assert!(
        found.verdict == Verdict::Ambiguous && told.iter().any(|name| *name == "cycle"),
        "{} {told:?}",
        found.reason
    );
}

#[test]
fn nothing_is_claimed_where_temperature_hardly_varied() {
    let found = diagnosed("chandra_s2", "docs/flight/chandra_s2_mn_k.ecsv");
    assert_eq!((found.verdict, found.steps.len()), (Verdict::Complete, 0), "{}", found.reason);
    assert!(found.noise[0].pedestal.is_none());
    let limit = found.limits.iter().find(|limit| limit.effect == "temperature-offset").unwrap();
    assert!(limit.table.is_none());
}
