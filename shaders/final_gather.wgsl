// The ambient light and what things reflect on real surfaces (environment::final_gather), as it was gathered at the corners of
// small triangles that lie in them.
//!include "common.wgsl"
//!include "light_sums.wgsl"
//!include "partly_covered.wgsl"

@group(0) @binding(0) var<uniform> view: AnchorView;

struct GatheredCorner {
    @location(0) position: vec3f,
    @location(1) reaching: vec3f,
    @location(2) taken: vec3f,
}

struct GatheredSurface {
    @builtin(position) clip: vec4f,
    @location(0) @interpolate(perspective, centroid) reaching: vec3f,
    @location(1) @interpolate(perspective, centroid) taken: vec3f,
    @location(2) @interpolate(perspective, centroid) one: f32,
    // Of the triangle's first corner (see recovered).
    @location(3) @interpolate(flat) first_reaching: vec3f,
    @location(4) @interpolate(flat) first_taken: vec3f,
}

@vertex
fn place_gathered(corner: GatheredCorner, @builtin(vertex_index) index: u32) -> GatheredSurface {
    return GatheredSurface(
        clip_from_point(view, vec4f(corner.position, 1.0)),
        corner.reaching,
        corner.taken,
        one(index),
        corner.reaching,
        corner.taken,
    );
}

@fragment
fn gathered_on_real(surface: GatheredSurface) -> LightSums {
    let reaching = recovered(surface.reaching, surface.first_reaching, surface.one);
    let taken = recovered(surface.taken, surface.first_taken, surface.one);
    return LightSums(vec4f(max(reaching, vec3f(0.0)), 1.0), vec4f(taken, 0.0));
}
