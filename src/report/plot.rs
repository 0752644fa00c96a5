//! Numbers → figures as SVG, PDF or PNG. This module does not depend on the meaning of the numbers.
//!
//! Values that cannot be shown (not finite, beyond 1e±250, not positive on a logarithmic axis) are omitted: a point is missing, a
//! line or a band has a gap, an error bar is absent or ends at the frame.

mod axis;
mod drawing;
mod font;
pub mod label;
mod legend;
#[cfg(feature = "figures")]
mod outline;
#[cfg(feature = "figures")]
mod pdf;
mod pen;
#[cfg(feature = "figures")]
mod png;
mod svg;

use axis::Axis;
use drawing::{Anchor, Drawing, Point};
use font::{fitted, wrapped};
use legend::Legend;
use pen::{LARGE, NORMAL, Pen, SMALL};

/// Panels below each other, or in rows, under a title.
#[derive(Clone, Debug, Default)]
pub struct Figure {
    /// Above the panels; may be empty.
    pub title: String,
    /// From top to bottom. Panels with the same `x_label` and `x_log` have the same range of x; of adjacent ones among them, only
    /// the lowest has numbers on its axis.
    pub panels: Vec<Panel>,
}

/// A frame with its axes.
#[derive(Clone, Debug, Default)]
pub struct Panel {
    /// Quantity on the x axis, with its unit.
    pub x_label: String,
    /// Quantity on the y axis, with its unit.
    pub y_label: String,
    /// Whether x is logarithmic.
    pub x_log: bool,
    /// Whether y is logarithmic.
    pub y_log: bool,
    /// Whether x is a count: its axis has no fractions.
    pub x_counts: bool,
    /// The data; shades are lowest, then bands, points, levels and lines.
    pub series: Vec<Series>,
    /// Height relative to the other panels; values that are not positive count as 1.
    pub height_share: f64,
    /// Panels to the right of it. If a figure has any, all panels are squares in columns. Those of a row with the same `y_label`
    /// and `y_log` have the same range of y, and only the first of a row has its label and numbers.
    pub beside: Vec<Panel>,
}

/// A data series.
#[derive(Clone, Debug)]
pub struct Series {
    /// Its name in the legend; series of the same name share an entry.
    pub label: Option<String>,
    /// Colour and marker: 0 black circle, 1 blue square, 2 vermilion triangle, 3 green diamond, 4 purple inverted
    /// triangle, 5 orange star, 6 sky-blue cross, 7 yellow plus, 8 as 0.
    pub color: usize,
    /// The marks to be drawn.
    pub kind: Mark,
}

/// Marks; of vectors of unequal length, only the common part is drawn.
#[derive(Clone, Debug)]
#[allow(missing_docs)]
pub enum Mark {
    /// Markers, with bars of one `sigma` up and down.
    Points { x: Vec<f64>, y: Vec<f64>, sigma: Option<Vec<f64>> },
    /// Points joined in their order.
    Line { x: Vec<f64>, y: Vec<f64>, dashed: bool },
    /// The area between two lines.
    Band { x: Vec<f64>, low: Vec<f64>, high: Vec<f64> },
    /// A horizontal line across the frame.
    Level { y: f64, dashed: bool },
    /// An interval of x; an infinite end means the edge of the frame.
    Shade { from: f64, to: f64 },
}

/// A line through points.
pub fn line(label: &str, color: usize, x: &[f64], y: Vec<f64>) -> Series {
    Series { label: Some(label.into()), color, kind: Mark::Line { x: x.to_vec(), y, dashed: false } }
}

/// A line distinguished from another of its colour.
pub fn dashed(label: &str, color: usize, x: &[f64], y: Vec<f64>) -> Series {
    Series { label: Some(label.into()), color, kind: Mark::Line { x: x.to_vec(), y, dashed: true } }
}

/// Markers.
pub fn points(label: &str, color: usize, x: &[f64], y: Vec<f64>) -> Series {
    Series { label: Some(label.into()), color, kind: Mark::Points { x: x.to_vec(), y, sigma: None } }
}

/// A limit: dashed, in black, from edge to edge.
pub fn level(label: &str, y: f64) -> Series {
    Series { label: Some(label.into()), color: 0, kind: Mark::Level { y, dashed: true } }
}

