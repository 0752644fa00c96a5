//! Packets and blocks, many at a time: those with the same wells and transfers are columns of one image.

use std::cmp::Ordering;

use ndarray::{Array2, s};

use super::{Probed, Reading};
use crate::error::InputError;
use crate::model::{Beside, Device};
use crate::numeric::parallel;
use crate::physics::conditions::Conditions;
use crate::readout::{Readout, Trap};

/// Columns of an image, backgrounds included: as many as SIMD reads side by side. The accuracy of a readout is relative to its
/// brightest column, so a few columns of similar charge are better than many.
const TOGETHER: usize = 16;

/// Charges less the trailed background, e-: of the packet or the block's last row, and of the pixels behind it. None for readings
/// of other kinds.
///
/// # Errors
/// If an effect has no value.
pub(super) fn read(readings: &[Reading], devices: &[Device]) -> Result<Vec<Option<Vec<f64>>>, InputError> {
    let devices: Vec<Option<Device>> = parallel::map(readings.iter().zip(devices), |(reading, device)| {
        matches!(reading.kind, Probed::Packet | Probed::Block).then(|| device.expected())
    });
    let columns: Vec<Column> = readings
        .iter()
        .zip(&devices)
        .enumerate()
        .filter_map(|(index, (reading, device))| Some(Column::new(index, reading, device.as_ref()?)))
        .collect();
    let mut groups: Vec<Vec<Column>> = Vec::new();
    for column in columns {
        match groups.iter_mut().find(|group| group[0].shares_a_readout_with(&column)) {
            Some(group) => group.push(column),
            None => groups.push(vec![column]),
        }
    }
    for group in &mut groups {
        // The order of the rows of a table must not matter.
        group.sort_by(Column::order);
    }
    let images: Vec<&[Column]> = groups.iter().flat_map(|group| images(group)).collect();
    let mut found = vec![None; readings.len()];
    for image in parallel::map(images, together) {
        for (index, charge_e) in image? {
            found[index] = Some(charge_e);
        }
    }
    Ok(found)
}

/// Cuts a group into images: each of its columns takes one, and each background another.
fn images<'a, 'b>(mut group: &'a [Column<'b>]) -> Vec<&'a [Column<'b>]> {
    let mut images = Vec::new();
    while !group.is_empty() {
        let mut backgrounds: Vec<(f64, &[Trap])> = Vec::new();
        let mut fitting = 0;
        for column in group {
            let background = (column.device.at.background_e, &*column.readout.traps);
            if !backgrounds.contains(&background) {
                backgrounds.push(background);
            }
            if fitting + 1 + backgrounds.len() > TOGETHER {
                break;
            }
            fitting += 1;
        }
        let (image, rest) = group.split_at(fitting);
        images.push(image);
        group = rest;
    }
    images
}

/// A packet or a block in a column of background.
struct Column<'a> {
    /// Index of the reading among all.
    index: usize,
    reading: &'a Reading<'a>,
    device: &'a Device,
    readout: Readout,
    /// Rows that hold the signal.
    block_px: usize,
    /// Whether the rows ahead of these hold the same: the rest of a block that is so long that its front is not felt.
    within_flat: bool,
    /// Whether columns with other traps may be beside it.
    has_room_beside: bool,
}

