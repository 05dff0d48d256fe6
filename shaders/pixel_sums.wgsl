// What the samples of a pixel add up to. Who includes this says by `shown` in which terms virtual light is added.

//!if MULTISAMPLED
@group(0) @binding(0) var reaching: texture_multisampled_2d<f32>;
@group(0) @binding(1) var changes: texture_multisampled_2d<f32>;
//!else
@group(0) @binding(0) var reaching: texture_2d<f32>;
@group(0) @binding(1) var changes: texture_2d<f32>;
//!end

// Set when the shader is built: the number of samples per pixel.
override SAMPLES: i32 = 4;

struct PixelSums {
    // Light of virtual surfaces.
    added: vec3f,
    // Irradiance on real surfaces without virtual things, and what these take of it.
    light: vec3f,
    taken: vec3f,
    // Samples on real surfaces, and on virtual ones.
    modelled: f32,
    seeming: f32,
}

fn pixel_sums(pixel: vec2i) -> PixelSums {
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
        added += select(vec3f(0.0), shown(change.rgb), is_virtual);
        seeming += select(0.0, 1.0, is_virtual);
        light += select(vec3f(0.0), reaches.rgb, is_real);
        taken += select(vec3f(0.0), change.rgb, is_real);
        modelled += select(0.0, 1.0, is_real);
    }
    return PixelSums(added, light, taken, modelled, seeming);
}

// A surface that loses and gains nothing keeps its picture bit for bit.
fn is_changed(sums: PixelSums) -> bool {
    return sums.seeming > 0.0 || any(sums.taken != vec3f(0.0));
}
