//! Distance to the register → shape error of the farthest galaxy, of the mean over the detector, and of dithered exposures.
//!
//! The effect is nearly proportional to the distance: the mean over the detector is half of the farthest. Exposures that see a
//! galaxy at several distances average its Δe:
//!
//! ```text
//! Δe(detector) = 1/T ∫₀ᵀ Δe(n) dn        Δe(pattern) = mean of Δe(n_k) over the exposures k
//! ```
//!
//! Rhodes et al. 2010, section 5.1 (distance) and 6.

use std::num::NonZeroUsize;

use clap::Args;
use gauss_quad::GaussLegendre;
use rayon::prelude::*;

use super::{Cell, Digits, Kind, Study, Table};
use super::{column, level, line, numbers, ready, when};
use crate::error::InputError;
use crate::mission::Mission;
use crate::plan::timeline::Timeline;
use crate::report::plot::{Figure, Panel};

/// Nodes of the mean over the detector.
const NODES: NonZeroUsize = NonZeroUsize::new(6).expect("above 0");

/// Distances of the curve.
const CURVE: u32 = 8;

/// Options of the study.
#[derive(Clone, Debug, Args)]
pub struct Distance {
    /// A dither pattern: the distance to the register in each exposure, in transfers, such as 1650,1240,830,410; may be given
    /// several times [default: small steps, half a register, the whole register]
    #[arg(long, value_name = "TRANSFERS")]
    pub dither: Vec<String>,
}

/// Distances with their weights.
struct Place {
    name: String,
    distances: Vec<(f64, f64)>,
}

impl Kind for Distance {
    fn study(&self, mission: &Mission, advance: &(dyn Fn() + Sync)) -> Result<Study, InputError> {
        let model = ready(mission)?;
        let farthest = f64::from(mission.readout.transfers);
        let mut places =
            vec![Place { name: "farthest".into(), distances: vec![(farthest, 1.0)] }, over_detector(farthest)];
        places.extend(self.patterns(farthest)?);
        let timeline = |transfers: f64| Timeline::under(&model, |at| at.transfers = transfers.round() as u32);
        let of = |place: &Place| {
            let timelines: Vec<_> = place.distances.par_iter().map(|(transfers, _)| timeline(*transfers)).collect();
            let timelines = timelines.into_iter().collect::<Result<Vec<Timeline>, _>>()?;
            let weights: Vec<f64> = place.distances.iter().map(|(_, weight)| *weight).collect();
            advance();
            Ok(Timeline::weighted(&timelines, &weights))
        };
        let found: Vec<Timeline> = places.iter().map(of).collect::<Result<_, InputError>>()?;
        let curve: Vec<Result<(f64, Option<f64>), InputError>> = (1..=CURVE)
            .into_par_iter()
            .map(|step| {
                let transfers = (farthest * f64::from(step) / f64::from(CURVE)).round().max(1.0);
                let mut at = model.conditions(mission.mission.duration_yr);
                at.transfers = transfers as u32;
                advance();
                Ok((transfers, model.change_by(0, &model.device(&at)?)?.map(|change| change.magnitude())))
            })
            .collect();
        let curve = curve.into_iter().collect::<Result<Vec<_>, _>>()?;
        Ok(report(mission, &places, &found, &curve))
    }
}

impl Distance {
    fn patterns(&self, farthest: f64) -> Result<Vec<Place>, InputError> {
        let pattern = |name: String, distances: Vec<f64>| {
            let weight = 1.0 / distances.len() as f64;
            Place { name, distances: distances.into_iter().map(|transfers| (transfers, weight)).collect() }
        };
        if self.dither.is_empty() {
            let share = |name: &str, shares: &[f64]| {
                pattern(name.into(), shares.iter().map(|share| (share * farthest).round().max(1.0)).collect())
            };
            return Ok(vec![
                share("steps of 1 %", &[1.0, 0.99, 0.98, 0.97]),
                share("half a register", &[1.0, 0.5]),
                share("whole register", &[1.0, 0.75, 0.5, 0.25]),
            ]);
        }
        let read = |text: &String| Ok(pattern(text.clone(), numbers("readout.transfers", text)?));
        self.dither.iter().map(read).collect()
    }
}

/// Galaxies evenly spread over the detector.
fn over_detector(farthest: f64) -> Place {
    let rule = GaussLegendre::new(NODES);
    let node = |(place, weight): (&f64, &f64)| (0.5 * farthest * (1.0 + place), 0.5 * weight);
    let distances = rule.iter().map(|pair| node((&pair.0, &pair.1))).collect();
    Place { name: "detector mean".into(), distances }
}

