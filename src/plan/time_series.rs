//! Dose, traps and shapes over a mission, between the ends of the years, densely enough for figures.

use crate::error::InputError;
use crate::model::{Device, Model};
use crate::numeric::calendar::decimal_year;
use crate::plan::curve::Curve;

/// A mission's dose, traps and shapes over time. All lists have the length of that of the times.
#[derive(Clone, Debug)]
pub struct TimeSeries {
    /// Decimal calendar years, ascending, from launch to the end of the mission.
    pub year: Vec<f64>,
    /// Dose since launch, MeV/g.
    pub dose_mev_g: Vec<f64>,
    /// Each species with its traps per pixel.
    pub traps_per_px: Vec<(String, Vec<f64>)>,
    /// |Δe| of each galaxy, in the mission's order; NaN if it has no shape left.
    pub delta_e: Vec<Vec<f64>>,
}

impl TimeSeries {
    /// For a mission whose galaxies have shapes.
    ///
    /// # Errors
    /// If a formula has no value.
    pub fn of(model: &Model) -> Result<TimeSeries, InputError> {
        let galaxies = 0..model.mission.galaxies.len();
        let curves: Vec<Curve> =
            galaxies.map(|galaxy| Curve::of_galaxy(model, galaxy, |_| {})).collect::<Result<_, _>>()?;
        let times: Vec<f64> = curves[0].points.iter().map(|point| point.0).collect();
        let devices = times.iter().map(|t_yr| model.device_at(*t_yr)).collect::<Result<Vec<_>, _>>()?;
        let species = devices[0].traps.iter().enumerate().map(|(index, species)| {
            let density = devices.iter().map(|device| device.traps[index].density_per_px);
            (species.name.clone(), density.collect())
        });
        let launch = decimal_year(model.mission.mission.launch.0);
        Ok(TimeSeries {
            year: times.iter().map(|t_yr| launch + t_yr).collect(),
            dose_mev_g: devices.iter().map(Device::dose_mev_g).collect::<Result<_, _>>()?,
            traps_per_px: species.collect(),
            delta_e: curves
                .iter()
                .map(|curve| times.iter().map(|t_yr| curve.at(*t_yr).unwrap_or(f64::NAN)).collect())
                .collect(),
        })
    }
}
