//! Lays a figure out and draws it.

use anyhow::Result;
use plotters::prelude::DrawingBackend;

use super::axis::Ruler;
use super::canvas::{ChartCanvas, Drawing, FAINT, GREY, INK, LOOKS, TextAnchor};
use super::figure::{Figure, FigurePanel, Scale, Series};

const TITLE_SIZE: f64 = 22.0;
const TEXT_SIZE: f64 = 15.5;
const LABEL_SIZE: f64 = 14.5;
const MARGIN: f64 = 18.0;
/// Title, reading and legend.
const HEAD: f64 = 92.0;
/// Room for ticks and labels of a panel.
const LEFT: f64 = 74.0;
const BOTTOM: f64 = 54.0;
const TOP: f64 = 34.0;
const RIGHT: f64 = 16.0;
/// Between an axis and the numbers beside it.
const TICK_GAP: f64 = 7.0;

impl Drawing for Figure {
    fn size(&self) -> [f64; 2] {
        let rows = self.panels.len().div_ceil(self.columns.max(1));
        let [width, height] = self.panel_size;
        [
            self.columns as f64 * width + 2.0 * MARGIN,
            rows as f64 * height + HEAD + MARGIN,
        ]
    }

    fn draw<B: DrawingBackend>(&self, canvas: &ChartCanvas<'_, B>) -> Result<()> {
        canvas.text(
            &self.title,
            [MARGIN, 24.0],
            TITLE_SIZE,
            INK,
            TextAnchor::Start,
        )?;
        canvas.text(
            &self.reading,
            [MARGIN, 50.0],
            TEXT_SIZE,
            INK,
            TextAnchor::Start,
        )?;
        self.draw_legend(canvas)?;
        for (index, panel) in self.panels.iter().enumerate() {
            let (column, row) = (index % self.columns, index / self.columns);
            let [width, height] = self.panel_size;
            let corner = [MARGIN + column as f64 * width, HEAD + row as f64 * height];
            draw_panel(canvas, panel, corner, self.panel_size)?;
        }
        Ok(())
    }
}

impl Figure {
    /// Each kind of series once, where there is more than one.
    fn draw_legend<B: DrawingBackend>(&self, canvas: &ChartCanvas<'_, B>) -> Result<()> {
        let mut kinds: Vec<&Series> = Vec::new();
        for series in self.panels.iter().flat_map(|panel| &panel.series) {
            if !series.name.is_empty() && kinds.iter().all(|known| known.name != series.name) {
                kinds.push(series);
            }
        }
        if kinds.len() < 2 {
            return Ok(());
        }
        let (mut x, y) = (MARGIN, 76.0);
        for series in kinds {
            let look = LOOKS[series.look % LOOKS.len()];
            if series.joined {
                canvas.dashed(&[[x, y], [x + 34.0, y]], look.0, 2.0, look.2)?;
            }
            canvas.mark([x + 17.0, y], look)?;
            canvas.text(
                &series.name,
                [x + 42.0, y],
                TEXT_SIZE,
                INK,
                TextAnchor::Start,
            )?;
            x += 42.0 + canvas.text_width(&series.name, TEXT_SIZE)? + 28.0;
        }
        Ok(())
    }
}

/// A box that nothing else may cover.
#[derive(Clone, Copy)]
struct TakenSpace {
    low: [f64; 2],
    high: [f64; 2],
}

impl TakenSpace {
    /// Area that both cover.
    fn shared(&self, other: &Self) -> f64 {
        let side = |axis: usize| {
            (self.high[axis].min(other.high[axis]) - self.low[axis].max(other.low[axis])).max(0.0)
        };
        side(0) * side(1)
    }

    fn middle(&self) -> [f64; 2] {
        [0, 1].map(|axis| (self.low[axis] + self.high[axis]) / 2.0)
    }

    fn area(&self) -> f64 {
        (self.high[0] - self.low[0]) * (self.high[1] - self.low[1])
    }
}

fn draw_panel<B: DrawingBackend>(
    canvas: &ChartCanvas<'_, B>,
    panel: &FigurePanel,
    corner: [f64; 2],
    size: [f64; 2],
) -> Result<()> {
    let plot = Plot::new(canvas, panel, corner, size)?;
    plot.ticks(canvas)?;
    plot.axes(canvas)?;
    let points = panel.series.iter().flat_map(|series| &series.points);
    let mut taken: Vec<TakenSpace> = points
        .map(|point| beside_mark(plot.place(point.at)))
        .collect();
    plot.rules(canvas, &mut taken)?;
    plot.front(canvas, &mut taken)?;
    plot.series(canvas)?;
    plot.labels(canvas, &mut taken)
}

/// A panel in its place in the picture.
struct Plot<'a> {
    panel: &'a FigurePanel,
    corner: [f64; 2],
    size: [f64; 2],
    /// Between the axes.
    frame: TakenSpace,
    x: Ruler,
    y: Ruler,
    /// Whether names are listed from the top.
    downwards: bool,
}

