//! What sources give to vertices in the terms in which it is taken out of the video: irradiance, of which a part of the
//! video's light is made; radiance that the camera sees; or encoded levels (Gibson et al. 2003, sections 7 and 7.1).

use std::f32::consts::FRAC_1_PI;

use glam::Vec3;

use super::intensity_transfers::{SETS, intensity_transfers, set_of};
use super::light_of_room::PatchLight;
use super::luminance;
use super::patches::RoomPatch;
use super::room_transport::RoomTransport;

/// A way to take what virtual things hide of a room's light out of the video.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Difference {
    /// Of the pixel's linear light as large a part as of the modelled light: the video keeps its texture, and the model's
    /// reflectances do not matter.
    Ratio,
    /// The radiance that the model says is missing (Gibson et al. 2003, section 7; Debevec 1998).
    Subtract,
    /// Intensity transfers, from the encoded pixel (Gibson et al. 2003, section 7.1): for the record, as it was done where
    /// pictures could not be added in linear light.
    Encoded,
}

/// The terms in which light is taken out of the video.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Terms<'a> {
    /// The way.
    pub difference: Difference,
    /// For each of a room's first pieces whether a picture says what it reflects: as radiance its light is that of a surface
    /// which reflects all, for whoever draws it to multiply it by the picture.
    pub pictured: &'a [bool],
}

impl Terms<'_> {
    /// What a patch reflects in these terms.
    pub fn reflectance(&self, patch: &RoomPatch, light: &PatchLight) -> Vec3 {
        let is_pictured = self.pictured.get(patch.piece as usize) == Some(&true);
        match is_pictured && self.difference == Difference::Subtract {
            true => Vec3::ONE,
            false => light.albedo,
        }
    }
}

/// Some vertices' light, and what each of some sources gives to it: rows of as many as there are sources.
pub struct Given {
    /// For each vertex.
    pub light: Vec<Vec3>,
    /// Row by row, a row for each vertex.
    pub by_source: Vec<Vec3>,
    /// Length of a row.
    pub source_count: usize,
}

impl Given {
    /// Irradiance in other terms.
    pub fn in_terms_of(self, terms: Terms<'_>, room: &RoomTransport, vertices: &[u32]) -> Self {
        if terms.difference == Difference::Ratio {
            return self;
        }
        let reflectances = reflectances(terms, room, vertices);
        let radiance = self.into_radiance(&reflectances);
        match terms.difference {
            Difference::Encoded => radiance.into_levels(),
            Difference::Ratio | Difference::Subtract => radiance,
        }
    }

    fn into_radiance(mut self, reflectances: &[Vec3]) -> Self {
        for (row, reflectance) in reflectances.iter().enumerate() {
            self.light[row] *= reflectance * FRAC_1_PI;
            for given in &mut self.by_source[row * self.source_count..][..self.source_count] {
                *given *= reflectance * FRAC_1_PI;
            }
        }
        self
    }

    fn into_levels(mut self) -> Self {
        let count = self.source_count;
        let power = |source: usize| -> f32 {
            let given = self.by_source.iter().skip(source).step_by(count);
            given.map(|&given| luminance(given)).sum()
        };
        let powers: Vec<f32> = (0..count).map(power).collect();
        let mut order: Vec<usize> = (0..count).collect();
        order.sort_by(|&a, &b| powers[b].total_cmp(&powers[a]));
        for (row, light) in self.light.iter().enumerate() {
            let given = &mut self.by_source[row * count..][..count];
            let sources = order.iter().enumerate();
            let sources = sources.map(|(place, &source)| (set_of(place), given[source]));
            let transfers = intensity_transfers::<SETS>(*light, sources);
            for (&source, transfer) in order.iter().zip(transfers) {
                given[source] = transfer;
            }
        }
        self
    }
}

/// What each vertex reflects: the mean of its patches.
fn reflectances(terms: Terms<'_>, room: &RoomTransport, vertices: &[u32]) -> Vec<Vec3> {
    let mut sums = vec![(Vec3::ZERO, 0.0); vertices.len()];
    for (patch, light) in room.patches.patches.iter().zip(&room.light) {
        for vertex in patch.vertices {
            if let Ok(row) = vertices.binary_search(&vertex) {
                sums[row].0 += terms.reflectance(patch, light);
                sums[row].1 += 1.0;
            }
        }
    }
    sums.into_iter()
        .map(|(sum, count): (Vec3, f32)| sum / count.max(1.0))
        .collect()
}