/// Width of a figure, px, as for all lengths below. In the column of a paper it is half as wide, in pt.
const WIDTH: f64 = 480.0;
/// Mean and minimum height of a frame.
const FRAME: f64 = 220.0;
const FRAME_LEAST: f64 = 60.0;
/// Heights of a line of the title, and of numbers and label of an x axis.
const HEAD: f64 = 20.0;
const FOOT: f64 = 44.0;
/// Space around frames, and between labels and the left edge of the figure.
const GAP: f64 = 12.0;
const EDGE: f64 = 4.0;
/// Space between adjacent frames.
const COLUMN_GAP: f64 = 6.0;
/// Length of a tick.
const TICK: f64 = 4.0;
/// Above this number of points they are drawn smaller.
const MANY: usize = 200;
/// Opacity of bands, of shades, and of grid lines with and without a number.
const BAND: f64 = 0.25;
const SHADE: f64 = 0.12;
const GRID: f64 = 0.14;
const MINOR_GRID: f64 = 0.06;

/// File formats of a figure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// For browsers and vector editors.
    Svg,
    /// For papers: the width of a column.
    #[cfg(feature = "figures")]
    Pdf,
    /// For slides: 1920 pixels wide.
    #[cfg(feature = "figures")]
    Png,
}

impl Format {
    /// All, of which PDF and PNG are there with the feature `figures`.
    pub const ALL: &[Format] = &[
        Format::Svg,
        #[cfg(feature = "figures")]
        Format::Pdf,
        #[cfg(feature = "figures")]
        Format::Png,
    ];

    /// The suffix of a file.
    pub fn ending(self) -> &'static str {
        match self {
            Format::Svg => "svg",
            #[cfg(feature = "figures")]
            Format::Pdf => "pdf",
            #[cfg(feature = "figures")]
            Format::Png => "png",
        }
    }
}

impl Figure {
    /// The figure as a file. The same figure gives the same bytes.
    pub fn to(&self, format: Format) -> Vec<u8> {
        match format {
            Format::Svg => self.svg().into_bytes(),
            #[cfg(feature = "figures")]
            Format::Pdf => pdf::pdf(&self.drawing()),
            #[cfg(feature = "figures")]
            Format::Png => png::png(&self.drawing()),
        }
    }

    /// The figure as an SVG document, 480 px wide and about 300 px high for each panel.
    pub fn svg(&self) -> String {
        svg::svg(&self.drawing())
    }

    fn drawing(&self) -> Drawing {
        let rows = self.layouts();
        let title = wrapped(&self.title, LARGE, WIDTH - 2.0 * GAP);
        let head = HEAD * title.len() as f64;
        let height_of = |row: &[Layout]| row.iter().map(Layout::height).fold(0.0, f64::max);
        let height = head + rows.iter().map(|row| height_of(row)).sum::<f64>() + GAP;
        let mut drawing = Drawing { width: WIDTH, height, marks: vec![] };
        for (index, line) in title.iter().enumerate() {
            let size = fitted(line, LARGE, WIDTH - 2.0 * GAP);
            drawing.write(line, size, (GAP, HEAD * (index as f64 + 0.6)), Anchor::Start);
        }
        let mut top = head;
        for row in &rows {
            row.iter().for_each(|layout| layout.draw(&mut drawing, top));
            top += height_of(row);
        }
        drawing
    }

    /// Rows of panels.
    fn layouts(&self) -> Vec<Vec<Layout<'_>>> {
        let rows: Vec<Vec<&Panel>> = self.panels.iter().map(Panel::row).collect();
        let columns = rows.iter().map(Vec::len).max().unwrap_or(0);
        let total: f64 = self.panels.iter().map(Panel::share).sum();
        let room = FRAME * self.panels.len() as f64;
        let frame = |panel: &Panel| match columns {
            0 | 1 => (room * panel.share() / total).max(FRAME_LEAST).round(),
            _ => (FRAME.min(WIDTH / columns as f64) - GAP).max(FRAME_LEAST).round(),
        };
        let y: Vec<Vec<Axis>> =
            rows.iter().map(|row| row.iter().map(|panel| panel.y_axis(row, frame(panel))).collect()).collect();
        // Frames are aligned vertically.
        let left = y.iter().filter_map(|row| row.first()).map(Axis::width).fold(0.0, f64::max) + EDGE + 2.0 * NORMAL;
        let width = (WIDTH - left - GAP + COLUMN_GAP) / columns.max(1) as f64 - COLUMN_GAP;
        let x = |panel: &Panel| {
            let peers = rows.iter().flatten().filter(|other| panel.shares_x(other));
            let values = peers.flat_map(|peer| &peer.series).flat_map(|series| series.kind.extent().0);
            Axis::new(values, panel.x_log, panel.x_counts, |count, widest| count * (widest + 1.5 * SMALL) <= width)
        };
        let row = |(index, y): (usize, Vec<Axis>)| {
            let layout = |(column, y): (usize, Axis)| {
                let panel = rows[index][column];
                let below = rows.get(index + 1).and_then(|row| row.get(column));
                Layout {
                    panel,
                    x: x(panel),
                    y,
                    left: left + column as f64 * (width + COLUMN_GAP),
                    width,
                    frame: frame(panel),
                    foot: if below.is_some_and(|below| panel.shares_x(below)) { 0.0 } else { FOOT },
                    says_y: column == 0 && (columns == 1 || !panel.y_label.is_empty()),
                    legend: Legend::new(&panel.series, width),
                }
            };
            y.into_iter().enumerate().map(layout).collect()
        };
        y.into_iter().enumerate().map(row).collect()
    }
}

