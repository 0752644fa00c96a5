//! Proton spectra of OMERE.
//!
//! From outputs of OMERE 5.9.1 in the repository mariapasaylo/LUMENS-PV (`omere_outputs/*_equiFlux.fle`, displacement damage with
//! its input fluences), and from programs that read others: `.dos` and `.let` of 5.9, and `.flx`, of which no output was available:
//! energies, and omnidirectional fluxes. All are tables of numbers below comments, the last of which contain the names and the
//! units of the columns:
//!
//! ```text
//! # OMERE 5.9.1.41289 - Displacement damage
//! # Lifetime : 10 year(s).
//! # ***********PROTONS**********
//! # ENERGY           DIFFERENTIAL_FLUENCE
//! #  MeV                  /(MeV.cm2)
//!  1.00e-01            1.62e+13
//! ```
//!
//! A table is a spectrum if its units say so, and of protons if the comments above it do. Where models are joined, an energy occurs
//! twice at the step to the second one: the second value is used.

use super::spectrum::{Point, Program, Quantity, Spectrum, SpectrumFile, Time};
use super::text::{Source, number};
use crate::error::InputError;
use crate::io::unit::Unit;

/// Whether a text was written by OMERE: a comment begins with its name and version, and numbers follow the comments.
pub(super) fn is_omere(text: &str) -> bool {
    let is_version = |line: &str| {
        let after = line.trim_start_matches('#').trim_start().strip_prefix("OMERE ");
        after.is_some_and(|after| after.trim_start().starts_with(|first: char| first.is_ascii_digit()))
    };
    let mut lines = text.lines().map(str::trim).filter(|line| !line.is_empty());
    let mut named = false;
    let first = lines.find(|line| {
        named |= line.starts_with('#') && is_version(line);
        !line.starts_with('#')
    });
    named && first.is_none_or(|row| row.split_whitespace().all(|cell| number(cell).is_some()))
}

/// Reads the spectrum of protons.
pub(super) fn read(source: &Source) -> Result<SpectrumFile, InputError> {
    let spectra: Vec<_> = sections(source)?.into_iter().filter_map(|table| Some((table.flux()?, table))).collect();
    let mut protons = spectra.iter().filter(|(_, table)| table.particle == Some(Particle::Proton));
    match (protons.next(), protons.next()) {
        (Some((column, table)), None) => table.spectrum(source, *column)?.checked(source, column.name()),
        (Some((_, first)), Some((_, second))) => {
            let problem = format!("a second spectrum of protons; the first begins at line {}", first.line());
            Err(source.refuse_line(second.line(), problem).with_help("keep the one that is meant, with its comments"))
        }
        (None, _) => Err(match spectra.iter().find(|(_, table)| table.particle.is_none()) {
            Some((_, table)) => source
                .refuse_line(table.line(), "the comments above this spectrum do not say of which particles it is")
                .with_help("write `# PROTONS` above the names of the columns"),
            None => source.refuse("there is no spectrum of protons: a table whose units are MeV, and cm-2 or the like"),
        }),
    }
}

/// The particle of a table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Particle {
    Proton,
    Other,
}

/// A table of numbers below comments.
struct Section<'a> {
    /// None if the comments name no particle, or several.
    particle: Option<Particle>,
    /// The units of the columns. None if the comments do not state them.
    units: Option<Vec<Unit>>,
    /// The duration of the mission, s.
    duration_s: Option<f64>,
    /// Lines, from 1, and cells.
    rows: Vec<(usize, Vec<&'a str>)>,
}

/// The flux or fluence column of a table.
#[derive(Clone, Copy)]
struct FluxColumn {
    place: usize,
    quantity: Quantity,
    time: Time,
    factor: f64,
}

impl FluxColumn {
    fn name(self) -> &'static str {
        match self.quantity {
            Quantity::Integral => "integral",
            Quantity::Differential => "differential",
        }
    }
}

