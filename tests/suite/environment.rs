//! An environment's light on things that move and turn, held against sums over all of the probe's pixels by rays.

use glam::{DAffine3, DMat3, DVec2, DVec3, Vec3};
use gnomon::geometry::camera::{Distortion, Intrinsics};
use gnomon::geometry::ray_caster::RayCaster;
use gnomon::light::probe::Probe;
use gnomon::render::{Layers, REAL, Shown, VIRTUAL};
use gnomon::scene::{Anchor, EnvironmentMethod, Grouping, Object, ProbeScene, Scene, Technique};

use crate::common::shapes::{cuboid, rectangle, sphere};
use crate::common::{Picture, Stage, flat_mesh, look_at, object, scene};

pub(crate) const CAMERA: Intrinsics = Intrinsics {
    size_px: [120, 90],
    focal_px: DVec2::splat(130.0),
    center_px: DVec2::new(59.5, 44.5),
    distortion: Distortion::NONE,
};
const PROBE_PX: [usize; 2] = [96, 48];

/// A sky that is bright to one side, with a broad glow, over dark ground; turned to the left by so many columns.
fn sky(turned: usize) -> Probe {
    let [width, height] = PROBE_PX;
    let grid = Probe::new(PROBE_PX, vec![Vec3::ONE; width * height]).expect("pixels");
    let glow = DVec3::new(0.6, 0.2, 0.7).normalize();
    let pixels = (0..width * height).map(|index| {
        let (row, column) = (index / width, (index % width + width - turned) % width);
        let direction = grid.direction(column as f64 + 0.5, row as f64 + 0.5);
        let glow = 6.0 * (direction.dot(glow).max(0.0)).powi(12);
        let sky = 0.6 + 0.4 * direction.y;
        let bright = match direction.z > 0.0 {
            true => sky + glow,
            false => 0.2,
        };
        Vec3::new(1.0, 0.9, 0.8) * bright as f32
    });
    Probe::new(PROBE_PX, pixels.collect()).expect("pixels")
}

pub(crate) fn probe_scene(probe: Probe) -> ProbeScene {
    ProbeScene {
        image: "sky.hdr".into(),
        probe,
        notes: Vec::new(),
        anchor: 0,
        position_m: DVec3::new(0.0, 0.0, 0.05),
        exposure: 0.3,
        room: Vec::new(),
        is_far: true,
    }
}

/// A table, and what stands on it, under the sky.
pub(crate) fn under_sky(turned: usize, phantoms: Vec<Object>, virtuals: Vec<Object>) -> Scene {
    let table = rectangle([-1.0, -1.0], [1.0, 1.0]);
    let table = flat_mesh(table.positions, table.triangles);
    let mut table = object("table", table, DVec3::splat(0.0), DAffine3::IDENTITY);
    table.casts = false;
    let phantoms = std::iter::once(table).chain(phantoms).collect();
    let mut scene = scene(phantoms, virtuals, Vec::new(), 0.0);
    scene.probe = Some(probe_scene(sky(turned)));
    scene.shadows.technique = Technique::Environment;
    scene.shadows.samples = 1;
    scene.shadows.ambient_samples = 256;
    // All of it is broad.
    scene.shadows.compact_penumbra_px = 0.0;
    scene
}

pub(crate) fn black_box(name: &str, low: [f32; 3], high: [f32; 3], place: DAffine3) -> Object {
    let soup = cuboid(low, high);
    object(
        name,
        flat_mesh(soup.positions, soup.triangles),
        DVec3::ZERO,
        place,
    )
}

/// The gain of each pixel, and what is there.
pub(crate) fn gains(
    scene: &Scene,
    camera_from_world: DAffine3,
) -> (Vec<[f32; 3]>, Vec<u8>, Picture) {
    let mut renderer = Stage::of_scene(scene.clone()).renderer(CAMERA);
    renderer.draw(&[Some(camera_from_world)], Shown::Composite);
    let picture = Picture::new(renderer.read_picture().expect("a picture"));
    let layers = renderer.layers().expect("layers");
    (layers.gain, layers.role, picture)
}

pub(crate) fn triangles(object: &Object) -> Vec<[Vec3; 3]> {
    let positions = object.positions_in_anchor(&object.mesh);
    let corners = object.mesh.triangles.iter();
    corners
        .map(|triangle| triangle.map(|index| positions[index as usize]))
        .collect()
}

