//! Published numbers beside the same numbers under many Suns, drawn as events.

use ctiplan::mission::Mission;
use ctiplan::physics::SolarEventDoses;
use rayon::prelude::*;
use statrs::distribution::{ContinuousCDF, Normal};

use super::flown::*;

/// Suns that are drawn.
pub const DRAWS: u32 = 2000;

/// Seed of the random numbers.
pub const SEED: u64 = 1;

/// Probabilities of the quantiles: the band, and its middle.
pub const QUANTILES: [f64; 3] = [0.05, 0.50, 0.95];

/// Interval (yr) at which the dose of everything but solar protons is tabulated: cosmic rays change little in it.
const STEP_YR: f64 = 0.05;

/// A mission under many Suns.
pub struct Drawn {
    launch: f64,
    /// Dose (MeV/g) since launch of everything but solar protons, every [`STEP_YR`].
    others: Vec<f64>,
    suns: SolarEventDoses,
}

impl Drawn {
    pub fn of(mission: &Mission) -> Drawn {
        let flown = Flown::new(mission);
        let suns =
            SolarEventDoses::of(mission, flown.history(), DRAWS, SEED).expect("a dose derived from solar protons");
        let steps = (mission.mission.duration_yr / STEP_YR).ceil() as u32 + 1;
        let others = (0..=steps).map(|step| flown.without_sun(f64::from(step) * STEP_YR)).collect();
        Drawn { launch: flown.launch, others, suns }
    }

    /// Numbers under each Sun, beside published ones: numbers are the outer, Suns the inner index.
    pub fn bands(&self, of: impl Fn(&Course) -> Vec<Compared> + Sync) -> Vec<Band> {
        let suns: Vec<Vec<Compared>> = (0..DRAWS as usize).into_par_iter().map(|sun| of(&self.course(sun))).collect();
        let band = |index: usize| {
            let Compared { published, error, .. } = suns[0][index];
            Band { published, error, draws: suns.iter().map(|numbers| numbers[index].model).collect() }
        };
        (0..suns[0].len()).map(band).collect()
    }

    fn course(&self, sun: usize) -> Course<'_> {
        let mut steps = self.suns.steps(sun);
        steps.sort_by(|one, other| one.0.total_cmp(&other.0));
        let mut sum = 0.0;
        for (_, dose) in &mut steps {
            sum += *dose;
            *dose = sum;
        }
        Course { launch: self.launch, others: &self.others, steps }
    }
}

/// A mission under one Sun.
pub struct Course<'a> {
    launch: f64,
    others: &'a [f64],
    /// Times (years since launch) of solar events, and their dose (MeV/g) up to each, with it.
    steps: Vec<(f64, f64)>,
}

impl Course<'_> {
    /// Dose (MeV/g) since launch of everything but solar protons, at a decimal year.
    pub fn others(&self, year: f64) -> f64 {
        let place = ((year - self.launch) / STEP_YR).clamp(0.0, (self.others.len() - 2) as f64);
        let (low, high) = (self.others[place as usize], self.others[place as usize + 1]);
        low + place.fract() * (high - low)
    }
}

impl Dose for Course<'_> {
    fn dose(&self, year: f64) -> f64 {
        let passed = self.steps.partition_point(|(t_yr, _)| *t_yr <= year - self.launch);
        let solar = passed.checked_sub(1).map_or(0.0, |last| self.steps[last].1);
        self.others(year) + solar
    }
}

/// A published number, and the same number under each Sun.
pub struct Band {
    pub published: f64,
    /// 1 sigma of the published number.
    pub error: f64,
    pub draws: Vec<f64>,
}

impl Band {
    /// At the probabilities of [`QUANTILES`].
    pub fn quantiles(&self) -> [f64; 3] {
        let mut sorted = self.draws.clone();
        sorted.sort_by(f64::total_cmp);
        QUANTILES.map(|p| sorted[(p * sorted.len() as f64) as usize])
    }

