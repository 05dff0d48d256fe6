// What a glossy layer mirrors of light that comes from all around, and what it leaves to what lies below it.

// Over the square roots of the cosine to the camera and of roughness (light::layer_albedo).
@group(0) @binding(1) var layer_albedo: texture_2d<f32>;
@group(0) @binding(2) var layer_sampler: sampler;

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
    let dielectric = diffuse * (1.0 - fresnel(cos_camera)) + around * (0.04 * layer.x + layer.y);
//!if LOOKS
    let metal = around * (look.albedo * layer.x + layer.y) * look.occlusion;
    return mix(dielectric, metal, look.metallic) + look.emission;
//!else
    return dielectric;
//!end
}

// Factor and summand that make what the layer mirrors of light from everywhere of what it mirrors of light head-on.
fn layer_of(roughness: f32, cos_camera: f32) -> vec2f {
    let side = vec2f(textureDimensions(layer_albedo));
    let entry = (vec2f(sqrt(cos_camera), sqrt(roughness)) * (side - 1.0) + 0.5) / side;
    return textureSampleLevel(layer_albedo, layer_sampler, entry, 0.0).rg;
}
