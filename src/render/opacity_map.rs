//! How opaque a translucent layer is as a light sees it, place by place: what of its whole shadow is really there.

use glam::{DAffine3, DMat4, DVec2, DVec3, DVec4, Vec3};

use crate::geometry::exact_side::exact_side;
use crate::geometry::shadow_volume::LightPlace;
use crate::light::{Light, irradiance};

use super::light_piece::light_place;

/// Texels along a side.
pub(super) const SIDE: usize = 256;
/// So many texels beyond the layer are as opaque as its edge, for what is seen between texels.
const BORDER: usize = 2;
/// Nearer than this part of its size a light stands in a layer, and has it all around.
const NEAREST_PART: f64 = 1e-3;

/// A layer on a plane that the light sees.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct OpacityMap {
    /// Of each texel, rows from the top: opacity, and 255 where the light's rays meet the layer.
    pub texels: Vec<[u8; 2]>,
    /// From the layer's space to texture coordinates, homogeneous.
    map_from_layer: DMat4,
    made_for: LightPlace,
}

impl OpacityMap {
    /// Of a layer's triangles in the light of one place, in its anchor's space; `opacity` has that of a triangle's places, which come
    /// as barycentric coordinates. `None` where the light is too near, or sees it edge-on.
    pub fn new(
        positions: &[Vec3],
        triangles: &[[u32; 3]],
        opacity: impl Fn(usize, [f32; 3]) -> f64,
        light: LightPlace,
    ) -> Option<Self> {
        let plane_from_layer = plane_from_layer(positions, light)?;
        let on_plane: Vec<DVec3> = positions
            .iter()
            .map(|place| plane_place(&plane_from_layer, place.as_dvec3()))
            .collect();
        let places = || on_plane.iter().map(|place| place.truncate());
        let low = places().reduce(DVec2::min)?;
        let size = places().reduce(DVec2::max)? - low;
        if size.min_element() <= f64::MIN_POSITIVE {
            return None;
        }
        // All of it lies within the border.
        let inner = (SIDE - 2 * BORDER) as f64 / SIDE as f64;
        let scale = DVec2::splat(inner) / size;
        let shift = DVec2::splat(BORDER as f64 / SIDE as f64) - low * scale;
        let to_map = DMat4::from_cols(
            DVec4::new(scale.x, 0.0, 0.0, 0.0),
            DVec4::new(0.0, scale.y, 0.0, 0.0),
            DVec4::new(0.0, 0.0, 1.0, 0.0),
            DVec4::new(shift.x, shift.y, 0.0, 1.0),
        );
        let mut passing = vec![None; SIDE * SIDE];
        for (number, triangle) in triangles.iter().enumerate() {
            let corners = triangle.map(|corner| {
                let DVec3 { x, y, z } = on_plane[corner as usize];
                let place = (DVec2::new(x, y) * scale + shift) * SIDE as f64;
                (place, z)
            });
            draw(&mut passing, corners, |weights| opacity(number, weights));
        }
        grow(&mut passing);
        let texels = passing.iter().map(|passing| match passing {
            Some(part) => [(255.0 * (1.0 - part)).round() as u8, 255],
            None => [0, 0],
        });
        Some(Self {
            texels: texels.collect(),
            map_from_layer: to_map * plane_from_layer,
            made_for: light,
        })
    }

    /// Whether it is that of a light at a place.
    pub fn is_for(&self, light: LightPlace) -> bool {
        self.made_for == light
    }

    /// From the camera's space to texture coordinates, homogeneous, where the layer's space has a pose.
    pub fn map_from_camera(&self, camera_from_layer: &DAffine3) -> DMat4 {
        self.map_from_layer * DMat4::from(camera_from_layer.inverse())
    }
}

/// Where the light stands, in a layer's space, that gives most light to a place in the world; `None` without lights.
pub(super) fn brightest(
    lights: &[Light],
    place: DVec3,
    layer_from_world: &DAffine3,
) -> Option<LightPlace> {
    let given = |light: &Light| {
        let (towards, _) = light.way_from(place);
        irradiance(light, place, towards.normalize_or_zero()).element_sum()
    };
    let brightest = lights.iter().max_by(|a, b| given(a).total_cmp(&given(b)))?;
    Some(light_place(brightest, layer_from_world))
}

/// The way of places on to a plane across the light: x and y over w there, and the depth along the light in w.
fn plane_from_layer(positions: &[Vec3], light: LightPlace) -> Option<DMat4> {
    let count = positions.len().max(1) as f64;
    let middle = positions.iter().map(|it| it.as_dvec3()).sum::<DVec3>() / count;
    let (forward, origin) = match light {
        LightPlace::Point(place) => ((middle - place).try_normalize()?, place),
        LightPlace::Along(direction) => (direction, middle),
    };
    let (right, up) = forward.any_orthonormal_pair();
    let row = |axis: DVec3| axis.extend(-axis.dot(origin));
    let depth = match light {
        LightPlace::Point(_) => row(forward),
        LightPlace::Along(_) => DVec4::W,
    };
    let rows = DMat4::from_cols(row(right), row(up), DVec4::ZERO, depth);
    let size = positions
        .iter()
        .map(|it| it.as_dvec3().distance(middle))
        .fold(0.0, f64::max);
    let is_before = |it: &Vec3| depth.dot(it.as_dvec3().extend(1.0)) > NEAREST_PART * size;
    positions.iter().all(is_before).then(|| rows.transpose())
}

/// x and y on the plane, and 1 over the depth there.
fn plane_place(plane_from_layer: &DMat4, place: DVec3) -> DVec3 {
    let homogeneous = *plane_from_layer * place.extend(1.0);
    let inverse = 1.0 / homogeneous.w;
    DVec3::new(homogeneous.x * inverse, homogeneous.y * inverse, inverse)
}

