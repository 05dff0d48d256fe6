// A thing's map for a region of the environment, and its tile in the atlas.

struct OcclusionMap {
    // World to u, v and depth, a row each: u and v from 0 to 1 over the tile, depth in metres from where the thing begins.
    tile_from_world: array<vec4f, 3>,
    // The same from the thing's anchor.
    tile_from_anchor: array<vec4f, 3>,
    // The tile in the atlas: its corner and its side, in parts of the atlas.
    tile_corner: vec2f,
    tile_side: vec2f,
    texels_per_m: f32,
    // How deep the thing is; 0: it is nowhere.
    range_m: f32,
    // Side of the tile, texels.
    tile_px: f32,
    // Number of the thing.
    thing: u32,
}
