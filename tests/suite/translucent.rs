//! What lets light through, and what a mask leaves, held against closed forms: sheets under suns above a table that nothing else
//! lights.

use std::sync::Arc;

use glam::{DAffine3, DVec2, DVec3, Vec3};
use gnomon::geometry::camera::{Distortion, Intrinsics};
use gnomon::geometry::mesh::CornerLook;
use gnomon::light::material::Coverage;
use gnomon::render::{Shown, VIRTUAL};
use gnomon::scene::{Object, Scene};

use crate::common::{Picture, Stage, linear_of_level, look_at, project_file};
use crate::environment::{black_box, under_sky};

const CAMERA: Intrinsics = Intrinsics {
    size_px: [320, 240],
    focal_px: DVec2::splat(360.0),
    center_px: DVec2::new(159.5, 119.5),
    distortion: Distortion::NONE,
};
const EYE: DVec3 = DVec3::new(0.05, -0.45, 0.45);

/// A sheet that faces up: its middle, its half sides, what it reflects and how opaque it is.
#[derive(Clone, Copy)]
struct Sheet {
    middle: DVec3,
    half: DVec2,
    albedo: f64,
    opacity: f64,
    /// A disc, of its half side as the radius.
    is_round: bool,
    /// Clear at its left side and as opaque as it is said to be at its right one.
    fades: bool,
}

impl Sheet {
    /// At a place on it.
    fn opacity_at(&self, place: DVec3) -> f64 {
        let part = 0.5 + 0.5 * (place.x - self.middle.x) / self.half.x;
        self.opacity * if self.fades { part } else { 1.0 }
    }
}

/// Whither its light goes, and the irradiance that it gives the table.
#[derive(Clone, Copy)]
struct Sun {
    direction: DVec3,
    irradiance: f64,
}

const LOW: Sheet = Sheet {
    middle: DVec3::new(-0.05, 0.05, 0.06),
    half: DVec2::new(0.06, 0.04),
    albedo: 0.8,
    opacity: 0.5,
    is_round: false,
    fades: false,
};
/// Before the other as the camera sees them.
const HIGH: Sheet = Sheet {
    middle: DVec3::new(0.0, -0.05, 0.13),
    half: DVec2::new(0.04, 0.05),
    albedo: 0.2,
    opacity: 0.3,
    is_round: false,
    fades: false,
};
const SUNS: [Sun; 2] = [
    Sun {
        direction: DVec3::new(0.6, 0.0, -0.8),
        irradiance: 1.5,
    },
    Sun {
        direction: DVec3::new(-0.28, 0.0, -0.96),
        irradiance: 0.5,
    },
];

/// What is expected is the suns' light alone, and sheets reflect some of it.
const NOTHING_REFLECTED: &str = "ambient_samples = 0\n";

fn scene(sheets: &[Sheet], suns: &[Sun], keys: &str) -> Scene {
    let mut text = format!(
        "[camera]\nsource = \"webcam:0\"\n[[board]]\nname = \"table\"\n\
         markers = [{{ id = 0, size_m = 0.045, center_m = [0, 0] }}]\n[table]\nrect_m = [-1, -1, 1, 1]\n{keys}"
    );
    for (number, sheet) in sheets.iter().enumerate() {
        let [x, y] = (2.0 * sheet.half).to_array();
        text += &format!(
            "[[virtual]]\nname = \"sheet {number}\"\nrect_m = [{x}, {y}]\nposition_m = {:?}\nmaterial = {{ albedo = {} }}\n",
            sheet.middle.to_array(),
            sheet.albedo
        );
    }
    for Sun {
        direction,
        irradiance,
    } in suns
    {
        text += &format!(
            "[[light]]\nkind = \"directional\"\ndirection = {:?}\nirradiance = {}\n",
            direction.to_array(),
            irradiance / -direction.z
        );
    }
    let mut scene = Scene::parse(&project_file("config/sheets.toml"), &text).expect("a scene");
    for (thing, sheet) in scene.virtuals.iter_mut().zip(sheets) {
        thing.materials[0].coverage = Coverage::Blend;
        thing.materials[0].opacity = sheet.opacity;
        if sheet.fades {
            let mut mesh = (*thing.mesh).clone();
            let look = |place: &Vec3| CornerLook {
                color: Vec3::ONE.extend(0.5 + 0.5 * place.x / sheet.half.x as f32),
                ..CornerLook::default()
            };
            mesh.looks = mesh.positions.iter().map(look).collect();
            mesh.corner_looks = mesh.triangles.clone();
            thing.mesh = Arc::new(mesh);
        }
    }
    scene
}

/// Where a ray meets a sheet.
fn hit(sheet: &Sheet, from: DVec3, direction: DVec3) -> Option<DVec3> {
    let place = from + direction * ((sheet.middle.z - from.z) / direction.z);
    let off = (place - sheet.middle).truncate().abs();
    let is_within = match sheet.is_round {
        true => off.length() <= sheet.half.x,
        false => off.cmple(sheet.half).all(),
    };
    (is_within && (place - from).dot(direction) > 1e-9).then_some(place)
}

