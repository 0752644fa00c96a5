//! The Sun as it was: doses of observed years, events on their days, what follows the record, and what is refused.

use chrono::Datelike;
use ctiplan::mission::Mission;
use ctiplan::model::Model;
use ctiplan::numeric::calendar::decimal_year;
use ctiplan::physics::SolarEventDoses;
use ctiplan::plan::dose::survey;
use ctiplan::plan::flown::Flown;
use toml::Value;

/// A mission at L2 with these keys.
fn mission(settings: &[(&str, Value)]) -> Mission {
    let base = Mission::read("missions/flown/gaia.toml").unwrap();
    let settings: Vec<(String, Value)> = settings.iter().map(|(key, value)| (key.to_string(), value.clone())).collect();
    base.with(&settings).unwrap()
}

fn date(text: &str) -> Value {
    Value::Datetime(text.parse().unwrap())
}

/// All observed years.
fn all_years(thickness_mm: f64) -> Mission {
    mission(&[
        ("mission.launch", date("1997-01-01")),
        ("mission.duration_yr", 28.7.into()),
        ("shielding.thickness_mm", thickness_mm.into()),
    ])
}

fn solar(mission: &Mission, from_yr: f64, to_yr: f64) -> f64 {
    let model = Model::new(mission);
    let sources = model.history().sources.iter().filter(|source| source.name == "solar-protons");
    sources.map(|source| model.history().of_source_mev_g(source, from_yr, to_yr)).sum()
}

/// The list's own check columns, another program's dose of the same events: each year to 25 %, all years together to 12 %.
///
/// Behind 5 mm the sum is 10.8 % above the check, by the same factor for soft and hard events. An integration in 4e6 steps of the
/// energy, with this range and damage curve, has 1.114 times the check for 2000-07-14 behind 5 mm, and 1.049 times without protons that
/// leave the shield below 0.1 MeV: the check omits them, and this program counts them down to 1 keV. Behind 80 mm the forms above 100
/// MeV differ. Gaps, which the check has not, are no events.
#[test]
fn doses_of_observed_years_are_those_worked_out_elsewhere() {
    let table = include_str!("../golden/solar_dose_yearly.csv");
    let mut lines = table.lines().filter(|line| !line.starts_with('#'));
    let header: Vec<&str> = lines.next().unwrap().split(',').collect();
    let rows: Vec<Vec<f64>> = lines.map(|line| line.split(',').map(|cell| cell.parse().unwrap()).collect()).collect();
    let mut faults = Vec::new();
    for (column, name) in header.iter().enumerate().skip(1) {
        let survey = survey(&all_years(name.trim_end_matches("_mm").parse().unwrap()), &[10.0]).unwrap();
        let found = |year: f64| {
            let of_year = survey.events.iter().filter(|event| f64::from(event.start.year()) == year);
            of_year.map(|event| event.dose_mev_g).sum::<f64>()
        };
        for row in &rows {
            // A year without events has neither.
            let (found, known) = (found(row[0]), row[column]);
            if (found - known).abs() > 0.25 * known {
                faults.push(format!("{} {name}: {found:e} {known:e}", row[0]));
            }
        }
        let (sum, found) =
            (rows.iter().map(|row| row[column]).sum::<f64>(), rows.iter().map(|row| found(row[0])).sum::<f64>());
        if (found / sum - 1.0).abs() >= 0.12 {
            faults.push(format!("{name}: {found:e} {sum:e}"));
        }
    }
    assert!(faults.is_empty(), "{faults:#?}");
}

