// What lets light through, over the picture without it. First its opacity where it is seen (beside opaque surfaces, which
// hide it), then the composite of pictures of display values, in linear light.
//!include "shading.wgsl"
//!include "video.wgsl"
//!include "fullscreen.wgsl"

@fragment
fn opaque(surface: Surface) -> @location(0) vec4f {
    return vec4f(0.0);
}

@fragment
fn place_of_surface(surface: Surface) -> @location(0) vec4f {
    return vec4f(surface.point_in_camera, 1.0);
}

//!if LOOKS
// Opacity in x, in y 1 where it is seen.
@fragment
fn opacity_of_virtual(surface: Surface, @builtin(front_facing) outside: bool) -> @location(0) vec4f {
    let look = look(surface, outside);
    if look.opacity == 0.0 {
        discard;
    }
    let is_translucent = materials[surface.number].translucent != 0u;
    return vec4f(look.opacity, 1.0, 0.0, 0.0) * select(0.0, 1.0, is_translucent);
}
//!end

// All that is opaque; the same with the layers that were drawn before; all that is opaque in the layer's shadow, as if it were
// opaque too; the same with the layer itself.
@group(0) @binding(0) var opaque_alone: texture_2d<f32>;
@group(0) @binding(1) var before: texture_2d<f32>;
@group(0) @binding(2) var in_shadow: texture_2d<f32>;
@group(0) @binding(3) var with_layer: texture_2d<f32>;
@group(0) @binding(4) var opacity: texture_2d<f32>;
@group(0) @binding(5) var<uniform> layer: LayerOpacity;
// Places of opaque surfaces in the camera's space, w 1 where there is one.
@group(0) @binding(6) var places: texture_2d<f32>;
// The layer as the brightest light sees it: opacity, and 1 where the light's rays meet it.
@group(0) @binding(7) var opacity_map: texture_2d<f32>;
@group(0) @binding(8) var map_sampler: sampler;

struct LayerOpacity {
    // To the map's coordinates, homogeneous.
    map_from_camera: mat4x4f,
    // Part of the light that the layer takes on the average.
    mean: f32,
    has_map: u32,
    padding: vec2u,
}

// Part of the light that the layer takes of what reaches the opaque surface in a pixel.
fn taken(pixel: vec2i) -> f32 {
    let place = textureLoad(places, pixel, 0);
    if layer.has_map == 0u || place.w == 0.0 {
        return layer.mean;
    }
    let on_map = layer.map_from_camera * place;
    let at = on_map.xy / on_map.w;
    if on_map.w <= 0.0 || any(at < vec2f(0.0)) || any(at > vec2f(1.0)) {
        return layer.mean;
    }
    let seen = textureSampleLevel(opacity_map, map_sampler, at, 0.0);
    return select(layer.mean, seen.x / max(seen.y, 0.5), seen.y > 0.5);
}

// How opaque the layer is around a pixel whose middle it does not cover.
fn opacity_beside(pixel: vec2i) -> f32 {
    let last = vec2i(textureDimensions(opacity)) - 1;
    var sum = vec2f(0.0);
    for (var y = -1; y <= 1; y++) {
        for (var x = -1; x <= 1; x++) {
            sum += textureLoad(opacity, clamp(pixel + vec2i(x, y), vec2i(0), last), 0).xy;
        }
    }
    return select(layer.mean, sum.x / max(sum.y, 1.0), sum.y > 0.0);
}

@fragment
fn over(@builtin(position) position: vec4f) -> @location(0) vec4f {
    let pixel = vec2i(position.xy);
    let alone = textureLoad(opaque_alone, pixel, 0).rgb;
    let behind = textureLoad(before, pixel, 0).rgb;
    let shadowed = textureLoad(in_shadow, pixel, 0).rgb;
    let seen = textureLoad(with_layer, pixel, 0).rgb;
    let veil = textureLoad(opacity, pixel, 0).xy;
    // What the layer does not touch stays bit for bit.
    if all(shadowed == alone) && all(seen == shadowed) && veil.y == 0.0 {
        return vec4f(behind, 1.0);
    }
    // Of the light that its whole shadow takes it takes its part.
    let lost = linear_from_srgb(shadowed) / max(linear_from_srgb(alone), vec3f(1e-4)) - 1.0;
    let lost_there = select(lost, vec3f(0.0), shadowed == alone);
    let left = linear_from_srgb(behind) * max(1.0 + taken(pixel) * lost_there, vec3f(0.0));
    // Beside its middle a pixel may see the edge of it all the same.
    let edge = left + opacity_beside(pixel) * (linear_from_srgb(seen) - linear_from_srgb(shadowed));
    let covered = mix(left, linear_from_srgb(seen), veil.x);
    return vec4f(srgb_from_linear(select(max(edge, vec3f(0.0)), covered, veil.y > 0.0)), 1.0);
}
