//! Lines, areas and markers of one colour on a drawing.

use std::f64::consts::PI;

use super::drawing::{Color, Drawing, Mark, Point};

/// Font sizes for numbers, labels and title, px: 6.8, 7.4 and 7.9 pt in the column of a paper.
pub const SMALL: f64 = 13.0;
pub const NORMAL: f64 = 14.0;
pub const LARGE: f64 = 15.0;
/// Radius of a circle as a marker, px.
const RADIUS: f64 = 3.8;
/// Widths of lines of data, and of frames and error bars, px.
const THICK: f64 = 1.6;
const THIN: f64 = 1.0;

/// Colours that colour-blind readers can distinguish (Okabe & Ito 2008).
const COLORS: [Color; 8] = [
    [0, 0, 0],
    [0, 114, 178],
    [213, 94, 0],
    [0, 158, 115],
    [204, 121, 167],
    [230, 159, 0],
    [86, 180, 233],
    [240, 228, 66],
];
/// Markers as stars: number of tips, radius between tips in units of that at tips, direction of the first tip in turns
/// from right over down.
const MARKERS: [(usize, f64, f64); 8] = [
    (12, 1.0, 0.0),
    (4, 0.707, 0.125),
    (3, 0.5, 0.75),
    (4, 0.707, 0.0),
    (3, 0.5, 0.25),
    (5, 0.4, 0.75),
    (4, 0.35, 0.125),
    (4, 0.35, 0.0),
];

/// Draws in one colour.
pub struct Pen<'a> {
    pub drawing: &'a mut Drawing,
    /// Index of colour and marker.
    pub color: usize,
}

impl Pen<'_> {
    pub fn line(&mut self, mut points: Vec<Point>, dashed: bool) {
        points.dedup();
        self.stroke(points, THICK, dashed.then_some([6.0, 4.0]), 1.0);
    }

    /// A thin line with an opacity.
    pub fn hairline(&mut self, from: Point, to: Point, opacity: f64) {
        self.stroke(vec![from, to], THIN, None, opacity);
    }

    /// The area between lower and upper points.
    pub fn band(&mut self, ends: Vec<(Point, Point)>, opacity: f64) {
        let (low, mut corners): (Vec<Point>, Vec<Point>) = ends.into_iter().unzip();
        corners.extend(low.into_iter().rev());
        self.area(corners, opacity);
    }

    pub fn rectangle(&mut self, low: Point, high: Point, opacity: f64) {
        self.band(vec![(low, (low.0, high.1)), ((high.0, low.1), high)], opacity);
    }

    pub fn frame(&mut self, low: Point, high: Point) {
        let corners = vec![low, (low.0, high.1), high, (high.0, low.1), low];
        self.stroke(corners, THIN, None, 1.0);
    }

    /// An error bar.
    pub fn whisker(&mut self, low: Point, high: Point) {
        let cap = |(x, y)| [(x - 2.5, y), (x + 2.5, y)];
        for [from, to] in [[low, high], cap(low), cap(high)] {
            self.hairline(from, to, 1.0);
        }
    }

    /// A marker, scaled by a factor.
    pub fn marker(&mut self, (x, y): Point, factor: f64) {
        let (tips, hollow, first) = MARKERS[self.color % MARKERS.len()];
        // All have nearly the same area.
        let radius = RADIUS * factor / hollow.sqrt();
        let corner = |index: usize| {
            let reach = if index.is_multiple_of(2) { radius } else { radius * hollow };
            let (down, right) = (2.0 * PI * (first + index as f64 / (2 * tips) as f64)).sin_cos();
            (x + reach * right, y + reach * down)
        };
        self.area((0..2 * tips).map(corner).collect(), 1.0);
    }

    fn stroke(&mut self, points: Vec<Point>, width: f64, dashes: Option<[f64; 2]>, opacity: f64) {
        let color = self.color();
        self.drawing.marks.push(Mark::Line { points, width, dashes, color, opacity });
    }

    fn area(&mut self, points: Vec<Point>, opacity: f64) {
        let color = self.color();
        self.drawing.marks.push(Mark::Area { points, color, opacity });
    }

    fn color(&self) -> Color {
        COLORS[self.color % COLORS.len()]
    }
}
