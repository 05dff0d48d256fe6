// What materials and their pictures say at a place of a surface. Reads the scene's materials and its pictures, which lie in
// stacks of one size each.

// How a picture lies on a surface: the twin of `MapOnGpu` in materials.rs.
struct MapOnGpu {
    // Columns of the map from corners' texture coordinates.
    linear: vec4f,
    offset: vec2f,
    // From the lowest bit: 1 if there is one; 2 bits the stack; 1 the texture coordinates; 2 each how it goes on along u and
    // v; 1 if its texels stay squares; from bit 16 its layer.
    place: u32,
    // Width in the low half, height in the high one, texels.
    size: u32,
}

// The twin of `MaterialOnGpu`.
struct MaterialOnGpu {
    albedo: vec3f,
    // 0: Lambert alone.
    roughness: f32,
    emission: vec3f,
    metallic: f32,
    opacity: f32,
    // What has less opacity is not there.
    cutoff: f32,
    normal_scale: f32,
    occlusion_strength: f32,
    // UNLIT if the colour is the radiance itself, PRINCIPLED, or 0.
    shading: u32,
    // 1 if it lets light through.
    translucent: u32,
    padding_2: u32,
    padding_3: u32,
    // Colour, emission, roughness, metallic, normal, occlusion.
    maps: array<MapOnGpu, 6>,
}

@group(3) @binding(0) var<storage, read> materials: array<MaterialOnGpu>;
@group(3) @binding(1) var srgb_0: texture_2d_array<f32>;
@group(3) @binding(2) var srgb_1: texture_2d_array<f32>;
@group(3) @binding(3) var srgb_2: texture_2d_array<f32>;
@group(3) @binding(4) var linear_0: texture_2d_array<f32>;
@group(3) @binding(5) var linear_1: texture_2d_array<f32>;
@group(3) @binding(6) var linear_2: texture_2d_array<f32>;
@group(3) @binding(7) var repeated: sampler;
@group(3) @binding(8) var clamped: sampler;

// What is seen at a slant is sampled in a row of spots, so many at most. (Not by the driver's anisotropic filter: it is another
// one on each GPU, and Mesa's software one takes seconds for a small thing.)
const MOST_SPOTS: f32 = 8.0;
const WRAP_CLAMP: u32 = 1u;
const WRAP_MIRROR: u32 = 2u;

// Both sets of texture coordinates, and how they change from pixel to pixel.
struct TextureCoordinates {
    uv: vec4f,
    along_x: vec4f,
    along_y: vec4f,
}

struct Sampled {
    picture: vec2f,
    // What a pixel sees of it: so many round spots in a row, and what lies between two of them.
    spots: u32,
    step: vec2f,
    spot_x: vec2f,
    spot_y: vec2f,
    stack: u32,
    layer: u32,
    wrap: vec2u,
}

fn wrapped(place: f32, wrap: u32) -> f32 {
    if wrap == WRAP_MIRROR {
        return 1.0 - abs(1.0 - 2.0 * fract(0.5 * place));
    }
    if wrap == WRAP_CLAMP {
        return clamp(place, 0.0, 1.0);
    }
    return place;
}

fn sampled(map: MapOnGpu, at: TextureCoordinates) -> Sampled {
    let second = (map.place & 8u) != 0u;
    let linear = mat2x2f(map.linear.xy, map.linear.zw);
    var picture = linear * select(at.uv.xy, at.uv.zw, second) + map.offset;
    let wrap = vec2u((map.place >> 4u) & 3u, (map.place >> 6u) & 3u);
    let size = vec2f(f32(map.size & 0xffffu), f32(map.size >> 16u));
    // The pixel's axes on the picture, texels; its longer one, and its width across that.
    let along_x = linear * select(at.along_x.xy, at.along_x.zw, second) * size;
    let along_y = linear * select(at.along_y.xy, at.along_y.zw, second) * size;
    let long = select(along_y, along_x, dot(along_x, along_x) >= dot(along_y, along_y));
    // (Beyond the whole picture a pixel sees no more of it; of a triangle seen edge-on the axes may be anything.)
    let length_px = clamp(length(long), 1e-6, max(size.x, size.y));
    let area = abs(along_x.x * along_y.y - along_x.y * along_y.x);
    let width_px = clamp(area / length_px, max(length_px / MOST_SPOTS, 1e-6), length_px);
    // A spot that is seen enlarged needs no others beside it.
    let spots = clamp(ceil(length_px / max(width_px, 1.0) - 0.1), 1.0, MOST_SPOTS);
    let along = long * (length_px / max(length(long), 1e-6)) / size;
    let is_squares = (map.place & 256u) != 0u;
    if is_squares {
        // In the middle of a texel nothing of its neighbours is mixed in, as long as it is seen enlarged.
        let footprint = max(abs(along_x), abs(along_y));
        if max(footprint.x, footprint.y) < 1.0 {
            picture = (floor(picture * size) + 0.5) / size;
        }
    }
    let spot_x = vec2f(width_px / size.x, 0.0);
    let spot_y = vec2f(0.0, width_px / size.y);
    let stack = (map.place >> 1u) & 3u;
    return Sampled(picture, u32(spots), along / spots, spot_x, spot_y, stack, map.place >> 16u, wrap);
}

