// An environment's broad light on real and virtual things that move and turn (Tamura et al. 2005): region by region what a thing
// hides of it from itself and what others hide.
//!include "sampled_surface.wgsl"
//!include "light_sums.wgsl"
//!include "occlusion_map.wgsl"
//!include "mirrored.wgsl"

struct EnvironmentFrame {
    world_from_camera: mat4x4f,
    region_count: u32,
    // Things with maps: the real ones first.
    caster_count: u32,
    real_caster_count: u32,
    disc_count: u32,
}

struct Region {
    // Unit direction towards it.
    toward: vec3f,
    // Side of the square of its solid angle, a metre off.
    width: f32,
    // Irradiance on a plane across.
    irradiance: vec3f,
    // Standard deviation of its light along either axis, a metre off.
    spread: f32,
}

struct Receiver {
    // Middle of the thing, in the world.
    center: vec3f,
    // First of its anchor's rows in `harmonics`.
    first_harmonics: u32,
}

// A disc that reflects light, or a group of them.
struct Disc {
    position: vec3f,
    area: f32,
    normal: vec3f,
    // Bits of the cells of an octahedron's map of directions in which its thing does not hide it (surfels.rs).
    open_low: u32,
    // Radiance without virtual things.
    without: vec3f,
    open_high: u32,
    // What of it virtual things take, or give where it is less than nothing.
    lost: vec3f,
    // Of a group; 0 for a disc.
    radius: f32,
    // Where it goes on after the group.
    next: u32,
}

@group(2) @binding(0) var<uniform> frame: EnvironmentFrame;
@group(2) @binding(1) var<storage, read> regions: array<Region>;
// For each caster as many as there are regions.
@group(2) @binding(2) var<storage, read> maps: array<OcclusionMap>;
// For each thing and region whether what throws no shadow (the table) leaves it open.
@group(2) @binding(3) var<storage, read> open: array<u32>;
// For each anchor and region the harmonics in its direction, four rows of four.
@group(2) @binding(4) var<storage, read> harmonics: array<vec4f>;
@group(2) @binding(5) var atlas: texture_2d<f32>;
@group(2) @binding(6) var atlas_sampler: sampler;
@group(2) @binding(9) var<storage, read> receivers: array<Receiver>;
// A tree: each group, then what is in it.
@group(2) @binding(10) var<storage, read> discs: array<Disc>;

// Set when the shader is built: whether a thing's shadow on another is as wide as at the other's middle, as in the paper.
override BY_PLANES: bool = false;
// Least variance of depths in a map: a thing shades what touches it.
const LEAST_SPREAD: f32 = 0.0004;
// A group is seen as one disc from so many of its radii (reflected.rs).
const SEEN_AS_ONE: f32 = 5.0;
// Part of a pixel's light below which what is taken from it is left.
const LEAST_TAKEN: f32 = 0.001;

// Part of a region's light that a thing hides from a place of another, 0 to 1.
fn hidden(caster: u32, index: u32, point_in_world: vec3f, receiver: u32) -> f32 {
    let number = caster * frame.region_count + index;
    let point = vec4f(point_in_world, 1.0);
    // (Most places lie beside most tiles.)
    let u = dot(maps[number].tile_from_world[0], point);
    if u < 0.0 || u > 1.0 {
        return 0.0;
    }
    let v = dot(maps[number].tile_from_world[1], point);
    if v < 0.0 || v > 1.0 || maps[number].thing == receiver {
        return 0.0;
    }
    let in_tile = vec2f(u, v);
    let range_m = maps[number].range_m;
    if BY_PLANES {
        // Equations 5 and 6: between the planes through both middles.
        let middle = dot(maps[number].tile_from_world[2], vec4f(receivers[receiver].center, 1.0));
        let distance = middle - 0.5 * range_m;
        if distance <= 0.0 {
            return 0.0;
        }
        // (A box of this width has this deviation.)
        return map_at(number, in_tile, 0.2887 * regions[index].width * distance).x;
    }
    let depth = dot(maps[number].tile_from_world[2], point);
    if depth <= 0.0 {
        return 0.0;
    }
    // As wide as the penumbra of the nearest part, then of what lies before the place on the average (Fernando 2005).
    let spread = regions[index].spread;
    let around = map_at(number, in_tile, spread * depth);
    if around.x < 1e-3 {
        return 0.0;
    }
    let mean = around.y / around.x;
    let behind = depth / range_m - mean;
    if behind <= 0.0 {
        return 0.0;
    }
    // What lies before the place, as if all else lay at its depth (Yang et al. 2010).
    let blocker = max(mean - spread_of(around) / behind, 0.0);
    let seen = map_at(number, in_tile, spread * (depth - range_m * blocker));
    let behind_seen = max(depth / range_m - seen.y / max(seen.x, 1e-3), 0.0);
    let squared = behind_seen * behind_seen;
    return seen.x * squared / (squared + spread_of(seen));
}

