//! A probe's light is conserved: whatever surroundings, however they are turned, places get what the sum over the probe's
//! pixels says.

use std::borrow::Cow;

use glam::{DAffine3, DVec3, Vec3};
use gnomon::geometry::bounds::Bounds;
use gnomon::light::probe::Probe;
use gnomon::light::{Light, irradiance};
use gnomon::scene::{Object, ProbeLightKind, Scene, SceneLight, Technique};
use gnomon::shafts::patches::RoomTriangle;
use gnomon::shafts::placed_probe::PlacedProbe;
use gnomon::shafts::room::{Room, RoomOptions};
use gnomon::shafts::room_transport::RoomTransport;

/// As a scene has them that says nothing.
const OPTIONS: RoomOptions = RoomOptions {
    patches: 1500,
    source_power: 1.0,
    receivers_per_leaf: 8,
    least_part: 0.02,
};

/// A sun of 3 W/m² across its direction on an even background.
fn sun(azimuth_deg: f64, elevation_deg: f64, width_deg: f64) -> Probe {
    const SIZE_PX: [usize; 2] = [1024, 512];
    let grid = Probe::new(SIZE_PX, vec![Vec3::ZERO; SIZE_PX[0] * SIZE_PX[1]]).expect("pixels");
    let direction = |index: usize| {
        let (column, row) = (index % SIZE_PX[0], index / SIZE_PX[0]);
        grid.direction(column as f64 + 0.5, row as f64 + 0.5)
    };
    let (azimuth, elevation) = (azimuth_deg.to_radians(), elevation_deg.to_radians());
    let toward = DVec3::new(
        elevation.cos() * azimuth.cos(),
        elevation.cos() * azimuth.sin(),
        elevation.sin(),
    );
    let pixels = 0..SIZE_PX[0] * SIZE_PX[1];
    let nearest = pixels.clone().max_by(|&a, &b| {
        direction(a)
            .dot(toward)
            .total_cmp(&direction(b).dot(toward))
    });
    let least = (width_deg / 2.0).to_radians().cos();
    let inside = |index: usize| direction(index).dot(toward) > least || Some(index) == nearest;
    let facing: f64 = pixels
        .clone()
        .filter(|&index| inside(index))
        .map(|index| grid.pixel_solid_angle(index / SIZE_PX[0]) * direction(index).dot(toward))
        .sum();
    let radiance = |index: usize| match inside(index) {
        true => 0.15 + 3.0 / facing,
        false => 0.15,
    };
    let pixels = pixels.map(|index| Vec3::splat(radiance(index) as f32));
    Probe::new(SIZE_PX, pixels.collect()).expect("pixels")
}

/// The same probe, turned to the left by so many columns.
fn turned(probe: &Probe, columns: usize) -> Probe {
    let [width, height] = probe.size_px();
    let pixel = |index: usize| {
        let (row, column) = (index / width, index % width);
        probe.pixels()[row * width + (column + width - columns) % width]
    };
    Probe::new([width, height], (0..width * height).map(pixel).collect()).expect("pixels")
}

/// Irradiance that a plane gets from all pixels before it.
fn exact(probe: &Probe, normal: Vec3) -> f64 {
    let [width, _] = probe.size_px();
    let pixels = probe.pixels().iter().enumerate();
    let arriving = |(index, pixel): (usize, &Vec3)| {
        let (row, column) = (index / width, index % width);
        let direction = probe.direction(column as f64 + 0.5, row as f64 + 0.5);
        let cosine = direction.dot(normal.as_dvec3()).max(0.0);
        f64::from(pixel.y) * cosine * probe.pixel_solid_angle(row)
    };
    pixels.map(arriving).sum()
}

/// The light where nothing stands around.
fn from_afar(probe: &Probe) -> RoomTransport {
    from_afar_past(probe, Vec::new())
}

