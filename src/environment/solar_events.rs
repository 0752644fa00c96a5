//! The Sun as a series of events: random solar proton events of a mission.
//!
//! Events of active years are a Poisson process with a rate w per year. The logarithm of an event's fluence above an energy is
//! normal, with one standard normal z for all energies, such that a year has ESP's mean and relative variance RV at each of them:
//!
//! ```text
//! φ(>E) = exp(μ + z σ)      σ² = ln(w RV)      μ = ln(mean/w) − σ²/2
//! ```
//!
//! w: ECSS-E-ST-10-04C (2008), table I-2. Sums of such events have ESP's mean, but not its quantiles: ESP is not closed under
//! addition, so no independent events reproduce them for all durations. Therefore each sample has a rank: the probability p that a
//! mission with as many active years T has a smaller sum above 30 MeV. In a conversion to fluence or dose, the active events of a
//! sample together receive ESP's total for T and p, and each of them its share ([`SunSample::confidence`]).
//!
//! Events of quiet years are rarer (w ≈ 1.6), smaller (exp μ times 0.55) and scatter less (0.8 σ). ESP does not include them, so
//! they keep their own size. Source: list of solar proton events affecting the Earth environment (NOAA/NCEI), 1976 to July 2026, in
//! which events less than a week apart are merged and peak fluxes replace fluences.
//!
//! The height of a future maximum is not drawn: ESP's distribution includes it. See [`HEIGHTS`].

mod calendar;
mod ranks;

use std::iter;

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Exp1, StandardNormal};

use super::esp::{self, Yearly};
use super::spectrum::Spectrum;
use crate::numeric::parallel;
pub use calendar::{Calendar, Sun};
use ranks::Ranks;

/// Whether the Sun is active or quiet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Activity {
    /// The seven years around a maximum.
    Active,
    /// The other four.
    Quiet,
}

/// Events of an active year, w.
pub const EVENTS_PER_ACTIVE_YR: f64 = 6.15;

/// Maxima of the 13-month smoothed international sunspot number v2.0, cycles 19 to 25 (NOAA/SWPC).
///
/// Events are more frequent in higher cycles, in proportion to the sunspot number, with the same distribution of sizes (Nymmik,
/// Moscow State University, quantitative probabilistic model of the fluxes of solar energetic particles); but their mean fluence is
/// smaller there (Barnard & Lockwood 2011, J. Geophys. Res. 116, A05103, cycles 20 to 23). So even the sign of the effect of height
/// on the fluence of a cycle is unknown. Cycle 24 had a third fewer events than cycle 23, and 4 to 10 times less fluence above 10
/// MeV (Mewaldt et al. 2015, PoS ICRC2015 030).
///
/// ESP is fitted to years of the maxima of three cycles, 20 to 22, whose heights differ. If fluences were proportional to the
/// height, and ESP did not include this, heights would add at most 5 % to the variance of the logarithm of the fluence of a cycle's
/// seven active years above 30 MeV, and 2 % to the standard deviation (a test). Differences as between cycles 23 and 24 are also
/// within ESP's distribution.
pub const HEIGHTS: [f64; 7] = [285.0, 156.6, 232.9, 212.5, 180.3, 116.4, 160.9];

/// Energy (MeV) above which the sum of events determines the rank of a sample.
const RANKED_MEV: f64 = 30.0;

impl Activity {
    /// Mean number of events per year.
    pub fn events_per_yr(self) -> f64 {
        match self {
            Activity::Active => EVENTS_PER_ACTIVE_YR,
            Activity::Quiet => 1.6,
        }
    }

    /// Fluence (cm⁻²) of an event of size z, at an energy with this mean and variance in active years.
    fn fluence(self, yearly: Yearly, z: f64) -> f64 {
        let sigma = (EVENTS_PER_ACTIVE_YR * yearly.relative_variance).ln().sqrt();
        let mu = (yearly.mean_cm2 / EVENTS_PER_ACTIVE_YR).ln() - 0.5 * sigma * sigma;
        match self {
            Activity::Active => (mu + z * sigma).exp(),
            Activity::Quiet => (mu + 0.55_f64.ln() + 0.8 * z * sigma).exp(),
        }
    }

    /// Spectrum at 1 AU of an event whose logarithm is z standard deviations above the mean.
    pub fn event(self, z: f64) -> Spectrum {
        esp::spectrum(|yearly| self.fluence(yearly, z))
    }
}

/// An event.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Event {
    /// Years since launch.
    pub t_yr: f64,
    /// Size: standard deviations above the mean of the logarithm.
    pub z: f64,
    /// Activity of the Sun at this time.
    pub activity: Activity,
}

/// One realisation of the Sun over a mission.
#[derive(Clone, Debug, PartialEq)]
pub struct SunSample {
    /// Active years of the mission; 0 or at least 1, as ESP counts them.
    pub active_years: f64,
    /// Probability p that a mission with this number of active years has a smaller sum of events above 30 MeV. The fluence of all
    /// active events together is ESP's for `active_years` at this confidence.
    pub confidence: f64,
    /// Events: first the active ones, then the quiet ones, each sorted by time.
    pub events: Vec<Event>,
}

