// The composite: video · gain + added in linear light, undistorted at the same camera matrix K.
//!include "video.wgsl"
//!include "whole_picture.wgsl"

// Replaced by the number of samples per pixel when the shader is built.
override SAMPLES: i32 = 4;

@group(0) @binding(0) var reaching: texture_multisampled_2d<f32>;
@group(0) @binding(1) var changes: texture_multisampled_2d<f32>;

// What the virtual things do to a pixel: a real surface's light is scaled, a virtual one's is added.
struct Change {
    gain: vec3f,
    added: vec3f,
    // Part of the pixel that is not virtual.
    kept: f32,
    touched: bool,
}

fn change(pixel: vec2i) -> Change {
    var added = vec3f(0.0);
    var light = vec3f(0.0);
    var taken = vec3f(0.0);
    var modelled = 0.0;
    var seeming = 0.0;
    for (var sample = 0; sample < SAMPLES; sample++) {
        let change = textureLoad(changes, pixel, sample);
        let is_virtual = change.a > 0.5;
        let reaches = textureLoad(reaching, pixel, sample);
        let is_real = !is_virtual && reaches.a > 0.5;
        added += select(vec3f(0.0), change.rgb, is_virtual);
        seeming += select(0.0, 1.0, is_virtual);
        light += select(vec3f(0.0), reaches.rgb, is_real);
        taken += select(vec3f(0.0), change.rgb, is_real);
        modelled += select(0.0, 1.0, is_real);
    }
    // The video's pixel is what all its light made of it: of that, and not sample by sample, a part is taken. Where a
    // virtual shadow meets a real one, the samples in the real one have less to lose, and made less of the pixel.
    let gain = select(vec3f(1.0), max(light - taken, vec3f(0.0)) / max(light, vec3f(1e-6)), taken != vec3f(0.0));
    let kept = f32(SAMPLES) - seeming;
    let weight = 1.0 / f32(SAMPLES);
    // A surface that loses and gains nothing keeps its picture bit for bit.
    let touched = seeming > 0.0 || any(taken != vec3f(0.0));
    return Change((gain * modelled + kept - modelled) * weight, added * weight, kept * weight, touched);
}

@fragment
fn composite(@builtin(position) position: vec4f) -> @location(0) vec4f {
    let pixel = vec2i(position.xy);
    let recorded = undistorted(pixel);
    let change = change(pixel);
    if !change.touched {
        return vec4f(recorded, 1.0);
    }
    return vec4f(srgb_from_linear(linear_from_srgb(recorded) * change.gain + change.added), 1.0);
}

// The factor on the real part of the pixel, for the `gain` layer.
@fragment
fn gain(@builtin(position) position: vec4f) -> @location(0) vec4f {
    let change = change(vec2i(position.xy));
    return vec4f(select(vec3f(1.0), change.gain / max(change.kept, 1e-6), change.kept > 0.0), 1.0);
}
