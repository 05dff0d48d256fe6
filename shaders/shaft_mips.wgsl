// Halves the atlas of the sources' maps: each texel is the mean of four.
//!include "fullscreen.wgsl"

@group(0) @binding(0) var finer: texture_2d<f32>;

@fragment
fn halve(@builtin(position) position: vec4f) -> @location(0) vec4f {
    let corner = 2 * vec2i(position.xy);
    return 0.25
        * (textureLoad(finer, corner, 0)
            + textureLoad(finer, corner + vec2i(1, 0), 0)
            + textureLoad(finer, corner + vec2i(0, 1), 0)
            + textureLoad(finer, corner + vec2i(1, 1), 0));
}
