//! What becomes of a shadow when phantoms are not quite where the real things are: a torus's shadow across a box, held
//! against the same with the box in its place; and `lamp` at true poses, against what a camera would have seen.

use std::path::PathBuf;
use std::sync::Arc;

use anyhow::{Context as _, Result, bail};
use glam::{DAffine3, DVec3};
use serde::{Deserialize, Serialize};

use super::family::Chart;
use super::figure::{Axis, Figure, FigurePanel, Point, Series};
use super::lab::Lab;
use super::measured::rounded;
use super::peers_table::{PeersStage, SIZE_PX, torus};
use super::shots::{Shots, grey_frame};
use crate::app::truth::{Drawn, around, compare, draw, edges};
use crate::render::{Gpu, Layers, REAL, Renderer, VIRTUAL_HIDES};
use crate::scene::{Object, Scene};

/// Gains that differ by more are a rim that the eye sees.
const VISIBLE_GAIN: f32 = 0.1;
/// How far from an outline a pixel still belongs to the rim, pixels.
const RIM_REACH_PX: i64 = 6;
/// The box alone is displaced there.
const BOX_SCENE: &str = "box";
/// The phantoms of `lamp` that are not the table's.
const STANDING: [&str; 2] = ["house", "tin"];
const LAMP: &str = "lamp";

/// A lamp that throws the torus's shadow across the box.
const LAMP_M: DVec3 = DVec3::new(0.25, -0.05, 0.35);
/// Beside the box, on the lamp's side.
const TORUS_M: DVec3 = DVec3::new(0.0, 0.01, 0.1);

/// The chart.
pub struct Displacement;

/// One displacement in one of the scenes.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct DisplacementRow {
    scene: String,
    phantoms: String,
    amount: f64,
    wrong_shadow_pct: f64,
    factor_rms: f64,
    rim_px: f64,
    residual_real: Option<f64>,
}

const MOVED: &str = "moved, mm";
const TURNED: &str = "turned, degrees";
const LEFT_OUT: &str = "left out";

/// A change to phantoms.
#[derive(Clone, Copy)]
enum Change {
    Moved { by_m: DVec3 },
    Turned { by_rad: f64 },
    LeftOut,
}

/// What was done, by how much, and the changes that it is the mean of.
fn steps() -> Vec<(&'static str, f64, Vec<Change>)> {
    let directions = [DVec3::X, DVec3::Y, DVec3::NEG_X, DVec3::NEG_Y];
    let mut steps = vec![(MOVED, 0.0, vec![Change::Moved { by_m: DVec3::ZERO }])];
    for mm in [0.5, 1.0, 2.0, 5.0] {
        let moved = directions.map(|direction| Change::Moved {
            by_m: 1e-3 * mm * direction,
        });
        steps.push((MOVED, mm, moved.to_vec()));
    }
    for degrees in [0.25, 0.5, 1.0] {
        let turned = [1.0, -1.0].map(|sense: f64| Change::Turned {
            by_rad: (sense * degrees).to_radians(),
        });
        steps.push((TURNED, degrees, turned.to_vec()));
    }
    steps.push((LEFT_OUT, 1.0, vec![Change::LeftOut]));
    steps
}

/// The four figures of a row; the last one where there is a truth.
type DisplacementErrors = ([f64; 3], Option<f64>);

impl Chart for Displacement {
    const NAME: &'static str = "displacement";
    const FAMILY: &'static str = "stability";
    const SHOWS: &'static str = "What a phantom beside its real thing costs. *box*: a torus's shadow across a box, against \
        the same with the box's phantom in its place. *lamp*: house and tin off alike, against the path-traced truth. Means \
        over four directions or both senses. A rim pixel's factor is off by more than 0.1; on *lamp* those within 6 pixels \
        of an outline count.";
    type Row = DisplacementRow;

    fn inputs(&self, lab: &Lab<'_>) -> Result<Vec<PathBuf>> {
        let recording = lab.recording(LAMP)?;
        Ok(vec![recording.folder, recording.scene])
    }

    fn units(&self, _: &Lab<'_>) -> Result<Vec<String>> {
        Ok(vec![BOX_SCENE.to_owned(), LAMP.to_owned()])
    }