/// Part of the suns' light that sheets let through to a place.
fn arriving(sheets: &[Sheet], suns: &[Sun], place: DVec3) -> f64 {
    let of_sun = |sun: &Sun| {
        let passing = sheets.iter().map(|sheet| {
            let met = hit(sheet, place, -sun.direction);
            1.0 - met.map_or(0.0, |met| sheet.opacity_at(met))
        });
        sun.irradiance * passing.product::<f64>()
    };
    suns.iter().map(of_sun).sum()
}

/// The linear light of a place in the picture over a white video; `None` where a sheet lies in another's shadow.
fn expected(sheets: &[Sheet], suns: &[Sun], direction: DVec3) -> Option<f64> {
    let table = EYE + direction * (-EYE.z / direction.z);
    let whole: f64 = suns.iter().map(|sun| sun.irradiance).sum();
    let mut light = arriving(sheets, suns, table) / whole;
    // From below.
    for sheet in sheets {
        if let Some(place) = hit(sheet, EYE, direction) {
            let arrives = arriving(sheets, suns, place);
            if arrives < whole {
                return None;
            }
            let own = sheet.albedo / std::f64::consts::PI * whole;
            let opacity = sheet.opacity_at(place);
            light = opacity * own + (1.0 - opacity) * light;
        }
    }
    Some(light)
}

/// Pixels that are off by more than two levels, of those on no edge, and how many these are.
fn wrong(picture: &Picture, sheets: &[Sheet], suns: &[Sun]) -> (usize, usize) {
    let world_from_camera = look_at(EYE, DVec3::ZERO).inverse();
    let [width, height] = CAMERA.size_px;
    let at = |x: f64, y: f64| {
        let in_camera = ((DVec2::new(x, y) - CAMERA.center_px) / CAMERA.focal_px).extend(1.0);
        expected(sheets, suns, world_from_camera.transform_vector3(in_camera))
    };
    let (mut wrong, mut judged) = (0, 0);
    for index in 0..width * height {
        let (x, y) = (f64::from(index % width), f64::from(index / width));
        let Some(light) = at(x, y) else { continue };
        let around = [(-1.5, -1.5), (1.5, -1.5), (-1.5, 1.5), (1.5, 1.5)];
        // (What fades does so by less from pixel to pixel.)
        let most = if sheets.iter().any(|sheet| sheet.fades) {
            0.02
        } else {
            1e-9
        };
        let same =
            |(dx, dy): &(f64, f64)| at(x + dx, y + dy).is_some_and(|it| (it - light).abs() < most);
        if !around.iter().all(same) {
            continue;
        }
        judged += 1;
        let found = picture.pixel(index as usize)[1];
        let [low, high] = [-2.0, 2.0].map(|off| linear_of_level(f64::from(found) + off));
        wrong += usize::from(light < low || light > high.max(1.0 * f64::from(found == 255)));
    }
    (wrong, judged)
}

fn hold(name: &str, sheets: &[Sheet], suns: &[Sun], keys: &str) {
    let scene = scene(sheets, suns, &format!("{keys}{NOTHING_REFLECTED}"));
    let mut renderer = Stage::of_scene(scene).renderer(CAMERA);
    renderer.draw(&[Some(look_at(EYE, DVec3::ZERO))], Shown::Composite);
    let picture = Picture::new(renderer.read_picture().expect("a picture"));
    let (wrong, judged) = wrong(&picture, sheets, suns);
    println!("{name}: {wrong} of {judged} pixels are off");
    assert!(judged > 60_000, "{name}: {judged} pixels judged");
    assert!(wrong == 0, "{name}: {wrong} of {judged} pixels are off");
    // Layers tell of what is opaque, and leave the picture.
    let layers = renderer.layers().expect("layers");
    assert!(!layers.role.contains(&VIRTUAL), "{name}");
    let after = Picture::new(renderer.read_picture().expect("a picture"));
    assert!(
        after.rgba == picture.rgba,
        "{name}: reading layers changes it"
    );
}

#[test]
fn what_is_half_transparent_is_half_seen_and_throws_half_a_shadow() {
    let one_sample = "[shadows]\nsamples = 1\n";
    hold("direct", &[LOW], &SUNS[..1], one_sample);
    hold("accumulated", &[LOW], &SUNS, one_sample);
    hold(
        "four samples",
        &[LOW],
        &SUNS[..1],
        "[shadows]\nsamples = 4\n",
    );
    hold("two sheets", &[LOW, HIGH], &SUNS[..1], one_sample);
    hold(
        "two sheets, two suns",
        &[LOW, HIGH],
        &SUNS,
        "[shadows]\nsamples = 4\n",
    );
}

/// Its shadow is as deep everywhere as it is opaque where the sun passes it.
#[test]
fn what_fades_throws_a_shadow_that_fades() {
    let fading = Sheet {
        opacity: 0.9,
        fades: true,
        ..LOW
    };
    hold(
        "one sample",
        &[fading],
        &SUNS[..1],
        "[shadows]\nsamples = 1\n",
    );
    hold(
        "two sheets",
        &[fading, HIGH],
        &SUNS[..1],
        "[shadows]\nsamples = 4\n",
    );
}

