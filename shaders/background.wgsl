// The video alone, as an ideal lens would have seen it.
//!include "video.wgsl"
//!include "fullscreen.wgsl"

@fragment
fn background(@builtin(position) position: vec4f) -> @location(0) vec4f {
    return vec4f(undistorted(vec2i(position.xy)), 1.0);
}
