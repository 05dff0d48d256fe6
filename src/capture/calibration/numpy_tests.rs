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

/// An archive of arrays, each of a type, a shape and its bytes.
fn archive(arrays: &[(&str, &str, &str, Vec<u8>)]) -> Vec<u8> {
    let mut writer = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
    for (name, kind, shape, data) in arrays {
        let header = format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': {shape}, }}\n");
        let options = zip::write::SimpleFileOptions::default();
        writer.start_file(format!("{name}.npy"), options).unwrap();
        let length = (header.len() as u16).to_le_bytes();
        for part in [b"\x93NUMPY\x01\0", &length[..], header.as_bytes(), data] {
            std::io::Write::write_all(&mut writer, part).unwrap();
        }
    }
    writer.finish().unwrap().into_inner()
}

/// Coefficients of half the precision, and the truths and texts that name a lens's model.
#[test]
fn halves_truths_and_texts_of_numpy_s_are_read() {
    let doubles = |numbers: &[f64]| numbers.iter().flat_map(|n| n.to_le_bytes()).collect();
    let halves = [0.125, -0.25, 0.0, 0.5].map(|number| half::f16::from_f64(number).to_le_bytes());
    let text = |text: &str| {
        text.chars()
            .flat_map(|c| u32::from(c).to_le_bytes())
            .collect()
    };
    let matrix = (
        "mtx",
        "<f8",
        "(3, 3)",
        doubles(&[615.0, 0.0, 320.0, 0.0, 615.0, 240.0, 0.0, 0.0, 1.0]),
    );
    let dist = ("dist", "<f2", "(1, 4)", halves.concat());
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.npz");
    let read = |arrays: &[(&str, &str, &str, Vec<u8>)]| {
        std::fs::write(&path, archive(arrays)).unwrap();
        load_calibration_among(&path, [640, 480])
            .map(|(read, _)| read.distortion)
            .map_err(|error| error.to_string())
    };
    let plain = Distortion::Polynomial([0.125, -0.25, 0.0, 0.5, 0.0]);
    let fisheye = Distortion::Fisheye([0.125, -0.25, 0.0, 0.5]);
    for (model, expected) in [
        (("fisheye", "|b1", "()", vec![1]), &fisheye),
        (("fisheye", "|b1", "()", vec![0]), &plain),
        (("model", "<U7", "()", text("fisheye")), &fisheye),
        (("model", "|S7", "()", b"fisheye".to_vec()), &fisheye),
        (("note", "<U3", "()", text("lab")), &plain),
    ] {
        let arrays = [matrix.clone(), dist.clone(), model];
        assert_eq!(read(&arrays).as_ref(), Ok(expected), "{arrays:?}");
    }
    for (other, part) in [
        (
            ("model", "<U3", "()", text("mei")),
            "'mei' is not supported",
        ),
        (("dist", "<c8", "(4,)", vec![0; 32]), "dist must be a list"),
        (
            ("dist_x", "<f8", "(1,)", doubles(&[1.0])),
            "dist_x is not understood",
        ),
    ] {
        let said = read(&[matrix.clone(), other]).unwrap_err();
        assert!(said.contains(part), "{said}");
    }
}
