// What a glossy layer mirrors of a probe's light, latitude-longitude; the square root of roughness rises evenly with the level.

@group(2) @binding(7) var environment: texture_2d<f32>;
@group(2) @binding(8) var environment_sampler: sampler;
// What a layer mirrors of light from everywhere, over the square roots of the cosine to the camera and of roughness.
@group(2) @binding(9) var layer_albedo: texture_2d<f32>;

// Radiance of a virtual surface with a glossy layer in a probe's light. `arriving`: irradiance of what lies below the layer;
// `left`: part of what the layer mirrors that nothing hides.
fn radiance_in_probe(look: Look, normal: vec3f, to_camera: vec3f, arriving: vec3f, left: vec3f) -> vec3f {
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
    let cos_camera = max(dot(normal, to_camera), 1e-3);
    let direction = reflect(-to_camera, normal);
    let mirrored = mirrored(direction, sqrt(look.roughness), cos_camera, vec3f(0.04)) * left;
    let dielectric = diffuse * (1.0 - fresnel(cos_camera)) + mirrored;
//!if LOOKS
    let metal = mirrored_by_metal(direction, look, cos_camera) * left * look.occlusion;
    return mix(dielectric, metal, look.metallic) + look.emission;
//!else
    return dielectric;
//!end
}

// Radiance that the glossy layer mirrors of the environment (Karis 2013: a mean over the lobe times what the layer reflects
// of light from everywhere).
//!if LOOKS
fn mirrored_by_metal(direction: vec3f, look: Look, cos_camera: f32) -> vec3f {
    return mirrored(direction, sqrt(look.roughness), cos_camera, look.albedo);
}
//!end

// `head_on` is what the surface mirrors of light that comes head-on.
fn mirrored(direction: vec3f, evenness: f32, cos_camera: f32, head_on: vec3f) -> vec3f {
    let place = vec2f(atan2(direction.y, direction.x) / (2.0 * PI) + 0.5, acos(clamp(direction.z, -1.0, 1.0)) / PI);
    let level = evenness * f32(textureNumLevels(environment) - 1u);
    let mean = textureSampleLevel(environment, environment_sampler, place, level).rgb;
    let side = vec2f(textureDimensions(layer_albedo));
    let entry = (vec2f(sqrt(cos_camera), evenness) * (side - 1.0) + 0.5) / side;
    let reflected = textureSampleLevel(layer_albedo, environment_sampler, entry, 0.0).rg;
    return mean * (head_on * reflected.x + reflected.y);
}
