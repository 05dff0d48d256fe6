// Shadow volumes into the stencil; no colour.
//!include "common.wgsl"
//!include "fullscreen.wgsl"

struct CastingLight {
    // In the caster's anchor: a point (w = 1), or the direction towards distant light (w = 0).
    place_in_anchor: vec4f,
    // A plane (normal, offset) at which the volume may end, and that every way from the light through the caster reaches; a
    // zero normal where there is none.
    end_in_anchor: vec4f,
}

@group(0) @binding(0) var<uniform> view: AnchorView;
@group(1) @binding(0) var<uniform> light: CastingLight;

struct Corner {
    @invariant @builtin(position) clip: vec4f,
}

// w = 1: the mesh's own vertices; w = 0: to be cast away from the light, to the end or to infinity.
@vertex
fn place(@location(0) corner: vec4f) -> Corner {
    return Corner(clip_from_point(view, select(cast_away(corner.xyz), corner, corner.w > 0.0)));
}

// Homogeneous, so that nothing is divided by what may be small.
fn cast_away(point: vec3f) -> vec4f {
    let away = point * light.place_in_anchor.w - light.place_in_anchor.xyz;
    let end = light.end_in_anchor;
    let falls = -dot(end.xyz, away);
    let height = dot(end.xyz, point) - end.w;
    return select(vec4f(away, 0.0), vec4f(point * falls + away * height, falls), falls > 0.0);
}

// Writes nothing: the pipelines mask all colours.
@fragment
fn count() {}
