// What comes or goes: the picture with it over the picture without it. Both are display values.
//!include "fullscreen.wgsl"

@group(0) @binding(0) var without: texture_2d<f32>;
@group(0) @binding(1) var with_it: texture_2d<f32>;
// In x how much of it is to be seen, 0 to 1.
@group(0) @binding(2) var<uniform> visibility: vec4f;

@fragment
fn fade(@builtin(position) position: vec4f) -> @location(0) vec4f {
    let pixel = vec2i(position.xy);
    let low = textureLoad(without, pixel, 0);
    // Where nothing comes or goes the difference is 0, and the pixel stays bit for bit.
    return low + (textureLoad(with_it, pixel, 0) - low) * visibility.x;
}
