//! A drawing as PDF, as wide as a column of a paper.

use pdf_writer::types::LineJoinStyle;
use pdf_writer::{Content, Finish, Name, Pdf, Rect, Ref};

use super::drawing::{Anchor, Color, Drawing, Mark, Point};
use super::font::{HALF_HEIGHT, length};
use super::outline::{Stroke, outlines};

/// Width of a column of ApJ, PASP and MNRAS, pt.
const COLUMN: f64 = 252.0;

/// The drawing as a PDF of one page. Its letters are outlines, so that it needs no fonts.
pub fn pdf(drawing: &Drawing) -> Vec<u8> {
    let scale = COLUMN / drawing.width;
    let height = (scale * drawing.height) as f32;
    let mut opacities: Vec<f64> = drawing.marks.iter().filter_map(opacity).collect();
    opacities.sort_by(f64::total_cmp);
    opacities.dedup();

    let [catalog, pages, page, content] = [1, 2, 3, 4].map(Ref::new);
    let mut pdf = Pdf::new();
    pdf.catalog(catalog).pages(pages);
    pdf.pages(pages).kids([page]).count(1);
    let mut sheet = pdf.page(page);
    sheet.parent(pages).media_box(Rect::new(0.0, 0.0, COLUMN as f32, height)).contents(content);
    let mut resources = sheet.resources();
    let mut states = resources.ext_g_states();
    for (index, opacity) in opacities.iter().enumerate() {
        let mut state = states.insert(Name(&name(index))).start::<pdf_writer::writers::ExtGraphicsState>();
        state.stroking_alpha(*opacity as f32).non_stroking_alpha(*opacity as f32);
    }
    states.finish();
    resources.finish();
    sheet.finish();

    let mut marks = Content::new();
    marks.set_line_join(LineJoinStyle::RoundJoin);
    // Lengths are px from the upper left corner, downwards.
    marks.transform([scale as f32, 0.0, 0.0, -scale as f32, 0.0, height]);
    for mark in &drawing.marks {
        let state = opacity(mark).and_then(|opacity| opacities.iter().position(|known| *known == opacity));
        marks.save_state();
        if let Some(index) = state {
            marks.set_parameters(Name(&name(index)));
        }
        draw(mark, &mut marks);
        marks.restore_state();
    }
    pdf.stream(content, &marks.finish());
    pdf.finish()
}

fn opacity(mark: &Mark) -> Option<f64> {
    match mark {
        Mark::Line { opacity, .. } | Mark::Area { opacity, .. } => Some(*opacity),
        Mark::Text { .. } => None,
    }
}

fn name(index: usize) -> Vec<u8> {
    format!("Opacity{index}").into_bytes()
}

fn draw(mark: &Mark, marks: &mut Content) {
    match mark {
        Mark::Line { points, width, dashes, color, .. } => {
            let [red, green, blue] = shares(*color);
            marks.set_stroke_rgb(red, green, blue).set_line_width(*width as f32);
            if let Some(dashes) = dashes {
                marks.set_dash_pattern(dashes.map(|length| length as f32), 0.0);
            }
            path(points, marks);
            marks.stroke();
        }
        Mark::Area { points, color, .. } => {
            let [red, green, blue] = shares(*color);
            marks.set_fill_rgb(red, green, blue);
            path(points, marks);
            marks.close_path().fill_nonzero();
        }
        Mark::Text { text, size, at: (x, y), anchor } => {
            let (x, y) = (*x as f32, *y as f32);
            marks.transform(match anchor {
                Anchor::Upwards => [0.0, -1.0, 1.0, 0.0, x, y],
                _ => [1.0, 0.0, 0.0, 1.0, x, y],
            });
            let (left, lower) = (-anchor.before() * length(text, *size), HALF_HEIGHT * size);
            let at = |(x, y): Point| ((left + x) as f32, (lower + y) as f32);
            for stroke in outlines(text, *size) {
                match stroke {
                    Stroke::Move(to) => marks.move_to(at(to).0, at(to).1),
                    Stroke::Line(to) => marks.line_to(at(to).0, at(to).1),
                    Stroke::Curve(points) => {
                        let [(x1, y1), (x2, y2), (x3, y3)] = points.map(at);
                        marks.cubic_to(x1, y1, x2, y2, x3, y3)
                    }
                    Stroke::Close => marks.close_path(),
                };
            }
            marks.fill_nonzero();
        }
    }
}

fn path(points: &[Point], marks: &mut Content) {
    for (index, (x, y)) in points.iter().enumerate() {
        let (x, y) = (*x as f32, *y as f32);
        if index == 0 {
            marks.move_to(x, y)
        } else {
            marks.line_to(x, y)
        };
    }
}

fn shares(color: Color) -> [f32; 3] {
    color.map(|part| f32::from(part) / 255.0)
}
