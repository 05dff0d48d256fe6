//! A light found in the picture by clicks: a vertex of a phantom, then the tip of its shadow, again and again.

use glam::DVec2;

use super::frame_tracker::TrackedPicture;
use crate::app::authoring::{Edit, FoundLight, PickedVertex, PicturedThings, ShadowClick};
use crate::geometry::light_placing::LightFreedom;
use crate::light::Light;
use crate::scene::Scene;

/// A click this near to a vertex means it, pixels.
const SNAP_PX: f64 = 14.0;

/// The clicks so far, in one frame.
pub struct ShadowClicks {
    things: PicturedThings,
    vertex: Option<PickedVertex>,
    pairs: Vec<(PickedVertex, ShadowClick)>,
}

impl ShadowClicks {
    /// No click yet; `None` while the world is not seen.
    pub fn begin(scene: &Scene, picture: &TrackedPicture) -> Option<Self> {
        let poses = picture.camera_from_nodes(scene);
        Some(Self {
            things: PicturedThings::new(
                &scene.shaped_at(picture.frame.time_secs),
                picture.intrinsics,
                &poses,
            )?,
            vertex: None,
            pairs: Vec::new(),
        })
    }

    /// Takes a click on a vertex, or on the shadow of the vertex before.
    ///
    /// # Errors
    /// No vertex is near.
    pub fn click(&mut self, pixel: DVec2) -> Result<(), &'static str> {
        match self.vertex.take() {
            Some(vertex) => {
                let click = ShadowClick {
                    vertex_m: vertex.world_m,
                    shadow_px: pixel,
                };
                self.pairs.push((vertex, click));
            }
            None => {
                let vertex = self.things.vertex_at(pixel, SNAP_PX);
                self.vertex = Some(vertex.ok_or("No corner of a real thing is there.")?.clone());
            }
        }
        Ok(())
    }

    /// Takes the last click back.
    pub fn take_back(&mut self) {
        if self.vertex.take().is_none() {
            self.vertex = self.pairs.pop().map(|(vertex, _)| vertex);
        }
    }

    /// The vertex whose shadow is to be clicked next.
    pub fn vertex(&self) -> Option<&PickedVertex> {
        self.vertex.as_ref()
    }

    /// Vertices with their shadows, both where they are in the undistorted picture.
    pub fn pairs_px(&self) -> impl ExactSizeIterator<Item = [DVec2; 2]> {
        let pairs = self.pairs.iter();
        pairs.map(|(vertex, click)| [vertex.pixel, click.shadow_px])
    }

    /// The light that casts the clicked shadows, in the frame that was clicked in.
    ///
    /// # Errors
    /// Why there is none, in words.
    pub fn find(
        &self,
        picture: &TrackedPicture,
        freedom: LightFreedom,
    ) -> Result<FoundLight, String> {
        let clicks: Vec<ShadowClick> = self.pairs.iter().map(|(_, click)| *click).collect();
        let found = self.things.find_light(&picture.frame, &clicks, freedom);
        found.map_err(|error| error.to_string())
    }
}

/// What a found light makes of a scene: it takes the place of light `index`, or is added where there is none.
pub fn edits(scene: &Scene, index: usize, found: &FoundLight) -> Vec<Edit> {
    let light = match (scene.lights.get(index), found.strengths) {
        // The picture does not tell how strong it is: it stays as strong as it was.
        (Some(before), None) => {
            as_large_as(as_strong_as(found.light, &before.light), &before.light)
        }
        (Some(before), Some(_)) => as_large_as(found.light, &before.light),
        (None, _) => found.light,
    };
    let placed = match scene.lights.len() {
        count if index < count => Edit::Light { index, light },
        _ => Edit::AddLight(light),
    };
    let ambient = found.strengths.map(|found| Edit::Ambient(found.ambient));
    std::iter::once(placed).chain(ambient).collect()
}

fn as_strong_as(mut light: Light, before: &Light) -> Light {
    match (&mut light, *before) {
        (Light::Point { intensity, .. }, Light::Point { intensity: was, .. }) => *intensity = was,
        (
            Light::Directional { irradiance, .. },
            Light::Directional {
                irradiance: was, ..
            },
        ) => {
            *irradiance = was;
        }
        (Light::Point { .. }, Light::Directional { .. })
        | (Light::Directional { .. }, Light::Point { .. }) => {}
    }
    light
}

/// Shadows tell where a light is, not how large: it keeps its size, and what is aimed still aims where it did.
fn as_large_as(mut light: Light, before: &Light) -> Light {
    match (&mut light, *before) {
        (Light::Point { shape, .. }, Light::Point { shape: was, .. }) => *shape = was,
        (Light::Directional { angle_rad, .. }, Light::Directional { angle_rad: was, .. }) => {
            *angle_rad = was;
        }
        (Light::Point { .. }, Light::Directional { .. })
        | (Light::Directional { .. }, Light::Point { .. }) => {}
    }
    light
}

/// What was found, for a notice.
pub fn in_words(found: &FoundLight) -> String {
    let place = match found.light {
        Light::Point { position_m, .. } => {
            let [x, y, z] = position_m.to_array();
            format!("A lamp at {x:.3}, {y:.3}, {z:.3} m")
        }
        Light::Directional { direction, .. } => {
            let [x, y, z] = direction.to_array();
            format!("Light that travels along {x:.3}, {y:.3}, {z:.3}")
        }
    };
    let fit = match found.edges {
        0 => format!(
            "by the clicks alone, which are off by {:.1} px",
            found.click_rms_px
        ),
        edges => format!(
            "{edges} edges of shadows fit it to {:.1} px",
            found.edge_rms_px
        ),
    };
    let strength = match found.strengths {
        Some(_) => "",
        None => "; too little is seen of the shadows' edges to tell how strong it is",
    };
    format!("{place}: {fit}{strength}.")
}
