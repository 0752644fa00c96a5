//! Why one scenario is better than another, in words.

use std::fmt;

use serde::ser::{Serialize, Serializer};

use crate::plan::scenario::Cause;

impl fmt::Display for Cause {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let but = |although: &bool| if *although { "although " } else { "" };
        match self {
            Cause::Lost => out.write_str("in the worst the galaxy has no measurable shape left"),
            Cause::Dose { although, dose_mev_g: [better, worse], active_yr: [better_yr, worse_yr] } => write!(
                out,
                "{}dose {better:.3e} against {worse:.3e} MeV/g ({better_yr:.2} against {worse_yr:.2} active years)",
                but(although)
            ),
            Cause::PerDose { although, ratio } => {
                write!(out, "{}|delta e| for each unit of dose is {ratio:.3} of the worst's", but(although))
            }
            Cause::Effects { only_better, only_worse } => {
                let alone = |names: &[String], whose| format!("only the {whose} has {}", names.join(", "));
                let both = [(only_better, "best"), (only_worse, "worst")];
                let said: Vec<_> = both
                    .iter()
                    .filter(|(names, _)| !names.is_empty())
                    .map(|(names, whose)| alone(names, whose))
                    .collect();
                out.write_str(&said.join("; "))
            }
            Cause::Beside { share } => write!(
                out,
                "serial registers and amplifiers contribute {:.0} % of the |delta e| of the best, {:.0} % of that of the worst",
                100.0 * share[0],
                100.0 * share[1]
            ),
            Cause::Species { name, release_transfers: [better, worse], share } => write!(
                out,
                "{name}, released after {better:.3} against {worse:.3} transfers, contributes {:.0} % of the |delta e| of the best, {:.0} % of \
                 that of the worst",
                100.0 * share[0],
                100.0 * share[1]
            ),
        }
    }
}

/// In text form.
impl Serialize for Cause {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        to.collect_str(self)
    }
}
