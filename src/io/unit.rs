//! Units as files state them → ours: the one converter of all tables.
//!
//! Products and quotients are read in the spellings of astropy (`MeV / g`, `1 / (MeV cm2)`, `1e-05`), of SPENVIS
//! (`cm!u-2!n s!u-1!n (MeV/n)!u-1!n`, the superscripts of IDL) and of OMERE (`/(MeV.cm2)`, `cm-2.s-1`). A `/` divides by the next
//! factor only. Energy per nucleon is energy: nucleons and counted particles have no unit here. Electrons, pixels, digital numbers
//! and counts are units of their own, since none of them can be turned into another without a gain or an exposure.

use std::f64::consts::PI;
use std::iter::Peekable;
use std::str::Chars;

/// Seconds in a year of 365.25 d.
pub(crate) const YEAR_S: f64 = 31_557_600.0;

/// factor · cm^a s^b rad^c MeV^d g^e K^f e-^g px^h DN^i ct^j
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Unit {
    pub factor: f64,
    /// Powers of the units above, in their order.
    pub powers: [i32; DIMENSIONS],
}

const DIMENSIONS: usize = 10;

/// Names of units, their values in units of [`Unit`], and the index and power of that unit. A year is 365.25 d.
const NAMES: [(&str, f64, usize, i32); 56] = [
    ("cm", 1.0, 0, 1),
    ("m", 100.0, 0, 1),
    ("s", 1.0, 1, 1),
    ("sec", 1.0, 1, 1),
    ("second", 1.0, 1, 1),
    ("seconds", 1.0, 1, 1),
    ("min", 60.0, 1, 1),
    ("h", 3600.0, 1, 1),
    ("hr", 3600.0, 1, 1),
    ("hrs", 3600.0, 1, 1),
    ("hour", 3600.0, 1, 1),
    ("hours", 3600.0, 1, 1),
    ("d", 86_400.0, 1, 1),
    ("day", 86_400.0, 1, 1),
    ("days", 86_400.0, 1, 1),
    ("wk", 604_800.0, 1, 1),
    ("week", 604_800.0, 1, 1),
    ("weeks", 604_800.0, 1, 1),
    ("month", YEAR_S / 12.0, 1, 1),
    ("months", YEAR_S / 12.0, 1, 1),
    ("yr", YEAR_S, 1, 1),
    ("a", YEAR_S, 1, 1),
    ("year", YEAR_S, 1, 1),
    ("years", YEAR_S, 1, 1),
    ("deg", PI / 180.0, 2, 1),
    ("degree", PI / 180.0, 2, 1),
    ("degrees", PI / 180.0, 2, 1),
    ("arcmin", PI / 10_800.0, 2, 1),
    ("arcsec", PI / 648_000.0, 2, 1),
    ("sr", 1.0, 2, 2),
    ("ster", 1.0, 2, 2),
    ("eV", 1e-6, 3, 1),
    ("g", 1.0, 4, 1),
    ("K", 1.0, 5, 1),
    ("Kelvin", 1.0, 5, 1),
    ("kelvin", 1.0, 5, 1),
    ("e", 1.0, 6, 1),
    ("electron", 1.0, 6, 1),
    ("electrons", 1.0, 6, 1),
    ("ke", 1e3, 6, 1),
    ("px", 1.0, 7, 1),
    ("pix", 1.0, 7, 1),
    ("pixel", 1.0, 7, 1),
    ("pixels", 1.0, 7, 1),
    ("row", 1.0, 7, 1),
    ("rows", 1.0, 7, 1),
    ("DN", 1.0, 8, 1),
    ("dn", 1.0, 8, 1),
    ("adu", 1.0, 8, 1),
    ("ADU", 1.0, 8, 1),
    ("ct", 1.0, 9, 1),
    ("count", 1.0, 9, 1),
    ("counts", 1.0, 9, 1),
    ("%", 0.01, 0, 0),
    ("percent", 0.01, 0, 0),
    ("ppm", 1e-6, 0, 0),
];

/// Units that may have a prefix.
const WITH_PREFIX: [&str; 7] = ["m", "s", "eV", "g", "K", "yr", "electron"];

/// Prefixes. (The two signs for micro are those of Latin-1 and of the Greek alphabet.)
const PREFIXES: [(&str, f64); 10] = [
    ("T", 1e12),
    ("G", 1e9),
    ("M", 1e6),
    ("k", 1e3),
    ("m", 1e-3),
    ("u", 1e-6),
    ("\u{b5}", 1e-6),
    ("\u{3bc}", 1e-6),
    ("n", 1e-9),
    ("p", 1e-12),
];

/// Counted items, which have no unit.
const COUNTED: [&str; 9] = ["particles", "protons", "nuclei", "ions", "p", "n", "u", "nuc", "nucleon"];

