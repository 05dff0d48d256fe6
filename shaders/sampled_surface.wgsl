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
//!if LOOKS
    @location(8) @interpolate(perspective, centroid) uv: vec4f,
    @location(9) @interpolate(perspective, centroid) color: vec4f,
    @location(10) @interpolate(perspective, centroid) tangent_in_camera: vec4f,
    @location(11) @interpolate(flat) number: u32,
    @location(12) @interpolate(flat) first_uv: vec4f,
    @location(13) @interpolate(flat) first_color: vec4f,
    @location(14) @interpolate(flat) first_tangent: vec4f,
//!end
//!if OCCLUSION
    // Which directions the thing itself leaves open: 16 harmonics.
    @location(15) @interpolate(perspective, centroid) visibility_0: vec4f,
    @location(16) @interpolate(perspective, centroid) visibility_1: vec4f,
    @location(17) @interpolate(perspective, centroid) visibility_2: vec4f,
    @location(18) @interpolate(perspective, centroid) visibility_3: vec4f,
    // Number of the thing.
    @location(19) @interpolate(flat) thing: u32,
    // The part of the irradiance that is of what things reflect; on what is real, what virtual things take of that.
    @location(24) @interpolate(perspective, centroid) reflected: vec3f,
    @location(25) @interpolate(flat) first_reflected: vec3f,
//!end
//!if HARMONIC_GLOSS
    // What is mirrored, degree by degree (harmonic_gloss.wgsl).
    @location(20) @interpolate(perspective, centroid) degree_0: vec3f,
    @location(21) @interpolate(perspective, centroid) degree_1: vec3f,
    @location(22) @interpolate(perspective, centroid) degree_2: vec3f,
    @location(23) @interpolate(perspective, centroid) degree_3: vec3f,
//!end
}

//!if OCCLUSION
struct OcclusionCorner {
    @location(8) visibility_0: vec4f,
    @location(9) visibility_1: vec4f,
    @location(10) visibility_2: vec4f,
    @location(11) visibility_3: vec4f,
    @location(12) thing: u32,
    @location(13) reflected: vec3f,
}
//!end

@vertex
//!if OCCLUSION
fn place_sampled(corner: SurfaceCorner, occlusion: OcclusionCorner, @builtin(vertex_index) index: u32) -> SampledSurface {
//!else
fn place_sampled(corner: SurfaceCorner, @builtin(vertex_index) index: u32) -> SampledSurface {
//!end
    let placed = placed(corner);
//!if HARMONIC_GLOSS
    let degrees = mirrored_degrees(placed, occlusion);
//!end
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
//!if LOOKS
        placed.uv,
        placed.color,
        placed.tangent_in_camera,
        placed.number,
        placed.uv,
        placed.color,
        placed.tangent_in_camera,
//!end
//!if OCCLUSION
        occlusion.visibility_0,
        occlusion.visibility_1,
        occlusion.visibility_2,
        occlusion.visibility_3,
        occlusion.thing,
        occlusion.reflected,
        occlusion.reflected,
//!end
//!if HARMONIC_GLOSS
        degrees.degree_0,
        degrees.degree_1,
        degrees.degree_2,
        degrees.degree_3,
//!end
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
//!if LOOKS
        vec4f(
            recovered(vec3f(sampled.uv.xy, 0.0), vec3f(sampled.first_uv.xy, 0.0), one).xy,
            recovered(vec3f(sampled.uv.zw, 0.0), vec3f(sampled.first_uv.zw, 0.0), one).xy,
        ),
        vec4f(
            recovered(sampled.color.rgb, sampled.first_color.rgb, one),
            recovered(vec3f(sampled.color.a), vec3f(sampled.first_color.a), one).x,
        ),
        vec4f(recovered(sampled.tangent_in_camera.xyz, sampled.first_tangent.xyz, one), sampled.first_tangent.w),
        sampled.number,
//!end
    );
}
