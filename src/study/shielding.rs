//! Aluminium → margin, as sphere and as slab, at each confidence.
//!
//! ```text
//! margin = 1 − |Δe|(end)/(budget × correction factor)
//! ```
//!
//! with the dose derived from the ESP fluence at each confidence (`environment/esp.rs`) behind each thickness
//! (`environment/shielding.rs`: no secondaries, no trapped protons), whatever dose rate the mission gives.

use std::collections::BTreeMap;

use clap::Args;
use rayon::prelude::*;

use super::{Cell, Digits, Kind, Study, Table};
use super::{column, level, line, numbers, ready};
use crate::environment::shielding::Geometry;
use crate::error::InputError;
use crate::mission::{Material, Mission, Orbit, Shielding as Shield};
use crate::plan::sources;
use crate::plan::timeline::Timeline;
use crate::report::plot::{Figure, Panel};

/// Options of the study.
#[derive(Clone, Debug, Args)]
pub struct Shielding {
    /// Thicknesses of aluminium, mm
    #[arg(long, value_name = "MM", default_value = "5,10,15,20,30,40,60,80")]
    pub thickness_mm: String,
    /// Probabilities that the solar proton fluence is not exceeded
    #[arg(long, value_name = "SHARES", default_value = "0.5,0.75,0.9,0.95,0.99")]
    pub confidence: String,
}

const GEOMETRIES: [Geometry; 2] = [Geometry::Sphere, Geometry::Slab];

/// One shield at one confidence.
struct Tried {
    geometry: Geometry,
    thickness_mm: f64,
    confidence: f64,
    dose_mev_g: f64,
    timeline: Timeline,
}

impl Kind for Shielding {
    fn study(&self, mission: &Mission, advance: &(dyn Fn() + Sync)) -> Result<Study, InputError> {
        let mut thicknesses = numbers("shielding.thickness_mm", &self.thickness_mm)?;
        thicknesses.sort_by(f64::total_cmp);
        let confidences = numbers("environment.confidence", &self.confidence)?;
        let requirement = &mission.requirement;
        let mut study = Study::of(
            "shielding",
            mission,
            format!(
                "aluminium against margin: what is left of the corrected budget ({}) of \"{}\" at the end of the mission",
                crate::mission::keys::plain(requirement.delta_e * requirement.correction_factor),
                requirement.galaxy
            ),
        );
        study.sources = sources::of_dose(mission);
        if mission.mission.orbit == Orbit::Leo {
            study.tables = vec![margins(&[], &confidences, 1.0)];
            study.find(
                "A low Earth orbit is dosed by trapped protons, for which there is no model here: no dose can be derived from \
                 shielding. --set mission.orbit=l2 would show the same detector outside the magnetosphere.",
            );
            return Ok(study);
        }
        let model = ready(mission)?;
        let mut cases = Vec::new();
        for geometry in GEOMETRIES {
            for &thickness_mm in &thicknesses {
                cases.extend(confidences.iter().map(|confidence| (geometry, thickness_mm, *confidence)));
            }
        }
        let tried: Vec<Result<Tried, InputError>> = cases
            .into_par_iter()
            .map(|(geometry, thickness_mm, confidence)| {
                let mut mission = model.mission.clone();
                mission.shielding = Some(Shield { geometry, material: Material::Aluminium, thickness_mm });
                mission.environment.active_dose_rate_mev_g_yr = None;
                mission.environment.confidence = confidence;
                let model = model.like(&mission);
                advance();
                let dose_mev_g = model.dose_mev_g(mission.mission.duration_yr)?;
                Ok(Tried { geometry, thickness_mm, confidence, dose_mev_g, timeline: Timeline::of(&model)? })
            })
            .collect();
        let tried = tried.into_iter().collect::<Result<Vec<Tried>, _>>()?;
        let limit = requirement.delta_e * requirement.correction_factor;
        let needed = needed(&tried, &confidences, limit);
        study.tables =
            vec![margins(&tried, &confidences, limit), needed_table(&needed, &confidences), details(&tried, mission)];
        study.figures = vec![("shielding.svg".into(), figure(mission, &tried, &confidences, limit))];
        conclude(&mut study, mission, &thicknesses, &needed);
        Ok(study)
    }
}

fn percent(confidence: f64) -> String {
    format!("{}", (100.0 * confidence * 1e6).round() / 1e6)
}

/// None where no shape is left.
fn margin(tried: &Tried, limit: f64) -> Option<f64> {
    tried.timeline.end().map(|end| 1.0 - end / limit)
}

fn margins(tried: &[Tried], confidences: &[f64], limit: f64) -> Table {
    let mut columns =
        vec![column("geometry", "shield", Digits::Fixed(0)), column("thickness_mm", "Al [mm]", Digits::Significant(4))];
    columns.extend(confidences.iter().map(|confidence| {
        let percent = percent(*confidence);
        column(format!("margin_percent_at_{percent}"), format!("at {percent} %"), Digits::Fixed(1))
    }));
    let rows = tried.chunks(confidences.len()).map(|chunk| {
        let mut row: Vec<Cell> = vec![chunk[0].geometry.to_string().into(), chunk[0].thickness_mm.into()];
        row.extend(chunk.iter().map(|tried| match margin(tried, limit) {
            Some(margin) => Cell::from(100.0 * margin),
            None => "lost".into(),
        }));
        row
    });
    Table {
        name: "margins",
        title: "Margin in % of the budget".into(),
        columns,
        rows: rows.collect(),
        ..Table::default()
    }
}