// Variance of the depths in a map.
fn spread_of(seen: vec3f) -> f32 {
    let mean = seen.y / max(seen.x, 1e-3);
    return max(seen.z / max(seen.x, 1e-3) - mean * mean, LEAST_SPREAD);
}

// The map around a place, averaged over a deviation of so many metres.
fn map_at(number: u32, in_tile: vec2f, spread_m: f32) -> vec3f {
    let tile_px = maps[number].tile_px;
    let level = clamp(log2(2.0 * spread_m * maps[number].texels_per_m), 0.0, log2(tile_px));
    let margin = 0.5 * exp2(level) / tile_px;
    let inside = clamp(in_tile, vec2f(margin), vec2f(1.0 - margin));
    let place = maps[number].tile_corner + inside * maps[number].tile_side;
    return textureSampleLevel(atlas, atlas_sampler, place, level).xyz;
}

// Part of a region's light that a thing itself leaves to a place of it.
fn self_visibility(sampled: SampledSurface, index: u32) -> f32 {
    let row = receivers[sampled.thing].first_harmonics + 4u * index;
    let sum = dot(sampled.visibility_0, harmonics[row])
        + dot(sampled.visibility_1, harmonics[row + 1u])
        + dot(sampled.visibility_2, harmonics[row + 2u])
        + dot(sampled.visibility_3, harmonics[row + 3u]);
    return clamp(recovered(vec3f(sum), vec3f(1.0), sampled.one).x, 0.0, 1.0);
}

// What of a region's light the casters from one to another leave to a place.
fn left_by(first: u32, end: u32, index: u32, point_in_world: vec3f, receiver: u32) -> f32 {
    var left = 1.0;
    for (var caster = first; caster < end; caster++) {
        left *= 1.0 - hidden(caster, index, point_in_world, receiver);
    }
    return left;
}

@fragment
fn light_on_real(sampled: SampledSurface, @builtin(front_facing) outside: bool) -> LightSums {
    let surface = surface(sampled);
    let side = select(-1.0, 1.0, outside);
    let point_in_world = (frame.world_from_camera * vec4f(surface.point_in_camera, 1.0)).xyz;
    let normal = (frame.world_from_camera * vec4f(unit(surface.normal_in_camera) * side, 0.0)).xyz;
    var reaching = surface.indirect;
    var taken = vec3f(0.0);
    let first_open = sampled.thing * frame.region_count;
    for (var index = 0u; index < frame.region_count; index++) {
        let cosine = dot(normal, regions[index].toward);
        if cosine <= 0.0 || open[first_open + index] == 0u {
            continue;
        }
        var part = cosine * left_by(0u, frame.real_caster_count, index, point_in_world, sampled.thing);
        if outside {
            part *= self_visibility(sampled, index);
        }
        let arriving = regions[index].irradiance * part;
        reaching += arriving;
        let left = left_by(frame.real_caster_count, frame.caster_count, index, point_in_world, sampled.thing);
        taken += arriving * (1.0 - left);
    }
    let reflected = reflected(point_in_world, normal);
    reaching += reflected.reaching;
    let lost = taken + reflected.taken;
    let is_seen = any(abs(lost) > LEAST_TAKEN * reaching);
    return LightSums(vec4f(reaching, 1.0), vec4f(select(vec3f(0.0), lost, is_seen), 0.0));
}

struct Reflected {
    reaching: vec3f,
    taken: vec3f,
}

