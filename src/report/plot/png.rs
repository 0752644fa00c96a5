//! A drawing as PNG.

use tiny_skia::{FillRule, LineJoin, Paint, Path, PathBuilder, Pixmap, Stroke, StrokeDash, Transform};

use super::drawing::{Anchor, Drawing, Mark, Point};
use super::font::{HALF_HEIGHT, length};
use super::outline::{self, outlines};

/// Pixels of the image per px of the drawing: 550 per inch in the column of a paper.
const SCALE: f64 = 4.0;

/// The drawing as a picture.
pub fn png(drawing: &Drawing) -> Vec<u8> {
    let pixels = |length: f64| (SCALE * length).ceil() as u32;
    let mut pixmap =
        Pixmap::new(pixels(drawing.width), pixels(drawing.height)).expect("figures are neither empty nor huge");
    pixmap.fill(tiny_skia::Color::WHITE);
    let scale = Transform::from_scale(SCALE as f32, SCALE as f32);
    for mark in &drawing.marks {
        draw(mark, &mut pixmap, scale);
    }
    pixmap.encode_png().expect("memory takes all")
}

fn draw(mark: &Mark, pixmap: &mut Pixmap, scale: Transform) {
    let mut paint = Paint::default();
    let mut set = |[red, green, blue]: [u8; 3], opacity: f64| {
        paint.set_color_rgba8(red, green, blue, (255.0 * opacity).round() as u8);
    };
    match mark {
        Mark::Line { points, width, dashes, color, opacity } => {
            set(*color, *opacity);
            let dash = dashes.and_then(|dashes| StrokeDash::new(dashes.map(|length| length as f32).to_vec(), 0.0));
            let stroke = Stroke { width: *width as f32, line_join: LineJoin::Round, dash, ..Stroke::default() };
            if let Some(path) = path(points, false) {
                pixmap.stroke_path(&path, &paint, &stroke, scale, None);
            }
        }
        Mark::Area { points, color, opacity } => {
            set(*color, *opacity);
            if let Some(path) = path(points, true) {
                pixmap.fill_path(&path, &paint, FillRule::Winding, scale, None);
            }
        }
        Mark::Text { text, size, at: (x, y), anchor } => {
            set([0, 0, 0], 1.0);
            let placed = scale.pre_translate(*x as f32, *y as f32);
            let turned = if *anchor == Anchor::Upwards { placed.pre_rotate(-90.0) } else { placed };
            let left = -anchor.before() * length(text, *size);
            if let Some(path) = letters(text, *size, (left, HALF_HEIGHT * size)) {
                pixmap.fill_path(&path, &paint, FillRule::Winding, turned, None);
            }
        }
    }
}

fn path(points: &[Point], closed: bool) -> Option<Path> {
    let mut path = PathBuilder::new();
    for (index, (x, y)) in points.iter().enumerate() {
        let (x, y) = (*x as f32, *y as f32);
        if index == 0 { path.move_to(x, y) } else { path.line_to(x, y) }
    }
    if closed {
        path.close();
    }
    path.finish()
}

/// Outlines of text whose baseline begins at a point.
fn letters(text: &str, size: f64, (left, lower): Point) -> Option<Path> {
    let at = |(x, y): Point| ((left + x) as f32, (lower + y) as f32);
    let mut path = PathBuilder::new();
    for stroke in outlines(text, size) {
        match stroke {
            outline::Stroke::Move(to) => path.move_to(at(to).0, at(to).1),
            outline::Stroke::Line(to) => path.line_to(at(to).0, at(to).1),
            outline::Stroke::Curve(points) => {
                let [(x1, y1), (x2, y2), (x3, y3)] = points.map(at);
                path.cubic_to(x1, y1, x2, y2, x3, y3);
            }
            outline::Stroke::Close => path.close(),
        }
    }
    path.finish()
}
