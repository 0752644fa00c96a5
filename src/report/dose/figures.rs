//! Dose by year, behind aluminium, and its spectrum.

use crate::physics::RateOrigin;
use crate::plan::dose::{AtEnergy, CalendarYear, SourceSpectrum, Survey};
use crate::report::active::shades;
use crate::report::plot::{Figure, Mark, Panel, Series, dashed, level, line};

/// Space on both sides of the column of a year, as a share of its part within the mission.
const BESIDE: f64 = 0.08;

impl Survey {
    /// Figures with their file names.
    pub(super) fn drawn(&self) -> Vec<(String, Figure)> {
        vec![
            ("years.svg".into(), self.by_year()),
            ("depth.svg".into(), self.by_depth()),
            ("spectrum.svg".into(), self.by_energy()),
        ]
    }

    /// The dose of each calendar year as a column, and that since launch.
    fn by_year(&self) -> Figure {
        let starts = self.years.iter().scan(self.launch, |start, year| {
            *start += year.flown_yr;
            Some(*start - year.flown_yr)
        });
        let column = |(index, (start, year)): (usize, (f64, &CalendarYear))| Series {
            label: (index == 0).then(|| "dose within the year".into()),
            color: 1,
            kind: Mark::Band {
                x: vec![start + BESIDE * year.flown_yr, start + (1.0 - BESIDE) * year.flown_yr],
                low: vec![0.0; 2],
                high: vec![year.dose_mev_g; 2],
            },
        };
        let flown_yr: f64 = self.years.iter().map(|year| year.flown_yr).sum();
        let active = || shades(&self.history, self.launch, self.launch + flown_yr);
        let mut columns = active();
        columns.extend(starts.zip(&self.years).enumerate().map(column));
        let years: Vec<f64> = self.over_time.iter().map(|(t_yr, _)| self.launch + t_yr).collect();
        let mut sum = active();
        sum.push(line(
            "dose since launch",
            1,
            &years,
            self.over_time.iter().map(|(_, dose_mev_g)| *dose_mev_g).collect(),
        ));
        sum.extend(self.large_events().enumerate().map(|(index, event)| Series {
            label: (index == 0).then(|| "observed solar events".into()),
            ..dashed("", 2, &[self.launch + event.t_yr; 2], vec![0.0, self.total_mev_g])
        }));
        let panel = |y_label: &str, series| Panel {
            x_label: "year".into(),
            y_label: y_label.into(),
            series,
            height_share: 1.0,
            ..Panel::default()
        };
        Figure {
            title: "Displacement damage dose year by year".into(),
            panels: vec![panel("dose [MeV/g]", columns), panel("dose since launch [MeV/g]", sum)],
        }
    }

    /// The dose of an active year against thickness.
    fn by_depth(&self) -> Figure {
        let thickness: Vec<f64> = self.depths.iter().map(|at| at.thickness_mm).collect();
        let mut series = vec![
            line("sphere", 1, &thickness, self.depths.iter().map(|at| at.sphere_mev_g).collect()),
            line("slab", 2, &thickness, self.depths.iter().map(|at| at.slab_mev_g).collect()),
        ];
        series.extend(match self.origin() {
            RateOrigin::Given => Some(level("rate of the mission file", self.history.active_rate_mev_g_yr)),
            RateOrigin::Esp { .. } => Some(level("rate of the mission", self.history.active_rate_mev_g_yr)),
            RateOrigin::Sources { .. } => Some(level("dose of the mission", self.total_mev_g)),
            RateOrigin::Spectra | RateOrigin::DoseDepth | RateOrigin::History => None,
        });
        Figure { title: self.depth_title(), panels: vec![logarithmic("thickness [mm Al]", "dose [MeV/g]", series)] }
    }

    /// Protons above an energy, in front of and behind the shield.
    fn by_energy(&self) -> Figure {
        if self.depths_of_mission {
            return self.spectra_by_source();
        }
        let mut spectrum = self.spectrum.clone();
        spectrum.sort_by(|a, b| a.energy_mev.total_cmp(&b.energy_mev));
        let energy: Vec<f64> = spectrum.iter().map(|at| at.energy_mev).collect();
        let above = |fluence: fn(&AtEnergy) -> Option<f64>| {
            spectrum.iter().map(|at| fluence(at).unwrap_or(f64::NAN)).collect::<Vec<f64>>()
        };
        let mut series = vec![
            line("mission", 1, &energy, above(|at| Some(at.integral_cm2.mission))),
            line("one active year", 2, &energy, above(|at| Some(at.integral_cm2.year))),
        ];
        if self.spectrum.iter().any(|at| at.shielded_integral_cm2.year.is_some()) {
            series.push(dashed("mission, shielded", 1, &energy, above(|at| at.shielded_integral_cm2.mission)));
            series.push(dashed("one active year, shielded", 2, &energy, above(|at| at.shielded_integral_cm2.year)));
        }
        Figure {
            title: format!("Solar protons above an energy, at {} % confidence", 100.0 * self.confidence),
            panels: vec![logarithmic("energy [MeV]", "protons above it [1/cm²]", series)],
        }
    }
}

impl Survey {
    /// Protons of each source above an energy, in front of and behind the shield.
    fn spectra_by_source(&self) -> Figure {
        let mut series = Vec::new();
        for (index, source) in self.sources.iter().enumerate() {
            let mut spectrum = source.spectrum.clone();
            spectrum.sort_by(|a, b| a.energy_mev.total_cmp(&b.energy_mev));
            let energy: Vec<f64> = spectrum.iter().map(|at| at.energy_mev).collect();
            let above = |fluence: fn(&SourceSpectrum) -> f64| -> Vec<f64> {
                let positive = |fluence: f64| if fluence > 0.0 { fluence } else { f64::NAN };
                spectrum.iter().map(|at| positive(fluence(at))).collect()
            };
            series.push(line(&source.name, index + 1, &energy, above(|at| at.integral_cm2)));
            let shielded = format!("{}, shielded", source.name);
            series.push(dashed(&shielded, index + 1, &energy, above(|at| at.shielded_integral_cm2)));
        }
        Figure {
            title: "Protons above an energy over the mission, by source".into(),
            panels: vec![logarithmic("energy [MeV]", "protons above it [1/cm²]", series)],
        }
    }
}

fn logarithmic(x_label: &str, y_label: &str, series: Vec<Series>) -> Panel {
    Panel { x_label: x_label.into(), y_label: y_label.into(), x_log: true, y_log: true, series, ..Panel::default() }
}
