//! Image and traps → image with trails.
//!
//! One transfer is the contract of the whole crate. In each physical pixel, for each packet that passes, in order: a filled trap
//! releases its electron with probability 1 − exp(−1/τ); released charge joins the packet; then every empty trap below the height
//! h(n) of the charge cloud captures one electron at once.
//!
//! ```text
//! row r of the image starts r + 1 + rows-downstream pixels from the register and passes through all of them:
//!
//!   register │ pixel 0 │ pixel 1 │ … downstream … │ row 0 │ row 1 │ … image … │
//!            ◀───────────────────────── charge moves
//! ```
//!
//! Several methods share one interface, [`Readout`]: [`Method::Fast`] (used everywhere else), [`Method::Exact`],
//! [`Method::Fractional`] and [`Method::MonteCarlo`]; [`Method::CarriedTraps`] is ArCTIc's other convention.
//!
//! This is a clock of one phase. In a clock of several phases, part of the released charge returns to the packet that has just
//! left: see `phase.rs`. Traps with a finite capture time follow another law, inside the cloud as the packet arrives: see
//! `finite_capture.rs`; that time may depend on the density of the cloud: see [`CaptureDensity`]. Spread release times are resolved
//! into many species of one release time each: see `continuum.rs`. A store region between the image and the register, filled by a
//! burst, makes a composition of readouts: see `frame_transfer.rs`. Traps that keep charge from one frame to the next are in
//! `persistence.rs`.
//!
//! Sources: Rhodes et al. 2010 (PASP 122, 439), section 3; Massey et al. 2010 (MNRAS 401, 371) for the cloud that
//! captures at once.

mod bands;
mod block_path;
mod cloud;
mod continuum;
mod duplicate_columns;
mod encounter;
mod equal_blocks;
mod estimate;
mod every_transfer;
mod finite_capture;
mod flat_field;
mod fractional;
mod frame_transfer;
mod home_watermarks;
pub mod interrupt;
mod monte_carlo;
mod multirevolution;
mod pass;
mod passage;
mod persistence;
mod phase;
mod pixel;
mod power;
mod several_clouds;
mod simd;
mod spent;
mod waiting_pixels;
mod watermarks;

pub use bands::Band;
pub use cloud::Cloud;
pub use equal_blocks::Allowed;
pub use frame_transfer::FrameTransfer;
pub use persistence::Persistence;
pub use phase::{Clock, ClockFault, ClockStep, Phase};

use std::sync::{Mutex, PoisonError};

use ndarray::{Array2, ArrayView1, ArrayView2, ArrayViewMut2, Axis};
use rayon::prelude::*;

use bands::Journey;
use duplicate_columns::DuplicateColumns;
use equal_blocks::{Division, Towards};
use finite_capture::FiniteCapturePixel;
use multirevolution::{Aim, Workspace};
use passage::{Lead, Passage};
use pixel::Pixel;
use several_clouds::{SeveralClouds, Stacks};
use simd::{LANES, Packets};

/// One trap species as seen by the readout.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Trap {
    /// Traps per pixel, ρ.
    pub density_per_px: f64,
    /// Release time constant τ, in units of one transfer; the median if it is spread.
    pub release_transfers: f64,
    /// Standard deviation of ln τ; 0 if all traps have the same.
    pub release_sigma: f64,
    /// Capture time constant τc inside the cloud, in units of one transfer; 0 if capture is instantaneous.
    pub capture_transfers: f64,
    /// How τc depends on the density of the cloud; none if it is the same in every cloud.
    pub capture_density: Option<CaptureDensity>,
    /// Exponent of its cloud's height, if it differs from that of the readout's cloud.
    pub well_fill_power: Option<f64>,
    /// Charge above which a packet reaches the surface, where the trap lies, e-; none for a bulk trap.
    pub surface_level_e: Option<f64>,
    /// When packets are over it; [`Clock::spread`] divides traps among the phases of a pixel.
    pub phase: Phase,
}

