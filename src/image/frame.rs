//! Position of the amplifiers, and the pixels of a frame that hold light.
//!
//! ```text
//!         columns as they are read, the first nearest the amplifier
//!         ◀──────────────────────────────────────────────
//!        ┌─────────┬───────────────────────┬─────────────┐
//!    ▲   │         │     overscan rows     │             │  read after the image: no light, but all transfers
//!   rows │         ├───────────────────────┤             │
//!        │ prescan │                       │  overscan   │
//!        │         │         image         │   columns   │
//!    │   │         │                       │             │
//!        └─────────┴───────────────────────┴─────────────┘
//!                         rows before                       between row 0 and the register, not in the frame
//!   amplifier ◀ columns before ◀ ═══ serial register ═══
//! ```
//!
//! Charge is clocked down through all rows to the register and then along it to the amplifier. Pixels of the prescan and the
//! overscan hold no charge before they are read: their content in the frame (bias, noise) was added by the amplifier and is
//! unchanged; trails of the image are added to it.

use ndarray::{Array2, ArrayView1, ArrayView2, ArrayViewMut2, Axis, Zip, s};

use super::trap_map::Factors;
use crate::error::InputError;
use crate::model::Device;
use crate::readout::{Allowed, Downstream};

/// Directions in which charge is clocked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Transfers {
    /// Along the columns, to the serial register.
    Parallel,
    /// Along the serial register, to the amplifier.
    Serial,
    /// Along the columns, then along the register.
    Both,
}

/// Corner of a frame that is read first, as displayed: its first pixel is at the lower left.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Corner {
    /// First row, first column.
    LowerLeft,
    /// First row, last column.
    LowerRight,
    /// Last row, first column.
    UpperLeft,
    /// Last row, last column.
    UpperRight,
}

/// Frames that are read by several amplifiers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Split {
    /// The left half is read to the left, the right half to the right.
    Columns,
    /// The lower half is read downwards, the upper half upwards.
    Rows,
    /// Each quarter is read to its corner.
    Both,
}

/// How a frame lies on the detector.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Geometry {
    /// Directions of transfer that are modelled.
    pub transfers: Transfers,
    /// The corner that is read first; overridden by the sides of split halves.
    pub corner: Corner,
    /// Amplifiers on both sides.
    pub split: Option<Split>,
    /// First columns read, from the serial register only.
    pub prescan_columns: usize,
    /// Last columns read, behind those of the image.
    pub overscan_columns: usize,
    /// Last rows read, behind those of the image.
    pub overscan_rows: usize,
    /// Rows between the frame's first row and the serial register.
    pub rows_before: u32,
    /// Charge in those rows before readout, e- per pixel.
    pub charge_before_e: f64,
    /// Pixels of the serial register between the frame's first column and the amplifier; dark.
    pub columns_before: u32,
}

impl Default for Geometry {
    /// A frame with only light, at the register and the amplifier, read through its lower left corner along its columns.
    fn default() -> Geometry {
        Geometry {
            transfers: Transfers::Parallel,
            corner: Corner::LowerLeft,
            split: None,
            prescan_columns: 0,
            overscan_columns: 0,
            overscan_rows: 0,
            rows_before: 0,
            charge_before_e: 0.0,
            columns_before: 0,
        }
    }
}

impl Corner {
    /// Whether the last column is read first.
    pub fn is_right(self) -> bool {
        matches!(self, Corner::LowerRight | Corner::UpperRight)
    }

    /// Whether the last row is read first.
    pub fn is_upper(self) -> bool {
        matches!(self, Corner::UpperLeft | Corner::UpperRight)
    }
}

impl Transfers {
    /// Whether charge is clocked along columns.
    pub fn parallel(self) -> bool {
        self != Transfers::Serial
    }

    /// Whether charge is clocked along the serial register.
    pub fn serial(self) -> bool {
        self != Transfers::Parallel
    }
}

