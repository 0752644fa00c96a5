//! `ctiplan study distance`.

use super::table::{column, words};
use super::{DataTable, Digits, Shown, StudyReport, budget, when};
use crate::mission::Mission;
use crate::report::plot::{Figure, Panel, line};
use crate::study::distance::{Place, Results};

impl Shown for Results {
    fn shown(&self, mission: &Mission) -> StudyReport {
        let title = format!(
            "distance to the register against shape error of \"{}\" at the end of the mission",
            mission.requirement.galaxy
        );
        let mut report = StudyReport::of("distance", mission, title, &self.warnings);
        report.of_galaxy_alone(mission);
        report.cite("Distance to the register, and dithers", "Rhodes et al. 2010 (PASP 122, 439), sections 5.1 and 6");
        report.tables = vec![places(self), distances(self)];
        report.draw(figure(self, mission));
        report.result("farthest_delta_e", self.farthest().delta_e);
        report.result("mean_delta_e", self.mean().delta_e);
        match self.farthest().delta_e {
            None => report.find("The farthest galaxy has no shape left at the end of the mission."),
            Some(0.0) => report.find("Nothing changes at any distance: the mission has no traps at its end."),
            Some(_) => compare(&mut report, self),
        }
        report
    }
}

fn places(results: &Results) -> DataTable {
    let columns = vec![
        words("place", "galaxies"),
        column("mean_transfers", "mean transfers", Digits::Fixed(1)),
        column("delta_e", "|Δe|", Digits::Scientific(3)),
        column("over_farthest", "of farthest", Digits::Fixed(3)),
        words("exceeded_date", "exceeded"),
        words("corrected_date", "corrected"),
    ];
    DataTable::of("places", &results.places, columns)
}

fn distances(results: &Results) -> DataTable {
    let columns =
        vec![column("transfers", "transfers", Digits::Fixed(0)), column("delta_e", "|Δe|", Digits::Scientific(3))];
    DataTable::of("distances", &results.curve, columns).titled("Against distance")
}

fn figure(results: &Results, mission: &Mission) -> Figure {
    let x: Vec<f64> = results.curve.iter().map(|point| point.transfers).collect();
    let y = results.curve.iter().map(|point| point.delta_e.unwrap_or(f64::NAN)).collect();
    let mut series = vec![line("at a distance", 1, &x, y)];
    series.extend(budget(mission));
    for (index, place) in results.places.iter().enumerate().skip(1) {
        let ends = [x[0], x[x.len() - 1]];
        series.push(line(&place.name, index + 1, &ends, vec![place.delta_e.unwrap_or(f64::NAN); 2]));
    }
    let panel = Panel {
        x_label: "transfers to the register".into(),
        y_label: "|Δe| at the end".into(),
        series,
        ..Panel::default()
    };
    Figure { title: format!("{}: distance to the register", mission.mission.name), panels: vec![panel] }
}

fn compare(report: &mut StudyReport, results: &Results) {
    let (farthest, mean) = (results.farthest(), results.mean());
    if let Some(over) = mean.over_farthest {
        report.find(format!(
            "The mean error over the detector is {over:.3} of the farthest galaxy's. An error proportional to the distance would \
             give 0.5. Uncorrected budget: {} by the farthest, {} by the mean.",
            when(farthest.exceeded_date),
            when(mean.exceeded_date)
        ));
    }
    let left = |place: &Place| place.over_farthest.unwrap_or(f64::INFINITY);
    for dither in results.dithers() {
        report.find(format!(
            "Dither \"{}\" reduces the worst-case error by {:.0} %, to {:.3} of the farthest galaxy's. Uncorrected budget: {}.",
            dither.name,
            100.0 * (1.0 - left(dither)),
            left(dither),
            when(dither.exceeded_date)
        ));
    }
    if let Some(best) = results.dithers().iter().min_by(|a, b| left(a).total_cmp(&left(b))) {
        report.result("best_dither", best.name.clone());
        report.result("best_dither_over_farthest", left(best));
        report.find(
            "No dither removes the mean over the detector. A pattern that moves every galaxy over the whole register gives all \
             galaxies that mean.",
        );
    }
}