impl<'a> Plot<'a> {
    fn new<B: DrawingBackend>(
        canvas: &ChartCanvas<'_, B>,
        panel: &'a FigurePanel,
        corner: [f64; 2],
        size: [f64; 2],
    ) -> Result<Self> {
        let left = match &panel.y.scale {
            Scale::Names(names) => {
                let widths: Result<Vec<f64>> = names
                    .iter()
                    .map(|name| canvas.text_width(name, LABEL_SIZE))
                    .collect();
                widths?.into_iter().fold(0.0, f64::max) + 2.0 * TICK_GAP
            }
            _ => LEFT,
        };
        let points = || panel.series.iter().flat_map(|series| &series.points);
        let ruled = |upright: bool| {
            let rules = panel.rules.iter();
            rules
                .filter(move |rule| rule.upright == upright)
                .map(|rule| rule.at)
        };
        Ok(Self {
            panel,
            corner,
            size,
            frame: TakenSpace {
                low: [corner[0] + left, corner[1] + TOP],
                high: [corner[0] + size[0] - RIGHT, corner[1] + size[1] - BOTTOM],
            },
            x: Ruler::new(
                &panel.x,
                points().map(|point| point.at[0]).chain(ruled(true)),
            ),
            y: Ruler::new(
                &panel.y,
                points().map(|point| point.at[1]).chain(ruled(false)),
            ),
            downwards: matches!(panel.y.scale, Scale::Names(_)),
        })
    }

    /// Where a pair of values lies in the picture.
    fn place(&self, at: [f64; 2]) -> [f64; 2] {
        let TakenSpace { low, high } = self.frame;
        let up = match self.downwards {
            true => 1.0 - self.y.share(at[1]),
            false => self.y.share(at[1]),
        };
        [
            low[0] + self.x.share(at[0]) * (high[0] - low[0]),
            high[1] - up * (high[1] - low[1]),
        ]
    }

    fn ticks<B: DrawingBackend>(&self, canvas: &ChartCanvas<'_, B>) -> Result<()> {
        let frame = &self.frame;
        let mut free_from = f64::NEG_INFINITY;
        for (value, name) in self.x.ticks() {
            let [at, _] = self.place([value, 0.0]);
            canvas.line(&[[at, frame.low[1]], [at, frame.high[1]]], FAINT, 0.8)?;
            let half = canvas.text_width(&name, LABEL_SIZE)? / 2.0;
            if at - half < free_from {
                continue;
            }
            free_from = at + half + TICK_GAP;
            let below = [at, frame.high[1] + TICK_GAP + 6.0];
            canvas.text(&name, below, LABEL_SIZE, INK, TextAnchor::Middle)?;
        }
        for (value, name) in self.y.ticks() {
            let at = self.place([f64::NAN, value])[1];
            canvas.line(&[[frame.low[0], at], [frame.high[0], at]], FAINT, 0.8)?;
            let beside = [frame.low[0] - TICK_GAP, at];
            canvas.text(&name, beside, LABEL_SIZE, INK, TextAnchor::End)?;
        }
        Ok(())
    }

    /// The axes with their labels, and the title.
    fn axes<B: DrawingBackend>(&self, canvas: &ChartCanvas<'_, B>) -> Result<()> {
        let (panel, corner, size) = (self.panel, self.corner, self.size);
        let TakenSpace { low, high } = self.frame;
        let axes = [low, [low[0], high[1]], high];
        canvas.line(&axes, INK, 1.2)?;
        let title = [low[0], corner[1] + 17.0];
        canvas.text(&panel.title, title, TEXT_SIZE, INK, TextAnchor::Start)?;
        let below = [(low[0] + high[0]) / 2.0, corner[1] + size[1] - 16.0];
        canvas.text(&panel.x.label, below, TEXT_SIZE, INK, TextAnchor::Middle)?;
        if !self.downwards {
            let beside = [corner[0] + 14.0, (low[1] + high[1]) / 2.0];
            canvas.upright_text(&panel.y.label, beside, TEXT_SIZE)?;
        }
        Ok(())
    }

    fn rules<B: DrawingBackend>(
        &self,
        canvas: &ChartCanvas<'_, B>,
        taken: &mut Vec<TakenSpace>,
    ) -> Result<()> {
        let TakenSpace { low, high } = self.frame;
        for rule in &self.panel.rules {
            let width = canvas.text_width(&rule.label, LABEL_SIZE)?;
            let middles = if rule.upright {
                let [at, _] = self.place([rule.at, 0.0]);
                canvas.dashed(&[[at, low[1]], [at, high[1]]], GREY, 1.4, &[6.0, 4.0])?;
                taken.push(along([at, low[1]], [at, high[1]]));
                let across = width / 2.0 + 6.0;
                let ends = [high[1] - 12.0, low[1] + 12.0];
                ends.map(|y| [[at + across, y], [at - across, y]])
            } else {
                let at = self.place([f64::NAN, rule.at])[1];
                canvas.dashed(&[[low[0], at], [high[0], at]], GREY, 1.4, &[6.0, 4.0])?;
                taken.push(along([low[0], at], [high[0], at]));
                let ends = [high[0] - width / 2.0 - 6.0, low[0] + width / 2.0 + 6.0];
                ends.map(|x| [[x, at - 11.0], [x, at + 11.0]])
            };
            let spots = middles.into_iter().flatten();
            let spot = least_covered(spots.map(|at| around(at, width)), &self.frame, taken);
            canvas.text(
                &rule.label,
                spot.middle(),
                LABEL_SIZE,
                GREY,
                TextAnchor::Middle,
            )?;
            taken.push(spot);
        }
        Ok(())
    }