// The middle of a spot on the picture as the sampler takes it.
fn spot_at(s: Sampled, spot: u32) -> vec2f {
    let at = s.picture + s.step * (f32(spot) - 0.5 * (f32(s.spots) - 1.0));
    if is_repeated(s) {
        return at;
    }
    let once = select(at, fract(at), s.wrap == vec2u(0u));
    return vec2f(wrapped(once.x, s.wrap.x), wrapped(once.y, s.wrap.y));
}

fn is_repeated(s: Sampled) -> bool {
    return all(s.wrap == vec2u(0u));
}

fn is_there(map: MapOnGpu) -> bool {
    return (map.place & 1u) != 0u;
}

// One reading of a picture: of the stack that it lies in, as its sampler repeats.
fn read_at(
    stack_0: texture_2d_array<f32>,
    stack_1: texture_2d_array<f32>,
    stack_2: texture_2d_array<f32>,
    s: Sampled,
    at: vec2f,
) -> vec4f {
    if is_repeated(s) {
        switch s.stack {
            case 0u: { return textureSampleGrad(stack_0, repeated, at, s.layer, s.spot_x, s.spot_y); }
            case 1u: { return textureSampleGrad(stack_1, repeated, at, s.layer, s.spot_x, s.spot_y); }
            default: { return textureSampleGrad(stack_2, repeated, at, s.layer, s.spot_x, s.spot_y); }
        }
    }
    switch s.stack {
        case 0u: { return textureSampleGrad(stack_0, clamped, at, s.layer, s.spot_x, s.spot_y); }
        case 1u: { return textureSampleGrad(stack_1, clamped, at, s.layer, s.spot_x, s.spot_y); }
        default: { return textureSampleGrad(stack_2, clamped, at, s.layer, s.spot_x, s.spot_y); }
    }
}

// Of a picture in sRGB; white where there is none.
fn srgb_of(map: MapOnGpu, at: TextureCoordinates) -> vec4f {
    if !is_there(map) {
        return vec4f(1.0);
    }
    let s = sampled(map, at);
    var sum = vec4f(0.0);
    for (var spot = 0u; spot < s.spots; spot++) {
        sum += read_at(srgb_0, srgb_1, srgb_2, s, spot_at(s, spot));
    }
    return sum / f32(s.spots);
}

// Of a picture of numbers; 1 where there is none.
fn linear_of(map: MapOnGpu, at: TextureCoordinates) -> vec4f {
    if !is_there(map) {
        return vec4f(1.0);
    }
    let s = sampled(map, at);
    var sum = vec4f(0.0);
    for (var spot = 0u; spot < s.spots; spot++) {
        sum += read_at(linear_0, linear_1, linear_2, s, spot_at(s, spot));
    }
    return sum / f32(s.spots);
}

// What a surface of a material reflects head-on, whatever else the material is.
fn albedo_at(number: u32, uv: vec4f, color: vec3f) -> vec3f {
    let at = TextureCoordinates(uv, dpdx(uv), dpdy(uv));
    return materials[number].albedo * srgb_of(materials[number].maps[0], at).rgb * color;
}

const UNLIT: u32 = 1u;
const PRINCIPLED: u32 = 2u;

// What the pictures make of a material; `normal` has unit length and looks out of the surface.
fn material_at(number: u32, uv: vec4f, color: vec4f, tangent: vec4f, normal: vec3f, side: f32) -> Look {
    let at = TextureCoordinates(uv, dpdx(uv), dpdy(uv));
    let material = materials[number];
    let base = srgb_of(material.maps[0], at) * color;
    let emission = material.emission * srgb_of(material.maps[1], at).rgb;
    let rough = linear_of(material.maps[2], at).g;
    let metal = linear_of(material.maps[3], at).b;
    let occluded = linear_of(material.maps[5], at).r;
    var bent = normal;
    if is_there(material.maps[4]) && tangent.w != 0.0 {
        let along = tangent.xyz - normal * dot(normal, tangent.xyz);
        let length_squared = dot(along, along);
        if length_squared > 1e-12 {
            let u_direction = along * inverseSqrt(length_squared);
            let v_direction = cross(normal, u_direction) * sign(tangent.w);
            let picture = linear_of(material.maps[4], at).xyz * 2.0 - 1.0;
            let scale = material.normal_scale;
            bent = unit(u_direction * picture.x * scale + v_direction * picture.y * scale + normal * picture.z);
        }
    }
    let albedo = material.albedo * base.rgb;
    let is_unlit = material.shading == UNLIT;
    let opacity = select(1.0, min(material.opacity * base.a, 1.0), material.translucent != 0u);
    // (A mirror's lobe is narrower than any light.)
    let roughness = select(0.0, max(material.roughness * rough * rough, 0.01), material.roughness > 0.0);
    return Look(
        select(albedo, vec3f(0.0), is_unlit),
        select(roughness, 0.0, is_unlit),
        select(material.metallic * metal, 0.0, is_unlit),
        select(emission, albedo, is_unlit),
        1.0 + material.occlusion_strength * (occluded - 1.0),
        select(0.0, opacity, material.opacity * base.a >= material.cutoff),
        bent * side,
        material.shading == PRINCIPLED,
    );
}
