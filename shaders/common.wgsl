// Shared by all passes that draw geometry. Spaces: anchor (as modelled), camera (x right, y down, z forward), clip.

struct AnchorView {
    clip_from_anchor: mat4x4f,
    camera_from_anchor: mat4x4f,
}

struct CameraLight {
    // A point in camera space (w = 1), or the direction towards distant light (w = 0).
    place_in_camera: vec4f,
    // Radiant intensity of a point, irradiance of distant light.
    power: vec4f,
}

const PI: f32 = 3.14159265358979;

// The one place where positions become clip coordinates: surfaces and shadow volumes must land on the same depths,
// bit for bit, or a lit surface would shadow itself.
fn clip_from_point(view: AnchorView, point_in_anchor: vec4f) -> vec4f {
    return view.clip_from_anchor * point_in_anchor;
}

// Unit direction to the light and the irradiance that it gives to a surface facing it.
struct Incidence {
    direction: vec3f,
    irradiance: vec3f,
}

fn incidence(light: CameraLight, point_in_camera: vec3f) -> Incidence {
    let to_light = light.place_in_camera.xyz - point_in_camera * light.place_in_camera.w;
    let distance_squared = dot(to_light, to_light);
    let falloff = select(1.0, 1.0 / max(distance_squared, 1e-12), light.place_in_camera.w > 0.0);
    return Incidence(to_light * inverseSqrt(max(distance_squared, 1e-12)), light.power.rgb * falloff);
}
