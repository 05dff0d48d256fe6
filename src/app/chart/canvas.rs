//! Lines, marks and text on one of the plotting library's backends, so that SVG and PNG are one picture.

use anyhow::{Result, anyhow};
use plotters::coord::Shift;
use plotters::prelude::{
    BitMapBackend, Circle, DrawingArea, DrawingBackend, IntoDrawingArea, PathElement, Polygon,
    RGBColor, SVGBackend, ShapeStyle, Text, TextStyle, WHITE,
};
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{Color as _, FontStyle, FontTransform, IntoFont, register_font};

/// Drawn larger than its unit, for fine screens and printers.
pub const PIXELS_PER_UNIT: f64 = 2.0;
const FONT: &str = "sans-serif";

/// Dark enough for text and axes.
pub const INK: RGBColor = RGBColor(40, 40, 40);
/// For lines that are not to be looked at first.
pub const FAINT: RGBColor = RGBColor(215, 215, 215);
/// Between the two.
pub const GREY: RGBColor = RGBColor(120, 120, 120);

/// Colours that colour-blind eyes tell apart (Okabe & Ito 2008), each with a mark and dashes of its own for printers.
pub const LOOKS: [SeriesLook; 8] = [
    SeriesLook(RGBColor(0, 114, 178), Mark::Disc, &[]),
    SeriesLook(RGBColor(213, 94, 0), Mark::Square, &[9.0, 4.0]),
    SeriesLook(RGBColor(0, 158, 115), Mark::Triangle, &[2.0, 3.0]),
    SeriesLook(RGBColor(150, 80, 130), Mark::Diamond, &[9.0, 3.0, 2.0, 3.0]),
    SeriesLook(RGBColor(190, 130, 0), Mark::Ring, &[5.0, 3.0]),
    SeriesLook(RGBColor(0, 0, 0), Mark::Cross, &[1.5, 4.0]),
    SeriesLook(RGBColor(86, 180, 233), Mark::Frame, &[14.0, 4.0]),
    SeriesLook(RGBColor(125, 85, 50), Mark::Plus, &[5.0, 2.0, 1.5, 2.0]),
];

/// Colour, mark and dashes (lengths of ink and gap) of a series.
#[derive(Clone, Copy)]
pub struct SeriesLook(pub RGBColor, pub Mark, pub &'static [f64]);

/// The shape of a point.
#[derive(Clone, Copy)]
pub enum Mark {
    /// A filled circle.
    Disc,
    /// A filled square.
    Square,
    /// A filled triangle.
    Triangle,
    /// A square on its corner.
    Diamond,
    /// A circle.
    Ring,
    /// Two strokes aslant.
    Cross,
    /// A square.
    Frame,
    /// Two strokes, one upright.
    Plus,
}

/// Where a text lies against its place.
#[derive(Clone, Copy, PartialEq)]
pub enum TextAnchor {
    /// It begins there.
    Start,
    /// Its middle is there.
    Middle,
    /// It ends there.
    End,
}

/// A sheet to draw on; the unit is a 96th of an inch, y goes down.
pub struct ChartCanvas<'a, B: DrawingBackend> {
    area: &'a DrawingArea<B, Shift>,
}

/// A drawing that any backend can take.
pub trait Drawing {
    /// Width and height, units.
    fn size(&self) -> [f64; 2];
    /// Draws it all.
    fn draw<B: DrawingBackend>(&self, canvas: &ChartCanvas<'_, B>) -> Result<()>;
}

/// A drawing as the text of an SVG file.
///
/// # Errors
/// The library failed.
pub fn svg(drawing: &impl Drawing) -> Result<String> {
    let mut text = String::new();
    draw_on(SVGBackend::with_string(&mut text, pixels(drawing)), drawing)?;
    Ok(text)
}

/// A drawing as RGBA, with its width and height.
///
/// # Errors
/// The library failed.
pub fn bitmap(drawing: &impl Drawing) -> Result<([u32; 2], Vec<u8>)> {
    let (width, height) = pixels(drawing);
    let mut rgb = vec![255; 3 * (width * height) as usize];
    draw_on(
        BitMapBackend::with_buffer(&mut rgb, (width, height)),
        drawing,
    )?;
    let rgba = rgb.chunks_exact(3).flat_map(|p| [p[0], p[1], p[2], 255]);
    Ok(([width, height], rgba.collect()))
}

fn pixels(drawing: &impl Drawing) -> (u32, u32) {
    let [width, height] = drawing.size().map(|side| (side * PIXELS_PER_UNIT) as u32);
    (width, height)
}

fn draw_on<B: DrawingBackend>(backend: B, drawing: &impl Drawing) -> Result<()> {
    // The font comes with the program: no machine has to have one.
    register_font(FONT, FontStyle::Normal, epaint_default_fonts::UBUNTU_LIGHT)
        .map_err(|_| anyhow!("the charts' font cannot be read"))?;
    let area = backend.into_drawing_area();
    area.fill(&WHITE).map_err(told)?;
    drawing.draw(&ChartCanvas { area: &area })?;
    area.present().map_err(told)
}

fn told(error: impl std::fmt::Display) -> anyhow::Error {
    anyhow!("a chart cannot be drawn: {error}")
}

fn place([x, y]: [f64; 2]) -> (i32, i32) {
    let pixel = |value: f64| (value * PIXELS_PER_UNIT).round() as i32;
    (pixel(x), pixel(y))
}

fn stroke(color: RGBColor, width: f64) -> ShapeStyle {
    ShapeStyle::from(&color).stroke_width((width * PIXELS_PER_UNIT).round().max(1.0) as u32)
}

impl<B: DrawingBackend> ChartCanvas<'_, B> {
    /// A line through some places.
    ///
    /// # Errors
    /// The library failed; so for all below.
    pub fn line(&self, places: &[[f64; 2]], color: RGBColor, width: f64) -> Result<()> {
        let path: Vec<_> = places.iter().copied().map(place).collect();
        self.area
            .draw(&PathElement::new(path, stroke(color, width)))
            .map_err(told)
    }

