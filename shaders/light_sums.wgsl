// What light is added up in before the composite.

struct LightSums {
    // Irradiance on a real surface without virtual things; a = 1 where it is known.
    @location(0) reaching: vec4f,
    // Irradiance that virtual things take from a real surface, or the radiance of a virtual one; a = 1 where the surface is
    // virtual.
    @location(1) change: vec4f,
}
