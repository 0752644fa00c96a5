//! Trails in bins of signal, transfers and background → mean trails.

use std::collections::BTreeMap;

use super::super::exposure::{About, When};
use super::super::statistic::{Mean, clipped_beyond, inliers, median, robust_scatter};
use super::super::table::Measurement;
use super::find::Cut;

/// Backgrounds below this are in a common bin, e-.
const LEAST_BACKGROUND_E: f64 = 1.0;

/// Bins for the trails.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bins {
    /// Bins of signal and of background per decade.
    pub per_decade: usize,
    /// Smallest and largest number of transfers, and number of bins between them.
    pub transfers: (f64, f64, usize),
    /// Whether amplifiers have separate bins.
    pub amplifiers_apart: bool,
}

impl Bins {
    /// Trails bin by bin, sorted by background, then transfers, then signal.
    pub fn sorted(&self, cuts: Vec<Cut>) -> Vec<Vec<Cut>> {
        let decade = |charge_e: f64| (charge_e.log10() * self.per_decade as f64).floor() as i64;
        let (least, most, count) = self.transfers;
        let by_transfers = |transfers: f64| {
            let place = (transfers - least) / (most - least) * count as f64;
            (place as usize).min(count - 1)
        };
        let mut bins: BTreeMap<_, Vec<Cut>> = BTreeMap::new();
        for cut in cuts {
            let background = decade(cut.background_e.max(0.999 * LEAST_BACKGROUND_E));
            let sensor = self.amplifiers_apart.then_some((cut.place.0, cut.place.1));
            let key = (sensor, background, by_transfers(cut.transfers), decade(cut.signal_e));
            bins.entry(key).or_default().push(cut);
        }
        bins.into_values().collect()
    }
}

/// A mean trail.
pub(super) struct Trail {
    signal_e: f64,
    background_e: f64,
    transfers: f64,
    /// Charge in each pixel behind, e-; None for too few values.
    pixels: Vec<Option<Mean>>,
}

/// The mean of trails, over warm pixels: exposures of one pixel are averaged first, since its surroundings are the same in all of
/// them. None for fewer warm pixels than `fewest`.
///
/// Trails of a bin differ because their signals S and transfers n do: to first order as √S n. This is removed, so that the mean is
/// the trail of the mean signal, and the scatter that of noise.
pub(super) fn stack(cuts: &[Cut], fewest: usize, trail_px: usize) -> Option<Trail> {
    let mut places: BTreeMap<_, Vec<usize>> = BTreeMap::new();
    for (index, cut) in cuts.iter().enumerate() {
        places.entry(cut.place).or_default().push(index);
    }
    if places.len() < fewest.max(1) {
        return None;
    }
    let places: Vec<Vec<usize>> = places.into_values().collect();
    let each_place = |value: &dyn Fn(usize) -> f64| -> Vec<f64> {
        places.iter().map(|members| mean_of(members.iter().map(|index| value(*index)))).collect()
    };
    let signals_e = each_place(&|index| cuts[index].signal_e);
    let transfers = each_place(&|index| cuts[index].transfers);
    let (signal_e, mean_transfers) = (mean_of(signals_e.iter().copied()), mean_of(transfers.iter().copied()));
    let expected = |place: usize| (signals_e[place] / signal_e).sqrt() * transfers[place] / mean_transfers;
    let quantum_e = cuts.iter().map(|cut| cut.quantum_e).fold(0.0, f64::max);
    let trails = without_sources(cuts, trail_px, quantum_e);
    let charges: Vec<Vec<f64>> = (0..trail_px).map(|distance| each_place(&|index| trails[index][distance])).collect();
    let least_scatter_e = usual_scatter(&charges).max(quantum_e);
    let pixel = |charges: &Vec<f64>| {
        let clipped = |values: Vec<f64>| clipped_beyond(values, quantum_e, least_scatter_e);
        let usual_e = clipped(charges.clone())?.value;
        let at_mean = charges.iter().enumerate().map(|(place, charge)| charge + usual_e * (1.0 - expected(place)));
        let mean = clipped(at_mean.collect())?;
        Some(Mean { rejected: places.len() - mean.used, ..mean }).filter(|mean| mean.used >= fewest.max(1))
    };
    Some(Trail {
        signal_e,
        background_e: mean_of(each_place(&|index| cuts[index].background_e).into_iter()),
        transfers: mean_transfers,
        pixels: charges.iter().map(pixel).collect(),
    })
}

/// The mean of the values that are not missing.
fn mean_of(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) =
        values.filter(|value| !value.is_nan()).fold((0.0, 0), |(sum, count), value| (sum + value, count + 1));
    sum / f64::from(count)
}

/// The trails with NaN in place of outliers. Significant charge behind a warm pixel is another source, with its own trail: the
/// pixels after it are also removed.
fn without_sources(cuts: &[Cut], trail_px: usize, quantum_e: f64) -> Vec<Vec<f64>> {
    let mut trails: Vec<Vec<f64>> = cuts.iter().map(|cut| cut.trail_e.clone()).collect();
    let at = |trails: &[Vec<f64>], distance: usize| trails.iter().map(|trail| trail[distance]).collect::<Vec<f64>>();
    let charges: Vec<Vec<f64>> = (0..trail_px).map(|distance| at(&trails, distance)).collect();
    let least_scatter_e = usual_scatter(&charges).max(quantum_e);
    for distance in 0..trail_px {
        let charges = at(&trails, distance);
        let kept = inliers(&charges, least_scatter_e);
        let middle = median(charges).unwrap_or(0.0);
        for (trail, _) in trails.iter_mut().zip(kept).filter(|(_, kept)| !kept) {
            let to = if trail[distance] > middle { trail_px } else { distance + 1 };
            trail[distance..to].fill(f64::NAN);
        }
    }
    trails
}

/// The median over the pixels of a trail of the scatter between trails, e-: noise is nearly the same in all of them, and with few
/// trails those of one pixel may be close together by chance.
fn usual_scatter(charges: &[Vec<f64>]) -> f64 {
    median(charges.iter().filter_map(|values| robust_scatter(values)).collect()).unwrap_or(0.0)
}

impl Trail {
    /// The rows of a table, for the exposures of a date; with the charge of the packet as read, or before transfer.
    pub fn rows(&self, abouts: &[&About], as_read: bool) -> Vec<Measurement> {
        let trailed_e: f64 = self.pixels.iter().flatten().map(|mean| mean.value).sum();
        let before_e = self.signal_e + trailed_e;
        let signal = if as_read { ("signal_read_e", self.signal_e) } else { ("signal_e", before_e) };
        let when = When::mean(&abouts.iter().map(|about| about.when).collect::<Vec<_>>());
        let mean_of = |value: fn(&About) -> Option<f64>| {
            let values: Option<Vec<f64>> = abouts.iter().map(|about| value(about)).collect();
            values.map(|values| values.iter().sum::<f64>() / values.len() as f64)
        };
        let row = |(index, mean): (usize, &Mean)| Measurement {
            conditions: vec![
                ("trail_px", (index + 1) as f64),
                signal,
                ("background_e", self.background_e.max(0.0)),
                ("transfers", self.transfers.round()),
            ],
            when,
            temperature_k: mean_of(|about| about.temperature_k),
            line_time_ms: mean_of(|about| about.line_time_ms),
            value: mean.value / before_e,
            sigma: mean.sigma / before_e,
            common: None,
            from: [abouts[0].sensor(), mean.pixels()].concat(),
        };
        self.pixels.iter().enumerate().filter_map(|(index, mean)| Some(row((index, mean.as_ref()?)))).collect()
    }
}
