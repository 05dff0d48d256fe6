//! What a chart shows, as values: panels with axes, series of points, lines to hold them against.

/// A whole picture.
#[derive(Debug, Clone, Default)]
pub struct Figure {
    /// What it shows, at its top.
    pub title: String,
    /// How to read it, in a line below.
    pub reading: String,
    /// Panels side by side.
    pub columns: usize,
    /// Width and height of each panel with its axes, in units of a 96th of an inch.
    pub panel_size: [f64; 2],
    /// Row by row.
    pub panels: Vec<FigurePanel>,
}

/// One plot.
#[derive(Debug, Clone, Default)]
pub struct FigurePanel {
    /// What it shows, above it.
    pub title: String,
    /// To the right.
    pub x: Axis,
    /// Upwards; names go downwards.
    pub y: Axis,
    /// What is drawn in it.
    pub series: Vec<Series>,
    /// Lines across it.
    pub rules: Vec<Rule>,
    /// Corners of a Pareto front.
    pub front: Vec<[f64; 2]>,
}

/// An axis with its unit.
#[derive(Debug, Clone, Default)]
pub struct Axis {
    /// With the unit.
    pub label: String,
    /// How values become places.
    pub scale: Scale,
    /// What it spans at least.
    pub spans: Vec<f64>,
}

/// A mapping of values to places.
#[derive(Debug, Clone, Default, PartialEq)]
pub enum Scale {
    /// Evenly.
    #[default]
    Linear,
    /// By their logarithm; what is smaller than the axis begins with, 0 too, stands at its beginning.
    Log,
    /// Each whole number is a name.
    Names(Vec<String>),
}

/// Points of one kind.
#[derive(Debug, Clone, Default)]
pub struct Series {
    /// Which kind; the legend names each once.
    pub name: String,
    /// Which of the colours, marks and dashes.
    pub look: usize,
    /// Whether a line joins them.
    pub joined: bool,
    /// In the order of the line.
    pub points: Vec<Point>,
}

/// A measured value.
#[derive(Debug, Clone, Default)]
pub struct Point {
    /// Where it is.
    pub at: [f64; 2],
    /// Written beside it.
    pub label: String,
}

/// A line across a panel.
#[derive(Debug, Clone, Default)]
pub struct Rule {
    /// Whether it stands upright at an x rather than lies at a y.
    pub upright: bool,
    /// Where.
    pub at: f64,
    /// Written at its end.
    pub label: String,
}

impl Axis {
    /// An even axis that begins at 0.
    pub fn from_zero(label: &str) -> Self {
        Self {
            label: label.to_owned(),
            scale: Scale::Linear,
            spans: vec![0.0],
        }
    }

    /// A logarithmic axis.
    pub fn log(label: &str) -> Self {
        Self {
            label: label.to_owned(),
            scale: Scale::Log,
            spans: Vec::new(),
        }
    }
}

impl Point {
    /// Without a label.
    pub fn at(x: f64, y: f64) -> Self {
        Self {
            at: [x, y],
            label: String::new(),
        }
    }

    /// With one.
    pub fn named(x: f64, y: f64, label: &str) -> Self {
        Self {
            at: [x, y],
            label: label.to_owned(),
        }
    }
}

/// The points that no other beats in both: the less of either the better. In the order of x.
pub fn pareto_front(points: impl IntoIterator<Item = [f64; 2]>) -> Vec<[f64; 2]> {
    let mut sorted: Vec<[f64; 2]> = points.into_iter().collect();
    sorted.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    let mut front: Vec<[f64; 2]> = Vec::new();
    for point in sorted {
        if front.last().is_none_or(|last| point[1] < last[1]) {
            front.push(point);
        }
    }
    front
}

/// Exponent and factor of the power law that fits points best, by least squares of the logarithms; `None` for fewer than
/// two different x.
pub fn power_law(points: &[[f64; 2]]) -> Option<(f64, f64)> {
    let logs: Vec<[f64; 2]> = points.iter().map(|point| point.map(f64::ln)).collect();
    let count = logs.len() as f64;
    let mean = |axis: usize| logs.iter().map(|log| log[axis]).sum::<f64>() / count;
    let (mean_x, mean_y) = (mean(0), mean(1));
    let sum = |of: fn([f64; 2]) -> f64| {
        let off = logs.iter().map(|log| [log[0] - mean_x, log[1] - mean_y]);
        off.map(of).sum::<f64>()
    };
    let spread = sum(|[x, _]| x * x);
    (logs.len() > 1 && spread > 0.0).then(|| {
        let exponent = sum(|[x, y]| x * y) / spread;
        (exponent, (mean_y - exponent * mean_x).exp())
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_beats_a_front() {
        let points = [
            [3.0, 1.0],
            [1.0, 5.0],
            [2.0, 5.0],
            [2.0, 3.0],
            [4.0, 1.0],
            [1.0, 6.0],
        ];
        assert_eq!(pareto_front(points), [[1.0, 5.0], [2.0, 3.0], [3.0, 1.0]]);
        assert!(pareto_front([]).is_empty());
    }

    #[test]
    fn a_power_law_is_found_again() {
        let points: Vec<[f64; 2]> = [1.0, 2.0, 7.0, 40.0]
            .map(|x: f64| [x, 3.0 * x.powf(0.75)])
            .to_vec();
        let (exponent, factor) = power_law(&points).unwrap();
        assert!((exponent - 0.75).abs() < 1e-12 && (factor - 3.0).abs() < 1e-12);
        assert_eq!(power_law(&points[..1]), None);
    }
}
