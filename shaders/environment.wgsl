// An environment's broad light on real and virtual things that move and turn (Tamura et al. 2005): region by region what a
// thing hides of it from itself and what others hide.
//!include "sampled_surface.wgsl"
//!include "light_sums.wgsl"
//!include "depth_moments.wgsl"
//!include "mirrored.wgsl"
//!include "tables.wgsl"
//!if HARMONIC_GLOSS
//!include "harmonic_gloss.wgsl"
//!end

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

@group(2) @binding(0) var<uniform> frame: EnvironmentFrame;
// Two texels for each region.
@group(2) @binding(1) var region_table: texture_2d<u32>;
// Five for each map, of which each caster has as many as there are regions.
@group(2) @binding(2) var map_table: texture_2d<u32>;
// For each thing one with its middle and the number of its group of casters or 0, and four for each region: the harmonics in its direction as the thing sees it, or nothing
// where what throws no shadow (the table) hides it.
@group(2) @binding(3) var receiver_table: texture_2d<u32>;
// Five for each node of a tree: each group, then what is in it.
@group(2) @binding(4) var disc_table: texture_2d<u32>;
@group(2) @binding(5) var atlas: texture_2d<f32>;
@group(2) @binding(6) var atlas_sampler: sampler;

fn region(index: u32) -> Region {
    let first = bitcast<vec4f>(textureLoad(region_table, place_in_table(2u * index), 0));
    let second = bitcast<vec4f>(textureLoad(region_table, place_in_table(2u * index + 1u), 0));
    return Region(first.xyz, first.w, second.xyz, second.w);
}

fn map_words(number: u32, part: u32) -> vec4u {
    return textureLoad(map_table, place_in_table(5u * number + part), 0);
}

fn receiver_row(number: u32) -> vec4f {
    return bitcast<vec4f>(textureLoad(receiver_table, place_in_table(number), 0));
}

fn disc_words(index: u32, part: u32) -> vec4u {
    return textureLoad(disc_table, place_in_table(5u * index + part), 0);
}

// Set when the shader is built: whether a thing's shadow on another is as wide as at the other's middle, as in the paper.
override BY_PLANES: bool = false;
// Set when the shader is built: whether casters near each other hide light as one, as in the paper (section 4.2.3).
override GROUPED: bool = false;
// A group is seen as one disc from so many of its radii (reflected.rs).
const SEEN_AS_ONE: f32 = 4.0;
// Part of a pixel's light below which what is taken from it is left.
const LEAST_TAKEN: f32 = 0.001;

// Part of a region's light that a thing hides from a place of another, 0 to 1.
fn hidden(number: u32, region: Region, point: vec4f, receiver: u32) -> f32 {
    // (Most places lie beside most tiles.)
    let u = dot(bitcast<vec4f>(map_words(number, 0u)), point);
    if u < 0.0 || u > 1.0 {
        return 0.0;
    }
    let v = dot(bitcast<vec4f>(map_words(number, 1u)), point);
    if v < 0.0 || v > 1.0 {
        return 0.0;
    }
    let words = map_words(number, 4u);
    if (words.w & 0xffffu) == receiver {
        return 0.0;
    }
    let depth_row = bitcast<vec4f>(map_words(number, 2u));
    let sizes = bitcast<vec3f>(words.xyz);
    let range_m = sizes.y;
    let tile = MapTile(bitcast<vec4f>(map_words(number, 3u)), sizes.z, sizes.x, vec2f(u, v));
    if BY_PLANES {
        // Equations 5 and 6: between the planes through both middles.
        let middle = receiver_row(receiver * (1u + 4u * frame.region_count)).xyz;
        let distance = dot(depth_row, vec4f(middle, 1.0)) - 0.5 * range_m;
        if distance <= 0.0 {
            return 0.0;
        }
        // (A box of this width has this deviation.)
        return map_at(tile, 0.2887 * region.width * distance).x;
    }
    let depth = dot(depth_row, point);
    if depth <= 0.0 {
        return 0.0;
    }
    // As wide as the penumbra of the nearest part, then of what lies before the place on the average (Fernando 2005).
    let around = map_at(tile, region.spread * depth);
    if around.x < 1e-3 {
        return 0.0;
    }
    let mean = around.y / around.x;
    let behind = depth / range_m - mean;
    if behind <= 0.0 {
        return 0.0;
    }
    let blocker = blocker_depth(around, mean, behind);
    let seen = map_at(tile, region.spread * (depth - range_m * blocker));
    return part_before(seen, depth / range_m);
}

struct MapTile {
    // Where it begins in the atlas, and its side there.
    corner_side: vec4f,
    // Texels along its side, and of a metre.
    side_px: f32,
    texels_per_m: f32,
    place: vec2f,
}