    /// The same in dashes; without any it is whole.
    pub fn dashed(
        &self,
        places: &[[f64; 2]],
        color: RGBColor,
        width: f64,
        dashes: &[f64],
    ) -> Result<()> {
        if dashes.is_empty() {
            return self.line(places, color, width);
        }
        let (mut dash, mut left) = (0, dashes[0]);
        for ends in places.windows(2) {
            let [from, to] = [ends[0], ends[1]];
            let length = (to[0] - from[0]).hypot(to[1] - from[1]);
            let along = |distance: f64| {
                let share = distance / length;
                [0, 1].map(|axis| from[axis] + share * (to[axis] - from[axis]))
            };
            let mut at = 0.0;
            while at < length {
                let end = (at + left).min(length);
                if dash % 2 == 0 {
                    self.line(&[along(at), along(end)], color, width)?;
                }
                left -= end - at;
                at = end;
                if left <= 1e-9 {
                    dash = (dash + 1) % dashes.len();
                    left = dashes[dash];
                }
            }
        }
        Ok(())
    }

    /// A mark in its look.
    pub fn mark(&self, [x, y]: [f64; 2], look: SeriesLook) -> Result<()> {
        let SeriesLook(color, mark, _) = look;
        let corners = |corners: &[[f64; 2]]| -> Result<()> {
            let places: Vec<_> = corners.iter().map(|[a, b]| place([x + a, y + b])).collect();
            self.area
                .draw(&Polygon::new(places, ShapeStyle::from(&color).filled()))
                .map_err(told)
        };
        let circle = |radius: f64, style: ShapeStyle| {
            let radius = (radius * PIXELS_PER_UNIT) as i32;
            self.area
                .draw(&Circle::new(place([x, y]), radius, style))
                .map_err(told)
        };
        match mark {
            Mark::Disc => circle(4.5, ShapeStyle::from(&color).filled()),
            Mark::Ring => circle(4.0, stroke(color, 1.5)),
            Mark::Square => corners(&[[-4.0, -4.0], [4.0, -4.0], [4.0, 4.0], [-4.0, 4.0]]),
            Mark::Diamond => corners(&[[0.0, -5.5], [5.5, 0.0], [0.0, 5.5], [-5.5, 0.0]]),
            Mark::Triangle => corners(&[[0.0, -5.0], [5.0, 4.0], [-5.0, 4.0]]),
            Mark::Cross => {
                self.line(&[[x - 4.0, y - 4.0], [x + 4.0, y + 4.0]], color, 1.5)?;
                self.line(&[[x - 4.0, y + 4.0], [x + 4.0, y - 4.0]], color, 1.5)
            }
            Mark::Frame => {
                let corners = [
                    [-4.0, -4.0],
                    [4.0, -4.0],
                    [4.0, 4.0],
                    [-4.0, 4.0],
                    [-4.0, -4.0],
                ];
                self.line(&corners.map(|[a, b]| [x + a, y + b]), color, 1.5)
            }
            Mark::Plus => {
                self.line(&[[x - 5.0, y], [x + 5.0, y]], color, 1.5)?;
                self.line(&[[x, y - 5.0], [x, y + 5.0]], color, 1.5)
            }
        }
    }

    /// A line of text, at half its height.
    pub fn text(
        &self,
        text: &str,
        at: [f64; 2],
        size: f64,
        color: RGBColor,
        anchor: TextAnchor,
    ) -> Result<()> {
        let horizontal = match anchor {
            TextAnchor::Start => HPos::Left,
            TextAnchor::Middle => HPos::Center,
            TextAnchor::End => HPos::Right,
        };
        let style = style(size, color).pos(Pos::new(horizontal, VPos::Center));
        self.area
            .draw(&Text::new(text.to_owned(), place(at), style))
            .map_err(told)
    }

    /// A line of text that runs upwards, its middle at a place.
    pub fn upright_text(&self, text: &str, at: [f64; 2], size: f64) -> Result<()> {
        let font = (FONT, size * PIXELS_PER_UNIT).into_font();
        let style = TextStyle::from(font.transform(FontTransform::Rotate270))
            .color(&INK)
            .pos(Pos::new(HPos::Center, VPos::Center));
        self.area
            .draw(&Text::new(text.to_owned(), place(at), style))
            .map_err(told)
    }

    /// Width of a line of text.
    pub fn text_width(&self, text: &str, size: f64) -> Result<f64> {
        let (width, _) = self
            .area
            .estimate_text_size(text, &style(size, INK))
            .map_err(told)?;
        Ok(f64::from(width) / PIXELS_PER_UNIT)
    }
}

fn style(size: f64, color: RGBColor) -> TextStyle<'static> {
    TextStyle {
        color: color.to_backend_color(),
        ..TextStyle::from((FONT, size * PIXELS_PER_UNIT).into_font())
    }
}