/// Samples of the Sun over a mission. The same seed gives the same bits, for any number of threads.
#[derive(Clone, Debug)]
pub struct SolarEvents {
    sun: Sun,
    duration_yr: f64,
    seed: u64,
    /// Active years and rank of each sample.
    ranked: Vec<(f64, f64)>,
}

impl SolarEvents {
    /// Samples of the Sun over a mission of `duration_yr` years. Events are regenerated when a sample is needed, since many samples
    /// of long missions would exhaust the memory.
    pub fn new(sun: Sun, duration_yr: f64, samples: u32, seed: u64) -> SolarEvents {
        let mut events = SolarEvents { sun, duration_yr, seed, ranked: Vec::new() };
        let indices = 0..u64::from(samples);
        let years: Vec<f64> = parallel::map(indices.clone(), |index| esp_years(&events.calendar(index)));
        let nodes = ranks::nodes(&years);
        let last = nodes.last().copied().unwrap_or(0.0);
        let yearly = Yearly::above(RANKED_MEV).expect("an energy of the table");
        let totals = |index: u64| {
            let own = years[index as usize];
            let mut sums = vec![0.0; nodes.len() + 1];
            for (at_yr, z) in events.events(index, Activity::Active, last) {
                let fluence = Activity::Active.fluence(yearly, z);
                for (sum, until_yr) in sums.iter_mut().zip(nodes.iter().chain([&own])) {
                    *sum += if at_yr < *until_yr { fluence } else { 0.0 };
                }
            }
            sums
        };
        let totals: Vec<Vec<f64>> = parallel::map(indices, totals);
        let ranks = Ranks::of(&nodes, &totals);
        events.ranked =
            years.iter().zip(&totals).map(|(years, sums)| (*years, ranks.of_sum(*years, sums[nodes.len()]))).collect();
        events
    }

    /// Number of samples.
    pub fn samples(&self) -> usize {
        self.ranked.len()
    }

    /// Smallest and largest number of active years above 0, as ESP counts them; None if no sample has any.
    pub fn active_years(&self) -> Option<(f64, f64)> {
        let years = || self.ranked.iter().map(|(years, _)| *years).filter(|years| *years > 0.0);
        years().next()?;
        Some((years().fold(f64::INFINITY, f64::min), years().fold(0.0, f64::max)))
    }

    /// Rank of a sample: its [`SunSample::confidence`].
    ///
    /// # Panics
    /// If there are not that many.
    pub fn rank(&self, index: usize) -> f64 {
        self.ranked[index].1
    }

    /// A sample.
    ///
    /// # Panics
    /// If there are not that many.
    pub fn sample(&self, index: usize) -> SunSample {
        let (active_years, confidence) = self.ranked[index];
        let index = index as u64;
        let calendar = self.calendar(index);
        // Less than one active year has the events of a full year.
        let stretch = if active_years > 0.0 { calendar.years(Activity::Active) / active_years } else { 1.0 };
        let of = |activity: Activity, until_yr: f64, stretch: f64| {
            let when = |at_yr: f64| calendar.when(activity, stretch * at_yr);
            let events = self.events(index, activity, until_yr);
            events.map(move |(at_yr, z)| Event { t_yr: when(at_yr), z, activity }).collect::<Vec<_>>()
        };
        let mut events = of(Activity::Active, active_years, stretch);
        events.extend(of(Activity::Quiet, calendar.years(Activity::Quiet), 1.0));
        SunSample { active_years, confidence, events }
    }

    /// Deviation of the calibration of a satellite (by its number) in a sample, in standard deviations.
    pub fn calibration(&self, index: usize, satellite: usize) -> f64 {
        let mut deviations = StandardNormal.sample_iter(self.random(index as u64, Draw::Calibration));
        deviations.nth(satellite).expect("endless")
    }

    /// Active and quiet time of a sample.
    fn calendar(&self, index: u64) -> Calendar {
        self.sun.drawn(self.duration_yr, &mut self.random(index, Draw::Cycles))
    }

    /// Elapsed active or quiet time (yr), up to a limit, and size of the events of a sample.
    fn events(&self, index: u64, activity: Activity, until_yr: f64) -> impl Iterator<Item = (f64, f64)> {
        let draw = match activity {
            Activity::Active => Draw::ActiveEvents,
            Activity::Quiet => Draw::QuietEvents,
        };
        poisson(self.random(index, draw), activity.events_per_yr(), until_yr)
    }

    /// Random numbers of a sample.
    fn random(&self, index: u64, draw: Draw) -> ChaCha8Rng {
        let mut random = ChaCha8Rng::seed_from_u64(self.seed);
        random.set_stream(STREAMS + 4 * index + draw as u64);
        random
    }
}

/// Random streams of the Sun, separate from all other uses of the same seed.
const STREAMS: u64 = 1 << 42;

/// The quantities drawn for a sample, each from its own stream.
#[derive(Clone, Copy)]
enum Draw {
    Cycles,
    ActiveEvents,
    QuietEvents,
    Calibration,
}

