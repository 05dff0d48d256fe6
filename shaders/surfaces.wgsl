// Real and virtual surfaces: first what the ambient light gives them, then each light added where the stencil lets it.
//!include "common.wgsl"

@group(0) @binding(0) var<uniform> view: View;
@group(1) @binding(0) var<uniform> surroundings: Surroundings;
@group(1) @binding(1) var<uniform> light: LightSource;

struct Corner {
    @location(0) position: vec3f,
    @location(1) normal: vec3f,
    @location(2) albedo: vec3f,
    @location(3) roughness: f32,
}

struct Surface {
    @invariant @builtin(position) clip: vec4f,
    // Centroid: at the edge of a triangle the pixel's centre may lie outside it.
    @location(0) @interpolate(perspective, centroid) point_in_camera: vec3f,
    @location(1) @interpolate(perspective, centroid) normal_in_camera: vec3f,
    @location(2) @interpolate(flat) albedo: vec3f,
    @location(3) @interpolate(flat) roughness: f32,
}

struct Light {
    // Irradiance on a real surface without virtual things; a = 1 where the surface is real.
    @location(0) before: vec4f,
    // Irradiance on a real surface, or radiance of a virtual one, with them; a = 1 where the surface is virtual.
    @location(1) after: vec4f,
}

@vertex
fn place(corner: Corner) -> Surface {
    let point = vec4f(corner.position, 1.0);
    return Surface(
        clip_from_point(view, point),
        (view.camera_from_anchor * point).xyz,
        (view.camera_from_anchor * vec4f(corner.normal, 0.0)).xyz,
        corner.albedo,
        corner.roughness,
    );
}

@fragment
fn ambient_on_real(surface: Surface) -> Light {
    let irradiance = PI * surroundings.ambient_radiance.rgb;
    return Light(vec4f(irradiance, 1.0), vec4f(irradiance, 0.0));
}

@fragment
fn ambient_on_virtual(surface: Surface) -> Light {
    return Light(vec4f(0.0), vec4f(surface.albedo * surroundings.ambient_radiance.rgb, 1.0));
}

@fragment
fn light_on_real(surface: Surface, @builtin(front_facing) outside: bool) -> Light {
    let arriving = incidence(light, surface.point_in_camera);
    let normal = normalize(surface.normal_in_camera) * select(-1.0, 1.0, outside);
    let irradiance = arriving.irradiance * max(dot(normal, arriving.direction), 0.0);
    return Light(vec4f(irradiance, 0.0), vec4f(irradiance, 0.0));
}

@fragment
fn light_on_virtual(surface: Surface, @builtin(front_facing) outside: bool) -> Light {
    let arriving = incidence(light, surface.point_in_camera);
    let normal = normalize(surface.normal_in_camera) * select(-1.0, 1.0, outside);
    let to_camera = normalize(-surface.point_in_camera);
    let reflected = reflectance(surface.albedo, surface.roughness, normal, arriving.direction, to_camera);
    let radiance = arriving.irradiance * max(dot(normal, arriving.direction), 0.0) * reflected;
    return Light(vec4f(0.0), vec4f(radiance, 0.0));
}

// The BRDF; its CPU twin is `light::reflectance`. Lambert under a dielectric GGX layer (Walter et al. 2007, with Schlick's
// Fresnel term and the height-correlated Smith term); roughness 0 means Lambert alone.
fn reflectance(albedo: vec3f, roughness: f32, normal: vec3f, to_light: vec3f, to_camera: vec3f) -> vec3f {
    let diffuse = albedo / PI;
    let cos_light = dot(normal, to_light);
    if roughness <= 0.0 || cos_light <= 0.0 {
        return diffuse;
    }
    let cos_camera = max(dot(normal, to_camera), 1e-3);
    let halfway = normalize(to_light + to_camera);
    let cos_half = clamp(dot(normal, halfway), 0.0, 1.0);
    let alpha_squared = roughness * roughness * roughness * roughness;
    let spread = cos_half * cos_half * (alpha_squared - 1.0) + 1.0;
    let distribution = alpha_squared / (PI * spread * spread);
    let visibility = 0.5
        / (cos_light * sqrt(cos_camera * cos_camera * (1.0 - alpha_squared) + alpha_squared)
            + cos_camera * sqrt(cos_light * cos_light * (1.0 - alpha_squared) + alpha_squared));
    let grazing = 1.0 - clamp(dot(to_light, halfway), 0.0, 1.0);
    let grazing_squared = grazing * grazing;
    let fresnel = 0.04 + 0.96 * grazing_squared * grazing_squared * grazing;
    return diffuse * (1.0 - fresnel) + distribution * visibility * fresnel;
}
