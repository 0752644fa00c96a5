//! Aluminium → margin, as sphere and as slab, at each confidence.
//!
//! ```text
//! margin = 1 − |Δe|(end)/(budget × correction factor)
//! ```
//!
//! or that of a shear bias of the population if it is smaller. The dose is derived from the ESP fluence at each confidence
//! (`environment/esp.rs`) behind each thickness (`environment/shielding.rs`), plus the other sources in the mission's model,
//! regardless of the dose rate stated by the mission.

use serde::Serialize;

use super::{Study, check, ready, warnings};
use crate::environment::shielding::Geometry;
use crate::error::InputError;
use crate::mission::{DoseModel, Mission, Shielding as Shield};
use crate::model::Model;
use crate::numeric::parallel;
use crate::numeric::root_finding;
use crate::plan::curve::Curve;
use crate::plan::date_distribution::Confidence;
use crate::plan::judgement::{JudgedRow, Judgement};
use crate::plan::scenario::{Merit, Ranking};
use crate::warning::{Warning, together};

/// Shields that are compared.
pub const GEOMETRIES: [Geometry; 2] = [Geometry::Sphere, Geometry::Slab];

/// Options of the study.
#[derive(Clone, Debug)]
pub struct Shielding {
    /// Thicknesses of aluminium, mm.
    pub thicknesses_mm: Vec<f64>,
    /// Probabilities that the solar proton fluence is not exceeded.
    pub confidences: Vec<f64>,
    /// The probability with which budgets are to be met, with the Sun and `[uncertainty]` drawn behind each shield.
    pub probability: Option<Confidence>,
}

impl Default for Shielding {
    fn default() -> Shielding {
        Shielding {
            thicknesses_mm: vec![5.0, 10.0, 15.0, 20.0, 30.0, 40.0, 60.0, 80.0],
            confidences: vec![0.5, 0.75, 0.9, 0.95, 0.99],
            probability: None,
        }
    }
}

/// The results of the study.
#[derive(Clone, Debug)]
pub struct Results {
    /// Thicknesses of aluminium, mm, ascending.
    pub thicknesses_mm: Vec<f64>,
    /// Probabilities that the solar proton fluence is not exceeded.
    pub confidences: Vec<f64>,
    /// Each geometry, thickness and confidence, the last varying fastest; empty in a low Earth orbit of unknown elements.
    pub cases: Vec<Case>,
    /// Thickness needed at each confidence; empty without cases.
    pub needed: Vec<Needed>,
    /// Each geometry and thickness with the Sun and `[uncertainty]` drawn; empty if no probability was requested.
    pub drawn: Vec<Drawn>,
    /// Shields, ranked by how long they meet the budgets with that probability.
    pub ranking: Option<Ranking>,
    /// The requested probability.
    pub probability: Option<f64>,
    /// Warnings about the mission.
    pub warnings: Vec<Warning>,
}

/// One shield at one confidence.
#[derive(Clone, Debug, Serialize)]
pub struct Case {
    /// Sphere or slab.
    pub geometry: Geometry,
    /// Thickness, mm of aluminium.
    pub thickness_mm: f64,
    /// Probability that the fluence is not exceeded.
    pub confidence: f64,
    /// Displacement dose at the end of the mission, MeV/g.
    pub dose_mev_g: f64,
    /// |Δe| at the end of the mission; None if no shape is left, here and below.
    pub delta_e: Option<f64>,
    /// Judgement of the budgets.
    #[serde(flatten)]
    pub judged: JudgedRow,
    /// Margin of the corrected budget at the end of the mission, the smallest of all budgets.
    #[serde(skip)]
    pub margin: Option<f64>,
    /// Warnings about its dose.
    #[serde(skip)]
    pub warnings: Vec<Warning>,
}

