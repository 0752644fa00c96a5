//! Trap species exchanged by a fit.
//!
//! Two species whose densities and release times are both free give the same model with exchanged values, if nothing else
//! distinguishes them. Their names and energy levels are not exchanged, so at another temperature it is a different detector.
//! Species therefore keep the order of their release times, unless the data are then described less well.

use std::collections::BTreeMap;

use super::plainer::refitted;
use super::result::{Advice, Fit};
use super::solve::Options;
use crate::analysis::measurement::DataSet;
use crate::mission::Mission;
use crate::model::Model;

/// Keys that must be free for species to be exchanged.
const EXCHANGED: [&str; 2] = ["density_per_px", "release_ms"];

/// A fit, or an equally good one in which species keep the order of their release times; advice if there is none.
pub(super) fn kept(
    model: &Model,
    data: &[DataSet],
    fit: Fit,
    options: &Options,
    progress: &(dyn Fn(f64) + Sync),
) -> Fit {
    let keys: Vec<String> = fit.parameters.iter().map(|parameter| parameter.key.clone()).collect();
    let values: Vec<(String, f64)> = restored(&fit.mission, &model.mission, &keys).into_iter().collect();
    if values.is_empty() {
        return fit;
    }
    refitted(model, data, &fit, &values, options, progress).unwrap_or_else(|| {
        let keys = values.into_iter().map(|(key, _)| key).filter(|key| key.ends_with(EXCHANGED[1])).collect();
        Fit { advice: [fit.advice.clone(), vec![Advice::Exchanged { keys }]].concat(), ..fit }
    })
}

/// Values, by dotted key, with which species whose free keys have the same names have their original order of release times. Empty
/// if they already have.
pub(crate) fn restored(fitted: &Mission, given: &Mission, free: &[String]) -> BTreeMap<String, f64> {
    let mut by_species: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
    for (species, name) in free.iter().filter_map(|key| key.rsplit_once('.')) {
        by_species.entry(species).or_default().push(name);
    }
    let mut alike: BTreeMap<Vec<&str>, Vec<&str>> = BTreeMap::new();
    for (species, mut names) in by_species {
        names.sort_unstable();
        if EXCHANGED.iter().all(|name| names.contains(name)) {
            alike.entry(names).or_default().push(species);
        }
    }
    let number = |mission: &Mission, species: &str, name: &str| mission.number(&format!("{species}.{name}"));
    let in_order = |mission: &Mission, all: &[&'_ str]| {
        let mut all: Vec<String> = all.iter().map(ToString::to_string).collect();
        let release_ms = |species: &String| number(mission, species, EXCHANGED[1]).unwrap_or(f64::NAN);
        all.sort_by(|a, b| release_ms(a).total_cmp(&release_ms(b)));
        all
    };
    let mut values = BTreeMap::new();
    for (names, all) in alike {
        for (to, from) in in_order(given, &all).into_iter().zip(in_order(fitted, &all)).filter(|(to, from)| to != from)
        {
            let moved = names.iter().filter_map(|name| Some((format!("{to}.{name}"), number(fitted, &from, name)?)));
            values.extend(moved);
        }
    }
    values
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn species_keep_the_order_of_their_release_times() {
        let given = Mission::read("missions/snap_l2.toml").unwrap();
        let names: Vec<String> = given.detector.traps.iter().map(|species| species.name.clone()).collect();
        let key = |species: usize, name: &str| format!("detector.traps.{}.{name}", names[species]);
        let free: Vec<String> = (0..names.len()).flat_map(|species| EXCHANGED.map(|name| key(species, name))).collect();
        assert!(restored(&given, &given, &free).is_empty());
        // A cyclic shift by one position.
        let count = names.len();
        let moved: Vec<_> = (0..count)
            .flat_map(|species| {
                let other = &given.detector.traps[(species + 1) % count];
                [
                    (key(species, EXCHANGED[0]), other.density_per_px.into()),
                    (key(species, EXCHANGED[1]), other.release_ms.into()),
                ]
            })
            .collect();
        let fitted = given.with(&moved).unwrap();
        let back: Vec<_> =
            restored(&fitted, &given, &free).into_iter().map(|(key, value)| (key, value.into())).collect();
        assert_eq!(back.len(), free.len());
        assert_eq!(fitted.with(&back).unwrap().detector.traps, given.detector.traps);
        // A key that is free in only one species distinguishes them.
        assert!(restored(&fitted, &given, &free[..1]).is_empty());
        let distinguished: Vec<String> =
            free.iter().cloned().chain((0..count - 1).map(|species| key(species, "energy_ev"))).collect();
        let last = format!("detector.traps.{}.", names[count - 1]);
        let values = restored(&fitted, &given, &distinguished);
        assert!(!values.is_empty() && values.keys().all(|key| !key.starts_with(&last)), "{values:?}");
    }
}
