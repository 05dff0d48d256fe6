// Soft shadows of a room's light (Gibson et al. 2003, section 7): what virtual things hide of the light of real surfaces, what
// they reflect, and the light on them.
//!include "sampled_surface.wgsl"
//!include "light_sums.wgsl"
//!include "depth_moments.wgsl"
//!include "mapped_source.wgsl"
//!include "mirrored.wgsl"

struct ShaftFrame {
    world_from_camera: mat4x4f,
    // Broad light on what moves.
    moving_irradiance: vec3f,
    source_count: u32,
}

@group(2) @binding(0) var<uniform> frame: ShaftFrame;
@group(2) @binding(1) var<storage, read> sources: array<MappedSource>;
// Of each vertex, without virtual things.
@group(2) @binding(2) var<storage, read> irradiances: array<vec3f>;
// Irradiance of each vertex from each source: rows of `source_count`, packed into two halves and one.
@group(2) @binding(3) var<storage, read> transfers: array<vec2u>;
// For each patch the sources that things may hide from it.
@group(2) @binding(4) var<storage, read> lists: array<u32>;
@group(2) @binding(5) var maps: texture_2d<f32>;
@group(2) @binding(6) var map_sampler: sampler;

struct PatchCorner {
    @location(0) position: vec3f,
    // Rows of the patch's three vertices.
    @location(1) rows: vec3u,
    // Weights of the first two there: 0 and 1.
    @location(2) weights: vec2f,
    // First of the patch's sources in `lists`, and their number.
    @location(3) list: vec2u,
}

struct ReflectedCorner {
    @location(0) position: vec3f,
    // Irradiance from virtual things.
    @location(1) irradiance: vec3f,
}

struct ReflectedSurface {
    @builtin(position) clip: vec4f,
    @location(0) @interpolate(perspective, centroid) irradiance: vec3f,
    @location(1) @interpolate(perspective, centroid) one: f32,
    @location(2) @interpolate(flat) first_irradiance: vec3f,
}

struct PatchSurface {
    @builtin(position) clip: vec4f,
    @location(0) @interpolate(perspective, centroid) point_in_world: vec3f,
    @location(1) @interpolate(perspective, centroid) weights: vec2f,
    @location(2) @interpolate(flat) rows: vec3u,
    @location(3) @interpolate(flat) list: vec2u,
    @location(4) @interpolate(perspective, centroid) one: f32,
    @location(5) @interpolate(flat) first_point_in_world: vec3f,
    @location(6) @interpolate(flat) first_weights: vec2f,
}

@vertex
fn place_patch(corner: PatchCorner, @builtin(vertex_index) index: u32) -> PatchSurface {
    return PatchSurface(
        clip_from_point(view, vec4f(corner.position, 1.0)),
        corner.position,
        corner.weights,
        corner.rows,
        corner.list,
        one(index),
        corner.position,
        corner.weights,
    );
}

@vertex
fn place_reflected(corner: ReflectedCorner, @builtin(vertex_index) index: u32) -> ReflectedSurface {
    return ReflectedSurface(
        clip_from_point(view, vec4f(corner.position, 1.0)),
        corner.irradiance,
        one(index),
        corner.irradiance,
    );
}

@vertex
fn place_depth(@location(0) position: vec3f) -> @invariant @builtin(position) vec4f {
    return clip_from_point(view, vec4f(position, 1.0));
}

// Part of a source's light that casters hide from a place, 0 to 1: percentage-closer soft shadows (Fernando 2005) on averaged
// maps. Nothing that a map shows lies behind a real surface; a caster is shown itself, with what lies beside and behind it.
fn hidden(index: u32, point_in_world: vec3f, is_caster: bool) -> f32 {
    let placed = sources[index].map_from_world * vec4f(point_in_world, 1.0);
    let depth = placed.w;
    if depth <= sources[index].near_m {
        return 0.0;
    }
    let in_tile = placed.xy / depth;
    if any(in_tile < vec2f(0.0)) || any(in_tile > vec2f(1.0)) {
        return 0.0;
    }
    let source = sources[index];
    let around = map_at(source, in_tile, source.near_m, depth);
    if around.x < 1e-3 {
        return 0.0;
    }
    let mean = around.y / around.x;
    let behind = (depth - source.near_m) / source.range_m - mean;
    if behind <= 0.0 {
        return 0.0;
    }
    if !is_caster {
        return map_at(source, in_tile, source.near_m + source.range_m * mean, depth).x;
    }
    let blocker = blocker_depth(around, mean, behind);
    let seen = map_at(source, in_tile, source.near_m + source.range_m * blocker, depth);
    return part_before(seen, (depth - source.near_m) / source.range_m);
}