/// One shield with the Sun and `[uncertainty]` drawn.
#[derive(Clone, Debug, Serialize)]
pub struct Drawn {
    /// Sphere or slab.
    pub geometry: Geometry,
    /// Thickness, mm of aluminium.
    pub thickness_mm: f64,
    /// Judgement of the budgets.
    #[serde(flatten)]
    pub judged: JudgedRow,
    /// Its ranking key.
    #[serde(skip)]
    merit: Merit,
}

/// Smallest thickness with which the corrected budget is met, mm of aluminium; infinite if no thickness tried is enough.
#[derive(Clone, Debug, Serialize)]
pub struct Needed {
    /// Probability that the fluence is not exceeded, %.
    pub confidence_percent: f64,
    /// As a sphere.
    pub sphere_mm: f64,
    /// As a slab.
    pub slab_mm: f64,
}

impl Needed {
    /// The thickness (mm) of a geometry.
    pub fn thickness_mm(&self, geometry: Geometry) -> f64 {
        match geometry {
            Geometry::Sphere => self.sphere_mm,
            Geometry::Slab => self.slab_mm,
        }
    }
}

impl Study for Shielding {
    type Results = Results;

    fn study(&self, mission: &Mission, advance: &(dyn Fn() + Sync)) -> Result<Results, InputError> {
        check("shielding.thickness_mm", &self.thicknesses_mm)?;
        check("environment.confidence", &self.confidences)?;
        let mut thicknesses_mm = self.thicknesses_mm.clone();
        thicknesses_mm.sort_by(f64::total_cmp);
        let confidences = self.confidences.clone();
        let environment = &mission.environment;
        if environment.model == DoseModel::History || environment.spectra.is_some() || environment.dose_depth.is_some()
        {
            let problem = "the dose is imported: it says nothing of other shields and confidences";
            return Err(InputError::new("cannot compare shields", problem)
                .with_help("take environment.model = \"derived\" without history, spectra and dose_depth"));
        }
        let warnings = warnings(mission);
        if mission.place().is_none() {
            let probability = self.probability.map(|required| required.probability);
            let (cases, needed, drawn) = (Vec::new(), Vec::new(), Vec::new());
            return Ok(Results {
                thicknesses_mm,
                confidences,
                cases,
                needed,
                drawn,
                ranking: None,
                probability,
                warnings,
            });
        }
        let model = ready(mission)?;
        let mut shields = Vec::new();
        for geometry in GEOMETRIES {
            for &thickness_mm in &thicknesses_mm {
                shields.extend(confidences.iter().map(|confidence| (geometry, thickness_mm, *confidence)));
            }
        }
        let cases = parallel::try_map(&shields, |&(geometry, thickness_mm, confidence)| {
            advance();
            Case::of(&model, geometry, thickness_mm, confidence)
        })?;
        let needed = confidences.iter().map(|confidence| Needed {
            confidence_percent: 100.0 * confidence,
            sphere_mm: needed_mm(&model, &cases, Geometry::Sphere, *confidence),
            slab_mm: needed_mm(&model, &cases, Geometry::Slab, *confidence),
        });
        let needed = needed.collect();
        let warnings = warnings.into_iter().chain(thick_shields(&cases)).collect();
        let drawn = self.drawn(&model, &thicknesses_mm, advance)?;
        let merits: Vec<Merit> = drawn.iter().map(|drawn| drawn.merit).collect();
        Ok(Results {
            needed,
            thicknesses_mm,
            confidences,
            cases,
            ranking: (!merits.is_empty()).then(|| Ranking::of(&merits)),
            drawn,
            probability: self.probability.map(|required| required.probability),
            warnings,
        })
    }
}

