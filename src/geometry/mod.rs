//! Shapes, poses and cameras as plain values: no GPU, file, clock or OpenCV type on this floor.
//!
//! The spaces, all in metres and radians:
//! *world* right-handed, z up, origin at the first board's centre on the table, x right and y up as printed;
//! *marker* and *board* the same axes at their own centre; *object* as its OBJ file says;
//! *camera* x right, y down, z forward (OpenCV). A pixel's integer coordinate is its centre.
//! `a_from_b` maps b to a.

pub mod bounds;
pub mod camera;
pub mod coincidence;
pub mod corner_points;
pub mod counting;
pub mod cuboid;
pub mod cut_edges;
pub mod exact_side;
pub mod homography;
pub mod least_squares;
pub mod lens;
pub mod levels;
pub mod light_placing;
mod looks;
pub mod matrix;
mod mend;
pub mod mesh;
pub mod normals;
mod orient;
pub mod outline_scale;
mod parts;
pub mod penumbra;
pub mod polygon;
pub mod pose;
pub mod quarter_turns;
pub mod ray_caster;
pub mod reach;
pub mod region_cut;
pub mod rig;
pub mod robust;
pub mod shadow_outline;
pub mod shadow_volume;
pub mod shapes;
pub mod solid;
mod soup;
pub mod subdivide;
pub mod surface_distance;
mod triangle_tree;
pub mod winding;