/// A capture rate that depends on the density of electrons in the cloud, n/h(n): one over
///
/// ```text
/// τc(n) = τc [(n₀/h(n₀)) / (n/h(n))]^power
/// ```
///
/// In Shockley-Read-Hall statistics the rate is σ v_th n_e: power 1 (Short et al. 2013, MNRAS 430, 3078, equation 4). The charge n
/// is that on arrival, and h(n) the height of the readout's cloud, to which a packet's volume is proportional.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CaptureDensity {
    /// Exponent of the density, 0 or more.
    pub power: f64,
    /// Charge n₀ of the packets in which the capture time is [`Trap::capture_transfers`], e-.
    pub at_e: f64,
}

impl Trap {
    /// Traps of one release time (in units of one transfer) with instantaneous capture.
    pub const fn new(density_per_px: f64, release_transfers: f64) -> Trap {
        Trap {
            density_per_px,
            release_transfers,
            release_sigma: 0.0,
            capture_transfers: 0.0,
            capture_density: None,
            well_fill_power: None,
            surface_level_e: None,
            phase: Phase::SINGLE,
        }
    }

    /// The cloud that it sees, in a readout with this cloud.
    fn own_cloud(&self, cloud: &Cloud) -> Cloud {
        let own = self.well_fill_power.map_or_else(|| cloud.clone(), |power| cloud.with_power(power));
        self.surface_level_e.map_or_else(|| own.clone(), |level_e| own.above_level(level_e))
    }

    /// Capture time in the cloud of a packet, in units of one transfer.
    fn capture_of(&self, cloud: &Cloud, charge_e: f64) -> f64 {
        match self.capture_density {
            // Infinite if there is no charge; instantaneous capture stays instantaneous.
            Some(density) if self.capture_transfers > 0.0 => {
                let ratio = cloud.density_e(density.at_e) / cloud.density_e(charge_e);
                self.capture_transfers * ratio.powf(density.power)
            }
            _ => self.capture_transfers,
        }
    }

    /// [`Trap::passage`] of a packet in a cloud.
    fn passage_of(&self, cloud: &Cloud, charge_e: f64) -> (f64, f64, f64) {
        Trap { capture_transfers: self.capture_of(cloud, charge_e), ..*self }.passage()
    }

    /// Fraction filled inside the clouds of n packets (e-) of background.
    fn filled_by(&self, packets: i64, cloud: &Cloud, charge_e: f64) -> f64 {
        let (_, full, approach) = self.passage_of(cloud, charge_e);
        full * (1.0 - approach.powf(packets as f64))
    }

    /// exp(−1/τ), the fraction that stays filled for one line time.
    fn kept(&self) -> f64 {
        (-1.0 / self.release_transfers).exp()
    }

    /// 1 − exp(−1/τ), the fraction that releases in one line time.
    fn lost(&self) -> f64 {
        -(-1.0 / self.release_transfers).exp_m1()
    }

    /// The fraction of filled traps that release to a packet before it captures: 1 − exp(−1/τ) in a clock of one phase.
    fn released(&self) -> f64 {
        self.phase.released(self.release_transfers)
    }

    /// The fraction of filled traps that release to the packet that has just left; 0 in a clock of one phase.
    fn returned(&self) -> f64 {
        self.phase.returned(self.release_transfers)
    }

    /// Whether any charge returns to the packet that has just left.
    fn returns(&self) -> bool {
        self.phase != Phase::SINGLE
    }

    /// The change per line of the fraction f of filled traps, counted when a packet has left for good: outside its cloud f ← f
    /// exp(−1/τ), inside f ← f∞ + (f − f∞) exp(−1/τc − 1/τ). Returns exp(−1/τ), f∞ and the other factor.
    fn passage(&self) -> (f64, f64, f64) {
        let (release, capture) = (self.release_transfers, self.capture_transfers);
        // Release time 0 and capture time 0 at once: the trap captures.
        let full = if capture == 0.0 { 1.0 } else { release / (release + capture) };
        if self.phase == Phase::SINGLE {
            return (self.kept(), full, (-1.0 / capture - 1.0 / release).exp());
        }
        // Inside the cloud for part of the line, with release alone before and after.
        let over = self.phase.over;
        let approach = (-over / capture - 1.0 / release).exp();
        let captured = -(-over / capture - over / release).exp_m1();
        (self.kept(), (1.0 - self.returned()) * full * captured / (1.0 - approach), approach)
    }

