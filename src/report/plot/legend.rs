//! Names of series with samples of their marks, in rows.

use super::drawing::{Anchor, Drawing};
use super::font::{fitted, length};
use super::pen::{Pen, SMALL};
use super::{BAND, Mark, SHADE, Series};

/// Height of a row, px.
const ROW: f64 = 19.0;
/// Width of a sample, px.
const SAMPLE: f64 = 28.0;

/// The legend of a panel.
pub struct Legend<'a> {
    entries: Vec<Entry<'a>>,
    width: f64,
}

/// One name.
struct Entry<'a> {
    label: &'a str,
    samples: Vec<&'a Series>,
    row: usize,
    /// Left edge of the sample within the legend, px.
    left: f64,
}

impl<'a> Legend<'a> {
    /// Entries from left to right in rows of a given width, px.
    pub fn new(series: &'a [Series], width: f64) -> Legend<'a> {
        let mut entries: Vec<Entry> = Vec::new();
        let (mut row, mut left) = (0, 0.0);
        for series in series {
            let Some(label) = series.label.as_deref().filter(|label| !label.is_empty()) else { continue };
            if let Some(entry) = entries.iter_mut().find(|entry| entry.label == label) {
                entry.samples.push(series);
                continue;
            }
            let advance = SAMPLE + 2.0 * SMALL + length(label, SMALL);
            if left > 0.0 && left + advance > width {
                (row, left) = (row + 1, 0.0);
            }
            entries.push(Entry { label, samples: vec![series], row, left });
            left += advance;
        }
        Legend { entries, width }
    }

    /// Height of all rows, px.
    pub fn height(&self) -> f64 {
        self.entries.last().map_or(0.0, |last| ROW * (last.row + 1) as f64)
    }

    /// Draws it from an upper left corner, px.
    pub fn draw(&self, drawing: &mut Drawing, left: f64, top: f64) {
        for entry in &self.entries {
            let middle = top + ROW * (entry.row as f64 + 0.3);
            for series in &entry.samples {
                sample(&mut Pen { drawing, color: series.color }, &series.kind, left + entry.left, middle);
            }
            let indent = entry.left + SAMPLE + 0.6 * SMALL;
            let size = fitted(entry.label, SMALL, self.width - indent);
            drawing.write(entry.label, size, (left + indent, middle), Anchor::Start);
        }
    }
}

/// The sample of a series.
fn sample(pen: &mut Pen, kind: &Mark, left: f64, middle: f64) {
    let at = |x: f64, y: f64| (left + x * SAMPLE, middle + y);
    match kind {
        Mark::Points { sigma, .. } => {
            if sigma.is_some() {
                pen.whisker(at(0.5, 8.0), at(0.5, -8.0));
            }
            pen.marker(at(0.5, 0.0), 1.0);
        }
        Mark::Line { dashed, .. } | Mark::Level { dashed, .. } => pen.line(vec![at(0.0, 0.0), at(1.0, 0.0)], *dashed),
        Mark::Band { .. } => pen.rectangle(at(0.0, 6.0), at(1.0, -6.0), BAND),
        Mark::Shade { .. } => pen.rectangle(at(0.0, 6.0), at(1.0, -6.0), SHADE),
    }
}