// The map around a place, averaged over a deviation of so many metres.
fn map_at(tile: MapTile, spread_m: f32) -> vec3f {
    let level = clamp(log2(2.0 * spread_m * tile.texels_per_m), 0.0, log2(tile.side_px));
    let margin = 0.5 * exp2(level) / tile.side_px;
    let inside = clamp(tile.place, vec2f(margin), vec2f(1.0 - margin));
    let place = tile.corner_side.xy + inside * tile.corner_side.zw;
    return textureSampleLevel(atlas, atlas_sampler, place, level).xyz;
}

// Part of a region's light that a thing itself leaves to a place of it.
fn self_visibility(sampled: SampledSurface, index: u32) -> f32 {
    let row = sampled.thing * (1u + 4u * frame.region_count) + 1u + 4u * index;
    var sum = dot(sampled.visibility_0, receiver_row(row));
    // (Of what hides nothing from itself only the first harmonic is there.)
    if any(sampled.visibility_0.yzw != vec3f(0.0)) {
        sum += dot(sampled.visibility_1, receiver_row(row + 1u))
            + dot(sampled.visibility_2, receiver_row(row + 2u))
            + dot(sampled.visibility_3, receiver_row(row + 3u));
    }
    return clamp(recovered(vec3f(sum), vec3f(1.0), sampled.one).x, 0.0, 1.0);
}

// What of a region's light the casters from one to another leave to a place: of groups and of single ones the product.
fn left_by(first: u32, end: u32, index: u32, region: Region, point: vec4f, receiver: u32) -> f32 {
    var left = 1.0;
    for (var caster = first; caster < end; caster++) {
        var map = caster;
        if GROUPED {
            let whose = map_words(caster * frame.region_count, 4u).w;
            let group = (whose >> 16u) & 0x7fffu;
            // (Members of one group hide from each other by themselves.)
            let own = u32(receiver_row(receiver * (1u + 4u * frame.region_count)).w);
            if group != 0u && group != own {
                if (whose >> 31u) == 0u {
                    continue;
                }
                map = frame.caster_count + group - 1u;
            }
        }
        left *= 1.0 - hidden(map * frame.region_count + index, region, point, receiver);
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
    let point = vec4f(point_in_world, 1.0);
    for (var index = 0u; index < frame.region_count; index++) {
        let region = region(index);
        let cosine = dot(normal, region.toward);
        if cosine <= 0.0 {
            continue;
        }
        let by_itself = cosine * self_visibility(sampled, index);
        if by_itself <= 0.0 {
            continue;
        }
        let part = by_itself * left_by(0u, frame.real_caster_count, index, region, point, sampled.thing);
        let arriving = region.irradiance * part;
        reaching += arriving;
        let left = left_by(frame.real_caster_count, frame.caster_count, index, region, point, sampled.thing);
        taken += arriving * (1.0 - left);
    }
    let reflected = reflected(point_in_world, normal);
    reaching += reflected.reaching;
    let of_reflected = recovered(sampled.reflected, sampled.first_reflected, sampled.one);
    let lost = taken + reflected.taken + of_reflected;
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
        let first = bitcast<vec4f>(disc_words(index, 0u));
        let last = disc_words(index, 4u);
        let way = first.xyz - point_in_world;
        let radius = bitcast<f32>(last.x);
        let facing = dot(normal, way);
        if facing >= -radius && dot(way, way) < SEEN_AS_ONE * SEEN_AS_ONE * radius * radius {
            index++;
            continue;
        }
        if facing > 0.0 {
            let part = from_disc(index, first.w, way, facing);
            if part > 0.0 {
                sums.reaching += part * bitcast<vec3f>(disc_words(index, 2u).xyz);
                sums.taken += part * bitcast<vec3f>(disc_words(index, 3u).xyz);
            }
        }
        index = last.y;
    }
    return sums;
}

// Irradiance of a place for each unit of a disc's radiance; `way` leads from the place to the disc.
fn from_disc(index: u32, area: f32, way: vec3f, facing: f32) -> f32 {
    let second = disc_words(index, 1u);
    let leaving = -dot(bitcast<vec3f>(second.xyz), way);
    if leaving <= 0.0 || !is_open(index, second.w, -way) {
        return 0.0;
    }
    let squared = dot(way, way);
    return facing * leaving * area / (max(squared, 1e-12) * (squared + area / PI));
}

