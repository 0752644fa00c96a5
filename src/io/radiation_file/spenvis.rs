//! Proton spectra of SPENVIS.
//!
//! From outputs of SPENVIS 4.6.13 in the repository tdloveless/me-radfx (`HW/HW_02_Solutions/*_spenvis_tri.txt`, `_sef.txt`,
//! `_sefflare.txt`, `_gcf.txt`), and of 4.6.7 and 4.6.11. A file is a sequence of blocks:
//!
//! ```text
//! '*',    75,     1,    33,    37,     3,     3,    29,     1
//! 'SPENVIS 4.6.13.3554          - 19-Sep-2025 22:14:30'
//! 'MIS_DUR',  1, 2.555000E+03,'days'
//! 'SPECIES', -1,'proton'
//! 'PS Annotation',  8,  2
//! 'Mission start: 01/01/2026 00:00:00'
//!  0.05, 0.00, 0.00
//! 'Energy','MeV', 1,'Energy'
//! 'IFlux','cm!u-2!n s!u-1!n', 1,'Integral Flux'
//! 'DFlux','cm!u-2!n s!u-1!n MeV!u-1!n', 1,'Differential Flux'
//!   1.0000E-01,  7.4888E+03,  4.7215E+04
//! 'End of Block'
//! ```
//!
//! The first line contains counts: lines of the header including itself, lines of text, metadata, lines of annotation, variables,
//! columns, rows, following blocks. A variable has a name, a unit, a number of columns, and a title; `SPECIES` names the columns if
//! ions share a block (`-92,'H ','He',...`). The last block ends with `'End of File'`.
//!
//! Blocks with an orbit (`ORB_MJD` to `ORB_TSE`, days) belong to a segment of the mission; the others belong to the whole mission
//! and have precedence. Fluxes of several segments are averaged by their durations, fluences are added.

use super::spectrum::{Point, Program, Spectrum, SpectrumFile, Time};
use super::text::{Source, number};
use crate::error::InputError;
use crate::io::unit::Unit;

/// Whether a text was written by SPENVIS: the first line counts the header, as above.
pub(super) fn is_spenvis(text: &str) -> bool {
    let first = text.lines().find(|line| !line.trim().is_empty()).unwrap_or("");
    first.trim_start().starts_with("'*'")
}

/// Reads the spectrum of protons.
pub(super) fn read(source: &Source) -> Result<SpectrumFile, InputError> {
    let blocks = blocks(source)?;
    let mut spectra = Vec::new();
    for species in [Species::Proton, Species::HydrogenAmongIons] {
        if spectra.is_empty() {
            for block in &blocks {
                spectra.extend(block.spectrum(source, species)?);
            }
        }
    }
    let of_mission = spectra.iter().filter(|spectrum| spectrum.segment_d.is_none()).count();
    match (spectra.len(), of_mission) {
        (0, _) => {
            Err(source
                .refuse("no block holds a spectrum of protons: Energy with IFlux or DFlux, and SPECIES proton or H"))
        }
        (_, 0) => sum_of_segments(source, spectra),
        (_, 1) => {
            let spectrum = spectra.into_iter().find(|spectrum| spectrum.segment_d.is_none()).expect("one");
            spectrum.spectrum.checked(source, spectrum.column)
        }
        (_, several) => {
            let lines: Vec<_> = spectra.iter().map(|spectrum| spectrum.line.to_string()).collect();
            let problem =
                format!("{several} blocks hold proton spectra of the whole mission, at lines {}", lines.join(", "));
            Err(source.refuse(problem).with_help("keep the block that is meant"))
        }
    }
}

/// The species that a block must have.
#[derive(Clone, Copy, PartialEq)]
enum Species {
    Proton,
    HydrogenAmongIons,
}

