// Surfaces and how they reflect one light, for all passes that shade.
//!include "area_lights.wgsl"

@group(0) @binding(0) var<uniform> view: AnchorView;
@group(1) @binding(0) var<uniform> light: CameraLight;

// Set when the shader is built: whether any material has a glossy layer.
override GLOSSY: bool = true;

struct SurfaceCorner {
    @location(0) position: vec3f,
    @location(1) normal: vec3f,
    // Albedo, and the roughness of a glossy layer or 0.
    @location(2) material: vec4f,
    @location(3) indirect: vec3f,
}

struct Surface {
    @invariant @builtin(position) clip: vec4f,
    @location(0) point_in_camera: vec3f,
    @location(1) normal_in_camera: vec3f,
    @location(2) @interpolate(flat) material: vec4f,
    // Irradiance from the surroundings, lights aside (light::bounce).
    @location(3) indirect: vec3f,
}

@vertex
fn place(corner: SurfaceCorner) -> Surface {
    return placed(corner);
}

fn placed(corner: SurfaceCorner) -> Surface {
    let point = vec4f(corner.position, 1.0);
    return Surface(
        clip_from_point(view, point),
        (view.camera_from_anchor * point).xyz,
        (view.camera_from_anchor * vec4f(corner.normal, 0.0)).xyz,
        corner.material,
        corner.indirect,
    );
}

fn irradiance(surface: Surface, outside: bool) -> vec3f {
    let normal = unit(surface.normal_in_camera) * select(-1.0, 1.0, outside);
    return incidence(light, surface.point_in_camera, normal).irradiance;
}

// Radiance of a virtual surface towards the camera.
fn radiance(surface: Surface, outside: bool) -> vec3f {
    let normal = unit(surface.normal_in_camera) * select(-1.0, 1.0, outside);
    let arriving = incidence(light, surface.point_in_camera, normal);
    let to_camera = normalize(-surface.point_in_camera);
    // The highlight of a light of some size is as much wider as the variances of its disc and of the slopes add up to (the
    // halfway vector turns half as far as the light); a matt surface stays one.
    let alpha = surface.material.a;
    let roughness = select(0.0, min(sqrt(alpha * alpha + 0.125 * arriving.sine_squared), 1.0), alpha > 0.0);
    let reflected = reflectance(surface.material.rgb, roughness, normal, arriving.direction, to_camera);
    return arriving.irradiance * reflected;
}

// Where opposite normals meet there is none.
fn unit(normal: vec3f) -> vec3f {
    return normal * inverseSqrt(max(dot(normal, normal), 1e-20));
}

// The BRDF; its CPU twin is `light::reflectance`. Lambert under a dielectric GGX layer (Walter et al. 2007, with Schlick's
// Fresnel term and the height-correlated Smith term); roughness 0 means Lambert alone.
fn reflectance(albedo: vec3f, roughness: f32, normal: vec3f, to_light: vec3f, to_camera: vec3f) -> vec3f {
    let diffuse = albedo / PI;
    let cos_light = dot(normal, to_light);
    if !GLOSSY || roughness <= 0.0 || cos_light <= 0.0 {
        return diffuse;
    }
    let cos_camera = max(dot(normal, to_camera), 1e-3);
    let halfway = normalize(to_light + to_camera);
    let cos_half = clamp(dot(normal, halfway), 0.0, 1.0);
    let alpha_squared = roughness * roughness;
    let spread = cos_half * cos_half * (alpha_squared - 1.0) + 1.0;
    let distribution = alpha_squared / (PI * spread * spread);
    let visibility = 0.5
        / (cos_light * sqrt(cos_camera * cos_camera * (1.0 - alpha_squared) + alpha_squared)
            + cos_camera * sqrt(cos_light * cos_light * (1.0 - alpha_squared) + alpha_squared));
    let specular = distribution * visibility * fresnel(dot(to_light, halfway));
    // What the layer lets in and out again; the mean keeps a white material white.
    let let_through = (1.0 - fresnel(cos_light)) * (1.0 - fresnel(cos_camera)) / (1.0 - MEAN_FRESNEL);
    return diffuse * let_through + specular;
}

// Cosine-weighted mean of `fresnel` over the hemisphere.
const MEAN_FRESNEL: f32 = 0.04 + 0.96 / 21.0;

// Schlick's approximation for a dielectric of index 1.5.
fn fresnel(cosine: f32) -> f32 {
    let grazing = 1.0 - clamp(cosine, 0.0, 1.0);
    let grazing_squared = grazing * grazing;
    return 0.04 + 0.96 * grazing_squared * grazing_squared * grazing;
}