/// Rays against those that cast shadows.
fn caster(objects: &[Object]) -> RayCaster {
    let casting = objects.iter().filter(|object| object.casts);
    RayCaster::new(&casting.flat_map(triangles).collect::<Vec<_>>())
}

/// Green irradiance of a place from all pixels that nothing of `casters` hides.
pub(crate) fn exact(probe: &Probe, place: DVec3, normal: DVec3, casters: &[&RayCaster]) -> f64 {
    let [width, _] = probe.size_px();
    let start = (place + normal * 1e-5).as_vec3();
    let pixels = probe.pixels().iter().enumerate();
    let arriving = pixels.map(|(index, pixel)| {
        let (row, column) = (index / width, index % width);
        let direction = probe.direction(column as f64 + 0.5, row as f64 + 0.5);
        let cosine = direction.dot(normal);
        let way = direction.as_vec3();
        let is_lost = cosine <= 0.0
            || direction.z < 0.0
            || casters
                .iter()
                .any(|it| it.is_hidden(start, way, f32::INFINITY));
        match is_lost {
            true => 0.0,
            false => f64::from(pixel.y) * cosine * probe.pixel_solid_angle(row),
        }
    });
    arriving.sum()
}

/// The place on the table that a pixel shows.
fn on_table(index: usize, camera_from_world: &DAffine3) -> DVec3 {
    let pixel = DVec2::new((index % 120) as f64, (index / 120) as f64);
    let world_from_camera = camera_from_world.inverse();
    let way = ((pixel - CAMERA.center_px) / CAMERA.focal_px).extend(1.0);
    let (eye, way) = (
        world_from_camera.translation,
        world_from_camera.transform_vector3(way),
    );
    eye - way * (eye.z / way.z)
}

pub(crate) fn camera() -> DAffine3 {
    look_at(DVec3::new(0.1, -0.5, 0.45), DVec3::new(0.0, 0.02, 0.0))
}

/// Root mean square and largest difference of a scene's gains on the table from the exact ones.
fn off_exact(scene: &Scene) -> [f64; 2] {
    let camera_from_world = camera();
    let (gain, role, _) = gains(scene, camera_from_world);
    let probe = &scene.probe.as_ref().expect("a probe").probe;
    let (real, virtuals) = (caster(&scene.phantoms), caster(&scene.virtuals));
    let hidden_by_real = scene.phantoms.len() > 1;
    let (mut squares, mut largest, mut count) = (0.0, 0.0, 0);
    for index in (0..gain.len()).step_by(7) {
        let place = on_table(index, &camera_from_world);
        let world_from_camera = camera_from_world.inverse();
        let eye = world_from_camera.translation.as_vec3();
        let way = place.as_vec3() - eye;
        // (Of phantoms the table alone is looked at.)
        let shows_phantom = hidden_by_real && real.is_hidden(eye, way, 0.999);
        if role[index] != REAL || place.truncate().length() > 0.6 || shows_phantom {
            continue;
        }
        let before = exact(probe, place, DVec3::Z, &[&real]);
        let after = exact(probe, place, DVec3::Z, &[&real, &virtuals]);
        // (Amid a real thing nothing arrives at all.)
        if before < 0.1 {
            continue;
        }
        let difference = f64::from(gain[index][1]) - after / before;
        squares += difference * difference;
        largest = f64::max(largest, difference.abs());
        count += 1;
    }
    assert!(count > 500, "{count}");
    [(squares / f64::from(count)).sqrt(), largest]
}

/// A box that floats, one that stands, and a real one.
fn three_boxes() -> Scene {
    let turned = DAffine3::from_rotation_z(0.5);
    let at = |x: f64, y: f64, z: f64| DAffine3::from_translation(DVec3::new(x, y, z)) * turned;
    let real = black_box(
        "crate",
        [-0.04, -0.03, 0.0],
        [0.04, 0.03, 0.07],
        at(-0.12, 0.05, 0.0),
    );
    let floats = black_box(
        "slab",
        [-0.06, -0.06, 0.0],
        [0.06, 0.06, 0.01],
        at(0.1, 0.02, 0.06),
    );
    let stands = black_box(
        "post",
        [-0.02, -0.02, 0.0],
        [0.02, 0.02, 0.1],
        at(-0.02, -0.05, 0.0),
    );
    under_sky(0, vec![real], vec![floats, stands])
}

