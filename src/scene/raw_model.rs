//! What a file of any format has of a model, before its vertices are welded.

use std::sync::Arc;

use glam::{DVec3, Vec3};

use super::notes::Notes;
use crate::geometry::mesh::{RawLooks, RawTriangle};
use crate::geometry::rig::{Clip, Rig};
use crate::light::Material;
use crate::light::texture::Texture;

/// Diffuse reflectance where neither the scene nor a mesh's file gives one.
pub const DEFAULT_ALBEDO: f64 = 0.5;
/// Smoothest surface that is kept apart from a mirror.
pub const LEAST_ROUGHNESS: f64 = 0.01;

/// GGX's α of a file's roughness, which is its root.
pub fn alpha(roughness: f64) -> f64 {
    (roughness * roughness).clamp(LEAST_ROUGHNESS, 1.0)
}

/// What is said where a picture is asked for and nothing says where it lies.
pub const NO_COORDINATES: &str = "texture coordinates of a picture that are not there or no numbers: faces there are of one colour";

/// A model as its file has it, in the file's own units and axes.
#[derive(Debug, Default)]
pub struct RawModel {
    /// Its vertices.
    pub positions: Vec<Vec3>,
    /// Its triangles.
    pub triangles: Vec<RawTriangle>,
    /// What their corners have besides.
    pub looks: RawLooks,
    /// What they are made of.
    pub materials: Vec<GivenMaterial>,
    /// What the materials' maps name.
    pub textures: Vec<Arc<Texture>>,
    /// What is passed over or taken for something else.
    pub notes: Notes,
    /// The animations that its file has.
    pub clips: Vec<ClipInfo>,
    /// How it moves, where one of them plays.
    pub motion: Option<RawMotion>,
}

/// What is known of an animation of a file.
#[derive(Debug, Clone, PartialEq)]
pub struct ClipInfo {
    /// Its name; empty where it has none.
    pub name: String,
    /// Seconds.
    pub duration_s: f64,
}

/// What moves a model, in the file's own units and axes.
#[derive(Debug)]
pub struct RawMotion {
    /// What plays.
    pub clip: Clip,
    /// What holds the model's corners: their looks say where.
    pub rig: Rig,
    /// For each position a number; those that have one number are one place, always.
    pub together: Vec<u32>,
}

/// What of a file has no surface.
#[derive(Debug, Clone, Copy, Default)]
pub struct WithoutSurface {
    /// There are points.
    pub points: bool,
    /// There are lines.
    pub lines: bool,
}

impl WithoutSurface {
    /// What is said of a file that has no surface; empty where it has nothing at all.
    pub fn told(self) -> &'static str {
        match (self.points, self.lines) {
            (true, false) => ": it is a cloud of points, which has no surface",
            (false, true) => ": it is made of lines, which have no surface",
            (true, true) => ": it is made of points and lines, which have no surface",
            (false, false) => "",
        }
    }
}

/// A material with what the file says of it.
#[derive(Debug, Clone, PartialEq)]
pub struct GivenMaterial {
    /// Its name in the file; empty where it has none.
    pub name: String,
    /// What it is.
    pub material: Material,
    /// Whether the file gives its colour.
    pub is_given: bool,
}

impl GivenMaterial {
    /// What a file says nothing of: grey, or white below colours of its own.
    pub fn unknown(has_colors: bool) -> Self {
        let albedo = if has_colors { 1.0 } else { DEFAULT_ALBEDO };
        Self {
            name: String::new(),
            material: Material::matt(DVec3::splat(albedo)),
            is_given: has_colors,
        }
    }
}
