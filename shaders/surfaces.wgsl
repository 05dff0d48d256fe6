// Real and virtual surfaces: first depth, and what the ambient light gives them, then each light where the stencil lets it.
//!include "sampled_surface.wgsl"
//!include "light_sums.wgsl"

@fragment
fn ambient_on_real(sampled: SampledSurface) -> LightSums {
    let surface = surface(sampled);
    return LightSums(vec4f(surface.indirect, 1.0), vec4f(0.0));
}

@fragment
fn ambient_on_virtual(sampled: SampledSurface, @builtin(front_facing) outside: bool) -> LightSums {
    let surface = surface(sampled);
    let look = look(surface, outside);
//!if LOOKS
    if look.opacity == 0.0 {
        discard;
    }
//!end
    return LightSums(vec4f(0.0), vec4f(ambient_radiance(surface, look), 1.0));
}

// Once where the light reaches the surface in the video, and once where virtual things then hide it.
@fragment
fn light_on_real(sampled: SampledSurface, @builtin(front_facing) outside: bool) -> LightSums {
    let surface = surface(sampled);
    let irradiance = vec4f(irradiance(surface, outside), 0.0);
    return LightSums(irradiance, irradiance);
}

@fragment
fn light_on_virtual(sampled: SampledSurface, @builtin(front_facing) outside: bool) -> LightSums {
    let surface = surface(sampled);
    return LightSums(vec4f(0.0), vec4f(radiance(surface, look(surface, outside)), 0.0));
}