impl Shielding {
    /// Each geometry and thickness with the Sun and `[uncertainty]` drawn; empty if no probability is requested.
    fn drawn(
        &self,
        model: &Model,
        thicknesses_mm: &[f64],
        advance: &(dyn Fn() + Sync),
    ) -> Result<Vec<Drawn>, InputError> {
        let Some(required) = self.probability else { return Ok(Vec::new()) };
        let mut shields = Vec::new();
        for geometry in GEOMETRIES {
            shields.extend(thicknesses_mm.iter().map(|thickness_mm| (geometry, *thickness_mm)));
        }
        parallel::try_map(&shields, |&(geometry, thickness_mm)| {
            advance();
            let mission = behind(&model.mission, geometry, thickness_mm, model.mission.environment.confidence);
            let model = model.like(&mission);
            let curve = Curve::of(&model)?;
            let judgement = Judgement::along(&model, &curve, Some(required))?;
            Ok(Drawn {
                geometry,
                thickness_mm,
                judged: JudgedRow::of(&judgement, mission.mission.launch.0, Some(required.probability)),
                merit: Merit::of(&judgement, Some(required.probability), curve.end()),
            })
        })
    }
}

impl Case {
    fn of(model: &Model, geometry: Geometry, thickness_mm: f64, confidence: f64) -> Result<Case, InputError> {
        let mission = behind(&model.mission, geometry, thickness_mm, confidence);
        let model = model.like(&mission);
        let curve = Curve::of(&model)?;
        let judgement = Judgement::along(&model, &curve, None)?;
        Ok(Case {
            geometry,
            thickness_mm,
            confidence,
            dose_mev_g: model.dose_mev_g(mission.mission.duration_yr)?,
            delta_e: curve.end(),
            judged: JudgedRow::of(&judgement, mission.mission.launch.0, None),
            margin: judgement.used().map(|used| 1.0 - used / mission.requirement.correction_factor),
            warnings: model.history().warnings(mission.mission.duration_yr),
        })
    }
}

/// Smallest thickness (mm) without a negative margin; infinite if no thickness tried is enough.
///
/// Between two thicknesses the used share of the budget is nearly a power law in the dose; the dose against thickness is computed.
fn needed_mm(model: &Model, cases: &[Case], geometry: Geometry, confidence: f64) -> f64 {
    let used = |case: &Case| case.margin.map(|margin| 1.0 - margin);
    let curve: Vec<&Case> =
        cases.iter().filter(|case| case.geometry == geometry && case.confidence == confidence).collect();
    let enough = |case: &&Case| used(case).is_some_and(|used| used <= 1.0);
    match curve.iter().position(enough) {
        None => f64::INFINITY,
        Some(0) => curve[0].thickness_mm,
        Some(after) => {
            let (thin, thick) = (curve[after - 1], curve[after]);
            let (Some(more), Some(less)) = (used(thin), used(thick)) else { return thick.thickness_mm };
            let place = (1.0 / less).ln() / (more / less).ln();
            let wanted = thick.dose_mev_g * (thin.dose_mev_g / thick.dose_mev_g).powf(place);
            let excess = |log_mm: f64| {
                let behind = behind(&model.mission, geometry, log_mm.exp(), confidence);
                let dose = model.like(&behind).dose_mev_g(behind.mission.duration_yr);
                dose.map_or(0.0, |dose| (dose / wanted).ln())
            };
            root_finding::between(thin.thickness_mm.ln(), thick.thickness_mm.ln(), 1e-4, excess).exp()
        }
    }
}

/// The warning about the thickest shields: nuclear reactions that the dose does not include.
fn thick_shields(cases: &[Case]) -> Option<Warning> {
    let all = cases.iter().flat_map(|case| &case.warnings);
    together(all.filter(|warning| warning.neutrons().is_some())).pop()
}

/// The mission behind aluminium, with its dose derived at a confidence.
fn behind(mission: &Mission, geometry: Geometry, thickness_mm: f64, confidence: f64) -> Mission {
    let mut behind = mission.clone();
    behind.shielding = Some(Shield::aluminium(geometry, thickness_mm));
    behind.environment.active_dose_rate_mev_g_yr = None;
    behind.environment.confidence = confidence;
    behind
}
