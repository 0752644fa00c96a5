//! A flash before each exposure → shape error against signal-to-noise ratio.
//!
//! Charge P in every pixel keeps traps full that a faint galaxy would otherwise meet, and adds its shot noise (Rhodes et al.
//! 2010, section 6):
//!
//! ```text
//! S/N = s F/√(s F + π r² (B + P + R²))
//! ```
//!
//! An exposure that has the old S/N again is longer by a factor, and the survey covers so much less; see `signal.rs`.

use clap::Args;
use rayon::prelude::*;

use super::{Cell, Digits, Exposure, Kind, Study, Table};
use super::{column, left_out, level, line, numbers, ready, short, when};
use crate::error::InputError;
use crate::mission::Mission;
use crate::plan::timeline::Timeline;
use crate::report::plot::{Figure, Panel};

/// Options of the study.
#[derive(Clone, Debug, Args)]
pub struct Preflash {
    /// Charges of the flash, e- per pixel; none at all is always among them
    #[arg(long, value_name = "ELECTRONS", default_value = "3,10,30,100,300,1000")]
    pub electrons: String,
}

/// One level of the flash.
struct Tried {
    electrons: f64,
    timeline: Timeline,
    flux_loss: Option<f64>,
    snr: f64,
    /// Area at equal depth over that without a flash.
    area: f64,
}

impl Kind for Preflash {
    fn study(&self, mission: &Mission, advance: &(dyn Fn() + Sync)) -> Result<Study, InputError> {
        let mut electrons = numbers("sky.background_e", &self.electrons)?;
        electrons.push(0.0);
        electrons.sort_by(f64::total_cmp);
        electrons.dedup();
        let model = ready(mission)?;
        let exposure = Exposure::of(mission);
        let tried: Vec<Result<Tried, InputError>> = electrons
            .into_par_iter()
            .map(|electrons| {
                let timeline = Timeline::under(&model, |at| at.background_e += electrons)?;
                let mut at = model.conditions(mission.mission.duration_yr);
                at.background_e += electrons;
                advance();
                Ok(Tried {
                    electrons,
                    timeline,
                    flux_loss: model.change_by(0, &model.device(&at)?)?.map(|change| -change.delta_flux),
                    snr: exposure.snr(electrons),
                    area: exposure.area_equal_depth(electrons, &exposure),
                })
            })
            .collect();
        let tried = tried.into_iter().collect::<Result<Vec<Tried>, _>>()?;
        let mut study = report(mission, &tried, exposure.aperture.radius_px);
        study.findings.extend(left_out(mission));
        Ok(study)
    }
}

fn report(mission: &Mission, tried: &[Tried], radius_px: f64) -> Study {
    let requirement = &mission.requirement;
    let (limit, corrected) = (requirement.delta_e, requirement.delta_e * requirement.correction_factor);
    let mut study = Study::of(
        "preflash",
        mission,
        format!(
            "a flash before each exposure against shape error of \"{}\" at the end of the mission; S/N within {radius_px:.2} px",
            requirement.galaxy
        ),
    );
    study.cite("A flash before each exposure", "Rhodes et al. 2010 (PASP 122, 439), section 6");
    let dark = &tried[0];
    let day = |date: Option<chrono::NaiveDate>| date.map_or(Cell::None, |date| date.to_string().into());
    let rows = tried.iter().map(|tried| {
        vec![
            tried.electrons.into(),
            tried.timeline.end().into(),
            tried.flux_loss.map(|loss| 100.0 * loss).into(),
            tried.snr.into(),
            (100.0 * (1.0 - tried.snr / dark.snr)).into(),
            tried.area.into(),
            day(tried.timeline.date(limit)),
            day(tried.timeline.date(corrected)),
        ]
    });
    study.tables = vec![Table {
        name: "levels",
        title: String::new(),
        columns: vec![
            column("electrons", "flash [e-]", Digits::Significant(4)),
            column("delta_e", "|delta e|", Digits::Scientific(3)),
            column("flux_loss_percent", "flux lost [%]", Digits::Fixed(3)),
            column("snr", "S/N", Digits::Fixed(2)),
            column("snr_loss_percent", "lost [%]", Digits::Fixed(1)),
            column("area_equal_depth", "area", Digits::Fixed(3)),
            column("exceeded_date", "exceeded", Digits::Fixed(0)),
            column("corrected_date", "corrected", Digits::Fixed(0)),
        ],
        rows: rows.collect(),
        ..Table::default()
    }];
    let x: Vec<f64> = tried.iter().map(|tried| tried.electrons).collect();
    let panel = |y_label: &str, series| Panel {
        x_label: "flash [e- per pixel]".into(),
        y_label: y_label.into(),
        series,
        ..Panel::default()
    };
    let ends = tried.iter().map(|tried| tried.timeline.end().unwrap_or(f64::NAN)).collect();
    study.figures = vec![(
        "preflash.svg".into(),
        Figure {
            title: format!("{}: a flash before each exposure", mission.mission.name),
            panels: vec![
                panel("|delta e| at the end", vec![line("shape error", 1, &x, ends), level("budget", limit)]),
                panel("S/N", vec![line("S/N", 2, &x, tried.iter().map(|tried| tried.snr).collect())]),
            ],
        },
    )];
    conclude(&mut study, mission, tried);
    study
}

fn conclude(study: &mut Study, mission: &Mission, tried: &[Tried]) {
    let requirement = &mission.requirement;
    let (dark, least) = (&tried[0], tried.get(1));
    let Some(end) = dark.timeline.end() else {
        study.find("Without a flash no shape is left at the end of the mission.");
        return;
    };
    if end == 0.0 {
        study.find("No flash is needed: the mission has no traps at its end.");
        return;
    }
    if let Some((first, with)) = least.and_then(|first| Some((first, first.timeline.end()?))) {
        let (gain, cost) = (100.0 * (1.0 - with / end), 100.0 * (1.0 - first.snr / dark.snr));
        study.find(format!(
            "The least flash that was tried, {} e-, lowers |delta e| by {gain:.1} % and S/N by {cost:.1} %: {:.1} % of shape \
             error for each % of S/N.",
            short(first.electrons),
            gain / cost
        ));
    }
    for (name, limit) in
        [("uncorrected", requirement.delta_e), ("corrected", requirement.delta_e * requirement.correction_factor)]
    {
        let lasts = |tried: &&Tried| tried.timeline.crossing(limit).t_yr.is_none();
        let key = format!("least_{name}_electrons");
        match tried.iter().find(lasts) {
            Some(level) if level.electrons == 0.0 => {
                study.result(&key, 0.0);
                study.find(format!("The {name} budget lasts without a flash: for it, none is best."));
            }
            Some(level) => {
                study.result(&key, level.electrons);
                study.find(format!(
                    "The {name} budget lasts with {} e- at the least of those tried (without: exceeded on {}): it costs {:.1} % \
                     of S/N, or {:.1} % of the survey's area at equal depth.",
                    short(level.electrons),
                    when(dark.timeline.date(limit)),
                    100.0 * (1.0 - level.snr / dark.snr),
                    100.0 * (1.0 - level.area)
                ));
            }
            None => {
                study.result(&key, serde_json::Value::Null);
                study.find(format!("No flash that was tried makes the {name} budget last to the end of the mission."));
            }
        }
    }
    let risen = tried.windows(2).find(|pair| pair[1].timeline.end() > pair[0].timeline.end());
    if let Some(pair) = risen {
        study.find(format!(
            "More is not always better: |delta e| rises from {} to {} e-.",
            short(pair[0].electrons),
            short(pair[1].electrons)
        ));
    }
}
