//! Arrays and matrices that other programs wrote, and broken ones.

use super::*;

/// What `numpy.savez`, `save` and `savetxt` wrote (NumPy 2.4): the matrix in rows and in columns, of 64 and 32 bits and whole
/// numbers, packed and not, beside a list of views.
#[test]
fn numpy_s_arrays_are_read() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/calibrations/numpy");
    let camera = |name: &str| {
        load_calibration_among(&folder.join(name), [640, 480])
            .unwrap()
            .0
    };
    for name in ["savez.npz", "packed.npz", "columns.npz", "whole.npz"] {
        let Intrinsics {
            focal_px,
            center_px,
            distortion,
            ..
        } = camera(name);
        assert_eq!(focal_px, DVec2::new(615.0, 613.0), "{name}");
        assert_eq!(center_px, DVec2::new(321.0, 238.0), "{name}");
        assert_eq!(distortion.coefficients()[0], 0.125, "{name}");
        assert_eq!(distortion.coefficients()[3], -0.25, "{name}");
    }
    for name in ["matrix.npy", "savetxt.txt"] {
        let read = camera(name);
        assert_eq!(read.focal_px, DVec2::new(615.0, 613.0), "{name}");
        assert_eq!(read.distortion, Distortion::NONE, "{name}");
    }
    // Cut off anywhere, or with any byte changed, it is refused or read, and no more.
    let whole = std::fs::read(folder.join("savez.npz")).unwrap();
    let path = tempfile::tempdir().unwrap();
    let path = path.path().join("broken.npz");
    for at in (0..whole.len()).step_by(7) {
        for bytes in [whole[..at].to_vec(), {
            let mut changed = whole.clone();
            changed[at] ^= 0xff;
            changed
        }] {
            std::fs::write(&path, bytes).unwrap();
            let _ = load_calibration_among(&path, [640, 480]);
        }
    }
    for deep in ["(", "[", "{0:", "-", "'", "((((((((0,"] {
        for times in [60, 160, 400, 5000] {
            let header = deep.repeat(times);
            let mut bytes = b"\x93NUMPY\x02\0".to_vec();
            bytes.extend((header.len() as u32).to_le_bytes());
            bytes.extend(header.as_bytes());
            std::fs::write(path.with_extension("npy"), bytes).unwrap();
            let refused = load_calibration_among(&path.with_extension("npy"), [640, 480]);
            assert!(refused.is_err(), "{deep} {times}");
        }
    }
    let pickle = load_calibration(&folder.join("camera.pkl"))
        .unwrap_err()
        .to_string();
    assert!(pickle.contains("numpy.savez"), "{pickle}");
}

/// KITTI's odometry: rectified cameras of the same lens, side by side, among turns and places.
#[test]
fn kitti_s_projections_are_read() {
    let line = |name: &str, shift: &str| {
        format!(
            "{name}: 7.18856e+02 0.0 6.071928e+02 {shift} 0.0 7.18856e+02 1.852157e+02 0.0 0.0 0.0 1.0 0.0\n"
        )
    };
    let text = line("P0", "0.0") + &line("P1", "-3.861448e+02") + "Tr: 1 0 0 0 0 1 0 0 0 0 1 0\n";
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("calib.txt");
    std::fs::write(&path, text).unwrap();
    let read = load_calibration_among(&path, [1241, 376]).unwrap().0;
    assert_eq!(read.focal_px, DVec2::splat(718.856));
    assert_eq!(read.center_px, DVec2::new(607.1928, 185.2157));
}