/// Days, fluences above 10 and 100 MeV (calibrated), as published for large events.
#[test]
fn large_events_come_on_their_days_with_their_fluences() {
    let survey = survey(&all_years(15.0), &[10.0]).unwrap();
    for (from, to, above_10, above_100) in [
        ("2000-07-14", "2000-07-15", 1.25e10, Some(9e7)),
        ("2000-11-07", "2000-11-09", 8e9, None),
        ("2001-11-03", "2001-11-05", 1.15e10, None),
        ("2003-10-28", "2003-11-02", 1.3e10, Some(7e7)),
        ("2005-01-15", "2005-02-01", 3.4e9, Some(5e7)),
        ("2006-12-01", "2007-01-01", 2.4e9, None),
        ("2012-01-23", "2012-01-24", 4.3e9, None),
        ("2012-01-01", "2012-02-01", 5e9, None),
        ("2012-03-07", "2012-03-08", 3.7e9, None),
        ("2017-09-10", "2017-09-11", 1.7e9, Some(2.7e7)),
        ("2024-01-01", "2025-01-01", 3.8e9, None),
        ("2024-10-01", "2024-11-01", 1.9e9, None),
    ] {
        let within = |event: &&ctiplan::plan::dose::EventDose| {
            let day = event.start.date().to_string();
            day.as_str() >= from && day.as_str() < to
        };
        let events: Vec<_> = survey.events.iter().filter(within).collect();
        let sum: f64 = events.iter().map(|event| event.above_10_mev_cm2).sum();
        assert!((sum / above_10 - 1.0).abs() < 0.1, "{from}: {sum:e}");
        if let Some(above_100) = above_100 {
            let sum: f64 = events.iter().map(|event| event.above_100_mev_cm2).sum();
            assert!((sum / above_100 - 1.0).abs() < 0.1, "{from}: {sum:e}");
        }
    }
    assert!(survey.events.windows(2).all(|pair| pair[0].dose_mev_g >= pair[1].dose_mev_g));
}

/// On the day of the event, and not before.
#[test]
fn the_dose_of_an_event_comes_in_its_days() {
    for launch in ["1999-12-10", "2000-03-01"] {
        let mission = mission(&[("mission.launch", date(launch)), ("mission.duration_yr", 3.0.into())]);
        let launch: chrono::NaiveDate = launch.parse().unwrap();
        let at = |day: &str| (day.parse::<chrono::NaiveDate>().unwrap() - launch).num_days() as f64 / 365.25;
        let (before, within) =
            (solar(&mission, at("2000-07-01"), at("2000-07-14")), solar(&mission, at("2000-07-14"), at("2000-08-01")));
        assert!(within > 100.0 * before && within > 1e6, "{before:e} {within:e}");
    }
}

/// Of launches after the record nothing is observed: dose and draws are those of the drawn Sun.
#[test]
fn after_the_record_the_sun_is_what_it_was() {
    for orbit in ["missions/flown/gaia.toml", "missions/hst_leo.toml"] {
        let base = Mission::read(orbit).unwrap();
        let at = |sun: &str| {
            let settings =
                [("environment.sun".to_string(), sun.into()), ("mission.launch".to_string(), date("2030-01-01"))];
            base.with(&settings).unwrap()
        };
        let (drawn, observed) = (at("drawn"), at("observed"));
        let models = [&drawn, &observed].map(Model::new);
        for t_yr in [0.3, 2.0, base.mission.duration_yr] {
            let [one, other] = [0, 1].map(|index: usize| models[index].dose_mev_g(t_yr).unwrap());
            assert!((one / other - 1.0).abs() < 1e-12, "{orbit}: {one} {other}");
        }
        assert_eq!([&drawn, &observed].map(Mission::observed_to), [None; 2]);
        let steps = [(&drawn, 0), (&observed, 1)]
            .map(|(mission, model)| SolarEventDoses::of(mission, models[model].history(), 100, 1).unwrap().steps(17));
        assert_eq!(steps[0], steps[1]);
    }
}

/// Before the record ends nothing but the calibration differs between draws; afterwards events do.
#[test]
fn draws_differ_by_calibration_up_to_the_record_and_by_events_after_it() {
    let mission = mission(&[("mission.launch", date("2020-01-01")), ("mission.duration_yr", 10.0.into())]);
    let model = Model::new(&mission);
    let doses = SolarEventDoses::of(&mission, model.history(), 200, 1).unwrap();
    let end_yr = 2025.69 - 2020.0;
    assert!((doses.drawn_from_yr - end_yr).abs() < 0.01, "{}", doses.drawn_from_yr);
    let sums: Vec<f64> = (0..200)
        .map(|index| doses.steps(index).iter().filter(|step| step.0 < end_yr).map(|step| step.1).sum())
        .collect();
    let mean = sums.iter().sum::<f64>() / 200.0;
    let scatter = (sums.iter().map(|sum| (sum / mean - 1.0).powi(2)).sum::<f64>() / 199.0).sqrt();
    assert!((mean / solar(&mission, 0.0, end_yr) - 1.0).abs() < 0.08, "{mean:e}");
    assert!((0.1..0.45).contains(&scatter), "{scatter}");
    let times = |index: usize| doses.steps(index).iter().map(|step| step.0).filter(|t_yr| *t_yr > end_yr).count();
    assert!((0..20).any(|index| times(index) != times(index + 20)));
}

