// What a glossy layer mirrors of light that comes from all around, and what it leaves to what lies below it.

// Over the square roots of the cosine to the camera and of roughness (light::layer_albedo).
@group(0) @binding(1) var layer_albedo: texture_2d<f32>;
@group(0) @binding(2) var layer_sampler: sampler;
// What rays have met for the lobe of the surface that is seen in a pixel, its mean radiance (reflections.wgsl). a: 1 where that is
// known, 0 where no such surface covers the pixel's middle, -1 where the lobe is too broad and weak to show it.
@group(0) @binding(3) var reflections: texture_2d<f32>;

// What the layer mirrors in a pixel: what rays have met, or `otherwise`.
fn reflected_or(at: vec2f, otherwise: vec3f) -> vec3f {
    let size = vec2i(textureDimensions(reflections));
    // (No rays are followed in this scene.)
    if !GLOSSY || size.x == 1 {
        return otherwise;
    }
    let pixel = vec2i(at);
    let own = textureLoad(reflections, pixel, 0);
    if own.a != 0.0 {
        return select(otherwise, own.rgb, own.a > 0.0);
    }
    // An edge of the surface beside the pixel's middle mirrors what it does in the pixels beside it.
    var sum = vec4f(0.0);
    for (var y = -1; y <= 1; y++) {
        for (var x = -1; x <= 1; x++) {
            sum += max(textureLoad(reflections, clamp(pixel + vec2i(x, y), vec2i(0), size - 1), 0), vec4f(0.0));
        }
    }
    return select(otherwise, sum.rgb / max(sum.a, 1.0), sum.a > 0.0);
}

// Radiance of a virtual surface in light that no lamp sends. `arriving`: irradiance of what lies below the layer; `around`: mean
// radiance where the layer mirrors it (Karis 2013: it is multiplied by what the layer reflects of light from everywhere).
fn radiance_all_around(look: Look, cos_camera: f32, arriving: vec3f, around: vec3f) -> vec3f {
//!if LOOKS
    let diffuse = look.albedo / PI * arriving * look.occlusion;
    if look.roughness <= 0.0 {
        return diffuse + look.emission;
    }
//!else
    let diffuse = look.albedo / PI * arriving;
    if !GLOSSY || look.roughness <= 0.0 {
        return diffuse;
    }
//!end
    let layer = layer_of(look.roughness, cos_camera);
    var below = let_through(layer);
//!if LOOKS
    if look.is_principled {
        below = mean_burley(look.roughness, cos_camera);
    }
//!end
    let dielectric = diffuse * below + around * (1.0 - let_through(layer));
//!if LOOKS
    let metal = around * (look.albedo * layer.x + layer.y) * look.occlusion;
    return mix(dielectric, metal, look.metallic) + look.emission;
//!else
    return dielectric;
//!end
}

// The mean of `burley` over light from everywhere, with 0.6 as the half angle's squared cosine: within .03 but for the last degrees.
fn mean_burley(roughness: f32, cos_camera: f32) -> f32 {
    let at_grazing = 1.2 * sqrt(roughness) - 0.5;
    return (1.0 + at_grazing / 21.0) * (1.0 + at_grazing * grazing(cos_camera));
}

// Part of the light that a dielectric's layer lets in or out (light::layer_albedo).
fn let_through(layer: vec3f) -> f32 {
    return 1.0 - (0.04 * layer.x + layer.y);
}

// Factor and summand that make what the layer mirrors of light from everywhere of what it mirrors of light head-on; and what a
// dielectric's mirrors of that on the average.
fn layer_of(roughness: f32, cosine: f32) -> vec3f {
    let side = vec2f(textureDimensions(layer_albedo));
    let entry = (vec2f(sqrt(cosine), sqrt(roughness)) * (side - 1.0) + 0.5) / side;
    return textureSampleLevel(layer_albedo, layer_sampler, entry, 0.0).rgb;
}