fn report(mission: &Mission, places: &[Place], found: &[Timeline], curve: &[(f64, Option<f64>)]) -> Study {
    let requirement = &mission.requirement;
    let (limit, corrected) = (requirement.delta_e, requirement.delta_e * requirement.correction_factor);
    let mut study = Study::of(
        "distance",
        mission,
        format!("distance to the register against shape error of \"{}\" at the end of the mission", requirement.galaxy),
    );
    study.cite("Distance to the register, and dithers", "Rhodes et al. 2010 (PASP 122, 439), sections 5.1 and 6");
    let farthest = found[0].end();
    let over =
        |end: Option<f64>| end.zip(farthest).and_then(|(end, farthest)| (farthest > 0.0).then(|| end / farthest));
    let rows = places.iter().zip(found).map(|(place, timeline)| {
        let mean: f64 = place.distances.iter().map(|(transfers, weight)| transfers * weight).sum();
        vec![
            place.name.clone().into(),
            mean.into(),
            timeline.end().into(),
            over(timeline.end()).into(),
            timeline.date(limit).map_or(Cell::None, |date| date.to_string().into()),
            timeline.date(corrected).map_or(Cell::None, |date| date.to_string().into()),
        ]
    });
    study.tables = vec![
        Table {
            name: "places",
            title: String::new(),
            columns: vec![
                column("place", "galaxies", Digits::Fixed(0)),
                column("mean_transfers", "mean transfers", Digits::Fixed(1)),
                column("delta_e", "|delta e|", Digits::Scientific(3)),
                column("over_farthest", "of farthest", Digits::Fixed(3)),
                column("exceeded_date", "exceeded", Digits::Fixed(0)),
                column("corrected_date", "corrected", Digits::Fixed(0)),
            ],
            rows: rows.collect(),
            ..Table::default()
        },
        Table {
            name: "distances",
            title: "Against distance".into(),
            columns: vec![
                column("transfers", "transfers", Digits::Fixed(0)),
                column("delta_e", "|delta e|", Digits::Scientific(3)),
            ],
            rows: curve.iter().map(|(transfers, delta_e)| vec![(*transfers).into(), (*delta_e).into()]).collect(),
            ..Table::default()
        },
    ];
    let x: Vec<f64> = curve.iter().map(|(transfers, _)| *transfers).collect();
    let y = curve.iter().map(|(_, delta_e)| delta_e.unwrap_or(f64::NAN)).collect();
    let mut series = vec![line("at a distance", 1, &x, y), level("budget", limit)];
    for (index, (place, timeline)) in places.iter().zip(found).enumerate().skip(1) {
        let ends = [x[0], x[x.len() - 1]];
        series.push(line(&place.name, index + 1, &ends, vec![timeline.end().unwrap_or(f64::NAN); 2]));
    }
    let panel = Panel {
        x_label: "transfers to the register".into(),
        y_label: "|delta e| at the end".into(),
        series,
        ..Panel::default()
    };
    study.figures = vec![(
        "distance.svg".into(),
        Figure { title: format!("{}: distance to the register", mission.mission.name), panels: vec![panel] },
    )];
    study.result("farthest_delta_e", farthest);
    study.result("mean_delta_e", found[1].end());
    let Some(farthest) = farthest else {
        study.find("The farthest galaxy has no shape left at the end of the mission.");
        return study;
    };
    if farthest == 0.0 {
        study.find("Nothing changes at any distance: the mission has no traps at its end.");
        return study;
    }
    let date = |index: usize| when(found[index].date(limit));
    if let Some(mean) = over(found[1].end()) {
        study.find(format!(
            "Galaxies evenly spread over the detector have {mean:.3} of the farthest's error in the mean; proportional to the \
             distance it would be 0.5. Uncorrected, the budget is exceeded: by the farthest {}, by the mean {}.",
            date(0),
            date(1)
        ));
    }
    let patterns = 2..places.len();
    let end = |index: usize| over(found[index].end()).unwrap_or(f64::INFINITY);
    for index in patterns.clone() {
        let end = end(index);
        study.find(format!(
            "Dither \"{}\" leaves {end:.3} of the farthest's error: it buys {:.0} %; exceeded: {}.",
            places[index].name,
            100.0 * (1.0 - end),
            date(index)
        ));
    }
    if let Some(best) = patterns.min_by(|a, b| end(*a).total_cmp(&end(*b))) {
        study.result("best_dither", places[best].name.clone());
        study.result("best_dither_over_farthest", end(best));
        study.find(
            "No dither takes the mean over the detector away: patterns that move every galaxy over the whole register \
             only make all galaxies alike, at that mean.",
        );
    }
    study
}