    /// Traps per pixel below the height of a packet (e-) that stay filled in equilibrium after the packet has left.
    fn held_per_px(&self, cloud: &Cloud, charge_e: f64) -> f64 {
        let held = |trap: &Trap| trap.density_per_px * trap.passage_of(cloud, charge_e).1;
        if !self.returns() {
            return held(self);
        }
        // The returned charge depends on the release time.
        continuum::resolved(&[*self], WIDEST, continuum::FINEST).iter().map(held).sum()
    }
}

/// How the transfers are computed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Method {
    /// Runge-Kutta methods for the *difference* equation of the transfers, with error control. `relative` is the error
    /// allowed in the charge of the packets, as estimated, in units of their change, both as root mean squares over the
    /// columns around the brightest pixel.
    Fast {
        /// Error of the packets over their change.
        relative: f64,
    },
    /// Every transfer of every packet, one by one.
    Exact,
    /// The same, but the traps of a pixel are not empty when its first packet arrives: they start in the state in which the next
    /// pixel nearer to the register was left by its own first packet. The default of ArCTIc (`empty_traps_for_first_transfers =
    /// False`). Charge is not conserved.
    CarriedTraps,
    /// The paper's fractional traps: each species is cut into `levels` traps at fixed heights, whose filling is a
    /// fraction. Every transfer is done. (Rhodes et al. 2010, section 3: 10 000 levels.)
    Fractional {
        /// Number of heights between 0 and 1.
        levels: usize,
    },
    /// The paper's real traps: whole numbers of them at random positions and heights that capture and release whole electrons at
    /// random. One realisation per seed.
    MonteCarlo {
        /// The same seed gives the same bits, regardless of the number of threads.
        seed: u64,
    },
}

impl Method {
    /// Whether traps are at random positions, different in each column.
    pub fn is_random(self) -> bool {
        matches!(self, Method::MonteCarlo { .. })
    }

    /// The same without randomness: the limit of the mean over many random sets of traps.
    pub fn expected(self) -> Method {
        match self {
            Method::MonteCarlo { .. } => Method::Exact,
            other => other,
        }
    }
}

/// What lies between row 0 of an image and the register.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Downstream {
    /// Number of rows; row r of the image makes r + 1 + rows transfers. Negative if the image reaches past the
    /// register: those rows make no transfer.
    pub rows: i64,
    /// Charge of the packets in those rows before readout, e-. They pass before row 0 and leave the traps in their reach full (with
    /// instantaneous capture this is the steady state of any number of equal packets), or as full as they could get. 0: the traps
    /// are empty when row 0 arrives.
    pub charge_e: f64,
}

impl Downstream {
    /// The image touches the register: row r makes r + 1 transfers and finds empty traps.
    pub const NONE: Downstream = Downstream { rows: 0, charge_e: 0.0 };
}

/// A detector's traps and wells, and the method for its transfers.
#[derive(Clone, Debug, PartialEq)]
pub struct Readout {
    /// Trap species.
    pub traps: Vec<Trap>,
    /// How high a charge cloud reaches.
    pub cloud: Cloud,
    /// The computing method.
    pub method: Method,
}

/// Calls `$body` with `$width` bound to the first of some widths that is large enough for the species; the last one must be.
macro_rules! with_width {
    ([$last:expr], $species:expr, |$width:ident| $body:expr) => {{
        const $width: usize = $last;
        $body
    }};
    ([$first:expr, $($more:expr),+], $species:expr, |$width:ident| $body:expr) => {
        if $species <= $first {
            const $width: usize = $first;
            $body
        } else {
            with_width!([$($more),+], $species, |$width| $body)
        }
    };
}

mod carried;
mod traps_of_each;

/// Maximum number of release times into which all species together are resolved.
const WIDEST: usize = 256;

/// Maximum number of species in one readout.
pub const MAX_SPECIES: usize = 128;

