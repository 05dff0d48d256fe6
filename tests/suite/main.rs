//! What the program knows and draws, held against oracles: one binary, for each that links everything takes its time.
#![allow(
    clippy::unwrap_used,
    reason = "a test may stop where its own files fail"
)]

#[path = "../common/mod.rs"]
mod common;

mod accuracy;
mod albedo_texture;
mod animation;
mod architecture;
mod authoring;
mod board;
mod boards_in_space;
mod calibrate;
mod counting;
mod deforming;
mod detail;
mod environment;
mod environment_corners;
mod figures;
mod final_gather;
mod gltf;
mod lenses;
mod light_from_picture;
mod motion;
mod picture;
mod probe;
mod probe_light;
mod reflected_gloss;
mod reflections;
mod scene;
mod shading;
mod shafts;
mod sized_lights;
mod stability;
mod tracking;
mod tracking_families;
mod tracking_photographs;
mod tracking_sessions;
mod tracking_stability;
mod translucent;
mod volumes;
