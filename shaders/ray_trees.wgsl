// Rays against the triangles of things: a tree of boxes for each (ray_trees.rs).
//!include "tables.wgsl"

// Two texels for each node of all trees, the two parts of one beside each other; then three for each triangle.
@group(2) @binding(1) var trees: texture_2d<u32>;
@group(2) @binding(2) var<storage, read> things: array<TracedThing>;

struct TracedThing {
    // How its own space lies in the camera's: the rows of what leads there.
    own_from_camera: array<vec4f, 3>,
    // Around it, in its own space.
    low: vec3f,
    // What it is.
    what: u32,
    high: vec3f,
    // As a stack has it.
    root: u32,
}

const IS_REAL: u32 = 1u;
const IS_SOLID: u32 = 2u;
const CASTS: u32 = 4u;
// Nodes that wait while others are looked at.
const DEEPEST: u32 = 48u;
// In a stack's word below the number of triangles: the texel of the first, or the number of a node's first part.
const PLACE_BITS: u32 = 24u;

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

// The first triangle within reach of those things that have all properties of a mask and none of another; with `any_will_do` it
// need not be the first.
fn first_hit(ray: Ray, reach: f32, thing_count: u32, all_of: u32, none_of: u32, any_will_do: bool) -> Hit {
    var hit = Hit(reach, 0u, 0u);
    for (var thing = 0u; thing < thing_count; thing++) {
        let what = things[thing].what;
        if (what & all_of) != all_of || (what & none_of) != 0u {
            continue;
        }
        let rows = things[thing].own_from_camera;
        // (The way is not of unit length where the thing is scaled: so distances stay the camera's.)
        let start = vec4f(ray.origin, 1.0);
        let along = vec4f(ray.direction, 0.0);
        let own = Ray(
            vec3f(dot(rows[0], start), dot(rows[1], start), dot(rows[2], start)),
            vec3f(dot(rows[0], along), dot(rows[1], along), dot(rows[2], along)),
        );
        let inverse = 1.0 / select(own.direction, vec3f(1e-20), abs(own.direction) < vec3f(1e-20));
        if entered(own.origin, inverse, things[thing].low, things[thing].high, hit.distance) < hit.distance {
            hit = hit_in_tree(own, inverse, hit, thing, (what & IS_SOLID) != 0u, any_will_do);
            if any_will_do && hit.triangle != 0u {
                return hit;
            }
        }
    }
    return hit;
}

fn hit_in_tree(ray: Ray, inverse: vec3f, before: Hit, thing: u32, is_solid: bool, any_will_do: bool) -> Hit {
    var hit = before;
    var waiting: array<u32, DEEPEST>;
    var count = 0u;
    var next = things[thing].root;
    loop {
        let triangles = next >> PLACE_BITS;
        let place = next & ((1u << PLACE_BITS) - 1u);
        for (var index = 0u; index < triangles; index++) {
            let triangle = place + 3u * index;
            let distance = hit_triangle(ray, triangle, is_solid, hit.distance);
            if distance < hit.distance {
                hit = Hit(distance, triangle, thing);
                if any_will_do {
                    return hit;
                }
            }
        }
        var is_found = false;
        if triangles == 0u {
            // The part that is entered first comes first, and the other waits.
            let low_1 = tree_words(2u * place);
            let high_1 = tree_words(2u * place + 1u);
            let low_2 = tree_words(2u * place + 2u);
            let high_2 = tree_words(2u * place + 3u);
            let enter_1 = entered(ray.origin, inverse, bitcast<vec3f>(low_1.xyz), bitcast<vec3f>(high_1.xyz), hit.distance);
            let enter_2 = entered(ray.origin, inverse, bitcast<vec3f>(low_2.xyz), bitcast<vec3f>(high_2.xyz), hit.distance);
            let part_1 = low_1.w | (high_1.w << PLACE_BITS);
            let part_2 = low_2.w | (high_2.w << PLACE_BITS);
            let is_second_nearer = enter_2 < enter_1;
            let far = max(enter_1, enter_2);
            is_found = min(enter_1, enter_2) < hit.distance;
            next = select(part_1, part_2, is_second_nearer);
            if far < hit.distance && count < DEEPEST {
                waiting[count] = select(part_2, part_1, is_second_nearer);
                count++;
            }
        }
        if !is_found {
            if count == 0u {
                return hit;
            }
            count--;
            next = waiting[count];
        }
    }
    return hit;
}

// Where a ray enters a box; `reach` where it does not before.
fn entered(origin: vec3f, inverse: vec3f, low: vec3f, high: vec3f, reach: f32) -> f32 {
    let one = (low - origin) * inverse;
    let other = (high - origin) * inverse;
    let near = min(one, other);
    let far = max(one, other);
    let enter = max(max(near.x, near.y), max(near.z, 0.0));
    return select(reach, enter, enter <= min(min(far.x, far.y), far.z));
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
    let rows = things[hit.thing].own_from_camera;
    let normal = rows[0].xyz * own.x + rows[1].xyz * own.y + rows[2].xyz * own.z;
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
    return (things[hit.thing].what & IS_REAL) != 0u;
}