impl Panel {
    fn share(&self) -> f64 {
        if self.height_share > 0.0 { self.height_share.clamp(0.01, 100.0) } else { 1.0 }
    }

    /// The panel and those beside it.
    fn row(&self) -> Vec<&Panel> {
        [self].into_iter().chain(&self.beside).collect()
    }

    /// The y axis of a frame with this height, in a row.
    fn y_axis(&self, row: &[&Panel], frame: f64) -> Axis {
        let shares = |other: &&&Panel| {
            std::ptr::eq(**other, self)
                || (!self.y_label.is_empty() && self.y_label == other.y_label && self.y_log == other.y_log)
        };
        let peers = row.iter().filter(shares);
        let values = peers.flat_map(|peer| &peer.series).flat_map(|series| series.kind.extent().1);
        Axis::new(values, self.y_log, false, |count, _| count * 2.8 * SMALL <= frame)
    }

    fn shares_x(&self, other: &Panel) -> bool {
        self.x_label == other.x_label && self.x_log == other.x_log
    }
}

/// A panel with its layout.
struct Layout<'a> {
    panel: &'a Panel,
    x: Axis,
    y: Axis,
    /// Left edge, width and height of the frame.
    left: f64,
    width: f64,
    frame: f64,
    /// Height for numbers and label of the x axis, if it has any.
    foot: f64,
    /// Whether it has numbers and label on the y axis.
    says_y: bool,
    legend: Legend<'a>,
}

