//! The long ellipse above the belts: Chandra ACIS.

use ctiplan::mission::Mission;

use super::flown::{self, *};

/// Start of what is compared, decimal year: the damage before it is that of soft protons through the mirrors.
const START: f64 = 1999.67;

/// Slope of parallel CTI (1e-6 per year, Mn K) of the imaging array, of a line from the start to a date: O'Dell et al. 2005, and the
/// monitoring pages of the Chandra X-ray Center (MTA). The last but one sets the scale.
pub const SLOPES: [(f64, f64); 5] = [(2000.7, 5.0), (2003.4, 3.19), (2004.65, 2.50), (2006.0, 2.93), (2015.67, 1.63)];

/// The date that sets the scale: the slope of 2006.
const SCALE: usize = 3;

/// Scatter of slopes that different pages print for the same array in 2006: 2.75 to 2.93, 1e-6 per year.
const SCATTER: f64 = 0.1;

pub fn mission() -> Mission {
    flown::mission("chandra_acis")
}

/// Slopes up to the dates, over that of 2006; that of 2006 itself left out.
pub fn slopes(flown: &impl Dose) -> Vec<(f64, Compared)> {
    let (scale_year, scale) = SLOPES[SCALE];
    let model_scale = flown.slope(START, scale_year);
    let of = |(year, slope): (f64, f64)| {
        let published = slope / scale;
        let error = published * (SCATTER / slope).hypot(SCATTER / scale);
        (year, Compared { published, error, model: flown.slope(START, year) / model_scale })
    };
    SLOPES.into_iter().enumerate().filter(|(index, _)| *index != SCALE).map(|(_, slope)| of(slope)).collect()
}

/// Mean growth per year from 2006 to 2015.7 over that from the start to 2006.
pub fn late_over_early(flown: &Flown) -> f64 {
    flown.rate(2006.0, 2015.67) / flown.rate(START, 2006.0)
}

/// Shields behind which the model is compared, mm of aluminium.
pub const THICKNESSES_MM: [f64; 5] = [10.0, 20.0, 30.0, 40.0, 80.0];

/// chi2 of the four slopes.
pub fn chi2(flown: &Flown) -> f64 {
    slopes(flown).iter().map(|(_, slope)| slope.sigma().powi(2)).sum()
}

pub fn report() -> Vec<String> {
    let mission = mission();
    let header = SLOPES.iter().enumerate().filter(|(index, _)| *index != SCALE);
    let years: Vec<String> = header.map(|(_, (year, _))| format!("{year:>8.1}")).collect();
    let mut lines = vec![
        "Slope of a line from 1999-09 to a date over that to 2006.0, under the Sun as observed".to_string(),
        format!(" {:<22} {}      chi2  late/early", "", years.join("")),
    ];
    let published = slopes(&Flown::new(&mission));
    let row = |values: &mut dyn Iterator<Item = f64>| values.map(|value| format!("{value:>8.2}")).collect::<String>();
    lines.push(format!(" {:<22} {}", "published", row(&mut published.iter().map(|(_, slope)| slope.published))));
    lines.push(format!(" {:<22} {}", "its error", row(&mut published.iter().map(|(_, slope)| slope.error))));
    for thickness_mm in THICKNESSES_MM {
        let flown = Flown::behind(&mission, thickness_mm);
        let model = slopes(&flown);
        lines.push(format!(
            " {:<22} {} {:>9.0} {:>11.2}",
            format!("behind {thickness_mm} mm"),
            row(&mut model.iter().map(|(_, slope)| slope.model)),
            chi2(&flown),
            late_over_early(&flown)
        ));
    }
    lines
}
