//! Lines, areas, markers and text on a canvas.

use std::f64::consts::PI;

use plotters::coord::Shift;
use plotters::element::{DashedPathElement, Drawable, PointCollection};
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::TAKES_ALL;

/// Plotters places everything on whole pixels; drawn this much larger than shown, curves are smooth.
const SCALE: f64 = 10.0;
/// Sizes of type for numbers, labels and title, px.
pub const SMALL: f64 = 12.0;
pub const NORMAL: f64 = 13.5;
pub const LARGE: f64 = 15.0;
/// Width of a letter in units of the size of type, on the wide side: what font will be at hand is not known here.
const LETTER: f64 = 0.58;
/// Radius of a circle as a marker, px.
const RADIUS: f64 = 3.8;

/// Colours that colour-blind readers tell apart (Okabe & Ito 2008).
const COLORS: [RGBColor; 8] = [
    RGBColor(0, 0, 0),
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
    RGBColor(240, 228, 66),
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

/// A whole figure, in tenths of px from its upper left corner.
pub type Canvas<'b> = DrawingArea<SVGBackend<'b>, Shift>;
pub type Pixel = (i32, i32);

/// Draws in one colour.
pub struct Pen<'a, 'b> {
    pub canvas: &'a Canvas<'b>,
    /// Index of colour and marker.
    pub color: usize,
}

impl<'b> Pen<'_, 'b> {
    pub fn line(&self, mut points: Vec<Pixel>, dashed: bool) {
        points.dedup();
        let style = self.color().stroke_width(16);
        if dashed {
            self.put(&DashedPathElement::new(points, px(6.0), px(4.0), style));
        } else {
            self.put(&PathElement::new(points, style));
        }
    }

    /// The area between lower and upper points.
    pub fn band(&self, ends: Vec<(Pixel, Pixel)>, opacity: f64) {
        let (low, mut corners): (Vec<Pixel>, Vec<Pixel>) = ends.into_iter().unzip();
        corners.extend(low.into_iter().rev());
        self.put(&Polygon::new(corners, self.color().mix(opacity)));
    }

    pub fn rectangle(&self, low: Pixel, high: Pixel, opacity: f64) {
        self.band(vec![(low, (low.0, high.1)), ((high.0, low.1), high)], opacity);
    }

    pub fn frame(&self, low: Pixel, high: Pixel) {
        let corners = vec![low, (low.0, high.1), high, (high.0, low.1), low];
        self.put(&PathElement::new(corners, self.color().stroke_width(10)));
    }

    /// An error bar.
    pub fn whisker(&self, low: Pixel, high: Pixel) {
        let cap = |(x, y)| [(x - px(2.5), y), (x + px(2.5), y)];
        for ends in [[low, high], cap(low), cap(high)] {
            self.put(&PathElement::new(ends, self.color().stroke_width(10)));
        }
    }

    /// A marker, smaller or larger by a factor.
    pub fn marker(&self, (x, y): Pixel, factor: f64) {
        let (tips, hollow, first) = MARKERS[self.color % MARKERS.len()];
        // All cover about the same area.
        let radius = RADIUS * factor / hollow.sqrt();
        let corner = |index: usize| {
            let reach = if index.is_multiple_of(2) { radius } else { radius * hollow };
            let (down, right) = (2.0 * PI * (first + index as f64 / (2 * tips) as f64)).sin_cos();
            (x + px(reach * right), y + px(reach * down))
        };
        self.put(&Polygon::new((0..2 * tips).map(corner).collect::<Vec<_>>(), self.color()));
    }

    fn color(&self) -> RGBColor {
        COLORS[self.color % COLORS.len()]
    }

    fn put<E: Drawable<SVGBackend<'b>>>(&self, element: &E)
    where
        for<'e> &'e E: PointCollection<'e, Pixel>,
    {
        self.canvas.draw(element).expect(TAKES_ALL);
    }
}

/// Writes text to the right of a point, smaller where there is no room.
pub fn write(canvas: &Canvas, text: &str, size: f64, (left, middle): (f64, f64), room: f64) {
    let style = style(fitted(text, size, room)).pos(Pos::new(HPos::Left, VPos::Center));
    canvas.draw_text(&clean(text), &style, (px(left), px(middle))).expect(TAKES_ALL);
}

/// Text of a size. Plotters writes it smaller by 1.24.
pub fn style(size: f64) -> TextStyle<'static> {
    ("sans-serif", 1.24 * size * SCALE).into()
}

/// Size of type at which text fits.
pub fn fitted(text: &str, size: f64, room: f64) -> f64 {
    size * (room / length(text, size)).min(1.0)
}

/// Length of text of a size, about.
pub fn length(text: &str, size: f64) -> f64 {
    LETTER * size * text.chars().count() as f64
}

/// Text without characters that XML cannot hold.
pub fn clean(text: &str) -> String {
    text.chars()
        .map(|letter| if letter.is_control() || ('\u{fffe}'..='\u{ffff}').contains(&letter) { ' ' } else { letter })
        .collect()
}

/// Lengths as Plotters takes them.
pub fn px(length: f64) -> i32 {
    (length * SCALE).round() as i32
}