#[test]
fn black_boxes_take_of_a_table_what_the_sum_over_the_probe_says() {
    let off = |method: EnvironmentMethod| {
        let mut scene = three_boxes();
        scene.shadows.environment.method = method;
        off_exact(&scene)
    };
    let [by_rays, largest_by_rays] = off(EnvironmentMethod::Rays);
    assert!(
        by_rays < 0.005 && largest_by_rays < 0.05,
        "{by_rays} {largest_by_rays}"
    );
    let [by_penumbrae, largest] = off(EnvironmentMethod::Penumbrae);
    assert!(
        by_penumbrae < 0.01 && largest < 0.15,
        "{by_penumbrae} {largest}"
    );
    let [by_maps, _] = off(EnvironmentMethod::Maps);
    assert!(
        by_penumbrae < by_maps && by_maps < 0.08,
        "the paper's way {by_maps}, ours {by_penumbrae}"
    );
}

/// Two slabs, one close behind the other as most of the light comes, and a post beside them.
fn stacked() -> Scene {
    let at = |x: f64, y: f64, z: f64| DAffine3::from_translation(DVec3::new(x, y, z));
    let slab = |name, place| black_box(name, [-0.05, -0.05, 0.0], [0.05, 0.05, 0.006], place);
    under_sky(
        0,
        Vec::new(),
        vec![
            slab("upper", at(0.01, 0.0, 0.075)),
            slab("lower", at(0.0, 0.0, 0.055)),
        ],
    )
}

#[test]
fn things_close_behind_each_other_hide_light_once() {
    let off = |method: EnvironmentMethod, grouping: Grouping| {
        let mut scene = stacked();
        scene.shadows.environment.method = method;
        scene.shadows.environment.grouping = grouping;
        off_exact(&scene)[0]
    };
    let [maps, penumbrae] = [EnvironmentMethod::Maps, EnvironmentMethod::Penumbrae]
        .map(|method| [Grouping::Apart, Grouping::Together].map(|grouping| off(method, grouping)));
    assert!(maps[1] < 0.95 * maps[0], "maps {maps:?}");
    assert!(penumbrae[1] < 0.7 * penumbrae[0], "penumbrae {penumbrae:?}");
}

#[test]
fn more_regions_are_nearer_to_the_sum() {
    let off = |regions: u32| {
        let mut scene = three_boxes();
        scene.shadows.environment.method = EnvironmentMethod::Penumbrae;
        scene.shadows.environment.regions = regions;
        off_exact(&scene)[0]
    };
    let [one, eight, many] = [1, 8, 64].map(off);
    assert!(many < eight && eight < one, "{one} {eight} {many}");
}

