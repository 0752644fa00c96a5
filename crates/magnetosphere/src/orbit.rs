//! Elements of an orbit → places and the fractions of time spent there.
//!
//! Trapped protons depend only on the place in the field, which rotates with the Earth. Over months the node visits all longitudes
//! evenly, and the perigee, unless it is fixed, all arguments. So the mean is one over anomaly, longitude and, if it is free,
//! argument of perigee; the eccentric anomaly E has the weight 1 − e cos E, from Kepler's equation.

use std::f64::consts::{PI, SQRT_2, TAU};

use crate::EARTH_RADIUS_KM;

/// Radius (km) of the reference sphere for altitudes.
pub const SPHERE_KM: f64 = 6371.0;

/// Gravitational parameter of the Earth, km³ s⁻².
const GM: f64 = 398_600.44;

/// Sidereal rotation period of the Earth, h.
const SIDEREAL_DAY_H: f64 = 23.934_47;

/// An orbit around the Earth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Elements {
    /// Lowest altitude above a sphere of 6371 km, km.
    pub perigee_km: f64,
    /// Highest altitude, km.
    pub apogee_km: f64,
    /// Inclination to the equator, degrees.
    pub inclination_deg: f64,
    /// Argument of perigee, degrees; None: uniformly distributed.
    pub argument_of_perigee_deg: Option<f64>,
}

/// The geostationary orbit.
pub const GEOSTATIONARY: Elements =
    Elements { perigee_km: 35_793.2, apogee_km: 35_793.2, inclination_deg: 0.0, argument_of_perigee_deg: None };

/// A geocentric place with its fraction of the time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Visit {
    /// Place, RE.
    pub place: [f64; 3],
    /// Fraction of the time, relative to the mean over all visits.
    pub weight: f64,
}

impl Elements {
    /// Semi-major axis, km.
    pub fn semi_major_axis_km(&self) -> f64 {
        SPHERE_KM + 0.5 * (self.perigee_km + self.apogee_km)
    }

    /// Eccentricity.
    pub fn eccentricity(&self) -> f64 {
        (self.apogee_km - self.perigee_km) / (2.0 * self.semi_major_axis_km())
    }

    /// Period, h.
    pub fn period_h(&self) -> f64 {
        TAU * (self.semi_major_axis_km().powi(3) / GM).sqrt() / 3600.0
    }

    /// Drift rate of the perigee from the Earth's oblateness, degrees per year. For high orbits that from Sun and Moon is as large.
    pub fn perigee_drift_deg_yr(&self) -> f64 {
        const J2: f64 = 1.082_63e-3;
        let parameter_km = self.semi_major_axis_km() * (1.0 - self.eccentricity().powi(2));
        let mean_motion = TAU / (self.period_h() * 3600.0);
        let sin = self.inclination_deg.to_radians().sin();
        let rate = 1.5 * J2 * (6378.137 / parameter_km).powi(2) * mean_motion * (2.0 - 2.5 * sin * sin);
        rate.to_degrees() * 3600.0 * 24.0 * 365.25
    }

    /// Revolutions per sidereal day if one or two, and if the longitudes of the passes drift too slowly for all of them to be met
    /// within a time (yr): a mean over all longitudes is then only valid for the mean of many such orbits.
    ///
    /// The passes of one day are 360°/revolutions apart, and drift by 360° (1 − revolutions per day/revolutions) a day.
    pub fn repeats_longitudes(&self, within_yr: f64) -> Option<u32> {
        /// Relative error of the revolutions per day of altitudes that are written to three digits, such as 20 200 km (which is
        /// 20 182 km), and of the drift of the node.
        const ROUNDED: f64 = 0.003;
        let per_day = SIDEREAL_DAY_H / self.period_h();
        let days = within_yr * 365.25 * 24.0 / SIDEREAL_DAY_H;
        [1, 2].into_iter().find(|revolutions| {
            let revolutions = f64::from(*revolutions);
            let drift = (per_day / revolutions - 1.0).abs();
            drift < ROUNDED || drift * days < 1.0 / revolutions
        })
    }

    /// Whether the difference of perigee and apogee is negligible.
    fn is_circular(&self) -> bool {
        self.eccentricity() < 1e-6
    }

    /// A place on the orbit below a distance (RE) from the centre, by its number, from 0 on. The mean of a quantity over the orbit
    /// is the mean of weight times quantity over the first visits; it has converged when more of them change nothing.
    ///
    /// Longitude of the node and argument of latitude, or anomaly if the perigee is fixed, follow the additive sequence of the
    /// powers of 1/φ with φ³ = φ + 1, which fills the square very evenly (Niederreiter 1992, Random Number Generation and
    /// Quasi-Monte Carlo Methods). If the perigee is free, the anomaly is independent of the argument of latitude, and follows √2.
    pub fn visit(&self, number: usize, below: f64) -> Visit {
        const GOLDEN: f64 = 1.324_717_957_244_746;
        let count = (number + 1) as f64;
        let (first, second) = ((count / GOLDEN).fract(), (count / (GOLDEN * GOLDEN)).fract());
        let node = TAU * first;
        let radius = self.semi_major_axis_km() / EARTH_RADIUS_KM;
        if self.is_circular() {
            let weight = if radius < below { 1.0 } else { 0.0 };
            return Visit { place: self.place(radius, TAU * second, node), weight };
        }
        let free = self.argument_of_perigee_deg.is_none();
        let eccentricity = self.eccentricity();
        // r = a (1 − e cos E)
        let reach = ((1.0 - below / radius) / eccentricity).clamp(-1.0, 1.0).acos();
        // More places near the perigee, where fast protons are: E = reach · (y − c (y − y³)), −1 < y < 1.
        let y = 2.0 * (if free { (count * SQRT_2).fract() } else { second }) - 1.0;
        let crowding = 0.75 * eccentricity;
        let anomaly = reach * (y - crowding * (y - y * y * y));
        let density = 1.0 - crowding * (1.0 - 3.0 * y * y);
        let stretch = 1.0 - eccentricity * anomaly.cos();
        let ratio = ((1.0 + eccentricity) / (1.0 - eccentricity)).sqrt();
        let argument = match self.argument_of_perigee_deg {
            None => TAU * second,
            Some(perigee_deg) => perigee_deg.to_radians() + 2.0 * (ratio * (0.5 * anomaly).tan()).atan(),
        };
        Visit { place: self.place(radius * stretch, argument, node), weight: density * stretch * reach / PI }
    }

    /// The place at a distance (RE) and an argument of latitude (rad), for a longitude of the node (rad).
    fn place(&self, radius: f64, argument: f64, node: f64) -> [f64; 3] {
        let (sin, cos) = argument.sin_cos();
        let inclination = self.inclination_deg.to_radians();
        let sin_latitude = inclination.sin() * sin;
        let cos_latitude = (1.0 - sin_latitude * sin_latitude).max(0.0).sqrt();
        let (east, towards) = ((inclination.cos() * sin).atan2(cos) + node).sin_cos();
        [radius * cos_latitude * towards, radius * cos_latitude * east, radius * sin_latitude]
    }
}