#[test]
fn what_has_flown_has_an_error_and_an_end() {
    let mission = mission(&[("mission.launch", date("2023-07-01")), ("mission.duration_yr", 6.0.into())]);
    let flown = Flown::of(&mission).unwrap().unwrap();
    assert_eq!(flown.until.to_string(), "2025-09-10");
    let [dose, events] = [flown.dose_mev_g, flown.solar_events_mev_g];
    assert!(dose.error > 0.2 * dose.value && dose.error < 0.6 * dose.value && events.value < dose.value, "{flown:?}");
    let past = Flown::of(&Mission::read("missions/flown/gaia.toml").unwrap()).unwrap().unwrap();
    assert!((past.t_yr - 6.04).abs() < 1e-9);
    assert_eq!(Flown::of(&Mission::read("missions/snap_l2_shielded.toml").unwrap()).unwrap(), None);
}

/// An orbit whose elements do not change is the fixed one, under the drawn Sun and the observed one.
#[test]
fn elements_that_do_not_change_are_a_fixed_orbit() {
    let folder = tempfile::tempdir().unwrap();
    let text = std::fs::read_to_string("missions/hst_leo.toml").unwrap();
    let lines = ["perigee_km", "apogee_km", "inclination_deg"];
    let fixed: Vec<&str> = text.lines().collect();
    let by_date: Vec<&str> =
        fixed.iter().filter(|line| !lines.iter().any(|key| line.starts_with(key))).copied().collect();
    let by_date = by_date.join("\n").replace("kind = \"elements\"", "kind = \"elements\"\nhistory = \"orbit.csv\"");
    let rows = "date,perigee_km,apogee_km,inclination_deg\n2008-01-01,590,590,28.5\n2013-01-01,590,590,28.5\n2016-05-01,590,590,28.5\n";
    std::fs::write(folder.path().join("orbit.csv"), rows).unwrap();
    std::fs::write(folder.path().join("mission.toml"), by_date).unwrap();
    let moved = Mission::read(folder.path().join("mission.toml")).unwrap();
    let held = Mission::read("missions/hst_leo.toml").unwrap();
    for sun in ["drawn", "observed"] {
        let [one, other] = [&held, &moved].map(|mission| {
            let mission = mission.with(&[("environment.sun".to_string(), sun.into())]).unwrap();
            Model::new(&mission).dose_mev_g(mission.mission.duration_yr).unwrap()
        });
        assert!((one / other - 1.0).abs() < 2e-3, "{sun}: {one:e} {other:e}");
    }
}

#[test]
fn observed_suns_are_refused_where_they_do_not_apply() {
    let base = Mission::read("missions/flown/gaia.toml").unwrap();
    let refused = |settings: &[(&str, Value)]| {
        let settings: Vec<(String, Value)> =
            settings.iter().map(|(key, value)| (key.to_string(), value.clone())).collect();
        base.with(&settings).unwrap_err().to_string()
    };
    assert!(refused(&[("mission.launch", date("1990-01-01"))]).contains("observed from 1997-01-01"));
    assert!(refused(&[("environment.active_years", 2.0.into())]).contains("sun = \"observed\""));
    assert!(refused(&[("environment.model", "constant".into())]).contains("derived"));
    let refused = refused(&[("environment.sun", "drawn".into()), ("environment.solar_events", "none.ecsv".into())]);
    assert!(refused.contains("none.ecsv"), "{refused}");
}

/// A file of one event: its columns of fluence with their unit, and its row.
fn event_file(unit: &str, row: &str) -> String {
    format!(
        "# %ECSV 1.0\n# ---\n# datatype:\n# - {{name: start, datatype: string}}\n# - {{name: end, datatype: string}}\n# - {{name: satellite, datatype: string}}\n# - {{name: above_10_mev_cm2, unit: {unit}, datatype: float64}}\n# - {{name: above_100_mev_cm2, unit: {unit}, datatype: float64}}\n# delimiter: ','\n# meta: {{observed_to: '2026-03-01'}}\n# schema: astropy-2.0\nstart,end,satellite,above_10_mev_cm2,above_100_mev_cm2\n{row}\n"
    )
}

