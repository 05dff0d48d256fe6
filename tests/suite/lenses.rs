//! Lenses against OpenCV: projections of random points, their derivatives, and the way back.

use glam::{DVec2, DVec3};
use gnomon::geometry::camera::{Distortion, Intrinsics};
use opencv::core::{Mat, Point2d, Point3d, Vec3d, Vector};

/// Lenses of each model, as calibrations give them.
const LENSES: [Distortion; 7] = [
    Distortion::Polynomial([-0.28, 0.09, 0.0015, -0.001, -0.01]),
    // A Kinect's.
    rational(
        [0.46, -2.5, 0.0008, -0.0002, 1.45, 0.34, -2.33, 1.38],
        [0.0; 6],
    ),
    rational(
        [0.1, -0.05, 0.001, 0.002, 0.01, 0.12, -0.03, 0.004],
        [0.002, -0.001, -0.003, 0.0015, 0.0, 0.0],
    ),
    rational(
        [0.1, -0.05, 0.001, 0.002, 0.01, 0.12, -0.03, 0.004],
        [0.002, -0.001, -0.003, 0.0015, 0.04, -0.03],
    ),
    rational([0.0; 8], [0.0, 0.0, 0.0, 0.0, -0.1, 0.2]),
    Distortion::Fisheye([0.0; 4]),
    Distortion::Fisheye([-0.013, 0.021, -0.019, 0.005]),
];

const fn rational(eight: [f64; 8], six: [f64; 6]) -> Distortion {
    let [k1, k2, p1, p2, k3, k4, k5, k6] = eight;
    let [s1, s2, s3, s4, tx, ty] = six;
    Distortion::Rational([k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4, tx, ty])
}

fn camera(distortion: Distortion) -> Intrinsics {
    Intrinsics {
        size_px: [640, 480],
        focal_px: DVec2::new(415.0, 413.0),
        center_px: DVec2::new(321.4, 238.2),
        distortion,
    }
}

/// Points in front of the camera, up to 42° from its axis; of a fisheye to 83°.
fn places_m(lens: &Distortion) -> Vec<DVec3> {
    let mut random = fastrand::Rng::with_seed(21);
    let most = match lens {
        Distortion::Fisheye(_) => 8.0,
        _ => 0.65,
    };
    let places = std::iter::repeat_with(|| {
        let mut side = || most * (2.0 * random.f64() - 1.0);
        DVec3::new(side(), side(), 1.0) * (0.2 + 2.0 * random.f64())
    });
    places.take(500).collect()
}

/// What OpenCV makes of the points.
fn opencvs_pixels(camera: &Intrinsics, places_m: &[DVec3]) -> Vec<DVec2> {
    let matrix = Mat::from_slice_2d(&[
        [camera.focal_px.x, 0.0, camera.center_px.x],
        [0.0, camera.focal_px.y, camera.center_px.y],
        [0.0, 0.0, 1.0],
    ])
    .unwrap();
    let coefficients = Vector::<f64>::from_slice(camera.distortion.coefficients());
    let points: Vector<Point3d> = places_m
        .iter()
        .map(|p| Point3d::new(p.x, p.y, p.z))
        .collect();
    let still = Vector::<f64>::from_slice(&[0.0; 3]);
    let mut pixels = Vector::<Point2d>::new();
    if let Distortion::Fisheye(_) = camera.distortion {
        opencv::calib3d::fisheye_project_points_vec(
            &points,
            &mut pixels,
            &Vec3d::default(),
            &Vec3d::default(),
            &matrix,
            &coefficients,
            0.0,
            &mut opencv::core::no_array(),
        )
        .unwrap();
    } else {
        opencv::calib3d::project_points_def(
            &points,
            &still,
            &still,
            &matrix,
            &coefficients,
            &mut pixels,
        )
        .unwrap();
    }
    pixels
        .iter()
        .map(|pixel| DVec2::new(pixel.x, pixel.y))
        .collect()
}

#[test]
fn projections_are_opencvs() {
    for lens in LENSES {
        let camera = camera(lens);
        let places_m = places_m(&lens);
        for (place_m, expected_px) in places_m.iter().zip(opencvs_pixels(&camera, &places_m)) {
            let found_px = camera.pixel_of(*place_m).unwrap();
            assert!(
                found_px.distance(expected_px) < 1e-8,
                "{lens:?} at {place_m}: {found_px}, OpenCV {expected_px}"
            );
            assert_eq!(camera.project(*place_m).unwrap().pixel, found_px);
        }
    }
}

#[test]
fn derivatives_are_what_small_steps_make() {
    const STEP_M: f64 = 1e-6;
    for lens in LENSES {
        let camera = camera(lens);
        for place_m in places_m(&lens).into_iter().chain([DVec3::Z]) {
            let moved = |by: DVec3| camera.pixel_of(place_m + by).unwrap();
            let found = camera.project(place_m).unwrap();
            for (axis, derivative) in DVec3::AXES.into_iter().zip(found.by_place) {
                let slope = (moved(axis * STEP_M) - moved(-axis * STEP_M)) / (2.0 * STEP_M);
                let off = slope.distance(derivative);
                assert!(
                    off < 1e-5 * (10.0 + slope.length()),
                    "{lens:?} {place_m}: {off}"
                );
            }
        }
    }
}

#[test]
fn undistorting_inverts_distorting() {
    for lens in LENSES {
        for place_m in places_m(&lens) {
            let point = place_m.truncate() / place_m.z;
            let found = lens.undistort(lens.distort(point));
            let off = found.map(|found| found.distance(point));
            assert!(
                off.is_some_and(|off| off < 1e-8 * (1.0 + point.length_squared())),
                "{lens:?} at {point}: {found:?}"
            );
        }
    }
}

/// Where the model turns back, a place has a point before the turn or none.
#[test]
fn nothing_is_found_beyond_the_turn() {
    let barrel = Distortion::Polynomial([-0.3, 0.05, 0.0, 0.0, 0.0]);
    let fisheye = Distortion::Fisheye([-0.2, 0.0, 0.0, 0.0]);
    let kinect = LENSES[1];
    let mut found_none = 0;
    for lens in [barrel, fisheye, kinect] {
        // The first place where a ray further out comes no further.
        let along = |radius: f64| lens.distort(DVec2::new(0.6, 0.8) * radius).length();
        let radii = (1..20_000).map(|k| f64::from(k) * 1e-3);
        let turn = radii.take_while(|radius| along(*radius) > along(radius - 1e-3));
        let turn = turn.last().unwrap();
        for k in 1..400 {
            let target = DVec2::new(0.6, 0.8) * (f64::from(k) * 0.01);
            match lens.undistort(target) {
                Some(point) => {
                    assert!(
                        lens.distort(point).distance(target) < 1e-9,
                        "{lens:?} {target}"
                    );
                    assert!(
                        point.length() < turn + 2e-3,
                        "{lens:?} {target}: {point}, turn {turn}"
                    );
                }
                None => {
                    assert!(
                        target.length() > along(turn) - 2e-3,
                        "{lens:?} {target}: none"
                    );
                    found_none += 1;
                }
            }
        }
    }
    assert!(found_none > 100);
}
