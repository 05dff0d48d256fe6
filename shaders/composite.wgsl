// The composite: video · gain + added in linear light, undistorted at the same camera matrix K; or one of the two other ways
// of taking what is hidden out of the video.
//!include "video.wgsl"
//!include "whole_picture.wgsl"

// Replaced by the number of samples per pixel when the shader is built.
override SAMPLES: i32 = 4;
// How what is hidden is taken out of the video: 0 as a part of its light, 1 as radiance, 2 from its encoded levels.
override DIFFERENCE: i32 = 0;

@group(0) @binding(0) var reaching: texture_multisampled_2d<f32>;
@group(0) @binding(1) var changes: texture_multisampled_2d<f32>;

// What the virtual things do to a pixel: a real surface's light is scaled, a virtual one's is added.
struct Change {
    gain: vec3f,
    added: vec3f,
    // What is taken away where that is not the gain's to do.
    taken: vec3f,
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
        let colour = select(change.rgb, srgb_from_linear(change.rgb), DIFFERENCE == 2);
        added += select(vec3f(0.0), colour, is_virtual);
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
    let kept_gain = select(vec3f(kept), gain * modelled + (kept - modelled), DIFFERENCE == 0);
    return Change(kept_gain * weight, added * weight, taken * weight, kept * weight, touched);
}

// The video's part of the pixel, in the terms of `added`.
fn left(recorded: vec3f, change: Change) -> vec3f {
    if DIFFERENCE == 2 {
        return max(recorded * change.gain - change.taken, vec3f(0.0));
    }
    let linear = linear_from_srgb(recorded) * change.gain;
    return select(linear, max(linear - change.taken, vec3f(0.0)), DIFFERENCE == 1);
}

@fragment
fn composite(@builtin(position) position: vec4f) -> @location(0) vec4f {
    let pixel = vec2i(position.xy);
    let recorded = undistorted(pixel);
    let change = change(pixel);
    if !change.touched {
        return vec4f(recorded, 1.0);
    }
    let together = left(recorded, change) + change.added;
    return vec4f(select(srgb_from_linear(together), together, DIFFERENCE == 2), 1.0);
}

// The factor on the real part of the pixel, for the `gain` layer.
@fragment
fn gain(@builtin(position) position: vec4f) -> @location(0) vec4f {
    let pixel = vec2i(position.xy);
    let change = change(pixel);
    if change.kept <= 0.0 || !change.touched {
        return vec4f(1.0);
    }
    if DIFFERENCE == 0 {
        return vec4f(change.gain / change.kept, 1.0);
    }
    let recorded = undistorted(pixel);
    let left = left(recorded, change) / change.kept;
    let linear = select(left, linear_from_srgb(left), DIFFERENCE == 2);
    return vec4f(linear / max(linear_from_srgb(recorded), vec3f(1e-4)), 1.0);
}