// Whether a disc's thing leaves a direction open.
fn is_open(index: u32, open_low: u32, direction: vec3f) -> bool {
    let whole = abs(direction);
    let flat = direction.xy / max(whole.x + whole.y + whole.z, 1e-20);
    let sign = select(vec2f(-1.0), vec2f(1.0), direction.xy >= vec2f(0.0));
    let folded = select((1.0 - abs(flat.yx)) * sign, flat, direction.z >= 0.0);
    let cell = min(vec2u((folded * 0.5 + 0.5) * 8.0), vec2u(7u));
    let bit = cell.y * 8u + cell.x;
    let bits = select(disc_words(index, 2u).w, open_low, bit < 32u);
    return (bits >> (bit & 31u) & 1u) == 1u;
}

// The first harmonic of the visibility of a place from which nothing is hidden, √(4π).
const NOTHING_HIDDEN: f32 = 3.5449077;

@fragment
fn light_on_virtual(sampled: SampledSurface, @builtin(front_facing) outside: bool) -> LightSums {
    let surface = surface(sampled);
    let point_in_world = (frame.world_from_camera * vec4f(surface.point_in_camera, 1.0)).xyz;
    var look = look(surface, outside);
//!if LOOKS
    if look.opacity == 0.0 {
        discard;
    }
    // What its shape hides of the light is told by rays already: a picture of occlusion counts for what is finer than its triangles.
    let open = recovered(vec3f(sampled.visibility_0.x), vec3f(NOTHING_HIDDEN), sampled.one).x / NOTHING_HIDDEN;
    look.occlusion = min(look.occlusion / max(open, 1e-3), 1.0);
//!end
    let normal = (frame.world_from_camera * vec4f(look.normal, 0.0)).xyz;
    let to_camera = normalize(frame.world_from_camera[3].xyz - point_in_world);
    // Of what arrives and of what the glossy layer sends to the camera: all that the thing itself leaves, and what others take.
    var whole = vec3f(0.0);
    var taken = vec3f(0.0);
    var thrown_back = vec3f(0.0);
    var whole_gloss = vec3f(1e-6);
    var taken_gloss = vec3f(0.0);
//!if HARMONIC_GLOSS
    let direction = reflect(-to_camera, normal);
    let exponent = phong_exponent(max(look.roughness, 0.01));
//!end
    let point = vec4f(point_in_world, 1.0);
    for (var index = 0u; index < frame.region_count; index++) {
        let region = region(index);
        let toward = region.toward;
        let cosine = dot(normal, toward);
        if cosine <= 0.0 {
            continue;
        }
        let seen = self_visibility(sampled, index);
        let arriving = region.irradiance * (cosine * seen);
        let hidden = 1.0 - left_by(0u, frame.caster_count, index, region, point, sampled.thing);
        whole += arriving;
        taken += arriving * hidden;
//!if LOOKS
        if look.is_principled {
            let between = dot(toward, normalize(toward + to_camera));
            thrown_back += arriving * burley(look.roughness, cosine, dot(normal, to_camera), between);
        }
//!end
//!if HARMONIC_GLOSS
        // Equation 15, which knows no cosine.
        taken_gloss += region.irradiance * (seen * hidden * phong_lobe(exponent, direction, toward));
//!else
        let gloss = arriving * lobe(look.roughness, normal, toward, to_camera, region.spread);
        whole_gloss += gloss;
        taken_gloss += gloss * hidden;
//!end
    }
    // The paper takes off what is hidden (equation 3). A part of what arrives is never more than all of it, whatever the few
    // regions miss. What hides light reflects light, which nothing is taken of.
    let reflected = recovered(sampled.reflected, sampled.first_reflected, sampled.one);
    var from_afar = max(surface.indirect - reflected, vec3f(0.0));
//!if LOOKS
    if look.is_principled {
        // More than of light from everywhere, where most of it grazes the surface.
        let mean = mean_burley(look.roughness, max(dot(normal, to_camera), 1e-3));
        from_afar *= thrown_back / max(whole, vec3f(1e-6)) / mean;
    }
//!end
    let subtracted = max(from_afar - taken, vec3f(0.0));
    let scaled = from_afar * (1.0 - taken / max(whole, vec3f(1e-6)));
    let arriving = reflected + select(scaled, subtracted, BY_PLANES);
//!if HARMONIC_GLOSS
    if GLOSSY && look.roughness > 0.0 {
        let mean = max(mean_over_lobe(sampled, exponent) - taken_gloss, vec3f(0.0));
        let radiance = radiance_all_around(look, max(dot(normal, to_camera), 1e-3), arriving, mean);
        return LightSums(vec4f(0.0), vec4f(radiance, 1.0));
    }
//!end
    let left = 1.0 - taken_gloss / whole_gloss;
    return LightSums(vec4f(0.0), vec4f(radiance_in_probe(surface.clip.xy, look, normal, to_camera, arriving, left), 1.0));
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
