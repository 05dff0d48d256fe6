//! A page as SVG, its unit the millimetre.

use std::fmt::Write as _;

use super::page::{Page, Rect};
use crate::app::files::made_by::MADE_BY;

/// The whole file.
pub fn text(page: &Page) -> String {
    let [width, height] = page.size_mm;
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}mm\" height=\"{height}mm\" \
         viewBox=\"0 0 {width} {height}\">\n<rect width=\"{width}\" height=\"{height}\" fill=\"white\"/>\n<desc>{MADE_BY}</desc>\n"
    );
    for black in &page.blacks {
        let mut path = String::new();
        for rect in std::iter::once(&black.outline).chain(&black.holes) {
            let Rect {
                at: [x, y],
                size: [w, h],
            } = rect;
            let _ = write!(path, "M{x:.4} {y:.4}h{w:.4}v{h:.4}h-{w:.4}z");
        }
        let _ = writeln!(svg, "<path fill-rule=\"evenodd\" d=\"{path}\"/>");
    }
    for text in &page.texts {
        let [x, y] = text.at;
        let escaped = text.text.replace('&', "&amp;").replace('<', "&lt;");
        let _ = writeln!(
            svg,
            "<text x=\"{x:.3}\" y=\"{y:.3}\" font-family=\"Helvetica, Arial, sans-serif\" font-size=\"{}\">{escaped}</text>",
            text.size_mm
        );
    }
    svg.push_str("</svg>\n");
    svg
}
