// What a light gives to a surface. The CPU twin of the irradiance is `light::irradiance`.
//!include "common.wgsl"

// Set when the shader is built: what its light is.
override LIGHT_KIND: u32 = 0;
const PLAIN: u32 = 0;
const SPOT: u32 = 1;
const ROUND: u32 = 2;
const RECT: u32 = 3;

struct Incidence {
    // Unit direction to the middle of what of the light is above the horizon, about.
    direction: vec3f,
    // What arrives on the surface.
    irradiance: vec3f,
    // Squared sine of half the width of a disc as large as the light is from here; 0 for a point.
    sine_squared: f32,
}

fn incidence(light: CameraLight, point: vec3f, normal: vec3f) -> Incidence {
    return incidence_of(LIGHT_KIND, light, point, normal);
}

fn incidence_of(kind: u32, light: CameraLight, point: vec3f, normal: vec3f) -> Incidence {
    let to_light = light.place_in_camera.xyz - point * light.place_in_camera.w;
    let distance_squared = max(dot(to_light, to_light), 1e-12);
    let direction = to_light * inverseSqrt(distance_squared);
    let falloff = select(1.0, 1.0 / distance_squared, light.place_in_camera.w > 0.0);
    let cosine = dot(normal, direction);
    if kind == PLAIN {
        return Incidence(direction, light.power.rgb * falloff * max(cosine, 0.0), 0.0);
    }
    // Irradiance over what the light gives to a surface that faces it.
    var mean_cosine = max(cosine, 0.0);
    var sine_squared = min(light.power.w * light.power.w * falloff, 1.0);
    if kind == SPOT {
        let ramp = clamp(-dot(direction, light.axis_in_camera.xyz) * light.half_width.x + light.half_width.y, 0.0, 1.0);
        mean_cosine *= ramp * ramp;
    } else if kind == RECT {
        let area = 4.0 * length(light.half_width.xyz) * length(light.half_height.xyz);
        let ahead = max(-dot(direction, light.axis_in_camera.xyz), 0.0);
        sine_squared = min(area * ahead * falloff / PI, 1.0);
        let reach_squared = dot(light.half_width, light.half_width) + dot(light.half_height, light.half_height);
        if reach_squared < FAR * distance_squared {
            mean_cosine *= ahead;
        } else {
            mean_cosine = rect_form(light, to_light, normal) * distance_squared / area;
        }
    } else if cosine * cosine < sine_squared {
        mean_cosine = disc_form(cosine, sine_squared) / (PI * light.power.w * light.power.w * falloff);
    }
    let lift = max(min(mean_cosine, 1.0) - cosine, 0.0);
    return Incidence(
        normalize(direction + normal * lift),
        light.power.rgb * (falloff * mean_cosine),
        sine_squared,
    );
}

// Half a rectangle's diagonal over its distance, squared, below which it gives what a point that faces the same way does, to half
// a percent.
const FAR: f32 = 0.005;

// `light::form_factor::disc`.
fn disc_form(cosine: f32, sine_squared: f32) -> f32 {
    let sine = sqrt(max(1.0 - cosine * cosine, 1e-12));
    let x = sqrt(1.0 / sine_squared - 1.0);
    let y = clamp(-x * cosine / sine, -1.0, 1.0);
    let z = sine * sqrt(1.0 - y * y);
    return max((cosine * acos(y) - x * z) * sine_squared + atan2(z, x), 0.0);
}

// `light::form_factor::rect`.
fn rect_form(light: CameraLight, to_middle: vec3f, normal: vec3f) -> f32 {
    if dot(light.axis_in_camera.xyz, to_middle) >= 0.0 {
        return 0.0;
    }
    let width = light.half_width.xyz;
    let height = light.half_height.xyz;
    var corners = array<vec3f, 4>(
        to_middle - width - height,
        to_middle - width + height,
        to_middle + width + height,
        to_middle + width - height,
    );
    var sum = 0.0;
    // Where the outline goes below the horizon and where it comes up again; the way between them closes it.
    var leaves = vec3f(0.0);
    var returns = vec3f(0.0);
    for (var index = 0; index < 4; index++) {
        var start = corners[index];
        var end = corners[(index + 1) % 4];
        let start_height = dot(normal, start);
        let end_height = dot(normal, end);
        if start_height < 0.0 && end_height < 0.0 {
            continue;
        }
        if (start_height < 0.0) != (end_height < 0.0) {
            let crossing = mix(start, end, start_height / (start_height - end_height));
            if start_height < 0.0 {
                start = crossing;
                returns = crossing;
            } else {
                end = crossing;
                leaves = crossing;
            }
        }
        sum += edge_form(start, end, normal);
    }
    sum += edge_form(leaves, returns, normal);
    return max(0.5 * sum, 0.0);
}

fn edge_form(start: vec3f, end: vec3f, normal: vec3f) -> f32 {
    let across = cross(start, end);
    let area = length(across);
    return select(0.0, atan2(area, dot(start, end)) * dot(across, normal) / area, area > 0.0);
}