/// A block: its metadata, its variables and its rows.
struct Block<'a> {
    /// Its first line, from 1.
    line: usize,
    meta: Vec<(usize, Vec<&'a str>)>,
    variables: Vec<(usize, Vec<&'a str>)>,
    rows: Vec<(usize, &'a str)>,
}

/// A proton spectrum of a block.
struct OfBlock {
    spectrum: Spectrum,
    /// Days of the mission that it covers. None if it covers all.
    segment_d: Option<f64>,
    /// The name of its values.
    column: &'static str,
    /// The block's first line, from 1.
    line: usize,
}

/// The cells of a line, without surrounding blanks and quotes. A comma between quotes is not a delimiter.
fn cells(line: &str) -> Vec<&str> {
    let mut quoted = false;
    let parts = line.split(move |letter| {
        quoted ^= letter == '\'';
        letter == ',' && !quoted
    });
    parts.map(|cell| cell.trim().trim_matches('\'').trim()).collect()
}

fn blocks(source: &Source) -> Result<Vec<Block<'_>>, InputError> {
    let mut lines = source.text.lines().enumerate().map(|(index, line)| (index + 1, line)).peekable();
    let mut blocks = Vec::new();
    while let Some((line, first)) = lines.find(|(_, line)| !line.trim().is_empty()) {
        let [header, text, meta, annotation, variables, rows] = counts(source, line, first)?;
        let mut block = Block { line, meta: Vec::new(), variables: Vec::new(), rows: Vec::new() };
        for offset in 1..header {
            let (line, written) = lines.next().ok_or_else(|| cut(source))?;
            let from_end = header - offset;
            if (text + 1..=text + meta).contains(&offset) {
                block.meta.push((line, cells(written)));
            } else if from_end <= variables && offset > text + meta + annotation {
                block.variables.push((line, cells(written)));
            }
        }
        loop {
            let (line, written) = lines.next().ok_or_else(|| cut(source))?;
            if written.trim_start().starts_with('\'') {
                if !written.contains("'End of") {
                    return Err(source.refuse_line(line, "here rows of numbers must stand, or 'End of Block'"));
                }
                break;
            }
            block.rows.push((line, written));
        }
        if block.rows.len() != rows {
            let problem = format!("the block has {} rows, where this line counts {rows}", block.rows.len());
            return Err(source.refuse_line(line, problem).with_help("take the file as SPENVIS wrote it"));
        }
        blocks.push(block);
    }
    Ok(blocks)
}

/// The counts in a block's first line: header lines including itself, lines of text, metadata, annotation, variables; rows.
fn counts(source: &Source, line: usize, first: &str) -> Result<[usize; 6], InputError> {
    let cells = cells(first);
    let count = |place: usize| cells.get(place).and_then(|cell| cell.parse::<usize>().ok());
    let counted = || Some([count(1)?, count(2)?, count(3)?, count(4)?, count(5)?, count(7)?]);
    let fits = |counts: &[usize; 6]| {
        let parts = counts[1..5].iter().try_fold(1_usize, |sum, part| sum.checked_add(*part));
        cells[0] == "*" && parts == Some(counts[0])
    };
    counted().filter(fits).ok_or_else(|| {
        let problem = "a block must begin with '*' and the counts of its lines: all = 1 + text + metadata + annotation + \
                       variables";
        source.refuse_line(line, problem).with_help("take the file as SPENVIS wrote it")
    })
}

fn cut(source: &Source) -> InputError {
    source.refuse("the file ends within a block").with_help("take the whole file: it ends with 'End of File'")
}

impl Block<'_> {
    /// The values of a key of the metadata, with its line.
    fn meta(&self, key: &str) -> Option<(usize, &[&str])> {
        let (line, cells) = self.meta.iter().find(|(_, cells)| cells[0] == key)?;
        Some((*line, cells.get(2..).unwrap_or(&[])))
    }

    /// The number of a key of the metadata.
    fn meta_number(&self, source: &Source, key: &str) -> Result<Option<f64>, InputError> {
        let Some((line, values)) = self.meta(key) else { return Ok(None) };
        let value = values.first().copied().unwrap_or("");
        let number = number(value).filter(|number| number.is_finite());
        number.map(Some).ok_or_else(|| source.refuse_value(line, key, value, "a number is needed here"))
    }

    /// The first column of a variable, from 0, its line and its unit.
    fn variable(&self, name: &str) -> Option<(usize, usize, &str)> {
        let mut first = 0;
        for (line, cells) in &self.variables {
            if cells[0] == name {
                return Some((first, *line, cells.get(1).copied()?));
            }
            first += cells.get(2)?.parse::<usize>().ok()?;
        }
        None
    }

    /// The spectrum of protons, if the block contains one of this species.
    fn spectrum(&self, source: &Source, species: Species) -> Result<Option<OfBlock>, InputError> {
        let Some((_, names)) = self.meta("SPECIES") else { return Ok(None) };
        let place = match species {
            Species::Proton => names.iter().position(|name| name.to_lowercase().starts_with("proton")),
            Species::HydrogenAmongIons => names.iter().position(|name| *name == "H"),
        };
        let value = ["IFlux", "DFlux"].into_iter().find_map(|name| Some((name, self.variable(name)?)));
        let (Some(place), Some((energy, energy_line, unit)), Some((column, (first, line, flux)))) =
            (place, self.variable("Energy"), value)
        else {
            return Ok(None);
        };
        self.check_mean(source)?;
        let mev = Unit::parse(unit).and_then(|unit| unit.to(Unit::MEV));
        let mev = mev.ok_or_else(|| source.refuse_line(energy_line, format!("`{unit}` is not a unit of energy")))?;
        let (quantity, time, factor) = Unit::parse(flux)
            .and_then(Unit::flux)
            .ok_or_else(|| source.refuse_line(line, format!("`{flux}` is not a unit of a flux or fluence")))?;
        let point = |&(line, row): &(usize, &str)| {
            let cells = cells(row);
            let read = |column: &str, place: usize| {
                let cell = cells.get(place).copied().unwrap_or("(nothing)");
                number(cell).ok_or_else(|| source.refuse_value(line, column, cell, "a number is needed here"))
            };
            Ok(Point { energy_mev: mev * read("Energy", energy)?, value: read(column, first + place)?, line })
        };
        let points = self.rows.iter().map(point).collect::<Result<_, InputError>>()?;
        let duration_s = self.meta_number(source, "MIS_DUR")?.map(|days| days * DAY_S);
        let program = Program::Spenvis;
        let spectrum = Spectrum { program, quantity, time, duration_s, shield: None, factor, points };
        Ok(Some(OfBlock { spectrum, segment_d: self.segment_d(source)?, column, line: self.line }))
    }

    /// Duration in days of the segment of the block. None if it covers the whole mission.
    fn segment_d(&self, source: &Source) -> Result<Option<f64>, InputError> {
        let (start, end) = (self.meta_number(source, "ORB_MJD")?, self.meta_number(source, "ORB_TSE")?);
        let (Some(start), Some(end)) = (start, end) else { return Ok(None) };
        if end > start {
            return Ok(Some(end - start));
        }
        Err(source.refuse_line(self.line, format!("the segment ends on day {end}, and begins on day {start}")))
    }

    /// Rejects the flux of a worst day or week, which is not a mean over the mission.
    fn check_mean(&self, source: &Source) -> Result<(), InputError> {
        match self.meta("MOD_ABB") {
            Some((line, ["FLA", ..])) => Err(source
                .refuse_line(
                    line,
                    "this is the flux of a short time (worst day, worst week), not the mean over the mission",
                )
                .with_help("take the fluence of the mission, spenvis_sef.txt")),
            _ => Ok(()),
        }
    }
}