fn sections(source: &Source) -> Result<Vec<Section<'_>>, InputError> {
    let mut sections: Vec<Section> = Vec::new();
    let mut above = Comments::default();
    let mut in_rows = false;
    for (index, line) in source.text.lines().enumerate() {
        let line = line.trim_matches(['\u{c}', '\u{1a}']).trim();
        if let Some(comment) = line.strip_prefix('#') {
            if in_rows {
                above.paragraph.clear();
            }
            in_rows = false;
            above.add(comment.trim());
        } else if line.is_empty() {
            above.add("");
        } else {
            let cells: Vec<&str> = line.split_whitespace().collect();
            if cells.iter().any(|cell| number(cell).is_none()) {
                return Err(source.refuse_line(index + 1, "here a comment or a row of numbers must stand"));
            }
            if !in_rows {
                let (particle, units) = (above.particle(), above.units(cells.len()));
                sections.push(Section { particle, units, duration_s: above.duration_s, rows: Vec::new() });
            }
            in_rows = true;
            sections.last_mut().expect("just begun").rows.push((index + 1, cells));
        }
    }
    Ok(sections)
}

/// The comments above a table.
#[derive(Default)]
struct Comments<'a> {
    /// The comments in one block above it.
    paragraph: Vec<&'a str>,
    /// Whether any so far name protons, and any other particles.
    proton: bool,
    other: bool,
    duration_s: Option<f64>,
}

impl<'a> Comments<'a> {
    fn add(&mut self, comment: &'a str) {
        if comment.is_empty() {
            self.paragraph.clear();
            return;
        }
        self.paragraph.push(comment);
        let (proton, other) = named(comment);
        self.proton |= proton;
        self.other |= other;
        if let Some(duration) = comment.strip_prefix("Lifetime") {
            self.duration_s = lifetime_s(duration).or(self.duration_s);
        }
    }

    /// The only particle named in the last comment that names one, or in all comments of the file so far.
    fn particle(&self) -> Option<Particle> {
        let last = self.paragraph.iter().rev().map(|comment| named(comment)).find(|(proton, other)| proton | other);
        match last.unwrap_or((self.proton, self.other)) {
            (true, false) => Some(Particle::Proton),
            (false, true) => Some(Particle::Other),
            _ => None,
        }
    }

    /// The units of some columns: from the last comment that has one for each column, bare or in brackets.
    fn units(&self, columns: usize) -> Option<Vec<Unit>> {
        self.paragraph.iter().rev().find_map(|comment| {
            let bare = comment.split_whitespace().collect();
            let wide = comment.split("  ").map(str::trim).filter(|unit| !unit.is_empty()).collect();
            [bare, wide, bracketed(comment)].into_iter().find_map(|units: Vec<&str>| {
                let units: Vec<Unit> = units.iter().map(|unit| Unit::parse(unit)).collect::<Option<_>>()?;
                let fits = units.len() == columns && units.first()?.to(Unit::PURE).is_none();
                fits.then_some(units)
            })
        })
    }
}

/// Whether a comment names protons, and whether it names other particles.
fn named(comment: &str) -> (bool, bool) {
    let comment = comment.to_lowercase();
    let other = ["electron", "neutron", "photon", "gamma", "ions"].iter().any(|name| comment.contains(name));
    (comment.contains("proton"), other)
}

/// The contents of the outermost brackets.
fn bracketed(comment: &str) -> Vec<&str> {
    let mut found = Vec::new();
    let mut open = Vec::new();
    for (place, letter) in comment.char_indices() {
        match letter {
            '(' | '[' => open.push(place + 1),
            ')' | ']' => {
                if let Some(start) = open.pop()
                    && open.is_empty()
                {
                    found.push(&comment[start..place]);
                }
            }
            _ => (),
        }
    }
    found
}

/// ` : 10 year(s).` in s.
fn lifetime_s(text: &str) -> Option<f64> {
    let mut words = text.trim_start_matches([' ', ':']).split_whitespace();
    let number = number(words.next()?).filter(|number| *number > 0.0)?;
    let unit = words.next()?;
    let unit = &unit[..unit.find(|letter: char| !letter.is_alphabetic()).unwrap_or(unit.len())];
    Some(number * Unit::parse(unit)?.to(Unit::parse("s")?)?)
}

