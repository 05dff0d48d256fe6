// A glossy layer as a Phong lobe over what a thing leaves of an environment, both in 16 harmonics (Tamura et al. 2005, section 5).

// For each thing the environment's matrix (equation 10), 16 rows of 16 texels: rows are of directions in the world, columns of
// directions as the thing has them.
@group(2) @binding(9) var gloss_table: texture_2d<u32>;

// What is mirrored towards a corner's camera, degree by degree: the part of equation 13 before the lobe is known.
struct MirroredDegrees {
    degree_0: vec3f,
    degree_1: vec3f,
    degree_2: vec3f,
    degree_3: vec3f,
}

fn mirrored_degrees(placed: Surface, occlusion: OcclusionCorner) -> MirroredDegrees {
    let from_camera = normalize(placed.point_in_camera);
    let direction = reflect(from_camera, unit(placed.normal_in_camera));
    var harmonics = harmonics((frame.world_from_camera * vec4f(direction, 0.0)).xyz);
    var visibility = array(
        occlusion.visibility_0,
        occlusion.visibility_1,
        occlusion.visibility_2,
        occlusion.visibility_3,
    );
    var degrees = array(vec3f(0.0), vec3f(0.0), vec3f(0.0), vec3f(0.0));
    for (var row = 0u; row < 16u; row++) {
        // L v, the light that the thing leaves (equation 12).
        var left = vec3f(0.0);
        for (var column = 0u; column < 16u; column++) {
            let texel = place_in_table(256u * occlusion.thing + 16u * row + column);
            let entry = bitcast<vec3f>(textureLoad(gloss_table, texel, 0).xyz);
            left += entry * visibility[column / 4u][column % 4u];
        }
        degrees[u32(sqrt(f32(row) + 0.5))] += left * harmonics[row];
    }
    return MirroredDegrees(degrees[0], degrees[1], degrees[2], degrees[3]);
}

// The twin of light::harmonics::basis up to degree 3.
fn harmonics(direction: vec3f) -> array<f32, 16> {
    let x = direction.x;
    let y = direction.y;
    let z = direction.z;
    return array<f32, 16>(
        0.28209479,
        0.48860251 * y,
        0.48860251 * z,
        0.48860251 * x,
        1.09254843 * x * y,
        1.09254843 * y * z,
        0.31539157 * (3.0 * z * z - 1.0),
        1.09254843 * x * z,
        0.54627422 * (x * x - y * y),
        0.59004359 * y * (3.0 * x * x - y * y),
        2.89061144 * x * y * z,
        0.45704580 * y * (5.0 * z * z - 1.0),
        0.37317633 * z * (5.0 * z * z - 3.0),
        0.45704580 * x * (5.0 * z * z - 1.0),
        1.44530572 * z * (x * x - y * y),
        0.59004359 * x * (x * x - 3.0 * y * y),
    );
}

// Phong's exponent for a roughness: that of the halfway vector which Walter et al. 2007 give, a quarter of it about the mirrored
// direction, which turns twice as far.
fn phong_exponent(roughness: f32) -> f32 {
    return max(0.5 / (roughness * roughness) - 0.5, 0.0);
}

// Mean radiance over the lobe of what the thing leaves: each degree times the lobe's (equations 12 and 13).
fn mean_over_lobe(sampled: SampledSurface, exponent: f32) -> vec3f {
    let one = sampled.one;
    let first = (exponent + 1.0) / (exponent + 2.0);
    let second = exponent / (exponent + 3.0);
    return max(recovered(sampled.degree_0, vec3f(0.0), one)
        + recovered(sampled.degree_1, vec3f(0.0), one) * first
        + recovered(sampled.degree_2, vec3f(0.0), one) * second
        + recovered(sampled.degree_3, vec3f(0.0), one) * first * ((exponent - 1.0) / (exponent + 4.0)), vec3f(0.0));
}

// The lobe in a direction, of unit integral.
fn phong_lobe(exponent: f32, mirrored: vec3f, toward: vec3f) -> f32 {
    return (exponent + 1.0) / (2.0 * PI) * pow(max(dot(mirrored, toward), 0.0), exponent);
}
