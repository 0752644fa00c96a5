//! Units of measurements, as our columns and values have them.

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
    /// Items of a pixel or of a transfer to the next one.
    PerPixel,
    /// Counted pixels or transfers.
    Count,
    Pure,
}

impl Unit {
    /// The unit of an observable's values.
    pub fn of(observable: Observable) -> Unit {
        match observable.unit() {
            "MeV/g" => Unit::Dose,
            "e-" => Unit::Electrons,
            "px" => Unit::Pixels,
            _ if [Observable::TrapDensity, Observable::Cti].contains(&observable) => Unit::PerPixel,
            _ => Unit::Pure,
        }
    }

    /// Units into whose first one files are converted; the others stand for the same number. A charge is that in one pixel.
    pub fn ours(self) -> &'static [&'static str] {
        match self {
            Unit::Years => &["yr"],
            Unit::Days => &["d"],
            Unit::Dose => &["MeV/g"],
            Unit::Kelvin => &["K"],
            Unit::Milliseconds => &["ms"],
            Unit::Electrons => &["e-", "e-/px"],
            Unit::Pixels => &["px"],
            Unit::PerPixel => &["", "1/px"],
            Unit::Count => &["", "px", "ct"],
            Unit::Pure => &[""],
        }
    }

    pub fn name(self) -> &'static str {
        self.ours()[0]
    }

    /// The unit's name after a number.
    pub fn behind(self) -> String {
        if self.name().is_empty() { String::new() } else { format!(" {}", self.name()) }
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
}
