// What glossy virtual things mirror of what stands around them: rays over the lobe of each pixel's surface. What a ray meets is as
// bright as the picture shows it where the camera sees it too, and elsewhere as bright as the scene's light makes it.
//!include "shading.wgsl"
//!include "mirrored.wgsl"
//!include "ray_trees.wgsl"

struct ReflectionFrame {
    clip_from_camera: mat4x4f,
    // The turn of the space that the probe is known in.
    light_from_camera: mat4x4f,
    // Radiance of what no ray meets, where there is no probe.
    ambient: vec3f,
    thing_count: u32,
    light_count: u32,
    has_probe: u32,
    // So many pixels is a metre wide a metre off.
    focal_px: f32,
    padding: u32,
}

@group(2) @binding(0) var<uniform> frame: ReflectionFrame;
// Those that shine, and of each in the last number of its axis what it is.
@group(2) @binding(10) var<storage, read> lamps: array<CameraLight>;
// Depth of the real surface that is seen, and of the virtual one before it, metres; 0 where there is none.
@group(2) @binding(3) var depths: texture_2d<f32>;
// The video, the picture as it is without reflections, and the part of that which is not virtual (a: how much that is), linear;
// each level is the mean of four of the finer.
@group(2) @binding(4) var recorded: texture_2d<f32>;
@group(2) @binding(5) var shown: texture_2d<f32>;
@group(2) @binding(9) var shown_real: texture_2d<f32>;
@group(2) @binding(6) var picture_sampler: sampler;

// Set when the shader is built: rays of a lobe that one cannot stand for.
override RAYS: u32 = 16u;
// Below this roughness one ray is enough: the picture's own levels blur it.
const SHARP: f32 = 0.03;
// Set when the shader is built: a dielectric rougher than this shows nothing of what it mirrors beside what lies below its layer.
override ROUGHEST_DIELECTRIC: f32 = 0.5;
// What is seen may lie so far behind or before what a ray meets, as a part of its depth.
const SAME_DEPTH: f32 = 0.004;
// Rays start so far off a surface, as a part of its depth.
const OFF_SURFACE: f32 = 5e-4;

@fragment
fn depth_of_surface(surface: Surface) -> @location(0) vec4f {
    return vec4f(surface.point_in_camera.z);
}

@fragment
fn mirror(surface: Surface, @builtin(front_facing) outside: bool) -> @location(0) vec4f {
    let look = look(surface, outside);
    let alpha = look.roughness;
    if alpha <= 0.0 || (look.metallic < 0.05 && alpha > ROUGHEST_DIELECTRIC) {
        return vec4f(0.0, 0.0, 0.0, -1.0);
    }
    let point = surface.point_in_camera;
    let to_camera = normalize(-point);
    // (A smooth surface may look away where its triangle does not.)
    let normal = normalize(look.normal + to_camera * max(1e-3 - dot(look.normal, to_camera), 0.0));
    let origin = point + normal * (OFF_SURFACE * point.z);
    let cos_camera = dot(normal, to_camera);
    let across = normalize(to_camera - normal * cos_camera + any_across(normal) * 1e-4);
    let frame_of_surface = mat3x3f(across, cross(normal, across), normal);
    let view_direction = vec3f(sqrt(max(1.0 - cos_camera * cos_camera, 0.0)), 0.0, cos_camera);
    let masked = smith(alpha, cos_camera);
    // (There is one place in this shader where rays are followed: a driver puts all that it takes into each.)
    let is_sharp = alpha < SHARP;
    let rays = select(RAYS, 1u, is_sharp);
    var sum = vec4f(0.0);
    for (var index = 0u; index < rays; index++) {
        var halfway = vec3f(0.0, 0.0, 1.0);
        if !is_sharp {
            halfway = visible_normal(view_direction, alpha, sequence(index));
        }
        let direction = reflect(-view_direction, halfway);
        if direction.z <= 1e-3 && !is_sharp {
            continue;
        }
        // Where as many rays come as the lobe sends light, each counts by what the way out leaves of it.
        let out = smith(alpha, max(direction.z, 1e-3));
        let weight = out / (masked + out - masked * out);
        let spread = halfway.z * halfway.z * (alpha * alpha - 1.0) + 1.0;
        let density = alpha * alpha / (PI * spread * spread) * masked / (4.0 * cos_camera);
        // (One ray stands for what the lobe is as wide as at its middle.)
        let solid_angle = select(1.0 / (f32(RAYS) * density), 4.0 * PI * alpha * alpha, is_sharp);
        sum += vec4f(radiance_along(Ray(origin, frame_of_surface * direction), solid_angle), 1.0) * weight;
    }
    return vec4f(sum.rgb / max(sum.a, 1e-6), 1.0);
}

// Smith's term of one direction: the part of the slopes that are not hidden from it.
fn smith(alpha: f32, cosine: f32) -> f32 {
    return 2.0 * cosine / (cosine + sqrt(alpha * alpha + (1.0 - alpha * alpha) * cosine * cosine));
}

// Points of the unit square that fill it evenly (Hammersley).
fn sequence(index: u32) -> vec2f {
    return vec2f((f32(index) + 0.5) / f32(RAYS), f32(reverseBits(index)) / 4294967296.0 + 0.5 / f32(RAYS));
}