/// The same where something was put in the probe's place after it was taken.
fn from_afar_past(probe: &Probe, things: Vec<RoomTriangle>) -> RoomTransport {
    let (low, high) = (Vec3::splat(-300.0), Vec3::splat(300.0));
    let room = Room {
        triangles: super::shafts::inside_of(low, high, None)
            .into_iter()
            .chain(small_square())
            .chain(things)
            .collect(),
        standing: 0,
        compact: Vec::new(),
        things: vec![Bounds {
            low: DVec3::new(-0.1, -0.1, 0.0),
            high: DVec3::new(0.1, 0.1, 0.1),
        }],
        options: OPTIONS,
        probe: PlacedProbe {
            probe: Cow::Borrowed(probe),
            position_m: DVec3::new(0.0, 0.0, 0.05),
            exposure: 1.0,
            beyond_m: 150.0,
        },
    };
    room.transport()
}

/// A black square below, to be lit, too small to hide anything of the rest.
fn small_square() -> [RoomTriangle; 2] {
    let corner = |x: f32, y: f32| Vec3::new(0.002 * x, 0.002 * y, -0.1);
    [
        [corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0)],
        [corner(-1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)],
    ]
    .map(|corners| RoomTriangle {
        corners,
        albedo: Some(Vec3::ZERO),
        piece: 6,
    })
}

/// Largest error of planes of several orientations over their exact irradiance.
fn largest_error(probe: &Probe) -> f64 {
    let room = from_afar(probe);
    let mut largest = 0.0_f64;
    let mut tell = |found: f32, normal: Vec3| {
        let expected = exact(probe, normal);
        largest = largest.max((f64::from(found) / expected - 1.0).abs());
    };
    for normal in [
        Vec3::Z,
        Vec3::X,
        Vec3::NEG_Y,
        Vec3::new(0.6, -0.64, 0.48),
        Vec3::new(-0.48, 0.6, 0.64),
    ] {
        let found = room.volume.irradiance(Vec3::new(0.01, 0.02, 0.05), normal);
        tell(found.y, normal);
    }
    for (vertex, irradiance) in room.patches.vertices.iter().zip(&room.irradiance) {
        if vertex.position.length() < 1.0 {
            tell(irradiance.y, vertex.normal);
        }
    }
    largest
}

#[test]
fn a_sun_gives_planes_its_light_wherever_it_stands_and_however_wide_it_is() {
    for (azimuth, elevation, width) in [
        (0.0, 35.0, 0.2),
        (47.3, 35.0, 0.5),
        (-131.0, 12.0, 0.5),
        (161.0, 71.0, 2.0),
        (93.7, 20.0, 5.0),
        (-20.0, 50.0, 15.0),
        (75.0, 40.0, 60.0),
    ] {
        let error = largest_error(&sun(azimuth, elevation, width));
        assert!(error < 0.01, "{azimuth} {elevation} {width}: {error:.4}");
    }
}

#[test]
fn surroundings_that_are_bright_on_one_side_give_planes_their_light() {
    // Not bright enough for lights of their own: what few harmonics leave out of a half's edge shows.
    let (width, height) = (512, 256);
    let grid = Probe::new([width, height], vec![Vec3::ZERO; width * height]).expect("pixels");
    let bright = DVec3::new(0.6, 0.48, 0.64);
    let pixel = |index: usize| {
        let (column, row) = (index % width, index / width);
        let cosine = grid
            .direction(column as f64 + 0.5, row as f64 + 0.5)
            .dot(bright);
        Vec3::splat(if cosine > 0.5 { 1.0 } else { 0.05 })
    };
    let probe = Probe::new([width, height], (0..width * height).map(pixel).collect());
    let error = largest_error(&probe.expect("pixels"));
    assert!(error < 0.01, "{error:.4}");
}

#[test]
fn surroundings_of_many_lamps_give_planes_their_light_however_they_are_turned() {
    // Lamps of several sizes, none where a pixel's edge is.
    let lamps = [
        (10.0, 62.0, 1.3),
        (100.0, 33.0, 4.0),
        (-60.0, 25.0, 0.4),
        (-140.0, 48.0, 9.0),
    ];
    let parts: Vec<Probe> = lamps.iter().map(|&(a, e, w)| sun(a, e, w)).collect();
    let pixel = |index: usize| parts.iter().map(|part| part.pixels()[index]).sum();
    let probe = Probe::new([1024, 512], (0..1024 * 512).map(pixel).collect()).expect("pixels");
    for columns in [0, 101, 333, 777] {
        let error = largest_error(&turned(&probe, columns));
        assert!(error < 0.01, "{columns}: {error:.4}");
    }
}

