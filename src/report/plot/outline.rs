//! Letters as outlines: a PDF or PNG needs no fonts.

use ttf_parser::OutlineBuilder;

use super::drawing::{Anchor, Point};
use super::font::{FACE, advance, glyph};

/// A stroke of a letter's outline.
#[derive(Clone, Copy, Debug)]
pub enum Stroke {
    Move(Point),
    Line(Point),
    /// A cubic curve: two control points and its end.
    Curve([Point; 3]),
    Close,
}

impl Anchor {
    /// Fraction of the text's length before its point.
    pub fn before(self) -> f64 {
        match self {
            Anchor::Start => 0.0,
            Anchor::Middle | Anchor::Upwards => 0.5,
            Anchor::End => 1.0,
        }
    }
}

/// Outlines of text that begins at x = 0 on a baseline at y = 0, y downwards.
pub fn outlines(text: &str, size: f64) -> Vec<Stroke> {
    let mut outline =
        Outline { scale: size / f64::from(FACE.units_per_em()), left: 0.0, last: (0.0, 0.0), strokes: vec![] };
    for letter in text.chars() {
        let glyph = glyph(letter);
        FACE.outline_glyph(glyph, &mut outline);
        outline.left += advance(glyph) * size;
    }
    outline.strokes
}

struct Outline {
    scale: f64,
    left: f64,
    last: Point,
    strokes: Vec<Stroke>,
}

impl Outline {
    fn at(&self, x: f32, y: f32) -> Point {
        (self.left + self.scale * f64::from(x), -self.scale * f64::from(y))
    }
}

impl OutlineBuilder for Outline {
    fn move_to(&mut self, x: f32, y: f32) {
        self.last = self.at(x, y);
        self.strokes.push(Stroke::Move(self.last));
    }

    fn line_to(&mut self, x: f32, y: f32) {
        self.last = self.at(x, y);
        self.strokes.push(Stroke::Line(self.last));
    }

    fn quad_to(&mut self, x1: f32, y1: f32, x: f32, y: f32) {
        let (start, control, end) = (self.last, self.at(x1, y1), self.at(x, y));
        let towards =
            |from: Point| (from.0 + 2.0 / 3.0 * (control.0 - from.0), from.1 + 2.0 / 3.0 * (control.1 - from.1));
        self.last = end;
        self.strokes.push(Stroke::Curve([towards(start), towards(end), end]));
    }

    fn curve_to(&mut self, x1: f32, y1: f32, x2: f32, y2: f32, x: f32, y: f32) {
        let curve = [self.at(x1, y1), self.at(x2, y2), self.at(x, y)];
        self.last = curve[2];
        self.strokes.push(Stroke::Curve(curve));
    }

    fn close(&mut self) {
        self.strokes.push(Stroke::Close);
    }
}
