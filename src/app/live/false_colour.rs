//! Pictures of what a renderer knows of its frame besides the picture, for the eye.

use glam::Vec3;

use crate::light::srgb::srgb_level;
use crate::render::Layers;

/// Role of a phantom's surface in [`Layers::role`].
const REAL: u8 = 100;
/// How much of a phantom's colour covers the video.
const PHANTOM_COVER: f32 = 0.7;

/// Colours of 0, 1, 2, … volumes; more have the last one.
const COUNT_COLOURS: [[u8; 3]; 7] = [
    [40, 44, 52],
    [58, 110, 165],
    [66, 170, 140],
    [170, 200, 70],
    [240, 180, 50],
    [235, 110, 50],
    [200, 40, 60],
];

/// Stencil counts as colours, and black where nothing is modelled.
pub fn counts(counts: &[u8], role: &[u8]) -> Vec<u8> {
    let colour = |(&count, &role): (&u8, &u8)| match role {
        0 => [0, 0, 0],
        _ => COUNT_COLOURS[usize::from(count).min(COUNT_COLOURS.len() - 1)],
    };
    opaque(counts.iter().zip(role).map(colour))
}

/// Depth from warm (near) to cold (far) between the nearest and the farthest surface; black where there is none.
pub fn depth(depth_m: &[f32]) -> Vec<u8> {
    let seen = || depth_m.iter().copied().filter(|depth_m| *depth_m > 0.0);
    let near_m = seen().fold(f32::INFINITY, f32::min);
    let far_m = seen().fold(0.0, f32::max);
    let span_m = (far_m - near_m).max(1e-6);
    opaque(depth_m.iter().map(|&depth_m| {
        if depth_m <= 0.0 {
            return [0, 0, 0];
        }
        let farness = (depth_m - near_m) / span_m;
        // Contours every twentieth of the span make shapes readable.
        let shade = if (farness * 20.0).fract() < 0.5 {
            1.0
        } else {
            0.85
        };
        ramp(farness).map(|level| (level * shade * 255.0).round() as u8)
    }))
}

/// The factor on the video's light as it is: white where nothing is taken away.
pub fn gain(gain: &[[f32; 3]]) -> Vec<u8> {
    opaque(gain.iter().map(|factors| factors.map(srgb_level)))
}

/// Phantoms over the video, shaded by how they face the camera.
pub fn phantoms(video: &[u8], layers: &Layers, size_px: [u32; 2], focal_px: f32) -> Vec<u8> {
    let [width, height] = size_px.map(|side| side as usize);
    let point = |x: usize, y: usize| {
        let depth_m = layers.depth_m[y * width + x];
        let across = |pixel: usize, side: usize| (pixel as f32 - side as f32 / 2.0) / focal_px;
        Vec3::new(across(x, width), across(y, height), 1.0) * depth_m
    };
    let mut pixels = Vec::with_capacity(4 * width * height);
    for (index, video) in video.as_chunks::<4>().0.iter().enumerate() {
        let (x, y) = (index % width, index / width);
        if layers.role[index] != REAL || x + 1 == width || y + 1 == height {
            pixels.extend(video);
            continue;
        }
        let here = point(x, y);
        let normal = (point(x + 1, y) - here)
            .cross(point(x, y + 1) - here)
            .normalize_or_zero();
        // Three directions, so that no two faces of a box look alike.
        let shades = [
            normal.dot(Vec3::new(-0.6, -0.5, 0.62)),
            normal.dot(Vec3::new(0.1, -0.6, 0.79)),
            normal.dot(Vec3::new(0.6, 0.2, 0.77)),
        ];
        for (channel, shade) in shades.iter().enumerate() {
            let level = 255.0 * (0.3 + 0.7 * shade.abs().min(1.0));
            let mixed = level * PHANTOM_COVER + f32::from(video[channel]) * (1.0 - PHANTOM_COVER);
            pixels.push(mixed.round() as u8);
        }
        pixels.push(255);
    }
    pixels
}

/// From warm over green to cold, 0 to 1.
fn ramp(part: f32) -> [f32; 3] {
    let bump = |middle: f32| (1.5 - (4.0 * part - middle).abs()).clamp(0.0, 1.0);
    [
        bump(1.0).max(if part < 0.25 { 1.0 } else { 0.0 }),
        bump(2.0),
        bump(3.0),
    ]
}

fn opaque(colours: impl Iterator<Item = [u8; 3]>) -> Vec<u8> {
    colours.flat_map(|[r, g, b]| [r, g, b, 255]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_picture_says_what_it_stands_for() {
        let counted = counts(&[0, 1, 200, 3], &[100, 200, 100, 0]);
        let colours: Vec<&[u8]> = counted.chunks(4).map(|pixel| &pixel[..3]).collect();
        assert_eq!(
            colours,
            [
                &COUNT_COLOURS[0][..],
                &COUNT_COLOURS[1],
                &COUNT_COLOURS[6],
                &[0, 0, 0]
            ]
        );
        let deep = depth(&[0.0, 1.0, 3.0]);
        assert_eq!(deep[..3], [0, 0, 0]);
        assert!(deep[4] > deep[6] && deep[8] < deep[10], "{deep:?}");
        assert_eq!(gain(&[[1.0, 0.5, 0.0]])[..], [255, 188, 0, 255]);
        assert_eq!(depth(&[0.0]), [0, 0, 0, 255], "nothing is seen");
    }

    #[test]
    fn phantoms_cover_the_video_only_where_they_are() {
        let layers = Layers {
            role: vec![0, 100, 200, 100, 100, 100, 0, 0, 0],
            depth_m: vec![0.0, 1.0, 1.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0],
            shadow: Vec::new(),
            gain: Vec::new(),
        };
        let video = [10, 20, 30, 255].repeat(9);
        let covered = phantoms(&video, &layers, [3, 3], 100.0);
        let changed: Vec<usize> = (0..9)
            .filter(|pixel| covered[4 * pixel..4 * pixel + 4] != video[4 * pixel..4 * pixel + 4])
            .collect();
        // The last column and row have no neighbours to tell a normal from.
        assert_eq!(changed, [1, 3, 4]);
    }
}
