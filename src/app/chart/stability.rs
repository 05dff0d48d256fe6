//! Where shadow methods fail: wrong pixels of gnomon, measured, beside those that were measured of its peers.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::{Context as _, Result};
use serde::{Deserialize, Serialize};

use super::family::Chart;
use super::figure::{Axis, Figure, FigurePanel, Point, Rule, Scale, Series};
use super::known_scene::{KnownScene, world_of};
use super::lab::Lab;
use super::measured::{from_csv, rounded};
use crate::app::truth::FACES_AWAY;
use crate::render::{Gpu, REAL, Renderer, Shown, VIRTUAL_HIDES};

/// The scenes, their masks, and the peers' figures.
const FOLDER: &str = "tests/stability";
/// Edge pixels alone stay below, percent.
const BAR_PCT: f64 = 0.02;
/// Where the axis begins, percent; less than a pixel of the picture.
const LEAST_SHOWN_PCT: f64 = 0.0002;
const OURS: &str = "gnomon";
/// As `OURS`, judged by what judged the peers.
const OURS_BY_MASK: &str = "gnomon, by the peers' masks";

/// The chart.
pub struct Stability;

/// A program in one of the situations.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct StabilityRow {
    row: String,
    program: String,
    least_wrong_pct: Option<f64>,
    most_wrong_pct: Option<f64>,
    note: String,
}

/// A line of the peers' figures.
#[derive(Debug, Deserialize)]
struct Peer {
    row: String,
    scenes: String,
    program: String,
    least_wrong_pct: Option<f64>,
    most_wrong_pct: Option<f64>,
    note: String,
}

fn peers() -> Result<Vec<Peer>> {
    let path = Path::new(FOLDER).join("peers.csv");
    let text = std::fs::read_to_string(&path).with_context(|| path.display().to_string())?;
    from_csv(&text, true).with_context(|| path.display().to_string())
}

impl Chart for Stability {
    const NAME: &'static str = "stability";
    const FAMILY: &'static str = "stability";
    const SHOWS: &'static str = "Where shadow volumes are known to fail: real pixels that face the light and are wrongly in \
        or out of a virtual shadow, against rays in double precision. The peers' figures were measured once with OGRE \
        1.12 and Irrlicht 1.8 against the masks of `tests/stability` (`peers.csv`), the worst where there are several. \
        Those masks' rays start 0.1 mm above the surface, which shows near the camera and under low light: gnomon is also \
        held against them.";
    type Row = StabilityRow;

    fn inputs(&self, _: &Lab<'_>) -> Result<Vec<PathBuf>> {
        Ok(vec![PathBuf::from(FOLDER)])
    }

    fn units(&self, _: &Lab<'_>) -> Result<Vec<String>> {
        let mut rows: Vec<String> = peers()?.into_iter().map(|peer| peer.row).collect();
        rows.dedup();
        Ok(rows)
    }

    fn measure(&self, lab: &Lab<'_>, unit: &str) -> Result<Option<Vec<StabilityRow>>> {
        if lab.is_stopped() {
            return Ok(None);
        }
        let peers = peers()?.into_iter().filter(|peer| peer.row == unit);
        let peers: Vec<Peer> = peers.collect();
        let scenes = peers.first().map_or("", |peer| &peer.scenes);
        let mut wrong = Vec::new();
        for name in scenes.split_whitespace() {
            wrong.push(wrong_pct(&lab.gpu()?, name)?);
        }
        let ours = |program: &str, of: fn(&Wrong) -> f64| {
            let all = || wrong.iter().map(of);
            StabilityRow {
                row: unit.to_owned(),
                program: program.to_owned(),
                least_wrong_pct: all().reduce(f64::min).map(rounded),
                most_wrong_pct: all().reduce(f64::max).map(rounded),
                note: String::new(),
            }
        };
        let ours = [
            ours(OURS, |wrong| wrong.exact_pct),
            ours(OURS_BY_MASK, |wrong| wrong.by_mask_pct),
        ];
        let theirs = peers.into_iter().filter(|peer| !peer.program.is_empty());
        let theirs = theirs.map(|peer| StabilityRow {
            row: peer.row,
            program: peer.program,
            least_wrong_pct: peer.least_wrong_pct,
            most_wrong_pct: peer.most_wrong_pct,
            note: peer.note,
        });
        Ok(Some(ours.into_iter().chain(theirs).collect()))
    }

