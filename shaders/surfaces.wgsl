// Real and virtual surfaces: first depth, and what the ambient light gives them, then each light where the stencil lets it.
//!include "sampled_surface.wgsl"

struct Light {
    // Irradiance on a real surface without virtual things; a = 1 where it is known.
    @location(0) reaching: vec4f,
    // Irradiance that virtual things take from a real surface, or the radiance of a virtual one; a = 1 where the surface is
    // virtual.
    @location(1) change: vec4f,
}

@fragment
fn ambient_on_real(sampled: SampledSurface) -> Light {
    let surface = surface(sampled);
    return Light(vec4f(surface.indirect, 1.0), vec4f(0.0));
}

@fragment
fn ambient_on_virtual(sampled: SampledSurface) -> Light {
    let surface = surface(sampled);
    return Light(vec4f(0.0), vec4f(surface.material.rgb / PI * surface.indirect, 1.0));
}

// Once where the light reaches the surface in the video, and once where virtual things then hide it.
@fragment
fn light_on_real(sampled: SampledSurface, @builtin(front_facing) outside: bool) -> Light {
    let surface = surface(sampled);
    let irradiance = vec4f(irradiance(surface, outside), 0.0);
    return Light(irradiance, irradiance);
}

@fragment
fn light_on_virtual(sampled: SampledSurface, @builtin(front_facing) outside: bool) -> Light {
    let surface = surface(sampled);
    return Light(vec4f(0.0), vec4f(radiance(surface, outside), 0.0));
}
