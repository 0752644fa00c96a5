//! Protons of the inner radiation belt.

use ctiplan_magnetosphere::{Activity, Elements, trapped_protons};

use super::{Card, NEVER, Place, Setting, Source, Stream, When, on_line, series};
use crate::environment::SECONDS_PER_YEAR;
use crate::environment::solar_cycle::Phase;
use crate::environment::spectrum::{Law, Spectrum};
use crate::numeric::recent::Recent;

pub(super) struct TrappedProtons;

/// Delay (yr) of the trapped protons relative to the Sun: 430 d, that of the damage of the low-orbit camera in Massey et al. 2025. The
/// fit to its 176 dates allows any of 50 to 450 d within a chi2 of 2.6 of its best.
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
        let phase = Phase { lag_yr: LAG_YR };
        let shares = setting.observed.as_ref().map_or(Vec::new(), |sun| sun.share_of_minimum(LAG_YR));
        let flown = Flown { orbits: &setting.orbits, shares: &shares, phase };
        let last = setting.orbits.last().map_or(elements, |(_, elements)| elements);
        let maps = [(Activity::Minimum, 1.0), (Activity::Maximum, -1.0)];
        let as_flown = maps.iter().flat_map(|(activity, sign)| flown.streams(elements, *activity, *sign));
        let by_law = maps.iter().map(|(activity, sign)| Stream {
            yearly: averaged(last, *activity).yearly,
            when: When::Cycle { cosines: vec![0.5, 0.5 * sign], phase, except: flown.span() },
        });
        by_law.chain(as_flown).collect()
    }
}

/// The part of a mission in which the orbit changed, or the Sun was observed.
struct Flown<'a> {
    /// Elements at years, in order; empty if they do not change.
    orbits: &'a [(f64, Elements)],
    /// Share of AP-8 MIN at years, in order; empty if the Sun was not observed.
    shares: &'a [(f64, f64)],
    /// The phase that gives this share at other times.
    phase: Phase,
}

/// Time (yr) between two values of a share.
const STEP_YR: f64 = 1.0 / 12.0;

impl Flown<'_> {
    /// Start and end; without orbits that change, those of the observed Sun.
    fn span(&self) -> [f64; 2] {
        let ends = |years: &mut dyn Iterator<Item = f64>| {
            years.fold(None, |ends: Option<[f64; 2]>, year| Some(ends.map_or([year; 2], |[from, _]| [from, year])))
        };
        let orbits = ends(&mut self.orbits.iter().map(|known| known.0));
        let shares = ends(&mut self.shares.iter().map(|known| known.0));
        match (orbits, shares) {
            (None, None) => NEVER,
            (None, Some(shares)) => shares,
            (Some(orbits), None) => orbits,
            (Some([from, to]), Some(shares)) => [from, to.max(shares[1])],
        }
    }

    /// Streams of one map: for each of the elements, between which the flux changes linearly in time.
    fn streams(&self, fixed: &Elements, activity: Activity, sign: f64) -> Vec<Stream> {
        let [from, to] = self.span();
        if from >= to {
            return Vec::new();
        }
        let steps = ((to - from) / STEP_YR).ceil() as usize;
        let mut years: Vec<f64> = (0..=steps).map(|step| from + (to - from) * step as f64 / steps as f64).collect();
        years.extend(self.orbits.iter().map(|known| known.0));
        years.sort_by(f64::total_cmp);
        years.dedup_by(|a, b| *a - *b < 1e-6);
        let share = |year: f64| 0.5 + sign * (self.share_of_minimum(year) - 0.5);
        let of = |elements: &Elements, weight: &dyn Fn(f64) -> f64| {
            let rates: Vec<(f64, f64)> = years.iter().map(|year| (*year, share(*year) * weight(*year))).collect();
            Stream { yearly: averaged(elements, activity).yearly, when: series(&rates) }
        };
        if self.orbits.is_empty() {
            return vec![of(fixed, &|_| 1.0)];
        }
        let hat = |index: usize| {
            let points: Vec<(f64, f64)> = self
                .orbits
                .iter()
                .enumerate()
                .map(|(other, (year, _))| (*year, f64::from(u8::from(other == index))))
                .collect();
            move |year: f64| on_line(&points, year)
        };
        self.orbits.iter().enumerate().map(|(index, (_, elements))| of(elements, &hat(index))).collect()
    }

    /// Share of AP-8 MIN at a year.
    fn share_of_minimum(&self, year: f64) -> f64 {
        let observed = self.shares.first().zip(self.shares.last());
        match observed.filter(|(first, last)| (first.0..=last.0).contains(&year)) {
            Some(_) => on_line(self.shares, year),
            None => self.phase.value(&[0.5, 0.5], year),
        }
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