impl Readout {
    /// Clocks an image out along its rows.
    ///
    /// `image[[row, column]]`, electrons, row 0 nearest the register; the same shape comes back. Columns are
    /// independent of one another and are computed in parallel; the result does not depend on the number of threads.
    ///
    /// # Panics
    /// With more than [`MAX_SPECIES`] species; if species with finite capture times have different clouds.
    pub fn parallel(&self, image: &Array2<f64>, downstream: Downstream) -> Array2<f64> {
        self.along(image, Journey::of(downstream.rows), &vec![downstream.charge_e; image.ncols()], Axis(0))
    }

    /// [`Readout::parallel`] if each column has its own background downstream: `charge_e[column]` in `rows` rows, as in
    /// [`Downstream`].
    ///
    /// # Panics
    /// With more than [`MAX_SPECIES`] species, or if the number of backgrounds is not that of the columns.
    pub fn parallel_after_each(&self, image: &Array2<f64>, rows: i64, charge_e: &[f64]) -> Array2<f64> {
        self.along(image, Journey::of(rows), charge_e, Axis(0))
    }

    /// Clocks an image out along its columns, column 0 nearest the amplifier: the same code with the axes swapped.
    ///
    /// # Panics
    /// With more than [`MAX_SPECIES`] species; if species with finite capture times have different clouds.
    pub fn serial(&self, image: &Array2<f64>, downstream: Downstream) -> Array2<f64> {
        self.along(image, Journey::of(downstream.rows), &vec![downstream.charge_e; image.nrows()], Axis(1))
    }

    /// [`Readout::serial`] if each row has its own background downstream: `charge_e[row]` in `columns` columns, as in
    /// [`Downstream`].
    ///
    /// # Panics
    /// With more than [`MAX_SPECIES`] species, or if the number of backgrounds is not that of the rows.
    pub fn serial_after_each(&self, image: &Array2<f64>, columns: i64, charge_e: &[f64]) -> Array2<f64> {
        self.along(image, Journey::of(columns), charge_e, Axis(1))
    }

    /// Clocks out one column of packets (e-), packet 0 nearest the register.
    ///
    /// # Panics
    /// With more than [`MAX_SPECIES`] species; if species with finite capture times have different clouds.
    pub fn column(&self, charge_e: &[f64], downstream: Downstream) -> Vec<f64> {
        let image = Array2::from_shape_vec((charge_e.len(), 1), charge_e.to_vec()).expect("one column");
        self.parallel(&image, downstream).into_raw_vec_and_offset().0
    }

    /// The image before [`Readout::parallel`], from the image read: the transfers in reverse order, for about the work of one
    /// readout. With every method, blocks of pixels are reversed as [`Method::Fast`] passes them. None for finite capture times or
    /// species with clouds of their own, whose pixels have to be passed one by one.
    ///
    /// # Panics
    /// With more than [`MAX_SPECIES`] species.
    pub fn parallel_reversed(
        &self,
        read: &Array2<f64>,
        downstream: Downstream,
        allowed: Allowed,
    ) -> Option<Array2<f64>> {
        self.in_blocks(read, (Journey::of(downstream.rows), downstream.charge_e), Axis(0), (Towards::Light, allowed))
    }

    /// The same for [`Readout::serial`].
    ///
    /// # Panics
    /// With more than [`MAX_SPECIES`] species.
    pub fn serial_reversed(&self, read: &Array2<f64>, downstream: Downstream, allowed: Allowed) -> Option<Array2<f64>> {
        self.in_blocks(read, (Journey::of(downstream.rows), downstream.charge_e), Axis(1), (Towards::Light, allowed))
    }

    /// [`Readout::parallel`] with an allowed error, as coarsely as it admits. For methods other than [`Method::Fast`], finite
    /// capture times, or species with clouds of their own, the image is read out by the method.
    ///
    /// # Panics
    /// As [`Readout::parallel`].
    pub fn parallel_within(&self, image: &Array2<f64>, downstream: Downstream, allowed: Allowed) -> Array2<f64> {
        self.within(image, (Journey::of(downstream.rows), downstream.charge_e), Axis(0), allowed)
            .unwrap_or_else(|| self.parallel(image, downstream))
    }

    /// The same for [`Readout::serial`].
    ///
    /// # Panics
    /// As [`Readout::serial`].
    pub fn serial_within(&self, image: &Array2<f64>, downstream: Downstream, allowed: Allowed) -> Array2<f64> {
        self.within(image, (Journey::of(downstream.rows), downstream.charge_e), Axis(1), allowed)
            .unwrap_or_else(|| self.serial(image, downstream))
    }

