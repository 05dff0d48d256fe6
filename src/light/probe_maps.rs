//! Light probes from pictures in other projections: angular maps, mirror balls, panoramas.
//!
//! A picture's directions are first those of the camera that looked along its middle (x right, y down, z forward); a
//! rotation then brings them into the world.

use std::f64::consts::{PI, TAU};

use glam::{DMat3, DVec2, DVec3, Vec3};
use rayon::prelude::*;

use super::probe::Probe;
use super::radiance_picture::RadiancePicture;

/// Samples a source pixel's width gets at least.
const SAMPLES_A_PIXEL: f64 = 3.0;
/// Samples a side of one pixel of the probe: where an angular map's rim is all one direction, more add nothing.
const MOST_SAMPLES: usize = 48;
/// The outermost pixels of a ball show its surroundings too.
const BALL_RIM_PX: f64 = 1.5;

/// Which place of a picture shows which direction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Projection {
    /// A panorama as seen from inside: the middle column looks forward, columns to the right of it further right.
    Panorama,
    /// Debevec's angular map in a circle: its middle looks forward, its rim backward.
    Angular(Circle),
    /// A mirror ball whose outline is a circle, whose middle shows the camera.
    Ball {
        /// Its outline.
        circle: Circle,
        /// From the camera to the ball's centre, in the ball's radii (> 1); infinite: an orthographic camera.
        distance_radii: f64,
    },
}

/// A circle in a picture, in pixels from the picture's upper left corner.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Circle {
    /// Pixels from the left and from the top.
    pub center_px: DVec2,
    /// Pixels.
    pub radius_px: f64,
}

impl Circle {
    /// The greatest one in the middle of a picture.
    pub fn inscribed(size_px: [usize; 2]) -> Self {
        let size_px = DVec2::from(size_px.map(|side| side as f64));
        Self {
            center_px: 0.5 * size_px,
            radius_px: 0.5 * size_px.min_element(),
        }
    }
}

/// A probe and what its picture did not show.
#[derive(Debug, Clone, PartialEq)]
pub struct Unwrapped {
    /// All directions, those that the picture does not show filled in from around them.
    pub probe: Probe,
    /// Part of the sphere that was filled in.
    pub blind_share: f64,
}

/// World directions of a camera that was turned to the left from looking along +y (x to its right), then tilted
/// downward, then rolled clockwise; radians.
pub fn world_from_camera(turn: f64, tilt: f64, roll: f64) -> DMat3 {
    let level = DMat3::from_cols(DVec3::X, DVec3::NEG_Z, DVec3::Y);
    DMat3::from_rotation_z(turn)
        * level
        * DMat3::from_rotation_x(-tilt)
        * DMat3::from_rotation_z(roll)
}

/// Columns of a probe that are about as fine as the picture, an even number.
pub fn fitting_width_px(projection: Projection, picture_px: [usize; 2]) -> usize {
    let width_px = match projection {
        Projection::Panorama => picture_px[0] as f64,
        Projection::Angular(circle) => 2.0 * circle.radius_px,
        Projection::Ball { circle, .. } => PI * circle.radius_px,
    };
    2 * (0.5 * width_px).ceil() as usize
}

/// Resamples a picture into a probe of `width_px` columns and half as many rows: each pixel gets the mean radiance of its
/// solid angle, so that a light that is smaller than a pixel keeps its power.
///
/// `None` where the picture shows no direction at all, or `width_px` is below 2.
pub fn unwrap(
    picture: &RadiancePicture,
    projection: Projection,
    world_from_camera: DMat3,
    width_px: usize,
) -> Option<Unwrapped> {
    let size_px = [width_px, width_px / 2];
    let grid = Probe::new(size_px, vec![Vec3::ZERO; size_px[0] * size_px[1]])?;
    let camera_from_world = world_from_camera.transpose();
    let place =
        |direction: DVec3| place_px(projection, picture.size_px(), camera_from_world * direction);
    let mean = |index: usize| {
        let (column, row) = ((index % width_px) as f64, (index / width_px) as f64);
        let corners_px = [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)]
            .map(|(right, down)| place(grid.direction(column + right, row + down)));
        let samples = samples_a_side(projection, picture.size_px(), corners_px);
        let mut sum = Vec3::ZERO;
        let mut seen = 0;
        for down in 0..samples {
            // Rows of equal solid angle.
            let part = (down as f64 + 0.5) / samples as f64;
            let cosine = |row: f64| (row / size_px[1] as f64 * PI).cos();
            let z = cosine(row) * (1.0 - part) + cosine(row + 1.0) * part;
            let level = (1.0 - z * z).max(0.0).sqrt();
            for right in 0..samples {
                let column = column + (right as f64 + 0.5) / samples as f64;
                let azimuth = column / width_px as f64 * TAU - PI;
                let direction = DVec3::new(level * azimuth.cos(), level * azimuth.sin(), z);
                let found =
                    place(direction).and_then(|place_px| sample(picture, projection, place_px));
                if let Some(found) = found {
                    sum += found;
                    seen += 1;
                }
            }
        }
        (2 * seen >= samples * samples).then(|| sum / seen as f32)
    };
    let pixels = (0..grid.pixels().len()).into_par_iter();
    let radiance: Vec<_> = pixels.map(mean).collect();
    fill_in(&grid, &radiance)
}

