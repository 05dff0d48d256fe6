//! gnomon puts virtual things on a real table seen by a camera and lets light treat both alike.
//!
//! The floors, lowest first; a module imports only from floors below its own (`tests/suite/architecture.rs` keeps that):
//! [`geometry`] → [`light`] → [`shafts`] → [`scene`] → [`capture`] → [`tracking`] → [`calibration`] →
//! [`render`] → [`app`].
//! `ARCHITECTURE.md` tells what each is for and what must never be.

pub mod app;
pub mod calibration;
pub mod capture;
pub mod environment;
pub mod geometry;
pub mod light;
pub mod render;
pub mod scene;
pub mod shafts;
pub mod tracking;
