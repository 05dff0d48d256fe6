// Real and virtual surfaces drawn straight over the video, where one light and one sample leave nothing to add up.
//!include "shading.wgsl"
//!include "video.wgsl"

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

// A real surface from which virtual things take the light: video · gain in linear light.
@fragment
fn hidden_on_real(surface: Surface, @builtin(front_facing) outside: bool) -> @location(0) vec4f {
    let taken = irradiance(surface, outside);
    let recorded = undistorted(vec2i(surface.clip.xy));
    let gain = surface.indirect / max(surface.indirect + taken, vec3f(1e-6));
    // A surface that loses nothing keeps its picture bit for bit. (To discard it would make the stencil wait for it.)
    let loses = any(taken > vec3f(0.0));
    return vec4f(select(recorded, srgb_from_linear(linear_from_srgb(recorded) * gain), loses), 1.0);
}

struct AmbientSurface {
    @invariant @builtin(position) clip: vec4f,
    @location(0) radiance: vec3f,
}

@vertex
fn place_in_ambient_light(@location(0) position: vec3f, @location(2) material: vec4f, @location(3) indirect: vec3f) -> AmbientSurface {
    return AmbientSurface(clip_from_point(view, vec4f(position, 1.0)), material.rgb / PI * indirect);
}

@fragment
fn ambient_on_virtual(surface: AmbientSurface) -> @location(0) vec4f {
    return vec4f(srgb_from_linear(surface.radiance), 1.0);
}

@fragment
fn light_on_virtual(surface: Surface, @builtin(front_facing) outside: bool) -> @location(0) vec4f {
    let ambient = surface.material.rgb / PI * surface.indirect;
    return vec4f(srgb_from_linear(ambient + radiance(surface, outside)), 1.0);
}