    fn front<B: DrawingBackend>(
        &self,
        canvas: &ChartCanvas<'_, B>,
        taken: &mut Vec<TakenSpace>,
    ) -> Result<()> {
        let front = &self.panel.front;
        let (Some(first), Some(last)) = (front.first(), front.last()) else {
            return Ok(());
        };
        let TakenSpace { low, high } = self.frame;
        // Between two of its points nothing is known to be better than the dearer one's time at the other's error.
        let mut steps = vec![[self.place(*first)[0], low[1]]];
        for &point in front {
            let [at_x, at_y] = self.place(point);
            steps.extend(steps.last().map(|&[_, before]| [at_x, before]));
            steps.push([at_x, at_y]);
        }
        steps.push([high[0], self.place(*last)[1]]);
        canvas.line(&steps, GREY, 1.2)?;
        taken.extend(steps.windows(2).map(|ends| along(ends[0], ends[1])));
        Ok(())
    }

    fn series<B: DrawingBackend>(&self, canvas: &ChartCanvas<'_, B>) -> Result<()> {
        for series in &self.panel.series {
            let look = LOOKS[series.look % LOOKS.len()];
            let points = series.points.iter();
            let places: Vec<[f64; 2]> = points.map(|point| self.place(point.at)).collect();
            if series.joined {
                canvas.dashed(&places, look.0, 2.0, look.2)?;
            }
            for &at in &places {
                canvas.mark(at, look)?;
            }
        }
        Ok(())
    }

    fn labels<B: DrawingBackend>(
        &self,
        canvas: &ChartCanvas<'_, B>,
        taken: &mut Vec<TakenSpace>,
    ) -> Result<()> {
        for series in &self.panel.series {
            let color = LOOKS[series.look % LOOKS.len()].0;
            for point in series.points.iter().filter(|point| !point.label.is_empty()) {
                let width = canvas.text_width(&point.label, LABEL_SIZE)?;
                let own = self.place(point.at);
                let spot = free_spot(own, width, &self.frame, taken);
                let middle = spot.middle();
                canvas.text(&point.label, middle, LABEL_SIZE, color, TextAnchor::Middle)?;
                taken.push(spot);
            }
        }
        Ok(())
    }
}

const LABEL_HEIGHT: f64 = 14.0;

/// What a mark covers.
fn beside_mark(at: [f64; 2]) -> TakenSpace {
    TakenSpace {
        low: at.map(|part| part - 5.0),
        high: at.map(|part| part + 5.0),
    }
}

/// What a line along an axis covers.
fn along(from: [f64; 2], to: [f64; 2]) -> TakenSpace {
    TakenSpace {
        low: [0, 1].map(|axis| from[axis].min(to[axis]) - 1.0),
        high: [0, 1].map(|axis| from[axis].max(to[axis]) + 1.0),
    }
}

/// What a label of a width covers about its middle.
fn around(middle: [f64; 2], width: f64) -> TakenSpace {
    let half = [width / 2.0, LABEL_HEIGHT / 2.0];
    TakenSpace {
        low: [middle[0] - half[0], middle[1] - half[1]],
        high: [middle[0] + half[0], middle[1] + half[1]],
    }
}

/// Where a label beside a mark covers least of what is there already; the first of equals is the nearest.
fn free_spot(mark: [f64; 2], width: f64, frame: &TakenSpace, taken: &[TakenSpace]) -> TakenSpace {
    let spots = [8.0, 16.0, 26.0].into_iter().flat_map(|gap| {
        let (across, down) = (gap + width / 2.0, gap + LABEL_HEIGHT / 2.0);
        [
            [across, 0.0],
            [0.0, -down],
            [0.0, down],
            [-across, 0.0],
            [across, -down],
            [across, down],
            [-across, -down],
            [-across, down],
        ]
    });
    let boxes = spots.map(|[x, y]| around([mark[0] + x, mark[1] + y], width));
    least_covered(boxes, frame, taken)
}

/// The first of the boxes that cover least of what is there already, and lie in the frame.
fn least_covered(
    spots: impl Iterator<Item = TakenSpace>,
    frame: &TakenSpace,
    taken: &[TakenSpace],
) -> TakenSpace {
    let cost = |spot: &TakenSpace| {
        let covered: f64 = taken.iter().map(|other| spot.shared(other)).sum();
        covered + 3.0 * (spot.area() - spot.shared(frame))
    };
    let nowhere = (f64::INFINITY, around([0.0; 2], 0.0));
    let costs = spots.map(|spot| (cost(&spot), spot));
    let least = costs.fold(
        nowhere,
        |least, spot| if spot.0 < least.0 { spot } else { least },
    );
    least.1
}
