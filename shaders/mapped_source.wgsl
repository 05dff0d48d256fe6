// A source of light that casts shadows, and its map in the atlas.

struct MappedSource {
    // World to the tile: (u w, v w, unused, w) with w the depth along the map's axis, metres.
    map_from_world: mat4x4f,
    position: vec3f,
    // Standard deviation of its light across the way to the casters, metres.
    spread_m: f32,
    // Radiant intensity towards the casters, for virtual surfaces.
    intensity: vec3f,
    // Texels of a tile per unit of tangent.
    focal_texels: f32,
    // The tile in the atlas: its corner and its side, in parts of the atlas.
    tile_corner: vec2f,
    tile_side: vec2f,
    // Where casters are, along the axis.
    near_m: f32,
    range_m: f32,
    // Side of the tile.
    tile_px: f32,
    padding: f32,
}
