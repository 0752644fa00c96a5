//! Protons of the inner radiation belt.

use ctiplan_magnetosphere::{Activity, Elements, trapped_protons};

use super::{Card, Place, Setting, Source, Stream, When};
use crate::environment::SECONDS_PER_YEAR;
use crate::environment::solar_cycle::Phase;
use crate::environment::spectrum::{Law, Spectrum};
use crate::numeric::recent::Recent;

pub(super) struct TrappedProtons;

/// Delay (yr) of the trapped protons relative to the Sun: 430 d, that of the damage of the low-orbit camera of Massey et al. 2025.
const LAG_YR: f64 = 430.0 / 365.25;

impl Source for TrappedProtons {
    fn card(&self) -> &'static Card {
        &Card {
            name: "trapped-protons",
            what: "protons of the inner radiation belt",
            law: "AP-8 MIN and AP-8 MAX, each with its own model of the magnetic field, averaged over the orbit; interpolated between the \
                  two over the solar cycle, with a delay of 430 d",
            range: "0.1 to 400 MeV; a factor of 2 anywhere, more below 500 km, where the flux doubles in 50 to 70 km; east-west \
                    asymmetry is averaged out; no storm belts",
            citation: "Sawyer & Vette 1976 (NSSDC/WDC-A-R&S 76-06); Daly et al. 1996 (IEEE Trans. Nucl. Sci. 43, 2771); fields: \
                       Jensen & Cain 1962, Cain et al. 1967; lag: Massey et al. 2025 (arXiv:2509.05057)",
        }
    }

    fn reaches(&self, place: &Place) -> bool {
        matches!(place, Place::Earth(_))
    }

    fn streams(&self, setting: &Setting) -> Vec<Stream> {
        let Place::Earth(elements) = &setting.place else { return Vec::new() };
        let share = |sign: f64| When::Cycle { cosines: vec![0.5, 0.5 * sign], phase: Phase { lag_yr: LAG_YR } };
        [(Activity::Minimum, 1.0), (Activity::Maximum, -1.0)]
            .into_iter()
            .map(|(activity, sign)| Stream { yearly: averaged(elements, activity).yearly, when: share(sign) })
            .collect()
    }
}

/// Mean over an orbit.
#[derive(Clone, Debug)]
pub struct Averaged {
    /// Omnidirectional fluence per year, cm⁻².
    pub yearly: Spectrum,
    /// Estimated relative error of the mean.
    pub relative_error: f64,
}

/// Mean over an orbit. It takes half a second, and fits and studies need it repeatedly for few orbits.
pub fn averaged(elements: &Elements, activity: Activity) -> Averaged {
    static KNOWN: Recent<(Elements, Activity), Averaged> = Recent::new(32);
    KNOWN.get((*elements, activity), |(elements, activity)| {
        let mean = trapped_protons(elements, *activity);
        let yearly = mean.flux_cm2_s.iter().map(|flux| flux * SECONDS_PER_YEAR);
        let nodes: Vec<(f64, f64)> = mean.energies_mev.iter().copied().zip(yearly).collect();
        Averaged { yearly: Spectrum::of(nodes, Law::Exponential), relative_error: mean.relative_error }
    })
}