// Irradiance from discs, and what virtual things take of it.
fn reflected(point_in_world: vec3f, normal: vec3f) -> Reflected {
    var sums = Reflected(vec3f(0.0), vec3f(0.0));
    var index = 0u;
    while index < frame.disc_count {
        let way = discs[index].position - point_in_world;
        let radius = discs[index].radius;
        let is_behind = dot(normal, way) < -radius;
        if !is_behind && dot(way, way) < SEEN_AS_ONE * SEEN_AS_ONE * radius * radius {
            index++;
            continue;
        }
        if !is_behind {
            let part = from_disc(index, point_in_world, normal);
            sums.reaching += part * discs[index].without;
            sums.taken += part * discs[index].lost;
        }
        index = discs[index].next;
    }
    return sums;
}

// Irradiance of a place for each unit of a disc's radiance.
fn from_disc(index: u32, point_in_world: vec3f, normal: vec3f) -> f32 {
    let way = discs[index].position - point_in_world;
    let facing = dot(normal, way);
    let leaving = -dot(discs[index].normal, way);
    if facing <= 0.0 || leaving <= 0.0 || !is_open(index, -way) {
        return 0.0;
    }
    let squared = dot(way, way);
    let area = discs[index].area;
    return facing * leaving * area / (max(squared, 1e-12) * (squared + area / PI));
}

// Whether a disc's thing leaves a direction open.
fn is_open(index: u32, direction: vec3f) -> bool {
    let whole = abs(direction);
    let flat = direction.xy / max(whole.x + whole.y + whole.z, 1e-20);
    let sign = select(vec2f(-1.0), vec2f(1.0), direction.xy >= vec2f(0.0));
    let folded = select((1.0 - abs(flat.yx)) * sign, flat, direction.z >= 0.0);
    let cell = min(vec2u((folded * 0.5 + 0.5) * 8.0), vec2u(7u));
    let bit = cell.y * 8u + cell.x;
    let bits = select(discs[index].open_high, discs[index].open_low, bit < 32u);
    return (bits >> (bit & 31u) & 1u) == 1u;
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
    let to_camera = normalize(frame.world_from_camera[3].xyz - point_in_world);
    // Of what arrives and of what the glossy layer sends to the camera: all that the thing itself leaves, and what others take.
    var whole = vec3f(0.0);
    var taken = vec3f(0.0);
    var whole_gloss = vec3f(1e-6);
    var taken_gloss = vec3f(0.0);
    let first_open = sampled.thing * frame.region_count;
    for (var index = 0u; index < frame.region_count; index++) {
        let toward = regions[index].toward;
        let cosine = dot(normal, toward);
        if cosine <= 0.0 || open[first_open + index] == 0u {
            continue;
        }
        let arriving = regions[index].irradiance * (cosine * self_visibility(sampled, index));
        let hidden = 1.0 - left_by(0u, frame.caster_count, index, point_in_world, sampled.thing);
        let gloss = arriving * lobe(look.roughness, normal, toward, to_camera, regions[index].spread);
        whole += arriving;
        taken += arriving * hidden;
        whole_gloss += gloss;
        taken_gloss += gloss * hidden;
    }
    // The paper takes off what is hidden (equation 3). A part of what arrives is never more than all of it, whatever the few
    // regions miss.
    let subtracted = max(surface.indirect - taken, vec3f(0.0));
    let scaled = surface.indirect * (1.0 - taken / max(whole, vec3f(1e-6)));
    let arriving = select(scaled, subtracted, BY_PLANES);
    let left = 1.0 - taken_gloss / whole_gloss;
    return LightSums(vec4f(0.0), vec4f(radiance_in_probe(look, normal, to_camera, arriving, left), 1.0));
}

// The share of a region in what a glossy layer mirrors: the GGX distribution, as much wider as the region is.
fn lobe(roughness: f32, normal: vec3f, toward: vec3f, to_camera: vec3f, spread: f32) -> f32 {
    if !GLOSSY || roughness <= 0.0 {
        return 0.0;
    }
    let squared = min(roughness * roughness + 0.5 * spread * spread, 1.0);
    let cosine = clamp(dot(normal, normalize(toward + to_camera)), 0.0, 1.0);
    let width = cosine * cosine * (squared - 1.0) + 1.0;
    return squared / (PI * width * width);
}
