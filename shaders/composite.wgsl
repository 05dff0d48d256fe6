// The composite: video · gain + added in linear light, undistorted at the same camera matrix K.
//!include "video.wgsl"
//!include "fullscreen.wgsl"
//!include "pixel_sums.wgsl"

fn shown(radiance: vec3f) -> vec3f {
    return radiance;
}

// What the virtual things do to a pixel: a real surface's light is scaled, a virtual one's is added.
struct Change {
    gain: vec3f,
    added: vec3f,
    // Part of the pixel that is not virtual.
    kept: f32,
    is_changed: bool,
}

fn change(pixel: vec2i) -> Change {
    let sums = pixel_sums(pixel);
    // The video's pixel is what all its light made of it: of that, and not sample by sample, a part is taken. Where a
    // virtual shadow meets a real one, the samples in the real one have less to lose, and made less of the pixel.
    let left = max(sums.light - sums.taken, vec3f(0.0)) / max(sums.light, vec3f(1e-6));
    let gain = select(vec3f(1.0), left, sums.taken != vec3f(0.0));
    let kept = f32(SAMPLES) - sums.seeming;
    let weight = 1.0 / f32(SAMPLES);
    let kept_gain = gain * sums.modelled + (kept - sums.modelled);
    return Change(kept_gain * weight, sums.added * weight, kept * weight, is_changed(sums));
}

@fragment
fn composite(@builtin(position) position: vec4f) -> @location(0) vec4f {
    let pixel = vec2i(position.xy);
    let recorded = undistorted(pixel);
    let change = change(pixel);
    // (So little may be taken that nothing is: the way to linear light and back would move a level all the same.)
    let is_same = all(change.gain == vec3f(1.0)) && all(change.added == vec3f(0.0));
    if !change.is_changed || is_same {
        return vec4f(recorded, 1.0);
    }
    return vec4f(srgb_from_linear(linear_from_srgb(recorded) * change.gain + change.added), 1.0);
}

// The factor on the real part of the pixel, for the `gain` layer.
@fragment
fn gain(@builtin(position) position: vec4f) -> @location(0) vec4f {
    let change = change(vec2i(position.xy));
    if change.kept <= 0.0 || !change.is_changed {
        return vec4f(1.0);
    }
    return vec4f(change.gain / change.kept, 1.0);
}
