//! Phase of the solar cycle → protons of galactic cosmic rays at 1 AU.
//!
//! The force-field model of Gleeson & Axford 1968 (ApJ 154, 1011) with the local interstellar spectrum of Burger et al. 2000 (J.
//! Geophys. Res. 105, 27447) in the form of Usoskin et al. 2005 (J. Geophys. Res. 110, A12108). With m the proton's rest energy and
//! T in GeV:
//!
//! ```text
//! J₀(T) = 1.9e4 P^−2.78/(1 + 0.4866 P^−2.51)     P = √(T (T + 2m))     per m² s sr GeV
//! J(T, φ) = J₀(T + φ) T (T + 2m)/[(T + φ)(T + φ + 2m)]
//! ```
//!
//! φ = 0.44 GV reproduces the CREME-96 spectrum of the minimum of 1977 to 10 % between 0.1 and 5 GeV.

use std::f64::consts::PI;
use std::sync::LazyLock;

use super::SECONDS_PER_YEAR;
use super::spectrum::Spectrum;

/// Rest energy of the proton, GeV.
const REST_GEV: f64 = 0.938_272;

/// Modulation (GV) at solar minimum and at maximum: rounded from the series of Usoskin et al., 0.3 to 0.45 and 0.7 to 1.1.
pub const MODULATION_GV: (f64, f64) = (0.40, 0.85);

/// Smallest and largest modulation (GV) of five solar minima, and of five maxima, 1954 to 2000: Usoskin et al. 2005.
pub const MODULATION_RANGES_GV: [(f64, f64); 2] = [(0.30, 0.45), (0.70, 1.10)];

/// Range of energies (MeV) of the spectrum.
const ENERGIES_MEV: (f64, f64) = (1.0, 1e5);

/// Rigidity (GV) of a proton of an energy (MeV).
pub(super) fn rigidity_gv(energy_mev: f64) -> f64 {
    let energy = energy_mev / 1000.0;
    (energy * (energy + 2.0 * REST_GEV)).sqrt()
}

/// Flux of protons of an energy (MeV) at a modulation (GV), per m² s sr GeV.
pub fn flux_m2_s_sr_gev(energy_mev: f64, modulation_gv: f64) -> f64 {
    let energy = energy_mev / 1000.0;
    let square = |energy: f64| energy * (energy + 2.0 * REST_GEV);
    let outside = energy + modulation_gv;
    let rigidity = square(outside).sqrt();
    let interstellar = 1.9e4 * rigidity.powf(-2.78) / (1.0 + 0.4866 * rigidity.powf(-2.51));
    interstellar * square(energy) / square(outside)
}

/// Modulation (GV) at a phase of the solar cycle (0 at minimum, ½ at maximum).
pub fn modulation_gv(phase: f64) -> f64 {
    let (minimum, maximum) = MODULATION_GV;
    0.5 * (minimum + maximum) - 0.5 * (maximum - minimum) * (2.0 * PI * phase).cos()
}

/// Energy (MeV) above which protons of cosmic rays are counted in their rate: those that cross a spacecraft and make showers in it.
const COUNTED_MEV: f64 = 1000.0;

/// Rate of cosmic rays at a modulation (GV), over that at the mean of a cycle: protons above 1 GeV.
pub fn relative_rate(modulation_gv: f64) -> f64 {
    const STEP_GV: f64 = 0.05;
    static RATES: LazyLock<Vec<f64>> = LazyLock::new(|| {
        let rate = |modulation_gv: f64| yearly(modulation_gv).above(COUNTED_MEV);
        let mean = rate(0.5 * (MODULATION_GV.0 + MODULATION_GV.1));
        (0..=60).map(|step| rate(STEP_GV * f64::from(step)) / mean).collect()
    });
    let place = (modulation_gv / STEP_GV).clamp(0.0, (RATES.len() - 2) as f64);
    let (before, share) = (place.floor() as usize, place.fract());
    RATES[before] + share * (RATES[before + 1] - RATES[before])
}

/// Omnidirectional fluence of a year at a modulation (GV), cm⁻².
pub fn yearly(modulation_gv: f64) -> Spectrum {
    // 4π sr, m² → cm², GeV → MeV
    let scale = 4.0 * PI * 1e-4 * 1e-3 * SECONDS_PER_YEAR;
    Spectrum::of_differential(
        |energy_mev| scale * flux_m2_s_sr_gev(energy_mev, modulation_gv),
        ENERGIES_MEV.0,
        ENERGIES_MEV.1,
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_flux_is_that_of_the_formula_worked_out_elsewhere() {
        // `orbit/oracle-public.csv` P33 and P34, to their printed digits.
        assert_eq!(format!("{:.0}", flux_m2_s_sr_gev(1000.0, 0.44)), "1219");
        assert_eq!(format!("{:.1}", flux_m2_s_sr_gev(200.0, 0.9)), "417.6");
    }

    /// The default of `uncertainty.cosmic_ray_modulation`: the mean range of five normal deviates is 2.326 standard deviations
    /// (Tippett 1925, Biometrika 17, 364).
    #[test]
    fn the_modulation_scatters_from_cycle_to_cycle_as_it_did() {
        let sigmas = MODULATION_RANGES_GV.map(|(least, greatest)| (greatest / least).ln() / 2.326);
        let (minima, maxima) = (sigmas[0], sigmas[1]);
        assert!((0.5 * (minima + maxima) - 0.18).abs() < 0.01, "{minima} {maxima}");
        // The values of the model lie within.
        let (minimum, maximum) = MODULATION_GV;
        let inside = |value: f64, (least, greatest): (f64, f64)| value > least && value < greatest;
        assert!(inside(minimum, MODULATION_RANGES_GV[0]) && inside(maximum, MODULATION_RANGES_GV[1]));
    }

    #[test]
    fn the_rate_is_that_of_the_spectrum() {
        assert!((relative_rate(0.625) - 1.0).abs() < 1e-3);
        for modulation_gv in [0.262, 0.4, 0.91, 1.5] {
            let exact = yearly(modulation_gv).above(1000.0) / yearly(0.625).above(1000.0);
            assert!((relative_rate(modulation_gv) / exact - 1.0).abs() < 2e-3, "{modulation_gv}");
        }
    }

    #[test]
    fn the_modulation_is_least_at_solar_minimum() {
        assert!((modulation_gv(0.0) - 0.40).abs() < 1e-12 && (modulation_gv(0.5) - 0.85).abs() < 1e-12);
        assert!(yearly(0.4).above(100.0) > yearly(0.85).above(100.0));
        // Above about 20 GeV the Sun has no effect.
        assert!((yearly(0.4).above(4e4) / yearly(0.85).above(4e4) - 1.0).abs() < 0.05);
    }
}
