//! Tracking, and a shadow drawn with the pose that it gives, against marker size and viewing angle: rendered sheets through
//! a known camera, each picture as if it were the first.

use std::path::PathBuf;

use anyhow::Result;
use glam::{DAffine3, DVec2, DVec3};
use serde::{Deserialize, Serialize};

use super::family::Chart;
use super::figure::{Axis, Figure, FigurePanel, Point, Series};
use super::lab::Lab;
use super::measured::rounded;
use super::peers_table::{LIGHT_M, PeersStage, TORUS_CENTER_M, torus};
use super::shots::grey_frame;
use super::tracking::bare_library;
use crate::app::stages::stats::quantile;
use crate::app::truth::sheets::{camera_above, photograph, with_noise};
use crate::app::truth::{PoseErrors, shifts_px};
use crate::geometry::camera::{Distortion, Intrinsics};
use crate::render::{Layers, REAL, Renderer, Shown, VIRTUAL_HIDES};
use crate::scene::{Anchor, DetectorKind, Family, Marker, SearchArea, TrackingSettings};
use crate::tracking::{Status, Tracker};

const CAMERA: Intrinsics = Intrinsics {
    size_px: [640, 480],
    focal_px: DVec2::new(615.0, 613.0),
    center_px: DVec2::new(321.4, 238.2),
    distortion: Distortion::NONE,
};
const MARKER_M: f64 = 0.04;
/// Noise of the pictures, levels of 255.
const NOISE: f64 = 2.0;

const SIZE: &str = "size";
const TILT: &str = "tilt";
/// Sides of a marker, pixels, and the tilt at which they are seen, degrees.
const SIZES_PX: [f64; 8] = [10.0, 14.0, 18.0, 24.0, 32.0, 45.0, 64.0, 90.0];
const TILT_DEG: f64 = 35.0;
/// Tilts, degrees from frontal, and the side, pixels, at which they are seen.
const TILTS_DEG: [f64; 9] = [0.0, 5.0, 10.0, 20.0, 35.0, 50.0, 60.0, 70.0, 78.0];
const SIDE_PX: f64 = 50.0;

/// The chart.
pub struct MarkerView;

/// One library at one size and tilt.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct MarkerViewRow {
    varied: String,
    side_px: f64,
    tilt_deg: f64,
    layout: String,
    library: String,
    pictures: u32,
    with_pose_pct: f64,
    shift_median_px: Option<f64>,
    shift_p95_px: Option<f64>,
    /// Pixels wrongly in or out of a virtual shadow, of those that are in it; the median of the pictures with a pose.
    wrong_shadow_pct: Option<f64>,
}

const LONE: &str = "lone marker";
const BOARD: &str = "board of four";

