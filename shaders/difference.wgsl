// The composite where what is hidden of a room's light is no part of the video's light (Gibson et al. 2003): where it is taken
// away as radiance (section 7), or from the encoded levels (section 7.1).
//!include "video.wgsl"
//!include "fullscreen.wgsl"
//!include "pixel_sums.wgsl"

//!if ENCODED
fn shown(radiance: vec3f) -> vec3f {
    return srgb_from_linear(radiance);
}

fn from_recorded(recorded: vec3f) -> vec3f {
    return recorded;
}

fn to_picture(light: vec3f) -> vec3f {
    return light;
}

fn to_linear(light: vec3f) -> vec3f {
    return linear_from_srgb(light);
}
//!else
fn shown(radiance: vec3f) -> vec3f {
    return radiance;
}

fn from_recorded(recorded: vec3f) -> vec3f {
    return linear_from_srgb(recorded);
}

fn to_picture(light: vec3f) -> vec3f {
    return srgb_from_linear(light);
}

fn to_linear(light: vec3f) -> vec3f {
    return light;
}
//!end

// What the virtual things do to a pixel, in the terms of `shown`.
struct Change {
    taken: vec3f,
    added: vec3f,
    // Part of the pixel that is not virtual.
    kept: f32,
    is_changed: bool,
}

fn change(pixel: vec2i) -> Change {
    let sums = pixel_sums(pixel);
    let kept = f32(SAMPLES) - sums.seeming;
    let weight = 1.0 / f32(SAMPLES);
    return Change(sums.taken * weight, sums.added * weight, kept * weight, is_changed(sums));
}

// The video's part of the pixel.
fn left(recorded: vec3f, change: Change) -> vec3f {
    return max(from_recorded(recorded) * change.kept - change.taken, vec3f(0.0));
}

@fragment
fn composite(@builtin(position) position: vec4f) -> @location(0) vec4f {
    let pixel = vec2i(position.xy);
    let recorded = undistorted(pixel);
    let change = change(pixel);
    if !change.is_changed {
        return vec4f(recorded, 1.0);
    }
    return vec4f(to_picture(left(recorded, change) + change.added), 1.0);
}

// The factor on the real part of the pixel, for the `gain` layer.
@fragment
fn gain(@builtin(position) position: vec4f) -> @location(0) vec4f {
    let pixel = vec2i(position.xy);
    let change = change(pixel);
    if change.kept <= 0.0 || !change.is_changed {
        return vec4f(1.0);
    }
    let recorded = undistorted(pixel);
    let left = to_linear(left(recorded, change) / change.kept);
    return vec4f(left / max(linear_from_srgb(recorded), vec3f(1e-4)), 1.0);
}
