//! The light of recordings, found in their frames from clicks that are off as people's are, against the light that is
//! known to have shone.

use crate::common::random::Random;
use glam::{DAffine3, DVec2, DVec3};
use gnomon::app::authoring::{FoundLight, PicturedThings, ShadowClick};
use gnomon::app::truth::key_frames;
use gnomon::capture::{Frame, load_calibration};
use gnomon::geometry::camera::Intrinsics;
use gnomon::geometry::light_placing::{FarLight, LightFreedom, PosedCamera};
use gnomon::light::{Light, Shape};
use gnomon::scene::Scene;

/// The light that is known, and the surroundings.
struct Known {
    position_m: DVec3,
    intensity: DVec3,
    ambient: DVec3,
}

impl Known {
    fn of(scene: &Scene) -> Self {
        let [
            Light::Point {
                position_m,
                intensity,
                shape: Shape::Point,
            },
        ] = scene.world_lights()[..]
        else {
            panic!("one lamp is expected")
        };
        Self {
            position_m,
            intensity,
            ambient: scene.ambient_radiance,
        }
    }

    /// Vertices whose shadows' tips the camera sees on the table, with those tips.
    fn tips(
        &self,
        things: &PicturedThings,
        sight: &PosedCamera,
        scene: &Scene,
    ) -> Vec<ShadowClick> {
        let light = FarLight {
            center_m: self.position_m - DVec3::Z,
            towards: DVec3::Z,
            inverse_distance: 1.0,
        };
        let table = gnomon::geometry::light_placing::Facet {
            point_m: DVec3::ZERO,
            normal: DVec3::Z,
        };
        let mut tips = Vec::new();
        for name in ["house", "tin"] {
            let Some(phantom) = scene
                .phantoms
                .iter()
                .find(|p| p.name == name && p.anchor == 0)
            else {
                continue;
            };
            for position in &phantom.mesh.positions {
                let vertex_m = phantom
                    .anchor_from_object
                    .transform_point3(position.as_dvec3());
                let Some(tip_m) = light.shadow_of(vertex_m, &table) else {
                    continue;
                };
                let Some(shadow_px) = sight.pixel(tip_m) else {
                    continue;
                };
                let seen = things.surface_at(shadow_px);
                if vertex_m.z > 0.03
                    && seen.is_some_and(|facet| (facet.point_m - tip_m).length() < 1.5e-3)
                {
                    tips.push(ShadowClick {
                        vertex_m,
                        shadow_px,
                    });
                }
            }
        }
        tips
    }
}

struct Judged {
    position_mm: f64,
    intensity_pct: f64,
    ambient_pct: f64,
    found: FoundLight,
}

fn judge(known: &Known, found: FoundLight) -> Judged {
    let Light::Point {
        position_m,
        intensity,
        shape: Shape::Point,
    } = found.light
    else {
        panic!("a lamp is expected")
    };
    let off = |a: DVec3, b: DVec3| 100.0 * (a / b - DVec3::ONE).abs().max_element();
    let strengths = found.strengths.expect("edges of shadows");
    Judged {
        position_mm: 1e3 * position_m.distance(known.position_m),
        intensity_pct: off(intensity, known.intensity),
        ambient_pct: off(strengths.ambient, known.ambient),
        found,
    }
}

/// Finds the light of a frame from some random pairs of tips, each up to `off_px` off, several times.
fn rounds(
    scene: &Scene,
    intrinsics: Intrinsics,
    (frame, poses): &(Frame, Vec<Option<DAffine3>>),
    off_px: f64,
) -> Vec<Judged> {
    let known = Known::of(scene);
    let things = PicturedThings::new(scene, intrinsics, poses).expect("a world that is seen");
    let sight = PosedCamera {
        intrinsics,
        camera_from_world: poses[0].expect("a pose"),
    };
    let tips = known.tips(&things, &sight, scene);
    assert!(tips.len() >= 2, "{} tips", tips.len());
    let mut random = Random::new(u64::from(frame.index));
    let mut judged = Vec::new();
    while judged.len() < 6 {
        let pick = |random: &mut Random| tips[random.below(tips.len())];
        let mut clicks = [pick(&mut random), pick(&mut random), pick(&mut random)];
        if clicks[0].vertex_m.distance(clicks[1].vertex_m) < 0.04 {
            continue;
        }
        for click in &mut clicks {
            click.shadow_px += DVec2::new(
                random.between(-off_px, off_px),
                random.between(-off_px, off_px),
            );
        }
        match things.find_light(frame, &clicks, LightFreedom::Point) {
            Ok(found) => judged.push(judge(&known, found)),
            Err(error) => panic!("frame {} {clicks:?}: {error}", frame.index),
        }
    }
    judged
}

/// What docs/authoring.md promises.
fn assert_near(what: &str, judged: &[Judged]) {
    for Judged {
        position_mm,
        intensity_pct,
        ambient_pct,
        found,
    } in judged
    {
        println!(
            "{what}: {position_mm:.1} mm (clicks ±{:.0} mm), intensity {intensity_pct:.1} %, ambient {ambient_pct:.1} %, {} edges \
             within {:.2} px",
            1e3 * found.click_sigma,
            found.edges,
            found.edge_rms_px,
        );
        assert!(*position_mm < 3.0, "{what}: {position_mm} mm");
        assert!(*intensity_pct < 5.0, "{what}: {intensity_pct} %");
        assert!(*ambient_pct < 9.0, "{what}: {ambient_pct} %");
        assert!(found.edges > 100 && found.edge_rms_px < 0.2, "{found:?}");
    }
}

fn scene(name: &str) -> Scene {
    Scene::load(&crate::common::project_file(&format!("config/{name}.toml")))
        .expect("a demo's scene")
}

#[test]
fn the_lamp_is_found_from_clicks_that_are_off() {
    let scene = scene("lamp");
    let folder = crate::common::project_file("recordings/lamp");
    let intrinsics = load_calibration(&folder.join("camera.toml")).expect("a calibration");
    for key in key_frames(&folder, &scene.anchors).expect("key frames") {
        let judged = rounds(&scene, intrinsics, &key, 1.5);
        assert_near(&format!("lamp {}", key.0.index), &judged);
    }
}

#[test]
#[cfg_attr(not(has_shared), ignore = "needs ../shared/sessions")]
fn the_lamp_of_the_shared_session_is_found() {
    let folder = crate::common::project_file("../shared/sessions/lamp");
    let scene = scene("lamp");
    let intrinsics = load_calibration(&folder.join("session.json")).expect("a calibration");
    for key in key_frames(&folder, &scene.anchors).expect("key frames") {
        let judged = rounds(&scene, intrinsics, &key, 1.5);
        assert_near(&format!("session {}", key.0.index), &judged);
    }
}