fn samples_a_side(
    projection: Projection,
    picture_px: [usize; 2],
    corners_px: [Option<DVec2>; 4],
) -> usize {
    let mut extent_px: f64 = 0.0;
    for (index, a) in corners_px.iter().enumerate() {
        for b in &corners_px[..index] {
            let (Some(a), Some(b)) = (a, b) else {
                return MOST_SAMPLES / 4;
            };
            let mut between_px = (*a - *b).abs();
            if projection == Projection::Panorama {
                between_px.x = between_px.x.min(picture_px[0] as f64 - between_px.x);
            }
            extent_px = extent_px.max(between_px.max_element());
        }
    }
    ((SAMPLES_A_PIXEL * extent_px).ceil() as usize).clamp(2, MOST_SAMPLES)
}

/// Where a picture shows a direction (camera space), in pixels from its upper left corner; `None` where it does not.
fn place_px(projection: Projection, picture_px: [usize; 2], direction: DVec3) -> Option<DVec2> {
    let across = direction.truncate().normalize_or(DVec2::X);
    let from_forward = direction.truncate().length().atan2(direction.z);
    match projection {
        Projection::Panorama => {
            let size_px = DVec2::from(picture_px.map(|side| side as f64));
            let down = direction.truncate().y.atan2(direction.x.hypot(direction.z));
            let turned = DVec2::new(direction.x.atan2(direction.z) / TAU, down / PI);
            Some((turned + 0.5) * size_px)
        }
        Projection::Angular(circle) => {
            Some(circle.center_px + across * (circle.radius_px * from_forward / PI))
        }
        Projection::Ball {
            circle,
            distance_radii,
        } => {
            let from_camera = PI - from_forward;
            let radius_px = circle.radius_px * ball_radius(from_camera, distance_radii)?;
            (radius_px <= circle.radius_px - BALL_RIM_PX)
                .then(|| circle.center_px + across * radius_px)
        }
    }
}

/// Distance from the middle of a ball's picture, in radii of its outline, at which it reflects what lies at an angle from
/// the direction towards the camera; `None` where the ball hides that.
fn ball_radius(from_camera: f64, distance_radii: f64) -> Option<f64> {
    let inverse = 1.0 / distance_radii;
    let limb = inverse.acos();
    if from_camera > 2.0 * limb + inverse.asin() {
        return None;
    }
    // A ray that leaves the axis by β meets the ball where its normal is turned by θ and goes on at 2θ + β, with
    // tan β = sin θ / (d - cos θ).
    let leaving = |normal: f64| (inverse * normal.sin()).atan2(1.0 - inverse * normal.cos());
    let (mut low, mut high) = (0.0, limb);
    let mut normal = 0.5 * from_camera.min(2.0 * limb);
    for _ in 0..60 {
        let beyond = 2.0 * normal + leaving(normal) - from_camera;
        if beyond.abs() < 1e-12 {
            break;
        }
        if beyond > 0.0 {
            high = normal;
        } else {
            low = normal;
        }
        // dβ/dθ = (d cos θ - 1) / (d² + 1 - 2 d cos θ)
        let (cosine, squared) = (normal.cos(), inverse * inverse);
        let slope = 2.0 + (inverse * cosine - squared) / (1.0 + squared - 2.0 * inverse * cosine);
        let newton = normal - beyond / slope;
        normal = if low < newton && newton < high {
            newton
        } else {
            0.5 * (low + high)
        };
    }
    // tan β over its value at the limb, where it is 1 / √(d² - 1).
    Some(normal.sin() * limb.sin() / (1.0 - inverse * normal.cos()))
}

