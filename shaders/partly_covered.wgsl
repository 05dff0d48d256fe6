// What is interpolated where a triangle may cover a part of a pixel: taken at the centroid of that part, for the pixel's centre
// may lie outside the triangle.

// 1, as no compiler may know. Where a pixel is partly covered, Mesa's software driver interpolates at the centroid but divides
// by the centre's depth: what it makes of 1 tells by how much all else is off.
fn one(vertex_index: u32) -> f32 {
    return bitcast<f32>(0x3f800000u | (vertex_index >> 31u));
}

// Set when the shader is built: whether pixels can be partly covered.
override MULTISAMPLED: bool = true;

// Of a triangle seen edge-on nothing that is interpolated can be trusted: it may be anything, and make a pixel black or white.
// There a number of its first corner stands for all.
const LARGEST_RECOVERY: f32 = 4.0;

// What was interpolated, put right; `first` is the same number at the triangle's first corner.
fn recovered(interpolated: vec3f, first: vec3f, one: f32) -> vec3f {
    if !MULTISAMPLED {
        return interpolated;
    }
    let is_sound = one > 1.0 / LARGEST_RECOVERY && one < LARGEST_RECOVERY;
    return select(first, interpolated / one, is_sound);
}
