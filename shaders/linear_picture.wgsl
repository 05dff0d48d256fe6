// A picture of display values as linear light, for coarser levels to be made of.
//!include "video.wgsl"
//!include "fullscreen.wgsl"

@group(0) @binding(0) var display: texture_2d<f32>;

@fragment
fn linear(@builtin(position) position: vec4f) -> @location(0) vec4f {
    return vec4f(linear_from_srgb(textureLoad(display, vec2i(position.xy), 0).rgb), 1.0);
}