impl Geometry {
    /// Checks that a frame of this shape (rows, columns) can be read like this.
    ///
    /// # Errors
    /// If prescan and overscan leave no image, or the halves are unequal.
    pub fn check(&self, (rows, columns): (usize, usize)) -> Result<(), InputError> {
        let refusal = |problem: String| Err(InputError::new(format!("a frame of {columns} x {rows} px"), problem));
        if rows == 0 || columns == 0 {
            return refusal("there are no pixels".into());
        }
        let (across, along) = (self.splits_columns(), self.splits_rows());
        for (split, length, what) in [(across, columns, "columns"), (along, rows, "rows")] {
            if split && length % 2 == 1 {
                return refusal(format!("{length} {what} do not make two halves"));
            }
        }
        let columns = if across { columns / 2 } else { columns };
        let rows = if along { rows / 2 } else { rows };
        let dark = self.prescan_columns.saturating_add(self.overscan_columns);
        let half = |split: bool| if split { " of each half" } else { "" };
        if dark >= columns {
            return refusal(format!(
                "{} columns of prescan and {} of overscan leave none{} for the image",
                self.prescan_columns,
                self.overscan_columns,
                half(across)
            ));
        }
        if self.overscan_rows >= rows {
            return refusal(format!("{} rows of overscan leave none{} for the image", self.overscan_rows, half(along)));
        }
        Ok(())
    }

    /// Whether some pixels hold no light.
    pub fn has_dark_pixels(&self) -> bool {
        self.prescan_columns + self.overscan_columns + self.overscan_rows > 0
    }

    /// Pixels that hold light, in a frame of this shape.
    pub fn lit(&self, shape: (usize, usize)) -> Array2<bool> {
        let mut lit = Array2::from_elem(shape, false);
        for part in self.parts() {
            let mut part = part.of_mut(&mut lit);
            let (rows, columns) = self.image(part.dim());
            part.slice_mut(s![rows, columns]).fill(true);
        }
        lit
    }

    /// The positions of the amplifiers, in words.
    pub fn sides(&self) -> String {
        let corner = match self.corner {
            Corner::LowerLeft => "lower left",
            Corner::LowerRight => "lower right",
            Corner::UpperLeft => "upper left",
            Corner::UpperRight => "upper right",
        };
        match self.split {
            None => format!("read at the {corner}"),
            Some(Split::Columns) => format!("halves read to the left and to the right, {corner} first"),
            Some(Split::Rows) => format!("halves read downwards and upwards, {corner} first"),
            Some(Split::Both) => "quarters read to their corners".into(),
        }
    }

    /// The part of a frame that each amplifier reads, in the order of readout.
    pub fn amplifiers<T: Clone>(&self, frame: &Array2<T>) -> Vec<Array2<T>> {
        self.parts().into_iter().map(|part| part.of(frame).to_owned()).collect()
    }

    /// Factors of a frame's pixels → those of each part, in the order of readout.
    pub(super) fn factors(&self, factors: Option<&Factors>) -> Vec<Option<Factors>> {
        let of = |Part { rows, columns }: Part| {
            Some(factors?.ordered(|all| rows.0.places(all, rows.1), |all| columns.0.places(all, columns.1)))
        };
        self.parts().into_iter().map(of).collect()
    }

    /// Copies the parts from [`Geometry::amplifiers`] back into a frame.
    pub fn put_back<T: Clone>(&self, parts: &[Array2<T>], frame: &mut Array2<T>) {
        for (part, values) in self.parts().into_iter().zip(parts) {
            part.of_mut(frame).assign(values);
        }
    }

    /// Rows and columns of the image in an amplifier's part, in the order of readout.
    pub fn image(&self, (rows, columns): (usize, usize)) -> (std::ops::Range<usize>, std::ops::Range<usize>) {
        (0..rows - self.overscan_rows, self.prescan_columns..columns - self.overscan_columns)
    }

    fn splits_columns(&self) -> bool {
        matches!(self.split, Some(Split::Columns | Split::Both))
    }

    fn splits_rows(&self) -> bool {
        matches!(self.split, Some(Split::Rows | Split::Both))
    }

