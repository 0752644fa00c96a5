//! Columns that look like a condition which the mission supplies.
//!
//! A column looks like a condition if its name, in lower case and without separators, is one of the condition's names (its own, or
//! the usual words declared with it), with or without units and words that say nothing of the quantity (`n_transfers`,
//! `ccd_temp_K`). Names of five letters or more may have one letter wrong, missing, additional, or two swapped.

use super::{DataSet, known, names_of_galaxy};
use crate::mission::Mission;
use crate::physics::conditions::MIRRORED;
use crate::warning::Warning;

/// Words of a name that do not tell one quantity from another: units, counts, statistics, the detector itself.
const FILLERS: &str = "k c degc kelvin celsius ms us s sec e el electron electrons adu dn px pix pixel per mev g yr n nr no num number of \
                       the total mean avg average median level ccd det detector operating in parallel set actual measured nominal";

/// Shortest name that is recognised with a slip.
const LEAST_LETTERS: usize = 5;

/// Whether a column's name looks like one of some names.
pub(super) fn looks_like(column: &str, names: &[&str]) -> bool {
    let words = words(column);
    let without = words.iter().filter(|word| !is_filler(word)).cloned().collect::<String>();
    let like = |name: &&str| {
        // One letter beside a unit may be anything: T_K.
        let without = Some(&without).filter(|rest| rest.len() > 1);
        [Some(&words.concat()), without].into_iter().flatten().any(|found| {
            found == name || (name.len() >= LEAST_LETTERS && strsim::damerau_levenshtein(found, name) == 1)
        })
    };
    names.iter().any(like)
}

/// The words of a name in lower case: separated by anything but letters and digits, or by a capital behind a small letter (not in
/// units, such as MeV).
fn words(name: &str) -> Vec<String> {
    let pieces = name.split(|letter: char| !letter.is_alphanumeric()).filter(|piece| !piece.is_empty());
    pieces
        .flat_map(|piece| if is_filler(&piece.to_lowercase()) { vec![piece.to_lowercase()] } else { humps(piece) })
        .collect()
}

/// `lineTime` → line, time.
fn humps(piece: &str) -> Vec<String> {
    let mut words = vec![String::new()];
    let mut before = ' ';
    for letter in piece.chars() {
        if letter.is_uppercase() && before.is_lowercase() {
            words.push(String::new());
        }
        words.last_mut().expect("one word").extend(letter.to_lowercase());
        before = letter;
    }
    words
}

fn is_filler(word: &str) -> bool {
    FILLERS.split_ascii_whitespace().any(|filler| filler == word)
}

impl DataSet {
    /// Says which conditions are the mission's although an unused column or number of `meta` looks like them; None if there are
    /// none.
    pub(super) fn lookalikes(&self, mission: &Mission) -> Option<Warning> {
        let mut found: Vec<[String; 3]> = Vec::new();
        for (condition, value) in self.of_the_mission(mission) {
            let names =
                if condition == "galaxy" { names_of_galaxy() } else { known(condition).expect("a condition").words };
            let columns =
                self.table.columns.iter().map(|column| &column.name).chain(self.table.meta.iter().map(|m| &m.name));
            let unused = |name: &&String| super::is_unknown(name) && looks_like(name, names);
            found.extend(columns.filter(unused).map(|column| [column.clone(), condition.to_string(), value.clone()]));
        }
        (!found.is_empty()).then(|| Warning::LooksLikeCondition { file: self.file.clone(), found })
    }

    /// Conditions of the observable that every row leaves to the mission, with the mission's value.
    fn of_the_mission(&self, mission: &Mission) -> Vec<(&'static str, String)> {
        let all = |left: &dyn Fn(&super::Row) -> bool| self.rows.iter().all(left);
        let mut found = Vec::new();
        for (name, key) in MIRRORED {
            if self.observable.depends_on(name) && all(&|row| row.at.is_left(name)) {
                let unit = known(name).expect("a condition").unit;
                let value = mission.number(key).or_else(|| Some(f64::from(mission.readout.transfers)));
                found.push((name, value.map_or(String::new(), |value| format!("{value}{}", unit.behind()))));
            }
        }
        if self.observable.depends_on("dose_mev_g") && all(&|row| row.at.dose_mev_g.is_none()) {
            found.push(("dose_mev_g", "from its environment".to_string()));
        }
        if all(&|row| row.galaxy_is_judged) {
            found.push(("galaxy", format!("\"{}\"", mission.requirement.galaxy)));
        }
        found
    }
}

#[cfg(test)]
mod tests {
    use super::super::{known, names_of_galaxy};
    use super::looks_like;
    use crate::physics::conditions::NAMES;

    /// Names as one would write them.
    const NEAR: [(&str, &[&str]); 7] = [
        (
            "transfers",
            &[
                "n_transfers",
                "transfer",
                "Transfers",
                "nTransfers",
                "n_trans",
                "num_transfers",
                "parallel_transfers",
                "shifts",
            ],
        ),
        (
            "temperature_k",
            &[
                "temperature",
                "temp",
                "T_K",
                "T_ccd",
                "ccd_temp",
                "Temp_C",
                "detector_temperature",
                "temperatur",
                "TEMPERATURE",
            ],
        ),
        (
            "background_e",
            &["background", "bkg", "sky", "bg_e", "mean_background", "backgroud", "sky_level", "fat_zero"],
        ),
        ("line_time_ms", &["line_time", "lineTime", "line_time_us", "row_time", "t_line", "linetime"]),
        ("dose_mev_g", &["dose", "ddd", "Dose_MeV"]),
        ("signal_e", &["signal", "Signal", "charge", "signal_electrons"]),
        ("t_yr", &["time", "year", "t", "years", "time_yr", "epoch"]),
    ];

    /// Ordinary covariates.
    const FAR: &str = "amplifier amp ccd chip quadrant exposure exposure_time exptime seeing airmass filter gain read_noise \
        column row x y ra dec run visit orbit_number night observer flag quality weight id index n camera \
        mirror_temperature focus voltage humidity moon phase version batch flux_ratio wavelength band";

    fn like(column: &str) -> Vec<&'static str> {
        let is_like = |name: &&'static str| looks_like(column, known(name).unwrap().words);
        let mut found: Vec<&str> = NAMES.into_iter().filter(is_like).collect();
        found.extend(looks_like(column, names_of_galaxy()).then_some("galaxy"));
        found
    }

    #[test]
    fn names_one_would_write_look_like_their_condition() {
        for (condition, columns) in NEAR {
            for column in columns {
                assert_eq!(like(column), [condition], "{column}");
            }
        }
    }

    #[test]
    fn ordinary_covariates_look_like_none() {
        for column in FAR.split_ascii_whitespace() {
            assert!(like(column).is_empty(), "{column}: {:?}", like(column));
        }
    }
}
