// What light that a real surface loses comes to as radiance, where a picture says what the surface reflects: `change`
// (light_sums.wgsl) has it there as of a surface that reflects all. Reads the materials of real things. Multiplies `change`.
//!include "shading.wgsl"
//!include "partly_covered.wgsl"

struct PicturedCorner {
    @location(0) position: vec3f,
    @location(4) uv: vec4f,
    @location(5) color: vec4f,
    @location(7) number: u32,
}

struct PicturedSurface {
    @builtin(position) clip: vec4f,
    @location(0) @interpolate(perspective, centroid) uv: vec4f,
    @location(1) @interpolate(perspective, centroid) color: vec3f,
    @location(2) @interpolate(perspective, centroid) one: f32,
    @location(3) @interpolate(flat) number: u32,
    @location(4) @interpolate(flat) first_uv: vec4f,
    @location(5) @interpolate(flat) first_color: vec3f,
}

@vertex
fn place_pictured(corner: PicturedCorner, @builtin(vertex_index) index: u32) -> PicturedSurface {
    return PicturedSurface(
        clip_from_point(view, vec4f(corner.position, 1.0)),
        corner.uv,
        corner.color.rgb,
        one(index),
        corner.number,
        corner.uv,
        corner.color.rgb,
    );
}

@fragment
fn albedo_of_real(surface: PicturedSurface) -> @location(1) vec4f {
    let uv = vec4f(
        recovered(vec3f(surface.uv.xy, 0.0), vec3f(surface.first_uv.xy, 0.0), surface.one).xy,
        recovered(vec3f(surface.uv.zw, 0.0), vec3f(surface.first_uv.zw, 0.0), surface.one).xy,
    );
    let color = recovered(surface.color, surface.first_color, surface.one);
//!if LOOKS
    return vec4f(albedo_at(surface.number, uv, color), 1.0);
//!else
    return vec4f(color, uv.x);
//!end
}