/// Least thickness (mm) without a negative margin, by geometry and confidence, on straight lines of the margin in the logarithm
/// of the thickness; infinite where none that was tried is enough.
fn needed(tried: &[Tried], confidences: &[f64], limit: f64) -> BTreeMap<(usize, usize), f64> {
    let mut needed = BTreeMap::new();
    for (place, geometry) in GEOMETRIES.iter().enumerate() {
        for (index, confidence) in confidences.iter().enumerate() {
            let curve: Vec<(f64, f64)> = tried
                .iter()
                .filter(|tried| tried.geometry == *geometry && tried.confidence == *confidence)
                .map(|tried| (tried.thickness_mm, margin(tried, limit).unwrap_or(f64::NEG_INFINITY)))
                .collect();
            let least = match curve.iter().position(|(_, margin)| *margin >= 0.0) {
                None => f64::INFINITY,
                Some(0) => curve[0].0,
                Some(after) => {
                    let ((from, below), (to, above)) = (curve[after - 1], curve[after]);
                    if below.is_finite() { from * (to / from).powf(below / (below - above)) } else { to }
                }
            };
            needed.insert((place, index), least);
        }
    }
    needed
}

fn needed_table(needed: &BTreeMap<(usize, usize), f64>, confidences: &[f64]) -> Table {
    let columns = vec![
        column("confidence_percent", "confidence [%]", Digits::Significant(6)),
        column("sphere_mm", "sphere [mm Al]", Digits::Fixed(1)),
        column("slab_mm", "slab [mm Al]", Digits::Fixed(1)),
    ];
    let row = |(index, confidence): (usize, &f64)| {
        vec![(100.0 * confidence).into(), needed[&(0, index)].into(), needed[&(1, index)].into()]
    };
    Table {
        name: "needed",
        title: "Least thickness that was tried, or lies between two, with which the corrected budget lasts".into(),
        columns,
        rows: confidences.iter().enumerate().map(row).collect(),
        ..Table::default()
    }
}

/// Every case, for programs and for those who plot themselves.
fn details(tried: &[Tried], mission: &Mission) -> Table {
    let requirement = &mission.requirement;
    let columns = vec![
        column("geometry", "shield", Digits::Fixed(0)),
        column("thickness_mm", "Al [mm]", Digits::Significant(4)),
        column("confidence", "confidence", Digits::Significant(6)),
        column("dose_mev_g", "dose [MeV/g]", Digits::Scientific(2)),
        column("delta_e", "|delta e|", Digits::Scientific(3)),
        column("exceeded_date", "exceeded", Digits::Fixed(0)),
        column("corrected_date", "corrected", Digits::Fixed(0)),
    ];
    let rows = tried.iter().map(|tried| {
        let day = |limit: f64| tried.timeline.date(limit).map_or(Cell::None, |date| date.to_string().into());
        vec![
            tried.geometry.to_string().into(),
            tried.thickness_mm.into(),
            tried.confidence.into(),
            tried.dose_mev_g.into(),
            tried.timeline.end().into(),
            day(requirement.delta_e),
            day(requirement.delta_e * requirement.correction_factor),
        ]
    });
    Table { name: "cases", title: "Every case".into(), columns, rows: rows.collect(), programs_only: true }
}

fn figure(mission: &Mission, tried: &[Tried], confidences: &[f64], limit: f64) -> Figure {
    let panel = |geometry: &Geometry| {
        let series = confidences.iter().enumerate().map(|(index, confidence)| {
            let curve: Vec<&Tried> =
                tried.iter().filter(|tried| tried.geometry == *geometry && tried.confidence == *confidence).collect();
            let x: Vec<f64> = curve.iter().map(|tried| tried.thickness_mm).collect();
            let y = curve.iter().map(|tried| tried.timeline.end().unwrap_or(f64::NAN)).collect();
            line(&format!("{} %", percent(*confidence)), index + 1, &x, y)
        });
        let mut series: Vec<_> = series.collect();
        series.push(level("corrected budget", limit));
        Panel {
            x_label: "aluminium [mm]".into(),
            y_label: format!("|delta e|, {geometry}"),
            x_log: true,
            y_log: true,
            series,
            ..Panel::default()
        }
    };
    Figure { title: format!("{}: shielding", mission.mission.name), panels: GEOMETRIES.iter().map(panel).collect() }
}

fn conclude(study: &mut Study, mission: &Mission, thicknesses: &[f64], needed: &BTreeMap<(usize, usize), f64>) {
    let (thinnest, thickest) = (thicknesses[0], thicknesses[thicknesses.len() - 1]);
    let confidence_rows = needed.len() / GEOMETRIES.len();
    for (place, geometry) in GEOMETRIES.iter().enumerate() {
        let range: Vec<f64> = (0..confidence_rows).map(|index| needed[&(place, index)]).collect();
        let said = |thickness_mm: f64| {
            if thickness_mm.is_infinite() {
                format!("more than {thickest} mm")
            } else if thickness_mm <= thinnest {
                format!("{thinnest} mm, the least that was tried, or less")
            } else {
                format!("{thickness_mm:.1} mm")
            }
        };
        let least = range.iter().copied().fold(f64::INFINITY, f64::min);
        let most = range.iter().copied().fold(0.0, f64::max);
        study.find(if least == most {
            format!("As a {geometry}, every confidence that was asked for needs {}.", said(most))
        } else {
            format!("As a {geometry}, the corrected budget needs {} at the lowest confidence that was asked for, and {} at the \
                     highest.", said(least), said(most))
        });
    }
    if mission.environment.active_dose_rate_mev_g_yr.is_some() {
        study.find("The mission gives its dose rate; here doses are derived from the shield instead.");
    }
}