/// Temperatures that do not begin at 0 K.
const CELSIUS: [&str; 5] = ["deg_C", "degC", "Celsius", "celsius", "°C"];
const CELSIUS_0_K: f64 = 273.15;

/// Units of ionising dose.
pub(crate) const IONISING: [&str; 7] = ["rad", "krad", "mrad", "gy", "kgy", "mgy", "cgy"];

/// Units to mention in messages, by ours.
const EXAMPLES: [(&str, &str); 11] = [
    ("yr", "yr, d, h, min, s"),
    ("d", "d, yr, h, min, s"),
    ("ms", "ms, s, us, ns, min"),
    ("MeV/g", "MeV/g, keV/g, GeV/g, TeV/g, MeV/kg"),
    ("MeV/g/yr", "MeV/g/yr, MeV/g/d, keV/g/s"),
    ("MeV", "MeV, keV, GeV"),
    ("mm", "mm, um, cm, m"),
    ("g/cm2", "g/cm2, kg/m2, mg/cm2"),
    ("K", "K, mK, deg_C"),
    ("e-", "e-, electron, ke-"),
    ("px", "px, pix, pixel, rows"),
];

/// Maximum length of a unit, which limits nested brackets.
const LONGEST: usize = 80;

/// ours = factor · theirs + offset
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Conversion {
    factor: f64,
    offset: f64,
}

/// The identity.
impl Default for Conversion {
    fn default() -> Conversion {
        Conversion { factor: 1.0, offset: 0.0 }
    }
}

impl Conversion {
    pub fn apply(self, theirs: f64) -> f64 {
        self.factor * theirs + self.offset
    }

    /// Conversion of a difference.
    pub fn scale(self, theirs: f64) -> f64 {
        self.factor * theirs
    }
}

/// The conversion from the unit in a file to the first of `ours`, an empty one of which is that of a pure number; the identity if
/// the file states none. The others of `ours` stand for the same number: an electron per pixel is an electron in a pixel.
///
/// # Errors
/// The fault of the unit, and what to try.
pub(crate) fn conversion(given: Option<&str>, ours: &[&str]) -> Result<Conversion, (String, Option<&'static str>)> {
    let Some(given) = given.map(str::trim).filter(|given| !given.is_empty() && !ours.contains(given)) else {
        return Ok(Conversion::default());
    };
    let first = ours.first().copied().unwrap_or("");
    if first == "K" && CELSIUS.contains(&given) {
        return Ok(Conversion { factor: 1.0, offset: CELSIUS_0_K });
    }
    let theirs = Unit::parse(given);
    let factor = theirs.and_then(|theirs| ours.iter().find_map(|ours| theirs.to(Unit::parse(ours)?)));
    match factor {
        Some(factor) => Ok(Conversion { factor, offset: 0.0 }),
        None => {
            let into = if first.is_empty() { "a pure number" } else { first };
            let problem = format!("the unit \"{given}\" cannot be converted to {into}; allowed: {}", allowed(ours));
            Err((problem, advice(given, ours)))
        }
    }
}

/// Units that a column may have, in words.
fn allowed(ours: &[&str]) -> String {
    let example = |ours: &&str| match EXAMPLES.iter().find(|(known, _)| known == ours) {
        Some((_, examples)) => (*examples).to_string(),
        None if ours.is_empty() => "none, %".to_string(),
        None => (*ours).to_string(),
    };
    ours.iter().map(example).collect::<Vec<_>>().join(", ")
}

/// What to try in place of a unit that needs to be converted with what the file does not say.
fn advice(given: &str, ours: &[&str]) -> Option<&'static str> {
    let lower = given.to_lowercase();
    let has = |words: &[&str]| lower.split(|c: char| !c.is_alphabetic()).any(|word| words.contains(&word));
    let is = |unit: &str| ours.contains(&unit);
    if ours.iter().any(|ours| ours.starts_with("MeV/g")) && has(&IONISING) {
        Some("displacement damage dose is needed: ionising dose cannot be converted without the spectrum")
    } else if is("e-") && has(&["adu", "dn", "ct", "count", "counts"]) {
        Some("multiply by the gain, e- per DN")
    } else if is("e-") && has(&["jy", "mjy", "ujy", "njy", "nmgy", "mag", "abmag", "maggy"]) {
        Some("convert with the zero point, the gain and the time of exposure")
    } else if is("e-") && has(&["s", "pix", "pixel", "px"]) {
        Some("the charge of the whole object in one exposure is needed")
    } else if is("px") && has(&["arcsec", "mas", "arcmin", "deg", "rad"]) {
        Some("divide by the width of a pixel, arcsec per px")
    } else if is("px") && has(&["m", "um", "mm"]) {
        Some("divide by the width of a pixel")
    } else {
        None
    }
}

impl Unit {
    pub const MEV: Unit = Unit { factor: 1.0, powers: [0, 0, 0, 1, 0, 0, 0, 0, 0, 0] };
    pub const PURE: Unit = Unit { factor: 1.0, powers: [0; DIMENSIONS] };

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