    /// Distance of the ends of the band.
    pub fn width(&self) -> f64 {
        let [low, _, high] = self.quantiles();
        high - low
    }

    /// Share of the draws below a number.
    pub fn below(&self, number: f64) -> f64 {
        self.mean(|draw| f64::from(u8::from(draw < number)))
    }

    /// Probability that a draw, measured with the published error, is below the published number.
    pub fn quantile(&self) -> f64 {
        self.quantile_of(self.published)
    }

    fn quantile_of(&self, number: f64) -> f64 {
        let normal = Normal::standard();
        self.mean(|draw| normal.cdf((number - draw) / self.error))
    }

    /// Whether the published number, with its error, lies within the band.
    pub fn within(&self) -> bool {
        self.has(self.published)
    }

    /// Whether a number, with the published error, would lie within the band.
    fn has(&self, number: f64) -> bool {
        (QUANTILES[0]..=QUANTILES[2]).contains(&self.quantile_of(number))
    }

    /// `published ± error, band, width, quantiles, within`.
    fn words(&self) -> String {
        let [low, middle, high] = self.quantiles();
        format!(
            "{:>7.2} +- {:.2} {low:>6.2} {middle:>5.2} {high:>5.2} {:>6.2} {:>13.1} {:>15.1}  {}",
            self.published,
            self.error,
            self.width(),
            100.0 * self.below(self.published),
            100.0 * self.quantile(),
            if self.within() { "yes" } else { "no" }
        )
    }

    /// Mean over the draws.
    pub fn mean(&self, of: impl Fn(f64) -> f64) -> f64 {
        self.draws.iter().map(|draw| of(*draw)).sum::<f64>() / self.draws.len() as f64
    }
}

/// Share of the Suns under which the number that is farthest out among its draws is at least as far out as the farthest published
/// one: several numbers are more often out of their bands than one.
pub fn as_extreme(bands: &[Band]) -> f64 {
    let far = |quantile: f64| (quantile - 0.5).abs();
    let published = bands.iter().map(|band| far(band.quantile())).fold(0.0, f64::max);
    let mut farthest = vec![0.0_f64; DRAWS as usize];
    for band in bands {
        let mut order: Vec<usize> = (0..band.draws.len()).collect();
        order.sort_by(|one, other| band.draws[*one].total_cmp(&band.draws[*other]));
        for (rank, sun) in order.iter().enumerate() {
            farthest[*sun] = farthest[*sun].max(far((rank as f64 + 0.5) / f64::from(DRAWS)));
        }
    }
    farthest.iter().filter(|far| **far >= published).count() as f64 / f64::from(DRAWS)
}

/// How many Suns, and from which seed.
pub fn suns() -> String {
    format!("{DRAWS} Suns (seed {SEED})")
}

/// How many published numbers lie within their bands.
pub fn within(bands: &[Band]) -> usize {
    bands.iter().filter(|band| band.within()).count()
}

/// In how many bands growth at a constant rate would lie: what the bands cannot tell from the published growth.
pub fn constant_within(bands: &[Band]) -> usize {
    bands.iter().filter(|band| band.has(1.0)).count()
}

/// A table of bands, each with its name; all names are as long as the heading.
pub fn table(what: &str, heading: &str, names: &[String], bands: &[Band]) -> Vec<String> {
    let mut lines = vec![
        format!("{what}: {}", suns()),
        format!(" {heading}       published    5 %  50 %  95 %  width  quantile [%]  with error [%]  within"),
    ];
    lines.extend(names.iter().zip(bands).map(|(name, band)| format!(" {name}  {}", band.words())));
    lines.push(format!(" {}", verdict(bands)));
    lines
}

fn verdict(bands: &[Band]) -> String {
    let (within, all) = (within(bands), bands.len());
    format!(
        "within 5 to 95 %: {within} of {all}: {}; a constant rate: {} of {all}; as extreme under {:.1} % of the Suns",
        if within == all { "met" } else { "not met" },
        constant_within(bands),
        100.0 * as_extreme(bands)
    )
}
