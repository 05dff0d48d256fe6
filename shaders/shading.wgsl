// Surfaces and how they reflect one light, for all passes that shade.
//!include "area_lights.wgsl"
//!include "layer_albedo.wgsl"
//!if LOOKS
//!include "materials.wgsl"
//!end

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
//!if LOOKS
    // Both sets of texture coordinates.
    @location(4) uv: vec4f,
    @location(5) color: vec4f,
    @location(6) tangent: vec4f,
    @location(7) number: u32,
//!end
}

struct Surface {
    @invariant @builtin(position) clip: vec4f,
    @location(0) point_in_camera: vec3f,
    @location(1) normal_in_camera: vec3f,
    @location(2) @interpolate(flat) material: vec4f,
    // Irradiance from the surroundings, lights aside (light::bounce).
    @location(3) indirect: vec3f,
//!if LOOKS
    @location(4) uv: vec4f,
    @location(5) color: vec4f,
    @location(6) tangent_in_camera: vec4f,
    @location(7) @interpolate(flat) number: u32,
//!end
}

// What a surface is made of at a place.
struct Look {
    albedo: vec3f,
    // 0: Lambert alone.
    roughness: f32,
    metallic: f32,
    emission: vec3f,
    // Part of the surroundings' light that arrives.
    occlusion: f32,
    // 0 where there is nothing, below 1 where light passes.
    opacity: f32,
    // Unit length, on the side that is seen.
    normal: vec3f,
    // Whether what lies below the layer is rough itself.
    is_principled: bool,
}

fn look(surface: Surface, outside: bool) -> Look {
    let side = select(-1.0, 1.0, outside);
    let normal = unit(surface.normal_in_camera);
//!if LOOKS
    return material_at(surface.number, surface.uv, surface.color, surface.tangent_in_camera, normal, side);
//!else
    return Look(surface.material.rgb, surface.material.a, 0.0, vec3f(0.0), 1.0, 1.0, normal * side, false);
//!end
}

// Radiance of a virtual surface without lights. Where no rays were followed, what its layer mirrors is as bright as what arrives is
// on the average: the ambient light with what hides it taken off, and what things around reflect.
fn ambient_radiance(surface: Surface, look: Look) -> vec3f {
    let cos_camera = max(dot(look.normal, normalize(-surface.point_in_camera)), 1e-3);
    let around = reflected_or(surface.clip.xy, surface.indirect / PI);
    return radiance_all_around(look, cos_camera, surface.indirect, around);
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
//!if LOOKS
        corner.uv,
        corner.color,
        vec4f((view.camera_from_anchor * vec4f(corner.tangent.xyz, 0.0)).xyz, corner.tangent.w),
        corner.number,
//!end
    );
}

fn irradiance(surface: Surface, outside: bool) -> vec3f {
    let normal = unit(surface.normal_in_camera) * select(-1.0, 1.0, outside);
    return incidence(light, surface.point_in_camera, normal).irradiance;
}

// Radiance of a virtual surface towards the camera.
fn radiance(surface: Surface, look: Look) -> vec3f {
    let arriving = incidence(light, surface.point_in_camera, look.normal);
    let to_camera = normalize(-surface.point_in_camera);
    // The highlight of a light of some size is as much wider as the variances of its disc and of the slopes add up to (the
    // halfway vector turns half as far as the light); a matt surface stays one.
    let alpha = look.roughness;
    var widened = look;
    widened.roughness = select(0.0, min(sqrt(alpha * alpha + 0.125 * arriving.sine_squared), 1.0), alpha > 0.0);
    return arriving.irradiance * reflectance(widened, arriving.direction, to_camera);
}

// Where opposite normals meet there is none.
fn unit(normal: vec3f) -> vec3f {
    return normal * inverseSqrt(max(dot(normal, normal), 1e-20));
}

// The BRDF; its CPU twin is `light::reflectance`. Lambert under a dielectric GGX layer (Walter et al. 2007, with Schlick's
// Fresnel term and the height-correlated Smith term); roughness 0 means Lambert alone; a metal is the layer in its colour.
fn reflectance(look: Look, to_light: vec3f, to_camera: vec3f) -> vec3f {
    let normal = look.normal;
    let roughness = look.roughness;
    let diffuse = look.albedo / PI;
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
    let out = layer_of(roughness, cos_camera);
    let passed = let_through(layer_of(roughness, cos_light)) * let_through(out) / (1.0 - out.z);
//!if LOOKS
    let below = select(passed, burley(roughness, cos_light, cos_camera, dot(to_light, halfway)), look.is_principled);
    let dielectric = diffuse * below + specular;
    let metal = look.albedo + (1.0 - look.albedo) * grazing(dot(to_light, halfway));
    return mix(dielectric, distribution * visibility * metal, look.metallic);
//!else
    return diffuse * passed + specular;
//!end
}

// Times Lambert: what a rough surface throws back of grazing light (Burley 2012, section 5.3).
fn burley(alpha: f32, cos_light: f32, cos_camera: f32, cos_between: f32) -> f32 {
    let at_grazing = 2.0 * sqrt(alpha) * cos_between * cos_between - 0.5;
    return (1.0 + at_grazing * grazing(cos_light)) * (1.0 + at_grazing * grazing(cos_camera));
}

// Schlick's approximation for a dielectric of index 1.5.
fn fresnel(cosine: f32) -> f32 {
    return 0.04 + 0.96 * grazing(cosine);
}

// Schlick's weight of grazing light.
fn grazing(cosine: f32) -> f32 {
    let left = 1.0 - clamp(cosine, 0.0, 1.0);
    let left_squared = left * left;
    return left_squared * left_squared * left;
}
