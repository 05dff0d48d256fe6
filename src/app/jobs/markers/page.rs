//! A printed page as values: black squares, lines of small print; millimetres from the top left corner.

/// A size of paper.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Paper {
    /// 210 x 297 mm.
    A4,
    /// 297 x 420 mm.
    A3,
    /// 8.5 x 11 inches.
    Letter,
}

impl Paper {
    /// Width and height, millimetres.
    pub fn size_mm(self, landscape: bool) -> [f64; 2] {
        let [width, height] = match self {
            Self::A4 => [210.0, 297.0],
            Self::A3 => [297.0, 420.0],
            Self::Letter => [215.9, 279.4],
        };
        if landscape {
            [height, width]
        } else {
            [width, height]
        }
    }
}

/// An upright rectangle, millimetres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rect {
    /// Left and upper edge.
    pub at: [f64; 2],
    /// Width and height.
    pub size: [f64; 2],
}

/// A shape that is black but for its holes. Rectangles that meet leave no seam, since they are filled as one.
#[derive(Debug, Clone, PartialEq)]
pub struct Black {
    /// What is black.
    pub outline: Rect,
    /// What of it is white.
    pub holes: Vec<Rect>,
}

/// Small print.
#[derive(Debug, Clone, PartialEq)]
pub struct Text {
    /// Left end of the line that the letters stand on, millimetres.
    pub at: [f64; 2],
    /// Size of the type, millimetres.
    pub size_mm: f64,
    /// What it says; ASCII.
    pub text: String,
}

/// One side of paper.
#[derive(Debug, Clone, PartialEq)]
pub struct Page {
    /// Width and height, millimetres.
    pub size_mm: [f64; 2],
    /// All that is black.
    pub blacks: Vec<Black>,
    /// All that is written.
    pub texts: Vec<Text>,
}

/// White at the rim of a page that printers cannot reach, millimetres.
pub const MARGIN_MM: f64 = 8.0;
/// What the ruler and the small print at the foot of a page take, millimetres.
pub const FOOT_MM: f64 = 16.0;
const RULER_MM: u32 = 100;

impl Page {
    /// A page with its ruler, which tells whether the printer has scaled it, and a line that says what is on it.
    pub fn new(size_mm: [f64; 2], about: &str) -> Self {
        let mut page = Self {
            size_mm,
            blacks: Vec::new(),
            texts: Vec::new(),
        };
        let left = (size_mm[0] - f64::from(RULER_MM)) / 2.0;
        let base = size_mm[1] - MARGIN_MM - 4.0;
        const LINE_MM: f64 = 0.2;
        // Its ends are the outer edges of the first and the last tick.
        page.fill([left, base], [f64::from(RULER_MM), LINE_MM]);
        for tick in 0..=RULER_MM {
            let height = match (tick % 10, tick % 5) {
                (0, _) => 4.0,
                (_, 0) => 3.0,
                _ => 2.0,
            };
            let shift = LINE_MM * f64::from(tick) / f64::from(RULER_MM);
            page.fill(
                [left + f64::from(tick) - shift, base - height],
                [LINE_MM, height],
            );
        }
        page.write(
            [left, base + 3.5],
            2.5,
            "100 mm: if a rule says otherwise, the page was scaled",
        );
        let [width, height] = size_mm;
        let says = format!("{about}; page {width} x {height} mm");
        page.write([left, base - 6.0], 2.5, &says);
        page
    }

    /// The part of a page that markers may take: left, top, right, bottom.
    pub fn free_mm(size_mm: [f64; 2]) -> [f64; 4] {
        let [width, height] = size_mm;
        [
            MARGIN_MM,
            MARGIN_MM,
            width - MARGIN_MM,
            height - MARGIN_MM - FOOT_MM,
        ]
    }

    /// Blackens a rectangle.
    pub fn fill(&mut self, at: [f64; 2], size: [f64; 2]) {
        self.blacks.push(Black {
            outline: Rect { at, size },
            holes: Vec::new(),
        });
    }

    /// Adds small print.
    pub fn write(&mut self, at: [f64; 2], size_mm: f64, text: &str) {
        self.texts.push(Text {
            at,
            size_mm,
            text: text.to_owned(),
        });
    }

    /// A square of cells with its upper left corner at `at`: black, but for the white cells (rows from the top).
    pub fn print(&mut self, at: [f64; 2], size_mm: f64, white: &[bool]) {
        let side = white.len().isqrt();
        let cell = size_mm / side as f64;
        let mut holes = Vec::new();
        for row in 0..side {
            let mut column = 0;
            while column < side {
                let run = white[row * side + column..(row + 1) * side]
                    .iter()
                    .take_while(|white| **white)
                    .count();
                if run > 0 {
                    holes.push(Rect {
                        at: [at[0] + column as f64 * cell, at[1] + row as f64 * cell],
                        size: [run as f64 * cell, cell],
                    });
                }
                column += run.max(1);
            }
        }
        self.blacks.push(Black {
            outline: Rect {
                at,
                size: [size_mm; 2],
            },
            holes,
        });
    }

    /// Marks where to cut: the corners of a rectangle, outside of it.
    pub fn cut_marks(&mut self, at: [f64; 2], size: [f64; 2]) {
        const LENGTH_MM: f64 = 2.0;
        const LINE_MM: f64 = 0.1;
        for (x, outward_x) in [(at[0], -LENGTH_MM), (at[0] + size[0], 0.0)] {
            for (y, outward_y) in [(at[1], -LENGTH_MM), (at[1] + size[1], 0.0)] {
                self.fill([x + outward_x, y - LINE_MM / 2.0], [LENGTH_MM, LINE_MM]);
                self.fill([x - LINE_MM / 2.0, y + outward_y], [LINE_MM, LENGTH_MM]);
            }
        }
    }
}