impl Layout<'_> {
    /// From the legend to the labels below.
    fn height(&self) -> f64 {
        self.above() + self.frame + self.foot
    }

    /// Height above the frame. The legend is there, where it covers no data.
    fn above(&self) -> f64 {
        GAP + self.legend.height()
    }

    fn draw(&self, drawing: &mut Drawing, top: f64) {
        self.legend.draw(drawing, self.left, top + GAP);
        let (right, upper) = (self.left + self.width, top + self.above());
        let lower = upper + self.frame;
        let at =
            |x: f64, y: f64| (self.left + self.x.place(x) * (right - self.left), lower - self.y.place(y) * self.frame);
        self.grid(drawing, at);
        let mut series: Vec<&Series> = self.panel.series.iter().collect();
        series.sort_by_key(|series| series.kind.layer());
        for series in series {
            self.series(&mut Pen { drawing, color: series.color }, &series.kind, at);
        }
        Pen { drawing, color: 0 }.frame((self.left, lower), (right, upper));
        self.numbers(drawing, at);
        let label = &self.panel.y_label;
        let place = (EDGE + 0.6 * NORMAL, 0.5 * (upper + lower));
        if self.says_y {
            drawing.write(label, fitted(label, NORMAL, self.frame), place, Anchor::Upwards);
        }
        if self.foot > 0.0 {
            let label = &self.panel.x_label;
            let place = (0.5 * (self.left + right), lower + self.foot - 0.7 * NORMAL);
            drawing.write(label, fitted(label, NORMAL, right - self.left), place, Anchor::Middle);
        }
    }

    /// Lines across the frame; `at` converts a point of the plane to the drawing.
    fn grid(&self, drawing: &mut Drawing, at: impl Fn(f64, f64) -> Point) {
        const END: f64 = f64::INFINITY;
        let mut pen = Pen { drawing, color: 0 };
        let minor = |axis: &Axis| axis.minor.iter().map(|value| (*value, MINOR_GRID)).collect::<Vec<_>>();
        let lines = |axis: &Axis| {
            let numbered = axis.numbers().map(|(value, _)| (value, GRID));
            minor(axis).into_iter().chain(numbered).collect::<Vec<_>>()
        };
        for (x, opacity) in lines(&self.x) {
            pen.hairline(at(x, -END), at(x, END), opacity);
        }
        for (y, opacity) in lines(&self.y) {
            pen.hairline(at(-END, y), at(END, y), opacity);
        }
    }

    /// Ticks and numbers.
    fn numbers(&self, drawing: &mut Drawing, at: impl Fn(f64, f64) -> Point) {
        for (value, number) in self.y.numbers().filter(|_| self.says_y) {
            let (left, y) = at(-f64::INFINITY, value);
            Pen { drawing, color: 0 }.hairline((left - TICK, y), (left, y), 1.0);
            drawing.write(number, SMALL, (left - 1.6 * TICK, y), Anchor::End);
        }
        for (value, number) in self.x.numbers().filter(|_| self.foot > 0.0) {
            let (x, lower) = at(value, -f64::INFINITY);
            Pen { drawing, color: 0 }.hairline((x, lower), (x, lower + TICK), 1.0);
            drawing.write(number, SMALL, (x, lower + TICK + 0.7 * SMALL), Anchor::Middle);
        }
    }

    /// The marks of a series; `at` converts a point of the plane to the canvas.
    fn series(&self, pen: &mut Pen, kind: &Mark, at: impl Fn(f64, f64) -> Point) {
        let shows = |x: &f64, y: &f64| self.x.shows(*x) && self.y.shows(*y);
        match kind {
            Mark::Points { x, y, sigma } => {
                let many = x.len() > MANY;
                for (index, (x, y)) in x.iter().zip(y).enumerate().filter(|(_, (x, y))| shows(x, y)) {
                    if let Some(bar) = sigma.as_ref().and_then(|sigma| sigma.get(index)).filter(|bar| bar.is_finite()) {
                        pen.whisker(at(*x, y - bar), at(*x, y + bar));
                    }
                    pen.marker(at(*x, *y), if many { 0.55 } else { 1.0 });
                }
            }
            Mark::Line { x, y, dashed } => {
                let points = x.iter().zip(y).map(|(x, y)| shows(x, y).then(|| at(*x, *y)));
                runs(points).into_iter().for_each(|run| pen.line(run, *dashed));
            }
            Mark::Band { x, low, high } => {
                let ends = x.iter().zip(low.iter().zip(high));
                let pairs = ends
                    .map(|(x, (low, high))| (shows(x, high) && low.is_finite()).then(|| (at(*x, *low), at(*x, *high))));
                runs(pairs).into_iter().for_each(|run| pen.band(run, BAND));
            }
            Mark::Level { y, dashed } if self.y.shows(*y) => {
                pen.line(vec![at(-f64::INFINITY, *y), at(f64::INFINITY, *y)], *dashed);
            }
            Mark::Shade { from, to } if !from.is_nan() && !to.is_nan() => {
                pen.rectangle(at(*from, -f64::INFINITY), at(*to, f64::INFINITY), SHADE);
            }
            Mark::Level { .. } | Mark::Shade { .. } => {}
        }
    }
}

impl Mark {
    /// Low layers are covered by higher ones. Lines are above points, where many points would hide a model.
    fn layer(&self) -> usize {
        match self {
            Mark::Shade { .. } => 0,
            Mark::Band { .. } => 1,
            Mark::Points { .. } => 2,
            Mark::Level { .. } => 3,
            Mark::Line { .. } => 4,
        }
    }

    /// The values of x and of y that axes should include.
    fn extent(&self) -> (Vec<f64>, Vec<f64>) {
        match self {
            Mark::Points { x, y, sigma: None } | Mark::Line { x, y, .. } => (x.clone(), y.clone()),
            Mark::Points { x, y, sigma: Some(sigma) } => {
                let ends = y.iter().zip(sigma).flat_map(|(y, bar)| [y - bar, y + bar]);
                (x.clone(), y.iter().copied().chain(ends).collect())
            }
            Mark::Band { x, low, high } => (x.clone(), [low.as_slice(), high].concat()),
            Mark::Level { y, .. } => (vec![], vec![*y]),
            Mark::Shade { from, to } => (vec![*from, *to], vec![]),
        }
    }
}

/// Runs without a gap.
fn runs<T>(items: impl Iterator<Item = Option<T>>) -> Vec<Vec<T>> {
    let mut runs = vec![vec![]];
    for item in items {
        match (item, runs.last_mut()) {
            (Some(item), Some(run)) => run.push(item),
            _ => runs.push(vec![]),
        }
    }
    runs.retain(|run| !run.is_empty());
    runs
}

