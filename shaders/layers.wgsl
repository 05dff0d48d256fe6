// Layers for tests and tools, at the pixels' centres: role and depth of the visible surface, and shadow bits.
//!include "common.wgsl"
//!include "fullscreen.wgsl"

@group(0) @binding(0) var<uniform> view: AnchorView;

struct Surface {
    @invariant @builtin(position) clip: vec4f,
    @location(0) depth_m: f32,
}

struct Layers {
    @location(0) role: vec4f,
    @location(1) depth_m: vec4f,
}

@vertex
fn place(@location(0) position: vec3f) -> Surface {
    let point = vec4f(position, 1.0);
    return Surface(clip_from_point(view, point), (view.camera_from_anchor * point).z);
}

@fragment
fn real(surface: Surface) -> Layers {
    return Layers(vec4f(100.0 / 255.0), vec4f(surface.depth_m));
}

@fragment
fn virtual_thing(surface: Surface) -> Layers {
    return Layers(vec4f(200.0 / 255.0), vec4f(surface.depth_m));
}

// Drawn where the stencil counts a volume; the bits add up by blending.
@fragment
fn in_real_shadow() -> @location(0) vec4f {
    return vec4f(1.0 / 255.0);
}

@fragment
fn in_virtual_shadow() -> @location(0) vec4f {
    return vec4f(2.0 / 255.0);
}

// Drawn where the stencil has one number; the pipelines' constant blends in that number.
@fragment
fn counted() -> @location(0) vec4f {
    return vec4f(1.0);
}