#[test]
fn a_renderer_that_follows_an_edit_draws_what_a_new_one_draws() {
    let turned =
        |by: f64| DAffine3::from_mat3(DMat3::from_axis_angle(DVec3::new(0.6, 0.0, 0.8), by));
    type Edit<'a> = (&'a str, &'a dyn Fn(&mut Scene));
    let edits: [Edit<'_>; 7] = [
        ("moved and turned", &|scene| {
            let place = &mut scene.virtuals[1].anchor_from_object;
            *place =
                DAffine3::from_translation(DVec3::new(0.02, -0.01, 0.05)) * turned(0.9) * *place;
        }),
        ("a virtual thing hidden", &|scene| {
            scene.virtuals[0].visible = false
        }),
        ("a real thing hidden", &|scene| {
            scene.phantoms[1].visible = false
        }),
        ("the probe turned", &|scene| {
            scene.probe = Some(probe_scene(sky(31)))
        }),
        ("brighter", &|scene| {
            scene.probe.as_mut().expect("a probe").exposure *= 1.7;
        }),
        ("a virtual thing shown", &|scene| {
            scene.virtuals[0].visible = true
        }),
        ("a real thing moved", &|scene| {
            scene.phantoms[1].visible = true;
            scene.phantoms[1].anchor_from_object.translation.x -= 0.03;
        }),
    ];
    for method in [
        EnvironmentMethod::Rays,
        EnvironmentMethod::Penumbrae,
        EnvironmentMethod::Maps,
    ] {
        let mut scene = three_boxes();
        let ball = sphere(0.02, 8, 12);
        let mut ball = object(
            "ball",
            flat_mesh(ball.positions, ball.triangles),
            DVec3::splat(0.3),
            DAffine3::from_translation(DVec3::new(0.0, -0.05, 0.02)),
        );
        ball.materials[0].roughness = Some(0.2);
        scene.virtuals.push(ball);
        scene.shadows.environment.method = method;
        let mut following = Stage::of_scene(scene.clone()).renderer(CAMERA);
        let seen = |renderer: &mut gnomon::render::Renderer| {
            // Where something has just moved, light is gathered finely from the next frame on.
            for _ in 0..2 {
                renderer.draw(&[Some(camera())], Shown::Composite);
            }
            renderer.read_picture().expect("a picture")
        };
        let mut before = seen(&mut following);
        for (step, (what, edit)) in edits.iter().enumerate() {
            edit(&mut scene);
            assert!(following.follow(&scene), "{method:?}: {what}: not followed");
            let kept = seen(&mut following);
            assert!(kept != before, "{method:?}: {what}: nothing changes");
            // A new renderer takes seconds; what was followed wrongly is wrong after the next edit too, as none takes back the one
            // before it.
            if step % 2 == 0 || method == EnvironmentMethod::Rays {
                let anew = seen(&mut Stage::of_scene(scene.clone()).renderer(CAMERA));
                let off = kept.iter().zip(&anew).map(|(a, b)| a.abs_diff(*b)).max();
                assert!(kept == anew, "{method:?}: {what}: off by {off:?} levels");
            }
            before = kept;
        }
        // What it hides from itself is another.
        scene.virtuals[1].anchor_from_object.matrix3.z_axis *= 2.0;
        assert!(!following.follow(&scene), "{method:?}");
    }
}

#[test]
fn a_turned_probe_is_a_turned_scene() {
    let columns = 17;
    let turn = DAffine3::from_mat3(DMat3::from_rotation_z(
        std::f64::consts::TAU * columns as f64 / PROBE_PX[0] as f64,
    ));
    let before = three_boxes();
    let mut after = three_boxes();
    after.probe = Some(probe_scene(sky(columns)));
    for thing in after.phantoms.iter_mut().chain(&mut after.virtuals) {
        thing.anchor_from_object = turn * thing.anchor_from_object;
    }
    let (gain, role, _) = gains(&before, camera());
    let (turned, turned_role, _) = gains(&after, camera() * turn.inverse());
    let (mut compared, mut squares) = (0, 0.0);
    for index in 0..gain.len() {
        // (The table's own outline is a square, and turns.)
        let place = on_table(index, &camera());
        if role[index] != REAL || turned_role[index] != REAL || place.truncate().length() > 0.5 {
            continue;
        }
        let off = (gain[index][1] - turned[index][1]).abs();
        squares += off * off;
        compared += 1;
    }
    // What differs is where the texels of the maps lie: no more than either is off the exact sum.
    let rms = (squares / compared as f32).sqrt();
    assert!(compared > 3000 && rms < 0.008, "{compared} compared: {rms}");
}

