// Real and virtual surfaces drawn straight over the video, where one light and one sample leave nothing to add up.
//!include "shading.wgsl"
//!include "video.wgsl"
//!include "fullscreen.wgsl"

struct Place {
    @invariant @builtin(position) clip: vec4f,
}

@vertex
fn place_alone(@location(0) position: vec3f) -> Place {
    return Place(clip_from_point(view, vec4f(position, 1.0)));
}

// Phantoms write no colour: the video already shows them.
@fragment
fn depth_alone() {}

// What virtual things leave of a real surface's light where they hide the lamp. In the order of sums (composite.wgsl), so
// that both round alike.
fn gain(surface: Surface, outside: bool) -> vec3f {
    // (Never below 0, but so no compiler joins its product to the sum, which would round otherwise.)
    let taken = max(irradiance(surface, outside), vec3f(0.0));
    let light = surface.indirect + taken;
    return select(vec3f(1.0), max(light - taken, vec3f(0.0)) / max(light, vec3f(1e-6)), taken != vec3f(0.0));
}

// A real surface from which virtual things take the light: video · gain in linear light.
@fragment
fn hidden_on_real(surface: Surface, @builtin(front_facing) outside: bool) -> @location(0) vec4f {
    let recorded = undistorted(vec2i(surface.clip.xy));
    let gain = gain(surface, outside);
    // A surface that loses nothing keeps its picture bit for bit. (To discard it would make the stencil wait for it.)
    let loses = any(gain != vec3f(1.0));
    return vec4f(select(recorded, srgb_from_linear(linear_from_srgb(recorded) * gain), loses), 1.0);
}

@fragment
fn gain_on_real(surface: Surface, @builtin(front_facing) outside: bool) -> @location(0) vec4f {
    return vec4f(gain(surface, outside), 1.0);
}

// Of a virtual surface the picture gets all its light, as if nothing hid any, and `ambient` what is left of it where
// something does.
struct Shaded {
    @location(0) picture: vec4f,
    // a: which surface is seen, one of the three below.
    @location(1) ambient: vec4f,
}

const NOT_VIRTUAL: f32 = 0.0;
// In the shadow if it lies in one volume.
const IN_OPEN_LIGHT: f32 = 1.0;
// In the shadow if it lies in two: the first is its own, and smooth shading lights it all the same. Otherwise the facets
// would draw a jagged line where the light ends.
const AT_TERMINATOR: f32 = 0.5;

@fragment
fn nothing() -> Shaded {
    return Shaded(vec4f(0.0), vec4f(NOT_VIRTUAL));
}

// No light reaches it that could be taken again.
//!if LAYERED
@fragment
fn ambient_on_virtual(surface: Surface, @builtin(front_facing) outside: bool) -> Shaded {
    let look = look(surface, outside);
//!if LOOKS
    if look.opacity == 0.0 {
        discard;
    }
//!end
    return Shaded(vec4f(srgb_from_linear(ambient_radiance(surface, look)), 1.0), vec4f(NOT_VIRTUAL));
}

@vertex
fn place_in_ambient_light(corner: SurfaceCorner) -> Surface {
    return placed(corner);
}
//!else
@fragment
fn ambient_on_virtual(surface: AmbientSurface) -> Shaded {
    let ambient = surface.material.rgb / PI * surface.indirect;
    return Shaded(vec4f(srgb_from_linear(ambient), 1.0), vec4f(NOT_VIRTUAL));
}

struct AmbientSurface {
    @invariant @builtin(position) clip: vec4f,
    @location(0) @interpolate(flat) material: vec4f,
    @location(1) indirect: vec3f,
}

@vertex
fn place_in_ambient_light(@location(0) position: vec3f, @location(2) material: vec4f, @location(3) indirect: vec3f) -> AmbientSurface {
    return AmbientSurface(clip_from_point(view, vec4f(position, 1.0)), material, indirect);
}
//!end

// Set when the shader is built.
override SEEN: f32 = IN_OPEN_LIGHT;

@fragment
fn light_on_virtual(surface: Surface, @builtin(front_facing) outside: bool) -> Shaded {
    let look = look(surface, outside);
//!if LOOKS
    if look.opacity == 0.0 {
        discard;
    }
//!end
    let ambient = ambient_radiance(surface, look);
    return Shaded(
        vec4f(srgb_from_linear(ambient + max(radiance(surface, look), vec3f(0.0))), 1.0),
        vec4f(srgb_from_linear(ambient), SEEN),
    );
}

@group(3) @binding(0) var ambient: texture_2d<f32>;

// What is left to virtual surfaces of one kind in the shadow.
@fragment
fn shadow_on_virtual(@builtin(position) at: vec4f) -> @location(0) vec4f {
    let left = textureLoad(ambient, vec2i(at.xy), 0);
    if abs(left.a - SEEN) > 0.1 {
        discard;
    }
    return vec4f(left.rgb, 1.0);
}
