// The composite: video · gain + added in linear light, undistorted at the same camera matrix K.
//!include "whole_picture.wgsl"

struct Lens {
    focal_px: vec2f,
    center_px: vec2f,
    // k1 k2 p1 p2 of OpenCV, then k3.
    distortion: vec4f,
    k3: f32,
    // 0 where the lens is perfect: the picture then passes untouched.
    distorts: u32,
    size_px: vec2u,
}

// Replaced by the number of samples per pixel when the shader is built.
override SAMPLES: i32 = 4;

@group(0) @binding(0) var<uniform> lens: Lens;
@group(0) @binding(1) var video: texture_2d<f32>;
@group(0) @binding(2) var reaching: texture_multisampled_2d<f32>;
@group(0) @binding(3) var changes: texture_multisampled_2d<f32>;

// What the virtual things do to a pixel: a real surface's light is scaled, a virtual one's is added.
struct Change {
    gain: vec3f,
    added: vec3f,
    // Part of the pixel that is not virtual.
    kept: f32,
    touched: bool,
}

fn change(pixel: vec2i) -> Change {
    var gain = vec3f(0.0);
    var added = vec3f(0.0);
    var kept = 0.0;
    var touched = false;
    for (var sample = 0; sample < SAMPLES; sample++) {
        let change = textureLoad(changes, pixel, sample);
        if change.a > 0.5 {
            added += change.rgb;
            touched = true;
            continue;
        }
        kept += 1.0;
        // A surface that loses nothing keeps its picture bit for bit.
        if all(change.rgb <= vec3f(0.0)) {
            gain += 1.0;
            continue;
        }
        let light = textureLoad(reaching, pixel, sample).rgb;
        gain += max(light - change.rgb, vec3f(0.0)) / max(light, vec3f(1e-6));
        touched = true;
    }
    let weight = 1.0 / f32(SAMPLES);
    return Change(gain * weight, added * weight, kept * weight, touched);
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

// The video alone.
@fragment
fn bare(@builtin(position) position: vec4f) -> @location(0) vec4f {
    return vec4f(undistorted(vec2i(position.xy)), 1.0);
}

// The factor on the real part of the pixel, for the `gain` layer.
@fragment
fn gain(@builtin(position) position: vec4f) -> @location(0) vec4f {
    let change = change(vec2i(position.xy));
    return vec4f(select(vec3f(1.0), change.gain / max(change.kept, 1e-6), change.kept > 0.0), 1.0);
}

// The recorded picture where an ideal lens would have seen this pixel, still sRGB-encoded.
fn undistorted(pixel: vec2i) -> vec3f {
    if lens.distorts == 0u {
        return textureLoad(video, pixel, 0).rgb;
    }
    let ideal = (vec2f(pixel) - lens.center_px) / lens.focal_px;
    let k = lens.distortion;
    let r2 = dot(ideal, ideal);
    let radial = 1.0 + r2 * (k.x + r2 * (k.y + r2 * lens.k3));
    let cross_term = 2.0 * ideal.x * ideal.y;
    let seen = ideal * radial
        + vec2f(k.z * cross_term + k.w * (r2 + 2.0 * ideal.x * ideal.x), k.z * (r2 + 2.0 * ideal.y * ideal.y) + k.w * cross_term);
    return bilinear(seen * lens.focal_px + lens.center_px);
}

// By hand, because samplers interpolate with few bits; beyond the edge the edge goes on.
fn bilinear(pixel: vec2f) -> vec3f {
    let last = vec2i(lens.size_px) - 1;
    let corner = floor(pixel);
    let weight = pixel - corner;
    let low = clamp(vec2i(corner), vec2i(0), last);
    let high = clamp(vec2i(corner) + 1, vec2i(0), last);
    let top = mix(textureLoad(video, low, 0).rgb, textureLoad(video, vec2i(high.x, low.y), 0).rgb, weight.x);
    let bottom = mix(textureLoad(video, vec2i(low.x, high.y), 0).rgb, textureLoad(video, high, 0).rgb, weight.x);
    return mix(top, bottom, weight.y);
}

// IEC 61966-2-1.
fn linear_from_srgb(encoded: vec3f) -> vec3f {
    return select(pow((encoded + 0.055) / 1.055, vec3f(2.4)), encoded / 12.92, encoded <= vec3f(0.04045));
}

fn srgb_from_linear(linear: vec3f) -> vec3f {
    let displayed = clamp(linear, vec3f(0.0), vec3f(1.0));
    return select(1.055 * pow(displayed, vec3f(1.0 / 2.4)) - 0.055, displayed * 12.92, displayed <= vec3f(0.0031308));
}
