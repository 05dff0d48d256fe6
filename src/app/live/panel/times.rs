//! What each stage takes, as numbers and as a plot of the last seconds.

use eframe::egui::{Grid, Ui};
use egui_plot::{Legend, Line, Plot, PlotPoints};

use super::Facts;
use crate::app::live::meters::Sample;

/// Height of the plot, points.
const PLOT_HEIGHT: f32 = 120.0;

/// What is measured, by its name.
type Figure = (&'static str, fn(&Sample) -> f64);

/// Shows it.
pub fn show(ui: &mut Ui, facts: &Facts<'_>) {
    let meters = facts.meters;
    ui.label(format!(
        "{:.0} frames/s",
        meters.frames_per_sec(facts.now_secs)
    ));
    let stages: [Figure; 4] = [
        ("tracking", |sample| sample.track_ms),
        ("drawing", |sample| sample.draw_ms),
        ("waiting", Sample::idle_ms),
        ("latency", |sample| sample.latency_ms),
    ];
    Grid::new("stages").num_columns(2).show(ui, |ui| {
        for (name, figure) in stages {
            ui.label(name);
            match meters.median(figure) {
                Some(ms) => ui.label(format!("{ms:.1} ms")),
                None => ui.weak("–"),
            };
            ui.end_row();
        }
        let (captured, [tracking, window, broken]) = facts.frames;
        ui.label("frames");
        ui.label(captured.to_string());
        ui.end_row();
        ui.label("dropped");
        ui.label((tracking + window + broken).to_string())
            .on_hover_text(format!(
                "{tracking} while tracking was busy, {window} while the window was, {broken} came broken"
            ));
        ui.end_row();
    });
    Plot::new("times")
        .height(PLOT_HEIGHT)
        .allow_drag(false)
        .allow_zoom(false)
        .allow_scroll(false)
        .include_y(0.0)
        .y_axis_label("ms")
        .show_axes([false, true])
        .legend(Legend::default())
        .show(ui, |plot| {
            for (name, figure) in stages {
                let points: PlotPoints<'_> = meters
                    .samples()
                    .map(|sample| [sample.shown_secs, figure(sample)])
                    .collect();
                plot.line(Line::new(name, points));
            }
        });
    ui.weak(facts.adapter);
}
