//! A drawing as SVG.

use std::fmt::Write;

use super::drawing::{Anchor, Drawing, Mark, Point};
use super::font::HALF_HEIGHT;

/// The drawing as an SVG document; text remains text, which programs can search and edit.
pub fn svg(drawing: &Drawing) -> String {
    let (width, height) = (number(drawing.width), number(drawing.height));
    let mut svg = format!(
        "<svg width=\"{width}\" height=\"{height}\" viewBox=\"0 0 {width} {height}\" xmlns=\"http://www.w3.org/2000/svg\" \
         fill=\"none\" stroke-linejoin=\"round\" font-family=\"DejaVu Sans, Verdana, sans-serif\">\n\
         <rect width=\"{width}\" height=\"{height}\" fill=\"#FFFFFF\"/>\n"
    );
    for mark in &drawing.marks {
        mark_of(mark, &mut svg).expect("text takes all");
    }
    svg + "</svg>\n"
}

fn mark_of(mark: &Mark, svg: &mut String) -> std::fmt::Result {
    match mark {
        Mark::Line { points, width, dashes, color: [red, green, blue], opacity } => {
            let color = format!("#{red:02X}{green:02X}{blue:02X}");
            let width = number(*width);
            write!(svg, "<polyline points=\"{}\" stroke=\"{color}\" stroke-width=\"{width}\"", places(points))?;
            if let Some([dash, gap]) = dashes {
                write!(svg, " stroke-dasharray=\"{} {}\"", number(*dash), number(*gap))?;
            }
            if *opacity < 1.0 {
                write!(svg, " stroke-opacity=\"{}\"", number(*opacity))?;
            }
        }
        Mark::Area { points, color: [red, green, blue], opacity } => {
            write!(svg, "<polygon points=\"{}\" fill=\"#{red:02X}{green:02X}{blue:02X}\"", places(points))?;
            if *opacity < 1.0 {
                write!(svg, " fill-opacity=\"{}\"", number(*opacity))?;
            }
        }
        Mark::Text { text, size, at: (x, y), anchor } => {
            let (x, y, lower) = (number(*x), number(*y), number(HALF_HEIGHT * size));
            let turned = if *anchor == Anchor::Upwards { " rotate(-90)" } else { "" };
            let side = match anchor {
                Anchor::Start => "start",
                Anchor::Middle | Anchor::Upwards => "middle",
                Anchor::End => "end",
            };
            let text = text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;");
            return writeln!(
                svg,
                "<text transform=\"translate({x} {y}){turned}\" y=\"{lower}\" font-size=\"{}\" text-anchor=\"{side}\" \
                 fill=\"#000000\">{text}</text>",
                number(*size)
            );
        }
    }
    svg.write_str("/>\n")
}

fn places(points: &[Point]) -> String {
    let places: Vec<String> = points.iter().map(|(x, y)| format!("{},{}", number(*x), number(*y))).collect();
    places.join(" ")
}

/// A number to a hundredth of a px.
fn number(value: f64) -> String {
    // Adding zero removes the sign of a negative zero.
    ((100.0 * value).round() / 100.0 + 0.0).to_string()
}
