//! What can be measured.

use std::fmt;

use serde::ser::{Serialize, Serializer};

/// A quantity that measurement files hold and the model predicts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Observable {
    /// Cumulative dose since launch, MeV/g.
    Dose,
    /// Charge in a pixel behind a lone packet, less the trailed background, over the packet's charge before transfer.
    Trail,
    /// Charge read in a lone packet's own pixel, less the trailed background, e-.
    PacketCharge,
    /// Charge in a pixel behind a flat block, less the background, e-.
    Eper,
    /// Change of a galaxy's e1.
    DeltaE1,
    /// Change of a galaxy's centroid along y, px.
    DeltaY,
    /// Change of a galaxy's weighted flux, as a fraction of it.
    DeltaFlux,
    /// Change of a galaxy's size, as a fraction of it.
    DeltaSize,
}

use Observable::{DeltaE1, DeltaFlux, DeltaSize, DeltaY, Dose, Eper, PacketCharge, Trail};

impl Observable {
    /// All of them.
    pub const ALL: [Observable; 8] = [Dose, Trail, PacketCharge, Eper, DeltaE1, DeltaY, DeltaFlux, DeltaSize];

    /// Name in measurement files.
    pub fn name(self) -> &'static str {
        match self {
            Dose => "dose",
            Trail => "trail",
            PacketCharge => "packet_charge",
            Eper => "eper",
            DeltaE1 => "delta_e1",
            DeltaY => "delta_y",
            DeltaFlux => "delta_flux",
            DeltaSize => "delta_size",
        }
    }

    /// Unit of its values; empty for pure numbers.
    pub fn unit(self) -> &'static str {
        match self {
            Dose => "MeV/g",
            PacketCharge | Eper => "e-",
            DeltaY => "px",
            Trail | DeltaE1 | DeltaFlux | DeltaSize => "",
        }
    }

    /// Conditions that must be known for it, besides those that the mission knows.
    pub fn requires(self) -> &'static [&'static str] {
        match self {
            Dose => &["t_yr"],
            Trail => &["trail_px", "signal_e"],
            PacketCharge => &["signal_e"],
            Eper => &["trail_px", "signal_e", "block_px"],
            DeltaE1 | DeltaY | DeltaFlux | DeltaSize => &["galaxy"],
        }
    }

    /// Whether it is a change of a galaxy's shape.
    pub fn is_shape(self) -> bool {
        matches!(self, DeltaE1 | DeltaY | DeltaFlux | DeltaSize)
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
