//! Scenes as people write them, with round numbers, whose things lie in one plane, touch, or stand in one another, and
//! whose lights lie in planes, on corners, close by and far off.

use std::f64::consts::{FRAC_PI_2, PI};

use glam::{DAffine3, DQuat, DVec2, DVec3, Vec2};
use gnomon::geometry::camera::{Distortion, Intrinsics};
use gnomon::light::Light;

use super::random::{Random, random_camera};
use super::shapes::{self, Soup};
use super::{Shape, Stage, Thing, lamp, look_with_up, sun};

/// A scene with what is needed to look at it.
pub struct Case {
    pub stage: Stage,
    /// Of all things' corners, in the world.
    pub places: Vec<DVec3>,
    pub intrinsics: Intrinsics,
    /// What is special about it.
    pub name: String,
}

const SIZE_PX: [u32; 2] = [72, 54];

fn step(random: &mut Random, low: i32, high: i32) -> f64 {
    f64::from(low + random.below((high - low + 1) as usize) as i32) / 100.0
}

/// Flat things in the plane z = 0, about the origin.
fn flat(random: &mut Random) -> Soup {
    let [half_x, half_y] = [0; 2].map(|_| step(random, 2, 8) as f32);
    match random.below(3) {
        0 | 1 => {
            let card = shapes::rectangle([-half_x, -half_y], [half_x, half_y]);
            let turned = random.chance(0.3);
            card.flipped(|_| turned)
        }
        _ => disc(half_x, 5 + random.below(8) as u32),
    }
}

fn disc(radius: f32, corners: u32) -> Soup {
    let on_rim = |index: u32| {
        let turn = std::f32::consts::TAU * index as f32 / corners as f32;
        (Vec2::from_angle(turn) * radius).extend(0.0)
    };
    let positions = (0..corners).map(on_rim).collect();
    let triangles = (1..corners - 1)
        .map(|index| [0, index, index + 1])
        .collect();
    Soup::new(positions, triangles)
}

fn block(random: &mut Random) -> (Soup, DVec3) {
    let size = DVec3::new(
        step(random, 2, 10),
        step(random, 2, 10),
        step(random, 2, 10),
    );
    let [x, y, z] = size.as_vec3().to_array();
    let soup = shapes::cuboid([-x / 2.0, -y / 2.0, 0.0], [x / 2.0, y / 2.0, z]);
    (soup, size)
}

fn upright(random: &mut Random, place: DVec3) -> DAffine3 {
    let turn = match random.below(2) {
        0 => DQuat::from_rotation_x(FRAC_PI_2),
        _ => DQuat::from_rotation_y(FRAC_PI_2),
    };
    DAffine3::from_rotation_translation(turn, place)
}

fn on_table(random: &mut Random) -> DVec3 {
    DVec3::new(step(random, -12, 12), step(random, -10, 10), 0.0)
}