/// Takes from what passes through texels what a triangle keeps; corners: place in texels, and 1 over the depth.
fn draw(
    passing: &mut [Option<f64>],
    corners: [(DVec2, f64); 3],
    opacity: impl Fn([f32; 3]) -> f64,
) {
    let [(a, depth_a), (b, depth_b), (c, depth_c)] = corners;
    let area = (b - a).perp_dot(c - a);
    if area == 0.0 || !area.is_finite() {
        return;
    }
    let turn = area.signum();
    let first = |low: f64| (low - 0.5).ceil().max(0.0) as usize;
    let (low, high) = (a.min(b).min(c), a.max(b).max(c));
    let last = |high: f64| ((high + 0.5).floor() as usize).min(SIDE);
    for row in first(low.y)..last(high.y) {
        for column in first(low.x)..last(high.x) {
            let place = DVec2::new(column as f64 + 0.5, row as f64 + 0.5);
            let sides = [(b, c), (c, a), (a, b)];
            if !sides
                .iter()
                .all(|&(from, to)| is_inside(from, to, turn, place))
            {
                continue;
            }
            let weights = sides.map(|(from, to)| (to - from).perp_dot(place - from) / area);
            let deep = [
                weights[0] * depth_a,
                weights[1] * depth_b,
                weights[2] * depth_c,
            ];
            let sum = deep.iter().sum::<f64>();
            let kept = opacity(deep.map(|weight| (weight / sum) as f32));
            let left = &mut passing[row * SIDE + column];
            *left = Some(left.unwrap_or(1.0) * (1.0 - kept));
        }
    }
}

/// Whether a place lies on the inner side of a triangle's edge, which is its left one where `turn` is positive. What lies on an edge
/// that two triangles share is in one of them.
fn is_inside(from: DVec2, to: DVec2, turn: f64, place: DVec2) -> bool {
    let side = exact_side(from, to, place) * turn;
    let along = (to - from) * turn;
    side > 0.0 || (side == 0.0 && (along.y > 0.0 || (along.y == 0.0 && along.x > 0.0)))
}

/// Gives texels beside the layer what passes through those of it.
fn grow(passing: &mut [Option<f64>]) {
    for _ in 0..BORDER {
        let before = passing.to_vec();
        let at = |column: usize, row: usize| {
            let is_there = column < SIDE && row < SIDE;
            is_there.then(|| before[row * SIDE + column]).flatten()
        };
        for (index, passing) in passing.iter_mut().enumerate() {
            if passing.is_some() {
                continue;
            }
            let (column, row) = (index % SIDE, index / SIDE);
            let around = (0..9).filter_map(|step| {
                at(
                    (column + step % 3).wrapping_sub(1),
                    (row + step / 3).wrapping_sub(1),
                )
            });
            let (count, sum) =
                around.fold((0.0, 0.0), |(count, sum), part| (count + 1.0, sum + part));
            *passing = (count > 0.0).then(|| sum / count);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A square of half a metre whose opacity is its x in halves of a metre.
    fn map(light: LightPlace) -> Option<OpacityMap> {
        let corners = [[0.0, 0.0], [0.5, 0.0], [0.5, 0.5], [0.0, 0.5]];
        let positions = corners.map(|[x, y]| Vec3::new(x, y, 0.0));
        let triangles = [[0, 1, 2], [0, 2, 3]];
        let opacity = |triangle: usize, weights: [f32; 3]| {
            let corners: [usize; 3] = triangles[triangle].map(|corner| corner as usize);
            let parts = corners.iter().zip(weights);
            parts
                .map(|(&corner, weight)| f64::from(2.0 * positions[corner].x * weight))
                .sum()
        };
        OpacityMap::new(&positions, &triangles, opacity, light)
    }

    /// Texture coordinates of a place in the layer's space.
    fn coordinates(map: &OpacityMap, place: DVec3) -> DVec2 {
        let homogeneous = map.map_from_layer * place.extend(1.0);
        homogeneous.truncate().truncate() / homogeneous.w
    }

    #[test]
    fn each_place_is_as_opaque_as_what_the_light_meets_there() {
        let place = DVec3::new(0.3, 0.2, 1.0);
        for light in [
            LightPlace::Point(place),
            LightPlace::Along(DVec3::new(0.3, -0.2, -0.8).normalize()),
        ] {
            let map = map(light).expect("a map");
            for on_sheet in [[0.1, 0.1], [0.25, 0.4], [0.45, 0.02]] {
                let on_sheet = DVec3::new(on_sheet[0], on_sheet[1], 0.0);
                // What lies behind is seen in the same place.
                let away = match light {
                    LightPlace::Point(light) => (on_sheet - light) * 0.7,
                    LightPlace::Along(direction) => direction,
                };
                for behind in [on_sheet, on_sheet + away] {
                    let at = coordinates(&map, behind) * SIDE as f64;
                    let [opacity, is_there] = map.texels[at.y as usize * SIDE + at.x as usize];
                    assert_eq!(is_there, 255);
                    let off = f64::from(opacity) / 255.0 - 2.0 * on_sheet.x;
                    assert!(off.abs() < 0.02, "{light:?} {on_sheet}: {off}");
                }
            }
            let aside = coordinates(&map, DVec3::new(0.6, 0.2, 0.0));
            assert!(
                aside.min_element() < 0.0 || aside.max_element() > 1.0,
                "{aside}"
            );
        }
        let within = LightPlace::Point(DVec3::new(0.2, 0.2, 0.0));
        assert_eq!(map(within), None);
    }
}
