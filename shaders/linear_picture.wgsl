// A picture of display values as linear light, for coarser levels to be made of; beyond its edges it goes on as it ends.
//!include "video.wgsl"
//!include "fullscreen.wgsl"

@group(0) @binding(0) var display: texture_2d<f32>;
// Of reflections.wgsl.
@group(0) @binding(1) var depths: texture_2d<f32>;

fn in_picture(position: vec4f) -> vec2i {
    return min(vec2i(position.xy), vec2i(textureDimensions(display)) - 1);
}

@fragment
fn linear(@builtin(position) position: vec4f) -> @location(0) vec4f {
    return vec4f(linear_from_srgb(textureLoad(display, in_picture(position), 0).rgb), 1.0);
}

// The part of it that is not virtual, nor beside what is, whose edge may cover some of the pixel: none of that comes into its
// coarser levels.
@fragment
fn linear_real(@builtin(position) position: vec4f) -> @location(0) vec4f {
    let pixel = in_picture(position);
    let end = vec2i(textureDimensions(display)) - 1;
    var nearest = 0.0;
    for (var y = -1; y <= 1; y++) {
        for (var x = -1; x <= 1; x++) {
            nearest = max(nearest, textureLoad(depths, clamp(pixel + vec2i(x, y), vec2i(0), end), 0).y);
        }
    }
    return select(vec4f(linear_from_srgb(textureLoad(display, pixel, 0).rgb), 1.0), vec4f(0.0), nearest > 0.0);
}