/// Light from afar is known for the frame without a layer and with it, and a frame does not depend on those before it.
#[test]
fn under_a_sky_a_still_frame_with_a_layer_stays_as_it_is() {
    let (low, high) = ([-0.03, -0.03, 0.0], [0.03, 0.03, 0.08]);
    let solid = black_box("box", low, high, DAffine3::IDENTITY);
    let mut scene = under_sky(0, Vec::new(), vec![solid, sheet_of_glass()]);
    scene.shadows.samples = 1;
    let mut renderer = Stage::of_scene(scene).renderer(CAMERA);
    let mut shoot = |eye: DVec3| {
        renderer.draw(&[Some(look_at(eye, DVec3::ZERO))], Shown::Composite);
        renderer.read_picture().expect("a picture")
    };
    let first = shoot(EYE);
    let _ = shoot(EYE + 0.05);
    assert!(first == shoot(EYE), "a frame depends on the one before it");
}

/// Half transparent, above a table.
fn sheet_of_glass() -> Object {
    let scene = scene(&[HIGH], &SUNS, "");
    let [sheet] = scene.virtuals.try_into().expect("one sheet");
    sheet
}

/// The order in the scene says nothing of which sheet is before the other, and what is not there is not.
#[test]
fn sheets_are_sorted_and_a_frame_is_as_if_it_were_the_first() {
    let shoot = |sheets: &[Sheet]| {
        let mut renderer = Stage::of_scene(scene(sheets, &SUNS, "")).renderer(CAMERA);
        let pose = [Some(look_at(EYE, DVec3::ZERO))];
        renderer.draw(&pose, Shown::Composite);
        let first = renderer.read_picture().expect("a picture");
        renderer.draw(
            &[Some(look_at(-EYE.with_z(-0.4), DVec3::ZERO))],
            Shown::Composite,
        );
        renderer.draw(&pose, Shown::Composite);
        let again = renderer.read_picture().expect("a picture");
        assert!(first == again, "a frame depends on the one before it");
        first
    };
    let [one, other] = [shoot(&[LOW, HIGH]), shoot(&[HIGH, LOW])];
    let off = one.iter().zip(&other).filter(|(a, b)| a.abs_diff(**b) > 1);
    assert_eq!(off.count(), 0);
}

/// A disc that a picture's opacity cuts out of a square card: its edge is where the opacity passes a half.
const DISC: Sheet = Sheet {
    middle: DVec3::new(-0.03, 0.03, 0.06),
    half: DVec2::splat(0.045),
    albedo: 0.8,
    opacity: 1.0,
    is_round: true,
    fades: false,
};

fn write_card(folder: &std::path::Path) {
    /// Texels of the card's side, and of the disc's radius: three quarters of half of it.
    const SIDE: u32 = 64;
    const RADIUS: f64 = 24.0;
    let grey = |x: u32, y: u32| {
        let off = DVec2::new(f64::from(x), f64::from(y)) - 0.5 * f64::from(SIDE - 1);
        let opacity = (0.5 + 0.5 * (RADIUS - off.length())).clamp(0.0, 1.0);
        image::Luma([(255.0 * opacity).round() as u8])
    };
    let mask = image::GrayImage::from_fn(SIDE, SIDE, grey);
    mask.save(folder.join("mask.png")).expect("a picture");
    let half = 0.045 / RADIUS * 0.5 * f64::from(SIDE);
    let mut obj = "mtllib card.mtl\nusemtl card\n".to_owned();
    for (x, y) in [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)] {
        let [across, up] = [x, y].map(|side| (2.0 * side - 1.0) * half);
        obj += &format!("v {across} {up} 0\nvt {x} {y}\n");
    }
    obj += "f 1/1 2/2 3/3 4/4\n";
    std::fs::write(folder.join("card.obj"), obj).expect("a file");
    let mtl = "newmtl card\nKd 0.8 0.8 0.8\nmap_d mask.png\n";
    std::fs::write(folder.join("card.mtl"), mtl).expect("a file");
}

#[test]
fn what_a_mask_leaves_is_seen_and_throws_its_own_shadow() {
    let folder = tempfile::tempdir().expect("a folder");
    write_card(folder.path());
    for (suns, samples) in [(&SUNS[..1], 1), (&SUNS[..], 4)] {
        let keys = format!(
            "[[virtual]]\nname = \"card\"\nmesh = {:?}\nposition_m = {:?}\n[shadows]\nsamples = {samples}\n\
             {NOTHING_REFLECTED}",
            folder.path().join("card.obj"),
            DISC.middle.to_array()
        );
        let mut renderer = Stage::of_scene(scene(&[], suns, &keys)).renderer(CAMERA);
        renderer.draw(&[Some(look_at(EYE, DVec3::ZERO))], Shown::Composite);
        let picture = Picture::new(renderer.read_picture().expect("a picture"));
        let (wrong, judged) = wrong(&picture, &[DISC], suns);
        println!("a mask's disc: {wrong} of {judged} pixels are off");
        assert!(judged > 60_000, "{judged} pixels judged");
        assert!(wrong == 0, "{wrong} of {judged} pixels are off");
    }
}