#[test]
#[cfg_attr(not(has_shared), ignore = "needs ../shared/probes")]
fn photographed_surroundings_give_planes_their_light_however_they_are_turned() {
    for name in ["studio_512", "workshop_512", "lobby_512"] {
        let path = crate::common::project_file(&format!("../shared/probes/{name}.hdr"));
        let kind = gnomon::scene::probe_file::ProbeKind::LatitudeLongitude;
        let probe = gnomon::scene::probe_file::read(&path, kind)
            .expect("a probe")
            .probe;
        for columns in [0, 67, 311] {
            let error = largest_error(&turned(&probe, columns));
            assert!(error < 0.01, "{name} {columns}: {error:.4}");
        }
    }
}

/// The room that ships, under other surroundings from afar.
fn scene_under(probe: Probe) -> Scene {
    let mut scene = Scene::load(&crate::common::project_file("config/room.toml")).expect("a scene");
    let lit_by = scene.probe.as_mut().expect("a probe");
    lit_by.probe = probe;
    lit_by.is_far = true;
    lit_by.exposure = 1.0;
    scene
}

/// Irradiance of a plane that sees all lights.
fn from_lights(lights: &[SceneLight], normal: Vec3) -> f64 {
    let given = |light: &SceneLight| irradiance(&light.light, DVec3::ZERO, normal.as_dvec3()).y;
    lights.iter().map(given).sum()
}

#[test]
fn light_does_not_depend_on_where_compact_ends() {
    let mut scene = scene_under(sun(-131.0, 40.0, 2.0));
    let mut counts = Vec::new();
    for compact_penumbra_px in [0.0, 1.0, 8.0, 100.0] {
        scene.shadows.compact_penumbra_px = compact_penumbra_px;
        let probe = scene.probe.as_ref().expect("a probe");
        let split = scene.split_light(probe);
        counts.push(split.compact.len());
        for normal in [Vec3::Z, Vec3::new(-0.6, -0.48, 0.64)] {
            let both = exact(&split.rest, normal) + from_lights(&split.compact, normal);
            let whole = exact(&probe.probe, normal);
            assert!(
                (both / whole - 1.0).abs() < 1e-3,
                "{normal}: {both} {whole}"
            );
        }
    }
    assert_eq!(counts, [0, 0, 1, 1]);
}

#[test]
fn a_lamp_that_the_scene_and_the_probe_know_shines_once() {
    let mut scene = scene_under(sun(-131.0, 40.0, 1.0));
    let to_sun = |azimuth_deg: f64, elevation_deg: f64| {
        let (azimuth, elevation) = (azimuth_deg.to_radians(), elevation_deg.to_radians());
        let (sine, cosine) = azimuth.sin_cos();
        DVec3::new(cosine, sine, 0.0) * elevation.cos() + DVec3::Z * elevation.sin()
    };
    let directional = |toward: DVec3, power: f64| Light::Directional {
        direction: -toward,
        irradiance: DVec3::splat(power),
        angle_rad: 0.0,
    };
    // A degree beside, and not quite as strong: the same.
    scene.lights = vec![directional(to_sun(-131.0, 41.0), 2.6).into()];
    let probe = scene.probe.as_ref().expect("a probe");
    let split = scene.split_light(probe);
    assert_eq!(split.compact, scene.lights);
    let ProbeLightKind::SameAs { light, ratio, .. } = split.found[0].kind else {
        panic!("{:?}", split.found);
    };
    assert_eq!(light, 0);
    assert!((ratio - 3.0 / 2.6).abs() < 0.01, "{ratio}");
    let left = exact(&split.rest, Vec3::Z) / (0.15 * std::f64::consts::PI);
    assert!((left - 1.0).abs() < 0.01, "{left}");
    // Elsewhere, or far weaker: another one.
    for other in [
        directional(to_sun(-100.0, 40.0), 2.6),
        directional(to_sun(-131.0, 40.0), 0.1),
    ] {
        scene.lights = vec![other.into()];
        let split = scene.split_light(scene.probe.as_ref().expect("a probe"));
        assert_eq!(split.compact.len(), 2);
        assert_eq!(split.found[0].kind, ProbeLightKind::Compact);
    }
    // With shafts alone the probe has all light.
    scene.shadows.technique = Technique::Shafts;
    let probe = scene.probe.as_ref().expect("a probe");
    let split = scene.split_light(probe);
    assert!(split.compact.is_empty() && *split.rest == probe.probe);
}