/// Phantoms and virtual things, and what is special about them.
type Things = (Vec<Thing>, Vec<Thing>, &'static str);

fn faceted_at(soup: Soup, place: DVec3) -> Thing {
    Thing::made(soup).at(place.to_array()).faceted()
}

fn above(random: &mut Random, place: DVec3) -> DVec3 {
    place + DVec3::Z * step(random, 2, 14)
}

/// Things that lie in one another's planes, and what is special about them.
fn things(random: &mut Random) -> Things {
    let place = on_table(random);
    match random.below(13) {
        0 => {
            // Where nothing else is higher, it lies in the top of the box around all.
            let place = above(random, place);
            let card = faceted_at(flat(random), place);
            (vec![], vec![card], "flat card on top")
        }
        1 => upright_card(random, place),
        2 => flat_phantom_over_torus(random, place),
        3 => {
            let sheet = faceted_at(flat(random), place);
            (vec![], vec![sheet], "virtual sheet in the table")
        }
        4 => {
            let (soup, size) = block(random);
            let sheet = faceted_at(flat(random), place + DVec3::Z * size.z);
            let real = faceted_at(soup, place);
            (vec![real], vec![sheet], "virtual sheet on a real block")
        }
        5 => {
            let (soup, size) = block(random);
            let sunk = [0.0, -size.z / 2.0, -size.z][random.below(3)];
            let thing = faceted_at(soup, place + DVec3::Z * sunk);
            (vec![], vec![thing], "virtual block on or in the table")
        }
        6 => {
            let (real, size) = block(random);
            let (soup, _) = block(random);
            let top = faceted_at(soup, place + DVec3::Z * size.z);
            let real = faceted_at(real, place);
            (vec![real], vec![top], "virtual block on a real one")
        }
        7 => {
            let (soup, _) = block(random);
            let copy = faceted_at(soup.clone(), place);
            let real = faceted_at(soup, place);
            (vec![real], vec![copy], "virtual copy of a phantom")
        }
        8 => thing_twice(random, place),
        9 | 10 => one_in_another(random, place),
        11 => cards_edge_to_edge(random, place),
        _ => stack_of_sheets(random, place),
    }
}

fn upright_card(random: &mut Random, place: DVec3) -> Things {
    let side = if random.chance(0.5) {
        // In a side of the box around all.
        let side = [0.4, -0.4][random.below(2)];
        match random.below(2) {
            0 => DVec3::new(side, place.y, 0.0),
            _ => DVec3::new(place.x, side, 0.0),
        }
    } else {
        place
    };
    let height = DVec3::Z * step(random, 0, 12);
    let pose = upright(random, side + height);
    let card = Thing::made(flat(random)).placed(pose).faceted();
    (vec![], vec![card], "upright card")
}

fn flat_phantom_over_torus(random: &mut Random, place: DVec3) -> Things {
    let radius = step(random, 3, 6) as f32;
    let tube = step(random, 1, 2) as f32;
    let ring = shapes::torus(radius, tube, 16, 8);
    let height = step(random, 2, 6);
    let top = match random.chance(0.5) {
        true => height + f64::from(tube),
        false => height + f64::from(tube) + 0.04,
    };
    let sheet = faceted_at(flat(random), DVec3::new(place.x, place.y, top));
    let ring = faceted_at(ring, place + DVec3::Z * height);
    (vec![sheet], vec![ring], "flat phantom over a torus")
}

fn thing_twice(random: &mut Random, place: DVec3) -> Things {
    let soup = match random.below(3) {
        0 => block(random).0,
        1 => flat(random),
        _ => shapes::torus(0.04, 0.02, 12, 7),
    };
    let place = above(random, place);
    let one = faceted_at(soup.clone(), place);
    let other = faceted_at(soup, place).of_albedo(0.2);
    (vec![], vec![one, other], "a virtual thing twice")
}

fn one_in_another(random: &mut Random, place: DVec3) -> Things {
    let (outer, size) = block(random);
    let inner = outer.clone().scaled(0.5);
    let inner_place = place + DVec3::Z * size.z * [0.0, 0.25][random.below(2)];
    let outer = faceted_at(outer, place);
    let inner = faceted_at(inner, inner_place);
    match random.below(2) {
        0 => (vec![outer], vec![inner], "virtual in real"),
        _ => (vec![inner], vec![outer], "real in virtual"),
    }
}

fn cards_edge_to_edge(random: &mut Random, place: DVec3) -> Things {
    let [half_x, half_y] = [0; 2].map(|_| step(random, 2, 6));
    let card = shapes::rectangle(
        [-half_x as f32, -half_y as f32],
        [half_x as f32, half_y as f32],
    );
    let place = above(random, place);
    let first = faceted_at(card.clone(), place);
    let beside = faceted_at(card, place + DVec3::X * (2.0 * half_x));
    match random.below(2) {
        0 => (vec![], vec![first, beside], "cards edge to edge"),
        _ => (
            vec![beside],
            vec![first],
            "real and virtual card edge to edge",
        ),
    }
}

/// Sheets one above the other, as many as the stencil's bits are tried by.
fn stack_of_sheets(random: &mut Random, place: DVec3) -> Things {
    let soup = flat(random);
    let count = 2 + random.below(6);
    let sheets = (0..count).map(|index| {
        let height = DVec3::Z * (0.01 + 0.01 * index as f64);
        faceted_at(soup.clone(), place + height)
    });
    (vec![], sheets.collect(), "a stack of sheets")
}

/// Of each of its triangles, on its anchor.
pub fn corners_of(thing: &Thing) -> Vec<[DVec3; 3]> {
    let Shape::Made(soup) = &thing.shape else {
        return Vec::new();
    };
    let placed = thing.anchor_from_thing * DAffine3::from_scale(thing.scale);
    let place = |index: u32| {
        let position = soup.positions[index as usize].as_dvec3();
        placed.transform_point3(position).as_vec3().as_dvec3()
    };
    soup.triangles.iter().map(|t| t.map(place)).collect()
}

/// A light, and what is special about it.
fn light(random: &mut Random, triangles: &[[DVec3; 3]]) -> (Light, &'static str) {
    let [a, b, c] = triangles[random.below(triangles.len())];
    let middle = (a + b + c) / 3.0;
    let normal = (b - a).cross(c - a).normalize();
    let rounded = |point: DVec3| (point * 1000.0).round() / 1000.0;
    // As bright on the table as a lamp half a metre away.
    let at = |point: DVec3, name| {
        let power = point.length_squared().max(0.02);
        (lamp(point.to_array(), [power; 3]), name)
    };
    match random.below(16) {
        0 => at(rounded(a), "light on a vertex"),
        1 => at(rounded((a + b) / 2.0), "light on an edge"),
        2 => at(rounded(middle), "light on a face"),
        3 => {
            let sign = [1.0, -1.0][random.below(2)];
            at(middle + normal * (1e-4 * sign), "light close to a face")
        }
        4 => {
            let out = (a - middle) * random.between(4.0, 12.0);
            at(middle + out, "light in the plane of a face")
        }
        5 => {
            let towards = (a - b) * random.between(3.0, 10.0);
            at(a + towards, "light in line with an edge")
        }
        6 | 7 => at(
            DVec3::new(rounded(a).x, rounded(a).y, 0.5),
            "light straight above",
        ),
        8 => {
            let towards = DVec3::new(
                step(random, -50, 50),
                step(random, -50, 50),
                step(random, 20, 60),
            );
            at(towards.normalize() * 1e4, "light far away")
        }
        9 => {
            let axes = [
                DVec3::NEG_Z,
                DVec3::NEG_Z,
                DVec3::X,
                DVec3::NEG_X,
                DVec3::Y,
                DVec3::NEG_Y,
            ];
            let axis = axes[random.below(axes.len())];
            (
                sun(axis.to_array(), [1.0; 3]),
                "distant light along an axis",
            )
        }
        10 => {
            let aslant = [[1.0, 0.0, -1.0], [0.0, -1.0, -1.0], [-1.0, 0.0, -0.5]];
            (
                sun(aslant[random.below(3)], [1.0; 3]),
                "distant light along a plane",
            )
        }
        _ => {
            let place = DVec3::new(
                step(random, -60, 60),
                step(random, -60, 60),
                step(random, 10, 60),
            );
            at(place, "lamp")
        }
    }
}

/// A scene in which things and lights lie in one another's planes and places.
pub fn degenerate_case(random: &mut Random) -> Case {
    let (mut phantoms, mut virtuals, what) = things(random);
    phantoms.insert(0, table(random));
    add_others(random, &mut phantoms, &mut virtuals);
    let all: Vec<[DVec3; 3]> = phantoms[1..]
        .iter()
        .chain(&virtuals)
        .flat_map(corners_of)
        .collect();
    let (mut lights, of_lights) = lights(random, &all);
    let mut names = [vec![what], of_lights].concat();
    names.dedup();
    let places = all.iter().flatten().copied().collect();

    // On the world's anchor the surroundings throw light back that rays do not know: little of it by dark things.
    let world_from_card = world_from_card(random);
    let mut ambient = random.between(0.03, 0.2);
    match world_from_card {
        None => {
            names.push("all on the world's anchor");
            ambient *= 0.5;
            reflect_less(&mut phantoms, &mut virtuals, &mut lights);
        }
        Some(card) => {
            for thing in &mut virtuals {
                thing.anchor_from_thing = card.inverse() * thing.anchor_from_thing;
            }
        }
    }
    let mut stage = Stage::new(
        &phantoms,
        &virtuals,
        world_from_card,
        lights,
        DVec3::splat(ambient),
    );
    stage.scene.shadows.samples = if random.chance(0.5) { 4 } else { 1 };
    Case {
        stage,
        places,
        intrinsics: Intrinsics {
            size_px: SIZE_PX,
            focal_px: DVec2::splat(random.between(40.0, 110.0).round()),
            center_px: DVec2::new(35.5, 26.5),
            distortion: Distortion::NONE,
        },
        name: names.join(", "),
    }
}

fn table(random: &mut Random) -> Thing {
    match random.below(4) {
        0 => Thing::made(shapes::cuboid([-0.4, -0.4, -0.05], [0.4, 0.4, 0.0])),
        1 => Thing::made(shapes::rectangle([-0.4, -0.4], [0.4, 0.4])).without_shadow(),
        _ => Thing::made(shapes::rectangle([-0.4, -0.4], [0.4, 0.4])),
    }
}

/// Sometimes one more of each kind, anywhere.
fn add_others(random: &mut Random, phantoms: &mut Vec<Thing>, virtuals: &mut Vec<Thing>) {
    if random.chance(0.2) {
        let (soup, _) = block(random);
        let place = on_table(random).to_array();
        phantoms.push(Thing::made(soup).at(place));
    }
    if random.chance(0.2) {
        let soup = random.closed_mesh();
        let place = on_table(random) + DVec3::Z * 0.06;
        let thing = Thing::made(soup)
            .scaled(DVec3::splat(0.04))
            .at(place.to_array());
        virtuals.push(thing.faceted());
    }
}

/// Lights about some triangles, and what is special about each.
fn lights(random: &mut Random, triangles: &[[DVec3; 3]]) -> (Vec<Light>, Vec<&'static str>) {
    let count = match random.below(20) {
        0 => 5 + random.below(12),
        1..=5 => 2 + random.below(2),
        _ => 1,
    };
    (0..count).map(|_| light(random, triangles)).unzip()
}

/// Where the virtual things' anchor is; `None` where they are on the world's.
fn world_from_card(random: &mut Random) -> Option<DAffine3> {
    match random.below(3) {
        0 => None,
        1 => Some(DAffine3::IDENTITY),
        _ => {
            let place = DVec3::new(step(random, -10, 10), step(random, -10, 10), 0.0);
            Some(DAffine3::from_translation(place))
        }
    }
}

/// Less reflected light beside what the lights give: darker things under brighter lights.
fn reflect_less(phantoms: &mut [Thing], virtuals: &mut [Thing], lights: &mut [Light]) {
    for light in lights {
        match light {
            Light::Point { intensity, .. } => *intensity *= 3.0,
            Light::Directional { irradiance, .. } => *irradiance *= 3.0,
        }
    }
    for thing in phantoms {
        thing.albedo = 0.0;
    }
    for thing in virtuals {
        thing.albedo *= 0.25;
    }
}

/// A camera for it: around it, straight above, in the plane of something, in something, or anywhere.
pub fn degenerate_camera(random: &mut Random, case: &Case) -> (DAffine3, &'static str) {
    let place = |random: &mut Random| case.places[random.below(case.places.len())];
    let target = place(random);
    let rounded = |point: DVec3| (point * 100.0).round() / 100.0;
    let around = |random: &mut Random| DVec2::from_angle(random.between(0.0, 2.0 * PI));
    match random.below(10) {
        0..=4 => {
            let turn = around(random) * random.between(0.3, 0.7);
            let eye = rounded(turn.extend(random.between(0.1, 0.6)));
            (look_with_up(eye, rounded(target), DVec3::Z), "around")
        }
        5 => {
            let eye = rounded(target) + DVec3::Z * 0.6;
            (
                look_with_up(eye, rounded(target), DVec3::Y),
                "straight above",
            )
        }
        6 => {
            // Level with a corner: whatever is flat there is seen from its edge.
            let turn = around(random) * random.between(0.2, 0.5);
            let eye = rounded(DVec3::new(turn.x, turn.y, 0.0)) + DVec3::Z * target.z.max(0.01);
            let level = DVec3::new(0.0, 0.0, eye.z);
            (look_with_up(eye, level, DVec3::Z), "level with a corner")
        }
        7 => {
            let eye = (target + place(random)) / 2.0 + DVec3::Z * 1e-3;
            let way = random.direction();
            (look_with_up(eye, eye + way, DVec3::Z), "in a thing")
        }
        8 => {
            let eye = DVec3::new(step(random, -20, 20), step(random, -20, 20), 0.01);
            (
                look_with_up(eye, target + DVec3::Z * 0.02, DVec3::Z),
                "on the table",
            )
        }
        _ => (
            random_camera(random, &case.places, &case.stage.scene.world_lights()),
            "anywhere",
        ),
    }
}