    /// The same readout without randomness: the limit of the mean over many random sets of traps.
    pub fn expected(&self) -> Readout {
        Readout { method: self.method.expected(), ..self.clone() }
    }

    /// Packets downstream as they are when they pass: each has filled the empty traps of the pixel it started in, and then finds
    /// traps that an equal packet has just filled.
    fn settled_e(&self, charge_e: f64) -> f64 {
        let (clouds, of) = several_clouds::clouds_of(&self.traps, &self.cloud);
        let spent_e: f64 = (0..clouds.len())
            .map(|cloud| {
                let species = self.traps.iter().zip(&of).filter(|(_, of)| **of == cloud);
                let held = species.map(|(trap, _)| trap.held_per_px(&clouds[cloud], charge_e)).sum::<f64>();
                held * clouds[cloud].height(charge_e)
            })
            .sum();
        (charge_e - spent_e).max(0.0)
    }

    /// `charge_e`: what lies downstream of each column.
    fn along(&self, image: &Array2<f64>, journey: Journey, charge_e: &[f64], transfer: Axis) -> Array2<f64> {
        assert!(self.traps.len() <= MAX_SPECIES, "at most {MAX_SPECIES} trap species");
        let across = Axis(1 - transfer.index());
        assert_eq!(charge_e.len(), image.len_of(across), "one background for each column");
        // Without traps, or if no trap retains charge, there is nothing to do.
        let traps: Vec<Trap> = self.traps.iter().filter(|trap| trap.density_per_px > 0.0).copied().collect();
        let rows = image.len_of(transfer);
        if image.is_empty() || traps.is_empty() {
            return image.clone();
        }
        let traps = continuum::resolved(&traps, WIDEST, continuum::error_of(self.method));
        let settled_e = |charge_e: &f64| if journey.fill_their_own { self.settled_e(*charge_e) } else { *charge_e };
        let settled_e: Vec<f64> = charge_e.iter().map(settled_e).collect();
        let settled = |column: u64| Downstream { rows: journey.rows, charge_e: settled_e[column as usize] };
        let pixels = || journey.pixels(rows);
        let (clouds, cloud_of) = several_clouds::clouds_of(&traps, &self.cloud);
        let each_cloud: Vec<&Cloud> = cloud_of.iter().map(|place| &clouds[*place]).collect();
        let takes_time = traps.iter().any(|trap| trap.capture_transfers > 0.0);
        let by_column = |column: &(dyn Fn(&mut [f64], u64) + Sync)| columns(image, across, column);
        match self.method {
            Method::Fractional { levels } => by_column(&|charge_e, column| {
                fractional::column(&traps, &each_cloud, charge_e, settled(column), pixels(), levels);
            }),
            Method::MonteCarlo { seed } => by_column(&|charge_e, column| {
                monte_carlo::column(&traps, &each_cloud, charge_e, settled(column), pixels(), (seed, column));
            }),
            Method::CarriedTraps => self.carried(&traps, (clouds, cloud_of), image, journey.rows, charge_e, across),
            _ if takes_time => {
                assert!(clouds.len() == 1, "capture that takes time needs one cloud for all species");
                self.slowly(&traps, &clouds[0], image, journey, charge_e, across)
            }
            Method::Exact if clouds.len() > 1 => {
                let pixel = SeveralClouds::new(&traps, (clouds, cloud_of), rows);
                by_column(&|charge_e, column| {
                    every_transfer::column_of_several_clouds(&pixel, charge_e, settled(column), pixels());
                })
            }
            Method::Fast { relative } if clouds.len() > 1 => {
                let pixel = SeveralClouds::new(&traps, (clouds, cloud_of), rows);
                side_by_side(&pixel, image, journey, &settled_e, across, Course::InSteps { relative })
            }
            Method::Exact => by_column(&|charge_e, column| {
                every_transfer::column(&traps, &clouds[0], charge_e, settled(column), pixels());
            }),
            Method::Fast { relative } if traps.iter().any(Trap::returns) => {
                with_width!([pixel::FEW, WIDEST], traps.len(), |WIDTH| {
                    let pixel = Pixel::<WIDTH, true>::new(&traps, clouds[0].clone(), rows);
                    side_by_side(&pixel, image, journey, &settled_e, across, Course::InSteps { relative })
                })
            }
            Method::Fast { relative } => with_width!([3, pixel::FEW, WIDEST], traps.len(), |WIDTH| {
                let pixel = Pixel::<WIDTH, false>::new(&traps, clouds[0].clone(), rows);
                side_by_side(&pixel, image, journey, &settled_e, across, Course::InSteps { relative })
            }),
        }
    }