    fn of_name(name: &str) -> Option<Unit> {
        let known = |name: &str| NAMES.iter().find(|(known, ..)| *known == name).copied();
        let with_prefix = || {
            let (prefix, factor) = PREFIXES
                .iter()
                .find(|(prefix, _)| name.strip_prefix(prefix).is_some_and(|base| WITH_PREFIX.contains(&base)))?;
            let (name, base, place, power) = known(name.strip_prefix(prefix)?)?;
            Some((name, factor * base, place, power))
        };
        if CELSIUS.contains(&name) {
            return None;
        }
        match known(name).or_else(with_prefix) {
            Some((_, factor, place, power)) => {
                let mut powers = [0; DIMENSIONS];
                powers[place] = power;
                Some(Unit { factor, powers })
            }
            None => COUNTED.contains(&name).then_some(Unit::PURE),
        }
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
            '0'..='9' => Unit { factor: number(rest)?, ..Unit::PURE },
            _ => {
                let unit = Unit::of_name(&word(rest))?;
                // A power in brackets, which is a fraction: electron(1/2).
                if rest.peek() == Some(&'(') {
                    return None;
                }
                unit
            }
        };
        unit = unit.times(factor, sign * power(rest)?);
        sign = 1;
    }
    Some(unit)
}

/// A scale, such as 1000 or 1e-05; above 0.
fn number(rest: &mut Peekable<Chars>) -> Option<f64> {
    let mut digits = String::new();
    let take = |rest: &mut Peekable<Chars>, digits: &mut String| {
        while let Some(digit) = rest.next_if(|c| c.is_ascii_digit() || *c == '.') {
            digits.push(digit);
        }
    };
    take(rest, &mut digits);
    let mut ahead = rest.clone();
    if ahead.next_if(|c| matches!(c, 'e' | 'E')).is_some() {
        let sign = ahead.next_if(|c| matches!(c, '+' | '-'));
        if ahead.peek().is_some_and(char::is_ascii_digit) {
            digits.push('e');
            digits.extend(sign);
            *rest = ahead;
            take(rest, &mut digits);
        }
    }
    digits.parse().ok().filter(|number: &f64| number.is_finite() && *number > 0.0)
}

fn word(rest: &mut Peekable<Chars>) -> String {
    let mut word = String::new();
    while let Some(letter) = rest.next_if(|letter| letter.is_alphabetic() || matches!(letter, '_' | '%' | '°')) {
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
            ("1e+06 MeV / g", "TeV/g"),
            ("10**3 electron", "ke-"),
            ("e-/px", "electron / pix"),
        ];
        for (one, other) in same {
            let (one, other) = (Unit::parse(one).unwrap(), Unit::parse(other).unwrap());
            assert!((one.to(other).unwrap() - 1.0).abs() < 1e-14, "{one:?} {other:?}");
        }
        for wrong in ["rad", "Gy", "MeV(", "cm)", "cm^x", "0 cm", "cm^99999999999", "electron(1/2)", "deg_C", "Jy"] {
            assert_eq!(Unit::parse(wrong), None, "{wrong}");
        }
        assert_eq!(Unit::parse(" "), Some(Unit::PURE));
    }

    #[test]
    fn a_unit_is_converted_into_one_of_its_kind() {
        let unit = |text| Unit::parse(text).unwrap();
        assert_eq!(unit("MeV/kg").to(unit("MeV/g")), Some(1e-3));
        assert_eq!(unit("days").to(unit("s")), Some(86_400.0));
        assert_eq!(unit("mm").to(unit("g/cm2")), None);
        for (ours, examples) in EXAMPLES {
            for example in examples.split(", ") {
                assert!(conversion(Some(example), &[ours]).is_ok(), "{example} to {ours}");
            }
        }
    }

    #[test]
    fn units_are_converted_or_refused() {
        let converted = |ours: &str, given: &str, number: f64| conversion(Some(given), &[ours]).unwrap().apply(number);
        assert_eq!(converted("ms", "s", 0.025), 25.0);
        assert!((converted("K", "deg_C", -140.15) - 133.0).abs() < 1e-9);
        assert_eq!(converted("MeV/g", "MeV / g", 2.0), 2.0);
        assert_eq!(converted("yr", "d", 730.5), 2.0);
        assert_eq!(conversion(None, &["e-"]).unwrap().apply(3.0), 3.0);
        for (ours, given) in [("MeV/g", "krad"), ("e-", "adu"), ("e-", "electron/pix"), ("K", "deg"), ("ms", "m")] {
            assert!(conversion(Some(given), &[ours]).is_err(), "{given}");
        }
        assert!(conversion(Some("krad"), &["MeV/g"]).unwrap_err().1.unwrap().contains("ionising"));
    }
}