const DAY_S: f64 = 86_400.0;

/// Combines segments: the mean of their fluxes by duration, the sum of their fluences.
fn sum_of_segments(source: &Source, segments: Vec<OfBlock>) -> Result<SpectrumFile, InputError> {
    let days: f64 = segments.iter().filter_map(|segment| segment.segment_d).sum();
    let mut segments = segments.into_iter();
    let mut first = segments.next().expect("at least one");
    let weight = |segment: &OfBlock| match (segment.spectrum.time, segment.segment_d) {
        (Time::PerSecond, Some(own)) => own / days,
        _ => 1.0,
    };
    let own = weight(&first);
    first.spectrum.points.iter_mut().for_each(|point| point.value *= own);
    for other in segments {
        let (sum, more) = (&mut first.spectrum, &other.spectrum);
        let energies = |spectrum: &Spectrum| spectrum.points.iter().map(|point| point.energy_mev).collect::<Vec<_>>();
        if (sum.quantity, sum.time, sum.factor) != (more.quantity, more.time, more.factor)
            || energies(sum) != energies(more)
        {
            let problem = "this segment has other energies or another quantity than the first";
            return Err(source.refuse_line(other.line, problem));
        }
        let weight = weight(&other);
        for (sum, more) in sum.points.iter_mut().zip(&more.points) {
            sum.value += weight * more.value;
        }
    }
    first.spectrum.checked(source, first.column)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_comma_between_quotes_parts_nothing() {
        assert_eq!(cells("'ORB_HDR', -1,'Polar, low'"), ["ORB_HDR", "-1", "Polar, low"]);
        assert_eq!(cells("'SPECIES',-3,'H ','He','Li'"), ["SPECIES", "-3", "H", "He", "Li"]);
        assert_eq!(cells("  1.0E+00,  2.0E+00"), ["1.0E+00", "2.0E+00"]);
        assert_eq!(cells(""), [""]);
    }

    #[test]
    fn spenvis_is_recognised_by_its_first_line() {
        assert!(is_spenvis("\n '*',    75,     1\n"));
        assert!(!is_spenvis("energy_mev,integral_cm2\n'*',1\n"));
    }
}
