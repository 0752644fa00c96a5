//! A galaxy of a survey, at its position on the detector → change of shape.

use crate::error::InputError;
use crate::mission::{Mission, PopulationGalaxy};
use crate::model::shear::SurveyGalaxy;
use crate::model::{Device, Model, Scene};
use crate::physics::accuracy::Purpose;
use crate::physics::conditions::Conditions;
use crate::physics::galaxy::{LensedGalaxy, snr};
use crate::physics::shape::ShapeChange;

impl SurveyGalaxy {
    /// A galaxy of a table; properties not in the table are those of the mission's judged galaxy, with all of its transfers.
    pub fn of(mission: &Mission, galaxy: &PopulationGalaxy) -> SurveyGalaxy {
        let judged = mission.judged_galaxy();
        SurveyGalaxy {
            flux_e: galaxy.flux_e.unwrap_or_else(|| snr::flux_e(mission, judged)),
            half_light_px: galaxy.half_light_px.unwrap_or(judged.half_light_px),
            sersic_index: galaxy.sersic_index.unwrap_or(judged.sersic_index),
            ellipticity: [galaxy.e1.unwrap_or(judged.e1), galaxy.e2.unwrap_or(0.0)],
            weight_px: galaxy.weight_px.unwrap_or(judged.weight_px),
            transfers: galaxy.transfers.unwrap_or(mission.readout.transfers),
            read_noise_e: mission.read_noise_e(judged),
        }
    }

    /// The galaxy without shear.
    fn unsheared(&self) -> LensedGalaxy {
        LensedGalaxy {
            sersic_index: self.sersic_index,
            half_light_px: self.half_light_px,
            ellipticity: self.ellipticity,
            shear: [0.0; 2],
            psf_shear: [0.0; 2],
        }
    }
}

impl Model {
    /// The detector at a time (years since launch), for galaxies with `transfers` transfers, with the accuracy needed for very many
    /// shapes.
    ///
    /// # Errors
    /// As [`Model::dose_mev_g`].
    pub fn survey_device(&self, t_yr: f64, transfers: u32) -> Result<Device, InputError> {
        let at = Conditions { transfers, ..self.conditions(t_yr) };
        Ok(self.device(&at)?.fit_for(Purpose::ManyShapes))
    }

    /// Mean changes of a galaxy's shape over the sub-pixel positions, by several devices. None if the shape is not measurable
    /// before or after the readout.
    ///
    /// # Errors
    /// As [`Model::dose_mev_g`].
    pub fn survey_changes(
        &self,
        galaxy: &SurveyGalaxy,
        devices: &[Device],
    ) -> Result<Option<Vec<ShapeChange>>, InputError> {
        let positions = self.positions();
        let scene = Scene::lensed(&galaxy.unsheared(), galaxy.flux_e, galaxy.weight_px, &self.mission, positions);
        let Some(scene) = scene else { return Ok(None) };
        let change = |device: &Device| -> Result<Option<ShapeChange>, InputError> {
            scene.change_by(device)?.map(|change| device.observed_change(change)).transpose()
        };
        devices.iter().map(change).collect()
    }
}
