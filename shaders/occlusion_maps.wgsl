// What each region of the environment sees of each thing: a tile of the atlas for each. Red: 1 where the thing is; green: how
// far, in parts of its depth; blue: its square; all averaged in the coarser levels.

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
    // Number of the thing, and of its group.
    thing: u32,
}

@group(0) @binding(0) var<storage, read> maps: array<OcclusionMap>;

struct Seen {
    @builtin(position) clip: vec4f,
    @location(0) depth: f32,
}

@vertex
fn see(@location(0) point_in_anchor: vec3f, @builtin(instance_index) index: u32) -> Seen {
    let map = maps[index];
    let point = vec4f(point_in_anchor, 1.0);
    let rows = map.tile_from_anchor;
    let placed = vec3f(dot(rows[0], point), dot(rows[1], point), dot(rows[2], point));
    let depth = placed.z / map.range_m;
    // (Rounding may put the nearest and the farthest place a little beyond.)
    return Seen(vec4f(2.0 * placed.x - 1.0, 1.0 - 2.0 * placed.y, clamp(depth, 0.0, 1.0), 1.0), depth);
}

@fragment
fn seen(seen: Seen) -> @location(0) vec4f {
    return vec4f(1.0, seen.depth, seen.depth * seen.depth, 0.0);
}