fn layouts() -> [(&'static str, Vec<Marker>); 2] {
    let marker = |id, x_m, y_m| {
        Marker::alone(Family::TAG36H11, id, MARKER_M).in_plane(DVec2::new(x_m, y_m), 0.0)
    };
    let board = [
        (0, -0.06, 0.04),
        (1, 0.06, 0.04),
        (2, -0.06, -0.04),
        (3, 0.06, -0.04),
    ];
    [
        (LONE, vec![marker(17, 0.0, 0.0)]),
        (BOARD, board.map(|(id, x, y)| marker(id, x, y)).to_vec()),
    ]
}

const APRILTAG: &str = "libapriltag, decimation 1";
const ARUCO: &str = "OpenCV's ArUco, contour";
const OURS: &str = "gnomon";

/// All at full resolution: what a picture has to give, not what is saved on it.
fn ways() -> [(&'static str, TrackingSettings); 3] {
    let detector_alone = |detector| TrackingSettings {
        detector,
        decimation: 1.0,
        ..bare_library()
    };
    let ours = TrackingSettings {
        search: SearchArea::Near,
        ..TrackingSettings::default()
    };
    [
        (APRILTAG, detector_alone(DetectorKind::AprilTag)),
        (ARUCO, detector_alone(DetectorKind::Aruco)),
        (OURS, ours),
    ]
}

/// Side in pixels and tilt of each step of a sweep.
fn steps(varied: &str) -> Vec<[f64; 2]> {
    match varied {
        SIZE => SIZES_PX.map(|side_px| [side_px, TILT_DEG]).to_vec(),
        _ => TILTS_DEG.map(|tilt_deg| [SIDE_PX, tilt_deg]).to_vec(),
    }
}

/// A camera over the sheet; each picture another turn, another place between the pixels.
fn pose(side_px: f64, tilt_deg: f64, picture: u32) -> DAffine3 {
    // Multiples of the golden ratio fill a circle evenly, whatever their number.
    let part = |step: f64| (f64::from(picture) * step).fract();
    let depth_m = CAMERA.focal_px.x * MARKER_M / side_px;
    let aside = 4.0 * depth_m / CAMERA.focal_px.x;
    let at_m = DVec3::new(
        aside * (part(0.754_877_7) - 0.5),
        aside * (part(0.569_840_3) - 0.5),
        depth_m,
    );
    camera_above(tilt_deg, 360.0 * part(0.618_034), at_m)
}

/// A torus over the sheet in the light of a lamp, drawn with poses of the sheet.
struct ShadowBench {
    stage: PeersStage,
    renderer: Renderer,
}

impl ShadowBench {
    fn new(lab: &Lab<'_>) -> Result<Self> {
        let caster = (torus(2_500, 0.5), TORUS_CENTER_M);
        let mut stage = PeersStage::new(vec![caster], &[LIGHT_M], CAMERA.size_px, 1);
        // The box, which is not on the sheet.
        stage.scene.phantoms.pop();
        let mut renderer = Renderer::new(lab.gpu()?, &stage.scene, CAMERA)?;
        renderer.upload(&grey_frame(CAMERA.size_px))?;
        Ok(Self { stage, renderer })
    }

    fn draw(&mut self, camera_from_sheet: DAffine3) -> Result<Layers> {
        let poses = self.stage.poses_from(camera_from_sheet, 0);
        self.renderer.draw(&poses, Shown::Composite);
        Ok(self.renderer.layers()?)
    }
}

/// Pixels, real in both, whose virtual shadow is another, over those that have one; percent.
fn wrong_shadow_pct(truth: &Layers, found: &Layers) -> f64 {
    let (mut shadow, mut wrong) = (0_u32, 0_u32);
    for index in 0..truth.role.len() {
        if truth.role[index] == REAL && found.role[index] == REAL {
            let [truly, found] = [truth, found].map(|layers| layers.shadow[0][index]);
            shadow += u32::from(truly & VIRTUAL_HIDES != 0);
            wrong += u32::from((truly ^ found) & VIRTUAL_HIDES != 0);
        }
    }
    100.0 * f64::from(wrong) / f64::from(shadow.max(1))
}

impl Chart for MarkerView {
    const NAME: &'static str = "marker-view";
    const FAMILY: &'static str = "stability";
    const SHOWS: &'static str = "How small and how oblique a marker may be: rendered sheets (640 x 480, noise of 2 levels, \
        markers of 40 mm) through a known camera, each picture as if it were the first. Sizes are seen at 35 degrees from \
        frontal, tilts with sides of 50 pixels. Shift is that of chart tracking, whose four places lie up to 9 cm from \
        the anchor. A lone marker has two poses: where the wrong one is taken, the 95 % panel jumps. Shadow: of a torus 6 cm \
        above the sheet, drawn with the found pose instead of the true one; pixels wrongly in or out of it, of those in it.";
    type Row = MarkerViewRow;

    fn inputs(&self, _: &Lab<'_>) -> Result<Vec<PathBuf>> {
        Ok(Vec::new())
    }

    fn units(&self, _: &Lab<'_>) -> Result<Vec<String>> {
        Ok(vec![SIZE.to_owned(), TILT.to_owned()])
    }

    fn measure(&self, lab: &Lab<'_>, unit: &str) -> Result<Option<Vec<MarkerViewRow>>> {
        let pictures = if lab.quick { 2 } else { 40 };
        let mut rows = Vec::new();
        let mut bench = ShadowBench::new(lab)?;
        for [side_px, tilt_deg] in steps(unit).into_iter().step_by(lab.step()) {
            for (layout, markers) in layouts() {
                let anchors = [Anchor {
                    name: layout.to_owned(),
                    markers: markers.clone(),
                }];
                let mut errors = ways().map(|_| (PoseErrors::default(), Vec::new()));
                for picture in 0..pictures {
                    if lab.is_stopped() {
                        return Ok(None);
                    }
                    let truth = pose(side_px, tilt_deg, picture);
                    let clean = photograph(&CAMERA, &[(&markers, truth)], 0.0);
                    let frame = with_noise(&clean, NOISE, u64::from(picture) + 1);
                    let true_shadow = bench.draw(truth)?;
                    for ((_, settings), (errors, wrong_pct)) in ways().iter().zip(&mut errors) {
                        let found = Tracker::new(settings, &anchors, CAMERA)?.track(&frame)?;
                        let found = found.first().filter(|pose| pose.status != Status::Lost);
                        let found = found.and_then(|pose| pose.camera_from_anchor);
                        errors.add(found.map(|found| shifts_px(&CAMERA, &found, &truth)));
                        if let Some(found) = found {
                            wrong_pct.push(wrong_shadow_pct(&true_shadow, &bench.draw(found)?));
                        }
                    }
                }
                for ((library, _), (errors, wrong_pct)) in ways().iter().zip(&errors) {
                    let has_any = !wrong_pct.is_empty();
                    rows.push(MarkerViewRow {
                        varied: unit.to_owned(),
                        side_px,
                        tilt_deg,
                        layout: layout.to_owned(),
                        library: (*library).to_owned(),
                        pictures,
                        with_pose_pct: rounded(errors.with_pose_pct()),
                        shift_median_px: errors.shift_px(0.5).map(rounded),
                        shift_p95_px: errors.shift_px(0.95).map(rounded),
                        wrong_shadow_pct: has_any.then(|| rounded(quantile(wrong_pct, 0.5))),
                    });
                }
            }
        }
        Ok(Some(rows))
    }

    fn figure(&self, rows: &[MarkerViewRow]) -> Figure {
        type Metric = (&'static str, fn(&MarkerViewRow) -> Option<f64>);
        let metrics: [Metric; 4] = [
            ("pictures with a pose, %", |row| Some(row.with_pose_pct)),
            ("shift, median, px", |row| row.shift_median_px),
            ("shift, 95 % of pictures, px", |row| row.shift_p95_px),
            ("wrong shadow, median, %", |row| row.wrong_shadow_pct),
        ];
        let mut panels = Vec::new();
        for (varied, label) in [
            (SIZE, "side of the marker, px"),
            (TILT, "degrees from frontal"),
        ] {
            for layout in [LONE, BOARD] {
                for (index, (name, value)) in metrics.iter().enumerate() {
                    let series = [APRILTAG, ARUCO, OURS].into_iter().enumerate();
                    let series = series.map(|(look, library)| Series {
                        name: library.to_owned(),
                        look,
                        joined: true,
                        points: rows
                            .iter()
                            .filter(|row| row.varied == varied && row.layout == layout)
                            .filter(|row| row.library == library)
                            .filter_map(|row| {
                                let x = match varied {
                                    SIZE => row.side_px,
                                    _ => row.tilt_deg,
                                };
                                Some(Point::at(x, value(row)?))
                            })
                            .collect(),
                    });
                    panels.push(FigurePanel {
                        title: layout.to_owned(),
                        x: match varied {
                            SIZE => Axis::log(label),
                            _ => Axis::from_zero(label),
                        },
                        y: match index {
                            0 => Axis {
                                spans: vec![0.0, 100.0],
                                ..Axis::from_zero(name)
                            },
                            _ => Axis::log(name),
                        },
                        series: series.collect(),
                        ..FigurePanel::default()
                    });
                }
            }
        }
        Figure {
            title: "How small and how oblique a marker may be".to_owned(),
            reading: "Above: size; below: tilt. From the left: how often there is a pose, how far it is off, and what \
                that makes of a shadow."
                .to_owned(),
            columns: metrics.len(),
            panel_size: [420.0, 300.0],
            panels,
        }
    }
}