// The map around a place, averaged over what the source's extent sees through a caster at a depth.
fn map_at(source: MappedSource, in_tile: vec2f, caster: f32, depth: f32) -> vec3f {
    let texels = source.spread_m * (depth - caster) / (depth * caster) * source.focal_texels;
    let level = clamp(log2(2.0 * texels), 0.0, log2(source.tile_px));
    let margin = 0.5 * exp2(level) / source.tile_px;
    let inside = clamp(in_tile, vec2f(margin), vec2f(1.0 - margin));
    return textureSampleLevel(maps, map_sampler, source.tile_corner + inside * source.tile_side, level).xyz;
}

fn transfer(row: u32, source: u32) -> vec3f {
    let packed = transfers[row * frame.source_count + source];
    return vec3f(unpack2x16float(packed.x), unpack2x16float(packed.y).x);
}

@fragment
fn light_on_patch(surface: PatchSurface) -> LightSums {
    let point_in_world = recovered(surface.point_in_world, surface.first_point_in_world, surface.one);
    let of_first = vec3f(surface.first_weights, 0.0);
    let first = recovered(vec3f(surface.weights, 0.0), of_first, surface.one).xy;
    let weights = vec3f(first, 1.0 - first.x - first.y);
    var taken = vec3f(0.0);
    for (var place = 0u; place < surface.list.y; place++) {
        let index = lists[surface.list.x + place];
        let hidden = hidden(index, point_in_world, false);
        if hidden > 0.0 {
            let arriving = weights.x * transfer(surface.rows.x, index)
                + weights.y * transfer(surface.rows.y, index)
                + weights.z * transfer(surface.rows.z, index);
            taken += hidden * arriving;
        }
    }
    let reaching = weights.x * irradiances[surface.rows.x]
        + weights.y * irradiances[surface.rows.y]
        + weights.z * irradiances[surface.rows.z];
    return LightSums(vec4f(reaching, 1.0), vec4f(taken, 0.0));
}

// All light of a patch, nothing hidden.
@fragment
fn whole_light_on_patch(surface: ReflectedSurface) -> LightSums {
    let irradiance = recovered(surface.irradiance, surface.first_irradiance, surface.one);
    return LightSums(vec4f(irradiance, 1.0), vec4f(0.0));
}

@fragment
fn light_on_moving() -> LightSums {
    return LightSums(vec4f(frame.moving_irradiance, 1.0), vec4f(0.0));
}

// Added to what sources take.
@fragment
fn reflected_on_patch(surface: ReflectedSurface) -> @location(1) vec4f {
    return vec4f(-recovered(surface.irradiance, surface.first_irradiance, surface.one), 0.0);
}

@fragment
fn light_on_virtual(sampled: SampledSurface, @builtin(front_facing) outside: bool) -> LightSums {
    let surface = surface(sampled);
    let point_in_world = (frame.world_from_camera * vec4f(surface.point_in_camera, 1.0)).xyz;
    let look = look(surface, outside);
//!if LOOKS
    if look.opacity == 0.0 {
        discard;
    }
//!end
    let normal = (frame.world_from_camera * vec4f(look.normal, 0.0)).xyz;
    var taken = vec3f(0.0);
    for (var index = 0u; index < frame.source_count; index++) {
        let way = sources[index].position - point_in_world;
        let distance_squared = dot(way, way);
        let facing = dot(normal, way);
        if facing > 0.0 {
            let hidden = hidden(index, point_in_world, true);
            let spread = 2.0 * sources[index].spread_m * sources[index].spread_m;
            taken += hidden * sources[index].intensity * facing * inverseSqrt(distance_squared) / (distance_squared + spread);
        }
    }
    let arriving = max(surface.indirect - taken, vec3f(0.0));
    let to_camera = normalize(frame.world_from_camera[3].xyz - point_in_world);
    // What hides light hides it from the layer as well; more is not known of where it comes from.
    let left = arriving / max(surface.indirect, vec3f(1e-6));
    return LightSums(vec4f(0.0), vec4f(radiance_in_probe(surface.clip.xy, look, normal, to_camera, arriving, left), 1.0));
}

// For what is drawn into depth alone.
@fragment
fn nothing() {
}
