//! Cuts a model's triangles along the edges of their opacity, so that its shape itself ends where its pictures say: it is seen
//! so, and casts such shadows, whatever draws it.

use std::collections::HashMap;
use std::path::Path;

use glam::{DVec2, Vec2};

use super::error::SceneError;
use super::raw_model::RawModel;
use crate::geometry::mesh::CornerLook;
use crate::geometry::region_cut::{Extent, Region, cut};
use crate::light::Material;
use crate::light::material::{Coverage, Filter, Map, Wrap};
use crate::light::texture::Texture;

/// Pieces beyond the triangles that the file has: noise in a small picture has more edges than any leaf.
const MOST_PIECES: usize = 300_000;

/// Positions that are made by cutting have numbers of their own from here on among those that move.
const FIRST_OF_CUTS: u32 = 1 << 31;

/// What has less opacity than this is left out of what lets light through: nobody sees it, and what is all clear beside leaves
/// or letters would count for their shadow.
const CLEAR: f64 = 0.02;

/// Cuts out what masks say, whose materials are opaque from then on, and what is clear.
///
/// # Errors
/// Masks that leave nothing.
pub fn cut_masks(model: &mut RawModel, path: &Path) -> Result<(), SceneError> {
    let masks = masks_of(model);
    if masks.is_empty() {
        return Ok(());
    }
    give_looks(model);
    let region_of = |material: u32| masks.get(&material).map(|mask| mask as &dyn Region);
    let most = model.triangles.len() + MOST_PIECES;
    let together = model.motion.as_ref().map(|motion| &motion.together[..]);
    let cut = cut(
        (&model.positions, together.unwrap_or_default()),
        &model.triangles,
        &model.looks,
        region_of,
        most,
    );
    let has_masks = || (model.materials.iter()).any(|given| is_mask(&given.material));
    if cut.triangles.is_empty() && !has_masks() {
        return Ok(());
    }
    if cut.triangles.is_empty() && !model.triangles.is_empty() {
        let message =
            "its masks (alphaMode MASK, map_d) cut out all of it; nothing is left to be seen";
        return Err(SceneError::of_file(path, message));
    }
    if cut.is_coarse {
        let message =
            "its masks have too many edges to be cut out texel by texel; they are cut coarsely";
        model.notes.add_of(path, message);
    }
    drop(masks);
    if let Some(motion) = &mut model.motion {
        // What was made is shared by its neighbours already.
        let made = motion.together.len()..cut.positions.len();
        let numbers = made.map(|index| FIRST_OF_CUTS + index as u32);
        motion.together.extend(numbers);
    }
    model.positions = cut.positions;
    model.triangles = cut.triangles;
    model.looks = cut.looks;
    let masked = model.materials.iter_mut().map(|given| &mut given.material);
    for material in masked.filter(|it| is_mask(it)) {
        material.coverage = Coverage::Opaque;
    }
    Ok(())
}

fn is_mask(material: &Material) -> bool {
    matches!(material.coverage, Coverage::Mask { .. })
}

/// The masks of the materials that have one, by their index.
fn masks_of(model: &RawModel) -> HashMap<u32, Mask> {
    let materials = model.materials.iter().zip(0..);
    let masks = materials.filter_map(|(given, index)| {
        let cutoff = match given.material.coverage {
            Coverage::Opaque => return None,
            Coverage::Mask { cutoff } => cutoff,
            Coverage::Blend => CLEAR,
        };
        let map = given.material.maps.color;
        let picture = map.and_then(|map| Some((map, model.textures.get(map.texture as usize)?)));
        let picture = picture.map(|(map, texture)| (map, &**texture));
        Some((index, Mask::new(&given.material, cutoff, picture)))
    });
    masks.collect()
}

/// Gives corners the look of what has none.
fn give_looks(model: &mut RawModel) {
    if model.looks.corners.is_empty() {
        model.looks.looks = vec![CornerLook::default()];
        model.looks.corners = vec![[0; 3]; model.triangles.len()];
    }
}

/// What a material's opacity leaves.
struct Mask {
    opacity: f64,
    cutoff: f64,
    picture: Option<MaskPicture>,
}

impl Mask {
    fn new(material: &Material, cutoff: f64, picture: Option<(Map, &Texture)>) -> Self {
        Self {
            opacity: material.opacity,
            cutoff,
            picture: picture.map(|(map, texture)| {
                MaskPicture::new(map, texture, cutoff / material.opacity.max(1e-12))
            }),
        }
    }
}

impl Region for Mask {
    fn inside(&self, look: &CornerLook) -> f64 {
        let of_picture = match &self.picture {
            Some(picture) => picture.alpha(look),
            None => 1.0,
        };
        self.opacity * of_picture * f64::from(look.color.w) - self.cutoff
    }

    fn extent(&self, corners: [&CornerLook; 3]) -> Extent {
        let Some(picture) = &self.picture else {
            // Colours are linear between corners.
            let inside = corners.map(|look| self.inside(look) >= 0.0);
            return match inside {
                [true, true, true] => Extent::Whole,
                [false, false, false] => Extent::Nothing,
                _ => Extent::Part,
            };
        };
        match picture.extent(corners) {
            // (Colours at corners let less through, never more.)
            Extent::Whole if corners.iter().any(|look| look.color.w < 1.0) => Extent::Part,
            Extent::Nothing if corners.iter().any(|look| look.color.w > 1.0) => Extent::Part,
            extent => extent,
        }
    }

    fn is_fine(&self, corners: [&CornerLook; 3]) -> bool {
        let picture = self.picture.as_ref();
        picture.is_none_or(|picture| picture.is_fine(corners))
    }
}

