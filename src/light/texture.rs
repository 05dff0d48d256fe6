//! Decoded pictures that lie on surfaces, and what they say at a place: the CPU twin of materials.wgsl.

use std::ops::{Add, Mul};

use glam::{DVec2, DVec4, Vec2};

use super::material::{Encoding, Filter, Map, Wrap};
use super::srgb::linear_from_srgb;

/// A decoded picture: RGBA of eight bits, alpha not multiplied in, rows from the top.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Texture {
    /// What messages call it: its file's name, or its number in the file.
    pub name: String,
    /// Width and height, at least 1.
    pub size_px: [u32; 2],
    /// Four bytes a texel.
    pub rgba: Vec<u8>,
}

impl Texture {
    /// The texel of a column and a row, linear in [0, 1].
    ///
    /// # Panics
    /// Beyond the picture.
    pub fn texel(&self, [column, row]: [u32; 2], encoding: Encoding) -> DVec4 {
        let first = 4 * (row as usize * self.size_px[0] as usize + column as usize);
        let [r, g, b, a] = [0, 1, 2, 3].map(|channel| self.rgba[first + channel]);
        let linear = |byte: u8| match encoding {
            Encoding::Srgb => linear_from_srgb(f64::from(byte) / 255.0),
            Encoding::Linear => f64::from(byte) / 255.0,
        };
        DVec4::new(linear(r), linear(g), linear(b), f64::from(a) / 255.0)
    }

    /// What lies at a corner's texture coordinates, between the four texels around it, linear.
    pub fn sample(&self, map: &Map, uv: Vec2, encoding: Encoding) -> DVec4 {
        map.sample(self.size_px, uv, |texel| self.texel(texel, encoding))
    }

    /// Memory that its texels take, bytes.
    pub fn bytes(&self) -> usize {
        self.rgba.len()
    }
}

impl Map {
    /// What lies at a corner's texture coordinates in a picture of some width and height, texels; `texel` has what is at a
    /// column and a row. Where the coordinates are no numbers it is the first.
    pub fn sample<T>(&self, [width, height]: [u32; 2], uv: Vec2, texel: impl Fn([u32; 2]) -> T) -> T
    where
        T: Add<Output = T> + Mul<f64, Output = T>,
    {
        let size = DVec2::new(f64::from(width), f64::from(height));
        let place = self.picture_from_corner.transform_point2(uv).as_dvec2() * size;
        if !place.is_finite() {
            return texel([0, 0]);
        }
        let texel = |column: f64, row: f64| {
            let column = wrapped(column, width, self.wrap[0]);
            texel([column, wrapped(row, height, self.wrap[1])])
        };
        if self.filter == Filter::Pixels {
            return texel(place.x.floor(), place.y.floor());
        }
        let low = (place - 0.5).floor();
        let share = place - 0.5 - low;
        let row =
            |row: f64| texel(low.x, row) * (1.0 - share.x) + texel(low.x + 1.0, row) * share.x;
        row(low.y) * (1.0 - share.y) + row(low.y + 1.0) * share.y
    }
}

/// The number of a texel that stands at a place along one side.
fn wrapped(place: f64, count: u32, wrap: Wrap) -> u32 {
    let length = f64::from(count);
    let inside = match wrap {
        Wrap::Repeat => place.rem_euclid(length),
        Wrap::Clamp => place.clamp(0.0, length - 1.0),
        Wrap::Mirror => {
            let twice = place.rem_euclid(2.0 * length);
            twice.min(2.0 * length - 1.0 - twice)
        }
    };
    (inside as u32).min(count - 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Affine2;

    /// Two texels wide: black and white, half transparent.
    fn two() -> Texture {
        Texture {
            name: "two".to_owned(),
            size_px: [2, 1],
            rgba: vec![0, 0, 0, 255, 255, 255, 255, 0],
        }
    }

    #[test]
    fn a_place_is_between_its_texels() {
        let texture = two();
        let red = |map: &Map, u: f32| texture.sample(map, Vec2::new(u, 0.5), Encoding::Srgb).x;
        let map = Map::of(0);
        for (u, expected) in [
            (0.25, 0.0),
            (0.75, 1.0),
            (0.5, 0.5),
            (0.0, 0.5),
            (1.25, 0.0),
        ] {
            assert!((red(&map, u) - expected).abs() < 1e-9, "{u}");
        }
        let clamped = Map {
            wrap: [Wrap::Clamp; 2],
            ..map
        };
        assert_eq!([red(&clamped, 0.0), red(&clamped, 7.0)], [0.0, 1.0]);
        let mirrored = Map {
            wrap: [Wrap::Mirror; 2],
            ..map
        };
        assert_eq!([red(&mirrored, 1.25), red(&mirrored, 1.75)], [1.0, 0.0]);
        assert_eq!([red(&mirrored, -0.25), red(&mirrored, -0.75)], [0.0, 1.0]);
        let pixels = Map {
            filter: Filter::Pixels,
            ..map
        };
        assert_eq!([red(&pixels, 0.49), red(&pixels, 0.51)], [0.0, 1.0]);
        let moved = Map {
            picture_from_corner: Affine2::from_translation(Vec2::new(0.5, 0.0)),
            ..map
        };
        assert_eq!(red(&moved, 0.25), 1.0);
        let nowhere = texture.sample(&map, Vec2::NAN, Encoding::Srgb);
        assert!(nowhere.is_finite());
    }

    #[test]
    fn bytes_mean_what_their_use_says() {
        let grey = Texture {
            name: "grey".to_owned(),
            size_px: [1, 1],
            rgba: vec![188; 4],
        };
        let texel = |encoding| grey.texel([0, 0], encoding);
        assert!((texel(Encoding::Srgb).x - 0.5029).abs() < 1e-4);
        assert!((texel(Encoding::Srgb).w - 188.0 / 255.0).abs() < 1e-12);
        assert!((texel(Encoding::Linear).x - 188.0 / 255.0).abs() < 1e-12);
    }
}