    fn measure(&self, lab: &Lab<'_>, unit: &str) -> Result<Option<Vec<DisplacementRow>>> {
        let gpu = lab.gpu()?;
        match unit {
            BOX_SCENE => {
                let unmoved = Change::Moved { by_m: DVec3::ZERO };
                let exact = shoot_box(&gpu, unmoved)?;
                rows(lab, unit, |change| {
                    let found = shoot_box(&gpu, change)?;
                    Ok(vec![(box_errors(&exact, &found), None)])
                })
            }
            LAMP => {
                let recording = lab.recording(LAMP)?;
                let scene = recording.load_scene()?;
                let shots = Shots::of(lab, &recording, &scene)?;
                let drawn = |change| draw_lamp(&gpu, &scene, &shots, change);
                let exact = drawn(Change::Moved { by_m: DVec3::ZERO })?;
                let rims: Vec<Vec<bool>> = exact
                    .iter()
                    .zip(&drawn(Change::LeftOut)?)
                    .map(|(exact, bare)| rim(&exact.layers, &bare.layers, shots.size_px()))
                    .collect();
                rows(lab, unit, |change| {
                    let found = drawn(change)?;
                    let frames = found.iter().zip(&exact).zip(&rims).zip(&shots.shots);
                    frames
                        .map(|(((drawn, exact), rim), shot)| {
                            let truth = compare(shot.frame.index, &shot.truth, drawn)?;
                            let rim_px = rim_px(rim, &drawn.layers, &exact.layers);
                            let shadow = truth.shadow.context("a lamp's shadow")?;
                            let errors = [shadow.wrong_pct, truth.factor, rim_px];
                            Ok((errors, Some(truth.residual_real)))
                        })
                        .collect()
                })
            }
            _ => bail!("no scene {unit} is displaced"),
        }
    }

