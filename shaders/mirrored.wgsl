// What a glossy layer mirrors of a probe's light, latitude-longitude; the square root of roughness rises evenly with the level.

@group(2) @binding(7) var environment: texture_2d<f32>;
@group(2) @binding(8) var environment_sampler: sampler;

// Radiance of a virtual surface in a probe's light, seen in a pixel. `arriving`: irradiance of what lies below its glossy layer;
// `left`: part of what the layer mirrors that nothing hides.
fn radiance_in_probe(at: vec2f, look: Look, normal: vec3f, to_camera: vec3f, arriving: vec3f, left: vec3f) -> vec3f {
    let cos_camera = max(dot(normal, to_camera), 1e-3);
    var around = vec3f(0.0);
    if GLOSSY && look.roughness > 0.0 {
        around = reflected_or(at, lobe_mean(reflect(-to_camera, normal), look.roughness) * left);
    }
    return radiance_all_around(look, cos_camera, arriving, around);
}

// Mean radiance of the probe over the lobe about a direction.
fn lobe_mean(direction: vec3f, roughness: f32) -> vec3f {
    let place = vec2f(atan2(direction.y, direction.x) / (2.0 * PI) + 0.5, acos(clamp(direction.z, -1.0, 1.0)) / PI);
    let level = sqrt(roughness) * f32(textureNumLevels(environment) - 1u);
    return textureSampleLevel(environment, environment_sampler, place, level).rgb;
}