fn sample(picture: &RadiancePicture, projection: Projection, place_px: DVec2) -> Option<Vec3> {
    match projection {
        Projection::Panorama => picture.between(place_px, true, |_| true),
        Projection::Angular(circle) | Projection::Ball { circle, .. } => {
            picture.between(place_px, false, |center_px| {
                center_px.distance_squared(circle.center_px) <= circle.radius_px * circle.radius_px
            })
        }
    }
}

/// Gives blind pixels the mean of those around the hole, weighted by their inverse squared distance.
fn fill_in(grid: &Probe, radiance: &[Option<Vec3>]) -> Option<Unwrapped> {
    let [width, height] = grid.size_px();
    let center =
        |index: usize| grid.direction((index % width) as f64 + 0.5, (index / width) as f64 + 0.5);
    let beside_a_hole = |index: usize| {
        let (column, row) = (index % width, index / width);
        let mut beside = vec![
            row * width + (column + 1) % width,
            row * width + (column + width - 1) % width,
        ];
        beside.extend((row > 0).then(|| index - width));
        beside.extend((row + 1 < height).then(|| index + width));
        beside.iter().any(|&index| radiance[index].is_none())
    };
    let rim: Vec<(DVec3, f64, Vec3)> = radiance
        .iter()
        .enumerate()
        .filter_map(|(index, seen)| {
            let seen = (*seen)?;
            beside_a_hole(index)
                .then(|| (center(index), grid.pixel_solid_angle(index / width), seen))
        })
        .collect();
    if radiance.iter().all(Option::is_none) {
        return None;
    }
    let mut blind = 0.0;
    let filled = radiance
        .iter()
        .enumerate()
        .map(|(index, seen)| {
            seen.unwrap_or_else(|| {
                blind += grid.pixel_solid_angle(index / width);
                let at = center(index);
                let (mut sum, mut weights) = (DVec3::ZERO, 0.0);
                for (direction, solid_angle, seen) in &rim {
                    let weight = solid_angle / at.distance_squared(*direction).max(1e-12);
                    sum += weight * seen.as_dvec3();
                    weights += weight;
                }
                (sum / weights).as_vec3()
            })
        })
        .collect();
    Some(Unwrapped {
        probe: Probe::new(grid.size_px(), filled)?,
        blind_share: blind / (4.0 * PI),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIDE_PX: usize = 256;

    /// What a picture of a known environment shows, each pixel its middle's radiance; black where it shows none.
    fn picture_of(
        projection: Projection,
        size_px: [usize; 2],
        radiance: impl Fn(DVec3) -> f64,
    ) -> RadiancePicture {
        let pixels = (0..size_px[0] * size_px[1])
            .map(|index| {
                let place_px = DVec2::new(
                    (index % size_px[0]) as f64 + 0.5,
                    (index / size_px[0]) as f64 + 0.5,
                );
                let shown = direction_shown(projection, size_px, place_px);
                Vec3::splat(shown.map_or(0.0, &radiance) as f32)
            })
            .collect();
        RadiancePicture::new(size_px, pixels).unwrap()
    }

    /// The other way round than `place_px`, by the closed forms of each projection; camera space.
    fn direction_shown(
        projection: Projection,
        size_px: [usize; 2],
        place_px: DVec2,
    ) -> Option<DVec3> {
        match projection {
            Projection::Panorama => {
                let turned = place_px / DVec2::from(size_px.map(|side| side as f64)) - 0.5;
                let (right, down) = (turned.x * TAU, turned.y * PI);
                Some(DVec3::new(
                    down.cos() * right.sin(),
                    down.sin(),
                    down.cos() * right.cos(),
                ))
            }
            Projection::Angular(circle) => {
                let off = (place_px - circle.center_px) / circle.radius_px;
                let (sine, cosine) = (PI * off.length()).sin_cos();
                (off.length() <= 1.0).then(|| (off.normalize_or_zero() * sine).extend(cosine))
            }
            Projection::Ball {
                circle,
                distance_radii,
            } => {
                // Ray tracing: from the camera to the sphere, and mirrored there.
                let off = (place_px - circle.center_px) / circle.radius_px;
                let (origin, ray) = if distance_radii.is_finite() {
                    let limb = 1.0 / (distance_radii * distance_radii - 1.0).sqrt();
                    (
                        DVec3::new(0.0, 0.0, -distance_radii),
                        (off * limb).extend(1.0).normalize(),
                    )
                } else {
                    (off.extend(-2.0), DVec3::Z)
                };
                let along = -origin.dot(ray);
                let inside = along * along - origin.length_squared() + 1.0;
                let normal = origin + (along - inside.max(0.0).sqrt()) * ray;
                (inside >= 0.0).then(|| ray - 2.0 * ray.dot(normal) * normal)
            }
        }
    }

    fn projections() -> [(Projection, [usize; 2]); 4] {
        let size_px = [SIDE_PX, SIDE_PX];
        let circle = Circle::inscribed(size_px);
        let off_center = Circle {
            center_px: DVec2::new(131.3, 120.8),
            radius_px: 118.4,
        };
        let ball = |circle, distance_radii| Projection::Ball {
            circle,
            distance_radii,
        };
        [
            (Projection::Panorama, [2 * SIDE_PX, SIDE_PX]),
            (Projection::Angular(circle), size_px),
            (ball(circle, f64::INFINITY), size_px),
            (ball(off_center, 4.0), size_px),
        ]
    }

    #[test]
    fn places_and_directions_agree_with_ray_tracing() {
        for (projection, size_px) in projections() {
            let mut seen = 0;
            for step in 0..2000 {
                // Halton's points.
                let place_px = DVec2::new(radical_inverse(2, step), radical_inverse(3, step))
                    * DVec2::from(size_px.map(|side| side as f64));
                let Some(direction) = direction_shown(projection, size_px, place_px) else {
                    continue;
                };
                if let Some(found_px) = super::place_px(projection, size_px, 2.0 * direction) {
                    assert!(
                        found_px.distance(place_px) < 1e-6,
                        "{projection:?} {place_px} {found_px}"
                    );
                    seen += 1;
                }
            }
            assert!(seen > 1250, "{projection:?}: {seen}");
        }
    }

    fn radical_inverse(base: u32, mut index: u32) -> f64 {
        let (mut value, mut digit) = (0.0, 1.0);
        while index > 0 {
            digit /= f64::from(base);
            value += digit * f64::from(index % base);
            index /= base;
        }
        value
    }

    fn power(probe: &Probe, weight: impl Fn(DVec3) -> f64) -> f64 {
        let [width, height] = probe.size_px();
        (0..width * height)
            .map(|index| {
                let (column, row) = (index % width, index / width);
                let direction = probe.direction(column as f64 + 0.5, row as f64 + 0.5);
                weight(direction)
                    * f64::from(probe.pixels()[index].x)
                    * probe.pixel_solid_angle(row)
            })
            .sum()
    }

    #[test]
    fn a_smooth_environment_comes_back_with_its_irradiance() {
        let camera = world_from_camera(0.7, 0.3, -0.2);
        let environment =
            |direction: DVec3| 1.0 + 0.5 * direction.z + 0.25 * direction.x * direction.y;
        for (projection, size_px) in projections() {
            let picture = picture_of(projection, size_px, |direction| {
                environment(camera * direction)
            });
            let unwrapped = unwrap(&picture, projection, camera, 128).unwrap();
            let probe = &unwrapped.probe;
            // The rim's normal, and where it reflects to: what lies behind that is not seen.
            let hole = match projection {
                Projection::Ball { circle, .. } => {
                    let radius = 1.0 - BALL_RIM_PX / circle.radius_px;
                    let side = direction_shown(
                        projection,
                        size_px,
                        circle.center_px + DVec2::new(radius * circle.radius_px, 0.0),
                    );
                    side.expect("inside the outline").z.acos()
                }
                _ => 0.0,
            };
            let blind_share = 0.5 * (1.0 - hole.cos());
            assert!(
                (unwrapped.blind_share - blind_share).abs() < 2e-3,
                "{projection:?} {}",
                unwrapped.blind_share
            );
            let irradiance = power(probe, |direction| direction.z.max(0.0));
            // ∫ (1 + z/2) z over the upper half: π + π/3
            let relative = irradiance / (PI + PI / 3.0) - 1.0;
            assert!(relative.abs() < 2e-3, "{projection:?} {relative}");
            for step in 0..500 {
                let (z, azimuth) = (
                    2.0 * radical_inverse(2, step) - 1.0,
                    TAU * radical_inverse(3, step),
                );
                let direction = DVec3::new(
                    azimuth.cos() * (1.0 - z * z).sqrt(),
                    azimuth.sin() * (1.0 - z * z).sqrt(),
                    z,
                );
                let off = f64::from(probe.radiance(direction).x) - environment(direction);
                // The probe's own pixels are 3 degrees wide; the hole is filled from its rim.
                let in_hole = (camera.transpose() * direction).z > 0.9;
                assert!(
                    off.abs() < if in_hole { 0.2 } else { 0.04 },
                    "{projection:?} {direction} {off}"
                );
            }
        }
    }

    #[test]
    fn a_light_of_one_pixel_lands_where_it_belongs_with_its_power() {
        let camera = world_from_camera(-1.1, 0.4, 0.1);
        for (projection, size_px) in projections() {
            for (column, row) in [(100, 90), (150, 140), (128, 60), (70, 128)] {
                let mut pixels = vec![Vec3::ZERO; size_px[0] * size_px[1]];
                pixels[row * size_px[0] + column] = Vec3::splat(5e4);
                let picture = RadiancePicture::new(size_px, pixels).unwrap();
                let corner = DVec2::new(column as f64, row as f64);
                let shown = |right, down| {
                    direction_shown(projection, size_px, corner + DVec2::new(right, down)).unwrap()
                };
                // The pixel's solid angle from two triangles' area, small as it is.
                let (a, b, c, d) = (
                    shown(0.0, 0.0),
                    shown(1.0, 0.0),
                    shown(1.0, 1.0),
                    shown(0.0, 1.0),
                );
                let solid_angle =
                    0.5 * ((b - a).cross(c - a).length() + (c - a).cross(d - a).length());
                for width_px in [64, 300] {
                    let probe = unwrap(&picture, projection, camera, width_px)
                        .unwrap()
                        .probe;
                    let found = power(&probe, |_| 1.0);
                    let relative = found / (5e4 * solid_angle) - 1.0;
                    assert!(
                        relative.abs() < 0.02,
                        "{projection:?} {column} {row} {width_px}: {relative}"
                    );
                    let toward = DVec3::new(
                        power(&probe, |direction| direction.x),
                        power(&probe, |direction| direction.y),
                        power(&probe, |direction| direction.z),
                    );
                    let expected = camera * shown(0.5, 0.5);
                    let off = toward.angle_between(expected);
                    assert!(
                        off < 0.6 * TAU / width_px as f64,
                        "{projection:?} {width_px}: {off}"
                    );
                }
            }
        }
    }

    #[test]
    fn turning_left_tilting_down_and_rolling_clockwise() {
        let degrees = f64::to_radians;
        let near = |a: DVec3, b: DVec3| a.distance(b) < 1e-12;
        assert!(near(world_from_camera(0.0, 0.0, 0.0) * DVec3::Z, DVec3::Y));
        assert!(near(
            world_from_camera(degrees(90.0), 0.0, 0.0) * DVec3::Z,
            DVec3::NEG_X
        ));
        assert!(near(
            world_from_camera(0.0, degrees(90.0), 0.0) * DVec3::Z,
            DVec3::NEG_Z
        ));
        // Clockwise: what was to the camera's right is then below it.
        assert!(near(
            world_from_camera(0.0, 0.0, degrees(90.0)) * DVec3::X,
            DVec3::NEG_Z
        ));
    }

    #[test]
    fn without_pixels_there_is_no_probe() {
        let picture = RadiancePicture::new([2, 2], vec![Vec3::ONE; 4]).unwrap();
        let level = world_from_camera(0.0, 0.0, 0.0);
        assert_eq!(unwrap(&picture, Projection::Panorama, level, 1), None);
        let ball = Projection::Ball {
            circle: Circle::inscribed([2, 2]),
            distance_radii: f64::INFINITY,
        };
        assert_eq!(unwrap(&picture, ball, level, 4), None);
    }
}
