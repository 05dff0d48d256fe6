// Soft shadows of a room's light (Gibson et al. 2003, section 7): what virtual things hide of the light of real surfaces, what
// they throw back, and the light on them.
//!include "shading.wgsl"
//!include "source.wgsl"

struct Frame {
    world_from_camera: mat4x4f,
    source_count: u32,
    surfel_count: u32,
    padding: vec2u,
}

// A corner of real patches.
struct Vertex {
    normal: vec3f,
    // Irradiance without virtual things.
    irradiance: vec3f,
}

// A disc on a virtual thing's surface.
struct Surfel {
    position: vec3f,
    area: f32,
    normal: vec3f,
    // A bit for each direction in which the thing itself does not hide it.
    open_low: u32,
    radiance: vec3f,
    open_high: u32,
}

@group(2) @binding(0) var<uniform> frame: Frame;
@group(2) @binding(1) var<storage, read> sources: array<Source>;
@group(2) @binding(2) var<storage, read> vertices: array<Vertex>;
// Irradiance of each vertex from each source: rows of `source_count`, packed into two halves and one.
@group(2) @binding(3) var<storage, read> transfers: array<vec2u>;
@group(2) @binding(4) var<storage, read> surfels: array<Surfel>;
@group(2) @binding(5) var maps: texture_2d<f32>;
@group(2) @binding(6) var map_sampler: sampler;




// Cells along a side of the octahedron's map of all directions.
const CELLS: f32 = 8.0;
// What lies no farther behind a caster than this part of its map's range is that caster.
const SAME_PART: f32 = 0.02;

struct PatchCorner {
    @location(0) position: vec3f,
    // Rows of the patch's three corners.
    @location(1) rows: vec3u,
}

struct PatchSurface {
    @invariant @builtin(position) clip: vec4f,
    @location(0) @interpolate(perspective, centroid) point_in_world: vec3f,
    @location(1) @interpolate(perspective, centroid) weights: vec3f,
    @location(2) @interpolate(flat) rows: vec3u,
}

struct Light {
    // Irradiance on a real surface without virtual things; a = 1 where it is known.
    @location(0) reaching: vec4f,
    // Irradiance that virtual things take from a real surface, or the radiance of a virtual one; a = 1 where the surface is
    // virtual.
    @location(1) change: vec4f,
}

@vertex
fn place_patch(corner: PatchCorner, @builtin(vertex_index) index: u32) -> PatchSurface {
    let which = index % 3u;
    return PatchSurface(
        clip_from_point(view, vec4f(corner.position, 1.0)),
        corner.position,
        vec3f(f32(which == 0u), f32(which == 1u), f32(which == 2u)),
        corner.rows,
    );
}

@vertex
fn place_depth(@location(0) position: vec3f) -> @invariant @builtin(position) vec4f {
    return clip_from_point(view, vec4f(position, 1.0));
}

// Part of a source's light that casters hide from a place, 0 to 1: percentage-closer soft shadows (Fernando 2005) on averaged
// maps.
fn hidden(source: Source, point_in_world: vec3f) -> f32 {
    let placed = source.map_from_world * vec4f(point_in_world, 1.0);
    let depth = placed.w;
    if depth <= source.near_m {
        return 0.0;
    }
    let in_tile = placed.xy / depth;
    if any(in_tile < vec2f(0.0)) || any(in_tile > vec2f(1.0)) {
        return 0.0;
    }
    let blockers = map_at(source, in_tile, source.near_m, depth);
    if blockers.x < 1e-3 {
        return 0.0;
    }
    let blocker = source.near_m + source.range_m * blockers.y / blockers.x;
    let behind = (depth - blocker) / source.range_m;
    if behind <= SAME_PART {
        return 0.0;
    }
    return map_at(source, in_tile, blocker, depth).x * smoothstep(SAME_PART, 2.0 * SAME_PART, behind);
}

