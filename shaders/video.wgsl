// The recorded picture as an ideal lens would have seen it, and its encoding.

struct Lens {
    focal_px: vec2f,
    center_px: vec2f,
    // OpenCV's k1 k2 p1 p2, of a fisheye k1 k2 k3 k4.
    distortion: vec4f,
    // k3 k4 k5 k6
    rational: vec4f,
    // s1 s2 s3 s4
    prism: vec4f,
    // The columns of the homography of a tilted sensor.
    tilt_x: vec4f,
    tilt_y: vec4f,
    tilt_z: vec4f,
    size_px: vec2u,
    // One of the constants below.
    model: u32,
    padding: u32,
}

const RATIONAL: u32 = 1u;
const FISHEYE: u32 = 2u;

// Set when the shader is built; a perfect lens lets the picture pass untouched.
override DISTORTS: bool = true;

@group(2) @binding(0) var<uniform> lens: Lens;
@group(2) @binding(1) var video: texture_2d<f32>;

// The recorded picture where an ideal lens would have seen this pixel, still sRGB-encoded.
fn undistorted(pixel: vec2i) -> vec3f {
    if !DISTORTS {
        return textureLoad(video, pixel, 0).rgb;
    }
    let ideal = (vec2f(pixel) - lens.center_px) / lens.focal_px;
    let k = lens.distortion;
    let r2 = dot(ideal, ideal);
    if lens.model == FISHEYE {
        let radius = sqrt(r2);
        let angle = atan(radius);
        let a2 = angle * angle;
        let bent = angle * (1.0 + a2 * (k.x + a2 * (k.y + a2 * (k.z + a2 * k.w))));
        // At the axis the radius is the angle.
        let scale = select(1.0, bent / max(radius, 1e-6), radius > 1e-6);
        return bilinear(ideal * scale * lens.focal_px + lens.center_px);
    }
    var radial = 1.0 + r2 * (k.x + r2 * (k.y + r2 * lens.rational.x));
    if lens.model == RATIONAL {
        radial /= 1.0 + r2 * (lens.rational.y + r2 * (lens.rational.z + r2 * lens.rational.w));
    }
    let cross_term = 2.0 * ideal.x * ideal.y;
    var seen = ideal * radial
        + vec2f(k.z * cross_term + k.w * (r2 + 2.0 * ideal.x * ideal.x), k.z * (r2 + 2.0 * ideal.y * ideal.y) + k.w * cross_term);
    if lens.model == RATIONAL {
        seen += r2 * (lens.prism.xz + r2 * lens.prism.yw);
        let tilted = lens.tilt_x.xyz * seen.x + lens.tilt_y.xyz * seen.y + lens.tilt_z.xyz;
        seen = tilted.xy / tilted.z;
    }
    return bilinear(seen * lens.focal_px + lens.center_px);
}

// By hand, because samplers interpolate with few bits; beyond the edge the edge goes on.
fn bilinear(pixel: vec2f) -> vec3f {
    let last = vec2i(lens.size_px) - 1;
    let corner = floor(pixel);
    let weight = pixel - corner;
    let low = clamp(vec2i(corner), vec2i(0), last);
    let high = clamp(vec2i(corner) + 1, vec2i(0), last);
    let top = mix(textureLoad(video, low, 0).rgb, textureLoad(video, vec2i(high.x, low.y), 0).rgb, weight.x);
    let bottom = mix(textureLoad(video, vec2i(low.x, high.y), 0).rgb, textureLoad(video, high, 0).rgb, weight.x);
    return mix(top, bottom, weight.y);
}

// IEC 61966-2-1.
fn linear_from_srgb(encoded: vec3f) -> vec3f {
    return select(pow((encoded + 0.055) / 1.055, vec3f(2.4)), encoded / 12.92, encoded <= vec3f(0.04045));
}

// Its power as a polynomial in the fourth root (minimax fit, off by less than 0.002 levels of 255): `pow` took as long as all
// other shading.
fn srgb_from_linear(linear: vec3f) -> vec3f {
    let displayed = clamp(linear, vec3f(0.0), vec3f(1.0));
    let root = sqrt(sqrt(displayed));
    let curve = -0.06134024 + root * (0.16202654 + root * (1.25540335 + root * (-0.57748083 + root * (0.28953139 - root * 0.06814678))));
    return select(curve, displayed * 12.92, displayed <= vec3f(0.0031308));
}
