//! Lines, areas and text in the plane: a figure before it is written to a file.

/// A point, px to the right of and below the upper left corner.
pub type Point = (f64, f64);

/// Red, green and blue, 0 to 255.
pub type Color = [u8; 3];

/// Marks in drawing order: later ones cover earlier ones.
#[derive(Clone, Debug)]
pub struct Drawing {
    /// Its width, px, as for all lengths here.
    pub width: f64,
    /// Its height.
    pub height: f64,
    /// What is on it.
    pub marks: Vec<Mark>,
}

/// A line, an area or text.
#[derive(Clone, Debug)]
pub enum Mark {
    /// Points joined, with dashes and gaps of these lengths if it is dashed.
    Line { points: Vec<Point>, width: f64, dashes: Option<[f64; 2]>, color: Color, opacity: f64 },
    /// The area between points.
    Area { points: Vec<Point>, color: Color, opacity: f64 },
    /// Text at a point at half of its height.
    Text { text: String, size: f64, at: Point, anchor: Anchor },
}

/// Position of text relative to its point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Anchor {
    /// To the right of it.
    Start,
    /// Centred on it.
    Middle,
    /// To the left of it.
    End,
    /// Centred on it, rotated to read upwards.
    Upwards,
}

impl Drawing {
    /// Writes text.
    pub fn write(&mut self, text: &str, size: f64, at: Point, anchor: Anchor) {
        if !text.is_empty() {
            self.marks.push(Mark::Text { text: clean(text), size, at, anchor });
        }
    }
}

/// Text without characters that XML does not allow.
fn clean(text: &str) -> String {
    text.chars()
        .map(|letter| if letter.is_control() || ('\u{fffe}'..='\u{ffff}').contains(&letter) { ' ' } else { letter })
        .collect()
}