#[test]
fn a_probe_on_a_marker_turns_with_it() {
    let columns = 17;
    let turn =
        DAffine3::from_rotation_z(std::f64::consts::TAU * columns as f64 / PROBE_PX[0] as f64);
    let anchor = |name: &str| Anchor {
        name: name.to_owned(),
        markers: Vec::new(),
    };
    // A lamp in the probe that is drawn with outlines turns as well.
    let probe = |turned: usize| {
        let sky = sky(turned);
        let mut pixels = sky.pixels().to_vec();
        let (row, column) = (14, (40 + turned) % PROBE_PX[0]);
        pixels[row * PROBE_PX[0] + column] = Vec3::splat(400.0);
        Probe::new(PROBE_PX, pixels).expect("pixels")
    };
    let scene = |turned: usize, on: usize| {
        let mut scene = three_boxes();
        scene.anchors = vec![anchor("table"), anchor("dial")];
        scene.shadows.compact_penumbra_px = 1000.0;
        scene.probe = Some(ProbeScene {
            anchor: on,
            ..probe_scene(probe(turned))
        });
        scene
    };
    for method in [EnvironmentMethod::Rays, EnvironmentMethod::Penumbrae] {
        let drawn = |mut scene: Scene, dial: DAffine3| {
            scene.shadows.environment.method = method;
            let mut renderer = Stage::of_scene(scene).renderer(CAMERA);
            // The dial may lie anywhere.
            let aside = DAffine3::from_translation(DVec3::new(0.3, -0.2, 0.0));
            let poses = [Some(camera()), Some(camera() * aside * dial)];
            renderer.draw(&poses, Shown::Composite);
            let picture = renderer.read_picture().expect("a picture");
            (picture, renderer.layers().expect("layers"))
        };
        let (_, of_probe) = drawn(scene(columns, 0), DAffine3::IDENTITY);
        let (_, of_dial) = drawn(scene(0, 1), turn);
        let (_, still) = drawn(scene(0, 1), DAffine3::IDENTITY);
        let rms = |one: &Layers, other: &Layers| {
            let pairs = one.gain.iter().zip(&other.gain);
            let squares = pairs.map(|(a, b)| (a[1] - b[1]).powi(2));
            (squares.sum::<f32>() / one.gain.len() as f32).sqrt()
        };
        let (off, moved) = (rms(&of_probe, &of_dial), rms(&of_probe, &still));
        // What differs is where regions, texels and rays lie.
        assert!(
            off < 0.02 && moved > 5.0 * off,
            "{method:?}: {off}, turned by {moved}"
        );
    }
    // What it turns with is not there: neither is its light.
    let mut renderer = Stage::of_scene(scene(0, 1)).renderer(CAMERA);
    renderer.draw(&[Some(camera()), None], Shown::Composite);
    let without = renderer.read_picture().expect("a picture");
    renderer.draw(&[Some(camera()), Some(camera())], Shown::Composite);
    assert!(renderer.read_picture().expect("a picture") != without);
}

#[test]
fn a_real_desk_darkens_what_is_virtual_below_it_as_much_as_it_hides() {
    let plate = rectangle([-0.03, -0.03], [0.03, 0.03]);
    let plate = flat_mesh(plate.positions, plate.triangles);
    let at = DVec3::new(0.0, 0.0, 0.02);
    let plate = object(
        "plate",
        plate,
        DVec3::splat(0.8),
        DAffine3::from_translation(at),
    );
    let desk_at = DAffine3::from_translation(DVec3::new(0.12, 0.08, 0.12));
    let desk = black_box("desk", [-0.12, -0.12, 0.0], [0.12, 0.12, 0.01], desk_at);
    let caster = RayCaster::new(&triangles(&desk));
    let scene = under_sky(0, vec![desk], vec![plate]);
    let (_, role, picture) = gains(&scene, camera());
    let probe = scene.probe.as_ref().expect("a probe");
    let irradiance = exact(&probe.probe, at, DVec3::Z, &[&caster]) * probe.exposure;
    let expected = 0.8 / std::f64::consts::PI * irradiance;
    let world_at = camera().transform_point3(at);
    let pixel = CAMERA.focal_px * world_at.truncate() / world_at.z + CAMERA.center_px;
    let index = pixel.y.round() as usize * 120 + pixel.x.round() as usize;
    assert_eq!(role[index], VIRTUAL);
    let found = picture.linear(index).y;
    assert!(
        (found / expected - 1.0).abs() < 0.06,
        "{found}, not {expected}"
    );
}