    /// See [`Readout::parallel_within`].
    fn within(
        &self,
        image: &Array2<f64>,
        downstream: (Journey, f64),
        transfer: Axis,
        allowed: Allowed,
    ) -> Option<Array2<f64>> {
        let fast = matches!(self.method, Method::Fast { .. });
        fast.then(|| self.in_blocks(image, downstream, transfer, (Towards::Register, allowed))).flatten()
    }

    /// Moves an image towards the register or the light, in equal blocks. None if pixels have to be passed one by one.
    fn in_blocks(
        &self,
        image: &Array2<f64>,
        (journey, background_e): (Journey, f64),
        transfer: Axis,
        (towards, allowed): (Towards, Allowed),
    ) -> Option<Array2<f64>> {
        assert!(self.traps.len() <= MAX_SPECIES, "at most {MAX_SPECIES} trap species");
        let traps: Vec<Trap> = self.traps.iter().filter(|trap| trap.density_per_px > 0.0).copied().collect();
        if image.is_empty() || traps.is_empty() {
            return Some(image.clone());
        }
        let traps = continuum::resolved(&traps, WIDEST, continuum::error_of(self.method));
        let (clouds, _) = several_clouds::clouds_of(&traps, &self.cloud);
        if clouds.len() > 1 || traps.iter().any(|trap| trap.capture_transfers > 0.0) {
            return None;
        }
        let across = Axis(1 - transfer.index());
        let charge_e = vec![self.settled_e(background_e); image.len_of(across)];
        let (rows, course) = (image.len_of(transfer), Course::InBlocks(towards, allowed));
        Some(if traps.iter().any(Trap::returns) {
            with_width!([pixel::FEW, WIDEST], traps.len(), |WIDTH| {
                let pixel = Pixel::<WIDTH, true>::new(&traps, clouds[0].clone(), rows);
                side_by_side(&pixel, image, journey, &charge_e, across, course)
            })
        } else {
            with_width!([3, pixel::FEW, WIDEST], traps.len(), |WIDTH| {
                let pixel = Pixel::<WIDTH, false>::new(&traps, clouds[0].clone(), rows);
                side_by_side(&pixel, image, journey, &charge_e, across, course)
            })
        })
    }

    /// See [`Method::CarriedTraps`].
    fn carried(
        &self,
        traps: &[Trap],
        (clouds, cloud_of): (Vec<Cloud>, Vec<usize>),
        image: &Array2<f64>,
        rows_downstream: i64,
        charge_e: &[f64],
        across: Axis,
    ) -> Array2<f64> {
        let rows = image.len_of(Axis(1 - across.index()));
        // Number of packets that the traps of the last pixel have seen, in either sense.
        let packets = (2 * rows as i64 + rows_downstream).max(1) as usize;
        let background_e = |column: u64| (rows_downstream > 0).then_some(charge_e[column as usize]);
        if traps.iter().all(|trap| trap.capture_transfers == 0.0) {
            let pixel = SeveralClouds::new(traps, (clouds, cloud_of), packets);
            return columns(image, across, &|charge_e, column| {
                let mut stacks = Stacks::default();
                pixel.start(background_e(column), &mut stacks);
                every_transfer::carried(charge_e, rows_downstream, stacks, |stacks, charge_e, packet| {
                    pixel.packet(stacks, charge_e, packet).0
                });
            });
        }
        assert!(clouds.len() == 1, "capture that takes time needs one cloud for all species");
        with_width!([4, 16, 64, WIDEST], traps.len(), |WIDTH| {
            columns(image, across, &|charge_e, column| {
                let background = Downstream { rows: rows_downstream, charge_e: background_e(column).unwrap_or(0.0) };
                let pixel = FiniteCapturePixel::<WIDTH>::new(traps, clouds[0].clone(), background, packets, 0.0);
                let mut watermarks = Default::default();
                pixel.start(0, rows_downstream, &mut watermarks);
                every_transfer::carried(charge_e, rows_downstream, watermarks, |watermarks, charge_e, packet| {
                    pixel.packet(watermarks, charge_e, packet + 1).0
                });
            })
        })
    }

