//! The font of figures: DejaVu Sans, needed for the widths of text.

use std::sync::LazyLock;

use ttf_parser::{Face, GlyphId};

pub(super) static FACE: LazyLock<Face<'static>> =
    LazyLock::new(|| Face::parse(include_bytes!("DejaVuSans.ttf"), 0).expect("a font that is part of the program"));

/// Half the height of lower-case letters, in units of the font size: text centred at y has its baseline lower by this.
pub const HALF_HEIGHT: f64 = 0.36;

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

/// The glyph of a letter; a box if the font has none.
pub(super) fn glyph(letter: char) -> GlyphId {
    FACE.glyph_index(letter).unwrap_or(GlyphId(0))
}

/// Width of a letter in units of the font size.
pub(super) fn advance(glyph: GlyphId) -> f64 {
    f64::from(FACE.glyph_hor_advance(glyph).unwrap_or(0)) / f64::from(FACE.units_per_em())
}