#[test]
fn things_that_move_past_each_other_change_the_light_smoothly() {
    let scene_at = |step: i32| {
        let at = DVec3::new(0.03 + 0.001 * f64::from(step), -0.03, 0.04);
        let soup = sphere(0.03, 16, 24);
        let ball = flat_mesh(soup.positions, soup.triangles);
        let ball = object("ball", ball, DVec3::ZERO, DAffine3::from_translation(at));
        let mut scene = three_boxes();
        scene.virtuals.push(ball);
        scene
    };
    let (mut largest, mut worst) = (0.0_f64, (0, 0));
    let steps: Vec<(Vec<[f32; 3]>, Vec<u8>)> = (0..8)
        .map(|step| {
            let (gain, role, _) = gains(&scene_at(step), camera());
            (gain, role)
        })
        .collect();
    for (first, around) in steps.windows(3).enumerate() {
        for index in 0..around[0].0.len() {
            if around.iter().all(|(_, role)| role[index] == REAL) {
                let [before, now, after] =
                    [0, 1, 2].map(|step| f64::from(around[step].0[index][1]));
                let bend = (before - 2.0 * now + after).abs();
                if bend > largest {
                    (largest, worst) = (bend, (first as i32, index));
                }
            }
        }
    }
    // The light itself bends where a thing passes close by.
    let (first, index) = worst;
    let exact_gain = |step: i32| {
        let scene = scene_at(step);
        let probe = &scene.probe.as_ref().expect("a probe").probe;
        let [real, virtuals] = [&scene.phantoms, &scene.virtuals].map(|objects| caster(objects));
        let place = on_table(index, &camera());
        let lit = |casters: &[&RayCaster]| exact(probe, place, DVec3::Z, casters);
        lit(&[&real, &virtuals]) / lit(&[&real])
    };
    let [before, now, after] = [0, 1, 2].map(|step| exact_gain(first + step));
    let of_the_light = (before - 2.0 * now + after).abs();
    assert!(
        largest < 0.02 + of_the_light,
        "{largest}, of the light {of_the_light}"
    );
}

/// A sky, and a sun as broad as a fist that comes low over what lies at -x.
fn sky_with_sun(radiance: f32) -> Probe {
    const SIZE_PX: [usize; 2] = [160, 80];
    let grid = Probe::new(SIZE_PX, vec![Vec3::ZERO; SIZE_PX[0] * SIZE_PX[1]]).expect("pixels");
    let sun = DVec3::new(
        -(40.0_f64.to_radians().cos()),
        0.0,
        40.0_f64.to_radians().sin(),
    );
    let pixel = |index: usize| {
        let (column, row) = (index % SIZE_PX[0], index / SIZE_PX[0]);
        let direction = grid.direction(column as f64 + 0.5, row as f64 + 0.5);
        let is_sun = direction.angle_between(sun) < 5.0_f64.to_radians();
        Vec3::splat(if is_sun { radiance } else { 0.4 })
    };
    let pixels = (0..SIZE_PX[0] * SIZE_PX[1]).map(pixel);
    Probe::new(SIZE_PX, pixels.collect()).expect("pixels")
}

/// Rays from the table end on a bright box that stands in a wall's shadow; none of the wall's sun goes on from there.
#[test]
fn a_broad_sun_that_a_real_wall_hides_is_thrown_on_by_nothing_behind_it() {
    let wall = black_box(
        "wall",
        [-0.06, -0.09, 0.0],
        [-0.04, 0.09, 0.15],
        DAffine3::IDENTITY,
    );
    let soup = cuboid([0.025, -0.03, 0.0], [0.06, 0.03, 0.03]);
    let mesh = flat_mesh(soup.positions, soup.triangles);
    let bright = object("box", mesh, DVec3::splat(0.8), DAffine3::IDENTITY);
    let gain_under = |radiance: f32| {
        let mut scene = under_sky(0, vec![wall.clone()], vec![bright.clone()]);
        scene.probe = Some(probe_scene(sky_with_sun(radiance)));
        let (gain, role, _) = gains(&scene, camera());
        (gain, role)
    };
    let (with_sun, role) = gain_under(60.0);
    let (without, _) = gain_under(0.4);
    let mut off = Vec::new();
    for index in 0..role.len() {
        let place = on_table(index, &camera());
        // Amid the shadow, off the wall's foot.
        let is_between = (-0.025..0.02).contains(&place.x) && place.y.abs() < 0.04;
        if role[index] == REAL && is_between && with_sun[index][1] != 1.0 {
            off.push(f64::from(with_sun[index][1] - without[index][1]));
        }
    }
    let mean = off.iter().sum::<f64>() / off.len() as f64;
    let largest = off.iter().fold(0.0, |most, off| f64::max(most, off.abs()));
    // (What few rays tell of the sky differs a little where there is a sun in it.)
    assert!(
        off.len() > 40 && mean.abs() < 0.02 && largest < 0.1,
        "{} places: {mean:.4} on the average, {largest:.4} at most",
        off.len()
    );
}
