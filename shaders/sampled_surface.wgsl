// A surface drawn with several samples per pixel.
//!include "shading.wgsl"
//!include "partly_covered.wgsl"

struct SampledSurface {
    @invariant @builtin(position) clip: vec4f,
    @location(0) @interpolate(perspective, centroid) point_in_camera: vec3f,
    @location(1) @interpolate(perspective, centroid) normal_in_camera: vec3f,
    @location(2) @interpolate(flat) material: vec4f,
    @location(3) @interpolate(perspective, centroid) indirect: vec3f,
    @location(4) @interpolate(perspective, centroid) one: f32,
    // Of the triangle's first corner (see recovered).
    @location(5) @interpolate(flat) first_point_in_camera: vec3f,
    @location(6) @interpolate(flat) first_normal_in_camera: vec3f,
    @location(7) @interpolate(flat) first_indirect: vec3f,
}

@vertex
fn place_sampled(corner: SurfaceCorner, @builtin(vertex_index) index: u32) -> SampledSurface {
    let placed = placed(corner);
    return SampledSurface(
        placed.clip,
        placed.point_in_camera,
        placed.normal_in_camera,
        placed.material,
        placed.indirect,
        one(index),
        placed.point_in_camera,
        placed.normal_in_camera,
        placed.indirect,
    );
}

fn surface(sampled: SampledSurface) -> Surface {
    let one = sampled.one;
    return Surface(
        sampled.clip,
        recovered(sampled.point_in_camera, sampled.first_point_in_camera, one),
        recovered(sampled.normal_in_camera, sampled.first_normal_in_camera, one),
        sampled.material,
        // (What is at the corners is never below 0, but rounding may be.)
        max(recovered(sampled.indirect, sampled.first_indirect, one), vec3f(0.0)),
    );
}
