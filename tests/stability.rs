//! Shadow masks held against ray casts in double precision, row by row (`tests/stability/README.md`): at most 0.02 %
//! wrong pixels, and none of them farther than 1.5 px from an edge.

mod common;

use common::ray_cast::{self, FACES_AWAY, Seen, VIRTUAL_HIDES};
use common::{StabilityRow, gpu, project_file, stability_row};
use gnomon::capture::Frame;
use gnomon::render::{Renderer, Shown};

/// Wrong pixels in percent of the phantom pixels that face the light, and how many of them are no edge pixels.
#[derive(Debug)]
struct Error {
    wrong_pct: f64,
    far: usize,
}

fn error_of(exact: &[Seen], found: impl Fn(usize) -> bool, size_px: [u32; 2]) -> Error {
    let counted = |seen: &Seen| seen.role == 100 && seen.bits & FACES_AWAY == 0;
    let pixels = exact.iter().filter(|seen| counted(seen)).count();
    let wrong: Vec<usize> = (0..exact.len())
        .filter(|&index| {
            counted(&exact[index]) && (exact[index].bits & VIRTUAL_HIDES != 0) != found(index)
        })
        .collect();
    // An edge lies between two neighbours that differ; 1.5 px reach to all pixels around it.
    let [width, height] = size_px.map(i64::from);
    let value = |x: i64, y: i64| {
        ((0..width).contains(&x) && (0..height).contains(&y))
            .then(|| exact[(y * width + x) as usize])
    };
    let around =
        |x: i64, y: i64| (-1..=1).flat_map(move |dy| (-1..=1).map(move |dx| (x + dx, y + dy)));
    let is_edge = |(x, y): (i64, i64)| {
        around(x, y).any(|(p, q)| value(p, q).is_some_and(|v| Some(v) != value(x, y)))
    };
    let far = wrong
        .iter()
        .filter(|&&index| !around(index as i64 % width, index as i64 / width).any(is_edge))
        .count();
    Error {
        wrong_pct: 100.0 * wrong.len() as f64 / pixels.max(1) as f64,
        far,
    }
}

/// The shadow bits of the first light as the renderer counts them.
fn rendered_bits(row: &StabilityRow) -> Vec<u8> {
    let mut renderer = Renderer::new(gpu(), &row.scene, row.intrinsics).expect("a renderer");
    let size_px = row.intrinsics.size_px;
    let rgba = vec![128; (4 * size_px[0] * size_px[1]) as usize];
    renderer
        .upload(&Frame {
            index: 0,
            time_secs: 0.0,
            size_px,
            rgba,
        })
        .expect("an uploaded frame");
    renderer.draw(&[Some(row.camera_from_world)], Shown::Composite);
    renderer.read_picture().expect("a picture");
    renderer.layers().expect("layers").shadow.swap_remove(0)
}

fn hold(name: &str) {
    let row = stability_row(&project_file("tests/stability"), name);
    let exact = ray_cast::cast(&row.scene, &row.intrinsics, &row.camera_from_world, 0.0);
    let bits = rendered_bits(&row);
    let error = error_of(
        &exact,
        |index| bits[index] & VIRTUAL_HIDES != 0,
        row.intrinsics.size_px,
    );
    assert!(
        error.wrong_pct <= 0.02 && error.far == 0,
        "{name}: {error:?}"
    );

    // The oracle itself: an independent renderer's mask, whose shadow rays start 0.1 mm above the surface.
    let lifted = ray_cast::cast(&row.scene, &row.intrinsics, &row.camera_from_world, 1e-4);
    let theirs = error_of(
        &lifted,
        |index| row.exact[index] >> 2 & VIRTUAL_HIDES != 0,
        row.intrinsics.size_px,
    );
    let unlifted = error_of(
        &exact,
        |index| row.exact[index] >> 2 & VIRTUAL_HIDES != 0,
        row.intrinsics.size_px,
    );
    eprintln!(
        "{name}: ours {error:?}, the other renderer {unlifted:?}, with rays lifted {theirs:?}"
    );
    assert!(
        theirs.wrong_pct <= 0.02,
        "{name}: the oracle disagrees with the independent mask: {theirs:?}"
    );
}

#[test]
fn plain() {
    hold("base");
}

#[test]
fn camera_inside_a_volume() {
    hold("cam_inside");
}

#[test]
fn near_plane_through_the_wall_of_a_volume() {
    hold("cam_edge");
}

#[test]
fn light_close_to_its_caster() {
    hold("light_near");
}

#[test]
fn grazing_light() {
    hold("light_grazing");
}

#[test]
fn caster_that_dips_under_the_table() {
    hold("touching_table");
}

#[test]
fn virtual_shadow_on_a_real_one() {
    hold("double_shadow");
}