    /// The part of each amplifier.
    fn parts(&self) -> Vec<Part> {
        let corner = self.corner;
        let sides = |split: bool, mirrored: bool| match split {
            false => vec![(Side::Whole, mirrored)],
            true => vec![(Side::First, false), (Side::Second, true)],
        };
        let mut parts = Vec::new();
        for (vertical, upside_down) in sides(self.splits_rows(), corner.is_upper()) {
            for (horizontal, mirrored) in sides(self.splits_columns(), corner.is_right()) {
                parts.push(Part { rows: (vertical, upside_down), columns: (horizontal, mirrored) });
            }
        }
        parts
    }
}

#[derive(Clone, Copy)]
enum Side {
    Whole,
    First,
    Second,
}

/// The part of one amplifier: its half of the rows and of the columns, and whether they are read from the far end.
#[derive(Clone, Copy)]
struct Part {
    rows: (Side, bool),
    columns: (Side, bool),
}

impl Part {
    fn of<'a, T>(self, frame: &'a Array2<T>) -> ArrayView2<'a, T> {
        let mut view = frame.view();
        for (axis, (side, reversed)) in [(Axis(0), self.rows), (Axis(1), self.columns)] {
            view.slice_axis_inplace(axis, side.range(view.len_of(axis)));
            if reversed {
                view.invert_axis(axis);
            }
        }
        view
    }

    fn of_mut<'a, T>(self, frame: &'a mut Array2<T>) -> ArrayViewMut2<'a, T> {
        let mut view = frame.view_mut();
        for (axis, (side, reversed)) in [(Axis(0), self.rows), (Axis(1), self.columns)] {
            view.slice_axis_inplace(axis, side.range(view.len_of(axis)));
            if reversed {
                view.invert_axis(axis);
            }
        }
        view
    }
}

impl Side {
    fn range(self, length: usize) -> ndarray::Slice {
        match self {
            Side::Whole => (0..length).into(),
            Side::First => (0..length / 2).into(),
            Side::Second => (length / 2..length).into(),
        }
    }

    /// The indices of its part, in the order of readout.
    fn places(self, all: &[usize], reversed: bool) -> Vec<usize> {
        let mut places = ArrayView1::from(all);
        places.slice_axis_inplace(Axis(0), self.range(all.len()));
        if reversed {
            places.invert_axis(Axis(0));
        }
        places.to_vec()
    }
}

/// Reads a frame (e-, `[[row, column]]`, row 0 the lowest): from light and the amplifier's contributions to the same with trails.
///
/// Serial registers are those of the device; the number of transfers in their effect is ignored, since every column makes its own.
///
/// # Errors
/// If an effect has no value, here and below.
pub fn read(device: &Device, geometry: &Geometry, frame_e: &Array2<f64>) -> Result<Array2<f64>, InputError> {
    read_with(device, geometry, frame_e, None, None)
}

/// The same with factors on the densities of the pixels' traps, and with an allowed error for each direction of transfer, e-; none:
/// with the accuracy of the device.
///
/// # Errors
/// As [`read`].
pub fn read_with(
    device: &Device,
    geometry: &Geometry,
    frame_e: &Array2<f64>,
    factors: Option<&Factors>,
    allowed_e: Option<f64>,
) -> Result<Array2<f64>, InputError> {
    let mut read_e = frame_e.clone();
    for (part, factors) in geometry.parts().into_iter().zip(geometry.factors(factors)) {
        let clocked = clocked(device, geometry, part.of(frame_e), factors.as_ref(), allowed_e)?;
        part.of_mut(&mut read_e).assign(&clocked);
    }
    Ok(read_e)
}

/// A frame before [`read`], from the frame read: the transfers are reversed, with an allowed error, and the amplifier's values in
/// pixels without light are unchanged. Effects other than transfers are not undone. None if transfers cannot be reversed; see
/// [`crate::readout::Readout::parallel_reversed`].
pub fn before(
    device: &Device,
    geometry: &Geometry,
    read_e: &Array2<f64>,
    factors: Option<&Factors>,
    allowed: Allowed,
) -> Option<Array2<f64>> {
    let mut before_e = read_e.clone();
    for (part, factors) in geometry.parts().into_iter().zip(geometry.factors(factors)) {
        let mut part_e = part.of_mut(&mut before_e);
        let (rows, columns) = geometry.image(part_e.dim());
        let light_e = unclocked(device, geometry, part_e.view(), factors.as_ref(), allowed)?;
        part_e.slice_mut(s![rows, columns]).assign(&light_e);
    }
    Some(before_e)
}

