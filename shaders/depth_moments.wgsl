// What averaged maps tell of depth: red is the part of the map that is covered, green the mean depth of that times the part,
// blue the same of depth squared.

// Least variance of depths in a map: a surface hides itself by no more than its own slope.
const LEAST_SPREAD: f32 = 0.0004;

// Variance of the depths.
fn spread_of(seen: vec3f) -> f32 {
    let mean = seen.y / max(seen.x, 1e-3);
    return max(seen.z / max(seen.x, 1e-3) - mean * mean, LEAST_SPREAD);
}

// Depth of what lies before a place that is `behind` the mean, as if all else lay at its depth (Yang et al. 2010).
fn blocker_depth(around: vec3f, mean: f32, behind: f32) -> f32 {
    return max(mean - spread_of(around) / behind, 0.0);
}

// Part of the map that lies before a depth.
fn part_before(seen: vec3f, depth: f32) -> f32 {
    let behind = max(depth - seen.y / max(seen.x, 1e-3), 0.0);
    let squared = behind * behind;
    return seen.x * squared / (squared + spread_of(seen));
}