impl Section<'_> {
    /// Its first line.
    fn line(&self) -> usize {
        self.rows.first().map_or(0, |(line, _)| *line)
    }

    /// The flux or fluence column, preferably the integral one. None if this is not a spectrum.
    fn flux(&self) -> Option<FluxColumn> {
        let units = self.units.as_ref()?;
        units.first()?.to(Unit::MEV)?;
        let columns = units.iter().enumerate().skip(1).filter_map(|(place, unit)| {
            let (quantity, time, factor) = unit.flux()?;
            Some(FluxColumn { place, quantity, time, factor })
        });
        columns.min_by_key(|column| column.quantity == Quantity::Differential)
    }

    fn spectrum(&self, source: &Source, column: FluxColumn) -> Result<Spectrum, InputError> {
        let mev = self.units.as_ref().and_then(|units| units[0].to(Unit::MEV)).unwrap_or(1.0);
        let mut points: Vec<Point> = Vec::new();
        for (line, cells) in &self.rows {
            let cell = |place: usize, name: &str| {
                let cell = cells.get(place).copied().unwrap_or("(nothing)");
                number(cell).ok_or_else(|| source.refuse_value(*line, name, cell, "a number is needed here"))
            };
            let (energy_mev, value) = (mev * cell(0, "energy")?, cell(column.place, column.name())?);
            // A model begins at this energy.
            points.pop_if(|last| last.energy_mev == energy_mev);
            points.push(Point { energy_mev, value, line: *line });
        }
        let (program, duration_s) = (Program::Omere, self.duration_s);
        let FluxColumn { quantity, time, factor, .. } = column;
        Ok(Spectrum { program, quantity, time, duration_s, shield: None, factor, points })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn omere_is_recognised_by_a_comment_with_its_version_above_numbers() {
        assert!(is_omere("#====\n# OMERE 5.9.1.41289 - Displacement damage\n\n 1.0 2.0\n"));
        assert!(!is_omere("# OMERE 5.9, as a table\nenergy_mev,integral_cm2\n1,2\n"));
        assert!(!is_omere("# made with OMERE\n1 2\n"));
    }

    #[test]
    fn the_last_comment_that_names_a_particle_says_which_it_is() {
        let particle = |comments: &[&str]| {
            let mut above = Comments::default();
            comments.iter().for_each(|comment| above.add(comment));
            above.particle()
        };
        assert_eq!(particle(&["Trapped electrons :", "", "PROTONS", "ENERGY"]), Some(Particle::Proton));
        assert_eq!(particle(&["Trapped protons :", "", "ENERGY"]), Some(Particle::Proton));
        assert_eq!(particle(&["Trapped protons :", "Trapped electrons :", "", "ENERGY"]), None);
        assert_eq!(particle(&["Solar protons : ESP", "", "PROTONS_AND_ELECTRONS"]), None);
        assert_eq!(particle(&["HEAVY IONS"]), Some(Particle::Other));
    }

    #[test]
    fn units_stand_bare_between_blanks_or_in_brackets() {
        let units = |comment| {
            let mut above = Comments::default();
            above.add(comment);
            above.units(2).map(|units| units[1].flux().map(|flux| flux.0))
        };
        assert_eq!(units("MeV   /(MeV.cm2)"), Some(Some(Quantity::Differential)));
        assert_eq!(units("MeV   cm-2 s-1"), Some(Some(Quantity::Integral)));
        assert_eq!(units("Energy (MeV)  Flux (/(MeV.cm2))"), Some(Some(Quantity::Differential)));
        assert_eq!(units("ENERGY  FLUX"), None);
        assert_eq!(units("----  ----"), None);
    }

    #[test]
    fn a_lifetime_is_in_years_months_or_days() {
        assert_eq!(lifetime_s(" : 10 year(s)."), Some(315_576_000.0));
        assert_eq!(lifetime_s(" : 18 month(s)."), Some(1.5 * 31_557_600.0));
        assert_eq!(lifetime_s(": long"), None);
    }
}