#[cfg(test)]
mod tests {
    use rand::{Rng, RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    fn scatter(x: Vec<f64>, y: Vec<f64>) -> Figure {
        let series = Series { label: None, color: 1, kind: Mark::Points { x, y, sigma: None } };
        Figure { panels: vec![Panel { series: vec![series], ..Panel::default() }], ..Figure::default() }
    }

    /// Random bits as a number, or a value that often breaks things.
    fn number(random: &mut ChaCha8Rng) -> f64 {
        let odd =
            [0.0, -0.0, 1.0, f64::NAN, f64::INFINITY, f64::NEG_INFINITY, f64::MAX, f64::MIN_POSITIVE, 5e-324, 1e250];
        let pick = random.random_range(0..3 * odd.len());
        odd.get(pick)
            .copied()
            .unwrap_or_else(|| if pick % 2 == 0 { f64::from_bits(random.next_u64()) } else { random.random() })
    }

    fn numbers(random: &mut ChaCha8Rng) -> Vec<f64> {
        (0..random.random_range(0..6)).map(|_| number(random)).collect()
    }

    fn text(random: &mut ChaCha8Rng) -> String {
        (0..random.random_range(0..60)).map(|_| random.random::<char>()).collect()
    }

    fn panel(random: &mut ChaCha8Rng) -> Panel {
        let series = |random: &mut ChaCha8Rng| {
            let (x, y, last, dashed) = (numbers(random), numbers(random), numbers(random), random.random::<bool>());
            let kind = match random.random_range(0..5) {
                0 => Mark::Points { x, y, sigma: dashed.then_some(last) },
                1 => Mark::Line { x, y, dashed },
                2 => Mark::Band { x, low: y, high: last },
                3 => Mark::Level { y: number(random), dashed },
                _ => Mark::Shade { from: number(random), to: number(random) },
            };
            Series { label: dashed.then(|| text(random)), color: random.random::<u64>() as usize, kind }
        };
        Panel {
            x_label: if random.random() { String::new() } else { text(random) },
            y_label: text(random),
            x_log: random.random(),
            y_log: random.random(),
            x_counts: random.random(),
            series: (0..random.random_range(0..5)).map(|_| series(random)).collect(),
            height_share: number(random),
            beside: if random.random_range(0..8) == 0 { vec![panel(random), panel(random)] } else { vec![] },
        }
    }

    #[test]
    fn nothing_breaks_it() {
        let mut random = ChaCha8Rng::seed_from_u64(1);
        for index in 0..100 {
            let panels = (0..random.random_range(0..4)).map(|_| panel(&mut random)).collect();
            let figure = Figure { title: text(&mut random), panels };
            let svg = figure.svg();
            assert_eq!(svg, figure.svg());
            assert!(svg.starts_with("<svg width=\"480\"") && svg.ends_with("</svg>\n"));
            assert!(!svg.contains("NaN") && !svg.contains("inf"), "{figure:?}");
            for format in Format::ALL {
                let begins: &[u8] = match format.ending() {
                    "svg" => b"<svg",
                    "pdf" => b"%PDF",
                    _ => b"\x89PNG",
                };
                // A PNG takes long.
                assert!(index % 20 > 0 && format.ending() == "png" || figure.to(*format).starts_with(begins));
            }
        }
    }

    #[test]
    fn what_cannot_be_shown_is_left_out() {
        let count = |figure: &Figure| figure.svg().matches("<polygon").count();
        let mut figure = scatter(vec![0.0, 1.0, f64::NAN, 3.0, 4.0], vec![1.0, f64::INFINITY, 2.0, -3.0, 5.0]);
        assert_eq!(count(&figure), 3);
        figure.panels[0].y_log = true;
        assert_eq!(count(&figure), 2);
    }

    #[test]
    fn text_is_escaped_and_named_only_where_it_has_a_name() {
        let mut figure = scatter(vec![1.0], vec![1.0]);
        figure.title = "a < b & \u{1}c".into();
        assert_eq!(figure.svg().matches("<polygon").count(), 1);
        figure.panels[0].series[0].label = Some("data".into());
        let svg = figure.svg();
        assert!(svg.contains("a &lt; b &amp;  c") && svg.contains("data"));
        assert_eq!(svg.matches("<polygon").count(), 2);
    }
}