    fn figure(&self, rows: &[DisplacementRow]) -> Figure {
        type Metric = (&'static str, fn(&DisplacementRow) -> f64);
        let metrics: [Metric; 3] = [
            ("wrong shadow, % of pixels", |row| row.wrong_shadow_pct),
            ("error of the factor, rms", |row| row.factor_rms),
            ("visible rim, pixels", |row| row.rim_px),
        ];
        let mut panels = Vec::new();
        for (phantoms, label) in [
            (MOVED, "phantoms moved, mm"),
            (TURNED, "phantoms turned, degrees"),
        ] {
            for (name, value) in metrics {
                let series = [BOX_SCENE, LAMP].into_iter().enumerate();
                let series = series.map(|(look, scene)| Series {
                    name: scene.to_owned(),
                    look,
                    joined: true,
                    points: rows
                        .iter()
                        .filter(|row| row.scene == scene)
                        // Nothing moved is nothing turned.
                        .filter(|row| row.phantoms == phantoms || row.amount == 0.0)
                        .map(|row| Point::at(row.amount, value(row)))
                        .collect(),
                });
                panels.push(FigurePanel {
                    title: name.to_owned(),
                    x: Axis::from_zero(label),
                    y: Axis::from_zero(name),
                    series: series.collect(),
                    ..FigurePanel::default()
                });
            }
        }
        let left_out = rows.iter().filter(|row| row.phantoms == LEFT_OUT);
        let left_out = left_out.map(|row| {
            format!(
                "{} {} %, factor {}, rim {} px",
                row.scene, row.wrong_shadow_pct, row.factor_rms, row.rim_px
            )
        });
        Figure {
            title: "Phantoms beside their real things".to_owned(),
            reading: format!(
                "Without the phantoms: {}.",
                left_out.collect::<Vec<_>>().join("; ")
            ),
            columns: metrics.len(),
            panel_size: [420.0, 310.0],
            panels,
        }
    }
}

/// A row for each step: the mean over its changes and whatever frames `errors` gives for each.
fn rows(
    lab: &Lab<'_>,
    scene: &str,
    errors: impl Fn(Change) -> Result<Vec<DisplacementErrors>>,
) -> Result<Option<Vec<DisplacementRow>>> {
    let mut rows = Vec::new();
    for (phantoms, amount, changes) in steps().into_iter().step_by(lab.step()) {
        if lab.is_stopped() {
            return Ok(None);
        }
        let mut all = Vec::new();
        let changes = changes.into_iter().take(lab.directions());
        for change in changes {
            all.extend(errors(change)?);
        }
        let count = all.len().max(1) as f64;
        let mean = |column: usize| {
            rounded(all.iter().map(|(errors, _)| errors[column]).sum::<f64>() / count)
        };
        let residuals: Option<Vec<f64>> = all.iter().map(|(_, residual)| *residual).collect();
        rows.push(DisplacementRow {
            scene: scene.to_owned(),
            phantoms: phantoms.to_owned(),
            amount,
            wrong_shadow_pct: mean(0),
            factor_rms: mean(1),
            rim_px: mean(2),
            residual_real: residuals
                .map(|residuals| rounded(residuals.iter().sum::<f64>() / count)),
        });
    }
    Ok(Some(rows))
}

/// Changes a phantom: moved in the table's plane, turned about its own upright axis.
fn change_phantom(phantom: &mut Object, change: Change) {
    let anchor_from_object = phantom.anchor_from_object;
    phantom.anchor_from_object = match change {
        Change::Moved { by_m } => DAffine3::from_translation(by_m) * anchor_from_object,
        Change::Turned { by_rad } => anchor_from_object * DAffine3::from_rotation_z(by_rad),
        Change::LeftOut => anchor_from_object,
    };
}

/// The layers of the torus's shadow across the box.
fn shoot_box(gpu: &Arc<Gpu>, change: Change) -> Result<Layers> {
    let mut stage = PeersStage::new(vec![(torus(2_500, 0.7), TORUS_M)], &[LAMP_M], SIZE_PX, 4);
    // The box is the last phantom. What the real one casts is in the video wherever the phantom stands.
    if let Change::LeftOut = change {
        stage.scene.phantoms.pop();
    } else {
        let cuboid = stage.scene.phantoms.last_mut().context("a box")?;
        cuboid.casts = true;
        change_phantom(cuboid, change);
    }
    let mut renderer = Renderer::new(Arc::clone(gpu), &stage.scene, stage.intrinsics)?;
    Ok(draw(&mut renderer, &grey_frame(SIZE_PX), &stage.poses(0))?.layers)
}

/// How far a picture's shadow is off, on the pixels that are real in both.
fn box_errors(exact: &Layers, found: &Layers) -> [f64; 3] {
    let (mut real, mut wrong, mut touched, mut rim) = (0_u32, 0_u32, 0_u32, 0_u32);
    let mut squares = 0.0;
    for index in 0..exact.role.len() {
        if exact.role[index] != REAL || found.role[index] != REAL {
            continue;
        }
        real += 1;
        let bits = exact.shadow[0][index] ^ found.shadow[0][index];
        wrong += u32::from(bits & VIRTUAL_HIDES != 0);
        let gains = [exact.gain[index][1], found.gain[index][1]];
        if gains != [1.0; 2] {
            let off = gains[0] - gains[1];
            touched += 1;
            squares += f64::from(off).powi(2);
            rim += u32::from(off.abs() > VISIBLE_GAIN);
        }
    }
    [
        100.0 * f64::from(wrong) / f64::from(real.max(1)),
        (squares / f64::from(touched.max(1))).sqrt(),
        f64::from(rim),
    ]
}

/// The key frames of `lamp` with changed phantoms.
fn draw_lamp(gpu: &Arc<Gpu>, scene: &Scene, shots: &Shots, change: Change) -> Result<Vec<Drawn>> {
    let mut scene = scene.clone();
    let stands = |phantom: &Object| STANDING.contains(&phantom.name.as_str());
    if let Change::LeftOut = change {
        scene.phantoms.retain(|phantom| !stands(phantom));
    }
    for phantom in scene.phantoms.iter_mut().filter(|phantom| stands(phantom)) {
        change_phantom(phantom, change);
    }
    shots.draw(gpu, &scene)
}

/// Real pixels near the outline of what stands on the table: there it is nearer than the table alone.
fn rim(exact: &Layers, bare_table: &Layers, size_px: [u32; 2]) -> Vec<bool> {
    let width = size_px[0] as usize;
    let stands: Vec<u8> = (0..exact.role.len())
        .map(|i| u8::from(exact.role[i] == REAL && exact.depth_m[i] != bare_table.depth_m[i]))
        .collect();
    let outline = edges(&stands, width);
    let near = |i| around(i, RIM_REACH_PX, width, outline.len()).any(|near| outline[near]);
    (0..outline.len())
        .map(|i| exact.role[i] == REAL && near(i))
        .collect()
}

/// Pixels of the rim whose gain is visibly another than with exact phantoms.
fn rim_px(rim: &[bool], found: &Layers, exact: &Layers) -> f64 {
    let differs = |i: &usize| {
        let gains = found.gain[*i].iter().zip(&exact.gain[*i]);
        rim[*i] && gains.into_iter().any(|(a, b)| (a - b).abs() > VISIBLE_GAIN)
    };
    (0..rim.len()).filter(differs).count() as f64
}
