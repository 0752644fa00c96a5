//! Units in the notation of radiation programs → powers of cm, s, sr, MeV and g.
//!
//! Products and quotients are read in the spellings of SPENVIS (`cm!u-2!n s!u-1!n (MeV/n)!u-1!n`, the superscripts of IDL), of
//! OMERE (`/(MeV.cm2)`, `cm-2.s-1`) and of ECSV (`1 / (MeV cm2)`). A `/` divides by the next factor only. Energy per nucleon is
//! energy: nucleons and counted particles have no unit here.

use std::f64::consts::PI;
use std::iter::Peekable;
use std::str::Chars;

use super::{Quantity, Time};

/// Seconds in a year of 365.25 d.
pub(super) const YEAR_S: f64 = 31_557_600.0;

/// factor · cm^a s^b sr^c MeV^d g^e
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Unit {
    factor: f64,
    /// Powers of cm, s, sr, MeV and g.
    powers: [i32; 5],
}

/// Names of units, their values in cm, s, sr, MeV or g, and the index of that among the powers. A year is 365.25 d.
const NAMES: [(&str, f64, usize); 35] = [
    ("um", 1e-4, 0),
    ("µm", 1e-4, 0),
    ("mm", 0.1, 0),
    ("cm", 1.0, 0),
    ("m", 100.0, 0),
    ("km", 1e5, 0),
    ("s", 1.0, 1),
    ("sec", 1.0, 1),
    ("second", 1.0, 1),
    ("seconds", 1.0, 1),
    ("min", 60.0, 1),
    ("h", 3600.0, 1),
    ("hr", 3600.0, 1),
    ("hrs", 3600.0, 1),
    ("hour", 3600.0, 1),
    ("hours", 3600.0, 1),
    ("d", 86_400.0, 1),
    ("day", 86_400.0, 1),
    ("days", 86_400.0, 1),
    ("month", YEAR_S / 12.0, 1),
    ("months", YEAR_S / 12.0, 1),
    ("yr", YEAR_S, 1),
    ("a", YEAR_S, 1),
    ("year", YEAR_S, 1),
    ("years", YEAR_S, 1),
    ("sr", 1.0, 2),
    ("ster", 1.0, 2),
    ("eV", 1e-6, 3),
    ("keV", 1e-3, 3),
    ("MeV", 1.0, 3),
    ("GeV", 1e3, 3),
    ("TeV", 1e6, 3),
    ("mg", 1e-3, 4),
    ("g", 1.0, 4),
    ("kg", 1e3, 4),
];

/// Counted items, which have no unit.
const COUNTED: [&str; 10] = ["particles", "protons", "electrons", "nuclei", "ions", "p", "n", "u", "nuc", "nucleon"];

/// Maximum length of a unit, which limits nested brackets.
const LONGEST: usize = 80;

impl Unit {
    pub const MEV: Unit = Unit { factor: 1.0, powers: [0, 0, 0, 1, 0] };
    pub const PURE: Unit = Unit { factor: 1.0, powers: [0; 5] };

    /// The unit in a text. None if it is not a unit.
    pub fn parse(text: &str) -> Option<Unit> {
        let text = text.replace("!u", "^").replace("!n", "").replace("**", "^");
        let mut rest = text.chars().peekable();
        let unit = if text.len() > LONGEST { return None } else { product(&mut rest)? };
        rest.next().is_none().then_some(unit)
    }

    /// The factor from this unit to another. None if they measure different things.
    pub fn to(self, other: Unit) -> Option<f64> {
        (self.powers == other.powers).then_some(self.factor / other.factor)
    }

    /// For the unit of a flux or a fluence: the quantity, the time, and the factor to omnidirectional values in cm, s and MeV. An
    /// isotropic flux per steradian is 1/(4 pi) of the omnidirectional one.
    pub fn flux(self) -> Option<(Quantity, Time, f64)> {
        let [cm, s, sr, mev, g] = self.powers;
        let quantity = match mev {
            0 => Quantity::Integral,
            -1 => Quantity::Differential,
            _ => return None,
        };
        let time = match s {
            0 => Time::Mission,
            -1 => Time::PerSecond,
            _ => return None,
        };
        let angle = match sr {
            0 => 1.0,
            -1 => 4.0 * PI,
            _ => return None,
        };
        (cm == -2 && g == 0).then_some((quantity, time, self.factor * angle))
    }

    fn of_name(name: &str) -> Option<Unit> {
        if COUNTED.contains(&name) {
            return Some(Unit::PURE);
        }
        let &(_, factor, place) = NAMES.iter().find(|(known, ..)| *known == name)?;
        let mut powers = [0; 5];
        powers[place] = 1;
        Some(Unit { factor, powers })
    }

