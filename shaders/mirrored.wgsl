// What a glossy layer mirrors of a probe's light, latitude-longitude; the square root of roughness rises evenly with the level.

@group(2) @binding(7) var environment: texture_2d<f32>;
@group(2) @binding(8) var environment_sampler: sampler;
// What a layer mirrors of light from everywhere, over the square roots of the cosine to the camera and of roughness.
@group(2) @binding(9) var layer_albedo: texture_2d<f32>;

// Radiance of a virtual surface with a glossy layer in a probe's light. `arriving`: irradiance of what lies below the layer;
// `left`: part of what the layer mirrors that nothing hides.
fn radiance_in_probe(look: Look, normal: vec3f, to_camera: vec3f, arriving: vec3f, left: vec3f) -> vec3f {
    let diffuse = diffuse_below(look, arriving);
//!if LOOKS
    if look.roughness <= 0.0 {
        return diffuse + look.emission;
    }
//!else
    if !GLOSSY || look.roughness <= 0.0 {
        return diffuse;
    }
//!end
    let mean = mean_of_probe(reflect(-to_camera, normal), sqrt(look.roughness)) * left;
    return radiance_of_layers(look, max(dot(normal, to_camera), 1e-3), diffuse, mean);
}

// Radiance of what lies below the layer, as if that were not there.
fn diffuse_below(look: Look, arriving: vec3f) -> vec3f {
//!if LOOKS
    return look.albedo / PI * arriving * look.occlusion;
//!else
    return look.albedo / PI * arriving;
//!end
}

// Radiance of a surface that has a glossy layer (Karis 2013: a mean of what arrives over the layer's lobe times what it reflects
// of light from everywhere). `diffuse`: radiance of what lies below the layer, as if that were not there; `mean`: that mean.
fn radiance_of_layers(look: Look, cos_camera: f32, diffuse: vec3f, mean: vec3f) -> vec3f {
    let evenness = sqrt(look.roughness);
    let mirrored = mean * reflected_of_all(vec3f(0.04), evenness, cos_camera);
    let dielectric = diffuse * (1.0 - fresnel(cos_camera)) + mirrored;
//!if LOOKS
    let metal = mean * reflected_of_all(look.albedo, evenness, cos_camera) * look.occlusion;
    return mix(dielectric, metal, look.metallic) + look.emission;
//!else
    return dielectric;
//!end
}

// The probe's mean radiance over a lobe.
fn mean_of_probe(direction: vec3f, evenness: f32) -> vec3f {
    let place = vec2f(atan2(direction.y, direction.x) / (2.0 * PI) + 0.5, acos(clamp(direction.z, -1.0, 1.0)) / PI);
    let level = evenness * f32(textureNumLevels(environment) - 1u);
    return textureSampleLevel(environment, environment_sampler, place, level).rgb;
}

// What a layer reflects of light from everywhere; `head_on`: of light that comes head-on.
fn reflected_of_all(head_on: vec3f, evenness: f32, cos_camera: f32) -> vec3f {
    let side = vec2f(textureDimensions(layer_albedo));
    let entry = (vec2f(sqrt(cos_camera), evenness) * (side - 1.0) + 0.5) / side;
    let reflected = textureSampleLevel(layer_albedo, environment_sampler, entry, 0.0).rg;
    return head_on * reflected.x + reflected.y;
}
