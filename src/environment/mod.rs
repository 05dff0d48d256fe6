//! Light from afar on things that move and turn, as plain values (Tamura, Johan & Nishita 2005): what a thing hides of it from
//! itself is worked out once, what others hide of it wherever they are.

pub mod distant_light;
pub mod final_gather;
pub mod finer;
pub mod glossy;
pub mod groups;
pub mod occlusion_map;
pub mod placed;
pub mod reflected;
pub mod self_occlusion;
pub mod sky;
pub mod surroundings;
pub mod thing;
