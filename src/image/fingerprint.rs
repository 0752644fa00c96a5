//! Fingerprint of a job, which distinguishes its files from those of other jobs: a hash of everything that determines their values,
//! except the frames themselves.

use std::path::Path;

use sha2::{Digest, Sha256};

use super::Job;
use super::fits::{Fits, Hdu};
use super::unit::number_of;
use crate::error::InputError;

/// Its header keyword.
pub(super) const KEYWORD: &str = "CTIJOB";

impl Job {
    /// Sixteen hexadecimal digits: a hash of ctiplan's version, mission, conditions and traps, of the task and its options, and of
    /// the contents of the amplifier table and the trap map. The selection of HDUs is not included: each frame has its own header.
    pub(super) fn fingerprint(&self) -> String {
        let Job { task, model, device, geometry, unit, amplifiers, bits, trap_map, .. } = self;
        let mut hash = Sha256::new();
        hash.update(concat!("ctiplan ", env!("CARGO_PKG_VERSION"), "\n"));
        hash.update(model.mission.to_toml());
        hash.update(format!("{:?} {:?} {:?}", device.at, device.traps, device.method));
        hash.update(format!("{task:?} {geometry:?} {unit:?} {bits:?}"));
        hash.update(format!("{:?} {} {}", self.read_noise_e, self.separate_noise, self.propagate_errors));
        // Files are identified by their contents, regardless of their paths.
        hash.update(amplifiers.as_ref().map_or(String::new(), |table| table.contents()));
        trap_map.iter().for_each(|map| map.add_to(&mut hash));
        hash.finalize().iter().take(8).map(|byte| format!("{byte:02x}")).collect()
    }

    /// Rejects an existing file unless it is one that this job writes.
    ///
    /// # Errors
    /// If it cannot be read, no frame in it was made by this command, or one was made with another mission, time, dose or options.
    pub(super) fn refuse_others(&self, output: &Path) -> Result<(), InputError> {
        let hdus = Fits::open(output)?.hdus;
        let wanted = Made { job: self.fingerprint(), conditions: self.conditions()? };
        let task = self.task.word();
        let frames: Vec<usize> = self.frames_without_map(&hdus, output)?.into_iter().map(|(index, _)| index).collect();
        let made = |hdu: &Hdu| Made::of(hdu).filter(|made| frames.contains(&hdu.index) || made.job == wanted.job);
        let made: Vec<(usize, Made)> = hdus.iter().filter_map(|hdu| Some((hdu.index, made(hdu)?))).collect();
        let problem = match made.iter().map(|(_, made)| made).find(|made| made.job != wanted.job) {
            None if made.iter().map(|(index, _)| *index).eq(frames) => return Ok(()),
            None if made.is_empty() => format!("no frame in it has the keyword {KEYWORD} that `ctiplan {task}` writes"),
            None => "other HDUs of it were processed than are requested now".into(),
            Some(other) if other.conditions != wanted.conditions => {
                format!("it was made with {}; requested is {}", other.conditions, wanted.conditions)
            }
            Some(other) => format!(
                "another command, mission file or other options made it: {KEYWORD} = '{}' there, '{}' of this `ctiplan {task}`; HISTORY \
                 in its header says what was done",
                other.job, wanted.job
            ),
        };
        Err(InputError::new(format!("cannot keep `{}`", output.display()), problem)
            .with_help("give another folder for each mission, time and set of options, or --overwrite"))
    }

    /// Mission, time and dose in words.
    fn conditions(&self) -> Result<String, InputError> {
        Ok(conditions(&self.name_in_header(), self.device.at.t_yr, self.device.dose_mev_g()?))
    }
}

/// The header's record of the job that made a frame.
struct Made {
    job: String,
    conditions: String,
}

impl Made {
    fn of(hdu: &Hdu) -> Option<Made> {
        let number = |keyword: &str| number_of(keyword, hdu, hdu, "").unwrap_or(f64::NAN);
        let mission = hdu.text("CTIMISS").unwrap_or_default();
        let conditions = conditions(&mission, number("CTIYEAR"), number("CTIDOSE"));
        Some(Made { job: hdu.text(KEYWORD)?, conditions })
    }
}

fn conditions(mission: &str, t_yr: f64, dose_mev_g: f64) -> String {
    format!("mission \"{}\" at {t_yr} yr, {dose_mev_g:.4e} MeV/g", mission.trim_end())
}
