//! What `gnomon check` says of a room that shafts take their light from.

use crate::app::precomputed;
use crate::app::stopwatch::Stopwatch;
use crate::app::talk::counted;
use crate::scene::{
    EnvironmentMethod, ProbeLight, ProbeLightKind, ProbeScene, Scene, ShadowTechnique,
};

/// What stands out of the probe, and what it is taken for.
fn compact_lines(scene: &Scene, probe: &ProbeScene) -> Vec<(&'static str, String)> {
    if !scene.chosen_technique().0.has_compact_and_broad() {
        return Vec::new();
    }
    let told = |found: ProbeLight| {
        let azimuth = found.direction.y.atan2(found.direction.x).to_degrees();
        let elevation = found.direction.z.clamp(-1.0, 1.0).asin().to_degrees();
        let seen = format!(
            "azimuth {azimuth:.1}, elevation {elevation:.1}, {:.1} degrees wide, {:.1} % of the power",
            found.width_rad.to_degrees(),
            100.0 * found.share,
        );
        let edges = format!("edges of {:.1} px", found.penumbra_px);
        match found.kind {
            ProbeLightKind::Compact => ("compact", format!("{seen}: {edges}, drawn with outlines")),
            ProbeLightKind::Broad => (
                "broad",
                format!("{seen}: {edges}, a part of the broad light"),
            ),
            ProbeLightKind::SameAs {
                light,
                beside_rad,
                ratio,
            } => (
                "same lamp",
                format!(
                    "{seen}: taken for light {light}, {:.1} degrees beside it and {ratio:.2} times as strong; its pixels are \
                     taken out",
                    beside_rad.to_degrees()
                ),
            ),
        }
    };
    let found = scene.split_light(probe).found.into_iter();
    found.map(told).collect()
}

/// Labels and what stands behind them. Works the room out where that has not been done yet.
pub fn room_lines(scene: &Scene, probe: &ProbeScene) -> Vec<(&'static str, String)> {
    let [width, height] = probe.probe.size_px();
    let room = scene.room(probe);
    let mut lines = vec![
        (
            "probe",
            format!(
                "{}  {width} x {height}, exposure {}",
                probe.image.display(),
                probe.exposure
            ),
        ),
        (
            "room",
            format!(
                "{}  {} triangles with the table and the phantoms",
                match probe.is_far {
                    true => "none, light from afar".to_owned(),
                    false => counted(probe.room.len(), "part"),
                },
                room.triangles.len()
            ),
        ),
    ];
    let technique = scene.chosen_technique().0;
    lines.extend(compact_lines(scene, probe));
    if technique == ShadowTechnique::Environment {
        let settings = scene.shadows.environment;
        let method = match settings.method {
            EnvironmentMethod::Rays => {
                "on real surfaces by rays, on virtual ones as soft as things are far"
            }
            EnvironmentMethod::Penumbrae => "as soft at each place as things are far from it",
            EnvironmentMethod::Maps => "as soft over a whole thing as its middle is far",
        };
        let told = format!(
            "{}, maps of {} px: shadows {method}",
            counted(settings.regions as usize, "region"),
            settings.map_px
        );
        lines.push(("environment", told));
    }
    if !technique.has_shafts() {
        return lines;
    }
    let (ready, took_ms) = Stopwatch::time(|| precomputed::ready_room(&room));
    let transport = &ready.transport;
    lines.push((
        "patches",
        format!(
            "{}  {} corners, {} of them send light",
            transport.patches.patches.len(),
            transport.patches.vertices.len(),
            transport.sources.patches.len()
        ),
    ));
    lines.push((
        "shafts",
        format!(
            "{} leaves  {:.1} MB, {}",
            transport.hierarchy.leaf_count(),
            transport.hierarchy.bytes() as f64 / 1e6,
            match ready.read_from {
                Some(path) => format!("kept in {}", path.display()),
                None => format!("worked out in {:.1} s", took_ms / 1e3),
            }
        ),
    ));
    let settings = &scene.shadows.shafts;
    let count = settings.sources.map_or("all".to_owned(), |n| n.to_string());
    lines.push((
        "sources",
        format!(
            "{count} at most cast a shadow, seen in {} px",
            settings.map_px
        ),
    ));
    lines
}