/// A picture's opacity, and how much of each part of it is there.
struct MaskPicture {
    map: Map,
    /// Alpha alone, in a picture of its own: from 0 to 1, rows from the top.
    alphas: Vec<u8>,
    size_px: [u32; 2],
    /// A summed-area table of the texels that are there (Crow 1984): row and column 0 are of nothing.
    there: Vec<u32>,
}

impl MaskPicture {
    fn new(map: Map, texture: &Texture, least: f64) -> Self {
        let alphas: Vec<u8> = texture.rgba.iter().skip(3).step_by(4).copied().collect();
        let [width, height] = texture.size_px.map(|side| side as usize);
        let mut there = vec![0; (width + 1) * (height + 1)];
        for row in 0..height {
            let mut in_row = 0;
            for column in 0..width {
                let alpha = f64::from(alphas[row * width + column]) / 255.0;
                in_row += u32::from(alpha >= least);
                let above = there[row * (width + 1) + column + 1];
                there[(row + 1) * (width + 1) + column + 1] = above + in_row;
            }
        }
        Self {
            map,
            alphas,
            size_px: texture.size_px,
            there,
        }
    }

    /// A corner's place in the picture, texels.
    fn place(&self, look: &CornerLook) -> DVec2 {
        let uv: Vec2 = look.uv[self.map.uv_set as usize & 1];
        let [width, height] = self.size_px.map(f64::from);
        self.map.picture_from_corner.transform_point2(uv).as_dvec2() * DVec2::new(width, height)
    }

    fn alpha(&self, look: &CornerLook) -> f64 {
        let uv = look.uv[self.map.uv_set as usize & 1];
        let alpha = |[column, row]: [u32; 2]| {
            let at = row as usize * self.size_px[0] as usize + column as usize;
            f64::from(self.alphas[at]) / 255.0
        };
        self.map.sample(self.size_px, uv, alpha)
    }

    /// Counts the texels that a triangle can see, and those of them that are there.
    fn extent(&self, corners: [&CornerLook; 3]) -> Extent {
        let places = corners.map(|look| self.place(look));
        if places.iter().any(|place| !place.is_finite()) {
            return Extent::Part;
        }
        let low = places[0].min(places[1]).min(places[2]);
        let high = places[0].max(places[1]).max(places[2]);
        // Between texels two count on either side.
        let (low, high) = match self.map.filter {
            Filter::Smooth => ((low - 0.5).floor(), (high - 0.5).floor() + 1.0),
            Filter::Pixels => (low.floor(), high.floor()),
        };
        let [columns, rows] = [
            spans([low.x, high.x], self.size_px[0], self.map.wrap[0]),
            spans([low.y, high.y], self.size_px[1], self.map.wrap[1]),
        ];
        let (mut all, mut there) = (0, 0);
        for &[left, right] in columns.iter().flatten() {
            for &[top, bottom] in rows.iter().flatten() {
                all += u64::from(right - left) * u64::from(bottom - top);
                there += self.there_in([left, right], [top, bottom]);
            }
        }
        match there {
            0 => Extent::Nothing,
            _ if there == all => Extent::Whole,
            _ => Extent::Part,
        }
    }

    fn there_in(&self, [left, right]: [u32; 2], [top, bottom]: [u32; 2]) -> u64 {
        let stride = self.size_px[0] as usize + 1;
        let at =
            |row: u32, column: u32| u64::from(self.there[row as usize * stride + column as usize]);
        at(bottom, right) + at(top, left) - at(top, right) - at(bottom, left)
    }

    /// Within a texel opacity hardly bends; the corners of squares are rounded by a tenth of one.
    fn is_fine(&self, corners: [&CornerLook; 3]) -> bool {
        let [a, b, c] = corners.map(|look| self.place(look));
        let longest = a.distance(b).max(b.distance(c)).max(c.distance(a));
        let most = match self.map.filter {
            Filter::Smooth => 1.0,
            Filter::Pixels => 0.25,
        };
        // (Of places that are no numbers nothing finer would be better.)
        !longest.is_finite() || longest <= most
    }
}

/// The texels, from the first to before the last, in which texels from the first to the last of a picture that goes on beyond
/// its sides lie.
fn spans([low, high]: [f64; 2], count: u32, wrap: Wrap) -> [Option<[u32; 2]>; 2] {
    let length = f64::from(count);
    let span = |first: f64, last: f64| Some([first as u32, last as u32 + 1]);
    let whole = [Some([0, count]), None];
    match wrap {
        Wrap::Clamp => {
            let [low, high] = [low, high].map(|texel| texel.clamp(0.0, length - 1.0));
            [span(low, high), None]
        }
        _ if high - low >= length - 1.0 => whole,
        Wrap::Repeat => {
            let [first, last] = [low, high].map(|texel| texel.rem_euclid(length));
            match first <= last {
                true => [span(first, last), None],
                false => [span(first, length - 1.0), span(0.0, last)],
            }
        }
        // (Across a mirror's edge it is more than is asked for, which is right too.)
        Wrap::Mirror if (low / length).floor() != (high / length).floor() => whole,
        Wrap::Mirror => {
            let is_turned = (low / length).floor().rem_euclid(2.0) == 1.0;
            let [first, last] = [low, high].map(|texel| texel.rem_euclid(length));
            match is_turned {
                true => [span(length - 1.0 - last, length - 1.0 - first), None],
                false => [span(first, last), None],
            }
        }
    }
}

#[cfg(test)]
mod tests;