// A normal of GGX's slopes as they are seen from a direction above them (Dupuy & Benyoub 2023).
fn visible_normal(seen_from: vec3f, alpha: f32, sample: vec2f) -> vec3f {
    let stretched = normalize(vec3f(seen_from.xy * alpha, seen_from.z));
    let azimuth = 2.0 * PI * sample.x;
    let z = (1.0 - sample.y) * (1.0 + stretched.z) - stretched.z;
    let radius = sqrt(clamp(1.0 - z * z, 0.0, 1.0));
    let cap = vec3f(radius * cos(azimuth), radius * sin(azimuth), z) + stretched;
    return normalize(vec3f(cap.xy * alpha, max(cap.z, 1e-6)));
}

fn any_across(normal: vec3f) -> vec3f {
    return select(vec3f(0.0, normal.z, -normal.y), vec3f(normal.z, 0.0, -normal.x), abs(normal.x) < 0.7);
}

// Radiance that comes along a ray which stands for a solid angle.
fn radiance_along(ray: Ray, solid_angle: f32) -> vec3f {
    let hit = first_hit(ray, 1e6, frame.thing_count, 0u, 0u, false);
    if hit.triangle == 0u {
        return from_afar(ray.direction, sqrt(solid_angle / (4.0 * PI)));
    }
    let place = ray.origin + ray.direction * hit.distance;
    let normal = hit_normal(hit, ray.direction);
    let clip = frame.clip_from_camera * vec4f(place, 1.0);
    let at = clip.xy / max(clip.w, 1e-6) * vec2f(0.5, -0.5) + 0.5;
    let width_px = hit.distance * sqrt(solid_angle / PI) * frame.focal_px / max(place.z, 1e-6);
    let level = log2(max(2.0 * width_px, 1.0));
    // What is seen of it: of a virtual thing where there is enough to tell its colour, of a real one with what the video shows behind
    // virtual things, without the shadows of such.
    var part = vec4f(0.0);
    var video = vec3f(0.0);
    let is_real = is_real(hit);
    if clip.w > 0.0 && all(at > vec2f(0.0)) && all(at < vec2f(1.0)) {
        let size = vec2f(textureDimensions(depths));
        // (The linear pictures are larger, so that each level is half as large as the finer.)
        let in_picture = at * size / vec2f(textureDimensions(shown));
        let seen = textureLoad(depths, vec2i(at * size), 0).xy;
        if abs(select(seen.y, seen.x, is_real) - place.z) < SAME_DEPTH * place.z {
            part = textureSampleLevel(shown_real, picture_sampler, in_picture, level);
            if is_real {
                video = textureSampleLevel(recorded, picture_sampler, in_picture, level).rgb;
            } else {
                let whole = textureSampleLevel(shown, picture_sampler, in_picture, level).rgb;
                part = select(vec4f(0.0), vec4f(max(whole - part.rgb, vec3f(0.0)) / (1.0 - part.a), 1.0), part.a < 0.9);
            }
        }
    }
    if part.a > 0.999 {
        return part.rgb;
    }
    let is_in_video = any(video > vec3f(0.0));
    let light = light_at(place, normal, is_in_video);
    let modelled = hit_albedo(hit) / PI * light.beside_all;
    let otherwise = select(modelled, video * light.beside_all / max(light.beside_real, vec3f(1e-6)), is_in_video);
    return part.rgb + (1.0 - part.a) * otherwise;
}

// Radiance from where no ray meets anything, over a lobe.
fn from_afar(direction: vec3f, roughness: f32) -> vec3f {
    if frame.has_probe == 0u {
        return frame.ambient;
    }
    return lobe_mean((frame.light_from_camera * vec4f(direction, 0.0)).xyz, clamp(roughness, 0.0, 1.0));
}

// Irradiance of a place, about: of the light from everywhere as if nothing hid it, and of lights beside what hides them, of real
// things (where that is asked for) and of all.
struct LightAt {
    beside_real: vec3f,
    beside_all: vec3f,
}

fn light_at(place: vec3f, normal: vec3f, is_real_asked: bool) -> LightAt {
    let broad = PI * from_afar(normal, 1.0);
    var light = LightAt(broad, broad);
    let origin = place + normal * (OFF_SURFACE * max(place.z, 0.1));
    for (var index = 0u; index < frame.light_count; index++) {
        let lamp = lamps[index];
        let arriving = incidence_of(u32(lamp.axis_in_camera.w), lamp, place, normal).irradiance;
        if all(arriving <= vec3f(0.0)) {
            continue;
        }
        let way = lamp.place_in_camera.xyz - origin * lamp.place_in_camera.w;
        let reach = select(1e6, length(way), lamp.place_in_camera.w > 0.0);
        let ray = Ray(origin, normalize(way));
        // Beside real things first and then beside virtual ones, or beside all at once.
        var is_open = true;
        for (var step = select(1u, 0u, is_real_asked); step < 2u && is_open; step++) {
            let real = select(0u, IS_REAL, is_real_asked);
            let is_of_real = step == 0u;
            is_open = first_hit(ray, reach, frame.thing_count, CASTS | select(0u, real, is_of_real), select(real, 0u, is_of_real), true)
                .triangle == 0u;
            if is_open && is_of_real {
                light.beside_real += arriving;
            }
        }
        light.beside_all += select(vec3f(0.0), arriving, is_open);
    }
    return light;
}
