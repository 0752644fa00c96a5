//! Measurable quantities: the catalogue of observables.
//!
//! Each observable has one file with its complete definition: its name and unit in measurement files, the conditions that it needs,
//! and how it is derived from a readout. To add one: a file beside the others, its `mod` line, its line in `observables!`.

mod cti;
mod delta_e1;
mod delta_flux;
mod delta_size;
mod delta_y;
mod dose;
mod eper;
mod packet_charge;
mod pumping_dipole;
mod trail;
mod trap_density;

use std::fmt;

use serde::ser::{Serialize, Serializer};

pub use pumping_dipole::dipole_e;

use crate::physics::conditions::Conditions;
use crate::physics::shape::ShapeChange;

/// The definition of an observable.
pub struct Card {
    /// Name in measurement files.
    pub name: &'static str,
    /// Unit of its values; empty for pure numbers.
    pub unit: &'static str,
    /// Symbol or words, with the unit, for the axis of a figure.
    pub label: &'static str,
    /// Conditions that a row must give, unless the mission has them.
    pub requires: &'static [&'static str],
    /// All conditions on which it depends, for listings.
    pub conditions: &'static [&'static str],
    /// How it is computed.
    pub probe: Probe,
    /// The smallest 1-sigma error expected of a measurement, in its unit.
    pub least_sigma: f64,
    /// The largest value that makes sense, in its unit; None if any may.
    pub most: Option<f64>,
    /// The likely fault of a model if data show more of it, in absolute value if it has a sign.
    pub more: &'static str,
    /// The likely fault of a model if data show less of it.
    pub less: &'static str,
}

/// The readout for an observable, and the observable as a function of its result.
pub enum Probe {
    /// No readout: the dose behind the traps, MeV/g.
    Dose,
    /// No readout: the traps per pixel, for one species or all.
    Traps,
    /// A lone packet: a function of the charges (e-, minus the trailed background) in its own pixel and in those behind it.
    Packet(fn(&[f64], &Conditions) -> f64),
    /// A flat block: a function of the charges (e-, minus the trailed background) in its last row and in those behind it.
    Block(fn(&[f64], &Conditions) -> f64),
    /// A lone packet, or a flat block if a row gives `block_px`.
    PacketOrBlock {
        /// Function of the charges of a packet, as above.
        packet: fn(&[f64], &Conditions) -> f64,
        /// Function of the charges of a block.
        block: fn(&[f64], &Conditions) -> f64,
    },
    /// A dipole of trap pumping, without a readout: a function of the release time (ms) of the species named in a row.
    Pumping(fn(f64, &Conditions) -> f64),
    /// A galaxy: a member of the change of its shape.
    Galaxy(fn(&mut ShapeChange) -> &mut f64),
}

/// The charge in the pixel requested by a row of measurements (e-).
fn behind(charge_e: &[f64], at: &Conditions) -> f64 {
    charge_e[at.trail_px.expect("a trail has a pixel") as usize]
}

/// Makes the list of observables from their cards.
macro_rules! observables {
    ($($name:ident: $file:ident,)+) => {
        /// A quantity in measurement files that the model predicts.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        pub enum Observable {
            $(#[doc = concat!("`", stringify!($file), "`.")] $name,)+
        }

        impl Observable {
            /// All of them.
            pub const ALL: [Observable; [$(stringify!($name)),+].len()] = [$(Observable::$name),+];

            /// Its definition.
            pub fn card(self) -> &'static Card {
                match self {
                    $(Observable::$name => &$file::CARD,)+
                }
            }
        }
    };
}

observables! {
    Dose: dose,
    TrapDensity: trap_density,
    Cti: cti,
    Trail: trail,
    PacketCharge: packet_charge,
    Eper: eper,
    PumpingDipole: pumping_dipole,
    DeltaE1: delta_e1,
    DeltaY: delta_y,
    DeltaFlux: delta_flux,
    DeltaSize: delta_size,
}

impl Observable {
    /// Name in measurement files.
    pub fn name(self) -> &'static str {
        self.card().name
    }

    /// Unit of its values; empty for pure numbers.
    pub fn unit(self) -> &'static str {
        self.card().unit
    }

    /// The observable with this name.
    pub fn named(name: &str) -> Option<Observable> {
        Observable::ALL.into_iter().find(|observable| observable.name() == name)
    }

    /// Whether it depends on a condition.
    pub fn depends_on(self, condition: &str) -> bool {
        self.card().conditions.contains(&condition)
    }

    /// Whether it is derived from other measurements: it is read from files, but never proposed as a measurement.
    pub fn is_derived(self) -> bool {
        matches!(self.card().probe, Probe::Traps | Probe::Pumping(_) | Probe::PacketOrBlock { .. })
    }

    /// Whether it is a change of a galaxy's shape.
    pub fn is_shape(self) -> bool {
        matches!(self.card().probe, Probe::Galaxy(_))
    }
}

impl fmt::Display for Observable {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.write_str(self.name())
    }
}

impl Serialize for Observable {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        to.serialize_str(self.name())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::physics::conditions::NAMES;

    #[test]
    fn every_card_has_a_name_of_its_own_and_conditions_that_there_are() {
        for (index, observable) in Observable::ALL.into_iter().enumerate() {
            let card = observable.card();
            assert_eq!(Observable::named(card.name), Some(observable));
            assert!(Observable::ALL[..index].iter().all(|other| other.name() != card.name), "{observable}");
            let known = |name: &&&str| NAMES.contains(name) || (observable.is_shape() && **name == "galaxy");
            assert!(card.requires.iter().chain(card.conditions).all(|name| known(&name)), "{observable}");
            let given = |name: &&&str| card.conditions.contains(name) || **name == "galaxy";
            assert!(card.requires.iter().all(|name| given(&name)), "{observable}: what is required matters");
            assert!(card.least_sigma > 0.0 && card.more != card.less, "{observable}");
        }
    }
}