/// Phantoms stand where the probe is taken to have been: without a room what it saw was farther away than they are.
#[test]
fn what_stands_about_the_probe_hides_nothing_of_what_it_saw() {
    let probe = sun(30.0, 40.0, 2.0);
    let toward = Vec3::new(0.663, 0.383, 0.643);
    let (across, up) = toward.any_orthonormal_pair();
    let corner =
        |x: f32, y: f32| Vec3::new(0.0, 0.0, 0.05) + toward * 0.03 + (across * x + up * y) * 0.02;
    let card = [
        [corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0)],
        [corner(-1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)],
    ];
    // From both sides.
    let turned = card.map(|[a, b, c]| [a, c, b]);
    let things = card.into_iter().chain(turned).map(|corners| RoomTriangle {
        corners,
        albedo: Some(Vec3::ZERO),
        piece: 7,
    });
    let (with, without) = (from_afar_past(&probe, things.collect()), from_afar(&probe));
    // Off to the side, where the card hides next to nothing of the sky and nothing of the sun.
    let aside = Vec3::new(-0.08, 0.08, 0.05);
    let [with, without] = [&with, &without].map(|room| room.volume.irradiance(aside, Vec3::Z).y);
    assert!((with / without - 1.0).abs() < 0.03, "{with} {without}");
}

#[test]
fn a_light_is_compact_by_how_far_things_are_above_what_they_shade() {
    let card = |height_m: f64| {
        let card = crate::common::shapes::rectangle([-0.1, -0.1], [0.1, 0.1]);
        let card = crate::common::flat_mesh(card.positions, card.triangles);
        let place = DAffine3::from_translation(DVec3::Z * height_m);
        crate::common::object("card", card, DVec3::splat(0.5), place)
    };
    let kind_of = |scene: &Scene| {
        let split = scene.split_light(scene.probe.as_ref().expect("a probe"));
        split.found[0].kind
    };
    let mut scene = scene_under(sun(-131.0, 40.0, 20.0));
    scene.phantoms.retain(|thing| !thing.casts);
    // What moves with a marker counts like what stands.
    for anchor in [0, 1] {
        for (height_m, kind) in [
            (0.001, ProbeLightKind::Compact),
            (0.12, ProbeLightKind::Broad),
        ] {
            let card = card(height_m);
            scene.virtuals = vec![Object { anchor, ..card }];
            assert_eq!(kind_of(&scene), kind, "{anchor} {height_m}");
        }
    }
    // From below a table nothing comes with outlines.
    let mut scene = scene_under(sun(-131.0, -20.0, 1.0));
    assert_eq!(kind_of(&scene), ProbeLightKind::Broad);
    scene.phantoms.retain(|thing| thing.name != "table");
    assert_eq!(kind_of(&scene), ProbeLightKind::Compact);
}

#[test]
fn large_pixels_are_cut_and_their_light_stays() {
    let mut pixels = vec![Vec3::splat(0.2); 8 * 4];
    pixels[8 + 3] = Vec3::splat(40.0);
    let small = Probe::new([8, 4], pixels).expect("pixels");
    let cut = small.at_least([128, 64]);
    assert_eq!(cut.size_px(), [128, 64]);
    let mut scene = scene_under(small.clone());
    scene.shadows.compact_penumbra_px = 0.0;
    let rest = scene
        .split_light(scene.probe.as_ref().expect("a probe"))
        .rest;
    assert_eq!(*rest, *cut);
    // The sum over each pixel's own sphere is kept to the last digits.
    let power = |probe: &Probe| {
        let [width, _] = probe.size_px();
        let pixels = probe.pixels().iter().enumerate();
        let light =
            pixels.map(|(k, pixel)| f64::from(pixel.y) * probe.pixel_solid_angle(k / width));
        light.sum::<f64>()
    };
    assert!((power(&cut) / power(&small) - 1.0).abs() < 1e-6);
    assert_eq!(cut.radiance(small.direction(3.5, 1.5)), Vec3::splat(40.0));
    // What is fine enough is not copied.
    assert!(matches!(cut.at_least([100, 64]), Cow::Borrowed(_)));
}
