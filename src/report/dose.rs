//! `ctiplan dose`.

mod explain;
mod figures;
mod samples;

use super::{Page, Parts, Report, or_dash, table};
use crate::mission::{Accumulate, Mission};
use crate::physics::RateOrigin;
use crate::plan::dose::{CalendarYear, SourceSpectrum, Survey};
use crate::plan::sources::{self, Source};
use crate::report::plot::Figure;

impl Report for Survey {
    fn text(&self) -> String {
        self.parts().text()
    }

    fn csv(&self) -> Vec<Vec<String>> {
        let mut header =
            ["year", "flown_yr", "active_yr", "dose_mev_g", "cumulative_mev_g"].map(str::to_string).to_vec();
        header.extend(samples::columns(self));
        let row = |(index, year): (usize, &CalendarYear)| {
            let mut row = vec![
                year.year.to_string(),
                year.flown_yr.to_string(),
                year.active_yr.to_string(),
                year.dose_mev_g.to_string(),
                year.cumulative_mev_g.to_string(),
            ];
            row.extend(samples::cells(self, index));
            row
        };
        std::iter::once(header).chain(self.years.iter().enumerate().map(row)).collect()
    }
}

impl Page for Survey {
    fn command(&self) -> String {
        "dose".into()
    }

    fn parts(&self) -> Parts {
        let mut out = Parts::default();
        out.verdict(
            format!(
                "Displacement damage dose in silicon: {:.4e} MeV/g at the end of the mission, as {:.3e} protons of 10 MeV \
                 or {:.3e} neutrons of 1 MeV per cm2",
                self.total_mev_g, self.equivalents.protons_10mev_cm2, self.equivalents.neutrons_1mev_cm2
            ),
            2,
        );
        explain::said(self, &mut out);
        self.by_source(&mut out);
        self.beside_imports(&mut out);
        self.year_by_year(&mut out);
        samples::said(self, &mut out);
        self.against_confidence(&mut out);
        self.against_depth(&mut out);
        self.protons(&mut out);
        out.warnings(&self.warnings);
        out
    }

    fn figures(&self) -> Vec<(String, Figure)> {
        self.drawn()
    }

    fn sources(&self, missions: &[Mission]) -> Vec<Source> {
        let drawn = self.samples.iter().map(|_| samples::source());
        sources::once(missions.iter().flat_map(sources::of_dose).chain(drawn))
    }
}

impl Survey {
    /// The sources, each with its dose and its limits; if there is more than one.
    fn by_source(&self, out: &mut Parts) {
        if self.sources.len() < 2 {
            return;
        }
        out.heading("Dose by source, before effects");
        let mut sources = table(&["source", "dose [MeV/g]", "share [%]"]);
        let sum: f64 = self.sources.iter().map(|source| source.total_mev_g).sum();
        for source in &self.sources {
            sources.add_row(vec![
                source.name.clone(),
                format!("{:.3e}", source.total_mev_g),
                format!("{:.1}", 100.0 * source.total_mev_g / sum),
            ]);
        }
        out.table(sources);
        for source in &self.sources {
            out.words(format!("{}: {}.", source.name, source.card.map_or("as imported", |card| card.range)), 2);
        }
        if let Some(secondaries) = self.secondaries {
            out.words(
                format!(
                    "Nuclear reactions in the shield take {:.1e} MeV/g and add {:.1e} MeV/g by neutrons, to a factor of 2: {}.",
                    secondaries.lost_mev_g,
                    secondaries.neutrons_mev_g,
                    if self.secondaries_counted { "counted" } else { "not counted" }
                ),
                2,
            );
        }
    }

    /// Imported doses, with the doses that would be derived in their place.
    fn beside_imports(&self, out: &mut Parts) {
        let Some(derived_mev_g) = self.derived_mev_g else { return };
        out.gap();
        out.words(
            format!(
                "The dose is imported. Derived from orbit, Sun, shield and NIEL it is {derived_mev_g:.3e} MeV/g: imported over \
                 derived is {:.2}.",
                self.total_mev_g / derived_mev_g
            ),
            2,
        );
    }

    /// The quantity in the curve of the dose against thickness.
    fn depth_title(&self) -> String {
        let of = if self.depths_of_mission { "the mission" } else { "one active year" };
        // The confidence is that of ESP's solar protons, and of nothing else.
        let esp = !self.depths_of_mission || self.sources.iter().any(|source| source.name == "solar-protons");
        let at = if esp { format!(", at {} % confidence", 100.0 * self.confidence) } else { String::new() };
        format!("Dose of {of} behind aluminium{at}")
    }

