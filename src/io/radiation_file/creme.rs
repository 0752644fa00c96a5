//! Proton spectra of CREME96 and CREME-MC: `.flx`, `.tfx` and `.trp`.
//!
//! From the page on file formats of creme.isde.vanderbilt.edu (`CREME-MC/faq/creme96-file-formats`), its page on the module TRANS
//! (units), and the reader of csda_rpp (P. O'Brien), which quotes a line of output. A file is
//! ```text
//!  4 GEO.FLX 210 1                       comments, file, version, program
//! %Created by CREME96:FLUX_DRIVER
//! %
//!  1.0000E-01  1.0000E+05   1002      1     92  UNSHIELDED    1977.000  0 2  200 3
//! ```
//!
//! with the first and last energy in MeV/nuc, the number of energies, evenly spaced in their logarithm, the first and last atomic
//! number, the shield, the year, and for `.flx` the state of the Sun (0 is quiet). The differential flux in (m2 s sr MeV/nuc)-1 of
//! all energies for each atomic number follows. Hydrogen is read.

use super::spectrum::{Point, Program, Spectrum, SpectrumFile};
use super::text::{Source, number};
use crate::error::InputError;
use crate::io::unit::Unit;

/// Whether a text was written by CREME: its first or second line is a comment that begins with `%`.
pub(super) fn is_creme(text: &str) -> bool {
    text.lines().filter(|line| !line.trim().is_empty()).take(2).any(is_comment)
}

fn is_comment(line: &str) -> bool {
    line.trim_start().starts_with('%')
}

/// Reads the spectrum of protons.
pub(super) fn read(source: &Source) -> Result<SpectrumFile, InputError> {
    let header = Header::of(source)?;
    let mut values = source
        .text
        .lines()
        .enumerate()
        .skip(header.line)
        .flat_map(|(index, line)| line.split_whitespace().map(move |cell| (index + 1, cell)));
    let unit = Unit::parse("(m2 sr s MeV/nuc)-1").and_then(Unit::flux);
    let (quantity, time, factor) = unit.expect("a unit of this crate");
    let mut points = Vec::new();
    for (index, (line, cell)) in values.by_ref().take(header.energies).enumerate() {
        let flux = number(cell).ok_or_else(|| source.refuse_value(line, "flux", cell, "a number is needed here"))?;
        points.push(Point { energy_mev: header.energy_mev(index), value: flux, line });
    }
    let (there, all) = (points.len() + values.count(), header.energies * header.nuclei);
    if there != all {
        let problem =
            format!("{there} fluxes, where {} energies of {} nuclei need {all}", header.energies, header.nuclei);
        return Err(source.refuse_line(header.line, problem).with_help("take the file as CREME wrote it"));
    }
    let shield = Some(header.target).filter(|target| target != OUTSIDE);
    Spectrum { program: Program::Creme, quantity, time, duration_s: None, shield, factor, points }
        .checked(source, "flux")
}

/// The line above the fluxes.
struct Header {
    /// The line, from 1.
    line: usize,
    first_mev: f64,
    last_mev: f64,
    energies: usize,
    first_nucleus: usize,
    nuclei: usize,
    /// The shield.
    target: String,
}

/// CREME's word for a spectrum without a shield.
const OUTSIDE: &str = "UNSHIELDED";

/// Above the largest atomic number in CREME, 92.
const HEAVIEST: usize = 120;

/// CREME's states of the Sun other than quiet.
const EVENTS: [&str; 3] = ["the worst day", "the worst week", "the peak of five minutes"];

impl Header {
    fn of(source: &Source) -> Result<Header, InputError> {
        // The number of comments, if present, is on its own line before them.
        let (index, line) = (source.text.lines().enumerate())
            .skip_while(|(_, line)| !is_comment(line))
            .find(|(_, line)| !is_comment(line) && !line.trim().is_empty())
            .ok_or_else(|| source.refuse("the file ends with its comments"))?;
        let header = Header::parse(index + 1, line).ok_or_else(|| {
            let problem = "here must stand the first and last energy, how many, and the first and last atomic number";
            source.refuse_line(index + 1, problem).with_help("such as 1.0E-01 1.0E+05 1002 1 92 UNSHIELDED 1977.000")
        })?;
        let refuse = |problem: String| Err(source.refuse_line(index + 1, problem));
        if header.first_nucleus != 1 {
            return refuse(format!("there are no protons: the first atomic number is {}", header.first_nucleus));
        }
        let is_let = source.text.lines().filter(|line| is_comment(line)).any(|line| line.contains("LETSPEC"));
        if is_let || header.target.starts_with("SILICON") {
            return refuse("this is a spectrum of LET, not of energy".into());
        }
        let words: Vec<&str> = line.split_whitespace().collect();
        if let [OUTSIDE, _, state, _, _, _] = words[5..]
            && let Some(state) = state.parse::<usize>().ok().filter(|&state| state > 0)
        {
            let event = EVENTS.get(state - 1).unwrap_or(&EVENTS[2]);
            return refuse(format!("this is the flux of {event}, not the mean over the mission"));
        }
        Ok(header)
    }

    fn parse(line: usize, text: &str) -> Option<Header> {
        let words: Vec<&str> = text.split_whitespace().collect();
        let [first, last, energies, low, high, target @ ..] = words.as_slice() else { return None };
        let (first_mev, last_mev) = (number(first)?, number(last)?);
        let (energies, low, high) = (energies.parse().ok()?, low.parse().ok()?, high.parse::<usize>().ok()?);
        let energies_fit = first_mev > 0.0 && last_mev > first_mev && last_mev.is_finite() && energies > 1;
        let nuclei_fit = (1..=high).contains(&low) && high <= HEAVIEST && energies <= usize::MAX / HEAVIEST;
        if !(energies_fit && nuclei_fit) {
            return None;
        }
        let target = target.first().copied().unwrap_or(OUTSIDE).to_string();
        Some(Header { line, first_mev, last_mev, energies, first_nucleus: low, nuclei: high - low + 1, target })
    }

    /// E = E1 (E2/E1)^(i/(n - 1))
    fn energy_mev(&self, index: usize) -> f64 {
        let part = index as f64 / (self.energies - 1) as f64;
        self.first_mev * (self.last_mev / self.first_mev).powf(part)
    }
}
