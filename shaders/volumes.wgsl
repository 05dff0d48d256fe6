// Shadow volumes into the stencil; no colour.
//!include "common.wgsl"

@group(0) @binding(0) var<uniform> view: View;

struct Corner {
    @invariant @builtin(position) clip: vec4f,
}

// w = 1: the mesh's own vertices; w = 0: cast to infinity.
@vertex
fn place(@location(0) position: vec4f) -> Corner {
    return Corner(clip_from_point(view, position));
}

// Writes nothing: the pipelines mask all colours.
@fragment
fn count() {}
