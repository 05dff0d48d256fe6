// What each source sees of the casters: a tile of the atlas for each. Red: 1 where a caster is; green: how far, from the
// nearest to the farthest that casters can be; blue: its square; all averaged in the coarser levels.
//!include "mapped_source.wgsl"

@group(0) @binding(0) var<storage, read> sources: array<MappedSource>;

struct Seen {
    @builtin(position) clip: vec4f,
    @location(0) depth: f32,
    @location(1) @interpolate(flat) range: vec2f,
}

@vertex
fn see(@location(0) point_in_world: vec3f, @builtin(instance_index) index: u32) -> Seen {
    let source = sources[index];
    let placed = source.map_from_world * vec4f(point_in_world, 1.0);
    let near = source.near_m;
    let far = near + source.range_m;
    return Seen(
        vec4f(
            2.0 * placed.x - placed.w,
            placed.w - 2.0 * placed.y,
            far / source.range_m * (placed.w - near),
            placed.w,
        ),
        placed.w,
        vec2f(near, source.range_m),
    );
}

@fragment
fn seen(seen: Seen) -> @location(0) vec4f {
    let depth = (seen.depth - seen.range.x) / seen.range.y;
    return vec4f(1.0, depth, depth * depth, 0.0);
}