    fn year_by_year(&self, out: &mut Parts) {
        out.gap();
        let mut years = table(&["year", "Sun", "active [yr]", "flown [yr]", "dose [MeV/g]", "since launch [MeV/g]"]);
        for year in &self.years {
            years.add_row(vec![
                year.year.to_string(),
                match (self.history.averages_the_cycle(), year.active_yr) {
                    (true, _) => "mean",
                    _ if self.origin() == RateOrigin::History => "-",
                    _ if year.observed_yr > year.flown_yr - 1e-9 => "observed",
                    _ if year.observed_yr > 0.0 => "observed in part",
                    (false, 0.0) => "quiet",
                    (false, active) if active < year.flown_yr - 1e-9 => "partly",
                    _ => "active",
                }
                .into(),
                if self.history.averages_the_cycle() { "-".into() } else { format!("{:.2}", year.active_yr) },
                format!("{:.2}", year.flown_yr),
                format!("{:.3e}", year.dose_mev_g),
                format!("{:.3e}", year.cumulative_mev_g),
            ]);
        }
        out.table(years);
    }

    fn against_confidence(&self, out: &mut Parts) {
        if self.confidences.is_empty() {
            return;
        }
        out.gap();
        out.words(
            format!(
                "Dose behind the shield against confidence, for the mission's {:.2} active years: the quantile of \
                 one year times years, and the quantile of the sum{}",
                self.active_years,
                match (self.origin(), self.accumulate) {
                    (RateOrigin::Given, _) => " (neither is used: the mission file gives its dose rate)",
                    (RateOrigin::Spectra | RateOrigin::DoseDepth | RateOrigin::History, _) => {
                        " (neither is used: the dose is imported)"
                    }
                    (_, Accumulate::Yearly) => " (the mission uses the first)",
                    (_, Accumulate::Mission) => " (the mission uses the second)",
                }
            ),
            2,
        );
        // With all sources there is no separate dose of an active year.
        let alone = !self.depths_of_mission;
        let mut columns = vec!["confidence [%]", "year x years [MeV/g]", "sum [MeV/g]"];
        if alone {
            columns.insert(1, "one active year [MeV/g]");
        }
        let mut confidences = table(&columns);
        for at in &self.confidences {
            let mut row = vec![
                format!("{:.0}", 100.0 * at.confidence),
                format!("{:.3e}", at.yearly_mev_g),
                format!("{:.3e}", at.mission_mev_g),
            ];
            if alone {
                row.insert(1, format!("{:.3e}", at.active_year_mev_g));
            }
            confidences.add_row(row);
        }
        out.table(confidences);
    }

    fn against_depth(&self, out: &mut Parts) {
        if self.depths.is_empty() {
            return;
        }
        out.heading(self.depth_title());
        let mut depths = table(&["mm Al", "sphere [MeV/g]", "slab [MeV/g]"]);
        for at in &self.depths {
            depths.add_row(vec![
                format!("{}", at.thickness_mm),
                format!("{:.3e}", at.sphere_mev_g),
                format!("{:.3e}", at.slab_mev_g),
            ]);
        }
        out.table(depths);
        if let (Some(sphere_mm), Some(slab_mm)) = (self.equivalent_mm.sphere, self.equivalent_mm.slab) {
            out.words(
                format!(
                    "The mission's dose rate of an active year is that behind {sphere_mm:.1} mm (sphere) or {slab_mm:.1} mm \
                     (slab)."
                ),
                2,
            );
        }
    }

    /// Fluences of each source.
    fn by_energy_and_source(&self, out: &mut Parts) {
        for (place, shielded) in [("at the spacecraft", false), ("behind the shield", true)] {
            let fluence = |at: &SourceSpectrum| if shielded { at.shielded_integral_cm2 } else { at.integral_cm2 };
            out.heading(format!("Protons above an energy over the mission {place}, per cm2"));
            let columns = self.sources.iter().map(|source| source.name.as_str());
            let mut spectrum = table(&std::iter::once("E [MeV]").chain(columns).collect::<Vec<_>>());
            for (index, at) in self.spectrum.iter().enumerate() {
                let mut row = vec![format!("{}", at.energy_mev)];
                row.extend(self.sources.iter().map(|source| format!("{:.3e}", fluence(&source.spectrum[index]))));
                spectrum.add_row(row);
            }
            out.table(spectrum);
        }
    }

    fn protons(&self, out: &mut Parts) {
        if self.depths_of_mission {
            if self.sources.iter().all(|source| source.spectrum.len() == self.spectrum.len()) {
                self.by_energy_and_source(out);
            }
            return;
        }
        out.gap();
        out.words(
            format!(
                "Solar protons outside the magnetosphere above an energy at {} %, per cm2: in one active year, and in the mission's {:.2} active \
                 years together",
                100.0 * self.confidence,
                self.active_years
            ),
            2,
        );
        let mut spectrum = table(&["E [MeV]", "1 yr", "1 yr, shielded", "mission", "mission, shielded"]);
        let cell = |value: Option<f64>| or_dash(value.map(|value| format!("{value:.3e}")));
        for at in &self.spectrum {
            spectrum.add_row(vec![
                format!("{}", at.energy_mev),
                format!("{:.3e}", at.integral_cm2.year),
                cell(at.shielded_integral_cm2.year),
                format!("{:.3e}", at.integral_cm2.mission),
                cell(at.shielded_integral_cm2.mission),
            ]);
        }
        out.table(spectrum);
    }
}