impl<'a> Column<'a> {
    fn new(index: usize, reading: &'a Reading<'a>, device: &'a Device) -> Column<'a> {
        let readout = device.readout();
        let plain = device.store.is_none() && device.persistence.is_none();
        let has_room_beside = plain && readout.has_room_beside();
        let block_px = match reading.kind {
            Probed::Block => device.at.block_px.expect("a block has rows") as usize,
            _ => 1,
        };
        let mut column = Column { index, reading, device, readout, block_px, within_flat: false, has_room_beside };
        if plain {
            column.omit_the_front();
        }
        column
    }

    /// Keeps the last rows of a long block, with the rest as background ahead of them.
    fn omit_the_front(&mut self) {
        let (background_e, transfers) = (self.device.at.background_e, f64::from(self.device.at.transfers));
        let behind_brighter = self.device.at.preceding_e.is_some();
        let until_flat = self.readout.rows_until_flat(self.signal_e(), background_e, transfers, behind_brighter);
        // Few different lengths, so that columns of slightly different traps are read side by side.
        let rows = until_flat.min(self.block_px as f64).ceil() as usize;
        let kept = rows.next_multiple_of((rows.next_power_of_two() / 4).max(1));
        if kept < self.block_px {
            (self.block_px, self.within_flat) = (kept, true);
        }
    }

    /// By the number of traps, since accuracy is relative to the largest changes; then by charge.
    fn order(&self, other: &Column) -> Ordering {
        let key = |column: &Column| {
            let traps = &column.readout.traps;
            let mut key = vec![traps.iter().map(|trap| trap.density_per_px).sum::<f64>()];
            key.extend(traps.iter().flat_map(|trap| [trap.density_per_px, trap.release_transfers]));
            key.extend([column.signal_e(), column.device.at.background_e]);
            key
        };
        let (ours, theirs) = (key(self), key(other));
        let differences = ours.iter().zip(&theirs).map(|(ours, theirs)| ours.total_cmp(theirs));
        differences.fold(Ordering::Equal, Ordering::then)
    }

    fn signal_e(&self) -> f64 {
        self.device.at.signal_e.expect("a packet has a charge")
    }

    /// The columns beside it in a serial register.
    fn beside(&self) -> Beside {
        if self.reading.kind == Probed::Block { Beside::Same } else { Beside::Background }
    }

    /// Rows ahead of the signal that belong to the image: from a preceding packet on, if it is felt.
    fn rows_ahead(&self) -> usize {
        if self.within_flat { 0 } else { self.device.at.preceding_px.unwrap_or(0) as usize }
    }

    /// The last row of the signal makes the device's transfers; background lies downstream.
    fn rows_downstream(&self) -> i64 {
        i64::from(self.device.at.transfers) - (self.rows_ahead() + self.block_px) as i64
    }

    fn shares_a_readout_with(&self, other: &Column) -> bool {
        self.block_px == other.block_px
            && self.rows_ahead() == other.rows_ahead()
            && self.rows_downstream() == other.rows_downstream()
            && (self.readout == other.readout || (self.has_room_beside && other.has_room_beside))
            && self.readout.cloud == other.readout.cloud
            && self.readout.method == other.readout.method
            && self.device.store == other.device.store
            && self.device.persistence == other.device.persistence
    }

    /// Charges (e-) that are clocked out, `[[row, 0]]`: with the signal and what precedes it, and of background alone.
    fn before(&self, rows: usize) -> Result<[Array2<f64>; 2], InputError> {
        let Conditions { background_e, preceding_e, .. } = self.device.at;
        let flat = Array2::from_elem((rows, 1), background_e);
        let mut image = flat.clone();
        if let Some(preceding_e) = preceding_e {
            image[[0, 0]] += preceding_e;
        }
        let first = self.rows_ahead();
        image.slice_mut(s![first..first + self.block_px, ..]).fill(background_e + self.signal_e());
        Ok([self.device.before(image)?, self.device.before(flat)?])
    }
}

/// Reads out columns that share a readout.
fn together<'a>(columns: &'a [Column]) -> Result<Vec<(usize, Vec<f64>)>, InputError> {
    let first = &columns[0];
    // Background behind a packet changes nothing before it.
    let behind = columns.iter().map(|column| column.reading.trail_px).max().unwrap_or(0);
    let rows = first.rows_ahead() + first.block_px + behind;
    let mut image = Array2::zeros((rows, 0));
    let (mut downstream_e, mut traps) = (Vec::new(), Vec::<&[Trap]>::new());
    // Most backgrounds are equal.
    let mut place = |charge_e: &Array2<f64>, ahead_e: f64, column: &'a Column| {
        let known = |place: &usize| {
            image.column(*place) == charge_e.column(0)
                && downstream_e[*place] == ahead_e
                && traps[*place] == column.readout.traps
        };
        let place = (0..image.ncols()).find(known);
        place.unwrap_or_else(|| {
            image.push_column(charge_e.column(0)).expect("columns of one length");
            downstream_e.push(ahead_e);
            traps.push(&column.readout.traps);
            image.ncols() - 1
        })
    };
    let mut placed = Vec::new();
    for column in columns {
        let [signal, flat] = column.before(rows)?;
        let background_e = column.device.at.background_e;
        let ahead_e = if column.within_flat { signal[[0, 0]] } else { background_e };
        placed.push([(place(&signal, ahead_e, column), signal), (place(&flat, background_e, column), flat)]);
    }
    let clocked = match columns.iter().all(|column| column.readout.traps == first.readout.traps) {
        true => first.device.clocked(&image, first.rows_downstream(), &downstream_e),
        false => first.readout.parallel_with_traps_of_each(&image, first.rows_downstream(), &downstream_e, &traps),
    };
    // Backgrounds in equal registers; clouds and methods of these columns are equal.
    let mut flats: Vec<(usize, &Column, Array2<f64>)> = Vec::new();
    let mut found = Vec::new();
    for (column, placed) in columns.iter().zip(placed) {
        let [(signal, before_e), (flat, flat_before_e)] = placed;
        let device = column.device;
        let registered =
            |place: usize| device.through_registers(clocked.slice(s![.., place..=place]).to_owned(), column.beside());
        let known = flats.iter().find(|(place, other, _)| {
            *place == flat && other.beside() == column.beside() && other.device.registers == device.registers
        });
        let flat_e = known.map_or_else(|| registered(flat), |(.., flat_e)| flat_e.clone());
        if known.is_none() {
            flats.push((flat, column, flat_e.clone()));
        }
        let read_e = device.amplified(&before_e, registered(signal))? - device.amplified(&flat_before_e, flat_e)?;
        let last = column.rows_ahead() + column.block_px - 1;
        found.push((column.index, read_e.slice(s![last..=last + column.reading.trail_px, 0]).to_vec()));
    }
    Ok(found)
}
