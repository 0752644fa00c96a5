//! The font of figures: DejaVu Sans, needed for the widths of text and for the letters in papers.

use std::sync::LazyLock;

use ttf_parser::{Face, GlyphId, OutlineBuilder};

use super::drawing::Point;

static FACE: LazyLock<Face<'static>> =
    LazyLock::new(|| Face::parse(include_bytes!("DejaVuSans.ttf"), 0).expect("a font that is part of the program"));

/// Half the height of lower-case letters, in units of the font size: text centred at y has its baseline lower by this.
pub const HALF_HEIGHT: f64 = 0.36;

/// A stroke of a letter's outline.
#[derive(Clone, Copy, Debug)]
pub enum Stroke {
    Move(Point),
    Line(Point),
    /// A cubic curve: two control points and its end.
    Curve([Point; 3]),
    Close,
}

/// Length of text in a font size, px.
pub fn length(text: &str, size: f64) -> f64 {
    text.chars().map(|letter| advance(glyph(letter))).sum::<f64>() * size
}

/// Font size at which text fits.
pub fn fitted(text: &str, size: f64, room: f64) -> f64 {
    size * (room / length(text, size)).min(1.0)
}

/// Text in lines that fit, as far as its words do.
pub fn wrapped(text: &str, size: f64, room: f64) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split_whitespace() {
        match lines.last_mut() {
            Some(line) if length(&format!("{line} {word}"), size) <= room => *line = format!("{line} {word}"),
            _ => lines.push(word.into()),
        }
    }
    lines
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

/// The glyph of a letter; a box if the font has none.
fn glyph(letter: char) -> GlyphId {
    FACE.glyph_index(letter).unwrap_or(GlyphId(0))
}

/// Width of a letter in units of the font size.
fn advance(glyph: GlyphId) -> f64 {
    f64::from(FACE.glyph_hor_advance(glyph).unwrap_or(0)) / f64::from(FACE.units_per_em())
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
