// Rays against the triangles of things: a tree of boxes for each (ray_trees.rs).
//!include "tables.wgsl"

// Two texels for each node of all trees; then three for each triangle.
@group(2) @binding(1) var trees: texture_2d<u32>;
// Four for each thing: how its space lies in the camera's, the root of its tree and what it is; then five for each light.
@group(2) @binding(2) var placed_table: texture_2d<u32>;

// In a thing's last word but one.
const IS_REAL: u32 = 1u;
const IS_SOLID: u32 = 2u;
const CASTS: u32 = 4u;
// Nodes that wait while others are looked at.
const DEEPEST: u32 = 48u;

struct Ray {
    // In the camera's space.
    origin: vec3f,
    // Unit length.
    direction: vec3f,
}

struct Hit {
    // Along the ray; what it was given where nothing is hit.
    distance: f32,
    // Texel of the triangle in `trees`; 0 where nothing is hit.
    triangle: u32,
    thing: u32,
}

fn tree_words(number: u32) -> vec4u {
    return textureLoad(trees, place_in_table(number), 0);
}

fn tree_row(number: u32) -> vec4f {
    return bitcast<vec4f>(tree_words(number));
}

fn placed_words(number: u32) -> vec4u {
    return textureLoad(placed_table, place_in_table(number), 0);
}

fn placed_row(number: u32) -> vec4f {
    return bitcast<vec4f>(placed_words(number));
}

// The first triangle within reach of those things that have all properties of a mask and none of another; with `any_will_do` it
// need not be the first.
fn first_hit(ray: Ray, reach: f32, thing_count: u32, all_of: u32, none_of: u32, any_will_do: bool) -> Hit {
    var hit = Hit(reach, 0u, 0u);
    for (var thing = 0u; thing < thing_count; thing++) {
        let what = placed_words(4u * thing + 3u);
        if (what.y & all_of) != all_of || (what.y & none_of) != 0u {
            continue;
        }
        let rows = array<vec4f, 3>(placed_row(4u * thing), placed_row(4u * thing + 1u), placed_row(4u * thing + 2u));
        let start = vec4f(ray.origin, 1.0);
        let own_origin = vec3f(dot(rows[0], start), dot(rows[1], start), dot(rows[2], start));
        // (Not of unit length where the thing is scaled: so distances stay the camera's.)
        let along = vec4f(ray.direction, 0.0);
        let own_direction = vec3f(dot(rows[0], along), dot(rows[1], along), dot(rows[2], along));
        hit = hit_in_tree(Ray(own_origin, own_direction), hit, thing, what.x, (what.y & IS_SOLID) != 0u, any_will_do);
        if any_will_do && hit.triangle != 0u {
            return hit;
        }
    }
    return hit;
}

fn hit_in_tree(ray: Ray, before: Hit, thing: u32, root: u32, is_solid: bool, any_will_do: bool) -> Hit {
    var hit = before;
    let inverse = 1.0 / select(ray.direction, vec3f(1e-20), abs(ray.direction) < vec3f(1e-20));
    var waiting: array<u32, DEEPEST>;
    var count = 0u;
    var node = root;
    loop {
        let low = tree_words(2u * node);
        let high = tree_words(2u * node + 1u);
        if enters(ray.origin, inverse, bitcast<vec3f>(low.xyz), bitcast<vec3f>(high.xyz), hit.distance) {
            if high.w == 0u {
                // Of the two parts that one first whose middle comes first.
                let parts = vec2u(low.w, low.w + 1u);
                let first = tree_row(2u * parts.x).xyz + tree_row(2u * parts.x + 1u).xyz;
                let second = tree_row(2u * parts.y).xyz + tree_row(2u * parts.y + 1u).xyz;
                let is_second_nearer = dot(second - first, ray.direction) < 0.0;
                node = select(parts.x, parts.y, is_second_nearer);
                if count < DEEPEST {
                    waiting[count] = select(parts.y, parts.x, is_second_nearer);
                    count++;
                }
                continue;
            }
            for (var index = 0u; index < high.w; index++) {
                let triangle = low.w + 3u * index;
                let distance = hit_triangle(ray, triangle, is_solid, hit.distance);
                if distance < hit.distance {
                    hit = Hit(distance, triangle, thing);
                    if any_will_do {
                        return hit;
                    }
                }
            }
        }
        if count == 0u {
            return hit;
        }
        count--;
        node = waiting[count];
    }
    return hit;
}

fn enters(origin: vec3f, inverse: vec3f, low: vec3f, high: vec3f, reach: f32) -> bool {
    let one = (low - origin) * inverse;
    let other = (high - origin) * inverse;
    let near = min(one, other);
    let far = max(one, other);
    let enter = max(max(near.x, near.y), max(near.z, 0.0));
    return enter <= min(min(far.x, far.y), min(far.z, reach));
}

// Along the ray (Moeller & Trumbore 1997); `reach` where it misses. Of what is solid only the outside is hit.
fn hit_triangle(ray: Ray, triangle: u32, is_solid: bool, reach: f32) -> f32 {
    let corner = tree_row(triangle).xyz;
    let edge_1 = tree_row(triangle + 1u).xyz;
    let edge_2 = tree_row(triangle + 2u).xyz;
    let across = cross(ray.direction, edge_2);
    let determinant = dot(edge_1, across);
    if abs(determinant) < 1e-20 || (is_solid && determinant < 0.0) {
        return reach;
    }
    let way = ray.origin - corner;
    let u = dot(way, across) / determinant;
    let turned = cross(way, edge_1);
    let v = dot(ray.direction, turned) / determinant;
    let distance = dot(edge_2, turned) / determinant;
    let is_inside = u >= 0.0 && v >= 0.0 && u + v <= 1.0;
    return select(reach, distance, is_inside && distance > 0.0 && distance < reach);
}

// Unit normal of a triangle that was hit, in the camera's space, towards where the ray comes from.
fn hit_normal(hit: Hit, direction: vec3f) -> vec3f {
    let own = cross(tree_row(hit.triangle + 1u).xyz, tree_row(hit.triangle + 2u).xyz);
    // Normals go by the transposed inverse: by the rows of what leads from the camera's space, as columns.
    let normal = placed_row(4u * hit.thing).xyz * own.x
        + placed_row(4u * hit.thing + 1u).xyz * own.y
        + placed_row(4u * hit.thing + 2u).xyz * own.z;
    let unit = normal * inverseSqrt(max(dot(normal, normal), 1e-30));
    return select(unit, -unit, dot(unit, direction) > 0.0);
}

// Diffuse reflectance of a triangle that was hit.
fn hit_albedo(hit: Hit) -> vec3f {
    return vec3f(
        tree_row(hit.triangle).w,
        tree_row(hit.triangle + 1u).w,
        tree_row(hit.triangle + 2u).w,
    );
}

fn is_real(hit: Hit) -> bool {
    return (placed_words(4u * hit.thing + 3u).y & IS_REAL) != 0u;
}