/// Active years as ESP counts them: less than one is one.
fn esp_years(calendar: &Calendar) -> f64 {
    let years = calendar.years(Activity::Active);
    if years > 0.0 { years.max(1.0) } else { 0.0 }
}

/// Times (yr) up to a limit, and sizes, of independent events at a given rate per year.
fn poisson(mut random: ChaCha8Rng, per_yr: f64, until_yr: f64) -> impl Iterator<Item = (f64, f64)> {
    let mut at_yr = 0.0;
    iter::from_fn(move || {
        let gap: f64 = Exp1.sample(&mut random);
        at_yr += gap / per_yr;
        (at_yr < until_yr).then(|| (at_yr, StandardNormal.sample(&mut random)))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn events_of_a_year_have_the_moments_of_esp() {
        for energy_mev in [1.0, 10.0, 30.0, 60.0, 100.0] {
            let yearly = Yearly::above(energy_mev).unwrap();
            let log = |z: f64| Activity::Active.fluence(yearly, z).ln();
            let (mu, sigma) = (log(0.0), log(1.0) - log(0.0));
            // Campbell: mean = w ⟨φ⟩, variance = w ⟨φ²⟩
            let mean = EVENTS_PER_ACTIVE_YR * (mu + 0.5 * sigma * sigma).exp();
            let variance = EVENTS_PER_ACTIVE_YR * (2.0 * mu + 2.0 * sigma * sigma).exp();
            assert!((mean / yearly.mean_cm2 - 1.0).abs() < 1e-12);
            assert!((variance / mean / mean / yearly.relative_variance - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn spectra_of_events_fall_with_energy_however_large_they_are() {
        for z in [-8.0, -3.0, 0.0, 3.0, 8.0] {
            for activity in [Activity::Active, Activity::Quiet] {
                let event = activity.event(z);
                let energies_mev = (0..200).map(|index| 10_f64.powf(0.02 * f64::from(index) - 1.0));
                let above: Vec<f64> = energies_mev.map(|energy_mev| event.above(energy_mev)).collect();
                assert!(above.windows(2).all(|pair| pair[1] <= pair[0] * (1.0 + 1e-12)), "{z}");
            }
        }
    }

    /// The maximum effect of the height of maxima on ESP: see [`HEIGHTS`].
    #[test]
    fn the_distribution_of_esp_holds_the_height_of_maxima() {
        let logs = HEIGHTS.map(f64::ln);
        let mean = logs.iter().sum::<f64>() / logs.len() as f64;
        let heights = logs.iter().map(|log| (log - mean).powi(2)).sum::<f64>() / (logs.len() - 1) as f64;
        assert!((heights.sqrt() - 0.295).abs() < 0.001, "{}", heights.sqrt());
        let of_esp =
            |energy_mev: f64, years: f64| (Yearly::above(energy_mev).unwrap().relative_variance / years).ln_1p();
        // Behind a shield, energies above 30 MeV matter.
        for energy_mev in [30.0, 60.0, 100.0] {
            let share = heights / (heights + of_esp(energy_mev, 7.0));
            assert!(share < 0.05, "{energy_mev} MeV: {share}");
            let wider = (1.0 + heights / of_esp(energy_mev, 7.0)).sqrt();
            assert!(wider < 1.025, "{energy_mev} MeV: {wider}");
        }
        // Two cycles that differ by 4 to 10 above 10 MeV: within two standard deviations of a ratio of ESP's sums.
        let sigma = (2.0 * of_esp(10.0, 7.0)).sqrt();
        assert!(10.0_f64.ln() / sigma < 2.0, "{sigma}");
    }

    #[test]
    fn ranks_are_spread_evenly() {
        let even = SolarEvents::new(Sun::Mean { active_yr: 3.0 }, 4.0, 400, 7);
        let mut ranks: Vec<f64> = even.ranked.iter().map(|(_, rank)| *rank).collect();
        ranks.sort_by(f64::total_cmp);
        for (index, rank) in ranks.iter().enumerate() {
            assert!((rank - (index as f64 + 0.5) / 400.0).abs() < 1e-12, "{index}: {rank}");
        }
    }

    #[test]
    fn events_come_in_their_time() {
        let maxima = super::super::solar_cycle::maxima(&[2024.8], 2060.0);
        let sun = Sun::Cycle { maxima, launch: 2030.0 };
        let events = SolarEvents::new(sun, 10.0, 300, 1);
        let mut count = [0, 0];
        for index in 0..events.samples() {
            let sample = events.sample(index);
            assert!(sample.confidence > 0.0 && sample.confidence < 1.0);
            for event in &sample.events {
                assert!((0.0..=10.0).contains(&event.t_yr), "{event:?}");
                count[usize::from(event.activity == Activity::Quiet)] += 1;
            }
        }
        let (least, most) = events.active_years().unwrap();
        assert!(least < 6.0 && most > 6.8 && most <= 7.0 + 1e-9, "{least} {most}");
        assert!(count[0] > 300 * 36 && count[0] < 300 * 46 && count[1] > 300 * 4 && count[1] < 300 * 8, "{count:?}");
    }
}
