//! Frames of a folder of pictures, and the exposures that they carry.

use gnomon::capture::FrameSource;
use gnomon::capture::exposures::exif_exposure;

const NAMES: [&str; 4] = ["a.png", "a.jpg", "a.tif", "a.ppm"];

// The choice says which name the bytes get.
pub fn run(input: &[u8]) {
    if let Some((name, bytes)) = super::choice(input, NAMES.len()) {
        let path = super::file(NAMES[name], bytes);
        let _ = exif_exposure(&path);
        let source = path.to_str().map(FrameSource::open);
        if let Some(Ok(source)) = source {
            let mut source = source.as_taken();
            while let Ok(Some(_)) = source.next_frame() {}
        }
    }
}