    fn times(self, other: Unit, power: i32) -> Unit {
        let mut powers = self.powers;
        for (own, theirs) in powers.iter_mut().zip(other.powers) {
            *own += power * theirs;
        }
        Unit { factor: self.factor * other.factor.powi(power), powers }
    }
}

/// Factors up to the end of the text or of the brackets.
fn product(rest: &mut Peekable<Chars>) -> Option<Unit> {
    let mut unit = Unit::PURE;
    let mut sign = 1;
    while let Some(&next) = rest.peek() {
        let factor = match next {
            ')' | ']' => break,
            ' ' | '\t' | '.' | '*' | '·' | '-' | '#' => {
                rest.next();
                continue;
            }
            '/' => {
                rest.next();
                sign = -1;
                continue;
            }
            '(' | '[' => {
                rest.next();
                let inner = product(rest)?;
                rest.next().filter(|&close| close == if next == '(' { ')' } else { ']' })?;
                inner
            }
            '1' => {
                rest.next();
                if rest.peek().is_some_and(char::is_ascii_digit) {
                    return None;
                }
                continue;
            }
            _ => Unit::of_name(&word(rest))?,
        };
        unit = unit.times(factor, sign * power(rest)?);
        sign = 1;
    }
    Some(unit)
}

fn word(rest: &mut Peekable<Chars>) -> String {
    let mut word = String::new();
    while let Some(letter) = rest.next_if(|letter| letter.is_alphabetic()) {
        word.push(letter);
    }
    word
}

/// The power after a factor: `2`, `-2`, `^-2`; 1 if there is none. A `-` before a letter joins factors.
fn power(rest: &mut Peekable<Chars>) -> Option<i32> {
    let raised = rest.next_if_eq(&'^').is_some();
    let mut ahead = rest.clone();
    let negative = ahead.next_if_eq(&'-').is_some();
    if !ahead.peek().is_some_and(char::is_ascii_digit) {
        return (!raised).then_some(1);
    }
    *rest = ahead;
    let mut digits = String::new();
    while let Some(digit) = rest.next_if(char::is_ascii_digit) {
        digits.push(digit);
    }
    let power: i32 = digits.parse().ok().filter(|&power| power <= 9)?;
    Some(if negative { -power } else { power })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_spellings_of_the_programs_are_read() {
        let same = [
            ("cm!u-2!n s!u-1!n MeV!u-1!n", "1 / (MeV s cm2)"),
            ("/(MeV.cm2)", "cm-2 MeV-1"),
            ("cm-2.s-1", "#/cm2/s"),
            ("m!u-2!n sr!u-1!n s!u-1!n (MeV/n)!u-1!n", "(m2-s-sr-MeV/nuc)**-1"),
            ("MeV.g-1", "MeV / g"),
            ("g/cm2", "g cm**-2"),
            ("protons/cm^2", "[cm-2]"),
        ];
        for (one, other) in same {
            assert_eq!(Unit::parse(one), Unit::parse(other), "{one} {other}");
            assert!(Unit::parse(one).is_some(), "{one}");
        }
        for wrong in ["rad", "Gy", "MeV(", "cm)", "cm^x", "2 cm", "10 cm", "cm^99999999999", "%"] {
            assert_eq!(Unit::parse(wrong), None, "{wrong}");
        }
        assert_eq!(Unit::parse(" "), Some(Unit::PURE));
    }

    #[test]
    fn fluxes_become_omnidirectional_in_cm_s_and_mev() {
        let flux = |text| Unit::parse(text).unwrap().flux();
        assert_eq!(flux("cm!u-2!n"), Some((Quantity::Integral, Time::Mission, 1.0)));
        assert_eq!(flux("1/(cm2 s keV)"), Some((Quantity::Differential, Time::PerSecond, 1000.0)));
        let (quantity, time, factor) = flux("m-2 sr-1 s-1 MeV-1").unwrap();
        assert_eq!((quantity, time), (Quantity::Differential, Time::PerSecond));
        assert!((factor / (4.0 * PI * 1e-4) - 1.0).abs() < 1e-14);
        for other in ["MeV", "MeV.cm2.g-1", "mm", "cm-2 s-2", "cm-3"] {
            assert_eq!(flux(other), None, "{other}");
        }
    }

    #[test]
    fn a_unit_is_converted_into_one_of_its_kind() {
        let unit = |text| Unit::parse(text).unwrap();
        assert_eq!(unit("MeV/kg").to(unit("MeV/g")), Some(1e-3));
        assert_eq!(unit("days").to(unit("s")), Some(86_400.0));
        assert_eq!(unit("mm").to(unit("g/cm2")), None);
    }
}
