//! Units of measurement files → ours.

use crate::physics::observable::Observable;

/// A unit of this crate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Unit {
    Years,
    Days,
    Dose,
    Kelvin,
    Milliseconds,
    Electrons,
    Pixels,
    Pure,
}

/// ours = factor · theirs + offset
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Conversion {
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

impl Unit {
    const ALL: [Unit; 8] = [
        Unit::Years,
        Unit::Days,
        Unit::Dose,
        Unit::Kelvin,
        Unit::Milliseconds,
        Unit::Electrons,
        Unit::Pixels,
        Unit::Pure,
    ];

    /// The unit of an observable's values.
    pub fn of(observable: Observable) -> Unit {
        Unit::ALL.into_iter().find(|unit| unit.name() == observable.unit()).expect("a unit of this crate")
    }

    pub fn name(self) -> &'static str {
        match self {
            Unit::Years => "yr",
            Unit::Days => "d",
            Unit::Dose => "MeV/g",
            Unit::Kelvin => "K",
            Unit::Milliseconds => "ms",
            Unit::Electrons => "e-",
            Unit::Pixels => "px",
            Unit::Pure => "",
        }
    }

    /// The unit's name after a number.
    pub fn behind(self) -> String {
        if self == Unit::Pure { String::new() } else { format!(" {}", self.name()) }
    }

    /// Spellings of units equal to this one up to a factor: those of astropy, and common ones.
    fn spellings(self) -> &'static [(&'static str, f64)] {
        match self {
            Unit::Years => &[
                ("yr", 1.0),
                ("year", 1.0),
                ("years", 1.0),
                ("a", 1.0),
                ("d", 1.0 / 365.25),
                ("day", 1.0 / 365.25),
                ("days", 1.0 / 365.25),
                ("h", 1.0 / 8766.0),
                ("s", 1.0 / 31_557_600.0),
            ],
            Unit::Days => &[
                ("d", 1.0),
                ("day", 1.0),
                ("days", 1.0),
                ("yr", 365.25),
                ("h", 1.0 / 24.0),
                ("min", 1.0 / 1440.0),
                ("s", 1.0 / 86_400.0),
            ],
            Unit::Dose => {
                &[("MeV/g", 1.0), ("keV/g", 1e-3), ("GeV/g", 1e3), ("TeV/g", 1e6), ("MeV/kg", 1e-3), ("eV/g", 1e-6)]
            }
            Unit::Kelvin => &[("K", 1.0), ("mK", 1e-3)],
            Unit::Milliseconds => &[("ms", 1.0), ("s", 1e3), ("us", 1e-3), ("µs", 1e-3), ("ns", 1e-6), ("min", 6e4)],
            Unit::Electrons => &[
                ("electron", 1.0),
                ("electrons", 1.0),
                ("e-", 1.0),
                ("e", 1.0),
                ("electron/pix", 1.0),
                ("electron/pixel", 1.0),
                ("e-/px", 1.0),
                ("kelectron", 1e3),
                ("ke-", 1e3),
            ],
            Unit::Pixels => &[("pix", 1.0), ("pixel", 1.0), ("pixels", 1.0), ("px", 1.0), ("row", 1.0), ("rows", 1.0)],
            Unit::Pure => &[("pix", 1.0), ("pixel", 1.0), ("ct", 1.0), ("count", 1.0), ("%", 0.01)],
        }
    }

    /// The conversion from a unit in a file; the identity if there is none.
    ///
    /// # Errors
    /// The fault of the unit, and what to try.
    pub fn from(self, given: Option<&str>) -> Result<Conversion, (String, Option<&'static str>)> {
        let pure = Conversion::default();
        let Some(given) = given.map(|given| given.replace(' ', "")).filter(|given| !given.is_empty()) else {
            return Ok(pure);
        };
        if self == Unit::Kelvin && ["deg_C", "degC", "Celsius", "°C"].contains(&given.as_str()) {
            return Ok(Conversion { factor: 1.0, offset: 273.15 });
        }
        if let Some((_, factor)) = self.spellings().iter().find(|(spelling, _)| *spelling == given) {
            return Ok(Conversion { factor: *factor, ..pure });
        }
        let ionising = ["rad", "krad", "Mrad", "Gy", "kGy", "rad(Si)", "krad(Si)"].contains(&given.as_str());
        let help = match self {
            Unit::Dose if ionising => {
                Some("displacement damage dose is needed: ionising dose cannot be converted without the spectrum")
            }
            Unit::Electrons if ["adu", "DN", "ct", "count"].contains(&given.as_str()) => {
                Some("multiply by the gain, e- per DN")
            }
            _ => None,
        };
        let known = self.spellings().iter().map(|(spelling, _)| *spelling).collect::<Vec<_>>().join(", ");
        Err((format!("the unit \"{given}\" cannot be converted to {}; known: {known}", self.or_none()), help))
    }

    fn or_none(self) -> &'static str {
        if self == Unit::Pure { "a pure number" } else { self.name() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_observable_has_a_unit_that_is_known() {
        for observable in Observable::ALL {
            assert_eq!(Unit::of(observable).name(), observable.unit());
        }
    }

    #[test]
    fn units_are_converted_or_refused() {
        let converted = |unit: Unit, given: &str, number: f64| unit.from(Some(given)).unwrap().apply(number);
        assert_eq!(converted(Unit::Milliseconds, "s", 0.025), 25.0);
        assert!((converted(Unit::Kelvin, "deg_C", -140.15) - 133.0).abs() < 1e-9);
        assert_eq!(converted(Unit::Dose, "MeV / g", 2.0), 2.0);
        assert_eq!(converted(Unit::Years, "d", 730.5), 2.0);
        assert_eq!(Unit::Electrons.from(None).unwrap().apply(3.0), 3.0);
        for (unit, given) in
            [(Unit::Dose, "krad"), (Unit::Electrons, "adu"), (Unit::Kelvin, "deg"), (Unit::Milliseconds, "m")]
        {
            assert!(unit.from(Some(given)).is_err(), "{given}");
        }
        assert!(Unit::Dose.from(Some("krad")).unwrap_err().1.unwrap().contains("ionising"));
    }
}
