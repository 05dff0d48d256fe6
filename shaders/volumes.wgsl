// Shadow volumes into the stencil; no colour.
//!include "common.wgsl"
//!include "whole_picture.wgsl"

struct CastingLight {
    // In the caster's anchor: a point (w = 1), or the direction towards distant light (w = 0).
    place_in_anchor: vec4f,
}

@group(0) @binding(0) var<uniform> view: View;
@group(1) @binding(0) var<uniform> light: CastingLight;

struct Corner {
    @invariant @builtin(position) clip: vec4f,
}

// w = 1: the mesh's own vertices; w = 0: to be cast away from the light to infinity.
@vertex
fn place(@location(0) corner: vec4f) -> Corner {
    let away = corner.xyz * light.place_in_anchor.w - light.place_in_anchor.xyz;
    return Corner(clip_from_point(view, vec4f(select(away, corner.xyz, corner.w > 0.0), corner.w)));
}

// Writes nothing: the pipelines mask all colours.
@fragment
fn count() {}
