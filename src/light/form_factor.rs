//! Irradiance that discs, spheres and rectangles of radiance 1 give, in closed form.

use std::f64::consts::{FRAC_PI_2, PI};

use glam::DVec3;

use super::Rect;

/// Irradiance from a round cone of directions of radiance 1, as a sphere or a sun fills it: `cosine` is that of the angle between
/// the normal and the cone's axis, `sine_squared` that of half the cone's width. What is below the horizon gives nothing (Snyder
/// 1996, "Area light sources for real-time graphics", as in Lagarde & de Rousiers 2014, section 4.7.2.1). From within a sphere,
/// whose squared sine would be more than 1, half of all directions shine.
pub fn disc(cosine: f64, sine_squared: f64) -> f64 {
    let (cosine, sine_squared) = (cosine.clamp(-1.0, 1.0), sine_squared.min(1.0));
    if cosine * cosine >= sine_squared {
        return PI * sine_squared * cosine.max(0.0);
    }
    let sine = (1.0 - cosine * cosine).sqrt();
    let x = (1.0 / sine_squared - 1.0).sqrt();
    let y = (-x * cosine / sine).clamp(-1.0, 1.0);
    let z = sine * (1.0 - y * y).sqrt();
    let past = match x > 0.0 {
        true => (z / x).atan(),
        false => FRAC_PI_2,
    };
    ((cosine * y.acos() - x * z) * sine_squared + past).max(0.0)
}

/// Irradiance from a rectangle of radiance 1 whose middle is `to_middle` away; nothing from behind it or from below the horizon
/// (Lambert's formula for polygons; Baum, Rushmeier & Winget 1989, equation 4).
pub fn rect(rect: &Rect, to_middle: DVec3, normal: DVec3) -> f64 {
    if rect.facing.dot(to_middle) >= 0.0 {
        return 0.0;
    }
    let [half_width, half_height] = rect.half_sides_m();
    // Counter-clockwise as the point sees it.
    let corners = [(-1.0, -1.0), (-1.0, 1.0), (1.0, 1.0), (1.0, -1.0)]
        .map(|(x, y)| to_middle + half_width * x + half_height * y);
    let above = clipped(&corners, normal);
    let edges = above.iter().zip(above.iter().cycle().skip(1));
    let sum: f64 = edges
        .map(|(&from, &to)| {
            let across = from.cross(to);
            let angle = across.length().atan2(from.dot(to));
            angle * across.normalize_or_zero().dot(normal)
        })
        .sum();
    (0.5 * sum).max(0.0)
}

/// The part of a polygon above the plane through the origin across a normal.
fn clipped(corners: &[DVec3], normal: DVec3) -> Vec<DVec3> {
    let mut above = Vec::with_capacity(corners.len() + 1);
    for (&from, &to) in corners.iter().zip(corners.iter().cycle().skip(1)) {
        let (from_height, to_height) = (normal.dot(from), normal.dot(to));
        if from_height >= 0.0 {
            above.push(from);
        }
        if (from_height >= 0.0) != (to_height >= 0.0) {
            above.push(from.lerp(to, from_height / (from_height - to_height)));
        }
    }
    above
}