    /// For finite capture times: the columns of each background separately, since it is followed until it settles.
    fn slowly(
        &self,
        traps: &[Trap],
        cloud: &Cloud,
        image: &Array2<f64>,
        journey: Journey,
        charge_e: &[f64],
        across: Axis,
    ) -> Array2<f64> {
        let rows = image.len_of(Axis(1 - across.index()));
        let mut kinds: Vec<Vec<usize>> = Vec::new();
        for (column, background_e) in charge_e.iter().enumerate() {
            match kinds.iter_mut().find(|kind| charge_e[kind[0]].to_bits() == background_e.to_bits()) {
                Some(kind) => kind.push(column),
                None => kinds.push(vec![column]),
            }
        }
        let read = |kind: &Vec<usize>| {
            let image = image.select(across, kind);
            let downstream = Downstream { rows: journey.rows, charge_e: charge_e[kind[0]] };
            let cloud = cloud.clone();
            match self.method {
                Method::Fast { relative } => {
                    let brightest = image.iter().copied().fold(0.0, f64::max);
                    let density: f64 = traps.iter().map(|trap| trap.density_per_px).sum();
                    let merge_e = MERGED * relative * density * cloud.height(brightest);
                    with_width!([4, 16, 64, WIDEST], traps.len(), |WIDTH| {
                        let pixel = FiniteCapturePixel::<WIDTH>::new(traps, cloud, downstream, rows, merge_e);
                        let background_e = vec![downstream.charge_e; kind.len()];
                        side_by_side(&pixel, &image, journey, &background_e, across, Course::InSteps { relative })
                    })
                }
                _ => with_width!([4, 16, 64, WIDEST], traps.len(), |WIDTH| {
                    let pixel = FiniteCapturePixel::<WIDTH>::new(traps, cloud, downstream, rows, 0.0);
                    columns(&image, across, &|charge_e, _| {
                        every_transfer::slow_column(&pixel, charge_e, journey.rows, journey.pixels(rows))
                    })
                }),
            }
        };
        let parts: Vec<Array2<f64>> = kinds.par_iter().map(read).collect();
        let mut trailed = Array2::zeros(image.raw_dim());
        for (kind, part) in kinds.iter().zip(parts) {
            for (column, charge_e) in kind.iter().zip(part.axis_iter(across)) {
                trailed.index_axis_mut(across, *column).assign(&charge_e);
            }
        }
        trailed
    }
}

/// From one end of a journey to the other.
#[derive(Clone, Copy)]
enum Course {
    /// To the register, by steps whose length and order follow from an accuracy relative to the packets' change.
    InSteps { relative: f64 },
    /// In equal blocks, with an allowed error.
    InBlocks(Towards, Allowed),
}

/// How a course is divided, chosen with the charges known.
#[derive(Clone, Copy)]
enum Plan {
    InSteps(Aim),
    InBlocks(Towards, Division),
}