/// A mission at L2 from 2025 with this file of events, or what is said against it.
fn with_events(text: &str) -> Result<Mission, String> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("events.ecsv");
    std::fs::write(&path, text).unwrap();
    let settings = [
        ("mission.launch".to_string(), date("2025-01-01")),
        ("mission.duration_yr".to_string(), 3.0.into()),
        ("environment.solar_events".to_string(), path.display().to_string().into()),
    ];
    Mission::read("missions/flown/gaia.toml").unwrap().with(&settings).map_err(|error| error.to_string())
}

/// A file continues the record; what lies within it would count twice.
#[test]
fn a_file_of_events_continues_the_record() {
    let read = |start: &str, end: &str| with_events(&event_file("cm-2", &format!("{start},{end},G18,5e9,2e7")));
    let mission = read("2025-11-11T10:25:00", "2025-11-14").unwrap();
    let from_yr = decimal_year("2025-11-10".parse().unwrap()) - 2025.0;
    assert!(solar(&mission, from_yr, from_yr + 0.03) > 1e5);
    let error = read("2025-06-01", "2025-06-04").unwrap_err();
    assert!(error.contains("count twice"), "{error}");
    let error = read("2026-02-27", "2026-03-04").unwrap_err();
    assert!(error.contains("line 13") && error.contains("end"), "{error}");
}

/// Units of fluence are those of the header; dates are days, moments, or moments with a zone. Others are refused by one message.
#[test]
fn events_have_the_units_of_their_header() {
    let dose = |text: &str| {
        let mission = with_events(text).unwrap();
        let from_yr = decimal_year("2025-11-10".parse().unwrap()) - 2025.0;
        solar(&mission, from_yr, from_yr + 0.03)
    };
    let known = dose(&event_file("cm-2", "2025-11-11,2025-11-14,G18,5e9,2e7"));
    for (unit, row) in [
        ("m-2", "2025-11-11,2025-11-14,G18,5e13,2e11"),
        ("1 / cm2", "2025-11-11,2025-11-14,G18,5e9,2e7"),
        ("mm-2", "2025-11-11,2025-11-14,G18,5e7,2e5"),
        ("cm-2", "2025-11-11T00:00:00,2025-11-14T00:00,G18,5e9,2e7"),
        ("cm-2", "2025-11-11T00:00:00Z,2025-11-14T00:00:00Z,G18,5e9,2e7"),
    ] {
        let found = dose(&event_file(unit, row));
        assert!((found / known - 1.0).abs() < 1e-6, "{unit} {row}: {found:e} {known:e}");
    }
    for (unit, row, said) in [
        ("MeV", "2025-11-11,2025-11-14,G18,5e9,2e7", "above_10_mev_cm2"),
        ("cm-2 s-1", "2025-11-11,2025-11-14,G18,5e9,2e7", "above_10_mev_cm2"),
        ("cm-2", "2025-11-11,2025-11-14,G18,-5e9,2e7", "negative"),
        ("cm-2", "2025-11-11,2025-11-14,G18,many,2e7", "above_10_mev_cm2"),
        ("cm-2", "11th of November,2025-11-14,G18,5e9,2e7", "start"),
        ("cm-2", "2025-11-14,2025-11-11,G18,5e9,2e7", "not after the start"),
        ("cm-2", "2025-11-11,2025-11-14,G18,,2e7", "two energies"),
    ] {
        let error = with_events(&event_file(unit, row)).unwrap_err();
        assert!(error.contains(said) && error.contains("events.ecsv"), "{unit} {row}: {error}");
        assert_eq!(error.matches("events.ecsv").count(), 1, "{error}");
    }
}

/// The template of the page.
#[test]
fn the_file_of_events_that_the_page_shows_is_read() {
    let page = include_str!("../../docs/orbit.md");
    let start = page.find("# %ECSV 1.0").unwrap();
    let shown = &page[start..start + page[start..].find("```").unwrap()];
    let mission = with_events(shown).unwrap();
    assert_eq!(mission.observed_sun().unwrap().record().to.to_string(), "2025-12-31 00:00:00");
    assert!(mission.observed_sun().unwrap().record().events.last().unwrap().satellite == "G18");
}