// The map around a place, averaged over what the source's extent sees through a caster at a depth.
fn map_at(source: Source, in_tile: vec2f, caster: f32, depth: f32) -> vec2f {
    let texels = source.spread_m * (depth - caster) / (depth * caster) * source.focal_texels;
    let level = clamp(log2(2.0 * texels), 0.0, log2(source.tile_px));
    let margin = 0.5 * exp2(level) / source.tile_px;
    let inside = clamp(in_tile, vec2f(margin), vec2f(1.0 - margin));
    return textureSampleLevel(maps, map_sampler, source.tile_corner + inside * source.tile_side, level).xy;
}

fn transfer(row: u32, source: u32) -> vec3f {
    let packed = transfers[row * frame.source_count + source];
    return vec3f(unpack2x16float(packed.x), unpack2x16float(packed.y).x);
}

@fragment
fn light_on_patch(surface: PatchSurface) -> Light {
    var taken = vec3f(0.0);
    for (var index = 0u; index < frame.source_count; index++) {
        let hidden = hidden(sources[index], surface.point_in_world);
        if hidden > 0.0 {
            let arriving = surface.weights.x * transfer(surface.rows.x, index)
                + surface.weights.y * transfer(surface.rows.y, index)
                + surface.weights.z * transfer(surface.rows.z, index);
            taken += hidden * arriving;
        }
    }
    let reaching = surface.weights.x * vertices[surface.rows.x].irradiance
        + surface.weights.y * vertices[surface.rows.y].irradiance
        + surface.weights.z * vertices[surface.rows.z].irradiance;
    let normal = vertices[surface.rows.x].normal;
    taken -= thrown_back(surface.point_in_world, normal);
    return Light(vec4f(reaching, 1.0), vec4f(taken, 0.0));
}

// Irradiance from virtual surfaces.
fn thrown_back(point_in_world: vec3f, normal: vec3f) -> vec3f {
    var sum = vec3f(0.0);
    for (var index = 0u; index < frame.surfel_count; index++) {
        let surfel = surfels[index];
        let way = surfel.position - point_in_world;
        let distance_squared = dot(way, way);
        let scale = dot(normal, way) * -dot(surfel.normal, way);
        if dot(normal, way) <= 0.0 || scale <= 0.0 || !is_open(surfel, -way) {
            continue;
        }
        sum += surfel.radiance
            * (scale / max(distance_squared, 1e-12) * surfel.area / (distance_squared + surfel.area / PI));
    }
    return sum;
}

fn is_open(surfel: Surfel, direction: vec3f) -> bool {
    let flat = direction.xy / (abs(direction.x) + abs(direction.y) + abs(direction.z));
    let signs = select(vec2f(-1.0), vec2f(1.0), direction.xy >= vec2f(0.0));
    let folded = select((1.0 - abs(flat.yx)) * signs, flat, direction.z >= 0.0);
    let cell = vec2u(clamp((folded * 0.5 + 0.5) * CELLS, vec2f(0.0), vec2f(CELLS - 1.0)));
    let bit = cell.y * u32(CELLS) + cell.x;
    let word = select(surfel.open_low, surfel.open_high, bit >= 32u);
    return (word >> (bit % 32u) & 1u) == 1u;
}

@fragment
fn light_on_virtual(surface: Surface, @builtin(front_facing) outside: bool) -> Light {
    let point_in_world = (frame.world_from_camera * vec4f(surface.point_in_camera, 1.0)).xyz;
    let normal_in_camera = normalize(surface.normal_in_camera) * select(-1.0, 1.0, outside);
    let normal = (frame.world_from_camera * vec4f(normal_in_camera, 0.0)).xyz;
    var taken = vec3f(0.0);
    for (var index = 0u; index < frame.source_count; index++) {
        let source = sources[index];
        let way = source.position - point_in_world;
        let distance_squared = dot(way, way);
        let facing = dot(normal, way);
        if facing > 0.0 {
            let hidden = hidden(source, point_in_world);
            taken += hidden * source.intensity * facing * inverseSqrt(distance_squared) / distance_squared;
        }
    }
    let arriving = max(surface.indirect - taken, vec3f(0.0));
    return Light(vec4f(0.0), vec4f(surface.material.rgb / PI * arriving, 1.0));
}

// For what is drawn into depth alone.
@fragment
fn nothing() {
}
