// Shared by all passes that draw geometry. Spaces: anchor (as modelled), camera (x right, y down, z forward), clip.

struct AnchorView {
    clip_from_anchor: mat4x4f,
    camera_from_anchor: mat4x4f,
}

struct CameraLight {
    // The middle in camera space (w = 1), or the direction towards distant light (w = 0).
    place_in_camera: vec4f,
    // Radiant intensity (of a rectangle straight ahead), or irradiance of distant light. w: the radius of a sphere, metres, or
    // the sine of half the width of distant light.
    power: vec4f,
    // Of a spot and of a rectangle the direction straight ahead.
    axis_in_camera: vec4f,
    // From a rectangle's middle to those of two sides, metres; a spot's factor and summand (light::spot_ramp) in xy.
    half_width: vec4f,
    half_height: vec4f,
}

const PI: f32 = 3.14159265358979;

// The one place where positions become clip coordinates: surfaces and shadow volumes must land on the same depths,
// bit for bit, or a lit surface would shadow itself.
fn clip_from_point(view: AnchorView, point_in_anchor: vec4f) -> vec4f {
    return view.clip_from_anchor * point_in_anchor;
}