/// Reads an image out or reverses that, several columns at a time; `charge_e` lies downstream of each column.
fn side_by_side<P: Passage>(
    pixel: &P,
    image: &Array2<f64>,
    journey: Journey,
    charge_e: &[f64],
    across: Axis,
    course: Course,
) -> Array2<f64> {
    // Rows along the transfers, columns across.
    let image = if across.index() == 1 { image.view() } else { image.t() };
    let columns = DuplicateColumns::of(image, charge_e);
    let groups: Vec<&[usize]> = columns.distinct.chunks(LANES).collect();
    let rows = image.nrows();
    let lead = |group: &[usize]| {
        let charge_e = simd::side_by_side(charge_e, group);
        Lead { rows: journey.rows, charge_e, pixels: journey.pixels(rows) }
    };
    // Errors are compared with the changes around the brightest pixel. One group is enough, and costs one pass.
    let brightest = groups[brightest(image, &columns.distinct) / LANES];
    let mut brightest_e = Vec::new();
    simd::gather(image, brightest, &mut brightest_e);
    let mut work = Workspace::new(rows);
    let plan = match course {
        Course::InSteps { relative } => {
            Plan::InSteps(multirevolution::aim(pixel, &brightest_e, &lead(brightest), relative, &mut work))
        }
        Course::InBlocks(towards, allowed) => {
            let division = Division::of(pixel, &brightest_e, &lead(brightest), towards, allowed, &mut work);
            Plan::InBlocks(towards, division)
        }
    };

    let mut trailed = Array2::zeros((rows, columns.distinct.len()));
    let read = |(charge_e, work): &mut (Vec<Packets>, Workspace<P::Watermarks>), group, mut out: ArrayViewMut2<f64>| {
        simd::gather(image, group, charge_e);
        match plan {
            Plan::InSteps(aim) => multirevolution::columns(pixel, charge_e, &lead(group), aim, work),
            Plan::InBlocks(towards, division) => {
                equal_blocks::columns(pixel, charge_e, &lead(group), (towards, division), work);
            }
        }
        for (mut out, charge_e) in out.rows_mut().into_iter().zip(charge_e) {
            let out = out.as_slice_mut().expect("columns side by side");
            out.copy_from_slice(&charge_e[..out.len()]);
        }
    };
    let parts = trailed.axis_chunks_iter_mut(Axis(1), LANES);
    if groups.len() <= GROUPS_PER_TASK {
        let mut buffers = (brightest_e, work);
        parts.into_iter().zip(groups).for_each(|(out, group)| read(&mut buffers, group, out));
    } else {
        // A few megabytes, kept from task to task: allocating them takes the system as long as computing a group.
        let spare = Mutex::new(vec![(brightest_e, work)]);
        let spares = || spare.lock().unwrap_or_else(PoisonError::into_inner);
        (parts.into_par_iter(), groups).into_par_iter().with_min_len(GROUPS_PER_TASK).for_each(|(out, group)| {
            let taken = spares().pop();
            let mut buffers = taken.unwrap_or_else(|| (Vec::new(), Workspace::new(rows)));
            read(&mut buffers, group, out);
            spares().push(buffers);
        });
    }
    let trailed = columns.spread(trailed);
    if across.index() == 1 { trailed } else { trailed.reversed_axes() }
}

/// The column with the brightest pixel, as an index into `distinct`.
fn brightest(image: ArrayView2<f64>, columns: &[usize]) -> usize {
    let mut brightest_e = vec![f64::NEG_INFINITY; image.ncols()];
    for charge_e in image.rows() {
        for (brightest_e, charge_e) in brightest_e.iter_mut().zip(simd::in_one_piece(charge_e).iter()) {
            *brightest_e = if charge_e > brightest_e { *charge_e } else { *brightest_e };
        }
    }
    let brighter = |best: usize, place: usize| {
        if brightest_e[columns[place]] > brightest_e[columns[best]] { place } else { best }
    };
    (0..columns.len()).fold(0, brighter)
}

/// Share of the requested accuracy times a pixel's trap capacity that one merger of watermarks may misplace, for finite capture
/// times: there may be a merger for every packet and pixel.
const MERGED: f64 = 1e-3;

/// Groups of columns that one thread takes at a time: the columns of a stamp are done sooner than a thread wakes up.
const GROUPS_PER_TASK: usize = 4;

/// An image with a function applied to each of its columns, which are identified by their number.
fn columns(image: &Array2<f64>, across: Axis, column: &(dyn Fn(&mut [f64], u64) + Sync)) -> Array2<f64> {
    let mut trailed = image.clone();
    trailed.axis_iter_mut(across).into_par_iter().enumerate().for_each(|(number, mut lane)| {
        interrupt::check();
        let mut charge_e = lane.to_vec();
        column(&mut charge_e, number as u64);
        lane.assign(&ArrayView1::from(&charge_e));
    });
    trailed
}
