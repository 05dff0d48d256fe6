//! What an environment cannot show, beside the technique that can and the truth.

use std::path::Path;
use std::sync::Arc;

use anyhow::Result;
use glam::{DMat4, DQuat, DVec3};

use super::AnyChart;
use super::lab::Lab;
use super::sheet::{ENLARGED, Sheet, SheetPart, changed_part};
use super::shots::Shots;
use crate::app::files::picture_files::write_small_rgb_png;
use crate::app::stages::progress::Progress;
use crate::app::truth::LinearPicture;
use crate::geometry::mesh::{HeldCorner, HeldNormal, RigPoint};
use crate::geometry::rig::posed::MeshPoser;
use crate::geometry::rig::surface::{Holding, RigSurface};
use crate::geometry::rig::{Clip, NodeParts, NodeTree, Rig, RigNode};
use crate::scene::{Animation, EnvironmentMethod, Object, Scene, Technique};

const NAME: &str = "environment-pictures";

/// How a scene is drawn.
type Way = (&'static str, fn(&mut Scene));

/// A recording, and its scene drawn in a way that fails and in one that does not.
struct Failure {
    recording: &'static str,
    fails: Way,
    holds: Way,
}

const FAILURES: [Failure; 4] = [
    Failure {
        recording: "room",
        fails: ("light that is near: environment", |scene| {
            scene.shadows.technique = Technique::Environment;
        }),
        holds: ("shafts", |scene| {
            scene.shadows.technique = Technique::Shafts;
        }),
    },
    Failure {
        recording: "sky",
        fails: ("large touches small: maps", |scene| {
            scene.shadows.environment.method = EnvironmentMethod::Maps;
        }),
        holds: ("rays", |scene| {
            scene.shadows.environment.method = EnvironmentMethod::Rays;
        }),
    },
    Failure {
        recording: "sky",
        fails: ("a sun that is broad: rays alone", |scene| {
            scene.shadows.compact_penumbra_px = 0.0;
        }),
        holds: ("its sun by volumes", |_| {}),
    },
    Failure {
        recording: "sky",
        fails: ("things that may deform: fewer rays", |scene| {
            scene.virtuals.iter_mut().for_each(play_nothing);
        }),
        holds: ("the same, rigid", |_| {}),
    },
];

/// Makes a thing one that plays an animation in which nothing moves: all that is worked out anew for what deforms is.
fn play_nothing(thing: &mut Object) {
    let mesh = Arc::make_mut(&mut thing.mesh);
    // Each corner of a triangle is a vertex of the rig, with its own normal.
    let corners = || mesh.triangles.iter().flatten();
    let normals = mesh.corner_normals.as_flattened();
    let surface = RigSurface {
        positions: corners()
            .map(|&vertex| mesh.positions[vertex as usize].as_dvec3())
            .collect(),
        normals: normals
            .iter()
            .map(|normal| Some(normal.as_dvec3()))
            .collect(),
        targets: Vec::new(),
        node: 0,
        holding: Holding::Node,
    };
    let root = RigNode {
        parent: None,
        parent_from_node: DMat4::IDENTITY,
        parts: NodeParts {
            translation: DVec3::ZERO,
            rotation: DQuat::IDENTITY,
            scale: DVec3::ONE,
        },
        weights: Vec::new(),
    };
    let Ok(tree) = NodeTree::new(vec![root]) else {
        return;
    };
    let held = |triangle: usize| {
        [0, 1, 2].map(|corner| HeldCorner {
            point: RigPoint::at((3 * triangle + corner) as u32),
            normal: HeldNormal::OfRig,
        })
    };
    mesh.held = (0..mesh.triangles.len()).map(held).collect();
    let rig = Rig {
        tree,
        surfaces: vec![surface],
    };
    let still = Clip {
        channels: Vec::new(),
        duration_s: 0.0,
    };
    thing.animation = Some(Animation {
        number: 0,
        speed: 1.0,
        loops: true,
        poser: Arc::new(MeshPoser::new((rig, still), mesh, DMat4::IDENTITY, 0.0)),
    });
}

/// The pictures.
pub struct EnvironmentPictures;

impl AnyChart for EnvironmentPictures {
    fn name(&self) -> &'static str {
        NAME
    }

    fn family(&self) -> &'static str {
        "environment"
    }

    fn shows(&self) -> &'static str {
        "What an environment cannot show, beside the technique that can and the path-traced truth: the middle key frame of recordings, \
         the part that the virtual things change, enlarged twice."
    }

    fn unit_count(&self, _lab: &Lab<'_>) -> Result<usize> {
        Ok(FAILURES.len())
    }

    fn make(&self, lab: &Lab<'_>, out: &Path, progress: &Progress) -> Result<bool> {
        let mut rows = Vec::new();
        for failure in &FAILURES {
            progress.tell(&format!("{NAME}: {}", failure.fails.0));
            let recording = lab.recording(failure.recording)?;
            let scene = recording.load_scene()?;
            let shots = Shots::middle_of(&recording, &scene)?;
            let width = shots.size_px()[0] as usize;
            let mut cells = Vec::new();
            for (name, change) in [failure.fails, failure.holds] {
                if lab.is_stopped() {
                    return Ok(false);
                }
                let mut scene = scene.clone();
                change(&mut scene);
                let drawn = shots.draw(&lab.gpu()?, &scene)?;
                for (shot, drawn) in shots.shots.iter().zip(&drawn) {
                    let change = shot.truth.with.minus(&shot.truth.without);
                    let picture = LinearPicture::from_rgba(width, &drawn.out);
                    let cell = |part: SheetPart| part.cut(name.to_owned(), &picture, |it| it);
                    cells.extend(changed_part(&change).map(cell));
                }
            }
            for shot in &shots.shots {
                let change = shot.truth.with.minus(&shot.truth.without);
                let truth = changed_part(&change);
                cells.extend(
                    truth.map(|part| part.cut("truth".to_owned(), &shot.truth.with, |it| it)),
                );
            }
            rows.push(cells);
            progress.advance();
        }
        let (size_px, rgba) = Sheet {
            title: "What an environment cannot show",
            reading: "Left the failure, in the middle what answers it, right the path-traced truth.",
            enlarged: ENLARGED,
            rows,
        }
        .paint()?;
        write_small_rgb_png(&out.join(format!("{NAME}.png")), size_px, &rgba)?;
        Ok(true)
    }
}