    fn figure(&self, rows: &[StabilityRow]) -> Figure {
        let mut names: Vec<String> = rows.iter().map(|row| row.row.clone()).collect();
        names.dedup();
        let programs = [
            OURS,
            OURS_BY_MASK,
            "OGRE",
            "Irrlicht depth-fail",
            "Irrlicht depth-pass",
        ];
        // gnomon in the middle of its row, the peers beside it, so that equal ones are seen apart.
        let offsets = [-0.1, 0.1, -0.3, 0.28, 0.42];
        let looks = [2, 4, 0, 1, 3];
        let series = programs.into_iter().zip(offsets).zip(looks);
        let series = series.map(|((program, offset), look)| Series {
            name: program.to_owned(),
            look,
            joined: false,
            points: rows
                .iter()
                .filter(|row| row.program == program)
                .filter_map(|row| {
                    let y = names.iter().position(|name| *name == row.row)? as f64 + offset;
                    // All of the shadow is wrong where nobody counted the pixels.
                    let x = row.most_wrong_pct.unwrap_or(100.0);
                    Some(Point::named(x, y, &row.note))
                })
                .collect(),
        });
        Figure {
            title: "Where shadow volumes fail".to_owned(),
            reading: "Wrong pixels in the worst case of each row; left of the dashed line only edges are. Both signs of gnomon are one picture.".to_owned(),
            columns: 1,
            panel_size: [1000.0, 90.0 + 44.0 * names.len() as f64],
            panels: vec![FigurePanel {
                title: "wrong pixels, percent of the real ones that face the light".to_owned(),
                x: Axis {
                    spans: vec![LEAST_SHOWN_PCT, 100.0],
                    ..Axis::log("wrong pixels, %; none stands at the left end")
                },
                y: Axis {
                    scale: Scale::Names(names.clone()),
                    ..Axis::default()
                },
                series: series.collect(),
                rules: vec![Rule {
                    upright: true,
                    at: BAR_PCT,
                    label: format!("{BAR_PCT} %"),
                }],
                front: Vec::new(),
            }],
        }
    }
}

/// Pixels whose bit *a virtual thing hides the light* is wrong, percent of the real ones that face the light.
struct Wrong {
    /// By rays from the very surface.
    exact_pct: f64,
    /// By the mask that judged the peers.
    by_mask_pct: f64,
}

fn wrong_pct(gpu: &Arc<Gpu>, name: &str) -> Result<Wrong> {
    const REAL_ID: u8 = 1;
    let known = KnownScene::read(Path::new(FOLDER), name)?;
    let scene = known.to_scene()?;
    let mut renderer = Renderer::new(Arc::clone(gpu), &scene, known.intrinsics)?;
    renderer.draw(&[Some(known.camera_from_world)], Shown::Composite);
    let found = &renderer.layers()?.shadow[0];
    let exact = world_of(&scene).cast(&known.lights, &known.view(), 0.0);
    let share_pct = |truth: &dyn Fn(usize) -> Option<u8>| {
        let (mut facing, mut wrong) = (0_u32, 0_u32);
        for (index, found) in found.iter().enumerate() {
            if let Some(bits) = truth(index).filter(|bits| bits & FACES_AWAY == 0) {
                facing += 1;
                wrong += u32::from((bits ^ found) & VIRTUAL_HIDES != 0);
            }
        }
        100.0 * f64::from(wrong) / f64::from(facing.max(1))
    };
    Ok(Wrong {
        exact_pct: share_pct(&|index| (exact.role(index) == REAL).then(|| exact.bits[0][index])),
        by_mask_pct: share_pct(&|index| {
            let (id, bits) = (known.exact[index] & 3, known.exact[index] >> 2);
            (id == REAL_ID).then_some(bits)
        }),
    })
}