/// The image in one amplifier's part, in the order of readout, before its transfers.
fn unclocked(
    device: &Device,
    geometry: &Geometry,
    part_e: ArrayView2<f64>,
    factors: Option<&Factors>,
    allowed: Allowed,
) -> Option<Array2<f64>> {
    // Pixels read after the image have not affected it.
    let (rows, columns) = geometry.image(part_e.dim());
    let mut read_e = part_e.slice(s![rows.clone(), ..columns.end]).to_owned();
    if geometry.transfers.serial() {
        // Dark pixels in front pass empty traps.
        read_e.slice_mut(s![.., ..columns.start]).fill(0.0);
        let downstream = Downstream { rows: geometry.columns_before.into(), charge_e: 0.0 };
        for (register, _) in device.serial().iter().rev() {
            read_e = register.serial_reversed(&read_e, downstream, allowed)?;
        }
    }
    let light_e = read_e.slice_move(s![.., columns.clone()]);
    if !geometry.transfers.parallel() {
        return Some(light_e);
    }
    let downstream = Downstream { rows: geometry.rows_before.into(), charge_e: geometry.charge_before_e };
    let readout = device.readout();
    match factors {
        Some(factors) => factors.part(rows, columns).parallel_reversed(&readout, &light_e, downstream, allowed),
        None => readout.parallel_reversed(&light_e, downstream, allowed),
    }
}

/// One amplifier's part, in the order of readout.
pub(super) fn clocked(
    device: &Device,
    geometry: &Geometry,
    part_e: ArrayView2<f64>,
    factors: Option<&Factors>,
    allowed_e: Option<f64>,
) -> Result<Array2<f64>, InputError> {
    let allowed = allowed_e.map(|error_e| Allowed { relative: 0.0, error_e });
    let (rows, columns) = geometry.image(part_e.dim());
    let image = s![rows, columns.clone()];
    let mut light_e = part_e.slice(image).to_owned();
    // Other effects on charge belong to the pixels, and are applied with them.
    if geometry.transfers.parallel() {
        light_e = device.before(light_e)?;
    }
    let mut before_e = Array2::zeros(part_e.raw_dim());
    before_e.slice_mut(image).assign(&light_e);
    let mut read_e = before_e.clone();
    if geometry.transfers.parallel() {
        // Overscan rows are empty rows above the image. No charge is captured or released above the topmost existing row, so they
        // may be clocked as if there were pixels for them: only the transfers below count.
        let downstream = Downstream { rows: geometry.rows_before.into(), charge_e: geometry.charge_before_e };
        let mut lit = read_e.slice_mut(s![.., columns.clone()]);
        let (readout, lit_e) = (device.readout(), lit.to_owned());
        let trailed = match (factors, allowed) {
            (Some(factors), _) => {
                factors.part(0..lit_e.nrows(), columns).parallel(&readout, &lit_e, downstream, allowed)
            }
            (None, Some(allowed)) => readout.parallel_within(&lit_e, downstream, allowed),
            (None, None) => readout.parallel(&lit_e, downstream),
        };
        lit.assign(&trailed);
    }
    if geometry.transfers.serial() {
        let downstream = Downstream { rows: geometry.columns_before.into(), charge_e: 0.0 };
        for (register, _) in device.serial() {
            read_e = match allowed {
                Some(allowed) => register.serial_within(&read_e, downstream, allowed),
                None => register.serial(&read_e, downstream),
            };
        }
    }
    if geometry.transfers.parallel() {
        read_e = device.amplified(&before_e, read_e)?;
    }
    // The amplifier's contribution in pixels without light.
    let mut added_e = part_e.to_owned();
    added_e.slice_mut(image).fill(0.0);
    Zip::from(&mut read_e).and(&added_e).for_each(|read, added| *read += added);
    Ok(read_e)
}
