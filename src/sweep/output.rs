//! Quantities that a sweep records for each point.

/// A quantity of one point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Output {
    /// Dose since launch at the end of the mission, MeV/g.
    Dose,
    /// Active time of the mission, yr.
    ActiveYears,
    /// |Δe| of the judged galaxy at the end of the mission.
    DeltaE,
    /// When the first of all budgets is exceeded without correction, years since launch.
    ExceededUncorrected,
    /// When the first of all budgets is exceeded with correction, years since launch.
    ExceededCorrected,
    /// Additive shear bias of the population at the end of the mission: absolute value of its larger component.
    AdditiveBias,
    /// The same for the multiplicative shear bias.
    MultiplicativeBias,
    /// When the budget of |Δe| is exceeded without correction, years since launch.
    ExceededDeltaE,
    /// The same for the additive shear bias.
    ExceededAdditive,
    /// The same for the multiplicative shear bias.
    ExceededMultiplicative,
    /// Limit minus |Δe| at the end of the mission, without correction.
    MarginUncorrected,
    /// Limit times the correction factor minus |Δe| at the end of the mission.
    MarginCorrected,
    /// d|Δe|/dt just after launch, per yr.
    RateAtLaunch,
    /// |Δe| at the end of the mission over its duration, per yr.
    MeanRate,
    /// Probability that all uncorrected budgets are met until the end, with the Sun and `[uncertainty]` drawn, here and below.
    ProbabilityMetUncorrected,
    /// Probability that all corrected budgets are met until the end.
    ProbabilityMetCorrected,
    /// How long all uncorrected budgets are met with a probability of 90 %, years since launch.
    KeptUncorrected,
    /// The same for the corrected budgets.
    KeptCorrected,
    /// Change of e1 of every galaxy at the end of the mission.
    DeltaE1,
    /// Change of the centroid of every galaxy along y, px.
    DeltaY,
    /// Relative change of the size of every galaxy.
    DeltaSize,
    /// Relative change of the flux of every galaxy.
    DeltaFlux,
}

use Output::{
    ActiveYears, AdditiveBias, DeltaE, DeltaE1, DeltaFlux, DeltaSize, DeltaY, Dose, ExceededAdditive,
    ExceededCorrected, ExceededDeltaE, ExceededMultiplicative, ExceededUncorrected, KeptCorrected, KeptUncorrected,
    MarginCorrected, MarginUncorrected, MeanRate, MultiplicativeBias, ProbabilityMetCorrected,
    ProbabilityMetUncorrected, RateAtLaunch,
};

/// Where a point without a value stands among the others: what is undefined has a place in the order wherever it means something.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Undefined {
    /// Below all values: a margin of a shape that is lost.
    Below,
    /// Nowhere: quantiles are those of the points that have a value.
    Apart,
    /// Above all values: a change or a bias of shapes that are lost.
    Above,
    /// Later than all dates: a budget that is kept to the end of the mission.
    Later,
}

impl Output {
    /// All of them.
    pub const ALL: [Output; 22] = [
        Dose,
        ActiveYears,
        DeltaE,
        ExceededUncorrected,
        ExceededCorrected,
        AdditiveBias,
        MultiplicativeBias,
        ExceededDeltaE,
        ExceededAdditive,
        ExceededMultiplicative,
        MarginUncorrected,
        MarginCorrected,
        RateAtLaunch,
        MeanRate,
        ProbabilityMetUncorrected,
        ProbabilityMetCorrected,
        KeptUncorrected,
        KeptCorrected,
        DeltaE1,
        DeltaY,
        DeltaSize,
        DeltaFlux,
    ];

    /// Quantities recorded by default.
    pub const USUAL: [Output; 4] = [Dose, DeltaE, ExceededUncorrected, ExceededCorrected];

    /// Name in grid files and of the column.
    pub fn name(self) -> &'static str {
        match self {
            Dose => "dose_mev_g",
            ActiveYears => "active_yr",
            DeltaE => "delta_e",
            ExceededUncorrected => "exceeded_yr",
            ExceededCorrected => "exceeded_corrected_yr",
            AdditiveBias => "c",
            MultiplicativeBias => "m",
            ExceededDeltaE => "exceeded_delta_e_yr",
            ExceededAdditive => "exceeded_c_yr",
            ExceededMultiplicative => "exceeded_m_yr",
            MarginUncorrected => "margin_delta_e",
            MarginCorrected => "margin_corrected_delta_e",
            RateAtLaunch => "rate_at_launch_per_yr",
            MeanRate => "mean_rate_per_yr",
            ProbabilityMetUncorrected => "probability_met",
            ProbabilityMetCorrected => "probability_met_corrected",
            KeptUncorrected => "kept_90_yr",
            KeptCorrected => "kept_corrected_90_yr",
            DeltaE1 => "delta_e1",
            DeltaY => "delta_y_px",
            DeltaSize => "delta_size",
            DeltaFlux => "delta_flux",
        }
    }

    /// Whether it is estimated from draws of the Sun and of `[uncertainty]`.
    pub fn is_drawn(self) -> bool {
        matches!(self, ProbabilityMetUncorrected | ProbabilityMetCorrected | KeptUncorrected | KeptCorrected)
    }

    /// Whether it is determined by all budgets together, if shear biases are limited.
    pub fn is_judged(self) -> bool {
        self.is_drawn()
            || matches!(
                self,
                ExceededUncorrected
                    | ExceededCorrected
                    | AdditiveBias
                    | MultiplicativeBias
                    | ExceededAdditive
                    | ExceededMultiplicative
            )
    }

    /// Where points without a value of it stand among the others.
    pub fn undefined(self) -> Undefined {
        match self {
            ExceededUncorrected
            | ExceededCorrected
            | ExceededDeltaE
            | ExceededAdditive
            | ExceededMultiplicative
            | KeptUncorrected
            | KeptCorrected => Undefined::Later,
            DeltaE | AdditiveBias | MultiplicativeBias | MeanRate => Undefined::Above,
            MarginUncorrected | MarginCorrected => Undefined::Below,
            Dose
            | ActiveYears
            | RateAtLaunch
            | ProbabilityMetUncorrected
            | ProbabilityMetCorrected
            | DeltaE1
            | DeltaY
            | DeltaSize
            | DeltaFlux => Undefined::Apart,
        }
    }

    /// Whether there is a column of it for every galaxy.
    pub fn of_galaxies(self) -> bool {
        matches!(self, DeltaE1 | DeltaY | DeltaSize | DeltaFlux)
    }
}
